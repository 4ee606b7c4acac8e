//! Checks every derivative of the crate, at every extreme, in two ways: against forward-mode differentiation of a
//! second implementation (`reference`, `dual`), and against differences of the crate's own values.
//!
//! `cargo test -p ghand-core --test it derivatives:: -- --nocapture` prints the worst errors, as in `lab/2026-11-numerics.md`.

mod cases;
mod check;
mod deformation;
mod dual;
mod parts;
mod posing;
mod reference;

use check::largest;
use glam::DVec3;

/// Step of the differences to rotations, radians: five points leave an error of some 1e-9 of the fifth power of the
/// turns along a chain, and rounding about 1e-13. At an angle of 1e-300 the step is far larger than the angle: the
/// differences there are between rotations on both sides of zero, which is exact up to 1e-300.
const ROTATION_STEP: f64 = 2e-3;

fn dvec3s(flat: &[f64]) -> Vec<DVec3> {
    flat.chunks_exact(3).map(DVec3::from_slice).collect()
}

fn flat(vectors: &[DVec3]) -> Vec<f64> {
    vectors.iter().flat_map(|v| v.to_array()).collect()
}

/// Number of joints on the longest path from the root.
fn depth(parents: &[Option<usize>]) -> f64 {
    let mut depths: Vec<f64> = vec![];
    parents.iter().for_each(|parent| depths.push(1.0 + parent.map_or(0.0, |p| depths[p])));
    largest(&depths)
}
