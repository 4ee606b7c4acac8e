//! Captures like photographs: an arm, a desk behind the hand, and no masks.

use crate::common::{errors, make, poses, small_options};
use ghand_capture::mask::MaskMethod;
use ghand_capture::{Capture, SplitView};
use ghand_core::posing::pose_hand;
use ghand_fit::alignment::{Alignment, align};
use ghand_hand_model::surface::arm_end::ArmEnd;
use ghand_synthetic::{Backdrop, Masks, SyntheticOptions};
use ghand_test_support::{cases, long};
use glam::DVec2;

fn options(masks: Masks) -> SyntheticOptions {
    SyntheticOptions { background: Backdrop::Clutter, forearm: true, masks, ..small_options(9) }
}

fn aligned(capture: &Capture) -> Alignment {
    align(capture, capture.split("train").unwrap(), None, &mut |_, _| true).unwrap()
}

/// Degrees and millimetres.
fn errors_of(capture: &Capture, alignment: &Alignment) -> [f64; 2] {
    let [_, truth] = poses(capture, capture.split("train").unwrap());
    errors(&alignment.poses, &truth)
}

/// Intersection over union of the masks of two captures on the hand's side of the true hand's end: mean and least.
fn overlaps(found: &Capture, truth: &Capture) -> [f64; 2] {
    let end = ArmEnd::of(&truth.template).unwrap();
    let [_, true_poses] = poses(truth, truth.split("train").unwrap());
    let of_view = |view: &SplitView| {
        let camera = &truth.cameras[view.camera];
        let posed = pose_hand(&truth.template, &[], &true_poses[view.position]).unwrap();
        let line = end.seen(&posed.vertices, camera);
        let width = camera.width as usize;
        let on_hand_side = |i: &usize| {
            let center = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            line.is_none_or(|line| line.beyond(center) <= 0.0)
        };
        let [a, b] = [found, truth].map(|capture| capture.load_hand_mask(view.camera, view.frame).unwrap());
        let count = |both: bool| {
            (0..a.len()).filter(|&i| if both { a[i] && b[i] } else { a[i] || b[i] }).filter(on_hand_side).count() as f64
        };
        count(true) / count(false)
    };
    let all: Vec<f64> = truth.split("train").unwrap().views.iter().map(of_view).collect();
    [all.iter().sum::<f64>() / all.len() as f64, all.iter().copied().fold(1.0, f64::min)]
}

#[test]
fn an_arm_in_the_masks_costs_an_alignment_nothing_and_is_cut_off_after_it() {
    if !long() {
        return;
    }
    let [(mut arm, _a), (hand, _b)] = [Masks::Arm, Masks::Hand].map(|masks| make(&options(masks)));
    let [with, without] = [&arm, &hand].map(aligned);
    let [e, f] = [errors_of(&arm, &with), errors_of(&hand, &without)];
    println!("with arm {e:.2?} {:?}, without {f:.2?} {:?}", with.fit, without.fit);
    assert!(with.rejection.is_none(), "{:?}", with.rejection);
    assert!(e[0] < f[0] + 0.3 && e[1] < f[1] + 0.3, "{e:.2?} with arm, {f:.2?} without");
    // The overlap is that of the hand.
    assert!((with.fit[1].overlap - without.fit[1].overlap).abs() < 0.01, "{:?} {:?}", with.fit, without.fit);
    let count = |capture: &Capture| {
        let of_view = |view: &SplitView| {
            let pixels = capture.load_view(view.camera, view.frame).unwrap().rgba;
            pixels.iter().filter(|pixel| pixel[3] == 255).count() as f64
        };
        capture.split("train").unwrap().views.iter().map(of_view).sum::<f64>()
    };
    let frames = arm.split("train").unwrap().frames.clone();
    let before = count(&arm);
    arm.align_masks(&with.template, &frames, &with.poses);
    assert!(
        before > 1.02 * count(&hand) && (count(&arm) / count(&hand) - 1.0).abs() < 0.03,
        "{before} {}",
        count(&arm)
    );
    // Where the wrist bends away from the template's end, skin goes on, in a mask that says neither hand nor background.
    let unknown: Vec<[u8; 4]> = (arm.split("train").unwrap().views.iter())
        .flat_map(|view| arm.load_view(view.camera, view.frame).unwrap().rgba)
        .filter(|pixel| ![0, 255].contains(&pixel[3]))
        .collect();
    assert!(!unknown.is_empty() && (unknown.len() as f64) < 0.02 * before, "{} of {before}", unknown.len());
    assert!(unknown.iter().all(|[r, _, b, mask]| *r > 60 && r > b && *mask < 128), "{:?}", unknown[0]);
}

#[test]
fn masks_are_made_for_a_capture_without_any_and_are_those_of_the_hand() {
    let [(none, _a), (hand, _b)] = [Masks::None, Masks::Hand].map(|masks| make(&options(masks)));
    let method = none.images.made_masks.as_ref().map(|made| made.method);
    assert!(hand.images.made_masks.is_none() && method == Some(MaskMethod::Colors));
    let made = overlaps(&none, &hand);
    let view = none.split("train").unwrap().views[0];
    let [camera, frame] = [&none.cameras[view.camera].id, &none.frames[view.frame].id];
    let kept = none.root.join(format!("ghand-masks/{camera}/{frame}.png"));
    assert!(kept.is_file(), "{} is missing", kept.display());
    let again = overlaps(&none, &hand);
    let alignment = aligned(&none);
    let error = errors_of(&none, &alignment);
    let frames = none.split("train").unwrap().frames.clone();
    let mut better = none.clone();
    better.align_masks(&alignment.template, &frames, &alignment.poses);
    let remade = overlaps(&better, &hand);
    println!("made {made:.3?}, remade {remade:.3?}; poses {error:.2?}");
    assert!(made[0] > 0.95 && made[1] > 0.85, "{made:?}");
    assert!(remade[0] > made[0] - 0.005, "{remade:?} after {made:?}");
    assert_eq!(made, again, "masks from the cache are others");
    let [given, truth] = poses(&none, none.split("train").unwrap());
    let given = errors(&given, &truth);
    assert!(alignment.rejection.is_none() && error[0] < 0.75 * given[0] && error[1] < given[1], "{error:?} {given:?}");
    if cases(false, true) {
        // 0.51 degrees and 0.30 mm more as measured.
        let with_masks = errors_of(&hand, &aligned(&hand));
        assert!(error[0] < with_masks[0] + 0.6 && error[1] < with_masks[1] + 0.5, "{error:?} {with_masks:?}");
    }
}
