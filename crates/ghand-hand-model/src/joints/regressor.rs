//! Joints as weighted sums of the skin around them.

use ghand_core::HandModel;
use ghand_core::posing::regress_joints;
use glam::DVec3;

use crate::cholesky::solve;

/// How far the skin is that a joint follows, as a multiple of the distance to the nearest: as far along a finger as it
/// is wide, in both directions.
const REACH: f64 = 2.2;
/// The least reach, as a part of the model's longest side: 11 mm of a hand with its wrist. A fingertip's joint lies on
/// the skin.
const LEAST_REACH: f64 = 0.05;
/// Reaches that are tried, each 1.5 times the one before: coarse meshes have few vertices around a joint.
const ATTEMPTS: i32 = 5;
/// Largest sum of the weights' sizes. Joints between vertices need 1 to 3; far more would amplify the displacements.
const MAX_SUM: f64 = 10.0;
/// How exactly a row must give its joint, as a part of its reach.
const ROUNDING: f64 = 1e-9;

/// One joint's row of a regressor: `(vertex, weight)`.
pub type Row = Vec<(u32, f64)>;

/// The vertices that a joint may follow, and the conditions on their weights.
pub struct Conditions {
    /// Vertices, and how readily the joint follows each (more than 0).
    pub candidates: Vec<(u32, f64)>,
    /// Number of conditions.
    pub count: usize,
    /// `[candidates][count]`: each vertex's part in each condition. The weighted sum of the first shall be 1, those of
    /// the others 0.
    pub columns: Vec<f64>,
}

impl Conditions {
    /// The smallest weights (in the sum of `weight^2 / readiness`) that keep the first `exact` conditions up to
    /// rounding and the others nearly.
    pub fn smallest_weights(&self, exact: usize) -> Row {
        let mut weights = vec![0.0; self.candidates.len()];
        // Some conditions depend on each other. So the smallest weights that nearly satisfy all of them are found
        // first, and then corrected for those that must hold exactly.
        for (count, ridge) in [(self.count, 1e-6), (exact, 0.0), (exact, 0.0)] {
            let mut gram = vec![0.0; count * count];
            let mut missing = vec![0.0; count];
            missing[0] = 1.0;
            for ((column, &(_, ready)), weight) in self.rows().zip(&weights) {
                for a in 0..count {
                    missing[a] -= weight * column[a];
                    (0..=a).for_each(|b| gram[a * count + b] += ready * column[a] * column[b]);
                }
            }
            let trace: f64 = self.candidates.iter().map(|(_, ready)| ready).sum();
            (0..count).for_each(|a| gram[a * count + a] += ridge * trace);
            let multipliers = solve(gram, &missing);
            for ((column, &(_, ready)), weight) in self.rows().zip(&mut weights) {
                *weight += ready * column.iter().zip(&multipliers).map(|(c, m)| c * m).sum::<f64>();
            }
        }
        self.candidates.iter().zip(weights).map(|(&(vertex, _), weight)| (vertex, weight)).collect()
    }

    fn rows(&self) -> impl Iterator<Item = (&[f64], &(u32, f64))> {
        self.columns.chunks_exact(self.count).zip(&self.candidates)
    }
}

/// Lets the joints of a model follow the skin around them in every shape: each joint is the smoothest sum of the
/// vertices near it that gives its rest position. Where no such sum exists, as in a flat mesh, all joints get
/// directions instead: the mean displacement of the skin around them.
pub fn follow_skin(model: &mut HandModel) {
    let rows: Vec<(Row, bool)> = (0..model.joint_count()).map(|joint| row(model, joint)).collect();
    let all_exact = rows.iter().all(|(_, exact)| *exact);
    let rows: Vec<Row> = rows.into_iter().map(|(row, _)| row).collect();
    if all_exact {
        // The same sum as in posing, so that shape 0 changes no bit.
        model.joints = regress_joints(&rows, &model.vertices);
        model.joint_regressor = rows;
    } else {
        let directions = model.shape_directions.chunks_exact(model.vertices.len());
        model.joint_directions = directions.flat_map(|direction| regress_joints(&rows, direction)).collect();
    }
}

/// One joint's row, and whether it gives the rest position.
fn row(model: &HandModel, joint: usize) -> (Row, bool) {
    let at = model.joints[joint];
    let kinship = kinship(model, joint);
    let nearest = (model.vertices.iter().zip(&kinship))
        .filter(|(_, kinship)| **kinship > 0.5)
        .map(|(v, _)| v.distance(at))
        .fold(f64::INFINITY, f64::min);
    let low = model.vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = model.vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let least = (LEAST_REACH * (high - low).max_element()).max(REACH * nearest);
    let mut around = Vec::new();
    for attempt in 0..ATTEMPTS {
        let reach = least * 1.5f64.powi(attempt);
        let conditions = conditions(model, at, reach, &kinship);
        let row = conditions.smallest_weights(4);
        let found: DVec3 = row.iter().map(|&(i, w)| model.vertices[i as usize] * w).sum();
        let size: f64 = row.iter().map(|(_, w)| w.abs()).sum();
        if size <= MAX_SUM && found.distance(at) <= ROUNDING * reach {
            return (row, true);
        }
        if around.is_empty() {
            around = conditions.candidates;
        }
    }
    let sum: f64 = around.iter().map(|(_, ready)| ready).sum();
    (around.into_iter().map(|(vertex, ready)| (vertex, ready / sum)).collect(), false)
}

/// Each vertex's weight for a joint, its parent and its children, as a part of the largest: skin of a neighbouring
/// finger may be near, but does not tell where the joint is.
fn kinship(model: &HandModel, joint: usize) -> Vec<f64> {
    let is_kin = |k: usize| k == joint || model.parents[joint] == Some(k) || model.parents[k] == Some(joint);
    let kin: Vec<usize> = (0..model.joint_count()).filter(|&k| is_kin(k)).collect();
    let of_vertex = |i: usize| -> f64 { kin.iter().map(|&k| model.vertex_weights(i)[k]).sum() };
    let sums: Vec<f64> = (0..model.vertices.len()).map(of_vertex).collect();
    let most = sums.iter().copied().fold(0.0, f64::max);
    if most > 0.0 { sums.into_iter().map(|sum| sum / most).collect() } else { vec![1.0; sums.len()] }
}

/// That the weights sum to 1 and give the joint.
fn conditions(model: &HandModel, at: DVec3, reach: f64, kinship: &[f64]) -> Conditions {
    let mut conditions = Conditions { candidates: vec![], count: 4, columns: vec![] };
    for (i, (v, kinship)) in model.vertices.iter().zip(kinship).enumerate() {
        let fade = 1.0 - v.distance_squared(at) / (reach * reach);
        if fade > 0.0 && *kinship > 0.0 {
            conditions.candidates.push((i as u32, fade * fade * kinship));
            let offset = (*v - at) / reach;
            conditions.columns.extend([1.0, offset.x, offset.y, offset.z]);
        }
    }
    conditions
}
