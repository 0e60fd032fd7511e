//! A table held against the complete search, at random poses.

use cdpr_core::table::{COORDINATES, TOLERANCE, Table, TableFault};
use cdpr_core::{CABLES, CableState, IrvineCatenary, Load, Pose, Robot};
use nalgebra::Vector3;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use rayon::prelude::*;
use serde::Serialize;

use super::place::pose;
use super::{Model, machine};
use crate::complete::complete;
use crate::problem::Problem;
use crate::problem::rounded;
use crate::robot_file::CableLimits;

/// The complete search goes this far beyond the longest length that the table leads to at a pose.
const ROOM: f64 = 1.5;
/// And up to this tension, in units of the highest there.
const TENSION_ROOM: f64 = 20.0;

/// What was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Verification {
    /// Poses tried.
    pub poses: usize,
    /// Of these, covered.
    pub covered: usize,
    /// Covered ones at which f32 arithmetic led to a solution that the complete search proves to exist.
    pub confirmed: usize,
    /// Those where it led elsewhere.
    pub wrong: usize,
    /// Those where the search could not decide.
    pub undecided: usize,
    /// Confirmed ones at which there are other solutions as well.
    pub with_others: usize,
}

impl Verification {
    fn add(self, other: Self) -> Self {
        Self {
            poses: self.poses + other.poses,
            covered: self.covered + other.covered,
            confirmed: self.confirmed + other.confirmed,
            wrong: self.wrong + other.wrong,
            undecided: self.undecided + other.undecided,
            with_others: self.with_others + other.with_others,
        }
    }
}

/// Checks a table at `poses` random poses of its region.
///
/// # Errors
/// [`TableFault::Malformed`] when its robot is none.
pub fn verify(table: &Table<'_>, poses: usize, seed: u64) -> Result<Verification, TableFault> {
    let machine = machine(&std::array::from_fn(|i| table.cable(i)), &table.load());
    let (robot, load) = machine.map_err(|_| TableFault::Malformed)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (low, extent) = (table.low(), table.extent());
    let places: Vec<[f64; COORDINATES]> = (0..poses)
        .map(|_| {
            std::array::from_fn(|k| {
                f64::from(low[k]) + random.random::<f64>() * f64::from(extent[k])
            })
        })
        .collect();
    Ok(places
        .par_iter()
        .map(|at| check(table, &robot, &load, at))
        .reduce(Verification::default, Verification::add))
}

fn check(
    table: &Table<'_>,
    robot: &Robot<f64, Model>,
    load: &Load<f64>,
    at: &[f64; COORDINATES],
) -> Verification {
    let mut outcome = Verification { poses: 1, ..Verification::default() };
    let Ok(exact) = pose(at) else { return outcome };
    let found = single(robot, load, &exact)
        .and_then(|(robot, load, pose)| table.states(&robot, &load, &pose));
    let found = match found {
        Ok(found) => found,
        Err(TableFault::OutsideRegion | TableFault::Uncovered(_)) => return outcome,
        // A seed that leads nowhere.
        Err(_) => return Verification { covered: 1, wrong: 1, ..outcome },
    };
    outcome.covered = 1;
    let found = found.map(|state: CableState<f32>| CableState {
        force_n: state.force_n.map(f64::from),
        rest_length_m: f64::from(state.rest_length_m),
    });
    let sum_n: f64 = found.iter().map(|s| s.force_n.lp_norm(1)).sum();
    let limits = found.map(|s| CableLimits {
        max_length_m: ROOM * s.rest_length_m.max(f64::from(table.limits_m()[0])),
        max_tension_n: TENSION_ROOM * sum_n,
    });
    let problem = Problem::new(*robot, load, &exact, limits);
    let Some(answer) = problem.ok().and_then(|problem| complete(&problem).ok()) else {
        outcome.undecided = 1;
        return outcome;
    };
    // As close as the table says, and as f32 knows the pose.
    let near = |states: &[CableState<f64>; CABLES]| {
        (0..CABLES)
            .all(|i| (states[i].force_n - found[i].force_n).lp_norm(1) <= 2.0 * TOLERANCE * sum_n)
    };
    let matching = answer.solutions.iter().filter(|proof| near(&proof.states())).count();
    match (matching, answer.undecided.is_empty()) {
        (1, _) => {
            outcome.confirmed = 1;
            outcome.with_others = usize::from(answer.solutions.len() > 1);
        }
        (_, true) => outcome.wrong = 1,
        (_, false) => outcome.undecided = 1,
    }
    outcome
}

/// Robot, load and pose as a controller in f32 has them.
#[allow(clippy::cast_possible_truncation, clippy::type_complexity)] // that is the point
fn single(
    robot: &Robot<f64, Model>,
    load: &Load<f64>,
    exact: &Pose<f64>,
) -> Result<(Robot<f32, IrvineCatenary<f32>>, Load<f32>, Pose<f32>), TableFault> {
    let vector = |v: &Vector3<f64>| v.map(|c| c as f32);
    let (robot, load) = rounded(robot, load).map_err(|_| TableFault::Malformed)?;
    let turn = exact.turn_vector().ok_or(TableFault::OutsideRegion)?;
    let w = (0.5 * (1.0 + (1.0 - turn.norm_squared()).sqrt())).sqrt();
    let v = vector(&(turn / (2.0 * w)));
    let orientation =
        nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(w as f32, v.x, v.y, v.z));
    let pose = Pose::new(vector(exact.position_m()), orientation)
        .map_err(|_| TableFault::OutsideRegion)?;
    Ok((robot, load, pose))
}
