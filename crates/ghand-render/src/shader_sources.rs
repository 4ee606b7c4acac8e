//! The WGSL of every stage, composed from its pieces as the device gets it.
//!
//! Host parts take their source from here and nowhere else, so that what is checked without a device ([`baseline`], [`fast`]) is what
//! runs on one.

use crate::Tier;
use crate::pipeline::compose;

const CAMERA: &str = include_str!("../../../shaders/shared/camera.wgsl");
const GAUSSIAN: &str = include_str!("../../../shaders/shared/gaussian.wgsl");
const HARMONICS: &str = include_str!("../../../shaders/shared/spherical_harmonics.wgsl");
const SPLAT: &str = include_str!("../../../shaders/shared/splat.wgsl");
const POSE: &str = include_str!("../../../shaders/shared/pose.wgsl");
const ROTATION: &str = include_str!("../../../shaders/shared/rotation.wgsl");
const FOUR: &str = include_str!("../../../shaders/shared/four.wgsl");
const BONES: &str = include_str!("../../../shaders/shared/bones.wgsl");

/// Every source of this crate that the baseline tier can run, with its name.
pub fn baseline() -> Vec<(&'static str, String)> {
    vec![
        ("project", project()),
        ("project_backward", project_backward()),
        ("camera_gradient", camera_gradient()),
        ("bin", bin()),
        ("sort", sort()),
        ("scan", scan()),
        ("rasterize", rasterize(Tier::Baseline)),
        ("rasterize_backward", rasterize_backward(Tier::Baseline)),
        ("image_loss", image_loss()),
        ("skeleton", skeleton()),
        ("skeleton_backward", skeleton_backward()),
        ("blend_shapes", blend_shapes()),
        ("residual_skeleton", residual_skeleton()),
        ("skin", skin()),
        ("skin_backward", skin_backward()),
        ("joint_sums", joint_sums().to_owned()),
        ("adam", adam()),
        ("mesh", mesh().to_owned()),
        ("wireframe", wireframe().to_owned()),
        ("mesh_resolve", mesh_resolve().to_owned()),
        ("picture", picture().to_owned()),
    ]
}

/// Those of the fast tier, which take the place of baseline ones.
pub fn fast() -> Vec<(&'static str, String)> {
    vec![
        ("sort_blocks", sort_blocks()),
        ("scan_blocks", scan_blocks()),
        ("rasterize_fast", rasterize(Tier::Fast)),
        ("rasterize_backward_fast", rasterize_backward(Tier::Fast)),
    ]
}

/// Gaussians to splats, tile rectangles and depth keys.
pub fn project() -> String {
    compose(&[CAMERA, SPLAT, GAUSSIAN, HARMONICS, include_str!("../../../shaders/project.wgsl")])
}

/// Slot gradients to the gradient of the table of Gaussians.
pub fn project_backward() -> String {
    compose(&[CAMERA, GAUSSIAN, HARMONICS, include_str!("../../../shaders/project_backward.wgsl")])
}

/// The Gaussians' shares of the camera's gradient to their sum.
pub fn camera_gradient() -> String {
    compose(&[CAMERA, include_str!("../../../shaders/camera_gradient.wgsl")])
}

/// Which Gaussians each tile draws.
pub fn bin() -> String {
    compose(&[CAMERA, include_str!("../../../shaders/bin.wgsl")])
}

/// A stable radix sort.
pub fn sort() -> String {
    compose(&[include_str!("../../../shaders/sort.wgsl")])
}

/// The same by blocks, for the fast tier on hardware.
pub fn sort_blocks() -> String {
    compose(&[include_str!("../../../shaders/sort_blocks.wgsl")])
}

/// A prefix sum.
pub fn scan() -> String {
    compose(&[include_str!("../../../shaders/shared/scan.wgsl")])
}

/// The same by blocks, for the fast tier on hardware.
pub fn scan_blocks() -> String {
    compose(&[include_str!("../../../shaders/shared/scan_blocks.wgsl")])
}

/// Splats to the image.
pub fn rasterize(tier: Tier) -> String {
    let stage = match tier {
        Tier::Baseline => include_str!("../../../shaders/rasterize.wgsl"),
        Tier::Fast => include_str!("../../../shaders/rasterize_fast.wgsl"),
    };
    compose(&[CAMERA, SPLAT, include_str!("../../../shaders/shared/blend.wgsl"), stage])
}

/// The image's gradient to slot gradients.
pub fn rasterize_backward(tier: Tier) -> String {
    let stage = match tier {
        Tier::Baseline => include_str!("../../../shaders/rasterize_backward.wgsl"),
        Tier::Fast => include_str!("../../../shaders/rasterize_backward_fast.wgsl"),
    };
    compose(&[CAMERA, SPLAT, include_str!("../../../shaders/shared/blend_backward.wgsl"), stage])
}

/// L1 + SSIM with its gradient.
pub fn image_loss() -> String {
    compose(&[include_str!("../../../shaders/image_loss.wgsl")])
}

/// A pose to the posed chain.
pub fn skeleton() -> String {
    compose(&[POSE, ROTATION, include_str!("../../../shaders/skeleton.wgsl")])
}

/// Gradients of the bones to those of joints and pose.
pub fn skeleton_backward() -> String {
    compose(&[POSE, ROTATION, include_str!("../../../shaders/skeleton_backward.wgsl")])
}

/// Shape bases and coefficients to offsets, and back.
pub fn blend_shapes() -> String {
    compose(&[POSE, include_str!("../../../shaders/blend_shapes.wgsl")])
}

/// The residual skeleton's joints, and back.
pub fn residual_skeleton() -> String {
    compose(&[POSE, FOUR, include_str!("../../../shaders/residual_skeleton.wgsl")])
}

/// Corrected linear blend skinning.
pub fn skin() -> String {
    compose(&[POSE, FOUR, BONES, include_str!("../../../shaders/skin.wgsl")])
}

/// The gradient of skinning.
pub fn skin_backward() -> String {
    compose(&[POSE, FOUR, BONES, include_str!("../../../shaders/skin_backward.wgsl")])
}

/// Products of two tables summed over the Gaussians.
pub fn joint_sums() -> &'static str {
    include_str!("../../../shaders/joint_sums.wgsl")
}

/// Adam on a range of a parameter table.
pub fn adam() -> String {
    compose(&[include_str!("../../../shaders/adam.wgsl")])
}

/// A mesh's faces to samples.
pub fn mesh() -> &'static str {
    include_str!("../../../shaders/mesh.wgsl")
}

/// A mesh's edges to samples.
pub fn wireframe() -> &'static str {
    include_str!("../../../shaders/wireframe.wgsl")
}

/// Samples of faces and edges to the image.
pub fn mesh_resolve() -> &'static str {
    include_str!("../../../shaders/mesh_resolve.wgsl")
}

/// The splatter's image as a texture, for a user interface.
pub fn picture() -> &'static str {
    include_str!("../../../shaders/picture.wgsl")
}
