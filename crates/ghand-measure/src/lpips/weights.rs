//! The file with the weights of AlexNet and of the linear layers.

use std::path::{Path, PathBuf};

use ghand_files::input_file;
use half::f16;
use safetensors::SafeTensors;
use safetensors::tensor::Dtype;

use super::BACKBONE;
use super::alexnet::CONVOLUTIONS;

/// Maximum file size, bytes; the `lpips` package's largest network has 59 million.
const LARGEST_FILE: u64 = 1 << 27;
/// Key of the backbone's name in the file's metadata.
const BACKBONE_KEY: &str = "lpips_backbone";
/// Key of the version of the linear layers.
const VERSION_KEY: &str = "lpips_version";
/// The version of the linear layers that this program computes with.
const VERSION: &str = "0.1";
/// What to do about a wrong file.
const REMEDY: &str = "make the file with scripts/lpips_weights.py";

/// Why a file of LPIPS weights is unusable.
#[derive(Debug, thiserror::Error)]
pub enum LpipsFileError {
    /// Reading failed.
    #[error("{path}: cannot read the LPIPS weights: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The contents are unusable.
    #[error("{path}: {field}: {problem}; {REMEDY}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The part that is wrong.
        field: String,
        /// What is wrong.
        problem: String,
    },
}

/// The weights of AlexNet and its linear layers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Weights {
    /// Weight `[outputs][inputs][kernel][kernel]` and bias of each convolution.
    pub convolutions: Vec<[Vec<f32>; 2]>,
    /// A weight per channel of each compared layer.
    pub linear: Vec<Vec<f32>>,
}

/// The published weights; the convolutions' are rounded to half floats.
const BUILT_IN: &[u8] = include_bytes!("../../../../assets/lpips/alexnet.safetensors");

impl Weights {
    /// The weights that come with the program.
    ///
    /// # Errors
    /// [`LpipsFileError`] if the program is damaged.
    pub fn built_in() -> Result<Weights, LpipsFileError> {
        Weights::from_bytes(Path::new("the built-in weights"), BUILT_IN)
    }

    /// Reads and checks a file.
    pub fn load(path: &Path) -> Result<Weights, LpipsFileError> {
        let bytes = input_file::read(path, LARGEST_FILE)
            .map_err(|source| LpipsFileError::Io { path: path.into(), source })?
            .ok_or_else(|| {
                let problem = format!("is larger than {} MiB, the limit for LPIPS weights", LARGEST_FILE >> 20);
                LpipsFileError::Invalid { path: path.into(), field: "file".into(), problem }
            })?;
        Weights::from_bytes(path, &bytes)
    }

    /// Checks the bytes of a file.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Weights, LpipsFileError> {
        Weights::parse(bytes).map_err(|Wrong { field, problem }| LpipsFileError::Invalid {
            path: path.into(),
            field,
            problem,
        })
    }

    fn parse(bytes: &[u8]) -> Result<Weights, Wrong> {
        let broken = |e| wrong("file", format!("is not a safetensors file, or is truncated ({e})"));
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(broken)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(broken)?;
        let named = |key: &str| header.metadata().as_ref().and_then(|all| all.get(key)).map(String::as_str);
        if let Some(version) = named(VERSION_KEY).filter(|version| *version != VERSION) {
            return Err(wrong(VERSION_KEY, format!("is {version:?}, expected {VERSION:?}")));
        }
        if let Some(name) = named(BACKBONE_KEY).filter(|name| *name != BACKBONE) {
            return Err(wrong(
                BACKBONE_KEY,
                format!("is {name:?}, but LPIPS is computed with AlexNet, {BACKBONE:?}, only"),
            ));
        }
        let mut convolutions = Vec::new();
        let mut linear = Vec::new();
        for (tap, conv) in CONVOLUTIONS.iter().enumerate() {
            let [weight, bias] = conv.shapes();
            let read = |part: &str, shape: &[usize]| floats(&tensors, &format!("{}.{part}", conv.name()), shape);
            convolutions.push([read("weight", &weight)?, read("bias", &bias)?]);
            linear.push(floats(&tensors, &format!("linear.{tap}"), &[conv.outputs])?);
        }
        Ok(Weights { convolutions, linear })
    }
}

/// What is wrong with which part of a file.
struct Wrong {
    field: String,
    problem: String,
}

fn wrong(field: &str, problem: String) -> Wrong {
    Wrong { field: field.into(), problem }
}

/// The values of a tensor.
fn floats(tensors: &SafeTensors, name: &str, shape: &[usize]) -> Result<Vec<f32>, Wrong> {
    let tensor = tensors
        .tensor(name)
        .map_err(|_| wrong(name, format!("is missing, but AlexNet for LPIPS has it with shape {shape:?}")))?;
    if !matches!(tensor.dtype(), Dtype::F32 | Dtype::F16) || tensor.shape() != shape {
        let found = format!("is {:?} {:?}", tensor.dtype(), tensor.shape());
        return Err(wrong(name, format!("{found}, but AlexNet for LPIPS has F32 or F16 {shape:?}")));
    }
    let values: Vec<f32> = match tensor.dtype() {
        Dtype::F16 => tensor.data().as_chunks().0.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32()).collect(),
        _ => tensor.data().as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
    };
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(wrong(name, format!("value {index} is not finite"))),
        None => Ok(values),
    }
}
