//! `ghand export`: writes an avatar or a hand model for other programs, in the format that the file's ending says.

mod avatar_glb;
mod format;
mod hand_model;
mod one_sided;
mod scene;
mod spark;
mod web_page;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use ghand_avatar::Avatar;
use ghand_files::atomic_file::check_writable;
use ghand_hand_model::joints::xr_names::{XrNames, xr_joint_names};
use ghand_motion::PoseSequence;

use crate::cli::AdapterArgs;
use crate::command_inputs::CommandInputs;
use crate::file_kind::{FileKind, file_kind};
use crate::hand_model_file::{HandModelReading, is_hand_name};
use crate::pose_choice::{PoseReadingArgs, choose_frame};
use crate::same_tracker::SameTrackerArgs;
use format::ExportFormat;

/// Edge of a texture, texels, if the command line says nothing else.
const DEFAULT_TEXTURE: u32 = 1024;

/// Command line of `ghand export`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("output").required(true))]
pub struct ExportArgs {
    /// The avatar, a .ghand file; for .glb also a hand model: MANO (.pkl, .npz), rigged glTF (.glb, .gltf), builtin or
    /// builtin-left
    #[arg(value_name = "AVATAR|HAND")]
    subject: PathBuf,
    /// What to write, by its ending; metres. .glb: a rigged hand, textured if it is an avatar's. .ply and .spz: the
    /// Gaussians of a pose, or of each frame of a motion in numbered files. .html: a page that plays the avatar in a
    /// browser, complete in one file
    #[arg(long, value_name = "FILE", group = "output")]
    out: Option<PathBuf>,
    /// A folder for a web page that plays the Gaussians with three.js and Spark: splats, skeleton, motion, index.html
    #[arg(long, value_name = "DIR", group = "output")]
    spark: Option<PathBuf>,
    /// A pose or a motion by name, or a file of poses, as for `render` [default: rest]. Into a .glb go several motions,
    /// and a pose in which it opens
    #[arg(long, visible_alias = "motion", value_name = "FILE|NAME")]
    pose: Vec<String>,
    #[command(flatten)]
    reading_poses: PoseReadingArgs,
    #[command(flatten)]
    same_tracker: SameTrackerArgs,
    /// Only the frame with this id or number, counted from 0 [default: all]
    #[arg(long, value_name = "ID")]
    frame: Option<String>,
    /// Edge of the texture of a .glb, texels: 256, 512, 1024, 2048 or 4096 [default: 1024]
    #[arg(long, value_name = "N", value_parser = parse_texture)]
    texture: Option<u32>,
    /// Names of the joints of a .glb [default: model]
    #[arg(long, value_enum, value_name = "NAMES")]
    joint_names: Option<JointNames>,
    /// Also write the Gaussians into a .glb: other programs show them at rest, ghand plays them as the avatar
    #[arg(long)]
    gaussians: bool,
    /// Degree of the harmonics of a .ply; those beyond 0 are 0, for programs that want 62 numbers per Gaussian
    #[arg(long, value_name = "DEGREE", value_parser = clap::value_parser!(u32).range(0..=3))]
    sh_degree: Option<u32>,
    /// Fit pose correctives that keep the volume of bent joints, in place of the hand's own, into a .glb's extras
    #[arg(long)]
    fit_pose_correctives: bool,
    #[command(flatten)]
    reading: HandModelReading,
}

/// Whose names the joints are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum JointNames {
    /// The hand model's own.
    Model,
    /// OpenXR's, such as XR_HAND_JOINT_INDEX_PROXIMAL_EXT
    Openxr,
    /// WebXR's, such as index-finger-phalanx-proximal
    Webxr,
}

impl JointNames {
    /// The names, in place of the model's.
    fn of(self, names: &[String]) -> Vec<String> {
        match self {
            JointNames::Model => names.to_vec(),
            JointNames::Openxr => xr_joint_names(names, XrNames::OpenXr),
            JointNames::Webxr => xr_joint_names(names, XrNames::WebXr),
        }
    }
}

fn parse_texture(text: &str) -> Result<u32, String> {
    let size = text.parse().ok().filter(|size: &u32| size.is_power_of_two() && (256..=4096).contains(size));
    size.ok_or_else(|| "must be 256, 512, 1024, 2048 or 4096".into())
}

