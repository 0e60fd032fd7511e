//! Paths with a proof for every step, and the numbers that the proofs are computed in.

use cdpr_core::{CableModel, IrvineCatenary, Parabola, Scalar};
use cdpr_host_sim::continuation::BranchEnd;
use cdpr_host_sim::dual::Dual;
use cdpr_host_sim::enumerate::{Method, Options};
use cdpr_host_sim::interval::Interval;
use cdpr_tests::{cable_cases, paper_cases, random_cases};
use nalgebra::Vector2;

#[test]
fn every_step_of_the_reference_cases_is_proven() {
    let mut folds = 0;
    for case in paper_cases().iter().chain(&random_cases()) {
        let options = Options { method: Method::Continuation, ..Options::default() };
        let answer = case.request().enumerate(options).expect("a valid pose");
        for branch in &answer.branches {
            assert!(branch.is_certified(), "at {:?}: {branch}", case.position_m);
            assert!(branch.largest_contraction < 1.0);
            folds += branch.folds.len();
            if let BranchEnd::Solution(solution) = &branch.end {
                let origin = answer.rigid.solutions.iter().find(|r| r.slack == branch.origin);
                let same = origin.expect("its origin").is_positive == solution.is_positive;
                assert_eq!(same, branch.folds.len() % 2 == 0);
            }
        }
    }
    assert!(folds > 0, "no case with a fold");
}

fn dual(value: f64, rate: f64) -> Dual {
    Dual { value: Interval::point(value), rate: Interval::point(rate) }
}

#[test]
fn rates_enclose_the_50_digit_derivative() {
    for case in cable_cases() {
        let model = IrvineCatenary {
            weight_n_m: Dual::point(case.weight_n_m),
            compliance_per_n: Dual::point(case.axial_stiffness_n),
        };
        let one = Dual::point(1.0);
        let model = IrvineCatenary { compliance_per_n: one / model.compliance_per_n, ..model };
        for column in 0..3 {
            let rate = |k: usize| if k == column { 1.0 } else { 0.0 };
            let force_n = Vector2::new(dual(case.fx_n, rate(0)), dual(case.fz_n, rate(1)));
            let end = model.end_point(force_n, dual(case.rest_length_m, rate(2)));
            for row in 0..2 {
                let expected = case.jacobian[(row, column)];
                // The data are rounded to the nearest float.
                let found = end.position_m[row].rate + Interval::symmetric(1e-16 * expected.abs());
                assert!(found.contains(expected), "{row} {column}: {found:?} {case:?}");
            }
        }
    }
}

#[test]
fn rates_agree_with_central_differences() {
    // By the logarithm of the deformation, and everything else at the same time.
    let irvine = IrvineCatenary { weight_n_m: 0.775, compliance_per_n: 1e-5 };
    let parabola = Parabola { weight_n_m: 0.775, compliance_per_n: 1e-5 };
    for force_n in [Vector2::new(400.0, -300.0), Vector2::new(3.0, 1.0), Vector2::new(0.1, 9.0)] {
        let (length_m, step) = (20.0, 1e-5);
        let at = |h: f64| (force_n * (1.0 + 0.3 * h), length_m * (1.0 - 0.2 * h), h.exp());
        let moving = |v: f64, share: f64| dual(v, v * share);
        let s = Dual::parameter(Interval::point(0.0)).exp();
        let w = Dual::point(0.775) * s;
        let c = Dual::point(1e-5) * s;
        let force = force_n.map(|f| moving(f, 0.3));
        let length = moving(length_m, -0.2);
        let (ahead, behind) = (at(step), at(-step));
        let check = |rates: Vector2<Dual>,
                     end: &dyn Fn((Vector2<f64>, f64, f64)) -> Vector2<f64>| {
            let difference = (end(ahead) - end(behind)) / (2.0 * step);
            for k in 0..2 {
                // Truncation and rounding both leave 1e-10 of a length of 20 m.
                let error = (rates[k].rate.middle() - difference[k]).abs();
                assert!(error < 1e-7 && rates[k].rate.radius() < 1e-9, "{force_n:?}: {error:e}");
            }
        };
        check(
            IrvineCatenary { weight_n_m: w, compliance_per_n: c }
                .end_point(force, length)
                .position_m,
            &|(f, l, s)| irvine.at_deformation(s).end_point(f, l).position_m,
        );
        check(
            Parabola { weight_n_m: w, compliance_per_n: c }.end_point(force, length).position_m,
            &|(f, l, s)| parabola.at_deformation(s).end_point(f, l).position_m,
        );
    }
}

#[test]
fn rates_of_the_tail_enclose_those_of_the_exact_series() {
    // Derivative of (atanh(q)/q - 1)/q^2 by its series, for arguments where 200 terms reach 1e-16.
    for q in [1e-9_f64, 1e-3, 0.1, 0.2499, 0.2501, 0.5, 0.8] {
        let series: f64 =
            (1..200).map(|k| f64::from(2 * k) / f64::from(2 * k + 3) * q.powi(2 * k - 1)).sum();
        let value = dual(q, 1.0);
        let complement = Dual::point(1.0) - value;
        let rate = Dual::atanh_tail(value, complement).rate;
        let rounding = Interval::symmetric(1e-14 * series);
        assert!((rate + rounding).contains(series), "{q}: {rate:?} {series:e}");
        assert!(rate.radius() < 0.01 * series, "{q}: {rate:?}");
    }
}
