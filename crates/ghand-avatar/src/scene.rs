//! A scene of posed avatars and the protocol of its frames.
//!
//! A frame is, in this order: poses ([`Scene::set_pose`], [`Scene::set_frame`]), a view ([`Scene::set_view`]), the commands
//! ([`Scene::encode`]), and, once the device has run them, whether the frame was complete
//! ([`Splatter::complete_for`]); if not there is room for it now, and it is encoded again. [`Scene::run_frame`] does this and
//! waits; a window encodes, lets the device work, and asks later.

use ghand_core::{Camera, Pose};
use ghand_render::deform::TablePlace;
use ghand_render::splat::{Counters, Image, Purpose, SplatOptions, Splatter, View};
use ghand_render::{Gpu, RenderError, buffers};

use crate::avatar::Avatar;
use crate::ply::SplatScene;
use crate::posed_avatar::PosedAvatar;

/// Opacity of every Gaussian of an avatar; fixed, as in the paper.
pub const OPACITY: f32 = 1.0;

/// What one splatter draws: any number of posed avatars, or Gaussians that stand still.
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
}

/// Encodes the posing of avatars: after it the splatter's table is that of the frame.
fn encode_poses(avatars: &mut [PosedAvatar], gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Result<(), RenderError> {
    avatars.iter_mut().try_for_each(|avatar| avatar.encode(gpu, encoder))
}

impl Scene {
    /// Puts avatars on the device, each with room for `frames` poses, for images of at most `max_size` pixels. What is
    /// only looked at needs no gradients, and far less memory.
    ///
    /// # Errors
    /// [`RenderError`] if the device has no room for it or was lost.
    pub fn new(
        gpu: &Gpu,
        avatars: &[&Avatar],
        purpose: Purpose,
        frames: usize,
        max_size: [u32; 2],
    ) -> Result<Scene, RenderError> {
        let columns = avatars.iter().map(|a| a.template.len()).sum();
        let splatter = Splatter::new(gpu, SplatOptions { purpose, ..Default::default() }, columns, max_size)?;
        let mut first = 0;
        let mut posed = Vec::new();
        for avatar in avatars {
            let count = avatar.template.len();
            let what = format!("an avatar of {count} Gaussians with {frames} poses");
            let place = TablePlace { columns, first };
            posed.push(gpu.scoped(&what, || PosedAvatar::new(gpu, avatar, frames, splatter.gaussians(), place))?);
            first += count;
        }
        Ok(Scene { splatter, avatars: posed })
    }

    /// Puts Gaussians that stand still on the device, for images of at most `max_size` pixels.
    ///
    /// # Errors
    /// As [`Scene::new`].
    pub fn of_splats(gpu: &Gpu, splats: &SplatScene, max_size: [u32; 2]) -> Result<Scene, RenderError> {
        let options = SplatOptions { model: splats.model(), purpose: Purpose::Images, depth: false };
        let splatter = Splatter::new(gpu, options, splats.count, max_size)?;
        gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&splats.table));
        Ok(Scene { splatter, avatars: Vec::new() })
    }

    /// The splatter; its image is the picture.
    pub fn splatter(&self) -> &Splatter {
        &self.splatter
    }

    /// The same, to be changed.
    pub fn splatter_mut(&mut self) -> &mut Splatter {
        &mut self.splatter
    }

    /// The splatter alone, with the last frame in its table.
    pub fn into_splatter(self) -> Splatter {
        self.splatter
    }

    /// The avatars, in the order in which they were given.
    pub fn avatars(&self) -> &[PosedAvatar] {
        &self.avatars
    }

    /// The same, to be changed.
    pub fn avatars_mut(&mut self) -> &mut [PosedAvatar] {
        &mut self.avatars
    }

    /// The splatter beside the avatars, to make gradients of both.
    pub fn parts_mut(&mut self) -> (&Splatter, &mut [PosedAvatar]) {
        (&self.splatter, &mut self.avatars)
    }

    /// Stores a pose of an avatar as frame number `frame`.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if there is no such avatar or frame, or the pose has another number of joints.
    pub fn set_pose(&self, gpu: &Gpu, avatar: usize, frame: usize, pose: &Pose) -> Result<(), RenderError> {
        let posed = self.avatars.get(avatar);
        let posed = posed.ok_or_else(|| {
            RenderError::Invalid(format!("a pose for avatar {avatar}, but the scene has {}", self.avatars.len()))
        })?;
        posed.set_pose(gpu, frame, pose)
    }

    /// Chooses the frame whose poses are used by what is submitted from now on.
    pub fn set_frame(&mut self, gpu: &Gpu, frame: usize) {
        self.avatars.iter_mut().for_each(|avatar| avatar.deformation.set_frame(gpu, frame));
    }

    /// Chooses the view of what is submitted from now on.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the image is too large.
    pub fn set_view(&mut self, gpu: &Gpu, camera: &Camera, background: [f32; 3]) -> Result<(), RenderError> {
        self.splatter.set_view(gpu, View::new(camera, self.splatter.count(), background, OPACITY))
    }

    /// Encodes a frame: posing and drawing.
    ///
    /// # Errors
    /// [`RenderError`] if a property model fails.
    pub fn encode(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Result<(), RenderError> {
        encode_poses(&mut self.avatars, gpu, encoder)?;
        self.splatter.forward(encoder);
        Ok(())
    }

    /// Runs a frame to its end, with what `behind` encodes behind the drawing, as often as it takes until it is complete.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, or the view needs more memory than it has.
    pub fn run_frame(
        &mut self,
        gpu: &Gpu,
        behind: impl Fn(&Splatter, &mut wgpu::CommandEncoder),
    ) -> Result<Counters, RenderError> {
        let Scene { splatter, avatars } = self;
        splatter.run_frame(gpu, |splatter, encoder| {
            encode_poses(avatars, gpu, encoder)?;
            splatter.forward(encoder);
            behind(splatter, encoder);
            Ok(())
        })
    }

    /// Renders frame `frame` from a camera and waits for the picture.
    ///
    /// # Errors
    /// As [`Scene::run_frame`]; or if the image is too large.
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

    /// As [`Scene::render`] for a picture of any height, in bands that the scene holds: see [`Splatter::render_bands`].
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
        self.pose_only(gpu, frame)?;
        self.splatter.render_bands(gpu, View::new(camera, self.splatter.count(), background, OPACITY), sink)
    }

    /// Leaves the Gaussians of frame `frame` in the splatter's table.
    fn pose_only(&mut self, gpu: &Gpu, frame: usize) -> Result<(), RenderError> {
        self.set_frame(gpu, frame);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encode_poses(&mut self.avatars, gpu, &mut encoder)?;
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// The Gaussians of frame `frame`: see [`SplatScene::of_hand`].
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn posed_splats(&mut self, gpu: &Gpu, frame: usize) -> Result<SplatScene, RenderError> {
        Ok(SplatScene::of_hand(&self.posed_table(gpu, frame)?))
    }

    /// The splatter's table of frame `frame`, `[rows][N]` with the avatars one after the other in each row.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn posed_table(&mut self, gpu: &Gpu, frame: usize) -> Result<Vec<f32>, RenderError> {
        self.pose_only(gpu, frame)?;
        let rows = self.splatter.options().model.rows();
        buffers::read(gpu, self.splatter.gaussians(), rows * self.splatter.count())
    }
}
