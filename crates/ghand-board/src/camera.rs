//! What one camera saw of the board.

use glam::DVec2;

use crate::finder::Sight;

/// A corner of the board in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenCorner {
    /// Its number on the board.
    pub number: usize,
    /// Where it is, pixels as filmed; the middle of the first one is (0.5, 0.5).
    pub pixel: DVec2,
}

/// The board in one image.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardView {
    /// When, by the camera's clock, seconds.
    pub time: f64,
    /// Corners that are seen, ascending numbers.
    pub corners: Vec<SeenCorner>,
}

/// All that one camera saw of the board.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardCamera {
    /// Name of the camera.
    pub id: String,
    /// Columns and rows of its images.
    pub size: [u32; 2],
    /// What to add to the first camera's time to have this one's, seconds, to a frame or so; `None` if that is not known. Of
    /// the first camera it does not matter.
    pub clock: Option<f64>,
    /// Images with the board, by time.
    pub views: Vec<BoardView>,
    /// How many images were searched.
    pub images: usize,
    /// Inner corners across and down of other boards, each with the number of images.
    pub others: Vec<([usize; 2], usize)>,
}

impl BoardCamera {
    /// A camera that has seen nothing yet.
    pub fn new(id: impl Into<String>, size: [u32; 2], clock: Option<f64>) -> BoardCamera {
        BoardCamera { id: id.into(), size, clock, views: vec![], images: 0, others: vec![] }
    }

    /// Adds what was found in the image of a time, seconds.
    pub fn add(&mut self, time: f64, sight: Sight) {
        self.images += 1;
        match sight {
            Sight::Board(corners) => {
                let place = self.views.partition_point(|view| view.time < time);
                self.views.insert(place, BoardView { time, corners });
            }
            Sight::Other(corners) => match self.others.iter_mut().find(|(known, _)| *known == corners) {
                Some((_, count)) => *count += 1,
                None => self.others.push((corners, 1)),
            },
            Sight::Nothing => {}
        }
    }
}
