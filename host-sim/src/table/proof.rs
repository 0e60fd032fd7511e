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
//! leaves zero on both sides, and that its slope `det` is of the right sign there. (On a piece the first lines are used
//! less multiples of the second. What is shown to be no zero with `K` and `R` is none with `t K` and `t R` either, for
//! `t` from 0 to 1, nor is `det (1 + t K)`, so that the signs are those of `t = 0`.) So `q` is found by any search that
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
//! # Poses
//!
//! What changes with the pose, which is the sum `S(P, pc)`, the matrix `M` and the slope of the eliminated cable, is
//! enclosed by the mean value theorem: as at the middle of the patch, and for each coordinate a derivative, summed over
//! the cables and multiplied with `A` before its size is taken. A turn that is hardly any is enclosed as it stands.
//!
//! # Folds
//!
//! Close to a fold the slope of the second line is zero not far from the solution. There the search in the bracket goes
//! by the slope, too: where the left side falls, it is past the fold ([`Start::fold_at_slack_end`]). So each piece past
//! the solution, towards that end, must have the sign of its side or fall. The poses that are too close to the fold, or
//! beyond it, are cut off by a plane: over a [`Patch`] the sums are bounded with what the plane tells.

use cdpr_core::chart::{ChartStep, Start};
use cdpr_core::statics::Balance;
use cdpr_core::table::{COORDINATES, Gap, TOLERANCE};
use cdpr_core::{CABLES, Load, Robot};
use nalgebra::{Matrix6, Vector6};
use num_traits::Zero;

use super::Model;
use super::curve::{Curves, Reach, both, size};
use super::patch::Patch;
use super::place::{ByPose, Likeness, Point, Sight, largest, pose};
use super::sums::{Inverse, Piece, Sums, UPWARDS, View};
use crate::interval::Interval;

/// Newton steps at the middle of a box, to find the solution there.
const SETTLING_STEPS: usize = 30;
/// A step that changes no coordinate by more than this is the last (relative, and absolute near zero).
const SETTLED: f64 = 1e-11;
/// Radii of the box of a solution, in units of what a step needs: how they grow, and how often.
const ROOM: f64 = 1.1;
const ROOM_ATTEMPTS: usize = 5;
const LEAST_RADIUS: f64 = 1e-9;
/// Times that the errors of a step are fed back through `A M - I`.
const FEEDBACK: usize = 6;
/// And what is added to each for it.
const SHARE: f64 = 0.01;
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
    pub(super) likeness: Likeness,
    pub(super) curves: Curves,
    /// Largest coordinate of an anchor, m.
    size_m: f64,
}

/// What is known of a box.
#[derive(Clone, Debug)]
pub(super) enum Verdict {
    /// The seed leads to the solution in so many steps.
    Proven { steps: u8 },
    /// At the middle of the patch it does not.
    Refuted,
    /// Not proven; a smaller box may be. The coordinate in which to halve it.
    Open { split: usize, gap: Gap },
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

    /// A step from coordinates.
    pub(super) fn step(
        &self,
        balance: &Balance<f64>,
        charts: &[f64; CABLES],
    ) -> Option<ChartStep<f64>> {
        ChartStep::new(&self.robot, balance, charts).ok()
    }

