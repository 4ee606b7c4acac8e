//! COLMAP's lens models.

use super::super::super::distortion::Distortion;
use super::super::found::{CalibrationFormat, Projection};
use super::super::lens::pixels;

/// A lens model: its number in binary files, its name, and how many parameters it has.
pub(super) struct Model {
    pub number: i32,
    pub name: &'static str,
    pub parameters: usize,
}

/// Also models that are not read, so that errors can name them.
const MODELS: [Model; 18] = {
    const fn model(number: i32, name: &'static str, parameters: usize) -> Model {
        Model { number, name, parameters }
    }
    [
        model(0, "SIMPLE_PINHOLE", 3),
        model(1, "PINHOLE", 4),
        model(2, "SIMPLE_RADIAL", 4),
        model(3, "RADIAL", 5),
        model(4, "OPENCV", 8),
        model(5, "OPENCV_FISHEYE", 8),
        model(6, "FULL_OPENCV", 12),
        model(7, "FOV", 5),
        model(8, "SIMPLE_RADIAL_FISHEYE", 4),
        model(9, "RADIAL_FISHEYE", 5),
        model(10, "THIN_PRISM_FISHEYE", 12),
        model(11, "RAD_TAN_THIN_PRISM_FISHEYE", 16),
        model(12, "SIMPLE_DIVISION", 4),
        model(13, "DIVISION", 5),
        model(14, "SIMPLE_FISHEYE", 3),
        model(15, "FISHEYE", 4),
        model(16, "EUCM", 6),
        model(17, "EQUIRECTANGULAR", 2),
    ]
};

/// The model of that number.
pub(super) fn by_number(number: i32) -> Option<&'static Model> {
    MODELS.iter().find(|model| model.number == number)
}

/// The projection and distortion of a model's parameters.
pub(super) fn lens(model: &str, parameters: &[f64]) -> Result<(Projection, Option<Distortion>), String> {
    let pinhole = |k: [f64; 8]| {
        let is_straight = k.iter().all(|coefficient| *coefficient == 0.0);
        if is_straight { Ok(None) } else { Distortion::from_opencv(&k).map(Some) }
    };
    let (intrinsics, distortion) = match (model, parameters) {
        ("SIMPLE_PINHOLE", &[f, x, y]) => ([f, f, x, y], None),
        ("PINHOLE", &[fx, fy, x, y]) => ([fx, fy, x, y], None),
        ("SIMPLE_RADIAL", &[f, x, y, k]) => ([f, f, x, y], pinhole([k, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])?),
        ("RADIAL", &[f, x, y, k1, k2]) => ([f, f, x, y], pinhole([k1, k2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])?),
        ("OPENCV", &[fx, fy, x, y, k1, k2, p1, p2]) => ([fx, fy, x, y], pinhole([k1, k2, p1, p2, 0.0, 0.0, 0.0, 0.0])?),
        ("FULL_OPENCV", &[fx, fy, x, y, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            ([fx, fy, x, y], pinhole([k1, k2, p1, p2, k3, k4, k5, k6])?)
        }
        ("OPENCV_FISHEYE", &[fx, fy, x, y, k1, k2, k3, k4]) => {
            ([fx, fy, x, y], Some(Distortion::Fisheye([k1, k2, k3, k4])))
        }
        ("SIMPLE_FISHEYE", &[f, x, y]) => ([f, f, x, y], Some(Distortion::Fisheye([0.0; 4]))),
        ("FISHEYE", &[fx, fy, x, y]) => ([fx, fy, x, y], Some(Distortion::Fisheye([0.0; 4]))),
        ("SIMPLE_RADIAL_FISHEYE", &[f, x, y, k]) => ([f, f, x, y], Some(Distortion::Fisheye([k, 0.0, 0.0, 0.0]))),
        ("RADIAL_FISHEYE", &[f, x, y, k1, k2]) => ([f, f, x, y], Some(Distortion::Fisheye([k1, k2, 0.0, 0.0]))),
        _ => {
            return Err(match MODELS.iter().find(|known| known.name == model) {
                Some(known) if known.parameters != parameters.len() => {
                    format!(
                        "has {} parameters, {model} has {}; copy the model again",
                        parameters.len(),
                        known.parameters
                    )
                }
                _ => {
                    let model: String = model.chars().take(40).collect();
                    format!("has the lens model {model}, which is not read; reconstruct with OPENCV or OPENCV_FISHEYE")
                }
            });
        }
    };
    if parameters.iter().any(|parameter| !parameter.is_finite()) {
        return Err("has a parameter that is not finite; reconstruct it again".into());
    }
    Ok((pixels(intrinsics, CalibrationFormat::Colmap), distortion))
}
