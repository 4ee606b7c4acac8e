//! `ghand evaluate`: compares an avatar with images of a capture.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use ghand_avatar::Avatar;
use ghand_capture::Capture;
use ghand_core::{HandModel, Pose};
use ghand_fit::alignment::pose_offsets::offsets_between;
use ghand_fit::alignment::single_frames::pose_knowledge;
use ghand_measure::evaluation::ImageMetrics;
use ghand_measure::protocol::Protocol;
use ghand_measure::protocol::{PosedView, aligned_views, cross_views, given_views, mask_views};
use ghand_pictures::write_png;
use serde::Serialize;

use crate::capture_source::{CaptureSource, check_sides};
use crate::cli::AdapterArgs;
use crate::command_inputs::refuse_capture_folder;
use crate::lpips_weights::{LpipsWeights, for_images};
use crate::run_files::{CAMERAS_FILE, METRICS_FILE, POSES_FILE, REPORT_FILE};
use crate::same_tracker::{describe, tracker_of};
use crate::say;
use crate::train_run::evaluation::{TestImages, evaluate_images, print_image_table};
use crate::train_run::interruption::Interruption;
use crate::train_run::report_picture::report;
use crate::train_run::results::save_metrics;
use crate::train_run::run_folder::RunFolder;
use crate::train_run::training_poses::{poses_of_split, true_poses};

/// Command line of `ghand evaluate`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("subject").args(["capture"]).required(true))]
pub struct EvaluateArgs {
    /// The avatar, a .ghand file
    avatar: PathBuf,
    #[command(flatten)]
    capture: CaptureSource,
    /// Split to evaluate on
    #[arg(long, default_value = "test")]
    split: String,
    /// In which poses avatar and floor are drawn [default: given if the capture has exact poses, else masks]
    #[arg(long, value_enum)]
    protocol: Option<ProtocolArg>,
    /// The test poses come from the tracker that gave the training poses: undo how they differ from the avatar's in all
    /// frames alike, as training found it
    #[arg(long)]
    same_tracker: bool,
    /// Split that the avatar was trained on: the floor's texture is made from its images [default: as the avatar says]
    #[arg(long)]
    train_split: Option<String>,
    /// Refined poses of the training frames [default: poses.json beside the avatar; without it, the floor takes the
    /// capture's poses]
    #[arg(long, value_name = "FILE")]
    training_poses: Option<PathBuf>,
    #[command(flatten)]
    lpips: LpipsWeights,
    /// Folder for metrics.json and report.png
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace earlier results in the folder
    #[arg(long)]
    force: bool,
}

/// [`Protocol`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ProtocolArg {
    /// The capture's poses, untouched
    Given,
    /// Poses fitted to the masks; of frames with three cameras or more without the compared image's own mask
    Masks,
    /// The capture's poses, mapped by the constant offsets between its exact training poses and the refined ones
    Aligned,
    /// Poses fitted to the masks of half of a frame's cameras and compared with the images of the other half, both ways
    RefinedCross,
    /// As HandAvatar is evaluated: the capture's poses, squares of 256 x 256 pixels around the hand, on black
    #[value(name = "handavatar")]
    HandAvatar,
}

/// Line of an evaluation that was stopped.
const STOPPED: &str = "stopped: nothing was saved";

/// Contents of `metrics.json`.
#[derive(Debug, Serialize)]
struct EvaluationFile {
    #[serde(flatten)]
    images: ImageMetrics,
    avatar: String,
    capture: String,
    train_split: String,
    /// The file of the refined training poses; absent if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    training_poses: Option<String>,
}

/// Compares the avatar with all images of a split and writes the results to a folder.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &EvaluateArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    run_watched(args, adapter, &Interruption::listen(STOPPED)?)
}

