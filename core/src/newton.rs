//! The condensed Newton step: 18 unknowns, one 6x6 elimination.
//!
//! In force-curve coordinates the system is six equations of equilibrium in six arc lengths:
//! the columns of the matrix are `G_i t_i`, the wrench of the unit tangent of each curve. Solving
//!
//! ```text
//! sum_i alpha_i G_i t_i = -(wrench + sum_i G_i (F_i + c_i)),      (F, L)_i += c_i + alpha_i t_i
//! ```
//!
//! with `c_i` the way back to curve `i` is the Newton step of all 18 equations.

use nalgebra::{Matrix6, Vector6};

use crate::elimination::Elimination;
use crate::statics::Balance;
use crate::{CABLES, CableModel, CableState, CurvePoint, Real, Robot, Scalar};

/// Why a Newton step was not taken. Cables are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StepFault {
    /// The tension of this cable vanishes somewhere, or a number is not finite: no tangent.
    SingularCable(usize),
    /// The six tangents do not span all wrenches: a fold, or a singular posture.
    SingularStatics,
    /// The rest length of this cable is not positive and finite, before the step or after it.
    LengthNotPositive(usize),
}

impl core::fmt::Display for StepFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::SingularCable(i) => write!(f, "cable {}: the tension vanishes along it", i + 1),
            Self::SingularStatics => write!(f, "the cables cannot balance every wrench (singular)"),
            Self::LengthNotPositive(i) => write!(f, "cable {}: no positive rest length", i + 1),
        }
    }
}

impl core::error::Error for StepFault {}

/// One Newton step: where it leads and how good its start was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonStep<T: Scalar> {
    /// Forces and rest lengths after the step.
    pub states: [CableState<T>; CABLES],
    /// The linearised curves at the start.
    pub curves: [CurvePoint<T>; CABLES],
    /// Arc lengths `alpha` moved along the curves, N.
    pub advance_n: Vector6<T>,
    /// Largest distance between the end of a cable and its attachment before the step, m.
    pub closure_m: T,
    /// Largest component of the unbalanced wrench before the step, with each force moved the
    /// shortest way to its curve (moments over the moment arm), N.
    pub imbalance_n: T,
    /// Size of the step: the largest change of a force or rest length, each relative to the force
    /// or rest length of its cable. From the solution of a nearby pose the error that is left is
    /// about its square; from any other start it can be 10^4 times that (next to a fold, or for the
    /// small horizontal force of a very slack cable): look at the next step then.
    pub relative_change: T,
    elimination: Elimination<T>,
}

