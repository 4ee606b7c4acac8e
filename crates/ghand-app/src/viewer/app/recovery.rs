//! What becomes of the viewer when its device is lost: the avatar, the pose and the view stay, the rest is made anew.

use crate::viewer::app::Viewer;
use crate::viewer::picture::{Median, Picture};

/// How often in a row the device may be lost before any picture is done.
const MOST_LOSSES: u32 = 3;

impl Viewer {
    /// Asks the device whether it is lost. Then nothing can be drawn with it any more.
    pub fn is_lost(&self) -> bool {
        self.gpu.poll().is_err() && self.gpu.is_lost()
    }

    /// Runs `show`, which shows the viewer, and if the device is lost meanwhile runs it again with a new one. What `show`
    /// draws the user interface with must be made anew by it, too.
    ///
    /// # Errors
    /// That of `show` if it failed for another reason or the device is lost every time, else one that says why there is no
    /// new device.
    pub fn persist<T>(&mut self, mut show: impl FnMut(&mut Viewer) -> anyhow::Result<T>) -> anyhow::Result<T> {
        let mut losses = 0;
        loop {
            let result = show(self);
            if result.is_ok() || !self.is_lost() {
                return result;
            }
            losses = if self.picture.frame_ms().is_some() { 1 } else { losses + 1 };
            if losses > MOST_LOSSES {
                return result;
            }
            log::warn!("the graphics device was lost: the viewer goes on with a new one");
            self.renew()?;
        }
    }

    fn renew(&mut self) -> anyhow::Result<()> {
        self.gpu = self.gpu.reopen()?;
        self.picture = Picture::new(&self.gpu, &self.avatar, [self.largest_edge; 2])?;
        self.detail = 1.0;
        self.too_many = u32::MAX;
        self.shown = None;
        self.texture = None;
        self.failure = None;
        self.last_frame = None;
        self.between_frames_ms = Median::default();
        Ok(())
    }
}
