//! Cameras from a reconstruction of images: which images are of one camera, and that it does not move.

use std::collections::HashMap;
use std::hash::Hash;
use std::path::Path;

use glam::{DMat3, DQuat, DVec3};

use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;
use crate::reading::validation::FileValidator;

/// Images of a camera that stands still are reconstructed within this of each other, radians, and within this part of
/// the distance between the farthest cameras.
const LARGEST_TURN: f64 = 1.0_f64.to_radians();
const LARGEST_PART: f64 = 0.03;

/// More cameras are frames of one that moves.
const MOST_CAMERAS: usize = 1000;

/// A reconstructed image.
pub(super) struct Shot<L> {
    /// Its path, from some folder.
    pub path: String,
    /// What its lens is known by.
    pub lens: L,
    pub place: Rigid,
}

/// A camera that took some images.
pub(super) struct ShotCamera<L> {
    pub id: String,
    pub lens: L,
    pub place: Rigid,
}

/// The folders of an image's path and its name without ending.
fn parts(path: &str) -> (Vec<&str>, &str) {
    let mut folders: Vec<&str> = path.split(['/', '\\']).filter(|part| !part.is_empty()).collect();
    let name = folders.pop().unwrap_or_default();
    (folders, name.rsplit_once('.').map_or(name, |(stem, _)| stem))
}

/// The name that sets the images of a camera apart: the folder, if its images are in one and others' in others.
pub(super) fn ids(cameras: &[Vec<&str>]) -> Vec<String> {
    let folder = |paths: &[&str]| -> Option<String> {
        let first = parts(paths.first()?).0;
        let is_one = paths.iter().all(|path| parts(path).0 == first);
        if is_one { first.last().map(|last| (*last).to_owned()) } else { None }
    };
    let stem = |paths: &[&str]| match paths {
        [only] => Some(parts(only).1.to_owned()),
        _ => None,
    };
    let candidates: [Vec<Option<String>>; 2] =
        [cameras.iter().map(|paths| folder(paths)).collect(), cameras.iter().map(|paths| stem(paths)).collect()];
    let is_good = |ids: &Vec<Option<String>>| {
        let mut sorted: Vec<&Option<String>> = ids.iter().collect();
        sorted.sort();
        sorted.dedup();
        sorted.len() == ids.len() && ids.iter().all(Option::is_some)
    };
    let chosen = candidates.into_iter().find(is_good);
    match chosen {
        Some(ids) => ids.into_iter().flatten().collect(),
        None => (1..=cameras.len()).map(|number| format!("camera{number}")).collect(),
    }
}

/// The cameras that took some images: those of a folder, or, if all are in one folder, of a lens. `path` is the
/// reconstruction's.
pub(super) fn cameras<L: Copy + Eq + Hash>(path: &Path, shots: &[Shot<L>]) -> Result<Vec<ShotCamera<L>>, CaptureError> {
    let folder = |shot: &Shot<L>| parts(&shot.path).0.join("/");
    let has_folders = shots.first().is_some_and(|first| shots.iter().any(|shot| folder(shot) != folder(first)));
    let mut groups: Vec<(String, Vec<&Shot<L>>)> = vec![];
    let mut known: HashMap<(String, Option<L>), usize> = HashMap::new();
    for shot in shots {
        let key = if has_folders { (folder(shot), None) } else { (String::new(), Some(shot.lens)) };
        let group = *known.entry(key).or_insert_with_key(|(folder, _)| {
            groups.push((folder.clone(), vec![]));
            groups.len() - 1
        });
        groups.get_mut(group).into_iter().for_each(|(_, group)| group.push(shot));
    }
    if groups.len() > MOST_CAMERAS {
        let problem =
            format!("are of {} cameras, more than {MOST_CAMERAS}; put each camera's in a folder", groups.len());
        return Err(FileValidator { path }.invalid("images", problem));
    }
    let paths: Vec<Vec<&str>> =
        groups.iter().map(|(_, group)| group.iter().map(|s| s.path.as_str()).collect()).collect();
    let mut cameras = vec![];
    for (id, (folder, group)) in ids(&paths).into_iter().zip(&groups) {
        let Some(first) = group.first() else { continue };
        if group.iter().any(|shot| shot.lens != first.lens) {
            let problem = format!(
                "has images in {folder:?} with several lenses; reconstruct with one camera per folder (COLMAP: \
                 --ImageReader.single_camera_per_folder 1)"
            );
            return Err(FileValidator { path }.invalid("images", problem));
        }
        cameras.push(ShotCamera { id, lens: first.lens, place: mean(group) });
    }
    let centers: Vec<DVec3> = cameras.iter().map(|camera| center(&camera.place)).collect();
    let pairs = centers.iter().flat_map(|one| centers.iter().map(|other| one.distance(*other)));
    let size = pairs.fold(0.0, f64::max);
    for (camera, (_, group)) in cameras.iter().zip(&groups) {
        let moved = |shot: &&&Shot<L>| {
            let turn = shot.place.angle(&camera.place);
            let distance = center(&shot.place).distance(center(&camera.place));
            !(turn <= LARGEST_TURN && distance <= LARGEST_PART * size)
        };
        if let Some(shot) = group.iter().find(moved).filter(|_| group.len() > 1) {
            let problem = format!(
                "show that camera {:?} moves: {} is from elsewhere than its other images; cameras must stand still, \
                 and images of several must be in a folder each",
                camera.id, shot.path
            );
            return Err(FileValidator { path }.invalid("images", problem));
        }
    }
    Ok(cameras)
}

