//! PlayCanvas' compressed `.ply`: chunks of 256 Gaussians with the ranges of their numbers, and four words for each
//! Gaussian. An element `sh` may have the harmonics beyond the first, a byte each.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use ghand_render::splat::SplatModel;

use super::{Element, Header, Kind, Problem, SplatScene, dc_of, degree_of, logit_of, problem, truncated};

/// Gaussians of a chunk.
const CHUNK: usize = 256;
/// Numbers of a chunk: the ranges of position, scale and colour. Older files have no range of the colour, which is 0 to 1.
const RANGES: [&str; 18] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];
/// Number of them that every file has.
const NEEDED: usize = 12;
const WORDS: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
/// Largest coefficient of a harmonic.
const LARGEST_HARMONIC: f64 = 4.0;

/// Rows of an element in the file.
struct Rows<'a> {
    element: &'a Element,
    bytes: &'a [u8],
}

impl Rows<'_> {
    fn value(&self, row: usize, column: usize) -> f64 {
        let kind = self.element.properties[column].1;
        let start = row * self.element.stride() + self.element.offset(column);
        f64::from(kind.value(&self.bytes[start..start + kind.size()]))
    }

    fn word(&self, row: usize, column: usize) -> u32 {
        let start = row * self.element.stride() + self.element.offset(column);
        self.bytes[start..].first_chunk::<4>().map_or(0, |word| u32::from_le_bytes(*word))
    }

    fn columns(&self, names: &[&str]) -> Result<Vec<usize>, Problem> {
        names.iter().map(|name| self.element.column(name)).collect()
    }
}

pub(super) fn parse(bytes: &[u8], header: &Header) -> Result<SplatScene, Problem> {
    if header.ascii {
        return problem("format", "is ascii, but packed numbers are binary; save it as binary_little_endian");
    }
    let mut data = bytes.get(header.end..).unwrap_or_default();
    let mut chunks = None;
    let mut vertices = None;
    let mut harmonics = None;
    for element in &header.elements {
        if let Some(unreadable) = &element.unreadable {
            return Err(unreadable.clone());
        }
        // Checked before anything is allocated.
        let length = element.count.saturating_mul(element.stride());
        let Some((own, rest)) = data.split_at_checked(length) else {
            let there = data.len() / element.stride().max(1);
            let text = format!("has {there} of {} rows of {}; copy the file again", element.count, element.name);
            return problem("data", text);
        };
        let rows = Some(Rows { element, bytes: own });
        match element.name.as_str() {
            "chunk" => chunks = rows,
            "vertex" => vertices = rows,
            "sh" => harmonics = rows,
            _ => {}
        }
        data = rest;
    }
    let (Some(chunks), Some(vertices)) = (chunks, vertices) else {
        return problem("element chunk", "is missing, without which packed numbers mean nothing; save the file again");
    };
    let count = vertices.element.count;
    if chunks.element.count.saturating_mul(CHUNK) < count {
        return problem("element chunk", format!("has {} rows, too few for {count} Gaussians", chunks.element.count));
    }
    let has_colors = chunks.element.column(RANGES[NEEDED]).is_ok();
    let ranges = chunks.columns(if has_colors { &RANGES } else { &RANGES[..NEEDED] })?;
    let words = vertices.columns(&WORDS)?;
    if words.iter().any(|column| vertices.element.properties[*column].1 != Kind::WORD) {
        return problem("packed_*", "must be of the type uint; save the file again");
    }
    let rest = harmonics.as_ref().map_or(0, |rows| rows.element.properties.len());
    let degree = degree_of(rest)?;
    let rest_columns = match &harmonics {
        Some(rows) if rows.element.count < count => return truncated(rows.element.count, count),
        Some(rows) => (0..rest).map(|k| rows.element.column(&format!("f_rest_{k}"))).collect::<Result<Vec<_>, _>>()?,
        None => vec![],
    };
    let range = |i: usize, what: usize, axis: usize, part: f64| {
        let at = |end: usize| chunks.value(i / CHUNK, ranges[6 * what + 3 * end + axis]);
        at(0) + (at(1) - at(0)) * part
    };
    let number = |row: usize, i: usize| -> f64 {
        let word = |k: usize| vertices.word(i, words[k]);
        match row {
            0..3 => range(i, 0, row, vector(word(0))[row]),
            3..6 => range(i, 1, row - 3, vector(word(2))[row - 3]),
            6..10 => rotation(word(1))[row - 6],
            10 => logit_of(bytes_of(word(3))[3]),
            11..14 => {
                let part = bytes_of(word(3))[row - 11];
                dc_of(if has_colors { range(i, 2, row - 11, part) } else { part })
            }
            _ => {
                // The file orders them by channel, the table by function.
                let function = (row - 14) / 3;
                let channel = (row - 14) % 3;
                let column = rest_columns[channel * (rest / 3) + function];
                let byte = harmonics.as_ref().map_or(0.0, |rows| rows.value(i, column));
                LARGEST_HARMONIC * (2.0 * harmonic_part(byte) - 1.0)
            }
        }
    };
    let table = SplatModel::trained(degree).table(count, |row, i| number(row, i) as f32);
    Ok(SplatScene { degree, count, table, antialias: header.antialias })
}

