//! The proof of a step: between its ends there is one solution, for every value of what is held.
//!
//! The six equations are those of [`complete`](crate::complete), with one parameter more. A [`Strand`]
//! is a stretch of one cable's force curve for all `sigma` of a range at once,
//!
//! ```text
//! F = center + u chord + v normal,      v = drift y + w(u, y),      u in [-1, 1]
//! ```
//!
//! with `sigma = middle + rho y`, `y` in `[-1, 1]`, and proven bounds on `|w|`, `|dw/du|` and
//! `|dw/dy|`. What is held (`sigma`, or `u` of one cable around a fold) ranges over its interval as a
//! parameter; the other six numbers are the unknowns. With `M` the columns of the unknowns (`G_i chord_i`,
//! and `sum_i drift_i G_i normal_i + rho wrench'` for `y`) and any matrix `C` near its inverse the
//! equations read
//!
//! ```text
//! unknowns = -C (wrench + sum_i G_i center_i + G_h chord_h u_h) - sum_i w_i C G_i normal_i - (C M - 1) unknowns
//! ```
//!
//! If the right side maps the box into itself, and all row sums of its derivative are below one, then
//! by Banach each value of the parameter has exactly one solution in the box, and they form one arc.
//!
//! Consecutive arcs are one path when they share a solution. Newton's point at the joint is only near
//! it; how near follows from what is left of the equations there, over one less the contraction. The
//! solution that one step proves within that distance must be inside the box of the next.
//!
//! The proof is of the problem with the computed planes of the cables, taken for exact.

use cdpr_core::elimination::Elimination;
use cdpr_core::{CABLES, CableModel, CablePlane, CableState, CurvePoint, Scalar};
use nalgebra::{Matrix2x3, Matrix6, Vector2, Vector6};
use num_traits::Zero;

use super::homotopy::Enclosed;
use super::system::{Point, SIGMA, System};
use crate::complete::curve::{Curve, Node};
use crate::complete::{Provable, Stretch};
use crate::dual::Dual;
use crate::interval::Interval;
use crate::problem::LEAST_FORCE;

/// Half length of a strand at least, in units of the way that the force moves along it.
const ROOM: f64 = 1.1;
/// The same for the held force, which is a parameter and stays between its ends.
const ROOM_HELD: f64 = 1.01;
/// Half length of a strand at least, as a part of the force.
const LEAST_RADIUS: f64 = 1e-7;
/// Part of a strand that is meant to be used.
const USED: f64 = 0.5;
/// Half lengths of the first strands, relative to the force and to the length of the step.
const FIRST_REACH: f64 = 1.0;
/// How much larger or smaller than the last the half length of a strand may be.
const REACH_CHANGE: f64 = 16.0;
/// How far the range of `sigma` extends beyond the ends of a step, as a part of it.
const MARGIN: f64 = 1e-3;
/// And at least.
const LEAST_MARGIN: f64 = 1e-12;
/// Half the range of `sigma` around a fold, in units of what the rates at the ends let expect: at
/// first, and at least.
const SIGMA_ROOM: f64 = 2.0;
const LEAST_SIGMA_ROOM: f64 = 1.1;
/// Weight of a cable over the tensions at its ends beyond which its length is taken to grow as its
/// weight per length falls.
const SLACK: f64 = 0.7;
/// Bounds on the slope of a strand that are further apart than twice this are sought on parts of the
/// range of `sigma`, cut this many times at most: only the cable that needs it is, not the step.
const WIDE: f64 = 0.03;
const CUTS: u32 = 2;
/// Bounds on the drift over the range of `sigma` that are wider than this, in half lengths of the
/// strand, are sought on this many pieces of it.
const WIDE_DRIFT: f64 = 0.01;
const PIECES: u32 = 4;
/// Units of rounding per sum, as in `complete::statics`: 7 terms of 6 products, and room.
const ROUNDING: f64 = 48.0 * f64::EPSILON;
/// For the rounding of sums of non-negative bounds.
const UPWARDS: f64 = 1.0 + 1e-12;

/// A point of a path between two steps.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    sigma: f64,
    /// Encloses a point of each curve next to the state there.
    states: [CableState<Interval>; CABLES],
    /// Encloses the sum of all wrenches there, N.
    imbalance_n: Vector6<Interval>,
    /// The solution proven by the step that arrived here: no force is further from these, N, and
    /// `sigma` from that of `point`.
    error_n: [f64; CABLES],
    error_sigma: f64,
}

/// How long strands are made: half of each, relative to its force and to the length of the step.
///
/// A strand must hold what the solution moves, and what the bounds leave open; a longer one bends
/// more. What the last step used is a good measure for the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    forces: [f64; CABLES],
    /// Half the range of `sigma` around a fold, relative to what its rates at the ends let expect.
    sigma: f64,
}

impl Default for Reach {
    fn default() -> Self {
        Self { forces: [FIRST_REACH; CABLES], sigma: SIGMA_ROOM }
    }
}

impl Reach {
    /// Adapts to what was used of each strand.
    fn learn(&mut self, used: &[f64; CABLES], held: usize) {
        for (k, used) in used.iter().enumerate() {
            let reach = if k == held { &mut self.sigma } else { &mut self.forces[k] };
            *reach *= (used / USED).clamp(1.0 / REACH_CHANGE, REACH_CHANGE);
        }
        self.sigma = self.sigma.max(LEAST_SIGMA_ROOM);
    }
}

