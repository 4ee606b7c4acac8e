//! Avatars.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ghand_app::lighting::{LightSource, Lighting};
use ghand_app::same_tracker::tracker_of;
use ghand_avatar::Avatar as LoadedAvatar;
use ghand_core::pose_offsets::TrackerOffsets;
use ghand_core::{Camera as CoreCamera, HandModel, Pose as CorePose, Side};
use ghand_render::Gpu;
use numpy::{PyArray2, PyArray4, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::arrays::{Numbers, array};
use crate::camera::Camera;
use crate::device::with_device;
use crate::drawing::Drawing;
use crate::error::{failed, wrong};
use crate::pose::Pose;
use crate::pose_argument::pose_of;
use crate::posed::PosedAvatar;

/// An avatar, and what of it is on the device.
pub struct Loaded {
    /// The avatar.
    pub avatar: LoadedAvatar,
    path: PathBuf,
    /// Locked without the interpreter's lock only: whoever draws may need that to tell of something.
    drawing: Mutex<Drawing>,
    closed: AtomicBool,
}

impl Loaded {
    /// Runs `work`, named `what`, with the avatar on the device; others wait meanwhile.
    ///
    /// # Errors
    /// [`Error`](crate::error::Error) if it is closed, or the device fails.
    pub fn draw<T: Send>(
        &self,
        py: Python<'_>,
        what: &str,
        mut work: impl FnMut(&mut Drawing, &Gpu, &LoadedAvatar) -> anyhow::Result<T> + Send,
    ) -> PyResult<T> {
        self.check_open()?;
        let drawn = py.detach(|| with_device(what, |gpu| work(&mut self.drawing(), gpu, &self.avatar)));
        drawn.map_err(failed)
    }

    /// Fails if it is closed.
    ///
    /// # Errors
    /// [`Error`](crate::error::Error) then.
    pub fn check_open(&self) -> PyResult<()> {
        if self.closed.load(Ordering::Relaxed) {
            return Err(failed(anyhow::anyhow!("{}: is closed", self.path.display())));
        }
        Ok(())
    }

    fn drawing(&self) -> MutexGuard<'_, Drawing> {
        // What a scene keeps is made anew where it does not fit.
        self.drawing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An avatar: a hand that takes any pose.
#[pyclass(frozen, module = "ghand")]
pub struct Avatar(Arc<Loaded>);

impl Avatar {
    /// Its hand model.
    ///
    /// # Errors
    /// [`Error`](crate::error::Error) if it is closed.
    pub fn model(&self) -> PyResult<Arc<HandModel>> {
        self.0.check_open()?;
        Ok(Arc::new(self.0.avatar.model.clone()))
    }

    /// How the tracker of its capture is off.
    ///
    /// # Errors
    /// [`Error`](crate::error::Error) if it does not know.
    pub fn tracker(&self) -> PyResult<TrackerOffsets> {
        tracker_of(&self.0.avatar, &self.0.path).cloned().map_err(failed)
    }

    fn own_model(&self) -> &HandModel {
        &self.0.avatar.model
    }
}

/// Loads an avatar, a `.ghand` file or a `.glb` with `GHAND_gaussian_avatar`. `light` is "capture", "studio" or a panorama
/// (.exr, .hdr), turned about the vertical by `light_turn` degrees.
#[pyfunction]
#[pyo3(signature = (path, *, light=None, light_turn=0.0))]
pub fn load(py: Python<'_>, path: PathBuf, light: Option<PathBuf>, light_turn: f64) -> PyResult<Avatar> {
    if !light_turn.is_finite() {
        return Err(wrong(format!("light_turn: is {light_turn}, must be finite")));
    }
    let source = light.map(LightSource::of).unwrap_or_default();
    let loaded = py.detach(|| -> anyhow::Result<Loaded> {
        let mut avatar = LoadedAvatar::load(&path)?;
        Lighting { source, turn: light_turn }.apply_to(&mut avatar)?;
        Ok(Loaded { avatar, path, drawing: Mutex::default(), closed: AtomicBool::new(false) })
    });
    Ok(Avatar(Arc::new(loaded.map_err(failed)?)))
}

#[pymethods]
impl Avatar {
    /// "left" or "right".
    #[getter]
    fn side(&self) -> &'static str {
        match self.own_model().side {
            Side::Left => "left",
            Side::Right => "right",
        }
    }

    /// The names of its joints, `J`.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.own_model().joint_names.clone()
    }

    /// The parent of each joint, -1 of the root, `J`.
    #[getter]
    fn parents(&self) -> Vec<i64> {
        let parent = |parent: &Option<usize>| parent.and_then(|parent| i64::try_from(parent).ok()).unwrap_or(-1);
        self.own_model().parents.iter().map(parent).collect()
    }

    /// The triangles of its mesh, `(F, 3)`.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let faces = &self.own_model().faces;
        array(py, [faces.len(), 3], faces.iter().flatten().copied().collect())
    }

    /// Whether Gaussians smaller than a pixel become fainter: gsplat's `rasterize_mode="antialiased"`.
    #[getter]
    fn antialiased(&self) -> bool {
        self.0.avatar.config.antialias
    }

    /// The blur of a pixel, square pixels: gsplat's `eps2d`.
    #[getter]
    fn blur(&self) -> f64 {
        self.0.avatar.config.filter().blur
    }

    /// Number of its Gaussians, `N`.
    fn __len__(&self) -> usize {
        self.0.avatar.template.len()
    }

    /// The avatar in a pose: a name, a file (of several poses with `frame`, a number or id), a [`Pose`](crate::pose::Pose),
    /// rotations of all joints as it takes them, or axis-angle rotations by joint names. With `same_tracker` it comes from
    /// the tracker that gave the avatar's training poses, whose constant errors are undone.
    #[pyo3(signature = (pose=None, translation=None, *, frame=None, same_tracker=false))]
    fn pose(
        &self,
        py: Python<'_>,
        pose: Option<&Bound<'_, PyAny>>,
        translation: Option<&Bound<'_, PyAny>>,
        frame: Option<&Bound<'_, PyAny>>,
        same_tracker: bool,
    ) -> PyResult<PosedAvatar> {
        self.0.check_open()?;
        let rest = "rest".into_pyobject(py)?.into_any();
        let mut pose = pose_of(pose.unwrap_or(&rest), translation, frame, self.own_model())?;
        if same_tracker {
            pose = self.tracker()?.offsets.apply(&pose, &self.own_model().parents);
        }
        Ok(PosedAvatar { loaded: self.0.clone(), pose })
    }

    /// Pictures `(B, height, width, 4)` of `poses` from `cameras`, one or as many, all of one size.
    #[pyo3(signature = (poses, cameras, background=None))]
    fn render_batch<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        cameras: &Bound<'py, PyAny>,
        background: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray4<f32>>> {
        let poses = self.several_poses(poses)?;
        let cameras = match cameras.cast::<Camera>() {
            Ok(camera) => vec![camera.get().0.clone()],
            Err(_) => {
                let cameras = cameras.try_iter()?.map(|camera| Ok(camera?.cast::<Camera>()?.get().0.clone()));
                cameras.collect::<PyResult<Vec<CoreCamera>>>()?
            }
        };
        let background = background_of(background)?;
        let [p, c] = [poses.len(), cameras.len()];
        if p == 0 || c == 0 || (p != c && p != 1 && c != 1) {
            return Err(wrong(format!("poses, cameras: are {p} and {c}; give one of each picture, or one for all")));
        }
        let size = |camera: &CoreCamera| [camera.width, camera.height];
        let first = size(&cameras[0]);
        if let Some(other) = cameras.iter().find(|camera| size(camera) != first) {
            let ([w, h], [width, height]) = (first, size(other));
            return Err(wrong(format!("cameras: have pictures of {w}x{h} and of {width}x{height}; give one size")));
        }
        let (width, height) = (first[0] as usize, first[1] as usize);
        let pictures = PyArray4::<f32>::zeros(py, [p.max(c), height, width, 4], false);
        for number in 0..p.max(c) {
            py.check_signals()?;
            let (pose, camera) = (&poses[number.min(p - 1)], &cameras[number.min(c - 1)]);
            let rgba = self
                .0
                .draw(py, "rendering", |drawing, gpu, avatar| drawing.picture(gpu, avatar, pose, camera, background))?;
            let mut all = pictures.readwrite();
            let at = number * rgba.len();
            all.as_slice_mut()?[at..at + rgba.len()].copy_from_slice(&rgba);
        }
        Ok(pictures)
    }

    /// Frees its memory on the device. It draws nothing any more.
    fn close(&self, py: Python<'_>) {
        self.0.closed.store(true, Ordering::Relaxed);
        py.detach(|| *self.0.drawing() = Drawing::default());
    }

    fn __enter__(slf: Py<Avatar>) -> Py<Avatar> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyAny>) {
        self.close(py);
    }

    fn __repr__(&self) -> String {
        format!("<ghand.Avatar {}, {} hand, {} Gaussians>", self.0.path.display(), self.side(), self.__len__())
    }
}

impl Avatar {
    /// Several poses of any kind, or one.
    fn several_poses(&self, poses: &Bound<'_, PyAny>) -> PyResult<Vec<CorePose>> {
        self.0.check_open()?;
        let is_one = poses.is_instance_of::<PyString>()
            || poses.is_instance_of::<PyDict>()
            || poses.is_instance_of::<Pose>()
            || poses.is_instance_of::<PosedAvatar>();
        if is_one {
            return Ok(vec![pose_of(poses, None, None, self.own_model())?]);
        }
        poses.try_iter()?.map(|pose| pose_of(&pose?, None, None, self.own_model())).collect()
    }
}

/// The colour behind a hand, from 0 to 1.
///
/// # Errors
/// `ValueError` if it is none.
pub fn background_of(value: Option<&Bound<'_, PyAny>>) -> PyResult<[f32; 3]> {
    let color = value.map_or(Ok([0.0; 3]), |value| Numbers::exactly("background", value))?;
    match color.iter().find(|part| !(0.0..=1.0).contains(*part)) {
        Some(part) => Err(wrong(format!("background: has {part}, must be red, green and blue from 0 to 1"))),
        None => Ok(color.map(|part| part as f32)),
    }
}
