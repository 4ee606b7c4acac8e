//! Whether the masks end where the template does, at the wrist: then its end is an outline as any other.

use ghand_core::{Camera, InvalidHandModel, Pose};
use rayon::prelude::*;

use crate::alignment::outlines::contour::ContourPoint;
use crate::alignment::{DistanceField, Edges, Fit, Images, quantiles};

/// Points of the end in an image that tell where its mask ends.
const LEAST_POINTS: usize = 3;
/// Masks end at the same place of the hand if the distances of their ends from the template's spread by no more than this
/// (median absolute deviation), relative to the size of the masks: 0.002 to 0.01 where the hand is alone, 0.033 where someone
/// has cut off the arm. As much as masks are off elsewhere comes on top of it, as an independent error.
const LARGEST_SPREAD: f64 = 0.0125;
/// An arm goes on at this place, in lengths of the last 6 % of the hand from where they begin.
const ARM: f64 = 2.5;
/// In fewer images there may be fingers: 0.15 to 0.25 where the hand is alone, 0.75 where masks have an arm.
const MOST_ARMS: f64 = 0.45;

/// What an image says.
struct Seen {
    /// Median distance of the template's end from the mask's outline, pixels; `None` where it is not seen.
    distance: Option<f64>,
    /// Absolute distances of the other contour from it, pixels.
    elsewhere: Vec<f64>,
    has_arm: bool,
    /// Square root of the mask's area, pixels.
    size: f64,
}

impl Fit<'_> {
    /// Whether the masks of these images end where the template does, or at a constant distance from there, by the present
    /// poses.
    pub(crate) fn masks_end_with_template(&self, images: &[Images]) -> Result<bool, InvalidHandModel> {
        let shaped = self.shaped()?.known();
        let whole = Edges::of(&shaped.model).with_arm_end();
        let of_frame = |(pose, images): (&Pose, &Images)| -> Result<Vec<Seen>, InvalidHandModel> {
            let positions = shaped.pose(pose)?.vertices;
            let normals = shaped.model.vertex_normals(&positions);
            let seen = |(camera, field): &(&Camera, &DistanceField)| {
                let contour = whole.contour(&positions, &normals, camera, field);
                let is_at_end = |point: &&ContourPoint| point.edge.iter().all(|v| self.edges.is_arm_end(*v));
                let (at_end, others): (Vec<&ContourPoint>, Vec<&ContourPoint>) = contour.iter().partition(is_at_end);
                let distances: Vec<f64> = at_end.iter().map(|point| point.residual).collect();
                let place = self.edges.arm_end(&positions, camera).map(|end| end.at(ARM));
                Seen {
                    distance: (distances.len() >= LEAST_POINTS).then(|| quantiles(distances)[0]),
                    elsewhere: others.iter().map(|point| point.residual.abs()).collect(),
                    has_arm: place.and_then(|place| field.at(place)).is_some_and(|(distance, _)| distance < 0.0),
                    size: (field.area() as f64).sqrt(),
                }
            };
            Ok(images.iter().map(seen).collect())
        };
        let seen: Vec<Vec<Seen>> = self.poses.par_iter().zip(images).map(of_frame).collect::<Result<_, _>>()?;
        let seen: Vec<Seen> = seen.into_iter().flatten().collect();
        let distances: Vec<f64> = seen.iter().filter_map(|seen| seen.distance).collect();
        let arms = seen.iter().filter(|seen| seen.has_arm).count();
        if 2 * distances.len() < seen.len() || distances.is_empty() || arms as f64 > MOST_ARMS * seen.len() as f64 {
            return Ok(false);
        }
        let middle = quantiles(distances.clone())[0];
        let spread = quantiles(distances.iter().map(|distance| (distance - middle).abs()).collect())[0];
        let size = quantiles(seen.iter().map(|seen| seen.size).collect())[0];
        let elsewhere = quantiles(seen.into_iter().flat_map(|seen| seen.elsewhere).collect())[0];
        log::debug!(
            "the masks' ends spread by {spread:.2} pixels, they are off by {elsewhere:.2} elsewhere, the hand is \
             {size:.0} large; {arms} arms"
        );
        Ok(spread < (LARGEST_SPREAD * size).hypot(elsewhere))
    }
}
