//! The paper's direct and inverse schemes: from non-deformable cables to deformable ones, and back.
//!
//! The deformation `s` in `(0, 1]` scales mass and stretch of every cable together:
//! `mu(s) = s mu`, `1/EA(s) = s/EA`. Each rigid solution starts a path at a small `s` and is followed
//! in `ln s`, because the rest length of a slack cable falls like `1/s`. Every step is taken with a
//! proof in interval arithmetic: over the whole of it there is exactly one solution in a box around the
//! path, so that it cannot jump to another branch. Where the deformation turns around (two branches
//! meet) a force leads instead, through the fold and back down, to the partner.
//!
//! A step that cannot be proven however short (next to a singular cable, or with a change between full
//! and simplified model) is taken on a sampled test and counted in [`Branch::unproved_steps`]. The
//! proofs begin at the start of a path: which rigid solution it comes from is told by being close.

mod certificate;
mod homotopy;
mod path;
mod step;
mod system;

use std::fmt;

use cdpr_core::{CABLES, CableModel, CableState, NewtonStep};

use crate::complete::Provable;
use crate::problem::Problem;
use crate::rigid::{RigidSolution, SlackSet};
use crate::robot_file::CableLimits;
use homotopy::Deformation;
use path::restore_full_model;

pub(crate) use homotopy::Homotopy;
pub(crate) use path::{End, Path, Waypoint, follow, locate_crossing};
pub(crate) use step::{Accuracy, converge};
pub(crate) use system::{Point, SIGMA, System};

/// Sag and stretch of the least loaded cable, relative to its length, where paths start: small
/// enough for the rigid solution to be a start for Newton.
const START_DEFLECTION: f64 = 1e-2;
/// How often the start is moved closer to the rigid solution, by this factor each time.
const START_ATTEMPTS: usize = 8;
const START_SHRINK: f64 = 0.1;
/// How closely, relative to each force, a path must come back to a rigid solution to be identified
/// with it. Two rigid solutions differ in the set of slack cables, so by far more.
const IDENTIFIED: f64 = 0.1;
/// Two solutions are the same when no length and no force differs by more than this part.
const SAME: f64 = 1e-8;
/// Steps are this many times shorter when paths are followed once more.
const CAREFUL: f64 = 8.0;

/// What a limit is set to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Rest length.
    Length,
    /// Tension at either end.
    Tension,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Length => "length",
            Self::Tension => "tension",
        })
    }
}

/// A solution of the inverse kinematics.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Forces and rest lengths.
    pub states: [CableState<f64>; CABLES],
    /// Tension at the anchor, N.
    pub anchor_tensions_n: [f64; CABLES],
    /// Sign of the determinant of the six unit tangents, towards longer cables: true for +1.
    pub is_positive: bool,
    /// Condition number (1-norm) of the same matrix.
    pub condition: f64,
    /// Cables that hang exactly vertically on both sides of their lowest point, solved with the
    /// simplified model.
    pub vertical: [bool; CABLES],
}

impl Solution {
    /// The solution with these forces and lengths; `None` where it is singular.
    #[must_use]
    pub fn at<M: CableModel<f64>>(
        problem: &Problem<M>,
        states: [CableState<f64>; CABLES],
    ) -> Option<Self> {
        let step = NewtonStep::new(&problem.robot, &problem.balance, &states).ok()?;
        Some(Self {
            states,
            anchor_tensions_n: std::array::from_fn(|i| {
                states[i].tension_at_anchor_n(problem.model(i).weight_n_m())
            }),
            is_positive: step.is_positive(),
            condition: step.condition(),
            vertical: [false; CABLES],
        })
    }

    /// Largest tension of a cable (counted from 0), which is at one of its ends, N.
    #[must_use]
    pub fn tension_n(&self, cable: usize) -> f64 {
        self.states[cable].tension_at_attachment_n().max(self.anchor_tensions_n[cable])
    }
}

/// How a branch ended.
#[derive(Clone, Debug, PartialEq)]
pub enum BranchEnd {
    /// It arrived at full deformation, within all limits.
    Solution(Solution),
    /// It arrived, but this cable is beyond its limit.
    BeyondLimit {
        /// The solution without regard to limits.
        solution: Solution,
        /// The cable, counted from 0.
        cable: usize,
        /// What is too large.
        quantity: Quantity,
    },
    /// It met another branch in a fold, and both end there.
    MetBranch(SlackSet),
    /// It turned back in a fold and came down to no known rigid solution.
    CameBackElsewhere,
    /// A tension ran off to infinity before full deformation.
    RanAway {
        /// The cable, counted from 0.
        cable: usize,
        /// Where it was given up.
        deformation: f64,
    },
    /// The cable, counted from 0, is slack but the model gives it no weight: it exerts no force.
    Weightless {
        /// The cable, counted from 0.
        cable: usize,
    },
    /// No deformation, however small, has a solution next to the rigid one that the test accepts.
    SingularStart,
    /// It met a singular point that is no fold.
    Stalled {
        /// Where.
        deformation: f64,
    },
    /// Two branches arrived at one solution, even with short steps, or this one with the wrong sign of
    /// the determinant for its origin and its folds: a step has jumped, which none with a proof can.
    Doubtful,
}

