//! Where cameras are to one another, from moments at which two of them see the board.

use ghand_capture::cameras::rigid::Rigid;

/// Differences from which on a pose does not support another one: radians, and parts of the distance.
const TOLERANCE: f64 = 0.05;
/// Candidates that are tried at most, and moments that they are compared with.
const MOST: usize = 60;

/// The pose of the board in a camera's axes at a moment, and others in which it looks alike.
pub(super) type Alike = Vec<Rigid>;

/// A relative pose of two cameras.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    /// `second_from_first`.
    pub pose: Rigid,
    /// How many moments support it.
    pub support: usize,
}

/// How much two poses differ: radians, or parts of the distance, whichever is more.
pub(super) fn difference(a: &Rigid, b: &Rigid) -> f64 {
    let distance = a.translation.length().max(b.translation.length()).max(1e-6);
    a.angle(b).max(a.translation.distance(b.translation) / distance)
}

/// The relative pose of two cameras that most moments support. Each has the board's pose in both.
pub(super) fn pair(moments: &[(Rigid, Alike)]) -> Option<Pair> {
    let step = moments.len().div_ceil(MOST).max(1);
    let few: Vec<&(Rigid, Alike)> = moments.iter().step_by(step).collect();
    let candidates = |(first, alike): &(Rigid, Alike)| -> Vec<Rigid> {
        alike.iter().map(|second| second.after(&first.inverse())).collect()
    };
    // By how the board moves on: the distance of poses depends on where the world's origin is.
    let off = |pose: &Rigid, (first, alike): &(Rigid, Alike)| {
        let predicted = pose.after(first);
        alike.iter().map(|second| difference(&predicted, second)).fold(f64::INFINITY, f64::min)
    };
    let mut best: Option<(f64, Pair)> = None;
    for pose in few.iter().flat_map(|moment| candidates(moment)) {
        let mut cost = 0.0;
        let mut support = 0;
        for moment in &few {
            let off = off(&pose, moment);
            cost += off.min(TOLERANCE);
            support += usize::from(off < TOLERANCE);
        }
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, Pair { pose, support: support * step }));
        }
    }
    best.map(|(_, pair)| pair).filter(|pair| pair.support > 0)
}

/// `camera_from_world` of all cameras, the first one at the origin, along the pairs that are supported most; `None` for
/// those that no pair connects. `pairs[a][b]` is of b seen from a.
pub(super) fn places(pairs: &[Vec<Option<Pair>>]) -> Vec<Option<Rigid>> {
    let mut places = vec![None; pairs.len()];
    if let Some(first) = places.first_mut() {
        *first = Some(Rigid::IDENTITY);
    }
    loop {
        let mut best: Option<(usize, usize, Pair)> = None;
        for (a, row) in pairs.iter().enumerate().filter(|(a, _)| places[*a].is_some()) {
            for (b, pair) in row.iter().enumerate().filter(|(b, _)| places[*b].is_none()) {
                if let Some(pair) = pair
                    && best.as_ref().is_none_or(|(_, _, best)| pair.support > best.support)
                {
                    best = Some((a, b, *pair));
                }
            }
        }
        let Some((a, b, pair)) = best else { return places };
        places[b] = places[a].map(|place: Rigid| pair.pose.after(&place));
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::rotation::rotation_from_axis_angle;
    use glam::DVec3;

    use super::*;

    fn pose(turn: [f64; 3], shift: [f64; 3]) -> Rigid {
        Rigid { rotation: rotation_from_axis_angle(DVec3::from(turn)), translation: DVec3::from(shift) }
    }

    #[test]
    fn a_pair_is_found_among_boards_that_look_alike_and_wrong_ones() {
        let truth = pose([0.1, 0.9, -0.2], [0.4, 0.05, 0.1]);
        let half = pose([0.0, 0.0, std::f64::consts::PI], [0.24, 0.18, 0.0]);
        let moments: Vec<(Rigid, Alike)> = (0..20)
            .map(|k| {
                let k = f64::from(k);
                let first = pose([0.3 * k.sin(), 0.4 * k.cos(), 0.1 * k], [0.05 * k.cos(), 0.03 * k.sin(), 0.6]);
                let mut second = truth.after(&first);
                // One in five is wrong.
                if k as u32 % 5 == 2 {
                    second.translation.x += 0.2;
                }
                let alike = vec![second.after(&half), second];
                (first, alike)
            })
            .collect();
        let found = pair(&moments).unwrap();
        assert!(difference(&found.pose, &truth) < 1e-9 && found.support == 16, "{found:?}");
        assert!(pair(&[]).is_none());
    }

    #[test]
    fn cameras_are_placed_along_a_chain_and_separate_ones_are_told() {
        let [a, b] = [pose([0.0, 0.5, 0.0], [0.3, 0.0, 0.0]), pose([0.0, 0.4, 0.1], [0.2, 0.1, 0.0])];
        let mut pairs = vec![vec![None; 4]; 4];
        pairs[0][1] = Some(Pair { pose: a, support: 5 });
        pairs[1][2] = Some(Pair { pose: b, support: 3 });
        let found = places(&pairs);
        assert!(difference(&found[2].unwrap(), &b.after(&a)) < 1e-12);
        assert!(found[3].is_none() && found[0] == Some(Rigid::IDENTITY));
    }
}
