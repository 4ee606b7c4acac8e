//! `ghand-lab cleanliness`: how clean an avatar looks in the named poses, from all around.

mod cameras;
pub mod figures;
mod sheet;
mod tones;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use cameras::{Footprint, all_around, direction_around};
use clap::Args;
use figures::{Cleanliness, DetailEnergy, HandPicture, KnownColors, PictureSums};
use ghand_app::capture_source::CaptureSource;
use ghand_app::cli::AdapterArgs;
use ghand_app::command_inputs::refuse_capture_folder;
use ghand_app::commands::evaluate::check_joints;
use ghand_app::pose_choice::pose_by_name;
use ghand_app::say;
use ghand_app::train_run::interruption::Interruption;
use ghand_app::train_run::results::save_metrics;
use ghand_avatar::framing::{middle, posed_vertices};
use ghand_avatar::{Avatar, Scene};
use ghand_capture::{Capture, Split};
use ghand_core::statistics::median;
use ghand_core::{Camera, Pose};
use ghand_files::claim::Claim;
use ghand_fit::texels::views::some_views;
use ghand_hand_model::named_poses::POSE_NAMES;
use ghand_measure::metrics::quantize;
use ghand_measure::outline::{Outline, OutlineSums, silhouette};
use ghand_pictures::write_png;
use ghand_render::Gpu;
use ghand_render::splat::Purpose;
use glam::{DQuat, DVec3};
use image::{Rgb, RgbImage};
use serde::Serialize;
use sheet::{PoseViews, cleanliness_sheet};

/// Command line of `ghand-lab cleanliness`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("subject").args(["capture"]).required(true))]
pub struct CleanlinessArgs {
    /// The avatar, a .ghand file
    avatar: PathBuf,
    #[command(flatten)]
    capture: CaptureSource,
    /// Split with images that training did not see: its figures are those of a perfect avatar
    #[arg(long, default_value = DEFAULT_SPLIT)]
    split: String,
    /// Split that the avatar was trained on, whose images say what skin looks like [default: as the avatar says]
    #[arg(long)]
    train_split: Option<String>,
    /// Folder for cleanliness.json and cleanliness.png
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace the files of an earlier run
    #[arg(long)]
    force: bool,
}

/// The default of `--split`.
const DEFAULT_SPLIT: &str = "test";
/// The figures.
const FIGURES_FILE: &str = "cleanliness.json";
/// The picture.
const SHEET_FILE: &str = "cleanliness.png";
/// Views of each pose, evenly around the hand.
const VIEWS: usize = 24;
/// Most images of a split that are measured.
const MOST_IMAGES: usize = 60;
/// Most poses on the sheet.
const SHEET_POSES: usize = 12;
/// Directions of the views on the sheet, in the axes of [`direction_around`].
const SHEET_DIRECTIONS: [DVec3; 4] = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y];

/// Contents of `cleanliness.json`.
#[derive(Debug, Serialize)]
struct LibraryFile {
    avatar: String,
    capture: String,
    /// All poses and views together.
    #[serde(flatten)]
    total: PoseFigures,
    poses: Vec<NamedFigures>,
    views: Vec<ViewFigures>,
    /// The picture with the most loose coverage, and that with the roughest outline.
    worst: Worst,
    training: Images,
    /// The images that training did not see; `null` without any.
    held_out: Option<HeldOut>,
    pixels_per_metre: f64,
}

/// Figures of pictures in the capture's light, and of the skin alone.
#[derive(Debug, Clone, Copy, Serialize)]
struct PoseFigures {
    #[serde(flatten)]
    lit: Cleanliness,
    #[serde(flatten)]
    outline: Outline,
    /// High-frequency energy of the skin's colours without light, as a multiple of the training images'.
    albedo_detail: Option<f64>,
}

#[derive(Debug, Serialize)]
struct NamedFigures {
    pose: String,
    #[serde(flatten)]
    figures: PoseFigures,
}

