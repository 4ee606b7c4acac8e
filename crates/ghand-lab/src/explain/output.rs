//! The folder that is written.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use ghand_files::atomic_file::write_atomically;
use ghand_files::claim::Claim;
use ghand_pictures::write_png;
use image::RgbImage;
use serde::Serialize;

use super::figures::Figures;
use super::page::{Section, framed};

/// Name of the file that every run writes last.
const REPORT: &str = "explain.json";
const SHEET: &str = "explain.png";

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
            check_absent(path, [REPORT, SHEET].into_iter())?;
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
        let pictures: Vec<_> = single.iter().map(|figure| figure.file.as_str()).collect();
        let report = Report { avatar: avatar.display().to_string(), figures, pictures };
        let path = self.path.join(REPORT);
        write_atomically(&path, serde_json::to_string_pretty(&report)?.as_bytes())
            .with_context(|| format!("{}: cannot write", path.display()))?;
        Ok(single.len())
    }
}
