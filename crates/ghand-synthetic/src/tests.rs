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

/// A renderer that draws the vertices as points: enough to show the hand's position.
fn points(scene: &SceneMesh, camera: &Camera) -> Result<Vec<[u8; 4]>, String> {
    let mut pixels = vec![[0; 4]; camera.width as usize * camera.height as usize];
    for (position, light_visibility) in scene.positions.iter().zip(scene.light_visibility) {
        let (pixel, depth) = camera.project(*position);
        let inside =
            pixel.min_element() >= 0.0 && pixel.x < f64::from(camera.width) && pixel.y < f64::from(camera.height);
        if !(inside && depth > 0.3 && (0.0..=1.0).contains(light_visibility)) {
            return Err(format!("a vertex is at {pixel}, depth {depth}, light_visibility {light_visibility}"));
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
    let train = capture.split("train").unwrap();
    let test = capture.split("test").unwrap();
    assert_eq!((train.cameras.len(), train.frames.len()), (6, 7));
    assert_eq!((test.cameras.len(), test.frames.len()), (2, 2));
    assert!(test.cameras.iter().all(|c| !train.cameras.contains(c)), "test cameras do not train");
    assert!(test.frames.iter().all(|f| !train.frames.contains(f)), "test frames do not train");
    let five = capture.split("train5").unwrap();
    assert!(five.cameras.len() == 5 && five.cameras.iter().all(|c| train.cameras.contains(c)));
    assert_eq!(capture.load_view(test.cameras[1], test.frames[1]).unwrap().rgba.len(), 24 * 36);

    let truth: Vec<Pose> = capture.truth.iter().flatten().flatten().cloned().collect();
    let fingers = anatomy::Anatomy::of(&capture.hand_model).fingers;
    let moved: Vec<usize> = fingers.iter().flat_map(|finger| finger.joints).collect();
    let pairs = |f: usize| capture.frames[f].pose.rotations.iter().zip(&truth[f].rotations).enumerate().skip(1);
    let still = train.frames.iter().flat_map(|&f| pairs(f)).filter(|(joint, _)| !moved.contains(joint));
    assert_eq!(still.filter(|(_, (given, _))| **given == DVec3::ZERO).count(), 7 * 9, "metacarpals and tips stay");
    let error = |frames: &[usize]| {
        let squares =
            frames.iter().flat_map(|&f| pairs(f)).filter(|(joint, _)| moved.contains(joint)).map(|(_, pair)| pair);
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, n), (a, b)| (sum + (*a - *b).length_squared(), n + 3.0));
        (sum / count).sqrt().to_degrees()
    };
    // 7 frames x 15 joints x 3 = 315 samples of sigma 4: the estimate is good to 4 / sqrt(2 x 315) = 0.16.
    assert!((error(&train.frames) - 4.0).abs() < 0.6, "{} degrees of noise", error(&train.frames));
    assert_eq!(error(&test.frames), 0.0);
}

#[test]
fn the_true_hand_is_not_the_template_under_linear_skinning() {
    let model = Templates::of(&options()).unwrap().own;
    let hand = true_hand(&options()).unwrap();
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
    let truth = hand.pose(pose, DVec3::ZERO);
    let gaps: Vec<f64> = (truth.positions.iter().step_by(37))
        .map(|p| linear.iter().map(|q| p.distance(*q)).fold(f64::INFINITY, f64::min))
        .collect();
    let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
    assert!((0.0008..0.01).contains(&mean), "mean distance of the surfaces {mean} m");
    assert!(truth.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-9));
}

/// The built-in hand with the index finger bent as far as it goes, and stretched.
fn index_finger(bend: f64) -> Pose {
    let model = Templates::of(&options()).unwrap().own;
    let finger = &anatomy::Anatomy::of(&model).fingers[0];
    let mut pose = Pose::rest(model.joint_count());
    (0..3).for_each(|k| pose.rotations[finger.joints[k]] = finger.bend_axis(k) * bend);
    pose
}

