//! What the equations sum to over a patch of poses, along the curve of the eliminated cable: see
//! [`proof`](super::proof) for what is made of it.

use cdpr_core::CABLES;
use cdpr_core::chart::{CROSSING_WIDTH, ChartStep, Start};
use cdpr_core::elimination::Elimination;
use cdpr_core::statics::Balance;
use cdpr_core::table::COORDINATES;
use nalgebra::{Matrix6, Vector2, Vector6};

use super::curve::{size, stretch};
use super::patch::Patch;
use super::place::{Along, ByPose, Loading, Sight};
use super::proof::Prover;
use crate::interval::Interval;

/// Fine pieces of the curve of the eliminated cable: length of the first from the solution, in units of how well that is
/// known; how they grow; and how far the root of the coordinate changes over one at most.
const FINEST: f64 = 0.5;
const GROWTH: f64 = 1.6;
const FINE_BEND: f64 = 0.055;
/// Rough pieces are enclosed as they stand. They are so long if a number is so well known by which their sign is told: its
/// least size exceeds its radius by this factor.
const ROUGH_BENDS: [(f64, f64); 3] = [(0.24, 4.0), (0.08, 1.0), (0.02, 0.0)];
/// Rounding of a force in the arithmetic of a controller in f32, as a part of it, about: it only says how far fine pieces
/// go, and the proof bounds it by itself.
const ARITHMETIC: f64 = 12.0 * f32::EPSILON as f64;
/// Fine pieces on one side of the solution at most.
const MOST_FINE: usize = 128;
/// For the rounding of sums of non-negative bounds.
pub(super) const UPWARDS: f64 = 1.0 + 1e-12;

/// Poses, and the seed to be examined for them.
pub(super) struct View<'a> {
    pub(super) prover: &'a Prover,
    pub(super) patch: &'a Patch,
    pub(super) sights: Vec<Sight>,
    loading: Loading,
    pub(super) along: Along,
    pub(super) seed: &'a Start<f64>,
    pub(super) steps: u8,
}

impl<'a> View<'a> {
    /// `None` where a cable may be vertical, or its curve is not known.
    pub(super) fn new(
        prover: &'a Prover,
        patch: &'a Patch,
        seed: &'a Start<f64>,
        steps: u8,
    ) -> Option<Self> {
        let (sights, loading) = prover.likeness.look(&patch.region).ok()?;
        let along = prover.likeness.along(&patch.region);
        Some(Self { prover, patch, sights, loading, along, seed, steps })
    }
}

/// A piece of the curve of the eliminated cable, for all poses of a patch.
pub(super) struct Piece {
    /// `A (S(P, pc) + G F(q))`.
    pub(super) sum: Vector6<Interval>,
    /// `A G F'(q)`, by the force density of the cable, m.
    pub(super) slope: Vector6<Interval>,
    /// `|F|` at most, N, and `|F'|`, m.
    pub(super) force_n: f64,
    pub(super) slope_m: f64,
    /// What row `e` of the sum rises by from one end to the other at least, N.
    pub(super) rise_n: f64,
    /// What the search for a crossing may leave out at its end, N.
    pub(super) left_n: f64,
    /// Row `e` times these factors is taken from each other row, so that the slope is about zero there.
    pub(super) ratio: Vector6<f64>,
    /// The sum after that.
    pub(super) swept: Vector6<Interval>,
    /// The slope after that, sizes.
    pub(super) swept_slope: Vector6<f64>,
}

/// The curve of the eliminated cable in pieces, from the taut end of the bracket.
pub(super) struct Course {
    /// Fine ones around the solution, rough ones beyond.
    pub(super) pieces: Vec<Piece>,
    /// The lower ends of the fine pieces, and the upper one of the last of them.
    pub(super) joints: Vec<Piece>,
    /// Numbers of the first fine piece, and of that which begins at the solution.
    pub(super) first_fine: usize,
    pub(super) middle: usize,
}

