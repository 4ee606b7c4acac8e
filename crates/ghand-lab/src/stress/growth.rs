//! How errors grow with a pose's angles, with the size of a hand, its distance, the layers over a pixel and the number of
//! Gaussians: each alone, with all else as usual.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use ghand_avatar::reference::{DirectTwin, PosedGaussians, vectors};
use ghand_avatar::scene::OPACITY;
use ghand_avatar::{Avatar, GaussianShape, PropertyTables};
use ghand_core::Pose;
use ghand_files::atomic_file::write_atomically;
use ghand_pictures::plot::{DataSeries, LogPanel, LogPlot};
use ghand_pictures::write_png;
use ghand_render::Gpu;
use glam::DVec3;
use rand::RngExt;

use super::case::{HIGHER, LOWER, StressSubject, gradient_parts, twin_of};
use super::compare::{differences, undecided};
use super::hand::{HandKind, Sampler, StressHand, StressModel, usual_hand, usual_pose};
use super::view::ViewKind;

/// Hands, poses and views of each value.
const REPEATED: u64 = 8;
/// Gaussians of a usual hand here.
const USUAL_COUNT: usize = 100;
/// What is measured.
const ERRORS: [&str; 3] = [
    "places of Gaussians (largest, part of the hand)",
    "picture (root mean square, display values)",
    "pose's gradient (part of it)",
];

/// What grows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quantity {
    Angle,
    Size,
    Distance,
    Layers,
    Count,
}

impl Quantity {
    const ALL: [Quantity; 5] = [Quantity::Angle, Quantity::Size, Quantity::Distance, Quantity::Layers, Quantity::Count];

    fn name(self) -> &'static str {
        match self {
            Quantity::Angle => "angle of each joint, rad",
            Quantity::Size => "size of the hand, m",
            Quantity::Distance => "distance from the origin, m",
            Quantity::Layers => "Gaussians over each pixel",
            Quantity::Count => "number of Gaussians",
        }
    }

    fn values(self) -> Vec<f64> {
        let decades = |from: i32, to: i32| (from..=to).map(|k| 10f64.powi(k)).collect::<Vec<_>>();
        match self {
            Quantity::Angle => decades(-4, 2),
            Quantity::Size => decades(-6, 3),
            Quantity::Distance => decades(-1, 4),
            Quantity::Layers => vec![1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0],
            Quantity::Count => vec![10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10_000.0],
        }
    }

    /// A hand, its pose, and the size of the hand, with this value.
    fn draw(self, draw: &mut Sampler, value: f64) -> (Avatar, Pose, f64) {
        let count = match self {
            Quantity::Layers | Quantity::Count => value as usize,
            _ => USUAL_COUNT,
        };
        let size = if self == Quantity::Size { value } else { HandKind::Usual.size().into() };
        let mut avatar = usual_hand(draw, count);
        let spacing = match self {
            // Each covers the whole hand.
            Quantity::Layers => 0.7,
            _ => 1.0 / (count as f32).sqrt(),
        };
        avatar.template.spacings.fill(spacing * HandKind::Usual.size());
        let mut pose = usual_pose(draw, &avatar.template);
        match self {
            Quantity::Angle => {
                let turned = |draw: &mut Sampler| draw.vector(1.0).try_normalize().unwrap_or(DVec3::X) * value;
                pose.rotations.iter_mut().for_each(|r| *r = turned(draw).as_vec3().as_dvec3());
            }
            Quantity::Size => scale(&mut avatar, &mut pose, (size / f64::from(HandKind::Usual.size())) as f32),
            Quantity::Distance => {
                let direction = draw.vector(1.0).try_normalize().unwrap_or(DVec3::X);
                pose.translation = (direction * value).as_vec3().as_dvec3();
            }
            Quantity::Layers | Quantity::Count => {}
        }
        (avatar, pose, size)
    }
}

/// Makes a hand this many times as large.
fn scale(avatar: &mut Avatar, pose: &mut Pose, factor: f32) {
    let template = &mut avatar.template;
    template.rest.iter_mut().chain(&mut template.spacings).for_each(|v| *v *= factor);
    let scaled = |v: DVec3| (v * f64::from(factor)).as_vec3().as_dvec3();
    template.joints.iter_mut().for_each(|joint| *joint = scaled(*joint));
    pose.translation = scaled(pose.translation);
    if let PropertyTables::Direct(tables) = &mut avatar.tables {
        tables.shape_basis.iter_mut().for_each(|v| *v *= factor);
    }
}

