//! Surface samples of meshes of any size, with triangles without area, and of random meshes.

use ghand_core::{HandModel, Side};
use ghand_hand_model::surface::{SurfaceSamples, sample_surface};
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::{DVec2, DVec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A wavy sheet of `cells` x `cells` quads, `size` metres wide, whose atlas fills the unit square.
fn sheet(cells: u32, size: f64, seed: u64) -> HandModel {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let side = cells + 1;
    let grid: Vec<DVec2> =
        (0..side * side).map(|i| DVec2::new(f64::from(i % side), f64::from(i / side)) / f64::from(cells)).collect();
    let vertices: Vec<DVec3> = grid.iter().map(|t| t.extend(rng.random_range(-0.1..0.1)) * size).collect();
    let faces: Vec<[u32; 3]> = (0..cells * cells)
        .map(|i| i / cells * side + i % cells)
        .flat_map(|a| [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]])
        .collect();
    let weights = grid.iter().flat_map(|t| [1.0 - t.x, t.x]).collect();
    HandModel {
        name: "sheet".into(),
        side: Side::Right,
        joint_names: vec!["root".into(), "tip".into()],
        parents: vec![None, Some(0)],
        joints: vec![DVec3::ZERO, DVec3::X * size],
        vertices,
        face_uvs: faces.clone(),
        faces,
        uvs: grid,
        weights,
        shape_directions: vec![],
        shape_names: vec![],
        pose_directions: vec![],
        joint_regressor: vec![],
        joint_directions: vec![],
        pose_space: None,
        source_vertices: vec![],
    }
}

