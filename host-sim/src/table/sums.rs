//! What the equations sum to over a patch of poses, along the curve of the eliminated cable: see
//! [`proof`](super::proof) for what is made of it.

use cdpr_core::CABLES;
use cdpr_core::chart::{CROSSING_WIDTH, ChartStep, Start};
use cdpr_core::elimination::Elimination;
use cdpr_core::statics::Balance;
use cdpr_core::table::COORDINATES;
use nalgebra::{Matrix6, Vector2, Vector6};
use num_traits::One;

use super::affine::Affine;
use super::curve::{Fine, Heading, Run, both, size, stretch};
use super::patch::Patch;
use super::place::{Along, ByPose, Loading, Sight};
use super::proof::Prover;
use crate::interval::Interval;

/// A derivative with the pose is taken in the mean on the way from the middle of a patch to any pose of it: so many shells
/// are each crossed by the same part of the way, up to which it is less off than over the patch. With three coordinates
/// it is not worth its time.
const fn shells(along: Along) -> u8 {
    match along {
        Along::Position => 1,
        Along::PositionAndTurn { .. } => 2,
    }
}

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
    /// The same of poses nearer to the middle, up to shells in equal steps.
    pub(super) within: Vec<(Vec<Sight>, Loading)>,
    pub(super) along: Along,
    pub(super) seed: &'a Start<f64>,
    pub(super) steps: u8,
}

impl<'a> View<'a> {
    /// Largest component of what the load makes of the wrench, N.
    pub(super) fn load_n(&self) -> f64 {
        self.loading.wrench_n.iter().fold(0.0, |most, component| most.max(component.magnitude()))
    }

    /// `None` where a cable may be vertical.
    pub(super) fn new(
        prover: &'a Prover,
        patch: &'a Patch,
        seed: &'a Start<f64>,
        steps: u8,
    ) -> Option<Self> {
        let (sights, loading) = prover.likeness.look(&patch.region).ok()?;
        let along = prover.likeness.along(&patch.region);
        let shells = shells(along);
        let within = (1..shells).map(|shell| {
            let [shell, shells] = [shell, shells].map(|n| Interval::point(f64::from(n)));
            let share = shell / shells;
            prover.likeness.look(&patch.part(along.count(), share)).ok()
        });
        let within = within.collect::<Option<_>>()?;
        Some(Self { prover, patch, sights, loading, within, along, seed, steps })
    }

    /// All cables but the eliminated one.
    pub(super) fn others(&self) -> impl Iterator<Item = usize> + use<> {
        let cable = self.seed.eliminated;
        (0..CABLES).filter(move |i| *i != cable)
    }

    /// What a cable sees from the poses up to each shell, the patch last.
    pub(super) fn shells(&self, cable: usize) -> impl Iterator<Item = &Sight> {
        let within = self.within.iter().map(move |(sights, _)| &sights[cable]);
        within.chain([&self.sights[cable]])
    }

    /// In the mean over all shells of what was summed over them.
    pub(super) fn mean(&self, sum: &ByPose) -> ByPose {
        let share = Interval::one() / Interval::point(f64::from(shells(self.along)));
        sum.map(|column| column.map(|component| component * share))
    }
}

/// What the equations sum to, `A (S(P, pc) + G F(q))`, for all poses of a patch, with `q` anywhere on a piece of the curve of
/// the eliminated cable, or at an end of one.
pub(super) struct Sum {
    pub(super) rows: Vector6<Interval>,
    /// Where on the curve.
    chart: Interval,
    /// `|F|` at most, N.
    pub(super) force_n: f64,
    /// What the search for a crossing may leave out at its end, if that is here, N.
    pub(super) left_n: f64,
    /// How it comes about.
    pub(super) affine: Affine,
}

/// A piece of that curve.
pub(super) struct Piece {
    pub(super) sum: Sum,
    /// `A G F'(q)`, of tangents that are of length 1 along their direction in the middle, and how long these are at most.
    pub(super) slope: Vector6<Interval>,
    pub(super) tangent: f64,
    /// How long it is along that direction at least, N.
    pub(super) along_n: f64,
    /// How the slope comes about.
    pub(super) affine_slope: Affine,
}

