//! Questions over the view, and the help.
//!
//! [`Dialogs`] owns the questions while they are open, and returns the answers. It does nothing with them itself.

pub mod command_palette;
pub mod file_dialog;
pub mod help_overlay;
pub mod name_dialog;
pub mod output_dialog;

use egui::Context;

use crate::viewer::command::{CommandId, Pressed};
use crate::viewer::dialogs::command_palette::{Choice, CommandPalette, Entry};
use crate::viewer::dialogs::file_dialog::{Answer, FileDialog};
use crate::viewer::dialogs::help_overlay::help_overlay;
use crate::viewer::dialogs::name_dialog::{NameDialog, Named};
use crate::viewer::dialogs::output_dialog::{Asked, OutputDialog, OutputKind};
use crate::viewer::document::Document;

/// What is saved to the file that the user chooses.
#[derive(Debug, Clone, PartialEq)]
pub enum Saving {
    /// The present motion as a file of poses.
    Motion,
    /// A picture or a film of the view.
    Output(OutputDialog),
}

/// The questions that are open.
#[derive(Default)]
pub struct Dialogs {
    /// Which file to open.
    open: Option<FileDialog>,
    /// Which file to save to, and what is saved there.
    save: Option<(FileDialog, Saving)>,
    palette: Option<CommandPalette>,
    /// Under which name to save the view.
    name: Option<NameDialog>,
    /// What to save of the view.
    output: Option<OutputDialog>,
    help_shown: bool,
}

impl Dialogs {
    /// Asks which file to open.
    pub fn ask_for_file(&mut self, context: &Context) {
        self.open = Some(FileDialog::open(context));
    }

    /// Whether it is asked which file to open.
    pub fn asks_for_file(&self) -> bool {
        self.open.is_some()
    }

    /// What became of the question which file to open.
    pub fn file_to_open(&mut self) -> Option<Answer> {
        let answer = self.open.as_ref()?.poll()?;
        self.open = None;
        Some(answer)
    }

    /// Asks where to save the motion.
    pub fn ask_for_motion_file(&mut self, context: &Context) {
        let dialog = FileDialog::save(context, "motion.json", "Poses", &["json"]);
        self.save = Some((dialog, Saving::Motion));
    }

    /// Whether it is asked where to save something.
    pub fn asks_where_to_save(&self) -> bool {
        self.save.is_some()
    }

    /// What became of the question where to save something.
    pub fn file_to_save(&mut self) -> Option<(Answer, Saving)> {
        let answer = self.save.as_ref()?.0.poll()?;
        let (_, what) = self.save.take()?;
        Some((answer, what))
    }

    /// Asks what to save of the view, in this size.
    pub fn ask_for_output(&mut self, kind: OutputKind, size: [u32; 2]) {
        self.output = Some(OutputDialog::new(kind, size));
    }

    /// Shows the question what to save, if it is open, and then asks where.
    pub fn show_output(&mut self, context: &Context, document: &Document) {
        let Some(mut dialog) = self.output.take() else { return };
        match dialog.show(context, document.has_motion()) {
            Asked::Open => self.output = Some(dialog),
            Asked::Closed => {}
            Asked::Save => {
                let chooser = match dialog.ending() {
                    None => FileDialog::folder(context),
                    Some(ending) => {
                        let name = format!("{}.{ending}", document.stem());
                        FileDialog::save(context, &name, "Pictures and films", &[ending])
                    }
                };
                self.save = Some((chooser, Saving::Output(dialog)));
            }
        }
    }

    /// Asks under which name to save the view.
    pub fn ask_for_name(&mut self) {
        self.name = Some(NameDialog::default());
    }

    /// Shows the question for a name, if it is open. Returns the name once it is given.
    pub fn show_name(&mut self, context: &Context) -> Option<String> {
        let mut dialog = self.name.take()?;
        match dialog.show(context, "Save this view as", "Save") {
            Named::Open => {
                self.name = Some(dialog);
                None
            }
            Named::Closed => None,
            Named::As(name) => Some(name),
        }
    }

    /// Opens the palette.
    pub fn open_palette(&mut self) {
        self.palette = Some(CommandPalette::default());
    }

    /// Whether the palette is open.
    pub fn has_palette(&self) -> bool {
        self.palette.is_some()
    }

    /// Shows the palette, if it is open. Returns the action that was chosen.
    pub fn show_palette<A: Clone>(&mut self, context: &Context, entries: &[Entry<A>]) -> Option<A> {
        let mut palette = self.palette.take()?;
        match palette.show(context, entries) {
            Choice::Open => {
                self.palette = Some(palette);
                None
            }
            Choice::Closed => None,
            Choice::Chosen(action) => Some(action),
        }
    }

    /// Opens the help.
    pub fn open_help(&mut self) {
        self.help_shown = true;
    }

    /// Shows the help, if it is open.
    pub fn show_help(&mut self, context: &Context) {
        self.help_shown = self.help_shown && help_overlay(context);
    }

    /// Whether the keys belong to a question or the help.
    pub fn take_keys(&self) -> bool {
        self.palette.is_some() || self.help_shown || self.name.is_some() || self.output.is_some()
    }

    /// Closes what the same keys have opened.
    pub fn close_by_key(&mut self, asked: &Pressed) {
        match asked {
            Pressed::Command(CommandId::ShowHelp) => self.help_shown = false,
            Pressed::Command(CommandId::ShowPalette) => self.palette = None,
            Pressed::Command(_) | Pressed::Pasted(_) => {}
        }
    }
}

#[cfg(test)]
impl Dialogs {
    /// Whether the help is open.
    pub(crate) fn has_help(&self) -> bool {
        self.help_shown
    }

    /// Whether it is asked under which name to save the view.
    pub(crate) fn asks_for_name(&self) -> bool {
        self.name.is_some()
    }
}
