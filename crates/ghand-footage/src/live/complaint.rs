//! What ffmpeg says of a camera, as a sentence with a remedy.

use super::system::System;

/// A camera that cannot be used: texts of ffmpeg or of the system, and what they mean.
const REASONS: [(&[&str], Reason); 5] = [
    (&["Device or resource busy", "Could not run graph", "already in use"], Reason::Busy),
    (&["Permission denied", "Operation not permitted", "not authorized", "Cannot use"], Reason::Denied),
    (&["Inappropriate ioctl", "Not a video capture device", "Is a directory", "Not a directory"], Reason::NotACamera),
    (&["No such file", "No such device", "Could not find video device", "device not found"], Reason::Missing),
    (&["Unknown input format"], Reason::NoSupport),
];

/// Why a camera gives no pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reason {
    Busy,
    Denied,
    NotACamera,
    Missing,
    NoSupport,
}

impl Reason {
    /// The reason in what ffmpeg has written, if it is one of these.
    pub fn of(complaint: &str) -> Option<Reason> {
        REASONS
            .into_iter()
            .find(|(texts, _)| texts.iter().any(|text| complaint.contains(text)))
            .map(|(_, reason)| reason)
    }

    /// What is wrong and what to do; continues the name of the camera.
    pub fn sentence(self, system: System) -> &'static str {
        match self {
            Reason::Busy => "is used by another program; close that program, such as a browser or a video call",
            Reason::Denied if system == System::Linux => {
                "may not be used by this user; run `sudo usermod -aG video $USER` and log in again"
            }
            Reason::Denied => "may not be used by this program; allow cameras in the privacy settings of the system",
            Reason::NotACamera => "is not a camera; choose another one",
            Reason::Missing => "is not connected; connect it, or choose another one",
            Reason::NoSupport => {
                "cannot be read, because this ffmpeg was built without cameras; install another ffmpeg"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_ffmpeg_become_reasons() {
        for (complaint, reason) in [
            ("Cannot open video device /dev/video9: No such file or directory", Reason::Missing),
            ("ioctl(VIDIOC_QUERYCAP): Inappropriate ioctl for device", Reason::NotACamera),
            ("Cannot open video device /tmp: Is a directory", Reason::NotACamera),
            ("Not a video capture device.", Reason::NotACamera),
            ("Cannot open video device /dev/video0: Permission denied", Reason::Denied),
            ("ioctl(VIDIOC_S_FMT): Device or resource busy", Reason::Busy),
            ("ioctl(VIDIOC_DQBUF): No such device", Reason::Missing),
            ("Failed to create AV capture input device: Cannot use FaceTime HD Camera", Reason::Denied),
            ("Could not run graph (sometimes caused by a device already in use by other application)", Reason::Busy),
            ("Could not find video device with name [Cam] among source devices of type video.", Reason::Missing),
            ("Unknown input format: 'v4l2'", Reason::NoSupport),
        ] {
            assert_eq!(Reason::of(complaint), Some(reason), "{complaint}");
        }
        assert_eq!(Reason::of("Selected video size (640x480) is not supported by the device."), None);
        assert_eq!(Reason::of(""), None);
        assert_ne!(Reason::Denied.sentence(System::Linux), Reason::Denied.sentence(System::MacOs));
    }
}
