//! What footage says of the lens that it was filmed with.

/// Diagonal of film of 36 x 24 mm, millimetres.
const FILM_DIAGONAL: f64 = 43.267;
/// Equivalents on film that cameras have, millimetres.
const LENGTHS: [f64; 2] = [5.0, 2000.0];
/// Standard deviation of the logarithm of a focal length that a picture's Exif data state: in whole millimetres, and of
/// the picture before it was straightened.
const OF_PICTURES: f64 = 0.05;
/// Phones state the equivalent of their photographs in videos, too. These show the whole width of a sensor of 4:3, videos
/// the part that is left when they are stabilised and their sides cut off: an iPhone's are 1.0 to 1.2 times as narrow.
const VIDEO_CROP: f64 = 1.1;
const OF_VIDEOS: f64 = 0.1;
const SENSOR_ASPECT: f64 = 4.0 / 3.0;

/// A focal length as footage states it.
#[derive(Debug, Clone, PartialEq)]
pub struct StatedFocal {
    /// The focal length of frames, pixels.
    pub pixels: f64,
    /// Standard deviation of its logarithm.
    pub deviation: f64,
    /// Where it is stated, as words: the pictures' Exif data, or the video's metadata, with the lens if its name is stated.
    pub origin: String,
}

impl StatedFocal {
    /// Of pictures of a size whose Exif data state this equivalent on film of 36 x 24 mm, millimetres; `None` if no lens has
    /// it.
    pub(crate) fn of_pictures(equivalent: f64, (width, height): (u32, u32)) -> Option<StatedFocal> {
        let diagonal = f64::from(width).hypot(f64::from(height));
        let pixels = usable(equivalent)? / FILM_DIAGONAL * diagonal;
        Some(StatedFocal { pixels, deviation: OF_PICTURES, origin: "the pictures' Exif data".into() })
    }

    /// The same of a phone's video.
    pub(crate) fn of_video(equivalent: f64, (width, height): (u32, u32), lens: Option<&str>) -> Option<StatedFocal> {
        // A narrower sensor's sides were cut off; the longer edge of the others is the sensor's.
        let longer = f64::from(width.max(height)).max(SENSOR_ASPECT * f64::from(width.min(height)));
        let diagonal = longer.hypot(longer / SENSOR_ASPECT);
        let pixels = usable(equivalent)? / FILM_DIAGONAL * diagonal * VIDEO_CROP;
        let lens = lens.map_or_else(String::new, |lens| format!(" ({lens})"));
        let origin = format!("the video's metadata{lens}");
        Some(StatedFocal { pixels, deviation: OF_VIDEOS, origin })
    }
}

fn usable(equivalent: f64) -> Option<f64> {
    (LENGTHS[0]..=LENGTHS[1]).contains(&equivalent).then_some(equivalent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn focal_lengths_of_photographs_are_of_their_diagonal_and_of_videos_of_the_whole_sensor() {
        // 26 mm sees 67 degrees of the longer edge of 4:3.
        let photograph = StatedFocal::of_pictures(26.0, (4032, 3024)).unwrap();
        assert!((2.0 * (2016.0 / photograph.pixels).atan().to_degrees() - 67.4).abs() < 0.5, "{photograph:?}");
        // An iPhone 6s, of 29 mm: its videos of 1080p see 58.0 degrees, by `AVCaptureDevice.Format.videoFieldOfView`.
        let video = StatedFocal::of_video(29.0, (1080, 1920), Some("back")).unwrap();
        let degrees = 2.0 * (960.0 / video.pixels).atan().to_degrees();
        assert!((degrees - 58.0).abs() < 2.0, "{degrees}");
        assert_eq!(video.origin, "the video's metadata (back)");
        assert!(video.deviation > photograph.deviation);
        for odd in [0.0, -26.0, 1e9, f64::NAN, f64::INFINITY] {
            assert!(StatedFocal::of_video(odd, (1920, 1080), None).is_none(), "{odd}");
        }
    }
}
