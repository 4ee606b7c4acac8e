//! Niantic's `.spz`, versions 1 to 3 (written in version 3): a header and one array after the other, compressed with gzip.
//!
//! Its axes are right, up and back; those of a `.ply` are right, down and front, so y and z are turned round.

mod write;

use std::f64::consts::FRAC_1_SQRT_2;
use std::io::Read;

use flate2::read::GzDecoder;
use ghand_render::splat::SplatModel;
use half::f16;

use super::{Antialiasing, Problem, SplatScene, logit_of, problem};

/// How a file begins.
pub(super) const GZIP: &[u8] = &[0x1f, 0x8b];
/// How it begins once it is decompressed; files of version 4 begin so.
pub(super) const MAGIC: &[u8] = b"NGSP";
/// Bytes of the header.
const HEADER: usize = 16;
/// Most Gaussians; Niantic's own reader takes no more.
const MOST: usize = 10_000_000;
/// The flag of scenes that were trained with antialiasing.
const ANTIALIASED: u8 = 1;
/// Stored colours are the harmonics of degree 0 times this, from the middle grey.
const COLOR_SCALE: f64 = 0.15;
/// The signs of the harmonics beyond the first where y and z are turned round.
const TURNED: [f64; 15] = [-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0];

/// The arrays of a file.
struct Arrays<'a> {
    version: u32,
    fraction: f64,
    positions: &'a [u8],
    alphas: &'a [u8],
    colors: &'a [u8],
    scales: &'a [u8],
    rotations: &'a [u8],
    harmonics: &'a [u8],
    /// Harmonics of a Gaussian.
    rest: usize,
}

pub(super) fn parse(bytes: &[u8]) -> Result<SplatScene, Problem> {
    let mut unpacked = GzDecoder::new(bytes);
    let mut header = [0; HEADER];
    if unpacked.read_exact(&mut header).is_err() || !header.starts_with(MAGIC) {
        return problem("header", "is not that of an SPZ file; copy it again, or give another kind of scene");
    }
    let word = |k: usize| header[4 * k..].first_chunk::<4>().map_or(0, |word| u32::from_le_bytes(*word));
    let version = word(1);
    let count = word(2) as usize;
    let degree = header[12];
    let fraction = header[13];
    if !(1..=3).contains(&version) {
        return problem("version", format!("is {version}; versions 1 to 3 are read, convert the scene to .ply"));
    }
    let rest = match degree {
        0..=3 => 3 * ((usize::from(degree) + 1).pow(2) - 1),
        other => return problem("degree", format!("of the harmonics is {other}; at most 3 is drawn, reduce it")),
    };
    if count > MOST || fraction > 24 {
        return problem("header", format!("has {count} Gaussians of {fraction} bits after the point; copy it again"));
    }
    let position = if version == 1 { 6 } else { 9 };
    let rotation = if version == 3 { 4 } else { 3 };
    let lengths = [position, 1, 3, 3, rotation, rest].map(|stride| stride * count);
    let wanted: usize = lengths.iter().sum();
    let mut data = vec![];
    // What is more than wanted is not read, however much it is.
    let read = unpacked.take(wanted as u64).read_to_end(&mut data);
    if read.is_err() || data.len() < wanted {
        let text = format!("has {} of {wanted} bytes; the file is truncated, copy it again", data.len());
        return problem("data", text);
    }
    let mut left = data.as_slice();
    let [positions, alphas, colors, scales, rotations, harmonics] = lengths.map(|length| {
        let (own, others) = left.split_at(length);
        left = others;
        own
    });
    let fraction = f64::from(1u32 << fraction);
    let arrays = Arrays { version, fraction, positions, alphas, colors, scales, rotations, harmonics, rest };
    let degree = u32::from(degree);
    let table = SplatModel::trained(degree).table(count, |row, i| arrays.number(row, i) as f32);
    let antialias = if header[14] & ANTIALIASED == 0 { Antialiasing::Off } else { Antialiasing::Narrow };
    Ok(SplatScene { degree, count, table, antialias })
}

