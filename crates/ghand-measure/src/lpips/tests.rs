//! LPIPS against JAX (`tests/reference.py`), finite differences, and wrong files.

use std::collections::HashMap;
use std::path::Path;

use rayon::ThreadPoolBuilder;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};

use super::alexnet::CONVOLUTIONS;
use super::*;

impl Weights {
    /// Random weights, the same ones each time; `reference.py` makes them, too. They keep the size of the
    /// features from layer to layer.
    fn random() -> Weights {
        let mut tensor = 0;
        let mut uniform = |count: usize, least: f64, most: f64| -> Vec<f32> {
            tensor += 1;
            (0..count).map(|k| (least + (most - least) * random_unit(tensor, k as u32)) as f32).collect()
        };
        let convolutions = CONVOLUTIONS.iter().map(|conv| {
            let [weight, _] = conv.shapes();
            let most = (6.0 / (conv.inputs * conv.kernel * conv.kernel) as f64).sqrt();
            [uniform(weight.iter().product(), -most, most), uniform(conv.outputs, -0.1, 0.1)]
        });
        let convolutions = convolutions.collect();
        let linear = CONVOLUTIONS.iter().map(|conv| uniform(conv.outputs, 0.0, 1.0)).collect();
        Weights { convolutions, linear }
    }
}

/// A number from 0 to 1 for each value of each tensor: the last step of the hash MurmurHash3.
fn random_unit(tensor: u32, value: u32) -> f64 {
    let mut h = value.wrapping_mul(0x9e37_79b1) ^ tensor.wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    f64::from(h ^ (h >> 16)) / 4_294_967_296.0
}

impl Lpips {
    fn random() -> Lpips {
        Lpips::new(Weights::random())
    }

    /// The distance of two pictures.
    fn distance(&self, &Pair { size, picture, truth }: &Pair) -> Result<f64, LpipsError> {
        self.distances(size, [picture], truth).map(|[distance]| distance)
    }
}

/// Two pictures by formula, with values of 8 bits.
fn pictures([width, height]: [u32; 2]) -> [Vec<[f32; 3]>; 2] {
    [0, 1].map(|seed: u32| {
        let value = |x: u32, y: u32, c: u32| {
            ((x * x * 3 + y * y * 5 + c * 40 + x * y * (seed + 1) + seed * 17) % 256) as f32 / 255.0
        };
        (0..height).flat_map(|y| (0..width).map(move |x| [0, 1, 2].map(|c| value(x, y, c)))).collect()
    })
}

fn values_of(view: &TensorView) -> Vec<f32> {
    view.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
}

#[test]
fn distances_and_gradients_are_those_of_jax() {
    let reference = SafeTensors::deserialize(include_bytes!("tests/reference.safetensors")).unwrap();
    let mut compared = 0;
    let lpips = Lpips::random();
    for name in reference.names() {
        let Some(rest) = name.strip_prefix("alex.") else { continue };
        let Some(size) = rest.strip_suffix(".distance") else { continue };
        let side: Vec<u32> = size.split('x').map(|side| side.parse().unwrap()).collect();
        let size = [side[0], side[1]];
        let [picture, truth] = pictures(size);
        let pair = Pair { size, picture: &picture, truth: &truth };
        let (distance, gradient) = lpips.distance_and_gradient(&pair).unwrap();
        assert_eq!(distance, lpips.distance(&pair).unwrap(), "{name}");

        let expected = f64::from(values_of(&reference.tensor(name).unwrap())[0]);
        assert!((distance / expected - 1.0).abs() < 3e-6, "{name}: {distance}, not {expected}");
        let expected = values_of(&reference.tensor(&name.replace("distance", "gradient")).unwrap());
        let length = |values: &[f32]| values.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        let off: Vec<f32> = gradient.as_flattened().iter().zip(&expected).map(|(a, b)| a - b).collect();
        let error = length(&off) / length(&expected);
        assert!(error < 1e-4, "{name}: the gradient is off by {error:e} of its length");
        compared += 1;
    }
    assert_eq!(compared, 2);
}

#[test]
fn gradients_are_those_of_finite_differences() {
    let lpips = Lpips::random();
    let size = [44, 37];
    let [picture, truth] = pictures(size);
    let distance = |picture: &[[f32; 3]]| lpips.distance(&Pair { size, picture, truth: &truth }).unwrap();
    let (_, gradient) = lpips.distance_and_gradient(&Pair { size, picture: &picture, truth: &truth }).unwrap();
    // Along the gradient itself, so that the distance changes by much more than its rounding. Some ReLUs and maxima
    // change sides on the way: with this step, derivatives in f64 are off by half a per cent, too.
    let largest = gradient.as_flattened().iter().fold(0.0f32, |most, g| most.max(g.abs()));
    let direction = |i: usize, c: usize| gradient[i][c] / largest;
    let step = 3e-4;
    let moved = |by: f32| -> Vec<[f32; 3]> {
        let pixels = picture.iter().enumerate();
        pixels.map(|(i, pixel)| [0, 1, 2].map(|c| pixel[c] + by * direction(i, c))).collect()
    };
    let measured = (distance(&moved(step)) - distance(&moved(-step))) / (2.0 * f64::from(step));
    let pixels = gradient.iter().enumerate();
    let derived: f64 = pixels.map(|(i, g)| (0..3).map(|c| f64::from(g[c] * direction(i, c))).sum::<f64>()).sum();
    assert!((measured - derived).abs() < 0.01 * derived.abs(), "{measured}, derived {derived}");
}

