//! What each camera saw over time: where the hand was found and sharp, how far its landmarks are off the fitted hand, and
//! which frames are chosen.

use ghand_core::statistics::quantile;
use ghand_import::Imported;
use ghand_import::candidates::sharp_tenth;
use ghand_import::choice::LEAST_SHARPNESS;
use maud::{Markup, html};

use super::round_step::round_step;

/// Size of a line, and the part of it that shows time, pixels.
const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 96.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 950.0;
/// Rows: the plot of distances, the band of images below it, and the axis.
const PLOT: [f64; 2] = [8.0, 54.0];
const BAND: [f64; 2] = [58.0, 72.0];
const AXIS: f64 = 88.0;
/// The plot reaches this many times what most distances are below.
const MOST: f64 = 0.98;
const BEYOND: f64 = 1.2;
/// Numbers on the axis of time, at most.
const TICKS: f64 = 12.0;

/// What an image shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// No hand was found.
    Nothing,
    /// A hand that is too blurred to be chosen.
    Blurred,
    /// A sharp hand.
    Sharp,
}

/// A camera over time, in seconds of the first camera's clock.
#[derive(Debug, Clone)]
pub struct Timeline {
    /// The camera, and what is told of it.
    pub title: String,
    /// Its images.
    pub images: Vec<(f64, Seen)>,
    /// How far landmarks are off the hand, pixels; `None` where there is no pose or no hand.
    pub residuals: Vec<(f64, Option<f64>)>,
    /// The chosen moments.
    pub chosen: Vec<f64>,
}

impl Timeline {
    /// Those of all cameras.
    pub fn of(imported: &Imported) -> Vec<Timeline> {
        let first = &imported.tracks[0].times;
        let one = |(camera, track): (usize, &ghand_import::track::Track)| {
            let sharp = LEAST_SHARPNESS * sharp_tenth(track);
            let offset = imported.solved.rig.offsets[camera];
            let seen = track.sightings.iter().map(|sighting| match sighting {
                None => Seen::Nothing,
                Some(sighting) if sighting.sharpness < sharp => Seen::Blurred,
                Some(_) => Seen::Sharp,
            });
            let chosen = imported.choice.train.iter().chain(&imported.choice.test);
            let chosen = chosen.map(|k| imported.candidates[*k].0);
            Timeline {
                title: imported.sources[camera].id.clone(),
                images: track.times.iter().map(|time| time - offset).zip(seen).collect(),
                residuals: first.iter().copied().zip(imported.residuals[camera].iter().copied()).collect(),
                chosen: chosen.filter(|k| imported.image_of(*k, camera).is_some()).map(|k| first[k]).collect(),
            }
        };
        imported.tracks.iter().enumerate().map(one).collect()
    }

    /// In how many images there is a sharp hand, and in how many there is any.
    pub fn sharp_and_found(&self) -> [usize; 2] {
        let count = |is: fn(Seen) -> bool| self.images.iter().filter(|(_, seen)| is(*seen)).count();
        [count(|seen| seen == Seen::Sharp), count(|seen| seen != Seen::Nothing)]
    }

    /// Runs of images that show the same: from, to, what.
    fn runs(&self) -> Vec<(f64, f64, Seen)> {
        let mut runs: Vec<(f64, f64, Seen)> = vec![];
        for (k, (time, seen)) in self.images.iter().enumerate() {
            let before = k.checked_sub(1).and_then(|k| self.images.get(k)).map_or(0.0, |(before, _)| time - before);
            let end = self.images.get(k + 1).map_or(time + before, |(next, _)| *next);
            match runs.last_mut() {
                Some(last) if last.2 == *seen => last.1 = end,
                _ => runs.push((*time, end, *seen)),
            }
        }
        runs
    }

    /// The curve of distances, as an SVG path. Of several frames in a pixel the worst one counts.
    fn curve(&self, scale: &Scale) -> String {
        let mut path = String::new();
        for part in self.residuals.split(|(_, value)| value.is_none()) {
            let mut points: Vec<[f64; 2]> = vec![];
            for (time, value) in part.iter().filter_map(|(time, value)| Some((time, (*value)?))) {
                let x = scale.x(*time).round();
                match points.last_mut() {
                    Some([last, worst]) if x <= *last => *worst = worst.max(value),
                    _ => points.push([x, value]),
                }
            }
            for (k, [x, value]) in points.into_iter().enumerate() {
                let y = scale.y(value);
                // A frame alone is a dot.
                path += &if k == 0 { format!("M{x:.0} {y:.1}h.1") } else { format!("L{x:.0} {y:.1}") };
            }
        }
        path
    }

