//! A second implementation of the mathematics over any scalar: written from the formulas, as plainly as possible,
//! without code of the crate. Rotations are matrix exponentials by scaling and squaring; the chain is a product of 4x4
//! matrices.

use super::dual::{Dual, Scalar};

pub type Vec3<S> = [S; 3];
/// The upper three rows of a 4x4 matrix whose last row is 0 0 0 1.
pub type Mat4<S> = [[S; 4]; 3];

pub fn zero<S: Scalar>() -> S {
    S::constant(0.0)
}

pub fn vec3s<S: Scalar>(flat: &[S]) -> Vec<Vec3<S>> {
    flat.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

pub fn add3<S: Scalar>(a: Vec3<S>, b: Vec3<S>) -> Vec3<S> {
    std::array::from_fn(|i| a[i] + b[i])
}

pub fn sub3<S: Scalar>(a: Vec3<S>, b: Vec3<S>) -> Vec3<S> {
    std::array::from_fn(|i| a[i] - b[i])
}

pub fn scale3<S: Scalar>(a: Vec3<S>, by: S) -> Vec3<S> {
    a.map(|x| x * by)
}

fn product3<S: Scalar>(a: &[S; 9], b: &[S; 9]) -> [S; 9] {
    std::array::from_fn(|i| (0..3).fold(zero(), |sum, k| sum + a[i / 3 * 3 + k] * b[k * 3 + i % 3]))
}

/// exp([v]x), row by row: the exponential series of the matrix halved until it is small, squared as often.
fn exponential<S: Scalar>(v: Vec3<S>) -> [S; 9] {
    let size = v.iter().map(|x| x.value().abs()).fold(0.0, f64::max);
    let mut halvings = 0;
    while size * 0.5_f64.powi(halvings) > 0.25 {
        halvings += 1;
    }
    let [x, y, z] = v.map(|x| x * S::constant(0.5_f64.powi(halvings)));
    let m = [zero(), -z, y, z, zero(), -x, -y, x, zero()];
    let unit: [S; 9] = std::array::from_fn(|i| S::constant(f64::from(i % 4 == 0)));
    // The first omitted term is below 0.44^17 / 17! = 2e-21.
    let mut sum = unit;
    for k in (1..=16).rev() {
        let next = product3(&m, &sum);
        sum = std::array::from_fn(|i| unit[i] + next[i] * S::constant(1.0 / f64::from(k)));
    }
    (0..halvings).fold(sum, |r, _| product3(&r, &r))
}

/// exp([v]x) with its partial derivatives, row by row.
fn rotation_with_partials(v: [f64; 3]) -> [Dual<3>; 9] {
    exponential([0, 1, 2].map(|k| Dual::input(v[k], k)))
}

/// exp([v]x), row by row.
pub fn rotation<S: Scalar>(v: Vec3<S>) -> [S; 9] {
    S::lift(v, rotation_with_partials(v.map(S::value)))
}

fn product4<S: Scalar>(a: &Mat4<S>, b: &Mat4<S>) -> Mat4<S> {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let sum = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
            if j == 3 { sum + a[i][3] } else { sum }
        })
    })
}

pub fn transform<S: Scalar>(m: &Mat4<S>, x: Vec3<S>) -> Vec3<S> {
    std::array::from_fn(|i| m[i][0] * x[0] + m[i][1] * x[1] + m[i][2] * x[2] + m[i][3])
}

/// `G_k` and `B_k` of every joint, from rotations that are given row by row.
pub fn chain<S: Scalar>(
    parents: &[Option<usize>],
    joints: &[Vec3<S>],
    rotations: &[[S; 9]],
) -> (Vec<Mat4<S>>, Vec<Mat4<S>>) {
    let mut world: Vec<Mat4<S>> = vec![];
    for (k, r) in rotations.iter().enumerate() {
        let bone = parents[k].map_or(joints[k], |p| sub3(joints[k], joints[p]));
        let local: Mat4<S> = std::array::from_fn(|i| [r[3 * i], r[3 * i + 1], r[3 * i + 2], bone[i]]);
        world.push(parents[k].map_or(local, |p| product4(&world[p], &local)));
    }
    let unit = |i: usize, j: usize| S::constant(f64::from(i == j));
    let from_rest = world.iter().zip(joints).map(|(g, joint)| {
        let back: Mat4<S> = std::array::from_fn(|i| [unit(i, 0), unit(i, 1), unit(i, 2), -joint[i]]);
        product4(g, &back)
    });
    let from_rest = from_rest.collect();
    (world, from_rest)
}

