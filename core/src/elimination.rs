//! Gaussian elimination of a 6x6 matrix: no panic, no allocation, a third of the cost of a general
//! LU decomposition.

use nalgebra::{Matrix6, Vector6};

use crate::{CABLES, Real, Scalar};

/// An LU decomposition with partial pivoting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elimination<T: Scalar> {
    /// Column by column: `L` below, `U` above the diagonal, reciprocal pivots on it; rows in pivoted
    /// order.
    columns: [[T; CABLES]; CABLES],
    /// Row `i` of the factors is row `order[i]` of the matrix.
    order: [usize; CABLES],
    positive: bool,
    /// Largest column sum of the matrix (1-norm).
    norm: T,
}

/// Brings the largest entry of column `K`, from row `K` down, to the diagonal, replaces it by its reciprocal and
/// clears what is below in all later columns; which row it was in, and whether it was positive. `None` when it is
/// not larger than `threshold`, or not finite.
#[inline]
fn eliminate<T: Real, const K: usize, const COLUMNS: usize>(
    columns: &mut [[T; CABLES]; COLUMNS],
    threshold: T,
) -> Option<(usize, bool)> {
    let mut pivot_size = columns[K][K].abs();
    let mut pivot_row = K;
    for i in K + 1..CABLES {
        let size = columns[K][i].abs();
        if size > pivot_size {
            pivot_size = size;
            pivot_row = i;
        }
    }
    let regular = pivot_size > threshold && pivot_size <= T::HUGE; // false for NaN
    if !regular {
        return None;
    }
    if pivot_row != K {
        for column in columns.iter_mut() {
            column.swap(K, pivot_row);
        }
    }
    let pivot = columns[K][K];
    let reciprocal = T::one() / pivot;
    columns[K][K] = reciprocal;
    for i in K + 1..CABLES {
        columns[K][i] *= reciprocal;
    }
    let factors = columns[K];
    for column in columns.iter_mut().skip(K + 1) {
        let top = column[K];
        for i in K + 1..CABLES {
            column[i] -= factors[i] * top;
        }
    }
    Some((pivot_row, pivot > T::zero()))
}

impl<T: Real> Elimination<T> {
    /// Decomposes `matrix`; `None` when it is singular to working precision or not finite.
    ///
    /// Singular means a pivot below the rounding unit of the 1-norm. About 70 multiplications, 6
    /// divisions.
    #[inline]
    #[must_use]
    pub fn new(matrix: &Matrix6<T>) -> Option<Self> {
        let norm = one_norm(matrix);
        let threshold = norm * T::EPSILON;
        let mut this =
            Self { columns: matrix.data.0, order: [0, 1, 2, 3, 4, 5], positive: true, norm };
        // One column each, with every loop of constant length.
        this.eliminate::<0>(threshold)?;
        this.eliminate::<1>(threshold)?;
        this.eliminate::<2>(threshold)?;
        this.eliminate::<3>(threshold)?;
        this.eliminate::<4>(threshold)?;
        this.eliminate::<5>(threshold)?;
        Some(this)
    }

    #[inline]
    fn eliminate<const K: usize>(&mut self, threshold: T) -> Option<()> {
        let (row, is_positive) = eliminate::<T, K, CABLES>(&mut self.columns, threshold)?;
        if row != K {
            self.order.swap(K, row);
            self.positive = !self.positive;
        }
        self.positive = self.positive == is_positive;
        Some(())
    }

    /// Solves `A x = b`. About 36 multiplications.
    #[inline]
    #[must_use]
    pub fn solve(&self, right: &Vector6<T>) -> Vector6<T> {
        // The order is a permutation, which the compiler cannot know; indexing could panic.
        let mut x: [T; CABLES] =
            core::array::from_fn(|i| right.get(self.order[i]).copied().unwrap_or_else(T::zero));
        for j in 0..CABLES {
            for i in j + 1..CABLES {
                x[i] -= self.columns[j][i] * x[j];
            }
        }
        for j in (0..CABLES).rev() {
            x[j] *= self.columns[j][j];
            for i in 0..j {
                x[i] -= self.columns[j][i] * x[j];
            }
        }
        Vector6::from(x)
    }

