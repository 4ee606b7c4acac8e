//! A property model of one's own: colours that run over the hand in a wave, whatever the pose, to `wave.png`.
//!
//!     cargo run --example property_model
//!
//! A model fills the properties of a deformation, which then poses the Gaussians; see `ghand_avatar::properties`. A model
//! that is to be trained and saved is a `TrainableModel`, too, and a variant of `PropertyTables`.

use anyhow::Context;
use ghand::avatar::deform::{Deformation, Properties};
use ghand::avatar::{DeviceModel, PropertyModel};
use ghand::prelude::*;
use ghand::render::RenderError;

/// Stripes along the model's y axis that move with every frame.
struct Wave {
    properties: Properties,
    /// y of each Gaussian at rest, metres.
    heights: Vec<f32>,
    frame: u32,
}

impl PropertyModel for Wave {
    fn forward(&mut self, gpu: &Gpu, _: &mut wgpu::CommandEncoder, _: &Deformation) -> Result<(), RenderError> {
        let shift = self.frame as f32 * 0.01;
        self.frame += 1;
        let stripe = |phase: f32| self.heights.iter().map(move |y| ((y - shift) * 300.0 + phase).sin() * 0.5 + 0.5);
        let colors: Vec<f32> = [0.0, 2.0, 4.0].into_iter().flat_map(stripe).collect();
        // `[3][N]`, as the documentation of the properties says.
        gpu.queue.write_buffer(&self.properties.color, 0, bytemuck::cast_slice(&colors));
        Ok(())
    }
}

fn main() -> anyhow::Result<()> {
    let gpu = Gpu::new(&AdapterChoice::from_env())?;
    let hand = builtin_hand(Side::Right)?;
    let avatar = Avatar::untrained(&hand, &AvatarConfig::default(), [0.5; 3], 0)?;
    let count = avatar.template.len();
    let size = [384, 384];
    let mut scene = Scene::new(&gpu, &[&avatar], Purpose::Images, 1, size)?;
    let pose = named_pose("spread", &avatar.model).context("there is no pose `spread`")?;
    scene.set_pose(&gpu, 0, 0, &pose)?;
    let cameras = turntable(&avatar.model, &[&pose], 1, size);
    let camera = cameras.first().and_then(|of_pose| of_pose.first()).context("no camera")?;
    // One frame with the avatar's own model: it fills the sizes, which the wave leaves as they are.
    scene.render(&gpu, 0, camera, [1.0; 3])?;

    let posed = &mut scene.avatars_mut()[0];
    let properties = posed.deformation.properties().clone();
    let heights = avatar.template.rest[count..2 * count].to_vec();
    posed.model = DeviceModel::Plays(Box::new(Wave { properties, heights, frame: 0 }));
    let image = scene.render(&gpu, 0, camera, [1.0; 3])?;

    let bytes = image.rgba.iter().flat_map(|p| [p[0], p[1], p[2]].map(|v| (v * 255.0).round() as u8)).collect();
    let picture = image::RgbImage::from_raw(image.width, image.height, bytes).context("the image has another size")?;
    picture.save("wave.png")?;
    println!("wave.png: {count} Gaussians");
    Ok(())
}
