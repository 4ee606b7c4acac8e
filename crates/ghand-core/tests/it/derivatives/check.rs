//! Checks of a problem: its values, its gradient against dual numbers, and its gradient against differences.

use std::cell::RefCell;
use std::collections::BTreeMap;

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestRng, TestRunner};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cases::{About, Case, uniform};
use super::dual::{Dual, Scalar};

/// Number of random cases per derivative, usually and in long tests.
const CASES: [u32; 2] = [1_000, 10_000];
/// Allowed relative errors: of values and of gradients against dual numbers, and of gradients against differences.
pub const EXACT: f64 = 1e-8;
const DIFFERENCES: f64 = 1e-6;
/// A gradient with cancelling terms is compared with this fraction of the terms, if that is larger than the gradient.
/// An error of 1e-8 of that fraction is 18 units of rounding (2^-52) of the terms, which even a correct sum may have.
const SHARE_OF_TERMS: f64 = 4e-7;
/// Number of inputs that are differentiated at once.
const PARTIALS: usize = 24;

/// One input of a function, with respect to which it is differentiated.
#[derive(Debug, Clone)]
pub struct Input {
    pub name: &'static str,
    pub values: Vec<f64>,
    /// Step of the differences. The loss is a polynomial of degree 2 in all inputs except rotations, for which the
    /// differences are exact with any step, so the step can be large enough to make rounding small.
    pub step: f64,
    /// Upper estimate of the terms that are summed in one entry of the gradient.
    pub terms: f64,
}

impl Input {
    pub fn new(name: &'static str, values: Vec<f64>, step: f64, terms: f64) -> Input {
        Input { name, values, step, terms }
    }
}

/// A function of the crate with its derivative, and a second implementation of the same function.
pub trait Problem {
    fn case(&self) -> &Case;
    /// The extremes that matter for this function.
    fn about(&self) -> &[About];
    fn inputs(&self) -> &[Input];
    /// The outputs of the reference.
    fn reference<S: Scalar>(&self, inputs: &[&[S]]) -> Vec<S>;
    /// The crate's outputs.
    fn outputs(&self, inputs: &[&[f64]]) -> Vec<f64>;
    /// The crate's gradients, in the order and lengths of the inputs.
    fn gradients(&self, d_outputs: &[f64]) -> Vec<Vec<f64>>;
    /// Upper estimate of the outputs and of the terms that are summed in them.
    fn size(&self) -> f64;

    /// The inputs as drawn.
    fn drawn(&self) -> Vec<&[f64]> {
        self.inputs().iter().map(|input| &input.values[..]).collect()
    }
}

/// `sum_i w_i x_i + curvature / 2 x_i^2` of the outputs x, with random weights between -1 and 1: a slope of 2 at most.
struct Loss {
    weights: Vec<f64>,
    curvature: f64,
}

impl Loss {
    fn new(problem: &impl Problem, outputs: usize) -> Loss {
        let case = problem.case();
        let mut rng = ChaCha8Rng::seed_from_u64(case.seed ^ 0x1055);
        let curvature = if case.quadratic { 1.0 / problem.size() } else { 0.0 };
        Loss { weights: uniform(&mut rng, outputs), curvature }
    }

    fn value<S: Scalar>(&self, outputs: &[S]) -> S {
        let half = S::constant(0.5 * self.curvature);
        let terms = outputs.iter().zip(&self.weights).map(|(x, w)| *x * (S::constant(*w) + half * *x));
        terms.fold(S::constant(0.0), |sum, term| sum + term)
    }

    fn slopes(&self, outputs: &[f64]) -> Vec<f64> {
        outputs.iter().zip(&self.weights).map(|(x, w)| w + self.curvature * x).collect()
    }
}

/// The largest slope of the loss, for estimates of terms.
pub const SLOPE: f64 = 2.0;

#[derive(Debug, Clone, Copy, Default)]
struct Errors {
    value: f64,
    dual: f64,
    difference: f64,
    /// Number of gradients to one input that were not zero, and of those that were compared with their terms.
    compared: usize,
    by_terms: usize,
}

fn worse(a: f64, b: f64) -> f64 {
    // NaN is the largest error.
    if a >= b || a.is_nan() { a } else { b }
}

