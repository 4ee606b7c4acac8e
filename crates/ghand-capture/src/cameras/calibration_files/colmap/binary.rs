//! COLMAP's binary files, little endian.

use std::path::Path;

use super::models::by_number;
use super::{Image, Lens, Sensor};
use crate::error::CaptureError;
use crate::reading::validation::FileValidator;

/// Bytes of a keypoint: its position and the number of its point in space.
const KEYPOINT: u64 = 24;
/// The kind of sensor that is a camera.
const CAMERA: i32 = 0;

/// Bytes that are taken one after the other.
struct Bytes<'a> {
    path: &'a Path,
    rest: &'a [u8],
}

impl<'a> Bytes<'a> {
    fn invalid(&self, problem: impl Into<String>) -> CaptureError {
        FileValidator { path: self.path }.invalid("file", problem)
    }

    fn truncated(&self) -> CaptureError {
        self.invalid("is truncated; copy the model again")
    }

    fn skip(&mut self, count: u64) -> Result<(), CaptureError> {
        let rest = usize::try_from(count).ok().and_then(|count| self.rest.get(count..));
        self.rest = rest.ok_or_else(|| self.truncated())?;
        Ok(())
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], CaptureError> {
        let (bytes, rest) = self.rest.split_first_chunk().ok_or_else(|| self.truncated())?;
        self.rest = rest;
        Ok(*bytes)
    }

    fn u32(&mut self) -> Result<u32, CaptureError> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn i32(&mut self) -> Result<i32, CaptureError> {
        Ok(i32::from_le_bytes(self.take()?))
    }

    fn u64(&mut self) -> Result<u64, CaptureError> {
        Ok(u64::from_le_bytes(self.take()?))
    }

    fn f64(&mut self) -> Result<f64, CaptureError> {
        Ok(f64::from_le_bytes(self.take()?))
    }

    fn place(&mut self) -> Result<[f64; 7], CaptureError> {
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = self.f64()?;
        }
        if numbers.iter().all(|number| number.is_finite()) {
            Ok(numbers)
        } else {
            Err(self.invalid("has a pose that is not finite; reconstruct it again"))
        }
    }

    /// Text up to a zero.
    fn text(&mut self) -> Result<String, CaptureError> {
        let end = self.rest.iter().position(|byte| *byte == 0).ok_or_else(|| self.truncated())?;
        let (text, rest) = self.rest.split_at(end);
        self.rest = rest.get(1..).unwrap_or_default();
        Ok(String::from_utf8_lossy(text).into_owned())
    }
}

pub(super) fn lenses(path: &Path, bytes: &[u8]) -> Result<Vec<Lens>, CaptureError> {
    let mut bytes = Bytes { path, rest: bytes };
    let mut lenses = vec![];
    for _ in 0..bytes.u64()? {
        let id = bytes.u32()?;
        let number = bytes.i32()?;
        let size = [bytes.u64()?, bytes.u64()?];
        let Some(model) = by_number(number) else {
            let problem =
                format!("has camera {id} with the lens model {number}, which is not read; reconstruct with OPENCV");
            return Err(bytes.invalid(problem));
        };
        let parameters = (0..model.parameters).map(|_| bytes.f64()).collect::<Result<_, _>>()?;
        lenses.push(Lens { id, model: model.name.into(), size, parameters });
    }
    Ok(lenses)
}

pub(super) fn images(path: &Path, bytes: &[u8]) -> Result<Vec<Image>, CaptureError> {
    let mut bytes = Bytes { path, rest: bytes };
    let mut images = vec![];
    for _ in 0..bytes.u64()? {
        bytes.u32()?;
        let place = bytes.place()?;
        let lens = bytes.u32()?;
        let name = bytes.text()?;
        let keypoints = bytes.u64()?;
        bytes.skip(keypoints.saturating_mul(KEYPOINT))?;
        images.push(Image { lens, name, place });
    }
    Ok(images)
}

/// The cameras of each rig.
pub(super) fn rigs(path: &Path, bytes: &[u8]) -> Result<Vec<Vec<Sensor>>, CaptureError> {
    let mut bytes = Bytes { path, rest: bytes };
    let mut rigs = vec![];
    for _ in 0..bytes.u64()? {
        bytes.u32()?;
        let mut sensors = vec![];
        for number in 0..bytes.u32()? {
            let kind = bytes.i32()?;
            let lens = bytes.u32()?;
            let has_pose = number > 0 && bytes.take::<1>()? != [0];
            let place = if has_pose { Some(bytes.place()?) } else { None };
            if kind == CAMERA {
                sensors.push(Sensor { lens, place });
            } else if number == 0 {
                return Err(bytes.invalid("has a rig around another sensor than a camera, which is not read"));
            }
        }
        rigs.push(sensors);
    }
    Ok(rigs)
}
