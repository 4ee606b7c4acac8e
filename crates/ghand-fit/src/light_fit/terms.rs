//! What a light consists of: as much as explains frames that the fit has not seen.

use ghand_avatar::light::{IrradianceParts, Lamps};
use ghand_avatar::{Light, LightKind};
use ghand_core::light::{DIRECTION_COUNT, directions};
use ghand_core::{HandModel, InvalidHandModel, Pose};
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector, RowDVector};
use rayon::prelude::*;

use super::coverage::Coverage;
use super::lamps::{self, LampSearch};
use super::least_squares::{ChannelFit, FrameColors, LightModel, Parts, Unknowns, fit, irradiances, squared_error};
use super::observations::Observations;
use super::{LightChoice, LightFigures, interreflection};

/// Every this many frames, one is held out.
const HOLD_OUT: usize = 3;
/// Light must reduce the held-out error of none to less than this fraction.
const WORTHWHILE: f64 = 0.9;
/// Light from all directions must reduce that of few lamps to less than this fraction.
const BETTER_THAN_LAMPS: f64 = 0.95;
/// A lamp near the hand must reduce the error of distant light to less than this fraction.
const WORTHWHILE_LAMP: f64 = 0.99;
/// Most lamps near the hand.
const MOST_LAMPS: usize = 2;
/// Light that skin throws on skin must reduce the error without it to less than this fraction.
const WORTHWHILE_INTERREFLECTION: f64 = 0.99;
/// How often the directions are turned so that one of them is the brightest.
const TURNS: usize = 2;
/// Directions within this cosine of the brightest one belong to the same lamp: its neighbours, some 30 degrees away.
pub(super) const SAME_LAMP: f64 = 0.8;

/// Nothing of the light that falls on skin is thrown on other skin.
const NONE: [f64; 3] = [0.0; 3];

/// Whether a frame is left out of a fit that is judged by it, of `frames` in all.
pub(super) fn held_out(frame: usize, frames: usize) -> bool {
    frame % HOLD_OUT == HOLD_OUT - 1 && frames >= 2 * HOLD_OUT
}

/// The terms of a light, and what its unknowns give the texels that frames show.
pub(super) struct Terms<'a> {
    seen: &'a Observations,
    model: &'a HandModel,
    /// What the directions give the hand in each frame.
    parts: Vec<IrradianceParts>,
    unknowns: Unknowns,
    lamps: Lamps,
    /// From the light's own axes to the world's.
    pub turn: DQuat,
    /// The frames' colours.
    pub columns: Vec<FrameColors>,
    /// Light that skin throws on skin, RGB.
    pub interreflection: [f64; 3],
    /// How well each kind explains held-out frames.
    pub figures: LightFigures,
}

