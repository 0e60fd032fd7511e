//! A table held against the complete search, at random poses.

use cdpr_core::chart::{ChartStep, Charted as _, Start};
use cdpr_core::statics::Balance;
use cdpr_core::table::{TOLERANCE, Table, TableFault};
use cdpr_core::{
    CABLES, CableState, IrvineCatenary, Load, Pose, Real, Robot, SetPoint, Tracker,
    TrackerSettings, Twist,
};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use rayon::prelude::*;
use serde::Serialize;

use super::place::{Point, pose};
use super::{Model, machine};
use crate::complete::{Complete, Proof, complete};
use crate::problem::{Precision, Problem, rounded};
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
    /// Those that the table covers, and where its seeds lead there.
    pub covered: Led,
    /// Those of them at which the tracker refuses to start for want of a certificate.
    pub uncertified: usize,
    /// Others that a start by way reaches.
    pub by_way: Led,
    /// Others, if ways were asked for, at which the complete search proves a solution of the sign of the sheet within the
    /// lengths for which that was wanted.
    pub unreached: usize,
    /// And those where it could not decide.
    pub unreached_undecided: usize,
}

/// What a controller is led to at poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Led {
    /// Poses.
    pub poses: usize,
    /// Those where it is a solution that the complete search proves to exist.
    pub confirmed: usize,
    /// Those where it is not.
    pub wrong: usize,
    /// Those where the search could not decide.
    pub undecided: usize,
    /// Confirmed ones at which there are other solutions as well.
    pub with_others: usize,
    /// Confirmed ones within the lengths for which the sheet was wanted.
    pub within_lengths: usize,
}

impl Verification {
    /// Of all poses at which there is a solution of the sign of the sheet within its lengths, if ways were asked for, the
    /// share that the table covers, and that with those that are reached by way.
    #[must_use]
    pub fn shares(&self) -> [f64; 2] {
        let [covered, by_way] = [self.covered, self.by_way].map(|led| led.within_lengths);
        let all = covered + by_way + self.unreached;
        [covered, covered + by_way].map(|some| some as f64 / all.max(1) as f64)
    }

    /// Poses where the controller is led elsewhere than to a solution.
    #[must_use]
    pub fn wrong(&self) -> usize {
        self.covered.wrong + self.by_way.wrong
    }

    fn add(self, other: Self) -> Self {
        Self {
            poses: self.poses + other.poses,
            covered: self.covered.add(other.covered),
            uncertified: self.uncertified + other.uncertified,
            by_way: self.by_way.add(other.by_way),
            unreached: self.unreached + other.unreached,
            unreached_undecided: self.unreached_undecided + other.unreached_undecided,
        }
    }
}

impl Led {
    fn add(self, other: Self) -> Self {
        Self {
            poses: self.poses + other.poses,
            confirmed: self.confirmed + other.confirmed,
            wrong: self.wrong + other.wrong,
            undecided: self.undecided + other.undecided,
            with_others: self.with_others + other.with_others,
            within_lengths: self.within_lengths + other.within_lengths,
        }
    }
}

/// A table with its robot, and parts of a way at most.
struct Check<'a> {
    table: &'a Table<'a>,
    robot: Robot<f64, Model>,
    load: Load<f64>,
    way_parts: u16,
    /// The sign of the sheet.
    is_positive: bool,
}

/// Checks what a table leads a controller of some precision to at `poses` random poses of its region, where it covers none
/// on a way of so many parts at most (0: not at all).
///
/// # Errors
/// [`TableFault::Malformed`] when its robot is none, or it has no seed.
pub fn verify(
    table: &Table<'_>,
    poses: usize,
    seed: u64,
    precision: Precision,
    way_parts: u16,
) -> Result<Verification, TableFault> {
    let machine = machine(&std::array::from_fn(|i| table.cable(i)), &table.load());
    let (robot, load) = machine.map_err(|_| TableFault::Malformed)?;
    let Start { is_positive, .. } = table.seed(0).ok_or(TableFault::Malformed)?;
    let check = Check { table, robot, load, way_parts, is_positive };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (low, extent) = (table.low(), table.extent());
    let places: Vec<Point> = (0..poses)
        .map(|_| {
            std::array::from_fn(|k| {
                f64::from(low[k]) + random.random::<f64>() * f64::from(extent[k])
            })
        })
        .collect();
    match precision {
        Precision::F32 => check.all::<f32>(&places),
        Precision::F64 => check.all::<f64>(&places),
    }
}

type States<T> = [CableState<T>; CABLES];

