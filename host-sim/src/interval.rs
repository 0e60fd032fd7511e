//! Interval arithmetic: the [`Scalar`] in which proofs are computed.
//!
//! An [`Interval`] holds every number that a quantity may be; an operation on intervals holds every
//! result that the operation can have on numbers of its operands, rounding included. So what is shown
//! for the interval is shown for the real number.
//!
//! Rounding is to nearest, as the processor does it by default, and every result is then moved
//! outwards by at least one unit in the last place. `low` is stored with its sign changed: both bounds
//! then round upwards, by the same instructions on a pair of floats.
//!
//! A bound is never NaN. What cannot be enclosed (division by an interval with zero, the logarithm of
//! nothing) becomes [`Interval::ENTIRE`], from which nothing can be proved.

use std::fmt;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use cdpr_core::Scalar;
use num_traits::{One, Zero};

/// A closed interval of real numbers; its ends may be infinite.
#[derive(Clone, Copy, PartialEq)]
pub struct Interval {
    /// The lower end with its sign changed.
    negated_low: f64,
    high: f64,
}

/// Unit of rounding to nearest, 2^-53.
const UNIT: f64 = 0.5 * f64::EPSILON;
/// `UNIT (1 + 2 UNIT)`: the next number up is at most this part of a normal number away (S. M. Rump,
/// P. Zimmermann, S. Boldo, G. Melquiond, Computing predecessor and successor in rounding to nearest,
/// BIT 49, 2009, algorithm 2).
const STEP: f64 = UNIT * (1.0 + f64::EPSILON);
/// Smallest positive number.
const LEAST: f64 = f64::from_bits(1);

/// A number above every real that rounds to `value`.
#[inline]
fn up(value: f64) -> f64 {
    value + (value.abs() * STEP + LEAST)
}

/// A number that exceeds `value` by the part `units` of it, in units of rounding, and more.
#[inline]
fn up_by(value: f64, units: f64) -> f64 {
    value + (value.abs() * (units * STEP) + LEAST)
}

impl Interval {
    /// All real numbers: nothing is known.
    pub const ENTIRE: Self = Self { negated_low: f64::INFINITY, high: f64::INFINITY };

    /// The interval from `low` to `high`; [`Interval::ENTIRE`] unless `low <= high` and a real
    /// number is between them.
    #[must_use]
    #[inline]
    pub fn new(low: f64, high: f64) -> Self {
        if low <= high { Self::checked(-low, high) } else { Self::ENTIRE }
    }

    /// The single number `value`.
    #[must_use]
    #[inline]
    pub fn point(value: f64) -> Self {
        Self::new(value, value)
    }

    /// `center` plus or minus `radius`, rounded outwards; [`Interval::ENTIRE`] unless `radius >= 0`.
    #[must_use]
    #[inline]
    pub fn around(center: f64, radius: f64) -> Self {
        if radius >= 0.0 { Self::outwards(radius - center, center + radius) } else { Self::ENTIRE }
    }

    /// What is between `-radius` and `radius`.
    #[must_use]
    #[inline]
    pub fn symmetric(radius: f64) -> Self {
        Self::new(-radius, radius)
    }

    /// From bounds that were rounded to nearest.
    #[inline]
    fn outwards(negated_low: f64, high: f64) -> Self {
        Self::checked(up(negated_low), up(high))
    }

    /// [`Interval::ENTIRE`] in place of NaN, and of a lower end that overflowed.
    #[inline]
    fn checked(negated_low: f64, high: f64) -> Self {
        if (negated_low + high).is_nan() { Self::ENTIRE } else { Self { negated_low, high } }
    }

    /// Lower end.
    #[must_use]
    #[inline]
    pub fn low(self) -> f64 {
        -self.negated_low
    }

    /// Upper end.
    #[must_use]
    #[inline]
    pub fn high(self) -> f64 {
        self.high
    }

