//! What rows of the equations are over a patch, as affine functions of the pose: see [`proof`](super::proof).

use cdpr_core::table::COORDINATES;
use nalgebra::{SMatrix, Vector6};

use super::patch::Patch;
use super::place::Point;
use super::sums::UPWARDS;
use crate::interval::Interval;

/// `|a| + |b| + ...`, element by element.
pub(super) fn sum_of_sizes<const R: usize, const C: usize>(
    all: &[SMatrix<f64, R, C>],
) -> SMatrix<f64, R, C> {
    all.iter().fold(SMatrix::zeros(), |sum, next| sum + next.abs())
}

/// Rows over a patch, as affine functions of the pose and of where on a piece the eliminated cable is.
#[derive(Clone, Copy)]
pub(super) struct Affine {
    pub(super) middle: Vector6<f64>,
    /// How far each coordinate moves them at most, and that place.
    pub(super) along: [Vector6<f64>; COORDINATES + 1],
    /// What they are off by besides at most.
    pub(super) open: Vector6<f64>,
}

impl Affine {
    /// With a way along a piece that begins there: how all rows change with it, and how far it is.
    pub(super) fn gone(self, slope: &Vector6<Interval>, gone_n: Interval) -> Self {
        let (slope_middle, middle) = (slope.map(Interval::middle), gone_n.middle());
        let mut along = self.along;
        along[COORDINATES] = slope_middle * gone_n.radius();
        let blur = slope.map(Interval::radius) + slope_middle.abs() * (4.0 * f64::EPSILON);
        let open = (self.open + blur * gone_n.magnitude()) * UPWARDS;
        Self { middle: self.middle + slope_middle * middle, along, open }
    }

    /// All values of a row.
    pub(super) fn over(&self, patch: &Patch, i: usize) -> Interval {
        let by_pose: Point = std::array::from_fn(|k| {
            let along = self.along[k][i];
            if along == 0.0 { 0.0 } else { along / patch.aside(k).magnitude() }
        });
        let aside = self.along[COORDINATES][i].abs() + self.open[i];
        patch.spread(&by_pose, &[0.0; COORDINATES]) + Interval::around(self.middle[i], aside)
    }

    /// Those where another row is zero: less multiples of it, the best for each end.
    pub(super) fn where_zero(&self, patch: &Patch, zero: usize, i: usize) -> Interval {
        // Sums of ten are off by fewer units than these of the sum of their sizes.
        const ROUNDING: f64 = 16.0 * f64::EPSILON;
        // The terms |a - t b| of the bound; they turn over at a/b.
        let terms: [[f64; 2]; COORDINATES + 2] = std::array::from_fn(|k| {
            self.along.get(k).map_or([0.0, self.open[zero]], |along| [along[i], along[zero]])
        });
        let mut turns = terms.map(|[a, b]| if b == 0.0 { [0.0; 2] } else { [a / b, b.abs()] });
        turns.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let all: f64 = turns.iter().map(|[_, weight]| weight).sum();
        let most = |way: f64| {
            let with = |t: f64| {
                let spread = terms.iter().map(|[a, b]| (a - t * b).abs()).sum::<f64>();
                let sizes = terms.iter().map(|[a, b]| a.abs() + (t * b).abs()).sum::<f64>();
                let [own, other] = [self.middle[i], t * self.middle[zero]];
                let rounding = (own.abs() + other.abs() + sizes) * ROUNDING;
                way * (own - other) + spread + self.open[i] + rounding
            };
            // It falls with t until then.
            let mut slope = -way * self.middle[zero] - all;
            let least = turns.iter().find(|[_, weight]| {
                slope += 2.0 * weight;
                slope >= 0.0
            });
            let [t, _] = least.unwrap_or(&turns[turns.len() - 1]);
            with(*t).min(with(0.0))
        };
        let (high, low) = (most(1.0), -most(-1.0));
        let all = self.over(patch, i);
        Interval::new(low.min(high), high.max(low)).intersection(all).unwrap_or(all)
    }

    /// How large they are at most.
    pub(super) fn most(&self) -> Vector6<f64> {
        (self.middle.abs() + sum_of_sizes(&self.along) + self.open) * UPWARDS
    }
}
