//! The viewer under random use: commands, the pointer, keys, files good and broken, other window sizes and lost devices.
//! It must neither fail nor panic, and must not grow.
//!
//! A short run belongs to the tests. A long one:
//! `SOAK_MINUTES=10 SOAK_SEED=1 cargo test -p ghand-app --test it viewer_soak -- --ignored --nocapture`

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::bail;
use egui::{Event, Key, Modifiers, MouseWheelUnit, PointerButton, Pos2, Vec2, pos2, vec2};
use egui_kittest::Harness;
use ghand_app::viewer::app::Viewer;
use ghand_app::viewer::command::{COMMANDS, CommandId};
use ghand_app::viewer::document::subject::Subject;
use ghand_core::Pose;
use ghand_hand_model::named_poses::POSE_NAMES;
use ghand_motion::motions::MOTION_NAMES;
use ghand_motion::{PoseFrame, PoseSequence};
use ghand_render::{AdapterChoice, Gpu};
use rand::seq::{IndexedMutRandom, IndexedRandom};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common::{save_avatar, small_capture};

/// Largest window, points: larger ones only take longer on a software rasteriser.
const LARGEST: [f32; 2] = [900.0, 700.0];
/// Of how many actions one is the loss of the device, in the first half of a run; the second has one device.
const ACTIONS_PER_LOSS: u32 = 150;
/// Of how many actions one is followed by a look at the memory.
const ACTIONS_PER_SAMPLE: u32 = 25;
/// Parts of a run whose samples are compared, two in each half: by the first, every cache has had its use.
const PARTS: [[f64; 2]; 4] = [[0.1, 0.3], [0.3, 0.5], [0.7, 0.85], [0.85, 1.0]];
/// Growth of the median resident memory from one to the other of a half, as a factor.
const MOST_GROWTH: f64 = 1.05;
/// Frames after which a subject at rest is drawn, with its picture at its final size.
const FRAMES_TO_REST: usize = 6;
/// The window at the start of each session, points.
const FIRST_SIZE: Vec2 = vec2(700.0, 500.0);
/// Seed of the short run.
const SEED: u64 = 1;

/// What a run did.
#[derive(Debug, Default)]
struct Counts {
    actions: u32,
    frames: u64,
    losses: u32,
    memory: Vec<Sample>,
}

/// A look at the memory.
#[derive(Debug)]
struct Sample {
    /// The part of the run that had passed.
    part: f64,
    /// Whether it is the first one with this device: while a device lives, its buffers keep the size of the largest picture.
    is_first: bool,
    /// Resident memory, MB.
    mb: f64,
}

/// The user interface of a viewer with its own painter.
struct State<'a> {
    viewer: &'a mut Viewer,
    renderer: egui_wgpu::Renderer,
}

/// A user who does anything.
struct User {
    random: ChaCha8Rng,
    files: Vec<PathBuf>,
    size: Vec2,
}

impl User {
    fn new(seed: u64, folder: &Path) -> User {
        User { random: ChaCha8Rng::seed_from_u64(seed), files: files(folder), size: FIRST_SIZE }
    }

    fn place(&mut self) -> Pos2 {
        pos2(self.random.random_range(0.0..self.size.x), self.random.random_range(0.0..self.size.y))
    }

    /// Does one thing.
    fn act(&mut self, ui: &mut Harness<'_, State<'_>>) {
        match self.random.random_range(0..20) {
            0..=6 => self.command(ui),
            7..=10 => self.drag(ui),
            11 => self.click(ui),
            12 => {
                let delta = vec2(0.0, self.random.random_range(-200.0..200.0));
                let pos = self.place();
                ui.event(Event::PointerMoved(pos));
                ui.event(Event::MouseWheel {
                    unit: MouseWheelUnit::Point,
                    delta,
                    phase: egui::TouchPhase::Move,
                    source: egui::MouseWheelSource::Unknown,
                    modifiers: Modifiers::NONE,
                });
            }
            13 => {
                let keys = [Key::Tab, Key::ArrowLeft, Key::ArrowRight, Key::Space, Key::Escape, Key::Delete, Key::Z];
                ui.key_press(*keys.choose(&mut self.random).unwrap());
            }
            14 | 15 => self.pose(ui),
            16 => self.bend(ui),
            17 | 18 => {
                let file = self.files.choose(&mut self.random).unwrap().clone();
                ui.state_mut().viewer.open(&file);
            }
            _ => {
                let [width, height] = LARGEST.map(|edge| self.random.random_range(120.0..edge));
                self.size = vec2(width, height);
                ui.set_size(self.size);
            }
        }
    }

