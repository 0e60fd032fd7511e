//! A single cable by itself: the force at its attachment from its rest length.

use nalgebra::Vector2;

use crate::cable::{CableModel, IrvineCatenary, LinearElastic, Parabola};
use crate::root::{Taylor, evaluation_bound, monotone_root};
use crate::{Real, Scalar};

/// The force of a cable of given rest length between two given points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineSolution<T: Scalar> {
    /// Force on the cable at the attachment, N.
    pub force_n: Vector2<T>,
    /// Largest error of the end point at this force, m: the size of rounding, about the machine
    /// epsilon times the length. For an exactly vertical slack cable, where the end-point map is
    /// singular, that of its limit.
    pub residual_m: T,
    /// Iterations used.
    pub iterations: u32,
}

/// Why a single cable has no force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LineFault {
    /// A number is infinite or NaN, the distance negative, or the rest length not positive.
    InvalidInput,
    /// The cable does not stretch and is not longer than the distance of its ends.
    TooShort,
    /// The cable has no weight and is longer than the distance of its ends: it exerts no force.
    Limp,
    /// No force within the range of the number type closes the cable.
    OutOfRange,
}

impl core::fmt::Display for LineFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::InvalidInput => "length or end points are not physical",
            Self::TooShort => "an inextensible cable is not longer than the distance of its ends",
            Self::Limp => "a massless cable is longer than the distance of its ends",
            Self::OutOfRange => "no finite force closes the cable",
        })
    }
}

impl core::error::Error for LineFault {}

/// Bound on the iterations of the catenary, the parabola and all closed forms: 98 in f64, 66 in
/// f32. Usual counts are 3 to 5.
#[must_use]
pub const fn root_iteration_bound<T: Real>() -> u32 {
    evaluation_bound::<T>()
}

/// Bound on the iterations (evaluations of the end-point map) of [`nested_force`].
#[must_use]
pub const fn nested_iteration_bound<T: Real>() -> u32 {
    (evaluation_bound::<T>() + 1) * (evaluation_bound::<T>() + 2) + POLISH_STEPS
}

/// Newton steps on the end-point map after the one-dimensional search.
const POLISH_STEPS: u32 = 3;

/// Refuses what no cable can be asked.
#[inline]
pub(crate) fn check_input<T: Real>(x_m: T, z_m: T, rest_length_m: T) -> Result<(), LineFault> {
    let physical = x_m >= T::zero()
        && rest_length_m > T::zero()
        && x_m.is_finite()
        && z_m.is_finite()
        && rest_length_m.is_finite();
    if physical { Ok(()) } else { Err(LineFault::InvalidInput) }
}

/// Evaluates the end point at `force_n` and reports the residual.
pub(crate) fn with_residual<T: Real, M: CableModel<T>>(
    model: &M,
    x_m: T,
    z_m: T,
    rest_length_m: T,
    force_n: Vector2<T>,
    iterations: u32,
) -> LineSolution<T> {
    let end = model.end_point(force_n, rest_length_m).position_m;
    LineSolution { force_n, residual_m: (end.x - x_m).abs().max((end.y - z_m).abs()), iterations }
}

