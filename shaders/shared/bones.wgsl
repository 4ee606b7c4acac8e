// Access to the two chains for the skinning stages.

fn bone_row(k: u32, row: u32) -> vec4<f32> {
    let at = k * CHAIN_STRIDE + CHAIN_POSED + 4u * row;
    return vec4(chain[at], chain[at + 1u], chain[at + 2u], chain[at + 3u]);
}

fn residual_bone_row(k: u32, row: u32) -> vec4<f32> {
    let at = k * CHAIN_STRIDE + CHAIN_POSED + 4u * row;
    return vec4(residual_chain[at], residual_chain[at + 1u], residual_chain[at + 2u], residual_chain[at + 3u]);
}

fn residual_mean(p: u32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < pose.joint_count; k++) {
        sum += residual_weights[k * pose.gaussian_count + p];
    }
    return sum / f32(pose.joint_count);
}
