//! Cameras and frames whose masks the posed template fits much worse than the others', which a mean hides, and what would
//! make it fit.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use ghand_core::Camera;
use ghand_core::statistics::median;
use glam::DVec3;
use rayon::prelude::*;

use super::ViewFit;
use super::fit::given_template;
use super::overlap::iou;
use crate::capture::Capture;
use crate::mask::covered_pixels;

/// The template in a tracker's poses overlaps masks more than this, in the median over a camera's images.
const WELL: f64 = 0.7;
/// A camera or frame is unlike the others below this part of their median.
const UNLIKE: f64 = 0.6;
/// A cause is named if without it the template overlaps the masks at least this much, this much more, and by nearly as much
/// as those of the other cameras.
const EXPLAINED: f64 = 0.5;
const GAIN: f64 = 0.2;
const NEARLY: f64 = 0.85;
/// Images of a camera on which causes are tried.
const MOST_VIEWS: usize = 5;
/// A camera with more overlap than this is not late.
const SURE: f64 = 0.93;
/// Frames by which images are tried to be late or early.
const MOST_LATE: i32 = 3;
/// A camera is paired wrongly if it overlaps the template of another frame by this much more, in this part of at least so many images.
const LATE_GAIN: f64 = 0.025;
const LATE_PART: f64 = 0.75;
const LATE_VIEWS: usize = 4;
/// Other cameras that it is compared with.
const MOST_OTHERS: usize = 5;
/// Rates of images that are tried, percent of the poses'.
const RATES: [u32; 2] = [50, 200];
/// Cameras or frames with fewer others have none to be compared with.
const LEAST_OTHERS: usize = 2;

/// What is wrong with a camera.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cause {
    /// Its masks are 0 on the hand.
    Inverted,
    /// Its images are turned by half.
    Turned,
    /// Its images are mirrored, left for right.
    Mirrored,
    /// Its images are upside down, but not mirrored left for right.
    Flipped,
    /// Its intrinsics are those of images this many times as large, in percent.
    Scaled(u32),
    /// Its rotation is that from the camera to the world.
    Transposed,
    /// Its translation is the camera's place.
    Place,
    /// Its images are those of another camera.
    Swapped(usize),
    /// Its images show the poses of frames that are this much later.
    Late(i32),
    /// Its images have this many percent of the rate of the poses.
    Rate(u32),
    /// It is not known.
    Unknown,
}

/// A camera whose images the template does not fit.
#[derive(Debug)]
pub(super) struct WrongCamera {
    pub camera: usize,
    pub cause: Cause,
    /// Median overlap of its masks with the template, as it is and without the cause.
    pub overlap: [f64; 2],
}

/// The cameras that are wrong, and the median overlap of the others. A camera without a known cause counts only if others
/// fit.
pub(super) fn wrong_cameras(capture: &Capture, views: &[&ViewFit]) -> (Vec<WrongCamera>, f64) {
    let mut overlaps: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for (view, overlap) in views.iter().filter_map(|view| Some((view, view.iou_given?))) {
        overlaps.entry(view.camera).or_default().push(overlap);
    }
    let medians: BTreeMap<usize, f64> = overlaps.into_iter().map(|(camera, values)| (camera, median(values))).collect();
    let poor: Vec<usize> = medians.iter().filter(|(_, m)| **m < WELL).map(|(camera, _)| *camera).collect();
    let others = |except: &[usize]| -> Vec<f64> {
        medians.iter().filter(|(camera, _)| !except.contains(camera)).map(|(_, m)| *m).collect()
    };
    let hand = &Templates::of(capture);
    let mut wrong = vec![];
    for &camera in &poor {
        let overlap = medians.get(&camera).copied().unwrap_or_default();
        let seen = seen_by(capture, views, camera, MOST_VIEWS);
        let best = alternatives(capture, camera, &poor)
            .into_iter()
            .map(|cause| (median(seen.iter().filter_map(|seen| seen.fit(hand, camera, &cause))), cause))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let rest = others(&[camera]);
        let least = EXPLAINED.max(NEARLY * median(rest.clone())).max(overlap + GAIN);
        let explained = best.filter(|(fit, _)| *fit >= least);
        match explained {
            Some((fit, cause)) => wrong.push(WrongCamera { camera, cause, overlap: [overlap, fit] }),
            None if rest.len() >= LEAST_OTHERS && overlap < UNLIKE * median(rest) => {
                wrong.push(WrongCamera { camera, cause: Cause::Unknown, overlap: [overlap, overlap] });
            }
            None => {}
        }
    }
    let is_known = |camera: &usize| wrong.iter().any(|wrong| wrong.camera == *camera && wrong.cause != Cause::Unknown);
    let unsure: Vec<(usize, f64)> = medians
        .iter()
        .filter(|(camera, overlap)| **overlap < SURE && !is_known(camera))
        .map(|(camera, overlap)| (*camera, *overlap))
        .collect();
    let found: Vec<(usize, f64, Pairing)> = unsure
        .par_iter()
        .filter_map(|&(camera, overlap)| Some((camera, overlap, Pairing::of(hand, views, camera)?)))
        .collect();
    // Where the pose of a frame is off, another one may fit all cameras better: a fault of few cameras is one that others lack.
    let is_shared = |cause: &Cause| {
        let count = found.iter().filter(|(.., other)| other.cause == *cause).count();
        count >= 2 && 3 * count >= medians.len()
    };
    let paired: Vec<WrongCamera> = found
        .iter()
        .filter(|(camera, overlap, pairing)| {
            let others: Vec<usize> = medians.keys().copied().filter(|other| other != camera).collect();
            let is_own = || pairing.gain >= pairing.gain_of(hand, &others) + LATE_GAIN;
            pairing.fit >= overlap + LATE_GAIN && (is_shared(&pairing.cause) || is_own())
        })
        .map(|(camera, overlap, Pairing { cause, fit, .. })| WrongCamera {
            camera: *camera,
            cause: cause.clone(),
            overlap: [*overlap, *fit],
        })
        .collect();
    wrong.retain(|wrong| paired.iter().all(|other| other.camera != wrong.camera));
    wrong.extend(paired);
    let names: Vec<usize> = wrong.iter().map(|wrong| wrong.camera).collect();
    (wrong, median(others(&names)))
}

