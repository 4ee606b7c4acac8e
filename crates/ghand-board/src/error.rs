//! Why a board was not understood, or cameras could not be calibrated by it.

/// Why a board was not understood, or cameras could not be calibrated by it, in one sentence.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BoardError {
    /// A board's description.
    #[error(
        "board {text:?}: {problem}; give charuco:8x6:30mm (squares across and down, side of a square), followed by the side of a \
         marker as :22mm if it is not 75% of that, by the dictionary as :5X5_100 if it is not 4X4, and by :legacy if OpenCV \
         before 4.6 made it; or chessboard:9x6:25mm (inner corners across and down, side of a square); or aprilgrid:6x6:24mm \
         (tags across and down, side of a tag), followed by the gap between tags as :0.25 if it is not 30% of their side"
    )]
    Kind {
        /// What was given.
        text: String,
        /// What is wrong.
        problem: String,
    },
    /// An image whose size does not fit its pixels.
    #[error("an image of {width} x {height} pixels has {found} bytes, but needs {needed}; give all of its rows")]
    Image {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes that were given.
        found: usize,
        /// Bytes that such an image has.
        needed: usize,
    },
    /// No image of a camera shows the board.
    #[error(
        "{camera}: none of its {images} images shows the board {kind}; show it whole, flat, near and in good light, or omit \
         --board"
    )]
    NeverSeen {
        /// The camera.
        camera: String,
        /// How many images were searched.
        images: usize,
        /// The board.
        kind: String,
    },
    /// Images show another board.
    #[error("{camera}: shows a board of {found}, not {kind}; give --board as it is printed")]
    OtherBoard {
        /// The camera.
        camera: String,
        /// What was found, in the words of the kind.
        found: String,
        /// The board that was expected.
        kind: String,
    },
    /// Squares are seen, but no markers of the dictionary, or not where they should be.
    #[error(
        "{camera}: shows the squares of the board {kind}, but not its markers; check the dictionary and the order of the two \
         numbers in --board, and add :legacy for a board made with OpenCV before 4.6"
    )]
    OtherMarkers {
        /// The camera.
        camera: String,
        /// The board that was expected.
        kind: String,
    },
    /// Tags are seen, but not where an AprilGrid has them.
    #[error(
        "{camera}: shows a board of at least {} x {} tags, not {kind}; give --board as it is printed, first the tags across with \
         tag 0 at the bottom left", found[0], found[1]
    )]
    OtherTags {
        /// The camera.
        camera: String,
        /// Tags across and down, as their numbers tell.
        found: [usize; 2],
        /// The board that was expected.
        kind: String,
    },
    /// The gaps between tags of an AprilGrid are others.
    #[error(
        "{camera}: the gaps between the board's tags are {found}% of their side, not {said}%, as {kind} has them; measure both \
         and give them in --board"
    )]
    OtherGap {
        /// The camera.
        camera: String,
        /// Percent of the tags' side, as seen.
        found: u32,
        /// The same, as expected.
        said: u32,
        /// The board that was expected.
        kind: String,
    },
    /// Too few images show enough of the board.
    #[error(
        "{camera}: only {views} of its images show the board {kind} well enough, at least {needed} are needed; show it for \
         some seconds, at different distances and tilted to different sides"
    )]
    TooFewViews {
        /// The camera.
        camera: String,
        /// Usable images.
        views: usize,
        /// How many there must be.
        needed: usize,
        /// The board.
        kind: String,
    },
    /// Cameras have no images of the board at the same time.
    #[error(
        "{camera} never sees the board at the same time as {others}; hold it for a moment so that both see it, for each pair \
         of neighbouring cameras"
    )]
    NotTogether {
        /// The camera.
        camera: String,
        /// Those that are connected with the first one.
        others: String,
    },
    /// A clock is not known and the board does not tell it.
    #[error(
        "{camera}: nothing tells its clock: the board moves too little or too differently from how others see it; move it \
         about for some seconds where this camera and another one see it"
    )]
    UnknownClock {
        /// The camera.
        camera: String,
    },
    /// The equations have no solution.
    #[error(
        "{camera}: the board's corners do not fit any camera, with a median error of {error} pixels; check that the board is \
         flat and is {kind}"
    )]
    NoFit {
        /// The camera.
        camera: String,
        /// Rounded.
        error: String,
        /// The board.
        kind: String,
    },
}
