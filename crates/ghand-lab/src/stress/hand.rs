//! Hands with something extreme about each.

use ghand_avatar::deform::baked::Precision;
use ghand_avatar::properties::direct::{DirectTables, no_limits, table_lengths};
use ghand_avatar::properties::network::{Activation, Normalization};
use ghand_avatar::{Avatar, AvatarConfig, Bake, GaussianShape, NetworkSizes, PropertyTables, Provenance, Template};
use ghand_core::blend_shapes::CoefficientLayout;
use ghand_core::posing::shape_hand;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_core::{HandModel, Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_render::Gpu;
use glam::DVec3;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::light;

/// What is extreme about a hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HandKind {
    /// Nothing.
    Usual,
    /// The built-in hand in a shape up to ten standard deviations from the mean.
    Human,
    /// The same with light apart from its skin.
    Lit,
    /// One joint.
    OneJoint,
    /// 25 joints in one chain.
    LongChain,
    /// Micrometres.
    Tiny,
    /// A hundred metres.
    Huge,
    /// All Gaussians in one place.
    OnePlace,
    /// Each Gaussian follows one joint.
    OneHot,
    /// Skinning weights that do not sum to 1.
    NotNormalised,
    /// Offsets of metres.
    LargeOffsets,
    /// Residual weights and joints larger than the hand's own.
    LargeResiduals,
    /// Properties that change a hundred times faster with the pose, without limits.
    SteepResponse,
    /// Colours and sizes at the ends of their ranges.
    Saturated,
    /// Some numbers that are not finite.
    NotFinite,
    /// Numbers near the largest of f32.
    Overflow,
}

/// The kinds that are drawn; some of the built-in hands are lit.
pub const HANDS: [HandKind; 15] = {
    use HandKind::*;
    [
        Usual,
        Human,
        OneJoint,
        LongChain,
        Tiny,
        Huge,
        OnePlace,
        OneHot,
        NotNormalised,
        LargeOffsets,
        LargeResiduals,
        SteepResponse,
        Saturated,
        NotFinite,
        Overflow,
    ]
};

impl HandKind {
    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            HandKind::Usual => "usual",
            HandKind::Human => "built-in, shape to 10 sd",
            HandKind::Lit => "built-in, lit",
            HandKind::OneJoint => "one joint",
            HandKind::LongChain => "25 joints in a chain",
            HandKind::Tiny => "micrometres",
            HandKind::Huge => "a hundred metres",
            HandKind::OnePlace => "all in one place",
            HandKind::OneHot => "one-hot weights",
            HandKind::NotNormalised => "weights not normalised",
            HandKind::LargeOffsets => "offsets of metres",
            HandKind::LargeResiduals => "large residual terms",
            HandKind::SteepResponse => "steep response",
            HandKind::Saturated => "saturated",
            HandKind::NotFinite => "not finite",
            HandKind::Overflow => "overflow",
        }
    }

    /// Whether f32 can hold what the exact numbers are.
    pub fn is_comparable(self) -> bool {
        !matches!(self, HandKind::NotFinite | HandKind::Overflow)
    }

    /// Whether gradients of tables and pose can be compared: those of saturated numbers vanish, and the device's are those of
    /// weights that sum to 1, as a hand model's do.
    pub fn has_gradients(self) -> bool {
        self.is_comparable() && !matches!(self, HandKind::Saturated | HandKind::NotNormalised)
    }

    /// Size of a hand, metres.
    fn size(self) -> f32 {
        match self {
            HandKind::Tiny => 1e-6,
            HandKind::Huge => 100.0,
            _ => 0.1,
        }
    }
}

/// How a hand's properties are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StressModel {
    /// By tables.
    Direct,
    /// By networks.
    Network,
    /// Baked.
    Baked(Precision),
}

impl StressModel {
    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            StressModel::Direct => "direct",
            StressModel::Network => "network",
            StressModel::Baked(Precision::F32) => "baked, f32",
            StressModel::Baked(Precision::F16) => "baked, f16",
            StressModel::Baked(Precision::U8) => "baked, u8",
        }
    }
}

