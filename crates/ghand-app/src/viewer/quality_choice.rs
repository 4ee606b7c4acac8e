//! The preset in which an avatar is played. What has to be baked for it is baked beside the user interface.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use egui::Context;
use ghand_render::Gpu;

use crate::quality::{self, Playback, Quality};

/// The preset, and the avatar as it was trained.
#[derive(Debug)]
pub struct QualityChoice {
    chosen: Quality,
    playback: Playback,
    /// The avatar's file; `None` if what is shown has none.
    avatar: Option<PathBuf>,
    baking: Option<Baking>,
}

#[derive(Debug)]
struct Baking {
    quality: Quality,
    done: Receiver<anyhow::Result<(Playback, Option<PathBuf>)>>,
}

/// An avatar that is ready to be played in a preset.
#[derive(Debug)]
pub struct Prepared {
    /// The file to show; `None` if what is shown has none and stays.
    pub file: Option<PathBuf>,
    quality: Quality,
    playback: Playback,
}

impl QualityChoice {
    /// What is shown is played as it is.
    pub fn exact(avatar: Option<&Path>) -> QualityChoice {
        let avatar = avatar.map(Path::to_owned);
        QualityChoice { chosen: Quality::Exact, playback: Playback::EXACT, avatar, baking: None }
    }

    /// An avatar that was prepared for a preset before it is shown.
    pub fn prepared(avatar: &Path, chosen: Quality, playback: Playback) -> QualityChoice {
        QualityChoice { chosen, playback, ..QualityChoice::exact(Some(avatar)) }
    }

    /// The preset that is shown.
    pub fn chosen(&self) -> Quality {
        self.chosen
    }

    /// The part of its edges at which the picture is drawn.
    pub fn image_scale(&self) -> f32 {
        self.playback.image_scale as f32
    }

    /// Whether an avatar is being prepared.
    pub fn is_busy(&self) -> bool {
        self.baking.is_some()
    }

    /// Prepares the avatar for a preset. The user interface is drawn again once that is done.
    pub fn choose(&mut self, gpu: &Gpu, quality: Quality, context: &Context) {
        let (sender, done) = channel();
        let (gpu, avatar, context) = (gpu.clone(), self.avatar.clone(), context.clone());
        std::thread::spawn(move || {
            let prepare = || {
                // A device of its own: the window's cannot be resized while another thread keeps it busy.
                let gpu = gpu.reopen()?;
                let playback = quality::playback(&gpu, quality)?;
                let path = avatar.map(|path| quality::prepare(&gpu, &path, quality, playback)).transpose()?;
                Ok((playback, path))
            };
            // A closed channel means that the viewer no longer waits.
            let _ = sender.send(prepare());
            context.request_repaint();
        });
        self.baking = Some(Baking { quality, done });
    }

    /// The avatar, once it has been prepared.
    ///
    /// # Errors
    /// Why it could not be prepared.
    pub fn poll(&mut self) -> anyhow::Result<Option<Prepared>> {
        let Some(baking) = &self.baking else { return Ok(None) };
        let done = match baking.done.try_recv() {
            Err(TryRecvError::Empty) => return Ok(None),
            Err(TryRecvError::Disconnected) => Err(anyhow::anyhow!("the avatar could not be baked")),
            Ok(done) => done,
        };
        let quality = baking.quality;
        self.baking = None;
        let (playback, file) = done?;
        Ok(Some(Prepared { file, quality, playback }))
    }

    /// Says that what was prepared is shown now.
    pub fn show(&mut self, prepared: &Prepared) {
        (self.chosen, self.playback) = (prepared.quality, prepared.playback);
    }
}
