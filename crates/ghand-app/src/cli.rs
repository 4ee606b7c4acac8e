//! Shared parts of the command lines: options, errors in one sentence, exit codes.

use std::io::{self, ErrorKind as IoErrorKind, Write};
use std::process::ExitCode;
use std::sync::OnceLock;

use clap::error::ErrorKind;
use clap::{Args, Parser, ValueEnum};
use ghand_render::{AdapterChoice, DeviceError, Gpu};

use crate::runtime_dir::RuntimeDir;
use crate::train_run::interruption::{Interruption, STOPPED};

/// Largest edge of an image that the splatter accepts, pixels.
const LARGEST_EDGE: u32 = 16_384;

/// Which graphics adapter to use.
#[derive(Debug, Clone, Default, Args)]
pub struct AdapterArgs {
    /// Graphics adapter: `cpu`, `gpu` or part of its name; a wrong name lists the available ones [default:
    /// $GHAND_ADAPTER, else the best]
    #[arg(long, global = true, value_name = "NAME")]
    adapter: Option<String>,
}

impl AdapterArgs {
    /// Opens the chosen adapter.
    ///
    /// # Errors
    /// [`DeviceError`] if no adapter has that name.
    pub fn open(&self) -> Result<Gpu, DeviceError> {
        Gpu::new(&self.adapter.as_deref().map_or_else(AdapterChoice::from_env, AdapterChoice::parse))
    }

    /// Opens the chosen adapter, for what can do without; within, the error if the computer has none at all.
    ///
    /// # Errors
    /// As [`AdapterArgs::open`], if there is another adapter.
    pub fn open_if_any(&self) -> Result<Result<Gpu, DeviceError>, DeviceError> {
        match self.open() {
            Err(DeviceError::NoAdapter { wanted, found }) if found.is_empty() => {
                Ok(Err(DeviceError::NoAdapter { wanted, found }))
            }
            opened => opened.map(Ok),
        }
    }
}

/// The user has stopped the program: a line that says what exists.
#[derive(Debug)]
pub struct Stopped(pub String);

impl std::fmt::Display for Stopped {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Stopped {}

/// Parses the command line and runs a program: exit code 0, or 1 with one line `error: ...` on stderr, or [`STOPPED`]
/// with the line of [`Stopped`] on stderr. Must be called first in `main`.
pub fn run<A: Parser>(program: impl FnOnce(A) -> anyhow::Result<()>) -> ExitCode {
    let _runtime_dir = RuntimeDir::ensure();
    // Failures of the device are returned as errors; log messages of the driver would only hide them.
    let quiet =
        "warn,egui_wgpu=error,wgpu_core=off,wgpu_hal=off,naga=off,ghand_render=off,ghand_render::device::recovery=warn";
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or(quiet)).init();
    let args = match A::try_parse() {
        Ok(args) => args,
        // Without any command: the help is the best answer.
        Err(e) if e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            eprint!("{e}");
            return ExitCode::FAILURE;
        }
        Err(e) if e.use_stderr() => {
            let message = e.to_string();
            let paragraph = message.split("\n\n").next().unwrap_or(&message);
            eprintln!("{}; see --help", one_line(paragraph));
            return ExitCode::FAILURE;
        }
        // Help or version, on stdout.
        Err(e) => {
            note(e.print());
            return told(Ok(()));
        }
    };
    // What a program has not said itself; without handlers, a signal ends it as well.
    let _ = Interruption::listen("stopped");
    told(program(args))
}

/// The exit code for the result of a program. Prints its error, and an error of stdout, too.
fn told(result: anyhow::Result<()>) -> ExitCode {
    note(io::stdout().flush());
    let unprinted = STDOUT_ERROR.get().map(|e| anyhow::anyhow!("stdout: cannot be written: {e}"));
    match (result, unprinted) {
        (Ok(()), None) => ExitCode::SUCCESS,
        (Err(e), _) if e.is::<Stopped>() => {
            eprintln!("{}", sentence(&e));
            ExitCode::from(STOPPED)
        }
        (Err(e), _) | (Ok(()), Some(e)) => {
            tell(&e);
            ExitCode::FAILURE
        }
    }
}

