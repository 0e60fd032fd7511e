//! The answer for one pose: all rigid solutions and what becomes of each, and the complete search.

use std::cmp::Ordering;
use std::fmt;

use cdpr_core::elimination::Elimination;
use cdpr_core::{
    CABLES, Cable, CableModel, CableState, GeometryFault, IrvineCatenary, LinearElastic,
    NonDeformable, Parabola, Pose,
};
use nalgebra::{Matrix6, UnitQuaternion, Vector2, Vector3};

use crate::complete::{Kantorovich, Place, Provable, Refusal, complete, kantorovich};
use crate::continuation::{self, Branch, BranchEnd, Solution, Steps};
use crate::problem::{FromMaterial, Problem};
use crate::rigid::{RigidSolution, RigidSolutions, SlackSet};
use crate::robot_file::{CableMaterial, RobotDescription};

/// How far beside an exactly vertical cable the search looks, relative to the coordinates of the pose:
/// about their rounding.
const BESIDE: f64 = 1e-13;

/// Which cable model.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum ModelKind {
    /// Elastic catenary.
    Irvine,
    /// Massless, linear elastic.
    Elastic,
    /// Parabola with elastic stretch.
    Parabolic,
    /// Non-deformable; slack cables hang under their own weight.
    Rigid,
}

/// One question: a robot with its load, a pose, and a cable model.
#[derive(Clone, Debug)]
pub struct Request {
    /// The robot, all overrides applied.
    pub robot: RobotDescription,
    /// Position of the platform origin, world frame, m.
    pub position_m: [f64; 3],
    /// Orientation as rotation vector (axis times angle), rad.
    pub rotation_vector_rad: [f64; 3],
    /// Cable model.
    pub model: ModelKind,
}

/// How to search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// All solutions within the limits, with a proof that there are no others.
    Complete,
    /// From every solution with non-deformable cables (Merlet's direct scheme).
    Continuation,
    /// Both, held against each other.
    #[default]
    Both,
}

impl Method {
    fn continues(self) -> bool {
        self != Self::Complete
    }

    fn searches(self) -> bool {
        self != Self::Continuation
    }
}

/// A solution with what people want to see of it.
#[derive(Clone, Debug)]
pub struct FoundSolution {
    /// The solution.
    pub solution: Solution,
    /// The rigid solution from which the direct scheme reaches it, if it does.
    pub origin: Option<SlackSet>,
    /// Largest height of the chord above the cable, m; of its upper end for a vertical cable.
    pub sags_m: [f64; CABLES],
    /// Where the inverse scheme leads, if it was asked for or the direct scheme does not reach it.
    pub retraced: Option<Retraced>,
    /// Present when it is proven to exist.
    pub proof: Option<ProofReport>,
}

/// A proof in numbers.
#[derive(Clone, Debug)]
pub struct ProofReport {
    /// How far each true rest length can be from the one given, m.
    pub length_radii_m: [f64; CABLES],
    /// The Kantorovich numbers, if they were asked for and could be bounded.
    pub kantorovich: Option<Kantorovich>,
}

/// Where the inverse scheme leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(untagged)]
pub enum Retraced {
    /// To this rigid solution.
    Rigid(SlackSet),
    /// To none.
    Nowhere,
}

/// What the complete search has to say.
#[derive(Clone, Debug)]
pub struct SearchReport {
    /// Why there was no search.
    pub refusal: Option<String>,
    /// Where it could not be decided whether there is a solution.
    pub undecided: Vec<Place>,
    /// Boxes examined.
    pub boxes: usize,
    /// Pieces of force curve enclosed.
    pub pieces: usize,
}

impl SearchReport {
    /// No search, and why.
    fn refused(reason: impl fmt::Display) -> Self {
        Self { refusal: Some(reason.to_string()), undecided: Vec::new(), boxes: 0, pieces: 0 }
    }

    /// Whether all solutions within the limits are known.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.refusal.is_none() && self.undecided.is_empty()
    }
}

