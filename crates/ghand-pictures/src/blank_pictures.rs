//! Tells of pictures that show nothing, and why.

use ghand_core::Camera;
use ghand_render::mesh::NEAR_PLANE;
use glam::DVec2;
use glam::DVec3;

use crate::Picture;

/// Things smaller than this many pixels are next to nothing.
const LEAST_PIXELS: f64 = 2.0;
/// A picture with more pixels of a thing needs no further look.
const ENOUGH_PIXELS: usize = 64;

/// Fewer points say nothing about the size of a thing.
const LEAST_POINTS: usize = 8;

/// Why a picture shows nothing of a thing, or next to nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Blank {
    /// It is behind the camera, or nearer than its near plane.
    Behind,
    /// It is beside the picture.
    Outside,
    /// It is this far away, and so small.
    Far(f64),
    /// It is in front of the camera, but nothing of it can be seen.
    Invisible,
}

impl Blank {
    /// The reason, as the end of a sentence on the thing.
    pub fn reason(self) -> String {
        match self {
            Blank::Behind => {
                format!(
                    "is behind the camera, or nearer than {NEAR_PLANE}; check the camera's rotation and translation"
                )
            }
            Blank::Outside => {
                "is outside of the picture; check the camera's rotation, translation and intrinsics".into()
            }
            Blank::Far(distance) => format!(
                "is {distance:.1} away and smaller than {LEAST_PIXELS} pixels; check the units, or bring the camera nearer"
            ),
            Blank::Invisible => "has nothing there that is opaque enough to be seen".into(),
        }
    }

    /// Why a picture with `covered` pixels of a thing of these points shows next to nothing; `None` if it shows the thing.
    pub fn of<P: IntoIterator<Item = DVec3>>(
        camera: &Camera,
        covered: usize,
        points: impl FnOnce() -> P,
    ) -> Option<Blank> {
        if covered >= ENOUGH_PIXELS {
            return None;
        }
        let mut low = DVec2::INFINITY;
        let mut high = DVec2::NEG_INFINITY;
        let mut nearest = f64::INFINITY;
        let mut count = 0;
        for point in points().into_iter().filter(|point| point.is_finite()) {
            let (pixel, depth) = camera.project(point);
            count += 1;
            if depth > NEAR_PLANE {
                (low, high, nearest) = (low.min(pixel), high.max(pixel), nearest.min(depth));
            }
        }
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        if count > 0 && nearest.is_infinite() {
            return Some(Blank::Behind).filter(|_| covered == 0);
        }
        let inside = high.cmpge(DVec2::ZERO).all() && low.cmple(size).all();
        if inside && (high - low).max_element() < LEAST_PIXELS && count >= LEAST_POINTS {
            return Some(Blank::Far(nearest));
        }
        match (covered, count > 0 && !inside) {
            (0, true) => Some(Blank::Outside),
            (0, false) => Some(Blank::Invisible),
            _ => None,
        }
    }
}

/// Counts the pictures of a series that show nothing.
#[derive(Debug, Default)]
pub struct BlankPictures {
    blank: usize,
    all: usize,
    reason: Option<Blank>,
}

impl BlankPictures {
    /// Looks at a picture of a thing of these points.
    pub fn look<P: IntoIterator<Item = DVec3>>(
        &mut self,
        picture: &Picture,
        camera: &Camera,
        points: impl FnOnce() -> P,
    ) {
        self.all += 1;
        if let Some(reason) = Blank::of(camera, picture.covered(), points) {
            self.blank += 1;
            self.reason.get_or_insert(reason);
        }
    }

    /// Warns of them in one line; `thing` is what the pictures are of.
    pub fn warn(&self, thing: &str) {
        let Some(reason) = self.reason.map(Blank::reason) else { return };
        match (self.blank, self.all) {
            (_, 1) => log::warn!("the picture shows nothing, or next to nothing: {thing} {reason}"),
            (blank, all) => {
                log::warn!(
                    "{blank} of {all} pictures show nothing, or next to nothing; in the first, {thing} {reason}"
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(at: DVec3) -> impl Iterator<Item = DVec3> {
        (0..8).map(move |k| at + 0.1 * DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)))
    }

    #[test]
    fn the_reason_is_where_the_thing_is() {
        let camera = Camera::look_at(DVec3::ZERO, DVec3::Z, DVec3::NEG_Y, 0.7, 100, 80);
        let why = |at: DVec3, covered| Blank::of(&camera, covered, || cube(at));
        assert_eq!(why(DVec3::new(0.0, 0.0, -2.0), 0), Some(Blank::Behind));
        assert_eq!(why(DVec3::new(5.0, 0.0, 2.0), 0), Some(Blank::Outside));
        assert_eq!(why(DVec3::new(0.0, -9.0, 2.0), 0), Some(Blank::Outside));
        assert_eq!(why(DVec3::new(0.0, 0.0, 450.0), 3), Some(Blank::Far(450.0)));
        assert_eq!(why(DVec3::new(0.0, 0.0, 2.0), 0), Some(Blank::Invisible));
        assert_eq!(why(DVec3::new(0.0, 0.0, 2.0), 30), None);
        // A corner of it is in the picture.
        assert_eq!(why(DVec3::new(0.6, 0.0, 2.0), 5), None);
        assert_eq!(Blank::of(&camera, 0, Vec::new), Some(Blank::Invisible));
    }
}