impl Sum {
    fn new(
        chart: Interval,
        rows: Vector6<Interval>,
        affine: &Affine,
        force_n: &Vector2<Interval>,
        [by_chart_n, bend_n]: [&Vector2<Interval>; 2],
    ) -> Self {
        // It ends with a bracket that is so wide in units of `1 + |q|`, or with a step along the tangent that is no longer
        // than the root of that, from here.
        let unit = 1.0 + chart.magnitude();
        let slope_n = size(by_chart_n).high().max(0.5 * size(bend_n).high() * unit);
        Self {
            rows,
            chart,
            force_n: size(force_n).high(),
            left_n: slope_n * unit * (CROSSING_WIDTH * UPWARDS),
            affine: *affine,
        }
    }
}

impl Piece {
    fn new(
        chart: Interval,
        sum: Sum,
        heading: &Heading,
        slope: Vector6<Interval>,
        affine_slope: &Affine,
    ) -> Self {
        Self {
            sum,
            tangent: size(&heading.vector(heading.slant)).high(),
            along_n: heading.rate_n.low() * (chart.high() - chart.low()) / UPWARDS,
            slope,
            affine_slope: *affine_slope,
        }
    }
}

/// The curve of the eliminated cable in pieces, from the taut end of the bracket.
pub(super) struct Course<'a> {
    pub(super) patch: &'a Patch,
    /// Largest force of the eliminated cable on the fine pieces, N.
    pub(super) force_n: f64,
    /// Fine ones around the solution, rough ones beyond.
    pub(super) pieces: Vec<Piece>,
    /// The lower ends of the fine pieces, and the upper one of the last of them.
    pub(super) joints: Vec<Sum>,
    /// Numbers of the first fine piece, and of that which begins at the solution.
    pub(super) first_fine: usize,
    pub(super) middle: usize,
}

/// `A (S(P, pc) + G F(q))` over a patch, and how it comes about.
pub(super) struct Sums<'a, 'i> {
    view: &'a View<'a>,
    inverse: &'i Inverse,
    /// At the middle of the patch.
    pub(super) sights: Vec<Sight>,
    /// The sum there, without the eliminated cable; before `A`, and after.
    others_n: Vector6<Interval>,
    others: Vector6<Interval>,
    /// How it changes with the pose, without the eliminated cable: before `A`, summed over the shells, and after, in the
    /// mean.
    by_pose_n: ByPose,
    rows: Rows,
    /// Over the patch.
    all_others: Vector6<Interval>,
}

impl<'a, 'i> Sums<'a, 'i> {
    pub(super) fn new(
        view: &'a View<'a>,
        center: &[f64; CABLES],
        inverse: &'i Inverse,
    ) -> Option<Self> {
        let Prover { curves, likeness, .. } = view.prover;
        let patch = view.patch;
        let (sights, loading) =
            likeness.look(&view.along.across(&patch.region, &patch.middle)).ok()?;
        let mut others_n = loading.wrench_n;
        let mut by_pose_n = [Vector6::zeros(); COORDINATES];
        for i in view.others() {
            let chart = Interval::point(center[i]);
            others_n += sights[i].wrench_n(&curves.hung(i, &sights[i], chart)?.force_n);
            for sight in view.shells(i) {
                sight.add_by_pose(&mut by_pose_n, &curves.hung(i, sight, chart)?, view.along);
            }
        }
        let loadings = view.within.iter().map(|(_, loading)| loading).chain([&view.loading]);
        for loading in loadings {
            for (sum, by_pose_n) in by_pose_n.iter_mut().zip(&loading.by_pose(view.along)) {
                *sum += by_pose_n;
            }
        }
        let (others, rows) =
            (inverse.times(&others_n), inverse.rows(&view.mean(&by_pose_n), view.along));
        let mut sums =
            Self { view, inverse, sights, others_n, others, by_pose_n, rows, all_others: others };
        sums.all_others += sums.rows.spread(patch, view.along);
        Some(sums)
    }