impl Arrays<'_> {
    fn number(&self, row: usize, i: usize) -> f64 {
        let of = |array: &[u8], k: usize| f64::from(array[3 * i + k]);
        match row {
            0..3 => turned(row) * self.position(i, row),
            3..6 => of(self.scales, row - 3) / 16.0 - 10.0,
            6 => self.rotation(i)[3],
            7..10 => turned(row - 7) * self.rotation(i)[row - 7],
            10 => logit_of(f64::from(self.alphas[i]) / 255.0),
            11..14 => (of(self.colors, row - 11) / 255.0 - 0.5) / COLOR_SCALE,
            _ => {
                // As in the table, red, green and blue of a function lie together.
                let stored = self.harmonics[self.rest * i + row - 14];
                TURNED[(row - 14) / 3] * (f64::from(stored) - 128.0) / 128.0
            }
        }
    }

    fn position(&self, i: usize, axis: usize) -> f64 {
        let at = 3 * i + axis;
        if self.version == 1 {
            return f16::from_le_bytes([self.positions[2 * at], self.positions[2 * at + 1]]).to_f64();
        }
        let [a, b, c] = [0, 1, 2].map(|k| self.positions[3 * at + k]);
        // The sign comes from the highest byte.
        f64::from(i32::from_le_bytes([0, a, b, c]) >> 8) / self.fraction
    }

    /// x, y, z, w.
    fn rotation(&self, i: usize) -> [f64; 4] {
        let rest = |known: &[f64]| (1.0 - known.iter().map(|v| v * v).sum::<f64>()).max(0.0).sqrt();
        if self.version < 3 {
            let [x, y, z] = [0, 1, 2].map(|k| f64::from(self.rotations[3 * i + k]) / 127.5 - 1.0);
            return [x, y, z, rest(&[x, y, z])];
        }
        let mut word = self.rotations[4 * i..].first_chunk::<4>().map_or(0, |word| u32::from_le_bytes(*word));
        let largest = (word >> 30) as usize;
        let mut rotation = [0.0; 4];
        for k in (0..4).rev().filter(|k| *k != largest) {
            let size = FRAC_1_SQRT_2 * f64::from(word & 511) / 511.0;
            rotation[k] = if word >> 9 & 1 == 1 { -size } else { size };
            word >>= 10;
        }
        rotation[largest] = rest(&rotation);
        rotation
    }
}

/// The sign of an axis.
fn turned(axis: usize) -> f64 {
    if axis == 0 { 1.0 } else { -1.0 }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::super::{Antialiasing, parse_any};

    fn packed(data: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(vec![], Compression::fast());
        encoder.write_all(data).unwrap();
        encoder.finish().unwrap()
    }

    /// A header with these numbers, then one Gaussian at (1, 2, -3), of size e^-4, opacity 0.8, red, turned by a quarter
    /// about y.
    fn file(version: u32, count: u32, degree: u8, flags: u8) -> Vec<u8> {
        let mut data = [&b"NGSP"[..], &version.to_le_bytes(), &count.to_le_bytes(), &[degree, 12, flags, 0]].concat();
        for v in [1.0f32, 2.0, -3.0] {
            match version {
                1 => data.extend(half::f16::from_f32(v).to_le_bytes()),
                _ => data.extend(&((v * 4096.0) as i32).to_le_bytes()[..3]),
            }
        }
        data.extend([204, 166, 89, 128, 96, 96, 96]);
        match version {
            // w is the largest, y is 0.7071.
            3 => data.extend((3u32 << 30 | 511 << 10).to_le_bytes()),
            _ => data.extend([128, 218, 128]),
        }
        data.extend((0..3 * ((degree + 1).pow(2) - 1)).map(|k| if k < 3 { 192 } else { 128 }));
        data
    }

    #[test]
    fn all_versions_give_the_scene_with_the_axes_of_a_ply() {
        for version in 1..=3 {
            let scene = parse_any(&packed(&file(version, 1, 1, 1)), "spz").unwrap();
            assert!((scene.count, scene.degree, scene.antialias) == (1, 1, Antialiasing::Narrow), "{version}");
            let expected = [1.0, -2.0, 3.0, -4.0, -4.0, -4.0, 0.707, 0.0, -0.707, 0.0, 1.386, 1.007, -1.007, 0.013];
            // The first function beyond is odd in y.
            let rest = [-0.5, -0.5, -0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            for (row, value) in expected.into_iter().chain(rest).enumerate() {
                let found = f64::from(scene.row(row).next().unwrap());
                assert!((found - value).abs() < 6e-3, "version {version}, row {row}: {found} instead of {value}");
            }
        }
        assert_eq!(parse_any(&packed(&file(2, 1, 0, 2)), "spz").unwrap().antialias, Antialiasing::Off);
    }

    #[test]
    fn damaged_files_are_errors_that_name_the_part() {
        let good = packed(&file(2, 1, 2, 0));
        for (bytes, part) in [
            (packed(&file(2, 2, 0, 0)), "of 38 bytes"),
            (packed(&file(2, 4_000_000_000, 0, 0)), "4000000000 Gaussians"),
            (packed(&file(9, 1, 0, 0)), "version: is 9"),
            (packed(&file(2, 1, 4, 0)), "degree"),
            (packed(b"something else that is long enough"), "not that of an SPZ"),
            (good[..good.len() / 2].to_vec(), "copy it again"),
            (file(2, 1, 0, 0), "version 4"),
            (b"nonsense".to_vec(), "not that of an SPZ"),
        ] {
            let (field, text) = parse_any(&bytes, "spz").unwrap_err();
            assert!(format!("{field}: {text}").contains(part), "{field}: {text}");
        }
    }
}
