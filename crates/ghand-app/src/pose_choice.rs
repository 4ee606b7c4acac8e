//! Selects the poses for a command: a pose or a motion by name, or a file.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use clap::Args;
use ghand_capture::cameras::list::read_cameras;
use ghand_core::{HandModel, Pose, Side};
use ghand_hand_model::files::mano::LeftShapes;
use ghand_hand_model::joints::axes::why_without_axes;
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use ghand_motion::motions::{MOTION_NAMES, motion};
use ghand_motion::pose_sequence::{DEFAULT_FPS, read_poses_and_fit};
use ghand_motion::{LandmarkFit, PoseFrame, PoseOptions, PoseSequence};

use crate::hand_model_file::load_hand_model;

/// How to read poses.
#[derive(Debug, Clone, Default, Args)]
pub struct PoseReadingArgs {
    /// Which hand the poses are of, if a file has both or is wrong [default: the model's, else the other one, mirrored]
    #[arg(long, value_name = "left|right", value_parser = parse_side)]
    side: Option<Side>,
    /// The hand model or avatar that the poses are for, for an exact transfer to another skeleton: a MANO model for
    /// MANO parameters; for ghand's own poses, their model if the file does not describe it
    #[arg(long, value_name = "FILE")]
    pose_model: Option<PathBuf>,
    /// Read poses as measured from the flat hand: a MANO model's mean pose is not added
    #[arg(long)]
    pub(crate) flat_mean: bool,
    /// Whether a left hand's MANO rotations are a right hand's in the mirrored image, as HaMeR and WiLoR give them
    /// [default: the file's, else as its names suggest]
    #[arg(long, value_name = "yes|no", value_parser = parse_yes)]
    mirrored: Option<bool>,
    /// Which capture of a file that holds several
    #[arg(long, value_name = "NAME")]
    take: Option<String>,
    /// Keep the hand in its rest position: only the fingers move
    #[arg(long)]
    in_place: bool,
    /// The cameras of landmarks in images: a capture.json, its folder, a JSON file with such cameras, or a complete
    /// calibration of another tool
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// Frames per second of a file's frames, if it does not say or is wrong
    #[arg(long, value_name = "N", value_parser = parse_fps)]
    file_fps: Option<f64>,
    /// Smooth a file's poses with a 1€ filter, and interpolate single frames that jump
    #[arg(long)]
    smooth: bool,
    /// Frames per second of a motion, or of a file (interpolated) [default: 30, or the file's]; also of a film
    #[arg(long, value_name = "N", value_parser = parse_fps)]
    pub(crate) fps: Option<f64>,
}

pub(crate) fn parse_side(text: &str) -> Result<Side, String> {
    match text {
        "left" => Ok(Side::Left),
        "right" => Ok(Side::Right),
        _ => Err("must be left or right".into()),
    }
}

fn parse_yes(text: &str) -> Result<bool, String> {
    match text {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err("must be yes or no".into()),
    }
}

pub(crate) fn parse_fps(text: &str) -> Result<f64, String> {
    let fps = text.parse().ok().filter(|fps| (0.1..=1000.0).contains(fps));
    fps.ok_or_else(|| "must be a number of frames per second from 0.1 to 1000".into())
}

impl PoseReadingArgs {
    /// The poses that `text` stands for: one of [`POSE_NAMES`], one of [`MOTION_NAMES`], or a file of any kind that
    /// [`ghand_motion::pose_sequence`] reads, or a capture's folder. What the user should know is logged.
    ///
    /// # Errors
    /// One sentence that names the file and the field, or lists the existing names.
    pub fn load(&self, text: &str, model: &HandModel) -> anyhow::Result<PoseSequence> {
        let sequence = self.load_with_fit(text, model)?.0;
        if let (Some(_), 1) = (self.fps, sequence.frames.len()) {
            bail!("--fps: {text} is one pose, not a motion; omit --fps");
        }
        Ok(sequence)
    }

