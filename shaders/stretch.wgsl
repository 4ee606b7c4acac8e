// Standard deviations of posed Gaussians: they follow the distances of neighbours on the surface, so that no gaps open where
// skinning stretches it. CPU twin: `ghand_core::stretch`.

import package::shared::dispatch::flat_index;
import package::shared::pose::{ROW_POINT, pose};

// Neighbours of each Gaussian.
override NEIGHBORS: u32 = 6u;
// Smallest and largest factor.
override SMALLEST: f32 = 0.5;
override LARGEST: f32 = 2.0;
// Row of the standard deviations in the splatter's table, behind the means.
const ROW_SCALE: u32 = 3u;

// [NEIGHBORS][N]; a missing one is the Gaussian itself.
@group(0) @binding(1) var<storage, read> neighbors: array<u32>;
@group(0) @binding(2) var<storage, read> offsets: array<f32>;
// Points after skinning, before the translation, [3][N], metres.
@group(0) @binding(3) var<storage, read> skinned: array<f32>;
// Before skinning, [N], metres, and its gradient.
@group(0) @binding(4) var<storage, read> scale: array<f32>;
@group(0) @binding(5) var<storage, read_write> d_scale: array<f32>;
@group(0) @binding(6) var<storage, read_write> gaussians: array<f32>;
@group(0) @binding(7) var<storage, read> d_gaussians: array<f32>;

fn point(p: u32) -> vec3<f32> {
    let at = ROW_POINT * pose.gaussian_count + p;
    return vec3(offsets[at], offsets[at + pose.gaussian_count], offsets[at + 2u * pose.gaussian_count]);
}

fn skinned_point(p: u32) -> vec3<f32> {
    return vec3(skinned[p], skinned[p + pose.gaussian_count], skinned[p + 2u * pose.gaussian_count]);
}

fn posed_scale(p: u32) -> u32 {
    return ROW_SCALE * pose.table_columns + pose.table_first + p;
}

@compute @workgroup_size(64)
fn stretch(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    let rest = point(p);
    let posed = skinned_point(p);
    var before = 0.0;
    var after = 0.0;
    for (var k = 0u; k < NEIGHBORS; k++) {
        let q = neighbors[k * n + p];
        let at_rest = point(q) - rest;
        let when_posed = skinned_point(q) - posed;
        before += dot(at_rest, at_rest);
        after += dot(when_posed, when_posed);
    }
    var factor = 1.0;
    if before > 0.0 {
        factor = clamp(sqrt(after / before), SMALLEST, LARGEST);
    }
    gaussians[posed_scale(p)] = scale[p] * factor;
}

// That the factor depends on the places is neglected.
@compute @workgroup_size(64)
fn stretch_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    if p >= pose.gaussian_count {
        return;
    }
    let at = posed_scale(p);
    // 1 for a Gaussian whose size vanishes.
    let factor = select(1.0, gaussians[at] / scale[p], scale[p] != 0.0);
    d_scale[p] = d_gaussians[at] * factor;
}
