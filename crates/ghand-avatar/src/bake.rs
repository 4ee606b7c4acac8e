//! Bakes an avatar for playing: what its property model computes over a set of poses is fitted by least squares as means
//! and few local components, see [`crate::deform::baked`].
//!
//! 1. [`order`] puts the Gaussians into groups that the same few joints move.
//! 2. [`exact`] has the avatar compute each pose, and takes plain skinning off: what remains of a Gaussian is where it lies
//!    before skinning, its size and its colour. Residual weights and the residual skeleton become part of that.
//! 3. [`sums`] adds up the normal equations of each group. Its regressors are the rotations of the joints that move it and of
//!    their parents, and products of the bends of a joint and its parent.
//! 4. [`components`] finds for each joint the few combinations of its regressors that change the hand most.
//! 5. [`pack`] fits each group again with the components that it keeps, and stores them.

mod components;
mod exact;
mod order;
mod pack;
mod sums;

use crate::deform::baked::{BakedTables, Precision, VALUES};
use ghand_core::Pose;
use ghand_core::skeleton::pose_skeleton;
use ghand_render::{Gpu, RenderError};

use crate::avatar::Avatar;
use crate::light::AvatarLight;
use crate::properties::PropertyTables;
use crate::properties::baked::template::template_parts;
use crate::template::{AvatarConfig, Template};
use components::JointComponents;
use exact::ExactPoses;
use order::Ordered;
use pack::Block;
use sums::{GroupSums, Regressors};

/// Fewest poses that say how a hand depends on its pose.
pub const FEWEST_POSES: usize = 30;
/// Largest number of components of a joint.
pub const MOST_COMPONENTS: usize = 10;
/// Errors of this size count as much as one of a whole display value: offset and standard deviation (metres), colour.
pub(crate) const EQUAL_ERRORS: [f64; VALUES] = [0.03, 0.03, 0.03, 0.05, 1.0, 1.0, 1.0];

/// Why an avatar cannot be baked.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// It is baked already.
    #[error("the avatar is baked already; bake the avatar that it was baked from")]
    Baked,
    /// The poses do not say enough.
    #[error("{given} poses are too few to see how the avatar depends on its pose; give at least {FEWEST_POSES}")]
    TooFewPoses {
        /// Their number.
        given: usize,
    },
    /// The device failed.
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// What a set of poses says about an avatar, from which baked avatars of any size are made.
pub struct Bake {
    source: Avatar,
    ordered: Ordered,
    regressors: Regressors,
    components: JointComponents,
    groups: Vec<GroupSums>,
    /// The blocks, those that change the hand most first.
    blocks: Vec<Block>,
}

impl Bake {
    /// Has the avatar compute these poses, and finds up to `rank` components of each joint.
    ///
    /// # Errors
    /// [`BakeError`] if the avatar is baked, the poses are too few, or the device fails.
    pub fn new(
        gpu: &Gpu,
        avatar: &Avatar,
        poses: &[Pose],
        rank: usize,
        mut progress: impl FnMut(usize),
    ) -> Result<Bake, BakeError> {
        if matches!(avatar.tables, PropertyTables::Baked(_)) {
            return Err(BakeError::Baked);
        }
        if poses.len() < FEWEST_POSES {
            return Err(BakeError::TooFewPoses { given: poses.len() });
        }
        let ordered = Ordered::new(&avatar.template);
        let template = &avatar.template;
        let chains: Vec<_> =
            poses.iter().map(|pose| pose_skeleton(&template.parents, &template.joints, &pose.rotations)).collect();
        let regressors = Regressors::new(&template.parents, &chains);
        let mut groups: Vec<GroupSums> =
            ordered.groups.iter().map(|group| GroupSums::new(group, &template.parents)).collect();
        let mut exact = ExactPoses::new(gpu, avatar)?;
        for (k, (pose, chain)) in poses.iter().zip(&chains).enumerate() {
            let values = exact.compute(gpu, pose, chain, &ordered)?;
            sums::add(&mut groups, &regressors.of(chain), &values);
            progress(k + 1);
        }
        let components = JointComponents::find(&regressors, &groups, rank.min(MOST_COMPONENTS), &chains);
        let groups: Vec<GroupSums> = groups.into_iter().map(|group| components.reduce(&group)).collect();
        let blocks = pack::blocks(&groups);
        Ok(Bake { source: avatar.clone(), ordered, regressors, components, groups, blocks })
    }

    /// Number of blocks: a component's values for a group.
    pub fn blocks(&self) -> usize {
        self.blocks.len()
    }

    /// The baked avatar that keeps the `keep` blocks that change the hand most.
    pub fn avatar(&self, keep: usize, precision: Precision) -> Avatar {
        let tables = self.tables(keep, precision);
        let source = &self.source;
        let parts = template_parts(&tables);
        let template = Template {
            rest: parts.rest,
            weights: parts.weights,
            spacings: parts.spacings,
            normals: parts.normals,
            ..source.template.clone()
        };
        let reorder = |light: &AvatarLight| AvatarLight {
            faces: self.ordered.order.iter().map(|p| light.faces[*p]).collect(),
            barycentric: self.ordered.order.iter().map(|p| light.barycentric[*p]).collect(),
            ..light.clone()
        };
        let config = AvatarConfig {
            shape_bases: 0,
            color_components: 0,
            network: None,
            plain_skinning: false,
            ..source.config.clone()
        };
        Avatar {
            template,
            config,
            tables: PropertyTables::Baked(tables),
            light: source.light.as_ref().map(reorder),
            seen: source.seen.as_ref().map(|seen| self.ordered.order.iter().map(|p| seen[*p]).collect()),
            ..source.clone()
        }
    }

    fn tables(&self, keep: usize, precision: Precision) -> BakedTables {
        let kept = &self.blocks[..keep.min(self.blocks.len())];
        let parts = pack::PackInputs {
            template: &self.source.template,
            ordered: &self.ordered,
            regressors: &self.regressors,
            components: &self.components,
            groups: &self.groups,
        };
        pack::pack(&parts, kept, precision)
    }

    /// The number, in the avatar that was baked, of each Gaussian of the baked one.
    pub fn order(&self) -> &[usize] {
        &self.ordered.order
    }
}
