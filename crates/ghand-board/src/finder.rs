//! Finds a board's corners in images.

mod april_grid;
mod charuco;
mod chessboard;
mod quads;

use calib_targets_chessboard::{DetectorConfig, GrayImageView, default_chess_config};
use chess_corners::ImageRefiner;
use glam::DVec2;
use nalgebra::Point2;

use crate::{BoardError, BoardKind, SeenCorner};
use april_grid::AprilGridFinder;
use charuco::CharucoFinder;
use chessboard::ChessboardFinder;

/// Narrower images show no board, and the detector refuses some of them, pixels.
const LEAST_EDGE: u32 = 32;

/// What an image shows.
#[derive(Debug, Clone, PartialEq)]
pub enum Sight {
    /// Corners of the board, ascending numbers.
    Board(Vec<SeenCorner>),
    /// Squares with so many inner corners across and down that are not known to be the board's: another board, a part of
    /// one, or one without its markers. If the board is an AprilGrid, at least so many corners of tags.
    Other([usize; 2]),
    /// No squares, or no tags.
    Nothing,
}

/// Finds a board in images.
pub struct BoardFinder {
    finder: Finder,
}

enum Finder {
    Charuco(Box<CharucoFinder>),
    Chessboard(ChessboardFinder),
    AprilGrid(AprilGridFinder),
}

impl BoardFinder {
    /// A finder for a board.
    ///
    /// # Errors
    /// [`BoardError::Kind`] if there cannot be such a board.
    pub fn new(kind: &BoardKind) -> Result<BoardFinder, BoardError> {
        let finder = match (kind.markers(), kind.tags()) {
            (Some(markers), _) => Finder::Charuco(Box::new(CharucoFinder::new(kind, markers)?)),
            (None, Some(tags)) => Finder::AprilGrid(AprilGridFinder::new(kind, tags)),
            (None, None) => Finder::Chessboard(ChessboardFinder::new(kind)),
        };
        Ok(BoardFinder { finder })
    }

    /// Looks for the board in an image: brightness, row by row.
    ///
    /// # Errors
    /// [`BoardError::Image`] if the bytes are not an image of that size.
    pub fn find(&self, gray: &[u8], width: u32, height: u32) -> Result<Sight, BoardError> {
        let needed = width as usize * height as usize;
        if gray.len() != needed || needed == 0 {
            return Err(BoardError::Image { width, height, found: gray.len(), needed: needed.max(1) });
        }
        if width.min(height) < LEAST_EDGE {
            return Ok(Sight::Nothing);
        }
        let image = GrayImageView { width: width as usize, height: height as usize, data: gray };
        Ok(match &self.finder {
            Finder::Charuco(finder) => finder.find(&image),
            Finder::Chessboard(finder) => finder.find(&image),
            Finder::AprilGrid(finder) => finder.find(&image),
        })
    }

    /// The same in an image of red, green and blue, row by row.
    ///
    /// # Errors
    /// As of [`Self::find`].
    pub fn find_in_rgb(&self, rgb: &[u8], width: u32, height: u32) -> Result<Sight, BoardError> {
        let needed = 3 * width as usize * height as usize;
        if rgb.len() != needed {
            return Err(BoardError::Image { width, height, found: rgb.len(), needed });
        }
        // The parts of brightness, of 256.
        let brightness =
            |[r, g, b]: &[u8; 3]| ((77 * u32::from(*r) + 150 * u32::from(*g) + 29 * u32::from(*b)) >> 8) as u8;
        let gray: Vec<u8> = rgb.as_chunks::<3>().0.iter().map(brightness).collect();
        self.find(&gray, width, height)
    }
}

/// How corners of squares are found: to 0.04 pixels where they are sharp, against 0.2 without the refiner.
fn corner_search() -> DetectorConfig {
    default_chess_config().with_refiner(ImageRefiner::saddle_point())
}

/// The detector has the middle of the first pixel at (0, 0).
fn pixel(position: Point2<f32>) -> DVec2 {
    DVec2::new(f64::from(position.x), f64::from(position.y)) + 0.5
}
