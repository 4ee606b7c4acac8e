//! The joints of a glTF skin: their names, hierarchy, order and rest positions.

use std::collections::HashMap;

use ::gltf::{Gltf, Node, Skin};
use glam::{DMat4, DVec3};

use super::Source;
use super::buffers::Buffers;
use crate::HandModelError;

/// The joints of a WebXR hand: parents precede their children, and each finger hangs from the wrist.
pub(super) const WEBXR_JOINTS: [&str; 25] = [
    "wrist",
    "thumb-metacarpal",
    "thumb-phalanx-proximal",
    "thumb-phalanx-distal",
    "thumb-tip",
    "index-finger-metacarpal",
    "index-finger-phalanx-proximal",
    "index-finger-phalanx-intermediate",
    "index-finger-phalanx-distal",
    "index-finger-tip",
    "middle-finger-metacarpal",
    "middle-finger-phalanx-proximal",
    "middle-finger-phalanx-intermediate",
    "middle-finger-phalanx-distal",
    "middle-finger-tip",
    "ring-finger-metacarpal",
    "ring-finger-phalanx-proximal",
    "ring-finger-phalanx-intermediate",
    "ring-finger-phalanx-distal",
    "ring-finger-tip",
    "pinky-finger-metacarpal",
    "pinky-finger-phalanx-proximal",
    "pinky-finger-phalanx-intermediate",
    "pinky-finger-phalanx-distal",
    "pinky-finger-tip",
];

/// Most joints of a skin: ten WebXR hands in one armature.
const MAX_JOINTS: usize = 256;

/// Joints in the model's order.
pub(super) struct Rig {
    pub names: Vec<String>,
    pub parents: Vec<Option<usize>>,
    /// Rest positions, metres, in the mesh's axes.
    pub positions: Vec<DVec3>,
    /// Index of each joint of the skin in the model; `None` for a joint that is omitted.
    pub model_from_skin: Vec<Option<usize>>,
}

impl Rig {
    pub(super) fn read(file: &Gltf, skin: &Skin, buffers: &Buffers, source: &Source) -> Result<Rig, HandModelError> {
        let nodes: Vec<Node> = skin.joints().take(MAX_JOINTS + 1).collect();
        if nodes.len() > MAX_JOINTS {
            let problem = format!("has more than {MAX_JOINTS} joints; export only the hand's armature");
            return Err(source.invalid("skin", problem));
        }
        // Without them, each part of the mesh is in the axes of its joint, and there is no common rest surface.
        let accessor = skin.inverse_bind_matrices().ok_or_else(|| {
            source.invalid("inverseBindMatrices", "are missing; export the armature in its bind pose".into())
        })?;
        let matrices = buffers.floats::<16>(&accessor, "inverseBindMatrices")?;
        if nodes.is_empty() || matrices.len() != nodes.len() {
            let problem = format!("{} for {} joints; export the hand again", matrices.len(), nodes.len());
            return Err(source.invalid("inverseBindMatrices", problem));
        }
        let mut skin_positions = Vec::with_capacity(nodes.len());
        for (k, matrix) in matrices.iter().enumerate() {
            let position = DMat4::from_cols_array(&matrix.map(f64::from)).inverse().w_axis.truncate();
            if !position.is_finite() {
                return Err(source.invalid("inverseBindMatrices", format!("that of joint {k} cannot be inverted")));
            }
            skin_positions.push(position);
        }
        let name = |k: usize| nodes[k].name().map_or_else(|| format!("joint{k}"), String::from);
        let (order, parents) = match webxr_order(&nodes, source)? {
            Some(order) => (order, (0..WEBXR_JOINTS.len()).map(webxr_parent).collect()),
            None => tree_order(file, &nodes, source)?,
        };
        let mut model_from_skin = vec![None; nodes.len()];
        for (to, &from) in order.iter().enumerate() {
            model_from_skin[from] = Some(to);
        }
        Ok(Rig {
            names: order.iter().map(|&k| name(k)).collect(),
            parents,
            positions: order.iter().map(|&k| skin_positions[k]).collect(),
            model_from_skin,
        })
    }
}

/// Parent of a joint of [`WEBXR_JOINTS`].
fn webxr_parent(joint: usize) -> Option<usize> {
    match joint {
        0 => None,
        k if WEBXR_JOINTS[k].ends_with("-metacarpal") => Some(0),
        k => Some(k - 1),
    }
}

/// Joints of the skin in the order of [`WEBXR_JOINTS`]; `None` if the rig has other names.
fn webxr_order(nodes: &[Node], source: &Source) -> Result<Option<Vec<usize>>, HandModelError> {
    let find = |name: &str| nodes.iter().position(|node| node.name() == Some(name));
    let found: Vec<Option<usize>> = WEBXR_JOINTS.iter().map(|name| find(name)).collect();
    // Rigs of other kinds may also have a joint called "wrist".
    if found.iter().flatten().count() <= 1 {
        return Ok(None);
    }
    let missing = WEBXR_JOINTS.iter().zip(&found).find(|(_, at)| at.is_none());
    match missing {
        Some((name, _)) => {
            Err(source.invalid("skin", format!("has WebXR joints but no '{name}'; export all 25 joints of the hand")))
        }
        None => Ok(Some(found.into_iter().flatten().collect())),
    }
}

type Order = (Vec<usize>, Vec<Option<usize>>);

/// The node tree as the hierarchy. A joint's parent is its nearest ancestor that is a joint of the skin.
fn tree_order(file: &Gltf, nodes: &[Node], source: &Source) -> Result<Order, HandModelError> {
    let joint_of_node: HashMap<usize, usize> = nodes.iter().enumerate().map(|(k, node)| (node.index(), k)).collect();
    let mut node_parents: Vec<Option<usize>> = vec![None; file.nodes().len()];
    for node in file.nodes() {
        for child in node.children() {
            node_parents[child.index()] = Some(node.index());
        }
    }
    let parent = |node: &Node| {
        // A damaged tree may have a cycle; no valid path is longer than the number of nodes.
        let mut ancestors = std::iter::successors(node_parents[node.index()], |&n| node_parents[n]);
        ancestors.by_ref().take(node_parents.len()).find_map(|n| joint_of_node.get(&n).copied())
    };
    let skin_parents: Vec<Option<usize>> = nodes.iter().map(parent).collect();
    let roots: Vec<usize> = (0..nodes.len()).filter(|&k| skin_parents[k].is_none()).collect();
    if roots.len() != 1 {
        let names: Vec<&str> = roots.iter().take(4).map(|&k| nodes[k].name().unwrap_or("unnamed")).collect();
        let problem = format!(
            "has {} root joints ({}); use WebXR's joint names, or parent all joints to the wrist",
            roots.len(),
            names.join(", ")
        );
        return Err(source.invalid("skin", problem));
    }
    let mut order: Vec<usize> = Vec::with_capacity(nodes.len());
    let mut placed = vec![None; nodes.len()];
    while order.len() < nodes.len() {
        let next = (0..nodes.len())
            .find(|&k| placed[k].is_none() && skin_parents[k].is_none_or(|parent: usize| placed[parent].is_some()));
        let Some(next) = next else {
            return Err(source.invalid("nodes", "form a cycle; the file is damaged, export it again".into()));
        };
        placed[next] = Some(order.len());
        order.push(next);
    }
    let parents = order.iter().map(|&k| skin_parents[k].and_then(|parent| placed[parent])).collect();
    Ok((order, parents))
}
