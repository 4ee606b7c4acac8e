use std::path::{Path, PathBuf};

use ghand_core::Side;
use ghand_datasets::{Dataset, Options, recognise};
use image::{Rgb, RgbImage};
use serde_json::json;

use crate::mano::{Mano, check_vertices, numbers, vectors};
use crate::scene::{
    Label, Scene, Shown, check, flat, folder, import, last_number, options, put, refused, rows, save, square,
};

pub const FRAMES: usize = 12;

/// Writes sequence 110 and a meta file in which frame 3 has no fit.
pub fn write(root: &Path, scene: &Scene, mano: impl Fn(usize) -> serde_json::Value) -> PathBuf {
    let has_fit: Vec<Vec<bool>> = (0..112).map(|s| (0..FRAMES).map(|f| !(s == 110 && f == 3)).collect()).collect();
    let object_id: Vec<Vec<Option<i32>>> = vec![vec![None; 3], vec![Some(1), None]];
    put(root.join("meta.json"), json!({"has_fit": has_fit, "object_id": object_id}).to_string());
    let cameras = || 0..8;
    let k: Vec<_> = cameras().map(|c| square(&scene.opencv_matrix(c), 3)).collect();
    let m: Vec<_> = cameras().map(|c| square(&scene.camera_from_world(c), 4)).collect();
    for f in 0..FRAMES {
        let file = |part: &str| root.join(part).join("0110").join(format!("{f:08}.json"));
        put(file("xyz"), json!(rows(&scene.joints(f))).to_string());
        put(file("calib"), json!({"K": k, "M": m}).to_string());
        put(file("shape"), mano(f).to_string());
        for c in cameras() {
            let file = |part: &str| root.join(part).join(format!("0110/cam{c}/{f:08}.jpg"));
            save(&scene.picture(c, f), file("rgb"));
            let label = scene.labels(c, f);
            let value = |x, y| if label(x, y) == Label::Hand { 255 } else { 0 };
            let mask = RgbImage::from_fn(224, 224, |x, y| Rgb([value(x, y); 3]));
            save(&mask, file("mask_hand"));
        }
    }
    root.join("rgb/0110")
}

#[test]
fn eight_cameras_see_the_hand_where_it_is_with_masks_that_leave_the_object() {
    let (folder, out) = folder();
    let root = folder.path().join("HanCo");
    let scene = Scene::new(Side::Right, 8, (224, 224), FRAMES);
    let sequence = write(
        &root,
        &scene,
        |_| json!({"poses": [vec![0.0; 48]], "shapes": [vec![0.0; 10]], "global_t": [[[0, 0, 0]]]}),
    );
    assert_eq!([&root, &sequence].map(|path| recognise(path)), [Some(Dataset::HanCo); 2]);
    let written = import(&sequence, &options(&out));
    assert_eq!(written.annotated, FRAMES - 1);
    let shown =
        Shown { scene: &scene, cameras: (0..8).collect(), frame: last_number, has_masks: true, has_pixels: true };
    check(&written, &shown);
    let whole = refused(&root, &options(&out));
    assert!(whole.ends_with("has many sequences of HanCo; give one of them, such as rgb/0110"), "{whole}");
}

#[test]
fn manos_parameters_are_of_the_world_and_from_the_mean_pose() {
    let (folder, out) = folder();
    let root = folder.path().join("HanCo");
    let scene = Scene::new(Side::Right, 8, (224, 224), FRAMES);
    let mano = Mano::new(folder.path(), Side::Right);
    let parts =
        |f: usize| (vectors(1, f, 0.8)[0], vectors(15, 50 + f, 0.3), numbers(10, 9, 1.0), vectors(1, 90 + f, 0.1)[0]);
    let sequence = write(&root, &scene, |f| {
        let (turn, fingers, shape, place) = parts(f);
        json!({"poses": [flat(&[vec![turn], fingers].concat())], "shapes": [shape], "global_t": [[place.to_array()]]})
    });
    let written = import(&sequence, &Options { hand_model: Some(mano.path.clone()), ..options(&out) });
    check_vertices(&written, 3, &scene.cameras[3], |id| {
        let (turn, fingers, shape, place) = parts(last_number(id));
        mano.posed(turn, &mano.with_mean(&fingers), &shape).0.iter().map(|vertex| *vertex + place).collect()
    });
}
