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
//! start's `p_e` does not matter. `P` runs over a box, and `pc` is the solution at a pose `Pc` of it.
//!
//! How fast a force changes with its coordinate says little where its curve goes straight on. So a tangent is seen along
//! its direction `d_i` at `Pc` and `pc`: `dF_i/dp_i = r_i (d_i + t_i n_i)`, with the rate `r_i` in newtons, `n_i` across
//! `d_i`, and a slant `t_i`. The unknowns are `r_i p_i`, the columns `M_i = G_i (d_i + t_i n_i)`. `A` is close to the
//! inverse of the matrix of these at `Pc` and `pc` whose column `e` is replaced by a unit vector across all others: it
//! stays regular at a fold, and row `e` of it tells what the five others cannot balance.
//!
//! # One step
//!
//! Along a curve that goes straight on the force gets where the other cables want it, however its coordinate does. So
//! what a tangent at `p` misses of the curve at some `u` is told apart: `F_i(u) - F_i(p) = s F_i'(p) + b n_i`. A force by
//! a step `s` along the tangent is as good as that by `u - p`, which it differs from as Newton's method in one unknown
//! does from its root, by `a = p + s - u`; and `b`, across it, is how much the curve turns, times how far it goes.
//!
//! With `y_i = r_i (p'_i - p_i - s_i)`, where `u` is `pc`, `K = A M - 1` (columns other than `e`) and `R = sum G_i b_i n_i`,
//!
//! ```text
//! y_i + (K y)_i = (A R)_i - (A (S(P, pc) + G_e F_e(q)))_i     i not e
//!         (K y)_e = (A R)_e - (A (S(P, pc) + G_e F_e(q)))_e     q = p'_e
//!            p'_i = pc_i + a_i + y_i/r_i                         i not e
//! ```
//!
//! `S(P, pc)` is enclosed by the mean value theorem over the pose. The curve of `e` is walked in short pieces; of the rows
//! `r = A (S + G_e F_e(q)) - A R` on a piece there becomes `u = (1 + K)^-1 r` as the other cables follow: `u_i = -y_i`, and
//! `u_e` is the left side of the one equation that is left. It tells on which pieces `q` may be, with what sign it leaves
//! zero on both sides, and that its slope `((1 + K)^-1 A G_e F_e')_e`, which has the sign of `det`, is of the right sign
//! there. So `q` is found by any search that goes by these signs, however sharp the bend, and `u_i` bounds the others.
//!
//! # The solution
//!
//! Along a chord of its curve the force of a cable changes by `F_i(p_i) - F_i(pc_i) = y_i (d_i + t_i n_i)`, where `t_i` is
//! a mean of the slants in between: of a curve that bends sharply at its end, far less than there. So a solution obeys the
//! equations of a step with `R = 0`, in which only slants are left of the curves. From any coordinates in a box they lead
//! to some `y`; where that is never beyond the chords within the box there is a solution in it for every pose (Brouwer).
//! It is the only one if `det` is of one sign on all pieces for the chords between any two, whose slants are among those
//! of all tangents there: what is between two solutions obeys the same equations with nothing on the right.
//!
//! # Newton's method
//!
//! After a step from `p` the coordinates obey, with `u = p*`, the solution, and `e_i = r_i (p'_i - p_i - s_i)`,
//!
//! ```text
//! sum_(i not e) M_i(P, p_i) e_i + G_e (F_e(q) - F_e(q*)) = sum_(i not e) G_i b_i n_i,      p'_i - p*_i = a_i + e_i/r_i
//! ```
//!
//! The difference on the left is an integral of `F_e'` over pieces on which the slope is positive. So from row `e` of
//! `(1 + K)^-1`, times all of it, that of the slope is known, and with the least slopes how far `q` is from `q*`; and by how
//! much the others follow at most on these pieces, how far they are off for it: no curvature of the eliminated cable
//! enters. `q` is no more pieces from `q*` than make up for that integral.
//!
//! `a` and `b` are enclosed thrice: as they stand; by `F_i''` and how fast the direction of `F_i'` turns over all that lies
//! between iterate and solution; and by how far both change over it at most, where they change most at its end. Beginning
//! with the seed this gives a box for each iterate, to which is added what arithmetic in f32 may do (as what it changes in
//! the equations): forces are off as vectors at the attachments, which the rows of `A` weigh far less than the components
//! of a wrench; these are for sums and eliminations.
//!
//! # Poses
//!
//! What changes with the pose, which is the sum `S(P, pc)`, the matrix `M` and the slope of the eliminated cable, is
//! enclosed by the mean value theorem: as at the middle of the patch, and for each coordinate a derivative, summed over
//! the cables and multiplied with `A` before its size is taken. A turn that is hardly any is enclosed as it stands.
//!
//! So rows are `r = c + m d + o` and the matrix is `K = T d + s`, with how far the pose `d` is aside, from -1 to 1 in each
//! coordinate (rows have a seventh: where on the piece `q` is), and with small `o` and `s` of which only bounds are known.
//! (Rows and matrix are multiplied once more, so that `K` is zero in the middle.) What becomes of them as the others follow
//! is a series,
//!
//! ```text
//! u = r - K u = c + (m - T c) d - T (m - T c) d d + (1 - T d) o + T d T d (m d + o) - (1 - T d) s u - T d T d K u
//! ```
//!
//! in which what is of first and second order in the pose is summed before its size is taken, much of which cancels, and
//! only the rest is bounded by sizes.
//!
//! Where row `e` is zero the others are `u_i - t u_e` for any `t`. The best `t`, for either end of `u_i`, is that of a
//! linear program: so only those poses count at which the eliminated cable is on the piece. With `u` bounded by that the
//! rest is less, if `u_e` is zero. Where a bound that holds in that case only shows that `u_e` is not zero, for no `d`, `o`
//! and `s`, it has the sign of `c_e`, which it is where these are nothing: they can all be taken there without a zero on
//! the way.
//!
//! # Folds
//!
//! Close to a fold the slope of the second line is zero not far from the solution. There the search in the bracket goes
//! by the slope, too: where the left side falls, it is past the fold ([`Start::fold_at_slack_end`]). So each piece past
//! the solution, towards that end, must have the sign of its side or fall. The poses that are too close to the fold, or
//! beyond it, are cut off by a plane: over a [`Patch`] the sums are bounded with what the plane tells.