/// A difference between the complete search and continuation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Difference {
    /// The solution with this number, counted from 1, is reached from no rigid one: the inverse scheme
    /// ends elsewhere.
    NoRigidOrigin {
        /// Which solution.
        number: usize,
    },
    /// The inverse scheme leads from this solution to a rigid one whose own branch ends elsewhere.
    OnlyInverse {
        /// Which solution, counted from 1.
        number: usize,
        /// The rigid solution.
        origin: SlackSet,
    },
    /// The branch arrives where the search has proven that there is no solution, or has not decided.
    Unconfirmed {
        /// The branch.
        origin: SlackSet,
        /// Whether the search has decided.
        contradicted: bool,
    },
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoRigidOrigin { number } => {
                write!(f, "solution {number} has no rigid origin: continuation does not reach it")
            }
            Self::OnlyInverse { number, origin } => write!(
                f,
                "solution {number} leads back to rigid slack set {origin}, whose branch does not \
                 arrive there"
            ),
            Self::Unconfirmed { origin, contradicted: true } => {
                write!(f, "branch {origin} arrives where there is provably no solution")
            }
            Self::Unconfirmed { origin, contradicted: false } => {
                write!(f, "the solution of branch {origin} could not be proven")
            }
        }
    }
}

/// Everything found for one pose.
#[derive(Clone, Debug)]
pub struct Enumeration {
    /// Rigid solutions.
    pub rigid: RigidSolutions,
    /// Deformable solutions within the limits: those with a rigid origin in its order, then others.
    pub solutions: Vec<FoundSolution>,
    /// What became of each rigid solution; empty without continuation.
    pub branches: Vec<Branch>,
    /// The complete search, if there was one.
    pub search: Option<SearchReport>,
    /// Where the two methods differ.
    pub differences: Vec<Difference>,
}

impl Enumeration {
    /// Sum of the signs of the solutions. Equal to the degree of the rigid ones unless solutions lie
    /// beyond the limits or are missing.
    #[must_use]
    pub fn degree(&self) -> i32 {
        self.solutions.iter().map(|found| sign(found.solution.is_positive)).sum()
    }

    /// The same over the branches that arrive within the limits.
    #[must_use]
    pub fn continuation_degree(&self) -> i32 {
        let arrived = self.branches.iter().map(|branch| match &branch.end {
            BranchEnd::Solution(solution) => sign(solution.is_positive),
            _ => 0,
        });
        arrived.sum()
    }

    /// Whether the solutions are proven to be all within the limits.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        let contradicted =
            |d: &Difference| matches!(d, Difference::Unconfirmed { contradicted: true, .. });
        self.search.as_ref().is_some_and(SearchReport::is_complete)
            && !self.differences.iter().any(contradicted)
    }
}

fn sign(is_positive: bool) -> i32 {
    if is_positive { 1 } else { -1 }
}

/// How a pose is enumerated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// How to search.
    pub method: Method,
    /// How sure each step of continuation is.
    pub steps: Steps,
    /// Follow every solution back by the inverse scheme.
    pub retrace: bool,
    /// Find the Kantorovich numbers of every proven solution, which takes about as long as the search.
    pub kantorovich: bool,
}

impl Request {
    /// Checks that the pose can be asked for.
    ///
    /// # Errors
    /// [`GeometryFault`] when the pose is not finite or puts an attachment on its anchor.
    pub fn check(&self) -> Result<(), GeometryFault> {
        self.problem::<NonDeformable>().map(|_| ())
    }

    /// Finds the solutions of a pose.
    ///
    /// # Errors
    /// As [`Request::check`].
    pub fn enumerate(&self, options: Options) -> Result<Enumeration, GeometryFault> {
        match self.model {
            ModelKind::Irvine => self.deformable::<IrvineCatenary<f64>>(options),
            ModelKind::Parabolic => self.deformable::<Parabola<f64>>(options),
            ModelKind::Elastic => self.deformable::<LinearElastic<f64>>(options),
            ModelKind::Rigid => self.rigid(options.method),
        }
    }

    /// Whether slack cables pull on the platform: as many solutions as with rigid cables, counted by their
    /// signs, is a theorem only then.
    pub(crate) fn has_weight(&self) -> bool {
        let gravity = self.robot.load.gravity_m_s2 > 0.0;
        let heavy = |cable: &Cable<f64, CableMaterial>| cable.model.linear_density_kg_m > 0.0;
        self.model != ModelKind::Elastic && gravity && self.robot.robot.cables().iter().all(heavy)
    }

    /// The problem of this request for a model made from the robot's materials.
    ///
    /// # Errors
    /// As [`Request::check`].
    pub fn problem<M: FromMaterial>(&self) -> Result<Problem<M>, GeometryFault> {
        let RobotDescription { limits, load, .. } = &self.robot;
        Problem::new(self.robot.with_model(), load, &self.pose()?, *limits)
    }

    /// The pose of the platform.
    ///
    /// # Errors
    /// [`GeometryFault::InvalidPose`] when it is not finite.
    pub fn pose(&self) -> Result<Pose<f64>, GeometryFault> {
        let orientation = UnitQuaternion::from_scaled_axis(Vector3::from(self.rotation_vector_rad));
        Pose::new(Vector3::from(self.position_m), orientation)
    }

