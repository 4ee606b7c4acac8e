//! Problems and oddities of a capture.

use std::f64::consts::TAU;
use std::fmt;

use ghand_core::Pose;
use ghand_core::posing::pose_hand;
use glam::DVec3;

use super::misfits::{Cause, WrongCamera, wrong_cameras, wrong_frames};
use super::outlines::images_and_masks;
use super::{CaptureInspection, SplitFacts, Spread, ViewFit};
use crate::capture::Capture;
use crate::images::mask_values::MaskSort;
use crate::mask::{MadeMasks, MaskMethod};

/// A template that overlaps the masks less than this may use another convention for poses or cameras than the capture:
/// noise of four degrees in every joint gives a mean of 0.8, transposed rotations, with cameras all around a hand, 0.5
/// to 0.6.
const LEAST_IOU: f64 = 0.7;
/// A template that overlaps the masks less than this is elsewhere: translations in millimetres give 0, and training,
/// which moves a hand by millimetres, cannot recover. Even a hand beside the right position, or a transposed rotation,
/// has more.
const HOPELESS_IOU: f64 = 0.1;
/// Plausible distances between cameras and a hand, metres: from a lens that nearly touches it to the far end of a hall.
const DISTANCES: std::ops::Range<f64> = 0.03..20.0;
/// Fraction of a split's images that must have a fault for training to be pointless. Some images of a good capture may
/// have it, such as when the hand leaves a camera's view.
const NEARLY_ALL: f64 = 0.9;
/// Fraction of the cameras that must have a fault for training to be pointless.
const MOST_CAMERAS: f64 = 0.5;
/// If more than this fraction of the joint rotations are longer than a whole turn, poses are in degrees. Few rotations
/// of a pose are zero, and most exceed 6.3 degrees; in radians, none exceeds a whole turn.
const DEGREES: f64 = 0.1;
/// Images, and hands, whose largest value is below this are black.
const LEAST_BRIGHTNESS: u8 = 20;
/// Images whose values differ by no more than this have one colour: lossy compression makes such differences.
const MOST_OF_ONE_COLOR: u8 = 2;
/// Most names in a list; further ones are counted.
const MOST_NAMES: usize = 5;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Unusual; the avatar may still be good.
    Odd,
    /// Training on this cannot give an avatar.
    Pointless,
}

/// A problem or oddity of a capture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// Description with consequence or cause: a sentence without its full stop.
    pub text: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// All findings.
pub(super) fn findings(capture: &Capture, found: &CaptureInspection) -> Vec<Finding> {
    [
        cameras(capture, found),
        poses(capture, found),
        shapes(capture, found),
        images(capture, found),
        masks(capture, found),
        images_and_masks(capture, &views(found).collect::<Vec<_>>()),
        fits(capture, found),
    ]
    .concat()
}

pub(super) fn finding(is_pointless: bool, text: String) -> Finding {
    Finding { severity: if is_pointless { Severity::Pointless } else { Severity::Odd }, text }
}

/// The views of all splits that are not part of others.
fn views(found: &CaptureInspection) -> impl Iterator<Item = &ViewFit> {
    found.splits.iter().filter(|split| !split.is_part).flat_map(|split| &split.views)
}

/// A finding about the views with a fault, if there are any: pointless if nearly all of a split have it. Only `of`
/// views count.
fn faulty(
    found: &CaptureInspection,
    of: impl Fn(&ViewFit) -> bool,
    has_fault: impl Fn(&ViewFit) -> bool,
    text: impl FnOnce(usize, usize) -> String,
) -> Option<Finding> {
    let count = |split: &SplitFacts| {
        let views = || split.views.iter().filter(|view| of(view));
        (views().filter(|view| has_fault(view)).count(), views().count())
    };
    let counts: Vec<(usize, usize)> = found.splits.iter().filter(|split| !split.is_part).map(count).collect();
    let (faulty, all) = counts.iter().fold((0, 0), |sum, counts| (sum.0 + counts.0, sum.1 + counts.1));
    let is_pointless = counts.iter().any(|(faulty, all)| *faulty > 0 && *faulty as f64 >= NEARLY_ALL * *all as f64);
    (faulty > 0).then(|| finding(is_pointless, text(faulty, all)))
}

