//! The project's WGSL without a device.

use ghand_render::{Tier, shader_sources};
use naga::valid::{Capabilities, ValidationFlags, Validator};

/// Every WGSL source as the device gets it, with its name and the tier that runs it.
pub fn sources() -> Vec<(&'static str, Tier, String)> {
    let baseline = shader_sources::baseline().into_iter().map(|(name, source)| (name, Tier::Baseline, source));
    let fast = shader_sources::fast().into_iter().map(|(name, source)| (name, Tier::Fast, source));
    let response = ("pose_response", Tier::Baseline, ghand_avatar::direct::shader_source());
    baseline.chain(fast).chain([response]).collect()
}

/// Parses and validates a source against what every device of a tier can do.
///
/// # Errors
/// The compiler's message, with the place in the source.
pub fn validate(tier: Tier, source: &str) -> Result<naga::Module, String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let capabilities = match tier {
        Tier::Baseline => Capabilities::empty(),
        Tier::Fast => Capabilities::SUBGROUP,
    };
    Validator::new(ValidationFlags::all(), capabilities).validate(&module).map_err(|e| e.emit_to_string(source))?;
    Ok(module)
}
