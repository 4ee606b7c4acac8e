//! Sews the two pieces of cloth together, pulls them over the solid hand and relaxes them.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::packing::pack;
use super::pattern::{Pattern, neighbours};
use super::skeleton::{CLOTH_PER_RADIUS, Chain, Skeleton, on_cloth};
use ghand_hand_model::files::mano::JOINT_NAMES;
use ghand_hand_model::pose_correctives::smooth_step;

/// The closed skin of the hand with its atlas.
#[derive(Debug, Clone)]
pub(super) struct Glove {
    pub vertices: Vec<DVec3>,
    pub faces: Vec<[u32; 3]>,
    pub uvs: Vec<DVec2>,
    pub face_uvs: Vec<[u32; 3]>,
    /// Position of each vertex on the cloth, metres.
    cloth: Vec<DVec2>,
    scale: f64,
}

/// Edge of the cloth's lattice at detail 1, metres, for a hand of the default size.
const EDGE: f64 = 0.0074;
/// The part of a web's middle that moves with the palm instead of with the fingers.
const WEB_HOLD: f64 = 0.6;

impl Glove {
    /// `None` if the cloth is not a disc.
    pub(super) fn sew(skeleton: &Skeleton, scale: f64, detail: u32) -> Option<Glove> {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for chain in &skeleton.chains {
            for (p, r) in chain.flat.iter().zip(&chain.radii) {
                let reach = DVec2::splat(CLOTH_PER_RADIUS * r + 0.01 * scale);
                low = low.min(*p - reach);
                high = high.max(*p + reach);
            }
        }
        let edge = EDGE * scale / f64::from(detail);
        let pattern = Pattern::triangulate(low, high, edge, |p| skeleton.outline.field(on_cloth(p)).value)?;
        let mut glove = Glove::from_pattern(&pattern, scale);
        glove.pull_over(skeleton, &pattern, detail);
        Some(glove)
    }

    fn from_pattern(pattern: &Pattern, scale: f64) -> Glove {
        let count = pattern.points.len() as u32;
        let mut cloth = pattern.points.clone();
        // The second piece shares the points of the outline but has its own UV points.
        let other: Vec<u32> = (0..count as usize)
            .map(|i| {
                if pattern.on_outline[i] {
                    return i as u32;
                }
                cloth.push(pattern.points[i]);
                cloth.len() as u32 - 1
            })
            .collect();
        let [back, palm] = pack(pattern);
        // The cloth's axes (along -Y, across +Z) form a rotation about -X: the back of the hand needs the triangles
        // with reversed winding.
        let turned = pattern.triangles.iter().map(|&[a, b, c]| [a, c, b]);
        Glove {
            vertices: vec![DVec3::ZERO; cloth.len()],
            faces: turned.clone().chain(pattern.triangles.iter().map(|t| t.map(|i| other[i as usize]))).collect(),
            uvs: back.into_iter().chain(palm).collect(),
            face_uvs: turned.chain(pattern.triangles.iter().map(|t| t.map(|i| i + count))).collect(),
            cloth,
            scale,
        }
    }

    fn pull_over(&mut self, skeleton: &Skeleton, pattern: &Pattern, detail: u32) {
        let count = pattern.points.len();
        self.vertices = (0..self.cloth.len())
            .map(|i| {
                let side = if i >= count {
                    -1.0
                } else if pattern.on_outline[i] {
                    0.0
                } else {
                    1.0
                };
                wrap(skeleton, self.cloth[i], side, self.scale)
            })
            .collect();
        let neighbours = neighbours(self.vertices.len(), &self.faces);
        // The first guess is already even, except at the webs. A finer cloth needs more rounds to move it over the same
        // distance. Exactly the same effect would need the square of the detail, but the difference is not visible.
        let rounds = 80 * detail;
        for _ in 0..rounds {
            let before = &self.vertices;
            self.vertices = before
                .par_iter()
                .zip(&neighbours)
                .map(|(&p, list)| {
                    let (on_skin, normal) = skeleton.flesh.project(p);
                    let mean = list.iter().map(|&j| before[j as usize]).sum::<DVec3>() / list.len().max(1) as f64;
                    let step = mean - p;
                    on_skin + 0.5 * (step - normal * step.dot(normal))
                })
                .collect();
        }
        for _ in 0..3 {
            self.vertices.par_iter_mut().for_each(|p| *p = skeleton.flesh.project(*p).0);
        }
    }

    /// How much of each vertex belongs to each chain, `[V][5]`; rows sum to 1. `softness` is the width of the borders,
    /// metres on a hand of the default size.
    pub(super) fn shares(&self, skeleton: &Skeleton, softness: f64) -> Vec<Vec<f64>> {
        self.cloth.iter().map(|&p| memberships(skeleton, p, softness * self.scale)).collect()
    }

