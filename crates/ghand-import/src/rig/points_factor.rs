//! The Cholesky factor of a moment's equations of points, of which only neighbours along bones depend on each other.

use nalgebra::{DMatrix, Dim, Dyn, Matrix, Matrix3, StorageMut};

use super::LANDMARKS;
use super::lengths::BONES;

/// Order of elimination: from fingertips to the wrist, so that only blocks between knuckles are added.
const ORDER: [usize; LANDMARKS] = [4, 3, 2, 1, 8, 7, 6, 12, 11, 10, 16, 15, 14, 20, 19, 18, 9, 13, 5, 17, 0];

/// For each landmark of [`ORDER`] those after it with which it has a block in the factor.
const LATER: [[bool; LANDMARKS]; LANDMARKS] = {
    let mut meets = [[false; LANDMARKS]; LANDMARKS];
    let mut bone = 0;
    while bone < BONES.len() {
        let (from, to) = BONES[bone];
        (meets[from][to], meets[to][from]) = (true, true);
        bone += 1;
    }
    let mut later = meets;
    let mut at = 0;
    while at < LANDMARKS {
        let gone = ORDER[at];
        later[gone] = meets[gone];
        let mut i = 0;
        while i < LANDMARKS {
            meets[i][gone] = false;
            let mut j = 0;
            while j < LANDMARKS {
                meets[i][j] |= later[gone][i] && later[gone][j] && i != j;
                j += 1;
            }
            i += 1;
        }
        at += 1;
    }
    later
};

/// A factor: of each landmark the inverse of its triangle, and its blocks with later ones.
pub(super) struct PointsFactor {
    inverses: [Matrix3<f64>; LANDMARKS],
    /// In the lower triangle: rows of the later landmark.
    blocks: DMatrix<f64>,
}

impl PointsFactor {
    /// Of a symmetric matrix of 3 x 3 blocks, which are zero where landmarks have no bone between them. `None` if it is not
    /// positive definite.
    pub(super) fn of(mut matrix: DMatrix<f64>) -> Option<PointsFactor> {
        let mut inverses = [Matrix3::identity(); LANDMARKS];
        for k in ORDER {
            let lower = matrix.fixed_view::<3, 3>(3 * k, 3 * k).clone_owned().cholesky()?.unpack();
            inverses[k] = lower.try_inverse()?;
            let upper = inverses[k].transpose();
            for i in later(k) {
                let block = matrix.fixed_view::<3, 3>(3 * i, 3 * k) * upper;
                matrix.fixed_view_mut::<3, 3>(3 * i, 3 * k).copy_from(&block);
            }
            for i in later(k) {
                for j in later(k) {
                    let product =
                        matrix.fixed_view::<3, 3>(3 * i, 3 * k) * matrix.fixed_view::<3, 3>(3 * j, 3 * k).transpose();
                    let mut rest = matrix.fixed_view_mut::<3, 3>(3 * i, 3 * j);
                    rest -= product;
                }
            }
        }
        Some(PointsFactor { inverses, blocks: matrix })
    }

    /// Solves with the factor: `L x = right`.
    pub(super) fn solve_lower<C: Dim, S: StorageMut<f64, Dyn, C>>(&self, right: &mut Matrix<f64, Dyn, C, S>) {
        for k in ORDER {
            for mut column in right.column_iter_mut() {
                let solved = self.inverses[k] * column.fixed_rows::<3>(3 * k);
                column.fixed_rows_mut::<3>(3 * k).copy_from(&solved);
            }
            for i in later(k) {
                let block = self.blocks.fixed_view::<3, 3>(3 * i, 3 * k);
                for mut column in right.column_iter_mut() {
                    let product = block * column.fixed_rows::<3>(3 * k);
                    let mut rest = column.fixed_rows_mut::<3>(3 * i);
                    rest -= product;
                }
            }
        }
    }

    /// Solves with the factor's transpose.
    pub(super) fn solve_upper<C: Dim, S: StorageMut<f64, Dyn, C>>(&self, right: &mut Matrix<f64, Dyn, C, S>) {
        for mut column in right.column_iter_mut() {
            for k in ORDER.into_iter().rev() {
                let mut rest = column.fixed_rows::<3>(3 * k).clone_owned();
                for i in later(k) {
                    rest -= self.blocks.fixed_view::<3, 3>(3 * i, 3 * k).tr_mul(&column.fixed_rows::<3>(3 * i));
                }
                column.fixed_rows_mut::<3>(3 * k).copy_from(&self.inverses[k].tr_mul(&rest));
            }
        }
    }
}

/// The landmarks after one with which it has a block.
fn later(k: usize) -> impl Iterator<Item = usize> {
    (0..LANDMARKS).filter(move |i| LATER[k][*i])
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;

    /// Positive definite, with blocks along bones.
    fn matrix() -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(3 * LANDMARKS, 3 * LANDMARKS);
        let mut row = DVector::zeros(3 * LANDMARKS);
        for (number, (from, to)) in BONES.into_iter().enumerate() {
            for turn in 0..3 {
                row.fill(0.0);
                for axis in 0..3 {
                    row[3 * from + axis] = ((7 * number + 3 * turn + axis) as f64).sin();
                    row[3 * to + axis] = ((5 * number + turn + 2 * axis) as f64).cos();
                }
                matrix += &row * row.transpose();
            }
        }
        matrix + DMatrix::identity(3 * LANDMARKS, 3 * LANDMARKS) * 0.1
    }

    #[test]
    fn it_solves_what_the_dense_factor_solves() {
        let dense = matrix().cholesky().unwrap();
        let factor = PointsFactor::of(matrix()).unwrap();
        let right = DMatrix::from_fn(3 * LANDMARKS, 4, |i, j| ((i + 11 * j) as f64).sin());
        let mut solved = right.clone();
        factor.solve_lower(&mut solved);
        let products = solved.transpose() * &solved;
        assert!((products - right.transpose() * dense.solve(&right)).amax() < 1e-9);
        factor.solve_upper(&mut solved);
        assert!((solved - dense.solve(&right)).amax() < 1e-9);
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_none() {
        let mut broken = matrix();
        broken[(0, 0)] = -1.0;
        assert!(PointsFactor::of(broken).is_none());
    }
}
