//! COLMAP's text files: one thing on each line, `#` before comments.

use std::path::Path;
use std::str::FromStr;

use super::{Image, Lens, Sensor};
use crate::error::CaptureError;
use crate::reading::validation::FileValidator;

/// The words of a line, which are taken one after the other.
struct Words<'a> {
    path: &'a Path,
    line: usize,
    rest: &'a str,
}

impl<'a> Words<'a> {
    fn invalid(&self, problem: impl Into<String>) -> CaptureError {
        FileValidator { path: self.path }.invalid(format!("line {}", self.line), problem)
    }

    fn next(&mut self) -> Option<&'a str> {
        let text = self.rest.trim_start();
        let end = text.find(char::is_whitespace).unwrap_or(text.len());
        let (word, rest) = text.split_at(end);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    fn read<T: FromStr>(&mut self, what: &str) -> Result<T, CaptureError> {
        let word = self.next();
        word.and_then(|word| word.parse().ok())
            .ok_or_else(|| self.invalid(format!("has no {what} where COLMAP has one; copy the model again")))
    }

    fn place(&mut self) -> Result<[f64; 7], CaptureError> {
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = self.read("number of the pose")?;
        }
        if numbers.iter().all(|number: &f64| number.is_finite()) {
            Ok(numbers)
        } else {
            Err(self.invalid("has a number that is not finite; reconstruct it again"))
        }
    }
}

/// The lines that are no comments.
fn lines<'a>(path: &'a Path, text: &'a str) -> impl Iterator<Item = Words<'a>> {
    let lines = text.lines().enumerate().map(move |(k, rest)| Words { path, line: k + 1, rest });
    lines.filter(|words| !words.rest.starts_with('#'))
}

/// `CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]`.
pub(super) fn lenses(path: &Path, text: &str) -> Result<Vec<Lens>, CaptureError> {
    let lens = |mut words: Words| {
        let lens = Lens {
            id: words.read("id")?,
            model: words.read("lens model")?,
            size: [words.read("width")?, words.read("height")?],
            parameters: vec![],
        };
        let mut parameters = vec![];
        while !words.rest.trim().is_empty() {
            parameters.push(words.read("number")?);
        }
        Ok(Lens { parameters, ..lens })
    };
    lines(path, text).filter(|words| !words.rest.trim().is_empty()).map(lens).collect()
}

/// `IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME`, and a line of keypoints, which may be empty.
pub(super) fn images(path: &Path, text: &str) -> Result<Vec<Image>, CaptureError> {
    let image = |mut words: Words| {
        words.read::<u32>("id")?;
        let place = words.place()?;
        let lens = words.read("camera")?;
        let name = words.rest.trim().to_owned();
        if name.is_empty() {
            Err(words.invalid("has no name; copy the model again"))
        } else {
            Ok(Image { lens, name, place })
        }
    };
    lines(path, text).step_by(2).filter(|words| !words.rest.trim().is_empty()).map(image).collect()
}

/// `RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as (SENSOR_TYPE, SENSOR_ID, HAS_POSE, [pose])`. Only
/// cameras are returned.
pub(super) fn rigs(path: &Path, text: &str) -> Result<Vec<Vec<Sensor>>, CaptureError> {
    let rig = |mut words: Words| {
        words.read::<u32>("id")?;
        let count: usize = words.read("number of sensors")?;
        let mut sensors = vec![];
        for number in 0..count {
            let kind: String = words.read("kind of sensor")?;
            let lens = words.read("sensor")?;
            let has_pose = number > 0 && words.read::<u8>("flag")? != 0;
            let place = if has_pose { Some(words.place()?) } else { None };
            if kind == "CAMERA" {
                sensors.push(Sensor { lens, place });
            } else if number == 0 {
                return Err(words.invalid("has a rig around another sensor than a camera, which is not read"));
            }
        }
        Ok(sensors)
    };
    lines(path, text).filter(|words| !words.rest.trim().is_empty()).map(rig).collect()
}
