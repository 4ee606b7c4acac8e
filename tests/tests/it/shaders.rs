//! Every shader compiles, and every shader file is used.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use ghand_render::shader_sources::{SHADERS, Shader};
use ghand_tests::shaders::{files, shader_folder, sources, validate, wgsl_files};

#[test]
fn every_source_is_valid_on_every_device_that_runs_it() {
    for (name, subgroups, source) in sources() {
        if let Err(message) = validate(subgroups, source) {
            panic!("{name}: {message}");
        }
    }
}

#[test]
fn a_source_that_does_not_parse_is_rejected() {
    assert!(validate(true, "fn broken( {").is_err());
}

#[test]
fn a_source_that_parses_but_is_invalid_is_rejected() {
    // A uniform buffer cannot contain a runtime-sized array: only validation detects it.
    let source = "@group(0) @binding(0) var<uniform> a: array<f32>;";
    assert!(naga::front::wgsl::parse_str(source).is_ok());
    assert!(validate(true, source).is_err());
}

#[test]
fn subgroup_operations_are_rejected_where_there_are_none() {
    let source = "@compute @workgroup_size(8) fn f() { let a = subgroupAdd(1u); }";
    assert!(validate(false, source).is_err() && validate(true, source).is_ok());
}

#[test]
fn names_and_entry_points_are_unique_apart_from_variants() {
    let mut names = BTreeSet::new();
    let mut entries = BTreeSet::new();
    for (name, subgroups, source) in sources() {
        assert!(names.insert(name), "two sources are called {name}");
        for entry in validate(subgroups, source).unwrap().entry_points {
            let is_new = entries.insert((subgroups, name.ends_with("_by_blocks"), entry.name.clone()));
            assert!(is_new, "{name}: another source has the entry point {}", entry.name);
        }
    }
}

#[test]
fn stages_with_subgroups_have_the_entry_points_of_those_they_replace() {
    for shader in SHADERS.iter().filter(|shader| shader.needs_subgroups()) {
        let Some(replaced) = SHADERS.iter().find(|other| shader.name.ends_with(&format!("/{}", other.name))) else {
            assert_eq!(shader.name, "subgroups/subgroup_size");
            continue;
        };
        let names = |shader: &Shader| shader.entries.iter().map(|entry| entry.name).collect::<Vec<_>>();
        assert_eq!(names(shader), names(replaced), "{}", shader.name);
    }
    assert!(SHADERS.iter().filter(|shader| shader.needs_subgroups()).count() >= 5);
}

#[test]
fn every_shared_piece_is_imported_and_every_stage_has_host_code() {
    let folder = shader_folder();
    let read = |path: &PathBuf| std::fs::read_to_string(path).unwrap();
    let shaders: String = wgsl_files(&folder).iter().map(read).collect();
    let host: String = files(&folder.join("../crates"), "rs").iter().map(read).collect();
    let unused = unused_files(&folder, &shaders, &host);
    assert!(unused.is_empty(), "nothing uses {unused:?}");
    // Without any text, the search reports every file.
    assert!(unused_files(&folder, "", "").len() == wgsl_files(&folder).len());
}

/// Shared pieces that `shaders` does not import, and stages that `host` does not name.
fn unused_files(folder: &Path, shaders: &str, host: &str) -> Vec<String> {
    let name = |file: &PathBuf| file.strip_prefix(folder).unwrap().with_extension("").to_string_lossy().into_owned();
    let is_used = |name: &str| match name.strip_prefix("shared/") {
        Some(piece) => shaders.contains(&format!("package::shared::{piece}::")),
        None => host.contains(&format!("\"{name}\"")),
    };
    wgsl_files(folder).iter().map(name).filter(|name| !is_used(name)).collect()
}

#[test]
fn an_error_names_the_file_and_line_of_its_function() {
    let (_, subgroups, source) = sources().into_iter().find(|(name, ..)| *name == "project").unwrap();
    let broken = source.replacen("let xx = q.x * d.x;", "let xx = q.x * d.xyzz;", 1);
    assert_ne!(broken, source, "the line to break does not exist");
    let message = validate(subgroups, &broken).unwrap_err();
    let file = std::fs::read_to_string(shader_folder().join("shared/gaussian.wgsl")).unwrap();
    let line = file.lines().position(|line| line.starts_with("fn axes_of")).unwrap() + 1;
    assert!(message.starts_with(&format!("shaders/shared/gaussian.wgsl:{line}, fn axes_of: ")), "{message}");
}
