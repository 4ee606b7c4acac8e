//! Landmarks in images of calibrated cameras.

use ghand_capture::cameras::distortion::Distortion;
use ghand_capture::cameras::list::LensCamera;
use ghand_core::Camera;
use ghand_hand_model::builtin::builtin_hand;
use glam::DVec2;

use super::*;

/// Two cameras half a metre from the hand, one with a lens that distorts.
fn cameras() -> Vec<LensCamera> {
    let at = DVec3::new(0.04, 0.0, 0.0);
    let camera =
        |id: &str, eye: DVec3| Camera { id: id.into(), ..Camera::look_at(at + eye, at, DVec3::NEG_Y, 0.8, 640, 480) };
    let lens = Distortion::from_opencv(&[-0.2, 0.05, 0.002, -0.003, 0.0]).unwrap();
    vec![
        LensCamera { camera: camera("left", DVec3::new(0.4, 0.0, -0.4)), distortion: Some(lens) },
        LensCamera { camera: camera("right", DVec3::new(-0.4, 0.1, -0.4)), distortion: None },
    ]
}

/// The image of a point as filmed, pixels.
fn filmed(lens: &LensCamera, point: DVec3) -> DVec2 {
    let camera = &lens.camera;
    let ray = (camera.project(point).0 - camera.principal) / camera.focal;
    lens.distortion.map_or(ray, |distortion| distortion.distorted(ray)) * camera.focal + camera.principal
}

fn options() -> PoseOptions {
    PoseOptions { cameras: cameras(), ..Default::default() }
}

/// A file of what the cameras see of the hand, whose fingertips' landmarks are at the skin.
fn file(poses: &[Pose], model: &HandModel) -> Json {
    let ik = HandIk::new(&RestSkeleton::of(model).unwrap());
    let frame = |(k, pose): (usize, &Pose)| {
        let seen = |lens: &LensCamera| ik.landmarks(pose).map(|point| filmed(lens, point).to_array());
        let cameras = cameras();
        json!({"id": format!("f{k}"), "image_landmarks": {"left": seen(&cameras[0]), "right": seen(&cameras[1])}})
    };
    let frames: Vec<Json> = poses.iter().enumerate().map(frame).collect();
    json!({"fps": 25, "side": "right", "tips": "skin", "frames": frames})
}

fn some_poses(model: &HandModel) -> Vec<Pose> {
    ["rest", "fist", "point", "victory", "relaxed", "open"].map(|name| named_pose(name, model).unwrap()).to_vec()
}

#[test]
fn pixels_of_two_cameras_give_the_poses_through_their_lenses() {
    let model = builtin_hand(Side::Right).unwrap();
    let poses = some_poses(&model);
    let ik = HandIk::new(&RestSkeleton::of(&model).unwrap());
    let given = file(&poses, &model);
    let (sequence, fit) = poses_and_fit("f", &value(&given), &model, &options()).unwrap();
    let fit = fit.unwrap();
    assert_eq!((sequence.fps, sequence.frames[2].id.as_str(), fit.unit), (25.0, "f2", "px"));
    for (frame, pose) in sequence.frames.iter().zip(&poses) {
        let found = ik.landmarks(&frame.pose);
        let truth = ik.landmarks(pose);
        let off = found.iter().zip(&truth).map(|(a, b)| a.distance(*b)).fold(0.0, larger);
        assert!(off < 1e-3, "frame {}: {off}", frame.id);
        assert_eq!(frame.shape.len(), model.shape_count());
        assert!(frame.shape.iter().all(|value| value.abs() < 0.1), "{:?}", frame.shape);
    }
    // The lens matters: without it, the landmarks fit no hand as well.
    let mut without = options();
    without.cameras[0].distortion = None;
    let (_, worse) = poses_and_fit("f", &value(&given), &model, &without).unwrap();
    let median = |fit: &LandmarkFit| fit.cameras[0].1.ninth;
    assert!(median(&worse.unwrap()) > 5.0 * median(&fit));
}

fn value(json: &Json) -> Value {
    Value::from_bytes(json.to_string().as_bytes()).unwrap()
}

