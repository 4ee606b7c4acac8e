//! The user interface without a window: what it draws, and what its controls and the pointer do.

mod adaptive;
mod commands;
mod files;
mod keys;
mod layers;
mod live;
mod motion;
mod output;
mod pointer;
mod pose;
mod saved_views;
mod snapshots;
mod thumbnails;
mod truth;
mod webcam;

use std::path::Path;
use std::sync::{Arc, Mutex};

use egui::{Event, Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use ghand_avatar::{Avatar, AvatarConfig};
use ghand_core::Side;
use ghand_hand_model::builtin::builtin_hand;
use ghand_render::AdapterChoice;
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::DVec2;

use self::snapshots::Textures;
use super::*;
use crate::pose_choice::pose_by_name;
use crate::viewer::document::scene::tests::scene;
use crate::viewer::hand::Hand;
use crate::viewer::hand::tests::untrained_avatar;
use crate::viewer::stage::canvas::Canvas;
use crate::viewer::stage::resolution::DETAIL_STEP;
use ghand_avatar::orbit_camera::OrbitCamera;

/// Size of the user interface, points.
const SIZE: Vec2 = vec2(700.0, 400.0);

struct State {
    viewer: Viewer,
    renderer: Arc<Mutex<egui_wgpu::Renderer>>,
}

/// The user interface of a viewer without a window.
struct Headless {
    harness: Harness<'static, State>,
}

impl Headless {
    /// With this many seconds between frames.
    fn new(subject: Subject, size: Vec2, step_secs: f32) -> Headless {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let mut viewer = Viewer::new(&gpu, subject, "test".into()).unwrap();
        // Small panels have no room for them.
        viewer.settings_mut().thumbnails_shown = false;
        let options = egui_wgpu::RendererOptions::PREDICTABLE;
        let renderer = egui_wgpu::Renderer::new(&gpu.device, wgpu::TextureFormat::Rgba8Unorm, options);
        let renderer = Arc::new(Mutex::new(renderer));
        let textures = Textures { gpu, renderer: renderer.clone() };
        let show = |ui: &mut Ui, state: &mut State| state.viewer.ui(ui, &mut state.renderer.lock().unwrap());
        let builder = Harness::builder().with_size(size).with_step_dt(step_secs).with_max_steps(1);
        Headless { harness: builder.renderer(textures).build_ui_state(show, State { viewer, renderer }) }
    }

    /// An untrained avatar at rest.
    fn untrained_avatar() -> Headless {
        Headless::new(Subject::avatar(untrained_avatar()), SIZE, 1.0)
    }

    fn viewer(&mut self) -> &mut Viewer {
        &mut self.harness.state_mut().viewer
    }

    fn canvas(&mut self) -> &mut Canvas {
        &mut self.viewer().stage.canvas
    }

    fn camera(&mut self) -> &mut OrbitCamera {
        &mut self.viewer().stage.camera
    }

    fn hand(&mut self) -> &mut Hand {
        match self.viewer().subject_mut() {
            Subject::Hand(hand) => hand,
            Subject::Scene { .. } => panic!("a scene"),
        }
    }

    /// Draws one frame with all these events, waits for its picture, and returns whether there was one.
    fn frame(&mut self, events: Vec<Event>) -> bool {
        let before = self.canvas().last_frame();
        self.harness.input_mut().events.extend(events);
        self.harness.step();
        self.viewer().wait_for_files();
        self.viewer().gpu().wait().unwrap();
        before != self.canvas().last_frame()
    }

    /// Opens a file and waits until it has been read.
    fn open(&mut self, path: &Path) {
        self.viewer().open(path);
        self.viewer().wait_for_files();
    }

    /// Clicks on the control with that name, over several frames.
    fn click(&mut self, name: &str) {
        self.harness.get_by_label(name).click();
        self.harness.step();
        self.harness.step();
    }
}

/// A hand of few Gaussians.
fn small_hand() -> Hand {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let config = AvatarConfig { uv_resolution: 32, ..Default::default() };
    Hand::new(Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0).unwrap())
}

/// A cube of 125 red Gaussians.
fn small_scene() -> Subject {
    let at = |k: usize| [k % 5, k / 5 % 5, k / 25].map(|i| 0.25 * i as f32 - 0.5);
    let places: Vec<[f32; 3]> = (0..125).map(at).collect();
    Subject::Scene { gaussians: Arc::new(scene(&places, 0.1, &[3.0])), name: "cube.ply".into() }
}

