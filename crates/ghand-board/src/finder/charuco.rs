//! Finds ChArUco boards, whole or in part.

use calib_targets_charuco::{
    CharucoBoardSpec, CharucoCorner, CharucoDetection, CharucoDetector, CharucoParams, ChessCorner, Dictionary,
};
use calib_targets_chessboard::{ChessboardDetector, GrayImageView, detect_corners};
use chess_corners::UpscaleConfig;

use super::chessboard::extent;
use super::{Sight, corner_search, pixel};
use crate::kind::Markers;
use crate::{BoardError, BoardKind, SeenCorner};

/// Images of fewer pixels are searched again at twice their size: markers may be too near to corners for the detector, which
/// looks five pixels around.
const SMALL: usize = 1_000_000;
/// Unless they have fewer corners of any kind than this.
const LEAST_CORNERS: usize = 12;

pub(super) struct CharucoFinder {
    detector: CharucoDetector,
    /// For what to say if markers are not found.
    squares: ChessboardDetector,
    /// How many numbers the detector's first corner is before the board's.
    first: usize,
}

impl CharucoFinder {
    pub(super) fn new(kind: &BoardKind, markers: &Markers) -> Result<CharucoFinder, BoardError> {
        let [across, down] = kind.squares().map(|count| count as u32);
        // The detector knows the newer pattern only. An older board is one with a row more, which nobody sees, above it.
        let (down, dictionary, first) = match markers.is_legacy {
            true => (down + 1, with_hidden_row(&markers.dictionary, across as usize / 2)?, kind.corners()[0]),
            false => (down, markers.dictionary, 0),
        };
        let spec = CharucoBoardSpec::new(down, across, kind.side() as f32, markers.part as f32, dictionary);
        let mut params = CharucoParams::for_board(spec);
        params.chess = corner_search();
        let unusable = |problem: String| BoardError::Kind { text: kind.to_string(), problem };
        let squares =
            ChessboardDetector::new(params.chessboard.clone()).map_err(|error| unusable(error.to_string()))?;
        let detector = CharucoDetector::new(params).map_err(|error| unusable(error.to_string()))?;
        Ok(CharucoFinder { detector, squares, first })
    }

    pub(super) fn find(&self, image: &GrayImageView) -> Sight {
        let found = self.detector.detect_corners(image);
        if let Some(board) = self.board(image, &found) {
            return board;
        }
        let is_small = image.width * image.height < SMALL && found.len() >= LEAST_CORNERS;
        let nearer = || detect_corners(image, &corner_search().with_upscale(UpscaleConfig::Fixed(2)));
        let again = if is_small { self.board(image, &nearer()) } else { None };
        again.unwrap_or_else(|| self.squares.detect(&found).map_or(Sight::Nothing, |grid| Sight::Other(extent(&grid))))
    }

    fn board(&self, image: &GrayImageView, found: &[ChessCorner]) -> Option<Sight> {
        let CharucoDetection { corners, .. } = self.detector.detect_with_corners(image, found).ok()?;
        let corner = |c: &CharucoCorner| {
            let number = (c.id as usize).checked_sub(self.first)?;
            Some(SeenCorner { number, pixel: pixel(c.position) })
        };
        let mut corners: Vec<SeenCorner> = corners.iter().filter_map(corner).collect();
        corners.sort_by_key(|corner| corner.number);
        corners.dedup_by_key(|corner| corner.number);
        Some(Sight::Board(corners))
    }
}

/// The dictionary with so many markers before its first one, which are its last ones: boards seldom have these.
fn with_hidden_row(dictionary: &Dictionary, count: usize) -> Result<Dictionary, BoardError> {
    let codes = dictionary.codes();
    let hidden = codes.iter().rev().cycle().take(count);
    let codes: Vec<u64> = hidden.chain(codes).copied().collect();
    // Dictionaries live as long as the program; a program searches for one board.
    let codes = codes.leak();
    Dictionary::from_static_codes("legacy", dictionary.marker_size(), dictionary.max_correction_bits(), codes)
        .map_err(|error| BoardError::Kind { text: dictionary.name().into(), problem: error.to_string() })
}
