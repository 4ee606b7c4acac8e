//! Files are opened, watched and refused.

use std::path::{Path, PathBuf};

use super::*;
use crate::viewer::hand::tests::untrained_avatar;

fn viewer() -> Headless {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), SIZE, 0.6);
    ui.frame(Vec::new());
    ui
}

fn messages(ui: &Headless, part: &str) -> usize {
    ui.harness.query_all_by_label_contains(part).count()
}

/// Saves an avatar whose hand has a name.
fn save(path: &Path, name: &str) {
    let mut avatar = untrained_avatar();
    avatar.template.name = name.into();
    avatar.save(path).unwrap();
}

#[test]
fn files_of_any_kind_are_opened() {
    let folder = tempfile::tempdir().unwrap();
    let avatar = folder.path().join("a.ghand");
    save(&avatar, "anna");
    let mut ui = viewer();
    ui.open(&avatar);
    ui.frame(Vec::new());
    assert!(ui.harness.query_by_label("anna").is_some());
    let fist = pose_by_name("fist", ui.hand().model()).unwrap();
    ui.hand().pose.clone_from(&fist);
    let poses = folder.path().join("fist.json");
    std::fs::write(&poses, ui.hand().pose_json()).unwrap();
    ui.viewer().subject_mut().reset();
    ui.open(&poses);
    let off = |(a, b): (&glam::DVec3, &glam::DVec3)| a.distance(*b);
    assert!(ui.hand().pose.rotations.iter().zip(&fist.rotations).map(off).all(|off| off < 1e-12));
    let recent = ui.viewer().settings_mut().recent.clone();
    assert_eq!(recent, [poses, avatar]);
}

#[test]
fn files_are_read_beside_the_user_interface_and_shown_in_their_order() {
    let folder = tempfile::tempdir().unwrap();
    let [avatar, poses] = ["a.ghand", "fist.json"].map(|name| folder.path().join(name));
    save(&avatar, "anna");
    let mut ui = viewer();
    let before = ui.viewer().subject_mut().name();
    // The poses are for the skeleton of the avatar that is opened before them.
    let mut hand = Hand::new(Avatar::load(&avatar).unwrap());
    let fist = pose_by_name("fist", hand.model()).unwrap();
    hand.pose.clone_from(&fist);
    std::fs::write(&poses, hand.pose_json()).unwrap();
    ui.viewer().open(&avatar);
    ui.viewer().open(&poses);
    ui.harness.step();
    assert!(ui.viewer().document.is_reading());
    assert_eq!(ui.viewer().subject_mut().name(), before);
    let start = Instant::now();
    while ui.viewer().document.is_reading() {
        ui.harness.step();
        assert!(start.elapsed().as_secs() < 60, "the files are not read");
    }
    assert_eq!(ui.viewer().subject_mut().name(), "anna");
    let off = |(a, b): (&glam::DVec3, &glam::DVec3)| a.distance(*b);
    assert!(ui.hand().pose.rotations.iter().zip(&fist.rotations).map(off).all(|off| off < 1e-12));
    assert_eq!(ui.viewer().settings_mut().recent, [poses, avatar]);
}

#[test]
fn a_file_that_cannot_be_opened_changes_nothing_but_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let bad = [
        file("cut.ghand", &[40, 0, 0, 0, 0, 0, 0, 0, b'{', b'"']),
        file("empty.ply", b""),
        file("notes.txt", b"to do"),
        file("model.glb", b"glTF\x02\0\0\0"),
        file("poses.json", b"{\"frames\":[]}"),
        file("poses.npz", b"PK\x03\x04"),
        folder.path().join("absent.ghand"),
        folder.path().to_owned(),
    ];
    let mut ui = viewer();
    let before = ui.viewer().subject_mut().name();
    for path in bad {
        ui.open(&path);
        ui.frame(Vec::new());
        ui.frame(Vec::new());
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        assert!(messages(&ui, &name) > 0, "nothing is said about {name}");
        assert!(name != "notes.txt" || messages(&ui, "neither an avatar") > 0);
        assert_eq!(ui.viewer().subject_mut().name(), before);
        assert!(ui.viewer().settings_mut().recent.is_empty());
        ui.viewer().session.forget_messages();
    }
    assert!(ui.canvas().failure().is_none());
}

