//! A small capture with known truth: a detailed hand that is *not* the template, seen by cameras all around it.
//!
//! The template is the built-in hand in its mean shape.
//! The true hand is the same in the shape of a random person (`hand/random_shape.rs`, `random_bones.rs`),
//! with a finer mesh, relief and skin that follow the pose, and volume-preserving skinning, so that the template with
//! plain linear blend skinning has the usual errors of templates. Metacarpals of the fingers and tips stay at rest.
//! Training poses have the errors of a tracker (`errors/poses.rs`), and training masks those of a segmentation if
//! wanted (`errors/masks.rs`); test poses, test masks and truth are exact. The same options give the same capture, up
//! to the renderer's rounding. Behind the hand there may be a desk (`images/background.rs`), and the hand may have a
//! forearm (`hand/forearm.rs`), as in photographs.

mod errors;
pub mod footage;
pub mod hand;
mod images;
pub mod make_capture;
pub mod make_footage;
mod new_folder;
mod noise;
mod normal;
mod rasteriser;
mod skin;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::Path;

use ghand_capture::cameras::sampling::farthest_point_sampling;
use ghand_capture::capture::{Capture, CaptureError, Frame, HandModelSource, ImagePaths, Split};
use ghand_core::mesh::Texture;
use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_hand_model::HandModelError;
use ghand_hand_model::builtin::builtin_hand;
use glam::{DVec2, DVec3};

use errors::poses::{PoseErrors, biased, noisy};
use hand::finger_play::{FingerPlay, Frames};
use hand::random_shape::random_hand;
use hand::true_hand::{Detail, TrueHand};
use hand::{anatomy, forearm, trajectory};
use images::camera_placement;
use images::draw::draw;
use new_folder::{check_is_new, make_folder};

/// What is behind the hand in the images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backdrop {
    /// Black.
    #[default]
    Plain,
    /// A desk with things on it, some of them with colours like skin: another one for each camera, in all frames the same.
    Clutter,
}

/// What the masks of a synthetic capture show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Masks {
    /// The hand up to the template's end at the wrist.
    #[default]
    Hand,
    /// The hand with its forearm.
    Arm,
    /// There are none.
    None,
}

/// The light of a synthetic capture, fixed in the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LightSetup {
    /// Soft light from all sides, without shadows but in the hand's hollows.
    #[default]
    Soft,
    /// One strong light from the thumb's side of the hand, in which the hand casts shadows on itself, and little else.
    Side,
    /// One strong light as in nature, added in linear light, with shadows and a dim sky: [`LightSetup::planted`].
    Key,
    /// As `Key`, from another side.
    Rim,
    /// As `Key`, from a lamp that is as near as one on a desk.
    Lamp,
    /// The skin's own colours: an irradiance of 1 everywhere.
    Flat,
}

/// A light whose effect is exact: linear irradiance = sky x openness + key x max(0, n . towards) x lit part, and display
/// value = texture x irradiance^(1 / 2.2). Near lamps shine from where they are, with the square of their distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantedLight {
    /// Unit vector towards the key light, world axes.
    pub towards: DVec3,
    /// How far from the world's origin the key light is, metres; infinite if it is a direction.
    pub distance: f64,
    /// Irradiance of the key light at normal incidence, at the world's origin.
    pub key: f64,
    /// Irradiance of the sky on an open surface.
    pub sky: f64,
}

impl LightSetup {
    /// The light of the setups with an exact one.
    pub fn planted(self) -> Option<PlantedLight> {
        let light = |towards: [f64; 3], key, sky| PlantedLight {
            towards: DVec3::from(towards).normalize(),
            distance: f64::INFINITY,
            key,
            sky,
        };
        match self {
            LightSetup::Soft | LightSetup::Side => None,
            LightSetup::Key => Some(light([0.35, -0.30, -0.90], 1.1, 0.12)),
            LightSetup::Rim => Some(light([-0.70, -0.55, 0.45], 1.1, 0.12)),
            LightSetup::Lamp => Some(PlantedLight { distance: 0.45, ..light([0.35, -0.30, -0.90], 1.1, 0.12) }),
            LightSetup::Flat => Some(light([0.0, -1.0, 0.0], 0.0, 1.0)),
        }
    }
}

