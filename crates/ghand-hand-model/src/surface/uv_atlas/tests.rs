use ghand_core::pose::Pose;
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Side};
use ghand_test_support::{cases, shared};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::files::gltf::read_gltf;
use crate::surface::{SurfaceSamples, sample_surface};
use ghand_test_support::procedural_hand::ProceduralHand;

type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// The mesh with its atlas, all of it bound to one joint.
fn model(mesh: &Mesh, atlas: &Atlas) -> HandModel {
    HandModel {
        name: "mesh".into(),
        side: Side::Right,
        joint_names: vec!["root".into()],
        parents: vec![None],
        joints: vec![DVec3::ZERO],
        vertices: mesh.0.clone(),
        faces: mesh.1.clone(),
        uvs: atlas.uvs.clone(),
        face_uvs: atlas.face_uvs.clone(),
        weights: vec![1.0; mesh.0.len()],
        shape_directions: vec![],
        shape_names: vec![],
        pose_directions: vec![],
        joint_regressor: vec![],
        joint_directions: vec![],
        pose_space: None,
        source_vertices: vec![],
    }
}

fn area(mesh: &Mesh, face: usize) -> f64 {
    let [a, b, c] = mesh.1[face].map(|i| mesh.0[i as usize]);
    0.5 * (b - a).cross(c - a).length()
}

/// The index of the connected piece of the atlas that contains each face.
fn chart_of_face(atlas: &Atlas) -> Vec<usize> {
    let mut group: Vec<usize> = (0..atlas.uvs.len()).collect();
    fn root(group: &mut [usize], mut k: usize) -> usize {
        while group[k] != k {
            group[k] = group[group[k]];
            k = group[k];
        }
        k
    }
    for t in &atlas.face_uvs {
        for i in &t[1..] {
            let (a, b) = (root(&mut group, t[0] as usize), root(&mut group, *i as usize));
            group[a] = b;
        }
    }
    atlas.face_uvs.iter().map(|t| root(&mut group, t[0] as usize)).collect()
}

/// Whether two triangles overlap by more than a millionth of their size, with any winding.
fn overlap(first: [DVec2; 3], second: [DVec2; 3]) -> bool {
    let shrunk = |t: [DVec2; 3]| {
        let centre = (t[0] + t[1] + t[2]) / 3.0;
        t.map(|p| p + (centre - p) * 1e-6)
    };
    let (first, second) = (shrunk(first), shrunk(second));
    let separated_along = |axis: DVec2| {
        let reach = |t: [DVec2; 3]| t.map(|p| p.dot(axis));
        let least = |t: [f64; 3]| t[0].min(t[1]).min(t[2]);
        let most = |t: [f64; 3]| t[0].max(t[1]).max(t[2]);
        let (a, b) = (reach(first), reach(second));
        most(a) <= least(b) || most(b) <= least(a)
    };
    let sides = |t: [DVec2; 3]| [(t[1] - t[0]).perp(), (t[2] - t[1]).perp(), (t[0] - t[2]).perp()];
    !sides(first).into_iter().chain(sides(second)).any(separated_along)
}

/// Pairs of triangles that overlap.
fn overlapping_pairs(triangles: &[[DVec2; 3]]) -> usize {
    let left = |t: &[DVec2; 3]| t[0].x.min(t[1].x).min(t[2].x);
    let right = |t: &[DVec2; 3]| t[0].x.max(t[1].x).max(t[2].x);
    let mut sorted = triangles.to_vec();
    sorted.sort_by(|a, b| left(a).total_cmp(&left(b)));
    let near = |k: usize| {
        sorted[k + 1..].iter().take_while({
            let end = right(&sorted[k]);
            move |other| left(other) < end
        })
    };
    (0..sorted.len()).map(|k| near(k).filter(|other| overlap(sorted[k], **other)).count()).sum()
}

