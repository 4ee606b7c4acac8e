//! What a video says of itself, by ffprobe.

pub(crate) mod decoder;
pub(crate) mod programs;
mod quicktime;
mod stream;

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use ghand_files::input_file;

use self::programs::Program;
use self::stream::{Format, Probed, Stream};
use crate::{FootageError, StatedFocal};

/// Most frames of a video: 46 hours at 60 per second.
const MOST_FRAMES: usize = 10_000_000;
/// Most pixels of a frame, four times those of 8K video.
const MOST_PIXELS: u64 = 1 << 27;
/// A video whose frames end this much before its stated end, as a part of its length, has lost its end.
const LOST_PART: f64 = 0.02;
/// As has one that lacks more than this, seconds.
const LEAST_LOST: f64 = 0.5;

/// A video.
#[derive(Debug, Clone)]
pub(crate) struct Video {
    path: PathBuf,
    stream: Stream,
    size: (u32, u32),
    has_times: bool,
    focal: Option<StatedFocal>,
    /// Filters of ffmpeg that make its frames RGB pictures of `size`.
    filters: String,
}

impl Video {
    /// The video with the times of its frames, seconds, and remarks.
    pub fn open(path: &Path) -> Result<(Video, Vec<f64>, Vec<String>), FootageError> {
        let Probed { mut streams, format } = probe(path)?;
        let count = streams.len();
        let kinds: Vec<String> = streams.iter().filter_map(|stream| stream.codec_type.clone()).collect();
        streams.retain(Stream::is_film);
        if streams.is_empty() {
            let has = match kinds.iter().any(|kind| kind == "audio") {
                true => "has sound, but no pictures",
                false if count == 0 => "is not a video",
                false => "has no video stream",
            };
            return Err(FootageError::unusable(path, format!("{has}; give a video or a folder of pictures")));
        }
        let several = streams.len() > 1;
        let stream = streams.swap_remove(0);
        let Some(size) = stream.size().filter(|(w, h)| u64::from(*w) * u64::from(*h) <= MOST_PIXELS) else {
            let problem = "has no usable size of its pictures; it is damaged, or is not a video";
            return Err(FootageError::unusable(path, problem));
        };
        let mut remarks = stream.remarks();
        if several {
            remarks.push(format!("has several video streams: the first, number {}, is taken", stream.index));
        }
        let (mut times, has_times) = times(path, &stream)?;
        if times.is_empty() {
            return Err(FootageError::unusable(path, "has no frames; it is damaged, or its recording was interrupted"));
        }
        if !has_times {
            let rate = stream.rate().unwrap_or(crate::clock::USUAL_RATE);
            remarks.push(format!("the file has no times of its frames: {rate} frames per second are assumed"));
            times = (0..times.len()).map(|k| k as f64 / rate).collect();
        }
        remarks.extend(lost_end(&stream, &format, &times));
        let filters = stream.filters(size, can_map_tones);
        let mut file = input_file::open(path).map_err(FootageError::file(path))?;
        let lens = quicktime::lens(&mut file);
        let focal = lens.equivalent.and_then(|film| StatedFocal::of_video(film, size, lens.name.as_deref()));
        Ok((Video { path: path.into(), stream, size, has_times, focal, filters }, times, remarks))
    }

    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Its stream, as ffmpeg names it.
    pub fn map(&self) -> String {
        format!("0:{}", self.stream.index)
    }

    /// Filters that make its frames RGB pictures of which no edge is longer than `longest`.
    pub fn filters_within(&self, longest: u32) -> String {
        let (width, height) = self.size;
        let part = (f64::from(longest) / f64::from(width.max(height))).min(1.0);
        let scaled = |edge: u32| ((f64::from(edge) * part).round() as u32).max(1);
        self.stream.filters((scaled(width), scaled(height)), can_map_tones)
    }

    pub fn has_times(&self) -> bool {
        self.has_times
    }

    /// As [`crate::Footage::stated_focal`].
    pub fn stated_focal(&self) -> Option<StatedFocal> {
        self.focal.clone()
    }

    pub fn stated_rate(&self) -> Option<f64> {
        self.stream.rate()
    }
}

