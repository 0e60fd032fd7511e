//! All solutions of MARIONET-CRANE with a cable model that the library does not know.
//!
//! `cargo run --release --example user_rope`

mod rope;

use cdpr_core::Pose;
use cdpr_host_sim::continuation::{self, Steps};
use cdpr_host_sim::problem::Problem;
use cdpr_host_sim::rigid::RigidSolutions;
use cdpr_host_sim::robot_file::RobotDescription;
use nalgebra::{UnitQuaternion, Vector3};
use rope::StiffeningRope;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let crane = RobotDescription::marionet_crane();
    let gravity_m_s2 = crane.load.gravity_m_s2;
    let robot = crane.robot.map_models(|_, material| StiffeningRope {
        weight_n_m: material.linear_density_kg_m * gravity_m_s2,
        compliance_per_n: 1e-4, // a soft fibre rope: 1 % at 100 N
        stiffening_n: 500.0,
    });
    let pose = Pose::new(Vector3::new(4.0, 7.0, 2.0), UnitQuaternion::identity())?;
    let problem = Problem::new(robot, &crane.load, &pose, crane.limits)?;
    let rigid = RigidSolutions::of(&problem.balance);
    for branch in continuation::direct(&problem, &rigid.solutions, Steps::Certified) {
        println!("branch {}: {branch}", branch.origin);
        if let continuation::BranchEnd::Solution(solution) = &branch.end {
            for (cable, state) in solution.states.iter().enumerate() {
                let tension_n = state.tension_at_attachment_n();
                println!("  cable {}: {:9.4} m, {tension_n:8.3} N", cable + 1, state.rest_length_m);
            }
        }
    }
    Ok(())
}
