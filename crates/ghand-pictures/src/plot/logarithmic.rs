//! Curves over logarithmic axes, in panels side by side with one vertical axis.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::{COLORS, DataSeries, FAINT, FONT, INK};

/// Curves over one quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct LogPanel {
    /// What it is, with its unit.
    pub axis: String,
    /// The curves; the same names in all panels. Points that are not positive are left out.
    pub series: Vec<DataSeries>,
}

/// Panels with the same vertical axis.
#[derive(Debug, Clone, PartialEq)]
pub struct LogPlot {
    /// Its title.
    pub title: String,
    /// The panels.
    pub panels: Vec<LogPanel>,
}

/// Panels side by side, and the size of one, pixels.
const COLUMNS: usize = 3;
const PANEL: [u32; 2] = [330, 270];
/// Heights of title and legend, pixels.
const TITLE: u32 = 34;
const LEGEND: u32 = 22;

impl LogPlot {
    pub(super) fn size(&self) -> [u32; 2] {
        let rows = self.panels.len().div_ceil(COLUMNS).max(1) as u32;
        let legend = self.names().len() as u32 * LEGEND + 12;
        [COLUMNS as u32 * PANEL[0], TITLE + rows * PANEL[1] + legend]
    }

    fn names(&self) -> Vec<&str> {
        self.panels.first().map_or(vec![], |panel| panel.series.iter().map(|series| series.name.as_str()).collect())
    }

    pub(super) fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), String> {
        let text = |e: &dyn std::fmt::Display| e.to_string();
        area.fill(&WHITE).map_err(|e| text(&e))?;
        let [_, height] = self.size();
        let (title, rest) = area.split_vertically(TITLE);
        let (charts, legend) = rest.split_vertically(height - TITLE - self.names().len() as u32 * LEGEND - 12);
        let style = (FONT, 18).into_font().color(&INK);
        title.draw(&Text::new(self.title.clone(), (14, 10), style)).map_err(|e| text(&e))?;
        let up =
            whole_decades(self.panels.iter().flat_map(|p| p.series.iter().flat_map(|s| s.points.iter().map(|p| p.1))));
        let places = charts.split_evenly((self.panels.len().div_ceil(COLUMNS).max(1), COLUMNS));
        for (panel, place) in self.panels.iter().zip(&places) {
            let across = whole_decades(panel.series.iter().flat_map(|s| s.points.iter().map(|p| p.0)));
            let mut chart = ChartBuilder::on(place)
                .margin(10)
                .x_label_area_size(42)
                .y_label_area_size(52)
                .build_cartesian_2d(across.log_scale(), up.clone().log_scale())
                .map_err(|e| text(&e))?;
            let power = |v: &f64| format!("{v:.0e}");
            chart
                .configure_mesh()
                .light_line_style(TRANSPARENT)
                .bold_line_style(FAINT)
                .axis_style(INK)
                .label_style((FONT, 12).into_font().color(&INK))
                .axis_desc_style((FONT, 13).into_font().color(&INK))
                .x_label_formatter(&power)
                .y_label_formatter(&power)
                .x_labels(5)
                .y_labels(6)
                .x_desc(&panel.axis)
                .draw()
                .map_err(|e| text(&e))?;
            for (series, color) in panel.series.iter().zip(COLORS.into_iter().cycle()) {
                let points = || series.points.iter().copied().filter(|(x, y)| *x > 0.0 && *y > 0.0 && y.is_finite());
                let line = LineSeries::new(points(), color.stroke_width(2));
                chart.draw_series(line).map_err(|e| text(&e))?;
                chart.draw_series(points().map(|p| Circle::new(p, 3, color.filled()))).map_err(|e| text(&e))?;
            }
        }
        for (k, (name, color)) in self.names().into_iter().zip(COLORS.into_iter().cycle()).enumerate() {
            let y = k as i32 * LEGEND as i32 + 8;
            let line = PathElement::new(vec![(20, y + 4), (44, y + 4)], color.stroke_width(2));
            legend.draw(&line).map_err(|e| text(&e))?;
            let style = (FONT, 13).into_font().color(&INK);
            legend.draw(&Text::new(name.to_owned(), (52, y - 3), style)).map_err(|e| text(&e))?;
        }
        Ok(())
    }
}

/// The powers of ten around the positive ones of some values.
fn whole_decades(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let logarithms = values.filter(|v| *v > 0.0 && v.is_finite()).map(f64::log10);
    let (low, high) = logarithms.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return 0.1..10.0;
    }
    let (low, high) = (low.floor(), high.ceil());
    10f64.powf(low)..10f64.powf(if high > low { high } else { low + 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_over_decades_are_drawn_and_what_is_not_positive_is_left_out() {
        let series = |name: &str, scale: f64| DataSeries {
            name: name.into(),
            points: (-3..4)
                .map(|k| (10f64.powi(k), scale * 10f64.powi(k)))
                .chain([(1.0, 0.0), (2.0, f64::NAN)])
                .collect(),
        };
        let panel = |axis: &str| LogPanel { axis: axis.into(), series: vec![series("one", 1.0), series("two", 1e-7)] };
        let plot = LogPlot { title: "Errors".into(), panels: ["a", "b", "c", "d"].map(panel).into() };
        let image = plot.to_image().unwrap();
        assert_eq!([image.width(), image.height()], [990, 34 + 2 * 270 + 56]);
        let svg = plot.to_svg().unwrap();
        assert!(svg.contains("two") && svg.contains("1e-10"), "{svg}");
        LogPlot { title: "none".into(), panels: vec![] }.to_image().unwrap();
        assert_eq!(whole_decades([0.02, 3.0].into_iter()), 0.01..10.0);
        assert_eq!(whole_decades([1.0].into_iter()), 1.0..10.0);
    }
}
