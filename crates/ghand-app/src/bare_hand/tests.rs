#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ghand_core::Side;
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::joints::axes::JointAxes;
use ghand_test_support::procedural_hand::ProceduralHand;

use super::*;

/// The colour of the skin at a vertex.
fn color_at(hand: &BareHand, vertex: usize) -> DVec3 {
    let k = hand.mesh.source_vertices.iter().position(|&v| v as usize == vertex).unwrap();
    let uv = (hand.mesh.uvs[k] * f64::from(RESOLUTION)).as_uvec2().min(glam::UVec2::splat(RESOLUTION - 1));
    DVec3::from(hand.skin.rgb[(uv.y * RESOLUTION + uv.x) as usize].map(f64::from)) / 255.0
}

#[test]
fn palms_are_paler_than_backs_and_every_texel_beside_a_chart_has_a_color() {
    for model in [builtin_hand(Side::Right), builtin_hand(Side::Left), ProceduralHand::default().build()] {
        let hand = BareHand::new(model.unwrap());
        let normals = hand.model.vertex_normals(&hand.model.vertices);
        let back = if hand.model.side == Side::Right { DVec3::X } else { DVec3::NEG_X };
        let mean = |wanted: &dyn Fn(f64) -> bool| {
            let colors: Vec<DVec3> =
                (0..normals.len()).filter(|v| wanted(normals[*v].dot(back))).map(|v| color_at(&hand, v)).collect();
            colors.iter().sum::<DVec3>() / colors.len() as f64
        };
        let [back, palm] = [mean(&|facing| facing > 0.9), mean(&|facing| facing < -0.9)];
        assert!((palm - back).min_element() > 0.03, "{}: back {back}, palm {palm}", hand.model.name);
        // Corners of triangles lie on the charts' edges, where filtering reads texels outside.
        for uv in &hand.mesh.uvs {
            let texel = (*uv * f64::from(RESOLUTION)).as_uvec2().min(glam::UVec2::splat(RESOLUTION - 1));
            let color = hand.skin.rgb[(texel.y * RESOLUTION + texel.x) as usize];
            assert!(color != [0; 3], "{}: nothing at {uv}", hand.model.name);
        }
    }
}

#[test]
fn nails_are_on_the_back_of_the_fingertips() {
    let model = builtin_hand(Side::Right).unwrap();
    let complexion = Complexion::of(&model);
    let axes = JointAxes::of_joints(&model).unwrap();
    let samples = sample_surface(&model, 256).unwrap();
    let weights = |point: usize| samples.weights.iter().skip(point).step_by(samples.len());
    for finger in ["thumb", "index-finger", "middle-finger", "ring-finger", "pinky-finger"] {
        let last = model.joint_index(&format!("{finger}-phalanx-distal")).unwrap();
        let own: Vec<usize> = (0..samples.len()).filter(|&p| *weights(p).nth(last).unwrap() > 0.9).collect();
        let is_nail = |p: &usize| {
            let color = complexion.color(samples.positions[*p], samples.normals[*p], weights(*p));
            color.distance(complexion::NAIL) < 0.02
        };
        let nail: Vec<usize> = own.iter().copied().filter(is_nail).collect();
        // Texels of the nails are less than a fifth of those of the last bones, and more than a twentieth.
        assert!((own.len() / 20..own.len() / 5).contains(&nail.len()), "{finger}: {} of {}", nail.len(), own.len());
        // Abduction is about the axis that comes out of the nail, or its opposite.
        let facing = |p: usize| samples.normals[p].dot(axes[last].abduction);
        let side = facing(nail[0]).signum();
        assert!(nail.iter().all(|&p| side * facing(p) > 0.1), "{finger}");
    }
}

#[test]
fn a_hand_without_known_joints_or_texture_coordinates_has_skin_too() {
    let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    model.joint_names[2] = "bone".into();
    assert_eq!(
        color_at(&BareHand::new(model.clone()), 100),
        DVec3::from(bytes(complexion::BACK).map(f64::from)) / 255.0
    );
    model.uvs.fill(glam::DVec2::splat(0.5));
    assert_eq!(BareHand::new(model).skin.rgb, vec![bytes(complexion::BACK)]);
}
