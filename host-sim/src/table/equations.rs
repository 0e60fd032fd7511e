//! The equations of a step over a patch, with one cable eliminated: what the others can make of them, and where the
//! eliminated one is then. See [`proof`](super::proof).

use std::ops::Range;

use nalgebra::Vector6;
use num_traits::Zero;

use super::columns::{Columns, Followed, Others, fed_back};
use super::sums::{Course, Piece, Sum, UPWARDS};
use crate::interval::Interval;

/// What the controller rounds off in each row of a step, at most: for the five others and their sum, by newton of the
/// force of the eliminated cable, and by newton that the search along its curve leaves out. None for what is exact.
#[derive(Default)]
pub(super) struct Arithmetic {
    pub(super) others: Vector6<f64>,
    pub(super) unit: Vector6<f64>,
    pub(super) per_newton: Vector6<f64>,
}

impl Arithmetic {
    /// All of it, with the eliminated cable where the equations sum to this.
    pub(super) fn on(&self, sum: &Sum) -> Vector6<f64> {
        self.others + self.unit * sum.force_n + self.per_newton * sum.left_n
    }
}

/// What a step obeys, from anywhere in a box of coordinates.
pub(super) struct Equations<'a> {
    columns: &'a Columns<'a>,
    course: &'a Course<'a>,
    fold_at_slack_end: bool,
    /// What the right sides are off by, as tangents miss it, and how much that is at most; and what is rounded.
    missed: Vector6<Interval>,
    missed_most: Vector6<f64>,
    arithmetic: Arithmetic,
    /// What the five others weigh at most in row `e`.
    weights: Option<Vector6<f64>>,
    /// How they follow; `None` where that is not bounded.
    others: Option<Others>,
}

/// How steeply row `e` rises on a piece as the others follow, by newton of the eliminated cable at least, and how far each
/// follows at most.
struct Rise {
    least: f64,
    others: Vector6<f64>,
}

/// The errors after a step, N.
pub(super) struct Errors {
    pub(super) others_n: Vector6<f64>,
    pub(super) eliminated_n: f64,
}

impl<'a> Equations<'a> {
    pub(super) fn new(
        columns: &'a Columns<'a>,
        course: &'a Course<'a>,
        fold_at_slack_end: bool,
        missed: Vector6<Interval>,
        arithmetic: Arithmetic,
    ) -> Self {
        let plain = columns.defect();
        let row = plain.row(columns.cable).transpose();
        let mut back = plain.transpose();
        back.fill_column(columns.cable, 0.0);
        let weights = fed_back(&back, &row);
        let others = Others::new(columns);
        let missed_most = missed.map(Interval::magnitude);
        Self {
            columns,
            course,
            fold_at_slack_end,
            missed,
            missed_most,
            arithmetic,
            weights,
            others,
        }
    }

    fn cable(&self) -> usize {
        self.columns.cable
    }

    /// A sum of row `e`, with what the others weigh in it at most, for what is in each row.
    fn weighed(&self, sum: Interval, own: f64, mut others: Vector6<f64>) -> Interval {
        others[self.cable()] = 0.0;
        let room = self.weights.map_or(f64::INFINITY, |weights| weights.dot(&others));
        sum + Interval::symmetric((room + own) * UPWARDS)
    }

    /// The left side of the one equation on a piece, as far as its sign matters. Mostly it is enough to know what the
    /// others weigh; where it is not, it is told how they follow.
    fn value(&self, sum: &Sum) -> Interval {
        let cable = self.cable();
        let own = sum.rows[cable];
        if own.mignitude() == 0.0 {
            return own;
        }
        let apart = self.missed_most + self.arithmetic.on(sum);
        let rough = self.weighed(own, apart[cable], apart + sum.rows.map(Interval::magnitude));
        if rough.mignitude() > 0.0 {
            return rough;
        }
        let Some(others) = &self.others else { return rough };
        let Some(followed) = others.follow(&sum.affine, &apart) else { return rough };
        let patch = self.course.patch;
        let value = followed.rows.over(patch, cable);
        if value.mignitude() > 0.0 {
            return value;
        }
        followed.balanced(others, patch, cable).rows.over(patch, cable)
    }