/// What the proof of a step shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Certificate {
    /// Largest row sum of the derivative, below one.
    pub(super) contraction: f64,
}

/// Why there is no proof.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Refusal {
    /// The strands were too short: longer ones, as [`Reach`] now has them, may do.
    Short,
    /// The step is too long.
    Long,
}

/// The step to prove.
pub(crate) struct Span<'a> {
    pub(super) before: &'a Point,
    pub(super) after: &'a Point,
    /// The coordinate that is held.
    pub(super) held: usize,
    /// Its length along the tangent.
    pub(super) length: f64,
    /// Around a fold, how far `sigma` may go beyond its values at the ends.
    pub(super) bow: f64,
}

/// A stretch of a force curve for a range of `sigma`.
struct Strand {
    /// Frame in which `u` is measured: `u = (F - origin).axis / (radius |axis|^2)`.
    origin_n: Vector2<f64>,
    axis: Vector2<f64>,
    radius_n: f64,
    /// Largest `|u|`, one but for rounding.
    reach: f64,
    /// Bounds on `|w|`, `|dw/du|` and `|dw/dy|`.
    thickness: f64,
    slope: f64,
    drift_slope: f64,
    drift: f64,
    center_wrench: Vector6<f64>,
    chord_wrench: Vector6<f64>,
    normal_wrench: Vector6<f64>,
    /// Bound on the rounding of a component of the wrench of any force of the strand, N.
    error_n: f64,
}

/// The range of `sigma` of a step.
#[derive(Clone, Copy)]
struct Range {
    middle: f64,
    /// `rho`.
    radius: f64,
    all: Interval,
    /// Whether `sigma` is an unknown.
    is_unknown: bool,
}

impl Joint {
    /// `point` with what is left of the equations next to it.
    pub(super) fn new<H: Enclosed>(system: &System<'_, H>, point: &Point) -> Option<Self> {
        let homotopy = system.homotopy;
        let sigma = Interval::point(point.sigma);
        let mut imbalance_n = Vector6::from(homotopy.wrench_over_n(sigma).map(|w| w.value));
        let mut states = Vec::with_capacity(CABLES);
        for (i, plane) in homotopy.planes().iter().enumerate() {
            let state = point.states[i];
            let enclosure = if system.is_vertical_line(i) {
                let pull_n = Interval::point(state.force_n.y);
                CableState {
                    force_n: Vector2::new(Interval::zero(), pull_n),
                    rest_length_m: Interval::point(state.rest_length_m),
                }
            } else {
                let model = homotopy.model(i, point.sigma);
                let scale = Interval::point(1.0);
                let enclosing = homotopy.enclosing(i, sigma);
                Curve::of_family(&model, enclosing, plane, scale).node(state)?.state
            };
            imbalance_n += enclosed(plane).wrench_n(&enclosure.force_n);
            states.push(enclosure);
        }
        let states = states.try_into().ok()?;
        let (error_n, error_sigma) = ([0.0; CABLES], 0.0);
        Some(Self { sigma: point.sigma, states, imbalance_n, error_n, error_sigma })
    }
}

/// Proves a step between two joints, and writes into `to` how near the solution is that the path
/// continues with.
pub(super) fn certify<H: Enclosed>(
    system: &System<'_, H>,
    span: &Span<'_>,
    from: &Joint,
    to: &mut Joint,
    reach: &mut Reach,
) -> Result<Certificate, Refusal> {
    let held = span.held;
    let range = Range::new(from, to, span, reach);
    let strands = strands(system, (from, to), span, &range, reach).ok_or(Refusal::Long)?;
    let verdict = examine(system, &strands, held, &range).ok_or(Refusal::Long)?;
    let used: [f64; CABLES] = std::array::from_fn(|k| {
        let reach = if k == held { 1.0 } else { strands[k].reach };
        (verdict.center[k].abs() + verdict.radius[k]) / (2.0 - reach)
    });
    if verdict.contraction < USED {
        reach.learn(&used, held);
    }
    let load = used.iter().copied().fold(verdict.contraction, f64::max);
    // Written so that NaN fails.
    let holds = load < 1.0;
    if !holds {
        return Err(if verdict.contraction < USED { Refusal::Short } else { Refusal::Long });
    }
    if !link(&strands, &verdict, held, &range, from, to) {
        return Err(Refusal::Long);
    }
    Ok(Certificate { contraction: verdict.contraction })
}

