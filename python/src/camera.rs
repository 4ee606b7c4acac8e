//! Cameras.

use std::path::PathBuf;

use ghand_core::Camera as CoreCamera;
use glam::{DMat3, DQuat, DVec2, DVec3};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Numbers, array, matrix_array};
use crate::error::{failed, wrong};

/// Largest edge of a picture, pixels.
const LARGEST_EDGE: u32 = 16_384;

/// A pinhole camera of OpenCV: x right, y down, z forward; pixel centres at half-integers.
#[pyclass(frozen, module = "ghand", from_py_object)]
#[derive(Clone)]
pub struct Camera(pub CoreCamera);

#[pymethods]
impl Camera {
    /// A camera from its calibration; `rotation` and `translation` (metres) take world to camera.
    #[new]
    #[pyo3(signature = (width, height, intrinsics, rotation=None, translation=None))]
    fn new(
        width: u32,
        height: u32,
        intrinsics: &Bound<'_, PyAny>,
        rotation: Option<&Bound<'_, PyAny>>,
        translation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Camera> {
        let size = checked_size((width, height))?;
        let k = Numbers::matrix("intrinsics", intrinsics)?;
        let [fx, fy] = [k.x_axis.x, k.y_axis.y];
        if !(fx > 0.0 && fy > 0.0) {
            return Err(wrong(format!("intrinsics: the focal lengths are {fx} and {fy}, must be positive pixels")));
        }
        let others = [k.x_axis.y, k.x_axis.z, k.y_axis.x, k.y_axis.z, k.z_axis.z - 1.0];
        if others.iter().any(|value| value.abs() > 1e-9) {
            return Err(wrong("intrinsics: must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], without skew"));
        }
        let rotation = rotation.map_or(Ok(DMat3::IDENTITY), |value| Numbers::matrix("rotation", value))?;
        let rotation = checked_rotation("rotation", &rotation)?;
        let translation = translation.map_or(Ok([0.0; 3]), |value| Numbers::exactly("translation", value))?;
        Ok(Camera(CoreCamera {
            id: String::new(),
            width: size[0],
            height: size[1],
            focal: DVec2::new(fx, fy),
            principal: k.z_axis.truncate(),
            rotation,
            translation: translation.into(),
        }))
    }

    /// A camera at `eye` that looks at `target`; `fov` is that of the height, radians.
    #[staticmethod]
    #[pyo3(signature = (eye, target, width=512, height=512, up=None, fov=0.6))]
    fn look_at(
        eye: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        width: u32,
        height: u32,
        up: Option<&Bound<'_, PyAny>>,
        fov: f64,
    ) -> PyResult<Camera> {
        let [width, height] = checked_size((width, height))?;
        let [eye, target] = [Numbers::exactly("eye", eye)?, Numbers::exactly("target", target)?].map(DVec3::from_array);
        let up = DVec3::from_array(up.map_or(Ok([0.0, -1.0, 0.0]), |value| Numbers::exactly("up", value))?);
        if !(1e-3..3.0).contains(&fov) {
            return Err(wrong(format!("fov: is {fov}, must be from 0.001 to 3 radians")));
        }
        match (target - eye).try_normalize().zip(up.try_normalize()) {
            Some((forward, up)) if forward.cross(up).length() > 1e-6 => {
                Ok(Camera(CoreCamera::look_at(eye, target, up, fov, width, height)))
            }
            _ => Err(wrong("eye, target, up: the camera must look somewhere, and not along `up`")),
        }
    }

    /// Its name in the file that it was read from.
    #[getter]
    fn id(&self) -> &str {
        &self.0.id
    }

    /// Columns, pixels.
    #[getter]
    fn width(&self) -> u32 {
        self.0.width
    }

    /// Rows, pixels.
    #[getter]
    fn height(&self) -> u32 {
        self.0.height
    }

    /// `K`, `(3, 3)`.
    #[getter]
    fn intrinsics<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let CoreCamera { focal, principal, .. } = &self.0;
        let x = DVec3::new(focal.x, 0.0, 0.0);
        matrix_array(py, &DMat3::from_cols(x, DVec3::new(0.0, focal.y, 0.0), principal.extend(1.0)))
    }

