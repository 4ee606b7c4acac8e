//! HOT3D-Clips: a clip is `train_aria/clip-000123.tar`, or the folder that it was unpacked to, with for each of 150 frames
//!
//! - `000012.image_214-1.jpg`: by the number of the stream; Aria's 214-1 is in colour, 1201-1 and 1201-2 are grey;
//! - `000012.cameras.json`: by stream `calibration` with `projection_model_type`, `projection_params` (fx, fy, cx, cy, or
//!   one focal length, then 12 numbers of the lens), `image_width`, `image_height`, `T_device_from_camera`; and
//!   `T_world_from_camera`. Motions are `quaternion_wxyz` and `translation_xyz`, metres; axes x right, y down, z forward; the
//!   first pixel's centre is at (0, 0);
//! - `000012.hands.json`: for `left` and `right` `mano_pose` with `thetas` (15 components from the mean pose) and
//!   `wrist_xform` (6): the root's axis-angle and a translation that is added to the hand, world; and by stream
//!   `visibilities_modeled`, from 0 to 1;
//!
//! and `__hand_shapes.json__` with `mano`, the shape (10) of both hands. Left hands have MANO's left model with corrected
//! shapes.
//!
//! The headset moves: the world of the capture is the device. Its lenses are fisheyes, whose images are turned into those of
//! pinhole cameras with the same focal length. If a stream is in colour, grey ones are not read. There are no masks of hands.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use ghand_capture::cameras::list::LensCamera;
use ghand_core::Side;
use ghand_hand_model::files::mano::LeftShapes;
use glam::{DVec2, DVec3};

use crate::DatasetError;
use crate::dataset::Layout;
use crate::fields::{DataFile, Field};
use crate::pictures::bytes_within;
use crate::sequence::{Annotated, Fingers, ManoPose, Picture, Place, Rigid, Sequence, View, choose_side, pinhole};
use crate::warp::{Fisheye624, Warp};

pub(crate) const LAYOUT: Layout = Layout {
    name: "HOT3D-Clips",
    example: "train_aria/clip-000123.tar",
    is_sequence: |path| {
        let is_tar = path.extension().is_some_and(|extension| extension == "tar") && path.is_file();
        let is_clip = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("clip-"));
        (is_tar && is_clip) || path.join("000000.cameras.json").is_file()
    },
    is_whole: |folder| {
        ["train_aria", "train_quest3"].iter().any(|part| folder.join(part).is_dir())
            || super::stems(folder, &["tar"]).iter().any(|stem| stem.starts_with("clip-"))
    },
    read,
};

/// The shapes of both hands.
const SHAPES: &str = "__hand_shapes.json__";
/// The only lens model of the data set.
const FISHEYE: &str = "FISHEYE624";
/// A hand of which less is visible is not there: HOT3D itself makes no crop of it.
const LEAST_VISIBLE: f64 = 0.1;
/// Images are no larger.
const LARGEST_SIDE: usize = 1 << 14;

/// The files of a clip by name.
struct Clip {
    path: PathBuf,
    /// Where each file is in the archive; of a folder, no place.
    files: BTreeMap<String, Option<(u64, u64)>>,
}

impl Clip {
    fn open(path: &Path) -> Result<Clip, DatasetError> {
        let fail =
            |error: std::io::Error| DatasetError::file(path, format!("cannot be read: {error}; download it again"));
        let mut files = BTreeMap::new();
        if path.is_dir() {
            for entry in path.read_dir().map_err(fail)? {
                files.insert(entry.map_err(fail)?.file_name().to_string_lossy().into_owned(), None);
            }
        } else {
            let mut archive = tar::Archive::new(File::open(path).map_err(fail)?);
            for entry in archive.entries_with_seek().map_err(fail)? {
                let entry = entry.map_err(fail)?;
                let name = entry.path().map_err(fail)?;
                let Some(name) = name.file_name() else { continue };
                files.insert(name.to_string_lossy().into_owned(), Some((entry.raw_file_position(), entry.size())));
            }
        }
        Ok(Clip { path: path.into(), files })
    }

