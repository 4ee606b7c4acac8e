//! Hands of other programs: names, units, several meshes, both hands, bodies. All are made from the small procedural hand
//! by changes of its file.

use serde_json::{Value, json};

use super::*;
use crate::files::rigged_glb::RiggedHand;
use crate::joints::names::{Finger, finger_joints};
use ghand_test_support::procedural_hand::ProceduralHand;

/// A file that can be changed.
#[derive(Clone)]
struct Rig {
    json: Value,
    bytes: Vec<u8>,
}

impl Rig {
    /// A right hand: joints 0 to 15 with MANO's names, and the mesh.
    fn hand() -> Rig {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap().without_blend_shapes();
        let glb = RiggedHand::default().document(&model).unwrap().finish().unwrap();
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let mut json: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
        json["skins"][0].as_object_mut().unwrap().remove("extras");
        Rig { json, bytes: glb[28 + length..].to_vec() }
    }

    /// With other names of the joints.
    fn named(mut self, name: impl Fn(&str) -> String) -> Rig {
        for node in self.json["nodes"].as_array_mut().unwrap() {
            if node.get("mesh").is_none() {
                node["name"] = name(node["name"].as_str().unwrap()).into();
            }
        }
        self
    }

    fn nodes(&mut self) -> &mut Vec<Value> {
        self.json["nodes"].as_array_mut().unwrap()
    }

