//! The cases of the attack.

use std::path::Path;

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

use super::damage::{self, pick};
use super::world::{GHAND, World};

const TRAIN: &str = env!("CARGO_BIN_EXE_train");
const VIEWER: &str = env!("CARGO_BIN_EXE_viewer");

/// One command, and the files that it must not change.
pub struct Case {
    /// The private folder in which the command runs.
    pub folder: TempDir,
    /// Program and arguments.
    pub command: Vec<String>,
    /// The file that it should write.
    pub output: Option<String>,
    /// Files that it must not change, with their contents.
    pub kept: Vec<(String, Vec<u8>)>,
}

impl Case {
    /// A case drawn at random.
    pub fn new(world: &World, random: &mut ChaCha8Rng) -> Case {
        let mut case = Case { folder: tempfile::tempdir().unwrap(), command: vec![], output: None, kept: vec![] };
        match random.random_range(0..100) {
            0..20 => case.damaged_poses(world, random),
            20..35 => case.damaged_capture(world, random),
            35..50 => case.damaged_avatar(world, random),
            50..60 => case.damaged_hand_model(world, random),
            60..70 => case.damaged_scene(world, random),
            70..76 => case.damaged_camera(world, random),
            76..86 => case.odd_output(world, random),
            86..93 => case.odd_setting(world, random),
            _ => case.odd_option(world, random),
        }
        case
    }

    fn file(&self, name: &str, bytes: &[u8]) -> String {
        std::fs::write(self.folder.path().join(name), bytes).unwrap();
        name.to_owned()
    }

    /// A copy of a file of the world.
    fn copy(&self, world: &World, name: &str) -> String {
        self.file(name, &world.bytes(name))
    }

    fn is(&mut self, program: &str, arguments: &[&str]) {
        self.command = [&[program], arguments].concat().into_iter().map(str::to_owned).collect();
    }

    fn writes(&mut self, output: &str) {
        self.output = Some(output.to_owned());
    }

    fn damaged_poses(&mut self, world: &World, random: &mut ChaCha8Rng) {
        let poses = self.file("poses.json", &damage::json(&world.poses, random));
        let hand = self.copy(world, "hand.ghand");
        if random.random_bool(0.1) {
            self.is(VIEWER, &[&hand, "--pose", &poses, "--size", "48x48", "--screenshot", "out.png"]);
            self.writes("out.png");
        } else {
            let out = pick(random, &["out.obj", "out.json"]);
            self.is(GHAND, &["pose", "--for", &hand, "--pose", &poses, "--out", out]);
            self.writes(out);
        }
    }

    fn damaged_capture(&mut self, world: &World, random: &mut ChaCha8Rng) {
        copy_folder(&world.path("capture"), &self.folder.path().join("capture"));
        let damaged = damage::json(&world.capture, random);
        std::fs::write(self.folder.path().join("capture/capture.json"), &damaged).unwrap();
        self.kept.push(("capture/capture.json".into(), damaged));
        if random.random_bool(0.1) {
            let arguments =
                ["--capture", "capture", "--out", "out", "--set", "iterations=4", "--set", "uv_resolution=16"];
            self.is(TRAIN, &arguments);
        } else {
            self.is(GHAND, &["inspect", "capture", "--no-sheet"]);
        }
    }

    fn damaged_avatar(&mut self, world: &World, random: &mut ChaCha8Rng) {
        let original = world.bytes("hand.ghand");
        // Half of the time in the header, which is small compared to the tensors.
        let head = if random.random_bool(0.5) { 4000.min(original.len()) } else { original.len() };
        let mut damaged = damage::bytes(&original[..head], random);
        damaged.extend(&original[head..]);
        let hand = self.file("hand.ghand", &damaged);
        self.kept.push((hand.clone(), damaged));
        match random.random_range(0..10) {
            0 => {
                self.is(VIEWER, &[&hand, "--size", "48x48", "--screenshot", "out.png"]);
                self.writes("out.png");
            }
            1 => {
                self.is(GHAND, &["export", &hand, "--out", "out.ply"]);
                self.writes("out.ply");
            }
            _ => self.is(GHAND, &["inspect", &hand]),
        }
    }

    fn damaged_hand_model(&mut self, world: &World, random: &mut ChaCha8Rng) {
        let hand = self.file("hand.npz", &damage::bytes(&world.bytes("hand.npz"), random));
        if random.random_bool(0.5) {
            self.is(GHAND, &["inspect", &hand]);
        } else {
            self.is(GHAND, &["pose", "--hand-model", &hand, "--pose", "fist", "--out", "out.obj"]);
            self.writes("out.obj");
        }
    }

    fn damaged_scene(&mut self, world: &World, random: &mut ChaCha8Rng) {
        let scene = self.file("scene.ply", &damage::bytes(&world.bytes("scene.ply"), random));
        if random.random_bool(0.7) {
            self.is(GHAND, &["inspect", &scene]);
        } else {
            let camera = self.copy(world, "camera.json");
            self.is(GHAND, &["splat", &scene, "--camera", &camera, "--out", "out.png"]);
            self.writes("out.png");
        }
    }

