//! Newton's method along a path, and the sampled test for steps that cannot be proven.

use cdpr_core::{CABLES, CableState};
use nalgebra::Vector6;

use super::homotopy::Homotopy;
use super::system::{Coordinates, Linearised, Point, SIGMA, System};

/// Largest contraction accepted: the derivative may change by this part over the tested box. One
/// half would do (then `eta <= (1 - k) r` for `r = 2 eta`); the rest covers what lies between the
/// sampled corners of the box.
const MAX_CONTRACTION: f64 = 0.25;

/// Smallest radius of the tested box, in scaled coordinates: a start that is exact still has to
/// show a neighbourhood in which it is the only solution.
const LEAST_RADIUS: f64 = 1e-7;

/// Newton steps after an accepted test; contraction below 1/4 with quadratic convergence needs 5.
const NEWTON_STEPS: usize = 12;

/// Step size at which Newton has converged, in scaled coordinates.
const CONVERGED: f64 = 1e-13;
/// Step size after which the next one, of its square, does not matter to a proof.
const CLOSE: f64 = 1e-3;
/// Step size that rounding may leave at a bad condition.
const CONVERGED_TO_ROUNDING: f64 = 1e-9;

/// The Kantorovich numbers of a start, in scaled force-curve coordinates and the largest-component
/// norm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kantorovich {
    /// Radius of the ball, twice the size `eta` of the first Newton step.
    pub(super) radius: f64,
    /// Contraction `k`: change of the derivative over the ball, seen through the
    /// inverse at its centre, and over the way from the last solution to it.
    pub(super) contraction: f64,
    /// `h = eta omega` with `omega = k / (2 eta)` the Lipschitz constant over the ball: at most 1/2
    /// means that there is exactly one solution in the ball (the paper, section 3.1).
    pub(super) h: f64,
}

/// Tests whether Newton from `start` with coordinate `held` fixed converges to the only solution
/// nearby, for every point between `from` and `start`.
///
/// The system is separable: the column of a cable depends on its own coordinate and `sigma` only.
/// So the change of the derivative over a box of all coordinates is bounded column by column, from
/// the curve at the corners of its own box, and at `from` for the way between. The curve turns
/// monotonically but for one inflection with an overshoot below 0.025 rad, so the corners see what
/// the box holds up to that; this is a test with a margin, for steps without a proof.
pub(super) fn kantorovich<H: Homotopy>(
    system: &System<'_, H>,
    linear: &Linearised<'_, H>,
    start: &Point,
    from: &Point,
    held: usize,
) -> Option<Kantorovich> {
    let elimination = linear.eliminate(held)?;
    let newton = linear.newton(held, &elimination);
    let eta = size_of_step(linear, start, &newton);
    let radius = (2.0 * eta).max(LEAST_RADIUS);
    let mut row_sums = Vector6::zeros();
    for i in 0..CABLES {
        let mut largest = [Vector6::zeros(); 2];
        let mut see = |state: &CableState<f64>, sigma: f64| {
            let other = system.curve(i, state, sigma)?;
            for (seen, largest) in
                linear.difference(i, &other, &elimination).iter().zip(&mut largest)
            {
                *largest = largest.sup(seen);
            }
            Some(())
        };
        see(&from.states[i], from.sigma)?;
        // A held coordinate does not move within the box.
        let forces: &[f64] = if held == i { &[0.0] } else { &[-radius, radius] };
        let sigmas: &[f64] = if held == SIGMA { &[0.0] } else { &[-radius, radius] };
        for &force in forces {
            for &sigma in sigmas {
                let mut step = [0.0; CABLES + 1];
                step[i] = force;
                step[SIGMA] = sigma;
                let corner = linear.advance(start, &step, true);
                let mut state = corner.states[i];
                // Back to the curve, so that the sample is a point of it.
                let back = system.curve(i, &state, corner.sigma)?.curve;
                state.force_n += back.correction_n();
                state.rest_length_m += back.length_correction_m();
                see(&state, corner.sigma)?;
            }
        }
        if held != i {
            row_sums += largest[0];
        }
        if held != SIGMA {
            row_sums += largest[1];
        }
    }
    if held != SIGMA {
        let sigmas = [from.sigma, start.sigma - radius, start.sigma + radius];
        let load = sigmas.map(|sigma| linear.load_difference(sigma, &elimination));
        row_sums += load[0].sup(&load[1]).sup(&load[2]);
    }
    let contraction = row_sums.max();
    let h = eta * contraction / radius;
    contraction.is_finite().then_some(Kantorovich { radius, contraction, h })
}

impl Kantorovich {
    /// Whether the start is accepted.
    pub(super) fn holds(&self) -> bool {
        self.contraction <= MAX_CONTRACTION
    }

    /// Whether `solution` lies in the ball around `start` that was tested. It does unless the corners
    /// of the ball missed a bend of a curve.
    pub(super) fn reaches<H>(
        &self,
        linear: &Linearised<'_, H>,
        start: &Point,
        solution: &Point,
    ) -> bool {
        let moved = |i: usize| (solution.states[i].force_n - start.states[i].force_n).norm();
        let forces = (0..CABLES).all(|i| moved(i) <= self.radius * linear.scales[i]);
        forces && (solution.sigma - start.sigma).abs() <= self.radius
    }
}

/// How far Newton is asked to converge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Accuracy {
    /// To rounding.
    Full,
    /// Well within the box of a proof, which bounds what is left.
    Proof,
}

/// Newton with coordinate `held` fixed, to convergence.
pub(crate) fn converge<H: Homotopy>(
    system: &System<'_, H>,
    start: &Point,
    held: usize,
    accuracy: Accuracy,
) -> Option<Point> {
    let mut point = start.clone();
    let mut last = f64::INFINITY;
    for _ in 0..NEWTON_STEPS {
        let linear = system.linearise(&point)?;
        let newton = linear.newton(held, &linear.eliminate(held)?);
        let size = size_of_step(&linear, &point, &newton);
        point = linear.advance(&point, &newton, true);
        let enough = match accuracy {
            Accuracy::Full => CONVERGED,
            Accuracy::Proof => CLOSE,
        };
        if size <= enough || (size >= 0.5 * last && size <= CONVERGED_TO_ROUNDING) {
            return Some(point);
        }
        last = size;
    }
    None
}

/// Largest scaled change of a coordinate, or relative change on the way back to a curve.
fn size_of_step<H: Homotopy>(linear: &Linearised<'_, H>, point: &Point, step: &Coordinates) -> f64 {
    let along = step.iter().fold(0.0_f64, |largest, y| largest.max(y.abs()));
    let back = linear.curves.iter().zip(&point.states).zip(&linear.scales).map(
        |((moving, state), scale)| {
            let force = moving.curve.correction_n().amax() / scale;
            force.max(moving.curve.length_correction_m().abs() / state.rest_length_m)
        },
    );
    back.fold(along, f64::max)
}
