//! What a person sees who opens the viewer on a computer without a usable graphics driver.

use std::io::ErrorKind;
use std::process::{Command, Stdio};

use ghand_render::DeviceError;

const TITLE: &str = "ghand: no graphics driver";
/// Longest line of a box, characters.
const COLUMNS: usize = 84;

/// What to install, by system.
const REMEDIES: &str = if cfg!(target_os = "windows") {
    "Install the newest driver of the graphics card from its maker (NVIDIA, AMD or Intel) and start the viewer again. \
     Over remote desktop, log in at the computer itself."
} else if cfg!(target_os = "macos") {
    "The viewer needs Metal, which every Mac since 2012 has from macOS 10.14 on: update macOS."
} else {
    "Install a Vulkan driver and start the viewer again:\n\
     \n\
     Debian, Ubuntu:  sudo apt install mesa-vulkan-drivers\n\
     Fedora:  sudo dnf install mesa-vulkan-drivers\n\
     Arch:  sudo pacman -S vulkan-intel, vulkan-radeon or, for any computer, vulkan-swrast\n\
     NVIDIA cards:  the maker's driver, from the system's driver manager\n\
     \n\
     Mesa's drivers include a software rasteriser, which needs no graphics card. \
     \"vulkaninfo --summary\" lists the drivers that are found."
};

/// Says what to install, on stderr and with the reason in a box on the desktop, and waits until it is closed. Does nothing if
/// there is a driver, and the adapter or the tier that the user asked for is the problem.
pub fn tell(error: &DeviceError) {
    let lacks_driver = match error {
        DeviceError::NoAdapter { found, .. } => found.is_empty(),
        DeviceError::NoDevice { .. } | DeviceError::Gone { .. } => true,
        DeviceError::NoTier { .. } | DeviceError::SmallLimits { .. } | DeviceError::UnknownTier { .. } => false,
    };
    if !lacks_driver {
        return;
    }
    eprintln!("{REMEDIES}");
    let text = wrapped(&format!("The viewer cannot draw: {error}.\n\n{REMEDIES}"));
    if cfg!(any(target_os = "windows", target_os = "macos")) {
        rfd::MessageDialog::new().set_level(rfd::MessageLevel::Error).set_title(TITLE).set_description(text).show();
        return;
    }
    // No library draws windows on every Linux desktop without a graphics driver; one of these programs is there.
    for (program, arguments) in boxes(&text) {
        let shown = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !shown.is_err_and(|error| error.kind() == ErrorKind::NotFound) {
            return;
        }
    }
}

/// The text in lines of at most [`COLUMNS`] characters: not every box breaks lines.
fn wrapped(text: &str) -> String {
    let mut lines = Vec::new();
    for line in text.lines() {
        let mut rest = String::new();
        for word in line.split(' ') {
            if !rest.is_empty() && rest.chars().count() + 1 + word.chars().count() > COLUMNS {
                lines.push(std::mem::take(&mut rest));
            } else if !rest.is_empty() {
                rest.push(' ');
            }
            rest.push_str(word);
        }
        lines.push(rest);
    }
    lines.join("\n")
}

/// Programs that show a box, the best first, and their arguments.
fn boxes(text: &str) -> [(&'static str, Vec<&str>); 4] {
    [
        ("zenity", vec!["--error", "--no-markup", "--width=560", "--title", TITLE, "--text", text]),
        ("kdialog", vec!["--title", TITLE, "--error", text]),
        ("xmessage", vec!["-center", "-title", TITLE, text]),
        ("notify-send", vec!["--urgency=critical", TITLE, text]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_are_broken_between_words_and_others_stay() {
        let text = format!("short\n\n{}\nend  of it", "word ".repeat(40).trim_end());
        let wrapped = wrapped(&text);
        assert!(wrapped.lines().all(|line| line.len() <= COLUMNS), "{wrapped}");
        assert_eq!(wrapped.matches("word").count(), 40);
        assert!(wrapped.starts_with("short\n\nword") && wrapped.ends_with("\nend  of it"));
    }
}
