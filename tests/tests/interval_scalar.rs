//! The scalar trait can be implemented by intervals, and the models then enclose: the same source that
//! runs on the controller will carry the proofs.
//!
//! This interval is as small as the purpose allows: each operation is rounded outwards by one number.

use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use cdpr_core::{CableModel, EndPoint, IrvineCatenary, LinearElastic, Parabola, Scalar};
use cdpr_tests::cable_cases;
use nalgebra::Vector2;
use num_traits::{One, Zero};

#[derive(Clone, Copy, Debug, PartialEq)]
struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    fn point(value: f64) -> Self {
        Self { low: value, high: value }
    }

    fn hull(values: &[f64]) -> Self {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self { low: low.next_down(), high: high.next_up() }
    }

    /// A function that rises in its argument and whose float version is good to `ulps` numbers.
    fn rising(self, f: impl Fn(f64) -> f64, ulps: u32) -> Self {
        let (mut low, mut high) = (f(self.low), f(self.high));
        for _ in 0..ulps {
            (low, high) = (low.next_down(), high.next_up());
        }
        Self { low, high }
    }

    fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

macro_rules! operator {
    ($trait:ident $method:ident, $assign:ident $assign_method:ident, $body:expr) => {
        impl $trait for Interval {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                let body: fn(Self, Self) -> Self = $body;
                body(self, other)
            }
        }
        impl $assign for Interval {
            fn $assign_method(&mut self, other: Self) {
                *self = $trait::$method(*self, other);
            }
        }
    };
}

operator!(Add add, AddAssign add_assign, |a, b| Interval::hull(&[a.low + b.low, a.high + b.high]));
operator!(Sub sub, SubAssign sub_assign, |a, b| Interval::hull(&[a.low - b.high, a.high - b.low]));
operator!(Mul mul, MulAssign mul_assign, |a, b| Interval::hull(&[
    a.low * b.low,
    a.low * b.high,
    a.high * b.low,
    a.high * b.high
]));
operator!(Div div, DivAssign div_assign, |a, b| {
    assert!(b.low > 0.0 || b.high < 0.0, "division by an interval that holds zero");
    Interval::hull(&[a.low / b.low, a.low / b.high, a.high / b.low, a.high / b.high])
});

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

impl Zero for Interval {
    fn zero() -> Self {
        Self::point(0.0)
    }
    fn is_zero(&self) -> bool {
        *self == Self::zero()
    }
}

impl One for Interval {
    fn one() -> Self {
        Self::point(1.0)
    }
}

impl Scalar for Interval {
    fn constant(value: f64) -> Self {
        Self::point(value)
    }

    fn sqrt(self) -> Self {
        self.rising(f64::sqrt, 1)
    }

    fn hypot_with_excess(x: Self, z: Self) -> (Self, Self) {
        // Monotone in |x|; the distance in |z|, the excess falling in z. 4 roundings each.
        let away = |i: Self| i.low.abs().max(i.high.abs());
        let close = |i: Self| if i.contains(0.0) { 0.0 } else { i.low.abs().min(i.high.abs()) };
        let at = <f64 as Scalar>::hypot_with_excess;
        let widen = |low: f64, high: f64| Self { low, high }.rising(|v| v, 4);
        (
            widen(at(close(x), close(z)).0, at(away(x), away(z)).0),
            widen(at(close(x), z.high).1, at(away(x), z.low).1),
        )
    }

    fn atanh_tail(q: Self, complement: Self) -> Self {
        // Rises with q. Below q = 1/4 the series is exact to 2 numbers, beyond it cancellation costs
        // up to 48 of them (see core/src/scalar.rs).
        let low = <f64 as Scalar>::atanh_tail(q.low.max(0.0), complement.high.min(1.0));
        let high = <f64 as Scalar>::atanh_tail(q.high, complement.low);
        Self { low, high }.rising(|v| v, 200)
    }
}

fn assert_encloses(wide: &EndPoint<Interval>, narrow: &EndPoint<f64>) {
    let values = narrow.position_m.iter().chain(&narrow.jacobian);
    for (interval, &value) in wide.position_m.iter().chain(&wide.jacobian).zip(values) {
        assert!(interval.contains(value), "{value:e} is not in {interval:?}");
    }
}

#[test]
fn a_point_interval_encloses_the_50_digit_end_point_narrowly() {
    for case in cable_cases() {
        let model = IrvineCatenary {
            weight_n_m: Interval::point(case.weight_n_m),
            compliance_per_n: Interval::one() / Interval::point(case.axial_stiffness_n),
        };
        let end = model
            .end_point(case.force_n().map(Interval::point), Interval::point(case.rest_length_m));
        for (interval, value) in end.position_m.iter().zip(case.position_m().iter()) {
            // The reference is itself rounded to a float.
            assert!(interval.low.next_down() <= *value && *value <= interval.high.next_up());
            assert!(interval.high - interval.low < 1e-12 * case.rest_length_m, "{interval:?}");
        }
    }
}

#[test]
fn boxes_of_forces_and_lengths_are_enclosed_by_every_model() {
    for case in cable_cases().iter().filter(|case| case.kind != "almost_vertical") {
        let share = 1e-4;
        let wide = |v: f64| Interval::hull(&[v * (1.0 - share), v * (1.0 + share)]);
        let (w, k) = (case.weight_n_m, 1.0 / case.axial_stiffness_n);
        let (wi, ki) = (Interval::point(w), Interval::point(k));
        let box_n = case.force_n().map(wide);
        let length = wide(case.rest_length_m);
        let irvine =
            IrvineCatenary { weight_n_m: wi, compliance_per_n: ki }.end_point(box_n, length);
        let parabola = Parabola { weight_n_m: wi, compliance_per_n: ki }.end_point(box_n, length);
        let elastic = LinearElastic { compliance_per_n: ki }.end_point(box_n, length);
        for corner in 0..8_u32 {
            let at = |bit: u32, v: f64| {
                if corner >> bit & 1 == 1 { v * (1.0 + share) } else { v * (1.0 - share) }
            };
            let force_n = Vector2::new(at(0, case.fx_n), at(1, case.fz_n));
            let length_m = at(2, case.rest_length_m);
            let narrow = IrvineCatenary { weight_n_m: w, compliance_per_n: k };
            assert_encloses(&irvine, &narrow.end_point(force_n, length_m));
            let narrow = Parabola { weight_n_m: w, compliance_per_n: k };
            assert_encloses(&parabola, &narrow.end_point(force_n, length_m));
            assert_encloses(
                &elastic,
                &LinearElastic { compliance_per_n: k }.end_point(force_n, length_m),
            );
        }
    }
}
