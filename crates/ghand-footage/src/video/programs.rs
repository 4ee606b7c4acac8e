//! The programs `ffmpeg` and `ffprobe`.

use std::io::{self, ErrorKind};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use crate::FootageError;

/// One of the programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Program {
    Ffmpeg,
    Ffprobe,
}

impl Program {
    fn name(self) -> &'static str {
        match self {
            Program::Ffmpeg => "ffmpeg",
            Program::Ffprobe => "ffprobe",
        }
    }

    /// The program, in the process group of this one.
    pub fn command_in_group(self) -> Command {
        let mut command = Command::new(self.name());
        command.stdin(Stdio::null()).arg("-hide_banner");
        command
    }

    /// The program.
    pub fn command(self) -> Command {
        let mut command = self.command_in_group();
        // Ctrl-C in a terminal is for the program that reads, which then closes the pipe.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command
    }

    /// The program, with a file as its input. A file that names other files or servers, as a playlist does, opens no
    /// servers.
    pub fn reading(self, path: &Path) -> Command {
        let mut command = self.command();
        let level = if self == Program::Ffprobe { "error" } else { "level+info" };
        let mut input = std::ffi::OsString::from("file:");
        input.push(path);
        command.args(["-loglevel", level, "-protocol_whitelist", "file"]);
        if self == Program::Ffmpeg {
            command.args(["-nostdin", "-nostats", "-copyts"]);
        }
        command.arg("-i").arg(input);
        command
    }

    /// Why the program did not start.
    pub fn failure(self, path: &Path) -> impl FnOnce(io::Error) -> FootageError {
        let path = path.to_path_buf();
        move |error| match error.kind() {
            ErrorKind::NotFound => FootageError::NotInstalled { path, program: self.name() },
            _ => FootageError::unusable(&path, format!("{} cannot be started: {error}", self.name())),
        }
    }

    /// Whether it has all these filters.
    pub fn has_filters(self, names: &[&str]) -> bool {
        let text = self.told(&["-filters"]);
        names.iter().all(|name| text.lines().any(|line| line.split_whitespace().nth(1) == Some(name)))
    }

    fn told(self, arguments: &[&str]) -> String {
        let output = self.command().args(arguments).stderr(Stdio::null()).output();
        output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default()
    }
}

/// The option by which ffmpeg gives each frame once: `-vsync` until version 5.1.
pub(crate) fn each_frame_once() -> &'static str {
    static OPTION: OnceLock<&str> = OnceLock::new();
    OPTION.get_or_init(|| {
        let help = Program::Ffmpeg.told(&["-h", "long"]);
        if help.contains("-fps_mode") || !help.contains("-vsync") { "-fps_mode" } else { "-vsync" }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_program_is_told_with_the_way_to_install_it() {
        let error = Program::Ffprobe.failure(Path::new("a.mp4"))(ErrorKind::NotFound.into()).to_string();
        let parts = ["a.mp4: ", "ffprobe", "apt-get install", "dnf install", "brew install", "winget install"];
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
}
