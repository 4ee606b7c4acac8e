//! Pinhole cameras with OpenCV's axes.

use glam::{DMat3, DMat4, DVec2, DVec3};

/// A calibrated pinhole camera without distortion.
///
/// Camera axes are OpenCV's (x right, y down, z forward), `x_camera = rotation * x_world + translation`, and the centre
/// of pixel (0, 0) is at (0.5, 0.5).
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Name of the camera, unique within its capture.
    pub id: String,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal lengths (fx, fy) in pixels.
    pub focal: DVec2,
    /// Principal point (cx, cy) in pixels.
    pub principal: DVec2,
    /// Rotation `camera_from_world`.
    pub rotation: DMat3,
    /// Translation `camera_from_world`, metres.
    pub translation: DVec3,
}

impl Camera {
    /// The point in camera coordinates (metres) of a world point (metres).
    pub fn camera_from_world(&self, world: DVec3) -> DVec3 {
        self.rotation * world + self.translation
    }

    /// Centre of projection in world coordinates, metres.
    pub fn center(&self) -> DVec3 {
        -(self.rotation.transpose() * self.translation)
    }

    /// Pixel coordinates and depth (camera z, metres) of a world point. The depth is not positive for points behind
    /// the camera; their pixel coordinates are meaningless.
    pub fn project(&self, world: DVec3) -> (DVec2, f64) {
        let p = self.camera_from_world(world);
        (DVec2::new(p.x / p.z, p.y / p.z) * self.focal + self.principal, p.z)
    }

    /// The same camera looking at the window of `width` x `height` pixels whose top left corner is pixel (x, y).
    /// The window may reach beyond the image.
    pub fn cropped(&self, x: i32, y: i32, width: u32, height: u32) -> Camera {
        Camera { width, height, principal: self.principal - DVec2::new(f64::from(x), f64::from(y)), ..self.clone() }
    }

    /// The same view at another image size: the field of view is kept along the axis that shrinks most.
    pub fn resized(&self, width: u32, height: u32) -> Camera {
        let scale = (f64::from(width) / f64::from(self.width)).min(f64::from(height) / f64::from(self.height));
        let center = DVec2::new(f64::from(self.width), f64::from(self.height)) * 0.5;
        let new_center = DVec2::new(f64::from(width), f64::from(height)) * 0.5;
        Camera {
            width,
            height,
            focal: self.focal * scale,
            principal: new_center + (self.principal - center) * scale,
            ..self.clone()
        }
    }

    /// The camera of a graphics program: `camera_from_world` with OpenGL's axes (x right, y up, z backward), and a
    /// perspective projection, off-centre or not, to a clip space whose y points up and whose w is the distance along the
    /// axis. Depth ranges, reversed or not, make no difference.
    pub fn from_view_and_projection(camera_from_world: &DMat4, projection: &DMat4, width: u32, height: u32) -> Camera {
        // OpenCV's y and z axes point the other way.
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let half = DVec2::new(f64::from(width), f64::from(height)) * 0.5;
        let [x, y, z, _] = projection.to_cols_array_2d();
        Camera {
            id: "view".into(),
            width,
            height,
            focal: DVec2::new(x[0], y[1]) * half,
            principal: half * DVec2::new(1.0 - z[0], 1.0 + z[1]),
            rotation: flip * DMat3::from_mat4(*camera_from_world),
            translation: flip * camera_from_world.w_axis.truncate(),
        }
    }

    /// A camera at `eye` that looks at `target`, `up` pointing up in the image, with the vertical field of view
    /// `fov_y` (radians). `up` must not be parallel to the line of sight.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, fov_y: f64, width: u32, height: u32) -> Camera {
        let z = (target - eye).normalize();
        let x = z.cross(up).normalize();
        let y = z.cross(x);
        let rotation = DMat3::from_cols(x, y, z).transpose();
        let f = 0.5 * f64::from(height) / (0.5 * fov_y).tan();
        Camera {
            id: "view".into(),
            width,
            height,
            focal: DVec2::splat(f),
            principal: DVec2::new(f64::from(width), f64::from(height)) * 0.5,
            rotation,
            translation: -(rotation * eye),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_at_puts_the_target_in_the_middle_with_up_upwards() {
        let c = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.1, 0.2, 0.3), DVec3::Z, 0.7, 64, 48);
        let (center, depth) = c.project(DVec3::new(0.1, 0.2, 0.3));
        assert!((center - DVec2::new(32.0, 24.0)).length() < 1e-12 && depth > 0.0);
        let (above, _) = c.project(DVec3::new(0.1, 0.2, 0.4));
        assert!(above.y < 24.0 && (above.x - 32.0).abs() < 1e-9);
        assert!((c.rotation.determinant() - 1.0).abs() < 1e-12);
        assert!((c.center() - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
    }

    #[test]
    fn a_graphics_programs_camera_projects_as_its_matrices() {
        let view =
            glam::dcamera::rh::view::look_at_mat4(DVec3::new(0.3, -0.2, 0.9), DVec3::new(0.05, 0.0, 0.1), DVec3::Y);
        // Off-centre, as for an eye of a headset.
        let projection = DMat4::from_cols_array_2d(&[
            [1.4, 0.0, 0.0, 0.0],
            [0.0, 2.0, 0.0, 0.0],
            [0.3, -0.2, -1.01, -1.0],
            [0.0, 0.0, -0.1, 0.0],
        ]);
        let camera = Camera::from_view_and_projection(&view, &projection, 200, 120);
        for point in [DVec3::ZERO, DVec3::new(0.1, 0.2, -0.3), DVec3::new(-0.2, 0.05, 0.2)] {
            let clip = projection * view * point.extend(1.0);
            let pixel = DVec2::new((1.0 + clip.x / clip.w) * 100.0, (1.0 - clip.y / clip.w) * 60.0);
            let (projected, depth) = camera.project(point);
            assert!((projected - pixel).length() < 1e-9 && (depth - clip.w).abs() < 1e-12, "{projected} {pixel}");
        }
        assert!((camera.rotation.determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn cropping_moves_pixels_and_nothing_else() {
        let c = Camera::look_at(DVec3::new(0.0, 0.0, -2.0), DVec3::ZERO, DVec3::Y, 0.5, 100, 80);
        let p = DVec3::new(0.05, -0.1, 0.2);
        let d = c.project(p).0 - c.cropped(7, -3, 20, 20).project(p).0;
        assert!((d - DVec2::new(7.0, -3.0)).length() < 1e-12);
    }
}