    /// Skinning weights `[V][16]`, rows sum to 1.
    ///
    /// The finger of a vertex is determined on the cloth, where fingers are far apart; its position along the finger,
    /// in space.
    pub(super) fn skinning_weights(&self, skeleton: &Skeleton, detail: u32) -> Vec<f64> {
        let n = JOINT_NAMES.len();
        let mut weights = vec![0.0; self.vertices.len() * n];
        for (i, row) in weights.chunks_exact_mut(n).enumerate() {
            let shares = memberships(skeleton, self.cloth[i], 0.0035 * self.scale);
            // A web follows the palm more than either finger: if it followed a finger that bends alone, it would turn
            // inside out.
            let belonging = shares.iter().copied().fold(0.0, f64::max);
            let free = 1.0 - WEB_HOLD * (1.0 - smooth_step(2.0 * belonging - 1.0));
            for (chain, share) in skeleton.chains.iter().zip(shares) {
                let mut above = share * free;
                row[0] += share - above;
                let bends = chain.bends(self.vertices[i]);
                row[0] += above * (1.0 - bends[0]);
                for k in 0..3 {
                    above *= bends[k];
                    row[chain.first_joint + k] += above * (1.0 - bends.get(k + 1).copied().unwrap_or(0.0));
                }
            }
        }
        let neighbours = neighbours(self.vertices.len(), &self.faces);
        // Rounds of averaging reach as far as the square root of their number, in edges.
        for _ in 0..2 * detail * detail {
            let before = weights.clone();
            weights.par_chunks_exact_mut(n).enumerate().for_each(|(i, row)| {
                for (k, w) in row.iter_mut().enumerate() {
                    let sum: f64 = neighbours[i].iter().map(|&j| before[j as usize * n + k]).sum();
                    *w = 0.5 * *w + 0.5 * sum / neighbours[i].len().max(1) as f64;
                }
            });
        }
        for row in weights.chunks_exact_mut(n) {
            let mut largest = row.to_vec();
            largest.sort_by(|a, b| b.total_cmp(a));
            // The fifth largest weight, or a small minimum, is subtracted from all: at most four joints remain, and no
            // weight jumps.
            let floor = largest[4].max(0.02);
            row.iter_mut().for_each(|w| *w = (*w - floor).max(0.0));
            let sum: f64 = row.iter().sum();
            row.iter_mut().for_each(|w| *w /= sum);
        }
        weights
    }
}

impl Chain {
    /// The bone nearest to a point of the cloth, and the part of the way along it.
    fn nearest_on_cloth(&self, p: DVec2) -> (usize, f64, DVec2) {
        let mut best = (0, 0.0, DVec2::ZERO, f64::INFINITY);
        for (k, pair) in self.flat.windows(2).enumerate() {
            let axis = pair[1] - pair[0];
            let t = ((p - pair[0]).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
            let offset = p - pair[0] - t * axis;
            if offset.length() < best.3 {
                best = (k, t, offset, offset.length());
            }
        }
        (best.0, best.1, best.2)
    }

    fn radius(&self, k: usize, t: f64) -> f64 {
        self.radii[k] + t * (self.radii[k + 1] - self.radii[k])
    }

    /// For each of the chain's joints: 0 well before it, 1 well beyond it, smooth between.
    fn bends(&self, p: DVec3) -> [f64; 3] {
        [0, 1, 2].map(|k| {
            let at = self.first_point + k;
            let joint = self.points[at];
            let radius = self.radii[at];
            let to = (self.points[at + 1] - joint).normalize();
            let from = (joint - self.points[at - 1]).normalize();
            let along = (p - joint).dot((to + from).normalize());
            // The root joints move a wide area of the palm; the others, after the weights are smoothed, about a
            // finger's width.
            let reach = if k == 0 { 1.4 } else { 0.55 } * radius;
            smooth_step((along + reach) / (2.0 * reach))
        })
    }
}

/// How much of a point of the cloth belongs to each chain; sums to 1. `softness` (metres) is the width of the borders.
fn memberships(skeleton: &Skeleton, p: DVec2, softness: f64) -> Vec<f64> {
    let depths: Vec<f64> = skeleton
        .chains
        .iter()
        .map(|chain| {
            let (k, t, offset) = chain.nearest_on_cloth(p);
            offset.length() - CLOTH_PER_RADIUS * chain.radius(k, t)
        })
        .collect();
    let least = depths.iter().copied().fold(f64::INFINITY, f64::min);
    let raw: Vec<f64> = depths.iter().map(|d| ((least - d) / softness).exp()).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|w| w / sum).collect()
}

/// A first guess of the position of a point of the cloth: wound halfway around its bones. `side` is 1 on the back, -1
/// on the palm, 0 on the seam.
fn wrap(skeleton: &Skeleton, p: DVec2, side: f64, scale: f64) -> DVec3 {
    let mut position = DVec3::ZERO;
    for (chain, membership) in skeleton.chains.iter().zip(memberships(skeleton, p, 0.006 * scale)) {
        let (k, t, offset) = chain.nearest_on_cloth(p);
        let axis = (chain.flat[k + 1] - chain.flat[k]).normalize();
        let to = (chain.points[k + 1] - chain.points[k]).normalize();
        let across = to.cross(DVec3::X).normalize();
        let up = across.cross(to);
        let radius = chain.radius(k, t);
        let turns = offset.length() / (CLOTH_PER_RADIUS * radius);
        let angle = turns.min(1.0) * std::f64::consts::FRAC_PI_2;
        let outwards = (to * offset.dot(axis) + across * axis.perp_dot(offset)).normalize_or_zero();
        let wound = outwards * (angle.sin() + (turns - 1.0).max(0.0)) + up * (side * angle.cos());
        position += membership * (chain.points[k].lerp(chain.points[k + 1], t) + radius * wound);
    }
    position
}
