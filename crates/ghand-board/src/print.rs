//! Boards for printing, in their true size.

use std::fmt::Write;

use glam::DVec2;

use crate::BoardKind;
use crate::picture::{MARGIN, is_black};

/// Cells along a square's edge: borders of markers of the usual sizes lie on them.
const CELLS: usize = 48;

/// A drawing (SVG) with a white margin; lengths are millimetres, so that it is printed in its true size at 100 %.
pub fn board_svg(kind: &BoardKind) -> String {
    let side = 1e3 * kind.side();
    let size = 1e3 * kind.size() + 2.0 * MARGIN * side;
    let [width, height] = size.to_array();
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.3}mm\" height=\"{height:.3}mm\" viewBox=\"0 0 {width:.3} {height:.3}\" shape-rendering=\"crispEdges\">\n<title>{kind}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n<path fill=\"#000\" d=\""
    );
    let cell = side / CELLS as f64;
    let [columns, rows] = kind.squares().map(|count| count * CELLS);
    let black = |x: usize, y: usize| is_black(kind, 1e-3 * cell * (DVec2::new(x as f64, y as f64) + 0.5));
    for y in 0..rows {
        let mut x = 0;
        while x < columns {
            let start = x;
            while x < columns && black(x, y) {
                x += 1;
            }
            if x > start {
                let [left, top] = [start, y].map(|place| MARGIN * side + place as f64 * cell);
                let run = (x - start) as f64 * cell;
                // Writing to a text cannot fail.
                let _ = write!(svg, "M{left:.4} {top:.4}h{run:.4}v{cell:.4}h-{run:.4}z");
            }
            x += 1;
        }
    }
    svg.push_str("\"/>\n</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_is_drawn_in_its_true_size() {
        let kind: BoardKind = "charuco:8x6:30mm".parse().unwrap();
        let svg = board_svg(&kind);
        assert!(svg.contains("width=\"300.000mm\" height=\"240.000mm\""), "{}", &svg[..200]);
        // As much black as the board has.
        let area: f64 = svg.split("h-").skip(1).map(|run| run.split('z').next().unwrap().parse::<f64>().unwrap()).sum();
        let count = 480 * 360;
        let place = |k: usize| DVec2::new((k % 480) as f64 + 0.5, (k / 480) as f64 + 0.5) * 0.0005;
        let black = (0..count).filter(|k| is_black(&kind, place(*k))).count() as f64 / count as f64;
        let drawn = area * 30.0 / CELLS as f64 / (240.0 * 180.0);
        assert!((drawn - black).abs() < 0.01, "{drawn} {black}");
    }
}
