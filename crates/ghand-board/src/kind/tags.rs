//! Tags of Kalibr's AprilGrid: their codes, and where they and the small black squares between them are.

use calib_targets_charuco::{Dictionary, builtins};

use super::length;

/// The only family that Kalibr draws.
const FAMILY: &str = "DICT_APRILTAG_36h11";
/// Black cells around the code of a tag: Kalibr's have two, other AprilTags one.
pub(crate) const BORDER: usize = 2;
/// Least and most tags along an edge. The family has enough for all of them.
const COUNTS: [u32; 2] = [2, 24];
/// The usual gap between tags, relative to their side, and what it may be. In narrower ones corners are not found.
const GAP: f64 = 0.3;
const GAPS: [f64; 2] = [0.1, 1.0];

/// Tags of an AprilGrid. Tag 0 is at the bottom left, tag 1 to the right of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tags {
    /// Between two tags, relative to their side.
    pub gap: f64,
    pub dictionary: Dictionary,
    /// The gap is as usual, not given.
    is_assumed: bool,
}

impl Tags {
    pub(super) fn parse(counts: [u32; 2], side: f64, rest: &[&str]) -> Result<Tags, String> {
        let [least, most] = COUNTS;
        if let Some(count) = counts.into_iter().find(|count| !(least..=most).contains(count)) {
            return Err(format!("{count} tags along an edge are not {least} to {most}"));
        }
        let gap = match rest {
            [] => None,
            // As Kalibr's files have it, or as a length.
            [text] => Some(text.trim().parse().or_else(|_| length(text).map(|gap| gap / side))?),
            [_, text, ..] => return Err(format!("{text:?} is one thing too many")),
        };
        let is_assumed = gap.is_none();
        let gap: f64 = gap.unwrap_or(GAP);
        if !(GAPS[0]..=GAPS[1]).contains(&gap) {
            let [least, most] = GAPS.map(|gap| 100.0 * gap);
            return Err(format!("the gap between tags must be {least:.0}% to {most:.0}% of their side"));
        }
        let dictionary = builtins::builtin_dictionary(FAMILY).ok_or("its family of tags is missing")?;
        Ok(Tags { gap, dictionary, is_assumed })
    }

    /// The gap as text: to a thousandth.
    pub(super) fn rounded_gap(&self) -> String {
        format!("{}", (1e3 * self.gap).round() / 1e3)
    }

    pub(super) fn assumption(&self) -> Option<String> {
        let part = 100.0 * self.gap;
        self.is_assumed
            .then(|| format!("nothing else is told of the board: the gap between its tags is {part:.0}% of their side"))
    }

    /// Length of a row of tags with the small squares at both ends, sides of a tag.
    pub(super) fn extent(&self, count: usize) -> f64 {
        count as f64 + (count + 1) as f64 * self.gap
    }

    /// Where a corner of the tags is along a row, which begins with a small square, sides of a tag.
    pub(super) fn corner(&self, number: usize) -> f64 {
        self.gap + (number / 2) as f64 * (1.0 + self.gap) + (number % 2) as f64
    }

    /// Cells of a tag along its edge.
    pub(crate) fn cells(&self) -> usize {
        self.dictionary.marker_size() + 2 * BORDER
    }

    /// Whether a cell of a tag, from its top left, is black. The dictionary has tags upside down, as OpenCV.
    pub(crate) fn is_black(&self, tag: usize, column: usize, row: usize) -> bool {
        let bits = self.dictionary.marker_size();
        let inner = |cell: usize| cell.checked_sub(BORDER).filter(|cell| *cell < bits);
        let (Some(column), Some(row)) = (inner(column), inner(row)) else { return true };
        let bit = bits * bits - 1 - (row * bits + column);
        self.dictionary.codes().get(tag).is_some_and(|code| (code >> bit) & 1 == 1)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use crate::BoardKind;

    #[test]
    fn corners_are_where_kalibr_has_them_and_tags_are_upright() {
        let kind: BoardKind = "aprilgrid:6x5:88mm:0.3".parse().unwrap();
        assert_eq!((kind.corners(), kind.corner_count()), ([12, 10], 120));
        // As `GridCalibrationTargetAprilgrid::createGridPoints`, whose origin is corner 0, with y up.
        let (side, gap) = (0.088, 0.3);
        for (row, column) in (0..10).flat_map(|row| (0..12).map(move |column| (row, column))) {
            let along = |k: usize| (k / 2) as f64 * (1.0 + gap) * side + (k % 2) as f64 * side;
            let off = kind.corner(12 * row + column) - kind.corner(0);
            assert!(off.distance(DVec3::new(along(column), -along(row), 0.0)) < 1e-12, "{row} {column}: {off}");
        }
        // A small square lies beyond the outermost corners.
        let size = kind.size();
        assert!((size.x - side * (6.0 + 7.0 * gap)).abs() < 1e-12);
        assert!((kind.corner(0) - DVec3::new(side * gap, size.y - side * gap, 0.0)).length() < 1e-12);
        assert_eq!(kind.outermost(), [108, 119, 11, 0]);
        // The first code of tag36h11 as AprilTag's authors write it: from the top left, 1 is white.
        let tags = kind.tags().unwrap();
        let code = (0..36).fold(0u64, |code, k| code << 1 | u64::from(!tags.is_black(0, 2 + k % 6, 2 + k / 6)));
        assert_eq!(code, 0xd5d628584);
        assert!(
            (0..100)
                .all(|k| (2..8).contains(&(k % 10)) && (2..8).contains(&(k / 10)) || tags.is_black(0, k % 10, k / 10))
        );
        assert_eq!(tags.dictionary.codes().len(), 587);
    }
}
