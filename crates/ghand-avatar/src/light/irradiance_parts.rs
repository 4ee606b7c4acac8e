//! What each part of a light gives a posed hand, before it is known how bright that part is.

use ghand_core::light::{DIRECTION_COUNT, HARMONIC_COUNT, directions, harmonics};
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, InvalidHandModel, Pose};
use glam::{DQuat, DVec3};

use super::{Lamps, LightKind, visibility};

/// What each coefficient and lamp of a light contributes to the irradiance of each vertex of a posed hand.
#[derive(Debug, Clone, PartialEq)]
pub struct IrradianceParts {
    /// One column of V numbers per coefficient, then one per lamp.
    pub columns: Vec<Vec<f32>>,
    /// The posed vertices, metres, world axes.
    pub vertices: Vec<DVec3>,
    /// Their normals, unit length.
    pub normals: Vec<DVec3>,
    /// Where the lamps stand, metres, world axes.
    pub lamps: Vec<DVec3>,
    /// Of even light, the part that does not reach each vertex past the hand; 0 without directions.
    pub closed: Vec<f32>,
    /// How far the light is trusted at each vertex.
    pub trust: Vec<f32>,
    /// Each vertex's part of the hand's surface.
    pub areas: Vec<f32>,
}

impl IrradianceParts {
    /// The parts of all coefficients of a light whose axes are turned, without lamps.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the hand.
    pub fn new(
        kind: LightKind,
        turn: DQuat,
        model: &HandModel,
        pose: &Pose,
    ) -> Result<IrradianceParts, InvalidHandModel> {
        let vertices = pose_hand(model, &[], pose)?.vertices;
        let normals = model.vertex_normals(&vertices);
        Ok(IrradianceParts::of(kind, turn, model, [vertices, normals], &[]))
    }

    /// As [`IrradianceParts::new`], of a hand with these vertices, metres, and normals, unit length, world axes. Columns that
    /// are `known`, perhaps of more vertices after these, are not computed.
    pub(super) fn of(
        kind: LightKind,
        turn: DQuat,
        model: &HandModel,
        [vertices, normals]: [Vec<DVec3>; 2],
        known: &[Vec<f32>],
    ) -> IrradianceParts {
        let columns = match kind {
            LightKind::Sh => {
                let all: Vec<[f64; HARMONIC_COUNT]> = normals.iter().map(|n| harmonics(turn.inverse() * *n)).collect();
                (0..HARMONIC_COUNT).map(|k| all.iter().map(|values| values[k] as f32).collect()).collect()
            }
            LightKind::Transfer => {
                let known = |k: usize| known.get(k).filter(|column| !column.is_empty());
                let (given, missing): (Vec<usize>, _) = (0..DIRECTION_COUNT).partition(|k| known(*k).is_some());
                let towards: Vec<DVec3> = missing.iter().map(|k| turn * directions()[*k]).collect();
                let mut columns = vec![vec![]; DIRECTION_COUNT];
                let found = visibility::vertex_transfers(&model.faces, &vertices, &normals, &towards);
                missing.iter().zip(found).for_each(|(k, column): (&usize, _)| columns[*k] = column);
                for k in given {
                    columns[k].extend(known(k).into_iter().flatten().take(vertices.len()));
                }
                columns
            }
        };
        let mut closed = vec![0.0; vertices.len()];
        if kind == LightKind::Transfer {
            closed.fill(1.0);
            for column in &columns {
                closed.iter_mut().zip(column).for_each(|(closed, part)| *closed -= part);
            }
            closed.iter_mut().for_each(|closed| *closed = closed.max(0.0));
        }
        let areas = areas(&model.faces, &vertices);
        let trust = vec![1.0; vertices.len()];
        IrradianceParts { columns, vertices, normals, lamps: vec![], closed, trust, areas }
    }

    /// Adds those of lamps. `turn` is that of the light.
    pub fn add_lamps(&mut self, lamps: &Lamps, turn: DQuat, model: &HandModel) {
        self.add_other_lamps(lamps, turn, model, &[]);
    }

    /// As [`IrradianceParts::add_lamps`]; columns that are `known`, perhaps of more vertices after these, are not computed.
    pub(super) fn add_other_lamps(&mut self, lamps: &Lamps, turn: DQuat, model: &HandModel, known: &[Vec<f32>]) {
        let positions = lamps.positions(turn, &self.vertices);
        for (lamp, at) in positions.into_iter().enumerate() {
            let column = match known.get(lamp).filter(|column| !column.is_empty()) {
                Some(known) => known.iter().take(self.vertices.len()).copied().collect(),
                None => lamps.column(lamp, model, at, &self.vertices, &self.normals),
            };
            self.columns.push(column);
            self.lamps.push(at);
        }
    }

    /// The mean of values of the vertices over the hand's surface.
    pub fn mean(&self, values: &[[f64; 3]]) -> [f64; 3] {
        let mut mean = [0.0; 3];
        for (value, area) in values.iter().zip(&self.areas) {
            mean.iter_mut().zip(value).for_each(|(sum, c)| *sum += f64::from(*area) * c);
        }
        mean
    }
}

/// Each vertex's part of a surface: a third of its triangles.
fn areas(faces: &[[u32; 3]], vertices: &[DVec3]) -> Vec<f32> {
    let mut areas = vec![0.0; vertices.len()];
    for face in faces {
        let [a, b, c] = face.map(|corner| vertices[corner as usize]);
        let area = (b - a).cross(c - a).length();
        face.iter().for_each(|corner| areas[*corner as usize] += area);
    }
    let whole = areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    areas.into_iter().map(|area| (area / whole) as f32).collect()
}
