//! Host part of `project.wgsl` and `project_backward.wgsl`.

use super::frame::FrameBuffers;
use crate::pipeline::{Bound, Module, Stage};
use crate::{Gpu, shader_sources};

pub struct Pipelines {
    project: Stage,
    project_backward: Stage,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Pipelines {
        let (forward, backward) = (shader_sources::project(), shader_sources::project_backward());
        Pipelines {
            project: Module::new(gpu, "project", &forward).stage(gpu, "project", &[]),
            project_backward: Module::new(gpu, "project_backward", &backward).stage(gpu, "project_backward", &[]),
        }
    }
}

pub struct Stages {
    project: Bound,
    project_backward: Bound,
    groups: u32,
}

impl Stages {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, b: &FrameBuffers) -> Stages {
        let s = &b.shared;
        Stages {
            project: pipelines.project.bind(
                gpu,
                &[
                    (0, &s.view),
                    (1, &s.gaussians),
                    (2, &b.splats),
                    (3, &b.tile_rects),
                    (4, &b.depth_keys[0]),
                    (5, &b.depth_order[0]),
                ],
            ),
            project_backward: pipelines.project_backward.bind(
                gpu,
                &[(0, &s.view), (1, &s.gaussians), (2, &b.slot_ranges), (3, &b.slot_gradients), (4, &s.d_gaussians)],
            ),
            groups: (b.count as u32).div_ceil(64),
        }
    }

    pub fn forward(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.project.dispatch(pass, self.groups);
    }

    pub fn backward(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.project_backward.dispatch(pass, self.groups);
    }
}
