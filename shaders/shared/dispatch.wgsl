// The global index of an invocation of a dispatch that may be folded into two dimensions.
fn flat_index(group: vec3<u32>, groups: vec3<u32>, local: u32, group_size: u32) -> u32 {
    return (group.x + group.y * groups.x) * group_size + local;
}
