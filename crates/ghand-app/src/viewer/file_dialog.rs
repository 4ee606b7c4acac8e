//! The desktop's dialog that chooses a file, without stopping the user interface.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use egui::Context;

/// A dialog that is open.
#[derive(Debug)]
pub struct FileDialog {
    chosen: Receiver<Option<PathBuf>>,
}

impl FileDialog {
    /// Opens the dialog. The user interface is drawn again once the user has chosen.
    pub fn open(context: &Context) -> FileDialog {
        let dialog = rfd::AsyncFileDialog::new()
            .set_title("Open")
            .add_filter(
                "Avatars, scenes, hand models, poses",
                &["ghand", "ply", "glb", "gltf", "pkl", "npz", "npy", "json", "jsonl"],
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

    fn wait(context: &Context, dialog: impl Future<Output = Option<rfd::FileHandle>> + Send + 'static) -> FileDialog {
        let (sender, chosen) = channel();
        let context = context.clone();
        std::thread::spawn(move || {
            let path = pollster::block_on(dialog).map(|file| file.path().to_owned());
            // A closed channel means that the viewer no longer waits.
            let _ = sender.send(path);
            context.request_repaint();
        });
        FileDialog { chosen }
    }

    /// The file that was chosen, `Some(None)` if none was or the desktop has no dialog; `None` while it is open.
    pub fn poll(&self) -> Option<Option<PathBuf>> {
        match self.chosen.try_recv() {
            Ok(path) => Some(path),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(None),
        }
    }
}
