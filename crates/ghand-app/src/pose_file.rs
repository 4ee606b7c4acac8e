//! Poses from a name, a pose file or a capture, in the order of an avatar's joints.

use std::path::Path;

use anyhow::{Context, anyhow, bail, ensure};
use ghand_core::hand_model::named_poses::{POSE_NAMES, named_pose};
use ghand_core::{HandModel, Pose};
use glam::DVec3;
use serde::Deserialize;

/// A pose with the id of its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct PosedFrame {
    /// Id of the frame, or the pose's name.
    pub id: String,
    /// The pose, one rotation for each joint of the avatar.
    pub pose: Pose,
    /// Shape parameters of the hand; empty for the mean shape.
    pub shape: Vec<f64>,
}

#[derive(Deserialize)]
struct PoseFile {
    format: Option<String>,
    version: Option<u64>,
    hand_model: Option<HandModelFile>,
    frames: Vec<FrameFile>,
}

#[derive(Deserialize)]
struct HandModelFile {
    joints: Option<Vec<String>>,
}

#[derive(Deserialize)]
struct FrameFile {
    id: Option<String>,
    pose: Vec<Vec<f64>>,
    #[serde(default)]
    translation: [f64; 3],
    #[serde(default)]
    shape: Vec<f64>,
}

/// The poses that `text` stands for: one of [`POSE_NAMES`], a file of frames (`{"frames":[{"id","pose","translation"}]}`), or
/// a `capture.json` or its folder, whose rows are matched to the avatar's joints by name.
///
/// # Errors
/// One sentence that names the file and the field, or lists the names that there are.
pub fn poses(text: &str, model: &HandModel) -> anyhow::Result<Vec<PosedFrame>> {
    if POSE_NAMES.contains(&text) {
        return Ok(vec![PosedFrame { id: text.into(), pose: pose_by_name(text, model)?, shape: vec![] }]);
    }
    let path = Path::new(text);
    let is_path = path.extension().is_some() || path.components().count() > 1;
    if !path.exists() && !is_path {
        return Err(unknown_name(text).context("neither a file nor a pose's name"));
    }
    let path = if path.is_dir() { path.join("capture.json") } else { path.to_path_buf() };
    let name = path.display();
    let text = std::fs::read_to_string(&path).with_context(|| format!("{name}: cannot read the poses"))?;
    let file: PoseFile = serde_json::from_str(&text)
        .with_context(|| format!("{name}: not a pose file; correct it at that place or export it again"))?;
    frames(&file, model).with_context(|| name.to_string())
}

/// The frame of that id, else of that number, counted from 0.
///
/// # Errors
/// One that tells the first and the last id.
pub fn choose_frame(mut frames: Vec<PosedFrame>, wanted: &str) -> anyhow::Result<PosedFrame> {
    let count = frames.len();
    let by_number = || wanted.parse().ok().filter(|n| *n < count);
    match frames.iter().position(|f| f.id == wanted).or_else(by_number) {
        Some(index) => Ok(frames.swap_remove(index)),
        None => {
            let id = |frame: Option<&PosedFrame>| frame.map_or(String::new(), |f| f.id.clone());
            Err(anyhow!(
                "has no frame {wanted:?} among its {count}, {:?} to {:?}",
                id(frames.first()),
                id(frames.last())
            ))
        }
    }
}

/// The pose of that name.
///
/// # Errors
/// One that lists the names, or says that the avatar's joints fit none of them.
pub fn pose_by_name(name: &str, model: &HandModel) -> anyhow::Result<Pose> {
    if name == "rest" {
        return Ok(Pose::rest(model.joint_count()));
    }
    if !POSE_NAMES.contains(&name) {
        return Err(unknown_name(name));
    }
    named_pose(name, model).ok_or_else(|| {
        anyhow!("pose {name:?} is for joints with MANO's or WebXR's names, which this avatar lacks; give a pose file")
    })
}

fn unknown_name(name: &str) -> anyhow::Error {
    anyhow!("unknown pose {name:?}; the poses are {}, or give a JSON file of poses", POSE_NAMES.join(", "))
}

fn frames(file: &PoseFile, model: &HandModel) -> anyhow::Result<Vec<PosedFrame>> {
    if let Some(format) = &file.format {
        ensure!(format == "ghand-capture", "format: is {format:?}, must be \"ghand-capture\" or absent");
        ensure!(file.version == Some(1), "version: must be 1; use the ghand that wrote the file");
    }
    ensure!(!file.frames.is_empty(), "frames: there are none");
    let order = match file.hand_model.as_ref().and_then(|m| m.joints.as_ref()) {
        Some(names) => Some((names.len(), order_by_name(names, model)?)),
        None => None,
    };
    let mut out = Vec::with_capacity(file.frames.len());
    for (number, frame) in file.frames.iter().enumerate() {
        let id = frame.id.clone().unwrap_or_else(|| format!("{number:04}"));
        let pose = pose(frame, order.as_ref(), model).with_context(|| format!("frames[{id:?}]"))?;
        out.push(PosedFrame { id, pose, shape: frame.shape.clone() });
    }
    Ok(out)
}

