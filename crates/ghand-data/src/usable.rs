//! Which images are of use by their content.

use std::collections::{BTreeMap, HashSet};

use rayon::prelude::*;

use crate::capture::Capture;
use crate::error::CaptureError;
use crate::left_out::{LeftOut, LeftOutCounts};
use crate::mask::{Facts, facts};

/// Least pixels of a mask.
const LEAST_MASK: u32 = 3000;
/// Images, and hands, whose largest value is below this are black.
const LEAST_BRIGHTNESS: u8 = 20;

impl Capture {
    /// Looks at the images of some splits and takes those that are of no use out of them: broken ones, black ones, and those
    /// with hardly any hand on the mask. Masks that are not there are made and kept. Only for captures of data sets where
    /// that is usual; others keep all their images.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] when there is no split of such a name, or nothing is left of one.
    pub fn drop_unusable(&mut self, splits: &[&str]) -> Result<LeftOutCounts, CaptureError> {
        let mut counts = LeftOutCounts::default();
        if self.images.made_masks.is_none() {
            return Ok(counts);
        }
        let mut pairs = vec![];
        for name in splits {
            pairs.extend(self.split(name)?.views.iter().map(|v| (v.camera, v.frame)));
        }
        pairs.sort_unstable();
        pairs.dedup();
        let capture = &*self;
        let found: BTreeMap<(usize, usize), Option<LeftOut>> =
            pairs.into_par_iter().map(|(camera, frame)| ((camera, frame), capture.unusable(camera, frame))).collect();
        found.values().for_each(|reason| counts.add(*reason));
        let dropped: HashSet<(usize, usize)> =
            found.into_iter().filter(|(_, reason)| reason.is_some()).map(|(pair, _)| pair).collect();
        for split in self.splits.values_mut() {
            *split = split.filtered(|v| !dropped.contains(&(v.camera, v.frame)));
        }
        for name in splits {
            if self.split(name)?.views.is_empty() {
                let problem =
                    format!("nothing is left of split {name:?}: {counts}; see that images and poses belong together");
                return Err(CaptureError::Invalid { path: self.root.clone(), field: "images".into(), problem });
            }
        }
        Ok(counts)
    }

    fn unusable(&self, camera: usize, frame: usize) -> Option<LeftOut> {
        match facts(self, camera, frame) {
            Err(error) => {
                log::debug!("{error}");
                Some(LeftOut::Broken)
            }
            Ok(facts) => verdict(&facts),
        }
    }
}

fn verdict(facts: &Facts) -> Option<LeftOut> {
    if facts.brightest < LEAST_BRIGHTNESS {
        Some(LeftOut::Dark)
    } else if facts.mask_pixels < LEAST_MASK {
        Some(LeftOut::SmallMask)
    } else if facts.brightest_on_hand < LEAST_BRIGHTNESS {
        Some(LeftOut::Dark)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_at_the_limits_are_of_use_and_below_them_not() {
        let facts = |mask_pixels, brightest, brightest_on_hand| Facts { mask_pixels, brightest, brightest_on_hand };
        assert_eq!(verdict(&facts(3000, 20, 20)), None);
        assert_eq!(verdict(&facts(2999, 20, 20)), Some(LeftOut::SmallMask));
        assert_eq!(verdict(&facts(3000, 19, 19)), Some(LeftOut::Dark));
        assert_eq!(verdict(&facts(3000, 20, 19)), Some(LeftOut::Dark));
    }
}
