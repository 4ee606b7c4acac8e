//! Paints the skin into the hand's UV atlas; the parts that depend on the pose are repainted for each pose.

use ghand_core::HandModel;
use ghand_core::mesh::Texture;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::complexion::Complexion;
use super::folds::{Bend, Fold, Folds, bent};
use super::{Look, Skin};
use crate::hand::anatomy::SkinPoint;
use crate::hand::true_hand::Detail;

/// Texels of the atlas along each side: finer than the pixels of the images.
const SIZE: usize = 1024;
/// The same for small images.
const SIZE_OF_SMALL: usize = 512;
/// The same where images show pores.
const SIZE_WITH_PORES: usize = 3072;
/// Texels that a chart's colour reaches beyond its edge, so that bilinear sampling has no gaps.
const MARGIN: usize = 3;

/// The atlas of one hand.
pub(crate) struct Atlas {
    /// Rows and columns.
    size: usize,
    /// Colours without the folds.
    rgb: Vec<[u8; 3]>,
    /// Texels that folds touch.
    folded: Vec<(u32, Look, Vec<Fold>)>,
    /// Texels beyond the edges of charts, and the texels that they copy.
    margin: Vec<(u32, u32)>,
}

impl Atlas {
    /// Rows and columns of its texture.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// `normals` and `finger_weights` are those of the model's vertices.
    pub(crate) fn new(
        model: &HandModel,
        normals: &[DVec3],
        finger_weights: &[Vec<f64>],
        skin: &Skin,
        folds: &Folds,
        detail: Detail,
    ) -> Atlas {
        let size = match detail {
            Detail::Pores => SIZE_WITH_PORES,
            Detail::Fine | Detail::Film => SIZE,
            Detail::Small => SIZE_OF_SMALL,
        };
        let owners = owners(model, size);
        let texels: Vec<Option<(Look, Vec<Fold>)>> = (owners.par_iter())
            .map(|owner| {
                let (face, b) = (*owner)?;
                let corners = model.faces[face as usize].map(|v| v as usize);
                let mix = |values: &[DVec3]| (0..3).map(|c| values[corners[c]] * b[c]).sum::<DVec3>();
                let finger_weights: Vec<f64> = (0..finger_weights[corners[0]].len())
                    .map(|finger| (0..3).map(|c| finger_weights[corners[c]][finger] * b[c]).sum())
                    .collect();
                let normal = mix(normals).normalize_or_zero();
                let point = SkinPoint { position: mix(&model.vertices), normal, finger_weights: &finger_weights };
                let mut look = skin.look(&point);
                if detail == Detail::Pores {
                    look.color *= skin.fine_shade(&point);
                }
                Some((look, folds.at(&point)))
            })
            .collect();
        let filled: Vec<bool> = texels.iter().map(Option::is_some).collect();
        let rgb = texels.iter().map(|t| t.as_ref().map_or([0; 3], |(look, _)| bytes(look.color))).collect();
        let folded = (texels.into_iter().zip(0..))
            .filter_map(|(texel, i)| texel.filter(|(_, folds)| !folds.is_empty()).map(|(look, folds)| (i, look, folds)))
            .collect();
        Atlas { size, rgb, folded, margin: margin(filled, size) }
    }

    /// The texture of a pose.
    pub(crate) fn texture(&self, bend: &Bend, complexion: &Complexion) -> Texture {
        let mut rgb = self.rgb.clone();
        let painted: Vec<[u8; 3]> =
            (self.folded.par_iter()).map(|(_, look, folds)| bytes(bent(look, folds, bend, complexion).color)).collect();
        self.folded.iter().zip(painted).for_each(|((i, ..), color)| rgb[*i as usize] = color);
        self.margin.iter().for_each(|&(texel, source)| rgb[texel as usize] = rgb[source as usize]);
        Texture { width: self.size as u32, height: self.size as u32, rgb }
    }
}

fn bytes(color: DVec3) -> [u8; 3] {
    color.to_array().map(|v| (v * 255.0).round().clamp(0.0, 255.0) as u8)
}

/// The face of each texel whose centre is on one, and its barycentric coordinates there.
fn owners(model: &HandModel, size: usize) -> Vec<Option<(u32, DVec3)>> {
    let mut owners = vec![None; size * size];
    for (face, uvs) in model.face_uvs.iter().enumerate() {
        let corners = uvs.map(|i| model.uvs[i as usize] * size as f64);
        own_texels(corners, size, |texel, barycentric| owners[texel] = Some((face as u32, barycentric)));
    }
    owners
}

/// Calls `own` with every texel whose centre is in a triangle (corners in texels), and its barycentric coordinates.
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

/// Texels around the filled ones, ring by ring, each with the filled texel that it copies.
fn margin(mut filled: Vec<bool>, size: usize) -> Vec<(u32, u32)> {
    let mut source: Vec<u32> = (0..filled.len() as u32).collect();
    let mut margin = vec![];
    for _ in 0..MARGIN {
        let ring: Vec<(u32, u32)> = (0..filled.len())
            .into_par_iter()
            .filter(|&i| !filled[i])
            .filter_map(|i| {
                let (x, y) = (i % size, i / size);
                let around = |v: usize| v.saturating_sub(1)..=(v + 1).min(size - 1);
                let mut neighbours = around(y).flat_map(|y| around(x).map(move |x| y * size + x));
                neighbours.find(|&j| filled[j]).map(|j| (i as u32, source[j]))
            })
            .collect();
        for &(texel, from) in &ring {
            filled[texel as usize] = true;
            source[texel as usize] = from;
        }
        margin.extend(ring);
    }
    margin
}
