//! The equations of a step over a patch, with one cable eliminated: what the others can make of them, and where the
//! eliminated one is then. See [`proof`](super::proof).

use std::ops::Range;

use cdpr_core::CABLES;
use cdpr_core::table::COORDINATES;
use nalgebra::{Matrix6, Vector6};
use num_traits::Zero;

use super::patch::Patch;
use super::place::{Along, ByPose};
use super::sums::{Course, Inverse, Piece, UPWARDS};
use crate::interval::Interval;

/// Times that the errors of a step are fed back through `A M - I`.
const FEEDBACK: usize = 6;
/// And what is added to each for it.
const SHARE: f64 = 0.01;

/// What the controller rounds off in each row of a step, at most: for the five others, by newton of the force of the
/// eliminated cable, and by newton that the search along its curve leaves out. None for what is exact.
#[derive(Default)]
pub(super) struct Arithmetic {
    pub(super) others: Vector6<f64>,
    pub(super) unit: Vector6<f64>,
    pub(super) per_newton: Vector6<f64>,
}

impl Arithmetic {
    /// With the eliminated cable on a piece. What is eliminated is its force, and as much of the sum of all others.
    pub(super) fn on(&self, piece: &Piece) -> Vector6<f64> {
        self.others + self.unit * (2.0 * piece.force_n) + self.per_newton * piece.left_n
    }
}

/// What a step obeys, from anywhere in a box of coordinates.
pub(super) struct Equations<'a> {
    columns: &'a Columns<'a>,
    course: &'a Course,
    fold_at_slack_end: bool,
    /// What the right sides are off by, and what is rounded.
    missed: Vector6<Interval>,
    arithmetic: Arithmetic,
    /// Row `e` of `|A M - 1|`.
    row: Vector6<f64>,
    /// What the five others weigh at most in row `e`.
    weights: Option<Vector6<f64>>,
}

impl<'a> Equations<'a> {
    pub(super) fn new(
        columns: &'a Columns,
        course: &'a Course,
        fold_at_slack_end: bool,
        missed: Vector6<Interval>,
        arithmetic: Arithmetic,
    ) -> Self {
        let plain = columns.defect(&Vector6::zeros());
        let row = plain.row(columns.cable).transpose();
        let mut back = plain.transpose();
        back.fill_column(columns.cable, 0.0);
        let weights = fed_back(&back, &row);
        Self { columns, course, fold_at_slack_end, missed, arithmetic, row, weights }
    }

    fn cable(&self) -> usize {
        self.columns.cable
    }

    fn others(&self, v: impl Fn(usize) -> f64) -> Vector6<f64> {
        Vector6::from_fn(|i, _| if i == self.cable() { 0.0 } else { v(i) })
    }

    /// How the others feed back, with the eliminated cable on a piece.
    fn fed(&self, piece: &Piece) -> Matrix6<f64> {
        let mut fed = self.columns.defect(&piece.ratio);
        fed.fill_row(self.cable(), 0.0);
        fed
    }

    /// What the right sides are off by at most, if the eliminated cable is on a piece.
    fn apart(&self, piece: &Piece) -> Vector6<f64> {
        self.missed.map(Interval::magnitude) + self.arithmetic.on(piece)
    }

    /// How far the others move then.
    fn bound(&self, fed: &Matrix6<f64>, piece: &Piece) -> Option<Vector6<f64>> {
        let apart = self.apart(piece);
        let all = |i: usize| apart[i] + piece.ratio[i].abs() * apart[self.cable()];
        fed_back(fed, &self.others(|i| all(i) + piece.swept[i].magnitude()))
    }

    /// A sum of row `e`, with what the others weigh in it at most, whatever the piece.
    fn open(&self, sum: Interval, own: f64, right: impl Fn(usize) -> f64) -> Interval {
        let others = self.others(right);
        let room = self.weights.map_or(f64::INFINITY, |weights| weights.dot(&others));
        sum + Interval::symmetric((room + own) * UPWARDS)
    }

