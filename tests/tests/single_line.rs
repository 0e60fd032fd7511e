//! One cable by itself: the force from the rest length, against 50-digit data, closed forms, and
//! the end-point map that the force has to satisfy.

use std::cell::Cell;

use cdpr_core::line::{self, LineFault, LineSolution};
use cdpr_core::{CableModel, IrvineCatenary, LinearElastic, NonDeformable, Parabola, Real};
use cdpr_tests::{CableCase, cable_cases, random_tests, tolerance};
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;
use proptest::test_runner::{TestError, TestRunner};

/// The question: a cable between its anchor and the point `(x, z)`.
#[derive(Clone, Copy, Debug)]
struct Line<T> {
    weight_n_m: T,
    compliance_per_n: T,
    rest_length_m: T,
    x_m: T,
    z_m: T,
}

impl<T: Real + Into<f64>> Line<T> {
    /// The line in which every number is rounded to `T`.
    fn rounded(line: &Line<f64>) -> Self {
        Self {
            weight_n_m: T::constant(line.weight_n_m),
            compliance_per_n: T::constant(line.compliance_per_n),
            rest_length_m: T::constant(line.rest_length_m),
            x_m: T::constant(line.x_m),
            z_m: T::constant(line.z_m),
        }
    }

    /// The same numbers in f64.
    fn widened(&self) -> Line<f64> {
        Line {
            weight_n_m: self.weight_n_m.into(),
            compliance_per_n: self.compliance_per_n.into(),
            rest_length_m: self.rest_length_m.into(),
            x_m: self.x_m.into(),
            z_m: self.z_m.into(),
        }
    }

    fn irvine(&self) -> IrvineCatenary<T> {
        let &Self { weight_n_m, compliance_per_n, .. } = self;
        IrvineCatenary { weight_n_m, compliance_per_n }
    }

    fn parabola(&self) -> Parabola<T> {
        let &Self { weight_n_m, compliance_per_n, .. } = self;
        Parabola { weight_n_m, compliance_per_n }
    }

    fn solve(&self, model: &impl CableModel<T>) -> Result<LineSolution<T>, LineFault> {
        model.force_at_length(self.x_m, self.z_m, self.rest_length_m)
    }

    fn solve_nested(&self, model: &impl CableModel<T>) -> Result<LineSolution<T>, LineFault> {
        line::nested_force(model, self.x_m, self.z_m, self.rest_length_m)
    }

    /// End point minus `(x, z)`, by the test, m.
    fn error_m(&self, model: &impl CableModel<T>, force_n: Vector2<T>) -> Vector2<f64> {
        let end = model.end_point(force_n, self.rest_length_m).position_m;
        Vector2::new((end.x - self.x_m).into(), (end.y - self.z_m).into())
    }
}

impl Line<f64> {
    fn of(case: &CableCase) -> Self {
        let IrvineCatenary { weight_n_m, compliance_per_n } = case.model();
        let &CableCase { rest_length_m, x_m, z_m, .. } = case;
        Self { weight_n_m, compliance_per_n, rest_length_m, x_m, z_m }
    }

    fn distance_m(&self) -> f64 {
        self.x_m.hypot(self.z_m)
    }

    /// What rounding is measured by: the distance, or the length of the cable when every part is
    /// stretched by the weight of the whole. The latter counts only for cables so soft that
    /// (`EA < w L`) they hang many times as long as they are.
    fn size_m(&self) -> f64 {
        let stretch = 1.0 + self.weight_n() * self.compliance_per_n;
        self.distance_m().max(self.rest_length_m * stretch)
    }

    fn weight_n(&self) -> f64 {
        self.weight_n_m * self.rest_length_m
    }

    /// Why this line has no force.
    fn fault(&self) -> Option<LineFault> {
        let reaches = self.distance_m() >= self.rest_length_m;
        if self.weight_n_m == 0.0 && self.distance_m() <= self.rest_length_m {
            Some(LineFault::Limp)
        } else {
            (self.compliance_per_n == 0.0 && reaches).then_some(LineFault::TooShort)
        }
    }
}

