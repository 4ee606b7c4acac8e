//! Live poses: packets from the port or from a webcam drive the hand until something else changes its pose.

mod cameras;
pub mod feed;
pub mod link;
mod panel;
mod rate;
mod webcam;

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use egui::Context;
use ghand_core::Pose;
use ghand_motion::live::port::Packet;
use ghand_motion::live::{LiveOptions, LivePoses, PacketKind};

use crate::viewer::hand::Hand;
use crate::viewer::rendering::frame::Median;
use feed::{Feed, FeedSettings};
use rate::Rate;
use webcam::Webcam;

/// Interval of looks at the rates while packets come.
const LOOK: Duration = Duration::from_millis(500);
/// A sender whose clock differs by more than this, milliseconds, does not send Unix time.
const LARGEST_CLOCK_DIFFERENCE: f64 = 60_000.0;

/// What the rest of the viewer should know.
#[derive(Debug)]
pub enum LiveEvent {
    /// The first pose of this kind has come.
    Begun(PacketKind),
    /// The user or a motion has changed the pose, and live poses are paused.
    Paused,
    /// No more poses come: the webcam has ended.
    Failed(anyhow::Error),
}

/// A live pose on its way to the screen.
#[derive(Debug, Clone, Copy)]
struct Underway {
    arrived: Instant,
    sent_ms: Option<f64>,
}

/// The port or webcam, the poses from it, and what the panel says about them.
pub struct Live {
    feed: Feed,
    poses: LivePoses,
    options: LiveOptions,
    started: Instant,
    paused: bool,
    /// The pose that the hand has from packets, while live poses drive it.
    driven: Option<Pose>,
    /// The pose that no picture shows yet, and the one that is being rendered.
    waiting: Option<Underway>,
    rendering: Option<Underway>,
    kind: Option<PacketKind>,
    received: Rate,
    shown: Rate,
    /// Pictures of the webcam.
    tracked: Rate,
    /// Packets, pictures, and pictures of the webcam per second.
    rates: [f64; 3],
    latency_ms: Median,
    since_sent_ms: Median,
}

impl Live {
    /// Opens the port, or begins to open the webcam.
    ///
    /// # Errors
    /// One sentence if the port cannot be opened, such as when another program has it.
    pub fn open(settings: &FeedSettings) -> anyhow::Result<Live> {
        let feed = Feed::open(settings)?;
        let now = Instant::now();
        Ok(Live {
            feed,
            poses: LivePoses::default(),
            options: LiveOptions::default(),
            started: now,
            paused: false,
            driven: None,
            waiting: None,
            rendering: None,
            kind: None,
            received: Rate::new(now),
            shown: Rate::new(now),
            tracked: Rate::new(now),
            rates: [0.0; 3],
            latency_ms: Median::default(),
            since_sent_ms: Median::default(),
        })
    }

    /// Where poses come from.
    pub fn feed(&self) -> &Feed {
        &self.feed
    }

    /// Whether live poses drive the hand now.
    pub fn drives(&self) -> bool {
        self.driven.is_some()
    }

    /// Whether packets arrive now.
    pub fn is_receiving(&self) -> bool {
        self.received.is_moving()
    }

    /// Prepares for another hand model.
    pub fn model_changed(&mut self) {
        (self.poses, self.driven) = (LivePoses::default(), None);
    }

    /// Takes the newest pose that has arrived. If the webcam has ended, says why. If something else has changed the hand's pose since the last one, live
    /// poses pause.
    pub fn advance(&mut self, hand: &mut Hand, context: &Context) -> Option<LiveEvent> {
        let mailbox = self.feed.mailbox();
        mailbox.wake({
            let context = context.clone();
            move || context.request_repaint()
        });
        let packets = mailbox.take();
        self.received.count(mailbox.tally().received);
        let webcam = self.feed.webcam();
        self.tracked.count(webcam.map_or(0, Webcam::pictures));
        // Asked before the rates are brought up to date: a rate that falls to zero must be shown, too. A webcam may end, or
        // lose the hand.
        if self.received.is_moving() || self.shown.is_moving() || webcam.is_some() {
            context.request_repaint_after(LOOK);
        }
        if let Some(problem) = webcam.and_then(Webcam::take_problem) {
            return Some(LiveEvent::Failed(problem));
        }
        let now = Instant::now();
        self.rates = [&mut self.received, &mut self.shown, &mut self.tracked].map(|rate| rate.per_second(now));
        if self.driven.as_ref().is_some_and(|pose| *pose != hand.pose || hand.is_playing()) {
            self.pause();
            return Some(LiveEvent::Paused);
        }
        let before = self.kind;
        if !self.paused {
            self.take_newest(packets, hand);
        }
        self.kind.filter(|_| self.kind != before).map(LiveEvent::Begun)
    }

    /// Drives the hand with the newest usable packet. The packets are in the order of their arrival.
    fn take_newest(&mut self, mut packets: Vec<Packet>, hand: &mut Hand) {
        while let Some(packet) = packets.pop() {
            let seconds = (packet.arrived - self.started).as_secs_f64();
            match self.poses.read(&packet.bytes, hand.model(), seconds, &self.options) {
                Ok(live) => {
                    self.kind = Some(live.kind);
                    let underway = Underway { arrived: packet.arrived, sent_ms: live.sent_ms };
                    let unseen = self.waiting.replace(underway);
                    self.feed.mailbox().overtaken(packets.len() as u64 + u64::from(unseen.is_some()));
                    hand.pause();
                    hand.pose.clone_from(&live.pose);
                    self.driven = Some(live.pose);
                    return;
                }
                Err(error) => self.feed.mailbox().refuse(error.to_string()),
            }
        }
    }

    fn pause(&mut self) {
        (self.paused, self.driven, self.waiting) = (true, None, None);
    }

    /// A picture of the hand's present pose is rendered now.
    pub fn picture_started(&mut self) {
        self.rendering = self.waiting.take().or(self.rendering);
    }

    /// The picture that was started last is complete.
    pub fn picture_complete(&mut self) {
        let Some(shown) = self.rendering.take() else { return };
        self.shown.add();
        self.latency_ms.add(shown.arrived.elapsed().as_secs_f64() * 1e3);
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(f64::NAN, |now| now.as_secs_f64() * 1e3);
        let since_sent = shown.sent_ms.map(|sent| now - sent).filter(|ms| ms.abs() < LARGEST_CLOCK_DIFFERENCE);
        since_sent.into_iter().for_each(|ms| self.since_sent_ms.add(ms));
    }
}
