//! Options that choose the settings of a run.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, anyhow, bail};
use clap::Args;
use ghand_files::input_file;
use ghand_train::presets::{DEFAULT_PRESET, Preset};
use ghand_train::{Align, Simplify, TrainSettings};

use crate::say;

/// Settings: a preset's, then those of a file, then single ones.
#[derive(Debug, Clone, Args)]
pub struct SettingsArgs {
    /// Settings to start from: `quick`, `standard` or `paper` [default: standard]
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// What gives the Gaussians their properties: `direct`, free tables, or `network`, the paper's networks; `auto` is the
    /// preset's, with as few Gaussians, bases and components as frames held out of short trainings require (simplify=auto)
    #[arg(long, value_name = "NAME", value_parser = ["direct", "network", "auto"])]
    model: Option<String>,
    /// TOML file of settings, which change the preset's; as --print-config prints them
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Change a setting, such as iterations=6000; may be given several times. A wrong name lists all settings.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Seed of all random numbers; the same seed on the same device gives the same avatar, byte for byte.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<String>,
    /// Longest time for training, such as 10m: rates then fall with time, and the run ends with it
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    max_time: Option<Duration>,
    /// Print all settings as TOML with their meanings, and do not train
    #[arg(long)]
    print_config: bool,
}

/// Largest file of settings, bytes.
const LARGEST_CONFIG: u64 = 1 << 20;

impl SettingsArgs {
    /// Whether any of these options is given.
    pub fn any_given(&self) -> bool {
        let given = [
            self.preset.is_some(),
            self.model.is_some(),
            self.config.is_some(),
            !self.set.is_empty(),
            self.seed.is_some(),
        ];
        given.contains(&true) || self.max_time.is_some()
    }

    /// Whether the option `--seed` is given.
    pub fn seed_given(&self) -> bool {
        self.seed.is_some()
    }

    /// Whether the option `--max-time` is given.
    pub fn max_time_given(&self) -> bool {
        self.max_time.is_some()
    }

    /// Whether the option `--print-config` is given.
    pub fn print_config(&self) -> bool {
        self.print_config
    }

    /// Name of the preset.
    pub fn preset(&self) -> &str {
        self.preset.as_deref().unwrap_or(DEFAULT_PRESET)
    }

    /// Prints the settings if that is all that is asked for.
    pub fn are_only_printed(&self, settings: &TrainSettings) -> bool {
        if self.print_config {
            say!("{}", settings.to_commented_toml().trim_end());
        }
        self.print_config
    }

    /// As [`settings`](Self::settings), for a command that compares or times settings as they are.
    ///
    /// # Errors
    /// As there; or an error that refuses `simplify=auto`.
    pub fn fixed_settings(&self, align: Option<Align>) -> anyhow::Result<TrainSettings> {
        let settings = self.settings(align)?;
        if settings.simplify == Simplify::Auto {
            bail!("simplify=auto (--model auto): only `train` chooses settings; name those that you mean");
        }
        Ok(settings)
    }

    /// The settings. The start of the run may choose `align`, unless file or options set it.
    ///
    /// # Errors
    /// An error that names the file, the setting and what is allowed.
    pub fn settings(&self, align: Option<Align>) -> anyhow::Result<TrainSettings> {
        let mut settings =
            Preset::by_name(self.preset()).map_err(|e| anyhow!("--preset: {}", e.problem))?.settings()?;
        settings.align = align.unwrap_or(settings.align);
        if let Some(path) = &self.config {
            let name = path.display();
            let bytes = input_file::read(path, LARGEST_CONFIG).with_context(|| format!("{name}: cannot be read"))?;
            let bytes = bytes.ok_or_else(|| anyhow!("{name}: is too large for a file of settings"))?;
            let text = String::from_utf8(bytes).map_err(|_| anyhow!("{name}: is not text"))?;
            settings.set_all(&text).map_err(|error| anyhow!("{name}: {error}"))?;
        }
        if let Some(model) = &self.model {
            settings.set(&if model == "auto" { "simplify=auto".into() } else { format!("model={model}") })?;
        }
        for assignment in &self.set {
            settings.set(assignment)?;
        }
        if let Some(seed) = &self.seed {
            settings.set(&format!("seed={seed}"))?;
        }
        if let Some(time) = self.max_time {
            settings.max_seconds = time.as_secs_f64();
        }
        Ok(settings)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use ghand_train::Model;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        settings: SettingsArgs,
    }

    fn parse(options: &[&str]) -> SettingsArgs {
        Line::try_parse_from([&["train"], options].concat()).unwrap_or_else(|e| panic!("{e}")).settings
    }

    #[test]
    fn the_model_is_chosen_by_its_own_option_and_auto_is_only_for_training() {
        let network = parse(&["--model", "network"]);
        assert!(network.any_given() && network.fixed_settings(None).unwrap().model == Model::Network);
        let auto = parse(&["--model", "auto", "--set", "iterations=60"]);
        let settings = auto.settings(None).unwrap();
        assert!((settings.model, settings.simplify, settings.iterations) == (Model::Direct, Simplify::Auto, 60));
        let refusal = auto.fixed_settings(None).unwrap_err().to_string();
        assert!(refusal.contains("only `train` chooses settings"), "{refusal}");
        assert!(Line::try_parse_from(["train", "--model", "best"]).is_err());
        assert!(!auto.are_only_printed(&settings) && parse(&["--print-config"]).are_only_printed(&settings));
    }
}
