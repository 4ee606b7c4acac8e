//! The desktop's dialog that chooses a file, without stopping the user interface.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use egui::Context;

/// A dialog that closes sooner than this was never seen.
const UNSEEN: Duration = Duration::from_millis(1000);

/// A dialog that is open.
#[derive(Debug)]
pub struct FileDialog {
    chosen: Receiver<Option<PathBuf>>,
    opened: Instant,
}

/// What came of a dialog.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// The user chose this file.
    Chosen(PathBuf),
    /// The user chose none.
    Cancelled,
    /// The desktop has no dialog.
    Unavailable,
}

impl FileDialog {
    /// Opens the dialog. The user interface is drawn again once the user has chosen.
    pub fn open(context: &Context) -> FileDialog {
        let (sender, chosen) = channel();
        let dialog = rfd::AsyncFileDialog::new()
            .set_title("Open")
            .add_filter(
                "Avatars, scenes, hand models, poses",
                &["ghand", "ply", "glb", "gltf", "pkl", "npz", "npy", "json", "jsonl"],
            )
            .add_filter("All files", &["*"])
            // Must be made on the main thread on some desktops; waiting for it need not be there.
            .pick_file();
        let context = context.clone();
        std::thread::spawn(move || {
            let path = pollster::block_on(dialog).map(|file| file.path().to_owned());
            // A closed channel means that the viewer no longer waits.
            let _ = sender.send(path);
            context.request_repaint();
        });
        FileDialog { chosen, opened: Instant::now() }
    }

    /// What came of it; `None` while the dialog is open.
    pub fn poll(&self) -> Option<Outcome> {
        match self.chosen.try_recv() {
            Ok(Some(path)) => Some(Outcome::Chosen(path)),
            Err(TryRecvError::Empty) => None,
            Ok(None) | Err(TryRecvError::Disconnected) if self.opened.elapsed() < UNSEEN => Some(Outcome::Unavailable),
            Ok(None) | Err(TryRecvError::Disconnected) => Some(Outcome::Cancelled),
        }
    }
}
