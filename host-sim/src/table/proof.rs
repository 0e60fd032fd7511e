//! The proof of a cell: a seed leads to one solution, for every pose of a box.
//!
//! The unknowns are the six coordinates `p` of the [chart](cdpr_core::chart), the equations
//! `wrench(P) + sum_i G_i(P) F_i(p_i; x_i(P), z_i(P)) = 0`. One cable, `e`, is eliminated: a step of
//! [`Start::step`] from `p` leads to the `p'` with
//!
//! ```text
//! S(P, p) + sum_(i not e) M_i(P, p_i) (p'_i - p_i) + G_e F_e(p'_e) = 0      S = wrench + sum_(i not e) G_i F_i
//! ```
//!
//! where `M_i = G_i dF_i/dp_i`, and to that `p'` of two at which `det (M_1 ... M_6)` has the sign of the sheet. The
//! start's `p_e` does not matter. `P` runs over a box, `pc` is the solution at a pose `Pc` of it, and `A` close to the
//! inverse of the matrix there whose column `e` is replaced by a unit vector across all others: it stays regular at a
//! fold, and row `e` of it tells what the five others cannot balance.
//!
//! # One step
//!
//! With `y = p' - pc`, `K = A M - 1` (columns other than `e`) and what the tangents at `p` miss at `pc`,
//! `R = sum G_i (F_i(pc) - F_i(p) - F_i'(p)(pc - p))`,
//!
//! ```text
//! y_i + (K y)_i = (A R)_i - (A (S(P, pc) + G_e F_e(q)))_i     i not e
//!         (K y)_e = (A R)_e - (A (S(P, pc) + G_e F_e(q)))_e     q = p'_e
//! ```
//!
//! `S(P, pc)` is enclosed by the mean value theorem over the pose. The curve of `e` is walked in short pieces; the
//! second line, with `|y|` bounded by the first, tells on which of them `q` may be, with what sign the left side
//! leaves zero on both sides, and that its slope `det` is of the right sign there. So `q` is found by any search that
//! goes by these signs, however sharp the bend, and the first line bounds the others.
//!
//! # The solution
//!
//! A box of the five coordinates that every step from it leads into holds a solution for every pose (Brouwer), which
//! is the only one in it when the errors of a step, below, shrink from the size of the box.
//!
//! # Newton's method
//!
//! The error `e_i = p'_i - p*_i` after a step from `p` obeys
//!
//! ```text
//! sum_(i not e) M_i(P, p_i) e_i + G_e (F_e(q) - F_e(q*)) = sum_(i not e) G_i (F_i(p*_i) - F_i(p_i) - F_i'(p_i) (p*_i - p_i))
//! ```
//!
//! The difference on the left is an integral of `F_e'` over pieces on which row `e` of `A G_e F_e'` is positive, so
//! that each of its other rows is at most so many times that one: no curvature of the eliminated cable enters. Each
//! bracket on the right is enclosed twice: as it stands, and as `F_i'' (p*_i - p_i)^2/2` with `F_i''` over all that
//! lies between iterate and solution. Beginning with the seed this gives a box for each iterate, to which is added what
//! arithmetic in f32 may do (as what it changes in the equations).
//!
//! # Patches
//!
//! Two cables that bend in one box are too much: then `K` is not small. The box is cut into [`Patch`]es across the
//! directions in which these two forces change, each with its own `pc` and `A`. What is common to the patches of a
//! box are the directions and distances of the cables, which hardly change.

use cdpr_core::chart::{ChartStep, Charted, Start, root};
use cdpr_core::elimination::Elimination;
use cdpr_core::statics::Balance;
use cdpr_core::table::{COORDINATES, Gap, TOLERANCE};
use cdpr_core::{CABLES, Load, Robot};
use nalgebra::{Matrix6, Vector2, Vector6};
use num_traits::Zero;

use super::Model;
use super::curve::{Curves, Reach, both, size};
use super::patch::Patch;
use super::place::{Likeness, Loading, Point, PoseBox, Sight, pose};
use crate::interval::Interval;

/// Newton steps at the middle of a box, to find the solution there.
const SETTLING_STEPS: usize = 30;
/// A step that changes no coordinate by more than this is the last (relative, and absolute near zero).
const SETTLED: f64 = 1e-11;
/// Radii of the box of a solution, in units of what a step needs: how they grow, and how often.
const ROOM: f64 = 1.1;
const ROOM_ATTEMPTS: usize = 5;
const LEAST_RADIUS: f64 = 1e-9;
/// For the rounding of sums of non-negative bounds.
const UPWARDS: f64 = 1.0 + 1e-12;
/// Times that the errors of a step are fed back through `A M - I`.
const FEEDBACK: usize = 6;
/// And what is added to each for it.
const SHARE: f64 = 0.01;
/// Pieces of the curve of the eliminated cable: length of the first from the solution, in units of how well that is
/// known; how they grow; and how far the root of the coordinate changes over one at most.
const FINEST: f64 = 0.5;
const GROWTH: f64 = 1.3;
const BEND: f64 = 0.08;
/// Fine pieces on one side of the solution at most.
const MOST_FINE: usize = 48;
/// Cuts of a box into patches, one within the other, at most.
const MOST_CUTS: u8 = 2;
/// Bracket of an eliminated cable: what it moves over a box, times one of these and a little more; the largest at
/// which the tangent is this steep, in units of the solution.
const BRACKETS: [f64; 7] = [1.0, 1.3, 1.6, 2.0, 2.5, 3.2, 4.0];
const LEAST_BRACKET: f64 = 0.5;
const STEEP: f64 = 0.3;

/// The arithmetic of a controller in f32: a component of the wrench of a cable is off by at most this many
/// units of the force (15 operations of the explicit curve, whose factors are of one sign, rounded half a
/// unit each, as are direction, lever arm, products and the sum of seven).
const F32_ROUNDINGS: f64 = 12.0;
/// And the plane of a cable by this many units of the coordinates that it is made of.
const F32_PLANE: f64 = 2.0;
/// Unit in the last place of 1.
const F32: f64 = f32::EPSILON as f64;