    fn damaged_camera(&mut self, world: &World, random: &mut ChaCha8Rng) {
        let camera = self.file("camera.json", &damage::json(&world.camera, random));
        let scene = self.copy(world, "scene.ply");
        self.is(GHAND, &["splat", &scene, "--camera", &camera, "--out", "out.png"]);
        self.writes("out.png");
    }

    /// Something else exists at the output's path.
    fn odd_output(&mut self, world: &World, random: &mut ChaCha8Rng) {
        let folder = self.folder.path();
        let name = pick(
            random,
            &[
                "a.png",
                "A.PNG",
                "a.jpg",
                "a",
                "b/c/a.png",
                "kept.png",
                "folder.png",
                "link.png",
                "/dev/null",
                "kept.png/a.png",
                "",
            ],
        );
        match name {
            "folder.png" => std::fs::create_dir(folder.join(name)).unwrap(),
            "link.png" => {
                #[cfg(unix)]
                std::os::unix::fs::symlink("/dev/null", folder.join(name)).unwrap();
            }
            _ => {}
        }
        let kept = folder.join("kept.png");
        std::fs::write(&kept, "kept").unwrap();
        let mut permissions = std::fs::metadata(&kept).unwrap().permissions();
        permissions.set_readonly(true);
        std::fs::set_permissions(&kept, permissions).unwrap();
        self.kept.push(("kept.png".into(), b"kept".to_vec()));
        let hand = self.copy(world, "hand.ghand");
        match random.random_range(0..4) {
            0 => self.is(VIEWER, &[&hand, "--size", "48x48", "--screenshot", name]),
            1 => self.is(GHAND, &["pose", "--for", &hand, "--out", name]),
            2 => {
                let scene = self.copy(world, "scene.ply");
                let camera = self.copy(world, "camera.json");
                self.is(GHAND, &["splat", &scene, "--camera", &camera, "--out", name]);
            }
            _ => self.is(GHAND, &["export", &hand, "--out", name]),
        }
    }

    fn odd_setting(&mut self, world: &World, random: &mut ChaCha8Rng) {
        const NAMES: [&str; 14] = [
            "iterations",
            "merge_below",
            "uv_resolution",
            "images_per_step",
            "seed",
            "shape_bases",
            "color_components",
            "rate_shape_basis",
            "rate_joints",
            "residual_weights",
            "residual_skeleton",
            "final_rate",
            "iteratoins",
            "",
        ];
        const VALUES: [&str; 14] = [
            "-1",
            "NaN",
            "inf",
            "1e300",
            "1.5",
            "true",
            "[1]",
            "{}",
            "\"\"",
            "paper ",
            "nonsense",
            "",
            "99999999999999999999",
            "=1",
        ];
        let setting = format!("{}={}", pick(random, &NAMES), pick(random, &VALUES));
        let capture = world.path("capture").display().to_string();
        self.is(
            TRAIN,
            &[
                "--capture",
                &capture,
                "--out",
                "out",
                "--set",
                &setting,
                "--set",
                "iterations=3",
                "--set",
                "uv_resolution=16",
            ],
        );
    }

    fn odd_option(&mut self, world: &World, random: &mut ChaCha8Rng) {
        let hand = self.copy(world, "hand.ghand");
        let value = pick(
            random,
            &["", "-1", "0", "nan", "1e9", "99999999999", "0x0", "3x", "a,b", "1,2,3", "..", "nowhere", "π"],
        );
        let option = pick(
            random,
            &["--size", "--background", "--frame", "--fps", "--pose", "--side", "--camera", "--turntable"],
        );
        let option = format!("{option}={value}");
        if random.random_bool(0.5) {
            self.is(GHAND, &["pose", "--for", &hand, "--pose", "fist", &option, "--out", "out.obj"]);
        } else {
            self.is(GHAND, &["render", &hand, "--pose", "fist", &option, "--out", "out"]);
        }
    }
}

fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_folder(&entry.path(), &target)
        } else {
            std::fs::copy(entry.path(), target).map(drop).unwrap()
        }
    }
}

/// So that the result depends only on the seed.
#[test]
fn the_same_seed_draws_the_same_cases() {
    let world = World::new();
    let draw = |stream: u64| {
        let case = super::case(&world, 3, stream);
        let files =
            std::fs::read_dir(case.folder.path()).unwrap().flatten().filter_map(|e| std::fs::read(e.path()).ok());
        let mut files: Vec<Vec<u8>> = files.collect();
        files.sort();
        (case.command.clone(), files)
    };
    assert!((0..20).all(|stream| draw(stream) == draw(stream)));
    assert!((1..20).any(|stream| draw(stream).0 != draw(0).0));
    let mut random: ChaCha8Rng = rand::SeedableRng::seed_from_u64(0);
    assert_eq!(random.clone().next_u64(), random.next_u64());
}