/// Whether the solutions at both joints are in the box.
fn link(
    strands: &[Strand; CABLES],
    verdict: &Verdict,
    held: usize,
    range: &Range,
    from: &Joint,
    to: &mut Joint,
) -> bool {
    let left = 1.0 - verdict.contraction;
    let mut errors = [0.0; 2];
    for (error, joint) in errors.iter_mut().zip([from, &*to]) {
        *error = verdict.distance(&joint.imbalance_n) / left * UPWARDS;
        let near = |k: usize| {
            let strand = &strands[k];
            let distance = strand.coordinate(&joint.states[k].force_n).magnitude();
            let solution = if k == held { 0.0 } else { *error };
            distance + solution + joint.error_n[k] / strand.radius_n < 2.0 - strand.reach
        };
        let inside = (joint.sigma - range.middle).abs() + joint.error_sigma;
        let moved = if held == SIGMA { 0.0 } else { *error * range.radius };
        if !(inside + moved < range.radius && (0..CABLES).all(near)) {
            return false;
        }
    }
    // Along the chord and, as steep as that may be, across it.
    to.error_n = std::array::from_fn(|k| {
        let strand = &strands[k];
        let steep = 1.0 + strand.slope + strand.drift.abs() + strand.drift_slope;
        2.0 * errors[1] * strand.radius_n * steep
    });
    to.error_sigma = if held == SIGMA { 0.0 } else { 2.0 * errors[1] * range.radius };
    true
}

impl Range {
    fn new(from: &Joint, to: &Joint, span: &Span<'_>, reach: &Reach) -> Self {
        let (a, b) = (from.sigma, to.sigma);
        let middle = 0.5 * (a + b);
        let half = 0.5 * (b - a).abs();
        let error = 2.0 * from.error_sigma + LEAST_MARGIN;
        let is_unknown = span.held != SIGMA;
        let radius = if is_unknown {
            reach.sigma * (half + span.bow) + error
        } else {
            half * (1.0 + MARGIN) + error
        };
        Self { middle, radius, all: Interval::around(middle, radius), is_unknown }
    }
}

impl Strand {
    /// Coordinate `u` of a force.
    fn coordinate(&self, force_n: &Vector2<Interval>) -> Interval {
        along(force_n, &self.origin_n, &self.axis)
            / (Interval::point(self.radius_n) * dot(&self.axis.map(Interval::point), &self.axis))
    }
}

fn dot(a: &Vector2<Interval>, b: &Vector2<f64>) -> Interval {
    a.x * Interval::point(b.x) + a.y * Interval::point(b.y)
}

fn along(force_n: &Vector2<Interval>, origin_n: &Vector2<f64>, axis: &Vector2<f64>) -> Interval {
    dot(&(force_n - origin_n.map(Interval::point)), axis)
}

/// The plane of a cable, taken for exact.
fn enclosed(plane: &CablePlane<f64>) -> CablePlane<Interval> {
    CablePlane {
        x_m: Interval::point(plane.x_m),
        z_m: Interval::point(plane.z_m),
        direction: plane.direction.map(Interval::point),
        lever_arm: plane.lever_arm.map(Interval::point),
    }
}

/// Where a strand is laid: a point near the curve, its direction there, and how far it should reach.
struct Frame {
    state: CableState<f64>,
    axis: Vector2<f64>,
    length_per_force_m_n: f64,
    /// Half the way of the force along the axis.
    way_n: f64,
    /// Whether its length is taken to grow as its weight per length falls.
    is_slack: bool,
    /// Size of its force, N.
    scale_n: f64,
}

fn strands<H: Enclosed>(
    system: &System<'_, H>,
    joints: (&Joint, &Joint),
    span: &Span<'_>,
    range: &Range,
    reach: &Reach,
) -> Option<[Strand; CABLES]> {
    let homotopy = system.homotopy;
    let load_n = homotopy.wrench_n(range.middle).amax();
    let mut frames = Vec::with_capacity(CABLES);
    for (i, plane) in homotopy.planes().iter().enumerate() {
        let (a, b) = (&span.before.states[i], &span.after.states[i]);
        let middle = CableState {
            force_n: (a.force_n + b.force_n) * 0.5,
            rest_length_m: (a.rest_length_m * b.rest_length_m).sqrt(),
        };
        let mut frame = Frame {
            state: middle,
            axis: Vector2::y(),
            length_per_force_m_n: 0.0,
            way_n: 0.0,
            is_slack: false,
            scale_n: middle.force_n.norm() + LEAST_FORCE * load_n,
        };
        if system.is_vertical_line(i) {
            frame.state.force_n.x = 0.0;
        } else {
            let model = homotopy.model(i, range.middle);
            let end = model.end_point(middle.force_n, middle.rest_length_m);
            let linear = CurvePoint::new(&end, plane.x_m, plane.z_m);
            if !linear.is_finite() {
                return None;
            }
            frame.state.force_n += linear.correction_n();
            frame.state.rest_length_m += linear.length_correction_m();
            frame.axis = linear.tangent;
            frame.length_per_force_m_n = linear.length_per_force_m_n;
            let weight_n_m = model.weight_n_m();
            let tensions_n =
                frame.state.tension_at_attachment_n() + frame.state.tension_at_anchor_n(weight_n_m);
            frame.is_slack = weight_n_m * frame.state.rest_length_m > SLACK * tensions_n;
        }
        frame.way_n = 0.5 * (b.force_n - a.force_n).dot(&frame.axis).abs();
        frames.push(frame);
    }
    let mut strands = Vec::with_capacity(CABLES);
    for (i, frame) in frames.iter().enumerate() {
        let error_n = 2.0 * joints.0.error_n[i];
        let radius_n = if i == span.held {
            ROOM_HELD * frame.way_n + error_n
        } else {
            let least_n = (reach.forces[i] * span.length).max(LEAST_RADIUS) * frame.scale_n;
            least_n.max(ROOM * frame.way_n) + error_n
        };
        let strand = if system.is_vertical_line(i) {
            vertical_strand(&homotopy.planes()[i], frame, radius_n)
        } else {
            strand(homotopy, i, frame, radius_n, range, joints)?
        };
        strands.push(strand);
    }
    strands.try_into().ok()
}

