//! All solutions with non-deformable cables: a linear complementarity problem.
//!
//! In the limit of vanishing mass and stretch the force curve of a cable becomes two rays, a tension
//! along the chord or a vertical pull of the slack cable. For each set of slack cables the
//! equilibrium is linear; it is a solution when every force is positive (the paper, section 3.2,
//! with the slack cables as unknowns so that each system is square).

use std::fmt;

use cdpr_core::elimination::Elimination;
use cdpr_core::statics::Balance;
use cdpr_core::{CABLES, CableState};
use nalgebra::{Matrix6, Vector2, Vector6};
use serde::{Serialize, Serializer};

/// A set of slack cables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SlackSet(u8);

impl SlackSet {
    /// The set of the cables with these numbers, counted from 1 as in the paper.
    #[must_use]
    pub fn of(numbers: &[usize]) -> Self {
        Self(
            numbers
                .iter()
                .filter(|n| (1..=CABLES).contains(n))
                .fold(0, |bits, n| bits | 1 << (n - 1)),
        )
    }

    /// The 63 sets in which not all cables are slack, those with fewer slack cables first.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..CABLES).flat_map(|size| {
            let full = 1_u8 << CABLES;
            (0..full).map(Self).filter(move |set| set.len() == size)
        })
    }

    /// Whether the cable with this index, counted from 0, is slack.
    #[must_use]
    pub fn contains(self, index: usize) -> bool {
        self.0 >> index & 1 == 1
    }

    /// Number of slack cables.
    #[must_use]
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether no cable is slack.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Numbers of the slack cables, counted from 1.
    pub fn numbers(self) -> impl Iterator<Item = usize> {
        (0..CABLES).filter(move |&i| self.contains(i)).map(|i| i + 1)
    }
}

impl fmt::Display for SlackSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.write_str("none");
        }
        let numbers: Vec<_> = self.numbers().map(|n| n.to_string()).collect();
        write!(f, "[{}]", numbers.join(","))
    }
}

impl Serialize for SlackSet {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.numbers())
    }
}

/// A solution with non-deformable cables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidSolution {
    /// Which cables are slack.
    pub slack: SlackSet,
    /// Tension of each taut cable, downward pull of each slack one, N; all positive.
    pub forces_n: [f64; CABLES],
    /// Whether its contribution to the degree is +1 (else -1).
    pub is_positive: bool,
}

impl RigidSolution {
    /// Force on cable `index` at its attachment, N: along the chord, or upwards when it is slack.
    #[must_use]
    pub fn force_n(&self, balance: &Balance<f64>, index: usize) -> Vector2<f64> {
        direction(balance, self.slack, index) * self.forces_n[index]
    }

    /// Forces and rest lengths when slack cables weigh `weights_n_m` and do nothing else: the
    /// simplified model of the paper's section 4. A slack cable hangs vertically on both sides of its
    /// lowest point, so `L = 2 tau / w - z` (the paper forgets `z`).
    #[must_use]
    pub fn states(
        &self,
        balance: &Balance<f64>,
        weights_n_m: &[f64; CABLES],
    ) -> [CableState<f64>; CABLES] {
        std::array::from_fn(|i| {
            let plane = &balance.planes()[i];
            let rest_length_m = if self.slack.contains(i) {
                2.0 * self.forces_n[i] / weights_n_m[i] - plane.z_m
            } else {
                plane.distance_m()
            };
            CableState { force_n: self.force_n(balance, i), rest_length_m }
        })
    }
}

/// All rigid solutions of a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidSolutions {
    /// The solutions, those with fewer slack cables first.
    pub solutions: Vec<RigidSolution>,
    /// Slack sets with a solution in which a force is zero to rounding: the pose lies on the border
    /// between two sets, and whether there is a solution is not decided.
    pub undecided: Vec<SlackSet>,
}

/// A force below this part of the largest one is zero to rounding, or below 16 rounding units times
/// the condition of the linear system where that is more.
const ZERO_FORCE: f64 = 1e-11;

/// A system with a larger condition is singular: its forces would exceed the load by as much.
const SINGULAR_CONDITION: f64 = 1e10;

impl RigidSolutions {
    /// Solves the equilibrium for each of the 63 slack sets.
    ///
    /// A set whose wrenches are linearly dependent (always so for four or more slack cables, which
    /// all pull vertically) has no solution, or for special poses a continuum whose ends belong to
    /// smaller sets; it is passed over.
    #[must_use]
    pub fn of(balance: &Balance<f64>) -> Self {
        let mut solutions = Vec::new();
        let mut undecided = Vec::new();
        for slack in SlackSet::all() {
            let columns: [Vector6<f64>; CABLES] = std::array::from_fn(|i| {
                balance.planes()[i].wrench_n(&direction(balance, slack, i))
            });
            let matrix = Matrix6::from_columns(&columns);
            let Some(elimination) = Elimination::new(&matrix) else { continue };
            let forces = elimination.solve(&-balance.wrench_n());
            if forces.min() < -1e-5 * forces.amax() {
                continue; // without a doubt, and without the cost of a condition
            }
            let condition = elimination.condition();
            let zero = forces.amax() * ZERO_FORCE.max(16.0 * f64::EPSILON * condition);
            if forces.min() < -zero || condition > SINGULAR_CONDITION {
                continue;
            }
            if forces.min() > zero {
                // A taut force falls with the length: d(G F)/dL = -(G column) for each of them.
                let is_positive = elimination.is_positive() == slack.len().is_multiple_of(2);
                solutions.push(RigidSolution { slack, forces_n: forces.into(), is_positive });
            } else {
                undecided.push(slack);
            }
        }
        Self { solutions, undecided }
    }

    /// Sum of the signs: the degree of the pose, the same for all cable parameters and models.
    #[must_use]
    pub fn degree(&self) -> i32 {
        self.solutions.iter().map(|s| if s.is_positive { 1 } else { -1 }).sum()
    }
}

/// Unit force on the cable at the attachment: along the chord, or upwards when slack.
fn direction(balance: &Balance<f64>, slack: SlackSet, index: usize) -> Vector2<f64> {
    if slack.contains(index) {
        Vector2::y()
    } else {
        let plane = &balance.planes()[index];
        Vector2::new(plane.x_m, plane.z_m) / plane.distance_m()
    }
}
