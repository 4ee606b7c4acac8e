//! The order in which a stage takes its views: shuffled passes over all of them.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use ghand_fit::views::TrainViews;

/// Number of steps whose views are decoded ahead, if not all fit into memory.
const PREFETCHED: usize = 16;
/// Multiples of the golden section are spread evenly over the numbers between 0 and 1.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// The order follows from the seed and the weights alone, so that a resumed run need only repeat it.
pub(super) struct ViewOrder<'a> {
    views: &'a TrainViews,
    /// Views of one frame in each step.
    together: usize,
    rng: ChaCha8Rng,
    turns: Turns,
    /// The steps of this pass that are still to come, the next one last.
    order: Vec<Vec<usize>>,
    /// How often each frame has come.
    frames: Vec<u64>,
}

impl<'a> ViewOrder<'a> {
    /// Up to `together` views of a frame come together, each view in a part `weights` of the passes. The first `skipped`
    /// steps are skipped.
    pub fn new(views: &'a TrainViews, weights: Vec<f64>, seed: u64, together: usize, skipped: u64) -> ViewOrder<'a> {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        let order = vec![];
        let mut order = ViewOrder { views, together, rng, turns: Turns::new(weights), order, frames: vec![] };
        for _ in 0..skipped {
            order.next();
        }
        order.prefetch(PREFETCHED);
        order
    }

    /// Indices of the next views, and how often their frame has come, this time included.
    pub fn take(&mut self) -> (Vec<usize>, u64) {
        let is_new = self.order.is_empty();
        let next = self.next();
        self.prefetch(if is_new { PREFETCHED } else { 1 });
        next
    }

    fn next(&mut self) -> (Vec<usize>, u64) {
        if self.order.is_empty() {
            self.order = self.pass();
        }
        let indices = self.order.pop().unwrap_or_default();
        let Some(frame) = indices.first().and_then(|index| self.views.position(*index)) else { return (indices, 0) };
        if self.frames.len() <= frame {
            self.frames.resize(frame + 1, 0);
        }
        self.frames[frame] += 1;
        (indices, self.frames[frame])
    }

    /// The steps of one pass.
    fn pass(&mut self) -> Vec<Vec<usize>> {
        let mut views = self.turns.next_pass();
        views.shuffle(&mut self.rng);
        if self.together == 1 {
            return views.into_iter().map(|view| vec![view]).collect();
        }
        // Which views of a frame come together differs from pass to pass, too.
        views.sort_by_key(|view| self.views.position(*view));
        let same = |a: &usize, b: &usize| self.views.position(*a) == self.views.position(*b);
        let mut steps: Vec<Vec<usize>> =
            views.chunk_by(same).flat_map(|frame| frame.chunks(self.together.max(1))).map(<[usize]>::to_vec).collect();
        steps.shuffle(&mut self.rng);
        steps
    }

    /// Starts decoding the views of the last of the next [`PREFETCHED`] steps, `count` of them.
    fn prefetch(&self, count: usize) {
        let steps = self.order.iter().rev().take(PREFETCHED).collect::<Vec<_>>();
        let first = steps.len().saturating_sub(count);
        steps[first..].iter().copied().flatten().for_each(|view| self.views.prefetch(*view));
    }
}

/// Which views come in a pass.
struct Turns {
    /// In how many of the passes each view comes, more than 0, at most 1.
    weights: Vec<f64>,
    /// What each view has of its next turn: it comes when it has 1.
    earned: Vec<f64>,
}

impl Turns {
    fn new(weights: Vec<f64>) -> Turns {
        // Those that come seldom do not come all at once.
        let earned = (0..weights.len()).map(|k| GOLDEN * k as f64 % 1.0).collect();
        Turns { weights, earned }
    }

    /// Indices of the views of the next pass; none only if there are no views.
    fn next_pass(&mut self) -> Vec<usize> {
        loop {
            self.earned.iter_mut().zip(&self.weights).for_each(|(earned, weight)| *earned += weight);
            let due: Vec<usize> = (0..self.earned.len()).filter(|k| self.earned[*k] >= 1.0).collect();
            due.iter().for_each(|k| self.earned[*k] -= 1.0);
            if !due.is_empty() || self.weights.is_empty() {
                return due;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_come_as_often_as_they_count() {
        let mut turns = Turns::new(vec![1.0, 0.1, 1.0, 0.1, 0.5, 0.1]);
        let mut counts = [0; 6];
        for _ in 0..100 {
            let pass = turns.next_pass();
            // Those that come seldom take turns.
            assert!(pass.iter().filter(|k| [1, 3, 5].contains(*k)).count() <= 1, "{pass:?}");
            pass.into_iter().for_each(|k| counts[k] += 1);
        }
        assert!(
            counts.iter().zip([100, 10, 100, 10, 50, 10]).all(|(n, m): (&i32, i32)| n.abs_diff(m) <= 1),
            "{counts:?}"
        );
        assert_eq!(Turns::new(vec![1.0; 3]).next_pass(), [0, 1, 2]);
        assert_eq!(Turns::new(vec![0.1; 3]).next_pass().len(), 1);
        assert_eq!(Turns::new(vec![]).next_pass(), Vec::<usize>::new());
    }
}
