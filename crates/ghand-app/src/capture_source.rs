//! A capture that a user names, and how to open it.

use std::path::{Path, PathBuf};

use anyhow::{anyhow, bail};
use clap::Args;
use ghand_capture::capture::HandModelSource;
use ghand_capture::mask::MaskMethod;
use ghand_capture::{Capture, CaptureKind, OpenOptions, Opened};
use ghand_core::Side;
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::hand_model_file::HandModelReading;
use crate::say;

/// Options that say which capture, and what its own files do not say. Part of a run's record on disk.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, Args)]
pub struct CaptureSource {
    /// Folder of a capture or its capture.json; InterHand2.6M or one of its folders, such as images/test/Capture0; or a
    /// subject of the Hand Appearance dataset.
    #[arg(long)]
    pub capture: Option<PathBuf>,
    /// What its own files do not say.
    #[command(flatten)]
    pub options: CaptureReading,
}

/// What a capture's own files do not say. Commands that take it call the capture's argument `capture`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, Args)]
pub struct CaptureReading {
    /// MANO model for captures whose poses are MANO's: MANO_RIGHT.pkl, or MANO_LEFT.pkl for the left hand.
    #[arg(long, value_name = "FILE", requires = "capture")]
    pub hand_model: Option<PathBuf>,
    /// How to read that file, or any other hand model of a command.
    #[command(flatten)]
    pub hand_model_args: HandModelReading,
    /// InterHand2.6M: sequences to train on [default: ROM04_RT_Occlusion, LT for a left hand]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "capture")]
    pub train_sequences: Vec<String>,
    /// InterHand2.6M: sequences to test on [default: ROM03_RT_No_Occlusion, LT for a left hand]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "capture")]
    pub test_sequences: Vec<String>,
    /// Hand Appearance: principal point in pixels [default: 224,224]
    #[arg(long, value_name = "X,Y", value_parser = parse_point, requires = "capture")]
    pub principal_point: Option<DVec2>,
}

fn parse_point(text: &str) -> anyhow::Result<DVec2> {
    let point = text.split_once(',').and_then(|(x, y)| {
        let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite());
        Some(DVec2::new(number(x)?, number(y)?))
    });
    point.ok_or_else(|| anyhow!("must be two numbers in pixels, such as 224,224"))
}

impl CaptureSource {
    /// Fails if an option says something about a capture, but none is given.
    ///
    /// # Errors
    /// One sentence that names the option.
    pub fn check(&self) -> anyhow::Result<()> {
        if self.capture.is_none() { self.options.refuse_without_capture() } else { Ok(()) }
    }

    /// The files and folders that these options name.
    pub fn inputs(&self) -> Vec<PathBuf> {
        self.capture.iter().chain(self.options.inputs()).cloned().collect()
    }

    /// The same files from any folder.
    ///
    /// # Errors
    /// If the present folder does not exist any more.
    pub fn absolute(&self) -> std::io::Result<CaptureSource> {
        let absolute = |path: &Option<PathBuf>| path.as_ref().map(std::path::absolute).transpose();
        let hand_model = absolute(&self.options.hand_model)?;
        let options = CaptureReading { hand_model, ..self.options.clone() };
        Ok(CaptureSource { capture: absolute(&self.capture)?, options })
    }

    /// Opens the capture at `path` and removes unusable images from the `needed` splits, and from the `optional` ones
    /// if they have images. One warning reports the skipped images.
    ///
    /// # Errors
    /// One sentence that names the file, the field and a remedy; also when a needed split is missing.
    pub fn open(&self, path: &Path, needed: &[&str], optional: &[&str]) -> anyhow::Result<Capture> {
        let opened = self.options.open(path)?;
        opened.warnings.iter().for_each(|warning| log::warn!("{warning}"));
        let mut capture = opened.capture;
        // Before images are checked, which may take long.
        needed.iter().try_for_each(|name| capture.split(name).map(|_| ()))?;
        let has_images = |name: &&&str| capture.splits.get(**name).is_some_and(|split| !split.views.is_empty());
        let splits: Vec<&str> = needed.iter().chain(optional.iter().filter(has_images)).copied().collect();
        match capture.images.made_masks.as_ref().map(|made| made.method) {
            Some(MaskMethod::Outline) => {
                say!("checking the images of {}; missing masks are made once", splits.join(" and "));
            }
            Some(MaskMethod::Colors) => say!(
                "masks: missing ones are made once, from the poses and the colours of all frames; see them with \
                 `ghand inspect`"
            ),
            None => {}
        }
        let dropped = capture.skip_unusable_images(&splits)?;
        for counts in [opened.skipped_images, dropped] {
            if counts.total() > 0 {
                log::warn!("{}: {counts}", path.display());
            }
        }
        Ok(capture)
    }
}

