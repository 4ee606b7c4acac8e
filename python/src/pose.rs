//! Poses, and files of them.

use std::path::{Path, PathBuf};

use ghand_app::hand_model_file::HandModelReading;
use ghand_app::pose_choice::poses_by_name;
use ghand_capture::cameras::list::read_cameras;
use ghand_core::rotation::axis_angle_from_rotation;
use ghand_core::{HandModel, Pose as CorePose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_motion::pose_sequence::DEFAULT_FPS;
use ghand_motion::{PoseFrame, PoseOptions, PoseSequence, read_poses as read_file};
use glam::{DMat3, DQuat, DVec3};
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PySlice;

use crate::arrays::{Numbers, array, matrix_of_rows, vector_array, wrong_shape};
use crate::avatar::Avatar;
use crate::camera::checked_rotation;
use crate::error::{failed, wrong};
use crate::messages::warn;

/// A rotation for each joint, relative to its parent, and the translation of the hand.
#[pyclass(frozen, module = "ghand", from_py_object)]
#[derive(Clone)]
pub struct Pose(pub CorePose);

#[pymethods]
impl Pose {
    /// From axis-angle rotations `(J, 3)` in radians, quaternions `(J, 4)` w first, or matrices `(J, 3, 3)`.
    #[new]
    #[pyo3(signature = (rotations, translation=None))]
    fn new(rotations: &Bound<'_, PyAny>, translation: Option<&Bound<'_, PyAny>>) -> PyResult<Pose> {
        let rotations = rotations_of(rotations)?;
        let translation = translation.map_or(Ok([0.0; 3]), |value| Numbers::exactly("translation", value))?;
        Ok(Pose(CorePose { rotations, translation: translation.into() }))
    }

    /// Axis-angle rotations, radians, `(J, 3)`.
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vector_array(py, &self.0.rotations)
    }

    /// Metres, `(3,)`.
    #[getter]
    fn translation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.translation.to_array())
    }

    fn __eq__(&self, other: &Pose) -> bool {
        self.0 == other.0
    }

    /// For pickles: what makes the same pose.
    #[expect(clippy::type_complexity, reason = "two arrays")]
    fn __getnewargs__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>)> {
        Ok((self.rotations(py)?, self.translation(py)))
    }

    fn __repr__(&self) -> String {
        format!("<ghand.Pose of {} joints>", self.0.rotations.len())
    }
}

/// Axis-angle rotations from any of the kinds that [`Pose::new`] takes.
///
/// # Errors
/// `ValueError` for other shapes, and for what is no rotation.
pub fn rotations_of(value: &Bound<'_, PyAny>) -> PyResult<Vec<DVec3>> {
    let numbers = Numbers::of("rotations", value)?;
    let rotation = |(joint, values): (usize, &[f64])| {
        let name = format!("rotations[{joint}]");
        let matrix = match *values {
            [x, y, z] => return Ok(DVec3::new(x, y, z)),
            [w, x, y, z] => {
                let quaternion = DQuat::from_xyzw(x, y, z, w);
                if !(quaternion.length_squared() - 1.0).abs().le(&0.01) {
                    return Err(wrong(format!("{name}: the quaternion (w, x, y, z) must have the length 1")));
                }
                DMat3::from_quat(quaternion.normalize())
            }
            _ => {
                let values = values.try_into().map_err(|_| wrong(format!("{name}: must be a rotation")))?;
                checked_rotation(&name, &matrix_of_rows(values))?
            }
        };
        Ok(axis_angle_from_rotation(&matrix))
    };
    match *numbers.shape.as_slice() {
        [_, size @ (3 | 4)] => numbers.values.chunks_exact(size).enumerate().map(rotation).collect(),
        [_, 3, 3] => numbers.values.chunks_exact(9).enumerate().map(rotation).collect(),
        ref shape => {
            Err(wrong_shape("rotations", shape, "(J, 3) axis-angle, (J, 4) quaternions or (J, 3, 3) matrices"))
        }
    }
}

/// Poses at a constant rate: a sequence of [`Pose`].
#[pyclass(frozen, sequence, module = "ghand")]
pub struct Poses(pub PoseSequence);

#[pymethods]
impl Poses {
    /// Frames per second.
    #[getter]
    fn fps(&self) -> f64 {
        self.0.fps
    }

    /// Seconds from the first to the last.
    #[getter]
    fn duration(&self) -> f64 {
        self.0.duration()
    }

