//! Recovery after the loss of a device.

use std::thread::sleep;
use std::time::Duration;

use crate::Gpu;
use crate::device::{DeviceError, adapter, instance};

/// Pauses between attempts to open an adapter again, milliseconds: a driver that is being reset or updated is
/// unavailable for seconds.
const PAUSES_MS: [u64; 5] = [100, 300, 1000, 2000, 4000];

/// How often a piece of work is restarted. If it loses the device every time, it would do so again.
const MOST_LOSSES: u32 = 3;

impl Gpu {
    /// Opens a new device of the same adapter, waiting some seconds if the adapter is unavailable. Objects of the old
    /// device cannot be used with the new one. With Direct3D 12, all objects of the old device should be dropped first:
    /// a system without independent devices does not open a second one.
    ///
    /// # Errors
    /// [`DeviceError::Gone`] if the adapter does not come back, [`DeviceError::NoDevice`] if it does not give a device.
    pub fn reopen(&self) -> Result<Gpu, DeviceError> {
        with_pauses(&PAUSES_MS.map(Duration::from_millis), || {
            let instance = instance();
            match pollster::block_on(adapter::find_again(&instance, &self.info)) {
                Some(adapter) => pollster::block_on(Gpu::open(instance, adapter, Some(self.tier))),
                None => Err(DeviceError::Gone { adapter: self.info.name.clone() }),
            }
        })
    }

    /// Runs `work`, named `what` in messages. If the device is lost meanwhile, restarts it on a new device, which
    /// replaces this one. `work` must make all device objects on the device that it is given, and keep results that
    /// need not be repeated outside the device.
    ///
    /// # Errors
    /// The error of `work` if it failed for another reason or after the device was lost several times; [`DeviceError`]
    /// if no new device can be opened.
    pub fn retry_on_device_loss<T, E: From<DeviceError>>(
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
            // The error can be wrapped in any other, so the device itself is asked whether it is lost.
            if result.is_ok() || !self.is_lost() || losses == MOST_LOSSES {
                return result;
            }
            losses += 1;
            log::warn!("the graphics device was lost: {what} continues with a new one");
        }
    }
}

/// Repeats `attempt` after each pause; returns its first success, or its last error.
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
    fn attempts_are_repeated_until_a_success_or_the_last_pause() {
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
