//! Skinning weights as the device has them, host part of `shared/weights.wgsl`: with lists of which joints move which
//! Gaussians, since a hand's joint moves few.

/// Gaussians of a block, as in `shared/points4.wgsl`: the joints that move any of them are listed together.
pub const BLOCK: usize = 32;
/// Joints that are summed over together, as in `joint_sums.wgsl`.
const JOINTS: usize = 4;

/// Number of invocations that handle four of `count` Gaussians each.
pub fn invocations_of_four(count: usize) -> u32 {
    (count.div_ceil(BLOCK) * BLOCK / 4) as u32
}

/// Weights `[joints][N]`, and behind them two tables of lists, whole numbers as floats: for each block of Gaussians, the
/// joints that have weights there; for each four joints, the blocks where they have some. A table is where each list
/// begins, where the last one ends, and the lists.
pub fn weight_table(weights: &[f32], joints: usize) -> Vec<f32> {
    let count = weights.len() / joints.max(1);
    let blocks = count.div_ceil(BLOCK);
    let has_weights = |joint: usize, block: usize| {
        let row = &weights[joint * count..][..count];
        row[block * BLOCK..count.min((block + 1) * BLOCK)].iter().any(|weight| *weight != 0.0)
    };
    let of_block = |block: usize| (0..joints).filter(|joint| has_weights(*joint, block)).collect();
    let of_joints = |first: usize| {
        let any = |block: &usize| (first..joints.min(first + JOINTS)).any(|joint| has_weights(joint, *block));
        (0..blocks).filter(any).collect()
    };
    [weights.to_vec(), lists((0..blocks).map(of_block)), lists((0..joints).step_by(JOINTS).map(of_joints))].concat()
}

/// Where each list begins and the last one ends, and the lists.
fn lists(lists: impl Iterator<Item = Vec<usize>>) -> Vec<f32> {
    let mut starts = vec![0.0];
    let mut all = vec![];
    for list in lists {
        all.extend(list.into_iter().map(|number| number as f32));
        starts.push(all.len() as f32);
    }
    [starts, all].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_and_blocks_are_listed_where_there_are_weights() {
        // 70 Gaussians, three blocks; joint 1 has weights in the first and the last, joint 4 in the last, 0 everywhere.
        let count = 70;
        let joints = 5;
        let mut weights = vec![0.0; joints * count];
        weights[..count].fill(0.5);
        weights[count + 31] = 0.5;
        weights[count + 69] = -0.1;
        weights[4 * count + 64] = f32::NAN;
        let table = weight_table(&weights, joints);
        let lists = &table[joints * count..];
        let of_blocks = [vec![0.0, 2.0, 3.0, 6.0], vec![0.0, 1.0], vec![0.0], vec![0.0, 1.0, 4.0]].concat();
        let of_joints = [vec![0.0, 3.0, 4.0], vec![0.0, 1.0, 2.0], vec![2.0]].concat();
        assert_eq!(lists, [of_blocks, of_joints].concat());
        assert_eq!(weight_table(&[], 3), [0.0, 0.0, 0.0]);
    }
}