    /// The names of the joints, `J`.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.0.joint_names.clone()
    }

    /// The names of the frames, `T`.
    #[getter]
    fn ids(&self) -> Vec<String> {
        self.0.frames.iter().map(|frame| frame.id.clone()).collect()
    }

    /// Axis-angle rotations, radians, `(T, J, 3)`.
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let values = self.0.frames.iter().flat_map(|frame| frame.pose.rotations.iter().flat_map(DVec3::to_array));
        array(py, [self.0.frames.len(), self.0.joint_names.len(), 3], values.collect())
    }

    /// Metres, `(T, 3)`.
    #[getter]
    fn translations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vector_array(py, &self.0.frames.iter().map(|frame| frame.pose.translation).collect::<Vec<_>>())
    }

    /// The pose at a time, interpolated.
    fn at(&self, seconds: f64) -> PyResult<Pose> {
        let pose = if seconds.is_finite() { self.0.pose_at(seconds) } else { None };
        pose.map(Pose).ok_or_else(|| wrong(format!("seconds: is {seconds}, must be a finite number")))
    }

    fn __len__(&self) -> usize {
        self.0.frames.len()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let count = self.0.frames.len();
        let pose = |frame: &PoseFrame| Pose(frame.pose.clone());
        if let Ok(slice) = index.cast::<PySlice>() {
            let range = slice.indices(count.try_into()?)?;
            let numbers = (0..range.slicelength).map(|k| range.start + range.step * isize::try_from(k).unwrap_or(0));
            let frames = numbers.filter_map(|number| self.0.frames.get(usize::try_from(number).ok()?));
            return frames.map(pose).collect::<Vec<_>>().into_pyobject(py);
        }
        let number: isize = index.extract()?;
        let number = if number < 0 { number + isize::try_from(count)? } else { number };
        let frame = usize::try_from(number).ok().and_then(|number| self.0.frames.get(number));
        let frame = frame.ok_or_else(|| PyIndexError::new_err(format!("there are {count} poses")))?;
        Ok(Bound::new(py, pose(frame))?.into_any())
    }

    fn __repr__(&self) -> String {
        format!("<ghand.Poses: {} frames at {} per second>", self.0.frames.len(), self.0.fps)
    }
}

/// Reads poses: a pose or motion by name, or a file of any kind that ghand reads, for an avatar's skeleton (default: the
/// built-in right hand).
#[pyfunction]
#[pyo3(signature = (source, avatar=None, *, side=None, pose_model=None, flat_mean=false, mirrored=None, take=None,
    in_place=false, cameras=None, file_fps=None, smooth=false, fps=None, same_tracker=false))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn read_poses(
    py: Python<'_>,
    source: PathBuf,
    avatar: Option<&Avatar>,
    side: Option<&str>,
    pose_model: Option<PathBuf>,
    flat_mean: bool,
    mirrored: Option<bool>,
    take: Option<String>,
    in_place: bool,
    cameras: Option<PathBuf>,
    file_fps: Option<f64>,
    smooth: bool,
    fps: Option<f64>,
    same_tracker: bool,
) -> PyResult<Poses> {
    let side = side.map(|side| match side {
        "left" => Ok(Side::Left),
        "right" => Ok(Side::Right),
        _ => Err(wrong(format!("side: is {side:?}, must be \"left\" or \"right\""))),
    });
    let side = side.transpose()?;
    for (name, rate) in [("file_fps", file_fps), ("fps", fps)] {
        if let Some(rate) = rate.filter(|rate| !(0.1..=1000.0).contains(rate)) {
            return Err(wrong(format!("{name}: is {rate}, must be from 0.1 to 1000 frames per second")));
        }
    }
    let model = avatar.map(Avatar::model).transpose()?;
    let tracker = match (same_tracker, avatar) {
        (true, Some(avatar)) => Some(avatar.tracker()?),
        (true, None) => return Err(wrong("same_tracker: an avatar knows its tracker; give it")),
        (false, _) => None,
    };
    let sequence = py.detach(|| -> anyhow::Result<PoseSequence> {
        let built_in;
        let model = match &model {
            Some(model) => model.as_ref(),
            None => {
                built_in = builtin_hand(Side::Right)?;
                &built_in
            }
        };
        let pose_model = pose_model.as_ref().map(|path| HandModelReading::default().load(Some(path))).transpose()?;
        let cameras = cameras.as_ref().map(|path| read_cameras(path)).transpose()?.unwrap_or_default();
        let pose_model = pose_model.map(|file| file.model);
        let by_id = false;
        let options =
            PoseOptions { side, pose_model, flat_mean, mirrored, take, file_fps, smooth, by_id, in_place, cameras };
        let found = poses_of(&source, model, &options)?;
        let mut found = match fps {
            Some(fps) => found.resampled(fps)?,
            None => found,
        };
        if let Some(tracker) = &tracker {
            found.frames.iter_mut().for_each(|frame| frame.pose = tracker.offsets.apply(&frame.pose, &model.parents));
        }
        Ok(found)
    });
    let mut sequence = sequence.map_err(failed)?;
    warn(py, &std::mem::take(&mut sequence.warnings))?;
    Ok(Poses(sequence))
}

/// Poses by name or of a file.
///
/// # Errors
/// One sentence with file and field, or with the names that there are.
pub fn poses_of(source: &Path, model: &HandModel, options: &PoseOptions) -> anyhow::Result<PoseSequence> {
    match source.to_str().map_or(Ok(None), |text| poses_by_name(text, model, DEFAULT_FPS))? {
        Some(found) => Ok(found),
        None => Ok(read_file(source, model, options)?),
    }
}