#[derive(Debug, Serialize)]
struct ViewFigures {
    /// From the hand to the camera, in the axes of [`direction_around`].
    direction: [f64; 3],
    outside_share: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Worst {
    loose: Option<WorstView>,
    rough: Option<WorstView>,
}

/// One picture.
#[derive(Debug, Serialize)]
struct WorstView {
    pose: String,
    /// As in [`ViewFigures`].
    direction: [f64; 3],
    #[serde(flatten)]
    outline: Outline,
}

#[derive(Debug, Serialize)]
struct Images {
    split: String,
    images: usize,
}

#[derive(Debug, Serialize)]
struct HeldOut {
    #[serde(flatten)]
    from: Images,
    #[serde(flatten)]
    figures: Cleanliness,
}

/// What the training images look like.
struct Training {
    known: KnownColors,
    detail: DetailEnergy,
    images: usize,
    footprint: Footprint,
}

/// What an avatar looks like in a pose.
#[derive(Default)]
struct PosedSums {
    /// Of each view.
    lit: Vec<PictureSums>,
    outlines: Vec<OutlineSums>,
    albedo: DetailEnergy,
    /// Of the sheet's directions.
    pictures: Vec<RgbImage>,
}

/// Measures the avatar in the named poses.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &CleanlinessArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let path = args.capture.capture.as_ref().context("--capture: is missing")?;
    let avatar = Avatar::load(&args.avatar)?;
    if let Some(out) = args.out.as_deref().filter(|_| !args.force) {
        refuse_capture_folder("--out", out, path)?;
        check_absent(out)?;
    }
    let mut gpu = adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    let interruption = Interruption::listen("stopped: nothing was saved")?;
    let _claim = args.out.as_deref().map(Claim::folder).transpose()?;
    let train_split = args.train_split.as_deref().unwrap_or(&avatar.provenance.split);
    // A capture without test images has no held-out figures.
    let (needed, optional) = match args.split == DEFAULT_SPLIT {
        true => (vec![train_split], vec![DEFAULT_SPLIT]),
        false => (vec![train_split, &args.split], vec![]),
    };
    let capture = args.capture.open(path, &needed, &optional)?;
    check_joints(&avatar, &args.avatar, &capture)?;
    let train = capture.split(train_split)?;
    let root = mean_root(&capture, train);
    let poses: Result<Vec<Pose>, _> = POSE_NAMES.iter().map(|name| library_pose(name, &avatar, root)).collect();
    let poses = poses?;
    let training = measure_training(&capture, train).with_context(|| path.display().to_string())?;
    let cameras = all_around(&avatar.model, &poses.iter().collect::<Vec<_>>(), VIEWS, training.footprint);
    let posed = gpu.retry_on_device_loss("the evaluation", |gpu| {
        draw(gpu, &avatar, &poses, &cameras, capture.background, &training)
    })?;

    let figures = |lit: &PictureSums, outline: &OutlineSums, albedo: &DetailEnergy| PoseFigures {
        lit: lit.figures(&training.detail),
        outline: outline.figures(),
        albedo_detail: albedo.relative_to(&training.detail),
    };
    let mut lit = PictureSums::default();
    let mut albedo = DetailEnergy::default();
    let mut outline = OutlineSums::default();
    let mut by_view = vec![PictureSums::default(); VIEWS];
    let mut by_pose: Vec<NamedFigures> = vec![];
    for (name, posed) in POSE_NAMES.iter().zip(&posed) {
        let mut of_pose = PictureSums::default();
        for (of_view, sums) in by_view.iter_mut().zip(&posed.lit) {
            of_pose.merge(sums);
            of_view.merge(sums);
        }
        let mut outline_of_pose = OutlineSums::default();
        posed.outlines.iter().for_each(|of_view| outline_of_pose.merge(of_view));
        lit.merge(&of_pose);
        outline.merge(&outline_of_pose);
        albedo.merge(&posed.albedo);
        by_pose
            .push(NamedFigures { pose: (*name).into(), figures: figures(&of_pose, &outline_of_pose, &posed.albedo) });
    }
    let view = |(k, sums): (usize, &PictureSums)| ViewFigures {
        direction: direction_around(k, VIEWS).to_array(),
        outside_share: sums.figures(&training.detail).outside_share,
    };
    let results = LibraryFile {
        avatar: args.avatar.display().to_string(),
        capture: path.display().to_string(),
        total: figures(&lit, &outline, &albedo),
        poses: by_pose,
        views: by_view.iter().enumerate().map(view).collect(),
        worst: Worst {
            loose: worst_view(&posed, |outline| outline.loose_share),
            rough: worst_view(&posed, |outline| outline.roughness),
        },
        held_out: measure_held_out(&capture, &args.split, &training)?,
        pixels_per_metre: training.footprint.pixels_per_metre,
        training: Images { split: train_split.into(), images: training.images },
    };
    print_table(&results);
    let Some(folder) = &args.out else { return Ok(()) };
    let sheet_path = folder.join(SHEET_FILE);
    interruption.whole(|| -> anyhow::Result<()> {
        write_png(&sheet_path, &sheet(&results, posed))?;
        save_metrics(&results, &folder.join(FIGURES_FILE))
    })?;
    say!("picture: {}", sheet_path.display());
    Ok(())
}

