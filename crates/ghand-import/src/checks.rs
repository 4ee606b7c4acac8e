//! What of footage cannot be used, or should be known.

use ghand_core::statistics::median;
use ghand_core::{Camera, Side};
use glam::DVec3;

use crate::ImportError;
use crate::choice::Choice;
use crate::landmarks::Tracked;
use crate::solve::{Known, Solved};
use crate::sources::Source;
use crate::track::Track;
use crate::uneven::UnevenClock;

/// Fewer frames with the hand than this are not worth an import.
const LEAST_FRAMES: usize = 5;
/// A hand in less than this part of the frames is told.
const FEW_FRAMES: f64 = 0.5;
/// A second hand in more than this part of the frames is told.
const OTHER_HAND: f64 = 0.1;
/// A camera whose images shift by less than this stands still, and one of more moves; relative to their width.
const STILL: f64 = 0.01;
const MOVING: f64 = 0.04;
/// Cameras whose directions from the hand differ by less, radians, show the same.
const LEAST_ANGLE: f64 = 0.05;
/// Landmarks are at most so far off the hand, relative to its length; beyond the second bound they are not one hand's.
const USUAL_ERROR: f64 = 0.03;
const MOST_ERROR: f64 = 0.045;
/// A camera whose landmarks are further off than this, and so many times as far as those of the others, sees something else.
const ODD_ERROR: f64 = 0.09;
const ODD_FACTOR: f64 = 3.0;

/// Where cameras come from, for the causes and remedies of what is wrong with them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A calibration that is given.
    Given,
    /// A board in the footage.
    Board,
    /// The hand itself.
    Hand,
}

impl Origin {
    /// Of cameras of which this was known.
    pub fn of(is_board: bool, known: Known) -> Origin {
        match known {
            _ if is_board => Origin::Board,
            Known::Nothing => Origin::Hand,
            _ => Origin::Given,
        }
    }
}

/// The side of the hand that is imported.
pub fn side(
    sources: &[Source],
    tracked: &[Tracked],
    wanted: Option<Side>,
    remarks: &mut Vec<String>,
) -> Result<Side, ImportError> {
    let count = |k: usize| tracked.iter().map(|tracked| tracked.hands.by_side[k]).sum::<usize>();
    let [right, left] = [count(0), count(1)];
    let side = wanted.unwrap_or(if left > right { Side::Left } else { Side::Right });
    let [own, other] = if side == Side::Right { [right, left] } else { [left, right] };
    if own == 0 {
        let problem = if other > 0 {
            let shown = side.other();
            format!("shows only a {shown} hand; give --side {shown}, or omit it")
        } else {
            // Its networks know the colours of skin: not those of a glove.
            "shows no hand that can be recognised; film the whole hand, bare, near and in good light, or give its landmarks \
             with --landmarks"
                .into()
        };
        return Err(ImportError::Unusable(format!("{}: {problem}", sources[0].footage.path().display())));
    }
    if wanted.is_none() && other as f64 > OTHER_HAND * own as f64 {
        remarks.push(format!(
            "the {side} hand is imported, which {own} images show; {other} also show another one: --side takes it"
        ));
    }
    for (source, tracked) in sources.iter().zip(tracked) {
        if tracked.missing > 0 {
            remarks.push(format!("{}: {} frames could not be decoded", source.id, tracked.missing));
        }
        if tracked.hands.with_same_side as f64 > OTHER_HAND * tracked.hands.with_hand as f64 {
            remarks.push(format!(
                "{}: {} of its frames show two hands of the same side; the one that is nearer to that of the frame before \
                 is taken",
                source.id, tracked.hands.with_same_side
            ));
        }
    }
    Ok(side)
}

/// Whether the hand is in the footage of each camera.
///
/// # Errors
/// If it is not.
pub fn check_tracks(
    sources: &[Source],
    tracked: &[Tracked],
    tracks: &[Track],
    side: Side,
    remarks: &mut Vec<String>,
) -> Result<(), ImportError> {
    for ((source, tracked), track) in sources.iter().zip(tracked).zip(tracks) {
        let (found, all) = (track.found(), track.sightings.len());
        let path = source.footage.path().display();
        let [right, left] = tracked.hands.by_side;
        let [other, other_side] = match side {
            Side::Right => [left, 1],
            Side::Left => [right, 0],
        };
        if found < LEAST_FRAMES && other >= LEAST_FRAMES {
            let [own, other] = if other_side == 1 { ["right", "left"] } else { ["left", "right"] };
            return Err(ImportError::Unusable(format!(
                "{path}: shows a {other} hand, but the {own} one is imported; webcams' programs often mirror what they \
                 record: give the footage as the camera saw it, or --side {other} if it is that hand"
            )));
        }
        if found < LEAST_FRAMES {
            return Err(ImportError::Unusable(format!(
                "{path}: the hand is found in {found} of {all} frames, at least {LEAST_FRAMES} are needed; film the whole \
                 hand, near and in good light"
            )));
        }
        if (found as f64) < FEW_FRAMES * all as f64 {
            remarks.push(format!("{}: the hand is found in {found} of {all} frames only", source.id));
        }
    }
    Ok(())
}

