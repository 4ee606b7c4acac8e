//! The folder that is written.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use ghand_files::atomic_file::write_atomically;
use image::RgbImage;
use serde::Serialize;

use super::figures::Figures;
use super::page::{Section, framed};
use crate::pictures::write_png;

/// Name of the file that every run writes last.
const REPORT: &str = "explain.json";
const SHEET: &str = "explain.png";
const COEFFICIENTS: [&str; 2] = ["coefficients.json", "coefficients.csv"];

/// A folder that may be written.
pub struct OutputFolder {
    path: PathBuf,
    force: bool,
}

/// `explain.json`.
#[derive(Serialize)]
struct Report<'a> {
    avatar: String,
    #[serde(flatten)]
    figures: &'a Figures,
    pictures: Vec<&'a str>,
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
        let folder = OutputFolder { path: path.into(), force };
        folder.check_absent([REPORT, SHEET].into_iter().chain(COEFFICIENTS))?;
        Ok(folder)
    }

    fn check_absent<'a>(&self, mut names: impl Iterator<Item = &'a str>) -> anyhow::Result<()> {
        match names.find(|name| self.path.join(name).exists()).filter(|_| !self.force) {
            Some(name) => bail!(
                "{}: exists already; choose another --out, or replace it with --force",
                self.path.join(name).display()
            ),
            None => Ok(()),
        }
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
        self.check_absent(single.iter().map(|figure| figure.file.as_str()))?;
        std::fs::create_dir_all(&self.path)
            .with_context(|| format!("{}: cannot create the folder", self.path.display()))?;
        for figure in &single {
            write_png(&self.path.join(&figure.file), &framed(&figure.picture))?;
        }
        write_png(&self.path.join(SHEET), sheet)?;
        let [json, csv] = COEFFICIENTS;
        self.write_text(json, &serde_json::to_string_pretty(&figures.coefficients)?)?;
        self.write_text(csv, &coefficients_csv(figures))?;
        let pictures = single.iter().map(|figure| figure.file.as_str()).collect();
        let report = Report { avatar: avatar.display().to_string(), figures, pictures };
        self.write_text(REPORT, &serde_json::to_string_pretty(&report)?)?;
        Ok(single.len())
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
