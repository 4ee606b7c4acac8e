// Sizes and switches of the pose pipeline. Host twin: `ghand_avatar::deform::PoseUniforms`.
struct PoseUniforms {
    gaussian_count: u32,
    joint_count: u32,
    basis_count: u32,
    // Where this frame's pose starts in `poses`.
    pose_offset: u32,
    // Whether the residual joints are relative to the rest joints (1) or to the origin (0).
    anchored: u32,
    // Whether the mean over the joints is subtracted from the residual weights.
    zero_sum: u32,
    // Where the hand's Gaussians lie in the splatter's table: columns of a row, and the first of theirs.
    table_columns: u32,
    table_first: u32,
}

@group(0) @binding(0) var<uniform> pose: PoseUniforms;

// A chain holds for each joint: local rotation (9), world_from_joint (12), posed_from_rest (12), all row-major.
const CHAIN_STRIDE: u32 = 33u;
const CHAIN_WORLD: u32 = 9u;
const CHAIN_POSED: u32 = 21u;
// Rows of the `offsets` table: the offset, then the point itself.
const ROW_OFFSET: u32 = 0u;
const ROW_POINT: u32 = 3u;
// Rows of the `d_skin` table: the gradient of the point (later of the offset), then d_posed (x) [point; 1], row-major.
const ROW_D_POINT: u32 = 0u;
const ROW_MOMENT: u32 = 3u;
