//! Cameras calibrated from corners with known noise.

use ghand_board::{BoardCamera, BoardKind, Sight, calibrate};

use crate::scene::{Off, cameras, compare, filmed};

/// Noise of corners, pixels: as measured in rendered images.
const NOISE: f64 = 0.05;

fn charuco() -> BoardKind {
    "charuco:8x6:30mm".parse().unwrap()
}

/// Whether all cameras are as good as they must be. Measured: at most half of this.
fn check(found: &[Off]) {
    for off in found {
        assert!(off.focal < 0.003 && off.principal < 2.0 && off.pixels < 2.5, "{off:?}");
        assert!(off.rotation < 0.1 && off.place < 0.001 && off.clock.abs() < 0.001, "{off:?}");
    }
}

fn error(kind: &BoardKind, cameras: &[BoardCamera]) -> String {
    calibrate(kind, cameras).unwrap_err().to_string()
}

#[test]
fn cameras_of_different_rates_and_clocks_are_placed_to_a_millimetre() {
    let mut truth = cameras(3, 30.0);
    truth[1].rate = 25.0;
    // 0.3 frames.
    truth[1].clock = 0.012;
    truth[2].clock = -0.01;
    let found = calibrate(&charuco(), &filmed(&charuco(), &truth, 10.0, NOISE)).unwrap();
    check(&compare(&truth, &found));
    assert_eq!(found.remarks.len(), 1, "{:?}", found.remarks);
}

#[test]
fn an_unknown_clock_is_found_by_how_the_board_moves() {
    let mut truth = cameras(3, 30.0);
    truth[1].clock = 2.371;
    truth[2].clock = -1.503;
    let mut seen = filmed(&charuco(), &truth, 16.0, NOISE);
    seen[1].clock = None;
    seen[2].clock = None;
    check(&compare(&truth, &calibrate(&charuco(), &seen).unwrap()));
    // A board that lies still does not tell it.
    let first = seen[1].views[0].clone();
    seen[1].views.iter_mut().for_each(|view| view.corners.clone_from(&first.corners));
    assert!(error(&charuco(), &seen[..2]).contains("cam1: nothing tells its clock"));
}

#[test]
fn a_wrong_clock_is_corrected_or_told() {
    let truth = cameras(2, 30.0);
    let mut seen = filmed(&charuco(), &truth, 10.0, NOISE);
    seen[1].clock = Some(0.7);
    let found = calibrate(&charuco(), &seen).unwrap();
    check(&compare(&truth, &found));
    assert!(
        found.remarks.iter().any(|remark| remark.contains("cam1: its clock differs from the given one by -0.70 s")),
        "{:?}",
        found.remarks
    );
    seen[1].clock = Some(4.0);
    let remarks = calibrate(&charuco(), &seen).unwrap().remarks;
    assert!(remarks.iter().any(|remark| remark.contains("its clock is wrong")), "{remarks:?}");
}

#[test]
fn cameras_that_never_see_the_board_together_are_placed_by_a_third_one_or_told() {
    let truth = cameras(3, 30.0);
    let mut seen = filmed(&charuco(), &truth, 12.0, NOISE);
    seen[0].views.retain(|view| view.time < 6.0);
    seen[2].views.retain(|view| view.time > 6.5);
    check(&compare(&truth, &calibrate(&charuco(), &seen).unwrap()));
    let [first, _, last] = &seen[..] else { unreachable!() };
    let told = error(&charuco(), &[first.clone(), last.clone()]);
    assert!(told.contains("cam2 never sees the board at the same time as cam0"), "{told}");
}

#[test]
fn a_board_that_looks_alike_upside_down_may_be_numbered_either_way() {
    let kind: BoardKind = "chessboard:8x6:27mm".parse().unwrap();
    let truth = cameras(2, 35.0);
    let mut seen = filmed(&kind, &truth, 14.0, NOISE);
    let last = kind.corner_count() - 1;
    for (k, view) in seen[1].views.iter_mut().enumerate() {
        // The finder begins at either end, and once in a while at the other one.
        if k % 7 != 3 {
            view.corners.iter_mut().for_each(|corner| corner.number = last - corner.number);
        }
    }
    check(&compare(&truth, &calibrate(&kind, &seen).unwrap()));
}

