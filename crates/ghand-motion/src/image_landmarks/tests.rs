//! Landmarks in the layouts of other programs: each file says what the cameras saw.

use std::io::Write;
use std::path::PathBuf;

use ghand_core::Side;
use glam::DVec2;
use serde_json::{Value as Json, json};
use tempfile::TempDir;

use super::*;
use crate::PoseError;
use crate::image_landmarks::view::Landmarks;

const CAMERAS: [&str; 2] = ["cam1", "cam10"];
const FRAMES: usize = 5;

/// Where landmark `k` of a hand is in the image of camera `view` in frame `frame`, pixels. Left hands are elsewhere.
fn pixel(side: Side, view: usize, frame: usize, k: usize) -> DVec2 {
    let left = if side == Side::Left { 200.0 } else { 0.0 };
    DVec2::new(100.0 + left + 10.0 * k as f64 + frame as f64, 300.25 + 20.0 * view as f64 - (k * k) as f64 / 4.0)
}

/// Frame 2 has no hand in the second camera, frame 3 no little finger's tip in the first one.
fn is_missing(view: usize, frame: usize, k: usize) -> bool {
    (view, frame) == (1, 2) || (view, frame, k) == (0, 3, 20)
}

fn seen(side: Side, view: usize, frame: usize) -> Landmarks {
    let at = |k| (!is_missing(view, frame, k)).then(|| ImagePoint { at: pixel(side, view, frame, k), score: 1.0 });
    std::array::from_fn(at)
}

fn ids() -> Vec<String> {
    CAMERAS.map(str::to_owned).to_vec()
}

fn read(paths: &[PathBuf], side: Side) -> Result<ImageLandmarks, PoseError> {
    read_image_landmarks(paths, &ids(), side)
}

/// Asserts that files hold what the cameras saw of a hand; `scale` makes pixels of their coordinates.
fn assert_seen(paths: &[PathBuf], side: Side, scale: DVec2) -> ImageLandmarks {
    let found = read(paths, side).unwrap();
    assert_eq!(found.frames.len(), FRAMES, "{paths:?}");
    for (number, frame) in found.frames.iter().enumerate() {
        assert_eq!(frame.id, format!("{number:04}"), "{paths:?}");
        for (view, id) in CAMERAS.iter().enumerate() {
            let expected = seen(side, view, number);
            let points = frame.cameras.iter().find(|(own, _)| own == id).map_or([None; LANDMARK_COUNT], |(_, p)| *p);
            for (k, (point, truth)) in points.iter().zip(&expected).enumerate() {
                let is_same = match (point, truth) {
                    (Some(point), Some(truth)) => (point.at * scale).distance(truth.at) < 1e-3 && point.score > 0.0,
                    (None, None) => true,
                    _ => false,
                };
                assert!(is_same, "{paths:?} frame {number} {id} landmark {k}: {point:?} {truth:?}");
            }
        }
    }
    found
}

fn write(folder: &TempDir, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, text).unwrap();
    path
}

/// An array of NumPy of 64-bit floats.
fn npy(shape: &[usize], values: &[f64]) -> Vec<u8> {
    assert_eq!(shape.iter().product::<usize>(), values.len());
    let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}), }}", shape.join(", "));
    header.push_str(&" ".repeat((64 - (header.len() + 11) % 64) % 64));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes
}

/// x and y of a landmark, NaN if it was not found.
fn xy(side: Side, view: usize, frame: usize, k: usize) -> [f64; 2] {
    if is_missing(view, frame, k) { [f64::NAN; 2] } else { pixel(side, view, frame, k).to_array() }
}