    /// Shows the first file at rest in a window of the first size.
    fn rest(&mut self, ui: &mut Harness<'_, State<'_>>) -> anyhow::Result<()> {
        self.size = FIRST_SIZE;
        ui.set_size(self.size);
        ui.key_press(Key::Escape);
        let viewer = &mut *ui.state_mut().viewer;
        viewer.open(&self.files[0]);
        viewer.wait_for_files();
        viewer.subject_mut().reset();
        for _ in 0..FRAMES_TO_REST {
            ui.step();
            ui.state_mut().viewer.finish()?;
        }
        Ok(())
    }

    fn command(&mut self, ui: &mut Harness<'_, State<'_>>) {
        let command = COMMANDS.choose(&mut self.random).unwrap();
        // These ask the desktop, or open a port that other programs may have.
        if ![CommandId::Open, CommandId::SaveMotion, CommandId::LivePoses, CommandId::Webcam].contains(&command.id) {
            let context = ui.ctx.clone();
            ui.state_mut().viewer.run(command.id, &context);
        }
    }

    /// Drags from anywhere to anywhere: sliders, handles, the view.
    fn drag(&mut self, ui: &mut Harness<'_, State<'_>>) {
        let button = *[PointerButton::Primary, PointerButton::Primary, PointerButton::Secondary]
            .choose(&mut self.random)
            .unwrap();
        let [from, to] = [self.place(), self.place()];
        let press = |pos, pressed| Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE };
        let steps = [
            Event::PointerMoved(from),
            press(from, true),
            Event::PointerMoved(from.lerp(to, 0.3)),
            Event::PointerMoved(to),
        ];
        for event in steps {
            ui.event(event);
            ui.step();
        }
        ui.event(press(to, false));
    }

    /// Clicks into the panel.
    fn click(&mut self, ui: &mut Harness<'_, State<'_>>) {
        // Below the menus: they lead to dialogs of the desktop.
        let pos = pos2(self.random.random_range(0.0..260.0), self.random.random_range(40.0..self.size.y.max(41.0)));
        ui.event(Event::PointerMoved(pos));
        for pressed in [true, false] {
            ui.event(Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE });
            ui.step();
        }
    }

    /// Shows a named pose or a motion.
    fn pose(&mut self, ui: &mut Harness<'_, State<'_>>) {
        let Subject::Hand(hand) = ui.state_mut().viewer.subject_mut() else { return };
        if self.random.random_bool(0.5) {
            let name = POSE_NAMES.choose(&mut self.random).unwrap();
            hand.take_pose(name);
        } else {
            hand.play(MOTION_NAMES.choose(&mut self.random).unwrap());
        }
    }

    /// Turns one joint and moves the hand, as far as a slider can.
    fn bend(&mut self, ui: &mut Harness<'_, State<'_>>) {
        let Subject::Hand(hand) = ui.state_mut().viewer.subject_mut() else { return };
        let model = hand.model();
        let mut pose = Pose::rest(model.joint_count());
        if let Some(joint) = pose.rotations.choose_mut(&mut self.random) {
            *joint = glam::DVec3::from_array([(); 3].map(|()| self.random.random_range(-1.5..1.5)));
        }
        pose.translation.x = self.random.random_range(-0.1..0.1);
        let frames = vec![PoseFrame { id: "bent".into(), pose, shape: vec![] }];
        let joint_names = model.joint_names.clone();
        hand.show("bent".into(), PoseSequence { fps: 30.0, joint_names, frames, warnings: vec![] });
    }
}

/// Files of all kinds, and broken ones.
fn files(folder: &Path) -> Vec<PathBuf> {
    let avatar = save_avatar(folder);
    let bytes = std::fs::read(&avatar).unwrap();
    small_capture(&folder.join("capture"));
    // As a run of training leaves them, for other frames.
    std::fs::write(folder.join("poses.json"), "{\"frames\":[{\"id\":\"0\",\"pose\":[[0,0,0]]}]}").unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    vec![
        avatar.clone(),
        avatar,
        folder.join("capture"),
        folder.join("capture"),
        file("cut.ghand", &bytes[..bytes.len() / 2]),
        file("empty.ply", b""),
        file("ball.ply", ball().as_bytes()),
        file("notes.txt", b"to do"),
        file("model.glb", b"glTF\x02\0\0\0"),
        file("none.json", b"{\"frames\":[]}"),
        folder.join("absent.ghand"),
        folder.to_owned(),
    ]
}

/// A scene of a few Gaussians on a ring.
fn ball() -> String {
    let properties = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let mut text = "ply\nformat ascii 1.0\nelement vertex 60\n".to_owned();
    properties.split(' ').for_each(|name| text += &format!("property float {name}\n"));
    text += "end_header\n";
    for k in 0..60 {
        let (sin, cos) = (0.1 * f64::from(k)).sin_cos();
        text += &format!("{cos} {sin} 0 1.5 -1.5 -1.5 4 -2 -2 -2 1 0 0 0\n");
    }
    text
}

