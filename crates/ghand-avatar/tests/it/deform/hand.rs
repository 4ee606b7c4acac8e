//! A hand of random numbers, deformed forward and backward on the device, with the intermediate results of all stages.

use std::sync::LazyLock;

use ghand_avatar::deform::{
    CHAIN_STRIDE, CoefficientLayout, DeformTemplate, Deformation, DeformationBackward, Properties, ROW_MOMENT,
    TablePlace,
};
use ghand_core::Pose;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skeleton::{Affine, Chain, pose_skeleton};
use ghand_core::skinning::ResidualWeights;
use ghand_render::splat::Shape;
use ghand_render::{AdapterChoice, Gpu, buffers};
use glam::{DMat3, DVec3};
use rand::{RngExt, SeedableRng};

/// Number of Gaussians of the hand, and position and size of the splatter's table around it.
pub const COUNT: usize = 333;
pub const PLACE: TablePlace = TablePlace { columns: 400, first: 50, shape: Shape::Isotropic };
pub const JOINTS: usize = 7;
pub const BASES: usize = 3;
pub const PARENTS: [Option<usize>; JOINTS] = [None, Some(0), Some(1), Some(2), Some(0), Some(4), Some(0)];

/// Those before and after each Gaussian; the first and the last have one.
pub static NEIGHBORS: LazyLock<Vec<u32>> = LazyLock::new(|| {
    let before = (0..COUNT as u32).map(|p| p.saturating_sub(1));
    before.chain((0..COUNT as u32).map(|p| (p + 1).min(COUNT as u32 - 1))).collect()
});

/// The options of a hand.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    pub coefficients: CoefficientLayout,
    pub weights: ResidualWeights,
    pub skeleton: ResidualSkeleton,
    /// Size of the rotations, radians.
    pub angle: f64,
}

pub fn kinds() -> Vec<Kind> {
    let mut kinds = Vec::new();
    for coefficients in [CoefficientLayout::PerBasis, CoefficientLayout::PerComponent] {
        for weights in [ResidualWeights::Paper, ResidualWeights::ZeroSum] {
            for skeleton in [ResidualSkeleton::Paper, ResidualSkeleton::Anchored] {
                for angle in [0.0, 1e-6, 3.0] {
                    kinds.push(Kind { coefficients, weights, skeleton, angle });
                }
            }
        }
    }
    kinds
}

/// The inputs, and the device's results.
pub struct Run {
    pub kind: Kind,
    pub pose: Pose,
    pub joints: Vec<DVec3>,
    pub weights: Vec<f64>,
    pub rest: Vec<DVec3>,
    pub rest_normals: Vec<DVec3>,
    pub shape_basis: Vec<DVec3>,
    pub coefficients: Vec<DVec3>,
    pub residual_weights: Vec<f64>,
    pub regressor: Vec<f64>,
    pub chain: Chain,
    pub residual_joints: Vec<DVec3>,
    /// The input of skinning: without the mean, or without the root's translation.
    pub residual_bones: Vec<Affine>,
    pub offsets: Vec<DVec3>,
    pub points: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    /// The whole table, `[7][columns]`.
    pub table: Vec<f64>,
    pub scale: Vec<f64>,
    pub color: Vec<f64>,
    /// Gradient of the posed means.
    pub d_posed: Vec<DVec3>,
    /// dL/d(offset) before and after the residual skeleton.
    pub d_points: Vec<DVec3>,
    pub d_offsets: Vec<DVec3>,
    pub d_moments: Vec<f64>,
    pub d_shape_basis: Vec<DVec3>,
    pub d_coefficients: Vec<f64>,
    pub d_residual_weights: Vec<f64>,
    pub d_regressor: Vec<f64>,
    pub d_scale: Vec<f64>,
    pub d_color: Vec<f64>,
    pub d_table: Vec<f64>,
    pub d_local: Vec<DMat3>,
    pub d_joints: Vec<DVec3>,
    pub d_pose: Vec<f64>,
}

