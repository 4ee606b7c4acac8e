//! Alignment of captures that are harder than usual or wrong.

use std::sync::OnceLock;

use crate::common::{errors, exact, exact_alignment, make, poses, small_options};
use ghand_capture::{Capture, Split};
use ghand_core::{HandModel, Pose, Side};
use ghand_fit::alignment::{Alignment, Rejection, align};
use ghand_hand_model::builtin::builtin_hand;
use ghand_synthetic::SyntheticOptions;
use ghand_test_support::{cases, long};
use glam::DVec3;

/// How far poses are off before and after an alignment.
#[derive(Debug)]
struct Figures {
    /// Degrees and millimetres, of the given poses and of the aligned.
    given: [f64; 2],
    aligned: [f64; 2],
    /// Of the frame that changed for the worst: its error in degrees relative to the given one.
    worst_frame: f64,
    /// Pixels, median and 95th percentile, before and after.
    contours: [[f64; 2]; 2],
    rejection: Option<Rejection>,
}

impl Figures {
    /// Asserts that the poses' angles and translations are at most these parts of the given ones' errors, and no frame
    /// worse than it was given.
    #[track_caller]
    fn assert_within(&self, parts: [f64; 2]) {
        // At most 0.83 as measured.
        assert!(self.worst_frame < 1.0 || self.rejection.is_some(), "a frame became worse: {self:.2?}");
        for ((given, aligned), part) in self.given.iter().zip(self.aligned).zip(parts) {
            assert!(aligned < part * given, "more than {part} of the given errors remain: {self:.2?}");
        }
    }

    /// Asserts that errors are at most so many degrees and millimetres larger than in another alignment.
    #[track_caller]
    fn assert_costs(&self, other: &Figures, most: [f64; 2]) {
        for ((aligned, other), most) in self.aligned.iter().zip(other.aligned).zip(most) {
            assert!(aligned - other < most, "more than {most} is lost: {self:.2?}");
        }
    }
}

fn figures(name: &str, capture: &Capture, split: &Split) -> Figures {
    figures_of(name, capture, split, &align(capture, split, None, &mut |_, _| true).unwrap())
}

fn figures_of(name: &str, capture: &Capture, split: &Split, aligned: &Alignment) -> Figures {
    let [given, truth] = poses(capture, split);
    let contours = aligned.fit.map(|fit| fit.contours);
    let degrees = |poses: &[Pose], frame: usize| errors(&poses[frame..=frame], &truth[frame..=frame])[0];
    let worst = |worst: f64, frame| worst.max(degrees(&aligned.poses, frame) / degrees(&given, frame));
    let worst_frame = (0..given.len()).fold(0.0, worst);
    let figures = Figures {
        given: errors(&given, &truth),
        aligned: errors(&aligned.poses, &truth),
        worst_frame,
        contours,
        rejection: aligned.rejection.clone(),
    };
    let by_contours = aligned.texture.as_ref().map(|texture| errors(&texture.contour_poses, &truth));
    println!("{name}: {figures:.2?}, by contours alone {by_contours:.2?}, {:.3?}", aligned.fit);
    figures
}

/// Its figures.
fn of_exact() -> &'static Figures {
    static FIGURES: OnceLock<Figures> = OnceLock::new();
    FIGURES.get_or_init(|| figures_of("exact", exact(), exact().split("train").unwrap(), exact_alignment()))
}

fn of_options(name: &str, options: &SyntheticOptions) -> Figures {
    let (capture, _folder) = make(options);
    figures(name, &capture, capture.split("train").unwrap())
}

/// Its figures with another template.
fn of_template(name: &str, template: HandModel) -> Figures {
    let capture = Capture { template, ..exact().clone() };
    figures(name, &capture, capture.split("train").unwrap())
}

#[test]
fn masks_two_pixels_off_cost_less_than_they_are_off() {
    if !long() {
        return;
    }
    let found = of_options("masks off by 2 px", &SyntheticOptions { mask_noise_pixels: 2.0, ..small_options(3) });
    assert_eq!(found.given, of_exact().given, "only masks differ");
    // Two pixels are 3 mm, and one mask in eight lacks a disc. 0.33 degrees and 0.89 mm as measured: translations are no better
    // than given.
    found.assert_costs(of_exact(), [0.5, 1.2]);
    assert!(found.contours[1][0] < 2.0 && found.contours[1][0] > of_exact().contours[1][0], "{found:.2?}");
}

#[test]
fn bites_out_of_masks_cost_nothing() {
    if !long() {
        return;
    }
    let (capture, _folder) = make(&small_options(3));
    let split = capture.split("train").unwrap();
    // A disc of radius 12 pixels on the outline is missing from every sixth mask.
    for (k, view) in split.views.iter().enumerate().filter(|(k, _)| k % 6 == 0) {
        let file = capture.mask_file(view.camera, view.frame).unwrap().unwrap();
        let mut mask = image::open(&file).unwrap().into_luma8();
        let is_inside = |x: u32, y: u32| mask.get_pixel(x, y).0[0] > 127;
        let rim: Vec<[u32; 2]> = (1..191)
            .flat_map(|y| (1..127).map(move |x| [x, y]))
            .filter(|&[x, y]| is_inside(x, y) && !(is_inside(x - 1, y) && is_inside(x + 1, y)))
            .collect();
        let [x, y] = rim[37 * k % rim.len()].map(f64::from);
        for (column, row, pixel) in mask.enumerate_pixels_mut() {
            if (f64::from(column) - x).hypot(f64::from(row) - y) < 12.0 {
                pixel.0 = [0];
            }
        }
        mask.save(&file).unwrap();
    }
    // Less than 0.005 degrees and millimetres as measured.
    figures("bites", &capture, split).assert_costs(of_exact(), [0.05, 0.05]);
}

