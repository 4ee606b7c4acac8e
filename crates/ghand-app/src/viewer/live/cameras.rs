//! The cameras of this computer, listed beside the user interface: some systems take a second for it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use egui::Context;
use ghand_footage::LiveSource;

/// A list older than this is made anew when it is looked at: cameras come and go.
const FRESH: Duration = Duration::from_secs(3);

/// The cameras that were connected when somebody last looked.
#[derive(Default)]
pub struct CameraList {
    found: Arc<Mutex<Found>>,
}

#[derive(Default)]
struct Found {
    cameras: Vec<LiveSource>,
    /// When the list was asked for.
    asked: Option<Instant>,
}

impl CameraList {
    /// The cameras, as far as they are known; begins to look for them if that was long ago, and then shows another frame.
    pub fn cameras(&self, context: &Context) -> Vec<LiveSource> {
        let mut found = lock(&self.found);
        if found.asked.is_none_or(|asked| asked.elapsed() > FRESH) {
            found.asked = Some(Instant::now());
            let (shared, context) = (self.found.clone(), context.clone());
            let list = move || {
                let cameras = LiveSource::cameras();
                lock(&shared).cameras = cameras;
                context.request_repaint();
            };
            // Without a thread there is no choice; the first camera can still be opened.
            _ = thread::Builder::new().name("list of cameras".into()).spawn(list);
        }
        found.cameras.clone()
    }

    /// These for as long as a test runs.
    #[cfg(test)]
    pub fn of(cameras: Vec<LiveSource>) -> CameraList {
        let asked = Some(Instant::now() + Duration::from_secs(3600));
        CameraList { found: Arc::new(Mutex::new(Found { cameras, asked })) }
    }
}

fn lock(found: &Mutex<Found>) -> MutexGuard<'_, Found> {
    found.lock().unwrap_or_else(PoisonError::into_inner)
}
