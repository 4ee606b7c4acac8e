//! How users choose the graphics adapter.

use std::path::Path;
use std::process::Output;

use crate::common::{assert_one_sentence, listing, run_in, save_avatar};
use ghand_avatar::scene_files::SplatScene;
use ghand_render::{AdapterChoice, Gpu};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");
const PROGRAMS: [(&str, &[&str]); 3] = [
    (env!("CARGO_BIN_EXE_train"), &[]),
    (env!("CARGO_BIN_EXE_viewer"), &["hand.ghand", "--screenshot", "a.png"]),
    (GHAND, &["render", "hand.ghand", "--turntable", "1", "--out", "pictures"]),
];

/// Renders a picture with `variable` as the value of the environment variable and `flag` as that of the option.
fn render(folder: &Path, variable: Option<&str>, flag: Option<&str>) -> Output {
    let mut arguments = vec!["render", "hand.ghand", "--turntable", "1", "--size", "64x64", "--out", "pictures"];
    arguments.extend(flag.iter().flat_map(|flag| ["--adapter", *flag]));
    run_in(GHAND, folder, &arguments, &[(AdapterChoice::VARIABLE, variable.unwrap_or(""))])
}

#[test]
fn the_option_overrides_the_variable_and_both_the_best_adapter() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let name = Gpu::new(&AdapterChoice::from_env()).unwrap().info.name;
    let works = |variable: Option<&str>, flag: Option<&str>| {
        let output = render(folder.path(), variable, flag);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    works(None, None);
    works(Some(&name.to_uppercase()), None);
    works(Some("nonsense"), Some(&name));
    works(Some("nonsense"), Some("best"));
    // A wrong name lists the available adapters.
    let refuses = |variable: Option<&str>, flag: Option<&str>, wrong: &str| {
        assert_one_sentence(&render(folder.path(), variable, flag), &[wrong, &name, "GHAND_ADAPTER"]);
    };
    refuses(Some("nonsense"), None, "`nonsense`");
    refuses(None, Some("rubbish"), "`rubbish`");
    refuses(Some(&name), Some("rubbish"), "`rubbish`");
    refuses(Some("nonsense"), Some("rubbish"), "`rubbish`");
    let kinds = ["cpu", "gpu"].map(|kind| render(folder.path(), None, Some(kind)));
    assert!(kinds.iter().any(|output| output.status.success()), "the adapter has neither kind");
    for (kind, output) in ["cpu", "gpu"].iter().zip(&kinds).filter(|(_, output)| !output.status.success()) {
        assert_one_sentence(output, &[&format!("of kind `{kind}`"), &name]);
    }
}

#[test]
fn a_machine_without_adapters_gets_one_sentence_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let before = listing(folder.path());
    for (program, arguments) in PROGRAMS {
        let nowhere = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|variable| (variable, "/nonexistent.json"));
        let output = run_in(program, folder.path(), arguments, &nowhere);
        if output.status.success() {
            println!("skipped: this system finds its graphics driver without Vulkan's loader");
            return;
        }
        assert_one_sentence(&output, &["no graphics adapter was found", "mesa-vulkan-drivers"]);
        assert_eq!(listing(folder.path()), before);
    }
}

#[test]
fn without_an_adapter_an_avatar_is_exported_alike() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let nowhere = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|variable| (variable, "/nonexistent.json"));
    let export = |file: &str, pose: &str, variables: &[(&str, &str)]| {
        let output = run_in(GHAND, folder.path(), &["export", "hand.ghand", "--pose", pose, "--out", file], variables);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        (SplatScene::read(&folder.path().join(file)).unwrap(), String::from_utf8(output.stdout).unwrap())
    };
    let farthest = |a: &SplatScene, b: &SplatScene| {
        assert_eq!(a.table.len(), b.table.len());
        a.table.iter().zip(&b.table).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    let (device, _) = export("device.ply", "fist", &[]);
    let (host, output) = export("host.ply", "fist", &nowhere);
    if !output.contains("no graphics adapter") {
        println!("skipped: this system finds its graphics driver without Vulkan's loader");
        return;
    }
    // Rounding, of logarithms of sizes more than of places.
    assert!(farthest(&device, &host) < 1e-4, "{}", farthest(&device, &host));
    let (other, _) = export("other.ply", "rest", &nowhere);
    assert!(farthest(&device, &other) > 1e-3);
}
