//! Videos as cameras record them: compressed, and perhaps with missing frames.

use crate::PictureError;
use crate::ffmpeg::{DISPLAY_TAGS, Ffmpeg, Purpose, words};

const PURPOSE: Purpose =
    Purpose { needed_by: "videos need", remedy: "install ffmpeg (Debian or Ubuntu: `apt-get install ffmpeg`)" };
/// Compression of x264 as a phone's or a webcam's.
const QUALITY: u32 = 23;

/// Properties of a video.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoOptions {
    /// Columns and rows, both even.
    pub size: [u32; 2],
    /// Frames per second by the video's clock.
    pub rate: f64,
    /// Numbers of the frames that the camera lost, ascending, not the first: at their times the video has none.
    pub lost: Vec<usize>,
}

/// Starts ffmpeg for an MP4 video, which is sent the frames' red, green and blue.
///
/// # Errors
/// One sentence if it is not installed.
pub fn start_video(options: &VideoOptions) -> Result<Ffmpeg, PictureError> {
    Ffmpeg::start(&arguments(options), PURPOSE)
}

/// All arguments except the last, the file.
fn arguments(options: &VideoOptions) -> Vec<String> {
    let [width, height] = options.size;
    let input = format!("-y -loglevel error -f rawvideo -pixel_format rgb24 -video_size {width}x{height} -framerate");
    // N counts the frames that are there; each lost one before it delays a frame by one more.
    let late = options.lost.iter().enumerate().map(|(before, lost)| format!("+gte(N,{})", lost.saturating_sub(before)));
    let filters =
        format!("setpts='N{}',scale=out_color_matrix=bt709:out_range=tv,format=yuv420p", late.collect::<String>());
    // Else ffmpeg would repeat frames in place of the lost ones.
    let gaps = if options.lost.is_empty() { vec![] } else { words("-fps_mode vfr") };
    let codec = format!("-c:v libx264 -crf {QUALITY} -preset veryfast -movflags +faststart -f mp4");
    let rate = options.rate.to_string();
    [words(&input), vec![rate], words("-i - -an -vf"), vec![filters], gaps, words(DISPLAY_TAGS), words(&codec)].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_after_lost_ones_are_as_late_as_they_were_filmed() {
        let options = VideoOptions { size: [4, 2], rate: 25.0, lost: vec![2, 3, 7] };
        // Filmed are frames 0, 1, 4, 5, 6, 8: the third of them is two late, the sixth three.
        let filters = arguments(&options).into_iter().find(|argument| argument.starts_with("setpts")).unwrap();
        assert!(filters.starts_with("setpts='N+gte(N,2)+gte(N,2)+gte(N,5)',"), "{filters}");
    }
}
