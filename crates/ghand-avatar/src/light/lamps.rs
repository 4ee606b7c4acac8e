//! Lamps near the hand: their direction and strength change over it, and their shadows have soft edges.

use std::f64::consts::TAU;

use ghand_core::HandModel;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::visibility;

/// Points of a lamp from which its light comes.
pub(super) const POINTS: usize = 8;
/// The golden angle as a part of a turn: points in this order cover a disc evenly.
const GOLDEN: f64 = 0.381_966_011_250_105;

/// A lamp: a disc that faces the hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lamp {
    /// From the lamps' place to its middle, in the light's own axes, metres.
    pub offset: DVec3,
    /// Metres.
    pub radius: f64,
    /// The radiance of a direction of the light that would be as bright at the lamps' place, linear RGB.
    pub radiance: [f32; 3],
}

/// The lamps near a hand. They stand where they stood in the capture while the hand is where it was then. If the hand goes
/// elsewhere, they go with it: nobody has seen it there, and it might meet them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lamps {
    /// Where lamps are counted from: the middle of all hands in the capture, metres, world axes.
    pub place: DVec3,
    /// How far from it the hand was, metres.
    pub reach: f64,
    /// The lamps.
    pub lamps: Vec<Lamp>,
}

impl Lamps {
    /// The middle of a hand: where it is, as lamps see it.
    pub fn middle(vertices: &[DVec3]) -> DVec3 {
        vertices.iter().sum::<DVec3>() / vertices.len().max(1) as f64
    }

    /// Where the lamps stand for a hand with these vertices, metres, world axes. `turn` is from the light's axes.
    pub fn positions(&self, turn: DQuat, vertices: &[DVec3]) -> Vec<DVec3> {
        let away = Lamps::middle(vertices) - self.place;
        let place = self.place + away - away.clamp_length_max(self.reach);
        self.lamps.iter().map(|lamp| place + turn * lamp.offset).collect()
    }

    /// What one of the lamps, with a radiance of 1 at a position, gives the vertices, as the light's directions do.
    pub(super) fn column(
        &self,
        lamp: usize,
        model: &HandModel,
        position: DVec3,
        vertices: &[DVec3],
        normals: &[DVec3],
    ) -> Vec<f32> {
        self.lamps[lamp].column(&model.faces, position, vertices, normals)
    }
}

