//! Points with intervals and names, and the line through the best of them.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::label::label_width;
use super::{COLORS, FONT, INK, SIZE, draw_axes, draw_legend, range};

/// A point.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its name, beside it; may be empty.
    pub name: String,
    /// Which of the plot's groups it belongs to.
    pub group: usize,
    /// Across, and upwards.
    pub at: [f64; 2],
    /// Ends of its interval across.
    pub across: [f64; 2],
    /// Whether it is on the line of the best.
    pub best: bool,
}

/// Points over two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct ScatterPlot {
    /// Its title.
    pub title: String,
    /// What the axes are, with units: below, at the left.
    pub axes: [String; 2],
    /// Names of the groups.
    pub groups: Vec<String>,
    /// The points.
    pub points: Vec<Point>,
}

/// Taller than other plots: names need room.
const HEIGHT: u32 = 560;
/// Height of the names, pixels.
const NAME_HEIGHT: i32 = 12;
/// Room at the right for names, as a part of the axis.
const NAMES: f64 = 0.28;

impl ScatterPlot {
    pub(super) fn size(&self) -> [u32; 2] {
        [SIZE[0], HEIGHT]
    }

    pub(super) fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), String> {
        let text = |e: &dyn std::fmt::Display| e.to_string();
        area.fill(&WHITE).map_err(|e| text(&e))?;
        let across = range(self.points.iter().flat_map(|point| point.across));
        let end = across.end + NAMES * across.end;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT, 18).into_font().color(&INK))
            .margin(14)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(0.0..end, range(self.points.iter().map(|point| point.at[1])))
            .map_err(|e| text(&e))?;
        draw_axes(&mut chart, &self.axes)?;
        let mut best: Vec<(f64, f64)> = self.points.iter().filter(|p| p.best).map(|p| (p.at[0], p.at[1])).collect();
        best.sort_by(|a, b| a.0.total_cmp(&b.0));
        chart.draw_series(LineSeries::new(best, INK.mix(0.35).stroke_width(1))).map_err(|e| text(&e))?;
        for (group, name) in self.groups.iter().enumerate() {
            let color = COLORS[group % COLORS.len()];
            let points: Vec<&Point> = self.points.iter().filter(|point| point.group == group).collect();
            let bars = points
                .iter()
                .map(|p| PathElement::new(vec![(p.across[0], p.at[1]), (p.across[1], p.at[1])], color.stroke_width(1)));
            chart.draw_series(bars).map_err(|e| text(&e))?;
            let circles = points.iter().map(|p| {
                let style = if p.best { color.filled() } else { color.stroke_width(1) };
                Circle::new((p.at[0], p.at[1]), 5, style)
            });
            let legend = move |(x, y): (i32, i32)| Circle::new((x + 9, y), 5, color.filled());
            chart.draw_series(circles).map_err(|e| text(&e))?.label(name).legend(legend);
        }
        let (best, others): (Vec<&Point>, Vec<&Point>) = self.points.iter().partition(|point| point.best);
        let named: Vec<&Point> = best.into_iter().chain(others).filter(|point| !point.name.is_empty()).collect();
        let places: Vec<(i32, i32)> = named.iter().map(|p| chart.backend_coord(&(p.at[0], p.at[1]))).collect();
        let widths: Vec<i32> = named.iter().map(|p| label_width(f64::from(NAME_HEIGHT), &p.name) as i32).collect();
        let offsets = without_overlap(&places, &widths);
        let names = named.iter().zip(offsets).filter_map(|(p, offset)| {
            let font = (FONT, NAME_HEIGHT).into_font().color(&INK.mix(if p.best { 1.0 } else { 0.6 }));
            Some(EmptyElement::at((p.at[0], p.at[1])) + Text::new(p.name.clone(), offset?, font))
        });
        chart.draw_series(names).map_err(|e| text(&e))?;
        if self.groups.len() > 1 {
            draw_legend(&mut chart, SeriesLabelPosition::LowerRight)?;
        }
        Ok(())
    }
}

/// Where each name goes, relative to its point, so that none lies on one before it; `None` where there is no room.
fn without_overlap(places: &[(i32, i32)], widths: &[i32]) -> Vec<Option<(i32, i32)>> {
    let mut taken: Vec<[i32; 4]> = vec![];
    let mut offset_of = |((x, y), width): ((i32, i32), i32)| {
        // Right of the point, higher and lower, then left of it.
        let beside = [8, -8 - width].into_iter().flat_map(|dx| [-14, 4, -28, 18, -42, 32].map(|dy| (dx, dy)));
        beside.into_iter().find(|(dx, dy)| {
            let [left, top, right, bottom] = [x + dx, y + dy, x + dx + width, y + dy + NAME_HEIGHT];
            let is_free = taken.iter().all(|[l, t, r, b]| right < *l || *r < left || bottom < *t || *b < top);
            if is_free {
                taken.push([left, top, right, bottom]);
            }
            is_free
        })
    };
    places.iter().copied().zip(widths.iter().copied()).map(&mut offset_of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_points_that_lie_together_do_not_overlap() {
        let places: Vec<(i32, i32)> = (0..20).map(|k| (100 + k % 3, 200 + k % 2)).collect();
        let offsets = without_overlap(&places, &[50; 20]);
        let boxes: Vec<(i32, i32)> =
            places.iter().zip(&offsets).filter_map(|((x, y), o)| o.map(|(dx, dy)| (x + dx, y + dy))).collect();
        assert!(boxes.len() >= 10 && offsets[0] == Some((8, -14)), "{offsets:?}");
        for (i, a) in boxes.iter().enumerate() {
            for b in &boxes[..i] {
                assert!((a.0 - b.0).abs() > 50 || (a.1 - b.1).abs() > NAME_HEIGHT, "{a:?} {b:?}");
            }
        }
        assert_eq!(offsets.last(), Some(&None), "no room is left");
    }

    #[test]
    fn points_are_drawn_with_their_names() {
        let point = |name: &str, x: f64, best: bool| Point {
            name: name.into(),
            group: usize::from(!best),
            at: [x, 30.0 + x.sqrt()],
            across: [0.9 * x, 1.1 * x],
            best,
        };
        let plot = ScatterPlot {
            title: "Trade".into(),
            axes: ["ms".into(), "dB".into()],
            groups: vec!["one".into(), "two".into()],
            points: vec![point("fast", 10.0, true), point("exact", 40.0, true), point("neither", 45.0, false)],
        };
        let image = plot.to_image().unwrap();
        assert!(image.pixels().filter(|p| p.0.iter().any(|v| *v < 128)).count() > 500);
        assert!(plot.to_svg().unwrap().contains("neither"));
        ScatterPlot { points: vec![], ..plot }.to_image().unwrap();
    }
}