#[test]
fn fractions_scores_and_missing_points_mean_what_they_say() {
    let model = builtin_hand(Side::Right).unwrap();
    let pixels = file(&some_poses(&model), &model);
    let mut other = pixels.clone();
    for frame in other["frames"].as_array_mut().unwrap() {
        for points in frame["image_landmarks"].as_object_mut().unwrap().values_mut() {
            for point in points.as_array_mut().unwrap() {
                let [x, y] = [0, 1].map(|k| point[k].as_f64().unwrap());
                *point = json!({"x": x / 640.0, "y": y / 480.0, "z": -0.01, "visibility": 0.0});
            }
        }
    }
    let read = |file: &Json| read_with(file, &model, &options());
    let (a, b) = (read(&pixels).unwrap(), read(&other).unwrap());
    for (a, b) in a.frames.iter().zip(&b.frames) {
        assert!(difference(&a.pose, &b.pose) < 1e-6);
    }
    // Points that were not found or are not to be trusted say nothing.
    let mut gaps = pixels.clone();
    gaps["frames"][0]["image_landmarks"]["left"][8] = Json::Null;
    gaps["frames"][0]["image_landmarks"]["right"][12] = json!([3.0, 4.0, 0.0]);
    gaps["frames"][1]["image_landmarks"]["left"] = Json::Null;
    gaps["frames"][2]["image_landmarks"] = Json::Null;
    let found = without_filled(read(&gaps).unwrap(), &["f2"]);
    assert_eq!(found.frames.len(), 5);
    assert!(
        found.warnings[0].contains("\"f2\"") && found.warnings[0].contains("has 0 landmarks"),
        "{:?}",
        found.warnings
    );
    assert!((found.frames[0].pose.translation - a.frames[0].pose.translation).length() < 2e-3);
}

#[test]
fn what_is_wrong_with_image_landmarks_is_named() {
    let model = builtin_hand(Side::Right).unwrap();
    let good = file(&some_poses(&model), &model);
    let says = |file: &Json, options: &PoseOptions, parts: &[&str]| {
        let error = read_with(file, &model, options).unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    };
    says(&good, &PoseOptions::default(), &["image_landmarks", "--cameras"]);
    let changed = |change: &dyn Fn(&mut Json)| {
        let mut file = good.clone();
        change(&mut file);
        file
    };
    let unknown = changed(&|file| file["frames"][3]["image_landmarks"]["top"] = json!(vec![[1.0, 2.0]; 21]));
    says(&unknown, &options(), &["frames[\"f3\"]", "\"top\"", "left, right"]);
    let few = changed(&|file| file["frames"][3]["image_landmarks"]["left"] = json!([[1.0, 2.0]]));
    says(&few, &options(), &["frames[\"f3\"]", "\"left\"", "1 landmarks, expected 21"]);
    let depth = changed(&|file| file["frames"][0]["image_landmarks"]["left"][2] = json!([1.0, 2.0, -0.1]));
    says(&depth, &options(), &["landmark 2", "score -0.1", "omit MediaPipe's z"]);
    says(
        &changed(&|file| file["side"] = json!("left")),
        &options(),
        &["left hand", "cannot be mirrored", "--side right"],
    );
    says(&changed(&|file| file["tips"] = json!("nail")), &options(), &["tips", "\"skin\""]);
}