/// Proves cells of one robot with one load.
pub(super) struct Prover {
    robot: Robot<f64, Model>,
    load: Load<f64>,
    likeness: Likeness,
    curves: Curves,
    /// Largest coordinate of an anchor, m.
    size_m: f64,
}

/// What is known of a box.
#[derive(Clone, Debug)]
pub(super) enum Verdict {
    /// The seed leads to the solution in so many steps.
    Proven { steps: u8 },
    /// At its middle it does not.
    Refuted,
    /// Not proven; a smaller box may be. The coordinate in which to halve it.
    Open { split: usize, gap: Gap },
}

/// A box, seen from the solution at a pose of it.
pub(super) struct Outlook {
    /// With the cable eliminated whose tangent turns most over the box, and with those that follow.
    pub(super) starts: Vec<Start<f64>>,
    /// Sines of the angles by which the tangents turn, about, in that order.
    pub(super) turns: Vec<f64>,
    /// The coordinate that moves the forces most.
    pub(super) widest: usize,
    /// How far the matrix turns over the box at fixed coordinates, about: a proof needs less than 1.
    pub(super) defect: f64,
}

impl Prover {
    pub(super) fn new(robot: &Robot<f64, Model>, load: &Load<f64>) -> Self {
        let size_m = robot.cables().iter().map(|c| c.anchor_m.amax()).fold(0.0, f64::max);
        let (likeness, curves) = (Likeness::new(robot, load), Curves::new(robot));
        Self { robot: *robot, load: *load, likeness, curves, size_m }
    }

    pub(super) fn robot(&self) -> &Robot<f64, Model> {
        &self.robot
    }

    pub(super) fn load(&self) -> &Load<f64> {
        &self.load
    }

    pub(super) fn balance(&self, at: &Point) -> Option<Balance<f64>> {
        Balance::at(&self.robot, &self.load, &pose(at).ok()?).ok()
    }

    /// The solution that Newton's method leads to from `charts`, in at most `steps` steps.
    pub(super) fn settle(
        &self,
        balance: &Balance<f64>,
        charts: &[f64; CABLES],
        steps: usize,
    ) -> Option<([f64; CABLES], ChartStep<f64>)> {
        let mut charts = *charts;
        for _ in 0..steps {
            let step = ChartStep::new(&self.robot, balance, &charts).ok()?;
            let settled = (0..CABLES)
                .all(|i| (step.charts[i] - charts[i]).abs() <= SETTLED * (1.0 + charts[i].abs()));
            if settled {
                return Some((charts, step));
            }
            charts = step.charts;
        }
        None
    }

    /// The solution that a seed leads to in so many steps, if that comes as close as a table asks for.
    pub(super) fn lead(
        &self,
        balance: &Balance<f64>,
        seed: &Start<f64>,
        steps: u8,
    ) -> Option<([f64; CABLES], ChartStep<f64>)> {
        let mut reached = *seed;
        for _ in 0..steps {
            reached = reached.step(&self.robot, balance).ok()?;
        }
        let reached = reached.charts;
        let (center, step) = self.settle(balance, &reached, SETTLING_STEPS)?;
        let (mut off_n, mut forces_n) = (0.0_f64, 0.0);
        for i in 0..CABLES {
            let point = &step.points[i];
            off_n = off_n.max(point.force_by_chart_n.lp_norm(1) * (reached[i] - center[i]).abs());
            forces_n += point.state.force_n.lp_norm(1);
        }
        let is_of_sheet = step.elimination().is_positive() == seed.is_positive;
        (is_of_sheet && off_n <= TOLERANCE * forces_n).then_some((center, step))
    }

    /// What a box looks like from the solution `charts` at a pose of it.
    pub(super) fn outlook(
        &self,
        region: &PoseBox,
        at: &Point,
        charts: &[f64; CABLES],
    ) -> Option<Outlook> {
        let balance = self.balance(at)?;
        let step = ChartStep::new(&self.robot, &balance, charts).ok()?;
        let inverse = step.elimination().inverse();
        let (sights, loading) = self.likeness.look(&PoseBox { low: *at, high: *at }).ok()?;
        let mut by_pose = [Vector6::zeros(); COORDINATES];
        by_pose[3..].copy_from_slice(&loading.by_turn);
        for (i, sight) in sights.iter().enumerate() {
            let hung = self.curves.hung(i, sight, Interval::point(charts[i]))?;
            let (by_x, by_z) = (&hung.force_by_x_n_m, &hung.force_by_z_n_m);
            let arm_m = self.likeness.moment_arm_m();
            sight.add_by_pose(&mut by_pose, &hung.force_n, by_x, by_z, arm_m);
        }
        let mut reach = Vector6::zeros();
        let slopes_n = Vector6::from_fn(|i, _| step.points[i].force_by_chart_n.norm());
        let (mut widest, mut most_n) = (0, 0.0);
        for k in 0..COORDINATES {
            let moved = (inverse * by_pose[k].map(Interval::middle)).abs();
            let moved = moved * (0.5 * region.extent(k));
            reach += moved;
            let forces_n = moved.dot(&slopes_n);
            if forces_n > most_n {
                (widest, most_n) = (k, forces_n);
            }
        }
        let turns: [f64; CABLES] =
            std::array::from_fn(|i| self.turn(&balance, i, charts[i], reach[i]));
        let mut order: Vec<usize> = (0..CABLES).collect();
        order.sort_by(|a, b| turns[*b].total_cmp(&turns[*a]));
        let start = |eliminated: usize| {
            let (chart, reach) = (charts[eliminated], reach[eliminated]);
            // Not up to where the determinant changes its sign.
            let row = inverse.row(eliminated).transpose();
            let plane = &balance.planes()[eliminated];
            let model = &self.robot.cables()[eliminated].model;
            let rise = |chart: f64| {
                let tangent = model.hang(plane.x_m, plane.z_m, chart).force_by_chart_n.normalize();
                row.dot(&plane.wrench_n(&tangent))
            };
            let least = STEEP * rise(chart);
            let end = |way: f64| {
                let rooms = BRACKETS.map(|times| way * (times * reach + LEAST_BRACKET));
                let is_steep = |room: &&f64| rise(chart + **room) >= least;
                chart + rooms.iter().rev().find(is_steep).unwrap_or(&rooms[0])
            };
            Start {
                charts: *charts,
                eliminated,
                bracket: [end(-1.0), end(1.0)],
                is_positive: step.elimination().is_positive(),
            }
        };
        let turns = order.iter().map(|cable| turns[*cable]).collect();
        let starts = order.into_iter().map(start).collect();
        let defect = self.defect(region, at, charts, &inverse, &slopes_n)?;
        Some(Outlook { starts, turns, widest, defect })
    }

