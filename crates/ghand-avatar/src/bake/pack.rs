//! Chooses blocks, fits the groups with them, and stores the result.

use crate::deform::baked::{BakedTables, Entry, GROUP, Group, Precision, VALUES};
use half::f16;
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::EQUAL_ERRORS;
use super::components::JointComponents;
use super::order::Ordered;
use super::sums::{GroupSums, Regressors, solve};
use crate::template::Template;

/// What a component changes of a group.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    /// The group.
    pub group: usize,
    /// Which of the group's regressors, from 1.
    pub regressor: usize,
    /// Mean square of what it changes.
    change: f64,
}

/// All blocks, those that change the hand most first.
pub fn blocks(groups: &[GroupSums]) -> Vec<Block> {
    let of_group = |(g, sums): (usize, &GroupSums)| {
        let solution = solve(&sums.gram, &sums.right);
        let change = |regressor: usize| {
            let row = solution.row(regressor);
            row.iter().enumerate().map(|(column, v)| (v / EQUAL_ERRORS[column % VALUES]).powi(2)).sum::<f64>()
        };
        (1..sums.gram.nrows()).map(|regressor| Block { group: g, regressor, change: change(regressor) }).collect()
    };
    let nested: Vec<Vec<Block>> = groups.par_iter().enumerate().map(of_group).collect();
    let mut all: Vec<Block> = nested.into_iter().flatten().filter(|block| block.change > 0.0).collect();
    all.sort_by(|a, b| b.change.total_cmp(&a.change).then((a.group, a.regressor).cmp(&(b.group, b.regressor))));
    all
}

/// What is packed.
pub struct PackInputs<'a> {
    pub template: &'a Template,
    pub ordered: &'a Ordered,
    pub regressors: &'a Regressors,
    pub components: &'a JointComponents,
    pub groups: &'a [GroupSums],
}

/// The tables with these blocks.
pub fn pack(parts: &PackInputs<'_>, kept: &[Block], precision: Precision) -> BakedTables {
    let mut of_group: Vec<Vec<usize>> = vec![vec![]; parts.groups.len()];
    kept.iter().for_each(|block| of_group[block.group].push(block.regressor));
    of_group.iter_mut().for_each(|regressors| regressors.sort_unstable());
    let solutions: Vec<DMatrix<f64>> =
        parts.groups.par_iter().zip(&of_group).map(|(sums, kept)| fit(sums, kept)).collect();

    let count = parts.ordered.order.len();
    let mean = |p: usize, value: usize| solutions[p / GROUP][(0, p % GROUP * VALUES + value)];
    let normals = parts.template.normals.as_deref();
    let normal = |p: usize, c: usize| normals.map_or(0.0, |n| f64::from(n[c * count + parts.ordered.order[p]]));
    let range = |value: usize| {
        let values = (0..count).map(|p| mean(p, value));
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
    };
    let ranges = [range(0), range(1), range(2)];
    let bounds = [ranges.map(|r| r[0] as f32), ranges.map(|r| (r[1] - r[0]) as f32)];
    let max_scale = (range(3)[1] as f32).max(f32::MIN_POSITIVE);
    let means = means(precision, count, bounds, max_scale, &mean, &normal);

    let mut tables = BakedTables {
        precision,
        count,
        joint_count: parts.template.joint_count(),
        normals: normals.is_some(),
        bounds,
        max_scale,
        components: vec![],
        bends: parts.regressors.bends.iter().map(|bend| bend.map(|u| u as f32)).collect(),
        groups: vec![],
        group_joints: vec![],
        entries: vec![],
        means,
        weights: vec![],
        values: vec![],
    };
    let mut numbers: Vec<Option<u32>> = vec![None; parts.regressors.joints() * super::MOST_COMPONENTS];
    for (g, (sums, kept)) in parts.groups.iter().zip(&of_group).enumerate() {
        let first_entry = tables.entries.len() as u32;
        for (row, regressor) in kept.iter().enumerate() {
            let (joint, index) = component_of(sums, *regressor);
            let number = *numbers[joint * super::MOST_COMPONENTS + index].get_or_insert_with(|| {
                tables.components.push(parts.components.component(parts.regressors, joint, index));
                tables.components.len() as u32 - 1
            });
            let values: Vec<f64> = solutions[g].row(row + 1).iter().copied().collect();
            let factors = store_values(precision, &values, &mut tables.values);
            tables.entries.push(Entry { component: number, factors });
        }
        let first_joint = tables.group_joints.len() as u32;
        store_weights(&parts.ordered.groups[g], &parts.ordered.weights, g, &mut tables);
        tables.groups.push(Group {
            first_joint,
            joints: tables.group_joints.len() as u32 - first_joint,
            first_entry,
            entries: kept.len() as u32,
        });
    }
    tables
}