    /// The left side of the one equation on a piece. Mostly it is enough to know what the others weigh; where it is
    /// not, what is fed back on the piece is swept.
    fn value(&self, piece: &Piece) -> Interval {
        let cable = self.cable();
        let apart = self.apart(piece);
        let own = apart[cable];
        let rough = self.open(piece.sum[cable], own, |i| apart[i] + piece.sum[i].magnitude());
        if rough.mignitude() > 0.0 {
            return rough;
        }
        let room = self.bound(&self.fed(piece), piece).map_or(f64::INFINITY, |y| self.row.dot(&y));
        piece.sum[cable] + Interval::symmetric((room + own) * UPWARDS)
    }

    /// And its slope.
    fn slope(&self, piece: &Piece) -> Interval {
        let cable = self.cable();
        let apart = self.arithmetic.unit * piece.slope_m;
        let own = apart[cable];
        let rough = self.open(piece.slope[cable], own, |i| apart[i] + piece.slope[i].magnitude());
        if rough.mignitude() > 0.0 {
            return rough;
        }
        let all = |i: usize| apart[i] + piece.ratio[i].abs() * own + piece.swept_slope[i];
        let room = fed_back(&self.fed(piece), &self.others(all))
            .map_or(f64::INFINITY, |y| self.row.dot(&y));
        piece.slope[cable] + Interval::symmetric((room + own) * UPWARDS)
    }

    /// The left side at the lower end of a fine piece, or the upper one of the last.
    fn joint(&self, number: usize) -> Option<Interval> {
        let Course { joints, first_fine, .. } = self.course;
        joints.get(number.checked_sub(*first_fine)?).map(|joint| self.value(joint))
    }

    /// The pieces around the center on which it may be zero: it rises on them, through zero.
    pub(super) fn pieces(&self) -> Option<Range<usize>> {
        let Course { pieces, middle, .. } = self.course;
        let rises = |number: usize| pieces.get(number).is_some_and(|p| self.slope(p).low() > 0.0);
        let mut last = *middle;
        loop {
            let end = rises(last).then(|| self.joint(last + 1)).flatten()?;
            if end.low() > 0.0 {
                break;
            }
            last += 1;
        }
        let mut first = middle.checked_sub(1)?;
        loop {
            let end = rises(first).then(|| self.joint(first)).flatten()?;
            if end.high() < 0.0 {
                break;
            }
            first = first.checked_sub(1)?;
        }
        Some(first..last + 1)
    }

    /// Whether it rises on all of these pieces.
    pub(super) fn rise_on(&self, pieces: &Range<usize>) -> bool {
        self.course.pieces[pieces.clone()].iter().all(|piece| self.slope(piece).low() > 0.0)
    }

    /// Whether the search goes to these pieces from anywhere else in the bracket. Beyond them the sign stays where it
    /// rises; and towards a fold it is enough that it has the sign, or falls.
    pub(super) fn leads_to(&self, pieces: &Range<usize>) -> bool {
        let all = &self.course.pieces;
        let goes = |piece: &Piece, way: f64, has_sign: &mut bool| {
            let slope = self.slope(piece);
            if (way > 0.0) != self.fold_at_slack_end {
                return slope.low() > 0.0;
            }
            let value = self.value(piece);
            let is_certain = if way > 0.0 { value.low() > 0.0 } else { value.high() < 0.0 };
            *has_sign = is_certain || *has_sign && slope.low() > 0.0;
            *has_sign || slope.high() < 0.0
        };
        let (mut below, mut above) = (true, true);
        all[..pieces.start].iter().rev().all(|piece| goes(piece, -1.0, &mut below))
            && all[pieces.end..].iter().all(|piece| goes(piece, 1.0, &mut above))
    }

