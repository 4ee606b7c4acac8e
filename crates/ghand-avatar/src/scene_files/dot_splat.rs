//! `.splat`: 32 bytes for each Gaussian, without a header. Position and standard deviations are floats, colour, opacity and
//! quaternion a byte each.

use ghand_render::splat::SplatModel;

use super::{Antialiasing, Problem, SplatScene, dc_of, logit_of, problem};

const STRIDE: usize = 32;

pub(super) fn parse(bytes: &[u8]) -> Result<SplatScene, Problem> {
    let count = bytes.len() / STRIDE;
    if count == 0 || !bytes.len().is_multiple_of(STRIDE) {
        let text = format!("is {} bytes, but a .splat has {STRIDE} for each Gaussian; copy it again", bytes.len());
        return problem("file", text);
    }
    let float = |i: usize, k: usize| {
        let start = i * STRIDE + 4 * k;
        f64::from(bytes[start..].first_chunk::<4>().map_or(0.0, |word| f32::from_le_bytes(*word)))
    };
    let byte = |i: usize, k: usize| f64::from(bytes[i * STRIDE + 24 + k]);
    let number = |row: usize, i: usize| match row {
        0..3 => float(i, row),
        3..6 => float(i, row).ln(),
        6..10 => (byte(i, row - 2) - 128.0) / 128.0,
        10 => logit_of(byte(i, 3) / 255.0),
        _ => dc_of(byte(i, row - 11) / 255.0),
    };
    let table = SplatModel::trained(0).table(count, |row, i| number(row, i) as f32);
    Ok(SplatScene { degree: 0, count, table, antialias: Antialiasing::Off })
}

#[cfg(test)]
mod tests {
    use super::super::parse_any;

    fn gaussian(place: [f32; 3], size: f32, color: [u8; 4], rotation: [u8; 4]) -> Vec<u8> {
        let floats = [place, [size, 2.0 * size, 3.0 * size]].concat();
        let bytes = floats.iter().flat_map(|v| v.to_le_bytes());
        bytes.chain(color).chain(rotation).collect()
    }

    #[test]
    fn sizes_become_logarithms_and_bytes_numbers() {
        let bytes = [
            gaussian([1.0, -2.0, 3.5], 0.01, [255, 0, 128, 204], [255, 128, 128, 128]),
            gaussian([0.0; 3], 0.5, [0, 255, 0, 255], [128, 0, 128, 128]),
        ]
        .concat();
        let scene = parse_any(&bytes, "splat").unwrap();
        let expected = [
            [1.0, -2.0, 3.5, -4.605, -3.912, -3.507, 0.992, 0.0, 0.0, 0.0, 1.386, 1.772, -1.772, 0.007],
            [0.0, 0.0, 0.0, -0.693, 0.0, 0.405, 0.0, -1.0, 0.0, 0.0, 11.513, -1.772, 1.772, -1.772],
        ];
        for (i, numbers) in expected.iter().enumerate() {
            for (row, value) in numbers.iter().enumerate() {
                let found = f64::from(scene.row(row).nth(i).unwrap());
                assert!((found - value).abs() < 2e-3, "Gaussian {i}, row {row}: {found} instead of {value}");
            }
        }
        for wrong in [&bytes[..33], &[]] {
            assert_eq!(parse_any(wrong, "splat").unwrap_err().0, "file");
        }
    }
}
