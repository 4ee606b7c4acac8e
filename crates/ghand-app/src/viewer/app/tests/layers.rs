//! Every layer shows at a known place of a known avatar the colour that its legend gives to the known number.

use ghand_avatar::light::{AvatarLight, Light};
use ghand_avatar::properties::PropertyTables;
use ghand_core::skinning::ResidualWeights;
use ghand_hand_model::surface::sample_surface;
use ghand_render::viridis::viridis;
use glam::DVec3;

use super::*;
use crate::viewer::rendering::picture::tests::pixels;
use crate::viewer::stage::layer::Layer;
use ghand_pictures::color_scale::diverging;

const SKIN: [f64; 3] = [0.8, 0.6, 0.5];
/// Shares of all skinning weights of the first two joints.
const WEIGHTS: [f32; 2] = [0.25, 0.75];
/// What the first basis adds to each Gaussian, metres: the limit of its colours is 4 mm. The coefficient of the second, which adds nothing.
const OFFSET: [f32; 3] = [0.0, 0.003_906_25, 0.0];
const SECOND_COEFFICIENT: f32 = -0.5;
/// The residual weight of joint 1, less the mean over the joints as it takes effect.
const RESIDUAL: f32 = 0.2;

/// An avatar whose numbers are the same at all Gaussians.
fn known_avatar() -> Avatar {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let config = AvatarConfig {
        uv_resolution: 96,
        shape_bases: 2,
        residual_weights: ResidualWeights::ZeroSum,
        ..Default::default()
    };
    let mut avatar = Avatar::untrained(&model, &config, SKIN, 0).unwrap();
    let count = avatar.template.len();
    avatar.template.weights.fill(0.0);
    for (joint, weight) in WEIGHTS.into_iter().enumerate() {
        avatar.template.weights[joint * count..(joint + 1) * count].fill(weight);
    }
    let PropertyTables::Direct(tables) = &mut avatar.tables else { panic!("not a direct avatar") };
    tables.shape_basis.fill(0.0);
    for (c, offset) in OFFSET.into_iter().enumerate() {
        tables.shape_basis[c * count..(c + 1) * count].fill(offset);
    }
    tables.residual_weights[count..2 * count].fill(RESIDUAL);
    let rows = config.coefficients.rows();
    tables.response[rows..2 * rows].fill(SECOND_COEFFICIENT);
    avatar.seen = Some(vec![2.0; count]);
    let samples = sample_surface(&model, config.uv_resolution).unwrap();
    avatar.light = Some(AvatarLight::new(Light::studio(), None, &samples));
    avatar
}

/// A picture of the avatar in a layer.
struct Shown {
    ui: Headless,
    pixels: Vec<u8>,
    size: [u32; 2],
}

impl Shown {
    fn new(avatar: Avatar, layer: Layer, joint: usize, basis: usize, zoom: f64) -> Shown {
        let name = avatar.model.joint_names[joint].clone();
        let mut ui = Headless::new(Subject::avatar(avatar), SIZE, 1.0);
        ui.frame(Vec::new());
        ui.camera().zoom(zoom);
        ui.viewer().show_layer(layer);
        assert!(ui.viewer().choose_joint(&name) && ui.viewer().choose_basis(basis + 1));
        // More than one, if memory was too small at first.
        (0..4).for_each(|_| _ = ui.frame(Vec::new()));
        assert!(ui.viewer().finish().unwrap());
        let viewer = ui.viewer();
        assert_eq!(viewer.stage.layers.layer(viewer.document.avatar()), layer);
        let gpu = ui.viewer().gpu().clone();
        let texture = ui.canvas().picture().texture().unwrap();
        let size = [texture.width(), texture.height()];
        let pixels = pixels(&gpu, texture);
        Shown { ui, pixels, size }
    }

    fn pixel(&self, [x, y]: [u32; 2]) -> DVec3 {
        let at = 4 * (y * self.size[0] + x) as usize;
        DVec3::from([0, 1, 2].map(|c| f64::from(self.pixels[at + c]) / 255.0))
    }

    fn place(&mut self, world: DVec3) -> [u32; 2] {
        let camera = self.ui.camera().camera(self.size);
        let pixel = camera.project(world).0;
        [pixel.x as u32, pixel.y as u32]
    }