/// Where two branches meet and end: the deformation turns around.
#[derive(Clone, Debug, PartialEq)]
pub struct Fold {
    /// Deformation `s` at the fold.
    pub deformation: f64,
    /// Forces and rest lengths there.
    pub states: [CableState<f64>; CABLES],
}

impl From<&Point> for Fold {
    fn from(point: &Point) -> Self {
        Self { deformation: point.sigma.exp(), states: point.states }
    }
}

/// What became of one rigid solution.
#[derive(Clone, Debug)]
pub struct Branch {
    /// The rigid solution.
    pub origin: SlackSet,
    /// How it ended.
    pub end: BranchEnd,
    /// Folds on the way.
    pub folds: Vec<Fold>,
    /// Accepted steps.
    pub steps: usize,
    /// Steps, and changes between the full and the simplified model, that were taken without a proof.
    pub unproved_steps: usize,
    /// Largest contraction of a proven step (below 1 there is exactly one solution).
    pub largest_contraction: f64,
}

impl Branch {
    /// A branch that ended where it began.
    pub(crate) fn without_steps(origin: SlackSet, end: BranchEnd) -> Self {
        Self {
            origin,
            end,
            folds: Vec::new(),
            steps: 0,
            unproved_steps: 0,
            largest_contraction: 0.0,
        }
    }

    /// Whether every step is proven: the path followed one branch from its start to its end.
    #[must_use]
    pub fn is_certified(&self) -> bool {
        self.unproved_steps == 0
    }
}

impl fmt::Display for Branch {
    /// One sentence that says how the branch ended.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.end {
            BranchEnd::Solution(_) => write!(f, "arrives")?,
            BranchEnd::BeyondLimit { solution, cable, quantity } => {
                let value = match quantity {
                    Quantity::Length => format!("{:.3} m", solution.states[*cable].rest_length_m),
                    Quantity::Tension => format!("{:.3} N", solution.tension_n(*cable)),
                };
                write!(f, "arrives beyond a limit: {quantity} of cable {} is {value}", cable + 1)?;
            }
            BranchEnd::MetBranch(partner) => {
                write!(f, "ends in a fold with branch {partner}")?;
            }
            BranchEnd::CameBackElsewhere => {
                write!(f, "turns back in a fold, to no rigid solution")?;
            }
            BranchEnd::RanAway { cable, deformation } => {
                let number = cable + 1;
                write!(f, "tension of cable {number} grows without bound at s = {deformation:.6}")?;
            }
            BranchEnd::Weightless { cable } => {
                write!(f, "cable {} is slack, and without weight it exerts no force", cable + 1)?;
            }
            BranchEnd::SingularStart => {
                write!(f, "singular start: no solution beside the rigid one")?;
            }
            BranchEnd::Stalled { deformation } => {
                write!(f, "given up at s = {deformation:.6}, next to a singular point")?;
            }
            BranchEnd::Doubtful => {
                write!(f, "doubtful: it has left its branch, or another one did")?;
            }
        }
        for fold in &self.folds {
            write!(f, ", fold at s = {:.8}", fold.deformation)?;
        }
        if !self.is_certified() {
            write!(f, " ({} of {} steps without proof)", self.unproved_steps, self.steps)?;
        }
        Ok(())
    }
}

/// How sure each step of a path is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Steps {
    /// Proven: for every deformation on the way there is one solution in a box around the path.
    #[default]
    Certified,
    /// Tested by sampling, some fifty times faster: good, but no proof.
    Tested,
}

/// The direct scheme: follows every rigid solution to full deformation.
pub fn direct<M: Provable>(
    problem: &Problem<M>,
    rigid: &[RigidSolution],
    steps: Steps,
) -> Vec<Branch> {
    let deformation = Deformation { problem, steps };
    let mut branches: Vec<Branch> =
        rigid.iter().map(|origin| branch(&deformation, rigid, origin, 1.0)).collect();
    // Two branches at one solution: a step has jumped although its test was passed.
    for index in doubles(&branches) {
        branches[index] = branch(&deformation, rigid, &rigid[index], CAREFUL);
    }
    for index in doubles(&branches) {
        branches[index].end = BranchEnd::Doubtful;
    }
    branches
}