    fn figure(&self, scale: &Scale) -> Markup {
        let [top, bottom] = PLOT;
        let ticks = (0..).map(|k| f64::from(k) * scale.tick).take_while(|time| *time <= scale.to);
        let ticks = ticks.filter(|time| *time >= scale.from);
        let row = |from: f64, to: f64| [format!("{:.1}", scale.x(from)), format!("{:.1}", scale.x(to) - scale.x(from))];
        html! {
            figure.timeline {
                figcaption { (self.title) }
                svg viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" aria-label={ "images of " (self.title) " over time" } {
                    @for (value, y) in [(scale.limit, top), (0.5 * scale.limit, 0.5 * (top + bottom)), (0.0, bottom)] {
                        line.grid x1=(LEFT) x2=(RIGHT) y1=(y) y2=(y) {}
                        text x=(LEFT - 6.0) y=(y + 4.0) text-anchor="end" { (value) @if value > 0.0 { " px" } }
                    }
                    @for (from, to, seen) in self.runs() {
                        @let [x, width] = row(from, to);
                        rect class=(class(seen)) x=(x) width=(width) y=(BAND[0]) height=(BAND[1] - BAND[0]) {}
                    }
                    @for time in &self.chosen {
                        rect.chosen x=(format!("{:.1}", scale.x(*time) - 0.75)) width="1.5" y=(BAND[0] - 3.0) height=(BAND[1] - BAND[0] + 6.0) {}
                    }
                    path.residual d=(self.curve(scale)) {}
                    @for time in ticks {
                        text x=(format!("{:.1}", scale.x(time))) y=(AXIS) text-anchor="middle" { (round(time)) " s" }
                    }
                }
            }
        }
    }
}

fn class(seen: Seen) -> &'static str {
    match seen {
        Seen::Nothing => "nothing",
        Seen::Blurred => "blurred",
        Seen::Sharp => "sharp",
    }
}

/// Without the digits of binary fractions.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Common to all cameras.
struct Scale {
    from: f64,
    to: f64,
    tick: f64,
    /// Pixels of the images at the plot's upper end.
    limit: f64,
}

impl Scale {
    fn of(lines: &[Timeline]) -> Scale {
        let runs = || lines.iter().flat_map(Timeline::runs);
        let from = runs().map(|(from, ..)| from).fold(f64::INFINITY, f64::min);
        let to = runs().map(|(_, to, _)| to).fold(f64::NEG_INFINITY, f64::max);
        let to = if to > from { to } else { from + 1.0 };
        let values = lines.iter().flat_map(|line| line.residuals.iter().filter_map(|(_, value)| *value));
        let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        let most = if values.is_empty() { 1.0 } else { quantile(values, MOST) };
        Scale { from, to, tick: round_step((to - from) / TICKS), limit: round_step(BEYOND * most) }
    }

    fn x(&self, time: f64) -> f64 {
        LEFT + (time - self.from) / (self.to - self.from) * (RIGHT - LEFT)
    }

    fn y(&self, value: f64) -> f64 {
        PLOT[1] - (value / self.limit).min(1.0) * (PLOT[1] - PLOT[0])
    }
}

/// All lines, one below the other, with their legend.
pub fn timelines(lines: &[Timeline]) -> Markup {
    let scale = Scale::of(lines);
    html! {
        @for line in lines { (line.figure(&scale)) }
        p.legend {
            span { i.residual {} "landmarks off the fitted hand" }
            span { i.sharp {} "the hand is sharp" }
            span { i.blurred {} "found, but blurred" }
            span { i.nothing {} "no hand found" }
            span { i.chosen {} "chosen" }
        }
    }
}

/// The styles of [`timelines`].
pub const STYLE: &str = "
.timeline { margin: .6rem 0; } .timeline svg { display: block; width: 100%; border-radius: 0; }
.timeline text { font-size: 11px; fill: currentColor; opacity: .75; } .timeline .grid { stroke: #8884; }
.sharp { fill: #2a9d6f; background: #2a9d6f; } .blurred { fill: #9dccb8; background: #9dccb8; }
.nothing { fill: #c9514a; background: #c9514a; } .chosen { fill: #e8891d; background: #e8891d; }
.timeline path { fill: none; stroke: #4a7fd6; stroke-width: 1.5; stroke-linecap: round; stroke-linejoin: round; }
.legend span { margin-right: 1.4rem; white-space: nowrap; } .legend i { display: inline-block; width: .8em; height: .8em; margin-right: .4em; }
.legend i.residual { height: 2px; width: 1.2em; vertical-align: middle; background: #4a7fd6; } .legend i.chosen { width: 3px; }
";