    /// How far the matrix at fixed coordinates is from that at a pose, at the ends of a box: the norm in newtons.
    fn defect(
        &self,
        region: &PoseBox,
        at: &Point,
        charts: &[f64; CABLES],
        inverse: &Matrix6<f64>,
        slopes_n: &Vector6<f64>,
    ) -> Option<f64> {
        let mut sum = Vector6::zeros();
        for k in 0..COORDINATES {
            let mut there = *at;
            there[k] += 0.5 * region.extent(k);
            let balance = self.balance(&there)?;
            for i in 0..CABLES {
                let (plane, model) = (&balance.planes()[i], &self.robot.cables()[i].model);
                let tangent = model.hang(plane.x_m, plane.z_m, charts[i]).force_by_chart_n;
                let mut column = inverse * plane.wrench_n(&tangent);
                column[i] -= 1.0;
                // A move by 1 N of this cable, in newtons of each.
                sum += column.abs().component_mul(slopes_n) / (slopes_n[i] * CABLES as f64);
            }
        }
        Some(sum.sum())
    }

    /// Sine of the angle by which the tangent of a cable turns around a coordinate.
    fn turn(&self, balance: &Balance<f64>, cable: usize, chart: f64, reach: f64) -> f64 {
        let plane = &balance.planes()[cable];
        let tangent = |chart: f64| {
            let model = &self.robot.cables()[cable].model;
            model.hang(plane.x_m, plane.z_m, chart).force_by_chart_n.normalize()
        };
        tangent(chart - reach).perp(&tangent(chart + reach)).abs()
    }

    /// Examines a box of poses; `steps` is what the seed may take at most.
    pub(super) fn examine(&self, region: &PoseBox, seed: &Start<f64>, steps: u8) -> Verdict {
        let middle = region.middle();
        let at_middle = self.balance(&middle).and_then(|balance| self.lead(&balance, seed, steps));
        let Some((center, at_center)) = at_middle else { return Verdict::Refuted };
        // Before anything is known: as far as an attachment moves.
        let extent =
            |k: usize| region.extent(k) * if k < 3 { 1.0 } else { self.likeness.moment_arm_m() };
        let split =
            (0..COORDINATES).fold(0, |best, k| if extent(k) > extent(best) { k } else { best });
        let open = Verdict::Open { split, gap: Gap::SingularCable };
        let Ok((sights, loading)) = self.likeness.look(region) else { return open };
        let Some(pieces) = Rough::all(&self.curves, seed, &sights) else { return open };
        let view = View { prover: self, region, sights, loading, pieces, seed, steps };
        let Some(frame) = Frame::new(&view, &Patch::whole(region), &center, &at_center) else {
            return open;
        };
        match frame.prove_in_patches(MOST_CUTS) {
            Ok(steps) => Verdict::Proven { steps },
            Err(gap) => Verdict::Open { split: frame.widest, gap },
        }
    }
}

/// A piece of the curve of the eliminated cable, for all poses of a box.
struct Rough {
    chart: Interval,
    force_n: Vector2<Interval>,
    by_chart_n: Vector2<Interval>,
}

impl Rough {
    fn of(curves: &Curves, cable: usize, sight: &Sight, chart: Interval) -> Option<Self> {
        let Reach { force_n, by_chart_n, .. } = curves.reach_at_once(cable, sight, chart)?;
        Some(Self { chart, force_n, by_chart_n })
    }

    /// The whole bracket of a seed, from its taut end.
    fn all(curves: &Curves, seed: &Start<f64>, sights: &[Sight]) -> Option<Vec<Self>> {
        let (cable, [mut low, end]) = (seed.eliminated, seed.bracket);
        let mut pieces = Vec::with_capacity(64);
        while low < end {
            let high = (low + longest(low)).min(end);
            pieces.push(Self::of(curves, cable, &sights[cable], Interval::new(low, high))?);
            low = high;
        }
        Some(pieces)
    }
}

/// How long a piece may be at a coordinate.
fn longest(chart: f64) -> f64 {
    let s = root(chart);
    (0.5 / s + 2.0 * s * s) * BEND
}

/// A box of poses, and the seed to be examined for it.
struct View<'a> {
    prover: &'a Prover,
    region: &'a PoseBox,
    sights: Vec<Sight>,
    loading: Loading,
    pieces: Vec<Rough>,
    seed: &'a Start<f64>,
    steps: u8,
}

/// A piece of the curve of the eliminated cable, for all poses of a patch.
struct Piece {
    /// `A (S(P, pc) + G F(q))`.
    sum: Vector6<Interval>,
    /// `A G F'(q)`.
    slope: Vector6<Interval>,
    /// `|F|` and `|F'|` at most, N.
    force_n: f64,
    slope_n: f64,
    /// Row `e` times these factors is taken from each other row, so that the slope is about zero there.
    ratio: Vector6<f64>,
    /// The sum after that.
    swept: Vector6<Interval>,
    /// The slope after that, sizes.
    swept_slope: Vector6<f64>,
}

