//! The times of the last pictures by stage, and their plot.

use std::collections::VecDeque;

use egui::{Color32, FontId, Grid, Pos2, Rect, RichText, Role, Sense, Stroke, Ui, WidgetInfo, pos2, vec2};
use ghand_pictures::color_scale::round_up;

use crate::viewer::rendering::frame::{Median, STAGES, StageTimes};

/// Colours of the stages, which are told apart with any colour vision (Okabe and Ito).
const COLORS: [Color32; 6] = [
    Color32::from_rgb(230, 159, 0),
    Color32::from_rgb(86, 180, 233),
    Color32::from_rgb(0, 158, 115),
    Color32::from_rgb(240, 228, 66),
    Color32::from_rgb(213, 94, 0),
    Color32::from_rgb(204, 121, 167),
];
/// Pictures in the plot.
const SHOWN: usize = 120;
/// Its heights in milliseconds, as multiples of a power of ten.
const STEPS: [f64; 3] = [1.0, 2.0, 5.0];
/// Height of the plot, points.
const HEIGHT: f32 = 72.0;

/// The times of the last pictures.
#[derive(Debug, Clone, Default)]
pub struct FrameTimes {
    frames: VecDeque<StageTimes>,
}

impl FrameTimes {
    /// Adds the times of a picture.
    pub fn add(&mut self, times: StageTimes) {
        if self.frames.len() == SHOWN {
            self.frames.pop_front();
        }
        self.frames.push_back(times);
    }

    /// Forgets all times.
    pub fn clear(&mut self) {
        self.frames.clear();
    }

    /// Median time of a stage, milliseconds.
    fn median(&self, stage: usize) -> Option<f64> {
        let mut median = Median::default();
        self.frames.iter().filter_map(|times| times.get(stage)).for_each(|time| median.add(*time));
        median.get()
    }

    /// Whether the stages are known.
    fn has_stages(&self) -> bool {
        self.frames.iter().any(|times| times.iter().filter(|time| **time > 0.0).count() > 1)
    }

    /// Shows the plot, and the median of each stage below it.
    pub fn show(&self, ui: &mut Ui) {
        let sums: Vec<f64> = self.frames.iter().map(|times| times.iter().sum()).collect();
        let most = round_up(sums.iter().copied().fold(0.0, f64::max), &STEPS);
        let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT), Sense::hover());
        response.widget_info(|| {
            let text = format!("Times of the last {} pictures, at most {most} milliseconds", sums.len());
            WidgetInfo::labeled(Role::Label, true, text)
        });
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
        let width = rect.width() / SHOWN as f32;
        let y_of = |ms: f64| rect.bottom() - (ms / most) as f32 * (rect.height() - 4.0);
        for (k, times) in self.frames.iter().enumerate() {
            let left = rect.right() - (self.frames.len() - k) as f32 * width;
            let mut below = 0.0;
            for (time, color) in times.iter().zip(COLORS) {
                let bar = Rect::from_min_max(pos2(left, y_of(below + time)), pos2(left + width, y_of(below)));
                painter.rect_filled(bar, 0.0, color);
                below += time;
            }
        }
        let line = |ms: f64| {
            let color = ui.visuals().text_color();
            painter.hline(rect.x_range(), y_of(ms), Stroke::new(0.5, color.gamma_multiply(0.4)));
            let place = Pos2::new(rect.left() + 3.0, y_of(ms));
            painter.text(place, egui::Align2::LEFT_TOP, format!("{ms} ms"), FontId::proportional(10.0), color);
        };
        line(most);
        line(0.5 * most);
        if self.has_stages() {
            self.medians(ui);
        }
    }

    fn medians(&self, ui: &mut Ui) {
        Grid::new("stages").num_columns(3).spacing([10.0, 2.0]).show(ui, |ui| {
            for (stage, (name, color)) in STAGES.into_iter().zip(COLORS).enumerate() {
                let median = self.median(stage).unwrap_or(0.0);
                ui.horizontal(|ui| {
                    let (square, _) = ui.allocate_exact_size(vec2(9.0, 9.0), Sense::hover());
                    ui.painter().rect_filled(square, 1.0, color);
                    ui.label(RichText::new(format!("{name} {median:.2}")).small());
                });
                if stage % 3 == 2 {
                    ui.end_row();
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_times_are_kept_and_each_stage_has_its_median() {
        let mut times = FrameTimes::default();
        assert!(times.median(0).is_none() && !times.has_stages());
        (0..1000).for_each(|k| times.add([f64::from(k), 2.0, 0.0, 0.0, 5.0, 0.0]));
        assert_eq!(times.frames.len(), SHOWN);
        assert_eq!((times.median(1), times.median(4)), (Some(2.0), Some(5.0)));
        assert!(times.median(0).unwrap() > 879.0 && times.has_stages());
        times.clear();
        times.add([0.0, 0.0, 0.0, 0.0, 5.0, 0.0]);
        assert!(!times.has_stages(), "a device without timestamps");
    }

    #[test]
    fn the_axis_ends_at_a_round_number() {
        assert_eq!([0.0, 0.7, 1.0, 3.0, 16.0, 70.0].map(|ms| round_up(ms, &STEPS)), [1.0, 1.0, 1.0, 5.0, 20.0, 100.0]);
    }
}
