//! CPU twin of the mesh renderer (`mesh.wgsl`), in f64.

use ghand_core::Camera;
use ghand_core::mesh::Texture;
use glam::{DVec2, DVec3};

use crate::mesh::{MeshError, MeshImage, MeshInstance, MeshStyle, NEAR_PLANE, Shading, check_input};

/// Vertex in camera axes with what is interpolated over a triangle.
#[derive(Clone, Copy)]
struct Corner {
    camera: DVec3,
    normal: DVec3,
    uv: DVec2,
    exposure: f64,
}

impl Corner {
    fn lerp(self, other: Corner, t: f64) -> Corner {
        Corner {
            camera: self.camera.lerp(other.camera, t),
            normal: self.normal.lerp(other.normal, t),
            uv: self.uv.lerp(other.uv, t),
            exposure: self.exposure + (other.exposure - self.exposure) * t,
        }
    }
}

/// Samples of the image at k times its size.
struct Samples {
    width: usize,
    height: usize,
    color: Vec<DVec3>,
    depth: Vec<f64>,
}

/// Draws one image exactly as [`crate::mesh::MeshRenderer::render`] promises to, but for samples within rounding of a
/// triangle's edge and for the device's f16 samples and f32 arithmetic.
///
/// # Errors
/// [`MeshError::Invalid`] when the input is unusable.
pub fn render(mesh: &MeshInstance, camera: &Camera, style: &MeshStyle) -> Result<MeshImage, MeshError> {
    check_input(mesh, camera, style)?;
    let k = style.supersample as usize;
    let (width, height) = (camera.width as usize, camera.height as usize);
    let count = width * k * height * k;
    let mut samples = Samples {
        width: width * k,
        height: height * k,
        color: vec![DVec3::ZERO; count],
        depth: vec![f64::INFINITY; count],
    };
    for triangle in mesh.triangles {
        let corners = triangle.map(|i| Corner {
            camera: camera.camera_from_world(mesh.positions[i as usize]),
            normal: mesh.normals[i as usize],
            uv: mesh.uvs[i as usize],
            exposure: mesh.exposure.map_or(1.0, |e| e[i as usize]),
        });
        let clipped = clip_near(&corners);
        for i in 1..clipped.len().saturating_sub(1) {
            fill(&mut samples, [clipped[0], clipped[i], clipped[i + 1]], camera, k as f64, mesh.texture, style);
        }
    }
    Ok(resolve(&samples, width, height, k))
}

/// The part of a triangle in front of the near plane: a polygon of up to four corners.
fn clip_near(triangle: &[Corner; 3]) -> Vec<Corner> {
    let mut polygon = Vec::with_capacity(4);
    for i in 0..3 {
        let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
        let (da, db) = (a.camera.z - NEAR_PLANE, b.camera.z - NEAR_PLANE);
        if da >= 0.0 {
            polygon.push(a);
        }
        if (da >= 0.0) != (db >= 0.0) {
            polygon.push(a.lerp(b, da / (da - db)));
        }
    }
    polygon
}

fn fill(samples: &mut Samples, corners: [Corner; 3], camera: &Camera, k: f64, texture: &Texture, style: &MeshStyle) {
    let pixels =
        corners.map(|c| (DVec2::new(c.camera.x, c.camera.y) / c.camera.z * camera.focal + camera.principal) * k);
    let [a, b, c] = pixels;
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 {
        return;
    }
    let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
    let first = |v: f64| (v - 0.5).ceil().max(0.0) as usize;
    let end = |v: f64, size: usize| ((v - 0.5).floor() + 1.0).clamp(0.0, size as f64) as usize;
    for y in first(lo.y)..end(hi.y, samples.height) {
        for x in first(lo.x)..end(hi.x, samples.width) {
            let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let screen = DVec3::new((c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)) / area;
            if screen.min_element() < 0.0 {
                continue;
            }
            // 1/z is linear on the screen; so is everything over z.
            let over_z = screen / DVec3::new(corners[0].camera.z, corners[1].camera.z, corners[2].camera.z);
            let depth = 1.0 / over_z.element_sum();
            let index = y * samples.width + x;
            if depth >= samples.depth[index] {
                continue;
            }
            let weights = (over_z * depth).to_array();
            let (mut normal, mut uv, mut exposure) = (DVec3::ZERO, DVec2::ZERO, 0.0);
            for (weight, corner) in weights.iter().zip(&corners) {
                normal += *weight * corner.normal;
                uv += *weight * corner.uv;
                exposure += *weight * corner.exposure;
            }
            samples.depth[index] = depth;
            samples.color[index] = shade(sample_color(texture, uv), normal, exposure, &style.shading);
        }
    }
}