    /// All of the bracket, in which the solution is at `at`; and how the sum changes with the pose there.
    pub(super) fn course(
        &self,
        at_center: &ChartStep<f64>,
        balance: &Balance<f64>,
        at: f64,
    ) -> Option<(Course<'a>, [Vector6<f64>; COORDINATES])> {
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
        let known = here.rows[*cable].radius().max(noise) / rise;
        if !(known > 0.0 && known.is_finite()) {
            return None;
        }
        let (down, down_joints, low) = self.march(at, (-known, noise), bracket[0])?;
        let (up, up_joints, high) = self.march(at, (known, noise), bracket[1])?;
        let fine = down.iter().chain(&up);
        let force_n = fine.fold(0.0, |most: f64, piece| most.max(piece.sum.force_n));
        let mut pieces = self.beyond(bracket[0], low)?;
        let first_fine = pieces.len();
        let middle = first_fine + down.len();
        pieces.extend(down.into_iter().rev());
        pieces.extend(up);
        pieces.extend(self.beyond(high, bracket[1])?);
        let mut joints: Vec<Sum> =
            down_joints.into_iter().rev().chain([here]).chain(up_joints).collect();
        take_from_neighbours(&mut pieces, &mut joints);
        let patch = self.view.patch;
        let course = Course { patch, force_n, pieces, joints, first_fine, middle };
        Some((course, rows.middle))
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
        let sight = &self.view.sights[cable];
        let (hung, bend_n) = self.view.prover.curves.bending(cable, sight, chart)?;
        let along = self.inverse.times(&sight.wrench_n(&hung.force_n));
        let affine = self.rows.affine(self.view.patch, &(self.others + along));
        let sum = Sum::new(
            chart,
            self.all_others + along,
            &affine,
            &hung.force_n,
            [&hung.force_by_chart_n, &bend_n],
        );
        let heading = Heading::at(&hung)?;
        let slope = self.inverse.times(&sight.wrench_n(&heading.vector(heading.slant)));
        let affine_slope = Rows::none().affine(self.view.patch, &slope);
        Some(Piece::new(chart, sum, &heading, slope, &affine_slope))
    }

