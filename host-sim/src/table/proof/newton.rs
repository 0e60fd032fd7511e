//! What a step of Newton's method misses, what arithmetic in f32 adds to it, and the errors that remain: see
//! [`proof`](super).

use std::ops::Range;

use cdpr_core::CABLES;
use nalgebra::Vector6;
use num_traits::Zero;

use super::super::curve::{Reach, both, seen, size};
use super::super::equations::{Arithmetic, Aside, Columns, fed_back};
use super::super::sums::{Piece, UPWARDS, View};
use super::{Frame, Tangents};
use crate::interval::Interval;

/// Groups of pieces on each of which a solution is looked at by itself.
const GROUPS: usize = 6;
/// The arithmetic of a controller in f32, in units of the force of a cable. The force itself, as a vector at the
/// attachment, is off by at most so many (15 operations of the explicit curve, whose factors are of one sign, and three
/// of its direction, rounded half a unit each; three more units for root and strain, and one for the coordinate as it is
/// kept from step to step).
const F32_FORCE: f64 = 13.0;
/// And by as many as its plane is off, by this in units of the coordinates that it is made of.
const F32_PLANE: f64 = 2.0;
/// A component of a wrench is off by at most so many (products with the lever arm, and the sum of seven, rounded half a
/// unit each).
const F32_WRENCH: f64 = 6.0;
/// What is rounded in a matrix and in its elimination, as a component of the wrench: in units of the step, and of what
/// is eliminated, which is the force of the eliminated cable and the sum of all others.
const F32_STEP: f64 = 36.0;
const F32_ELIMINATED: f64 = 18.0;
/// Unit in the last place of 1.
const F32: f64 = f32::EPSILON as f64;

/// What tangents miss of curves.
pub(super) struct Missed {
    /// Across the tangents, N.
    pub(super) aside_n: [Interval; CABLES],
    /// Along them, in units of the coordinates.
    pub(super) along: [Interval; CABLES],
}

/// The errors after a step, N.
#[derive(Clone, Copy)]
pub(super) struct Errors {
    pub(super) others_n: Vector6<f64>,
    pub(super) eliminated_n: f64,
}

