//! Host part of `shade.wgsl`: lights the colours of a hand.

use super::{BackwardBuffers, ForwardBuffers, LitSurface};
use ghand_render::bindings::ComputeEntry;
use ghand_render::pipeline::{Bound, Module, Stage};
use ghand_render::stages::{LightColors, LightColorsBackward, LightColorsBackwardBindings, LightColorsBindings};
use ghand_render::{Gpu, RenderError, buffers};

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
    /// A single number if nothing is glossy.
    vertex_gloss: wgpu::Buffer,
    glossy: bool,
    color_row: u64,
}

impl ShadeBuffers {
    fn stage<E: ComputeEntry>(&self, gpu: &Gpu) -> Stage<E> {
        let constants = [
            ("VERTEX_COUNT", self.vertex_count as f64),
            ("GLOSSY", f64::from(u8::from(self.glossy))),
            ("ROW_COLOR", self.color_row as f64),
        ];
        Module::new(gpu, "shade").stage(gpu, &constants)
    }
}

impl Shade {
    /// All shades are 1, and all gloss is 0, until they are set.
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, surface: &LitSurface<'_>, color_row: u64, frames: usize) -> Shade {
        let columns = |get: &dyn Fn(usize) -> u32| -> Vec<u32> { (0..3 * surface.corners.len()).map(get).collect() };
        let count = surface.corners.len().max(1);
        let corners = columns(&|i| surface.corners[i % count][i / count]);
        let barycentric = columns(&|i| surface.barycentric[i % count][i / count].to_bits());
        let buffers = ShadeBuffers {
            vertex_count: surface.vertex_count,
            corners: buffers::filled(gpu, "corners", &corners),
            barycentric: buffers::filled(gpu, "barycentric", &barycentric),
            vertex_shades: buffers::filled(gpu, "vertex shades", &vec![1.0f32; frames * surface.vertex_count * 3]),
            vertex_gloss: buffers::zeroed(
                gpu,
                "vertex gloss",
                if surface.glossy { 3 * surface.vertex_count } else { 1 },
            ),
            glossy: surface.glossy,
            color_row,
        };
        let light_colors = buffers.stage::<LightColors>(gpu).bind(
            gpu,
            &LightColorsBindings {
                pose: &b.pose,
                corners: &buffers.corners,
                barycentric: &buffers.barycentric,
                vertex_shades: &buffers.vertex_shades,
                color: &b.properties.color,
                gaussians: &b.gaussians,
                vertex_gloss: &buffers.vertex_gloss,
            },
        );
        Shade { buffers, light_colors, count: b.properties.sizes.gaussians as u32, frames }
    }

    /// Sets the shades of a frame, one RGB per vertex.
    pub fn set(&self, gpu: &Gpu, frame: usize, shades: &[[f32; 3]]) -> Result<(), RenderError> {
        let vertices = self.buffers.vertex_count;
        if frame >= self.frames || shades.len() != vertices {
            let given = shades.len();
            let frames = self.frames;
            let problem = format!("{given} shades for {vertices} vertices in frame {frame} of {frames}");
            return Err(RenderError::Invalid(problem));
        }
        let offset = frame * vertices * size_of::<[f32; 3]>();
        gpu.queue.write_buffer(&self.buffers.vertex_shades, offset as u64, bytemuck::cast_slice(shades));
        Ok(())
    }

    /// Sets the gloss of the frame and view to be drawn, one RGB per vertex, linear light.
    pub fn set_gloss(&self, gpu: &Gpu, gloss: &[[f32; 3]]) -> Result<(), RenderError> {
        let vertices = self.buffers.vertex_count;
        if !self.buffers.glossy || gloss.len() != vertices {
            let what = if self.buffers.glossy { "" } else { " of a hand without gloss" };
            return Err(RenderError::Invalid(format!("gloss of {} for {vertices} vertices{what}", gloss.len())));
        }
        gpu.queue.write_buffer(&self.buffers.vertex_gloss, 0, bytemuck::cast_slice(gloss));
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
        let buffers = &forward.buffers;
        let light_colors = buffers.stage::<LightColorsBackward>(gpu).bind(
            gpu,
            &LightColorsBackwardBindings {
                pose: &b.pose,
                corners: &buffers.corners,
                barycentric: &buffers.barycentric,
                vertex_shades: &buffers.vertex_shades,
                color: &b.properties.color,
                d_gaussians: &d.d_gaussians,
                d_color: &d.gradients.color,
                vertex_gloss: &buffers.vertex_gloss,
            },
        );
        ShadeBackward { light_colors, count: forward.count }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.light_colors.dispatch_invocations(pass, self.count);
    }
}
