// The place of an invocation in a stage that works by blocks, one workgroup each.

struct Block {
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @if(!subgroups) @builtin(local_invocation_index) index: u32,
    @if(subgroups) @builtin(subgroup_id) subgroup: u32,
    @if(subgroups) @builtin(num_subgroups) subgroups: u32,
    @if(subgroups) @builtin(subgroup_size) lanes: u32,
    @if(subgroups) @builtin(subgroup_invocation_id) lane: u32,
}

// The number of an invocation in its workgroup: with subgroups, in their order.
@if(subgroups)
fn thread_of(it: Block) -> u32 {
    return it.subgroup * it.lanes + it.lane;
}

@if(!subgroups)
fn thread_of(it: Block) -> u32 {
    return it.index;
}