/// Whether cameras that must stand still do. A single one may move: the hand then moves before it.
///
/// # Errors
/// If one of several moves.
pub fn check_still(sources: &[Source], tracked: &[Tracked], remarks: &mut Vec<String>) -> Result<(), ImportError> {
    for (source, Tracked { hands, .. }) in sources.iter().zip(tracked) {
        let shift = format!(
            "{}: the camera moves: what is behind the hand shifts by up to {:.0} % of the image's width",
            source.id,
            1e2 * hands.shift
        );
        match sources.len() {
            _ if hands.shift < STILL => {}
            1 => remarks.push(format!("{shift}; the light is taken to move with it")),
            _ if hands.shift < MOVING => remarks.push(format!("{shift}; fix it, or poses and cameras are less exact")),
            _ => {
                return Err(ImportError::Unusable(format!(
                    "{shift}; of several cameras all must stand still: fix them, or import this footage alone"
                )));
            }
        }
    }
    Ok(())
}

/// Whether two cameras at least see the hand from different sides.
///
/// # Errors
/// If none do.
pub fn check_sides(sources: &[Source], cameras: &[Camera], hand: DVec3) -> Result<(), ImportError> {
    let [first, others @ ..] = cameras else { return Ok(()) };
    let from = |camera: &Camera| camera.center() - hand;
    let angle = |camera: &Camera| from(first).angle_between(from(camera));
    let widest = others.iter().map(angle).fold(0.0, f64::max);
    if others.is_empty() || widest > LEAST_ANGLE {
        return Ok(());
    }
    let names: Vec<&str> = sources.iter().map(|source| source.id.as_str()).collect();
    Err(ImportError::Unusable(format!(
        "{}: show the hand from the same side, {:.1} degrees apart; is it the same footage twice? Otherwise move the cameras \
         apart, by 30 degrees or more",
        names.join(", "),
        widest.to_degrees()
    )))
}

/// Whether landmarks of all cameras are those of one hand: `errors` are how far they are off it in each frame, relative to
/// the hand's length.
///
/// # Errors
/// If they are not.
pub fn check_fit(errors: &[f64], origin: Origin, remarks: &mut Vec<String>) -> Result<(), ImportError> {
    let mut errors = errors.to_vec();
    errors.sort_by(f64::total_cmp);
    let error = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
    if error < USUAL_ERROR {
        return Ok(());
    }
    let off = format!("landmarks are off the hand by {:.0} % of its length (median), usually by 1 to 2 %", 1e2 * error);
    let same = "they do not show the same hand at the same time";
    let [cause, remedy] = match origin {
        Origin::Hand => {
            ["cameras moved", "film again with cameras that stand still, and give their footage of the same time"]
        }
        Origin::Board => {
            ["cameras moved after they saw the board", "film board and hand again without touching the cameras"]
        }
        Origin::Given => [
            "the calibration is not of these cameras, in this order and at this resolution",
            "give the right one, or import without --cameras",
        ],
    };
    if error < MOST_ERROR {
        remarks.push(format!("{off}: {cause}, or {same}"));
        return Ok(());
    }
    Err(ImportError::Unusable(format!("{off}: {cause}, or {same}; {remedy}")))
}

/// Whether no camera contradicts the others: `errors` are how far landmarks are off the hand, relative to its length, by camera.
/// Of two, nobody can tell which one is wrong: [`check_fit`] names both.
///
/// # Errors
/// If one does.
pub fn check_cameras(ids: &[&str], errors: &[Option<f64>], origin: Origin) -> Result<(), ImportError> {
    let of_others = |camera: usize| {
        let others: Vec<f64> = (0..errors.len()).filter(|k| *k != camera).filter_map(|k| errors[k]).collect();
        (others.len() > 1).then(|| median(others))
    };
    for (camera, id) in ids.iter().enumerate() {
        let (Some(own), Some(others)) = (errors[camera], of_others(camera)) else { continue };
        if own < ODD_ERROR || own < ODD_FACTOR * others {
            continue;
        }
        let cause = match origin {
            Origin::Hand => "it moved, or it shows another hand or another time",
            Origin::Board => "it moved after it saw the board, or it shows another hand or another time",
            Origin::Given => "its calibration is wrong, or it shows another hand or another time",
        };
        return Err(ImportError::Unusable(format!(
            "{id}: its landmarks are off the hand that the other cameras see by {:.0} % of the hand's length (median), those \
             of the others by {:.0} %: {cause}; mend that, or leave this camera out",
            1e2 * own,
            1e2 * others
        )));
    }
    Ok(())
}

