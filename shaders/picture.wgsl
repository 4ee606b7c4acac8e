// Copies an image to a part of a texture, which the user interface draws; around it is the background. Host: `ghand_app::viewer::picture`.

@group(0) @binding(0) var<storage, read> image: array<vec4<f32>>;
// x, y: the image's left column and top row in the texture; z, w: its columns and rows.
@group(0) @binding(1) var<uniform> place: vec4<u32>;
// xyz: colour behind the image, display values. w: 1 if the image is premultiplied and has no background yet; 0 if it is
// complete.
@group(0) @binding(2) var<uniform> background: vec4<f32>;

// One triangle that covers the whole target.
@vertex
fn cover(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn picture(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    // Left of the image and above it, the difference wraps around to large numbers.
    let pixel = vec2<u32>(position.xy) - place.xy;
    if pixel.x >= place.z || pixel.y >= place.w {
        return vec4(background.rgb, 1.0);
    }
    let value = image[pixel.y * place.z + pixel.x];
    return vec4(value.rgb + background.w * (1.0 - value.a) * background.rgb, 1.0);
}