/// The frames of which most images fit much worse than the others of their cameras: one that looks along an error does not see it.
pub(super) fn wrong_frames(views: &[&ViewFit], wrong: &[WrongCamera]) -> Vec<usize> {
    let right = || {
        let known = views.iter().filter_map(|view| Some((view.camera, view.frame, view.iou_given?)));
        known.filter(|(camera, ..)| wrong.iter().all(|wrong| wrong.camera != *camera))
    };
    let mut of_camera: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    right().for_each(|(camera, _, overlap)| of_camera.entry(camera).or_default().push(overlap));
    let usual: BTreeMap<usize, f64> = of_camera
        .into_iter()
        .filter(|(_, values)| values.len() > LEAST_OTHERS)
        .map(|(camera, values)| (camera, median(values)))
        .collect();
    let mut of_frame: BTreeMap<usize, Vec<bool>> = BTreeMap::new();
    for (camera, frame, overlap) in right() {
        if let Some(usual) = usual.get(&camera) {
            of_frame.entry(frame).or_default().push(overlap < UNLIKE * usual);
        }
    }
    of_frame
        .into_iter()
        .filter(|(_, unlike)| 2 * unlike.iter().filter(|u| **u).count() > unlike.len())
        .map(|(frame, _)| frame)
        .collect()
}

fn alternatives(capture: &Capture, camera: usize, poor: &[usize]) -> Vec<Cause> {
    let Some(own) = capture.cameras.get(camera) else { return vec![] };
    // Where the principal point is in the middle of images of another size, that is the size.
    let middle = [own.principal.x / f64::from(own.width), own.principal.y / f64::from(own.height)];
    let by_middle = (100.0 * (middle[0] + middle[1])).round().clamp(10.0, 1000.0) as u32;
    let mut causes =
        vec![Cause::Inverted, Cause::Turned, Cause::Mirrored, Cause::Flipped, Cause::Transposed, Cause::Place];
    causes.extend([50, 200, by_middle].into_iter().filter(|percent| percent.abs_diff(100) > 10).map(Cause::Scaled));
    let same_size = |other: &&usize| {
        let other = capture.cameras.get(**other);
        other.is_some_and(|other| (other.width, other.height) == (own.width, own.height))
    };
    causes.extend(poor.iter().filter(|other| **other != camera).filter(same_size).map(|other| Cause::Swapped(*other)));
    causes
}

/// Some images of a camera, spread over its frames.
fn seen_by(capture: &Capture, views: &[&ViewFit], camera: usize, count: usize) -> Vec<Seen> {
    let frames: Vec<usize> = views.iter().filter(|view| view.camera == camera).map(|view| view.frame).collect();
    let step = frames.len().div_ceil(count).max(1);
    frames.iter().step_by(step).filter_map(|frame| Seen::of(capture, camera, *frame)).collect()
}

/// How a camera's images are paired with the wrong frames.
struct Pairing {
    cause: Cause,
    /// How much more the template of the right frames overlaps the masks, and how much it does: medians over frames.
    gain: f64,
    fit: f64,
    frames: Vec<usize>,
}

