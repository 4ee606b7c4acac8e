//! Avatars with gloss, and with flat Gaussians, in a scene.

use ghand_avatar::light::Gloss;
use ghand_avatar::reference::pose_avatar;
use ghand_avatar::{Avatar, AvatarConfig, AvatarLight, GaussianShape, Light, PosedHand, Scene};
use ghand_core::{Camera, Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::surface::sample_surface;
use ghand_render::splat::{Purpose, SplatModel};
use ghand_render::{AdapterChoice, Gpu};
use glam::{DMat3, DVec2, DVec3};

fn gpu() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"))
}

fn avatar(gaussians: GaussianShape, gloss: Option<Gloss>) -> Avatar {
    let model = builtin_hand(Side::Right).unwrap();
    let config = AvatarConfig { uv_resolution: 32, gaussians, ..Default::default() };
    let mut avatar = Avatar::untrained(&model, &config, [0.6, 0.4, 0.3], 1).unwrap();
    let samples = sample_surface(&model, config.uv_resolution).unwrap();
    avatar.light = Some(AvatarLight::new(Light::studio(), gloss, &samples));
    avatar
}

fn glossy() -> Avatar {
    avatar(GaussianShape::Flat, Some(Gloss { roughness: 0.5, strengths: vec![[2.0; 3]; 25] }))
}

/// A camera half a metre in front of the hand or behind it.
fn camera(behind: bool) -> Camera {
    let rotation = if behind { DMat3::from_rotation_y(std::f64::consts::PI) } else { DMat3::IDENTITY };
    let hand = builtin_hand(Side::Right).unwrap();
    let middle = hand.vertices.iter().sum::<DVec3>() / hand.vertices.len() as f64;
    Camera {
        id: String::new(),
        width: 64,
        height: 64,
        focal: DVec2::splat(150.0),
        principal: DVec2::splat(32.0),
        rotation,
        translation: DVec3::new(0.0, 0.0, 0.5) - rotation * middle,
    }
}

fn poses() -> [Pose; 2] {
    let rest = Pose::rest(25);
    let mut turned = rest.clone();
    turned.rotations[0] = DVec3::new(0.0, 1.0, 0.2);
    [rest, turned]
}

/// Pictures of frames from cameras, one after the other in the same scene.
fn pictures(gpu: &Gpu, avatar: &Avatar, wanted: &[(usize, bool)]) -> Vec<Vec<[f32; 4]>> {
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 2, [64, 64]).unwrap();
    for (frame, pose) in poses().iter().enumerate() {
        scene.set_pose(gpu, 0, frame, pose).unwrap();
    }
    wanted.iter().map(|(frame, side)| scene.render(gpu, *frame, &camera(*side), [0.0; 3]).unwrap().rgba).collect()
}

#[test]
fn gloss_is_that_of_the_frame_and_the_eye() {
    let gpu = gpu();
    let matte = avatar(GaussianShape::Flat, None);
    let brightness = |picture: &[[f32; 4]]| picture.iter().map(|p| f64::from(p[0] + p[1] + p[2])).sum::<f64>();
    let all = [(0, false), (0, true), (1, true), (1, false), (0, false)];
    let shiny = pictures(&gpu, &glossy(), &all);
    let dull = pictures(&gpu, &matte, &all);
    let gains: Vec<f64> = shiny.iter().zip(&dull).map(|(shiny, dull)| brightness(shiny) / brightness(dull)).collect();
    // Never darker, and different from each side in each pose.
    assert!(gains.iter().all(|gain| *gain > 1.002), "{gains:?}");
    for (k, gain) in gains[..4].iter().enumerate() {
        assert!(gains[..k].iter().all(|other| (gain / other - 1.0).abs() > 1e-4), "{gains:?}");
        // What was shown before does not matter.
        let alone = &pictures(&gpu, &glossy(), &all[k..=k])[0];
        assert!(*alone == shiny[k], "{k}");
    }
    assert!(shiny[4] == shiny[0]);
}

#[test]
fn exported_gaussians_have_no_gloss() {
    let gpu = gpu();
    let export = |avatar: &Avatar| {
        let mut hand = PosedHand::new(&gpu, avatar).unwrap();
        hand.set_pose(&gpu, &poses()[0]).unwrap();
        hand.splats(&gpu).unwrap()
    };
    assert!(export(&glossy()) == export(&avatar(GaussianShape::Flat, None)));
}

#[test]
fn a_posed_hand_is_that_of_a_scene_and_its_twin_has_the_same_light() {
    let gpu = gpu();
    let avatar = glossy();
    let mut hand = PosedHand::new(&gpu, &avatar).unwrap();
    let mut scene = Scene::new(&gpu, &[&avatar], Purpose::Images, 1, [8, 8]).unwrap();
    for pose in poses() {
        hand.set_pose(&gpu, &pose).unwrap();
        scene.set_pose(&gpu, 0, 0, &pose).unwrap();
        let table = hand.table(&gpu).unwrap();
        assert!(table == scene.posed_table(&gpu, 0).unwrap());
        let farthest = |other: &Avatar| {
            let twin = pose_avatar(other, &pose).unwrap().table();
            assert_eq!(twin.len(), table.len());
            twin.iter().zip(&table).map(|(a, b)| (a - f64::from(*b)).abs()).fold(0.0, f64::max)
        };
        // f32 on the device.
        assert!(farthest(&avatar) < 1e-5, "{}", farthest(&avatar));
        assert!(farthest(&Avatar { light: None, ..avatar.clone() }) > 0.05, "the light is compared");
    }
}

#[test]
fn round_gaussians_stay_round_among_flat_ones() {
    let gpu = gpu();
    let round = avatar(GaussianShape::Round, None);
    let flat = avatar(GaussianShape::Flat, None);
    let count = round.template.len();
    let mut scene = Scene::new(&gpu, &[&round, &flat], Purpose::Images, 1, [64, 64]).unwrap();
    for hand in 0..2 {
        scene.set_pose(&gpu, hand, 0, &poses()[1]).unwrap();
    }
    let table = scene.posed_table(&gpu, 0).unwrap();
    let model = scene.splatter().options().model;
    assert_eq!(table.len(), model.rows() * 2 * count);
    let normal =
        |p: usize| DVec3::from([0, 1, 2].map(|c| f64::from(table[(model.rotation_row() + c) * 2 * count + p])));
    assert!((0..count).all(|p| normal(p) == DVec3::ZERO));
    assert!((count..2 * count).all(|p| (normal(p).length() - 1.0).abs() < 1e-5));
    // Normals are those of the turned hand, and everything else is the same for both.
    let rest = flat.template.normals.as_ref().unwrap();
    let cosine =
        (0..count).map(|p| normal(count + p).dot(DVec3::from([0, 1, 2].map(|c| f64::from(rest[c * count + p])))));
    assert!((0.3..0.95).contains(&(cosine.sum::<f64>() / count as f64)));
    for row in (0..model.rotation_row()).chain(model.color_row()..model.rows()) {
        let [one, other] = [0, 1].map(|hand| &table[(2 * row + hand) * count..][..count]);
        assert!(one == other, "row {row}");
    }
    assert_eq!(SplatModel::HAND.rows() + 3, model.rows());
}
