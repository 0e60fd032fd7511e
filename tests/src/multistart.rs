//! All solutions of a pose by brute force: an oracle for the tests of cleverer methods.
//!
//! Newton's method from many random starts. It shares the cable models and the linearised force
//! curve with what it tests, but nothing else: no rigid solutions, no continuation, no search by
//! intervals. It proves nothing about solutions it does not find.

use cdpr_core::elimination::Elimination;
use cdpr_core::{CABLES, CableModel, CableState, CurvePoint, NewtonStep, newton};
use cdpr_host_sim::problem::Problem;
use nalgebra::{Matrix6, Vector2, Vector6};
use rand::{Rng, RngExt};

/// Largest number of slack cables of a start. Slack cables pull nearly vertically, and four or more
/// vertical forces are dependent.
const SLACK_CABLES: u32 = 3;
/// Where there is no limit of the length, starts are at most this many times as long as the distance.
const LENGTH_FACTOR: f64 = 1e3;
/// Taut starts have at most this many times the load and the weight of the straight cables as
/// tension, where the limit is not lower.
const TENSION_FACTOR: f64 = 1e3;
/// Tension range of taut starts, as a part of its upper end.
const TENSION_RANGE: f64 = 1e-5;

/// Damped Newton steps from one start. Starts that arrive need about ten.
const STEPS: usize = 20;
/// Lengths that are tried for a step, each half of the last. More of them, and more of
/// [`STEPS_TO_CURVE`], bring a few more starts home, at a cost that is better spent on more starts.
const TRIES: usize = 3;
/// Part of the expected improvement that is enough (Armijo's rule).
const ENOUGH: f64 = 1e-2;
/// Largest step, relative to the force, or to the weight of the cable where that is more.
const LARGEST_STEP: f64 = 4.0;
/// Newton steps from a state to its force curve, which is nearly straight where steps are long.
const STEPS_TO_CURVE: usize = 5;
/// How close to the curve is close enough, relative to force and length; Newton's next step squares it.
const ON_CURVE: f64 = 1e-8;
/// Relative imbalance from which undamped Newton converges to rounding.
const BALANCED: f64 = 1e-9;
/// Change of the last Newton step of a solution, relative. Rounding times the condition near a fold
/// is about this; a start that has not found a solution does not come near it.
const CONVERGED: f64 = 1e-10;
/// Undamped Newton steps at the end.
const LAST_STEPS: u32 = 6;
/// Two solutions are the same when no length and no force differs by more than this part: far more
/// than [`CONVERGED`], and less than the distance of two solutions next to a fold.
const SAME: f64 = 1e-6;

/// A solution found from random starts.
#[derive(Clone, Debug)]
pub struct Found {
    /// Forces and rest lengths.
    pub states: [CableState<f64>; CABLES],
    /// Sign of the determinant of the six unit tangents, towards longer cables: true for +1.
    pub is_positive: bool,
    /// Starts that led to it. A solution with few of them would have been missed with fewer starts.
    pub hits: u32,
}

/// Solutions of `problem` within its limits, found from `starts` random starts; in the order in which
/// they were found, none twice. Exactly vertical slack cables, which have no regular force curve, are
/// not found.
///
/// A solution that a share `p` of the starts leads to is missed with probability `(1 - p)^starts`. Within
/// the limits of MARIONET-CRANE the smallest share was 1.4 % (800 solutions at 4000 random poses, 10 of
/// them without rigid origin), without limits 0.5 %: three slack cables each.
///
/// Cost: 15 us a start.
#[must_use]
pub fn solutions<M: CableModel<f64>>(
    problem: &Problem<M>,
    starts: u32,
    rng: &mut impl Rng,
) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    for _ in 0..starts {
        let Some(step) = start(problem, rng).and_then(|start| solve(problem, start)) else {
            continue;
        };
        if let Some(known) = found.iter_mut().find(|known| are_same(&known.states, &step.states)) {
            known.hits += 1;
        } else if is_within_limits(problem, &step.states) {
            let is_positive = step.is_positive();
            found.push(Found { states: step.states, is_positive, hits: 1 });
        }
    }
    found
}

/// Whether no length and no force (as a plane vector) differs by more than `1e-6` of it.
#[must_use]
pub fn are_same(a: &[CableState<f64>; CABLES], b: &[CableState<f64>; CABLES]) -> bool {
    a.iter().zip(b).all(|(a, b)| {
        (a.rest_length_m - b.rest_length_m).abs() <= SAME * b.rest_length_m
            && (a.force_n - b.force_n).norm() <= SAME * b.force_n.norm()
    })
}

fn is_within_limits<M: CableModel<f64>>(
    problem: &Problem<M>,
    states: &[CableState<f64>; CABLES],
) -> bool {
    (0..CABLES).all(|i| {
        let (state, limits) = (&states[i], &problem.limits[i]);
        let at_anchor = state.tension_at_anchor_n(problem.model(i).weight_n_m());
        state.rest_length_m <= limits.max_length_m
            && state.tension_at_attachment_n().max(at_anchor) <= limits.max_tension_n
    })
}

/// Six cables on their force curves, and how far they are from equilibrium.
struct OnCurves {
    states: [CableState<f64>; CABLES],
    curves: [CurvePoint<f64>; CABLES],
    imbalance: Vector6<f64>,
}

