//! `ghand capture`: makes a synthetic capture with known truth.

mod footage;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::bail;
use clap::Args;
use ghand_core::Side;
use ghand_files::claim::Claim;
use ghand_synthetic::make_capture::make_capture;
use ghand_synthetic::{Backdrop, LightSetup, Masks, SyntheticOptions};

use self::footage::FootageArgs;
use crate::cli::{AdapterArgs, parse_size};
use crate::say;
use crate::train_run::interruption::Interruption;

/// Command line of `ghand capture`.
#[derive(Debug, Args)]
pub struct MakeCaptureArgs {
    /// Folder to create; must be empty or not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of training cameras, on a sphere around the hand [default: 8], or of cameras that film [default: 4]
    #[arg(long, value_name = "N")]
    views: Option<usize>,
    /// Number of test cameras, between the others [default: 3]
    #[arg(long, value_name = "N")]
    test_views: Option<usize>,
    /// Number of training frames, one smooth motion [default: 16]
    #[arg(long, value_name = "N")]
    train_frames: Option<usize>,
    /// Number of test frames, with other poses [default: 6]
    #[arg(long, value_name = "N")]
    test_frames: Option<usize>,
    /// Size of the images, pixels [default: 192x288, of footage 640x480]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Selects the hand: its proportions and its skin [default: 7]
    #[arg(long, value_name = "SEED")]
    identity: Option<u64>,
    /// How much the lengths of single bones differ from the template's, in multiples of their published spread among men
    /// and women, up to 2 [default: 1]
    #[arg(long, value_name = "FACTOR")]
    bone_spread: Option<f64>,
    /// Seed of the motion, the test poses and the errors of the training poses [default: 7]
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Standard deviation of the errors of the training poses, degrees about each axis of a finger's joint; half of it
    /// for the root [default: 4]
    #[arg(long, value_name = "DEG")]
    pose_noise: Option<f64>,
    /// Standard deviation of errors that each joint of the training poses has in all frames alike, degrees about each
    /// axis; half of it for the root. The translation is off by a constant, too: 0.5 mm per degree along each axis
    /// [default: 0]
    #[arg(long, value_name = "DEG")]
    pose_bias: Option<f64>,
    /// Standard deviation of the errors of the training masks' outlines, pixels, alike over some 15 pixels. One mask in
    /// eight also misses a disc of four times this radius. Images and test masks stay exact [default: 0]
    #[arg(long, value_name = "PX")]
    mask_noise: Option<f64>,
    /// Standard deviation of the exposures of the training cameras, as a part of the display values; each channel has a
    /// third of it in addition. Test images are exact [default: 0]
    #[arg(long, value_name = "PART")]
    exposure_noise: Option<f64>,
    /// Standard deviation of additional true rotations of the fingers' joints about their bones, degrees, within
    /// anatomical limits, to which hinges add a play of 10 degrees [default: 0]
    #[arg(long, value_name = "DEG")]
    twist: Option<f64>,
    /// The same as --twist, but sideways [default: 0]
    #[arg(long, value_name = "DEG")]
    abduction: Option<f64>,
    /// Which hand the capture shows
    #[arg(long, value_name = "SIDE", default_value = "right", value_parser = ["right", "left"])]
    side: String,
    /// soft: light from all sides. side: one strong light from the thumb's side, with shadows, and little else. key,
    /// rim: one strong light from one of two sides, added in linear light. lamp: the same from a lamp half a metre away.
    /// flat: the skin's own colours
    #[arg(long, value_name = "LIGHT", default_value = "soft", value_parser = LIGHTS.map(|(name, _)| name))]
    light: String,
    /// plain: black. clutter: a desk with things on it, some of them with colours like skin, another one for each camera
    #[arg(long, value_name = "WHAT", default_value = "plain", value_parser = ["plain", "clutter"])]
    background: String,
    /// Shows the forearm, too, which bends at the wrist. The template ends there
    #[arg(long)]
    forearm: bool,
    /// What the masks show. hand: the hand alone. arm: the hand and its forearm. none: there are no masks
    #[arg(long, value_name = "WHAT", default_value = "hand", value_parser = MASKS.map(|(name, _)| name))]
    masks: String,
    #[command(flatten)]
    footage: FootageArgs,
}