fn center(place: &Rigid) -> DVec3 {
    place.inverse().translation
}

/// The mean place of images.
fn mean<L>(group: &[&Shot<L>]) -> Rigid {
    let quaternions = group.iter().map(|shot| DQuat::from_mat3(&shot.place.rotation));
    // A quaternion and its negative are the same rotation.
    let sum = quaternions
        .fold(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, q| if sum.dot(q) < 0.0 { sum + -q } else { sum + q });
    let count = group.len() as f64;
    let center = group.iter().map(|shot| center(&shot.place)).sum::<DVec3>() / count;
    match group {
        // Without rounding.
        [only] => only.place,
        _ => {
            let rotation = DMat3::from_quat(sum.normalize());
            Rigid { rotation, translation: -(rotation * center) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shot(path: &str, lens: u32, turn: f64, x: f64) -> Shot<u32> {
        let rotation = DMat3::from_rotation_y(turn);
        Shot { path: path.into(), lens, place: Rigid { rotation, translation: -(rotation * DVec3::X * x) } }
    }

    fn found(shots: &[Shot<u32>]) -> Result<Vec<(String, u32, f64)>, String> {
        let cameras = cameras(Path::new("model"), shots).map_err(|error| error.to_string())?;
        Ok(cameras.into_iter().map(|camera| (camera.id, camera.lens, center(&camera.place).x)).collect())
    }

    #[test]
    fn images_of_a_folder_are_of_one_camera_that_stands_still() {
        let shots = |last: f64, turn: f64| {
            [shot("rig/a/1.png", 1, 0.0, 0.0), shot("rig/a/2.png", 1, turn, last), shot("rig/b/1.png", 2, 1.0, 1.0)]
        };
        let still = found(&shots(0.02, 0.01)).unwrap();
        assert_eq!(still.iter().map(|(id, lens, _)| (id.as_str(), *lens)).collect::<Vec<_>>(), [("a", 1), ("b", 2)]);
        assert!((still[0].2 - 0.01).abs() < 1e-12);
        for moved in [shots(0.2, 0.0), shots(0.0, 0.1)] {
            let error = found(&moved).unwrap_err();
            assert!(error.contains("\"a\" moves") && error.contains("rig/a/"), "{error}");
        }
        let mut lenses = shots(0.0, 0.0);
        lenses[1].lens = 3;
        assert!(found(&lenses).unwrap_err().contains("several lenses"));
    }

    #[test]
    fn without_folders_each_lens_is_a_camera() {
        let names = |paths: [&str; 3], lenses: [u32; 3]| {
            let shots = [0, 1, 2].map(|k| shot(paths[k], lenses[k], 0.0, f64::from(lenses[k])));
            found(&shots).unwrap().into_iter().map(|(id, ..)| id).collect::<Vec<_>>()
        };
        assert_eq!(names(["left.png", "mid.png", "right.png"], [1, 2, 3]), ["left", "mid", "right"]);
        assert_eq!(names(["x/left.png", "x/mid.png", "x/right.png"], [1, 2, 3]), ["left", "mid", "right"]);
        assert_eq!(names(["a/x.png", "b/x.png", "c/x.png"], [1, 2, 3]), ["a", "b", "c"]);
        assert_eq!(names(["c:\\a\\x.png", "c:\\b\\x.png", "c:\\c\\x.png"], [1, 1, 1]), ["a", "b", "c"]);
        assert_eq!(names(["1.png", "2.png", "3.png"], [1, 1, 2]), ["camera1", "camera2"]);
    }
}
