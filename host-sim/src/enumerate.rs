//! The answer for one pose: all rigid solutions and what becomes of each.

use cdpr_core::elimination::Elimination;
use cdpr_core::{
    CABLES, CableModel, CableState, GeometryFault, IrvineCatenary, LinearElastic, NonDeformable,
    Parabola, Pose,
};
use nalgebra::{Matrix6, UnitQuaternion, Vector2, Vector3};

use crate::continuation::{self, Branch, BranchEnd, Solution};
use crate::problem::{FromMaterial, Problem};
use crate::rigid::{RigidSolution, RigidSolutions, SlackSet};
use crate::robot_file::RobotDescription;

/// Which cable model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
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

/// A solution with what people want to see of it.
#[derive(Clone, Debug)]
pub struct FoundSolution {
    /// The solution.
    pub solution: Solution,
    /// Largest height of the chord above the cable, m; of its upper end for a vertical cable.
    pub sags_m: [f64; CABLES],
    /// Where the inverse scheme leads, if it was asked for.
    pub retraced: Option<Retraced>,
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

/// Everything found for one pose.
#[derive(Clone, Debug)]
pub struct Enumeration {
    /// Rigid solutions.
    pub rigid: RigidSolutions,
    /// Deformable solutions within the limits, in the order of their rigid origins.
    pub solutions: Vec<FoundSolution>,
    /// What became of each rigid solution.
    pub branches: Vec<Branch>,
}

impl Enumeration {
    /// Sum of the signs of the solutions. Equal to the degree of the rigid ones unless solutions lie
    /// beyond the limits or have no rigid origin.
    #[must_use]
    pub fn degree(&self) -> i32 {
        self.solutions.iter().map(|found| if found.solution.is_positive { 1 } else { -1 }).sum()
    }
}

impl Request {
    /// Checks that the pose can be asked for.
    ///
    /// # Errors
    /// [`GeometryFault`] when the pose is not finite or puts an attachment on its anchor.
    pub fn check(&self) -> Result<(), GeometryFault> {
        self.problem::<NonDeformable>().map(|_| ())
    }

    /// Finds all rigid solutions and follows each by continuation; with `retrace`, follows each
    /// deformable solution back as well.
    ///
    /// # Errors
    /// As [`Request::check`].
    pub fn enumerate(&self, retrace: bool) -> Result<Enumeration, GeometryFault> {
        match self.model {
            ModelKind::Irvine => self.continued::<IrvineCatenary<f64>>(retrace),
            ModelKind::Parabolic => self.continued::<Parabola<f64>>(retrace),
            ModelKind::Elastic => self.continued::<LinearElastic<f64>>(retrace),
            ModelKind::Rigid => self.rigid(),
        }
    }

    /// The problem of this request for a model made from the robot's materials.
    ///
    /// # Errors
    /// As [`Request::check`].
    pub fn problem<M: FromMaterial>(&self) -> Result<Problem<M>, GeometryFault> {
        let RobotDescription { robot, limits, load, .. } = &self.robot;
        let orientation = UnitQuaternion::from_scaled_axis(Vector3::from(self.rotation_vector_rad));
        let pose = Pose::new(Vector3::from(self.position_m), orientation)?;
        let robot = robot.map_models(|_, material| M::from_material(material, load.gravity_m_s2));
        Problem::new(robot, load, &pose, *limits)
    }

    fn continued<M: FromMaterial>(&self, retrace: bool) -> Result<Enumeration, GeometryFault> {
        let problem = self.problem::<M>()?;
        let rigid = RigidSolutions::of(&problem.balance);
        let branches = continuation::direct(&problem, &rigid.solutions);
        let solutions = branches
            .iter()
            .filter_map(|branch| match &branch.end {
                BranchEnd::Solution(solution) => Some(solution),
                _ => None,
            })
            .map(|solution| FoundSolution {
                sags_m: std::array::from_fn(|i| sag_m(&problem, solution, i)),
                retraced: retrace.then(|| {
                    continuation::inverse(&problem, &rigid.solutions, solution)
                        .map_or(Retraced::Nowhere, Retraced::Rigid)
                }),
                solution: solution.clone(),
            })
            .collect();
        Ok(Enumeration { rigid, solutions, branches })
    }

    /// The rigid solutions themselves; the weight of the material gives slack cables their lengths.
    fn rigid(&self) -> Result<Enumeration, GeometryFault> {
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
                origin: origin.slack,
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
            Some(FoundSolution { solution, sags_m, retraced: None })
        };
        let mut solutions = Vec::new();
        let mut branches = Vec::new();
        for found in rigid.solutions.iter().filter_map(found) {
            let origin = found.solution.origin;
            let end = continuation::held_against_limits(&self.robot.limits, found.solution.clone());
            if matches!(end, BranchEnd::Solution(_)) {
                solutions.push(found);
            }
            branches.push(Branch { origin, end, folds: Vec::new(), steps: 0, largest_h: 0.0 });
        }
        Ok(Enumeration { rigid, solutions, branches })
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
