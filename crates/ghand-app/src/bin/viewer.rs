//! `viewer`: shows an avatar in any pose from any side.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, bail};
use clap::{Parser, ValueEnum};
use ghand_app::baked::baked;
use ghand_app::capture_source::CaptureReading;
use ghand_app::cli::{self, AdapterArgs, choice_name, parse_size};
use ghand_app::command_inputs::CommandInputs;
use ghand_app::demo_avatar::{DEMO_AVATAR_NAME, demo_avatar};
use ghand_app::file_kind::{FileKind, file_kind};
use ghand_app::lighting::Lighting;
use ghand_app::pose_choice::PoseReadingArgs;
use ghand_app::same_tracker::SameTrackerArgs;
use ghand_app::say;
use ghand_app::train_run::run_folder::last_avatar;
use ghand_app::viewer::app::Viewer;
use ghand_app::viewer::document::capture_panel::CapturePanel;
use ghand_app::viewer::document::subject::Subject;
use ghand_app::viewer::document::training_run::TrainingRun;
use ghand_app::viewer::live::feed::FeedSettings;
use ghand_app::viewer::screenshot::screenshot;
use ghand_app::viewer::session::settings::{Settings, Theme};
use ghand_app::viewer::stage::comparison::Comparison;
use ghand_app::viewer::stage::layer::Layer;
use ghand_app::viewer::stage::overlay::Overlay;
use ghand_app::viewer::window;
use ghand_footage::{FootageError, LiveSource};
use ghand_motion::live::port::{DEFAULT_PORT, LiveSettings};

/// View an animatable hand avatar, or a scene of Gaussians
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// An avatar (.ghand), the folder of a run of `train`, also while it goes on, a scene of Gaussians (.ply) or a hand model
    /// (.glb, .gltf, MANO; builtin or builtin-left) [default: the avatar trained last in out/train, out/train-2,
    /// ..., else an avatar that comes with ghand]
    file: Option<PathBuf>,
    /// The initial pose or a motion to play: a name, or any file of poses that `ghand render` reads [default: rest]
    #[arg(long, value_name = "FILE|NAME")]
    pose: Option<String>,
    #[command(flatten)]
    reading: PoseReadingArgs,
    #[command(flatten)]
    same_tracker: SameTrackerArgs,
    #[command(flatten)]
    light: Lighting,
    /// Play the avatar baked, which is faster; it is baked first, unless it is beside the avatar already
    #[arg(long)]
    baked: bool,
    /// A capture whose cameras and frames the panel offers: its folder or capture.json, or a data set's folder
    #[arg(long, value_name = "PATH")]
    capture: Option<PathBuf>,
    #[command(flatten)]
    capture_options: CaptureReading,
    /// What the colours of an avatar show
    #[arg(long, value_enum, default_value_t)]
    layer: Layer,
    /// The joint of `--layer weights` and `--layer residual` [default: the first]
    #[arg(long, value_name = "NAME")]
    joint: Option<String>,
    /// The shape basis of `--layer basis` and `--layer coefficient`, from 1 [default: 1]
    #[arg(long, value_name = "N")]
    basis: Option<usize>,
    /// Lines over the view
    #[arg(long, value_enum, value_name = "NAMES", value_delimiter = ',')]
    overlay: Vec<Overlay>,
    /// What is shown of the picture and the capture's image of the same view
    #[arg(long, value_enum, default_value_t, requires = "capture")]
    compare: Comparison,
    /// Take live poses from trackers and programs on this computer, by WebSocket and UDP on this port; the same as
    /// "Live poses" in the menu [default port: 4263]
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, conflicts_with = "screenshot")]
    live: Option<Option<u16>>,
    /// Also let pages of this origin send live poses, such as https://example.org; may be repeated
    #[arg(long, value_name = "ORIGIN", requires = "live")]
    live_origin: Vec<String>,
    /// Take live poses from hands before a webcam: the first one, or one by number, device (/dev/video2) or name; or from a
    /// video, which repeats. Needs ffmpeg
    #[arg(long, value_name = "CAMERA|VIDEO", num_args = 0..=1, require_equals = true, conflicts_with_all = ["live", "screenshot"])]
    webcam: Option<Option<OsString>>,
    /// The initial view: a side of the hand (back, palm, thumb-side, little-finger-side, fingertips) or a view saved in the
    /// viewer
    #[arg(long, value_name = "NAME")]
    view: Option<String>,
    /// As in a drawing, without perspective
    #[arg(long)]
    orthographic: bool,
    /// Write a picture of the viewer to this PNG file instead of opening a window; needs no display
    #[arg(long, value_name = "FILE")]
    screenshot: Option<PathBuf>,
    /// Size of the screenshot [default: 1280x800]
    #[arg(long, value_name = "WxH", value_parser = parse_size, requires = "screenshot")]
    size: Option<[u32; 2]>,
    /// Pixels per point of the screenshot, as on a display of high resolution [default: 1]
    #[arg(long, value_name = "N", value_parser = parse_scale, requires = "screenshot")]
    scale: Option<f32>,
    /// Light or dark [default: the last choice, else dark]
    #[arg(long, value_name = "THEME")]
    theme: Option<Theme>,
    #[command(flatten)]
    adapter: AdapterArgs,
}

