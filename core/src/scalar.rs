//! The one seam between the mathematics and the number type.
//!
//! [`Scalar`] is what the cable models and the statics are written in. It has no order and no
//! branches, so that an interval can implement it as well as `f32` and `f64`: wherever a float
//! needs a case distinction to stay accurate, the whole expression is one method here
//! ([`Scalar::hypot_with_excess`], [`Scalar::atanh_tail`]), monotone in each argument, which an
//! interval evaluates at its ends. [`Real`] adds the order that algorithms need.
//!
//! Float functions come from `libm` on every target: the host then computes the same bits as the
//! firmware, and no function of `std` can slip in unnoticed (`clippy.toml` disallows them).

use core::ops::Neg;

use nalgebra::{ClosedAddAssign, ClosedDivAssign, ClosedMulAssign, ClosedSubAssign};
use num_traits::{One, Zero};

/// A number in which cable models and statics are written: `f32`, `f64`, or an interval.
pub trait Scalar:
    nalgebra::Scalar
    + Copy
    + Zero
    + One
    + Neg<Output = Self>
    + ClosedAddAssign
    + ClosedSubAssign
    + ClosedMulAssign
    + ClosedDivAssign
{
    /// The constant `value`. An interval implementation must enclose it.
    fn constant(value: f64) -> Self;

    /// Square root of a non-negative number.
    #[must_use]
    fn sqrt(self) -> Self;

    /// `(t, t - z)` with `t = sqrt(x^2 + z^2)`.
    ///
    /// The excess `t - z` has full relative accuracy although it cancels for `z > 0`. It rises with
    /// `|x|` and falls with `z`.
    fn hypot_with_excess(x: Self, z: Self) -> (Self, Self);

    /// `(atanh(q)/q - 1) / q^2 = 1/3 + q^2/5 + q^4/7 + ...` for `0 <= q < 1`.
    ///
    /// `complement` is `1 - q`, given by the caller because near `q = 1` it cannot be recovered
    /// from `q`. Rises with `q`; 1/3 at `q = 0`, without bound towards 1.
    fn atanh_tail(q: Self, complement: Self) -> Self;
}

/// A [`Scalar`] with an order: `f32` or `f64`.
pub trait Real: Scalar + PartialOrd {
    /// Distance from 1 to the next larger number.
    const EPSILON: Self;
    /// Smallest positive number of full precision.
    const TINY: Self;
    /// Largest finite number.
    const HUGE: Self;
    /// How many times the logarithm of `TINY..HUGE` can be halved until neighbouring numbers are
    /// left: the bound on the bisections of one root.
    const BISECTIONS: u32;

    /// Absolute value.
    #[must_use]
    fn abs(self) -> Self;
    /// Natural logarithm of a positive number.
    #[must_use]
    fn ln(self) -> Self;
    /// Natural logarithm of a positive number to 0.01, in a few instructions: for where a search
    /// starts.
    #[must_use]
    fn rough_ln(self) -> Self;
    /// Cube root of a positive number to 5 %, in a few instructions: for where a search starts.
    #[must_use]
    fn rough_cbrt(self) -> Self;
    /// False for infinities and NaN.
    fn is_finite(self) -> bool;

    /// The larger of two numbers; `other` when `self` is NaN.
    #[must_use]
    #[inline]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// The smaller of two numbers; `other` when `self` is NaN.
    #[must_use]
    #[inline]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
}

