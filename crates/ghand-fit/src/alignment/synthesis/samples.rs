//! Pixels of a drawn image against those of the true one, with what moves them.

use ghand_render::splat::Image;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::visible_faces::VisibleFaces;
use crate::alignment::blur::blurred;
use crate::views::TrainView;

/// A band of spatial frequencies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Standard deviations of the blurs whose difference it is, pixels.
    pub blurs: [f64; 2],
    /// One in so many rows and columns is sampled.
    pub step: usize,
}

/// A pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The face that it moves with.
    pub face: u32,
    /// What is drawn less what is true, display values.
    pub residual: f64,
    /// Its derivative by the place of the face, per metre, world axes.
    pub gradient: DVec3,
    /// Squared slope of the image, per squared pixel.
    pub squared_slope: f64,
}

/// The samples of a view, drawn with the surface at `positions` (metres, world axes), at the pixels that are used.
///
/// A surface that moves carries its pixels along: what is drawn changes by less its slope times the motion in the image. As
/// slope the mean of the drawn and the true one is taken, with which a step is right to second order.
pub fn samples(
    view: &TrainView,
    drawn: &Image,
    positions: &[DVec3],
    faces: &[[u32; 3]],
    band: Band,
    is_used: impl Fn([usize; 2]) -> bool,
) -> Vec<Sample> {
    let [columns, rows] = view.size.map(|edge| edge as usize);
    let camera = &view.camera;
    let grey_of_drawn = || drawn.rgba.iter().map(|[r, g, b, _]| (r + g + b) / 3.0).collect::<Vec<f32>>();
    let grey_of_view =
        || view.pixels.iter().map(|[r, g, b, _]| (f32::from(*r) + f32::from(*g) + f32::from(*b)) / 765.0).collect();
    let in_band = |image: Vec<f32>| -> Vec<f32> {
        let [near, far] = band.blurs.map(|blur| blurred(&image, [columns, rows], blur));
        near.iter().zip(&far).map(|(near, far)| near - far).collect()
    };
    let reach = (1.5 * band.blurs[0] + 1.0) as usize;
    let (images, visible) = rayon::join(
        || [0, 1].into_par_iter().map(|k| in_band(if k == 0 { grey_of_drawn() } else { grey_of_view() })).collect(),
        || VisibleFaces::new(camera, positions, faces, reach),
    );
    let images: Vec<Vec<f32>> = images;
    let slope = |image: &Vec<f32>, at: usize| {
        let [x, y] = [image[at + 1] - image[at - 1], image[at + columns] - image[at - columns]];
        0.5 * DVec2::new(x.into(), y.into())
    };
    let to_world = camera.rotation.transpose();
    let mut found = vec![];
    for y in (1..rows.saturating_sub(1)).step_by(band.step) {
        for x in (1..columns.saturating_sub(1)).step_by(band.step) {
            let at = y * columns + x;
            let depth = visible.depths[at];
            if depth.is_infinite() || !is_used([x, y]) {
                continue;
            }
            let slope = 0.5 * (slope(&images[0], at) + slope(&images[1], at));
            let ray = (DVec2::new(x as f64 + 0.5, y as f64 + 0.5) - camera.principal) / camera.focal;
            let by_place = slope * camera.focal / depth;
            found.push(Sample {
                face: visible.faces[at],
                residual: f64::from(images[0][at] - images[1][at]),
                gradient: -(to_world * by_place.extend(-by_place.dot(ray))),
                squared_slope: slope.length_squared(),
            });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use ghand_core::Camera;

    use super::*;

    /// A wall of waves, moved by `shift`, as a camera sees it.
    fn wall(camera: &Camera, shift: DVec3) -> Vec<[f32; 4]> {
        let value = |i: u32| {
            let pixel = DVec2::new(f64::from(i % camera.width), f64::from(i / camera.width)) + 0.5;
            let ray = camera.rotation.transpose() * ((pixel - camera.principal) / camera.focal).extend(1.0);
            let center = camera.center();
            let at = center + ray * (shift.z - center.z) / ray.z - shift;
            (0.5 + 0.1 * (90.0 * at.x).sin() + 0.1 * (70.0 * at.y + 40.0 * at.x).cos()) as f32
        };
        (0..camera.width * camera.height).map(|i| [value(i), value(i), value(i), 1.0]).collect()
    }

    #[test]
    fn gradients_are_those_of_the_drawn_image_by_the_place_of_the_surface() {
        let eye = DVec3::new(0.1, 0.05, -0.5);
        let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 0.4, 120, 90);
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let positions = [corner(-0.3, -0.3), corner(-0.3, 0.3), corner(0.3, 0.3), corner(0.3, -0.3)];
        let faces = [[0, 1, 2], [0, 2, 3]];
        let band = Band { blurs: [0.8, 6.0], step: 1 };
        let still = wall(&camera, DVec3::ZERO);
        let pixels = still.iter().map(|p| p.map(|v| (255.0 * v).round() as u8)).collect();
        let size = [camera.width, camera.height];
        let view = TrainView { camera_index: 0, frame: 0, camera: camera.clone(), size, pixels };
        let of = |shift: DVec3| {
            let image = Image { width: size[0], height: size[1], rgba: wall(&camera, shift) };
            samples(&view, &image, &positions, &faces, band, |[x, y]| (20..100).contains(&x) && (20..70).contains(&y))
        };
        let here = of(DVec3::ZERO);
        assert_eq!(here.len(), 80 * 50);
        for axis in DVec3::AXES {
            let step = 1e-4;
            let [low, high] = [of(-step * axis), of(step * axis)];
            let (mut worst, mut largest): (f64, f64) = (0.0, 0.0);
            for ((low, high), here) in low.iter().zip(&high).zip(&here) {
                let difference = (high.residual - low.residual) / (2.0 * step);
                worst = worst.max((difference - here.gradient.dot(axis)).abs());
                largest = largest.max(difference.abs());
            }
            // Slopes are differences over two pixels, and blurs reach where the wall is seen from another distance.
            assert!(worst < 0.12 * largest, "{axis}: {worst} of {largest}");
        }
        assert!(here.iter().all(|sample| sample.residual.abs() < 0.004), "the images are the same");
    }
}
