//! The cameras of the footage, as a calibration says.

use std::path::Path;

use ghand_capture::cameras::calibration_files::{FoundCalibration, FoundCamera, Projection, read_calibration};
use ghand_capture::cameras::list::LensCamera;
use ghand_core::Camera;
use ghand_footage::StatedFocal;
use ghand_motion::image_landmarks::UsualFocal;
use glam::DVec2;

use crate::ImportError;
use crate::rig::start::unknown_camera;
use crate::solve::Known;
use crate::sources::Source;

/// Sizes of images whose aspects differ by more, relatively, are not the same images scaled.
const ASPECT_TOLERANCE: f64 = 0.01;
/// Principal points are at most so far from the middle of images, relative to their size; beyond the second bound they are
/// of other images.
const USUAL_OFF_MIDDLE: f64 = 0.12;
const MOST_OFF_MIDDLE: f64 = 0.3;

/// The cameras before any landmark is seen.
pub(crate) struct GivenCameras {
    pub lenses: Vec<LensCamera>,
    pub known: Known,
    /// Standard deviations of the logarithms of focal lengths, where they are not known.
    pub focal_deviations: Vec<f64>,
}

/// The cameras of a calibration, for the footage by name, by the number in the name, or in order; or cameras of which
/// nothing is known.
pub(crate) fn given_cameras(
    sources: &[Source],
    file: Option<&Path>,
    remarks: &mut Vec<String>,
) -> Result<GivenCameras, ImportError> {
    let Some(file) = file else {
        let unknown = |source: &Source| unknown(source, source.footage.stated_focal().as_ref(), remarks);
        let (lenses, focal_deviations) = sources.iter().map(unknown).unzip();
        return Ok(GivenCameras { lenses, known: Known::Nothing, focal_deviations });
    };
    let given = read_calibration(file)?;
    remarks.extend(given.remarks.iter().map(|remark| format!("{}: {remark}", file.display())));
    let numbers = matched(sources, &given, remarks)?;
    let chosen: Vec<&FoundCamera> = numbers.iter().map(|number| &given.cameras[*number]).collect();
    let are_placed = chosen.iter().all(|camera| camera.extrinsics.is_some());
    let known = match (are_placed, given.unit.in_metres()) {
        (true, Some(_)) => Known::All,
        // One camera has no distance from others.
        (true, None) if sources.len() > 1 => Known::AllButTheUnit,
        (true, None) => Known::All,
        (false, _) => Known::Lenses,
    };
    let mut lenses = vec![];
    for (source, camera) in sources.iter().zip(chosen) {
        let (width, height) = source.footage.size();
        let scaled = scaled(camera, [width, height], &source.id, remarks);
        let camera = scaled.as_ref().unwrap_or(camera);
        let mut lens = match known {
            Known::All | Known::AllButTheUnit => {
                given.lens_camera(camera, [width, height], given.unit.in_metres().unwrap_or(1.0))?
            }
            Known::Lenses | Known::Nothing => given.lens_at_origin(camera, [width, height])?,
        };
        lens.camera.id.clone_from(&source.id);
        check_middle(file, &lens.camera, remarks)?;
        lenses.push(lens);
    }
    let focal_deviations = vec![UsualFocal::UNSTATED; lenses.len()];
    Ok(GivenCameras { lenses, known, focal_deviations })
}

/// A camera of which nothing is known but what its footage states, and the standard deviation of the logarithm of its focal
/// length.
fn unknown(source: &Source, stated: Option<&StatedFocal>, remarks: &mut Vec<String>) -> (LensCamera, f64) {
    let (width, height) = source.footage.size();
    let mut camera = unknown_camera(&source.id, width, height);
    let Some(StatedFocal { pixels, deviation, origin }) = stated else {
        return (LensCamera { camera, distortion: None }, UsualFocal::UNSTATED);
    };
    camera.focal = DVec2::splat(*pixels);
    remarks.push(format!(
        "{}: the focal length is taken from {origin}: {pixels:.0} pixels, good to {:.0} %",
        source.id,
        100.0 * deviation
    ));
    (LensCamera { camera, distortion: None }, *deviation)
}

