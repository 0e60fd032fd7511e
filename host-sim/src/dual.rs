//! Numbers that know how they change with a parameter: forward differentiation in intervals.
//!
//! A [`Dual`] encloses a quantity and its derivative by one parameter, for every value of the
//! parameter (and of everything else) over an interval. Where the deformation itself is one of the
//! unknowns, around a fold, a proof needs the derivative of a cable's end point by it, and a model that
//! is written in a generic [`Scalar`] gives it without a formula of its own.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use cdpr_core::Scalar;
use num_traits::{One, Zero};

use crate::interval::Interval;

/// A quantity and its rate of change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual {
    /// Encloses the quantity.
    pub value: Interval,
    /// Encloses its derivative by the parameter.
    pub rate: Interval,
}

impl Dual {
    /// Something in `value` that does not change.
    #[must_use]
    pub fn fixed(value: Interval) -> Self {
        Self { value, rate: Interval::zero() }
    }

    /// The number `value`.
    #[must_use]
    pub fn point(value: f64) -> Self {
        Self::fixed(Interval::point(value))
    }

    /// The parameter itself.
    #[must_use]
    pub fn parameter(value: Interval) -> Self {
        Self { value, rate: Interval::one() }
    }

    /// Exponential function.
    #[must_use]
    pub fn exp(self) -> Self {
        let value = self.value.exp();
        Self { value, rate: value * self.rate }
    }
}

/// `a b`, exactly zero where a rate `a` is: most rates are, and what rounding would make of them
/// costs the processor a hundred times as much as a number.
#[inline]
fn times(a: Interval, b: Interval) -> Interval {
    if a.is_zero() { a } else { a * b }
}

/// `a + b` with the same care.
#[inline]
fn sum(a: Interval, b: Interval) -> Interval {
    if a.is_zero() {
        b
    } else if b.is_zero() {
        a
    } else {
        a + b
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, rate: -self.rate }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, rate: sum(self.rate, other.rate) }
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, rate: sum(self.rate, -other.rate) }
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            rate: sum(times(self.rate, other.value), times(other.rate, self.value)),
        }
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let rate = sum(self.rate, -times(other.rate, value));
        Self { value, rate: if rate.is_zero() { rate } else { rate / other.value } }
    }
}

macro_rules! assigning {
    ($($trait:ident $method:ident $by:ident),*) => {$(
        impl $trait for Dual {
            fn $method(&mut self, other: Self) {
                *self = (*self).$by(other);
            }
        }
    )*};
}

assigning!(AddAssign add_assign add, SubAssign sub_assign sub, MulAssign mul_assign mul, DivAssign div_assign div);

impl Zero for Dual {
    fn zero() -> Self {
        Self::fixed(Interval::zero())
    }

    fn is_zero(&self) -> bool {
        self.value.is_zero() && self.rate.is_zero()
    }
}

impl One for Dual {
    fn one() -> Self {
        Self::fixed(Interval::one())
    }
}

impl Scalar for Dual {
    fn constant(value: f64) -> Self {
        Self::fixed(Interval::constant(value))
    }

    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        let rate = self.rate;
        Self { value, rate: if rate.is_zero() { rate } else { rate / (value + value) } }
    }

    /// The rate of the excess is `(x x' - (t - z) z')/t`, in which nothing cancels that need not.
    fn hypot_with_excess(x: Self, z: Self) -> (Self, Self) {
        let (t, excess) = Interval::hypot_with_excess(x.value, z.value);
        let (mut t_rate, mut excess_rate) = (Interval::zero(), Interval::zero());
        if !(x.rate.is_zero() && z.rate.is_zero()) {
            let across = times(x.rate, x.value);
            t_rate = sum(across, times(z.rate, z.value)) / t;
            excess_rate = sum(across, -times(z.rate, excess)) / t;
        }
        (Self { value: t, rate: t_rate }, Self { value: excess, rate: excess_rate })
    }

    fn atanh_tail(q: Self, complement: Self) -> Self {
        Self {
            value: Interval::atanh_tail(q.value, complement.value),
            rate: if q.rate.is_zero() {
                q.rate
            } else {
                Interval::atanh_tail_slope(q.value, complement.value) * q.rate
            },
        }
    }
}