#[test]
fn creases_deepen_and_darken_where_a_joint_bends_and_nowhere_else() {
    let hand = true_hand(&options()).unwrap();
    let anatomy = &hand.anatomy;
    let finger = &anatomy.fingers[0];
    let relief = |pose: &Pose| hand.rest_with_folds(&skin::folds::Bend::of(anatomy, pose));
    let stretched = relief(&index_finger(0.0));
    let bent = relief(&index_finger(1.4));
    // Positive if the skin rises as the finger bends.
    let rise: Vec<f64> =
        (stretched.iter().zip(&bent).zip(&hand.normals)).map(|((a, b), n)| (*b - *a).dot(*n)).collect();
    let middle_crease = |v: usize| {
        let offset = hand.model.vertices[v] - finger.points[1];
        hand.normals[v].dot(finger.dorsal) < -0.6
            && offset.dot(finger.direction(1)).abs() < 0.004
            && offset.length() < 0.015
    };
    let deepest = (0..rise.len()).filter(|&v| middle_crease(v)).map(|v| rise[v]).fold(0.0, f64::min);
    assert!((-0.002..-0.0004).contains(&deepest), "the crease deepens by {deepest} m");
    let knuckle = (0..rise.len()).min_by(|&a, &b| {
        let distance = |v: usize| hand.model.vertices[v].distance(finger.points[0] + finger.dorsal * finger.radius);
        distance(a).total_cmp(&distance(b))
    });
    assert!(rise[knuckle.unwrap()] > 0.0005, "the knuckle stands out by {} m", rise[knuckle.unwrap()]);
    let elsewhere = (0..rise.len()).filter(|&v| hand.model.vertex_weights(v)[anatomy.fingers[1].joints[1]] > 0.5);
    assert!(elsewhere.map(|v| rise[v].abs()).all(|moved| moved == 0.0), "the next finger is unchanged");

    let [a, b] = [0.0, 1.4].map(|bend| hand.pose(&index_finger(bend), DVec3::ZERO).texture);
    let brightness = |texel: &[u8; 3]| texel.iter().map(|v| i32::from(*v)).sum::<i32>();
    let change: Vec<i32> = a.rgb.iter().zip(&b.rgb).map(|(a, b)| brightness(b) - brightness(a)).collect();
    assert!(change.iter().filter(|c| **c < -60).count() > 100, "creases darken");
    assert!(change.iter().filter(|c| **c > 30).count() > 100, "knuckles blanch and folds on the back vanish");
    assert!(change.iter().filter(|c| **c != 0).count() < change.len() / 8, "most of the skin stays as it is");
}

#[test]
fn two_identities_differ_from_the_template_and_from_each_other_in_shape() {
    let model = Templates::of(&options()).unwrap().own;
    let joints = [1, 2].map(|identity| random_hand(&model, identity, 1.0).unwrap().joints);
    let bones = |joints: &[DVec3]| -> Vec<f64> {
        let parents = model.parents.iter().enumerate().filter_map(|(k, parent)| Some((k, (*parent)?)));
        parents.map(|(k, parent)| joints[k].distance(joints[parent])).collect()
    };
    let [one, two, template] = [&joints[0], &joints[1], &model.joints].map(|joints| bones(joints));
    for (a, b) in [(&one, &template), (&two, &template), (&one, &two)] {
        let largest = a.iter().zip(b).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
        assert!((0.05..0.5).contains(&largest), "bones differ by up to {largest}");
    }
}

#[test]
fn identities_have_different_hands_and_seeds_different_motions() {
    let capture = |identity, seed| {
        let folder = tempfile::tempdir().unwrap();
        let options = SyntheticOptions { identity, seed, ..options() };
        generate(&options, &folder.path().join("c"), &mut points).unwrap();
        let capture = Capture::open(&folder.path().join("c")).unwrap();
        (capture.truth.unwrap(), contents(&folder.path().join("c/images")))
    };
    let [base, other_hand, other_motion] =
        [(7, 7), (u64::MAX, 7), (7, u64::MAX)].map(|(identity, seed)| capture(identity, seed));
    assert!(base.0 == other_hand.0 && base.1 != other_hand.1);
    assert!(base.0 != other_motion.0);
}

#[test]
fn each_error_changes_only_what_it_is_an_error_of() {
    let folder = tempfile::tempdir().unwrap();
    let make = |name: &str, options: SyntheticOptions| {
        generate(&options, &folder.path().join(name), &mut points).unwrap();
        (Capture::open(&folder.path().join(name)).unwrap(), contents(&folder.path().join(name)))
    };
    let differing = |a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>| -> Vec<String> {
        assert!(a.keys().eq(b.keys()));
        a.iter().filter(|(name, bytes)| b[*name] != **bytes).map(|(name, _)| name.clone()).collect()
    };
    let (exact, base) = make("base", options());
    let (_, bad_masks) = make("masks", SyntheticOptions { mask_noise_pixels: 1.0, ..options() });
    let train = exact.split("train").unwrap();
    let test = exact.split("test").unwrap();
    let is_train = |name: &String| train.cameras.iter().any(|&i| name.contains(&exact.cameras[i].id));
    let masks = differing(&base, &bad_masks);
    assert!(masks.iter().all(|name| name.starts_with("masks/") && is_train(name)), "{masks:?}");
    assert!(masks.len() > 40, "{} of 42 masks have errors", masks.len());

    let (biased, files) = make("bias", SyntheticOptions { pose_bias_degrees: 3.0, ..options() });
    assert_eq!(differing(&base, &files), ["capture.json"], "the truth stays");
    let turn = |capture: &Capture, frame: usize, joint: usize| {
        ghand_core::rotation::rotation_from_axis_angle(capture.frames[frame].pose.rotations[joint])
    };
    let bias = |frame: usize, joint: usize| turn(&biased, frame, joint) * turn(&exact, frame, joint).transpose();
    let fingers = anatomy::Anatomy::of(&exact.hand_model).fingers;
    let mut squares = 0.0;
    for joint in std::iter::once(0).chain(fingers.iter().flat_map(|finger| finger.joints)) {
        let first = bias(train.frames[0], joint);
        assert!(train.frames.iter().all(|&f| bias(f, joint).abs_diff_eq(first, 1e-6)), "the same in all frames");
        assert!(test.frames.iter().all(|&f| bias(f, joint).abs_diff_eq(glam::DMat3::IDENTITY, 1e-9)));
        squares += ghand_core::rotation::axis_angle_from_rotation(&first).length_squared();
    }
    // 46 or so numbers of sigma 3: good to 3 / sqrt(2 x 46) = 0.3.
    let deviation = (squares / 45.75).sqrt().to_degrees();
    assert!((2.0..4.0).contains(&deviation), "{deviation} degrees");
    let moved = biased.frames[0].pose.translation - exact.frames[0].pose.translation;
    assert!((0.0003..0.006).contains(&moved.length()), "{moved}");
}

