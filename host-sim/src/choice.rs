//! One of the solutions of a pose: the best by a stated criterion, or by its number.

use std::fmt;

use cdpr_core::{CABLES, GeometryFault};

use crate::continuation::Solution;
use crate::enumerate::{FoundSolution, Method, Options, Request};

/// What makes one solution better than another.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Choice {
    /// The one whose longest cable is the shortest.
    Shortest,
    /// The one whose highest tension is the lowest.
    Tension,
    /// The one furthest from a fold or singularity: of the smallest condition number.
    Fold,
}

/// What the best is best at.
impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Shortest => "the longest cable is the shortest",
            Self::Tension => "the highest tension is the lowest",
            Self::Fold => "the furthest from a fold",
        })
    }
}

/// Why there is no such solution.
#[derive(Debug, thiserror::Error)]
pub enum ChoiceError {
    /// There is none at all.
    #[error("the pose has no solution within the limits")]
    NoSolution,
    /// Not so many.
    #[error("the pose has only {0} solutions within the limits")]
    NoSuchSolution(usize),
    /// They could not all be found.
    #[error("whether these are all solutions of the pose could not be decided; choose another")]
    Undecided,
    /// The pose.
    #[error(transparent)]
    Pose(#[from] GeometryFault),
}

impl Choice {
    /// What is to be small: longest rest length (m), highest tension (N), or condition.
    pub(crate) fn measure(self, solution: &Solution) -> f64 {
        match self {
            Self::Shortest => solution.states.iter().map(|s| s.rest_length_m).fold(0.0, f64::max),
            Self::Tension => (0..CABLES).map(|i| solution.tension_n(i)).fold(0.0, f64::max),
            Self::Fold => solution.condition,
        }
    }

    /// The best of these; the first of equals.
    #[must_use]
    pub fn best(self, solutions: &[FoundSolution]) -> Option<&Solution> {
        let solutions = solutions.iter().map(|found| &found.solution);
        solutions.min_by(|a, b| self.measure(a).total_cmp(&self.measure(b)))
    }
}

/// One of all solutions at the pose of `request`: the best by `choice`, or that with a number, counted from 1.
///
/// # Errors
/// [`ChoiceError`].
pub(crate) fn choose(
    request: &Request,
    choice: Choice,
    number: Option<usize>,
) -> Result<Solution, ChoiceError> {
    let options = Options { method: Method::Complete, ..Options::default() };
    let answer = request.enumerate(options)?;
    if !answer.is_complete() {
        return Err(ChoiceError::Undecided);
    }
    let solutions = &answer.solutions;
    match number {
        None => choice.best(solutions).cloned().ok_or(ChoiceError::NoSolution),
        Some(number) => number
            .checked_sub(1)
            .and_then(|index| solutions.get(index))
            .map(|found| found.solution.clone())
            .ok_or(ChoiceError::NoSuchSolution(solutions.len())),
    }
}
