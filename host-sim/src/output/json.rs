//! The answer as JSON. Cables are in the order of the robot file, numbered from 1 in sets.

use cdpr_core::CABLES;
use serde::Serialize;

use crate::branches::Parameter;
use crate::complete::Kantorovich;
use crate::continuation::{Branch, BranchEnd};
use crate::enumerate::{Enumeration, FoundSolution, Method, ModelKind, Request, Retraced};
use crate::rigid::{RigidSolution, SlackSet};

/// The answer to `request` as one JSON document; lengths in m, forces (on the cable at B) in N.
#[must_use]
pub fn json(request: &Request, method: Method, answer: &Enumeration) -> impl Serialize + use<> {
    Document {
        question: Question::of(request, None),
        method,
        complete: answer.is_complete(),
        rigid: answer.rigid.solutions.iter().map(Rigid::from).collect(),
        rigid_undecided: answer.rigid.undecided.clone(),
        degree: Degree {
            rigid: answer.rigid.degree(),
            deformable: answer.degree(),
            continuation: (method != Method::Complete).then(|| answer.continuation_degree()),
        },
        solutions: answer.solutions.iter().map(Solution::from).collect(),
        branches: answer.branches.iter().map(BranchReport::from).collect(),
        undecided: answer
            .search
            .iter()
            .flat_map(|search| &search.undecided)
            .map(|place| Undecided {
                lengths_m: place.states.map(|s| [s.rest_length_m.low(), s.rest_length_m.high()]),
            })
            .collect(),
        search: answer.search.as_ref().map(|search| Search {
            refusal: search.refusal.clone(),
            boxes: search.boxes,
            pieces: search.pieces,
        }),
        differences: answer.differences.iter().map(ToString::to_string).collect(),
    }
}

#[derive(Serialize)]
struct Document {
    #[serde(flatten)]
    question: Question,
    method: Method,
    /// Whether the solutions are proven to be all within the limits.
    complete: bool,
    rigid: Vec<Rigid>,
    /// Slack sets on the border between solution and none.
    rigid_undecided: Vec<SlackSet>,
    degree: Degree,
    solutions: Vec<Solution>,
    branches: Vec<BranchReport>,
    /// Where it could not be decided whether there is a solution.
    undecided: Vec<Undecided>,
    search: Option<Search>,
    /// Where the two methods differ, and why.
    differences: Vec<String>,
}

#[derive(Serialize)]
struct Undecided {
    /// Lower and upper bound of each rest length.
    lengths_m: [[f64; 2]; CABLES],
}

#[derive(Serialize)]
struct Search {
    /// Why there was none.
    refusal: Option<String>,
    boxes: usize,
    pieces: usize,
}

/// What was asked; what varies is null.
#[derive(Serialize)]
pub(super) struct Question {
    robot: String,
    model: ModelKind,
    position_m: [f64; 3],
    rotation_vector_rad: [f64; 3],
    mass_kg: Option<f64>,
    gravity_m_s2: f64,
    /// Numbers that are infinite (no limit) become null.
    cables: [Cable; CABLES],
}

impl Question {
    pub(super) fn of(request: &Request, varied: Option<Parameter>) -> Self {
        let Request { robot, position_m, rotation_vector_rad, model } = request;
        let fixed = |parameter, value| (varied != Some(parameter)).then_some(value);
        let cable = |i: usize| {
            let (material, limits) = (&robot.robot.cables()[i].model, &robot.limits[i]);
            Cable {
                linear_density_kg_m: fixed(Parameter::LinearDensity, material.linear_density_kg_m),
                axial_stiffness_n: fixed(Parameter::AxialStiffness, material.axial_stiffness_n),
                max_length_m: limits.max_length_m,
                max_tension_n: limits.max_tension_n,
            }
        };
        Self {
            robot: robot.name.clone(),
            model: *model,
            position_m: *position_m,
            rotation_vector_rad: *rotation_vector_rad,
            mass_kg: fixed(Parameter::Mass, robot.load.mass_kg),
            gravity_m_s2: robot.load.gravity_m_s2,
            cables: std::array::from_fn(cable),
        }
    }
}

#[derive(Serialize)]
struct Cable {
    linear_density_kg_m: Option<f64>,
    axial_stiffness_n: Option<f64>,
    max_length_m: f64,
    max_tension_n: f64,
}

#[derive(Serialize)]
struct Rigid {
    slack: SlackSet,
    forces_n: [f64; CABLES],
    det_sign: i8,
}

