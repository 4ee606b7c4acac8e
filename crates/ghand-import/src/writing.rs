//! Writes the capture: images of the chosen frames, cameras, poses and splits.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Cursor};
use std::path::Path;

use ghand_capture::cameras::list::LensCamera;
use ghand_capture::capture::{Frame, HandModelSource, ImagePaths};
use ghand_capture::images::color_correction::ColorCorrection;
use ghand_capture::{Capture, Split};
use ghand_core::{HandModel, Pose};
use ghand_files::atomic_file::write_atomically;
use glam::DVec2;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::ImportError;
use crate::apart::other_hands;
use crate::progress::{OnProgress, Progress, Step};
use crate::sources::Source;
use crate::track::{Sighting, Track};

/// Quality of the images, of 100: their errors are far below those of a video.
const QUALITY: u8 = 97;
/// The description of the capture.
const CAPTURE_FILE: &str = "capture.json";
/// Where the images are, and where other hands are in them.
const IMAGES: &str = "images/{camera}/{frame}.jpg";
const OTHER_HANDS: &str = "other-hands/{camera}/{frame}.png";
/// Another hand whose landmarks are nearer than this, relative to the hand's extent in the image, is cut out of its mask.
const NEAR: f64 = 0.4;

/// A chosen frame.
pub struct ChosenFrame {
    /// Its name.
    pub id: String,
    /// The number of the image of each camera, if it shows the hand; others are not written.
    pub images: Vec<Option<usize>>,
    /// The pose at its time.
    pub pose: Pose,
    /// Whether it is held out.
    pub is_held_out: bool,
}

/// Writes the images of frames, and where other hands are in those that show one near the hand; removes those of an earlier
/// choice. Returns for each camera in how many images another hand is near.
///
/// # Errors
/// If a file cannot be written, footage cannot be decoded, or the caller stops it.
pub fn write_images(
    out: &Path,
    sources: &[Source],
    tracks: &[Track],
    frames: &[ChosenFrame],
    on_progress: &mut OnProgress,
) -> Result<Vec<usize>, ImportError> {
    // A folder with a capture.json is complete: an earlier one goes first.
    remove(|path| fs::remove_file(path), &out.join(CAPTURE_FILE))?;
    let total = frames.iter().flat_map(|frame| frame.images.iter().flatten()).count();
    let mut done = 0;
    let mut near = vec![0; sources.len()];
    remove(|path| fs::remove_dir_all(path), &out.join("other-hands"))?;
    for (camera, source) in sources.iter().enumerate() {
        let folder = out.join("images").join(&source.id);
        // Images of an earlier choice would only confuse.
        remove(|path| fs::remove_dir_all(path), &folder)?;
        fs::create_dir_all(&folder).map_err(ImportError::write(&folder))?;
        let mut numbers: Vec<usize> = frames.iter().filter_map(|frame| frame.images[camera]).collect();
        numbers.sort_unstable();
        let mut images = source.footage.frames_at(&numbers)?;
        let (width, height) = source.footage.size();
        let mut rgb = vec![];
        while let Some(number) = images.next_into(&mut rgb)? {
            for frame in frames.iter().filter(|frame| frame.images[camera] == Some(number)) {
                let path = folder.join(format!("{}.jpg", frame.id));
                let mut bytes = Cursor::new(vec![]);
                let encoder = JpegEncoder::new_with_quality(&mut bytes, QUALITY);
                encoder
                    .write_image(&rgb, width, height, ExtendedColorType::Rgb8)
                    .map_err(|error| ImportError::write(&path)(io::Error::other(error)))?;
                write_atomically(&path, bytes.get_ref()).map_err(ImportError::write(&path))?;
                let sighting = tracks[camera].sightings.get(number).and_then(Option::as_ref);
                if let Some(sighting) = sighting.filter(|sighting| is_another_near(sighting)) {
                    write_other_hands(out, &source.id, &frame.id, sighting, [width, height])?;
                    near[camera] += 1;
                }
                done += 1;
            }
            if !on_progress(&Progress { step: Step::Images, subject: source.id.clone(), done, total }) {
                return Err(ImportError::Stopped);
            }
        }
    }
    Ok(near)
}

/// Whether another hand is so near that a mask might reach it.
fn is_another_near(sighting: &Sighting) -> bool {
    let edge = |of: fn(DVec2, DVec2) -> DVec2| sighting.pixels.iter().copied().reduce(of).unwrap_or_default();
    let extent = (edge(DVec2::max) - edge(DVec2::min)).max_element();
    sighting.gap().is_some_and(|gap| gap < NEAR * extent)
}

/// Writes which pixels of an image are another hand's.
fn write_other_hands(
    out: &Path,
    camera: &str,
    frame: &str,
    sighting: &Sighting,
    [width, height]: [u32; 2],
) -> Result<(), ImportError> {
    let path = out.join(OTHER_HANDS.replace("{camera}", camera).replace("{frame}", frame));
    let folder = path.parent().unwrap_or(out);
    fs::create_dir_all(folder).map_err(ImportError::write(folder))?;
    let found = other_hands(sighting, [width, height].map(|edge| edge as usize));
    let values: Vec<u8> = found.into_iter().map(|is_other| if is_other { 255 } else { 0 }).collect();
    let mut bytes = Cursor::new(vec![]);
    PngEncoder::new(&mut bytes)
        .write_image(&values, width, height, ExtendedColorType::L8)
        .map_err(|error| ImportError::write(&path)(io::Error::other(error)))?;
    write_atomically(&path, bytes.get_ref()).map_err(ImportError::write(&path))
}

/// Writes `capture.json` for images that are there: a folder that has one is complete.
///
/// # Errors
/// If it cannot be written.
pub fn write_capture(
    out: &Path,
    lenses: &[LensCamera],
    model: &HandModel,
    shape: &[f64],
    frames: &[ChosenFrame],
) -> Result<Capture, ImportError> {
    let every: Vec<usize> = (0..lenses.len()).collect();
    let split = |held_out: bool| {
        let frames = frames.iter().enumerate().filter(|(_, frame)| frame.is_held_out == held_out);
        Split::product(every.clone(), frames.map(|(k, _)| k).collect())
    };
    let mut splits = BTreeMap::from([("train".to_owned(), split(false))]);
    if frames.iter().any(|frame| frame.is_held_out) {
        splits.insert("test".to_owned(), split(true));
    }
    let other_hands = out.join("other-hands").is_dir().then(|| OTHER_HANDS.to_owned());
    let mut capture = Capture {
        root: out.into(),
        side: model.side,
        background: [0.0; 3],
        hand_model: model.clone(),
        hand_model_source: HandModelSource::Builtin,
        template: model.clone(),
        cameras: lenses.iter().map(|lens| lens.camera.clone()).collect(),
        distortion: lenses.iter().map(|lens| lens.distortion).collect(),
        color_correction: ColorCorrection::default(),
        frames: frames
            .iter()
            .map(|f| Frame { id: f.id.clone(), pose: f.pose.clone(), shape: shape.to_vec() })
            .collect(),
        images: ImagePaths { other_hands, ..ImagePaths::plain(IMAGES, None) },
        splits,
        truth: None,
    };
    capture.take_shape(shape)?;
    capture.save()?;
    Ok(capture)
}

/// Removes what may be there.
fn remove(by: impl Fn(&Path) -> io::Result<()>, path: &Path) -> Result<(), ImportError> {
    match by(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(ImportError::write(path)(error)),
        _ => Ok(()),
    }
}
