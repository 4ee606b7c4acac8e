use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use ghand_core::{Camera, Side};
use ghand_datasets::{Dataset, Options, recognise};
use ghand_test_support::mano_files::python::{Py, dictionary, pickle, string};
use glam::DVec3;
use serde_json::json;

use crate::mano::{Mano, check_vertices, numbers, vectors};
use crate::scene::{Scene, flat, folder, import, last_number, mark_in, options, put, refused, save};
use crate::torch::tensor;

pub const FRAMES: usize = 10;
const NAMES: [&str; 2] = ["(stir, spoon, bowl)", "20231105_019"];
const SERIALS: [&str; 2] = ["22070938", "22139905"];

fn parts(f: usize) -> (DVec3, Vec<DVec3>, DVec3) {
    (vectors(1, f, 0.8)[0], vectors(15, 60 + f, 0.3), vectors(1, 200 + f, 0.05)[0])
}

fn shape() -> Vec<f64> {
    numbers(10, 8, 1.0)
}

/// Writes videos of the scene, calibrated at twice their size.
pub fn write(root: &Path, scene: &Scene) -> PathBuf {
    let below = |part: &str| root.join(part).join(NAMES[0]).join(NAMES[1]);
    let videos = below("Allocentric_RGB_Videos");
    let mut calibration = serde_json::Map::new();
    for (c, serial) in SERIALS.iter().enumerate() {
        let camera = &scene.cameras[c];
        let frames = root.join(format!("frames-{serial}"));
        (0..FRAMES).for_each(|f| save(&scene.picture(c, f), frames.join(format!("{f:04}.png"))));
        std::fs::create_dir_all(&videos).unwrap();
        let status = Command::new("ffmpeg")
            .args(["-loglevel", "error", "-y", "-framerate", "30", "-i"])
            .arg(frames.join("%04d.png"))
            .args(["-c:v", "mpeg4", "-q:v", "1", "-bf", "0"])
            .arg(videos.join(format!("{serial}.mp4")))
            .stdin(Stdio::null())
            .status();
        assert!(status.unwrap().success());
        let large = camera.principal * 2.0 - 0.5;
        let k = [2.0 * camera.focal.x, 0.0, large.x, 0.0, 2.0 * camera.focal.y, large.y, 0.0, 0.0, 1.0];
        let rotation = camera.rotation.transpose().to_cols_array();
        let size = [2 * camera.width, 2 * camera.height];
        calibration.insert(
            (*serial).into(),
            json!({"K": k, "R": rotation, "T": camera.translation.to_array(), "imgSize": size}),
        );
    }
    put(below("Allocentric_Camera_Parameters").join("calibration.json"), json!(calibration).to_string());
    let frame = |f: usize| {
        let (turn, fingers, place) = parts(f);
        let entries = vec![
            ("hand_pose", tensor(&flat(&[vec![turn], fingers].concat()))),
            ("hand_trans", tensor(&place.to_array())),
        ];
        (string(&format!("{:05}", f + 1)), dictionary(entries))
    };
    let poses = below("Hand_Poses");
    // Names are sorted by the reader.
    put(poses.join("right_hand.pkl"), pickle(&Py::Dict((0..FRAMES).rev().map(frame).collect())));
    put(poses.join("right_hand_shape.pkl"), pickle(&dictionary(vec![("hand_shape", tensor(&shape()))])));
    videos
}

#[test]
fn frames_of_videos_belong_to_poses_whose_wrist_is_at_the_translation() {
    if !ghand_test_support::ffmpeg() {
        return;
    }
    let (folder, out) = folder();
    let root = folder.path().join("TACO");
    let scene = Scene::new(Side::Right, 2, (320, 240), FRAMES);
    let sequence = write(&root, &scene);
    assert_eq!([&root, &sequence].map(|path| recognise(path)), [Some(Dataset::Taco); 2]);
    let mano = Mano::new(folder.path(), Side::Right);
    let written = import(&sequence, &Options { hand_model: Some(mano.path.clone()), frames: 5, ..options(&out) });
    assert_eq!((written.annotated, written.capture.frames.len()), (FRAMES, 5));
    let number = |id: &str| last_number(id) - 1;
    for (c, serial) in SERIALS.iter().enumerate() {
        check_vertices(&written, c, &scene.cameras[c], |id| {
            let (turn, fingers, place) = parts(number(id));
            let (vertices, joints) = mano.posed(turn, &fingers, &shape());
            vertices.iter().map(|vertex| *vertex - joints[0] + place).collect()
        });
        let camera = &written.capture.cameras[c];
        let Camera { focal, principal, .. } = scene.cameras[c].clone();
        assert_eq!(camera.id, *serial);
        assert!(camera.focal.distance(focal) < 1e-9 && camera.principal.distance(principal) < 1e-9);
        for (f, frame) in written.capture.frames.iter().enumerate() {
            let mark = mark_in(&written.capture.image_file(c, f).unwrap());
            assert!(mark.distance(scene.pixel(c, number(&frame.id), 0)) < 1.0, "{serial} {}", frame.id);
        }
    }
    let poses = root.join("Hand_Poses").join(NAMES[0]).join(NAMES[1]).join("right_hand.pkl");
    let options = Options { hand_model: Some(mano.path.clone()), ..options(&out) };
    for (file, half) in [(poses, true), (sequence.join("22070938.mp4"), false)] {
        let whole = std::fs::read(&file).unwrap();
        std::fs::write(&file, &whole[..if half { whole.len() / 2 } else { 0 }]).unwrap();
        let error = refused(&sequence, &options);
        assert!(error.contains(&*file.file_name().unwrap().to_string_lossy()) && !error.contains('\n'), "{error}");
        std::fs::write(&file, whole).unwrap();
    }
}
