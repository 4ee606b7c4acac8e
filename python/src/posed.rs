//! An avatar in a pose.

use std::sync::Arc;

use ghand_avatar::framing::{posed_vertices, turntable};
use ghand_avatar::orbit_camera::OrbitCamera;
use ghand_avatar::scene::OPACITY;
use ghand_avatar::view_side::ViewSide;
use ghand_core::Pose as CorePose;
use ghand_core::posing::{PosedModel, pose_hand};
use ghand_motion::RestSkeleton;
use ghand_motion::ik::HandIk;
use ghand_pictures::blank_pictures::Blank;
use ghand_render::splat::{FLATNESS, Shape, SplatModel};
use glam::{Quat, Vec3};
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, point_array};
use crate::avatar::{Loaded, background_of};
use crate::camera::{Camera, checked_size};
use crate::error::{failed, wrong};
use crate::messages::warn;
use crate::pose::Pose;

/// An avatar in a pose.
#[pyclass(frozen, module = "ghand")]
pub struct PosedAvatar {
    /// The avatar.
    pub loaded: Arc<Loaded>,
    /// A pose of it.
    pub pose: CorePose,
}

impl PosedAvatar {
    /// The hand model in the pose.
    fn mesh(&self) -> PyResult<PosedModel> {
        self.loaded.check_open()?;
        pose_hand(&self.loaded.avatar.model, &[], &self.pose).map_err(failed)
    }
}

#[pymethods]
impl PosedAvatar {
    /// The pose.
    #[getter]
    fn pose(&self) -> Pose {
        Pose(self.pose.clone())
    }

    /// The vertices of the hand model, metres, `(V, 3)`.
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        point_array(py, self.mesh()?.vertices.into_iter())
    }

    /// The joints, metres, `(J, 3)`.
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        point_array(py, self.mesh()?.joints.into_iter())
    }

    /// The 21 landmarks in MediaPipe's order: wrist, then four of each finger from thumb to little finger; metres,
    /// `(21, 3)`.
    fn landmarks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.loaded.check_open()?;
        let skeleton = RestSkeleton::of(&self.loaded.avatar.model).map_err(failed)?;
        point_array(py, HandIk::new(&skeleton).landmarks(&self.pose).into_iter())
    }

    /// The Gaussians in gsplat's convention, float32: `means` `(N, 3)` in metres, `quats` `(N, 4)` w first, `scales`
    /// `(N, 3)`, `opacities` `(N,)`, `colors` `(N, 3)` as displayed; with the gloss that `camera` sees, if given.
    #[pyo3(signature = (camera=None))]
    fn gaussians<'py>(&self, py: Python<'py>, camera: Option<&Camera>) -> PyResult<Bound<'py, PyDict>> {
        let eye = camera.map(|camera| camera.0.center());
        let (table, model) =
            self.loaded.draw(py, "posing", |drawing, gpu, avatar| drawing.gaussians(gpu, avatar, &self.pose, eye))?;
        let count = self.loaded.avatar.template.len();
        let value = |row: usize, i: usize| table.get(row * count + i).copied().unwrap_or_default();
        let vector = |row: usize, i: usize| [0, 1, 2].map(|part| value(row + part, i));
        let flat = model.shape == Shape::Flat;
        // A flat Gaussian is thin along its normal.
        let quaternion = |i: usize| {
            let normal = if flat { Vec3::from(vector(model.rotation_row(), i)).try_normalize() } else { None };
            normal.map_or(Quat::IDENTITY, |normal| Quat::from_rotation_arc(Vec3::Z, normal))
        };
        let scale = |i: usize| {
            let size = value(SplatModel::SCALE_ROW, i);
            [size, size, if flat { size * FLATNESS as f32 } else { size }]
        };
        let rows = |row: usize| (0..count).flat_map(move |i| vector(row, i)).collect();
        let quaternions = (0..count).map(quaternion).flat_map(|q| [q.w, q.x, q.y, q.z]).collect();
        let found = PyDict::new(py);
        found.set_item("means", array(py, [count, 3], rows(0))?)?;
        found.set_item("quats", array(py, [count, 4], quaternions)?)?;
        found.set_item("scales", array(py, [count, 3], (0..count).flat_map(scale).collect())?)?;
        found.set_item("opacities", array(py, [count], vec![OPACITY; count])?)?;
        found.set_item("colors", array(py, [count, 3], rows(model.color_row()))?)?;
        Ok(found)
    }

    /// A picture `(height, width, 4)`, float32: display colours from 0 to 1 over the background, and coverage. Over black
    /// they are premultiplied.
    #[pyo3(signature = (camera, background=None))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        camera: &Camera,
        background: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let background = background_of(background)?;
        let rgba = self.loaded.draw(py, "rendering", |drawing, gpu, avatar| {
            drawing.picture(gpu, avatar, &self.pose, &camera.0, background)
        })?;
        let covered = rgba.chunks_exact(4).filter(|pixel| pixel[3] > 0.0).count();
        if let Some(blank) = Blank::of(&camera.0, covered, || posed_vertices(&self.loaded.avatar.model, &self.pose)) {
            warn(py, &[format!("the picture is empty: the hand {}", blank.reason())])?;
        }
        array(py, [camera.0.height as usize, camera.0.width as usize, 4], rgba)
    }

    /// Depths along the camera's axis, metres, `(height, width)`, float32; 0 where there is no hand.
    fn depth<'py>(&self, py: Python<'py>, camera: &Camera) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let depths = self
            .loaded
            .draw(py, "rendering", |drawing, gpu, avatar| drawing.depths(gpu, avatar, &self.pose, &camera.0))?;
        array(py, [camera.0.height as usize, camera.0.width as usize], depths)
    }

    /// A camera whose picture the hand fills, seen from its back and a little from the thumb, or from a side: "back",
    /// "palm", "thumb-side", "little-finger-side", "fingertips".
    #[pyo3(signature = (side=None, size=(512, 512)), text_signature = "($self, /, side=None, size=(512, 512))")]
    fn camera(&self, side: Option<&str>, size: (u32, u32)) -> PyResult<Camera> {
        let size = checked_size(size)?;
        let model = &self.loaded.avatar.model;
        let points = posed_vertices(model, &self.pose);
        let mut orbit = OrbitCamera::facing(model, &self.pose, &points);
        if let Some(name) = side {
            let names = ViewSide::ALL.map(ViewSide::name).join(", ");
            let side = ViewSide::of(name);
            let side = side.ok_or_else(|| wrong(format!("side: there is no {name:?}; there are {names}")))?;
            orbit.look_from(side, model, &self.pose);
            orbit.frame(&points);
        }
        Ok(Camera(orbit.camera(size)))
    }

    /// Cameras around the hand, from its back on.
    #[pyo3(signature = (views, size=(512, 512)), text_signature = "($self, /, views, size=(512, 512))")]
    fn turntable(&self, views: usize, size: (u32, u32)) -> PyResult<Vec<Camera>> {
        let size = checked_size(size)?;
        if !(1..=10_000).contains(&views) {
            return Err(wrong(format!("views: is {views}, must be from 1 to 10000")));
        }
        let cameras = turntable(&self.loaded.avatar.model, &[&self.pose], views, size);
        Ok(cameras.into_iter().flatten().map(Camera).collect())
    }

    fn __repr__(&self) -> String {
        format!("<ghand.PosedAvatar of {} joints>", self.pose.rotations.len())
    }
}