impl Frame<'_> {
    /// What the tangents that were taken at `at` miss of the curves at `to`, which is less by `errors`.
    pub(super) fn missed(
        &self,
        tangents: &Tangents,
        at: &[Interval; CABLES],
        to: &[Interval; CABLES],
        errors: &[Interval; CABLES],
    ) -> Option<Missed> {
        let (curves, sights) = (&self.view.prover.curves, &self.view.sights);
        let mut aside_n = [Interval::zero(); CABLES];
        let mut along = [Interval::zero(); CABLES];
        for i in self.others() {
            let (sight, error, direction) = (&sights[i], errors[i], &self.directions[i]);
            let (here, heading) = tangents.courses[i].as_ref()?;
            let there = curves.hung(i, sight, to[i])?;
            let all = at[i].hull(to[i]);
            let (between, course) = curves.course(i, sight, all, direction)?;
            let half_square = error.square() * Interval::point(0.5);
            // As they stand, by how the curve bends, and by how far its tangents differ at most.
            let plain = there.force_n - here.force_n + here.by_chart_n * error;
            let missed_n = both(&plain, &(between.bend_n * half_square))?;
            let (along_n, across_n) = seen(&missed_n, direction);
            let along_n = along_n.intersection(-(course.rate_n - heading.rate_n) * error)?;
            along[i] = along_n / heading.rate_n;
            let plain_n = across_n - heading.slant * along_n;
            let bent_n = course.rate_n * course.bend * half_square;
            let turned_n = -(course.rate_n * (course.slant - heading.slant)) * error;
            aside_n[i] = plain_n.intersection(bent_n)?.intersection(turned_n)?;
        }
        Some(Missed { aside_n, along })
    }

    /// What is off in each row by newton of the force of a cable in f32: on its curve, by its plane, and as so many units
    /// of a component of the wrench.
    fn unit(&self, cable: usize, of_wrench: f64) -> Vector6<f64> {
        let View { prover, sights, .. } = self.view;
        let x_m = sights[cable].x_m;
        let of_force = F32_FORCE + F32_PLANE * (prover.size_m + x_m.high()) * 2.0 / x_m.low();
        let all = self.per_force.column(cable) * of_force + self.inverse.per_newton * of_wrench;
        all * (F32 * UPWARDS)
    }

    /// What a column of the matrix of a step is off by: in its elimination, too.
    pub(super) fn column_rounding(
        &self,
        cable: usize,
        at: &Reach,
        rate_n: Interval,
    ) -> Vector6<f64> {
        self.unit(cable, F32_STEP) * (size(&at.by_chart_n).high() / rate_n.low() * UPWARDS)
    }

    /// What arithmetic in f32 adds to a step from there that misses so much, with these errors. What is off of its matrix
    /// counts here for the step along the tangents, and in the [`Columns`] for all beyond.
    pub(super) fn arithmetic(
        &self,
        from: &Tangents,
        missed: &Missed,
        errors: &[Interval; CABLES],
    ) -> Arithmetic {
        let cable = self.view.seed.eliminated;
        // The sum of all others, which is eliminated once, is about minus the force of the eliminated cable where the step
        // ends; how far it is from that is among the steps below. It begins with the load.
        let per_newton = self.inverse.per_newton * (F32 * UPWARDS);
        let sum_n = F32_ELIMINATED * self.course.force_n + F32_WRENCH * self.view.load_n();
        let mut others = per_newton * sum_n;
        for i in self.others() {
            let Some((at, _)) = &from.courses[i] else { continue };
            let step = missed.along[i].magnitude() + errors[i].magnitude();
            let step_n = size(&at.by_chart_n).high() * step;
            let force_n = size(&at.force_n).high();
            others += self.unit(i, F32_WRENCH) * force_n + self.unit(i, F32_STEP) * step_n;
        }
        let unit = self.unit(cable, F32_ELIMINATED);
        Arithmetic { others, unit, per_newton: self.per_force.column(cable).into_owned() }
    }

    /// The errors after a step, from what the tangents miss across them, with solution and step on any of some pieces. What
    /// is eliminated is not told apart further where it is `small_n`.
    pub(super) fn errors(
        &self,
        columns: &Columns,
        all: Range<usize>,
        missed: &Aside,
        arithmetic: &Arithmetic,
        small_n: f64,
    ) -> Option<Errors> {
        let cable = self.view.seed.eliminated;
        let pieces = &self.course.pieces;
        if !all.clone().all(|number| pieces[number].slope[cable].low() > 0.0) {
            return None;
        }
        let rise_n = |numbers: Range<usize>| {
            numbers.map(|number| pieces[number].rise_n).sum::<f64>() / UPWARDS
        };
        // On all of them: it is not known yet where the step ends.
        let roundings = pieces[all.clone()].iter().map(|piece| arithmetic.on(&piece.sum));
        let rounding = roundings.fold(Vector6::zeros(), |most, next| most.sup(&next)) * UPWARDS;
        let on = |numbers| self.errors_on(columns, &pieces[numbers], missed, &rounding);
        let whole = on(all.clone()).map(|(errors, _)| errors);
        if whole.is_some_and(|errors| errors.eliminated_n < small_n) {
            return whole;
        }
        let mut most = Errors { others_n: Vector6::zeros(), eliminated_n: 0.0 };
        // With the solution on each of some groups, and the step on some more pieces.
        let group = all.len().div_ceil(GROUPS);
        for first in all.clone().step_by(group) {
            let last = (first + group).min(all.end);
            let mut far = 1;
            let errors = loop {
                let from = first.saturating_sub(far).max(all.start);
                let until = (last + far).min(all.end);
                if from == all.start && until == all.end {
                    break whole?;
                }
                if let Some((errors, along_n)) = on(from..until) {
                    let is_inside = |is_end, between| is_end || along_n < rise_n(between);
                    if is_inside(from == all.start, from..first)
                        && is_inside(until == all.end, last..until)
                    {
                        break errors;
                    }
                }
                far *= 2;
            };
            most.others_n = most.others_n.sup(&errors.others_n);
            most.eliminated_n = most.eliminated_n.max(errors.eliminated_n);
        }
        Some(most)
    }

    /// These errors if solution and step are on these pieces; and by how much the eliminated cable moves row `e` then.
    fn errors_on(
        &self,
        columns: &Columns,
        pieces: &[Piece],
        missed: &Aside,
        rounding: &Vector6<f64>,
    ) -> Option<(Errors, f64)> {
        let cable = self.view.seed.eliminated;
        let most = |size: &dyn Fn(&Piece) -> f64| {
            let ratios = pieces.iter().map(|piece| size(piece) / piece.slope[cable].low());
            ratios.fold(0.0, f64::max) * UPWARDS
        };
        let ratio = &self.course.swept_slope(&pieces[pieces.len() / 2]).ratio;
        // As much as the slopes of a piece are off its own ratio, and that is off this one; or as they are.
        let pull = Vector6::from_fn(|i, _| {
            let off = |piece: &Piece| {
                let (rise, own) = (piece.slope[cable], self.course.swept_slope(piece));
                let turned = (own.ratio[i] - ratio[i]).abs() * rise.high();
                let plain = piece.slope[i] - Interval::point(ratio[i]) * rise;
                plain.magnitude().min((own.all[i].magnitude() + turned) * UPWARDS)
            };
            if i == cable { 0.0 } else { most(&off) }
        });
        let defect = columns.defect(ratio);
        let row = defect.row(cable);
        let mut fed = defect + pull * row;
        fed.fill_row(cable, 0.0);
        let swept = missed.swept(cable, ratio);
        let alone = swept[cable].magnitude() + rounding[cable];
        let right = Vector6::from_fn(|i, _| {
            if i == cable {
                return 0.0;
            }
            let rounding = rounding[i] + ratio[i].abs() * rounding[cable];
            swept[i].magnitude() + rounding + pull[i] * alone
        });
        let others_n = fed_back(&fed, &right)?;
        let along_n = (alone + row.transpose().dot(&others_n)) * UPWARDS;
        let eliminated_n = along_n * most(&|piece| piece.tangent);
        Some((Errors { others_n, eliminated_n }, along_n))
    }
}