pub fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| worse(m, v.abs()))
}

/// `error` relative to the correct gradient's largest entry. 0 of 0 is not an error.
fn relative(error: f64, size: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / size }
}

fn split<'a, S>(inputs: &[Input], flat: &'a [S]) -> Vec<&'a [S]> {
    let mut rest = flat;
    let mut take = |n| {
        let (head, tail) = rest.split_at(n);
        rest = tail;
        head
    };
    inputs.iter().map(|input| take(input.values.len())).collect()
}

/// The gradient by dual numbers, flat.
fn dual_gradient(problem: &impl Problem, loss: &Loss, flat: &[f64]) -> Vec<f64> {
    let inputs = problem.inputs();
    let mut gradient = Vec::with_capacity(flat.len());
    let mut numbers: Vec<Dual<PARTIALS>> = flat.iter().map(|v| Dual::constant(*v)).collect();
    for start in (0..flat.len()).step_by(PARTIALS) {
        let end = flat.len().min(start + PARTIALS);
        (start..end).for_each(|i| numbers[i] = Dual::input(flat[i], i - start));
        let value = loss.value(&problem.reference(&split(inputs, &numbers)));
        gradient.extend(&value.partials[..end - start]);
        (start..end).for_each(|i| numbers[i] = Dual::constant(flat[i]));
    }
    gradient
}

/// The derivative of the crate's loss along `direction` of length about 1, by five points: exact to the fourth power.
fn difference(loss: &impl Fn(&[f64]) -> f64, flat: &[f64], direction: &[f64], step: f64) -> f64 {
    let at = |h: f64| {
        let moved: Vec<f64> = flat.iter().zip(direction).map(|(x, d)| x + h * d).collect();
        loss(&moved)
    };
    (8.0 * (at(step) - at(-step)) - (at(2.0 * step) - at(-2.0 * step))) / (12.0 * step)
}

/// The crate's gradients.
fn gradients(problem: &impl Problem) -> Vec<Vec<f64>> {
    let outputs = problem.outputs(&problem.drawn());
    problem.gradients(&Loss::new(problem, outputs.len()).slopes(&outputs))
}

/// The errors of one case with these `gradients`.
///
/// All gradient entries are compared with dual numbers. Differences are taken along random signs of all entries of an
/// input at once, and along one entry.
fn errors(problem: &impl Problem, gradients: &[Vec<f64>]) -> Errors {
    let inputs = problem.inputs();
    let flat: Vec<f64> = problem.drawn().concat();
    let mut rng = ChaCha8Rng::seed_from_u64(problem.case().seed ^ 0xd1ff);
    let found = problem.outputs(&problem.drawn());
    let right = problem.reference::<f64>(&problem.drawn());
    assert_eq!(found.len(), right.len(), "outputs");
    let apart: Vec<f64> = found.iter().zip(&right).map(|(a, b)| a - b).collect();
    let mut errors = Errors { value: relative(largest(&apart), problem.size()), ..Default::default() };
    let weighted = Loss::new(problem, found.len());
    let loss = |flat: &[f64]| weighted.value(&problem.outputs(&split(inputs, flat)));
    let right = dual_gradient(problem, &weighted, &flat);
    assert_eq!(gradients.len(), inputs.len());
    let mut start = 0;
    for (input, found) in inputs.iter().zip(gradients) {
        let right = &right[start..start + input.values.len()];
        assert_eq!(found.len(), right.len(), "entries of the gradient to {}", input.name);
        let size = largest(right).max(SHARE_OF_TERMS * input.terms);
        let apart: Vec<f64> = found.iter().zip(right).map(|(a, b)| a - b).collect();
        errors.dual = worse(errors.dual, relative(largest(&apart), size));
        errors.compared += usize::from(largest(right) > 0.0);
        errors.by_terms += usize::from(largest(right) > 0.0 && largest(right) < size);
        if !right.is_empty() {
            let mut direction = vec![0.0; flat.len()];
            for one in [false, true] {
                let chosen = rng.random_range(0..right.len());
                for (i, d) in direction[start..start + right.len()].iter_mut().enumerate() {
                    let sign = if rng.random_range(0..2) == 0 { 1.0 } else { -1.0 };
                    *d = if one { f64::from(i == chosen) } else { sign / (right.len() as f64).sqrt() };
                }
                let along: f64 = found.iter().zip(&direction[start..]).map(|(g, d)| g * d).sum();
                let numeric = difference(&loss, &flat, &direction, input.step);
                errors.difference = worse(errors.difference, relative((along - numeric).abs(), size));
            }
        }
        start += right.len();
    }
    errors
}

