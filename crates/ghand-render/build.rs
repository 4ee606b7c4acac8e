//! Composes the WGSL of every stage: each file in `shaders/` and `shaders/subgroups/` with what it imports from
//! `shaders/shared/` (WESL imports). A file in `shaders/` with `@if(subgroups)` is composed twice. Lists the entry points with their bindings. An import that does not exist, and
//! WGSL that is invalid, fails the build and names file and line.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use naga::valid::{Capabilities, ValidationFlags, Validator};
use wesl::{ManglerKind, ModulePath, Wesl};

fn main() {
    if let Err(error) = write_sources() {
        eprintln!("{error}");
        std::process::exit(1);
    }
}

fn write_sources() -> Result<(), Box<dyn Error>> {
    // When it runs, not when it was compiled: checkouts can share a build folder.
    let package = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?);
    // In the package, a folder; in the checkout, a link to the folder at the top, or where there are no links, a file.
    let linked = package.join("shaders");
    let shaders = if linked.is_dir() { linked } else { package.join("../../shaders") };
    println!("cargo::rerun-if-changed={}", shaders.display());
    let out = PathBuf::from(env::var("OUT_DIR")?);
    let mut table = String::from("&[\n");
    let mut composed = Vec::new();
    for stage in stages(&shaders)? {
        let text = fs::read_to_string(shaders.join(&stage).with_extension("wgsl"))?;
        if text.contains("@if(subgroups)") {
            composed.push((format!("subgroups/{stage}"), compose(&shaders, &stage, true)?));
        }
        composed.push((stage.clone(), compose(&shaders, &stage, false)?));
    }
    for stage in stages(&shaders.join("subgroups"))? {
        let stage = format!("subgroups/{stage}");
        composed.push((stage.clone(), compose(&shaders, &stage, true)?));
    }
    for (name, source) in composed {
        let file = out.join(format!("{}.wgsl", name.replace('/', "_")));
        let entries = entries(&source).map_err(|error| format!("shaders/{name}.wgsl: {error}"))?;
        fs::write(&file, source)?;
        let path = file.display().to_string();
        writeln!(table, "    Shader {{ name: {name:?}, source: include_str!({path:?}), entries: &[{entries}] }},")?;
    }
    table.push(']');
    fs::write(out.join("shaders.rs"), table)?;
    Ok(())
}

/// Names of the stages in a folder, sorted.
fn stages(folder: &Path) -> Result<Vec<String>, Box<dyn Error>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if let (Some("wgsl"), Some(stem)) = (path.extension().and_then(|e| e.to_str()), path.file_stem()) {
            names.push(stem.to_string_lossy().into_owned());
        }
    }
    names.sort();
    Ok(names)
}

fn compose(shaders: &Path, name: &str, subgroups: bool) -> Result<String, Box<dyn Error>> {
    let mut compiler = Wesl::new(shaders);
    // Names are unique in the project and not mangled: host code finds buffers and structs by them.
    compiler.set_mangler(ManglerKind::None).set_feature("subgroups", subgroups);
    let path: ModulePath = format!("package::{}", name.replace('/', "::")).parse()?;
    let composed = compiler.compile(&path).map_err(|error| format!("shaders/{name}.wgsl: {error}"))?;
    Ok(composed.to_string())
}

/// The entry points of a composed source, as Rust.
fn entries(source: &str) -> Result<String, Box<dyn Error>> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let mut validator = Validator::new(ValidationFlags::empty(), Capabilities::all());
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(source))?;
    let mut entries = String::new();
    for (index, entry) in module.entry_points.iter().enumerate() {
        let uses = info.get_entry_point(index);
        let used = module.global_variables.iter().filter(|(handle, _)| !uses[*handle].is_empty());
        let bindings: Vec<_> = used.filter_map(|(_, v)| Some((v.name.clone()?, v.binding?.binding))).collect();
        let (name, workgroup) = (&entry.name, entry.workgroup_size);
        write!(entries, "Entry {{ name: {name:?}, workgroup: {workgroup:?}, bindings: &{bindings:?} }}, ")?;
    }
    Ok(entries)
}