impl<'a> Terms<'a> {
    /// Distant light, as much as a choice allows.
    pub fn new(
        seen: &'a Observations,
        model: &'a HandModel,
        poses: &[Pose],
        choice: LightChoice,
    ) -> Result<Terms<'a>, InvalidHandModel> {
        let parts_in = |turn: DQuat| -> Result<Vec<IrradianceParts>, InvalidHandModel> {
            let of_frame = |frame: &usize| IrradianceParts::new(LightKind::Transfer, turn, model, &poses[*frame]);
            seen.frames.par_iter().map(of_frame).collect()
        };
        let parts = parts_in(DQuat::IDENTITY)?;
        let constant = Parts::constant(seen.samples.len());
        let figures =
            LightFigures { none: f64::NAN, lamps: f64::NAN, transfer: f64::NAN, near: None, interreflection: None };
        let mut terms = Terms {
            seen,
            model,
            unknowns: Unknowns::directions(LightModel::Directions, 0),
            lamps: lamps::place(&parts),
            turn: DQuat::IDENTITY,
            columns: columns(seen, model, &parts),
            parts,
            interreflection: NONE,
            figures,
        };
        for _ in 0..TURNS {
            let Some(further) = towards_peak(&terms.fits()) else { break };
            terms.turn *= further;
            terms.parts = parts_in(terms.turn)?;
            terms.columns = columns(seen, model, &terms.parts);
        }
        let constant: Vec<FrameColors> = (0..seen.frames.len()).map(|f| seen.colors(f, &constant)).collect();
        terms.figures.none = terms.error(&Unknowns::constant(), &constant, NONE);
        [terms.figures.lamps, terms.figures.transfer] = terms.errors_of_models(&terms.columns, 0);
        let model_of_light = match choice {
            LightChoice::Off => LightModel::Constant,
            LightChoice::Transfer => directions_needed(terms.figures.lamps, terms.figures.transfer).0,
            LightChoice::Auto => needed(&terms.figures),
        };
        match model_of_light {
            LightModel::Constant => {
                (terms.unknowns, terms.columns, terms.turn) = (Unknowns::constant(), constant, DQuat::IDENTITY);
            }
            directions => terms.unknowns = Unknowns::directions(directions, 0),
        }
        Ok(terms)
    }

    /// Whether light is apart from skin.
    pub fn is_lit(&self) -> bool {
        self.unknowns.model != LightModel::Constant
    }

    /// Adds lamps near the hand, one after the other, as long as they explain more.
    pub fn add_lamps(&mut self) {
        let mut least = self.figures.lamps.min(self.figures.transfer);
        let others = self.others();
        while self.lamps.lamps.len() < MOST_LAMPS {
            let search =
                LampSearch { seen: self.seen, model: self.model, frames: &self.parts, turn: self.turn, used: &others };
            let before = self.fit(
                &self.columns,
                &others,
                &Unknowns::directions(LightModel::Directions, self.lamps.lamps.len()),
                NONE,
            );
            let Some(more) = search.one_more(&self.lamps, &before) else { return };
            let with_lamps = |frame: &IrradianceParts| {
                let mut lit = frame.clone();
                lit.add_lamps(&more, self.turn, self.model);
                lit
            };
            let lit: Vec<IrradianceParts> = self.parts.iter().map(with_lamps).collect();
            let near = columns(self.seen, self.model, &lit);
            let count = more.lamps.len();
            let [few, many] = self.errors_of_models(&near, count);
            let (directions, error) = directions_needed(few, many);
            let is_worthwhile = error < WORTHWHILE_LAMP * least;
            // The error with the lamps that are kept; if none is, that which was not worth it.
            if is_worthwhile || self.figures.near.is_none() {
                self.figures.near = Some(error);
            }
            if !is_worthwhile {
                return;
            }
            least = error;
            self.unknowns = Unknowns::directions(directions, count);
            (self.lamps, self.columns) = (more, near);
        }
    }

    /// Adds light that skin throws on skin, if that explains more.
    pub fn add_interreflection(&mut self) {
        let some = self.seen.some_texels();
        let others: Vec<FrameColors> = self.others().iter().map(|f| self.columns[*f].of_texels(&some)).collect();
        let others: Vec<&FrameColors> = others.iter().collect();
        let found = interreflection::find(&self.unknowns, &others, self.seen.samples.len());
        let [with, without] = [found, NONE].map(|part| self.error(&self.unknowns, &self.columns, part));
        self.figures.interreflection = Some(with);
        if with < WORTHWHILE_INTERREFLECTION * without {
            self.interreflection = found;
        }
    }

    /// Replaces the colours by those of other observations, which found the same texels.
    pub fn recolor(&mut self, seen: &Observations) {
        self.columns.iter_mut().enumerate().for_each(|(frame, colors)| seen.recolor(frame, colors));
    }

    /// The squared error of held-out frames.
    pub fn squared_error(&self) -> f64 {
        self.error(&self.unknowns, &self.columns, self.interreflection)
    }

    /// The fits of all frames, channel by channel.
    pub fn fits(&self) -> Vec<ChannelFit> {
        let all: Vec<usize> = (0..self.columns.len()).collect();
        self.fit(&self.columns, &all, &self.unknowns, self.interreflection)
    }

    /// The light of some fits; `None` if none is apart from skin.
    pub fn light(&self, coverage: &Coverage, fits: &[ChannelFit]) -> Option<Light> {
        self.is_lit().then(|| {
            let rgb = |k: usize| [0, 1, 2].map(|c| fits[c].light[k] as f32);
            let mut lamps = self.lamps.clone();
            lamps.lamps.iter_mut().enumerate().for_each(|(i, lamp)| lamp.radiance = rgb(DIRECTION_COUNT + i));
            let light = Light {
                kind: LightKind::Transfer,
                turn: self.turn,
                coefficients: (0..DIRECTION_COUNT).map(rgb).collect(),
                lamps: Some(lamps).filter(|lamps| !lamps.lamps.is_empty()),
                trust: None,
            };
            Light { trust: coverage.trust(&light, &irradiances(&self.columns, fits)), ..light }
        })
    }

    /// The frames that are not held out.
    fn others(&self) -> Vec<usize> {
        let count = self.seen.frames.len();
        (0..count).filter(|frame| !held_out(*frame, count)).collect()
    }

    fn fit(
        &self,
        columns: &[FrameColors],
        frames: &[usize],
        unknowns: &Unknowns,
        interreflection: [f64; 3],
    ) -> Vec<ChannelFit> {
        let frames: Vec<&FrameColors> = frames.iter().map(|f| &columns[*f]).collect();
        fit(unknowns, &frames, self.seen.samples.len(), interreflection)
    }

    /// The squared error of held-out frames with these terms.
    fn error(&self, unknowns: &Unknowns, columns: &[FrameColors], interreflection: [f64; 3]) -> f64 {
        let fits = self.fit(columns, &self.others(), unknowns, interreflection);
        let left_out = (0..columns.len()).filter(|frame| held_out(*frame, columns.len()));
        squared_error(&left_out.map(|f| &columns[f]).collect::<Vec<_>>(), &fits)
    }

    /// Those of few lamps in an even sky, and of all directions.
    fn errors_of_models(&self, columns: &[FrameColors], lamps: usize) -> [f64; 2] {
        let models = [LightModel::Lamps, LightModel::Directions];
        models.map(|model| self.error(&Unknowns::directions(model, lamps), columns, NONE))
    }
}

