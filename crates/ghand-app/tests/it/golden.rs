//! Pictures of the programs as they were when they were last looked at: [`ghand_test_support::golden`].
//!
//! `GHAND_UPDATE_GOLDEN=1 cargo test --workspace --test it golden` makes them anew.

use std::path::Path;

use ghand_test_support::golden;

use crate::common::run_in;

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

/// Runs `ghand` on a CPU adapter.
fn ghand(folder: &Path, arguments: &str) {
    let arguments: Vec<&str> = arguments.split(' ').collect();
    let output = run_in(GHAND, folder, &arguments, &[("GHAND_ADAPTER", "cpu")]);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn pictures_of_the_programs_look_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let avatar = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/demo-avatar/right.ghand");
    std::fs::copy(avatar, folder.path().join("demo.ghand")).unwrap();
    for (name, arguments) in [
        ("render-own-light", "render demo.ghand --pose relaxed --turntable 3 --size 160x160 --out NAME"),
        ("render-studio", "render demo.ghand --pose fist --light studio --turntable 3 --size 160x160 --out NAME"),
        (
            "render-turned-light",
            "render demo.ghand --pose victory --light-turn 120 --turntable 3 --size 160x160 --out NAME",
        ),
        ("mesh-solid", "pose --pose pinch --size 160x160 --picture NAME.png"),
        ("mesh-wireframe", "pose --pose spread --style wireframe --size 160x160 --picture NAME.png"),
        ("mesh-weights", "pose --hand-model builtin-left --style weights --size 160x160 --picture NAME.png"),
        ("scene-export", "export demo.ghand --pose point --out scene.ply"),
        ("scene", "splat scene.ply --turntable 3 --size 160x160 --out NAME"),
    ] {
        ghand(folder.path(), &arguments.replace("NAME", name));
        let made = [format!("{name}.png"), format!("{name}/frame-0000_view-01.png"), format!("{name}/view-01.png")];
        if let Some(made) = made.iter().map(|made| folder.path().join(made)).find(|made| made.exists()) {
            golden::check(name, &image::open(made).unwrap().into_rgb8());
        } else {
            assert_eq!(name, "scene-export");
        }
    }
}