fn sample_color(texture: &Texture, uv: DVec2) -> DVec3 {
    let p = uv * DVec2::new(f64::from(texture.width), f64::from(texture.height)) - 0.5;
    let base = p.floor();
    let f = p - base;
    let texel = |x: f64, y: f64| {
        let x = x.clamp(0.0, f64::from(texture.width) - 1.0) as usize;
        let y = y.clamp(0.0, f64::from(texture.height) - 1.0) as usize;
        DVec3::from(texture.rgb[y * texture.width as usize + x].map(|v| f64::from(v) / 255.0))
    };
    let top = texel(base.x, base.y).lerp(texel(base.x + 1.0, base.y), f.x);
    let bottom = texel(base.x, base.y + 1.0).lerp(texel(base.x + 1.0, base.y + 1.0), f.x);
    top.lerp(bottom, f.y)
}

fn shade(color: DVec3, normal: DVec3, exposure: f64, shading: &Shading) -> DVec3 {
    match shading {
        Shading::Unlit => color,
        Shading::Lit { ambient, lights, wrap } => {
            let normal = normal.normalize_or_zero();
            let light = lights.iter().fold(*ambient, |sum, light| {
                let cosine = normal.dot(light.direction.normalize_or_zero());
                sum + light.color * ((cosine + wrap) / (1.0 + wrap)).max(0.0)
            });
            (color * light * exposure).min(DVec3::ONE)
        }
    }
}