#[test]
fn poses_that_are_off_in_all_frames_alike_become_better() {
    if !long() {
        return;
    }
    // Mean errors of 13.7 degrees and 3.8 mm; 8.0 and 1.1 remain as measured: a constant rotation and other
    // proportions explain the same contours. With a person's own bones 7.8 and 3.4: there is no telling a wrist that lies
    // elsewhere from longer metacarpals.
    let biased = SyntheticOptions { pose_bias_degrees: 6.0, ..small_options(3) };
    of_options("bias 6, own bones", &biased).assert_within([0.65, 1.0]);
    of_options("bias 6", &SyntheticOptions { bone_spread: 0.0, ..biased }).assert_within([0.65, 0.35]);
}

#[test]
fn joints_that_are_no_hinges_become_better() {
    if !long() {
        return;
    }
    let options = SyntheticOptions { twist_degrees: 5.0, abduction_degrees: 4.0, ..small_options(3) };
    // 0.69 and 0.34 as measured.
    of_options("twist and abduction", &options).assert_within([0.75, 0.5]);
}

/// A person whose bones differ from the template's by twice the published spread, as far as the fourth of its standard
/// deviations, with masks off by a pixel.
fn extreme_person(identity: u64) -> SyntheticOptions {
    let side = if identity.is_multiple_of(2) { Side::Right } else { Side::Left };
    SyntheticOptions { side, bone_spread: 2.0, mask_noise_pixels: 1.0, ..small_options(identity) }
}

#[test]
fn persons_at_the_ends_of_the_population_are_aligned() {
    if !long() {
        return;
    }
    for identity in 20..cases(22, 24) {
        let found = of_options(&format!("person {identity}"), &extreme_person(identity));
        // 0.61 and 0.47 at most as measured with twelve persons, none of whom is refused.
        assert_eq!(found.rejection, None, "{identity}");
        found.assert_within([0.7, 0.6]);
    }
    let (capture, _folder) = make(&extreme_person(25));
    let capture = Capture { template: builtin_hand(Side::Right).unwrap(), ..capture };
    let found = figures("the other hand of such a person", &capture, capture.split("train").unwrap());
    assert_eq!(found.rejection, Some(Rejection::OtherHand { side: Side::Right }));
}

#[test]
fn a_left_hand_is_aligned_as_well_as_a_right_one() {
    if !long() {
        return;
    }
    let found = of_options("left", &SyntheticOptions { side: Side::Left, ..small_options(3) });
    // It is the mirror image, but cameras are not: -0.04 degrees and 0.02 mm as measured.
    found.assert_costs(of_exact(), [0.1, 0.2]);
    found.assert_within([0.68, 0.55]);
}

#[test]
fn one_camera_is_enough_to_make_poses_better() {
    let capture = exact();
    let split = capture.split("train").unwrap();
    for camera in split.cameras.iter().take(cases(1, split.cameras.len())) {
        let alone = Split::product(vec![*camera], split.frames.clone());
        let found = figures(&format!("camera {camera}"), capture, &alone);
        // At most 0.70 and 0.88 as measured: one camera hardly tells how far away the hand is.
        found.assert_within([0.75, 0.92]);
        assert!(found.contours[1][0] < 0.6, "{found:.2?}");
    }
}

#[test]
fn a_template_of_another_size_takes_the_size_of_the_hand() {
    if !long() {
        return;
    }
    for factor in [0.8, 1.3] {
        let found = of_template(&format!("template x {factor}"), scaled(&exact().template, factor));
        // Another size moves the template's wrist, so that translations cannot be compared. 3.27 and 3.51
        // degrees as measured, where the template's own size has 3.21; and 0.4 pixels. At 1.3 images held out are not
        // explained better, so that texture refines nothing.
        found.assert_costs(of_exact(), [0.4, f64::INFINITY]);
        assert!(found.contours[1][0] < 0.6, "{found:.2?}");
    }
}

#[test]
fn templates_that_cannot_be_right_are_refused() {
    let left = of_template("other side", builtin_hand(Side::Left).unwrap());
    assert_eq!(left.rejection, Some(Rejection::OtherHand { side: Side::Left }), "{left:?}");
    for factor in [10.0, 0.1].into_iter().take(cases(1, 2)) {
        let found = of_template(&format!("template x {factor}"), scaled(&exact().template, factor));
        // A small one finds some outline everywhere: 1.6 pixels off, with an overlap of 0.15.
        let is_refused = match found.rejection {
            Some(Rejection::NoMatch { distance, size }) => distance > 0.04 * size,
            Some(Rejection::NoOverlap { overlap }) => overlap < 0.2,
            // Or its wrist grows over the masks.
            Some(Rejection::Proportions { ratio, .. }) => ratio > 3.0,
            _ => false,
        };
        assert!(is_refused, "{found:?}");
        assert_eq!(found.given, found.aligned);
    }
    let message = left.rejection.unwrap().to_string();
    assert!(message.contains("fit a right hand better than the left one") && !message.contains('\n'), "{message}");
}

fn scaled(model: &HandModel, factor: f64) -> HandModel {
    let times = |points: &[DVec3]| points.iter().map(|p| *p * factor).collect();
    HandModel {
        vertices: times(&model.vertices),
        joints: times(&model.joints),
        shape_directions: times(&model.shape_directions),
        joint_directions: times(&model.joint_directions),
        pose_directions: times(&model.pose_directions),
        ..model.clone()
    }
}
