//! The desktop's dialog that chooses a file, without stopping the user interface.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use egui::Context;

/// What to do on a desktop without a dialog.
pub const NO_DIALOG: &str =
    "this desktop has no dialog that chooses a file; install zenity (Debian or Ubuntu: apt-get install zenity)";
/// Nobody closes a dialog as soon as this after asking for it.
const SOONEST_CLOSED: Duration = Duration::from_secs(1);

/// A dialog that is open.
#[derive(Debug)]
pub struct FileDialog {
    answer: Receiver<Answer>,
}

/// What became of a dialog.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    /// This file was chosen.
    Chosen(PathBuf),
    /// It was closed.
    Closed,
    /// The desktop has none.
    Missing,
}

impl FileDialog {
    /// Opens the dialog. The user interface is drawn again once the user has chosen.
    pub fn open(context: &Context) -> FileDialog {
        let dialog = rfd::AsyncFileDialog::new()
            .set_title("Open")
            .add_filter(
                "Avatars, scenes, hand models, poses",
                &["ghand", "ply", "spz", "splat", "glb", "gltf", "pkl", "npz", "npy", "json", "jsonl"],
            )
            .add_filter("All files", &["*"])
            // Must be made on the main thread on some desktops; waiting for it need not be there.
            .pick_file();
        FileDialog::wait(context, dialog)
    }

    /// Opens the dialog that chooses a new file of one kind: its name, what it is and how it may end, the usual ending first.
    pub fn save(context: &Context, name: &str, kind: &str, endings: &[&str]) -> FileDialog {
        let dialog =
            rfd::AsyncFileDialog::new().set_title("Save").set_file_name(name).add_filter(kind, endings).save_file();
        FileDialog::wait(context, dialog)
    }

    /// Opens the dialog that chooses a folder to save to.
    pub fn folder(context: &Context) -> FileDialog {
        FileDialog::wait(context, rfd::AsyncFileDialog::new().set_title("Save to a folder").pick_folder())
    }

    fn wait(context: &Context, dialog: impl Future<Output = Option<rfd::FileHandle>> + Send + 'static) -> FileDialog {
        let (sender, answer) = channel();
        let context = context.clone();
        let asked = Instant::now();
        std::thread::spawn(move || {
            let answer = match pollster::block_on(dialog) {
                Some(file) => Answer::Chosen(file.path().to_owned()),
                None if asked.elapsed() < SOONEST_CLOSED && lacks_zenity() => Answer::Missing,
                None => Answer::Closed,
            };
            // A closed channel means that the viewer no longer waits.
            let _ = sender.send(answer);
            context.request_repaint();
        });
        FileDialog { answer }
    }

    /// What became of it; `None` while it is open.
    pub fn poll(&self) -> Option<Answer> {
        match self.answer.try_recv() {
            Ok(answer) => Some(answer),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Answer::Closed),
        }
    }
}

/// Whether the program is not there whose dialog stands in where the desktop has no portal with one.
fn lacks_zenity() -> bool {
    let is_unix = cfg!(all(unix, not(target_vendor = "apple")));
    is_unix && Command::new("zenity").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err()
}
