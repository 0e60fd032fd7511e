//! What changes along a path.

use cdpr_core::{CABLES, CableModel, CablePlane};
use nalgebra::Vector6;

use crate::problem::Problem;

/// A family of problems of one pose with one positive parameter, followed in its logarithm `sigma`.
///
/// The equations stay separable: each cable has its own force curve at each `sigma`, and the wrench
/// depends on `sigma` alone.
pub(crate) trait Homotopy {
    /// The cable model.
    type Model: CableModel<f64>;

    /// The planes of the cables, which do not change.
    fn planes(&self) -> &[CablePlane<f64>; CABLES];

    /// The model of one cable, counted from 0, at `sigma`.
    fn model(&self, cable: usize, sigma: f64) -> Self::Model;

    /// The external wrench at `sigma`, moments over the moment arm, N.
    fn wrench_n(&self, sigma: f64) -> Vector6<f64>;

    /// Its derivative in `sigma`, N.
    fn wrench_slope_n(&self, sigma: f64) -> Vector6<f64>;
}

/// Mass and stretch of every cable scaled together by the deformation `s = exp(sigma)`:
/// `mu(s) = s mu`, `1/EA(s) = s/EA`.
pub(super) struct Deformation<'a, M> {
    /// The problem at `s = 1`.
    pub(super) problem: &'a Problem<M>,
}

impl<M: CableModel<f64>> Homotopy for Deformation<'_, M> {
    type Model = M;

    fn planes(&self) -> &[CablePlane<f64>; CABLES] {
        self.problem.balance.planes()
    }

    fn model(&self, cable: usize, sigma: f64) -> M {
        self.problem.model(cable).at_deformation(sigma.exp())
    }

    fn wrench_n(&self, _sigma: f64) -> Vector6<f64> {
        *self.problem.balance.wrench_n()
    }

    fn wrench_slope_n(&self, _sigma: f64) -> Vector6<f64> {
        Vector6::zeros()
    }
}
