//! Composes the WGSL of every stage: each file in `shaders/` and `shaders/subgroups/` with what it imports from
//! `shaders/shared/` (WESL imports). A file in `shaders/` with `@if(subgroups)` is composed twice. Lists the entry
//! points, and writes them with their bindings as Rust types, see `src/stages.rs`. An import that does not exist, and
//! WGSL that is invalid, fails the build and names file and line.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use naga::valid::{Capabilities, GlobalUse, ModuleInfo, ValidationFlags, Validator};
use naga::{GlobalVariable, Module, ShaderStage, TypeInner};
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
    let mut programs = Programs::new();
    for (name, source) in composed {
        let in_file = |error: String| format!("shaders/{name}.wgsl: {error}");
        let (module, info) = parse(&source).map_err(in_file)?;
        collect_programs(&mut programs, &name, &module, &info).map_err(in_file)?;
        let entries = entries(&module, &info)?;
        let file = out.join(format!("{}.wgsl", name.replace('/', "_")));
        fs::write(&file, source)?;
        let path = file.display().to_string();
        writeln!(table, "    Shader {{ name: {name:?}, source: include_str!({path:?}), entries: &[{entries}] }},")?;
    }
    table.push(']');
    fs::write(out.join("shaders.rs"), table)?;
    let types: Result<String, _> = programs.iter().map(|(key, program)| rust_types(key, program)).collect();
    fs::write(out.join("stages.rs"), types?)?;
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
    // Names are unique in the project and not mangled: the Rust types have them, too.
    compiler.set_mangler(ManglerKind::None).set_feature("subgroups", subgroups);
    let path: ModulePath = format!("package::{}", name.replace('/', "::")).parse()?;
    let composed = compiler.compile(&path).map_err(|error| format!("shaders/{name}.wgsl: {error}"))?;
    Ok(composed.to_string())
}

fn parse(source: &str) -> Result<(Module, ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let mut validator = Validator::new(ValidationFlags::empty(), Capabilities::all());
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(source))?;
    Ok((module, info))
}

/// The variables that an entry point binds, with their numbers and with what it does to them.
fn bound<'a>(
    module: &'a Module,
    info: &'a ModuleInfo,
    entry: usize,
) -> impl Iterator<Item = (u32, &'a GlobalVariable, GlobalUse)> {
    let uses = info.get_entry_point(entry);
    let variables = module.global_variables.iter();
    variables.filter_map(move |(handle, v)| Some((v.binding?.binding, v, uses[handle]))).filter(|(.., u)| !u.is_empty())
}

/// The entry points of a composed source, as Rust values.
fn entries(module: &Module, info: &ModuleInfo) -> Result<String, std::fmt::Error> {
    let mut entries = String::new();
    for (index, entry) in module.entry_points.iter().enumerate() {
        let bindings: Vec<u32> = bound(module, info, index).map(|(number, ..)| number).collect();
        let name = &entry.name;
        let workgroup = entry.workgroup_size;
        write!(entries, "Entry {{ name: {name:?}, workgroup: {workgroup:?}, bindings: &{bindings:?} }}, ")?;
    }
    Ok(entries)
}

/// Trait and name of each program: compute entry points by their names, since variants have the same; the other entry
/// points of a shader together, by the shader's name, since a pipeline has several.
type Programs = BTreeMap<(&'static str, String), Program>;

#[derive(Default)]
struct Program {
    files: Vec<String>,
    /// By number.
    bindings: BTreeMap<u32, Binding>,
}

struct Binding {
    name: String,
    kind: Kind,
    used: GlobalUse,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Buffer,
    Texture,
    Sampler,
}

/// Adds a shader's programs. Where variants of an entry point bind the same number, they must bind the same there.
fn collect_programs(programs: &mut Programs, shader: &str, module: &Module, info: &ModuleInfo) -> Result<(), String> {
    for (index, entry) in module.entry_points.iter().enumerate() {
        let key = match entry.stage {
            ShaderStage::Compute => ("ComputeEntry", entry.name.clone()),
            _ => ("RenderShader", shader.to_owned()),
        };
        let program = programs.entry(key).or_default();
        let file = format!("`{shader}.wgsl`");
        if !program.files.contains(&file) {
            program.files.push(file);
        }
        for (number, variable, used) in bound(module, info, index) {
            let name = variable.name.clone().unwrap_or_default();
            let kind = match module.types[variable.ty].inner {
                TypeInner::Image { .. } => Kind::Texture,
                TypeInner::Sampler { .. } => Kind::Sampler,
                _ => Kind::Buffer,
            };
            let binding = program.bindings.entry(number).or_insert(Binding {
                name: name.clone(),
                kind,
                used: GlobalUse::empty(),
            });
            if (&binding.name, binding.kind) != (&name, kind) {
                let entry = &entry.name;
                let other = &binding.name;
                return Err(format!("`{entry}` binds `{name}` as number {number}, but a variant binds `{other}`"));
            }
            binding.used |= used;
        }
    }
    Ok(())
}

/// A marker type, and a struct with a field for each binding.
fn rust_types((role, name): &(&'static str, String), program: &Program) -> Result<String, std::fmt::Error> {
    let marker: String = name.split('_').map(capitalized).collect();
    let files = program.files.join(", ");
    let mut fields = String::new();
    let mut entries = String::new();
    for (number, Binding { name, kind, used }) in &program.bindings {
        let (rust_type, resource) = match kind {
            Kind::Buffer => ("Buffer", format!("self.{name}.as_entire_binding()")),
            Kind::Texture => ("TextureView", format!("wgpu::BindingResource::TextureView(self.{name})")),
            Kind::Sampler => ("Sampler", format!("wgpu::BindingResource::Sampler(self.{name})")),
        };
        let access = match (used.intersects(!GlobalUse::WRITE), used.intersects(GlobalUse::WRITE | GlobalUse::ATOMIC)) {
            (true, true) => "read and written",
            (false, true) => "written",
            _ => "read",
        };
        writeln!(fields, "    /// `{name}`, {access}.\n    pub {name}: &'a wgpu::{rust_type},")?;
        writeln!(entries, "            wgpu::BindGroupEntry {{ binding: {number}, resource: {resource} }},")?;
    }
    Ok(format!(
        "/// `{name}` in {files}.
#[derive(Debug, Clone, Copy)]
pub struct {marker};

/// What [`{marker}`] binds.
#[derive(Debug, Clone, Copy)]
pub struct {marker}Bindings<'a> {{
{fields}}}

impl {role} for {marker} {{
    const NAME: &'static str = {name:?};
    type Bindings<'a> = {marker}Bindings<'a>;
}}

impl Bindings for {marker}Bindings<'_> {{
    fn entries(&self) -> Vec<wgpu::BindGroupEntry<'_>> {{
        vec![
{entries}        ]
    }}
}}

"
    ))
}

fn capitalized(word: &str) -> String {
    let (first, rest) = word.split_at(word.len().min(1));
    first.to_uppercase() + rest
}
