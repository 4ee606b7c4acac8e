//! Pictures of what baking has lost.

use ghand_avatar::{Avatar, PosedHand, Scene};
use ghand_core::{HandModel, Pose};
use ghand_measure::metrics::quantize;
use ghand_pictures::color_scale::{ColorScale, Colors};
use ghand_pictures::plot::label;
use ghand_render::Gpu;
use ghand_render::splat::{Image, Purpose};
use glam::DVec3;
use image::{Rgb, RgbImage};

use super::hand_painter::{Dots, HandPainter, palm_and_back};
use super::pose_set::NamedPose;
use ghand_avatar::framing::turntable;

const SIZE: [u32; 2] = [334, 512];
/// Height of the line of text above the pictures, and size of its letters, pixels.
const TITLE: u32 = 30;
const LETTERS: f64 = 18.0;
/// How much stronger differences are shown.
const DIFFERENCE: f32 = 4.0;
const INK: Rgb<u8> = Rgb([40, 40, 40]);
const PAPER: Rgb<u8> = Rgb([255, 255, 255]);

/// The avatar, the baked one and their difference in a pose.
///
/// # Errors
/// An error if the device failed.
pub fn side_by_side(gpu: &Gpu, exact: &Avatar, baked: &Avatar, pose: &NamedPose) -> anyhow::Result<RgbImage> {
    let Some(camera) = turntable(&exact.model, &[&pose.pose], 1, SIZE).into_iter().flatten().next() else {
        anyhow::bail!("there is no view of the hand");
    };
    let draw = |avatar: &Avatar| -> anyhow::Result<Image> {
        let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, SIZE)?;
        scene.set_pose(gpu, 0, 0, &pose.pose)?;
        Ok(scene.render(gpu, 0, &camera, [1.0; 3])?)
    };
    let [a, b] = [draw(exact)?, draw(baked)?];
    let [width, height] = SIZE;
    let mut sheet = RgbImage::from_pixel(3 * width, height + TITLE, PAPER);
    let titles = [format!("avatar, {}", pose.name), "baked".into(), format!("difference x {DIFFERENCE}")];
    for (k, title) in titles.iter().enumerate() {
        label(&mut sheet, [(k as u32 * width) as i32 + 8, 4], LETTERS, INK, title);
    }
    for (i, (a, b)) in a.rgba.iter().zip(&b.rgba).enumerate() {
        let (x, y) = (i as u32 % width, i as u32 / width + TITLE);
        let colors = [*a, *b].map(|p| [p[0], p[1], p[2]]);
        let difference = [0, 1, 2].map(|c| 1.0 - DIFFERENCE * (a[c] - b[c]).abs());
        for (k, color) in [colors[0], colors[1], difference].into_iter().enumerate() {
            sheet.put_pixel(x + k as u32 * width, y, Rgb(quantize(color)));
        }
    }
    Ok(sheet)
}

/// Posed centres of an avatar's Gaussians, metres, N.
fn posed(gpu: &Gpu, hand: &mut PosedHand, pose: &Pose) -> anyhow::Result<Vec<DVec3>> {
    hand.set_pose(gpu, pose)?;
    let table = hand.table(gpu)?;
    let n = hand.count();
    Ok((0..n).map(|p| DVec3::from([0, 1, 2].map(|c| f64::from(table[c * n + p])))).collect())
}

/// How far apart each Gaussian's places are in a pose, metres, in the baked avatar's order.
///
/// # Errors
/// An error if the device failed.
pub fn distances(gpu: &Gpu, exact: &Avatar, baked: &Avatar, pose: &Pose, order: &[usize]) -> anyhow::Result<Vec<f64>> {
    let a = posed(gpu, &mut PosedHand::new(gpu, exact)?, pose)?;
    let b = posed(gpu, &mut PosedHand::new(gpu, baked)?, pose)?;
    Ok(order.iter().zip(&b).map(|(p, b)| a[*p].distance(*b)).collect())
}

/// Where the loss is: the root mean square distance of each Gaussian's places over poses, on the hand at rest.
///
/// # Errors
/// An error if the device failed.
pub fn heat_map(
    gpu: &Gpu,
    exact: &Avatar,
    baked: &Avatar,
    order: &[usize],
    poses: &[NamedPose],
) -> anyhow::Result<RgbImage> {
    let [mut a, mut b] = [PosedHand::new(gpu, exact)?, PosedHand::new(gpu, baked)?];
    let mut squares = vec![0.0; order.len()];
    for named in poses {
        let [a, b] = [posed(gpu, &mut a, &named.pose)?, posed(gpu, &mut b, &named.pose)?];
        squares.iter_mut().zip(order).zip(&b).for_each(|((sum, p), b)| *sum += a[*p].distance_squared(*b));
    }
    let errors: Vec<f64> = squares.iter().map(|sum| 1e3 * (sum / poses.len().max(1) as f64).sqrt()).collect();
    let scale = ColorScale::new(Colors::Viridis, errors.iter().copied(), "mm");
    let colors: Vec<DVec3> = errors.iter().map(|error| scale.color(*error)).collect();
    let rest = Pose::rest(baked.template.joint_count());
    let positions = posed(gpu, &mut b, &rest)?;
    let normals = normals(&baked.model, &positions);
    let mut painter = HandPainter::new(gpu, &baked.template.spacings, SIZE)?;
    let [width, height] = SIZE;
    let legend = scale.legend(height);
    let mut sheet = RgbImage::from_pixel(2 * width + legend.width(), height + TITLE, PAPER);
    label(&mut sheet, [8, 4], LETTERS, INK, "Distance from the exact avatar over poses that were not fitted");
    for (k, camera) in palm_and_back(&baked.model, &rest, SIZE).iter().enumerate() {
        let dots = Dots { positions: &positions, normals: &normals, colors: &colors, ambient: 0.6 };
        let picture = painter.draw(&dots, camera)?;
        image::imageops::replace(&mut sheet, &picture, i64::from(k as u32 * width), i64::from(TITLE));
    }
    image::imageops::replace(&mut sheet, &legend, i64::from(2 * width), i64::from(TITLE));
    Ok(sheet)
}

/// The normal of the mesh's nearest vertex for each point.
fn normals(model: &HandModel, points: &[DVec3]) -> Vec<DVec3> {
    let normals = model.vertex_normals(&model.vertices);
    let nearest = |p: &DVec3| {
        let distances = model.vertices.iter().map(|v| v.distance_squared(*p)).enumerate();
        distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(v, _)| v)
    };
    points.iter().map(|p| normals[nearest(p)]).collect()
}