fn images(capture: &Capture, found: &CaptureInspection) -> Vec<Finding> {
    let files = &found.files;
    if files.images == 0 {
        return vec![finding(true, "the splits have no images; list their cameras and frames".into())];
    }
    if !found.has_usable_image() {
        let text = format!(
            "none of the {} images can be used ({} files are missing, {} broken); check that paths, cameras and files \
             match{}",
            files.images,
            files.missing,
            files.broken,
            files.problems.first().map_or(String::new(), |problem| format!(": {}", problem.reason))
        );
        return vec![finding(true, text)];
    }
    let dark = faulty(
        found,
        |_| true,
        |view| view.brightest < LEAST_BRIGHTNESS,
        |dark, all| format!("{dark} of {all} images, or their hands, are black; export them again with enough light"),
    );
    let flat = faulty(
        found,
        |view| view.brightest >= LEAST_BRIGHTNESS,
        |view| view.contrast <= MOST_OF_ONE_COLOR,
        |flat, all| format!("{flat} of {all} images have a single colour; export them again"),
    );
    let others: Vec<[u8; 3]> = views(found).filter_map(|view| view.other_background).collect();
    let all = views(found).count();
    let background = (others.len() as f64 >= NEARLY_ALL * all as f64).then(|| others.first().copied()).flatten();
    let background = background.map(|color| {
        let [shown, said] = [color.map(|v| f64::from(v) / 255.0), capture.background];
        let of = |[r, g, b]: [f64; 3]| format!("[{r:.2}, {g:.2}, {b:.2}]");
        let text = format!(
            "the images are {} beside the hand, but `background` is {}: edges of the hand are mixed with the first; \
             set `background` to it",
            of(shown),
            of(said)
        );
        finding(false, text)
    });
    let holes = views(found).filter(|view| view.nan_pixels > 0).count();
    let holes = (holes > 0).then(|| {
        let all = views(found).count();
        finding(false, format!("{holes} of {all} images have NaN pixels, which count as black"))
    });
    [dark, flat, background, holes].into_iter().flatten().collect()
}

fn masks(capture: &Capture, found: &CaptureInspection) -> Vec<Finding> {
    let mut findings = vec![];
    let checked = views(found).count();
    let without = views(found).filter(|view| view.coverage.is_none()).count();
    if without > 0 {
        let text = format!(
            "{without} of {checked} images have no mask; the hand may be anywhere in them, and the background counts \
             as hand"
        );
        findings.push(finding(false, text));
    }
    let has_mask = |view: &ViewFit| view.coverage.is_some();
    findings.extend(faulty(
        found,
        has_mask,
        |view| view.coverage == Some(0.0) && view.mask_sort == MaskSort::Usual,
        |empty, all| {
            format!("{empty} of {all} masks are empty; a mask is at least 128 on the hand and below elsewhere")
        },
    ));
    findings.extend(faulty(
        found,
        has_mask,
        |view| view.coverage == Some(1.0) && view.mask_sort == MaskSort::Usual,
        |full, all| format!("{full} of {all} masks are full; a mask is at least 128 on the hand and below elsewhere"),
    ));
    findings.extend(values_of_masks(found));
    findings.extend(second_hands(found));
    let made = found.files.made_masks;
    if made > 0 {
        let by_colors = |made: &MadeMasks| made.method == MaskMethod::Colors;
        let how = if capture.images.made_masks.as_ref().is_some_and(by_colors) {
            "from colours near the posed hand"
        } else {
            "from the posed hand, so they always match it"
        };
        let text =
            format!("{made} of {} masks have no file and are made {how}; check the pictures", found.files.images);
        findings.push(finding(false, text));
    }
    findings
}

