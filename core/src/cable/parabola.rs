//! The parabola with elastic stretch.

use nalgebra::{Matrix2x3, Vector2};

use super::tension_profile::TensionProfile;
use super::{CableModel, EndPoint, LinearElastic};
use crate::line::{self, LineFault, LineSolution};
use crate::root::{Taylor, monotone_root};
use crate::{Real, Scalar};

/// Parabolic cable: its weight acts as if spread evenly over the chord, and it stretches by its
/// mean tension.
///
/// With `M = F - (W/2) z` the force at mid-span and `T_m` the mean of `|F - u W z|` over `u` in
/// `[0, 1]`, arc length and stretch of that parabola give
///
/// ```text
/// (X, Z) = L M (1/T_m + 1/EA),      T_m = (S/4) (2 + (1 - c^2) ((1 - q^2) atanh(q)/q - 1))
/// ```
///
/// The chord points along `M` exactly, so the force curve at a fixed pose is one-dimensional by
/// inspection. At the same `M` it differs from the catenary by the order `(W/T)^4` along `M` and by
/// `L c sqrt(1 - c^2) (W/T)^2 / 12` across, and by tens of percent for a slack cable; its compliance
/// is not exactly symmetric. `1/EA = 0` and `w = 0` are
/// regular.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parabola<T> {
    /// Weight per rest length, N/m.
    pub weight_n_m: T,
    /// Reciprocal axial stiffness `1/EA`, 1/N. Zero: inextensible.
    pub compliance_per_n: T,
}

/// Mean tension of a parabolic cable and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanTension<T: Scalar> {
    /// `T_m`, N.
    pub mean_n: T,
    /// `d T_m / dF`.
    pub by_force: Vector2<T>,
    /// `d T_m / dW + c/2`: what is left when `M` instead of `F` is held.
    by_weight: T,
    /// `T_m - M_x dT_m/dFx` and `T_m - M_z dT_m/dFz`, N, as sums of terms of one sign.
    remainder_n: Vector2<T>,
}

impl<T: Scalar> Parabola<T> {
    /// `T_m` at the force `(Fx, Fz)` and the total weight `W`.
    ///
    /// `T_m = (1/W) int T dT_z` has `dT_m/dFx = Fx (2/S) atanh(q)/q`, `dT_m/dFz = c` and
    /// `dT_m/dW = (T_A - T_m)/W`; the last cancels and is written with the tail of the series.
    #[inline]
    #[must_use]
    pub fn mean_tension(force_n: Vector2<T>, weight_n: T) -> MeanTension<T> {
        let one = T::one();
        let quarter = T::constant(0.25);
        let p = TensionProfile::new(force_n, weight_n);
        let sag = p.sag();
        let c = p.slope;
        let across = force_n.x * (p.inverse_sum + p.inverse_sum);
        let one_minus_c2 = across * (across / p.openness());
        // (1 - q^2)(1 + sag) - 1 = -q^2 (1 - (1 - q^2) tail), which cancels nowhere
        let bow = p.q * (one - p.openness() * p.tail);
        let (two, quarter_sum) = (T::constant(2.0), quarter * p.sum);
        let (arc, gap) = (one_minus_c2 * p.q * bow, one_minus_c2 * (two - p.q * bow));
        MeanTension {
            mean_n: (two - arc) * quarter_sum,
            remainder_n: Vector2::new((two * c * c + arc) * quarter_sum, gap * quarter_sum),
            by_force: Vector2::new(across * (one + sag), c),
            by_weight: one_minus_c2 * bow * quarter,
        }
    }
}

