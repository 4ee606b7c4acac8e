// Measures the size of subgroups in workgroups as the rasteriser's, where an adapter only says that they may be small.

@group(0) @binding(0) var<storage, read_write> size: array<u32>;

@compute @workgroup_size(32)
fn subgroup_size(@builtin(subgroup_size) lanes: u32) {
    size[0] = lanes;
}