    /// Whether it is so well known which sign row `e` has on a piece, or whether it rises or falls.
    fn is_told(&self, piece: &Piece, times: f64) -> bool {
        let cable = self.view.seed.eliminated;
        let is_told = |sum: Interval| sum.mignitude() > times * sum.radius();
        is_told(piece.sum.rows[cable]) || is_told(piece.slope[cable])
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
    fn joint(&self, exact: &Vector6<Interval>, chart: f64) -> Option<(Sum, Rows)> {
        let cable = self.view.seed.eliminated;
        let (sight, along) = (&self.view.sights[cable], self.view.along);
        let chart = Interval::point(chart);
        let hung = self.view.prover.curves.hung(cable, sight, chart)?;
        let mut moving_n = self.by_pose_n;
        for (sights, _) in &self.view.within {
            let within = self.view.prover.curves.hung(cable, &sights[cable], chart)?;
            sights[cable].add_by_pose(&mut moving_n, &within, along);
        }
        sight.add_by_pose(&mut moving_n, &hung, along);
        let rows = self.inverse.rows(&self.view.mean(&moving_n), along);
        let plain = self.all_others + self.inverse.times(&sight.wrench_n(&hung.force_n));
        let sum = both(&plain, &(exact + rows.spread(self.view.patch, along)))?;
        let affine = rows.affine(self.view.patch, exact);
        Some((
            Sum::new(
                chart,
                sum,
                &affine,
                &hung.force_n,
                [&hung.force_by_chart_n, &Vector2::zeros()],
            ),
            rows,
        ))
    }

    /// By the mean value theorem, over the pose and from a coordinate at which the sum is `exact` at the middle.
    ///
    /// Along the curve it goes on from the middle, so with the slope there, not with that before a plane.
    fn fine(&self, exact: &Vector6<Interval>, from: f64, to: f64) -> Option<Piece> {
        let cable = self.view.seed.eliminated;
        let (sight, here, along) = (&self.view.sights[cable], &self.sights[cable], self.view.along);
        let chart = Interval::new(from.min(to), from.max(to));
        let curves = &self.view.prover.curves;
        let Fine { run, rate_here_n, slant_here } = curves.fine(cable, sight, here, chart)?;
        let Run { reach, heading, .. } = &run;
        let (mut turning, mut moving_n) = ([Vector6::zeros(); COORDINATES], self.by_pose_n);
        let mut add = |sight: &Sight, Run { reach, heading, turn }: &Run| {
            sight.add_moved(&mut turning, &heading.vector(heading.slant), turn, along);
            sight.add_moved(&mut moving_n, &reach.force_n, &reach.by_end_n, along);
        };
        for (sights, _) in &self.view.within {
            let sight = &sights[cable];
            add(sight, &curves.run(cable, sight, chart, Some(&heading.direction))?);
        }
        add(sight, &run);
        // The slope.
        let turning = self.inverse.rows(&self.view.mean(&turning), along);
        let slope_here = self.inverse.times(&here.wrench_n(&heading.vector(slant_here)));
        let plain = self.inverse.times(&sight.wrench_n(&heading.vector(heading.slant)));
        let slope = both(&plain, &(slope_here + turning.spread(self.view.patch, along)))?;
        // The sum.
        let rows = self.inverse.rows(&self.view.mean(&moving_n), along);
        let gone_n = rate_here_n * (chart - Interval::point(from));
        let plain = self.all_others + self.inverse.times(&sight.wrench_n(&reach.force_n));
        let near = exact + slope_here.map(|slope| slope * gone_n);
        let near = near + rows.spread(self.view.patch, along);
        // Of the way along it all rows tell together.
        let affine = rows.affine(self.view.patch, exact).gone(&slope_here, gone_n);
        let sum = both(&plain, &near)?;
        let sum = Sum::new(chart, sum, &affine, &reach.force_n, [&reach.by_chart_n, &reach.bend_n]);
        let affine_slope = turning.affine(self.view.patch, &slope_here);
        Some(Piece::new(chart, sum, heading, slope, &affine_slope))
    }

    /// Fine pieces from the solution to where the sum has a certain sign or falls, their far ends, and where that is:
    /// towards `end`, beginning with about the distance `known`, which has the sign of the way. A sum as small as `noise`
    /// has none for certain.
    fn march(
        &self,
        at: f64,
        (known, noise): (f64, f64),
        end: f64,
    ) -> Option<(Vec<Piece>, Vec<Sum>, f64)> {
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
            let sum = joint.rows[cable];
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

/// The last step of a search may come from a little beyond a piece, and the curve bends as it does there.
fn take_from_neighbours(pieces: &mut [Piece], joints: &mut [Sum]) {
    let left: Vec<(Interval, f64)> =
        pieces.iter().map(|piece| (piece.sum.chart, piece.sum.left_n)).collect();
    for sum in pieces.iter_mut().map(|piece| &mut piece.sum).chain(joints) {
        let unit = 1.0 + sum.chart.magnitude();
        // From a coordinate so far away that is a little larger itself.
        let near = sum.chart + Interval::symmetric(CROSSING_WIDTH.sqrt() * unit * 1.01);
        let first = left.partition_point(|(chart, _)| chart.high() < near.low());
        let near = left[first..].iter().take_while(|(chart, _)| chart.low() <= near.high());
        sum.left_n = near.fold(sum.left_n, |most, (_, left_n)| most.max(*left_n));
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
        let mut rows = Rows::none();
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
    pub(super) fn ball(&self, vector: &Vector6<Interval>) -> (Vector6<f64>, Vector6<f64>) {
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
#[derive(Clone, Copy)]
pub(super) struct Rows {
    pub(super) middle: [Vector6<f64>; COORDINATES],
    pub(super) radius: [Vector6<f64>; COORDINATES],
}

impl Rows {
    /// Of what does not change, or is enclosed as it stands.
    fn none() -> Self {
        let zero = [Vector6::zeros(); COORDINATES];
        Self { middle: zero, radius: zero }
    }

    /// With what the rows are at the middle of the patch.
    fn affine(&self, patch: &Patch, here: &Vector6<Interval>) -> Affine {
        let mut along = [Vector6::zeros(); COORDINATES + 1];
        let mut open = here.map(Interval::radius);
        for k in 0..COORDINATES {
            let aside = patch.aside(k).magnitude();
            along[k] = self.middle[k] * aside;
            open += self.radius[k] * aside + along[k].abs() * f64::EPSILON;
        }
        Affine { middle: here.map(Interval::middle), along, open: open * UPWARDS }
    }

    /// What poses aside from the middle add.
    fn spread(&self, patch: &Patch, along: Along) -> Vector6<Interval> {
        let count = along.count();
        Vector6::from_fn(|i, _| {
            let [middle, radius] = [&self.middle, &self.radius].map(|of| of.map(|row| row[i]));
            patch.spread(&middle[..count], &radius[..count])
        })
    }
}