/// Errors over a quantity: medians of [`ERRORS`] and the worst, `None` where nothing is drawn.
struct Curve {
    quantity: Quantity,
    points: Vec<(f64, [Option<[f64; 2]>; 3])>,
}

/// Measures all curves and writes `growth.csv`, `growth.png` and `growth.svg` to a folder; the table in Markdown.
///
/// # Errors
/// If the device fails or a file cannot be written.
pub fn measure(gpu: &mut Gpu, seed: u64, folder: Option<&Path>) -> anyhow::Result<String> {
    let mut curves = vec![];
    for (k, quantity) in Quantity::ALL.into_iter().enumerate() {
        let mut points = vec![];
        for (step, value) in quantity.values().into_iter().enumerate() {
            let mut all: [Vec<f64>; 3] = Default::default();
            for repetition in 0..REPEATED {
                let stream = ((k as u64) << 32) + ((step as u64) << 16) + repetition;
                let found = gpu.retry_on_device_loss("a case", |gpu| {
                    errors(gpu, quantity, value, &mut Sampler::new(seed, stream))
                })?;
                all.iter_mut().zip(found).for_each(|(all, found)| all.extend(found));
            }
            points.push((value, all.map(median_and_worst)));
        }
        curves.push(Curve { quantity, points });
    }
    if let Some(folder) = folder {
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            write_atomically(&path, bytes).with_context(|| format!("{}: cannot write", path.display()))
        };
        let plot = plot(&curves);
        write("growth.csv", csv(&curves).as_bytes())?;
        write("growth.svg", plot.to_svg()?.as_bytes())?;
        write_png(&folder.join("growth.png"), &plot.to_image()?)?;
    }
    Ok(table(&curves))
}

/// The errors of one hand in one pose and view.
fn errors(gpu: &Gpu, quantity: Quantity, value: f64, draw: &mut Sampler) -> anyhow::Result<[Option<f64>; 3]> {
    let (avatar, pose, size) = quantity.draw(draw, value);
    let twin = DirectTwin::new(&avatar).context("the hand has no twin")?;
    let posed = twin.pose(&pose);
    let camera = ViewKind::Usual.draw(draw, &posed.gaussians);
    let hand = StressHand { kind: HandKind::Usual, model: StressModel::Direct, avatar: avatar.clone(), full: None };
    let mut subject = StressSubject::new(gpu, &hand)?;
    let (image, table) = subject.draw(gpu, &pose, &camera)?;

    let found =
        PosedGaussians::from_table(&table.iter().map(|v| f64::from(*v)).collect::<Vec<_>>(), GaussianShape::Round);
    let places = found.means.iter().zip(&posed.gaussians.means).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max) / size;

    let splats = posed.gaussians.splats(OPACITY.into());
    let exact = |cut: f64| twin_of(&splats, &camera, avatar.config.filter(), cut).rasterize();
    let [low, drawn, high] = [LOWER, 1.0, HIGHER].map(exact);
    let undecided = undecided([&low, &drawn, &high]);
    let is_drawn = drawn.iter().any(|pixel| pixel[3] > 0.0);
    let squares: Vec<f64> = (differences(&image, &drawn).iter().zip(&undecided))
        .filter(|(_, undecided)| !**undecided)
        .map(|(d, _)| d * d)
        .collect();
    let picture = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();

    let weight = |undecided: &bool| [0; 4].map(|_| if *undecided { 0.0 } else { draw.0.random_range(-1.0f32..1.0) });
    let weights: Vec<[f32; 4]> = undecided.iter().map(weight).collect();
    let d_image: Vec<[f64; 4]> = weights.iter().map(|w| w.map(f64::from)).collect();
    let d_splats = twin_of(&splats, &camera, avatar.config.filter(), 1.0).rasterize_vjp(&d_image).0;
    let [d_means, d_scales, d_colors] = gradient_parts(&d_splats, 1.0);
    let d_gaussians = PosedGaussians {
        means: vectors(&d_means, 0, d_splats.len()),
        scales: d_scales,
        normals: None,
        colors: vectors(&d_colors, 0, d_splats.len()),
    };
    let exact = twin.gradients(&pose, &posed, &d_gaussians, [0.0; 2]).pose;
    let gradients = subject.gradients(gpu, &weights, table.len())?;
    let found = gradients.iter().find(|(name, _)| name == "pose").map_or(&[][..], |(_, values)| values);
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let size = norm(&mut exact.iter().copied());
    let gradient = norm(&mut exact.iter().zip(found).map(|(a, b)| a - f64::from(*b))) / size;
    Ok([Some(places), is_drawn.then_some(picture), (is_drawn && size > 0.0).then_some(gradient)])
}

