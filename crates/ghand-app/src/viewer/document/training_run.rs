//! A run of `train` that the viewer shows, while it goes on and after it: the newest avatar in its folder, and the files
//! that say how it goes.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use egui::{ColorImage, Context, Image, RichText, TextureHandle, TextureOptions, Ui, vec2};

use crate::run_files::{AVATAR_FILE, CHECKPOINTS, CURVES_TABLE, METRICS_FILE, PREVIEW, PREVIEW_AVATAR};
use crate::viewer::widgets::curve_plot::curve_plot;

/// Seconds between two looks at the files.
const INTERVAL_SECS: f64 = 1.0;
/// Largest table of curves that is read, bytes: a point every 25 iterations has about 40.
const LARGEST_TABLE: u64 = 16 << 20;

/// A row of the table of curves.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    iteration: f64,
    stage: f64,
    seconds: f64,
    l1: Option<f64>,
    held_out_psnr: Option<f64>,
}

/// A run's folder.
pub struct TrainingRun {
    folder: PathBuf,
    rows: Vec<Row>,
    /// Images held out above the avatar.
    pictures: Option<TextureHandle>,
    is_going_on: bool,
    /// When the table and the pictures that were read were written.
    read: [Option<SystemTime>; 2],
    /// When the next look is due, in the user interface's seconds.
    next_look: f64,
}

impl TrainingRun {
    /// The run in a folder; `None` if it is not the folder of a run with an avatar.
    pub fn open(folder: &Path) -> Option<TrainingRun> {
        newest_avatar(folder)?;
        let rows = Vec::new();
        let is_going_on = is_going_on(folder);
        Some(TrainingRun { folder: folder.into(), rows, pictures: None, is_going_on, read: [None; 2], next_look: 0.0 })
    }

    /// Its newest avatar.
    pub fn avatar(&self) -> Option<PathBuf> {
        newest_avatar(&self.folder)
    }

    /// Whether it has no result yet.
    pub fn is_going_on(&self) -> bool {
        self.is_going_on
    }

    /// Reads what has changed since the last look. Returns whether it looked.
    pub fn look(&mut self, context: &Context) -> bool {
        let now = context.input(|input| input.time);
        if now < self.next_look {
            return false;
        }
        self.next_look = now + INTERVAL_SECS;
        self.is_going_on = is_going_on(&self.folder);
        let [table, pictures] = [CURVES_TABLE, PREVIEW].map(|name| newest(&self.folder, name));
        if let Some((written, path)) = table.filter(|(written, _)| Some(*written) != self.read[0]) {
            self.read[0] = Some(written);
            let is_small = path.metadata().is_ok_and(|metadata| metadata.len() <= LARGEST_TABLE);
            // What cannot be read stays as it was: the run may be replacing it.
            if let Some(text) = is_small.then(|| std::fs::read_to_string(&path).ok()).flatten() {
                self.rows = rows(&text);
            }
        }
        if let Some((written, path)) = pictures.filter(|(written, _)| Some(*written) != self.read[1]) {
            self.read[1] = Some(written);
            if let Ok(picture) = image::open(&path) {
                let picture = picture.to_rgb8();
                let size = [picture.width() as usize, picture.height() as usize];
                let image = ColorImage::from_rgb(size, picture.as_raw());
                self.pictures = Some(context.load_texture("images held out", image, TextureOptions::LINEAR));
            }
        }
        true
    }

    /// Forgets pictures of a user interface that has ended.
    pub fn forget_pictures(&mut self) {
        (self.pictures, self.read[1]) = (None, None);
    }

