//! Host part of `slots.wgsl`: numbers the slots of the Gaussians, into which the tiles write their gradients.

use super::frame_buffers::FrameBuffers;
use super::sort::{self, Scan};
use crate::pipeline::{Bound, Module, Stage};
use crate::{Gpu, buffers};

pub struct Pipelines {
    count_slots: Stage,
    place_slots: Stage,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Pipelines {
        let module = Module::new(gpu, "slots");
        Pipelines {
            count_slots: module.stage(gpu, "count_slots", &[]),
            place_slots: module.stage(gpu, "place_slots", &[]),
        }
    }
}

pub struct Stages {
    count_slots: Bound,
    scan: Scan,
    place_slots: Bound,
    count: u32,
}

impl Stages {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, sort: &sort::Pipelines, b: &FrameBuffers) -> Stages {
        let slot_starts = buffers::zeroed(gpu, "slot starts", b.count);
        let all = [
            ("view", &b.shared.view),
            ("tile_rects", &b.tile_rects),
            ("slot_starts", &slot_starts),
            ("splats", &b.splats),
        ];
        let total = buffers::zeroed(gpu, "slot total", 1);
        Stages {
            count_slots: pipelines.count_slots.bind(gpu, &all),
            scan: sort.scan(gpu, &slot_starts, b.count as u32, &total, sort::FIRST_WORD),
            place_slots: pipelines.place_slots.bind(gpu, &all),
            count: b.count as u32,
        }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.count_slots.dispatch_invocations(pass, self.count);
        self.scan.encode(pass);
        self.place_slots.dispatch_invocations(pass, self.count);
    }
}
