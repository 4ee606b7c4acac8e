//! Twin of `rasterize.wgsl` and `rasterize_backward.wgsl`.

use ghand_core::Camera;
use glam::{DVec2, DVec3};

use super::bin::bin;
use super::project::{Gaussian, Splat, project, project_vjp};
use crate::splat::TILE_SIZE;

/// The cut-offs of blending. Tests that take finite differences set them so that the image is smooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cuts {
    /// Contributions below this are left out.
    pub alpha_min: f64,
    /// Alpha never exceeds this.
    pub alpha_max: f64,
    /// A pixel ends before the splat that would bring its transmittance to this or less.
    pub transmittance_min: f64,
    /// Whether splats are listed only in tiles that their box touches.
    pub tiled: bool,
}

impl Default for Cuts {
    fn default() -> Self {
        Cuts { alpha_min: 1.0 / 255.0, alpha_max: 0.99, transmittance_min: 1e-4, tiled: true }
    }
}

/// What a scene is rendered with.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// The Gaussians.
    pub gaussians: &'a [Gaussian],
    /// The camera.
    pub camera: &'a Camera,
    /// Colour behind everything.
    pub background: DVec3,
    /// Opacity of all Gaussians.
    pub opacity: f64,
    /// The cut-offs.
    pub cuts: Cuts,
}

/// Gaussian weight and alpha (before the upper cut) of a splat at a pixel centre.
fn raw_alpha(s: &Splat, at: DVec2, opacity: f64) -> f64 {
    let d = s.mean - at;
    opacity * (-0.5 * (s.conic.x * d.x * d.x + s.conic.z * d.y * d.y) - s.conic.y * d.x * d.y).exp()
}

struct Lists {
    splats: Vec<Option<Splat>>,
    tiles: Vec<Vec<u32>>,
}

