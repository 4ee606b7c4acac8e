//! A viewer beside a run, which shows the avatar while it is trained.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use ghand_avatar::Avatar;

use crate::cli::check_display;
use crate::run_files::PREVIEW_AVATAR;

/// Writes avatars to a file that a viewer watches, beside training, which never waits for either. The viewer is a program
/// of its own: closing it does not end the run, and it stays open when the run has ended. When this is dropped, the last
/// file is complete.
pub struct LiveViewer {
    avatars: Option<SyncSender<Avatar>>,
    writer: Option<JoinHandle<()>>,
}

impl LiveViewer {
    /// A viewer of the run in `folder`, which opens with the first avatar; `None`, with a warning, if there is no display.
    pub fn open(folder: &Path, checkpoints: &Path) -> Option<LiveViewer> {
        // The error's remedy is that of the viewer.
        if check_display().is_err() {
            log::warn!("--viewer: there is no display, so the run continues without the viewer");
            return None;
        }
        Some(LiveViewer::with_program(viewer_program(), folder, checkpoints))
    }

    fn with_program(program: PathBuf, folder: &Path, checkpoints: &Path) -> LiveViewer {
        // One is written while one waits; others are dropped.
        let (sender, avatars) = sync_channel(1);
        let folder = folder.to_owned();
        let file = checkpoints.join(PREVIEW_AVATAR);
        let writer = std::thread::spawn(move || write_all(&avatars, &file, &program, &folder));
        LiveViewer { avatars: Some(sender), writer: Some(writer) }
    }

    /// Shows an avatar, unless the last one is still being written.
    pub fn show(&self, avatar: Avatar) {
        let Some(avatars) = &self.avatars else { return };
        match avatars.try_send(avatar) {
            Ok(()) | Err(TrySendError::Full(_)) => {}
            Err(TrySendError::Disconnected(_)) => log::debug!("the avatar is no longer shown"),
        }
    }
}

impl Drop for LiveViewer {
    fn drop(&mut self) {
        // The thread ends when the channel is closed.
        self.avatars = None;
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

fn write_all(avatars: &Receiver<Avatar>, file: &Path, program: &Path, folder: &Path) {
    let mut is_open = false;
    for avatar in avatars {
        // It is only for looking at.
        match avatar.save(file) {
            Ok(()) if !is_open => {
                is_open = true;
                start(program, folder);
            }
            Ok(()) => {}
            Err(error) => log::debug!("{error}"),
        }
    }
}

fn start(program: &Path, folder: &Path) {
    let mut command = Command::new(program);
    command.arg(folder).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    // Ctrl+C in the terminal stops the run, and not the viewer.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    if let Err(error) = command.spawn() {
        log::warn!(
            "--viewer: {}: cannot be started: {error}; the run continues without it (`cargo build --bin viewer` builds it)",
            program.display()
        );
    }
}

/// The viewer that was installed with this program.
fn viewer_program() -> PathBuf {
    let name = format!("viewer{}", std::env::consts::EXE_SUFFIX);
    std::env::current_exe().map_or_else(|_| name.clone().into(), |program| program.with_file_name(&name))
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt;
    use std::time::{Duration, Instant};

    use ghand_avatar::AvatarConfig;
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    #[test]
    fn the_viewer_opens_once_with_the_first_avatar_and_nobody_waits_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let opened = folder.path().join("opened");
        let program = folder.path().join("viewer");
        // It never ends by itself, like a window.
        std::fs::write(&program, "#!/bin/sh\ntest -f \"$1/preview.ghand\" && echo \"$1\" >>\"$1/opened\"\nsleep 5\n")
            .unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let viewer = LiveViewer::with_program(program, folder.path(), folder.path());
        let hand = builtin_hand(Side::Right).unwrap();
        let avatar = Avatar::untrained(&hand, &AvatarConfig::default(), [0.86, 0.65, 0.54], 0).unwrap();
        let start = Instant::now();
        for _ in 0..3 {
            viewer.show(avatar.clone());
            std::thread::sleep(Duration::from_millis(50));
        }
        drop(viewer);
        assert!(start.elapsed() < Duration::from_secs(4), "it waits for the viewer");
        assert_eq!(Avatar::load(&folder.path().join(PREVIEW_AVATAR)).unwrap().tables, avatar.tables);
        while !opened.exists() && start.elapsed() < Duration::from_secs(10) {
            std::thread::sleep(Duration::from_millis(20));
        }
        std::thread::sleep(Duration::from_millis(200));
        assert_eq!(std::fs::read_to_string(&opened).unwrap().lines().count(), 1);
    }

    #[test]
    fn a_viewer_that_cannot_be_started_is_no_error() {
        let folder = tempfile::tempdir().unwrap();
        let viewer = LiveViewer::with_program("/nowhere/viewer".into(), folder.path(), folder.path());
        let hand = builtin_hand(Side::Right).unwrap();
        viewer.show(Avatar::untrained(&hand, &AvatarConfig::default(), [0.86, 0.65, 0.54], 0).unwrap());
        drop(viewer);
        assert!(folder.path().join(PREVIEW_AVATAR).exists());
    }
}
