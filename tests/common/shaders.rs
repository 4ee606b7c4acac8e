//! The project's WGSL without a device.

use naga::valid::{Capabilities, ValidationFlags, Validator};

/// Every WGSL source as the device gets it, with its name.
pub fn sources() -> Vec<(&'static str, String)> {
    let mut sources = ghand_render::shader_sources::all();
    sources.push(("pose_response", ghand_avatar::direct::shader_source()));
    sources
}

/// Parses and validates a source against what every WebGPU device can do.
///
/// # Errors
/// The compiler's message, with the place in the source.
pub fn validate(source: &str) -> Result<naga::Module, String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|e| e.emit_to_string(source))?;
    Ok(module)
}
