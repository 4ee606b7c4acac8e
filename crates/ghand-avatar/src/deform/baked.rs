//! A baked hand: means and few local components instead of properties. Host part of `baked.wgsl`.
//!
//! What a pose changes of a Gaussian (its offset before skinning, its size, its colour) is a mean plus a few components.
//! A component is a number that depends on the rotation of one joint, and perhaps on the bend of another, in a small closed
//! form within limits. Gaussians lie in groups of [`GROUP`], ordered so that those of a group are moved by the same few
//! joints; a group has values only of the components that change it.

use bytemuck::{Pod, Zeroable};

use super::{ForwardBuffers, Properties, TablePlace};
use ghand_render::pipeline::{Bound, Module};
use ghand_render::splat::{Shape, SplatModel};
use ghand_render::stages::{BakedPose, BakedPoseBindings, BakedTerms, BakedTermsBindings};
use ghand_render::{Gpu, buffers};

/// Gaussians of a group.
pub const GROUP: usize = 64;
/// Invocations of a group, each for four Gaussians.
const INVOCATIONS: u32 = GROUP as u32 / 4;
/// Values of an entry for a Gaussian: offset (3), standard deviation, colour (3).
pub const VALUES: usize = 7;
/// Smallest standard deviation of a posed Gaussian, metres.
pub const SMALLEST_SCALE: f64 = 1e-6;

/// How a baked hand's numbers are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// All in f32.
    F32,
    /// Values of components in f16; means in 16 bits (position, size) and 8 bits (colour, normal).
    F16,
    /// Values of components in 8 bits, with a factor for each group and component; means as with f16.
    U8,
}

impl Precision {
    /// Words of an entry's values for a Gaussian.
    pub fn value_words(self) -> usize {
        match self {
            Precision::F32 => VALUES,
            Precision::F16 => 4,
            Precision::U8 => 2,
        }
    }

    /// Words of a Gaussian's mean: position, standard deviation, colour, normal.
    pub fn mean_words(self) -> usize {
        match self {
            Precision::F32 => 10,
            Precision::F16 | Precision::U8 => 4,
        }
    }
}

/// The rows of the colour among the words of a mean, as three floats and packed into one.
const COLOR_ROW: usize = 4;
const PACKED_COLOR_ROW: usize = 2;

/// A number that depends on the pose: `clamp(gains . vec(R_joint - I) + product * bend_joint * bend_other, limits)` with
/// `bend_k = bends_k . vec(R_k - I)`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Component {
    /// The joint, a whole number.
    pub joint: f32,
    /// The joint whose bend the product has, a whole number.
    pub other: f32,
    /// Least and largest value.
    pub limits: [f32; 2],
    /// Gain of the product.
    pub product: f32,
    /// Gains of the entries of `vec(R - I)`, row by row.
    pub gains: [f32; 9],
}

/// A group of Gaussians: where its joints and its entries are in the tables.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct Group {
    /// First of its joints, an even number.
    pub first_joint: u32,
    /// Number of its joints, even: one without weights may be added.
    pub joints: u32,
    /// First of its entries.
    pub first_entry: u32,
    /// Number of its entries.
    pub entries: u32,
}

/// A component that changes a group.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Entry {
    /// The component.
    pub component: u32,
    /// Factors on the stored values of offsets (metres), standard deviations (metres) and colours (display values).
    pub factors: [f32; 3],
}

/// The tables of a baked hand of N Gaussians in G groups.
#[derive(Debug, Clone, PartialEq)]
pub struct BakedTables {
    /// How numbers are stored.
    pub precision: Precision,
    /// Number of Gaussians, N.
    pub count: usize,
    /// Number of joints, `n_b`.
    pub joint_count: usize,
    /// Whether Gaussians have normals.
    pub normals: bool,
    /// Corner and size of the box that packed positions are relative to, metres.
    pub bounds: [[f32; 3]; 2],
    /// The standard deviation that packed ones are relative to, metres.
    pub max_scale: f32,
    /// The components.
    pub components: Vec<Component>,
    /// Which way each joint bends: weights of the entries of `vec(R - I)`, `n_b`.
    pub bends: Vec<[f32; 9]>,
    /// The groups, G.
    pub groups: Vec<Group>,
    /// Their joints.
    pub group_joints: Vec<u32>,
    /// Their entries.
    pub entries: Vec<Entry>,
    /// Means, `[mean words][N]`: position, standard deviation, colour, normal.
    pub means: Vec<u32>,
    /// Skinning weights of two joints in 16 bits each, [`GROUP`] words for each pair of `group_joints`.
    pub weights: Vec<u32>,
    /// Values of the entries, `[entries][value words][GROUP]`.
    pub values: Vec<u32>,
}

