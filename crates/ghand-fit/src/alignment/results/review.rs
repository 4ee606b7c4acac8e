//! What the masks say of a capture before anything is trained: how far its hand and its poses are from what is given, what
//! is wrong with the masks, and which parts of the hand no image shows.

use std::collections::BTreeMap;

use ghand_capture::mask::covered_pixels;
use ghand_capture::{Capture, Split, SplitView};
use ghand_core::posing::pose_hand;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{Camera, HandModel, Pose};
use ghand_hand_model::joints::hand_directions::hand_directions;
use ghand_hand_model::joints::names::{Finger, JointRole};
use rayon::prelude::*;

use crate::views::TrainViews;

use super::rejection::rejection;
use crate::alignment::reduced::Reduced;
use crate::alignment::texture::surface::{NearestDepth, SurfacePoint, surface_points};
use crate::alignment::{
    AlignmentError, Calibration, Fit, MaskFit, OddCamera, Rejection, Shape, TimeOffset, calibration_views,
    images_of_frames,
};

/// Frames that are fitted: so many pairs of successive ones, which tell velocities, evenly over the split.
const PAIRS: usize = 8;
/// Images that are looked at for blur, and pixels around the hand in them.
const MOST_IMAGES: usize = 240;
const BORDER: u32 = 8;
/// A point of the surface is seen at an angle with at least this cosine.
const LEAST_COSINE: f64 = 0.3;
/// A part of the hand of which less than this is seen is named.
const LEAST_SEEN: f64 = 0.3;
/// Outlines of which 5 % are farther than this off the fitted hand are named: pixels, and a part of the masks' size.
const FAR_PIXELS: f64 = 3.0;
const FAR: f64 = 0.015;
/// Holes in masks of fewer pixels do not count, nor those of which the fitted template covers less than the second: they may
/// be gaps between fingers.
const LEAST_HOLE: usize = 16;
const COVERED_HOLE: f64 = 0.9;

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Review {
    /// Frames that were fitted.
    pub frames: usize,
    /// How given and fitted poses fit the masks.
    pub fit: [MaskFit; 2],
    /// How the cameras' calibration is off, if it is.
    pub calibration: Option<Calibration>,
    /// Cameras that do not show the hand that the others show; all else is said without them.
    pub odd_cameras: Vec<OddCamera>,
    /// Cameras that take their images earlier or later than the others.
    pub time_offsets: Vec<TimeOffset>,
    /// Why training would use the given poses, if it would.
    pub rejection: Option<Rejection>,
    /// Size of the hand relative to the template's: median over the bones.
    pub size: f64,
    /// How far the given translations are off, metres: median over the frames.
    pub shift: f64,
    /// How far the given rotations of the whole hand are off, radians: median over the frames.
    pub turn: f64,
    /// How far the given rotations of the fingers' joints are off, radians: median over frames and joints.
    pub fingers: f64,
    /// Masks that were looked at, and how many of them have holes in the hand.
    pub masks: usize,
    /// Masks with holes inside the hand.
    pub masks_with_holes: usize,
    /// Images that were looked at for blur, and how many of them are blurred.
    pub looked_at: usize,
    /// Images so blurred that training takes them less than half as often as others.
    pub blurred: usize,
    /// Parts of the hand that hardly any image shows, with the share of them that is seen.
    pub unseen: Vec<(String, f64)>,
}