/// The colours of the texels in each frame, with what each unknown of a light gives them.
fn columns(seen: &Observations, model: &HandModel, parts: &[IrradianceParts]) -> Vec<FrameColors> {
    parts.par_iter().enumerate().map(|(f, parts)| seen.colors(f, &texel_parts(parts, model, seen))).collect()
}

/// The parts of vertices, interpolated at the texels.
pub(super) fn texel_parts(parts: &IrradianceParts, model: &HandModel, seen: &Observations) -> Parts {
    let samples = &seen.samples;
    let at = |values: &[f32], t: usize| {
        let corners = model.faces[samples.faces[t] as usize].iter().zip(samples.barycentric[t]);
        corners.map(|(vertex, weight)| f64::from(values[*vertex as usize]) * weight).sum::<f64>()
    };
    let mean = |k: usize| parts.columns[k].iter().zip(&parts.areas).map(|(part, area)| f64::from(part * area)).sum();
    Parts {
        direct: DMatrix::from_fn(samples.len(), parts.columns.len(), |t, k| at(&parts.columns[k], t)),
        closed: DVector::from_fn(samples.len(), |t, _| at(&parts.closed, t)),
        mean: RowDVector::from_fn(parts.columns.len(), |_, k| mean(k)),
    }
}

/// The turn, in the light's own axes, from its brightest direction to the middle of the lamp around it; `None` if no
/// direction stands out.
fn towards_peak(fits: &[ChannelFit]) -> Option<DQuat> {
    let all = directions();
    let radiance = |k: usize| fits.iter().map(|fit| fit.light[k]).sum::<f64>() / fits.len() as f64;
    let brightest = (0..all.len()).max_by(|a, b| radiance(*a).total_cmp(&radiance(*b)))?;
    let lamp = (0..all.len()).filter(|k| all[*k].dot(all[brightest]) > SAME_LAMP);
    let middle: DVec3 = lamp.map(|k| all[k] * (radiance(k) - 1.0).max(0.0)).sum();
    Some(DQuat::from_rotation_arc(all[brightest], middle.try_normalize()?))
}

/// Directions, unless they are hardly better than no light.
fn needed(figures: &LightFigures) -> LightModel {
    let (directions, error) = directions_needed(figures.lamps, figures.transfer);
    if error < WORTHWHILE * figures.none { directions } else { LightModel::Constant }
}

/// The simpler of the two kinds of directions, unless it is worse, and its error.
fn directions_needed(lamps: f64, transfer: f64) -> (LightModel, f64) {
    if transfer < BETTER_THAN_LAMPS * lamps { (LightModel::Directions, transfer) } else { (LightModel::Lamps, lamps) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_simplest_light_that_explains_the_frames_is_taken() {
        let figures = |none, lamps, transfer| LightFigures { none, lamps, transfer, near: None, interreflection: None };
        assert_eq!(needed(&figures(1.0, 0.93, 0.93)), LightModel::Constant);
        assert_eq!(needed(&figures(1.0, 0.3, 0.29)), LightModel::Lamps);
        assert_eq!(needed(&figures(1.0, 0.4, 0.3)), LightModel::Directions);
        assert_eq!(needed(&figures(1.0, f64::NAN, f64::NAN)), LightModel::Constant);
    }
}