    fn add_node(&mut self, node: Value) -> usize {
        let at = self.nodes().len();
        self.nodes().push(node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(at.into());
        at
    }

    /// With the skeleton below a node.
    fn below(mut self, mut node: Value) -> Rig {
        node["children"] = json!([0]);
        self.add_node(node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().retain(|node| *node != 0);
        self
    }

    fn numbers(&self, accessor: usize) -> (usize, usize) {
        let accessor = &self.json["accessors"][accessor];
        let view = &self.json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let size = match accessor["type"].as_str().unwrap() {
            "VEC3" => 3,
            "MAT4" => 16,
            other => panic!("{other}"),
        };
        (view["byteOffset"].as_u64().unwrap_or(0) as usize, accessor["count"].as_u64().unwrap() as usize * size)
    }

    /// Changes the floats of an accessor; `change` also knows their place.
    fn change(&mut self, accessor: usize, change: impl Fn(usize, f32) -> f32) {
        let (at, count) = self.numbers(accessor);
        for k in 0..count {
            let place = at + 4 * k..at + 4 * k + 4;
            let value = f32::from_le_bytes(self.bytes[place.clone()].try_into().unwrap());
            self.bytes[place].copy_from_slice(&change(k, value).to_le_bytes());
        }
    }

    fn accessor(&self, of: &Value) -> usize {
        of.as_u64().unwrap() as usize
    }

    /// With mesh and joints in another unit, `factor` to the metre.
    fn in_unit(mut self, factor: f32) -> Rig {
        let positions = self.accessor(&self.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"]);
        self.change(positions, |_, x| x * factor);
        let binds = self.accessor(&self.json["skins"][0]["inverseBindMatrices"]);
        self.change(binds, |k, x| if (12..15).contains(&(k % 16)) { x * factor } else { x });
        for node in self.nodes() {
            if let Some(translation) = node.get_mut("translation") {
                let moved: Vec<f64> =
                    translation.as_array().unwrap().iter().map(|x| x.as_f64().unwrap() * f64::from(factor)).collect();
                *translation = json!(moved);
            }
        }
        self
    }

    /// With a copy of the hand, mirrored by its armature: joints from node `first` on, the mesh and its skin.
    fn with_mirrored(mut self, name: impl Fn(&str) -> String) -> Rig {
        let first = self.nodes().len();
        for k in 0..16 {
            let mut joint = self.nodes()[k].clone();
            joint["name"] = name(joint["name"].as_str().unwrap()).into();
            if let Some(children) = joint.get_mut("children") {
                *children = children.as_array().unwrap().iter().map(|c| c.as_u64().unwrap() as usize + first).collect();
            }
            self.nodes().push(joint);
        }
        self.add_node(json!({"name": "mirror", "scale": [-1, 1, 1], "children": [first]}));
        let mut skin = self.json["skins"][0].clone();
        skin.as_object_mut().unwrap().remove("skeleton");
        skin["joints"] = (first..first + 16).collect();
        self.json["skins"].as_array_mut().unwrap().push(skin);
        self.add_node(json!({"name": "other", "mesh": 0, "skin": 1}));
        self
    }

    fn read_side(&self, wanted: Option<Side>) -> Result<GltfFile, HandModelError> {
        read_hand("rig.glb", &SmallHand { json: self.json.to_string(), bytes: self.bytes.clone() }.glb(), None, wanted)
    }

    fn read(&self) -> GltfFile {
        self.read_side(None).unwrap()
    }
}

fn length(model: &HandModel) -> f64 {
    let fold = |f: fn(f64, f64) -> f64, start| model.vertices.iter().map(|v| v.y).fold(start, f);
    fold(f64::max, f64::MIN) - fold(f64::min, f64::MAX)
}

fn told(file: &GltfFile) -> String {
    file.warnings.join("; ")
}

/// MANO's finger and number, `None` of the wrist.
fn finger_of(name: &str) -> Option<(&str, usize)> {
    Some((name.trim_end_matches(|c: char| c.is_ascii_digit()), name.chars().last()?.to_digit(10)? as usize))
}

#[test]
fn rigs_of_other_programs_have_the_same_fingers() {
    let capital = |finger: &str| format!("{}{}", finger[..1].to_uppercase(), &finger[1..]);
    let unity = |name: &str| match finger_of(name) {
        Some((finger, k)) => format!("Right{}{}", capital(finger), ["Proximal", "Intermediate", "Distal"][k - 1]),
        None => "RightHand".into(),
    };
    let sketchfab = |name: &str| match finger_of(name) {
        Some((finger, k)) => format!("f_{finger}.0{k}.R_0{}", 3 * finger.len() * finger.len() + k),
        None => "hand.R_01".into(),
    };
    let hand = Rig::hand().read().model;
    for rig in [Rig::hand().named(unity), Rig::hand().named(sketchfab), Rig::hand().named(|n| format!("x1:{n}.001"))] {
        let file = rig.read();
        assert!(file.warnings.is_empty(), "{}", told(&file));
        for finger in Finger::ALL {
            assert_eq!(
                finger_joints(finger, &file.model),
                finger_joints(finger, &hand),
                "{:?}",
                file.model.joint_names
            );
        }
    }
}

#[test]
fn webxr_names_need_not_be_complete_or_exact() {
    let webxr = |finger: &str, k: usize| match finger {
        "thumb" => format!("thumb-{}", ["metacarpal", "phalanx-proximal", "phalanx-distal"][k - 1]),
        _ => format!("{finger}-finger-phalanx-{}", ["proximal", "intermediate", "distal"][k - 1]),
    };
    let without_tips = |name: &str| finger_of(name).map_or("wrist".into(), |(finger, k)| webxr(finger, k));
    let with_little = |name: &str| without_tips(name).replace("pinky", "little");
    for rig in [Rig::hand().named(without_tips), Rig::hand().named(with_little)] {
        let file = rig.read();
        assert!(file.warnings.is_empty(), "{}", told(&file));
        assert!(Finger::ALL.iter().all(|finger| finger_joints(*finger, &file.model).is_some()));
    }
}

#[test]
fn joints_beside_each_other_are_a_hand_by_their_names() {
    let hand = Rig::hand().read().model;
    for name in [|name: &str| name.to_owned(), |name: &str| format!("left_{name}")] {
        let mut rig = Rig::hand().named(name);
        let places: Vec<DVec3> = hand.joints.clone();
        for (node, place) in rig.nodes().iter_mut().take(16).zip(&places) {
            node.as_object_mut().unwrap().remove("children");
            node["translation"] = json!(place.to_array());
        }
        rig.json["scenes"][0]["nodes"] = (0..17).collect();
        let file = rig.read();
        assert_eq!((&file.model.parents, &file.model.joints), (&hand.parents, &hand.joints));
    }
}

#[test]
fn nodes_above_the_joints_scale_and_turn_the_hand_and_that_of_the_mesh_does_not() {
    let hand = Rig::hand().read().model;
    let turn = glam::DQuat::from_rotation_x(1.0);
    let half = json!([0.5f64.sin(), 0.0, 0.0, 0.5f64.cos()]);
    for (rig, turn) in [
        (Rig::hand().in_unit(100.0).below(json!({"scale": [0.01, 0.01, 0.01]})), glam::DQuat::IDENTITY),
        (Rig::hand().in_unit(1000.0).below(json!({"scale": [1e-3, 1e-3, 1e-3], "rotation": half})), turn),
        (Rig::hand().below(json!({"rotation": half, "translation": [1, 2, 3]})), turn),
    ] {
        let mut moved = rig.clone();
        for node in moved.nodes().iter_mut().filter(|node| node.get("mesh").is_some()) {
            node["scale"] = json!([7, 7, 7]);
        }
        let file = rig.read();
        assert_eq!(file, moved.read());
        assert!(file.warnings.is_empty(), "{}", told(&file));
        for (found, expected) in file.model.vertices.iter().zip(&hand.vertices) {
            assert!(found.distance(turn * *expected) < 1e-6, "{found} is not {expected}");
        }
        for (found, expected) in file.model.joints.iter().zip(&hand.joints) {
            assert!(found.distance(turn * *expected) < 1e-6, "{found} is not {expected}");
        }
    }
    assert!(length(&Rig::hand().in_unit(100.0).read().model) > 10.0, "a wrong unit stays what it is");
}

#[test]
fn odd_transforms_are_told_or_refused() {
    let uneven = Rig::hand().below(json!({"scale": [1.0, 1.3, 1.0]})).read();
    assert!(told(&uneven).contains("scale it unevenly"), "{}", told(&uneven));
    let mut posed = Rig::hand();
    posed.nodes()[1]["rotation"] = json!([0.0, 0.0, 0.6, 0.8]);
    assert!(told(&posed.read()).contains("from where it was bound"), "{}", told(&posed.read()));
    assert_eq!(posed.read().model, Rig::hand().read().model);
    let flat = Rig::hand().below(json!({"scale": [0, 0, 0]})).read_side(None).unwrap_err().to_string();
    assert!(flat.contains("rig.glb: nodes: scale the hand to nothing"), "{flat}");
}

#[test]
fn the_shape_tells_the_side_and_contradicting_names_are_told() {
    let right = Rig::hand().named(|name| format!("left_{name}")).read();
    assert_eq!(right.model.side, Side::Right);
    assert!(told(&right).contains("\"left_wrist\" says left"), "{}", told(&right));
    let left = Rig::hand().below(json!({"name": "R_hand", "scale": [-1, 1, 1]})).read();
    assert_eq!(left.model.side, Side::Left);
    assert!(told(&left).contains("says right"), "{}", told(&left));
    // A mirror turns triangles inside out; the normals must point outwards again.
    let volume = |model: &HandModel| {
        let corner = |i: u32| model.vertices[i as usize];
        model.faces.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c)))).sum::<f64>()
    };
    assert!(volume(&left.model) > 0.0 && volume(&right.model) > 0.0);
    let unclear = Rig::hand().named(|name| format!("leftover_{name}")).read();
    assert_eq!((unclear.model.side, unclear.warnings), (Side::Right, vec![]));
}

