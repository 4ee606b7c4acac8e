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

fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

// What the projection of an isotropic Gaussian needs in both directions.
struct Footprint {
    // Slopes x/z and y/z, clamped.
    slope: vec2<f32>,
    // Covariance in pixels^2 with the blur: xx, xy, yy.
    covariance: vec3<f32>,
}

fn footprint(view: View, p: vec3<f32>, scale: f32) -> Footprint {
    let slope = clamp(p.xy / p.z, view.slope_min, view.slope_max);
    let u = (scale / p.z) * (scale / p.z);
    let f = view.focal;
    let covariance = vec3(u * f.x * f.x * (1.0 + slope.x * slope.x) + BLUR,
                          u * f.x * f.y * slope.x * slope.y,
                          u * f.y * f.y * (1.0 + slope.y * slope.y) + BLUR);
    return Footprint(slope, covariance);
}