    /// The solution at a pose that Newton's method leads to from one nearby, if it is of the same sign.
    pub(super) fn nearby(
        &self,
        at: &Point,
        charts: &[f64; CABLES],
        is_positive: bool,
        steps: usize,
    ) -> Option<[f64; CABLES]> {
        let balance = self.balance(at)?;
        let (charts, step) = self.settle(&balance, charts, steps)?;
        (step.elimination().is_positive() == is_positive).then_some(charts)
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
            let step = self.step(balance, &charts)?;
            let settled = (0..CABLES)
                .all(|i| (step.charts[i] - charts[i]).abs() <= SETTLED * (1.0 + charts[i].abs()));
            if settled {
                return Some((charts, step));
            }
            charts = step.charts;
        }
        None
    }

    /// Where a seed leads in so many steps, and the step from there, if that is as short as a table asks for.
    fn reached(
        &self,
        balance: &Balance<f64>,
        seed: &Start<f64>,
        steps: u8,
    ) -> Option<([f64; CABLES], ChartStep<f64>)> {
        let mut reached = *seed;
        for _ in 0..steps {
            reached = reached.step(&self.robot, balance).ok()?;
        }
        let step = self.step(balance, &reached.charts)?;
        let is_of_sheet = step.elimination().is_positive() == seed.is_positive;
        let is_near = is_near(&step, &reached.charts, &step.charts);
        (is_of_sheet && is_near).then_some((reached.charts, step))
    }

    /// Whether a seed seems to lead to a solution in so many steps at a pose.
    pub(super) fn leads(&self, at: &Point, seed: &Start<f64>, steps: u8) -> bool {
        let balance = self.balance(at);
        balance.and_then(|balance| self.reached(&balance, seed, steps)).is_some()
    }

    /// The solution that a seed leads to in so many steps.
    pub(super) fn lead(
        &self,
        balance: &Balance<f64>,
        seed: &Start<f64>,
        steps: u8,
    ) -> Option<([f64; CABLES], ChartStep<f64>)> {
        let (reached, near) = self.reached(balance, seed, steps)?;
        let (center, step) = self.settle(balance, &near.charts, SETTLING_STEPS)?;
        let is_of_sheet = step.elimination().is_positive() == seed.is_positive;
        (is_of_sheet && is_near(&step, &reached, &center)).then_some((center, step))
    }

    /// The solution at a pose that a seed leads to.
    pub(super) fn led(&self, at: &Point, seed: &Start<f64>, steps: u8) -> Option<[f64; CABLES]> {
        Some(self.lead(&self.balance(at)?, seed, steps)?.0)
    }

    /// Examines a patch; `steps` is what the seed may take at most.
    pub(super) fn examine(&self, patch: &Patch, seed: &Start<f64>, steps: u8) -> Verdict {
        let Some(balance) = self.balance(&patch.middle) else { return Verdict::Refuted };
        let Some((center, at_center)) = self.lead(&balance, seed, steps) else {
            return Verdict::Refuted;
        };
        let view = View::new(self, patch, seed, steps);
        let frame = view.as_ref().and_then(|view| Frame::new(view, &balance, &center, &at_center));
        let Some(frame) = frame else {
            // Nothing is known: as far as an attachment moves.
            let extent = |k: usize| {
                patch.region.extent(k) * if k < 3 { 1.0 } else { self.likeness.moment_arm_m() }
            };
            let split = largest(0..COORDINATES, extent);
            return Verdict::Open { split, gap: Gap::SingularCable };
        };
        match frame.prove() {
            Ok(steps) => Verdict::Proven { steps },
            Err(gap) => Verdict::Open { split: frame.widest(), gap },
        }
    }
}

/// Whether the forces at two sets of coordinates are as close as a table asks for, by the slopes of a step.
fn is_near(step: &ChartStep<f64>, a: &[f64; CABLES], b: &[f64; CABLES]) -> bool {
    let (mut off_n, mut forces_n) = (0.0_f64, 0.0);
    for (i, point) in step.points.iter().enumerate() {
        off_n = off_n.max(point.force_by_chart_n.lp_norm(1) * (a[i] - b[i]).abs());
        forces_n += point.state.force_n.lp_norm(1);
    }
    off_n <= TOLERANCE * forces_n // false for NaN
}

