//! What a line through a hand's Gaussians meets: how much it is covered, and which colour is seen along it.

use std::collections::HashMap;

use ghand_core::HandModel;
use ghand_render::splat::FLATNESS;
use glam::{DVec3, IVec3};

use crate::reference::PosedGaussians;
use crate::scene::OPACITY;

/// How far from a place its surface may be, metres: training moves no Gaussian farther.
pub const REACH: f64 = 7e-3;
/// Edge of a grid's cell, metres.
const CELL: f64 = 4e-3;
/// A Gaussian that covers less is not drawn by the splatter either.
const LEAST_COVER: f64 = 1.0 / 255.0;
/// Squared distance, in standard deviations, at which a Gaussian covers that much.
const FARTHEST: f64 = 11.09;

/// A Gaussian of the hand.
struct Splat {
    mean: DVec3,
    /// Standard deviation, metres.
    scale: f64,
    /// The direction in which it is flat; zero if it is round.
    flat: DVec3,
    /// Outwards from the hand.
    outwards: DVec3,
    color: DVec3,
}

/// The Gaussians of a hand at rest, in a grid.
pub struct Cloud {
    splats: Vec<Splat>,
    /// The Gaussians that a line through a place in a cell can meet within [`REACH`] of that place.
    cells: HashMap<IVec3, Vec<u32>>,
}

/// A line through a place of the surface.
pub struct Line {
    /// The place, metres.
    pub place: DVec3,
    /// Outwards from the hand there: Gaussians of another side are not met.
    pub outwards: DVec3,
    /// Unit vector along the line, in the direction of looking.
    pub along: DVec3,
}

impl Cloud {
    /// The Gaussians of a hand at rest.
    pub fn new(model: &HandModel, gaussians: &PosedGaussians) -> Cloud {
        let normals = model.vertex_normals(&model.vertices);
        let nearest = |mean: DVec3| {
            let near = (0..normals.len()).min_by(|a, b| {
                let squared = |v: usize| model.vertices[v].distance_squared(mean);
                squared(*a).total_cmp(&squared(*b))
            });
            near.map_or(DVec3::Z, |v| normals[v])
        };
        let splat = |p: usize| Splat {
            mean: gaussians.means[p],
            scale: gaussians.scales[p],
            flat: gaussians.normals.as_ref().map_or(DVec3::ZERO, |normals| normals[p]),
            outwards: nearest(gaussians.means[p]),
            color: gaussians.colors[p],
        };
        let splats: Vec<Splat> = (0..gaussians.means.len()).map(splat).collect();
        let mut cells: HashMap<IVec3, Vec<u32>> = HashMap::new();
        for (i, splat) in splats.iter().enumerate() {
            let around = REACH.hypot(FARTHEST.sqrt() * splat.scale);
            let [low, high] = [cell(splat.mean - around), cell(splat.mean + around)];
            for x in low.x..=high.x {
                for y in low.y..=high.y {
                    for z in low.z..=high.z {
                        cells.entry(IVec3::new(x, y, z)).or_default().push(i as u32);
                    }
                }
            }
        }
        Cloud { splats, cells }
    }

    /// The Gaussians that a line meets: depth along the line from its place (metres), cover from 0 to 1, colour.
    fn met<'a>(&'a self, line: &'a Line) -> impl Iterator<Item = (f64, f64, DVec3)> + 'a {
        let near = self.cells.get(&cell(line.place)).map_or(&[][..], Vec::as_slice);
        near.iter().filter_map(move |i| {
            let splat = &self.splats[*i as usize];
            let from_place = splat.mean - line.place;
            let depth = from_place.dot(line.along);
            if depth.abs() > REACH || splat.outwards.dot(line.outwards) <= 0.0 {
                return None;
            }
            // The projection of the Gaussian along the line: a circle, or an ellipse that is thinner towards the
            // direction in which it is flat.
            let aside = from_place - line.along * depth;
            let thin = splat.flat - line.along * splat.flat.dot(line.along);
            let flattened = 1.0 - FLATNESS * FLATNESS;
            let gain = flattened / (1.0 - flattened * thin.length_squared());
            let squared = (aside.length_squared() + gain * thin.dot(aside).powi(2)) / (splat.scale * splat.scale);
            let cover = f64::from(OPACITY) * (-0.5 * squared).exp();
            (cover >= LEAST_COVER).then_some((depth, cover, splat.color))
        })
    }

    /// How much of a line is covered, from 0 to 1.
    pub fn cover(&self, line: &Line) -> f64 {
        1.0 - self.met(line).map(|(_, cover, _)| 1.0 - cover).product::<f64>()
    }

    /// The colour that is seen along a line, and how much of it is covered; `None` if it meets nothing.
    pub fn seen(&self, line: &Line) -> Option<(DVec3, f64)> {
        let mut met: Vec<_> = self.met(line).collect();
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut color = DVec3::ZERO;
        let mut left = 1.0;
        for (_, cover, own) in met {
            color += own * (left * cover);
            left *= 1.0 - cover;
        }
        let covered = 1.0 - left;
        (covered > 0.0).then(|| (color / covered, covered))
    }
}

fn cell(place: DVec3) -> IVec3 {
    (place / CELL).floor().as_ivec3()
}
