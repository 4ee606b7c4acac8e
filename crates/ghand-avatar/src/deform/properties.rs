//! The properties of the Gaussians: written by a property model, read by the deformation and the projection.

use ghand_core::blend_shapes::CoefficientLayout;

use ghand_render::{Gpu, buffers};

/// Sizes of the properties of one hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PropertySizes {
    /// Number of Gaussians, N.
    pub gaussians: usize,
    /// Number of joints, `n_b`.
    pub joints: usize,
    /// Number of shape bases, n.
    pub bases: usize,
    /// Layout of the blend coefficients.
    pub coefficients: CoefficientLayout,
    /// Whether skinning is plain: there are no residual weights, no regressor and no residual skeleton.
    pub plain_skinning: bool,
}

impl PropertySizes {
    /// Rows of residual weights and of the regressor.
    pub fn residual_rows(&self) -> usize {
        if self.plain_skinning { 0 } else { self.joints }
    }

    /// The constants of the skinning stages.
    pub(super) fn skinning(&self) -> [(&'static str, f64); 1] {
        [("PLAIN", f64::from(u8::from(self.plain_skinning)))]
    }
}

/// The properties of N Gaussians in one pose, on the device: f32, row-major, in buffers that exist as long as the hand.
/// A property model fills them before the deformation runs; those that do not depend on the pose can be filled once.
///
/// Gradients of the properties have the same layout, in separate buffers.
#[derive(Debug, Clone)]
pub struct Properties {
    /// Sizes of the buffers.
    pub sizes: PropertySizes,
    /// Shape bases S, `[n][3][N]`, metres (paper eq. 7).
    pub shape_basis: wgpu::Buffer,
    /// Blend coefficients C, `[n][N]` or `[n][3][N]`, no unit.
    pub coefficients: wgpu::Buffer,
    /// Residual skinning weights W^, `[n_b][N]`, no unit; empty if skinning is plain, as is the regressor.
    pub residual_weights: wgpu::Buffer,
    /// Skeleton regressor R, `[n_b][N]`, no unit.
    pub regressor: wgpu::Buffer,
    /// Standard deviations of the Gaussians, `[N]`, metres.
    pub scale: wgpu::Buffer,
    /// Colours, `[3][N]`, display values.
    pub color: wgpu::Buffer,
}

impl Properties {
    /// Zeroed buffers.
    pub fn zeroed(gpu: &Gpu, sizes: PropertySizes) -> Properties {
        let PropertySizes { gaussians: n, bases, coefficients, .. } = sizes;
        Properties {
            sizes,
            shape_basis: buffers::zeroed(gpu, "shape basis", 3 * bases * n),
            coefficients: buffers::zeroed(gpu, "coefficients", coefficients.rows() * bases * n),
            residual_weights: buffers::zeroed(gpu, "residual weights", sizes.residual_rows() * n),
            regressor: buffers::zeroed(gpu, "regressor", sizes.residual_rows() * n),
            scale: buffers::zeroed(gpu, "scale", n),
            color: buffers::zeroed(gpu, "color", 3 * n),
        }
    }

    /// Those of a baked hand of N Gaussians: none but, if it is lit, colours.
    pub(super) fn colors(gpu: &Gpu, gaussians: usize, joints: usize, lit: bool) -> Properties {
        let coefficients = CoefficientLayout::default();
        let none = PropertySizes { gaussians: 0, joints: 0, bases: 0, coefficients, plain_skinning: true };
        Properties {
            sizes: PropertySizes { gaussians, joints, ..none },
            color: buffers::zeroed(gpu, "color", if lit { 3 * gaussians } else { 0 }),
            ..Properties::zeroed(gpu, none)
        }
    }
}
