//! The picture is compared with the capture's image of the same view.

use std::path::Path;

use egui::accesskit::Role;
use egui::{PointerButton, Pos2, Rect, pos2};
use egui_kittest::kittest::NodeT;
use ghand_core::Pose;
use ghand_motion::pose_sequence::formats::ghand::write_poses;
use ghand_motion::{PoseFrame, PoseSequence};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;
use glam::DVec3;

use super::*;
use crate::capture_source::CaptureReading;
use crate::viewer::command::CommandId;
use crate::viewer::document::capture_panel::CapturePanel;
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::stage::truth_view::drawn;

/// The built-in hand in front of the first camera of a small capture.
fn viewer(folder: &Path) -> Headless {
    let mut ui = Headless::new(Subject::avatar(untrained_avatar()), vec2(760.0, 900.0), 0.3);
    let options =
        SyntheticOptions { views: 2, train_frames: 2, test_frames: 0, width: 60, height: 80, ..Default::default() };
    make_capture(ui.viewer().gpu(), &options, folder).unwrap();
    let model = ui.hand().model().clone();
    let panel = CapturePanel::open(folder, &CaptureReading::default(), &model).unwrap();
    ui.viewer().show_capture(panel);
    settle(&mut ui);
    ui
}

/// An avatar's file that is shown in front of the capture of [`viewer`], beside poses of these frames.
fn viewer_of_file(folder: &Path, frames: &[&str]) -> Headless {
    let mut ui = viewer(&folder.join("capture"));
    let avatar = folder.join("avatar.ghand");
    untrained_avatar().save(&avatar).unwrap();
    ui.open(&avatar);
    write_trained(&mut ui, folder, frames);
    ui.open(&folder.join("capture"));
    settle(&mut ui);
    ui
}

/// Writes a fist as the pose of all these frames, as training writes poses.
fn write_trained(ui: &mut Headless, folder: &Path, frames: &[&str]) {
    let fist = pose_by_name("fist", ui.hand().model()).unwrap();
    write_pose(ui, folder, frames, &fist);
}

fn write_pose(ui: &mut Headless, folder: &Path, frames: &[&str], pose: &Pose) {
    let model = ui.hand().model().clone();
    let frame = |id: &&str| PoseFrame { id: (*id).into(), pose: pose.clone(), shape: vec![] };
    let frames = frames.iter().map(frame).collect();
    let sequence = PoseSequence { fps: 30.0, joint_names: model.joint_names.clone(), frames, warnings: vec![] };
    write_poses(&folder.join("poses.json"), &sequence, &model).unwrap();
}

/// How far the pose that is shown is from a fist, radians.
fn off_fist(ui: &mut Headless) -> f64 {
    let fist = pose_by_name("fist", ui.hand().model()).unwrap();
    let pairs = ui.hand().pose.rotations.iter().zip(&fist.rotations);
    pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}

/// Shows frames until the comparison is done.
fn settle(ui: &mut Headless) {
    for _ in 0..10 {
        ui.frame(Vec::new());
        if ui.viewer().finish().unwrap() {
            ui.frame(Vec::new());
            return;
        }
    }
    panic!("the comparison does not end");
}

/// Replaces the capture's image of the view by the picture, all of which is hand.
fn put_picture_into_capture(ui: &mut Headless) {
    let viewer = ui.viewer();
    let panel = viewer.document.capture().unwrap();
    let camera = panel.chosen().unwrap().0.clone();
    let capture = panel.capture().clone();
    let (camera_index, frame) = panel.chosen_indices().unwrap();
    let background = capture.background.map(|v| v as f32);
    let inputs = PictureInputs { camera: camera.clone(), background, ..viewer.stage.canvas.shown().cloned().unwrap() };
    let bytes = drawn(&mut viewer.stage.canvas, &inputs).unwrap().into_flattened();
    let image = image::RgbImage::from_raw(camera.width, camera.height, bytes).unwrap();
    image.save(capture.image_file(camera_index, frame).unwrap()).unwrap();
    let mask = image::GrayImage::from_pixel(camera.width, camera.height, image::Luma([255]));
    mask.save(capture.mask_file(camera_index, frame).unwrap().unwrap()).unwrap();
}

