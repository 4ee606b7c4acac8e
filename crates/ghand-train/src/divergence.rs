//! Detects failed training: numbers that are no longer finite, or a loss that has risen.

use ghand_avatar::PropertyTables;
use ghand_core::Pose;

use crate::settings::TrainSettings;

/// Why a stage failed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Divergence {
    /// Something is infinite or not a number.
    NotFinite(&'static str),
    /// The loss over the same views is higher than before the first iteration.
    Risen {
        /// Before the first iteration.
        from: f64,
        /// After the last.
        to: f64,
    },
}

impl std::fmt::Display for Divergence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Divergence::NotFinite(what) => write!(f, "{what} became infinite or not a number"),
            Divergence::Risen { from, to } => write!(f, "the loss rose from {from:.4} to {to:.4}"),
        }
    }
}

/// Fails unless the loss is a finite number.
pub(crate) fn check_loss(loss: f64) -> Result<(), Divergence> {
    if loss.is_finite() { Ok(()) } else { Err(Divergence::NotFinite("the loss")) }
}

/// Fails if the loss over the same views has risen, or is not a finite number.
pub(crate) fn check_change(from: f64, to: f64) -> Result<(), Divergence> {
    check_loss(from)?;
    check_loss(to)?;
    if to > from { Err(Divergence::Risen { from, to }) } else { Ok(()) }
}

fn check_values(learned: &[(&'static str, &[f32])]) -> Result<(), Divergence> {
    match learned.iter().find(|(_, values)| values.iter().any(|v| !v.is_finite())) {
        Some((name, _)) => Err(Divergence::NotFinite(name)),
        None => Ok(()),
    }
}

/// Fails unless the numbers learned for the whole hand are finite. They are few enough to be read regularly.
pub(crate) fn check_hand(response: &[f32], joints: &[[f32; 3]], poses: &[Pose]) -> Result<(), Divergence> {
    check_values(&[("the pose response", response), ("the rest joints", joints.as_flattened())])?;
    let is_finite = |p: &Pose| p.translation.is_finite() && p.rotations.iter().all(|r| r.is_finite());
    if poses.iter().all(is_finite) { Ok(()) } else { Err(Divergence::NotFinite("a pose")) }
}

/// Fails unless the numbers learned for each Gaussian are finite.
pub(crate) fn check_gaussians(tables: &PropertyTables) -> Result<(), Divergence> {
    check_values(&tables.parts())
}

/// A setting more than this many times its default is the likely reason.
const SUSPICIOUS: f64 = 2.0;

/// What to do about a fault: lower the setting that is furthest above its default, if there is one.
pub(crate) fn remedy(settings: &TrainSettings) -> String {
    let numbers = |s: &TrainSettings| {
        [
            ("color_roughness", s.color_roughness),
            ("rate_shape_basis", s.rate_shape_basis),
            ("rate_residual_weights", s.rate_residual_weights),
            ("rate_networks", s.rate_networks),
            ("rate_feature_tensor", s.rate_feature_tensor),
            ("rate_joints", s.rate_joints),
        ]
    };
    let raised = numbers(settings).into_iter().zip(numbers(&TrainSettings::default()));
    let suspect = raised
        .map(|((name, value), (_, default))| (name, value, default, value / default))
        .filter(|(.., ratio)| *ratio > SUSPICIOUS)
        .max_by(|a, b| a.3.total_cmp(&b.3));
    match suspect {
        Some((name, value, default, _)) => {
            format!("most likely `{name}` is too high: it is {value:?}, its default is {default:?}; lower it")
        }
        None => "lower the rates (such as --set rate_shape_basis=5e-5), and check the capture's poses and masks \
                 with `ghand inspect`"
            .into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ghand_avatar::DirectTables;
    use glam::DVec3;

    #[test]
    fn a_loss_must_not_rise_and_must_be_finite() {
        check_change(0.5, 0.5).unwrap();
        check_change(0.5, 0.1).unwrap();
        assert_eq!(check_change(0.5, 0.51), Err(Divergence::Risen { from: 0.5, to: 0.51 }));
        for (from, to) in [(f64::NAN, 0.1), (0.1, f64::NAN), (0.1, f64::INFINITY)] {
            assert_eq!(check_change(from, to), Err(Divergence::NotFinite("the loss")));
        }
    }

    #[test]
    fn every_learned_number_is_checked() {
        let tables = DirectTables {
            shape_basis: vec![0.0; 3],
            residual_weights: vec![0.0; 3],
            regressor: vec![0.0; 3],
            appearance: vec![0.0; 3],
            response: vec![0.0; 3],
            response_limits: vec![0.0; 6],
        };
        let joints = [[0.0; 3]; 2];
        let pose = Pose { rotations: vec![DVec3::ZERO; 2], translation: DVec3::ZERO };
        let check = |tables: &DirectTables, joints: &[[f32; 3]], poses: &[Pose]| {
            check_hand(&tables.response, joints, poses)
                .and_then(|()| check_gaussians(&PropertyTables::Direct(tables.clone())))
        };
        check(&tables, &joints, std::slice::from_ref(&pose)).unwrap();
        let fields: [fn(&mut DirectTables) -> &mut Vec<f32>; 5] = [
            |t| &mut t.shape_basis,
            |t| &mut t.residual_weights,
            |t| &mut t.regressor,
            |t| &mut t.appearance,
            |t| &mut t.response,
        ];
        for field in fields {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let mut tables = tables.clone();
                field(&mut tables)[2] = bad;
                check(&tables, &joints, std::slice::from_ref(&pose)).unwrap_err();
            }
        }
        check(&tables, &[[0.0, 0.0, f32::NAN]], &[]).unwrap_err();
        let turned = Pose { rotations: vec![DVec3::new(0.0, f64::NAN, 0.0)], ..pose.clone() };
        check(&tables, &joints, &[pose.clone(), turned]).unwrap_err();
        let moved = Pose { translation: DVec3::new(0.0, f64::INFINITY, 0.0), ..pose };
        assert_eq!(check(&tables, &joints, &[moved]), Err(Divergence::NotFinite("a pose")));
    }

    #[test]
    fn the_setting_furthest_above_its_default_is_named() {
        let settings =
            TrainSettings { rate_joints: 3e-4, rate_shape_basis: 1e38, final_rate: 1e-9, ..Default::default() };
        let text = remedy(&settings);
        assert!(text.contains("`rate_shape_basis` is too high: it is 1e38, its default is 0.0001"), "{text}");
        assert!(!remedy(&TrainSettings::default()).contains("too high"));
    }
}