#[test]
fn mediapipes_dumps_of_each_camera_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let point = |side, view, frame, k: usize| {
        let at = pixel(side, view, frame, k) / DVec2::new(640.0, 480.0);
        json!({"x": at.x, "y": at.y, "z": -0.03, "visibility": 0.0})
    };
    let hand = |side, view, frame| (0..21).map(|k| point(side, view, frame, k)).collect::<Json>();
    let scale = DVec2::new(640.0, 480.0);
    type Frame<'a> = &'a dyn Fn(usize, usize) -> Json;
    // The landmark that is missing in frame 3 cannot be expressed by most of these: it is null.
    let without = |view: usize, frame: usize, mut hand: Json| {
        if (view, frame) == (0, 3) {
            hand[20] = Json::Null;
        }
        hand
    };
    let multi: Frame = &|view, frame| match (view, frame) {
        (1, 2) => json!({"multi_hand_landmarks": null, "multi_handedness": null}),
        _ => json!({
            "multi_hand_landmarks": [
                {"landmark": without(view, frame, hand(Side::Left, view, frame))},
                {"landmark": without(view, frame, hand(Side::Right, view, frame))}],
            "multi_handedness": [
                {"classification": [{"index": 0, "score": 0.99, "label": "Left"}]},
                {"classification": [{"index": 1, "score": 0.98, "label": "Right"}]}]}),
    };
    let tasks: Frame = &|view, frame| match (view, frame) {
        (1, 2) => json!({"frame": frame, "landmarks": [], "handedness": []}),
        _ => json!({
            "frame": frame,
            "landmarks": [
                without(view, frame, hand(Side::Right, view, frame)), without(view, frame, hand(Side::Left, view, frame))],
            "handedness": [[{"categoryName": "Right"}], [{"categoryName": "Left"}]]}),
    };
    let holistic: Frame = &|view, frame| match (view, frame) {
        (1, 2) => json!({"right_hand_landmarks": null, "left_hand_landmarks": null}),
        _ => json!({
            "right_hand_landmarks": without(view, frame, hand(Side::Right, view, frame)),
            "left_hand_landmarks": {"landmark": without(view, frame, hand(Side::Left, view, frame))}}),
    };
    for (name, frame) in [("multi", multi), ("tasks", tasks), ("holistic", holistic)] {
        let file = |view: usize| {
            let frames: Vec<Json> = (0..FRAMES).map(|number| frame(view, number)).collect();
            write(&folder, &format!("{name}-{view}.json"), json!({"fps": 25, "frames": frames}).to_string())
        };
        let paths = [file(0), file(1)];
        for side in [Side::Right, Side::Left] {
            let found = assert_seen(&paths, side, scale);
            assert_eq!((found.fps, found.tip_inset), (Some(25.0), MEDIAPIPE_TIP_INSET), "{name}");
            assert_eq!(found.beside, &MEDIAPIPE_BESIDE, "{name}");
        }
        // Frames alone, one on each line.
        let lines = |view: usize| {
            let frames: Vec<String> = (0..FRAMES).map(|number| frame(view, number).to_string()).collect();
            write(&folder, &format!("{name}-{view}.jsonl"), frames.join("\n"))
        };
        assert_seen(&[lines(0), lines(1)], Side::Right, scale);
    }
    // A tracker that calls all hands left.
    let frames: Vec<Json> =
        (0..2).map(|n| json!({"landmarks": [hand(Side::Right, 0, n)], "handedness": ["Left"]})).collect();
    let path = write(&folder, "swapped.json", Json::from(frames).to_string());
    let found = read_image_landmarks(&[path], &["a".to_owned()], Side::Right).unwrap();
    assert!(found.remarks[0].contains("left hands only"), "{:?}", found.remarks);
}

