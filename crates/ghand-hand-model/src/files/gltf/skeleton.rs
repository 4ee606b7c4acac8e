//! The joints that one or more skins of a file share, and where its nodes and inverse bind matrices place them.

use std::collections::HashMap;

use ::gltf::scene::Transform;
use ::gltf::{Gltf, Node, Skin};
use glam::{DMat4, DQuat, DVec3};

use super::Source;
use super::buffers::Buffers;
use crate::HandModelError;

/// Most joints of a skeleton: ten WebXR hands in one armature.
const MAX_JOINTS: usize = 256;

/// Joints of skins with joints in common, in the order in which the skins list them.
pub(super) struct Skeleton<'a> {
    pub nodes: Vec<Node<'a>>,
    pub names: Vec<String>,
    /// The nearest ancestor in the node tree that is a joint.
    pub parents: Vec<Option<usize>>,
    /// Transforms of the nodes at rest.
    pub world_from_node: Vec<DMat4>,
    pub skins: Vec<BoundSkin>,
}

/// A skin of a skeleton.
pub(super) struct BoundSkin {
    /// Its index in the file.
    pub index: usize,
    /// The skeleton's joint for each of the skin's.
    pub joints: Vec<usize>,
    pub inverse_binds: Vec<DMat4>,
}

impl<'a> Skeleton<'a> {
    /// The skeletons of skins, in order; skins with a joint in common have the same one.
    pub(super) fn all(
        file: &'a Gltf,
        skins: &[Skin<'a>],
        buffers: &Buffers,
        source: &Source,
    ) -> Result<Vec<Skeleton<'a>>, HandModelError> {
        let tree = Tree::of(file);
        let mut groups: Vec<Vec<&Skin<'a>>> = vec![];
        for skin in skins {
            let shares = |group: &Vec<&Skin>| group.iter().any(|other| have_joint_in_common(skin, other));
            let (joined, apart): (Vec<_>, Vec<_>) = groups.into_iter().partition(shares);
            groups = apart;
            groups.push(joined.into_iter().flatten().chain([skin]).collect());
        }
        groups.iter_mut().for_each(|group| group.sort_by_key(|skin| skin.index()));
        groups.sort_by_key(|group| group.first().map(|skin| skin.index()));
        groups.iter().map(|group| Skeleton::of(group, &tree, buffers, source)).collect()
    }

    fn of(
        skins: &[&Skin<'a>],
        tree: &Tree,
        buffers: &Buffers,
        source: &Source,
    ) -> Result<Skeleton<'a>, HandModelError> {
        let mut nodes: Vec<Node<'a>> = vec![];
        let mut joint_of_node: HashMap<usize, usize> = HashMap::new();
        let mut bound = vec![];
        for skin in skins {
            let mut joints = vec![];
            for node in skin.joints() {
                joints.push(*joint_of_node.entry(node.index()).or_insert_with(|| {
                    nodes.push(node.clone());
                    nodes.len() - 1
                }));
                if nodes.len() > MAX_JOINTS {
                    let problem = format!("has more than {MAX_JOINTS} joints; export only the hand's armature");
                    return Err(source.invalid("skin", problem));
                }
            }
            bound.push(BoundSkin {
                index: skin.index(),
                inverse_binds: inverse_binds(skin, joints.len(), buffers, source)?,
                joints,
            });
        }
        let name = |(k, node): (usize, &Node)| node.name().map_or_else(|| format!("joint{k}"), String::from);
        Ok(Skeleton {
            names: nodes.iter().enumerate().map(name).collect(),
            parents: nodes
                .iter()
                .map(|node| tree.ancestors(node.index()).find_map(|n| joint_of_node.get(&n).copied()))
                .collect(),
            world_from_node: nodes.iter().map(|node| tree.world_from_node(node.index())).collect(),
            nodes,
            skins: bound,
        })
    }

    /// The transform of a skin's mesh to the world at rest, as its binding to that joint has it; of a joint that the skin
    /// does not have, that of its first one.
    pub(super) fn world_from_mesh(&self, skin: &BoundSkin, joint: usize) -> DMat4 {
        let at = skin.joints.iter().position(|own| *own == joint).unwrap_or(0);
        match (skin.joints.get(at), skin.inverse_binds.get(at)) {
            (Some(&joint), Some(bind)) => self.world_from_node[joint] * *bind,
            _ => DMat4::IDENTITY,
        }
    }

