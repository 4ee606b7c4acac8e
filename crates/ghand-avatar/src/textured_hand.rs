//! An avatar as a textured mesh, for programs that draw no Gaussians: the hand model's mesh, moved to where the Gaussians
//! begin, and what they show of each place of the UV atlas.
//!
//! 1. [`outline`] moves each vertex along its normal to where a line that touches the hand there is half covered: the mesh
//!    has the outline of the avatar.
//! 2. [`atlas`] looks at each texel's place from straight above, and blends the Gaussians that it sees as the splatter
//!    does.
//!
//! Both look along lines through a [`line_of_sight::Cloud`] of the Gaussians at rest. Colours are the mean over poses, without
//! what depends on the view; without light, if the avatar's is apart from its skin.

mod atlas;
mod correctives;
mod line_of_sight;
mod outline;

use ghand_core::mesh::Texture;
use ghand_core::{HandModel, Pose};
use ghand_hand_model::HandModelError;
use ghand_hand_model::files::rigged_glb::{Gloss, Skin};
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use glam::DVec3;

use crate::avatar::Avatar;
use crate::properties::PropertyTables;
use crate::reference::{PosedGaussians, TwinError, pose_unlit};
pub use correctives::Correctives;
use line_of_sight::Cloud;

/// Largest edge of a texture, texels.
pub const LARGEST_TEXTURE: u32 = 4096;

/// A hand as a textured mesh at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct TexturedHand {
    /// The hand with the avatar's shape.
    pub model: HandModel,
    /// Its colours, display values.
    pub texture: Texture,
    /// Whether light is part of the colours.
    pub is_lit: bool,
    /// What the skin mirrors, if that is known.
    pub gloss: Option<Gloss>,
}

impl TexturedHand {
    /// The hand of an avatar, with a texture of `size` x `size` texels.
    ///
    /// # Errors
    /// [`TwinError`] if the hand model has no usable UV atlas, or the size is 0 or above [`LARGEST_TEXTURE`].
    pub fn new(avatar: &Avatar, size: u32) -> Result<TexturedHand, TwinError> {
        if !(1..=LARGEST_TEXTURE).contains(&size) {
            let problem = format!("has {size} texels along an edge; choose 1 to {LARGEST_TEXTURE}");
            return Err(HandModelError::invalid(avatar.model.name.clone(), "texture", problem).into());
        }
        let rest = Pose::rest(avatar.model.joint_count());
        let mut gaussians = pose_unlit(avatar, &rest)?;
        gaussians.colors = mean_colors(avatar, &gaussians)?;
        let cloud = Cloud::new(&avatar.model, &gaussians);
        let mut model = avatar.model.clone();
        model.vertices = outline::fitted(&avatar.model, &cloud);
        let texture = atlas::bake(&model, &cloud, size)?;
        let gloss = avatar.light.as_ref().and_then(|lit| lit.gloss.as_ref()).map(|gloss| {
            let strengths = gloss.vertex_strengths(&avatar.model);
            let sum: f64 = strengths.as_flattened().iter().map(|strength| f64::from(*strength)).sum();
            let strength = (sum / (3 * strengths.len()).max(1) as f64).clamp(0.0, 1.0);
            Gloss { roughness: gloss.roughness, strength }
        });
        Ok(TexturedHand { model, texture, is_lit: avatar.light.is_none(), gloss })
    }

    /// The skin as a file has it, with the texture as a PNG file.
    pub fn skin(&self, png: Vec<u8>) -> Skin {
        Skin { png, is_lit: self.is_lit, gloss: self.gloss }
    }
}

/// The mean of each Gaussian's colour over the named poses. Networks, which are slow without a device, are asked only for
/// the pose of rest.
fn mean_colors(avatar: &Avatar, rest: &PosedGaussians) -> Result<Vec<DVec3>, TwinError> {
    let mut sum = rest.colors.clone();
    let mut count = 1.0;
    if !matches!(avatar.tables, PropertyTables::Network(_)) {
        for pose in POSE_NAMES.iter().skip(1).filter_map(|name| named_pose(name, &avatar.model)) {
            sum.iter_mut().zip(pose_unlit(avatar, &pose)?.colors).for_each(|(sum, color)| *sum += color);
            count += 1.0;
        }
    }
    Ok(sum.into_iter().map(|color| color / count).collect())
}

#[cfg(test)]
mod tests;
