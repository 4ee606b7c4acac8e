//! Films encoded by ffmpeg.

use crate::ffmpeg::{DISPLAY_TAGS, Ffmpeg, Purpose, words};
use crate::film_options::FilmOptions;
use crate::format::FilmFormat;
use crate::{Background, PictureError};

const PURPOSE: Purpose = Purpose {
    needed_by: "webm and mp4 need",
    remedy: "install ffmpeg (Debian or Ubuntu: `apt-get install ffmpeg`), or render a .gif or a folder of PNG pictures",
};

/// Starts ffmpeg for a film, which is sent the pictures' red, green, blue and alpha.
///
/// # Errors
/// One sentence if it is not installed, or the format cannot be transparent.
pub fn start(options: &FilmOptions) -> Result<Ffmpeg, PictureError> {
    if options.format == FilmFormat::Mp4 && options.background == Background::Transparent {
        return Err(PictureError::Unsuitable(
            "--background transparent: MP4 has no transparency; give .webm, .gif or a folder of PNG pictures".into(),
        ));
    }
    Ffmpeg::start(&arguments(options), PURPOSE)
}

/// All arguments except the last, the file.
fn arguments(options: &FilmOptions) -> Vec<String> {
    let [width, height] = options.size;
    let (behind, pixels) = match options.background {
        Background::Transparent => ("black@0".into(), "yuva420p"),
        Background::Color(color) => {
            let [r, g, b] = color.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
            (format!("0x{r:02x}{g:02x}{b:02x}"), "yuv420p")
        }
    };
    // Colour has half as many columns and rows, so that both must be even.
    let even = format!("pad=ceil(iw/2)*2:ceil(ih/2)*2:color={behind}");
    let filters = format!("{even},scale=out_color_matrix=bt709:out_range=tv,format={pixels}");
    let input = format!("-y -loglevel error -f rawvideo -pixel_format rgba -video_size {width}x{height} -framerate");
    let codec = match options.format {
        FilmFormat::Mp4 => "-c:v libx264 -crf 16 -preset medium -movflags +faststart -f mp4",
        // GIF is not handled here.
        FilmFormat::Webm | FilmFormat::Gif => "-c:v libvpx-vp9 -crf 20 -b:v 0 -row-mt 1 -f webm",
    };
    let fps = options.fps.to_string();
    [words(&input), vec![fps], words("-i - -an -vf"), vec![filters], words(DISPLAY_TAGS), words(codec)].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_mp4_cannot_be_transparent() {
        let options =
            FilmOptions { format: FilmFormat::Mp4, size: [4, 4], background: Background::Transparent, fps: 30.0 };
        let error = start(&options).err().unwrap().to_string();
        assert!(error.contains("transparent") && error.contains(".webm"), "{error}");
    }
}
