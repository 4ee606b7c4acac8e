//! Frames of a video, by ffmpeg, through a pipe.
//!
//! ffmpeg writes raw frames to its output and the time of each one to its messages (filter `showinfo`), so that each frame
//! has its number even if others cannot be decoded.

use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, ChildStderr, ChildStdout, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};

use super::Video;
use super::programs::{Program, each_frame_once};
use crate::FootageError;

/// Most characters of a message of ffmpeg that are kept.
const LONGEST_MESSAGE: usize = 300;

/// A running decoder. Dropping it stops ffmpeg.
pub(crate) struct Decoder {
    path: PathBuf,
    child: Child,
    frames: ChildStdout,
    messages: Receiver<Message>,
    /// Bytes of a frame.
    length: usize,
    /// Times of the file's frames; empty if it has none.
    times: Vec<f64>,
    /// How many frames the file has.
    count: usize,
    /// The number that the next frame has at least.
    next: usize,
    complaint: Option<String>,
}

enum Message {
    /// The time of the next frame, seconds; `None` if it has none.
    Time(Option<f64>),
    Error(String),
}

impl Decoder {
    /// Starts ffmpeg. `times` are those of the frames.
    pub fn start(video: &Video, times: &[f64]) -> Result<Decoder, FootageError> {
        let (width, height) = video.size;
        let filters = format!("{},showinfo=checksum=0", video.filters);
        let map = video.map();
        let mut child = Program::Ffmpeg
            .reading(&video.path)
            .args(["-map", &map, each_frame_once(), "passthrough", "-vf", &filters])
            .args(["-f", "rawvideo", "-pix_fmt", "rgb24", "pipe:1"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(Program::Ffmpeg.failure(&video.path))?;
        let (Some(frames), Some(told)) = (child.stdout.take(), child.stderr.take()) else {
            return Err(FootageError::unusable(&video.path, "ffmpeg has no output"));
        };
        let (sender, messages) = channel();
        std::thread::spawn(move || listen(told, &sender));
        Ok(Decoder {
            path: video.path.clone(),
            child,
            frames,
            messages,
            length: width as usize * height as usize * 3,
            times: if video.has_times { times.to_vec() } else { vec![] },
            count: times.len(),
            next: 0,
            complaint: None,
        })
    }

    /// The next frame into `rgb`, and its number; `None` at the end.
    pub fn next_into(&mut self, rgb: &mut Vec<u8>) -> Result<Option<usize>, FootageError> {
        while self.next < self.count {
            rgb.clear();
            rgb.reserve(self.length);
            // An incomplete frame is none.
            let read =
                (&mut self.frames).take(self.length as u64).read_to_end(rgb).map_err(FootageError::file(&self.path))?;
            if read < self.length {
                break;
            }
            if let Some(number) = {
                let time = self.time_of_frame();
                self.number_of(time)
            } {
                self.next = number + 1;
                return Ok(Some(number));
            }
        }
        if self.next == 0 {
            return Err(self.failure());
        }
        Ok(None)
    }

    /// ffmpeg tells the time of a frame before it writes the frame.
    fn time_of_frame(&mut self) -> Option<f64> {
        loop {
            match self.messages.recv() {
                Ok(Message::Time(time)) => return time,
                Ok(Message::Error(text)) => {
                    self.complaint.get_or_insert(text);
                }
                Err(_) => return None,
            }
        }
    }

    /// The number of a frame of that time; `None` if it is not one of those that are still to come.
    fn number_of(&self, time: Option<f64>) -> Option<usize> {
        let (Some(time), false) = (time, self.times.is_empty()) else { return Some(self.next) };
        let after = self.times.partition_point(|other| *other < time);
        let distance = |k: &usize| self.times.get(*k).map_or(f64::INFINITY, |other| (other - time).abs());
        let nearest =
            [after.saturating_sub(1), after].into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        // Several frames of one time.
        let number = if nearest < self.next && distance(&self.next) == 0.0 { self.next } else { nearest };
        (number >= self.next).then_some(number)
    }

    fn failure(&mut self) -> FootageError {
        // It has ended, and with it its messages.
        while let Ok(message) = self.messages.recv() {
            if let Message::Error(text) = message {
                self.complaint.get_or_insert(text);
            }
        }
        let complaint = self.complaint.as_deref().unwrap_or("it gives no reason");
        let problem =
            format!("ffmpeg cannot decode any frame of it ({complaint}); convert it to H.264, or record again");
        FootageError::unusable(&self.path, problem)
    }
}

impl Drop for Decoder {
    fn drop(&mut self) {
        // Nothing to do if it has ended, and no way to report if it cannot be stopped.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends on the messages of ffmpeg until it ends or nobody listens.
fn listen(told: ChildStderr, sender: &Sender<Message>) {
    let mut base: Option<f64> = None;
    let mut lines = BufReader::new(told);
    let mut line = vec![];
    loop {
        line.clear();
        if !matches!(lines.read_until(b'\n', &mut line), Ok(1..)) {
            return;
        }
        let text = String::from_utf8_lossy(&line);
        let message = if text.contains("_showinfo_") {
            if let Some(ratio) = after(&text, "config in time_base: ") {
                base = ratio.split_once('/').and_then(|(a, b)| Some(a.parse::<f64>().ok()? / b.parse::<f64>().ok()?));
            }
            let Some(ticks) = after(&text, " pts:") else { continue };
            Message::Time(ticks.parse::<f64>().ok().and_then(|ticks| Some(ticks * base?)))
        } else if let Some((_, problem)) = text.split_once("[error] ").or_else(|| text.split_once("[fatal] ")) {
            Message::Error(problem.trim().chars().take(LONGEST_MESSAGE).collect())
        } else {
            continue;
        };
        // Whoever has stopped reading frames closes the pipe, too.
        if sender.send(message).is_err() {
            return;
        }
    }
}

/// The word behind a text, which may be padded, without a comma.
fn after<'a>(text: &'a str, before: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(before)?;
    rest.split_whitespace().next().map(|word| word.trim_end_matches(','))
}
