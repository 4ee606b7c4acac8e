//! Describes a hand model.

use ghand_core::HandModel;
use ghand_hand_model::files::read::HandModelFile;
use ghand_hand_model::inspection::inspect;
use ghand_hand_model::joints::names::JointRole;
use glam::DVec3;

/// The description of a hand model with its oddities, as lines.
pub fn describe(file: &HandModelFile) -> String {
    let found = inspect(&file.model);
    let model = &file.model;
    let mut lines = vec![format!("{}: {}, {}", model.name, file.kind, model.side)];
    let mut row = |name: &str, text: String| lines.push(format!("  {name:<12} {text}"));
    row("joints", format!("{}", model.joint_count()));
    for line in joint_tree(model) {
        row("", line);
    }
    let in_file = match model.source_vertices.len() {
        0 => String::new(),
        split => format!(" ({split} in the file, where seams are split)"),
    };
    row("vertices", format!("{}{in_file}", model.vertices.len()));
    let opening = match found.boundary_edges {
        0 => "closed".into(),
        edges => format!("open at {edges} edges"),
    };
    row("triangles", format!("{}, {opening}", model.faces.len()));
    row("size", format!("{} m", vector(found.high - found.low)));
    let names = match model.shape_names.join(", ") {
        names if names.is_empty() => String::new(),
        names => format!(": {names}"),
    };
    row("shapes", format!("{} directions{names}", model.shape_count()));
    row("correctives", format!("{} pose directions", model.pose_directions.len() / model.vertices.len().max(1)));
    let joints_from = match (model.joint_regressor.is_empty(), model.joint_directions.is_empty()) {
        (false, _) => "the shaped vertices",
        (true, false) => "shape directions of their own",
        (true, true) => "fixed positions",
    };
    row("joints from", joints_from.into());
    if let Some(space) = &model.pose_space {
        let components = space.components.len().checked_div(space.mean.len()).unwrap_or(0);
        row("mean pose", format!("yes, with {components} components"));
    }
    row("UV", format!("{} points, the atlas fills {:.0}% of its square", model.uvs.len(), 100.0 * found.uv_fill));
    for (resolution, texels) in &found.texels {
        row(&format!("  at {resolution}"), format!("{texels} texels"));
    }
    if file.warnings.is_empty() {
        row("warnings", "none".into());
    }
    for warning in &file.warnings {
        row("warning", warning.clone());
    }
    lines.join("\n") + "\n"
}

/// The joints with their rest positions in metres and the parts of the hand that they move, children indented below their
/// parents.
pub(super) fn joint_tree(model: &HandModel) -> Vec<String> {
    let mut depth = vec![0; model.joint_count()];
    let roles = JointRole::of_joints(&model.joint_names);
    let role = |k: usize| roles[k].map_or("no part".into(), |role| role.to_string());
    let joints = model.joint_names.iter().zip(&model.joints).zip(&model.parents).enumerate();
    joints
        .map(|(k, ((name, at), parent))| {
            depth[k] = parent.map_or(0, |p| depth[p] + 1);
            format!("{:>2} {:indent$}{name}  {}  {}", k, "", vector(*at), role(k), indent = 2 * depth[k])
        })
        .collect()
}

pub(super) fn vector(v: DVec3) -> String {
    format!("({:.4}, {:.4}, {:.4})", v.x, v.y, v.z)
}
