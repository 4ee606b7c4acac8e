//! Draws images of the splatter and of the mesh rasteriser into a render pass, also into somebody else's. Host part of
//! `texture_pass.wgsl`.

use bytemuck::{Pod, Zeroable};

use crate::bindings::RenderBindings;
use crate::shader_sources::Shader;
use crate::splat::Splatter;
use crate::stages::TexturePassBindings;
use crate::{Gpu, RenderError, buffers, stages};

/// See `shaders/texture_pass.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Place {
    /// The image's left column and top row in the target.
    pub origin: [u32; 2],
    /// Its columns and rows.
    pub size: [u32; 2],
    /// Colour behind the image if the target is replaced, display values.
    pub background: [f32; 4],
    /// The target's depth is x + y / z.
    pub depth_from_z: [f32; 2],
    /// Unused.
    pub padding: [u32; 2],
}

/// What a pass draws to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Format of the colour texture. Formats without sRGB conversion get display values, see [`Target::linear`].
    pub format: wgpu::TextureFormat,
    /// Whether the texture holds linear light, as sRGB formats do for shaders, and most textures with high dynamic range.
    pub linear: bool,
    /// Samples per pixel of the render pass.
    pub samples: u32,
    /// Whether the image replaces what is there, over its background, instead of covering it.
    pub replace: bool,
    /// The depth of the render pass, if it has one.
    pub depth: Option<DepthTarget>,
}

impl Target {
    /// A colour texture of this format, one sample per pixel, without depth; the image covers what is there.
    pub fn color(format: wgpu::TextureFormat) -> Target {
        Target { format, linear: format.is_srgb(), samples: 1, replace: false, depth: None }
    }
}

/// The depth texture of a render pass. The splats and what is drawn with the same depths hide each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthTarget {
    /// Its format.
    pub format: wgpu::TextureFormat,
    /// When a pixel is drawn.
    pub compare: wgpu::CompareFunction,
    /// Whether the depth of the splats is written. The soft edges of a hand then hide what is drawn behind them later.
    pub write: bool,
    /// The depth in the texture is x + y / z, where z is the distance from the camera along its axis, metres.
    pub depth_from_z: [f32; 2],
}

impl DepthTarget {
    /// Depths from 0 at the near plane to 1 at the far plane, metres, compared by `Less`.
    pub fn near_to_far(format: wgpu::TextureFormat, near: f32, far: f32) -> DepthTarget {
        let scale = far / (far - near);
        let compare = wgpu::CompareFunction::Less;
        DepthTarget { format, compare, write: true, depth_from_z: [scale, -near * scale] }
    }

    /// Reversed depths: 1 at the near plane, metres, and 0 at infinity, compared by `Greater`.
    pub fn reversed(format: wgpu::TextureFormat, near: f32) -> DepthTarget {
        DepthTarget { format, compare: wgpu::CompareFunction::Greater, write: true, depth_from_z: [0.0, near] }
    }
}

/// Draws images into render passes with one kind of target.
pub struct TexturePass {
    target: Target,
    pipeline: wgpu::RenderPipeline,
    bindings: RenderBindings<stages::TexturePass>,
}

/// An image with its place in the target.
#[derive(Debug)]
pub struct ImageLayer {
    group: wgpu::BindGroup,
    place: wgpu::Buffer,
}

impl TexturePass {
    /// A pass for this kind of target.
    ///
    /// # Errors
    /// [`RenderError::Device`] if the device rejects it, such as for a format that it cannot blend.
    pub fn new(gpu: &Gpu, target: Target) -> Result<TexturePass, RenderError> {
        gpu.scoped("a pass that draws images", || TexturePass::make(&gpu.device, target))
    }

    fn make(device: &wgpu::Device, target: Target) -> TexturePass {
        let module = Shader::named("texture_pass").module(device);
        let flag = |on: bool| f64::from(u8::from(on));
        let constants = [("LINEAR", flag(target.linear)), ("REPLACE", flag(target.replace))];
        let compilation_options =
            wgpu::PipelineCompilationOptions { constants: &constants, ..wgpu::PipelineCompilationOptions::default() };
        let entry = if target.depth.is_some() { "draw_deep_image" } else { "draw_image" };
        let blend = if target.replace { None } else { Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING) };
        let write_mask = wgpu::ColorWrites::ALL;
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("texture pass"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("cover"),
                compilation_options: compilation_options.clone(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: target.depth.map(|depth| wgpu::DepthStencilState {
                format: depth.format,
                depth_write_enabled: Some(depth.write),
                depth_compare: Some(depth.compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState { count: target.samples, ..wgpu::MultisampleState::default() },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(entry),
                compilation_options,
                targets: &[Some(wgpu::ColorTargetState { format: target.format, blend, write_mask })],
            }),
            multiview_mask: None,
            cache: None,
        });
        TexturePass { target, pipeline, bindings: RenderBindings::new(&["cover", entry]) }
    }

    /// The image of a splatter, whose view must have a black background. It stays valid as long as the splatter.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the target has a depth, but the splatter renders none ([`crate::splat::SplatOptions`]).
    pub fn layer(&self, gpu: &Gpu, splatter: &Splatter) -> Result<ImageLayer, RenderError> {
        if self.target.depth.is_some() && !splatter.options().depth {
            return Err(RenderError::Invalid("a pass with depth needs a splatter with `depth: true`".into()));
        }
        Ok(self.image_layer(gpu, splatter.image(), splatter.depths()))
    }

    /// Any image: pixels `vec4<f32>`, row-major, premultiplied display values; camera z of each, metres, for targets with a
    /// depth.
    pub fn image_layer(&self, gpu: &Gpu, image: &wgpu::Buffer, depths: &wgpu::Buffer) -> ImageLayer {
        let place = buffers::uniform(gpu, "place", &Place::zeroed());
        let bindings = TexturePassBindings { image, depths, place: &place };
        ImageLayer { group: self.bindings.group(&gpu.device, &self.pipeline, &bindings), place }
    }

    /// Sets where later submissions draw a layer: left column and top row in the target; the image's columns and rows, as
    /// in the view of the splatter; the colour behind it, display values, if the target is replaced.
    pub fn set_place(&self, gpu: &Gpu, layer: &ImageLayer, origin: [u32; 2], size: [u32; 2], background: [f32; 3]) {
        let [r, g, b] = background;
        let depth_from_z = self.target.depth.map_or([0.0; 2], |depth| depth.depth_from_z);
        let place = Place { origin, size, background: [r, g, b, 1.0], depth_from_z, padding: [0; 2] };
        gpu.queue.write_buffer(&layer.place, 0, bytemuck::bytes_of(&place));
    }

    /// Draws a layer. The splatter's commands must come before the render pass.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, layer: &ImageLayer) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &layer.group, &[]);
        pass.draw(0..3, 0..1);
    }
}
