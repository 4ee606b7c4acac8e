//! Avatar files of networks: read as written, and damaged ones rejected in one sentence.

use std::collections::HashMap;
use std::path::Path;

use ghand_avatar::properties::network::Normalization;
use ghand_avatar::{Avatar, AvatarConfig, NetworkSizes};
use ghand_test_support::procedural_hand::ProceduralHand;
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};

fn avatar() -> Avatar {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let sizes = NetworkSizes {
        map_side: 32,
        encoder_channels: 2,
        feature_channels: 4,
        tensor_channels: 2,
        hidden: 8,
        normalization: Normalization::Batch,
        ..NetworkSizes::quick()
    };
    let config = AvatarConfig { uv_resolution: 24, network: Some(sizes), ..Default::default() };
    Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 3).unwrap()
}

/// Type, shape and bytes of a tensor.
type Contents = (Dtype, Vec<usize>, Vec<u8>);

/// The avatar's file with its metadata and tensors changed.
fn damaged(path: &Path, metadata: &dyn Fn(String) -> String, tensor: (&str, Option<Contents>)) {
    avatar().save(path).unwrap();
    let bytes = std::fs::read(path).unwrap();
    let block = SafeTensors::read_metadata(&bytes).unwrap().1.metadata().clone().unwrap();
    let block: HashMap<_, _> = block.into_iter().map(|(key, text)| (key, metadata(text))).collect();
    let read = SafeTensors::deserialize(&bytes).unwrap();
    let mut views: Vec<(String, TensorView)> =
        read.tensors().into_iter().filter(|(name, _)| name != tensor.0).collect();
    let (name, replacement) = tensor;
    if let Some((dtype, shape, data)) = &replacement {
        views.push((name.to_owned(), TensorView::new(*dtype, shape.clone(), data).unwrap()));
    }
    std::fs::write(path, serialize(views, Some(block)).unwrap()).unwrap();
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

#[test]
fn networks_are_read_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.ghand");
    avatar().save(&path).unwrap();
    assert_eq!(Avatar::load(&path).unwrap(), avatar());
}

#[test]
fn damaged_networks_are_rejected_with_the_part_that_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.ghand");
    let same = |text: String| text;
    let of = |values: &[f32], shape: &[usize]| Some((Dtype::F32, shape.to_vec(), floats(values)));
    let tensors = [
        ("network.trunk.0.weight", None, "is missing"),
        ("network.trunk.1.bias", of(&[0.0; 7], &[7]), "expected F32 [Some(8)]"),
        ("network.trunk.1.bias", of(&[f32::NAN; 8], &[8]), "is not finite"),
        ("network.trunk.1.bias", Some((Dtype::F64, vec![8], vec![0; 64])), "expected F32"),
        ("network.feature_tensor", of(&[0.0; 8], &[8]), "expected F32 [Some(1), Some(2), Some(32), Some(32)]"),
        ("network.norm.0.mean", None, "is missing"),
        ("network.norm.0.variance", of(&[-1.0; 4], &[4]), "negative"),
        ("network.base_logits", None, "is missing"),
        ("network.base_shape_basis", of(&[0.0], &[1, 1, 1]), "expected F32"),
    ];
    for (name, tensor, expected) in tensors {
        damaged(&path, &same, (name, tensor));
        let error = Avatar::load(&path).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains(expected) && !error.contains('\n'), "{name}: {error}");
        assert!(error.contains("hand.ghand"), "{error}");
    }
    // Each replaces a part of the metadata.
    let metadata = [
        ("\"map_side\":32", "\"map_side\":33", "map_side is 33; it must be a multiple of 32"),
        ("\"map_side\":32", "\"map_side\":4294967296", "map_side is 4294967296"),
        ("\"map_side\":32", "\"map_side\":0", "map_side is 0"),
        ("\"hidden\":8", "\"hidden\":1000000000", "hidden is 1000000000; it must be from 1 to 1024"),
        ("\"hidden\":8", "\"hidden\":16", "network.shape_basis.0.weight"),
        ("\"hidden\":8", "\"hidden\":-1", "metadata"),
        ("\"hidden\":8,", "", "hidden"),
        ("\"hidden\":8", "\"hidden\":8,\"heads\":5", "heads"),
        ("\"activation\":\"relu\"", "\"activation\":\"gelu\"", "gelu"),
        ("\"uv_resolution\":24", "\"uv_resolution\":32", "texels on the hand at uv_resolution 32"),
        ("\"uv_resolution\":24", "\"uv_resolution\":4000000000", "the limit for networks is 2048"),
        ("\"uv_resolution\":24", "\"uv_resolution\":0", "UV resolution"),
        ("\"property_model\":\"network\"", "\"property_model\":\"direct\"", "has sizes of networks"),
        ("\"property_model\":\"network\"", "\"property_model\":\"tables\"", "metadata"),
    ];
    for (from, to, expected) in metadata {
        let changed = |text: String| {
            assert!(text.contains(from), "{from} is not in {text}");
            text.replacen(from, to, 1)
        };
        damaged(&path, &changed, ("", None));
        let error = Avatar::load(&path).unwrap_err().to_string();
        assert!(error.contains(expected) && !error.contains('\n'), "{to}: {error}");
    }
}

#[test]
fn sizes_that_cannot_be_are_an_error_before_anything_is_made() {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let sizes = NetworkSizes { hidden: usize::MAX, ..NetworkSizes::quick() };
    let config = AvatarConfig { uv_resolution: 24, network: Some(sizes), ..Default::default() };
    let error = Avatar::untrained(&model, &config, [0.5; 3], 0).unwrap_err().to_string();
    assert!(error.contains("hidden is") && error.contains("must be from 1 to 1024"), "{error}");
}
