//! Colour and relief of the true hand's skin, as functions of the place on the hand at rest.

use glam::{DVec2, DVec3};

use super::anatomy::{Anatomy, Finger};
use super::noise::{bump, fractal, lattice, noise, smoothstep};

/// A place on the skin.
pub(super) struct Place<'a> {
    /// At rest, metres, model axes.
    pub position: DVec3,
    /// Unit normal, outwards.
    pub normal: DVec3,
    /// How much of it belongs to each finger of the anatomy, `[0, 1]`.
    pub memberships: &'a [f64],
}

/// What the skin is like at a place.
pub(super) struct Look {
    /// Display colour, `[0, 1]`.
    pub color: DVec3,
    /// Height above the smooth hand, metres.
    pub height: f64,
}

/// The skin of one hand.
pub(super) struct Skin<'a> {
    anatomy: &'a Anatomy,
    seed: u64,
    /// Lines on the back of the hand, as (along, across), metres.
    veins: Vec<Vec<DVec2>>,
    /// The three great lines of the palm.
    palm_lines: Vec<Vec<DVec2>>,
}

const BACK: DVec3 = DVec3::new(0.76, 0.545, 0.44);
const PALM: DVec3 = DVec3::new(0.89, 0.685, 0.59);
const BLOOD: DVec3 = DVec3::new(0.80, 0.36, 0.31);
const VEIN: DVec3 = DVec3::new(0.46, 0.47, 0.50);
const CREASE: DVec3 = DVec3::new(0.50, 0.27, 0.20);
const FRECKLE: DVec3 = DVec3::new(0.47, 0.29, 0.19);
const NAIL: DVec3 = DVec3::new(0.90, 0.68, 0.63);
const NAIL_EDGE: DVec3 = DVec3::new(0.95, 0.91, 0.86);

