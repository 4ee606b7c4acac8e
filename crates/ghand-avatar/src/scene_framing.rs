//! Places cameras so that a scene of Gaussians fills the picture, ignoring outliers.

use std::f64::consts::TAU;
use std::str::FromStr;

use crate::scene_files::SplatScene;
use ghand_core::Camera;
use ghand_core::statistics::median;
use ghand_render::splat::NEAR;
use glam::{DQuat, DVec2, DVec3};

use crate::framing::middle;

/// Fraction of the picture, from edge to edge, that the scene may fill.
const FILL: f64 = 0.9;
/// Distance of the cameras, in multiples of the scene's radius: about that of a portrait.
const DISTANCE: f64 = 4.0;
/// Gaussians that extend farther from the middle than this many times the median are outliers, which training leaves
/// far away. All of a ball is within 1.3, all of a rod within 2.
const STRAY: f64 = 3.0;
/// Visible radius of a Gaussian, in standard deviations.
const REACH: f64 = 2.0;
/// Logit of the opacity below which Gaussians are hardly visible: that of 0.05.
const FAINT: f32 = -2.944;

/// Which axis of a scene points up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpAxis(DVec3);

impl Default for UpAxis {
    /// That of scenes from images.
    fn default() -> Self {
        UpAxis(DVec3::NEG_Y)
    }
}

impl FromStr for UpAxis {
    type Err = String;

    fn from_str(text: &str) -> Result<UpAxis, String> {
        let axis = match text.strip_prefix(['-', '+']).unwrap_or(text) {
            "x" => DVec3::X,
            "y" => DVec3::Y,
            "z" => DVec3::Z,
            _ => return Err("must be x, y, z, -x, -y or -z".into()),
        };
        Ok(UpAxis(if text.starts_with('-') { -axis } else { axis }))
    }
}

impl UpAxis {
    /// Direction from the middle to the first camera of a turntable: for y, on the side from which OpenCV's cameras
    /// look.
    fn front(self) -> DVec3 {
        if self.0.z == 0.0 { DVec3::NEG_Z } else { DVec3::NEG_Y }
    }
}

/// A Gaussian for framing: its centre and its visible radius.
#[derive(Clone, Copy)]
struct Ball {
    center: DVec3,
    radius: f64,
}

/// Cameras around a scene, with everything except outliers in view.
pub fn scene_turntable(scene: &SplatScene, views: usize, up: UpAxis, [width, height]: [u32; 2]) -> Vec<Camera> {
    let balls = belonging(balls(scene));
    let corners: Vec<DVec3> = balls.iter().flat_map(|b| [b.center - b.radius, b.center + b.radius]).collect();
    let target = middle(&corners);
    let radius = balls.iter().map(|b| b.center.distance(target) + b.radius).fold(0.0, f64::max);
    let distance = (DISTANCE * radius).max(radius + 2.0 * f64::from(NEAR));
    let camera = |view: usize, fov_y: f64| {
        let direction = DQuat::from_axis_angle(up.0, TAU * view as f64 / views as f64) * up.front();
        Camera::look_at(target + direction * distance, target, up.0, fov_y, width, height)
    };
    // The picture's half size at distance 1 that contains every ball in every view.
    let aspect = f64::from(width) / f64::from(height);
    let mut slope = 0.0f64;
    for camera in (0..views).map(|view| camera(view, 1.0)) {
        for ball in &balls {
            let p = camera.camera_from_world(ball.center);
            let reach = (p.truncate().abs() + ball.radius) / p.z;
            slope = slope.max((reach / DVec2::new(aspect, 1.0)).max_element());
        }
    }
    let fov_y = 2.0 * (slope.clamp(1e-3, 10.0) / FILL).atan();
    (0..views).map(|view| camera(view, fov_y)).collect()
}

/// The visible Gaussians, or all if none is visible.
fn balls(scene: &SplatScene) -> Vec<Ball> {
    let model = scene.model();
    let n = scene.count;
    let at = |row: usize, i: usize| scene.table.get(row * n + i).copied().unwrap_or(f32::NAN);
    let ball = |i: usize| {
        let center = DVec3::from([0, 1, 2].map(|row| f64::from(at(row, i))));
        let sizes = (0..model.scale_rows()).map(|k| f64::from(at(ghand_render::splat::SplatModel::SCALE_ROW + k, i)));
        let radius = REACH * sizes.fold(f64::NEG_INFINITY, f64::max).exp();
        (center.is_finite() && radius.is_finite()).then_some(Ball { center, radius })
    };
    let seen: Vec<Ball> = (0..n).filter(|i| at(model.opacity_row(), *i) >= FAINT).filter_map(ball).collect();
    if seen.is_empty() { (0..n).filter_map(ball).collect() } else { seen }
}

