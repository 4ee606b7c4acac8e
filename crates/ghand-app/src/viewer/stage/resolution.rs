//! How many pixels the picture has: no more than the device can hold, and fewer while it changes on a slow device.

use egui::Vec2;

use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::stage::adaptive_detail::AdaptiveDetail;

/// Longest edge of the picture, pixels, on a graphics card.
const LARGEST_PICTURE: u32 = 2048;
/// The same on a software rasteriser.
const LARGEST_PICTURE_CPU: u32 = 1024;
/// Step by which the picture's edges shrink while the device cannot hold it, and grow when it can again.
pub(crate) const DETAIL_STEP: f32 = 0.75;
/// Below this scale the viewer gives up.
const LEAST_DETAIL: f32 = 0.1;

/// The picture's size, and what determines it.
#[derive(Debug)]
pub struct Resolution {
    largest_edge: u32,
    /// Edge of the picture as a fraction of the panel's: less than 1 if the device cannot hold so large a close-up.
    detail: f32,
    /// Fewest tile intersections that the device could not hold.
    too_many: u32,
    /// Fewer pixels while the picture changes.
    adaptive: AdaptiveDetail,
    /// What the picture should show, at any size.
    wanted: Option<PictureInputs>,
    /// Part of the edge that the last picture had for being in motion.
    drawn_scale: f32,
}

/// What a frame changes in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Change {
    /// Nothing; a movement, if there is one, will have ended after so many seconds.
    None(Option<f64>),
    /// It is the first picture.
    First,
    /// It shows something else.
    Other,
}

impl Resolution {
    /// On a processor or on a graphics card.
    pub fn new(is_cpu: bool) -> Resolution {
        Resolution {
            largest_edge: if is_cpu { LARGEST_PICTURE_CPU } else { LARGEST_PICTURE },
            detail: 1.0,
            too_many: u32::MAX,
            adaptive: AdaptiveDetail::default(),
            wanted: None,
            drawn_scale: 1.0,
        }
    }

    /// Longest edge of a picture, pixels.
    pub fn largest_edge(&self) -> u32 {
        self.largest_edge
    }

    /// Forgets what the device could not hold: the subject or the device is another one.
    pub fn forget_limits(&mut self) {
        (self.detail, self.too_many) = (1.0, u32::MAX);
    }

    /// Follows whether the picture changes, at this time of the user interface, seconds.
    pub fn follow(&mut self, inputs: &PictureInputs, now: f64) -> Change {
        if self.wanted.as_ref().is_some_and(|wanted| wanted.shows_the_same(inputs)) {
            return Change::None(self.adaptive.same(now));
        }
        match self.wanted.replace(inputs.clone()) {
            None => Change::First,
            Some(_) => {
                self.adaptive.changed(now);
                Change::Other
            }
        }
    }

    /// A picture took this long.
    pub fn took(&mut self, ms: f64) {
        self.adaptive.took(self.drawn_scale, ms);
    }

    /// The device cannot hold that many tile intersections. Returns whether there can be fewer.
    pub fn coarsen(&mut self, intersections: u32) -> bool {
        if self.detail <= LEAST_DETAIL {
            return false;
        }
        self.too_many = self.too_many.min(intersections);
        self.detail *= DETAIL_STEP;
        true
    }

    /// The device could hold that many tile intersections.
    pub fn refine(&mut self, intersections: u32) {
        // One step less than doubles the number; the rest is a margin against oscillation.
        if self.detail < 1.0 && intersections < self.too_many / 3 {
            self.detail = (self.detail / DETAIL_STEP).min(1.0);
        }
    }

    /// Part of the picture's edge that is drawn while the picture changes.
    fn adaptive_scale(&self, adaptive: bool) -> f32 {
        if adaptive { self.adaptive.scale() } else { 1.0 }
    }

    /// A picture of the present size is begun.
    pub fn picture_begun(&mut self, adaptive: bool) {
        self.drawn_scale = self.adaptive_scale(adaptive);
    }

    /// Part of the edge that the last picture had for being in motion.
    pub fn drawn_scale(&self) -> f32 {
        self.drawn_scale
    }

    /// A panel's size in pixels, reduced if that is too many.
    pub fn size(&self, pixels: Vec2, adaptive: bool) -> [u32; 2] {
        let shrink = (self.largest_edge as f32 / pixels.max_elem().max(1.0)).min(1.0)
            * self.detail
            * self.adaptive_scale(adaptive);
        [pixels.x, pixels.y].map(|edge| ((edge * shrink).round() as u32).clamp(1, self.largest_edge))
    }
}

#[cfg(test)]
impl Resolution {
    /// Edge of the picture as a fraction of the panel's.
    pub(crate) fn detail(&self) -> f32 {
        self.detail
    }

    /// As after a picture that the device could not hold.
    pub(crate) fn limit(&mut self, detail: f32, too_many: u32) {
        (self.detail, self.too_many) = (detail, too_many);
    }
}