#[test]
fn folders_of_openpose_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = |side, view, frame| -> Vec<f64> {
        let point = |k| match is_missing(view, frame, k) {
            true => [0.0; 3],
            false => [pixel(side, view, frame, k).x, pixel(side, view, frame, k).y, 0.8 + 0.02 * k as f64],
        };
        (0..21).flat_map(point).collect()
    };
    for (view, id) in CAMERAS.iter().enumerate() {
        for frame in 0..FRAMES {
            let person = |shift: f64, weight: f64| {
                let hand = |side| -> Vec<f64> {
                    let values = numbers(side, view, frame);
                    values.chunks_exact(3).flat_map(|p| [p[0] + shift, p[1], p[2] * weight]).collect()
                };
                json!({"person_id": [-1], "pose_keypoints_2d": [0.0, 0.0, 0.0], "face_keypoints_2d": [],
                       "hand_left_keypoints_2d": hand(Side::Left), "hand_right_keypoints_2d": hand(Side::Right),
                       "pose_keypoints_3d": [], "hand_right_keypoints_3d": []})
            };
            // Somebody stands behind, who is seen less well; in one frame nobody was found.
            let people = if (view, frame) == (1, 2) { vec![] } else { vec![person(50.0, 0.3), person(0.0, 1.0)] };
            let file = json!({"version": 1.3, "people": people}).to_string();
            write(&folder, &format!("out/{}/take_{frame:012}_keypoints.json", id), file);
        }
    }
    let out = folder.path().join("out");
    for side in [Side::Right, Side::Left] {
        // OpenPose's landmarks are taken for joints.
        assert!(assert_seen(std::slice::from_ref(&out), side, DVec2::ONE).beside.is_empty());
        assert_seen(&[out.join("cam10"), out.join("cam1")], side, DVec2::ONE);
    }
    // One camera of the two is enough if its name says which.
    assert!(read(&[out.join("cam1")], Side::Right).unwrap().frames.iter().all(|frame| frame.cameras.len() == 1));
    let people =
        json!({"version": 1.3, "people": [{"hand_right_keypoints_2d": numbers(Side::Right, 0, 0)}]}).to_string();
    write(&folder, "alone/x_000000000007_keypoints.json", people);
    let error = read(&[folder.path().join("alone")], Side::Right).unwrap_err().to_string();
    assert!(error.contains("is of one camera") && error.contains("cam1, cam10"), "{error}");
    write(&folder, "out/cam1/take_000000000002_keypoints.json", r#"{"people":[{"hand_right_keypoints_2d":[1,2,3]}]}"#);
    let error = read(std::slice::from_ref(&out), Side::Right).unwrap_err().to_string();
    assert!(error.contains("000000000002_keypoints.json") && error.contains("people[0]"), "{error}");
}

#[test]
fn arrays_are_read_by_either_axis_first() {
    let folder = tempfile::tempdir().unwrap();
    let side = Side::Right;
    let mut by_frame = vec![];
    let mut by_camera = vec![];
    (0..FRAMES).for_each(|f| (0..2).for_each(|v| (0..21).for_each(|k| by_frame.extend(xy(side, v, f, k)))));
    (0..2).for_each(|v| (0..FRAMES).for_each(|f| (0..21).for_each(|k| by_camera.extend(xy(side, v, f, k)))));
    let frames_first = write(&folder, "a.npy", npy(&[FRAMES, 2, 21, 2], &by_frame));
    // Of 21 points nobody knows whose they are.
    assert!(assert_seen(&[frames_first], side, DVec2::ONE).beside.is_empty());
    let cameras_first = write(&folder, "b.npy", npy(&[2, FRAMES, 21, 2], &by_camera));
    assert_seen(&[cameras_first], side, DVec2::ONE);
    // Scores as third numbers; not found is a score of 0.
    let scored: Vec<f64> = by_camera
        .chunks_exact(2)
        .flat_map(|p| if p[0].is_nan() { [5.0, 5.0, 0.0] } else { [p[0], p[1], 0.7] })
        .collect();
    let found = assert_seen(&[write(&folder, "c.npy", npy(&[2, FRAMES, 21, 3], &scored))], side, DVec2::ONE);
    assert!(found.frames[0].cameras[0].1.iter().flatten().all(|point| point.score == 0.7));
    // One file for each camera, found by its id in the name.
    let half = by_camera.len() / 2;
    let second = write(&folder, "points_cam10.npy", npy(&[FRAMES, 21, 2], &by_camera[half..]));
    let first = write(&folder, "points_cam1.npy", npy(&[FRAMES, 21, 2], &by_camera[..half]));
    assert_seen(&[second, first], side, DVec2::ONE);
    // An archive with a rate.
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(vec![]));
    for (name, array) in [("points.npy", npy(&[2, FRAMES, 21, 2], &by_camera)), ("fps.npy", npy(&[1], &[50.0]))] {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&array).unwrap();
    }
    let archive = write(&folder, "d.npz", zip.finish().unwrap().into_inner());
    assert_eq!(assert_seen(&[archive], side, DVec2::ONE).fps, Some(50.0));
    let other = write(&folder, "e.npy", npy(&[3, FRAMES, 21, 2], &vec![1.0; 3 * FRAMES * 42]));
    let error = read(&[other], side).unwrap_err().to_string();
    assert!(error.contains("e.npy") && error.contains("number of cameras, 2"), "{error}");
    let empty = write(&folder, "f.npy", npy(&[2, FRAMES, 21, 2], &vec![f64::NAN; 2 * FRAMES * 42]));
    let error = read(&[empty], side).unwrap_err().to_string();
    assert!(error.contains("there are none of this hand"), "{error}");
}

