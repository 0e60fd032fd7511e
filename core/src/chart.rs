//! Force curves with one number for each point, whatever the pose: what a warm-start table stores.
//!
//! A [`CurvePoint`](crate::CurvePoint) is the curve of one pose near one state. A [`Charted`] model has a
//! coordinate for all of the curve, from bar-tight to slack, in which every pose has a point:
//! `(p, x, z) -> (F, L)` is explicit. Six such numbers are a seed that serves every pose of a neighbourhood,
//! because at an unchanged coordinate the forces turn and the lengths grow with the cable.
//!
//! # The coordinate
//!
//! The force density `m = S/(2L)` of a catenary (`S` the sum of the end tensions) exceeds half the weight
//! per length: `m = (w/2)(1 + s^2)` with `s > 0`, large for taut and small for slack cables. The force is
//! nearly linear in `s^2` for taut cables, and in `1/s` for slack ones, so the coordinate is
//!
//! ```text
//! p = 1/(2 s) - s^2        from -infinity (taut) to infinity (slack), without unit
//! ```
//!
//! which rises with the rest length. Newton's method in `p` then takes the bend of the curve as well as
//! in arc length: both need 270 cells to cover the workspace of MARIONET-CRANE in five steps. (Factors 1/4
//! and 1 in place of 1/2 need more.)
//!
//! # Newton's method, one cable eliminated
//!
//! Where a cable goes from taut to slack its curve bends, within a few newtons, and tangents say little. [`Start::step`]
//! replaces the curves of five cables by their tangents and keeps the sixth, which is said by the start, as it is. Six
//! equations in five unknowns leave one that is linear in the force of the sixth cable:
//!
//! ```text
//! a . F(q) + c = 0
//! ```
//!
//! a line across its force curve, which it meets where the slope `a . dF/dq` has the sign of the determinant of the six
//! columns `G_i dF_i/dp_i` on the wanted sheet, and once more where it has the other. The start has a bracket of `q` in
//! which the slope has the right sign, but at one end, where it may reach past a fold: so a search by signs, of the
//! distance from the line and of the slope, finds the one. (Nonlinear elimination, as in P. J. Lanzkron, D. J. Rose and
//! J. T. Wilkes, *An analysis of approximate nonlinear elimination*, 1996.)
//!
//! The error `e` of the five others after a step is that of their tangents alone, however sharply the sixth bends:
//! `sum M_i e_i + G_6 (F_6(q) - F_6(q*)) = sum G_i F_i''(somewhere between) e_i^2 / 2`. One to three steps do, from
//! anywhere within some half a metre on MARIONET-CRANE. The table builder of the host bounds all this in interval
//! arithmetic. [`ChartStep`] is Newton's method with no cable eliminated, for the host's search for starts.

use nalgebra::{ArrayStorage, Matrix6, Vector2};

use crate::elimination::{Condensed, Elimination};
use crate::statics::Balance;
use crate::{CABLES, CableModel, CableState, Real, Robot, Scalar, StepFault};

pub use crate::cable::Slackness;

/// `p = CHART_SCALE / s - s^2`.
pub(crate) const CHART_SCALE: f64 = 0.5;

/// Newton steps of [`root`] and of the strain of [`Charted::hang`] at most.
const ROOT_STEPS: u32 = 8;
const STRAIN_STEPS: u32 = 4;

/// Points of the curve of an eliminated cable, in a step of [`Start::step`] at most.
pub const CROSSING_STEPS: u32 = 64;
/// So many of them may come about by Newton's method.
const NEWTON_STEPS: u32 = 12;
/// A step along the curve so short, in units of `1 + |p|`, is the last.
const CROSSED: f64 = 1.0 / (1 << 10) as f64;
/// And so is a bracket of this width.
pub const CROSSING_WIDTH: f64 = 1.0 / (1 << 20) as f64;

/// No coordinate leaves this range on the way: tensions of `w d/2` times this, or lengths of `x` times this.
const FARTHEST: f64 = 1e6;