/// Vertical force of a line that hangs straight and how fast it rises with z, from statics: the ends
/// of a taut one carry `EA (|z|/L - 1)` in the mean; a slack one hangs from B with the length `a`
/// and from A with the rest, so that `z = (2 a - L) (1 + w L/(2 EA))`.
fn vertical_force(line: &Line<f64>) -> (f64, f64) {
    let Line { weight_n_m, compliance_per_n, rest_length_m, z_m, .. } = *line;
    let weight_n = weight_n_m * rest_length_m;
    let by_own_weight = 1.0 + 0.5 * weight_n * compliance_per_n;
    if z_m.abs() <= rest_length_m * by_own_weight {
        (0.5 * weight_n_m * (rest_length_m + z_m / by_own_weight), 0.5 * weight_n_m)
    } else {
        let mean_n = (z_m.abs() / rest_length_m - 1.0) / compliance_per_n;
        let stiffness_n_m = (compliance_per_n * rest_length_m).recip();
        (0.5 * weight_n + z_m.signum() * mean_n, stiffness_n_m)
    }
}

/// A solution has a finite force that closes the line to rounding, says so, and took no more than
/// `most` iterations. Returns the iterations.
fn accept<T: Real + Into<f64>>(
    line: &Line<T>,
    model: &impl CableModel<T>,
    solution: &LineSolution<T>,
    most: u32,
) -> Result<u32, TestCaseError> {
    let exact_line = line.widened();
    let bound = tolerance::RESIDUAL * T::EPSILON.into() * exact_line.size_m();
    let force_n = solution.force_n.map(T::into);
    if force_n.x == 0.0 {
        // Taken for vertical, where the end point of a slack cable is a limit.
        let (expected_n, stiffness_n_m) = vertical_force(&exact_line);
        let error_m = (force_n.y - expected_n).abs() / stiffness_n_m;
        prop_assert!(error_m <= bound && exact_line.x_m <= bound, "{error_m:e}: {solution:?}");
    } else {
        let error = line.error_m(model, solution.force_n).abs();
        // Each component by itself: the larger of a number and NaN would be the number.
        prop_assert!(error.x <= bound && error.y <= bound, "{error:?} > {bound:e}: {solution:?}");
    }
    prop_assert!(solution.residual_m.into() <= bound, "{solution:?}");
    prop_assert!(force_n.x.is_finite() && force_n.y.is_finite(), "{solution:?}");
    prop_assert!(solution.iterations <= most, "{solution:?}");
    Ok(solution.iterations)
}

/// Solves, and accepts a solution or, where there is none, the reason. Returns the iterations.
fn check<T: Real + Into<f64>, M: CableModel<T>>(
    line: &Line<T>,
    model: &M,
) -> Result<u32, TestCaseError> {
    match (line.solve(model), line.widened().fault()) {
        (Ok(solution), None) => accept(line, model, &solution, line::root_iteration_bound::<T>()),
        (Err(fault), Some(expected)) if fault == expected => Ok(0),
        (outcome, expected) => {
            Err(TestCaseError::fail(format!("{line:?}: {outcome:?} instead of {expected:?}")))
        }
    }
}

/// The same for the search that knows nothing of the model, and therefore not why there is no
/// solution.
fn check_nested<T: Real + Into<f64>, M: CableModel<T>>(
    line: &Line<T>,
    model: &M,
) -> Result<u32, TestCaseError> {
    match (line.solve_nested(model), line.widened().fault()) {
        (Ok(solution), None) => accept(line, model, &solution, line::nested_iteration_bound::<T>()),
        (Err(LineFault::OutOfRange), Some(LineFault::TooShort)) => Ok(0),
        (outcome, expected) => {
            Err(TestCaseError::fail(format!("{line:?}: {outcome:?} instead of {expected:?}")))
        }
    }
}

/// Iterations on the lines of `cable.json`; largest found 3.
const USUAL_ITERATIONS: u32 = 4;

/// What an error of the end point does to the force: `|K^-1| error`, K with 50 digits.
fn by_conditioning(case: &CableCase, end_point_error_m: Vector2<f64>) -> Vector2<f64> {
    let k: Matrix2<f64> = case.jacobian.fixed_columns::<2>(0).into_owned();
    k.try_inverse().unwrap().abs() * end_point_error_m
}

/// Smallest tension along a cable: the distance of 0 from the forces in it, N.
fn least_tension_n(force_n: Vector2<f64>, weight_n: f64) -> f64 {
    force_n.x.hypot(force_n.y.min(0.0) + (force_n.y - weight_n).max(0.0))
}

/// Error of a force that is as good as a float type with this `eps` allows.
fn force_bound(case: &CableCase, eps: f64) -> Vector2<f64> {
    let lengths = case.rest_length_m + case.x_m + case.z_m.abs();
    let end_point_error_m = Vector2::repeat(tolerance::FORCE * eps * lengths);
    by_conditioning(case, end_point_error_m) + case.force_n().abs() * eps
}

