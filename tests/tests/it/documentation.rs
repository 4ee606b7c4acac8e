//! Pages of `docs/` that are generated from the code.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;

use ghand_train::TrainSettings;

/// The table of settings, with the defaults.
fn settings_table() -> String {
    let row = |setting: ghand_train::DescribedSetting| {
        let value = setting.value.trim_matches('"').to_owned();
        let value = if setting.value.starts_with('"') { format!("`{value}`") } else { value };
        format!("| `{}` | {value} | {} |\n", setting.name, setting.meaning)
    };
    let rows: String = TrainSettings::default().described().into_iter().map(row).collect();
    format!("| setting | default | meaning |\n|---|---|---|\n{rows}")
}

/// Replaces what stands between two markers of a page.
fn with_table(page: &str, table: &str) -> String {
    let (begin, end) = ("<!-- generated: settings -->\n", "<!-- end -->\n");
    let (before, rest) = page.split_once(begin).unwrap();
    let (_, after) = rest.split_once(end).unwrap();
    format!("{before}{begin}{table}{end}{after}")
}

/// `GHAND_WRITE_DOCS=1 cargo test --workspace --test it documentation` writes the page.
#[test]
fn the_page_of_settings_is_generated() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/settings.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let generated = with_table(&page, &settings_table());
    if std::env::var_os("GHAND_WRITE_DOCS").is_some() {
        std::fs::write(&path, &generated).unwrap();
    } else {
        assert!(page == generated, "docs/settings.md is not of this code; run with GHAND_WRITE_DOCS=1");
    }
    // Every setting has a meaning, and none breaks the table.
    for setting in TrainSettings::default().described() {
        assert!(setting.meaning.len() > 10 && !setting.meaning.contains('|'), "{setting:?}");
    }
}

#[test]
fn another_table_is_found() {
    let page = "a\n<!-- generated: settings -->\nold\n<!-- end -->\nb\n";
    assert_eq!(with_table(page, "new\n"), page.replace("old", "new"));
}
