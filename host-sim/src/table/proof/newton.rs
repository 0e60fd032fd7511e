//! What a step of Newton's method misses, and what arithmetic in f32 adds to it: see [`proof`](super).

use cdpr_core::CABLES;
use nalgebra::Vector6;
use num_traits::Zero;

use super::super::curve::{Reach, both, seen, size};
use super::super::equations::Arithmetic;
use super::super::sums::{UPWARDS, View};
use super::{Frame, Tangents};
use crate::interval::Interval;

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
    /// counts here for the step along the tangents, and in its columns for all beyond.
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
}
