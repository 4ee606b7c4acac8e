//! A hand with MANO's joints, generated from a few lengths, for tests.
//!
//! It is constructed like a glove. Two equal pieces of cloth are cut along one outline (`pattern`), sewn together at
//! it, and pulled over a solid hand (`flesh`), on which the cloth is then relaxed. The flat pieces are the UV atlas,
//! which is therefore one-to-one by construction, and the texels are about equally dense on the palm and on the sides
//! of the fingers.
//!
//! # Shape
//!
//! Ten shape directions ([`HandModel::shape_directions`]); a unit is about a standard deviation among adults, and the
//! wrist joint does not move:
//!
//! | | direction | a unit changes | of the default hand |
//! |---|---|---|---|
//! | 0 | `hand-size` | all lengths by 5 % | 9.5 mm from wrist to tip |
//! | 1 | `palm-length` | wrist to knuckles by 3.3 % of `palm_length`; fingers and thumb are carried along | 3.0 mm |
//! | 2 | `palm-width` | index to little knuckle by 4 % of `palm_width`; the wrist by less | 2.4 mm |
//! | 3 | `thickness` | palm to back by 6 %, fingers and forearm too | 1.6 mm at the knuckles |
//! | 4 | `finger-girth` | width and thickness of fingers and thumb beyond the webs by 5 % | 1.0 mm |
//! | 5 to 9 | `thumb-length`, `index-length`, `middle-length`, `ring-length`, `pinky-length` | joint at the base to tip by 3.6 % | 3.8, 3.1, 3.5, 3.3, 2.6 mm |
//!
//! The joints follow: [`HandModel::joint_regressor`] finds them in the shaped skin (`regressor`).
//!
//! # Pose
//!
//! [`HandModel::pose_directions`] keep the volume of bent joints, which linear blending alone would lose
//! ([`ghand_hand_model::pose_correctives`]).

mod flesh;
mod glove;
mod packing;
mod pattern;
mod regressor;
mod shapes;
mod skeleton;

use std::sync::{Mutex, PoisonError};

use ghand_core::posing::regress_joints;
use ghand_core::{HandModel, Side};
use glam::DVec3;

use ghand_hand_model::HandModelError;
use ghand_hand_model::files::mano::{JOINT_NAMES, PARENTS};
use ghand_hand_model::pose_correctives::{BendingChain, Skin, pose_directions};
use glove::Glove;

/// Lengths of a hand, metres. [`Default`] is an adult's right hand.
///
/// The rest pose is flat with the fingers slightly spread: wrist joint at the origin, fingers along -Y, thumb side
/// towards -Z, back of the hand towards +X (of a left hand: -X). Joints are MANO's 16, in MANO's order.
#[derive(Debug, Clone, PartialEq)]
pub struct ProceduralHand {
    /// Makes the left hand: the mirror image in x.
    pub left: bool,
    /// From the wrist joint to the knuckle of the middle finger.
    pub palm_length: f64,
    /// From the knuckle of the index finger to that of the little finger, centre to centre.
    pub palm_width: f64,
    /// Thickness of the palm at the knuckles.
    pub palm_thickness: f64,
    /// Width of the forearm at the wrist.
    pub wrist_width: f64,
    /// From knuckle to tip: index, middle, ring and little finger.
    pub finger_lengths: [f64; 4],
    /// Width at the base: index, middle, ring and little finger.
    pub finger_widths: [f64; 4],
    /// From the joint at the thumb's base (inside the palm) to its tip.
    pub thumb_length: f64,
    /// Width of the thumb's last joint.
    pub thumb_width: f64,
    /// Fineness of the mesh: an edge is about 7.4 mm / `detail` long, on a hand of the default size. From 1 to 6; 2
    /// gives about 4,800 vertices in half a second, 6 about 42,000 in some ten seconds. The blend shapes take 3.5 kB
    /// per vertex: 17 MB at 2, 145 MB at 6.
    pub detail: u32,
}

impl Default for ProceduralHand {
    fn default() -> Self {
        ProceduralHand {
            left: false,
            palm_length: 0.092,
            palm_width: 0.061,
            palm_thickness: 0.027,
            wrist_width: 0.056,
            finger_lengths: [0.087, 0.098, 0.091, 0.073],
            finger_widths: [0.0215, 0.0220, 0.0206, 0.0180],
            thumb_length: 0.105,
            thumb_width: 0.0225,
            detail: 2,
        }
    }
}