    /// The inverse, by six solves.
    #[must_use]
    pub fn inverse(&self) -> Matrix6<T> {
        let mut inverse = Matrix6::zeros();
        for j in 0..CABLES {
            let mut unit = Vector6::zeros();
            unit[j] = T::one();
            inverse.set_column(j, &self.solve(&unit));
        }
        inverse
    }

    /// Condition number in the 1-norm, by way of the inverse.
    #[must_use]
    pub fn condition(&self) -> T {
        self.norm * one_norm(&self.inverse())
    }

    /// Sign of the determinant: `true` when it is positive.
    #[must_use]
    pub fn is_positive(&self) -> bool {
        self.positive
    }
}

/// Six equations in five unknowns and three further columns, from which the unknowns are eliminated:
/// `M y = -(c_0 t_0 + c_1 t_1 + c_2 t_2)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Condensed<T> {
    /// The five columns of `M` as in [`Elimination`], then the three others.
    columns: [[T; CABLES]; 8],
    positive: bool,
}

impl<T: Real> Condensed<T> {
    /// `None` when the columns of `M` are dependent to working precision, or not finite. About 80 multiplications, 5
    /// divisions.
    #[inline]
    pub(crate) fn new(columns: [[T; CABLES]; 8]) -> Option<Self> {
        let norm = columns[..5]
            .iter()
            .map(|column| column.iter().fold(T::zero(), |sum, entry| sum + entry.abs()));
        let threshold = norm.fold(T::zero(), T::max) * T::EPSILON;
        let mut this = Self { columns, positive: true };
        this.eliminate::<0>(threshold)?;
        this.eliminate::<1>(threshold)?;
        this.eliminate::<2>(threshold)?;
        this.eliminate::<3>(threshold)?;
        this.eliminate::<4>(threshold)?;
        Some(this)
    }

    #[inline]
    fn eliminate<const K: usize>(&mut self, threshold: T) -> Option<()> {
        let (row, is_positive) = eliminate::<T, K, 8>(&mut self.columns, threshold)?;
        self.positive = self.positive == ((row == K) == is_positive);
        Some(())
    }

    /// The equation that is left: `sum t_k left[k] = 0`. Its sign is such that `left[k]` has that of the determinant of
    /// the five columns and column `k`, in this order.
    #[inline]
    pub(crate) fn left(&self) -> [T; 3] {
        let sign = if self.positive { T::one() } else { -T::one() };
        core::array::from_fn(|k| sign * self.columns[5 + k][5])
    }

    /// The five unknowns for `t`.
    #[inline]
    pub(crate) fn solve(&self, t: &[T; 3]) -> [T; 5] {
        let mut y: [T; 5] = core::array::from_fn(|i| {
            let [a, b, c] = core::array::from_fn(|k| self.columns[5 + k][i] * t[k]);
            -(a + b + c)
        });
        for j in (0..5).rev() {
            y[j] *= self.columns[j][j];
            for i in 0..j {
                y[i] -= self.columns[j][i] * y[j];
            }
        }
        y
    }
}

/// A 6x6 matrix, column by column, to be inverted in place: for where the norm of the inverse is
/// wanted as well as its product with several vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Square<T> {
    /// Of the inverse: column `j` belongs to component `rows[j]` of what it is multiplied with.
    pub(crate) columns: [[T; CABLES]; CABLES],
    rows: [usize; CABLES],
}

impl<T: Real> Square<T> {
    /// A matrix, given by its columns.
    #[inline]
    pub(crate) fn new(columns: [[T; CABLES]; CABLES]) -> Self {
        Self { columns, rows: [0, 1, 2, 3, 4, 5] }
    }