/// The inverse scheme: follows `solution` back to non-deformable cables and names the rigid
/// solution it comes from, or says that there is none.
pub fn inverse<M: Provable>(
    problem: &Problem<M>,
    rigid: &[RigidSolution],
    solution: &Solution,
    steps: Steps,
) -> Option<SlackSet> {
    origin(problem, rigid, solution.states, solution.vertical, steps)
}

/// The same for the forces and rest lengths of a solution and the cables that hang vertically in it.
pub(crate) fn origin<M: Provable>(
    problem: &Problem<M>,
    rigid: &[RigidSolution],
    states: [CableState<f64>; CABLES],
    vertical: [bool; CABLES],
    steps: Steps,
) -> Option<SlackSet> {
    let deformation = Deformation { problem, steps };
    let system = System { homotopy: &deformation, vertical };
    let start = Point { states, sigma: 0.0 };
    let smallest =
        rigid.iter().map(|r| start_deformation(problem, r)).fold(START_DEFLECTION, f64::min);
    let path = follow(system, start, (smallest.ln(), 0.0), false, 1.0);
    match down_to_rigid(&deformation, rigid, path, 1.0).end {
        End::Bottom(point) => identify(problem, rigid, &point),
        _ => None,
    }
}

/// Follows a path that has come to the lower end of the deformation further down, until it is close
/// enough to a rigid solution to tell which, or turns away.
fn down_to_rigid<M: Provable>(
    deformation: &Deformation<'_, M>,
    rigid: &[RigidSolution],
    mut path: Path,
    caution: f64,
) -> Path {
    for _ in 0..START_ATTEMPTS {
        let End::Bottom(point) = &path.end else { break };
        if identify(deformation.problem, rigid, point).is_some() {
            break;
        }
        let range = (point.sigma + START_SHRINK.ln(), 0.0);
        let system = System { homotopy: deformation, vertical: path.vertical };
        path = follow(system, point.clone(), range, false, caution).after(path);
    }
    path
}

/// Follows one rigid solution.
fn branch<M: Provable>(
    deformation: &Deformation<'_, M>,
    rigid: &[RigidSolution],
    origin: &RigidSolution,
    caution: f64,
) -> Branch {
    let problem = deformation.problem;
    let ended = |end| Branch::without_steps(origin.slack, end);
    let weightless = |&i: &usize| origin.slack.contains(i) && problem.model(i).weight_n_m() <= 0.0;
    if let Some(cable) = (0..CABLES).find(weightless) {
        return ended(BranchEnd::Weightless { cable });
    }
    let Some((system, start)) = start(deformation, origin) else {
        return ended(BranchEnd::SingularStart);
    };
    let bottom = start.sigma;
    let path = follow(system, start, (bottom, 0.0), true, caution);
    let path = down_to_rigid(deformation, rigid, path, caution);
    let end = match &path.end {
        End::Top(point) => match arrival(deformation, point, &path) {
            // The determinant changes its sign in every fold and nowhere else.
            BranchEnd::Solution(solution) | BranchEnd::BeyondLimit { solution, .. }
                if (solution.is_positive == origin.is_positive)
                    != (path.folds().count() % 2 == 0) =>
            {
                BranchEnd::Doubtful
            }
            end => end,
        },
        End::Bottom(point) => identify(problem, rigid, point)
            .map_or(BranchEnd::CameBackElsewhere, BranchEnd::MetBranch),
        End::RanAway { cable, sigma } => {
            BranchEnd::RanAway { cable: *cable, deformation: sigma.exp() }
        }
        End::Stalled { sigma } => BranchEnd::Stalled { deformation: sigma.exp() },
    };
    Branch {
        origin: origin.slack,
        end,
        folds: path.folds().map(Fold::from).collect(),
        steps: path.steps,
        unproved_steps: path.unproved_steps,
        largest_contraction: path.largest_contraction,
    }
}

/// A deformation at which sag and stretch of every cable are small against its length.
fn start_deformation<M: CableModel<f64>>(problem: &Problem<M>, origin: &RigidSolution) -> f64 {
    let taut = (0..CABLES).filter(|&i| !origin.slack.contains(i));
    let bound = taut.map(|i| {
        let plane = &problem.balance.planes()[i];
        let distance_m = plane.distance_m();
        let model = problem.model(i);
        let state =
            CableState { force_n: origin.force_n(&problem.balance, i), rest_length_m: distance_m };
        // Sag angle w d / T, and stretch as the model itself has it.
        let sag = model.weight_n_m() * distance_m / origin.forces_n[i];
        let end = model.end_point(state.force_n, distance_m).position_m;
        let stretch = (end.norm() / distance_m - 1.0).abs();
        START_DEFLECTION / (START_DEFLECTION + sag + stretch)
    });
    bound.fold(START_DEFLECTION, f64::min)
}

