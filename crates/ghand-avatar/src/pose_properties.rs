//! The properties of an avatar in a pose, read from the device.

use ghand_render::{Gpu, RenderError, buffers};
use glam::DVec3;

use crate::deform::Properties;

/// The properties in one pose, as on the device but in f64.
#[derive(Debug, Clone)]
pub struct PoseProperties {
    /// Shape bases S, `[n][N]`, metres.
    pub shape_basis: Vec<DVec3>,
    /// Coefficients, `[n][rows][N]`.
    pub coefficients: Vec<f32>,
    /// Numbers of a coefficient.
    pub rows: usize,
    /// Residual skinning weights, `[n_b][N]`; zero if skinning is plain.
    pub residual_weights: Vec<f64>,
    /// Skeleton regressor, `[n_b][N]`; zero if skinning is plain.
    pub regressor: Vec<f64>,
}

impl PoseProperties {
    /// Reads them once an avatar is posed, and waits for them.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed.
    pub fn read(gpu: &Gpu, p: &Properties) -> Result<PoseProperties, RenderError> {
        let n = p.sizes.gaussians;
        let bases = p.sizes.bases;
        let joints = p.sizes.joints;
        let wide = |values: Vec<f32>| values.into_iter().map(f64::from).collect::<Vec<f64>>();
        let rows = p.sizes.coefficients.rows();
        // Plain skinning is that with residual weights of 0.
        let residual = |buffer: &wgpu::Buffer| match p.sizes.plain_skinning {
            true => Ok(vec![0.0; joints * n]),
            false => buffers::read(gpu, buffer, joints * n).map(wide),
        };
        Ok(PoseProperties {
            shape_basis: vectors(&wide(buffers::read(gpu, &p.shape_basis, 3 * bases * n)?), n),
            coefficients: buffers::read(gpu, &p.coefficients, rows * bases * n)?,
            rows,
            residual_weights: residual(&p.residual_weights)?,
            regressor: residual(&p.regressor)?,
        })
    }
}

/// Vectors from rows of components `[k][3][N]`.
pub fn vectors(values: &[f64], count: usize) -> Vec<DVec3> {
    let rows = values.chunks_exact(3 * count.max(1));
    rows.flat_map(|row| (0..count).map(|p| DVec3::new(row[p], row[count + p], row[2 * count + p]))).collect()
}

/// Weights `[n_b][N]` less their mean over the joints.
pub fn centred(weights: &[f64], count: usize, joints: usize) -> Vec<f64> {
    let mean = |p: usize| (0..joints).map(|k| weights[k * count + p]).sum::<f64>() / joints.max(1) as f64;
    let means: Vec<f64> = (0..count).map(mean).collect();
    weights.iter().enumerate().map(|(i, weight)| weight - means[i % count.max(1)]).collect()
}
