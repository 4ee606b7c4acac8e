//! Gaussians that training hardly saw take their values from their neighbours, and offsets lie smoothly over the surface.

use rayon::prelude::*;

use super::tables::DirectTables;
use crate::neighbors::MOST_NEIGHBORS;

/// How much a difference between neighbours counts, as a part of the weight of a Gaussian that training saw as much as
/// most. Where training saw much this moves nothing visible; where it saw nothing neighbours decide alone.
const COUPLING: f64 = 0.01;
/// The same of offsets, times the number of cameras. Also a Gaussian that was seen often has been at the outline in few images,
/// and elsewhere images hardly say where it is: there offsets are noise, which in other poses frays the outline into flakes. The
/// more cameras, the more say where it is: of a hand filmed by two, smoothing takes loose coverage from 0.26 to 0.21 %, while
/// 0.1 instead of 0.015 costs 0.15 dB with twenty.
const OFFSET_COUPLING: f64 = 0.3;
/// Sweeps over the surface: enough to cross the widest unseen part.
const SWEEPS: usize = 300;

impl DirectTables {
    /// Solves `min sum_p w_p |x_p - y_p|^2 + c sum_(p,q) |x_p - x_q|^2` over neighbours for each row of shape bases and
    /// appearance; c is larger for the bases. `seen` is how much training saw each Gaussian, N; w is that, relative to the median, but at most 1.
    /// `neighbors` is [`crate::neighbors::neighbors`], `cameras` the number of cameras of the training images.
    pub fn fill_unseen(&mut self, seen: &[f32], neighbors: &[u32], cameras: usize) {
        let offset_coupling = (OFFSET_COUPLING / cameras.max(1) as f64).max(COUPLING);
        let count = seen.len();
        let mut sorted = seen.to_vec();
        sorted.sort_by(f32::total_cmp);
        let median = f64::from(sorted.get(count / 2).copied().unwrap_or_default());
        if median.is_nan() || median <= 0.0 {
            return;
        }
        let weights: Vec<f64> = seen.iter().map(|w| (f64::from(*w) / median).clamp(0.0, 1.0)).collect();
        // Gaussians without neighbours in their part of the surface keep their values.
        let near: Vec<Vec<usize>> = (0..count)
            .map(|p| (0..MOST_NEIGHBORS).map(|k| neighbors[k * count + p] as usize).filter(|q| *q != p).collect())
            .collect();
        let offsets = self.shape_basis.par_chunks_exact_mut(count).map(|row| (row, offset_coupling));
        let appearance = self.appearance.par_chunks_exact_mut(count).map(|row| (row, COUPLING));
        offsets.chain(appearance).for_each(|(row, coupling)| fill_row(row, &weights, &near, coupling));
    }
}

/// Gauss-Seidel sweeps, forwards and backwards in turns.
fn fill_row(row: &mut [f32], weights: &[f64], near: &[Vec<usize>], coupling: f64) {
    let wanted: Vec<f64> = row.iter().map(|y| f64::from(*y)).collect();
    let mut values = wanted.clone();
    let update = |values: &mut [f64], p: usize| {
        let sum: f64 = near[p].iter().map(|q| values[*q]).sum();
        let total = weights[p] + coupling * near[p].len() as f64;
        if total > 0.0 {
            values[p] = (weights[p] * wanted[p] + coupling * sum) / total;
        }
    };
    for sweep in 0..SWEEPS {
        if sweep % 2 == 0 {
            (0..values.len()).for_each(|p| update(&mut values, p));
        } else {
            (0..values.len()).rev().for_each(|p| update(&mut values, p));
        }
    }
    row.iter_mut().zip(values).for_each(|(slot, value)| *slot = value as f32);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of 60 Gaussians.
    fn chain() -> Vec<Vec<usize>> {
        (0..60usize).map(|p| [p.checked_sub(1), (p < 59).then_some(p + 1)].into_iter().flatten().collect()).collect()
    }

    #[test]
    fn unseen_gaussians_get_what_lies_between_seen_ones_and_those_stay() {
        let noise = |p: usize| if p.is_multiple_of(2) { 9.0 } else { -9.0 };
        let seen = |p: usize| !(20..40).contains(&p);
        let mut row: Vec<f32> = (0..60)
            .map(|p| {
                if !seen(p) {
                    noise(p)
                } else if p < 20 {
                    1.0
                } else {
                    2.0
                }
            })
            .collect();
        let weights: Vec<f64> = (0..60).map(|p| if seen(p) { 1.0 } else { 0.0 }).collect();
        fill_row(&mut row, &weights, &chain(), COUPLING);
        for (p, value) in row.iter().enumerate() {
            let expected = 1.0 + (p as f32 - 19.5).clamp(0.0, 20.0) / 20.0;
            assert!((value - expected).abs() < 0.06, "{p}: {value}, expected {expected}");
        }
        assert!((row[0] - 1.0).abs() < 1e-4 && (row[59] - 2.0).abs() < 1e-4);
    }

    #[test]
    fn noise_of_seen_offsets_shrinks_while_what_is_smooth_stays() {
        let noise = |p: usize| if p.is_multiple_of(2) { 1.0 } else { -1.0 };
        let smooth = |p: usize| 3.0 * (p as f32 * 0.1).sin();
        let of = |value: &dyn Fn(usize) -> f32, coupling: f64| {
            let mut row: Vec<f32> = (0..60).map(value).collect();
            fill_row(&mut row, &[1.0; 60], &chain(), coupling);
            // Away from the chain's ends.
            (10..50).map(|p| (row[p] - value(p)).abs()).fold(0.0, f32::max)
        };
        // A difference of neighbours of 2 shrinks by 1 / (1 + 4 c); curvature of 0.01 per square step by c times as much.
        assert!(of(&noise, OFFSET_COUPLING / 2.0) > 0.25 && of(&noise, COUPLING) < 0.05);
        assert!(of(&smooth, OFFSET_COUPLING / 2.0) < 0.02);
    }

    #[test]
    fn a_surface_that_nothing_saw_keeps_its_values() {
        let template =
            crate::Template::sample(&ghand_hand_model::builtin::builtin_hand(ghand_core::Side::Right).unwrap(), 16)
                .unwrap();
        let config = crate::AvatarConfig { uv_resolution: 16, ..Default::default() };
        let lengths = super::super::table_lengths(template.len(), template.joint_count(), &config);
        let values = |i: usize| (0..lengths[i]).map(|k| k as f32).collect::<Vec<f32>>();
        let mut tables = DirectTables {
            shape_basis: values(0),
            residual_weights: values(1),
            regressor: values(2),
            appearance: values(3),
            response: values(4),
            response_limits: values(5),
        };
        let before = tables.clone();
        let neighbors = crate::neighbors::neighbors(&template);
        tables.fill_unseen(&vec![0.0; template.len()], &neighbors, 8);
        assert_eq!(tables, before);
        let mut seen = vec![1.0; template.len()];
        seen[7] = 0.0;
        tables.fill_unseen(&seen, &neighbors, 8);
        assert_ne!(tables.appearance, before.appearance);
        assert_eq!((&tables.response, &tables.residual_weights), (&before.response, &before.residual_weights));
    }
}