/// Fits the template to the masks of some frames of a split. `None` if no mask shows an outline.
///
/// # Errors
/// [`AlignmentError`] if an image is unusable or a pose does not fit the template.
pub fn review(capture: &Capture, whole: &Split) -> Result<Option<Review>, AlignmentError> {
    // Images that cannot be read are told elsewhere.
    let views = TrainViews::new(capture, &some_images(whole), BORDER).ok();
    let blurred = views.as_ref().and_then(|views| views.blurred().ok());
    let (looked_at, blurred) = views.zip(blurred).map_or((0, 0), |(views, blurred)| (views.len(), blurred));
    let split = some_frames(whole);
    let reduced = Reduced::new(capture, &split)?;
    let fields = reduced.fields(&split.views)?;
    let mut images = images_of_frames(&reduced.cameras, &split, &fields);
    if images.iter().all(Vec::is_empty) {
        return Ok(None);
    }
    let given: Vec<&Pose> = split.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let mut fit = Fit::new(&capture.template, given.clone(), Shape::Unknown);
    fit.follow_contours(&images, &mut |_, _, _| true)?;
    let calibration = fit.calibrate(&reduced.cameras, &calibration_views(&split, &fields))?;
    // With wrong cameras nothing else can be told.
    let refined = calibration.as_ref().map(|calibration| calibration.applied_to(&reduced.cameras));
    let cameras = refined.as_ref().unwrap_or(&reduced.cameras);
    if calibration.is_some() {
        images = images_of_frames(cameras, &split, &fields);
        fit = Fit::new(&capture.template, given.clone(), Shape::Unknown);
        fit.follow_contours(&images, &mut |_, _, _| true)?;
    }
    let odd_cameras = fit.odd_cameras(&reduced, cameras, &split, &fields)?;
    if !odd_cameras.is_empty() {
        let is_odd = |view: &SplitView| odd_cameras.iter().any(|odd| odd.camera == capture.cameras[view.camera].id);
        let mut others = whole.clone();
        others.views.retain(|view| !is_odd(view));
        others.cameras.retain(|camera| others.views.iter().any(|view| view.camera == *camera));
        let merged = |mut found: Review| {
            found.odd_cameras.splice(..0, odd_cameras);
            found
        };
        return Ok(review(capture, &others)?.map(merged));
    }
    let time_offsets = fit.time_offsets(capture, &split, &images)?;
    let template = fit.shaped_template()?;
    let fits = [fit.fit_as_given(&images)?, fit.fit_of(&fit.shaped()?, &fit.poses, &images)?.0];
    let is_other = fit.is_other_hand(&images)?;
    let lengths = bone_lengths(&template).into_iter().zip(bone_lengths(&capture.template));
    let pairs = || fit.poses.iter().zip(&given).zip(&images).filter(|(_, images)| !images.is_empty()).map(|(p, _)| p);
    let angle = |found: &Pose, given: &Pose, joint: usize| {
        let [a, b] = [found, given].map(|pose| rotation_from_axis_angle(pose.rotations[joint]));
        axis_angle_from_rotation(&(a * b.transpose())).length()
    };
    let fingers = pairs().flat_map(|(found, given)| {
        fit.moving.iter().filter(|joint| **joint > 0).map(move |joint| angle(found, given, *joint))
    });
    let with_holes = |view: &SplitView| -> Result<bool, AlignmentError> {
        let mask = reduced.mask(view.camera, view.frame)?;
        let camera = &cameras[view.camera];
        let positions = pose_hand(&template, &[], &fit.poses[view.position])?.vertices;
        Ok(has_hole(&mask, &covered_pixels(camera, &positions, &template.faces), camera.width as usize))
    };
    let holes: Vec<bool> = split.views.par_iter().map(with_holes).collect::<Result<_, _>>()?;
    Ok(Some(Review {
        frames: split.frames.len(),
        calibration: calibration.map(|found| reduced.full_size_calibration(found)),
        odd_cameras,
        time_offsets,
        rejection: rejection(fits, &capture.template, &template, is_other),
        fit: fits,
        size: median(lengths.map(|(found, given)| found / given).collect()),
        shift: median(pairs().map(|(found, given)| found.translation.distance(given.translation)).collect()),
        turn: median(pairs().map(|(found, given)| angle(found, given, 0)).collect()),
        fingers: median(fingers.collect()),
        masks: holes.len(),
        masks_with_holes: holes.iter().filter(|hole| **hole).count(),
        looked_at,
        blurred,
        unseen: unseen_parts(&reduced, cameras, &template, &split, &fit.poses)?,
    }))
}

