//! The commands of the viewer: one list that feeds the menu, the keyboard, the help and the command palette.

use egui::{Event, Key, KeyboardShortcut, Modifiers};

use crate::viewer::stage::comparison::Comparison;
use crate::viewer::stage::layer::Layer;
use crate::viewer::stage::overlay::Overlay;

/// Names a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the list of commands says what each does")]
pub enum CommandId {
    Open,
    SavePicture,
    SaveFilm,
    Quit,
    Undo,
    Redo,
    CopyPose,
    PastePose,
    ShowHandles,
    ShowThumbnails,
    Play,
    SetKey,
    DeleteKey,
    PreviousKey,
    NextKey,
    SaveMotion,
    LivePoses,
    Webcam,
    ResetAll,
    Frame,
    ResetView,
    ViewBack,
    ViewPalm,
    ViewThumbSide,
    ViewLittleFingerSide,
    ViewFingertips,
    SwitchProjection,
    SaveView,
    Turntable,
    PreviousCamera,
    NextCamera,
    Measure,
    AdaptDetail,
    SwitchTheme,
    ShowPanel,
    ShowLayer(Layer),
    DrawOverlay(Overlay),
    Compare(Comparison),
    CapturePoses,
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
    /// What the view shows of the subject.
    Layers,
    /// What explains the rest.
    Help,
}

impl Menu {
    /// All menus in their order.
    pub const ALL: [Menu; 5] = [Menu::File, Menu::Pose, Menu::View, Menu::Layers, Menu::Help];