/// A point of the force curve, and how it moves with its coordinate and with the end of the cable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hung<T: Scalar> {
    /// Force on the cable at the attachment, N.
    pub force_n: Vector2<T>,
    /// Rest length, m.
    pub rest_length_m: T,
    /// Change of the force by the force density of the cable (`m`, see [`IrvineCatenary`](crate::IrvineCatenary)), m: where
    /// the curve is heading, hardly different all along a taut cable's.
    pub heading_m: Vector2<T>,
    /// Change of the force per unit of the coordinate, N: the heading, so many times as fast as the density changes.
    pub force_by_chart_n: Vector2<T>,
    /// Change of the strain per unit of the coordinate.
    pub strain_by_chart: T,
    /// Change of the strain at fixed coordinate when the end moves in x and in z, 1/m.
    pub strain_by_end_per_m: Vector2<T>,
    /// Change of the force at fixed coordinate when the end moves in x, N/m.
    pub force_by_x_n_m: Vector2<T>,
    /// And in z.
    pub force_by_z_n_m: Vector2<T>,
}

/// A point of the force curve in its chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChartPoint<T: Scalar> {
    /// Force and rest length.
    pub state: CableState<T>,
    /// Change of the force per unit of the coordinate, N.
    pub force_by_chart_n: Vector2<T>,
}

impl<T: Real> ChartPoint<T> {
    #[inline]
    fn is_finite(&self) -> bool {
        let (state, slope) = (&self.state, &self.force_by_chart_n);
        // One sum instead of five checks: infinities and NaN do not cancel out of it.
        (state.force_n.x + state.force_n.y + state.rest_length_m + slope.x + slope.y).is_finite()
    }
}

/// A cable model whose force curves have a chart.
pub trait Charted<T: Scalar>: CableModel<T> {
    /// How taut or slack a cable is at a coordinate: all that does not depend on where it ends.
    type Slackness;

    /// That, where the coordinate has the root `s`.
    fn slackness(&self, root: T) -> Self::Slackness;

    /// The curve of the cable to an attachment at `(x_m, z_m)`, at the point with that slackness. `strain`, the mean
    /// strain of the ends, is to be the one that comes out.
    ///
    /// Explicit, with no case distinction: an interval implements `T` as well.
    fn hung(&self, x_m: T, z_m: T, slackness: &Self::Slackness, strain: T) -> Hung<T>;

    /// Reciprocal axial stiffness `1/EA`, 1/N.
    fn compliance_per_n(&self) -> T;

    /// The mean strain of the ends at that point if its length were the one that goes with `strain`, and how
    /// much faster than one that less `strain` falls with `strain`: what [`Charted::hang`] iterates.
    fn strain(&self, x_m: T, z_m: T, slackness: &Self::Slackness, strain: T) -> (T, T);

    /// The point of the curve at the coordinate `chart`, for an attachment at `(x_m, z_m)`.
    ///
    /// One evaluation of [`Charted::hung`], at most 4 of [`Charted::strain`], and a cubic equation. Not finite when the
    /// numbers leave the range of their type.
    #[inline]
    fn hang(&self, x_m: T, z_m: T, chart: T) -> ChartPoint<T>
    where
        T: Real,
    {
        let slackness = self.slackness(root(chart));
        let mut strain = T::zero();
        for _ in 0..STRAIN_STEPS {
            let (next, slope) = self.strain(x_m, z_m, &slackness, strain);
            let change = (next - strain) / slope;
            strain += change;
            // The step after this one would be its square.
            if change * change <= T::EPSILON {
                break;
            }
        }
        let hung = self.hung(x_m, z_m, &slackness, strain);
        ChartPoint {
            state: CableState { force_n: hung.force_n, rest_length_m: hung.rest_length_m },
            force_by_chart_n: hung.force_by_chart_n,
        }
    }

