//! Finds images with usable content.

use std::collections::{BTreeMap, HashSet};
use std::io::ErrorKind;

use rayon::prelude::*;

use super::file::{Role, check};
use super::skipped::{SkipReason, SkippedImages};
use crate::capture::Capture;
use crate::error::CaptureError;
use crate::mask::{Facts, MadeMasks, MaskMethod, facts};

/// Least number of pixels of a mask.
const LEAST_MASK: u32 = 3000;
/// Images, and hands, whose largest value is below this are black.
const LEAST_BRIGHTNESS: u8 = 20;

impl Capture {
    /// Checks the images of some splits and removes unusable ones: those whose image or mask file is missing,
    /// unreadable, truncated or not of its camera's size. Only parts of each PNG and JPEG are read; damage inside is an
    /// error of [`Capture::load_view`]. EXR images are decoded, and those with only NaN are removed.
    ///
    /// For a data set with masks made by outline, the images are decoded; those that are broken, black or almost without hand in
    /// the mask are removed. Missing masks are made and cached.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] if there is no split of this name, or no image is left in one.
    pub fn skip_unusable_images(&mut self, splits: &[&str]) -> Result<SkippedImages, CaptureError> {
        let mut counts = SkippedImages::default();
        let mut pairs = vec![];
        let mut filled = vec![];
        for name in splits {
            let views = &self.split(name)?.views;
            pairs.extend(views.iter().map(|v| (v.camera, v.frame)));
            filled.extend((!views.is_empty()).then_some(*name));
        }
        pairs.sort_unstable();
        pairs.dedup();
        let capture = &*self;
        let found: BTreeMap<(usize, usize), Option<Unusable>> =
            pairs.into_par_iter().map(|(camera, frame)| ((camera, frame), capture.unusable(camera, frame))).collect();
        let mut dropped: HashSet<(usize, usize)> = HashSet::new();
        for (pair, unusable) in found {
            counts.add(unusable.as_ref().map(|unusable| unusable.reason));
            if let Some(Unusable { problem, .. }) = unusable {
                dropped.insert(pair);
                counts.first = counts.first.or(problem);
            }
        }
        if dropped.is_empty() {
            return Ok(counts);
        }
        for split in self.splits.values_mut() {
            *split = split.filtered(|v| !dropped.contains(&(v.camera, v.frame)));
        }
        for name in filled {
            if self.split(name)?.views.is_empty() {
                let problem =
                    format!("no images are left in split {name:?}: {counts}; check that images and poses match");
                return Err(CaptureError::Invalid { path: self.root.clone(), field: "images".into(), problem });
            }
        }
        Ok(counts)
    }

    fn unusable(&self, camera: usize, frame: usize) -> Option<Unusable> {
        let by_outline = |made: &MadeMasks| made.method == MaskMethod::Outline;
        let found = if self.images.made_masks.as_ref().is_some_and(by_outline) {
            facts(self, camera, frame).map(|facts| verdict(&facts))
        } else {
            self.check_files(camera, frame).map(|()| None)
        };
        found.map(|reason| reason.map(|reason| Unusable { reason, problem: None })).unwrap_or_else(|error| {
            log::debug!("{error}");
            let reason = match &error {
                CaptureError::Io { source, .. } if source.kind() == ErrorKind::NotFound => SkipReason::Missing,
                _ => SkipReason::Broken,
            };
            Some(Unusable { reason, problem: Some(error.to_string()) })
        })
    }

    fn check_files(&self, camera: usize, frame: usize) -> Result<(), CaptureError> {
        let size = self.camera_and_frame(camera, frame).map(|(c, _)| (c.width, c.height))?;
        check(&self.image_file(camera, frame)?, Role::Image, size)?;
        match self.mask_file(camera, frame)? {
            Some(mask) if self.images.made_masks.is_none() || mask.exists() => check(&mask, Role::Mask, size),
            _ => Ok(()),
        }
    }
}

/// Why an image cannot be used, and the message of its file's error, if any.
struct Unusable {
    reason: SkipReason,
    problem: Option<String>,
}

fn verdict(facts: &Facts) -> Option<SkipReason> {
    if facts.brightest < LEAST_BRIGHTNESS {
        Some(SkipReason::Dark)
    } else if facts.mask_pixels < LEAST_MASK {
        Some(SkipReason::SmallMask)
    } else if facts.brightest_on_hand < LEAST_BRIGHTNESS {
        Some(SkipReason::Dark)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_at_the_limits_are_usable_and_below_them_not() {
        let facts = |mask_pixels, brightest, brightest_on_hand| Facts { mask_pixels, brightest, brightest_on_hand };
        assert_eq!(verdict(&facts(3000, 20, 20)), None);
        assert_eq!(verdict(&facts(2999, 20, 20)), Some(SkipReason::SmallMask));
        assert_eq!(verdict(&facts(3000, 19, 19)), Some(SkipReason::Dark));
        assert_eq!(verdict(&facts(3000, 20, 19)), Some(SkipReason::Dark));
    }
}
