//! Meshes to draw, and the comparison of their images.

use ghand_core::Camera;
use ghand_core::mesh::Texture;
use ghand_render::mesh::{Light, MeshImage, MeshInstance, MeshStyle, Shading, Surface, Wireframe};
use glam::{DVec2, DVec3};

/// A mesh with all attributes that a surface can need.
#[derive(Clone)]
pub struct Model {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
    pub colors: Vec<DVec3>,
    pub light_visibility: Vec<f64>,
    pub triangles: Vec<[u32; 3]>,
    pub texture: Texture,
}

impl Model {
    /// Vertices and triangles, with plain other attributes.
    pub fn plain(positions: &[DVec3], triangles: &[[u32; 3]]) -> Model {
        let n = positions.len();
        Model {
            positions: positions.to_vec(),
            normals: vec![DVec3::Z; n],
            uvs: vec![DVec2::ZERO; n],
            colors: vec![DVec3::ONE; n],
            light_visibility: vec![1.0; n],
            triangles: triangles.to_vec(),
            texture: Texture::plain([255; 3]),
        }
    }

    pub fn textured(&self) -> MeshInstance<'_> {
        self.with(Surface::Texture { uvs: &self.uvs, texture: &self.texture })
    }

    pub fn colored(&self) -> MeshInstance<'_> {
        self.with(Surface::VertexColors(&self.colors))
    }

    pub fn with<'a>(&'a self, surface: Surface<'a>) -> MeshInstance<'a> {
        MeshInstance {
            positions: &self.positions,
            normals: &self.normals,
            light_visibility: Some(&self.light_visibility),
            triangles: &self.triangles,
            surface,
        }
    }
}

/// A torus with a wavy surface: it occludes itself, its UVs, colours and normals vary fast, and it has a seam.
pub fn torus(n: u32, m: u32) -> Model {
    let mut t = Model::plain(&[], &[]);
    t.texture =
        Texture { width: 7, height: 5, rgb: (0..35u8).map(|i| [i * 7, 255 - i * 3, i.wrapping_mul(53)]).collect() };
    for i in 0..=n {
        for j in 0..=m {
            let uv = DVec2::new(f64::from(i) / f64::from(n), f64::from(j) / f64::from(m));
            let s = uv.x * std::f64::consts::TAU;
            let t_angle = uv.y * std::f64::consts::TAU;
            let out = DVec3::new(s.cos(), s.sin(), 0.0);
            let normal = out * t_angle.cos() + DVec3::Z * t_angle.sin();
            t.positions.push(out * 0.08 + normal * (0.03 + 0.004 * (5.0 * s).sin()));
            t.normals.push(normal);
            t.uvs.push(uv);
            t.colors.push(0.5 + 0.5 * DVec3::new(s.cos(), t_angle.cos(), (3.0 * s).sin()));
            t.light_visibility.push(0.6 + 0.4 * (3.0 * s).cos());
            if i < n && j < m {
                let a = i * (m + 1) + j;
                t.triangles.extend([[a, a + m + 1, a + m + 2], [a, a + m + 2, a + 1]]);
            }
        }
    }
    t
}

/// Unequal focal lengths, an off-centre principal point, a size that is not a multiple of a workgroup.
pub fn camera() -> Camera {
    let camera = Camera::look_at(DVec3::new(0.25, -0.2, 0.3), DVec3::ZERO, DVec3::Y, 0.5, 75, 61);
    Camera { focal: DVec2::new(123.0, 101.0), principal: DVec2::new(31.3, 36.9), ..camera }
}

/// A camera in the hole of the torus, with the surface on all sides.
pub fn camera_inside() -> Camera {
    Camera::look_at(DVec3::new(0.08, 0.0, 0.0), DVec3::new(0.0, 0.08, 0.0), DVec3::Z, 1.2, 48, 48)
}

/// The point of the world at pixel coordinates and a depth.
pub fn at_pixel(camera: &Camera, x: f64, y: f64, depth: f64) -> DVec3 {
    let ray = ((DVec2::new(x, y) - camera.principal) / camera.focal).extend(1.0) * depth;
    camera.rotation.transpose() * (ray - camera.translation)
}