/// Why a hand is `length` metres long by cameras whose unit is the metre.
pub fn wrong_size(length: f64, origin: Origin) -> ImportError {
    let cause = match origin {
        Origin::Board => "the side of the board's squares is another than --board says",
        Origin::Given | Origin::Hand => "their unit of length is not the metre, or they are other cameras",
    };
    ImportError::Unusable(format!(
        "by these cameras the hand is {length:.3} m long, from the wrist to the tip of the middle finger: {cause}"
    ))
}

/// What a single camera's focal length was taken from, if only from what is usual.
pub fn guessed_focal(source: &Source) -> Option<String> {
    source.footage.stated_focal().is_none().then(|| {
        "one camera does not tell its focal length: that of most cameras is taken; --cameras gives a calibration".into()
    })
}

/// What the user should know of the cameras' clocks.
pub fn clock_remarks(sources: &[Source], solved: &Solved, uneven: &[UnevenClock]) -> Vec<String> {
    let first = &sources[0].id;
    let of_uneven = |clock: &UnevenClock| {
        let lost = if clock.uneven > 0.0 {
            format!(", and its frames are uneven by up to {:.0} ms: some are lost", 1e3 * clock.uneven)
        } else {
            String::new()
        };
        let id = &sources[clock.camera].id;
        let fast = 1e3 * clock.fast;
        format!("{id}: its clock gains {fast:+.1} ms in a second on that of {first}{lost}; times are corrected")
    };
    let untold = |(k, source): (usize, &Source)| {
        format!(
            "{}: the hand's movements agree too little with those in {first} to tell its clock; as if both were started \
             together, landmarks then tell {:+.3} s: look whether the images of a frame show the same moment",
            source.id, solved.rig.offsets[k]
        )
    };
    let unclear = sources.iter().enumerate().skip(1).filter(|(k, _)| solved.clocks[*k].is_none()).map(untold);
    uneven.iter().map(of_uneven).chain(unclear).collect()
}

/// Why a camera cannot be placed.
pub fn too_little_in_common(id: &str, known: Known) -> ImportError {
    let remedy = if known == Known::Nothing { ", or give --cameras" } else { "" };
    ImportError::Unusable(format!(
        "{id}: sees the hand at too few moments at which another camera sees it, too; film so that all cameras see the hand \
         for some seconds at the same time{remedy}"
    ))
}

/// Whether enough frames of `count` could be chosen.
///
/// # Errors
/// If not, with the reasons.
pub fn check_choice(choice: &Choice, count: usize) -> Result<(), ImportError> {
    let chosen = choice.train.len() + choice.test.len();
    if chosen >= LEAST_FRAMES {
        return Ok(());
    }
    let reasons: Vec<String> = choice.rejected.iter().map(|(reason, count)| format!("{reason} ({count})")).collect();
    let reasons = if reasons.is_empty() { "the others show the same".into() } else { reasons.join(", ") };
    Err(ImportError::Unusable(format!(
        "only {chosen} of {count} frames with the hand can be used ({reasons}); film for longer, the hand slowly, in more light \
         and whole in all images"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_contradicts_the_others_is_named_with_its_cause() {
        let ids = ["a", "b", "c"];
        let check = |errors: &[Option<f64>], origin| check_cameras(&ids[..errors.len()], errors, origin);
        for fine in [
            &[Some(0.015), Some(0.02), Some(0.03)][..],
            // All are bad alike, or one of two, or a camera saw nothing.
            &[Some(0.1), Some(0.09), Some(0.12)],
            &[Some(0.01), Some(0.4)],
            &[Some(0.01), None, Some(0.02)],
        ] {
            assert!(check(fine, Origin::Given).is_ok(), "{fine:?}");
        }
        for (origin, cause) in
            [(Origin::Given, "calibration"), (Origin::Hand, "another time"), (Origin::Board, "after it saw the board")]
        {
            let told = check(&[Some(0.02), Some(0.02), Some(0.4)], origin).unwrap_err().to_string();
            assert!(told.starts_with("c: ") && told.contains("40 %") && told.contains(cause), "{told}");
        }
    }
}
