use std::sync::OnceLock;

use ghand_core::Pose;
use ghand_core::posing::{pose_hand, shape_hand};
use ghand_core::rotation::rotation_from_axis_angle;
use glam::{DMat3, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};

const FINGERS: [&str; 5] = ["thumb", "index", "middle", "ring", "pinky"];

fn hand() -> &'static HandModel {
    static HAND: OnceLock<HandModel> = OnceLock::new();
    HAND.get_or_init(|| ProceduralHand::default().build().unwrap())
}

/// The shape with one parameter set.
fn unit(direction: usize, value: f64) -> [f64; 10] {
    std::array::from_fn(|d| if d == direction { value } else { 0.0 })
}

fn joint(name: &str) -> usize {
    hand().joint_index(name).unwrap()
}

/// The outermost vertex of each finger.
fn tips() -> [usize; 5] {
    let model = hand();
    FINGERS.map(|finger| {
        let last = joint(&format!("{finger}3"));
        let out = (model.joints[last] - model.joints[last - 1]).normalize();
        let reach = |i: &usize| (model.vertices[*i] - model.joints[last]).dot(out);
        let own = (0..model.vertices.len()).filter(|&i| model.vertex_weights(i)[last] > 0.9);
        own.max_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap()
    })
}

fn inverted(positions: &[DVec3]) -> usize {
    let model = hand();
    let normals = model.vertex_normals(positions);
    let is_inverted = |face: &&[u32; 3]| {
        let [a, b, c] = face.map(|i| positions[i as usize]);
        let around: DVec3 = face.iter().map(|&i| normals[i as usize]).sum();
        (b - a).cross(c - a).dot(around) <= 0.0
    };
    model.faces.iter().filter(is_inverted).count()
}

fn volume(positions: &[DVec3]) -> f64 {
    let p = |i: u32| positions[i as usize];
    hand().faces.iter().map(|&[a, b, c]| p(a).dot(p(b).cross(p(c))) / 6.0).sum()
}

/// The default hand without pose blend shapes.
fn blended_only() -> HandModel {
    HandModel { pose_directions: vec![], ..hand().clone() }
}

#[test]
fn a_unit_of_a_fingers_length_lengthens_it_by_3_6_percent_and_moves_no_other_tip() {
    let model = hand();
    let tips = tips();
    let lengths = ProceduralHand::default();
    let documented = [lengths.thumb_length, lengths.finger_lengths[0], lengths.finger_lengths[1]]
        .into_iter()
        .chain([lengths.finger_lengths[2], lengths.finger_lengths[3]])
        .map(|length| 0.036 * length);
    for (finger, documented) in documented.enumerate() {
        for sign in [-1.0, 1.0] {
            let shaped = shape_hand(model, &unit(5 + finger, sign)).unwrap();
            for (other, &tip) in tips.iter().enumerate() {
                let moved = shaped.vertices[tip] - model.vertices[tip];
                if other == finger {
                    // Measured along the bones, which are not quite straight.
                    let grown = sign * moved.length();
                    println!("{} {sign:+}: {:.2} mm", FINGERS[finger], grown * 1e3);
                    assert!((grown - sign * documented).abs() < 0.05 * documented);
                    let first = joint(&format!("{}1", FINGERS[finger]));
                    let out = (model.vertices[tip] - model.joints[first]).normalize();
                    assert!(sign * moved.dot(out) > 0.95 * documented);
                } else {
                    assert!(moved.length() < 1e-4, "{} moved {}", FINGERS[other], moved.length());
                }
            }
        }
    }
}