    /// The coordinate of a state on its curve.
    fn chart(&self, state: &CableState<T>) -> T
    where
        T: Real,
    {
        // m - w/2 = (S - W)/(2L), each excess without cancellation.
        let weight_n_m = self.weight_n_m();
        let (force, weight) = (state.force_n, weight_n_m * state.rest_length_m);
        let (_, excess_b) = T::hypot_with_excess(force.x, force.y);
        let (_, excess_a) = T::hypot_with_excess(force.x, weight - force.y);
        let square = (excess_a + excess_b) / weight;
        T::constant(CHART_SCALE) / square.sqrt() - square
    }
}

/// The root `s > 0` of `1/(2s) - s^2 = chart`, to rounding.
#[inline]
pub fn root<T: Real>(chart: T) -> T {
    // f(s) = s^3 + chart s - c is convex and rises from its root on: Newton's method from above falls to it.
    let c = T::constant(CHART_SCALE);
    let widest = T::constant(0.793_700_525_984_099_7); // c^(1/3)
    let mut s = if chart >= T::zero() {
        widest.min(c / chart)
    } else {
        (-chart).sqrt() + widest.min(T::constant(-0.5) * c / chart)
    };
    for _ in 0..ROOT_STEPS {
        let square = s * s;
        let next = (square * s * T::constant(2.0) + c) / (T::constant(3.0) * square + chart);
        let settled = (s - next).abs() <= T::constant(2.0) * T::EPSILON * s;
        s = next;
        if settled {
            break;
        }
    }
    s
}

/// `chart` for a root `s`, and its slope, for any scalar.
pub fn chart_of_root<T: Scalar>(root: T) -> (T, T) {
    let c = T::constant(CHART_SCALE);
    let per_root = T::one() / root;
    (c * per_root - root * root, -(c * per_root * per_root + root + root))
}

/// One Newton step from six coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChartStep<T: Scalar> {
    /// The coordinates after it.
    pub charts: [T; CABLES],
    /// The points of the curves before it.
    pub points: [ChartPoint<T>; CABLES],
    elimination: Elimination<T>,
}

impl<T: Real> ChartStep<T> {
    /// The step at the pose of `balance`.
    ///
    /// Cost: six points of force curves, one elimination, one solve.
    ///
    /// # Errors
    /// [`StepFault`] when a number leaves its range, or the curves do not span all wrenches.
    #[inline]
    pub fn new<M: Charted<T>>(
        robot: &Robot<T, M>,
        balance: &Balance<T>,
        charts: &[T; CABLES],
    ) -> Result<Self, StepFault> {
        let points = points(robot, balance, charts)?;
        let mut sum = *balance.wrench_n();
        let mut columns = [[T::zero(); CABLES]; CABLES];
        for i in 0..CABLES {
            let plane = &balance.planes()[i];
            sum += plane.wrench_n(&points[i].state.force_n);
            columns[i] = plane.wrench_n(&points[i].force_by_chart_n).data.0[0];
        }
        let matrix = Matrix6::from_array_storage(ArrayStorage(columns));
        let elimination = Elimination::new(&matrix).ok_or(StepFault::SingularStatics)?;
        let back = elimination.solve(&sum);
        let farthest = T::constant(FARTHEST);
        let charts = core::array::from_fn(|i| (charts[i] - back[i]).max(-farthest).min(farthest));
        Ok(Self { charts, points, elimination })
    }

    /// The decomposed matrix of the wrenches of `dF_i/dp_i`.
    #[must_use]
    pub fn elimination(&self) -> &Elimination<T> {
        &self.elimination
    }
}

/// The points of six curves.
#[inline]
fn points<T: Real, M: Charted<T>>(
    robot: &Robot<T, M>,
    balance: &Balance<T>,
    charts: &[T; CABLES],
) -> Result<[ChartPoint<T>; CABLES], StepFault> {
    let points: [ChartPoint<T>; CABLES] = core::array::from_fn(|i| {
        let plane = &balance.planes()[i];
        robot.cables()[i].model.hang(plane.x_m, plane.z_m, charts[i])
    });
    match points.iter().position(|point| !point.is_finite()) {
        Some(i) => Err(StepFault::SingularCable(i)),
        None => Ok(points),
    }
}

