//! Branches of solutions over a parameter: folds, limits, and the solutions at single values.

use cdpr_core::{CABLES, CableState, IrvineCatenary, NewtonStep, newton};
use cdpr_host_sim::branches::{Border, Diagram, Doubt, Fold, Parameter, Range, SolutionBranch};
use cdpr_host_sim::cases::Overrides;
use cdpr_host_sim::continuation::{BranchEnd, Quantity, Steps};
use cdpr_host_sim::enumerate::{Method, ModelKind, Options, Request};
use cdpr_host_sim::rigid::SlackSet;
use cdpr_host_sim::robot_file::RobotDescription;
use cdpr_tests::{paper_cases, random_tests, tolerance};
use nalgebra::{Matrix4, Vector4};
use proptest::prelude::*;

/// Where none and [3] meet when the linear density of the paper's pose rises and EA stays, kg/m, and
/// the length of cable 3 there, m: the maximum of the density over that length, from Irvine's equations
/// with arcsinh in 40-digit arithmetic.
const PAPER_FOLD: (f64, f64) = (0.004_192_992_413_708_873, 58.132_243_466_279);

/// How solutions at single values are found, those beyond limits as well.
const CONTINUATION: Options = Options {
    method: Method::Continuation,
    steps: Steps::Tested,
    retrace: false,
    kantorovich: false,
};

/// The paper's pose with five solutions, at the density where it has them.
fn paper_pose() -> Request {
    Parameter::LinearDensity.request_at(&paper_cases()[3].request(), 0.004)
}

fn trace(request: &Request, parameter: Parameter, from: f64, to: f64) -> Diagram {
    let range = Range::new(from, to).expect("a range");
    Diagram::trace(request, parameter, range).expect("a valid pose")
}

fn paper_diagram() -> Diagram {
    trace(&paper_pose(), Parameter::LinearDensity, 0.001, 0.079)
}

/// Branches over a value of the parameter.
fn crossing(diagram: &Diagram, value: f64) -> usize {
    let over = |branch: &&SolutionBranch| {
        branch.points[0].value <= value
            && branch.points.last().is_some_and(|last| value <= last.value)
    };
    diagram.branches.iter().filter(over).count()
}

/// Solutions that the enumeration finds at a single value, those beyond limits among them.
fn solutions(request: &Request, parameter: Parameter, value: f64) -> usize {
    let answer =
        parameter.request_at(request, value).enumerate(CONTINUATION).expect("a valid pose");
    let arrived =
        |end: &BranchEnd| matches!(end, BranchEnd::Solution(_) | BranchEnd::BeyondLimit { .. });
    answer.branches.iter().filter(|branch| arrived(&branch.end)).count()
}

fn only_fold(diagram: &Diagram) -> &Fold {
    let [fold] = &diagram.folds[..] else { panic!("{} folds", diagram.folds.len()) };
    fold
}

/// The maximum of the parameter along one branch into a fold, from four solutions on it that the
/// core's Newton finds without any path: `p` as a cubic in the length of `cable`.
fn vertex(request: &Request, fold: &Fold, branch: &SolutionBranch, cable: usize) -> f64 {
    // Lengths change like the square root of the distance to the fold, so start on that parabola,
    // through the fold and a point of the branch.
    let mut points = branch.points.iter();
    let near = points.rfind(|point| (point.value / fold.value - 1.0).abs() > 1e-3).expect("one");
    let solved = |part: f64| {
        let value = fold.value * (1.0 - 1e-6 * part * part);
        let share = ((fold.value - value) / (fold.value - near.value)).sqrt();
        let start: [CableState<f64>; CABLES] = std::array::from_fn(|i| {
            let (at, off) = (&fold.states[i], &near.states[i]);
            CableState {
                force_n: at.force_n + (off.force_n - at.force_n) * share,
                rest_length_m: at.rest_length_m + (off.rest_length_m - at.rest_length_m) * share,
            }
        });
        let problem = Parameter::LinearDensity
            .request_at(request, value)
            .problem::<IrvineCatenary<f64>>()
            .expect("a valid pose");
        let found = newton::converge(&problem.robot, &problem.balance, &start, 1e-10, 20);
        let length_m = found.expect("converges").step.states[cable].rest_length_m;
        (length_m / fold.states[cable].rest_length_m - 1.0, value / fold.value - 1.0)
    };
    let samples = [1.0, 2.0, 3.0, 4.0].map(solved);
    let powers =
        Matrix4::from_fn(|row, column| samples[row].0.powi(i32::try_from(column).unwrap()));
    let values = Vector4::from_fn(|row, _| samples[row].1);
    let cubic = powers.lu().solve(&values).expect("four different lengths");
    let mut x = 0.0;
    for _ in 0..20 {
        let slope = cubic[1] + x * (2.0 * cubic[2] + x * 3.0 * cubic[3]);
        x -= slope / (2.0 * cubic[2] + x * 6.0 * cubic[3]);
    }
    fold.value * (1.0 + cubic[0] + x * (cubic[1] + x * (cubic[2] + x * cubic[3])))
}