/// A patch, seen from the solution at its middle.
struct Frame<'a> {
    view: &'a View<'a>,
    patch: Patch,
    center: [f64; CABLES],
    /// `A`.
    inverse: Inverse,
    /// From the taut end; fine ones around the solution, rough ones beyond.
    pieces: Vec<Piece>,
    /// The lower ends of the fine pieces, and the upper one of the last of them.
    joints: Vec<Piece>,
    /// Numbers of the first fine piece, and of that which begins at the solution.
    first_fine: usize,
    middle: usize,
    /// The coordinate that moves the forces most.
    widest: usize,
    /// The cable that bends most besides the eliminated one, if any does.
    bent: usize,
    /// How the sum changes with the pose, and along the curve, in the middle.
    by_pose: [Vector6<f64>; COORDINATES],
    slope: Vector6<f64>,
}

type Rows = [Vector6<Interval>; COORDINATES];

/// `A (S(P, pc) + G F(q))` over a patch, and how it comes about.
struct Sums<'a> {
    view: &'a View<'a>,
    patch: &'a Patch,
    inverse: &'a Inverse,
    /// At the middle of the patch.
    sights: Vec<Sight>,
    /// The same there, without the eliminated cable; before `A`, and after.
    others_n: Vector6<Interval>,
    others: Vector6<Interval>,
    /// How it changes with the pose, without the eliminated cable; before `A`, and after.
    by_pose_n: Rows,
    rows: Rows,
    /// Over the patch.
    all_others: Vector6<Interval>,
}

impl<'a> Sums<'a> {
    fn new(
        view: &'a View<'a>,
        patch: &'a Patch,
        center: &[f64; CABLES],
        inverse: &'a Inverse,
    ) -> Option<Self> {
        let Prover { curves, likeness, .. } = view.prover;
        let at = patch.middle;
        let (sights, loading) = likeness.look(&PoseBox { low: at, high: at }).ok()?;
        let mut others_n = loading.wrench_n;
        let mut by_pose_n = [Vector6::zeros(); COORDINATES];
        by_pose_n[3..].copy_from_slice(&view.loading.by_turn);
        for i in (0..CABLES).filter(|i| *i != view.seed.eliminated) {
            let chart = Interval::point(center[i]);
            others_n += sights[i].wrench_n(&curves.hung(i, &sights[i], chart)?.force_n);
            let all = curves.hung(i, &view.sights[i], chart)?;
            let (by_x, by_z) = (&all.force_by_x_n_m, &all.force_by_z_n_m);
            let arm_m = likeness.moment_arm_m();
            view.sights[i].add_by_pose(&mut by_pose_n, &all.force_n, by_x, by_z, arm_m);
        }
        let (others, rows) = (inverse.times(&others_n), inverse.rows(&by_pose_n));
        let mut sums = Self {
            view,
            patch,
            inverse,
            sights,
            others_n,
            others,
            by_pose_n,
            rows,
            all_others: others,
        };
        sums.all_others += sums.spread(&rows, &Vector6::zeros());
        Some(sums)
    }

    /// Row `e` times the factors taken from the other rows.
    fn swept(&self, v: &Vector6<Interval>, ratio: &Vector6<f64>) -> Vector6<Interval> {
        let cable = self.view.seed.eliminated;
        Vector6::from_fn(|i, _| v[i] - Interval::point(ratio[i]) * v[cable])
    }

    /// What poses aside from the middle add, swept.
    fn spread(&self, rows: &Rows, ratio: &Vector6<f64>) -> Vector6<Interval> {
        let swept = rows.each_ref().map(|row| self.swept(row, ratio));
        let gradient = |i: usize| swept.each_ref().map(|row| row[i]);
        Vector6::from_fn(|i, _| self.patch.spread(self.view.region, &gradient(i)))
    }

    fn rough(&self, piece: &Rough) -> Piece {
        let cable = self.view.seed.eliminated;
        let sight = &self.view.sights[cable];
        let along = self.inverse.times(&sight.wrench_n(&piece.force_n));
        let slope = self.inverse.times(&sight.wrench_n(&piece.by_chart_n));
        let rise = slope[cable];
        let ratio = Vector6::from_fn(|i, _| {
            let ratio = slope[i].middle() / rise.middle();
            if i != cable && rise.mignitude() > 0.0 && ratio.is_finite() { ratio } else { 0.0 }
        });
        Piece {
            sum: self.all_others + along,
            force_n: size(&piece.force_n).high(),
            slope_n: size(&piece.by_chart_n).high(),
            swept: self.swept(&(self.others + along), &ratio) + self.spread(&self.rows, &ratio),
            swept_slope: self.swept(&slope, &ratio).map(Interval::magnitude),
            slope,
            ratio,
        }
    }

    /// The rows with the eliminated cable, too.
    fn rows_at(&self, chart: Interval) -> Option<Rows> {
        let Prover { curves, likeness, .. } = self.view.prover;
        let cable = self.view.seed.eliminated;
        let sight = &self.view.sights[cable];
        let all = curves.hung(cable, sight, chart)?;
        let mut by_pose_n = self.by_pose_n;
        let (by_x, by_z) = (&all.force_by_x_n_m, &all.force_by_z_n_m);
        let arm_m = likeness.moment_arm_m();
        sight.add_by_pose(&mut by_pose_n, &all.force_n, by_x, by_z, arm_m);
        Some(self.inverse.rows(&by_pose_n))
    }

    /// The sum at the middle of the patch.
    fn exactly(&self, chart: f64) -> Option<Vector6<Interval>> {
        let cable = self.view.seed.eliminated;
        let sight = &self.sights[cable];
        let here = self.view.prover.curves.hung(cable, sight, Interval::point(chart))?;
        Some(self.inverse.times(&(self.others_n + sight.wrench_n(&here.force_n))))
    }

