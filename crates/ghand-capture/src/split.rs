//! Named selections of a capture's images.

/// One image of a split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SplitView {
    /// Index of the frame in [`Split::frames`].
    pub position: usize,
    /// The frame, an index into the frames of the capture.
    pub frame: usize,
    /// The camera, an index into the cameras of the capture.
    pub camera: usize,
}

/// A named selection of images: pairs of cameras and frames, not always all pairs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Split {
    /// Indices into the cameras of the capture.
    pub cameras: Vec<usize>,
    /// Indices into the frames of the capture.
    pub frames: Vec<usize>,
    /// The images, frames outermost, each once.
    pub views: Vec<SplitView>,
}

impl Split {
    /// Every camera with every frame.
    pub fn product(cameras: Vec<usize>, frames: Vec<usize>) -> Split {
        let of_frame = |(position, &frame)| cameras.iter().map(move |&camera| SplitView { position, frame, camera });
        let views = frames.iter().enumerate().flat_map(of_frame).collect();
        Split { cameras, frames, views }
    }

    /// The given pairs of camera and frame, in ascending order of frame and camera.
    pub fn of_pairs(pairs: impl IntoIterator<Item = (usize, usize)>) -> Split {
        let mut views: Vec<SplitView> =
            pairs.into_iter().map(|(camera, frame)| SplitView { position: 0, frame, camera }).collect();
        views.sort_unstable_by_key(|v| (v.frame, v.camera));
        views.dedup();
        let mut cameras: Vec<usize> = views.iter().map(|v| v.camera).collect();
        cameras.sort_unstable();
        cameras.dedup();
        let mut frames: Vec<usize> = vec![];
        for view in &mut views {
            if frames.last() != Some(&view.frame) {
                frames.push(view.frame);
            }
            view.position = frames.len() - 1;
        }
        Split { cameras, frames, views }
    }

    /// The same selection without the images that `keep` rejects, and without cameras and frames that have no images
    /// left.
    pub fn filtered(&self, keep: impl Fn(&SplitView) -> bool) -> Split {
        Split::of_pairs(self.views.iter().filter(|v| keep(v)).map(|v| (v.camera, v.frame)))
    }

    /// Every `stride`-th image, beginning with the first.
    pub fn every(&self, stride: usize) -> Split {
        Split::of_pairs(self.views.iter().step_by(stride.max(1)).map(|v| (v.camera, v.frame)))
    }

    /// Whether every camera has every frame.
    pub fn is_product(&self) -> bool {
        self.views.len() == self.cameras.len() * self.frames.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_contain_every_pair_frames_outermost() {
        let split = Split::product(vec![4, 2], vec![7, 9]);
        let pairs: Vec<_> = split.views.iter().map(|v| (v.position, v.frame, v.camera)).collect();
        assert_eq!(pairs, [(0, 7, 4), (0, 7, 2), (1, 9, 4), (1, 9, 2)]);
        assert!(split.is_product());
        assert!(Split::product(vec![1], vec![]).is_product());
    }

    #[test]
    fn cameras_and_frames_without_images_are_dropped() {
        let split = Split::product(vec![0, 1, 2], vec![5, 6, 7]).filtered(|v| v.frame != 6 && v.camera != 0);
        assert_eq!((split.cameras.as_slice(), split.frames.as_slice()), (&[1, 2][..], &[5, 7][..]));
        assert!(split.views.iter().all(|v| split.frames[v.position] == v.frame));
        assert!(split.is_product());
        let split = split.filtered(|v| (v.frame, v.camera) != (5, 2));
        assert_eq!((split.views.len(), split.is_product()), (3, false));
        assert_eq!(Split::of_pairs([(1, 5), (1, 5)]).views.len(), 1);
    }

    #[test]
    fn a_stride_begins_with_the_first_image() {
        let split = Split::product(vec![0, 1], vec![0, 1, 2]).every(4);
        let pairs: Vec<_> = split.views.iter().map(|v| (v.frame, v.camera)).collect();
        assert_eq!(pairs, [(0, 0), (2, 0)]);
    }
}