#[test]
fn none_and_3_meet_where_the_density_says() {
    let (request, diagram) = (paper_pose(), paper_diagram());
    assert!(diagram.is_consistent(), "{:?} {:?}", diagram.checks, diagram.doubts);
    let fold = only_fold(&diagram);
    assert_eq!(format!("{:.10}", fold.value), "0.0041929924");
    assert!((fold.value / PAPER_FOLD.0 - 1.0).abs() < tolerance::FOLD);
    let length_m = fold.states[2].rest_length_m;
    assert!((length_m / PAPER_FOLD.1 - 1.0).abs() < tolerance::FOLD_STATE);
    assert!(fold.is_death);
    let meeting = fold.branches.map(|index| &diagram.branches[index]);
    assert_eq!(meeting.map(|branch| branch.origin), [&[][..], &[3]].map(|s| Some(SlackSet::of(s))));
    assert_ne!(meeting[0].is_positive, meeting[1].is_positive);
    for branch in meeting {
        assert_eq!((branch.low, branch.high), (Border::Range, Border::Fold(0)));
        assert_eq!(branch.points.last().map(|point| point.states), Some(fold.states));
        // From this branch alone, and without following it.
        let vertex = vertex(&request, fold, branch, 2);
        assert_eq!(format!("{vertex:.10}"), "0.0041929924");
    }
    // By counting solutions on either side.
    for (share, count) in [(1.0 - 1e-6, 5), (1.0 + 1e-6, 3)] {
        let value = fold.value * share;
        assert_eq!(solutions(&request, Parameter::LinearDensity, value), count);
        assert_eq!(crossing(&diagram, value), count);
    }
    assert_eq!([0.004, 0.079].map(|value| crossing(&diagram, value)), [5, 3]);
}

#[test]
fn a_fold_is_the_same_along_every_parameter() {
    let at_fold = |parameter, from, to, request: &Request| {
        let diagram = trace(request, parameter, from, to);
        assert!(diagram.is_consistent(), "{:?} {:?}", diagram.checks, diagram.doubts);
        only_fold(&diagram).clone()
    };
    let density_kg_m = 0.0042;
    let request = Parameter::LinearDensity.request_at(&paper_pose(), density_kg_m);
    for (parameter, from, to, is_death) in
        [(Parameter::AxialStiffness, 3e3, 1e6, true), (Parameter::Mass, 5.0, 20.0, false)]
    {
        let fold = at_fold(parameter, from, to, &request);
        // A lighter cable, a softer one and a heavier platform all bring the two solutions back.
        assert_eq!(fold.is_death, is_death, "{parameter:?}");
        // With that stiffness or mass, the density has its fold where it was held before.
        let there = parameter.request_at(&request, fold.value);
        let crossed = at_fold(Parameter::LinearDensity, 0.004, 0.0044, &there);
        let apart = (crossed.value / density_kg_m - 1.0).abs();
        assert!(apart < tolerance::FOLD, "{parameter:?}: {apart:e}");
        for (a, b) in fold.states.iter().zip(&crossed.states) {
            let apart = (a.rest_length_m / b.rest_length_m - 1.0).abs();
            assert!(apart < tolerance::FOLD_STATE, "{parameter:?}: {apart:e}");
        }
    }
}

/// A pose whose solutions hang over each other as the mass grows, with a branch between the two
/// folds that no rigid solution leads to.
fn hysteresis() -> Request {
    let overrides = Overrides {
        linear_density_kg_m: Some(0.243),
        axial_stiffness_n: Some(1.78e6),
        max_length_m: Some(200.0),
        max_tension_n: Some(3000.0),
        ..Overrides::default()
    };
    Request {
        robot: overrides.apply(&RobotDescription::marionet_crane()),
        position_m: [-0.0877, 7.1964, 0.8488],
        rotation_vector_rad: [-0.0265, 0.3645, 0.2415],
        model: ModelKind::Irvine,
    }
}

