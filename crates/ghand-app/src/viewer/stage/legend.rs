//! Legends over the view: what colours mean, in numbers with a unit.

use egui::{Align2, Area, Color32, FontId, Frame, Id, Mesh, Pos2, Rect, RichText, Role, Sense, Ui, WidgetInfo};
use ghand_pictures::color_scale::diverging;
use ghand_render::viridis::viridis;
use glam::DVec3;

/// Size of the bar of colours, points.
const BAR: egui::Vec2 = egui::vec2(210.0, 12.0);
/// Parts of the bar with one gradient each; Viridis is given at nine values.
const PARTS: u32 = 32;
/// Distance from the view's edges, points.
const MARGIN: f32 = 12.0;

/// The colours of numbers. All are told apart with any colour vision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorMap {
    /// Dark violet to yellow.
    Viridis,
    /// Blue through grey to orange.
    Diverging,
    /// Black to white.
    Grey,
}

impl ColorMap {
    /// The colour of a number, display values: 0 has the first colour and 1 the last.
    pub fn color(self, part: f64) -> DVec3 {
        match self {
            ColorMap::Viridis => viridis(part),
            ColorMap::Diverging => diverging(2.0 * part - 1.0),
            ColorMap::Grey => DVec3::splat(part.clamp(0.0, 1.0)),
        }
    }
}

/// A legend.
#[derive(Debug, Clone, PartialEq)]
pub struct Legend {
    /// What is shown, with its unit.
    pub title: String,
    /// The colours of the numbers; `None` if colours are not those of numbers.
    pub map: Option<ColorMap>,
    /// The numbers with the first, the middle and the last colour.
    pub ticks: [String; 3],
}

impl Legend {
    /// Of a range of numbers, the last of which may stand for larger ones, too.
    pub fn linear(title: &str, [low, high]: [f64; 2], clamped: bool) -> Legend {
        let at = |part: f64| number(low + part * (high - low), high - low);
        let last = if clamped { format!("≥ {}", at(1.0)) } else { at(1.0) };
        Legend { title: title.into(), map: Some(ColorMap::Viridis), ticks: [at(0.0), at(0.5), last] }
    }

    /// Of numbers on both sides of zero, up to a limit that may stand for larger ones, too.
    pub fn around_zero(title: &str, limit: f64, clamped: bool) -> Legend {
        let text = number(limit, 2.0 * limit);
        let ticks = match clamped {
            true => [format!("≤ -{text}"), "0".into(), format!("≥ {text}")],
            false => [format!("-{text}"), "0".into(), text],
        };
        Legend { title: title.into(), map: Some(ColorMap::Diverging), ticks }
    }

    /// Without numbers.
    pub fn text(title: &str) -> Legend {
        Legend { title: title.into(), map: None, ticks: [const { String::new() }; 3] }
    }

    /// Shows it in the lower left corner of the view. It does not take the pointer.
    pub fn show(&self, ui: &Ui, view: Rect) {
        let at = view.left_bottom() + egui::vec2(MARGIN, -MARGIN);
        let area = Area::new(Id::unique("legend")).pivot(Align2::LEFT_BOTTOM).fixed_pos(at).interactable(false);
        area.show(ui.ctx(), |ui| {
            let fill = ui.visuals().window_fill().gamma_multiply(0.92);
            Frame::popup(ui.style()).fill(fill).inner_margin(10.0).show(ui, |ui| {
                ui.set_width(BAR.x);
                ui.label(RichText::new(&self.title));
                if let Some(map) = self.map {
                    self.bar(ui, map);
                }
            });
        });
    }

    fn bar(&self, ui: &mut Ui, map: ColorMap) {
        let font = FontId::proportional(11.0);
        let (rect, response) = ui.allocate_exact_size(BAR + egui::vec2(0.0, font.size + 6.0), Sense::hover());
        let bar = Rect::from_min_size(rect.min, BAR);
        ui.painter().add(gradient(bar, map));
        let aligns = [Align2::LEFT_TOP, Align2::CENTER_TOP, Align2::RIGHT_TOP];
        for ((text, align), x) in self.ticks.iter().zip(aligns).zip([bar.left(), bar.center().x, bar.right()]) {
            ui.painter().text(Pos2::new(x, bar.bottom() + 4.0), align, text, font.clone(), ui.visuals().text_color());
        }
        let spoken = format!("Colours from {} to {}", self.ticks[0], self.ticks[2]);
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &spoken));
    }
}

/// The colours from left to right.
fn gradient(bar: Rect, map: ColorMap) -> Mesh {
    let mut mesh = Mesh::default();
    for k in 0..=PARTS {
        let part = k as f32 / PARTS as f32;
        let [r, g, b] = map.color(part.into()).to_array().map(|v| (v * 255.0).round() as u8);
        let x = bar.left() + part * bar.width();
        for y in [bar.top(), bar.bottom()] {
            mesh.colored_vertex(Pos2::new(x, y), Color32::from_rgb(r, g, b));
        }
    }
    for k in 0..PARTS {
        let first = 2 * k;
        mesh.add_triangle(first, first + 1, first + 2);
        mesh.add_triangle(first + 1, first + 2, first + 3);
    }
    mesh
}

/// A number with as many decimals as an eighth of the range needs, but no zeros at its end.
fn number(value: f64, range: f64) -> String {
    let decimals = (1.0 - (0.125 * range.abs()).max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_the_range_needs() {
        let texts = |low: f64, high: f64| [0.0, 0.5, 1.0].map(|part| number(low + part * (high - low), high - low));
        assert_eq!(texts(0.0, 0.25), ["0", "0.125", "0.25"]);
        assert_eq!(texts(0.0, 1.0), ["0", "0.5", "1"]);
        assert_eq!(texts(0.61, 0.75), ["0.61", "0.68", "0.75"]);
        assert_eq!(texts(0.0, 30.0), ["0", "15", "30"]);
    }
}
