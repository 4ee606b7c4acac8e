//! Draws a subject to an image on the device: Gaussians by the splatter, the mesh of a hand without an avatar by the
//! rasteriser.

use std::sync::Arc;

use ghand_avatar::Scene;
use ghand_avatar::scene::OPACITY;
use ghand_core::{Camera, Pose};
use ghand_pictures::Picture;
use ghand_render::mesh::{MeshError, MeshRenderer, MeshStyle, NEAR_PLANE};
use ghand_render::splat::{Counters, FrameStage, Shape, SplatModel, View};
use ghand_render::timing::FrameClock;
use ghand_render::{Gpu, RenderError};
use glam::{DVec2, DVec3};

use crate::bare_hand::{BareHand, PosedMesh, studio_light};
use crate::viewer::rendering::frame::{PictureInputs, STAGES};
use ghand_avatar::pose_properties::PoseProperties;

/// Samples per pixel along each axis.
const SUPERSAMPLE: u32 = 2;

/// The colours of an avatar's Gaussians.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum GaussianColors {
    /// Its own in its light.
    #[default]
    Own,
    /// Its own without light.
    Unlit,
    /// These display values, `[3][N]`.
    Given(Vec<f32>),
    /// Its own in its light, on dots at the centres of the Gaussians.
    Dots,
}

/// Standard deviation of a dot at a Gaussian's centre, metres: a small part of the distance between Gaussians, which is about
/// a millimetre.
const DOT_SCALE: f32 = 1.5e-4;

/// Numbers of the first and the last stage of [`STAGES`] that ends in a drawing.
const POSED: u32 = 1;
const BLENDED: u32 = STAGES.len() as u32 - 1;

/// A subject on the device.
pub enum Drawing {
    /// Gaussians, posed or static.
    Gaussians(Box<Scene>),
    /// A mesh.
    Mesh(Box<MeshDrawing>),
}

/// The mesh of a hand without an avatar.
pub struct MeshDrawing {
    hand: Arc<BareHand>,
    renderer: MeshRenderer,
}

/// An image on the device.
pub struct Layer {
    /// Its pixels, row-major `vec4<f32>`, premultiplied.
    pub image: wgpu::Buffer,
    /// Its left column and top row in the picture.
    pub origin: [u32; 2],
    /// Its columns and rows.
    pub size: [u32; 2],
}

impl Drawing {
    /// A hand's mesh.
    ///
    /// # Errors
    /// [`RenderError`] if the device rejects the shaders.
    pub fn mesh(gpu: &Gpu, hand: Arc<BareHand>) -> Result<Drawing, RenderError> {
        let renderer = MeshRenderer::new(gpu).map_err(render_error)?;
        Ok(Drawing::Mesh(Box::new(MeshDrawing { hand, renderer })))
    }

    /// Encodes an image, with the ends of all stages but the last. Colours are those of Gaussians; a mesh has its own.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or lacks memory, or the pose, the shape or the size does not fit.
    pub fn encode(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        inputs: &PictureInputs,
        colors: &GaussianColors,
        clock: Option<&FrameClock>,
    ) -> Result<Layer, RenderError> {
        let timestamps = |stage: FrameStage| Some(clock?.pass(number(stage)?));
        let posed = |encoder: &mut wgpu::CommandEncoder| clock.iter().for_each(|clock| clock.mark(encoder, POSED));
        match self {
            Drawing::Gaussians(scene) => {
                set_inputs(scene, gpu, inputs)?;
                scene.set_view(gpu, &inputs.camera, [0.0; 3])?;
                if *colors == GaussianColors::Own {
                    scene.encode_timed(gpu, encoder, posed, timestamps)?;
                } else {
                    // The colours are written behind the posing, which is therefore submitted first and not in the times.
                    scene.pose_only(gpu, 0, Some(inputs.camera.center()))?;
                    set_colors(scene, gpu, encoder, colors);
                    posed(encoder);
                    scene.splatter().forward_timed(encoder, timestamps);
                }
                let image = scene.splatter().image().clone();
                let camera = &inputs.camera;
                Ok(Layer { image, origin: [0; 2], size: [camera.width, camera.height] })
            }
            Drawing::Mesh(mesh) => {
                // The processor poses a mesh, and drawing it is one stage.
                clock.iter().for_each(|clock| (POSED..BLENDED).for_each(|stage| clock.mark(encoder, stage)));
                let layer = mesh.encode(encoder, inputs)?;
                clock.iter().for_each(|clock| clock.mark(encoder, BLENDED));
                Ok(layer)
            }
        }
    }

