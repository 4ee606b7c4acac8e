//! Settings in TOML: the presets, and files of one's own.

use documented::DocumentedFields;
use serde_json::Value;

use crate::settings::{SettingsError, TrainSettings};

/// A set of settings that comes with ghand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    toml: &'static str,
}

/// All presets; what a preset does not mention is as in the second, the defaults.
pub const PRESETS: [Preset; 3] = [
    Preset { name: "quick", toml: include_str!("../presets/quick.toml") },
    Preset { name: "standard", toml: include_str!("../presets/standard.toml") },
    Preset { name: "paper", toml: include_str!("../presets/paper.toml") },
];

/// The preset of runs that name none.
pub const DEFAULT_PRESET: &str = "standard";

impl Preset {
    /// The preset of that name.
    ///
    /// # Errors
    /// [`SettingsError`] with the names that there are.
    pub fn by_name(name: &str) -> Result<Preset, SettingsError> {
        let names = || PRESETS.map(|preset| format!("`{}`", preset.name)).join(" or ");
        let unknown = || SettingsError { setting: "preset".into(), problem: format!("must be {}", names()) };
        PRESETS.into_iter().find(|preset| preset.name == name).ok_or_else(unknown)
    }

    /// Its settings.
    ///
    /// # Errors
    /// [`SettingsError`] if the preset is wrong, which a test excludes.
    pub fn settings(self) -> Result<TrainSettings, SettingsError> {
        let mut settings = TrainSettings::default();
        settings.set_all(self.toml)?;
        Ok(settings)
    }
}

impl TrainSettings {
    /// Applies settings in TOML, `key = value` on each line. If that fails, the settings are unchanged.
    ///
    /// # Errors
    /// [`SettingsError`] if it is not TOML, a key is unknown or a value is not allowed.
    pub fn set_all(&mut self, text: &str) -> Result<(), SettingsError> {
        let table: toml::Table = text.parse().map_err(|error: toml::de::Error| SettingsError {
            setting: "all".into(),
            problem: format!("the file is not TOML: {}", error.message()),
        })?;
        let mut settings = self.clone();
        for (key, value) in table {
            let text = match value {
                toml::Value::String(text) => text,
                other => other.to_string(),
            };
            settings.set_from_file(&key, &text)?;
        }
        *self = settings;
        Ok(())
    }

    /// All settings in TOML, in the order of their documentation.
    pub fn to_toml(&self) -> String {
        self.described().into_iter().map(|setting| format!("{} = {}\n", setting.name, setting.value)).collect()
    }

    /// As [`to_toml`](Self::to_toml), each with its meaning as a comment.
    pub fn to_commented_toml(&self) -> String {
        let lines = self.described().into_iter();
        lines.map(|setting| format!("# {}\n{} = {}\n", setting.meaning, setting.name, setting.value)).collect()
    }

    /// All settings with their values and meanings, in the order of their documentation.
    pub fn described(&self) -> Vec<DescribedSetting> {
        let text = serde_json::to_string(self).unwrap_or_default();
        let fields = serde_json::to_value(self).unwrap_or_default();
        let mut fields: Vec<(&String, &Value)> = fields.as_object().into_iter().flatten().collect();
        fields.sort_by_key(|(key, _)| text.find(&format!("\"{key}\":")));
        let described = |(key, value): (&String, &Value)| {
            // TOML has no whole numbers above 2^63.
            let large = value.as_u64().is_some_and(|number| i64::try_from(number).is_err());
            let value = if large { format!("\"{value}\"") } else { value.to_string() };
            let meaning = TrainSettings::get_field_docs(key).unwrap_or_default();
            let meaning = meaning.split_whitespace().collect::<Vec<_>>().join(" ");
            DescribedSetting { name: key.clone(), value, meaning: meaning.trim_end_matches('.').into() }
        };
        fields.into_iter().map(described).collect()
    }
}