/// The coefficients of the constant and of the kept regressors, a row each.
fn fit(sums: &GroupSums, kept: &[usize]) -> DMatrix<f64> {
    let rows: Vec<usize> = std::iter::once(0).chain(kept.iter().copied()).collect();
    solve(&sums.gram.select_rows(&rows).select_columns(&rows), &sums.right.select_rows(&rows))
}

/// The joint of a group's regressor, and which of its components it is.
fn component_of(sums: &GroupSums, regressor: usize) -> (usize, usize) {
    let mut index = regressor - 1;
    for (joint, count) in &sums.joints {
        if index < *count {
            return (*joint, index);
        }
        index -= count;
    }
    (0, 0)
}

fn unorm16(value: f64) -> u32 {
    (value.clamp(0.0, 1.0) * 65_535.0).round() as u32
}

fn snorm8(value: f64) -> u32 {
    u32::from((value.clamp(-1.0, 1.0) * 127.0).round() as i8 as u8)
}

fn bytes(values: [u32; 4]) -> u32 {
    values.iter().rev().fold(0, |word, value| word << 8 | value)
}

/// The words of the means, `[mean words][N]`.
fn means(
    precision: Precision,
    count: usize,
    [corner, size]: [[f32; 3]; 2],
    max_scale: f32,
    mean: &dyn Fn(usize, usize) -> f64,
    normal: &dyn Fn(usize, usize) -> f64,
) -> Vec<u32> {
    let mut words = vec![0; precision.mean_words() * count];
    for p in 0..count {
        let mut set = |row: usize, word: u32| words[row * count + p] = word;
        if precision == Precision::F32 {
            (0..VALUES).for_each(|value| set(value, (mean(p, value) as f32).to_bits()));
            (0..3).for_each(|c| set(VALUES + c, (normal(p, c) as f32).to_bits()));
            continue;
        }
        let at = |c: usize| {
            let width = f64::from(size[c]);
            unorm16(if width > 0.0 { (mean(p, c) - f64::from(corner[c])) / width } else { 0.0 })
        };
        set(0, at(0) | at(1) << 16);
        set(1, at(2) | unorm16(mean(p, 3) / f64::from(max_scale)) << 16);
        let color = |c: usize| (mean(p, 4 + c).clamp(0.0, 1.0) * 255.0).round() as u32;
        set(2, bytes([color(0), color(1), color(2), 0]));
        set(3, bytes([snorm8(normal(p, 0)), snorm8(normal(p, 1)), snorm8(normal(p, 2)), 0]));
    }
    words
}

/// Which of the three factors a value has.
const FACTOR_OF: [usize; VALUES] = [0, 0, 0, 1, 2, 2, 2];

/// Adds the words of a block's values, and gives their factors.
fn store_values(precision: Precision, values: &[f64], out: &mut Vec<u32>) -> [f32; 3] {
    let mut factors = [0.0f64; 3];
    for (column, value) in values.iter().enumerate() {
        let factor = &mut factors[FACTOR_OF[column % VALUES]];
        *factor = factor.max(value.abs());
    }
    let factors = match precision {
        Precision::F32 => [1.0; 3],
        // Half precision would lose offsets, which are below a millimetre.
        // A factor that f32 cannot hold, or that a device takes for 0, would make infinities of what is divided by it.
        Precision::F16 | Precision::U8 => factors.map(|factor| {
            let factor = factor as f32;
            if factor >= f32::MIN_POSITIVE { factor } else { 1.0 }
        }),
    };
    let stored = |lane: usize, value: usize| match value {
        VALUES.. => 0.0,
        _ => values[lane * VALUES + value] / f64::from(factors[FACTOR_OF[value]]),
    };
    let half = |v: f64| u32::from(f16::from_f64(v).to_bits());
    for word in 0..precision.value_words() {
        out.extend((0..GROUP).map(|lane| match precision {
            Precision::F32 => (stored(lane, word) as f32).to_bits(),
            Precision::F16 => half(stored(lane, 2 * word)) | half(stored(lane, 2 * word + 1)) << 16,
            Precision::U8 => bytes(std::array::from_fn(|i| snorm8(stored(lane, 4 * word + i)))),
        }));
    }
    factors
}

/// Adds the joints of a group, two by two, and their weights.
fn store_weights(joints: &[usize], weights: &[Vec<(usize, u16)>], group: usize, tables: &mut BakedTables) {
    let weight = |lane: usize, joint: Option<&usize>| -> u32 {
        let of = weights.get(group * GROUP + lane).into_iter().flatten();
        of.filter(|(k, _)| Some(k) == joint).map(|(_, w)| u32::from(*w)).sum()
    };
    for pair in joints.chunks(2) {
        tables.group_joints.extend([pair[0], *pair.last().unwrap_or(&pair[0])].map(|k| k as u32));
        let second = pair.get(1);
        tables.weights.extend((0..GROUP).map(|lane| weight(lane, pair.first()) | weight(lane, second) << 16));
    }
}