/// What the panel says of the PSNR of the image, dB.
fn psnr(ui: &Headless) -> f64 {
    let labels: Vec<String> =
        ui.harness.query_all_by_label_contains(" dB").filter_map(|label| label.accesskit_node().value()).collect();
    labels.first().expect("no PSNR").trim_end_matches(" dB").parse().unwrap()
}

#[test]
fn a_picture_differs_from_the_capture_but_not_from_itself() {
    let folder = tempfile::tempdir().unwrap();
    let mut ui = viewer(folder.path());
    ui.click("difference");
    settle(&mut ui);
    let other = psnr(&ui);
    assert!((5.0..40.0).contains(&other), "{other} dB");
    assert!(ui.harness.query_by_label_contains("display values").is_some(), "the legend is missing");
    put_picture_into_capture(&mut ui);
    ui.viewer().stage.truth.forget_images();
    settle(&mut ui);
    // Half a grey level in one of 60 x 80 x 3 values.
    assert!(psnr(&ui) > 90.0, "{} dB", psnr(&ui));
}

#[test]
fn the_truth_is_read_only_when_it_is_asked_for_and_not_beside_the_camera() {
    let folder = tempfile::tempdir().unwrap();
    let mut ui = viewer(folder.path());
    assert!(ui.viewer().stage.truth.texture().is_none());
    ui.click("truth");
    settle(&mut ui);
    assert_eq!(ui.viewer().stage.truth.texture(), Some((0, 0)));
    ui.viewer().step_camera(1);
    settle(&mut ui);
    assert_eq!(ui.viewer().stage.truth.texture(), Some((1, 0)));
    ui.camera().orbit(DVec2::new(30.0, 0.0));
    settle(&mut ui);
    assert!(ui.harness.query_by_label_contains(" dB").is_none());
    ui.click("Back to the camera");
    settle(&mut ui);
    assert!(ui.camera().is_calibrated() && psnr(&ui) > 0.0);
}

#[test]
fn training_frames_have_the_poses_of_training_unless_the_user_wants_those_of_the_capture() {
    let folder = tempfile::tempdir().unwrap();
    let mut ui = viewer_of_file(folder.path(), &["0000"]);
    assert!(off_fist(&mut ui) < 1e-9 && ui.harness.query_by_label("shown: as training refined it").is_some());
    ui.click("as given");
    settle(&mut ui);
    assert!(off_fist(&mut ui) > 0.5 && ui.harness.query_by_label("shown: as given, before training").is_some());
    let context = ui.harness.ctx.clone();
    ui.viewer().run(CommandId::CapturePoses, &context);
    assert!(off_fist(&mut ui) < 1e-9);
    // Training did not have the second frame.
    ui.harness.get_by_role_and_label(Role::Slider, "frame").focus();
    ui.frame(Vec::new());
    ui.press(egui::Modifiers::NONE, egui::Key::ArrowRight);
    settle(&mut ui);
    assert!(off_fist(&mut ui) > 0.5);
    assert!(ui.harness.query_by_label("shown: as given; not a frame of training").is_some());
}

#[test]
fn poses_of_training_follow_their_file_with_the_avatar() {
    let folder = tempfile::tempdir().unwrap();
    let mut ui = viewer_of_file(folder.path(), &["0001"]);
    assert!(off_fist(&mut ui) > 0.5);
    write_trained(&mut ui, folder.path(), &["0000"]);
    let mut avatar = untrained_avatar();
    avatar.template.name = "another name".into();
    avatar.save(&folder.path().join("avatar.ghand")).unwrap();
    (0..12).for_each(|_| _ = ui.frame(Vec::new()));
    assert_eq!(ui.viewer().subject_mut().name(), "another name");
    assert!(off_fist(&mut ui) < 1e-9);
}