#[test]
fn a_branch_without_rigid_origin_is_found_and_said() {
    let request = hysteresis();
    let diagram = trace(&request, Parameter::Mass, 1.0, 300.0);
    assert_eq!(diagram.doubts, []);
    assert_eq!(diagram.folds.iter().map(|fold| fold.is_death).collect::<Vec<_>>(), [false, true]);
    let between = diagram.branches.iter().filter(|branch| branch.origin.is_none());
    let [between] = &between.collect::<Vec<_>>()[..] else { panic!("one branch without origin") };
    assert_eq!((between.low, between.high), (Border::Fold(0), Border::Fold(1)));
    // The complete search knows it at the values between the folds, and only there.
    assert!(diagram.is_consistent());
    let folds = &diagram.folds;
    for check in &diagram.checks {
        let inside = folds[0].value < check.value && check.value < folds[1].value;
        let count = if inside { 3 } else { 1 };
        assert_eq!((check.solutions, check.branches), (count, count));
        assert_eq!(check.degree, diagram.rigid_degree);
    }
}

#[test]
fn every_point_solves_the_equations() {
    let diagrams = [
        (paper_pose(), Parameter::LinearDensity, 0.001, 0.079),
        (paper_pose(), Parameter::AxialStiffness, 1e4, 1e7),
        (paper_pose(), Parameter::Mass, 1.0, 100.0),
        (hysteresis(), Parameter::Mass, 1.0, 300.0),
    ];
    for (request, parameter, from, to) in diagrams {
        let diagram = trace(&request, parameter, from, to);
        for (number, branch) in diagram.branches.iter().enumerate() {
            assert!(branch.points.len() > 20, "branch {number} of {parameter:?}");
            assert!(branch.points.is_sorted_by(|a, b| a.value < b.value), "branch {number}");
            for (index, point) in branch.points.iter().enumerate() {
                let problem = parameter
                    .request_at(&request, point.value)
                    .problem::<IrvineCatenary<f64>>()
                    .expect("a valid pose");
                let is_end = index == 0 || index + 1 == branch.points.len();
                let step = match NewtonStep::new(&problem.robot, &problem.balance, &point.states) {
                    Ok(step) => step,
                    Err(fault) => {
                        assert!(is_end, "{fault} at {} of branch {number}", point.value);
                        continue; // exactly at a fold
                    }
                };
                let largest = |quantity: &dyn Fn(usize) -> f64| {
                    (0..CABLES).map(quantity).fold(0.0_f64, f64::max)
                };
                let length_m = largest(&|i| point.states[i].rest_length_m);
                let force_n = largest(&|i| point.states[i].force_n.norm());
                let residual = (step.closure_m / length_m).max(step.imbalance_n / force_n);
                assert!(residual < tolerance::POINT, "{residual:e} at {}", point.value);
                if !is_end {
                    assert_eq!(step.is_positive(), branch.is_positive, "at {}", point.value);
                }
                for i in 0..CABLES {
                    let weight_n_m = problem.model(i).weight_n_m;
                    let tension_n = point.states[i].tension_at_anchor_n(weight_n_m);
                    assert!((point.anchor_tensions_n[i] / tension_n - 1.0).abs() < 1e-12);
                }
            }
        }
    }
}

