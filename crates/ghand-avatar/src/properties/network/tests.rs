//! Tests of the networks without a device: against a plain twin, by finite differences, by counting, by fitting.

#[cfg(feature = "gpu-networks")]
mod gpu;

use crate::deform::PropertySizes;
use burn_tensor::{Device, Tensor, TensorData};
use ghand_core::blend_shapes::CoefficientLayout;
use glam::DVec2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::adam::NetworkAdam;
use super::layers::Pass;
use super::networks::{Base, Networks};
use super::parameters::{Parameter, ParameterList, Part};
use super::position_map::FeatureSampler;
use super::sizes::{Activation, NetworkSizes, Normalization};
use crate::reference::network::{Outputs, Twin};

const NAMES: [&str; 6] = ["shape basis", "residual weights", "coefficients", "regressor", "scale", "color"];

/// The smallest networks with every part.
fn tiny(activation: Activation) -> NetworkSizes {
    NetworkSizes {
        map_side: 32,
        encoder_channels: 2,
        feature_channels: 3,
        tensor_channels: 2,
        hidden: 5,
        normalization: Normalization::Instance,
        activation,
        own_colors: activation == Activation::Relu,
    }
}

fn random(seed: u64, count: usize, size: f32) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| rng.random_range(-size..size)).collect()
}

/// Networks, their inputs and a random weight for each output.
struct Case {
    sizes: NetworkSizes,
    networks: Networks,
    list: ParameterList,
    parameters: Vec<Vec<f32>>,
    uvs: Vec<DVec2>,
    maps: [Vec<f32>; 2],
    base_shape_basis: Vec<f32>,
    base_logits: Vec<f32>,
    weights: [Vec<f32>; 6],
    /// Where they run.
    device: Device,
}

const MAX_SCALE: f32 = 0.02;

impl Case {
    fn new(sizes: NetworkSizes, gaussians: usize) -> Case {
        let properties = PropertySizes {
            gaussians,
            joints: 3,
            bases: 2,
            coefficients: CoefficientLayout::PerComponent,
            plain_skinning: false,
        };
        let (networks, list) = Networks::new(&sizes, properties);
        let parameters = list.parameters.iter().enumerate().map(|(k, p)| {
            let values = random(100 + k as u64, p.len(), 0.5);
            // Positive biases, so that not all of a layer's few channels end below an activation's kink.
            if p.name.ends_with(".bias") { values.into_iter().map(f32::abs).collect() } else { values }
        });
        let parameters = parameters.collect();
        let uvs = random(1, 2 * gaussians, 0.5);
        let uvs = uvs.chunks_exact(2).map(|uv| DVec2::new(uv[0].into(), uv[1].into()) + 0.5);
        let map = |seed| random(seed, 3 * sizes.map_side * sizes.map_side, 1.0);
        // Offsets are a hundredth of other outputs, sizes a fiftieth: the loss weighs them accordingly.
        let rows = [(6, 100.0), (3, 1.0), (6, 1.0), (3, gaussians as f32), (1, 50.0), (3, 1.0)];
        let weights = std::array::from_fn(|k| random(20 + k as u64, rows[k].0 * gaussians, rows[k].1));
        Case {
            uvs: uvs.collect(),
            maps: [map(2), map(3)],
            base_shape_basis: random(4, 6 * gaussians, 0.01),
            base_logits: random(5, 4 * gaussians, 1.0),
            sizes,
            networks,
            list,
            parameters,
            weights,
            device: Device::flex(),
        }
    }

    fn table(&self, values: &[f32], rows: usize) -> Tensor<2> {
        Tensor::from_data(TensorData::new(values.to_vec(), [rows, values.len() / rows]), &self.device)
    }

    fn tensors(&self) -> Vec<Tensor<1>> {
        let tensor = |v: &Vec<f32>| Tensor::from_data(TensorData::new(v.clone(), [v.len()]), &self.device);
        self.parameters.iter().map(tensor).collect()
    }

