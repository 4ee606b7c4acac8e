//! Numbers that carry derivatives: forward-mode differentiation, independent of hand-written derivatives.

use std::ops::{Add, Mul, Neg, Sub};

/// The scalar of the mathematics in `reference`.
pub trait Scalar: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> {
    /// A number that does not depend on any input.
    fn constant(value: f64) -> Self;
    /// `f` of three numbers: `nine` values with known partial derivatives.
    fn lift(inputs: [Self; 3], nine: [Dual<3>; 9]) -> [Self; 9];
    /// The number without its derivatives.
    fn value(self) -> f64;
}

/// A number and its derivatives with respect to `K` inputs.
#[derive(Debug, Clone, Copy)]
pub struct Dual<const K: usize> {
    /// The number.
    pub value: f64,
    /// Its partial derivatives.
    pub partials: [f64; K],
}

impl<const K: usize> Dual<K> {
    /// Input number `k`.
    pub fn input(value: f64, k: usize) -> Self {
        Dual { value, partials: std::array::from_fn(|i| f64::from(i == k)) }
    }

    fn zip(self, other: Self, value: f64, f: impl Fn(f64, f64) -> f64) -> Self {
        Dual { value, partials: std::array::from_fn(|i| f(self.partials[i], other.partials[i])) }
    }
}

impl<const K: usize> Add for Dual<K> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.zip(other, self.value + other.value, |a, b| a + b)
    }
}

impl<const K: usize> Sub for Dual<K> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.zip(other, self.value - other.value, |a, b| a - b)
    }
}

impl<const K: usize> Mul for Dual<K> {
    type Output = Self;
    #[allow(clippy::suspicious_arithmetic_impl, reason = "the product rule adds")]
    fn mul(self, other: Self) -> Self {
        self.zip(other, self.value * other.value, |a, b| a * other.value + b * self.value)
    }
}

impl<const K: usize> Neg for Dual<K> {
    type Output = Self;
    fn neg(self) -> Self {
        Dual { value: -self.value, partials: self.partials.map(|d| -d) }
    }
}

impl<const K: usize> Scalar for Dual<K> {
    fn constant(value: f64) -> Self {
        Dual { value, partials: [0.0; K] }
    }

    fn lift(inputs: [Self; 3], nine: [Dual<3>; 9]) -> [Self; 9] {
        nine.map(|f| Dual {
            value: f.value,
            partials: std::array::from_fn(|i| (0..3).map(|j| f.partials[j] * inputs[j].partials[i]).sum()),
        })
    }

    fn value(self) -> f64 {
        self.value
    }
}

impl Scalar for f64 {
    fn constant(value: f64) -> Self {
        value
    }

    fn lift(_: [Self; 3], nine: [Dual<3>; 9]) -> [Self; 9] {
        nine.map(|f| f.value)
    }

    fn value(self) -> f64 {
        self
    }
}
