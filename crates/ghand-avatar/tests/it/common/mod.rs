//! Avatars of random numbers: every stage of the pipeline has a visible effect, and nothing cancels.

#![allow(dead_code, reason = "every test file is its own crate and uses the part that it needs")]

use ghand_avatar::properties::direct::{DirectTables, table_lengths};
use ghand_avatar::{Avatar, AvatarConfig, PropertyTables, Template};
use ghand_core::Side;
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::DVec3;
use rand::{RngExt, SeedableRng};

/// Number of Gaussians of a random avatar.
pub const COUNT: usize = 333;
/// Number of joints of a random avatar.
pub const JOINTS: usize = 7;

/// `count` numbers in -size..size.
pub fn random(seed: u64, count: usize, size: f32) -> Vec<f32> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| rng.random_range(-size..size)).collect()
}

/// Limits of joint terms: none for a quarter of them, tight ones for the others.
fn random_limits(seed: u64, length: usize) -> Vec<f32> {
    let limits = random(seed, length, 0.4);
    let one = |limit: &[f32]| match limit {
        [low, _] if *low < -0.2 => [f32::MIN, f32::MAX],
        [low, width] => [*low, low + 2.0 * width.abs()],
        _ => [0.0; 2],
    };
    limits.chunks_exact(2).flat_map(one).collect()
}

/// A random avatar; equal seeds give equal avatars.
pub fn random_avatar(seed: u64, config: &AvatarConfig) -> Avatar {
    let random = |table: u64, count: usize, size: f32| random(100 * seed + table, count, size);
    let mut weights: Vec<f32> = random(1, JOINTS * COUNT, 1.0).iter().map(|w| w.abs()).collect();
    for p in 0..COUNT {
        let sum: f32 = (0..JOINTS).map(|k| weights[k * COUNT + p]).sum();
        (0..JOINTS).for_each(|k| weights[k * COUNT + p] /= sum);
    }
    let vec3 = |v: Vec<f32>| v.chunks_exact(3).map(|c| DVec3::new(c[0].into(), c[1].into(), c[2].into())).collect();
    let template = Template {
        name: "random".into(),
        side: Side::Right,
        joint_names: (0..JOINTS).map(|k| format!("joint{k}")).collect(),
        parents: vec![None, Some(0), Some(1), Some(2), Some(0), Some(4), Some(0)],
        joints: vec3(random(2, 3 * JOINTS, 0.1)),
        rest: random(3, 3 * COUNT, 0.1),
        weights,
        spacings: vec![0.001; COUNT],
        normals: None,
    };
    let lengths = table_lengths(COUNT, JOINTS, config);
    let tables = DirectTables {
        shape_basis: random(4, lengths[0], 0.01),
        residual_weights: random(5, lengths[1], 0.2),
        regressor: random(6, lengths[2], 0.05),
        appearance: random(7, lengths[3], 1.0),
        response: random(8, lengths[4], 0.8),
        response_limits: random_limits(100 * seed + 11, lengths[5]),
    };
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    Avatar {
        template,
        model,
        config: config.clone(),
        tables: PropertyTables::Direct(tables),
        light: None,
        seen: None,
        tracker: None,
        provenance: Default::default(),
    }
}

/// The tables of a direct avatar.
pub fn tables_of(avatar: &Avatar) -> &DirectTables {
    let PropertyTables::Direct(tables) = &avatar.tables else { unreachable!() };
    tables
}