    fn outputs(&self, parameters: &[Tensor<1>]) -> [Tensor<2>; 6] {
        let side = self.sizes.map_side;
        let sampler = FeatureSampler::new(&self.uvs, side, &self.device);
        let map = |k: usize| Tensor::from_data(TensorData::new(self.maps[k].clone(), [1, 3, side, side]), &self.device);
        let base = Base {
            shape_basis: self.table(&self.base_shape_basis, 6),
            logits: self.table(&self.base_logits, 4),
            max_scale: MAX_SCALE,
        };
        let mut pass = Pass::new(parameters, None);
        let c = self.networks.canonical(&mut pass, map(0), &sampler, &base);
        let p = self.networks.posed(&mut pass, map(1), &sampler, &c, &base);
        [c.shape_basis, c.residual_weights, p.coefficients, p.regressor, p.scale, p.color]
    }

    fn values(&self) -> Vec<Vec<f32>> {
        let read = |t: Tensor<2>| t.try_into_vec_as::<f32>().unwrap();
        self.outputs(&self.tensors()).into_iter().map(read).collect()
    }

    /// Gradients of the weighted sum of the outputs, by parameter.
    fn gradients(&self) -> Vec<Vec<f32>> {
        let parameters: Vec<_> = self.tensors().into_iter().map(|t| t.autodiff().require_grad()).collect();
        let outputs = self.outputs(&parameters).into_iter().zip(&self.weights);
        let loss = outputs.map(|(output, weights)| {
            let rows = output.dims()[0];
            (output * self.table(weights, rows)).sum()
        });
        let mut all = loss.reduce(|a, b| a + b).unwrap().backward();
        parameters.iter().map(|p| p.grad_remove(&mut all).unwrap().try_into_vec_as::<f32>().unwrap()).collect()
    }

    fn twin(&self) -> Twin {
        let wide = |v: &[f32]| v.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>();
        Twin {
            sizes: self.sizes.clone(),
            parameters: self
                .list
                .parameters
                .iter()
                .zip(&self.parameters)
                .map(|(p, v)| (p.name.clone(), wide(v)))
                .collect(),
            fixed_norms: vec![],
            uvs: self.uvs.clone(),
            maps: self.maps.each_ref().map(|m| wide(m)),
            base_shape_basis: wide(&self.base_shape_basis),
            base_logits: wide(&self.base_logits),
            max_scale: MAX_SCALE.into(),
            coefficient_rows: 6,
        }
    }

    fn twin_loss(&self, outputs: &Outputs) -> f64 {
        let dot = |(o, w): (&Vec<f64>, &Vec<f32>)| o.iter().zip(w).map(|(o, w)| o * f64::from(*w)).sum::<f64>();
        outputs.iter().zip(&self.weights).map(dot).sum()
    }
}

#[test]
fn the_networks_agree_with_their_twin() {
    for activation in [Activation::Relu, Activation::Softplus] {
        let case = Case::new(tiny(activation), 40);
        let values = case.values();
        let expected = case.twin().outputs();
        for ((name, values), expected) in NAMES.iter().zip(&values).zip(&expected) {
            let size = expected.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            assert!(size > 0.0 && values.len() == expected.len(), "{name}");
            for (p, (a, b)) in values.iter().zip(expected).enumerate() {
                // Thirty layers of f32, two of them normalisations over four texels.
                assert!((f64::from(*a) - b).abs() <= 2e-5 * size, "{name} {p}: {a}, twin {b}");
            }
        }
        if activation == Activation::Relu {
            continue;
        }
        // The comparison notices a wrong number anywhere: each parameter has an effect beyond the tolerance.
        let twin = case.twin();
        for index in 0..twin.parameters.len() {
            let mut wrong = case.twin();
            // Not all alike: a normalisation removes what it adds to a whole channel.
            wrong.parameters[index].1.iter_mut().step_by(3).for_each(|v| *v += 0.5);
            let differs = wrong.outputs().iter().zip(&expected).any(|(a, b)| {
                let size = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                a.iter().zip(b).any(|(a, b)| (a - b).abs() > 4e-5 * size)
            });
            assert!(differs, "{}", wrong.parameters[index].0);
        }
    }
}