/// A setting in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DescribedSetting {
    /// Its name.
    pub name: String,
    /// Its value, as in TOML.
    pub value: String,
    /// What it means, in Markdown on one line, without a full stop.
    pub meaning: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Align, ExposureChoice, GlossChoice, LightChoice, Unseen};

    #[test]
    fn presets_are_valid_and_the_default_one_is_the_default() {
        for preset in PRESETS {
            preset.settings().unwrap().check().unwrap();
        }
        assert_eq!(Preset::by_name(DEFAULT_PRESET).unwrap().settings().unwrap(), TrainSettings::default());
        let message = Preset::by_name("fast").unwrap_err().to_string();
        assert!(message.contains("`quick` or `standard` or `paper`"), "{message}");
    }

    #[test]
    fn settings_survive_as_toml() {
        let settings = TrainSettings { seed: u64::MAX, rate_joints: 3e-38, ..PRESETS[2].settings().unwrap() };
        let text = settings.to_toml();
        assert!(text.starts_with("iterations = 124800\n"), "{text}");
        let mut read = TrainSettings::default();
        read.set_all(&text).unwrap();
        assert_eq!(read, settings);
    }

    #[test]
    fn settings_of_version_0_1_are_read_and_removed_ones_must_have_their_defaults() {
        let text = include_str!("../tests/data/settings-0.1.toml");
        let mut settings = TrainSettings { seed: 5, ..TrainSettings::default() };
        settings.set_all(text).unwrap();
        // What was the default then.
        let wanted = TrainSettings { uv_resolution: 160, ..TrainSettings::default() };
        assert_eq!(settings, wanted);
        let run: TrainSettings = TrainSettings::of_run(text.parse::<toml::Table>().unwrap()).unwrap();
        assert_eq!(run, wanted);
        for line in text.lines() {
            let name = line.split(' ').next().unwrap();
            let set = TrainSettings::default().set(&line.replace('"', ""));
            let fields = serde_json::to_value(TrainSettings::default()).unwrap();
            let message = set.err().map(|error| error.to_string()).unwrap_or_default();
            assert_eq!(fields.get(name).is_none(), message.contains("was removed in 0.2: "), "{line}: {message}");
        }
        for (former, is_off) in [
            ("align = \"none\"", TrainSettings { align: Align::Off, ..TrainSettings::default() }),
            ("light = \"none\"", TrainSettings { light: LightChoice::Off, ..TrainSettings::default() }),
            ("gloss = \"none\"", TrainSettings { gloss: GlossChoice::Off, ..TrainSettings::default() }),
            ("exposure = \"same\"", TrainSettings { exposure: ExposureChoice::Off, ..TrainSettings::default() }),
            ("unseen = \"keep\"", TrainSettings { unseen: Unseen::Off, ..TrainSettings::default() }),
        ] {
            let mut settings = TrainSettings::default();
            settings.set_all(former).unwrap();
            assert_eq!(settings, is_off);
        }
        let other = text.replace("rate_light = 0.01", "rate_light = 0.0");
        assert!(settings.set_all(&other).unwrap_err().to_string().contains("`rate_light`: was removed in 0.2"));
    }

    #[test]
    fn wrong_files_name_what_is_wrong_and_change_nothing() {
        for (text, part) in [
            ("iterations = 5\nnonsense = 1", "`nonsense`"),
            ("iteration = 5", "did you mean `iterations`?"),
            ("iterations = [3]", "must be a whole number"),
            ("iterations = true", "must be a whole number"),
            ("[iterations]\nx = 1", "must be a whole number"),
            ("iterations 5", "is not TOML"),
            ("rate_joints = nan", "must be a number"),
        ] {
            let mut settings = TrainSettings::default();
            let message = settings.set_all(text).unwrap_err().to_string();
            assert!(message.contains(part) && !message.contains('\n'), "{message}");
            assert_eq!(settings, TrainSettings::default());
        }
    }
}
