//! Lenses of files: camera matrices and coefficients of distortion.

use glam::DVec2;

use super::super::distortion::Distortion;
use super::field::Field;
use super::found::{CalibrationFormat, Projection};
use crate::error::CaptureError;

/// The projection of a camera matrix `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`.
pub(super) fn projection(matrix: &Field, format: CalibrationFormat) -> Result<Projection, CaptureError> {
    let rows = matrix.matrix()?.transpose();
    let [fx, skew, cx] = rows.x_axis.to_array();
    let [below, fy, cy] = rows.y_axis.to_array();
    if skew != 0.0 || below != 0.0 || rows.z_axis.to_array() != [0.0, 0.0, 1.0] {
        let problem = "must be [[fx,0,cx],[0,fy,cy],[0,0,1]]; calibrate without skew";
        return Err(matrix.invalid(problem));
    }
    Ok(pixels([fx, fy, cx, cy], format))
}

/// The projection of fx, fy, cx and cy as the format has them.
pub(super) fn pixels([fx, fy, cx, cy]: [f64; 4], format: CalibrationFormat) -> Projection {
    Projection::Pixels { focal: DVec2::new(fx, fy), principal: DVec2::new(cx, cy) + format.pixel_shift() }
}

/// The distortion of OpenCV's coefficients, `None` if all are 0.
pub(super) fn distortion(coefficients: &Field) -> Result<Option<Distortion>, CaptureError> {
    let numbers = coefficients.numbers()?;
    if numbers.iter().all(|number| *number == 0.0) {
        return Ok(None);
    }
    Distortion::from_opencv(&numbers).map(Some).map_err(|problem| coefficients.invalid(problem))
}

/// The distortion of a fisheye lens with OpenCV's k1 to k4. Without them it is still a fisheye.
pub(super) fn fisheye(coefficients: &Field) -> Result<Option<Distortion>, CaptureError> {
    let numbers = coefficients.numbers()?;
    let mut four = [0.0; 4];
    if numbers.len() < four.len() || numbers.iter().skip(four.len()).any(|number| *number != 0.0) {
        let problem = format!("has {} numbers; a fisheye lens has four, k1 to k4", numbers.len());
        return Err(coefficients.invalid(problem));
    }
    four.iter_mut().zip(&numbers).for_each(|(slot, number)| *slot = *number);
    Ok(Some(Distortion::Fisheye(four)))
}
