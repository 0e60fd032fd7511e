//! What the equations sum to over a patch of poses, along the curve of the eliminated cable: see
//! [`proof`](super::proof) for what is made of it.

use cdpr_core::CABLES;
use cdpr_core::chart::{ChartStep, Start, root};
use cdpr_core::elimination::Elimination;
use cdpr_core::statics::Balance;
use nalgebra::{Matrix6, Vector2, Vector6};

use super::curve::{Curves, Reach, size};
use super::patch::Patch;
use super::place::{ByPose, Loading, PoseBox, Sight};
use super::proof::Prover;
use crate::interval::Interval;

/// Pieces of the curve of the eliminated cable: length of the first from the solution, in units of how well that is
/// known; how they grow; and how far the root of the coordinate changes over one at most.
const FINEST: f64 = 0.5;
const GROWTH: f64 = 1.3;
const BEND: f64 = 0.08;
/// Fine pieces on one side of the solution at most.
const MOST_FINE: usize = 48;
/// For the rounding of sums of non-negative bounds.
pub(super) const UPWARDS: f64 = 1.0 + 1e-12;

/// A box of poses, and the seed to be examined for it.
pub(super) struct View<'a> {
    pub(super) prover: &'a Prover,
    pub(super) region: &'a PoseBox,
    pub(super) sights: Vec<Sight>,
    loading: Loading,
    pub(super) pieces: Vec<Rough>,
    pub(super) seed: &'a Start<f64>,
    pub(super) steps: u8,
}

impl<'a> View<'a> {
    /// `None` where a cable may be vertical, or its curve is not known.
    pub(super) fn new(
        prover: &'a Prover,
        region: &'a PoseBox,
        seed: &'a Start<f64>,
        steps: u8,
    ) -> Option<Self> {
        let (sights, loading) = prover.likeness.look(region).ok()?;
        let pieces = Rough::all(&prover.curves, seed, &sights)?;
        Some(Self { prover, region, sights, loading, pieces, seed, steps })
    }
}

/// A piece of the curve of the eliminated cable, for all poses of a box.
pub(super) struct Rough {
    pub(super) chart: Interval,
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

/// A piece of the curve of the eliminated cable, for all poses of a patch.
pub(super) struct Piece {
    /// `A (S(P, pc) + G F(q))`.
    pub(super) sum: Vector6<Interval>,
    /// `A G F'(q)`.
    pub(super) slope: Vector6<Interval>,
    /// `|F|` and `|F'|` at most, N.
    pub(super) force_n: f64,
    pub(super) slope_n: f64,
    /// Row `e` times these factors is taken from each other row, so that the slope is about zero there.
    pub(super) ratio: Vector6<f64>,
    /// The sum after that.
    pub(super) swept: Vector6<Interval>,
    /// The slope after that, sizes.
    pub(super) swept_slope: Vector6<f64>,
}

/// `A (S(P, pc) + G F(q))` over a patch, and how it comes about.
pub(super) struct Sums<'a> {
    view: &'a View<'a>,
    patch: &'a Patch,
    inverse: &'a Inverse,
    /// At the middle of the patch.
    sights: Vec<Sight>,
    /// The same there, without the eliminated cable; before `A`, and after.
    others_n: Vector6<Interval>,
    others: Vector6<Interval>,
    /// How it changes with the pose, without the eliminated cable; before `A`, and after.
    by_pose_n: ByPose,
    rows: ByPose,
    /// Over the patch.
    all_others: Vector6<Interval>,
}

