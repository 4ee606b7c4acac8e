//! The mesh that light falls on, which may be finer than the avatar's own.
//!
//! An avatar's triangles are some millimetres long, and light changes faster than that where skin bends. So each may be
//! divided into four ([`Division`]). What hides light is the avatar's own mesh. Each vertex looks for the brightest sources of
//! light; for the others only the avatar's own vertices do, as that takes time: of these, to the middle of an edge comes as
//! much of the light that its normal is turned to as reaches its ends.

use ghand_core::hand_model::vertex_normals;
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, InvalidHandModel, Pose};
use ghand_hand_model::surface::smooth::Division;
use glam::DVec3;

use super::{AvatarLight, Gloss, IrradianceParts, Light, gloss, shades};

/// The mesh that an avatar's light falls on.
#[derive(Debug, Clone)]
pub struct LitMesh {
    model: HandModel,
    division: Option<Division>,
    /// How glossy the model's own vertices are; empty without gloss.
    strengths: Vec<[f32; 3]>,
}

/// What light gives a mesh in a pose.
#[derive(Debug, Clone)]
pub struct LitParts {
    /// What the avatar's own vertices get.
    pub own: IrradianceParts,
    /// What all vertices get of the brightest sources, whether they are trusted or not, if the mesh is divided.
    bright: Option<IrradianceParts>,
}

impl LitMesh {
    /// Of an avatar's light on its hand model.
    pub fn new(lit: &AvatarLight, model: &HandModel) -> LitMesh {
        LitMesh {
            division: lit.divided.then(|| Division::new(&model.faces, model.vertices.len())),
            strengths: lit.gloss.as_ref().map_or(vec![], |gloss| gloss.vertex_strengths(model)),
            model: model.clone(),
        }
    }

    /// Its triangles.
    pub fn faces(&self) -> &[[u32; 3]] {
        self.division.as_ref().map_or(&self.model.faces, |division| &division.faces)
    }

    /// Number of its vertices: the avatar's own, then the middles of edges.
    pub fn vertex_count(&self) -> usize {
        self.model.vertices.len() + self.division.as_ref().map_or(0, |division| division.ends.len())
    }

    /// What a light gives it in a pose.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the hand.
    pub fn parts(&self, light: &Light, pose: &Pose) -> Result<LitParts, InvalidHandModel> {
        let own = pose_hand(&self.model, &[], pose)?.vertices;
        let normals = self.model.vertex_normals(&own);
        let Some(division) = &self.division else {
            return Ok(LitParts { own: light.parts_of(&self.model, [own, normals], &[]), bright: None });
        };
        let vertices = division.positions(&own, &normals);
        let normals = vertex_normals(&division.faces, &vertices);
        let of_own = normals[..own.len()].to_vec();
        let bright = light.bright_parts(&self.model, vertices, normals);
        let own = light.parts_of(&self.model, [own, of_own], &bright.columns);
        Ok(LitParts { own, bright: Some(bright) })
    }

    /// The shade of each vertex, RGB, with as much light that skin throws on skin as `interreflection` says.
    pub fn shades(&self, light: &Light, parts: &LitParts, interreflection: [f32; 3]) -> Vec<[f32; 3]> {
        let mut irradiances = light.irradiances(&parts.own, interreflection);
        if let (Some(division), Some(all)) = (&self.division, &parts.bright) {
            let bright = light.irradiances(all, [0.0; 3]);
            let open = light.open_irradiances(&all.normals, &light.bright());
            let (middles, open_in_middles) = (&bright[irradiances.len()..], &open[irradiances.len()..]);
            let ends: Vec<End> = (irradiances.iter().zip(&bright).zip(&open).zip(&parts.own.trust))
                .map(|(((whole, bright), open), trust)| End::new(whole, bright, *open, f64::from(*trust)))
                .collect();
            let lit = middles.iter().zip(open_in_middles);
            irradiances
                .extend(division.middles(&ends, End::mean).zip(lit).map(|(ends, (b, open))| ends.turned(b, open)));
        }
        shades(&irradiances)
    }

