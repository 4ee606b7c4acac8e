//! Shortens gradients of the networks that are much longer than usual.

use burn_tensor::Tensor;
use ghand_render::RenderError;

/// Weight of the last norm in the usual one.
const MOMENTUM: f32 = 0.05;

/// How many times its usual norm a gradient may have. Tables need no limit: Adam moves a number by no more than 3.2 times
/// its rate, for any gradient.
const LONGEST: f32 = 10.0;

/// What norm the gradient of all parameters together usually has.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct GradientClip {
    /// Running mean; 0 before the first gradient.
    usual: f32,
}

impl GradientClip {
    /// The factor, up to 1, that makes a gradient no longer than [`LONGEST`] times the usual. `None` if the gradient is not
    /// finite.
    ///
    /// # Errors
    /// [`RenderError::Device`] if a tensor cannot be read.
    pub fn factor(&mut self, gradients: &[Option<Tensor<1>>]) -> Result<Option<f32>, RenderError> {
        let squares = gradients.iter().flatten().map(|gradient| gradient.clone().square().sum());
        let Some(sum) = squares.reduce(|a, b| a + b) else { return Ok(Some(1.0)) };
        let sum = sum.try_into_scalar::<f32>().map_err(|e| RenderError::Device(format!("a tensor: {e:?}")))?;
        Ok(self.factor_of(sum.sqrt()))
    }

    fn factor_of(&mut self, norm: f32) -> Option<f32> {
        if !norm.is_finite() {
            return None;
        }
        if self.usual == 0.0 {
            self.usual = norm;
        }
        let most = LONGEST * self.usual;
        let factor = if norm > most { most / norm } else { 1.0 };
        self.usual += MOMENTUM * (norm * factor - self.usual);
        Some(factor)
    }

    /// As a part of a training state.
    pub fn state(self) -> Vec<f32> {
        vec![self.usual]
    }

    /// From that part.
    pub fn from_state(state: &[f32]) -> GradientClip {
        GradientClip { usual: state.first().copied().unwrap_or_default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gradient_is_shortened_to_a_multiple_of_the_usual() {
        let mut clip = GradientClip::default();
        for _ in 0..20 {
            assert_eq!(clip.factor_of(2.0), Some(1.0));
        }
        assert_eq!(clip.factor_of(19.0), Some(1.0));
        let usual = clip.usual;
        assert!((2.0..3.0).contains(&usual));
        assert_eq!(clip.factor_of(1e6), Some(LONGEST * usual / 1e6));
        // An outlier counts as what it was shortened to.
        assert!(clip.usual < 1.5 * usual);
        assert_eq!(GradientClip::from_state(&clip.state()), clip);
    }

    #[test]
    fn a_gradient_that_is_not_finite_changes_nothing() {
        let mut clip = GradientClip { usual: 2.0 };
        for norm in [f32::NAN, f32::INFINITY] {
            assert_eq!(clip.factor_of(norm), None);
        }
        assert_eq!(clip.usual, 2.0);
    }
}
