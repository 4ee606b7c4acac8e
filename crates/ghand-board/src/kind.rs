//! Which board it is, as text and as places of its corners.

mod tags;

use std::fmt::{self, Display};
use std::str::FromStr;

use calib_targets_charuco::{Dictionary, builtins, resolve_dictionary};
use glam::{DVec2, DVec3};

use crate::BoardError;
pub(crate) use tags::{BORDER, Tags};

/// Least and most squares along an edge.
const SQUARES: [u32; 2] = [3, 40];
/// Shortest and longest side of a square, metres.
const SIDES: [f64; 2] = [0.001, 1.0];
/// The usual side of a marker, relative to that of its square, and what it may be.
const MARKER: f64 = 0.75;
const MARKERS: [f64; 2] = [0.3, 0.95];
/// Dictionaries that the usual board may be of: the first one that has enough markers. Each begins with those before it.
const USUAL: [&str; 4] = ["DICT_4X4_50", "DICT_4X4_100", "DICT_4X4_250", "DICT_4X4_1000"];

/// A kind of calibration board.
///
/// As text, `charuco:8x6:30mm` has 8 squares across and 6 down with a side of 30 mm; the side of a marker and the dictionary
/// may follow, as in `charuco:8x6:30mm:22mm:5X5_100`, and `legacy` for the pattern of OpenCV before 4.6, which differs where
/// rows are even. `chessboard:9x6:25mm` has 9 inner corners across and 6 down. Both count
/// as OpenCV does.
///
/// `aprilgrid:6x6:24mm` is Kalibr's AprilGrid with 6 tags across and 6 down, with a side of 24 mm; the gap between tags may
/// follow, relative to their side as in Kalibr's `tagSpacing`, or as a length: `aprilgrid:6x6:24mm:0.3`. Its corners are
/// those of the tags, counted as Kalibr does: from the bottom left to the right, then up.
#[derive(Debug, Clone, Copy)]
pub struct BoardKind {
    /// Corners across and down.
    corners: [u32; 2],
    /// Side of a square, or of a tag, metres.
    side: f64,
    pattern: Pattern,
}

#[derive(Debug, Clone, Copy)]
enum Pattern {
    Chessboard,
    Charuco(Markers),
    AprilGrid(Tags),
}

/// Markers of a ChArUco board.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Markers {
    /// Side of a marker, relative to that of a square.
    pub part: f64,
    pub dictionary: Dictionary,
    /// Whether the square at the bottom left is black, not that at the top left, and markers are in the others.
    pub is_legacy: bool,
    /// Side and dictionary are as usual, not given.
    assumed: [bool; 2],
}

impl BoardKind {
    /// Number of corners across and down: inner ones of squares, or those of tags.
    pub fn corners(&self) -> [usize; 2] {
        self.corners.map(|count| count as usize)
    }

    /// Side of a square, or of a tag, metres.
    pub fn side(&self) -> f64 {
        self.side
    }

    /// Width and height of all that is printed, metres.
    pub fn size(&self) -> DVec2 {
        let sides = match self.pattern {
            Pattern::AprilGrid(tags) => self.tag_counts().map(|count| tags.extent(count)),
            _ => self.squares().map(|count| count as f64),
        };
        DVec2::from_array(sides) * self.side
    }

    /// Number of squares across and down, of a board that has squares.
    pub(crate) fn squares(&self) -> [usize; 2] {
        self.corners().map(|count| count + 1)
    }

    /// Number of tags across and down, of an AprilGrid.
    pub(crate) fn tag_counts(&self) -> [usize; 2] {
        self.corners().map(|count| count / 2)
    }

    pub(crate) fn markers(&self) -> Option<&Markers> {
        if let Pattern::Charuco(markers) = &self.pattern { Some(markers) } else { None }
    }

    pub(crate) fn tags(&self) -> Option<&Tags> {
        if let Pattern::AprilGrid(tags) = &self.pattern { Some(tags) } else { None }
    }

    /// How many corners it has.
    pub fn corner_count(&self) -> usize {
        self.corners().iter().product()
    }

    /// Where a corner is on the board, metres.
    pub fn corner(&self, number: usize) -> DVec3 {
        let [columns, _] = self.corners();
        let (column, row) = (number % columns, number / columns);
        let sides = match self.pattern {
            Pattern::AprilGrid(tags) => {
                let [_, down] = self.tag_counts();
                DVec2::new(tags.corner(column), tags.extent(down) - tags.corner(row))
            }
            _ => DVec2::new((column + 1) as f64, (row + 1) as f64),
        };
        (sides * self.side).extend(0.0)
    }

