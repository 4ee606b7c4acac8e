//! A scene of posed avatars, and the protocol for rendering its frames.
//!
//! A frame takes these steps: set poses ([`Scene::set_pose`], [`Scene::set_frame`]), set a view ([`Scene::set_view`]),
//! encode the commands ([`Scene::encode`]), and, once the device has run them, check whether the frame was complete
//! ([`Splatter::complete_for`]). If not, the buffers have grown, and the frame is encoded again. [`Scene::run_frame`]
//! does this and waits; a window submits the commands and checks later.

use crate::deform::TablePlace;
use ghand_core::{Camera, Pose};
use ghand_render::splat::{Counters, FrameStage, Image, Purpose, Shape, SplatModel, SplatOptions, Splatter, View};
use ghand_render::{Gpu, RenderError, buffers};
use glam::{DMat3, DVec3};

use crate::avatar::Avatar;
use crate::posed_avatar::PosedAvatar;
use crate::scene_files::SplatScene;
use crate::template::GaussianShape;

/// Opacity of every Gaussian of an avatar; fixed, as in the paper.
pub const OPACITY: f32 = 1.0;

/// The contents of one splatter: any number of posed avatars, or static Gaussians.
///
/// ```no_run
/// use ghand_avatar::{Avatar, Scene};
/// use ghand_core::Pose;
/// use ghand_render::splat::Purpose;
/// use ghand_render::{AdapterChoice, Gpu};
/// # fn camera() -> ghand_core::Camera { unimplemented!() }
///
/// let avatar = Avatar::load("out/train/avatar.ghand".as_ref())?;
/// let gpu = Gpu::new(&AdapterChoice::from_env())?;
/// let mut scene = Scene::new(&gpu, &[&avatar], Purpose::Images, 1, [640, 480])?;
/// scene.set_pose(&gpu, 0, 0, &Pose::rest(avatar.model.joint_count()))?;
/// let image = scene.render(&gpu, 0, &camera(), [0.0; 3])?;
/// assert_eq!(image.rgba.len(), 640 * 480);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Scene {
    splatter: Splatter,
    avatars: Vec<PosedAvatar>,
    /// Where the view is taken from, metres, world axes.
    eye: Option<DVec3>,
}

/// Encodes the posing of all avatars, which fills the splatter's table for the frame as an eye sees it.
fn encode_poses(
    avatars: &mut [PosedAvatar],
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    eye: Option<DVec3>,
) -> Result<(), RenderError> {
    avatars.iter_mut().try_for_each(|avatar| avatar.encode(gpu, encoder, eye))
}

/// The kind of the avatars' Gaussians. The splatter draws all of them in one way.
pub(crate) fn splat_model(avatars: &[&Avatar]) -> Result<SplatModel, RenderError> {
    let filter = |avatar: &&Avatar| avatar.config.filter();
    let first = avatars.first().map(filter);
    if let Some(other) = avatars.iter().position(|avatar| Some(filter(avatar)) != first) {
        let name = |avatar: &Avatar| match (avatar.config.antialias, avatar.config.narrow_blur) {
            (false, _) => "without antialiasing",
            (true, false) => "with the antialiasing of an earlier version",
            (true, true) => "with antialiasing",
        };
        return Err(RenderError::Invalid(format!(
            "avatar 0 was trained {} and avatar {other} {}, so one scene cannot show both; train one of them again",
            name(avatars[0]),
            name(avatars[other])
        )));
    }
    let [antialias, narrow] =
        avatars.first().map_or([false; 2], |avatar| [avatar.config.antialias, avatar.config.narrow_blur]);
    // Without a normal, a flat Gaussian is round.
    let flat = avatars.iter().any(|avatar| avatar.config.gaussians == GaussianShape::Flat);
    let shape = if flat { Shape::Flat } else { Shape::Isotropic };
    Ok(SplatModel { shape, antialias, narrow: antialias && narrow, ..SplatModel::HAND })
}

impl Scene {
    /// Puts avatars on the device, each with space for `frames` poses, for images of at most `max_size` pixels.
    /// Rendering without gradients needs far less memory.
    ///
    /// # Errors
    /// [`RenderError`] if the device has too little memory or was lost; [`RenderError::Invalid`] if some avatars are
    /// antialiased and others are not.
    pub fn new(
        gpu: &Gpu,
        avatars: &[&Avatar],
        purpose: Purpose,
        frames: usize,
        max_size: [u32; 2],
    ) -> Result<Scene, RenderError> {
        Scene::with_options(gpu, avatars, frames, max_size, SplatOptions { purpose, ..SplatOptions::default() })
    }

