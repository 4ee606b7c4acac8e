//! The viewer in a real window, used with pointer and keys: X without a screen (Xvfb), and synthetic input (xdotool).
//!
//! Without these programs the test says so and passes. With `GHAND_WINDOW_PICTURES=DIR` it keeps its pictures there, and with
//! `GHAND_WINDOW_SIZE=WxH` the window has another size:
//! `cargo test -p ghand-app --test it viewer_window -- --ignored --nocapture`

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use image::RgbImage;

const VIEWER: &str = env!("CARGO_BIN_EXE_viewer");
/// The programs that it needs.
const PROGRAMS: [&str; 3] = ["Xvfb", "xdotool", "import"];
/// Width of the panel beside the view, points.
const PANEL: u32 = 260;
/// Longest time until the window shows what was asked for: a software rasteriser on a busy computer.
const PATIENCE: Duration = Duration::from_secs(60);
/// Time that a hand at rest must look the same.
const REST: Duration = Duration::from_millis(700);

/// A program that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A viewer in a window that fills a display of its own.
struct Desk {
    viewer: Running,
    _server: Running,
    display: String,
    size: [u32; 2],
    folder: tempfile::TempDir,
}

impl Desk {
    /// Opens the viewer without arguments; `recent` are the files that were opened before.
    fn open(size: [u32; 2], recent: &[PathBuf]) -> Desk {
        let folder = tempfile::tempdir().unwrap();
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &format!("{}x{}x24", size[0], size[1]), "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let server = Running(server);
        let display = format!(":{}", number.trim());
        let settings = folder.path().join("ghand");
        std::fs::create_dir(&settings).unwrap();
        let recent: Vec<String> = recent.iter().map(|path| format!("{:?}", path.display().to_string())).collect();
        let text = format!(r#"{{"window_size":[{},{}],"recent":[{}]}}"#, size[0], size[1], recent.join(","));
        std::fs::write(settings.join("viewer.json"), text).unwrap();
        let viewer = Command::new(VIEWER)
            .current_dir(folder.path())
            .env("DISPLAY", &display)
            .env("XDG_CONFIG_HOME", folder.path())
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .spawn()
            .unwrap();
        let mut desk = Desk { viewer: Running(viewer), _server: server, display, size, folder };
        let start = Instant::now();
        desk.until("the hand is shown", |picture| hand_pixels(picture) > 1000);
        println!("the hand is shown after {:.1} s", start.elapsed().as_secs_f64());
        desk.tool("search --sync --name ghand windowmove 0 0 windowfocus");
        desk
    }

    /// Runs commands of xdotool.
    fn tool(&self, commands: &str) {
        let status = Command::new("xdotool").env("DISPLAY", &self.display).args(commands.split(' ')).status();
        assert!(status.unwrap().success(), "{commands}");
    }

    /// What the display shows.
    fn look(&mut self) -> RgbImage {
        assert!(self.viewer.0.try_wait().unwrap().is_none(), "the viewer has ended");
        let path = self.folder.path().join("look.png");
        let mut import = Command::new("import");
        let status = import.env("DISPLAY", &self.display).args(["-window", "root"]).arg(&path).status();
        assert!(status.unwrap().success(), "import has failed");
        image::open(&path).unwrap().into_rgb8()
    }

    /// Waits until the display shows something.
    fn until(&mut self, what: &str, shows: impl Fn(&RgbImage) -> bool) -> RgbImage {
        let start = Instant::now();
        loop {
            let picture = self.look();
            if shows(&picture) {
                return picture;
            }
            assert!(start.elapsed() < PATIENCE, "{what}: not after {PATIENCE:?}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Waits until nothing moves in the view, with a picture of full resolution.
    fn at_rest(&mut self) -> RgbImage {
        let start = Instant::now();
        let mut before = self.look();
        loop {
            std::thread::sleep(REST);
            let now = self.look();
            if in_view(&now) == in_view(&before) {
                return now;
            }
            assert!(start.elapsed() < PATIENCE, "the view does not come to rest");
            before = now;
        }
    }

    /// Waits until the view differs from a picture.
    fn until_other(&mut self, what: &str, before: &RgbImage) {
        self.until(what, |now| in_view(now) != in_view(before));
    }

    /// Drags with the main button.
    fn drag(&self, [x, y]: [i64; 2], by: [i64; 2]) {
        self.tool(&format!("mousemove {x} {y} sleep 0.3 mousedown 1 sleep 0.2"));
        for k in 1..=6 {
            self.tool(&format!("mousemove {} {} sleep 0.1", x + k * by[0] / 6, y + k * by[1] / 6));
        }
        self.tool("sleep 0.2 mouseup 1");
        // So that no handles are drawn.
        self.tool(&format!("mousemove {} {} sleep 0.1", self.size[0] - 12, self.size[1] - 12));
    }

    /// Finds a command in the palette and runs it.
    fn palette(&mut self, text: &str) -> RgbImage {
        let before = self.look();
        self.tool("key ctrl+k");
        self.until_other("the palette opens", &before);
        let mut typed = vec!["type", "--delay", "60", text];
        let status = Command::new("xdotool").env("DISPLAY", &self.display).args(std::mem::take(&mut typed)).status();
        assert!(status.unwrap().success());
        std::thread::sleep(REST);
        let open = self.look();
        self.tool("key Return");
        open
    }

    /// Keeps a picture, if somebody wants it.
    fn keep(&self, picture: &RgbImage, name: &str) {
        let Some(folder) = std::env::var_os("GHAND_WINDOW_PICTURES") else { return };
        let [width, height] = self.size;
        picture.save(Path::new(&folder).join(format!("{name}-{width}x{height}.png"))).unwrap();
    }
}

/// Whether a pixel of the view is skin: neither the panel's nor the greys of the interface.
fn is_skin(x: u32, pixel: &image::Rgb<u8>) -> bool {
    let [r, _, b] = pixel.0;
    x >= PANEL && r > 120 && r > b.saturating_add(30)
}

fn hand_pixels(picture: &RgbImage) -> usize {
    picture.enumerate_pixels().filter(|(x, _, pixel)| is_skin(*x, pixel)).count()
}

/// The highest place of the hand.
fn top(picture: &RgbImage) -> [i64; 2] {
    let (x, y, _) = picture.enumerate_pixels().find(|(x, _, pixel)| is_skin(*x, pixel)).unwrap();
    [x.into(), y.into()]
}

/// The highest handle that bends a finger, by its orange.
fn handle(picture: &RgbImage) -> Option<[i64; 2]> {
    let is_orange = |p: &image::Rgb<u8>| p.0[0] > 225 && (140..190).contains(&p.0[1]) && p.0[2] < 80;
    let (x, y, _) = picture.enumerate_pixels().find(|(x, _, pixel)| *x >= PANEL && is_orange(pixel))?;
    Some([x.into(), i64::from(y) + 3])
}

/// Pixels in the colour of messages about errors.
fn error_pixels(picture: &RgbImage) -> usize {
    let near = |p: &image::Rgb<u8>| p.0.iter().zip([222u8, 82, 70]).all(|(a, b)| a.abs_diff(b) <= 4);
    picture.enumerate_pixels().filter(|(x, _, pixel)| *x >= PANEL && near(pixel)).count()
}

/// The pixels of the view.
fn in_view(picture: &RgbImage) -> Vec<[u8; 3]> {
    picture.enumerate_pixels().filter(|(x, ..)| *x >= PANEL).map(|(.., pixel)| pixel.0).collect()
}

/// Skin that one picture has and the other has not, as a part of the first.
fn changed(a: &RgbImage, b: &RgbImage) -> f64 {
    let skin = a.enumerate_pixels().filter(|(x, _, pixel)| is_skin(*x, pixel));
    let gone = skin.filter(|(x, y, _)| !is_skin(*x, b.get_pixel(*x, *y))).count();
    gone as f64 / hand_pixels(a).max(1) as f64
}

#[test]
#[ignore = "opens a window and takes a minute"]
fn a_first_session_works_in_a_real_window() {
    let found = |program: &&str| {
        let path = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&path).any(|folder| folder.join(program).exists())
    };
    if let Some(missing) = PROGRAMS.iter().find(|program| !found(program)) {
        eprintln!("skipped: {missing} is not installed");
        return;
    }
    let size = std::env::var("GHAND_WINDOW_SIZE").unwrap_or("1280x800".into());
    let size: Vec<u32> = size.split('x').map(|edge| edge.parse().unwrap()).collect();
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.ghand");
    std::fs::write(&broken, b"this is no avatar").unwrap();
    let mut desk = Desk::open([size[0], size[1]], &[broken]);
    desk.tool(&format!("mousemove {} {}", size[0] - 12, size[1] - 12));
    let start = desk.at_rest();
    desk.keep(&start, "start");

    // A finger follows the pointer.
    let [x, y] = top(&start);
    desk.tool(&format!("mousemove {x} {}", y + 15));
    let hovered = desk.until("handles appear under the pointer", |picture| handle(picture).is_some());
    desk.drag(handle(&hovered).unwrap(), [8, i64::from(size[1]) / 8]);
    let bent = desk.at_rest();
    desk.keep(&bent, "finger");
    let moved = changed(&start, &bent);
    assert!((0.003..0.3).contains(&moved), "{moved} of the hand has moved");
    desk.tool("key ctrl+z");
    let undone = desk.at_rest();
    assert!(changed(&start, &undone) < 1e-3, "undo: {}", changed(&start, &undone));

    // The view turns.
    desk.drag([i64::from(size[0]) - 30, i64::from(size[1]) / 2], [-120, 20]);
    let turned = desk.at_rest();
    assert!(changed(&start, &turned) > 0.05, "{}", changed(&start, &turned));
    desk.keep(&turned, "turned");

    // A motion of the palette plays.
    let palette = desk.palette("motion: count");
    desk.keep(&palette, "palette");
    let before = desk.look();
    desk.until_other("the motion plays", &before);
    let plays = desk.look();
    desk.until_other("the motion plays on", &plays);
    desk.tool("key space");
    let paused = desk.at_rest();
    desk.keep(&paused, "paused");

    // A wrong file is told, and the hand stays.
    let palette = desk.palette("open: broken");
    // Neither the palette nor the view as it was, but with the hand.
    let told = desk.until("the wrong file is told, and the hand stays", |picture| {
        [&palette, &paused].iter().all(|other| in_view(picture) != in_view(other))
            && error_pixels(picture) > 100
            && changed(&paused, picture) < 0.5
    });
    desk.keep(&told, "wrong-file");
    desk.tool("key ctrl+q");
    let start = Instant::now();
    while desk.viewer.0.try_wait().unwrap().is_none() {
        assert!(start.elapsed() < PATIENCE, "the viewer does not end");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(desk.viewer.0.wait().unwrap().success());
}
