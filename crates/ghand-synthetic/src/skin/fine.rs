//! What only images of a megapixel or more show of skin: its fine mesh of furrows with pores, and the ridges of prints.

use glam::{DVec2, DVec3};

use super::Skin;
use crate::hand::anatomy::SkinPoint;
use crate::noise::{bump, lattice, noise, smoothstep};

/// Distance between furrows on the back of the hand, metres.
const CELL: f64 = 0.0009;
/// Width of a furrow and of a pore, parts of a cell.
const FURROW: f64 = 0.13;
const PORE: f64 = 0.14;
/// Distance between two ridges of a print, metres.
const RIDGE: f64 = 0.00055;
/// How much darker furrows, pores and the valleys of prints are.
const FURROW_DEPTH: f64 = 0.10;
const PORE_DEPTH: f64 = 0.22;
const VALLEY_DEPTH: f64 = 0.13;

impl Skin<'_> {
    /// By how much fine detail darkens the skin at a point: a factor of its colour.
    pub(super) fn fine_shade(&self, point: &SkinPoint) -> f64 {
        let s = self.anatomy.scale;
        let facing = self.anatomy.facing(point);
        let on_palm = smoothstep(0.0, -0.35, facing);
        let furrows = if on_palm < 1.0 { self.furrows(point.position / (CELL * s)) } else { 0.0 };
        let valleys = if on_palm > 0.0 { VALLEY_DEPTH * self.valleys(point, RIDGE * s) } else { 0.0 };
        let nails = self.anatomy.fingers.iter().filter_map(|finger| finger.nail.as_ref());
        let nail = nails.map(|plate| plate.part_of(point.position, point.normal)).fold(0.0, f64::max);
        1.0 - (1.0 - nail) * ((1.0 - on_palm) * furrows + on_palm * valleys)
    }

    /// Furrows between cells of random centres, and a pore in some centres; `p` in cells.
    fn furrows(&self, p: DVec3) -> f64 {
        let base = p.floor();
        let [x, y, z] = base.to_array().map(|v| v as i64);
        let mut nearest = [f64::INFINITY; 2];
        let mut has_pore = false;
        for (dx, dy, dz) in (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| (x, y, z)))) {
            let number = |k: u64| lattice(x + dx, y + dy, z + dz, self.seed + 80 + k);
            let centre = base + DVec3::new(dx as f64 + number(0), dy as f64 + number(1), dz as f64 + number(2));
            let distance = p.distance(centre);
            if distance < nearest[0] {
                nearest = [distance, nearest[0]];
                has_pore = number(3) < 0.4;
            } else {
                nearest[1] = nearest[1].min(distance);
            }
        }
        let pore = if has_pore { PORE_DEPTH * bump(nearest[0], PORE) } else { 0.0 };
        FURROW_DEPTH * bump(nearest[1] - nearest[0], FURROW) + pore
    }

    /// 1 in the valleys between ridges, 0 on them: whorls on the fingertips, else lines across fingers and palm.
    fn valleys(&self, point: &SkinPoint, ridge: f64) -> f64 {
        let s = self.anatomy.scale;
        let waver = 0.004 * s * noise(point.position, 0.011 * s, self.seed + 90);
        let mut across = self.anatomy.on_palm(point.position).dot(DVec2::new(0.8, 0.6));
        for (finger, &membership) in self.anatomy.fingers.iter().zip(point.finger_weights) {
            if membership > 0.5 {
                let core =
                    finger.points[3] - finger.direction(2) * (0.6 * finger.radius) - finger.dorsal * finger.radius;
                let from_core = point.position - core;
                let along = from_core.dot(finger.direction(2));
                let whorl = from_core.reject_from(finger.dorsal).length();
                // Below the core the arcs become lines across the finger.
                across = whorl + (along.abs() - whorl) * smoothstep(0.0, -1.6 * finger.radius, along);
            }
        }
        0.5 + 0.5 * (std::f64::consts::TAU * (across + waver) / ridge).cos()
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;
    use crate::hand::anatomy::Anatomy;
    use crate::skin::complexion::Complexion;

    /// The shades along a line of the hand at rest, every fiftieth of a millimetre for a centimetre.
    fn shades(start: impl Fn(&Anatomy) -> DVec3, facing: f64) -> Vec<f64> {
        let anatomy = Anatomy::of(&builtin_hand(Side::Right).unwrap());
        let complexion = Complexion::of(7);
        let skin = Skin::new(&anatomy, &complexion, 7);
        let finger = anatomy.fingers.iter().position(|finger| !finger.is_thumb).unwrap();
        let weights: Vec<f64> = (0..anatomy.fingers.len()).map(|k| f64::from(k == finger)).collect();
        let (direction, dorsal) = (anatomy.fingers[finger].direction(1), anatomy.fingers[finger].dorsal);
        let shade = |k: u32| {
            let position = start(&anatomy) + direction * (f64::from(k) * 2e-5);
            skin.fine_shade(&SkinPoint { position, normal: dorsal * facing, finger_weights: &weights })
        };
        (0..500).map(shade).collect()
    }

    /// How often values cross their mean.
    fn crossings(values: &[f64]) -> usize {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.windows(2).filter(|pair| (pair[0] < mean) != (pair[1] < mean)).count()
    }

    #[test]
    fn prints_repeat_twice_a_millimetre_and_furrows_less_often_without_an_order() {
        let middle = |anatomy: &Anatomy| {
            let finger = anatomy.fingers.iter().find(|finger| !finger.is_thumb).unwrap();
            finger.points[1] - finger.dorsal * finger.radius
        };
        let palm = shades(middle, -1.0);
        let back = shades(middle, 1.0);
        // Two crossings a ridge, of 0.55 mm.
        assert!((30..=44).contains(&crossings(&palm)), "{}", crossings(&palm));
        assert!((8..=40).contains(&crossings(&back)), "{}", crossings(&back));
        for shade in palm.into_iter().chain(back) {
            assert!((1.0 - FURROW_DEPTH - PORE_DEPTH..=1.0).contains(&shade), "{shade}");
        }
    }

    #[test]
    fn nails_are_smooth() {
        let on_nail = |anatomy: &Anatomy| {
            let finger = anatomy.fingers.iter().find(|finger| !finger.is_thumb).unwrap();
            let hand = builtin_hand(Side::Right).unwrap();
            let plate = finger.nail.as_ref().unwrap();
            let inside = |v: &&DVec3| plate.part_of(**v, plate.normal) > 0.99;
            *hand.vertices.iter().find(inside).expect("a vertex of the nail")
        };
        let shade = shades(on_nail, 1.0)[0];
        assert!(shade > 0.99, "{shade}");
    }
}
