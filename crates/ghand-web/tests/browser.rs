//! The player of `web/dist/` in a browser: its pictures against the native renderer's, and what a page may do to it.
//! Chromium runs without a window, with WebGPU on its software rasteriser.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "browser/server.rs"]
mod server;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use ghand_avatar::deform::baked::Precision;
use ghand_avatar::{Avatar, AvatarConfig, AvatarLight, Bake, Light, Scene};
use ghand_core::{Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::named_poses::POSE_NAMES;
use ghand_hand_model::surface::sample_surface;
use ghand_motion::motions::motion;
use ghand_render::splat::Purpose;
use ghand_render::{AdapterChoice, Gpu};
use ghand_test_support::cases;
use ghand_web::stage::{LightChoice, Stage};
use glam::DMat3;
use serde_json::{Value, json};

const SIZE: [u32; 2] = [320, 240];
/// Turn of the lights, degrees, as in `checks.js`.
const TURN: f64 = 30.0;
const LIGHTS: [(&str, LightChoice); 2] = [("capture", LightChoice::Capture), ("studio", LightChoice::Studio)];
/// Largest difference of a pixel, 255ths.
const MOST_APART: u8 = 2;
/// Motions of which poses are drawn, too, at these seconds.
const MOMENTS: [(&str, f64); 8] = [
    ("count", 0.7),
    ("count", 1.9),
    ("wave", 0.5),
    ("grasp", 0.6),
    ("ripple", 0.9),
    ("pinching", 0.4),
    ("pointing", 1.0),
    ("tour", 2.2),
];
/// Longest run of the page.
const PATIENCE: Duration = Duration::from_secs(900);

/// What the page has posted.
struct Run {
    results: BTreeMap<String, Value>,
    pictures: BTreeMap<String, Vec<u8>>,
}

/// The avatars by their files' names: the demo, and one baked in the two other precisions.
fn avatars() -> Vec<(&'static str, Vec<u8>)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let demo = std::fs::read(root.join("assets/demo-avatar/right.ghand")).unwrap();
    let model = builtin_hand(Side::Left).unwrap();
    let config = AvatarConfig { uv_resolution: 64, ..AvatarConfig::default() };
    let mut avatar = Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 1).unwrap();
    let samples = sample_surface(&model, config.uv_resolution).unwrap();
    avatar.light = Some(AvatarLight::new(Light::studio().turned(1.0), None, &samples));
    let poses: Vec<Pose> =
        motion("tour", &avatar.model, 6.0).unwrap().unwrap().frames.into_iter().map(|f| f.pose).collect();
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let bake = Bake::new(&gpu, &avatar, &poses, 3, |_| ()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("avatar.ghand");
    let baked = |precision| {
        bake.avatar(bake.blocks(), precision).save(&path).unwrap();
        std::fs::read(&path).unwrap()
    };
    vec![("demo.ghand", demo), ("f32.ghand", baked(Precision::F32)), ("f16.ghand", baked(Precision::F16))]
}

/// Poses by name that are drawn, and moments of motions.
fn counts() -> [usize; 2] {
    [cases(5, POSE_NAMES.len()), cases(3, MOMENTS.len())]
}

/// What the page draws: of each avatar the poses by name, then moments of motions; and a number of other poses, one after the
/// other.
fn plan(avatars: &[(&str, Vec<u8>)]) -> Value {
    let [names, moments] = counts();
    let named = POSE_NAMES.iter().take(names).map(|name| json!({"name": name}));
    let moments = MOMENTS.iter().take(moments).map(|(motion, seconds)| json!({"motion": motion, "seconds": seconds}));
    let poses: Vec<Value> = named.chain(moments).collect();
    let lights: Vec<&str> = LIGHTS.iter().map(|(name, _)| *name).collect();
    let pictures: Value =
        avatars.iter().map(|(name, _)| json!({"avatar": name, "lights": lights, "poses": poses})).collect();
    json!({"pictures": pictures, "poses": cases(100, 500)})
}

fn files(avatars: &[(&'static str, Vec<u8>)]) -> BTreeMap<String, (&'static str, Vec<u8>)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &str| std::fs::read(root.join(path)).unwrap();
    let script = "text/javascript";
    let mut files = BTreeMap::from([
        ("/".to_owned(), ("text/html", read("tests/browser/page.html"))),
        ("/checks.js".to_owned(), (script, read("tests/browser/checks.js"))),
        ("/ghand-avatar.js".to_owned(), (script, read("../../web/dist/ghand-avatar.js"))),
        ("/ghand.wasm".to_owned(), ("application/wasm", read("../../web/dist/ghand.wasm"))),
        ("/plan.json".to_owned(), ("application/json", plan(avatars).to_string().into_bytes())),
    ]);
    let mut add = |name: &str, bytes: Vec<u8>| files.insert(format!("/{name}"), ("application/octet-stream", bytes));
    let demo = &avatars[0].1;
    add("broken.ghand", demo[..demo.len() / 2].to_vec());
    add("foreign.ghand", b"solid hand".to_vec());
    // The version in the file's header, with as many digits.
    let text = String::from_utf8_lossy(demo);
    let at = text.find(r#"\"version\":4"#).unwrap();
    let mut newer = demo.clone();
    newer[at + r#"\"version\":"#.len()] = b'9';
    add("newer.ghand", newer);
    avatars.iter().for_each(|(name, bytes)| drop(add(name, bytes.clone())));
    files
}

/// The run of the page, once for all tests; `None` without a browser.
static RUN: LazyLock<Option<Run>> = LazyLock::new(|| {
    let browser = ghand_test_support::browser()?;
    let mut rotations = vec![[0.0; 3]; 25];
    rotations[5][0] = 0.25;
    let packet = json!({"pose": rotations, "translation": [0, 0, 0]}).to_string();
    let avatars = avatars();
    let server = server::serve(files(&avatars), packet);
    let profile = tempfile::tempdir().unwrap();
    let mut page = Command::new(browser)
        .args(["--headless=new", "--no-sandbox", "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"])
        .args(["--enable-features=Vulkan", "--use-vulkan=swiftshader", "--use-angle=vulkan", "--ignore-gpu-blocklist"])
        .args(["--disable-background-networking", "--disable-quic", "--no-first-run", "--disable-component-update"])
        .args(["--disable-sync", "--force-device-scale-factor=1", "--window-size=900,700"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("http://127.0.0.1:{}/", server.port))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut run = Run { results: BTreeMap::new(), pictures: BTreeMap::new() };
    let begin = Instant::now();
    let posts = server.posts.lock().unwrap();
    while let Ok((path, body)) = posts.recv_timeout(PATIENCE.saturating_sub(begin.elapsed())) {
        if let Some(name) = path.strip_prefix("/picture/") {
            run.pictures.insert(name.to_owned(), body);
        } else if let Some(name) = path.strip_prefix("/result/") {
            run.results.insert(name.to_owned(), serde_json::from_slice(&body).unwrap());
        } else {
            break;
        }
    }
    let _ = page.kill();
    let _ = page.wait();
    Some(run)
});

/// What a check of the page has returned; fails with its error. `None` without a browser.
fn value(check: &str) -> Option<Value> {
    let run = RUN.as_ref()?;
    let result = run.results.get(check);
    let result = result.unwrap_or_else(|| panic!("the page did not come to {check}; done: {:?}", run.results.keys()));
    eprintln!("{check}: {} s", result["seconds"]);
    assert!(result["error"].is_null(), "{check}: {}", result["error"].as_str().unwrap_or_default());
    Some(result["value"].clone())
}

/// RGBA bytes of the native renderer.
fn native(gpu: &Gpu, scene: &mut Scene, stage: &Stage) -> Vec<u8> {
    let hand = stage.hand(0).unwrap();
    scene.avatars_mut()[0].set_light(&stage.light_on(hand).unwrap());
    scene.set_placement(0, DMat3::IDENTITY, hand.place).unwrap();
    scene.set_pose(gpu, 0, 0, hand.pose()).unwrap();
    let image = scene.render(gpu, 0, &stage.camera(SIZE).unwrap(), [1.0; 3]).unwrap();
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    image.rgba.iter().flat_map(|[r, g, b, _]| [byte(*r), byte(*g), byte(*b), 255]).collect()
}

#[test]
fn pictures_are_those_of_the_native_renderer() {
    if value("pictures").is_none() {
        return;
    }
    let pictures = &RUN.as_ref().unwrap().pictures;
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let [names, moments] = counts();
    let mut compared = 0;
    for (k, (name, bytes)) in avatars().into_iter().enumerate() {
        let mut stage = Stage::default();
        stage.add(Avatar::from_bytes(Path::new(name), &bytes).unwrap()).unwrap();
        let avatar = stage.hand(0).unwrap().avatar().clone();
        let mut scene = Scene::new(&gpu, &[&avatar], Purpose::Images, 1, SIZE).unwrap();
        for (light, choice) in LIGHTS {
            stage.set_light(choice, TURN.to_radians()).unwrap();
            for j in 0..names + moments {
                let hand = stage.hand_mut(0).unwrap();
                let pose = match j.checked_sub(names) {
                    None => hand.named(POSE_NAMES[j]).unwrap(),
                    Some(moment) => {
                        let (motion, seconds) = MOMENTS[moment];
                        hand.motion(motion).unwrap().pose_at(seconds).unwrap()
                    }
                };
                hand.go_to(pose, 0.0).unwrap();
                let wanted = native(&gpu, &mut scene, &stage);
                let found = &pictures[&format!("{k}/{light}/{j}")];
                assert_eq!(found.len(), wanted.len());
                let dark = wanted.iter().filter(|value| **value < 200).count();
                assert!(dark > wanted.len() / 40, "{name}, {light}, pose {j}: the picture is empty");
                let apart = found.iter().zip(&wanted).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                assert!(apart <= MOST_APART, "{name}, {light}, pose {j}: a pixel differs by {apart}");
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 6 * (names + moments));
}

#[test]
fn the_canvas_shows_the_picture_in_any_size() {
    value("canvas");
}

#[test]
fn a_lost_device_comes_back_with_what_was_shown() {
    if let Some(message) = value("lost_device") {
        assert!(message.as_str().unwrap().contains("lost"), "{message}");
    }
}

#[test]
fn layers_are_shown_by_name_on_a_new_device_too() {
    let Some(said) = value("layers") else { return };
    assert!(said[0].as_str().unwrap().contains("there are skin, albedo, views"), "{said}");
    assert!(said[1].as_str().unwrap().contains("it has skin, albedo"), "{said}");
}

#[test]
fn many_poses_are_drawn_one_after_the_other() {
    value("poses");
}

#[test]
fn players_and_hands_are_independent() {
    value("two_players_and_two_hands");
}

#[test]
fn packets_sockets_and_sessions_drive_the_hand() {
    value("live_poses");
    value("socket");
}

#[test]
fn files_can_be_dropped_on_it() {
    if let Some(message) = value("dropped_files") {
        assert!(message.as_str().unwrap().contains("hand.ghand"), "{message}");
    }
}

#[test]
fn keys_and_controls_reach_everything_and_have_names() {
    value("keys_and_controls");
}

#[test]
fn bad_input_is_one_sentence() {
    let Some(said) = value("bad_input") else { return };
    let expected = [
        ("none.ghand", "none.ghand cannot be fetched: 404"),
        ("broken.ghand", "truncated"),
        ("newer.ghand", "version"),
        ("foreign.ghand", "foreign.ghand"),
        ("pose", "fist"),
        ("numbers", "7 numbers"),
        ("nan", "NaN"),
        ("joint", "there is no joint"),
        ("vector", "three numbers"),
        ("light", "studio"),
        ("view", "position"),
        ("side", "palm"),
        ("hand", "no hand 3"),
        ("packet", "packet"),
        ("socket", "WebSocket"),
        ("motion", "count"),
        ("file", "poses.json"),
        ("mediapipe", "mediapipe"),
        // Whichever is missing first: without a GPU there may be no WebGL 2.
        ("served", "hand_landmarker.task|WebGL 2"),
        ("picture", "0 x 10"),
        ("elsewhere", "Access-Control-Allow-Origin"),
        ("closed", "closed"),
    ];
    for (case, words) in expected {
        let text = said[case].as_str().unwrap();
        assert!(words.split('|').any(|words| text.contains(words)) && !text.contains('\n'), "{case}: {text}");
    }
    assert_eq!(said.as_object().unwrap().len(), expected.len());
}