/// More are probably a mistake.
const MOST_CAMERAS: usize = 1000;
const MOST_FRAMES: usize = 100_000;
/// Standard deviation of a constant error of the translation per degree of that of the joints, metres.
const TRANSLATION_BIAS: f64 = 0.0005;

/// Options of a synthetic capture.
#[derive(Debug, Clone, PartialEq)]
pub struct SyntheticOptions {
    /// Seed of the hand and its skin.
    pub identity: u64,
    /// How much the lengths of the hand's single bones differ from the template's, in multiples of the published spread among
    /// men and women; 0 for the template's proportions in a shape of the model's own.
    pub bone_spread: f64,
    /// Seed of the motion, the test poses and the errors of the training poses.
    pub seed: u64,
    /// Cameras of the training split.
    pub views: usize,
    /// Frames of the training split: one smooth trajectory.
    pub train_frames: usize,
    /// Frames of the test split: single poses that are not on the trajectory.
    pub test_frames: usize,
    /// Cameras of the test split, none of which is used for training.
    pub test_views: usize,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Standard deviation of the errors of the training poses: each component of a finger joint's axis-angle, degrees.
    /// The root's errors are half as large.
    pub pose_noise_degrees: f64,
    /// Standard deviation of each component of the training translations, metres.
    pub translation_noise: f64,
    /// Standard deviation of the constant errors of the training poses, the same in all frames: each joint's rotation
    /// about each axis, degrees; half of it for the root. Each component of the translation has one of 0.5 mm per
    /// degree.
    pub pose_bias_degrees: f64,
    /// Standard deviation of the errors of the training masks' outlines, pixels; they are alike over some 15 pixels. In
    /// one mask of eight, a disc of four times this radius is missing at the outline.
    pub mask_noise_pixels: f64,
    /// Standard deviation of the logarithm of the training cameras' exposures, of display values; each channel has a third
    /// of it in addition.
    pub exposure_noise: f64,
    /// Standard deviation of additional true rotations of the fingers' joints about their bones, degrees, within what
    /// the joints allow.
    pub twist_degrees: f64,
    /// The same, sideways.
    pub abduction_degrees: f64,
    /// Which hand it shows.
    pub side: Side,
    /// The light.
    pub light: LightSetup,
    /// What is behind the hand.
    pub background: Backdrop,
    /// Whether the hand has a forearm, which bends at the wrist.
    pub forearm: bool,
    /// What the masks show.
    pub masks: Masks,
}

impl Default for SyntheticOptions {
    fn default() -> Self {
        SyntheticOptions {
            identity: 7,
            bone_spread: 1.0,
            seed: 7,
            views: 8,
            train_frames: 16,
            test_frames: 6,
            test_views: 3,
            width: 192,
            height: 288,
            pose_noise_degrees: 4.0,
            translation_noise: 0.001,
            pose_bias_degrees: 0.0,
            mask_noise_pixels: 0.0,
            exposure_noise: 0.0,
            twist_degrees: 0.0,
            abduction_degrees: 0.0,
            side: Side::Right,
            light: LightSetup::Soft,
            background: Backdrop::Plain,
            forearm: false,
            masks: Masks::Hand,
        }
    }
}

/// A directional light fixed in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneLight {
    /// Unit vector from the scene towards the light, world axes.
    pub direction: DVec3,
    /// Its contribution to the texture's factor at normal incidence.
    pub color: DVec3,
}

/// The light of a scene: colour = texture x visibility x (ambient + sum of color x max(0, (n.l + wrap) / (1 + wrap))),
/// clamped to 1, in display values.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneLighting {
    /// Ambient light.
    pub ambient: DVec3,
    /// The lights.
    pub lights: Vec<SceneLight>,
    /// How far light wraps around the shape, `[0, 1]`.
    pub wrap: f64,
}