    fn deformable<M: FromMaterial + Provable>(
        &self,
        options: Options,
    ) -> Result<Enumeration, GeometryFault> {
        let problem = self.problem::<M>()?;
        let rigid = RigidSolutions::of(&problem.balance);
        let mut answer = Enumeration {
            branches: Vec::new(),
            rigid,
            solutions: Vec::new(),
            search: None,
            differences: Vec::new(),
        };
        if options.method.continues() {
            answer.branches =
                continuation::direct(&problem, &answer.rigid.solutions, options.steps);
            for branch in &answer.branches {
                if let BranchEnd::Solution(solution) = &branch.end {
                    answer.solutions.push(FoundSolution {
                        sags_m: std::array::from_fn(|i| sag_m(&problem, solution, i)),
                        solution: solution.clone(),
                        origin: Some(branch.origin),
                        retraced: None,
                        proof: None,
                    });
                }
            }
        }
        if options.method.searches() {
            self.search(&problem, &mut answer, options)?;
        }
        for found in &mut answer.solutions {
            // With both methods, a solution that continuation does not reach is explained.
            let unexplained = found.origin.is_none() && options.method.continues();
            if options.retrace || unexplained {
                let rigid = &answer.rigid.solutions;
                let end = continuation::inverse(&problem, rigid, &found.solution, options.steps);
                found.retraced = Some(end.map_or(Retraced::Nowhere, Retraced::Rigid));
            }
        }
        if options.method == Method::Both {
            for (index, found) in answer.solutions.iter().enumerate() {
                let number = index + 1;
                answer.differences.extend(match (found.origin, found.retraced) {
                    (None, Some(Retraced::Rigid(origin))) => {
                        Some(Difference::OnlyInverse { number, origin })
                    }
                    (None, _) => Some(Difference::NoRigidOrigin { number }),
                    _ => None,
                });
            }
        }
        Ok(answer)
    }

    /// The complete search: proves what continuation has found and finds what it has not.
    fn search<M: FromMaterial + Provable>(
        &self,
        problem: &Problem<M>,
        answer: &mut Enumeration,
        options: Options,
    ) -> Result<(), GeometryFault> {
        let beside;
        let mut problem = problem;
        let mut found = complete(problem);
        if let Err(Refusal::Vertical(_)) = found {
            // The plane of an exactly vertical cable is not defined: that of a pose beside it is.
            beside = self.beside().problem::<M>()?;
            problem = &beside;
            found = complete(problem);
        }
        let found = match found {
            Ok(found) => found,
            Err(refusal) => {
                answer.search = Some(SearchReport::refused(refusal));
                return Ok(());
            }
        };
        let mut undecided = found.undecided;
        let mut continued = std::mem::take(&mut answer.solutions);
        let mut others = Vec::new();
        for proof in &found.solutions {
            let report = ProofReport {
                length_radii_m: proof.enclosure().map(|state| state.rest_length_m.radius()),
                kantorovich: if options.kantorovich { kantorovich(problem, proof) } else { None },
            };
            let known = continued
                .iter_mut()
                .find(|known| known.proof.is_none() && proof.holds(&known.solution.states));
            if let Some(known) = known {
                known.proof = Some(report);
                known.solution.states = proof.states();
                continue;
            }
            let Some(solution) = Solution::at(problem, proof.states()) else {
                // It exists, but floats find it singular: not to be passed over.
                undecided.push(Place { states: proof.enclosure() });
                continue;
            };
            others.push(FoundSolution {
                sags_m: std::array::from_fn(|i| sag_m(problem, &solution, i)),
                solution,
                origin: None,
                retraced: None,
                proof: Some(report),
            });
        }
        // What continuation claims and the search excludes is no solution.
        let decided = undecided.is_empty();
        let unproven = continued.iter().filter(|known| known.proof.is_none());
        answer.differences.extend(unproven.filter_map(|known| {
            Some(Difference::Unconfirmed { origin: known.origin?, contradicted: decided })
        }));
        continued.retain(|known| known.proof.is_some() || !decided);
        others.sort_by(|a, b| {
            let lengths = |f: &FoundSolution| f.solution.states.map(|s| s.rest_length_m);
            lengths(a).partial_cmp(&lengths(b)).unwrap_or(Ordering::Equal)
        });
        answer.solutions = continued;
        answer.solutions.extend(others);
        answer.search = Some(SearchReport {
            refusal: None,
            undecided,
            boxes: found.boxes,
            pieces: found.pieces,
        });
        Ok(())
    }

