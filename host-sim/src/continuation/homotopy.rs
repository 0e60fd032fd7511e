//! What changes along a path.

use cdpr_core::{CABLES, CableModel, CablePlane};
use nalgebra::Vector6;

use super::Steps;
use super::certificate::{Certificate, Joint, Reach, Refusal, Span, certify};
use super::system::{Point, System};
use crate::complete::Provable;
use crate::dual::Dual;
use crate::interval::Interval;
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

    /// What a proof of the steps from and to `point` needs; `None` when steps are not to be proven.
    fn joint(_system: &System<'_, Self>, _point: &Point) -> Option<Joint>
    where
        Self: Sized,
    {
        None
    }

    /// Proves a step from one joint to another.
    ///
    /// # Errors
    /// [`Refusal`]; always for a family without proofs.
    fn certify(
        _system: &System<'_, Self>,
        _span: &Span<'_>,
        _from: &Joint,
        _to: &mut Joint,
        _reach: &mut Reach,
    ) -> Result<Certificate, Refusal>
    where
        Self: Sized,
    {
        Err(Refusal::Long)
    }

    /// Whether steps are to be proven.
    fn is_proven(&self) -> bool {
        false
    }
}

/// A family that can be enclosed over a range of the parameter.
pub(super) trait Enclosed: Homotopy<Model: Provable> {
    /// Encloses the model of one cable at every number of `sigma`.
    fn enclosing(&self, cable: usize, sigma: Interval) -> <Self::Model as Provable>::Enclosing;

    /// The same, with the rate at which the model changes as `sigma` does.
    fn moving(&self, cable: usize, sigma: Dual) -> <Self::Model as Provable>::Moving;

    /// Encloses the external wrench at every number of `sigma`, and its derivative, N.
    fn wrench_over_n(&self, sigma: Interval) -> [Dual; 6];
}

/// Mass and stretch of every cable scaled together by the deformation `s = exp(sigma)`:
/// `mu(s) = s mu`, `1/EA(s) = s/EA`.
pub(super) struct Deformation<'a, M> {
    /// The problem at `s = 1`.
    pub(super) problem: &'a Problem<M>,
    /// How sure each step is.
    pub(super) steps: Steps,
}

impl<M: Provable> Homotopy for Deformation<'_, M> {
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

    fn joint(system: &System<'_, Self>, point: &Point) -> Option<Joint> {
        if system.homotopy.is_proven() { Joint::new(system, point) } else { None }
    }

    fn certify(
        system: &System<'_, Self>,
        span: &Span<'_>,
        from: &Joint,
        to: &mut Joint,
        reach: &mut Reach,
    ) -> Result<Certificate, Refusal> {
        certify(system, span, from, to, reach)
    }

    fn is_proven(&self) -> bool {
        self.steps == Steps::Certified
    }
}

impl<M: Provable> Enclosed for Deformation<'_, M> {
    fn enclosing(&self, cable: usize, sigma: Interval) -> M::Enclosing {
        self.problem.model(cable).enclosing().at_deformation(sigma.exp())
    }

    fn moving(&self, cable: usize, sigma: Dual) -> M::Moving {
        self.problem.model(cable).moving().at_deformation(sigma.exp())
    }

    fn wrench_over_n(&self, _sigma: Interval) -> [Dual; 6] {
        self.problem.balance.wrench_n().data.0[0].map(Dual::point)
    }
}
