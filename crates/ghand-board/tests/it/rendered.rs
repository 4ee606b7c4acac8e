//! Cameras calibrated from rendered images.

use ghand_board::{BoardCamera, BoardFinder, BoardKind, calibrate};
use rayon::prelude::*;

use crate::scene::{Exposure, Filming, SIZE, cameras, compare, render};
use ghand_test_support::long;

const EXPOSURE: Exposure = Exposure { shutter: 0.008, noise: 3.0 };

fn searched(kind: &BoardKind, cameras: &[Filming], seconds: f64) -> Vec<BoardCamera> {
    let finder = BoardFinder::new(kind).unwrap();
    let film = |filming: &Filming| {
        let mut camera = BoardCamera::new(filming.lens.camera.id.clone(), SIZE, Some(0.0));
        let sights: Vec<_> = (0..(seconds * filming.rate) as u32)
            .into_par_iter()
            .map(|frame| {
                let time = f64::from(frame) / filming.rate;
                let image = render(kind, filming, time - filming.clock, EXPOSURE);
                (time, finder.find(&image, SIZE[0], SIZE[1]).unwrap())
            })
            .collect();
        sights.into_iter().for_each(|(time, sight)| camera.add(time, sight));
        camera
    };
    cameras.iter().map(film).collect()
}

#[test]
fn two_cameras_are_calibrated_from_noisy_blurred_images_of_lenses_that_distort() {
    if !long() {
        return;
    }
    for text in ["charuco:8x6:30mm", "aprilgrid:6x5:28mm"] {
        check(&text.parse().unwrap());
    }
}

fn check(kind: &BoardKind) {
    let mut truth = cameras(2, 40.0);
    // As half of the frames of 30 a second.
    truth.iter_mut().for_each(|filming| filming.rate = 15.0);
    truth[1].clock = 0.01;
    let found = calibrate(kind, &searched(kind, &truth, 6.0)).unwrap();
    for off in compare(&truth, &found) {
        assert!(off.focal < 0.005 && off.principal < 2.0 && off.pixels < 2.0, "{off:?}");
        assert!(off.rotation < 0.1 && off.place < 0.001 && off.clock.abs() < 0.001, "{off:?}");
    }
}
