//! Linear blend skinning (paper eq. 4) with the residual correction (eq. 11), and its derivative.

use glam::DVec3;
use rayon::prelude::*;

use crate::parallel::{CHUNK, sum_in_chunks};
use crate::skeleton::{Affine, outer};

/// Meaning of the residual skinning weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ResidualWeights {
    /// Used unchanged, as in the paper: their sum scales the rest pose. The residual root turns about the origin, not
    /// about its joint. Otherwise a rotation of the whole hand would move points by that sum times the joint's
    /// displacement.
    Paper,
    /// Their mean over the joints is subtracted, so that the rest pose does not move.
    #[default]
    ZeroSum,
}

/// The inputs of corrected skinning, all for the same N points and `n_b` joints.
#[derive(Debug, Clone, Copy)]
pub struct Skinning<'a> {
    /// Points at rest (metres), N.
    pub rest: &'a [DVec3],
    /// Skinning weights `[n_b][N]`.
    pub weights: &'a [f64],
    /// Residual skinning weights `[n_b][N]`, before `mode` is applied. Empty for plain linear blend skinning.
    pub residual_weights: &'a [f64],
    /// `posed_from_rest` of the skeleton, `n_b`.
    pub bones: &'a [Affine],
    /// `posed_from_rest` of the residual skeleton, `n_b`. Empty if `residual_weights` is empty.
    pub residual_bones: &'a [Affine],
    /// Global translation, metres.
    pub translation: DVec3,
    /// Meaning of the residual weights.
    pub mode: ResidualWeights,
}

/// Gradients of [`skin`].
#[derive(Debug, Clone, PartialEq)]
pub struct SkinGradients {
    /// dL/d(rest points), N.
    pub rest: Vec<DVec3>,
    /// dL/d(residual weights before `mode` is applied), `[n_b][N]`; empty if there are none.
    pub residual_weights: Vec<f64>,
    /// dL/dB, `n_b`.
    pub bones: Vec<Affine>,
    /// dL/dB^, `n_b`; empty if there are none.
    pub residual_bones: Vec<Affine>,
    /// dL/d(translation).
    pub translation: DVec3,
}

impl Skinning<'_> {
    /// The residual bones that the unchanged residual weights blend. Subtracting the mean over the joints from the
    /// weights gives the same map as subtracting it from the bones, of which there are far fewer.
    fn effective_residual_bones(&self) -> Vec<Affine> {
        match self.mode {
            ResidualWeights::Paper => about_the_origin(self.residual_bones),
            ResidualWeights::ZeroSum => centred(self.residual_bones),
        }
    }

    /// The affine map that moves one point: `sum_k W_k B_k + W^_k B^_k`.
    fn blended(&self, residual_bones: &[Affine], point: usize) -> Affine {
        let count = self.rest.len();
        let mut map = Affine::ZERO;
        for (bone, row) in self.bones.iter().zip(self.weights.chunks_exact(count)) {
            map = map.add_scaled(row[point], bone);
        }
        for (bone, row) in residual_bones.iter().zip(self.residual_weights.chunks_exact(count)) {
            map = map.add_scaled(row[point], bone);
        }
        map
    }
}

/// The maps minus their mean.
fn centred(maps: &[Affine]) -> Vec<Affine> {
    let share = -1.0 / maps.len() as f64;
    let mean = maps.iter().fold(Affine::ZERO, |sum, map| sum.add_scaled(share, map));
    maps.iter().map(|map| map.add_scaled(1.0, &mean)).collect()
}

/// The maps of a chain whose root, map 0, turns about the origin: the root's translation is subtracted from all of
/// them.
///
/// With the root turned by `R_0` about `J_0`, every map is `R_0 B + (J_0 - R_0 J_0)` of the map B without that turn.
/// The second term is subtracted, so that a rotation of the root rotates every weighted sum of the maps.
fn about_the_origin(maps: &[Affine]) -> Vec<Affine> {
    let root = maps.first().map_or(DVec3::ZERO, |map| map.translation);
    maps.iter().map(|map| Affine { translation: map.translation - root, ..*map }).collect()
}

/// The adjoint of [`about_the_origin`].
fn about_the_origin_vjp(d_maps: &[Affine]) -> Vec<Affine> {
    let mut d = d_maps.to_vec();
    let sum: DVec3 = d_maps.iter().map(|map| map.translation).sum();
    if let Some(root) = d.first_mut() {
        root.translation -= sum;
    }
    d
}