    /// Shows how it goes.
    pub fn show(&self, ui: &mut Ui) {
        ui.label(RichText::new("Training").strong());
        let Some(last) = self.rows.last() else {
            ui.label(RichText::new("There are no figures yet.").weak());
            return;
        };
        let state = if self.is_going_on { "goes on" } else { "has ended" };
        let Row { iteration, stage, seconds, .. } = last;
        ui.label(RichText::new(format!("{state}: iteration {iteration}, stage {stage}, {seconds:.0} s")).weak());
        // Both stages have a loss, but on images of different sizes: only the present one is shown.
        let of_stage = || self.rows.iter().filter(|row| row.stage == *stage);
        let points = |value: fn(&Row) -> Option<f64>| -> Vec<[f64; 2]> {
            of_stage().filter_map(|row| Some([row.iteration, value(row)?])).collect()
        };
        curve_plot(ui, "Loss (L1)", &points(|row| row.l1), |value| format!("{value:.4}"));
        curve_plot(ui, "Images held out", &points(|row| row.held_out_psnr), |value| format!("{value:.2} dB"));
        if let Some(pictures) = &self.pictures {
            let width = ui.available_width();
            ui.add(Image::new(pictures).max_size(vec2(width, 2.0 * width)).corner_radius(3.0));
            ui.label(RichText::new("Images held out, and the avatar in their poses below").small().weak());
        }
    }
}

/// Whether training has shown an avatar since the last figures of a result.
fn is_going_on(folder: &Path) -> bool {
    let preview = folder.join(CHECKPOINTS).join(PREVIEW_AVATAR);
    newest_of([preview.clone(), folder.join(METRICS_FILE)]).is_some_and(|(_, path)| path == preview)
}

/// The newest avatar in a run's folder: the one that training shows, or its result.
fn newest_avatar(folder: &Path) -> Option<PathBuf> {
    let files = [folder.join(CHECKPOINTS).join(PREVIEW_AVATAR), folder.join(AVATAR_FILE)];
    newest_of(files).map(|(_, path)| path)
}

/// The newest file of that name that a run has written, while it went on or at its end.
fn newest(folder: &Path, name: &str) -> Option<(SystemTime, PathBuf)> {
    newest_of([folder.join(CHECKPOINTS).join(name), folder.join(name)])
}

fn newest_of(files: [PathBuf; 2]) -> Option<(SystemTime, PathBuf)> {
    let written = |path: PathBuf| Some((path.metadata().and_then(|metadata| metadata.modified()).ok()?, path));
    files.into_iter().filter_map(written).max()
}

/// The rows of a table of curves; lines that are not rows are skipped.
fn rows(text: &str) -> Vec<Row> {
    let row = |line: &str| {
        let cells: Vec<Option<f64>> =
            line.split(',').map(|cell| cell.trim().parse().ok().filter(|value: &f64| value.is_finite())).collect();
        match cells[..] {
            [Some(iteration), Some(stage), Some(seconds), l1, held_out_psnr] => {
                Some(Row { iteration, stage, seconds, l1, held_out_psnr })
            }
            _ => None,
        }
    };
    text.lines().filter_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_read_and_other_lines_skipped() {
        let text = "iteration,stage,seconds,l1,held_out_psnr\n25,1,3.0,0.5,\n50,2,7.5,,21.25\nbroken\n75,2,nan,0.1,\n";
        let row = |iteration, stage, seconds, l1, held_out_psnr| Row { iteration, stage, seconds, l1, held_out_psnr };
        assert_eq!(rows(text), [row(25.0, 1.0, 3.0, Some(0.5), None), row(50.0, 2.0, 7.5, None, Some(21.25))]);
    }

    #[test]
    fn the_newest_avatar_of_a_run_is_shown() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        assert!(TrainingRun::open(path).is_none());
        std::fs::create_dir(path.join(CHECKPOINTS)).unwrap();
        let write = |file: PathBuf, age: u64| {
            let file = std::fs::File::create(file).unwrap();
            file.set_modified(SystemTime::now() - std::time::Duration::from_secs(age)).unwrap();
        };
        let preview = path.join(CHECKPOINTS).join(PREVIEW_AVATAR);
        // The result of an earlier run in the folder.
        write(path.join(AVATAR_FILE), 100);
        write(preview.clone(), 50);
        let run = TrainingRun::open(path).unwrap();
        assert_eq!(run.avatar(), Some(preview));
        assert!(run.is_going_on());
        write(path.join(AVATAR_FILE), 10);
        assert_eq!(run.avatar(), Some(path.join(AVATAR_FILE)));
        write(path.join(METRICS_FILE), 5);
        assert!(!TrainingRun::open(path).unwrap().is_going_on());
    }
}
