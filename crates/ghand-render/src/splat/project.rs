//! Host part of `project.wgsl`, `project_backward.wgsl` and `camera_gradient.wgsl`.

use super::frame_buffers::{CAMERA_ROWS, FrameBuffers, gradient_cells};
use super::{Purpose, SplatModel, Thresholds, frame};
use crate::Gpu;
use crate::pipeline::{Bound, Module, Stage};

/// The stages of the backward pass.
struct Backward<T> {
    project_backward: T,
    /// The strands and their sum, if the camera's gradient is computed.
    camera: Option<[T; 2]>,
}

pub struct Pipelines {
    project: Stage,
    backward: Option<Backward<Stage>>,
}

impl Pipelines {
    pub fn new(gpu: &Gpu, model: &SplatModel, purpose: Purpose, thresholds: &Thresholds) -> Pipelines {
        let mut constants = model.constants();
        let shift = f64::from(frame::DEPTH_BITS - thresholds.depth_bits());
        let all = [&constants[..], &[thresholds.alpha_min(), ("DEPTH_KEY_SHIFT", shift)]].concat();
        let project = Module::new(gpu, "project").stage(gpu, "project", &all);
        let backward = purpose.has_gradients().then(|| {
            constants.push(("SLOT_OPACITY", f64::from(u8::from(model.slot_opacity()))));
            constants.push(("SLOT_CELLS", f64::from(gradient_cells(gpu.tier))));
            constants.push(("CAMERA_GRADIENT", f64::from(u8::from(purpose == Purpose::CameraGradients))));
            let module = Module::new(gpu, "project_backward");
            let camera = (purpose == Purpose::CameraGradients).then(|| {
                let module = Module::new(gpu, "camera_gradient");
                ["camera_strands", "camera_gradient"].map(|entry| module.stage(gpu, entry, &[]))
            });
            Backward { project_backward: module.stage(gpu, "project_backward", &constants), camera }
        });
        Pipelines { project, backward }
    }
}

pub struct Stages {
    project: Bound,
    backward: Option<Backward<Bound>>,
    count: u32,
}

impl Stages {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, b: &FrameBuffers) -> Stages {
        let s = &b.shared;
        let project = pipelines.project.bind(
            gpu,
            &[
                ("view", &s.view),
                ("gaussians", &s.gaussians),
                ("splats", &b.splats),
                ("tile_rects", &b.tile_rects),
                ("depth_keys", &b.depth_keys[0]),
                ("counters", &s.counters),
            ],
        );
        let backward = pipelines.backward.as_ref().map(|p| Backward {
            project_backward: p.project_backward.bind(
                gpu,
                &[
                    ("view", &s.view),
                    ("gaussians", &s.gaussians),
                    ("tile_rects", &b.tile_rects),
                    ("splats", &b.splats),
                    ("slot_gradients", &b.slot_gradients),
                    ("slot_marks", &b.slot_marks),
                    ("d_gaussians", &s.d_gaussians),
                    ("camera_rows", &b.camera_rows),
                    ("counters", &s.counters),
                ],
            ),
            camera: p.camera.as_ref().map(|[strands, sum]| {
                [
                    strands.bind(
                        gpu,
                        &[("view", &s.view), ("camera_rows", &b.camera_rows), ("strands", &b.camera_strands)],
                    ),
                    sum.bind(gpu, &[("strands", &b.camera_strands), ("d_camera", &s.d_camera)]),
                ]
            }),
        });
        Stages { project, backward, count: b.count as u32 }
    }

    pub fn forward(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.project.dispatch_invocations(pass, self.count);
    }

    pub fn backward(&self, pass: &mut wgpu::ComputePass<'_>) {
        let Some(backward) = &self.backward else { return };
        backward.project_backward.dispatch_invocations(pass, self.count);
        for stage in backward.camera.iter().flatten() {
            stage.dispatch(pass, CAMERA_ROWS as u32);
        }
    }
}