#[test]
fn a_file_that_changes_is_read_again_and_pose_and_view_stay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ghand");
    save(&path, "anna");
    let mut ui = viewer();
    ui.open(&path);
    ui.click("fist");
    ui.camera().orbit(DVec2::new(50.0, 10.0));
    let camera = ui.camera().clone();
    let pose = ui.hand().pose.clone();
    let settle = |ui: &mut Headless| (0..6).for_each(|_| _ = ui.frame(Vec::new()));
    settle(&mut ui);
    save(&path, "a longer name");
    settle(&mut ui);
    assert_eq!(ui.viewer().subject_mut().name(), "a longer name");
    assert_eq!((&ui.camera().clone(), &ui.hand().pose), (&camera, &pose));
    // A broken file is told once, and the hand stays.
    std::fs::write(&path, "broken").unwrap();
    settle(&mut ui);
    assert_eq!(messages(&ui, "a.ghand: "), 1);
    assert_eq!(ui.viewer().subject_mut().name(), "a longer name");
    save(&path, "mended");
    settle(&mut ui);
    assert_eq!(ui.viewer().subject_mut().name(), "mended");
    assert!(ui.viewer().document.watched() == Some(path.as_path()));
}

/// A file that is dropped onto the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        Err("only its path is needed".into())
    }
}

#[test]
fn dropped_files_are_opened() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ghand");
    save(&path, "anna");
    let mut ui = viewer();
    let file = egui::HoveredFile { path: Some(path.clone()), ..Default::default() };
    ui.harness.input_mut().hovered_files = vec![file];
    ui.frame(Vec::new());
    ui.harness.input_mut().hovered_files.clear();
    ui.harness.input_mut().dropped_files = vec![Arc::new(Dropped(path.clone()))];
    ui.frame(Vec::new());
    ui.frame(Vec::new());
    assert_eq!(ui.viewer().subject_mut().name(), "anna");
    assert_eq!(ui.viewer().settings_mut().recent, [path]);
}

#[test]
fn a_run_is_followed_from_its_first_avatar_to_its_result() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path();
    let checkpoints = folder.path().join("checkpoints");
    std::fs::create_dir(&checkpoints).unwrap();
    save(&checkpoints.join("preview.ghand"), "beginning");
    let mut ui = viewer();
    ui.open(run);
    let settle = |ui: &mut Headless| (0..8).for_each(|_| _ = ui.frame(Vec::new()));
    settle(&mut ui);
    assert_eq!(ui.viewer().subject_mut().name(), "beginning");
    assert_eq!(messages(&ui, "There are no figures yet."), 1);
    let table = "iteration,stage,seconds,l1,held_out_psnr\n25,2,3.0,0.5,\n50,2,7.5,0.25,21.5\n";
    std::fs::write(checkpoints.join("curves.csv"), table).unwrap();
    ui.click("fist");
    let pose = ui.hand().pose.clone();
    save(&checkpoints.join("preview.ghand"), "in the middle");
    settle(&mut ui);
    assert_eq!(ui.viewer().subject_mut().name(), "in the middle");
    assert_eq!(ui.hand().pose, pose);
    assert_eq!(messages(&ui, "goes on: iteration 50, stage 2, 8 s"), 1);
    assert_eq!(messages(&ui, "Loss (L1): 0.2500 after 50 iterations"), 1);
    assert_eq!(messages(&ui, "Images held out: 21.50 dB"), 1);
    assert_eq!(messages(&ui, "was read again"), 0, "it says so all the time");
    // The result takes the place of what was shown.
    save(&run.join("avatar.ghand"), "trained");
    std::fs::remove_dir_all(&checkpoints).unwrap();
    std::fs::write(run.join("curves.csv"), table).unwrap();
    std::fs::write(run.join("metrics.json"), "{}").unwrap();
    settle(&mut ui);
    assert_eq!(ui.viewer().subject_mut().name(), "trained");
    assert_eq!(ui.hand().pose, pose);
    assert_eq!(messages(&ui, "has ended: iteration 50"), 1);
    // Another file has no run.
    let other = folder.path().join("other.ghand");
    save(&other, "other");
    ui.open(&other);
    settle(&mut ui);
    assert_eq!(messages(&ui, "has ended"), 0);
}