#[test]
fn a_board_that_is_seen_in_part_is_enough() {
    let kind: BoardKind = "charuco:14x11:55mm".parse().unwrap();
    let truth = cameras(2, 35.0);
    let seen = filmed(&kind, &truth, 8.0, NOISE);
    let whole = seen.iter().flat_map(|camera| &camera.views).filter(|view| view.corners.len() == kind.corner_count());
    assert!(whole.count() < 40, "the board is too small for this test");
    check(&compare(&truth, &calibrate(&kind, &seen).unwrap()));
}

#[test]
fn wrong_corners_do_not_matter() {
    let truth = cameras(2, 35.0);
    let mut seen = filmed(&charuco(), &truth, 8.0, NOISE);
    for (k, view) in seen.iter_mut().flat_map(|camera| &mut camera.views).enumerate() {
        if let Some(corner) = view.corners.get_mut(k % 11) {
            corner.pixel.x += 9.0;
        }
        // One image in fifteen is of something else, and one mirrored.
        match k % 15 {
            4 => view.corners.iter_mut().for_each(|corner| corner.pixel.x += 25.0),
            11 => view.corners.iter_mut().for_each(|corner| corner.pixel.y = 480.0 - corner.pixel.y),
            _ => {}
        }
    }
    check(&compare(&truth, &calibrate(&charuco(), &seen).unwrap()));
}

#[test]
fn standard_errors_are_of_the_size_of_the_errors() {
    let truth = cameras(2, 35.0);
    let mut ratios: [Vec<f64>; 3] = Default::default();
    for shift in 0..12 {
        let mut seen = filmed(&charuco(), &truth, 6.0, 0.2);
        // Other images, and other noise.
        for camera in &mut seen {
            camera.views =
                camera.views.drain(..).enumerate().filter(|(k, _)| k % 12 != shift).map(|(_, v)| v).collect();
            for (k, view) in camera.views.iter_mut().enumerate() {
                let off = 0.2 * (((k * 7 + shift * 13) % 17) as f64 / 8.0 - 1.0);
                view.corners
                    .iter_mut()
                    .enumerate()
                    .for_each(|(n, c)| c.pixel.x += off * ((n * 31 + k * shift) as f64).sin());
            }
        }
        let found = calibrate(&charuco(), &seen).unwrap();
        for (off, camera) in compare(&truth, &found).into_iter().zip(&found.cameras) {
            ratios[0].push(off.focal / camera.errors.focal);
            if camera.errors.place > 0.0 {
                ratios[1].push(off.place / camera.errors.place);
                ratios[2].push(off.rotation.to_radians() / camera.errors.rotation);
            }
        }
    }
    for values in ratios {
        let root = (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        println!("{root:.2} of the standard error");
        assert!((0.2..2.5).contains(&root), "{root}");
    }
}

#[test]
fn what_the_images_do_not_tell_is_told() {
    let truth = cameras(2, 35.0);
    // A moment is nearly one tilt, in a part of the image.
    let mut short = filmed(&charuco(), &truth, 6.0, 6.0 * NOISE);
    short.iter_mut().for_each(|camera| camera.views.retain(|view| (1.0..1.3).contains(&view.time)));
    let found = calibrate(&charuco(), &short).unwrap();
    for says in ["focal length is uncertain", "of the image only", "its place is uncertain"] {
        assert!(found.remarks.iter().any(|remark| remark.contains(says)), "{says}: {:?}", found.remarks);
    }
    let seen = filmed(&charuco(), &truth, 6.0, NOISE);
    let mut few = seen.clone();
    few[1].views.truncate(4);
    assert!(error(&charuco(), &few).contains("cam1: only 4 of its images"));
    let mut none = seen.clone();
    none[1].views.clear();
    assert!(error(&charuco(), &none).contains("cam1: none of its 180 images"));
    // Waves, as of no board.
    let mut stretched = seen;
    for view in stretched.iter_mut().flat_map(|camera| &mut camera.views) {
        view.corners.iter_mut().for_each(|corner| corner.pixel.x += 30.0 * (0.05 * corner.pixel.y).sin());
    }
    let told = error(&charuco(), &stretched);
    assert!(told.contains("do not fit any camera"), "{told}");
    let mut other = BoardCamera::new("a", [640, 480], None);
    (0..5).for_each(|k| other.add(f64::from(k), Sight::Other([4 + k as usize % 3, 3])));
    let told = error(&charuco(), &[other]);
    assert!(told.contains("a: none of its 5 images"), "{told}");
}