/// Newton on `(X, Z) = (x, z)` from a force that is already close; keeps the best.
#[inline]
fn polish<T: Real, M: CableModel<T>>(
    model: &M,
    x_m: T,
    z_m: T,
    rest_length_m: T,
    start_n: Vector2<T>,
    iterations: u32,
) -> Result<LineSolution<T>, LineFault> {
    // A few rounding units of the length: no force does better.
    let good = T::constant(4.0) * T::EPSILON * rest_length_m.max(x_m).max(z_m.abs());
    let mut force_n = start_n;
    let mut best = LineSolution { force_n, residual_m: T::HUGE, iterations };
    for step in 0..=POLISH_STEPS {
        // Without the derivative, which is needed only when rounding was unkind.
        let end = model.end_point(force_n, rest_length_m).position_m;
        let (gx, gz) = (end.x - x_m, end.y - z_m);
        let residual_m = gx.abs().max(gz.abs());
        let improved = residual_m < best.residual_m;
        if !improved {
            break;
        }
        best = LineSolution { force_n, residual_m, iterations: iterations + step };
        if residual_m <= good {
            break;
        }
        let j = model.end_point(force_n, rest_length_m).jacobian;
        let determinant = j.m11 * j.m22 - j.m12 * j.m21;
        let dx = (j.m22 * gx - j.m12 * gz) / determinant;
        let dz = (j.m11 * gz - j.m21 * gx) / determinant;
        force_n = Vector2::new(force_n.x - dx, force_n.y - dz);
    }
    let finite =
        best.residual_m < T::HUGE && best.force_n.x.is_finite() && best.force_n.y.is_finite();
    if finite { Ok(best) } else { Err(LineFault::OutOfRange) }
}

/// The elastic catenary. In the elliptic coordinates `q = W/S`, `c` of the force its two equations
/// give `c` and `Fx` explicitly, and the ellipse `4 Fx^2/(S^2 - W^2) + c^2 = 1` is one equation for
/// `S` alone:
///
/// ```text
/// (z / (L (1 + e)))^2 + (x / (L (atanh(q)/q + e)))^2 / (1 - q^2) = 1,      e = S / (2 EA)
/// ```
///
/// With `q = tanh a` the second denominator is `(L (a/sinh a + e/cosh a))^2`, so the left side
/// falls strictly with `S`, from infinity at `S = W` (`x > 0`) to zero (or to `(d/L)^2` when
/// `1/EA = 0`): there is exactly one root, and none only for an inextensible cable that is too
/// short. Multiplied out, so that nothing is divided, the equation is close to linear in `S - W`,
/// for taut cables (through `e`) as well as for slack ones (through `1 - q^2`):
///
/// ```text
/// g = ((1 + e)^2 - (z/L)^2) (1 - q^2) (atanh(q)/q + e)^2 - (x/L)^2 (1 + e)^2
/// ```
pub(crate) fn catenary_force<T: Real>(
    model: &IrvineCatenary<T>,
    x_m: T,
    z_m: T,
    rest_length_m: T,
) -> Result<LineSolution<T>, LineFault> {
    check_input(x_m, z_m, rest_length_m)?;
    let (one, half) = (T::one(), T::constant(0.5));
    let (two, three, four) = (T::constant(2.0), T::constant(3.0), T::constant(4.0));
    let weight = model.weight_n_m * rest_length_m;
    if weight <= T::zero() {
        let massless = LinearElastic { compliance_per_n: model.compliance_per_n };
        return massless.force_at_length(x_m, z_m, rest_length_m);
    }
    let per_length = one / rest_length_m;
    let (xi, zeta) = (x_m * per_length, z_m * per_length);
    // Strain for S = W; e = unit_strain S/W.
    let unit_strain = half * model.compliance_per_n * weight;
    let distance_sq = xi * xi + zeta * zeta;
    if unit_strain <= T::zero() && distance_sq >= one {
        return Err(LineFault::TooShort);
    }
    if x_m <= T::zero() {
        return vertical_catenary_force(weight, unit_strain, z_m, rest_length_m);
    }

    // u = S/W - 1 is the unknown. sag = atanh(q)/q - 1 may cancel here: it is only added to one.
    let far = T::constant(16.0);
    let sag_at = |u: T, s: T, q: T, inverse_open: T| {
        if s * s > far {
            q * q * T::atanh_tail(q, u * q)
        } else {
            // (1 + q)/(1 - q) = (s + 1)^2 / ((s + 1) u)
            half * s * ((s + one) * (s + one) * inverse_open).ln() - one
        }
    };
    let mut last = (one, one, one, one);
    let equation = |u: T| {
        let s = one + u;
        let q = one / s;
        let inverse_open = one / ((s + one) * u); // q^2 / (1 - q^2)
        let sag = sag_at(u, s, q, inverse_open);
        // The sag obeys d sag/ds = (sag - 1/(s^2 - 1)) / s, hence d^2 sag/ds^2 = 2 / (s^2 - 1)^2.
        let sag_slope = q * (sag - inverse_open);
        let half_sag_curvature = inverse_open * inverse_open;
        last = (u, sag, sag_slope, half_sag_curvature);
        let stretch = one + unit_strain * s;
        let wide = stretch + sag;
        let widening = sag_slope + unit_strain;
        // g = a o w - b with a = stretch^2 - zeta^2, o = 1 - q^2, w = wide^2, b = (xi stretch)^2,
        // and half of their derivatives by s.
        let (a, a_slope) = (stretch * stretch - zeta * zeta, unit_strain * stretch);
        let a_curvature = unit_strain * unit_strain;
        let (o, o_slope) = (u * (s + one) * (q * q), q * q * q);
        let o_curvature = -three * o_slope * q;
        let (w, w_slope) = (wide * wide, wide * widening);
        let w_curvature = widening * widening + two * wide * half_sag_curvature;
        let (ow, ow_slope) = (o * w, o_slope * w + o * w_slope);
        let ow_curvature = o_curvature * w + four * o_slope * w_slope + o * w_curvature;
        let xi_sq = xi * xi;
        Taylor {
            value: a * ow - xi_sq * (stretch * stretch),
            slope: two * (a_slope * (ow - xi_sq) + a * ow_slope),
            curvature: two
                * (a_curvature * (ow - xi_sq) + four * a_slope * ow_slope + a * ow_curvature),
        }
    };
    let start = catenary_start(xi, zeta, distance_sq, unit_strain);
    let (u, iterations) =
        monotone_root(equation, start, T::EPSILON.rough_cbrt()).ok_or(LineFault::OutOfRange)?;

    // The last evaluation was within the settling step, where the Taylor series of the sag is exact.
    let (last_u, last_sag, sag_slope, half_sag_curvature) = last;
    let change = u - last_u;
    let sag = last_sag + change * (sag_slope + change * half_sag_curvature);
    let s = one + u;
    let stretch = one + unit_strain * s;
    let half_sum = half * weight * s;
    let force_n = Vector2::new(
        half_sum * (xi / (stretch + sag)),
        half * weight + half_sum * (zeta / stretch),
    );
    polish(model, x_m, z_m, rest_length_m, force_n, iterations)
}