/// Fails if results are there.
fn check_absent(folder: &Path) -> anyhow::Result<()> {
    match [FIGURES_FILE, SHEET_FILE].iter().map(|name| folder.join(name)).find(|file| file.exists()) {
        Some(file) => bail!("{}: exists already; choose another --out, or replace it with --force", file.display()),
        None => Ok(()),
    }
}

/// The mean place of the hand in a split: its root's rotation (axis-angle, radians) and its translation (metres). There
/// the light falls on it as in training.
fn mean_root(capture: &Capture, split: &Split) -> [DVec3; 2] {
    let poses: Vec<&Pose> = split.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let turns: Vec<DQuat> = poses.iter().map(|pose| DQuat::from_scaled_axis(pose.rotations[0])).collect();
    let first = turns.first().copied().unwrap_or_default();
    // A quaternion and its negative are the same rotation.
    let aligned = turns.iter().map(|turn| if turn.dot(first) < 0.0 { -*turn } else { *turn });
    let sum = aligned.fold(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, turn| sum + turn);
    let turn = if sum.length() > 1e-6 { sum.normalize() } else { first };
    let translation = poses.iter().map(|pose| pose.translation).sum::<DVec3>() / poses.len().max(1) as f64;
    [turn.to_scaled_axis(), translation]
}

/// A named pose with the hand at a place.
fn library_pose(name: &str, avatar: &Avatar, [rotation, translation]: [DVec3; 2]) -> anyhow::Result<Pose> {
    let mut pose = pose_by_name(name, &avatar.model)?;
    pose.rotations[0] = rotation;
    Ok(Pose { translation, ..pose })
}

/// Measures a sample of the training images.
fn measure_training(capture: &Capture, split: &Split) -> anyhow::Result<Training> {
    let mut known = KnownColors::default();
    let mut detail = DetailEnergy::default();
    let mut resolutions = vec![];
    let mut distances = vec![];
    let mut has_outline = false;
    let sample = some_views(split, MOST_IMAGES);
    if sample.is_empty() {
        bail!("needs training images, but their split has none; choose another with --train-split");
    }
    for view in &sample {
        let picture = load_picture(capture, view.camera, view.frame)?;
        has_outline |= !picture.is_all_hand();
        known.add(&picture);
        detail.add(&picture);
        let camera = &capture.cameras[view.camera];
        let frame = &capture.frames[view.frame];
        let distance = camera.camera_from_world(middle(&posed_vertices(&capture.template, &frame.pose))).z;
        if distance > 0.0 {
            resolutions.push(0.5 * camera.focal.element_sum() / distance);
            distances.push(distance);
        }
    }
    if !has_outline {
        bail!("needs masks, but the training images have neither masks nor transparent backgrounds");
    }
    if known.is_empty() {
        bail!("the hand is less than five pixels wide in all training images; use larger images");
    }
    if distances.is_empty() {
        bail!("the hand is behind the camera in all training images; `ghand inspect` shows what is wrong");
    }
    let footprint = Footprint { pixels_per_metre: median(resolutions), distance: median(distances) };
    Ok(Training { known, detail, images: sample.len(), footprint })
}

