//! `ghand inspect`: describes a capture, a hand model, an avatar or a scene of Gaussians, with its oddities.

mod avatar;
mod capture;
pub(super) mod contact_sheet;
mod hand_model;
mod scene;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use ghand_avatar::Avatar;
use ghand_avatar::scene_files::SplatScene;
use ghand_capture::Opened;
use ghand_capture::inspection::{CaptureInspection, DEFAULT_SAMPLE};
use ghand_files::atomic_file::check_writable;
use ghand_fit::alignment::results::review::review;
use ghand_hand_model::files::read::file_and_side;
use ghand_pictures::write_png;

use crate::capture_source::CaptureReading;
use crate::cli::AdapterArgs;
use crate::command_inputs::CommandInputs;
use crate::file_kind::{FileKind, file_kind};
use crate::hand_model_file::is_hand_name;
use crate::say;
use contact_sheet::{SheetView, contact_sheet};

/// The split whose hand, poses, masks and views are told apart.
const REVIEWED_SPLIT: &str = "train";
/// Number of views on a contact sheet.
const SHEET_VIEWS: usize = 12;

/// Command line of `ghand inspect`.
#[derive(Debug, Args)]
pub struct InspectArgs {
    /// A capture: any folder that `train` accepts, or a capture.json. Or a hand model: MANO (.pkl, .npz) or rigged glTF
    /// (.glb, .gltf; FILE:left is the left one of two). Or an avatar (.ghand), or a scene of Gaussians (.ply) [default: the built-in hand]
    #[arg(value_name = "PATH")]
    capture: Option<PathBuf>,
    #[command(flatten)]
    options: CaptureReading,
    /// Where to write the pictures of a capture, .png: some images, and the posed template over them [default:
    /// out/inspect-NAME.png, with the name of the capture]
    #[arg(long, value_name = "FILE", requires = "capture", conflicts_with = "no_sheet")]
    sheet: Option<PathBuf>,
    /// Do not write pictures
    #[arg(long, requires = "capture")]
    no_sheet: bool,
}

/// Describes a capture, a hand model, an avatar or a scene, with its oddities; for a capture, also writes a sheet of
/// pictures.
///
/// # Errors
/// An error that names the file and its unusable part, or the sheet that cannot be written. Unusable images are an
/// error only if no image can be used.
pub fn run(args: &InspectArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    match &args.capture {
        Some(path) if !file_and_side(path).0.exists() && !is_hand_name(path) => {
            bail!("{}: no such file or folder", path.display())
        }
        Some(path) if is_capture(path) => run_capture(args, path, adapter),
        path => {
            let reading = &args.options;
            let sheet = (args.sheet.is_some() || args.no_sheet).then_some("--sheet or --no-sheet");
            if let (Some(path), Some(option)) = (path, reading.given().or(sheet)) {
                bail!("{}: {option} is for captures only, a folder or a .json", path.display());
            }
            let hand_model_args = &reading.hand_model_args;
            let text = match (path, path.as_deref().map(file_kind)) {
                (Some(path), Some(FileKind::Avatar)) => {
                    hand_model_args.refuse_for(&format!("{} is an avatar", path.display()))?;
                    avatar::describe(path, &Avatar::load(path)?)
                }
                (Some(path), Some(FileKind::Scene)) => {
                    hand_model_args.refuse_for(&format!("{} is a scene", path.display()))?;
                    scene::describe(path, &SplatScene::read(path)?)
                }
                _ => hand_model::describe(&hand_model_args.load(path.as_ref())?),
            };
            say!("{}", text.trim_end());
            Ok(())
        }
    }
}

/// Whether a path means a capture: hand models are files, and never JSON.
fn is_capture(path: &Path) -> bool {
    path.is_dir() || path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
}

/// Default path of a capture's pictures, relative to the current folder. Each capture has its own file, so that an
/// inspection does not replace the pictures of another capture.
fn default_sheet(capture: &Path) -> PathBuf {
    // `.` and `..` have no name of their own; a capture.json has that of its folder.
    let full = std::fs::canonicalize(capture).unwrap_or_else(|_| capture.to_path_buf());
    let folder = if full.is_dir() { Some(full.as_path()) } else { full.parent() };
    let name = folder.and_then(Path::file_name).map_or("capture".into(), |name| name.to_string_lossy());
    Path::new("out").join(format!("inspect-{name}.png"))
}

fn run_capture(args: &InspectArgs, path: &Path, adapter: &AdapterArgs) -> anyhow::Result<()> {
    if let Some(sheet) = args.sheet.as_ref().filter(|p| p.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png"))) {
        bail!("--sheet {}: must end in .png", sheet.display());
    }
    let sheet = args.sheet.clone().unwrap_or_else(|| default_sheet(path));
    if !args.no_sheet {
        CommandInputs::default().and([path]).and(args.options.inputs()).refuse("--sheet", &sheet)?;
        check_writable(&sheet)
            .with_context(|| format!("{}: cannot write the pictures; see --sheet", sheet.display()))?;
    }
    let opened = args.options.open(path)?;
    let found = CaptureInspection::of(&opened.capture, DEFAULT_SAMPLE)?;
    let views: Vec<SheetView> = (found.examples(SHEET_VIEWS).into_iter())
        .map(|(split, fit)| SheetView { split: split.name.clone(), fit })
        .collect();
    let reviewed = match opened.capture.splits.get(REVIEWED_SPLIT).filter(|_| found.is_trainable()) {
        Some(split) => review(&opened.capture, split)?,
        None => None,
    };
    say!("{}", capture::describe(path, &opened, &found, reviewed.as_ref(), &views).trim_end());
    match (args.no_sheet, views.is_empty()) {
        (true, _) => {}
        (_, true) => say!("\nno pictures: no image could be decoded"),
        _ => say!("\n{}", write_sheet(&sheet, args.sheet.is_some(), adapter, &opened, &views)?),
    }
    if !found.has_usable_image() {
        bail!("{}: no image can be used; see the problems above", path.display());
    }
    if !found.is_trainable() {
        bail!("{}: training on it cannot succeed; see the problems above", path.display());
    }
    Ok(())
}

/// Draws and writes the sheet; returns a line that says where it is, or why there is none.
fn write_sheet(
    path: &Path,
    is_wanted: bool,
    adapter: &AdapterArgs,
    opened: &Opened,
    views: &[SheetView],
) -> anyhow::Result<String> {
    let mut gpu = match adapter.open_if_any()? {
        // The rest of an inspection does not need a device, and the pictures were not requested.
        Err(error) if !is_wanted => return Ok(format!("no pictures: {error}")),
        opened => opened?,
    };
    let sheet = gpu.retry_on_device_loss("the contact sheet", |gpu| contact_sheet(gpu, &opened.capture, views))?;
    write_png(path, &sheet)?;
    Ok(format!("pictures: {}", path.display()))
}
