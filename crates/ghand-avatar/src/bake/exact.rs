//! What the avatar that is baked computes in a pose, with plain skinning taken off.

use crate::deform::baked::VALUES;
use ghand_core::Pose;
use ghand_core::skeleton::{Affine, Chain};
use ghand_render::{Gpu, RenderError, buffers};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::order::Ordered;
use crate::avatar::Avatar;
use crate::posed_hand::PosedHand;

/// Where skinning flattens the hand, the place before it is not determined. Added to the square of the blended map, this
/// keeps it from running away, and changes other places by less than a thousandth of their offset.
const DAMPING: f64 = 4e-4;

/// The avatar on the device.
pub struct ExactPoses {
    hand: PosedHand,
}

impl ExactPoses {
    pub fn new(gpu: &Gpu, avatar: &Avatar) -> Result<ExactPoses, RenderError> {
        Ok(ExactPoses { hand: PosedHand::new(gpu, avatar)? })
    }

    /// The values of each Gaussian in the new order: place before plain skinning, standard deviation, colour.
    pub fn compute(
        &mut self,
        gpu: &Gpu,
        pose: &Pose,
        chain: &Chain,
        ordered: &Ordered,
    ) -> Result<Vec<[f32; VALUES]>, RenderError> {
        self.hand.set_pose(gpu, pose)?;
        let table = self.hand.table(gpu)?;
        let n = ordered.order.len();
        let properties = self.hand.properties();
        let color: Vec<f32> = buffers::read(gpu, &properties.color, 3 * n)?;
        let one = |i: usize| {
            let p = ordered.order[i];
            let mean = DVec3::from([0, 1, 2].map(|c| f64::from(table[c * n + p])));
            let weights = ordered.weights[i].iter();
            let map = weights
                .fold(Affine::ZERO, |sum, (k, w)| sum.add_scaled(Ordered::weight(*w), &chain.posed_from_rest[*k]));
            let rest = unposed(&map, mean - pose.translation);
            let [x, y, z] = rest.as_vec3().to_array();
            [x, y, z, table[3 * n + p], color[p], color[n + p], color[2 * n + p]]
        };
        Ok((0..n).into_par_iter().map(one).collect())
    }
}

/// The point that a map takes to a place.
fn unposed(map: &Affine, posed: DVec3) -> DVec3 {
    let m = map.linear;
    let transposed = m.transpose();
    let square = transposed * m + DMat3::from_diagonal(DVec3::splat(DAMPING));
    // Relative to the point that the map's transpose would give, so that damping pulls towards it.
    let guess = transposed * (posed - map.translation);
    guess + square.inverse() * (transposed * (posed - map.apply(guess)))
}
