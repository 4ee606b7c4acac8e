//! Views decoded in the background, within bounded memory.

use ghand_capture::{ViewStore, ViewStoreOptions};

use crate::fixtures::{assert_says, synthetic};

fn pairs() -> Vec<(usize, usize)> {
    synthetic().splits["train"].views.iter().map(|v| (v.camera, v.frame)).collect()
}

#[test]
fn views_equal_those_of_the_capture_cropped_to_the_hand_in_any_request_order() {
    let capture = synthetic();
    for (capacity, threads) in [(1 << 30, 1), (1 << 30, 3), (200_000, 2), (0, 2)] {
        let options = ViewStoreOptions { margin: 4, capacity, threads: Some(threads) };
        let store = ViewStore::new(capture, &options).unwrap();
        for pass in 0..2 {
            pairs().iter().for_each(|(camera, frame)| store.prefetch(*camera, *frame));
            for (camera, frame) in pairs() {
                let expected = capture.load_view(camera, frame).unwrap().cropped(&capture.cameras[camera], 4);
                assert!(*store.get(camera, frame).unwrap() == expected, "{camera} {frame} in pass {pass}");
                assert!(store.kept_bytes() <= capacity, "{} bytes of {capacity}", store.kept_bytes());
            }
        }
        let sizes = store.map(&pairs(), |view| view.pixels.len()).unwrap();
        let expected: Vec<usize> = pairs().iter().map(|(c, f)| store.get(*c, *f).unwrap().pixels.len()).collect();
        assert_eq!(sizes, expected);
        assert_eq!(capacity == 1 << 30, store.kept_bytes() > 200_000);
    }
}

#[test]
fn an_undecodable_view_is_an_error_on_every_request() {
    let mut capture = synthetic().clone();
    capture.images.image = "nowhere/{camera}/{frame}.png".into();
    let store = ViewStore::new(&capture, &ViewStoreOptions::default()).unwrap();
    store.prefetch(0, 0);
    for _ in 0..2 {
        assert_says(&store.get(0, 0).unwrap_err().to_string(), &["nowhere", "read the image"]);
    }
    assert_says(&store.map(&pairs(), |_| ()).unwrap_err().to_string(), &["nowhere"]);
    assert_says(&store.get(99, 0).unwrap_err().to_string(), &["cameras", "number 99"]);
}