/// Resident memory of this process, MB.
fn resident_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<f64>().unwrap() / 1024.0
}

/// Lets a user act until the time is over or the device is lost.
fn session(viewer: &mut Viewer, user: &mut User, time: [Instant; 2], counts: &mut Counts) -> anyhow::Result<()> {
    let options = egui_wgpu::RendererOptions::PREDICTABLE;
    let gpu = viewer.gpu().clone();
    let renderer = egui_wgpu::Renderer::new(&gpu.device, wgpu::TextureFormat::Rgba8Unorm, options);
    let show = |ui: &mut egui::Ui, state: &mut State<'_>| state.viewer.ui(ui, &mut state.renderer);
    user.size = FIRST_SIZE;
    let builder = Harness::builder().with_size(user.size).with_step_dt(0.1).with_max_steps(1);
    let mut ui = builder.build_ui_state(show, State { viewer, renderer });
    let [start, end] = time;
    let length = (end - start).as_secs_f64();
    let part = || start.elapsed().as_secs_f64() / length;
    // So that a later loss counts as the first.
    for _ in 0..FRAMES_TO_REST {
        ui.step();
        ui.state_mut().viewer.finish()?;
    }
    let mut is_first = true;
    while Instant::now() < end {
        user.act(&mut ui);
        counts.actions += 1;
        for _ in 0..2 {
            ui.step();
            counts.frames += 1;
            ui.state_mut().viewer.finish()?;
        }
        if counts.actions.is_multiple_of(ACTIONS_PER_SAMPLE) {
            // What is shown decides how much memory is used: the same for all samples.
            user.rest(&mut ui)?;
            counts.memory.push(Sample { part: part(), is_first, mb: resident_mb() });
            is_first = false;
        }
        if part() < 0.5 && user.random.random_ratio(1, ACTIONS_PER_LOSS) {
            counts.losses += 1;
            gpu.device.destroy();
            bail!("the device is gone");
        }
    }
    Ok(())
}

/// Runs the viewer for so long with a user of this seed.
fn soak(length: Duration, seed: u64) -> Counts {
    let folder = tempfile::tempdir().unwrap();
    let mut user = User::new(seed, folder.path());
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let subject = Subject::read(&user.files[0], &Default::default()).unwrap();
    let mut viewer = Viewer::new(&gpu, subject, "test".into()).unwrap();
    let start = Instant::now();
    let mut counts = Counts::default();
    viewer
        .retry_on_device_loss(|viewer| session(viewer, &mut user, [start, start + length], &mut counts))
        .unwrap_or_else(|error| panic!("seed {seed}, after {} actions: {error:#}", counts.actions));
    counts
}

#[test]
fn a_viewer_that_is_used_at_random_neither_fails_nor_panics() {
    let counts = soak(Duration::from_secs(10), SEED);
    assert!(counts.actions > 0, "{counts:?}");
}

/// `SOAK_MINUTES` (1 by default) and `SOAK_SEED` say how long and with which user.
#[test]
#[ignore = "takes minutes"]
fn a_viewer_that_is_used_for_long_does_not_grow() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<f64>().ok());
    let minutes = number("SOAK_MINUTES").unwrap_or(1.0);
    let counts = soak(Duration::from_secs_f64(60.0 * minutes), number("SOAK_SEED").unwrap_or(SEED as f64) as u64);
    let median = |k: usize| {
        let [from, to] = PARTS[k];
        let of_new_devices = k < 2;
        let chosen = |sample: &&Sample| (from..to).contains(&sample.part) && (sample.is_first || !of_new_devices);
        let mut samples: Vec<f64> = counts.memory.iter().filter(chosen).map(|sample| sample.mb).collect();
        samples.sort_by(f64::total_cmp);
        *samples
            .get(samples.len() / 2)
            .unwrap_or_else(|| panic!("too short: no look at the memory from {from} to {to}"))
    };
    let medians = [median(0), median(1), median(2), median(3)];
    println!("memory: {:.0?}", counts.memory.iter().map(|sample| sample.mb).collect::<Vec<_>>());
    println!(
        "{minutes} minutes, {} actions, {} frames, {} lost devices; new devices {:.0} and later {:.0} MB, one device {:.0} and \
         later {:.0} MB",
        counts.actions, counts.frames, counts.losses, medians[0], medians[1], medians[2], medians[3]
    );
    for [before, after] in [[medians[0], medians[1]], [medians[2], medians[3]]] {
        assert!(after <= MOST_GROWTH * before, "{before:.0} MB became {after:.0} MB");
    }
}