mod newton;

use std::ops::Range;

use cdpr_core::chart::{ChartStep, Start};
use cdpr_core::statics::Balance;
use cdpr_core::table::{COORDINATES, Gap, TOLERANCE};
use cdpr_core::{CABLES, Load, Robot};
use nalgebra::{Matrix6, Vector2, Vector6};
use num_traits::{One, Zero};

use super::Model;
use super::columns::{Across, Columns};
use super::curve::{Curves, Heading, Reach, across, size};
use super::equations::{Arithmetic, Equations, Errors};
use super::patch::Patch;
use super::place::{Likeness, Point, Sight, largest, pose};
use super::sums::{Course, Inverse, Sums, UPWARDS, View};
use crate::interval::Interval;
use newton::Missed;

/// Newton steps at the middle of a box, to find the solution there.
const SETTLING_STEPS: usize = 30;
/// A step that changes no coordinate by more than this is the last (relative, and absolute near zero).
const SETTLED: f64 = 1e-11;
/// Radii of the box of a solution, in units of what a step needs: how they grow, and how often.
const ROOM: f64 = 1.1;
const ROOM_ATTEMPTS: usize = 5;
const LEAST_RADIUS: f64 = 1e-9;

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

/// Two solutions that differ by less are one: far below the radii within which each is proven to be alone.
const SAME: f64 = 1e-6;

