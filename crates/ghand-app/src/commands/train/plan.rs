//! What a run of `train` does, and where: by its options, or by the record of the run that it resumes.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{anyhow, bail};
use ghand_train::presets::Preset;
use ghand_train::{Align, TrainSettings};

use super::TrainArgs;
use crate::command_inputs::refuse_capture_folder;
use crate::say;
use crate::train_run::demo_capture::DEMO_CAPTURE;
use crate::train_run::run_folder::{DEFAULT_FOLDER, RunFolder};
use crate::train_run::run_record::RunRecord;
use crate::train_run::training_poses::StartPoses;

/// A run that is to be begun or continued.
pub(super) struct Plan {
    pub folder: RunFolder,
    pub record: RunRecord,
    pub resumed: bool,
    /// Time between two checkpoints.
    pub checkpoint_every: Duration,
    /// Of every how many iterations a checkpoint is kept; 0: of none.
    pub keep_checkpoints: u64,
}

/// What there is to do.
pub(super) enum Planned {
    /// A run.
    Run(Box<Plan>),
    /// Nothing: the run in this folder has ended.
    HasEnded(PathBuf),
}

impl Planned {
    /// Chooses and locks the folder. A line says so if its run has ended.
    pub fn new(args: &TrainArgs) -> anyhow::Result<Planned> {
        if let (Some(out), Some(capture), false) = (&args.out, &args.capture.capture, args.force) {
            refuse_capture_folder("--out", out, capture)?;
        }
        let folder = args.folder()?;
        let Some((record, resumed)) = args.record_in(&folder)? else {
            say!("the run in {} has ended: there is nothing to go on with", folder.path().display());
            return Ok(Planned::HasEnded(folder.path().into()));
        };
        Ok(Planned::Run(Box::new(Plan {
            resumed,
            checkpoint_every: args.checkpoint_every.or(record.checkpoint_every).unwrap_or(CHECKPOINT_EVERY),
            keep_checkpoints: args.keep_checkpoints.or(record.keep_checkpoints).unwrap_or(0),
            folder,
            record,
        })))
    }
}

impl Plan {
    /// Name of the split for evaluation.
    pub fn test_split(&self) -> &str {
        self.record.test_split.as_deref().unwrap_or(DEFAULT_TEST_SPLIT)
    }

    /// How many iterations were done.
    pub fn progress(&self, iterations: u64) -> String {
        format!("{iterations} of {} iterations", self.record.settings.iterations)
    }
}

impl TrainArgs {
    pub(super) fn settings(&self) -> anyhow::Result<TrainSettings> {
        self.settings.settings((self.poses == Some(StartPoses::Truth)).then_some(Align::Off))
    }

    fn folder(&self) -> anyhow::Result<RunFolder> {
        let default = Path::new(DEFAULT_FOLDER);
        match &self.out {
            Some(out) if self.resume && !out.exists() && self.capture.capture.is_none() => Err(nothing_to_resume(out)),
            out if self.resume => RunFolder::resumed(out.as_deref(), default),
            Some(out) => RunFolder::named(out, self.force),
            None if self.force => RunFolder::named(default, true),
            None => RunFolder::next(default),
        }
    }

    /// The run as these options describe it.
    fn record(&self) -> anyhow::Result<RunRecord> {
        let mut capture = self.capture.clone();
        let demo = match &self.out {
            _ if capture.capture.is_some() => None,
            Some(out) => Some(out.join("capture")),
            None => Some(PathBuf::from(DEMO_CAPTURE)),
        };
        let is_demo = demo.is_some();
        capture.capture = capture.capture.or(demo);
        let poses = match self.poses.clone().unwrap_or_default() {
            StartPoses::File(path) => StartPoses::File(std::path::absolute(path)?),
            other => other,
        };
        Ok(RunRecord {
            capture: capture.absolute()?,
            demo: is_demo,
            split: self.split.clone().unwrap_or_else(|| DEFAULT_SPLIT.into()),
            test_split: self.test_split.clone(),
            poses: poses.to_string(),
            lpips: self.lpips.absolute()?,
            preset: self.settings.preset().into(),
            settings: self.settings()?,
            ignore_checks: self.ignore_checks,
            checkpoint_every: self.checkpoint_every,
            keep_checkpoints: self.keep_checkpoints,
            quality: None,
        })
    }

