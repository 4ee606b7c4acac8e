//! Boards for printing, in their true size.

use std::fmt::Write;

use glam::DVec2;

use crate::BoardKind;
use crate::picture::{is_black, margin};

/// Cells along a square's edge: borders of markers of the usual sizes lie on them.
const CELLS: usize = 48;

/// A drawing (SVG) with a white margin; lengths are millimetres, so that it is printed in its true size at 100 %.
pub fn board_svg(kind: &BoardKind) -> String {
    let margin = 1e3 * margin(kind);
    let size = 1e3 * kind.size() + 2.0 * margin;
    let [width, height] = size.to_array();
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.3}mm\" height=\"{height:.3}mm\" viewBox=\"0 0 {width:.3} {height:.3}\" shape-rendering=\"crispEdges\">\n<title>{kind}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n<path fill=\"#000\" d=\""
    );
    let [columns, rows] = edges(kind);
    for row in rows.windows(2) {
        let [top, bottom] = [row[0], row[1]];
        let mut runs: Vec<[f64; 2]> = vec![];
        for column in columns.windows(2) {
            let middle = 0.5 * DVec2::new(column[0] + column[1], top + bottom);
            if !is_black(kind, middle) {
                continue;
            }
            match runs.last_mut() {
                Some(run) if run[1] == column[0] => run[1] = column[1],
                _ => runs.push([column[0], column[1]]),
            }
        }
        for [left, right] in runs {
            let [x, y] = [left, top].map(|place| margin + 1e3 * place);
            let [run, height] = [right - left, bottom - top].map(|length| 1e3 * length);
            // Writing to a text cannot fail.
            let _ = write!(svg, "M{x:.4} {y:.4}h{run:.4}v{height:.4}h-{run:.4}z");
        }
    }
    svg.push_str("\"/>\n</svg>\n");
    svg
}

/// Where columns and rows of cells, within which the colour is the same, begin and end, metres.
fn edges(kind: &BoardKind) -> [Vec<f64>; 2] {
    let side = kind.side();
    match kind.tags() {
        Some(tags) => kind.tag_counts().map(|count| {
            let of_tag = |tag: usize| {
                let start = tags.gap + tag as f64 * (1.0 + tags.gap);
                (0..=tags.cells()).map(move |cell| (start + cell as f64 / tags.cells() as f64) * side)
            };
            let end = (count as f64 * (1.0 + tags.gap) + tags.gap) * side;
            std::iter::once(0.0).chain((0..count).flat_map(of_tag)).chain([end]).collect()
        }),
        None => kind.squares().map(|count| (0..=count * CELLS).map(|k| k as f64 * side / CELLS as f64).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_is_drawn_in_its_true_size() {
        for (text, size) in [("charuco:8x6:30mm", [300.0, 240.0]), ("aprilgrid:3x2:40mm:0.25", [180.0, 130.0])] {
            let kind: BoardKind = text.parse().unwrap();
            let svg = board_svg(&kind);
            let told = format!("width=\"{:.3}mm\" height=\"{:.3}mm\"", size[0], size[1]);
            assert!(svg.contains(&told), "{}", &svg[..200]);
            // Left, top, width, height of what is black.
            let numbers = |path: &str| -> Vec<f64> {
                path.split([' ', 'h', 'v', 'z']).take(4).map(|number| number.parse().unwrap()).collect()
            };
            let path = &svg[svg.find("d=\"").unwrap()..];
            let boxes: Vec<Vec<f64>> = path.split('M').skip(1).map(numbers).collect();
            let is_drawn =
                |x: f64, y: f64| boxes.iter().any(|b| x > b[0] && x < b[0] + b[2] && y > b[1] && y < b[1] + b[3]);
            let mut black = 0;
            // Places that are on no edge of a cell.
            for (x, y) in (0..90)
                .flat_map(|k| (0..80).map(move |l| (1.0237 + 1.871 * f64::from(k), 0.931 + 1.573 * f64::from(l))))
            {
                let is_black = is_black(&kind, 1e-3 * DVec2::new(x, y) - margin(&kind));
                assert_eq!(is_drawn(x, y), is_black, "{text}: {x} {y}");
                black += usize::from(is_black);
            }
            assert!(black > 1500, "{text}: {black}");
        }
    }
}