impl<T: Scalar> CableModel<T> for Parabola<T> {
    #[inline]
    fn end_point(&self, force_n: Vector2<T>, rest_length_m: T) -> EndPoint<T> {
        let half = T::constant(0.5);
        let weight = self.weight_n_m * rest_length_m;
        let mean = Self::mean_tension(force_n, weight);
        let inverse_mean = T::one() / mean.mean_n;
        let stretch = inverse_mean + self.compliance_per_n;
        let middle = Vector2::new(force_n.x, force_n.y - half * weight);
        let along = rest_length_m * self.compliance_per_n;
        // d(1/T_m) = -dT_m / T_m^2
        let turn = rest_length_m * inverse_mean * inverse_mean;
        let (tx, tz) = (turn * mean.by_force.x, turn * mean.by_force.y);
        // L d/dL: W grows in proportion, M loses W/2 in height and T_m gains W dT_m/dW.
        let by_weight = (mean.by_weight - half * mean.by_force.y) * weight;
        let per_length = stretch - by_weight * inverse_mean * inverse_mean;
        EndPoint {
            position_m: middle * (rest_length_m * stretch),
            jacobian: Matrix2x3::new(
                along + turn * mean.remainder_n.x,
                -(middle.x * tz),
                middle.x * per_length,
                -(middle.y * tx),
                along + turn * mean.remainder_n.y,
                middle.y * per_length - half * weight * stretch,
            ),
        }
    }

    fn weight_n_m(&self) -> T {
        self.weight_n_m
    }

    fn at_deformation(&self, s: T) -> Self {
        Self { weight_n_m: self.weight_n_m * s, compliance_per_n: self.compliance_per_n * s }
    }

    fn with_weight(&self, weight_n_m: T) -> Option<Self> {
        Some(Self { weight_n_m, ..*self })
    }

    /// `M` points along the chord, so with `d` the distance of the ends
    /// `d = L |M| (1/T_m + 1/EA)` is one equation for `|M|`. Its right side rises with `|M|`,
    /// because `T_m/|M|` is the mean of `|chord + (W/|M|)(1/2 - u) z|`, which is convex and even in
    /// `1/|M|`. At most [`line::root_iteration_bound`] iterations.
    fn force_at_length(
        &self,
        x_m: T,
        z_m: T,
        rest_length_m: T,
    ) -> Result<LineSolution<T>, LineFault>
    where
        T: Real,
    {
        line::check_input(x_m, z_m, rest_length_m)?;
        let weight = self.weight_n_m * rest_length_m;
        let (distance, _) = T::hypot_with_excess(x_m, z_m);
        if weight <= T::zero() {
            let massless = LinearElastic { compliance_per_n: self.compliance_per_n };
            return massless.force_at_length(x_m, z_m, rest_length_m);
        }
        if self.compliance_per_n <= T::zero() && distance >= rest_length_m {
            return Err(LineFault::TooShort);
        }
        let half = T::constant(0.5);
        let half_weight = half * weight;
        // A vertical slack chord is the limit of a nearly vertical one, too close to leave a trace.
        let chord = Vector2::new((x_m / distance).max(line::vertical_ratio()), z_m / distance);
        let force = |pull: T| Vector2::new(pull * chord.x, pull * chord.y + half_weight);
        let target = distance / rest_length_m;
        let equation = |pull: T| {
            let mean = Parabola::mean_tension(force(pull), weight);
            let ratio = pull / mean.mean_n;
            let growth = mean.by_force.x * chord.x + mean.by_force.y * chord.y;
            Taylor {
                value: ratio + pull * self.compliance_per_n - target,
                slope: (T::one() - ratio * growth) / mean.mean_n + self.compliance_per_n,
                curvature: T::zero(),
            }
        };
        // W/4 <= T_m <= |M| + W/4 brackets the root; the margin is for rounding.
        let quarter_weight = half * half_weight;
        let margin = T::one() + T::constant(16.0) * T::EPSILON;
        let low = target / (T::one() / quarter_weight + self.compliance_per_n);
        let high = if target < T::one() {
            (target / self.compliance_per_n).min(target * quarter_weight / (T::one() - target))
        } else {
            target / self.compliance_per_n
        };
        let bracket = (low / margin, high * margin);
        let (pull, iterations) = monotone_root(equation, bracket, half_weight, T::EPSILON.sqrt())
            .ok_or(LineFault::OutOfRange)?;
        line::polish(self, x_m, z_m, rest_length_m, force(pull), iterations)
    }
}