pub fn gpu() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"))
}

pub fn random(seed: u64, count: usize, size: f32) -> Vec<f32> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| rng.random_range(-size..size)).collect()
}

pub fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|v| f64::from(*v)).collect()
}

/// Vectors of `count` columns, each from three rows.
pub fn planes(values: &[f64], count: usize) -> Vec<DVec3> {
    let at = |row: usize, p: usize| values[row * count + p];
    (0..values.len() / (3 * count))
        .flat_map(|i| (0..count).map(move |p| DVec3::new(at(3 * i, p), at(3 * i + 1, p), at(3 * i + 2, p))))
        .collect()
}

pub fn vectors(values: &[f64]) -> Vec<DVec3> {
    values.chunks_exact(3).map(DVec3::from_slice).collect()
}

fn rows3(v: &[f64]) -> DMat3 {
    DMat3::from_cols_slice(v).transpose()
}

fn affine(v: &[f64]) -> Affine {
    let linear = DMat3::from_cols_array(&[v[0], v[4], v[8], v[1], v[5], v[9], v[2], v[6], v[10]]);
    Affine { linear, translation: DVec3::new(v[3], v[7], v[11]) }
}

/// The bones of a chain table.
fn bones(table: &[f64]) -> Vec<Affine> {
    table.chunks_exact(CHAIN_STRIDE).map(|joint| affine(&joint[21..])).collect()
}

fn chain(table: &[f64]) -> Chain {
    let joints = || table.chunks_exact(CHAIN_STRIDE);
    Chain {
        local: joints().map(|joint| rows3(&joint[..9])).collect(),
        world: joints().map(|joint| affine(&joint[9..])).collect(),
        posed_from_rest: bones(table),
    }
}

impl Run {
    pub fn new(gpu: &Gpu, kind: Kind) -> Run {
        let mut weights: Vec<f32> = random(1, JOINTS * COUNT, 1.0).iter().map(|w| w.abs()).collect();
        for p in 0..COUNT {
            // As a hand's, where each joint moves a few Gaussians beside each other.
            (0..JOINTS).filter(|k| (k + p / 50) % 3 > 0).for_each(|k| weights[k * COUNT + p] = 0.0);
            let sum: f32 = (0..JOINTS).map(|k| weights[k * COUNT + p]).sum();
            (0..JOINTS).for_each(|k| weights[k * COUNT + p] /= sum);
        }
        let rest = random(3, 3 * COUNT, 0.1);
        let joints = random(2, 3 * JOINTS, 0.1);
        let normals: Vec<DVec3> =
            planes(&widen(&random(11, 3 * COUNT, 1.0)), COUNT).iter().map(|n| n.normalize()).collect();
        let normals: Vec<f32> = (0..3).flat_map(|c| normals.iter().map(move |n| n[c] as f32)).collect();
        let parents = PARENTS.map(|p| p.map_or(-1, |p| p as i32));
        let template = DeformTemplate {
            rest: &rest,
            weights: &weights,
            normals: Some(&normals),
            neighbors: &NEIGHBORS,
            joints: &joints,
            parents: &parents,
            basis_count: BASES,
            coefficients: kind.coefficients,
            frames: 2,
            plain_skinning: false,
            anchored: kind.skeleton == ResidualSkeleton::Anchored,
            zero_sum: kind.weights == ResidualWeights::ZeroSum,
            lit_surface: None,
        };
        let columns = PLACE.columns;
        let gaussians = buffers::zeroed(gpu, "gaussians", 7 * columns);
        let d_table = random(10, 7 * columns, 1.0);
        let d_gaussians = buffers::filled(gpu, "d_gaussians", &d_table);
        let mut deformation = Deformation::new(gpu, &template, &gaussians, PLACE);
        let backward = DeformationBackward::new(gpu, &deformation, &d_gaussians, &[1.0; JOINTS]);
        let rows = kind.coefficients.rows();
        let sizes = [3 * BASES * COUNT, rows * BASES * COUNT, JOINTS * COUNT, JOINTS * COUNT, COUNT, 3 * COUNT];
        let values: Vec<Vec<f32>> = sizes
            .iter()
            .zip(4..)
            .zip([0.01, 1.0, 0.2, 0.05, 0.01, 1.0])
            .map(|((n, s), size)| random(s, *n, size))
            .collect();
        let buffers_of = |p: &Properties| {
            [&p.shape_basis, &p.coefficients, &p.residual_weights, &p.regressor, &p.scale, &p.color].map(Clone::clone)
        };
        for (buffer, values) in buffers_of(deformation.properties()).iter().zip(&values) {
            gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(values));
        }
        // Rounded to f32, so that both sides start from the same numbers.
        let numbers = vectors(&widen(&random(9, 3 * JOINTS + 3, 1.0)));
        let pose = Pose {
            rotations: numbers[..JOINTS].iter().map(|v| (*v * kind.angle).as_vec3().as_dvec3()).collect(),
            translation: (numbers[JOINTS] * 0.1).as_vec3().as_dvec3(),
        };
        let flat: Vec<f32> =
            pose.rotations.iter().chain([&pose.translation]).flat_map(|v| v.as_vec3().to_array()).collect();
        gpu.queue.write_buffer(deformation.poses(), (flat.len() * 4) as u64, bytemuck::cast_slice(&flat));
        deformation.set_frame(gpu, 1);

