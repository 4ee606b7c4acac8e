//! Where points of the world are on the screen.

use egui::{Pos2, Rect, Vec2};
use ghand_core::Camera;
use glam::{DVec2, DVec3};

/// A view on the screen.
#[derive(Debug, Clone)]
pub struct Screen {
    /// Its rectangle, points.
    pub rect: Rect,
    /// The camera of the picture that fills it.
    pub camera: Camera,
}

impl Screen {
    /// Position on the screen and depth (metres) of a point (metres, world); `None` behind the camera.
    pub fn project(&self, world: DVec3) -> Option<(Pos2, f64)> {
        let (pixel, depth) = self.camera.project(world);
        let size = DVec2::new(self.camera.width.into(), self.camera.height.into());
        let part = pixel / size;
        let offset = Vec2::new(part.x as f32 * self.rect.width(), part.y as f32 * self.rect.height());
        (depth > 0.0 && part.is_finite()).then(|| (self.rect.min + offset, depth))
    }

    /// The offset in the world, metres, that looks like this one in points at a depth.
    pub fn unproject_offset(&self, by: Vec2, depth: f64) -> DVec3 {
        let size = DVec2::new(self.camera.width.into(), self.camera.height.into());
        let extent = DVec2::new(self.rect.width().into(), self.rect.height().into());
        let slope = DVec2::new(by.x.into(), by.y.into()) / extent * size / self.camera.focal;
        self.camera.rotation.transpose() * (slope * depth).extend(0.0)
    }

    /// Length in points of a length in metres at a depth.
    pub fn points(&self, metres: f64, depth: f64) -> f32 {
        let scale = f64::from(self.rect.width()) / f64::from(self.camera.width);
        (metres / depth * self.camera.focal.x * scale) as f32
    }
}

#[cfg(test)]
mod tests {
    use egui::{pos2, vec2};

    use super::*;

    #[test]
    fn offsets_on_the_screen_and_in_the_world_agree() {
        let camera = Camera::look_at(DVec3::new(0.3, 0.2, -0.7), DVec3::ZERO, DVec3::NEG_Y, 0.5, 200, 120);
        // Two pixels for each point.
        let screen = Screen { rect: Rect::from_min_size(pos2(260.0, 30.0), vec2(100.0, 60.0)), camera };
        let point = DVec3::new(0.02, -0.03, 0.05);
        let (at, depth) = screen.project(point).unwrap();
        let by = vec2(7.0, -11.0);
        let (moved, same_depth) = screen.project(point + screen.unproject_offset(by, depth)).unwrap();
        assert!((moved - at - by).length() < 1e-3 && (depth - same_depth).abs() < 1e-9);
        let (aside, _) = screen.project(point + screen.camera.rotation.row(0) * 0.01).unwrap();
        assert!((aside.distance(at) - screen.points(0.01, depth)).abs() < 1e-3);
        assert_eq!(screen.project(DVec3::new(0.6, 0.4, -1.4)), None);
    }
}