/// A hand.
pub struct StressHand {
    /// What is extreme about it.
    pub kind: HandKind,
    /// How its properties are computed.
    pub model: StressModel,
    /// The hand.
    pub avatar: Avatar,
    /// The same baked in f32, if it is baked in fewer bits.
    pub full: Option<Avatar>,
}

/// Most Gaussians of a hand.
const MOST_GAUSSIANS: usize = 120;
/// UV resolution of the built-in hand: some hundred Gaussians.
const HUMAN_RESOLUTION: u32 = 16;
/// Poses over which a hand is baked.
const BAKED_POSES: usize = 36;

/// Numbers from a seed.
pub struct Sampler(pub ChaCha8Rng);

impl Sampler {
    /// The numbers of one of many things.
    pub fn new(seed: u64, stream: u64) -> Sampler {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Sampler(rng)
    }

    /// `count` numbers in -size..size.
    pub fn numbers(&mut self, count: usize, size: f32) -> Vec<f32> {
        (0..count).map(|_| self.0.random_range(-1.0..1.0f32) * size).collect()
    }

    /// A vector in the cube of this half edge, rounded to f32.
    pub fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::from([0; 3].map(|_| f64::from(self.0.random_range(-1.0..1.0f32)) * size)).as_vec3().as_dvec3()
    }

    /// One of some things.
    pub fn one<T: Copy>(&mut self, of: &[T]) -> T {
        *of.choose(&mut self.0).unwrap_or_else(|| unreachable!("there is a choice"))
    }

    /// Whether something of this probability happens.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.0.random_bool(probability)
    }

    /// A number between two, even in its logarithm.
    pub fn log(&mut self, from: f64, to: f64) -> f64 {
        (self.0.random_range(0.0..1.0) * (to / from).ln()).exp() * from
    }
}

impl StressHand {
    /// The hand of this number.
    ///
    /// # Errors
    /// If the built-in hand cannot be sampled or the device failed while baking.
    pub fn draw(gpu: &Gpu, seed: u64, number: u64) -> anyhow::Result<StressHand> {
        let mut draw = Sampler::new(seed, 2 * number);
        let kind = draw.one(&HANDS);
        let config = config(&mut draw);
        let mut avatar = match kind {
            HandKind::Human => human(&mut draw, &config)?,
            _ => {
                let count = draw.0.random_range(1..=MOST_GAUSSIANS);
                random(&mut draw, kind, &config, count)
            }
        };
        set_tables(&mut draw, kind, &mut avatar);
        // With numbers of their own, so that all else is the same with and without light, with tables and with networks.
        let mut of_light = Sampler::new(!seed, 2 * number);
        let kind = match kind {
            HandKind::Human if of_light.chance(0.5) => {
                avatar.light = Some(light::draw(&mut of_light, &avatar)?);
                HandKind::Lit
            }
            other => other,
        };
        let mut model = StressModel::Direct;
        if matches!(kind, HandKind::Human | HandKind::Lit) && of_light.chance(0.4) && cfg!(feature = "networks") {
            avatar = network(&mut of_light, &avatar)?;
            model = StressModel::Network;
        }
        let baked = kind.is_comparable() && draw.chance(0.3);
        if !baked {
            return Ok(StressHand { kind, model, avatar, full: None });
        }
        let poses: Vec<Pose> = (0..BAKED_POSES).map(|_| usual_pose(&mut draw, &avatar.template)).collect();
        let precision = draw.one(&[Precision::F32, Precision::F16, Precision::U8]);
        let bake = Bake::new(gpu, &avatar, &poses, 3, |_| ())?;
        let baked = |precision: Precision| bake.avatar(bake.blocks(), precision);
        let full = (precision != Precision::F32).then(|| baked(Precision::F32));
        Ok(StressHand { kind, model: StressModel::Baked(precision), avatar: baked(precision), full })
    }
}

/// A pose such as a hand takes.
pub fn usual_pose(draw: &mut Sampler, template: &Template) -> Pose {
    let size = f64::from(template.mean_spacing()).min(1.0);
    Pose { rotations: template.joints.iter().map(|_| draw.vector(0.9)).collect(), translation: draw.vector(size) }
}

