//! The panel of live poses: where they come from, how many and how late, and the controls.

use egui::{Align, Layout, RichText, Ui};
use ghand_motion::live::PacketKind;

use crate::viewer::live::Live;
use crate::viewer::live::feed::Feed;
use crate::viewer::live::webcam::Webcam;

/// Longest text that is shown, characters: a packet may contain any.
const LONGEST_TEXT: usize = 160;

impl Live {
    /// Shows what comes in, with the controls. Returns whether the user stops it.
    pub fn controls(&mut self, ui: &mut Ui) -> bool {
        let mut stop = false;
        ui.horizontal(|ui| {
            ui.label(RichText::new("Live poses").strong());
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let hover = match self.feed {
                    Feed::Port(_) => "Closes the port; the last pose stays",
                    Feed::Webcam(_) => "Closes the camera; the last pose stays",
                };
                stop = ui.button("Stop").on_hover_text(hover).clicked();
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
        let tally = self.feed.mailbox().tally();
        match &self.feed {
            Feed::Port(port) => {
                let address = format!("ws://127.0.0.1:{}", port.number());
                if tally.received == 0 {
                    ui.label(format!("waiting for data on {address}"));
                } else {
                    ui.label(RichText::new(address).weak());
                    let [received, ..] = self.rates;
                    row(ui, "Data", self.kind.map_or("-", PacketKind::title).into());
                    row(ui, "Packets", format!("{received:.0} /s"));
                    self.figures(ui, tally.dropped);
                }
            }
            Feed::Webcam(webcam) => {
                ui.label(RichText::new(shortened(webcam.name())).weak());
                ui.label(sight(webcam));
                if webcam.pictures() > 0 {
                    let [.., tracked] = self.rates;
                    let hover = "Pictures of the camera in which hands are searched. More than this computer can track \
                                 are dropped: the newest wins.";
                    row(ui, "Tracked", format!("{tracked:.0} /s")).on_hover_text(hover);
                    self.figures(ui, tally.dropped + webcam.dropped());
                }
            }
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
        let [_, shown, _] = self.rates;
        let ms = |time: Option<f64>| time.map_or("-".to_owned(), |t| format!("{t:.0} ms"));
        let hover = "Pictures of live poses. More packets than that cannot be shown: the newest wins.";
        row(ui, "Shown", format!("{shown:.0} /s")).on_hover_text(hover);
        row(ui, "Dropped", dropped.to_string()).on_hover_text("Those that newer ones overtook.");
        let hover = "From the arrival of a packet, or of a camera's picture, to the finished picture of its pose, median \
                     of the last 60; the window shows it next.";
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

/// What a webcam sees.
fn sight(webcam: &Webcam) -> &'static str {
    match (webcam.pictures(), webcam.hands()) {
        (0, _) => "waiting for its first picture",
        (_, 0) => "no hand is seen",
        (_, 1) => "one hand is seen",
        (_, _) => "two hands are seen",
    }
}

/// A text that can be shown.
fn shortened(text: &str) -> String {
    let mut shown: String = text.chars().filter(|c| !c.is_control()).take(LONGEST_TEXT).collect();
    if text.chars().count() > LONGEST_TEXT {
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
