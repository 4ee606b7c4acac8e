//! Cameras of Linux, macOS and Windows, as ffmpeg reads them.

use std::path::Path;

use super::camera::Camera;
use crate::natural_order;
use crate::video::programs::Program;

/// Names of a screen among the cameras of macOS begin so.
const SCREEN: &str = "Capture screen";

/// A system with its way to cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum System {
    Linux,
    MacOs,
    Windows,
}

impl System {
    /// This one. Others than these are taken for Linux, whose interface the BSDs have.
    pub fn here() -> System {
        match std::env::consts::OS {
            "macos" => System::MacOs,
            "windows" => System::Windows,
            _ => System::Linux,
        }
    }

    /// ffmpeg's name for its interface to cameras.
    pub fn format(self) -> &'static str {
        match self {
            System::Linux => "v4l2",
            System::MacOs => "avfoundation",
            System::Windows => "dshow",
        }
    }

    /// The connected cameras, in the order of the system.
    pub fn cameras(self) -> Vec<Camera> {
        match self {
            System::Linux => of_linux(Path::new("/dev"), Path::new("/sys/class/video4linux")),
            System::MacOs => of_macos(&self.list("")),
            System::Windows => of_windows(&self.list("dummy")),
        }
    }

    /// What ffmpeg says when it is asked for its list of devices. It fails after that, as it has no input.
    fn list(self, input: &str) -> String {
        let mut command = Program::Ffmpeg.command();
        command.args(["-nostdin", "-f", self.format(), "-list_devices", "true", "-i", input]);
        // Without ffmpeg there is no list; whatever is opened then says that it is missing.
        command.output().map(|output| String::from_utf8_lossy(&output.stderr).into_owned()).unwrap_or_default()
    }
}

/// Files `video0`, `video1`, ... whose names are in `class`. A camera has files for other data behind its first one.
fn of_linux(devices: &Path, class: &Path) -> Vec<Camera> {
    let entries = std::fs::read_dir(devices).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.retain(|name| name.strip_prefix("video").is_some_and(|number| number.parse::<u32>().is_ok()));
    names.sort_by(|a, b| natural_order::compare(a, b));
    let told = |name: &String, what: &str| std::fs::read_to_string(class.join(name).join(what)).ok();
    names.retain(|name| told(name, "index").is_none_or(|index| index.trim() == "0"));
    let camera = |file: &String| {
        let input = devices.join(file).display().to_string();
        let name = told(file, "name").map_or_else(|| input.clone(), |name| format!("{} ({input})", name.trim()));
        Camera { name, input }
    };
    names.iter().map(camera).collect()
}

/// Lines such as `[AVFoundation indev @ 0x7f8] [0] FaceTime HD Camera` before those of microphones.
fn of_macos(list: &str) -> Vec<Camera> {
    let videos = list.lines().skip_while(|line| !line.contains("video devices:")).skip(1);
    let videos = videos.take_while(|line| !line.contains("audio devices:"));
    let camera = |line: &str| {
        let (_, rest) = line.split_once("] [")?;
        let (number, name) = rest.split_once("] ")?;
        let is_camera = number.parse::<u32>().is_ok() && !name.starts_with(SCREEN);
        is_camera.then(|| Camera { name: name.trim().into(), input: format!("{number}:none") })
    };
    videos.filter_map(camera).collect()
}

/// Lines such as `[dshow @ 000] "Integrated Camera" (video)`; until version 5, the kind is in a headline.
fn of_windows(list: &str) -> Vec<Camera> {
    let mut is_video = true;
    let mut cameras = vec![];
    for line in list.lines() {
        if line.contains("DirectShow") {
            is_video = line.contains("video devices");
        }
        if line.contains("Alternative name") {
            continue;
        }
        let Some((name, kind)) = line.split_once('"').and_then(|(_, rest)| rest.rsplit_once('"')) else { continue };
        let kind = kind.trim();
        if is_video && (kind.is_empty() || kind.contains("video") || kind == "(none)") {
            cameras.push(Camera { name: name.into(), input: format!("video={name}") });
        }
    }
    cameras
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(cameras: &[Camera]) -> Vec<(&str, &str)> {
        cameras.iter().map(|camera| (camera.name.as_str(), camera.input.as_str())).collect()
    }

    #[test]
    fn cameras_of_linux_are_first_files_with_names() {
        let folder = tempfile::tempdir().unwrap();
        for device in ["video10", "video2", "video0", "video1", "video", "null"] {
            std::fs::write(folder.path().join(device), "").unwrap();
        }
        for (device, name, index) in
            [("video0", "HD Webcam", "0"), ("video1", "HD Webcam", "1"), ("video10", "Cam", "0")]
        {
            let class = folder.path().join("class").join(device);
            std::fs::create_dir_all(&class).unwrap();
            std::fs::write(class.join("name"), format!("{name}\n")).unwrap();
            std::fs::write(class.join("index"), format!("{index}\n")).unwrap();
        }
        let cameras = of_linux(folder.path(), &folder.path().join("class"));
        let path = |name: &str| folder.path().join(name).display().to_string();
        let [first, second, last] = ["video0", "video2", "video10"].map(path);
        let expected =
            [(&*format!("HD Webcam ({first})"), &*first), (&*second, &*second), (&*format!("Cam ({last})"), &*last)];
        assert_eq!(named(&cameras), expected);
        assert!(of_linux(Path::new("/nowhere"), Path::new("/nowhere")).is_empty());
    }

    #[test]
    fn cameras_of_macos_are_listed_without_screens_and_microphones() {
        let list = "[AVFoundation indev @ 0x7f8] AVFoundation video devices:\n\
                    [AVFoundation indev @ 0x7f8] [0] FaceTime HD Camera\n\
                    [AVFoundation indev @ 0x7f8] [1] My iPhone [back] Camera\n\
                    [AVFoundation indev @ 0x7f8] [2] Capture screen 0\n\
                    [AVFoundation indev @ 0x7f8] AVFoundation audio devices:\n\
                    [AVFoundation indev @ 0x7f8] [0] Built-in Microphone\n: Input/output error\n";
        let expected = [("FaceTime HD Camera", "0:none"), ("My iPhone [back] Camera", "1:none")];
        assert_eq!(named(&of_macos(list)), expected);
    }

    #[test]
    fn cameras_of_windows_are_listed_by_old_and_new_versions() {
        let new = "[dshow @ 01] \"Integrated Camera\" (video)\n\
                   [dshow @ 01]   Alternative name \"@device_pnp_1\"\n\
                   [dshow @ 01] \"OBS Virtual Camera\" (none)\n\
                   [dshow @ 01] \"Microphone\" (audio)\n\
                   dummy: Immediate exit requested\n";
        let old = "[dshow @ 01] DirectShow video devices (some may be both video and audio devices)\n\
                   [dshow @ 01]  \"Integrated Camera\"\n\
                   [dshow @ 01]     Alternative name \"@device_pnp_1\"\n\
                   [dshow @ 01]  \"OBS Virtual Camera\"\n\
                   [dshow @ 01] DirectShow audio devices\n\
                   [dshow @ 01]  \"Microphone\"\n";
        for list in [new, old] {
            let expected =
                [("Integrated Camera", "video=Integrated Camera"), ("OBS Virtual Camera", "video=OBS Virtual Camera")];
            assert_eq!(named(&of_windows(list)), expected);
        }
    }
}
