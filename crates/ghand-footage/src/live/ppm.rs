//! Pictures one after the other in a stream, in the form PPM, which tells the size of each.

use std::io::{self, BufRead, ErrorKind, Read};

/// Most columns or rows; the pictures of a stream were made small.
const LARGEST_EDGE: u32 = 8192;
/// Most bytes of a header.
const LONGEST_HEADER: u64 = 64;

/// Columns, rows, and red, green, blue of each pixel, row by row.
pub(super) type Picture = (u32, u32, Vec<u8>);

/// The next picture of a stream; `None` at its end. An incomplete picture is none.
pub(super) fn next_picture(stream: &mut impl BufRead) -> io::Result<Option<Picture>> {
    let mut header = stream.by_ref().take(LONGEST_HEADER);
    let Some(kind) = word(&mut header)? else { return Ok(None) };
    let mut number = || word(&mut header).map(|word| word.and_then(|word| word.parse::<u32>().ok()));
    let [width, height, largest] = [number()?, number()?, number()?];
    let is_edge = |edge: &u32| (1..=LARGEST_EDGE).contains(edge);
    let (Some(width), Some(height)) = (width.filter(is_edge), height.filter(is_edge)) else {
        return Err(ErrorKind::InvalidData.into());
    };
    if kind != "P6" || largest != Some(255) {
        return Err(ErrorKind::InvalidData.into());
    }
    let length = u64::from(width) * u64::from(height) * 3;
    let mut rgb = Vec::with_capacity(length as usize);
    stream.by_ref().take(length).read_to_end(&mut rgb)?;
    Ok((rgb.len() as u64 == length).then_some((width, height, rgb)))
}

/// A word and the one white space behind it; `None` at the end.
fn word(stream: &mut impl BufRead) -> io::Result<Option<String>> {
    let mut word = String::new();
    for byte in stream.bytes() {
        match byte? {
            byte if byte.is_ascii_whitespace() => return Ok(Some(word)),
            byte => word.push(byte.into()),
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_any_size_follow_each_other() {
        let mut stream: &[u8] = b"P6\n2 1\n255\nabc\nefP6\n1 1\n255\nxyzP6\n9 9\n255\nlost";
        assert_eq!(next_picture(&mut stream).unwrap(), Some((2, 1, b"abc\nef".to_vec())));
        assert_eq!(next_picture(&mut stream).unwrap(), Some((1, 1, b"xyz".to_vec())));
        assert_eq!(next_picture(&mut stream).unwrap(), None, "it is incomplete");
        assert_eq!(next_picture(&mut stream).unwrap(), None);
    }

    #[test]
    fn what_is_not_a_picture_is_refused() {
        for text in
            [&b"P5\n2 1\n255\nab"[..], b"P6\n2 -1\n255\n", b"P6\n99999 9\n255\n", b"P6\n2 1\n65535\n", b"a b c d "]
        {
            assert!(next_picture(&mut &*text).is_err(), "{}", String::from_utf8_lossy(text));
        }
        assert_eq!(next_picture(&mut &[b'P'; 200][..]).unwrap(), None, "a header has an end");
    }
}
