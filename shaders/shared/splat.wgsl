// A Gaussian as the rasteriser sees it. Host twin: `ghand_render::splat::Splat`.
struct Splat {
    // Centre in pixels.
    mean: vec2<f32>,
    // Camera z, metres.
    depth: f32,
    opacity: f32,
    // Inverse covariance in pixels^-2: xx, xy, yy.
    conic: vec3<f32>,
    padding: f32,
    color: vec3<f32>,
    padding_2: f32,
}
