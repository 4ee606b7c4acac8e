//! What is odd about a capture.

use super::CaptureInspection;
use crate::capture::Capture;

/// A template that meets the masks less than this may be posed, or seen, in another way than the capture means: noise of four
/// degrees in every joint leaves a mean of 0.8, a transposed rotation, where cameras stand all around a hand, 0.5 to 0.6.
const LEAST_IOU: f64 = 0.7;
/// Distances between cameras and a hand, metres: from a lens that nearly touches it to the far end of a hall.
const DISTANCES: std::ops::Range<f64> = 0.03..20.0;
/// Names in a list; more are counted.
const MOST_NAMES: usize = 5;

/// A sentence for each thing that is odd, with what it leads to or where it comes from.
pub(super) fn warnings(capture: &Capture, found: &CaptureInspection) -> Vec<String> {
    [masks(found), cameras(capture, found), fits(found)].concat()
}

fn masks(found: &CaptureInspection) -> Vec<String> {
    let mut warnings = vec![];
    let views = || found.splits.iter().filter(|split| !split.is_part).flat_map(|split| &split.views);
    let (looked_at, without) = (views().count(), views().filter(|view| view.coverage.is_none()).count());
    if without > 0 {
        warnings.push(format!(
            "{without} of {looked_at} images have no mask; the hand may be anywhere in them, and what is behind it is taken for \
             hand"
        ));
    }
    let empty = views().filter(|view| view.coverage == Some(0.0)).count();
    if empty > 0 {
        warnings.push(format!(
            "{empty} of {looked_at} masks are empty; a mask is at least 128 on the hand and below elsewhere"
        ));
    }
    let made = found.files.made_masks;
    if made > 0 {
        warnings.push(format!(
            "{made} of {} masks have no file and are made from the posed hand, which they therefore meet; look at the pictures",
            found.files.images
        ));
    }
    warnings
}

fn cameras(capture: &Capture, found: &CaptureInspection) -> Vec<String> {
    let mut warnings = vec![];
    let used = || capture.cameras.iter().zip(&found.cameras).filter(|(_, facts)| facts.images > 0);
    let names = |ids: Vec<&str>| {
        let more = ids.len().saturating_sub(MOST_NAMES);
        let shown = ids.get(..MOST_NAMES).unwrap_or(&ids).join(", ");
        if more > 0 { format!("{shown} and {more} more") } else { shown }
    };
    let behind: Vec<&str> = used().filter(|(_, f)| !f.in_front).map(|(camera, _)| camera.id.as_str()).collect();
    if !behind.is_empty() {
        warnings.push(format!(
            "the hand is behind {} of {} cameras ({}); their rotation may be transposed or look along -z",
            behind.len(),
            used().count(),
            names(behind)
        ));
    }
    let odd: Vec<&str> =
        used().filter(|(_, f)| !DISTANCES.contains(&f.distance)).map(|(camera, _)| camera.id.as_str()).collect();
    if !odd.is_empty() {
        warnings.push(format!(
            "{} of {} cameras are not between {} and {} m from the hand ({}); a unit may not be the metre",
            odd.len(),
            used().count(),
            DISTANCES.start,
            DISTANCES.end,
            names(odd)
        ));
    }
    warnings
}

fn fits(found: &CaptureInspection) -> Vec<String> {
    let poor = found.splits.iter().filter(|split| !split.is_part).filter_map(|split| {
        let mean = split.iou_given()?.mean;
        // Not `<`: NaN is poor, too.
        let fits = mean >= LEAST_IOU;
        (!fits).then(|| format!("{} ({mean:.2})", split.name))
    });
    let poor: Vec<String> = poor.collect();
    if poor.is_empty() {
        return vec![];
    }
    vec![format!(
        "the posed template meets the masks of {} poorly (mean IoU); an axis, a rotation, a unit or the side of the hand may not be \
         what the format says",
        poor.join(", ")
    )]
}
