//! Masks made for images that have none, in one of two ways.
//!
//! By outline, as HandAvatar (Chen et al., CVPR 2023) makes them for InterHand2.6M, in exact poses: the filled outline of
//! the projected mesh, without pixels too dark or too bright for skin, and of that the part inside the largest contour.
//!
//! By colours, in a tracker's poses and before any surroundings: `learn.rs` learns over the frames of a camera which
//! colours (`histogram.rs`) the hand and its surroundings have, and what stands still (`still.rs`); `segment.rs` parts
//! them near the posed model (`guide.rs`) by a minimum cut (`min_cut.rs`).

mod aligned;
mod cache;
mod contour;
mod distance;
mod fill;
mod guide;
mod histogram;
mod learn;
mod made;
mod min_cut;
mod segment;
mod still;

use ghand_core::posing::pose_hand;

use crate::capture::Capture;
use crate::error::CaptureError;
use crate::images::file::{Role, decode, read_bytes};
use crate::images::mask_values::mask_values;

pub use aligned::AlignedHand;
pub(crate) use contour::{EDGES_AND_CORNERS, parts};
pub use distance::{depths, squared_distances};
pub use fill::{covered_pixels, open_pixels, projected};
pub(crate) use made::mask_by_colors;
pub use made::{MadeMasks, MaskMethod};

/// Skin has a mean of red, green and blue between these, exclusively.
const GREY_RANGE: [u16; 2] = [10, 200];

/// Facts that decide whether an image can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Facts {
    /// Number of pixels of the mask.
    pub mask_pixels: u32,
    /// The largest value of the image, in any channel.
    pub brightest: u8,
    /// The largest mean of red, green and blue on the mask.
    pub brightest_on_hand: u8,
}

impl Facts {
    fn of(rgba: &[[u8; 4]], mask: &[u8]) -> Facts {
        let on_hand = || rgba.iter().zip(mask).filter(|(_, m)| **m >= 128).map(|(p, _)| p);
        Facts {
            mask_pixels: on_hand().count() as u32,
            brightest: rgba.iter().map(|[r, g, b, _]| *r.max(g).max(b)).max().unwrap_or(0),
            brightest_on_hand: on_hand().map(|p| (sum(p) / 3) as u8).max().unwrap_or(0),
        }
    }
}

fn sum([r, g, b, _]: &[u8; 4]) -> u16 {
    u16::from(*r) + u16::from(*g) + u16::from(*b)
}

/// The mask of an image that has none, from the cache or made: 255 on the hand. `file` are the bytes of the image's file
/// and `rgba` its pixels.
pub(crate) fn made_mask(
    capture: &Capture,
    camera: usize,
    frame: usize,
    file: &[u8],
    rgba: &[[u8; 4]],
) -> Result<Vec<u8>, CaptureError> {
    let place = cache::MaskFile::new(capture, camera, frame, file, None, 0)?;
    if let Some(mask) = place.read().and_then(|stored| stored.mask()) {
        return Ok(mask);
    }
    let mask = make(capture, camera, frame, rgba)?;
    place.write(&Facts::of(rgba, &mask), Some(&mask));
    Ok(mask)
}

/// The facts of an image, from the cache or computed.
pub(crate) fn facts(capture: &Capture, camera: usize, frame: usize) -> Result<Facts, CaptureError> {
    let size = capture.camera_and_frame(camera, frame).map(|(c, _)| (c.width, c.height))?;
    let file = capture.image_file(camera, frame)?;
    let bytes = read_bytes(&file, Role::Image, size)?;
    let mask_file = capture.mask_file(camera, frame)?.filter(|file| file.exists());
    let mask_bytes = mask_file.as_ref().map(|file| read_bytes(file, Role::Mask, size)).transpose()?;
    let place = cache::MaskFile::new(capture, camera, frame, &bytes, mask_bytes.as_deref(), 0)?;
    if let Some(stored) = place.read() {
        return Ok(stored.facts);
    }
    let rgba = capture.display_values(decode(&file, Role::Image, &bytes, size)?, &bytes);
    if let (Some(file), Some(bytes)) = (mask_file, mask_bytes) {
        let facts = Facts::of(&rgba, &mask_values(decode(&file, Role::Mask, &bytes, size)?).values);
        place.write(&facts, None);
        return Ok(facts);
    }
    let mask = make(capture, camera, frame, &rgba)?;
    let facts = Facts::of(&rgba, &mask);
    place.write(&facts, Some(&mask));
    Ok(facts)
}

fn make(capture: &Capture, camera: usize, frame: usize, rgba: &[[u8; 4]]) -> Result<Vec<u8>, CaptureError> {
    let (camera, frame) = capture.camera_and_frame(camera, frame)?;
    let posed = pose_hand(&capture.hand_model, &frame.shape, &frame.pose)
        .map_err(|source| CaptureError::HandModel { path: capture.root.clone(), source: source.into() })?;
    let mut mask = covered_pixels(camera, &posed.vertices, &capture.hand_model.faces);
    let [low, high] = GREY_RANGE.map(|mean| 3 * mean);
    for (inside, pixel) in mask.iter_mut().zip(rgba) {
        *inside &= (low + 1..high).contains(&sum(pixel));
    }
    contour::keep_largest(&mut mask, camera.width as usize);
    Ok(mask.into_iter().map(|inside| if inside { 255 } else { 0 }).collect())
}
