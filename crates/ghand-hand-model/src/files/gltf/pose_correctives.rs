//! Pose correctives in the extras of a glTF skin, as [`crate::files::rigged_glb`] writes them.

use ::gltf::json::extras::RawValue;
use ::gltf::{Accessor, Gltf};
use ghand_core::HandModel;
use glam::DVec3;
use serde::Deserialize;

use super::buffers::Buffers;
use super::{Source, dvec3};
use crate::HandModelError;

/// Most displacements (9 x joints x vertices), 0.4 gigabytes: 70,000 vertices with 25 joints.
const MAX_DISPLACEMENTS: usize = 1 << 24;
/// Entries of a rotation.
const FEATURES: usize = 9;

#[derive(Deserialize)]
struct SkinExtras {
    pose_correctives: Vec<Corrective>,
}

#[derive(Deserialize)]
struct Corrective {
    joint: String,
    vertices: usize,
    directions: usize,
}

/// The pose directions `[9 (n_b - 1)][V]` of a welded model; empty if the file has none. Extras of other programs are
/// ignored.
pub(super) fn pose_directions(
    extras: Option<&RawValue>,
    model: &HandModel,
    file: &Gltf,
    buffers: &Buffers,
    source: &Source,
) -> Result<Vec<DVec3>, HandModelError> {
    let extras: Option<SkinExtras> = extras.and_then(|extras| serde_json::from_str(extras.get()).ok());
    let Some(SkinExtras { pose_correctives }) = extras.filter(|extras| !extras.pose_correctives.is_empty()) else {
        return Ok(vec![]);
    };
    let count = model.vertices.len();
    let joints = model.joint_count();
    let invalid = |problem: String| source.invalid("skins.extras.pose_correctives", problem);
    let length = FEATURES * (joints - 1) * count;
    if length > MAX_DISPLACEMENTS {
        let problem = format!("are for {count} vertices and {joints} joints, too many; decimate the mesh");
        return Err(invalid(problem));
    }
    let mut copies = vec![0.0; count];
    model.source_vertices.iter().for_each(|&vertex| copies[vertex as usize] += 1.0);
    let mut all = vec![DVec3::ZERO; length];
    let mut seen = vec![false; joints];
    for Corrective { joint: name, vertices, directions } in pose_correctives {
        let fail = |problem: String| invalid(format!("those of joint {name:?} {problem}; export the hand again"));
        let joint = match model.joint_index(&name) {
            Some(0) => return Err(fail("are of the root, which has none".into())),
            Some(joint) if !std::mem::replace(&mut seen[joint], true) => joint,
            Some(_) => return Err(fail("are there twice".into())),
            None => return Err(fail("are of no joint of the skin".into())),
        };
        let accessor = |k: usize| -> Result<Accessor, HandModelError> {
            file.accessors().nth(k).ok_or_else(|| fail(format!("refer to accessor {k} of {}", file.accessors().len())))
        };
        let vertices = accessor(vertices)?;
        let directions = accessor(directions)?;
        if directions.count() != FEATURES.saturating_mul(vertices.count()) {
            return Err(fail(format!("have {} directions for {} vertices", directions.count(), vertices.count())));
        }
        let vertices = buffers.integers::<1>(&vertices, "pose_correctives.vertices")?;
        let directions = buffers.floats::<3>(&directions, "pose_correctives.directions")?;
        let rows = all.chunks_exact_mut(count).skip(FEATURES * (joint - 1));
        for (row, directions) in rows.zip(directions.chunks_exact(vertices.len())) {
            for (&[vertex], direction) in vertices.iter().zip(directions) {
                let Some(&welded) = model.source_vertices.get(vertex as usize) else {
                    return Err(fail(format!("refer to vertex {vertex} of {}", model.source_vertices.len())));
                };
                row[welded as usize] += dvec3(*direction) / copies[welded as usize];
            }
        }
    }
    Ok(all)
}
