//! HanCo: 1,518 sequences of 8 cameras, `rgb/0110/cam3/00000024.jpg`, with the same numbers in
//!
//! - `calib/0110/00000024.json`: `K` (8, 3, 3) and `M` (8, 4, 4), from the world to each camera, metres;
//! - `xyz/0110/00000024.json` (21, 3): joints in MediaPipe's order, world, metres; fingertips are vertices of the skin;
//! - `shape/0110/00000024.json`: MANO's `poses` (48 axis-angle numbers from the mean pose), `shapes` (10) and `global_t`
//!   (3, metres, added to the hand), world;
//! - `mask_hand/0110/cam3/00000024.jpg`: the hand without objects, bright on black; only of sequences with a green screen;
//! - `meta.json`: `has_fit[110][24]`, whether there is a fit of the hand.
//!
//! All hands are right hands. `rgb_merged/0110` and others, with made backgrounds, can be given in place of `rgb/0110`.

use std::path::Path;

use ghand_capture::cameras::list::LensCamera;
use ghand_core::Side;
use ghand_hand_model::files::mano::LeftShapes;
use glam::DVec3;

use super::{IMAGES, above, name, no_images, stems, with_extension};
use crate::DatasetError;
use crate::dataset::Layout;
use crate::fields::{DataFile, Field};
use crate::sequence::{
    Annotated, Fingers, ManoPose, Mask, Place, Rigid, Sequence, View, choose_side, pinhole_of_matrix, points,
};

pub(crate) const LAYOUT: Layout = Layout {
    name: "HanCo",
    example: "rgb/0110",
    is_sequence: |folder| {
        name(&above(folder, 1)).starts_with("rgb")
            && folder.join("cam0").is_dir()
            && above(folder, 2).join("calib").join(name(folder)).is_dir()
    },
    is_whole: |folder| ["rgb", "calib", "xyz"].iter().all(|part| folder.join(part).is_dir()),
    read,
};

/// Cameras of a sequence.
const CAMERAS: usize = 8;
/// Numbers of a calibration that differ by more are of a camera that was moved: pixels, or metres.
const SAME_CALIBRATION: f64 = 1e-3;

fn read(folder: &Path, side: Option<Side>) -> Result<Sequence, DatasetError> {
    let side = choose_side(side, [true, false], folder)?;
    let root = above(folder, 2);
    let sequence = name(folder);
    let has_fit = fits(&root, &sequence)?;
    let mut calibration: Option<Vec<f64>> = None;
    let mut cameras = vec![];
    let mut frames = vec![];
    let mut moved = 0;
    for stem in stems(&root.join("xyz").join(&sequence), &["json"]) {
        let number = stem.parse::<usize>().ok();
        if number.is_some_and(|number| has_fit.get(number) == Some(&false)) {
            continue;
        }
        let file = |part: &str| root.join(part).join(&sequence).join(format!("{stem}.json"));
        let joints = DataFile::read(&file("xyz"))?.root().numbers(63)?;
        let calib = DataFile::read(&file("calib"))?;
        let numbers =
            [calib.root().get("K")?.numbers(9 * CAMERAS)?, calib.root().get("M")?.numbers(16 * CAMERAS)?].concat();
        let differs = |first: &Vec<f64>| first.iter().zip(&numbers).any(|(a, b)| (a - b).abs() > SAME_CALIBRATION);
        if calibration.as_ref().is_some_and(differs) {
            moved += 1;
            continue;
        }
        let view = |camera: usize| -> Option<View> {
            let part = format!("cam{camera}");
            let picture = with_extension(&folder.join(&part), &stem, &IMAGES)?;
            let mask = with_extension(&root.join("mask_hand").join(&sequence).join(&part), &stem, &IMAGES);
            Some(View::file(picture, mask.map(Mask::Bright)))
        };
        let views: Vec<Option<View>> = (0..CAMERAS).map(view).collect();
        if views.iter().all(Option::is_none) {
            continue;
        }
        if calibration.is_none() {
            cameras = lenses(&calib.root(), &views)?;
            calibration = Some(numbers);
        }
        let shape = file("shape");
        let mano = if shape.is_file() { Some(mano_pose(&DataFile::read(&shape)?.root())?) } else { None };
        frames.push(Annotated { id: stem, joints: Some(points(&joints)), mano, views });
    }
    if frames.is_empty() {
        return Err(no_images(folder));
    }
    let remark =
        (moved > 0).then(|| format!("in {moved} frames cameras are calibrated differently; they are left out"));
    Ok(Sequence {
        side,
        cameras,
        frames,
        tip_inset: 0.0,
        left_shapes: LeftShapes::Fixed,
        remarks: remark.into_iter().collect(),
    })
}

/// Whether each frame has a fit; empty if that is not known.
fn fits(root: &Path, sequence: &str) -> Result<Vec<bool>, DatasetError> {
    let path = root.join("meta.json");
    if !path.is_file() {
        return Ok(vec![]);
    }
    let meta = DataFile::read(&path)?;
    let all = meta.root().get("has_fit")?;
    let number = sequence.parse::<usize>().unwrap_or(usize::MAX);
    // Sequences of one length are an array of numbers, others a list of them.
    let row = all.item(number).ok_or_else(|| all.invalid(format!("lacks the sequence {sequence}")))?;
    Ok(row.rows(1)?.into_iter().map(|value| value != [0.0]).collect())
}

fn lenses(calib: &Field, views: &[Option<View>]) -> Result<Vec<LensCamera>, DatasetError> {
    let intrinsics = calib.get("K")?.rows(9)?;
    let mut lenses = vec![];
    let size = |view: &Option<View>| view.as_ref().map(|view| view.picture.size());
    // All cameras have images of one size.
    let usual = views.iter().find_map(size).transpose()?.unwrap_or_default();
    for (camera, k) in intrinsics.iter().enumerate() {
        let m = calib.get("M")?;
        let m = m.item(camera).ok_or_else(|| m.invalid(format!("lacks camera {camera}")))?.rigid()?;
        let size = views.get(camera).and_then(size).transpose()?.unwrap_or(usual);
        lenses.push(pinhole_of_matrix(&format!("cam{camera}"), size, k, &m));
    }
    Ok(lenses)
}

fn mano_pose(shape: &Field) -> Result<ManoPose, DatasetError> {
    let pose = shape.get("poses")?.numbers(48)?;
    let (root, fingers) = pose.split_at(3);
    Ok(ManoPose {
        root: DVec3::from_slice(root),
        fingers: Fingers::Rotations(fingers.to_vec()),
        from_mean: true,
        shape: shape.get("shapes")?.numbers(10)?,
        place: Place::Added(shape.get("global_t")?.point()?),
        world_from_mano: Rigid::IDENTITY,
    })
}