impl BakedTables {
    /// Gives each Gaussian a colour (display values, 0 to 1), the same in all poses.
    pub fn set_constant_colors(&mut self, colors: &[[f64; 3]]) {
        let count = self.count;
        for (p, color) in colors.iter().enumerate().take(count) {
            match self.precision {
                Precision::F32 => {
                    let rows = COLOR_ROW..COLOR_ROW + 3;
                    rows.zip(color).for_each(|(row, v)| self.means[row * count + p] = (*v as f32).to_bits());
                }
                Precision::F16 | Precision::U8 => {
                    let [r, g, b] = color.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u32);
                    self.means[PACKED_COLOR_ROW * count + p] = r | g << 8 | b << 16;
                }
            }
        }
        self.entries.iter_mut().for_each(|entry| entry.factors[2] = 0.0);
    }

    /// Fails unless the parts fit each other.
    ///
    /// # Errors
    /// The part that is wrong, and one sentence about it.
    pub fn validate(&self) -> Result<(), (&'static str, String)> {
        let check = |name: &'static str, found: usize, wanted: usize| match found == wanted {
            true => Ok(()),
            false => Err((name, format!("has {found} numbers, not {wanted}"))),
        };
        if self.count == 0 || self.joint_count == 0 {
            return Err(("groups", "there are no Gaussians or no joints".into()));
        }
        check("groups", self.groups.len(), self.count.div_ceil(GROUP))?;
        check("bends", self.bends.len(), self.joint_count)?;
        check("means", self.means.len(), self.precision.mean_words() * self.count)?;
        check("weights", self.weights.len(), self.group_joints.len() / 2 * GROUP)?;
        check("values", self.values.len(), self.entries.len() * self.precision.value_words() * GROUP)?;
        let whole = |joint: f32| joint >= 0.0 && joint.fract() == 0.0 && (joint as usize) < self.joint_count;
        for (i, c) in self.components.iter().enumerate() {
            let fits = whole(c.joint) && whole(c.other) && c.limits[0] <= c.limits[1];
            let numbers = c.gains.iter().chain(&c.limits).chain([&c.product]);
            if !fits || numbers.into_iter().any(|v| !v.is_finite()) {
                return Err(("components", format!("component {i} has a wrong joint, limit or gain")));
            }
        }
        if self.bends.iter().flatten().chain(self.bounds.as_flattened()).any(|v| !v.is_finite()) {
            return Err(("bends", "a number is not finite".into()));
        }
        if !(self.max_scale > 0.0 && self.max_scale.is_finite()) {
            return Err(("means", format!("the largest standard deviation is {}", self.max_scale)));
        }
        if self.group_joints.iter().any(|k| *k as usize >= self.joint_count) {
            return Err(("group_joints", format!("a joint is not one of {}", self.joint_count)));
        }
        let component = |e: &Entry| (e.component as usize) < self.components.len();
        if !self.entries.iter().all(|e| component(e) && e.factors.iter().all(|f| f.is_finite())) {
            return Err(("entries", "an entry has no component, or a factor that is not finite".into()));
        }
        for (i, g) in self.groups.iter().enumerate() {
            let ends =
                [(g.first_joint, g.joints, self.group_joints.len()), (g.first_entry, g.entries, self.entries.len())];
            let inside = ends.iter().all(|(first, count, len)| u64::from(*first) + u64::from(*count) <= *len as u64);
            if !inside || g.first_joint % 2 != 0 || g.joints % 2 != 0 {
                return Err(("groups", format!("group {i} has joints or entries that do not exist")));
            }
        }
        if self.precision == Precision::F32 && self.means.iter().any(|word| !f32::from_bits(*word).is_finite()) {
            return Err(("means", "a number is not finite".into()));
        }
        match self.values.iter().position(|word| !self.is_finite(*word)) {
            Some(i) => Err(("values", format!("word {i} has a number that is not finite"))),
            None => Ok(()),
        }
    }

    /// Whether the numbers in a word of values are finite.
    fn is_finite(&self, word: u32) -> bool {
        const INFINITE_HALF: u32 = 0x7c00;
        match self.precision {
            Precision::F32 => f32::from_bits(word).is_finite(),
            Precision::F16 => [word, word >> 16].iter().all(|half| half & INFINITE_HALF != INFINITE_HALF),
            Precision::U8 => true,
        }
    }

    /// Bytes of all tables.
    pub fn bytes(&self) -> usize {
        let words = self.means.len() + self.weights.len() + self.values.len() + self.group_joints.len();
        size_of::<u32>() * words
            + size_of_val(&self.components[..])
            + size_of_val(&self.bends[..])
            + size_of_val(&self.groups[..])
            + size_of_val(&self.entries[..])
    }
}