    /// The files and folders that poses are read from.
    pub fn inputs(&self, poses: Option<&str>) -> Vec<PathBuf> {
        let named = poses.filter(|text| !is_name(text)).map(PathBuf::from);
        named.into_iter().chain(self.pose_model.clone()).chain(self.cameras.clone()).collect()
    }

    /// The first given option that applies only to files of poses, if any.
    fn given_for_files(&self) -> Option<&'static str> {
        let given = [
            ("--side", self.side.is_some()),
            ("--pose-model", self.pose_model.is_some()),
            ("--flat-mean", self.flat_mean),
            ("--take", self.take.is_some()),
            ("--in-place", self.in_place),
            ("--cameras", self.cameras.is_some()),
            ("--mirrored", self.mirrored.is_some()),
            ("--file-fps", self.file_fps.is_some()),
            ("--smooth", self.smooth),
        ];
        given.into_iter().find_map(|(name, given)| given.then_some(name))
    }

    /// Fails if any of these options is given, for a command line without the option `needed`, which names poses.
    ///
    /// # Errors
    /// One sentence that names the option.
    pub fn refuse_without(&self, needed: &str) -> anyhow::Result<()> {
        match self.given_for_files().or(self.fps.map(|_| "--fps")) {
            Some(option) => bail!("{option}: says how poses are read, and needs {needed}; give it, or omit {option}"),
            None => Ok(()),
        }
    }

    /// What of these options applies to motions by name.
    #[must_use]
    pub fn for_names(&self) -> PoseReadingArgs {
        PoseReadingArgs { fps: self.fps, ..PoseReadingArgs::default() }
    }

    /// Like [`Self::load`], with how well the hand fits if the poses are from landmarks.
    ///
    /// # Errors
    /// As in [`Self::load`].
    pub fn load_with_fit(&self, text: &str, model: &HandModel) -> anyhow::Result<(PoseSequence, Option<LandmarkFit>)> {
        if is_name(text)
            && let Some(option) = self.given_for_files()
        {
            bail!("{option}: {text:?} is a pose or motion of ghand, not a file; omit {option}");
        }
        if let Some(sequence) = poses_by_name(text, model, self.fps.unwrap_or(DEFAULT_FPS))? {
            return Ok((sequence, None));
        }
        let path = Path::new(text);
        let pose_model = match &self.pose_model {
            Some(path) => {
                let file = load_hand_model(path, LeftShapes::Fixed)?;
                file.warnings.iter().for_each(|warning| log::warn!("{}: {warning}", path.display()));
                Some(file.model)
            }
            None => None,
        };
        let options = PoseOptions {
            side: self.side,
            pose_model,
            flat_mean: self.flat_mean,
            mirrored: self.mirrored,
            take: self.take.clone(),
            file_fps: self.file_fps,
            smooth: self.smooth,
            by_id: false,
            in_place: self.in_place,
            cameras: match &self.cameras {
                Some(path) => read_cameras(path).context("--cameras")?,
                None => vec![],
            },
        };
        let (sequence, fit) = read_poses_and_fit(path, model, &options)?;
        for warning in &sequence.warnings {
            log::warn!("{text}: {warning}");
        }
        match self.fps {
            Some(fps) => Ok((sequence.resampled(fps).with_context(|| format!("{text}: --fps {fps}"))?, fit)),
            None => Ok((sequence, fit)),
        }
    }
}

/// Whether this is a pose or a motion by name.
pub fn is_name(text: &str) -> bool {
    POSE_NAMES.contains(&text) || MOTION_NAMES.contains(&text)
}

/// The frame of that id, else of that number, counted from 0.
///
/// # Errors
/// An error with the first and the last id.
pub fn choose_frame(mut frames: Vec<PoseFrame>, wanted: &str) -> anyhow::Result<PoseFrame> {
    let number = frame_number(&frames, wanted)?;
    Ok(frames.swap_remove(number))
}

