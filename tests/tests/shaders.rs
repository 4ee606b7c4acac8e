//! Every shader compiles, and every shader file is used.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use ghand_render::Tier;
use ghand_tests::shaders::{sources, validate};

#[test]
fn every_source_is_valid_on_every_device_of_its_tier() {
    for (name, tier, source) in sources() {
        if let Err(message) = validate(tier, &source) {
            panic!("{name}: {message}");
        }
    }
}

#[test]
fn a_source_that_does_not_parse_is_rejected() {
    assert!(validate(Tier::Fast, "fn broken( {").is_err());
}

#[test]
fn a_source_that_parses_but_is_invalid_is_rejected() {
    // A uniform buffer cannot hold a runtime-sized array: only validation sees that.
    let source = "@group(0) @binding(0) var<uniform> a: array<f32>;";
    assert!(naga::front::wgsl::parse_str(source).is_ok());
    assert!(validate(Tier::Fast, source).is_err());
}

#[test]
fn subgroup_operations_are_rejected_on_the_baseline_tier() {
    let source = "@compute @workgroup_size(8) fn f() { let a = subgroupAdd(1u); }";
    assert!(validate(Tier::Baseline, source).is_err() && validate(Tier::Fast, source).is_ok());
}

#[test]
fn names_and_entry_points_are_unique_in_their_tier() {
    let (mut names, mut entries) = (BTreeSet::new(), BTreeSet::new());
    for (name, tier, source) in sources() {
        assert!(names.insert(name), "two sources are called {name}");
        for entry in validate(tier, &source).unwrap().entry_points {
            let is_new = entries.insert((tier, entry.name.clone()));
            assert!(is_new, "{name}: another source has the entry point {}", entry.name);
        }
    }
}

#[test]
fn what_the_fast_tier_replaces_has_the_same_entry_points() {
    let entries = |wanted: Tier| -> BTreeSet<String> {
        let of_tier = sources().into_iter().filter(|(_, tier, _)| *tier == wanted);
        of_tier.flat_map(|(_, tier, source)| validate(tier, &source).unwrap().entry_points).map(|e| e.name).collect()
    };
    let (baseline, fast) = (entries(Tier::Baseline), entries(Tier::Fast));
    assert!(fast.len() >= 7 && fast.is_subset(&baseline), "{fast:?}");
}

#[test]
fn every_shader_file_is_part_of_a_source() {
    let sources = sources();
    let files = wgsl_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../shaders"));
    assert!(!files.is_empty(), "no shaders were found");
    let unused: Vec<_> = files.iter().filter(|f| !is_used(&std::fs::read_to_string(f).unwrap(), &sources)).collect();
    assert!(unused.is_empty(), "no source contains {unused:?}");
}

#[test]
fn a_shader_file_that_no_source_contains_is_noticed() {
    assert!(!is_used("fn nobody_composes_this() {}", &sources()));
}

fn is_used(text: &str, sources: &[(&str, Tier, String)]) -> bool {
    sources.iter().any(|(_, _, source)| source.contains(text))
}

fn wgsl_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.unwrap_or_else(|e| panic!("{}: {e}", folder.display())).path();
        if path.is_dir() {
            files.extend(wgsl_files(&path));
        } else if path.extension().is_some_and(|e| e == "wgsl") {
            files.push(path);
        }
    }
    files
}