    /// The pixel in the middle of the hand's back.
    fn middle(&mut self) -> [u32; 2] {
        let model = self.ui.hand().model();
        let [wrist, knuckle] = ["wrist", "middle1"].map(|name| model.joints[model.joint_index(name).unwrap()]);
        self.place(0.5 * (wrist + knuckle) + DVec3::from(OFFSET.map(f64::from)))
    }

    fn title(&mut self) -> String {
        self.ui.viewer().stage.layers.legend().map(|legend| legend.title.clone()).unwrap_or_default()
    }
}

/// Checks the pixel in the middle of the hand, and the legend's title.
fn check(layer: Layer, joint: usize, basis: usize, expected: DVec3, title: &str) {
    let mut shown = Shown::new(known_avatar(), layer, joint, basis, 1.0);
    let middle = shown.middle();
    let pixel = shown.pixel(middle);
    // One percent of the background shines through, and values are rounded.
    assert!(pixel.distance(expected) < 0.02, "{layer:?}: {pixel} instead of {expected}");
    assert!(shown.title().contains(title), "{:?} lacks {title:?}", shown.title());
    // Beside the hand there is none of it.
    let corner = shown.pixel([2, 2]);
    assert!(corner.distance(expected) > 0.1, "{layer:?}: {corner} in the corner");
}

#[test]
fn albedo_is_the_skin_without_its_light() {
    check(Layer::Albedo, 0, 0, DVec3::from(SKIN), "");
    let mut lit = Shown::new(known_avatar(), Layer::Skin, 0, 0, 1.0);
    let middle = lit.middle();
    assert!(lit.pixel(middle).distance(DVec3::from(SKIN)) > 0.02, "the light changes nothing");
    let mut unlit = Shown::new(Avatar { light: None, ..known_avatar() }, Layer::Skin, 0, 0, 1.0);
    let middle = unlit.middle();
    assert!(unlit.pixel(middle).distance(DVec3::from(SKIN)) < 0.02);
}

#[test]
fn what_training_saw_is_relative_to_the_median() {
    // The scale has three decades below the median and one above.
    check(Layer::Views, 0, 0, viridis(0.75), "× median");
}

#[test]
fn weights_are_those_of_the_chosen_joint() {
    for (joint, weight) in WEIGHTS.into_iter().enumerate() {
        check(Layer::Weights, joint, 0, viridis(f64::from(weight)), "skinning weight");
    }
    check(Layer::Weights, 2, 0, viridis(0.0), "skinning weight");
}

#[test]
fn offsets_are_how_far_what_was_learned_moves_a_gaussian() {
    check(Layer::Offset, 0, 0, viridis(3.906_25 / 4.0), "mm");
}

#[test]
fn depth_is_that_of_the_nearest_surface() {
    let mut shown = Shown::new(known_avatar(), Layer::Depth, 0, 0, 1.0);
    let middle = shown.middle();
    let avatar = known_avatar();
    let count = avatar.template.len();
    let world = |p: usize| DVec3::from([0, 1, 2].map(|c| f64::from(avatar.template.rest[c * count + p] + OFFSET[c])));
    let camera = shown.ui.camera().camera(shown.size);
    let depths: Vec<(f64, f64)> = (0..count)
        .map(|p| {
            let (pixel, depth) = camera.project(world(p));
            (pixel.distance(DVec2::new(middle[0].into(), middle[1].into())), depth)
        })
        .collect();
    let extreme = |pick: fn(f64, f64) -> f64, first: f64| depths.iter().fold(first, |a, (_, depth)| pick(a, *depth));
    let (low, high) = (extreme(f64::min, f64::MAX), extreme(f64::max, 0.0));
    let near = depths.iter().filter(|(distance, _)| *distance < 4.0).map(|(_, depth)| *depth);
    let expected = viridis((near.fold(f64::MAX, f64::min) - low) / (high - low));
    assert!(shown.pixel(middle).distance(expected) < 0.05, "{} instead of {expected}", shown.pixel(middle));
    assert!(shown.title().contains("depth, m"));
}

#[test]
fn alpha_is_white_on_the_hand_and_black_beside_it() {
    check(Layer::Alpha, 0, 0, DVec3::ONE, "alpha");
    let shown = Shown::new(known_avatar(), Layer::Alpha, 0, 0, 1.0);
    assert_eq!(shown.pixel([2, 2]), DVec3::ZERO);
}

