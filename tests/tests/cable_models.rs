//! The end-point maps and their derivatives, against 50-digit data, difference quotients,
//! quadrature of the defining integral, and the limits in which closed forms exist.

#[path = "../../host-sim/examples/user_rope/rope.rs"]
mod rope;

use cdpr_core::{
    CableModel, EndPoint, IrvineCatenary, LinearElastic, NonDeformable, Parabola, Real,
};
use cdpr_tests::{CableCase, cable_cases, random_tests, tolerance};
use nalgebra::{Matrix2x3, Vector2};
use proptest::prelude::*;
use rope::StiffeningRope;

/// A cable under a force, away from the singular points.
#[derive(Clone, Copy, Debug)]
struct State {
    force_n: Vector2<f64>,
    rest_length_m: f64,
    weight_n_m: f64,
    compliance_per_n: f64,
}

impl State {
    fn irvine(&self) -> IrvineCatenary<f64> {
        let &Self { weight_n_m, compliance_per_n, .. } = self;
        IrvineCatenary { weight_n_m, compliance_per_n }
    }

    fn parabola(&self) -> Parabola<f64> {
        let &Self { weight_n_m, compliance_per_n, .. } = self;
        Parabola { weight_n_m, compliance_per_n }
    }

    fn weight_n(&self) -> f64 {
        self.weight_n_m * self.rest_length_m
    }

    /// Smallest tension along the cable: the distance of 0 from the forces in it.
    fn least_tension_n(&self) -> f64 {
        let (top, bottom) = (self.force_n.y, self.force_n.y - self.weight_n());
        self.force_n.x.hypot(top.min(0.0) + bottom.max(0.0))
    }

    /// Length when every part is stretched by the largest tension: the size of the terms that add
    /// up to the end point.
    fn stretched_length_m(&self) -> f64 {
        let tension = self.force_n.norm() + self.weight_n();
        self.rest_length_m * (1.0 + self.compliance_per_n * tension)
    }
}

/// Taut, slack, above (attachment higher than the anchor bears) and nearly vertical states.
fn states() -> impl Strategy<Value = State> {
    let log = |low: f64, high: f64| (low.ln()..high.ln()).prop_map(f64::exp);
    let over_weight = prop_oneof![
        (log(10.0, 1e3), 0.05..3.1)
            .prop_map(|(t, angle)| (t * f64::sin(angle), t * f64::cos(angle))),
        (log(1e-2, 1.0), 0.05..0.95),
        (log(1e-2, 10.0), 1.05..10.0),
        (log(1e-6, 1e-3), prop_oneof![-10.0..-0.1, 1.1..10.0]),
    ];
    let strain = prop_oneof![Just(0.0), log(1e-8, 0.1)];
    (over_weight, log(0.1, 1e3), log(1e-3, 1e2), strain).prop_map(
        |((x, z), rest_length_m, weight_n_m, strain)| {
            let force_n = Vector2::new(x, z) * (weight_n_m * rest_length_m);
            let compliance_per_n = strain / force_n.norm();
            State { force_n, rest_length_m, weight_n_m, compliance_per_n }
        },
    )
}

/// Error of a derivative in units of the largest entry of its row, the columns of Fx and Fz being
/// multiplied by `(|Fx| + |Fz|)/L`.
fn derivative_error(
    actual: &Matrix2x3<f64>,
    expected: &Matrix2x3<f64>,
    force_n: Vector2<f64>,
    rest_length_m: f64,
) -> f64 {
    let scale = force_n.lp_norm(1) / rest_length_m;
    let scaled = |m: &Matrix2x3<f64>, i| m.row(i).component_mul(&[[scale], [scale], [1.0]].into());
    let row = |i| scaled(&(actual - expected), i).amax() / scaled(expected, i).amax();
    row(0).max(row(1))
}

/// The same cable, force and length, rounded to another float type.
fn rounded<T: Real>(case: &CableCase) -> (IrvineCatenary<T>, Vector2<T>, T) {
    let model = case.model();
    let rounded = IrvineCatenary {
        weight_n_m: T::constant(model.weight_n_m),
        compliance_per_n: T::constant(model.compliance_per_n),
    };
    (rounded, case.force_n().map(T::constant), T::constant(case.rest_length_m))
}

