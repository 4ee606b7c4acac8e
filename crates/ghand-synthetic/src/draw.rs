//! Draws the pictures of a synthetic capture.

use std::path::Path;

use ghand_capture::capture::{Capture, CaptureError, fill_template};
use ghand_core::Camera;
use ghand_files::atomic_file::write_atomically;
use glam::DVec3;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::true_hand::{PosedHand, TrueHand};
use super::{RenderScene, SceneLight, SceneLighting, SceneMesh};

/// From 0 to 100.
const JPEG_QUALITY: u8 = 95;

/// A warm key light from above on the back's side, a weaker one from the palm's side, and a faint one from below.
fn lighting() -> SceneLighting {
    let light = |x: f64, y: f64, z: f64, color: [f64; 3]| SceneLight {
        direction: DVec3::new(x, y, z).normalize(),
        color: DVec3::from(color),
    };
    SceneLighting {
        ambient: DVec3::new(0.36, 0.355, 0.36),
        lights: vec![
            light(0.75, -0.55, -0.50, [0.74, 0.70, 0.64]),
            light(-0.80, -0.45, 0.35, [0.64, 0.62, 0.60]),
            light(0.10, 0.60, 0.85, [0.26, 0.23, 0.21]),
        ],
        wrap: 0.25,
    }
}

/// Renders and writes the image and mask of every pair of the splits `train` and `test`.
pub(super) fn draw(capture: &Capture, hand: &TrueHand, render: &mut RenderScene) -> Result<(), CaptureError> {
    let lighting = lighting();
    let poses = capture.truth.iter().flatten().map(|pose| pose.as_ref());
    for (frame, pose) in poses.enumerate() {
        let Some(pose) = pose else { continue };
        let posed = hand.pose(pose);
        for split in ["train", "test"].iter().filter_map(|name| capture.splits.get(*name)) {
            if !split.frames.contains(&frame) {
                continue;
            }
            for camera in split.cameras.iter().filter_map(|&i| capture.cameras.get(i)) {
                draw_view(capture, hand, &posed, &lighting, camera, &capture.frames[frame].id, render)?;
            }
        }
    }
    Ok(())
}

fn draw_view(
    capture: &Capture,
    hand: &TrueHand,
    posed: &PosedHand,
    lighting: &SceneLighting,
    camera: &Camera,
    frame: &str,
    render: &mut RenderScene,
) -> Result<(), CaptureError> {
    let scene = SceneMesh {
        positions: &posed.positions,
        normals: &posed.normals,
        uvs: &hand.mesh.uvs,
        light_visibility: &posed.light_visibility,
        triangles: &hand.mesh.triangles,
        texture: &posed.texture,
        lighting,
    };
    let failed = |problem| CaptureError::Render { frame: frame.into(), camera: camera.id.clone(), problem };
    let pixels = render(&scene, camera).map_err(failed)?;
    let expected = camera.width as usize * camera.height as usize;
    if pixels.len() != expected {
        return Err(failed(format!("it returned {} pixels, expected {expected}", pixels.len())));
    }
    let over_background = |[r, g, b, a]: [u8; 4]| {
        let a = f64::from(a) / 255.0;
        let mix = |value: u8, behind: f64| (f64::from(value) * a + 255.0 * behind * (1.0 - a)).round() as u8;
        [mix(r, capture.background[0]), mix(g, capture.background[1]), mix(b, capture.background[2])]
    };
    let colors: Vec<u8> = pixels.iter().flat_map(|p| over_background(*p)).collect();
    let mask: Vec<u8> = pixels.iter().map(|p| if p[3] >= 128 { 255 } else { 0 }).collect();
    let file = |template: &str| capture.root.join(fill_template(template, &camera.id, frame));
    write_image(&file(&capture.images.image), "image", &colors, camera, ExtendedColorType::Rgb8)?;
    match &capture.images.mask {
        Some(template) => write_image(&file(template), "mask", &mask, camera, ExtendedColorType::L8),
        None => Ok(()),
    }
}

/// Writes a JPEG if the path says so, else a PNG.
fn write_image(
    path: &Path,
    what: &'static str,
    pixels: &[u8],
    camera: &Camera,
    color: ExtendedColorType,
) -> Result<(), CaptureError> {
    let mut bytes = Vec::new();
    let encoded = if path.extension().is_some_and(|e| e == "jpg") {
        JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).write_image(pixels, camera.width, camera.height, color)
    } else {
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive).write_image(
            pixels,
            camera.width,
            camera.height,
            color,
        )
    };
    encoded.map_err(|source| CaptureError::Image { path: path.into(), what, source })?;
    let written = match path.parent() {
        Some(folder) => std::fs::create_dir_all(folder).and_then(|()| write_atomically(path, &bytes)),
        None => write_atomically(path, &bytes),
    };
    written.map_err(|source| CaptureError::Io {
        path: path.into(),
        action: "write the image",
        source,
        remedy: "check that the folder is writable and has free space",
    })
}