#[test]
fn freemocaps_arrays_are_read_in_both_of_its_orders() {
    let folder = tempfile::tempdir().unwrap();
    let name = "mediapipe_2dData_numCams_numFrames_numTrackedPoints_pixelXY.npy";
    let block = |side, v, f| {
        (0..21).flat_map(move |k| {
            let [x, y] = xy(side, v, f, k);
            [x, y, -7.5]
        })
    };
    let filler = |count: usize| (0..count).flat_map(|_| [900.0, 900.0, 0.0]);
    for face in [0, 136, 468, 478] {
        for is_face_first in [false, true] {
            let mut values = vec![];
            for (v, f) in (0..2).flat_map(|v| (0..FRAMES).map(move |f| (v, f))) {
                let mut body: Vec<f64> = filler(33).collect();
                for (wrist, side) in [(15, Side::Left), (16, Side::Right)] {
                    let at = pixel(side, v, f, 0);
                    body[3 * wrist] = at.x + 4.0;
                    body[3 * wrist + 1] = at.y - 3.0;
                }
                values.extend(body);
                let [right, left] = [Side::Right, Side::Left].map(|side| block(side, v, f));
                if is_face_first {
                    values.extend(filler(face).chain(left).chain(right));
                } else {
                    values.extend(right.chain(left).chain(filler(face)));
                }
            }
            let path = write(&folder, name, npy(&[2, FRAMES, 75 + face, 3], &values));
            for side in [Side::Right, Side::Left] {
                // FreeMoCap tracks with MediaPipe.
                assert_eq!(assert_seen(std::slice::from_ref(&path), side, DVec2::ONE).beside, &MEDIAPIPE_BESIDE);
            }
        }
    }
}

#[test]
fn interhands_order_of_joints_is_turned_round() {
    let folder = tempfile::tempdir().unwrap();
    // Each finger from its tip to the palm, thumb first; the wrist last.
    let order: Vec<usize> = [4, 3, 2, 1, 8, 7, 6, 5, 12, 11, 10, 9, 16, 15, 14, 13, 20, 19, 18, 17, 0].to_vec();
    let joints = |v: usize, f: usize| -> (Vec<[f64; 2]>, Vec<[f64; 1]>) {
        let sides = [Side::Right, Side::Left];
        sides
            .into_iter()
            .flat_map(|side| order.iter().map(move |k| (side, *k)))
            .map(|(side, k)| (pixel(side, v, f, k).to_array(), [if is_missing(v, f, k) { 0.0 } else { 1.0 }]))
            .unzip()
    };
    let file = |view: usize| {
        let frame = |f: usize| json!({"joint_img": joints(view, f).0, "joint_valid": joints(view, f).1});
        write(&folder, &format!("{}.json", CAMERAS[view]), (0..FRAMES).map(frame).collect::<Json>().to_string())
    };
    let paths = [file(0), file(1)];
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(vec![]));
    let all: Vec<_> = (0..FRAMES).flat_map(|f| (0..2).map(move |v| (v, f))).map(|(v, f)| joints(v, f)).collect();
    let points: Vec<f64> = all.iter().flat_map(|(points, _)| points.concat()).collect();
    let valid: Vec<f64> = all.iter().flat_map(|(_, valid)| valid.concat()).collect();
    for (name, array) in
        [("joints.npy", npy(&[FRAMES, 2, 42, 2], &points)), ("joint_valid.npy", npy(&[FRAMES, 2, 42], &valid))]
    {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&array).unwrap();
    }
    let archive = write(&folder, "joints.npz", zip.finish().unwrap().into_inner());
    for side in [Side::Right, Side::Left] {
        assert_eq!(assert_seen(&paths, side, DVec2::ONE).tip_inset, 0.0);
        assert_seen(std::slice::from_ref(&archive), side, DVec2::ONE);
    }
}

