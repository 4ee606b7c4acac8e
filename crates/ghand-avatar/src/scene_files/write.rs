//! Writing scenes, and posed hands as scenes.

use std::path::Path;

use ghand_files::atomic_file::write_atomically;
use ghand_render::splat::{FLATNESS, Shape, SplatModel};
use glam::{DQuat, DVec3};

use super::{Antialiasing, PlyError, SplatScene, WIDE_COMMENT};

/// The exported opacity of an opaque Gaussian. Scenes store logits, and the logit of 1 is infinite; this value is so
/// close to 1 that no 8-bit value of a picture changes by more than one.
pub const EXPORTED_OPACITY: f64 = 0.99999;

/// The logit of [`EXPORTED_OPACITY`], 11.513.
pub fn exported_logit() -> f32 {
    (EXPORTED_OPACITY / (1.0 - EXPORTED_OPACITY)).ln() as f32
}

/// The spherical harmonic of degree 0, 1 / (2 sqrt(pi)).
pub(super) const SH_0: f64 = 0.282_094_791_773_878_14;
/// The sum of the harmonics is added to this grey.
pub(super) const GREY: f64 = 0.5;

impl SplatScene {
    /// Converts a table of [`SplatModel::HAND`] with this shape, `[rows][N]`, to a scene that looks the same. The
    /// opaque Gaussians with view-independent colour get three sizes, equal unless they are flat, a rotation from the z
    /// axis to their normal, the logit of [`EXPORTED_OPACITY`], and harmonics of degree 0.
    pub fn of_hand(table: &[f32], shape: Shape) -> SplatScene {
        let hand = SplatModel { shape, ..SplatModel::HAND };
        let model = SplatModel::trained(0);
        let count = table.len() / hand.rows();
        let row = |row: usize| table.iter().skip(row * count).take(count).copied();
        let mut scene = Vec::with_capacity(model.rows() * count);
        (0..SplatModel::SCALE_ROW).for_each(|axis| scene.extend(row(axis)));
        let normal = |i: usize| match shape {
            Shape::Flat => {
                DVec3::from([0, 1, 2].map(|c| f64::from(table[(hand.rotation_row() + c) * count + i]))).try_normalize()
            }
            _ => None,
        };
        for axis in 0..model.scale_rows() {
            let factor = |i: usize| if axis == 2 && normal(i).is_some() { FLATNESS } else { 1.0 };
            let scales = row(SplatModel::SCALE_ROW).enumerate();
            scene.extend(scales.map(|(i, scale)| (f64::from(scale) * factor(i)).ln() as f32));
        }
        let rotations: Vec<DQuat> = (0..count)
            .map(|i| normal(i).map_or(DQuat::IDENTITY, |normal| DQuat::from_rotation_arc(DVec3::Z, normal)))
            .collect();
        for component in [|q: &DQuat| q.w, |q: &DQuat| q.x, |q: &DQuat| q.y, |q: &DQuat| q.z] {
            scene.extend(rotations.iter().map(|q| component(q) as f32));
        }
        scene.extend(std::iter::repeat_n(exported_logit(), count));
        // One basis function: red, green and blue of a Gaussian lie together.
        let colors =
            (0..count).flat_map(|i| (0..3).map(move |channel| table[(hand.color_row() + channel) * count + i]));
        scene.extend(colors.map(|color| ((f64::from(color) - GREY) / SH_0) as f32));
        SplatScene { degree: 0, count, table: scene, antialias: Antialiasing::Off }
    }