    /// By the mean value theorem, over the pose and from a coordinate at which the sum is `exact` at the middle.
    fn fine(&self, exact: &Vector6<Interval>, from: f64, to: f64) -> Option<Piece> {
        let cable = self.view.seed.eliminated;
        let (curves, sight) = (&self.view.prover.curves, &self.view.sights[cable]);
        let chart = Interval::new(from.min(to), from.max(to));
        let rows = self.rows_at(chart)?;
        let mut piece = self.rough(&Rough::of(curves, cable, sight, chart)?);
        let along = chart - Interval::point(from);
        let sum = exact + piece.slope.map(|c| c * along) + self.spread(&rows, &Vector6::zeros());
        let turned = piece.swept_slope.map(|c| Interval::symmetric(c) * along);
        let spread = self.spread(&rows, &piece.ratio);
        let swept = self.swept(exact, &piece.ratio) + turned + spread;
        for i in 0..CABLES {
            piece.sum[i] = piece.sum[i].intersection(sum[i])?;
            piece.swept[i] = piece.swept[i].intersection(swept[i])?;
        }
        Some(piece)
    }

    /// Fine pieces from the solution to where the sum has a certain sign, their far ends, and where that is: towards
    /// `end`, beginning with steps of `step`.
    fn march(&self, at: f64, mut step: f64, end: f64) -> Option<(Vec<Piece>, Vec<Piece>, f64)> {
        let cable = self.view.seed.eliminated;
        let (mut pieces, mut joints, mut chart) = (Vec::new(), Vec::new(), at);
        let mut exact = self.exactly(at)?;
        for _ in 0..MOST_FINE {
            step = (GROWTH * step).clamp(-longest(chart), longest(chart));
            let is_last = (end - chart).abs() <= step.abs();
            let next = if is_last { end } else { chart + step };
            pieces.push(self.fine(&exact, chart, next)?);
            exact = self.exactly(next)?;
            let joint = self.fine(&exact, next, next)?;
            let sum = joint.sum[cable];
            let is_certain = sum.middle() * step.signum() > 2.0 * sum.radius();
            joints.push(joint);
            chart = next;
            if is_certain || is_last {
                break;
            }
        }
        Some((pieces, joints, chart))
    }
}

/// Where a step leads from anywhere in a box of coordinates.
struct Stage {
    /// Of the five cables, at the box.
    reach: Vec<Option<Reach>>,
    columns: Columns,
    /// Pieces on which the eliminated cable may be then.
    first: usize,
    last: usize,
    /// The other coordinates then.
    to: [Interval; CABLES],
}

impl<'a> Frame<'a> {
    fn new(
        view: &'a View<'a>,
        patch: &Patch,
        center: &[f64; CABLES],
        at_center: &ChartStep<f64>,
    ) -> Option<Self> {
        let cable = view.seed.eliminated;
        let balance = view.prover.balance(&patch.middle)?;
        let inverse = Inverse::new(&balance, at_center, cable)?;
        let sums = Sums::new(view, patch, center, &inverse)?;
        let (at, bracket) = (center[cable], view.seed.bracket);
        let is_inside = at > bracket[0] && at < bracket[1];
        if !is_inside {
            return None;
        }
        let exact = sums.exactly(at)?;
        let here = sums.fine(&exact, at, at)?;
        let slope = here.slope.map(Interval::middle);
        let known = here.sum[cable].radius() / here.slope[cable].low();
        if !(known > 0.0 && known.is_finite()) {
            return None;
        }
        let (down, down_joints, low) = sums.march(at, -FINEST * known, bracket[0])?;
        let (up, up_joints, high) = sums.march(at, FINEST * known, bracket[1])?;
        let mut pieces = Vec::with_capacity(view.pieces.len() + down.len() + up.len());
        let below = view.pieces.iter().filter(|p| p.chart.low() < low);
        pieces.extend(below.map(|piece| sums.rough(piece)));
        let first_fine = pieces.len();
        let middle = first_fine + down.len();
        pieces.extend(down.into_iter().rev());
        pieces.extend(up);
        let above = view.pieces.iter().filter(|p| p.chart.high() > high);
        pieces.extend(above.map(|piece| sums.rough(piece)));
        let joints = down_joints.into_iter().rev().chain([here]).chain(up_joints).collect();

        let rows = sums.rows_at(Interval::point(at))?;
        let by_pose = rows.map(|row| row.map(Interval::middle));
        let mut frame = Self {
            view,
            patch: *patch,
            center: *center,
            inverse,
            pieces,
            joints,
            first_fine,
            middle,
            widest: 0,
            bent: cable,
            by_pose,
            slope,
        };
        frame.judge(&balance, at_center);
        Some(frame)
    }

    /// Which coordinate moves the forces most, and which other cable bends.
    fn judge(&mut self, balance: &Balance<f64>, at_center: &ChartStep<f64>) {
        let View { prover, region, seed, .. } = self.view;
        let cable = seed.eliminated;
        let slope_n = |i: usize| {
            if i == cable { 1.0 } else { at_center.points[i].force_by_chart_n.norm() }
        };
        let share = |k: usize| -> f64 {
            let moved = |i: usize| self.by_pose[k][i].abs() * slope_n(i);
            region.extent(k) * (0..CABLES).map(moved).sum::<f64>()
        };
        let shares: [f64; COORDINATES] = std::array::from_fn(share);
        self.widest = (0..COORDINATES).fold(0, |b, k| if shares[k] > shares[b] { k } else { b });
        let here = &self.joints[self.middle - self.first_fine].sum;
        let turn = |i: usize| {
            if i == cable {
                return 0.0;
            }
            let by_eliminated = (self.slope[i] / self.slope[cable]).abs() * here[cable].radius();
            let reach = here[i].radius() + by_eliminated;
            prover.turn(balance, i, self.center[i], reach)
        };
        let turns: [f64; CABLES] = std::array::from_fn(turn);
        self.bent = (0..CABLES).fold(cable, |b, i| if turns[i] > turns[b] { i } else { b });
    }

