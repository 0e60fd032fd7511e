//! The interval type of the proofs encloses, and narrowly: operation by operation against ranges that
//! are exact or have 50 digits (`oracles/interval.py`), then whole cable models. The same source that
//! runs on the controller carries the proofs.

#![allow(clippy::float_cmp)] // ends of intervals are what they are, to the bit

use cdpr_core::{CableModel, EndPoint, IrvineCatenary, LinearElastic, Parabola, Scalar};
use cdpr_host_sim::interval::Interval;
use cdpr_tests::{CableCase, IntervalCase, cable_cases, interval_cases};
use nalgebra::Vector2;
use num_traits::{One, Zero};

/// How many floats the ends of an enclosure may be beyond the range. A unit is `2^-53`; one float is
/// one to two of them.
mod beyond {
    /// Rounding to nearest may have gone outwards already; then `up` goes one float on, or two just
    /// above the subnormal numbers, where the least number that it adds counts.
    pub(crate) const ROUNDED: f64 = 2.0;
    /// Less than one float of error of the logarithm, three units for it, which are up to three
    /// floats, and their rounding.
    pub(crate) const LOGARITHM: f64 = 5.0;
    /// Two units of rounding of the distance, four for them, and the rounding of that.
    pub(crate) const DISTANCE: f64 = 7.0;
    /// The distance, then three operations of up to three units each (rounding and [`ROUNDED`]).
    pub(crate) const EXCESS: f64 = DISTANCE + 9.0;
    /// The series of `atanh_tail`: 48 units, what they stand for, and the rounding of that.
    pub(crate) const SERIES: f64 = 56.0;

    /// The logarithm in `atanh_tail` at `q`, where the tail is `t`. Sum, complement and quotient in
    /// its argument are good to 10 units, which are as many of the logarithm in absolute terms; its
    /// own 6, half of it 2, `q` and the quotient 6 come on top. All this is relative to `1 + q^2 t`,
    /// from which 1 is taken away; the last operations add `3 + 9 + 3` units.
    pub(crate) fn logarithm_in_tail(q: f64, t: f64) -> f64 {
        let sum = 1.0 + q * q * t;
        let logarithm = 2.0 * q * sum;
        (10.0 / logarithm + 14.0) * sum / (q * q * t) + 15.0
    }

    /// Where squares would overflow or underflow the distance is only known to be between the larger
    /// coordinate and the sum of both: this factor.
    pub(crate) const ROUGH_DISTANCE: f64 = core::f64::consts::SQRT_2 + 1e-9;
}

/// Width of the end point of a single force and length, times `eps L` with L the rest length: the
/// longest path rounds 18 times, each up to three units to each side; largest found 34.
const POSITION_WIDTH: f64 = 54.0;

/// Width of its derivative, times `eps` and the largest entry of its row, the columns of Fx and Fz
/// times `(|Fx| + |Fz|)/L`: products of up to five paths, 25 roundings each; largest found 185.
const JACOBIAN_WIDTH: f64 = 375.0;

/// Floats in their order, as integers without gaps.
fn ordinal(value: f64) -> i128 {
    let magnitude = i128::from(value.abs().to_bits());
    if value < 0.0 { -magnitude } else { magnitude }
}

/// What `Interval` makes of the case; nothing for an intersection that is empty.
fn evaluate(case: &IntervalCase) -> Option<Interval> {
    let operand = |i: usize| Interval::new(case.operands[i][0], case.operands[i][1]);
    let a = operand(0);
    Some(match case.operation.as_str() {
        "add" => a + operand(1),
        "sub" => a - operand(1),
        "mul" => a * operand(1),
        "div" => a / operand(1),
        "neg" => -a,
        "square" => a.square(),
        "sqrt" => a.sqrt(),
        "ln" => a.ln(),
        "hull" => a.hull(operand(1)),
        "intersection" => return a.intersection(operand(1)),
        "around" => Interval::around(case.operands[0][0], case.operands[1][0]),
        "distance" => Interval::hypot_with_excess(a, operand(1)).0,
        "excess" => Interval::hypot_with_excess(a, operand(1)).1,
        "tail" => Interval::atanh_tail(a, operand(1)),
        "constant" => Interval::constant(case.operands[0][0]),
        other => panic!("{other} is not an operation"),
    })
}

