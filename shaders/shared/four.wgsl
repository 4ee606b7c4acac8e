// Four points per invocation: i, i + Q, i + 2 Q and i + 3 Q with Q a quarter of the points, so that neighbouring
// invocations touch neighbouring words. Points beyond the last are computed as the last and not stored.

fn quarter(count: u32) -> u32 {
    return (count + 3u) / 4u;
}

fn four_points(i: u32, count: u32) -> vec4<u32> {
    return min(vec4(i) + vec4(0u, 1u, 2u, 3u) * quarter(count), vec4(count - 1u));
}

fn four_stored(i: u32, count: u32) -> vec4<bool> {
    return vec4(i) + vec4(0u, 1u, 2u, 3u) * quarter(count) < vec4(count);
}