/// The end point in `T`, and in f64 at exactly the numbers that `T` was given.
fn in_type_and_f64<T: Real + Into<f64>>(case: &CableCase) -> [EndPoint<f64>; 2] {
    let (model, force_n, rest_length_m) = rounded::<T>(case);
    let end = model.end_point(force_n, rest_length_m);
    let model = IrvineCatenary {
        weight_n_m: model.weight_n_m.into(),
        compliance_per_n: model.compliance_per_n.into(),
    };
    let widened =
        EndPoint { position_m: end.position_m.map(T::into), jacobian: end.jacobian.map(T::into) };
    [widened, model.end_point(force_n.map(T::into), rest_length_m.into())]
}

#[test]
fn irvine_agrees_with_50_digits() {
    for case in cable_cases() {
        let (force_n, length) = (case.force_n(), case.rest_length_m);
        let end = case.model().end_point(force_n, length);
        let error = (end.position_m - case.position_m()).abs() / (length * f64::EPSILON);
        assert!(error.max() <= tolerance::END_POINT, "{error:?} {case:?}");
        let error = derivative_error(&end.jacobian, &case.jacobian, force_n, length);
        assert!(error <= tolerance::DERIVATIVE * f64::EPSILON, "{error:e} {case:?}");
    }
}

#[test]
fn irvine_in_f32_rounds_like_f64() {
    for case in cable_cases() {
        let [single, double] = in_type_and_f64::<f32>(&case);
        let eps = f64::from(f32::EPSILON);
        let error = (single.position_m - double.position_m).abs() / eps;
        assert!(error.y <= tolerance::END_POINT * case.rest_length_m, "{error:?} {case:?}");
        // X keeps its relative accuracy, however close to vertical the cable is.
        assert!(error.x <= tolerance::END_POINT * case.x_m, "{error:?} {case:?}");
        let error = derivative_error(
            &single.jacobian,
            &double.jacobian,
            case.force_n(),
            case.rest_length_m,
        );
        assert!(error <= tolerance::DERIVATIVE * eps, "{error:e} {case:?}");
    }
}

/// What f32 does to the end point is arithmetic (above) and, as much, the rounding of the five
/// inputs to `eps/2`. A relative change of each moves the end point by `K F`, `b L` and, because
/// the map keeps its form when force and weight, or length and weight, are scaled together,
/// `b L - (X, Z)` for the weight and the stretch `L (F - W/2 z)/EA` for the compliance.
#[test]
fn f32_error_is_arithmetic_and_input_rounding() {
    for case in cable_cases() {
        let [single, double] = in_type_and_f64::<f32>(&case);
        let length = case.rest_length_m;
        let by_force = case.jacobian.fixed_columns::<2>(0).abs() * case.force_n().abs();
        let by_length = case.jacobian.column(2) * length;
        let middle = case.force_n() - Vector2::y() * (0.5 * case.weight_n_m * length);
        let stretch = middle * (length / case.axial_stiffness_n);
        let inputs =
            by_force + by_length.abs() + (by_length - case.position_m()).abs() + stretch.abs();
        let eps = f64::from(f32::EPSILON);
        let from_inputs = inputs * (0.5 * eps);
        let arithmetic = Vector2::new(case.x_m, length) * (tolerance::END_POINT * eps);
        let input_error = (double.position_m - case.position_m()).abs();
        assert!(input_error < from_inputs, "{input_error:?} {from_inputs:?} {case:?}");
        let total_error = (single.position_m - case.position_m()).abs();
        assert!(total_error < from_inputs + arithmetic, "{total_error:?} {case:?}");
    }
}

/// Step of the central differences, relative to the least tension `T` (for L: to that tension over
/// the weight per length, or to L itself): the cube root of `eps`.
///
/// Third derivatives of `F/|F|` are below `3/T^3`, of the parabola's `M/T_m` below `24/T^3`, so that
/// truncation is below `8 STEP^2` times the size `L STEP/step` of the derivative. Ends that are
/// off by `END_POINT eps L` add `END_POINT eps/STEP` of it: both are around 2e-10.
const STEP: f64 = 6e-6;