macro_rules! implement_for_float {
    ($float:ident, $bits:ident, $sqrt:ident, $log:ident,
     near: $near:expr, $near_terms:expr, far: $far:expr, $far_terms:expr, bisections: $bisections:expr) => {
        impl Scalar for $float {
            #[inline]
            #[allow(clippy::cast_possible_truncation, clippy::cast_lossless)]
            fn constant(value: f64) -> Self {
                value as $float
            }

            #[inline]
            fn sqrt(self) -> Self {
                square_root::$sqrt(self)
            }

            #[inline]
            fn hypot_with_excess(x: Self, z: Self) -> (Self, Self) {
                let t = square_root::$sqrt(x * x + z * z);
                // x (x / (t + z)) rather than x^2 / (t + z): x^2 would underflow first.
                let excess = if z > 0.0 { x * (x / (t + z)) } else { t - z };
                (t, excess)
            }

            #[inline]
            fn atanh_tail(q: Self, complement: Self) -> Self {
                let q2 = q * q;
                if q2 < $near {
                    inverse_odd_series::<$float, $near_terms>(q2)
                } else if q2 < $far {
                    inverse_odd_series::<$float, $far_terms>(q2)
                } else {
                    let inverse = 1.0 / q; // runs beside the logarithm
                    (0.5 * libm::$log((1.0 + q) / complement) * inverse - 1.0) * (inverse * inverse)
                }
            }
        }

        impl Real for $float {
            const EPSILON: Self = $float::EPSILON;
            const TINY: Self = $float::MIN_POSITIVE;
            const HUGE: Self = $float::MAX;
            const BISECTIONS: u32 = $bisections;

            #[inline]
            fn abs(self) -> Self {
                $float::abs(self)
            }

            #[inline]
            fn ln(self) -> Self {
                libm::$log(self)
            }

            #[inline]
            #[allow(
                clippy::cast_possible_wrap,
                clippy::cast_possible_truncation,
                clippy::cast_lossless
            )] // an exponent
            fn rough_ln(self) -> Self {
                // x = 2^n m: n is the exponent, and log2(m) on [1, 2) is nearly a parabola.
                const ONE: $bits = (1.0 as $float).to_bits();
                let bits = self.to_bits();
                let n = (bits >> ($float::MANTISSA_DIGITS - 1)) as i32
                    - (ONE >> ($float::MANTISSA_DIGITS - 1)) as i32;
                let m =
                    $float::from_bits((bits & ((1 << ($float::MANTISSA_DIGITS - 1)) - 1)) | ONE);
                core::$float::consts::LN_2 * (n as $float + (2.0 - m / 3.0) * m - 5.0 / 3.0)
            }

            #[inline]
            fn rough_cbrt(self) -> Self {
                // The bits of a float are nearly its logarithm, which is divided by three (W. Kahan).
                const ONE: $bits = (1.0 as $float).to_bits();
                const SHIFT: $bits =
                    ONE / 3 * 2 - (1 << (($float::MANTISSA_DIGITS - 1) - 5)) / 3 * 2;
                $float::from_bits(self.to_bits() / 3 + SHIFT)
            }

            #[inline]
            fn is_finite(self) -> bool {
                $float::is_finite(self)
            }
        }
    };
}

// The first term left out of the series, relative to its sum of at least 1/3, at the end of each
// range: f32 64^-4 * 3/11 = 2e-8, 16^-6 * 3/15 = 1e-8; f64 256^-7 * 3/17 = 2e-18,
// 16^-13 * 3/29 = 2e-17. Beyond q^2 = 1/16 the logarithm loses at most the factor 1/(q^2/3) = 48
// in the tail, which the models only ever add to 1 after multiplying it by q^2 again.
//
// Bisections: log2(2 * 128 ln 2 / 2^-23) = 31 for f32, log2(2 * 1024 ln 2 / 2^-52) = 63 for f64.
implement_for_float!(f32, u32, sqrtf, logf, near: 1.0 / 64.0, 4, far: 1.0 / 16.0, 6, bisections: 32);
implement_for_float!(f64, u64, sqrt, log, near: 1.0 / 256.0, 7, far: 1.0 / 16.0, 13, bisections: 64);

/// The square root, correctly rounded everywhere and therefore the same on every machine.
///
/// On a controller `libm` computes it in software, 57 instructions in f32; a call of C's `sqrtf` is one
/// `VSQRT` where the processor has it, and where not, the linker finds the function in Rust's own
/// `compiler_builtins`. The only unsafe declaration of this crate.
mod square_root {
    #[cfg(not(target_os = "none"))]
    pub(super) use libm::{sqrt, sqrtf};

