//! COLMAP's sparse models, as text or binary: cameras that stand still, or a rig.
//!
//! Lenses and images suffice for cameras that stand still. A rig, which COLMAP has since version 3.12, may move as a
//! whole: then the places of its cameras are relative to the first.

mod binary;
mod models;
mod text;

use std::path::{Path, PathBuf};

use ghand_files::input_file;

use super::found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit};
use super::rotations::from_wxyz;
use super::shots::{self, Shot};
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;
use crate::reading::text_file::text_of;
use crate::reading::validation::FileValidator;

/// Largest file; that of images holds their keypoints, too.
const LARGEST_FILE: u64 = 1 << 29;
/// Where models are in a project's folder.
const PLACES: [&str; 3] = ["", "sparse/0", "sparse"];

/// A camera as COLMAP has it: a lens, shared by images.
struct Lens {
    id: u32,
    model: String,
    size: [u64; 2],
    parameters: Vec<f64>,
}

/// A reconstructed image.
struct Image {
    lens: u32,
    name: String,
    /// `camera_from_world`: the quaternion, real part first, and the translation.
    place: [f64; 7],
}

/// A rig's camera, with its place relative to the first one.
struct Sensor {
    lens: u32,
    place: Option<[f64; 7]>,
}

/// The folder of a model in a folder, if it has one.
pub(super) fn model_in(folder: &Path) -> Option<PathBuf> {
    let has = |place: &Path, name: &str| ["bin", "txt"].iter().any(|end| place.join(format!("{name}.{end}")).is_file());
    PLACES.iter().map(|place| folder.join(place)).find(|place| has(place, "cameras") && has(place, "images"))
}

/// Whether a file's name is that of a model's part.
pub(super) fn is_part(name: &str) -> bool {
    let part = name.strip_suffix(".bin").or_else(|| name.strip_suffix(".txt"));
    part.is_some_and(|part| ["cameras", "images", "rigs", "frames", "points3D"].contains(&part))
}

/// Reads the model in a folder. Of a folder with both kinds, COLMAP reads the binary ones.
pub(super) fn read(folder: &Path) -> Result<FoundCalibration, CaptureError> {
    let is_binary = ["cameras.bin", "images.bin"].iter().all(|name| folder.join(name).is_file());
    let bytes = |path: &Path| -> Result<Vec<u8>, CaptureError> {
        let io = |source| CaptureError::Io {
            path: path.into(),
            action: "read the cameras",
            source,
            remedy: "give the folder of a COLMAP model",
        };
        input_file::read(path, LARGEST_FILE).map_err(io)?.ok_or_else(|| {
            FileValidator { path }
                .invalid("file", format!("is larger than {} MiB; remove keypoints", LARGEST_FILE >> 20))
        })
    };
    let ending = if is_binary { "bin" } else { "txt" };
    let path = |name: &str| folder.join(format!("{name}.{ending}"));
    let (cameras_path, images_path, rigs_path) = (path("cameras"), path("images"), path("rigs"));
    let has_rigs = rigs_path.is_file();
    let (lenses, images, rigs) = if is_binary {
        let rigs = if has_rigs { binary::rigs(&rigs_path, &bytes(&rigs_path)?)? } else { vec![] };
        (
            binary::lenses(&cameras_path, &bytes(&cameras_path)?)?,
            binary::images(&images_path, &bytes(&images_path)?)?,
            rigs,
        )
    } else {
        let text = |path: &Path| text_of(path, bytes(path)?);
        let rigs = if has_rigs { text::rigs(&rigs_path, &text(&rigs_path)?)? } else { vec![] };
        (text::lenses(&cameras_path, &text(&cameras_path)?)?, text::images(&images_path, &text(&images_path)?)?, rigs)
    };
    let mut rigs = rigs.into_iter().filter(|sensors| sensors.len() > 1);
    let mut remarks = vec![];
    let placed = match (rigs.next(), rigs.next()) {
        (Some(rig), None) => {
            remarks.push("the cameras are a rig; the world is that of its first camera".into());
            cameras_of_rig(&rigs_path, &rig, &images)?
        }
        _ => cameras_of_images(&images_path, &images)?,
    };
    let camera = |(id, lens, place): (String, u32, Rigid)| {
        let validator = FileValidator { path: &cameras_path };
        let lens = lenses.iter().find(|known| known.id == lens).ok_or_else(|| {
            validator.invalid(format!("camera {lens}"), "is missing, but has images; copy the whole model")
        })?;
        found(validator, id, lens, place)
    };
    let cameras: Vec<FoundCamera> = placed.into_iter().map(camera).collect::<Result<_, _>>()?;
    FoundCalibration::checked(folder, CalibrationFormat::Colmap, LengthUnit::Unknown, cameras, remarks)
}

fn found(validator: FileValidator, id: String, lens: &Lens, place: Rigid) -> Result<FoundCamera, CaptureError> {
    let invalid = |problem: String| validator.invalid(format!("camera {}", lens.id), problem);
    let (projection, distortion) = models::lens(&lens.model, &lens.parameters).map_err(invalid)?;
    let [width, height] = lens.size.map(u32::try_from);
    let (Ok(width), Ok(height)) = (width, height) else {
        return Err(invalid("has an impossible size; copy the model again".into()));
    };
    Ok(FoundCamera { id, size: Some([width, height]), projection, distortion, extrinsics: Some(place) })
}

fn place(path: &Path, field: &str, numbers: [f64; 7]) -> Result<Rigid, CaptureError> {
    let [w, x, y, z, t @ ..] = numbers;
    let validator = FileValidator { path };
    let rotation = from_wxyz([w, x, y, z])
        .ok_or_else(|| validator.invalid(field, "has a quaternion of length 0; reconstruct it again"))?;
    Ok(Rigid { rotation: validator.rotation(field.into(), rotation)?, translation: t.into() })
}

/// Ids, lenses and places.
type PlacedLens = (String, u32, Rigid);

fn cameras_of_images(path: &Path, images: &[Image]) -> Result<Vec<PlacedLens>, CaptureError> {
    let shot = |image: &Image| -> Result<Shot<u32>, CaptureError> {
        Ok(Shot { path: image.name.clone(), lens: image.lens, place: place(path, &image.name, image.place)? })
    };
    let shots: Vec<Shot<u32>> = images.iter().map(shot).collect::<Result<_, _>>()?;
    Ok(shots::cameras(path, &shots)?.into_iter().map(|camera| (camera.id, camera.lens, camera.place)).collect())
}

fn cameras_of_rig(path: &Path, rig: &[Sensor], images: &[Image]) -> Result<Vec<PlacedLens>, CaptureError> {
    let mut paths: Vec<Vec<&str>> = vec![vec![]; rig.len()];
    for image in images {
        let sensor = rig.iter().position(|sensor| sensor.lens == image.lens);
        sensor.and_then(|sensor| paths.get_mut(sensor)).into_iter().for_each(|paths| paths.push(&image.name));
    }
    let mut cameras = vec![];
    for (number, (sensor, id)) in rig.iter().zip(shots::ids(&paths)).enumerate() {
        let field = format!("sensor {}", sensor.lens);
        let at = match (number, sensor.place) {
            (0, _) => Rigid::IDENTITY,
            (_, Some(numbers)) => place(path, &field, numbers)?,
            (_, None) => {
                let problem = "has no place in the rig; reconstruct with known or refined rigs";
                return Err(FileValidator { path }.invalid(field, problem));
            }
        };
        cameras.push((id, sensor.lens, at));
    }
    Ok(cameras)
}