#[test]
fn only_changes_are_rendered() {
    let mut ui = Headless::untrained_avatar();
    // The first pictures may have lacked memory.
    (0..3).for_each(|_| _ = ui.frame(Vec::new()));
    assert!(!ui.frame(Vec::new()) && !ui.frame(vec![Event::PointerMoved(egui::pos2(500.0, 200.0))]));
    let fist = pose_by_name("fist", ui.hand().model()).unwrap();
    ui.hand().pose = fist;
    assert!(ui.frame(Vec::new()));
    ui.frame(Vec::new());
    assert!(!ui.frame(Vec::new()));
    ui.canvas().set_measured(true);
    assert!(ui.frame(Vec::new()) && ui.frame(Vec::new()));
    assert!(ui.canvas().picture().frame_ms().is_some_and(|ms| ms > 0.0));
}

#[test]
fn a_picture_with_too_little_memory_is_rendered_again() {
    let mut ui = Headless::untrained_avatar();
    ui.frame(Vec::new());
    ui.camera().zoom(4.0);
    assert!(ui.frame(Vec::new()));
    assert!(!ui.viewer().finish().unwrap(), "the picture had enough memory; zoom in further");
    assert!(ui.frame(Vec::new()));
    assert!(ui.viewer().finish().unwrap());
    assert!(!ui.frame(Vec::new()));
}

#[test]
fn a_close_up_beyond_the_device_gets_coarser_and_recovers() {
    let mut ui = Headless::untrained_avatar();
    ui.frame(Vec::new());
    let settle = |ui: &mut Headless| {
        for _ in 0..40 {
            if !ui.frame(Vec::new()) && ui.viewer().finish().unwrap() {
                return;
            }
        }
        panic!("the picture does not settle");
    };
    settle(&mut ui);
    assert_eq!(ui.canvas().resolution_mut().detail(), 1.0);
    // Like a device that cannot hold more than the picture needs now.
    let intersections = ui.canvas().picture().intersections();
    ui.canvas().resolution_mut().limit(DETAIL_STEP.powi(2), intersections);
    settle(&mut ui);
    assert_eq!(ui.canvas().resolution_mut().detail(), DETAIL_STEP.powi(2), "it must not go back and forth");
    ui.camera().zoom(0.25);
    settle(&mut ui);
    assert_eq!(ui.canvas().resolution_mut().detail(), 1.0);
    assert!(ui.canvas().failure().is_none());
}

#[test]
fn every_control_has_a_name() {
    let mut hand = small_hand();
    let motion = ghand_motion::motions::motion("wave", hand.model(), 30.0).unwrap().unwrap();
    hand.show("wave".into(), motion);
    let mut ui = Headless::new(Subject::Hand(Box::new(hand)), vec2(400.0, 900.0), 0.1);
    ui.click("Joints");
    ui.click("Index finger");
    assert!(ui.harness.query_all_by_label("flexion").count() > 3, "the sliders are missing");
    ui.harness.check_accessibility();
}

#[test]
fn the_names_of_shapes_and_joints_fit_the_panel() {
    let hand = Hand::bare(builtin_hand(Side::Right).unwrap());
    let mut ui = Headless::new(Subject::Hand(Box::new(hand)), vec2(500.0, 1600.0), 0.1);
    for section in ["Shape", "Joints", "Thumb"] {
        ui.click(section);
    }
    (0..3).for_each(|_| _ = ui.frame(Vec::new()));
    for name in ["finger diameter", "wrist circumference", "macro 5", "flexion", "Pixels"] {
        let labels: Vec<f32> = ui.harness.query_all_by_label_contains(name).map(|label| label.rect().right()).collect();
        assert!(!labels.is_empty(), "{name} is missing");
        assert!(labels.iter().all(|right| *right < PANEL_WIDTH), "{name} reaches {labels:?}");
    }
}

#[test]
fn a_scene_has_figures_and_a_view_but_no_pose() {
    let mut ui = Headless::new(small_scene(), SIZE, 0.1);
    ui.frame(Vec::new());
    for name in ["cube.ply", "Gaussians", "125", "Pixels", "Picture", "Reset view"] {
        assert!(ui.harness.query_by_label(name).is_some(), "{name}");
    }
    for name in ["Pose", "Motion", "Joints", "fist", "count"] {
        assert!(ui.harness.query_by_label(name).is_none(), "{name}");
    }
    let first = ui.camera().clone();
    ui.camera().orbit(DVec2::new(40.0, 0.0));
    assert!(ui.frame(Vec::new()), "the scene turns");
    ui.click("Reset all");
    assert_eq!(*ui.camera(), first);
}
