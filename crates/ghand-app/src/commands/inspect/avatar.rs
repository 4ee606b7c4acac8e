//! Describes an avatar.

use std::path::Path;

use ghand_avatar::Avatar;
use glam::DVec3;
use serde::Serialize;

use super::hand_model::{joint_tree, vector};
use super::scene::file_size;

/// The description of an avatar, as lines.
pub fn describe(path: &Path, avatar: &Avatar) -> String {
    let template = &avatar.template;
    let model = &avatar.model;
    let config = &avatar.config;
    let mut lines = vec![format!("{}: avatar of {}, {}", path.display(), template.name, template.side)];
    let mut row = |name: &str, text: String| lines.push(format!("  {name:<12} {text}").trim_end().to_owned());
    row("file", file_size(path));
    row("Gaussians", format!("{}, {:.2} mm apart on average", template.len(), 1e3 * template.mean_spacing()));
    let [low, high] = extent(&template.rest, template.len());
    row("extents", format!("{} to {} m at rest, {} m", vector(low), vector(high), vector(high - low)));
    row("shape bases", config.shape_bases.to_string());
    match config.network {
        None => {
            row("colours", format!("a base colour and {} components that follow the pose", config.color_components))
        }
        Some(_) => row("networks", "give all properties, from the pose and the place on the hand".into()),
    }
    row("joints", template.joint_count().to_string());
    for line in joint_tree(model) {
        row("", line);
    }
    row("mesh", format!("{} vertices, {} triangles", model.vertices.len(), model.faces.len()));
    fields(config).into_iter().enumerate().for_each(|(k, line)| row(if k == 0 { "settings" } else { "" }, line));
    if avatar.provenance.iterations == 0 {
        row("trained", "not yet".into());
    } else {
        fields(&avatar.provenance)
            .into_iter()
            .enumerate()
            .for_each(|(k, line)| row(if k == 0 { "trained" } else { "" }, line));
    }
    lines.join("\n") + "\n"
}

/// The fields of a value as stored in the file.
fn fields(value: &impl Serialize) -> Vec<String> {
    let value = serde_json::to_value(value).unwrap_or_default();
    let line = |(name, value): (&String, &serde_json::Value)| {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        format!("{name} {value}")
    };
    value.as_object().map(|fields| fields.iter().map(line).collect()).unwrap_or_default()
}

/// Lower and upper corner of points stored as `[3][count]`.
fn extent(points: &[f32], count: usize) -> [DVec3; 2] {
    let range = |axis: usize| {
        let values = points.iter().skip(axis * count).take(count).map(|value| f64::from(*value));
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    let [x, y, z] = [0, 1, 2].map(range);
    [DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1)]
}
