//! One case: a pose and a view of a hand, on the device and in f64.

use anyhow::Context;
use ghand_avatar::deform::DeformationBackward;
use ghand_avatar::properties::network::Normalization;
use ghand_avatar::reference::{DirectTwin, PosedGaussians, pose_baked, pose_network, rows};
use ghand_avatar::scene::OPACITY;
use ghand_avatar::{Avatar, GaussianShape, PropertyTables, Scene};
use ghand_core::{Camera, Pose};
use ghand_render::reference::project::{Filter, Gaussian};
use ghand_render::reference::rasterize::{Scene as SplatTwin, Thresholds};
use ghand_render::splat::{NEAR, Purpose, SplatModel};
use ghand_render::{Gpu, buffers};
use glam::DVec3;
use rand::RngExt;
use rayon::prelude::*;

use super::compare::{move_by_one, picture, roundings, undecided};
use super::hand::{HandKind, Sampler, StressHand, StressModel, usual_pose};
use super::light::TwinLight;
use super::view::{LARGEST_EDGE, POSES, PoseKind, VIEWS, ViewKind};

/// What is compared.
pub const STAGES: [&str; 5] = [
    "pose to Gaussians",
    "Gaussians to picture",
    "picture's gradient to Gaussians",
    "Gaussians' gradient to tables and pose",
    "pose to picture",
];
/// Most roundings of each stage that count as correct.
pub const BOUNDS: [f64; 5] = [200.0, 20.0, 30_000.0, 30_000.0, 100.0];

/// Factors on the thresholds of blending: what they change is decided by rounding.
const LOWER: f64 = 0.99;
const HIGHER: f64 = 1.01;
/// Gaussians whose depths differ by less than this many units in the last place can be drawn in either order.
const ORDER_UNITS: f64 = 4.0;

/// Colour behind the hand.
const BACKGROUND: [f32; 3] = [0.2, 0.3, 0.4];

/// What a case showed.
#[derive(Debug, Clone)]
pub struct CaseOutcome {
    /// Its number, and what is extreme about it.
    pub number: u64,
    pub hand: HandKind,
    pub model: StressModel,
    pub pose: PoseKind,
    pub view: ViewKind,
    /// Roundings of each stage; `None` where nothing can be compared.
    pub roundings: [Option<f64>; 5],
    /// Part of the picture's pixels that rounding has decided otherwise.
    pub flipped: f64,
    /// Whether rounding may decide which of two Gaussians is in front.
    pub undecided: bool,
    /// The table whose gradient is off most.
    pub worst_table: Option<String>,
    /// What fewer bits than f32 cost a baked hand: the largest distance as a part of its extent, and difference of colours.
    pub packing: Option<[f64; 2]>,
    /// What must never be, if it is.
    pub problem: Option<String>,
}

impl CaseOutcome {
    fn new(hand: &StressHand, number: u64, pose: PoseKind, view: ViewKind) -> CaseOutcome {
        let kind = hand.kind;
        let model = hand.model;
        CaseOutcome {
            number,
            hand: kind,
            model,
            pose,
            view,
            roundings: [None; 5],
            flipped: 0.0,
            undecided: false,
            worst_table: None,
            packing: None,
            problem: None,
        }
    }

    /// The outcome of a case that panicked.
    pub fn panicked(hand: &StressHand, seed: u64, number: u64) -> CaseOutcome {
        let (_, pose, view) = kinds(seed, number);
        CaseOutcome { problem: Some("panicked".into()), ..CaseOutcome::new(hand, number, pose, view) }
    }
}

/// The numbers of a case, and what is extreme about it.
fn kinds(seed: u64, number: u64) -> (Sampler, PoseKind, ViewKind) {
    let mut draw = Sampler::new(seed, 2 * number + 1);
    let pose = draw.one(&POSES);
    let view = draw.one(&VIEWS);
    (draw, pose, view)
}

/// A hand on the device.
pub struct StressSubject<'a> {
    hand: &'a StressHand,
    scene: Scene,
    /// Of what can be trained.
    backward: Option<DeformationBackward>,
}

