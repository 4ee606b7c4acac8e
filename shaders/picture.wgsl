// Copies an image to a part of a texture, which the user interface draws; around it is the background. Host: `ghand_app::viewer::picture`.

struct Settings {
    // Colour behind the image, display values.
    background: vec4<f32>,
    // The image's left column and top row in the texture.
    origin: vec2<u32>,
    // The image's columns and rows.
    size: vec2<u32>,
    // 1: the image is premultiplied and has no background yet; 0: it is complete.
    is_layer: u32,
    padding: vec3<u32>,
}

@group(0) @binding(0) var<storage, read> image: array<vec4<f32>>;
@group(0) @binding(1) var<uniform> settings: Settings;

// One triangle that covers the whole target.
@vertex
fn cover(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn picture(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    // Left of the image and above it, the difference wraps around to large numbers.
    let pixel = vec2<u32>(position.xy) - settings.origin;
    if pixel.x >= settings.size.x || pixel.y >= settings.size.y {
        return vec4(settings.background.rgb, 1.0);
    }
    let value = image[pixel.y * settings.size.x + pixel.x];
    let behind = select(0.0, 1.0 - value.a, settings.is_layer == 1u);
    return vec4(value.rgb + behind * settings.background.rgb, 1.0);
}