    /// As [`Scene::new`], with a splatter of these options: with depths, other thresholds, the largest weights. Their kind
    /// of Gaussians is replaced by that of the avatars.
    ///
    /// # Errors
    /// As [`Scene::new`].
    pub fn with_options(
        gpu: &Gpu,
        avatars: &[&Avatar],
        frames: usize,
        max_size: [u32; 2],
        options: SplatOptions,
    ) -> Result<Scene, RenderError> {
        let options = SplatOptions { model: splat_model(avatars)?, ..options };
        let columns = avatars.iter().map(|a| a.template.len()).sum();
        let shape = options.model.shape;
        let splatter = Splatter::new(gpu, options, columns, max_size)?;
        let mut first = 0;
        let mut posed = Vec::new();
        for avatar in avatars {
            let count = avatar.template.len();
            let what = format!("an avatar of {count} Gaussians with {frames} poses");
            let place = TablePlace { columns, first, shape };
            posed.push(gpu.scoped(&what, || PosedAvatar::new(gpu, avatar, frames, splatter.gaussians(), place))??);
            first += count;
        }
        Ok(Scene { splatter, avatars: posed, eye: None })
    }

    /// Puts static Gaussians on the device, for images of at most `max_size` pixels.
    ///
    /// # Errors
    /// As [`Scene::new`].
    pub fn of_static_gaussians(gpu: &Gpu, splats: &SplatScene, max_size: [u32; 2]) -> Result<Scene, RenderError> {
        let options = SplatOptions { model: splats.model(), purpose: Purpose::Images, ..SplatOptions::default() };
        let splatter = Splatter::new(gpu, options, splats.count, max_size)?;
        gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&splats.table));
        Ok(Scene { splatter, avatars: Vec::new(), eye: None })
    }

    /// The splatter, which holds the rendered image.
    pub fn splatter(&self) -> &Splatter {
        &self.splatter
    }

    /// The splatter, mutable.
    pub fn splatter_mut(&mut self) -> &mut Splatter {
        &mut self.splatter
    }

    /// Drops the avatars and returns the splatter, with the last frame in its table.
    pub fn into_splatter(self) -> Splatter {
        self.splatter
    }

    /// The avatars, in the order in which they were given.
    pub fn avatars(&self) -> &[PosedAvatar] {
        &self.avatars
    }

    /// The avatars, mutable.
    pub fn avatars_mut(&mut self) -> &mut [PosedAvatar] {
        &mut self.avatars
    }

    /// The splatter and the avatars, borrowed together to make gradients of both.
    pub fn splatter_and_avatars_mut(&mut self) -> (&Splatter, &mut [PosedAvatar]) {
        (&self.splatter, &mut self.avatars)
    }

    /// Sets the pose of an avatar in frame number `frame`.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the avatar or frame does not exist, or the pose has the wrong number of joints.
    pub fn set_pose(&mut self, gpu: &Gpu, avatar: usize, frame: usize, pose: &Pose) -> Result<(), RenderError> {
        let count = self.avatars.len();
        let posed = self.avatars.get_mut(avatar);
        let posed = posed.ok_or_else(|| {
            RenderError::Invalid(format!("pose for avatar {avatar}, but the scene has {count} avatars"))
        })?;
        posed.set_pose(gpu, frame, pose)
    }

    /// Moves an avatar as a whole, in poses that are set later: turned about the origin, then shifted (metres). Its light
    /// stays where it is.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the avatar does not exist.
    pub fn set_placement(&mut self, avatar: usize, rotation: DMat3, translation: DVec3) -> Result<(), RenderError> {
        let count = self.avatars.len();
        let placed = self.avatars.get_mut(avatar);
        let missing = || RenderError::Invalid(format!("place of avatar {avatar}, but the scene has {count} avatars"));
        placed.ok_or_else(missing)?.set_placement(rotation, translation);
        Ok(())
    }

    /// Sets the frame whose poses later submissions use.
    pub fn set_frame(&mut self, gpu: &Gpu, frame: usize) {
        self.avatars.iter_mut().for_each(|avatar| avatar.set_frame(gpu, frame));
    }

    /// Sets the view of later submissions.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the image is too large.
    pub fn set_view(&mut self, gpu: &Gpu, camera: &Camera, background: [f32; 3]) -> Result<(), RenderError> {
        self.eye = Some(camera.center());
        self.splatter.set_view(gpu, View::new(camera, self.splatter.count(), background, OPACITY))
    }

    /// Encodes a frame: posing and drawing.
    ///
    /// # Errors
    /// [`RenderError`] if a property model fails.
    pub fn encode(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Result<(), RenderError> {
        encode_poses(&mut self.avatars, gpu, encoder, self.eye)?;
        self.splatter.forward(encoder);
        Ok(())
    }

    /// As [`Scene::encode`], for a program that draws frame after frame and never waits: see
    /// [`Splatter::forward_growing`].
    ///
    /// # Errors
    /// [`RenderError`] if a property model fails, or the view needs more memory than the device has.
    pub fn encode_growing(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Result<bool, RenderError> {
        encode_poses(&mut self.avatars, gpu, encoder, self.eye)?;
        self.splatter.forward_growing(gpu, encoder)
    }

    /// As [`Scene::encode`], with the commands of `posed` behind the posing, and a pass for each stage of the drawing, which
    /// writes these timestamps.
    ///
    /// # Errors
    /// [`RenderError`] if a property model fails.
    pub fn encode_timed<'a>(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        posed: impl FnOnce(&mut wgpu::CommandEncoder),
        timestamps: impl Fn(FrameStage) -> Option<wgpu::ComputePassTimestampWrites<'a>>,
    ) -> Result<(), RenderError> {
        encode_poses(&mut self.avatars, gpu, encoder, self.eye)?;
        posed(encoder);
        self.splatter.forward_timed(encoder, timestamps);
        Ok(())
    }

    /// Runs a frame, with the commands that `behind` encodes after drawing, and repeats it until it is complete.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, or the view needs more memory than it has.
    pub fn run_frame(
        &mut self,
        gpu: &Gpu,
        behind: impl Fn(&Splatter, &mut wgpu::CommandEncoder),
    ) -> Result<Counters, RenderError> {
        let Scene { splatter, avatars, eye } = self;
        splatter.run_frame(gpu, |splatter, encoder| {
            encode_poses(avatars, gpu, encoder, *eye)?;
            splatter.forward(encoder);
            behind(splatter, encoder);
            Ok(())
        })
    }

    /// Renders frame `frame` from a camera and waits for the picture.
    ///
    /// # Errors
    /// As [`Scene::run_frame`], or if the image is too large.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        frame: usize,
        camera: &Camera,
        background: [f32; 3],
    ) -> Result<Image, RenderError> {
        self.set_view(gpu, camera, background)?;
        self.set_frame(gpu, frame);
        self.run_frame(gpu, |_, _| {})?;
        self.splatter.read_image(gpu)
    }

    /// As [`Scene::render`], without blocking the thread: see [`Splatter::render_async`].
    ///
    /// # Errors
    /// As [`Scene::render`].
    pub async fn render_async(
        &mut self,
        gpu: &Gpu,
        frame: usize,
        camera: &Camera,
        background: [f32; 3],
    ) -> Result<Image, RenderError> {
        self.set_view(gpu, camera, background)?;
        self.pose_only(gpu, frame, self.eye)?;
        self.splatter.render_async(gpu).await
    }

    /// As [`Scene::render`], for a picture of any height, in bands no larger than `max_size`: see
    /// [`Splatter::render_bands`].
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, or the image is too wide.
    pub fn render_bands(
        &mut self,
        gpu: &Gpu,
        frame: usize,
        camera: &Camera,
        background: [f32; 3],
        sink: impl FnMut(u32, &Image),
    ) -> Result<(), RenderError> {
        self.pose_only(gpu, frame, Some(camera.center()))?;
        self.splatter.render_bands(gpu, View::new(camera, self.splatter.count(), background, OPACITY), sink)
    }

    /// Fills the splatter's table with the Gaussians of frame `frame` as an eye (metres, world axes) sees them, without drawing
    /// and without waiting.
    ///
    /// # Errors
    /// [`RenderError`] if the property model fails.
    pub fn pose_only(&mut self, gpu: &Gpu, frame: usize, eye: Option<DVec3>) -> Result<(), RenderError> {
        self.set_frame(gpu, frame);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encode_poses(&mut self.avatars, gpu, &mut encoder, eye)?;
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// The splatter's table of frame `frame` without gloss, `[rows][N]` with the avatars one after the other in each row.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn posed_table(&mut self, gpu: &Gpu, frame: usize) -> Result<Vec<f32>, RenderError> {
        self.pose_only(gpu, frame, None)?;
        let rows = self.splatter.options().model.rows();
        buffers::read(gpu, self.splatter.gaussians(), rows * self.splatter.count())
    }
}
