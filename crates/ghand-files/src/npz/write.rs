//! Writes `.npz` archives.

use std::io::{self, Cursor, Write};

/// An array to be written: its name, its shape, and its numbers, row-major.
pub struct NamedNumbers<'a> {
    /// The name, without `.npy`.
    pub name: &'a str,
    /// Lengths of the axes.
    pub shape: &'a [usize],
    /// The numbers.
    pub values: &'a [f64],
}

/// The bytes of an archive of arrays of 8-byte floats.
///
/// # Errors
/// An error of the compressor; [`io::ErrorKind::InvalidInput`] names an array whose numbers do not match its shape.
pub fn npz_bytes(arrays: &[NamedNumbers]) -> io::Result<Vec<u8>> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    // No timestamps, so that the same arrays give the same bytes.
    let options = zip::write::SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Deflated)
        .last_modified_time(zip::DateTime::default());
    for array in arrays {
        if array.shape.iter().product::<usize>() != array.values.len() {
            let problem = format!("{} has {} numbers, its shape is {:?}", array.name, array.values.len(), array.shape);
            return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
        }
        archive.start_file(format!("{}.npy", array.name), options)?;
        archive.write_all(&npy_header(array.shape))?;
        let bytes: Vec<u8> = array.values.iter().flat_map(|v| v.to_le_bytes()).collect();
        archive.write_all(&bytes)?;
    }
    Ok(archive.finish()?.into_inner())
}

/// The header of NumPy's format 1.0, padded so that the numbers begin at a multiple of 64 bytes.
fn npy_header(shape: &[usize]) -> Vec<u8> {
    let axes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}), }}", axes.trim_end());
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    // A shape of a few axes needs far fewer than the 65,535 bytes that the format allows.
    header.extend((length as u16).to_le_bytes());
    header.extend(format!("{text:<width$}\n", width = length - 1).bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::super::Npz;
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let arrays = [
            NamedNumbers { name: "a", shape: &[2, 3], values: &[0.0, -1.5, 1e300, f64::MIN_POSITIVE, 4.0, 5.0] },
            NamedNumbers { name: "b", shape: &[1], values: &[0.1] },
            NamedNumbers { name: "empty", shape: &[0, 3], values: &[] },
        ];
        let bytes = npz_bytes(&arrays).unwrap();
        assert_eq!(bytes, npz_bytes(&arrays).unwrap(), "the same bytes each time");
        let mut archive = Npz::open(&bytes).unwrap();
        for array in arrays {
            let read = archive.numbers(array.name).unwrap();
            assert_eq!((read.shape.as_slice(), read.values.as_slice()), (array.shape, array.values));
        }
        let wrong = NamedNumbers { name: "c", shape: &[2, 2], values: &[1.0] };
        assert!(npz_bytes(&[wrong]).unwrap_err().to_string().contains("c has 1 numbers"));
    }
}