    /// A number of the interval near its middle (0 for an interval without a finite middle).
    #[must_use]
    #[inline]
    pub fn middle(self) -> f64 {
        let middle = 0.5 * self.high - 0.5 * self.negated_low;
        if middle.is_finite() { middle.clamp(self.low(), self.high) } else { 0.0 }
    }

    /// At least the distance of [`Interval::middle`] from either end.
    #[must_use]
    #[inline]
    pub fn radius(self) -> f64 {
        let middle = self.middle();
        up((self.high - middle).max(middle + self.negated_low))
    }

    /// Largest absolute value.
    #[must_use]
    #[inline]
    pub fn magnitude(self) -> f64 {
        self.high.max(self.negated_low)
    }

    /// Smallest absolute value.
    #[must_use]
    #[inline]
    pub fn mignitude(self) -> f64 {
        self.low().max(-self.high).max(0.0)
    }

    /// Whether both ends are finite.
    #[must_use]
    #[inline]
    pub fn is_bounded(self) -> bool {
        self.negated_low < f64::INFINITY && self.high < f64::INFINITY
    }

    /// Whether `value` is one of its numbers.
    #[must_use]
    #[inline]
    pub fn contains(self, value: f64) -> bool {
        self.low() <= value && value <= self.high
    }

    /// Whether all numbers of `self` lie in `other`, none at its ends.
    #[must_use]
    #[inline]
    pub fn is_inside(self, other: Self) -> bool {
        self.negated_low < other.negated_low && self.high < other.high
    }

    /// The smallest interval with the numbers of both.
    #[must_use]
    #[inline]
    pub fn hull(self, other: Self) -> Self {
        Self {
            negated_low: self.negated_low.max(other.negated_low),
            high: self.high.max(other.high),
        }
    }

    /// The numbers of both; `None` when there are none.
    #[must_use]
    #[inline]
    pub fn intersection(self, other: Self) -> Option<Self> {
        let (negated_low, high) =
            (self.negated_low.min(other.negated_low), self.high.min(other.high));
        (-negated_low <= high).then_some(Self { negated_low, high })
    }

    /// All squares of its numbers.
    #[must_use]
    #[inline]
    pub fn square(self) -> Self {
        let (small, large) = (self.mignitude(), self.magnitude());
        let low = -up(-(small * small));
        Self::checked(-low.max(0.0), up(large * large))
    }

    /// Natural logarithm; [`Interval::ENTIRE`] unless it is positive.
    ///
    /// The logarithm of libm (FreeBSD's) errs by less than one unit in the last place, which is at
    /// most two units of rounding.
    #[must_use]
    #[inline]
    pub fn ln(self) -> Self {
        if self.low() > 0.0 {
            let (low, high) = (libm::log(self.low()), libm::log(self.high));
            Self::checked(up_by(-low, 3.0), up_by(high, 3.0))
        } else {
            Self::ENTIRE
        }
    }
}

impl Interval {
    /// Exponential function.
    ///
    /// That of libm (FreeBSD's) errs by less than one unit in the last place, which is at most two
    /// units of rounding; below the smallest normal number nothing is known of it.
    #[must_use]
    #[inline]
    pub fn exp(self) -> Self {
        let (low, high) = (libm::exp(self.low()), libm::exp(self.high));
        let least = f64::MIN_POSITIVE;
        let negated_low = if low > least { up_by(-low, 3.0) } else { -0.0 };
        Self::checked(negated_low, up_by(high.max(least), 3.0))
    }

    /// Derivative of [`Scalar::atanh_tail`] by `q`, that is `2q/5 + 4q^3/7 + 6q^5/9 + ...`, for
    /// `0 <= q < 1` with its complement to one. All terms rise with `q`.
    #[must_use]
    pub(crate) fn atanh_tail_slope(q: Self, complement: Self) -> Self {
        rising(q, complement, tail_slope)
    }
}