/// Names as in MediaPipe's enumeration.
const NAMES: [&str; 21] = [
    "WRIST",
    "THUMB_CMC",
    "THUMB_MCP",
    "THUMB_IP",
    "THUMB_TIP",
    "INDEX_FINGER_MCP",
    "INDEX_FINGER_PIP",
    "INDEX_FINGER_DIP",
    "INDEX_FINGER_TIP",
    "MIDDLE_FINGER_MCP",
    "MIDDLE_FINGER_PIP",
    "MIDDLE_FINGER_DIP",
    "MIDDLE_FINGER_TIP",
    "RING_FINGER_MCP",
    "RING_FINGER_PIP",
    "RING_FINGER_DIP",
    "RING_FINGER_TIP",
    "PINKY_MCP",
    "PINKY_PIP",
    "PINKY_DIP",
    "PINKY_TIP",
];

#[test]
fn tables_of_deeplabcut_anipose_and_others_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let row = |first: &str, cells: &mut dyn Iterator<Item = String>| {
        std::iter::once(first.to_owned()).chain(cells).collect::<Vec<_>>().join(",")
    };
    let names: Vec<String> =
        [Side::Right, Side::Left].into_iter().flat_map(|side| NAMES.map(|name| format!("{side}_{name}"))).collect();
    let values = |view: usize, frame: usize| -> Vec<String> {
        let sides = [Side::Right, Side::Left].into_iter();
        let point = |(side, k)| match is_missing(view, frame, k) {
            true => [String::new(), String::new(), "0.0".to_owned()],
            false => {
                [pixel(side, view, frame, k).x.to_string(), pixel(side, view, frame, k).y.to_string(), "0.97".into()]
            }
        };
        sides.flat_map(|side| (0..21).map(move |k| (side, k))).flat_map(point).collect()
    };
    for (view, id) in CAMERAS.iter().enumerate() {
        let mut lines = vec![
            row("scorer", &mut std::iter::repeat_n("DLC_resnet50_hands".to_owned(), 126)),
            row("bodyparts", &mut names.iter().flat_map(|name| [name.clone(), name.clone(), name.clone()])),
            row("coords", &mut (0..42).flat_map(|_| ["x", "y", "likelihood"].map(str::to_owned))),
        ];
        lines.extend((0..FRAMES).map(|f| row(&f.to_string(), &mut values(view, f).into_iter())));
        write(&folder, &format!("dlc/take-{}DLC_resnet50.csv", id), lines.join("\n"));
        // As DeepLabCut writes several animals.
        let mut several = lines.clone();
        several.insert(1, row("individuals", &mut std::iter::repeat_n("single".to_owned(), 126)));
        write(&folder, &format!("several/{}.csv", id), several.join("\r\n"));
        // One row of names, as pandas and FreeMoCap have it, with semicolons.
        let flat = names.iter().flat_map(|name| ["x", "y", "confidence"].map(|axis| format!("{name}_{axis}")));
        let mut lines = vec![row("frame", &mut flat.into_iter())];
        lines.extend((0..FRAMES).map(|f| row(&f.to_string(), &mut values(view, f).into_iter())));
        write(&folder, &format!("flat/{}.csv", id), lines.join("\n").replace(',', ";"));
    }
    for name in ["dlc", "several", "flat"] {
        for side in [Side::Right, Side::Left] {
            let found = assert_seen(&[folder.path().join(name)], side, DVec2::ONE);
            assert!(found.beside.is_empty(), "{name}");
            assert!(found.frames[0].cameras[0].1.iter().flatten().all(|point| point.score == 0.97), "{name}");
        }
    }
    let mouse = "scorer,a,a,a,a\nbodyparts,nose,nose,tail,tail\ncoords,x,y,x,y\n0,1,2,3,4\n";
    let paths = ["cam1.csv", "cam10.csv"].map(|name| write(&folder, name, mouse));
    let error = read(&paths, Side::Right).unwrap_err().to_string();
    assert!(error.contains("cam1.csv: bodyparts") && error.contains("nose, tail"), "{error}");
}

