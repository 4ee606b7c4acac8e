//! Cameras that do not show the hand that the others show: their images are of other moments, their calibration or their masks
//! are wrong. Among many cameras one hides in every mean, and where the given poses are off, in how these fit its masks, too.

use ghand_capture::Split;
use ghand_core::{Camera, InvalidHandModel, Pose};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::alignment::reduced::Reduced;
use crate::alignment::{AlignmentError, DistanceField, Fit, Images, MaskFit, Shape, images_of_frames, quantiles};

/// Fewer other cameras say nothing of one.
const LEAST_OTHERS: usize = 2;
/// Fewer images of a camera say nothing of it.
const LEAST_IMAGES: usize = 3;
/// A camera is looked at if its masks lack so many times as much in overlap as the others', and this much more; it is odd by
/// the second pair, if its outlines also are so many times as far off.
const SUSPICIOUS: [f64; 2] = [1.3, 0.03];
const ODD: [f64; 2] = [2.0, 0.05];
const FARTHER: f64 = 2.5;
/// Odd cameras that are looked for, and frames from which.
const MOST_ODD: usize = 3;
const FRAMES: usize = 16;
/// Frames by which its images are tried to be late or early.
const MOST_LATE: isize = 3;
/// Images are late if this explains so much of what they lack more than the others'.
const EXPLAINED: f64 = 0.5;

/// A camera that does not show the hand that the others show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OddCamera {
    /// The camera's id.
    pub camera: String,
    /// How far 5 % of its outlines are off the fitted hand at least, and those of the other cameras (median), pixels.
    pub contours: [f64; 2],
    /// How well the fitted hand overlaps its masks, and those of the others (median).
    pub overlap: [f64; 2],
    /// Frames by which its masks show later poses, and the overlap without that.
    pub late: Option<(isize, f64)>,
}

impl std::fmt::Display for OddCamera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let OddCamera { camera, contours: [far, others], overlap: [overlap, usual], late } = self;
        let what = format!(
            "{camera} does not show the hand that the other cameras show: 5 % of its outlines are more than {far:.0} pixels \
             off, of theirs {others:.0} (overlap {overlap:.2}, theirs {usual:.2})"
        );
        match late {
            Some((late, without)) => {
                let which = if *late > 0 { "later" } else { "earlier" };
                let s = if late.abs() == 1 { "" } else { "s" };
                let count = late.abs();
                write!(
                    f,
                    "{what}; its masks show the poses of {count} frame{s} {which} (overlap {without:.2} without that): \
                     shift its images"
                )
            }
            None => {
                write!(
                    f,
                    "{what}; its calibration, its masks or its moments are wrong: mend them, or leave it out of `splits`"
                )
            }
        }
    }
}

impl MaskFit {
    fn lacks_more_than(&self, others: &MaskFit, [times, more]: [f64; 2]) -> bool {
        let lack = 1.0 - self.overlap;
        let usual = 1.0 - others.overlap;
        lack > times * usual && lack > usual + more
    }
}

/// The medians of all cameras but one; `None` if these are too few.
fn others_of(camera: usize, fits: &[(usize, MaskFit)]) -> Option<MaskFit> {
    let others = || fits.iter().filter(|(other, _)| *other != camera).map(|(_, fit)| fit);
    let usual = |value: fn(&MaskFit) -> f64| quantiles(others().map(value).collect())[0];
    (others().count() >= LEAST_OTHERS).then(|| MaskFit {
        contours: [usual(|fit| fit.contours[0]), usual(|fit| fit.contours[1])],
        overlap: usual(|fit| fit.overlap),
        mask_size: usual(|fit| fit.mask_size),
    })
}