/// The number, counted from 0, of the frame of that id, else of that number.
///
/// # Errors
/// As in [`choose_frame`].
pub fn frame_number(frames: &[PoseFrame], wanted: &str) -> anyhow::Result<usize> {
    let count = frames.len();
    let by_number = || wanted.parse().ok().filter(|n| *n < count);
    match frames.iter().position(|f| f.id == wanted).or_else(by_number) {
        Some(number) => Ok(number),
        None => {
            let id = |frame: Option<&PoseFrame>| frame.map_or(String::new(), |f| f.id.clone());
            Err(anyhow!(
                "has no frame {wanted:?} among its {count}, {:?} to {:?}",
                id(frames.first()),
                id(frames.last())
            ))
        }
    }
}

/// A pose or a motion by name; `None` if the text is not a name, but the path of a file.
///
/// # Errors
/// One sentence that lists the names, or says that the hand's joints do not match any of them.
pub fn poses_by_name(text: &str, model: &HandModel, fps: f64) -> anyhow::Result<Option<PoseSequence>> {
    if POSE_NAMES.contains(&text) {
        let frames = vec![PoseFrame { id: text.into(), pose: pose_by_name(text, model)?, shape: vec![] }];
        let joint_names = model.joint_names.clone();
        return Ok(Some(PoseSequence { fps, joint_names, frames, warnings: vec![] }));
    }
    if let Some(found) = motion(text, model, fps) {
        return Ok(Some(found.with_context(|| format!("the motion {text:?}"))?));
    }
    let path = Path::new(text);
    let is_path = path.extension().is_some() || path.components().count() > 1;
    if !path.exists() && !is_path {
        return Err(unknown_name(text));
    }
    Ok(None)
}

/// The pose of that name.
///
/// # Errors
/// An error that lists the names, or says that the avatar's joints do not match any of them.
pub fn pose_by_name(name: &str, model: &HandModel) -> anyhow::Result<Pose> {
    if name == "rest" {
        return Ok(Pose::rest(model.joint_count()));
    }
    if !POSE_NAMES.contains(&name) {
        bail!(unknown_name(name));
    }
    named_pose(name, model).ok_or_else(|| {
        let cause = why_without_axes(&model.joint_names);
        anyhow!("{}: pose {name:?} needs the joints of each finger: {cause}; or give a file of poses", model.name)
    })
}

fn unknown_name(name: &str) -> anyhow::Error {
    let poses = POSE_NAMES.join(", ");
    let motions = MOTION_NAMES.join(", ");
    anyhow!("unknown pose {name:?}; the poses are {poses}; the motions are {motions}; or give a file of poses")
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    fn load(text: &str) -> anyhow::Result<PoseSequence> {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        PoseReadingArgs::default().load(text, &model)
    }

    #[test]
    fn poses_and_motions_are_found_by_name() {
        assert_eq!(load("fist").unwrap().frames.len(), 1);
        assert!(load("count").unwrap().frames.len() > 60);
        let error = load("salute").unwrap_err().to_string();
        assert!(POSE_NAMES.iter().chain(&MOTION_NAMES).all(|name| error.contains(name)), "{error}");
    }

    #[test]
    fn frames_are_chosen_by_id_or_else_by_number() {
        let frame = |id: &str| PoseFrame { id: id.into(), pose: Pose::rest(16), shape: vec![] };
        let frames = vec![frame("0007"), frame("2"), frame("0009")];
        let chosen = |wanted| choose_frame(frames.clone(), wanted).map(|f| f.id);
        assert_eq!(chosen("0009").unwrap(), "0009");
        assert_eq!(chosen("2").unwrap(), "2");
        assert_eq!(chosen("0").unwrap(), "0007");
        let error = chosen("3").unwrap_err().to_string();
        assert!(error.contains("\"3\"") && error.contains("0007") && error.contains("0009"), "{error}");
    }
}