#[test]
fn a_left_hand_is_the_mirror_image() {
    let [right, left] = [Side::Right, Side::Left].map(|side| {
        let options = SyntheticOptions { side, ..options() };
        (true_hand(&options).unwrap(), poses(&options, &Templates::of(&options).unwrap().right)[1][4].clone())
    });
    let [a, b] = [right.0.pose(&right.1, DVec3::ZERO), left.0.pose(&left.1, DVec3::ZERO)];
    let mirror = |p: &DVec3| DVec3::new(-p.x, p.y, p.z);
    let apart = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| mirror(a).distance(*b)).fold(0.0, f64::max);
    assert!(apart(&a.positions, &b.positions) < 1e-12 && apart(&a.normals, &b.normals) < 1e-12);
    // The left template posed as the truth says is where the left hand is.
    let template = Templates::of(&SyntheticOptions { side: Side::Left, ..options() }).unwrap().own;
    let posed = ghand_core::posing::pose_hand(&template, &[], &left.1).unwrap();
    let outline = left.0.outline(&left.1);
    let gaps = outline.iter().zip(&posed.vertices).map(|(a, b)| a.distance(*b));
    let mean = gaps.sum::<f64>() / outline.len() as f64;
    assert!(mean < 0.01, "the true hand is {mean} m off its template");
    // Triangles are seen from outside.
    let outwards = (left.0.mesh.triangles.iter())
        .filter(|t| {
            let [p, q, r] = t.map(|v| b.positions[v as usize]);
            (q - p).cross(r - p).dot(b.normals[t[0] as usize]) > 0.0
        })
        .count();
    assert!(outwards * 100 > left.0.mesh.triangles.len() * 99);
}

#[test]
fn a_light_from_the_side_leaves_the_far_side_dark() {
    let hand = true_hand(&options()).unwrap();
    let setup = images::lighting::lighting(LightSetup::Side);
    let mut posed = hand.pose(&index_finger(1.4), DVec3::ZERO);
    let soft = posed.light_visibility.clone();
    images::cast_shadow::add_shadow(&mut posed, &setup);
    let light = setup.lights[0].direction;
    let part = |wanted: &dyn Fn(f64) -> bool| {
        let mut kept = 0.0;
        let mut count = 0.0;
        for ((normal, now), before) in posed.normals.iter().zip(&posed.light_visibility).zip(&soft) {
            assert!(*now >= 0.0 && now <= before);
            if wanted(normal.dot(light)) {
                (kept, count) = (kept + now / before, count + 1.0);
            }
        }
        kept / count
    };
    let (near, far) = (part(&|cosine| cosine > 0.8), part(&|cosine| cosine < -0.2));
    // What faces away gets ambient light only, of which shadows take nothing.
    assert!((0.6..1.0).contains(&near) && far == 1.0, "{near} {far}");
}

#[test]
fn a_capture_appears_completely_or_not_at_all() {
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
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "no files remain");
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
    says(SyntheticOptions { pose_bias_degrees: -1.0, ..options() }, &out, "pose_bias_degrees: is -1; give 0 to 45");
    says(SyntheticOptions { mask_noise_pixels: 11.0, ..options() }, &out, "mask_noise_pixels: is 11; give 0 to 10");
    says(SyntheticOptions { twist_degrees: f64::INFINITY, ..options() }, &out, "twist_degrees");
    says(SyntheticOptions { abduction_degrees: 50.0, ..options() }, &out, "abduction_degrees");
    says(SyntheticOptions { views: 100_000, ..options() }, &out, "views: is 100000; give 1 to 1000");
    says(SyntheticOptions { pose_noise_degrees: f64::NAN, ..options() }, &out, "pose_noise_degrees");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("mine"), "precious").unwrap();
    says(options(), &out, "not empty");
    assert_eq!(std::fs::read(out.join("mine")).unwrap(), b"precious");
}
