//! Live poses drive the hand until something else does.

use std::net::UdpSocket;
use std::time::{Duration, Instant};

use egui::{Key, Modifiers};
use ghand_core::Pose;
use glam::DVec3;

use ghand_motion::live::port::LiveSettings;
use ghand_test_support::mano_files::model::write_mano;

use super::*;
use crate::viewer::live::feed::{Feed, FeedSettings};

fn port(port: u16) -> FeedSettings {
    FeedSettings::Port(LiveSettings { port, origins: vec![] })
}

fn viewer() -> Headless {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), vec2(760.0, 900.0), 0.1);
    ui.frame(Vec::new());
    ui.viewer().start_live(port(0));
    ui.frame(Vec::new());
    ui
}

/// A pose in which all joints are turned by this angle about x.
fn turned(angle: f64) -> Pose {
    Pose { rotations: vec![DVec3::X * angle; 16], ..Pose::rest(16) }
}

fn packet(angle: f64) -> String {
    let rows: Vec<[f64; 3]> = turned(angle).rotations.iter().map(DVec3::to_array).collect();
    format!(r#"{{"pose":{rows:?}}}"#)
}

impl Headless {
    fn port(&mut self) -> u16 {
        match self.viewer().live.live().unwrap().feed() {
            Feed::Port(port) => port.number(),
            Feed::Webcam(_) => panic!("a webcam"),
        }
    }

    fn send(&mut self, packet: &str) {
        let number = self.port();
        UdpSocket::bind("127.0.0.1:0").unwrap().send_to(packet.as_bytes(), ("127.0.0.1", number)).unwrap();
    }

    /// Sends a pose and shows frames until the hand has it.
    fn drive(&mut self, angle: f64) {
        self.send(&packet(angle));
        self.wait(|ui| ui.hand().pose == turned(angle));
    }

    fn wait(&mut self, mut is_so: impl FnMut(&mut Headless) -> bool) {
        let start = Instant::now();
        while !is_so(self) {
            assert!(start.elapsed() < Duration::from_secs(20), "waited in vain");
            std::thread::sleep(Duration::from_millis(2));
            self.frame(Vec::new());
        }
        self.frame(Vec::new());
    }

    fn is_shown(&self, text: &str) -> bool {
        self.harness.query_all_by_label_contains(text).next().is_some()
    }

    fn drives(&mut self) -> bool {
        self.viewer().live.drives()
    }
}

#[test]
fn packets_pose_the_hand_and_the_panel_says_what_comes() {
    let mut ui = viewer();
    let number = ui.port();
    assert!(ui.is_shown(&format!("waiting for data on ws://127.0.0.1:{number}")));
    let before = ui.canvas().shown().cloned();
    ui.drive(0.2);
    assert!(ui.canvas().shown() != before.as_ref() && ui.drives());
    for text in ["pose", "Packets", "Latency", " ms", "smooth", "move in space"] {
        assert!(ui.is_shown(text), "{text}");
    }
    assert!(!ui.is_shown("waiting for data") && !ui.is_shown("Unusable"));
    ui.send("{\"pose\":[[0,0,\"\u{7}x\"]]}");
    ui.wait(|ui| ui.is_shown("Unusable"));
    assert!(ui.is_shown("packet: "));
    assert_eq!(ui.hand().pose, turned(0.2));
    ui.drive(0.3);
    ui.harness.check_accessibility();
}

#[test]
fn live_poses_are_one_step_to_undo_and_the_last_one_stays() {
    let mut ui = viewer();
    let rest = ui.hand().pose.clone();
    (1..=5).for_each(|k| ui.drive(0.1 * f64::from(k)));
    ui.click("Stop");
    assert!(ui.viewer().live.live().is_none() && ui.hand().pose == turned(0.5));
    ui.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(ui.hand().pose, rest);
    ui.press(Modifiers::COMMAND, Key::Y);
    assert_eq!(ui.hand().pose, turned(0.5));
    // Undo while they come pauses them.
    ui.press(Modifiers::COMMAND, Key::L);
    ui.drive(0.1);
    ui.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(ui.hand().pose, turned(0.5));
    assert!(ui.is_shown("paused") && !ui.drives());
}

#[test]
fn who_poses_the_hand_or_starts_a_motion_pauses_live_poses() {
    let mut ui = viewer();
    for control in ["fist", "wave"] {
        ui.drive(0.2);
        ui.click(control);
        (0..2).for_each(|_| _ = ui.frame(Vec::new()));
        assert!(ui.is_shown("Live poses are paused") && !ui.drives(), "{control}");
        let posed = ui.hand().pose.clone();
        assert_ne!(posed, turned(0.2));
        ui.send(&packet(0.4));
        (0..20).for_each(|_| {
            std::thread::sleep(Duration::from_millis(2));
            ui.frame(Vec::new());
        });
        assert_ne!(ui.hand().pose, turned(0.4), "{control}");
        ui.click("Resume");
        ui.viewer().session.forget_messages();
    }
    // They stop a motion that plays.
    assert!(ui.hand().is_playing());
    ui.drive(0.3);
    assert!(!ui.hand().is_playing() && ui.drives());
    ui.click("Hold");
    ui.send(&packet(0.4));
    (0..20).for_each(|_| _ = ui.frame(Vec::new()));
    assert_eq!(ui.hand().pose, turned(0.3));
}

#[test]
fn a_trackers_hand_is_seen_as_the_tracker_sees_it() {
    let mut ui = viewer();
    let first = ui.camera().clone();
    ui.drive(0.1);
    assert_eq!(*ui.camera(), first, "a pose in the model's axes does not turn the view");
    let joint = r#"[0,0,0,0,0,0,1]"#;
    let joints = vec![joint; 25].join(",");
    ui.send(&format!(r#"{{"handedness":"right","joints":[{joints}]}}"#));
    ui.wait(|ui| *ui.camera() != first);
    let camera = ui.camera().camera([100, 100]);
    assert!((camera.rotation - glam::DMat3::IDENTITY).to_cols_array().iter().all(|e| e.abs() < 1e-9));
}

#[test]
fn a_port_in_use_is_told_and_another_hand_keeps_the_port() {
    let mut ui = viewer();
    let number = ui.port();
    let mut other = Headless::new(Subject::Hand(Box::new(small_hand())), SIZE, 0.1);
    other.viewer().start_live(port(number));
    other.frame(Vec::new());
    other.frame(Vec::new());
    assert!(other.viewer().live.live().is_none() && other.is_shown(&format!("port {number} is already in use")));
    ui.drive(0.2);
    let folder = tempfile::tempdir().unwrap();
    let left = ProceduralHand { detail: 1, left: true, ..Default::default() }.build().unwrap();
    let path = folder.path().join("left.npz");
    write_mano(&path, &left);
    ui.open(&path);
    ui.drive(0.3);
    // The port is free again once the viewer does not need it.
    ui.press(Modifiers::COMMAND, Key::L);
    other.viewer().start_live(port(number));
    assert!(other.viewer().live.live().is_some());
}

#[test]
fn a_scene_has_no_live_poses() {
    let mut ui = viewer();
    *ui.viewer().subject_mut() = small_scene();
    let viewer = ui.viewer();
    viewer.live.subject_changed(&viewer.document.subject);
    assert!(ui.viewer().live.live().is_none());
    ui.press(Modifiers::COMMAND, Key::L);
    assert!(ui.viewer().live.live().is_none());
}