/// A cable that hangs exactly vertically: its force is vertical whatever `sigma` is.
fn vertical_strand(plane: &CablePlane<f64>, frame: &Frame, radius_n: f64) -> Strand {
    let (origin_n, axis) = (frame.state.force_n, frame.axis);
    let slack = 8.0 * f64::EPSILON * (origin_n.amax() + radius_n) / radius_n;
    Strand {
        origin_n,
        axis,
        radius_n,
        reach: 1.0 + slack,
        thickness: 0.0,
        slope: 0.0,
        drift_slope: 0.0,
        drift: 0.0,
        center_wrench: plane.wrench_n(&origin_n),
        chord_wrench: plane.wrench_n(&(axis * radius_n)),
        normal_wrench: Vector6::zeros(),
        error_n: 64.0 * f64::EPSILON * (origin_n.amax() + radius_n),
    }
}

/// What is known of the curves of a range of `sigma` between two lines across the axis of a frame.
struct Bounds {
    /// Holds their forces and rest lengths.
    hull: CableState<Interval>,
    /// Where they cross the lines, and their slope, in half lengths of the strand.
    begin: Interval,
    end: Interval,
    slopes: Interval,
    /// Their drift with `sigma`, N, where that is an unknown.
    drift_n: Interval,
}

impl Bounds {
    fn hull(self, other: &Self) -> Self {
        let (a, b) = (self.hull, other.hull);
        Self {
            hull: CableState {
                force_n: a.force_n.zip_map(&b.force_n, Interval::hull),
                rest_length_m: a.rest_length_m.hull(b.rest_length_m),
            },
            begin: self.begin.hull(other.begin),
            end: self.end.hull(other.end),
            slopes: self.slopes.hull(other.slopes),
            drift_n: self.drift_n.hull(other.drift_n),
        }
    }
}

/// Where the strand of one cable is laid.
struct Lines<'a, H: Enclosed> {
    homotopy: &'a H,
    cable: usize,
    plane: &'a CablePlane<f64>,
    frame: &'a Frame,
    radius_n: f64,
    normal: Vector2<f64>,
    /// Whether `sigma` is an unknown.
    is_drift_wanted: bool,
}

