// The view that a frame is splatted from. Host twin: `ghand_render::splat::View`.
struct View {
    // camera_from_world, row by row: xyz rotation, w translation (metres).
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    // Focal lengths and principal point in pixels; the centre of pixel (0, 0) is (0.5, 0.5).
    focal: vec2<f32>,
    principal: vec2<f32>,
    // Colour behind everything.
    background: vec4<f32>,
    // Image size in pixels and in tiles.
    size: vec2<u32>,
    tiles: vec2<u32>,
    // Bounds of x/z and y/z in the projection's Jacobian.
    slope_min: vec2<f32>,
    slope_max: vec2<f32>,
    gaussian_count: u32,
    intersection_capacity: u32,
    // Near plane, metres.
    near: f32,
    // Opacity that all Gaussians share.
    opacity: f32,
    // If this frame is a band of a larger image: its first row there, a multiple of TILE_SIZE. Projected positions are
    // those of the larger image, to the bit; `size` and `tiles` are the band's.
    first_row: u32,
    padding_1: u32,
    padding_2: u32,
    padding_3: u32,
}

@group(0) @binding(0) var<uniform> view: View;

const TILE_SIZE: u32 = 8u;
// Screen-space blur added to every projected covariance, pixels^2: as 3D Gaussian Splatting has it, and as Mip-Splatting has
// it.
const BLUR: f32 = 0.3;
const NARROW_BLUR: f32 = 0.1;
// Less alpha is not blended.
override ALPHA_MIN: f32 = 1.0 / 255.0;
const ALPHA_MAX: f32 = 0.99;
// Blending of a pixel ends before the splat that would reduce its transmittance to this or less.
const TRANSMITTANCE_MIN: f32 = 1e-4;

fn camera_from_world(view: View, p: vec3<f32>) -> vec3<f32> {
    return vec3(dot(view.row_x.xyz, p) + view.row_x.w,
                dot(view.row_y.xyz, p) + view.row_y.w,
                dot(view.row_z.xyz, p) + view.row_z.w);
}