fn check_derivative(model: impl CableModel<f64>, state: &State) -> Result<(), TestCaseError> {
    let &State { force_n, rest_length_m: length, .. } = state;
    let point = [force_n.x, force_n.y, length];
    let end_at = |[fx, fz, length]: [f64; 3]| model.end_point(Vector2::new(fx, fz), length);
    let force_step = state.least_tension_n() * STEP;
    let length_step = length.min(state.least_tension_n() / state.weight_n_m) * STEP;
    let end = end_at(point);
    for (column, step) in [force_step, force_step, length_step].into_iter().enumerate() {
        let [mut low, mut high] = [point; 2];
        low[column] -= step;
        high[column] += step;
        let change = end_at(high).position_m - end_at(low).position_m;
        let error = end.jacobian.column(column) - change / (high[column] - low[column]);
        let truncation = 8.0 * STEP * STEP * (length * STEP / step);
        let rounding = tolerance::END_POINT * f64::EPSILON * state.stretched_length_m() / step;
        let bound = truncation + rounding;
        prop_assert!(error.amax() <= bound, "column {column}: {:e} > {bound:e}", error.amax());
    }
    Ok(())
}

/// The contract of `CableModel`: odd in Fx, diagonal of K positive, determinant not negative; up to
/// rounding, which is that of the largest entry where an almost vertical cable hardly gives way.
fn check_contract(model: impl CableModel<f64>, state: &State) -> Result<(), TestCaseError> {
    let &State { force_n, rest_length_m, .. } = state;
    let end = model.end_point(force_n, rest_length_m);
    let mirrored = model.end_point(Vector2::new(-force_n.x, force_n.y), rest_length_m);
    prop_assert_eq!(mirrored.position_m, Vector2::new(-end.position_m.x, end.position_m.y));
    prop_assert!(end.position_m.x > 0.0);
    let k = &end.jacobian;
    let size = k.m11.max(k.m22);
    let rounding = tolerance::DERIVATIVE * f64::EPSILON * size;
    prop_assert!(k.m11.min(k.m22) >= -rounding, "diagonal {} {}", k.m11, k.m22);
    let determinant = k.m11 * k.m22 - k.m12 * k.m21;
    prop_assert!(determinant >= -rounding * size, "determinant {determinant:e}");
    Ok(())
}

proptest! {
    #![proptest_config(random_tests(1000))]

    #[test]
    fn derivatives_agree_with_central_differences(state in states()) {
        let elastic = LinearElastic { compliance_per_n: state.compliance_per_n };
        check_derivative(state.irvine(), &state)?;
        check_derivative(state.parabola(), &state)?;
        check_derivative(elastic, &state)?;
        check_derivative(NonDeformable, &state)?;
    }

    #[test]
    fn models_keep_their_contract(state in states()) {
        let elastic = LinearElastic { compliance_per_n: state.compliance_per_n };
        check_contract(state.irvine(), &state)?;
        check_contract(state.parabola(), &state)?;
        check_contract(elastic, &state)?;
        check_contract(NonDeformable, &state)?;
    }
}

proptest! {
    #![proptest_config(random_tests(20_000))]

    #[test]
    fn force_curves_run_as_the_proofs_expect(
        state in states(),
        stiffening in (1e-3_f64.ln()..1e3_f64.ln()).prop_map(f64::exp),
    ) {
        check_course(state.irvine(), &state)?;
        check_course(state.parabola(), &state)?;
        check_course(LinearElastic { compliance_per_n: state.compliance_per_n }, &state)?;
        let State { weight_n_m, compliance_per_n, .. } = state;
        let stiffening_n = stiffening * state.force_n.norm();
        check_course(StiffeningRope { weight_n_m, compliance_per_n, stiffening_n }, &state)?;
    }
}

/// The lengths at which a cable between two points is looked at, as parts of their distance: soft ones
/// down to half of it, slack ones up to a thousand times.
const LENGTHS: [f64; 2] = [0.5, 1e3];
const LENGTHS_OF_A_CABLE: i32 = 300;