/// Whether ffmpeg has the filters for HDR.
fn can_map_tones() -> bool {
    Program::Ffmpeg.has_filters(&["zscale", "tonemap"])
}

fn probe(path: &Path) -> Result<Probed, FootageError> {
    let output = Program::Ffprobe
        .reading(path)
        .args(["-show_entries", "stream:stream_side_data:stream_tags:stream_disposition:format", "-of", "json"])
        .output()
        .map_err(Program::Ffprobe.failure(path))?;
    if !output.status.success() {
        let complaint = String::from_utf8_lossy(&output.stderr);
        let problem = if complaint.contains("moov atom not found") && begins_as_mp4(path) {
            "is incomplete: the index at its end is missing; copy it again from the camera, or record again".into()
        } else {
            let complaint = complaint.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or_default();
            let complaint = complaint.rsplit(": ").next().unwrap_or(complaint);
            format!("is not a video that ffmpeg can read ({complaint}); give a video or a folder of pictures")
        };
        return Err(FootageError::unusable(path, problem));
    }
    serde_json::from_slice(&output.stdout)
        .map_err(|error| FootageError::unusable(path, format!("ffprobe describes it in an unknown way ({error})")))
}

/// Whether a file has the first bytes of MP4; ffmpeg takes names for kinds.
fn begins_as_mp4(path: &Path) -> bool {
    let mut head = [0; 8];
    let read = input_file::open(path).and_then(|mut file| file.read_exact(&mut head));
    read.is_ok() && head.ends_with(b"ftyp")
}

/// The times of the frames that a player shows, ascending, and whether the file has them; else zeros. Packets are read,
/// not decoded, unless half pictures come in packets of their own.
fn times(path: &Path, stream: &Stream) -> Result<(Vec<f64>, bool), FootageError> {
    let entries = match stream.is_interlaced() {
        true => "frame=best_effort_timestamp",
        false => "packet=pts,flags",
    };
    let mut child = Program::Ffprobe
        .reading(path)
        .args(["-select_streams", &stream.index.to_string(), "-show_entries", entries, "-of", "compact=p=0"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(Program::Ffprobe.failure(path))?;
    // Decimal seconds of ffprobe are rounded.
    let tick = stream.tick();
    let mut times = vec![];
    let mut without = 0;
    let lines = child.stdout.take().map(|out| BufReader::new(out).lines());
    for line in lines.into_iter().flatten() {
        let line = line.map_err(FootageError::file(path))?;
        let field = |name: &str| line.split('|').find_map(|part| part.strip_prefix(name)?.strip_prefix('='));
        // Packets before the start that the file states are decoded, but not shown.
        if line.trim().is_empty() || field("flags").is_some_and(|flags| flags.contains('D')) {
            continue;
        }
        let ticks = field("pts").or_else(|| field("best_effort_timestamp"));
        match ticks.and_then(|ticks| Some(ticks.parse::<i64>().ok()? as f64 * tick)).filter(|time| time.is_finite()) {
            Some(time) => times.push(time),
            None => without += 1,
        }
        if times.len() + without > MOST_FRAMES {
            // Nobody waits for it: it ends when its pipe is closed.
            return Err(FootageError::unusable(path, format!("has more than {MOST_FRAMES} frames; cut it into parts")));
        }
    }
    // What it could not read is missing in the times.
    let _ = child.wait();
    if without > 0 {
        return Ok((vec![0.0; times.len() + without], false));
    }
    times.sort_by(f64::total_cmp);
    Ok((times, true))
}

/// A remark if a file ends before it says.
fn lost_end(stream: &Stream, format: &Format, times: &[f64]) -> Option<String> {
    let read = times.len();
    if let Some(stated) = stream.frame_count().filter(|stated| *stated > read && stream.is_film()) {
        let lost = (stated - read) as f64 > LOST_PART * stated as f64;
        return lost.then(|| format!("is incomplete: it says that it has {stated} frames, and {read} can be read"));
    }
    let length = times.last()? - times.first()?;
    let stated = stream.duration().or(format.duration())?;
    let lost = stated - length > (LOST_PART * stated).max(LEAST_LOST);
    lost.then(|| format!("is incomplete: it says that it lasts {stated:.1} s, and {length:.1} s can be read"))
}