/// How many floats the lower and the upper end may be off; infinite where only soundness is asked.
fn allowance(case: &IntervalCase) -> [f64; 2] {
    let among = |is: fn(f64) -> bool| case.operands.iter().flatten().all(|&v| is(v));
    // Infinity times zero gives up.
    if !among(f64::is_finite) {
        return [f64::INFINITY; 2];
    }
    // Of the larger coordinate at either end.
    let square_is_ordinary = |v: f64| v == 0.0 || (1e-140..1e150).contains(&v.abs());
    let squares_are_ordinary = || {
        let is_point = case.operands.iter().all(|[low, high]| low == high);
        let largest = case.operands.iter().fold(0.0, |most: f64, [v, _]| most.max(v.abs()));
        if is_point { square_is_ordinary(largest) } else { among(square_is_ordinary) }
    };
    match case.operation.as_str() {
        "neg" | "hull" | "intersection" => [0.0; 2],
        "ln" => [beyond::LOGARITHM; 2],
        "distance" | "excess" if !squares_are_ordinary() => [f64::INFINITY; 2],
        "distance" => [beyond::DISTANCE; 2],
        "excess" => [beyond::EXCESS; 2],
        "tail" => {
            let (q, complement) = (case.operands[0], case.operands[1]);
            let limit = |q: f64, complement: f64, tail: f64| {
                if complement < 1e-300 {
                    f64::INFINITY // two over that may overflow
                } else if q < 0.25 - 1e-9 {
                    beyond::SERIES
                } else {
                    beyond::logarithm_in_tail(q, tail)
                }
            };
            let low = [q[0].max(1.0 - complement[1]), complement[1].min(1.0 - q[0])];
            let high = [q[1].min(1.0 - complement[0]), complement[0].max(1.0 - q[1])];
            [limit(low[0], low[1], case.range[0]), limit(high[0], high[1], case.range[1])]
        }
        _ => [beyond::ROUNDED; 2],
    }
}

#[test]
fn every_operation_encloses_the_exact_range_narrowly() {
    for case in interval_cases() {
        let [least, greatest] = case.range;
        let Some(result) = evaluate(&case) else {
            assert!(least > greatest, "not empty: {case:?}");
            continue;
        };
        assert!(result.low() <= least && greatest <= result.high(), "{case:?}: {result:?}");
        if ["square", "sqrt", "distance", "excess"].contains(&case.operation.as_str()) {
            assert!(result.low() >= 0.0, "{case:?}: {result:?}");
        }
        // What overflows as a whole need not be told from everything.
        if least == f64::MAX || greatest == -f64::MAX {
            continue;
        }
        let allowed = allowance(&case);
        let off = [(result.low(), least), (result.high(), greatest)]
            .map(|(end, exact)| (ordinal(end) - ordinal(exact)).abs() as f64);
        assert!(off[0] <= allowed[0] && off[1] <= allowed[1], "{case:?}: {result:?} {off:?}");
    }
}

#[test]
fn distances_without_ordinary_squares_are_rough_but_no_more() {
    let mut found = 0;
    for case in interval_cases().iter().filter(|case| case.operation == "distance") {
        let result = evaluate(case).expect("never empty");
        let [least, greatest] = case.range;
        if greatest < f64::MAX / 2.0 {
            found += 1;
            assert!(result.low() * beyond::ROUGH_DISTANCE >= least, "{case:?}: {result:?}");
            let rough = greatest * beyond::ROUGH_DISTANCE;
            assert!(result.high() <= rough.next_up().next_up(), "{case:?}: {result:?}");
        }
    }
    assert!(found > 100);
}