fn resolve(samples: &Samples, width: usize, height: usize, k: usize) -> MeshImage {
    let mut image = MeshImage {
        width: width as u32,
        height: height as u32,
        rgba: Vec::with_capacity(width * height),
        depth: Vec::with_capacity(width * height),
    };
    for pixel in 0..width * height {
        let (x, y) = (pixel % width, pixel / width);
        let (mut color, mut covered, mut nearest) = (DVec3::ZERO, 0.0, f64::INFINITY);
        for index in (0..k * k).map(|s| (y * k + s / k) * samples.width + x * k + s % k) {
            if samples.depth[index].is_finite() {
                color += samples.color[index];
                covered += 1.0;
                nearest = nearest.min(samples.depth[index]);
            }
        }
        let color = (color / (k * k) as f64).as_vec3();
        image.rgba.push([color.x, color.y, color.z, (covered / (k * k) as f64) as f32]);
        image.depth.push(nearest as f32);
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{AdapterChoice, Gpu};
    use crate::mesh::{Light, MeshRenderer};

    /// A torus with a wavy skin: hides parts of itself, has UVs and normals that vary fast.
    struct Torus {
        positions: Vec<DVec3>,
        normals: Vec<DVec3>,
        uvs: Vec<DVec2>,
        exposure: Vec<f64>,
        triangles: Vec<[u32; 3]>,
        texture: Texture,
    }

    fn torus() -> Torus {
        let (n, m) = (40u32, 24u32);
        let mut t = Torus {
            positions: vec![],
            normals: vec![],
            uvs: vec![],
            exposure: vec![],
            triangles: vec![],
            texture: Texture {
                width: 7,
                height: 5,
                rgb: (0..35u8).map(|i| [i * 7, 255 - i * 3, i.wrapping_mul(53)]).collect(),
            },
        };
        for i in 0..=n {
            for j in 0..=m {
                let uv = DVec2::new(f64::from(i) / f64::from(n), f64::from(j) / f64::from(m));
                let (s, t_angle) = (uv.x * std::f64::consts::TAU, uv.y * std::f64::consts::TAU);
                let out = DVec3::new(s.cos(), s.sin(), 0.0);
                let normal = out * t_angle.cos() + DVec3::Z * t_angle.sin();
                t.positions.push(out * 0.08 + normal * (0.03 + 0.004 * (5.0 * s).sin()));
                t.normals.push(normal);
                t.uvs.push(uv);
                t.exposure.push(0.6 + 0.4 * (3.0 * s).cos());
                if i < n && j < m {
                    let a = i * (m + 1) + j;
                    t.triangles.extend([[a, a + m + 1, a + m + 2], [a, a + m + 2, a + 1]]);
                }
            }
        }
        t
    }

    impl Torus {
        fn instance(&self) -> MeshInstance<'_> {
            MeshInstance {
                positions: &self.positions,
                normals: &self.normals,
                uvs: &self.uvs,
                exposure: Some(&self.exposure),
                triangles: &self.triangles,
                texture: &self.texture,
            }
        }
    }

    fn camera() -> Camera {
        let camera = Camera::look_at(DVec3::new(0.25, -0.2, 0.3), DVec3::ZERO, DVec3::Y, 0.5, 75, 61);
        Camera { focal: DVec2::new(123.0, 101.0), principal: DVec2::new(31.3, 36.9), ..camera }
    }

    fn lit(supersample: u32) -> MeshStyle {
        let light = |x, y, z, color| Light { direction: DVec3::new(x, y, z), color };
        let lights = vec![light(1.0, 2.0, 1.5, DVec3::new(0.7, 0.6, 0.5)), light(-1.0, 0.0, 0.3, DVec3::splat(0.3))];
        MeshStyle { supersample, shading: Shading::Lit { ambient: DVec3::new(0.2, 0.25, 0.3), lights, wrap: 0.3 } }
    }

    /// Fails unless the images agree: everywhere that the expected image is smooth (no edge and no jump in depth among
    /// a pixel's neighbours) to rounding, and in coverage but for a few samples that lie on an edge.
    fn compare(image: &MeshImage, expected: &MeshImage, supersample: u32) -> Result<(), String> {
        let (width, height) = (expected.width as i64, expected.height as i64);
        if (image.width, image.height) != (expected.width, expected.height) {
            return Err("sizes differ".into());
        }
        let (mut smooth, mut coverage_error) = (0, 0.0f64);
        for y in 0..height {
            for x in 0..width {
                let i = (y * width + x) as usize;
                coverage_error += f64::from((image.rgba[i][3] - expected.rgba[i][3]).abs());
                let depth = expected.depth[i];
                let is_smooth = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy))).all(|(x, y)| {
                    let inside = (0..width).contains(&x) && (0..height).contains(&y);
                    let j = (y * width + x) as usize;
                    inside
                        && expected.rgba[j][3] == expected.rgba[i][3]
                        && (expected.depth[j] == depth || (expected.depth[j] - depth).abs() < 0.01)
                });
                if !is_smooth {
                    continue;
                }
                smooth += 1;
                // f16 samples carry 11 bits: 2^-12 of a value near 1, with as much again for f32 inside.
                if !(0..4).all(|c| (image.rgba[i][c] - expected.rgba[i][c]).abs() <= 5e-4) {
                    return Err(format!("({x}, {y}): {:?} is not {:?}", image.rgba[i], expected.rgba[i]));
                }
                // Lavapipe's interpolation of camera z is good to a few ulps of 0.5 m.
                if !(image.depth[i] == depth || (image.depth[i] - depth).abs() <= 2e-6) {
                    return Err(format!("({x}, {y}): depth {} is not {depth}", image.depth[i]));
                }
            }
        }
        if smooth < 1000 {
            return Err(format!("only {smooth} smooth pixels: the images say too little"));
        }
        // Triangle edges on the outline that cross within rounding of a sample: a handful at most.
        let samples = coverage_error * f64::from(supersample * supersample);
        if samples <= 4.0 { Ok(()) } else { Err(format!("{samples} samples differ in coverage")) }
    }

    fn gpu() -> Gpu {
        Gpu::new(&AdapterChoice::from_env()).unwrap()
    }

    #[test]
    fn the_device_draws_what_the_twin_draws() {
        let (torus, camera, renderer) = (torus(), camera(), MeshRenderer::new(&gpu()).unwrap());
        let unlit = MeshStyle { supersample: 1, shading: Shading::Unlit };
        for style in [lit(1), lit(2), lit(3), lit(4), unlit] {
            let expected = render(&torus.instance(), &camera, &style).unwrap();
            let image = renderer.render(&torus.instance(), &camera, &style).unwrap();
            compare(&image, &expected, style.supersample).unwrap();
        }
    }

    #[test]
    fn triangles_through_the_near_plane_are_cut_alike() {
        let (torus, renderer) = (torus(), MeshRenderer::new(&gpu()).unwrap());
        let inside = Camera::look_at(DVec3::new(0.08, 0.0, 0.0), DVec3::new(0.0, 0.08, 0.0), DVec3::Z, 1.2, 48, 48);
        let expected = render(&torus.instance(), &inside, &lit(2)).unwrap();
        compare(&renderer.render(&torus.instance(), &inside, &lit(2)).unwrap(), &expected, 2).unwrap();
    }

    #[test]
    fn the_comparator_rejects_wrong_images() {
        let (torus, camera, mut inside_out) = (torus(), camera(), torus());
        let good = render(&torus.instance(), &camera, &lit(2)).unwrap();
        compare(&good, &good, 2).unwrap();
        let draw = |torus: &Torus, camera: &Camera, style| render(&torus.instance(), camera, &style).unwrap();
        let shifted = Camera { principal: camera.principal + DVec2::new(0.1, 0.0), ..camera.clone() };
        assert!(compare(&draw(&torus, &shifted, lit(2)), &good, 2).is_err(), "a tenth of a pixel");
        let nearer = Camera { translation: camera.translation - DVec3::Z * 1e-5, ..camera.clone() };
        assert!(compare(&draw(&torus, &nearer, lit(2)), &good, 2).is_err(), "ten micrometres");
        inside_out.normals.iter_mut().for_each(|n| *n = -*n);
        assert!(compare(&draw(&inside_out, &camera, lit(2)), &good, 2).is_err(), "other normals");
        let mut broken = good.clone();
        broken.rgba[30 * 75 + 8] = [f32::NAN; 4];
        assert!(compare(&broken, &good, 2).is_err(), "not a number");
        assert!(compare(&draw(&torus, &camera, lit(1)), &draw(&torus, &camera, lit(3)), 3).is_err(), "aliased");
    }

    #[test]
    fn a_pixel_centre_lies_where_the_camera_says() {
        // A square whose projection is exactly the pixels 3..7 x 2..5.
        let camera = Camera { focal: DVec2::new(20.0, 30.0), principal: DVec2::new(1.25, 9.0), ..camera() };
        let world = |x: f64, y: f64| {
            let ray = ((DVec2::new(x, y) - camera.principal) / camera.focal).extend(1.0) * 0.4;
            camera.rotation.transpose() * (ray - camera.translation)
        };
        let positions = [world(3.0, 2.0), world(7.0, 2.0), world(3.0, 5.0), world(7.0, 5.0)];
        let texture = Texture::plain([255, 255, 255]);
        let mesh = MeshInstance {
            positions: &positions,
            normals: &[DVec3::Z; 4],
            uvs: &[DVec2::ZERO; 4],
            exposure: None,
            triangles: &[[0, 1, 2], [2, 1, 3]],
            texture: &texture,
        };
        let style = MeshStyle { supersample: 1, shading: Shading::Unlit };
        let renderer = MeshRenderer::new(&gpu()).unwrap();
        for image in [render(&mesh, &camera, &style).unwrap(), renderer.render(&mesh, &camera, &style).unwrap()] {
            for y in 0..camera.height {
                for x in 0..camera.width {
                    let i = (y * camera.width + x) as usize;
                    let covered = (3..7).contains(&x) && (2..5).contains(&y);
                    assert_eq!(image.rgba[i][3], if covered { 1.0 } else { 0.0 }, "({x}, {y})");
                    assert!(if covered {
                        (image.depth[i] - 0.4).abs() < 1e-6
                    } else {
                        image.depth[i] == f32::INFINITY
                    });
                }
            }
        }
    }

    #[test]
    fn unusable_input_is_named() {
        let (torus, camera) = (torus(), camera());
        let says = |mesh: MeshInstance, camera: &Camera, style: MeshStyle, text: &str| {
            let error = render(&mesh, camera, &style).unwrap_err().to_string();
            assert!(error.contains(text), "{error}");
        };
        says(MeshInstance { uvs: &[], ..torus.instance() }, &camera, lit(1), "vertices");
        says(MeshInstance { triangles: &[[0, 1, 99_999]], ..torus.instance() }, &camera, lit(1), "triangles");
        says(torus.instance(), &Camera { width: 0, ..camera.clone() }, lit(1), "camera");
        says(torus.instance(), &camera, lit(5), "supersample");
        let broken = Texture { width: 2, height: 2, rgb: vec![] };
        says(MeshInstance { texture: &broken, ..torus.instance() }, &camera, lit(1), "texture");
    }
}
