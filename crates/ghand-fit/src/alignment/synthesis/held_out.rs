//! What of a frame's images is not used to refine its pose, but to judge the result.

use std::collections::BTreeMap;

use ghand_render::splat::Image;

use super::IMAGES;
use crate::views::TrainView;

/// At most so many images of a frame are used, and at least, if there are as many.
const MOST_USED: usize = 10;
const LEAST_USED: usize = 4;
/// One in so many images of a frame is held out, but no more than some; of a frame with too few images, one in so many
/// blocks of each.
const HELD_OUT: usize = 4;
const MOST_HELD_OUT: usize = 3;
/// A frame with fewer images holds out blocks.
const LEAST_IMAGES: usize = 3;
/// Side of a block, pixels of the image as it was taken.
const BLOCK: usize = 20;
/// Larger differences count as this, display values.
const BOUND: f64 = 0.15;

/// What the images of a frame are for; indices of views.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Roles {
    /// They refine the pose.
    pub used: Vec<usize>,
    /// They judge it; empty if blocks of the others do.
    held_out: Vec<usize>,
}

impl Roles {
    /// Of each of so many frames; `of_image` has the frame of each image.
    pub fn of_frames(of_image: &[usize], frames: usize) -> Vec<Roles> {
        let mut by_frame: Vec<Vec<usize>> = vec![vec![]; frames];
        for (image, frame) in of_image.iter().enumerate() {
            if let Some(own) = by_frame.get_mut(*frame) {
                own.push(image);
            }
        }
        let most = (IMAGES / frames.max(1)).clamp(LEAST_USED, MOST_USED);
        by_frame.iter().enumerate().map(|(frame, images)| Roles::of(images, frame, most)).collect()
    }

    /// Others are held out from frame to frame. Both are spread over the images, neighbours of which are often taken from
    /// nearby.
    fn of(images: &[usize], frame: usize, most: usize) -> Roles {
        let count = images.len();
        if count < LEAST_IMAGES {
            return Roles { used: images.to_vec(), held_out: vec![] };
        }
        let judges = (count / HELD_OUT).clamp(1, MOST_HELD_OUT);
        let held: Vec<usize> = (0..judges).map(|k| (k * count / judges + frame) % count).collect();
        let rest: Vec<usize> = (0..count).filter(|k| !held.contains(k)).collect();
        let taken = rest.len().min(most);
        let used = (0..taken).map(|k| images[rest[(k * rest.len() / taken + frame) % rest.len()]]).collect();
        Roles { used, held_out: held.iter().map(|k| images[*k]).collect() }
    }

    /// The images that judge the pose.
    pub fn judges(&self) -> &[usize] {
        if self.held_out.is_empty() { &self.used } else { &self.held_out }
    }

    /// Whether a pixel of an image at a fraction of its resolution takes no part in the refinement, but judges it.
    pub fn is_held_out(&self, image: usize, pixel: [usize; 2], reduction: u32) -> bool {
        if !self.held_out.is_empty() {
            return self.held_out.contains(&image);
        }
        let [x, y] = block(pixel, reduction);
        (x + 2 * y + image).is_multiple_of(HELD_OUT)
    }
}

fn block(pixel: [usize; 2], reduction: u32) -> [usize; 2] {
    pixel.map(|at| at * reduction as usize / BLOCK)
}

/// How far images are from the avatar in two poses.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Comparison {
    /// Number of values.
    count: usize,
    /// Sums of absolute differences with bounded influence of outliers.
    sums: [f64; 2],
    /// By image and block, how much larger the second sum is: the pixels of a block err alike.
    increases: BTreeMap<[usize; 3], f64>,
}

impl Comparison {
    /// Adds the pixels of an image, number `place` of the frame, that count.
    pub fn add(
        &mut self,
        place: usize,
        view: &TrainView,
        drawn: [&Image; 2],
        reduction: u32,
        counts: impl Fn([usize; 2]) -> bool,
    ) {
        let columns = (view.size[0] as usize).max(1);
        for (at, shown) in view.pixels.iter().enumerate() {
            let pixel = [at % columns, at / columns];
            if !counts(pixel) {
                continue;
            }
            let off = drawn.map(|image| {
                let off = |k: usize| (f64::from(image.rgba[at][k]) - f64::from(shown[k]) / 255.0).abs();
                ((off(0) + off(1) + off(2)) / 3.0).min(BOUND)
            });
            self.count += 1;
            self.sums = [0, 1].map(|k| self.sums[k] + off[k]);
            let [x, y] = block(pixel, reduction);
            *self.increases.entry([place, x, y]).or_default() += off[1] - off[0];
        }
    }

