//! The light on a hand that is drawn: the shades of each frame's mesh, and what it mirrors to the eye.

use std::collections::BTreeMap;

use ghand_core::{InvalidHandModel, Pose};
use glam::DVec3;

use super::{AvatarLight, Light, LightKind, LitMesh, LitParts};

/// Frames whose parts of the light are kept: half a megabyte each.
const MOST_KEPT: usize = 512;

/// An avatar's light, the mesh on which it falls, and its frames.
pub(crate) struct LitHand {
    lit: AvatarLight,
    mesh: LitMesh,
    frames: Vec<Option<LitFrame>>,
    /// Frames' parts of their light, if something asks for them again.
    parts: BTreeMap<usize, LitParts>,
    /// The frame and eye whose gloss the device has.
    mirrored: Option<(usize, DVec3)>,
}

struct LitFrame {
    light: Light,
    pose: Pose,
}

impl LitHand {
    pub fn new(lit: &AvatarLight, mesh: LitMesh, frames: usize) -> LitHand {
        LitHand {
            lit: lit.clone(),
            mesh,
            frames: (0..frames).map(|_| None).collect(),
            parts: BTreeMap::new(),
            mirrored: None,
        }
    }

    /// Replaces the light for poses that are set later.
    pub fn set_light(&mut self, light: &Light) {
        self.lit.light.clone_from(light);
    }

    /// Sets the pose of a frame and returns its shades.
    pub fn set_pose(&mut self, frame: usize, pose: &Pose) -> Result<Vec<[f32; 3]>, InvalidHandModel> {
        let light = self.lit.light.clone();
        let parts = self.mesh.parts(&light, pose)?;
        let shades = self.mesh.shades(&light, &parts, self.lit.interreflection);
        if self.lit.gloss.is_some() {
            self.keep(frame, parts);
        }
        self.frames[frame] = Some(LitFrame { light, pose: pose.clone() });
        self.mirrored = None;
        Ok(shades)
    }

    fn keep(&mut self, frame: usize, parts: LitParts) {
        if self.parts.len() >= MOST_KEPT {
            self.parts.pop_first();
        }
        self.parts.insert(frame, parts);
    }

    /// Makes sure that a frame's parts are kept.
    fn need_parts(&mut self, frame: usize) -> Result<(), InvalidHandModel> {
        if let Some(Some(LitFrame { light, pose, .. })) = self.frames.get(frame)
            && !self.parts.contains_key(&frame)
        {
            let parts = self.mesh.parts(light, pose)?;
            self.keep(frame, parts);
        }
        Ok(())
    }

    /// What the device should have of the skin's gloss and has not, one RGB per vertex, for a frame and an eye, which is not
    /// finite if there is none: then nothing is mirrored.
    pub fn missing_gloss(&mut self, frame: usize, eye: DVec3) -> Result<Option<Vec<[f32; 3]>>, InvalidHandModel> {
        let Some(gloss) = self.lit.gloss.clone() else { return Ok(None) };
        // A NaN is never equal: then it is computed each time.
        if self.mirrored == Some((frame, eye)) {
            return Ok(None);
        }
        self.need_parts(frame)?;
        self.mirrored = Some((frame, eye));
        let none = || vec![[0.0; 3]; self.mesh.vertex_count()];
        let (Some(Some(lit)), Some(parts)) = (self.frames.get(frame), self.parts.get(&frame)) else {
            return Ok(Some(none()));
        };
        let visible = eye.is_finite() && lit.light.kind == LightKind::Transfer;
        Ok(Some(if visible { self.mesh.gloss(&gloss, &lit.light, parts, eye) } else { none() }))
    }
}
