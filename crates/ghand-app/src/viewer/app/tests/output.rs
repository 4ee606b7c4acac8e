//! Pictures and films that are saved beside the user interface.

use std::path::Path;

use super::*;
use crate::viewer::dialogs::output_dialog::{OutputDialog, OutputKind, SERIES};

impl Headless {
    /// Saves what was asked for and runs the user interface until it is done. Returns how many frames that took.
    fn save(&mut self, asked: &OutputDialog, path: &Path) -> usize {
        let context = self.harness.ctx.clone();
        self.viewer().save_output(asked, path, &context).unwrap();
        let start = Instant::now();
        let mut frames = 0;
        while self.viewer().output.is_some() {
            self.frame(Vec::new());
            frames += 1;
            assert!(start.elapsed().as_secs() < 120, "it is not done");
        }
        frames
    }
}

fn viewer() -> Headless {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), SIZE, 0.1);
    (0..3).for_each(|_| _ = ui.frame(Vec::new()));
    ui
}

#[test]
fn the_view_is_saved_as_a_picture_of_any_size_also_transparent() {
    let mut ui = viewer();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("view.png");
    let mut asked = OutputDialog::new(OutputKind::Picture, [300, 170]);
    ui.save(&asked, &path);
    let opaque = image::open(&path).unwrap();
    assert_eq!((opaque.width(), opaque.height(), opaque.color().has_alpha()), (300, 170, false));
    assert_eq!(opaque.to_rgb8().get_pixel(0, 0).0, crate::viewer::stage::DARK_BACKGROUND);
    // An ending is added.
    asked.transparent = true;
    ui.save(&asked, &folder.path().join("clear"));
    let clear = image::open(folder.path().join("clear.png")).unwrap().to_rgba8();
    assert_eq!(clear.get_pixel(0, 0).0, [0; 4]);
    // An EXR has the light of the same picture.
    (asked.picture, asked.transparent) = ("exr", false);
    ui.save(&asked, &folder.path().join("light"));
    let light = image::open(folder.path().join("light.exr")).unwrap();
    assert_eq!(light.color(), image::ColorType::Rgba32F);
    let encode = |v: f32| if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    for (linear, byte) in light.to_rgb32f().pixels().zip(opaque.to_rgb8().pixels()) {
        for (linear, byte) in linear.0.iter().zip(byte.0) {
            assert!((encode(*linear) - f32::from(byte) / 255.0).abs() < 0.51 / 255.0, "{linear} {byte}");
        }
    }
    let model = ui.hand().model();
    let [wrist, knuckle] = ["wrist", "middle1"].map(|name| model.joints[model.joint_index(name).unwrap()]);
    let camera = ui.camera().camera([300, 170]);
    let middle = camera.project(0.5 * (wrist + knuckle)).0;
    assert!(clear.get_pixel(middle.x as u32, middle.y as u32).0[3] > 250);
}

#[test]
fn a_turn_and_the_motion_are_saved_as_films_while_the_view_can_be_used() {
    let mut ui = viewer();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("turn.gif");
    let frames = ui.save(&OutputDialog::new(OutputKind::Turntable, [40, 30]), &path);
    assert!(frames > 2, "the user interface stood still");
    let pictures = |path: &Path| {
        let mut decoder = gif::DecodeOptions::new().read_info(std::fs::File::open(path).unwrap()).unwrap();
        std::iter::from_fn(|| decoder.next_frame_info().unwrap().map(|_| ())).count()
    };
    assert_eq!(pictures(&path), 120);
    ui.hand().play("grasp");
    ui.hand().pause();
    ui.hand().timeline.as_mut().unwrap().set_range([0.2, 0.5]);
    let path = folder.path().join("grasp.gif");
    ui.save(&OutputDialog::new(OutputKind::Motion, [40, 30]), &path);
    assert_eq!(pictures(&path), 10, "only what repeats");
    // Its pictures one by one.
    let folder = folder.path().join("grasp.v1");
    let mut asked = OutputDialog::new(OutputKind::Motion, [40, 30]);
    asked.film = SERIES;
    ui.save(&asked, &folder);
    let is_png = |file: &Path| file.extension().is_some_and(|ending| ending == "png");
    assert_eq!(std::fs::read_dir(&folder).unwrap().filter(|file| is_png(&file.as_ref().unwrap().path())).count(), 10);
}

#[test]
fn a_film_that_is_stopped_leaves_no_file() {
    let mut ui = viewer();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("turn.gif");
    let context = ui.harness.ctx.clone();
    let asked = OutputDialog::new(OutputKind::Turntable, [200, 150]);
    ui.viewer().save_output(&asked, &path, &context).unwrap();
    (0..2).for_each(|_| _ = ui.frame(Vec::new()));
    ui.click("Stop");
    assert!(ui.viewer().output.is_none());
    std::thread::sleep(std::time::Duration::from_secs(1));
    assert!(!path.exists());
    // A name that ends otherwise gets the ending.
    ui.viewer().save_output(&asked, &folder.path().join("film.v2"), &context).unwrap();
    assert_eq!(ui.viewer().output.take().unwrap().path(), folder.path().join("film.v2.gif"));
}
