//! FreiHAND: `training_K.json`, `training_xyz.json` and `training_mano.json`, one entry for each of 32,560 images
//! `training/rgb/00000000.jpg` (of the green screen; the next three times 32,560 have made backgrounds) and masks
//! `training/mask/00000000.jpg`.
//!
//! - `K` (3, 3) is of the 224 x 224 pixels of an image: another focal length for each, the axis in the middle.
//! - `xyz` (21, 3): joints in MediaPipe's order, metres, in the axes of the image's camera (x right, y down, z forward).
//!   Fingertips are vertices of the skin.
//! - `mano` (1, 61): 48 axis-angle numbers from MANO's mean pose, the root first; 10 of the shape; 3 of an orthographic
//!   camera. The hand is placed so that the middle finger's knuckle is at its joint.
//! - All hands are right hands; left ones were mirrored.
//!
//! Images are single moments of 32 people, without a word on who is shown. They become one camera with the focal length
//! of most: images are enlarged or reduced about their axis. Hands of nearly one size are taken.

use std::path::Path;

use ghand_core::Side;
use ghand_core::statistics::median;
use ghand_hand_model::files::mano::LeftShapes;
use ghand_motion::ik::BONES;
use glam::{DVec2, DVec3};

use super::no_images;
use crate::DatasetError;
use crate::dataset::Layout;
use crate::fields::DataFile;
use crate::sequence::{
    Annotated, Fingers, ManoPose, Mask, Picture, Place, Rigid, Sequence, View, choose_side, pinhole, points,
};
use crate::warp::Warp;

pub(crate) const LAYOUT: Layout = Layout {
    name: "FreiHAND",
    example: "the folder with training_xyz.json",
    is_sequence: |folder| folder.join("training_xyz.json").is_file() && folder.join("training_K.json").is_file(),
    is_whole: |_| false,
    read,
};

/// Sizes of hands that differ by less than this part are taken as one.
const ONE_SIZE: f64 = 0.02;
/// MANO's joint at the knuckle of the middle finger, and that landmark.
const MIDDLE_KNUCKLE: (usize, usize) = (4, 9);

fn read(folder: &Path, side: Option<Side>) -> Result<Sequence, DatasetError> {
    let side = choose_side(side, [true, false], folder)?;
    let cameras = DataFile::read(&folder.join("training_K.json"))?.root().rows(9)?;
    let joints_file = DataFile::read(&folder.join("training_xyz.json"))?;
    let joints = joints_file.root().rows(63)?;
    let mano_file = folder.join("training_mano.json");
    let mano = if mano_file.is_file() { DataFile::read(&mano_file)?.root().rows(61)? } else { vec![] };
    if cameras.len() != joints.len() || !(mano.is_empty() || mano.len() == joints.len()) {
        let [k, m] = [cameras.len(), mano.len()];
        let problem = format!(
            "has {} samples, training_K.json {k} and training_mano.json {m}; download them again",
            joints.len()
        );
        return Err(joints_file.root().invalid(problem));
    }
    let focal_and_principal = |k: &[f64]| match *k {
        [fx, _, cx, _, fy, cy, ..] => (DVec2::new(fx, fy), DVec2::new(cx, cy)),
        _ => (DVec2::ONE, DVec2::ZERO),
    };
    let intrinsics: Vec<(DVec2, DVec2)> = cameras.iter().map(|k| focal_and_principal(k)).collect();
    let sizes: Vec<f64> = joints.iter().map(|numbers| size(&points(numbers))).collect();
    let usual_size = median(sizes.clone());
    let picture = |k: usize| folder.join("training/rgb").join(format!("{k:08}.jpg"));
    let taken: Vec<usize> = (0..joints.len())
        .filter(|k| {
            sizes.get(*k).is_some_and(|size| (size / usual_size - 1.0).abs() < ONE_SIZE) && picture(*k).is_file()
        })
        .collect();
    let first = taken.first().ok_or_else(|| no_images(&folder.join("training/rgb")))?;
    let image_size = Picture::File(picture(*first)).size()?;
    let focals = taken.iter().filter_map(|k| Some(intrinsics.get(*k)?.0));
    let focal = DVec2::new(median(focals.clone().map(|f| f.x)), median(focals.map(|f| f.y)));
    let principal = intrinsics.get(*first).map_or(DVec2::ZERO, |(_, principal)| *principal);
    let lens = pinhole("cam0", image_size, focal, principal, &Rigid::IDENTITY);
    let frame = |k: usize| -> Option<Annotated> {
        let (from_focal, from_principal) = *intrinsics.get(k)?;
        let joints = points(joints.get(k)?);
        let mask = folder.join("training/mask").join(format!("{k:08}.jpg"));
        let warp = Warp::Zoom { from: (from_focal, from_principal + 0.5), to: (focal, principal + 0.5) };
        let view = View {
            picture: Picture::File(picture(k)),
            mask: mask.is_file().then_some(Mask::Bright(mask)),
            warp: Some(warp),
        };
        let mano = mano.get(k).and_then(|numbers| mano_pose(numbers, joints[MIDDLE_KNUCKLE.1]));
        Some(Annotated { id: format!("{k:08}"), joints: Some(joints), mano, views: vec![Some(view)] })
    };
    let remark = format!(
        "FreiHAND does not say whose hand an image shows: {} of {} hands are within {:.0} % of one size and may be of several \
         people",
        taken.len(),
        joints.len(),
        100.0 * ONE_SIZE
    );
    Ok(Sequence {
        side,
        cameras: vec![lens],
        frames: taken.into_iter().filter_map(frame).collect(),
        tip_inset: 0.0,
        left_shapes: LeftShapes::Fixed,
        remarks: vec![remark],
    })
}

fn mano_pose(numbers: &[f64], middle_knuckle: DVec3) -> Option<ManoPose> {
    Some(ManoPose {
        root: DVec3::from_slice(numbers.get(..3)?),
        fingers: Fingers::Rotations(numbers.get(3..48)?.to_vec()),
        from_mean: true,
        shape: numbers.get(48..58)?.to_vec(),
        place: Place::Joint(MIDDLE_KNUCKLE.0, middle_knuckle),
        world_from_mano: Rigid::IDENTITY,
    })
}

/// The length of all bones, metres.
fn size(joints: &[DVec3; 21]) -> f64 {
    BONES.iter().map(|(from, to)| joints[*from].distance(joints[*to])).sum()
}