impl<H: Enclosed> Lines<'_, H> {
    /// Bounds for all `sigma` of a range; if they are wide, from cuts of the range and of the strand.
    fn bounds(&self, low: f64, high: f64, cuts: u32) -> Option<Bounds> {
        let whole = self.bounds_of(low, high, 1);
        let is_good = |bounds: &Bounds| {
            bounds.slopes.radius() < WIDE
                && bounds.drift_n.radius() * 0.5 * (high - low) < WIDE_DRIFT * self.radius_n
        };
        if cuts == 0 || whole.as_ref().is_some_and(is_good) {
            return whole;
        }
        if self.is_drift_wanted {
            return self.bounds_of(low, high, PIECES);
        }
        let middle = 0.5 * (low + high);
        let lower = self.bounds(low, middle, cuts - 1)?;
        Some(lower.hull(&self.bounds(middle, high, cuts - 1)?))
    }

    /// Whether the point of the curve at a joint is between the ends of the strand there.
    fn hold(&self, cable: usize, joint: &Joint) -> Option<bool> {
        let model = self.homotopy.model(cable, joint.sigma);
        let enclosing = self.homotopy.enclosing(cable, Interval::point(joint.sigma));
        let curve = Curve::of_family(&model, enclosing, self.plane, Interval::point(1.0));
        let length = joint.states[cable].rest_length_m;
        let (shorter, longer) = (self.node(&curve, -1.0)?, self.node(&curve, 1.0)?);
        let (shorter, longer) = (shorter.state.rest_length_m, longer.state.rest_length_m);
        Some(shorter.high() < length.low() && length.high() < longer.low())
    }

    /// The points of the curves on the line across the axis at `u`.
    fn node(
        &self,
        curve: &Curve<'_, H::Model>,
        u: f64,
    ) -> Option<Node<<H::Model as Provable>::End>> {
        let Self { frame, radius_n, normal, .. } = *self;
        let Frame { state, axis, .. } = frame;
        let target_n = state.force_n + axis * (u * radius_n);
        let stretch = u * radius_n * frame.length_per_force_m_n / state.rest_length_m;
        let guess =
            CableState { force_n: target_n, rest_length_m: state.rest_length_m * stretch.exp() };
        let mut near = curve.approach(guess, *axis, target_n.dot(axis))?;
        near.force_n = target_n + normal * (near.force_n - target_n).dot(&normal);
        curve.node_along(near, *axis, Interval::zero())
    }

    /// The same from this many pieces of the strand.
    fn bounds_of(&self, low: f64, high: f64, pieces: u32) -> Option<Bounds> {
        let Self { homotopy, cable, frame, radius_n, normal, .. } = *self;
        let Frame { state, axis, .. } = frame;
        let model = homotopy.model(cable, 0.5 * (low + high));
        let sigma = Interval::new(low, high);
        let curve = self.family(&model, sigma);
        // For each sigma the strand runs between the points of its curve on lines across the axis.
        // Whichever of two is the longer cable, what lies between them is in the box of both; and if
        // forwards along the axis is towards longer cables all over the box, it is the one ahead.
        let node = |u: f64| self.node(&curve, u);
        let size_n = Interval::point(radius_n) * dot(&normal.map(Interval::point), &normal);
        let across = |node: &Node<_>| along(&node.state.force_n, &state.force_n, &normal) / size_n;
        let width = 2.0 / f64::from(pieces);
        let mut bounds: Option<Bounds> = None;
        let mut shorter = node(-1.0)?;
        for piece in 1..=pieces {
            let longer = node(width * f64::from(piece) - 1.0)?;
            let (a, b) = (&shorter.state, &longer.state);
            let hull = curve.hull(a, b);
            let ends = [&shorter.end, &longer.end];
            let stretch = Stretch { span_m: curve.target, shorter: a, longer: b, hull, ends };
            let direction = <H::Model as Provable>::course(&curve.enclosing, &stretch).direction;
            let forwards = dot(&direction, axis);
            if forwards.low() <= 0.0 || !forwards.is_bounded() {
                return None;
            }
            let slopes = dot(&direction, &normal) / forwards;
            let (begin, end) = (across(&shorter), across(&longer));
            let drift_n = if self.is_drift_wanted {
                let middle = width * (f64::from(piece) - 0.5) - 1.0;
                let slack = 16.0 * f64::EPSILON * (1.0 + state.force_n.amax() / radius_n);
                self.drift_n(&curve, sigma, &hull, slopes, width * 0.5 + slack, &node(middle)?)?
            } else {
                Interval::zero()
            };
            let part = Bounds { hull, begin, end, slopes, drift_n };
            bounds = Some(match bounds {
                None => part,
                Some(before) => Bounds { begin: before.begin, end, ..before.hull(&part) },
            });
            shorter = longer;
        }
        bounds
    }

    /// The curves for all numbers of `sigma`; `model` is one of them.
    fn family<'a>(&'a self, model: &'a H::Model, sigma: Interval) -> Curve<'a, H::Model> {
        let enclosing = self.homotopy.enclosing(self.cable, sigma);
        if self.frame.is_slack {
            // Similar cables: of the weight of `model`, to an attachment further away.
            let weight_n_m = Interval::point(model.weight_n_m());
            if let Some(similar) = enclosing.with_weight(weight_n_m) {
                let scale = enclosing.weight_n_m() / weight_n_m;
                return Curve::of_family(model, similar, self.plane, scale);
            }
        }
        Curve::of_family(model, enclosing, self.plane, Interval::point(1.0))
    }
}

/// The strand of cable `i` that reaches `radius_n` to either side along the axis of its frame.
fn strand<H: Enclosed>(
    homotopy: &H,
    cable: usize,
    frame: &Frame,
    radius_n: f64,
    range: &Range,
    joints: (&Joint, &Joint),
) -> Option<Strand> {
    let plane = &homotopy.planes()[cable];
    let Frame { state, axis, .. } = frame;
    let (origin_n, normal) = (state.force_n, Vector2::new(-axis.y, axis.x));
    let is_drift_wanted = range.is_unknown;
    let lines = Lines { homotopy, cable, plane, frame, radius_n, normal, is_drift_wanted };
    // A point of the curve between the lines might still be beyond an end of the strand, if the curve
    // came back. That of a cable that goes down does not: its horizontal force falls and the vertical
    // one rises all the way. For others the lengths tell.
    let goes_on = plane.z_m <= 0.0 && axis.x <= 0.0 && axis.y >= 0.0;
    if !(goes_on || (lines.hold(cable, joints.0)? && lines.hold(cable, joints.1)?)) {
        return None;
    }
    let bounds = lines.bounds(range.all.low(), range.all.high(), CUTS)?;
    let tilt = bounds.slopes.middle();
    let slopes = bounds.slopes - Interval::point(tilt);
    let (rise, fall) = (slopes.high().max(0.0), -slopes.low().min(0.0));
    let slope = rise.max(fall);
    let slack = 8.0 * f64::EPSILON * (origin_n.amax() + radius_n) / radius_n;
    let (mut drift, mut drift_slope) = (0.0, 0.0);
    let (mut begin, mut end) = (bounds.begin, bounds.end);
    if range.is_unknown {
        let rate = bounds.drift_n;
        let per_radius = range.radius / radius_n;
        (drift, drift_slope) = (rate.middle() * per_radius, rate.radius() * per_radius * UPWARDS);
        drift_slope += 4.0 * f64::EPSILON * drift.abs();
        // The ends count as they are at the middle of the range.
        let lines = Lines { is_drift_wanted: false, ..lines };
        let thin = lines.bounds_of(range.middle, range.middle, 1)?;
        (begin, end) = (thin.begin, thin.end);
    }
    let (begin, end) = (begin + Interval::point(tilt), end - Interval::point(tilt));
    let high = crest(begin.high(), end.high(), rise, fall);
    let low = -crest(-begin.low(), -end.low(), fall, rise);
    let offset = 0.5 * (high + low);
    let size = origin_n.amax() / radius_n;
    let thickness = 0.5 * (high - low) * UPWARDS
        + drift_slope
        + 8.0 * f64::EPSILON * (1.0 + begin.magnitude() + end.magnitude() + size)
        + 3.0 * slack * (1.0 + slope + tilt.abs());
    if !(thickness + slope + drift).is_finite() {
        return None;
    }
    let normal_n = normal * radius_n;
    let force_n = bounds.hull.force_n.map(Interval::magnitude).sum();
    Some(Strand {
        origin_n,
        axis: *axis,
        radius_n,
        reach: 1.0 + 2.0 * slack,
        thickness,
        slope,
        drift_slope,
        drift,
        center_wrench: plane.wrench_n(&(origin_n + normal_n * offset)),
        chord_wrench: plane.wrench_n(&(axis * radius_n + normal_n * tilt)),
        normal_wrench: plane.wrench_n(&normal_n),
        error_n: 64.0 * f64::EPSILON * force_n,
    })
}

