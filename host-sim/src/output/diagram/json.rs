//! All branches as one JSON document. Branches, folds and cables are numbered from 1.

use cdpr_core::CABLES;
use serde::Serialize;

use crate::branches::{
    Border, BranchPoint, Diagram, Fold, LimitCrossing, Parameter, SolutionBranch, StartCheck,
};
use crate::enumerate::Request;
use crate::output::json::{Question, sign};
use crate::rigid::SlackSet;

/// The branches of `request` as one JSON document.
#[must_use]
pub fn json(request: &Request, diagram: &Diagram) -> impl Serialize + use<> {
    Document {
        question: Question::of(request, Some(diagram.parameter)),
        parameter: match diagram.parameter {
            Parameter::LinearDensity => "linear_density_kg_m",
            Parameter::AxialStiffness => "axial_stiffness_n",
            Parameter::Mass => "mass_kg",
        },
        from: diagram.range.from(),
        to: diagram.range.to(),
        branches: (1..).zip(&diagram.branches).map(|(n, branch)| Branch::of(n, branch)).collect(),
        folds: (1..).zip(&diagram.folds).map(|(n, fold)| FoldReport::of(n, fold)).collect(),
        rigid_degree: diagram.rigid_degree,
        start_values: diagram.checks.iter().map(Check::from).collect(),
        doubts: diagram.doubts.iter().map(ToString::to_string).collect(),
        is_consistent: diagram.is_consistent(),
    }
}

#[derive(Serialize)]
struct Document {
    #[serde(flatten)]
    question: Question,
    /// What varies, with the unit of every `value`, `from` and `to`.
    parameter: &'static str,
    from: f64,
    to: f64,
    branches: Vec<Branch>,
    folds: Vec<FoldReport>,
    rigid_degree: i32,
    start_values: Vec<Check>,
    doubts: Vec<String>,
    is_consistent: bool,
}

#[derive(Serialize)]
struct Branch {
    number: usize,
    rigid_slack_set: Option<SlackSet>,
    det_sign: i8,
    low: End,
    high: End,
    limit_crossings: Vec<Crossing>,
    points: Vec<Point>,
}

impl Branch {
    fn of(number: usize, branch: &SolutionBranch) -> Self {
        let end = |point: Option<&BranchPoint>, border| {
            let (at, fold, cable) = match border {
                Border::Range => ("range", None, None),
                Border::Fold(fold) => ("fold", Some(fold + 1), None),
                Border::RanAway(cable) => ("ran_away", None, Some(cable + 1)),
                Border::Stalled => ("stalled", None, None),
                Border::Doubtful => ("doubtful", None, None),
            };
            End { value: point.map(|point| point.value), at, fold, cable }
        };
        Self {
            number,
            rigid_slack_set: branch.origin,
            det_sign: sign(branch.is_positive),
            low: end(branch.points.first(), branch.low),
            high: end(branch.points.last(), branch.high),
            limit_crossings: branch.limit_crossings.iter().map(Crossing::from).collect(),
            points: branch.points.iter().map(Point::from).collect(),
        }
    }
}

#[derive(Serialize)]
struct End {
    value: Option<f64>,
    /// The name of the [`Border`], in snake case.
    at: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    fold: Option<usize>,
    /// The cable whose tension ran away.
    #[serde(skip_serializing_if = "Option::is_none")]
    cable: Option<usize>,
}

#[derive(Serialize)]
struct Crossing {
    value: f64,
    cable: usize,
    /// What reaches its limit: `length` or `tension`.
    quantity: String,
    /// On which side it is beyond the limit: `above` or `below` this value of the parameter.
    beyond: &'static str,
}

impl From<&LimitCrossing> for Crossing {
    fn from(crossing: &LimitCrossing) -> Self {
        Self {
            value: crossing.value,
            cable: crossing.cable + 1,
            quantity: crossing.quantity.to_string(),
            beyond: if crossing.is_beyond_above { "above" } else { "below" },
        }
    }
}

#[derive(Serialize)]
struct Point {
    value: f64,
    lengths_m: [f64; CABLES],
    anchor_tensions_n: [f64; CABLES],
    is_beyond_limit: bool,
}

impl From<&BranchPoint> for Point {
    fn from(point: &BranchPoint) -> Self {
        Self {
            value: point.value,
            lengths_m: point.states.map(|state| state.rest_length_m),
            anchor_tensions_n: point.anchor_tensions_n,
            is_beyond_limit: point.is_beyond_limit,
        }
    }
}

#[derive(Serialize)]
struct FoldReport {
    number: usize,
    value: f64,
    /// `birth` or `death` of the two branches, the parameter growing.
    kind: &'static str,
    branches: [usize; 2],
    lengths_m: [f64; CABLES],
}

impl FoldReport {
    fn of(number: usize, fold: &Fold) -> Self {
        Self {
            number,
            value: fold.value,
            kind: if fold.is_death { "death" } else { "birth" },
            branches: fold.branches.map(|index| index + 1),
            lengths_m: fold.states.map(|state| state.rest_length_m),
        }
    }
}

#[derive(Serialize)]
struct Check {
    value: f64,
    solutions: usize,
    branches: usize,
    degree: i32,
}

impl From<&StartCheck> for Check {
    fn from(check: &StartCheck) -> Self {
        let StartCheck { value, solutions, branches, degree } = *check;
        Self { value, solutions, branches, degree }
    }
}