/// Where the search for `u = S/W - 1` starts: within some percent in each regime, so that three or
/// four Newton steps are left. `xi = x/L`, `zeta = z/L`.
#[inline]
fn catenary_start<T: Real>(xi: T, zeta: T, distance_sq: T, unit_strain: T) -> T {
    let (one, half) = (T::one(), T::constant(0.5));
    // Near taut, to second order in q = 1/s: unit_strain s = excess + bow / s^2, a cubic for s.
    let excess = half * (distance_sq - one);
    let bow = xi * xi * T::constant(1.0 / 6.0);
    if excess >= T::zero() {
        let straight = excess / unit_strain;
        let bent = (bow / unit_strain).rough_cbrt();
        let share = bent / (straight + bent);
        let s = straight + bent * share * share;
        // One Newton step on the cubic, where its two limits meet.
        let three_halves = T::constant(1.5);
        let slope = s * (three_halves * unit_strain * s - excess);
        let change = half * ((unit_strain * s - excess) * s * s - bow) / slope;
        return (s - change - one).max(half);
    }
    // Inextensible: sinh(a)/a = ratio with q = tanh(a), that is S/W = coth(a).
    let ratio = ((one - zeta) * (one + zeta)).max(T::zero()).sqrt() / xi;
    let surplus = -(excess + excess) / (xi * xi * (ratio + one)); // ratio - 1
    if surplus < T::constant(2.0) {
        // 1 + a^2/6 + a^4/120 = ratio, and coth^2(a) = 1 + 1/sinh^2(a).
        let root = (one + T::constant(1.2) * surplus).sqrt();
        let a_sq = T::constant(12.0) * surplus / (one + root);
        let opening = one / (ratio * ratio * a_sq);
        let s = (one + opening).sqrt();
        let u = opening / (s + one);
        // Stretch, by one Newton step on the cubic, or from its other end where it dominates.
        let softness = unit_strain * s * s * s;
        return if softness < bow {
            (u - s * softness / (bow + bow + T::constant(3.0) * softness)).max(half * u)
        } else {
            let bent = (bow / unit_strain).rough_cbrt();
            (bent + excess / (T::constant(3.0) * unit_strain)).max(half * bent)
        };
    }
    // Slack: a = ln(2 ratio a), one Newton step from a fit that is good to 5 %.
    let level = (ratio + ratio).rough_ln();
    let fit = half + T::constant(1.2) * level;
    let a = fit + (level + fit.rough_ln() - fit) * (fit / (fit - one));
    let growth = (ratio + ratio) * a;
    // S/W = coth(a)
    T::constant(2.0) / (growth * growth - one)
}