    fn others(&self) -> impl Iterator<Item = usize> + use<> {
        let cable = self.view.seed.eliminated;
        (0..CABLES).filter(move |i| *i != cable)
    }

    /// The proof for the patch, or for parts of it, cut so many times.
    fn prove_in_patches(&self, cuts: u8) -> Result<u8, Gap> {
        let View { prover, region, seed, steps, .. } = self.view;
        let gap = match self.prove() {
            Ok(steps) => return Ok(steps),
            Err(gap) => gap,
        };
        let cable = seed.eliminated;
        if cuts == 0 || self.bent == cable {
            return Err(gap);
        }
        // In the coordinate of the bent cable.
        let units = [(self.slope[self.bent] / self.slope[cable]).abs(), 1.0];
        let normals = [cable, self.bent].map(|row| self.by_pose.each_ref().map(|by| by[row]));
        let mut most = 1;
        for half in self.patch.halves(region, normals, units) {
            if half.is_empty(region) {
                continue;
            }
            let balance = prover.balance(&half.middle).ok_or(gap)?;
            let (center, at_center) =
                prover.lead(&balance, seed, *steps).ok_or(Gap::TooManySteps)?;
            let frame = Frame::new(self.view, &half, &center, &at_center).ok_or(gap)?;
            most = most.max(frame.prove_in_patches(cuts - 1)?);
        }
        Ok(most)
    }

    /// What the tangents at `from`, taken at `at`, miss of the curves at `to`; through `A`.
    fn missed(
        &self,
        from: &[Option<Reach>],
        at: &[Interval; CABLES],
        to: &[Interval; CABLES],
        errors: &[Interval; CABLES],
    ) -> Option<Vector6<Interval>> {
        let (curves, sights) = (&self.view.prover.curves, &self.view.sights);
        let mut left_n = Vector6::zeros();
        for i in self.others() {
            let sight = &sights[i];
            let error = errors[i];
            let here = from[i].as_ref()?;
            let there = curves.hung(i, sight, to[i])?;
            let between = curves.reach(i, sight, at[i].hull(to[i]))?;
            let plain = there.force_n - here.force_n + here.by_chart_n * error;
            let bent = between.bend_n * (error.square() * Interval::point(0.5));
            left_n += sight.wrench_n(&both(&plain, &bent)?);
        }
        Some(self.inverse.times(&left_n))
    }

    /// What arithmetic in f32 may add in a step from there with these errors.
    fn rounding(
        &self,
        from: &[Option<Reach>],
        eliminated_n: f64,
        errors: &[Interval; CABLES],
    ) -> Vector6<f64> {
        let View { prover, sights, .. } = self.view;
        let mut wrench_n = 0.0;
        for i in 0..CABLES {
            let (force_n, step_n) = match &from[i] {
                // The step is about as long as the error, and its matrix is rounded, too.
                Some(at) => (
                    size(&at.force_n).high(),
                    size(&at.by_chart_n).high() * errors[i].magnitude() * 4.0,
                ),
                // What its last step along the curve leaves out is of the size of a rounding.
                None => (2.0 * eliminated_n, 0.0),
            };
            let plane_m = F32_PLANE * (prover.size_m + sights[i].x_m.high());
            let swing_n_m = force_n / sights[i].x_m.low() * 2.0;
            wrench_n += F32_ROUNDINGS * (force_n + step_n) + plane_m * swing_n_m;
        }
        self.inverse.per_newton * (F32 * wrench_n)
    }