fn load_picture(capture: &Capture, camera: usize, frame: usize) -> anyhow::Result<HandPicture> {
    let view = capture.load_view(camera, frame)?;
    Ok(HandPicture::of_image(&view.rgba, [view.width, view.height]))
}

/// Real images that training did not see: what the measures give for a perfect avatar.
fn measure_held_out(capture: &Capture, split: &str, training: &Training) -> anyhow::Result<Option<HeldOut>> {
    let Some(images) = capture.splits.get(split).filter(|split| !split.views.is_empty()) else { return Ok(None) };
    let sample = some_views(images, MOST_IMAGES);
    let mut sums = PictureSums::default();
    for view in &sample {
        sums.add(&load_picture(capture, view.camera, view.frame)?, &training.known);
    }
    let from = Images { split: split.into(), images: sample.len() };
    Ok(Some(HeldOut { from, figures: sums.figures(&training.detail) }))
}

/// Draws and measures every pose from all views.
fn draw(
    gpu: &Gpu,
    avatar: &Avatar,
    poses: &[Pose],
    cameras: &[Vec<Camera>],
    background: [f64; 3],
    training: &Training,
) -> anyhow::Result<Vec<PosedSums>> {
    let background = background.map(|b| b as f32);
    let pixels_per_metre = training.footprint.pixels_per_metre;
    let size = cameras.iter().flatten().next().map_or([1; 2], |camera| [camera.width, camera.height]);
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, size)?;
    // Without its light, an avatar shows its skin's own colours.
    let unlit = avatar.light.as_ref().map(|_| Avatar { light: None, ..avatar.clone() });
    let mut unlit_scene =
        unlit.as_ref().map(|unlit| Scene::new(gpu, &[unlit], Purpose::Images, 1, size)).transpose()?;
    let shown = SHEET_DIRECTIONS.map(nearest_view);
    let mut all = vec![];
    for (pose, cameras) in poses.iter().zip(cameras) {
        let mut posed = PosedSums::default();
        let mut pictures: [Option<RgbImage>; SHEET_DIRECTIONS.len()] = Default::default();
        scene.set_pose(gpu, 0, 0, pose)?;
        let vertices = posed_vertices(&avatar.model, pose);
        if let Some(scene) = &mut unlit_scene {
            scene.set_pose(gpu, 0, 0, pose)?;
        }
        for (k, camera) in cameras.iter().enumerate() {
            let rendering = scene.render(gpu, 0, camera, background)?.rgba;
            let picture = HandPicture::of_rendering(&rendering, size);
            let mut sums = PictureSums::default();
            sums.add(&picture, &training.known);
            posed.lit.push(sums);
            let coverage: Vec<f32> = rendering.iter().map(|pixel| pixel[3]).collect();
            let mut outline = OutlineSums::default();
            outline.add(&coverage, &silhouette(camera, &vertices, &avatar.model.faces), size, pixels_per_metre);
            posed.outlines.push(outline);
            match &mut unlit_scene {
                Some(scene) => {
                    let rendering = scene.render(gpu, 0, camera, background)?.rgba;
                    posed.albedo.add(&HandPicture::of_rendering(&rendering, size));
                }
                None => posed.albedo.add(&picture),
            }
            for (place, _) in pictures.iter_mut().zip(shown).filter(|(_, view)| *view == k) {
                *place = Some(RgbImage::from_fn(size[0], size[1], |x, y| {
                    let [r, g, b, _] = rendering[(y * size[0] + x) as usize];
                    Rgb(quantize([r, g, b]))
                }));
            }
        }
        posed.pictures = pictures.into_iter().flatten().collect();
        all.push(posed);
    }
    Ok(all)
}

