use std::path::{Path, PathBuf};

use ghand_core::Side;
use ghand_datasets::{Dataset, Options, recognise};
use ghand_test_support::mano_files::python::{Py, array, npy, zip};
use glam::DVec3;

use crate::mano::{Mano, check_vertices, numbers, vectors};
use crate::scene::{Label, Scene, Shown, check, flat, folder, import, last_number, options, put, refused, save};

pub const FRAMES: usize = 13;
/// The hand is not there in the first frame.
const WITHOUT: usize = 1;
const SERIALS: [&str; 2] = ["836212060125", "840412060917"];

fn list(numbers: &[f64]) -> String {
    numbers.iter().map(|number| format!("  - {number:?}\n")).collect()
}

/// Writes a sequence; `mano` are the 51 numbers of a camera and a frame.
pub fn write(root: &Path, scene: &Scene, shape: &[f64], mano: impl Fn(usize, usize) -> Vec<f64>) -> PathBuf {
    let sequence = root.join("20200709-subject-01/20200709_141754");
    let side = scene.model.side;
    put(
        sequence.join("meta.yml"),
        format!(
            "extrinsics: '20200702_151821'\nmano_calib:\n- 20200709-subject-01_{side}\nmano_sides:\n- {side}\nnum_frames: {FRAMES}\n\
             serials:\n- '{}'\n- '{}'\nycb_grasp_ind: 0\nycb_ids:\n- 2\n- 10\n",
            SERIALS[0], SERIALS[1]
        ),
    );
    let calibration = root.join("calibration");
    let mut extrinsics = "extrinsics:\n".to_owned();
    for (c, serial) in SERIALS.iter().enumerate() {
        let [fx, _, cx, _, fy, cy, ..] = scene.opencv_matrix(c);
        put(
            calibration.join(format!("intrinsics/{serial}_640x480.yml")),
            format!(
                "color:\n  fx: {fx:?}\n  fy: {fy:?}\n  ppx: {cx:?}\n  ppy: {cy:?}\ndepth:\n  fx: 1.0\n  fy: 1.0\n  ppx: 0.0\n  ppy: 0.0\n"
            ),
        );
        extrinsics += &format!("  '{serial}':\n{}", list(&scene.world_from_camera(c)[..12]));
    }
    extrinsics += "  apriltag:\n  - 1.0\nmaster: '840412060917'\n";
    put(calibration.join("extrinsics_20200702_151821/extrinsics.yml"), extrinsics);
    put(calibration.join(format!("mano_20200709-subject-01_{side}/mano.yml")), format!("betas:\n{}", list(shape)));
    for (c, serial) in SERIALS.iter().enumerate() {
        for f in 0..FRAMES {
            let folder = sequence.join(serial);
            let number = f.saturating_sub(WITHOUT);
            save(&scene.picture(c, number), folder.join(format!("color_{f:06}.jpg")));
            let is_there = f >= WITHOUT;
            let label = scene.labels(c, number);
            let labels: Vec<f64> = (0..640 * 480)
                .map(|at| match label(at % 640, at / 640) {
                    Label::Hand if is_there => 255.0,
                    Label::Object => 10.0,
                    _ => 0.0,
                })
                .collect();
            let joints = if is_there { flat(&scene.joints_in_camera(c, number)) } else { vec![-1.0; 63] };
            let pose = if is_there { mano(c, number) } else { vec![0.0; 51] };
            let file = |name: &str, code, shape: &[usize], values: &[f64]| {
                (format!("{name}.npy"), npy(&Py::Array(array(code, shape, false, values))))
            };
            let files = [
                file("seg", "|u1", &[480, 640], &labels),
                file("pose_y", "<f4", &[2, 3, 4], &[0.0; 24]),
                file("pose_m", "<f4", &[1, 51], &pose),
                file("joint_3d", "<f4", &[1, 21, 3], &joints),
                file("joint_2d", "<f4", &[1, 21, 2], &[0.0; 42]),
            ];
            put(folder.join(format!("labels_{f:06}.npz")), zip(&files, true));
        }
    }
    sequence
}

fn scene_frame(id: &str) -> usize {
    last_number(id) - WITHOUT
}

#[test]
fn a_left_hand_is_where_its_joints_are_and_its_masks_leave_objects() {
    let (folder, out) = folder();
    let root = folder.path().join("DexYCB");
    let scene = Scene::new(Side::Left, 2, (640, 480), FRAMES - WITHOUT);
    let sequence = write(&root, &scene, &[0.0; 10], |_, _| vec![0.1; 51]);
    let subject = sequence.parent().unwrap().to_path_buf();
    assert_eq!([&root, &subject, &sequence].map(|path| recognise(path)), [Some(Dataset::DexYcb); 3]);
    let written = import(&sequence, &options(&out));
    assert_eq!(written.annotated, FRAMES - WITHOUT);
    assert_eq!(written.capture.cameras.iter().map(|c| c.id.as_str()).collect::<Vec<_>>(), SERIALS);
    let shown = Shown { scene: &scene, cameras: vec![0, 1], frame: scene_frame, has_masks: true, has_pixels: true };
    check(&written, &shown);
    let right = refused(&sequence, &Options { side: Some(Side::Right), ..options(&out) });
    assert!(right.ends_with("shows only a left hand; give --side left, or omit it"), "{right}");
}

#[test]
fn components_are_of_the_mean_pose_in_the_axes_of_each_camera() {
    let (folder, out) = folder();
    let root = folder.path().join("DexYCB");
    let scene = Scene::new(Side::Right, 2, (640, 480), FRAMES - WITHOUT);
    let mano = Mano::new(folder.path(), Side::Right);
    let shape = numbers(10, 3, 1.0);
    let parts = |f: usize| (vectors(1, f, 0.8)[0], numbers(45, 20 + f, 0.5), DVec3::new(0.02, 0.01 * f as f64, 0.7));
    // The same numbers in all cameras, of which the first counts.
    let sequence = write(&root, &scene, &shape, |_, f| {
        let (turn, components, place) = parts(f);
        [turn.to_array().to_vec(), components, place.to_array().to_vec()].concat()
    });
    let written = import(&sequence, &Options { hand_model: Some(mano.path.clone()), ..options(&out) });
    let here = ghand_core::Camera::look_at(DVec3::ZERO, DVec3::Z, -DVec3::Y, 0.5, 224, 224);
    check_vertices(&written, 0, &here, |id| {
        let (turn, components, place) = parts(scene_frame(id));
        let fingers = mano.with_mean(&mano.of_components(&components));
        mano.posed(turn, &fingers, &shape).0.iter().map(|vertex| *vertex + place).collect()
    });
    let left = Mano::new(folder.path(), Side::Left);
    let error = refused(&sequence, &Options { hand_model: Some(left.path), ..options(&out) });
    assert!(error.contains("is a left hand, and the sequence is read for its right one"), "{error}");
}
