//! Whether the memory has room for a training.

use ghand_avatar::PropertyTables;

use crate::settings::TrainSettings;
use crate::train_error::TrainError;

/// Bytes that `gaussians` take in the host's memory while a stage starts: the learned tables, the sampled template, and
/// the samples of the surface, once for each and once for their colours.
fn bytes_wanted(gaussians: usize, joints: usize, settings: &TrainSettings) -> u64 {
    let [tables, template, sampled, colors] =
        [PropertyTables::bytes_per_gaussian(joints, &settings.avatar()), 4 * (joints + 4), 8 * (joints + 11), 8 * 13];
    gaussians as u64 * (tables + template + 2 * sampled + colors) as u64
}

/// Fails if the system does not give as much memory as training will ask for: Rust ends a program that runs out of it.
/// What is given may still be missing where the system promises more than it has, as Linux usually does.
///
/// # Errors
/// [`TrainError::NoMemory`] with the number of Gaussians and what they need.
pub(crate) fn check(gaussians: usize, joints: usize, settings: &TrainSettings) -> Result<(), TrainError> {
    let bytes = bytes_wanted(gaussians, joints, settings);
    let refused = TrainError::NoMemory { gaussians, mebibytes: bytes >> 20, uv_resolution: settings.uv_resolution };
    let Ok(length) = usize::try_from(bytes) else { return Err(refused) };
    // Asked for and given back, never written to.
    Vec::<u8>::new().try_reserve_exact(length).map_err(|_| refused)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_memory_holds_is_refused_with_what_it_needs() {
        let settings = TrainSettings::default();
        check(14_000, 16, &settings).unwrap();
        // More than a 64-bit processor addresses.
        let message = check(1 << 46, 16, &settings).unwrap_err().to_string();
        assert!(message.contains("not enough memory") && message.contains("uv_resolution=160"), "{message}");
        assert!(message.contains("70368744177664 Gaussians"), "{message}");
    }
}