    /// The step from anywhere in `at`; `None` where it may not lead to one place.
    fn stage(&self, at: &[Interval; CABLES]) -> Option<Stage> {
        let View { prover, sights, seed, .. } = self.view;
        let cable = seed.eliminated;
        let mut reach = Vec::with_capacity(CABLES);
        let mut columns = Columns::default();
        for i in 0..CABLES {
            if i == cable {
                reach.push(None);
                continue;
            }
            let here = prover.curves.reach(i, &sights[i], at[i])?;
            columns.set(i, &sights[i].wrench_n(&here.by_chart_n));
            reach.push(Some(here));
        }
        let center = self.center.map(Interval::point);
        let errors = std::array::from_fn(|i| at[i] - center[i]);
        let missed = self.missed(&reach, at, &center, &errors)?;
        let rounding = self.rounding(&reach, self.pieces[self.middle].force_n, &errors);
        let apart = missed.map(Interval::magnitude) + rounding;

        // Of each piece |y| is bounded if `q` is on it.
        let row = self.defect(&columns, &Vector6::zeros()).row(cable).transpose();
        let fed = |piece: &Piece| {
            let mut fed = self.defect(&columns, &piece.ratio);
            fed.fill_row(cable, 0.0);
            fed
        };
        let unit = self.inverse.per_newton[cable] * F32 * F32_ROUNDINGS;
        let others =
            |v: &dyn Fn(usize) -> f64| Vector6::from_fn(|i, _| if i == cable { 0.0 } else { v(i) });
        let bound = |piece: &Piece| {
            let right = others(&|i| {
                apart[i] + piece.ratio[i].abs() * apart[cable] + piece.swept[i].magnitude()
            });
            fed_back(&fed(piece), &right)
        };
        // The left side of the one equation, and its slope, where that could be zero.
        let plain = self.defect(&columns, &Vector6::zeros());
        let value = |piece: &Piece| {
            let right = others(&|i| apart[i] + piece.sum[i].magnitude());
            let rooms = [fed_back(&plain, &right), bound(piece)];
            let room =
                rooms.into_iter().flatten().map(|y| row.dot(&y)).fold(f64::INFINITY, f64::min);
            let room = room + apart[cable] + 2.0 * unit * piece.force_n;
            piece.sum[cable] + Interval::symmetric(room * UPWARDS)
        };
        let slope = |piece: &Piece| {
            let right = others(&|i| piece.swept_slope[i]);
            let room = fed_back(&fed(piece), &right).map_or(f64::INFINITY, |y| row.dot(&y));
            let room = room + unit * piece.slope_n;
            piece.slope[cable] + Interval::symmetric(room * UPWARDS)
        };
        let joint =
            |number: usize| self.joints.get(number.checked_sub(self.first_fine)?).map(value);
        // Where it may end.
        let rises = |number: usize| self.pieces.get(number).is_some_and(|p| slope(p).low() > 0.0);
        let mut last = self.middle;
        loop {
            let end = rises(last).then(|| joint(last + 1)).flatten()?;
            if end.low() > 0.0 {
                break;
            }
            last += 1;
        }
        let mut first = self.middle.checked_sub(1)?;
        loop {
            let end = rises(first).then(|| joint(first)).flatten()?;
            if end.high() < 0.0 {
                break;
            }
            first = first.checked_sub(1)?;
        }
        // There the sign tells the side from anywhere else, too.
        if !((0..first).all(rises) && (last + 1..self.pieces.len()).all(rises)) {
            return None;
        }

        let mut to: Option<[Interval; CABLES]> = None;
        for piece in &self.pieces[first..=last] {
            let turned = fed(piece) * bound(piece)?;
            let here = std::array::from_fn(|i| {
                if i == cable {
                    return Interval::zero();
                }
                let ratio = piece.ratio[i];
                let room = turned[i] + rounding[i] + ratio.abs() * rounding[cable];
                center[i] - piece.swept[i] + missed[i] - Interval::point(ratio) * missed[cable]
                    + Interval::symmetric(room * UPWARDS)
            });
            to = Some(match to {
                None => here,
                Some(to) => std::array::from_fn(|i| to[i].hull(here[i])),
            });
        }
        Some(Stage { reach, columns, first, last, to: to? })
    }

    /// Bound of `|A M - I|`, column `e` zero, after row `e` times the factors was taken from the others.
    fn defect(&self, columns: &Columns, ratio: &Vector6<f64>) -> Matrix6<f64> {
        let cable = self.view.seed.eliminated;
        let matrix = self.inverse.matrix - ratio * self.inverse.matrix.row(cable);
        let mut defect = matrix * columns.middle;
        for i in self.others() {
            defect[(i, i)] -= 1.0;
        }
        // Seven roundings of a sum of six products, and those of the matrix.
        let sizes = self.inverse.sizes + ratio.abs() * self.inverse.sizes.row(cable);
        let rounding = columns.middle.abs() * (12.0 * f64::EPSILON);
        (defect.abs() + matrix.abs() * columns.radius + sizes * rounding) * UPWARDS
    }

    /// The errors after a step, from what the tangents miss; and that of the eliminated force, N.
    fn errors(
        &self,
        columns: &Columns,
        pieces: &[Piece],
        missed: &Vector6<Interval>,
        rounding: &Vector6<f64>,
    ) -> Option<(Vector6<f64>, f64)> {
        let cable = self.view.seed.eliminated;
        let rise = |piece: &Piece| piece.slope[cable].low();
        if !pieces.iter().all(|piece| rise(piece) > 0.0) {
            return None;
        }
        let most = |size: &dyn Fn(&Piece) -> f64| {
            let ratios = pieces.iter().map(|piece| size(piece) / rise(piece));
            ratios.fold(0.0, f64::max) * UPWARDS
        };
        let ratio = pieces[pieces.len() / 2].ratio;
        let pull = Vector6::from_fn(|i, _| {
            let factor = Interval::point(ratio[i]);
            let off = |p: &Piece| (p.slope[i] - factor * p.slope[cable]).magnitude();
            if i == cable { 0.0 } else { most(&off) }
        });
        let row = self.defect(columns, &Vector6::zeros()).row(cable).into_owned();
        let mut fed = self.defect(columns, &ratio) + pull * row;
        fed.fill_row(cable, 0.0);
        let alone = missed[cable].magnitude() + rounding[cable];
        let right = Vector6::from_fn(|i, _| {
            if i == cable {
                return 0.0;
            }
            let swept = missed[i] - Interval::point(ratio[i]) * missed[cable];
            swept.magnitude() + rounding[i] + ratio[i].abs() * rounding[cable] + pull[i] * alone
        });
        let errors = fed_back(&fed, &right)?;
        let along = (alone + row.transpose().dot(&errors)) * UPWARDS;
        Some((errors, along * most(&|piece| piece.slope_n)))
    }

    /// The boxes of the solutions, and the step from there.
    fn solution(&self) -> Result<([Interval; CABLES], Stage), Gap> {
        let mut room = self.center.map(Interval::point);
        for attempt in 0..=ROOM_ATTEMPTS {
            let stage = self.stage(&room).ok_or(Gap::Unproven)?;
            let to = stage.to;
            if attempt > 0 && self.others().all(|i| to[i].is_inside(room[i])) {
                return Ok((to, self.stage(&to).ok_or(Gap::Unproven)?));
            }
            room = to.map(|to| Interval::around(to.middle(), ROOM * to.radius() + LEAST_RADIUS));
        }
        Err(Gap::Unproven)
    }

