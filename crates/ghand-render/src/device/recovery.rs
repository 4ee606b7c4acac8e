//! Going on after the loss of a device.

use std::thread::sleep;
use std::time::Duration;

use crate::Gpu;
use crate::device::{DeviceError, adapter, instance};

/// Pauses between the tries to open an adapter again, milliseconds: a driver that is being reset or updated is away for
/// seconds.
const PAUSES_MS: [u64; 5] = [100, 300, 1000, 2000, 4000];

/// How often one piece of work is begun again. What has made the device fail every time will do so once more.
const MOST_LOSSES: u32 = 3;

impl Gpu {
    /// Opens a new device of the same adapter, waiting some seconds if the adapter is away. Nothing that was made on the
    /// old device can be used with the new one. Where the adapter speaks Direct3D 12, nothing of the old device should be
    /// left by then: a system without independent devices gives no second one beside it.
    ///
    /// # Errors
    /// [`DeviceError::Gone`] if the adapter does not come back, [`DeviceError::NoDevice`] if it gives no device.
    pub fn reopen(&self) -> Result<Gpu, DeviceError> {
        with_pauses(&PAUSES_MS.map(Duration::from_millis), || {
            let instance = instance();
            match adapter::find_again(&instance, &self.info) {
                Some(adapter) => Gpu::open(instance, adapter, Some(self.tier)),
                None => Err(DeviceError::Gone { adapter: self.info.name.clone() }),
            }
        })
    }

    /// Does `work`, which is called `what`, and if the device is lost meanwhile begins it again on a new device, which
    /// then takes the place of this one. `work` makes what it needs on the device that it is given, and keeps elsewhere
    /// what it need not do twice.
    ///
    /// # Errors
    /// That of `work` if it failed for another reason or after the device was lost several times; [`DeviceError`] if no
    /// new device can be had.
    pub fn persist<T, E: From<DeviceError>>(
        &mut self,
        what: &str,
        mut work: impl FnMut(&Gpu) -> Result<T, E>,
    ) -> Result<T, E> {
        let mut losses = 0;
        loop {
            if self.is_lost() {
                *self = self.reopen()?;
            }
            let result = work(self);
            // The error may be wrapped up in any other; the device itself tells best whether it is lost.
            if result.is_ok() || !self.is_lost() || losses == MOST_LOSSES {
                return result;
            }
            losses += 1;
            log::warn!("the graphics device was lost: {what} goes on with a new one");
        }
    }
}

/// The first success of `attempt`, which is repeated after each pause; else its last error.
fn with_pauses<T, E>(pauses: &[Duration], mut attempt: impl FnMut() -> Result<T, E>) -> Result<T, E> {
    for pause in pauses {
        if let Ok(success) = attempt() {
            return Ok(success);
        }
        sleep(*pause);
    }
    attempt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_back_late_is_found_and_what_stays_away_is_given_up() {
        let pauses = [Duration::ZERO; 3];
        for (back_at, expected) in [(1, Ok(1)), (3, Ok(3)), (4, Ok(4)), (5, Err(4))] {
            let mut tries = 0;
            let result = with_pauses(&pauses, || {
                tries += 1;
                if tries >= back_at { Ok(tries) } else { Err(tries) }
            });
            assert_eq!(result, expected);
        }
    }
}