/// The Gaussians near the median of all.
fn belonging(balls: Vec<Ball>) -> Vec<Ball> {
    let center = DVec3::from([0, 1, 2].map(|axis| median(balls.iter().map(|b| b.center[axis]))));
    let typical = median(balls.iter().map(|b| b.center.distance(center) + b.radius));
    let belongs = |b: &Ball| b.center.distance(center) + b.radius <= STRAY * typical;
    balls.into_iter().filter(belongs).collect()
}

#[cfg(test)]
mod tests {
    use crate::{Avatar, AvatarConfig};
    use ghand_test_support::procedural_hand::ProceduralHand;

    use crate::scene_files::Antialiasing;

    use super::*;

    /// The table of a hand's Gaussians, and additional `stray` ones: centre, logarithm of the size, logit.
    fn scene(stray: &[(DVec3, f32, f32)]) -> SplatScene {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let config = AvatarConfig { uv_resolution: 64, ..Default::default() };
        let avatar = Avatar::untrained(&model, &config, [0.5; 3], 0).unwrap();
        let n = avatar.template.len();
        let mut gaussians: Vec<(DVec3, f32, f32)> = (0..n)
            .map(|i| (DVec3::from([0, 1, 2].map(|c| f64::from(avatar.template.rest[c * n + i]))), -7.0, 5.0))
            .collect();
        gaussians.extend(stray);
        let row = |value: &dyn Fn(&(DVec3, f32, f32)) -> f32| gaussians.iter().map(value).collect::<Vec<f32>>();
        let mut table = Vec::new();
        (0..3).for_each(|axis| table.extend(row(&|g| g.0[axis] as f32)));
        (0..3).for_each(|_| table.extend(row(&|g| g.1)));
        (0..4).for_each(|k| table.extend(row(&|_| if k == 0 { 1.0 } else { 0.0 })));
        table.extend(row(&|g| g.2));
        (0..3).for_each(|_| table.extend(row(&|_| 0.0)));
        SplatScene { degree: 0, count: gaussians.len(), table, antialias: Antialiasing::Off }
    }

    #[test]
    fn a_scene_fills_the_picture_from_all_sides_with_any_up_axis() {
        let hand = scene(&[]);
        for (up, size) in [("-y", [300, 300]), ("z", [200, 400]), ("x", [400, 200])] {
            let up: UpAxis = up.parse().unwrap();
            let mut most = 0.0f64;
            for camera in scene_turntable(&hand, 5, up, size) {
                let above = camera.rotation * up.0;
                assert!(above.y < -0.999, "up points up");
                for ball in balls(&hand) {
                    let (p, z) = camera.project(ball.center);
                    let reach = ball.radius * camera.focal.x / z;
                    let edge = (p / DVec2::new(size[0].into(), size[1].into()) - 0.5).abs()
                        + reach / DVec2::new(size[0].into(), size[1].into());
                    most = most.max(edge.max_element());
                }
            }
            assert!((most - 0.5 * FILL).abs() < 1e-6, "{most}");
        }
    }

    #[test]
    fn outliers_and_faint_or_broken_gaussians_change_nothing() {
        let near = scene_turntable(&scene(&[]), 3, UpAxis(DVec3::NEG_Y), [64, 64]);
        let mut stray: Vec<(DVec3, f32, f32)> =
            (0..40).map(|k| (DVec3::new((f64::from(k)).sin(), 0.3, f64::from(k)) * 50.0, 0.0, 3.0)).collect();
        stray.push((DVec3::ZERO, 4.0, 3.0));
        stray.push((DVec3::splat(0.15), -7.0, -6.0));
        stray.push((DVec3::new(f64::NAN, 0.0, 0.0), -7.0, 6.0));
        let far = scene_turntable(&scene(&stray), 3, UpAxis(DVec3::NEG_Y), [64, 64]);
        for (a, b) in near.iter().zip(&far) {
            assert!(a.center().distance(b.center()) < 1e-9 && (a.focal - b.focal).length() < 1e-6, "{a:?} {b:?}");
        }
    }

    #[test]
    fn scenes_without_extent_get_cameras_too() {
        for gaussians in [0, 1] {
            let table = vec![0.0; 14 * gaussians];
            let scene = SplatScene { degree: 0, count: gaussians, table, antialias: Antialiasing::Off };
            let cameras = scene_turntable(&scene, 2, "y".parse().unwrap(), [10, 10]);
            assert!(cameras.len() == 2 && cameras.iter().all(|c| c.center().is_finite() && c.focal.is_finite()));
        }
        assert!("w".parse::<UpAxis>().is_err() && "-".parse::<UpAxis>().is_err());
    }
}