impl CaptureReading {
    /// Opens the capture at `path` with all images. The warnings include oddities of the hand model's file.
    ///
    /// # Errors
    /// One sentence that names the file, the field and what to do.
    pub fn open(&self, path: &Path) -> anyhow::Result<Opened> {
        if self.hand_model.is_none() {
            self.hand_model_args.refuse_for("no --hand-model is given")?;
        }
        let file = self.hand_model.as_ref().map(|file| self.hand_model_args.load(Some(file))).transpose()?;
        let mut warnings = vec![];
        let mano = file.map(|file| {
            warnings.extend(file.warnings.iter().map(|warning| format!("{}: {warning}", file.model.name)));
            file.model
        });
        let options = OpenOptions {
            mano,
            train_sequences: self.train_sequences.clone(),
            test_sequences: self.test_sequences.clone(),
            principal_point: self.principal_point,
        };
        let mut opened = Capture::open_with(path, &options)?;
        self.refuse_unused(path, &opened)?;
        warnings.append(&mut opened.warnings);
        opened.warnings = warnings;
        Ok(opened)
    }

    /// The files that these options name.
    pub fn inputs(&self) -> impl Iterator<Item = &PathBuf> {
        self.hand_model.iter()
    }

    /// Fails if an option is given that says nothing about this capture.
    fn refuse_unused(&self, path: &Path, opened: &Opened) -> anyhow::Result<()> {
        let refuse = |option: &str, reason: &str| bail!("{option}: {} {reason}; omit {option}", path.display());
        if self.hand_model.is_some() && opened.capture.hand_model_source != HandModelSource::Mano {
            refuse("--hand-model", "brings its own hand model, and its poses are that one's")?;
        }
        let is = |kind| opened.kind == kind;
        for (option, given) in
            [("--train-sequences", &self.train_sequences), ("--test-sequences", &self.test_sequences)]
        {
            if !given.is_empty() && !is(CaptureKind::InterHand) {
                refuse(option, "is not InterHand2.6M, and has no sequences")?;
            }
        }
        if self.principal_point.is_some() && !is(CaptureKind::HandAppearance) {
            refuse("--principal-point", "is not of the Hand Appearance dataset, and its cameras say it")?;
        }
        Ok(())
    }

    /// Fails if any of these options is given, for a command line without a capture.
    ///
    /// # Errors
    /// One sentence that names the option.
    pub fn refuse_without_capture(&self) -> anyhow::Result<()> {
        match self.given() {
            Some(option) => bail!("{option}: is for captures, and no --capture is given; omit {option}"),
            None => self.hand_model_args.refuse_for("no --hand-model is given"),
        }
    }

    /// The first given option that applies only to captures, if any.
    pub fn given(&self) -> Option<&'static str> {
        [
            ("--hand-model", self.hand_model.is_some()),
            ("--train-sequences", !self.train_sequences.is_empty()),
            ("--test-sequences", !self.test_sequences.is_empty()),
            ("--principal-point", self.principal_point.is_some()),
        ]
        .into_iter()
        .find_map(|(name, given)| given.then_some(name))
    }
}

/// Fails if an avatar is compared with a capture of the other hand.
///
/// # Errors
/// One sentence that names both.
pub fn check_sides(avatar: &str, side: Side, capture: &Capture) -> anyhow::Result<()> {
    if side != capture.side {
        bail!(
            "{avatar}: is a {side} hand, but {} shows a {} one; give a capture of the same hand",
            capture.root.display(),
            capture.side
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_two_numbers() {
        assert_eq!(parse_point("224, 230.5").unwrap(), DVec2::new(224.0, 230.5));
        for text in ["", "224", "1,2,3", "a,b", "1,nan", "1,inf"] {
            assert!(parse_point(text).is_err(), "{text}");
        }
    }
}
