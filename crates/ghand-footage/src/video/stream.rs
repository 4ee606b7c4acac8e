//! A video stream, as ffprobe describes it.

use std::collections::BTreeMap;

use serde::Deserialize;

/// The answer of ffprobe.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Probed {
    #[serde(default)]
    pub streams: Vec<Stream>,
    #[serde(default)]
    pub format: Format,
}

/// The file.
#[derive(Debug, Clone, Default, Deserialize)]
pub(crate) struct Format {
    duration: Option<String>,
}

/// One stream.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Stream {
    pub index: u32,
    pub codec_type: Option<String>,
    width: u32,
    height: u32,
    sample_aspect_ratio: Option<String>,
    pix_fmt: Option<String>,
    color_space: Option<String>,
    color_transfer: Option<String>,
    field_order: Option<String>,
    avg_frame_rate: Option<String>,
    r_frame_rate: Option<String>,
    time_base: Option<String>,
    duration: Option<String>,
    nb_frames: Option<String>,
    disposition: BTreeMap<String, i64>,
    tags: BTreeMap<String, String>,
    side_data_list: Vec<SideData>,
}

#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
struct SideData {
    rotation: Option<f64>,
}

/// Two numbers with a sign between them, such as `30000/1001`.
fn ratio(text: &str) -> Option<f64> {
    let (over, under) = text.split_once(['/', ':'])?;
    let ratio = over.parse::<f64>().ok()? / under.parse::<f64>().ok()?;
    (ratio.is_finite() && ratio > 0.0).then_some(ratio)
}

impl Format {
    /// Seconds.
    pub fn duration(&self) -> Option<f64> {
        self.duration.as_ref()?.parse().ok()
    }
}

impl Stream {
    /// Whether it has moving pictures, and not the cover of a piece of music.
    pub fn is_film(&self) -> bool {
        let is = |name: &str| self.disposition.get(name).is_some_and(|value| *value != 0);
        self.codec_type.as_deref() == Some("video") && !is("attached_pic") && !is("timed_thumbnails")
    }

    /// Columns and rows as a player shows them.
    pub fn size(&self) -> Option<(u32, u32)> {
        let aspect = self.sample_aspect_ratio.as_deref().and_then(ratio).unwrap_or(1.0);
        let width = (f64::from(self.width) * aspect).round();
        let is_usable = self.width > 0 && self.height > 0 && width >= 1.0 && width <= f64::from(u16::MAX);
        let (width, height) = (width as u32, self.height);
        is_usable.then_some(if self.is_on_its_side() { (height, width) } else { (width, height) })
    }

    /// Degrees by which a player turns the pictures.
    fn rotation(&self) -> f64 {
        let matrix = self.side_data_list.iter().find_map(|data| data.rotation);
        matrix.or_else(|| self.tags.get("rotate")?.parse().ok()).unwrap_or(0.0)
    }

    fn is_on_its_side(&self) -> bool {
        // As ffmpeg decides.
        ((self.rotation().abs() % 180.0) - 90.0).abs() < 1.0
    }

    /// Frames per second as the file states them.
    pub fn rate(&self) -> Option<f64> {
        [&self.avg_frame_rate, &self.r_frame_rate].into_iter().find_map(|rate| ratio(rate.as_deref()?))
    }

    /// Unit of its times, seconds.
    pub fn tick(&self) -> f64 {
        self.time_base.as_deref().and_then(ratio).unwrap_or(f64::NAN)
    }

    /// Seconds.
    pub fn duration(&self) -> Option<f64> {
        self.duration.as_ref()?.parse().ok()
    }

    /// Frames as the file states them.
    pub fn frame_count(&self) -> Option<usize> {
        self.nb_frames.as_ref()?.parse().ok()
    }

    /// Whether its pictures are made of two halves of different moments.
    pub fn is_interlaced(&self) -> bool {
        matches!(self.field_order.as_deref(), Some("tt" | "bb" | "tb" | "bt"))
    }

    fn is_hdr(&self) -> bool {
        matches!(self.color_transfer.as_deref(), Some("smpte2084" | "arib-std-b67"))
    }

    fn is_square(&self) -> bool {
        self.sample_aspect_ratio.as_deref().and_then(ratio).is_none_or(|aspect| aspect == 1.0)
    }