/// Writes what the arguments ask for. All input is read and checked before anything is written.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &ExportArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let poses: Vec<PathBuf> = match args.pose.is_empty() {
        true => args.reading_poses.inputs(None),
        false => args.pose.iter().flat_map(|pose| args.reading_poses.inputs(Some(pose))).collect(),
    };
    let inputs = CommandInputs::default().and([&args.subject]).and(poses);
    if args.pose.is_empty() {
        args.reading_poses.refuse_without("--pose")?;
        if args.frame.is_some() {
            bail!("--frame: chooses a frame of a motion, and needs --pose; give it, or omit --frame");
        }
        args.same_tracker.refuse("says what poses are, and needs --pose")?;
    }
    match (&args.out, &args.spark) {
        (Some(out), _) => {
            let format = ExportFormat::of(out)?;
            args.refuse_other_formats(format)?;
            inputs.refuse("--out", out)?;
            check_writable(out).with_context(|| format!("--out {}: cannot be written", out.display()))?;
            match format {
                ExportFormat::Glb if is_avatar(&args.subject) => avatar_glb::write(args, out, adapter),
                ExportFormat::Glb => {
                    args.same_tracker.refuse("a hand model knows no tracker")?;
                    hand_model::write(args, out)
                }
                ExportFormat::Ply | ExportFormat::Spz => scene::write(args, format, out, &inputs, adapter),
                ExportFormat::Html => web_page::write(args, out, adapter),
            }
        }
        (None, Some(folder)) => {
            args.refuse("--spark", &["--texture", "--joint-names", "--gaussians", "--sh-degree", FIT])?;
            spark::write(args, folder, &inputs, adapter)
        }
        (None, None) => bail!("give --out or --spark"),
    }
}

const FIT: &str = "--fit-pose-correctives";

fn is_avatar(path: &Path) -> bool {
    file_kind(path) == FileKind::Avatar
}

impl ExportArgs {
    /// Fails if an option is given that means nothing for a format.
    fn refuse_other_formats(&self, format: ExportFormat) -> anyhow::Result<()> {
        match format {
            ExportFormat::Glb => self.refuse(".glb", &["--sh-degree"]),
            ExportFormat::Ply => self.refuse(".ply", &["--texture", "--joint-names", "--gaussians", FIT]),
            ExportFormat::Spz => {
                self.refuse(".spz", &["--texture", "--joint-names", "--gaussians", "--sh-degree", FIT])
            }
            ExportFormat::Html => {
                self.refuse(".html", &["--texture", "--joint-names", "--gaussians", "--sh-degree", FIT])
            }
        }
    }

    /// Fails if one of these options is given.
    fn refuse(&self, what: &str, options: &[&str]) -> anyhow::Result<()> {
        let given = [
            ("--texture", self.texture.is_some()),
            ("--joint-names", self.joint_names.is_some()),
            ("--gaussians", self.gaussians),
            ("--sh-degree", self.sh_degree.is_some()),
            (FIT, self.fit_pose_correctives),
        ];
        match given.into_iter().find(|(name, given)| *given && options.contains(name)) {
            Some((name, _)) => bail!("{name}: means nothing for {what}; omit it"),
            None => Ok(()),
        }
    }

    /// The frames of a pose or a motion by name or of a file; of it, with --frame, one.
    fn frames(&self, pose: &str, avatar: &Avatar) -> anyhow::Result<PoseSequence> {
        let sequence = self.reading_poses.load(pose, &avatar.model)?;
        let mut sequence = self.same_tracker.apply(pose, sequence, avatar, &self.subject)?;
        if let Some(wanted) = &self.frame {
            sequence.frames = vec![choose_frame(sequence.frames, wanted).with_context(|| pose.to_owned())?];
        }
        Ok(sequence)
    }

    /// The avatar, for formats of Gaussians.
    fn avatar(&self) -> anyhow::Result<Avatar> {
        let shown = self.subject.display();
        if is_hand_name(&self.subject) || (self.subject.exists() && file_kind(&self.subject) == FileKind::HandModel) {
            bail!("{shown}: is a hand model, which has no Gaussians; give an avatar, or write a .glb");
        }
        self.reading.refuse_for("only an avatar has Gaussians")?;
        Ok(Avatar::load(&self.subject)?)
    }

    /// The only pose or motion, for formats that have one.
    fn only_pose(&self) -> anyhow::Result<&str> {
        match &self.pose[..] {
            [] => Ok("rest"),
            [pose] => Ok(pose),
            [_, second, ..] => bail!("--pose {second}: a second pose or motion; only a .glb has several"),
        }
    }
}
