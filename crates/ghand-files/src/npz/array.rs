//! Arrays of numbers as NumPy stores them: a type code, a shape, and the bytes.

/// The problem with a stored array, and its remedy.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ArrayError(pub String);

/// An array of numbers, row-major (the last index runs fastest), independent of the order in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct NumericArray {
    /// Length of each axis; empty for a single number.
    pub shape: Vec<usize>,
    /// The numbers, as many as the product of `shape`. Integers beyond 2^53 are rounded.
    pub values: Vec<f64>,
}

/// Most numbers in one array: twice the pose blend shapes of a whole body (10475 x 3 x 486), 256 MiB as f64.
const MAX_ELEMENTS: usize = 1 << 25;

/// Most axes of an array; arrays of hand models have at most three.
const MAX_AXES: usize = 8;

/// Type of the elements of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ElementKind {
    Float,
    /// Floats of two bytes that are the upper halves of floats of four.
    BrainFloat,
    Signed,
    Unsigned,
    Bool,
    /// Python objects: their bytes are a pickle.
    Object,
    /// Text, one byte per character.
    Bytes,
    /// Text, four bytes per character.
    Unicode,
}

/// Type of the elements of an array, and how to read their bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ElementType {
    pub kind: ElementKind,
    /// Bytes of one element; 0 for objects.
    pub size: usize,
    pub big_endian: bool,
}

impl ElementType {
    /// Reads a code such as `<f8`, `>i4`, `|u1`, `f8`, `|O` or `U7`.
    pub(crate) fn parse(code: &str) -> Result<ElementType, ArrayError> {
        let unusable = || {
            ArrayError(format!(
                "has elements of type {code:?}; store integers of 1 to 8 bytes or floats of 2 to 8 \
                 (array.astype(float))"
            ))
        };
        let (big_endian, rest) = match code.split_at_checked(1) {
            Some((">", rest)) => (true, rest),
            Some(("<" | "|" | "=", rest)) => (false, rest),
            _ => (false, code),
        };
        let (letter, size) = rest.split_at_checked(1).ok_or_else(unusable)?;
        let size: usize = if size.is_empty() { 0 } else { size.parse().map_err(|_| unusable())? };
        let (kind, size) = match (letter, size) {
            ("f", 2 | 4 | 8) => (ElementKind::Float, size),
            ("i", 1 | 2 | 4 | 8) => (ElementKind::Signed, size),
            ("u", 1 | 2 | 4 | 8) => (ElementKind::Unsigned, size),
            ("b", 1) => (ElementKind::Bool, size),
            ("O", _) => (ElementKind::Object, 0),
            ("S", _) => (ElementKind::Bytes, size),
            ("U", _) => (ElementKind::Unicode, size.checked_mul(4).ok_or_else(unusable)?),
            _ => return Err(unusable()),
        };
        Ok(ElementType { kind, size, big_endian })
    }

    /// Number of bytes of an array of this shape.
    pub(crate) fn byte_count(&self, shape: &[usize]) -> Result<usize, ArrayError> {
        element_count(shape)?
            .checked_mul(self.size)
            .ok_or_else(|| ArrayError(format!("is far too large ({shape:?}); store less in it")))
    }

