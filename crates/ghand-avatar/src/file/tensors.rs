//! The tensors of an avatar file, as they are written and read.

use std::path::Path;

use bytemuck::Pod;
use safetensors::SafeTensors;
use safetensors::tensor::Dtype;

use super::metadata::{Metadata, ModelTag, broken};
use super::{AvatarFileError, METADATA_KEY};

/// Tensors to be written to a file.
#[derive(Default)]
pub(crate) struct Tensors {
    pub(super) named: Vec<(String, Dtype, Vec<usize>, Vec<u8>)>,
}

impl Tensors {
    /// Adds a tensor.
    pub(crate) fn add<T: Pod>(&mut self, name: &str, dtype: Dtype, shape: &[usize], values: &[T]) {
        self.named.push((name.into(), dtype, shape.to_vec(), bytemuck::cast_slice(values).to_vec()));
    }
}

/// An avatar file that is being read.
pub(crate) struct Reader<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
    pub(super) metadata: Metadata,
}

impl<'a> Reader<'a> {
    /// Reads the header and the JSON block.
    pub(super) fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Reader<'a>, AvatarFileError> {
        let invalid = |(field, problem): (&str, String)| AvatarFileError::Invalid {
            path: path.into(),
            field: field.into(),
            problem,
        };
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| invalid(broken(&e)))?;
        let block = header.metadata().as_ref().and_then(|m| m.get(METADATA_KEY));
        let no_block = "has no `ghand` block: a safetensors file, but not an avatar";
        let block = block.ok_or_else(|| invalid(("metadata", no_block.into())))?;
        let metadata = Metadata::parse(block).map_err(invalid)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| invalid(broken(&e)))?;
        Ok(Reader { path, tensors, metadata })
    }

    /// The error that a part is wrong.
    pub(crate) fn invalid(&self, field: &str, problem: impl Into<String>) -> AvatarFileError {
        AvatarFileError::Invalid { path: self.path.into(), field: field.into(), problem: problem.into() }
    }

    /// A tensor of this type; `shape` has `None` for dimensions of any size.
    pub(super) fn tensor<T: Pod + Default>(
        &self,
        name: &str,
        dtype: Dtype,
        shape: &[Option<usize>],
    ) -> Result<(Vec<usize>, Vec<T>), AvatarFileError> {
        let view = self.tensors.tensor(name).map_err(|_| self.invalid(name, "is missing; export the avatar again"))?;
        let fits =
            view.shape().len() == shape.len() && view.shape().iter().zip(shape).all(|(a, b)| b.is_none_or(|b| b == *a));
        if view.dtype() != dtype || !fits {
            return Err(self.invalid(
                name,
                format!(
                    "is {:?} {:?}, expected {dtype:?} {shape:?}; the parts of the file do not match",
                    view.dtype(),
                    view.shape()
                ),
            ));
        }
        let mut values = vec![T::default(); view.data().len() / size_of::<T>()];
        bytemuck::cast_slice_mut::<T, u8>(&mut values).copy_from_slice(view.data());
        Ok((view.shape().to_vec(), values))
    }

    /// Whether there is a tensor of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.tensors.tensor(name).is_ok()
    }

    /// An f32 tensor; `shape` has `None` for dimensions of any size.
    pub(crate) fn floats(&self, name: &str, shape: &[Option<usize>]) -> Result<Vec<f32>, AvatarFileError> {
        let (_, values) = self.tensor::<f32>(name, Dtype::F32, shape)?;
        match values.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(self.invalid(name, format!("value {i} is not finite"))),
            None => Ok(values),
        }
    }

    /// A u32 tensor; `shape` has `None` for dimensions of any size.
    pub(crate) fn words(&self, name: &str, shape: &[Option<usize>]) -> Result<Vec<u32>, AvatarFileError> {
        Ok(self.tensor::<u32>(name, Dtype::U32, shape)?.1)
    }

    /// An f64 tensor, which is f32 in a baked avatar.
    pub(super) fn mesh_numbers(&self, name: &str, shape: &[Option<usize>]) -> Result<Vec<f64>, AvatarFileError> {
        match self.metadata.property_model {
            ModelTag::Baked => Ok(self.floats(name, shape)?.into_iter().map(f64::from).collect()),
            _ => self.doubles(name, shape),
        }
    }

    /// An f64 tensor; `shape` has `None` for dimensions of any size.
    pub(super) fn doubles(&self, name: &str, shape: &[Option<usize>]) -> Result<Vec<f64>, AvatarFileError> {
        let (_, values) = self.tensor::<f64>(name, Dtype::F64, shape)?;
        match values.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(self.invalid(name, format!("value {i} is not finite"))),
            None => Ok(values),
        }
    }
}