impl Pairing {
    fn of(hand: &Templates, views: &[&ViewFit], camera: usize) -> Option<Pairing> {
        let seen = seen_by(hand.capture, views, camera, 2 * LATE_VIEWS);
        let as_is: Vec<Option<f64>> = seen.iter().map(|seen| seen.fit(hand, camera, &Cause::Unknown)).collect();
        let late = (-MOST_LATE..=MOST_LATE).filter(|late| *late != 0).map(Cause::Late);
        let tried = late.chain(RATES.map(Cause::Rate)).filter_map(|cause| {
            let other = seen.iter().zip(&as_is).filter(|(seen, _)| seen.paired(&cause) != Some(seen.frame));
            let pairs: Vec<(usize, [f64; 2])> = other
                .filter_map(|(seen, as_is)| Some((seen.frame, [(*as_is)?, seen.fit(hand, camera, &cause)?])))
                .collect();
            let better = pairs.iter().filter(|(_, [a, b])| *b > a + LATE_GAIN / 2.0).count();
            let gain = median(pairs.iter().map(|(_, [a, b])| b - a));
            let fit = median(pairs.iter().map(|(_, [_, b])| *b));
            let is_better = better as f64 >= LATE_PART * pairs.len() as f64 && gain >= LATE_GAIN;
            let frames = pairs.iter().map(|(frame, _)| *frame).collect();
            (pairs.len() >= LATE_VIEWS && is_better && fit >= EXPLAINED).then_some(Pairing { cause, gain, fit, frames })
        });
        tried.max_by(|a, b| a.gain.total_cmp(&b.gain))
    }

    /// What the same would gain in other cameras: the median of some of them, in the same frames; 0 without any.
    fn gain_of(&self, hand: &Templates, others: &[usize]) -> f64 {
        let step = others.len().div_ceil(MOST_OTHERS).max(1);
        let gain_in = |camera: &usize| {
            let gains = self.frames.par_iter().filter_map(|frame| {
                let seen = Seen::of(hand.capture, *camera, *frame)?;
                Some(seen.fit(hand, *camera, &self.cause)? - seen.fit(hand, *camera, &Cause::Unknown)?)
            });
            let gains: Vec<f64> = gains.collect();
            (!gains.is_empty()).then(|| median(gains))
        };
        median(others.iter().step_by(step).filter_map(gain_in))
    }
}

/// The template in a capture's frames, in each of which it is posed once.
struct Templates<'a> {
    capture: &'a Capture,
    posed: Vec<OnceLock<Option<Vec<DVec3>>>>,
}

impl Templates<'_> {
    fn of(capture: &Capture) -> Templates<'_> {
        Templates { capture, posed: capture.frames.iter().map(|_| OnceLock::new()).collect() }
    }

    /// Its vertices in a frame, world, metres.
    fn vertices(&self, frame: usize) -> Option<&[DVec3]> {
        self.posed.get(frame)?.get_or_init(|| given_template(self.capture, frame).ok()).as_deref()
    }
}

/// The mask of an image.
struct Seen {
    frame: usize,
    mask: Vec<bool>,
}

impl Seen {
    fn of(capture: &Capture, camera: usize, frame: usize) -> Option<Seen> {
        Some(Seen { frame, mask: capture.load_hand_mask(camera, frame).ok()? })
    }

    /// The frame whose pose the image shows if the camera has this fault.
    fn paired(&self, cause: &Cause) -> Option<usize> {
        match cause {
            Cause::Late(late) => self.frame.checked_add_signed(*late as isize),
            Cause::Rate(percent) => Some((self.frame as f64 * 100.0 / f64::from(*percent)).round() as usize),
            _ => Some(self.frame),
        }
    }

    /// How well the template overlaps the mask if the camera has this fault, which is undone.
    fn fit(&self, hand: &Templates, camera: usize, cause: &Cause) -> Option<f64> {
        let capture = hand.capture;
        let own = capture.cameras.get(camera)?;
        let width = own.width as usize;
        let mut mask = self.mask.clone();
        let rows = |mask: &mut Vec<bool>| mask.chunks_mut(width.max(1)).for_each(<[bool]>::reverse);
        let mut seen_by = own.clone();
        match cause {
            Cause::Inverted => mask.iter_mut().for_each(|inside| *inside = !*inside),
            Cause::Turned => mask.reverse(),
            Cause::Mirrored => rows(&mut mask),
            Cause::Flipped => {
                mask.reverse();
                rows(&mut mask);
            }
            Cause::Scaled(percent) => {
                let factor = f64::from(*percent) / 100.0;
                seen_by = Camera { focal: own.focal / factor, principal: own.principal / factor, ..seen_by };
            }
            Cause::Transposed => seen_by = Camera { rotation: own.rotation.transpose(), ..seen_by },
            Cause::Place => seen_by = Camera { translation: -(own.rotation * own.translation), ..seen_by },
            Cause::Swapped(other) => seen_by = capture.cameras.get(*other)?.clone(),
            Cause::Late(_) | Cause::Rate(_) | Cause::Unknown => {}
        }
        let vertices = hand.vertices(self.paired(cause)?)?;
        iou(&mask, &covered_pixels(&seen_by, vertices, &capture.hand_model.faces))
    }
}