    /// Inverts a matrix whose columns have norms around 1 (Gauss and Jordan, partial pivoting); `false`
    /// when it is singular to working precision or not finite, and then nothing is left of it.
    #[inline]
    pub(crate) fn invert(&mut self) -> bool {
        self.exchange::<0>()
            && self.exchange::<1>()
            && self.exchange::<2>()
            && self.exchange::<3>()
            && self.exchange::<4>()
            && self.exchange::<5>()
    }

    /// Exchanges unknown `K` for the right side of the equation with the largest factor of it.
    #[inline]
    fn exchange<const K: usize>(&mut self) -> bool {
        let mut factors = self.columns[K];
        let mut pivot_size = factors[K].abs();
        let mut pivot_row = K;
        for i in K + 1..CABLES {
            let size = factors[i].abs();
            if size > pivot_size {
                pivot_size = size;
                pivot_row = i;
            }
        }
        let regular = pivot_size > T::EPSILON && pivot_size <= T::HUGE; // false for NaN
        if !regular {
            return false;
        }
        if pivot_row != K {
            for column in &mut self.columns {
                column.swap(K, pivot_row);
            }
            factors.swap(K, pivot_row);
            self.rows.swap(K, pivot_row);
        }
        let reciprocal = T::one() / factors[K];
        for i in 0..CABLES {
            factors[i] = -(factors[i] * reciprocal);
        }
        factors[K] = reciprocal;
        for j in 0..CABLES {
            if j != K {
                let top = self.columns[j][K];
                for i in 0..CABLES {
                    if i != K {
                        self.columns[j][i] += factors[i] * top;
                    }
                }
                self.columns[j][K] = top * reciprocal;
            }
        }
        self.columns[K] = factors;
        true
    }

    /// The product with a vector.
    #[inline]
    pub(crate) fn times(&self, right: &[T; CABLES]) -> [T; CABLES] {
        let mut x = [T::zero(); CABLES];
        for j in 0..CABLES {
            // A permutation, which the compiler cannot know; indexing could panic.
            let factor = right.get(self.rows[j]).copied().unwrap_or_else(T::zero);
            for i in 0..CABLES {
                x[i] += self.columns[j][i] * factor;
            }
        }
        x
    }

    /// Norms of the rows (2-norm).
    #[inline]
    pub(crate) fn row_norms(&self) -> [T; CABLES] {
        let mut sums = [T::zero(); CABLES];
        for column in &self.columns {
            for i in 0..CABLES {
                sums[i] += column[i] * column[i];
            }
        }
        sums.map(T::sqrt)
    }
}