/// Whether the principal point is near the middle of the images: it tells a calibration of other images that has no size.
fn check_middle(file: &Path, camera: &Camera, remarks: &mut Vec<String>) -> Result<(), ImportError> {
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let off = (camera.principal / size - 0.5).abs().max_element();
    if off < USUAL_OFF_MIDDLE {
        return Ok(());
    }
    let [x, y] = [camera.principal.x, camera.principal.y];
    let problem = format!(
        "{}: the principal point of {}, at ({x:.0}, {y:.0}), is far from the middle of its images of {} x {} pixels",
        file.display(),
        camera.id,
        camera.width,
        camera.height
    );
    if off > MOST_OFF_MIDDLE {
        return Err(ImportError::Unusable(format!(
            "{problem}: the calibration is of images of another size; give that of these, or images as calibrated"
        )));
    }
    remarks
        .push(format!("{problem}; was the calibration made with images of another size, or before they were cropped?"));
    Ok(())
}

/// For each footage the number of its camera.
fn matched(sources: &[Source], given: &FoundCalibration, remarks: &mut Vec<String>) -> Result<Vec<usize>, ImportError> {
    let all = |find: &dyn Fn(&Source) -> Option<usize>| -> Option<Vec<usize>> {
        let mut numbers: Vec<usize> = sources.iter().map(find).collect::<Option<_>>()?;
        let found = numbers.clone();
        numbers.sort_unstable();
        numbers.dedup();
        (numbers.len() == sources.len()).then_some(found)
    };
    let place = |is_it: &dyn Fn(&str) -> bool| {
        let mut found = given.cameras.iter().enumerate().filter(|(_, camera)| is_it(&camera.id)).map(|(k, _)| k);
        found.next().filter(|_| found.next().is_none())
    };
    if let Some(numbers) = all(&|source| place(&|id| id == source.id)) {
        return Ok(numbers);
    }
    let by_number = all(&|source| {
        let number = number_in(&source.id)?;
        place(&|id| number_in(id) == Some(number))
    });
    let numbers = match by_number {
        Some(numbers) => numbers,
        None if given.cameras.len() == sources.len() => (0..sources.len()).collect(),
        None => {
            return Err(ImportError::Unusable(format!(
                "{}: has the cameras {}, but the footage is {}; name the videos as the cameras, or give as many",
                given.path.display(),
                given.cameras.iter().map(|camera| camera.id.as_str()).collect::<Vec<_>>().join(", "),
                sources.iter().map(|source| source.id.as_str()).collect::<Vec<_>>().join(", ")
            )));
        }
    };
    let pairs = sources.iter().zip(&numbers).map(|(s, k)| format!("{} is {}", s.id, given.cameras[*k].id));
    remarks.push(format!("cameras of the calibration: {}", pairs.collect::<Vec<_>>().join(", ")));
    Ok(numbers)
}

/// The last number in a name.
fn number_in(name: &str) -> Option<u64> {
    let end = name.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = name[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |k| k + 1);
    name.get(start..end)?.parse().ok()
}

/// The camera for the same images at another size; `None` if it is for this one, or the aspect differs.
fn scaled(camera: &FoundCamera, size: [u32; 2], id: &str, remarks: &mut Vec<String>) -> Option<FoundCamera> {
    let calibrated = camera.size.filter(|calibrated| *calibrated != size)?;
    let Projection::Pixels { focal, principal } = camera.projection else { return None };
    let [across, down] = [0, 1].map(|k| f64::from(size[k]) / f64::from(calibrated[k]));
    if (across / down - 1.0).abs() > ASPECT_TOLERANCE {
        return None;
    }
    remarks.push(format!(
        "{id}: the calibration for {} x {} pixels is scaled to {} x {}",
        calibrated[0], calibrated[1], size[0], size[1]
    ));
    let scale = DVec2::new(across, down);
    let projection = Projection::Pixels { focal: focal * scale, principal: principal * scale };
    Some(FoundCamera { size: Some(size), projection, ..camera.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_number_of_a_name_counts() {
        for (name, number) in [("cam1", Some(1)), ("c0", Some(0)), ("take2-cam07", Some(7)), ("left", None)] {
            assert_eq!(number_in(name), number, "{name}");
        }
    }
}