#[test]
fn limits_are_crossed_where_the_solution_says() {
    let mut request = paper_pose();
    for limits in &mut request.robot.limits {
        (limits.max_length_m, limits.max_tension_n) = (3000.0, 130.0);
    }
    let diagram = trace(&request, Parameter::Mass, 5.0, 20.0);
    let mut seen = Vec::new();
    for branch in &diagram.branches {
        for crossing in &branch.limit_crossings {
            seen.push(crossing.quantity);
            for (share, is_beyond) in
                [(1.0 - 1e-8, !crossing.is_beyond_above), (1.0 + 1e-8, crossing.is_beyond_above)]
            {
                let there = Parameter::Mass.request_at(&request, crossing.value * share);
                let answer = there.enumerate(CONTINUATION).expect("a valid pose");
                let origin = branch.origin.expect("the paper's branches have one");
                let end = &answer.branches.iter().find(|b| b.origin == origin).expect("it").end;
                let (BranchEnd::Solution(solution) | BranchEnd::BeyondLimit { solution, .. }) = end
                else {
                    panic!("{end:?}");
                };
                let limits = &request.robot.limits[crossing.cable];
                let excess = match crossing.quantity {
                    Quantity::Length => {
                        solution.states[crossing.cable].rest_length_m > limits.max_length_m
                    }
                    Quantity::Tension => solution.tension_n(crossing.cable) > limits.max_tension_n,
                };
                assert_eq!(excess, is_beyond, "{crossing:?}");
            }
        }
        // Beyond on one side of the crossings, within on the other.
        for pair in branch.points.windows(2) {
            let changes = branch
                .limit_crossings
                .iter()
                .any(|crossing| (pair[0].value..=pair[1].value).contains(&crossing.value));
            assert!(changes || pair[0].is_beyond_limit == pair[1].is_beyond_limit);
        }
    }
    assert!(seen.contains(&Quantity::Length) && seen.contains(&Quantity::Tension), "{seen:?}");
}

#[test]
fn ranges_and_models_are_refused() {
    for (from, to) in
        [(0.0, 1.0), (-1.0, 1.0), (2.0, 1.0), (1.0, 1.0), (1.0, f64::INFINITY), (f64::NAN, 1.0)]
    {
        assert!(Range::new(from, to).is_err(), "{from} to {to}");
    }
    let range = Range::new(0.001, 0.1).expect("a range");
    for (model, parameter) in
        [(ModelKind::Rigid, Parameter::Mass), (ModelKind::Elastic, Parameter::LinearDensity)]
    {
        let request = Request { model, ..paper_pose() };
        assert!(Diagram::trace(&request, parameter, range).is_err(), "{model:?}");
    }
}

proptest! {
    #![proptest_config(random_tests(60))]

    /// Anywhere in the range, and not only where branches start, as many branches as solutions; the
    /// degree is that of the rigid solutions; at each fold two branches of different sign end.
    #[test]
    fn branches_and_solutions_agree(
        position_m in [-3.0..9.0, -1.0..20.0, 0.0..8.0],
        rotation_vector_rad in [-0.4..0.4, -0.4..0.4, -0.4..0.4],
        mass in 0.5..2.5, density in -3.0..0.0, stiffness in 4.5..7.5,
        what in 0..3, parabolic: bool, place in 0.0..1.0,
    ) {
        let overrides = Overrides {
            mass_kg: Some(10_f64.powf(mass)),
            linear_density_kg_m: Some(10_f64.powf(density)),
            axial_stiffness_n: Some(10_f64.powf(stiffness)),
            ..Overrides::default()
        };
        let request = Request {
            robot: overrides.apply(&RobotDescription::marionet_crane()),
            position_m,
            rotation_vector_rad,
            model: if parabolic { ModelKind::Parabolic } else { ModelKind::Irvine },
        };
        let (parameter, from, to) = match what {
            0 => (Parameter::LinearDensity, 1e-3, 1.0),
            1 => (Parameter::AxialStiffness, 1e4, 1e7),
            _ => (Parameter::Mass, 1.0, 300.0),
        };
        let diagram = trace(&request, parameter, from, to);
        prop_assert_eq!(&diagram.doubts, &Vec::<Doubt>::new());
        for check in &diagram.checks {
            prop_assert_eq!(check.degree, diagram.rigid_degree);
        }
        for (index, fold) in diagram.folds.iter().enumerate() {
            let [a, b] = fold.branches.map(|branch| &diagram.branches[branch]);
            prop_assert!(a.is_positive != b.is_positive && fold.branches[0] != fold.branches[1]);
            for branch in [a, b] {
                let border = if fold.is_death { branch.high } else { branch.low };
                prop_assert_eq!(border, Border::Fold(index));
            }
        }
        let value = from * (to / from).powf(place);
        let (branches, solutions) =
            (crossing(&diagram, value), solutions(&request, parameter, value));
        prop_assert!(branches >= solutions, "{branches} branches, {solutions} solutions");
        if diagram.branches.iter().all(|branch| branch.origin.is_some()) {
            prop_assert_eq!(branches, solutions);
        }
    }
}
