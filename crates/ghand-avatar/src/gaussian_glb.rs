//! An avatar's Gaussians in a glTF file: as `KHR_gaussian_splatting` draws them at rest, with skinning weights, and as
//! `GHAND_gaussian_avatar`, which has the avatar's own file in a view of the buffer: ghand plays it exactly.
//! `extensions/GHAND_gaussian_avatar/README.md` describes the extension.
//!
//! The Gaussians are in a scene of their own, the second: programs that do not know them show the first, and those that know
//! only `KHR_gaussian_splatting` do not draw a still hand over one that moves.

mod read;

use ghand_core::Pose;
use ghand_hand_model::HandModelError;
use ghand_hand_model::files::glb_document::GlbDocument;
use ghand_render::splat::SplatModel;
use glam::{DVec3, Vec4};
use serde_json::{Value, json};

use crate::avatar::Avatar;
use crate::file::AvatarFileError;
use crate::four_bones::FourBones;
use crate::posed_hand::PosedHand;
use crate::reference::TwinError;
pub(crate) use read::avatar_in;
pub use read::holds_avatar;

/// Gaussians as glTF has them.
const SPLATTING: &str = "KHR_gaussian_splatting";
/// The avatar as ghand has it.
pub const EXTENSION: &str = "GHAND_gaussian_avatar";
/// Version of [`EXTENSION`].
const VERSION: u32 = 1;

/// Why an avatar's Gaussians are not in a file.
#[derive(Debug, thiserror::Error)]
pub enum GaussianGlbError {
    /// They cannot be posed at rest.
    #[error(transparent)]
    Pose(#[from] TwinError),
    /// They do not fit into the file.
    #[error(transparent)]
    File(#[from] HandModelError),
    /// The avatar has no file.
    #[error(transparent)]
    Avatar(#[from] AvatarFileError),
}

/// Adds an avatar to a file that has its skeleton as skin 0.
///
/// # Errors
/// [`GaussianGlbError`] if the avatar cannot be posed or does not fit into a file.
pub fn add_gaussians(document: &mut GlbDocument<'_>, avatar: &Avatar) -> Result<(), GaussianGlbError> {
    let scene = PosedHand::splats_on_host(avatar, &Pose::rest(avatar.model.joint_count()))?;
    let model = scene.model();
    let count = scene.count;
    let means: Vec<DVec3> = scene.means().collect();
    let at = |row: usize, i: usize| scene.table[model.index(row, i, count)];
    let per_gaussian = |rows: &[usize], value: &dyn Fn(f32) -> f32| -> Vec<f32> {
        (0..count).flat_map(|i| rows.iter().map(move |row| value(at(*row, i)))).collect()
    };
    let [first_scale, first_rotation] = [SplatModel::SCALE_ROW, model.rotation_row()];
    let scales = per_gaussian(&[first_scale, first_scale + 1, first_scale + 2], &f32::exp);
    // x, y, z, w.
    let rotations: Vec<f32> = (0..count)
        .flat_map(|i| Vec4::from([1, 2, 3, 0].map(|k| at(first_rotation + k, i))).normalize_or(Vec4::W).to_array())
        .collect();
    let opacities = per_gaussian(&[model.opacity_row()], &|logit| 1.0 / (1.0 + (-logit).exp()));
    let color = model.color_row();
    let colors = per_gaussian(&[color, color + 1, color + 2], &|v| v);
    let FourBones { joints, weights } = FourBones::of(avatar);
    let [joints, weights] = document.joints_and_weights(&joints, &weights);
    let attributes = json!({
        "POSITION": document.displacements(&means, "Gaussians")?,
        "KHR_gaussian_splatting:ROTATION": document.vertex_floats(rotations.into_iter(), "VEC4"),
        "KHR_gaussian_splatting:SCALE": document.vertex_floats(scales.into_iter(), "VEC3"),
        "KHR_gaussian_splatting:OPACITY": document.vertex_floats(opacities.into_iter(), "SCALAR"),
        "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0": document.vertex_floats(colors.into_iter(), "VEC3"),
        "JOINTS_0": joints,
        "WEIGHTS_0": weights,
    });
    document.use_extension(SPLATTING);
    let splatting = json!({
        "kernel": "ellipse", "colorSpace": "srgb_rec709_display", "projection": "perspective",
        "sortingMethod": "cameraDistance"
    });
    // Points, number 0 of glTF's modes.
    let primitive = json!({"mode": 0, "attributes": attributes, "extensions": {SPLATTING: splatting}});
    let mesh = document.push("meshes", json!({"name": "gaussians", "primitives": [primitive]}));
    let node = document.push("nodes", json!({"name": "gaussians", "mesh": mesh}));
    document.push("scenes", json!({"name": "gaussians", "nodes": [node]}));
    let view = document.bytes(&avatar.to_bytes("the avatar".as_ref())?);
    let extension: Value = json!({"version": VERSION, "avatar": view, "skin": 0, "mesh": mesh});
    document.extend_root(EXTENSION, extension);
    Ok(())
}

#[cfg(test)]
mod tests;
