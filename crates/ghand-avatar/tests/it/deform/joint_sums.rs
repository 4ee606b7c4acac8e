//! `joint_sums.wgsl` against plain sums.

use ghand_avatar::deform::{JointSums, weight_table};
use ghand_render::buffers;

use crate::deform::hand::assert_same;
use crate::deform::hand::{gpu, kinds, random, widen};

#[test]
fn sums_of_products_equal_those_of_the_twin() {
    let gpu = gpu();
    // Fewer columns than strands, one more than a multiple of them, and blocks that are not full.
    let sizes = [(1, 1, 1, 0), (63, 4, 3, 0), (65, 5, 12, 3), (4097, 16, 7, 1)];
    let both = sizes.into_iter().flat_map(|sizes| [(sizes, false), (sizes, true)]);
    for ((count, left_rows, right_rows, offset), of_weights) in both {
        let mut left = random(1, left_rows * count, 1.0);
        let right = random(2, (offset + right_rows) * count, 1.0);
        if of_weights {
            // Where no joint of a block has weights, of points or of joints.
            let none = |k: usize, p: usize| (k / 3 + p / 80).is_multiple_of(4);
            (0..left.len()).filter(|i| none(i / count, i % count)).for_each(|i| left[i] = 0.0);
        }
        let on_device = if of_weights { weight_table(&left, left_rows) } else { left.clone() };
        let buffers_of = [buffers::filled(&gpu, "left", &on_device), buffers::filled(&gpu, "right", &right)];
        let new = if of_weights { JointSums::of_weights } else { JointSums::new };
        let sums = new(&gpu, &buffers_of[0], left_rows, &buffers_of[1], offset as u32, right_rows, count);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        sums.encode(&mut encoder.begin_compute_pass(&Default::default()));
        gpu.queue.submit([encoder.finish()]);
        let got: Vec<f32> = buffers::read(&gpu, &sums.total, left_rows * right_rows).unwrap();
        let (left, right) = (widen(&left), widen(&right));
        let product = |k: usize, m: usize| -> f64 {
            (0..count).map(|p| left[k * count + p] * right[(offset + m) * count + p]).sum()
        };
        let twin: Vec<f64> =
            (0..left_rows).flat_map(|k| (0..right_rows).map(move |m| (k, m))).map(|(k, m)| product(k, m)).collect();
        assert_same(kinds()[0], &format!("{count} columns, of weights: {of_weights}"), &widen(&got)[..], &twin);
    }
}
