//! Pictures of a posed hand model's mesh.

use std::str::FromStr;

use anyhow::bail;
use ghand_core::{Camera, HandModel};
use ghand_pictures::Picture;
use ghand_render::Gpu;
use ghand_render::mesh::weights::{heat_texture, joint_heat_uvs, joint_mix};
use ghand_render::mesh::{MeshInstance, MeshRenderer, MeshStyle, NEAR_PLANE, Shading, Surface, Wireframe};
use glam::DVec3;

use crate::bare_hand::{BareHand, studio_light};

/// How a mesh is drawn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PictureStyle {
    /// Skin in soft light.
    Solid,
    /// The edges that are not hidden by faces.
    Wireframe,
    /// The edges on faces in soft light.
    SolidWireframe,
    /// One colour per joint, mixed by skinning weight.
    Weights,
    /// The skinning weight of one joint, by name or number: grey for 0, then dark violet to yellow.
    JointWeights(String),
}

impl FromStr for PictureStyle {
    type Err = String;

    fn from_str(text: &str) -> Result<PictureStyle, String> {
        match (text, text.split_once('=')) {
            ("solid", _) => Ok(PictureStyle::Solid),
            ("wireframe", _) => Ok(PictureStyle::Wireframe),
            ("solid-wireframe", _) => Ok(PictureStyle::SolidWireframe),
            ("weights", _) => Ok(PictureStyle::Weights),
            (_, Some(("weights", joint))) => Ok(PictureStyle::JointWeights(joint.into())),
            _ => Err("must be solid, wireframe, solid-wireframe, weights, or weights=JOINT".into()),
        }
    }
}

/// Samples per pixel along each axis.
const SUPERSAMPLE: u32 = 4;
/// Faces below lines: plain, so that the lines stand out.
const PALE: DVec3 = DVec3::new(0.82, 0.83, 0.85);
/// Lines alone, and lines on faces, display values.
const LINES: DVec3 = DVec3::new(0.1, 0.12, 0.16);
/// Width of a line as a fraction of the median edge in the picture, and its bounds, pixels: faces of fine meshes stay
/// visible.
const LINE_SHARE: f64 = 0.08;
const LINE_WIDTHS: [f64; 2] = [0.5, 3.0];

/// Draws a hand model's mesh with its vertices at `positions` (world, metres) into a picture of the camera's size.
///
/// # Errors
/// An error that names the missing joint, or what cannot be drawn.
pub fn draw(
    gpu: &Gpu,
    model: &HandModel,
    positions: &[DVec3],
    camera: &Camera,
    style: &PictureStyle,
    picture: &mut Picture,
) -> anyhow::Result<()> {
    let joints = model.joint_count();
    if *style == PictureStyle::Solid {
        return draw_skin(gpu, model, positions, camera, picture);
    }
    let (colors, uvs, texture);
    let surface = match style {
        PictureStyle::Solid | PictureStyle::Wireframe | PictureStyle::SolidWireframe => Surface::Color(PALE),
        PictureStyle::Weights => {
            colors = joint_mix(&model.weights, joints)?;
            Surface::VertexColors(&colors)
        }
        PictureStyle::JointWeights(joint) => {
            uvs = joint_heat_uvs(&model.weights, joints, joint_number(model, joint)?)?;
            texture = heat_texture();
            Surface::Texture { uvs: &uvs, texture: &texture }
        }
    };
    let shading = match style {
        PictureStyle::Solid | PictureStyle::SolidWireframe => Shading::soft(camera, 0.4),
        // Colours have a meaning here: only enough shading to show the shape.
        PictureStyle::Weights | PictureStyle::JointWeights(_) => Shading::soft(camera, 0.55),
        PictureStyle::Wireframe => Shading::Transparent,
    };
    let has_lines = matches!(style, PictureStyle::Wireframe | PictureStyle::SolidWireframe);
    let width = line_width(model, positions, camera);
    let wireframe = has_lines.then_some(Wireframe { width, color: LINES });
    let mesh = MeshInstance {
        positions,
        normals: &model.vertex_normals(positions),
        light_visibility: None,
        triangles: &model.faces,
        surface,
    };
    let style = MeshStyle { supersample: SUPERSAMPLE, shading, wireframe };
    MeshRenderer::new(gpu)?.render_blocks(&mesh, camera, &style, |corner, block| picture.place_mesh(corner, &block))?;
    Ok(())
}

/// Draws skin and nails in soft light.
fn draw_skin(
    gpu: &Gpu,
    model: &HandModel,
    positions: &[DVec3],
    camera: &Camera,
    picture: &mut Picture,
) -> anyhow::Result<()> {
    let hand = BareHand::new(model.clone());
    let posed = hand.mesh_at(positions);
    let style = MeshStyle { supersample: SUPERSAMPLE, shading: studio_light(camera), wireframe: None };
    let place = |corner, block| picture.place_mesh(corner, &block);
    Ok(MeshRenderer::new(gpu)?.render_blocks(&hand.instance(&posed), camera, &style, place)?)
}

/// A line width, pixels, that suits the mesh as seen by the camera.
fn line_width(model: &HandModel, positions: &[DVec3], camera: &Camera) -> f64 {
    let [thinnest, widest] = LINE_WIDTHS;
    let pixels: Vec<_> = positions.iter().map(|p| camera.project(*p)).collect();
    let sides = model.faces.iter().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
    let ends = sides.filter_map(|side| {
        let [a, b] = side.map(|i| pixels.get(*i as usize));
        let (a, _) = a.filter(|p| p.1 > NEAR_PLANE)?;
        let (b, _) = b.filter(|p| p.1 > NEAR_PLANE)?;
        Some(a.distance(*b))
    });
    let mut lengths: Vec<f64> = ends.collect();
    lengths.sort_unstable_by(f64::total_cmp);
    lengths.get(lengths.len() / 2).map_or(thinnest, |median| (LINE_SHARE * median).clamp(thinnest, widest))
}

/// The joint of that name, else of that number, counted from 0.
fn joint_number(model: &HandModel, text: &str) -> anyhow::Result<usize> {
    let by_number = || text.parse().ok().filter(|k| *k < model.joint_count());
    match model.joint_index(text).or_else(by_number) {
        Some(joint) => Ok(joint),
        None => {
            bail!("--style weights={text}: the hand model has no such joint; it has {}", model.joint_names.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    #[test]
    fn styles_are_parsed_and_invalid_ones_rejected() {
        assert_eq!("weights=index1".parse(), Ok(PictureStyle::JointWeights("index1".into())));
        assert_eq!("solid-wireframe".parse(), Ok(PictureStyle::SolidWireframe));
        for text in ["", "Solid", "weight", "wireframe=2", "=index1"] {
            assert!(text.parse::<PictureStyle>().is_err(), "{text}");
        }
    }

    #[test]
    fn joints_are_found_by_name_or_number() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        assert_eq!(joint_number(&model, "thumb1").unwrap(), model.joint_index("thumb1").unwrap());
        assert_eq!(joint_number(&model, "15").unwrap(), 15);
        for text in ["16", "-1", "", "elbow"] {
            let error = joint_number(&model, text).unwrap_err().to_string();
            assert!(error.contains("--style") && error.contains("thumb1"), "{error}");
        }
    }
}