#[test]
fn gradients_of_every_part_agree_with_finite_differences() {
    let case = Case::new(tiny(Activation::Softplus), 40);
    let gradients = case.gradients();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for (index, (parameter, gradient)) in case.list.parameters.iter().zip(&gradients).enumerate() {
        let size = gradient.iter().fold(0.0f32, |m, g| m.max(g.abs()));
        assert!(size > 0.0, "{} has no gradient", parameter.name);
        for _ in 0..4 {
            let at = rng.random_range(0..gradient.len());
            // Small enough not to step over the encoders' kinks.
            let step = 1e-6;
            let loss = |sign: f64| {
                let mut twin = case.twin();
                twin.parameters[index].1[at] += sign * step;
                case.twin_loss(&twin.outputs())
            };
            let expected = (loss(1.0) - loss(-1.0)) / (2.0 * step);
            let error = (f64::from(gradient[at]) - expected).abs();
            assert!(error <= 1e-3 * f64::from(size), "{} {at}: {}, expected {expected}", parameter.name, gradient[at]);
        }
    }
}

fn count(list: &[Parameter], part: Part) -> usize {
    list.iter().filter(|p| p.part == part).map(Parameter::len).sum()
}

#[test]
fn every_part_has_the_papers_number_of_parameters() {
    let properties = PropertySizes {
        gaussians: 87_779,
        joints: 16,
        bases: 8,
        coefficients: CoefficientLayout::PerComponent,
        plain_skinning: false,
    };
    let (_, list) = Networks::new(&NetworkSizes::paper(), properties);
    let list = list.parameters;
    // 4 x 4 kernels; down 3, 32, 64, 128, 256, 256; up 256, 128, 64, 32, 64 from those and what was skipped.
    let down = 16 * (3 * 32 + 32 * 64 + 64 * 128 + 128 * 256 + 256 * 256);
    let up = 16 * (256 * 256 + 512 * 128 + 256 * 64 + 128 * 32 + 64 * 64) + 64;
    let layer = |inputs: usize, outputs: usize| inputs * outputs + outputs;
    let hidden = layer(256, 256);
    let expected = [
        (Part::CanonicalEncoder, down + up),
        (Part::PoseEncoder, down + up),
        (Part::FeatureTensor, 64 * 128 * 128),
        (Part::Smoothing, 3 * 64 * 64 * 25),
        // Two MLPs of 4 layers from 64 features and uv.
        (Part::ShapeBasis, layer(66, 256) + 2 * hidden + layer(256, 24)),
        (Part::ResidualWeights, layer(66, 256) + 2 * hidden + layer(256, 16)),
        // 4 layers from both features and uv, then four heads of 3.
        (Part::Trunk, layer(130, 256) + 3 * hidden),
        (Part::Coefficients, 2 * hidden + layer(256, 24)),
        (Part::Regressor, 2 * hidden + layer(256, 16)),
        (Part::Scale, 2 * hidden + layer(256, 1)),
        (Part::Color, 2 * hidden + layer(256, 3)),
    ];
    for (part, expected) in expected {
        assert_eq!(count(&list, part), expected, "{part:?}");
    }
    assert_eq!(list.iter().map(Parameter::len).sum::<usize>(), expected.iter().map(|(_, n)| n).sum::<usize>());
    let shape = |name: &str| list.iter().find(|p| p.name == name).unwrap().shape.clone();
    assert_eq!(shape("pose_encoder.down.0"), [32, 3, 4, 4]);
    assert_eq!(shape("pose_encoder.up.1.weight"), [512, 128, 4, 4]);
    assert_eq!(shape("pose_encoder.up.4.bias"), [64]);
    assert_eq!(shape("trunk.0.weight"), [130, 256]);
    assert_eq!(shape("coefficients.2.weight"), [256, 24]);
    let names: std::collections::BTreeSet<_> = list.iter().map(|p| &p.name).collect();
    assert_eq!(names.len(), list.len(), "names are unique");
}

