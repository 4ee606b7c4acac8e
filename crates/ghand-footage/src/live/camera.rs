//! A camera of this computer.

use std::path::Path;

use super::system::System;
use crate::FootageError;

/// A camera of this computer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Camera {
    /// For users.
    pub name: String,
    /// For ffmpeg.
    pub input: String,
}

impl Camera {
    /// The first camera.
    pub fn first(system: System) -> Result<Camera, FootageError> {
        let problem = "there is none; connect one, or give a video";
        system.cameras().into_iter().next().ok_or_else(|| FootageError::unusable(Path::new("first camera"), problem))
    }

    /// The camera of a number from 0, of a device's path (Linux), or of a name or a part of it.
    pub fn find(text: &str, system: System) -> Result<Camera, FootageError> {
        if system == System::Linux {
            let number = text.parse::<u32>().ok();
            if let Some(path) = number.map(|number| format!("/dev/video{number}")).or_else(|| device(text)) {
                return of_path(&path, &system.cameras());
            }
        }
        among(text, system.cameras())
    }
}

fn device(text: &str) -> Option<String> {
    text.starts_with("/dev/").then(|| text.to_owned())
}

fn of_path(path: &str, connected: &[Camera]) -> Result<Camera, FootageError> {
    if !Path::new(path).exists() {
        return Err(FootageError::unusable(Path::new(path), format!("there is no such device; {}", told(connected))));
    }
    let known = connected.iter().find(|camera| camera.input == path);
    Ok(known.cloned().unwrap_or_else(|| Camera { name: path.into(), input: path.into() }))
}

fn among(text: &str, connected: Vec<Camera>) -> Result<Camera, FootageError> {
    let lower = |name: &str| name.to_lowercase();
    let position = match text.parse::<usize>() {
        Ok(number) => Some(number).filter(|number| *number < connected.len()),
        Err(_) if text.is_empty() => None,
        Err(_) => {
            let whole = connected.iter().position(|camera| lower(&camera.name) == lower(text));
            whole.or_else(|| connected.iter().position(|camera| lower(&camera.name).contains(&lower(text))))
        }
    };
    let problem = format!("is neither a camera nor a file; {}", told(&connected));
    position
        .and_then(|position| connected.into_iter().nth(position))
        .ok_or_else(|| FootageError::unusable(Path::new(if text.is_empty() { "\"\"" } else { text }), problem))
}

fn told(connected: &[Camera]) -> String {
    match connected {
        [] => "no camera is connected".into(),
        _ => {
            let names: Vec<&str> = connected.iter().map(|camera| camera.name.as_str()).collect();
            format!("connected: {}", names.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn connected() -> Vec<Camera> {
        ["Big Webcam", "Webcam", "Front \"x\"; rm -r $HOME"]
            .map(|name| Camera { name: name.into(), input: format!("video={name}") })
            .into()
    }

    #[test]
    fn cameras_are_found_by_number_name_and_part_of_a_name() {
        for (text, name) in [
            ("0", "Big Webcam"),
            ("1", "Webcam"),
            ("webcam", "Webcam"),
            ("big", "Big Webcam"),
            ("\"X\";", "Front \"x\"; rm -r $HOME"),
        ] {
            assert_eq!(among(text, connected()).unwrap().name, name, "{text}");
        }
        for text in ["", "3", "other"] {
            let error = among(text, connected()).unwrap_err().to_string();
            assert!(error.contains("neither a camera nor a file; connected: Big Webcam, Webcam,"), "{error}");
        }
        assert!(among("0", vec![]).unwrap_err().to_string().ends_with("no camera is connected"));
    }

    #[test]
    fn a_path_of_a_device_need_not_be_known_but_must_exist() {
        assert_eq!(of_path("/", &[]).unwrap(), Camera { name: "/".into(), input: "/".into() });
        let known = Camera { name: "Cam (/)".into(), input: "/".into() };
        assert_eq!(of_path("/", std::slice::from_ref(&known)).unwrap(), known);
        let error = of_path("/dev/video777", &connected()).unwrap_err().to_string();
        assert!(error.starts_with("/dev/video777: there is no such device; connected: Big Webcam"), "{error}");
    }
}