pub fn lights() -> Shading {
    let light = |x, y, z, color| Light { direction: DVec3::new(x, y, z), color };
    let lights = vec![light(1.0, 2.0, 1.5, DVec3::new(0.7, 0.6, 0.5)), light(-1.0, 0.0, 0.3, DVec3::splat(0.3))];
    Shading::Lit { ambient: DVec3::new(0.2, 0.25, 0.3), lights, wrap: 0.3 }
}

pub fn faces(supersample: u32, shading: Shading) -> MeshStyle {
    MeshStyle { supersample, shading, wireframe: None }
}

pub fn lines(supersample: u32, shading: Shading, width: f64) -> MeshStyle {
    let color = DVec3::new(0.9, 0.2, 0.1);
    MeshStyle { supersample, shading, wireframe: Some(Wireframe { width, color }) }
}

/// f16 samples have 11 bits, and a GPU may cut them off: 2^-11 for values near 1, and f32 arithmetic.
const COLOR_BOUND: f32 = 6e-4;
/// A few ulps of the device's interpolation of depths.
const DEPTH_BOUND: f32 = 4e-6;
/// A rasteriser may move vertices by half of 1/256 pixel, and with them what a pixel shows.
const MOVED: f32 = 1.0 / 256.0;

/// Fails unless the images agree in all but `flips` pixels, where rounding can decide about a triangle's edge or the
/// point where a line passes behind a face.
pub fn compare(image: &MeshImage, expected: &MeshImage, flips: usize) -> Result<(), String> {
    if (image.width, image.height) != (expected.width, expected.height)
        || [image.rgba.len(), image.depth.len()] != [expected.rgba.len(), expected.depth.len()]
    {
        return Err("sizes differ".into());
    }
    let agrees = |i: &usize| {
        let [depth, expected_depth] = [image.depth[*i], expected.depth[*i]];
        let bound = DEPTH_BOUND * expected_depth + MOVED * slope(expected, *i, |k| expected.depth[k]);
        (depth == expected_depth || (depth - expected_depth).abs() <= bound)
            && (0..4).all(|c| {
                let bound = COLOR_BOUND + MOVED * slope(expected, *i, |k| expected.rgba[k][c]);
                (image.rgba[*i][c] - expected.rgba[*i][c]).abs() <= bound
            })
    };
    let different: Vec<usize> = (0..expected.rgba.len()).filter(|i| !agrees(i)).collect();
    match different.first() {
        Some(&i) if different.len() > flips => {
            let at = |image: &MeshImage| format!("{:?} at depth {}", image.rgba[i], image.depth[i]);
            let (x, y) = (i % expected.width as usize, i / expected.width as usize);
            Err(format!("{} pixels differ: ({x}, {y}) is {}, not {}", different.len(), at(image), at(expected)))
        }
        _ => Ok(()),
    }
}

/// The smaller change of a value per pixel to both sides along a row and a column, added: that of the surface, not of its
/// edge.
fn slope(image: &MeshImage, i: usize, value: impl Fn(usize) -> f32) -> f32 {
    let width = image.width as usize;
    let x = i % image.width as usize;
    let change = |beside: Option<usize>| {
        let change = beside.map_or(f32::INFINITY, |k| (value(k) - value(i)).abs());
        if change.is_finite() { change } else { f32::INFINITY }
    };
    let along = |a: Option<usize>, b: Option<usize>| {
        let smaller = change(a).min(change(b));
        if smaller.is_finite() { smaller } else { 0.0 }
    };
    let below = Some(i + width).filter(|k| *k < image.depth.len());
    along((x > 0).then(|| i - 1), (x + 1 < width).then_some(i + 1)) + along(i.checked_sub(width), below)
}

/// Number of covered pixels.
pub fn covered(image: &MeshImage) -> usize {
    image.rgba.iter().filter(|p| p[3] > 0.0).count()
}