impl<H: Enclosed> Lines<'_, H> {
    /// How the force moves along the normal with `sigma` while its other component stays, at every
    /// point of the strand and every `sigma` of the range, N: by implicit differentiation of the two
    /// equations of the end point, `-det[d(X, Z)/d sigma, b] / det[K normal, b]`.
    ///
    /// Similar cables give the part of the weight: `w d(X, Z)/dw = L b - (X, Z)`, of which `L b` does
    /// not count, and `(X, Z)` is where the attachment is. What that leaves depends on the point of the
    /// curve alone and is known best by its value in the middle and its rate along the strand.
    fn drift_n(
        &self,
        curve: &Curve<'_, H::Model>,
        sigma: Interval,
        hull: &CableState<Interval>,
        slopes: Interval,
        half: f64,
        middle: &Node<<H::Model as Provable>::End>,
    ) -> Option<Interval> {
        let Self { homotopy, cable, frame, radius_n, normal, .. } = *self;
        let normal = normal.map(Interval::point);
        let moving = homotopy.moving(cable, Dual::parameter(sigma));
        let weight = moving.weight_n_m();
        let still_n_m = Dual::fixed(curve.enclosing.weight_n_m());
        let (still, growth) = match moving.with_weight(still_n_m) {
            Some(still) if weight.value.low() > 0.0 => (still, weight.rate / weight.value),
            _ => (moving, Interval::zero()),
        };
        let end = still.end_point(hull.force_n.map(Dual::fixed), Dual::fixed(hull.rest_length_m));
        let (rate, j) = (end.position_m.map(|p| p.rate), end.jacobian.map(|c| c.value));
        let other = turning(&j, &rate, &normal);
        if growth.is_zero() {
            return other.is_bounded().then_some(-other);
        }
        let span = curve.target;

        // Along the curve K dF + b dL = 0.
        let axis = frame.axis.map(Interval::point);
        let force_rate = (axis + normal * slopes) * Interval::point(radius_n);
        let b = Vector2::new(j.m13, j.m23);
        let moved = Vector2::new(
            j.m11 * force_rate.x + j.m12 * force_rate.y,
            j.m21 * force_rate.x + j.m22 * force_rate.y,
        );
        let length_rate = -(moved.x * b.x + moved.y * b.y) / (b.x.square() + b.y.square());
        let dual = |value: Interval, rate: Interval| Dual { value, rate };
        let still = homotopy.moving(cable, Dual::fixed(sigma)).with_weight(still_n_m)?;
        let along = still.end_point(
            hull.force_n.zip_map(&force_rate, dual),
            dual(hull.rest_length_m, length_rate),
        );
        let along = turning(&along.jacobian, &span.map(Dual::fixed), &normal.map(Dual::fixed));
        let (force_n, length_m) = (middle.state.force_n, middle.state.rest_length_m);
        let j = curve.enclosing.end_point(force_n, length_m).jacobian;
        let here = turning(&j, &span, &normal) + along.rate * Interval::symmetric(half);
        let drift = growth * along.value.intersection(here)? - other;
        drift.is_bounded().then_some(drift)
    }
}

/// `det[shift, b] / det[K normal, b]`.
fn turning<T: Scalar>(j: &Matrix2x3<T>, shift: &Vector2<T>, normal: &Vector2<T>) -> T {
    let across =
        Vector2::new(j.m11 * normal.x + j.m12 * normal.y, j.m21 * normal.x + j.m22 * normal.y);
    (shift.x * j.m23 - shift.y * j.m13) / (across.x * j.m23 - across.y * j.m13)
}

/// The largest value on `[-1, 1]` of a function that is `begin` and `end` at the ends at most, rising
/// no faster than `rise` and falling no faster than `fall`.
fn crest(begin: f64, end: f64, rise: f64, fall: f64) -> f64 {
    let sum = rise + fall;
    let peak = if sum > 0.0 { ((end - begin + fall - rise) / sum).clamp(-1.0, 1.0) } else { 0.0 };
    let top = (begin + rise * (peak + 1.0)).max(end + fall * (1.0 - peak));
    top + 16.0 * f64::EPSILON * (begin.abs() + end.abs() + sum)
}

