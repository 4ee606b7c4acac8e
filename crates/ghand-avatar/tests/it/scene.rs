//! Scenes of several avatars.

use crate::common::{COUNT, JOINTS, random, random_avatar};
use ghand_avatar::{Avatar, AvatarConfig, Scene};
use ghand_core::Pose;
use ghand_render::splat::Purpose;
use ghand_render::{AdapterChoice, Gpu, RenderError};
use glam::DVec3;

fn pose(seed: u64) -> Pose {
    let numbers = random(seed, 3 * JOINTS + 3, 1.0);
    let vector = |v: &[f32]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
    let mut rotations: Vec<DVec3> = numbers.chunks_exact(3).map(vector).collect();
    let translation = rotations.pop().unwrap() * 0.1;
    Pose { rotations, translation }
}

/// The posed Gaussians of a scene, `[7][N]`, with each avatar in its pose as frame 1.
fn table(gpu: &Gpu, avatars: &[&Avatar], poses: &[Pose]) -> Vec<f32> {
    let mut scene = Scene::new(gpu, avatars, Purpose::Images, 2, [16, 16]).unwrap();
    for (avatar, pose) in poses.iter().enumerate() {
        scene.set_pose(gpu, avatar, 1, pose).unwrap();
    }
    scene.posed_table(gpu, 1).unwrap()
}

#[test]
fn every_avatar_of_a_scene_is_posed_as_if_it_were_alone() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let config =
        |bases, components| AvatarConfig { shape_bases: bases, color_components: components, ..Default::default() };
    let avatars = [random_avatar(1, &config(3, 2)), random_avatar(2, &config(1, 0)), random_avatar(3, &config(2, 4))];
    let poses = [pose(11), pose(12), pose(13)];
    let together = table(&gpu, &avatars.each_ref(), &poses);
    for (place, (avatar, pose)) in avatars.iter().zip(&poses).enumerate() {
        let alone = table(&gpu, &[avatar], std::slice::from_ref(pose));
        for (row, alone) in alone.chunks_exact(COUNT).enumerate() {
            let part = &together[(row * avatars.len() + place) * COUNT..][..COUNT];
            assert!(part == alone, "avatar {place}, row {row}");
        }
    }
    let swapped = table(&gpu, &avatars.each_ref(), &[poses[1].clone(), poses[0].clone(), poses[2].clone()]);
    assert!(swapped != together, "the poses have no effect");
}

#[test]
fn poses_without_a_matching_avatar_or_frame_are_rejected_with_one_sentence() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let avatar = random_avatar(1, &AvatarConfig { shape_bases: 1, color_components: 0, ..Default::default() });
    let mut scene = Scene::new(&gpu, &[&avatar], Purpose::Images, 2, [16, 16]).unwrap();
    let short = Pose { rotations: vec![DVec3::ZERO; JOINTS - 1], translation: DVec3::ZERO };
    for (avatar, frame, pose, part) in
        [(1, 0, pose(1), "avatar 1"), (0, 2, pose(1), "frame 2"), (0, 0, short, "6 joints")]
    {
        let Err(RenderError::Invalid(message)) = scene.set_pose(&gpu, avatar, frame, &pose) else { panic!("{part}") };
        assert!(message.contains(part) && !message.contains('\n'), "{message}");
    }
    assert!(scene.set_pose(&gpu, 0, 1, &pose(1)).is_ok());
}

#[test]
fn a_scene_is_antialiased_if_its_avatars_are_and_refuses_to_mix_them() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let [off, on] = [false, true].map(|antialias| {
        let config = AvatarConfig { shape_bases: 1, color_components: 0, antialias, ..Default::default() };
        random_avatar(1, &config)
    });
    let made = |avatars: &[&Avatar]| Scene::new(&gpu, avatars, Purpose::Images, 1, [16, 16]);
    for (avatars, expected) in [(vec![], false), (vec![&off, &off], false), (vec![&on, &on], true)] {
        assert_eq!(made(&avatars).unwrap().splatter().options().model.antialias, expected);
    }
    let Err(RenderError::Invalid(message)) = made(&[&off, &off, &on]) else { panic!("both kinds in one scene") };
    assert!(message.contains("avatar 2 with the antialiasing of an earlier") && !message.contains('\n'), "{message}");
    let mut narrow = on.clone();
    narrow.config.narrow_blur = true;
    assert!(made(&[&narrow, &narrow]).unwrap().splatter().options().model.narrow);
    let Err(RenderError::Invalid(message)) = made(&[&narrow, &on]) else { panic!("both blurs in one scene") };
    assert!(message.starts_with("avatar 0 was trained with antialiasing and avatar 1 with the"), "{message}");
}