/// Checks that hold for the samples of any mesh.
fn check(model: &HandModel, s: &SurfaceSamples) {
    let n = s.len();
    assert!(n > 0 && !s.is_empty());
    assert_eq!(
        (s.faces.len(), s.barycentric.len(), s.positions.len(), s.normals.len(), s.spacings.len()),
        (n, n, n, n, n)
    );
    assert_eq!(s.weights.len(), n * s.joint_count);
    assert!(s.texels.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(s.texels.iter().all(|t| *t < s.resolution * s.resolution));
    for k in 0..n {
        // Three quotients whose divisor was their sum.
        let sum: f64 = s.barycentric[k].iter().sum();
        assert!((sum - 1.0).abs() <= 4.0 * f64::EPSILON && s.barycentric[k].iter().all(|b| (0.0..=1.0).contains(b)));
        assert!(s.positions[k].is_finite());
        assert!((s.normals[k].length() - 1.0).abs() <= 1e-14, "normal {}", s.normals[k]);
        assert!(s.spacings[k].is_finite() && s.spacings[k] >= 0.0, "spacing {}", s.spacings[k]);
        let weight: f64 = (0..s.joint_count).map(|j| s.weights[j * n + k]).sum();
        assert!((weight - 1.0).abs() <= 1e-6);
        // The point is at its texel's centre.
        let uvs = model.face_uvs[s.faces[k] as usize].map(|i| model.uvs[i as usize]);
        let at: DVec2 = (0..3).map(|c| uvs[c] * s.barycentric[k][c]).sum();
        let size = f64::from(s.resolution);
        let centre = DVec2::new(f64::from(s.texels[k] % s.resolution), f64::from(s.texels[k] / s.resolution)) + 0.5;
        // Texels up to 1e-9 outside a triangle are moved onto its edge.
        assert!((at * size - centre).length() <= 1e-8 * size, "{at} of {centre}");
    }
}

fn config() -> ProptestConfig {
    ProptestConfig { cases: 300, failure_persistence: None, rng_seed: RngSeed::Fixed(7), ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn samples_of_a_sheet_are_complete_and_scale_with_it(
        cells in 1_u32..8,
        resolution in 1_u32..40,
        size in prop_oneof![Just(1e-6), Just(0.1), Just(1e3)],
        seed in any::<u64>(),
    ) {
        let model = sheet(cells, size, seed);
        let samples = sample_surface(&model, resolution).unwrap();
        check(&model, &samples);
        // A one-to-one atlas that fills the square: every texel once.
        prop_assert_eq!(samples.len(), (resolution * resolution) as usize);
        prop_assert_eq!(samples.overlaps, 0);
        prop_assert_eq!(&samples, &sample_surface(&model, resolution).unwrap());
        // The same one-metre sheet, enlarged.
        let unit = sample_surface(&sheet(cells, 1.0, seed), resolution).unwrap();
        prop_assert_eq!((&unit.texels, &unit.faces, &unit.barycentric), (&samples.texels, &samples.faces, &samples.barycentric));
        for k in 0..unit.len() {
            prop_assert!((samples.positions[k] / size - unit.positions[k]).length() <= 1e-15);
            prop_assert!((samples.normals[k] - unit.normals[k]).length() <= 1e-13);
            prop_assert!((samples.spacings[k] / size - unit.spacings[k]).abs() <= 1e-14 * unit.spacings[k]);
        }
    }

    #[test]
    fn triangles_without_area_cause_no_nan(
        cells in 2_u32..6,
        resolution in 8_u32..32,
        size in prop_oneof![Just(1e-6), Just(0.1), Just(1e3)],
        seed in any::<u64>(),
        // Ways in which a triangle loses its area: two or three equal corners, or all on a line.
        how in 0_usize..3,
        (in_space, in_atlas) in prop_oneof![Just((true, false)), Just((false, true)), Just((true, true))],
    ) {
        let mut model = sheet(cells, size, seed);
        let rng = &mut ChaCha8Rng::seed_from_u64(!seed);
        for _ in 0..cells {
            let face = rng.random_range(0..model.faces.len());
            let [a, b, c] = model.faces[face].map(|i| i as usize);
            let v = model.vertices.clone();
            if in_space {
                model.vertices[c] = [v[b], v[a], 0.5 * (v[a] + v[b])][how];
                model.vertices[b] = if how == 1 { v[a] } else { v[b] };
            }
            if in_atlas {
                // Separate corners, so that the neighbours keep their texels.
                let t = model.face_uvs[face].map(|i| model.uvs[i as usize]);
                let third = [t[1], t[0], 0.5 * (t[0] + t[1])][how];
                let start = model.uvs.len() as u32;
                model.uvs.extend([t[0], if how == 1 { t[0] } else { t[1] }, third]);
                model.face_uvs[face] = [start, start + 1, start + 2];
            }
        }
        check(&model, &sample_surface(&model, resolution).unwrap());
        prop_assert!(model.vertex_normals(&model.vertices).iter().all(|n| n.is_finite() && n.length() <= 1.0 + 1e-15));
    }
}

#[test]
fn a_surface_that_is_one_point_still_has_normals_and_spacings() {
    let mut model = sheet(3, 1.0, 1);
    model.vertices.fill(DVec3::new(0.1, 0.2, 0.3));
    let samples = sample_surface(&model, 16).unwrap();
    check(&model, &samples);
    assert!(samples.spacings.iter().all(|s| *s == 0.0));
    assert_eq!(model.vertex_normals(&model.vertices), vec![DVec3::ZERO; model.vertices.len()]);
}

#[test]
fn the_built_in_hand_is_sampled_alike_at_a_micrometre_and_at_a_kilometre() {
    let hand = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let right = sample_surface(&hand, 128).unwrap();
    for size in [1e-5, 1e4] {
        let mut model = hand.clone();
        model.vertices.iter_mut().for_each(|v| *v *= size);
        let samples = sample_surface(&model, 128).unwrap();
        check(&model, &samples);
        assert_eq!(samples.texels, right.texels);
        for (a, b) in samples.spacings.iter().zip(&right.spacings) {
            assert!((a / size - b).abs() <= 1e-12 * b);
        }
    }
}
