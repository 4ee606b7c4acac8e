// Turns samples of faces and lines into the image: lines over faces, then a box filter. CPU twin: `reference/mesh.rs`.

struct ResolveUniforms {
    // Size of the image, pixels.
    size: vec2u,
    // Samples per pixel along each axis.
    supersample: u32,
    // Width of the border around the image that is drawn but not kept, pixels.
    margin: u32,
    // Colour of visible lines and of lines behind faces; w unused.
    line_color: vec4f,
    hidden_color: vec4f,
    // Whether there are lines; without them their textures are not read.
    lines: u32,
    // Near plane, metres: inverse depth is line depth / near.
    near: f32,
    padding: vec2u,
}

@group(0) @binding(0) var<uniform> uniforms: ResolveUniforms;
@group(0) @binding(1) var face_colors: texture_2d<f32>;
@group(0) @binding(2) var face_depths: texture_2d<f32>;
// Coverage by visible lines and by lines behind faces.
@group(0) @binding(3) var line_coverages: texture_2d<f32>;
@group(0) @binding(4) var line_depths: texture_depth_2d;
@group(0) @binding(5) var<storage, read_write> image: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> depths: array<f32>;

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
            if uniforms.lines != 0u {
                let coverage = textureLoad(line_coverages, at, 0).rg;
                color = mix(color, vec4f(uniforms.hidden_color.rgb, 1.0), coverage.g);
                color = mix(color, vec4f(uniforms.line_color.rgb, 1.0), coverage.r);
                let depth = textureLoad(line_depths, at, 0);
                if depth > 0.0 {
                    nearest = nearer(nearest, uniforms.near / depth);
                }
            }
            sum += color;
        }
    }
    let pixel = id.y * size.x + id.x;
    image[pixel] = sum / f32(k * k);
    depths[pixel] = nearest;
}