    /// The request for a pose within rounding of this one.
    fn beside(&self) -> Self {
        let mut beside = self.clone();
        let size_m = beside.position_m.iter().fold(1.0_f64, |size, c| size.max(c.abs()));
        beside.position_m[0] += 0.6 * BESIDE * size_m;
        beside.position_m[1] += 0.8 * BESIDE * size_m;
        beside
    }

    /// The rigid solutions themselves; the weight of the material gives slack cables their lengths.
    fn rigid(&self, method: Method) -> Result<Enumeration, GeometryFault> {
        let hanging = self.problem::<IrvineCatenary<f64>>()?;
        let rigid = RigidSolutions::of(&hanging.balance);
        let weights = std::array::from_fn(|i| hanging.model(i).weight_n_m);
        let found = |origin: &RigidSolution| {
            let states = origin.states(&hanging.balance, &weights);
            let columns: [_; CABLES] = std::array::from_fn(|i| {
                let towards_longer = if origin.slack.contains(i) { 1.0 } else { -1.0 };
                let unit = origin.force_n(&hanging.balance, i) / origin.forces_n[i];
                hanging.balance.planes()[i].wrench_n(&(unit * towards_longer))
            });
            let matrix = Matrix6::from_columns(&columns);
            let condition = Elimination::new(&matrix)?.condition();
            let slack = std::array::from_fn(|i| origin.slack.contains(i));
            let solution = Solution {
                states,
                anchor_tensions_n: std::array::from_fn(|i| {
                    if slack[i] {
                        weights[i] * states[i].rest_length_m - origin.forces_n[i]
                    } else {
                        origin.forces_n[i]
                    }
                }),
                is_positive: origin.is_positive,
                condition,
                vertical: slack,
            };
            let sags_m = std::array::from_fn(|i| {
                if slack[i] {
                    depth_m(&states[i], weights[i], hanging.balance.planes()[i].z_m)
                } else {
                    0.0
                }
            });
            let origin = Some(origin.slack);
            Some(FoundSolution { solution, origin, sags_m, retraced: None, proof: None })
        };
        let mut solutions = Vec::new();
        let mut branches = Vec::new();
        for (origin, found) in rigid.solutions.iter().filter_map(|r| Some((r.slack, found(r)?))) {
            let end = continuation::held_against_limits(&self.robot.limits, found.solution.clone());
            if matches!(end, BranchEnd::Solution(_)) {
                solutions.push(found);
            }
            branches.push(Branch::without_steps(origin, end));
        }
        let search = method.searches().then(|| {
            SearchReport::refused("rigid cables are solved by linear algebra, without a proof")
        });
        Ok(Enumeration { rigid, solutions, branches, search, differences: Vec::new() })
    }
}

/// How deep a vertical slack cable hangs below its upper end, which is what the height of the chord
/// above it tends to: `Fz` carries the part from its lowest point up to the attachment.
fn depth_m(state: &CableState<f64>, weight_n_m: f64, z_m: f64) -> f64 {
    state.force_n.y / weight_n_m - z_m.min(0.0)
}

/// Largest height of the chord above the cable. The cable is parallel to the chord where its tension
/// is; the part from the anchor to there is itself a cable, whose end the model knows.
fn sag_m<M: CableModel<f64>>(problem: &Problem<M>, solution: &Solution, cable: usize) -> f64 {
    let (plane, state) = (&problem.balance.planes()[cable], &solution.states[cable]);
    let model = problem.model(cable);
    let weight_n_m = model.weight_n_m();
    if weight_n_m <= 0.0 {
        return 0.0;
    }
    if solution.vertical[cable] || plane.x_m <= 0.0 {
        let hangs = state.force_n.y > 0.0 && state.force_n.y < weight_n_m * state.rest_length_m;
        return if hangs { depth_m(state, weight_n_m, plane.z_m) } else { 0.0 };
    }
    let slope = plane.z_m / plane.x_m;
    let beyond_n =
        (state.force_n.y - state.force_n.x * slope).clamp(0.0, weight_n_m * state.rest_length_m);
    let part = Vector2::new(state.force_n.x, state.force_n.y - beyond_n);
    let point = model.end_point(part, state.rest_length_m - beyond_n / weight_n_m).position_m;
    let sag = point.x * slope - point.y;
    if sag.is_finite() { sag.max(0.0) } else { 0.0 }
}
