//! No motion of the built-in hand pushes one part of it into another.

use ghand_core::Side;
use ghand_core::posing::pose_hand;
use ghand_hand_model::builtin::builtin_hand;
use ghand_test_support::cases;
use ghand_test_support::self_penetration::deepest_penetration;

use super::*;

/// How many frames of a motion are checked.
fn frames_to_check() -> usize {
    cases(4, 20)
}

/// Metres. The deepest of the frames that are checked is 1.81 mm.
const DEEPEST: f64 = 0.002;

#[test]
fn no_motion_is_inside_itself() {
    // The left hand's are mirrored.
    for side in [Side::Right, Side::Left].into_iter().take(cases(1, 2)) {
        let model = builtin_hand(side).unwrap();
        for name in MOTION_NAMES {
            let frames = motion(name, &model, 30.0).unwrap().unwrap().frames;
            let depth = |frame: &PoseFrame| {
                let posed = pose_hand(&model, &[], &frame.pose).unwrap().vertices;
                deepest_penetration(&model.faces, &model.vertices, &posed)
            };
            let sampled = frames.iter().step_by(frames.len().div_ceil(frames_to_check()));
            let depths = sampled.map(|frame| (depth(frame), &frame.id));
            let (depth, id) = depths.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            println!("{}, {name}: {:.2} mm in frame {id}", model.name, depth * 1e3);
            assert!(depth < DEEPEST, "{}, {name}: {depth} m in frame {id}", model.name);
        }
    }
}
