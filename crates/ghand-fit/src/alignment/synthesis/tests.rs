//! A textured hand in known poses, seen by several cameras, drawn by the mesh rasteriser in place of an avatar.

use ghand_core::posing::pose_hand;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{Camera, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_render::mesh::{MeshInstance, MeshStyle, Shading, Surface};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

const FRAMES: usize = 5;
const SIZE: u32 = 160;

struct Scene {
    template: HandModel,
    colors: Vec<DVec3>,
    truth: Vec<Pose>,
    /// The truth with errors.
    given: Vec<Pose>,
    cameras: Vec<Camera>,
    /// By frame and camera.
    views: Vec<TrainView>,
}

impl Scene {
    fn new(camera_count: usize) -> Scene {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut random = || rng.random::<f64>() - 0.5;
        let template = builtin_hand(Side::Right).unwrap().without_blend_shapes();
        let center = template.vertices.iter().sum::<DVec3>() / template.vertices.len() as f64;
        let camera = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / camera_count as f64;
            let eye = center + 0.5 * DVec3::new(angle.cos(), 0.4 * (3.0 * angle).sin(), angle.sin());
            Camera::look_at(eye, center, DVec3::Y, 0.55, SIZE, SIZE)
        };
        let cameras: Vec<Camera> = (0..camera_count).map(camera).collect();
        let is_bent = |name: &String| name.contains("index") && name.contains("phalanx");
        let bent: Vec<usize> =
            (0..template.joint_count()).filter(|joint| is_bent(&template.joint_names[*joint])).collect();
        let (mut truth, mut given) = (vec![], vec![]);
        for _ in 0..FRAMES {
            let mut pose = Pose { rotations: vec![DVec3::ZERO; template.joint_count()], translation: DVec3::ZERO };
            pose.rotations[0] = 0.2 * DVec3::new(random(), random(), random());
            bent.iter().for_each(|k| pose.rotations[*k] = 0.4 * DVec3::new(random(), random(), random()));
            truth.push(pose.clone());
            let mut turn = |joint: usize, size: f64| {
                let error = rotation_from_axis_angle(size * DVec3::new(random(), random(), random()));
                let turned = error * rotation_from_axis_angle(pose.rotations[joint]);
                pose.rotations[joint] = axis_angle_from_rotation(&turned);
            };
            // Up to 0.9 degrees at the root, up to 3 in the finger.
            turn(0, 0.03);
            bent.iter().for_each(|joint| turn(*joint, 0.1));
            pose.translation += 0.0008 * DVec3::new(random(), random(), random());
            given.push(pose);
        }
        let colors: Vec<DVec3> = template.vertices.iter().map(|_| DVec3::splat(0.6 + 0.5 * random())).collect();
        let mut scene = Scene { template, colors, truth, given, cameras, views: vec![] };
        for frame in 0..FRAMES {
            for (camera_index, camera) in scene.cameras.iter().enumerate() {
                let byte = |v: f32| (255.0 * v).round() as u8;
                let image = scene.draw(camera, &scene.truth[frame]);
                let pixels = image.rgba.iter().map(|p| p.map(byte)).collect();
                let camera = camera.clone();
                scene.views.push(TrainView { camera_index, frame, camera, size: [SIZE; 2], pixels });
            }
        }
        scene
    }

    /// On black.
    fn draw(&self, camera: &Camera, pose: &Pose) -> Image {
        let positions = pose_hand(&self.template, &[], pose).unwrap().vertices;
        let normals = self.template.vertex_normals(&positions);
        let mesh = MeshInstance {
            positions: &positions,
            normals: &normals,
            light_visibility: None,
            triangles: &self.template.faces,
            surface: Surface::VertexColors(&self.colors),
        };
        let style = MeshStyle { supersample: 2, shading: Shading::Unlit, wireframe: None };
        let mut image = ghand_render::reference::mesh::render(&mesh, camera, &style).unwrap();
        image.rgba.iter_mut().for_each(|p| (0..3).for_each(|k| p[k] *= p[3]));
        Image { width: SIZE, height: SIZE, rgba: image.rgba }
    }

    fn refine(&self, poses: &[Pose]) -> (Vec<Pose>, SynthesisRefinement) {
        let refined = self.refine_while(poses, &mut || true).unwrap();
        (refined.0, SynthesisRefinement { seconds: 0.0, ..refined.1 })
    }

    fn refine_while(
        &self,
        poses: &[Pose],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Option<(Vec<Pose>, SynthesisRefinement)> {
        let view = |index: usize| Ok(self.views[index].clone());
        let problem = SynthesisProblem {
            template: &self.template,
            given: self.given.iter().collect(),
            frames: self.views.iter().map(|view| view.frame).collect(),
            view: &view,
            reduction: 1,
        };
        let mut draw = |view: &TrainView, pose: &Pose| Ok(go_on().then(|| self.draw(&view.camera, pose)));
        refine_by_synthesis(&problem, poses, 200, &mut draw).unwrap()
    }

    /// Root mean square distance of posed vertices from their true places, metres.
    fn error(&self, poses: &[Pose], frame: usize) -> f64 {
        let [a, b] =
            [&poses[frame], &self.truth[frame]].map(|pose| pose_hand(&self.template, &[], pose).unwrap().vertices);
        (a.iter().zip(&b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>() / a.len() as f64).sqrt()
    }
}

#[test]
fn planted_errors_are_pulled_back_with_any_number_of_threads() {
    let scene = Scene::new(6);
    let refined = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| scene.refine(&scene.given))
    };
    let (poses, refinement) = refined(4);
    assert!(refinement.refined_frames == FRAMES && refinement.kept_frames == 0, "{refinement:?}");
    for frame in 0..FRAMES {
        let [before, after] = [&scene.given, &poses].map(|poses| scene.error(poses, frame));
        println!("frame {frame}: {:.3} -> {:.3} mm", 1e3 * before, 1e3 * after);
        assert!(after < 0.35 * before, "frame {frame}: {before} -> {after}");
    }
    assert!(refinement.held_out_after < 0.6 * refinement.held_out_before, "{refinement:?}");
    assert!(refinement.turned_deg > 0.2 && refinement.summary().contains("5 frames"), "{}", refinement.summary());
    assert!(refined(1) == (poses, refinement), "the same bits");
}