/// For each joint of the avatar the row that holds its rotation.
fn order_by_name(names: &[String], model: &HandModel) -> anyhow::Result<Vec<usize>> {
    let row = |joint: &String| {
        names.iter().position(|n| n == joint).ok_or_else(|| {
            anyhow!("hand_model.joints: lacks the avatar's joint {joint:?}; give poses of the same hand model")
        })
    };
    model.joint_names.iter().map(row).collect()
}

fn pose(frame: &FrameFile, order: Option<&(usize, Vec<usize>)>, model: &HandModel) -> anyhow::Result<Pose> {
    let expected = order.map_or(model.joint_count(), |(rows, _)| *rows);
    let got = frame.pose.len();
    ensure!(got == expected, "pose: has {got} rows, expected {expected}: one for each joint");
    let mut rows = Vec::with_capacity(got);
    for (number, row) in frame.pose.iter().enumerate() {
        match row[..] {
            [x, y, z] if x.is_finite() && y.is_finite() && z.is_finite() => rows.push(DVec3::new(x, y, z)),
            [_, _, _] => bail!("pose: row {number} holds a number that is not finite"),
            _ => bail!("pose: row {number} has {} numbers, expected 3 (axis-angle)", row.len()),
        }
    }
    let rotations = match order {
        Some((_, order)) => order.iter().filter_map(|&row| rows.get(row).copied()).collect(),
        None => rows,
    };
    Ok(Pose { rotations, translation: DVec3::from(frame.translation) })
}

#[cfg(test)]
mod tests {
    use ghand_core::hand_model::procedural::ProceduralHand;

    use super::*;

    fn model() -> HandModel {
        ProceduralHand { detail: 1, ..Default::default() }.build().unwrap()
    }

    fn read(json: &str) -> anyhow::Result<Vec<PosedFrame>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("poses.json");
        std::fs::write(&path, json)?;
        poses(&path.display().to_string(), &model())
    }

    /// Row k is (k, 0, 0).
    fn rows(count: usize) -> String {
        (0..count).map(|k| format!("[{k},0,0]")).collect::<Vec<_>>().join(",")
    }

    #[test]
    fn rows_of_a_pose_file_are_in_the_order_of_the_joints() {
        let json = format!(r#"{{"fps":30,"frames":[{{"id":"a","pose":[{}],"translation":[1,2,3]}}]}}"#, rows(16));
        let frames = read(&json).unwrap();
        assert_eq!((frames.len(), frames[0].id.as_str()), (1, "a"));
        assert_eq!(frames[0].pose.translation, DVec3::new(1.0, 2.0, 3.0));
        assert!(frames[0].pose.rotations.iter().enumerate().all(|(k, r)| r.x == k as f64));
    }

    #[test]
    fn rows_of_a_capture_are_matched_by_name() {
        let mut names = model().joint_names;
        names.reverse();
        names.insert(0, "elbow".into());
        let names = serde_json::to_string(&names).unwrap();
        let json = format!(
            r#"{{"format":"ghand-capture","version":1,"hand_model":{{"joints":{names}}},"frames":[{{"id":"a","pose":[{}]}}]}}"#,
            rows(17)
        );
        let frames = read(&json).unwrap();
        assert!(frames[0].pose.rotations.iter().enumerate().all(|(k, r)| r.x == (16 - k) as f64));
        let error = format!("{:#}", read(&json.replace("index2", "index9")).unwrap_err());
        assert!(error.contains("index2") && error.contains("poses.json"), "{error}");
    }

    #[test]
    fn frames_are_chosen_by_id_or_else_by_number() {
        let frame = |id: &str| PosedFrame { id: id.into(), pose: Pose::rest(16), shape: vec![] };
        let frames = vec![frame("0007"), frame("2"), frame("0009")];
        let chosen = |wanted| choose_frame(frames.clone(), wanted).map(|f| f.id);
        assert_eq!(chosen("0009").unwrap(), "0009");
        assert_eq!(chosen("2").unwrap(), "2");
        assert_eq!(chosen("0").unwrap(), "0007");
        let error = chosen("3").unwrap_err().to_string();
        assert!(error.contains("\"3\"") && error.contains("0007") && error.contains("0009"), "{error}");
    }

    #[test]
    fn wrong_poses_are_told_with_what_was_got_and_expected() {
        let short = format!(r#"{{"frames":[{{"id":"a","pose":[{}]}}]}}"#, rows(5));
        let error = format!("{:#}", read(&short).unwrap_err());
        assert!(error.contains("5 rows") && error.contains("expected 16") && error.contains("poses.json"), "{error}");
        assert!(read(r#"{"frames":[]}"#).is_err());
        assert!(read("{\"frames\":[").is_err());
        let error = format!("{:#}", poses("salute", &model()).unwrap_err());
        assert!(POSE_NAMES.iter().all(|n| error.contains(n)), "{error}");
    }
}
