//! Splats 10,000 random Gaussians, and fits their colours to a picture by gradient descent: the splatter alone, without
//! hands.
//!
//!     cargo run --example splat_a_scene
//!
//! Writes `splats.png`: the splats before, the picture, and the splats after.

use anyhow::Context;
use ghand::prelude::*;
use ghand::render::image_loss::{ImageLoss, LossWeights};
use ghand::render::optimizer::{Adam, AdamUniforms, Grouping};
use ghand::render::splat::{Image, SplatOptions, Splatter, View};
use glam::{DMat3, DVec2, DVec3};
use rand::{RngExt, SeedableRng};

const COUNT: usize = 10_000;
const SIZE: [u32; 2] = [256, 192];
const STEPS: u64 = 100;

fn main() -> anyhow::Result<()> {
    let gpu = Gpu::new(&AdapterChoice::from_env())?;
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    // Made for gradients, of round Gaussians with plain colours: a table of seven rows, mean (3), size, colour (3).
    let mut splatter = Splatter::new(&gpu, SplatOptions::default(), COUNT, SIZE)?;
    gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&random_table()));
    splatter.set_view(&gpu, View::new(&camera(), COUNT, [0.0; 3], 0.7))?;
    let before = splatter.render(&gpu)?;

    let mut loss = ImageLoss::new(&gpu, splatter.image(), splatter.d_image(), pixels)?;
    loss.set_target(&gpu, SIZE, &target(), LossWeights { l1: 1.0, ..Default::default() }, 3.0 * pixels as f64)?;
    // Adam on the colours alone: rows 4 to 6 of the table.
    let table = splatter.gaussians().clone();
    let gradients = splatter.d_gaussians().clone();
    let adam = Adam::new(&gpu)?.table(&gpu, &table, &gradients, 7 * COUNT, 1, Grouping::Scalars)?;
    for step in 1..=STEPS {
        splatter.run_frame(&gpu, |splatter, encoder| {
            splatter.forward(encoder);
            loss.encode(encoder);
            splatter.backward(encoder);
            Ok(())
        })?;
        // The frame was complete, so its gradients are right.
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let colors = 4 * COUNT..7 * COUNT;
        let update = AdamUniforms::new(colors.clone(), colors.start, 0.03, step);
        adam.encode(&gpu, &mut encoder.begin_compute_pass(&Default::default()), 0, &update);
        gpu.queue.submit([encoder.finish()]);
    }
    let after = splatter.render(&gpu)?;
    save(&[&before, &after]).context("splats.png cannot be written")?;
    println!("splats.png: mean error {:.3} before, {:.3} after {STEPS} steps", error(&before), error(&after));
    Ok(())
}

fn camera() -> Camera {
    Camera {
        id: "front".into(),
        width: SIZE[0],
        height: SIZE[1],
        focal: DVec2::splat(300.0),
        principal: DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1])) / 2.0,
        rotation: DMat3::IDENTITY,
        translation: DVec3::new(0.0, 0.0, 1.0),
    }
}

/// Grey Gaussians of 4 mm in a slab in front of the camera.
fn random_table() -> Vec<f32> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut row = |size: f32| -> Vec<f32> { (0..COUNT).map(|_| rng.random_range(-size..size)).collect() };
    [row(0.45), row(0.33), row(0.05), vec![0.004; COUNT], vec![0.5; 3 * COUNT]].concat()
}

/// Red, green, blue and mask of every pixel of the picture to fit: rings.
fn target() -> Vec<[u8; 4]> {
    let ring = |x: f32, y: f32| (((x * x + y * y).sqrt() * 0.15).sin() * 127.0 + 128.0) as u8;
    let pixel = |x: u32, y: u32| {
        let (dx, dy) = (x as f32 - SIZE[0] as f32 / 2.0, y as f32 - SIZE[1] as f32 / 2.0);
        [ring(dx, dy), x as u8, y as u8, 255]
    };
    (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| pixel(x, y))).collect()
}

/// Mean difference from the picture, display values.
fn error(image: &Image) -> f32 {
    let of_pixel = |(p, t): (&[f32; 4], &[u8; 4])| (0..3).map(|c| (p[c] - f32::from(t[c]) / 255.0).abs()).sum::<f32>();
    image.rgba.iter().zip(&target()).map(of_pixel).sum::<f32>() / (3 * image.rgba.len()) as f32
}

/// The first image, the picture and the second image, side by side.
fn save([before, after]: &[&Image; 2]) -> anyhow::Result<()> {
    let picture = target();
    let mut all = image::RgbImage::new(3 * SIZE[0], SIZE[1]);
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let at = (y * SIZE[0] + x) as usize;
            let rendered = |image: &Image| [0, 1, 2].map(|c| (image.rgba[at][c] * 255.0).round() as u8);
            all.put_pixel(x, y, image::Rgb(rendered(before)));
            all.put_pixel(SIZE[0] + x, y, image::Rgb([picture[at][0], picture[at][1], picture[at][2]]));
            all.put_pixel(2 * SIZE[0] + x, y, image::Rgb(rendered(after)));
        }
    }
    Ok(all.save("splats.png")?)
}