    /// The run in a folder, and whether it is resumed; `None` if it has ended.
    fn record_in(&self, folder: &RunFolder) -> anyhow::Result<Option<(RunRecord, bool)>> {
        let asked = self.record()?;
        if !self.resume {
            return Ok(Some((asked, false)));
        }
        let Some(record) = RunRecord::load(&folder.record())? else {
            if folder.is_finished() {
                return Ok(None);
            }
            if self.capture.capture.is_none() {
                return Err(nothing_to_resume(folder.path()));
            }
            say!("there is no run to go on with in {}: it begins", folder.path().display());
            return Ok(Some((asked, false)));
        };
        let differs = |option: &str, then: String| {
            anyhow!("{option}: the run in {} was started with {then}; leave the option out", folder.path().display())
        };
        if self.capture.capture.is_some() && asked.capture != record.capture {
            let then = record.capture.capture.unwrap_or_default();
            return Err(differs("--capture", format!("{} or other options of it", then.display())));
        }
        if self.split.is_some() && asked.split != record.split {
            return Err(differs("--split", record.split));
        }
        if self.test_split.is_some() && asked.test_split != record.test_split {
            return Err(differs("--test-split", record.test_split.unwrap_or_else(|| DEFAULT_TEST_SPLIT.into())));
        }
        if self.poses.is_some() && asked.poses != record.poses {
            return Err(differs("--poses", record.poses));
        }
        if self.lpips.lpips.is_some() && asked.lpips != record.lpips {
            return Err(differs("--lpips", "other weights".into()));
        }
        if self.settings.any_given()
            && let Some((key, then, now)) = record.settings.first_difference(&asked.settings)
        {
            bail!(
                "--resume: the setting `{key}` is {now}, but the run in {} was started with {then}; omit the options of \
                 settings",
                folder.path().display()
            );
        }
        Ok(Some((record, true)))
    }
}

fn nothing_to_resume(folder: &Path) -> anyhow::Error {
    anyhow!(
        "{}: there is no run to go on with; to begin one, give its --capture or leave out --resume",
        folder.display()
    )
}

/// The usual time between two checkpoints.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);
/// The usual name of the split for training.
const DEFAULT_SPLIT: &str = "train";
/// The usual name of the split for evaluation.
pub(super) const DEFAULT_TEST_SPLIT: &str = "test";

/// The command that makes the same run again.
pub(super) fn command(record: &RunRecord) -> String {
    let RunRecord { capture, split, test_split, poses, preset, settings, .. } = record;
    let mut command = format!("train --preset {preset}");
    if let (false, Some(path)) = (record.demo, &capture.capture) {
        command += &format!(" --capture {}", path.display());
    }
    if let Some(path) = &record.lpips.lpips {
        command += &format!(" --lpips {}", path.display());
    }
    let options = [("--split", Some(split), DEFAULT_SPLIT), ("--poses", Some(poses), "given")];
    let named = [("--test-split", test_split.as_ref(), DEFAULT_TEST_SPLIT)];
    for (option, value, default) in options.into_iter().chain(named) {
        if let Some(value) = value.filter(|value| *value != default) {
            command += &format!(" {option} {value}");
        }
    }
    // What the preset does not say.
    let start = Preset::by_name(preset).and_then(Preset::settings).unwrap_or_default().to_toml();
    for line in settings.to_toml().lines().filter(|line| !start.lines().any(|other| other == *line)) {
        command += &format!(" --set {}", line.replace(" = ", "=").replace('"', ""));
    }
    command
}