impl From<&RigidSolution> for Rigid {
    fn from(solution: &RigidSolution) -> Self {
        Self {
            slack: solution.slack,
            forces_n: solution.forces_n,
            det_sign: sign(solution.is_positive),
        }
    }
}

#[derive(Serialize)]
struct Degree {
    rigid: i32,
    deformable: i32,
    /// Null when continuation was not asked for.
    continuation: Option<i32>,
}

#[derive(Serialize)]
struct Solution {
    lengths_m: [f64; CABLES],
    proved: bool,
    /// How far each true length can be from the one given; null when not proved.
    length_radii_m: Option<[f64; CABLES]>,
    kantorovich: Option<Kantorovich>,
    horizontal_forces_n: [f64; CABLES],
    vertical_forces_n: [f64; CABLES],
    anchor_tensions_n: [f64; CABLES],
    sags_m: [f64; CABLES],
    /// Null when no rigid solution leads to it, or continuation was not asked for.
    rigid_slack_set: Option<SlackSet>,
    det_sign: i8,
    condition: f64,
    /// Cables solved with the simplified vertical model.
    vertical_cables: Vec<usize>,
    /// With `--retrace`, and for solutions that continuation does not reach: where the inverse scheme
    /// leads, null when to no rigid solution.
    #[serde(skip_serializing_if = "Option::is_none")]
    retraced_slack_set: Option<Retraced>,
}

impl From<&FoundSolution> for Solution {
    fn from(found: &FoundSolution) -> Self {
        let solution = &found.solution;
        let states = &solution.states;
        Self {
            lengths_m: std::array::from_fn(|i| states[i].rest_length_m),
            proved: found.proof.is_some(),
            length_radii_m: found.proof.as_ref().map(|proof| proof.length_radii_m),
            kantorovich: found.proof.as_ref().and_then(|proof| proof.kantorovich),
            horizontal_forces_n: std::array::from_fn(|i| states[i].force_n.x),
            vertical_forces_n: std::array::from_fn(|i| states[i].force_n.y),
            anchor_tensions_n: solution.anchor_tensions_n,
            sags_m: found.sags_m,
            rigid_slack_set: found.origin,
            det_sign: sign(solution.is_positive),
            condition: solution.condition,
            vertical_cables: (0..CABLES).filter(|&i| solution.vertical[i]).map(|i| i + 1).collect(),
            retraced_slack_set: found.retraced,
        }
    }
}

#[derive(Serialize)]
struct BranchReport {
    rigid_slack_set: SlackSet,
    /// The name of the [`BranchEnd`], in snake case.
    end: &'static str,
    /// The partner, when two branches meet.
    #[serde(skip_serializing_if = "Option::is_none")]
    met: Option<SlackSet>,
    message: String,
    folds: Vec<FoldReport>,
    steps: usize,
    /// Whether every step is proven.
    certified: bool,
    unproved_steps: usize,
    largest_contraction: f64,
}

#[derive(Serialize)]
struct FoldReport {
    /// Mass and compliance of the cables there, relative to those asked for.
    deformation: f64,
    lengths_m: [f64; CABLES],
}

impl From<&Branch> for BranchReport {
    fn from(branch: &Branch) -> Self {
        let (end, met) = match &branch.end {
            BranchEnd::Solution(_) => ("solution", None),
            BranchEnd::BeyondLimit { .. } => ("beyond_limit", None),
            BranchEnd::MetBranch(partner) => ("met_branch", Some(*partner)),
            BranchEnd::CameBackElsewhere => ("came_back_elsewhere", None),
            BranchEnd::RanAway { .. } => ("ran_away", None),
            BranchEnd::Weightless { .. } => ("weightless", None),
            BranchEnd::SingularStart => ("singular_start", None),
            BranchEnd::Stalled { .. } => ("stalled", None),
            BranchEnd::Doubtful => ("doubtful", None),
        };
        Self {
            rigid_slack_set: branch.origin,
            end,
            met,
            message: branch.to_string(),
            folds: branch
                .folds
                .iter()
                .map(|fold| FoldReport {
                    deformation: fold.deformation,
                    lengths_m: std::array::from_fn(|i| fold.states[i].rest_length_m),
                })
                .collect(),
            steps: branch.steps,
            certified: branch.is_certified(),
            unproved_steps: branch.unproved_steps,
            largest_contraction: branch.largest_contraction,
        }
    }
}

pub(super) fn sign(is_positive: bool) -> i8 {
    if is_positive { 1 } else { -1 }
}
