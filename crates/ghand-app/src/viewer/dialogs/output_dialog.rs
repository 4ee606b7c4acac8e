//! Asks what to save of the view: a picture, a turn around the subject, or its motion.

use std::path::{Path, PathBuf};

use egui::{Align2, Context, DragValue, Id, Modal};

/// Longest edge of a picture, pixels, as of `ghand render`.
const LONGEST_EDGE: u32 = 16384;

/// What is saved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputKind {
    /// The view as a picture.
    Picture,
    /// A film of one turn around the subject.
    Turntable,
    /// A film of the motion.
    Motion,
}

/// The files that a picture can be.
const PICTURES: [&str; 2] = ["png", "exr"];
/// The files that a film can be.
const FILMS: [&str; 3] = ["gif", "webm", "mp4"];
/// What a film is instead if its pictures are files of their own, in a folder.
pub const SERIES: &str = "png pictures";

/// The question, while it is open.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputDialog {
    /// What is saved.
    pub kind: OutputKind,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Whether there is nothing behind the subject.
    pub transparent: bool,
    /// Ending of a picture's file.
    pub picture: &'static str,
    /// Ending of a film's file, or [`SERIES`].
    pub film: &'static str,
}

/// What the user did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// Nothing yet.
    Open,
    /// Closed the question.
    Closed,
    /// Wants it saved.
    Save,
}

impl OutputDialog {
    /// Asks about a picture or a film of this size.
    pub fn new(kind: OutputKind, size: [u32; 2]) -> OutputDialog {
        OutputDialog { kind, size, transparent: false, picture: PICTURES[0], film: FILMS[0] }
    }

    /// The ending of the file; `None` if it is a folder of pictures.
    pub fn ending(&self) -> Option<&'static str> {
        let format = if self.kind == OutputKind::Picture { self.picture } else { self.film };
        (format != SERIES).then_some(format)
    }

    /// Whether a file of this name can be what is saved.
    fn fits(&self, path: &Path) -> bool {
        let endings: &[&str] = if self.kind == OutputKind::Picture { &PICTURES } else { &FILMS };
        path.extension().is_some_and(|own| endings.iter().any(|ending| own.eq_ignore_ascii_case(ending)))
    }

    /// The file to save to, which gets its ending if it has none, or the folder.
    pub fn completed(&self, path: &Path) -> PathBuf {
        let mut path = path.as_os_str().to_owned();
        match self.ending() {
            // A name with a dot is a folder's, too.
            None => path.push(std::path::MAIN_SEPARATOR_STR),
            Some(ending) if !self.fits(Path::new(&path)) => path.push(format!(".{ending}")),
            Some(_) => {}
        }
        path.into()
    }

    /// Shows the question; a motion is offered if there is one.
    pub fn show(&mut self, context: &Context, has_motion: bool) -> Asked {
        let mut asked = Asked::Open;
        let area = Modal::default_area(Id::unique("output")).anchor(Align2::CENTER_TOP, [0.0, 60.0]);
        let response = Modal::new(Id::unique("output")).area(area).show(context, |ui| {
            ui.set_width(300.0f32.min(context.content_rect().width() - 40.0));
            ui.horizontal_wrapped(|ui| {
                ui.selectable_value(&mut self.kind, OutputKind::Picture, "Picture");
                ui.selectable_value(&mut self.kind, OutputKind::Turntable, "Turntable film");
                if has_motion {
                    ui.selectable_value(&mut self.kind, OutputKind::Motion, "Film of the motion");
                }
            });
            ui.separator();
            ui.horizontal(|ui| {
                let label = ui.label("size").id;
                let edge = |value| DragValue::new(value).range(1..=LONGEST_EDGE).speed(4);
                let [columns, rows] = &mut self.size;
                ui.add(edge(columns)).labelled_by(label).on_hover_text("Width, pixels");
                ui.label("x");
                ui.add(edge(rows)).labelled_by(label).on_hover_text("Height, pixels");
                ui.label("pixels");
            });
            ui.checkbox(&mut self.transparent, "transparent background");
            if self.kind == OutputKind::Picture {
                ui.horizontal(|ui| {
                    for picture in PICTURES {
                        let hover =
                            if picture == "png" { "8-bit display values" } else { "Linear light in 32-bit floats" };
                        if ui.selectable_label(self.picture == picture, picture).on_hover_text(hover).clicked() {
                            self.picture = picture;
                        }
                    }
                });
            } else {
                ui.horizontal_wrapped(|ui| {
                    for film in FILMS.into_iter().chain([SERIES]) {
                        let hover = match film {
                            "gif" => "256 colours",
                            SERIES => "A file for each picture, in a folder",
                            _ => "Needs ffmpeg",
                        };
                        if ui.selectable_label(self.film == film, film).on_hover_text(hover).clicked() {
                            self.film = film;
                        }
                    }
                });
                if self.film == "mp4" && self.transparent {
                    ui.weak("MP4 has no transparency; choose webm or gif.");
                }
            }
            ui.separator();
            ui.horizontal(|ui| {
                let possible = !(self.ending() == Some("mp4") && self.transparent);
                let save = if self.ending().is_none() { "Save to ..." } else { "Save as ..." };
                if ui.add_enabled(possible, egui::Button::new(save)).clicked() {
                    asked = Asked::Save;
                }
                if ui.button("Cancel").clicked() {
                    asked = Asked::Closed;
                }
            });
        });
        if asked == Asked::Open && response.should_close() { Asked::Closed } else { asked }
    }
}
