//! Which hand of a file is read, and what of the file is not.

use std::path::Path;

use ::gltf::{Gltf, Mesh, Node, Skin};
use ghand_core::Side;

use super::buffers::Buffers;
use super::cut::listed;
use super::hands::{Hand, hands};
use super::placement::joints_in_world;
use super::skeleton::Skeleton;
use super::{Source, no_skin};
use crate::HandModelError;
use crate::joints::names::{JointRole, side_in_name};
use crate::side::side_of_shape;

/// A mesh with its skin.
pub(super) struct Part<'a> {
    pub node: Node<'a>,
    pub mesh: Mesh<'a>,
    pub skin: Skin<'a>,
}

/// The hand that is read.
pub(super) struct Choice<'a> {
    pub skeleton: Skeleton<'a>,
    pub hand: Hand,
    /// The meshes that its skeleton moves, the largest first: where meshes have the same texels, the first has them.
    pub parts: Vec<Part<'a>>,
    /// Whether the skeleton has no other hand.
    pub is_only_hand: bool,
}

/// A hand that could be read.
struct Candidate {
    skeleton: usize,
    hand: Hand,
    side: Option<Side>,
    /// Vertices of the meshes that its skeleton moves.
    vertices: usize,
}

impl<'a> Choice<'a> {
    /// The hand of the wanted side, else the right one, else the first; of hands of one side, that with the most vertices.
    pub(super) fn of(
        file: &'a Gltf,
        wanted: Option<Side>,
        buffers: &Buffers,
        source: &Source,
        warnings: &mut Vec<String>,
    ) -> Result<Choice<'a>, HandModelError> {
        let parts = skinned_parts(file, warnings);
        let mut skins: Vec<Skin> = vec![];
        for part in &parts {
            if skins.iter().all(|skin| skin.index() != part.skin.index()) {
                skins.push(part.skin.clone());
            }
        }
        let skeletons = Skeleton::all(file, &skins, buffers, source)?;
        let vertices: Vec<usize> = skeletons.iter().map(|skeleton| vertices(skeleton, &parts)).collect();
        let mut candidates = vec![];
        for (k, skeleton) in skeletons.iter().enumerate() {
            for hand in hands(skeleton, source)? {
                let side = side(skeleton, &hand, &parts, file);
                candidates.push(Candidate { skeleton: k, hand, side, vertices: vertices[k] });
            }
        }
        if candidates.is_empty() {
            let Some(largest) = first_largest(&vertices) else { return Err(no_skin(source)) };
            let hand = Hand::whole(&skeletons[largest], source)?;
            candidates.push(Candidate { skeleton: largest, hand, side: None, vertices: vertices[largest] });
        }
        let preference = |candidate: &Candidate| match (wanted, candidate.side) {
            (Some(wanted), side) => usize::from(side == Some(wanted)),
            (None, Some(Side::Right)) => 2,
            (None, Some(Side::Left)) => 1,
            (None, None) => 0,
        };
        let best = candidates.iter().map(|c| (preference(c), c.vertices)).max().unwrap_or_default();
        let at = candidates.iter().position(|c| (preference(c), c.vertices) == best).unwrap_or(0);
        let chosen = candidates.swap_remove(at);
        let others_here = candidates.iter().filter(|other| other.skeleton == chosen.skeleton).count();
        let names = |other: &Candidate| {
            let own = parts.iter().filter(|part| moves(&skeletons[other.skeleton], part));
            listed(&own.map(Part::name).collect::<Vec<_>>())
        };
        warnings.extend(candidates.iter().filter_map(|other| told_of(other, &names(other), &chosen, wanted, source)));
        let (mut own, apart): (Vec<_>, Vec<_>) =
            parts.into_iter().partition(|part| moves(&skeletons[chosen.skeleton], part));
        own.sort_by_key(|part| std::cmp::Reverse(part.vertices()));
        let has_hand = |part: &Part| candidates.iter().any(|other| moves(&skeletons[other.skeleton], part));
        let unread: Vec<String> = apart.iter().filter(|part| !has_hand(part)).map(Part::name).collect();
        if !unread.is_empty() {
            warnings.push(format!("meshes of other skeletons are not read: {}", listed(&unread)));
        }
        let Some(skeleton) = skeletons.into_iter().nth(chosen.skeleton) else { return Err(no_skin(source)) };
        Ok(Choice { skeleton, hand: chosen.hand, parts: own, is_only_hand: others_here == 0 })
    }

    /// What is said of meshes and joints: which are read as one hand, and which are not of it. Of the vertices, those
    /// before `ends[k]` and not before `ends[k - 1]` are of part `k`; `kept` are those of the hand.
    pub(super) fn told_of_parts(&self, ends: &[usize], kept: &[bool]) -> Vec<String> {
        let mut told = vec![];
        let starts = [0].into_iter().chain(ends.iter().copied());
        let is_read = |(start, end): (usize, &usize)| kept.get(start..*end).is_some_and(|own| own.contains(&true));
        let reads: Vec<bool> = starts.zip(ends).map(is_read).collect();
        let names = |wanted: bool| -> Vec<String> {
            self.parts.iter().zip(&reads).filter(|(_, read)| **read == wanted).map(|(part, _)| part.name()).collect()
        };
        let read = names(true);
        let unread = names(false);
        if read.len() > 1 {
            told.push(format!("{} meshes are read as one hand: {}", read.len(), listed(&read)));
        }
        if !unread.is_empty() {
            told.push(format!("meshes that do not follow the hand's joints are not read: {}", listed(&unread)));
        }
        let is_other = |joint: &usize| !self.hand.joints.contains(joint);
        let others: Vec<String> =
            (0..self.skeleton.names.len()).filter(is_other).map(|k| self.skeleton.names[k].clone()).collect();
        if !others.is_empty() {
            told.push(format!("joints that are not of the hand are not read: {}", listed(&others)));
        }
        told
    }

    /// Names that may tell the side, the most reliable first; that of the file, which may be anything, comes last.
    pub(super) fn telling_names(&self, file: &Gltf, path: &Path) -> Vec<String> {
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let joints = self.hand.names(&self.skeleton);
        let above = self.hand.names_above(&self.skeleton, file);
        [joints, names_of_parts(&self.parts.iter().collect::<Vec<_>>()), above, stem.into_iter().collect()].concat()
    }
}

