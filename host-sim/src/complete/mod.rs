//! All solutions of a pose, with a proof that these are all.
//!
//! For a fixed pose the force of each cable runs along a plane curve (see
//! [`force_curve`](cdpr_core::CurvePoint)), and the inverse kinematics is six curves and six equations
//! of equilibrium. Limits of length and tension make the curves finite; a box of six pieces of them is
//! shown to hold no solution, or exactly one, or is cut. What can be shown neither way down to pieces
//! of rounding size (two solutions meeting exactly at this pose) is reported as undecided.
//!
//! The proof holds for exact cables of the model's equations at every pose whose planes differ from
//! the computed ones by rounding (see [`PLANE_ROUNDING`]), under the contract of
//! [`CableModel`]. All bounds are in interval arithmetic or carry a bound on
//! their rounding.

pub(crate) mod curve;
mod model;
mod search;
mod statics;
#[cfg(test)]
mod tests;

use cdpr_core::{CABLES, CableModel, CableState};
use nalgebra::Vector2;
use num_traits::Zero;

pub use model::{Course, Provable, Shape, Stretch, jacobian_course};

use crate::continuation::Quantity;
use crate::interval::Interval;
use crate::problem::Problem;
use cdpr_core::Scalar;
use curve::{Curve, Node, Piece};
use search::Search;
use statics::examine;

/// How far a computed plane may be from the true one, in units of the coordinates that went into it.
///
/// The entries of the rotation matrix are off by at most 8 roundings (of 2^-53 each) and their product
/// with the attachment by 3 more, three of them together: 20 roundings of the moment arm are enough.
/// Adding the position and subtracting the anchor round once each, the horizontal distance twice.
/// Twice all that is taken.
pub const PLANE_ROUNDING: f64 = 2.0 * f64::EPSILON;
/// How far beyond the limits the curves are searched, so that solutions at a limit are not cut off.
const BEYOND: f64 = 1e-6;
/// How often the ball of [`kantorovich`] is doubled at most.
const BALL_DOUBLINGS: usize = 48;
/// How often a starting point is moved further beyond a limit, by this factor each time.
const END_ATTEMPTS: usize = 24;
const END_GROWTH: f64 = 2.0;

/// A solution that was proven to exist.
#[derive(Clone, Debug)]
pub struct Proof {
    nodes: [Node<()>; CABLES],
    /// Half lengths of the pieces in which it is the only one, N.
    radii_n: [f64; CABLES],
}

/// The numbers of Kantorovich's theorem for a proven solution, in force-curve coordinates (newtons
/// along each curve) and the largest-component norm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Kantorovich {
    /// Norm of the inverse of the derivative at the solution (its columns are wrenches of unit
    /// tangents, in newtons).
    pub beta: f64,
    /// Bound on the Newton step from the middle of the enclosure, N.
    pub eta_n: f64,
    /// Bound on the change of the derivative from the solution to any point of the ball, over the
    /// radius of the ball, 1/N.
    pub omega_per_n: f64,
    /// `beta eta omega`; the theorem asks for at most one half.
    pub h: f64,
    /// Within this distance of the middle there is a solution, N.
    pub existence_radius_n: f64,
    /// Within this distance there is no other, N; the ball of `omega`.
    pub uniqueness_radius_n: f64,
}

impl Proof {
    /// Encloses force and rest length of each cable.
    #[must_use]
    pub fn enclosure(&self) -> [CableState<Interval>; CABLES] {
        self.nodes.map(|node| node.state)
    }

    /// The solution, rounded: within [`Proof::enclosure`] but for rounding.
    #[must_use]
    pub fn states(&self) -> [CableState<f64>; CABLES] {
        self.nodes.map(|node| CableState {
            force_n: node.state.force_n.map(Interval::middle),
            rest_length_m: node.state.rest_length_m.middle(),
        })
    }

    /// Largest radius of the enclosure of a force, relative to it.
    fn relative_radius(&self) -> f64 {
        let radius = self.nodes.iter().map(|node| node.radius_n() / node.near.force_n.norm());
        radius.fold(0.0, f64::max)
    }

