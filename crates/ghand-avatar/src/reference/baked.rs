//! Twin of `baked.wgsl`.

use ghand_core::Pose;
use ghand_core::skeleton::{Affine, pose_skeleton};
use glam::{DMat3, DVec3};

use crate::deform::baked::{BakedTables, Component, GROUP, Precision, SMALLEST_SCALE};

/// A Gaussian before or after it is posed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BakedGaussian {
    /// Its centre, metres.
    pub mean: DVec3,
    /// Its standard deviation, metres.
    pub scale: f64,
    /// Its colour, display values.
    pub color: DVec3,
    /// Its normal; of unit length once it is posed, or zero.
    pub normal: DVec3,
}

fn unorm16(word: u32, half: u32) -> f64 {
    f64::from(word >> (16 * half) & 0xffff) / 65535.0
}

fn unorm8(word: u32, byte: u32) -> f64 {
    f64::from(word >> (8 * byte) & 0xff) / 255.0
}

fn snorm8(word: u32, byte: u32) -> f64 {
    (f64::from((word >> (8 * byte)) as u8 as i8) / 127.0).max(-1.0)
}

fn half(word: u32, half: u32) -> f64 {
    half::f16::from_bits((word >> (16 * half)) as u16).to_f64()
}

fn float(word: u32) -> f64 {
    f64::from(f32::from_bits(word))
}

impl BakedTables {
    /// A Gaussian at the mean, before it is skinned.
    pub fn mean_of(&self, p: usize) -> BakedGaussian {
        let word = |row: usize| self.means[row * self.count + p];
        match self.precision {
            Precision::F32 => {
                let vector = |row: usize| DVec3::from([0, 1, 2].map(|c| float(word(row + c))));
                BakedGaussian { mean: vector(0), scale: float(word(3)), color: vector(4), normal: vector(7) }
            }
            Precision::F16 | Precision::U8 => {
                let [corner, size] = self.bounds.map(|v| DVec3::from(v.map(f64::from)));
                let at = DVec3::new(unorm16(word(0), 0), unorm16(word(0), 1), unorm16(word(1), 0));
                BakedGaussian {
                    mean: corner + size * at,
                    scale: f64::from(self.max_scale) * unorm16(word(1), 1),
                    color: DVec3::from([0, 1, 2].map(|c| unorm8(word(2), c))),
                    normal: DVec3::from([0, 1, 2].map(|c| snorm8(word(3), c))),
                }
            }
        }
    }

    /// Joints of a Gaussian with their skinning weights; some may be 0.
    pub fn weights_of(&self, p: usize) -> Vec<(usize, f64)> {
        let group = &self.groups[p / GROUP];
        let joints = group.first_joint as usize..(group.first_joint + group.joints) as usize;
        joints
            .map(|j| (self.group_joints[j] as usize, unorm16(self.weights[j / 2 * GROUP + p % GROUP], j as u32 % 2)))
            .collect()
    }

    /// What an entry adds to a Gaussian of its group per unit of the component: offset, standard deviation, colour.
    pub fn values_of(&self, entry: usize, lane: usize) -> (DVec3, f64, DVec3) {
        let words = self.precision.value_words();
        let word = |row: usize| self.values[(entry * words + row) * GROUP + lane];
        let stored: [f64; 7] = match self.precision {
            Precision::F32 => std::array::from_fn(|i| float(word(i))),
            Precision::F16 => std::array::from_fn(|i| half(word(i / 2), i as u32 % 2)),
            Precision::U8 => std::array::from_fn(|i| snorm8(word(i / 4), i as u32 % 4)),
        };
        let [offset, scale, color] = self.entries[entry].factors.map(f64::from);
        let [x, y, z, s, r, g, b] = stored;
        (DVec3::new(x, y, z) * offset, s * scale, DVec3::new(r, g, b) * color)
    }

    /// The components in a pose.
    pub fn terms(&self, local: &[DMat3]) -> Vec<f64> {
        let feature = |k: usize| ghand_core::pose_response::rotation_features(&local[k]);
        let product =
            |gains: &[f32; 9], f: [f64; 9]| -> f64 { gains.iter().zip(f).map(|(g, f)| f64::from(*g) * f).sum() };
        let bend = |k: usize| product(&self.bends[k], feature(k));
        let term = |c: &Component| {
            let [k, other] = [c.joint as usize, c.other as usize];
            let sum = f64::from(c.product) * bend(k) * bend(other) + product(&c.gains, feature(k));
            sum.clamp(f64::from(c.limits[0]), f64::from(c.limits[1]))
        };
        self.components.iter().map(term).collect()
    }

    /// All Gaussians in a pose of a skeleton with these parents and rest joints (metres).
    pub fn posed(&self, parents: &[Option<usize>], joints: &[DVec3], pose: &Pose) -> Vec<BakedGaussian> {
        let chain = pose_skeleton(parents, joints, &pose.rotations);
        let terms = self.terms(&chain.local);
        (0..self.count)
            .map(|p| {
                let mut g = self.mean_of(p);
                let group = &self.groups[p / GROUP];
                for entry in group.first_entry as usize..(group.first_entry + group.entries) as usize {
                    let term = terms[self.entries[entry].component as usize];
                    let (offset, scale, color) = self.values_of(entry, p % GROUP);
                    g.mean += offset * term;
                    g.scale += scale * term;
                    g.color += color * term;
                }
                let map = self
                    .weights_of(p)
                    .iter()
                    .fold(Affine::ZERO, |sum, (k, w)| sum.add_scaled(*w, &chain.posed_from_rest[*k]));
                let [x, y, z] = [0, 1, 2].map(|row| map.linear.row(row));
                let n = g.normal;
                let turned = DVec3::new(y.cross(z).dot(n), z.cross(x).dot(n), x.cross(y).dot(n));
                BakedGaussian {
                    mean: map.apply(g.mean) + pose.translation,
                    scale: g.scale.max(SMALLEST_SCALE),
                    color: g.color.clamp(DVec3::ZERO, DVec3::ONE),
                    normal: turned.normalize_or_zero(),
                }
            })
            .collect()
    }
}
