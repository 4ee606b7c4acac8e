// The kinematic chain: joint rotations to posed_from_rest maps. CPU twin: `ghand_core::skeleton`.

import package::shared::chain::pose_chain;

@compute @workgroup_size(1)
fn skeleton() {
    pose_chain();
}