#[test]
fn centers_are_dots_with_gaps_between_them() {
    let mut shown = Shown::new(Avatar { light: None, ..known_avatar() }, Layer::Centers, 0, 0, 6.0);
    assert!(shown.title().contains("centres"));
    let behind = shown.pixel([0, 0]);
    let [width, height] = shown.size;
    let all: Vec<DVec3> = (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).map(|at| shown.pixel(at)).collect();
    let is_dot = |color: &&DVec3| color.distance(DVec3::from(SKIN)) < 0.1;
    let dots = all.iter().filter(is_dot).count() as f64 / all.len() as f64;
    let gaps = all.iter().filter(|color| color.distance(behind) < 0.1).count() as f64 / all.len() as f64;
    assert!(dots > 0.002 && gaps > 0.5, "{dots} of the picture are dots, {gaps} gaps");
    // The same view without the layer is full of hand.
    let full = Shown::new(Avatar { light: None, ..known_avatar() }, Layer::Skin, 0, 0, 6.0);
    let hand = (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).filter(|at| is_dot(&&full.pixel(*at))).count();
    assert!(hand as f64 > 0.5 * all.len() as f64);
    // A dot is where a Gaussian is: one of the nearest surface.
    let avatar = known_avatar();
    let count = avatar.template.len();
    let world = |p: usize| DVec3::from([0, 1, 2].map(|c| f64::from(avatar.template.rest[c * count + p] + OFFSET[c])));
    let camera = shown.ui.camera().camera(shown.size);
    let nearest = (0..count)
        .filter(|p| {
            let (pixel, _) = camera.project(world(*p));
            pixel.min_element() > 4.0 && pixel.x < f64::from(width) - 4.0 && pixel.y < f64::from(height) - 4.0
        })
        .min_by(|a, b| camera.project(world(*a)).1.total_cmp(&camera.project(world(*b)).1))
        .unwrap();
    let place = shown.place(world(nearest));
    assert!(is_dot(&&shown.pixel(place)), "{} at {place:?}", shown.pixel(place));
}

#[test]
fn residual_weights_are_as_they_take_effect() {
    let joints = known_avatar().template.joint_count() as f64;
    // Limits are 0.2 for joint 1, whose weight less the mean is the largest number, and 0.02 for the others.
    let own = f64::from(RESIDUAL) * (1.0 - 1.0 / joints);
    check(Layer::Residual, 1, 0, diverging(own / 0.2), "residual weight");
    let other = -f64::from(RESIDUAL) / joints;
    check(Layer::Residual, 2, 0, diverging(other / 0.02), "residual weight");
}

#[test]
fn bases_and_coefficients_are_those_of_the_chosen_number() {
    check(Layer::Basis, 0, 0, viridis(3.906_25 / 4.0), "shape basis 1, mm");
    check(Layer::Basis, 0, 1, viridis(0.0), "shape basis 2, mm");
    check(Layer::Coefficient, 0, 0, diverging(1.0), "coefficient 1");
    check(Layer::Coefficient, 0, 1, diverging(f64::from(SECOND_COEFFICIENT) / 0.6), "coefficient 2");
}

#[test]
fn a_layer_that_an_avatar_lacks_is_explained_and_not_shown() {
    let mut avatar = known_avatar();
    avatar.light = None;
    avatar.seen = None;
    let mut ui = Headless::new(Subject::avatar(avatar), SIZE, 0.1);
    ui.frame(Vec::new());
    let context = ui.harness.ctx.clone();
    for (layer, said) in [(Layer::Albedo, "part of its colours"), (Layer::Views, "train it again")] {
        ui.viewer().run(crate::viewer::command::CommandId::ShowLayer(layer), &context);
        ui.frame(Vec::new());
        ui.frame(Vec::new());
        let viewer = ui.viewer();
        assert_eq!(viewer.stage.layers.layer(viewer.document.avatar()), Layer::Skin);
        assert!(ui.harness.query_by_label_contains(said).is_some(), "{layer:?}: no message");
        assert!(ui.viewer().missing_layer(layer).is_some());
    }
    assert!(!ui.viewer().choose_basis(9));
}
