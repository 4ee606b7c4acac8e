//! Pictures of the named poses.

use super::*;

/// How many pictures are made.
fn made(ui: &mut Headless) -> usize {
    let count = ghand_hand_model::named_poses::POSE_NAMES.len();
    (0..count).filter(|pose| ui.hand().thumbnail(*pose).is_some()).count()
}

#[test]
fn pictures_of_poses_are_made_while_the_view_rests_and_choose_poses() {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), vec2(700.0, 900.0), 0.1);
    (0..3).for_each(|_| _ = ui.frame(Vec::new()));
    assert_eq!(made(&mut ui), 0, "words need no pictures");
    ui.viewer().settings_mut().thumbnails_shown = true;
    let count = ghand_hand_model::named_poses::POSE_NAMES.len();
    // While a motion plays there are no new ones.
    ui.hand().play("wave");
    (0..5).for_each(|_| _ = ui.frame(Vec::new()));
    assert_eq!(made(&mut ui), 0);
    ui.hand().pause();
    let start = Instant::now();
    while made(&mut ui) < count {
        ui.frame(Vec::new());
        assert!(start.elapsed().as_secs() < 60, "{} of {count} pictures", made(&mut ui));
    }
    ui.click("fist");
    let fist = pose_by_name("fist", ui.hand().model()).unwrap();
    assert_eq!(ui.hand().pose, fist);
    ui.harness.check_accessibility();
}
