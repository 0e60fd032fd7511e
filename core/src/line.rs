//! A single cable by itself: the force at its attachment from its rest length.

use nalgebra::Vector2;

use crate::cable::CableModel;
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
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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

/// `x/L` below which a cable is a vertical line: far below rounding, and above where squares of
/// the horizontal force would underflow.
pub(crate) fn vertical_ratio<T: Real>() -> T {
    T::TINY.sqrt() / T::EPSILON
}

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
    LineSolution { force_n, residual_m: largest_error(end.x - x_m, end.y - z_m), iterations }
}

/// The larger absolute value; NaN when either is (`Real::max` would drop one of them).
#[inline]
fn largest_error<T: Real>(gx: T, gz: T) -> T {
    let (gx, gz) = (gx.abs(), gz.abs());
    if gx <= gz {
        gz
    } else if gz <= gx {
        gx
    } else {
        gx + gz
    }
}

/// Newton on `(X, Z) = (x, z)` from a force that is already close; keeps the best.
#[inline]
pub(crate) fn polish<T: Real, M: CableModel<T>>(
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
        let residual_m = largest_error(gx, gz);
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
    let scale = if weight > T::zero() { weight } else { T::one() };
    let vertical = x_m <= rest_length_m * vertical_ratio();
    // A vertical line is not polished afterwards, and has a kink where its end becomes slack.
    let settled = if vertical { T::EPSILON } else { T::EPSILON.sqrt() };
    // Where squares of the force neither underflow nor overflow.
    let bracket = (T::constant(16.0) * T::TINY.sqrt() * scale, T::HUGE.sqrt() * T::constant(0.25));
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
            bracket,
            guess,
            settled,
        )?;
        evaluations += count + 1;
        Some(side * fz)
    };
    if vertical {
        // The limit Fx -> 0 of the height is regular; take it at a force that leaves no trace.
        let fx = bracket.0;
        let fz = height(fx, scale).ok_or(LineFault::OutOfRange)?;
        let mut solution =
            with_residual(model, x_m, z_m, rest_length_m, Vector2::new(fx, fz), evaluations);
        let end = model.end_point(solution.force_n, rest_length_m).position_m;
        solution.force_n.x = T::zero();
        solution.residual_m = (end.y - z_m).abs();
        let finite = solution.residual_m.is_finite();
        return if finite { Ok(solution) } else { Err(LineFault::OutOfRange) };
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
        bracket,
        scale * (x_m / rest_length_m),
        settled,
    );
    let (fx, _) = found.ok_or(LineFault::OutOfRange)?;
    let fz = height(fx, fz).ok_or(LineFault::OutOfRange)?;
    polish(model, x_m, z_m, rest_length_m, Vector2::new(fx, fz), evaluations)
}