/// See `shaders/baked.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct BakedUniforms {
    /// Corner of the box that packed positions are relative to, metres.
    pub corner: [f32; 3],
    /// The standard deviation that packed ones are relative to, metres.
    pub max_scale: f32,
    /// Size of the box, metres.
    pub size: [f32; 3],
    /// Number of components.
    pub component_count: u32,
    /// Number of groups.
    pub group_count: u32,
    /// Where the groups' joints start among the layout's words.
    pub joints_start: u32,
    /// Where the entries start there.
    pub entries_start: u32,
    /// Where the weights start among the words.
    pub weights_start: u32,
    /// Where the values start there.
    pub values_start: u32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
    /// Unused.
    pub padding_3: u32,
}

/// From the posed chain to the posed Gaussians.
pub(super) struct Baked {
    terms: Bound,
    pose: Bound,
    component_count: u32,
    group_count: u32,
}

impl Baked {
    /// `lit` leaves the colours to the stage that lights them.
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, tables: &BakedTables, place: TablePlace, lit: bool) -> Baked {
        let [groups, joints] = [bytemuck::cast_slice(&tables.groups), &tables.group_joints[..]];
        let layout: Vec<u32> = [groups, joints, bytemuck::cast_slice(&tables.entries)].concat();
        let words = [&tables.means[..], &tables.weights, &tables.values].concat();
        let [corner, size] = tables.bounds;
        let uniforms = BakedUniforms {
            corner,
            max_scale: tables.max_scale,
            size,
            component_count: tables.components.len() as u32,
            group_count: tables.groups.len() as u32,
            joints_start: groups.len() as u32,
            entries_start: (groups.len() + joints.len()) as u32,
            weights_start: tables.means.len() as u32,
            values_start: (tables.means.len() + tables.weights.len()) as u32,
            padding_1: 0,
            padding_2: 0,
            padding_3: 0,
        };
        let [baked, components, bends, terms, layout_words, words] = &[
            buffers::uniform(gpu, "baked", &uniforms),
            buffers::filled(gpu, "components", &tables.components),
            buffers::filled(gpu, "bends", &tables.bends),
            buffers::zeroed(gpu, "terms", tables.components.len()),
            buffers::filled(gpu, "layout of the baked hand", &layout),
            buffers::filled(gpu, "words of the baked hand", &words),
        ];
        let ForwardBuffers { pose, poses, chain, gaussians, properties: Properties { color, .. }, .. } = b;
        let flag = |on: bool| f64::from(u8::from(on));
        let constants = [
            ("VALUE_WORDS", tables.precision.value_words() as f64),
            ("FLAT", flag(place.shape == Shape::Flat)),
            ("NORMALS", flag(tables.normals)),
            ("LIT", flag(lit)),
            ("ROW_COLOR", SplatModel { shape: place.shape, ..SplatModel::HAND }.color_row() as f64),
        ];
        let module = Module::new(gpu, "baked");
        Baked {
            terms: module
                .stage::<BakedTerms>(gpu, &[])
                .bind(gpu, &BakedTermsBindings { baked, chain, components, bends, terms }),
            pose: module.stage::<BakedPose>(gpu, &constants).bind(
                gpu,
                &BakedPoseBindings { pose, baked, chain, poses, terms, layout_words, words, gaussians, color },
            ),
            component_count: tables.components.len() as u32,
            group_count: tables.groups.len() as u32,
        }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.terms.dispatch_invocations(pass, self.component_count);
        self.pose.dispatch_invocations(pass, self.group_count * INVOCATIONS);
    }
}
