//! Where live poses come from: the port, or a webcam.

use ghand_footage::LiveSource;
use ghand_motion::live::port::{LivePort, LiveSettings, Mailbox};

use crate::viewer::live::webcam::Webcam;

/// Where live poses shall come from.
#[derive(Debug, Clone)]
pub enum FeedSettings {
    /// From other programs.
    Port(LiveSettings),
    /// From hands that a camera or a video shows.
    Webcam(LiveSource),
}

impl Default for FeedSettings {
    fn default() -> Self {
        FeedSettings::Port(LiveSettings::default())
    }
}

/// Where live poses come from.
pub enum Feed {
    /// From other programs.
    Port(LivePort),
    /// From hands that a camera or a video shows.
    Webcam(Webcam),
}

impl Feed {
    /// Opens it. A webcam goes on opening afterwards.
    ///
    /// # Errors
    /// One sentence if the port cannot be opened, such as when another program has it, or if there are no more threads.
    pub fn open(settings: &FeedSettings) -> anyhow::Result<Feed> {
        Ok(match settings {
            FeedSettings::Port(settings) => Feed::Port(LivePort::open(settings)?),
            FeedSettings::Webcam(source) => Feed::Webcam(Webcam::open(source.clone())?),
        })
    }

    /// Where its packets wait.
    pub fn mailbox(&self) -> &Mailbox {
        match self {
            Feed::Port(port) => port.mailbox(),
            Feed::Webcam(webcam) => webcam.mailbox(),
        }
    }

    /// The webcam, if it is one.
    pub fn webcam(&self) -> Option<&Webcam> {
        match self {
            Feed::Port(_) => None,
            Feed::Webcam(webcam) => Some(webcam),
        }
    }
}