    /// What each vertex mirrors to an eye (metres, world axes), linear RGB.
    pub fn gloss(&self, gloss: &Gloss, light: &Light, parts: &LitParts, eye: DVec3) -> Vec<[f32; 3]> {
        let mut values = gloss::of_vertices(light, &parts.own, gloss.roughness, eye);
        let mut strengths = self.strengths.clone();
        if let (Some(division), Some(all)) = (&self.division, &parts.bright) {
            let bright = gloss::of_vertices(light, all, gloss.roughness, eye);
            let trust = |v: usize| parts.own.trust[v];
            let rest: Vec<([f32; 3], f32)> = (0..values.len())
                .map(|v| (std::array::from_fn(|c| values[v][c] - trust(v) * bright[v][c]), trust(v)))
                .collect();
            let mean = |a: &[f32; 3], b: &[f32; 3]| -> [f32; 3] { std::array::from_fn(|c| 0.5 * (a[c] + b[c])) };
            let ends = division.middles(&rest, |a, b| (mean(&a.0, &b.0), 0.5 * (a.1 + b.1)));
            let whole = |((rest, trust), bright): (([f32; 3], f32), &[f32; 3])| {
                std::array::from_fn(|c| (rest[c] + trust * bright[c]).max(0.0))
            };
            let middles: Vec<[f32; 3]> = ends.zip(&bright[values.len()..]).map(whole).collect();
            strengths.extend(division.middles(&self.strengths, mean));
            values.extend(middles);
        }
        gloss::scale(&mut values, &strengths);
        values
    }
}

/// A vertex in the light of all sources but the brightest, or the mean of two.
struct End {
    irradiance: [f64; 3],
    /// What it would be if nothing were in the way.
    open: [f64; 3],
    /// The light's trust.
    trust: f64,
}

impl End {
    fn new(whole: &[f64; 3], bright: &[f64; 3], open: [f64; 3], trust: f64) -> End {
        End { irradiance: std::array::from_fn(|c| whole[c] - trust * bright[c]), open, trust }
    }

    fn mean(a: &End, b: &End) -> End {
        let mean = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
        End {
            irradiance: mean(a.irradiance, b.irradiance),
            open: mean(a.open, b.open),
            trust: 0.5 * (a.trust + b.trust),
        }
    }

    /// The irradiance of a vertex like this that gets so much of the brightest sources, and of the others would get so much if
    /// nothing were in the way.
    fn turned(&self, bright: &[f64; 3], open: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|c| {
            let seen = (self.irradiance[c] / self.open[c].max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            self.irradiance[c] + self.trust * (bright[c] + seen * (open[c] - self.open[c]))
        })
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_core::light::DIRECTION_COUNT;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::named_poses::named_pose;
    use ghand_hand_model::surface::sample_surface;
    use ghand_hand_model::surface::smooth::smoothed;

    use super::*;
    use crate::light::{Lamp, Lamps, LightKind};

    fn root_mean_square(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
        let squares = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(a - b).powi(2));
        (squares.sum::<f64>() / a.as_flattened().len() as f64).sqrt()
    }

    /// A light, a single direction, and one with a lamp near the hand.
    fn lights(model: &HandModel) -> [Light; 3] {
        let mut hard = Light::studio();
        hard.coefficients.fill([0.2; 3]);
        hard.coefficients[20] = [50.0, 40.0, 30.0];
        let lamp = Lamp { offset: DVec3::new(0.5, 0.3, 0.4), radius: 0.1, radiance: [20.0, 10.0, 5.0] };
        let place = Lamps::middle(&model.vertices);
        let near = Light { lamps: Some(Lamps { place, reach: 0.1, lamps: vec![lamp] }), ..Light::studio() };
        [Light::studio(), hard, near]
    }

    fn on(model: &HandModel, light: &Light, divided: bool) -> AvatarLight {
        let samples = sample_surface(model, 16).unwrap();
        AvatarLight { divided, ..AvatarLight::new(light.clone(), None, &samples) }
    }

    #[test]
    fn shades_of_a_divided_mesh_are_near_those_of_a_finer_hand() {
        let model = builtin_hand(Side::Right).unwrap().without_blend_shapes();
        let fine = smoothed(&model);
        for name in ["open", "fist", "pinch"] {
            let pose = named_pose(name, &model).unwrap();
            for (k, light) in lights(&model).iter().enumerate() {
                let exact = light.shades(&light.parts(&fine, &pose).unwrap(), [0.0; 3]);
                let mesh = LitMesh::new(&on(&model, light, true), &model);
                let shades = mesh.shades(light, &mesh.parts(light, &pose).unwrap(), [0.0; 3]);
                assert_eq!((mesh.faces(), mesh.vertex_count()), (&fine.faces[..], fine.vertices.len()));
                let own = light.shades(&light.parts(&model, &pose).unwrap(), [0.0; 3]);
                let division = Division::new(&model.faces, own.len());
                let mean = |a: &[f32; 3], b: &[f32; 3]| std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
                let means = own.iter().copied().chain(division.middles(&own, mean)).collect::<Vec<_>>();
                let [found, without] = [&shades, &means].map(|shades| root_mean_square(shades, &exact));
                println!("{name}, light {k}: {found:.4}, {without:.4} on the mesh itself");
                assert!(found < without, "{name}, light {k}: {found}, {without}");
            }
        }
    }

