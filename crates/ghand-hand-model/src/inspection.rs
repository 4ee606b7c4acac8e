//! Facts about a hand model for its user, and unusual properties.

use std::collections::HashMap;

use ghand_core::HandModel;
use glam::DVec3;

use crate::joints::names::{JointRole, unidentified};
use crate::surface::count_texels;

/// Resolutions at which texels are counted.
const RESOLUTIONS: [u32; 5] = [64, 128, 256, 512, 1024];

/// Plausible range of the bounding box's longest edge, metres: from a child's hand without a forearm to an adult's
/// with.
const HAND_SIZE: std::ops::Range<f64> = 0.08..0.5;

/// Facts about a hand model.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// Lower corner of the bounding box of the rest pose, metres.
    pub low: DVec3,
    /// Upper corner, metres.
    pub high: DVec3,
    /// Edges that only one triangle has.
    pub boundary_edges: usize,
    /// Number of Gaussians that each UV resolution gives.
    pub texels: Vec<(u32, usize)>,
    /// Fraction of the UV square that the atlas covers.
    pub uv_fill: f64,
}

/// Inspects a valid model.
pub fn inspect(model: &HandModel) -> Inspection {
    let (low, high) = bounds(model);
    let texels: Vec<(u32, usize)> = RESOLUTIONS
        .iter()
        .map(|&resolution| (resolution, count_texels(model, resolution).map_or(0, |[texels, _]| texels)))
        .collect();
    let uv_fill = texels.last().map_or(0.0, |(resolution, count)| *count as f64 / f64::from(*resolution).powi(2));
    let boundary_edges = edge_uses(model).values().filter(|uses| **uses == 1).count();
    Inspection { low, high, boundary_edges, texels, uv_fill }
}

/// Unusual properties of a valid model, each with its consequence.
pub fn warnings(model: &HandModel) -> Vec<String> {
    let mut warnings = Vec::new();
    let (low, high) = bounds(model);
    let longest = (high - low).max_element();
    if !HAND_SIZE.contains(&longest) {
        warnings
            .push(format!("is {longest:.4} m long, which is not the size of a hand; its unit may not be the metre"));
    }
    warnings.extend(unidentified(&model.joint_names));
    let margin = 0.1 * longest;
    for (name, joint) in model.joint_names.iter().zip(&model.joints) {
        if joint.cmplt(low - margin).any() || joint.cmpgt(high + margin).any() {
            warnings.push(format!("joint {name} is outside the hand; the skeleton may be in another frame"));
        }
    }
    let joints = model.joint_count();
    // A joint at a fingertip only marks it.
    let roles = JointRole::of_joints(&model.joint_names);
    let idle: Vec<&str> = (0..joints)
        .filter(|k| !matches!(roles[*k], Some(JointRole::Tip(_))))
        .filter(|k| model.weights.iter().skip(*k).step_by(joints).all(|w| *w == 0.0))
        .map(|k| model.joint_names[k].as_str())
        .collect();
    if !idle.is_empty() {
        warnings.push(format!("no vertex follows {}; rotating it alone has no visible effect", idle.join(", ")));
    }
    let crowded = edge_uses(model).values().filter(|uses| **uses > 2).count();
    if crowded > 0 {
        warnings.push(format!("{crowded} edges belong to more than two triangles; the surface is not a manifold"));
    }
    let flat = model.faces.iter().filter(|face| area(model, **face) == 0.0).count();
    if flat > 0 {
        warnings.push(format!("{flat} triangles have no area"));
    }
    warnings.extend(atlas_warning(model));
    warnings
}

/// What is wrong with the UV atlas, at the highest resolution.
fn atlas_warning(model: &HandModel) -> Option<String> {
    let resolution = *RESOLUTIONS.last()?;
    match count_texels(model, resolution) {
        Ok([_, overlaps]) if overlaps > 0 => Some(format!(
            "the UV atlas overlaps itself at {overlaps} texels of {resolution}; parts of the hand get no Gaussians, \
             unwrap it again"
        )),
        Ok(_) => None,
        Err(_) => Some("the UV atlas has no texels in [0, 1]^2; unwrap it again".into()),
    }
}

fn bounds(model: &HandModel) -> (DVec3, DVec3) {
    let points = || model.vertices.iter().copied();
    (points().fold(DVec3::INFINITY, DVec3::min), points().fold(DVec3::NEG_INFINITY, DVec3::max))
}

/// How many triangles have each edge.
fn edge_uses(model: &HandModel) -> HashMap<[u32; 2], usize> {
    let mut edges: HashMap<[u32; 2], usize> = HashMap::new();
    for &[a, b, c] in &model.faces {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry([edge[0].min(edge[1]), edge[0].max(edge[1])]).or_default() += 1;
        }
    }
    edges
}

fn area(model: &HandModel, face: [u32; 3]) -> f64 {
    let [a, b, c] = face.map(|i| model.vertices[i as usize]);
    0.5 * (b - a).cross(c - a).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ghand_test_support::procedural_hand::ProceduralHand;

    #[test]
    fn the_built_in_hand_is_closed_and_gives_no_warning() {
        let hand = ProceduralHand::default().build().unwrap();
        let found = inspect(&hand);
        assert_eq!((found.boundary_edges, warnings(&hand)), (0, vec![]));
        assert_eq!(found.texels.iter().map(|t| t.0).collect::<Vec<_>>(), RESOLUTIONS);
        // Four times as many texels at twice the resolution, except at the charts' borders.
        let growth = found.texels.windows(2).map(|pair| pair[1].1 as f64 / pair[0].1 as f64);
        assert!(growth.into_iter().all(|g| (3.8..4.2).contains(&g)), "{:?}", found.texels);
    }

    #[test]
    fn oddities_are_reported() {
        let sound = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let warned = |change: fn(&mut HandModel), expected: &str| {
            let mut model = sound.clone();
            change(&mut model);
            let warnings = warnings(&model).join("; ");
            assert!(warnings.contains(expected), "wanted {expected:?}, got {warnings:?}");
        };
        warned(|m| m.vertices.iter_mut().for_each(|v| *v *= 1000.0), "unit may not be the metre");
        warned(|m| m.joint_names[5] = "blob".into(), "do not tell middle 2");
        warned(|m| m.joints[3].x += 1.0, "index3 is outside");
        warned(|m| m.weights.chunks_exact_mut(16).for_each(|w| w[0] += std::mem::take(&mut w[5])), "follows middle2");
        warned(|m| m.faces.push(m.faces[0]), "more than two");
        warned(|m| m.faces[0][1] = m.faces[0][0], "1 triangles have no area");
        warned(|m| m.face_uvs.copy_within(..200, 200), "overlaps itself");
        warned(|m| m.uvs.fill(glam::DVec2::splat(3.0)), "no texels");
    }
}