#[test]
fn equal_pictures_have_no_distance_and_no_gradient() {
    let size = [33, 40];
    let [picture, _] = pictures(size);
    let pair = Pair { size, picture: &picture, truth: &picture };
    let (distance, gradient) = Lpips::random().distance_and_gradient(&pair).unwrap();
    assert_eq!(distance, 0.0);
    assert!(gradient.iter().flatten().all(|g| *g == 0.0));
}

#[test]
fn the_gradient_is_finite_where_all_features_are_zero() {
    let mut weights = Weights::random();
    // No feature of the first layer is above zero, and so on.
    for [weight, bias] in &mut weights.convolutions {
        weight.fill(0.0);
        bias.fill(-1.0);
    }
    let size = [40, 40];
    let [picture, truth] = pictures(size);
    let (distance, gradient) =
        Lpips::new(weights).distance_and_gradient(&Pair { size, picture: &picture, truth: &truth }).unwrap();
    assert_eq!(distance, 0.0);
    assert!(gradient.iter().flatten().all(|g| *g == 0.0));
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let lpips = Lpips::random();
    let size = [200, 150];
    let [picture, truth] = pictures(size);
    let run = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| lpips.distance_and_gradient(&Pair { size, picture: &picture, truth: &truth }).unwrap())
    };
    let alone = run(1);
    for threads in [2, 3, 8] {
        assert!(run(threads) == alone, "{threads} threads");
    }
}

#[test]
fn images_that_are_too_small_are_refused_in_one_sentence() {
    let lpips = Lpips::random();
    let size = [60, SMALLEST_SIDE - 1];
    let [picture, truth] = pictures(size);
    let refusal = lpips.distance(&Pair { size, picture: &picture, truth: &truth }).unwrap_err().to_string();
    assert!(
        refusal.contains("at least 31 x 31") && refusal.contains("60 x 30") && !refusal.contains('\n'),
        "{refusal}"
    );
    let size = [60, SMALLEST_SIDE];
    let [picture, truth] = pictures(size);
    assert!(lpips.distance(&Pair { size, picture: &picture, truth: &truth }).unwrap() > 0.0);
    assert!(lpips.distance(&Pair { size, picture: &picture[1..], truth: &truth }).is_err());
}

/// Name, type, shape and bytes of a tensor.
type FileTensor = (String, Dtype, Vec<usize>, Vec<u8>);
/// The tensors of a file, to be changed.
type Tensors = Vec<FileTensor>;

fn tensors_of(weights: &Weights) -> Tensors {
    let bytes = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let mut all = Tensors::new();
    for (conv, [weight, bias]) in CONVOLUTIONS.iter().zip(&weights.convolutions) {
        let [weight_shape, bias_shape] = conv.shapes();
        all.push((format!("{}.weight", conv.name()), Dtype::F32, weight_shape, bytes(weight)));
        all.push((format!("{}.bias", conv.name()), Dtype::F32, bias_shape, bytes(bias)));
    }
    for (tap, values) in weights.linear.iter().enumerate() {
        all.push((format!("linear.{tap}"), Dtype::F32, vec![values.len()], bytes(values)));
    }
    all
}

fn file(tensors: &Tensors, metadata: &[(&str, &str)]) -> Vec<u8> {
    let views = tensors
        .iter()
        .map(|(name, dtype, shape, data)| (name.as_str(), TensorView::new(*dtype, shape.clone(), data).unwrap()));
    let metadata: HashMap<String, String> = metadata.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
    safetensors::serialize(views, Some(metadata)).unwrap()
}

fn refusal(bytes: &[u8]) -> String {
    let message = Weights::from_bytes(Path::new("net.safetensors"), bytes).unwrap_err().to_string();
    assert!(message.starts_with("net.safetensors: ") && !message.contains('\n'), "{message}");
    assert!(message.ends_with("scripts/lpips_weights.py"), "{message}");
    message
}

#[test]
fn the_built_in_weights_give_the_published_distances() {
    let size = [64, 64];
    let [picture, truth] = pictures(size);
    let distance = Lpips::built_in().unwrap().distance(&Pair { size, picture: &picture, truth: &truth }).unwrap();
    // With the published weights as they are, F32.
    let published = 0.155628;
    assert!((distance / published - 1.0).abs() < 1e-3, "{distance}, published {published}");
}

