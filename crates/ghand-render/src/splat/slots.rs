//! Host part of `slots.wgsl`: numbers the slots of the Gaussians, into which the tiles write their gradients.

use super::Shared;
use super::frame_buffers::FrameBuffers;
use super::sort::{self, Scan};
use crate::pipeline::{Bound, Module, Stage};
use crate::stages::{CountSlots, CountSlotsBindings, PlaceSlots, PlaceSlotsBindings};
use crate::{Gpu, buffers};

pub struct Pipelines {
    count_slots: Stage<CountSlots>,
    place_slots: Stage<PlaceSlots>,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Pipelines {
        let module = Module::new(gpu, "slots");
        Pipelines { count_slots: module.stage(gpu, &[]), place_slots: module.stage(gpu, &[]) }
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
        let FrameBuffers { shared: Shared { view, .. }, tile_rects, splats, .. } = b;
        let slot_starts = &buffers::zeroed(gpu, "slot starts", b.count);
        let total = buffers::zeroed(gpu, "slot total", 1);
        Stages {
            count_slots: pipelines.count_slots.bind(gpu, &CountSlotsBindings { view, tile_rects, slot_starts }),
            scan: sort.scan(gpu, slot_starts, b.count as u32, &total, sort::FIRST_WORD),
            place_slots: pipelines.place_slots.bind(gpu, &PlaceSlotsBindings { view, tile_rects, slot_starts, splats }),
            count: b.count as u32,
        }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.count_slots.dispatch_invocations(pass, self.count);
        self.scan.encode(pass);
        self.place_slots.dispatch_invocations(pass, self.count);
    }
}
