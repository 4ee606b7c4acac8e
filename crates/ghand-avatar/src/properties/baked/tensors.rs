//! The `baked` model's tensors in an avatar file.

use crate::deform::baked::{BakedTables, Precision};
use bytemuck::{cast_slice, cast_vec};
use safetensors::tensor::Dtype;
use serde::{Deserialize, Serialize};

use crate::file::{AvatarFileError, Reader, Tensors};

/// What the tensors do not say.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BakedMetadata {
    /// How numbers are stored.
    pub precision: Precision,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Largest standard deviation of a packed Gaussian, metres.
    pub max_scale: f32,
}

/// Most Gaussians of a baked avatar.
const MOST_GAUSSIANS: usize = 1 << 24;
/// Words of a component and of an entry in a file.
const COMPONENT_WORDS: usize = 14;
const ENTRY_WORDS: usize = 4;

pub(crate) fn metadata(tables: &BakedTables) -> BakedMetadata {
    BakedMetadata { precision: tables.precision, gaussians: tables.count, max_scale: tables.max_scale }
}

/// Adds the tables to the tensors of a file.
pub(crate) fn write(tables: &BakedTables, out: &mut Tensors) {
    let words = |values: &[u32], row: usize| [values.len() / row.max(1), row];
    let components: &[f32] = cast_slice(&tables.components);
    out.add("baked.components", Dtype::F32, &[tables.components.len(), COMPONENT_WORDS], components);
    out.add("baked.bends", Dtype::F32, &[tables.bends.len(), 9], tables.bends.as_flattened());
    out.add("baked.bounds", Dtype::F32, &[2, 3], tables.bounds.as_flattened());
    out.add("baked.groups", Dtype::U32, &[tables.groups.len(), 4], cast_slice::<_, u32>(&tables.groups));
    out.add("baked.group_joints", Dtype::U32, &[tables.group_joints.len()], &tables.group_joints);
    out.add("baked.entries", Dtype::U32, &[tables.entries.len(), ENTRY_WORDS], cast_slice::<_, u32>(&tables.entries));
    out.add("baked.means", Dtype::U32, &words(&tables.means, tables.count), &tables.means);
    out.add("baked.weights", Dtype::U32, &[tables.weights.len()], &tables.weights);
    out.add("baked.values", Dtype::U32, &[tables.values.len()], &tables.values);
}

/// Reads the tables from the tensors of a file and checks them.
pub(crate) fn read(
    reader: &Reader<'_>,
    metadata: BakedMetadata,
    joint_count: usize,
    normals: bool,
) -> Result<BakedTables, AvatarFileError> {
    let BakedMetadata { precision, gaussians: count, max_scale } = metadata;
    if count > MOST_GAUSSIANS {
        return Err(reader.invalid("baked", format!("has {count} Gaussians, more than {MOST_GAUSSIANS}")));
    }
    let components = reader.floats("baked.components", &[None, Some(COMPONENT_WORDS)])?;
    let bounds = reader.floats("baked.bounds", &[Some(2), Some(3)])?;
    let bends = reader.floats("baked.bends", &[Some(joint_count), Some(9)])?;
    let groups = reader.words("baked.groups", &[None, Some(4)])?;
    let entries = reader.words("baked.entries", &[None, Some(ENTRY_WORDS)])?;
    let tables = BakedTables {
        precision,
        count,
        joint_count,
        normals,
        bounds: std::array::from_fn(|i| std::array::from_fn(|c| bounds[3 * i + c])),
        max_scale,
        components: cast_slice(&components).to_vec(),
        bends: cast_vec(bends).as_chunks::<9>().0.to_vec(),
        groups: cast_slice(&groups).to_vec(),
        group_joints: reader.words("baked.group_joints", &[None])?,
        entries: cast_slice(&entries).to_vec(),
        means: reader.words("baked.means", &[Some(precision.mean_words()), Some(count)])?,
        weights: reader.words("baked.weights", &[None])?,
        values: reader.words("baked.values", &[None])?,
    };
    let invalid = |(part, problem): (&str, String)| {
        reader.invalid(&format!("baked.{part}"), format!("{problem}; bake the avatar again"))
    };
    tables.validate().map_err(invalid)?;
    Ok(tables)
}
