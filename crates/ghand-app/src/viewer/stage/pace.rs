//! How fast pictures follow each other.

use std::time::Instant;

use crate::viewer::rendering::frame::Median;

/// Times between pictures, and of the first one.
#[derive(Debug, Default)]
pub struct Pace {
    /// Whether pictures are rendered all the time, to measure how fast that is.
    is_measured: bool,
    last_frame: Option<Instant>,
    between_frames_ms: Median,
    /// When the program was started, until the first picture is done.
    started: Option<Instant>,
}

impl Pace {
    /// Whether it is measured.
    pub fn is_measured(&self) -> bool {
        self.is_measured
    }

    /// Measures it, or stops.
    pub fn set_measured(&mut self, is_measured: bool) {
        self.is_measured = is_measured;
        self.forget();
    }

    /// Logs how long after `start` the first picture is done.
    pub fn log_start(&mut self, start: Instant) {
        self.started = Some(start);
    }

    /// A picture is done.
    pub fn picture_done(&mut self) {
        if let Some(start) = self.started.take() {
            log::info!("the first picture was done {:.2} s after the start", start.elapsed().as_secs_f64());
        }
    }

    /// A picture is begun.
    pub fn picture_begun(&mut self) {
        let now = Instant::now();
        if let Some(last) = self.last_frame.replace(now).filter(|_| self.is_measured) {
            self.between_frames_ms.add((now - last).as_secs_f64() * 1e3);
        }
    }

    /// Median time between pictures, milliseconds.
    pub fn between_frames_ms(&self) -> Option<f64> {
        self.between_frames_ms.get()
    }

    /// Forgets the times so far.
    pub fn forget(&mut self) {
        self.between_frames_ms.clear();
        self.last_frame = None;
    }

    /// When the last picture was begun.
    #[cfg(test)]
    pub(crate) fn last_frame(&self) -> Option<Instant> {
        self.last_frame
    }
}
