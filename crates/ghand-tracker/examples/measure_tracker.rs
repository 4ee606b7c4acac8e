//! Tracks the hands of a film and prints in how many frames a hand was found, and how long a frame took.
//!
//! `cargo run -p ghand-tracker --example measure_tracker -- FILM WIDTH HEIGHT [TRUTH]` (needs ffmpeg). With the `truth.json`
//! of made footage (`ghand capture --footage`) it also prints how far landmarks are from the true ones, and on how many
//! hands the side is right.

use std::error::Error;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use ghand_core::Side;
use ghand_tracker::HandTracker;
use glam::DVec2;
use serde_json::Value;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let ([film, width, height], truth) = match &arguments[..] {
        [film, width, height] => ([film, width, height], None),
        [film, width, height, truth] => ([film, width, height], Some(Truth::read(truth, film)?)),
        _ => return Err("usage: measure_tracker FILM WIDTH HEIGHT [TRUTH]".into()),
    };
    let [width, height]: [u32; 2] = [width.parse()?, height.parse()?];
    let mut ffmpeg = Command::new("ffmpeg")
        .args(["-loglevel", "error", "-i", film, "-vf", &format!("scale={width}:{height}")])
        // Else it would repeat frames where a camera has lost some.
        .args(["-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
        .stdout(Stdio::piped())
        .spawn()?;
    let mut pictures = ffmpeg.stdout.take().ok_or("no output of ffmpeg")?;
    let mut picture = vec![0; width as usize * height as usize * 3];
    let mut tracker = HandTracker::new(1);
    let mut frames = 0_u32;
    let mut found = 0_u32;
    let mut identities = 0;
    let mut time = Duration::ZERO;
    let mut distances = vec![];
    let mut right_sides = 0;
    while pictures.read_exact(&mut picture).is_ok() {
        let start = Instant::now();
        let hands = tracker.track(&picture, width, height)?;
        time += start.elapsed();
        if let Some(hand) = hands.first() {
            found += 1;
            identities = hand.identity + 1;
            if let Some(truth) = &truth {
                let landmarks = truth.landmarks.get(frames as usize).ok_or("the truth has fewer frames")?;
                let apart = |(found, known): (DVec2, &DVec2)| found.distance(*known);
                distances.extend(hand.landmarks.into_iter().zip(landmarks).map(apart));
                right_sides += u32::from(hand.side == truth.side);
            }
        }
        frames += 1;
    }
    ffmpeg.wait()?;
    let mean_ms = time.as_secs_f64() * 1000.0 / f64::from(frames.max(1));
    println!("a hand in {found} of {frames} frames, found anew {identities} times; {mean_ms:.1} ms per frame");
    if !distances.is_empty() {
        distances.sort_by(f64::total_cmp);
        let [median, most] = [0.5, 0.9].map(|part| distances[(part * distances.len() as f64) as usize]);
        println!(
            "landmarks: median {median:.1} px from the true ones, 90 % within {most:.1} px; side right on {right_sides}"
        );
    }
    Ok(())
}

/// What made footage shows.
struct Truth {
    side: Side,
    /// Of each frame, pixels.
    landmarks: Vec<Vec<DVec2>>,
}

impl Truth {
    /// Reads what the truth says about a film, by its name.
    fn read(path: &str, film: &str) -> Result<Truth, Box<dyn Error>> {
        let truth: Value = serde_json::from_slice(&std::fs::read(path)?)?;
        let name = Path::new(film).file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let cameras = truth["cameras"].as_array().ok_or("the truth has no cameras")?;
        let camera = cameras.iter().find(|camera| camera["video"] == name).ok_or("the truth does not know the film")?;
        let point = |point: &Value| {
            let [x, y] = [0, 1].map(|k| point[k].as_f64().unwrap_or(f64::NAN));
            DVec2::new(x, y)
        };
        let frame = |frame: &Value| frame["landmarks"].as_array().map_or(vec![], |all| all.iter().map(point).collect());
        Ok(Truth {
            side: if truth["side"] == "left" { Side::Left } else { Side::Right },
            landmarks: camera["frames"].as_array().map_or(vec![], |frames| frames.iter().map(frame).collect()),
        })
    }
}
