//! The light of an avatar as tensors.

use ghand_core::light::DIRECTION_COUNT;
use glam::{DQuat, DVec3};
use safetensors::tensor::Dtype;

use super::{AvatarFileError, Reader, Tensors};
use crate::light::{AvatarLight, Gloss, Lamp, Lamps, Light, LightKind, MOST_INTERREFLECTION, Trust};

/// Numbers of a lamp: its offset, its radius, its radiance.
const LAMP_NUMBERS: usize = 7;

/// Adds the tensors of a light.
pub(super) fn write(lit: &AvatarLight, out: &mut Tensors) {
    let light = &lit.light;
    out.add("light.coefficients", Dtype::F32, &[light.coefficients.len(), 3], light.coefficients.as_flattened());
    out.add("light.turn", Dtype::F64, &[4], &light.turn.to_array());
    out.add("light.faces", Dtype::U32, &[lit.faces.len()], &lit.faces);
    out.add("light.barycentric", Dtype::F32, &[lit.barycentric.len(), 3], lit.barycentric.as_flattened());
    if let Some(trust) = &light.trust {
        out.add("light.trust", Dtype::F32, &[trust.values().len(), 2], trust.values().as_flattened());
    }
    if let Some(lamps) = &light.lamps {
        let row = |lamp: &Lamp| {
            let radiance = lamp.radiance.map(f64::from);
            [&lamp.offset.to_array()[..], &[lamp.radius], &radiance].concat()
        };
        let rows: Vec<f64> = lamps.lamps.iter().flat_map(row).collect();
        out.add("light.lamps", Dtype::F64, &[lamps.lamps.len(), LAMP_NUMBERS], &rows);
        let [x, y, z] = lamps.place.to_array();
        out.add("light.place", Dtype::F64, &[4], &[x, y, z, lamps.reach]);
    }
    if lit.interreflection != [0.0; 3] {
        out.add("light.interreflection", Dtype::F32, &[3], &lit.interreflection);
    }
    if let Some(gloss) = &lit.gloss {
        out.add("light.roughness", Dtype::F64, &[1], &[gloss.roughness]);
        out.add("light.gloss", Dtype::F32, &[gloss.strengths.len(), 3], gloss.strengths.as_flattened());
    }
}