        let submit = |encode: &dyn Fn(&mut wgpu::CommandEncoder)| {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            encode(&mut encoder);
            gpu.queue.submit([encoder.finish()]);
        };
        let read = |buffer: &wgpu::Buffer, n: usize| widen(&buffers::read::<f32>(gpu, buffer, n).unwrap());
        submit(&|encoder| {
            deformation.encode_skeleton(encoder);
            deformation.encode_skin(encoder);
            backward.encode_point_gradients(encoder);
        });
        let d_points = planes(&read(backward.d_offsets(), 3 * COUNT), COUNT);
        submit(&|encoder| backward.encode_property_gradients(encoder));
        let d_skin = read(backward.d_offsets(), 15 * COUNT);
        submit(&|encoder| backward.encode_pose_gradient(encoder));
        let [residual_joints, residual_chain] = deformation.residual_chain();
        let offsets = read(deformation.offsets(), 6 * COUNT);
        let gradients: Vec<Vec<f64>> =
            buffers_of(backward.gradients()).iter().zip(sizes).map(|(buffer, n)| read(buffer, n)).collect();
        let d_table = widen(&d_table);
        let of_hand = |row: usize| &d_table[row * columns + PLACE.first..][..COUNT];
        let coefficients = widen(&values[1]);
        Run {
            kind,
            pose,
            joints: vectors(&widen(&joints)),
            weights: widen(&weights),
            rest: planes(&widen(&rest), COUNT),
            rest_normals: planes(&widen(&normals), COUNT),
            normals: planes(&read(deformation.normals().unwrap(), 3 * COUNT), COUNT),
            shape_basis: planes(&widen(&values[0]), COUNT),
            coefficients: match kind.coefficients {
                CoefficientLayout::PerBasis => coefficients.iter().map(|c| DVec3::splat(*c)).collect(),
                CoefficientLayout::PerComponent => planes(&coefficients, COUNT),
            },
            residual_weights: widen(&values[2]),
            regressor: widen(&values[3]),
            chain: chain(&read(deformation.chain(), CHAIN_STRIDE * JOINTS)),
            residual_joints: vectors(&read(residual_joints, 3 * JOINTS)),
            residual_bones: bones(&read(residual_chain, CHAIN_STRIDE * JOINTS)),
            points: planes(&offsets[3 * COUNT..], COUNT),
            offsets: planes(&offsets[..3 * COUNT], COUNT),
            table: read(&gaussians, 7 * columns),
            scale: widen(&values[4]),
            color: widen(&values[5]),
            d_posed: planes(&[of_hand(0), of_hand(1), of_hand(2)].concat(), COUNT),
            d_points,
            d_offsets: planes(&d_skin[..3 * COUNT], COUNT),
            d_moments: d_skin[ROW_MOMENT as usize * COUNT..].to_vec(),
            d_shape_basis: planes(&gradients[0], COUNT),
            d_coefficients: gradients[1].clone(),
            d_residual_weights: gradients[2].clone(),
            d_regressor: gradients[3].clone(),
            d_scale: gradients[4].clone(),
            d_color: gradients[5].clone(),
            d_local: read(backward.d_local(), 9 * JOINTS).chunks_exact(9).map(rows3).collect(),
            d_joints: vectors(&read(backward.d_joints(), 3 * JOINTS)),
            d_pose: read(backward.d_pose(), 3 * JOINTS + 3),
            d_table,
        }
    }

    /// Runs `check` on every kind of hand; all tests share the runs.
    pub fn each(check: impl Fn(&Run)) {
        static RUNS: LazyLock<Vec<Run>> = LazyLock::new(|| {
            let gpu = gpu();
            kinds().into_iter().map(|kind| Run::new(&gpu, kind)).collect()
        });
        RUNS.iter().for_each(check);
    }

    /// dL/dB of bones with these weights, from the device's moments.
    pub fn d_bones(&self, weights: &[f64]) -> Vec<Affine> {
        let bone = |row: &[f64]| {
            let moment = |m: usize| -> f64 { (0..COUNT).map(|p| row[p] * self.d_moments[m * COUNT + p]).sum() };
            affine(&(0..12).map(moment).collect::<Vec<_>>())
        };
        weights.chunks_exact(COUNT).map(bone).collect()
    }

    /// The residual chain in f64, from the device's residual joints.
    pub fn exact_residual_chain(&self) -> Chain {
        pose_skeleton(&PARENTS, &self.residual_joints, &self.pose.rotations)
    }
}

