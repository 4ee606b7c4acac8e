//! Where packets wait for the program: few, the newest.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Most packets that wait. One would do if all were usable; with a few, a broken packet does not hide the good one
/// before it.
const MOST: usize = 4;

/// A packet as it arrived.
#[derive(Debug, Clone)]
pub struct Packet {
    /// Its content.
    pub bytes: Vec<u8>,
    /// When it was complete, or what it was made from.
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

/// What is called when something has arrived.
type Wake = Arc<dyn Fn() + Send + Sync>;

#[derive(Default)]
struct Content {
    waiting: VecDeque<Packet>,
    tally: Tally,
    wake: Option<Wake>,
}

/// The queue between the threads that receive packets and the program.
#[derive(Default)]
pub struct Mailbox {
    content: Mutex<Content>,
}

impl Mailbox {
    fn content(&self) -> MutexGuard<'_, Content> {
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a packet, with the time at which what it tells was complete; if too many wait, the oldest is dropped. Wakes the
    /// program if none waited.
    pub fn put(&self, bytes: Vec<u8>, arrived: Instant) {
        let packet = Packet { bytes, arrived };
        let mut content = self.content();
        content.tally.received += 1;
        let was_empty = content.waiting.is_empty();
        content.waiting.push_back(packet);
        if content.waiting.len() > MOST {
            content.waiting.pop_front();
            content.tally.dropped += 1;
        }
        let wake = content.wake.clone().filter(|_| was_empty);
        // What is woken may ask for the mailbox.
        drop(content);
        if let Some(wake) = wake {
            wake();
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
        let wake = content.wake.clone();
        drop(content);
        if let Some(wake) = wake {
            wake();
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

    /// Calls this from now on when something arrives while nothing waits. It runs on the thread that puts it in.
    pub fn wake(&self, wake: impl Fn() + Send + Sync + 'static) {
        self.content().wake = Some(Arc::new(wake));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_packets_stay_and_the_others_are_counted() {
        let mailbox = Mailbox::default();
        (0..100u8).for_each(|k| mailbox.put(vec![k], Instant::now()));
        let bytes: Vec<u8> = mailbox.take().iter().map(|packet| packet.bytes[0]).collect();
        assert_eq!(bytes, [96, 97, 98, 99]);
        let tally = mailbox.tally();
        assert_eq!((tally.received, tally.dropped), (100, 96));
        assert!(mailbox.take().is_empty());
    }
}
