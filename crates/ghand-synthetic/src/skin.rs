//! Pose-independent colour and relief of the true hand's skin, as functions of the point on the hand at rest.

pub(crate) mod atlas;
pub(crate) mod complexion;
pub(crate) mod curve;
mod fine;
pub(crate) mod folds;
pub(crate) mod nails;

use glam::{DVec2, DVec3};

use super::noise::{bump, fractal, lattice, noise, smoothstep};
use crate::hand::anatomy::{Anatomy, Finger, SkinPoint};
use complexion::Complexion;
use curve::{cubic, distance};
use nails::NailPlate;

/// The skin at a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    /// Display colour, `[0, 1]`.
    pub color: DVec3,
    /// Height above the smooth hand, metres.
    pub height: f64,
}

/// The skin of one hand.
pub(super) struct Skin<'a> {
    anatomy: &'a Anatomy,
    complexion: &'a Complexion,
    seed: u64,
    /// Lines on the back of the hand, as (along, across), metres.
    veins: Vec<Vec<DVec2>>,
}

impl<'a> Skin<'a> {
    pub(super) fn new(anatomy: &'a Anatomy, complexion: &'a Complexion, seed: u64) -> Skin<'a> {
        let s = anatomy.scale;
        let fingers = anatomy.fingers.iter().filter(|f| !f.is_thumb);
        let knuckles: Vec<DVec2> = fingers.map(|f| anatomy.on_palm(f.points[0])).collect();
        let mut veins = Vec::new();
        for (i, pair) in sorted_by_across(&knuckles).windows(2).enumerate() {
            // Veins start between the knuckles and run in waves towards the wrist.
            let top = (pair[0] + pair[1]) * 0.5;
            let top = DVec2::new(top.x * 0.97, top.y);
            let waver = |k: u64| (lattice(i as i64, k as i64, 0, seed) - 0.5) * 0.016 * s;
            let foot = DVec2::new(0.002 * s, top.y * 0.45 + waver(0));
            veins.push(cubic([
                top,
                top.lerp(foot, 0.33) + DVec2::new(0.0, waver(1)),
                top.lerp(foot, 0.66) + DVec2::new(0.0, waver(2)),
                foot,
            ]));
        }
        let branch = [(0.68, 0.13), (0.59, 0.31), (0.51, 0.49), (0.43, 0.56)];
        veins.push(cubic(branch.map(|(along, across)| anatomy.between_knuckles(along, across))));
        Skin { anatomy, complexion, seed, veins }
    }

    /// Colour and relief at a point.
    pub(super) fn look(&self, point: &SkinPoint) -> Look {
        let s = self.anatomy.scale;
        let p = point.position;
        let palm_part = point.palm_part();
        let facing = self.anatomy.facing(point);
        let back = smoothstep(-0.35, 0.45, facing);
        let Complexion { back: of_back, palm, blood, .. } = *self.complexion;
        let mut color = palm.lerp(of_back, back);
        let mut height = 0.00025 * s * fractal(p, 0.009 * s, self.seed);

        // Blood below the skin makes patches; the palm is more mottled.
        let patches = fractal(p, 0.008 * s, self.seed + 10);
        color = color.lerp(blood, (0.10 + 0.17 * patches * (1.2 - 0.5 * back)).max(0.0));
        color *= 1.0 + 0.06 * fractal(p, 0.0035 * s, self.seed + 20) + 0.04 * noise(p, 0.017 * s, self.seed + 30);

        self.veins(point, palm_part, facing, &mut color, &mut height);
        self.freckles(p, back, &mut color);
        for (finger, &membership) in self.anatomy.fingers.iter().zip(point.finger_weights) {
            if membership + palm_part > 0.2 {
                self.knuckles(finger, point, membership, &mut color, &mut height);
            }
            if let Some(plate) = finger.nail.as_ref().filter(|_| membership > 0.5) {
                self.nail(plate, point, &mut color, &mut height);
            }
        }
        Look { color: color.clamp(DVec3::ZERO, DVec3::ONE), height }
    }

    fn veins(&self, point: &SkinPoint, palm_part: f64, facing: f64, color: &mut DVec3, height: &mut f64) {
        let s = self.anatomy.scale;
        let at = self.anatomy.on_palm(point.position);
        let on_back = smoothstep(0.35, 0.75, facing) * palm_part;
        if on_back > 0.0 {
            for (i, vein) in self.veins.iter().enumerate() {
                let d = distance(vein, at);
                let faint = 0.65 + 0.35 * noise(point.position, 0.02 * s, self.seed + 40 + i as u64);
                *color = color.lerp(self.complexion.vein, 0.38 * faint * on_back * bump(d, 0.0019 * s));
                *height += 0.0006 * s * faint * on_back * bump(d, 0.0020 * s);
            }
        }
    }

    fn freckles(&self, p: DVec3, back: f64, color: &mut DVec3) {
        let cell = 0.0065 * self.anatomy.scale;
        let base = (p / cell).floor();
        let [x, y, z] = base.to_array().map(|v| v as i64);
        for (dx, dy, dz) in (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| (x, y, z)))) {
            let number = |k: u64| lattice(x + dx, y + dy, z + dz, self.seed + 60 + k);
            let chance = 0.12 + self.complexion.freckles * back;
            if number(0) < chance {
                let center =
                    (base + DVec3::new(dx as f64 + number(1), dy as f64 + number(2), dz as f64 + number(3))) * cell;
                let size = cell * (0.07 + 0.13 * number(4) * number(4));
                let strength = (0.25 + 0.5 * number(5)) * (0.3 + 0.7 * back);
                *color = color.lerp(self.complexion.freckle, strength * bump(p.distance(center), size));
            }
        }
    }

    /// Redness and swelling over the joints, and redness of the tips.
    fn knuckles(&self, finger: &Finger, point: &SkinPoint, membership: f64, color: &mut DVec3, height: &mut f64) {
        let s = self.anatomy.scale;
        let facing = point.normal.dot(finger.dorsal);
        let sizes = [0.0085, 0.0062, 0.0048].map(|v| v * s);
        for (k, size) in sizes.into_iter().enumerate() {
            let offset = point.position - finger.points[k];
            let above = smoothstep(0.1, 0.7, facing) * if k == 0 { 1.0 } else { membership };
            let near = bump(offset.reject_from(finger.dorsal).length(), size) * above;
            *color = color.lerp(self.complexion.blood, 0.34 * near);
            *height += [0.0009, 0.0005, 0.0003][k] * s * near;
        }
        let tip = bump((point.position - finger.points[3]).length(), 0.011 * s);
        *color = color.lerp(self.complexion.blood, 0.30 * tip * membership);
    }

    /// A nail, smooth as its mesh, and the fold of skin around it.
    fn nail(&self, plate: &NailPlate, point: &SkinPoint, color: &mut DVec3, height: &mut f64) {
        let at = plate.coordinates(point.position);
        let out = plate.eccentricity(point.position);
        let part = plate.part_of(point.position, point.normal);
        let Complexion { nail, nail_edge, crease, .. } = *self.complexion;
        let up = smoothstep(0.05, 0.3, point.normal.dot(plate.normal));
        let fold = up * bump(out - 1.06, 0.06) * smoothstep(0.95, 0.6, at.x);
        let lunula = smoothstep(0.36, 0.22, DVec2::new(at.x + 0.95, at.y * 0.8).length());
        let nail = nail.lerp(nail_edge, smoothstep(0.74, 0.86, at.x)).lerp(nail_edge, 0.55 * lunula);
        *color = color.lerp(crease, 0.4 * fold).lerp(nail, part);
        *height *= 1.0 - part;
    }
}

fn sorted_by_across(points: &[DVec2]) -> Vec<DVec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.y.total_cmp(&b.y));
    sorted
}