    /// What the user should know.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = vec![];
        let turn = self.rotation();
        if turn.abs() >= 1.0 {
            remarks
                .push(format!("the camera was turned: pictures are rotated by {} degrees, as players do", turn.abs()));
        }
        if self.is_interlaced() {
            remarks
                .push("it is interlaced: each picture has two halves of different moments; film progressively".into());
        }
        if let (false, Some((width, height))) = (self.is_square(), self.size()) {
            remarks.push(format!("its pixels are not square: pictures are resized to {width} x {height}"));
        }
        if self.is_hdr() {
            remarks.push("it is HDR: colours are converted to SDR, which is not exact; film in SDR".into());
        }
        remarks
    }

    /// Filters of ffmpeg that make frames of this stream RGB pictures. `can_map_tones`: whether ffmpeg has the filters
    /// for HDR; without them dark and bright parts come out flat.
    pub fn filters(&self, (width, height): (u32, u32), can_map_tones: impl FnOnce() -> bool) -> String {
        let mut filters = vec![];
        if self.is_hdr() && can_map_tones() {
            // A hundred candelas per square metre are white, in linear light.
            filters.push("zscale=t=linear:npl=100,format=gbrpf32le,zscale=p=bt709".to_owned());
            filters.push("tonemap=hable:desat=0,zscale=t=bt709:m=bt709:r=tv,format=yuv444p".to_owned());
        }
        // Where a file does not say how its colours are coded, high resolutions have the way of HDTV.
        let is_told = self.color_space.as_deref().is_some_and(|space| space != "unknown");
        let is_yuv = self.pix_fmt.as_deref().is_some_and(|format| format.starts_with("yuv"));
        let matrix =
            if !is_told && is_yuv && self.height.min(self.width) >= 720 { ":in_color_matrix=bt709" } else { "" };
        filters.push(format!("scale={width}:{height}:flags=bicubic+accurate_rnd+full_chroma_int{matrix}"));
        filters.push("format=rgb24".to_owned());
        filters.join(",")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(json: &str) -> Stream {
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn sizes_are_those_that_players_show() {
        let size = |json: &str| stream(json).size();
        assert_eq!(size(r#"{"width":1920,"height":1080}"#), Some((1920, 1080)));
        assert_eq!(size(r#"{"width":1920,"height":1080,"side_data_list":[{"rotation":-90}]}"#), Some((1080, 1920)));
        assert_eq!(size(r#"{"width":1920,"height":1080,"tags":{"rotate":"270"}}"#), Some((1080, 1920)));
        assert_eq!(size(r#"{"width":1920,"height":1080,"tags":{"rotate":"180"}}"#), Some((1920, 1080)));
        assert_eq!(size(r#"{"width":1440,"height":1080,"sample_aspect_ratio":"4:3"}"#), Some((1920, 1080)));
        for odd in [r#"{"width":0,"height":1080}"#, r#"{"width":9,"height":9,"sample_aspect_ratio":"99999:1"}"#] {
            assert_eq!(size(odd), None, "{odd}");
        }
    }

    #[test]
    fn hdr_is_told_and_converted_as_well_as_this_ffmpeg_can() {
        let hdr = stream(r#"{"width":1920,"height":1080,"color_transfer":"arib-std-b67","color_space":"bt2020nc"}"#);
        assert!(hdr.remarks().iter().any(|remark| remark.contains("HDR")));
        assert!(hdr.filters((1920, 1080), || true).contains("tonemap"));
        assert!(!hdr.filters((1920, 1080), || false).contains("tonemap"));
        let sdr = stream(r#"{"width":1920,"height":1080,"color_transfer":"bt709"}"#);
        assert!(sdr.remarks().is_empty());
        assert!(!sdr.filters((1920, 1080), || true).contains("tonemap"));
    }

    #[test]
    fn covers_of_music_are_not_films() {
        assert!(stream(r#"{"codec_type":"video"}"#).is_film());
        assert!(!stream(r#"{"codec_type":"video","disposition":{"attached_pic":1}}"#).is_film());
        assert!(!stream(r#"{"codec_type":"audio"}"#).is_film());
    }
}
