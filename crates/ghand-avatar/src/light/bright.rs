//! The sources of light that are worth a closer look.

use ghand_core::HandModel;
use ghand_core::light::DIRECTION_COUNT;
use glam::DVec3;

use super::{IrradianceParts, Light, LightKind, lamps, visibility};

/// A source is bright if it has this many times the mean radiance of all.
const BRIGHT: f64 = 2.0;
/// From how many places bright sources may be looked for: a lamp needs several.
const MOST_LOOKS: usize = 16;

impl Light {
    /// The brightest sources, numbers of directions and, after those, of lamps: clearly brighter than most, and as many as may
    /// cost little.
    pub(super) fn bright(&self) -> Vec<usize> {
        if self.kind == LightKind::Sh {
            return vec![];
        }
        let strengths: Vec<f64> =
            self.radiances().map(|radiance| radiance.iter().map(|c| f64::from(*c)).sum()).collect();
        let least = BRIGHT * strengths.iter().sum::<f64>() / strengths.len() as f64;
        let mut sources: Vec<usize> = (0..strengths.len()).filter(|source| strengths[*source] > least).collect();
        sources.sort_by(|a, b| strengths[*b].total_cmp(&strengths[*a]));
        let mut looks = 0;
        sources.retain(|source| {
            looks += if *source < DIRECTION_COUNT { 1 } else { lamps::POINTS };
            looks <= MOST_LOOKS
        });
        sources
    }

    /// What the brightest sources give vertices (metres, world axes) with these normals (unit length); the columns of others are
    /// empty. The first vertices are those of the hand, which is in the way.
    pub(super) fn bright_parts(&self, model: &HandModel, vertices: Vec<DVec3>, normals: Vec<DVec3>) -> IrradianceParts {
        let sources = self.bright();
        let own = &vertices[..model.vertices.len().min(vertices.len())];
        let positions = self.lamps.as_ref().map_or(vec![], |lamps| lamps.positions(self.turn, own));
        let mut columns = vec![vec![]; DIRECTION_COUNT + positions.len()];
        let towards = self.directions();
        let (far, near): (Vec<usize>, Vec<usize>) = sources.iter().partition(|source| **source < DIRECTION_COUNT);
        let chosen: Vec<DVec3> = far.iter().map(|k| towards[*k]).collect();
        for (k, column) in far.iter().zip(visibility::vertex_transfers(&model.faces, &vertices, &normals, &chosen)) {
            columns[*k] = column;
        }
        for k in near {
            let lamp = k - DIRECTION_COUNT;
            if let Some(lamps) = &self.lamps {
                columns[k] = lamps.column(lamp, model, positions[lamp], &vertices, &normals);
            }
        }
        IrradianceParts { columns, vertices, normals, lamps: positions, closed: vec![], trust: vec![], areas: vec![] }
    }
}