impl MakeCaptureArgs {
    fn side(&self) -> Side {
        if self.side == "left" { Side::Left } else { Side::Right }
    }
}

/// The kinds of masks by name.
const MASKS: [(&str, Masks); 3] = [("hand", Masks::Hand), ("arm", Masks::Arm), ("none", Masks::None)];

/// The lights by name.
const LIGHTS: [(&str, LightSetup); 6] = [
    ("soft", LightSetup::Soft),
    ("side", LightSetup::Side),
    ("key", LightSetup::Key),
    ("rim", LightSetup::Rim),
    ("lamp", LightSetup::Lamp),
    ("flat", LightSetup::Flat),
];

/// Fails if options contradict each other.
fn check(args: &MakeCaptureArgs) -> anyhow::Result<()> {
    if args.masks == "arm" && !args.forearm {
        bail!("--masks arm: there is no forearm; give --forearm, or omit --masks");
    }
    if args.masks == "none" && args.mask_noise.is_some_and(|noise| noise > 0.0) {
        bail!("--mask-noise: with --masks none there are no masks; omit one of the two");
    }
    for (option, given, other, zero) in [
        ("--test-frames", args.test_frames, "--test-views", args.test_views),
        ("--test-views", args.test_views, "--test-frames", args.test_frames),
    ] {
        if given.is_some_and(|given| given > 0) && zero == Some(0) {
            bail!("{option}: with {other} 0 there are no test images; omit {option}");
        }
    }
    Ok(())
}

/// Makes the capture.
///
/// # Errors
/// An error that names the option or the file and its problem.
pub fn run(args: &MakeCaptureArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    if args.footage.is_wanted() {
        return args.footage.make(args, adapter);
    }
    check(args)?;
    let start = Instant::now();
    let defaults = SyntheticOptions::default();
    let [width, height] = args.size.unwrap_or([defaults.width, defaults.height]);
    let options = SyntheticOptions {
        identity: args.identity.unwrap_or(defaults.identity),
        bone_spread: args.bone_spread.unwrap_or(defaults.bone_spread),
        seed: args.seed.unwrap_or(defaults.seed),
        views: args.views.unwrap_or(defaults.views),
        train_frames: args.train_frames.unwrap_or(defaults.train_frames),
        test_frames: args.test_frames.unwrap_or(defaults.test_frames),
        test_views: args.test_views.unwrap_or(defaults.test_views),
        width,
        height,
        pose_noise_degrees: args.pose_noise.unwrap_or(defaults.pose_noise_degrees),
        pose_bias_degrees: args.pose_bias.unwrap_or(defaults.pose_bias_degrees),
        mask_noise_pixels: args.mask_noise.unwrap_or(defaults.mask_noise_pixels),
        exposure_noise: args.exposure_noise.unwrap_or(defaults.exposure_noise),
        twist_degrees: args.twist.unwrap_or(defaults.twist_degrees),
        abduction_degrees: args.abduction.unwrap_or(defaults.abduction_degrees),
        side: args.side(),
        light: LIGHTS.iter().find(|(name, _)| args.light == *name).map_or(defaults.light, |(_, light)| *light),
        background: if args.background == "clutter" { Backdrop::Clutter } else { Backdrop::Plain },
        forearm: args.forearm,
        masks: MASKS.iter().find(|(name, _)| args.masks == *name).map_or(defaults.masks, |(_, masks)| *masks),
        ..defaults
    };
    let _claim = Claim::beside(&args.out)?;
    Interruption::listen("stopped: nothing was written")?;
    adapter.open()?.retry_on_device_loss("the synthetic capture", |gpu| -> anyhow::Result<()> {
        Ok(make_capture(gpu, &options, &args.out)?)
    })?;
    let images = options.views * options.train_frames + options.test_views * options.test_frames;
    let folder = args.out.display();
    let seconds = start.elapsed().as_secs_f64();
    say!("{folder}: {images} images of {width} x {height} in {seconds:.1} s");
    say!("train on it: train --capture {folder}");
    Ok(())
}
