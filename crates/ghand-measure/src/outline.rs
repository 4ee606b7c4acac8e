//! How far pictures of a hand keep to the outline of its posed template where nothing can be compared with: what lies
//! loose beside it, and how frayed the outline is.

use ghand_avatar::{Avatar, Scene};
use ghand_capture::images::blur::blurred;
use ghand_capture::mask::{covered_pixels, depths};
use ghand_core::Camera;
use ghand_core::posing::pose_hand;
use ghand_core::sphere::spiral_direction;
use ghand_hand_model::named_poses::named_pose;
use ghand_render::splat::Purpose;
use ghand_render::{Gpu, RenderError};
use glam::{DVec2, DVec3};
use serde::Serialize;

/// Distance from the template's outline beyond which coverage is loose, metres. Hands differ by less from a template in
/// their proportions, and what is further away is seen as apart from the hand.
pub const LOOSE_DISTANCE: f64 = 3e-3;
/// Standard deviation of the blur that an outline is compared after, metres: flakes and notches up to about twice as
/// wide vanish in it, the round ends of fingers stay.
pub const FRAY_SIZE: f64 = 2e-3;
/// Poses that few captures show, and how they are seen.
const BENT_POSES: [&str; 4] = ["fist", "point", "pinch", "thumbs-up"];
const VIEWS: usize = 8;
const SIDE: u32 = 200;
const DISTANCE: f64 = 0.6;
const PIXELS_PER_METRE: f64 = 800.0;
/// The silhouette is counted on so many times as many pixels in each direction.
const SILHOUETTE_SCALE: u32 = 4;

/// Part of each pixel that a mesh covers, 0..1, row-major. `faces` are indices into `points` (world, metres).
pub fn silhouette(camera: &Camera, points: &[DVec3], faces: &[[u32; 3]]) -> Vec<f32> {
    let scale = f64::from(SILHOUETTE_SCALE);
    let fine = Camera {
        focal: camera.focal * scale,
        principal: camera.principal * scale,
        width: camera.width * SILHOUETTE_SCALE,
        height: camera.height * SILHOUETTE_SCALE,
        ..camera.clone()
    };
    covered_parts(&covered_pixels(&fine, points, faces), [camera.width, camera.height])
}

/// Part of each pixel that a silhouette covers, from one of [`SILHOUETTE_SCALE`] times the size.
fn covered_parts(is_inside: &[bool], [width, height]: [u32; 2]) -> Vec<f32> {
    let width = width as usize;
    let side = SILHOUETTE_SCALE as usize;
    let mut parts = vec![0.0f32; width * height as usize];
    for (row, pixels) in is_inside.chunks_exact((width * side).max(1)).enumerate() {
        for (column, is_inside) in pixels.iter().enumerate() {
            if let Some(part) = parts.get_mut(row / side * width + column / side) {
                *part += f32::from(u8::from(*is_inside)) / (side * side) as f32;
            }
        }
    }
    parts
}

/// Sums over pictures.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OutlineSums {
    /// Pixels of the template's silhouette.
    silhouette: f64,
    /// Coverage far outside of it, pixels.
    loose: f64,
    /// Frayed pixels of the picture and of the silhouette.
    frayed: [usize; 2],
}

impl OutlineSums {
    /// Adds a picture from its coverage and that of the template's silhouette (both 0..1, row-major).
    pub fn add(&mut self, coverage: &[f32], silhouette: &[f32], size: [u32; 2], pixels_per_metre: f64) {
        let outside = depths(silhouette.iter().map(|part| *part < 0.5), size);
        let distance = LOOSE_DISTANCE * pixels_per_metre;
        let loose = coverage.iter().zip(&outside).filter(|(_, outside)| **outside > distance);
        self.loose += loose.map(|(coverage, _)| f64::from(*coverage)).sum::<f64>();
        self.silhouette += silhouette.iter().map(|part| f64::from(*part)).sum::<f64>();
        for (sum, picture) in self.frayed.iter_mut().zip([coverage, silhouette]) {
            *sum += frayed(picture, size, FRAY_SIZE * pixels_per_metre);
        }
    }

    /// Adds the sums over other pictures.
    pub fn merge(&mut self, other: &OutlineSums) {
        self.silhouette += other.silhouette;
        self.loose += other.loose;
        self.frayed.iter_mut().zip(other.frayed).for_each(|(sum, count)| *sum += count);
    }

    /// The figures.
    pub fn figures(&self) -> Outline {
        let [picture, silhouette] = self.frayed;
        Outline {
            loose_share: (self.silhouette > 0.0).then(|| self.loose / self.silhouette),
            roughness: (silhouette > 0).then(|| picture as f64 / silhouette as f64),
        }
    }
}

/// Figures of pictures; `None` where the template is not in them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Outline {
    /// Coverage more than [`LOOSE_DISTANCE`] outside the template's silhouette, relative to the silhouette's area.
    pub loose_share: Option<f64>,
    /// Area between the outline and itself after a blur of [`FRAY_SIZE`], as a multiple of the same of the template.
    pub roughness: Option<f64>,
}