#[test]
fn damaged_and_foreign_files_are_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("empty.json", ""),
        ("list.json", "[]"),
        ("map.json", r#"{"a": 1}"#),
        ("short.json", r#"{"landmarks": [[[0.1, 0.2]]]}"#),
        ("words.json", r#"[{"multi_hand_landmarks": [["a", "b"]]}]"#),
        ("deep.json", r#"{"people": [{"hand_right_keypoints_2d": {"x": []}}], "version": 1}"#),
        ("header.csv", "scorer,a,a,a\nbodyparts,b,b,b"),
        ("cut.csv", "scorer,a,a,a\n"),
        ("valid.json", r#"[{"joint_img": [[1, 2]], "joint_valid": [1]}]"#),
        ("quotes.csv", "scorer,\"a,a,a\nbodyparts,\"\"\"\ncoords,x\n0,\"1"),
        ("binary.csv", "scorer,a,b\n\u{0}\u{1}\u{2}"),
    ] {
        let path = write(&folder, name, text);
        for cameras in [&CAMERAS[..1], &CAMERAS[..]] {
            let ids: Vec<String> = cameras.iter().map(|id| (*id).to_owned()).collect();
            let error = read_image_landmarks(std::slice::from_ref(&path), &ids, Side::Right).unwrap_err().to_string();
            assert!(error.contains(name) && error.lines().count() == 1, "{name}: {error}");
        }
    }
    assert!(read(&[], Side::Right).is_err());
    let error = read(&[folder.path().join("none")], Side::Right).unwrap_err().to_string();
    assert!(error.contains("none"), "{error}");
}

#[test]
fn files_of_ghand_track_of_several_cameras_are_joined() {
    let folder = tempfile::tempdir().unwrap();
    let file = |view: usize, tracker: Json| {
        let point = |f, k: usize| {
            if is_missing(view, f, k) { Json::Null } else { json!(pixel(Side::Right, view, f, k).to_array()) }
        };
        let frame = |f: usize| {
            let points: Vec<Json> = (0..21).map(|k| point(f, k)).collect();
            json!({"id": format!("{f:04}"), "image_landmarks": {CAMERAS[view]: points}})
        };
        let frames: Vec<Json> = (0..FRAMES).map(frame).collect();
        let file = json!({"fps": 30, "side": "right", "tracker": tracker, "frames": frames});
        write(&folder, &format!("{view}-{tracker}.json").replace('"', ""), file.to_string())
    };
    let paths = [0, 1].map(|view| file(view, json!("mediapipe")));
    assert_eq!(assert_seen(&paths, Side::Right, DVec2::ONE).beside, &MEDIAPIPE_BESIDE);
    for tracker in [Json::Null, json!("mine")] {
        let others = [0, 1].map(|view| file(view, tracker.clone()));
        assert!(assert_seen(&others, Side::Right, DVec2::ONE).beside.is_empty(), "{tracker}");
        let error = read(&[paths[0].clone(), others[1].clone()], Side::Right).unwrap_err().to_string();
        assert!(error.contains("another kind of tracker"), "{error}");
    }
    let error = read(&[file(0, json!(5)), paths[1].clone()], Side::Right).unwrap_err().to_string();
    assert!(error.contains("tracker") && error.contains("give the tracker's name"), "{error}");
    let error = read(&paths, Side::Left).unwrap_err().to_string();
    assert!(error.contains("other hand"), "{error}");
}