/// Whether two solutions at one pose are the same.
pub(super) fn is_same(here: &[f64; CABLES], there: &[f64; CABLES]) -> bool {
    (0..CABLES).all(|i| (here[i] - there[i]).abs() <= SAME * (1.0 + here[i].abs()))
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
    /// `A`, and what a newton at each attachment, in any direction, makes in each row at most.
    inverse: Inverse,
    per_force: Matrix6<f64>,
    /// The curve of the eliminated cable.
    course: Course<'a>,
    /// How the sum changes with the pose there.
    by_pose: [Vector6<f64>; COORDINATES],
    /// Directions of the tangents there, and what is across them in the rows, for all of the patch.
    directions: [Vector2<f64>; CABLES],
    across: Across,
}

/// The curves of five cables over a box of coordinates.
struct Tangents<'a> {
    /// None of the eliminated one.
    courses: [Option<(Reach, Heading)>; CABLES],
    columns: Columns<'a>,
}

impl Tangents<'_> {
    /// How fast the force of a cable changes along its direction, N; 1 of the eliminated one.
    fn rate_n(&self, cable: usize) -> Interval {
        self.courses[cable].as_ref().map_or(Interval::one(), |(_, heading)| heading.rate_n)
    }
}

/// Where a step leads from anywhere in a box of coordinates.
struct Stage<'a> {
    tangents: Tangents<'a>,
    /// Pieces on which the eliminated cable may be then.
    pieces: Range<usize>,
    /// The other coordinates then.
    to: [Interval; CABLES],
}

