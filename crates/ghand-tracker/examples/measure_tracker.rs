//! Tracks the hands of a film and prints in how many frames a hand was found, and how long a frame took.
//!
//! `cargo run -p ghand-tracker --example measure_tracker -- FILM WIDTH HEIGHT` (needs ffmpeg).

use std::error::Error;
use std::io::Read;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use ghand_tracker::HandTracker;

fn main() -> Result<(), Box<dyn Error>> {
    let [film, width, height] = &std::env::args().skip(1).collect::<Vec<_>>()[..] else {
        return Err("usage: measure_tracker FILM WIDTH HEIGHT".into());
    };
    let [width, height]: [u32; 2] = [width.parse()?, height.parse()?];
    let mut ffmpeg = Command::new("ffmpeg")
        .args(["-loglevel", "error", "-i", film, "-vf", &format!("scale={width}:{height}")])
        .args(["-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
        .stdout(Stdio::piped())
        .spawn()?;
    let mut pictures = ffmpeg.stdout.take().ok_or("no output of ffmpeg")?;
    let mut picture = vec![0; width as usize * height as usize * 3];
    let mut tracker = HandTracker::new(1)?;
    let mut frames = 0_u32;
    let mut found = 0_u32;
    let mut identities = 0;
    let mut time = Duration::ZERO;
    while pictures.read_exact(&mut picture).is_ok() {
        let start = Instant::now();
        let hands = tracker.track(&picture, width, height)?;
        time += start.elapsed();
        frames += 1;
        if let Some(hand) = hands.first() {
            found += 1;
            identities = hand.identity + 1;
        }
    }
    ffmpeg.wait()?;
    let mean_ms = time.as_secs_f64() * 1000.0 / f64::from(frames.max(1));
    println!("a hand in {found} of {frames} frames, found anew {identities} times; {mean_ms:.1} ms per frame");
    Ok(())
}