    /// How much larger the sum is in the second pose.
    pub fn increase(&self) -> f64 {
        self.sums[1] - self.sums[0]
    }

    /// Whether it is larger by more than two standard errors.
    pub fn is_worse(&self) -> bool {
        let variance: f64 = self.increases.values().map(|increase| increase.powi(2)).sum();
        self.increase() > 2.0 * variance.sqrt()
    }

    /// The mean difference over some frames, in the first or the second pose.
    pub fn mean(all: &[&Comparison], which: usize) -> f64 {
        let count: usize = all.iter().map(|one| one.count).sum();
        all.iter().map(|one| one.sums[which]).sum::<f64>() / count.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_refine_or_judge_but_never_both() {
        for count in [3, 4, 5, 8, 16, 20, 60] {
            let images: Vec<usize> = (100..100 + count).collect();
            let mut judged_by = std::collections::BTreeSet::new();
            for frame in 0..count {
                let roles = Roles::of(&images, frame, 10);
                assert!(!roles.used.is_empty() && !roles.judges().is_empty());
                assert!(roles.used.iter().all(|image| !roles.judges().contains(image)), "{count}: {roles:?}");
                let different: std::collections::BTreeSet<&usize> = roles.used.iter().collect();
                assert_eq!(different.len(), roles.used.len());
                assert!(roles.used.len() == 10 || roles.used.len() + roles.judges().len() == count);
                assert!(
                    !roles.is_held_out(roles.used[0], [3, 4], 1) && roles.is_held_out(roles.judges()[0], [3, 4], 1)
                );
                judged_by.extend(roles.judges().to_vec());
            }
            assert_eq!(judged_by.len(), count, "each image judges in some frame");
        }
    }

    #[test]
    fn single_images_hold_out_blocks() {
        let roles = Roles::of(&[7, 8], 0, 10);
        assert_eq!(roles.judges(), roles.used);
        let held = |image: usize, reduction: u32| {
            let size = 400 / reduction as usize;
            let pixels = (0..size * size).filter(|i| roles.is_held_out(image, [i % size, i / size], reduction));
            pixels.count() as f64 / (size * size) as f64
        };
        for part in [held(7, 1), held(8, 1), held(7, 2)] {
            assert!((part - 0.25).abs() < 0.01, "{part}");
        }
    }

    #[test]
    fn a_frame_is_worse_only_if_many_blocks_agree() {
        let size = [200, 200];
        let camera = ghand_core::Camera::look_at(glam::DVec3::Z, glam::DVec3::ZERO, glam::DVec3::Y, 1.0, 200, 200);
        let view = TrainView { camera_index: 0, frame: 0, camera, size, pixels: vec![[100; 4]; 40_000] };
        let image = |off: &dyn Fn(usize) -> f32| Image {
            width: 200,
            height: 200,
            rgba: (0..40_000).map(|i| [100.0 / 255.0 + off(i); 4]).collect(),
        };
        let compared = |after: &dyn Fn(usize) -> f32| {
            let mut comparison = Comparison::default();
            comparison.add(0, &view, [&image(&|_| 0.01), &image(after)], 1, |_| true);
            comparison
        };
        let everywhere = compared(&|_| 0.02);
        assert!(everywhere.is_worse() && (everywhere.increase() / 40_000.0 - 0.01).abs() < 1e-6);
        // One block far off, all others as before.
        let single = compared(&|i| if i % 200 < 20 && i / 200 < 20 { 1.0 } else { 0.01 });
        assert!(single.increase() > 0.0 && !single.is_worse());
        assert!(!compared(&|_| 0.0).is_worse());
        assert!((Comparison::mean(&[&everywhere, &single], 0) - 0.01).abs() < 1e-6);
    }
}
