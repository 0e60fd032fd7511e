//! The inverse kinematics of MARIONET-CRANE, from the rigid solutions to the deformable ones and back.

use cdpr_core::statics::Balance;
use cdpr_core::{
    CABLES, Cable, CableModel, IrvineCatenary, NewtonStep, Parabola, Pose, Robot, newton,
};
use cdpr_host_sim::cases::Overrides;
use cdpr_host_sim::continuation::{BranchEnd, Solution, Steps};
use cdpr_host_sim::enumerate::{Enumeration, Method, ModelKind, Options, Request, Retraced};
use cdpr_host_sim::rigid::SlackSet;
use cdpr_host_sim::robot_file::RobotDescription;
use cdpr_tests::{PoseCase, SolutionCase, paper_cases, random_cases, random_tests, tolerance};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use proptest::prelude::*;

/// Largest relative error of the lengths, and of the forces as plane vectors.
fn errors(found: &Solution, expected: &SolutionCase) -> (f64, f64) {
    let mut lengths = 0.0_f64;
    let mut forces = 0.0_f64;
    for i in 0..CABLES {
        let state = &found.states[i];
        let force = Vector2::new(expected.fx_n[i], expected.fz_n[i]);
        lengths = lengths.max((state.rest_length_m / expected.lengths_m[i] - 1.0).abs());
        forces = forces.max((state.force_n - force).norm() / force.norm());
    }
    (lengths, forces)
}

fn agrees(found: &Solution, expected: &SolutionCase) -> bool {
    let (lengths, forces) = errors(found, expected);
    lengths < tolerance::SOLUTION_LENGTH && forces < tolerance::SOLUTION_FORCE
}

fn enumerate(case: &PoseCase) -> Enumeration {
    case.request().enumerate(Options { retrace: true, ..Options::default() }).expect("a valid pose")
}

/// Every found solution is expected, every expected one is found, and none twice.
fn assert_same_solutions(answer: &Enumeration, case: &PoseCase) {
    assert_eq!(answer.solutions.len(), case.solutions.len(), "at {:?}", case.position_m);
    assert!(answer.is_complete(), "at {:?}", case.position_m);
    assert_eq!(answer.differences, [], "at {:?}", case.position_m);
    for expected in &case.solutions {
        let found =
            answer.solutions.iter().filter(|found| agrees(&found.solution, expected)).count();
        assert_eq!(found, 1, "{:?} at {:?}", expected.lengths_m, case.position_m);
    }
}

#[test]
fn the_paper_is_reproduced() {
    for case in paper_cases() {
        let answer = enumerate(&case);
        assert_eq!(answer.rigid.solutions.len(), case.rigid_solutions.len());
        for expected in &case.rigid_solutions {
            let set = SlackSet::of(&expected.slack);
            let found =
                answer.rigid.solutions.iter().find(|s| s.slack == set).expect("the rigid set");
            for i in 0..CABLES {
                let error = (found.forces_n[i] / expected.forces_n[i] - 1.0).abs();
                assert!(error < tolerance::RIGID_FORCE, "{set}, cable {}: {error:e}", i + 1);
            }
        }
        assert_same_solutions(&answer, &case);
        for expected in &case.solutions {
            let found = answer
                .solutions
                .iter()
                .find(|f| agrees(&f.solution, expected))
                .expect("found above");
            let origin =
                SlackSet::of(expected.from_rigid_slack_set.as_ref().expect("paper.json names it"));
            assert_eq!(found.origin, Some(origin));
            assert_eq!(found.retraced, Some(Retraced::Rigid(origin)), "the inverse scheme");
            assert_eq!(
                found.solution.is_positive,
                expected.det_sign.expect("paper.json has it") > 0
            );
        }
        assert_eq!(answer.degree(), answer.rigid.degree());
    }
}

