//! The order of a baked hand's Gaussians, and the joints of their groups.

use crate::deform::baked::GROUP;

use crate::template::Template;

/// Skinning weights below this are dropped; the others take their place.
const SMALLEST_WEIGHT: f64 = 0.004;
/// Most joints of a Gaussian.
const MOST_JOINTS: usize = 6;
/// The largest weight as it is stored.
const ONE: f64 = 65_535.0;

/// Gaussians in their new order.
pub struct Ordered {
    /// The number of each in the avatar that is baked.
    pub order: Vec<usize>,
    /// Skinning weights of each, as they are stored, with their joints; they sum up to 65,535.
    pub weights: Vec<Vec<(usize, u16)>>,
    /// Joints of each group, ascending.
    pub groups: Vec<Vec<usize>>,
}

impl Ordered {
    pub fn new(template: &Template) -> Ordered {
        let count = template.len();
        let weights: Vec<_> = (0..count).map(|p| stored_weights(template, p)).collect();
        let mut order: Vec<usize> = (0..count).collect();
        let places = places(&template.rest, count);
        order.sort_by_cached_key(|p| {
            let mut joints: Vec<(u16, usize)> = weights[*p].iter().map(|(k, w)| (*w, *k)).collect();
            joints.sort_unstable_by(|a, b| b.cmp(a));
            let most: Vec<usize> = joints.iter().take(2).map(|(_, k)| *k).collect();
            (most, places[*p])
        });
        let weights: Vec<_> = order.iter().map(|p| weights[*p].clone()).collect();
        let groups = weights.chunks(GROUP).map(|group| {
            let mut joints: Vec<usize> = group.iter().flatten().map(|(k, _)| *k).collect();
            joints.sort_unstable();
            joints.dedup();
            joints
        });
        Ordered { groups: groups.collect(), order, weights }
    }

    /// A weight as a number.
    pub fn weight(stored: u16) -> f64 {
        f64::from(stored) / ONE
    }
}

fn stored_weights(template: &Template, p: usize) -> Vec<(usize, u16)> {
    let count = template.len();
    let mut all: Vec<(usize, f64)> =
        (0..template.joint_count()).map(|k| (k, f64::from(template.weights[k * count + p]))).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(MOST_JOINTS);
    // The largest always stays.
    let mut kept: Vec<(usize, f64)> = all.iter().take(1).copied().collect();
    kept.extend(all.into_iter().skip(1).filter(|(_, w)| *w >= SMALLEST_WEIGHT));
    let sum: f64 = kept.iter().map(|(_, w)| w).sum();
    let mut stored: Vec<(usize, u16)> = kept.iter().map(|(k, w)| (*k, (w / sum * ONE).round() as u16)).collect();
    let rest: i32 = ONE as i32 - stored.iter().map(|(_, w)| i32::from(*w)).sum::<i32>();
    if let Some((_, largest)) = stored.first_mut() {
        *largest = (i32::from(*largest) + rest) as u16;
    }
    stored
}

/// Numbers of the cells of the Gaussians along a curve that stays close to where it was (Morton's), N.
fn places(rest: &[f32], count: usize) -> Vec<u32> {
    const BITS: u32 = 10;
    let range = |c: usize| {
        let row = &rest[c * count..(c + 1) * count];
        let low = row.iter().copied().fold(f32::INFINITY, f32::min);
        [low, row.iter().copied().fold(f32::NEG_INFINITY, f32::max) - low]
    };
    let ranges = [range(0), range(1), range(2)];
    let cell = |p: usize, c: usize| {
        let [low, width] = ranges[c];
        ((rest[c * count + p] - low) / width.max(f32::MIN_POSITIVE) * ((1 << BITS) - 1) as f32) as u32
    };
    let interleave = |p: usize| {
        let cells = [0, 1, 2].map(|c| cell(p, c));
        (0..BITS).fold(0, |sum, bit| (0..3).fold(sum, |sum, c| sum | (cells[c as usize] >> bit & 1) << (3 * bit + c)))
    };
    (0..count).map(interleave).collect()
}