impl Review {
    /// What is unusual, a sentence each without its full stop: hand, poses, masks and views apart.
    pub fn sentences(&self) -> Vec<String> {
        let mut all = vec![];
        if let Some(rejection) = &self.rejection {
            all.push(format!("training would use the given poses: {rejection}"));
        }
        if let Some(calibration) = &self.calibration {
            let [before, after] = calibration.left_out.map(|lack| 1.0 - lack);
            all.push(format!(
                "the cameras' calibration is off ({}): images left out overlap the hand by {before:.2}, {after:.2} once it is \
                 refined; training refines it, calibrating again is better",
                calibration.parts_text()
            ));
        }
        all.extend(self.odd_cameras.iter().map(ToString::to_string));
        all.extend(self.time_offsets.iter().map(ToString::to_string));
        let percent = 100.0 * (self.size - 1.0);
        if percent.abs() >= 2.0 {
            let how = if percent > 0.0 { "larger" } else { "smaller" };
            all.push(format!("the hand is {:.0} % {how} than the template; training takes its size", percent.abs()));
        }
        if self.shift >= 0.005 || self.turn >= 5.0_f64.to_radians() {
            all.push(format!(
                "the given poses put the hand {:.0} mm beside the masks and turned by {:.0} degrees (medians)",
                1e3 * self.shift,
                self.turn.to_degrees()
            ));
        }
        if self.fingers >= 10.0_f64.to_radians() {
            all.push(format!(
                "the given rotations of the fingers' joints are {:.0} degrees off what the masks show (median)",
                self.fingers.to_degrees()
            ));
        }
        let [median, far] = self.fit[1].contours;
        let usual = FAR_PIXELS.max(FAR * self.fit[1].mask_size).max(3.0 * median);
        if self.rejection.is_none() && far > usual {
            all.push(format!(
                "parts of the masks are not the hand's: 5 % of the outlines are more than {far:.0} pixels off the fitted \
                 hand, half of them less than {median:.1}; look for cut fingers, filled gaps and the arm"
            ));
        }
        if self.masks_with_holes > 0 {
            all.push(format!("{} of {} masks have holes in the hand", self.masks_with_holes, self.masks));
        }
        if 10 * self.blurred >= self.looked_at.max(1) {
            all.push(format!(
                "{} of {} images are blurred; training takes them less often: expose for a shorter time, with more light, or \
                 move more slowly",
                self.blurred, self.looked_at
            ));
        }
        if !self.unseen.is_empty() {
            let parts: Vec<String> =
                self.unseen.iter().map(|(part, seen)| format!("{part} ({:.0} % seen)", 100.0 * seen)).collect();
            all.push(format!(
                "hardly any image shows {}; film these, too, or they are guessed from the rest",
                parts.join(", ")
            ));
        }
        all
    }
}

/// Some of a split's images, evenly over their cameras and frames.
fn some_images(split: &Split) -> Split {
    let step = split.views.len().div_ceil(MOST_IMAGES).max(1);
    // Without a factor in common with the number of cameras, or some of these would never come.
    let cameras = split.cameras.len().max(1);
    let shares_factor = |step: usize| (2..=step).any(|k| step.is_multiple_of(k) && cameras.is_multiple_of(k));
    let step = (step..=step + cameras).find(|step| !shares_factor(*step)).unwrap_or(step);
    Split { views: split.views.iter().step_by(step).copied().collect(), ..split.clone() }
}

/// A split's frames, if there are many an even selection of pairs.
fn some_frames(split: &Split) -> Split {
    let count = PAIRS.min(split.frames.len().div_ceil(2));
    let first: Vec<usize> = (0..count).map(|k| 2 * (split.frames.len() * k / (2 * count))).collect();
    split.filtered(|view| first.contains(&(view.position - view.position % 2)))
}

