//! Scenes of Gaussians: in the `.ply` format of 3D Gaussian Splatting, in PlayCanvas' compressed one, `.spz` and `.splat`.

mod compressed;
mod dot_splat;
mod spz;
mod suspicions;
mod write;

use std::path::{Path, PathBuf};

use ghand_files::input_file;
use ghand_render::splat::SplatModel;
use glam::DVec3;
pub use write::{EXPORTED_OPACITY, exported_logit};

/// Why a scene file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// The file could not be read.
    #[error("{path}: cannot read the scene: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file could not be written.
    #[error("{path}: cannot write the scene: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The contents are unusable.
    #[error("{path}: {field}: {problem}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The part that is wrong.
        field: String,
        /// What is wrong and what to do.
        problem: String,
    },
}

/// The comment on a `.ply` file's wide blur, after one that other programs read.
const WIDE_COMMENT: &str = "blur: 0.3 square pixels";

/// Maximum file size, bytes; the largest published scenes have about 1.5 GiB.
const LARGEST_FILE: u64 = 1 << 32;

/// Gaussians as stored: means in metres, logarithms of sizes, quaternions (w, x, y, z) of any norm, logits of
/// opacities, coefficients of spherical harmonics.
#[derive(Debug, Clone, PartialEq)]
pub struct SplatScene {
    /// Degree of the harmonics, 0 to 3.
    pub degree: u32,
    /// Number of Gaussians, N.
    pub count: usize,
    /// The table of [`SplatModel::trained`] for this degree, ordered by [`SplatModel::index`].
    pub table: Vec<f32>,
    /// The antialiasing that it was trained with, so that it must be shown with it.
    pub antialias: Antialiasing,
}

/// What becomes of Gaussians smaller than a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Antialiasing {
    /// They are larger than they should be.
    #[default]
    Off,
    /// They are fainter, blurred by 0.1 square pixels, as in Mip-Splatting.
    Narrow,
    /// They are fainter, blurred by 0.3 square pixels, as in gsplat.
    Wide,
}

impl Antialiasing {
    /// That of Gaussians that are antialiased with a narrow blur or not.
    pub(crate) fn of(antialias: bool, narrow: bool) -> Antialiasing {
        match (antialias, narrow) {
            (false, _) => Antialiasing::Off,
            (true, true) => Antialiasing::Narrow,
            (true, false) => Antialiasing::Wide,
        }
    }
}

impl SplatScene {
    /// The model of the Gaussians.
    pub fn model(&self) -> SplatModel {
        let antialias = self.antialias != Antialiasing::Off;
        let narrow = self.antialias == Antialiasing::Narrow;
        SplatModel { antialias, narrow, ..SplatModel::trained(self.degree) }
    }

    /// A row of the table, a number of each Gaussian.
    pub fn row(&self, row: usize) -> impl Iterator<Item = f32> {
        let model = self.model();
        (0..self.count).filter_map(move |i| self.table.get(model.index(row, i, self.count)).copied())
    }

    /// The centres of the Gaussians.
    pub fn means(&self) -> impl Iterator<Item = DVec3> {
        let [x, y, z] = [0, 1, 2].map(|axis| self.row(axis).map(f64::from));
        x.zip(y).zip(z).map(|((x, y), z)| DVec3::new(x, y, z))
    }

    /// Reads a scene, recognised from its contents or else its name. A `.ply` file is binary (little-endian) or ASCII, with
    /// the properties `x y z`, `f_dc_*`, `f_rest_*` (0, 9, 24 or 45 of them), `opacity`, `scale_*` and `rot_*`, others are
    /// ignored; or it is PlayCanvas' compressed one. Or the file is a `.spz` or a `.splat`.
    ///
    /// # Errors
    /// [`PlyError`] names the file, the part and a remedy.
    pub fn read(path: &Path) -> Result<SplatScene, PlyError> {
        let bytes =
            input_file::read(path, LARGEST_FILE).map_err(|source| PlyError::Io { path: path.into(), source })?;
        let too_large = || ("file".into(), format!("is larger than {} GiB; split the scene", LARGEST_FILE >> 30));
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        let scene = bytes.ok_or_else(too_large).and_then(|bytes| parse_any(&bytes, &ending));
        scene.map_err(|(field, problem)| PlyError::Invalid { path: path.into(), field, problem })
    }
}

