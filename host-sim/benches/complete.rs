//! How long it takes to find all solutions of a pose with a proof, over the workspace of MARIONET-CRANE.
//!
//! ```text
//! cargo bench -p cdpr-host-sim --bench complete
//! ```
//!
//! One thread. On a shared machine only ratios of figures from one run mean anything; boxes and pieces
//! are exact.

use std::time::Instant;

use cdpr_core::IrvineCatenary;
use cdpr_host_sim::cases::Overrides;
use cdpr_host_sim::complete::complete;
use cdpr_host_sim::continuation::{self, Steps};
use cdpr_host_sim::enumerate::{ModelKind, Request};
use cdpr_host_sim::problem::Problem;
use cdpr_host_sim::rigid::RigidSolutions;
use cdpr_host_sim::robot_file::RobotDescription;

/// The box of poses, m, and the points along each axis.
const REGION: [(f64, f64, usize); 3] = [(-3.0, 9.5, 25), (-0.5, 20.4, 40), (0.2, 5.2, 10)];
/// The platform of the robot file and the light one of the paper's second example, kg.
const MASSES: [f64; 2] = [69.0, 10.0];

/// The work of one pose.
struct Pose {
    complete_us: f64,
    continuation_us: f64,
    boxes: usize,
    pieces: usize,
    solutions: usize,
}

fn main() {
    for mass_kg in MASSES {
        let poses: Vec<Pose> = grid().map(|position_m| run(position_m, mass_kg)).collect();
        report(&format!("{mass_kg} kg, all poses"), poses.iter());
        report(&format!("{mass_kg} kg, reachable"), poses.iter().filter(|p| p.solutions > 0));
    }
}

fn grid() -> impl Iterator<Item = [f64; 3]> {
    let axis = |k: usize| {
        let (low, high, count) = REGION[k];
        (0..count).map(move |i| low + (high - low) * i as f64 / (count - 1) as f64)
    };
    axis(0).flat_map(move |x| axis(1).flat_map(move |y| axis(2).map(move |z| [x, y, z])))
}

fn run(position_m: [f64; 3], mass_kg: f64) -> Pose {
    let changes = Overrides { mass_kg: Some(mass_kg), ..Overrides::default() };
    let request = Request {
        robot: changes.apply(&RobotDescription::marionet_crane()),
        position_m,
        rotation_vector_rad: [0.0; 3],
        model: ModelKind::Irvine,
    };
    let problem: Problem<IrvineCatenary<f64>> = request.problem().expect("a pose");
    let start = Instant::now();
    let found = complete(&problem).expect("a search");
    let complete_us = 1e6 * start.elapsed().as_secs_f64();
    assert!(found.undecided.is_empty(), "undecided at {position_m:?}");
    let start = Instant::now();
    let rigid = RigidSolutions::of(&problem.balance);
    let branches = continuation::direct(&problem, &rigid.solutions, Steps::Tested);
    let continuation_us = 1e6 * start.elapsed().as_secs_f64();
    assert_eq!(branches.len(), rigid.solutions.len());
    Pose {
        complete_us,
        continuation_us,
        boxes: found.boxes,
        pieces: found.pieces,
        solutions: found.solutions.len(),
    }
}

fn report<'a>(title: &str, poses: impl Iterator<Item = &'a Pose>) {
    let poses: Vec<&Pose> = poses.collect();
    println!("{title}: {} poses", poses.len());
    let line = |name: &str, value: &dyn Fn(&Pose) -> f64| {
        let mut values: Vec<f64> = poses.iter().map(|p| value(p)).collect();
        values.sort_by(f64::total_cmp);
        let quantile = |percent: usize| values[(values.len() - 1) * percent / 100];
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        println!(
            "  {name:<24} mean {mean:9.1}  median {:9.1}  99 % {:9.1}  largest {:9.1}",
            quantile(50),
            quantile(99),
            quantile(100)
        );
    };
    line("complete, us", &|p| p.complete_us);
    line("  boxes", &|p| p.boxes as f64);
    line("  pieces of curve", &|p| p.pieces as f64);
    line("  us a box", &|p| p.complete_us / p.boxes.max(1) as f64);
    line("continuation alone, us", &|p| p.continuation_us);
    line("solutions", &|p| p.solutions as f64);
}
