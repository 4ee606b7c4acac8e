//! The hand that is photographed: other lengths, finer, with skin.

use ghand_core::hand_model::procedural::ProceduralHand;
use ghand_core::mesh::{RenderMesh, Texture};
use ghand_core::{HandModel, HandModelError, Pose};
use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::anatomy::Anatomy;
use super::exposure::Exposure;
use super::skin::{Place, Skin};
use super::skinning::pose_vertices;

/// Texels of the atlas along each side: finer than the pixels of the images by far.
const TEXTURE_SIZE: u32 = 1024;
/// Texels that a chart's colour reaches beyond its edge, so that bilinear sampling sees no gap.
const MARGIN: usize = 3;
/// Largest relative difference of the true hand's lengths from the template's.
const LENGTH_VARIATION: f64 = 0.06;

/// The true hand, ready to be posed.
pub(super) struct TrueHand {
    model: HandModel,
    /// Rest positions with relief.
    rest: Vec<DVec3>,
    pub mesh: RenderMesh,
    /// UVs of the render vertices.
    pub texture: Texture,
    exposure: Exposure,
}

/// Vertices of one frame at the render mesh's vertices.
pub(super) struct PosedHand {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub exposure: Vec<f64>,
}

impl TrueHand {
    /// Varies the template's lengths by the seed and grows skin on the result.
    pub(super) fn new(template: &ProceduralHand, seed: u64) -> Result<TrueHand, HandModelError> {
        let model = varied(template, seed).build()?;
        let anatomy = Anatomy::of(&model);
        let skin = Skin::new(&anatomy, seed);
        let memberships: Vec<Vec<f64>> =
            (0..model.vertices.len()).map(|v| anatomy.memberships(model.vertex_weights(v))).collect();
        let normals = model.vertex_normals(&model.vertices);
        let rest = (0..model.vertices.len())
            .into_par_iter()
            .map(|v| {
                let (position, normal) = (model.vertices[v], normals[v]);
                position + normal * skin.look(&Place { position, normal, memberships: &memberships[v] }).height
            })
            .collect();
        let texture = paint(&model, &normals, &memberships, &skin);
        let exposure = Exposure::new(&anatomy, &model);
        Ok(TrueHand { mesh: RenderMesh::from_model(&model), rest, texture, exposure, model })
    }

    pub(super) fn pose(&self, pose: &Pose) -> PosedHand {
        let positions = pose_vertices(&self.model, &self.rest, pose);
        let normals = self.model.vertex_normals(&positions);
        let exposure = self.exposure.of(&self.model, pose, &positions, &normals);
        PosedHand {
            positions: self.mesh.gather(&positions),
            normals: self.mesh.gather(&normals),
            exposure: self.mesh.source_vertices.iter().map(|&v| exposure[v as usize]).collect(),
        }
    }
}

fn varied(template: &ProceduralHand, seed: u64) -> ProceduralHand {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x4A7D);
    let mut vary = |length: f64| length * (1.0 + LENGTH_VARIATION * (2.0 * rng.random::<f64>() - 1.0));
    ProceduralHand {
        left: template.left,
        palm_length: vary(template.palm_length),
        palm_width: vary(template.palm_width),
        palm_thickness: vary(template.palm_thickness),
        wrist_width: vary(template.wrist_width),
        finger_lengths: template.finger_lengths.map(&mut vary),
        finger_widths: template.finger_widths.map(&mut vary),
        thumb_length: vary(template.thumb_length),
        thumb_width: vary(template.thumb_width),
        detail: template.detail.max(3),
    }
}

/// Paints the skin into the model's atlas.
fn paint(model: &HandModel, normals: &[DVec3], memberships: &[Vec<f64>], skin: &Skin) -> Texture {
    let size = TEXTURE_SIZE as usize;
    let mut owners: Vec<Option<(u32, DVec3)>> = vec![None; size * size];
    for (face, uvs) in model.face_uvs.iter().enumerate() {
        let corners = uvs.map(|i| model.uvs[i as usize] * f64::from(TEXTURE_SIZE));
        own_texels(corners, size, |texel, barycentric| owners[texel] = Some((face as u32, barycentric)));
    }
    let mut colors: Vec<Option<DVec3>> = (owners.par_iter())
        .map(|owner| {
            let (face, b) = (*owner)?;
            let corners = model.faces[face as usize].map(|v| v as usize);
            let mix = |values: &[DVec3]| (0..3).map(|c| values[corners[c]] * b[c]).sum::<DVec3>();
            let memberships: Vec<f64> = (0..memberships[corners[0]].len())
                .map(|finger| (0..3).map(|c| memberships[corners[c]][finger] * b[c]).sum())
                .collect();
            let normal = mix(normals).normalize_or_zero();
            Some(skin.look(&Place { position: mix(&model.vertices), normal, memberships: &memberships }).color)
        })
        .collect();
    for _ in 0..MARGIN {
        colors = spread(&colors, size);
    }
    let byte = |v: f64| (v * 255.0).round() as u8;
    let rgb = colors.iter().map(|c| c.unwrap_or(DVec3::ZERO).to_array().map(byte)).collect();
    Texture { width: TEXTURE_SIZE, height: TEXTURE_SIZE, rgb }
}

/// Calls `own` with every texel whose centre lies in a triangle (corners in texels), and its barycentric coordinates.
fn own_texels([a, b, c]: [DVec2; 3], size: usize, mut own: impl FnMut(usize, DVec3)) {
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 {
        return;
    }
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let first = |v: f64| (v - 0.5).ceil().max(0.0) as usize;
    let end = |v: f64| ((v - 0.5).floor() + 1.0).clamp(0.0, size as f64) as usize;
    for y in first(low.y)..end(high.y) {
        for x in first(low.x)..end(high.x) {
            let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let barycentric =
                DVec3::new((c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)) / area;
            if barycentric.min_element() >= 0.0 {
                own(y * size + x, barycentric);
            }
        }
    }
}

/// Fills every empty texel beside filled ones with their mean.
fn spread(colors: &[Option<DVec3>], size: usize) -> Vec<Option<DVec3>> {
    (0..colors.len())
        .into_par_iter()
        .map(|i| {
            colors[i].or_else(|| {
                let (x, y) = (i % size, i / size);
                let around = (y.saturating_sub(1)..=(y + 1).min(size - 1))
                    .flat_map(|y| (x.saturating_sub(1)..=(x + 1).min(size - 1)).map(move |x| y * size + x));
                let (sum, count) = around
                    .filter_map(|j| colors[j])
                    .fold((DVec3::ZERO, 0.0), |(sum, count), color| (sum + color, count + 1.0));
                (count > 0.0).then(|| sum / count)
            })
        })
        .collect()
}