/// `A (S(P, pc) + G F(q))` over a patch, and how it comes about.
pub(super) struct Sums<'a> {
    view: &'a View<'a>,
    inverse: &'a Inverse,
    /// At the middle of the patch.
    pub(super) sights: Vec<Sight>,
    /// The sum there, without the eliminated cable; before `A`, and after.
    others_n: Vector6<Interval>,
    others: Vector6<Interval>,
    /// How it changes with the pose, without the eliminated cable; before `A`, and after.
    by_pose_n: ByPose,
    rows: Rows,
    /// Over the patch.
    all_others: Vector6<Interval>,
}

impl<'a> Sums<'a> {
    pub(super) fn new(
        view: &'a View<'a>,
        center: &[f64; CABLES],
        inverse: &'a Inverse,
    ) -> Option<Self> {
        let Prover { curves, likeness, .. } = view.prover;
        let patch = view.patch;
        let (sights, loading) =
            likeness.look(&view.along.across(&patch.region, &patch.middle)).ok()?;
        let mut others_n = loading.wrench_n;
        let mut by_pose_n = view.loading.by_pose(view.along);
        for i in (0..CABLES).filter(|i| *i != view.seed.eliminated) {
            let chart = Interval::point(center[i]);
            others_n += sights[i].wrench_n(&curves.hung(i, &sights[i], chart)?.force_n);
            let all = curves.hung(i, &view.sights[i], chart)?;
            view.sights[i].add_by_pose(&mut by_pose_n, &all, view.along);
        }
        let (others, rows) = (inverse.times(&others_n), inverse.rows(&by_pose_n, view.along));
        let mut sums =
            Self { view, inverse, sights, others_n, others, by_pose_n, rows, all_others: others };
        sums.all_others += sums.spread(&sums.rows, &Vector6::zeros());
        Some(sums)
    }

    /// All of the bracket, in which the solution is at `at`; and how the sum changes with the pose there.
    pub(super) fn course(
        &self,
        at_center: &ChartStep<f64>,
        balance: &Balance<f64>,
        at: f64,
    ) -> Option<(Course, [Vector6<f64>; COORDINATES])> {
        let View { seed: Start { eliminated: cable, bracket, .. }, .. } = self.view;
        let is_inside = at > bracket[0] && at < bracket[1];
        if !is_inside {
            return None;
        }
        let (here, rows) = self.joint(&self.exactly(at)?, at)?;
        let tangent_n =
            balance.planes()[*cable].wrench_n(&at_center.points[*cable].force_by_chart_n);
        let rise = self.inverse.matrix.row(*cable).transpose().dot(&tangent_n);
        // How well the sum is known: in the arithmetic of a controller, and over the patch.
        let force_n: f64 = at_center.points.iter().map(|point| point.state.force_n.norm()).sum();
        let noise = self.inverse.per_newton[*cable] * (ARITHMETIC * force_n);
        let known = here.sum[*cable].radius().max(noise) / rise;
        if !(known > 0.0 && known.is_finite()) {
            return None;
        }
        let (down, down_joints, low) = self.march(at, (-known, noise), bracket[0])?;
        let (up, up_joints, high) = self.march(at, (known, noise), bracket[1])?;
        let mut pieces = self.beyond(bracket[0], low)?;
        let first_fine = pieces.len();
        let middle = first_fine + down.len();
        pieces.extend(down.into_iter().rev());
        pieces.extend(up);
        pieces.extend(self.beyond(high, bracket[1])?);
        let joints = down_joints.into_iter().rev().chain([here]).chain(up_joints).collect();
        let course = Course { pieces, joints, first_fine, middle };
        Some((course, rows.middle))
    }

    /// Row `e` times the factors taken from the other rows.
    fn swept(&self, v: &Vector6<Interval>, ratio: &Vector6<f64>) -> Vector6<Interval> {
        let cable = self.view.seed.eliminated;
        Vector6::from_fn(|i, _| v[i] - Interval::point(ratio[i]) * v[cable])
    }

