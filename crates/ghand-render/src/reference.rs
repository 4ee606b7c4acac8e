//! CPU twins of the GPU stages, in plain f64, against which tests compare the shaders.

pub mod adam;
pub mod bin;
pub mod image_loss;
pub mod mesh;
pub mod penalty;
pub mod project;
pub mod rasterize;
pub mod roughness;
pub mod sort;
pub mod spherical_harmonics;
mod wireframe;

/// Numbers that the shaders and their twins both have: stage, name in the WGSL, value here. A test compares them.
pub fn shared_constants() -> [(&'static str, &'static str, f64); 10] {
    [
        ("project", "BLUR", project::BLUR),
        ("project", "NARROW_BLUR", project::NARROW_BLUR),
        ("project", "ALPHA_MIN", project::ALPHA_MIN),
        ("rasterize", "ALPHA_MAX", rasterize::ALPHA_MAX),
        ("rasterize", "TRANSMITTANCE_MIN", rasterize::TRANSMITTANCE_MIN),
        ("image_loss", "RADIUS", image_loss::RADIUS as f64),
        ("image_loss", "C1", image_loss::C1),
        ("image_loss", "C2", image_loss::C2),
        ("image_loss", "ROW_STRIP", f64::from(crate::image_loss::ROW_STRIP)),
        ("image_loss", "COLUMN_STRIP", f64::from(crate::image_loss::COLUMN_STRIP)),
    ]
}