impl<'a> Sums<'a> {
    pub(super) fn new(
        view: &'a View<'a>,
        patch: &'a Patch,
        center: &[f64; CABLES],
        inverse: &'a Inverse,
    ) -> Option<Self> {
        let Prover { curves, likeness, .. } = view.prover;
        let at = patch.middle;
        let (sights, loading) = likeness.look(&PoseBox { low: at, high: at }).ok()?;
        let mut others_n = loading.wrench_n;
        let mut by_pose_n = view.loading.by_pose();
        for i in (0..CABLES).filter(|i| *i != view.seed.eliminated) {
            let chart = Interval::point(center[i]);
            others_n += sights[i].wrench_n(&curves.hung(i, &sights[i], chart)?.force_n);
            let all = curves.hung(i, &view.sights[i], chart)?;
            view.sights[i].add_by_pose(&mut by_pose_n, &all, likeness.moment_arm_m());
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
    fn spread(&self, rows: &ByPose, ratio: &Vector6<f64>) -> Vector6<Interval> {
        let swept = rows.each_ref().map(|row| self.swept(row, ratio));
        let gradient = |i: usize| swept.each_ref().map(|row| row[i]);
        Vector6::from_fn(|i, _| self.patch.spread(self.view.region, &gradient(i)))
    }

    pub(super) fn rough(&self, piece: &Rough) -> Piece {
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
    pub(super) fn rows_at(&self, chart: Interval) -> Option<ByPose> {
        let Prover { curves, likeness, .. } = self.view.prover;
        let cable = self.view.seed.eliminated;
        let sight = &self.view.sights[cable];
        let all = curves.hung(cable, sight, chart)?;
        let mut by_pose_n = self.by_pose_n;
        sight.add_by_pose(&mut by_pose_n, &all, likeness.moment_arm_m());
        Some(self.inverse.rows(&by_pose_n))
    }

    /// The sum at the middle of the patch.
    pub(super) fn exactly(&self, chart: f64) -> Option<Vector6<Interval>> {
        let cable = self.view.seed.eliminated;
        let sight = &self.sights[cable];
        let here = self.view.prover.curves.hung(cable, sight, Interval::point(chart))?;
        Some(self.inverse.times(&(self.others_n + sight.wrench_n(&here.force_n))))
    }

    /// By the mean value theorem, over the pose and from a coordinate at which the sum is `exact` at the middle.
    fn fine(&self, exact: &Vector6<Interval>, from: f64, to: f64) -> Option<Piece> {
        let chart = Interval::new(from.min(to), from.max(to));
        self.fine_with(&self.rows_at(chart)?, exact, from, chart)
    }

    /// The same, with the rows there.
    pub(super) fn fine_with(
        &self,
        rows: &ByPose,
        exact: &Vector6<Interval>,
        from: f64,
        chart: Interval,
    ) -> Option<Piece> {
        let cable = self.view.seed.eliminated;
        let (curves, sight) = (&self.view.prover.curves, &self.view.sights[cable]);
        let mut piece = self.rough(&Rough::of(curves, cable, sight, chart)?);
        let along = chart - Interval::point(from);
        let sum = exact + piece.slope.map(|c| c * along) + self.spread(rows, &Vector6::zeros());
        let turned = piece.swept_slope.map(|c| Interval::symmetric(c) * along);
        let spread = self.spread(rows, &piece.ratio);
        let swept = self.swept(exact, &piece.ratio) + turned + spread;
        for i in 0..CABLES {
            piece.sum[i] = piece.sum[i].intersection(sum[i])?;
            piece.swept[i] = piece.swept[i].intersection(swept[i])?;
        }
        Some(piece)
    }

    /// Fine pieces from the solution to where the sum has a certain sign, their far ends, and where that is: towards
    /// `end`, beginning with about the distance `known`, which has the sign of the way.
    pub(super) fn march(
        &self,
        at: f64,
        known: f64,
        end: f64,
    ) -> Option<(Vec<Piece>, Vec<Piece>, f64)> {
        let cable = self.view.seed.eliminated;
        let (mut pieces, mut joints, mut chart) = (Vec::new(), Vec::new(), at);
        let mut exact = self.exactly(at)?;
        let mut step = FINEST * known;
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
            let column = balance.planes()[i].wrench_n(&at.points[i].force_by_chart_n);
            columns.set_column(i, &column);
        }
        columns.set_column(cable, &(across / across.norm()));
        let matrix = Elimination::new(&columns)?.inverse();
        let sizes = matrix.abs();
        Some(Self { matrix, sizes, per_newton: sizes * Vector6::repeat(1.0) })
    }

    /// The products with what changes with each coordinate of the pose.
    fn rows(&self, by_pose_n: &ByPose) -> ByPose {
        by_pose_n.each_ref().map(|column| self.times(column))
    }

    /// The product with a vector of intervals, by its middle and radius.
    pub(super) fn times(&self, vector: &Vector6<Interval>) -> Vector6<Interval> {
        // A sum of six products is off by at most seven units of the sum of their sizes.
        const ROUNDING: f64 = 8.0 * f64::EPSILON;
        let middle = vector.map(Interval::middle);
        let radius = vector.map(Interval::radius) + middle.abs() * ROUNDING;
        let (middle, radius) = (self.matrix * middle, self.sizes * radius);
        let least = f64::MIN_POSITIVE;
        Vector6::from_fn(|i, _| Interval::around(middle[i], radius[i] * UPWARDS + least))
    }
}