#[test]
fn either_of_two_hands_is_read() {
    for name in [|name: &str| format!("{name}_l"), |name: &str| format!("{name}.001")] {
        let rig = Rig::hand().with_mirrored(name);
        let (right, left) = (rig.read(), rig.read_side(Some(Side::Left)).unwrap());
        assert_eq!((right.model.side, left.model.side), (Side::Right, Side::Left));
        assert!(told(&right).contains("rig.glb:left is the left one"), "{}", told(&right));
        assert_eq!((left.warnings, left.model.joint_names[3].clone()), (vec![], name("index3")));
        assert_eq!(right.model.vertices.len(), left.model.vertices.len());
    }
}

#[test]
fn all_meshes_of_a_skeleton_are_one_hand_and_others_are_told() {
    let whole = Rig::hand().read().model;
    let mut halves = Rig::hand();
    let indices = halves.accessor(&halves.json["meshes"][0]["primitives"][0]["indices"]);
    let count = halves.json["accessors"][indices]["count"].as_u64().unwrap() / 6 * 3;
    let size = if halves.json["accessors"][indices]["componentType"] == 5125 { 4 } else { 2 };
    let mut second = halves.json["accessors"][indices].clone();
    second["byteOffset"] = (count * size).into();
    second["count"] = (second["count"].as_u64().unwrap() - count).into();
    halves.json["accessors"][indices]["count"] = count.into();
    halves.json["accessors"].as_array_mut().unwrap().push(second);
    let mut mesh = halves.json["meshes"][0].clone();
    mesh["primitives"][0]["indices"] = (halves.json["accessors"].as_array().unwrap().len() - 1).into();
    halves.json["meshes"].as_array_mut().unwrap().push(mesh);
    // With a skin of its own, of the same joints.
    let skin = halves.json["skins"][0].clone();
    halves.json["skins"].as_array_mut().unwrap().push(skin);
    for skin in [0, 1] {
        let mut rig = halves.clone();
        rig.add_node(json!({"name": "lower half", "mesh": 1, "skin": skin}));
        rig.add_node(json!({"name": "table", "mesh": 1}));
        let file = rig.read();
        assert_eq!((&file.model.vertices, &file.model.faces), (&whole.vertices, &whole.faces));
        assert!(
            told(&file).contains("2 meshes are read as one hand: ") && told(&file).contains("lower half"),
            "{}",
            told(&file)
        );
        assert!(told(&file).contains("meshes without a skin are not read: table"), "{}", told(&file));
    }
}