impl Reader<'_> {
    /// A light on `count` Gaussians on a mesh of `faces` faces, of a hand of `joints` joints.
    pub(super) fn light(
        &self,
        kind: LightKind,
        count: usize,
        faces: usize,
        joints: usize,
    ) -> Result<AvatarLight, AvatarFileError> {
        let coefficients = self.floats("light.coefficients", &[Some(kind.len()), Some(3)])?;
        let coefficients = coefficients.as_chunks::<3>().0.to_vec();
        if kind == LightKind::Transfer && coefficients.iter().flatten().any(|radiance| *radiance < 0.0) {
            return Err(self.invalid("light.coefficients", "a radiance is negative; train the avatar again"));
        }
        // The first files of version 3 had no turn.
        let turn = match self.has("light.turn") {
            true => DQuat::from_slice(&self.doubles("light.turn", &[Some(4)])?),
            false => DQuat::IDENTITY,
        };
        if !turn.is_normalized() {
            return Err(self.invalid("light.turn", "is not a unit quaternion; train the avatar again"));
        }
        let divided = self.metadata.light_divided;
        let faces = if divided { 4 * faces } else { faces };
        let (_, on) = self.tensor::<u32>("light.faces", Dtype::U32, &[Some(count)])?;
        if let Some(face) = on.iter().find(|face| **face as usize >= faces) {
            return Err(self.invalid("light.faces", format!("names face {face} of {faces}; train the avatar again")));
        }
        let barycentric = self.floats("light.barycentric", &[Some(count), Some(3)])?.as_chunks::<3>().0.to_vec();
        let gloss = self.gloss(joints)?;
        let light = Light { kind, turn, coefficients, lamps: self.lamps(kind)?, trust: self.trust()? };
        Ok(AvatarLight { light, divided, faces: on, barycentric, gloss, interreflection: self.interreflection(kind)? })
    }

    /// The lamps near the hand; files before version 6 have none.
    fn lamps(&self, kind: LightKind) -> Result<Option<Lamps>, AvatarFileError> {
        if !self.has("light.lamps") {
            return Ok(None);
        }
        let wrong = |field: &str, problem: &str| self.invalid(field, format!("{problem}; train the avatar again"));
        let rows = self.doubles("light.lamps", &[None, Some(LAMP_NUMBERS)])?;
        let lamp = |row: &[f64; LAMP_NUMBERS]| {
            let [x, y, z, radius, r, g, b] = *row;
            Lamp { offset: DVec3::new(x, y, z), radius, radiance: [r, g, b].map(|c| c as f32) }
        };
        let lamps: Vec<Lamp> = rows.as_chunks::<LAMP_NUMBERS>().0.iter().map(lamp).collect();
        if lamps.iter().any(|lamp| lamp.radius < 0.0 || lamp.radiance.iter().any(|c| *c < 0.0 || !c.is_finite())) {
            return Err(wrong("light.lamps", "has a negative or infinite radius or radiance"));
        }
        let place = self.doubles("light.place", &[Some(4)])?;
        let (reach, place) = (place[3], DVec3::from_slice(&place));
        if reach < 0.0 {
            return Err(wrong("light.place", "has a negative reach"));
        }
        if lamps.iter().any(|lamp| lamp.offset.length() <= reach) {
            return Err(wrong("light.lamps", "has a lamp where the hand is"));
        }
        if kind != LightKind::Transfer {
            return Err(wrong("light.lamps", "needs a light from directions"));
        }
        Ok(Some(Lamps { place, reach, lamps }))
    }

    /// Light that skin throws on skin; files before version 6 have none.
    fn interreflection(&self, kind: LightKind) -> Result<[f32; 3], AvatarFileError> {
        if !self.has("light.interreflection") {
            return Ok([0.0; 3]);
        }
        let parts = self.floats("light.interreflection", &[Some(3)])?;
        let valid = |(part, most): (&f32, f32)| (0.0..=most).contains(part);
        match <[f32; 3]>::try_from(parts) {
            Ok(parts) if kind == LightKind::Transfer && parts.iter().zip(MOST_INTERREFLECTION).all(valid) => Ok(parts),
            _ => Err(self.invalid(
                "light.interreflection",
                format!(
                    "is not between 0 and {MOST_INTERREFLECTION:?}, or light does not come from directions; train the \
                     avatar again"
                ),
            )),
        }
    }

    /// How far the light may be trusted; in files without it, everywhere.
    fn trust(&self) -> Result<Option<Trust>, AvatarFileError> {
        if !self.has("light.trust") {
            return Ok(None);
        }
        let trust =
            Trust::new(self.floats("light.trust", &[Some(DIRECTION_COUNT), Some(2)])?.as_chunks::<2>().0.to_vec());
        let problem = || {
            self.invalid(
                "light.trust",
                "is not between 0 and 1, or says that images show nothing; train the avatar again",
            )
        };
        trust.ok_or_else(problem).map(Some)
    }

    /// The gloss of a hand of `joints` joints; earlier files have none.
    fn gloss(&self, joints: usize) -> Result<Option<Gloss>, AvatarFileError> {
        if !self.has("light.gloss") {
            return Ok(None);
        }
        let strengths = self.floats("light.gloss", &[Some(joints), Some(3)])?.as_chunks::<3>().0.to_vec();
        let roughness = self.doubles("light.roughness", &[Some(1)])?[0];
        if !(roughness > 0.0 && roughness <= 1.0) {
            let problem = format!("is {roughness}, it must be above 0 and at most 1; train the avatar again");
            return Err(self.invalid("light.roughness", problem));
        }
        if strengths.iter().flatten().any(|strength| *strength < 0.0) {
            return Err(self.invalid("light.gloss", "a strength is negative; train the avatar again"));
        }
        Ok(Some(Gloss { roughness, strengths }))
    }
}