#[test]
fn the_other_shape_directions_change_what_their_names_say_by_the_documented_amount() {
    let model = hand();
    let lengths = ProceduralHand::default();
    let grown = |direction: usize, measure: &dyn Fn(&ghand_core::posing::ShapedHand) -> f64| {
        measure(&shape_hand(model, &unit(direction, 1.0)).unwrap()) - measure(&shape_hand(model, &[]).unwrap())
    };
    let between = |a: &str, b: &str| {
        let (a, b) = (joint(a), joint(b));
        move |hand: &ghand_core::posing::ShapedHand| hand.joints[a].distance(hand.joints[b])
    };
    // Width of a finger at mid-bone across an axis.
    let wide = |finger: &str, axis: DVec3| {
        let (from, to) = (model.joints[joint(&format!("{finger}2"))], model.joints[joint(&format!("{finger}3"))]);
        let band: Vec<usize> = (0..model.vertices.len())
            .filter(|&i| {
                model.vertices[i].distance(from.midpoint(to)) < 0.014
                    && (model.vertices[i] - from.midpoint(to)).dot((to - from).normalize()).abs() < 0.004
            })
            .collect();
        move |hand: &ghand_core::posing::ShapedHand| {
            let along = band.iter().map(|&i| hand.vertices[i].dot(axis));
            along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
        }
    };
    let near = |value: f64, expected: f64, tolerance: f64, what: &str| {
        println!("{what}: {:.3} mm, documented {:.3}", value * 1e3, expected * 1e3);
        assert!((value - expected).abs() <= tolerance, "{what}");
    };
    let middle = wide("middle", DVec3::Z);
    let thick = wide("middle", DVec3::X);
    let rest = shape_hand(model, &[]).unwrap();
    let palm = between("wrist", "middle1");
    let knuckles = between("index1", "pinky1");
    let (index, thumb) = (between("index1", "index3"), between("thumb1", "thumb3"));
    near(grown(0, &palm), 0.05 * palm(&rest), 1e-5, "size: palm");
    near(grown(0, &middle), 0.05 * middle(&rest), 1e-5, "size: width of the middle finger");
    near(grown(1, &palm), 0.033 * lengths.palm_length, 1e-4, "palm length");
    near(grown(1, &index), 0.0, 1e-4, "palm length: index finger");
    near(grown(1, &thumb), 0.0, 2e-4, "palm length: thumb");
    let across =
        |hand: &ghand_core::posing::ShapedHand| hand.joints[joint("pinky1")].z - hand.joints[joint("index1")].z;
    near(grown(2, &across), 0.04 * lengths.palm_width, 1e-4, "palm width");
    near(grown(2, &knuckles), 0.04 * lengths.palm_width, 2e-4, "palm width, knuckle to knuckle");
    near(grown(2, &index), 0.0, 1e-4, "palm width: index finger");
    near(grown(2, &middle), 0.0, 1e-4, "palm width: width of the middle finger");
    near(grown(3, &thick), 0.06 * thick(&rest), 1e-4, "thickness of the middle finger");
    near(grown(3, &middle), 0.0, 1e-4, "thickness: width of the middle finger");
    near(grown(4, &middle), 0.05 * middle(&rest), 1e-4, "girth: width of the middle finger");
    near(grown(4, &thick), 0.05 * thick(&rest), 1e-4, "girth: thickness of the middle finger");
    near(grown(4, &knuckles), 0.0, 1e-4, "girth: knuckles");
}

