//! The order in which a stage takes its views: shuffled passes over all of them.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::views::TrainViews;

/// Number of steps whose views are decoded ahead, if not all fit into memory.
const PREFETCHED: usize = 16;

/// The order follows from the seed alone, so that a run which goes on need only repeat it.
pub(super) struct ViewOrder<'a> {
    views: &'a TrainViews,
    /// Views of one frame in each step.
    together: usize,
    rng: ChaCha8Rng,
    /// The steps of this pass that are still to come, the next one last.
    order: Vec<Vec<usize>>,
    /// How often each frame has come.
    frames: Vec<u64>,
}

impl<'a> ViewOrder<'a> {
    /// Up to `together` views of a frame come together. The first `skipped` steps are left out.
    pub fn new(views: &'a TrainViews, seed: u64, together: usize, skipped: u64) -> ViewOrder<'a> {
        let (rng, order) = (ChaCha8Rng::seed_from_u64(seed), vec![]);
        let mut order = ViewOrder { views, together, rng, order, frames: vec![] };
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
        let mut views: Vec<usize> = (0..self.views.len()).collect();
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
