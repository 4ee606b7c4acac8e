//! Whether live poses are taken: start, stop, and what they do to the hand.

use egui::{Context, Ui};

use crate::viewer::document::Document;
use crate::viewer::document::subject::Subject;
use crate::viewer::live::feed::FeedSettings;
use crate::viewer::live::webcam::Webcam;
use crate::viewer::live::{Live, LiveEvent};

/// Live poses, while their port or webcam is open, and the settings with which it is opened.
#[derive(Default)]
pub struct LiveLink {
    live: Option<Live>,
    settings: FeedSettings,
}

impl LiveLink {
    /// Opens the port or webcam, now and whenever the user starts live poses again.
    ///
    /// # Errors
    /// One sentence if the port cannot be opened.
    pub fn start(&mut self, settings: FeedSettings) -> anyhow::Result<()> {
        let opened = Live::open(&settings);
        self.settings = settings;
        self.live = Some(opened.map_err(|error| error.context("live poses"))?);
        Ok(())
    }

    /// Waits until the webcam has given its first picture.
    ///
    /// # Errors
    /// One sentence that says why there is none; live poses are then closed.
    pub fn wait_for_webcam(&mut self) -> anyhow::Result<()> {
        let webcam = self.live.as_ref().and_then(|live| live.feed().webcam());
        let waited = webcam.map_or(Ok(()), Webcam::wait_for_picture);
        if waited.is_err() {
            self.live = None;
        }
        waited
    }

    /// Opens the port or webcam, or closes it; the last pose stays.
    ///
    /// # Errors
    /// As [`LiveLink::start`].
    pub fn start_or_stop(&mut self) -> anyhow::Result<()> {
        match self.live.take() {
            Some(_) => Ok(()),
            None => self.start(self.settings.clone()),
        }
    }

    /// Live poses, while they are open.
    pub fn live(&self) -> Option<&Live> {
        self.live.as_ref()
    }

    /// Whether live poses drive the hand now.
    pub fn drives(&self) -> bool {
        self.live.as_ref().is_some_and(Live::drives)
    }

    /// Whether packets arrive now.
    pub fn is_receiving(&self) -> bool {
        self.live.as_ref().is_some_and(Live::is_receiving)
    }

    /// Takes the newest live pose. A webcam that has ended is closed.
    pub fn advance(&mut self, document: &mut Document, context: &Context) -> Option<LiveEvent> {
        let event = self.live.as_mut()?.advance(document.hand_mut()?, context);
        if let Some(LiveEvent::Failed(_)) = event {
            self.live = None;
        }
        event
    }

    /// Another subject is shown; a scene has no pose.
    pub fn subject_changed(&mut self, subject: &Subject) {
        match subject {
            Subject::Hand(_) => self.live.iter_mut().for_each(Live::model_changed),
            Subject::Scene { .. } => self.live = None,
        }
    }

    /// A picture of the hand's present pose is rendered now.
    pub fn picture_started(&mut self) {
        self.live.iter_mut().for_each(Live::picture_started);
    }

    /// The picture that was started last is complete.
    pub fn picture_complete(&mut self) {
        self.live.iter_mut().for_each(Live::picture_complete);
    }

    /// Shows the controls while live poses are open.
    pub fn controls(&mut self, ui: &mut Ui) {
        let Some(live) = &mut self.live else { return };
        if live.controls(ui) {
            self.live = None;
        }
        ui.separator();
    }
}