/// Builds the atlas of a mesh and checks everything promised about it except evenness; returns its samples at 512.
fn check(name: &str, mesh: &Mesh) -> (Atlas, SurfaceSamples) {
    let start = std::time::Instant::now();
    let atlas = build_atlas(&mesh.0, &mesh.1).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    assert_eq!(atlas, build_atlas(&mesh.0, &mesh.1).unwrap(), "{name}: the same mesh gave another atlas");
    assert!(atlas.uvs.iter().all(|p| p.cmpge(DVec2::ZERO).all() && p.cmple(DVec2::ONE).all()), "{name}");
    assert_eq!(atlas.face_uvs.len(), mesh.1.len());
    let triangles: Vec<[DVec2; 3]> = atlas.face_uvs.iter().map(|t| t.map(|i| atlas.uvs[i as usize])).collect();
    let mut shown = vec![];
    for (k, t) in triangles.iter().enumerate() {
        let doubled = (t[1] - t[0]).perp_dot(t[2] - t[0]);
        if area(mesh, k) > 0.0 {
            assert!(doubled < 0.0, "{name}: face {k} is mirrored or lost: {doubled}");
            shown.push(*t);
        } else {
            assert!(doubled == 0.0, "{name}: face {k} without area has an area in the atlas: {doubled}");
        }
    }
    assert_eq!(overlapping_pairs(&shown), 0, "{name}");
    let model = model(mesh, &atlas);
    assert_eq!(sample_surface(&model, 2048).unwrap().overlaps, 0, "{name} at 2048");
    let samples = sample_surface(&model, 512).unwrap();
    assert_eq!(samples.overlaps, 0, "{name} at 512");
    let charts = chart_of_face(&atlas);
    let mut raster = vec![usize::MAX; 512 * 512];
    for (&texel, &face) in samples.texels.iter().zip(&samples.faces) {
        raster[texel as usize] = charts[face as usize];
    }
    for &texel in &samples.texels {
        let (row, column) = (texel as usize / 512, texel as usize % 512);
        assert!((2..510).contains(&row) && (2..510).contains(&column), "{name}: a texel at the border");
        let own = raster[texel as usize];
        let around = (row - 2..=row + 2).flat_map(|r| &raster[r * 512 + column - 2..=r * 512 + column + 2]);
        for &near in around {
            assert!(near == own || near == usize::MAX, "{name}: charts closer than 2 texels at {row}, {column}");
        }
    }
    let mut spacings = samples.spacings.clone();
    spacings.sort_by(f64::total_cmp);
    let at = |part: usize| spacings[spacings.len() * part / 100];
    println!(
        "{name}: {} vertices, {} charts, {} texels at 512, spacing p95/p5 {:.3}, max/min {:.3}, {seconds:.3} s",
        mesh.0.len(),
        atlas.charts,
        samples.len(),
        at(95) / at(5),
        spacings[spacings.len() - 1] / spacings[0],
    );
    (atlas, samples)
}

/// Steepest against flattest: sqrt(2), and rounding.
fn assert_even(name: &str, samples: &SurfaceSamples) {
    let least = samples.spacings.iter().copied().fold(f64::INFINITY, f64::min);
    let most = samples.spacings.iter().copied().fold(0.0, f64::max);
    assert!(most / least < 2f64.sqrt() + 1e-9, "{name}: {}", most / least);
}

fn procedural(detail: u32) -> HandModel {
    ProceduralHand { detail, ..Default::default() }.build().unwrap()
}

/// A hand as fine as MANO's, with an open wrist like MANO's.
fn open_hand() -> Mesh {
    let hand = procedural(1);
    let wrist = hand.vertices.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max) - 0.02;
    let inside = |face: &&[u32; 3]| face.iter().all(|&i| hand.vertices[i as usize].y < wrist);
    let faces = hand.faces.iter().filter(inside).copied().collect();
    (hand.vertices, faces)
}

fn sphere(rings: u32) -> Mesh {
    let segments = 2 * rings;
    let mut vertices = vec![];
    for ring in 0..=rings {
        let (sin, cos) = (std::f64::consts::PI * f64::from(ring) / f64::from(rings)).sin_cos();
        for segment in 0..segments {
            let (y, x) = (std::f64::consts::TAU * f64::from(segment) / f64::from(segments)).sin_cos();
            // All points of a pole are one.
            let sin = if ring % rings == 0 { 0.0 } else { sin };
            vertices.push(DVec3::new(sin * x, sin * y, cos));
        }
    }
    let mut faces = vec![];
    for ring in 0..rings {
        for segment in 0..segments {
            let at = |r: u32, s: u32| r * segments + s % segments;
            let (a, b) = (at(ring, segment), at(ring, segment + 1));
            let (c, d) = (at(ring + 1, segment), at(ring + 1, segment + 1));
            faces.extend([[a, c, d], [a, d, b]]);
        }
    }
    (vertices, faces)
}