    fn picture(&self, name: &str) -> Option<Picture> {
        let place = self.files.get(name)?;
        Some(match place {
            None => Picture::File(self.path.join(name)),
            Some((start, length)) => {
                Picture::Entry { archive: self.path.clone(), name: name.into(), start: *start, length: *length }
            }
        })
    }

    fn json(&self, name: &str) -> Result<Option<DataFile>, DatasetError> {
        match self.files.get(name) {
            None => Ok(None),
            Some(None) => DataFile::read(&self.path.join(name)).map(Some),
            Some(Some((start, length))) => {
                DataFile::of_bytes(self.path.join(name), &bytes_within(&self.path, *start, *length)?).map(Some)
            }
        }
    }

    fn needed(&self, name: &str) -> Result<DataFile, DatasetError> {
        let missing = || {
            let problem = "is missing; the test clips have no poses: give a clip of train_aria or train_quest3";
            DatasetError::file(&self.path.join(name), problem)
        };
        self.json(name)?.ok_or_else(missing)
    }
}

/// A camera of the headset.
struct Stream {
    name: String,
    lens: Fisheye624,
    device_from_camera: Rigid,
    camera: LensCamera,
}

fn read(path: &Path, side: Option<Side>) -> Result<Sequence, DatasetError> {
    let clip = Clip::open(path)?;
    let shape = clip.needed(SHAPES)?.root().get("mano")?.numbers(10)?;
    let ids: Vec<String> =
        clip.files.keys().filter_map(|name| name.strip_suffix(".cameras.json")).map(str::to_owned).collect();
    let first = ids.first().ok_or_else(|| DatasetError::file(path, "has no cameras; download it again"))?;
    let streams = streams(&clip.needed(&format!("{first}.cameras.json"))?.root())?;
    let mut annotated = vec![];
    for id in &ids {
        if let Some(hands) = clip.json(&format!("{id}.hands.json"))? {
            annotated.push((id, hands));
        }
    }
    let has = |side: Side| annotated.iter().any(|(_, hands)| mano_of(&hands.root(), side).is_some());
    let side = choose_side(side, [has(Side::Right), has(Side::Left)], path)?;
    let mut frames = vec![];
    for (id, hands) in &annotated {
        let Some(hand) = mano_of(&hands.root(), side) else { continue };
        let cameras = clip.needed(&format!("{id}.cameras.json"))?;
        let device_from_world = device_from_world(&cameras.root(), &streams)?;
        let visible = hands.root().get(&side.to_string())?.find("visibilities_modeled");
        let mut views = vec![];
        for stream in &streams {
            let share = visible.as_ref().and_then(|visible| visible.find(&stream.name));
            let is_visible = share.map(|share| share.number()).transpose()?.is_none_or(|share| share >= LEAST_VISIBLE);
            let picture = clip.picture(&format!("{id}.image_{}.jpg", stream.name)).filter(|_| is_visible);
            let warp = Warp::Fisheye(Box::new(stream.lens), stream.camera.camera.clone());
            views.push(picture.map(|picture| View { picture, mask: None, warp: Some(warp) }));
        }
        if views.iter().all(Option::is_none) {
            continue;
        }
        let mano = mano_pose(&hand, &shape, device_from_world)?;
        frames.push(Annotated { id: (*id).clone(), joints: None, mano: Some(mano), views });
    }
    let is_grey = streams.iter().all(|stream| !stream.is_in_color());
    let remark = is_grey.then(|| "all cameras of this headset are grey, and so will be an avatar".to_owned());
    Ok(Sequence {
        side,
        cameras: streams.into_iter().map(|stream| stream.camera).collect(),
        frames,
        tip_inset: 0.0,
        left_shapes: LeftShapes::Fixed,
        remarks: remark.into_iter().collect(),
    })
}