/// Where Newton's method with one cable eliminated starts, and which of the solutions that it may meet is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start<T> {
    /// Coordinates of the six cables.
    pub charts: [T; CABLES],
    /// The cable that is eliminated.
    pub eliminated: usize,
    /// Coordinates between which its point is looked for, the taut one first.
    pub bracket: [T; 2],
    /// The end of the bracket that may be past a fold: the slack one, or the taut one.
    pub fold_at_slack_end: bool,
    /// Sign of the determinant of the six columns `G_i dF_i/dp_i` at the solution.
    pub is_positive: bool,
}

impl<T: Copy> Start<T> {
    /// The same in other numbers.
    #[inline]
    pub fn map<U>(&self, number: impl Fn(T) -> U) -> Start<U> {
        Start {
            charts: self.charts.map(&number),
            eliminated: self.eliminated,
            bracket: self.bracket.map(&number),
            fold_at_slack_end: self.fold_at_slack_end,
            is_positive: self.is_positive,
        }
    }
}

impl<T: Real> Start<T> {
    /// One step from here at the pose of `balance`.
    ///
    /// Cost: five points of force curves, one elimination, and some five points of the eliminated curve
    /// ([`CROSSING_STEPS`] at most).
    ///
    /// # Errors
    /// [`StepFault`] when a number leaves its range, the five tangents are dependent, or the search in the bracket does
    /// not end.
    #[inline]
    pub fn step<M: Charted<T>>(
        &self,
        robot: &Robot<T, M>,
        balance: &Balance<T>,
    ) -> Result<Self, StepFault> {
        let sixth = self.eliminated;
        let (Some(cable), Some(plane), Some(chart)) =
            (robot.cables().get(sixth), balance.planes().get(sixth), self.charts.get(sixth))
        else {
            return Err(StepFault::SingularStatics);
        };
        let mut columns = [[T::zero(); CABLES]; 8];
        let mut sum = *balance.wrench_n();
        let mut free = columns.iter_mut();
        let all = robot.cables().iter().zip(balance.planes()).zip(&self.charts);
        for (i, ((cable, plane), chart)) in all.enumerate() {
            if i == sixth {
                continue;
            }
            let point = cable.model.hang(plane.x_m, plane.z_m, *chart);
            if !point.is_finite() {
                return Err(StepFault::SingularCable(i));
            }
            sum += plane.wrench_n(&point.state.force_n);
            if let Some(column) = free.next() {
                *column = plane.wrench_n(&point.force_by_chart_n).data.0[0];
            }
        }
        columns[5] = plane.wrench_n(&Vector2::new(T::one(), T::zero())).data.0[0];
        columns[6] = plane.wrench_n(&Vector2::new(T::zero(), T::one())).data.0[0];
        columns[7] = sum.data.0[0];
        let condensed = Condensed::new(columns).ok_or(StepFault::SingularStatics)?;
        // The determinant with the column of the sixth cable in its place: so many exchanges.
        let is_even = (CABLES - 1 - sixth) & 1 == 0;
        let sign = if self.is_positive == is_even { T::one() } else { -T::one() };
        let [x, z, rest] = condensed.left().map(|entry| sign * entry);
        let line = Line {
            normal: Vector2::new(x, z),
            offset_n: rest,
            falls_at_slack_end: self.fold_at_slack_end,
        };
        let (chart, force_n) = line
            .crossing(&cable.model, (plane.x_m, plane.z_m), *chart, self.bracket)
            .ok_or(StepFault::SingularCable(sixth))?;
        let changes = condensed.solve(&[force_n.x, force_n.y, T::one()]);
        let farthest = T::constant(FARTHEST);
        let mut next = *self;
        let mut changes = changes.into_iter();
        for (i, to) in next.charts.iter_mut().enumerate() {
            if i == sixth {
                *to = chart;
            } else if let Some(change) = changes.next() {
                *to = (*to + change).max(-farthest).min(farthest);
            }
        }
        Ok(next)
    }
}

/// A line in the plane of a cable, `normal . F + offset = 0`: the forces that the five others can balance.
struct Line<T> {
    normal: Vector2<T>,
    offset_n: T,
    /// Where `normal . F` may fall as the coordinate rises: at the slack end of a bracket, or at the taut one.
    falls_at_slack_end: bool,
}