    /// What poses aside from the middle add, swept.
    fn spread(&self, rows: &Rows, ratio: &Vector6<f64>) -> Vector6<Interval> {
        let cable = self.view.seed.eliminated;
        let count = self.view.along.count();
        Vector6::from_fn(|i, _| {
            let (mut middle, mut radius) = ([0.0; COORDINATES], [0.0; COORDINATES]);
            for k in 0..count {
                let (row, room) = (&rows.middle[k], &rows.radius[k]);
                let taken = ratio[i] * row[cable];
                middle[k] = row[i] - taken;
                let rounding = (row[i].abs() + taken.abs()) * (2.0 * f64::EPSILON);
                radius[k] = (room[i] + ratio[i].abs() * room[cable] + rounding) * UPWARDS;
            }
            self.view.patch.spread(&middle[..count], &radius[..count])
        })
    }

    /// Pieces of a part of the bracket, from its taut end: as long as is told by what they sum to.
    fn beyond(&self, mut low: f64, end: f64) -> Option<Vec<Piece>> {
        let mut pieces = Vec::new();
        while low < end {
            let until = |bend: f64| (low + stretch(low, bend)).min(end);
            let (mut piece, mut high) = (None, low);
            for (bend, times) in ROUGH_BENDS {
                high = until(bend);
                piece = self.rough(Interval::new(low, high));
                if piece.as_ref().is_some_and(|piece| self.is_told(piece, times)) {
                    break;
                }
            }
            pieces.push(piece?);
            low = high;
        }
        Some(pieces)
    }

    /// A piece as it stands.
    fn rough(&self, chart: Interval) -> Option<Piece> {
        let cable = self.view.seed.eliminated;
        let hung = self.view.prover.curves.hung(cable, &self.view.sights[cable], chart)?;
        let tangent_m = -hung.heading_m;
        let mut piece = self.plain(chart, &hung.force_n, &hung.force_by_chart_n, &tangent_m);
        piece.swept += self.spread(&self.rows, &piece.ratio);
        Some(piece)
    }

    /// Whether it is so well known which sign row `e` has on a piece, or whether it rises or falls.
    fn is_told(&self, piece: &Piece, times: f64) -> bool {
        let cable = self.view.seed.eliminated;
        let is_told = |sum: Interval| sum.mignitude() > times * sum.radius();
        is_told(piece.sum[cable]) || is_told(piece.slope[cable])
    }

    /// A piece with what is swept only at the middle of the patch.
    fn plain(
        &self,
        chart: Interval,
        force_n: &Vector2<Interval>,
        by_chart_n: &Vector2<Interval>,
        tangent_m: &Vector2<Interval>,
    ) -> Piece {
        let cable = self.view.seed.eliminated;
        let sight = &self.view.sights[cable];
        let along = self.inverse.times(&sight.wrench_n(force_n));
        let slope = self.inverse.times(&sight.wrench_n(tangent_m));
        let rise = slope[cable];
        let ratio = Vector6::from_fn(|i, _| {
            let ratio = slope[i].middle() / rise.middle();
            if i != cable && rise.mignitude() > 0.0 && ratio.is_finite() { ratio } else { 0.0 }
        });
        // By as many newtons a metre the force density falls at least, along the piece.
        let falls_n_m =
            size(by_chart_n).low() / size(tangent_m).high() * (chart.high() - chart.low());
        Piece {
            sum: self.all_others + along,
            force_n: size(force_n).high(),
            slope_m: size(tangent_m).high(),
            rise_n: rise.low().max(0.0) * falls_n_m / UPWARDS,
            left_n: size(by_chart_n).high()
                * (1.0 + chart.magnitude())
                * (CROSSING_WIDTH * UPWARDS),
            swept: self.swept(&(self.others + along), &ratio),
            swept_slope: self.swept(&slope, &ratio).map(Interval::magnitude),
            slope,
            ratio,
        }
    }

    /// The sum at the middle of the patch.
    fn exactly(&self, chart: f64) -> Option<Vector6<Interval>> {
        let cable = self.view.seed.eliminated;
        let sight = &self.sights[cable];
        let here = self.view.prover.curves.hung(cable, sight, Interval::point(chart))?;
        Some(self.inverse.times(&(self.others_n + sight.wrench_n(&here.force_n))))
    }

