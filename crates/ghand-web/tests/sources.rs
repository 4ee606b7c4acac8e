//! Whether the player in `web/dist/` was built from the sources that are here. `make web` builds it anew.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// The crates in the player.
const CRATES: [&str; 8] = ["core", "files", "hand-model", "capture", "render", "motion", "avatar", "web"];

/// All files in a folder and below with one of these endings.
fn files_in(folder: &Path, endings: &[&str], found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() {
            // Tests are not in the player.
            if name != "tests" && name != "dist" {
                files_in(&path, endings, found);
            }
        } else if endings.iter().any(|ending| name.ends_with(ending)) && name != "tests.rs" {
            found.push(path);
        }
    }
}

/// The hash of the sources: of each file's name and content, in the order of the names, without carriage returns.
fn hash(root: &Path) -> String {
    let mut files = Vec::new();
    for name in CRATES {
        let folder = root.join(format!("crates/ghand-{name}"));
        files.push(folder.join("Cargo.toml"));
        files_in(&folder.join("src"), &[".rs"], &mut files);
    }
    files.push(root.join("crates/ghand-render/build.rs"));
    files.push(root.join("scripts/build_web.sh"));
    files_in(&root.join("shaders"), &[".wgsl"], &mut files);
    files_in(&root.join("web"), &[".js", ".ts"], &mut files);
    let mut named: Vec<(String, PathBuf)> = files
        .into_iter()
        .map(|path| (path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/"), path))
        .collect();
    named.sort();
    let mut hash = Sha256::new();
    for (name, path) in named {
        let content: Vec<u8> = std::fs::read(path).unwrap().into_iter().filter(|byte| *byte != b'\r').collect();
        hash.update(name.as_bytes());
        hash.update([0]);
        hash.update((content.len() as u64).to_le_bytes());
        hash.update(&content);
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn the_player_was_built_from_these_sources() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let kept = root.join("web/dist/sources.sha256");
    let hash = hash(&root);
    if std::env::var_os("GHAND_PLAYER_IS_NEW").is_some() {
        std::fs::write(&kept, format!("{hash}\n")).unwrap();
    }
    let before = std::fs::read_to_string(&kept).unwrap_or_default();
    assert!(before.trim() == hash, "web/dist was built from other sources; run `make web` and commit web/dist");
}
