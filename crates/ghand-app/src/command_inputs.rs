//! What a command reads, which none of its outputs may replace.

use std::path::{Path, PathBuf};

use anyhow::bail;

/// What says of a folder that it is a capture.
const CAPTURE_FILE: &str = "capture.json";
/// Endings of files beside it.
const DATA_ENDINGS: [&str; 6] = ["json", "glb", "gltf", "bin", "pkl", "npz"];

/// The files and captures that a command reads.
#[derive(Debug, Clone, Default)]
pub struct CommandInputs(Vec<PathBuf>);

impl CommandInputs {
    /// Adds files, or folders of captures. What does not exist, such as the name of a pose, is no file.
    #[must_use]
    pub fn and<P: AsRef<Path>>(mut self, paths: impl IntoIterator<Item = P>) -> CommandInputs {
        self.0.extend(paths.into_iter().map(|path| path.as_ref().to_path_buf()));
        self
    }

    /// Fails if an output is one of them, by whatever name, or exists and may be a part of a capture among them.
    ///
    /// # Errors
    /// One sentence that names the option and the file.
    pub fn refuse(&self, option: &str, output: &Path) -> anyhow::Result<()> {
        let shown = output.display();
        if let Some(input) = self.0.iter().find(|input| is_same(input, output)) {
            bail!("{option} {shown}: is {}, which this command reads; give another name", input.display());
        }
        let output = output.exists().then(|| std::fs::canonicalize(output).ok()).flatten();
        let inside = |folder: &&PathBuf| output.as_ref().is_some_and(|output| may_be_part(output, folder));
        let folders: Vec<PathBuf> = self.0.iter().filter_map(|input| capture_folder(input)).collect();
        match folders.iter().find(inside) {
            Some(folder) => bail!(
                "{option} {shown}: exists in {}, a folder that this command reads; give another name",
                folder.display()
            ),
            None => Ok(()),
        }
    }
}

/// Fails if a command would write its results into the folder of the capture that it reads.
///
/// # Errors
/// One sentence that names the option and the folder.
pub fn refuse_capture_folder(option: &str, output: &Path, capture: &Path) -> anyhow::Result<()> {
    let folder = if capture.is_dir() { Some(capture) } else { capture.parent() };
    let folder = folder.map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    if folder.is_some_and(|folder| is_same(folder, output)) {
        bail!("{option} {}: is the folder of the capture that is read; give another, or --force", output.display());
    }
    Ok(())
}

/// Whether two names are of one file or folder. Pipes and devices are not looked at: opening them may wait.
fn is_same(a: &Path, b: &Path) -> bool {
    let is_plain = |path: &Path| path.metadata().is_ok_and(|found| found.is_file() || found.is_dir());
    is_plain(a) && is_plain(b) && same_file::is_same_file(a, b).unwrap_or(false)
}

/// Whether a file may be a part of the capture in a folder: it is in a folder of it, like images, or has the ending of data.
fn may_be_part(file: &Path, folder: &Path) -> bool {
    let Ok(inside) = file.strip_prefix(folder) else { return false };
    let ending = inside.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    inside.components().count() > 1 || DATA_ENDINGS.contains(&ending.as_str())
}

/// The folder of a capture, in full.
fn capture_folder(path: &Path) -> Option<PathBuf> {
    let is_file = path.file_name().is_some_and(|name| name == CAPTURE_FILE);
    let folder = if is_file { path.parent()? } else { path };
    let full = std::fs::canonicalize(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }).ok()?;
    full.is_dir().then_some(full)
}

/// The file of a camera `FILE` or `FILE:ID`.
pub fn camera_file(name: &Path) -> PathBuf {
    let Some(text) = name.to_str().filter(|_| !name.exists()) else { return name.into() };
    let cuts = text.rmatch_indices(':').map(|(at, _)| Path::new(&text[..at]));
    cuts.into_iter().find(|path| path.exists()).unwrap_or(name).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_found_by_any_of_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.ghand"), "x").unwrap();
        std::fs::write(at("b.ghand"), "x").unwrap();
        std::fs::create_dir(at("sub")).unwrap();
        let inputs = CommandInputs::default().and([at("a.ghand"), at("rest")]);
        let mut same = vec![at("a.ghand"), at("sub/../a.ghand"), at("./a.ghand")];
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(at("a.ghand"), at("link")).unwrap();
            same.push(at("link"));
        }
        std::fs::hard_link(at("a.ghand"), at("hard")).unwrap();
        same.push(at("hard"));
        for output in same {
            let error = inputs.refuse("--out", &output).unwrap_err().to_string();
            assert!(error.starts_with("--out ") && error.contains("a.ghand, which"), "{error}");
        }
        for output in ["b.ghand", "new.ghand", "rest", "sub/a.ghand"] {
            inputs.refuse("--out", &at(output)).unwrap();
        }
    }

    #[test]
    fn what_is_in_a_capture_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("S/images")).unwrap();
        for name in ["S/capture.json", "S/images/0.png", "other.png"] {
            std::fs::write(at(name), "x").unwrap();
        }
        for capture in ["S", "S/capture.json"] {
            let inputs = CommandInputs::default().and([at(capture)]);
            for output in ["S/capture.json", "S/images/0.png"] {
                assert!(inputs.refuse("--sheet", &at(output)).is_err(), "{capture} {output}");
            }
            inputs.refuse("--sheet", &at("S/new.png")).unwrap();
            std::fs::write(at("S/sheet.png"), "x").unwrap();
            inputs.refuse("--sheet", &at("S/sheet.png")).unwrap();
            inputs.refuse("--sheet", &at("other.png")).unwrap();
            assert!(refuse_capture_folder("--out", &at("S/images/.."), &at(capture)).is_err());
            refuse_capture_folder("--out", &at("S/run"), &at(capture)).unwrap();
        }
    }

    #[test]
    fn a_camera_of_a_capture_is_in_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("c:d.json");
        std::fs::write(&file, "x").unwrap();
        let with_id = PathBuf::from(format!("{}:cam:0", file.display()));
        assert_eq!((camera_file(&file), camera_file(&with_id)), (file.clone(), file));
    }
}