/// The picture for which a figure is largest.
fn worst_view(posed: &[PosedSums], figure: impl Fn(&Outline) -> Option<f64>) -> Option<WorstView> {
    let pictures = POSE_NAMES.iter().zip(posed).flat_map(|(name, posed)| {
        let view = |(k, sums): (usize, &OutlineSums)| WorstView {
            pose: (*name).into(),
            direction: direction_around(k, VIEWS).to_array(),
            outline: sums.figures(),
        };
        posed.outlines.iter().enumerate().map(view)
    });
    let measured = pictures.filter_map(|picture| Some((figure(&picture.outline)?, picture)));
    measured.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, picture)| picture)
}

/// The view whose direction is closest to another.
fn nearest_view(direction: DVec3) -> usize {
    let closeness = |k: &usize| direction_around(*k, VIEWS).dot(direction);
    (0..VIEWS).max_by(|a, b| closeness(a).total_cmp(&closeness(b))).unwrap_or(0)
}

fn sheet(results: &LibraryFile, posed: Vec<PosedSums>) -> RgbImage {
    let with_title = |(named, posed): (&NamedFigures, PosedSums)| {
        let lit = &named.figures.lit;
        let [outside, loose] = [lit.outside_share, named.figures.outline.loose_share].map(percent);
        let title = format!("{}  outside {outside}  detail {}  loose {loose}", named.pose, factor(lit.detail));
        PoseViews { title, pictures: posed.pictures }
    };
    let poses: Vec<PoseViews> = results.poses.iter().zip(posed).take(SHEET_POSES).map(with_title).collect();
    cleanliness_sheet(&poses)
}

fn print_table(results: &LibraryFile) {
    let LibraryFile { poses, total, training, held_out, .. } = results;
    say!(
        "\n{} named poses from {VIEWS} views, against {} images of split `{}`",
        poses.len(),
        training.images,
        training.split
    );
    say!("outside: hand pixels with colours that these images lack; detail: high-frequency energy, theirs is 1");
    say!("darker, more saturated: parts of the hand that are so by a tenth than all but a hundredth of these images");
    say!(
        "loose: coverage more than 3 mm outside the posed template, as part of it; rough: how frayed the outline is, its is 1"
    );
    say!(
        "                    outside  see-through     darker  more saturated   detail   detail without light     loose    rough"
    );
    let row = |name: &str, lit: &Cleanliness, rest: Option<(Option<f64>, &Outline)>| {
        let [outside, see_through] = [lit.outside_share, lit.see_through_share].map(percent);
        let [darker, saturated] = [lit.darker_share, lit.more_saturated_share].map(percent);
        let detail = factor(lit.detail);
        let (albedo, outline) = rest.map_or((None, None), |(albedo, outline)| (albedo, Some(outline)));
        let [albedo, rough] = [albedo, outline.and_then(|outline| outline.roughness)].map(factor);
        let loose = percent(outline.and_then(|outline| outline.loose_share));
        say!(
            "  {name:<14}  {outside:>9}    {see_through:>9}  {darker:>9}       {saturated:>9}   {detail:>6}   {albedo:>6}               {loose:>9}   {rough:>6}"
        );
    };
    let posed =
        |name: &str, figures: &PoseFigures| row(name, &figures.lit, Some((figures.albedo_detail, &figures.outline)));
    poses.iter().for_each(|named| posed(&named.pose, &named.figures));
    posed("all", total);
    if let Some(HeldOut { from, figures }) = held_out {
        row(&format!("split `{}`", from.split), figures, None);
    }
    if let Some(worst) = &results.worst.loose {
        let [back, side, tips] = worst.direction;
        let loose = percent(worst.outline.loose_share);
        say!(
            "most loose coverage in one picture: {loose}, pose `{}` from [{back:.2}, {side:.2}, {tips:.2}]",
            worst.pose
        );
    }
    if let Some(worst) = &results.worst.rough {
        let [back, side, tips] = worst.direction;
        let rough = factor(worst.outline.roughness);
        say!("roughest outline in one picture: {rough}, pose `{}` from [{back:.2}, {side:.2}, {tips:.2}]", worst.pose);
    }
}

fn percent(share: Option<f64>) -> String {
    share.map_or("-".into(), |share| format!("{:.3} %", 100.0 * share))
}

fn factor(value: Option<f64>) -> String {
    value.map_or("-".into(), |value| format!("{value:.2}"))
}
