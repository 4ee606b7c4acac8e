//! Means with intervals over the same names, in panels one below the other.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{COLORS, FAINT, FONT, INK, range};

/// One quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// What it is.
    pub title: String,
    /// Mean and both ends of the interval, one for each name of the plot.
    pub values: Vec<[f64; 3]>,
}

/// Panels over one axis of names.
#[derive(Debug, Clone, PartialEq)]
pub struct PanelPlot {
    /// Its title.
    pub title: String,
    /// Names along the axis, such as poses.
    pub names: Vec<String>,
    /// The panels, from top to bottom.
    pub panels: Vec<Panel>,
}

/// Width of the plot, and height of a panel, pixels.
const WIDTH: u32 = 780;
const PANEL: u32 = 92;
/// Most names that fit side by side; of more, only some are written.
const MOST_NAMES: usize = 12;
/// Smallest range of a panel, as a fraction of the largest: what hardly changes should look so.
const LEAST_RANGE: f64 = 0.05;

impl PanelPlot {
    pub(super) fn size(&self) -> [u32; 2] {
        [WIDTH, 102 + PANEL * self.panels.len() as u32]
    }

    pub(super) fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), String> {
        let text = |e: &dyn std::fmt::Display| e.to_string();
        area.fill(&WHITE).map_err(|e| text(&e))?;
        let title = (FONT, 18).into_font().color(&INK);
        let area = area.margin(6, 0, 0, 0).titled(&self.title, title).map_err(|e| text(&e))?;
        let (above, below) = area.split_vertically(PANEL * self.panels.len() as u32 + 10);
        let ranges = || self.panels.iter().map(|panel| range(panel.values.iter().flatten().copied()));
        let least = LEAST_RANGE * ranges().map(|range| range.end - range.start).fold(0.0, f64::max);
        let right = self.names.len() as f64 - 0.5;
        for ((panel, range), (area, color)) in self
            .panels
            .iter()
            .zip(ranges())
            .zip(above.split_evenly((self.panels.len().max(1), 1)).iter().zip(COLORS.iter().cycle()))
        {
            let room = (0.5 * (least - range.end + range.start)).max(0.0);
            let mut chart = ChartBuilder::on(area)
                .margin_top(10)
                .margin_right(20)
                .margin_left(80)
                .y_label_area_size(60)
                .build_cartesian_2d(-0.5..right, range.start - room..range.end + room)
                .map_err(|e| text(&e))?;
            chart
                .configure_mesh()
                .disable_x_mesh()
                .x_labels(0)
                .y_labels(4)
                .y_label_formatter(&|value| tick(*value))
                .light_line_style(TRANSPARENT)
                .bold_line_style(FAINT)
                .axis_style(INK)
                .label_style((FONT, 12).into_font().color(&INK))
                .draw()
                .map_err(|e| text(&e))?;
            let middle = 0.5 * (range.start + range.end);
            let label = (FONT, 14).into_font().color(&INK).pos(Pos::new(HPos::Right, VPos::Center));
            let name = EmptyElement::at((-0.5, middle)) + Text::new(panel.title.clone(), (-62, 0), label);
            chart.draw_series([name]).map_err(|e| text(&e))?;
            let means = panel.values.iter().enumerate().map(|(k, value)| (k as f64, value[0]));
            let line = LineSeries::new(means.clone(), color.mix(0.4).stroke_width(1));
            chart.draw_series(line).map_err(|e| text(&e))?;
            for (k, [_, low, high]) in panel.values.iter().enumerate() {
                let bar = PathElement::new(vec![(k as f64, *low), (k as f64, *high)], color.stroke_width(2));
                chart.draw_series([bar]).map_err(|e| text(&e))?;
            }
            chart.draw_series(means.map(|at| Circle::new(at, 4, color.filled()))).map_err(|e| text(&e))?;
        }
        // The names, below the last panel: at the same places as its points.
        let names = ChartBuilder::on(&below)
            .margin_right(20)
            .margin_left(140)
            .build_cartesian_2d(-0.5..right, 0.0..1.0)
            .map_err(|e| text(&e))?;
        let every = self.names.len().div_ceil(MOST_NAMES).max(1);
        for (k, name) in self.names.iter().enumerate().step_by(every) {
            let label = (FONT, 13).into_font().color(&INK).pos(Pos::new(HPos::Center, VPos::Top));
            let place = EmptyElement::at((k as f64, 1.0)) + Text::new(name.clone(), (0, 4), label);
            names.plotting_area().draw(&place).map_err(|e| text(&e))?;
        }
        Ok(())
    }
}

/// A number on an axis, without a minus before zero.
fn tick(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_have_their_titles_and_names() {
        let panel =
            |title: &str, value: f64| Panel { title: title.into(), values: vec![[value, value - 0.1, value + 0.2]; 3] };
        let names = ["rest", "fist", "ok"].map(String::from).to_vec();
        let plot = PanelPlot { title: "A plot".into(), names, panels: vec![panel("one", 1.0), panel("two", f64::NAN)] };
        let image = plot.to_image().unwrap();
        assert_eq!([image.width(), image.height()], plot.size());
        let svg = plot.to_svg().unwrap();
        assert!(["A plot", "fist", "one", "two"].iter().all(|text| svg.contains(text)));
    }

    #[test]
    fn ticks_are_short() {
        assert_eq!([0.0, -1e-17, 0.15000000000000002, -0.05, 1200.0].map(tick), ["0", "0", "0.15", "-0.05", "1200"]);
    }

    #[test]
    fn a_plot_without_panels_or_names_is_drawn() {
        let plot = PanelPlot { title: "none".into(), names: vec![], panels: vec![] };
        let image = plot.to_image().unwrap();
        assert_eq!([image.width(), image.height()], plot.size());
        assert!(plot.to_svg().unwrap().contains("none"));
    }
}
