//! The paper's conjecture, put to the test: does every solution with deformable cables come from one
//! with non-deformable cables, so that both reach the same poses?
//!
//! `cargo run --release --example conjecture`
//!
//! Scans poses of MARIONET-CRANE with a light platform, counts what either kind of cable reaches, and
//! proves one pose that only the deformable ones do: existence in interval arithmetic, and for each of
//! the 63 sets of slack cables a force that would have to push.

use cdpr_core::IrvineCatenary;
use cdpr_core::elimination::Elimination;
use cdpr_core::statics::Balance;
use cdpr_host_sim::cases::Overrides;
use cdpr_host_sim::complete::{Complete, complete};
use cdpr_host_sim::enumerate::{ModelKind, Request};
use cdpr_host_sim::problem::Problem;
use cdpr_host_sim::rigid::{RigidSolutions, SlackSet};
use cdpr_host_sim::robot_file::RobotDescription;
use nalgebra::{Matrix6, Vector6};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// Mass of the platform of the paper's second example, kg.
const MASS_KG: f64 = 10.0;
/// The box of poses, m, and the points along each axis.
const REGION: [(f64, f64, usize); 3] = [(-3.0, 9.5, 25), (-0.5, 20.4, 40), (0.2, 5.2, 10)];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let reached: Vec<Reached> =
        grid().collect::<Vec<_>>().into_par_iter().map(reach).collect::<Result<_, _>>()?;
    let count = |test: &dyn Fn(&Reached) -> bool| reached.iter().filter(|r| test(r)).count();
    println!("{} poses, {MASS_KG} kg, cables of steel, 4 mm", reached.len());
    println!("  non-deformable cables reach {}", count(&|r| r.rigid > 0));
    println!("  deformable cables reach     {}", count(&|r| r.deformable > 0));
    println!("  only non-deformable ones    {}", count(&|r| r.rigid > 0 && r.deformable == 0));
    let gained = |r: &Reached| r.rigid == 0 && r.deformable > 0;
    println!("  only deformable ones        {}", count(&gained));
    println!("  undecided                   {}", count(&|r| r.undecided));

    // The clearest of them: where no set of slack cables comes near to a solution.
    let mut clearest: Option<(f64, [f64; 3])> = None;
    for pose in reached.iter().filter(|r| gained(r)) {
        let margin = margin(&problem(pose.position_m)?.balance);
        if clearest.is_none_or(|(best, _)| margin > best) {
            clearest = Some((margin, pose.position_m));
        }
    }
    let Some((margin, position_m)) = clearest else {
        println!("no counterexample among these poses");
        return Ok(());
    };
    println!("\nAt ({}, {}, {}) m:", position_m[0], position_m[1], position_m[2]);
    println!(
        "  no rigid solution: each set of slack cables has a force below -{margin:.3} of its largest"
    );
    for proof in complete(&problem(position_m)?)?.solutions {
        println!("  a deformable solution exists, and only one, with the rest lengths (m)");
        for (cable, state) in proof.enclosure().iter().enumerate() {
            let length = state.rest_length_m;
            println!("    cable {}: {:.9} to {:.9}", cable + 1, length.low(), length.high());
        }
    }
    Ok(())
}

/// How many solutions a pose has.
struct Reached {
    position_m: [f64; 3],
    rigid: usize,
    deformable: usize,
    undecided: bool,
}

fn grid() -> impl Iterator<Item = [f64; 3]> {
    let axis = |k: usize| {
        let (low, high, count) = REGION[k];
        (0..count).map(move |i| low + (high - low) * i as f64 / (count - 1) as f64)
    };
    axis(0).flat_map(move |x| axis(1).flat_map(move |y| axis(2).map(move |z| [x, y, z])))
}

fn problem(position_m: [f64; 3]) -> Result<Problem<IrvineCatenary<f64>>, cdpr_core::GeometryFault> {
    let changes = Overrides { mass_kg: Some(MASS_KG), ..Overrides::default() };
    let request = Request {
        robot: changes.apply(&RobotDescription::marionet_crane()),
        position_m,
        rotation_vector_rad: [0.0; 3],
        model: ModelKind::Irvine,
    };
    request.problem()
}

fn reach(position_m: [f64; 3]) -> Result<Reached, String> {
    let problem = problem(position_m).map_err(|fault| fault.to_string())?;
    let rigid = RigidSolutions::of(&problem.balance);
    let Complete { solutions, undecided, .. } =
        complete(&problem).map_err(|refusal| refusal.to_string())?;
    Ok(Reached {
        position_m,
        rigid: rigid.solutions.len() + rigid.undecided.len(),
        deformable: solutions.len(),
        undecided: !undecided.is_empty(),
    })
}

/// How far every set of slack cables is from a solution: its most negative force, relative to its
/// largest, where that is smallest. Sets with dependent wrenches have solutions only where smaller
/// ones do.
fn margin(balance: &Balance<f64>) -> f64 {
    let planes = balance.planes();
    let margin = |slack: SlackSet| {
        let columns: [Vector6<f64>; 6] = std::array::from_fn(|i| {
            let unit = if slack.contains(i) {
                nalgebra::Vector2::y()
            } else {
                nalgebra::Vector2::new(planes[i].x_m, planes[i].z_m) / planes[i].distance_m()
            };
            planes[i].wrench_n(&unit)
        });
        let forces =
            Elimination::new(&Matrix6::from_columns(&columns))?.solve(&-balance.wrench_n());
        Some(-forces.min() / forces.amax())
    };
    SlackSet::all().filter_map(margin).fold(f64::INFINITY, f64::min)
}