    /// The proof for all of the patch at once; the steps that it takes.
    fn prove(&self) -> Result<u8, Gap> {
        let View { sights, seed, steps, .. } = self.view;
        let cable = seed.eliminated;
        let (solutions, there) = self.solution()?;
        let at = |i: usize| there.reach[i].as_ref();
        let of = |value: &dyn Fn(&Reach) -> f64| Vector6::from_fn(|i, _| at(i).map_or(0.0, value));
        // It is the only one: two would be closer together than they are.
        let widths =
            Vector6::from_fn(
                |i, _| {
                    if i == cable { 0.0 } else { 2.0 * solutions[i].radius() * UPWARDS }
                },
            );
        let mut bent_n = Vector6::zeros();
        for i in self.others() {
            let bend_n = at(i).ok_or(Gap::Unproven)?.bend_n;
            let half_square = Interval::new(0.0, 0.5 * widths[i] * widths[i] * UPWARDS);
            bent_n += sights[i].wrench_n(&(bend_n * half_square));
        }
        let bent = self.inverse.times(&bent_n);
        let pieces = &self.pieces[there.first..=there.last];
        let none = Vector6::zeros();
        let (closer, _) = self.errors(&there.columns, pieces, &bent, &none).ok_or(Gap::Unproven)?;
        if !self.others().all(|i| closer[i] < widths[i]) {
            return Err(Gap::Unproven);
        }

        // From the seed.
        let sum_n = of(&|reach| size(&reach.force_n).low()).sum();
        let slopes_n = of(&|reach| size(&reach.by_chart_n).high());
        let mut iterate = seed.charts.map(Interval::point);
        let mut errors: [Interval; CABLES] = std::array::from_fn(|i| iterate[i] - solutions[i]);
        for done in 1..=*steps {
            let stage = self.stage(&iterate).ok_or(Gap::TooManySteps)?;
            let missed = self
                .missed(&stage.reach, &iterate, &solutions, &errors)
                .ok_or(Gap::TooManySteps)?;
            let pieces = &self.pieces[stage.first.min(there.first)..=stage.last.max(there.last)];
            let eliminated_n = pieces.iter().map(|p| p.force_n).fold(0.0, f64::max);
            let rounding = self.rounding(&stage.reach, eliminated_n, &errors);
            let after = self.errors(&stage.columns, pieces, &missed, &rounding);
            let (after, eliminated_n) = after.ok_or(Gap::TooManySteps)?;
            let off_n = self.others().map(|i| slopes_n[i] * after[i]).fold(eliminated_n, f64::max);
            if off_n < TOLERANCE * sum_n {
                return Ok(done);
            }
            iterate = std::array::from_fn(|i| {
                errors[i] = Interval::symmetric(after[i]);
                let near = solutions[i] + errors[i];
                near.intersection(stage.to[i]).unwrap_or(near)
            });
        }
        Err(Gap::TooManySteps)
    }
}

/// The wrenches of the tangents of five cables, by middle and radius; column `e` is zero.
#[derive(Default)]
struct Columns {
    middle: Matrix6<f64>,
    radius: Matrix6<f64>,
}

impl Columns {
    fn set(&mut self, cable: usize, column: &Vector6<Interval>) {
        self.middle.set_column(cable, &column.map(Interval::middle));
        self.radius.set_column(cable, &column.map(Interval::radius));
    }
}

/// `A`, and what is needed to multiply with it.
struct Inverse {
    matrix: Matrix6<f64>,
    sizes: Matrix6<f64>,
    /// What 1 N in each row of the equations makes in each row at most.
    per_newton: Vector6<f64>,
}

impl Inverse {
    /// The inverse at a solution, with the column of a cable replaced by the unit vector across all others.
    fn new(balance: &Balance<f64>, at: &ChartStep<f64>, cable: usize) -> Option<Self> {
        let across = at.elimination().inverse().row(cable).transpose();
        let mut columns = Matrix6::zeros();
        for i in 0..CABLES {
            let column = balance.planes()[i].wrench_n(&at.points[i].force_by_chart_n);
            columns.set_column(i, &column);
        }
        columns.set_column(cable, &(across / across.norm()));
        let matrix = Elimination::new(&columns)?.inverse();
        let sizes = matrix.abs();
        Some(Self { matrix, sizes, per_newton: sizes * Vector6::repeat(1.0) })
    }

    /// The products with what changes with each coordinate of the pose.
    fn rows(&self, by_pose_n: &Rows) -> Rows {
        by_pose_n.each_ref().map(|column| self.times(column))
    }

    /// The product with a vector of intervals, by its middle and radius.
    fn times(&self, vector: &Vector6<Interval>) -> Vector6<Interval> {
        // A sum of six products is off by at most seven units of the sum of their sizes.
        const ROUNDING: f64 = 8.0 * f64::EPSILON;
        let middle = vector.map(Interval::middle);
        let radius = vector.map(Interval::radius) + middle.abs() * ROUNDING;
        let (middle, radius) = (self.matrix * middle, self.sizes * radius);
        let least = f64::MIN_POSITIVE;
        Vector6::from_fn(|i, _| Interval::around(middle[i], radius[i] * UPWARDS + least))
    }
}

/// A bound on all `e >= 0` with `e <= right + defect e`; `None` when that does not bound them.
fn fed_back(defect: &Matrix6<f64>, right: &Vector6<f64>) -> Option<Vector6<f64>> {
    let mut weights = *right;
    for _ in 0..FEEDBACK {
        weights = right + defect * weights;
    }
    // A little more, so that what comes from others only has something of its own as well.
    let right = right + weights * SHARE + Vector6::repeat(f64::MIN_POSITIVE);
    for _ in 0..FEEDBACK {
        weights = right + defect * weights;
    }
    let fed = defect * weights;
    // e <= weights max(right/(weights - defect weights)), where the difference is positive
    let mut factor = 0.0_f64;
    for i in 0..CABLES {
        let kept = weights[i] - fed[i] * UPWARDS;
        let is_kept = kept > 0.0 && kept.is_finite();
        if !is_kept {
            return None;
        }
        factor = factor.max(right[i] / kept);
    }
    let bound = weights * (factor * UPWARDS);
    Some((right + defect * bound) * UPWARDS)
}