/// Reads a scene whose file's name has this ending, in lower case.
fn parse_any(bytes: &[u8], ending: &str) -> Result<SplatScene, Problem> {
    let convert = |format: &str, ending: &str| {
        let text = format!(
            "is {format}, which is not read; convert it to .ply, for example with PlayCanvas' splat-transform: \
             `splat-transform scene.{ending} scene.ply`"
        );
        problem("format", text)
    };
    match ending {
        _ if bytes.starts_with(b"ply") => parse(bytes),
        _ if bytes.starts_with(spz::GZIP) => spz::parse(bytes),
        _ if bytes.starts_with(spz::MAGIC) => convert("SPZ of version 4 or later", "spz"),
        "sog" => convert("SOG", "sog"),
        "ksplat" => convert("a .ksplat", "ksplat"),
        "lcc" => convert("an .lcc", "lcc"),
        "spz" => problem("header", "is not that of an SPZ file; copy it again"),
        "splat" => dot_splat::parse(bytes),
        _ => parse(bytes),
    }
}

/// The field of the file, and what is wrong with it.
type Problem = (String, String);

fn problem<T>(field: &str, text: impl Into<String>) -> Result<T, Problem> {
    Err((field.into(), text.into()))
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Integer { bytes: usize, signed: bool },
    Float,
    Double,
}

impl Kind {
    /// Four bytes without a sign.
    const WORD: Kind = Kind::Integer { bytes: 4, signed: false };

    fn parse(name: &str) -> Option<Kind> {
        let integer = |bytes, signed| Some(Kind::Integer { bytes, signed });
        match name {
            "char" | "int8" => integer(1, true),
            "uchar" | "uint8" => integer(1, false),
            "short" | "int16" => integer(2, true),
            "ushort" | "uint16" => integer(2, false),
            "int" | "int32" => integer(4, true),
            "uint" | "uint32" => integer(4, false),
            "float" | "float32" => Some(Kind::Float),
            "double" | "float64" => Some(Kind::Double),
            _ => None,
        }
    }

    fn size(self) -> usize {
        match self {
            Kind::Integer { bytes, .. } => bytes,
            Kind::Float => 4,
            Kind::Double => 8,
        }
    }

    /// Reads a value from exactly [`Kind::size`] bytes.
    fn value(self, bytes: &[u8]) -> f32 {
        let mut word = [0; 8];
        word.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        match self {
            Kind::Float => f32::from_le_bytes([word[0], word[1], word[2], word[3]]),
            Kind::Double => f64::from_le_bytes(word) as f32,
            Kind::Integer { bytes, signed } => {
                let unused = 64 - 8 * bytes as u32;
                let raw = u64::from_le_bytes(word) << unused;
                if signed { ((raw as i64) >> unused) as f32 } else { (raw >> unused) as f32 }
            }
        }
    }
}

/// A kind of rows.
struct Element {
    name: String,
    count: usize,
    properties: Vec<(String, Kind)>,
    /// A property that cannot be read, and what is wrong with it.
    unreadable: Option<Problem>,
}

impl Element {
    /// Bytes of a row.
    fn stride(&self) -> usize {
        self.properties.iter().map(|(_, kind)| kind.size()).sum()
    }

    /// Bytes of the properties before one.
    fn offset(&self, column: usize) -> usize {
        self.properties.iter().take(column).map(|(_, kind)| kind.size()).sum()
    }

    fn column(&self, name: &str) -> Result<usize, Problem> {
        match self.properties.iter().position(|(own, _)| own == name) {
            Some(column) => Ok(column),
            None => problem(&format!("property {name}"), "is missing; give a 3D Gaussian Splatting .ply file"),
        }
    }
}

