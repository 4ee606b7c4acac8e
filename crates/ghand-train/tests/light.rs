//! Light and skin of captures with known light.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use common::{make, poses, small_options};
use ghand_avatar::light::AvatarLight;
use ghand_avatar::{Light, LightKind};
use ghand_capture::Capture;
use ghand_core::Pose;
use ghand_core::light::linear;
use ghand_hand_model::surface::sample_surface;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::{LightSetup, SyntheticOptions};
use ghand_train::LightChoice;
use ghand_train::floor::texel_colors;
use ghand_train::light_fit::{LightFit, fit_light};
use glam::DVec3;

const RESOLUTION: u32 = 48;

/// A capture in a light, with the true poses of its training frames.
fn capture(light: LightSetup) -> (Capture, Vec<Pose>, tempfile::TempDir) {
    let options = SyntheticOptions { light, train_frames: 12, width: 160, height: 240, ..small_options(5) };
    let (capture, folder) = make(&options);
    let [_, truth] = poses(&capture, capture.split("train").unwrap());
    (capture, truth, folder)
}

fn fit(gpu: &Gpu, capture: &Capture, poses: &[Pose], choice: LightChoice) -> LightFit {
    let fit = fit_light(gpu, capture, capture.split("train").unwrap(), poses, choice).unwrap();
    println!("{choice:?}: {:?}", fit.report());
    fit
}

/// Unlit colours of the texels, display values, and how many of them there are.
fn skin(gpu: &Gpu, capture: &Capture, poses: &[Pose], light: Option<&Light>) -> Vec<[f64; 3]> {
    let samples = sample_surface(&capture.template, RESOLUTION).unwrap();
    let model = capture.template.without_blend_shapes();
    let shades = |frame: usize| match light {
        Some(light) => {
            let vertices = light.vertex_shades(&model, &poses[frame])?;
            Ok(AvatarLight::new(light.clone(), &samples).at_gaussians(&model, &vertices))
        }
        None => Ok(vec![[1.0; 3]; samples.len()]),
    };
    let split = capture.split("train").unwrap();
    texel_colors(gpu, capture, split, poses, RESOLUTION, 72, Some(&shades)).unwrap().colors
}

/// The median relative error of linear albedos, up to one factor per channel.
fn albedo_error(found: &[[f64; 3]], truth: &[[f64; 3]]) -> f64 {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let mut errors = vec![];
    for c in 0..3 {
        let ratios: Vec<f64> = found.iter().zip(truth).map(|(f, t)| linear(f[c]) / linear(t[c])).collect();
        let factor = median(ratios.clone());
        errors.extend(ratios.iter().map(|ratio| (ratio / factor - 1.0).abs()));
    }
    median(errors)
}

#[test]
fn a_planted_light_and_the_skin_under_it_are_found() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let (flat, poses, _a) = capture(LightSetup::Flat);
    let truth = skin(&gpu, &flat, &poses, None);
    for setup in [LightSetup::Key, LightSetup::Rim] {
        let (lit, same_poses, _b) = capture(setup);
        assert_eq!(poses, same_poses);
        let fit = fit(&gpu, &lit, &poses, LightChoice::Auto);
        let light = fit.light.clone().unwrap();
        assert_eq!(light.kind, LightKind::Transfer, "{:?}", fit.figures);
        let towards = DVec3::from(fit.report().towards.unwrap());
        let angle = towards.angle_between(setup.planted().unwrap().towards).to_degrees();
        let [with, without] = [Some(&light), None].map(|light| albedo_error(&skin(&gpu, &lit, &poses, light), &truth));
        println!("{setup:?}: {angle:.1} degrees, albedo {:.1} %, unlit {:.1} %", 1e2 * with, 1e2 * without);
        // Measured: 4.3 and 11.6 degrees; 24.8 % and 21.6 % instead of 26.5 % and 40.6 %. The hand hardly turns here, and
        // the template has other proportions.
        assert!(angle < 14.0, "{setup:?}: the light is off by {angle} degrees");
        assert!(with < 0.3 && with < 0.97 * without, "{setup:?}: {with}, {without}");
    }
}

#[test]
fn skin_without_light_on_it_needs_none() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let (flat, poses, _folder) = capture(LightSetup::Flat);
    let fit = fit(&gpu, &flat, &poses, LightChoice::Auto);
    assert_eq!(fit.light, None, "{:?}", fit.figures);
    // What is asked for is done all the same.
    let forced = fit_light(&gpu, &flat, flat.split("train").unwrap(), &poses, LightChoice::Sh).unwrap();
    assert_eq!(forced.light.unwrap().kind, LightKind::Sh);
}

/// Figures of a capture given by its folder: `CAPTURE=DIR cargo test ... -- --ignored --nocapture`.
#[test]
#[ignore = "needs a capture"]
fn light_of_a_capture() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let capture = Capture::open(std::env::var("CAPTURE").unwrap().as_ref()).unwrap();
    let [_, truth] = poses(&capture, capture.split("train").unwrap());
    fit(&gpu, &capture, &truth, LightChoice::Auto);
}
