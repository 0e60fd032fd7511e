//! The warm f64 step, timed call by call for the comparison with other programs
//! (`benches/casadi/compare.py`).
//!
//! ```text
//! cargo bench -p cdpr-host-sim --bench warm_step [-- --json]
//! ```
//!
//! Prints the median and the shortest time of one step. With `--json` it prints instead everything
//! another program needs to walk the same path, and the lengths found.

mod warm_path;

use std::time::Instant;

use cdpr_core::Load;
use nalgebra::Vector3;
use serde_json::{Value, json};
use warm_path::{TICKS, Walker, position_m};

/// A step of 1e-5 leaves an error of 1e-10 of each force and length.
const TOLERANCE: f64 = 1e-5;
/// What a further step may change.
const ERROR: f64 = 1e-9;
/// Turns of the circle that are timed.
const TURNS: usize = 20;

fn main() {
    let mut walker = Walker::on_circle(TOLERANCE, ERROR);
    let mut times_ns = Vec::with_capacity(TURNS * TICKS);
    for _ in 0..TURNS * TICKS {
        let start = Instant::now();
        walker.warm_tick();
        times_ns.push(start.elapsed().as_nanos());
    }
    times_ns.sort_unstable();
    let (median, minimum) = (times_ns[times_ns.len() / 2], times_ns[0]);
    if std::env::args().any(|argument| argument == "--json") {
        println!(
            "{}",
            json!({ "median_ns": median, "minimum_ns": minimum, "problem": problem(walker) })
        );
    } else {
        println!("warm step: median {median} ns, minimum {minimum} ns");
    }
}

/// The robot, the poses and the solutions: at tick `k`, `states[k]` is `Fx`, `Fz`, `L` cable by cable.
fn problem(mut walker: Walker<f64>) -> Value {
    let array = |v: &Vector3<f64>| [v.x, v.y, v.z];
    let cables: Vec<Value> = walker
        .robot
        .cables()
        .iter()
        .map(|cable| {
            json!({
                "anchor_m": array(&cable.anchor_m),
                "attachment_m": array(&cable.attachment_m),
                "weight_n_m": cable.model.weight_n_m,
                "compliance_per_n": cable.model.compliance_per_n,
            })
        })
        .collect();
    let Load { mass_kg, gravity_m_s2, .. } = walker.load;
    let mut states = vec![Value::Null; TICKS];
    for _ in 0..TICKS {
        walker.warm_tick();
        states[walker.tick] = walker
            .states
            .iter()
            .flat_map(|state| [state.force_n.x, state.force_n.y, state.rest_length_m])
            .collect();
    }
    json!({
        "cables": cables,
        "moment_arm_m": walker.robot.moment_arm_m(),
        "weight_n": mass_kg * gravity_m_s2,
        "tolerance": TOLERANCE,
        "positions_m": (0..TICKS).map(position_m).collect::<Vec<_>>(),
        "states": states,
    })
}
