//! Options that select a capture.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Args;
use glam::DVec2;

use crate::capture_source::{CaptureReading, CaptureSource};
use crate::hand_model_args::HandModelArgs;

/// A capture and what its own files do not say.
#[derive(Debug, Clone, Args)]
pub struct CaptureArgs {
    /// Folder of a capture or its capture.json; InterHand2.6M or one of its folders, such as images/test/Capture0; or a
    /// subject of the Hand Appearance dataset.
    #[arg(long)]
    pub capture: Option<PathBuf>,
    #[command(flatten)]
    options: CaptureOptions,
}

/// What a capture's own files do not say. Commands that take it call the capture's argument `capture`.
#[derive(Debug, Clone, Args)]
pub struct CaptureOptions {
    /// MANO model for captures whose poses are MANO's: MANO_RIGHT.pkl, or MANO_LEFT.pkl for the left hand.
    #[arg(long, value_name = "FILE", requires = "capture")]
    hand_model: Option<PathBuf>,
    #[command(flatten)]
    hand_model_args: HandModelArgs,
    /// InterHand2.6M: sequences to train on [default: ROM04_RT_Occlusion, LT for a left hand]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "capture")]
    train_sequences: Vec<String>,
    /// InterHand2.6M: sequences to test on [default: ROM03_RT_No_Occlusion, LT for a left hand]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "capture")]
    test_sequences: Vec<String>,
    /// Hand Appearance: principal point in pixels [default: 224,224]
    #[arg(long, value_name = "X,Y", value_parser = parse_point, requires = "capture")]
    principal_point: Option<DVec2>,
}

impl CaptureArgs {
    /// What these options name.
    pub fn source(&self) -> CaptureSource {
        CaptureSource { capture: self.capture.clone(), options: self.options.reading() }
    }
}

impl CaptureOptions {
    /// How to read the capture.
    pub fn reading(&self) -> CaptureReading {
        CaptureReading {
            hand_model: self.hand_model.clone(),
            hand_model_args: self.hand_model_args.reading(),
            train_sequences: self.train_sequences.clone(),
            test_sequences: self.test_sequences.clone(),
            principal_point: self.principal_point,
        }
    }
}

fn parse_point(text: &str) -> anyhow::Result<DVec2> {
    let point = text.split_once(',').and_then(|(x, y)| {
        let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite());
        Some(DVec2::new(number(x)?, number(y)?))
    });
    point.ok_or_else(|| anyhow!("must be two numbers in pixels, such as 224,224"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_two_numbers() {
        assert_eq!(parse_point("224, 230.5").unwrap(), DVec2::new(224.0, 230.5));
        for text in ["", "224", "1,2,3", "a,b", "1,nan", "1,inf"] {
            assert!(parse_point(text).is_err(), "{text}");
        }
    }
}
