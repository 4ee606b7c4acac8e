//! Scenes of Gaussians, normalised in size and position so that a view of them fits.

use std::path::Path;

use anyhow::ensure;
use ghand_avatar::scene_files::SplatScene;
use ghand_render::splat::SplatModel;
use glam::DVec3;

use crate::scene_file::read_scene_file;

/// Lowest opacity of Gaussians that determine the scene's extent: trained scenes have many invisible ones anywhere.
const VISIBLE: f64 = 0.1;
/// Fraction of the Gaussians within a scene's radius before it is enlarged by `MARGIN`.
const MOST: f64 = 0.95;
/// Factor on that radius, so that thin ends such as fingertips are inside as well.
const MARGIN: f64 = 1.1;
/// Largest radius in multiples of the median distance from the middle. A solid ball has 1.3, a hand about 2; more means
/// a background far behind the scene's object.
const SPREAD: f64 = 2.5;

/// Reads a scene and normalises it: its middle becomes the origin and its radius 1, which suits the near plane and the
/// camera's range in any unit.
///
/// # Errors
/// One sentence that names the file and the invalid part.
pub fn read_scene(path: &Path) -> anyhow::Result<SplatScene> {
    let mut scene = read_scene_file(path)?;
    let bounds = Bounds::of(&scene);
    ensure!(
        bounds.is_some_and(|b| normalize(&mut scene, b)),
        "{}: Gaussians: none has a finite position and size; give another scene",
        path.display()
    );
    Ok(scene)
}

/// The extent of most of a scene, in its own units.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bounds {
    middle: DVec3,
    radius: f64,
}

impl Bounds {
    /// The bounds of the visible Gaussians, without outliers.
    fn of(scene: &SplatScene) -> Option<Bounds> {
        let model = scene.model();
        let row = |row: usize| scene.row(row).map(f64::from);
        let columns = |first: usize| row(first).zip(row(first + 1)).zip(row(first + 2));
        let sizes = columns(SplatModel::SCALE_ROW).map(|((x, y), z)| x.max(y).max(z).exp());
        let opacities = row(model.opacity_row()).map(|logit| 1.0 / (1.0 + (-logit).exp()));
        let places = columns(0).map(|((x, y), z)| DVec3::new(x, y, z));
        let all: Vec<(DVec3, f64, f64)> = (places.zip(sizes).zip(opacities))
            .map(|((place, size), opacity)| (place, size, opacity))
            .filter(|(place, size, _)| place.is_finite() && size.is_finite())
            .collect();
        let seen: Vec<&(DVec3, f64, f64)> = all.iter().filter(|g| g.2 >= VISIBLE).collect();
        let chosen = if seen.is_empty() { all.iter().collect() } else { seen };
        let median = |axis: usize| quantile(chosen.iter().map(|g| g.0[axis]).collect(), 0.5);
        let middle = DVec3::new(median(0)?, median(1)?, median(2)?);
        let reaches: Vec<f64> = chosen.iter().map(|g| g.0.distance(middle) + g.1).collect();
        let radius = (MARGIN * quantile(reaches.clone(), MOST)?).min(SPREAD * quantile(reaches, 0.5)?);
        Some(Bounds { middle, radius })
    }
}

/// The value below which a fraction of the values is.
fn quantile(mut values: Vec<f64>, part: f64) -> Option<f64> {
    let place = (values.len().checked_sub(1)? as f64 * part).ceil() as usize;
    Some(*values.select_nth_unstable_by(place, f64::total_cmp).1)
}

/// Moves the middle to the origin and scales the radius to 1. Colours depend only on directions, which stay. Returns
/// whether this was possible.
fn normalize(scene: &mut SplatScene, Bounds { middle, radius }: Bounds) -> bool {
    if !(radius.is_normal() && radius > 0.0 && middle.is_finite()) {
        return false;
    }
    let count = scene.count;
    for (axis, row) in scene.table.chunks_mut(count).take(3).enumerate() {
        row.iter_mut().for_each(|v| *v = ((f64::from(*v) - middle[axis]) / radius) as f32);
    }
    for row in scene.table.chunks_mut(count).skip(SplatModel::SCALE_ROW).take(3) {
        row.iter_mut().for_each(|v| *v = (f64::from(*v) - radius.ln()) as f32);
    }
    true
}

#[cfg(test)]
pub(crate) mod tests {
    use ghand_avatar::scene_files::Antialiasing;

    use super::*;