impl Lamp {
    /// As [`Lamps::column`], where it stands at a position.
    fn column(&self, faces: &[[u32; 3]], position: DVec3, vertices: &[DVec3], normals: &[DVec3]) -> Vec<f32> {
        let towards = (position - Lamps::middle(vertices)).try_normalize().unwrap_or(DVec3::Z);
        let (x, y) = towards.any_orthonormal_pair();
        let point = |i: usize| {
            let from_middle = self.radius * ((i as f64 + 0.5) / POINTS as f64).sqrt();
            let (sine, cosine) = (TAU * GOLDEN * i as f64).sin_cos();
            position + (x * cosine + y * sine) * from_middle
        };
        let points: Vec<DVec3> = (0..POINTS).map(point).collect();
        visibility::lamp_transfers(faces, vertices, normals, &points, self.offset.length())
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::light::{DIRECTION_COUNT, cosine_transfer, directions, shade};
    use ghand_core::{Pose, Side};
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::named_poses::named_pose;

    use super::*;
    use crate::light::{AvatarLight, Light};

    fn hand(name: &str) -> (HandModel, Pose) {
        let model = builtin_hand(Side::Right).unwrap().without_blend_shapes();
        let pose = named_pose(name, &model).unwrap();
        (model, pose)
    }

    /// Only a lamp, counted from the middle of the hand.
    fn lamp_alone(model: &HandModel, offset: DVec3, radius: f64) -> Light {
        let lamps = vec![Lamp { offset, radius, radiance: [40.0, 30.0, 20.0] }];
        let place = Lamps::middle(&model.vertices);
        let coefficients = vec![[0.0; 3]; DIRECTION_COUNT];
        Light { coefficients, lamps: Some(Lamps { place, reach: 0.1, lamps }), ..Light::studio() }
    }

    fn shades(light: &Light, model: &HandModel, pose: &Pose) -> Vec<[f32; 3]> {
        light.shades(&light.parts(model, pose).unwrap(), [0.0; 3])
    }

    #[test]
    fn a_lamp_far_away_is_a_direction() {
        for name in ["open", "fist"] {
            let (model, pose) = hand(name);
            for k in [3, 20, 41] {
                let mut distant = Light { coefficients: vec![[0.0; 3]; DIRECTION_COUNT], ..Light::studio() };
                distant.coefficients[k] = [40.0, 30.0, 20.0];
                let lamp = lamp_alone(&model, directions()[k] * 200.0, 0.0);
                let [near, far] = [lamp, distant].map(|light| shades(&light, &model, &pose));
                let differences = near.iter().zip(&far).filter(|(a, b)| (a[0] - b[0]).abs() > 0.05).count();
                assert!(differences < near.len() / 100, "{name}, {k}: {differences} of {} vertices differ", near.len());
            }
        }
    }

    #[test]
    fn vertices_see_a_lamp_where_rays_reach_it() {
        for name in ["open", "fist", "pinch"] {
            let (model, pose) = hand(name);
            let vertices = ghand_core::posing::pose_hand(&model, &[], &pose).unwrap().vertices;
            let normals = model.vertex_normals(&vertices);
            let (mut agree, mut count, mut hidden) = (0.0, 0.0, 0.0);
            for towards in [DVec3::new(1.0, -0.3, 0.2), DVec3::new(-0.8, 0.1, 0.6), DVec3::new(0.1, -0.4, -1.0)] {
                let at = Lamps::middle(&vertices) + 0.3 * towards;
                let offset = 0.3 * towards;
                let lamp = Lamp { offset, radius: 0.0, radiance: [1.0; 3] };
                let column = lamp.column(&model.faces, at, &vertices, &normals);
                for v in (0..vertices.len()).step_by(13) {
                    let to = at - vertices[v];
                    let open =
                        cosine_transfer(normals[v], to.normalize()) * offset.length_squared() / to.length_squared();
                    if normals[v].dot(to.normalize()) <= 0.2 {
                        continue;
                    }
                    let from = vertices[v] + normals[v] * 0.002;
                    let triangle = |face: &[u32; 3]| face.map(|corner| vertices[corner as usize]);
                    let lit = !model.faces.iter().any(|face| visibility::tests::meets(from, to, triangle(face)));
                    count += 1.0;
                    hidden += if lit { 0.0 } else { 1.0 };
                    agree += 1.0 - (f64::from(column[v]) / open - if lit { 1.0 } else { 0.0 }).abs();
                }
            }
            println!("{name}: {:.3} agree, {:.3} hidden", agree / count, hidden / count);
            // As with directions: skin lies on skin in a fist.
            assert!(agree / count > if name == "fist" { 0.82 } else { 0.95 }, "{name}: {}", agree / count);
            assert!(name == "open" || hidden / count > 0.1, "{name}: {}", hidden / count);
        }
    }

    #[test]
    fn a_hand_is_brighter_nearer_to_the_lamp_and_takes_it_along_beyond_its_reach() {
        let (model, rest) = hand("open");
        let towards = DVec3::new(0.6, -0.2, 0.77).normalize();
        let light = lamp_alone(&model, 0.5 * towards, 0.05);
        let at = |shift: DVec3| {
            let pose = Pose { translation: shift, ..rest.clone() };
            let shades = shades(&light, &model, &pose);
            shades.iter().map(|s| f64::from(s[0])).sum::<f64>() / shades.len() as f64
        };
        let [away, here, near] = [-0.09, 0.0, 0.09].map(|d| at(d * towards));
        assert!(away < 0.95 * here && here < 0.95 * near, "{away} {here} {near}");
        // However far it goes.
        let border = at(0.1 * towards);
        for distance in [0.3, 0.5, 20.0, 1e6] {
            assert!((at(distance * towards) / border - 1.0).abs() < 0.02, "{distance}");
        }
    }

    #[test]
    fn whatever_a_lamp_is_shades_are_finite() {
        let (model, pose) = hand("fist");
        for distance in [1e-9, 1e-3, 0.05, 1.0, 1e9] {
            for radius in [0.0, 1e-3, 1.0, 1e9] {
                let light = lamp_alone(&model, DVec3::new(0.0, distance, 0.0), radius);
                let on_hand = shades(&light, &model, &pose);
                assert!(on_hand.iter().flatten().all(|s| s.is_finite() && *s >= 0.0), "{distance}, {radius}");
                assert!(on_hand.iter().flatten().all(|s| f64::from(*s) < shade(1000.0)), "{distance}, {radius}");
            }
        }
    }

    #[test]
    fn hollows_are_brighter_with_light_that_skin_throws_on_skin_and_open_skin_is_not() {
        let (model, pose) = hand("fist");
        let samples = ghand_hand_model::surface::sample_surface(&model, 16).unwrap();
        let none = AvatarLight::new(Light::studio(), None, &samples);
        let some = AvatarLight { interreflection: [0.6, 0.3, 0.0], ..none.clone() };
        let parts = none.light.parts(&model, &pose).unwrap();
        let [before, after] = [&none, &some].map(|lit| lit.light.shades(&parts, lit.interreflection));
        for (v, closed) in parts.closed.iter().enumerate() {
            let gains = [0, 1, 2].map(|c| after[v][c] - before[v][c]);
            assert!(gains[0] >= gains[1] && gains[1] >= 0.0 && gains[2] == 0.0, "{gains:?}");
            assert!(*closed > 0.0 || gains[0] == 0.0);
        }
        let darkest = (0..before.len()).max_by(|a, b| parts.closed[*a].total_cmp(&parts.closed[*b])).unwrap();
        assert!(parts.closed[darkest] > 0.6 && after[darkest][0] > 1.1 * before[darkest][0]);
    }
}