    /// At a coordinate at which the sum is `exact` at the middle, by the mean value theorem over the pose; and how the
    /// sum changes with that.
    fn joint(&self, exact: &Vector6<Interval>, chart: f64) -> Option<(Piece, Rows)> {
        let cable = self.view.seed.eliminated;
        let sight = &self.view.sights[cable];
        let chart = Interval::point(chart);
        let hung = self.view.prover.curves.hung(cable, sight, chart)?;
        let tangent_m = -hung.heading_m;
        let mut piece = self.plain(chart, &hung.force_n, &hung.force_by_chart_n, &tangent_m);
        let mut moving_n = self.by_pose_n;
        sight.add_by_pose(&mut moving_n, &hung, self.view.along);
        let rows = self.inverse.rows(&moving_n, self.view.along);
        let swept = self.swept(exact, &piece.ratio);
        self.narrow(&mut piece, exact, &swept, &rows)?;
        Some((piece, rows))
    }

    /// Narrows the sums of a piece by those at the middle and how they change with the pose.
    fn narrow(
        &self,
        piece: &mut Piece,
        sum: &Vector6<Interval>,
        swept: &Vector6<Interval>,
        rows: &Rows,
    ) -> Option<()> {
        let sum = sum + self.spread(rows, &Vector6::zeros());
        for i in 0..CABLES {
            piece.sum[i] = piece.sum[i].intersection(sum[i])?;
        }
        piece.swept = swept + self.spread(rows, &piece.ratio);
        Some(())
    }

    /// By the mean value theorem, over the pose and from a coordinate at which the sum is `exact` at the middle.
    ///
    /// Along the curve it goes on from the middle, so with the slope there, not with that before a plane.
    fn fine(&self, exact: &Vector6<Interval>, from: f64, to: f64) -> Option<Piece> {
        let cable = self.view.seed.eliminated;
        let (curves, sight) = (&self.view.prover.curves, &self.view.sights[cable]);
        let (here, none) = (&self.sights[cable], Vector6::zeros());
        let chart = Interval::new(from.min(to), from.max(to));
        let (reach, tangent, by_end) = curves.turning_reach(cable, sight, chart)?;
        let mut piece = self.plain(chart, &reach.force_n, &reach.by_chart_n, &tangent.at_m);
        // The slope.
        let mut turning = [Vector6::zeros(); COORDINATES];
        sight.add_moved(&mut turning, &tangent.at_m, &by_end, self.view.along);
        let turning = self.inverse.rows(&turning, self.view.along);
        let [slope_n, at_m] = curves.slope(cable, here, chart, &reach.bend_n, &tangent.bend_m)?;
        let slope = self.inverse.times(&here.wrench_n(&at_m));
        let near = slope + self.spread(&turning, &none);
        let slope_swept = self.swept(&slope, &piece.ratio);
        let swept = slope_swept + self.spread(&turning, &piece.ratio);
        for i in 0..CABLES {
            piece.slope[i] = piece.slope[i].intersection(near[i])?;
            piece.swept_slope[i] = piece.swept_slope[i].min(swept[i].magnitude());
        }
        // The sum.
        let slope = self.inverse.times(&here.wrench_n(&slope_n));
        let slope_swept = self.swept(&slope, &piece.ratio);
        let mut moving_n = self.by_pose_n;
        sight.add_moved(&mut moving_n, &reach.force_n, &reach.by_end_n, self.view.along);
        let rows = self.inverse.rows(&moving_n, self.view.along);
        let along = chart - Interval::point(from);
        let sum = exact + slope.map(|c| c * along);
        let swept = self.swept(exact, &piece.ratio) + slope_swept.map(|c| c * along);
        self.narrow(&mut piece, &sum, &swept, &rows)?;
        Some(piece)
    }