    #[test]
    fn on_the_mesh_itself_all_is_as_its_vertices_have_it() {
        let model = builtin_hand(Side::Left).unwrap().without_blend_shapes();
        let pose = named_pose("relaxed", &model).unwrap();
        let light = Light::studio();
        let mesh = LitMesh::new(&on(&model, &light, false), &model);
        let parts = mesh.parts(&light, &pose).unwrap();
        let whole = light.parts(&model, &pose).unwrap();
        assert_eq!(parts.own, whole);
        assert_eq!(mesh.shades(&light, &parts, [0.1; 3]), light.shades(&whole, [0.1; 3]));
        assert_eq!((mesh.faces(), mesh.vertex_count()), (&model.faces[..], model.vertices.len()));
    }

    #[test]
    fn gloss_of_a_divided_mesh_is_near_that_of_a_finer_hand() {
        let model = builtin_hand(Side::Left).unwrap().without_blend_shapes();
        let fine = smoothed(&model);
        let gloss = Gloss { roughness: 0.5, strengths: vec![[1.0, 0.5, 0.0]; model.joint_count()] };
        let eye = DVec3::new(0.3, -0.5, 0.2);
        for (name, light) in ["relaxed", "open", "pinch"].into_iter().zip(lights(&model)) {
            let pose = named_pose(name, &model).unwrap();
            let lit = AvatarLight { gloss: Some(gloss.clone()), ..on(&model, &light, true) };
            let mesh = LitMesh::new(&lit, &model);
            let values = mesh.gloss(&gloss, &light, &mesh.parts(&light, &pose).unwrap(), eye);
            let of_hand = |hand: &HandModel| {
                let mut values = gloss::of_vertices(&light, &light.parts(hand, &pose).unwrap(), gloss.roughness, eye);
                gloss::scale(&mut values, &gloss.vertex_strengths(hand));
                values
            };
            let own = of_hand(&model);
            let division = Division::new(&model.faces, own.len());
            let mean = |a: &[f32; 3], b: &[f32; 3]| std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
            let means = own.iter().copied().chain(division.middles(&own, mean)).collect::<Vec<_>>();
            let exact = of_hand(&fine);
            let [found, without] = [&values, &means].map(|values| root_mean_square(values, &exact));
            println!("{name}: {found:.5}, {without:.5} on the mesh itself");
            assert!(values.iter().any(|value| value[0] > 0.0) && values.iter().all(|value| value[2] == 0.0));
            assert!(found < without, "{name}: {found}, {without}");
        }
    }

    #[test]
    fn irradiances_of_many_normals_are_those_of_each() {
        let model = builtin_hand(Side::Right).unwrap().without_blend_shapes();
        let turn = glam::DQuat::from_rotation_y(0.7);
        let harmonics = vec![[0.9, 0.3, 0.1]; LightKind::Sh.len()];
        let sh = Light { kind: LightKind::Sh, coefficients: harmonics, ..Light::studio() };
        let normals: Vec<DVec3> = ghand_core::light::directions()[..37].to_vec();
        for light in lights(&model).into_iter().chain([sh]) {
            let light = Light { turn, ..light };
            let many = light.open_irradiances(&normals, &[]);
            assert_eq!(many.len(), normals.len());
            for (normal, found) in normals.iter().zip(many) {
                let expected = light.open_irradiance(turn.inverse() * *normal);
                let near = |(a, b): (f64, f64)| (a - b).abs() <= 1e-5 * (1.0 + b.abs());
                assert!(found.into_iter().zip(expected).all(near), "{found:?}, {expected:?}");
            }
        }
        assert_eq!(lights(&model)[0].coefficients.len(), DIRECTION_COUNT);
    }
}