    /// Whether `states`, known to be near a solution, are near this one: well inside the box in which
    /// it is the only one.
    #[must_use]
    pub fn holds(&self, states: &[CableState<f64>; CABLES]) -> bool {
        (0..CABLES).all(|k| {
            (states[k].force_n - self.nodes[k].near.force_n).norm() < 0.1 * self.radii_n[k]
        })
    }
}

/// A box of rest lengths and forces.
#[derive(Clone, Debug)]
pub struct Place {
    /// Rest lengths and forces of each cable.
    pub states: [CableState<Interval>; CABLES],
}

impl Place {
    fn of<E>(pieces: &[&Piece<E>; CABLES]) -> Self {
        Self { states: pieces.map(|piece| either(&piece.shorter.state, &piece.longer.state)) }
    }

    fn touches(&self, other: &Self) -> bool {
        self.states
            .iter()
            .zip(&other.states)
            .all(|(a, b)| a.rest_length_m.intersection(b.rest_length_m).is_some())
    }

    fn hull(&self, other: &Self) -> Self {
        Self { states: std::array::from_fn(|k| either(&self.states[k], &other.states[k])) }
    }
}

/// The smallest box that holds two.
fn either(a: &CableState<Interval>, b: &CableState<Interval>) -> CableState<Interval> {
    CableState {
        force_n: a.force_n.zip_map(&b.force_n, Interval::hull),
        rest_length_m: a.rest_length_m.hull(b.rest_length_m),
    }
}

/// A proven solution that does not count.
#[derive(Clone, Debug)]
pub struct Outside {
    /// The solution.
    pub proof: Proof,
    /// The cable, counted from 0, that is beyond its limit.
    pub cable: usize,
    /// What is too large.
    pub quantity: Quantity,
}

/// All solutions within the limits.
#[derive(Clone, Debug)]
pub struct Complete {
    /// The solutions.
    pub solutions: Vec<Proof>,
    /// Solutions met just beyond a limit; there may be more.
    pub outside: Vec<Outside>,
    /// Where it could not be decided whether there is a solution.
    pub undecided: Vec<Place>,
    /// Boxes examined.
    pub boxes: usize,
    /// Pieces of curve enclosed.
    pub pieces: usize,
}

/// Why a pose cannot be searched. Cables are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Without a limit of the tension there is no end to the search.
    #[error("cable {}: no tension limit, so the search has no end", .0 + 1)]
    NoTensionLimit(usize),
    /// The cable hangs exactly vertically, where its plane is not defined.
    #[error("cable {}: exactly vertical", .0 + 1)]
    Vertical(usize),
    /// The ends of the force curve could not be proven: numbers out of range.
    #[error("cable {}: the end of its force curve could not be enclosed", .0 + 1)]
    NoEnd(usize),
}

/// Finds all solutions of `problem` within its limits and proves each, and that there are no others.
///
/// # Errors
/// [`Refusal`] when the search cannot begin.
pub fn complete<M: Provable>(problem: &Problem<M>) -> Result<Complete, Refusal> {
    let mut curves = Vec::with_capacity(CABLES);
    for cable in 0..CABLES {
        let plane = &problem.balance.planes()[cable];
        if plane.x_m <= 0.0 {
            return Err(Refusal::Vertical(cable));
        }
        let tension_n = problem.limits[cable].max_tension_n;
        if !tension_n.is_finite() {
            return Err(Refusal::NoTensionLimit(cable));
        }
        let curve = curve(problem, cable);
        let length_m = problem.limits[cable].max_length_m;
        match whole(&curve, tension_n, length_m) {
            Whole::Found(piece) => curves.push((curve, *piece)),
            Whole::Nothing => {
                return Ok(Complete {
                    solutions: Vec::new(),
                    outside: Vec::new(),
                    undecided: Vec::new(),
                    boxes: 0,
                    pieces: 0,
                });
            }
            Whole::Unproven => return Err(Refusal::NoEnd(cable)),
        }
    }
    let found = Search::new(problem, curves).run();
    let mut answer = Complete {
        solutions: Vec::new(),
        outside: Vec::new(),
        undecided: found.undecided,
        boxes: found.boxes,
        pieces: found.pieces,
    };
    for proof in found.proofs {
        match within(problem, &proof) {
            Within::Inside => answer.solutions.push(proof),
            Within::Outside(cable, quantity) => {
                answer.outside.push(Outside { proof, cable, quantity });
            }
            Within::Undecided => answer.undecided.push(Place { states: proof.enclosure() }),
        }
    }
    Ok(answer)
}