#[test]
fn forces_agree_with_50_digits() {
    for case in cable_cases() {
        let line = Line::of(&case);
        let solution = line.solve(&line.irvine()).unwrap();
        accept(&line, &line.irvine(), &solution, USUAL_ITERATIONS).unwrap();
        let error = (solution.force_n - case.force_n()).abs();
        let bound = force_bound(&case, f64::EPSILON);
        assert!(error <= bound, "{error:?} {bound:?} {case:?}");
    }
}

/// In f32 the arithmetic of the solver adds what it does in f64, times the other `eps`. What the
/// rounding of the five inputs adds is as large: half a unit of each of x and z, and of what
/// length, weight and compliance contribute to the end point (as in `cable_models`). Stiff taut
/// lines are ill-conditioned: half a unit of the length is more than their whole stretch. There
/// only the residual says something; the force is compared where both effects are linear, that
/// is, small against the least tension.
#[test]
fn f32_error_is_arithmetic_and_input_rounding() {
    let eps = f64::from(f32::EPSILON);
    let mut compared = 0;
    for case in cable_cases() {
        let line = Line::<f32>::rounded(&Line::of(&case));
        let exact_line = line.widened();
        let single = line.solve(&line.irvine()).unwrap();
        accept(&line, &line.irvine(), &single, line::root_iteration_bound::<f32>()).unwrap();
        let single_n = single.force_n.map(f64::from);
        let residual = exact_line.error_m(&exact_line.irvine(), single_n).amax();
        let bound = (tolerance::RESIDUAL + tolerance::END_POINT) * eps * exact_line.size_m();
        assert!(residual <= bound, "{residual:e} {case:?}");

        let position = case.position_m();
        let by_length = case.jacobian.column(2) * case.rest_length_m;
        let middle = case.force_n() - Vector2::y() * (0.5 * case.weight_n_m * case.rest_length_m);
        let stretch = middle * (case.rest_length_m / case.axial_stiffness_n);
        let inputs =
            position.abs() + by_length.abs() + (by_length - position).abs() + stretch.abs();
        let from_inputs = by_conditioning(&case, inputs * (0.5 * eps));
        let arithmetic = force_bound(&case, eps);
        let least_tension_n = least_tension_n(case.force_n(), exact_line.weight_n());
        if (from_inputs + arithmetic).norm() > 0.1 * least_tension_n {
            continue;
        }
        compared += 1;
        let double_n = exact_line.solve(&exact_line.irvine()).unwrap().force_n;
        let input_error = (double_n - case.force_n()).abs();
        assert!(input_error <= from_inputs, "{input_error:?} {from_inputs:?} {case:?}");
        let arithmetic_error = (single_n - double_n).abs();
        assert!(arithmetic_error <= arithmetic, "{arithmetic_error:?} {case:?}");
    }
    println!("{compared} of 120 lines are well-conditioned in f32");
    assert!(compared >= 100);
}

/// Exactly vertical, or as nearly as rounding leaves it, or nearer than squares can tell; taut below
/// the anchor, slack, and taut above it.
#[test]
fn vertical_lines_are_regular() {
    let rest_length_m = 12.0;
    for (weight_n_m, compliance_per_n) in [(0.5, 1e-6), (30.0, 1e-3), (0.5, 0.0)] {
        for height in [-1.3, -1.01, -1.0, -0.7, -0.01, 0.3, 0.99, 1.0, 1.02, 1.2] {
            for ratio in [0.0, 1e-9, 1e-12, 1e-16, 1e-20, 1e-80, 1e-160, 1e-300] {
                let (x_m, z_m) = (ratio * rest_length_m, height * rest_length_m);
                let line = Line { weight_n_m, compliance_per_n, rest_length_m, x_m, z_m };
                let single = Line::<f32>::rounded(&line);
                check(&line, &line.irvine()).unwrap();
                check(&line, &line.parabola()).unwrap();
                check(&single, &single.irvine()).unwrap();
                if line.fault().is_none() {
                    check_nested(&line, &line.irvine()).unwrap();
                    check_nested(&single, &single.irvine()).unwrap();
                }
                check(&single, &single.parabola()).unwrap();
            }
        }
    }
}

/// Both ends at one point: a loop that hangs from it with half its weight on either.
#[test]
fn a_loop_hangs_with_half_its_weight() {
    for compliance_per_n in [0.0, 1e-6, 1e-2] {
        let line =
            Line { weight_n_m: 0.7, compliance_per_n, rest_length_m: 5.0, x_m: 0.0, z_m: 0.0 };
        check(&line, &line.irvine()).unwrap();
        let force_n = line.solve(&line.irvine()).unwrap().force_n;
        assert_eq!(force_n, Vector2::new(0.0, 0.5 * 0.7 * 5.0));
    }
}

