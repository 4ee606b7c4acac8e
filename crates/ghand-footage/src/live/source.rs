//! Where live frames come from.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::camera::Camera;
use super::system::System;
use crate::video::Video;
use crate::video::programs::{Program, each_frame_once};
use crate::{Footage, FootageError};

/// Longest edge of live frames, pixels. Networks look at fewer.
const LONGEST_EDGE: u32 = 640;

/// What is asked of a camera; the next is tried where it refuses. Some systems choose a slow rate or a large picture by
/// themselves, others refuse what a camera does not have.
const WISHES: [&[&str]; 3] = [&["-framerate", "30", "-video_size", "640x480"], &["-framerate", "30"], &[]];

/// Where live frames come from: a camera of this computer, or a video.
#[derive(Debug, Clone)]
pub struct LiveSource(Kind);

#[derive(Debug, Clone)]
enum Kind {
    Camera(Camera, System),
    /// A video, with filters of ffmpeg that make its frames RGB pictures.
    Video(PathBuf, Box<Video>, String),
}

impl LiveSource {
    /// The first camera.
    ///
    /// # Errors
    /// If none is connected.
    pub fn first_camera() -> Result<LiveSource, FootageError> {
        let system = System::here();
        Ok(LiveSource(Kind::Camera(Camera::first(system)?, system)))
    }

    /// All connected cameras, in the order of the system. This may take a second: on some systems ffmpeg lists them.
    pub fn cameras() -> Vec<LiveSource> {
        let system = System::here();
        system.cameras().into_iter().map(|camera| LiveSource(Kind::Camera(camera, system))).collect()
    }

    /// A camera by its number from 0, its name or a part of it, or on Linux its device (`/dev/video2`); or the file of a
    /// video. A number is always that of a camera, whatever files there are.
    ///
    /// # Errors
    /// One sentence if there is no such camera and no such file, or if the file is not a video that ffmpeg can read.
    pub fn find(text: &OsStr) -> Result<LiveSource, FootageError> {
        let path = Path::new(text);
        let system = System::here();
        let name = text.to_string_lossy();
        let is_number = name.parse::<u32>().is_ok();
        let kind = std::fs::metadata(path).ok().filter(|_| !is_number);
        match kind {
            Some(kind) if kind.is_file() => Self::video(path),
            Some(kind) if kind.is_dir() => Err(FootageError::unusable(path, "is a folder; give a video or a camera")),
            Some(_) | None => Ok(LiveSource(Kind::Camera(Camera::find(&name, system)?, system))),
        }
    }

    /// A video.
    ///
    /// # Errors
    /// One sentence if it is not a video that ffmpeg can read.
    pub fn video(path: &Path) -> Result<LiveSource, FootageError> {
        let Some(video) = Footage::open(path)?.into_video() else {
            return Err(FootageError::unusable(path, "is a picture; give a video or a camera"));
        };
        let filters = video.filters_within(LONGEST_EDGE);
        Ok(LiveSource(Kind::Video(path.into(), video, filters)))
    }

    /// Its name for users.
    pub fn name(&self) -> String {
        match &self.0 {
            Kind::Camera(camera, _) => camera.name.clone(),
            Kind::Video(path, ..) => path.display().to_string(),
        }
    }

    /// The camera's system; `None` for a video.
    pub(super) fn system(&self) -> Option<System> {
        match &self.0 {
            Kind::Camera(_, system) => Some(*system),
            Kind::Video(..) => None,
        }
    }

    /// Commands that write frames as pictures (PPM) to their output; each is tried if the one before it gives none.
    pub(super) fn commands(&self) -> Vec<Command> {
        match &self.0 {
            Kind::Camera(camera, system) => WISHES.iter().map(|wishes| of_camera(camera, *system, wishes)).collect(),
            Kind::Video(path, video, filters) => vec![of_video(path, video, filters)],
        }
    }
}

fn of_camera(camera: &Camera, system: System, wishes: &[&str]) -> Command {
    let mut command = reader();
    // Frames are decoded one by one: several at once would be late.
    command.args(["-fflags", "nobuffer", "-flags", "low_delay", "-f", system.format()]).args(wishes);
    let size = format!("scale='min({LONGEST_EDGE},iw)':'min({LONGEST_EDGE},ih)':force_original_aspect_ratio=decrease");
    command.arg("-i").arg(&camera.input).args(["-an", "-vf", &format!("{size},format=rgb24")]);
    written(command)
}

/// At its own pace, again and again.
fn of_video(path: &Path, video: &Video, filters: &str) -> Command {
    let mut command = reader();
    let mut input = std::ffi::OsString::from("file:");
    input.push(path);
    command.args(["-protocol_whitelist", "file", "-re", "-stream_loop", "-1", "-i"]).arg(input);
    command.args(["-map", &video.map(), "-vf", filters]);
    written(command)
}

/// ffmpeg, in the process group of this program: Ctrl-C in a terminal must end both, also while a camera gives nothing.
fn reader() -> Command {
    let mut command = Program::Ffmpeg.command_in_group();
    command.args(["-nostdin", "-nostats", "-loglevel", "level+error"]);
    command
}

fn written(mut command: Command) -> Command {
    command.args([
        each_frame_once(),
        "passthrough",
        "-c:v",
        "ppm",
        "-f",
        "image2pipe",
        "-flush_packets",
        "1",
        "pipe:1",
    ]);
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(command: &Command) -> Vec<String> {
        command.get_args().map(|word| word.to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn the_name_of_a_camera_is_one_word_of_the_command() {
        let name = "a b\"; $(rm -r /)";
        for system in [System::Linux, System::MacOs, System::Windows] {
            let camera = Camera { name: name.into(), input: format!("video={name}") };
            let source = LiveSource(Kind::Camera(camera, system));
            let commands = source.commands();
            assert_eq!(commands.len(), 3);
            for command in &commands {
                let line = line(command);
                let at = line.iter().position(|word| *word == format!("video={name}")).unwrap();
                assert_eq!((line[at - 1].as_str(), line.contains(&system.format().to_owned())), ("-i", true));
            }
            assert!(!line(&commands[2]).iter().any(|word| word == "-framerate"));
        }
    }

    #[test]
    fn what_is_not_a_source_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mp4");
        for (content, part) in [(&b""[..], "is empty"), (b"text", "is not a video")] {
            std::fs::write(&file, content).unwrap();
            let error = LiveSource::find(file.as_os_str()).unwrap_err().to_string();
            assert!(error.starts_with(&file.display().to_string()) && error.contains(part), "{error}");
        }
        image::RgbImage::new(4, 4).save(folder.path().join("a.png")).unwrap();
        for (path, part) in [
            (folder.path().to_path_buf(), "is a folder"),
            (folder.path().join("a.png"), "is a picture"),
            (folder.path().join("none.mp4"), "is neither a camera nor a file"),
        ] {
            let error = LiveSource::find(path.as_os_str()).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
