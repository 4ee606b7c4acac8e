//! The hand that is part of the program.

use ghand_core::Side;
use ghand_hand_model::builtin::{HAND_NAMES, builtin_hand, hand_by_name};
use ghand_hand_model::inspection::inspect;
use ghand_hand_model::joints::names::{Finger, finger_joints};
use glam::DVec3;

#[test]
fn both_sides_are_human_hands_with_shapes_and_correctives_and_mirror_images() {
    let [right, left] = [Side::Right, Side::Left].map(|side| builtin_hand(side).unwrap());
    for hand in [&right, &left] {
        assert_eq!((hand.vertices.len(), hand.joint_count(), hand.shape_count()), (1750, 25, 10));
        assert_eq!(hand.shape_names[0], "finger-length");
        assert_eq!(hand.joint_directions.len(), 250);
        assert_eq!(hand.pose_directions.len(), 24 * 9 * 1750);
        assert!(Finger::ALL.iter().all(|finger| finger_joints(*finger, hand).is_some()));
        // The tips' joints are at the skin; everything else is inside.
        let found = inspect(hand);
        assert_eq!(found.boundary_edges, 0);
        assert_eq!(found.texels.iter().find(|(resolution, _)| *resolution == 512).unwrap().1, 110_747);
    }
    assert_eq!((right.side, left.side), (Side::Right, Side::Left));
    let mirror = |p: &DVec3| DVec3::new(-p.x, p.y, p.z);
    let apart = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| mirror(a).distance(*b)).fold(0.0, f64::max);
    assert!(apart(&right.vertices, &left.vertices) < 1e-9);
    assert!(apart(&right.joints, &left.joints) < 1e-9);
    assert!(apart(&right.shape_directions, &left.shape_directions) < 1e-9);
    // A mirrored rotation has the same entries but for the signs of those that mix X with another axis.
    let count = right.vertices.len();
    for (k, (r, l)) in
        right.pose_directions.chunks_exact(count).zip(left.pose_directions.chunks_exact(count)).enumerate()
    {
        let [row, column] = [k % 9 / 3, k % 9 % 3];
        let sign = if (row == 0) != (column == 0) { -1.0 } else { 1.0 };
        let mirrored: Vec<DVec3> = r.iter().map(|d| *d * sign).collect();
        assert!(apart(&mirrored, l) < 1e-6, "direction {k}: {}", apart(&mirrored, l));
    }
}

#[test]
fn hands_are_found_by_name() {
    for name in HAND_NAMES {
        hand_by_name(name).unwrap().unwrap().validate().unwrap();
    }
    assert_eq!(hand_by_name("builtin-left").unwrap().unwrap().side, Side::Left);
    assert!(hand_by_name("right.glb").is_none());
}
