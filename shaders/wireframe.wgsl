// Edges of a mesh as lines of constant width, each a rectangle around its centre line: the part of a sample that visible
// lines cover. CPU twin: `reference/wireframe.rs`.

struct WireframeUniforms {
    // Size of the target, samples.
    size: vec2f,
    // Half the width of a line, samples.
    half_width: f32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> uniforms: WireframeUniforms;
// Camera z of the faces, 0 where there is none.
@group(0) @binding(1) var face_depths: texture_2d<f32>;

struct Varyings {
    @builtin(position) clip: vec4f,
    // Both ends, samples.
    @location(0) @interpolate(flat) ends: vec4f,
    // Inverse depth at both ends, and how much smaller it may be than that of a face that the line lies on.
    @location(1) @interpolate(flat) inverse_depths: vec3f,
}

@vertex
fn line_vertex(
    @builtin(vertex_index) index: u32,
    @location(0) ends: vec4f,
    @location(1) inverse_depths: vec3f,
) -> Varyings {
    let along = ends.zw - ends.xy;
    let extent = length(along);
    // For an edge seen end on, or without length, any direction works.
    let direction = select(vec2f(1.0, 0.0), along / max(extent, 1e-12), extent > 1e-6);
    // Half a sample wider than the line, for its smooth edge.
    let reach = uniforms.half_width + 0.5;
    let side = vec2f(-direction.y, direction.x) * select(-reach, reach, (index & 1u) == 1u);
    let corner = select(ends.xy - direction * reach, ends.zw + direction * reach, index >= 2u) + side;
    var out: Varyings;
    out.clip = vec4f(corner / uniforms.size * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0), 0.0, 1.0);
    out.ends = ends;
    out.inverse_depths = inverse_depths;
    return out;
}

// Coverage by a line that no face hides. Targets keep the larger value, so that lines that meet or overlap are drawn
// once, in any order.
@fragment
fn line_coverage(in: Varyings) -> @location(0) f32 {
    let at = in.clip.xy;
    let start = in.ends.xy;
    let along = in.ends.zw - start;
    let squared = dot(along, along);
    let t = select(0.0, saturate(dot(at - start, along) / squared), squared > 1e-12);
    let middle = start + t * along;
    let distance = length(at - middle);
    // The part of a sample's width, centred at that distance, that is within the line: thin lines fade, so that total
    // coverage is proportional to width.
    let half_width = uniforms.half_width;
    let coverage = saturate(min(distance + 0.5, half_width) - max(distance - 0.5, -half_width));
    let inverse_depth = mix(in.inverse_depths.x, in.inverse_depths.y, t);

    // Visible if no face is nearer at one of the four samples around the centre line: the centre line decides for the
    // whole width.
    let base = vec2i(floor(middle - 0.5));
    let last = vec2i(uniforms.size) - 1;
    var in_sight = false;
    for (var i = 0; i < 4; i++) {
        let z = textureLoad(face_depths, clamp(base + vec2i(i & 1, i >> 1u), vec2i(0), last), 0).r;
        let face = select(1.0 / z, 0.0, z == 0.0);
        in_sight = in_sight || inverse_depth + in.inverse_depths.z >= face;
    }
    return select(0.0, coverage, in_sight);
}
