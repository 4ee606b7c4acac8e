//! Access to the project's WGSL without a device.

use std::path::{Path, PathBuf};

use ghand_render::shader_sources::SHADERS;
use naga::valid::{Capabilities, ValidationFlags, Validator};

/// Every composed WGSL source, with its name and whether it needs subgroups.
pub fn sources() -> Vec<(&'static str, bool, &'static str)> {
    SHADERS.iter().map(|shader| (shader.name, shader.needs_subgroups(), shader.source)).collect()
}

/// Parses a source and validates it against the features of every WebGPU device, or with subgroups.
///
/// # Errors
/// The compiler's message with the location in the source, and file and line of the enclosing declaration.
pub fn validate(subgroups: bool, source: &str) -> Result<naga::Module, String> {
    let at =
        |message: String, location: Option<naga::SourceLocation>| match location.and_then(|l| declared_at(source, l)) {
            Some(place) => format!("{place}: {message}"),
            None => message,
        };
    let module = naga::front::wgsl::parse_str(source).map_err(|e| at(e.emit_to_string(source), e.location(source)))?;
    let capabilities = if subgroups { Capabilities::SUBGROUP } else { Capabilities::empty() };
    let mut validator = Validator::new(ValidationFlags::all(), capabilities);
    validator.validate(&module).map_err(|e| at(e.emit_to_string(source), e.location(source)))?;
    Ok(module)
}

/// The declaration that a line of WGSL begins, such as `fn skin`.
fn declaration(line: &str) -> Option<String> {
    let mut words = line.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty());
    match words.next()? {
        word @ ("fn" | "struct") => Some(format!("{word} {}", words.next()?)),
        _ => None,
    }
}

/// File and line in `shaders/` of the declaration around a location in a composed source, whose line numbers differ.
fn declared_at(source: &str, place: naga::SourceLocation) -> Option<String> {
    let lines: Vec<&str> = source.lines().take(place.line_number as usize).collect();
    let wanted = lines.iter().rev().find_map(|line| declaration(line))?;
    let root = shader_folder();
    wgsl_files(&root).into_iter().find_map(|file| {
        let text = std::fs::read_to_string(&file).ok()?;
        let line = text.lines().position(|line| declaration(line).as_ref() == Some(&wanted))?;
        Some(format!("shaders/{}:{}, {wanted}", file.strip_prefix(&root).ok()?.display(), line + 1))
    })
}

/// The folder of the WGSL files.
pub fn shader_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../shaders")
}

/// All WGSL files below a folder.
///
/// # Panics
/// Panics if the folder cannot be read.
pub fn wgsl_files(folder: &Path) -> Vec<PathBuf> {
    files(folder, "wgsl")
}

/// All files below a folder with this extension.
///
/// # Panics
/// Panics if the folder cannot be read.
pub fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.unwrap_or_else(|e| panic!("{}: {e}", folder.display())).path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
    found
}
