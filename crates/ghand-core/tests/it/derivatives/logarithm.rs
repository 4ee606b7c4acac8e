//! The logarithm of a rotation: its derivative along the rotations, at R towards `R exp([w]x)`.

use ghand_core::rotation::{axis_angle_from_rotation, axis_angle_from_rotation_vjp, rotation_from_axis_angle};
use glam::{DMat3, DVec3};

use super::cases::{About, Case, axis, cases, uniform};
use super::check::{Input, Problem, SLOPE, prove};
use super::dual::{Dual, Scalar};
use super::reference::{product3, rotation, rotation_with_partials};

/// `w -> log(R exp([w]x))` at `w = 0`, R by an angle of at most pi.
struct Logarithm {
    case: Case,
    rotation: DMat3,
    inputs: Vec<Input>,
}

impl Logarithm {
    fn new(case: &Case) -> Logarithm {
        let rng = &mut case.rng();
        // Logarithms are no longer than pi.
        let mut angle = case.angle.1;
        if angle.is_nan() || angle > std::f64::consts::PI {
            angle = std::f64::consts::PI * (0.5 + 0.5 * uniform(rng, 1)[0]);
        }
        let v = DVec3::from_array(axis(rng)) * angle;
        // Near a half turn the logarithm changes sides; differences there follow the side of their start.
        let inputs = vec![Input::new("turn", vec![0.0; 3], 5e-4, 3.0 * SLOPE)];
        Logarithm { case: case.clone(), rotation: rotation_from_axis_angle(v), inputs }
    }

    /// The logarithm on the side of `v`: of the two that are up to 2 pi long, the nearer one.
    fn beside(u: DVec3, v: DVec3) -> DVec3 {
        if u.length() < 1.0 {
            return u;
        }
        let other = u * (1.0 - std::f64::consts::TAU / u.length());
        if (u - v).length() <= (other - v).length() { u } else { other }
    }
}

impl Problem for Logarithm {
    fn case(&self) -> &Case {
        &self.case
    }

    fn about(&self) -> &[About] {
        // Cases of larger angles were replaced.
        if self.case.angle.1 > std::f64::consts::PI { &[] } else { &[About::Angle] }
    }

    fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    fn size(&self) -> f64 {
        std::f64::consts::PI
    }

    /// The logarithm is what the exponential maps to the rotation: one step of Newton's from the crate's logarithm,
    /// which carries the derivatives, and is small if that is right.
    fn reference<S: Scalar>(&self, inputs: &[&[S]]) -> Vec<S> {
        let v = axis_angle_from_rotation(&self.rotation);
        let at: [Dual<3>; 9] = rotation_with_partials(v.to_array());
        let rows = self.rotation.transpose().to_cols_array().map(S::constant);
        let turned = product3(&rows, &rotation([inputs[0][0], inputs[0][1], inputs[0][2]]));
        // Least squares of nine entries in three unknowns. The columns' products are far from singular up to pi.
        let column = |j: usize| {
            DVec3::from_array(std::array::from_fn(|i| at.iter().map(|e| e.partials[i] * e.partials[j]).sum()))
        };
        let inverse = DMat3::from_cols(column(0), column(1), column(2)).inverse();
        let residual: [S; 9] = std::array::from_fn(|e| turned[e] - S::constant(at[e].value));
        let moment: [S; 3] = std::array::from_fn(|i| {
            (0..9).fold(S::constant(0.0), |sum, e| sum + residual[e] * S::constant(at[e].partials[i]))
        });
        let step = |i: usize| (0..3).fold(S::constant(v[i]), |sum, j| sum + moment[j] * S::constant(inverse.col(j)[i]));
        (0..3).map(step).collect()
    }

    fn outputs(&self, inputs: &[&[f64]]) -> Vec<f64> {
        let turned = self.rotation * rotation_from_axis_angle(DVec3::from_slice(inputs[0]));
        Logarithm::beside(axis_angle_from_rotation(&turned), axis_angle_from_rotation(&self.rotation))
            .to_array()
            .to_vec()
    }

    fn gradients(&self, d_outputs: &[f64]) -> Vec<Vec<f64>> {
        let d = axis_angle_from_rotation_vjp(&self.rotation, DVec3::from_slice(d_outputs));
        // R [w]x is the move; its inner product with d is linear in w.
        let entries = |m: DMat3| m.to_cols_array();
        let along = |w: DVec3| {
            let skew =
                DMat3::from_cols(DVec3::new(0.0, w.z, -w.y), DVec3::new(-w.z, 0.0, w.x), DVec3::new(w.y, -w.x, 0.0));
            entries(d).iter().zip(entries(self.rotation * skew)).map(|(a, b)| a * b).sum()
        };
        vec![DVec3::AXES.map(along).to_vec()]
    }
}

#[test]
fn logarithms_of_rotations_are_right() {
    prove("axis_angle_from_rotation", cases(), Logarithm::new);
}