    /// Numbers of the outermost corners, clockwise from the top left.
    pub(crate) fn outermost(&self) -> [usize; 4] {
        let [columns, rows] = self.corners();
        let [first, last] = [[0, columns - 1], [columns * (rows - 1), columns * rows - 1]];
        let [top, bottom] = if self.tags().is_some() { [last, first] } else { [first, last] };
        [top[0], top[1], bottom[1], bottom[0]]
    }

    /// What was assumed because it was not given, as one sentence.
    pub fn assumption(&self) -> Option<String> {
        let Markers { part, dictionary, assumed, .. } = match self.pattern {
            Pattern::Chessboard => return None,
            Pattern::Charuco(markers) => markers,
            Pattern::AprilGrid(tags) => return tags.assumption(),
        };
        let side = format!("its markers have a side of {}", millimetres(part * self.side));
        let name = format!("its markers are of {}", dictionary.name());
        let what = match assumed {
            [true, true] => format!("{side} and are of {}", dictionary.name()),
            [true, false] => side,
            [false, true] => name,
            [false, false] => return None,
        };
        Some(format!("nothing else is told of the board: {what}"))
    }

    /// Numberings of the corners that look alike: for each, the corner that has the place of corner 0, 1, ... First the one
    /// as it is; others turn the board.
    pub(crate) fn symmetries(&self) -> Vec<Vec<usize>> {
        let mut all = vec![(0..self.corner_count()).collect()];
        if !matches!(self.pattern, Pattern::Chessboard) {
            return all;
        }
        let [columns, rows] = self.corners();
        let turned = |to: &dyn Fn(usize, usize) -> [usize; 2]| -> Vec<usize> {
            let place = |number: usize| {
                let [x, y] = to(number % columns, number / columns);
                y * columns + x
            };
            (0..columns * rows).map(place).collect()
        };
        // Squares at opposite corners have the same colour, and if it is a square of squares, all four.
        if (columns + rows) % 2 == 0 {
            all.push(turned(&|x, y| [columns - 1 - x, rows - 1 - y]));
        }
        if columns == rows && columns % 2 == 0 {
            all.push(turned(&|x, y| [columns - 1 - y, x]));
            all.push(turned(&|x, y| [y, rows - 1 - x]));
        }
        all
    }
}

impl PartialEq for BoardKind {
    fn eq(&self, other: &BoardKind) -> bool {
        self.to_string() == other.to_string()
    }
}

impl Display for BoardKind {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        let side = millimetres(self.side);
        match &self.pattern {
            Pattern::Charuco(Markers { part, dictionary, is_legacy, .. }) => {
                let [across, down] = self.squares();
                let marker = millimetres(part * self.side);
                let name = dictionary.name().trim_start_matches("DICT_");
                write!(formatter, "charuco:{across}x{down}:{side}:{marker}:{name}")?;
                if *is_legacy { formatter.write_str(":legacy") } else { Ok(()) }
            }
            Pattern::AprilGrid(tags) => {
                let [across, down] = self.tag_counts();
                write!(formatter, "aprilgrid:{across}x{down}:{side}:{}", tags.rounded_gap())
            }
            Pattern::Chessboard => write!(formatter, "chessboard:{}x{}:{side}", self.corners[0], self.corners[1]),
        }
    }
}

/// A length as text, to a micrometre.
fn millimetres(length: f64) -> String {
    format!("{}mm", (1e6 * length).round() / 1e3)
}

impl FromStr for BoardKind {
    type Err = BoardError;

    fn from_str(text: &str) -> Result<BoardKind, BoardError> {
        parse(text.trim()).map_err(|problem| BoardError::Kind { text: text.into(), problem })
    }
}

