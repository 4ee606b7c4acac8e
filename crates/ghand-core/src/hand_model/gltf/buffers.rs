//! Bytes of a glTF file and the typed values in them, with every range checked.

use std::path::Path;

use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::Source as BufferSource;
use ::gltf::{Accessor, Gltf};

use super::Source;
use crate::hand_model::HandModelError;

/// The buffers of one file.
pub(super) struct Buffers<'a> {
    data: Vec<Vec<u8>>,
    source: &'a Source,
}

impl<'a> Buffers<'a> {
    pub(super) fn load(file: &Gltf, folder: Option<&Path>, source: &'a Source) -> Result<Buffers<'a>, HandModelError> {
        let mut data = Vec::new();
        for buffer in file.buffers() {
            let field = format!("buffer {}", buffer.index());
            let bytes = match buffer.source() {
                BufferSource::Bin => file.blob.clone().ok_or_else(|| {
                    source.invalid(&field, "the GLB has no binary chunk; export the hand again".into())
                })?,
                BufferSource::Uri(uri) if uri.starts_with("data:") => {
                    let problem = "is a data: URI, which is not supported; export as .glb or with a .bin file";
                    return Err(source.invalid(&field, problem.into()));
                }
                BufferSource::Uri(uri) if uri.contains("://") => {
                    return Err(source.invalid(&field, format!("lies at {uri}; put it beside the .gltf file")));
                }
                BufferSource::Uri(uri) => {
                    let folder = folder.ok_or_else(|| {
                        source.invalid(&field, format!("is in the file {uri}; export as .glb, which is one file"))
                    })?;
                    let beside = folder.join(uri);
                    std::fs::read(&beside).map_err(|error| HandModelError::Io { path: beside, source: error })?
                }
            };
            if bytes.len() < buffer.length() {
                let problem = format!(
                    "has {} of {} bytes; the file is cut short, copy or export it again",
                    bytes.len(),
                    buffer.length()
                );
                return Err(source.invalid(&field, problem));
            }
            data.push(bytes);
        }
        Ok(Buffers { data, source })
    }

    /// Finite values of a vector or matrix accessor; normalised integers become 0..1 or -1..1.
    pub(super) fn floats<const N: usize>(
        &self,
        accessor: &Accessor,
        field: &str,
    ) -> Result<Vec<[f32; N]>, HandModelError> {
        let normalized = accessor.normalized();
        let convert = |kind: DataType, bytes: &[u8]| -> Option<f32> {
            match kind {
                DataType::F32 => Some(f32::from_le_bytes(bytes.try_into().ok()?)),
                DataType::U8 if normalized => Some(f32::from(*bytes.first()?) / 255.0),
                DataType::U16 if normalized => Some(f32::from(u16::from_le_bytes(bytes.try_into().ok()?)) / 65535.0),
                _ => None,
            }
        };
        let values: Vec<[f32; N]> = self.read(accessor, field, convert)?;
        match values.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
            Some(k) => {
                Err(self.source.invalid(field, format!("entry {k} is not finite; repair the mesh and export it")))
            }
            None => Ok(values),
        }
    }

    /// Values of an unsigned integer accessor.
    pub(super) fn integers<const N: usize>(
        &self,
        accessor: &Accessor,
        field: &str,
    ) -> Result<Vec<[u32; N]>, HandModelError> {
        self.read(accessor, field, |kind, bytes| match kind {
            DataType::U8 => bytes.first().map(|b| u32::from(*b)),
            DataType::U16 => Some(u32::from(u16::from_le_bytes(bytes.try_into().ok()?))),
            DataType::U32 => Some(u32::from_le_bytes(bytes.try_into().ok()?)),
            _ => None,
        })
    }

    fn read<T: Copy, const N: usize>(
        &self,
        accessor: &Accessor,
        field: &str,
        convert: impl Fn(DataType, &[u8]) -> Option<T>,
    ) -> Result<Vec<[T; N]>, HandModelError> {
        let fail = |problem: &str| self.source.invalid(field, problem.into());
        let components = match accessor.dimensions() {
            Dimensions::Scalar => 1,
            Dimensions::Vec2 => 2,
            Dimensions::Vec3 => 3,
            Dimensions::Vec4 | Dimensions::Mat2 => 4,
            Dimensions::Mat3 => 9,
            Dimensions::Mat4 => 16,
        };
        if components != N {
            return Err(fail(&format!("has {components} components, expected {N}; export the hand again")));
        }
        if accessor.sparse().is_some() {
            return Err(fail("is stored sparsely, which is not supported; export without sparse accessors"));
        }
        let view = accessor.view().ok_or_else(|| fail("has no data; export the hand again"))?;
        let truncated = || fail("reaches beyond its buffer; the file is damaged, copy or export it again");
        let bytes = self.data.get(view.buffer().index()).ok_or_else(truncated)?;
        let component_size = accessor.data_type().size();
        let stride = view.stride().unwrap_or(component_size * N);
        let begin = view.offset().checked_add(accessor.offset()).ok_or_else(truncated)?;
        let view_end = view.offset().checked_add(view.length()).ok_or_else(truncated)?;
        let bytes = bytes.get(..view_end).ok_or_else(truncated)?;
        // Checked before anything is allocated: a damaged count must not ask for all memory.
        let last = accessor.count().checked_sub(1).ok_or_else(|| fail("is empty; export the hand again"))?;
        let end = stride.checked_mul(last).and_then(|v| v.checked_add(begin)?.checked_add(component_size * N));
        if stride == 0 || end.is_none_or(|end| end > bytes.len()) {
            return Err(truncated());
        }
        let unusable =
            || fail(&format!("has components of type {:?}; export it as glTF demands", accessor.data_type()));
        let mut values = Vec::with_capacity(accessor.count());
        for k in 0..accessor.count() {
            let element = bytes.get(begin + k * stride..).ok_or_else(truncated)?;
            let mut parts = element.chunks_exact(component_size).map(|part| convert(accessor.data_type(), part));
            let mut value = Vec::with_capacity(N);
            for _ in 0..N {
                value.push(parts.next().flatten().ok_or_else(unusable)?);
            }
            values.push(<[T; N]>::try_from(value).map_err(|_| truncated())?);
        }
        Ok(values)
    }
}