    /// The Gaussians of an avatar in a pose, metres, world, N; none of a mesh. Waits for them.
    ///
    /// # Errors
    /// As [`Drawing::encode`].
    pub fn posed_gaussians(&mut self, gpu: &Gpu, pose: &Pose) -> Result<Vec<DVec3>, RenderError> {
        let Drawing::Gaussians(scene) = self else { return Ok(Vec::new()) };
        scene.set_pose(gpu, 0, 0, pose)?;
        let table = scene.posed_table(gpu, 0)?;
        let mut rows = table.chunks_exact(scene.splatter().count().max(1));
        let [x, y, z] = [(); 3].map(|()| rows.next().unwrap_or_default());
        Ok(x.iter().zip(y).zip(z).map(|((x, y), z)| glam::Vec3::new(*x, *y, *z).as_dvec3()).collect())
    }

    /// What an avatar has learned, in a pose; `None` of other subjects. Waits for it.
    ///
    /// # Errors
    /// As [`Drawing::encode`].
    pub fn properties(&mut self, gpu: &Gpu, pose: &Pose) -> Result<Option<PoseProperties>, RenderError> {
        match self {
            Drawing::Gaussians(scene) if !scene.avatars().is_empty() => {
                scene.set_pose(gpu, 0, 0, pose)?;
                scene.pose_only(gpu, 0, None)?;
                let posed = scene.avatars().first();
                posed.map(|posed| PoseProperties::read(gpu, posed.deformation.properties())).transpose()
            }
            Drawing::Gaussians(_) | Drawing::Mesh(_) => Ok(None),
        }
    }

    /// Fills a picture of any size with an image, in bands if it is large, and waits for it. The picture's background counts, not
    /// that of the inputs.
    ///
    /// # Errors
    /// As [`Drawing::encode`].
    pub fn fill(
        &mut self,
        gpu: &Gpu,
        inputs: &PictureInputs,
        colors: &GaussianColors,
        picture: &mut Picture,
    ) -> Result<(), RenderError> {
        match self {
            Drawing::Gaussians(scene) => {
                set_inputs(scene, gpu, inputs)?;
                scene.pose_only(gpu, 0, Some(inputs.camera.center()))?;
                let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                set_colors(scene, gpu, &mut encoder, colors);
                gpu.queue.submit([encoder.finish()]);
                let count = scene.splatter().count();
                let view = View::new(&inputs.camera, count, picture.background().color(), OPACITY);
                scene.splatter_mut().render_bands(gpu, view, |row, band| picture.place([0, row], band))
            }
            Drawing::Mesh(mesh) => {
                let posed = mesh.posed(inputs)?;
                let instance = mesh.hand.instance(&posed);
                let style = mesh_style(&inputs.camera);
                let image = mesh.renderer.render(&instance, &inputs.camera, &style).map_err(render_error)?;
                picture.place_mesh([0; 2], &image);
                Ok(())
            }
        }
    }

    /// The counters of an image of Gaussians.
    pub fn counters(&self) -> Option<&wgpu::Buffer> {
        match self {
            Drawing::Gaussians(scene) => Some(scene.splatter().counters()),
            Drawing::Mesh(_) => None,
        }
    }

    /// Whether an image with these counters is complete; if not, there is now enough memory for it.
    ///
    /// # Errors
    /// As in [`ghand_render::splat::Splatter::complete_for`].
    pub fn complete_for(&mut self, gpu: &Gpu, counters: &Counters) -> Result<bool, RenderError> {
        match self {
            Drawing::Gaussians(scene) => scene.splatter_mut().complete_for(gpu, counters),
            Drawing::Mesh(_) => Ok(true),
        }
    }

    /// What it consists of, and how many.
    pub fn size(&self) -> (&'static str, usize) {
        match self {
            Drawing::Gaussians(scene) => ("Gaussians", scene.splatter().count()),
            Drawing::Mesh(mesh) => ("Triangles", mesh.hand.model.faces.len()),
        }
    }
}

/// Number in [`STAGES`], counted from 1, of the stage that ends with a pass of the splatter.
fn number(stage: FrameStage) -> Option<u32> {
    match stage {
        FrameStage::Project => Some(2),
        FrameStage::SortDepth => Some(3),
        FrameStage::FindRanges => Some(4),
        FrameStage::Rasterize => Some(BLENDED),
        // Parts of the lists by tile, and stages of gradients.
        FrameStage::Bin
        | FrameStage::SortTiles
        | FrameStage::NumberSlots
        | FrameStage::RasterizeBackward
        | FrameStage::ProjectBackward => None,
    }
}