/// Whether errors are within the allowed ones. NaN is not.
fn accepts(errors: &Errors) -> bool {
    errors.value <= EXACT && errors.dual <= EXACT && errors.difference <= DIFFERENCES
}

/// Draws the random cases.
pub fn runner() -> TestRunner {
    let config =
        Config { cases: ghand_test_support::cases(CASES[0], CASES[1]), failure_persistence: None, ..Config::default() };
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]))
}

/// Checks a derivative at random cases, prints the worst errors at each extreme, and checks that wrong gradients are
/// rejected.
pub fn prove<P>(name: &str, cases: impl Strategy<Value = Case>, build: impl Fn(&Case) -> P)
where
    P: Problem,
{
    // A case is too small for several threads. A test that starts on this thread later keeps this setting.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    let worst: RefCell<BTreeMap<String, (usize, Errors)>> = RefCell::default();
    let refused = RefCell::new(0);
    let outcome = runner().run(&cases, |case| {
        let problem = build(&case);
        let gradients = gradients(&problem);
        let found = errors(&problem, &gradients);
        let mut worst = worst.borrow_mut();
        for extreme in std::iter::once("any".to_owned()).chain(case.extremes(problem.about())) {
            let (count, all) = worst.entry(extreme).or_default();
            *count += 1;
            all.value = worse(all.value, found.value);
            all.dual = worse(all.dual, found.dual);
            all.difference = worse(all.difference, found.difference);
            all.compared += found.compared;
            all.by_terms += found.by_terms;
        }
        if !accepts(&found) {
            return Err(TestCaseError::fail(format!("{found:?}")));
        }
        // At intervals, each input's gradient is made slightly wrong, which must be detected.
        if case.seed % 100 == 0 {
            *refused.borrow_mut() += refuses_wrong_gradients(&problem, &gradients);
        }
        Ok(())
    });
    let mut table = format!(
        "\n{name}\n| extreme | cases | value | dual numbers | differences | by terms |\n|---|---|---|---|---|---|\n"
    );
    for (extreme, (count, e)) in worst.borrow().iter() {
        let by_terms = 100.0 * e.by_terms as f64 / e.compared.max(1) as f64;
        table += &format!(
            "| {extreme} | {count} | {:.1e} | {:.1e} | {:.1e} | {by_terms:.1} % |\n",
            e.value, e.dual, e.difference
        );
    }
    println!("{table}");
    outcome.unwrap_or_else(|problem| panic!("{name}: {problem}"));
    assert!(*refused.borrow() > 0, "{name}: no wrong gradient was tried");
}

/// Number of wrong gradients that were tried; all of them must be rejected.
fn refuses_wrong_gradients(problem: &impl Problem, gradients: &[Vec<f64>]) -> usize {
    let mut tried = 0;
    for (index, input) in problem.inputs().iter().enumerate() {
        let Some(at) = (problem.case().seed as usize / 100).checked_rem(input.values.len()) else { continue };
        let size = largest(&gradients[index]).max(SHARE_OF_TERMS * input.terms);
        let size = if size == 0.0 { 1.0 } else { size };
        for wrong in [2.1 * EXACT * size, f64::NAN] {
            let mut gradients = gradients.to_vec();
            gradients[index][at] += wrong;
            let found = errors(problem, &gradients);
            assert!(!accepts(&found), "a wrong gradient to {} passes: {found:?}", input.name);
        }
        let mut gradients = gradients.to_vec();
        gradients[index].iter_mut().for_each(|g| *g += 4.0 * DIFFERENCES * size);
        let found = errors(problem, &gradients).difference;
        assert!(!(found <= DIFFERENCES), "differences do not detect a wrong gradient to {}: {found}", input.name);
        tried += 3;
    }
    tried
}