/// Masks whose files do not have 255 on the hand and 0 elsewhere.
fn values_of_masks(found: &CaptureInspection) -> Vec<Finding> {
    let mut sorts: Vec<MaskSort> = views(found).map(|view| view.mask_sort).collect();
    sorts.sort_unstable();
    sorts.dedup();
    let text = |sort: MaskSort| {
        Some(match sort {
            MaskSort::Usual => return None,
            MaskSort::Low(value) => (false, format!("have 0 and {value} instead of 0 and 255; {value} counts as hand")),
            MaskSort::Alpha => (false, "are black all over; their alpha channel counts as mask".into()),
            MaskSort::Labels(value) => (
                true,
                format!(
                    "are labels from 0 to {value}, which do not say which is the hand; make it 255 and all others 0"
                ),
            ),
            MaskSort::High(value) => (
                true,
                format!(
                    "are nowhere below {value}, so that all of the image is hand; make the hand 255 and the rest 0"
                ),
            ),
            MaskSort::Photo => (
                true,
                "are photographs and not masks; check `mask_path`: a mask is 255 on the hand and 0 elsewhere".into(),
            ),
        })
    };
    let of_sort = |sort: MaskSort| {
        let (is_unusable, text) = text(sort)?;
        let said = faulty(
            found,
            |view| view.coverage.is_some(),
            |view| view.mask_sort == sort,
            |some, all| format!("{some} of {all} masks {text}"),
        )?;
        Some(if is_unusable { said } else { finding(false, said.text) })
    };
    sorts.into_iter().filter_map(of_sort).collect()
}

/// A part of masks apart from the posed template, of at least this fraction of the mask, is another hand or a thing.
const OTHER_PART: f64 = 0.2;
/// Part of the images that must show it.
const OTHER_IMAGES: f64 = 0.25;

/// Masks that show a second hand, of which the template is none.
fn second_hands(found: &CaptureInspection) -> Option<Finding> {
    let has_other = views(found).filter(|view| view.other_part > OTHER_PART);
    let parts: Vec<f64> = has_other.map(|view| view.other_part).collect();
    let all = views(found).filter(|view| view.coverage.is_some()).count();
    let mean = parts.iter().sum::<f64>() / parts.len().max(1) as f64;
    let count = parts.len();
    (count as f64 > OTHER_IMAGES * all as f64).then(|| {
        let text = format!(
            "the masks of {count} of {all} images show something apart from the posed hand, {:.0} % of the mask: a second hand \
             or a thing; keep only the hand that is captured in the masks",
            100.0 * mean
        );
        finding(false, text)
    })
}

/// Templates of one person differ by no more than this part in size.
const SAME_SIZE: f64 = 0.02;
/// Most frames whose shapes are compared.
const MOST_SHAPES: usize = 64;

/// Frames whose shapes make hands of different sizes.
fn shapes(capture: &Capture, found: &CaptureInspection) -> Vec<Finding> {
    let step = found.posed_frames.len().div_ceil(MOST_SHAPES).max(1);
    let frames = found.posed_frames.iter().step_by(step).filter_map(|frame| capture.frames.get(*frame));
    let size = |shape: &[f64]| {
        let rest = Pose::rest(capture.hand_model.joint_count());
        let vertices = pose_hand(&capture.hand_model, shape, &rest).ok()?.vertices;
        let low = vertices.iter().copied().reduce(DVec3::min)?;
        Some((vertices.iter().copied().reduce(DVec3::max)? - low).length())
    };
    let mut known: Vec<(&[f64], f64)> = vec![];
    for frame in frames {
        if known.iter().all(|(shape, _)| *shape != frame.shape.as_slice())
            && let Some(size) = size(&frame.shape)
        {
            known.push((&frame.shape, size));
        }
    }
    let Some(sizes) = Spread::of(known.iter().map(|(_, size)| *size)) else { return vec![] };
    if sizes.max <= sizes.min * (1.0 + SAME_SIZE) {
        return vec![];
    }
    let [low, high] = [sizes.min, sizes.max].map(|size| 1000.0 * size);
    let text = format!(
        "the frames' shapes make hands from {low:.0} to {high:.0} mm long; one person's hand has one size: give all frames the \
         same `shape`, such as the median"
    );
    vec![finding(false, text)]
}

