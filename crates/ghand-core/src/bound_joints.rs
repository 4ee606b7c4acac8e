//! Skinning weights without the zeros: most vertices follow two to four joints.

use crate::HandModel;

/// By vertex the joints that move it, ascending, and their weights.
#[derive(Debug, Clone)]
pub struct BoundJoints {
    /// Where each vertex's part of `all` begins, and the end of the last, `V + 1`.
    first: Vec<usize>,
    all: Vec<(usize, f64)>,
}

impl BoundJoints {
    /// Those of a model.
    pub fn of(model: &HandModel) -> BoundJoints {
        let mut first = Vec::with_capacity(model.vertices.len() + 1);
        let mut all = vec![];
        for row in model.weights.chunks_exact(model.joint_count().max(1)) {
            first.push(all.len());
            all.extend(row.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0));
        }
        first.push(all.len());
        BoundJoints { first, all }
    }

    /// Those of a vertex.
    pub fn of_vertex(&self, vertex: usize) -> &[(usize, f64)] {
        &self.all[self.first[vertex]..self.first[vertex + 1]]
    }
}
