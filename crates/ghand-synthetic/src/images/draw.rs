//! Draws the pictures of a synthetic capture.

use std::path::Path;

use ghand_capture::capture::{Capture, CaptureError, fill_template};
use ghand_core::Camera;
use ghand_files::atomic_file::write_atomically;
use glam::DVec3;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::background::clutter;
use super::cast_shadow::{add_shadow, plant_light};
use super::labels::hand_alone;
use super::lighting::lighting;
use crate::errors::exposures::exposures;
use crate::errors::masks::MaskErrors;
use crate::hand::forearm::bend;
use crate::hand::true_hand::{PosedTrueHand, TrueHand};
use crate::{Backdrop, LightSetup, Masks, RenderScene, SceneLighting, SceneMesh, SyntheticOptions};

/// Renders and writes the image and mask of every pair of the splits `train` and `test`. Only masks of `train` have
/// errors.
pub(crate) fn draw(
    capture: &Capture,
    hand: &TrueHand,
    options: &SyntheticOptions,
    render: &mut RenderScene,
) -> Result<(), CaptureError> {
    let exact = MaskErrors { pixels: 0.0, seed: options.seed };
    let errors = MaskErrors { pixels: options.mask_noise_pixels, ..exact };
    let exposures = exposures(capture.cameras.len(), options.exposure_noise, options.seed);
    let lighting = lighting(options.light);
    let backgrounds: Vec<Vec<DVec3>> = (capture.cameras.iter().enumerate())
        .map(|(index, camera)| match options.background {
            Backdrop::Plain => vec![DVec3::from(capture.background); (camera.width * camera.height) as usize],
            Backdrop::Clutter => clutter(camera, index, options.seed),
        })
        .collect();
    let poses = capture.truth.iter().flatten().map(|pose| pose.as_ref());
    for (frame, pose) in poses.enumerate() {
        let Some(pose) = pose else { continue };
        let mut posed = hand.pose(pose, bend(frame, options.seed));
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
                let background = &backgrounds[camera];
                let masks = options.masks;
                Shot { capture, hand, posed: &posed, lighting: &lighting, camera, frame, exposure, background, masks }
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
    posed: &'a PosedTrueHand,
    lighting: &'a SceneLighting,
    camera: usize,
    frame: usize,
    /// Factors on the display values.
    exposure: [f64; 3],
    /// Display colours behind the hand.
    background: &'a [DVec3],
    masks: Masks,
}

impl Shot<'_> {
    fn take(&self, errors: &MaskErrors, render: &mut RenderScene) -> Result<(), CaptureError> {
        let capture = self.capture;
        let posed = self.posed;
        let camera = &capture.cameras[self.camera];
        let frame = &capture.frames[self.frame].id;
        let scene = SceneMesh {
            positions: &posed.positions,
            normals: &posed.normals,
            uvs: &self.hand.mesh.uvs,
            light_visibility: &posed.light_visibility,
            triangles: &self.hand.mesh.triangles,
            texture: &posed.texture,
            lighting: self.lighting,
        };
        let pixels = self.rendered(&scene, render)?;
        let over_background = |([r, g, b, a], behind): (&[u8; 4], &DVec3)| {
            let a = f64::from(*a) / 255.0;
            let mix = |value: &u8, behind: f64| (f64::from(*value) * a + 255.0 * behind * (1.0 - a)).round() as u8;
            let mixed = [mix(r, behind.x), mix(g, behind.y), mix(b, behind.z)];
            [0, 1, 2].map(|c| (f64::from(mixed[c]) * self.exposure[c]).round().min(255.0) as u8)
        };
        let colors: Vec<u8> = pixels.iter().zip(self.background).flat_map(over_background).collect();
        let covered = if self.masks == Masks::Hand && !self.hand.on_forearm.is_empty() {
            hand_alone(&scene, &self.hand.on_forearm, |labels| self.rendered(labels, render))?
        } else {
            pixels.iter().map(|p| p[3] >= 128).collect()
        };
        let mask = errors.of(&covered, camera.width as usize, self.camera, self.frame);
        let mask: Vec<u8> = mask.into_iter().map(|inside| if inside { 255 } else { 0 }).collect();
        let file = |template: &str| capture.root.join(fill_template(template, &camera.id, frame));
        write_image(&file(&capture.images.image), "image", &colors, camera, ExtendedColorType::Rgb8)?;
        match &capture.images.mask {
            Some(template) => write_image(&file(template), "mask", &mask, camera, ExtendedColorType::L8),
            None => Ok(()),
        }
    }

    fn rendered(&self, scene: &SceneMesh, render: &mut RenderScene) -> Result<Vec<[u8; 4]>, CaptureError> {
        let camera = &self.capture.cameras[self.camera];
        let frame = &self.capture.frames[self.frame].id;
        let failed = |problem| CaptureError::Render { frame: frame.into(), camera: camera.id.clone(), problem };
        let pixels = render(scene, camera).map_err(failed)?;
        let expected = camera.width as usize * camera.height as usize;
        if pixels.len() != expected {
            return Err(failed(format!("it returned {} pixels, expected {expected}", pixels.len())));
        }
        Ok(pixels)
    }
}

/// Writes a PNG.
pub(crate) fn write_image(
    path: &Path,
    what: &'static str,
    pixels: &[u8],
    camera: &Camera,
    color: ExtendedColorType,
) -> Result<(), CaptureError> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
        .write_image(pixels, camera.width, camera.height, color)
        .map_err(|source| CaptureError::Image { path: path.into(), what, source })?;
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