/// One frame of the true hand, for a renderer.
#[derive(Debug, Clone, Copy)]
pub struct SceneMesh<'a> {
    /// Vertex positions, metres, world axes.
    pub positions: &'a [DVec3],
    /// Unit vertex normals, world axes.
    pub normals: &'a [DVec3],
    /// UV of each vertex, (0, 0) at the outer corner of the first texel.
    pub uvs: &'a [DVec2],
    /// The fraction of the light that reaches each vertex past the rest of the hand, `[0, 1]`.
    pub light_visibility: &'a [f64],
    /// Triangles as vertex indices.
    pub triangles: &'a [[u32; 3]],
    /// Colour of the skin.
    pub texture: &'a Texture,
    /// The light.
    pub lighting: &'a SceneLighting,
}

/// Draws a scene as a camera sees it: row-major pixels of the camera's size, straight colour and coverage, antialiased;
/// or returns an error.
pub type RenderScene<'a> = dyn FnMut(&SceneMesh, &Camera) -> Result<Vec<[u8; 4]>, String> + 'a;

/// Makes a synthetic capture in the folder `out_dir`.
///
/// The capture appears there atomically: it is made beside `out_dir` and renamed.
///
/// # Errors
/// [`CaptureError`] if the options are unusable, `out_dir` is not empty or cannot be written, or `render` fails.
pub fn generate(options: &SyntheticOptions, out_dir: &Path, render: &mut RenderScene) -> Result<(), CaptureError> {
    check(options, out_dir)?;
    make_folder(out_dir, |workshop| draw_capture(options, out_dir, workshop, render))
}

/// Makes the capture that will be called `out_dir` in the folder `workshop`.
fn draw_capture(
    options: &SyntheticOptions,
    out_dir: &Path,
    workshop: &Path,
    render: &mut RenderScene,
) -> Result<(), CaptureError> {
    let model_error = |source| CaptureError::HandModel { path: out_dir.into(), source };
    let templates = Templates::of(options).map_err(model_error)?;
    let true_hand = true_hand(options).map_err(model_error)?;
    let capture = plan(options, templates, &true_hand, workshop);
    draw(&capture, &true_hand, options, render)?;
    capture.save()
}

fn check(options: &SyntheticOptions, out_dir: &Path) -> Result<(), CaptureError> {
    let fail = |field: &str, problem: String| {
        Err(CaptureError::Invalid { path: out_dir.into(), field: field.into(), problem })
    };
    let counts = [
        ("views", options.views, 1, MOST_CAMERAS),
        ("test_views", options.test_views, 0, MOST_CAMERAS),
        ("train_frames", options.train_frames, 1, MOST_FRAMES),
        ("test_frames", options.test_frames, 0, MOST_FRAMES),
    ];
    if let Some((field, count, least, most)) =
        counts.into_iter().find(|(_, n, least, most)| !(least..=most).contains(&n))
    {
        return fail(field, format!("is {count}; give {least} to {most}"));
    }
    if options.width < 16 || options.height < 16 || options.width.max(options.height) > 4096 {
        return fail("width and height", format!("{} x {}; give 16 to 4096", options.width, options.height));
    }
    let noise = [
        ("pose_noise_degrees", options.pose_noise_degrees, 45.0),
        ("translation_noise", options.translation_noise, 0.1),
        ("bone_spread", options.bone_spread, 2.0),
        ("pose_bias_degrees", options.pose_bias_degrees, 45.0),
        ("mask_noise_pixels", options.mask_noise_pixels, 10.0),
        ("exposure_noise", options.exposure_noise, 1.0),
        ("twist_degrees", options.twist_degrees, 45.0),
        ("abduction_degrees", options.abduction_degrees, 45.0),
    ];
    for (field, value, most) in noise {
        if !(0.0..=most).contains(&value) {
            return fail(field, format!("is {value}; give 0 to {most}"));
        }
    }
    check_is_new(out_dir)
}

/// The template, and the right hand that it is or mirrors: all motions are made for that.
struct Templates {
    own: HandModel,
    right: HandModel,
}

impl Templates {
    fn of(options: &SyntheticOptions) -> Result<Templates, HandModelError> {
        Ok(Templates { own: builtin_hand(options.side)?, right: builtin_hand(Side::Right)? })
    }
}

