//! Draws the pictures of a synthetic capture.

use std::path::Path;

use ghand_capture::capture::{Capture, CaptureError, fill_template};
use ghand_core::Camera;
use ghand_files::atomic_file::write_atomically;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::cast_shadow::{add_shadow, plant_light};
use super::exposure::exposures;
use super::lighting::lighting;
use super::mask_errors::MaskErrors;
use super::true_hand::{PosedHand, TrueHand};
use super::{LightSetup, RenderScene, SceneLighting, SceneMesh, SyntheticOptions};

/// From 0 to 100.
const JPEG_QUALITY: u8 = 95;

/// Renders and writes the image and mask of every pair of the splits `train` and `test`. Only masks of `train` have
/// errors.
pub(super) fn draw(
    capture: &Capture,
    hand: &TrueHand,
    options: &SyntheticOptions,
    render: &mut RenderScene,
) -> Result<(), CaptureError> {
    let exact = MaskErrors { pixels: 0.0, seed: options.seed };
    let errors = MaskErrors { pixels: options.mask_noise_pixels, ..exact };
    let exposures = exposures(capture.cameras.len(), options.exposure_noise, options.seed);
    let lighting = lighting(options.light);
    let poses = capture.truth.iter().flatten().map(|pose| pose.as_ref());
    for (frame, pose) in poses.enumerate() {
        let Some(pose) = pose else { continue };
        let mut posed = hand.pose(pose);
        if options.light == LightSetup::Side {
            add_shadow(&mut posed, &lighting);
        }
        if let Some(light) = options.light.planted() {
            plant_light(&mut posed, &light);
        }
        for (split, errors, exposures) in [("train", &errors, Some(&exposures)), ("test", &exact, None)] {
            let Some(split) = capture.splits.get(split).filter(|split| split.frames.contains(&frame)) else { continue };
            for &camera in &split.cameras {
                let exposure = exposures.map_or([1.0; 3], |all| all[camera]);
                Shot { capture, hand, posed: &posed, lighting: &lighting, camera, frame, exposure }
                    .take(errors, render)?;
            }
        }
    }
    Ok(())
}

/// One image.
struct Shot<'a> {
    capture: &'a Capture,
    hand: &'a TrueHand,
    posed: &'a PosedHand,
    lighting: &'a SceneLighting,
    camera: usize,
    frame: usize,
    /// Factors on the display values.
    exposure: [f64; 3],
}

impl Shot<'_> {
    fn take(&self, errors: &MaskErrors, render: &mut RenderScene) -> Result<(), CaptureError> {
        let (capture, posed) = (self.capture, self.posed);
        let (camera, frame) = (&capture.cameras[self.camera], &capture.frames[self.frame].id);
        let scene = SceneMesh {
            positions: &posed.positions,
            normals: &posed.normals,
            uvs: &self.hand.mesh.uvs,
            light_visibility: &posed.light_visibility,
            triangles: &self.hand.mesh.triangles,
            texture: &posed.texture,
            lighting: self.lighting,
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
            let mixed = [mix(r, capture.background[0]), mix(g, capture.background[1]), mix(b, capture.background[2])];
            [0, 1, 2].map(|c| (f64::from(mixed[c]) * self.exposure[c]).round().min(255.0) as u8)
        };
        let colors: Vec<u8> = pixels.iter().flat_map(|p| over_background(*p)).collect();
        let covered: Vec<bool> = pixels.iter().map(|p| p[3] >= 128).collect();
        let mask = errors.of(&covered, camera.width as usize, self.camera, self.frame);
        let mask: Vec<u8> = mask.into_iter().map(|inside| if inside { 255 } else { 0 }).collect();
        let file = |template: &str| capture.root.join(fill_template(template, &camera.id, frame));
        write_image(&file(&capture.images.image), "image", &colors, camera, ExtendedColorType::Rgb8)?;
        match &capture.images.mask {
            Some(template) => write_image(&file(template), "mask", &mask, camera, ExtendedColorType::L8),
            None => Ok(()),
        }
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
