//! A test bench of one's own: the loop period by period, with a check after each.
//!
//! A crane with a load swings for a moment, is pushed, and must not stray by more than 10 cm; whatever the test bench
//! wants to know it asks between two periods.
//!
//! ```text
//! cargo run --release --example test_bench
//! ```

use std::error::Error;

use cdpr_host_sim::problem::Precision;
use cdpr_host_sim::robot_file::RobotDescription;
use cdpr_host_sim::simulate::{
    Beginning, HostController, Scenario, Simulation, Summary, Trajectory,
};

const TRAJECTORY: &str = "time_s,x_m,y_m,z_m
0, 2.0, 7.0, 2.5
3, 2.2, 7.5, 2.6
6, 2.0, 7.0, 2.5
";

const SCENARIO: &str = "
[[fault]]
kind = 'push'
force_n = [0, 80, 0]
at_s = 2.0
for_s = 0.2
";

fn main() -> Result<(), Box<dyn Error>> {
    let mut crane = RobotDescription::marionet_crane();
    for limits in &mut crane.limits {
        (limits.max_length_m, limits.max_tension_n) = (60.0, 2000.0);
    }
    let trajectory = Trajectory::parse(TRAJECTORY, "TRAJECTORY")?;
    trajectory.check(crane.control.way_point_s, &crane.motion_limits(), crane.control.period_s)?;
    let scenario = Scenario::parse(SCENARIO, "SCENARIO")?;

    let beginning = Beginning::at(&crane, &trajectory, None)?;
    let controller = HostController::start(&crane, &beginning, None, Precision::F32)?;
    let mut simulation = Simulation::new(&crane, &trajectory, &scenario, &beginning, controller)?;
    let mut summary = Summary::new(crane.control.period_s);
    while let Some(sample) = simulation.step()? {
        summary.add(&sample);
        let stray_m = (sample.place.position_m - sample.commanded.position_m).norm();
        assert!(stray_m < 0.1, "{stray_m} m astray at {} s", sample.time_s);
        if summary.ticks.is_multiple_of(100) {
            let error = simulation.pose_error(&sample);
            summary.look(&sample, error.as_ref());
        }
    }
    summary.close(simulation.is_finished(), simulation.stops());
    println!("{}: at most {:.1} mm astray", summary.outcome, 1e3 * summary.total_m.largest);
    assert!(summary.outcome.is_at_end());
    Ok(())
}
