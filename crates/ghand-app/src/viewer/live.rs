//! Live poses: packets from the port drive the hand until something else changes its pose.

pub mod link;
mod rate;

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use egui::{Align, Context, Layout, RichText, Ui};
use ghand_core::Pose;
use ghand_motion::live::port::{LivePort, LiveSettings, Packet};
use ghand_motion::live::{LiveOptions, LivePoses, PacketKind};

use crate::viewer::hand::Hand;
use crate::viewer::rendering::frame::Median;
use rate::Rate;

/// Interval of looks at the rates while packets come.
const LOOK: Duration = Duration::from_millis(500);
/// Longest reason that is shown, characters: a packet may contain any text.
const LONGEST_REASON: usize = 160;
/// A sender whose clock differs by more than this, milliseconds, does not send Unix time.
const LARGEST_CLOCK_DIFFERENCE: f64 = 60_000.0;

/// What the rest of the viewer should know.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LiveEvent {
    /// The first pose of this kind has come.
    Begun(PacketKind),
    /// The user or a motion has changed the pose, and live poses are paused.
    Paused,
}

/// A live pose on its way to the screen.
#[derive(Debug, Clone, Copy)]
struct Underway {
    arrived: Instant,
    sent_ms: Option<f64>,
}

/// The port, the poses from it, and what the panel says about them.
pub struct Live {
    port: LivePort,
    poses: LivePoses,
    options: LiveOptions,
    started: Instant,
    paused: bool,
    /// The pose that the hand has from the port, while live poses drive it.
    driven: Option<Pose>,
    /// The pose that no picture shows yet, and the one that is being rendered.
    waiting: Option<Underway>,
    rendering: Option<Underway>,
    kind: Option<PacketKind>,
    received: Rate,
    shown: Rate,
    /// Packets and pictures per second.
    rates: [f64; 2],
    latency_ms: Median,
    since_sent_ms: Median,
}

impl Live {
    /// Opens the port.
    ///
    /// # Errors
    /// One sentence if the port cannot be opened, such as when another program has it.
    pub fn open(settings: &LiveSettings) -> anyhow::Result<Live> {
        let port = LivePort::open(settings)?;
        let now = Instant::now();
        Ok(Live {
            port,
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
            rates: [0.0; 2],
            latency_ms: Median::default(),
            since_sent_ms: Median::default(),
        })
    }

    /// The number of the port.
    pub fn port(&self) -> u16 {
        self.port.number()
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

    /// Takes the newest pose that has arrived. If something else has changed the hand's pose since the last one, live
    /// poses pause.
    pub fn advance(&mut self, hand: &mut Hand, context: &Context) -> Option<LiveEvent> {
        let mailbox = self.port.mailbox();
        mailbox.wake({
            let context = context.clone();
            move || context.request_repaint()
        });
        let packets = mailbox.take();
        self.received.count(mailbox.tally().received);
        // Asked before the rates are brought up to date: a rate that falls to zero must be shown, too.
        if self.received.is_moving() || self.shown.is_moving() {
            context.request_repaint_after(LOOK);
        }
        let now = Instant::now();
        self.rates = [&mut self.received, &mut self.shown].map(|rate| rate.per_second(now));
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
                    self.port.mailbox().overtaken(packets.len() as u64 + u64::from(unseen.is_some()));
                    hand.pause();
                    hand.pose.clone_from(&live.pose);
                    self.driven = Some(live.pose);
                    return;
                }
                Err(error) => self.port.mailbox().refuse(error.to_string()),
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

    /// Shows what comes in, with the controls. Returns whether the user stops it.
    pub fn controls(&mut self, ui: &mut Ui) -> bool {
        let mut stop = false;
        ui.horizontal(|ui| {
            ui.label(RichText::new("Live poses").strong());
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                stop = ui.button("Stop").on_hover_text("Closes the port; the last pose stays").clicked();
                let word = if self.paused { "Resume" } else { "Hold" };
                if ui.button(word).on_hover_text("Holds the present pose, or follows live poses again").clicked() {
                    if self.paused {
                        self.paused = false;
                    } else {
                        self.pause();
                    }
                }
            });
        });
        let tally = self.port.mailbox().tally();
        let address = format!("ws://127.0.0.1:{}", self.port());
        if tally.received == 0 {
            ui.label(format!("waiting for data on {address}"));
        } else {
            ui.label(RichText::new(address).weak());
            self.figures(ui, tally.dropped);
        }
        if tally.unusable > 0 {
            row(ui, "Unusable", tally.unusable.to_string())
                .on_hover_text("Packets and connections, with the last reason.");
            ui.label(RichText::new(shortened(&tally.reason)).weak());
        }
        self.switches(ui);
        stop
    }

    fn figures(&self, ui: &mut Ui, dropped: u64) {
        let [received, shown] = self.rates;
        let ms = |time: Option<f64>| time.map_or("-".to_owned(), |t| format!("{t:.0} ms"));
        row(ui, "Data", self.kind.map_or("-", PacketKind::title).into());
        row(ui, "Packets", format!("{received:.0} /s"));
        let hover = "Pictures of live poses. More packets than that cannot be shown: the newest wins.";
        row(ui, "Shown", format!("{shown:.0} /s")).on_hover_text(hover);
        row(ui, "Dropped", dropped.to_string()).on_hover_text("Packets that newer ones overtook.");
        let hover = "From the arrival of a packet to its finished picture, median of the last 60; the window shows \
                     it next.";
        row(ui, "Latency", ms(self.latency_ms.get())).on_hover_text(hover);
        if let Some(time) = self.since_sent_ms.get() {
            let hover = "From the time that the sender writes into its packets (sent_ms) to the finished picture. \
                         Right if both clocks agree.";
            row(ui, "Since sent", ms(Some(time))).on_hover_text(hover);
        }
    }

    fn switches(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let mut smooth = self.options.smooth.unwrap_or(self.kind == Some(PacketKind::Landmarks));
            let hover = "Takes the tremble out of the poses of a noisy tracker; they lag a little. By default only \
                         landmarks are smoothed.";
            if ui.checkbox(&mut smooth, "smooth").on_hover_text(hover).changed() {
                self.options.smooth = Some(smooth);
            }
            let mut moves = !self.options.in_place;
            let hover = "Lets the hand move through space as the sender says; F finds it. Otherwise it turns and \
                         bends in place.";
            if ui.checkbox(&mut moves, "move in space").on_hover_text(hover).changed() {
                self.options.in_place = !moves;
            }
        });
    }
}

/// A reason that can be shown.
fn shortened(reason: &str) -> String {
    let mut shown: String = reason.chars().filter(|c| !c.is_control()).take(LONGEST_REASON).collect();
    if reason.chars().count() > LONGEST_REASON {
        shown.push('…');
    }
    shown
}

/// A name with a value at the right.
fn row(ui: &mut Ui, name: &str, value: String) -> egui::Response {
    let row = ui.horizontal(|ui| {
        ui.label(name);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.label(RichText::new(value).monospace()));
    });
    row.response
}