#[test]
fn no_shape_of_two_units_flips_a_triangle() {
    for direction in 0..10 {
        for value in [-2.0, 2.0] {
            let shaped = shape_hand(hand(), &unit(direction, value)).unwrap();
            assert_eq!(inverted(&shaped.vertices), 0, "direction {direction} at {value}");
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for _ in 0..20 {
        let shape: [f64; 10] = std::array::from_fn(|_| rng.random_range(-1.5..1.5));
        assert_eq!(inverted(&shape_hand(hand(), &shape).unwrap().vertices), 0, "{shape:?}");
    }
    let most = (0..10).flat_map(|d| [-3.0, 3.0].map(|v| inverted(&shape_hand(hand(), &unit(d, v)).unwrap().vertices)));
    println!("at three units at most {} triangles", most.max().unwrap());
}

#[test]
fn regressed_joints_match_the_skeleton_and_follow_every_shape() {
    let lengths = ProceduralHand::default();
    let details = [1, lengths.detail, 3];
    for detail in &details[..crate::cases(2, 3)] {
        let lengths = ProceduralHand { detail: *detail, ..lengths.clone() };
        let model = lengths.build().unwrap();
        let skeleton = skeleton::Skeleton::new(&lengths);
        for (built, laid_out) in model.joints.iter().zip(skeleton.joints()) {
            assert!(built.distance(laid_out) < 1e-12);
        }
        assert_eq!(shape_hand(&model, &[]).unwrap().joints, model.joints);
        let glove = Glove::sew(&skeleton, 1.0, lengths.detail).unwrap();
        let wanted = shapes::Shapes::new(&lengths, &skeleton, &glove).joints;
        let mut worst = 0.0f64;
        for (direction, wanted) in wanted.iter().enumerate() {
            let shaped = shape_hand(&model, &unit(direction, 1.0)).unwrap();
            for ((after, before), moved) in shaped.joints.iter().zip(&model.joints).zip(wanted) {
                let distance = (*after - *before).distance(*moved);
                assert!(distance < 1e-4, "{distance}");
                worst = worst.max(distance);
            }
        }
        let weight = |row: &Vec<(u32, f64)>| row.iter().map(|(_, w)| w.abs()).sum::<f64>();
        let largest = model.joint_regressor.iter().map(weight).fold(0.0, f64::max);
        println!("detail {}: joints off by {:.4} mm at most, sum |w| {largest:.2}", lengths.detail, worst * 1e3);
        assert!(largest < 5.0, "{largest}");
    }
}

#[test]
fn the_rest_pose_has_no_correctives_and_those_of_a_joint_stay_near_it() {
    let model = hand();
    let posed = pose_hand(model, &[], &Pose::rest(16)).unwrap();
    assert_eq!(posed.corrected, model.vertices);
    let count = model.vertices.len();
    for (feature, directions) in model.pose_directions.chunks_exact(count).enumerate() {
        let at = model.joints[1 + feature / 9];
        for (v, d) in model.vertices.iter().zip(directions) {
            assert!(d.length() == 0.0 || v.distance(at) < 0.06, "{} at {v}", model.joint_names[1 + feature / 9]);
            assert!(d.length() < 0.01, "{d}");
        }
    }
}

#[test]
fn a_bent_finger_keeps_its_volume_with_correctives() {
    let model = hand();
    let rest = volume(&model.vertices);
    for name in ["index2", "middle2", "ring2", "pinky2", "middle3"] {
        let mut pose = Pose::rest(16);
        pose.rotations[joint(name)] = DVec3::NEG_Z * std::f64::consts::FRAC_PI_2;
        let loss = |model: &HandModel| rest - volume(&pose_hand(model, &[], &pose).unwrap().vertices);
        let blended = loss(&blended_only());
        let corrected = loss(model);
        println!("{name}: loses {:.2} cm^3 blended, {:.2} corrected", blended * 1e6, corrected * 1e6);
        assert!(corrected.abs() < 0.4 * blended.abs(), "{name}");
    }
}

#[test]
fn correctives_flip_hardly_more_triangles_than_blending_alone() {
    for name in POSE_NAMES {
        let pose = named_pose(name, hand()).unwrap();
        let count = |model: &HandModel| inverted(&pose_hand(model, &[], &pose).unwrap().vertices);
        let blended = count(&blended_only());
        let corrected = count(hand());
        println!("{name}: {blended} blended, {corrected} corrected");
        // The skin inside a hinge bent by more than a right angle folds onto itself either way: in the fist 6 for 5.
        assert!(corrected <= blended + 1 && corrected <= 6, "{name}");
    }
}

#[test]
fn the_left_hand_in_a_mirrored_pose_is_the_mirror_image_in_every_shape() {
    let left = ProceduralHand { left: true, ..Default::default() }.build().unwrap();
    let mirror = DVec3::new(-1.0, 1.0, 1.0);
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    for _ in 0..4 {
        let shape: [f64; 10] = std::array::from_fn(|_| rng.random_range(-2.0..2.0));
        let mut pose = Pose::rest(16);
        for r in &mut pose.rotations {
            *r = DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        }
        pose.translation = DVec3::new(0.1, -0.2, 0.3);
        // M R(v) M = R(det(M) M v): an axis is a pseudovector.
        let rotations: Vec<DVec3> = pose.rotations.iter().map(|r| -mirror * *r).collect();
        let mirrored = Pose { rotations, translation: mirror * pose.translation };
        let m = DMat3::from_diagonal(mirror);
        let turned = rotation_from_axis_angle(mirrored.rotations[3]);
        let expected = rotation_from_axis_angle(pose.rotations[3]);
        assert!((turned - m * expected * m).abs_diff_eq(DMat3::ZERO, 1e-15));
        let (of_left, of_right) =
            (pose_hand(&left, &shape, &mirrored).unwrap(), pose_hand(hand(), &shape, &pose).unwrap());
        let pairs = of_left.vertices.iter().zip(&of_right.vertices).chain(of_left.joints.iter().zip(&of_right.joints));
        for (l, r) in pairs {
            assert!(l.distance(mirror * *r) < 1e-12, "{l} {r}");
        }
    }
}