#[test]
fn half_floats_are_read() {
    let weights = Weights::random();
    let mut tensors = tensors_of(&weights);
    for tensor in tensors.iter_mut().filter(|tensor| tensor.0.ends_with(".weight")) {
        tensor.1 = Dtype::F16;
        let values = tensor.3.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
        tensor.3 = values.flat_map(|value| half::f16::from_f32(value).to_le_bytes()).collect();
    }
    let read = Weights::from_bytes(Path::new("file"), &file(&tensors, &[])).unwrap();
    for ([read, bias], [exact, same]) in read.convolutions.iter().zip(&weights.convolutions) {
        assert!(read.iter().zip(exact).all(|(read, exact)| (read - exact).abs() <= 5e-4 * exact.abs() + 1e-7));
        assert!(bias == same);
    }
}

#[test]
fn files_are_read_with_and_without_metadata() {
    let weights = Weights::random();
    let tensors = tensors_of(&weights);
    for metadata in [&[("lpips_backbone", "alex"), ("lpips_version", "0.1")][..], &[]] {
        let read = Weights::from_bytes(Path::new("file"), &file(&tensors, metadata)).unwrap();
        assert!(read == weights);
    }
}

#[test]
fn files_of_another_network_or_version_are_refused() {
    let tensors = tensors_of(&Weights::random());
    let message = refusal(&file(&tensors, &[("lpips_backbone", "vgg")]));
    assert!(
        message.contains("lpips_backbone: is \"vgg\", but LPIPS is computed with AlexNet, \"alex\", only"),
        "{message}"
    );
    let message = refusal(&file(&tensors, &[("lpips_version", "0.0")]));
    assert!(message.contains("lpips_version: is \"0.0\", expected \"0.1\""), "{message}");
    // VGG16's first convolution, without a name.
    let other = vec![("features.0.weight".to_owned(), Dtype::F32, vec![64, 3, 3, 3], vec![0; 4 * 64 * 27])];
    let message = refusal(&file(&other, &[]));
    assert!(
        message
            .contains("features.0.weight: is F32 [64, 3, 3, 3], but AlexNet for LPIPS has F32 or F16 [64, 3, 11, 11]")
    );
}

#[test]
fn tensors_that_are_missing_or_wrong_are_named() {
    let tensors = tensors_of(&Weights::random());
    let changed = |name: &str, change: &dyn Fn(&mut FileTensor)| {
        let mut tensors = tensors.clone();
        change(tensors.iter_mut().find(|tensor| tensor.0 == name).unwrap());
        refusal(&file(&tensors, &[]))
    };
    let message = changed("features.3.bias", &|tensor| tensor.0 = "other".into());
    assert!(message.contains("features.3.bias: is missing") && message.contains("[192]"), "{message}");
    let message = changed("linear.2", &|tensor| tensor.2 = vec![1, 384, 1, 1]);
    assert!(message.contains("linear.2: is F32 [1, 384, 1, 1]") && message.contains("F32 or F16 [384]"), "{message}");
    let message = changed("linear.0", &|tensor| {
        tensor.1 = Dtype::BF16;
        tensor.3.truncate(128);
    });
    assert!(message.contains("linear.0: is BF16 [64]") && message.contains("has F32 or F16 [64]"), "{message}");
    for bad in [f32::NAN, f32::INFINITY] {
        let message = changed("features.0.weight", &|tensor| tensor.3[40..44].copy_from_slice(&bad.to_le_bytes()));
        assert!(message.contains("features.0.weight: value 10 is not finite"), "{message}");
    }
}

#[test]
fn damaged_files_are_refused() {
    let whole = file(&tensors_of(&Weights::random()), &[]);
    for length in [0, 7, 8, 100, whole.len() / 2, whole.len() - 1] {
        assert!(refusal(&whole[..length]).contains("is not a safetensors file, or is truncated"));
    }
    assert!(refusal(b"\x80\x02}q\0X\x04\0\0\0lin0 a pickle").contains("is not a safetensors file"));
    let with_header = |header: &str| [&(header.len() as u64).to_le_bytes()[..], header.as_bytes()].concat();
    for header in [
        r#"{"features.8.weight":{"dtype":"F32","shape":[4294967296,4294967296,4294967296],"data_offsets":[0,0]}}"#,
        r#"{"features.8.weight":{"dtype":"F32","shape":[1099511627776],"data_offsets":[0,4398046511104]}}"#,
        r#"{"features.8.weight":{"dtype":"F32","shape":[1],"data_offsets":[4,0]}}"#,
        "[]",
    ] {
        assert!(refusal(&with_header(header)).contains("is not a safetensors file"), "{header}");
    }
    let huge_header = [&u64::MAX.to_le_bytes()[..], b"{}"].concat();
    assert!(refusal(&huge_header).contains("is not a safetensors file"));
}

#[test]
fn files_that_are_too_large_or_absent_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("vgg16.safetensors");
    let absent = Lpips::load(&path).unwrap_err().to_string();
    assert!(absent.contains("vgg16.safetensors: cannot read the LPIPS weights"), "{absent}");
    // Sparse: it takes no disk space.
    std::fs::File::create(&path).unwrap().set_len(1 << 29).unwrap();
    let message = Lpips::load(&path).unwrap_err().to_string();
    assert!(message.contains("larger than 128 MiB") && !message.contains('\n'), "{message}");
}
