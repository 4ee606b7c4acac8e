//! What the viewer remembers from one start to the next: window, theme, panel, recent files and saved views.

use std::path::{Path, PathBuf};

use egui::ThemePreference;
use etcetera::{BaseStrategy, choose_base_strategy};
use ghand_files::atomic_file::write_atomically;
use serde::{Deserialize, Serialize};

use crate::viewer::session::saved_view::{SavedView, view_name};

/// Most recent files that are remembered.
const MOST_RECENT: usize = 8;
/// Most views that are read from a file.
const MOST_VIEWS: usize = 200;
/// Sizes of the window that are believed, points.
const WINDOW_EDGES: [f32; 2] = [200.0, 20_000.0];

/// Light or dark.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Theme {
    /// Light on dark.
    #[default]
    Dark,
    /// Dark on light.
    Light,
    /// As the desktop.
    System,
}

impl Theme {
    /// The same for egui.
    pub fn preference(self) -> ThemePreference {
        match self {
            Theme::Dark => ThemePreference::Dark,
            Theme::Light => ThemePreference::Light,
            Theme::System => ThemePreference::System,
        }
    }

    /// The one after it.
    pub fn next(self) -> Theme {
        match self {
            Theme::Dark => Theme::Light,
            Theme::Light => Theme::System,
            Theme::System => Theme::Dark,
        }
    }
}

/// The settings; what a file lacks or has wrong is as at the first start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Light or dark.
    pub theme: Theme,
    /// Whether the panel is shown.
    pub panel_shown: bool,
    /// Whether handles are shown on the hand.
    pub handles_shown: bool,
    /// Whether changing pictures have fewer pixels on slow devices.
    pub adaptive: bool,
    /// Whether the named poses have pictures.
    pub thumbnails_shown: bool,
    /// Size of the window, points.
    pub window_size: Option<[f32; 2]>,
    /// Whether the window fills the screen.
    pub maximized: bool,
    /// The files that were opened last, the newest first.
    pub recent: Vec<PathBuf>,
    /// The views that the user has saved.
    pub views: Vec<SavedView>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            theme: Theme::default(),
            panel_shown: true,
            handles_shown: true,
            adaptive: true,
            thumbnails_shown: true,
            window_size: None,
            maximized: false,
            recent: Vec::new(),
            views: Vec::new(),
        }
    }
}

impl Settings {
    /// Where the user's settings are; `None` if there is no such folder.
    pub fn path() -> Option<PathBuf> {
        Some(choose_base_strategy().ok()?.config_dir().join("ghand").join("viewer.json"))
    }

    /// Reads the settings; those of the first start if there is no usable file.
    pub fn read(path: &Path) -> Settings {
        let read = std::fs::read(path).ok().and_then(|bytes| serde_json::from_slice::<Settings>(&bytes).ok());
        let mut settings = read.unwrap_or_default();
        let [low, high] = WINDOW_EDGES;
        settings.window_size = settings.window_size.filter(|size| size.iter().all(|edge| (low..high).contains(edge)));
        settings.recent.truncate(MOST_RECENT);
        settings.views.retain(|view| view.point.is_usable() && view_name(&view.name).as_ref() == Ok(&view.name));
        settings.views.truncate(MOST_VIEWS);
        settings
    }

    /// Writes the settings.
    ///
    /// # Errors
    /// If the folder or the file cannot be written.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        write_atomically(path, serde_json::to_string_pretty(self)?.as_bytes())
    }

    /// Remembers a file as the newest.
    pub fn add_recent(&mut self, path: &Path) {
        let Ok(path) = std::path::absolute(path) else { return };
        self.recent.retain(|other| *other != path);
        self.recent.insert(0, path);
        self.recent.truncate(MOST_RECENT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_read_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config/ghand/viewer.json");
        assert_eq!(Settings::read(&path), Settings::default());
        let mut settings = Settings { theme: Theme::Light, window_size: Some([900.0, 700.0]), ..Default::default() };
        settings.add_recent(Path::new("/a.ghand"));
        settings.write(&path).unwrap();
        assert_eq!(Settings::read(&path), settings);
    }

    #[test]
    fn unusable_settings_are_those_of_the_first_start() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("viewer.json");
        for text in ["", "{", "[]", r#"{"theme":"pink"}"#, r#"{"window_size":[1,1e9]}"#] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(Settings::read(&path), Settings::default(), "{text}");
        }
        std::fs::write(&path, r#"{"theme":"light","from_the_future":1}"#).unwrap();
        assert_eq!(Settings::read(&path).theme, Theme::Light);
    }

    #[test]
    fn recent_files_are_listed_once_the_newest_first() {
        let mut settings = Settings::default();
        for k in 0..20 {
            settings.add_recent(Path::new(&format!("/{}", k % 10)));
        }
        settings.add_recent(Path::new("/5"));
        let names: Vec<String> = settings.recent.iter().map(|path| path.display().to_string()).collect();
        assert_eq!(names, ["/5", "/9", "/8", "/7", "/6", "/4", "/3", "/2"]);
    }
}