    /// Fine pieces from the solution to where the sum has a certain sign or falls, their far ends, and where that is:
    /// towards `end`, beginning with about the distance `known`, which has the sign of the way. A sum as small as `noise`
    /// has none for certain.
    fn march(
        &self,
        at: f64,
        (known, noise): (f64, f64),
        end: f64,
    ) -> Option<(Vec<Piece>, Vec<Piece>, f64)> {
        let cable = self.view.seed.eliminated;
        let (mut pieces, mut joints, mut chart) = (Vec::new(), Vec::new(), at);
        let mut exact = self.exactly(at)?;
        let mut step = FINEST * known;
        for _ in 0..MOST_FINE {
            let longest = stretch(chart, FINE_BEND);
            step = (GROWTH * step).clamp(-longest, longest);
            let is_last = (end - chart).abs() <= step.abs();
            let next = if is_last { end } else { chart + step };
            let piece = self.fine(&exact, chart, next)?;
            let falls = piece.slope[cable].high() < 0.0;
            pieces.push(piece);
            exact = self.exactly(next)?;
            let (joint, _) = self.joint(&exact, next)?;
            let sum = joint.sum[cable];
            let is_certain = sum.middle() * step.signum() > 2.0 * sum.radius() + noise;
            joints.push(joint);
            chart = next;
            if is_certain || falls || is_last {
                break;
            }
        }
        Some((pieces, joints, chart))
    }
}

/// `A`, and what is needed to multiply with it.
pub(super) struct Inverse {
    pub(super) matrix: Matrix6<f64>,
    pub(super) sizes: Matrix6<f64>,
    /// What 1 N in each row of the equations makes in each row at most.
    pub(super) per_newton: Vector6<f64>,
}

impl Inverse {
    /// The inverse at a solution, with the column of a cable replaced by the unit vector across all others.
    pub(super) fn new(balance: &Balance<f64>, at: &ChartStep<f64>, cable: usize) -> Option<Self> {
        let across = at.elimination().inverse().row(cable).transpose();
        let mut columns = Matrix6::zeros();
        for i in 0..CABLES {
            let tangent = at.points[i].force_by_chart_n.normalize();
            let column = balance.planes()[i].wrench_n(&tangent);
            columns.set_column(i, &column);
        }
        columns.set_column(cable, &(across / across.norm()));
        let matrix = Elimination::new(&columns)?.inverse();
        let sizes = matrix.abs();
        Some(Self { matrix, sizes, per_newton: sizes * Vector6::repeat(1.0) })
    }

    /// The products with what changes with each coordinate of the pose.
    pub(super) fn rows(&self, by_pose_n: &ByPose, along: Along) -> Rows {
        let zero = [Vector6::zeros(); COORDINATES];
        let mut rows = Rows { middle: zero, radius: zero };
        for (k, column) in by_pose_n.iter().enumerate().take(along.count()) {
            (rows.middle[k], rows.radius[k]) = self.ball(column);
        }
        rows
    }

    /// The product with a vector of intervals.
    pub(super) fn times(&self, vector: &Vector6<Interval>) -> Vector6<Interval> {
        let (middle, radius) = self.ball(vector);
        middle.zip_map(&radius, Interval::around)
    }

    /// The product with a vector of intervals, by its middle and radius.
    fn ball(&self, vector: &Vector6<Interval>) -> (Vector6<f64>, Vector6<f64>) {
        // A sum of six products is off by at most seven units of the sum of their sizes.
        const ROUNDING: f64 = 8.0 * f64::EPSILON;
        let middle = vector.map(Interval::middle);
        let radius = vector.map(Interval::radius) + middle.abs() * ROUNDING;
        let radius = self.sizes * radius * UPWARDS + Vector6::repeat(f64::MIN_POSITIVE);
        (self.matrix * middle, radius)
    }
}

/// How the rows of the equations change with each coordinate of the pose, those that are not followed left out: by
/// middle and radius.
pub(super) struct Rows {
    pub(super) middle: [Vector6<f64>; COORDINATES],
    pub(super) radius: [Vector6<f64>; COORDINATES],
}