/// The hand in the images.
fn true_hand(options: &SyntheticOptions) -> Result<TrueHand, HandModelError> {
    let person = random_hand(&builtin_hand(Side::Right)?, options.identity, options.bone_spread)?;
    let detail = Detail::of_images([options.width, options.height]);
    if options.forearm {
        return Ok(TrueHand::with_forearm(forearm::with_forearm(&person)?, options.side, options.identity, detail));
    }
    Ok(TrueHand::new(&person, options.side, options.identity, detail))
}

/// Given and true poses of the training frames, then of the test frames.
fn poses(options: &SyntheticOptions, right: &HandModel) -> [Vec<Pose>; 2] {
    let anatomy = anatomy::Anatomy::of(right);
    let joint_count = right.joint_count();
    let seed = options.seed;
    let mut train = trajectory::trajectory(&anatomy, joint_count, options.train_frames, seed);
    let mut test = trajectory::single_poses(&anatomy, joint_count, options.test_frames, seed);
    if options.twist_degrees > 0.0 || options.abduction_degrees > 0.0 {
        let [abduction, twist] = [options.abduction_degrees, options.twist_degrees].map(f64::to_radians);
        let play = FingerPlay { abduction, twist };
        play.add(right, &anatomy, &mut train, Frames::Motion, seed);
        play.add(right, &anatomy, &mut test, Frames::Single, seed);
    }
    let noise =
        PoseErrors { rotation: options.pose_noise_degrees.to_radians(), translation: options.translation_noise };
    let mut tracked = noisy(&anatomy, &train, &noise, seed);
    let bias = options.pose_bias_degrees;
    if bias > 0.0 {
        let bias = PoseErrors { rotation: bias.to_radians(), translation: TRANSLATION_BIAS * bias };
        tracked = biased(&anatomy, &tracked, &bias, seed);
    }
    let of_side = |pose: Pose| if options.side == Side::Left { pose.mirrored() } else { pose };
    [tracked, train].map(|training| training.into_iter().chain(test.iter().cloned()).map(of_side).collect())
}

/// The capture without its pictures.
fn plan(options: &SyntheticOptions, templates: Templates, true_hand: &TrueHand, root: &Path) -> Capture {
    let [given, truth] = poses(options, &templates.right);
    let hand_model = templates.own;
    let points: Vec<DVec3> = truth.iter().flat_map(|pose| true_hand.outline(pose)).collect();
    let test_views = if options.test_frames == 0 { 0 } else { options.test_views };
    let count = options.views + test_views;
    let cameras = camera_placement::cameras(count, options.width, options.height, &points);
    // Test cameras are spread between the others.
    let is_test = |i: usize| (i + 1) * test_views / count != i * test_views / count;
    let (test_cameras, train_cameras): (Vec<usize>, Vec<usize>) = (0..count).partition(|&i| is_test(i));
    let train_frames: Vec<usize> = (0..options.train_frames).collect();
    let five = farthest_point_sampling(&cameras, &train_cameras, 5);
    let splits = BTreeMap::from([
        ("train".to_owned(), Split::product(train_cameras, train_frames.clone())),
        ("train5".to_owned(), Split::product(five, train_frames)),
        ("test".to_owned(), Split::product(test_cameras, (options.train_frames..truth.len()).collect())),
    ]);
    let frames = given.into_iter().enumerate().map(|(i, pose)| Frame { id: format!("{i:04}"), pose, shape: vec![] });
    Capture {
        root: root.into(),
        side: options.side,
        background: [0.0; 3],
        template: hand_model.clone(),
        hand_model,
        hand_model_source: HandModelSource::Builtin,
        cameras,
        distortion: vec![],
        color_correction: Default::default(),
        frames: frames.collect(),
        images: ImagePaths::plain(
            "images/{camera}/{frame}.png",
            (options.masks != Masks::None).then_some("masks/{camera}/{frame}.png"),
        ),
        splits,
        truth: Some(truth.into_iter().map(Some).collect()),
    }
}
