//! Images that a reader skips, counted by reason.

use std::collections::BTreeMap;
use std::fmt;

/// Why an image cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SkipReason {
    /// The annotations do not contain its camera.
    NoCamera,
    /// Its frame has no pose.
    NoPose,
    /// It shows the other hand, or both.
    OtherHand,
    /// Its hand is near or beyond the border.
    AtBorder,
    /// Its hand is small.
    Small,
    /// Its file, or that of its mask, is missing.
    Missing,
    /// Its file, or that of its mask, is truncated, not an image, or not of its camera's size.
    Broken,
    /// It is black, or its hand is.
    Dark,
    /// Its mask contains almost no hand.
    SmallMask,
}

impl fmt::Display for SkipReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SkipReason::NoCamera => "without a camera",
            SkipReason::NoPose => "without a pose",
            SkipReason::OtherHand => "of the other hand or both",
            SkipReason::AtBorder => "with the hand at the border",
            SkipReason::Small => "with a small hand",
            SkipReason::Missing => "without a file",
            SkipReason::Broken => "with a broken file",
            SkipReason::Dark => "too dark",
            SkipReason::SmallMask => "with almost no hand in the mask",
        })
    }
}

/// How many images were skipped, and why. Displayed as one sentence.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SkippedImages {
    /// Number of checked images.
    pub checked: usize,
    /// Skipped images by reason.
    pub reasons: BTreeMap<SkipReason, usize>,
    /// The problem of the first missing or broken file, if known.
    pub first: Option<String>,
}

impl SkippedImages {
    /// Counts one checked image.
    pub fn add(&mut self, reason: Option<SkipReason>) {
        self.checked += 1;
        if let Some(reason) = reason {
            *self.reasons.entry(reason).or_default() += 1;
        }
    }

    /// Total number of skipped images.
    pub fn total(&self) -> usize {
        self.reasons.values().sum()
    }
}

impl fmt::Display for SkippedImages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} images are skipped", self.total(), self.checked)?;
        for (i, (reason, count)) in self.reasons.iter().enumerate() {
            write!(f, "{} {count} {reason}", if i == 0 { ":" } else { "," })?;
        }
        if let Some(first) = &self.first {
            write!(f, "; the first: {first}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_reported_in_one_sentence() {
        let mut counts = SkippedImages::default();
        [None, Some(SkipReason::Dark), Some(SkipReason::Missing), Some(SkipReason::Dark)]
            .into_iter()
            .for_each(|r| counts.add(r));
        assert_eq!(counts.to_string(), "3 of 4 images are skipped: 1 without a file, 2 too dark");
        counts.first = Some("0.png: gone".into());
        assert!(counts.to_string().ends_with("2 too dark; the first: 0.png: gone"));
        assert_eq!(SkippedImages { checked: 4, ..Default::default() }.to_string(), "0 of 4 images are skipped");
    }
}