impl<T: Real> Line<T> {
    /// The point of a force curve on the line, in a bracket of its coordinate over which `normal . F + offset` rises,
    /// but towards one end; coordinate and force.
    ///
    /// Newton's method, halving where a step would leave the bracket or does not shrink fast, and from
    /// [`NEWTON_STEPS`] on: what is left of the bracket then is halved until it ends.
    #[inline]
    fn crossing<M: Charted<T>>(
        &self,
        model: &M,
        (x_m, z_m): (T, T),
        start: T,
        [mut low, mut high]: [T; 2],
    ) -> Option<(T, Vector2<T>)> {
        let half = T::constant(0.5);
        let mut chart = start.max(low).min(high);
        let mut last_change = high - low;
        for step in 0..CROSSING_STEPS {
            let point = model.hang(x_m, z_m, chart);
            if !point.is_finite() {
                return None;
            }
            let force_n = point.state.force_n;
            let excess_n = self.normal.dot(&force_n) + self.offset_n;
            let slope_n = self.normal.dot(&point.force_by_chart_n);
            let rises = slope_n > T::zero();
            // Where it falls it is beyond the fold.
            let is_past = if rises { excess_n > T::zero() } else { self.falls_at_slack_end };
            if is_past {
                high = chart;
            } else {
                low = chart;
            }
            let change = -(excess_n / slope_n);
            let next = chart + change;
            let unit = T::one() + chart.abs();
            // False for NaN, all of them.
            if rises && change.abs() <= T::constant(CROSSED) * unit {
                // What is left is of second order.
                return Some((next, force_n + point.force_by_chart_n * change));
            }
            if high - low <= T::constant(CROSSING_WIDTH) * unit {
                return Some((chart, force_n));
            }
            let shrinks = rises && change.abs() <= half * last_change;
            if shrinks && next >= low && next <= high && step < NEWTON_STEPS {
                last_change = change.abs();
                chart = next;
            } else {
                last_change = high - low;
                chart = between(low, high);
            }
        }
        None
    }
}

/// A number between two coordinates: the mean of their roots, with signs.
pub(crate) fn between<T: Real>(low: T, high: T) -> T {
    let root = |chart: T| if chart < T::zero() { -(-chart).sqrt() } else { chart.sqrt() };
    let middle = T::constant(0.5) * (root(low) + root(high));
    middle * middle.abs()
}