/// The limit `x -> 0` of the catenary, where the cable is a vertical line: taut below or above the
/// anchor, or slack with its lowest point somewhere between the ends.
fn vertical_catenary_force<T: Real>(
    weight: T,
    unit_strain: T,
    z_m: T,
    rest_length_m: T,
) -> Result<LineSolution<T>, LineFault> {
    let (one, half) = (T::one(), T::constant(0.5));
    let zeta = z_m / rest_length_m;
    let slack_slope = zeta / (one + unit_strain);
    let fz = if slack_slope.abs() <= one {
        // S = W
        half * weight * (one + slack_slope)
    } else {
        // c = +-1 and 1 + e = |zeta|
        let sum_over_weight = (zeta.abs() - one) / unit_strain;
        let side = if zeta > T::zero() { one } else { -one };
        half * weight * (one + side * sum_over_weight)
    };
    // Z = (Fz - W/2)(2L/S + L/EA), S = |Fz| + |Fz - W|
    let sum = fz.abs() + (fz - weight).abs();
    let middle = (fz + fz - weight) / weight;
    let end = middle * rest_length_m * (weight / sum + unit_strain);
    let residual_m = (end - z_m).abs();
    if residual_m.is_finite() {
        Ok(LineSolution { force_n: Vector2::new(T::zero(), fz), residual_m, iterations: 1 })
    } else {
        Err(LineFault::OutOfRange)
    }
}

/// The parabola: `M = F - (W/2) z` points along the chord, so with `d` the distance of the ends
/// `d = L |M| (1/T_m + 1/EA)` is one equation for `|M|`. Its right side rises with `|M|`, because
/// `T_m/|M|` is the mean of `|chord + (W/|M|)(1/2 - u) z|`, which is convex and even in `1/|M|`.
pub(crate) fn parabola_force<T: Real>(
    model: &Parabola<T>,
    x_m: T,
    z_m: T,
    rest_length_m: T,
) -> Result<LineSolution<T>, LineFault> {
    check_input(x_m, z_m, rest_length_m)?;
    let weight = model.weight_n_m * rest_length_m;
    let (distance, _) = T::hypot_with_excess(x_m, z_m);
    if weight <= T::zero() {
        let massless = LinearElastic { compliance_per_n: model.compliance_per_n };
        return massless.force_at_length(x_m, z_m, rest_length_m);
    }
    if model.compliance_per_n <= T::zero() && distance >= rest_length_m {
        return Err(LineFault::TooShort);
    }
    let half_weight = T::constant(0.5) * weight;
    let chord = Vector2::new(x_m / distance, z_m / distance);
    let force = |pull: T| Vector2::new(pull * chord.x, pull * chord.y + half_weight);
    let target = distance / rest_length_m;
    let equation = |pull: T| {
        let mean = Parabola::mean_tension(force(pull), weight);
        let ratio = pull / mean.mean_n;
        let growth = mean.by_force.x * chord.x + mean.by_force.y * chord.y;
        Taylor {
            value: ratio + pull * model.compliance_per_n - target,
            slope: (T::one() - ratio * growth) / mean.mean_n + model.compliance_per_n,
            curvature: T::zero(),
        }
    };
    let (pull, iterations) =
        monotone_root(equation, half_weight, T::EPSILON.sqrt()).ok_or(LineFault::OutOfRange)?;
    polish(model, x_m, z_m, rest_length_m, force(pull), iterations)
}