#[test]
fn random_poses_are_reproduced() {
    for case in random_cases() {
        let answer = enumerate(&case);
        let mut sets: Vec<_> = answer.rigid.solutions.iter().map(|s| s.slack).collect();
        let mut expected: Vec<_> =
            case.rigid_slack_sets.iter().map(|set| SlackSet::of(set)).collect();
        sets.sort_unstable();
        expected.sort_unstable();
        assert_eq!(sets, expected);
        assert_same_solutions(&answer, &case);
        for found in &answer.solutions {
            assert_eq!(found.retraced, found.origin.map(Retraced::Rigid), "the inverse scheme");
        }
    }
}

/// The paper's pose with five solutions, at this share of mass and stretch of its steel cables.
fn paper_pose_at(deformation: f64) -> Enumeration {
    let mut case = paper_cases().remove(3);
    case.linear_density_kg_m *= deformation;
    case.axial_stiffness_n /= deformation;
    case.request().enumerate(Options::default()).expect("a valid pose")
}

#[test]
fn none_and_3_end_in_one_fold() {
    let (none, three) = (SlackSet::of(&[]), SlackSet::of(&[3]));
    let answer = paper_pose_at(1.0);
    let branch =
        |set| answer.branches.iter().find(|b| b.origin == set).expect("a branch for each set");
    let mut folds = Vec::new();
    for (set, partner) in [(none, three), (three, none)] {
        assert_eq!(branch(set).end, BranchEnd::MetBranch(partner));
        let [fold] = &branch(set).folds[..] else { panic!("one fold on branch {set}") };
        folds.push(fold);
    }
    assert!((folds[0].deformation / folds[1].deformation - 1.0).abs() < tolerance::FOLD);
    // The paper has mu = 0.0042; with more digits s = 0.053075, mu = 0.0041929 kg/m.
    assert_eq!(format!("{:.6}", folds[0].deformation), "0.053075");
    assert_eq!(format!("{:.7}", folds[0].deformation * 0.079), "0.0041929");
    assert_eq!(answer.solutions.len(), 3);

    // The same without arc length: two solutions on one side of the fold, none on the other.
    for (share, solutions) in [(1.0 - 1e-6, 5), (1.0 + 1e-6, 3)] {
        assert_eq!(paper_pose_at(folds[0].deformation * share).solutions.len(), solutions);
    }
}

#[test]
fn a_limit_is_named() {
    let mut case = paper_cases().remove(0);
    case.max_length_m = 60.0;
    let answer = enumerate(&case);
    assert!(answer.solutions.is_empty());
    let text = answer.branches[0].to_string();
    assert!(text.contains("length of cable 4 is 165.251 m"), "{text}");
    case.max_length_m = 5000.0;
    case.max_tension_n = 480.0;
    let text = enumerate(&case).branches[0].to_string();
    assert!(text.contains("tension of cable 5 is 489.772 N"), "{text}");
}

#[test]
fn a_massless_cable_cannot_be_slack() {
    let mut request = paper_cases()[2].request();
    request.model = ModelKind::Elastic;
    let answer = request.enumerate(Options::default()).expect("a valid pose");
    assert_eq!(answer.solutions.len(), 1);
    assert_eq!(answer.solutions[0].origin, Some(SlackSet::of(&[])));
    let taut = &answer.solutions[0].solution;
    for (state, cable) in taut.states.iter().zip(answer.rigid.solutions[0].forces_n) {
        // A straight elastic cable pulls along the chord, as the rigid one does.
        assert!((state.tension_at_attachment_n() / cable - 1.0).abs() < tolerance::RIGID_FORCE);
    }
    assert!(answer.branches[1..].iter().all(|b| matches!(b.end, BranchEnd::Weightless { .. })));
}

