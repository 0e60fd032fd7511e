//! The refined solutions answer the questions that the program is asked, with the same doubles.

use cdpr_core::{CableModel, IrvineCatenary};
use cdpr_tests::{paper_cases, random_cases, refined_cases, tolerance};
use nalgebra::Vector2;

/// Residual of the balance, times `eps` and the sum of all forces, with moments over the moment arm:
/// force, direction, arm and two products round by `eps/2` each; largest found 0.43.
const BALANCE: f64 = 2.5;

#[test]
fn the_data_are_the_doubles_of_the_program() {
    for case in refined_cases() {
        let request = case.pose.request();
        let load = &request.robot.load;
        assert_eq!(load.gravity_m_s2.to_bits(), case.gravity_m_s2.to_bits(), "{}", case.origin);
        let problem = request.problem::<IrvineCatenary<f64>>().expect("a pose of the robot");
        for i in 0..6 {
            let model = problem.model(i);
            assert_eq!(model.weight_n_m.to_bits(), case.weight_n_m.to_bits());
            assert_eq!(model.compliance_per_n.to_bits(), case.compliance_per_n.to_bits());
        }
        let platform_n = -problem.balance.wrench_n()[2];
        assert_eq!(platform_n.to_bits(), case.platform_weight_n.to_bits());
    }
}

#[test]
fn every_solution_is_refined_once() {
    let refined = refined_cases();
    let plain: Vec<_> = paper_cases().into_iter().chain(random_cases()).collect();
    // One more: the pose without a rigid solution.
    assert_eq!(refined.len(), plain.len() + 1);
    assert_eq!(refined.last().map(|case| case.pose.solutions.len()), Some(2));
    for (case, other) in refined.iter().zip(&plain) {
        assert_eq!(case.pose.solutions.len(), other.solutions.len(), "{}", case.origin);
        for (digits, solution) in case.pose.solutions.iter().zip(&other.solutions) {
            for (digits, length_m) in digits.lengths_m.iter().zip(solution.lengths_m) {
                let refined_m: f64 = digits.parse().expect("a decimal number");
                let off = (refined_m / length_m - 1.0).abs();
                assert!(off < tolerance::SOLUTION_LENGTH, "{}: {off:e}", case.origin);
            }
        }
    }
}

#[test]
fn the_rounded_solutions_solve_the_equations_of_the_program() {
    for case in refined_cases() {
        let problem = case.pose.request().problem::<IrvineCatenary<f64>>().expect("a pose");
        for solution in &case.pose.solutions {
            let number = |digits: &String| digits.parse::<f64>().expect("a decimal number");
            let forces_n: [_; 6] = std::array::from_fn(|i| {
                Vector2::new(number(&solution.fx_n[i]), number(&solution.fz_n[i]))
            });
            let load_n = case.platform_weight_n + forces_n.iter().map(Vector2::norm).sum::<f64>();
            let residual_n = problem.balance.residual_n(&forces_n).norm();
            assert!(
                residual_n < BALANCE * f64::EPSILON * load_n,
                "{}: {residual_n:e}",
                case.origin
            );
            for (i, force_n) in forces_n.iter().enumerate() {
                let length_m = number(&solution.lengths_m[i]);
                let end_m = problem.model(i).end_point(*force_n, length_m).position_m;
                let plane = problem.balance.planes()[i];
                let off_m = (end_m - Vector2::new(plane.x_m, plane.z_m)).norm();
                let close_m = tolerance::RESIDUAL * f64::EPSILON * length_m;
                assert!(off_m < close_m, "{}, cable {}: {off_m:e}", case.origin, i + 1);
            }
        }
    }
}
