//! A frame of the view, below all that draws it: what it depends on, the stages of its drawing, and their times.

use std::collections::VecDeque;

use ghand_avatar::Light;
use ghand_core::{Camera, Pose};

/// Number of times whose median is shown.
const TIMES: usize = 60;
/// Stages of a picture: the hand's pose, the projection of its Gaussians, their order by depth, their lists by tile, the
/// blending, and the picture on the screen.
pub const STAGES: [&str; 6] = ["pose", "project", "sort", "tiles", "blend", "show"];

/// The times of one picture, milliseconds, by stage. A device without timestamps has only their sum, as the blending.
pub type StageTimes = [f64; STAGES.len()];

/// Everything that a picture depends on.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureInputs {
    /// The pose, if the subject has one.
    pub pose: Option<Pose>,
    /// The shape, if the subject has one.
    pub shape: Vec<f64>,
    /// The light, if it is apart from the subject's colours.
    pub light: Option<Light>,
    /// The camera; its size is the picture's.
    pub camera: Camera,
    /// Colour behind the subject, display values.
    pub background: [f32; 3],
}

impl PictureInputs {
    /// Whether another picture shows the same, perhaps in another size.
    pub fn shows_the_same(&self, other: &PictureInputs) -> bool {
        // Whole pixels change the field of view a little.
        let field = |camera: &Camera| camera.focal.x / f64::from(camera.width.min(camera.height));
        let (a, b) = (&self.camera, &other.camera);
        self.pose == other.pose
            && self.shape == other.shape
            && self.light == other.light
            && self.background == other.background
            && (a.rotation, a.translation) == (b.rotation, b.translation)
            && (field(a) / field(b) - 1.0).abs() < 0.01
    }
}

/// Median of the last times.
#[derive(Debug, Clone, Default)]
pub struct Median {
    times: VecDeque<f64>,
}

impl Median {
    /// Adds a time.
    pub fn add(&mut self, time: f64) {
        if self.times.len() == TIMES {
            self.times.pop_front();
        }
        self.times.push_back(time);
    }

    /// Forgets all times.
    pub fn clear(&mut self) {
        self.times.clear();
    }

    /// The median, if there is any time.
    pub fn get(&self) -> Option<f64> {
        let mut sorted: Vec<f64> = self.times.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_that_of_the_last_sixty() {
        let mut median = Median::default();
        assert_eq!(median.get(), None);
        (0..1000).for_each(|t| median.add(f64::from(t)));
        assert_eq!(median.get(), Some(970.0));
    }
}
