//! Host part of `project.wgsl`, `project_backward.wgsl` and `camera_gradient.wgsl`.

use super::frame_buffers::{CAMERA_ROWS, FrameBuffers, gradient_cells};
use super::{Purpose, SplatModel, Thresholds, frame};
use crate::Gpu;
use crate::pipeline::{Bound, Module, Stage};
use crate::stages::{
    CameraGradient, CameraGradientBindings, CameraStrands, CameraStrandsBindings, Project, ProjectBackward,
    ProjectBackwardBindings, ProjectBindings,
};

pub struct Pipelines {
    project: Stage<Project>,
    /// If there are gradients.
    project_backward: Option<Stage<ProjectBackward>>,
    /// The strands and their sum, if the camera's gradient is computed.
    camera: Option<(Stage<CameraStrands>, Stage<CameraGradient>)>,
}

impl Pipelines {
    pub fn new(gpu: &Gpu, model: &SplatModel, purpose: Purpose, thresholds: &Thresholds) -> Pipelines {
        let mut constants = model.constants();
        let shift = f64::from(frame::DEPTH_BITS - thresholds.depth_bits());
        let all = [&constants[..], &[thresholds.alpha_min(), ("DEPTH_KEY_SHIFT", shift)]].concat();
        let project = Module::new(gpu, "project").stage(gpu, &all);
        let project_backward = purpose.has_gradients().then(|| {
            constants.push(("SLOT_OPACITY", f64::from(u8::from(model.slot_opacity()))));
            constants.push(("SLOT_CELLS", f64::from(gradient_cells(gpu.tier))));
            constants.push(("CAMERA_GRADIENT", f64::from(u8::from(purpose == Purpose::CameraGradients))));
            Module::new(gpu, "project_backward").stage(gpu, &constants)
        });
        let camera = (purpose == Purpose::CameraGradients).then(|| {
            let module = Module::new(gpu, "camera_gradient");
            (module.stage(gpu, &[]), module.stage(gpu, &[]))
        });
        Pipelines { project, project_backward, camera }
    }
}

pub struct Stages {
    project: Bound,
    project_backward: Option<Bound>,
    camera: Option<[Bound; 2]>,
    count: u32,
}

impl Stages {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, b: &FrameBuffers) -> Stages {
        let s = &b.shared;
        let project = pipelines.project.bind(
            gpu,
            &ProjectBindings {
                view: &s.view,
                gaussians: &s.gaussians,
                splats: &b.splats,
                tile_rects: &b.tile_rects,
                depth_keys: &b.depth_keys[0],
                counters: &s.counters,
            },
        );
        let project_backward = pipelines.project_backward.as_ref().map(|stage| {
            stage.bind(
                gpu,
                &ProjectBackwardBindings {
                    view: &s.view,
                    gaussians: &s.gaussians,
                    tile_rects: &b.tile_rects,
                    splats: &b.splats,
                    slot_gradients: &b.slot_gradients,
                    slot_marks: &b.slot_marks,
                    d_gaussians: &s.d_gaussians,
                    camera_rows: &b.camera_rows,
                    counters: &s.counters,
                },
            )
        });
        let camera = pipelines.camera.as_ref().map(|(of_strands, sum)| {
            let camera_rows = &b.camera_rows;
            let strands = &b.camera_strands;
            [
                of_strands.bind(gpu, &CameraStrandsBindings { view: &s.view, camera_rows, strands }),
                sum.bind(gpu, &CameraGradientBindings { strands, d_camera: &s.d_camera }),
            ]
        });
        Stages { project, project_backward, camera, count: b.count as u32 }
    }

    pub fn forward(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.project.dispatch_invocations(pass, self.count);
    }

    pub fn backward(&self, pass: &mut wgpu::ComputePass<'_>) {
        let Some(project_backward) = &self.project_backward else { return };
        project_backward.dispatch_invocations(pass, self.count);
        for stage in self.camera.iter().flatten() {
            stage.dispatch(pass, CAMERA_ROWS as u32);
        }
    }
}
