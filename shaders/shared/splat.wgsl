// A Gaussian as the rasteriser sees it. Host twin: `ghand_render::splat::Splat`.
struct Splat {
    // Centre in pixels.
    mean: vec2<f32>,
    // Camera z, metres.
    depth: f32,
    opacity: f32,
    // Inverse covariance in pixels^-2: xx, xy, yy.
    conic: vec3<f32>,
    // Its slots in the backward pass, see `slot_of`: that of tile (0, 0), modulo 2^32, and those of a row of tiles.
    slot_origin: u32,
    color: vec3<f32>,
    slot_columns: u32,
}

// The slot that holds the gradient of a splat from a tile.
fn slot_of(splat: Splat, tile: vec2<u32>) -> u32 {
    return splat.slot_origin + tile.x + tile.y * splat.slot_columns;
}
