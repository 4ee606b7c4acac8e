//! Checks that the host has enough memory for training.

use ghand_avatar::PropertyTables;

use crate::settings::TrainSettings;
use crate::train_error::TrainError;

/// Bytes of host memory that `gaussians` need while a stage starts: the learned tables, the sampled template, the
/// surface samples (once for the template and once for the colours), and the colours.
fn bytes_wanted(gaussians: usize, joints: usize, settings: &TrainSettings) -> u64 {
    let [tables, template, sampled, colors] =
        [PropertyTables::bytes_per_gaussian(joints, &settings.avatar()), 4 * (joints + 4), 8 * (joints + 11), 8 * 13];
    gaussians as u64 * (tables + template + 2 * sampled + colors) as u64
}

/// Fails if the system does not grant the memory that training will need, because Rust aborts a program that runs out
/// of it. A system that overcommits memory, as Linux usually does, can grant more than it has.
///
/// # Errors
/// [`TrainError::NoMemory`] with the number of Gaussians and what they need.
pub(crate) fn check(gaussians: usize, joints: usize, settings: &TrainSettings) -> Result<(), TrainError> {
    let bytes = bytes_wanted(gaussians, joints, settings);
    let refused = TrainError::NoMemory { gaussians, mebibytes: bytes >> 20, uv_resolution: settings.uv_resolution };
    let Ok(length) = usize::try_from(bytes) else { return Err(refused) };
    // Reserved and freed, never written to.
    Vec::<u8>::new().try_reserve_exact(length).map_err(|_| refused)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_gaussians_than_memory_holds_are_rejected_with_what_they_need() {
        let settings = TrainSettings { uv_resolution: 160, ..TrainSettings::default() };
        check(14_000, 16, &settings).unwrap();
        // More than a 64-bit processor can address.
        let message = check(1 << 46, 16, &settings).unwrap_err().to_string();
        assert!(message.contains("not enough memory") && message.contains("uv_resolution=160"), "{message}");
        assert!(message.contains("70368744177664 Gaussians"), "{message}");
    }
}