    /// Where a joint was bound, in the axes of a skin's mesh; the first skin that has it, with its place among the skins.
    pub(super) fn bind_position(&self, joint: usize) -> Option<(usize, DVec3)> {
        self.skins.iter().enumerate().find_map(|(k, skin)| {
            let at = skin.joints.iter().position(|own| *own == joint)?;
            Some((k, skin.inverse_binds.get(at)?.inverse().w_axis.truncate()))
        })
    }

    /// Joint indices with parents before their children, else in the file's order.
    pub(super) fn order(&self, parents: &[Option<usize>], source: &Source) -> Result<Vec<usize>, HandModelError> {
        let mut order: Vec<usize> = Vec::with_capacity(parents.len());
        let mut placed = vec![false; parents.len()];
        while order.len() < parents.len() {
            let next = (0..parents.len()).find(|&k| !placed[k] && parents[k].is_none_or(|parent| placed[parent]));
            let Some(next) = next else {
                return Err(source.invalid("nodes", "form a cycle; the file is damaged, export it again".into()));
            };
            placed[next] = true;
            order.push(next);
        }
        Ok(order)
    }

    /// Names of the nodes above a joint, the nearest first.
    pub(super) fn names_above(&self, file: &'a Gltf, joint: usize) -> Vec<String> {
        let tree = Tree::of(file);
        let name = |node: usize| file.nodes().nth(node)?.name().map(String::from);
        tree.ancestors(self.nodes[joint].index()).filter_map(name).collect()
    }
}

fn have_joint_in_common(a: &Skin, b: &Skin) -> bool {
    let of_a: Vec<usize> = a.joints().map(|node| node.index()).collect();
    b.joints().any(|node| of_a.contains(&node.index()))
}

fn inverse_binds(skin: &Skin, joints: usize, buffers: &Buffers, source: &Source) -> Result<Vec<DMat4>, HandModelError> {
    // Without them, each part of the mesh is in the axes of its joint, and there is no common rest surface.
    let accessor = skin.inverse_bind_matrices().ok_or_else(|| {
        source.invalid("inverseBindMatrices", "are missing; export the armature in its bind pose".into())
    })?;
    let matrices = buffers.floats::<16>(&accessor, "inverseBindMatrices")?;
    if joints == 0 || matrices.len() != joints {
        let problem = format!("{} for {joints} joints; export the hand again", matrices.len());
        return Err(source.invalid("inverseBindMatrices", problem));
    }
    let matrix = |(k, matrix): (usize, &[f32; 16])| {
        let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
        let position = matrix.inverse().w_axis;
        let unusable = || source.invalid("inverseBindMatrices", format!("that of joint {k} cannot be inverted"));
        position.is_finite().then_some(matrix).ok_or_else(unusable)
    };
    matrices.iter().enumerate().map(matrix).collect()
}

/// The node tree.
struct Tree {
    parents: Vec<Option<usize>>,
    parent_from_node: Vec<DMat4>,
}

impl Tree {
    fn of(file: &Gltf) -> Tree {
        let mut parents = vec![None; file.nodes().len()];
        for node in file.nodes() {
            node.children().for_each(|child| parents[child.index()] = Some(node.index()));
        }
        Tree { parents, parent_from_node: file.nodes().map(|node| parent_from_node(node.transform())).collect() }
    }

    /// The nodes above a node. A damaged tree may have a cycle; no valid path is longer than the number of nodes.
    fn ancestors(&self, node: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(self.parents[node], |&n| self.parents[n]).take(self.parents.len())
    }

    fn world_from_node(&self, node: usize) -> DMat4 {
        self.ancestors(node).fold(self.parent_from_node[node], |below, above| self.parent_from_node[above] * below)
    }
}

fn parent_from_node(transform: Transform) -> DMat4 {
    match transform {
        Transform::Matrix { matrix } => DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from))),
        Transform::Decomposed { translation, rotation, scale } => DMat4::from_scale_rotation_translation(
            super::dvec3(scale),
            DQuat::from_array(rotation.map(f64::from)).normalize(),
            super::dvec3(translation),
        ),
    }
}
