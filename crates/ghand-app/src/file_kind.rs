//! The kind of a file, recognised from its contents.

use std::io::Read;
use std::path::Path;

use ghand_avatar::gaussian_glb::holds_avatar;
use ghand_files::input_file;
use ghand_hand_model::files::read::file_and_side;

/// Kinds of files that commands distinguish before reading them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// An avatar: `.ghand`, or a `.glb` that has one.
    Avatar,
    /// A scene of Gaussians: `.ply`, `.spz` or `.splat`, or one in a format that is not read.
    Scene,
    /// A hand model: `.glb`, `.gltf`, or MANO's `.pkl` and `.npz`.
    HandModel,
    /// Anything else.
    Other,
}

/// Longest JSON header of a safetensors file, bytes; the format's own bound.
const LARGEST_HEADER: u64 = 100_000_000;

/// First bytes of binary glTF, of an archive of arrays, and of pickles of the protocols 2 to 5.
const HAND_MODEL_STARTS: [&[u8]; 6] = [b"glTF", b"PK\x03\x04", b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"];

/// The kind of a file from its first bytes, or from its name if these are not conclusive. `FILE:left` is a hand of a file.
pub fn file_kind(path: &Path) -> FileKind {
    let (path, _) = file_and_side(path);
    let mut start = Vec::new();
    // A safetensors file begins with the length of its JSON header, little-endian, and the header.
    let read = input_file::open(&path).and_then(|file| file.take(9).read_to_end(&mut start));
    let header = start.first_chunk::<8>().map(|length| u64::from_le_bytes(*length));
    let is_safetensors =
        header.is_some_and(|length| (2..=LARGEST_HEADER).contains(&length)) && start.get(8) == Some(&b'{');
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        _ if read.is_ok() && is_safetensors => FileKind::Avatar,
        _ if read.is_ok() && start.starts_with(b"glTF") && input_file::open(&path).is_ok_and(holds_avatar) => {
            FileKind::Avatar
        }
        _ if read.is_ok() && start.starts_with(b"ply") => FileKind::Scene,
        // An archive, like some hand models.
        Some("sog") => FileKind::Scene,
        _ if read.is_ok() && HAND_MODEL_STARTS.iter().any(|mark| start.starts_with(mark)) => FileKind::HandModel,
        Some("ghand") => FileKind::Avatar,
        Some("ply" | "spz" | "splat" | "ksplat" | "lcc") => FileKind::Scene,
        Some("glb" | "gltf" | "pkl" | "npz") => FileKind::HandModel,
        _ => FileKind::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_recognised_from_their_first_bytes_or_else_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let kind = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            file_kind(&path)
        };
        let tensors = [&40u64.to_le_bytes()[..], b"{\"__metadata__\":{}}"].concat();
        assert_eq!(kind("a.bin", &tensors), FileKind::Avatar);
        assert_eq!(kind("a.bin", b"ply\nformat ascii 1.0\n"), FileKind::Scene);
        assert_eq!(kind("a.bin", b"\x80\x02}q\x00(X"), FileKind::HandModel);
        assert_eq!(kind("a.bin", b"{\"frames\":[{}]}"), FileKind::Other);
        assert_eq!(kind("avatar.ghand", b"ply\r\nformat"), FileKind::Scene);
        assert_eq!(kind("a.bin", b"glTF\x02\0\0\0\0"), FileKind::HandModel);
        // A file with a broken beginning is left to the reader for its name.
        assert_eq!(kind("e.pkl", b"(dp1\n"), FileKind::HandModel);
        assert_eq!(kind("hand.obj", b"v 0 0 0\nv "), FileKind::Other);
        assert_eq!(kind("a.sog", b"PK\x03\x04abcdef"), FileKind::Scene);
        assert_eq!((kind("a.SPZ", b"\x1f\x8babcdefgh"), kind("b.splat", &[0; 32])), (FileKind::Scene, FileKind::Scene));
        assert_eq!((kind("a.ghand", b""), kind("a.PLY", b"cut")), (FileKind::Avatar, FileKind::Scene));
        assert_eq!(file_kind(&folder.path().join("absent.glb")), FileKind::HandModel);
        assert_eq!(file_kind(&folder.path().join("absent.txt")), FileKind::Other);
    }
}