fn cameras(capture: &Capture, found: &CaptureInspection) -> Vec<Finding> {
    let mut findings = vec![];
    let used = || capture.cameras.iter().zip(&found.cameras).filter(|(_, facts)| facts.images > 0);
    let are_most = |ids: &[&str]| ids.len() as f64 > MOST_CAMERAS * used().count() as f64;
    let behind: Vec<&str> = used().filter(|(_, f)| !f.in_front).map(|(camera, _)| camera.id.as_str()).collect();
    if !behind.is_empty() {
        let text = format!(
            "the hand is behind {} of {} cameras ({}); their rotation may be transposed or look along -z",
            behind.len(),
            used().count(),
            names(&behind)
        );
        findings.push(finding(are_most(&behind), text));
    }
    let odd: Vec<&str> =
        used().filter(|(_, f)| !DISTANCES.contains(&f.distance)).map(|(camera, _)| camera.id.as_str()).collect();
    if !odd.is_empty() {
        let text = format!(
            "{} of {} cameras are not between {} and {} m from the hand ({}); {}",
            odd.len(),
            used().count(),
            DISTANCES.start,
            DISTANCES.end,
            names(&odd),
            unit_of(used().map(|(_, facts)| facts.distance))
        );
        findings.push(finding(are_most(&odd), text));
    }
    findings
}

/// Distances at which hands are filmed, metres.
const USUAL_DISTANCES: std::ops::Range<f64> = 0.15..4.0;

/// The unit that cameras at these distances from the hand may have.
fn unit_of(distances: impl Iterator<Item = f64>) -> String {
    let mut distances: Vec<f64> = distances.filter(|distance| distance.is_finite()).collect();
    distances.sort_by(f64::total_cmp);
    let middle = distances.get(distances.len() / 2).copied().unwrap_or(0.0);
    let units = [(1000.0, "millimetres"), (100.0, "centimetres")];
    match units.iter().find(|(factor, _)| USUAL_DISTANCES.contains(&(middle / factor))) {
        Some((factor, name)) => format!(
            "their translations seem to be {name}: divide them by {factor}, or give the poses' translations in metres, too"
        ),
        None => "a unit may not be the metre".into(),
    }
}

/// Rotations that are longer than a whole turn.
fn poses(capture: &Capture, found: &CaptureInspection) -> Vec<Finding> {
    let rotations = || {
        let frames = found.posed_frames.iter().filter_map(|frame| capture.frames.get(*frame));
        frames.flat_map(|frame| &frame.pose.rotations)
    };
    let long = rotations().filter(|rotation| rotation.length() > TAU).count();
    let all = rotations().count();
    if long == 0 {
        return vec![];
    }
    let text = format!(
        "{long} of {all} joint rotations are longer than a whole turn (2 pi); poses must be axis-angle in radians, but \
         may be in degrees here"
    );
    vec![finding(long as f64 >= DEGREES * all as f64, text)]
}

