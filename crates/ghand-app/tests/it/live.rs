//! The examples of `examples/live` send what the viewer's port takes.

use std::path::{Path, PathBuf};
use std::process::Command;

use ghand_core::Side;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_hand_model::builtin::builtin_hand;
use ghand_motion::live::port::{DEFAULT_PORT, LivePort, LiveSettings};
use ghand_motion::live::{LiveOptions, LivePose, LivePoses, PacketKind};

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/live").join(name)
}

/// Runs the client to its end; `None` without Python.
fn run_client(port: &LivePort, arguments: &[&str]) -> Option<String> {
    let mut client = Command::new("python3");
    client.arg(example("send_poses.py")).args(["--port", &port.number().to_string()]).args(arguments);
    match client.output() {
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.success(), "{text}");
            Some(text)
        }
        Err(_) => {
            println!("skipped: there is no python3");
            None
        }
    }
}

fn newest(port: &LivePort, side: Side) -> LivePose {
    let packet = port.mailbox().take().pop().unwrap();
    LivePoses::default().read(&packet.bytes, &builtin_hand(side).unwrap(), 0.0, &LiveOptions::default()).unwrap()
}

fn open() -> LivePort {
    LivePort::open(&LiveSettings { port: 0, origins: vec![] }).unwrap()
}

#[test]
fn the_python_client_sends_a_moving_hand_by_websocket_and_udp() {
    for how in [&[][..], &["--udp"]] {
        let port = open();
        let arguments = [&["--seconds", "0.5", "--rate", "60"], how].concat();
        let Some(told) = run_client(&port, &arguments) else { return };
        assert!(told.starts_with("30 packets in "), "{told}");
        let tally = port.mailbox().tally();
        assert_eq!((tally.received, tally.dropped, tally.unusable), (30, 26, 0));
        let live = newest(&port, Side::Left);
        assert_eq!(live.kind, PacketKind::XrJoints);
        assert!(live.sent_ms.unwrap() > 1.7e12);
    }
}

#[test]
fn the_python_client_sends_the_frames_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let rows = |angle: f64| vec![[angle, 0.0, 0.0]; 16];
    let frames = serde_json::json!({"fps": 100, "side": "right", "frames": [
        {"global_orient": [0, 0, 0], "hand_pose": vec![0.0; 45], "is_right": 1},
        {"global_orient": [0.5, 0, 0], "hand_pose": vec![0.1; 45], "is_right": 1},
    ]});
    let path = folder.path().join("poses.json");
    std::fs::write(&path, frames.to_string()).unwrap();
    let port = open();
    let Some(told) = run_client(&port, &[path.to_str().unwrap()]) else { return };
    assert!(told.starts_with("2 packets in "), "{told}");
    assert_eq!(newest(&port, Side::Right).kind, PacketKind::Mano);
    // Arrays alone, one on each line.
    let lines: Vec<String> = [0.0, 0.1].map(|angle| serde_json::to_string(&rows(angle)).unwrap()).into();
    std::fs::write(&path, lines.join("\n")).unwrap();
    run_client(&port, &[path.to_str().unwrap(), "--udp", "--loop", "--seconds", "0.1"]).unwrap();
    assert_eq!(newest(&port, Side::Right).kind, PacketKind::Mano);
}

#[test]
fn the_packet_of_the_webcam_page_poses_either_hand() {
    let packet = std::fs::read(example("webcam_packet.json")).unwrap();
    let pose = |side: Side| {
        let live =
            LivePoses::default().read(&packet, &builtin_hand(side).unwrap(), 0.0, &LiveOptions::default()).unwrap();
        assert_eq!(live.kind, PacketKind::Landmarks);
        live.pose.rotations
    };
    let [right, left] = [Side::Right, Side::Left].map(pose);
    // The packet has two hands that are mirror images of each other, up to a millimetre or two.
    let mirrored = |v: &glam::DVec3| glam::DVec3::new(v.x, -v.y, -v.z);
    for (right, left) in right.iter().zip(&left) {
        let off = rotation_from_axis_angle(*right) - rotation_from_axis_angle(mirrored(left));
        assert!(off.to_cols_array().iter().all(|entry| entry.abs() < 0.3), "{right} and {left}");
    }
}

#[test]
fn the_examples_use_the_default_port() {
    for name in ["webcam.html", "send_poses.py"] {
        let text = std::fs::read_to_string(example(name)).unwrap();
        assert!(text.contains(&DEFAULT_PORT.to_string()), "{name}");
    }
}