/// Where in its range the coefficient of a byte is, 0 to 1: the ends exactly, else the middle of the byte's step.
fn harmonic_part(byte: f64) -> f64 {
    if byte <= 0.0 {
        0.0
    } else if byte >= 255.0 {
        1.0
    } else {
        (byte + 0.5) / 256.0
    }
}

/// A whole number of so many bits as a part of the largest.
fn part(word: u32, shift: u32, bits: u32) -> f64 {
    let largest = (1 << bits) - 1;
    f64::from(word >> shift & largest) / f64::from(largest)
}

/// Three parts of 11, 10 and 11 bits.
fn vector(word: u32) -> [f64; 3] {
    [part(word, 21, 11), part(word, 11, 10), part(word, 0, 11)]
}

/// Four parts of a byte, the first in the highest.
fn bytes_of(word: u32) -> [f64; 4] {
    [24, 16, 8, 0].map(|shift| part(word, shift, 8))
}

/// A quaternion (w, x, y, z): which component is the largest, and the three others.
fn rotation(word: u32) -> [f64; 4] {
    let others = [20, 10, 0].map(|shift| (part(word, shift, 10) - 0.5) * SQRT_2);
    debug_assert!(others.iter().all(|v| v.abs() <= FRAC_1_SQRT_2 + 1e-9));
    let largest = (1.0 - others.iter().map(|v| v * v).sum::<f64>()).max(0.0).sqrt();
    let mut rotation = others.into_iter();
    std::array::from_fn(|k| if k == (word >> 30) as usize { largest } else { rotation.next().unwrap_or(0.0) })
}

#[cfg(test)]
mod tests {
    use super::super::{Antialiasing, parse_any};

    /// A file of `count` Gaussians that are all alike, with these words and ranges of 0 to 2, -5 to -1 and 0 to 1.
    fn file(count: usize, words: [u32; 4], rest: usize, colors: bool, comment: &str) -> Vec<u8> {
        let chunks = count.div_ceil(256);
        let mut header = format!("ply\nformat binary_little_endian 1.0\n{comment}element chunk {chunks}\n");
        let names = &super::RANGES[..if colors { 18 } else { 12 }];
        names.iter().for_each(|name| header.push_str(&format!("property float {name}\n")));
        header.push_str(&format!("element vertex {count}\n"));
        super::WORDS.iter().for_each(|name| header.push_str(&format!("property uint {name}\n")));
        if rest > 0 {
            header.push_str(&format!("element sh {count}\n"));
            (0..rest).for_each(|k| header.push_str(&format!("property uchar f_rest_{k}\n")));
        }
        let mut bytes = (header + "end_header\n").into_bytes();
        let ranges = [[0.0f32; 3], [2.0; 3], [-5.0; 3], [-1.0; 3], [0.0; 3], [1.0; 3]];
        for _ in 0..chunks {
            bytes.extend(ranges.as_flattened()[..names.len()].iter().flat_map(|v| v.to_le_bytes()));
        }
        (0..count).for_each(|_| bytes.extend(words.iter().flat_map(|word| word.to_le_bytes())));
        (0..count).for_each(|_| bytes.extend((0..rest).map(|k| if k == 1 { 255 } else { 128 })));
        bytes
    }

