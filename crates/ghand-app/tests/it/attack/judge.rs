//! Judges how a command has ended.

use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::cases::Case;

/// Every case takes a second or two; the machine may be busy.
const MOST_TIME: Duration = Duration::from_secs(60);

/// How a command ended.
pub struct Outcome {
    /// The exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// Its output on stderr.
    pub stderr: String,
    /// Whether it ended by itself.
    pub in_time: bool,
}

/// Runs the command of a case in its folder.
pub fn run(case: &Case) -> Outcome {
    let folder = case.folder.path();
    let mut command = Command::new(&case.command[0]);
    command.args(&case.command[1..]).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::null());
    for variable in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET", "RUST_LOG"] {
        command.env_remove(variable);
    }
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let mut pipe = child.stderr.take().unwrap();
    let reader = std::thread::spawn(move || {
        let mut text = vec![];
        pipe.read_to_end(&mut text).map(|_| String::from_utf8_lossy(&text).into_owned()).unwrap_or_default()
    });
    let start = Instant::now();
    let mut in_time = true;
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > MOST_TIME {
            in_time = false;
            child.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    Outcome { code: status.code(), stderr: reader.join().unwrap(), in_time }
}

/// Words of parsers and of Rust, which mean nothing to users.
const JARGON: [&str; 15] = [
    "panicked",
    "RUST_BACKTRACE",
    "invalid type: ",
    "invalid value: ",
    "invalid digit",
    "expected u64",
    "expected u32",
    "expected f64",
    "usize",
    "expected a string",
    "expected struct",
    "missing field",
    "Os {",
    "Error(",
    "called `Option::unwrap",
];

/// Whether a command ended as required; otherwise the problem.
pub fn judge(case: &Case, outcome: &Outcome) -> Result<(), String> {
    if !outcome.in_time {
        return Err(format!("was not finished after {} s", MOST_TIME.as_secs()));
    }
    let lines: Vec<&str> = outcome.stderr.lines().filter(|line| !line.trim().is_empty()).collect();
    let errors = lines.iter().filter(|line| line.starts_with("error: ")).count();
    // Warnings are the logger's and begin with a bracket.
    if let Some(line) = lines.iter().find(|line| !line.starts_with("error: ") && !line.starts_with('[')) {
        return Err(format!("prints a line that is neither a warning nor an error: {line}"));
    }
    match outcome.code {
        Some(0) if errors == 0 => {}
        Some(1) if errors == 1 => {}
        Some(code) => return Err(format!("exit code {code} with {errors} errors")),
        None => return Err("was ended by a signal".into()),
    }
    if let Some(word) = JARGON.iter().find(|word| outcome.stderr.contains(**word)) {
        return Err(format!("contains {word:?}"));
    }
    if let Some(litter) = litter(case.folder.path()) {
        return Err(format!("leaves {litter} behind"));
    }
    for (path, before) in &case.kept {
        if std::fs::read(case.folder.path().join(path)).ok().as_deref() != Some(before) {
            return Err(format!("changes {path}"));
        }
    }
    match &case.output {
        Some(output) => check_output(&case.folder.path().join(output), outcome.code == Some(0)),
        None => Ok(()),
    }
}

/// A temporary file that was not removed.
fn litter(folder: &Path) -> Option<String> {
    std::fs::read_dir(folder).ok()?.flatten().find_map(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with(".writing-") { Some(name) } else { litter(&entry.path()) }
    })
}

/// The output must be complete if the command succeeded, and must not exist otherwise.
fn check_output(path: &Path, succeeded: bool) -> Result<(), String> {
    let name = path.display();
    if !succeeded {
        return if path.exists() { Err(format!("failed, but left {name}")) } else { Ok(()) };
    }
    let bytes = std::fs::read(path).map_err(|error| format!("{name}: {error}"))?;
    let is_whole = match path.extension().and_then(|e| e.to_str()) {
        Some("png") => image::load_from_memory(&bytes).is_ok_and(|picture| picture.width() > 0),
        Some("json") => serde_json::from_slice::<serde_json::Value>(&bytes).is_ok_and(|value| all_finite(&value)),
        Some("obj") => {
            let text = String::from_utf8_lossy(&bytes);
            text.contains("\nv ") && !text.contains("NaN") && !text.contains("inf")
        }
        _ => !bytes.is_empty(),
    };
    if is_whole { Ok(()) } else { Err(format!("{name} is not complete")) }
}

/// Infinite numbers are `null` in JSON.
fn all_finite(value: &serde_json::Value) -> bool {
    match value {
        serde_json::Value::Array(list) => list.iter().all(|v| !v.is_null() && all_finite(v)),
        serde_json::Value::Object(map) => map.values().all(all_finite),
        _ => true,
    }
}