#[test]
fn poses_that_are_missing_foreign_or_broken_leave_the_capture_as_given() {
    let folder = tempfile::tempdir().unwrap();
    let mut ui = viewer_of_file(folder.path(), &["0000", "of another capture"]);
    assert!(off_fist(&mut ui) > 0.5 && ui.harness.query_by_label("as given").is_none());
    assert_eq!(ui.harness.query_all_by_label_contains("\"of another capture\"").count(), 1);
    let poses = folder.path().join("poses.json");
    for (content, notes) in [(Some("broken"), 1), (Some("{\"frames\":[]}"), 1), (None, 0)] {
        match content {
            Some(content) => std::fs::write(&poses, content).unwrap(),
            None => std::fs::remove_file(&poses).unwrap(),
        }
        ui.viewer().session.forget_messages();
        ui.open(&folder.path().join("capture"));
        settle(&mut ui);
        assert_eq!(ui.harness.query_all_by_label_contains("poses.json").count(), notes, "{content:?}");
        assert!(off_fist(&mut ui) > 0.5 && ui.canvas().failure().is_none());
    }
}

#[test]
fn poses_of_another_capture_with_the_same_frame_ids_are_told_from_those_of_this_one() {
    let folder = tempfile::tempdir().unwrap();
    let mut ui = viewer_of_file(folder.path(), &["0000"]);
    ui.click("as given");
    settle(&mut ui);
    let given = ui.hand().pose.clone();
    let moved = |metres: f64| Pose { translation: given.translation + DVec3::new(0.0, metres, 0.0), ..given.clone() };
    for (metres, notes) in [(0.06, 0), (0.1, 1)] {
        write_pose(&mut ui, folder.path(), &["0000"], &moved(metres));
        ui.viewer().session.forget_messages();
        ui.open(&folder.path().join("capture"));
        settle(&mut ui);
        assert_eq!(ui.harness.query_all_by_label_contains("of another capture").count(), notes, "{metres} m");
        assert_eq!(ui.harness.query_by_label("as given").is_some(), notes == 0, "{metres} m");
        let shown = ui.hand().pose.translation.y - given.translation.y;
        assert!((shown - if notes == 0 { metres } else { 0.0 }).abs() < 1e-6, "{shown} m");
    }
}

#[test]
fn a_missing_or_broken_image_is_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut ui = viewer(folder.path());
    let capture = ui.viewer().document.capture().unwrap().capture().clone();
    let missing = capture.image_file(0, 0).unwrap();
    std::fs::remove_file(&missing).unwrap();
    std::fs::write(capture.image_file(1, 0).unwrap(), "broken").unwrap();
    ui.click("split");
    settle(&mut ui);
    let name = missing.file_name().unwrap().to_string_lossy().into_owned();
    assert_eq!(ui.harness.query_all_by_label_contains(&name).count(), 1);
    ui.viewer().session.forget_messages();
    settle(&mut ui);
    assert_eq!(ui.harness.query_all_by_label_contains(&name).count(), 0);
    ui.viewer().step_camera(1);
    settle(&mut ui);
    assert_eq!(ui.harness.query_all_by_label_contains(&name).count(), 1);
    assert!(ui.canvas().failure().is_none());
}

#[test]
fn the_line_of_the_split_is_dragged_and_the_view_stays() {
    let folder = tempfile::tempdir().unwrap();
    let mut ui = viewer(folder.path());
    ui.click("split");
    settle(&mut ui);
    let line: Rect = ui.harness.get_by_label("Line between picture and truth").rect();
    let (from, to) = (line.center(), line.center() + vec2(60.0, 0.0));
    let button = |pos: Pos2, pressed| Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Default::default(),
    };
    for events in [
        vec![Event::PointerMoved(from)],
        vec![button(from, true)],
        vec![Event::PointerMoved(pos2(from.x + 30.0, from.y))],
        vec![Event::PointerMoved(to)],
        vec![button(to, false)],
    ] {
        ui.frame(events);
    }
    ui.frame(Vec::new());
    let moved = ui.harness.get_by_label("Line between picture and truth").rect().center();
    assert!((moved.x - to.x).abs() < 1.0, "{moved} instead of {to}");
    assert!(ui.camera().is_calibrated());
}