/// The outline of an avatar with bent fingers, from all around; without figures if its hand model has no named poses.
///
/// # Errors
/// [`RenderError`] if the device cannot draw it.
pub fn bent_outline(gpu: &Gpu, avatar: &Avatar) -> Result<Outline, RenderError> {
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, [SIDE; 2])?;
    let mut sums = OutlineSums::default();
    for pose in BENT_POSES.into_iter().filter_map(|name| named_pose(name, &avatar.model)) {
        scene.set_pose(gpu, 0, 0, &pose)?;
        let posed = pose_hand(&avatar.model, &[], &pose).map_err(|error| RenderError::Invalid(error.to_string()))?;
        let points = posed.vertices;
        let middle = points.iter().sum::<DVec3>() / points.len() as f64;
        for view in 0..VIEWS {
            let eye = middle + spiral_direction(view, VIEWS) * DISTANCE;
            let camera = Camera::look_at(eye, middle, DVec3::Z, 1.0, SIDE, SIDE);
            let camera = Camera { focal: DVec2::splat(PIXELS_PER_METRE * DISTANCE), ..camera };
            let drawn = scene.render(gpu, 0, &camera, [0.0; 3])?.rgba;
            let coverage: Vec<f32> = drawn.iter().map(|pixel| pixel[3]).collect();
            let template = silhouette(&camera, &points, &avatar.model.faces);
            sums.add(&coverage, &template, [SIDE; 2], PIXELS_PER_METRE);
        }
    }
    Ok(sums.figures())
}

/// Number of pixels on one side of the outline (where coverage is a half) that are on its other side after a blur with
/// this standard deviation, pixels.
fn frayed(coverage: &[f32], size: [u32; 2], deviation: f64) -> usize {
    let is_inside = |coverage: &f32| *coverage >= 0.5;
    let blurred = blurred(coverage, size, deviation);
    coverage.iter().zip(&blurred).filter(|(sharp, blurred)| is_inside(sharp) != is_inside(blurred)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: u32 = 80;
    const SIZE: [u32; 2] = [SIDE; 2];
    /// One pixel for each millimetre.
    const PIXELS_PER_METRE: f64 = 1000.0;

    /// A disc of about this radius, pixels, by angle, around the middle.
    fn disc(radius: impl Fn(f64) -> f64) -> Vec<f32> {
        let fine = SIDE * SILHOUETTE_SCALE;
        let is_inside = |x: u32, y: u32| {
            let [x, y] = [x, y].map(|v| (f64::from(v) + 0.5) / f64::from(SILHOUETTE_SCALE) - f64::from(SIDE) / 2.0);
            x.hypot(y) < radius(y.atan2(x))
        };
        let fine: Vec<bool> =
            (0..fine).flat_map(|y| (0..fine).map(move |x| (x, y))).map(|(x, y)| is_inside(x, y)).collect();
        covered_parts(&fine, SIZE)
    }

    /// With a flake of 3 x 3 pixels whose corner is there.
    fn with_flake(mut coverage: Vec<f32>, [left, top]: [u32; 2], opacity: f32) -> Vec<f32> {
        for (x, y) in (0..9).map(|i| (left + i % 3, top + i / 3)) {
            coverage[(y * SIDE + x) as usize] = opacity;
        }
        coverage
    }

    fn figures(coverage: &[f32]) -> [f64; 2] {
        let mut sums = OutlineSums::default();
        sums.add(coverage, &disc(|_| 25.0), SIZE, PIXELS_PER_METRE);
        let Outline { loose_share, roughness } = sums.figures();
        [loose_share.unwrap(), roughness.unwrap()]
    }

    #[test]
    fn the_template_itself_and_a_hand_that_is_a_little_larger_are_neither_loose_nor_rough() {
        assert_eq!(figures(&disc(|_| 25.0)), [0.0, 1.0]);
        let [loose, roughness] = figures(&disc(|angle| 26.5 + 0.8 * angle.cos()));
        // The template's own figure is a few pixels on a disc so small, so that others are small multiples of it: 3.25.
        assert!(loose == 0.0 && roughness < 4.0, "{loose} {roughness}");
    }

    #[test]
    fn loose_flakes_count_by_their_area_and_opacity() {
        let area = std::f64::consts::PI * 625.0;
        for opacity in [1.0, 0.4] {
            // The disc ends at x = 65: one flake is 5 pixels away from it, the other touches it.
            let [far, near] = [71, 65].map(|x| figures(&with_flake(disc(|_| 25.0), [x, 39], opacity)));
            let expected = 9.0 * f64::from(opacity) / area;
            assert!((far[0] / expected - 1.0).abs() < 0.01, "{} instead of {expected}", far[0]);
            assert_eq!(near[0], 0.0);
        }
    }

    #[test]
    fn a_frayed_outline_is_rough_and_a_wide_bulge_is_not() {
        // Teeth 4 mm wide and 2 mm deep, and a hand that is 2 mm thicker to one side.
        let teeth = figures(&disc(|angle| 25.0 + (39.0 * angle).sin().signum()));
        let bulge = figures(&disc(|angle| 26.0 + angle.cos()));
        assert!(teeth[1] > 3.0 && bulge[1] < 1.5, "{teeth:?} {bulge:?}");
    }

    #[test]
    fn sums_are_over_pixels_and_nothing_has_no_figures() {
        let mut sums = OutlineSums::default();
        assert_eq!(sums.figures(), Outline { loose_share: None, roughness: None });
        let without = disc(|_| 25.0);
        sums.add(&with_flake(without.clone(), [2, 2], 1.0), &without, SIZE, PIXELS_PER_METRE);
        let alone = sums.figures().loose_share.unwrap();
        let mut other = OutlineSums::default();
        other.add(&without, &without, SIZE, PIXELS_PER_METRE);
        sums.merge(&other);
        assert!((sums.figures().loose_share.unwrap() - 0.5 * alone).abs() < 1e-12 && alone > 0.0);
    }
}