#[test]
fn models_agree_where_cables_are_nearly_straight() {
    // All six cables taut: sag and stretch are small, and catenary and parabola differ by their square.
    let request = |model| Request {
        robot: RobotDescription::marionet_crane(),
        position_m: [2.0, 7.0, 2.5],
        rotation_vector_rad: [0.0; 3],
        model,
    };
    let solution = |model| {
        let answer = request(model).enumerate(Options::default()).expect("a valid pose");
        assert_eq!(answer.solutions.len(), 1);
        answer.solutions[0].solution.clone()
    };
    let [irvine, parabolic, rigid] =
        [ModelKind::Irvine, ModelKind::Parabolic, ModelKind::Rigid].map(solution);
    for i in 0..CABLES {
        let length = |s: &Solution| s.states[i].rest_length_m;
        let sag = (length(&irvine) / length(&rigid) - 1.0).abs();
        assert!(sag < 2e-3, "cable {}: {sag:e}", i + 1);
        let difference = (length(&irvine) / length(&parabolic) - 1.0).abs();
        assert!(difference < 0.3 * sag && difference > 0.0, "cable {}: {difference:e}", i + 1);
    }
}

#[test]
fn an_exactly_vertical_slack_cable_is_solved() {
    // Anchor 4 moved to straight above attachment 4 at this pose; the solution is continuous there.
    let length = |offset_m: f64| {
        let crane = RobotDescription::marionet_crane();
        let mut cables = *crane.robot.cables();
        cables[3].anchor_m = Vector3::new(4.27, 7.5, 8.704);
        let request = Request {
            robot: RobotDescription { robot: Robot::new(cables).expect("a robot"), ..crane },
            position_m: [4.0, 7.0 + offset_m, 2.0],
            rotation_vector_rad: [0.0; 3],
            model: ModelKind::Irvine,
        };
        let answer = request
            .enumerate(Options { retrace: true, ..Options::default() })
            .expect("a valid pose");
        assert_eq!(answer.solutions.len(), 1);
        let found = &answer.solutions[0];
        assert_eq!(found.retraced, Some(Retraced::Rigid(SlackSet::of(&[4]))));
        assert_eq!(found.solution.vertical, [false, false, false, offset_m == 0.0, false, false]);
        found.solution.states.map(|state| state.rest_length_m)
    };
    let exact = length(0.0);
    for offset_m in [1e-3, 1e-6, 1e-9, 1e-12] {
        let near = length(offset_m);
        for i in 0..CABLES {
            // The slack length moves by some hundred metres per metre of offset.
            let change = (near[i] - exact[i]).abs();
            assert!(
                change < 300.0 * offset_m + 1e-9 * exact[i],
                "{offset_m:e}, cable {}: {change:e}",
                i + 1
            );
        }
    }
}

#[test]
fn slack_length_of_a_rigid_cable_is_exact() {
    // Inextensible, heavy, straight below or above: the single-line solver must give back tau.
    let case = &paper_cases()[2];
    let answer = enumerate(case);
    let problem = case.request().problem::<IrvineCatenary<f64>>().expect("a valid pose");
    let weight_n_m = case.linear_density_kg_m * 9.81;
    for rigid in &answer.rigid.solutions {
        let states = rigid.states(&problem.balance, &[weight_n_m; CABLES]);
        for i in (0..CABLES).filter(|&i| rigid.slack.contains(i)) {
            let model = IrvineCatenary { weight_n_m, compliance_per_n: 0.0 };
            let z_m = problem.balance.planes()[i].z_m;
            let line =
                model.force_at_length(0.0, z_m, states[i].rest_length_m).expect("a hanging cable");
            assert!((line.force_n.y / rigid.forces_n[i] - 1.0).abs() < 1e-12);
        }
    }
}

/// A robot with its platform frame moved by `shift_m`, hung in a world turned about the vertical.
fn moved(
    crane: &RobotDescription,
    shift_m: Vector3<f64>,
    turn: &UnitQuaternion<f64>,
) -> RobotDescription {
    let cables = crane.robot.cables().map(|cable| Cable {
        anchor_m: turn * cable.anchor_m,
        attachment_m: cable.attachment_m - shift_m,
        model: cable.model,
    });
    let mut moved = crane.clone();
    moved.robot = Robot::new(cables).expect("a robot");
    moved.load.center_of_mass_m -= shift_m;
    moved
}