fn parse_scale(text: &str) -> Result<f32, String> {
    let scale = text.parse().ok().filter(|scale| (0.5..=4.0).contains(scale));
    scale.ok_or_else(|| "must be a number from 0.5 to 4".into())
}

fn main() -> ExitCode {
    cli::run(run)
}

fn run(arguments: Arguments) -> anyhow::Result<()> {
    let start = Instant::now();
    check_options(&arguments)?;
    let webcam = arguments.webcam.as_ref().map(|text| webcam(text.as_deref())).transpose().context("--webcam")?;
    if arguments.screenshot.is_none() {
        cli::check_display()?;
    }
    let training = arguments.file.as_deref().and_then(TrainingRun::open);
    let mut path = training.as_ref().and_then(TrainingRun::avatar).or(arguments.file).or_else(last_avatar);
    let mut gpu = arguments.adapter.open()?;
    if arguments.baked {
        let Some(avatar) = path.filter(|path| file_kind(path) == FileKind::Avatar) else {
            bail!("--baked: is for avatars' files, and what is shown is none; omit --baked");
        };
        path = Some(gpu.retry_on_device_loss("baking", |gpu| baked(gpu, &avatar))?);
    }
    let light = &arguments.light;
    let (mut subject, source) = subject(path.as_deref(), light)?;
    let of_hands = [
        ("--pose", arguments.pose.is_some()),
        ("--capture", arguments.capture.is_some()),
        ("--overlay", !arguments.overlay.is_empty()),
        ("--live", arguments.live.is_some()),
        ("--webcam", webcam.is_some()),
    ];
    if let (Subject::Scene { .. }, Some((option, _))) = (&subject, of_hands.iter().find(|(_, given)| *given)) {
        bail!("{option}: {source} is a scene of Gaussians, which has no hand; give an avatar or omit {option}");
    }
    match (&mut subject, arguments.pose) {
        (Subject::Hand(hand), Some(text)) => {
            let mut sequence = arguments.reading.load(&text, hand.model())?;
            match (hand.avatar(), &path) {
                (Some(avatar), Some(path)) => {
                    sequence = arguments.same_tracker.apply(&text, sequence, avatar, path)?;
                }
                _ => arguments.same_tracker.refuse("only an avatar's file knows a tracker")?,
            }
            hand.show(text, sequence);
        }
        _ => arguments.same_tracker.refuse("says what poses are, and needs --pose")?,
    }
    let capture = match (&arguments.capture, &subject) {
        (Some(path), Subject::Hand(hand)) => Some(CapturePanel::open(path, &arguments.capture_options, hand.model())?),
        _ => None,
    };
    let mut viewer = Viewer::new(&gpu, subject, source.clone())?;
    viewer.log_start(start);
    if let Some(path) = &path {
        viewer.watch(path, light);
    }
    match training {
        Some(_) if arguments.baked => say!("the run is not followed: its next avatars are not baked"),
        Some(training) => viewer.follow_run(training),
        None => {}
    }
    if let Some(capture) = capture {
        viewer.show_capture(capture);
        viewer.compare(arguments.compare);
    }
    if let (true, Some(reason)) = (arguments.layer != Layer::Skin, viewer.missing_layer(arguments.layer)) {
        bail!("--layer {}: {source} cannot show it: {reason}", choice_name(arguments.layer));
    }
    if let Some(number) = arguments.basis.filter(|number| !viewer.choose_basis(*number)) {
        bail!("--basis {number}: {source} has no such shape basis");
    }
    if let Some(joint) = arguments.joint.filter(|joint| !viewer.choose_joint(joint)) {
        bail!("--joint {joint}: {source} has no such joint");
    }
    viewer.show_layer(arguments.layer);
    for overlay in Overlay::value_variants().iter().filter(|overlay| arguments.overlay.contains(overlay)) {
        viewer.toggle_overlay(*overlay);
    }
    let settings_path = Settings::path();
    let mut settings = settings_path.as_deref().map(Settings::read).unwrap_or_default();
    viewer.settings_mut().views.clone_from(&settings.views);
    if let Some(name) = &arguments.view {
        viewer.go_to_view(name).context("--view")?;
    }
    if arguments.orthographic {
        viewer.show_orthographic();
    }
    if let Some(path) = &arguments.screenshot {
        // The panel of a screenshot does not depend on who takes it.
        viewer.settings_mut().views.clear();
        viewer.settings_mut().theme = arguments.theme.unwrap_or_default();
        let size = arguments.size.unwrap_or(window::WINDOW_SIZE);
        return screenshot(&mut viewer, size, arguments.scale.unwrap_or(1.0), path);
    }
    settings.theme = arguments.theme.unwrap_or(settings.theme);
    if let Some(path) = &path {
        settings.add_recent(path);
    }
    viewer.use_settings(settings, settings_path);
    if let Some(port) = arguments.live {
        let settings = LiveSettings { port: port.unwrap_or(DEFAULT_PORT), origins: arguments.live_origin };
        viewer.start_live(FeedSettings::Port(settings));
    }
    if let Some(source) = webcam {
        viewer.start_live(FeedSettings::Webcam(source));
        viewer.wait_for_webcam().context("--webcam")?;
    }
    window::open(&mut viewer)
}