pub trait Flat {
    fn flat(&self) -> Vec<f64>;
}

impl Flat for [DVec3] {
    fn flat(&self) -> Vec<f64> {
        self.iter().flat_map(|v| v.to_array()).collect()
    }
}

impl Flat for [DMat3] {
    fn flat(&self) -> Vec<f64> {
        self.iter().flat_map(|m| m.to_cols_array()).collect()
    }
}

impl Flat for [Affine] {
    fn flat(&self) -> Vec<f64> {
        self.iter().flat_map(|a| [&a.linear.to_cols_array()[..], &a.translation.to_array()].concat()).collect()
    }
}

impl Flat for [f64] {
    fn flat(&self) -> Vec<f64> {
        self.to_vec()
    }
}

/// Rounding error of a few hundred products in f32, relative to the whole table.
const BOUND: f64 = 3e-6;

pub fn norm<T: Flat + ?Sized>(values: &T) -> f64 {
    values.flat().iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Fails unless the device's table equals its twin's, and unless a single wrong number would be detected.
pub fn assert_same<T: Flat + ?Sized>(kind: Kind, name: &str, device: &T, twin: &T) {
    assert_near(kind, name, device, twin, 0.0);
}

/// As [`assert_same`] for differences of numbers of size `scale`, which nearly cancel near the rest pose.
pub fn assert_near<T: Flat + ?Sized>(kind: Kind, name: &str, device: &T, twin: &T, scale: f64) {
    let device = device.flat();
    let twin = twin.flat();
    assert_eq!(device.len(), twin.len(), "{name}");
    let norm = norm(&twin[..]).max(scale).max(1e-3);
    let error = |twin: &[f64]| {
        let difference: f64 = device.iter().zip(twin).map(|(a, b)| (a - b) * (a - b)).sum();
        difference.sqrt() / norm
    };
    assert!(error(&twin) <= BOUND, "{kind:?}, {name}: {}", error(&twin));
    let mut wrong = twin.clone();
    wrong[twin.len() / 2] += 1e-4 * norm;
    assert!(!(error(&wrong) <= BOUND), "{name} is not compared");
}
