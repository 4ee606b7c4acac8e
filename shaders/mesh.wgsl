// Textured or coloured, lit triangles at k times the image's size. Lines are drawn over them by `wireframe.wgsl`, and
// `mesh_resolve.wgsl` makes the image of both. CPU twin: `reference/mesh.rs`.

struct MeshUniforms {
    // clip_from_camera without its depth row: x_clip = clip_x.xy . (x, z), y_clip = clip_y.xy . (y, z).
    clip_x: vec4f,
    clip_y: vec4f,
    // x: near plane, metres; y: how far diffuse light wraps around; z: number of lights.
    settings: vec4f,
    // x: SHADING_*; y: SURFACE_*.
    modes: vec4u,
    ambient: vec4f,
    // Unit vectors towards the lights, world axes, and their colours.
    light_directions: array<vec4f, 4>,
    light_colors: array<vec4f, 4>,
}

const SHADING_UNLIT: u32 = 0u;
const SHADING_LIT: u32 = 1u;
const SHADING_TRANSPARENT: u32 = 2u;
const SURFACE_TEXTURE: u32 = 0u;
const SURFACE_COLOR: u32 = 1u;

@group(0) @binding(0) var<uniform> uniforms: MeshUniforms;
@group(0) @binding(1) var color_texture: texture_2d<f32>;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
    // UV and nothing, or a colour.
    @location(1) surface: vec3f,
    @location(2) depth: f32,
    @location(3) light_visibility: f32,
}

struct Targets {
    @location(0) color: vec4f,
    @location(1) depth: f32,
}

@vertex
fn vertex(
    @location(0) position_camera: vec3f,
    @location(1) normal_world: vec3f,
    @location(2) surface: vec3f,
    @location(3) light_visibility: f32,
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
    out.surface = surface;
    out.depth = z;
    out.light_visibility = light_visibility;
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
    if uniforms.modes.x == SHADING_TRANSPARENT {
        // Only the depth is kept, for lines to hide behind.
        return Targets(vec4f(0.0), in.depth);
    }
    var color = in.surface;
    if uniforms.modes.y == SURFACE_TEXTURE {
        color = sample_color(in.surface.xy);
    }
    if uniforms.modes.x == SHADING_LIT {
        color = min(color * shade(in.normal) * in.light_visibility, vec3f(1.0));
    }
    return Targets(vec4f(color, 1.0), in.depth);
}
