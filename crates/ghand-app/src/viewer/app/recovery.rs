//! Recovery of the viewer from a lost device: subject, pose and view stay, everything else is created again.

use crate::viewer::app::Viewer;

/// How many times in a row the device may be lost before a picture is done.
const MOST_LOSSES: u32 = 3;

impl Viewer {
    /// Whether the device is lost. A lost device cannot draw anything.
    pub fn is_lost(&self) -> bool {
        self.gpu().poll().is_err() && self.gpu().is_lost()
    }

    /// Runs `show`, which shows the viewer. If the device is lost meanwhile, runs it again with a new one; `show` must
    /// then also create its own drawing resources again.
    ///
    /// # Errors
    /// The error of `show` if it failed for another reason or the device is lost every time, else one that says why
    /// there is no new device.
    pub fn retry_on_device_loss<T>(
        &mut self,
        mut show: impl FnMut(&mut Viewer) -> anyhow::Result<T>,
    ) -> anyhow::Result<T> {
        let mut losses = 0;
        loop {
            let result = show(self);
            if result.is_ok() || !self.is_lost() {
                return result;
            }
            losses = if self.stage.canvas.has_times() { 1 } else { losses + 1 };
            if losses > MOST_LOSSES {
                return result;
            }
            log::warn!("the graphics device was lost: the viewer continues with a new one");
            self.renew()?;
        }
    }

    fn renew(&mut self) -> anyhow::Result<()> {
        self.stage.renew(&self.document.subject)?;
        self.document.forget_pictures();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use ghand_render::{AdapterChoice, Gpu};
    use image::RgbImage;

    use super::*;
    use crate::pose_choice::pose_by_name;
    use crate::viewer::document::subject::Subject;
    use crate::viewer::hand::Hand;
    use crate::viewer::hand::tests::untrained_avatar;
    use crate::viewer::screenshot::screenshot;

    fn viewer() -> Viewer {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let mut hand = Hand::new(untrained_avatar());
        hand.pose = pose_by_name("fist", hand.model()).unwrap();
        Viewer::new(&gpu, Subject::Hand(Box::new(hand)), "test".into()).unwrap()
    }

    /// The hand without the panel, because the panel shows times.
    fn shot(viewer: &mut Viewer) -> RgbImage {
        let file = tempfile::Builder::new().suffix(".png").tempfile().unwrap();
        screenshot(viewer, [400, 200], 1.0, file.path()).unwrap();
        let picture = image::open(file.path()).unwrap().into_rgb8();
        image::imageops::crop_imm(&picture, 260, 0, 140, 200).to_image()
    }

    #[test]
    fn a_viewer_shows_the_same_picture_after_a_device_loss() {
        let mut viewer = viewer();
        viewer.stage.camera.zoom(1.5);
        let before = shot(&mut viewer);
        let lost = viewer.gpu().clone();
        lost.device.destroy();
        assert!(viewer.is_lost() && lost.is_lost());
        let after = shot(&mut viewer);
        assert!(lost.is_lost() && !viewer.is_lost());
        assert!(before == after);
        let mut other = self::viewer();
        other.subject_mut().reset();
        assert!(shot(&mut other) != before, "the pictures are not compared");
    }

    #[test]
    fn a_viewer_that_loses_every_device_ends_with_the_reason() {
        let mut viewer = viewer();
        let mut tries = 0;
        let error = viewer
            .retry_on_device_loss(|viewer| -> anyhow::Result<()> {
                tries += 1;
                viewer.gpu().device.destroy();
                Ok(viewer.gpu().wait()?)
            })
            .unwrap_err();
        assert_eq!(tries, 1 + MOST_LOSSES);
        assert!(error.to_string().contains("was lost"), "{error}");
        // Other failures are not retried; a window closed by its user is not a failure.
        viewer.renew().unwrap();
        assert_eq!(
            viewer.retry_on_device_loss(|_| -> anyhow::Result<()> { anyhow::bail!("no") }).unwrap_err().to_string(),
            "no"
        );
        assert_eq!(viewer.retry_on_device_loss(|_| Ok(7)).unwrap(), 7);
    }
}