/// Cameras and frames that the template fits much worse than others, and whether the cause is known.
fn misfits(capture: &Capture, found: &CaptureInspection) -> Vec<(bool, Finding)> {
    let views: Vec<&ViewFit> = views(found).collect();
    let (wrong, others) = wrong_cameras(capture, &views);
    let name = |camera: usize| capture.cameras.get(camera).map_or("", |camera| camera.id.as_str());
    let used = found.cameras.iter().filter(|facts| facts.images > 0).count();
    let mut causes: Vec<&Cause> = wrong.iter().map(|wrong| &wrong.cause).collect();
    causes.sort();
    causes.dedup();
    let of_cause = |cause: &Cause| {
        let of: Vec<&WrongCamera> = wrong.iter().filter(|wrong| wrong.cause == *cause).collect();
        let count = of.len();
        let cameras = names(&of.iter().map(|wrong| name(wrong.camera)).collect::<Vec<_>>());
        let [as_is, without] = [0, 1].map(|k| of.iter().map(|wrong| wrong.overlap[k]).sum::<f64>() / count as f64);
        let what = match cause {
            Cause::Inverted => "the masks are 0 on the hand and not elsewhere".to_owned(),
            Cause::Turned => "the images are turned by 180 degrees".to_owned(),
            Cause::Mirrored => "the images are mirrored, left for right".to_owned(),
            Cause::Flipped => "the images are mirrored, top for bottom".to_owned(),
            Cause::Scaled(percent) => {
                format!("the intrinsics are those of images {:.2} times as large", f64::from(*percent) / 100.0)
            }
            Cause::Transposed => "`rotation` is world_from_camera, and must be transposed,".to_owned(),
            Cause::Place => "`translation` is the camera's place c, and must be -R c,".to_owned(),
            Cause::Swapped(other) => format!("the images are those of {}", name(*other)),
            Cause::Late(late) => {
                let count = late.unsigned_abs();
                let which = if *late > 0 { "later" } else { "earlier" };
                let s = if count == 1 { "" } else { "s" };
                format!("the masks show the poses of {count} frame{s} {which}")
            }
            Cause::Rate(percent) => format!(
                "the images have {:.2} times the rate of the poses: pair each image with the frame of its time",
                f64::from(*percent) / 100.0
            ),
            Cause::Unknown => {
                let text = format!(
                    "the posed template hardly matches the masks of {count} of {used} cameras ({cameras}; overlap \
                     {as_is:.2}), but those of the others ({others:.2}); their calibration, images or masks are wrong"
                );
                return (false, finding(false, text));
            }
        };
        let text = format!(
            "{what} in {count} of {used} cameras ({cameras}): the posed template overlaps the masks by {as_is:.2}, and by \
             {without:.2} without that"
        );
        (true, finding(count as f64 > MOST_CAMERAS * used as f64, text))
    };
    let mut findings: Vec<(bool, Finding)> = causes.into_iter().map(of_cause).collect();
    let frames = wrong_frames(&views, &wrong);
    if !frames.is_empty() {
        let ids: Vec<&str> =
            frames.iter().filter_map(|frame| capture.frames.get(*frame)).map(|frame| frame.id.as_str()).collect();
        let text = format!(
            "the posed template matches the masks of {} frames ({}) much worse than the others; their poses or images are \
             wrong",
            ids.len(),
            names(&ids)
        );
        findings.push((false, finding(false, text)));
    }
    findings
}

pub(super) fn names(ids: &[&str]) -> String {
    let more = ids.len().saturating_sub(MOST_NAMES);
    let shown = ids.get(..MOST_NAMES).unwrap_or(ids).join(", ");
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}

fn fits(capture: &Capture, found: &CaptureInspection) -> Vec<Finding> {
    let outside = faulty(
        found,
        |_| true,
        |view| !view.shows_template,
        |outside, all| {
            format!("the posed template is outside {outside} of {all} images; cameras, poses or units are wrong")
        },
    );
    let worse_than = |most: f64, least: f64| {
        let poor = found.splits.iter().filter(|split| !split.is_part).filter_map(move |split| {
            let mean = split.iou_given()?.mean;
            // NaN counts as poor, too.
            let is_poor = (least..most).contains(&mean) || (mean.is_nan() && least == 0.0);
            is_poor.then(|| format!("{} ({mean:.2})", split.name))
        });
        poor.collect::<Vec<_>>().join(", ")
    };
    let text = |how: &str, splits: String| {
        format!(
            "the posed template matches the masks of {splits} {how} (mean IoU); an axis, a rotation, a unit or the \
             side of the hand may be wrong"
        )
    };
    let misfits = misfits(capture, found);
    // A poor mean has its reason then.
    let is_explained = misfits.iter().any(|(is_known, _)| *is_known);
    let unless_explained = |splits: String| Some(splits).filter(|splits| !splits.is_empty() && !is_explained);
    let hopeless = unless_explained(worse_than(HOPELESS_IOU, 0.0));
    let poor = unless_explained(worse_than(LEAST_IOU, HOPELESS_IOU));
    let of_mean = [
        // It is normal for a hand to leave some cameras' view.
        outside.filter(|outside| outside.severity == Severity::Pointless),
        hopeless.map(|splits| finding(true, text("hardly or not at all", splits))),
        poor.map(|splits| finding(false, text("poorly", splits))),
    ];
    of_mean.into_iter().flatten().chain(misfits.into_iter().map(|(_, finding)| finding)).collect()
}