impl Part<'_> {
    fn vertices(&self) -> usize {
        let count = |primitive: ::gltf::Primitive| Some(primitive.get(&::gltf::Semantic::Positions)?.count());
        self.mesh.primitives().filter_map(count).fold(0, usize::saturating_add)
    }

    pub(super) fn name(&self) -> String {
        self.node.name().or(self.mesh.name()).unwrap_or("unnamed").to_owned()
    }
}

/// The meshes with skins. A mesh without one is not part of any hand, which is said.
fn skinned_parts<'a>(file: &'a Gltf, warnings: &mut Vec<String>) -> Vec<Part<'a>> {
    let mut parts: Vec<Part> = vec![];
    let mut plain = vec![];
    for node in file.nodes() {
        match (node.mesh(), node.skin()) {
            (Some(mesh), Some(skin)) => {
                let is_same = |part: &Part| (part.mesh.index(), part.skin.index()) == (mesh.index(), skin.index());
                if !parts.iter().any(is_same) {
                    parts.push(Part { node, mesh, skin });
                }
            }
            (Some(mesh), None) => plain.push(node.name().or(mesh.name()).unwrap_or("unnamed").to_owned()),
            _ => {}
        }
    }
    if !plain.is_empty() && !parts.is_empty() {
        warnings.push(format!("meshes without a skin are not read: {}", listed(&plain)));
    }
    parts
}

fn moves(skeleton: &Skeleton, part: &Part) -> bool {
    skeleton.skins.iter().any(|skin| skin.index == part.skin.index())
}

fn vertices(skeleton: &Skeleton, parts: &[Part]) -> usize {
    parts.iter().filter(|part| moves(skeleton, part)).map(Part::vertices).fold(0, usize::saturating_add)
}

fn first_largest(counts: &[usize]) -> Option<usize> {
    let largest = counts.iter().max()?;
    counts.iter().position(|count| count == largest)
}

/// The side of a hand from its shape, or else from names.
fn side(skeleton: &Skeleton, hand: &Hand, parts: &[Part], file: &Gltf) -> Option<Side> {
    let joints = hand.names(skeleton);
    let by_shape = side_of_shape(&JointRole::of_joints(&joints), &joints_in_world(skeleton, hand));
    let own: Vec<&Part> = parts.iter().filter(|part| moves(skeleton, part)).collect();
    let names = [joints, names_of_parts(&own), hand.names_above(skeleton, file)].concat();
    by_shape.or_else(|| names.iter().find_map(|name| side_in_name(name)))
}

fn names_of_parts(parts: &[&Part]) -> Vec<String> {
    let names = parts.iter().flat_map(|part| [part.node.name(), part.mesh.name(), part.skin.name()]);
    names.flatten().map(String::from).collect()
}

/// What is said of a hand that is not read; nothing if the user has chosen between sides.
fn told_of(
    other: &Candidate,
    meshes: &str,
    chosen: &Candidate,
    wanted: Option<Side>,
    source: &Source,
) -> Option<String> {
    match (chosen.side, other.side) {
        (Some(read), Some(side)) if side != read => wanted
            .is_none()
            .then(|| format!("has both hands; the {read} one is read, {}:{side} is the {side} one", source.name)),
        _ => Some(format!("has another hand that is not read ({meshes}); export the wanted one alone")),
    }
}