#[test]
fn outputs_and_gradients_are_the_same_bits_on_any_number_of_threads() {
    let sizes = NetworkSizes { activation: Activation::Softplus, ..NetworkSizes::quick() };
    let case = Case::new(sizes, 700);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (case.values(), case.gradients()))
    };
    let bits = |values: &[Vec<f32>]| values.concat().iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
    let (values, gradients) = run(1);
    for threads in [2, 5] {
        let (again, gradients_again) = run(threads);
        assert!(bits(&again) == bits(&values), "outputs on {threads} threads");
        assert!(bits(&gradients_again) == bits(&gradients), "gradients on {threads} threads");
    }
}

#[test]
fn training_fits_planted_offsets_and_colors() {
    let case = Case::new(tiny(Activation::Relu), 60);
    // Start values as in an avatar; the target is another set of weights.
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let start: Vec<Vec<f32>> = case.list.parameters.iter().map(|p| p.start.values(p.len(), &mut rng)).collect();
    let target = case.outputs(&case.tensors());
    let mut learned = Case { parameters: start, ..Case::new(tiny(Activation::Relu), 60) }.tensors();
    let mut adam = NetworkAdam::new(learned.len());
    // Offsets in centimetres, colours as they are.
    let loss = |parameters: &[Tensor<1>]| {
        let outputs = case.outputs(parameters);
        let term = |k: usize, gain: f64| ((outputs[k].clone() - target[k].clone()) * gain).square().mean();
        term(0, 100.0) + term(5, 1.0)
    };
    let first: f32 = loss(&learned).into_scalar();
    for step in 1..=200 {
        let leaves: Vec<_> = learned.iter().map(|p| p.clone().autodiff().require_grad()).collect();
        let mut gradients = loss(&leaves).backward();
        for (k, (slot, leaf)) in learned.iter_mut().zip(&leaves).enumerate() {
            if let Some(gradient) = leaf.grad_remove(&mut gradients) {
                *slot = adam.updated(k, slot.clone(), gradient, 3e-3, step);
            }
        }
    }
    let last: f32 = loss(&learned).into_scalar();
    assert!(last < 0.1 * first, "{first} to {last}");
}

#[test]
fn adam_agrees_with_its_twin() {
    let parameters = random(1, 50, 1.0);
    let mut expected: Vec<f64> = parameters.iter().map(|p| (*p).into()).collect();
    let mut moments = vec![[0.0; 2]; 50];
    let tensor = |v: Vec<f32>| Tensor::<1>::from_data(TensorData::new(v, [50]), &Device::flex());
    let mut adam = NetworkAdam::new(1);
    let mut learned = tensor(parameters);
    for step in 1..=5 {
        let gradient = random(10 + step, 50, 1e-6);
        let wide: Vec<f64> = gradient.iter().map(|g| (*g).into()).collect();
        ghand_render::reference::adam::adam(&mut expected, &mut moments, &wide, 1e-2, step);
        learned = adam.updated(0, learned, tensor(gradient), 1e-2, step);
    }
    for (a, b) in learned.try_into_vec_as::<f32>().unwrap().iter().zip(&expected) {
        assert!((f64::from(*a) - b).abs() < 1e-6, "{a}, expected {b}");
    }
}

#[test]
fn sizes_out_of_range_are_one_sentence() {
    NetworkSizes::quick().check().unwrap();
    NetworkSizes::paper().check().unwrap();
    type Spoil = fn(&mut NetworkSizes);
    let spoil: [(&str, Spoil); 6] = [
        ("map_side", |s| s.map_side = 0),
        ("map_side", |s| s.map_side = 100),
        ("map_side", |s| s.map_side = 1 << 40),
        ("hidden", |s| s.hidden = 0),
        ("hidden", |s| s.hidden = usize::MAX),
        ("encoder_channels", |s| s.encoder_channels = 65),
    ];
    for (name, spoil) in spoil {
        let mut sizes = NetworkSizes::quick();
        spoil(&mut sizes);
        let problem = sizes.check().unwrap_err();
        assert!(problem.starts_with(name) && problem.contains("must be"), "{problem}");
    }
}
