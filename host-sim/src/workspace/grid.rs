//! The poses of a map: positions on a regular grid.

use serde::{Deserialize, Serialize};

/// Poses of a map at most: what is known of them is held in memory, some 50 bytes a pose and 200 more where there is a
/// solution.
pub const MOST_POSES: usize = 100_000_000;

/// A regular grid of positions, both ends of each range included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    counts: [usize; 3],
    low_m: [f64; 3],
    high_m: [f64; 3],
}

/// Why there is no such grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GridError {
    /// No pose along an axis.
    #[error("--grid: at least one pose is needed along {0}")]
    NoPose(char),
    /// Too many.
    #[error("--grid: more than {MOST_POSES} poses")]
    TooMany,
    /// The ends are not in order, or not finite.
    #[error("--region: the ends along {0} are not finite and in ascending order")]
    Range(char),
    /// One pose in a range.
    #[error(
        "--grid, --region: one pose along {0}, but the region has two ends there: give one value"
    )]
    OneInRange(char),
    /// Several poses at one place.
    #[error("--grid, --region: several poses along {0}, but the region has no extent there")]
    ManyAtOnePlace(char),
}

impl Grid {
    /// `counts` poses along x, y and z from `low_m` to `high_m`, world frame.
    ///
    /// # Errors
    /// [`GridError`].
    pub fn new(counts: [usize; 3], low_m: [f64; 3], high_m: [f64; 3]) -> Result<Self, GridError> {
        for (axis, name) in ['x', 'y', 'z'].into_iter().enumerate() {
            let (count, low, high) = (counts[axis], low_m[axis], high_m[axis]);
            let is_range = low <= high && low.is_finite() && (high - low).is_finite();
            if !is_range {
                return Err(GridError::Range(name));
            }
            match (count, low < high) {
                (0, _) => return Err(GridError::NoPose(name)),
                (1, true) => return Err(GridError::OneInRange(name)),
                (2.., false) => return Err(GridError::ManyAtOnePlace(name)),
                _ => {}
            }
        }
        let poses = counts.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
        match poses {
            Some(poses) if poses <= MOST_POSES => Ok(Self { counts, low_m, high_m }),
            _ => Err(GridError::TooMany),
        }
    }

    /// Number of poses along x, y and z.
    #[must_use]
    pub fn counts(&self) -> [usize; 3] {
        self.counts
    }

    /// Its lowest corner, m.
    #[must_use]
    pub fn low_m(&self) -> [f64; 3] {
        self.low_m
    }

    /// Its highest corner, m.
    #[must_use]
    pub fn high_m(&self) -> [f64; 3] {
        self.high_m
    }

    /// Number of poses.
    #[must_use]
    pub fn poses(&self) -> usize {
        self.counts.iter().product()
    }

    /// Where pose `number` stands along x, y and z, counted from 0. x runs fastest.
    #[must_use]
    pub fn indices(&self, number: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts;
        [number % nx, number / nx % ny, number / nx / ny]
    }

    /// Position of pose `number`, m. The ends are those given, to the bit.
    #[must_use]
    pub fn position_m(&self, number: usize) -> [f64; 3] {
        let indices = self.indices(number);
        std::array::from_fn(|axis| {
            let (index, steps) = (indices[axis], self.counts[axis] - 1);
            if index == steps {
                self.high_m[axis]
            } else {
                let step_m = (self.high_m[axis] - self.low_m[axis]) / steps as f64;
                self.low_m[axis] + index as f64 * step_m
            }
        })
    }

    /// Whether it is one that [`Grid::new`] makes: to be asked of one that was read.
    pub(super) fn check(&self) -> Result<(), GridError> {
        Self::new(self.counts, self.low_m, self.high_m).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn x_runs_fastest_and_the_ends_are_exact() {
        let grid = Grid::new([3, 1, 2], [-0.1, 7.0, 0.0], [0.3, 7.0, 0.7]).expect("a grid");
        let positions: Vec<_> = (0..grid.poses()).map(|n| grid.position_m(n)).collect();
        let (low, middle, high) = (-0.1, -0.1 + (0.3 - -0.1) / 2.0, 0.3);
        let row = |z| [[low, 7.0, z], [middle, 7.0, z], [high, 7.0, z]];
        assert_eq!(positions, [row(0.0), row(0.7)].concat());
        assert_eq!(grid.indices(4), [1, 0, 1]);
    }

    #[test]
    fn what_is_no_grid_is_refused() {
        let (low, high) = ([0.0; 3], [1.0; 3]);
        let with = |counts, low, high| Grid::new(counts, low, high).expect_err("no grid");
        assert_eq!(with([0, 2, 2], low, high), GridError::NoPose('x'));
        assert_eq!(with([2, 1, 2], low, high), GridError::OneInRange('y'));
        assert_eq!(with([2, 2, 2], low, [1.0, 1.0, 0.0]), GridError::ManyAtOnePlace('z'));
        assert_eq!(with([2, 2, 2], low, [1.0, -1.0, 1.0]), GridError::Range('y'));
        assert_eq!(with([2, 2, 2], [f64::NAN; 3], high), GridError::Range('x'));
        assert_eq!(with([2, 2, 2], [f64::MIN; 3], [f64::MAX; 3]), GridError::Range('x'));
        assert_eq!(with([1000, 1000, 101], low, high), GridError::TooMany);
        assert_eq!(with([usize::MAX; 3], low, high), GridError::TooMany);
    }
}
