//! The example of a user's own cable model: it needs nothing from core but the trait.

#[path = "../../host-sim/examples/user_rope/rope.rs"]
mod rope;

use cdpr_core::{CableModel, IrvineCatenary, Pose};
use cdpr_host_sim::complete::complete;
use cdpr_host_sim::continuation::{BranchEnd, Steps, direct, inverse};
use cdpr_host_sim::problem::Problem;
use cdpr_host_sim::rigid::RigidSolutions;
use cdpr_host_sim::robot_file::RobotDescription;
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use rope::StiffeningRope;

const ROPE: StiffeningRope<f64> =
    StiffeningRope { weight_n_m: 0.775, compliance_per_n: 1e-4, stiffening_n: 500.0 };

#[test]
fn without_stiffening_it_is_the_elastic_catenary() {
    let rope = StiffeningRope { stiffening_n: f64::INFINITY, ..ROPE };
    let irvine = IrvineCatenary { weight_n_m: 0.775, compliance_per_n: 1e-4 };
    for force_n in [Vector2::new(40.0, -70.0), Vector2::new(5.0, 30.0), Vector2::new(0.3, 3.0)] {
        let (a, b) = (rope.end_point(force_n, 12.0), irvine.end_point(force_n, 12.0));
        assert!((a.position_m - b.position_m).amax() < 1e-13);
        assert!((a.jacobian - b.jacobian).amax() < 1e-12 * b.jacobian.amax());
    }
}

#[test]
fn its_derivative_is_right() {
    let (force_n, length_m, h) = (Vector2::new(150.0, -210.0), 12.0, 1e-6);
    let exact = ROPE.end_point(force_n, length_m).jacobian;
    let column = |force_step: Vector2<f64>, length_step: f64| {
        let ahead = ROPE.end_point(force_n + force_step * h, length_m + length_step * h).position_m;
        let behind =
            ROPE.end_point(force_n - force_step * h, length_m - length_step * h).position_m;
        (ahead - behind) / (2.0 * h)
    };
    let columns = [(Vector2::x(), 0.0), (Vector2::y(), 0.0), (Vector2::zeros(), 1.0)];
    for (j, (force_step, length_step)) in columns.into_iter().enumerate() {
        // Rounding leaves epsilon L / h = 3e-9.
        assert!((column(force_step, length_step) - exact.column(j)).amax() < 1e-8, "column {j}");
    }
}

#[test]
fn all_of_the_library_works_with_it() {
    // One line: the default solver of the trait.
    for (x_m, z_m, length_m) in [(8.0, -6.0, 9.9), (8.0, -6.0, 14.0), (3.0, 4.0, 30.0)] {
        let line = ROPE.force_at_length(x_m, z_m, length_m).expect("a force");
        assert!(line.residual_m < 1e-13 * length_m, "{line:?}");
        assert!(line.iterations <= cdpr_core::line::nested_iteration_bound::<f64>());
    }
    // The robot: there and back.
    let crane = RobotDescription::marionet_crane();
    let robot = crane.robot.map_models(|_, _| ROPE);
    let pose = Pose::new(Vector3::new(4.0, 7.0, 2.0), UnitQuaternion::identity()).expect("a pose");
    let problem = Problem::new(robot, &crane.load, &pose, crane.limits).expect("a problem");
    let rigid = RigidSolutions::of(&problem.balance);
    let branches = direct(&problem, &rigid.solutions, Steps::Certified);
    let [branch] = &branches[..] else { panic!("one branch") };
    assert!(branch.is_certified(), "{branch}");
    let BranchEnd::Solution(solution) = &branch.end else { panic!("{branch}") };
    assert_eq!(
        inverse(&problem, &rigid.solutions, solution, Steps::Certified),
        Some(branch.origin)
    );

    // All solutions, with a proof.
    let found = complete(&problem).expect("a search");
    assert!(found.undecided.is_empty());
    let [proof] = &found.solutions[..] else { panic!("one solution") };
    assert!(proof.holds(&solution.states));
}
