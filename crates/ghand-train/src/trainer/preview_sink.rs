//! A preview of the avatar while it is trained.

use std::time::{Duration, Instant};

use ghand_avatar::Avatar;

/// Takes an avatar.
type Show<'a> = Box<dyn FnMut(Avatar) + 'a>;

/// Receives a copy of the avatar, at most once per interval.
pub(super) struct PreviewSink<'a> {
    every: Duration,
    shown: Option<Instant>,
    show: Show<'a>,
}

impl<'a> PreviewSink<'a> {
    pub fn new(every: Duration, show: impl FnMut(Avatar) + 'a) -> PreviewSink<'a> {
        PreviewSink { every, shown: None, show: Box::new(show) }
    }

    /// Whether the interval since the last avatar has passed, or none was shown yet.
    pub fn is_due(&self) -> bool {
        self.shown.is_none_or(|shown| shown.elapsed() >= self.every)
    }

    /// Shows an avatar.
    pub fn show(&mut self, avatar: Avatar) {
        (self.show)(avatar);
        self.shown = Some(Instant::now());
    }
}