/// Sets the light and the pose of a scene.
fn set_inputs(scene: &mut Scene, gpu: &Gpu, inputs: &PictureInputs) -> Result<(), RenderError> {
    if let Some(light) = &inputs.light {
        scene.avatars_mut().iter_mut().for_each(|avatar| avatar.set_light(light));
    }
    inputs.pose.as_ref().map_or(Ok(()), |pose| scene.set_pose(gpu, 0, 0, pose))
}

/// Replaces the colours of posed Gaussians.
fn set_colors(scene: &Scene, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, colors: &GaussianColors) {
    let splatter = scene.splatter();
    let row_bytes = (size_of::<f32>() * scene.splatter().count()) as u64;
    let first = splatter.options().model.color_row() as u64 * row_bytes;
    match (colors, scene.avatars().first()) {
        (GaussianColors::Unlit, Some(avatar)) => {
            let unlit = &avatar.deformation.properties().color;
            encoder.copy_buffer_to_buffer(unlit, 0, splatter.gaussians(), first, 3 * row_bytes);
        }
        (GaussianColors::Given(colors), Some(_)) => {
            gpu.queue.write_buffer(splatter.gaussians(), first, bytemuck::cast_slice(colors));
        }
        (GaussianColors::Dots, Some(_)) => {
            let model = splatter.options().model;
            let count = splatter.count();
            let scales = vec![DOT_SCALE; count * model.scale_rows()];
            let place = SplatModel::SCALE_ROW as u64 * row_bytes;
            gpu.queue.write_buffer(splatter.gaussians(), place, bytemuck::cast_slice(&scales));
            if model.shape == Shape::Flat {
                // Without a normal, a flat Gaussian is round.
                let normals = vec![0f32; 3 * count];
                let place = model.rotation_row() as u64 * row_bytes;
                gpu.queue.write_buffer(splatter.gaussians(), place, bytemuck::cast_slice(&normals));
            }
        }
        _ => {}
    }
}

impl MeshDrawing {
    fn posed(&self, inputs: &PictureInputs) -> Result<PosedMesh, RenderError> {
        let Some(pose) = &inputs.pose else { return Err(RenderError::Invalid("a hand needs a pose".into())) };
        self.hand.posed(&inputs.shape, pose).map_err(|e| RenderError::Invalid(e.to_string()))
    }

    fn encode(&self, encoder: &mut wgpu::CommandEncoder, inputs: &PictureInputs) -> Result<Layer, RenderError> {
        let posed = self.posed(inputs)?;
        let instance = self.hand.instance(&posed);
        let style = mesh_style(&inputs.camera);
        // Without the empty part of the picture: most of the time goes into pixels.
        let (origin, size) = part_with(instance.positions, &inputs.camera);
        let camera = inputs.camera.cropped(origin[0] as i32, origin[1] as i32, size[0], size[1]);
        let image = self.renderer.encode(encoder, &instance, &camera, &style).map_err(render_error)?;
        Ok(Layer { image, origin, size })
    }
}

fn mesh_style(camera: &Camera) -> MeshStyle {
    MeshStyle { supersample: SUPERSAMPLE, shading: studio_light(camera), wireframe: None }
}

/// The part of a picture, left column and top row, columns and rows, that shows points; at least one pixel.
fn part_with(points: &[DVec3], camera: &Camera) -> ([u32; 2], [u32; 2]) {
    let whole = [camera.width, camera.height];
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for point in points {
        let (pixel, z) = camera.project(*point);
        if z <= NEAR_PLANE {
            return ([0; 2], whole);
        }
        (low, high) = (low.min(pixel), high.max(pixel));
    }
    let limit = |v: f64, edge: u32| v.clamp(0.0, f64::from(edge)) as u32;
    let origin = [limit(low.x.floor(), whole[0] - 1), limit(low.y.floor(), whole[1] - 1)];
    let end = [limit(high.x.ceil(), whole[0]), limit(high.y.ceil(), whole[1])];
    (origin, [0, 1].map(|axis| end[axis].saturating_sub(origin[axis]).max(1)))
}

fn render_error(error: MeshError) -> RenderError {
    match error {
        MeshError::Device(error) => error,
        invalid @ MeshError::Invalid { .. } => RenderError::Invalid(invalid.to_string()),
    }
}