fn config(draw: &mut Sampler) -> AvatarConfig {
    AvatarConfig {
        uv_resolution: HUMAN_RESOLUTION,
        shape_bases: draw.one(&[1, 2, 4]),
        coefficients: draw.one(&[CoefficientLayout::PerBasis, CoefficientLayout::PerComponent]),
        color_components: draw.one(&[0, 1, 3]),
        residual_weights: draw.one(&[ResidualWeights::Paper, ResidualWeights::ZeroSum]),
        residual_skeleton: draw.one(&[ResidualSkeleton::Paper, ResidualSkeleton::Anchored]),
        plain_skinning: draw.chance(0.3),
        gaussians: draw.one(&[GaussianShape::Round, GaussianShape::Flat]),
        antialias: draw.chance(0.5),
        narrow_blur: true,
        ..AvatarConfig::default()
    }
}

/// The built-in hand in a shape, its joints rounded as the device rounds them.
fn human(draw: &mut Sampler, config: &AvatarConfig) -> anyhow::Result<Avatar> {
    let side = draw.one(&[Side::Left, Side::Right]);
    let model = builtin_hand(side)?;
    let size = draw.one(&[1.0, 10.0]);
    let shape: Vec<f64> = draw.numbers(model.shape_count(), size).into_iter().map(f64::from).collect();
    let shaped = shape_hand(&model, &shape)?;
    let model = HandModel { vertices: shaped.vertices, joints: shaped.joints, ..model.without_blend_shapes() };
    let mut avatar = Avatar::untrained(&model, config, [0.8, 0.5, 0.4], 0)?;
    avatar.template.joints.iter_mut().for_each(|joint| *joint = joint.as_vec3().as_dvec3());
    Ok(avatar)
}

/// A hand with networks instead of tables, small ones.
fn network(draw: &mut Sampler, avatar: &Avatar) -> anyhow::Result<Avatar> {
    let normalization = draw.one(&[Normalization::Instance, Normalization::Batch]);
    let sizes = NetworkSizes {
        map_side: 32,
        encoder_channels: 2,
        feature_channels: 3,
        tensor_channels: 2,
        hidden: 8,
        normalization,
        activation: draw.one(&[Activation::Relu, Activation::Softplus]),
        own_colors: draw.chance(0.5),
    };
    let config = AvatarConfig { network: Some(sizes), plain_skinning: false, ..avatar.config.clone() };
    let with_networks = Avatar::untrained(&avatar.model, &config, [0.8, 0.5, 0.4], 0)?;
    // With larger ones, residual weights are in the thousands.
    let mut tables = with_networks.tables;
    let size = draw.one(&[0.1, 0.3]);
    if let PropertyTables::Network(tables) = &mut tables {
        for values in &mut tables.parameters {
            let noise = draw.numbers(values.len(), size);
            values.iter_mut().zip(noise).for_each(|(value, noise)| *value += noise);
        }
        for [means, variances] in &mut tables.running_norms {
            means.iter_mut().for_each(|mean| *mean = draw.0.random_range(-0.3..0.3));
            variances.iter_mut().for_each(|variance| *variance = draw.log(0.3, 3.0) as f32);
        }
    }
    Ok(Avatar { tables, config, ..avatar.clone() })
}

