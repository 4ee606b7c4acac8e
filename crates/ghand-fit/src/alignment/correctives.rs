//! A hand model's pose correctives by vertex: most joints have none for most vertices.

use ghand_core::HandModel;
use ghand_core::pose_response::rotation_features;
use ghand_core::skeleton::Chain;
use glam::DVec3;

/// Entries of a joint's rotation, on which its correctives depend.
pub const FEATURES: usize = 9;

/// Directions of one vertex, metres per entry of `R_k - I`, row by row, of a joint `k`.
type OfJoint = (usize, [DVec3; FEATURES]);

/// Pose correctives.
pub struct VertexCorrectives {
    /// Where each vertex's part of `all` begins, and the end of the last, `V + 1`.
    first: Vec<usize>,
    /// By vertex, then by ascending joint.
    all: Vec<OfJoint>,
}

impl VertexCorrectives {
    pub fn new(model: &HandModel) -> VertexCorrectives {
        let count = model.vertices.len();
        let mut by_vertex: Vec<Vec<OfJoint>> = vec![vec![]; count];
        for (k, directions) in model.pose_directions.chunks_exact((FEATURES * count).max(1)).enumerate() {
            for (vertex, own) in by_vertex.iter_mut().enumerate() {
                let own_directions = std::array::from_fn(|feature| directions[feature * count + vertex]);
                if own_directions != [DVec3::ZERO; FEATURES] {
                    own.push((k + 1, own_directions));
                }
            }
        }
        let mut first = vec![0];
        let mut all = vec![];
        for own in by_vertex {
            all.extend(own);
            first.push(all.len());
        }
        VertexCorrectives { first, all }
    }

    /// Those of a vertex, by ascending joint.
    pub fn of_vertex(&self, vertex: usize) -> &[OfJoint] {
        &self.all[self.first[vertex]..self.first[vertex + 1]]
    }

    /// Adds the correctives of a pose to the vertices at rest.
    pub fn add(&self, chain: &Chain, vertices: &mut [DVec3]) {
        let features: Vec<[f64; FEATURES]> = chain.local.iter().map(rotation_features).collect();
        for (vertex, place) in vertices.iter_mut().enumerate() {
            for (joint, directions) in self.of_vertex(vertex) {
                let moved = features[*joint].iter().zip(directions).filter(|(feature, _)| **feature != 0.0);
                moved.for_each(|(feature, direction)| *place += *direction * *feature);
            }
        }
    }
}