struct Header {
    ascii: bool,
    elements: Vec<Element>,
    /// What its comments say.
    antialias: Antialiasing,
    /// Offset of the data, bytes.
    end: usize,
}

/// Maximum length of the header, bytes: a thousand properties of a hundred letters.
const MAX_HEADER: usize = 100_000;

fn header(bytes: &[u8]) -> Result<Header, Problem> {
    let mut at = 0;
    let mut line = || -> Result<&str, Problem> {
        let rest = bytes.get(at..bytes.len().min(MAX_HEADER)).unwrap_or_default();
        let Some(length) = rest.iter().position(|b| *b == b'\n') else {
            return problem("header", "has no end; this is not a PLY file, or it is truncated");
        };
        at += length + 1;
        match std::str::from_utf8(&rest[..length]) {
            Ok(text) => Ok(text.trim()),
            Err(_) => problem("header", "is not text; this is not a PLY file"),
        }
    };
    if line()? != "ply" {
        return problem("header", "does not begin with `ply`; give a 3D Gaussian Splatting .ply file");
    }
    let mut ascii = None;
    let mut antialias = Antialiasing::Off;
    let mut elements = Vec::<Element>::new();
    loop {
        let words: Vec<String> = line()?.split_whitespace().map(String::from).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        match (words.as_slice(), elements.last_mut()) {
            (["format", "ascii", _], _) => ascii = Some(true),
            (["format", "binary_little_endian", _], _) => ascii = Some(false),
            (["format", other, ..], _) => {
                return problem("format", format!("is {other}; save it as binary_little_endian or ascii"));
            }
            (["comment", comment @ ..], _) => antialias = said_antialias(comment).unwrap_or(antialias),
            (["obj_info", ..] | [], _) => {}
            (["element", name, number], _) => match number.parse::<usize>() {
                Ok(count) => {
                    elements.push(Element { name: (*name).into(), count, properties: vec![], unreadable: None });
                }
                Err(_) => return problem(&format!("element {name}"), format!("has the count {number:?}")),
            },
            (["property", "list", ..], Some(element)) => {
                let text = format!("of the element {} is a list; remove it", element.name);
                element.unreadable.get_or_insert(("property".into(), text));
            }
            (["property", kind, name], Some(element)) => match Kind::parse(kind) {
                Some(kind) => element.properties.push(((*name).into(), kind)),
                None => {
                    let text = format!("is of the unknown type {kind}");
                    element.unreadable.get_or_insert((format!("property {name}"), text));
                }
            },
            (["end_header"], _) => break,
            _ => return problem("header", format!("has the line {:?}, which is not valid PLY", words.join(" "))),
        }
    }
    match ascii {
        Some(ascii) => Ok(Header { ascii, elements, antialias, end: at }),
        None => problem("format", "is missing from the header"),
    }
}

/// What a comment says of antialiasing: `SplatRenderMode: mip`, as Brush writes it, or `antialiased 1`, as Postshot does;
/// and [`WIDE_COMMENT`].
fn said_antialias(comment: &[&str]) -> Option<Antialiasing> {
    if comment.join(" ") == WIDE_COMMENT {
        return Some(Antialiasing::Wide);
    }
    let text = comment.join(" ").to_lowercase();
    let words: Vec<&str> = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    match words[..] {
        ["splatrendermode", mode] => Some(if mode == "mip" { Antialiasing::Narrow } else { Antialiasing::Off }),
        ["antialiased", "1" | "true"] => Some(Antialiasing::Narrow),
        ["antialiased", _] => Some(Antialiasing::Off),
        _ => None,
    }
}

