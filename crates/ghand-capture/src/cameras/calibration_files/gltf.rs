//! Cameras of glTF scenes, as Blender exports them. They look along -z with y up; lengths are metres.
//!
//! Only the JSON part is read, and of it nodes and cameras. A camera's resolution is not in it.

use std::io::Read;
use std::path::Path;

use ghand_files::input_file;
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

use super::field::Field;
use super::found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit, Projection};
use super::node::Node;
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;
use crate::reading::validation::FileValidator;

/// Largest JSON part; those of scenes without images in them are far smaller.
const LARGEST_JSON: u32 = 1 << 24;
/// Older exporters of Blender turn the camera in a node of its own below the one with the user's name.
const TURNED: &str = "_Orientation";

pub(super) fn recognises_bytes(bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
}

pub(super) fn recognises(node: &Node) -> bool {
    ["asset", "nodes"].iter().all(|name| node.get(name).is_some())
}

/// The content of the JSON part of a `.glb` file; what else it holds may have any size.
pub(super) fn node_of_glb(path: &Path) -> Result<Node, CaptureError> {
    let invalid = |problem: &str| FileValidator { path }.invalid("file", problem);
    let damaged = || invalid("is a damaged GLB file; export it again");
    let read = || -> std::io::Result<Option<Vec<u8>>> {
        let mut file = input_file::open(path)?;
        let mut head = [0; 20];
        file.read_exact(&mut head)?;
        let [.., a, b, c, d, b'J', b'S', b'O', b'N'] = head else { return Ok(None) };
        let length = u32::from_le_bytes([a, b, c, d]);
        let mut json = vec![];
        if length <= LARGEST_JSON {
            file.take(u64::from(length)).read_to_end(&mut json)?;
        }
        Ok((json.len() as u64 == u64::from(length)).then_some(json))
    };
    let json = read().ok().flatten().ok_or_else(damaged)?;
    let text = String::from_utf8(json).map_err(|_| damaged())?;
    Node::parse(text.trim_end()).map_err(|problem| invalid(&problem))
}

pub(super) fn read(path: &Path, node: &Node) -> Result<FoundCalibration, CaptureError> {
    let root = Field::root(path, node);
    let nodes = root.require("nodes")?.items()?;
    let lenses = match root.find("cameras") {
        Some(cameras) => cameras.items()?,
        None => vec![],
    };
    let mut remarks = vec!["axes are turned from glTF's to OpenCV's; the world's y axis points up".into()];
    let mut cameras = vec![];
    for Placed { node, parent, world } in placed(&nodes)? {
        let Some(lens) = node.find("camera") else { continue };
        let index = lens.whole()? as usize;
        let Some(lens) = lenses.get(index) else {
            return Err(
                lens.invalid(format!("is {index}, but there are {} cameras; export the scene again", lenses.len()))
            );
        };
        let name = |field: &Field| field.find("name").map(|name| name.text()).transpose();
        let id = match (name(&node)?, parent) {
            (Some(own), Some(parent)) if own.ends_with(TURNED) => name(parent)?.unwrap_or(own),
            (Some(own), _) => own,
            (None, _) => name(lens)?.unwrap_or_else(|| format!("camera{index}")),
        };
        let Some(perspective) = lens.find("perspective") else {
            remarks.push(format!("{id} is not read, because it has no perspective"));
            continue;
        };
        cameras.push(FoundCamera {
            id,
            size: None,
            projection: Projection::FieldOfView {
                vertical: perspective.require("yfov")?.number()?,
                aspect: perspective.find("aspectRatio").map(|aspect| aspect.number()).transpose()?,
            },
            distortion: None,
            extrinsics: Some(extrinsics(&node, &world)?),
        });
    }
    FoundCalibration::checked(path, CalibrationFormat::Gltf, LengthUnit::Metre, cameras, remarks)
}

/// A node with its place in the world.
struct Placed<'n, 'a> {
    node: Field<'a>,
    parent: Option<&'n Field<'a>>,
    world: DMat4,
}

/// All nodes, each below its parent, in the order of the file.
fn placed<'n, 'a>(nodes: &'n [Field<'a>]) -> Result<Vec<Placed<'n, 'a>>, CaptureError> {
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for (number, node) in nodes.iter().enumerate() {
        for child in node.find("children").map(|children| children.numbers()).transpose()?.unwrap_or_default() {
            match parents.get_mut(child as usize) {
                Some(parent @ None) => *parent = Some(number),
                _ => {
                    return Err(node.invalid("has a child that is missing, or has two parents; export the scene again"));
                }
            }
        }
    }
    let locals: Vec<DMat4> = nodes.iter().map(local).collect::<Result<_, _>>()?;
    let place = |number: usize, node: &Field<'a>| {
        let mut world = DMat4::IDENTITY;
        let mut next = Some(number);
        for _ in 0..=nodes.len() {
            let Some(at) = next else {
                let parent = parents.get(number).copied().flatten().and_then(|parent| nodes.get(parent));
                return Ok(Placed { node: node.clone(), parent, world });
            };
            world = locals.get(at).copied().unwrap_or(DMat4::IDENTITY) * world;
            next = parents.get(at).copied().flatten();
        }
        Err(node.invalid("is its own ancestor; export the scene again"))
    };
    // Only cameras' places are computed: chains of nodes may be long.
    let cameras = nodes.iter().enumerate().filter(|(_, node)| node.find("camera").is_some());
    cameras.map(|(number, node)| place(number, node)).collect()
}

/// A node's transform to its parent.
fn local(node: &Field) -> Result<DMat4, CaptureError> {
    let array = |name: &str, count: usize| -> Result<Option<Vec<f64>>, CaptureError> {
        let Some(field) = node.find(name) else { return Ok(None) };
        let numbers = field.numbers()?;
        if numbers.len() == count { Ok(Some(numbers)) } else { Err(field.invalid(format!("must be {count} numbers"))) }
    };
    if let Some(matrix) = array("matrix", 16)? {
        return Ok(<[f64; 16]>::try_from(matrix).map_or(DMat4::IDENTITY, |matrix| DMat4::from_cols_array(&matrix)));
    }
    let vector = |numbers: Option<Vec<f64>>, default: DVec3| match numbers.as_deref() {
        Some(&[x, y, z]) => DVec3::new(x, y, z),
        _ => default,
    };
    let rotation = match array("rotation", 4)?.as_deref() {
        Some(&[x, y, z, w]) => DQuat::from_xyzw(x, y, z, w),
        _ => DQuat::IDENTITY,
    };
    let length = rotation.length();
    if !(length > 1e-6 && length.is_finite()) {
        return Err(node.invalid("has a rotation of length 0; export the scene again"));
    }
    let scale = vector(array("scale", 3)?, DVec3::ONE);
    let translation = vector(array("translation", 3)?, DVec3::ZERO);
    Ok(DMat4::from_scale_rotation_translation(scale, rotation / length, translation))
}

/// Where a camera of that `world_from_camera` stands. Even scales of nodes above it have no effect on its picture.
fn extrinsics(node: &Field, world: &DMat4) -> Result<Rigid, CaptureError> {
    let axes = DMat3::from_mat4(*world);
    let scale = axes.determinant().cbrt();
    let turned = if scale > 0.0 { axes * (1.0 / scale) } else { axes };
    // OpenCV's y and z axes point the other way.
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let rotation = FileValidator { path: node.path }.rotation(node.name.clone(), flip * turned.transpose())?;
    let center: DVec4 = world.w_axis;
    Ok(Rigid { rotation, translation: -(rotation * center.truncate()) })
}
