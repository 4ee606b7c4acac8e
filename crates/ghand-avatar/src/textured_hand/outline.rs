//! The avatar's shape as a mesh: vertices where the outline of its Gaussians is.

use std::f64::consts::PI;

use ghand_core::HandModel;
use glam::DVec3;
use rayon::prelude::*;

use super::line_of_sight::{Cloud, Line};

/// Largest distance by which a vertex is moved, metres.
const FARTHEST: f64 = 4e-3;
/// Places that are tried, from outside to inside.
const STEPS: usize = 33;
/// Directions of lines that touch the hand at a place, over half a turn.
const DIRECTIONS: usize = 6;
/// Rounds in which each vertex takes a part of its neighbours' distances: what differs from vertex to vertex is noise of
/// single Gaussians.
const ROUNDS: usize = 4;

/// The vertices (metres) of a model at rest, moved to the outline of its Gaussians.
pub fn fitted(model: &HandModel, cloud: &Cloud) -> Vec<DVec3> {
    let normals = model.vertex_normals(&model.vertices);
    let places: Vec<_> = model.vertices.iter().zip(&normals).collect();
    let moves: Vec<Option<f64>> =
        places.par_iter().map(|(vertex, normal)| outline(cloud, **vertex, **normal)).collect();
    let moves = smooth(model, moves);
    places.iter().zip(moves).map(|((vertex, normal), distance)| **vertex + **normal * distance).collect()
}

/// How far outwards of a vertex a line that touches the hand is half covered. Of all directions that counts in which it is
/// covered least: where the surface is bent most, and others look along it. `None` if that is not near.
fn outline(cloud: &Cloud, vertex: DVec3, normal: DVec3) -> Option<f64> {
    let across = normal.any_orthonormal_vector();
    let other = normal.cross(across);
    let cover = |distance: f64| {
        let place = vertex + normal * distance;
        let of = |k: usize| {
            let (sin, cos) = (k as f64 * PI / DIRECTIONS as f64).sin_cos();
            cloud.cover(&Line { place, outwards: normal, along: across * cos + other * sin })
        };
        (0..DIRECTIONS).map(of).fold(1.0, f64::min)
    };
    let at = |step: usize| FARTHEST * (1.0 - 2.0 * step as f64 / (STEPS - 1) as f64);
    let mut outside = cover(at(0));
    for step in 1..STEPS {
        let inside = cover(at(step));
        if outside < 0.5 && inside >= 0.5 {
            let part = (0.5 - outside) / (inside - outside);
            return Some(at(step - 1) + part * (at(step) - at(step - 1)));
        }
        outside = inside;
    }
    None
}

/// Distances that change slowly over the mesh. Vertices without a distance take that of their neighbours.
fn smooth(model: &HandModel, moves: Vec<Option<f64>>) -> Vec<f64> {
    let mut weights: Vec<f64> = moves.iter().map(|known| if known.is_some() { 1.0 } else { 1e-3 }).collect();
    let mut moves: Vec<f64> = moves.into_iter().map(Option::unwrap_or_default).collect();
    for _ in 0..ROUNDS {
        let mut sums: Vec<(f64, f64)> = moves.iter().zip(&weights).map(|(m, w)| (2.0 * m * w, 2.0 * w)).collect();
        for face in &model.faces {
            for k in 0..3 {
                let [from, to] = [face[k] as usize, face[(k + 1) % 3] as usize];
                // Each edge is in two faces, once in each direction.
                sums[to].0 += moves[from] * weights[from];
                sums[to].1 += weights[from];
            }
        }
        moves = sums.iter().map(|(sum, weight)| sum / weight).collect();
        // What came from neighbours is known from now on.
        weights = sums.iter().map(|(_, weight)| weight.min(1.0)).collect();
    }
    moves
}