fn bone_lengths(model: &HandModel) -> Vec<f64> {
    let bones = model.parents.iter().enumerate().filter_map(|(k, parent)| Some((k, (*parent)?)));
    bones.map(|(k, parent)| model.joints[k].distance(model.joints[parent])).collect()
}

fn median(values: Vec<f64>) -> f64 {
    crate::alignment::quantiles(values)[0]
}

/// Whether a mask (row-major) lacks a part of the hand that it surrounds, and the template (`covered`) has it.
fn has_hole(mask: &[bool], covered: &[bool], width: usize) -> bool {
    let mut reached = mask.to_vec();
    (0..mask.len()).any(|start| {
        if reached[start] {
            return false;
        }
        let (pixels, at_border) = fill(&mut reached, start, width);
        let hidden = pixels.iter().filter(|pixel| covered[**pixel]).count();
        !at_border && pixels.len() >= LEAST_HOLE && hidden as f64 >= COVERED_HOLE * pixels.len() as f64
    })
}

/// The pixels that were not reached yet and hang together with one, and whether any is at the border of the image.
fn fill(reached: &mut [bool], start: usize, width: usize) -> (Vec<usize>, bool) {
    let (width, height) = (width.max(1), reached.len() / width.max(1));
    let mut open = vec![start];
    let mut pixels = vec![];
    let mut at_border = false;
    reached[start] = true;
    while let Some(at) = open.pop() {
        pixels.push(at);
        let (x, y) = (at % width, at / width);
        at_border |= x == 0 || y == 0 || x + 1 == width || y + 1 == height;
        let near = [
            (x > 0).then(|| at - 1),
            (x + 1 < width).then_some(at + 1),
            (y > 0).then(|| at - width),
            (y + 1 < height).then_some(at + width),
        ];
        for next in near.into_iter().flatten() {
            if !std::mem::replace(&mut reached[next], true) {
                open.push(next);
            }
        }
    }
    (pixels, at_border)
}

/// The parts of the hand of which hardly anything is seen in the images of a split, in these poses.
fn unseen_parts(
    reduced: &Reduced,
    cameras: &[Camera],
    template: &HandModel,
    split: &Split,
    poses: &[Pose],
) -> Result<Vec<(String, f64)>, AlignmentError> {
    let Some(directions) = hand_directions(template) else { return Ok(vec![]) };
    let points = surface_points(template);
    let seen_in = |view: &SplitView| -> Result<Vec<bool>, AlignmentError> {
        let camera = &cameras[view.camera];
        let mask = reduced.mask(view.camera, view.frame)?;
        let positions = pose_hand(template, &[], &poses[view.position])?.vertices;
        let normals = template.vertex_normals(&positions);
        let nearest = NearestDepth::new(camera, &positions, &template.faces);
        let is_seen = |point: &SurfacePoint| {
            let place = point.mean_of(&positions);
            let (pixel, depth) = camera.project(place);
            let faces = point.mean_of(&normals).normalize_or_zero().dot((camera.center() - place).normalize_or_zero());
            let column = |at: f64, size: u32| (at >= 0.0 && at < f64::from(size)).then_some(at as usize);
            let on_hand = column(pixel.x, camera.width).zip(column(pixel.y, camera.height));
            faces >= LEAST_COSINE
                && nearest.shows(pixel, depth)
                && on_hand.is_some_and(|(x, y)| mask[y * camera.width as usize + x])
        };
        Ok(points.iter().map(is_seen).collect())
    };
    let seen: Vec<Vec<bool>> = split.views.par_iter().map(seen_in).collect::<Result<_, _>>()?;
    let normals = template.vertex_normals(&template.vertices);
    let roles = JointRole::of_joints(&template.joint_names);
    let mut parts: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    for (k, point) in points.iter().enumerate() {
        let weights = template.vertex_weights(point.corners[0] as usize);
        let strongest = (0..weights.len()).max_by(|a, b| weights[*a].total_cmp(&weights[*b])).unwrap_or(0);
        let is_back = point.mean_of(&normals).dot(directions.back) > 0.0;
        let name = part_name(roles.get(strongest).copied().flatten(), is_back);
        let [all, shown] = parts.entry(name).or_default();
        *all += 1;
        *shown += usize::from(seen.iter().any(|of_view| of_view[k]));
    }
    let share = |[all, shown]: [usize; 2]| shown as f64 / all as f64;
    Ok(parts.into_iter().map(|(name, counts)| (name, share(counts))).filter(|(_, seen)| *seen < LEAST_SEEN).collect())
}