impl OnCurves {
    fn new<M: CableModel<f64>>(
        problem: &Problem<M>,
        guess: &[CableState<f64>; CABLES],
    ) -> Option<Self> {
        let mut states = *guess;
        let mut curves = [None; CABLES];
        for i in 0..CABLES {
            let (state, curve) = to_curve(problem, i, guess[i])?;
            states[i] = state;
            curves[i] = Some(curve);
        }
        let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = curves else { return None };
        let imbalance = problem.balance.residual_n(&states.map(|state| state.force_n));
        Some(Self { states, curves: [a, b, c, d, e, f], imbalance })
    }

    /// The unit of a relative imbalance.
    fn load_n<M>(&self, problem: &Problem<M>) -> f64 {
        let forces = self.states.iter().map(|state| state.force_n.norm());
        forces.fold(problem.balance.wrench_n().amax(), f64::max)
    }
}

/// One cable moved to its force curve, the shortest way.
fn to_curve<M: CableModel<f64>>(
    problem: &Problem<M>,
    cable: usize,
    guess: CableState<f64>,
) -> Option<(CableState<f64>, CurvePoint<f64>)> {
    let (plane, model) = (&problem.balance.planes()[cable], problem.model(cable));
    let mut state = guess;
    for _ in 0..STEPS_TO_CURVE {
        let end = model.end_point(state.force_n, state.rest_length_m);
        let curve = CurvePoint::new(&end, plane.x_m, plane.z_m);
        if !curve.is_finite() {
            return None;
        }
        let force = curve.correction_n().norm() / state.force_n.norm();
        let length = curve.length_correction_m().abs() / state.rest_length_m;
        state.force_n += curve.correction_n();
        state.rest_length_m += curve.length_correction_m();
        // A cable pulls its attachment towards the anchor, never away from it.
        if !(state.rest_length_m > 0.0 && state.force_n.x > 0.0) {
            return None;
        }
        if force.max(length) < ON_CURVE {
            return Some((state, curve));
        }
    }
    None
}

/// A random start: any of the 42 sets of up to three cables slack, with lengths log-uniform between the
/// distance and the limit, the others with log-uniform tension.
fn start<M: CableModel<f64>>(problem: &Problem<M>, rng: &mut impl Rng) -> Option<OnCurves> {
    let planes = problem.balance.planes();
    let heavy = (0..CABLES).map(|i| problem.model(i).weight_n_m() * planes[i].distance_m());
    let load_n = problem.balance.wrench_n().norm() + heavy.sum::<f64>();
    let slack = loop {
        let set = rng.random_range(0..1_u32 << CABLES);
        if set.count_ones() <= SLACK_CABLES {
            break set;
        }
    };
    let mut states = [CableState { force_n: Vector2::zeros(), rest_length_m: 0.0 }; CABLES];
    for i in 0..CABLES {
        let (plane, model, limits) = (&planes[i], problem.model(i), &problem.limits[i]);
        let distance_m = plane.distance_m();
        let is_slack = slack >> i & 1 == 1 && model.weight_n_m() > 0.0;
        states[i] = if is_slack {
            let longest_m = limits.max_length_m.min(LENGTH_FACTOR * distance_m);
            let ratio = (longest_m / distance_m).max(1.0);
            // Not the distance itself, which an inextensible cable cannot have.
            let share = 1.0 - rng.random::<f64>();
            let rest_length_m = distance_m * ratio.powf(share);
            let line = model.force_at_length(plane.x_m, plane.z_m, rest_length_m).ok()?;
            CableState { force_n: line.force_n, rest_length_m }
        } else {
            let largest_n = limits.max_tension_n.min(TENSION_FACTOR * load_n);
            let tension_n = largest_n * TENSION_RANGE.powf(rng.random());
            let force_n = Vector2::new(plane.x_m, plane.z_m) * (tension_n / distance_m);
            CableState { force_n, rest_length_m: distance_m }
        };
    }
    OnCurves::new(problem, &states)
}

/// Damped Newton along the six force curves.
fn solve<M: CableModel<f64>>(problem: &Problem<M>, start: OnCurves) -> Option<NewtonStep<f64>> {
    let planes = problem.balance.planes();
    let mut at = start;
    for _ in 0..STEPS {
        if at.imbalance.norm() <= BALANCED * at.load_n(problem) {
            break;
        }
        let columns: [Vector6<f64>; CABLES] =
            std::array::from_fn(|i| planes[i].wrench_n(&at.curves[i].tangent));
        let advance = Elimination::new(&Matrix6::from_columns(&columns))?.solve(&-at.imbalance);
        let largest = (0..CABLES)
            .map(|i| {
                let weight_n = problem.model(i).weight_n_m() * planes[i].distance_m();
                advance[i].abs() / at.states[i].force_n.norm().max(weight_n)
            })
            .fold(0.0, f64::max);
        let mut part = (LARGEST_STEP / largest).min(1.0);
        let mut next = None;
        for _ in 0..TRIES {
            let guess = std::array::from_fn(|i| {
                let (state, curve) = (&at.states[i], &at.curves[i]);
                let along = part * advance[i];
                CableState {
                    force_n: state.force_n + curve.tangent * along,
                    rest_length_m: state.rest_length_m + curve.length_per_force_m_n * along,
                }
            });
            next = OnCurves::new(problem, &guess)
                .filter(|next| next.imbalance.norm() < (1.0 - ENOUGH * part) * at.imbalance.norm());
            if next.is_some() {
                break;
            }
            part *= 0.5;
        }
        at = next?;
    }
    newton::converge(&problem.robot, &problem.balance, &at.states, CONVERGED, LAST_STEPS)
        .ok()
        .map(|convergence| convergence.step)
}