/// A patch, seen from the solution at its middle.
struct Frame<'a> {
    view: &'a View<'a>,
    center: [f64; CABLES],
    /// What the cables see of its middle.
    sights: Vec<Sight>,
    /// `A`.
    inverse: Inverse,
    /// From the taut end; fine ones around the solution, rough ones beyond.
    pieces: Vec<Piece>,
    /// The lower ends of the fine pieces, and the upper one of the last of them.
    joints: Vec<Piece>,
    /// Numbers of the first fine piece, and of that which begins at the solution.
    first_fine: usize,
    middle: usize,
    /// How the sum changes with the pose there.
    by_pose: [Vector6<f64>; COORDINATES],
    /// Slopes of the cables there, N.
    slopes_n: [f64; CABLES],
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
        balance: &Balance<f64>,
        center: &[f64; CABLES],
        at_center: &ChartStep<f64>,
    ) -> Option<Self> {
        let cable = view.seed.eliminated;
        let inverse = Inverse::new(balance, at_center, cable)?;
        let sums = Sums::new(view, center, &inverse)?;
        let (at, bracket) = (center[cable], view.seed.bracket);
        let is_inside = at > bracket[0] && at < bracket[1];
        if !is_inside {
            return None;
        }
        let exact = sums.exactly(at)?;
        let (here, rows) = sums.joint(&exact, at)?;
        let tangent_n = balance.planes()[cable].wrench_n(&at_center.points[cable].force_by_chart_n);
        let rise = inverse.matrix.row(cable).transpose().dot(&tangent_n);
        let known = here.sum[cable].radius() / rise;
        if !(known > 0.0 && known.is_finite()) {
            return None;
        }
        let (down, down_joints, low) = sums.march(at, -known, bracket[0])?;
        let (up, up_joints, high) = sums.march(at, known, bracket[1])?;
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

        let sights = sums.sights;
        Some(Self {
            view,
            center: *center,
            sights,
            inverse,
            pieces,
            joints,
            first_fine,
            middle,
            by_pose: rows.map(|row| row.map(Interval::middle)),
            slopes_n: at_center.points.map(|point| point.force_by_chart_n.norm()),
        })
    }

    /// The coordinate of the pose that moves the forces most.
    fn widest(&self) -> usize {
        let cable = self.view.seed.eliminated;
        // Row `e` is in newtons.
        let slope_n = |i: usize| if i == cable { 1.0 } else { self.slopes_n[i] };
        let moved_n =
            |k: usize| -> f64 { (0..CABLES).map(|i| self.by_pose[k][i].abs() * slope_n(i)).sum() };
        largest(0..COORDINATES, |k| self.view.patch.region.extent(k) * moved_n(k))
    }

    fn others(&self) -> impl Iterator<Item = usize> + use<> {
        let cable = self.view.seed.eliminated;
        (0..CABLES).filter(move |i| *i != cable)
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

    /// What the wrench of a cable is off by in f32, in units of its force: its curve, and its plane.
    fn roundings(&self, cable: usize) -> f64 {
        let View { prover, sights, .. } = self.view;
        let x_m = sights[cable].x_m;
        F32_ROUNDINGS + F32_PLANE * (prover.size_m + x_m.high()) * 2.0 / x_m.low()
    }

    /// What arithmetic in f32 may add in a step from there with these errors, and the end of the search.
    fn rounding(
        &self,
        from: &[Option<Reach>],
        eliminated: &[Piece],
        errors: &[Interval; CABLES],
    ) -> Vector6<f64> {
        let most = |size: fn(&Piece) -> f64| eliminated.iter().map(size).fold(0.0, f64::max);
        let mut wrench_n = most(|piece| piece.left_n) / F32;
        for i in 0..CABLES {
            let force_n = match &from[i] {
                // The step is about as long as the error, and its matrix is rounded, too.
                Some(at) => {
                    let step_n = size(&at.by_chart_n).high() * errors[i].magnitude() * 4.0;
                    size(&at.force_n).high() + step_n
                }
                // What its last step along the curve leaves out is of the size of a rounding.
                None => 2.0 * most(|piece| piece.force_n),
            };
            wrench_n += self.roundings(i) * force_n;
        }
        self.inverse.per_newton * (F32 * wrench_n)
    }

    /// The curves of five cables at `at`, and their tangents.
    fn tangents(&self, at: &[Interval; CABLES]) -> Option<(Vec<Option<Reach>>, Columns)> {
        let View { prover, patch, sights, along, seed, .. } = self.view;
        let mut reach = Vec::with_capacity(CABLES);
        let mut columns = Columns::default();
        for i in 0..CABLES {
            if i == seed.eliminated {
                reach.push(None);
                continue;
            }
            let all = prover.curves.reach(i, &sights[i], at[i])?;
            let tangent_n = prover.curves.tangent(i, &self.sights[i], at[i], &all.bend_n)?;
            columns.set(i, &self.inverse, &self.sights[i].wrench_n(&tangent_n));
            let mut turning_n = [Vector6::zeros(); COORDINATES];
            sights[i].add_moved(&mut turning_n, &all.by_chart_n, &all.turn_n, *along);
            columns.turn(i, &self.inverse.rows(&turning_n, *along), patch);
            reach.push(Some(all));
        }
        Some((reach, columns))
    }

    /// The step from anywhere in `at`; `None` where it may not lead to one place.
    fn stage(&self, at: &[Interval; CABLES]) -> Option<Stage> {
        let seed = self.view.seed;
        let cable = seed.eliminated;
        let (reach, columns) = self.tangents(at)?;
        let center = self.center.map(Interval::point);
        let errors = std::array::from_fn(|i| at[i] - center[i]);
        let missed = self.missed(&reach, at, &center, &errors)?;
        let rounding = self.rounding(&reach, &self.pieces[self.middle..=self.middle], &errors);
        let apart = missed.map(Interval::magnitude) + rounding;

        // Of each piece |y| is bounded if `q` is on it.
        let plain = self.defect(&columns, &Vector6::zeros());
        let row = plain.row(cable).transpose();
        let fed = |piece: &Piece| {
            let mut fed = self.defect(&columns, &piece.ratio);
            fed.fill_row(cable, 0.0);
            fed
        };
        let per_newton = self.inverse.per_newton[cable];
        let rounded = |i: usize| per_newton * F32 * self.roundings(i);
        let unit = rounded(cable);
        // What is rounded in the tangents of the others.
        let matrix_unit = Vector6::from_fn(|i, _| {
            let slope_n = reach[i].as_ref().map_or(0.0, |at| size(&at.by_chart_n).high());
            rounded(i) * slope_n
        });
        let others =
            |v: &dyn Fn(usize) -> f64| Vector6::from_fn(|i, _| if i == cable { 0.0 } else { v(i) });
        let bound = |piece: &Piece| {
            let right = others(&|i| {
                apart[i] + piece.ratio[i].abs() * apart[cable] + piece.swept[i].magnitude()
            });
            fed_back(&fed(piece), &right)
        };
        // The left side of the one equation, and its slope, where that could be zero. Mostly it is enough to know what
        // the others weigh in it at most, whatever the piece; where it is not, what is fed back on the piece is swept.
        let weights = self.weights(&plain, &(row + matrix_unit));
        let open = |sum: Interval, own: f64, right: &dyn Fn(usize) -> f64| {
            let room = weights.map_or(f64::INFINITY, |weights| weights.dot(&others(right)));
            sum + Interval::symmetric((room + own) * UPWARDS)
        };
        let value = |piece: &Piece| {
            let own = apart[cable] + 2.0 * unit * piece.force_n + per_newton * piece.left_n;
            let right = |i: usize| apart[i] + piece.sum[i].magnitude();
            let rough = open(piece.sum[cable], own, &right);
            if rough.mignitude() > 0.0 {
                return rough;
            }
            let room = bound(piece).map_or(f64::INFINITY, |y| row.dot(&y));
            piece.sum[cable] + Interval::symmetric((room + own) * UPWARDS)
        };
        let slope = |piece: &Piece| {
            let own = unit * piece.slope_n;
            let rough = open(piece.slope[cable], own, &|i| piece.slope[i].magnitude());
            if rough.mignitude() > 0.0 {
                return rough;
            }
            let right = others(&|i| piece.swept_slope[i]);
            let room = fed_back(&fed(piece), &right)
                .map_or(f64::INFINITY, |y| row.dot(&y) + matrix_unit.dot(&y));
            piece.slope[cable] + Interval::symmetric((room + own) * UPWARDS)
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
        // From anywhere else the search goes there. Beyond, the sign stays where it rises; and towards a fold it is
        // enough that it has the sign, or falls.
        let goes = |number: usize, way: f64, has_sign: &mut bool| {
            let piece = &self.pieces[number];
            let slope = slope(piece);
            if (way > 0.0) != seed.fold_at_slack_end {
                return slope.low() > 0.0;
            }
            let value = value(piece);
            let is_certain = if way > 0.0 { value.low() > 0.0 } else { value.high() < 0.0 };
            *has_sign = is_certain || *has_sign && slope.low() > 0.0;
            *has_sign || slope.high() < 0.0
        };
        let (mut below, mut above) = (true, true);
        if !((0..first).rev().all(|number| goes(number, -1.0, &mut below))
            && (last + 1..self.pieces.len()).all(|number| goes(number, 1.0, &mut above)))
        {
            return None;
        }

        let mut to: Option<[Interval; CABLES]> = None;
        for piece in &self.pieces[first..=last] {
            let turned = fed(piece) * bound(piece)?;
            let here = self.after(piece, &turned, &missed, &rounding);
            to = Some(to.map_or(here, |to| std::array::from_fn(|i| to[i].hull(here[i]))));
        }
        Some(Stage { reach, columns, first, last, to: to? })
    }

    /// What the five others weigh at most in a sum with these weights, when each feeds back through `defect`.
    fn weights(&self, defect: &Matrix6<f64>, weights: &Vector6<f64>) -> Option<Vector6<f64>> {
        let mut back = defect.transpose();
        back.fill_column(self.view.seed.eliminated, 0.0);
        fed_back(&back, weights)
    }

    /// Where the five others are after a step, with the eliminated cable on a piece; from what the matrix turns there.
    fn after(
        &self,
        piece: &Piece,
        turned: &Vector6<f64>,
        missed: &Vector6<Interval>,
        rounding: &Vector6<f64>,
    ) -> [Interval; CABLES] {
        let cable = self.view.seed.eliminated;
        std::array::from_fn(|i| {
            if i == cable {
                return Interval::zero();
            }
            let ratio = piece.ratio[i];
            let room = turned[i] + rounding[i] + ratio.abs() * rounding[cable];
            Interval::point(self.center[i]) - piece.swept[i] + missed[i]
                - Interval::point(ratio) * missed[cable]
                + Interval::symmetric(room * UPWARDS)
        })
    }

    /// Bound of `|A M - I|`, column `e` zero, after row `e` times the factors was taken from the others.
    fn defect(&self, columns: &Columns, ratio: &Vector6<f64>) -> Matrix6<f64> {
        let cable = self.view.seed.eliminated;
        let swept = |matrix: &Matrix6<f64>| matrix - ratio * matrix.row(cable);
        let mut bound = swept(&columns.defect).abs();
        bound += swept(&self.inverse.matrix).abs() * columns.radius;
        for turned in columns.turned.iter().take(self.view.along.count()) {
            bound += swept(turned).abs();
        }
        bound += columns.blur + ratio.abs() * columns.blur.row(cable);
        bound * UPWARDS
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
            let rounding = self.rounding(&stage.reach, pieces, &errors);
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

/// `A M - 1` over a patch, for the tangents of five cables; column `e` is zero.
#[derive(Default)]
struct Columns {
    /// At the middle of the patch, with the middles of the tangents.
    defect: Matrix6<f64>,
    /// Radii of the wrenches of the tangents there.
    radius: Matrix6<f64>,
    /// How far each coordinate of the pose turns it at most, by middle.
    turned: [Matrix6<f64>; COORDINATES],
    /// The radii of that, and all roundings, of what is made of a row and as much again of row `e`, too.
    blur: Matrix6<f64>,
}

impl Columns {
    /// Sets a column at the middle of the patch.
    fn set(&mut self, cable: usize, inverse: &Inverse, wrench_n: &Vector6<Interval>) {
        let middle = wrench_n.map(Interval::middle);
        let mut defect = inverse.matrix * middle;
        defect[cable] -= 1.0;
        self.defect.set_column(cable, &defect);
        self.radius.set_column(cable, &wrench_n.map(Interval::radius));
        // Ten roundings of a sum of six products that is about 1 or 0, and of the matrix.
        let blur = inverse.sizes * middle.abs() * (16.0 * f64::EPSILON);
        self.blur.set_column(cable, &blur);
    }

    /// Sets how `A` times it changes with each coordinate.
    fn turn(&mut self, cable: usize, rows: &ByPose, patch: &Patch) {
        let mut blur = self.blur.column_mut(cable);
        for (k, row) in rows.iter().enumerate() {
            let aside = patch.aside(k).magnitude();
            let turned = row.map(Interval::middle) * aside;
            blur += row.map(Interval::radius) * aside + turned.abs() * (4.0 * f64::EPSILON);
            self.turned[k].set_column(cable, &turned);
        }
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