    /// The numbers in `bytes`; `fortran` if the first index runs fastest there.
    pub(crate) fn numbers(&self, bytes: &[u8], shape: &[usize], fortran: bool) -> Result<NumericArray, ArrayError> {
        let wanted = self.byte_count(shape)?;
        if bytes.len() != wanted {
            let found = bytes.len();
            return Err(ArrayError(format!(
                "has {found} bytes, its shape {shape:?} needs {wanted}; the file is damaged, copy or download it again"
            )));
        }
        let big = self.big_endian;
        let values = match (self.kind, self.size) {
            (ElementKind::Float, 2) => decode(bytes, big, |b| half(u16::from_le_bytes(b))),
            (ElementKind::BrainFloat, 2) => {
                decode(bytes, big, |b| f64::from(f32::from_bits(u32::from(u16::from_le_bytes(b)) << 16)))
            }
            (ElementKind::Float, 4) => decode(bytes, big, |b| f64::from(f32::from_le_bytes(b))),
            (ElementKind::Float, 8) => decode(bytes, big, f64::from_le_bytes),
            (ElementKind::Signed, 1) => decode(bytes, big, |b| f64::from(i8::from_le_bytes(b))),
            (ElementKind::Signed, 2) => decode(bytes, big, |b| f64::from(i16::from_le_bytes(b))),
            (ElementKind::Signed, 4) => decode(bytes, big, |b| f64::from(i32::from_le_bytes(b))),
            (ElementKind::Signed, 8) => decode(bytes, big, |b| i64::from_le_bytes(b) as f64),
            (ElementKind::Unsigned, 1) => decode(bytes, big, |b| f64::from(u8::from_le_bytes(b))),
            (ElementKind::Unsigned, 2) => decode(bytes, big, |b| f64::from(u16::from_le_bytes(b))),
            (ElementKind::Unsigned, 4) => decode(bytes, big, |b| f64::from(u32::from_le_bytes(b))),
            (ElementKind::Unsigned, 8) => decode(bytes, big, |b| u64::from_le_bytes(b) as f64),
            (ElementKind::Bool, 1) => decode(bytes, big, |[b]| f64::from(u8::from(b != 0))),
            _ => return Err(ArrayError("has objects or text; store numbers in it".into())),
        };
        let values = if fortran { rows_first(&values, shape) } else { values };
        Ok(NumericArray { shape: shape.to_vec(), values })
    }

    /// The text of a single element of a text type, without the padding.
    pub(crate) fn text(&self, bytes: &[u8]) -> Option<String> {
        let text: String = match self.kind {
            ElementKind::Bytes => bytes.iter().map(|&b| char::from(b)).collect(),
            ElementKind::Unicode => {
                let code = |c: [u8; 4]| if self.big_endian { u32::from_be_bytes(c) } else { u32::from_le_bytes(c) };
                let characters = bytes.chunks_exact(4).map(|c| <[u8; 4]>::try_from(c).ok().map(code));
                characters.map(|c| char::from_u32(c?)).collect::<Option<String>>()?
            }
            _ => return None,
        };
        Some(text.trim_end_matches('\0').to_owned())
    }
}

/// Product of the axes, within the limits. The limits also apply to the other axes if one has length 0, because a
/// reader of such an array may count its rows.
pub(crate) fn element_count(shape: &[usize]) -> Result<usize, ArrayError> {
    let most = shape.iter().try_fold(1usize, |product, &n| product.checked_mul(n.max(1)));
    match most {
        Some(most) if most <= MAX_ELEMENTS && shape.len() <= MAX_AXES => Ok(shape.iter().product()),
        _ => Err(ArrayError(format!(
            "has the shape {shape:?}; at most {MAX_ELEMENTS} numbers in {MAX_AXES} axes are read, store less in it"
        ))),
    }
}

/// Converts a two-byte float: a sign, five bits of exponent, ten of fraction.
fn half(bits: u16) -> f64 {
    let exponent = i32::from(bits >> 10 & 0x1f);
    let fraction = f64::from(bits & 0x3ff);
    let size = match exponent {
        0 => fraction * 2f64.powi(-24),
        0x1f if fraction == 0.0 => f64::INFINITY,
        0x1f => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    };
    if bits >> 15 == 0 { size } else { -size }
}

fn decode<const N: usize>(bytes: &[u8], big_endian: bool, number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    let element = |chunk: &[u8]| {
        let mut element = [0; N];
        element.copy_from_slice(chunk);
        if big_endian {
            element.reverse();
        }
        number(element)
    };
    bytes.chunks_exact(N).map(element).collect()
}

/// Converts from the order in which the first index runs fastest to that in which the last does. `values` has as many
/// numbers as the product of `shape`.
fn rows_first(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut strides = Vec::with_capacity(shape.len());
    let mut stride = 1;
    for &n in shape {
        strides.push(stride);
        stride *= n;
    }
    let mut index = vec![0; shape.len()];
    let mut from = 0;
    let mut result = Vec::with_capacity(values.len());
    while result.len() < values.len() {
        result.push(values[from]);
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            from += strides[axis];
            if index[axis] < shape[axis] {
                break;
            }
            from -= strides[axis] * shape[axis];
            index[axis] = 0;
        }
    }
    result
}