    /// Position (2, 0, 1), scales all at -3, rotation 90 degrees about x, colour (1, 0, 0.5), opacity 0.8.
    fn words() -> [u32; 4] {
        let middle = 1023 << 21 | 511 << 11 | 1023;
        // w is the largest; x is 0.7071, the others 0.
        let rotation = 1023 << 20 | 511 << 10 | 511;
        [2047 << 21 | 1023, rotation, middle, 255 << 24 | 127 << 8 | 204]
    }

    #[test]
    fn packed_numbers_are_those_of_the_ranges() {
        for (count, colors) in [(1, true), (300, false)] {
            let scene = parse_any(&file(count, words(), 0, colors, ""), "ply").unwrap();
            assert_eq!((scene.count, scene.degree, scene.antialias), (count, 0, Antialiasing::Off));
            let at = |row: usize| f64::from(scene.row(row).last().unwrap());
            let expected = [2.0, 0.0, 1.0, -3.0, -3.0, -3.0, 0.707, 0.707, 0.0, 0.0, 1.386, 1.772, -1.772, 0.0];
            for (row, value) in expected.into_iter().enumerate() {
                assert!((at(row) - value).abs() < 0.01, "row {row}: {} instead of {value}", at(row));
            }
        }
    }

    #[test]
    fn harmonics_and_antialiasing_are_read() {
        let scene = parse_any(&file(2, words(), 9, true, "comment SplatRenderMode: mip\n"), "ply").unwrap();
        assert_eq!((scene.antialias, scene.degree), (Antialiasing::Narrow, 1));
        // Number 1 of the file is the second function of red.
        let rest: Vec<f32> = (14..23).map(|row| scene.row(row).next().unwrap()).collect();
        assert!(rest[3] == 4.0 && rest.iter().filter(|v| v.abs() < 0.02).count() == 8, "{rest:?}");
    }

    #[test]
    fn damaged_files_are_errors_that_name_the_part() {
        let good = file(300, words(), 9, true, "");
        let replaced = |from: &str, to: &str| {
            let at = good.windows(from.len()).position(|part| part == from.as_bytes()).unwrap();
            [&good[..at], to.as_bytes(), &good[at + from.len()..]].concat()
        };
        for (bytes, part) in [
            (good[..good.len() - 1].to_vec(), "rows of sh"),
            (good[..900].to_vec(), "rows of"),
            (replaced("chunk 2", "chunk 1"), "too few"),
            (replaced("chunk 2", "chunk 99999999999999999"), "rows of chunk"),
            (replaced("chunk 2", "chonk 2"), "element chunk"),
            (replaced("uint packed_scale", "char packed_scale"), "type uint"),
            (replaced("packed_color", "packed_colour"), "packed_color"),
            (replaced("max_scale_x", "max_scale_w"), "max_scale_x"),
            (replaced("property uchar f_rest_8\n", ""), "f_rest_*"),
            (replaced("binary_little_endian", "ascii"), "is ascii"),
        ] {
            let (field, text) = parse_any(&bytes, "ply").unwrap_err();
            assert!(format!("{field}: {text}").contains(part), "{field}: {text}");
        }
    }
}