    /// And its slope, by newton of the eliminated cable, as far as its sign matters.
    fn slope(&self, piece: &Piece) -> Interval {
        let cable = self.cable();
        let slope = piece.slope[cable];
        if slope.mignitude() == 0.0 {
            return slope;
        }
        let apart = self.arithmetic.unit * piece.tangent;
        let rough = self.weighed(slope, apart[cable], apart + piece.slope.map(Interval::magnitude));
        if rough.mignitude() > 0.0 {
            return rough;
        }
        let followed = self.followed_slope(piece);
        followed.map_or(rough, |followed| followed.rows.over(self.course.patch, cable))
    }

    fn followed_slope(&self, piece: &Piece) -> Option<Followed> {
        let apart = self.arithmetic.unit * piece.tangent;
        self.others.as_ref()?.follow(&piece.affine_slope, &apart)
    }

    /// `None` where it may not rise.
    fn rise(&self, piece: &Piece) -> Option<Rise> {
        let followed = self.followed_slope(piece)?;
        let least = followed.rows.over(self.course.patch, self.cable()).low();
        (least > 0.0).then(|| Rise { least, others: followed.rows.most() })
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
            let value = self.value(&piece.sum);
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
        let (cable, patch) = (self.cable(), self.course.patch);
        let others = self.others.as_ref()?;
        let mut all: Option<Vector6<Interval>> = None;
        for piece in &self.course.pieces[pieces.clone()] {
            let mut affine = piece.sum.affine;
            affine.middle -= self.missed.map(Interval::middle);
            let apart = self.missed.map(Interval::radius) + self.arithmetic.on(&piece.sum);
            let followed = others.follow(&affine, &apart)?.balanced(others, patch, cable);
            let here = Vector6::from_fn(|i, _| {
                if i == cable {
                    Interval::zero()
                } else {
                    -followed.rows.where_zero(patch, cable, i)
                }
            });
            all = Some(all.map_or(here, |all| all.zip_map(&here, Interval::hull)));
        }
        all
    }

    /// The errors after a step that misses so much, with the solution on some pieces, and the step on some that these are
    /// part of.
    pub(super) fn errors(&self, solutions: &Range<usize>, all: &Range<usize>) -> Option<Errors> {
        let pieces = &self.course.pieces;
        // On all of them: it is not known yet where the step ends.
        let rounding = pieces[all.clone()].iter().map(|piece| self.arithmetic.on(&piece.sum));
        let rounding = rounding.fold(Vector6::zeros(), |most, next| most.sup(&next));
        let alone_n = fed_back(&self.columns.defect(), &(self.missed_most + rounding))?;
        let reach_n = alone_n[self.cable()];
        let (mut pulled, mut steepest) = (Vector6::zeros(), 0.0_f64);
        let mut rise_n = |number: usize| {
            let piece: &Piece = pieces.get(number)?;
            let Rise { least, others } = self.rise(piece)?;
            pulled = others.map(|other| other / least).sup(&pulled);
            steepest = steepest.max(piece.tangent / least);
            Some(least * piece.along_n)
        };
        for number in solutions.clone() {
            rise_n(number)?;
        }
        // And as far beyond as it may get, down and up.
        let beyond: [&mut dyn Iterator<Item = usize>; 2] =
            [&mut (all.start..solutions.start).rev(), &mut (solutions.end..all.end)];
        for numbers in beyond {
            let mut left_n = reach_n;
            while left_n >= 0.0
                && let Some(number) = numbers.next()
            {
                left_n -= rise_n(number)? / UPWARDS;
            }
        }
        let others_n = (alone_n + pulled * reach_n) * UPWARDS;
        Some(Errors { others_n, eliminated_n: reach_n * steepest * UPWARDS })
    }
}
