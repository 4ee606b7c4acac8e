//! Facts about a hand model for its user, and unusual properties.

use std::collections::HashMap;

use ghand_core::HandModel;
use glam::DVec3;

use crate::joint_names::JointRole;
use crate::surface::sample_surface;

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
    /// Unusual properties, each with its consequence.
    pub warnings: Vec<String>,
}

/// Inspects a valid model.
pub fn inspect(model: &HandModel) -> Inspection {
    let mut warnings = Vec::new();
    let low = model.vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = model.vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let longest = (high - low).max_element();
    if !HAND_SIZE.contains(&longest) {
        warnings
            .push(format!("is {longest:.4} m long, which is not the size of a hand; its unit may not be the metre"));
    }
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
    let mut edges: HashMap<[u32; 2], usize> = HashMap::new();
    for &[a, b, c] in &model.faces {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry([edge[0].min(edge[1]), edge[0].max(edge[1])]).or_default() += 1;
        }
    }
    let crowded = edges.values().filter(|uses| **uses > 2).count();
    if crowded > 0 {
        warnings.push(format!("{crowded} edges belong to more than two triangles; the surface is not a manifold"));
    }
    let flat = model.faces.iter().filter(|face| area(model, **face) == 0.0).count();
    if flat > 0 {
        warnings.push(format!("{flat} triangles have no area"));
    }
    let mut texels = Vec::new();
    let mut uv_fill = 0.0;
    for resolution in RESOLUTIONS {
        match sample_surface(model, resolution) {
            Ok(samples) => {
                texels.push((resolution, samples.len()));
                uv_fill = samples.len() as f64 / f64::from(resolution).powi(2);
                if samples.overlaps > 0 && RESOLUTIONS.last() == Some(&resolution) {
                    let count = samples.overlaps;
                    warnings.push(format!(
                        "the UV atlas overlaps itself at {count} texels of {resolution}; parts of \
                                           the hand get no Gaussians, unwrap it again"
                    ));
                }
            }
            Err(_) => texels.push((resolution, 0)),
        }
    }
    if texels.last().is_none_or(|(_, count)| *count == 0) {
        warnings.push("the UV atlas has no texels in [0, 1]^2; unwrap it again".into());
    }
    let boundary_edges = edges.values().filter(|uses| **uses == 1).count();
    Inspection { low, high, boundary_edges, texels, uv_fill, warnings }
}

fn area(model: &HandModel, face: [u32; 3]) -> f64 {
    let [a, b, c] = face.map(|i| model.vertices[i as usize]);
    0.5 * (b - a).cross(c - a).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedural::ProceduralHand;

    #[test]
    fn the_built_in_hand_is_closed_and_gives_no_warning() {
        let found = inspect(&ProceduralHand::default().build().unwrap());
        assert_eq!((found.boundary_edges, &found.warnings[..]), (0, &[][..]));
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
            let warnings = inspect(&model).warnings.join("; ");
            assert!(warnings.contains(expected), "wanted {expected:?}, got {warnings:?}");
        };
        warned(|m| m.vertices.iter_mut().for_each(|v| *v *= 1000.0), "unit may not be the metre");
        warned(|m| m.joints[3].x += 1.0, "index3 is outside");
        warned(|m| m.weights.chunks_exact_mut(16).for_each(|w| w[0] += std::mem::take(&mut w[5])), "follows middle2");
        warned(|m| m.faces.push(m.faces[0]), "more than two");
        warned(|m| m.faces[0][1] = m.faces[0][0], "1 triangles have no area");
        warned(|m| m.face_uvs.copy_within(..200, 200), "overlaps itself");
        warned(|m| m.uvs.fill(glam::DVec2::splat(3.0)), "no texels");
    }
}
