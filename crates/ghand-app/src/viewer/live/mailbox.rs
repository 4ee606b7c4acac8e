//! Where packets wait for the viewer: few, the newest.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use egui::Context;

/// Most packets that wait. One would do if all were usable; with a few, a broken packet does not hide the good one
/// before it.
const MOST: usize = 4;

/// A packet as it arrived.
#[derive(Debug, Clone)]
pub struct Packet {
    /// Its content.
    pub bytes: Vec<u8>,
    /// When it was complete.
    pub arrived: Instant,
}

/// What has happened so far.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Tally {
    /// Packets that arrived.
    pub received: u64,
    /// Packets that newer ones overtook.
    pub dropped: u64,
    /// Packets and connections that cannot be used.
    pub unusable: u64,
    /// The last reason for that.
    pub reason: String,
}

#[derive(Default)]
struct Content {
    waiting: VecDeque<Packet>,
    tally: Tally,
    context: Option<Context>,
}

/// The queue between the threads of the port and the viewer.
#[derive(Default)]
pub struct Mailbox {
    content: Mutex<Content>,
}

impl Mailbox {
    fn content(&self) -> MutexGuard<'_, Content> {
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a packet; if too many wait, the oldest is dropped. Wakes the user interface if none waited.
    pub fn put(&self, bytes: &[u8]) {
        let packet = Packet { bytes: bytes.to_vec(), arrived: Instant::now() };
        let mut content = self.content();
        content.tally.received += 1;
        let was_empty = content.waiting.is_empty();
        content.waiting.push_back(packet);
        if content.waiting.len() > MOST {
            content.waiting.pop_front();
            content.tally.dropped += 1;
        }
        let context = content.context.clone().filter(|_| was_empty);
        // The user interface may be asking for the mailbox.
        drop(content);
        if let Some(context) = context {
            context.request_repaint();
        }
    }

    /// Counts packets that newer ones overtook.
    pub fn overtaken(&self, count: u64) {
        self.content().tally.dropped += count;
    }

    /// Counts a packet or a connection that cannot be used.
    pub fn refuse(&self, reason: String) {
        let mut content = self.content();
        content.tally.unusable += 1;
        content.tally.reason = reason;
        let context = content.context.clone();
        drop(content);
        if let Some(context) = context {
            context.request_repaint();
        }
    }

    /// Takes all that wait, the oldest first.
    pub fn take(&self) -> Vec<Packet> {
        self.content().waiting.drain(..).collect()
    }

    /// What has happened so far.
    pub fn tally(&self) -> Tally {
        self.content().tally.clone()
    }

    /// Wakes this user interface from now on.
    pub fn wake(&self, context: &Context) {
        self.content().context = Some(context.clone());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_packets_stay_and_the_others_are_counted() {
        let mailbox = Mailbox::default();
        (0..100u8).for_each(|k| mailbox.put(&[k]));
        let bytes: Vec<u8> = mailbox.take().iter().map(|packet| packet.bytes[0]).collect();
        assert_eq!(bytes, [96, 97, 98, 99]);
        let tally = mailbox.tally();
        assert_eq!((tally.received, tally.dropped), (100, 96));
        assert!(mailbox.take().is_empty());
    }
}