/// Posed points (metres): `x_p = sum_k W_k B_k x + sum_k W^_k B^_k x + t`, applied as affine maps without
/// renormalising.
pub fn skin(s: &Skinning) -> Vec<DVec3> {
    let residual_bones = s.effective_residual_bones();
    let move_point = |(p, x): (usize, &DVec3)| s.blended(&residual_bones, p).apply(*x) + s.translation;
    s.rest.par_iter().enumerate().with_min_len(CHUNK).map(move_point).collect()
}

/// Unit normals of the skinned surface from those at rest, N. A normal turns as the cross product of two tangents does, by
/// the cofactors of the blended map, whose own change along the surface is neglected; zero where the map collapses the
/// surface.
pub fn skin_normals(s: &Skinning, rest_normals: &[DVec3]) -> Vec<DVec3> {
    let residual_bones = s.effective_residual_bones();
    let turn = |(p, normal): (usize, &DVec3)| {
        let [x, y, z] = s.blended(&residual_bones, p).linear.to_cols_array_2d().map(DVec3::from_array);
        // Cofactors of the columns; those of the rows are their transpose.
        (y.cross(z) * normal.x + z.cross(x) * normal.y + x.cross(y) * normal.z).normalize_or_zero()
    };
    rest_normals.par_iter().enumerate().with_min_len(CHUNK).map(turn).collect()
}

/// Gradients of all inputs from dL/d(posed points). The result is bit-identical for any number of threads.
pub fn skin_vjp(s: &Skinning, d_posed: &[DVec3]) -> SkinGradients {
    let count = s.rest.len();
    let residual_bones = s.effective_residual_bones();
    let d_rest = |(p, d): (usize, &DVec3)| s.blended(&residual_bones, p).linear.transpose() * *d;
    // dL/dB_k = sum over the points of W_k dx_p [x; 1]^T.
    let d_bone = |row: &[f64]| {
        let moment = |p: usize| Affine { linear: outer(d_posed[p], s.rest[p]), translation: d_posed[p] };
        sum_in_chunks(count, Affine::ZERO, |sum, p| sum.add_scaled(row[p], &moment(p)), |a, b| a.add_scaled(1.0, &b))
    };
    let d_bones = |weights: &[f64]| weights.par_chunks_exact(count.max(1)).map(d_bone).collect();
    let d_effective: Vec<Affine> = d_bones(s.residual_weights);
    let mut d_residual_weights = vec![0.0; s.residual_weights.len()];
    let rows = d_residual_weights.par_chunks_exact_mut(count.max(1)).zip(&residual_bones);
    rows.for_each(|(row, bone)| {
        for ((slot, x), d) in row.iter_mut().zip(s.rest).zip(d_posed) {
            *slot = bone.apply(*x).dot(*d);
        }
    });
    SkinGradients {
        rest: d_posed.par_iter().enumerate().with_min_len(CHUNK).map(d_rest).collect(),
        residual_weights: d_residual_weights,
        bones: d_bones(s.weights),
        residual_bones: match s.mode {
            ResidualWeights::Paper => about_the_origin_vjp(&d_effective),
            // Subtracting the mean is self-adjoint.
            ResidualWeights::ZeroSum => centred(&d_effective),
        },
        translation: sum_in_chunks(count, DVec3::ZERO, |sum, p| sum + d_posed[p], |a, b| a + b),
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    #[test]
    fn a_normal_stays_perpendicular_to_the_surface_under_shear_and_scale() {
        let linear = DMat3::from_cols_array(&[1.2, 0.1, 0.0, 0.7, 0.9, -0.2, 0.0, 0.3, 1.5]);
        let bone = Affine { linear, translation: DVec3::new(1.0, 2.0, 3.0) };
        let tangent = DVec3::new(0.6, 0.0, 0.8);
        let bitangent = DVec3::new(0.3, 1.0, -0.2);
        let flat = Affine { linear: DMat3::from_diagonal(DVec3::X), ..bone };
        let posed = |bones: &[Affine]| {
            let skinning = Skinning {
                rest: &[DVec3::ZERO],
                weights: &[1.0],
                residual_weights: &[],
                bones,
                residual_bones: &[],
                translation: DVec3::ZERO,
                mode: ResidualWeights::ZeroSum,
            };
            skin_normals(&skinning, &[tangent.cross(bitangent).normalize()])[0]
        };
        let expected = (linear * tangent).cross(linear * bitangent).normalize();
        assert!(posed(&[bone]).abs_diff_eq(expected, 1e-14), "{}", posed(&[bone]));
        assert_eq!(posed(&[flat]), DVec3::ZERO);
    }
}
