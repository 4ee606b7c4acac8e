//! Whoever looks on while an avatar is trained.

use std::time::{Duration, Instant};

use ghand_avatar::Avatar;

/// Takes an avatar.
type Show<'a> = Box<dyn FnMut(Avatar) + 'a>;

/// Gets the avatar as it is now and then.
pub(super) struct Onlooker<'a> {
    every: Duration,
    shown: Option<Instant>,
    show: Show<'a>,
}

impl<'a> Onlooker<'a> {
    pub fn new(every: Duration, show: impl FnMut(Avatar) + 'a) -> Onlooker<'a> {
        Onlooker { every, shown: None, show: Box::new(show) }
    }

    /// Whether the last avatar is old; at first there is none.
    pub fn is_due(&self) -> bool {
        self.shown.is_none_or(|shown| shown.elapsed() >= self.every)
    }

    /// Shows an avatar.
    pub fn show(&mut self, avatar: Avatar) {
        (self.show)(avatar);
        self.shown = Some(Instant::now());
    }
}