/// Largest column sum of absolute values.
#[inline]
fn one_norm<T: Real>(matrix: &Matrix6<T>) -> T {
    let mut largest = T::zero();
    for column in matrix.column_iter() {
        let mut sum = T::zero();
        for entry in &column {
            sum += entry.abs();
        }
        largest = largest.max(sum);
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Well-mixed numbers in (-1, 1) from a linear congruence (Knuth's MMIX constants).
    fn entries(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            #[allow(clippy::cast_precision_loss)]
            let unit = (state >> 11) as f64 / 9_007_199_254_740_992.0;
            2.0 * unit - 1.0
        }
    }

    #[test]
    fn condensed_equations_are_what_is_left_of_six() {
        for seed in 0..500 {
            let mut next = entries(seed);
            let columns: [[f64; CABLES]; 8] =
                core::array::from_fn(|_| core::array::from_fn(|_| next()));
            let condensed = Condensed::new(columns).unwrap();
            let left = condensed.left();
            let with =
                |k: usize| Matrix6::from_fn(|i, j| columns[if j < 5 { j } else { 5 + k }][i]);
            let determinants = [0, 1, 2].map(|k| with(k).determinant());
            let room = 1e-12 * (1.0 + left.iter().map(|l| l.abs()).sum::<f64>());
            for k in 0..3 {
                assert!(left[k] * determinants[k] >= 0.0, "{seed}");
                let other = (k + 1) % 3;
                let cross = left[k] * determinants[other] - left[other] * determinants[k];
                assert!(cross.abs() < room, "{seed}: {cross:e}");
            }
            // On the equation that is left, the five unknowns solve all six.
            let t = [left[1], -left[0], 0.0];
            let y = condensed.solve(&t);
            for i in 0..CABLES {
                let sum: f64 = (0..5).map(|j| columns[j][i] * y[j]).sum::<f64>()
                    + (0..3).map(|k| columns[5 + k][i] * t[k]).sum::<f64>();
                let size = 1.0 + y.iter().map(|y| y.abs()).sum::<f64>();
                assert!(sum.abs() < 1e-12 * size, "{seed}: {sum:e}");
            }
        }
        let mut dependent = [[1.0; CABLES]; 8];
        assert!(Condensed::new(dependent).is_none());
        dependent[2][3] = f64::NAN;
        assert!(Condensed::new(dependent).is_none());
    }

    #[test]
    fn agrees_with_nalgebra() {
        for seed in 0..500 {
            let mut next = entries(seed);
            let matrix = Matrix6::from_fn(|_, _| next());
            let right = Vector6::from_fn(|_, _| next());
            let elimination = Elimination::new(&matrix).unwrap();
            let x = elimination.solve(&right);
            // Backward error of partial pivoting: n rounding units times a growth below 8 here.
            assert!((matrix * x - right).amax() < 6.0 * 8.0 * f64::EPSILON * (1.0 + x.amax()));
            assert_eq!(elimination.is_positive(), matrix.determinant() > 0.0);
            let identity = elimination.inverse() * matrix;
            let condition = elimination.condition();
            assert!((identity - Matrix6::identity()).amax() < 48.0 * f64::EPSILON * condition);
        }
    }

    #[test]
    fn inverts_like_nalgebra() {
        for seed in 0..500 {
            let mut next = entries(seed);
            let matrix = Matrix6::<f64>::from_fn(|_, _| next());
            let right = core::array::from_fn(|_| next());
            let mut square = Square::new(matrix.data.0);
            assert!(square.invert());
            // As above: the backward error of elimination, times the condition.
            let inverse = matrix.try_inverse().unwrap();
            let rows = square.row_norms();
            let bound = 2.0 * 6.0 * 8.0 * f64::EPSILON * matrix.norm() * inverse.norm();
            for (i, norm) in rows.into_iter().enumerate() {
                assert!((norm - inverse.row(i).norm()).abs() < bound * inverse.norm(), "{seed}");
            }
            let product = Vector6::from(square.times(&right));
            let error = (product - inverse * Vector6::from(right)).norm();
            assert!(error < bound * inverse.norm() * Vector6::from(right).norm(), "{seed}");
        }
        let mut singular = Square::new([[1.0_f32; CABLES]; CABLES]);
        assert!(!singular.invert());
        let mut not_finite = Square::new(Matrix6::<f32>::identity().data.0);
        not_finite.columns[3][4] = f32::NAN;
        assert!(!not_finite.invert());
    }

    #[test]
    fn refuses_singular_and_non_finite() {
        let mut next = entries(7);
        let mut matrix = Matrix6::from_fn(|_, _| next());
        let copy = matrix.column(1) * 2.0 - matrix.column(4);
        matrix.set_column(3, &copy);
        assert_eq!(Elimination::new(&matrix), None);
        assert_eq!(Elimination::<f64>::new(&Matrix6::zeros()), None);
        let mut matrix = Matrix6::<f32>::identity();
        matrix[(2, 2)] = f32::NAN;
        assert_eq!(Elimination::new(&matrix), None);
        matrix[(2, 2)] = f32::INFINITY;
        assert_eq!(Elimination::new(&matrix), None);
    }
}
