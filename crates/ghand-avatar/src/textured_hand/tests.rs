#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ghand_core::Side;
use ghand_hand_model::SurfaceSamples;
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::surface::sample_surface;

use super::*;
use crate::template::{AvatarConfig, GaussianShape};

/// A slow change of colour over the hand.
fn color_at(p: DVec3) -> DVec3 {
    DVec3::new(0.5 + 3.0 * p.y, 0.5 + 4.0 * p.z, 0.5 + 5.0 * p.x).clamp(DVec3::ZERO, DVec3::ONE)
}

/// An avatar with these colours, its Gaussians `inset` standard deviations below the built-in hand's surface.
fn painted(shape: GaussianShape, inset: f64) -> (Avatar, SurfaceSamples) {
    let model = builtin_hand(Side::Right).unwrap();
    let config = AvatarConfig { uv_resolution: 160, gaussians: shape, ..Default::default() };
    let samples = sample_surface(&model, 160).unwrap();
    let mut avatar = Avatar::untrained_at(&model, &samples, &config, [0.5; 3], inset, 1).unwrap();
    let colors: Vec<[f64; 3]> = samples.positions.iter().map(|p| color_at(*p).to_array()).collect();
    avatar.tables.set_constant_colors(&colors);
    (avatar, samples)
}

#[test]
fn the_texture_shows_the_gaussians_colours_without_holes_or_seams() {
    for shape in [GaussianShape::Flat, GaussianShape::Round] {
        let (avatar, _) = painted(shape, 1.0);
        let hand = TexturedHand::new(&avatar, 256).unwrap();
        assert!(hand.is_lit && hand.gloss.is_none());
        let texel = |at: u32| DVec3::from(hand.texture.rgb[at as usize].map(f64::from)) / 255.0;
        let places = sample_surface(&avatar.model, 256).unwrap();
        let wrong = places.texels.iter().zip(&places.positions).map(|(at, p)| (texel(*at) - color_at(*p)).abs());
        let wrong: Vec<f64> = wrong.map(DVec3::max_element).collect();
        let worst = wrong.iter().copied().fold(0.0, f64::max);
        let mean = wrong.iter().sum::<f64>() / wrong.len() as f64;
        // A Gaussian of 1.5 mm blends colours that differ by 0.5 in 100 mm.
        assert!(worst < 0.04 && mean < 0.004, "{shape:?}: {worst} {mean}");
        // Just outside the charts, where pictures are interpolated, are the colours of the nearest texels.
        let inside: std::collections::HashSet<u32> = places.texels.iter().copied().collect();
        let beyond: Vec<u32> = (places.texels.iter())
            .flat_map(|at| [at.wrapping_sub(1), at + 1, at.wrapping_sub(256), at + 256])
            .filter(|at| *at < 256 * 256 && !inside.contains(at))
            .collect();
        assert!(beyond.len() > 500);
        for at in beyond {
            let near = [at.wrapping_sub(1), at + 1, at.wrapping_sub(256), at + 256];
            let near =
                near.into_iter().filter(|near| inside.contains(near)).map(|near| texel(near).distance(texel(at)));
            assert!(near.fold(f64::INFINITY, f64::min) < 0.05);
        }
    }
}

#[test]
fn the_mesh_has_the_outline_of_the_gaussians() {
    let mean_move = |inset: f64| {
        let (avatar, _) = painted(GaussianShape::Flat, inset);
        let hand = TexturedHand::new(&avatar, 32).unwrap();
        let normals = avatar.model.vertex_normals(&avatar.model.vertices);
        let moves = hand.model.vertices.iter().zip(&avatar.model.vertices).zip(normals);
        let moves: Vec<f64> = moves.map(|((to, from), normal)| (*to - *from).dot(normal)).collect();
        moves.iter().sum::<f64>() / moves.len() as f64
    };
    let [on, below] = [0.0, 1.0].map(mean_move);
    // One standard deviation is 0.7 of the spacing of 2.0 mm, but little Gaussians of thin fingers are less deep.
    assert!(on > 0.0 && (on - below) > 0.8e-3 && (on - below) < 1.6e-3, "{on} {below}");
}

#[test]
fn impossible_sizes_are_refused() {
    let (avatar, _) = painted(GaussianShape::Round, 1.0);
    for size in [0, LARGEST_TEXTURE + 1] {
        let message = TexturedHand::new(&avatar, size).unwrap_err().to_string();
        assert!(message.contains("texture: has") && message.contains("choose 1 to 4096"), "{message}");
    }
}
