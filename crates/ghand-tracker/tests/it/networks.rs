//! Networks: the numbers of the original, and hostile files.

use ghand_tracker::Network;

const PALMS: &[u8] = include_bytes!("../../../../assets/hand-tracker/palm_detection_full.tflite");
const LANDMARKS: &[u8] = include_bytes!("../../../../assets/hand-tracker/hand_landmark_full.tflite");

/// A smooth made-up picture.
fn waves(edge: usize) -> Vec<f32> {
    let wave = |y: usize, x: usize, c: usize| 0.5 + 0.5 * (0.05 * x as f64 + 0.03 * y as f64 + c as f64).sin();
    let numbers = (0..edge * edge * 3).map(|k| wave(k / 3 / edge, k / 3 % edge, k % 3) as f32);
    numbers.collect()
}

/// A small generator: the cases are the same in each run.
fn random(state: &mut u64) -> usize {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as usize
}

#[test]
fn outputs_are_those_of_tensorflow_lite() {
    // From `ai_edge_litert` on the same input: output, index, number. Sums differ in their order only.
    let palms = [
        (0, 0, 2.210628),
        (0, 6047, 4.471709),
        (0, 12095, 8.971502),
        (0, 18143, 9.598189),
        (0, 24191, 10.528),
        (0, 30239, 24.985102),
        (0, 36287, -2.901664),
        (1, 0, -8.455997),
        (1, 335, -7.416464),
        (1, 671, -7.388546),
        (1, 1007, -6.905465),
        (1, 1343, -9.823341),
        (1, 1679, -10.271726),
        (1, 2015, -6.901298),
    ];
    let landmarks = [
        (0, 0, 126.221458),
        (0, 10, 123.931595),
        (0, 20, -4.758162),
        (0, 31, 84.660042),
        (0, 41, -1.600633),
        (0, 51, 117.209663),
        (0, 62, 2.547836),
        (1, 0, 0.000182),
        (2, 0, 0.736637),
        (3, 0, 0.017276),
        (3, 10, 0.017093),
        (3, 20, -0.01652),
        (3, 31, -0.061411),
        (3, 41, 0.003861),
        (3, 51, -0.00115),
        (3, 62, 0.050572),
    ];
    for (bytes, edge, expected) in [(PALMS, 192, &palms[..]), (LANDMARKS, 224, &landmarks[..])] {
        let outputs = Network::from_tflite(bytes).unwrap().run(&waves(edge)).unwrap();
        for &(output, index, expected) in expected {
            let got = f64::from(outputs[output][index]);
            let error = (got - expected).abs();
            assert!(error <= 2e-4 * expected.abs() + 2e-5, "{output}, {index}: {got}, not {expected}");
        }
    }
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let network = Network::from_tflite(LANDMARKS).unwrap();
    let input = waves(224);
    assert_eq!(network.run(&input).unwrap(), network.run(&input).unwrap());
    let error = network.run(&input[1..]).unwrap_err();
    assert!(error.to_string().contains("150528"), "{error}");
}

#[test]
fn hostile_bytes_are_an_error() {
    for bytes in [&[][..], b"TFL3", b"\0\0\0\0TFL3", b"\xff\xff\xff\xffTFL3", &[0; 64]] {
        assert!(Network::from_tflite(bytes).is_err());
    }
    for end in [100, 1000, 10_000, PALMS.len() / 2, PALMS.len() - 4096] {
        assert!(Network::from_tflite(&PALMS[..end]).is_err(), "{end}");
    }
    let mut state = 1;
    let mut refused = 0;
    let mut run = 0;
    for case in 0..ghand_test_support::cases(200, 5000) {
        let mut bytes = LANDMARKS.to_vec();
        // The graph is at the end, weights are at the beginning.
        let start = bytes.len() - 40_000;
        for _ in 0..1 + case % 8 {
            let place = start + random(&mut state) % 40_000;
            bytes[place] = random(&mut state) as u8;
        }
        match Network::from_tflite(&bytes) {
            Err(_) => refused += 1,
            Ok(network) if network.input_size() == 224 * 224 * 3 && run < 20 => {
                run += 1;
                assert!(network.run(&waves(224)).is_ok());
            }
            Ok(_) => {}
        }
    }
    assert!(refused > 20 && run > 0, "{refused} refused, {run} run");
}
