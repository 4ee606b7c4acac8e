//! Morph targets: the shape directions of a hand.

use std::collections::HashSet;

use ::gltf::accessor::DataType;
use ::gltf::json::extras::RawValue;
use ::gltf::mesh::Primitive;
use glam::DVec3;
use serde::Deserialize;

use super::Source;
use super::buffers::Buffers;
use super::raw_mesh::RawTarget;
use crate::HandModelError;

/// Most morph targets of a mesh: many times those of any hand, fewer than those of a face.
const MAX_TARGETS: usize = 256;
/// Most displacements (targets x vertices), a fifth of a gigabyte: 256 targets of 32,000 vertices.
const MAX_DISPLACEMENTS: usize = 1 << 23;

/// The displacements of a primitive's `count` vertices by each of its morph targets, metres. `before` is the number
/// of vertices that other primitives have.
pub(super) fn displacements(
    primitive: &Primitive,
    count: usize,
    before: usize,
    buffers: &Buffers,
    source: &Source,
) -> Result<Vec<Vec<[f32; 3]>>, HandModelError> {
    let targets = primitive.morph_targets().len();
    if targets > MAX_TARGETS {
        let problem = format!("{targets} morph targets, at most {MAX_TARGETS} are read; export only those of shapes");
        return Err(source.invalid("targets", problem));
    }
    if targets.saturating_mul(before + count) > MAX_DISPLACEMENTS {
        let problem = format!(
            "{targets} morph targets of {} vertices, too many; export fewer of them or decimate the mesh",
            before + count
        );
        return Err(source.invalid("targets", problem));
    }
    let target = |(k, target): (usize, ::gltf::mesh::MorphTarget)| {
        let field = format!("targets[{k}].POSITION");
        let Some(accessor) = target.positions() else { return Ok(vec![[0.0; 3]; count]) };
        if accessor.data_type() != DataType::F32 {
            let problem = format!(
                "has components of type {:?}, but glTF allows only floats in a morph target; export without \
                 quantization",
                accessor.data_type()
            );
            return Err(source.invalid(&field, problem));
        }
        if accessor.count() != count {
            let problem = format!("has {} entries for {count} positions; export the hand again", accessor.count());
            return Err(source.invalid(&field, problem));
        }
        buffers.floats::<3>(&accessor, &field)
    };
    primitive.morph_targets().enumerate().map(target).collect()
}

/// Requires the primitives of a mesh to have equally many targets, as glTF does.
pub(super) fn require_equal_counts(primitives: &[Primitive], source: &Source) -> Result<(), HandModelError> {
    let first = primitives.first().map_or(0, |primitive| primitive.morph_targets().len());
    match primitives.iter().find(|primitive| primitive.morph_targets().len() != first) {
        Some(odd) => {
            let problem = format!(
                "primitive {} has {} morph targets, the first has {first}; export the hand again",
                odd.index(),
                odd.morph_targets().len()
            );
            Err(source.invalid("targets", problem))
        }
        None => Ok(()),
    }
}

/// Removes targets that move no vertex of what is left of a mesh.
pub(super) fn drop_idle(targets: &mut Vec<RawTarget>, warnings: &mut Vec<String>) {
    let before = targets.len();
    targets.retain(|target| target.displacements.iter().any(|d| *d != DVec3::ZERO));
    if targets.len() < before {
        warnings.push(format!(
            "{} of {before} morph targets do not move this hand; they are not read",
            before - targets.len()
        ));
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct MeshExtras {
    target_names: Vec<serde_json::Value>,
}

/// The names of a mesh's `count` targets, as far as its extras have them.
pub(super) fn names_in_file(extras: Option<&RawValue>, count: usize) -> Vec<Option<String>> {
    let found: Option<MeshExtras> = extras.and_then(|extras| serde_json::from_str(extras.get()).ok());
    let found = found.map(|extras| extras.target_names).unwrap_or_default();
    (0..count).map(|k| found.get(k)?.as_str().map(String::from)).collect()
}

/// A different name for each target: `shape-3` for one without, `wide-2` for the second `wide`.
pub(super) fn unique_names(names: Vec<Option<String>>) -> Vec<String> {
    let mut taken = HashSet::new();
    let unique = |(k, name): (usize, Option<String>)| {
        let wanted = name.filter(|name| !name.trim().is_empty()).unwrap_or_else(|| format!("shape-{k}"));
        let mut name = wanted.clone();
        let mut copies = 1;
        while !taken.insert(name.clone()) {
            copies += 1;
            name = format!("{wanted}-{copies}");
        }
        name
    };
    names.into_iter().enumerate().map(unique).collect()
}