    #[cfg(target_os = "none")]
    #[allow(unsafe_code)] // both take and return a number and touch nothing else
    unsafe extern "C" {
        pub(super) safe fn sqrt(x: f64) -> f64;
        pub(super) safe fn sqrtf(x: f32) -> f32;
    }
}

/// `1/3 + t/5 + t^2/7 + ...`, `TERMS` terms, by Horner's rule from the smallest.
#[inline]
fn inverse_odd_series<T: Scalar, const TERMS: u32>(t: T) -> T {
    let mut sum = T::zero();
    for k in (0..TERMS).rev() {
        sum = sum * t + T::constant(1.0 / f64::from(2 * k + 3));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values computed with 50 digits (mpmath: `(atanh(q)/q - 1)/q**2`).
    const ATANH_TAIL: [(f64, f64, f64); 8] = [
        (0.0, 1.0, 1.0 / 3.0),
        (1e-8, 1.0 - 1e-8, 0.333_333_333_333_333_37),
        (0.062_4, 0.937_6, 0.334_114_257_823_275_73),
        (0.062_6, 0.937_4, 0.334_119_285_852_834_6),
        (0.249, 0.751, 0.346_310_593_948_929_42),
        (0.251, 0.749, 0.346_529_848_596_334_23),
        (0.9, 0.1, 0.784_937_571_444_746_5),
        (1.0 - 1e-10, 1e-10, 10.859_499_058_583_05),
    ];

    #[test]
    fn atanh_tail_has_the_stated_accuracy() {
        for (q, complement, expected) in ATANH_TAIL {
            // What counts is the error after multiplication by q^2 and addition to 1.
            let error =
                (f64::atanh_tail(q, complement) - expected) * q * q / (1.0 + q * q * expected);
            assert!(error.abs() < 3.0 * f64::EPSILON, "q = {q}: {error:e}");
            #[allow(clippy::cast_possible_truncation)]
            let single = f32::atanh_tail(q as f32, complement as f32);
            let error = (f64::from(single) - expected) * q * q / (1.0 + q * q * expected);
            assert!(error.abs() < 3.0 * f64::from(f32::EPSILON), "f32, q = {q}: {error:e}");
        }
    }

    #[test]
    fn rough_functions_are_as_rough_as_stated() {
        let mut x = 1e-30_f64;
        while x < 1e30 {
            assert!((x.rough_ln() - libm::log(x)).abs() < 0.01, "{x:e}");
            assert!((x.rough_cbrt() / libm::cbrt(x) - 1.0).abs() < 0.05, "{x:e}");
            #[allow(clippy::cast_possible_truncation)]
            let single = x as f32;
            assert!((single.rough_ln() - libm::logf(single)).abs() < 0.01, "f32 {x:e}");
            assert!((single.rough_cbrt() / libm::cbrtf(single) - 1.0).abs() < 0.05, "f32 {x:e}");
            x *= 1.01;
        }
    }

    #[test]
    fn excess_keeps_its_digits() {
        // sqrt(x^2 + 1) - 1 = x^2/2 - x^4/8 + ...: plain subtraction would leave nothing at 1e-9.
        let (_, excess) = f64::hypot_with_excess(1e-9, 1.0);
        assert!((excess / 5e-19 - 1.0).abs() < 2.0 * f64::EPSILON);
        let (t, excess) = f64::hypot_with_excess(3.0, -4.0);
        assert!((t - 5.0).abs() < 1e-15 && (excess - 9.0).abs() < 2e-15);
        // Exactly vertical is not a special case.
        assert_eq!(f64::hypot_with_excess(0.0, 2.0), (2.0, 0.0));
        assert_eq!(f64::hypot_with_excess(0.0, -2.0), (2.0, 4.0));
    }
}