/// A hand of random numbers.
fn random(draw: &mut Sampler, kind: HandKind, config: &AvatarConfig, count: usize) -> Avatar {
    let joint_count = match kind {
        HandKind::OneJoint => 1,
        HandKind::LongChain => 25,
        _ => draw.0.random_range(1..=25),
    };
    let parents = (0..joint_count)
        .map(|k: usize| match (k, kind) {
            (0, _) => None,
            (_, HandKind::LongChain) => Some(k - 1),
            _ => Some(draw.0.random_range(0..k)),
        })
        .collect();
    let size = kind.size();
    let rest = match kind {
        HandKind::OnePlace => draw.numbers(3, size).iter().flat_map(|c| vec![*c; count]).collect(),
        _ => draw.numbers(3 * count, size),
    };
    let mut weights: Vec<f32> = draw.numbers(joint_count * count, 1.0).iter().map(|w| w.abs()).collect();
    for p in 0..count {
        let own = draw.0.random_range(0..joint_count);
        let sum: f32 = (0..joint_count).map(|k| weights[k * count + p]).sum();
        for k in 0..joint_count {
            let weight = &mut weights[k * count + p];
            match kind {
                HandKind::OneHot => *weight = f32::from(u8::from(k == own)),
                HandKind::NotNormalised => *weight = 3.0 * *weight - 0.5,
                _ => *weight /= sum,
            }
        }
    }
    let normals: Vec<DVec3> = (0..count).map(|_| draw.vector(1.0).try_normalize().unwrap_or(DVec3::X)).collect();
    let normals = (0..3).flat_map(|c| normals.iter().map(move |n| n[c] as f32)).collect();
    let spacing = draw.0.random_range(0.003..0.5) * size;
    let model = builtin_hand(Side::Right).map(|model| model.without_blend_shapes());
    Avatar {
        template: Template {
            name: kind.name().into(),
            side: Side::Right,
            joint_names: (0..joint_count).map(|k| format!("joint{k}")).collect(),
            parents,
            joints: (0..joint_count).map(|_| draw.vector(size.into())).collect(),
            rest,
            weights,
            spacings: vec![spacing; count],
            normals: (config.gaussians == GaussianShape::Flat).then_some(normals),
        },
        model: model.unwrap_or_else(|e| unreachable!("the built-in hand is valid: {e}")),
        config: config.clone(),
        // Replaced by those of the kind.
        tables: PropertyTables::Direct(DirectTables {
            shape_basis: vec![],
            residual_weights: vec![],
            regressor: vec![],
            appearance: vec![],
            response: vec![],
            response_limits: vec![],
        }),
        light: None,
        seen: None,
        tracker: None,
        provenance: Provenance::default(),
    }
}

fn set_tables(draw: &mut Sampler, kind: HandKind, avatar: &mut Avatar) {
    let template = &avatar.template;
    let config = &avatar.config;
    let lengths = table_lengths(template.len(), template.joint_count(), config);
    let size = kind.size();
    let offset = if kind == HandKind::LargeOffsets { 10.0 } else { 0.1 * size };
    let [residual_weight, regressor] = if kind == HandKind::LargeResiduals { [10.0, 10.0] } else { [0.2, 0.05] };
    let logit = if kind == HandKind::Saturated { draw.one(&[15.0, 100.0, 1e4]) } else { 3.0 };
    let (gain, limited) = match kind {
        HandKind::SteepResponse => (100.0, false),
        _ => (0.8, draw.chance(0.5)),
    };
    let mut tables = DirectTables {
        shape_basis: draw.numbers(lengths[0], offset),
        residual_weights: draw.numbers(lengths[1], residual_weight),
        regressor: draw.numbers(lengths[2], regressor),
        appearance: draw.numbers(lengths[3], logit),
        response: draw.numbers(lengths[4], gain),
        response_limits: no_limits(lengths[5] / 2),
    };
    if limited {
        tables.response_limits = (0..lengths[5] / 2)
            .flat_map(|_| [-draw.0.random_range(0.0..0.5f32), draw.0.random_range(0.0..0.5f32)])
            .collect();
    }
    match kind {
        HandKind::NotFinite => spoil(draw, &mut tables, &[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]),
        HandKind::Overflow => spoil(draw, &mut tables, &[1e30, -1e38, f32::MAX, f32::MIN, 1e20, 1e-38, 1e-45]),
        _ => {}
    }
    avatar.tables = PropertyTables::Direct(tables);
}

/// Sets some numbers of one of the tables to one of these.
fn spoil(draw: &mut Sampler, tables: &mut DirectTables, values: &[f32]) {
    let all = [
        &mut tables.shape_basis,
        &mut tables.residual_weights,
        &mut tables.regressor,
        &mut tables.appearance,
        &mut tables.response,
    ];
    let which = draw.0.random_range(0..all.len());
    for table in all.into_iter().skip(which).take(1) {
        for _ in 0..draw.0.random_range(1..=3) {
            if !table.is_empty() {
                let at = draw.0.random_range(0..table.len());
                table[at] = draw.one(values);
            }
        }
    }
}