/// A solution at a small deformation, from the rigid one by way of the simplified vertical model.
fn start<'a, M: Provable>(
    deformation: &'a Deformation<'a, M>,
    origin: &RigidSolution,
) -> Option<(System<'a, Deformation<'a, M>>, Point)> {
    let problem = deformation.problem;
    let mut s = start_deformation(problem, origin);
    for _ in 0..START_ATTEMPTS {
        let weights = std::array::from_fn(|i| problem.model(i).at_deformation(s).weight_n_m());
        let vertical = std::array::from_fn(|i| origin.slack.contains(i));
        let mut system = System { homotopy: deformation, vertical };
        let rigid = Point { states: origin.states(&problem.balance, &weights), sigma: s.ln() };
        if let Some(mut point) = converge(&system, &rigid, SIGMA, Accuracy::Full)
            && departure(problem, origin, &point) < IDENTIFIED
        {
            restore_full_model(&mut system, &mut point);
            let full =
                (0..CABLES).all(|i| !system.vertical[i] || problem.balance.planes()[i].x_m <= 0.0);
            if full && departure(problem, origin, &point) < IDENTIFIED {
                return Some((system, point));
            }
        }
        s *= START_SHRINK;
    }
    None
}

/// Largest change of a force or rest length from the rigid solution, relative to it.
fn departure<M: CableModel<f64>>(
    problem: &Problem<M>,
    origin: &RigidSolution,
    point: &Point,
) -> f64 {
    let s = point.sigma.exp();
    let weights = std::array::from_fn(|i| problem.model(i).at_deformation(s).weight_n_m());
    let rigid = origin.states(&problem.balance, &weights);
    let change = |i: usize| {
        let force = (point.states[i].force_n - rigid[i].force_n).norm() / origin.forces_n[i];
        force.max((point.states[i].rest_length_m / rigid[i].rest_length_m - 1.0).abs())
    };
    (0..CABLES).map(change).fold(0.0, f64::max)
}

fn identify<M: CableModel<f64>>(
    problem: &Problem<M>,
    rigid: &[RigidSolution],
    point: &Point,
) -> Option<SlackSet> {
    rigid.iter().find(|r| departure(problem, r, point) < IDENTIFIED).map(|r| r.slack)
}

/// A path that reached full deformation: the solution, held against the limits.
fn arrival<M: Provable>(deformation: &Deformation<'_, M>, point: &Point, path: &Path) -> BranchEnd {
    let problem = deformation.problem;
    let system = System { homotopy: deformation, vertical: path.vertical };
    let Some(elimination) = system.eliminate_tangents(point) else {
        return BranchEnd::Stalled { deformation: 1.0 };
    };
    let solution = Solution {
        states: point.states,
        anchor_tensions_n: std::array::from_fn(|i| {
            point.states[i].tension_at_anchor_n(problem.model(i).weight_n_m())
        }),
        is_positive: elimination.is_positive(),
        condition: elimination.condition(),
        vertical: path.vertical,
    };
    held_against_limits(&problem.limits, solution)
}

/// `solution`, or the first cable that is beyond its limit.
pub(crate) fn held_against_limits(limits: &[CableLimits; CABLES], solution: Solution) -> BranchEnd {
    for (cable, limits) in limits.iter().enumerate() {
        let quantity = if solution.states[cable].rest_length_m > limits.max_length_m {
            Quantity::Length
        } else if solution.tension_n(cable) > limits.max_tension_n {
            Quantity::Tension
        } else {
            continue;
        };
        return BranchEnd::BeyondLimit { solution, cable, quantity };
    }
    BranchEnd::Solution(solution)
}

/// Indices of branches that arrive where another one does.
fn doubles(branches: &[Branch]) -> Vec<usize> {
    let arrived = |branch: &Branch| match &branch.end {
        BranchEnd::Solution(solution) | BranchEnd::BeyondLimit { solution, .. } => {
            Some(solution.states)
        }
        _ => None,
    };
    let same = |i: usize, j: usize| {
        let (Some(a), Some(b)) = (arrived(&branches[i]), arrived(&branches[j])) else {
            return false;
        };
        same_states(&a, &b)
    };
    let indices = 0..branches.len();
    indices.clone().filter(|&i| indices.clone().any(|j| i != j && same(i, j))).collect()
}

/// Whether two solutions of a problem are the same.
pub(crate) fn same_states(a: &[CableState<f64>; CABLES], b: &[CableState<f64>; CABLES]) -> bool {
    a.iter().zip(b).all(|(a, b)| {
        (a.rest_length_m / b.rest_length_m - 1.0).abs() < SAME
            && (a.force_n - b.force_n).norm() < SAME * a.force_n.norm()
    })
}