/// What the equations say about a box of strands.
struct Verdict {
    inverse: Matrix6<f64>,
    /// Holds all solutions: middle and radius of each unknown.
    center: Vector6<f64>,
    radius: Vector6<f64>,
    contraction: f64,
}

impl Verdict {
    /// How far the map moves a point at which `imbalance_n` is left of the equations.
    fn distance(&self, imbalance_n: &Vector6<Interval>) -> f64 {
        let left_n = imbalance_n.map(Interval::magnitude);
        (self.inverse.abs() * left_n).max() * UPWARDS
    }
}

fn examine<H: Enclosed>(
    system: &System<'_, H>,
    strands: &[Strand; CABLES],
    held: usize,
    range: &Range,
) -> Option<Verdict> {
    let homotopy = system.homotopy;
    let at = if range.is_unknown { Interval::point(range.middle) } else { range.all };
    let wrench = homotopy.wrench_over_n(at).map(|w| w.value);
    let mut imbalance = Vector6::from(wrench.map(Interval::middle));
    let mut error_n = wrench.iter().fold(0.0, |e: f64, w| e.max(w.radius()));
    let mut size_n = imbalance.amax();
    let mut columns: [Vector6<f64>; CABLES] = std::array::from_fn(|i| strands[i].chord_wrench);
    // The column of sigma, and what its rate leaves open.
    let mut shift = Vector6::zeros();
    let mut shift_open_n = 0.0;
    if range.is_unknown {
        let rates = homotopy.wrench_over_n(range.all).map(|w| w.rate);
        shift = Vector6::from(rates.map(Interval::middle)) * range.radius;
        shift_open_n =
            rates.iter().fold(0.0, |e: f64, r| e.max(r.radius())) * range.radius * UPWARDS;
    }
    let mut turned_n = shift.amax();
    for strand in strands {
        imbalance += strand.center_wrench;
        shift += strand.normal_wrench * strand.drift;
        error_n += strand.error_n;
        let normal_n = strand.normal_wrench.amax();
        size_n += strand.center_wrench.amax()
            + strand.chord_wrench.amax()
            + normal_n * (strand.thickness + strand.drift.abs());
        turned_n += normal_n * (strand.slope + strand.drift.abs() + strand.drift_slope);
    }
    error_n += shift_open_n + ROUNDING * (size_n + turned_n);
    if range.is_unknown {
        columns[held] = shift;
    }
    let matrix = Matrix6::from_columns(&columns);
    let inverse = Elimination::new(&matrix)?.inverse();
    let center = -(inverse * imbalance);
    let defect = inverse * matrix - Matrix6::identity();
    let (mut radius, mut slopes) = (Vector6::zeros(), Vector6::zeros());
    for k in 0..CABLES {
        let row: f64 = (0..CABLES).map(|j| inverse[(k, j)].abs()).sum();
        let off: f64 = (0..CABLES).map(|j| defect[(k, j)].abs() * strands[j].reach).sum();
        radius[k] = row * error_n + off;
        slopes[k] = radius[k] + row * ROUNDING * turned_n;
    }
    for (j, strand) in strands.iter().enumerate() {
        let seen = (inverse * strand.normal_wrench).abs();
        radius += seen * strand.thickness;
        slopes += seen * strand.drift_slope;
        if j == held {
            radius += (inverse * strand.chord_wrench).abs() * strand.reach;
        } else {
            slopes += seen * strand.slope;
        }
    }
    let verdict =
        Verdict { inverse, center, radius: radius * UPWARDS, contraction: slopes.max() * UPWARDS };
    let sum = verdict.center.sum() + verdict.radius.sum() + verdict.contraction;
    sum.is_finite().then_some(verdict)
}

#[cfg(test)]
mod tests {
    use super::super::homotopy::Deformation;
    use super::super::step::{Accuracy, converge};
    use super::*;
    use crate::cases::Overrides;
    use crate::continuation::Steps;
    use crate::continuation::{BranchEnd, direct};
    use crate::enumerate::{ModelKind, Request};
    use crate::problem::Problem;
    use crate::rigid::RigidSolutions;
    use crate::robot_file::RobotDescription;
    use cdpr_core::IrvineCatenary;

    /// Linear density at which two branches of the paper's pose meet, kg/m.
    const FOLD_KG_M: f64 = 0.053_074_811_614_3 * 0.079;
    const NO_CABLE_IS_VERTICAL: [bool; CABLES] = [false; CABLES];

    /// The paper's pose with five solutions, at this share of mass and stretch at the fold.
    fn paper_pose(share: f64) -> Problem<IrvineCatenary<f64>> {
        let crane = RobotDescription::marionet_crane();
        let stiffness_n = crane.robot.cables()[0].model.axial_stiffness_n;
        let s = FOLD_KG_M / 0.079 * share;
        let changes = Overrides {
            mass_kg: Some(10.0),
            linear_density_kg_m: Some(0.079 * s),
            axial_stiffness_n: Some(stiffness_n / s),
            ..Overrides::default()
        };
        let request = Request {
            robot: changes.apply(&crane),
            position_m: [0.967_33, 11.3833, 1.65],
            rotation_vector_rad: [0.0; 3],
            model: ModelKind::Irvine,
        };
        request.problem().expect("a valid pose")
    }

