//! The learned parameters of the networks: a flat list with names, shapes and start values.

use burn_tensor::Tensor;
use rand::RngExt;

/// The parts of the model that learn separately.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// E_c.
    CanonicalEncoder,
    /// E_p.
    PoseEncoder,
    /// The optimisable feature tensor.
    FeatureTensor,
    /// The convolutions that smooth it.
    Smoothing,
    /// The half of d_c that gives S.
    ShapeBasis,
    /// The half of d_c that gives W^.
    ResidualWeights,
    /// What the heads of d_p share.
    Trunk,
    /// The head for C.
    Coefficients,
    /// The head for R.
    Regressor,
    /// The head for the Gaussians' sizes.
    Scale,
    /// The head for the colours.
    Color,
    /// The colours of single Gaussians.
    OwnColors,
}

/// Start values of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Start {
    /// All zero.
    Zero,
    /// The first ones are 1, the others 0.
    Ones(usize),
    /// Uniform between minus and plus this.
    Uniform(f32),
    /// About normal with this standard deviation.
    Normal(f32),
}

impl Start {
    /// Uniform within `1 / sqrt(inputs)`, so that no layer makes its input much larger.
    pub fn of_inputs(inputs: usize) -> Start {
        Start::Uniform(1.0 / (inputs as f32).sqrt())
    }

    /// `count` values.
    pub fn values(self, count: usize, rng: &mut impl rand::Rng) -> Vec<f32> {
        let mut uniform = || rng.random_range(-1.0f32..1.0);
        match self {
            Start::Zero => vec![0.0; count],
            Start::Ones(ones) => (0..count).map(|i| if i < ones { 1.0 } else { 0.0 }).collect(),
            Start::Uniform(bound) => (0..count).map(|_| uniform() * bound).collect(),
            // The sum of four uniform numbers is close enough to a normal one, and has the same bits on every platform.
            Start::Normal(deviation) => {
                let scale = deviation * (3.0f32 / 4.0).sqrt();
                (0..count).map(|_| (0..4).map(|_| uniform()).sum::<f32>() * scale).collect()
            }
        }
    }
}

/// A learned parameter.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parameter {
    /// Its name in avatar files, after the prefix.
    pub name: String,
    /// Where it belongs.
    pub part: Part,
    /// Its shape.
    pub shape: Vec<usize>,
    /// How it starts.
    pub start: Start,
}

impl Parameter {
    /// Number of values.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }
}

/// The place of a parameter of rank `D` in the list.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slot<const D: usize> {
    index: usize,
    shape: [usize; D],
}

impl<const D: usize> Slot<D> {
    /// Its index in the list.
    pub fn index(&self) -> usize {
        self.index
    }

    /// The parameter among all, which are flat.
    pub fn of(&self, parameters: &[Tensor<1>]) -> Tensor<D> {
        parameters[self.index].clone().reshape(self.shape)
    }
}

/// The list while the networks are laid out.
#[derive(Debug, Default)]
pub(super) struct ParameterList {
    /// All so far.
    pub parameters: Vec<Parameter>,
    /// Channels of each normalisation so far.
    pub norms: Vec<usize>,
}

impl ParameterList {
    /// Adds a parameter.
    pub fn add<const D: usize>(&mut self, name: String, part: Part, shape: [usize; D], start: Start) -> Slot<D> {
        self.parameters.push(Parameter { name, part, shape: shape.to_vec(), start });
        Slot { index: self.parameters.len() - 1, shape }
    }
}
