//! Valid files that the attack damages: an avatar, a hand model, a capture, poses, a camera and a scene, all small.

use std::path::{Path, PathBuf};
use std::process::Command;

use ghand_avatar::{Avatar, AvatarConfig};
use ghand_test_support::mano_files::model::write_mano;
use ghand_test_support::procedural_hand::ProceduralHand;
use serde_json::{Value, json};
use tempfile::TempDir;

/// The program with many commands.
pub const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

/// The files.
pub struct World {
    /// Their folder.
    pub folder: TempDir,
    /// `capture.json`.
    pub capture: Value,
    /// `poses.json`.
    pub poses: Value,
    /// `camera.json`.
    pub camera: Value,
}

impl World {
    /// Makes them.
    pub fn new() -> World {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let config = AvatarConfig { uv_resolution: 32, ..Default::default() };
        Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0).unwrap().save(&at("hand.ghand")).unwrap();
        write_mano(&at("hand.npz"), &model);
        let capture = at("capture");
        make(
            &["capture", "--views", "4", "--train-frames", "2", "--test-frames", "1", "--size", "64x96", "--out"],
            &capture,
        );
        // The capture's own template is finer than needed here.
        let mut value = read(&capture.join("capture.json"));
        value["hand_model"]["parameters"]["detail"] = json!(1);
        write(&capture.join("capture.json"), &value);
        write(&at("camera.json"), &value["cameras"][0]);
        make(&["pose", "--hand-model", path(&at("hand.npz")), "--pose", "fist", "--out"], &at("poses.json"));
        std::fs::write(at("scene.ply"), scene()).unwrap();
        let camera = value["cameras"][0].clone();
        let poses = read(&at("poses.json"));
        World { capture: value, poses, camera, folder }
    }

    /// The bytes of one of the files.
    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.folder.path().join(name)).unwrap()
    }

    /// The path of one of the files.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn make(arguments: &[&str], out: &Path) {
    let output = Command::new(GHAND).args(arguments).arg(out).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn read(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn write(path: &Path, value: &Value) {
    std::fs::write(path, value.to_string()).unwrap();
}

/// A scene of a few Gaussians without harmonics.
fn scene() -> Vec<u8> {
    let names = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
        "rot_2", "rot_3",
    ];
    let count = 40;
    let mut file = format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n");
    names.iter().for_each(|name| file.push_str(&format!("property float {name}\n")));
    file.push_str("end_header\n");
    let mut bytes = file.into_bytes();
    for i in 0..count {
        let t = i as f32 * 0.4;
        let row =
            [t.cos() * 0.1, t.sin() * 0.1, t * 0.01, 0.5, t.sin(), 0.1, 2.0, -4.0, -5.0, -4.5, 1.0, t.sin(), 0.2, 0.0];
        bytes.extend(row.into_iter().flat_map(f32::to_le_bytes));
    }
    bytes
}