/// Without weight, without stretch, without either; and close to where an inextensible cable ends.
#[test]
fn lines_without_weight_or_stretch() {
    let distance_m = f64::hypot(6.0, 8.0);
    for (weight_n_m, compliance_per_n) in [(0.0, 1e-5), (0.0, 0.0), (2.0, 0.0), (2.0, 1e-12)] {
        for surplus in [-0.3, -1e-3, -1e-9, -1e-15, 0.0, 1e-15, 1e-12, 1e-9, 1e-3, 0.3, 40.0] {
            for z_m in [8.0, -8.0] {
                let rest_length_m = distance_m * (1.0 + surplus);
                let line = Line { weight_n_m, compliance_per_n, rest_length_m, x_m: 6.0, z_m };
                check(&line, &line.irvine()).unwrap();
                check(&line, &line.parabola()).unwrap();
                if weight_n_m == 0.0 {
                    check(&line, &LinearElastic { compliance_per_n }).unwrap();
                }
                let limp = rest_length_m >= distance_m;
                let fault = if limp { LineFault::Limp } else { LineFault::TooShort };
                assert_eq!(line.solve(&NonDeformable), Err(fault));
            }
        }
    }
}

/// From threads to absurd: forces and lengths over twelve decades, EA from 10 to 1e12 N.
#[test]
fn absurd_magnitudes_are_solved_or_refused() {
    for (weight_n_m, rest_length_m) in [1e-6, 1e-3, 1.0, 1e3, 1e6]
        .iter()
        .flat_map(|&w| [1e-6, 1e-2, 1.0, 1e2, 1e6].map(|l| (w, l)))
    {
        for compliance_per_n in [0.0, 1e-12, 1e-7, 1e-3, 0.1] {
            for (x, z) in
                [(1e-6, -1.1), (0.3, -1.0), (0.8, 0.5), (1.1, 0.0), (0.01, 0.98), (0.7, 0.9)]
            {
                let (x_m, z_m) = (x * rest_length_m, z * rest_length_m);
                let line = Line { weight_n_m, compliance_per_n, rest_length_m, x_m, z_m };
                let single = Line::<f32>::rounded(&line);
                check(&line, &line.irvine()).unwrap();
                check(&line, &line.parabola()).unwrap();
                check(&single, &single.irvine()).unwrap();
                check(&single, &single.parabola()).unwrap();
            }
        }
    }
}

#[test]
fn input_that_is_no_line_is_refused() {
    fn refused(model: impl CableModel<f64>, [x_m, z_m, length_m]: [f64; 3]) {
        assert_eq!(model.force_at_length(x_m, z_m, length_m), Err(LineFault::InvalidInput));
        let nested = line::nested_force(&model, x_m, z_m, length_m);
        assert_eq!(nested, Err(LineFault::InvalidInput));
    }
    let good = [3.0, -4.0, 6.0];
    let mut bad: Vec<_> = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY]
        .into_iter()
        .flat_map(|value| {
            (0..3).map(move |place| {
                let mut line = good;
                line[place] = value;
                line
            })
        })
        .collect();
    bad.extend([[-1e-9, -4.0, 6.0], [3.0, -4.0, 0.0], [3.0, -4.0, -0.0], [3.0, -4.0, -6.0]]);
    for line in bad {
        refused(IrvineCatenary { weight_n_m: 0.5, compliance_per_n: 1e-6 }, line);
        refused(Parabola { weight_n_m: 0.5, compliance_per_n: 1e-6 }, line);
        refused(LinearElastic { compliance_per_n: 1e-6 }, line);
        refused(NonDeformable, line);
    }
}

/// A model whose parameters are no cable's may be refused in any way, but not answered with a force
/// that is no number.
#[test]
fn models_that_are_no_cable_give_no_nonsense() {
    let values = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.5, -1e-6, 0.0, 1e-6, 0.5];
    for (weight_n_m, compliance_per_n) in values.into_iter().flat_map(|w| values.map(|c| (w, c))) {
        for (x_m, z_m) in [(3.0, -4.0), (3.0, 4.5), (0.0, -4.0), (0.0, 4.5)] {
            let line = Line { weight_n_m, compliance_per_n, rest_length_m: 5.1, x_m, z_m };
            for outcome in [
                line.solve(&line.irvine()),
                line.solve(&line.parabola()),
                line.solve(&LinearElastic { compliance_per_n }),
                line.solve_nested(&line.irvine()),
            ] {
                let finite = |s: LineSolution<f64>| {
                    s.force_n.x.is_finite() && s.force_n.y.is_finite() && s.residual_m.is_finite()
                };
                assert!(outcome.is_ok_and(finite) || outcome.is_err(), "{line:?} {outcome:?}");
            }
        }
    }
}

