// Draws an image of the splatter, or of the mesh rasteriser, into a render pass: display values, premultiplied by their
// coverage.

struct Place {
    // The image's left column and top row in the target, and its columns and rows.
    origin: vec2<u32>,
    size: vec2<u32>,
    // Colour behind the image if the target is replaced, display values.
    background: vec4<f32>,
    // The target's depth is x + y / z.
    depth_from_z: vec2<f32>,
    padding: vec2<u32>,
}

// Whether the target stores linear values, and whether it is replaced instead of covered.
override LINEAR: bool = false;
override REPLACE: bool = false;

@group(0) @binding(0) var<storage, read> image: array<vec4<f32>>;
@group(0) @binding(1) var<uniform> place: Place;
@group(0) @binding(2) var<storage, read> depths: array<f32>;

// One triangle that covers the whole target.
@vertex
fn cover(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// The linear value of a display value (sRGB).
fn linear(display: vec3<f32>) -> vec3<f32> {
    let c = max(display, vec3(0.0));
    return select(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, c <= vec3(0.04045));
}

// The number of the image's pixel at a position in the target; none outside the image.
fn pixel_at(position: vec4<f32>) -> u32 {
    // Left of the image and above it, the difference wraps around to large numbers.
    let pixel = vec2<u32>(position.xy) - place.origin;
    if pixel.x >= place.size.x || pixel.y >= place.size.y {
        return 0xffffffffu;
    }
    return pixel.y * place.size.x + pixel.x;
}

fn shown(value: vec4<f32>) -> vec4<f32> {
    if REPLACE {
        let color = value.rgb + (1.0 - value.a) * place.background.rgb;
        return vec4(select(color, linear(color), LINEAR), 1.0);
    }
    if value.a <= 0.0 {
        discard;
    }
    return vec4(select(value.rgb, linear(value.rgb / value.a) * value.a, LINEAR), value.a);
}

@fragment
fn draw_image(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = pixel_at(position);
    if pixel == 0xffffffffu {
        return shown(vec4(0.0));
    }
    return shown(image[pixel]);
}

struct DeepColor {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn draw_deep_image(@builtin(position) position: vec4<f32>) -> DeepColor {
    let pixel = pixel_at(position);
    if pixel == 0xffffffffu || depths[min(pixel, arrayLength(&depths) - 1u)] <= 0.0 {
        discard;
    }
    return DeepColor(shown(image[pixel]), place.depth_from_z.x + place.depth_from_z.y / depths[pixel]);
}
