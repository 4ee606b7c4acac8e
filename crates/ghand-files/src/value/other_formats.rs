//! Formats that are not read, named with the line that converts them.

/// What a file of another format is and what to do; `None` if its format is unknown.
pub(super) fn problem(bytes: &[u8]) -> Option<String> {
    if bytes.trim_ascii().is_empty() {
        return Some("is empty; write or download the file again".into());
    }
    let what = by_first_bytes(bytes).or_else(|| by_text(bytes))?;
    Some(what.into())
}

const UTF_16: &str = "is text in UTF-16; save it in UTF-8 (open(\"IN\", encoding=\"utf-16\") reads it in Python)";

/// First bytes of files, with what they are and a remedy.
const FIRST_BYTES: [(&[u8], &str); 38] = [
    (b"\xff\xfe", UTF_16),
    (b"\xfe\xff", UTF_16),
    (b"version https://git-lfs", "is a pointer of Git LFS and not the data; fetch it with `git lfs pull`"),
    (b"MATLAB 5.0 MAT-file", MATLAB),
    (b"MATLAB 7", HDF5_OF_MATLAB),
    (b"\x89HDF\r\n\x1a\n", HDF5),
    (b"Kaydara FBX Binary", SCENE),
    (b"; FBX", SCENE),
    (b"HIERARCHY", BVH),
    (b"PXR-USDC", SCENE),
    (b"#usda", SCENE),
    (b"glTF", GLTF),
    (b"PAR1", TABLE),
    (b"ARROW1", TABLE),
    (b"FEA1", TABLE),
    (b"#ROSBAG", BAG),
    (b"\x89MCAP0\r\n", BAG),
    (
        b"SQLite format 3\0",
        "is an SQLite database, as ROS 2 records; read its messages in Python and write them with numpy.savez",
    ),
    (b"\x89PNG\r\n", IMAGE),
    (b"\xff\xd8\xff", IMAGE),
    (b"GIF8", IMAGE),
    (b"II*\0", IMAGE),
    (b"MM\0*", IMAGE),
    (b"\x76\x2f\x31\x01", IMAGE),
    (b"8BPS", IMAGE),
    (b"BM", BITMAP),
    (
        b"RIFF",
        "is a video, an image or sound (RIFF); run a hand tracker on its pictures and give what it finds, as docs/poses.md lists",
    ),
    (b"\x1a\x45\xdf\xa3", VIDEO),
    (b"ply\n", MESH),
    (b"ply\r\n", MESH),
    (b"%PDF", "is a PDF document; give a file with poses, as docs/poses.md lists"),
    (b"\x7fELF", "is a program; give a file with poses, as docs/poses.md lists"),
    (b"7z\xbc\xaf\x27\x1c", ARCHIVE),
    (b"Rar!", ARCHIVE),
    (b"<!DOCTYPE html", PAGE),
    (b"<!doctype html", PAGE),
    (b"<html", PAGE),
    (b"<", "is XML; read it in Python (xml.etree.ElementTree) and write the poses as JSON"),
];

const MATLAB: &str = "is a MATLAB file; convert it: `import numpy, scipy.io; numpy.savez(\"poses.npz\", **{k: v for k, v in \
                      scipy.io.loadmat(\"IN\").items() if not k.startswith(\"__\")})`";
const HDF5_OF_MATLAB: &str = "is a MATLAB 7.3 file, which is HDF5; convert it: `import numpy, h5py; f = h5py.File(\"IN\"); \
                              numpy.savez(\"poses.npz\", **{k: f[k][()].T for k in f if k[0] != \"#\"})`";
const HDF5: &str = "is an HDF5 file; convert it: `import numpy, h5py; f = h5py.File(\"IN\"); numpy.savez(\"poses.npz\", \
                    **{k: f[k][()] for k in f if isinstance(f[k], h5py.Dataset)})`";
const SCENE: &str = "is a scene of an animation program (FBX or USD), whose animation is not read; open it in Blender and \
                     write the rotations of its hand's bones as JSON, or those of a tracker, as docs/poses.md lists";
const BVH: &str = "is a BVH file, a motion of a whole skeleton, which is not read; open it in Blender and write the \
                   rotations of its hand's bones as JSON, as docs/poses.md lists";
const GLTF: &str = "is a glTF scene, which is read as a hand model (--hand-model) and not for poses; write the rotations of \
                    its bones as JSON, as docs/poses.md lists";
const TABLE: &str = "is a table (Parquet or Arrow); convert it: `import numpy, pandas; numpy.savez(\"poses.npz\", \
                     **{k: numpy.stack(v) for k, v in pandas.read_parquet(\"IN\").items()})` (read_feather for Arrow)";
const BAG: &str = "is a recording of ROS (a bag or MCAP); read its messages in Python (rosbags or mcap) and write the poses \
                   with numpy.savez";
const IMAGE: &str = "is an image and has no poses; run a hand tracker on it (MediaPipe, HaMeR, WiLoR) and give what it finds, \
                     as docs/poses.md lists";
const BITMAP: &str = IMAGE;
const VIDEO: &str = "is a video and has no poses; run a hand tracker on it (MediaPipe, HaWoR, Dyn-HaMR) and give what it \
                     finds, as docs/poses.md lists";
const MESH: &str = "is a mesh (PLY) and has no poses; give rotations or landmarks, as docs/poses.md lists";
const ARCHIVE: &str = "is an archive; unpack it and give the file with the poses";
const PAGE: &str = "is a web page, as servers send in place of a file that needs a login; download the file again";