impl Fit<'_> {
    /// The odd cameras among those of a split's frames, the worst first. `fields` are those of the split's views,
    /// `cameras` those of the reduced images. A camera that fits worse than the others pulls the poses of all: it is judged by
    /// poses without it.
    pub(crate) fn odd_cameras(
        &self,
        reduced: &Reduced,
        cameras: &[Camera],
        split: &Split,
        fields: &[Option<DistanceField>],
    ) -> Result<Vec<OddCamera>, AlignmentError> {
        let images = images_of_frames(cameras, split, fields);
        let chosen: Vec<usize> = (0..split.frames.len()).step_by(split.frames.len().div_ceil(FRAMES).max(1)).collect();
        let mut odd: Vec<OddCamera> = vec![];
        let mut fits = self.fits_of_cameras(cameras, &images)?;
        while odd.len() < MOST_ODD {
            let lack_of = |(_, fit): &&(usize, MaskFit)| 1.0 - fit.overlap;
            let is_known = |camera: usize| odd.iter().any(|odd| odd.camera == cameras[camera].id);
            let left: Vec<(usize, MaskFit)> = fits.iter().copied().filter(|(camera, _)| !is_known(*camera)).collect();
            let Some(&(worst, fit)) = left.iter().max_by(|a, b| lack_of(a).total_cmp(&lack_of(b))) else { break };
            let Some(others) = others_of(worst, &left) else { break };
            if !fit.lacks_more_than(&others, SUSPICIOUS) {
                break;
            }
            let is_left_out =
                |camera: &Camera| camera.id == cameras[worst].id || odd.iter().any(|odd| odd.camera == camera.id);
            let some = chosen.iter().map(|frame| {
                images[*frame].iter().filter(|(camera, _)| !is_left_out(camera)).copied().collect::<Images>()
            });
            let some: Vec<Images> = some.collect();
            let mut without =
                Fit::new(self.template, chosen.iter().map(|frame| self.given[*frame]).collect(), Shape::Unknown);
            without.follow_contours(&some, &mut |_, _, _| true)?;
            let all: Vec<Images> = chosen.iter().map(|frame| images[*frame].clone()).collect();
            fits = without.fits_of_cameras(cameras, &all)?;
            let left: Vec<(usize, MaskFit)> = fits.iter().copied().filter(|(camera, _)| !is_known(*camera)).collect();
            let Some(fit) = left.iter().find(|(camera, _)| *camera == worst).map(|(_, fit)| *fit) else { break };
            let Some(others) = others_of(worst, &left) else { break };
            if !fit.lacks_more_than(&others, ODD) || fit.contours[1] < FARTHER * others.contours[1] {
                break;
            }
            let frames: Vec<usize> = chosen.iter().map(|frame| split.frames[*frame]).collect();
            odd.push(OddCamera {
                camera: cameras[worst].id.clone(),
                contours: [fit.contours[1], others.contours[1]],
                overlap: [fit.overlap, others.overlap],
                late: without.late_by(reduced, &cameras[worst], &frames, worst, [fit.overlap, others.overlap])?,
            });
        }
        Ok(odd)
    }

    /// How well the hand fits the masks of each camera that has enough of them.
    fn fits_of_cameras(
        &self,
        cameras: &[Camera],
        images: &[Images],
    ) -> Result<Vec<(usize, MaskFit)>, InvalidHandModel> {
        let shaped = self.shaped()?.known();
        let of_camera = |number: usize| -> Result<Option<(usize, MaskFit)>, InvalidHandModel> {
            let id = &cameras[number].id;
            let seen = self.poses.iter().zip(images).filter_map(|(pose, images)| {
                let own = images.iter().find(|(other, _)| other.id == *id)?;
                Some((pose.clone(), vec![*own]))
            });
            let (poses, images): (Vec<Pose>, Vec<Images>) = seen.unzip();
            if poses.len() < LEAST_IMAGES {
                return Ok(None);
            }
            Ok(Some((number, self.fit_of(&shaped, &poses, &images)?.0)))
        };
        let fits: Vec<Option<(usize, MaskFit)>> =
            (0..cameras.len()).into_par_iter().map(of_camera).collect::<Result<_, _>>()?;
        Ok(fits.into_iter().flatten().collect())
    }

    /// By how many frames the masks of a camera show later poses, if that explains why the hand does not fit them, and the
    /// overlap without that. The poses are those of `frames`; the overlaps are the camera's and the others'.
    fn late_by(
        &self,
        reduced: &Reduced,
        camera: &Camera,
        frames: &[usize],
        number: usize,
        [overlap, usual]: [f64; 2],
    ) -> Result<Option<(isize, f64)>, AlignmentError> {
        let shaped = self.shaped()?.known();
        let without = |late: isize| -> Result<Option<f64>, AlignmentError> {
            // The image that shows a frame's pose is that of an earlier frame if images are late.
            let paired = frames.par_iter().zip(&self.poses).filter_map(|(frame, pose)| {
                let field = reduced.field(number, frame.checked_add_signed(-late)?).ok()??;
                Some((pose.clone(), field))
            });
            let (poses, fields): (Vec<Pose>, Vec<DistanceField>) = paired.unzip();
            if fields.len() < LEAST_IMAGES {
                return Ok(None);
            }
            let images: Vec<Images> = fields.iter().map(|field| vec![(camera, field)]).collect();
            Ok(Some(self.fit_of(&shaped, &poses, &images)?.0.overlap))
        };
        let mut best: Option<(isize, f64)> = None;
        for late in (-MOST_LATE..=MOST_LATE).filter(|late| *late != 0) {
            let found = without(late)?;
            let is_better = |found: f64| best.is_none_or(|(_, best)| found > best);
            best = found.filter(|found| is_better(*found)).map(|found| (late, found)).or(best);
        }
        Ok(best.filter(|(_, found)| *found > overlap + EXPLAINED * (usual - overlap)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_odd_is_said_with_its_remedy() {
        let camera =
            OddCamera { camera: "left".into(), contours: [12.6, 2.1], overlap: [0.81, 0.93], late: Some((-2, 0.9)) };
        let text = camera.to_string();
        assert!(text.contains("more than 13 pixels off, of theirs 2"), "{text}");
        assert!(text.contains("poses of 2 frames earlier (overlap 0.90 without that): shift its images"), "{text}");
        let unknown = OddCamera { late: None, ..camera }.to_string();
        assert!(unknown.contains("its calibration, its masks or its moments"), "{unknown}");
    }
}