fn median_and_worst(mut values: Vec<f64>) -> Option<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    Some([*values.get(values.len() / 2)?, *values.last()?])
}

fn csv(curves: &[Curve]) -> String {
    let mut text = "quantity,value,error,median,worst\n".to_owned();
    for Curve { quantity, points } in curves {
        for (value, errors) in points {
            for (name, error) in ERRORS.iter().zip(errors) {
                let Some([median, worst]) = error else { continue };
                let _ = writeln!(text, "\"{}\",{value},\"{name}\",{median:e},{worst:e}", quantity.name());
            }
        }
    }
    text
}

fn table(curves: &[Curve]) -> String {
    let mut text = format!("| | from, to | {} |\n|---|---|---|---|---|\n", ERRORS.join(" | "));
    for Curve { quantity, points } in curves {
        let [Some(first), Some(last)] = [points.first(), points.last()] else { continue };
        let ends = |k: usize| {
            let all: Vec<f64> = points.iter().filter_map(|(_, errors)| Some(errors[k]?[0])).collect();
            let worst = points.iter().filter_map(|(_, errors)| Some(errors[k]?[1])).fold(0.0, f64::max);
            match all[..] {
                [first, .., last] => format!("{first:.1e}, {last:.1e}; worst {worst:.1e}"),
                _ => "nothing is drawn".into(),
            }
        };
        let (from, to) = (first.0, last.0);
        let _ = writeln!(text, "| {} | {from}, {to} | {} | {} | {} |", quantity.name(), ends(0), ends(1), ends(2));
    }
    text
}

fn plot(curves: &[Curve]) -> LogPlot {
    let panel = |curve: &Curve| LogPanel {
        axis: curve.quantity.name().into(),
        series: (0..3)
            .map(|k| DataSeries {
                name: ERRORS[k].into(),
                points: curve.points.iter().filter_map(|(value, errors)| Some((*value, errors[k]?[0]))).collect(),
            })
            .collect(),
    };
    LogPlot { title: "Errors of f32 against f64, medians".into(), panels: curves.iter().map(panel).collect() }
}

#[cfg(test)]
mod tests {
    use ghand_render::AdapterChoice;

    use super::*;

    #[test]
    fn only_distance_from_the_origin_costs_digits() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let of = |quantity: Quantity, value: f64| errors(&gpu, quantity, value, &mut Sampler::new(3, 1)).unwrap();
        let usual =
            [(Quantity::Angle, 1.0), (Quantity::Size, 10.0), (Quantity::Layers, 30.0), (Quantity::Count, 300.0)];
        for (quantity, value) in usual.into_iter().chain([(Quantity::Distance, 0.1)]) {
            for error in of(quantity, value) {
                assert!(error.is_some_and(|error| error > 0.0 && error < 2e-5), "{quantity:?}: {error:?}");
            }
        }
        for error in of(Quantity::Distance, 1e3) {
            assert!(error.is_some_and(|error| (2e-5..0.1).contains(&error)), "{error:?}");
        }
        // Nothing is as near as a hand of a micrometre would have to be.
        let [places, picture, gradient] = of(Quantity::Size, 1e-6);
        assert!(places.is_some_and(|error| error < 1e-5) && picture.is_none() && gradient.is_none());
    }

    #[test]
    fn tables_and_files_have_all_that_was_measured() {
        let point = |value: f64| (value, [Some([1e-7, 2e-7]), Some([3e-7, 4e-7]), None]);
        let curves = [Curve { quantity: Quantity::Angle, points: vec![point(0.1), point(1.0)] }];
        assert!(table(&curves).contains("| angle of each joint, rad | 0.1, 1 | 1.0e-7, 1.0e-7; worst 2.0e-7 |"));
        assert!(table(&curves).contains("nothing is drawn"));
        assert_eq!(csv(&curves).lines().count(), 1 + 2 * 2);
        plot(&curves).to_image().unwrap();
        assert_eq!(median_and_worst(vec![3.0, 1.0, 2.0]), Some([2.0, 3.0]));
        assert_eq!(median_and_worst(vec![]), None);
    }
}