#[test]
fn frames_do_not_matter() {
    let mut crane = RobotDescription::marionet_crane();
    crane.load.center_of_mass_m = Vector3::new(0.05, -0.1, -0.2);
    let (position, rotation) = (Vector3::new(2.2, 7.3, 2.4), Vector3::new(0.05, -0.03, 0.1));
    let request = |robot, position: Vector3<f64>, rotation: Vector3<f64>| Request {
        robot,
        position_m: position.into(),
        rotation_vector_rad: rotation.into(),
        model: ModelKind::Irvine,
    };
    let reference = request(crane.clone(), position, rotation)
        .enumerate(Options::default())
        .expect("a valid pose");
    assert!(!reference.solutions.is_empty());
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 0.8));
    let shift = Vector3::new(0.3, -0.4, 0.6);
    let orientation = UnitQuaternion::from_scaled_axis(rotation);
    let answer = request(
        moved(&crane, shift, &turn),
        turn * (position + orientation * shift),
        (turn * orientation).scaled_axis(),
    )
    .enumerate(Options::default())
    .expect("a valid pose");
    assert_eq!(answer.solutions.len(), reference.solutions.len());
    for (a, b) in answer.solutions.iter().zip(&reference.solutions) {
        for (a, b) in a.solution.states.iter().zip(&b.solution.states) {
            assert!((a.rest_length_m / b.rest_length_m - 1.0).abs() < tolerance::SOLUTION_LENGTH);
        }
    }
}

#[test]
fn newton_converges_quadratically_in_f64_and_to_rounding_in_f32() {
    let case = &paper_cases()[0];
    let request = case.request();
    let problem = request.problem::<IrvineCatenary<f64>>().expect("a valid pose");
    let answer = enumerate(case);
    let solution = &answer.solutions[0].solution;
    let mut states = solution.states;
    for (i, state) in states.iter_mut().enumerate() {
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        state.force_n *= 1.0 + 1e-3 * sign;
        state.rest_length_m *= 1.0 - 1e-4 * sign;
    }
    let mut changes = Vec::new();
    for _ in 0..4 {
        let step = NewtonStep::new(&problem.robot, &problem.balance, &states).expect("a step");
        changes.push(step.relative_change);
        states = step.states;
    }
    // Quadratic: each change is at most the square of the last times a constant of the problem.
    assert!(
        changes[1] < 100.0 * changes[0].powi(2) && changes[2] < 100.0 * changes[1].powi(2),
        "{changes:?}"
    );
    assert!(changes[3] < 1e-12, "{changes:?}");
    let last =
        newton::converge(&problem.robot, &problem.balance, &states, 1e-11, 3).expect("converged");
    assert!(last.step.closure_m < 1e-12 && last.step.imbalance_n < 1e-9);
    assert!((last.step.condition() / solution.condition - 1.0).abs() < 1e-6);
    assert_eq!(last.step.is_positive(), solution.is_positive);

    #[allow(clippy::cast_possible_truncation)]
    let single = |v: f64| v as f32;
    let cables = request.robot.robot.cables().map(|cable| Cable {
        anchor_m: cable.anchor_m.map(single),
        attachment_m: cable.attachment_m.map(single),
        model: IrvineCatenary {
            weight_n_m: single(case.linear_density_kg_m * 9.81),
            compliance_per_n: single(1.0 / case.axial_stiffness_n),
        },
    });
    let robot = Robot::new(cables).expect("a robot");
    let load = &request.robot.load;
    let load = cdpr_core::Load {
        mass_kg: single(load.mass_kg),
        center_of_mass_m: load.center_of_mass_m.map(single),
        gravity_m_s2: single(load.gravity_m_s2),
        force_n: load.force_n.map(single),
        moment_nm: load.moment_nm.map(single),
    };
    let pose = Pose::new(Vector3::from(case.position_m).map(single), UnitQuaternion::identity())
        .expect("a pose");
    let balance = Balance::at(&robot, &load, &pose).expect("a balance");
    let mut states = solution.states.map(|state| cdpr_core::CableState {
        force_n: state.force_n.map(|f| single(f * 1.001)),
        rest_length_m: single(state.rest_length_m),
    });
    for _ in 0..3 {
        states = NewtonStep::new(&robot, &balance, &states).expect("a step").states;
    }
    // Equilibrium shares the rounding of the largest force among all cables.
    let largest_n = solution.states.iter().map(|s| s.force_n.norm()).fold(0.0, f64::max);
    for (i, (a, b)) in states.iter().zip(&solution.states).enumerate() {
        let length = (f64::from(a.rest_length_m) / b.rest_length_m - 1.0).abs();
        let force = (a.force_n.map(f64::from) - b.force_n).norm() / largest_n;
        let bound = f64::from(f32::EPSILON) * solution.condition;
        assert!(length < bound && force < bound, "cable {}: {length:e}, {force:e}", i + 1);
    }
}