impl Stream {
    /// Project Aria's number of its RGB camera.
    fn is_in_color(&self) -> bool {
        self.name.starts_with("214-")
    }

    fn of(name: &str, camera: &Field) -> Result<Stream, DatasetError> {
        let calibration = camera.get("calibration")?;
        let model = calibration.get("projection_model_type")?;
        if !model.text()?.to_uppercase().ends_with(FISHEYE) {
            return Err(model.invalid(format!("is {}, expected {FISHEYE}", model.text()?)));
        }
        let params = calibration.get("projection_params")?;
        let numbers: Vec<f64> = params.rows(1)?.concat();
        let (focal, principal, rest) = match numbers[..] {
            [f, cx, cy, ref rest @ ..] if rest.len() == 12 => (DVec2::splat(f), DVec2::new(cx, cy), rest),
            [fx, fy, cx, cy, ref rest @ ..] if rest.len() == 12 => (DVec2::new(fx, fy), DVec2::new(cx, cy), rest),
            _ => return Err(params.invalid(format!("has {} numbers, expected 15 or 16", numbers.len()))),
        };
        let [k1, k2, k3, k4, k5, k6, p1, p2, s1, s2, s3, s4] = rest[..] else {
            return Err(params.invalid("must have 12 numbers of the lens"));
        };
        let lens = Fisheye624 {
            focal,
            principal: principal + 0.5,
            radial: [k1, k2, k3, k4, k5, k6],
            tangential: [p1, p2],
            prism: [s1, s2, s3, s4],
        };
        let size = |name: &str| Ok::<_, DatasetError>(calibration.get(name)?.count(LARGEST_SIDE)? as u32);
        let size = (size("image_width")?, size("image_height")?);
        let device_from_camera = motion(&calibration.get("T_device_from_camera")?)?;
        let camera = pinhole(name, size, focal, principal, &device_from_camera.inverse());
        Ok(Stream { name: name.into(), lens, device_from_camera, camera })
    }
}

fn motion(field: &Field) -> Result<Rigid, DatasetError> {
    field.by_quaternion("quaternion_wxyz", "translation_xyz")
}

/// The streams to read: those in colour, if there are any.
fn streams(cameras: &Field) -> Result<Vec<Stream>, DatasetError> {
    let all = cameras.names().into_iter().map(|name| Stream::of(&name, &cameras.get(&name)?));
    let mut all: Vec<Stream> = all.collect::<Result<_, _>>()?;
    if all.is_empty() {
        return Err(cameras.invalid("has no cameras; download it again"));
    }
    if all.iter().any(Stream::is_in_color) {
        all.retain(Stream::is_in_color);
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

/// Where the headset was at a moment.
fn device_from_world(cameras: &Field, streams: &[Stream]) -> Result<Rigid, DatasetError> {
    let stream = streams.first().ok_or_else(|| cameras.invalid("has no cameras"))?;
    let world_from_camera = motion(&cameras.get(&stream.name)?.get("T_world_from_camera")?)?;
    Ok(stream.device_from_camera.after(&world_from_camera.inverse()))
}

/// MANO's parameters of a hand; registration failed in some frames.
fn mano_of<'a>(hands: &Field<'a>, side: Side) -> Option<Field<'a>> {
    hands.find(&side.to_string())?.find("mano_pose")
}

fn mano_pose(mano: &Field, shape: &[f64], device_from_world: Rigid) -> Result<ManoPose, DatasetError> {
    let wrist = mano.get("wrist_xform")?.numbers(6)?;
    let (root, place) = wrist.split_at(3);
    Ok(ManoPose {
        root: DVec3::from_slice(root),
        fingers: Fingers::Components(mano.get("thetas")?.numbers(15)?),
        from_mean: true,
        shape: shape.to_vec(),
        place: Place::Added(DVec3::from_slice(place)),
        world_from_mano: device_from_world,
    })
}