/// The same at one cable of growing length, from the forces alone: what a derivative with a mistake
/// in it could hide.
fn check_growing(model: impl CableModel<f64>, x_m: f64, z_m: f64) -> Result<(), TestCaseError> {
    let distance_m = x_m.hypot(z_m);
    let ratio = (LENGTHS[1] / LENGTHS[0]).powf(f64::from(LENGTHS_OF_A_CABLE).recip());
    let mut last: Option<(Vector2<f64>, Vector2<f64>, f64)> = None;
    for n in 0..LENGTHS_OF_A_CABLE {
        let length_m = distance_m * LENGTHS[0] * ratio.powi(n);
        // A stiff cable cannot be that short.
        let Ok(line) = model.force_at_length(x_m, z_m, length_m) else { continue };
        let end = model.end_point(line.force_n, length_m);
        let compliance = end.jacobian.fixed_columns::<2>(0).into_owned();
        let Some(stiffness) = compliance.try_inverse() else { continue };
        let force_n = line.force_n;
        let at_anchor_n = force_n.y - model.weight_n_m() * length_m;
        let sizes = length_m + x_m + z_m.abs();
        let error_n = tolerance::FORCE
            * f64::EPSILON
            * (stiffness.norm() * sizes + force_n.norm() + at_anchor_n.abs());
        let now = (force_n, Vector2::new(force_n.y, at_anchor_n), error_n);
        if let Some((before_n, ends_n, error_before_n)) = last {
            let rounding = error_n + error_before_n;
            prop_assert!(force_n.x <= before_n.x + rounding, "Fx rises at {length_m}");
            if z_m <= 0.0 {
                prop_assert!(now.1.x >= ends_n.x - rounding, "Fz falls at {length_m}");
            }
            if z_m >= 0.0 {
                prop_assert!(now.1.y <= ends_n.y + rounding, "Fz - wL rises at {length_m}");
            }
        }
        last = Some(now);
    }
    prop_assert!(last.is_some(), "no force at any length");
    Ok(())
}

proptest! {
    #![proptest_config(random_tests(50))]

    #[test]
    fn longer_cables_pull_as_the_proofs_expect(
        steepness in -12.0..12.0_f64,
        level in proptest::bool::weighted(0.1),
        strain in (1e-8_f64.ln()..0.3_f64.ln()).prop_map(f64::exp),
        stiffening in (1e-3_f64.ln()..1e3_f64.ln()).prop_map(f64::exp),
    ) {
        // One metre and one newton per metre: all others follow by scaling. A large steepness, which is
        // a hyperbolic angle, is a nearly vertical cable.
        let (x_m, z_m) = if level { (1.0, 0.0) } else { (steepness.cosh().recip(), steepness.tanh()) };
        let (weight_n_m, compliance_per_n) = (1.0, strain);
        check_growing(IrvineCatenary { weight_n_m, compliance_per_n }, x_m, z_m)?;
        check_growing(Parabola { weight_n_m, compliance_per_n }, x_m, z_m)?;
        let rope = StiffeningRope { weight_n_m, compliance_per_n, stiffening_n: stiffening };
        check_growing(rope, x_m, z_m)?;
    }
}

