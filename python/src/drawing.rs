//! An avatar on the device: its scenes, made when they are first needed.

use anyhow::ensure;
use ghand_avatar::{Avatar, Scene};
use ghand_core::{Camera, Pose};
use ghand_render::splat::{Purpose, SplatModel, SplatOptions, band_rows};
use ghand_render::{Gpu, buffers};
use glam::DVec3;

/// The scenes of an avatar.
#[derive(Default)]
pub struct Drawing {
    colors: Option<Drawn>,
    /// With depths.
    depths: Option<Drawn>,
}

struct Drawn {
    /// The device that the scene is on.
    device: wgpu::Device,
    scene: Scene,
    /// The largest picture, pixels.
    size: [u32; 2],
    /// The pose that it has.
    pose: Option<Pose>,
}

impl Drawn {
    /// The scene in `slot`, for pictures of at least this size, with the avatar in this pose; made anew where it is too
    /// small, or on another device.
    fn posed<'a>(
        slot: &'a mut Option<Drawn>,
        gpu: &Gpu,
        avatar: &Avatar,
        pose: &Pose,
        [width, height]: [u32; 2],
        depth: bool,
    ) -> anyhow::Result<&'a mut Drawn> {
        let kept = slot.take().filter(|drawn| drawn.device == gpu.device);
        let [w, h] = kept.as_ref().map_or([1, 1], |drawn| drawn.size);
        let drawn = match kept {
            Some(drawn) if w >= width && h >= height => drawn,
            outgrown => {
                // Its memory is free before more is taken.
                drop(outgrown);
                let size = [w.max(width), h.max(height)];
                let options = SplatOptions { purpose: Purpose::Images, depth, ..SplatOptions::default() };
                let scene = Scene::with_options(gpu, &[avatar], 1, size, options)?;
                Drawn { device: gpu.device.clone(), scene, size, pose: None }
            }
        };
        let drawn = slot.insert(drawn);
        if drawn.pose.as_ref() != Some(pose) {
            drawn.scene.set_pose(gpu, 0, 0, pose)?;
            drawn.pose = Some(pose.clone());
        }
        Ok(drawn)
    }
}

impl Drawing {
    /// A picture: colour over the background and coverage of each pixel, row-major.
    ///
    /// # Errors
    /// If the device fails, or the picture is too wide for it.
    pub fn picture(
        &mut self,
        gpu: &Gpu,
        avatar: &Avatar,
        pose: &Pose,
        camera: &Camera,
        background: [f32; 3],
    ) -> anyhow::Result<Vec<f32>> {
        let size = [camera.width, camera.height];
        let rows = band_rows(gpu, size);
        let drawn = Drawn::posed(&mut self.colors, gpu, avatar, pose, [size[0], rows], false)?;
        if rows >= camera.height {
            return Ok(displayed(drawn.scene.render(gpu, 0, camera, background)?.rgba.into_flattened()));
        }
        let mut rgba = Vec::with_capacity(4 * size[0] as usize * size[1] as usize);
        drawn.scene.render_bands(gpu, 0, camera, background, |_, band| {
            rgba.extend_from_slice(band.rgba.as_flattened());
        })?;
        Ok(displayed(rgba))
    }

    /// Depths along the camera's axis, metres, 0 where there is no hand, row-major.
    ///
    /// # Errors
    /// If the device fails, or the picture is too large for it.
    pub fn depths(&mut self, gpu: &Gpu, avatar: &Avatar, pose: &Pose, camera: &Camera) -> anyhow::Result<Vec<f32>> {
        let size = [camera.width, camera.height];
        ensure!(
            band_rows(gpu, size) >= camera.height,
            "camera: {}x{} pixels of depths are more than the device takes at once; divide the picture",
            size[0],
            size[1]
        );
        let scene = &mut Drawn::posed(&mut self.depths, gpu, avatar, pose, size, true)?.scene;
        scene.set_view(gpu, camera, [0.0; 3])?;
        scene.set_frame(gpu, 0);
        scene.run_frame(gpu, |_, _| {})?;
        Ok(buffers::read(gpu, scene.splatter().depths(), size[0] as usize * size[1] as usize)?)
    }

    /// The table of the Gaussians, `[rows][N]`, and their kind, with the gloss that an eye (metres, world) sees, if there is
    /// one.
    ///
    /// # Errors
    /// If the device fails.
    pub fn gaussians(
        &mut self,
        gpu: &Gpu,
        avatar: &Avatar,
        pose: &Pose,
        eye: Option<DVec3>,
    ) -> anyhow::Result<(Vec<f32>, SplatModel)> {
        let scene = &mut Drawn::posed(&mut self.colors, gpu, avatar, pose, [1, 1], false)?.scene;
        scene.pose_only(gpu, 0, eye)?;
        let model = scene.splatter().options().model;
        let numbers = model.rows() * scene.splatter().count();
        Ok((buffers::read(gpu, scene.splatter().gaussians(), numbers)?, model))
    }
}

/// Values as a display shows them: highlights are brighter than it can be.
fn displayed(mut rgba: Vec<f32>) -> Vec<f32> {
    rgba.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
    rgba
}
