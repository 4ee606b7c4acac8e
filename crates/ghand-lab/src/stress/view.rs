//! Poses and views with something extreme about each, rounded to f32 as the device rounds them.

use std::f64::consts::PI;

use ghand_avatar::Template;
use ghand_avatar::reference::PosedGaussians;
use ghand_core::pose::{LARGEST_ANGLE, LARGEST_TRANSLATION};
use ghand_core::{Camera, Pose};
use glam::{DMat3, DVec2, DVec3};
use rand::RngExt;

use super::hand::{Sampler, usual_pose};

/// What is extreme about a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseKind {
    /// Nothing.
    Usual,
    /// No rotation.
    Rest,
    /// Angles of 1e-12 to 1e-3 rad.
    TinyAngles,
    /// Half turns, exact and nearly.
    HalfTurns,
    /// Whole turns, exact and nearly.
    WholeTurns,
    /// The largest angles that a pose may have.
    ManyTurns,
    /// Up to a kilometre away.
    FarAway,
}

/// All kinds.
pub const POSES: [PoseKind; 7] = {
    use PoseKind::*;
    [Usual, Rest, TinyAngles, HalfTurns, WholeTurns, ManyTurns, FarAway]
};

impl PoseKind {
    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            PoseKind::Usual => "usual",
            PoseKind::Rest => "rest",
            PoseKind::TinyAngles => "angles 1e-12 to 1e-3",
            PoseKind::HalfTurns => "half turns",
            PoseKind::WholeTurns => "whole turns",
            PoseKind::ManyTurns => "angles to 100 rad",
            PoseKind::FarAway => "to 1 km away",
        }
    }

    /// A pose of this kind.
    pub fn draw(self, draw: &mut Sampler, template: &Template) -> Pose {
        let mut pose = usual_pose(draw, template);
        let mut turn = |angle: &mut dyn FnMut(&mut Sampler) -> f64| {
            for rotation in &mut pose.rotations {
                let axis = draw.vector(1.0).try_normalize().unwrap_or(DVec3::X);
                *rotation = (axis * angle(draw)).as_vec3().as_dvec3();
            }
        };
        match self {
            PoseKind::Usual => {}
            PoseKind::Rest => turn(&mut |_| 0.0),
            PoseKind::TinyAngles => turn(&mut |draw| draw.log(1e-12, 1e-3)),
            PoseKind::HalfTurns => turn(&mut |draw| PI + draw.one(&[0.0, 1e-7, -1e-7, 1e-3, -1e-3])),
            PoseKind::WholeTurns => turn(&mut |draw| 2.0 * PI + draw.one(&[0.0, 1e-7, -1e-7, 1e-3, -1e-3])),
            PoseKind::ManyTurns => turn(&mut |draw| draw.0.random_range(10.0..LARGEST_ANGLE)),
            PoseKind::FarAway => {
                let far = draw.log(1.0, LARGEST_TRANSLATION / 2.0);
                pose.translation = draw.vector(far);
            }
        }
        pose
    }
}

/// What is extreme about a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewKind {
    /// Nothing.
    Usual,
    /// From as near as the splatter draws.
    Near,
    /// From within the hand.
    Inside,
    /// Away from the hand.
    Away,
    /// From far, without magnification.
    Far,
    /// From far, magnified so that the hand fills the picture.
    Telescope,
    /// A focal length of some pixels.
    Wide,
    /// Pictures of one pixel, one row and one column.
    FewPixels,
    /// A principal point outside the picture.
    OffCentre,
}

/// All kinds.
pub const VIEWS: [ViewKind; 9] = {
    use ViewKind::*;
    [Usual, Near, Inside, Away, Far, Telescope, Wide, FewPixels, OffCentre]
};

/// Largest edge of a picture, pixels.
pub const LARGEST_EDGE: u32 = 32;

impl ViewKind {
    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            ViewKind::Usual => "usual",
            ViewKind::Near => "1 to 30 mm from the skin",
            ViewKind::Inside => "inside the hand",
            ViewKind::Away => "away from the hand",
            ViewKind::Far => "from far",
            ViewKind::Telescope => "from far, magnified",
            ViewKind::Wide => "focal length of 1 to 4 pixels",
            ViewKind::FewPixels => "1x1 to 1x32 pixels",
            ViewKind::OffCentre => "principal point outside",
        }
    }

    /// A camera of this kind for a posed hand.
    pub fn draw(self, draw: &mut Sampler, hand: &PosedGaussians) -> Camera {
        let points: Vec<DVec3> = hand.means.iter().copied().filter(|mean| mean.length() < 1e6).collect();
        let count = points.len().max(1) as f64;
        let middle = points.iter().sum::<DVec3>() / count;
        let spread = points.iter().map(|point| point.distance(middle)).sum::<f64>() / count;
        let thickness = hand.scales.iter().filter(|s| s.is_finite()).sum::<f64>() / count;
        let size = (spread + 2.0 * thickness).clamp(1e-6, 1e6);
        let toward = draw.vector(1.0).try_normalize().unwrap_or(DVec3::Z);
        let distance = match self {
            ViewKind::Near => draw.log(1e-3, 0.03),
            ViewKind::Inside => 1e-3 * size,
            ViewKind::Far | ViewKind::Telescope => draw.log(1e2, 1e5) * size,
            _ => draw.0.random_range(3.0..8.0) * size,
        };
        let target = match self {
            ViewKind::Near if !points.is_empty() => draw.one(&points),
            _ => middle,
        };
        let eye = target + toward * distance;
        let target = if self == ViewKind::Away { eye + toward } else { target };
        let up = draw.vector(1.0);
        let up = if up.cross(toward).length() > 1e-3 { up } else { toward.any_orthogonal_vector() };
        let [width, height] = match self {
            ViewKind::FewPixels => draw.one(&[[1, 1], [1, LARGEST_EDGE], [LARGEST_EDGE, 1], [9, 8]]),
            _ => [24, 18].map(|edge| draw.0.random_range(edge / 2..=LARGEST_EDGE.min(2 * edge))),
        };
        let fov = match self {
            ViewKind::Telescope => 3.0 * size / distance,
            _ => draw.0.random_range(0.4..1.0),
        };
        let mut camera = Camera::look_at(eye, target, up, fov, width, height);
        match self {
            ViewKind::Wide => camera.focal = DVec2::splat(draw.0.random_range(1.0..4.0)),
            ViewKind::OffCentre => {
                let by = draw.log(10.0, 1e3);
                camera.principal += DVec2::new(by, -0.5 * by) * draw.one(&[1.0, -1.0]);
            }
            _ => camera.focal.y *= draw.0.random_range(0.8..1.25),
        }
        let rounded = |v: DVec2| v.as_vec2().as_dvec2();
        Camera {
            focal: rounded(camera.focal),
            principal: rounded(camera.principal),
            rotation: DMat3::from_cols_array(&camera.rotation.to_cols_array().map(|v| f64::from(v as f32))),
            translation: camera.translation.as_vec3().as_dvec3(),
            ..camera
        }
    }
}