/// The contract on the force curve through this state, from the derivative: `Fx` falls, at the lower
/// end of the cable the pull down falls, and the weight pulls somewhere between the ends.
///
/// `dF/dL = -K^-1 b`, so `-adj(K) b` has its signs; with entries that are off by [`DERIVATIVE`] a sum of
/// two products is off by three times that (a rounding of its own included) of its terms.
///
/// [`DERIVATIVE`]: tolerance::DERIVATIVE
fn check_course(model: impl CableModel<f64>, state: &State) -> Result<(), TestCaseError> {
    let &State { force_n, rest_length_m: length, .. } = state;
    let end = model.end_point(force_n, length);
    let (x, z) = (end.position_m.x, end.position_m.y);
    let row = |i| {
        end.jacobian
            .row(i)
            .component_mul(&[[1.0], [1.0], [length / force_n.lp_norm(1)]].into())
            .amax()
    };
    let error = 3.0 * tolerance::DERIVATIVE * f64::EPSILON * (force_n.lp_norm(1) / length);
    let (size, weight_n_m) = (row(0) * row(1), model.weight_n_m());
    let j = &end.jacobian;
    let by_length = Vector2::new(j.m12 * j.m23 - j.m13 * j.m22, j.m13 * j.m21 - j.m11 * j.m23);
    let determinant = j.m11 * j.m22 - j.m12 * j.m21;
    let rounding = error * size;
    prop_assert!(by_length.x <= rounding, "Fx rises: {:e}, {rounding:e}", by_length.x);
    if z <= 0.0 {
        prop_assert!(by_length.y >= -rounding, "Fz falls: {:e}, {rounding:e}", by_length.y);
    }
    if z >= 0.0 {
        let at_anchor = by_length.y - weight_n_m * determinant;
        let rounding = rounding * (1.0 + weight_n_m * length / force_n.lp_norm(1));
        prop_assert!(at_anchor <= rounding, "Fz - wL rises: {at_anchor:e}, {rounding:e}");
    }
    let moment = x * force_n.y - z * force_n.x;
    let rounding = tolerance::END_POINT
        * f64::EPSILON
        * state.stretched_length_m()
        * (force_n.lp_norm(1) + weight_n_m * length);
    let weight = weight_n_m * length * x;
    prop_assert!(moment >= -rounding, "moment {moment:e}, {rounding:e}");
    prop_assert!(moment <= weight + rounding, "moment {moment:e} of {weight:e}, {rounding:e}");
    Ok(())
}

/// Position and derivative of two models agree to rounding.
fn check_equal(
    left: impl CableModel<f64>,
    right: impl CableModel<f64>,
    state: &State,
) -> Result<(), TestCaseError> {
    let &State { force_n, rest_length_m, .. } = state;
    let [left, right] =
        [left.end_point(force_n, rest_length_m), right.end_point(force_n, rest_length_m)];
    let error = (left.position_m - right.position_m).amax() / state.stretched_length_m();
    prop_assert!(error <= tolerance::END_POINT * f64::EPSILON, "position {error:e}");
    let error = derivative_error(&left.jacobian, &right.jacobian, force_n, rest_length_m);
    prop_assert!(error <= tolerance::DERIVATIVE * f64::EPSILON, "derivative {error:e}");
    Ok(())
}

proptest! {
    #![proptest_config(random_tests(1000))]

    #[test]
    fn without_weight_or_stretch_the_simpler_models_are_left(state in states()) {
        let elastic = LinearElastic { compliance_per_n: state.compliance_per_n };
        let massless = State { weight_n_m: 0.0, ..state };
        check_equal(massless.irvine(), elastic, &state)?;
        check_equal(massless.parabola(), elastic, &state)?;
        let rigid = State { compliance_per_n: 0.0, ..massless };
        check_equal(rigid.irvine(), NonDeformable, &state)?;
        check_equal(rigid.parabola(), NonDeformable, &state)?;
        check_equal(LinearElastic { compliance_per_n: 0.0 }, NonDeformable, &state)?;
    }

    #[test]
    fn deformation_runs_from_the_non_deformable_cable_to_the_model(state in states()) {
        let (irvine, parabola) = (state.irvine(), state.parabola());
        let elastic = LinearElastic { compliance_per_n: state.compliance_per_n };
        check_equal(irvine.at_deformation(0.0), NonDeformable, &state)?;
        check_equal(parabola.at_deformation(0.0), NonDeformable, &state)?;
        check_equal(CableModel::<f64>::at_deformation(&elastic, 0.0), NonDeformable, &state)?;
        prop_assert_eq!(irvine.at_deformation(1.0), irvine);
        prop_assert_eq!(parabola.at_deformation(1.0), parabola);
        prop_assert_eq!(CableModel::<f64>::at_deformation(&elastic, 1.0), elastic);
    }
}

