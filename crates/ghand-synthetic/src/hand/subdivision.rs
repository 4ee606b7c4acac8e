//! Makes a finer mesh of the same hand by Loop subdivision (C. Loop, Smooth Subdivision Surfaces Based on Triangles,
//! 1987).

use std::collections::HashMap;
use std::f64::consts::TAU;

use ghand_core::HandModel;
use ghand_hand_model::surface::smooth::split;
use glam::DVec3;

/// The two triangles at an edge at most, and the edge's own vertex.
struct Edge {
    ends: [u32; 2],
    opposite: Vec<u32>,
    vertex: u32,
}

/// The hand with each triangle divided into four, with positions and skinning weights smoothed in the same way and UVs
/// at edge midpoints; fingers keep their girth. Blend shapes and the joint regressor, which are per vertex, are
/// dropped; the joints do not move.
pub(crate) fn subdivided(model: &HandModel) -> HandModel {
    let edges = edges(&model.faces, model.vertices.len());
    let edge_of: HashMap<[u32; 2], u32> = edges.iter().map(|e| (e.ends, e.vertex)).collect();
    let faces = split(&model.faces, |a, b| edge_of[&key(a, b)]);

    // UVs are cut at seams and therefore have their own edges; functions that are linear on a triangle stay linear.
    let mut uvs = model.uvs.clone();
    let mut uv_of = HashMap::new();
    let face_uvs = split(&model.face_uvs, |a, b| {
        *uv_of.entry(key(a, b)).or_insert_with(|| {
            uvs.push((uvs[a as usize] + uvs[b as usize]) * 0.5);
            uvs.len() as u32 - 1
        })
    });

    let stencils = stencils(&edges, model.vertices.len());
    let smoothed = |from: &[DVec3], count: usize| -> Vec<DVec3> {
        let sum = |stencil: &Vec<(u32, f64)>| stencil.iter().map(|&(v, part)| from[v as usize] * part).sum();
        stencils.iter().take(count).map(sum).collect()
    };
    // Smoothing pulls round parts inwards; they are pushed outwards by the same amount first, so that the surface
    // passes near the old vertices.
    let pulled = smoothed(&model.vertices, model.vertices.len());
    let pushed: Vec<DVec3> = model.vertices.iter().zip(&pulled).map(|(v, p)| *v * 2.0 - *p).collect();
    let vertices = smoothed(&pushed, stencils.len());
    let mut weights = Vec::with_capacity(stencils.len() * model.joint_count());
    for stencil in &stencils {
        let first = weights.len();
        weights.resize(first + model.joint_count(), 0.0);
        for &(v, part) in stencil {
            let of_vertex = model.vertex_weights(v as usize);
            weights[first..].iter_mut().zip(of_vertex).for_each(|(sum, w)| *sum += w * part);
        }
    }
    HandModel { faces, face_uvs, uvs, vertices, weights, ..model.without_blend_shapes() }
}

fn key(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Every edge once, in the order of the faces; their vertices follow the mesh's own.
fn edges(faces: &[[u32; 3]], vertices: usize) -> Vec<Edge> {
    let mut edges: Vec<Edge> = vec![];
    let mut index = HashMap::new();
    for &[a, b, c] in faces {
        for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
            let ends = key(from, to);
            let i = *index.entry(ends).or_insert_with(|| {
                edges.push(Edge { ends, opposite: vec![], vertex: (vertices + edges.len()) as u32 });
                edges.len() - 1
            });
            edges[i].opposite.push(opposite);
        }
    }
    edges
}

/// Composition of each new vertex: old vertices and their weights, which sum to one.
fn stencils(edges: &[Edge], vertices: usize) -> Vec<Vec<(u32, f64)>> {
    let mut neighbours = vec![vec![]; vertices];
    let mut along_border = vec![vec![]; vertices];
    for edge in edges {
        let [a, b] = edge.ends;
        for (from, to) in [(a, b), (b, a)] {
            neighbours[from as usize].push(to);
            if edge.opposite.len() != 2 {
                along_border[from as usize].push(to);
            }
        }
    }
    let even = neighbours.iter().zip(&along_border).zip(0..).map(|((around, border), v)| {
        // On a border, and where surfaces meet, only border vertices count.
        let (around, rest) = match border.len() {
            0 => {
                let n = around.len() as f64;
                let inner = 0.375 + 0.25 * (TAU / n).cos();
                (around, if around.is_empty() { 0.0 } else { 0.625 - inner * inner })
            }
            _ => (border, 0.25),
        };
        let part = rest / around.len().max(1) as f64;
        std::iter::once((v, 1.0 - rest)).chain(around.iter().map(|&u| (u, part))).collect()
    });
    let odd = edges.iter().map(|edge| match edge.opposite[..] {
        [c, d] => vec![(edge.ends[0], 0.375), (edge.ends[1], 0.375), (c, 0.125), (d, 0.125)],
        _ => edge.ends.map(|v| (v, 0.5)).to_vec(),
    });
    even.chain(odd).collect()
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    #[test]
    fn subdivision_gives_four_times_the_faces_of_the_same_hand() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let fine = subdivided(&model);
        fine.validate().unwrap();
        assert_eq!(fine.faces.len(), 4 * model.faces.len());
        // Euler: a closed surface of one piece.
        assert_eq!(fine.vertices.len() as i64 - fine.faces.len() as i64 / 2, 2);
        let weights = fine.weights.chunks_exact(fine.joint_count());
        assert!(weights.map(|row| (row.iter().sum::<f64>() - 1.0).abs()).all(|error| error < 1e-12));
        let moved: Vec<f64> = model.vertices.iter().zip(&fine.vertices).map(|(a, b)| a.distance(*b)).collect();
        let mean = moved.iter().sum::<f64>() / moved.len() as f64;
        // On a finger's radius of 10 mm, edges of 7 mm would be pulled in by 0.8 mm.
        assert!((1e-6..2e-4).contains(&mean), "{mean} m on average");
    }

    #[test]
    fn the_regular_grid_is_kept_and_a_border_is_halved() {
        // Six triangles around a vertex: a hexagon, flat.
        let ring = |k: u32| DVec3::new((TAU / 6.0 * f64::from(k)).cos(), (TAU / 6.0 * f64::from(k)).sin(), 2.0);
        let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        model.vertices = std::iter::once(DVec3::Z * 2.0).chain((0..6).map(ring)).collect();
        model.weights = [1.0].repeat(7).into_iter().flat_map(|w| [vec![w], vec![0.0; 15]].concat()).collect();
        model.faces = (0..6).map(|k| [0, 1 + k, 1 + (k + 1) % 6]).collect();
        model.face_uvs = model.faces.clone();
        let fine = subdivided(&model);
        assert_eq!((fine.vertices.len(), fine.faces.len()), (19, 24));
        assert!(fine.vertices[0].distance(DVec3::Z * 2.0) < 1e-12);
        assert!(fine.vertices.iter().all(|p| (p.z - 2.0).abs() < 1e-12));
        // A border vertex becomes 3/4 of itself plus 1/8 of each neighbour on the border: (6 + 1/2 + 1/2) / 8 = 0.875
        // along its own direction, of a hexagon that was pushed out to 2 - 0.875 first.
        assert!((fine.vertices[1].truncate().length() - 0.875 * 1.125).abs() < 1e-12);
        let spoke = fine.vertices[7].truncate();
        assert!(spoke.distance(ring(0).truncate() * 0.5 * 1.125) < 1e-12, "{spoke}");
    }
}
