//! The skeleton that files with MANO's joints mean if they do not give their own: that of an adult's flat hand.

use ghand_core::Side;
use ghand_hand_model::files::mano::{JOINT_NAMES, PARENTS};
use glam::DVec3;

use crate::PoseError;
use crate::rest_skeleton::RestSkeleton;

/// Rest positions of MANO's joints in a right hand, metres: fingers along -Y, thumb side towards -Z, back towards +X.
#[rustfmt::skip]
const JOINTS: [DVec3; 16] = [
    DVec3::new(5.998687332454955e-18, -1.470660954670279e-19, -2.812149384884277e-19),
    DVec3::new(-0.0004999999999999969, -0.08969999999999999, -0.02501),
    DVec3::new(-0.0004999999999999984, -0.12825522353042795, -0.031808326155660316),
    DVec3::new(-0.0015, -0.15310192313892598, -0.03618946967819696),
    DVec3::new(0.001999999999999997, -0.092, -0.004270000000000001),
    DVec3::new(0.0020000000000000018, -0.1360731354715421, -0.005809067804580296),
    DVec3::new(0.001, -0.1644758227754248, -0.006800911500865374),
    DVec3::new(-0.003500000000000002, -0.07681999999999997, 0.03598999999999997),
    DVec3::new(-0.0035, -0.10769572567353881, 0.04484347186884202),
    DVec3::new(-0.0045, -0.12734391473851794, 0.05047749942174147),
    DVec3::new(0.0004999999999999981, -0.08694000000000002, 0.015860000000000003),
    DVec3::new(0.0005000000000000004, -0.12762676748995624, 0.020495671603795777),
    DVec3::new(-0.0005000000000000021, -0.15384712876126147, 0.023483104415130848),
    DVec3::new(-0.009999999999999995, -0.02399999999999999, -0.019999999999999983),
    DVec3::new(-0.026221589200053706, -0.05554197900010441, -0.04793718140009249),
    DVec3::new(-0.034024231640296575, -0.08090056693089376, -0.0667935672973461),
];
/// Its fingertips, thumb to little finger.
#[rustfmt::skip]
const TIPS: [DVec3; 5] = [
    DVec3::new(-0.038204578003977405, -0.10113776261259996, -0.08378552777933786),
    DVec3::new(-0.0041130642024263175, -0.17494827099983695, -0.041470055704717165),
    DVec3::new(-0.0014754126445466493, -0.186352572005345, -0.014155467504426766),
    DVec3::new(-0.0027100500222453196, -0.1773615623731893, 0.02474625987195214),
    DVec3::new(-0.00911272907025618, -0.14483976485558522, 0.058461882187953666),
];

/// The skeleton of that hand; the left one is its mirror image in x.
///
/// # Errors
/// None: MANO's names are known.
pub(crate) fn average_hand(side: Side) -> Result<RestSkeleton, PoseError> {
    let mirror = if side == Side::Right { DVec3::ONE } else { DVec3::new(-1.0, 1.0, 1.0) };
    let names = JOINT_NAMES.map(String::from);
    let joints = JOINTS.map(|joint| joint * mirror);
    RestSkeleton::from_rest_pose("average hand", side, &names, &PARENTS, &joints, TIPS.map(|tip| tip * mirror))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_hands::procedural;

    #[test]
    fn it_is_the_skeleton_of_the_procedural_hand() {
        for side in [Side::Right, Side::Left] {
            let hand = RestSkeleton::of(procedural(side)).unwrap();
            assert_eq!(average_hand(side).unwrap(), RestSkeleton { name: "average hand".into(), ..hand });
        }
    }
}