    /// Round, red Gaussians of this size with these opacities.
    pub(crate) fn scene(places: &[[f32; 3]], size: f32, opacity_logits: &[f32]) -> SplatScene {
        let count = places.len();
        let mut table: Vec<f32> = (0..3).flat_map(|axis| places.iter().map(move |p| p[axis])).collect();
        table.extend(vec![size.ln(); 3 * count]);
        table.extend(vec![1.0; count]);
        table.extend(vec![0.0; 3 * count]);
        table.extend((0..count).map(|i| opacity_logits[i % opacity_logits.len()]));
        table.extend([1.5, -1.5, -1.5].repeat(count));
        SplatScene { degree: 0, count, table, antialias: Antialiasing::Off }
    }

    /// The corners and centres of a grid of edge 2 about `middle`, times `scale`.
    fn grid(middle: [f32; 3], scale: f32) -> Vec<[f32; 3]> {
        let at = |i: usize| (i as f32 - 4.5) / 4.5;
        let place = |k: usize| [at(k % 10), at(k / 10 % 10), at(k / 100)];
        (0..1000).map(place).map(|p| [0, 1, 2].map(|axis| middle[axis] + scale * p[axis])).collect()
    }

    #[test]
    fn a_scene_in_any_unit_and_position_is_normalised_to_radius_one() {
        for (middle, scale) in [([0.0; 3], 1.0), ([300.0, -20.0, 7.0], 40.0), ([1e-3, 0.0, 0.0], 1e-4)] {
            let mut moved = scene(&grid(middle, scale), 0.01 * scale, &[2.0]);
            let bounds = Bounds::of(&moved).unwrap();
            assert!(normalize(&mut moved, bounds));
            // The corners of a cube of edge 2 are at 1.73 from its middle, 95 % of its inside within 1.4.
            let reach = |i: usize| (0..3).map(|axis| moved.table[axis * 1000 + i].powi(2)).sum::<f32>().sqrt();
            let largest = (0..1000).map(reach).fold(0.0, f32::max);
            assert!((0.9..1.15).contains(&largest), "{scale}: {largest}");
            let size = f64::from(moved.table[SplatModel::SCALE_ROW * 1000]).exp();
            assert!((size - 0.01 * scale as f64 / bounds.radius).abs() < 1e-6, "{scale}: {size}");
        }
    }

    #[test]
    fn outliers_and_invisible_gaussians_do_not_count() {
        let places = grid([1.0, 2.0, 3.0], 0.5);
        let plain = Bounds::of(&scene(&places, 0.01, &[2.0])).unwrap();
        let near = |other: Bounds, times: f64| {
            assert!(other.middle.distance(plain.middle) < 0.2 * plain.radius, "{other:?} {plain:?}");
            assert!((other.radius / plain.radius).ln().abs() < times.ln(), "{other:?} {plain:?}");
        };
        // Floaters, a few of them not finite.
        let mut outliers = places.clone();
        outliers.extend((0..30).map(|i| [1e3 + i as f32, -500.0, 1e6]));
        outliers.extend([[f32::NAN, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0]]);
        near(Bounds::of(&scene(&outliers, 0.01, &[2.0])).unwrap(), 1.2);
        // A background on all sides.
        let mut background = places.clone();
        background.extend(grid([1.0, 2.0, 3.0], 80.0).into_iter().step_by(4));
        near(Bounds::of(&scene(&background, 0.01, &[2.0])).unwrap(), 2.0);
        // Every other Gaussian is far away and nearly transparent.
        let mixed: Vec<[f32; 3]> = places.iter().flat_map(|p| [*p, [p[0] + 50.0, p[1], p[2]]]).collect();
        near(Bounds::of(&scene(&mixed, 0.01, &[2.0, -5.0])).unwrap(), 1.01);
    }

    #[test]
    fn one_gaussian_is_a_scene_and_none_is_not() {
        let one = Bounds::of(&scene(&[[1.0, 0.0, 0.0]], 0.2, &[0.0])).unwrap();
        assert!((one.radius - 0.22).abs() < 1e-6 && one.middle == DVec3::X, "{one:?}");
        assert_eq!(Bounds::of(&scene(&[], 0.2, &[0.0])), None);
        assert_eq!(Bounds::of(&scene(&[[f32::NAN; 3]], 0.2, &[0.0])), None);
        let mut points = scene(&[[0.0; 3]; 4], 0.0, &[0.0]);
        let bounds = Bounds::of(&points).unwrap();
        assert!(!normalize(&mut points, bounds), "points without a size at one place");
    }
}
