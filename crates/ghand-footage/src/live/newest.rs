//! The newest frame, between the thread that reads frames and the one that uses them.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::FootageError;

/// One frame as it arrived.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LiveFrame {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green, blue, row by row.
    pub rgb: Vec<u8>,
    /// When it was complete.
    pub arrived: Instant,
}

#[derive(Default)]
struct Content {
    frame: Option<LiveFrame>,
    dropped: u64,
    end: Option<FootageError>,
    is_over: bool,
}

/// Room for one frame: a new one takes the place of an old one, so that whoever is slow is never late.
#[derive(Default)]
pub(super) struct Newest {
    content: Mutex<Content>,
    changed: Condvar,
}

impl Newest {
    fn content(&self) -> MutexGuard<'_, Content> {
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts in a frame.
    pub fn put(&self, frame: LiveFrame) {
        let mut content = self.content();
        let before = content.frame.replace(frame);
        content.dropped += u64::from(before.is_some());
        self.changed.notify_all();
    }

    /// No frame will come; `end` says why, unless it was asked for.
    pub fn end(&self, end: Option<FootageError>) {
        let mut content = self.content();
        content.end = content.end.take().or(end);
        content.is_over = true;
        self.changed.notify_all();
    }

    /// The newest frame that was not taken yet. Waits at most `patience` for one.
    ///
    /// # Errors
    /// Why no frame will come, once.
    pub fn take(&self, patience: Duration) -> Result<Option<LiveFrame>, FootageError> {
        let waited = self
            .changed
            .wait_timeout_while(self.content(), patience, |content| content.frame.is_none() && !content.is_over);
        let mut content = waited.unwrap_or_else(PoisonError::into_inner).0;
        match (content.frame.take(), content.end.take()) {
            (Some(frame), end) => {
                content.end = end;
                Ok(Some(frame))
            }
            (None, Some(end)) => Err(end),
            (None, None) => Ok(None),
        }
    }

    /// Frames that newer ones overtook.
    pub fn dropped(&self) -> u64 {
        self.content().dropped
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_newest_frame_is_taken_then_the_reason_for_the_end() {
        let newest = Newest::default();
        let frame = |grey: u8| LiveFrame { width: 1, height: 1, rgb: vec![grey; 3], arrived: Instant::now() };
        (0..5).for_each(|grey| newest.put(frame(grey)));
        newest.end(Some(FootageError::unusable(Path::new("camera"), "was unplugged")));
        newest.end(None);
        let take = || newest.take(Duration::from_secs(60));
        assert_eq!(take().unwrap().map(|frame| frame.rgb[0]), Some(4));
        assert_eq!(take().unwrap_err().to_string(), "camera: was unplugged");
        assert!(take().unwrap().is_none(), "it does not wait for what cannot come");
        assert_eq!(newest.dropped(), 4);
    }
}