/// Any model that keeps the contract of [`CableModel`]: `Z` rises with `Fz` at fixed `Fx`, and along
/// `Z = z` so does `X` with `Fx` (by `det K / K_zz`), hence two nested one-dimensional searches.
///
/// # Errors
/// [`LineFault`].
pub fn nested_force<T: Real, M: CableModel<T>>(
    model: &M,
    x_m: T,
    z_m: T,
    rest_length_m: T,
) -> Result<LineSolution<T>, LineFault> {
    check_input(x_m, z_m, rest_length_m)?;
    let weight = model.weight_n_m() * rest_length_m;
    let scale = weight.max(T::one());
    let settled = T::EPSILON.sqrt();
    let mut evaluations = 0;
    // Fz with Z(Fx, Fz) = z: searched on the side of zero that the sign at zero tells.
    let mut height = |fx: T, guess: T| -> Option<T> {
        let at_zero =
            model.end_point(Vector2::new(fx, T::zero()), rest_length_m).position_m.y - z_m;
        let side = if at_zero < T::zero() { T::one() } else { -T::one() };
        let guess = if guess * side > T::zero() { guess * side } else { scale };
        let (fz, count) = monotone_root(
            |fz| {
                let end = model.end_point(Vector2::new(fx, side * fz), rest_length_m);
                Taylor {
                    value: side * (end.position_m.y - z_m),
                    slope: end.jacobian.m22,
                    curvature: T::zero(),
                }
            },
            guess,
            settled,
        )?;
        evaluations += count + 1;
        Some(side * fz)
    };
    if x_m <= T::zero() {
        // The limit Fx -> 0 of the height is regular; take it at a force that leaves no trace.
        let fx = T::TINY.sqrt() * T::constant(16.0);
        let fz = height(fx, scale).ok_or(LineFault::OutOfRange)?;
        let mut solution =
            with_residual(model, x_m, z_m, rest_length_m, Vector2::new(fx, fz), evaluations);
        let end = model.end_point(solution.force_n, rest_length_m).position_m;
        solution.force_n.x = T::zero();
        solution.residual_m = (end.y - z_m).abs();
        return Ok(solution);
    }
    let mut fz = scale;
    let found = monotone_root(
        |fx| {
            // A height that does not exist ends the search: the value below is then NaN.
            fz = height(fx, fz).unwrap_or(T::HUGE * T::HUGE);
            let end = model.end_point(Vector2::new(fx, fz), rest_length_m);
            let j = &end.jacobian;
            Taylor {
                value: end.position_m.x - x_m,
                slope: j.m11 - j.m12 * (j.m21 / j.m22),
                curvature: T::zero(),
            }
        },
        scale,
        settled,
    );
    let (fx, _) = found.ok_or(LineFault::OutOfRange)?;
    let fz = height(fx, fz).ok_or(LineFault::OutOfRange)?;
    polish(model, x_m, z_m, rest_length_m, Vector2::new(fx, fz), evaluations)
}
