//! Writing `.spz` files, of version 3.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use ghand_files::atomic_file::write_atomically;

use super::{ANTIALIASED, COLOR_SCALE, MAGIC, MOST, TURNED, turned};
use crate::scene_files::{Antialiasing, PlyError, SplatScene};

const VERSION: u32 = 3;
/// Most bits after a position's point: a hand is known to a thousandth of a millimetre.
const MOST_BITS: u32 = 20;
/// Largest positive number of 24 bits.
const LARGEST: f64 = ((1 << 23) - 1) as f64;

impl SplatScene {
    /// The contents of a `.spz` file of version 3 with this scene. Positions are as exact as 24 bits allow, to a thousandth
    /// of a millimetre at best; sizes to 3 %, colours to 1/270, rotations to 0.1 degrees.
    ///
    /// # Errors
    /// [`PlyError::Invalid`] if there are more Gaussians than such a file may have, or a number is not finite or too large;
    /// [`PlyError::Write`] if it cannot be compressed.
    pub fn to_spz(&self, path: &Path) -> Result<Vec<u8>, PlyError> {
        let invalid =
            |field: &str, problem: String| PlyError::Invalid { path: path.into(), field: field.into(), problem };
        if self.count > MOST {
            return Err(invalid("Gaussians", format!("there are {}, more than {MOST}; write a .ply file", self.count)));
        }
        if self.table.iter().any(|v| v.is_nan()) {
            return Err(invalid("Gaussians", "a number is NaN; check the avatar and the pose".into()));
        }
        let model = self.model();
        let at = |row: usize, i: usize| f64::from(self.table[model.index(row, i, self.count)]);
        let farthest = self.means().map(|mean| mean.abs().max_element()).fold(0.0, f64::max);
        let bits = (0..=MOST_BITS).rev().find(|bits| farthest * f64::from(1u32 << bits) <= LARGEST);
        let Some(bits) = bits else {
            return Err(invalid("positions", format!("reach {farthest:e} m, too far for a .spz file")));
        };
        let mut data = vec![];
        data.extend(MAGIC);
        data.extend(VERSION.to_le_bytes());
        data.extend((self.count as u32).to_le_bytes());
        data.extend([
            self.degree as u8,
            bits as u8,
            if self.antialias == Antialiasing::Off { 0 } else { ANTIALIASED },
            0,
        ]);
        let all = 0..self.count;
        for i in all.clone() {
            for axis in 0..3 {
                let fixed = (turned(axis) * at(axis, i) * f64::from(1u32 << bits)).round() as i32;
                data.extend(&fixed.to_le_bytes()[..3]);
            }
        }
        data.extend(all.clone().map(|i| byte(255.0 / (1.0 + (-at(model.opacity_row(), i)).exp()))));
        let color = model.color_row();
        for i in all.clone() {
            data.extend((0..3).map(|c| byte((at(color + c, i) * COLOR_SCALE + 0.5) * 255.0)));
        }
        for i in all.clone() {
            data.extend((3..6).map(|row| byte((at(row, i) + 10.0) * 16.0)));
        }
        let first = model.rotation_row();
        for i in all.clone() {
            let rotation = [1, 2, 3, 0].map(|k| at(first + k, i));
            data.extend(smallest_three(std::array::from_fn(
                |k| if k < 3 { turned(k) * rotation[k] } else { rotation[3] },
            )));
        }
        for i in all {
            for row in color + 3..model.rows() {
                data.push(byte(TURNED[(row - color - 3) / 3] * at(row, i) * 128.0 + 128.0));
            }
        }
        let failed = |source| PlyError::Write { path: path.into(), source };
        let mut encoder = GzEncoder::new(vec![], Compression::best());
        encoder.write_all(&data).map_err(failed)?;
        encoder.finish().map_err(failed)
    }

    /// Writes [`SplatScene::to_spz`] to a file, atomically.
    ///
    /// # Errors
    /// As for [`SplatScene::to_spz`]; [`PlyError::Write`] if the file cannot be written.
    pub fn write_spz(&self, path: &Path) -> Result<(), PlyError> {
        let bytes = self.to_spz(path)?;
        write_atomically(path, &bytes).map_err(|source| PlyError::Write { path: path.into(), source })
    }
}

