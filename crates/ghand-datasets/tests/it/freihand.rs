use std::path::Path;

use ghand_core::Side;
use ghand_datasets::{Dataset, recognise};
use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};
use serde_json::json;

use crate::mano::{Mano, check_vertices, numbers, vectors};
use crate::scene::{
    MIDDLE_KNUCKLE, Scene, Shown, WRIST, check, flat, folder, import, last_number, marked, options, put, refused, rows,
    save,
};

pub const FRAMES: usize = 12;
const SIZE: (u32, u32) = (224, 224);

/// The principal point of all images, with the first pixel's centre at (0, 0).
const PRINCIPAL: f64 = 112.0;

fn focal(sample: usize) -> f64 {
    330.0 + 12.0 * sample as f64
}

/// A joint in the axes of the camera of a sample, and its pixel.
fn seen(scene: &Scene, sample: usize, landmark: usize) -> DVec2 {
    let at = scene.joints_in_camera(0, sample)[landmark];
    DVec2::new(at.x, at.y) / at.z * focal(sample) + PRINCIPAL + 0.5
}

fn write(root: &Path, scene: &Scene) {
    let matrix =
        |sample: usize| json!([[focal(sample), 0.0, PRINCIPAL], [0.0, focal(sample), PRINCIPAL], [0.0, 0.0, 1.0]]);
    let all: Vec<usize> = (0..FRAMES).collect();
    let k: Vec<_> = all.iter().map(|sample| matrix(*sample)).collect();
    let xyz: Vec<_> = all.iter().map(|sample| rows(&scene.joints_in_camera(0, *sample))).collect();
    put(root.join("training_K.json"), json!(k).to_string());
    put(root.join("training_xyz.json"), json!(xyz).to_string());
    for sample in all {
        let picture = marked(SIZE.0, SIZE.1, seen(scene, sample, WRIST));
        save(&picture, root.join(format!("training/rgb/{sample:08}.jpg")));
        let knuckle = seen(scene, sample, MIDDLE_KNUCKLE);
        let mask = RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let near = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5).distance(knuckle) < 12.0;
            Rgb([if near { 255 } else { 0 }; 3])
        });
        save(&mask, root.join(format!("training/mask/{sample:08}.jpg")));
    }
}

#[test]
fn single_images_become_one_camera_that_sees_the_joints_where_they_are_shown() {
    let (folder, out) = folder();
    let root = folder.path().join("FreiHAND_pub_v2");
    let scene = Scene::new(Side::Right, 1, SIZE, FRAMES);
    write(&root, &scene);
    assert_eq!(recognise(&root), Some(Dataset::FreiHand));
    let written = import(&root, &options(&out));
    let shown = Shown { scene: &scene, cameras: vec![0], frame: last_number, has_masks: false, has_pixels: false };
    check(&written, &shown);
    let camera = &written.capture.cameras[0];
    assert_eq!((camera.focal, camera.principal), (DVec2::splat(focal(6)), DVec2::splat(112.5)));
    assert!(written.remarks.iter().any(|remark| remark.contains("does not say whose hand")), "{:?}", written.remarks);
    for (f, frame) in written.capture.frames.iter().enumerate() {
        let mask = image::open(written.capture.mask_file(0, f).unwrap().unwrap()).unwrap().into_luma8();
        let at = camera.project(scene.joints_in_camera(0, last_number(&frame.id))[MIDDLE_KNUCKLE]).0;
        let hand = mask.enumerate_pixels().filter(|(_, _, p)| p.0[0] == 255);
        let hand: Vec<DVec2> = hand.map(|(x, y, _)| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).collect();
        let middle = hand.iter().sum::<DVec2>() / hand.len() as f64;
        assert!(middle.distance(at) < 0.6, "{middle} {at}");
    }
    let left = refused(&root, &ghand_datasets::Options { side: Some(Side::Left), ..options(&out) });
    assert!(left.ends_with("shows only a right hand; give --side right, or omit it"), "{left}");
}

#[test]
fn manos_hand_has_its_middle_knuckle_at_that_joint() {
    let (folder, out) = folder();
    let root = folder.path().join("FreiHAND");
    let scene = Scene::new(Side::Right, 1, SIZE, FRAMES);
    write(&root, &scene);
    let mano = Mano::new(folder.path(), Side::Right);
    let root_of = |sample| vectors(1, sample, 0.8)[0];
    let fingers = |sample| vectors(15, 100 + sample, 0.3);
    let shape = numbers(10, 7, 1.0);
    let row = |sample| [vec![root_of(sample)], fingers(sample)].concat();
    let entry = |sample| vec![[flat(&row(sample)), shape.clone(), numbers(3, 1, 1.0)].concat()];
    let entries: Vec<_> = (0..FRAMES).map(entry).collect();
    put(root.join("training_mano.json"), json!(entries).to_string());
    let written = import(&root, &ghand_datasets::Options { hand_model: Some(mano.path.clone()), ..options(&out) });
    // The scene's camera is the world.
    let here = ghand_core::Camera::look_at(DVec3::ZERO, DVec3::Z, -DVec3::Y, 0.5, 224, 224);
    assert_eq!(here.rotation, glam::DMat3::IDENTITY);
    check_vertices(&written, 0, &here, |id| {
        let sample = last_number(id);
        let (vertices, joints) = mano.posed(root_of(sample), &mano.with_mean(&fingers(sample)), &shape);
        let shift = scene.joints_in_camera(0, sample)[MIDDLE_KNUCKLE] - joints[4];
        vertices.iter().map(|vertex| *vertex + shift).collect()
    });
}