/// The hand below an arm: a forearm 0.2 m above the wrist, and a shoulder. The vertices around the wrist beyond `from`
/// (along +Y) follow the arm.
fn on_an_arm(mut rig: Rig, arm: f32, follows: usize) -> Rig {
    let binds = rig.accessor(&rig.json["skins"][0]["inverseBindMatrices"]);
    let (at, _) = rig.numbers(binds);
    let mut matrices = rig.bytes[at..at + 16 * 64].to_vec();
    for up in [arm, 2.0 * arm] {
        let matrix: [f32; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., -up, 0., 1.];
        matrices.extend(matrix.iter().flat_map(|x| x.to_le_bytes()));
    }
    let start = rig.bytes.len();
    rig.bytes.extend(&matrices);
    rig.json["buffers"][0]["byteLength"] = rig.bytes.len().into();
    let views = rig.json["bufferViews"].as_array_mut().unwrap();
    views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": matrices.len()}));
    let view = views.len() - 1;
    rig.json["accessors"][binds] = json!({"bufferView": view, "componentType": 5126, "count": 18, "type": "MAT4"});
    let wrist = rig.nodes()[0].get("translation").cloned().unwrap_or(json!([0, 0, 0]));
    let wrist: Vec<f64> = wrist.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    rig.nodes()[0]["translation"] = json!([wrist[0], wrist[1] - f64::from(arm), wrist[2]]);
    let forearm = rig.nodes().len();
    rig.nodes().push(json!({"name": "forearm", "translation": [0, -arm, 0], "children": [0]}));
    let shoulder = rig.add_node(json!({"name": "shoulder", "translation": [0, 2.0 * arm, 0], "children": [forearm]}));
    rig.json["scenes"][0]["nodes"].as_array_mut().unwrap().retain(|node| *node != 0);
    let joints = rig.json["skins"][0]["joints"].as_array_mut().unwrap();
    joints.extend([forearm.into(), shoulder.into()]);
    // The wrist's vertices follow another joint.
    let joints = rig.accessor(&rig.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"]);
    let accessor = rig.json["accessors"][joints].clone();
    let view = rig.json["bufferViews"][rig.accessor(&accessor["bufferView"])].clone();
    let at = view["byteOffset"].as_u64().unwrap_or(0) as usize;
    let positions = rig.accessor(&rig.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"]);
    let (places, _) = rig.numbers(positions);
    for k in 0..accessor["count"].as_u64().unwrap() as usize {
        let y = f32::from_le_bytes(rig.bytes[places + 12 * k + 4..places + 12 * k + 8].try_into().unwrap());
        let width = if accessor["componentType"] == 5123 { 2 } else { 1 };
        for entry in 0..4 {
            let place = at + (4 * k + entry) * width;
            if y > 0.02 && rig.bytes[place] == 0 {
                rig.bytes[place] = follows as u8;
            }
        }
    }
    rig
}

#[test]
fn a_hand_on_an_arm_begins_at_the_wrist() {
    let hand = Rig::hand().read().model;
    let file = on_an_arm(Rig::hand(), 0.2, 16).read();
    assert_eq!((&file.model.joint_names, &file.model.vertices), (&hand.joint_names, &hand.vertices));
    assert!(told(&file).contains("follow the wrist instead of forearm"), "{}", told(&file));
    assert!(told(&file).contains("joints that are not of the hand are not read: forearm, shoulder"), "{}", told(&file));
    // Of a giant with another hand, what follows the shoulder is cut off.
    let both = on_an_arm(Rig::hand().named(|name| format!("R_{name}")), 0.2, 17).in_unit(4.0);
    let file = both.read();
    assert!(told(&file).contains("vertices follow joints that are not of this hand"), "{}", told(&file));
    assert!(file.model.vertices.iter().all(|v| v.y < 4.0 * 0.021), "the skin of the shoulder is gone");
    assert!(file.model.vertices.len() > hand.vertices.len() / 2);
}

#[test]
fn skeletons_without_a_hand_are_refused_or_told() {
    let mut apart =
        Rig::hand().named(|name| name.replace("index", "spring").replace("ring", "x").replace("thumb", "y"));
    let children = apart.nodes()[0].as_object_mut().unwrap().remove("children").unwrap();
    apart.json["scenes"][0]["nodes"].as_array_mut().unwrap().extend(children.as_array().unwrap().clone());
    let refused = apart.read_side(None).unwrap_err().to_string();
    assert!(refused.contains("6 root joints (wrist, "), "{refused}");
    let file = Rig::hand().named(|name| name.replace("thumb", "spring")).read();
    let oddities = crate::inspection::warnings(&file.model).join("; ");
    assert!(
        oddities.contains("thumb 1, thumb 2, thumb 3") && oddities.contains("spring1, spring2, spring3"),
        "{oddities}"
    );
}
