//! Renders an avatar in a named pose to `pose.png`.
//!
//!     cargo run --example render_pose [AVATAR.ghand [POSE]]
//!
//! Without an avatar the built-in hand is drawn, in one colour.

use std::path::Path;

use anyhow::Context;
use ghand::prelude::*;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let avatar = match arguments.next() {
        Some(path) => Avatar::load(Path::new(&path))?,
        None => {
            let hand = builtin_hand(Side::Right)?;
            Avatar::untrained(&hand, &AvatarConfig::default(), [0.8, 0.6, 0.5], 0)?
        }
    };
    let name = arguments.next().unwrap_or_else(|| "point".into());
    let pose = named_pose(&name, &avatar.model).with_context(|| format!("there is no pose `{name}`"))?;

    // A scene may hold several avatars: each has its own poses, and all share one view.
    let gpu = Gpu::new(&AdapterChoice::from_env())?;
    let size = [512, 512];
    let mut scene = Scene::new(&gpu, &[&avatar], Purpose::Images, 1, size)?;
    scene.set_pose(&gpu, 0, 0, &pose)?;
    let cameras = turntable(&avatar.model, &[&pose], 1, size);
    let camera = cameras.first().and_then(|of_pose| of_pose.first()).context("no camera")?;
    let image = scene.render(&gpu, 0, camera, [1.0; 3])?;

    let bytes = image.rgba.iter().flat_map(|p| [p[0], p[1], p[2]].map(|v| (v * 255.0).round() as u8)).collect();
    let picture = image::RgbImage::from_raw(image.width, image.height, bytes).context("the image has another size")?;
    picture.save("pose.png")?;
    println!("pose.png: `{name}`, {} Gaussians", avatar.template.len());
    Ok(())
}
