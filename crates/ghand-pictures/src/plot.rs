//! Plots: curves over a run, means with intervals, points over two axes, and panels of curves; and text in pictures.

mod label;
mod panels;
mod scatter;

use std::sync::OnceLock;

use epaint_default_fonts::UBUNTU_LIGHT;
use image::RgbImage;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, register_font};

pub use label::{label, label_width};
pub use panels::{Panel, PanelPlot};
pub use scatter::{Point, ScatterPlot};

/// A curve.
#[derive(Debug, Clone, PartialEq)]
pub struct DataSeries {
    /// Its name in the legend.
    pub name: String,
    /// Its points, in order.
    pub points: Vec<(f64, f64)>,
}

/// Curves over an axis that begins at 0.
#[derive(Debug, Clone, PartialEq)]
pub struct LinePlot {
    /// Its title.
    pub title: String,
    /// What the axes are, with units: below, at the left.
    pub axes: [String; 2],
    /// The curves.
    pub series: Vec<DataSeries>,
}

/// Means with intervals, one below the other.
#[derive(Debug, Clone, PartialEq)]
pub struct IntervalPlot {
    /// Its title.
    pub title: String,
    /// What is measured, with its unit.
    pub axis: String,
    /// Name, and mean with both ends of its interval.
    pub rows: Vec<(String, [f64; 3])>,
}

/// Why a plot could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the plot `{title}` could not be drawn: {problem}")]
pub struct PlotError {
    title: String,
    problem: String,
}

/// Width and height of plots, pixels.
pub const SIZE: [u32; 2] = [760, 380];
/// Height of a row of an interval plot, pixels.
const ROW: u32 = 30;
/// Least width of the names of an interval plot, pixels.
const NAMES: u32 = 170;
/// Colours that people tell apart whatever their colour vision (Okabe and Ito).
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];
const INK: RGBColor = RGBColor(45, 45, 50);
const FAINT: RGBColor = RGBColor(222, 222, 226);
const FONT: &str = "sans-serif";

/// The font has to be known once.
fn ensure_font() {
    static KNOWN: OnceLock<bool> = OnceLock::new();
    KNOWN.get_or_init(|| register_font(FONT, FontStyle::Normal, UBUNTU_LIGHT).is_ok());
}

/// Draws with `draw` to pixels.
fn pixels(
    size: [u32; 2],
    title: &str,
    draw: impl Fn(&DrawingArea<BitMapBackend<'_>, Shift>) -> Result<(), String>,
) -> Result<RgbImage, PlotError> {
    ensure_font();
    let error = |problem: String| PlotError { title: title.into(), problem };
    let mut buffer = vec![255; 3 * size[0] as usize * size[1] as usize];
    {
        let area = BitMapBackend::with_buffer(&mut buffer, (size[0], size[1])).into_drawing_area();
        draw(&area).map_err(error)?;
        area.present().map_err(|e| error(e.to_string()))?;
    }
    RgbImage::from_raw(size[0], size[1], buffer).ok_or_else(|| error("it is too large".into()))
}

/// Draws with `draw` to SVG.
fn svg(
    size: [u32; 2],
    title: &str,
    draw: impl Fn(&DrawingArea<SVGBackend<'_>, Shift>) -> Result<(), String>,
) -> Result<String, PlotError> {
    ensure_font();
    let error = |problem: String| PlotError { title: title.into(), problem };
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (size[0], size[1])).into_drawing_area();
        draw(&area).map_err(error)?;
        area.present().map_err(|e| error(e.to_string()))?;
    }
    Ok(text)
}

/// The range of values, with some room; of any size if there are none.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)));
    if low > high {
        return 0.0..1.0;
    }
    let room = (0.06 * (high - low)).max(1e-6 * high.abs()).max(1e-9);
    low - room..high + room
}

/// A chart of numbers over numbers.
type Chart<'a, B> = ChartContext<'a, B, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Draws the grid and the axes, with what they are: below, at the left.
fn draw_axes<B: DrawingBackend>(chart: &mut Chart<'_, B>, axes: &[String; 2]) -> Result<(), String> {
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(FAINT)
        .axis_style(INK)
        .label_style((FONT, 13).into_font().color(&INK))
        .axis_desc_style((FONT, 14).into_font().color(&INK))
        .x_label_formatter(&|x| if x.fract() == 0.0 { format!("{x:.0}") } else { format!("{x}") })
        .x_desc(&axes[0])
        .y_desc(&axes[1])
        .draw()
        .map_err(|e| e.to_string())
}

/// Draws the names of what is on a chart.
fn draw_legend<'a, B: DrawingBackend + 'a>(chart: &mut Chart<'a, B>, at: SeriesLabelPosition) -> Result<(), String> {
    chart
        .configure_series_labels()
        .position(at)
        .background_style(WHITE.mix(0.85))
        .border_style(FAINT)
        .label_font((FONT, 13).into_font().color(&INK))
        .draw()
        .map_err(|e| e.to_string())
}

