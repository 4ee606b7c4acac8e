//! In which poses an avatar is compared with the images of a split.

use std::collections::BTreeSet;

use ghand_capture::{Capture, Split, SplitView};
use ghand_core::pose_offsets::PoseOffsets;
use ghand_core::{HandModel, Pose};
use ghand_fit::alignment::AlignmentError;
use ghand_fit::alignment::single_frames::{PoseKnowledge, SingleFrame, align_single_frames};
use serde::{Deserialize, Serialize};

/// How the poses of the evaluated images are chosen. Figures of different protocols cannot be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Protocol {
    /// The capture's own poses.
    #[default]
    Given,
    /// Poses fitted to the frame's masks, by what the training frames' masks say of poses; without the mask of the image
    /// that is compared where the frame has three images or more. The template's end at the wrist is not compared.
    Masks,
    /// The capture's own poses, mapped by the constant offsets between true and refined training poses.
    Aligned,
    /// Poses fitted to the masks' contours of half of a frame's cameras, compared with the images of the other half.
    RefinedCross,
    /// The capture's own poses, in squares around the hand on black ([`crate::hand_box`]), as HandAvatar is evaluated.
    #[serde(rename = "handavatar")]
    HandAvatar,
}

impl Protocol {
    /// What it does, for people.
    pub fn description(self) -> &'static str {
        match self {
            Protocol::Given => "test poses untouched",
            Protocol::Masks => {
                "test poses fitted to the masks; with three cameras or more without the compared image's own"
            }
            Protocol::Aligned => "test poses mapped by the constant offsets of the refined training poses",
            Protocol::RefinedCross => "test poses fitted to the masks of half of the cameras, scored on the other half",
            Protocol::HandAvatar => "test poses untouched, squares of 256 x 256 pixels around the hand on black",
        }
    }
}

impl std::fmt::Display for Protocol {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Protocol::Given => "given",
            Protocol::Masks => "masks",
            Protocol::Aligned => "aligned",
            Protocol::RefinedCross => "refined-cross",
            Protocol::HandAvatar => "handavatar",
        })
    }
}

/// An image to compare with, and the pose to draw.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PosedView {
    /// Index of the camera in the capture.
    pub camera: usize,
    /// Index of the frame in the capture.
    pub frame: usize,
    /// The pose.
    pub pose: Pose,
}

/// The images of a split in the capture's own poses.
pub fn given_views(capture: &Capture, split: &Split) -> Vec<PosedView> {
    let view = |view: &SplitView| {
        let pose = capture.frames[view.frame].pose.clone();
        PosedView { camera: view.camera, frame: view.frame, pose }
    };
    split.views.iter().map(view).collect()
}

/// The images of a split in the capture's poses, mapped by these offsets.
pub fn aligned_views(capture: &Capture, split: &Split, offsets: &PoseOffsets) -> Vec<PosedView> {
    let aligned = |view: PosedView| PosedView { pose: offsets.apply(&view.pose, &capture.hand_model.parents), ..view };
    given_views(capture, split).into_iter().map(aligned).collect()
}

/// The images of a split in poses that were fitted to its frames' masks: `poses`, one for each frame. Of a frame with three
/// images or more, those of the training split counted, each is compared in a pose by the masks of the others, fitted from
/// the capture's pose on with what is known. `template` is the avatar's; its shape is fixed. The images' colours have no part in it.
///
/// # Errors
/// [`AlignmentError`] if a mask is unusable or a pose does not fit the template.
pub fn mask_views(
    capture: &Capture,
    train: &Split,
    split: &Split,
    template: &HandModel,
    poses: &[Pose],
    known: &PoseKnowledge,
) -> Result<Vec<PosedView>, AlignmentError> {
    let others_of = |view: &SplitView| -> Vec<usize> {
        let others = split.views.iter().chain(&train.views);
        let others = others.filter(|other| other.frame == view.frame && other.camera != view.camera);
        others.map(|other| other.camera).collect::<BTreeSet<usize>>().into_iter().collect()
    };
    let single = |view: &SplitView| {
        let cameras = others_of(view);
        let pose = capture.frames[view.frame].pose.clone();
        (cameras.len() >= 2).then_some(SingleFrame { frame: view.frame, cameras, pose })
    };
    let singles: Vec<Option<SingleFrame>> = split.views.iter().map(single).collect();
    let fits: Vec<SingleFrame> = singles.iter().flatten().cloned().collect();
    let mut fitted = align_single_frames(capture, template, Some(known), &fits)?.into_iter();
    let posed = |(view, single): (&SplitView, &Option<SingleFrame>)| {
        let own = single.as_ref().and_then(|_| fitted.next());
        let pose = own.unwrap_or_else(|| poses[view.position].clone());
        PosedView { camera: view.camera, frame: view.frame, pose }
    };
    Ok(split.views.iter().zip(&singles).map(posed).collect())
}

/// Why poses could not be fitted to half of the cameras.
#[derive(Debug, thiserror::Error)]
pub enum CrossError {
    /// There is nothing to fit to, or nothing to compare with.
    #[error(
        "the frame {frame:?} of the split has {cameras} image; the protocol refined-cross needs at least two cameras for \
         each frame: one half to fit the pose to, the other to compare with"
    )]
    OneCamera {
        /// Id of the frame.
        frame: String,
        /// Number of its cameras.
        cameras: usize,
    },
    /// The fit failed.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
}

/// The images of a split, each in a pose that was fitted to the masks of the other half of its frame's cameras: those at
/// even places in the split's order, or those at odd ones. `template` is the avatar's; its shape is fixed. The fit starts
/// from the capture's pose.
///
/// # Errors
/// [`CrossError`] if a frame has only one image, or the fit fails.
pub fn cross_views(capture: &Capture, split: &Split, template: &HandModel) -> Result<Vec<PosedView>, CrossError> {
    let mut halves: Vec<[SingleFrame; 2]> = vec![];
    for frame in &split.frames {
        let empty = SingleFrame { frame: *frame, cameras: vec![], pose: capture.frames[*frame].pose.clone() };
        halves.push([empty.clone(), empty]);
    }
    for view in &split.views {
        let [even, odd] = &mut halves[view.position];
        let half = if even.cameras.len() == odd.cameras.len() { even } else { odd };
        half.cameras.push(view.camera);
    }
    for [even, odd] in &halves {
        if odd.cameras.is_empty() {
            let frame = capture.frames[even.frame].id.clone();
            return Err(CrossError::OneCamera { frame, cameras: even.cameras.len() });
        }
    }
    let fits: Vec<SingleFrame> = halves.iter().flatten().cloned().collect();
    let poses = align_single_frames(capture, template, None, &fits)?;
    let mut views = vec![];
    for ([even, odd], fitted) in halves.iter().zip(poses.chunks_exact(2)) {
        for (scored, pose) in [(even, &fitted[1]), (odd, &fitted[0])] {
            let view = |camera: &usize| PosedView { camera: *camera, frame: scored.frame, pose: pose.clone() };
            views.extend(scored.cameras.iter().map(view));
        }
    }
    Ok(views)
}