/// The exact Gaussians.
fn exact(avatar: &Avatar, pose: &Pose) -> Option<PosedGaussians> {
    match &avatar.tables {
        PropertyTables::Baked(tables) => Some(pose_baked(avatar, tables, pose)),
        PropertyTables::Network(tables) => pose_network(avatar, tables, pose).ok(),
        PropertyTables::Direct(_) => DirectTwin::new(avatar).map(|twin| twin.pose(pose).gaussians),
    }
}

fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|v| f64::from(*v)).collect()
}

fn all_finite(values: &[f32]) -> bool {
    values.iter().all(|v| v.is_finite())
}

impl<'a> StressSubject<'a> {
    /// Puts a hand on the device.
    pub fn new(gpu: &Gpu, hand: &'a StressHand) -> anyhow::Result<StressSubject<'a>> {
        let mut scene = Scene::new(gpu, &[&hand.avatar], Purpose::Gradients, 1, [LARGEST_EDGE; 2])?;
        let mobility = vec![1.0; hand.avatar.template.joint_count()];
        let (splatter, avatars) = scene.splatter_and_avatars_mut();
        let posed = avatars.first_mut().context("the scene has no avatar")?;
        let normalization = hand.avatar.config.network.as_ref().map(|sizes| sizes.normalization);
        // In training, batch normalisation goes by other numbers than at play.
        let is_trained = match hand.model {
            StressModel::Direct => true,
            StressModel::Network => normalization != Some(Normalization::Batch),
            StressModel::Baked(_) => false,
        };
        let prepare = || posed.prepare_training(gpu, splatter.d_gaussians(), &mobility);
        let backward = is_trained.then(prepare).transpose()?;
        Ok(StressSubject { hand, scene, backward })
    }

    /// Takes the hand through the pipeline in the pose and the view of a case.
    pub fn run(&mut self, gpu: &Gpu, seed: u64, number: u64) -> anyhow::Result<CaseOutcome> {
        let avatar = &self.hand.avatar;
        let (mut draw, pose_kind, view_kind) = kinds(seed, number);
        let mut outcome = CaseOutcome::new(self.hand, number, pose_kind, view_kind);
        let pose = pose_kind.draw(&mut draw, &avatar.template);
        let unlit = exact(avatar, &pose).context("the hand has no twin")?;
        let camera = view_kind.draw(&mut draw, &unlit);
        let light = TwinLight::of(avatar, &pose, camera.center())?;
        let lit = |unlit: &PosedGaussians, light: &Option<TwinLight>| match light {
            Some(light) => light.light(unlit),
            None => unlit.clone(),
        };
        let exact_posed = lit(&unlit, &light);
        let full = self.hand.full.as_ref().and_then(|full| exact(full, &pose));
        outcome.packing = full.filter(|full| full.means.len() > 1).map(|full| packing(&full, &unlit));

        let (image, table) = self.draw(gpu, &pose, &camera)?;
        let model = self.scene.splatter().options().model;
        if !all_finite(image.as_flattened()) {
            outcome.problem = Some("a pixel is not finite".into());
            return Ok(outcome);
        }

        // The splatter alone: its twin starts from the device's own Gaussians.
        let shape = avatar.config.gaussians;
        let (mut moved_camera, mut moved_table) = (camera.clone(), table.clone());
        moved_table.iter_mut().for_each(|v| *v = move_by_one(*v, draw.chance(0.5)));
        move_camera(&mut draw, &mut moved_camera);
        let weights: Vec<[f32; 4]> =
            (0..image.len()).map(|_| [0; 4].map(|_| draw.0.random_range(-1.0f32..1.0))).collect();
        let of_device = PosedGaussians::from_table(&widen(&table), shape);
        let mut of_moved = PosedGaussians::from_table(&widen(&moved_table), shape);
        move_depths(&mut draw, &mut of_moved, &camera);
        let twins = [
            (of_device.splats(OPACITY.into()), &camera),
            (of_moved.splats(OPACITY.into()), &moved_camera),
            (exact_posed.splats(OPACITY.into()), &camera),
        ];
        let [of_device, of_moved, of_exact] = twins.each_ref().map(|(splats, camera)| (&splats[..], *camera));
        let views = [(of_device, 1.0), (of_moved, 1.0), (of_exact, 1.0), (of_device, LOWER), (of_device, HIGHER)];
        let drawn: Vec<_> = views
            .into_par_iter()
            .map(|((splats, camera), cut)| twin_of(splats, camera, model.filter(), cut).rasterize())
            .collect();
        let undecided = undecided([&drawn[3], &drawn[0], &drawn[4]]);
        let is_sorted = is_order_decided(of_device.0, &camera);
        let (error, flipped) = picture(&image, &drawn[0], &drawn[1], &undecided);
        outcome.flipped = flipped.iter().filter(|f| **f).count() as f64 / flipped.len() as f64;
        outcome.undecided = !is_sorted;
        // Where products overflow, a Gaussian may be drawn or not.
        if is_sorted && self.hand.kind != HandKind::Overflow {
            outcome.roundings[1] = error;
        }

        // And back, without the pixels that rounding has decided otherwise.
        let weights: Vec<[f32; 4]> =
            weights.iter().zip(&flipped).map(|(w, flipped)| if *flipped { [0.0; 4] } else { *w }).collect();
        let d_image: Vec<[f64; 4]> = weights.iter().map(|w| w.map(f64::from)).collect();
        let gradients: Vec<Vec<Gaussian>> = twins[..2]
            .par_iter()
            .map(|(splats, camera)| twin(splats, camera, &model).rasterize_vjp(&d_image).0)
            .collect();
        let device = self.gradients(gpu, &weights, table.len())?;
        // Tables with numbers that are not finite have such gradients, too; training does not take such steps.
        let checked = if self.hand.kind.is_comparable() { device.len() } else { 1 };
        if !device[..checked].iter().all(|(_, values)| all_finite(values)) {
            outcome.problem = Some("a gradient is not finite".into());
            return Ok(outcome);
        }
        let [exact_parts, moved_parts] =
            [&gradients[0], &gradients[1]].map(|all| gradient_parts(all, thickness(&model)));
        let (_, d_table) = &device[0];
        let d_device = PosedGaussians::from_table(&widen(d_table), shape);
        let device_parts = [rows(&d_device.means), d_device.scales.clone(), rows(&d_device.colors)];
        let worst = (0..3).map(|i| roundings(&narrow(&device_parts[i]), &exact_parts[i], &moved_parts[i], 0.0));
        if !self.hand.kind.is_comparable() {
            return Ok(outcome);
        }
        if is_sorted {
            outcome.roundings[2] = Some(worst.fold(0.0, f64::max));
        }

        // From the pose, whose numbers and the hand's are moved.
        let moved_avatar = moved_avatar(&mut draw, avatar);
        let moved_pose = moved_pose(&mut draw, &pose);
        let moved_unlit = exact(&moved_avatar, &moved_pose).context("the hand has no twin")?;
        let moved_light = light.as_ref().map(|light| light.moved(&mut draw));
        let mut moved = lit(&moved_unlit, &moved_light);
        outcome.roundings[0] = Some(posed_roundings(avatar, &table, &exact_posed, &moved));
        move_depths(&mut draw, &mut moved, &camera);
        let moved_picture = twin(&moved.splats(OPACITY.into()), &moved_camera, &model).rasterize();
        // What rounding has moved past another or the near plane is drawn otherwise.
        if is_sorted && draw_order(of_device.0, &camera) == draw_order(of_exact.0, &camera) {
            outcome.roundings[4] = picture(&image, &drawn[2], &moved_picture, &undecided).0;
        }
        // Networks' gradients have no twin here: tests compare them with finite differences.
        if self.backward.is_none() || self.hand.model != StressModel::Direct || !self.hand.kind.has_gradients() {
            return Ok(outcome);
        }
        let unlit_gradient = |unlit: &PosedGaussians, light: &Option<TwinLight>, d: PosedGaussians| match light {
            Some(light) => light.light_vjp(unlit, &d),
            None => d,
        };
        let d_moved = moved_table_of(&mut draw, d_table, shape);
        let d_exact = unlit_gradient(&unlit, &light, d_device);
        let exact = all_gradients(avatar, &pose, &d_exact);
        let moved = all_gradients(&moved_avatar, &moved_pose, &unlit_gradient(&moved_unlit, &moved_light, d_moved));
        // Some parts vanish at rest: there, they need be no more exact than they are elsewhere.
        let usual = all_gradients(avatar, &usual_pose(&mut draw, &avatar.template), &d_exact);
        let parts = device[1..].iter().zip(&exact).zip(moved.iter().zip(&usual));
        let of_parts = parts.map(|(((name, got), exact), (moved, usual))| {
            (roundings(got, exact, moved, root_mean_square(usual)), name)
        });
        let worst = of_parts.max_by(|a, b| a.0.total_cmp(&b.0));
        outcome.roundings[3] = worst.map(|(roundings, _)| roundings);
        outcome.worst_table = worst.map(|(_, name)| name.clone());
        Ok(outcome)
    }

    /// The picture in a pose and a view, and the table of posed Gaussians.
    fn draw(&mut self, gpu: &Gpu, pose: &Pose, camera: &Camera) -> anyhow::Result<(Vec<[f32; 4]>, Vec<f32>)> {
        self.scene.set_pose(gpu, 0, 0, pose)?;
        self.scene.set_view(gpu, camera, BACKGROUND)?;
        self.scene.set_frame(gpu, 0);
        self.scene.run_frame(gpu, |_, _| {})?;
        let image = self.scene.splatter().read_image(gpu)?.rgba;
        let length = self.scene.splatter().options().model.rows() * self.hand.avatar.template.len();
        Ok((image, buffers::read(gpu, self.scene.splatter().gaussians(), length)?))
    }

    /// The device's gradients of a loss with these weights of the picture's values: of the Gaussians' table, of the
    /// learned tables and of the pose.
    fn gradients(&mut self, gpu: &Gpu, weights: &[[f32; 4]], length: usize) -> anyhow::Result<Vec<(String, Vec<f32>)>> {
        let (splatter, avatars) = self.scene.splatter_and_avatars_mut();
        let posed = avatars.first_mut().context("the scene has no avatar")?;
        gpu.queue.write_buffer(splatter.d_image(), 0, bytemuck::cast_slice(weights));
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        splatter.backward(&mut encoder);
        if let Some(backward) = &self.backward {
            backward.encode_point_gradients(&mut encoder);
            backward.encode_property_gradients(&mut encoder);
            posed.model.trainable_mut()?.backward(gpu, &mut encoder)?;
            backward.encode_pose_gradient(&mut encoder);
        }
        gpu.queue.submit([encoder.finish()]);
        let mut all = vec![("Gaussians".to_owned(), buffers::read(gpu, splatter.d_gaussians(), length)?)];
        if let Some(backward) = &self.backward {
            all.extend(posed.model.trainable_mut()?.parameter_gradients(gpu)?);
            let joints = self.hand.avatar.template.joint_count();
            all.push(("pose".into(), buffers::read(gpu, backward.d_pose(), 3 * joints + 3)?));
        }
        Ok(all)
    }
}

/// The twin of a picture, with this factor on the thresholds of blending.
fn twin_of<'a>(gaussians: &'a [Gaussian], camera: &'a Camera, filter: Filter, cut: f64) -> SplatTwin<'a> {
    let background = DVec3::from(BACKGROUND.map(f64::from));
    let usual = Thresholds::default();
    let [alpha_min, transmittance_min] = [usual.alpha_min, usual.transmittance_min].map(|limit| limit * cut);
    SplatTwin {
        gaussians,
        camera,
        background,
        filter,
        thresholds: Thresholds { alpha_min, transmittance_min, ..usual },
    }
}

fn twin<'a>(gaussians: &'a [Gaussian], camera: &'a Camera, model: &SplatModel) -> SplatTwin<'a> {
    twin_of(gaussians, camera, model.filter(), 1.0)
}

fn depth(gaussian: &Gaussian, camera: &Camera) -> f64 {
    camera.rotation.row(2).dot(gaussian.mean) + camera.translation.z
}

/// Whether the depths of all Gaussians differ enough, from each other and from the near plane, to sort them.
fn is_order_decided(gaussians: &[Gaussian], camera: &Camera) -> bool {
    let depths = gaussians.iter().map(|g| depth(g, camera)).filter(|depth| depth.is_finite());
    let mut depths: Vec<f64> = depths.chain([f64::from(NEAR)]).collect();
    depths.sort_by(f64::total_cmp);
    // A sum's terms may be larger than the sum.
    let size = |depth: f64| depth.abs().max(camera.translation.length()) as f32;
    let unit = |depth: f64| f64::from(size(depth).next_up() - size(depth));
    depths.array_windows().all(|[near, far]| far - near > ORDER_UNITS * unit(*far))
}

/// Which Gaussians are before the near plane, the nearest first.
fn draw_order(gaussians: &[Gaussian], camera: &Camera) -> Vec<usize> {
    let depths: Vec<f64> = gaussians.iter().map(|g| depth(g, camera)).collect();
    let mut order: Vec<usize> = (0..depths.len()).filter(|i| depths[*i] >= f64::from(NEAR)).collect();
    order.sort_by(|a, b| depths[*a].total_cmp(&depths[*b]));
    order
}

/// How thick Gaussians are, as a part of their width.
fn thickness(model: &SplatModel) -> f64 {
    use ghand_render::splat::{FLATNESS, Shape};
    if model.shape == Shape::Flat { FLATNESS } else { 1.0 }
}

/// Gradients of centres, sizes and colours.
fn gradient_parts(gradient: &[Gaussian], thickness: f64) -> [Vec<f64>; 3] {
    let means: Vec<DVec3> = gradient.iter().map(|d| d.mean).collect();
    let colors: Vec<DVec3> = gradient.iter().filter_map(|d| d.coefficients().first().copied()).collect();
    let size = |d: &Gaussian| d.scales.x + d.scales.y + thickness * d.scales.z;
    [rows(&means), gradient.iter().map(size).collect(), rows(&colors)]
}

fn narrow(values: &[f64]) -> Vec<f32> {
    values.iter().map(|v| *v as f32).collect()
}

/// Roundings of the posed Gaussians' parts, the worst.
fn posed_roundings(avatar: &Avatar, table: &[f32], exact: &PosedGaussians, moved: &PosedGaussians) -> f64 {
    let got = PosedGaussians::from_table(&widen(table), avatar.config.gaussians);
    let normals = |g: &PosedGaussians| g.normals.as_deref().map(rows).unwrap_or_default();
    let of = |got: &[f64], exact: &[f64], moved: &[f64], least: f64| roundings(&narrow(got), exact, moved, least);
    [
        of(&rows(&got.means), &rows(&exact.means), &rows(&moved.means), 0.0),
        of(&got.scales, &exact.scales, &moved.scales, avatar.max_scale().into()),
        of(&normals(&got), &normals(exact), &normals(moved), 1.0),
        of(&rows(&got.colors), &rows(&exact.colors), &rows(&moved.colors), 1.0),
    ]
    .into_iter()
    .fold(0.0, f64::max)
}

/// Gradients in the order of the device's.
fn all_gradients(avatar: &Avatar, pose: &Pose, d: &PosedGaussians) -> Vec<Vec<f64>> {
    let gradients = DirectTwin::new(avatar).map(|twin| twin.gradients(pose, &twin.pose(pose), d, [0.0; 2]));
    gradients.map_or(vec![], |g| g.tables.into_iter().map(|(_, d)| d).chain([g.pose]).collect())
}

/// Largest distance between the centres of two hands, as a part of the extent of the first, and difference of colours.
fn packing(full: &PosedGaussians, packed: &PosedGaussians) -> [f64; 2] {
    let largest = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    let first = full.means.first().copied().unwrap_or(DVec3::ZERO);
    let extent = full.means.iter().map(|mean| mean.distance(first)).fold(f64::MIN_POSITIVE, f64::max);
    [largest(&full.means, &packed.means) / extent, largest(&full.colors, &packed.colors)]
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

fn moved_number(draw: &mut Sampler, value: f64) -> f64 {
    move_by_one(value as f32, draw.chance(0.5)).into()
}

fn moved_vector(draw: &mut Sampler, v: DVec3) -> DVec3 {
    DVec3::from(v.to_array().map(|x| moved_number(draw, x)))
}

fn move_camera(draw: &mut Sampler, camera: &mut Camera) {
    camera.translation = moved_vector(draw, camera.translation);
    for column in [&mut camera.rotation.x_axis, &mut camera.rotation.y_axis, &mut camera.rotation.z_axis] {
        *column = moved_vector(draw, *column);
    }
    camera.focal.x = moved_number(draw, camera.focal.x);
    camera.focal.y = moved_number(draw, camera.focal.y);
    camera.principal.x = moved_number(draw, camera.principal.x);
    camera.principal.y = moved_number(draw, camera.principal.y);
}

fn moved_pose(draw: &mut Sampler, pose: &Pose) -> Pose {
    Pose {
        rotations: pose.rotations.iter().map(|v| moved_vector(draw, *v)).collect(),
        translation: moved_vector(draw, pose.translation),
    }
}

/// Moves the Gaussians along the line of sight by one unit in the last place of their depth, by which they are sorted.
fn move_depths(draw: &mut Sampler, gaussians: &mut PosedGaussians, camera: &Camera) {
    let forward = camera.rotation.row(2);
    for mean in &mut gaussians.means {
        let depth = forward.dot(*mean) + camera.translation.z;
        *mean += forward * (moved_number(draw, depth) - f64::from(depth as f32));
    }
}

fn moved_table_of(draw: &mut Sampler, table: &[f32], shape: GaussianShape) -> PosedGaussians {
    let moved: Vec<f64> = table.iter().map(|v| moved_number(draw, f64::from(*v))).collect();
    PosedGaussians::from_table(&moved, shape)
}

/// The hand with every number moved; of a baked one, whose numbers are packed, the joints.
fn moved_avatar(draw: &mut Sampler, avatar: &Avatar) -> Avatar {
    let mut moved = avatar.clone();
    let mut all = |values: &mut Vec<f32>| values.iter_mut().for_each(|v| *v = move_by_one(*v, draw.chance(0.5)));
    all(&mut moved.template.rest);
    all(&mut moved.template.weights);
    match &mut moved.tables {
        PropertyTables::Direct(tables) => {
            all(&mut tables.shape_basis);
            all(&mut tables.residual_weights);
            all(&mut tables.regressor);
            all(&mut tables.appearance);
            all(&mut tables.response);
        }
        PropertyTables::Network(tables) => {
            tables.parameters.iter_mut().chain(tables.running_norms.iter_mut().flatten()).for_each(&mut all);
            all(&mut tables.base_shape_basis);
            all(&mut tables.base_logits);
        }
        PropertyTables::Baked(_) => {}
    }
    moved.template.joints.iter_mut().for_each(|joint| *joint = moved_vector(draw, *joint));
    moved
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use ghand_render::AdapterChoice;

    use super::*;

    #[test]
    fn a_lit_hand_is_compared_with_its_own_light() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let is_glossy = |hand: &StressHand| hand.avatar.light.as_ref().is_some_and(|light| light.gloss.is_some());
        let hand = (0..).map(|number| StressHand::draw(&gpu, 2, number).unwrap()).find(is_glossy).unwrap();
        let avatar = &hand.avatar;
        let mut draw = Sampler::new(0, 0);
        let pose = PoseKind::Usual.draw(&mut draw, &avatar.template);
        let unlit = exact(avatar, &pose).unwrap();
        let camera = ViewKind::Usual.draw(&mut draw, &unlit);
        let (_, table) = StressSubject::new(&gpu, &hand).unwrap().draw(&gpu, &pose, &camera).unwrap();
        let light = TwinLight::of(avatar, &pose, camera.center()).unwrap().unwrap();
        let lit = light.light(&unlit);
        let moved = light.moved(&mut draw).light(&unlit);
        let off = |exact: &PosedGaussians| posed_roundings(avatar, &table, exact, &moved);
        assert!(off(&lit) < BOUNDS[0], "{}", off(&lit));
        // Moved as little as possible: the moved numbers of the right light would pass for what rounding does to the wrong one.
        let wrong = posed_roundings(avatar, &table, &unlit, &unlit);
        assert!(wrong > BOUNDS[0], "nothing is compared: {wrong}");
    }

    #[cfg(feature = "networks")]
    #[test]
    fn a_hand_of_networks_is_compared_with_its_twin() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        // The hand of cases 2250 to 2299 of this seed.
        let hand = StressHand::draw(&gpu, 1, 45).unwrap();
        assert_eq!(hand.model, StressModel::Network);
        let mut subject = StressSubject::new(&gpu, &hand).unwrap();
        for number in 2250..2260 {
            let outcome = subject.run(&gpu, 1, number).unwrap();
            assert_eq!(outcome.problem, None);
            let roundings = outcome.roundings[0].unwrap();
            assert!(0.0 < roundings && roundings < BOUNDS[0], "{roundings}");
        }
    }
}
