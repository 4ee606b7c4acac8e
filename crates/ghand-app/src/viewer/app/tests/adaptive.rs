//! Fewer pixels while the hand moves, and the figures of the pictures.

use super::*;

fn edge(ui: &mut Headless) -> u32 {
    ui.canvas().picture().texture().unwrap().width()
}

#[test]
fn a_slow_device_draws_fewer_pixels_in_motion_says_so_and_refines_at_rest() {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), SIZE, 0.05);
    (0..3).for_each(|_| _ = ui.frame(Vec::new()));
    let whole = edge(&mut ui);
    ui.viewer().stage.set_turning(true);
    for _ in 0..20 {
        ui.frame(Vec::new());
        // Like a device that needs 200 ms for each picture.
        ui.canvas().resolution_mut().took(200.0);
    }
    assert!(edge(&mut ui) < whole / 2, "{} of {whole}", edge(&mut ui));
    ui.viewer().stage.set_turning(false);
    // It rests, but the last picture may still be on its way.
    (0..30).for_each(|_| _ = ui.frame(Vec::new()));
    assert_eq!(edge(&mut ui), whole);
    // Measured pictures are whole.
    ui.viewer().stage.set_turning(true);
    ui.canvas().set_measured(true);
    (0..5).for_each(|_| _ = ui.frame(Vec::new()));
    assert_eq!(edge(&mut ui), whole);
    ui.canvas().set_measured(false);
    ui.viewer().settings_mut().adaptive = false;
    (0..5).for_each(|_| _ = ui.frame(Vec::new()));
    assert_eq!(edge(&mut ui), whole);
}

#[test]
fn measuring_shows_the_times_of_the_stages() {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), vec2(700.0, 600.0), 0.1);
    ui.canvas().set_measured(true);
    (0..5).for_each(|_| _ = ui.frame(Vec::new()));
    assert!(ui.harness.query_by_label_contains("Times of the last").is_some());
    if ui.viewer().gpu().device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
        for stage in crate::viewer::rendering::frame::STAGES {
            assert!(ui.harness.query_by_label_contains(&format!("{stage} ")).is_some(), "{stage}");
        }
    }
}