/// A cable that hangs straight: `Z = +-(L + mean tension L/EA)`, and sideways the compliance of the
/// integral of `1/T`, a logarithm.
#[test]
fn exactly_vertical_taut_cables_are_regular() {
    let (length, weight_n_m, compliance_per_n) = (7.0, 3.0, 1e-4);
    let weight_n = weight_n_m * length;
    for tension_n in [1e-3, 0.1, 5.0, 30.0, 4e3] {
        let upper_tension_n = tension_n + weight_n;
        let lower_tension_n = upper_tension_n - weight_n; // exact, unlike the sum
        let mean_tension_n = 0.5 * (lower_tension_n + upper_tension_n);
        let lateral = f64::ln_1p(weight_n / lower_tension_n) / weight_n_m;
        let along = length * compliance_per_n;
        // The attachment carries the lower end, or (B above A) the upper one.
        for (fz_n, side, tension_a_n) in
            [(-lower_tension_n, -1.0, upper_tension_n), (upper_tension_n, 1.0, lower_tension_n)]
        {
            let state = State {
                force_n: Vector2::new(0.0, fz_n),
                rest_length_m: length,
                weight_n_m,
                compliance_per_n,
            };
            let position_m =
                Vector2::new(0.0, side * length * (1.0 + mean_tension_n * compliance_per_n));
            let along_slope = side * (1.0 + tension_a_n * compliance_per_n);
            // The parabola takes its sideways compliance from the mean tension.
            for (end, lateral) in [
                (state.irvine().end_point(state.force_n, length), lateral),
                (state.parabola().end_point(state.force_n, length), length / mean_tension_n),
            ] {
                let jacobian = Matrix2x3::new(lateral + along, 0.0, 0.0, 0.0, along, along_slope);
                let error = (end.position_m - position_m).amax() / length;
                assert!(error <= tolerance::END_POINT * f64::EPSILON, "{error:e} {state:?}");
                let error = derivative_error(&end.jacobian, &jacobian, state.force_n, length);
                assert!(error <= tolerance::DERIVATIVE * f64::EPSILON, "{error:e} {state:?}");
            }
        }
    }
}

/// Next to the singular line (slack, Fx -> 0) logarithms grow and brackets vanish; there the
/// textbook forms, with `asinh(Fz/Fx) + asinh((W - Fz)/Fx)`, do not cancel.
#[test]
fn almost_vertical_slack_cables_keep_their_digits() {
    let (weight_n_m, compliance_per_n) = (0.4, 1e-4);
    for (percent, exponent) in (1..100).flat_map(|p| (2..16).map(move |e| (p, e))) {
        let share = 0.01 * f64::from(percent);
        let length = 40.0 + share; // so that every case rounds in its own way
        let weight_n = weight_n_m * length;
        let force_n = Vector2::new(0.1_f64.powi(exponent), share) * weight_n;
        let state = State { force_n, rest_length_m: length, weight_n_m, compliance_per_n };
        let bound = tolerance::END_POINT * f64::EPSILON;
        let middle = force_n - Vector2::new(0.0, 0.5 * weight_n);
        let elastic = middle * (compliance_per_n * length);

        let (from_b, from_a) = (force_n.y, weight_n - force_n.y);
        let (tension_b, tension_a) = (force_n.norm(), force_n.x.hypot(from_a));
        let arcs = (from_b / force_n.x).asinh() + (from_a / force_n.x).asinh();
        let expected = Vector2::new(force_n.x * arcs, tension_b - tension_a) / weight_n_m + elastic;
        let error = state.irvine().end_point(force_n, length).position_m - expected;
        assert!(error.x.abs() <= bound * expected.x, "{error:?} {state:?}");
        assert!(error.y.abs() <= bound * length, "{error:?} {state:?}");

        let ends = from_b * tension_b + from_a * tension_a;
        let mean_n = 0.5 * (ends + force_n.x * force_n.x * arcs) / weight_n;
        let expected = middle * (length / mean_n) + elastic;
        let error = state.parabola().end_point(force_n, length).position_m - expected;
        // Twice the roundings: the mean tension takes the square of a slope.
        let bound = 2.0 * bound * expected.abs();
        assert!(error.abs() <= bound, "parabola {error:?} {state:?}");
    }
}

