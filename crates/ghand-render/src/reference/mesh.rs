//! CPU twin of the mesh renderer (`mesh.wgsl`, `mesh_resolve.wgsl`), in f64.

use ghand_core::Camera;
use ghand_core::mesh::Texture;
use glam::{DVec2, DVec3, DVec4};

use super::wireframe::{FaceDepths, line_coverage};
use crate::mesh::{
    MeshError, MeshImage, MeshInstance, MeshStyle, NEAR_PLANE, Shading, Surface, check_input, segments, with_margin,
};

/// Vertex in camera axes with the values that are interpolated over a triangle.
#[derive(Clone, Copy)]
struct Corner {
    camera: DVec3,
    normal: DVec3,
    /// UV and 0, or a colour.
    surface: DVec3,
    light_visibility: f64,
}

impl Corner {
    fn lerp(self, other: Corner, t: f64) -> Corner {
        Corner {
            camera: self.camera.lerp(other.camera, t),
            normal: self.normal.lerp(other.normal, t),
            surface: self.surface.lerp(other.surface, t),
            light_visibility: self.light_visibility + (other.light_visibility - self.light_visibility) * t,
        }
    }
}

/// The faces at k times the image's size.
struct FaceSamples {
    width: usize,
    height: usize,
    color: Vec<DVec3>,
    /// Camera z, infinity where there is no face.
    depth: Vec<f64>,
}

/// Draws the same image as [`crate::mesh::MeshRenderer::render`], except for samples within rounding of a triangle's
/// edge or of the point where a line passes behind a face, and for the device's f16 samples and f32 arithmetic.
///
/// # Errors
/// [`MeshError::Invalid`] if the input is unusable.
pub fn render(mesh: &MeshInstance, camera: &Camera, style: &MeshStyle) -> Result<MeshImage, MeshError> {
    check_input(mesh, camera, style)?;
    let margin = style.wireframe.map_or(0, |w| w.margin());
    let around = with_margin(camera, margin);
    let k = style.supersample as usize;
    let (width, height) = (around.width as usize * k, around.height as usize * k);
    let mut faces = FaceSamples {
        width,
        height,
        color: vec![DVec3::ZERO; width * height],
        depth: vec![f64::INFINITY; width * height],
    };
    for triangle in mesh.triangles {
        let corners = triangle.map(|i| Corner {
            camera: around.camera_from_world(mesh.positions[i as usize]),
            normal: mesh.normals[i as usize],
            surface: mesh.surface.at_vertex(i as usize),
            light_visibility: mesh.light_visibility.map_or(1.0, |e| e[i as usize]),
        });
        let clipped = clip_near(&corners);
        for i in 1..clipped.len().saturating_sub(1) {
            fill(
                &mut faces,
                [clipped[0], clipped[i], clipped[i + 1]],
                &around,
                k as f64,
                &mesh.surface,
                &style.shading,
            );
        }
    }
    let lines = style.wireframe.map(|wireframe| {
        let half_width = 0.5 * wireframe.width * k as f64;
        let segments = segments(mesh.positions, mesh.triangles, &around, style.supersample, half_width + 1.0);
        let depths = FaceDepths { width, height, depth: &faces.depth };
        (wireframe.color, line_coverage(&segments, half_width, &depths))
    });
    Ok(resolve(&faces, lines.as_ref(), camera, style, margin as usize))
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

fn fill(
    samples: &mut FaceSamples,
    corners: [Corner; 3],
    camera: &Camera,
    k: f64,
    surface: &Surface,
    shading: &Shading,
) {
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
            let mut normal = DVec3::ZERO;
            let mut at_sample = DVec3::ZERO;
            let mut light_visibility = 0.0;
            for (weight, corner) in weights.iter().zip(&corners) {
                normal += *weight * corner.normal;
                at_sample += *weight * corner.surface;
                light_visibility += *weight * corner.light_visibility;
            }
            samples.depth[index] = depth;
            let color = match surface {
                Surface::Texture { texture, .. } => sample_color(texture, at_sample.truncate()),
                Surface::VertexColors(_) | Surface::Color(_) => at_sample,
            };
            samples.color[index] = shade(color, normal, light_visibility, shading);
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

fn shade(color: DVec3, normal: DVec3, light_visibility: f64, shading: &Shading) -> DVec3 {
    match shading {
        // The resolve ignores the colour of transparent faces.
        Shading::Unlit | Shading::Transparent => color,
        Shading::Lit { ambient, lights, wrap } => {
            let normal = normal.normalize_or_zero();
            let light = lights.iter().fold(*ambient, |sum, light| {
                let cosine = normal.dot(light.direction.normalize_or_zero());
                sum + light.color * ((cosine + wrap) / (1.0 + wrap)).max(0.0)
            });
            (color * light * light_visibility).min(DVec3::ONE)
        }
    }
}

fn resolve(
    faces: &FaceSamples,
    lines: Option<&(DVec3, Vec<f64>)>,
    camera: &Camera,
    style: &MeshStyle,
    margin: usize,
) -> MeshImage {
    let width = camera.width as usize;
    let height = camera.height as usize;
    let k = style.supersample as usize;
    let mut image = MeshImage {
        width: camera.width,
        height: camera.height,
        rgba: Vec::with_capacity(width * height),
        depth: Vec::with_capacity(width * height),
    };
    for pixel in 0..width * height {
        let (x, y) = (pixel % width + margin, pixel / width + margin);
        let mut sum = DVec4::ZERO;
        let mut nearest = f64::INFINITY;
        for index in (0..k * k).map(|s| (y * k + s / k) * faces.width + x * k + s % k) {
            let mut color = DVec4::ZERO;
            if faces.depth[index].is_finite() && style.shading != Shading::Transparent {
                color = faces.color[index].extend(1.0);
                nearest = nearest.min(faces.depth[index]);
            }
            if let Some((line_color, covered)) = lines {
                color = color.lerp(line_color.extend(1.0), covered[index]);
            }
            sum += color;
        }
        image.rgba.push((sum / (k * k) as f64).as_vec4().to_array());
        image.depth.push(nearest as f32);
    }
    image
}