    /// The contents of a `.ply` file with this scene: binary, little-endian, with the same properties in the same order
    /// as trainers of 3D Gaussian Splatting write, including normals (all zero). Comments say if the scene is antialiased.
    pub fn to_ply(&self) -> Vec<u8> {
        let model = self.model();
        let rest = model.color_bases() - 1;
        let rotation = model.rotation_row();
        let opacity = model.opacity_row();
        let color = model.color_row();
        // Name and table row of each property; normals have no row.
        let named = |name: &str, rows: std::ops::Range<usize>| -> Vec<(String, Option<usize>)> {
            rows.enumerate().map(|(k, row)| (format!("{name}_{k}"), Some(row))).collect()
        };
        let mut properties: Vec<(String, Option<usize>)> =
            [("x", Some(0)), ("y", Some(1)), ("z", Some(2)), ("nx", None), ("ny", None), ("nz", None)]
                .map(|(name, row)| (name.to_owned(), row))
                .to_vec();
        properties.extend(named("f_dc", color..color + 3));
        // Files order the harmonics by channel, the table by basis function.
        let functions = (0..3).flat_map(|channel| (1..=rest).map(move |function| color + 3 * function + channel));
        properties.extend(functions.enumerate().map(|(k, row)| (format!("f_rest_{k}"), Some(row))));
        properties.push(("opacity".into(), Some(opacity)));
        properties.extend(named("scale", SplatModel::SCALE_ROW..rotation));
        properties.extend(named("rot", rotation..opacity));

        let comment = match self.antialias {
            Antialiasing::Off => String::new(),
            Antialiasing::Narrow => "comment SplatRenderMode: mip\n".into(),
            Antialiasing::Wide => format!("comment SplatRenderMode: mip\ncomment {WIDE_COMMENT}\n"),
        };
        let mut header = format!("ply\nformat binary_little_endian 1.0\n{comment}element vertex {}\n", self.count);
        properties.iter().for_each(|(name, _)| header.push_str(&format!("property float {name}\n")));
        header.push_str("end_header\n");
        let mut bytes = header.into_bytes();
        bytes.reserve(4 * properties.len() * self.count);
        for i in 0..self.count {
            for (_, row) in &properties {
                let value = row.and_then(|row| self.table.get(model.index(row, i, self.count))).copied().unwrap_or(0.0);
                bytes.extend(value.to_le_bytes());
            }
        }
        bytes
    }

    /// The same scene with harmonics of this degree, for programs that want those of a trained scene: missing ones are 0,
    /// surplus ones are omitted.
    #[must_use]
    pub fn with_degree(&self, degree: u32) -> SplatScene {
        let own = self.model();
        let rows = own.rows();
        let value = |row: usize, i: usize| match row < rows {
            true => self.table.get(own.index(row, i, self.count)).copied().unwrap_or_default(),
            false => 0.0,
        };
        SplatScene { degree, table: SplatModel::trained(degree).table(self.count, value), ..*self }
    }

