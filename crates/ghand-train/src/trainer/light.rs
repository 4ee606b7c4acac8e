//! Light and the cameras' exposures, from the images, before an avatar is trained.

use ghand_capture::ColorCorrection;
use ghand_core::InvalidHandModel;
use ghand_fit::exposure::{ExposureChoice, WORTHWHILE, fit_exposure};
use ghand_fit::light_fit::{LightChoice, LightFit, Unexplained, fit_light_and_try};
use ghand_fit::texels::frames::TexelFrames;
use ghand_fit::views::TrainViews;
use ghand_render::Gpu;

use super::{CROP_MARGIN, Problem};
use crate::settings::TrainSettings;
use crate::train_error::TrainError;

/// A larger part of the hand's pixels that is burnt out or black is reported.
const MOST_EXTREME: f64 = 0.1;
/// Frames whose brightness differs by more than this (standard deviation of the logarithm) are reported.
const UNSTEADY: f64 = 0.06;

impl Problem {
    /// Estimates exposures and light from the images, and corrects the images accordingly.
    pub(super) fn find_light(&mut self, gpu: &mut Gpu) -> Result<(), TrainError> {
        let TrainSettings { light, exposure, .. } = self.settings;
        if (light, exposure) == (LightChoice::Off, ExposureChoice::Off) {
            return Ok(());
        }
        let mut seen = gpu.retry_on_device_loss("the light", |gpu| -> Result<TexelFrames, TrainError> {
            Ok(TexelFrames::new(gpu, &self.capture, &self.split, &self.prepared.poses)?)
        })?;
        let [burnt, black] = seen.extremes();
        for (part, how) in [(burnt, "burnt out (white)"), (black, "black")] {
            if part > MOST_EXTREME {
                log::warn!(
                    "{:.0} % of what the images show of the hand is {how}: its colours there are not known",
                    1e2 * part
                );
            }
        }
        let mut exposures = (exposure != ExposureChoice::Off).then(|| fit_exposure(&seen, exposure));
        let mut correction = ColorCorrection::default();
        let mut found = None;
        if let Some(fit) = exposures.as_mut().filter(|fit| fit.corrected) {
            let maps = ColorCorrection { cameras: fit.maps.clone() };
            let corrected = seen.corrected(&maps);
            // Shine and light from one side differ between cameras, too.
            if exposure == ExposureChoice::Auto
                && let Some((as_it_is, Some(tried))) = self.light_of(&seen, Some(&corrected))?
            {
                let left = fit.squared_difference_left_out;
                let sum = |of: Unexplained, which: usize| of.of_frames + left[which] * of.of_differences;
                let unexplained = [sum(as_it_is.unexplained(), 0), sum(tried, 1)];
                fit.unexplained = Some(unexplained);
                fit.corrected = unexplained[1] < WORTHWHILE * unexplained[0];
                found = Some(as_it_is);
            }
            if fit.corrected {
                (seen, correction, found) = (corrected, maps, None);
            }
        }
        if found.is_none() {
            found = self.light_of(&seen, None)?.map(|(fit, _)| fit);
        }
        self.prepared.exposure = exposures;
        if let Some(fit) = found {
            let differ = fit.frames_differ();
            if differ > UNSTEADY {
                log::warn!(
                    "frames differ in brightness by {:.0} % (standard deviation) beyond what a fixed light explains; \
                     keep light and exposure fixed while a hand is filmed",
                    1e2 * differ
                );
            }
            self.prepared.light = Some(fit);
        }
        if !correction.is_empty() {
            self.prepared.correction.clone_from(&correction);
            self.capture.color_correction = correction;
            self.views = TrainViews::new(&self.capture, &self.split, CROP_MARGIN)?;
        }
        Ok(())
    }

    /// The light in which the images show the hand, and what it leaves unexplained of the same images in other colours; `None`
    /// if it is not to be taken apart from skin.
    fn light_of(
        &self,
        seen: &TexelFrames,
        recolored: Option<&TexelFrames>,
    ) -> Result<Option<(LightFit, Option<Unexplained>)>, InvalidHandModel> {
        let TrainSettings { light, gloss, .. } = self.settings;
        let fit = || fit_light_and_try(seen, &self.capture.template, &self.prepared.poses, light, gloss, recolored);
        (light != LightChoice::Off).then(fit).transpose()
    }
}