/// Fails if an option is given without what it applies to.
fn check_options(arguments: &Arguments) -> anyhow::Result<()> {
    if arguments.pose.is_none() {
        arguments.reading.refuse_without("--pose")?;
    }
    if arguments.capture.is_none() {
        arguments.capture_options.refuse_without_capture()?;
    }
    if let Some(path) = &arguments.screenshot {
        if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("png")) {
            bail!("--screenshot {}: must end in .png", path.display());
        }
        let inputs = CommandInputs::default()
            .and(arguments.file.as_ref().filter(|file| file.is_file()))
            .and(arguments.reading.inputs(arguments.pose.as_deref()))
            .and(arguments.light.input())
            .and(&arguments.capture)
            .and(arguments.capture_options.inputs());
        inputs.refuse("--screenshot", path)?;
    }
    // clap does not require what conflicts with another option.
    if arguments.live.is_none() && !arguments.live_origin.is_empty() {
        bail!("--live-origin: needs --live; give it, or omit --live-origin");
    }
    if arguments.screenshot.is_none() && (arguments.size.is_some() || arguments.scale.is_some()) {
        bail!("--size and --scale: are those of a --screenshot; omit them");
    }
    let layer = arguments.layer;
    if arguments.joint.is_some() && !layer.has_joint() {
        bail!(
            "--joint: --layer {} shows no joint; give --layer weights or residual, or omit --joint",
            choice_name(layer)
        );
    }
    if arguments.basis.is_some() && !layer.has_basis() {
        bail!(
            "--basis: --layer {} shows no basis; give --layer basis or coefficient, or omit --basis",
            choice_name(layer)
        );
    }
    Ok(())
}

/// The camera or video of `--webcam`.
fn webcam(text: Option<&OsStr>) -> Result<LiveSource, FootageError> {
    text.map_or_else(LiveSource::first_camera, LiveSource::find)
}

/// What to show, and its source.
fn subject(path: Option<&Path>, light: &Lighting) -> anyhow::Result<(Subject, String)> {
    match path {
        Some(path) => Ok((Subject::read(path, light)?, path.display().to_string())),
        None => {
            let mut avatar = demo_avatar()?;
            light.apply_to(&mut avatar)?;
            Ok((Subject::avatar(avatar), DEMO_AVATAR_NAME.into()))
        }
    }
}
