//! ContactPose: a grasp is `full28_use/bowl` with `annotations.json` and images `images_full/kinect2_left/color/frame000.png`
//! of three cameras.
//!
//! - `cameras` by name: `valid`; `K` with `fx`, `fy`, `cx`, `cy`; `wTc`, from the camera to the world. Translations are
//!   metres, quaternions w, x, y, z.
//! - `frames`: `oTw`, from the world to the object; `hTo`, from the object to each hand.
//! - `hands`, left and right: `valid`; `joints` (21, 3) in OpenPose's order, which is MediaPipe's, metres, in the hand's axes
//!   if it is `moving`, else in the object's. They are inside of the fingers.
//! - K is of the images as the sensors gave them, 960 x 540. The images are turned: those of `kinect2_left` by 90 degrees
//!   clockwise, of `kinect2_right` counter-clockwise, of `kinect2_middle` by 180 degrees. The cameras here are turned with
//!   them, by whole pixels.
//! - `mano_fits_15.json`, for each hand: `valid`; `pose` (18), the root's axis-angle and 15 components from the mean pose;
//!   `betas` (10); `mTc`, from the hand's axes to MANO's. Left hands have MANO's left model as published.

use std::path::Path;

use ghand_capture::cameras::list::LensCamera;
use ghand_core::Side;
use ghand_hand_model::files::mano::LeftShapes;
use ghand_motion::image_landmarks::MEDIAPIPE_TIP_INSET;
use glam::{DMat3, DVec2, DVec3};

use super::folders;
use crate::DatasetError;
use crate::dataset::Layout;
use crate::fields::{DataFile, Field};
use crate::sequence::{Annotated, Fingers, ManoPose, Place, Rigid, Sequence, View, choose_side, pinhole, points};

pub(crate) const LAYOUT: Layout = Layout {
    name: "ContactPose",
    example: "full28_use/bowl",
    is_sequence: |folder| folder.join("annotations.json").is_file() && folder.join("images_full").is_dir(),
    is_whole: |folder| {
        let has_grasps =
            |folder: &Path| folders(folder).iter().any(|name| folder.join(name).join("annotations.json").is_file());
        has_grasps(folder)
            || folders(folder).iter().any(|name| name.starts_with("full") && has_grasps(&folder.join(name)))
    },
    read,
};

/// Numbers of the hands.
const LEFT: usize = 0;
const RIGHT: usize = 1;

/// How far images are turned against their sensor, and how pixels move.
#[derive(Clone, Copy)]
enum Turn {
    Clockwise,
    CounterClockwise,
    Half,
}

impl Turn {
    fn of(camera: &str) -> Option<Turn> {
        match camera {
            "kinect2_left" => Some(Turn::Clockwise),
            "kinect2_right" => Some(Turn::CounterClockwise),
            "kinect2_middle" => Some(Turn::Half),
            _ => None,
        }
    }

    /// The camera of the turned image. `size` is that image's; `principal` OpenCV's, of the sensor.
    fn camera(
        self,
        id: &str,
        size: (u32, u32),
        focal: DVec2,
        principal: DVec2,
        camera_from_world: &Rigid,
    ) -> LensCamera {
        let (width, height) = (f64::from(size.0), f64::from(size.1));
        let (x, y) = (principal.x, principal.y);
        // The last pixel becomes the first: its number is one less than the size.
        let (turn, focal, principal) = match self {
            Turn::Clockwise => (
                DMat3::from_cols(DVec3::Y, -DVec3::X, DVec3::Z),
                DVec2::new(focal.y, focal.x),
                DVec2::new(width - 1.0 - y, x),
            ),
            Turn::CounterClockwise => (
                DMat3::from_cols(-DVec3::Y, DVec3::X, DVec3::Z),
                DVec2::new(focal.y, focal.x),
                DVec2::new(y, height - 1.0 - x),
            ),
            Turn::Half => (
                DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0)),
                focal,
                DVec2::new(width - 1.0 - x, height - 1.0 - y),
            ),
        };
        let turned = Rigid { rotation: turn, translation: DVec3::ZERO };
        pinhole(id, size, focal, principal, &turned.after(camera_from_world))
    }
}