#[test]
fn a_frame_of_another_place_is_named_with_its_cause_and_spoils_nothing() {
    let model = builtin_hand(Side::Right).unwrap();
    let mut poses = some_poses(&model);
    poses.extend(some_poses(&model));
    let mut given = file(&poses, &model);
    // One camera of a frame sees something else; the tip of another frame is far off in one camera.
    for k in 0..21 {
        given["frames"][4]["image_landmarks"]["left"][k] =
            json!([100.0 + 31.0 * (k % 5) as f64, 50.0 + 17.0 * k as f64]);
    }
    given["frames"][1]["image_landmarks"]["right"][8] = json!([600.0, 20.0]);
    let (sequence, fit) = poses_and_fit("f", &value(&given), &model, &options()).unwrap();
    let fit = fit.unwrap();
    let sequence = without_filled(sequence, &["f4"]);
    assert!(fit.rejected.len() == 1 && fit.rejected[0].0 == "f4", "{:?}", fit.rejected);
    assert!(fit.rejected[0].1.contains("of left's 21 landmarks"), "{:?}", fit.rejected);
    assert_eq!(sequence.frames.len(), poses.len() - 1);
    let wrong: Vec<_> = fit.frames.iter().filter(|frame| !frame.wrong.is_empty()).collect();
    assert!(wrong.len() == 1 && wrong[0].id == "f1" && wrong[0].wrong == ["index tip in right"], "{wrong:?}");
    assert!((fit.lengths[0] / fit.lengths[1] - 1.0).abs() < 0.01, "{:?}", fit.lengths);
    let text = fit.to_string();
    assert!(
        ["little tip", "left", "f1: 1 of 42: index tip in right", "f4: "].iter().all(|part| text.contains(part)),
        "{text}"
    );
    // The file has the report and is read again as it is.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses.json");
    ghand::write_fitted_poses(&path, &sequence, &fit, &model).unwrap();
    let again = read_poses(&path, &model, &PoseOptions::default()).unwrap();
    let again = without_filled(again, &["f4"]);
    assert_eq!((&again.frames, again.fps), (&sequence.frames, sequence.fps));
    let written: Json = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(written["landmark_fit"]["unit"], "px");
    assert_eq!(written["landmark_fit"]["landmarks"][8]["distances"]["wrong"], 1);
}

#[test]
fn a_hand_of_another_size_is_said_and_one_camera_says_what_it_cannot_know() {
    let model = builtin_hand(Side::Right).unwrap();
    let poses = some_poses(&model);
    let ik = HandIk::new(&RestSkeleton::of(&model).unwrap());
    let points = |scale: f64| -> Vec<[[f64; 3]; 21]> {
        poses.iter().map(|pose| ik.landmarks(pose).map(|p| (p * scale).to_array())).collect()
    };
    let fit_of =
        |file: &Json, options: &PoseOptions| poses_and_fit("f", &value(file), &model, options).unwrap().1.unwrap();
    let large = fit_of(&json!(points(1.1)), &PoseOptions::default());
    assert!((large.lengths[1] / large.lengths[0] - 1.1).abs() < 0.01 && large.remarks.is_empty(), "{large}");
    assert!(large.shape.iter().any(|(name, value)| name == "hand-scale" && *value > 0.5), "{large}");
    let huge = fit_of(&json!(points(1.5)), &PoseOptions::default());
    assert!(huge.remarks[0].contains("% longer") && huge.remarks[0].contains("metres"), "{huge}");
    let mut one = file(&poses, &model);
    for frame in one["frames"].as_array_mut().unwrap() {
        frame["image_landmarks"].as_object_mut().unwrap().remove("left");
    }
    let fit = fit_of(&one, &options());
    assert!(fit.remarks[0].starts_with("one camera"), "{fit}");
}