fn parse(bytes: &[u8]) -> Result<SplatScene, Problem> {
    let header = header(bytes)?;
    let vertices = header.elements.iter().find(|element| element.name == "vertex");
    let Some(vertices) = vertices else {
        return problem("element vertex", "is missing; the file has no Gaussians");
    };
    if vertices.column("packed_position").is_ok() {
        return compressed::parse(bytes, &header);
    }
    if let Some(first) = header.elements.first().filter(|first| first.name != "vertex") {
        return problem("element", format!("{} comes before the vertices; save only the Gaussians", first.name));
    }
    if let Some(unreadable) = &vertices.unreadable {
        return Err(unreadable.clone());
    }
    if vertices.column("scale_1").is_ok() && vertices.column("scale_2").is_err() {
        let text =
            "is missing: this is a scene of flat Gaussians (2DGS), which are not drawn; give one of 3D Gaussians";
        return problem("property scale_2", text);
    }
    let find = |name: &str| vertices.column(name);
    let rest = vertices.properties.iter().filter(|(name, _)| name.starts_with("f_rest_")).count();
    let degree = degree_of(rest)?;
    // The column of each row of the table. Files order the harmonics by channel, the table by basis function.
    let named = |names: &[&str]| names.iter().map(|name| find(name)).collect::<Result<Vec<_>, _>>();
    let mut columns = named(&["x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"])?;
    columns.extend(named(&["opacity", "f_dc_0", "f_dc_1", "f_dc_2"])?);
    for function in 0..rest / 3 {
        for channel in 0..3 {
            columns.push(find(&format!("f_rest_{}", channel * (rest / 3) + function))?);
        }
    }
    let data = bytes.get(header.end..).unwrap_or_default();
    let count = vertices.count;
    let model = SplatModel::trained(degree);
    let table = if header.ascii {
        let numbers = ascii_numbers(data, vertices, &columns)?;
        model.table(count, |row, i| numbers[i * columns.len() + row])
    } else {
        let stride = vertices.stride();
        // Checked before anything is allocated.
        if count.checked_mul(stride).is_none_or(|size| size > data.len()) {
            return truncated(data.len() / stride.max(1), count);
        }
        let offsets: Vec<usize> = columns.iter().map(|column| vertices.offset(*column)).collect();
        let mut table = vec![0.0; columns.len() * count];
        for (i, vertex) in data.chunks_exact(stride).take(count).enumerate() {
            for (row, (column, offset)) in columns.iter().zip(&offsets).enumerate() {
                let kind = vertices.properties[*column].1;
                table[model.index(row, i, count)] = kind.value(&vertex[*offset..offset + kind.size()]);
            }
        }
        table
    };
    Ok(SplatScene { degree, count, table, antialias: header.antialias })
}

/// The logit of an opacity; those of files with bytes are 0 or 1, whose logits are infinite.
fn logit_of(opacity: f64) -> f64 {
    let opacity = opacity.clamp(1.0 - EXPORTED_OPACITY, EXPORTED_OPACITY);
    (opacity / (1.0 - opacity)).ln()
}

/// The harmonic of degree 0 of a colour, a display value.
fn dc_of(color: f64) -> f64 {
    (color - write::GREY) / write::SH_0
}

/// The degree of the harmonics with this many numbers beyond the first function.
fn degree_of(rest: usize) -> Result<u32, Problem> {
    match rest {
        0 => Ok(0),
        9 => Ok(1),
        24 => Ok(2),
        45 => Ok(3),
        other => problem("f_rest_*", format!("has {other} properties; there must be 0, 9, 24 or 45")),
    }
}

fn truncated<T>(there: usize, count: usize) -> Result<T, Problem> {
    problem("data", format!("has {there} of {count} Gaussians; the file is truncated, copy it again"))
}

