//! The folder that is written.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use ghand_files::atomic_file::write_atomically;
use ghand_files::claim::Claim;
use ghand_files::input_file;
use ghand_pictures::write_png;
use image::RgbImage;
use serde::{Deserialize, Serialize};

use super::figures::Figures;
use super::page::{Section, framed};

/// Name of the file that every run writes last.
const REPORT: &str = "explain.json";
const SHEET: &str = "explain.png";
/// Largest `explain.json`, bytes.
const LARGEST_REPORT: u64 = 16 << 20;
const COEFFICIENTS: [&str; 2] = ["coefficients.json", "coefficients.csv"];

/// A folder that may be written.
pub struct OutputFolder {
    path: PathBuf,
    force: bool,
    _claim: Claim,
}

/// `explain.json`.
#[derive(Serialize)]
struct Report<'a> {
    avatar: String,
    #[serde(flatten)]
    figures: &'a Figures,
    pictures: Vec<&'a str>,
}

/// What counts of an earlier run's `explain.json`.
#[derive(Deserialize)]
struct Earlier {
    pictures: Vec<String>,
}

fn check_absent<'a>(folder: &Path, mut names: impl Iterator<Item = &'a str>) -> anyhow::Result<()> {
    match names.find(|name| folder.join(name).exists()) {
        Some(name) => {
            bail!("{}: exists already; choose another --out, or replace it with --force", folder.join(name).display())
        }
        None => Ok(()),
    }
}

impl OutputFolder {
    /// Checks a folder before anything is computed. With `force`, files of the same names may be replaced.
    ///
    /// # Errors
    /// An error if it is a file, or has results without `force`.
    pub fn check(path: &Path, force: bool) -> anyhow::Result<OutputFolder> {
        if path.exists() && !path.is_dir() {
            bail!("--out {}: is not a folder", path.display());
        }
        if !force {
            check_absent(path, [REPORT, SHEET].into_iter().chain(COEFFICIENTS))?;
        }
        Ok(OutputFolder { path: path.into(), force, _claim: Claim::folder(path)? })
    }

    /// Writes everything; returns the number of single pictures.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn write(
        &self,
        avatar: &Path,
        figures: &Figures,
        sections: &[Section],
        sheet: &RgbImage,
    ) -> anyhow::Result<usize> {
        let single: Vec<_> = sections.iter().flat_map(|section| &section.figures).collect();
        if !self.force {
            check_absent(&self.path, single.iter().map(|figure| figure.file.as_str()))?;
        }
        std::fs::create_dir_all(&self.path)
            .with_context(|| format!("{}: cannot create the folder", self.path.display()))?;
        for figure in &single {
            write_png(&self.path.join(&figure.file), &framed(&figure.picture))?;
        }
        write_png(&self.path.join(SHEET), sheet)?;
        let [json, csv] = COEFFICIENTS;
        self.write_text(json, &serde_json::to_string_pretty(&figures.coefficients)?)?;
        self.write_text(csv, &coefficients_csv(figures))?;
        let pictures: Vec<_> = single.iter().map(|figure| figure.file.as_str()).collect();
        self.remove_others(&pictures);
        let report = Report { avatar: avatar.display().to_string(), figures, pictures };
        self.write_text(REPORT, &serde_json::to_string_pretty(&report)?)?;
        Ok(single.len())
    }

    /// Removes pictures of an earlier run, of an avatar that had more, which its report names.
    fn remove_others(&self, pictures: &[&str]) {
        let Ok(Some(report)) = input_file::read(&self.path.join(REPORT), LARGEST_REPORT) else { return };
        let Ok(Earlier { pictures: earlier }) = serde_json::from_slice(&report) else { return };
        let is_picture = |name: &&String| {
            let path = Path::new(name);
            path.file_name() == Some(path.as_os_str()) && path.extension().is_some_and(|e| e == "png")
        };
        for name in earlier.iter().filter(is_picture).filter(|name| !pictures.contains(&name.as_str())) {
            let path = self.path.join(name);
            if let Err(error) = std::fs::remove_file(&path) {
                log::debug!("{}: {error}", path.display());
            }
        }
    }

    fn write_text(&self, name: &str, text: &str) -> anyhow::Result<()> {
        let path = self.path.join(name);
        write_atomically(&path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))
    }
}

/// The coefficients as a table; ids are quoted, since they may have commas.
fn coefficients_csv(figures: &Figures) -> String {
    let mut text = String::from("basis,pose,mean,standard_deviation,min,max\n");
    for c in &figures.coefficients {
        let id = c.pose.replace('"', "\"\"");
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},\"{id}\",{},{},{},{}", c.basis, c.mean, c.standard_deviation, c.min, c.max);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_an_earlier_run_go_and_other_files_stay() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("explain");
        std::fs::create_dir(&path).unwrap();
        let report = r#"{"avatar": "a.ghand", "pictures": ["basis_1.png", "basis_2.png", "../mine.png", "notes.txt"]}"#;
        std::fs::write(path.join(REPORT), report).unwrap();
        let files = ["basis_1.png", "basis_2.png", "../mine.png", "notes.txt", "other.png"].map(|name| path.join(name));
        files.iter().for_each(|file| std::fs::write(file, "").unwrap());
        OutputFolder::check(&path, true).unwrap().remove_others(&["basis_1.png"]);
        assert_eq!(files.map(|file| file.exists()), [true, false, true, true, true]);
        assert!(OutputFolder::check(&path, false).is_err());
    }
}