fn parse(text: &str) -> Result<BoardKind, String> {
    let mut parts = text.split(':');
    let name = parts.next().unwrap_or_default().to_ascii_lowercase();
    let counts = parts.next().ok_or("its numbers of squares, corners or tags are missing")?;
    let side = parts.next().ok_or("the side of its squares or tags is missing")?;
    let rest: Vec<&str> = parts.collect();
    let counts: Vec<u32> = counts
        .split(['x', 'X', '×'])
        .map(|count| count.trim().parse())
        .collect::<Result<_, _>>()
        .map_err(|_| format!("{counts:?} must be two numbers, as 8x6"))?;
    let [across, down] = counts[..] else { return Err("it must have two numbers, as 8x6".into()) };
    let side = length(side)?;
    if !(SIDES[0]..=SIDES[1]).contains(&side) {
        return Err(format!("a side of {} is unlikely; check its unit", millimetres(side)));
    }
    let in_range = |squares: [u32; 2]| {
        let [least, most] = SQUARES;
        match squares.into_iter().find(|count| !(least..=most).contains(count)) {
            Some(count) => Err(format!("{count} squares along an edge are not {least} to {most}")),
            None => Ok(squares.map(|count| count - 1)),
        }
    };
    match name.as_str() {
        "charuco" => {
            let corners = in_range([across, down])?;
            let markers = markers([across, down], side, &rest)?;
            Ok(BoardKind { corners, side, pattern: Pattern::Charuco(markers) })
        }
        "chessboard" | "checkerboard" => {
            if !rest.is_empty() {
                return Err("a chessboard has no markers".into());
            }
            let corners = in_range([across.saturating_add(1), down.saturating_add(1)])?;
            Ok(BoardKind { corners, side, pattern: Pattern::Chessboard })
        }
        "aprilgrid" => {
            let tags = Tags::parse([across, down], side, &rest)?;
            Ok(BoardKind { corners: [2 * across, 2 * down], side, pattern: Pattern::AprilGrid(tags) })
        }
        _ => Err(format!("{name:?} is not a kind of board")),
    }
}

fn markers([across, down]: [u32; 2], side: f64, rest: &[&str]) -> Result<Markers, String> {
    let mut part = None;
    let mut dictionary = None;
    let mut is_legacy = false;
    for text in rest {
        if text.trim().eq_ignore_ascii_case("legacy") {
            is_legacy = true;
            continue;
        }
        // Names of dictionaries begin with a number, too, but do not end in a unit.
        match named_dictionary(text.trim()) {
            Some(found) if dictionary.is_none() => dictionary = Some(found),
            None if part.is_none() => part = Some(length(text)? / side),
            _ => return Err(format!("{text:?} is one thing too many")),
        }
    }
    let needed = (across * down / 2) as usize;
    let usual = || USUAL.into_iter().filter_map(resolve_dictionary).find(|usual| usual.codes().len() >= needed);
    let assumed = [part.is_none(), dictionary.is_none()];
    let dictionary = dictionary.or_else(usual).ok_or("it has too many squares")?;
    if dictionary.codes().len() < needed {
        let name = dictionary.name();
        return Err(format!("it has {needed} markers, but {name} has only {}", dictionary.codes().len()));
    }
    let part = part.unwrap_or(MARKER);
    if !(MARKERS[0]..=MARKERS[1]).contains(&part) {
        let [least, most] = MARKERS.map(|part| 100.0 * part);
        return Err(format!("a marker's side must be {least:.0}% to {most:.0}% of that of a square"));
    }
    // Where rows are odd, both patterns are the same.
    Ok(Markers { part, dictionary, is_legacy: is_legacy && down.is_multiple_of(2), assumed })
}

/// A dictionary of OpenCV, with or without `DICT_`.
fn named_dictionary(name: &str) -> Option<Dictionary> {
    let is_it = |known: &&&str| {
        known.eq_ignore_ascii_case(name) || known.trim_start_matches("DICT_").eq_ignore_ascii_case(name)
    };
    builtins::builtin_dictionary(builtins::BUILTIN_DICTIONARY_NAMES.iter().find(is_it)?)
}