fn by_first_bytes(bytes: &[u8]) -> Option<&'static str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let at = |from: usize, magic: &[u8]| bytes.get(from..).is_some_and(|rest| rest.starts_with(magic));
    if at(4, b"ftyp") {
        let is_image = ["heic", "heix", "mif1", "avif"].iter().any(|brand| at(8, brand.as_bytes()));
        return Some(if is_image { IMAGE } else { VIDEO });
    }
    if at(257, b"ustar") {
        return Some(ARCHIVE);
    }
    if is_safetensors(bytes) {
        return Some(
            "is a safetensors file; convert it: `import numpy; from safetensors.numpy import load_file; \
             numpy.savez(\"poses.npz\", **load_file(\"IN\"))`",
        );
    }
    if is_message_pack(bytes) {
        return Some(
            "is MessagePack; convert it: `import json, msgpack; json.dump(msgpack.load(open(\"IN\", \"rb\")), \
             open(\"poses.json\", \"w\"))`",
        );
    }
    FIRST_BYTES
        .iter()
        .find(|(magic, what)| at(0, magic) && (*what != BITMAP || is_bitmap(bytes)))
        .map(|(_, what)| *what)
}

/// Whether the size that a bitmap's header gives is that of the file; text may begin with BM.
fn is_bitmap(bytes: &[u8]) -> bool {
    let size = bytes.get(2..6).and_then(|size| <[u8; 4]>::try_from(size).ok()).map(u32::from_le_bytes);
    !bytes.starts_with(b"BM") || size.is_some_and(|size| size as usize == bytes.len())
}

/// Whether the bytes begin with the length of a JSON object, and with that object.
fn is_safetensors(bytes: &[u8]) -> bool {
    let Some((length, rest)) = bytes.split_first_chunk::<8>() else { return false };
    let length = u64::from_le_bytes(*length);
    rest.first() == Some(&b'{') && length >= 2 && length <= rest.len() as u64
}

/// Whether the bytes begin with a map whose first key is a short word. A pickle begins with other bytes.
fn is_message_pack(bytes: &[u8]) -> bool {
    let rest = match bytes {
        [0x81..=0x8f, rest @ ..] | [0xde, _, _, rest @ ..] | [0xdf, _, _, _, _, rest @ ..] => rest,
        _ => return false,
    };
    let Some((length, key)) = (match rest {
        [length @ 0xa1..=0xbf, key @ ..] => Some((usize::from(length - 0xa0), key)),
        [0xd9, length, key @ ..] => Some((usize::from(*length), key)),
        _ => None,
    }) else {
        return false;
    };
    let is_word = |byte: &u8| byte.is_ascii_graphic() || *byte == b' ';
    key.get(..length).is_some_and(|key| key.iter().all(is_word))
}

/// Formats of text, from the first lines with content.
fn by_text(bytes: &[u8]) -> Option<&'static str> {
    let head = bytes.get(..bytes.len().min(4096)).unwrap_or_default();
    let bare = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    // The head may end within a character.
    let text = match std::str::from_utf8(bare) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => std::str::from_utf8(bare.get(..error.valid_up_to())?).ok()?,
        Err(_) => return None,
    };
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    let first = lines.next()?;
    let second = lines.next();
    if is_row_of_numbers(first) || second.is_some_and(|second| is_row_of_numbers(second) && columns(first) > 1) {
        return Some(if columns(first) > 1 && first.contains([',', ';', '\t']) { CSV } else { NUMBERS });
    }
    let is_key = |key: &str| {
        let is_part = |c: char| c.is_alphanumeric() || "_-. \"'".contains(c);
        !key.is_empty() && key.chars().all(is_part)
    };
    let is_yaml = first == "---"
        || first.starts_with("- ")
        || first.starts_with("%YAML")
        || first.split_once(':').is_some_and(|(key, rest)| is_key(key) && (rest.is_empty() || rest.starts_with(' ')));
    if is_yaml {
        return Some(YAML);
    }
    let has_number = |line: &str| line.split([',', ';', '\t']).any(|field| field.trim().parse::<f64>().is_ok());
    let is_table = second.is_some_and(|second| columns(second) == columns(first) && has_number(second));
    (columns(first) > 1 && is_table).then_some(CSV)
}

const CSV: &str = "is a table in text (CSV); convert it: `import json, pandas; pandas.read_csv(\"IN\").to_json(\"poses.json\", \
                   orient=\"records\")`, and give the numbers of each frame one of the names that docs/poses.md lists";
const NUMBERS: &str = "is rows of numbers in text; convert it: `import numpy; numpy.save(\"poses.npy\", \
                       numpy.loadtxt(\"IN\"))`, with one of the shapes that docs/poses.md lists";
const YAML: &str = "is YAML; convert it: `import json, yaml; json.dump(yaml.safe_load(open(\"IN\")), \
                    open(\"poses.json\", \"w\"))`";

/// Number of fields between commas, semicolons or tabs.
fn columns(line: &str) -> usize {
    [',', ';', '\t'].iter().map(|mark| line.split(*mark).count()).max().unwrap_or(1)
}

/// Whether a line has numbers and nothing else.
fn is_row_of_numbers(line: &str) -> bool {
    let mut fields = line.split([',', ';', '\t', ' ']).filter(|field| !field.is_empty()).peekable();
    fields.peek().is_some() && fields.all(|field| field.parse::<f64>().is_ok())
}