impl ProceduralHand {
    /// Builds the hand. The same parameters give the same bits.
    ///
    /// ```
    /// use ghand_core::Pose;
    /// use ghand_core::posing::pose_hand;
    /// use ghand_test_support::procedural_hand::ProceduralHand;
    /// use glam::DVec3;
    ///
    /// let hand = ProceduralHand::default().build()?;
    /// let mut pose = Pose::rest(hand.joint_count());
    /// pose.translation = DVec3::new(0.0, 0.0, 0.5);
    /// let posed = pose_hand(&hand, &[], &pose)?;
    /// assert!((posed.vertices[0] - hand.vertices[0] - pose.translation).length() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`HandModelError::Invalid`] if a length is not finite, not positive or far from a hand's proportions, if
    /// `detail` is not in 1..=6, or if the parts intersect, so that no valid surface exists.
    pub fn build(&self) -> Result<HandModel, HandModelError> {
        // Half a second each, and a program of tests asks for the same hands again and again.
        static BUILT: Mutex<Vec<(ProceduralHand, HandModel)>> = Mutex::new(Vec::new());
        let kept = || BUILT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, model)) = kept().iter().find(|(hand, _)| hand == self) {
            return Ok(model.clone());
        }
        let model = self.make()?;
        let mut kept = kept();
        if self.detail <= 2 && kept.len() < 8 {
            kept.push((self.clone(), model.clone()));
        }
        Ok(model)
    }

    fn make(&self) -> Result<HandModel, HandModelError> {
        self.check()?;
        let skeleton = skeleton::Skeleton::new(self);
        let glove = Glove::sew(&skeleton, self.scale(), self.detail).ok_or_else(|| {
            invalid("proportions", "the fingers intersect; make them thinner or the palm wider".into())
        })?;
        let weights = glove.skinning_weights(&skeleton, self.detail);
        let shapes = shapes::Shapes::new(self, &skeleton, &glove);
        let joint_regressor = regressor::joint_regressor(&skeleton, &glove.vertices, &shapes);
        let chains: Vec<_> = skeleton.chains.iter().enumerate().map(|(c, chain)| bending(chain, c == 4)).collect();
        let mut model = HandModel {
            name: "procedural hand".into(),
            side: Side::Right,
            joint_names: JOINT_NAMES.map(String::from).to_vec(),
            parents: PARENTS.to_vec(),
            joints: regress_joints(&joint_regressor, &glove.vertices),
            pose_directions: pose_directions(
                &glove.vertices,
                &weights,
                &chains,
                &glove.shares(&skeleton, 0.0025),
                Skin::Fleshy,
            ),
            weights,
            uvs: glove.uvs,
            face_uvs: glove.face_uvs,
            faces: glove.faces,
            vertices: glove.vertices,
            shape_directions: shapes.skin,
            shape_names: shapes::SHAPE_NAMES.map(String::from).to_vec(),
            joint_regressor,
            joint_directions: vec![],
            pose_space: None,
            source_vertices: vec![],
        };
        if self.left {
            model = model.mirrored();
        }
        model.validate()?;
        Ok(model)
    }

    /// Size relative to the default hand, for lengths that are not parameters.
    fn scale(&self) -> f64 {
        self.palm_width / ProceduralHand::default().palm_width
    }

    fn check(&self) -> Result<(), HandModelError> {
        let single = [
            ("palm_length", self.palm_length),
            ("palm_width", self.palm_width),
            ("palm_thickness", self.palm_thickness),
            ("wrist_width", self.wrist_width),
            ("thumb_length", self.thumb_length),
            ("thumb_width", self.thumb_width),
        ];
        let lengths = self.finger_lengths.map(|v| ("finger_lengths", v));
        let widths = self.finger_widths.map(|v| ("finger_widths", v));
        for (field, value) in single.into_iter().chain(lengths).chain(widths) {
            // Probably a length in centimetres or millimetres.
            if !(value.is_finite() && value > 0.0 && value < 1.0) {
                return Err(invalid(field, format!("is {value}; it must be a length in metres between 0 and 1")));
            }
        }
        // Outside these ratios the fixed proportions (joints, pads, webs) stop fitting the given lengths.
        let ratios = [
            ("palm_length", self.palm_length / self.palm_width, 1.0, 2.5),
            ("palm_thickness", self.palm_thickness / self.palm_width, 0.2, 0.8),
            ("wrist_width", self.wrist_width / self.palm_width, 0.6, 1.3),
            ("thumb_length", self.thumb_length / self.palm_width, 1.2, 2.6),
            ("thumb_width", self.thumb_width / self.palm_width, 0.15, 0.55),
        ];
        let fingers = self.finger_lengths.map(|v| ("finger_lengths", v / self.palm_width, 0.7, 2.6));
        let widths = self.finger_widths.map(|v| ("finger_widths", v / self.palm_width, 0.12, 0.42));
        for (field, ratio, low, high) in ratios.into_iter().chain(fingers).chain(widths) {
            if !(ratio >= low && ratio <= high) {
                return Err(invalid(field, format!("is {ratio:.2} of palm_width; a hand has {low} to {high}")));
            }
        }
        if !(1..=6).contains(&self.detail) {
            return Err(invalid("detail", format!("is {}; it must be 1 to 6", self.detail)));
        }
        Ok(())
    }
}

/// A finger as the pose correctives need it.
fn bending(chain: &skeleton::Chain, is_thumb: bool) -> BendingChain {
    let at = |k: usize| chain.first_point + k;
    BendingChain {
        joints: std::array::from_fn(|k| chain.first_joint + k),
        beyond: vec![],
        points: std::array::from_fn(|k| chain.points[at(k) - 1]),
        radii: std::array::from_fn(|k| chain.radii[at(k)]),
        // Fingers close towards the palm (-X), the thumb's outer joints mostly across it.
        closing: if is_thumb { DVec3::new(-0.45, 0.0, 1.0) } else { DVec3::NEG_X },
        is_thumb,
    }
}

fn invalid(field: &str, problem: String) -> HandModelError {
    HandModelError::invalid("procedural hand", field, problem)
}

#[cfg(test)]
mod blend_shape_tests;
#[cfg(test)]
mod tests;