    /// Writes [`SplatScene::to_ply`] to a file, atomically.
    ///
    /// # Errors
    /// [`PlyError::Write`] names the file.
    pub fn write(&self, path: &Path) -> Result<(), PlyError> {
        write_atomically(path, &self.to_ply()).map_err(|source| PlyError::Write { path: path.into(), source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_scene_of_any_degree_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.ply");
        for degree in 0..=3 {
            let count = 5;
            let table = (0..SplatModel::trained(degree).rows() * count).map(|k| (k as f32 * 0.37).sin()).collect();
            let antialias = [Antialiasing::Off, Antialiasing::Narrow, Antialiasing::Wide][degree.min(2) as usize];
            let scene = SplatScene { degree, count, table, antialias };
            scene.write(&path).unwrap();
            let says = scene.to_ply().windows(20).any(|part| part == b"SplatRenderMode: mip");
            assert_eq!(says, antialias != Antialiasing::Off);
            assert_eq!(SplatScene::read(&path).unwrap(), scene);
        }
    }

    #[test]
    fn a_scene_padded_to_degree_3_has_62_numbers_a_gaussian_and_looks_the_same() {
        let table = (0..SplatModel::trained(0).rows() * 4).map(|k| (k as f32 * 0.31).cos()).collect();
        let scene = SplatScene { degree: 0, count: 4, table, antialias: Antialiasing::Narrow };
        let padded = scene.with_degree(3);
        let ply = padded.to_ply();
        let text = String::from_utf8_lossy(&ply[..4000.min(ply.len())]).into_owned();
        assert_eq!(text.matches("property float ").count(), 62);
        let end = text.find("end_header\n").unwrap() + "end_header\n".len();
        assert_eq!(ply.len() - end, 4 * 62 * 4);
        assert!((0..14).all(|row| padded.row(row).eq(scene.row(row))));
        assert!((14..padded.model().rows()).all(|row| padded.row(row).all(|v| v == 0.0)));
        assert_eq!(padded.with_degree(0), scene);
    }

    #[test]
    fn the_properties_and_their_order_match_those_of_trainers() {
        let scene = SplatScene { degree: 1, count: 0, table: vec![], antialias: Antialiasing::Off };
        let text = String::from_utf8(scene.to_ply()).unwrap();
        let names: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("property float ")).collect();
        let expected = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 f_rest_0 f_rest_1 f_rest_2 f_rest_3 f_rest_4 f_rest_5 \
                        f_rest_6 f_rest_7 f_rest_8 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
        assert_eq!(names.join(" "), expected);
        assert!(text.starts_with("ply\nformat binary_little_endian 1.0\nelement vertex 0\n"));
    }

    #[test]
    fn an_exported_hand_is_a_finite_scene_of_the_same_gaussians() {
        let rows: [[f32; 2]; 7] =
            [[0.1, -0.2], [0.0, 0.3], [0.5, 0.4], [0.001, 0.0025], [0.0, 1.0], [0.25, 0.5], [0.75, 0.1]];
        let scene = SplatScene::of_hand(rows.as_flattened(), Shape::Isotropic);
        assert_eq!((scene.count, scene.degree, scene.table.len()), (2, 0, 14 * 2));
        assert!(scene.table.iter().all(|v| v.is_finite()));
        (0..2usize).for_each(|i| {
            let at = |row: usize| f64::from(scene.table[scene.model().index(row, i, 2)]);
            let near = |a: f64, b: f32| assert!((a - f64::from(b)).abs() < 1e-6, "{a} {b}");
            let row = |k: usize| rows[k][i];
            (0..3).for_each(|axis| near(at(axis), row(axis)));
            (3..6).for_each(|k| near(at(k).exp() * 1e2, row(3) * 1e2));
            assert_eq!([6, 7, 8, 9].map(at), [1.0, 0.0, 0.0, 0.0]);
            near(1.0 / (1.0 + (-at(10)).exp()), EXPORTED_OPACITY as f32);
            (0..3).for_each(|c| near(0.5 + 0.282_094_79 * at(11 + c), row(4 + c)));
        });
    }

    #[test]
    fn an_exported_flat_gaussian_is_thin_along_its_normal() {
        let normal = [0.6f32, 0.0, -0.8];
        let rows =
            [[0.1, 0.0], [0.2, 0.0], [0.3, 0.0], [0.01, 0.02], [normal[0], 0.0], [normal[1], 0.0], [normal[2], 0.0]];
        let scene = SplatScene::of_hand([&rows[..], &[[0.5; 2]; 3]].concat().as_flattened(), Shape::Flat);
        let at = |row: usize, i: usize| f64::from(scene.table[row * 2 + i]);
        let scales = |i: usize| [3, 4, 5].map(|row| (at(row, i).exp() * 1e4).round());
        assert_eq!((scales(0), scales(1)), ([100.0, 100.0, 20.0], [200.0; 3]));
        let turned = DQuat::from_xyzw(at(7, 0), at(8, 0), at(9, 0), at(6, 0)) * DVec3::Z;
        assert!(turned.distance(DVec3::from(normal.map(f64::from))) < 1e-6, "{turned}");
        assert_eq!([6, 7, 8, 9].map(|row| at(row, 1)), [1.0, 0.0, 0.0, 0.0], "without a normal it is round");
    }
}