/// The solutions of a patch.
struct Solutions {
    charts: [Interval; CABLES],
    /// Pieces on which the eliminated cable may be.
    pieces: Range<usize>,
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
        let (course, by_pose) = sums.course(at_center, balance, center[cable])?;
        let sights = sums.sights;
        let per_force = Matrix6::from_fn(|row, i| {
            view.sights[i].per_newton(&inverse.matrix.row(row).transpose())
        });
        let directions = at_center.points.map(|point| point.force_by_chart_n.normalize());
        let mut in_rows = Across { middle: Matrix6::zeros(), radius: Matrix6::zeros() };
        for (i, direction) in directions.iter().enumerate() {
            let wrench_n = view.sights[i].wrench_n(&across(direction).map(Interval::point));
            let (middle, radius) = inverse.ball(&wrench_n);
            in_rows.middle.set_column(i, &middle);
            in_rows.radius.set_column(i, &radius);
        }
        Some(Self {
            view,
            per_force,
            center: *center,
            sights,
            across: in_rows,
            inverse,
            course,
            by_pose,
            directions,
        })
    }

    /// The coordinate of the pose that moves the forces most.
    fn widest(&self) -> usize {
        let moved_n = |k: usize| self.by_pose[k].abs().sum();
        largest(0..COORDINATES, |k| self.view.patch.region.extent(k) * moved_n(k))
    }

    fn others(&self) -> impl Iterator<Item = usize> + use<> {
        self.view.others()
    }

    /// The curves of five cables at `at`, and their tangents.
    fn tangents(&self, at: &[Interval; CABLES]) -> Option<Tangents<'_>> {
        let View { prover, sights, along, seed, .. } = self.view;
        let mut courses = std::array::from_fn(|_| None);
        let mut columns = Columns::new(&self.inverse, seed.eliminated, *along);
        for i in self.others() {
            let direction = &self.directions[i];
            let (reach, heading) = prover.curves.course(i, &sights[i], at[i], direction)?;
            let (_, at_middle) = prover.curves.course(i, &self.sights[i], at[i], direction)?;
            self.set(&mut columns, (i, at[i]), &heading, (at_middle.slant, Interval::zero()))?;
            columns.round(i, &self.column_rounding(i, &reach, heading.rate_n));
            courses[i] = Some((reach, heading));
        }
        Some(Tangents { courses, columns })
    }

    /// The columns of chords from the center to anywhere in `room`.
    fn chords(&self, room: &[Interval; CABLES]) -> Option<Columns<'_>> {
        let View { prover, sights, along, seed, .. } = self.view;
        let mut columns = Columns::new(&self.inverse, seed.eliminated, *along);
        for i in self.others() {
            let direction = &self.directions[i];
            let course = |sight, at| Some(prover.curves.course(i, sight, at, direction)?.1);
            let (center, here) = (Interval::point(self.center[i]), &self.sights[i]);
            let turned = prover.curves.chord(i, &sights[i], self.center[i], room[i], direction)?;
            let slant = (course(here, center)?.slant, turned);
            self.set(&mut columns, (i, center), &course(&sights[i], center)?, slant)?;
        }
        Some(columns)
    }

    /// Sets the column of a cable that is heading so at a coordinate over the patch, with its slant at the middle of it, and
    /// what is to be added to both.
    fn set(
        &self,
        columns: &mut Columns,
        (cable, at): (usize, Interval),
        heading: &Heading,
        (here, more): (Interval, Interval),
    ) -> Option<()> {
        let View { prover, patch, sights, within, along, .. } = self.view;
        let slant = here + more;
        let middle = heading.vector(Interval::point(slant.middle()));
        let wrench_n = self.sights[cable].wrench_n(&middle);
        columns.set(cable, &wrench_n, (&self.across, slant.radius()));
        let mut turning = [Vector6::zeros(); COORDINATES];
        let mut add = |sight: &Sight, heading: &Heading| {
            let turn = prover.curves.turn(cable, sight, at, heading)?;
            sight.add_moved(&mut turning, &heading.vector(heading.slant + more), &turn, *along);
            Some(())
        };
        for (sights, _) in within {
            let sight = &sights[cable];
            let (_, heading) = prover.curves.course(cable, sight, at, &heading.direction)?;
            add(sight, &heading)?;
        }
        add(&sights[cable], heading)?;
        columns.turn(cable, &self.view.mean(&turning), patch);
        Some(())
    }

    /// What a step obeys with these tangents, what they miss across them, and roundings.
    fn equations<'e>(
        &'e self,
        columns: &'e Columns,
        aside_n: &[Interval; CABLES],
        arithmetic: Arithmetic,
    ) -> Equations<'e> {
        let fold_at_slack_end = self.view.seed.fold_at_slack_end;
        let missed = self.across.times(aside_n);
        Equations::new(columns, &self.course, fold_at_slack_end, missed, arithmetic)
    }

    /// What they obey that miss nothing: chords, in place of the steps of a controller.
    fn exact<'e>(&'e self, columns: &'e Columns) -> Equations<'e> {
        self.equations(columns, &[Interval::zero(); CABLES], Arithmetic::default())
    }

    /// The step from anywhere in `at`; `None` where it may not lead to one place, or not to the solutions as the right side
    /// vanishes.
    fn stage(&self, at: &[Interval; CABLES], solutions: &Solutions) -> Option<Stage<'_>> {
        let cable = self.view.seed.eliminated;
        let tangents = self.tangents(at)?;
        let center = self.center.map(Interval::point);
        let errors = std::array::from_fn(|i| at[i] - center[i]);
        let missed = self.missed(&tangents, at, &center, &errors)?;
        let arithmetic = self.arithmetic(&tangents, &missed, &errors);
        let Missed { aside_n, along } = missed;
        let equations = self.equations(&tangents.columns, &aside_n, arithmetic);
        let pieces = equations.pieces()?;
        equations.leads_to(&pieces).then_some(())?;
        equations.rise_on(&solutions.pieces).then_some(())?;
        let moved = equations.moved(&pieces)?;
        let to = std::array::from_fn(|i| {
            if i == cable {
                return Interval::zero();
            }
            center[i] + along[i] + moved[i] / tangents.rate_n(i)
        });
        Some(Stage { tangents, pieces, to })
    }

    /// The solutions that are on the chords from the center to anywhere in `room`.
    fn found(&self, room: &[Interval; CABLES]) -> Option<Solutions> {
        let View { prover, sights, seed, .. } = self.view;
        let columns = self.chords(room)?;
        let equations = self.exact(&columns);
        let pieces = equations.pieces()?;
        let moved = equations.moved(&pieces)?;
        let mut charts = self.center.map(Interval::point);
        for i in self.others() {
            let reached = |way: f64, moved_n: f64| {
                let (sight, direction) = (&sights[i], &self.directions[i]);
                prover.curves.reached(i, sight, (self.center[i], way), moved_n, direction)
            };
            // With the center, where all chords begin.
            let (down, up) = ((-moved[i].low()).max(0.0), moved[i].high().max(0.0));
            charts[i] = Interval::new(reached(-1.0, down)?, reached(1.0, up)?);
        }
        charts[seed.eliminated] = Interval::zero();
        Some(Solutions { charts, pieces })
    }

    /// The solutions of the patch, one for each pose.
    fn solutions(&self) -> Option<Solutions> {
        let mut room = self.center.map(Interval::point);
        for attempt in 0..=ROOM_ATTEMPTS {
            let found = self.found(&room)?;
            if attempt > 0 && self.others().all(|i| found.charts[i].is_inside(room[i])) {
                let Tangents { columns, .. } = self.tangents(&found.charts)?;
                return self.exact(&columns).rise_on(&found.pieces).then_some(found);
            }
            room = found
                .charts
                .map(|to| Interval::around(to.middle(), ROOM * to.radius() + LEAST_RADIUS));
        }
        None
    }

    /// The proof for all of the patch at once; the steps that it takes.
    fn prove(&self) -> Result<u8, Gap> {
        let View { prover, sights, seed, steps, .. } = self.view;
        let solutions = self.solutions().ok_or(Gap::Unproven)?;
        let mut sum_n = 0.0;
        for i in self.others() {
            let there = prover.curves.hung(i, &sights[i], solutions.charts[i]);
            sum_n += size(&there.ok_or(Gap::Unproven)?.force_n).low();
        }
        let near_n = TOLERANCE * sum_n;

        // From the seed.
        let mut iterate = seed.charts.map(Interval::point);
        let mut errors: [Interval; CABLES] =
            std::array::from_fn(|i| iterate[i] - solutions.charts[i]);
        for done in 1..=*steps {
            let stage = self.stage(&iterate, &solutions).ok_or(Gap::TooManySteps)?;
            let missed = self
                .missed(&stage.tangents, &iterate, &solutions.charts, &errors)
                .ok_or(Gap::TooManySteps)?;
            let arithmetic = self.arithmetic(&stage.tangents, &missed, &errors);
            let Missed { aside_n, along } = missed;
            let equations = self.equations(&stage.tangents.columns, &aside_n, arithmetic);
            let (a, b) = (&stage.pieces, &solutions.pieces);
            let pieces = a.start.min(b.start)..a.end.max(b.end);
            let after = equations.errors(&solutions.pieces, &pieces);
            let Errors { others_n: after_n, eliminated_n } = after.ok_or(Gap::TooManySteps)?;
            let rate = |i: usize| stage.tangents.rate_n(i).low();
            iterate = std::array::from_fn(|i| {
                if i == seed.eliminated {
                    return Interval::zero();
                }
                errors[i] = along[i] + Interval::symmetric(after_n[i] / rate(i) * UPWARDS);
                let near = solutions.charts[i] + errors[i];
                near.intersection(stage.to[i]).unwrap_or(near)
            });
            // What that makes of the forces, on the curves.
            let mut off_n = eliminated_n;
            for i in self.others() {
                let there = solutions.charts[i].hull(iterate[i]);
                let slope_n = prover.curves.hung(i, &sights[i], there).ok_or(Gap::TooManySteps)?;
                off_n = off_n.max(size(&slope_n.force_by_chart_n).high() * errors[i].magnitude());
            }
            if off_n < near_n {
                return Ok(done);
            }
        }
        Err(Gap::TooManySteps)
    }
}