    /// World to camera, `(4, 4)`: gsplat's `viewmats`.
    #[getter]
    fn world_to_camera<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let [x, y, z] = [0, 1, 2].map(|row| self.0.rotation.row(row).extend(self.0.translation[row]).to_array());
        array(py, [4, 4], [x, y, z, [0.0, 0.0, 0.0, 1.0]].concat())
    }

    /// Its place in the world, metres, `(3,)`.
    #[getter]
    fn center<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.center().to_array())
    }

    /// Pixels `(N, 2)` and depths `(N,)` in metres of points `(N, 3)`.
    #[expect(clippy::type_complexity, reason = "two arrays")]
    fn project<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>)> {
        let (pixels, depths): (Vec<DVec2>, Vec<f64>) =
            Numbers::points("points", points)?.into_iter().map(|point| self.0.project(point)).unzip();
        let flat = pixels.iter().flat_map(DVec2::to_array).collect();
        Ok((array(py, [depths.len(), 2], flat)?, PyArray1::from_vec(py, depths)))
    }

    /// The same view in another size.
    fn resized(&self, width: u32, height: u32) -> PyResult<Camera> {
        let [width, height] = checked_size((width, height))?;
        Ok(Camera(self.0.resized(width, height)))
    }

    fn __eq__(&self, other: &Camera) -> bool {
        CoreCamera { id: String::new(), ..self.0.clone() } == CoreCamera { id: String::new(), ..other.0.clone() }
    }

    /// For pickles: what makes the same camera.
    #[expect(clippy::type_complexity, reason = "three arrays")]
    fn __getnewargs__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(u32, u32, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>)> {
        let CoreCamera { width, height, rotation, translation, .. } = &self.0;
        let translation = PyArray1::from_slice(py, &translation.to_array());
        Ok((*width, *height, self.intrinsics(py), matrix_array(py, rotation), translation))
    }

    fn __repr__(&self) -> String {
        let CoreCamera { id, width, height, focal, .. } = &self.0;
        format!("<ghand.Camera {id:?} {width}x{height}, focal length {:.1} px>", focal.y)
    }
}

/// The cameras of a capture or of a calibration, by their ids.
#[pyfunction]
pub fn read_cameras(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let cameras = py.detach(|| ghand_capture::cameras::list::read_cameras(&path)).map_err(failed)?;
    let found = PyDict::new(py);
    for camera in cameras {
        found.set_item(camera.camera.id.clone(), Camera(camera.camera))?;
    }
    Ok(found)
}

/// A size of pictures.
///
/// # Errors
/// `ValueError` if none has that size.
pub fn checked_size((width, height): (u32, u32)) -> PyResult<[u32; 2]> {
    if [width, height].iter().all(|edge| (1..=LARGEST_EDGE).contains(edge)) {
        return Ok([width, height]);
    }
    Err(wrong(format!("size: {width}x{height}, each must be from 1 to {LARGEST_EDGE} pixels")))
}

/// Largest entry by which `R R^T` of a rotation that was rounded differs from the identity.
const ROUNDED: f64 = 1e-3;
/// The same of one that was not.
const EXACT: f64 = 1e-12;

/// A rotation, orthonormal to the last bit.
///
/// # Errors
/// `ValueError` if the matrix is none.
pub fn checked_rotation(name: &str, matrix: &DMat3) -> PyResult<DMat3> {
    let difference = *matrix * matrix.transpose() - DMat3::IDENTITY;
    let is_rotation = difference.to_cols_array().iter().all(|entry| entry.abs() <= ROUNDED);
    if !is_rotation || matrix.determinant() < 0.0 {
        return Err(wrong(format!("{name}: is no rotation: its rows must be orthonormal, and its determinant 1")));
    }
    let is_exact = difference.to_cols_array().iter().all(|entry| entry.abs() < EXACT);
    Ok(if is_exact { *matrix } else { DMat3::from_quat(DQuat::from_mat3(matrix).normalize()) })
}