    /// How far the others move, N, with the eliminated cable on one of the pieces.
    pub(super) fn moved(&self, pieces: &Range<usize>) -> Option<Vector6<Interval>> {
        let (cable, missed) = (self.cable(), &self.missed);
        let mut all: Option<Vector6<Interval>> = None;
        for piece in &self.course.pieces[pieces.clone()] {
            let fed = self.fed(piece);
            let turned = fed * self.bound(&fed, piece)?;
            let rounding = self.arithmetic.on(piece);
            let here = Vector6::from_fn(|i, _| {
                if i == cable {
                    return Interval::zero();
                }
                let ratio = piece.ratio[i];
                let room = turned[i] + rounding[i] + ratio.abs() * rounding[cable];
                missed[i] - piece.swept[i] - Interval::point(ratio) * missed[cable]
                    + Interval::symmetric(room * UPWARDS)
            });
            all = Some(all.map_or(here, |all| all.zip_map(&here, Interval::hull)));
        }
        all
    }
}

/// `A M - 1` over a patch, for the tangents of five cables; column `e` is zero.
pub(super) struct Columns<'a> {
    inverse: &'a Inverse,
    cable: usize,
    along: Along,
    /// At the middle of the patch, with the middles of the tangents.
    defect: Matrix6<f64>,
    /// Radii of the wrenches of the tangents there.
    radius: Matrix6<f64>,
    /// How far each coordinate of the pose turns it at most, by middle.
    turned: [Matrix6<f64>; COORDINATES],
    /// The radii of that, and all roundings, of what is made of a row and as much again of row `e`, too.
    blur: Matrix6<f64>,
}

impl<'a> Columns<'a> {
    /// None, until they are set, of a start that eliminates a cable.
    pub(super) fn new(inverse: &'a Inverse, cable: usize, along: Along) -> Self {
        let zero = Matrix6::zeros();
        let turned = [zero; COORDINATES];
        Self { inverse, cable, along, defect: zero, radius: zero, turned, blur: zero }
    }

    /// Sets a column at the middle of the patch.
    pub(super) fn set(&mut self, cable: usize, wrench_n: &Vector6<Interval>) {
        let inverse = self.inverse;
        let middle = wrench_n.map(Interval::middle);
        let mut defect = inverse.matrix * middle;
        defect[cable] -= 1.0;
        self.defect.set_column(cable, &defect);
        self.radius.set_column(cable, &wrench_n.map(Interval::radius));
        // Ten roundings of a sum of six products that is about 1 or 0, and of the matrix.
        let blur = inverse.sizes * middle.abs() * (16.0 * f64::EPSILON);
        self.blur.set_column(cable, &blur);
    }

    /// Adds what a controller rounds in a column.
    pub(super) fn round(&mut self, cable: usize, rounding: &Vector6<f64>) {
        let mut blur = self.blur.column_mut(cable);
        blur += rounding;
    }

    /// Sets how it changes with each coordinate.
    pub(super) fn turn(&mut self, cable: usize, by_pose: &ByPose, patch: &Patch) {
        let rows = self.inverse.rows(by_pose, self.along);
        let mut blur = self.blur.column_mut(cable);
        for k in 0..self.along.count() {
            let aside = patch.aside(k).magnitude();
            let turned = rows.middle[k] * aside;
            blur += rows.radius[k] * aside + turned.abs() * (4.0 * f64::EPSILON);
            self.turned[k].set_column(cable, &turned);
        }
    }

    /// Bound of `|A M - I|`, column `e` zero, after row `e` times the factors was taken from the others.
    pub(super) fn defect(&self, ratio: &Vector6<f64>) -> Matrix6<f64> {
        let swept = |matrix: &Matrix6<f64>| matrix - ratio * matrix.row(self.cable);
        let mut bound = swept(&self.defect).abs();
        bound += swept(&self.inverse.matrix).abs() * self.radius;
        for turned in self.turned.iter().take(self.along.count()) {
            bound += swept(turned).abs();
        }
        bound += self.blur + ratio.abs() * self.blur.row(self.cable);
        bound * UPWARDS
    }
}

/// A bound on all `e >= 0` with `e <= right + defect e`; `None` when that does not bound them.
pub(super) fn fed_back(defect: &Matrix6<f64>, right: &Vector6<f64>) -> Option<Vector6<f64>> {
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