    /// Its title.
    pub fn title(self) -> &'static str {
        match self {
            Menu::File => "File",
            Menu::Pose => "Pose",
            Menu::View => "View",
            Menu::Layers => "Layers",
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

const fn ctrl_shift(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), key)
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

const fn compare(comparison: Comparison, title: &'static str) -> Command {
    command(CommandId::Compare(comparison), Menu::Layers, title, &[], comparison.summary())
}

const fn layer(layer: Layer, title: &'static str) -> Command {
    command(CommandId::ShowLayer(layer), Menu::Layers, title, &[], layer.summary())
}

const fn overlay(overlay: Overlay, title: &'static str) -> Command {
    command(CommandId::DrawOverlay(overlay), Menu::Layers, title, &[], overlay.summary())
}

/// All commands, in the order of the menus.
pub const COMMANDS: &[Command] = &[
    command(
        CommandId::Open,
        Menu::File,
        "Open",
        &[ctrl(Key::O)],
        "Opens an avatar, a hand model, a scene, poses or a capture; dropping a file does the same.",
    ),
    command(
        CommandId::SavePicture,
        Menu::File,
        "Save picture",
        &[ctrl_shift(Key::S)],
        "Saves the view as a picture of any size, also without a background.",
    ),
    command(
        CommandId::SaveFilm,
        Menu::File,
        "Save film",
        &[ctrl_shift(Key::F)],
        "Saves a turn around the subject, or its motion, as a film.",
    ),
    command(CommandId::Quit, Menu::File, "Quit", &[ctrl(Key::Q)], "Closes the window."),
    command(
        CommandId::Undo,
        Menu::Pose,
        "Undo",
        &[ctrl(Key::Z)],
        "Goes back to pose, shape and keys before the last change.",
    ),
    command(
        CommandId::Redo,
        Menu::Pose,
        "Redo",
        &[ctrl_shift(Key::Z), ctrl(Key::Y)],
        "Goes forward to what was undone.",
    ),
    command(
        CommandId::CopyPose,
        Menu::Pose,
        "Copy pose",
        &[ctrl(Key::C)],
        "Copies pose and shape to the clipboard as JSON, which --pose reads, too.",
    ),
    command(
        CommandId::PastePose,
        Menu::Pose,
        "Paste pose",
        &[ctrl(Key::V)],
        "Takes the pose, or plays the poses, on the clipboard.",
    ),
    command(
        CommandId::ShowHandles,
        Menu::Pose,
        "Handles",
        &[key(Key::H)],
        "Shows dots to drag when the pointer is on the hand, or hides them.",
    ),
    command(
        CommandId::ShowThumbnails,
        Menu::Pose,
        "Pictures of poses",
        &[],
        "Shows the named poses as pictures, or as words.",
    ),
    command(CommandId::Play, Menu::Pose, "Play or pause", &[key(Key::Space)], "Plays the motion, or stops it."),
    command(
        CommandId::SetKey,
        Menu::Pose,
        "Set key",
        &[key(Key::K)],
        "Keeps the present pose as a key of a motion, at the present position; the first key begins one.",
    ),
    command(
        CommandId::DeleteKey,
        Menu::Pose,
        "Delete key",
        &[key(Key::Delete)],
        "Deletes the key at the present position.",
    ),
    command(
        CommandId::PreviousKey,
        Menu::Pose,
        "Previous key",
        &[key(Key::OpenBracket)],
        "Goes to the key before the present position.",
    ),
    command(
        CommandId::NextKey,
        Menu::Pose,
        "Next key",
        &[key(Key::CloseBracket)],
        "Goes to the key after the present position.",
    ),
    command(
        CommandId::SaveMotion,
        Menu::Pose,
        "Save motion",
        &[ctrl(Key::S)],
        "Saves the motion as a file of poses, which --pose reads.",
    ),
    command(
        CommandId::LivePoses,
        Menu::Pose,
        "Live poses",
        &[ctrl(Key::L)],
        "Opens the port, or the webcam of --webcam, through which a tracker drives the hand, or closes it.",
    ),
    command(
        CommandId::Webcam,
        Menu::Pose,
        "Webcam",
        &[ctrl_shift(Key::L)],
        "Lets a hand before a webcam drive this one, or closes the webcam.",
    ),
    command(
        CommandId::ResetAll,
        Menu::Pose,
        "Reset all",
        &[key(Key::R)],
        "Resets pose, shape, light, colours, background and view.",
    ),
    command(
        CommandId::Frame,
        Menu::View,
        "Frame",
        &[key(Key::F)],
        "Moves the view so that the subject fills it in its present pose.",
    ),
    command(
        CommandId::ResetView,
        Menu::View,
        "Reset view",
        &[key(Key::Home)],
        "Shows the subject as at the start; so does a double click.",
    ),
    command(CommandId::ViewBack, Menu::View, "From the back", &[key(Key::Num1)], "Shows the back of the hand."),
    command(CommandId::ViewPalm, Menu::View, "From the palm", &[key(Key::Num2)], "Shows the palm."),
    command(
        CommandId::ViewThumbSide,
        Menu::View,
        "From the thumb's side",
        &[key(Key::Num3)],
        "Shows the thumb's side.",
    ),
    command(
        CommandId::ViewLittleFingerSide,
        Menu::View,
        "From the little finger's side",
        &[key(Key::Num4)],
        "Shows the little finger's side.",
    ),
    command(
        CommandId::ViewFingertips,
        Menu::View,
        "From the fingertips",
        &[key(Key::Num5)],
        "Shows the hand from beyond the fingertips.",
    ),
    command(
        CommandId::SwitchProjection,
        Menu::View,
        "Orthographic",
        &[key(Key::O)],
        "Gives all depths the same size, as in a drawing, or returns to perspective.",
    ),
    command(
        CommandId::SaveView,
        Menu::View,
        "Save view",
        &[key(Key::V)],
        "Keeps the present view under a name, for the panel, the palette and --view.",
    ),
    command(
        CommandId::Turntable,
        Menu::View,
        "Turntable",
        &[key(Key::T)],
        "Turns the view around the subject, once in 12 seconds.",
    ),
    command(
        CommandId::PreviousCamera,
        Menu::View,
        "Previous camera",
        &[key(Key::Comma)],
        "Shows the view of the capture's previous camera.",
    ),
    command(
        CommandId::NextCamera,
        Menu::View,
        "Next camera",
        &[key(Key::Period)],
        "Shows the view of the capture's next camera.",
    ),
    command(
        CommandId::Measure,
        Menu::View,
        "Measure",
        &[key(Key::M)],
        "Renders continuously and shows the times of pictures.",
    ),
    command(
        CommandId::AdaptDetail,
        Menu::View,
        "Adapt resolution",
        &[],
        "Draws fewer pixels while the picture changes, if the device is slow, and all once it rests.",
    ),
    command(
        CommandId::SwitchTheme,
        Menu::View,
        "Light or dark",
        &[key(Key::L)],
        "Switches between light on dark, dark on light, and the desktop's choice.",
    ),
    command(
        CommandId::ShowPanel,
        Menu::View,
        "Panel",
        &[key(Key::N)],
        "Shows or hides the panel, for more room in a narrow window.",
    ),
    layer(Layer::Skin, "Layer: skin"),
    layer(Layer::Albedo, "Layer: albedo"),
    layer(Layer::Views, "Layer: views in training"),
    layer(Layer::Weights, "Layer: skinning weights"),
    layer(Layer::Offset, "Layer: offset"),
    layer(Layer::Depth, "Layer: depth"),
    layer(Layer::Alpha, "Layer: alpha"),
    layer(Layer::Centers, "Layer: centres"),
    layer(Layer::Residual, "Layer: residual weights"),
    layer(Layer::Basis, "Layer: shape basis"),
    layer(Layer::Coefficient, "Layer: coefficient"),
    overlay(Overlay::Skeleton, "Skeleton"),
    overlay(Overlay::Wireframe, "Wireframe"),
    compare(Comparison::Picture, "Capture: picture alone"),
    compare(Comparison::Truth, "Capture: truth"),
    compare(Comparison::Split, "Capture: split"),
    compare(Comparison::Flicker, "Capture: flicker"),
    compare(Comparison::Difference, "Capture: difference"),
    command(
        CommandId::CapturePoses,
        Menu::Layers,
        "Capture: poses of training",
        &[],
        "Shows the training frames in the poses that training refined, or as the capture gives them.",
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

/// What the user asks for by keys.
#[derive(Debug, Clone, PartialEq)]
pub enum Pressed {
    /// A command.
    Command(CommandId),
    /// Text of the clipboard: the window reads it when [`CommandId::PastePose`]'s keys are pressed.
    Pasted(String),
}

/// What was asked for by keys; the presses are consumed. While text is typed there are none, and while
/// another control has the keyboard only those with a modifier.
pub fn pressed(context: &egui::Context) -> Vec<Pressed> {
    if context.text_edit_focused() {
        return Vec::new();
    }
    let control_has_keys = context.egui_wants_keyboard_input();
    context.input_mut(|input| {
        let mut found = Vec::new();
        input.events.retain(|event| {
            let asked = match event {
                Event::Copy => Some(Pressed::Command(CommandId::CopyPose)),
                Event::Paste(text) => Some(Pressed::Pasted(text.clone())),
                Event::Key { key, pressed: true, repeat, modifiers, .. } => {
                    let command = command_of_key(*key, *modifiers, control_has_keys);
                    // Of a key that is held, only undo and redo go on.
                    let goes_on = |id: &CommandId| !repeat || matches!(id, CommandId::Undo | CommandId::Redo);
                    command.filter(goes_on).map(Pressed::Command)
                }
                _ => None,
            };
            let is_kept = asked.is_none();
            found.extend(asked);
            is_kept
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
