//! What tests of several crates share: hands from a few lengths ([`procedural_hand`]), MANO files ([`mano_files`]), the
//! inputs of the fuzz targets ([`fuzz_corpus`]), files of rigged hands ([`rigged_glb`]), a measure of how deep a posed
//! hand is inside itself ([`self_penetration`]), pictures as they were before ([`golden`]), how many random cases tests
//! try ([`cases`]), which tests are too long for `make test` ([`long`]), and what tests are skipped without: files next to
//! the checkout, in `../shared` ([`shared`]), ffmpeg ([`ffmpeg`]) and Chromium ([`browser`]).
//!
//! Cargo hides the output of `println!` in passing tests. A skipped test therefore writes its line directly to standard
//! error, and appends it to the file in `GHAND_SKIPPED_TESTS`, which `make test` summarises at its end.

pub mod fuzz_corpus;
pub mod golden;
pub mod mano_files;
pub mod procedural_hand;
pub mod self_penetration;

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use ghand_core::HandModel;
use ghand_hand_model::HandModelError;
use ghand_hand_model::files::rigged_glb::RiggedHand;

/// Prefix of every line about a skipped test.
pub const PREFIX: &str = "SKIPPED TEST:";

/// The environment variable with the path of the file of skipped tests.
pub const RECORD: &str = "GHAND_SKIPPED_TESTS";

/// The environment variable that chooses the long counts of random cases, and the long tests.
pub const LONG: &str = "GHAND_LONG_TESTS";

/// What a test that is left out for its length needs.
const LATER: &str = "make test-long";

/// How many random cases a test tries: `long` with [`LONG`], else `usual`.
pub fn cases<N>(usual: N, long: N) -> N {
    if std::env::var_os(LONG).is_some() { long } else { usual }
}

/// Whether long tests are run, as with [`LONG`]. If not, this function reports the test as left to `make test-long`, and
/// the calling test must return.
pub fn long() -> bool {
    let is_chosen = std::env::var_os(LONG).is_some();
    if !is_chosen {
        skip(LATER, std::env::var_os(RECORD).as_deref().map(Path::new));
    }
    is_chosen
}

/// The file or folder of this name in `../shared`, if it exists. If not, this function reports the test as skipped, and
/// the calling test must return.
pub fn shared(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    find(&folder, name, std::env::var_os(RECORD).as_deref().map(Path::new))
}

/// Whether ffmpeg is installed. If not, this function reports the test as skipped, and the calling test must return.
pub fn ffmpeg() -> bool {
    let version = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    let installed = version.is_ok_and(|status| status.success());
    if !installed {
        skip("ffmpeg", std::env::var_os(RECORD).as_deref().map(Path::new));
    }
    installed
}

/// The program of a Chromium that draws with WebGPU without a GPU. If there is none, this function reports the test as
/// skipped, and the calling test must return.
pub fn browser() -> Option<&'static str> {
    let answers = |name: &&str| {
        let version = Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        version.is_ok_and(|status| status.success())
    };
    let found = ["chromium", "chromium-browser", "google-chrome"].into_iter().find(answers);
    if found.is_none() {
        skip("chromium", std::env::var_os(RECORD).as_deref().map(Path::new));
    }
    found
}

fn find(folder: &Path, name: &str, record: Option<&Path>) -> Option<PathBuf> {
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    skip(&format!("shared/{name}"), record);
    None
}

/// The bytes of a GLB file with the model at rest.
///
/// # Errors
/// As for [`RiggedHand::document`].
pub fn rigged_glb(model: &HandModel) -> Result<Vec<u8>, HandModelError> {
    RiggedHand::default().document(model)?.finish()
}

/// Reports that the running test needs something that is missing.
fn skip(needs: &str, record: Option<&Path>) {
    let thread = std::thread::current();
    let line = format!("{PREFIX} {} needs {needs}\n", thread.name().unwrap_or("a test"));
    // If standard error is closed, only this notice is lost.
    let _ = io::stderr().write_all(line.as_bytes());
    if let Some(record) = record
        && let Err(error) = append(record, &line)
    {
        panic!("{RECORD}={}: cannot record a skipped test: {error}", record.display());
    }
}

/// Appends a line in one write, since several test programs do this at the same time.
fn append(path: &Path, line: &str) -> io::Result<()> {
    OpenOptions::new().create(true).append(true).open(path)?.write_all(line.as_bytes())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn a_missing_file_is_recorded_on_one_line_and_an_existing_one_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let record = folder.path().join("skipped");
        std::fs::write(folder.path().join("there"), b"").unwrap();
        assert_eq!(find(folder.path(), "there", Some(&record)), Some(folder.path().join("there")));
        assert!(!record.exists());
        assert_eq!(find(folder.path(), "captures/a", Some(&record)), None);
        assert_eq!(find(folder.path(), "assets/b", Some(&record)), None);
        assert_eq!(find(folder.path(), "no/record", None), None);
        let lines = std::fs::read_to_string(record).unwrap();
        let lines: Vec<&str> = lines.lines().collect();
        assert!(lines.iter().all(|line| line.starts_with(PREFIX)), "{lines:?}");
        assert!(lines[0].ends_with("needs shared/captures/a") && lines[1].ends_with("needs shared/assets/b"));
        assert_eq!(lines.len(), 2);
    }
}
