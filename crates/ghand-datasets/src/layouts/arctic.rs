//! ARCTIC: the images of a sequence are `images/s01/box_grab_01` with one folder for each view, `1/00012.jpg`; beside
//! `images` are
//!
//! - `meta/misc.json`: for each subject `world2cam` (8, 4, 4), metres, and `intris_mat` (8, 3, 3), of the views 1 to 8, and
//!   `ioi_offset`, what is added to the number of a frame to get that of its image;
//! - `raw_seqs/s01/box_grab_01.mano.npy`: for `right` and `left` MANO's `rot` (T, 3), `pose` (T, 45), axis-angle from the
//!   mean pose, `trans` (T, 3), metres, added to the hand, and `shape` (10), world. Left hands have MANO's left model with
//!   its shapes as published.
//!
//! View 0 is a camera on the head, which moves, and is not read. There are no masks and, without a run of ARCTIC's own
//! program, no joints.

use std::path::Path;

use ghand_core::Side;
use ghand_hand_model::files::mano::LeftShapes;
use glam::DVec3;

use super::{IMAGES, above, name, no_images, stems, with_extension};
use crate::DatasetError;
use crate::dataset::Layout;
use crate::fields::{DataFile, Field};
use crate::sequence::{Annotated, Fingers, ManoPose, Place, Rigid, Sequence, View, choose_side, pinhole_of_matrix};

pub(crate) const LAYOUT: Layout = Layout {
    name: "ARCTIC",
    example: "images/s01/box_grab_01",
    is_sequence: |folder| {
        ["images", "cropped_images"].contains(&name(&above(folder, 2)).as_str())
            && above(folder, 3).join("raw_seqs").is_dir()
            && folder.join("1").is_dir()
    },
    is_whole: |folder| folder.join("raw_seqs").is_dir() && folder.join("meta/misc.json").is_file(),
    read,
};

/// Views of still cameras.
const VIEWS: usize = 8;
/// Larger numbers of images do not exist.
const LARGEST_OFFSET: usize = 100_000;

fn read(folder: &Path, side: Option<Side>) -> Result<Sequence, DatasetError> {
    if name(&above(folder, 2)) == "cropped_images" {
        let problem = "are cropped images, whose place in the whole images is not in them; give the same folder in images, \
                       which download_images.sh downloads";
        return Err(DatasetError::file(folder, problem));
    }
    let root = above(folder, 3);
    let subject = name(&above(folder, 1));
    let misc = DataFile::read(&root.join("meta/misc.json"))?;
    let meta = misc.root().get(&subject)?;
    let offset = meta.get("ioi_offset")?.count(LARGEST_OFFSET)?;
    let motion = DataFile::read(&root.join("raw_seqs").join(&subject).join(format!("{}.mano.npy", name(folder))))?;
    let hands = [Side::Right, Side::Left].map(|side| motion.root().find(&side.to_string()));
    let side = choose_side(side, hands.each_ref().map(Option::is_some), folder)?;
    let hand = motion.root().get(&side.to_string())?;
    let mut views = vec![];
    let mut cameras = vec![];
    for view in 1..=VIEWS {
        let images = folder.join(view.to_string());
        let Some(first) = stems(&images, &IMAGES).into_iter().next() else { continue };
        let Some(first) = with_extension(&images, &first, &IMAGES) else { continue };
        let item = |name: &str| -> Result<Field, DatasetError> {
            let field = meta.get(name)?;
            field.item(view - 1).ok_or_else(|| field.invalid(format!("lacks view {view}")))
        };
        let size = View::file(first, None).picture.size()?;
        let camera_from_world = item("world2cam")?.rigid()?;
        let k = item("intris_mat")?.numbers(9)?;
        cameras.push(pinhole_of_matrix(&format!("view{view}"), size, &k, &camera_from_world));
        views.push(images);
    }
    if cameras.is_empty() {
        return Err(no_images(folder));
    }
    let mut frames = vec![];
    for (number, mano) in mano_poses(&hand)?.into_iter().enumerate() {
        let stem = format!("{:05}", number + offset);
        let view = |images: &std::path::PathBuf| Some(View::file(with_extension(images, &stem, &IMAGES)?, None));
        let views: Vec<Option<View>> = views.iter().map(view).collect();
        if views.iter().any(Option::is_some) {
            frames.push(Annotated { id: stem, joints: None, mano: Some(mano), views });
        }
    }
    Ok(Sequence { side, cameras, frames, tip_inset: 0.0, left_shapes: LeftShapes::AsPublished, remarks: vec![] })
}

fn mano_poses(hand: &Field) -> Result<Vec<ManoPose>, DatasetError> {
    let roots = hand.get("rot")?.rows(3)?;
    let fingers = hand.get("pose")?.rows(45)?;
    let places = hand.get("trans")?.rows(3)?;
    // One for all frames; in some files, once for each.
    let shape = hand.get("shape")?;
    let shape = shape.rows(10)?.into_iter().next().ok_or_else(|| shape.invalid("is empty; download it again"))?;
    if roots.len() != fingers.len() || roots.len() != places.len() {
        let [rot, pose, trans] = [&roots, &fingers, &places].map(Vec::len);
        return Err(
            hand.invalid(format!("has {rot} rows of rot, {pose} of pose and {trans} of trans; download it again"))
        );
    }
    let pose = |((root, fingers), place): ((&Vec<f64>, Vec<f64>), &Vec<f64>)| ManoPose {
        root: DVec3::from_slice(root),
        fingers: Fingers::Rotations(fingers),
        from_mean: true,
        shape: shape.clone(),
        place: Place::Added(DVec3::from_slice(place)),
        world_from_mano: Rigid::IDENTITY,
    };
    Ok(roots.iter().zip(fingers).zip(&places).map(pose).collect())
}