/// `sum_k W_k B_k x + sum_k W^_k B^_k x + t`, with the residual weights made to sum to zero if `zero_sum`; otherwise
/// all B^ are translated so that B^_0 maps the origin to itself.
pub struct Skin<'a, S> {
    pub rest: &'a [Vec3<S>],
    pub weights: &'a [f64],
    pub residual_weights: &'a [S],
    pub bones: &'a [Mat4<S>],
    pub residual_bones: &'a [Mat4<S>],
    pub translation: Vec3<S>,
    pub zero_sum: bool,
}

impl<S: Scalar> Skin<'_, S> {
    pub fn posed(&self) -> Vec<Vec3<S>> {
        (0..self.rest.len()).map(|p| self.point(p)).collect()
    }

    fn point(&self, p: usize) -> Vec3<S> {
        let (n, x) = (self.rest.len(), self.rest[p]);
        let mut sum = self.translation;
        for (k, bone) in self.bones.iter().enumerate() {
            sum = add3(sum, scale3(transform(bone, x), S::constant(self.weights[k * n + p])));
        }
        let column: Vec<S> = (0..self.residual_bones.len()).map(|k| self.residual_weights[k * n + p]).collect();
        let total = column.iter().fold(zero(), |sum: S, w| sum + *w);
        let mean = if self.zero_sum { total * S::constant(1.0 / column.len() as f64) } else { zero() };
        let root = self.residual_bones.first().filter(|_| !self.zero_sum);
        let root = root.map_or([zero(); 3], |bone| transform(bone, [zero(); 3]));
        for (bone, w) in self.residual_bones.iter().zip(column) {
            sum = add3(sum, scale3(sub3(transform(bone, x), root), w - mean));
        }
        sum
    }
}

/// `Delta_p = sum_i C_i^p (.) S_i^p`.
pub fn offsets<S: Scalar>(basis: &[Vec3<S>], coefficients: &[Vec3<S>], n: usize) -> Vec<Vec3<S>> {
    let mut sum = vec![[zero(); 3]; n];
    for (i, (s, c)) in basis.iter().zip(coefficients).enumerate() {
        sum[i % n] = add3(sum[i % n], std::array::from_fn(|a| s[a] * c[a]));
    }
    sum
}

/// `J^ = R Delta`, on top of `joints` if anchored.
pub fn residual_joints<S: Scalar>(
    regressor: &[S],
    offsets: &[Vec3<S>],
    joints: &[Vec3<S>],
    anchored: bool,
) -> Vec<Vec3<S>> {
    let n = offsets.len();
    let row = |(k, joint): (usize, &Vec3<S>)| {
        let from = if anchored { *joint } else { [zero(); 3] };
        (0..n).fold(from, |sum, p| add3(sum, scale3(offsets[p], regressor[k * n + p])))
    };
    joints.iter().enumerate().map(row).collect()
}

/// `gain_{i,k} . vec(R_k - I)`, `[channels][n_b]`, with 0 for the root.
pub fn response_terms<S: Scalar>(gain: &[S], rotations: &[[S; 9]]) -> Vec<S> {
    let joints = rotations.len();
    let entry = |at: usize, e: usize| {
        gain[at * 9 + e] * (rotations[at % joints][e] - S::constant(f64::from(e.is_multiple_of(4))))
    };
    let term = |at: usize| {
        if at.is_multiple_of(joints) { zero() } else { (0..9).fold(zero(), |sum: S, e| sum + entry(at, e)) }
    };
    (0..gain.len() / 9).map(term).collect()
}

/// `bias_i + sum_k W_k^p t_{i,k}` of the terms t within their limits, `[channels][N]`.
pub fn pose_response<S: Scalar>(
    bias: &[S],
    gain: &[S],
    limits: &[[f64; 2]],
    weights: &[f64],
    rotations: &[[S; 9]],
    n: usize,
) -> Vec<S> {
    let joints = rotations.len();
    let mut terms = response_terms(gain, rotations);
    for (term, limit) in terms.iter_mut().zip(limits) {
        let [low, high] = limit.map(S::constant);
        *term = if term.value() < low.value() { low } else { *term };
        *term = if term.value() > high.value() { high } else { *term };
    }
    let value = |i: usize, p: usize| {
        (0..joints).fold(bias[i], |sum, k| sum + S::constant(weights[k * n + p]) * terms[i * joints + k])
    };
    (0..bias.len()).flat_map(|i| (0..n).map(move |p| (i, p))).map(|(i, p)| value(i, p)).collect()
}

/// `v + sum_i weight_i D_i` for directions `[weights][V]` that are data.
pub fn add_directions<S: Scalar>(vertices: &mut [Vec3<S>], weights: &[S], directions: &[[f64; 3]]) {
    let v = vertices.len();
    for (i, weight) in weights.iter().enumerate() {
        for (p, vertex) in vertices.iter_mut().enumerate() {
            let d = directions[i * v + p];
            *vertex = std::array::from_fn(|a| vertex[a] + *weight * S::constant(d[a]));
        }
    }
}