impl Scene<'_> {
    fn lists(&self) -> Lists {
        let mut splats: Vec<_> = self.gaussians.iter().map(|g| project(g, self.camera, self.opacity)).collect();
        if !self.cuts.tiled {
            splats.iter_mut().flatten().for_each(|s| s.reach = DVec2::splat(1e9));
        }
        let tiles = bin(&splats, self.camera);
        Lists { splats, tiles }
    }

    /// The splats that a pixel takes, front to back, with their raw alpha and the transmittance before each, and the
    /// final transmittance.
    fn pixel<'l>(&self, lists: &'l Lists, x: u32, y: u32) -> (Vec<(u32, &'l Splat, f64, f64)>, f64) {
        let tile = (y / TILE_SIZE) * self.camera.width.div_ceil(TILE_SIZE) + x / TILE_SIZE;
        let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let mut taken = Vec::new();
        let mut transmittance = 1.0;
        for &index in &lists.tiles[tile as usize] {
            let Some(splat) = &lists.splats[index as usize] else { continue };
            let raw = raw_alpha(splat, at, self.opacity);
            let alpha = raw.min(self.cuts.alpha_max);
            if alpha < self.cuts.alpha_min {
                continue;
            }
            let next = transmittance * (1.0 - alpha);
            if next <= self.cuts.transmittance_min {
                break;
            }
            taken.push((index, splat, raw, transmittance));
            transmittance = next;
        }
        (taken, transmittance)
    }

    /// The image, row-major: colour over the background, and coverage.
    pub fn rasterize(&self) -> Vec<[f64; 4]> {
        let lists = self.lists();
        let mut image = Vec::with_capacity((self.camera.width * self.camera.height) as usize);
        for y in 0..self.camera.height {
            for x in 0..self.camera.width {
                let (taken, transmittance) = self.pixel(&lists, x, y);
                let mut color = self.background * transmittance;
                for (_, splat, raw, before) in taken {
                    color += splat.color * raw.min(self.cuts.alpha_max) * before;
                }
                image.push([color.x, color.y, color.z, 1.0 - transmittance]);
            }
        }
        image
    }

    /// dL/d(Gaussians) from dL/d(image).
    pub fn rasterize_vjp(&self, d_image: &[[f64; 4]]) -> Vec<Gaussian> {
        let lists = self.lists();
        let mut d_splats = vec![(DVec2::ZERO, DVec3::ZERO, DVec3::ZERO); self.gaussians.len()];
        for y in 0..self.camera.height {
            for x in 0..self.camera.width {
                let d = d_image[(y * self.camera.width + x) as usize];
                let d_color = DVec3::new(d[0], d[1], d[2]);
                let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let (taken, transmittance) = self.pixel(&lists, x, y);
                let mut behind = transmittance * (self.background.dot(d_color) - d[3]);
                for (index, splat, raw, before) in taken.into_iter().rev() {
                    let alpha = raw.min(self.cuts.alpha_max);
                    let value = splat.color.dot(d_color);
                    let d_alpha = before * value - behind / (1.0 - alpha);
                    behind += alpha * before * value;
                    let d_splat = &mut d_splats[index as usize];
                    d_splat.2 += d_color * alpha * before;
                    if raw <= self.cuts.alpha_max {
                        let d_power = d_alpha * raw;
                        let o = splat.mean - at;
                        d_splat.0 -= d_power
                            * DVec2::new(
                                splat.conic.x * o.x + splat.conic.y * o.y,
                                splat.conic.y * o.x + splat.conic.z * o.y,
                            );
                        d_splat.1 -= d_power * DVec3::new(0.5 * o.x * o.x, o.x * o.y, 0.5 * o.y * o.y);
                    }
                }
            }
        }
        self.gaussians
            .iter()
            .zip(&lists.splats)
            .zip(d_splats)
            .map(|((g, splat), (d_mean, d_conic, d_color))| match splat {
                Some(_) => project_vjp(g, self.camera, d_mean, d_conic, d_color),
                None => Gaussian { mean: DVec3::ZERO, scale: 0.0, color: DVec3::ZERO },
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn the_gradient_agrees_with_central_differences_where_the_image_is_smooth() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let camera = Camera {
            focal: DVec2::new(30.0, 26.0),
            principal: DVec2::new(7.2, 9.1),
            ..Camera::look_at(DVec3::new(0.1, 0.2, -1.0), DVec3::ZERO, DVec3::Y, 0.6, 17, 15)
        };
        let mut v = || DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        // Some lie far outside the view, where the Jacobian is clamped.
        let gaussians: Vec<Gaussian> = (0..12)
            .map(|i| Gaussian {
                mean: v() * if i < 9 { 0.2 } else { 0.7 },
                scale: 0.06 + 0.03 * v().x,
                color: v() * 0.5 + 0.5,
            })
            .collect();
        let weights: Vec<[f64; 4]> = (0..17 * 15).map(|_| [v().x, v().x, v().x, v().x]).collect();
        let cuts = Cuts { alpha_min: 0.0, alpha_max: 2.0, transmittance_min: 0.0, tiled: false };
        let background = DVec3::new(0.3, 0.1, 0.7);
        let loss = |gaussians: &[Gaussian]| -> f64 {
            let scene = Scene { gaussians, camera: &camera, background, opacity: 0.8, cuts };
            scene.rasterize().iter().zip(&weights).map(|(p, w)| (0..4).map(|c| p[c] * w[c]).sum::<f64>()).sum()
        };
        let scene = Scene { gaussians: &gaussians, camera: &camera, background, opacity: 0.8, cuts };
        let gradient = scene.rasterize_vjp(&weights);
        for (i, d) in gradient.iter().enumerate() {
            let analytic = [d.mean.x, d.mean.y, d.mean.z, d.scale, d.color.x, d.color.y, d.color.z];
            for (field, analytic) in analytic.into_iter().enumerate() {
                let shifted = |h: f64| {
                    let mut other = gaussians.clone();
                    match field {
                        0..3 => other[i].mean[field] += h,
                        3 => other[i].scale += h,
                        _ => other[i].color[field - 4] += h,
                    }
                    loss(&other)
                };
                let numeric = (shifted(1e-6) - shifted(-1e-6)) / 2e-6;
                let error = (analytic - numeric).abs() / (1.0 + numeric.abs());
                assert!(error <= 1e-6, "gaussian {i} field {field}: {analytic} against {numeric}");
            }
        }
    }
}