fn cube() -> Mesh {
    let vertices = (0..8).map(|k| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2))).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    (vertices, quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

#[test]
fn hands_without_uvs_get_a_one_to_one_even_and_dense_atlas() {
    for detail in [1, 2, 4].into_iter().take(cases(2, 3)) {
        let hand = procedural(detail);
        let name = format!("procedural hand of detail {detail}");
        let (_, samples) = check(&name, &(hand.vertices, hand.faces));
        assert_even(&name, &samples);
        // One and a half times as many as MANO's own atlas has, 87,780.
        assert!(samples.len() > 130_000, "{name}: {} texels", samples.len());
    }
}

#[test]
fn every_face_of_a_hand_as_fine_as_manos_gets_texels() {
    let mesh = open_hand();
    let (_, samples) = check("open hand", &mesh);
    assert_even("open hand", &samples);
    let mut texels = vec![0; mesh.1.len()];
    for &face in &samples.faces {
        texels[face as usize] += 1;
    }
    println!("{} faces, fewest texels {:?}", mesh.1.len(), texels.iter().min());
    assert!(texels.iter().all(|&n| n >= 4));
    // MANO's own atlas has 87,780.
    assert!(samples.len() > 120_000);
}

#[test]
fn the_atlas_of_a_fist_is_complete() {
    let hand = procedural(1);
    let mut pose = Pose::rest(hand.joint_count());
    pose.rotations[1..].fill(DVec3::new(0.0, 0.0, 1.2));
    let fist = pose_hand(&hand, &[], &pose).unwrap().vertices;
    let (_, samples) = check("fist", &(fist, hand.faces));
    assert_even("fist", &samples);
}

#[test]
fn a_rig_gets_an_atlas_as_good_as_its_own() {
    let Some(path) = shared("assets/generic-hand/right.glb") else { return };
    let hand = read_gltf(&path, None).unwrap().model;
    // An artist's atlas has the same orientation.
    let turned = |t: &&[u32; 3]| {
        let [a, b, c] = t.map(|i| hand.uvs[i as usize]);
        (b - a).perp_dot(c - a) < 0.0
    };
    assert!(hand.face_uvs.iter().filter(turned).count() * 100 > 99 * hand.face_uvs.len());
    let own = sample_surface(&hand, 512).unwrap().len();
    let (_, samples) = check("generic hand", &(hand.vertices, hand.faces));
    assert_even("generic hand", &samples);
    assert!(samples.len() > own, "{} texels, its own atlas has {own}", samples.len());
}

#[test]
fn simple_solids_fill_the_square() {
    let (atlas, samples) = check("cube", &cube());
    // No more than three sides are visible from one direction, and three only if one of them is tilted by at least 54.7
    // degrees.
    assert!(atlas.charts <= 6, "{}", atlas.charts);
    assert!(samples.len() > 150_000, "{}", samples.len());
    let (atlas, samples) = check("sphere", &sphere(24));
    assert!(atlas.charts <= 24, "{}", atlas.charts);
    assert_even("sphere", &samples);
}

#[test]
fn position_and_size_do_not_matter() {
    let (vertices, faces) = open_hand();
    let expected = build_atlas(&vertices, &faces).unwrap();
    // A power of two only changes exponents: the same bits.
    for scale in [2f64.powi(-20), 2f64.powi(13)] {
        let scaled: Vec<DVec3> = vertices.iter().map(|p| *p * scale).collect();
        assert_eq!(build_atlas(&scaled, &faces).unwrap(), expected);
    }
    for scale in [1e-6, 1e3] {
        let moved = vertices.iter().map(|p| *p * scale + DVec3::new(3.0, -2.0, 1.0) * scale).collect();
        check(&format!("hand times {scale}"), &(moved, faces.clone()));
    }
}

#[test]
fn tangled_surfaces_get_an_atlas_too() {
    // A Moebius strip has only one side.
    let mut strip: Mesh = (vec![], vec![]);
    for k in 0..40 {
        let angle = std::f64::consts::TAU * f64::from(k) / 40.0;
        let out = DVec3::new(angle.cos(), angle.sin(), 0.0);
        let across = out * (angle / 2.0).cos() + DVec3::Z * (angle / 2.0).sin();
        strip.0.extend([out - across * 0.3, out + across * 0.3]);
        let (a, b) = (2 * k as u32, 2 * k as u32 + 1);
        let (c, d) = if k < 39 { (a + 2, b + 2) } else { (1, 0) };
        strip.1.extend([[a, c, d], [a, d, b]]);
    }
    check("strip with half a turn", &strip);
    // A book: many pages at one edge, one of them twice, one from both sides.
    let mut book: Mesh = (vec![DVec3::ZERO, DVec3::Z], vec![]);
    for k in 0..7 {
        let angle = 0.4 * f64::from(k);
        book.0.push(DVec3::new(angle.cos(), angle.sin(), 0.3));
        book.1.push([0, 1, k as u32 + 2]);
    }
    book.1.extend([[0, 1, 2], [1, 0, 3]]);
    check("book", &book);
    // Triangles anywhere that share corners at random.
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let vertices = (0..60).map(|_| DVec3::from_array(std::array::from_fn(|_| random.random()))).collect();
    let mut corners = std::iter::repeat_with(|| random.random_range(0..60u32));
    let mut faces = vec![];
    while faces.len() < 150 {
        let face: Vec<u32> = corners.by_ref().take(3).collect();
        if face[0] != face[1] && face[1] != face[2] && face[2] != face[0] {
            faces.push([face[0], face[1], face[2]]);
        }
    }
    check("random triangles", &(vertices, faces));
}

#[test]
fn faces_without_area_are_at_one_point_of_the_atlas() {
    let (mut vertices, mut faces) = cube();
    vertices.push(DVec3::new(0.5, 0.0, 0.0));
    // Two equal corners, three equal corners, and three corners on a line.
    faces.extend([[0, 0, 3], [5, 5, 5], [0, 8, 1]]);
    let (atlas, _) = check("cube with faces without area", &(vertices, faces));
    for t in &atlas.face_uvs[12..] {
        assert!(t[0] == t[1] && t[1] == t[2]);
    }
}

#[test]
fn unusable_meshes_are_errors() {
    let (vertices, faces) = cube();
    let refused = |vertices: &[DVec3], faces: &[[u32; 3]]| build_atlas(vertices, faces).unwrap_err();
    assert_eq!(refused(&[], &[]), WITHOUT_AREA);
    assert_eq!(refused(&vertices, &[]), WITHOUT_AREA);
    assert_eq!(refused(&vertices, &[[0, 1, 1]]), WITHOUT_AREA);
    assert_eq!(refused(&[DVec3::ONE; 8], &faces), WITHOUT_AREA);
    assert_eq!(refused(&vertices[..7], &faces), "face 2 refers to a vertex beyond the 7; repair the mesh");
    for bad in [f64::NAN, f64::INFINITY, -f64::MAX] {
        let mut broken = vertices.clone();
        broken[6].y = bad;
        broken[5].y = if bad == -f64::MAX { f64::MAX } else { 0.0 };
        let found = refused(&broken, &faces);
        assert!([5, 6].map(|k| format!("vertex {k} is not finite; repair the mesh")).contains(&found), "{found}");
    }
}

#[test]
fn thousands_of_pieces_fit_into_an_atlas() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut point = || DVec3::from_array(std::array::from_fn(|_| random.random()));
    let vertices: Vec<DVec3> = (0..15_000).map(|_| point()).collect();
    let faces: Vec<[u32; 3]> = (0..5000).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let atlas = build_atlas(&vertices, &faces).unwrap();
    assert_eq!(atlas.charts, 5000);
    let triangles: Vec<[DVec2; 3]> = atlas.face_uvs.iter().map(|t| t.map(|i| atlas.uvs[i as usize])).collect();
    assert_eq!(overlapping_pairs(&triangles), 0);
}