impl<T: Real> NewtonStep<T> {
    /// One step from `states` towards equilibrium at the pose of `balance`.
    ///
    /// Cost: six end-point maps, one elimination, one solve. No loops with a variable bound.
    ///
    /// # Errors
    /// [`StepFault`]; the states are then to be kept as they were.
    #[inline]
    pub fn new<M: CableModel<T>>(
        robot: &Robot<T, M>,
        balance: &Balance<T>,
        states: &[CableState<T>; CABLES],
    ) -> Result<Self, StepFault> {
        let planes = balance.planes();
        let mut closure_m = T::zero();
        let curves: [CurvePoint<T>; CABLES] = core::array::from_fn(|i| {
            let (plane, state) = (&planes[i], &states[i]);
            let end = robot.cables()[i].model.end_point(state.force_n, state.rest_length_m);
            let gap =
                (end.position_m.x - plane.x_m).abs().max((end.position_m.y - plane.z_m).abs());
            closure_m = closure_m.max(gap);
            CurvePoint::new(&end, plane.x_m, plane.z_m)
        });
        for i in 0..CABLES {
            if !is_length(states[i].rest_length_m) {
                return Err(StepFault::LengthNotPositive(i));
            }
            if !curves[i].is_finite() {
                return Err(StepFault::SingularCable(i));
            }
        }
        let mut imbalance = *balance.wrench_n();
        for i in 0..CABLES {
            imbalance += planes[i].wrench_n(&(states[i].force_n + curves[i].correction_n()));
        }
        let columns: [Vector6<T>; CABLES] =
            core::array::from_fn(|i| planes[i].wrench_n(&curves[i].tangent));
        let matrix = Matrix6::from_columns(&columns);
        let elimination = Elimination::new(&matrix).ok_or(StepFault::SingularStatics)?;
        let advance_n = elimination.solve(&-imbalance);
        let mut relative_change = T::zero();
        let mut next = *states;
        for i in 0..CABLES {
            let (curve, state) = (&curves[i], &states[i]);
            let force_change = curve.correction_n() + curve.tangent * advance_n[i];
            let length_change =
                curve.length_correction_m() + curve.length_per_force_m_n * advance_n[i];
            next[i].force_n = state.force_n + force_change;
            next[i].rest_length_m = state.rest_length_m + length_change;
            if !is_length(next[i].rest_length_m) {
                return Err(StepFault::LengthNotPositive(i));
            }
            if !(next[i].force_n.x.is_finite() && next[i].force_n.y.is_finite()) {
                return Err(StepFault::SingularCable(i));
            }
            // Both relative changes with one division.
            let (force, length) =
                (state.force_n.x.abs() + state.force_n.y.abs(), state.rest_length_m);
            let larger = ((force_change.x.abs() + force_change.y.abs()) * length)
                .max(length_change.abs() * force);
            relative_change = relative_change.max(larger / (force * length));
        }
        Ok(Self {
            states: next,
            curves,
            advance_n,
            closure_m,
            imbalance_n: max_component(&imbalance),
            relative_change,
            elimination,
        })
    }

    /// Condition number (1-norm) of the matrix of tangent wrenches at the start of the step.
    ///
    /// Its columns are unit forces, so its reciprocal is the relative distance to a fold or a
    /// singular posture. Exact but for rounding, at the cost of six solves.
    #[must_use]
    pub fn condition(&self) -> T {
        self.elimination.condition()
    }

    /// Sign of the determinant of the matrix of tangent wrenches (tangents towards longer cables):
    /// `true` when positive. Its sum over all solutions of a pose is the degree.
    #[must_use]
    pub fn is_positive(&self) -> bool {
        self.elimination.is_positive()
    }
}

/// A solution, with the step that confirmed it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence<T: Scalar> {
    /// The last step, taken at the solution: its start is converged, and its result is the solution.
    pub step: NewtonStep<T>,
    /// Steps taken.
    pub iterations: u32,
}

/// Why Newton's method ended without a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConvergenceFault<T> {
    /// A step could not be taken.
    Step(StepFault),
    /// The steps did not settle.
    NotConverged {
        /// Steps taken.
        iterations: u32,
        /// Size of the last step.
        relative_change: T,
    },
}

/// Newton steps until one changes nothing by more than `tolerance` (relative), at most
/// `max_iterations` of them.
///
/// # Errors
/// [`ConvergenceFault`]; never the last iterate passed off as a solution.
pub fn converge<T: Real, M: CableModel<T>>(
    robot: &Robot<T, M>,
    balance: &Balance<T>,
    start: &[CableState<T>; CABLES],
    tolerance: T,
    max_iterations: u32,
) -> Result<Convergence<T>, ConvergenceFault<T>> {
    let mut states = *start;
    let mut relative_change = T::HUGE;
    for iterations in 1..=max_iterations {
        let step = NewtonStep::new(robot, balance, &states).map_err(ConvergenceFault::Step)?;
        relative_change = step.relative_change;
        if relative_change <= tolerance {
            return Ok(Convergence { step, iterations });
        }
        states = step.states;
    }
    Err(ConvergenceFault::NotConverged { iterations: max_iterations, relative_change })
}

/// Positive and finite; false for NaN.
#[inline]
fn is_length<T: Real>(length_m: T) -> bool {
    length_m > T::zero() && length_m <= T::HUGE
}

#[inline]
fn max_component<T: Real>(vector: &Vector6<T>) -> T {
    vector.iter().fold(T::zero(), |largest, c| largest.max(c.abs()))
}
