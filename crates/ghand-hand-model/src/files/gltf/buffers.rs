//! The bytes of a glTF file and their typed values. Every range is checked.

use std::cell::OnceCell;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use ::gltf::accessor::sparse::IndexType;
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::{Buffer, Source as BufferSource, View};
use ::gltf::{Accessor, Gltf};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use ghand_files::input_file;
use percent_encoding::percent_decode_str;

use super::Source;
use crate::HandModelError;

/// Largest file or buffer that is read.
pub(super) const MAX_BYTES: u64 = 1 << 30;
/// Most numbers of an accessor, a quarter of a gigabyte: a sparse accessor may declare any number of them without
/// storing any bytes.
const MAX_NUMBERS: usize = 1 << 26;

/// Some exporters omit the padding at the end.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The buffers of one file. Each is read when an accessor needs it; those of textures and animations never are.
pub(super) struct Buffers<'a> {
    file: &'a Gltf,
    folder: Option<&'a Path>,
    data: Vec<OnceCell<Vec<u8>>>,
    source: &'a Source,
}

impl<'a> Buffers<'a> {
    /// The buffers of a file in that folder; without a folder, the file must not name other files.
    pub(super) fn new(file: &'a Gltf, folder: Option<&'a Path>, source: &'a Source) -> Buffers<'a> {
        Buffers { file, folder, data: file.buffers().map(|_| OnceCell::new()).collect(), source }
    }

    /// The bytes of a buffer, at least as many as it declares.
    fn bytes(&self, buffer: &Buffer) -> Result<&[u8], HandModelError> {
        let field = format!("buffer {}", buffer.index());
        let fail = |problem: String| self.source.invalid(&field, problem);
        if buffer.length() as u64 > MAX_BYTES {
            let problem = format!("has {} bytes, more than {MAX_BYTES}; export only the hand", buffer.length());
            return Err(fail(problem));
        }
        let bytes = match (buffer.source(), self.data.get(buffer.index())) {
            // Only the first buffer can be the GLB's own.
            (BufferSource::Bin, _) if buffer.index() == 0 => self.file.blob.as_deref(),
            (BufferSource::Uri(uri), Some(cell)) => match cell.get() {
                Some(bytes) => Some(bytes.as_slice()),
                None => {
                    let bytes = self.load(uri, buffer.length()).map_err(fail)?;
                    Some(cell.get_or_init(|| bytes).as_slice())
                }
            },
            _ => None,
        };
        let bytes = bytes.ok_or_else(|| fail("has no data; export the hand again, without mesh compression".into()))?;
        if bytes.len() < buffer.length() {
            let problem = format!(
                "has {} of {} bytes; the file is truncated, copy or export it again",
                bytes.len(),
                buffer.length()
            );
            return Err(fail(problem));
        }
        Ok(bytes)
    }

    /// The first `length` bytes at a URI: data in the URI itself, or a file beside the glTF file.
    fn load(&self, uri: &str, length: usize) -> Result<Vec<u8>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(',').and_then(|(kind, data)| kind.ends_with(";base64").then_some(data));
            let encoded = encoded.ok_or("is a data: URI without base64; export as .glb or with a .bin file")?;
            return BASE64.decode(encoded).map_err(|error| format!("is not base64 ({error}); export the hand again"));
        }
        let folder = self.folder.ok_or_else(|| format!("is in the file {uri}; export as .glb, which is one file"))?;
        let path = folder.join(relative_path(uri)?);
        let readable = || -> std::io::Result<Vec<u8>> {
            let mut bytes = Vec::new();
            input_file::open(&path)?.take(length as u64).read_to_end(&mut bytes)?;
            Ok(bytes)
        };
        readable()
            .map_err(|error| format!("cannot read {}: {error}; put '{uri}' beside the .gltf file", path.display()))
    }

    /// Finite values of a vector or matrix accessor; normalised integers become 0..1.
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
        self.read(accessor, field, integer)
    }

    fn read<T: Copy + Default, const N: usize>(
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
        let kind = accessor.data_type();
        let count = accessor.count();
        if count == 0 {
            return Err(fail("is empty; export the hand again"));
        }
        if count.saturating_mul(N) > MAX_NUMBERS {
            return Err(fail(&format!("has {count} entries, more than any hand needs; export only the hand")));
        }
        let mut values = match accessor.view() {
            Some(view) => self.elements(&view, accessor.offset(), kind, count, field, &convert)?,
            None => vec![[T::default(); N]; count],
        };
        if let Some(sparse) = accessor.sparse() {
            let indices = sparse.indices();
            let replacements = sparse.values();
            let index_kind = match indices.index_type() {
                IndexType::U8 => DataType::U8,
                IndexType::U16 => DataType::U16,
                IndexType::U32 => DataType::U32,
            };
            let places: Vec<[u32; 1]> =
                self.elements(&indices.view(), indices.offset(), index_kind, sparse.count(), field, &integer)?;
            let replacements =
                self.elements(&replacements.view(), replacements.offset(), kind, sparse.count(), field, &convert)?;
            for ([place], value) in places.into_iter().zip(replacements) {
                let slot = values.get_mut(place as usize).ok_or_else(|| {
                    fail(&format!("replaces entry {place} of {count}; the file is damaged, export it again"))
                })?;
                *slot = value;
            }
        }
        Ok(values)
    }

    /// `count` elements of a view from `offset` on.
    fn elements<T: Copy + Default, const N: usize>(
        &self,
        view: &View,
        offset: usize,
        kind: DataType,
        count: usize,
        field: &str,
        convert: &impl Fn(DataType, &[u8]) -> Option<T>,
    ) -> Result<Vec<[T; N]>, HandModelError> {
        let truncated = || {
            self.source.invalid(field, "reaches beyond its buffer; the file is damaged, copy or export it again".into())
        };
        let unusable = || {
            self.source.invalid(
                field,
                format!("has components of type {kind:?}; export it as glTF requires, without quantization"),
            )
        };
        let bytes = self.bytes(&view.buffer())?;
        let size = kind.size() * N;
        let stride = view.stride().unwrap_or(size);
        let begin = view.offset().checked_add(offset).ok_or_else(truncated)?;
        let view_end = view.offset().checked_add(view.length()).ok_or_else(truncated)?;
        let bytes = bytes.get(..view_end).ok_or_else(truncated)?;
        let Some(last) = count.checked_sub(1) else { return Ok(vec![]) };
        // Checked before anything is allocated: a damaged count must not exhaust memory. Elements do not overlap, so
        // there are at most as many as bytes.
        let end = stride.checked_mul(last).and_then(|v| v.checked_add(begin)?.checked_add(size));
        if stride < size || end.is_none_or(|end| end > bytes.len()) {
            return Err(truncated());
        }
        let mut values = Vec::with_capacity(count);
        for k in 0..count {
            let at = begin + k * stride;
            let element = bytes.get(at..at + size).ok_or_else(truncated)?;
            let mut value = [T::default(); N];
            for (slot, part) in value.iter_mut().zip(element.chunks_exact(kind.size())) {
                *slot = convert(kind, part).ok_or_else(unusable)?;
            }
            values.push(value);
        }
        Ok(values)
    }
}

fn integer(kind: DataType, bytes: &[u8]) -> Option<u32> {
    match kind {
        DataType::U8 => bytes.first().map(|b| u32::from(*b)),
        DataType::U16 => Some(u32::from(u16::from_le_bytes(bytes.try_into().ok()?))),
        DataType::U32 => Some(u32::from_le_bytes(bytes.try_into().ok()?)),
        _ => None,
    }
}

/// The path of a URI below the folder of its file. A downloaded hand must not cause other files to be read.
fn relative_path(uri: &str) -> Result<PathBuf, String> {
    let decoded = percent_decode_str(uri)
        .decode_utf8()
        .map_err(|_| format!("is at '{uri}', which is not UTF-8; rename the file"))?;
    let outside = || format!("is at '{uri}', outside the .gltf file's folder; put it beside the .gltf file");
    // A colon is part of a scheme or of a Windows drive; a backslash separates folders on Windows.
    if decoded.is_empty() || decoded.contains([':', '\\', '\0']) {
        return Err(outside());
    }
    let path = PathBuf::from(decoded.as_ref());
    if path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        Ok(path)
    } else {
        Err(outside())
    }
}