/// As [`run`], for a program that does it inside itself.
///
/// # Errors
/// As [`run`]; [`Stopped`](crate::cli::Stopped) if that program wants an end.
pub fn run_watched(args: &EvaluateArgs, adapter: &AdapterArgs, interruption: &Interruption) -> anyhow::Result<()> {
    check_out(args)?;
    let avatar = Avatar::load(&args.avatar)?;
    let lpips = args.lpips.load()?;
    let mut gpu = adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    let folder = RunFolder::named(&args.out, args.force)?;
    interruption.end_with(STOPPED.into());
    interruption.remove_at_end(folder.leftovers());

    let path = args.capture.capture.as_ref().context("--capture: is missing")?;
    let train_split = args.train_split.as_deref().unwrap_or(&avatar.provenance.split);
    let capture = args.capture.open(path, &[&args.split, train_split], &[])?;
    check_joints(&avatar, &args.avatar, &capture)?;
    let split = capture.split(&args.split)?;
    if split.views.is_empty() {
        bail!("{}: the split {:?} has no images", path.display(), args.split);
    }
    let file = refined_poses_file(args);
    let refined = file.as_ref().map(|file| poses_of_split(file, &capture, train_split)).transpose()?;
    let mut scored = capture.clone();
    let default = if capture.truth.is_some() { ProtocolArg::Given } else { ProtocolArg::Masks };
    let chosen = args.protocol.unwrap_or(default);
    if args.same_tracker && chosen != ProtocolArg::Given {
        bail!("--same-tracker: is for the capture's own poses; give --protocol given");
    }
    let (protocol, views) = match chosen {
        ProtocolArg::Masks => {
            let cameras = args.avatar.parent().map(|folder| folder.join(CAMERAS_FILE)).filter(|file| file.exists());
            if let Some(file) = &cameras {
                scored.take_cameras(file)?;
                say!("cameras and their colours: as in {}", file.display());
            }
            let train = capture.split(train_split)?;
            let model = model_with_correctives(&avatar.model, &capture.template);
            let (known, poses) = pose_knowledge(&scored, &model, train, split)?;
            let views = mask_views(&scored, train, split, &model, &poses, &known)?;
            // As in training, masks end where the avatar's template does.
            scored.align_masks(&model, &split.frames, &poses);
            (Protocol::Masks, views)
        }
        ProtocolArg::Given if args.same_tracker => {
            let tracker = tracker_of(&avatar, &args.avatar)?;
            say!("poses: {}", describe(tracker));
            (Protocol::Given, aligned_views(&capture, split, &tracker.offsets))
        }
        ProtocolArg::Given => (Protocol::Given, given_views(&capture, split)),
        ProtocolArg::HandAvatar => (Protocol::HandAvatar, given_views(&capture, split)),
        ProtocolArg::Aligned => {
            let refined = refined.as_deref().with_context(|| {
                format!(
                    "--protocol aligned: needs the refined training poses, but there is no {POSES_FILE} beside {}; give \
                     them with --training-poses",
                    args.avatar.display()
                )
            })?;
            (Protocol::Aligned, aligned(&capture, &args.split, train_split, refined)?)
        }
        ProtocolArg::RefinedCross => {
            let views = cross_views(&capture, split, &model_with_correctives(&avatar.model, &capture.template));
            (Protocol::RefinedCross, views.with_context(|| format!("--split {}", args.split))?)
        }
    };
    let train = capture.split(train_split)?;
    let train_poses: Vec<Pose> = match refined {
        Some(refined) => refined,
        None => train.frames.iter().map(|frame| capture.frames[*frame].pose.clone()).collect(),
    };
    interruption.check()?;
    let test = TestImages {
        capture: &scored,
        split: &args.split,
        protocol,
        views,
        lpips: for_images(&lpips, &scored, &args.split),
    };
    let (images, shown) = gpu.retry_on_device_loss("the evaluation", |gpu| {
        evaluate_images(gpu, &avatar, &test, train, &train_poses, interruption)
    })?;
    let results = EvaluationFile {
        images,
        avatar: args.avatar.display().to_string(),
        capture: path.display().to_string(),
        train_split: train_split.into(),
        training_poses: file.as_ref().map(|file| file.display().to_string()),
    };
    let report_path = folder.file(REPORT_FILE);
    interruption.whole(|| -> anyhow::Result<()> {
        write_png(&report_path, &report(&shown))?;
        save_metrics(&results, &folder.file(METRICS_FILE))
    })?;
    print_image_table(&results.images);
    match &file {
        Some(file) => say!("floor: textured in the training poses of {}", file.display()),
        None => say!("floor: textured in the capture's training poses"),
    }
    say!("report: {}", report_path.display());
    Ok(())
}

/// Fails if the results would go to the capture's folder.
fn check_out(args: &EvaluateArgs) -> anyhow::Result<()> {
    match &args.capture.capture {
        Some(capture) if !args.force => refuse_capture_folder("--out", &args.out, capture),
        _ => Ok(()),
    }
}

/// An avatar's model, whose poses are fitted to masks, with the pose correctives of the capture's template: avatars keep
/// none. Without them if the template is another hand model.
fn model_with_correctives(model: &HandModel, template: &HandModel) -> HandModel {
    let is_of_template = model.faces == template.faces && model.joint_names == template.joint_names;
    let pose_directions = if is_of_template { template.pose_directions.clone() } else { vec![] };
    HandModel { pose_directions, ..model.clone() }
}

/// The test images in poses mapped by the offsets of the refined training poses.
fn aligned(capture: &Capture, split: &str, train_split: &str, refined: &[Pose]) -> anyhow::Result<Vec<PosedView>> {
    let truth = true_poses(capture, train_split).context("--protocol aligned")?;
    let offsets = offsets_between(&truth, refined, &capture.hand_model.parents);
    say!("offsets of the refined training poses: {:.2} degrees per joint on average", offsets.mean_degrees());
    Ok(aligned_views(capture, capture.split(split)?, &offsets))
}

/// The file of the refined training poses, if one was given or is beside the avatar.
fn refined_poses_file(args: &EvaluateArgs) -> Option<PathBuf> {
    let beside = args.avatar.parent().map(|folder| folder.join(POSES_FILE)).filter(|file| file.exists());
    args.training_poses.clone().or(beside)
}

/// Poses of the capture must be poses of the avatar.
///
/// # Errors
/// An error that names the avatar's file `path`, if its side or its joints are not those of the capture's hand.
pub fn check_joints(avatar: &Avatar, path: &Path, capture: &Capture) -> anyhow::Result<()> {
    check_sides(&path.display().to_string(), avatar.template.side, capture)?;
    let [own, other] = [&avatar.template.joint_names, &capture.hand_model.joint_names];
    if own != other || avatar.template.parents != capture.hand_model.parents {
        bail!(
            "{}: the avatar's {} joints are not the {} of the hand model of {}; evaluate it on a capture with its own \
             hand model",
            path.display(),
            own.len(),
            other.len(),
            capture.root.display()
        );
    }
    Ok(())
}
