//! DexYCB: a sequence is `20200709-subject-01/20200709_141754` with one folder for each of 8 cameras, by serial number, in
//! which `color_000012.jpg` (640 x 480) and `labels_000012.npz` belong together. Beside the subjects,
//! `calibration` has what `meta.yml` of the sequence names.
//!
//! - `calibration/intrinsics/SERIAL_640x480.yml`: `color` with `fx`, `fy`, `ppx`, `ppy`.
//! - `calibration/extrinsics_NAME/extrinsics.yml`: `extrinsics` by serial number, (3, 4) from the camera to the world,
//!   metres.
//! - `calibration/mano_NAME/mano.yml`: `betas`, MANO's shape.
//! - labels: `joint_3d` (1, 21, 3), metres, in the camera's axes (x right, y down, z forward), MediaPipe's order, -1 without
//!   a hand; `pose_m` (1, 51) in the camera's axes, all 0 without a hand: the root's axis-angle, 45 principal components from
//!   MANO's mean pose, a translation that is added to the hand; `seg`: 255 is the hand, 1 to 21 are objects, 0 the rest.
//! - `meta.yml`: `mano_sides`. Left hands have the axes of MANO's left model, with its shapes as published.

use std::path::Path;

use ghand_core::Side;
use ghand_hand_model::files::mano::LeftShapes;
use glam::{DVec2, DVec3};

use super::{above, folders};
use crate::DatasetError;
use crate::dataset::Layout;
use crate::fields::{DataFile, Field};
use crate::sequence::{Annotated, Fingers, ManoPose, Mask, Place, Rigid, Sequence, View, choose_side, pinhole, points};

pub(crate) const LAYOUT: Layout = Layout {
    name: "DexYCB",
    example: "20200709-subject-01/20200709_141754",
    is_sequence: |folder| folder.join("meta.yml").is_file() && !holds_intrinsics(folder),
    is_whole: |folder| {
        holds_intrinsics(folder) || folders(folder).iter().any(|name| folder.join(name).join("meta.yml").is_file())
    },
    read,
};

/// The label of the hand.
const HAND: f64 = 255.0;
/// What absent joints are.
const ABSENT: f64 = -1.0;
/// More frames than any sequence has.
const MOST_FRAMES: usize = 100_000;
/// The size of all images.
const SIZE: (u32, u32) = (640, 480);

fn holds_intrinsics(folder: &Path) -> bool {
    folder.join("calibration/intrinsics").is_dir()
}

/// A camera of a sequence.
struct Recorded {
    serial: String,
    world_from_camera: Rigid,
}

fn read(folder: &Path, side: Option<Side>) -> Result<Sequence, DatasetError> {
    let meta = DataFile::read_yaml(&folder.join("meta.yml"))?;
    let meta = meta.root();
    let sides = meta.get("mano_sides")?;
    let is_left = first_text(&sides)? == "left";
    let side = choose_side(side, [!is_left, is_left], folder)?;
    let calibration = above(folder, 2).join("calibration");
    if !calibration.is_dir() {
        return Err(DatasetError::file(&calibration, "is missing; unpack calibration.tar.gz beside the subjects"));
    }
    let extrinsics = meta.get("extrinsics")?.text()?;
    let extrinsics = DataFile::read_yaml(&calibration.join(format!("extrinsics_{extrinsics}/extrinsics.yml")))?;
    let mut recorded = vec![];
    let mut cameras = vec![];
    for serial in meta.get("serials")?.items()? {
        let serial = serial.text()?;
        let world_from_camera = extrinsics.root().get("extrinsics")?.get(&serial)?.rigid()?;
        let intrinsics = DataFile::read_yaml(&calibration.join(format!("intrinsics/{serial}_640x480.yml")))?;
        let color = intrinsics.root().get("color")?;
        let [fx, fy, cx, cy] = ["fx", "fy", "ppx", "ppy"].map(|name| color.get(name)?.number());
        let (focal, principal) = (DVec2::new(fx?, fy?), DVec2::new(cx?, cy?));
        cameras.push(pinhole(&serial, SIZE, focal, principal, &world_from_camera.inverse()));
        recorded.push(Recorded { serial, world_from_camera });
    }
    let shape = shape(&meta, &calibration)?;
    let mut frames = vec![];
    for number in 0..meta.get("num_frames")?.count(MOST_FRAMES)? {
        frames.extend(frame(folder, number, &recorded, shape.as_deref())?);
    }
    Ok(Sequence { side, cameras, frames, tip_inset: 0.0, left_shapes: LeftShapes::AsPublished, remarks: vec![] })
}

fn first_text(list: &Field) -> Result<String, DatasetError> {
    list.item(0).ok_or_else(|| list.invalid("is empty"))?.text()
}

/// MANO's shape parameters, if their file is there.
fn shape(meta: &Field, calibration: &Path) -> Result<Option<Vec<f64>>, DatasetError> {
    let Some(names) = meta.find("mano_calib") else { return Ok(None) };
    let path = calibration.join(format!("mano_{}/mano.yml", first_text(&names)?));
    path.is_file().then(|| DataFile::read_yaml(&path)?.root().get("betas")?.numbers(10)).transpose()
}

fn frame(
    folder: &Path,
    number: usize,
    cameras: &[Recorded],
    shape: Option<&[f64]>,
) -> Result<Option<Annotated>, DatasetError> {
    let mut found = None;
    let mut views = vec![];
    for camera in cameras {
        let folder = folder.join(&camera.serial);
        let image = folder.join(format!("color_{number:06}.jpg"));
        let file = folder.join(format!("labels_{number:06}.npz"));
        if !(image.is_file() && file.is_file()) {
            views.push(None);
            continue;
        }
        views.push(Some(View::file(image, Some(Mask::Label { file: file.clone(), array: "seg", label: HAND }))));
        if found.is_some() {
            continue;
        }
        let labels = DataFile::read(&file)?;
        let numbers = labels.root().get("joint_3d")?.numbers(63)?;
        if numbers.iter().all(|value| *value == ABSENT) {
            continue;
        }
        let joints = points(&numbers).map(|point| camera.world_from_camera.apply(point));
        let mano = shape.map(|shape| mano_pose(&labels.root(), shape, camera.world_from_camera)).transpose()?;
        found = Some((joints, mano));
    }
    Ok(found.map(|(joints, mano)| Annotated { id: format!("{number:06}"), joints: Some(joints), mano, views }))
}

fn mano_pose(labels: &Field, shape: &[f64], world_from_mano: Rigid) -> Result<ManoPose, DatasetError> {
    let pose = labels.get("pose_m")?.numbers(51)?;
    let (root, rest) = pose.split_at(3);
    let (components, translation) = rest.split_at(45);
    Ok(ManoPose {
        root: DVec3::from_slice(root),
        fingers: Fingers::Components(components.to_vec()),
        from_mean: true,
        shape: shape.to_vec(),
        place: Place::Added(DVec3::from_slice(translation)),
        world_from_mano,
    })
}
