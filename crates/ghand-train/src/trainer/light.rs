//! Light and the cameras' exposures, from the images, before an avatar is trained.

use ghand_capture::ColorCorrection;
use ghand_core::InvalidHandModel;
use ghand_fit::exposure::{ExposureChoice, WORTHWHILE, fit_exposure};
use ghand_fit::light_fit::{LightChoice, LightFit, fit_light};
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
        let mut found;
        if let Some(fit) = exposures.as_mut().filter(|fit| fit.corrected) {
            // Shine and light from one side differ between cameras, too.
            let as_it_is = match exposure {
                ExposureChoice::Auto => self.light_of(&seen)?,
                _ => None,
            };
            correction.cameras.clone_from(&fit.maps);
            seen.correct(&correction);
            found = self.light_of(&seen)?;
            if let (Some(without), Some(with)) = (&as_it_is, &found) {
                let unexplained = [without.unexplained(fit, 0), with.unexplained(fit, 1)];
                fit.unexplained = Some(unexplained);
                fit.corrected = unexplained[1] < WORTHWHILE * unexplained[0];
            }
            if !fit.corrected {
                (correction, found) = (ColorCorrection::default(), as_it_is);
            }
        } else {
            found = self.light_of(&seen)?;
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

    /// The light in which the images show the hand; `None` if it is not to be taken apart from skin.
    fn light_of(&self, seen: &TexelFrames) -> Result<Option<LightFit>, InvalidHandModel> {
        let TrainSettings { light, gloss, .. } = self.settings;
        let fit = || fit_light(seen, &self.capture.template, &self.prepared.poses, light, gloss);
        (light != LightChoice::Off).then(fit).transpose()
    }
}