    fn solutions(problem: &Problem<IrvineCatenary<f64>>) -> Vec<Point> {
        let rigid = RigidSolutions::of(&problem.balance);
        let arrived =
            direct(problem, &rigid.solutions, Steps::Certified).into_iter().filter_map(|b| match b
                .end
            {
                BranchEnd::Solution(solution) => {
                    Some(Point { states: solution.states, sigma: 0.0 })
                }
                _ => None,
            });
        arrived.collect()
    }

    /// The strands of a step of this length from a point, with the point at its end.
    fn step(
        system: &System<'_, Deformation<'_, IrvineCatenary<f64>>>,
        before: &Point,
        held: usize,
        length: f64,
    ) -> Option<([Strand; CABLES], Range, Verdict, Point)> {
        let linear = system.linearise(before)?;
        let mut like = [0.0; CABLES + 1];
        like[held] = -1.0;
        let tangent = linear.tangent(held, &like)?;
        let start = linear.advance(before, &tangent.map(|t| t * length), false);
        let after = converge(system, &start, held, Accuracy::Full)?;
        let (from, to) = (Joint::new(system, before)?, Joint::new(system, &after)?);
        let bow = 0.5 * (after.sigma - before.sigma).abs();
        let span = Span { before, after: &after, held, length, bow };
        let reach = Reach::default();
        let range = Range::new(&from, &to, &span, &reach);
        let strands = strands(system, (&from, &to), &span, &range, &reach)?;
        let verdict = examine(system, &strands, held, &range)?;
        Some((strands, range, verdict, after))
    }

    /// `w` at a point of a strand, for a step with `sigma` an unknown.
    fn beside(plane: &CablePlane<f64>, strand: &Strand, state: &CableState<f64>, y: f64) -> f64 {
        let u = strand.coordinate(&state.force_n.map(Interval::point)).middle();
        let wrench = plane.wrench_n(&state.force_n)
            - strand.center_wrench
            - strand.chord_wrench * u
            - strand.normal_wrench * (strand.drift * y);
        wrench.dot(&strand.normal_wrench) / strand.normal_wrench.norm_squared()
    }

    #[test]
    fn what_newton_finds_on_the_way_is_in_the_box() {
        let problem = paper_pose(0.9);
        let deformation = Deformation { problem: &problem, steps: Steps::Certified };
        let system = System { homotopy: &deformation, vertical: NO_CABLE_IS_VERTICAL };
        let mut thickest = 0.0_f64;
        for before in solutions(&problem) {
            for held in [SIGMA, 2] {
                let (strands, range, verdict, after) =
                    step(&system, &before, held, 1e-3).expect("strands");
                for k in 0..=8 {
                    let part = f64::from(k) / 8.0;
                    let mut start = before.clone();
                    for (i, state) in start.states.iter_mut().enumerate() {
                        let end = &after.states[i];
                        state.force_n += (end.force_n - state.force_n) * part;
                        state.rest_length_m += (end.rest_length_m - state.rest_length_m) * part;
                    }
                    start.sigma += (after.sigma - start.sigma) * part;
                    let point = converge(&system, &start, held, Accuracy::Full).expect("solution");
                    let y = (point.sigma - range.middle) / range.radius;
                    assert!(y.abs() <= 1.0);
                    for (i, strand) in strands.iter().enumerate() {
                        let u = strand.coordinate(&point.states[i].force_n.map(Interval::point));
                        assert!(u.magnitude() < strand.reach, "cable {i}: {u:?}");
                        let slot = if i == held { y } else { u.middle() };
                        let off = (slot - verdict.center[i]).abs();
                        assert!(off <= verdict.radius[i], "cable {i}: {off}");
                        let plane = &problem.balance.planes()[i];
                        let w = beside(plane, strand, &point.states[i], y).abs();
                        assert!(w <= strand.thickness, "cable {i}: {w} {}", strand.thickness);
                        thickest = thickest.max(w / strand.thickness);
                    }
                }
            }
        }
        // The bounds are no luxury: a strand of half the thickness would not hold them.
        assert!(thickest > 0.5, "{thickest}");
    }

    #[test]
    fn branches_cannot_be_swapped() {
        let problem = paper_pose(1.0 - 1e-6);
        let deformation = Deformation { problem: &problem, steps: Steps::Certified };
        let system = System { homotopy: &deformation, vertical: NO_CABLE_IS_VERTICAL };
        let found = solutions(&problem);
        assert_eq!(found.len(), 5);
        for (i, before) in found.iter().enumerate() {
            for after in &found[..i] {
                let mut joint = Joint::new(&system, after).expect("a joint");
                let from = Joint::new(&system, before).expect("a joint");
                for length in [1e-4, 1e-3, 1e-2, 0.1, 1.0] {
                    let span = Span { before, after, held: SIGMA, length, bow: 0.0 };
                    let mut reach = Reach::default();
                    let proof = certify(&system, &span, &from, &mut joint, &mut reach);
                    assert!(proof.is_err(), "{length}");
                }
            }
        }
    }
}
