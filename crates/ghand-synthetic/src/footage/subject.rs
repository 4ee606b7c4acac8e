//! What is filmed: the true hand, its forearm and its sleeve, at any time.

use ghand_core::{HandModel, Pose, Side};
use ghand_hand_model::HandModelError;
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::joints::names::{Finger, JointRole};
use glam::{DVec2, DVec3};

use super::FootageOptions;
use super::motion::Motion;
use super::room::DESK;
use super::sleeve::{Sleeve, TEXTURE_ROWS};
use crate::hand::forearm::with_forearm;
use crate::hand::random_shape::random_hand;
use crate::hand::true_hand::{Detail, PosedTrueHand, TrueHand};

/// The bones' lengths differ between people as published.
const BONE_SPREAD: f64 = 1.0;

/// The arm that is filmed.
pub(crate) struct Subject {
    hand: TrueHand,
    /// The person's hand that it shows, without forearm, of its side.
    pub model: HandModel,
    sleeve: Sleeve,
    /// The sleeve's part of the texture, below the skin's.
    cloth: Vec<[u8; 3]>,
    motion: Motion,
    side: Side,
    /// Joints of the model that are MediaPipe's landmarks.
    landmark_joints: Vec<usize>,
    /// Of hand and sleeve together.
    pub uvs: Vec<DVec2>,
    pub triangles: Vec<[u32; 3]>,
    /// Whether a vertex is on the forearm or the sleeve.
    pub on_forearm: Vec<bool>,
}

impl Subject {
    /// The arm of a random person, and its motion.
    ///
    /// # Errors
    /// [`HandModelError`] if the built-in hand cannot be made.
    pub(crate) fn random(options: &FootageOptions) -> Result<Subject, HandModelError> {
        let side = options.side;
        let person = random_hand(&builtin_hand(Side::Right)?, options.identity, BONE_SPREAD)?;
        let hand = TrueHand::with_forearm(with_forearm(&person)?, side, options.identity, Detail::Film);
        let sleeve = Sleeve::on(&hand.model, options.identity);
        let motion = Motion::random(&hand.anatomy, options.seconds, options.is_moving, options.seed);

        let first = hand.mesh.uvs.len() as u32;
        let triangles = sleeve.triangles.iter().map(|triangle| triangle.map(|v| v + first));
        let triangles = hand.mesh.triangles.iter().copied().chain(triangles).collect();
        let size = hand.texture_size();
        let skin_part = f64::from(size) / f64::from(size + TEXTURE_ROWS);
        let below = |uv: &DVec2| DVec2::new(uv.x, skin_part + (1.0 - skin_part) * uv.y);
        let skin = hand.mesh.uvs.iter().map(|uv| DVec2::new(uv.x, uv.y * skin_part));
        let uvs = skin.chain(sleeve.uvs.iter().map(below)).collect();
        let on_sleeve = sleeve.vertices.iter().map(|_| true);
        let on_forearm = hand.on_forearm.iter().copied().chain(on_sleeve).collect();
        let landmark_joints = landmark_joints(&person);
        let model = if side == Side::Left { person.mirrored() } else { person };
        let cloth = sleeve.texture(size);
        Ok(Subject { hand, model, sleeve, cloth, motion, side, landmark_joints, uvs, triangles, on_forearm })
    }

    /// The hand's pose at a time, seconds, and the rotation of the forearm against a right hand.
    fn pose_and_wrist(&self, time: f64) -> (Pose, DVec3) {
        let (pose, wrist) = self.motion.at(&self.hand.anatomy, self.model.joint_count(), time);
        match self.side {
            Side::Right => (pose, wrist),
            Side::Left => (pose.mirrored(), wrist),
        }
    }

    /// The hand's pose at a time, seconds.
    pub(crate) fn pose(&self, time: f64) -> Pose {
        self.pose_and_wrist(time).0
    }

    /// MediaPipe's 21 landmarks in a pose of [`Subject::pose`]: joints, and tips of fingers; world, metres.
    pub(crate) fn landmarks(&self, pose: &Pose) -> Vec<DVec3> {
        let joints = self.hand.joints(pose);
        self.landmark_joints.iter().map(|&joint| joints[joint]).collect()
    }

    /// From the wrist along the bones to the tip of the middle finger, metres.
    pub(crate) fn length(&self) -> f64 {
        // The wrist, and the middle finger's landmarks.
        let chain = [0, 9, 10, 11, 12].map(|landmark| self.model.joints[self.landmark_joints[landmark]]);
        chain.windows(2).map(|bone| bone[0].distance(bone[1])).sum()
    }

    /// The arm at a time, seconds.
    pub(crate) fn posed(&self, time: f64) -> PosedTrueHand {
        let (pose, wrist) = self.pose_and_wrist(time);
        let PosedTrueHand { mut positions, mut normals, mut light_visibility, mut texture } =
            self.hand.pose(&pose, wrist);
        let sleeve = self.sleeve_at(&pose, wrist);
        let sign = if self.side == Side::Left { -1.0 } else { 1.0 };
        normals.extend(self.sleeve.normals(&sleeve, sign));
        positions.extend(sleeve);
        light_visibility.extend(&self.sleeve.light_visibility);
        texture.rgb.extend(&self.cloth);
        texture.height += TEXTURE_ROWS;
        PosedTrueHand { positions, normals, light_visibility, texture }
    }

    /// The positions of [`Subject::posed`] alone.
    pub(crate) fn positions(&self, time: f64) -> Vec<DVec3> {
        let (pose, wrist) = self.pose_and_wrist(time);
        let mut positions = self.hand.positions(&pose, wrist);
        positions.extend(self.sleeve_at(&pose, wrist));
        positions
    }

    fn sleeve_at(&self, pose: &Pose, wrist: DVec3) -> Vec<DVec3> {
        let mut moved = self.hand.moved_with_forearm(&self.sleeve.vertices, pose, wrist);
        // The elbow rests on the desk.
        moved.iter_mut().for_each(|point| point.y = point.y.min(DESK));
        moved
    }
}

/// The joints of a model in MediaPipe's order: the wrist, then four of each finger from the thumb on.
fn landmark_joints(model: &HandModel) -> Vec<usize> {
    let roles = JointRole::of_joints(&model.joint_names);
    let of_finger = |finger: Finger| {
        [JointRole::Bend(finger, 1), JointRole::Bend(finger, 2), JointRole::Bend(finger, 3), JointRole::Tip(finger)]
    };
    let wanted = std::iter::once(JointRole::Wrist).chain(Finger::ALL.into_iter().flat_map(of_finger));
    // The built-in hand has them all.
    wanted.map(|role| roles.iter().position(|known| *known == Some(role)).unwrap_or(0)).collect()
}