impl Skin<'_> {
    pub(super) fn new(anatomy: &Anatomy, seed: u64) -> Skin<'_> {
        let s = anatomy.scale;
        let curve = |points: [(f64, f64); 4]| cubic(points.map(|(along, across)| DVec2::new(along, across) * s));
        let knuckles: Vec<DVec3> = anatomy.fingers.iter().filter(|f| !f.is_thumb).map(|f| f.points[0]).collect();
        let mut veins = Vec::new();
        for (i, pair) in sorted_by_across(&knuckles).windows(2).enumerate() {
            // Veins gather between the knuckles and run, wavering, towards the wrist.
            let top = (pair[0] + pair[1]) * 0.5;
            let top = DVec2::new(-top.y * 0.97, top.z);
            let waver = |k: u64| (lattice(i as i64, k as i64, 0, seed) - 0.5) * 0.016 * s;
            let foot = DVec2::new(0.002 * s, top.y * 0.45 + waver(0));
            veins.push(cubic([
                top,
                top.lerp(foot, 0.33) + DVec2::new(0.0, waver(1)),
                top.lerp(foot, 0.66) + DVec2::new(0.0, waver(2)),
                foot,
            ]));
        }
        veins.push(curve([(0.060, -0.022), (0.052, -0.008), (0.044, 0.006), (0.036, 0.012)]));
        let palm_lines = vec![
            curve([(0.066, 0.042), (0.058, 0.018), (0.066, -0.004), (0.083, -0.013)]),
            curve([(0.066, -0.034), (0.062, -0.012), (0.054, 0.010), (0.038, 0.026)]),
            curve([(0.067, -0.034), (0.062, -0.008), (0.034, 0.002), (0.012, -0.002)]),
        ];
        Skin { anatomy, seed, veins, palm_lines }
    }

    /// Colour and relief at a place.
    pub(super) fn look(&self, place: &Place) -> Look {
        let s = self.anatomy.scale;
        let p = place.position;
        let palm_part = 1.0 - place.memberships.iter().sum::<f64>().clamp(0.0, 1.0);
        let facing = self.facing(place);
        let back = smoothstep(-0.35, 0.45, facing);
        let mut color = PALM.lerp(BACK, back);
        let mut height = 0.00025 * s * fractal(p, 0.009 * s, self.seed);

        // Blood below the skin comes and goes in patches; the palm is the more mottled side.
        let patches = fractal(p, 0.008 * s, self.seed + 10);
        color = color.lerp(BLOOD, (0.10 + 0.17 * patches * (1.2 - 0.5 * back)).max(0.0));
        color *= 1.0 + 0.06 * fractal(p, 0.0035 * s, self.seed + 20) + 0.04 * noise(p, 0.017 * s, self.seed + 30);

        self.veins_and_lines(place, palm_part, facing, &mut color, &mut height);
        self.freckles(p, back, &mut color);
        for (finger, &membership) in self.anatomy.fingers.iter().zip(place.memberships) {
            if membership + palm_part > 0.2 {
                self.knuckles(finger, place, membership, &mut color, &mut height);
            }
            if membership > 0.5 {
                self.creases(finger, place, &mut color, &mut height);
                self.nail(finger, place, &mut color, &mut height);
            }
        }
        Look { color: color.clamp(DVec3::ZERO, DVec3::ONE), height }
    }

    /// 1 where the skin faces away from the palm, -1 where it faces the palm's way.
    fn facing(&self, place: &Place) -> f64 {
        let mut dorsal = DVec3::X;
        for (finger, &membership) in self.anatomy.fingers.iter().zip(place.memberships) {
            dorsal = dorsal.lerp(finger.dorsal, membership.clamp(0.0, 1.0));
        }
        place.normal.dot(dorsal.normalize())
    }

    fn veins_and_lines(&self, place: &Place, palm_part: f64, facing: f64, color: &mut DVec3, height: &mut f64) {
        let s = self.anatomy.scale;
        let at = DVec2::new(-place.position.y, place.position.z);
        let on_back = smoothstep(0.35, 0.75, facing) * palm_part;
        if on_back > 0.0 {
            for (i, vein) in self.veins.iter().enumerate() {
                let d = distance(vein, at);
                let faint = 0.65 + 0.35 * noise(place.position, 0.02 * s, self.seed + 40 + i as u64);
                *color = color.lerp(VEIN, 0.38 * faint * on_back * bump(d, 0.0019 * s));
                *height += 0.0006 * s * faint * on_back * bump(d, 0.0020 * s);
            }
            // Tendons: shallow ridges from the wrist to each knuckle.
            for finger in self.anatomy.fingers.iter().filter(|f| !f.is_thumb) {
                let knuckle = DVec2::new(-finger.points[0].y, finger.points[0].z);
                let line = [DVec2::new(0.012 * s, knuckle.y * 0.3), knuckle];
                let ridge = on_back * bump(distance(&line, at), 0.0026 * s);
                *height += 0.0006 * s * ridge;
                *color = color.lerp(PALM, 0.16 * ridge);
            }
        }
        let on_palm = smoothstep(0.2, 0.6, -facing) * palm_part;
        if on_palm > 0.0 {
            let faint = 0.7 + 0.3 * noise(place.position, 0.012 * s, self.seed + 55);
            let wobble = 0.0008 * s * noise(place.position, 0.005 * s, self.seed + 50);
            for line in &self.palm_lines {
                let d = distance(line, at) + wobble;
                *color = color.lerp(CREASE, 0.45 * on_palm * faint * bump(d, 0.0009 * s));
                *height -= 0.0006 * s * on_palm * bump(d, 0.0013 * s);
            }
        }
    }

    fn freckles(&self, p: DVec3, back: f64, color: &mut DVec3) {
        let cell = 0.0065 * self.anatomy.scale;
        let base = (p / cell).floor();
        let [x, y, z] = base.to_array().map(|v| v as i64);
        for (dx, dy, dz) in (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| (x, y, z)))) {
            let number = |k: u64| lattice(x + dx, y + dy, z + dz, self.seed + 60 + k);
            let chance = 0.12 + 0.30 * back;
            if number(0) < chance {
                let center =
                    (base + DVec3::new(dx as f64 + number(1), dy as f64 + number(2), dz as f64 + number(3))) * cell;
                let size = cell * (0.07 + 0.13 * number(4) * number(4));
                let strength = (0.25 + 0.5 * number(5)) * (0.3 + 0.7 * back);
                *color = color.lerp(FRECKLE, strength * bump(p.distance(center), size));
            }
        }
    }

    /// Redness and swelling over the joints, and redness of the tips.
    fn knuckles(&self, finger: &Finger, place: &Place, membership: f64, color: &mut DVec3, height: &mut f64) {
        let s = self.anatomy.scale;
        let facing = place.normal.dot(finger.dorsal);
        let sizes = [0.0085, 0.0062, 0.0048].map(|v| v * s);
        for (k, size) in sizes.into_iter().enumerate() {
            let offset = place.position - finger.points[k];
            let above = smoothstep(0.1, 0.7, facing) * if k == 0 { 1.0 } else { membership };
            let near = bump(offset.reject_from(finger.dorsal).length(), size) * above;
            *color = color.lerp(BLOOD, 0.34 * near);
            *height += [0.0009, 0.0005, 0.0003][k] * s * near;
        }
        let tip = bump((place.position - finger.points[3]).length(), 0.011 * s);
        *color = color.lerp(BLOOD, 0.30 * tip * membership);
    }

    /// Flexion creases on the palm's side, folds on the back of the joints.
    fn creases(&self, finger: &Finger, place: &Place, color: &mut DVec3, height: &mut f64) {
        let s = self.anatomy.scale;
        let facing = place.normal.dot(finger.dorsal);
        let warp = 0.0007 * s * noise(place.position, 0.004 * s, self.seed + 70);
        let faint = 0.7 + 0.3 * noise(place.position, 0.006 * s, self.seed + 75);
        let below = smoothstep(-0.35, 0.25, -facing);
        let above = smoothstep(0.25, 0.7, facing);
        let base_crease = if finger.is_thumb { 0.05 } else { 0.47 } * finger.points[0].distance(finger.points[1]);
        let lines: [(usize, &[f64]); 3] = [(0, &[0.0]), (1, &[-0.0010, 0.0012]), (2, &[0.0])];
        for (k, offsets) in lines {
            let axis =
                if k == 0 { finger.direction(0) } else { (finger.direction(k - 1) + finger.direction(k)).normalize() };
            let start = finger.points[k] + axis * if k == 0 { base_crease } else { 0.0 };
            let along = (place.position - start).dot(axis) + warp;
            for offset in offsets {
                let depth = below * bump(along - offset * s, 0.00075 * s);
                *color = color.lerp(CREASE, 0.5 * depth * faint);
                *height -= 0.0006 * s * below * bump(along - offset * s, 0.0011 * s);
            }
            if k == 0 {
                continue;
            }
            // Folds on the back bow away from the joint's middle.
            let across = (place.position - start).dot(finger.dorsal.cross(axis));
            let reach = [0.0, 0.0042, 0.0026][k] * s;
            for fold in -2..=2 {
                let center = f64::from(fold) * 0.0019 * s;
                let bowed = along - center * (1.0 - 0.35 * (across / (0.006 * s)).powi(2));
                let depth = above * bump(bowed, 0.00055 * s) * bump(center, reach);
                *color = color.lerp(CREASE, 0.38 * depth);
                *height -= 0.0003 * s * depth;
            }
        }
    }

    fn nail(&self, finger: &Finger, place: &Place, color: &mut DVec3, height: &mut f64) {
        let axis = finger.direction(2);
        let offset = place.position - finger.points[3];
        let facing = place.normal.dot(finger.dorsal);
        let (half_length, half_width) = (0.72 * finger.radius, 0.74 * finger.radius);
        // From the free edge, a little behind the outermost point of the tip, backwards.
        let along = (offset.dot(axis) + 0.22 * finger.radius + half_length) / half_length;
        let across = offset.dot(finger.dorsal.cross(axis)) / half_width;
        let shape = (along.abs().powf(3.5) + across.abs().powf(3.0)).powf(0.3);
        let up = smoothstep(0.05, 0.3, facing);
        let inside = up * smoothstep(1.04, 0.94, shape);
        let fold = up * bump(shape - 1.09, 0.09) * smoothstep(0.9, 0.3, along);
        let mut nail = NAIL.lerp(NAIL_EDGE, smoothstep(0.72, 0.86, along));
        // The lunula.
        nail = nail.lerp(NAIL_EDGE, 0.55 * smoothstep(0.36, 0.22, DVec2::new(along + 0.95, across * 0.8).length()));
        *color = color.lerp(CREASE, 0.45 * fold).lerp(nail, inside);
        *height += finger.radius * (0.035 * fold - 0.05 * bump(shape - 1.0, 0.06) * up + 0.02 * inside);
    }
}

fn sorted_by_across(points: &[DVec3]) -> Vec<DVec3> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.z.total_cmp(&b.z));
    sorted
}

/// A Bézier curve as a polyline.
fn cubic([a, b, c, d]: [DVec2; 4]) -> Vec<DVec2> {
    (0..=16)
        .map(|i| {
            let t = f64::from(i) / 16.0;
            let u = 1.0 - t;
            u * u * u * a + 3.0 * u * u * t * b + 3.0 * u * t * t * c + t * t * t * d
        })
        .collect()
}

fn distance(line: &[DVec2], p: DVec2) -> f64 {
    line.windows(2)
        .map(|w| {
            let way = w[1] - w[0];
            let t = ((p - w[0]).dot(way) / way.length_squared().max(1e-18)).clamp(0.0, 1.0);
            p.distance(w[0] + way * t)
        })
        .fold(f64::INFINITY, f64::min)
}