#[test]
fn a_step_refuses_what_has_no_tangent() {
    let case = &paper_cases()[0];
    let request = case.request();
    let problem = request.problem::<Parabola<f64>>().expect("a valid pose");
    let good = enumerate(case).solutions[0].solution.states;
    for value in [0.0, f64::NAN, f64::INFINITY, -1.0] {
        for cable in 0..CABLES {
            let mut states = good;
            states[cable].rest_length_m = value;
            assert!(
                NewtonStep::new(&problem.robot, &problem.balance, &states).is_err(),
                "length {value}"
            );
        }
    }
    let mut states = good;
    states[2].force_n = Vector2::zeros();
    assert!(NewtonStep::new(&problem.robot, &problem.balance, &states).is_err());
}

proptest! {
    #![proptest_config(random_tests(600))]

    /// The degree depends on the pose alone, and continuation never finds a solution twice.
    #[test]
    fn degree_is_invariant(
        position_m in [-3.0..9.0, -1.0..20.0, 0.0..8.0],
        rotation_vector_rad in [-0.4..0.4, -0.4..0.4, -0.4..0.4],
        mass in 0.5..2.5, density in -3.0..0.0, stiffness in 4.5..7.5,
        parabolic: bool,
    ) {
        let overrides = Overrides {
            mass_kg: Some(10_f64.powf(mass)),
            linear_density_kg_m: Some(10_f64.powf(density)),
            axial_stiffness_n: Some(10_f64.powf(stiffness)),
            max_length_m: Some(f64::INFINITY),
            max_tension_n: Some(f64::INFINITY),
            ..Overrides::default()
        };
        let request = Request {
            robot: overrides.apply(&RobotDescription::marionet_crane()),
            position_m,
            rotation_vector_rad,
            model: if parabolic { ModelKind::Parabolic } else { ModelKind::Irvine },
        };
        // Without limits only continuation has an end.
        let options = Options { method: Method::Continuation, steps: Steps::Tested, retrace: true, ..Options::default() };
        let answer = request.enumerate(options).expect("a valid pose");
        prop_assert_eq!(answer.degree(), answer.rigid.degree());
        for branch in &answer.branches {
            let known = matches!(branch.end, BranchEnd::Solution(_) | BranchEnd::MetBranch(_));
            prop_assert!(known, "{}: {}", branch.origin, branch);
        }
        for (n, a) in answer.solutions.iter().enumerate() {
            prop_assert_eq!(a.retraced, a.origin.map(Retraced::Rigid));
            for b in &answer.solutions[..n] {
                let same = a.solution.states.iter().zip(&b.solution.states)
                    .all(|(a, b)| (a.force_n - b.force_n).norm() < 1e-6 * a.force_n.norm());
                prop_assert!(!same, "{:?} and {:?}", a.origin, b.origin);
            }
        }
    }
}