/// Metres of a text as `30mm`, `3cm`, `0.03m` or `1.2in`.
fn length(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let units = [("mm", 1e-3), ("cm", 1e-2), ("in", 0.0254), ("m", 1.0)];
    let found = units.into_iter().find_map(|(unit, metres)| Some((text.strip_suffix(unit)?, metres)));
    let (number, metres) = found.ok_or_else(|| format!("{text:?} is not a length with a unit, as 30mm"))?;
    let number: f64 = number.trim().parse().map_err(|_| format!("{text:?} is not a length, as 30mm"))?;
    if number > 0.0 && number.is_finite() { Ok(number * metres) } else { Err(format!("{text:?} must be positive")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind(text: &str) -> BoardKind {
        text.parse().unwrap()
    }

    #[test]
    fn boards_are_read_as_they_are_written_and_say_what_they_assume() {
        let board = kind("charuco:8x6:30mm");
        assert_eq!(board.to_string(), "charuco:8x6:30mm:22.5mm:4X4_50");
        assert_eq!(board.corners(), [7, 5]);
        assert_eq!(board.corner(8), DVec3::new(0.06, 0.06, 0.0));
        let told = board.assumption().unwrap();
        assert!(told.contains("22.5mm") && told.contains("DICT_4X4_50"), "{told}");
        let board = kind("ChArUco:5x7:3.5cm:DICT_5X5_100:24mm");
        assert_eq!(board.to_string(), "charuco:5x7:35mm:24mm:5X5_100");
        assert_eq!(board.assumption(), None);
        assert_eq!(kind(&board.to_string()), board);
        assert_eq!(kind("charuco:5x7:35mm:apriltag_36H11").to_string(), "charuco:5x7:35mm:26.25mm:APRILTAG_36h11");
        let legacy = kind("charuco:8x6:35mm:Legacy");
        assert_eq!(legacy.to_string(), "charuco:8x6:35mm:26.25mm:4X4_50:legacy");
        assert_eq!(kind(&legacy.to_string()), legacy);
        assert_ne!(legacy, kind("charuco:8x6:35mm"));
        assert_eq!(kind("charuco:8x7:35mm:legacy"), kind("charuco:8x7:35mm"));
        // More than 50 markers.
        assert_eq!(kind("charuco:12x9:30mm").to_string(), "charuco:12x9:30mm:22.5mm:4X4_100");
        let chess = kind("chessboard:9x6:1in");
        assert_eq!((chess.to_string().as_str(), chess.squares()), ("chessboard:9x6:25.4mm", [10, 7]));
        assert_ne!(chess, kind("chessboard:6x9:1in"));
        let april = kind("AprilGrid:6x5:88mm");
        assert_eq!(april.to_string(), "aprilgrid:6x5:88mm:0.3");
        assert!(april.assumption().unwrap().contains("30% of their side"));
        assert_eq!(kind("aprilgrid:6x5:88mm:26.4mm"), april);
        assert_eq!((kind("aprilgrid:6x5:88mm:0.3"), kind("aprilgrid:6x5:88mm:0.3").assumption()), (april, None));
        assert_ne!(kind("aprilgrid:6x5:88mm:0.25"), april);
    }

    #[test]
    fn what_is_wrong_with_a_board_is_told_with_its_grammar() {
        for (text, says) in [
            ("", "missing"),
            ("charuco:8x6", "side of its squares"),
            ("charuco:8:30mm", "two numbers"),
            ("charuco:8x6x2:30mm", "two numbers"),
            ("charuco:8x6:30", "unit"),
            ("charuco:8x6:-3mm", "positive"),
            ("charuco:8x6:30m", "unlikely"),
            ("charuco:8x6:30mm:29mm", "marker's side"),
            ("charuco:8x6:30mm:4X4_51", "not a length"),
            ("charuco:8x6:30mm:20mm:20mm", "too many"),
            ("charuco:14x9:30mm:4X4_50", "has only 50"),
            ("charuco:2x6:30mm", "2 squares"),
            ("chessboard:99999999999x6:30mm", "two numbers"),
            ("chessboard:4294967295x6:30mm", "squares along an edge"),
            ("chessboard:9x6:25mm:4X4_50", "no markers"),
            ("dots:9x6:25mm", "not a kind"),
            ("aprilgrid:6x6", "squares or tags is missing"),
            ("aprilgrid:1x6:30mm", "1 tags along an edge"),
            ("aprilgrid:4294967295x6:30mm", "tags along an edge"),
            ("aprilgrid:24x25:30mm", "25 tags along an edge"),
            ("aprilgrid:6x6:30mm:0.01", "gap between tags"),
            ("aprilgrid:6x6:30mm:90mm", "gap between tags"),
            ("aprilgrid:6x6:30mm:NaN", "gap between tags"),
            ("aprilgrid:6x6:30mm:36h11", "length with a unit"),
            ("aprilgrid:6x6:30mm:0.3:0.3", "one thing too many"),
        ] {
            let error = text.parse::<BoardKind>().unwrap_err().to_string();
            assert!(error.contains(says) && error.contains("charuco:8x6:30mm"), "{text}: {error}");
        }
    }

    #[test]
    fn only_chessboards_whose_opposite_corners_are_alike_have_symmetries() {
        let count = |text: &str| kind(text).symmetries().len();
        assert_eq!([count("charuco:8x6:30mm"), count("chessboard:9x6:25mm")], [1, 1]);
        assert_eq!(
            [count("chessboard:8x6:25mm"), count("chessboard:7x7:25mm"), count("chessboard:6x6:25mm")],
            [2, 2, 4]
        );
        for turned in kind("chessboard:6x6:25mm").symmetries() {
            let mut sorted = turned.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..36).collect::<Vec<_>>());
        }
    }
}
