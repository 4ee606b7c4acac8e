//! The truth of a view: the capture's image of a camera and a frame, read in the background.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::anyhow;
use egui::Context;
use ghand_capture::{Capture, View};
use image::imageops::{FilterType, resize};

/// Indices of a camera and a frame in a capture.
pub type Pair = (usize, usize);

/// The image of a camera and a frame.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Camera and frame.
    pub pair: Pair,
    /// The image, reduced if it is too large for the device.
    pub view: View,
    /// The factor by which its edges are reduced; 1 for an image as in the capture.
    pub reduced: f64,
}

impl Truth {
    /// Width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.view.width, self.view.height]
    }

    /// Whether there is a mask that tells the hand from the rest.
    pub fn has_mask(&self) -> bool {
        let is_hand = |pixel: &[u8; 4]| pixel[3] >= 128;
        self.view.rgba.iter().any(is_hand) && !self.view.rgba.iter().all(is_hand)
    }
}

struct Reading {
    pair: Pair,
    done: Receiver<anyhow::Result<Truth>>,
    thread: JoinHandle<()>,
}

/// Reads one image at a time.
#[derive(Default)]
pub struct TruthReader {
    reading: Option<Reading>,
    read: Option<Truth>,
    /// The pair that could not be read.
    failed: Option<Pair>,
}

impl TruthReader {
    /// The image of this pair, once it has been read; `None` before, and if it cannot be read.
    pub fn get(&self, pair: Pair) -> Option<&Truth> {
        self.read.as_ref().filter(|truth| truth.pair == pair)
    }

    /// Waits until the image that is being read is there for the next request.
    pub fn wait(&self) {
        while self.reading.as_ref().is_some_and(|reading| !reading.thread.is_finished()) {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Whether an image is being read.
    pub fn is_busy(&self) -> bool {
        self.reading.is_some()
    }

    /// Reads the image of this pair, unless that has been done; the user interface is drawn again then. Images with edges of
    /// more than `largest_edge` pixels are reduced.
    ///
    /// # Errors
    /// Once, one sentence that names the file that is missing or broken.
    pub fn request(
        &mut self,
        capture: &Arc<Capture>,
        pair: Pair,
        largest_edge: u32,
        context: &Context,
    ) -> anyhow::Result<()> {
        let done = self.poll();
        let is_wanted = self.get(pair).is_none() && self.failed != Some(pair);
        // One at a time: whoever steps through many frames waits only for the last one.
        if is_wanted && self.reading.is_none() {
            let (sender, done) = channel();
            let capture = capture.clone();
            let context = context.clone();
            let thread = std::thread::spawn(move || {
                let view = capture.load_view(pair.0, pair.1).map_err(anyhow::Error::from);
                // A closed channel means that the viewer no longer waits.
                let _ = sender.send(view.map(|view| reduced(pair, view, largest_edge)));
                context.request_repaint();
            });
            self.reading = Some(Reading { pair, done, thread });
        }
        done
    }

    /// Takes over an image that has been read.
    fn poll(&mut self) -> anyhow::Result<()> {
        let Some(reading) = &self.reading else { return Ok(()) };
        let done = match reading.done.try_recv() {
            Err(TryRecvError::Empty) => return Ok(()),
            Err(TryRecvError::Disconnected) => Err(anyhow!("an image of the capture could not be read")),
            Ok(done) => done,
        };
        let pair = reading.pair;
        self.reading = None;
        self.failed = done.is_err().then_some(pair);
        self.read = Some(done?);
        Ok(())
    }
}

/// An image whose edges have at most this many pixels.
fn reduced(pair: Pair, view: View, largest_edge: u32) -> Truth {
    let longest = view.width.max(view.height);
    if longest <= largest_edge {
        return Truth { pair, view, reduced: 1.0 };
    }
    let factor = f64::from(largest_edge) / f64::from(longest);
    let [width, height] = [view.width, view.height].map(|edge| ((f64::from(edge) * factor).round() as u32).max(1));
    let image = image::RgbaImage::from_raw(view.width, view.height, view.rgba.into_flattened()).unwrap_or_default();
    // Not premultiplied: the colours outside the mask count, too.
    let rgba = resize(&image, width, height, FilterType::Triangle).pixels().map(|pixel| pixel.0).collect();
    Truth { pair, view: View { width, height, rgba }, reduced: factor }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_images_that_are_too_large_are_reduced() {
        let view = View { width: 8, height: 4, rgba: [[200, 100, 0, 255], [0, 100, 200, 0]].repeat(16) };
        let whole = reduced((0, 0), view.clone(), 8);
        assert_eq!((whole.size(), whole.reduced, &whole.view), ([8, 4], 1.0, &view));
        let half = reduced((0, 0), view, 4);
        assert_eq!((half.size(), half.reduced), ([4, 2], 0.5));
        assert!(half.view.rgba[1][..3].iter().all(|v| v.abs_diff(100) < 30), "{:?}", half.view.rgba[1]);
    }
}