fn read(folder: &Path, side: Option<Side>) -> Result<Sequence, DatasetError> {
    let file = DataFile::read(&folder.join("annotations.json"))?;
    let root = file.root();
    let hands = root.get("hands")?;
    let hand =
        |number: usize| hands.item(number).filter(|hand| hand.find("valid").is_some_and(|valid| valid.is_true()));
    let side = choose_side(side, [RIGHT, LEFT].map(|number| hand(number).is_some()), folder)?;
    let number = if side == Side::Right { RIGHT } else { LEFT };
    let hand = hand(number).ok_or_else(|| hands.invalid(format!("lacks the {side} hand")))?;
    let joints = points(&hand.get("joints")?.numbers(63)?);
    let is_moving = hand.find("moving").is_some_and(|moving| moving.is_true());
    let mano = mano_fit(folder, number)?;
    let images = folder.join("images_full");
    let names: Vec<String> = root.get("cameras")?.names();
    let mut used = vec![];
    let mut cameras = vec![];
    for name in names {
        let camera = root.get("cameras")?.get(&name)?;
        let colors = images.join(&name).join("color");
        if !camera.find("valid").is_some_and(|valid| valid.is_true()) || !colors.is_dir() {
            continue;
        }
        let turn = Turn::of(&name)
            .ok_or_else(|| camera.invalid("is not one of kinect2_left, kinect2_middle and kinect2_right"))?;
        let first = super::stems(&colors, &["png"]).into_iter().next();
        let first = first.ok_or_else(|| super::no_images(&colors))?;
        let size = View::file(colors.join(format!("{first}.png")), None).picture.size()?;
        let k = camera.get("K")?;
        let [fx, fy, cx, cy] = ["fx", "fy", "cx", "cy"].map(|name| k.get(name)?.number());
        let camera_from_world = camera.get("wTc")?.by_quaternion("rotation", "translation")?.inverse();
        cameras.push(turn.camera(&name, size, DVec2::new(fx?, fy?), DVec2::new(cx?, cy?), &camera_from_world));
        used.push(colors);
    }
    if cameras.is_empty() {
        return Err(super::no_images(&images));
    }
    let mut frames = vec![];
    for (k, frame) in root.get("frames")?.items()?.iter().enumerate() {
        let view = |colors: &std::path::PathBuf| {
            let path = colors.join(format!("frame{k:03}.png"));
            path.is_file().then(|| View::file(path, None))
        };
        let views: Vec<Option<View>> = used.iter().map(view).collect();
        if views.iter().all(Option::is_none) {
            continue;
        }
        let world_from_hand = world_from_hand(frame, number, is_moving)?;
        let mano = mano.as_ref().map(|(mano, hand_from_mano)| ManoPose {
            world_from_mano: world_from_hand.after(hand_from_mano),
            ..mano.clone()
        });
        let joints = Some(joints.map(|point| world_from_hand.apply(point)));
        frames.push(Annotated { id: format!("frame{k:03}"), joints, mano, views });
    }
    Ok(Sequence {
        side,
        cameras,
        frames,
        tip_inset: MEDIAPIPE_TIP_INSET,
        left_shapes: LeftShapes::AsPublished,
        remarks: vec![],
    })
}

fn world_from_hand(frame: &Field, hand: usize, is_moving: bool) -> Result<Rigid, DatasetError> {
    let world_from_object = frame.get("oTw")?.by_quaternion("rotation", "translation")?.inverse();
    if !is_moving {
        return Ok(world_from_object);
    }
    let field = frame.get("hTo")?;
    let hand_from_object = field.item(hand).ok_or_else(|| field.invalid(format!("lacks hand {hand}")))?;
    let hand_from_object = hand_from_object.by_quaternion("rotation", "translation")?;
    Ok(world_from_object.after(&hand_from_object.inverse()))
}

/// MANO's fit of a hand, and from its space to the hand's.
fn mano_fit(folder: &Path, hand: usize) -> Result<Option<(ManoPose, Rigid)>, DatasetError> {
    let path = folder.join("mano_fits_15.json");
    if !path.is_file() {
        return Ok(None);
    }
    let file = DataFile::read(&path)?;
    let Some(fit) = file.root().item(hand).filter(|fit| fit.find("valid").is_some_and(|valid| valid.is_true())) else {
        return Ok(None);
    };
    let pose = fit.get("pose")?.numbers(18)?;
    let (root, components) = pose.split_at(3);
    let mano = ManoPose {
        root: DVec3::from_slice(root),
        fingers: Fingers::Components(components.to_vec()),
        from_mean: true,
        shape: fit.get("betas")?.numbers(10)?,
        place: Place::Added(DVec3::ZERO),
        world_from_mano: Rigid::IDENTITY,
    };
    Ok(Some((mano, fit.get("mTc")?.by_quaternion("rotation", "translation")?.inverse())))
}