#[test]
fn what_cannot_be_enclosed_is_everything() {
    let everything = [
        Interval::new(2.0, 1.0),
        Interval::new(f64::NAN, 1.0),
        Interval::new(1.0, f64::NAN),
        Interval::point(f64::NAN),
        Interval::point(f64::INFINITY),
        Interval::point(f64::NEG_INFINITY),
        Interval::around(f64::NAN, 1.0),
        Interval::around(0.0, f64::NAN),
        Interval::around(f64::INFINITY, f64::INFINITY),
        Interval::around(1.0, -0.1),
        Interval::symmetric(f64::INFINITY),
        Interval::symmetric(-0.1),
        Interval::symmetric(f64::NAN),
        Interval::constant(f64::NAN),
        Interval::one() / Interval::zero(),
        Interval::one() / Interval::new(0.0, 1.0),
        Interval::one() / Interval::new(-1.0, 0.0),
        Interval::one() / Interval::new(-1.0, 1.0),
        Interval::one() / Interval::ENTIRE,
        Interval::new(-1.0, 1.0).ln(),
        Interval::new(0.0, 1.0).ln(),
        Interval::new(-2.0, -1.0).ln(),
        Interval::new(-2.0, -1.0).sqrt(),
        Interval::ENTIRE + Interval::ENTIRE,
        Interval::ENTIRE - Interval::ENTIRE,
        Interval::ENTIRE * Interval::ENTIRE,
        Interval::ENTIRE * Interval::zero(),
        Interval::point(f64::MAX) * Interval::point(f64::MAX),
        Interval::point(f64::MAX) + Interval::point(f64::MAX),
        -Interval::ENTIRE,
    ];
    for (i, result) in everything.into_iter().enumerate() {
        assert_eq!(result, Interval::ENTIRE, "number {i}");
    }
    // Not told from everything, but sound.
    for (x, z) in [(f64::INFINITY, 1.0), (1.0, f64::INFINITY), (f64::INFINITY, f64::INFINITY)] {
        let (x, z) = (Interval::new(0.0, x), Interval::new(-z, z));
        let (distance, excess) = Interval::hypot_with_excess(x, z);
        assert!(distance.low() >= 0.0 && distance.high() == f64::INFINITY);
        assert!(excess.low() >= 0.0 && excess.high() == f64::INFINITY);
    }
    assert_eq!(Interval::ENTIRE.square(), Interval::new(0.0, f64::INFINITY));
    assert_eq!(Interval::ENTIRE.sqrt(), Interval::new(0.0, f64::INFINITY));
    let tail = Interval::atanh_tail(Interval::ENTIRE, Interval::ENTIRE);
    assert!(tail.low() <= 1.0 / 3.0 && tail.high() == f64::INFINITY);
    // Overflow of one end leaves the other.
    let large = Interval::new(1.0, 1e200);
    assert_eq!((large * large).high(), f64::INFINITY);
    assert!((large * large).low() > 0.999);
    assert!(large.square().low() > 0.999);
}

#[test]
fn queries_answer_about_the_numbers_of_the_interval() {
    let (wide, point) = (Interval::new(-3.0, 2.0), Interval::point(0.1));
    assert_eq!(
        (wide.low(), wide.high(), wide.magnitude(), wide.mignitude()),
        (-3.0, 2.0, 3.0, 0.0)
    );
    assert_eq!((-wide).magnitude(), 3.0);
    assert_eq!(
        (Interval::new(2.0, 3.0).mignitude(), Interval::new(-3.0, -2.0).mignitude()),
        (2.0, 2.0)
    );
    assert_eq!((point.low(), point.high(), point.middle()), (0.1, 0.1, 0.1));
    assert_eq!(Interval::symmetric(2.0), Interval::new(-2.0, 2.0));
    assert_eq!((Interval::zero(), Interval::one()), (Interval::point(0.0), Interval::point(1.0)));
    assert!(Interval::zero().is_zero() && !wide.is_zero() && !Interval::new(0.0, 1.0).is_zero());
    assert!(wide.contains(-3.0) && wide.contains(2.0) && wide.contains(0.0));
    assert!(!wide.contains(2.0_f64.next_up()) && !wide.contains((-3.0_f64).next_down()));
    assert!(!Interval::ENTIRE.contains(f64::NAN) && Interval::ENTIRE.contains(f64::MAX));
    assert!(wide.is_bounded() && !Interval::ENTIRE.is_bounded());
    assert!(!Interval::new(0.0, f64::INFINITY).is_bounded());
    assert!(!Interval::new(f64::NEG_INFINITY, 0.0).is_bounded());
    let inner = Interval::new((-3.0_f64).next_up(), 2.0_f64.next_down());
    assert!(inner.is_inside(wide) && !wide.is_inside(inner) && !wide.is_inside(wide));
    assert!(!Interval::new(-3.0, 1.0).is_inside(wide) && !Interval::new(-1.0, 2.0).is_inside(wide));
    assert_eq!(Interval::ENTIRE.middle(), 0.0);
    assert_eq!(Interval::ENTIRE.radius(), f64::INFINITY);
    let mut sum = wide;
    sum += point;
    assert_eq!(sum, wide + point);
    sum -= point;
    assert_eq!(sum, wide + point - point);
    sum *= point;
    assert_eq!(sum, (wide + point - point) * point);
    sum /= point;
    assert_eq!(sum, (wide + point - point) * point / point);
}

