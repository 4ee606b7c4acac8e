// Copies the splatter's image to a texture, which the user interface draws. Host: `ghand_app::viewer::picture`.
@group(0) @binding(0) var<storage, read> image: array<vec4<f32>>;
// x: columns of the image.
@group(0) @binding(1) var<uniform> size: vec4<u32>;

// One triangle that covers the whole target.
@vertex
fn cover(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn picture(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    return vec4(image[pixel.y * size.x + pixel.x].rgb, 1.0);
}
