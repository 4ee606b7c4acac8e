//! The commands of the viewer: one list that feeds the menu, the keyboard, the help and the command palette.

use egui::{Event, Key, KeyboardShortcut, Modifiers};

/// Names a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the list of commands says what each does")]
pub enum CommandId {
    Quit,
    Play,
    ResetAll,
    ResetView,
    Measure,
    ShowPanel,
    ShowPalette,
    ShowHelp,
}

/// A menu, in the order of the menu bar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Menu {
    /// Files and the program.
    File,
    /// The hand's pose and motion.
    Pose,
    /// The camera and the interface.
    View,
    /// What explains the rest.
    Help,
}

impl Menu {
    /// All menus in their order.
    pub const ALL: [Menu; 4] = [Menu::File, Menu::Pose, Menu::View, Menu::Help];

    /// Its title.
    pub fn title(self) -> &'static str {
        match self {
            Menu::File => "File",
            Menu::Pose => "Pose",
            Menu::View => "View",
            Menu::Help => "Help",
        }
    }
}

/// What a command is called, how it is given and what it does.
#[derive(Debug, Clone, Copy)]
pub struct Command {
    /// Names it.
    pub id: CommandId,
    /// Its title in menus and in the palette.
    pub title: &'static str,
    /// The menu that has it.
    pub menu: Menu,
    /// Its key, if it has one; the first is shown, the others work as well.
    pub shortcuts: &'static [KeyboardShortcut],
    /// What it does, one sentence.
    pub summary: &'static str,
}

const fn key(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::NONE, key)
}

const fn ctrl(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND, key)
}

const fn command(
    id: CommandId,
    menu: Menu,
    title: &'static str,
    shortcuts: &'static [KeyboardShortcut],
    summary: &'static str,
) -> Command {
    Command { id, title, menu, shortcuts, summary }
}

/// All commands, in the order of the menus.
pub const COMMANDS: &[Command] = &[
    command(CommandId::Quit, Menu::File, "Quit", &[ctrl(Key::Q)], "Closes the window."),
    command(CommandId::Play, Menu::Pose, "Play or pause", &[key(Key::Space)], "Plays the motion, or stops it."),
    command(
        CommandId::ResetAll,
        Menu::Pose,
        "Reset all",
        &[key(Key::R)],
        "Resets pose, shape, light, colours, background and view.",
    ),
    command(
        CommandId::ResetView,
        Menu::View,
        "Reset view",
        &[key(Key::Home)],
        "Shows the subject as at the start; so does a double click.",
    ),
    command(
        CommandId::Measure,
        Menu::View,
        "Measure",
        &[key(Key::M)],
        "Renders continuously and shows the times of pictures.",
    ),
    command(
        CommandId::ShowPanel,
        Menu::View,
        "Panel",
        &[key(Key::N)],
        "Shows or hides the panel, for more room in a narrow window.",
    ),
    command(
        CommandId::ShowPalette,
        Menu::Help,
        "Command palette",
        &[ctrl(Key::K), ctrl(Key::P)],
        "Finds commands, poses and motions by name.",
    ),
    command(
        CommandId::ShowHelp,
        Menu::Help,
        "Keys and mouse",
        &[key(Key::F1), key(Key::Questionmark)],
        "Lists all commands with their keys.",
    ),
];

impl Command {
    /// The command of that name.
    pub fn of(id: CommandId) -> Option<&'static Command> {
        COMMANDS.iter().find(|command| command.id == id)
    }

    /// Its key as text; empty if it has none.
    pub fn shortcut_text(&self, context: &egui::Context) -> String {
        self.shortcuts.first().map(|shortcut| context.format_shortcut(shortcut)).unwrap_or_default()
    }
}

/// The commands whose keys were pressed; the presses are consumed. While text is typed there are none, and while
/// another control has the keyboard only those with a modifier.
pub fn pressed(context: &egui::Context) -> Vec<CommandId> {
    if context.text_edit_focused() {
        return Vec::new();
    }
    let control_has_keys = context.egui_wants_keyboard_input();
    context.input_mut(|input| {
        let mut found = Vec::new();
        input.events.retain(|event| {
            let Event::Key { key, pressed: true, repeat: false, modifiers, .. } = event else { return true };
            let Some(command) = command_of_key(*key, *modifiers, control_has_keys) else { return true };
            found.push(command);
            false
        });
        found
    })
}

fn command_of_key(key: Key, modifiers: Modifiers, only_with_modifier: bool) -> Option<CommandId> {
    let is_pressed = |shortcut: &KeyboardShortcut| {
        let plain = shortcut.modifiers.is_none();
        // The question mark needs Shift on most keyboards.
        let fits = modifiers.matches_exact(shortcut.modifiers) || (key == Key::Questionmark && modifiers.shift_only());
        shortcut.logical_key == key && fits && !(plain && only_with_modifier)
    };
    COMMANDS.iter().find(|command| command.shortcuts.iter().any(is_pressed)).map(|command| command.id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_commands_have_the_same_key() {
        // The user interface enlarges itself with these.
        let taken = [Key::Plus, Key::Equals, Key::Minus, Key::Num0].map(ctrl);
        let shortcuts: Vec<KeyboardShortcut> =
            taken.into_iter().chain(COMMANDS.iter().flat_map(|command| command.shortcuts).copied()).collect();
        for (k, shortcut) in shortcuts.iter().enumerate() {
            assert!(!shortcuts[..k].contains(shortcut), "{shortcut:?} has two commands");
        }
    }

    #[test]
    fn every_command_is_named_once_and_explained_in_a_sentence() {
        for (k, command) in COMMANDS.iter().enumerate() {
            let others = &COMMANDS[..k];
            assert!(others.iter().all(|other| other.id != command.id && other.title != command.title), "{command:?}");
            assert!(command.summary.ends_with('.') && command.title.len() < 30, "{command:?}");
        }
    }

    #[test]
    fn a_longer_shortcut_is_not_taken_for_a_shorter_one() {
        let quit = |modifiers| command_of_key(Key::Q, modifiers, false);
        assert_eq!(quit(Modifiers::COMMAND), Some(CommandId::Quit));
        assert_eq!(quit(Modifiers::COMMAND | Modifiers::SHIFT), None);
        assert_eq!(quit(Modifiers::NONE), None);
        assert_eq!(command_of_key(Key::Space, Modifiers::NONE, false), Some(CommandId::Play));
        assert_eq!(command_of_key(Key::Space, Modifiers::NONE, true), None);
        assert_eq!(command_of_key(Key::Questionmark, Modifiers::SHIFT, false), Some(CommandId::ShowHelp));
    }
}
