//! The learned tables of a `direct` avatar.

use rand::{RngExt, SeedableRng};

use crate::properties::{PropertyStart, PropertyTables};
use crate::template::{AvatarConfig, FEATURES, Offsets, Template};

/// Rows of the appearance table before the colour components: scale logit and base colour.
pub(super) const APPEARANCE_ROWS: usize = 4;

/// The learned tables of a direct avatar, row-major `[rows][N]` unless stated otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectTables {
    /// S, `[n * 3][N]`, metres.
    pub shape_basis: Vec<f32>,
    /// W^, `[n_b][N]`; empty if skinning is plain.
    pub residual_weights: Vec<f32>,
    /// R, `[n_b][N]`; empty if skinning is plain.
    pub regressor: Vec<f32>,
    /// Scale logit, base colour logits (3), colour components (3 each), `[4 + 3 m][N]`.
    pub appearance: Vec<f32>,
    /// Biases `[n + m]`, then gains `[n + m][n_b][9]`.
    pub response: Vec<f32>,
    /// Smallest and largest term of each joint in each channel of the response, `[n + m][n_b][2]`; not learned.
    pub response_limits: Vec<f32>,
}

/// Lengths of the tables of [`DirectTables`], in the order of its fields.
pub fn table_lengths(count: usize, joints: usize, config: &AvatarConfig) -> [usize; 6] {
    let channels = config.channels();
    let residual = if config.plain_skinning { 0 } else { joints * count };
    [
        3 * config.shape_bases * count,
        residual,
        residual,
        (APPEARANCE_ROWS + 3 * config.color_components) * count,
        channels + channels * joints * 9,
        channels * joints * 2,
    ]
}

/// Bytes of the learned tables per Gaussian.
pub(in crate::properties) fn bytes_per_gaussian(joints: usize, config: &AvatarConfig) -> usize {
    let [shape_basis, residual_weights, regressor, appearance, ..] = table_lengths(1, joints, config);
    size_of::<f32>() * (shape_basis + residual_weights + regressor + appearance)
}

/// Limits for `terms` joint terms, `[terms][2]`, that have no effect. Finite, as all numbers of an avatar must be.
pub fn no_limits(terms: usize) -> Vec<f32> {
    [f32::MIN, f32::MAX].repeat(terms)
}

/// Standard deviation of the bases whose coefficient starts at 0: too small to be visible, enough to break symmetry.
const BASIS_NOISE: f32 = 1e-4;
/// The same for the colour components, in logits.
const COMPONENT_NOISE: f32 = 0.1;

fn logit(x: f32) -> f32 {
    (x / (1.0 - x)).ln()
}

impl DirectTables {
    /// Tables that give the template's plain surface in one colour. The first basis has a constant coefficient of 1;
    /// all others and all colour components start with coefficient 0.
    ///
    /// The first basis moves each Gaussian inwards, against its normal, by its inset: splats extend beyond their centres, and
    /// the initial silhouette should match the surface's.
    pub fn untrained(template: &Template, config: &AvatarConfig, start: &PropertyStart<'_>) -> DirectTables {
        let count = template.len();
        let joints = template.joint_count();
        let lengths = table_lengths(count, joints, config);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(start.seed);
        // The sum of four uniform numbers is close enough to a normal one, and has the same bits on every platform.
        let mut noise = |size: f32| -> f32 {
            let sum: f32 = (0..4).map(|_| rng.random_range(-1.0f32..1.0)).sum();
            sum * size * (3.0f32 / 4.0).sqrt()
        };
        let mut shape_basis = vec![0.0; lengths[0]];
        shape_basis.iter_mut().skip(3 * count).for_each(|s| *s = noise(BASIS_NOISE));
        for (c, row) in shape_basis.chunks_exact_mut(count.max(1)).take(3).enumerate() {
            for ((slot, normal), inset) in row.iter_mut().zip(start.normals).zip(start.insets) {
                *slot = -(normal[c] * inset) as f32;
            }
        }
        let largest = template.max_scale();
        let mut appearance: Vec<f32> = template
            .spacings
            .iter()
            .map(|s| logit((PropertyTables::START_SCALE * s / largest).clamp(0.02, 0.9)))
            .collect();
        for channel in start.color {
            appearance.extend(std::iter::repeat_n(logit((channel as f32).clamp(0.01, 0.99)), count));
        }
        appearance.extend((0..lengths[3] - APPEARANCE_ROWS * count).map(|_| noise(COMPONENT_NOISE)));
        let mut response = vec![0.0; lengths[4]];
        // The first basis has a coefficient of 1 in each row.
        let rows = config.coefficients.rows().min(config.coefficient_rows());
        response.iter_mut().take(rows).for_each(|bias| *bias = 1.0);
        if config.offsets == Offsets::Free {
            shape_basis[3 * count..].fill(0.0);
            // Basis 1 + f responds to entry f of every joint's vec(R_k - I), and nothing else.
            let gains = &mut response[config.channels()..];
            for feature in 0..FEATURES.min(config.coefficient_rows().saturating_sub(1)) {
                for joint in 0..joints {
                    gains[((1 + feature) * joints + joint) * FEATURES + feature] = 1.0;
                }
            }
        }
        DirectTables {
            shape_basis,
            residual_weights: vec![0.0; lengths[1]],
            regressor: vec![0.0; lengths[2]],
            appearance,
            response,
            response_limits: no_limits(lengths[5] / 2),
        }
    }
}

/// Sets rows 1 to 3 of a table `[rows][N]` to the logits of these colours (display values 0..1).
pub(in crate::properties) fn set_color_logits(table: &mut [f32], colors: &[[f64; 3]]) {
    let count = colors.len();
    for channel in 0..3 {
        let row = table.iter_mut().skip((1 + channel) * count);
        row.zip(colors).for_each(|(slot, color)| *slot = logit((color[channel] as f32).clamp(0.01, 0.99)));
    }
}

impl DirectTables {
    /// Sets the base colour of each Gaussian (display values 0..1).
    pub fn set_base_colors(&mut self, colors: &[[f64; 3]]) {
        set_color_logits(&mut self.appearance, colors);
    }

    /// As [`DirectTables::set_base_colors`], and no pose changes the colours.
    pub fn set_constant_colors(&mut self, colors: &[[f64; 3]]) {
        self.set_base_colors(colors);
        self.appearance.iter_mut().skip(APPEARANCE_ROWS * colors.len()).for_each(|component| *component = 0.0);
    }
}
