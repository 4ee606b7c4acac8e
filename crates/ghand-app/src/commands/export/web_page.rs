//! An avatar as a page with the player, complete in one file.

use std::path::Path;

use anyhow::Context;
use ghand_avatar::{Avatar, Scene};
use ghand_core::Pose;
use ghand_files::atomic_file::write_atomically;
use ghand_hand_model::named_poses::POSE_NAMES;
use ghand_motion::pose_sequence::formats::ghand::poses_json;
use ghand_render::splat::{Image, Purpose};
use ghand_render::{Gpu, RenderError};
use ghand_web::stage::Stage;

use super::ExportArgs;
use crate::cli::AdapterArgs;
use crate::commands::bake::hand_painter::to_rgb;
use crate::html_page::data_url;
use crate::pose_choice::is_name;
use crate::say;
use crate::web_page::{BACKGROUND, PlayerPage, Source};

/// Size of the still picture, pixels.
const POSTER: [u32; 2] = [720, 720];
/// Files above this are worth baking, bytes.
const LARGE: usize = 3_000_000;

/// Writes the page.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn write(args: &ExportArgs, out: &Path, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let avatar = args.avatar()?;
    let shown = args.subject.display();
    let bytes = std::fs::read(&args.subject).with_context(|| format!("{shown}: cannot be read"))?;
    let size = bytes.len();
    let title = args.subject.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let kind = "application/octet-stream";
    let mut page = PlayerPage { title, avatars: vec![Source::Inside { kind, bytes }], ..PlayerPage::default() };
    let text = args.only_pose()?;
    let sequence = args.frames(text, &avatar)?;
    let first = sequence.frames.first().map(|frame| frame.pose.clone());
    if POSE_NAMES.contains(&text) {
        page.pose = Some(text.to_owned());
    } else if is_name(text) && args.frame.is_none() && args.reading_poses.fps.is_none() {
        page.motion = Some(Source::At(text.to_owned()));
    } else {
        let bytes = poses_json(&sequence, &avatar.model).into_bytes();
        page.motion = Some(Source::Inside { kind: "application/json", bytes });
    }
    page.poster = poster(avatar, first, adapter)?;
    let html = page.self_contained();
    write_atomically(out, html.as_bytes()).with_context(|| format!("{}: cannot be written", out.display()))?;
    say!("{}: a page of {:.1} MB; open it in a browser", out.display(), html.len() as f64 / 1e6);
    if size > LARGE {
        say!("{shown} makes most of it: `ghand bake` makes a smaller avatar of it");
    }
    Ok(())
}

/// The picture where there is no WebGPU: the first view of the player. None without a graphics adapter.
fn poster(avatar: Avatar, pose: Option<Pose>, adapter: &AdapterArgs) -> anyhow::Result<Option<Source>> {
    let Ok(gpu) = adapter.open_if_any()? else {
        say!("there is no graphics adapter: the page has no picture for browsers without WebGPU");
        return Ok(None);
    };
    let mut stage = Stage::default();
    stage.add(avatar).map_err(anyhow::Error::msg)?;
    Ok(Some(Source::At(data_url(&to_rgb(&picture(&gpu, &stage, pose)?))?)))
}

fn picture(gpu: &Gpu, stage: &Stage, pose: Option<Pose>) -> Result<Image, RenderError> {
    let invalid = RenderError::Invalid;
    let avatar = stage.hand(0).map_err(invalid)?.avatar();
    let camera = stage.camera(POSTER).ok_or_else(|| RenderError::Invalid("there is no view".into()))?;
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, POSTER)?;
    scene.set_pose(gpu, 0, 0, &pose.unwrap_or_else(|| Pose::rest(avatar.model.joint_count())))?;
    scene.render(gpu, 0, &camera, BACKGROUND)
}