#[test]
fn landmarks_in_memory_give_the_hand_of_a_file_and_its_distances_in_pixels() {
    use crate::image_landmarks::{FitOptions, ImageFrame, ImagePoint};

    let model = builtin_hand(Side::Right).unwrap();
    let mut given = file(&some_poses(&model), &model);
    // One wrong landmark, and a frame without enough.
    given["frames"][3]["image_landmarks"]["right"][16][0] = json!(20.0);
    given["frames"][4]["image_landmarks"] = json!({});
    let point = |point: &Json| {
        let [x, y] = [0, 1].map(|k| point[k].as_f64().unwrap());
        Some(ImagePoint { at: DVec2::new(x, y), score: 1.0 })
    };
    let frame = |frame: &Json| ImageFrame {
        id: frame["id"].as_str().unwrap().into(),
        cameras: frame["image_landmarks"]
            .as_object()
            .unwrap()
            .iter()
            .map(|(id, points)| (id.clone(), std::array::from_fn(|k| point(&points[k]))))
            .collect(),
    };
    let frames: Vec<ImageFrame> = given["frames"].as_array().unwrap().iter().map(frame).collect();
    let fit_hand = |frames: &[ImageFrame], cameras: &[LensCamera]| {
        crate::image_landmarks::fit_hand(frames, cameras, &model, 0.0, &FitOptions::default())
    };
    let hand = fit_hand(&frames, &cameras()).unwrap();
    let (sequence, fit) = poses_and_fit("f", &value(&given), &model, &options()).unwrap();
    assert_eq!(Some(&hand.report), fit.as_ref());
    assert_eq!(hand.report.rejected.len(), 1);
    let has_pose: Vec<bool> = hand.poses.iter().map(Option::is_some).collect();
    assert_eq!(has_pose, [true, true, true, true, false, true]);
    for (found, read) in hand.poses.iter().zip(&sequence.frames).filter(|(found, _)| found.is_some()) {
        assert_eq!((found.as_ref(), &hand.shape), (Some(&read.pose), &read.shape));
    }
    assert!(hand.noise > 0.0 && hand.noise < 1e-3, "{}", hand.noise);
    let counts: Vec<usize> = hand.distances.iter().map(Vec::len).collect();
    assert_eq!(counts, [42, 42, 42, 42, 0, 42]);
    let wrong: Vec<_> = hand.distances.iter().flatten().filter(|one| one.is_wrong).collect();
    assert!(
        matches!(wrong[..], [one] if (one.landmark, one.camera) == (16, Some(1)) && one.distance > 50.0),
        "{wrong:?}"
    );
    // One camera's pixels, the other's fractions: each by itself.
    let mut mixed = frames.clone();
    for (_, points) in mixed.iter_mut().flat_map(|frame| &mut frame.cameras).filter(|(id, _)| id == "left") {
        points.iter_mut().flatten().for_each(|point| point.at /= DVec2::new(640.0, 480.0));
    }
    let mixed = fit_hand(&mixed, &cameras()).unwrap();
    for (a, b) in hand.poses.iter().zip(&mixed.poses) {
        assert!(a.iter().zip(b).all(|(a, b)| difference(a, b) < 1e-6));
    }
    let error = fit_hand(&frames, &cameras()[..1]).unwrap_err().to_string();
    assert!(error.contains("\"right\"") && error.contains("they are left"), "{error}");
}

#[test]
fn other_trackers_landmarks_with_cameras_give_the_poses_of_ghands_own() {
    let model = builtin_hand(Side::Right).unwrap();
    let given = file(&some_poses(&model), &model);
    let folder = tempfile::tempdir().unwrap();
    for (number, frame) in given["frames"].as_array().unwrap().iter().enumerate() {
        for id in ["left", "right"] {
            let points = frame["image_landmarks"][id].as_array().unwrap();
            let numbers: Vec<f64> =
                points.iter().flat_map(|p| [p[0].as_f64().unwrap(), p[1].as_f64().unwrap(), 1.0]).collect();
            let people = json!({"version": 1.3, "people": [{"hand_right_keypoints_2d": numbers}]});
            std::fs::create_dir_all(folder.path().join(id)).unwrap();
            let name = format!("{id}/a_{number:012}_keypoints.json");
            std::fs::write(folder.path().join(name), people.to_string()).unwrap();
        }
    }
    let (own, _) = poses_and_fit("f", &value(&given), &model, &options()).unwrap();
    let (found, fit) = read_poses_and_fit(folder.path(), &model, &options()).unwrap();
    assert_eq!(fit.unwrap().cameras.len(), 2);
    let poses = |sequence: &PoseSequence| sequence.frames.iter().map(|frame| frame.pose.clone()).collect::<Vec<_>>();
    assert_eq!(poses(&found), poses(&own));
    // Places in metres stay what they are, with cameras and without.
    let metres = json!({"world_landmarks": vec![vec![[0.1, 0.2, 0.3]; 21]; 2]});
    let path = folder.path().join("metres.json");
    std::fs::write(&path, metres.to_string()).unwrap();
    let problem = |options: &PoseOptions| read_poses(&path, &model, options).unwrap_err().to_string();
    assert_eq!(problem(&options()), problem(&PoseOptions::default()));
    let table = folder.path().join("table.csv");
    std::fs::write(&table, "scorer,a,a\nbodyparts,wrist,wrist\ncoords,x,y\n0,1,2\n").unwrap();
    let error = read_poses(&table, &model, &PoseOptions::default()).unwrap_err().to_string();
    assert!(error.contains("table.csv") && error.contains("--cameras"), "{error}");
}