/// Takes `steps` steps from `start` and returns the states they lead to: on the curves of the pose, and in equilibrium
/// as far as the steps suffice, which is for the caller to know.
///
/// # Errors
/// [`StepFault`], as [`Start::step`].
pub fn converge<T: Real, M: Charted<T>>(
    robot: &Robot<T, M>,
    balance: &Balance<T>,
    start: &Start<T>,
    steps: u8,
) -> Result<[CableState<T>; CABLES], StepFault> {
    let mut reached = *start;
    for _ in 0..steps {
        reached = reached.step(robot, balance)?;
    }
    Ok(points(robot, balance, &reached.charts)?.map(|point| point.state))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::IrvineCatenary;

    const CABLES_TRIED: [(f64, f64); 4] = [(0.775, 8e-7), (0.039, 8e-7), (5.0, 0.0), (0.775, 4e-4)];
    const ENDS_M: [(f64, f64); 4] = [(8.0, -6.0), (0.5, -9.0), (12.0, -0.1), (7.0, 2.0)];
    const CHARTS: [f64; 9] = [-1e3, -90.0, -9.0, -1.0, 0.0, 0.4, 2.0, 9.0, 300.0];

    fn each(mut check: impl FnMut(IrvineCatenary<f64>, f64, f64, f64)) {
        for (weight_n_m, compliance_per_n) in CABLES_TRIED {
            for (x, z) in ENDS_M {
                for chart in CHARTS {
                    // Strains up to a tenth.
                    if chart * weight_n_m * compliance_per_n > -0.02 {
                        check(IrvineCatenary { weight_n_m, compliance_per_n }, x, z, chart);
                    }
                }
            }
        }
    }

    #[test]
    fn root_solves_its_equation() {
        let mut chart = -1e6_f64;
        while chart < 1e6 {
            let s = root(chart);
            let (back, _) = chart_of_root(s);
            // Either term is rounded to half a unit, and the root to a few.
            assert!((back - chart).abs() < 32.0 * f64::EPSILON * (1.0 + chart.abs()), "{chart}");
            #[allow(clippy::cast_possible_truncation)]
            let single = root(chart as f32);
            assert!((f64::from(single) / s - 1.0).abs() < 8.0 * f64::from(f32::EPSILON), "{chart}");
            chart += 0.37 + chart.abs() * 0.01;
        }
    }

    /// The cable ends where it should, by the end-point map, which is another formula.
    #[test]
    fn cable_ends_at_its_attachment() {
        each(|model, x, z, chart| {
            let state = model.hang(x, z, chart).state;
            let end = model.end_point(state.force_n, state.rest_length_m).position_m;
            let error_m = (end.x - x).abs().max((end.y - z).abs());
            // A few units of the length, as for the end-point map itself.
            let bound_m = 16.0 * f64::EPSILON * (state.rest_length_m + x);
            assert!(error_m <= bound_m, "{model:?} {x} {z} {chart}: {error_m:e}");
            let back = model.chart(&state);
            assert!((back - chart).abs() <= 1e-11 * (1.0 + chart.abs()), "{chart}: {back}");
        });
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        each(|model, x, z, chart| {
            let force = |x, z, chart| model.hang(x, z, chart).state.force_n;
            let strain = |x, z, chart: f64| {
                let state = model.hang(x, z, chart).state;
                let tensions_n =
                    state.tension_at_attachment_n() + state.tension_at_anchor_n(model.weight_n_m);
                0.5 * model.compliance_per_n * tensions_n
            };
            let strained = strain(x, z, chart);
            let hung = model.hung(x, z, &model.slackness(root(chart)), strained);
            let step = 1e-5 * (1.0 + chart.abs());
            let near = |found: Vector2<f64>, wanted: Vector2<f64>, what: &str| {
                // Of second order in a relative step of 1e-5, and rounding over the step.
                let bound = 1e-7 * wanted.norm() + 1e-9 * force(x, z, chart).norm();
                assert!(
                    (found - wanted).norm() <= bound,
                    "{what} {model:?} {x} {z} {chart}: {found} {wanted}"
                );
            };
            let by_chart = (force(x, z, chart + step) - force(x, z, chart - step)) / (2.0 * step);
            near(hung.force_by_chart_n, by_chart, "chart");
            // By the force density, which falls as the coordinate rises: without the half weight in it, which does not.
            let density = |chart: f64| 0.5 * model.weight_n_m * root(chart) * root(chart);
            let fall = (density(chart + step) - density(chart - step)) / (2.0 * step);
            near(hung.heading_m * fall, by_chart, "density");
            let h = 1e-5 * x;
            near(
                hung.force_by_x_n_m,
                (force(x + h, z, chart) - force(x - h, z, chart)) / (2.0 * h),
                "x",
            );
            near(
                hung.force_by_z_n_m,
                (force(x, z + h, chart) - force(x, z - h, chart)) / (2.0 * h),
                "z",
            );
            let by_end = Vector2::new(
                (strain(x + h, z, chart) - strain(x - h, z, chart)) / (2.0 * h),
                (strain(x, z + h, chart) - strain(x, z - h, chart)) / (2.0 * h),
            );
            let off = (hung.strain_by_end_per_m - by_end).norm();
            assert!(off <= 1e-6 * by_end.norm() + 1e-9 * strained / h, "{off} {by_end}");
            let by_chart = (strain(x, z, chart + step) - strain(x, z, chart - step)) / (2.0 * step);
            assert!(
                (hung.strain_by_chart - by_chart).abs() <= 1e-6 * by_chart.abs() + 1e-10 * strained
            );
        });
    }
}
