// Turns samples of faces and lines into the image: lines over faces, then a box filter. CPU twin: `reference/mesh.rs`.

struct ResolveUniforms {
    // Size of the image, pixels.
    size: vec2u,
    // Samples per pixel along each axis.
    supersample: u32,
    // Width of the border around the image that is drawn but not kept, pixels.
    margin: u32,
    // Colour of the lines, and 1; 0 if there are none, so that their texture is not read.
    line_color: vec4f,
}

@group(0) @binding(0) var<uniform> uniforms: ResolveUniforms;
@group(0) @binding(1) var face_colors: texture_2d<f32>;
@group(0) @binding(2) var face_depths: texture_2d<f32>;
// Coverage by visible lines.
@group(0) @binding(3) var line_coverages: texture_2d<f32>;
@group(0) @binding(4) var<storage, read_write> image: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> depths: array<f32>;

// The nearer of two depths, where 0 marks nothing (nothing in front of the near plane has it).
fn nearer(a: f32, b: f32) -> f32 {
    return select(min(a, b), max(a, b), a == 0.0 || b == 0.0);
}

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3u) {
    let size = uniforms.size;
    if any(id.xy >= size) {
        return;
    }
    let k = uniforms.supersample;
    var sum = vec4f(0.0);
    // The host converts 0 to infinity.
    var nearest = 0.0;
    for (var y = 0u; y < k; y++) {
        for (var x = 0u; x < k; x++) {
            let at = vec2i((id.xy + uniforms.margin) * k + vec2u(x, y));
            var color = textureLoad(face_colors, at, 0);
            if color.a > 0.0 {
                nearest = nearer(nearest, textureLoad(face_depths, at, 0).r);
            }
            if uniforms.line_color.a > 0.0 {
                color = mix(color, uniforms.line_color, textureLoad(line_coverages, at, 0).r);
            }
            sum += color;
        }
    }
    let pixel = id.y * size.x + id.x;
    image[pixel] = sum / f32(k * k);
    depths[pixel] = nearest;
}
