//! Hands that a camera or a video shows, as packets of live poses, like those of a page with MediaPipe.
//!
//! One thread reads frames, another tracks the hands of the newest one.

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use ghand_core::Side;
use ghand_footage::{LiveFrames, LiveSource};
use ghand_motion::live::port::Mailbox;
use ghand_tracker::{HandTracker, TrackedHand};

use crate::world_landmarks::world_landmarks;

/// Both hands are tracked, so that the model's can be taken.
const MOST_HANDS: usize = 2;
/// Interval of checks while no frames come.
const LOOK: Duration = Duration::from_millis(50);
/// Longest time until a camera gives its first picture: some need seconds, and a system may ask the user first.
const START: Duration = Duration::from_secs(15);

/// A camera or video whose hands are tracked. Dropping it ends the tracking and closes the camera.
pub struct Webcam {
    name: String,
    shared: Arc<Shared>,
    tracking: Option<JoinHandle<()>>,
}

struct Shared {
    frames: LiveFrames,
    mailbox: Mailbox,
    is_closing: AtomicBool,
    /// Pictures that were tracked so far, and hands in the last one.
    pictures: AtomicU64,
    hands: AtomicUsize,
    /// Why it has ended.
    problem: Mutex<Option<anyhow::Error>>,
}

impl Webcam {
    /// Begins to open a camera or a video. What goes wrong then is told by [`Webcam::take_problem`].
    ///
    /// # Errors
    /// If no threads can be started.
    pub fn open(source: LiveSource) -> anyhow::Result<Webcam> {
        let name = source.name();
        let shared = Arc::new(Shared {
            frames: LiveFrames::start(source)?,
            mailbox: Mailbox::default(),
            is_closing: AtomicBool::new(false),
            pictures: AtomicU64::new(0),
            hands: AtomicUsize::new(0),
            problem: Mutex::new(None),
        });
        let track = {
            let shared = shared.clone();
            move || {
                if let Err(error) = shared.track() {
                    *shared.problem() = Some(error);
                }
            }
        };
        let tracking = thread::Builder::new().name("webcam".into()).spawn(track).context("no thread can be started")?;
        Ok(Webcam { name, shared, tracking: Some(tracking) })
    }

    /// Waits until its first picture was tracked.
    ///
    /// # Errors
    /// One sentence that says why there is none, such as when another program uses the camera.
    pub fn wait_for_picture(&self) -> anyhow::Result<()> {
        let start = Instant::now();
        while self.pictures() == 0 {
            if let Some(problem) = self.take_problem() {
                return Err(problem);
            }
            if start.elapsed() > START {
                let seconds = START.as_secs();
                bail!("{}: gives no picture within {seconds} s; connect it again, or choose another camera", self.name);
            }
            thread::sleep(LOOK);
        }
        Ok(())
    }

    /// Its name for users.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where packets wait, one for each picture with hands.
    pub fn mailbox(&self) -> &Mailbox {
        &self.shared.mailbox
    }

    /// Pictures that were tracked so far.
    pub fn pictures(&self) -> u64 {
        self.shared.pictures.load(Ordering::Relaxed)
    }

    /// Pictures that newer ones overtook before they were tracked.
    pub fn dropped(&self) -> u64 {
        self.shared.frames.dropped()
    }

    /// Hands in the last picture.
    pub fn hands(&self) -> usize {
        self.shared.hands.load(Ordering::Relaxed)
    }

    /// Why it has ended, once.
    pub fn take_problem(&self) -> Option<anyhow::Error> {
        self.shared.problem().take()
    }
}

impl Drop for Webcam {
    fn drop(&mut self) {
        self.shared.is_closing.store(true, Ordering::Relaxed);
        self.shared.frames.stop();
        // At most the picture that is being tracked is finished.
        self.tracking.take().into_iter().for_each(|tracking| _ = tracking.join());
    }
}

impl Shared {
    fn problem(&self) -> MutexGuard<'_, Option<anyhow::Error>> {
        self.problem.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tracks the newest frames until they end or nobody needs them.
    fn track(&self) -> anyhow::Result<()> {
        let mut tracker = HandTracker::new(MOST_HANDS);
        while !self.is_closing.load(Ordering::Relaxed) {
            let Some(frame) = self.frames.take(LOOK)? else { continue };
            let hands = tracker.track(&frame.rgb, frame.width, frame.height)?;
            self.hands.store(hands.len(), Ordering::Relaxed);
            self.pictures.fetch_add(1, Ordering::Relaxed);
            if !hands.is_empty() {
                self.mailbox.put(packet(&hands), frame.arrived);
            }
        }
        Ok(())
    }
}

/// The packet of a picture. Of two hands of one side, the one that was found first is taken.
fn packet(hands: &[TrackedHand]) -> Vec<u8> {
    let first = |side: Side| hands.iter().find(|hand| hand.side == side).map(|hand| (side, hand));
    let fields = world_landmarks([Side::Right, Side::Left].into_iter().filter_map(first));
    serde_json::Value::Object(fields).to_string().into_bytes()
}
