//! A video, or pictures one after the other.

use std::path::{Path, PathBuf};

use ghand_files::input_file;

use crate::frames::Frames;
use crate::pictures::Pictures;
use crate::video::Video;
use crate::{FootageError, StatedFocal, pictures};

/// The rate of pictures, which have no clock, frames per second.
const PICTURE_RATE: f64 = crate::clock::USUAL_RATE;

/// A video, or pictures one after the other, of one camera.
#[derive(Debug, Clone)]
pub struct Footage {
    path: PathBuf,
    size: (u32, u32),
    times: Vec<f64>,
    rate: f64,
    remarks: Vec<String>,
    source: Source,
}

#[derive(Debug, Clone)]
pub(crate) enum Source {
    Video(Box<Video>),
    Pictures(Pictures),
}

impl Footage {
    /// Opens a video, a picture, or a folder of pictures, in the order of their names (`frame9` before `frame10`). Reads
    /// headers and times only, not the frames.
    ///
    /// # Errors
    /// [`FootageError`] says in one sentence what is wrong and what to do: ffmpeg is not installed, the file is empty, not
    /// a video, lacks its end, or has no pictures; the folder has none; pictures differ in size.
    pub fn open(path: &Path) -> Result<Footage, FootageError> {
        let kind = std::fs::metadata(path).map_err(FootageError::file(path))?;
        if kind.is_dir() {
            return Self::of(path, Pictures::of_folder(path)?);
        }
        // Refuses pipes and devices.
        let length = input_file::open(path).and_then(|file| file.metadata()).map_err(FootageError::file(path))?.len();
        if length == 0 {
            return Err(FootageError::unusable(path, "is empty (0 bytes); copy it again from the camera"));
        }
        if pictures::is_picture(path)? {
            return Self::of(path, Pictures::new(vec![path.into()])?);
        }
        let (video, times, mut remarks) = Video::open(path)?;
        let (rate, uneven) = crate::clock::rate(&times).unwrap_or((video.stated_rate().unwrap_or(PICTURE_RATE), None));
        remarks.extend(uneven);
        Ok(Footage {
            path: path.into(),
            size: video.size(),
            times,
            rate,
            remarks,
            source: Source::Video(Box::new(video)),
        })
    }

    /// Pictures in this order.
    ///
    /// # Errors
    /// As in [`Footage::open`], and if there are none.
    pub fn of_pictures(paths: &[PathBuf]) -> Result<Footage, FootageError> {
        Self::of(paths.first().map_or(Path::new("pictures"), PathBuf::as_path), Pictures::new(paths.to_vec())?)
    }

    /// The video, if it is one.
    pub(crate) fn into_video(self) -> Option<Box<Video>> {
        match self.source {
            Source::Video(video) => Some(video),
            Source::Pictures(_) => None,
        }
    }

    fn of(path: &Path, pictures: Pictures) -> Result<Footage, FootageError> {
        let count = pictures.paths().len();
        let remarks =
            (count > 1).then(|| format!("pictures have no times: {PICTURE_RATE} frames per second are assumed"));
        Ok(Footage {
            path: path.into(),
            size: pictures.size(),
            times: (0..count).map(|k| k as f64 / PICTURE_RATE).collect(),
            rate: PICTURE_RATE,
            remarks: remarks.into_iter().collect(),
            source: Source::Pictures(pictures),
        })
    }

    /// The file or folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Columns and rows of all frames, as a player shows them: turned as the camera was held, with square pixels.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// The time of each frame, in order, seconds of the file's own clock, whose zero means nothing. At least one.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Whether the times are the file's; those of pictures are assumed.
    pub fn has_times(&self) -> bool {
        matches!(&self.source, Source::Video(video) if video.has_times())
    }

    /// The usual rate, frames per second.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// The focal length that the footage states: pictures in their Exif data, videos of phones in their metadata.
    pub fn stated_focal(&self) -> Option<StatedFocal> {
        match &self.source {
            Source::Pictures(pictures) => pictures.stated_focal(),
            Source::Video(video) => video.stated_focal(),
        }
    }

    /// What the user should know, one sentence each.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// The name of a frame: its number with at least four digits, or the name of its picture without extension.
    pub fn name(&self, number: usize) -> String {
        let stem = match &self.source {
            Source::Pictures(pictures) => pictures.paths().get(number).and_then(|path| path.file_stem()),
            Source::Video(_) => None,
        };
        stem.map_or_else(|| format!("{number:04}"), |stem| stem.to_string_lossy().into_owned())
    }

    /// All frames, in order. Where a video is damaged, frames may be missing; the remaining ones keep their numbers.
    ///
    /// # Errors
    /// If ffmpeg cannot be started.
    pub fn frames(&self) -> Result<Frames, FootageError> {
        Frames::new(&self.source, &self.times, None)
    }

    /// The frames of these numbers, ascending, each once; numbers that do not exist are ignored. Videos are decoded from
    /// their beginning to the last of these.
    ///
    /// # Errors
    /// As in [`Footage::frames`].
    pub fn frames_at(&self, numbers: &[usize]) -> Result<Frames, FootageError> {
        let mut wanted: Vec<usize> = numbers.iter().copied().filter(|number| *number < self.times.len()).collect();
        wanted.sort_unstable();
        wanted.dedup();
        Frames::new(&self.source, &self.times, Some(wanted))
    }
}
