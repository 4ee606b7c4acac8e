// Textured, lit triangles at k times the image's size (`vertex`, `fragment`), then the box filter that makes the image
// of them (`resolve`). CPU twin: `reference/mesh.rs`.

struct MeshUniforms {
    // clip_from_camera without its depth row: x_clip = clip_x.xy . (x, z), y_clip = clip_y.xy . (y, z).
    clip_x: vec4f,
    clip_y: vec4f,
    // x: near plane, metres; y: how far diffuse light wraps around; z: number of lights; w: 1 for lit, 0 for unlit.
    settings: vec4f,
    ambient: vec4f,
    // Unit vectors towards the lights, world axes, and their colours.
    light_directions: array<vec4f, 4>,
    light_colors: array<vec4f, 4>,
}

struct ResolveUniforms {
    // Size of the image, pixels.
    size: vec2u,
    supersample: u32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> uniforms: MeshUniforms;
@group(0) @binding(1) var color_texture: texture_2d<f32>;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
    @location(1) uv: vec2f,
    @location(2) depth: f32,
    @location(3) exposure: f32,
}

struct Targets {
    @location(0) color: vec4f,
    @location(1) depth: f32,
}

@vertex
fn vertex(
    @location(0) position_camera: vec3f,
    @location(1) normal_world: vec3f,
    @location(2) uv: vec2f,
    @location(3) exposure: f32,
) -> Varyings {
    let z = position_camera.z;
    var out: Varyings;
    // Reversed depth near/z with the far plane at infinity: no scene-dependent range, and the best f32 resolution.
    out.clip = vec4f(
        dot(uniforms.clip_x.xy, vec2f(position_camera.x, z)),
        dot(uniforms.clip_y.xy, vec2f(position_camera.y, z)),
        uniforms.settings.x,
        z,
    );
    out.normal = normal_world;
    out.uv = uv;
    out.depth = z;
    out.exposure = exposure;
    return out;
}

// Bilinear by hand: samplers are free to round their weights to 8 bits, and the twin does not.
fn sample_color(uv: vec2f) -> vec3f {
    let size = vec2i(textureDimensions(color_texture));
    let p = uv * vec2f(size) - 0.5;
    let base = floor(p);
    let f = p - base;
    let lo = clamp(vec2i(base), vec2i(0), size - 1);
    let hi = clamp(vec2i(base) + 1, vec2i(0), size - 1);
    let top = mix(
        textureLoad(color_texture, lo, 0).rgb,
        textureLoad(color_texture, vec2i(hi.x, lo.y), 0).rgb,
        f.x,
    );
    let bottom = mix(
        textureLoad(color_texture, vec2i(lo.x, hi.y), 0).rgb,
        textureLoad(color_texture, hi, 0).rgb,
        f.x,
    );
    return mix(top, bottom, f.y);
}

fn shade(normal: vec3f) -> vec3f {
    // Degenerate triangles hand in a zero normal: only ambient light reaches them.
    let n = normal / max(length(normal), 1e-12);
    let wrap = uniforms.settings.y;
    var light = uniforms.ambient.rgb;
    for (var i = 0u; i < u32(uniforms.settings.z); i++) {
        let cosine = dot(n, uniforms.light_directions[i].xyz);
        light += uniforms.light_colors[i].rgb * max(0.0, (cosine + wrap) / (1.0 + wrap));
    }
    return light;
}

@fragment
fn fragment(in: Varyings) -> Targets {
    var color = sample_color(in.uv);
    if uniforms.settings.w > 0.5 {
        color = min(color * shade(in.normal) * in.exposure, vec3f(1.0));
    }
    return Targets(vec4f(color, 1.0), in.depth);
}

@group(0) @binding(0) var<uniform> resolve_uniforms: ResolveUniforms;
@group(0) @binding(1) var sample_colors: texture_2d<f32>;
@group(0) @binding(2) var sample_depths: texture_2d<f32>;
@group(0) @binding(3) var<storage, read_write> image: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> depths: array<f32>;

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3u) {
    let size = resolve_uniforms.size;
    if any(id.xy >= size) {
        return;
    }
    let k = resolve_uniforms.supersample;
    var sum = vec4f(0.0);
    // 0 marks an empty pixel (nothing in front of the near plane has it); the host reads it as infinity.
    var nearest = 0.0;
    for (var y = 0u; y < k; y++) {
        for (var x = 0u; x < k; x++) {
            let at = vec2i(id.xy * k + vec2u(x, y));
            let color = textureLoad(sample_colors, at, 0);
            sum += color;
            if color.a > 0.0 {
                let depth = textureLoad(sample_depths, at, 0).r;
                nearest = select(min(nearest, depth), depth, nearest == 0.0);
            }
        }
    }
    let pixel = id.y * size.x + id.x;
    image[pixel] = sum / f32(k * k);
    depths[pixel] = nearest;
}