/// Expanding both integrals in `W/m`, `m = |M|` the tension at mid-span and `c` its slope: along M
/// they differ from the fourth order on, across it by `L c sqrt(1 - c^2) (W/m)^2 / 12`.
#[test]
fn parabola_follows_the_catenary_for_taut_cables() {
    let (length, middle_n) = (20.0, 500.0);
    for elevation in [-1.1, -0.4, 0.2, 0.9] {
        let (slope, run) = f64::sin_cos(elevation);
        let (along, across) = (Vector2::new(run, slope), Vector2::new(slope, -run));
        let difference = |ratio: f64| {
            let weight_n = ratio * middle_n;
            let state = State {
                force_n: along * middle_n + Vector2::new(0.0, 0.5 * weight_n),
                rest_length_m: length,
                weight_n_m: weight_n / length,
                compliance_per_n: 1e-6,
            };
            let catenary = state.irvine().end_point(state.force_n, length);
            let parabola = state.parabola().end_point(state.force_n, length);
            let difference = (catenary.position_m - parabola.position_m) / length;
            (difference.dot(&along), difference.dot(&across))
        };
        let coarse = 0.1;
        let [(along_coarse, across_coarse), (along_fine, across_fine)] =
            [coarse, 0.5 * coarse].map(difference);
        // The next order in either is (W/m)^2 times a number below 4.
        let next_order = 4.0 * coarse * coarse;
        let leading = slope * run * coarse * coarse / 12.0;
        assert!((across_coarse / leading - 1.0).abs() < next_order);
        assert!((across_coarse / across_fine / 4.0 - 1.0).abs() < next_order);
        assert!((along_coarse / along_fine / 16.0 - 1.0).abs() < next_order);
    }
}

/// Five-point Gauss-Legendre on each of `2^halvings` parts, summed in pairs.
fn integral(f: &impl Fn(f64) -> Vector2<f64>, from: f64, to: f64, halvings: u32) -> Vector2<f64> {
    let middle = 0.5 * (from + to);
    if halvings > 0 {
        return integral(f, from, middle, halvings - 1) + integral(f, middle, to, halvings - 1);
    }
    let half = 0.5 * (to - from);
    let root = f64::sqrt(10.0 / 7.0);
    let weight_root = 13.0 * f64::sqrt(70.0);
    let pair =
        |node: f64, weight: f64| (f(middle - half * node) + f(middle + half * node)) * weight;
    let inner = pair(f64::sqrt(5.0 - 2.0 * root) / 3.0, (322.0 + weight_root) / 900.0);
    let outer = pair(f64::sqrt(5.0 + 2.0 * root) / 3.0, (322.0 - weight_root) / 900.0);
    (f(middle) * (128.0 / 225.0) + inner + outer) * half
}

/// 1024 parts: the nearest singularity of the integrand, where T vanishes, is 20 half-widths away
/// at `Fx = 0.01 W`, which leaves `(20 + sqrt(20^2 + 1))^-10 = 1e-16` of it.
const HALVINGS: u32 = 10;

proptest! {
    #![proptest_config(random_tests(200))]

    #[test]
    fn end_points_agree_with_quadrature(state in states()) {
        let State { force_n, rest_length_m: length, compliance_per_n, .. } = state;
        let weight_n = state.weight_n();
        let tension = |u: f64| force_n - Vector2::new(0.0, weight_n * u);
        let bound = tolerance::QUADRATURE * f64::EPSILON * state.stretched_length_m();

        let strained = |u: f64| tension(u) * (compliance_per_n + tension(u).norm().recip());
        let expected = integral(&strained, 0.0, 1.0, HALVINGS) * length;
        let end = state.irvine().end_point(force_n, length).position_m;
        prop_assert!((end - expected).amax() <= bound, "irvine {end:?} {expected:?}");

        let mean_n = integral(&|u| Vector2::repeat(tension(u).norm()), 0.0, 1.0, HALVINGS).x;
        let expected = tension(0.5) * (length * (mean_n.recip() + compliance_per_n));
        let end = state.parabola().end_point(force_n, length).position_m;
        prop_assert!((end - expected).amax() <= bound, "parabola {end:?} {expected:?}");
    }
}
