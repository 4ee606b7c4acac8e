// The rectangles of tiles that Gaussians may cover: first and one past last tile, x in the low and y in the high half of
// each word; all zero when culled.

fn first_tile(rect: vec2<u32>) -> vec2<u32> {
    return vec2(rect.x & 0xffffu, rect.x >> 16u);
}

fn end_tile(rect: vec2<u32>) -> vec2<u32> {
    return vec2(rect.y & 0xffffu, rect.y >> 16u);
}

fn tile_count(rect: vec2<u32>) -> u32 {
    let size = end_tile(rect) - first_tile(rect);
    return size.x * size.y;
}