/// Over wide ranges; the horizontal distance down to 1e-9 of the length.
fn lines() -> impl Strategy<Value = Line<f64>> {
    let log = |low: f64, high: f64| (low.ln()..high.ln()).prop_map(f64::exp);
    let compliance = prop_oneof![4 => log(1e-9, 1e-3), 1 => Just(0.0)];
    let across = prop_oneof![log(1e-9, 1.0), 0.0..1.0];
    let side = prop_oneof![Just(-1.0), Just(1.0)];
    (log(1e-4, 1e2), compliance, log(0.1, 1e4), 1e-9..1.2, across, side).prop_map(
        |(weight_n_m, compliance_per_n, rest_length_m, chord, across, side): (
            _,
            _,
            _,
            f64,
            f64,
            f64,
        )| {
            let x = across.min(chord);
            let z = side * ((chord - x) * (chord + x)).sqrt();
            let (x_m, z_m) = (x * rest_length_m, z * rest_length_m);
            Line { weight_n_m, compliance_per_n, rest_length_m, x_m, z_m }
        },
    )
}

/// Checks `cases` random lines and returns the largest number of iterations.
fn for_lines(cases: u32, check: impl Fn(&Line<f64>) -> Result<u32, TestCaseError>) -> u32 {
    let most = Cell::new(0);
    let outcome = TestRunner::new(random_tests(cases)).run(&lines(), |line| {
        most.set(most.get().max(check(&line)?));
        Ok(())
    });
    if let Err(TestError::Fail(reason, line)) = &outcome {
        panic!("{reason}\n{line:?}");
    }
    outcome.unwrap();
    most.get()
}

/// Fast steps of the root search: a catenary never needs the bisection behind them.
const FAST_STEPS: u32 = 32;

#[test]
fn every_catenary_is_solved() {
    let double = for_lines(20_000, |line| check(line, &line.irvine()));
    let single = for_lines(20_000, |line| {
        let line = Line::<f32>::rounded(line);
        check(&line, &line.irvine())
    });
    println!("catenary: at most {double} iterations in f64, {single} in f32");
    assert!(double.max(single) <= FAST_STEPS);
}

#[test]
fn every_parabola_is_solved() {
    let double = for_lines(20_000, |line| check(line, &line.parabola()));
    let single = for_lines(20_000, |line| {
        let line = Line::<f32>::rounded(line);
        check(&line, &line.parabola())
    });
    println!("parabola: at most {double} iterations in f64, {single} in f32");
}

/// Both models by the search that any model can use; where the force is well-conditioned it is that
/// of the catenary's own solver.
#[test]
fn the_general_search_solves_them_too() {
    let double = for_lines(5000, |line| {
        let irvine = check_nested(line, &line.irvine())?;
        if let (Ok(nested), Ok(own)) =
            (line.solve_nested(&line.irvine()), line.solve(&line.irvine()))
        {
            // Both residuals, and the rounding of both end points, through the stiffness here.
            let lengths_m = 2.0 * (tolerance::RESIDUAL + tolerance::END_POINT) * line.size_m();
            let end = line.irvine().end_point(own.force_n, line.rest_length_m);
            let compliance = end.jacobian.fixed_columns::<2>(0).into_owned();
            let stiffness = compliance.try_inverse().expect("compliance").abs();
            let bound_n = stiffness * Vector2::repeat(lengths_m * f64::EPSILON);
            let error_n = (nested.force_n - own.force_n).abs();
            let linear = bound_n.norm() < 0.1 * least_tension_n(own.force_n, line.weight_n());
            prop_assert!(!linear || error_n <= bound_n, "{error_n:?} {bound_n:?}");
        }
        Ok(irvine.max(check_nested(line, &line.parabola())?))
    });
    let single = for_lines(5000, |line| {
        let line = Line::<f32>::rounded(line);
        let irvine = check_nested(&line, &line.irvine())?;
        Ok(irvine.max(check_nested(&line, &line.parabola())?))
    });
    println!("general search: at most {double} iterations in f64, {single} in f32");
}