fn byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// A rotation (x, y, z, w of any norm) as the number of its largest entry and, in ten bits each, the three others.
fn smallest_three(rotation: [f64; 4]) -> [u8; 4] {
    let norm = rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
    let unit = if norm > 0.0 { rotation.map(|v| v / norm) } else { [0.0, 0.0, 0.0, 1.0] };
    let largest = (0..4).fold(0, |best, k| if unit[k].abs() > unit[best].abs() { k } else { best });
    // Both signs of all are the same rotation; the largest is stored as positive.
    let sign = unit[largest].signum();
    let mut word = largest as u32;
    for k in (0..4).filter(|k| *k != largest) {
        let value = sign * unit[k];
        let size = (value.abs() / std::f64::consts::FRAC_1_SQRT_2 * 511.0).round().min(511.0) as u32;
        word = word << 10 | u32::from(value < 0.0) << 9 | size;
    }
    word.to_le_bytes()
}

#[cfg(test)]
mod tests {
    use ghand_render::splat::SplatModel;

    use super::*;

    /// A scene of any degree with numbers as trained ones have them.
    fn scene(degree: u32, count: usize) -> SplatScene {
        let wave = |row: usize, i: usize| ((7 * row + 13 * i) as f64 * 0.61).sin() as f32;
        let value = |row: usize, i: usize| match row {
            0..3 => 0.2 * wave(row, i),
            3..6 => -7.0 + wave(row, i),
            6..10 => wave(row, i),
            10 => 4.0 * wave(row, i),
            11..14 => 1.5 * wave(row, i),
            _ => 0.6 * wave(row, i),
        };
        SplatScene {
            degree,
            count,
            table: SplatModel::trained(degree).table(count, value),
            antialias: if degree.is_multiple_of(2) { Antialiasing::Narrow } else { Antialiasing::Off },
        }
    }

    #[test]
    fn a_written_scene_is_read_back_within_the_formats_steps() {
        let folder = tempfile::tempdir().unwrap();
        for degree in 0..=3 {
            let path = folder.path().join("scene.spz");
            let written = scene(degree, 300);
            written.write_spz(&path).unwrap();
            let read = SplatScene::read(&path).unwrap();
            assert_eq!((read.count, read.degree, read.antialias), (300, degree, written.antialias));
            let worst = |rows: std::ops::Range<usize>, change: &dyn Fn(f64) -> f64| {
                rows.flat_map(|row| written.row(row).zip(read.row(row)).collect::<Vec<_>>())
                    .map(|(a, b)| (change(a.into()) - change(b.into())).abs())
                    .fold(0.0, f64::max)
            };
            assert!(worst(0..3, &|v| v) < 0.6 / f64::from(1 << 20));
            assert!(worst(3..6, &|v| v) < 0.5 / 16.0 + 1e-6);
            assert!(worst(10..11, &|v| 1.0 / (1.0 + (-v).exp())) < 0.51 / 255.0);
            assert!(worst(11..14, &|v| v) < 0.51 / 255.0 / COLOR_SCALE);
            assert!(worst(14..written.model().rows(), &|v| v) < 0.51 / 128.0);
            for i in 0..300 {
                let of = |scene: &SplatScene| {
                    let [w, x, y, z] = [6, 7, 8, 9].map(|row| f64::from(scene.row(row).nth(i).unwrap()));
                    glam::DQuat::from_xyzw(x, y, z, w).normalize()
                };
                assert!(of(&written).dot(of(&read)).abs() > 1.0 - 4e-6, "rotation {i}");
            }
        }
    }

    #[test]
    fn far_scenes_keep_fewer_bits_and_impossible_ones_are_refused() {
        let path = Path::new("far.spz");
        let mut far = scene(0, 3);
        far.table[0] = 900.0;
        let read = super::super::parse(&far.to_spz(path).unwrap()).unwrap();
        assert!((read.table[0] - 900.0).abs() < 1e-3);
        far.table[0] = 1e8;
        assert!(far.to_spz(path).unwrap_err().to_string().contains("far.spz: positions: reach 1e8 m"));
        far.table[0] = f32::NAN;
        assert!(far.to_spz(path).unwrap_err().to_string().contains("NaN"));
    }
}
