//! TACO: the videos of a sequence are `Allocentric_RGB_Videos/(stir, spoon, bowl)/20231105_019/22070938.mp4`, one for each
//! camera by serial number, or the same in `Marker_Removed_Allocentric_RGB_Videos`. Beside these folders, with the same
//! names below, are
//!
//! - `Allocentric_Camera_Parameters/.../calibration.json`: by serial number `K` (9), `R` (9) and `T` (3), from the world to
//!   the camera, metres. Videos have no distortion. If `imgSize` is another size than the video's, K is of that;
//! - `Hand_Poses/.../right_hand.pkl` and `left_hand.pkl`: for each frame of the videos, sorted by name, PyTorch's tensors
//!   `hand_pose` (48), axis-angle from the flat hand, and `hand_trans` (3), metres: where the wrist's joint is;
//! - `right_hand_shape.pkl`: `hand_shape` (10). Left hands have MANO's left model with its shapes as published.
//!
//! The camera on the head moves and is not read. Masks are not read.

use std::path::Path;

use ghand_core::Side;
use ghand_footage::Footage;
use ghand_hand_model::files::mano::LeftShapes;
use glam::{DVec2, DVec3};

use super::{above, name, stems};
use crate::DatasetError;
use crate::dataset::Layout;
use crate::fields::{DataFile, Field};
use crate::sequence::{Annotated, Fingers, ManoPose, Picture, Place, Rigid, Sequence, View, choose_side, pinhole};
use crate::write::plain_ids;

pub(crate) const LAYOUT: Layout = Layout {
    name: "TACO",
    example: "Allocentric_RGB_Videos/(stir, spoon, bowl)/20231105_019",
    is_sequence: |folder| {
        name(&above(folder, 2)).ends_with("Allocentric_RGB_Videos") && !stems(folder, &["mp4"]).is_empty()
    },
    is_whole: |folder| {
        folder.join("Hand_Poses").is_dir()
            || name(folder).ends_with("Allocentric_RGB_Videos")
            || name(&above(folder, 1)).ends_with("Allocentric_RGB_Videos")
    },
    read,
};

fn read(folder: &Path, side: Option<Side>) -> Result<Sequence, DatasetError> {
    let beside = |part: &str| above(folder, 3).join(part).join(name(&above(folder, 1))).join(name(folder));
    let poses = beside("Hand_Poses");
    let file = |side: Side| poses.join(format!("{side}_hand.pkl"));
    if !poses.is_dir() {
        return Err(DatasetError::file(&poses, "is missing; unpack Hand_Poses beside the videos"));
    }
    let side = choose_side(side, [Side::Right, Side::Left].map(|side| file(side).is_file()), folder)?;
    let motion = DataFile::read(&file(side))?;
    let shape = DataFile::read(&poses.join(format!("{side}_hand_shape.pkl")))?;
    let shape = shape.root().get("hand_shape")?.numbers(10)?;
    let calibration = DataFile::read(&beside("Allocentric_Camera_Parameters").join("calibration.json"))?;
    let mut cameras = vec![];
    let mut videos = vec![];
    for serial in stems(folder, &["mp4"]) {
        let video = folder.join(format!("{serial}.mp4"));
        let camera = calibration.root().get(&serial)?;
        let footage = Footage::open(&video)?;
        let k = camera.get("K")?.numbers(9)?;
        let [fx, _, cx, _, fy, cy, ..] = k[..] else { continue };
        let scale = scale(&camera, footage.size())?;
        // Half pixels are those of the larger image.
        let principal = (DVec2::new(cx, cy) + 0.5) * scale - 0.5;
        let camera_from_world =
            Rigid { rotation: camera.get("R")?.rotation()?, translation: camera.get("T")?.point()? };
        cameras.push(pinhole(&serial, footage.size(), DVec2::new(fx, fy) * scale, principal, &camera_from_world));
        videos.push((video, footage.times().len()));
    }
    let root = motion.root();
    let mut names = root.names();
    names.sort();
    let ids = plain_ids(names.iter().map(String::as_str));
    let mut frames = vec![];
    for (number, (name, id)) in names.iter().zip(ids).enumerate() {
        let view = |(video, count): &(std::path::PathBuf, usize)| {
            let picture = Picture::Video(video.clone(), number);
            (number < *count).then_some(View { picture, mask: None, warp: None })
        };
        let views: Vec<Option<View>> = videos.iter().map(view).collect();
        let mano = mano_pose(&root.get(name)?, &shape)?;
        if views.iter().any(Option::is_some) {
            frames.push(Annotated { id, joints: None, mano: Some(mano), views });
        }
    }
    let different = videos.iter().filter(|(_, count)| *count != names.len()).count();
    let remark = (different > 0).then(|| {
        format!(
            "{different} videos have another number of frames than the poses, {}; the first ones are taken together",
            names.len()
        )
    });
    Ok(Sequence {
        side,
        cameras,
        frames,
        tip_inset: 0.0,
        left_shapes: LeftShapes::AsPublished,
        remarks: remark.into_iter().collect(),
    })
}

/// How many times as large as the calibrated image the video is.
fn scale(camera: &Field, size: (u32, u32)) -> Result<DVec2, DatasetError> {
    let Some(field) = camera.find("imgSize") else { return Ok(DVec2::ONE) };
    match field.numbers(2)?[..] {
        [width, height] if width > 0.0 && height > 0.0 => {
            Ok(DVec2::new(f64::from(size.0), f64::from(size.1)) / DVec2::new(width, height))
        }
        _ => Err(field.invalid("must be two sizes above 0")),
    }
}

fn mano_pose(frame: &Field, shape: &[f64]) -> Result<ManoPose, DatasetError> {
    let pose = frame.get("hand_pose")?.numbers(48)?;
    let (root, fingers) = pose.split_at(3);
    Ok(ManoPose {
        root: DVec3::from_slice(root),
        fingers: Fingers::Rotations(fingers.to_vec()),
        from_mean: false,
        shape: shape.to_vec(),
        place: Place::Joint(0, frame.get("hand_trans")?.point()?),
        world_from_mano: Rigid::IDENTITY,
    })
}