#[test]
fn two_images_a_frame_refine_it_and_blocks_of_them_judge() {
    let scene = Scene::new(2);
    let (poses, refinement) = scene.refine(&scene.given);
    assert!(refinement.held_out_after < refinement.held_out_before, "{refinement:?}");
    let sum = |poses: &[Pose]| (0..FRAMES).map(|frame| scene.error(poses, frame)).sum::<f64>();
    println!("{:.3} -> {:.3} mm", 1e3 * sum(&scene.given), 1e3 * sum(&poses));
    assert!(sum(&poses) < 0.6 * sum(&scene.given));
}

#[test]
fn a_frame_with_images_of_another_pose_keeps_its_pose() {
    // The images that refine frame 1 show frame 3, those that judge it are right.
    let mut scene = Scene::new(6);
    let frames: Vec<usize> = scene.views.iter().map(|view| view.frame).collect();
    let roles = Roles::of_frames(&frames, FRAMES);
    for index in &roles[1].used {
        scene.views[*index].pixels = scene.views[index + 2 * 6].pixels.clone();
    }
    let (poses, refinement) = scene.refine(&scene.given);
    assert_eq!(poses[1], scene.given[1]);
    assert!(refinement.refined_frames == FRAMES - 1 && refinement.kept_frames == 1, "{refinement:?}");
    for frame in [0, 2, 3, 4] {
        assert!(scene.error(&poses, frame) < scene.error(&scene.given, frame), "frame {frame}");
    }
}

#[test]
fn true_poses_stay_and_a_caller_may_stop() {
    let scene = Scene::new(4);
    let (poses, _) = scene.refine(&scene.truth);
    for frame in 0..FRAMES {
        assert!(scene.error(&poses, frame) < 5e-5, "{}", scene.error(&poses, frame));
    }
    let mut left = 30;
    let stopped = scene.refine_while(&scene.given, &mut || {
        left -= 1;
        left > 0
    });
    assert!(stopped.is_none() && left == 0);
}
