//! Presets from fast to exact.

use std::path::Path;
use std::time::{Duration, Instant};

use ghand_avatar::PropertyTables;

use super::*;
use crate::lighting::Lighting;
use crate::quality::{Quality, playback};
use crate::viewer::command::CommandId;
use crate::viewer::hand::Look;

fn is_baked(ui: &mut Headless) -> bool {
    matches!(ui.hand().look(), Look::Avatar(avatar) if matches!(avatar.tables, PropertyTables::Baked(_)))
}

/// A viewer of an avatar's file.
fn viewer(path: &Path) -> Headless {
    let mut ui = Headless::new(Subject::read(path, &Lighting::default()).unwrap(), SIZE, 1.0);
    ui.viewer().watch(path, &Lighting::default());
    ui
}

/// Runs a command that prepares the avatar, and frames until it has.
fn choose(ui: &mut Headless, id: CommandId) {
    let context = ui.harness.ctx.clone();
    ui.viewer().run(id, &context);
    assert!(ui.viewer().quality.is_busy());
    let start = Instant::now();
    while ui.viewer().quality.is_busy() {
        assert!(start.elapsed() < Duration::from_secs(120), "the avatar is not baked");
        std::thread::sleep(Duration::from_millis(20));
        ui.frame(Vec::new());
    }
}

#[test]
fn an_avatar_is_played_in_a_preset_and_exactly_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ghand");
    let hand = small_hand();
    let Look::Avatar(avatar) = hand.look() else { panic!("no avatar") };
    avatar.save(&path).unwrap();
    let mut ui = viewer(&path);
    let gpu = ui.viewer().gpu.clone();
    let fast = playback(&gpu, Quality::Fast).unwrap();
    ui.hand().take_pose("fist");
    ui.frame(Vec::new());

    choose(&mut ui, CommandId::PlayFast);
    let pose = ui.hand().pose.clone();
    assert_eq!(ui.viewer().quality.chosen(), Quality::Fast);
    assert_eq!((is_baked(&mut ui), ui.viewer().quality.image_scale()), (fast.kept.is_some(), fast.image_scale as f32));
    assert!(pose != ghand_core::Pose::rest(pose.rotations.len()), "the pose stays");
    // The baked avatar is beside the other, for the next time.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1 + usize::from(fast.kept.is_some()));

    choose(&mut ui, CommandId::PlayExact);
    assert_eq!((is_baked(&mut ui), ui.viewer().quality.image_scale()), (false, 1.0));
    assert_eq!(ui.hand().pose, pose);

    // An avatar that cannot be read leaves everything as it was.
    std::fs::write(&path, "no avatar").unwrap();
    choose(&mut ui, CommandId::PlayFast);
    assert_eq!((is_baked(&mut ui), ui.viewer().quality.chosen()), (false, Quality::Exact));

    avatar.save(&path).unwrap();
    let mut ui = viewer(&path);
    choose(&mut ui, CommandId::PlayFast);
    std::fs::write(&path, "no avatar").unwrap();
    choose(&mut ui, CommandId::PlayExact);
    assert_eq!((is_baked(&mut ui), ui.viewer().quality.chosen()), (fast.kept.is_some(), Quality::Fast));
}

#[test]
fn an_avatar_opened_while_another_is_prepared_is_the_one_shown() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["a.ghand", "b.ghand"].map(|name| folder.path().join(name));
    let hand = small_hand();
    let Look::Avatar(avatar) = hand.look() else { panic!("no avatar") };
    avatar.save(&first).unwrap();
    let mut other = avatar.as_ref().clone();
    other.template.name = "anna".into();
    other.save(&second).unwrap();
    let mut ui = viewer(&first);

    let context = ui.harness.ctx.clone();
    ui.viewer().run(CommandId::PlayFast, &context);
    let start = Instant::now();
    // The baked avatar is the folder's third file; it is offered to the viewer just after it was written.
    while std::fs::read_dir(folder.path()).unwrap().count() < 3 && start.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(500));
    ui.viewer().open(&second);
    for _ in 0..4 {
        ui.frame(Vec::new());
    }
    assert!(!ui.viewer().quality.is_busy());
    assert_eq!((ui.viewer().subject.name().as_str(), ui.viewer().quality.chosen()), ("anna", Quality::Exact));
    assert!(!is_baked(&mut ui));
}