/// The slope of the tail for a thin interval `q` with its complement to one.
///
/// From `q^3 tail + q = atanh(q)` it is `(1/(1 - q^2) - 3 tail)/q`. That cancels for small `q`, where
/// it is between the first two terms and these with the second over `(1 - q^2)^2`: the coefficient of
/// `q^(2k - 1)`, `2k/(2k + 3)`, is at most `(k - 1) 4/7`.
fn tail_slope(q: Interval, complement: Interval) -> Interval {
    let (one, four) = (Interval::one(), Interval::point(4.0));
    let open = complement * (one + q);
    if q.high < 0.25 {
        let first = Interval::point(2.0) * q / Interval::point(5.0);
        let second = four * q * q.square() / Interval::point(7.0);
        return (first + second).hull(first + second / open.square());
    }
    (one / open - Interval::point(3.0) * tail(q, complement)) / q
}

impl fmt::Debug for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{:e}, {:e}]", self.low(), self.high)
    }
}

impl Neg for Interval {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { negated_low: self.high, high: self.negated_low }
    }
}

impl Add for Interval {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::outwards(self.negated_low + other.negated_low, self.high + other.high)
    }
}

impl Sub for Interval {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::outwards(self.negated_low + other.high, self.high + other.negated_low)
    }
}

impl Mul for Interval {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self, other);
        // By the signs, which are mostly the same wherever a product stands: two products do unless both have zero
        // inside. Zero times infinity is NaN, of which nothing is known.
        if a.negated_low <= 0.0 {
            let low_by = if b.negated_low <= 0.0 { -a.negated_low } else { a.high };
            let high_by = if b.high >= 0.0 { a.high } else { -a.negated_low };
            return Self::outwards(low_by * b.negated_low, high_by * b.high);
        }
        if a.high <= 0.0 {
            let low_by = if b.high >= 0.0 { a.negated_low } else { -a.high };
            let high_by = if b.negated_low <= 0.0 { -a.high } else { a.negated_low };
            return Self::outwards(low_by * b.high, high_by * b.negated_low);
        }
        if b.negated_low <= 0.0 {
            return Self::outwards(a.negated_low * b.high, a.high * b.high);
        }
        if b.high <= 0.0 {
            return Self::outwards(a.high * b.negated_low, a.negated_low * b.negated_low);
        }
        Self::outwards(
            (a.negated_low * b.high).max(a.high * b.negated_low),
            (a.high * b.high).max(a.negated_low * b.negated_low),
        )
    }
}

impl Div for Interval {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let (a, b) = (self, other);
        if b.negated_low < 0.0 {
            // Divided by positive numbers: each end by the one that takes it further out.
            let low_by = if a.negated_low > 0.0 { -b.negated_low } else { b.high };
            let high_by = if a.high > 0.0 { -b.negated_low } else { b.high };
            Self::outwards(a.negated_low / low_by, a.high / high_by)
        } else if b.high < 0.0 {
            -(a / -b)
        } else {
            Self::ENTIRE
        }
    }
}

macro_rules! assigning {
    ($($trait:ident $method:ident $by:ident),*) => {$(
        impl $trait for Interval {
            #[inline]
            fn $method(&mut self, other: Self) {
                *self = (*self).$by(other);
            }
        }
    )*};
}

assigning!(AddAssign add_assign add, SubAssign sub_assign sub, MulAssign mul_assign mul, DivAssign div_assign div);

impl Zero for Interval {
    #[inline]
    fn zero() -> Self {
        Self { negated_low: -0.0, high: 0.0 }
    }

    fn is_zero(&self) -> bool {
        self.negated_low == 0.0 && self.high == 0.0
    }
}

impl One for Interval {
    #[inline]
    fn one() -> Self {
        Self { negated_low: -1.0, high: 1.0 }
    }
}

impl Scalar for Interval {
    /// The float itself: constants of the models are floats, or reciprocals that are rounded to one.
    #[inline]
    fn constant(value: f64) -> Self {
        // A reciprocal as 1/3 is off by half a unit in the last place, the powers of two are exact.
        // Widening all of them costs nothing that matters.
        Self::outwards(-value, value)
    }