#[test]
fn the_radius_reaches_both_ends_from_the_middle() {
    for case in interval_cases() {
        let interval = Interval::new(case.operands[0][0], case.operands[0][1]);
        let (middle, radius) = (interval.middle(), interval.radius());
        if !interval.is_bounded() {
            assert_eq!(radius, f64::INFINITY, "{interval:?}");
            continue;
        }
        assert!(interval.contains(middle), "{interval:?}");
        for (a, b) in [(interval.high(), middle), (middle, interval.low())] {
            // a - b is `difference + error` without error (D. Knuth's two-sum).
            let difference = a - b;
            let taken = a - difference;
            let error = (a - (difference + taken)) + (taken - b);
            let reaches = radius > difference || (radius == difference && error <= 0.0);
            assert!(reaches, "{interval:?}: {radius:e}");
        }
        // Half the width, and no more than the rounding of the middle and the step outwards.
        let half = 0.5 * interval.high() - 0.5 * interval.low();
        let rounding = 4.0 * f64::EPSILON * interval.magnitude() + 1e-322;
        assert!(radius <= half + rounding, "{interval:?}: {radius:e}");
    }
}

fn irvine(case: &CableCase) -> IrvineCatenary<Interval> {
    IrvineCatenary {
        weight_n_m: Interval::point(case.weight_n_m),
        compliance_per_n: Interval::one() / Interval::point(case.axial_stiffness_n),
    }
}

/// The reference is itself rounded to a float: off by less than one.
fn assert_encloses_rounded(interval: Interval, value: f64, what: &str) {
    let meets = interval.low() < value.next_up() && value.next_down() < interval.high();
    assert!(meets, "{what}: {value:e} is not in {interval:?}");
}

#[test]
fn a_point_interval_encloses_the_50_digit_end_point_and_jacobian_narrowly() {
    for case in cable_cases() {
        let end = irvine(&case)
            .end_point(case.force_n().map(Interval::point), Interval::point(case.rest_length_m));
        let width = |interval: Interval| interval.high() - interval.low();
        let length_m = case.rest_length_m;
        for (&interval, &value) in end.position_m.iter().zip(&case.position_m()) {
            assert_encloses_rounded(interval, value, &case.kind);
            assert!(width(interval) < POSITION_WIDTH * f64::EPSILON * length_m, "{interval:?}");
        }
        let force_n = case.fx_n.abs() + case.fz_n.abs();
        let scale = [force_n, force_n, length_m];
        for row in 0..2 {
            let entry = |column: usize| case.jacobian[(row, column)];
            let largest = (0..3).map(|i| (entry(i) * scale[i]).abs()).fold(0.0, f64::max);
            for column in 0..3 {
                let interval = end.jacobian[(row, column)];
                assert_encloses_rounded(interval, entry(column), &case.kind);
                let narrow = JACOBIAN_WIDTH * f64::EPSILON * largest;
                assert!(width(interval) * scale[column] < narrow, "{row} {column} {case:?}");
            }
        }
    }
}

fn assert_encloses(wide: &EndPoint<Interval>, narrow: &EndPoint<f64>) {
    let values = narrow.position_m.iter().chain(&narrow.jacobian);
    for (interval, &value) in wide.position_m.iter().chain(&wide.jacobian).zip(values) {
        assert!(interval.contains(value), "{value:e} is not in {interval:?}");
    }
}

#[test]
fn boxes_of_forces_and_lengths_are_enclosed_by_every_model() {
    for case in cable_cases().iter().filter(|case| case.kind != "almost_vertical") {
        let share = 1e-4;
        let wide = |v: f64| Interval::around(v, share * v.abs());
        let (w, k) = (case.weight_n_m, 1.0 / case.axial_stiffness_n);
        let (wi, ki) = (Interval::point(w), Interval::point(k));
        let box_n = case.force_n().map(wide);
        let length = wide(case.rest_length_m);
        let irvine =
            IrvineCatenary { weight_n_m: wi, compliance_per_n: ki }.end_point(box_n, length);
        let parabola = Parabola { weight_n_m: wi, compliance_per_n: ki }.end_point(box_n, length);
        let elastic = LinearElastic { compliance_per_n: ki }.end_point(box_n, length);
        // The corners and, with a third of the way for each number, points between them.
        for sample in 0..64_u32 {
            let at = |digit: u32, v: f64| {
                let thirds = f64::from(sample >> (2 * digit) & 3);
                v + share * v.abs() * (2.0 / 3.0 * thirds - 1.0)
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
