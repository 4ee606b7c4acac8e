//! Host part of `shade.wgsl`: lights the colours of a hand.

use super::{BackwardBuffers, ForwardBuffers, LitSurface};
use crate::pipeline::{Bound, Module};
use crate::{Gpu, RenderError, buffers};

/// From unlit colours to those in the splatter's table.
pub struct Shade {
    buffers: ShadeBuffers,
    light_colors: Bound,
    count: u32,
    frames: usize,
}

struct ShadeBuffers {
    vertex_count: usize,
    corners: wgpu::Buffer,
    barycentric: wgpu::Buffer,
    vertex_shades: wgpu::Buffer,
}

impl ShadeBuffers {
    fn named(&self) -> [(&str, &wgpu::Buffer); 3] {
        [("corners", &self.corners), ("barycentric", &self.barycentric), ("vertex_shades", &self.vertex_shades)]
    }

    fn bind(&self, gpu: &Gpu, stage: &'static str, others: &[(&str, &wgpu::Buffer)]) -> Bound {
        let constants = [("VERTEX_COUNT", self.vertex_count as f64)];
        Module::new(gpu, "shade").stage(gpu, stage, &constants).bind(gpu, &[&self.named()[..], others].concat())
    }
}

impl Shade {
    /// All shades are 1 until they are set.
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, surface: &LitSurface<'_>, frames: usize) -> Shade {
        let columns = |get: &dyn Fn(usize) -> u32| -> Vec<u32> { (0..3 * surface.corners.len()).map(get).collect() };
        let count = surface.corners.len().max(1);
        let corners = columns(&|i| surface.corners[i % count][i / count]);
        let barycentric = columns(&|i| surface.barycentric[i % count][i / count].to_bits());
        let buffers = ShadeBuffers {
            vertex_count: surface.vertex_count,
            corners: buffers::filled(gpu, "corners", &corners),
            barycentric: buffers::filled(gpu, "barycentric", &barycentric),
            vertex_shades: buffers::filled(gpu, "vertex shades", &vec![1.0f32; frames * surface.vertex_count * 3]),
        };
        let others = [&b.named()[..], &[("color", &b.properties.color)]].concat();
        let light_colors = buffers.bind(gpu, "light_colors", &others);
        Shade { buffers, light_colors, count: b.properties.sizes.gaussians as u32, frames }
    }

    /// Sets the shades of a frame, one RGB per vertex.
    pub fn set(&self, gpu: &Gpu, frame: usize, shades: &[[f32; 3]]) -> Result<(), RenderError> {
        let vertices = self.buffers.vertex_count;
        if frame >= self.frames || shades.len() != vertices {
            let (given, frames) = (shades.len(), self.frames);
            let problem = format!("{given} shades for {vertices} vertices in frame {frame} of {frames}");
            return Err(RenderError::Invalid(problem));
        }
        let offset = frame * vertices * size_of::<[f32; 3]>();
        gpu.queue.write_buffer(&self.buffers.vertex_shades, offset as u64, bytemuck::cast_slice(shades));
        Ok(())
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.light_colors.dispatch_invocations(pass, self.count);
    }
}

/// From the gradients of the colours in the table to those of the unlit ones.
pub struct ShadeBackward {
    light_colors: Bound,
    count: u32,
}

impl ShadeBackward {
    pub fn new(gpu: &Gpu, forward: &Shade, b: &ForwardBuffers, d: &BackwardBuffers) -> ShadeBackward {
        let others = [&b.named()[..], &d.named()[..], &[("d_color", &d.gradients.color)]].concat();
        ShadeBackward {
            light_colors: forward.buffers.bind(gpu, "light_colors_backward", &others),
            count: forward.count,
        }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.light_colors.dispatch_invocations(pass, self.count);
    }
}
