use std::path::PathBuf;

use super::*;

const PATIENCE: Duration = Duration::from_secs(20);

/// A film of three seconds, 1280 x 720, 25 frames per second, whose frames become brighter from black to white.
fn film(folder: &Path) -> PathBuf {
    let path = folder.join("it's a film; $(1).mp4");
    let brighter = "color=black:s=1280x720:r=25:d=3,format=gray,geq=lum='16+N*2.9'";
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-v", "error", "-f", "lavfi", "-i", brighter, "-c:v", "mpeg4", "-q:v", "3"]).arg(&path);
    assert!(ffmpeg.status().unwrap().success());
    path
}

fn next(frames: &LiveFrames) -> LiveFrame {
    frames.take(PATIENCE).unwrap().expect("no frame")
}

/// The time of a frame in the film, frames.
fn place(frame: &LiveFrame) -> f64 {
    (f64::from(frame.rgb[frame.rgb.len() / 2]) - 16.0) / 2.9
}

/// Number of the running ffmpeg.
fn process(frames: &LiveFrames) -> u32 {
    frames.shared.decoder().child.as_ref().unwrap().id()
}

/// Whether a process is there, and is not a dead one.
fn is_running(process: u32) -> bool {
    let state = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    state.contains("ffmpeg") && !state.contains(") Z ")
}

#[test]
fn a_video_plays_at_its_pace_and_whoever_is_slow_gets_the_newest_frame() {
    let folder = tempfile::tempdir().unwrap();
    let frames = LiveFrames::start(LiveSource::video(&film(folder.path())).unwrap()).unwrap();
    let first = next(&frames);
    assert_eq!((first.width, first.height), (640, 360));
    let mut places = vec![];
    for _ in 0..8 {
        thread::sleep(Duration::from_millis(250));
        let frame = next(&frames);
        assert!(frame.arrived.elapsed() < Duration::from_millis(200), "late by {:?}", frame.arrived.elapsed());
        let expected = place(&first) + 25.0 * (frame.arrived - first.arrived).as_secs_f64();
        places.push((place(&frame), expected));
    }
    // Two of three seconds: not yet at the beginning again. Frames may come a little early or late on a busy computer.
    let is_on_time = |(place, expected): &(f64, f64)| (place - expected).abs() < 5.0;
    assert!(places.iter().all(is_on_time), "{places:?}");
    assert!(frames.dropped() > 20, "{} were dropped", frames.dropped());
}

#[test]
fn a_video_begins_again_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let frames = LiveFrames::start(LiveSource::video(&film(folder.path())).unwrap()).unwrap();
    let mut before = 0.0;
    let start = Instant::now();
    loop {
        assert!(start.elapsed() < PATIENCE, "it does not begin again");
        let now = place(&next(&frames));
        if now < before - 30.0 {
            break;
        }
        before = now;
    }
    let seconds = start.elapsed().as_secs_f64();
    assert!(seconds > 2.5, "a round took only {seconds} s");
}

#[test]
#[cfg(target_os = "linux")]
fn ffmpeg_ends_with_the_frames() {
    let folder = tempfile::tempdir().unwrap();
    let source = LiveSource::video(&film(folder.path())).unwrap();
    let frames = LiveFrames::start(source.clone()).unwrap();
    next(&frames);
    let first = process(&frames);
    assert!(is_running(first));
    drop(frames);
    assert!(!is_running(first));
    let frames = LiveFrames::start(source).unwrap();
    frames.stop();
    // What came before it may be taken; then nothing comes, and there is no reason to tell.
    while frames.take(PATIENCE).unwrap().is_some() {}
}

#[test]
#[cfg(target_os = "linux")]
fn a_decoder_that_ends_by_itself_is_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = film(folder.path());
    let frames = LiveFrames::start(LiveSource::video(&path).unwrap()).unwrap();
    next(&frames);
    let number = process(&frames).to_string();
    assert!(Command::new("kill").args(["-9", &number]).status().unwrap().success());
    let error = loop {
        if let Err(error) = frames.take(PATIENCE) {
            break error.to_string();
        }
    };
    assert!(error.starts_with(&path.display().to_string()) && error.contains("has stopped reading"), "{error}");
    assert_eq!(frames.take(PATIENCE).unwrap(), None);
}

#[test]
#[cfg(target_os = "linux")]
fn a_device_that_is_not_a_camera_is_told_in_a_sentence() {
    for (device, part) in [("/dev/null", "is not a camera"), ("/dev/nothing", "there is no such device")] {
        let error = match LiveSource::find(device.as_ref()) {
            Ok(source) => LiveFrames::start(source).unwrap().take(PATIENCE).unwrap_err(),
            Err(error) => error,
        };
        let error = error.to_string();
        assert!(error.starts_with(device) && error.contains(part), "{error}");
    }
}
