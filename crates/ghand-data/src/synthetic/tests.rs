use std::collections::BTreeMap;
use std::path::Path;

use super::*;

fn options() -> SyntheticOptions {
    SyntheticOptions {
        views: 6,
        train_frames: 7,
        test_frames: 2,
        test_views: 2,
        width: 24,
        height: 36,
        ..Default::default()
    }
}

/// A renderer that shows the vertices as points: enough to see where the hand is.
fn points(scene: &SceneMesh, camera: &Camera) -> Result<Vec<[u8; 4]>, String> {
    let mut pixels = vec![[0; 4]; camera.width as usize * camera.height as usize];
    for (position, exposure) in scene.positions.iter().zip(scene.exposure) {
        let (pixel, depth) = camera.project(*position);
        let inside =
            pixel.min_element() >= 0.0 && pixel.x < f64::from(camera.width) && pixel.y < f64::from(camera.height);
        if !(inside && depth > 0.3 && (0.0..=1.0).contains(exposure)) {
            return Err(format!("a vertex is at {pixel}, depth {depth}, exposure {exposure}"));
        }
        pixels[pixel.y as usize * camera.width as usize + pixel.x as usize] = [200, 150, (depth * 300.0) as u8, 255];
    }
    Ok(pixels)
}

/// Contents of all files below a folder.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap()) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            files.extend(contents(&entry.path()).into_iter().map(|(k, v)| (format!("{name}/{k}"), v)));
        } else {
            files.insert(name, std::fs::read(entry.path()).unwrap());
        }
    }
    files
}

#[test]
fn a_capture_is_the_same_each_time_and_holds_the_hand_in_every_image() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
    generate(&options(), &a, &mut points).unwrap();
    generate(&options(), &b, &mut points).unwrap();
    let files = contents(&a);
    // Image and mask of 6 x 7 + 2 x 2 pairs, capture.json and truth.json.
    assert_eq!(files.len(), 2 * 46 + 2);
    assert!(files == contents(&b), "the same options give the same files");

    let capture = Capture::open(&a).unwrap();
    let (train, test) = (capture.split("train").unwrap(), capture.split("test").unwrap());
    assert_eq!((train.cameras.len(), train.frames.len()), (6, 7));
    assert_eq!((test.cameras.len(), test.frames.len()), (2, 2));
    assert!(test.cameras.iter().all(|c| !train.cameras.contains(c)), "test cameras do not train");
    assert!(test.frames.iter().all(|f| !train.frames.contains(f)), "test frames do not train");
    let five = capture.split("train5").unwrap();
    assert!(five.cameras.len() == 5 && five.cameras.iter().all(|c| train.cameras.contains(c)));
    assert_eq!(capture.load_view(test.cameras[1], test.frames[1]).unwrap().rgba.len(), 24 * 36);

    let truth: Vec<Pose> = capture.truth.iter().flatten().flatten().cloned().collect();
    let error = |frames: &[usize]| {
        let squares =
            frames.iter().flat_map(|&f| capture.frames[f].pose.rotations.iter().zip(&truth[f].rotations).skip(1));
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, n), (a, b)| (sum + (*a - *b).length_squared(), n + 3.0));
        (sum / count).sqrt().to_degrees()
    };
    // 7 frames x 15 joints x 3 = 315 samples of sigma 4: the estimate is good to 4 / sqrt(2 x 315) = 0.16.
    assert!((error(&train.frames) - 4.0).abs() < 0.6, "{} degrees of noise", error(&train.frames));
    assert_eq!(error(&test.frames), 0.0);
}

#[test]
fn the_true_hand_is_not_the_template_under_linear_skinning() {
    let template = ProceduralHand::default();
    let (model, hand) = (template.build().unwrap(), TrueHand::new(&template, 7).unwrap());
    let anatomy = anatomy::Anatomy::of(&model);
    assert_eq!(anatomy.fingers.len(), 5);
    let motion = |seed| trajectory::trajectory(&anatomy, model.joint_count(), 6, seed);
    assert!(motion(7) != motion(8), "another seed gives another motion");
    let pose = &motion(7)[3];
    let motions = ghand_core::skeleton::pose_skeleton(&model.parents, &model.joints, &pose.rotations).posed_from_rest;
    let linear: Vec<DVec3> = (0..model.vertices.len())
        .map(|v| {
            let weights = model.vertex_weights(v).iter().zip(&motions);
            weights.map(|(w, m)| m.apply(model.vertices[v]) * *w).sum::<DVec3>() + pose.translation
        })
        .collect();
    let truth = hand.pose(pose);
    let gaps: Vec<f64> = (truth.positions.iter().step_by(37))
        .map(|p| linear.iter().map(|q| p.distance(*q)).fold(f64::INFINITY, f64::min))
        .collect();
    let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
    assert!((0.0008..0.01).contains(&mean), "mean distance of the surfaces {mean} m");
    assert!(truth.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-9));
}

#[test]
fn a_capture_appears_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("capture");
    let mut left = 3;
    let error = generate(&options(), &out, &mut |scene, camera| {
        left -= 1;
        if left == 0 { Err("the card is on fire".into()) } else { points(scene, camera) }
    });
    let message = error.unwrap_err().to_string();
    assert!(message.contains("the card is on fire") && message.contains("0000"), "{message}");
    let short = generate(&options(), &out, &mut |_, _| Ok(vec![])).unwrap_err().to_string();
    assert!(short.contains("0 pixels, expected 864"), "{short}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}

#[test]
fn unusable_options_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let says = |options: SyntheticOptions, out: &Path, text: &str| {
        let message = generate(&options, out, &mut points).unwrap_err().to_string();
        assert!(message.contains(text), "{message}");
    };
    let out = folder.path().join("capture");
    says(SyntheticOptions { views: 0, ..options() }, &out, "views");
    says(SyntheticOptions { width: 0, ..options() }, &out, "width");
    says(SyntheticOptions { pose_noise_degrees: f64::NAN, ..options() }, &out, "pose_noise_degrees");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("mine"), "precious").unwrap();
    says(options(), &out, "not empty");
    assert_eq!(std::fs::read(out.join("mine")).unwrap(), b"precious");
}