/// The name of a part of the hand, by the joint that moves it and the side that it faces.
fn part_name(role: Option<JointRole>, is_back: bool) -> String {
    let finger = match role {
        Some(JointRole::Bend(finger, part)) if !(finger == Finger::Thumb && part == 1) => finger,
        Some(JointRole::Tip(finger)) => finger,
        _ if is_back => return "the back of the hand".into(),
        _ => return "the palm".into(),
    };
    let finger = match finger {
        Finger::Thumb => "thumb",
        Finger::Index => "index finger",
        Finger::Middle => "middle finger",
        Finger::Ring => "ring finger",
        Finger::Little => "little finger",
    };
    format!("the {finger}'s {}", if is_back { "back" } else { "palm side" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alignment::cameras::unknowns::Part;

    #[test]
    fn a_hole_in_a_mask_is_told_from_a_gap_between_fingers() {
        // A square ring around a hole of 4 x 4 pixels.
        let mask: Vec<bool> = (0..144)
            .map(|i| {
                let (x, y) = (i % 12, i / 12);
                (1..11).contains(&x) && (1..11).contains(&y) && !((4..8).contains(&x) && (4..8).contains(&y))
            })
            .collect();
        assert!(has_hole(&mask, &[true; 144], 12));
        // Where the template has no skin either, nothing is missing; nor at the border of the image.
        assert!(!has_hole(&mask, &mask, 12));
        let open: Vec<bool> = mask.iter().enumerate().map(|(i, inside)| *inside && i % 12 != 5).collect();
        assert!(!has_hole(&open, &[true; 144], 12));
    }

    #[test]
    fn what_is_unusual_is_said_apart() {
        let fit = |contours| MaskFit { contours, overlap: 0.9, mask_size: 100.0 };
        let usual = Review {
            frames: 12,
            fit: [fit([2.0, 6.0]), fit([0.5, 2.0])],
            rejection: None,
            size: 1.01,
            shift: 0.001,
            turn: 0.02,
            fingers: 0.05,
            masks: 24,
            masks_with_holes: 0,
            looked_at: 90,
            blurred: 8,
            unseen: vec![],
            calibration: None,
            time_offsets: vec![],
            odd_cameras: vec![],
        };
        assert_eq!(usual.sentences(), Vec::<String>::new());
        let all = Review {
            size: 0.92,
            shift: 0.012,
            masks_with_holes: 3,
            blurred: 9,
            unseen: vec![("the palm".into(), 0.04)],
            fit: [fit([4.0, 20.0]), fit([0.9, 9.0])],
            time_offsets: vec![TimeOffset { camera: "left".into(), frames: -0.3 }],
            calibration: Some(Calibration {
                parts: vec![Part::Extrinsics],
                changes: vec![],
                moved: vec!["top".into()],
                left_out: [0.3, 0.1],
            }),
            ..usual
        };
        let text = all.sentences().join("\n");
        for part in [
            "left seem to be taken 0.3 frames earlier",
            "position and direction, most of all of top",
            "by 0.70, 0.90 once",
            "8 % smaller",
            "12 mm beside",
            "3 of 24 masks have holes",
            "9 of 90 images are blurred",
            "the palm (4 % seen)",
            "more than 9 pixels",
        ] {
            assert!(text.contains(part), "{part:?} is missing in {text}");
        }
    }
}