    /// Of the part that is not negative; the processor rounds square roots to nearest.
    #[inline]
    fn sqrt(self) -> Self {
        if self.high < 0.0 {
            return Self::ENTIRE;
        }
        let low = -up(-self.low().max(0.0).sqrt());
        Self::checked(-low.max(0.0), up(self.high.sqrt()))
    }

    #[inline]
    fn hypot_with_excess(x: Self, z: Self) -> (Self, Self) {
        let (near, far) = (x.mignitude(), x.magnitude());
        let t =
            Self::checked(hypot(near, z.mignitude()).negated_low, hypot(far, z.magnitude()).high);
        let excess = Self::checked(-excess(near, z.high).low().max(0.0), excess(far, z.low()).high);
        (t, excess)
    }

    #[inline]
    fn atanh_tail(q: Self, complement: Self) -> Self {
        rising(q, complement, tail)
    }
}

/// A function that rises with `q`, over all `q` and their complements to one, from what it is for a thin
/// `q`.
///
/// The two are views of one number, `q` itself and `1 - complement`: the tighter one counts at each end.
/// They are compared as complements, in which near `q = 1` neither loses digits.
#[inline]
fn rising(
    q: Interval,
    complement: Interval,
    thin: impl Fn(Interval, Interval) -> Interval,
) -> Interval {
    let one = Interval::one();
    let from_q = one - q;
    let low = if complement.high < from_q.high {
        let end = Interval::point(complement.high.min(1.0));
        thin(one - end, end)
    } else {
        let end = Interval::point(q.low().max(0.0));
        thin(end, one - end)
    };
    let high = if complement.low() > from_q.low() {
        let end = Interval::point(complement.low());
        thin(one - end, end)
    } else {
        let end = Interval::point(q.high);
        thin(end, one - end)
    };
    Interval::checked(low.negated_low, high.high)
}

/// `sqrt(x^2 + z^2)` of two floats.
///
/// Two products, a sum and a root: the relative error is below 1 + 1/2 + 1 units and their products,
/// as long as the squares neither overflow nor underflow; 4 are taken.
#[inline]
fn hypot(x: f64, z: f64) -> Interval {
    let (x, z) = (x.abs(), z.abs());
    let largest = x.max(z);
    if (1e-140..1e150).contains(&largest) {
        let t = (x * x + z * z).sqrt();
        Interval::checked(up_by(-t, 4.0), up_by(t, 4.0))
    } else {
        Interval::checked(-largest, up(x + z))
    }
}

/// `sqrt(x^2 + z^2) - z` of two floats, rising with `|x|` and falling with `z`.
///
/// For `z > 0` it is `x (x / (t + z))`: 4 units for the distance, one for each of three operations.
#[inline]
fn excess(x: f64, z: f64) -> Interval {
    let t = hypot(x, z);
    if z > 0.0 {
        let part = Interval::point(x.abs());
        part * (part / (t + Interval::point(z)))
    } else {
        t - Interval::point(z)
    }
}

/// `(atanh(q)/q - 1)/q^2` for a thin interval `q` with its complement to one.
#[inline]
fn tail(q: Interval, complement: Interval) -> Interval {
    if q.high < 0.25 {
        // The float version sums a series of positive terms: 13 products and sums, each of at most
        // one unit, the rounding of the constants, and 2e-17 left out. `q` may be off by its width.
        let (low, high) = (
            <f64 as Scalar>::atanh_tail(q.low().max(0.0), 1.0),
            <f64 as Scalar>::atanh_tail(q.high.max(0.0), 1.0),
        );
        return Interval::checked(up_by(-low, 48.0), up_by(high, 48.0));
    }
    let one = Interval::one();
    let logarithm = ((one + q) / complement).ln();
    (Interval::point(0.5) * logarithm / q - one) / q.square()
}