/// The Kantorovich numbers of a proven solution, with the largest ball (but for a factor of two) in
/// which it can be shown to be the only one. Costs about as much as the search.
#[must_use]
pub fn kantorovich<M: Provable>(problem: &Problem<M>, proof: &Proof) -> Option<Kantorovich> {
    let curves: [Curve<'_, M>; CABLES] = std::array::from_fn(|k| curve(problem, k));
    let numbers = |radius_n: f64| ball(problem, &curves, proof, radius_n);
    let mut radius_n = proof.radii_n.iter().copied().fold(f64::INFINITY, f64::min);
    let mut best = None;
    for _ in 0..BALL_DOUBLINGS {
        match numbers(radius_n) {
            Some(found) => best = Some(found),
            None if best.is_some() => break,
            None => {}
        }
        radius_n *= 2.0;
    }
    best
}

/// The numbers over the ball of a given radius; `None` unless the solution is the only one in it.
fn ball<M: Provable>(
    problem: &Problem<M>,
    curves: &[Curve<'_, M>; CABLES],
    proof: &Proof,
    radius_n: f64,
) -> Option<Kantorovich> {
    let mut pieces = Vec::with_capacity(CABLES);
    for (curve, node) in curves.iter().zip(&proof.nodes) {
        let beside = |step_n: f64| curve.beside(&node.near, node.tangent, step_n);
        pieces.push(curve.piece(beside(-radius_n)?, beside(radius_n)?)?);
    }
    let pieces: [&Piece<M::End>; CABLES] = std::array::from_fn(|k| &pieces[k]);
    let verdict = examine(&pieces, problem.balance.wrench_n())?;
    if !verdict.is_unique() {
        return None;
    }
    // What the enclosure leaves open, along the curve: the ball need not be centred better.
    let eta_n = proof.nodes.iter().map(Node::radius_n).fold(0.0, f64::max);
    let beta = verdict.inverse_norm * radius_n;
    let omega_per_n = verdict.contraction / (beta * radius_n);
    Some(Kantorovich {
        beta,
        eta_n,
        omega_per_n,
        h: beta * eta_n * omega_per_n,
        existence_radius_n: eta_n,
        uniqueness_radius_n: radius_n,
    })
}

/// The force curve of one cable.
fn curve<M: Provable>(problem: &Problem<M>, cable: usize) -> Curve<'_, M> {
    let plane = &problem.balance.planes()[cable];
    let anchor_m = problem.robot.cables()[cable].anchor_m.amax();
    let arm_m = problem.robot.moment_arm_m();
    let coordinates_m = 2.0 * anchor_m + 4.0 * plane.distance_m() + 20.0 * arm_m;
    Curve::new(problem.model(cable), plane, PLANE_ROUNDING * coordinates_m)
}

/// The force curve between the limits.
enum Whole<E> {
    Found(Box<Piece<E>>),
    /// No point of the curve is within the limits.
    Nothing,
    Unproven,
}

fn whole<M: Provable>(curve: &Curve<'_, M>, tension_n: f64, length_m: f64) -> Whole<M::End> {
    let Some(taut) = taut_end(curve, tension_n) else { return Whole::Unproven };
    if taut.state.rest_length_m.low() > length_m * (1.0 + BEYOND) {
        return Whole::Nothing; // even at this tension it is too long
    }
    let Some(slack) = slack_end(curve, tension_n, length_m) else { return Whole::Unproven };
    if slack.state.rest_length_m.high() <= taut.state.rest_length_m.low() {
        return Whole::Nothing;
    }
    curve.piece(taut, slack).map_or(Whole::Unproven, |piece| Whole::Found(Box::new(piece)))
}

/// A point of the curve so taut that all shorter cables are beyond the limit as well: with falling
/// length the horizontal force and the pull at the lower end only grow.
fn taut_end<M: Provable>(curve: &Curve<'_, M>, tension_n: f64) -> Option<Node<M::End>> {
    let axis = curve.chord();
    let distance_m = curve.plane.distance_m();
    let weight_n = curve.model.weight_n_m() * distance_m;
    let limit = Interval::point(tension_n);
    let mut target_n = tension_n * (1.0 + BEYOND) + weight_n;
    for _ in 0..END_ATTEMPTS {
        let guess = CableState { force_n: axis * target_n, rest_length_m: distance_m };
        let node = curve.approach(guess, axis, target_n).and_then(|state| curve.node(state));
        if let Some(node) = node {
            let force = node.state.force_n;
            let weight = curve.enclosing.weight_n_m() * node.state.rest_length_m;
            let pull = if curve.plane.z_m <= 0.0 { -force.y } else { force.y - weight };
            let pull = pull.low().max(0.0);
            let lowest = Interval::point(force.x.low()).square() + Interval::point(pull).square();
            if lowest.low() > limit.square().high() {
                return Some(node);
            }
        }
        target_n *= END_GROWTH;
    }
    None
}

/// A point of the curve so slack that all longer cables are beyond a limit: the longest cable, or one
/// that hangs so far down that its own weight breaks it.
fn slack_end<M: Provable>(
    curve: &Curve<'_, M>,
    tension_n: f64,
    length_m: f64,
) -> Option<Node<M::End>> {
    let distance_m = curve.plane.distance_m();
    let weight_n_m = curve.model.weight_n_m();
    if weight_n_m <= 0.0 {
        // A massless cable has no force at its full length, and none beyond.
        let near = CableState { force_n: Vector2::zeros(), rest_length_m: distance_m };
        let state = CableState {
            force_n: Vector2::new(Interval::zero(), Interval::zero()),
            rest_length_m: Interval::around(distance_m, 4.0 * curve.plane_error_m),
        };
        let end = M::end(&curve.enclosing, &state);
        return Some(Node { near, tangent: -curve.chord(), state, end });
    }
    let mut longest_m = 2.0 * tension_n * (1.0 + BEYOND) / weight_n_m + distance_m;
    for _ in 0..END_ATTEMPTS {
        let limited = length_m * (1.0 + BEYOND) <= longest_m;
        let rest_length_m = if limited { length_m * (1.0 + BEYOND) } else { longest_m };
        let node = curve.at_length(rest_length_m).and_then(|state| {
            // From the length alone the force of a taut cable is not well known: from the force then.
            let axis = curve.chord();
            let polished = curve.approach(state, axis, state.force_n.dot(&axis)).unwrap_or(state);
            curve.node(polished)
        });
        if let Some(node) = node {
            let force = node.state.force_n;
            let weight = curve.enclosing.weight_n_m() * node.state.rest_length_m;
            let pull = if curve.plane.z_m <= 0.0 { force.y } else { weight - force.y };
            let long = node.state.rest_length_m.low() > length_m;
            if long || pull.low() > tension_n {
                return Some(node);
            }
        }
        if limited {
            return None;
        }
        longest_m *= END_GROWTH;
    }
    None
}

/// Whether a solution is within the limits.
enum Within {
    Inside,
    Outside(usize, Quantity),
    Undecided,
}

fn within<M: Provable>(problem: &Problem<M>, proof: &Proof) -> Within {
    let mut answer = Within::Inside;
    for (cable, node) in proof.nodes.iter().enumerate() {
        let limits = &problem.limits[cable];
        let weight = problem.model(cable).enclosing().weight_n_m() * node.state.rest_length_m;
        let force = node.state.force_n;
        let tension = |z: Interval| Interval::hypot_with_excess(force.x, z).0;
        let (at_b, at_a) = (tension(force.y), tension(force.y - weight));
        let length = node.state.rest_length_m;
        if length.low() > limits.max_length_m {
            return Within::Outside(cable, Quantity::Length);
        }
        if at_b.low().max(at_a.low()) > limits.max_tension_n {
            return Within::Outside(cable, Quantity::Tension);
        }
        let inside = length.high() <= limits.max_length_m
            && at_b.high().max(at_a.high()) <= limits.max_tension_n;
        if !inside {
            answer = Within::Undecided;
        }
    }
    answer
}
