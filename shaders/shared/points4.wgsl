// Four points per invocation. Eight neighbouring invocations share a block of 32 points: each takes one of the first
// eight, one of the next, and so on, so that neighbours touch neighbouring words. Points beyond the last are computed as the
// last and not stored.

// Points of a block. Host twin: `ghand_avatar::deform::BLOCK`.
const BLOCK: u32 = 32u;
const LANES: u32 = BLOCK / 4u;

// Number of invocations for so many points.
fn invocations(count: u32) -> u32 {
    return (count + BLOCK - 1u) / BLOCK * LANES;
}

fn unbounded_points(i: u32) -> vec4<u32> {
    return vec4(i / LANES * BLOCK + i % LANES) + vec4(0u, LANES, 2u * LANES, 3u * LANES);
}

fn points4(i: u32, count: u32) -> vec4<u32> {
    return min(unbounded_points(i), vec4(count - 1u));
}

fn in_range4(i: u32, count: u32) -> vec4<bool> {
    return unbounded_points(i) < vec4(count);
}