impl Check<'_> {
    fn all<T: Real + Into<f64> + Sync>(
        &self,
        places: &[Point],
    ) -> Result<Verification, TableFault> {
        let controller = rounded::<T>(&self.robot, &self.load);
        let controller = controller.map_err(|_| TableFault::Malformed)?;
        let all = places.par_iter().map(|at| self.at(&controller, at));
        Ok(all.reduce(Verification::default, Verification::add))
    }

    /// At a pose, with robot and load as a controller has them.
    fn at<T: Real + Into<f64>>(
        &self,
        controller: &(Robot<T, IrvineCatenary<T>>, Load<T>),
        at: &Point,
    ) -> Verification {
        let none = Verification { poses: 1, ..Verification::default() };
        let Ok(exact) = pose(at) else { return none };
        let Ok(pose) = pose(at) else { return none };
        let set_point = SetPoint { pose, twist: Twist::none() };
        let (robot, load) = controller;
        let start = |way_parts: u16| {
            Tracker::start_from(
                *robot,
                *load,
                TrackerSettings::unlimited(T::one()),
                &set_point,
                self.table,
                way_parts,
            )
        };
        match self.table.states(robot, load, &pose) {
            Ok(states) => {
                let uncertified = usize::from(start(0).is_err());
                Verification { covered: self.led(&exact, &wide(states)), uncertified, ..none }
            }
            Err(TableFault::OutsideRegion | TableFault::Uncovered(_)) if self.way_parts > 0 => {
                if let Ok(tracker) = start(self.way_parts) {
                    let states = wide(tracker.command().states());
                    return Verification { by_way: self.led(&exact, &states), ..none };
                }
                match self.has_solution(at, &exact) {
                    Some(is_there) => Verification { unreached: usize::from(is_there), ..none },
                    None => Verification { unreached_undecided: 1, ..none },
                }
            }
            Err(TableFault::OutsideRegion | TableFault::Uncovered(_)) => none,
            // A seed that leads nowhere.
            Err(_) => {
                let covered = Led { poses: 1, wrong: 1, ..Led::default() };
                Verification { covered, ..none }
            }
        }
    }

    /// Whether the search proves states that were found at a pose.
    fn led(&self, exact: &Pose<f64>, found: &States<f64>) -> Led {
        let mut led = Led { poses: 1, ..Led::default() };
        let (sum_n, wanted_m) = (sum_n(found), self.table.limits_m());
        let limits = std::array::from_fn(|i| CableLimits {
            max_length_m: ROOM * found[i].rest_length_m.max(f64::from(wanted_m[i])),
            max_tension_n: TENSION_ROOM * sum_n,
        });
        let Some(answer) = self.search(exact, limits) else {
            led.undecided = 1;
            return led;
        };
        // As close as the table says, and as f32 knows the pose. Next to a fold there is one of the other sign as well.
        let near = |states: &States<f64>| {
            let off_n = |i: usize| (states[i].force_n - found[i].force_n).lp_norm(1);
            (0..CABLES).all(|i| off_n(i) <= 2.0 * TOLERANCE * sum_n)
        };
        let is_led_to = |proof: &&Proof| near(&proof.states()) && self.is_of_sheet(exact, proof);
        let matching = answer.solutions.iter().filter(is_led_to).count();
        match (matching, answer.undecided.is_empty()) {
            (1, _) => {
                led.confirmed = 1;
                led.with_others = usize::from(answer.solutions.len() > 1);
                let mut lengths_m = found.iter().map(|state| state.rest_length_m).zip(wanted_m);
                let is_within = lengths_m.all(|(length_m, most_m)| length_m <= f64::from(most_m));
                led.within_lengths = usize::from(is_within);
            }
            (_, true) => led.wrong = 1,
            (_, false) => led.undecided = 1,
        }
        led
    }

    /// Whether the search proves a solution of the sign of the sheet within its lengths; tensions are limited by those at
    /// the nearest pose that is covered. `None` when it cannot decide.
    fn has_solution(&self, at: &Point, exact: &Pose<f64>) -> Option<bool> {
        let near = pose(&self.table.nearest(at, self.robot.moment_arm_m())?).ok()?;
        let states = self.table.states(&self.robot, &self.load, &near).ok()?;
        let max_tension_n = TENSION_ROOM * sum_n(&states);
        let limits = self
            .table
            .limits_m()
            .map(|length_m| CableLimits { max_length_m: f64::from(length_m), max_tension_n });
        let answer = self.search(exact, limits)?;
        let is_there = answer.solutions.iter().any(|proof| self.is_of_sheet(exact, proof));
        (is_there || answer.undecided.is_empty()).then_some(is_there)
    }

    /// Whether a solution has the sign of the sheet.
    fn is_of_sheet(&self, exact: &Pose<f64>, proof: &Proof) -> bool {
        let states = proof.states();
        let charts = std::array::from_fn(|i| self.robot.cables()[i].model.chart(&states[i]));
        let balance = Balance::at(&self.robot, &self.load, exact).ok();
        let step = balance.and_then(|b| ChartStep::new(&self.robot, &b, &charts).ok());
        step.is_some_and(|step| step.elimination().is_positive() == self.is_positive)
    }

    fn search(&self, exact: &Pose<f64>, limits: [CableLimits; CABLES]) -> Option<Complete> {
        complete(&Problem::new(self.robot, &self.load, exact, limits).ok()?).ok()
    }
}

/// The sum of all forces on the cables, N.
fn sum_n(states: &States<f64>) -> f64 {
    states.iter().map(|state| state.force_n.lp_norm(1)).sum()
}

fn wide<T: Real + Into<f64>>(states: States<T>) -> States<f64> {
    states.map(|state| CableState {
        force_n: state.force_n.map(Into::into),
        rest_length_m: state.rest_length_m.into(),
    })
}
