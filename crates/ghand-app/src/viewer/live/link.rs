//! Whether live poses are taken: start, stop, and what they do to the hand.

use egui::{Context, Ui};
use ghand_footage::LiveSource;

use crate::viewer::document::Document;
use crate::viewer::document::subject::Subject;
use crate::viewer::live::cameras::CameraList;
use crate::viewer::live::feed::FeedSettings;
use crate::viewer::live::webcam::Webcam;
use crate::viewer::live::{Live, LiveEvent};

/// Live poses, while their port or webcam is open, and the settings with which it is opened.
#[derive(Default)]
pub struct LiveLink {
    live: Option<Live>,
    settings: FeedSettings,
    cameras: CameraList,
    /// The camera that was chosen last.
    webcam: Option<LiveSource>,
    /// Whether live poses were opened as a webcam, beside the settings.
    is_chosen: bool,
}

impl LiveLink {
    /// Opens the port or webcam, now and whenever the user starts live poses again.
    ///
    /// # Errors
    /// One sentence if the port cannot be opened.
    pub fn start(&mut self, settings: FeedSettings) -> anyhow::Result<()> {
        let opened = Live::open(&settings);
        self.settings = settings;
        self.is_chosen = false;
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

    /// Opens the port or webcam of the settings, or closes it; the last pose stays.
    ///
    /// # Errors
    /// As [`LiveLink::start`].
    pub fn start_or_stop(&mut self) -> anyhow::Result<()> {
        let is_open = self.is_open();
        self.live = None;
        if is_open { Ok(()) } else { self.start(self.settings.clone()) }
    }

    /// Whether the port or webcam of the settings is open.
    pub fn is_open(&self) -> bool {
        self.live.is_some() && !self.is_chosen
    }

    /// Opens the camera that was chosen last, else the first one; or closes the webcam.
    ///
    /// # Errors
    /// One sentence if there is no camera. What goes wrong later is told by [`LiveLink::advance`].
    pub fn start_or_stop_webcam(&mut self) -> anyhow::Result<()> {
        if self.webcam_name().is_some() {
            self.live = None;
            return Ok(());
        }
        let source = self.webcam.clone().map_or_else(LiveSource::first_camera, Ok)?;
        self.open_webcam(source)
    }

    /// Opens a camera in place of what is open.
    ///
    /// # Errors
    /// If no threads can be started. What goes wrong later is told by [`LiveLink::advance`].
    pub fn open_webcam(&mut self, source: LiveSource) -> anyhow::Result<()> {
        // A camera can be open only once.
        self.live = None;
        self.webcam = Some(source.clone());
        self.live = Some(Live::open(&FeedSettings::Webcam(source))?);
        self.is_chosen = true;
        Ok(())
    }

    /// The name of the webcam, while it is open.
    pub fn webcam_name(&self) -> Option<&str> {
        Some(self.live.as_ref()?.feed().webcam()?.name())
    }

    /// The connected cameras, as far as they are known yet.
    pub fn cameras(&self, context: &Context) -> Vec<LiveSource> {
        self.cameras.cameras(context)
    }

    /// Takes these for the connected cameras.
    #[cfg(test)]
    pub fn set_cameras(&mut self, cameras: Vec<LiveSource>) {
        self.cameras = CameraList::of(cameras);
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
            // It may be unplugged.
            self.webcam = None;
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