/// The first error of printing to stdout, if any.
static STDOUT_ERROR: OnceLock<io::Error> = OnceLock::new();

/// Stores an error of stdout for the end of the program. A closed pipe is not an error: the reader chose to close it.
fn note(printed: io::Result<()>) {
    if let Err(error) = printed
        && error.kind() != IoErrorKind::BrokenPipe
    {
        STDOUT_ERROR.get_or_init(|| error);
    }
}

fn tell(error: &anyhow::Error) {
    eprintln!("error: {}", sentence(error));
}

/// Prints a line on stdout like `println!`, but never panics. If a line cannot be written, for instance on a full disk,
/// the program continues, and [`cli::run`](crate::cli::run) ends it with exit code 1. A closed pipe is not an error.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => { $crate::cli::say(format_args!($($text)*)) };
}

/// See [`say!`].
pub fn say(line: std::fmt::Arguments) {
    match LISTENER.get() {
        Some(listener) => listener(&line.to_string()),
        None => note(writeln!(io::stdout(), "{line}")),
    }
}

/// What takes the lines of [`say!`] instead of stdout.
static LISTENER: OnceLock<fn(&str)> = OnceLock::new();

/// Gives the lines that commands print to `listener` from now on, for a program that runs them inside itself.
pub fn send_lines_to(listener: fn(&str)) {
    LISTENER.get_or_init(|| listener);
}

/// Ends the program at once like an error of [`run`], for places that cannot return an error.
pub fn end(error: &anyhow::Error) -> ! {
    tell(error);
    std::process::exit(1)
}

/// An error with its causes, joined by ": ". Causes that a message already contains are not repeated.
pub fn sentence(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(|c| one_line(&c.to_string())) {
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What to do where no window can be opened.
pub const WITHOUT_WINDOW: &str = "use --screenshot FILE.png, which needs no display";

/// Fails if no window can be opened.
///
/// # Errors
/// An error that says so and what to do.
pub fn check_display() -> anyhow::Result<()> {
    let unix = cfg!(all(unix, not(target_vendor = "apple"), not(target_os = "android")));
    let set = |name: &str| std::env::var_os(name).is_some_and(|v| !v.is_empty());
    if unix && !["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"].into_iter().any(set) {
        anyhow::bail!("there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set); {WITHOUT_WINDOW}");
    }
    Ok(())
}

/// The name by which an option and the viewer offer a choice.
pub fn choice_name(choice: impl ValueEnum) -> String {
    choice.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

/// Parses a number of views, frames or pictures.
///
/// # Errors
/// A description of the problem with the text.
pub fn parse_count(text: &str) -> Result<u32, String> {
    const MOST: u32 = 10_000;
    let count = text.trim().parse().ok().filter(|count| (1..=MOST).contains(count));
    count.ok_or_else(|| format!("must be a whole number from 1 to {MOST}"))
}

/// Parses an image size like `640x480`.
///
/// # Errors
/// A description of the problem with the text.
pub fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let problem = || format!("must be WIDTHxHEIGHT in pixels, each from 1 to {LARGEST_EDGE}, such as 640x480");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(problem)?;
    let edge = |t: &str| t.trim().parse::<u32>().ok().filter(|v| (1..=LARGEST_EDGE).contains(v)).ok_or_else(problem);
    Ok([edge(width)?, edge(height)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_parsed_and_invalid_ones_rejected() {
        assert_eq!(parse_size("334x512"), Ok([334, 512]));
        for text in ["", "x", "12", "0x4", "4x-1", "99999x4", "4x4x4"] {
            assert!(parse_size(text).is_err(), "{text}");
        }
    }

    #[test]
    fn causes_are_printed_once_and_on_one_line() {
        let inner = anyhow::anyhow!("no such\nfile");
        let error = inner.context("avatar.ghand: cannot read: no such file").context("loading");
        assert_eq!(sentence(&error), "loading: avatar.ghand: cannot read: no such file");
    }
}