/// The numbers of these columns, one Gaussian after the other.
fn ascii_numbers(data: &[u8], vertices: &Element, columns: &[usize]) -> Result<Vec<f32>, Problem> {
    let Ok(text) = std::str::from_utf8(data) else { return problem("data", "is not text, but the format is ascii") };
    let mut numbers = Vec::new();
    for (i, line) in text.lines().take(vertices.count).enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        for column in columns {
            match words.get(*column).and_then(|word| word.parse::<f32>().ok()) {
                Some(number) => numbers.push(number),
                None => {
                    let name = &vertices.properties[*column].0;
                    return problem("data", format!("Gaussian {i} has no number for {name}; save the file again"));
                }
            }
        }
    }
    let there = numbers.len() / columns.len();
    if there < vertices.count {
        return truncated(there, vertices.count);
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of two Gaussians of degree 1 with an unused property, and the table expected from it.
    fn file(ascii: bool) -> (Vec<u8>, Vec<f32>) {
        let mut names =
            vec!["x", "y", "z", "nx", "f_dc_0", "f_dc_1", "f_dc_2"].into_iter().map(String::from).collect::<Vec<_>>();
        names.extend((0..9).map(|k| format!("f_rest_{k}")));
        names
            .extend(["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"].map(String::from));
        let format = if ascii { "ascii" } else { "binary_little_endian" };
        let mut bytes = format!("ply\nformat {format} 1.0\ncomment by hand\nelement vertex 2\n").into_bytes();
        for name in &names {
            let kind = if name == "nx" {
                "uchar"
            } else if name == "y" {
                "double"
            } else {
                "float"
            };
            bytes.extend(format!("property {kind} {name}\n").bytes());
        }
        bytes.extend(b"end_header\n");
        let value = |i: usize, column: usize| (100 * i + column) as f32 + 0.5;
        for i in 0..2 {
            for (column, name) in names.iter().enumerate() {
                let v = value(i, column);
                match name.as_str() {
                    _ if ascii => bytes.extend(format!("{v} ").bytes()),
                    "nx" => bytes.push(7),
                    "y" => bytes.extend(f64::from(v).to_le_bytes()),
                    _ => bytes.extend(v.to_le_bytes()),
                }
            }
            if ascii {
                bytes.push(b'\n');
            }
        }
        let column = |name: &str| names.iter().position(|n| n == name).unwrap();
        let mut order = ["x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity"]
            .map(column)
            .to_vec();
        order.extend(["f_dc_0", "f_dc_1", "f_dc_2"].map(column));
        // By basis function: red, green, blue of the first, then of the second.
        order.extend([0, 3, 6, 1, 4, 7, 2, 5, 8].map(|k| column(&format!("f_rest_{k}"))));
        let (rows, harmonics) = order.split_at(11);
        let by_row = rows.iter().flat_map(|column| (0..2).map(|i| value(i, *column)));
        let table = by_row.chain((0..2).flat_map(|i| harmonics.iter().map(move |column| value(i, *column)))).collect();
        (bytes, table)
    }

    #[test]
    fn both_encodings_are_read_with_harmonics_ordered_by_basis_function() {
        for ascii in [false, true] {
            let (bytes, table) = file(ascii);
            assert_eq!(parse(&bytes).unwrap(), SplatScene { degree: 1, count: 2, table, antialias: Antialiasing::Off });
        }
        let scene = parse(&file(false).0).unwrap();
        assert_eq!(scene.table.len(), scene.model().rows() * scene.count);
    }

    #[test]
    fn errors_for_damaged_files_name_the_part() {
        let (bytes, _) = file(false);
        let replaced = |from: &str, to: &str| -> Vec<u8> {
            let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
            [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
        };
        let cases = [
            (replaced("ply\n", "plx\n"), "header"),
            (replaced("binary_little_endian", "binary_big_endian"), "binary_little_endian"),
            (replaced("vertex 2", "vertex 99999999999999"), "of 99999999999999 Gaussians"),
            (replaced("vertex 2", "vertex -2"), "element vertex"),
            (replaced("float opacity", "float opacities"), "property opacity"),
            (replaced("float f_rest_8", "float f_test_8"), "f_rest_*"),
            (replaced("float x", "list uchar int x"), "list"),
            (replaced("float x", "quaternion x"), "quaternion"),
            (replaced("end_header\n", ""), "header"),
            (b"ply\nformat ascii 1.0\nend_header\n".to_vec(), "element vertex"),
        ];
        for (bytes, expected) in cases {
            let (field, text) = parse(&bytes).unwrap_err();
            assert!(format!("{field}: {text}").contains(expected), "wanted {expected:?}, got {field}: {text}");
        }
        for length in 0..bytes.len() {
            assert!(parse(&bytes[..length]).is_err(), "{length} of {} bytes were accepted", bytes.len());
        }
    }
}