/// Gives plots, which have a size, a title and how they are drawn, their pictures.
macro_rules! pictures {
    ($($plot:ty),*) => {$(
        impl $plot {
            /// As pixels.
            ///
            /// # Errors
            /// [`PlotError`] if it cannot be drawn.
            pub fn to_image(&self) -> Result<RgbImage, PlotError> {
                pixels(self.size(), &self.title, |area| self.draw(area))
            }

            /// As SVG.
            ///
            /// # Errors
            /// [`PlotError`] if it cannot be drawn.
            pub fn to_svg(&self) -> Result<String, PlotError> {
                svg(self.size(), &self.title, |area| self.draw(area))
            }
        }
    )*};
}

pictures!(LinePlot, IntervalPlot, PanelPlot, ScatterPlot);

impl LinePlot {
    fn size(&self) -> [u32; 2] {
        SIZE
    }

    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), String> {
        let text = |e: &dyn std::fmt::Display| e.to_string();
        area.fill(&WHITE).map_err(|e| text(&e))?;
        let points = || self.series.iter().flat_map(|series| &series.points);
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT, 18).into_font().color(&INK))
            .margin(14)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(0.0..range(points().map(|p| p.0)).end, range(points().map(|p| p.1)))
            .map_err(|e| text(&e))?;
        draw_axes(&mut chart, &self.axes)?;
        for (series, color) in self.series.iter().zip(COLORS.into_iter().cycle()) {
            let line = LineSeries::new(series.points.iter().copied(), color.stroke_width(2));
            let legend = move |(x, y): (i32, i32)| PathElement::new(vec![(x, y), (x + 18, y)], color.stroke_width(2));
            chart.draw_series(line).map_err(|e| text(&e))?.label(&series.name).legend(legend);
        }
        if self.series.len() > 1 {
            draw_legend(&mut chart, SeriesLabelPosition::MiddleRight)?;
        }
        Ok(())
    }
}

impl IntervalPlot {
    fn size(&self) -> [u32; 2] {
        [SIZE[0], 110 + ROW * self.rows.len() as u32]
    }

    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), String> {
        let text = |e: &dyn std::fmt::Display| e.to_string();
        area.fill(&WHITE).map_err(|e| text(&e))?;
        let count = self.rows.len() as f64;
        let names =
            self.rows.iter().map(|(name, _)| label_width(13.0, name) + 24).fold(NAMES, u32::max).min(SIZE[0] / 2);
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT, 18).into_font().color(&INK))
            .margin(14)
            .margin_left(names)
            .x_label_area_size(44)
            .build_cartesian_2d(range(self.rows.iter().flat_map(|row| row.1)), count - 0.5..-0.5)
            .map_err(|e| text(&e))?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .y_labels(0)
            .light_line_style(TRANSPARENT)
            .bold_line_style(FAINT)
            .axis_style(INK)
            .label_style((FONT, 13).into_font().color(&INK))
            .axis_desc_style((FONT, 14).into_font().color(&INK))
            .x_desc(&self.axis)
            .draw()
            .map_err(|e| text(&e))?;
        let left = chart.plotting_area().get_x_range().start;
        for (k, (name, [mean, low, high])) in self.rows.iter().enumerate() {
            let y = k as f64;
            let color = COLORS[0];
            let label = (FONT, 13).into_font().color(&INK).pos(Pos::new(HPos::Right, VPos::Center));
            let line = PathElement::new(vec![(*low, y), (*high, y)], color.stroke_width(2));
            chart.draw_series([line]).map_err(|e| text(&e))?;
            chart.draw_series([Circle::new((*mean, y), 4, color.filled())]).map_err(|e| text(&e))?;
            let name = EmptyElement::at((left, y)) + Text::new(name.clone(), (-8, 0), label);
            chart.draw_series([name]).map_err(|e| text(&e))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dark(image: &RgbImage) -> usize {
        image.pixels().filter(|p| p.0.iter().any(|v| *v < 128)).count()
    }

    #[test]
    fn curves_are_drawn_with_their_names() {
        let series = |name: &str, scale: f64| DataSeries {
            name: name.into(),
            points: (0..50).map(|k| (f64::from(k), scale * f64::from(k).sqrt())).collect(),
        };
        let axes = ["iterations".to_owned(), "dB".to_owned()];
        let plot = LinePlot { title: "A run".into(), axes, series: vec![series("one", 1.0), series("two", -1.0)] };
        let image = plot.to_image().unwrap();
        assert_eq!([image.width(), image.height()], SIZE);
        assert!(dark(&image) > 2000);
        let svg = plot.to_svg().unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("two") && svg.contains("iterations"));
    }

    #[test]
    fn plots_without_points_and_with_one_are_drawn() {
        let empty = LinePlot { title: "none".into(), axes: Default::default(), series: vec![] };
        // Its title.
        assert!(dark(&empty.to_image().unwrap()) > 50);
        for value in [0.0, -3.0, f64::NAN] {
            let series = vec![DataSeries { name: "a".into(), points: vec![(1.0, value)] }];
            let svg = LinePlot { series, ..empty.clone() }.to_svg().unwrap();
            assert!(svg.contains("none") && !svg.contains("NaN"), "{svg}");
            let rows = vec![("a".to_owned(), [value; 3])];
            let image = IntervalPlot { title: "a".into(), axis: "dB".into(), rows }.to_image().unwrap();
            assert!(dark(&image) > 50);
        }
    }
}
