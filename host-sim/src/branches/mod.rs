//! All solutions of one pose over a range of one parameter: the bifurcation diagram.
//!
//! Solutions are born and die in folds, two at a time, and may exist nowhere at the ends of the range.
//! So the solutions at several start values in it are followed in both directions, by arc length through
//! folds, until every curve has left the range or closed. A branch is a smooth stretch of a curve
//! between two folds or ends of the range: along it the parameter rises, and the sign of the
//! determinant does not change. Limits of length and tension do not end a branch; where it crosses one
//! is located.

mod family;
mod graph;

use std::fmt;

use cdpr_core::{CABLES, CableState, GeometryFault, IrvineCatenary, LinearElastic, Parabola};

use crate::cases::Overrides;
use crate::complete::Provable;
use crate::continuation::{
    self, BranchEnd, Homotopy, Point, Quantity, Solution, Steps, System, Waypoint, locate_crossing,
};
use crate::enumerate::{ModelKind, Options, Request};
use crate::problem::{FromMaterial, Problem};
use crate::rigid::{RigidSolutions, SlackSet};
use crate::robot_file::CableLimits;
use family::Family;
use graph::{Chain, Graph, Start, Tip};

/// Start values strictly inside the range, at equal ratios.
const INTERIOR_STARTS: u32 = 9;
/// Narrowest range, relative to its lower end: start values in it must differ by more than rounding.
const NARROWEST: f64 = 1e-9;
/// How closely a limit is met where a branch is said to cross it, relative to the limit.
const CROSSING_TOLERANCE: f64 = 1e-12;
/// How far from the limit the place is in doubt, where rounding has left more than the tolerance.
const CROSSING_DOUBT: f64 = 1e-9;

/// What varies, for all cables alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Parameter {
    /// Mass of the cables per rest length, kg/m
    LinearDensity,
    /// Axial stiffness EA of the cables, N
    AxialStiffness,
    /// Mass of the platform, kg
    Mass,
}

impl Parameter {
    /// What people call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::LinearDensity => "linear density of the cables",
            Self::AxialStiffness => "axial stiffness of the cables",
            Self::Mass => "mass of the platform",
        }
    }

    /// Its unit.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::LinearDensity => "kg/m",
            Self::AxialStiffness => "N",
            Self::Mass => "kg",
        }
    }

    /// Its values in `request`, in its [unit](Self::unit): one for each cable, or the same for all.
    #[must_use]
    pub fn of(self, request: &Request) -> [f64; CABLES] {
        let robot = &request.robot;
        let cables = robot.robot.cables();
        match self {
            Self::LinearDensity => cables.each_ref().map(|cable| cable.model.linear_density_kg_m),
            Self::AxialStiffness => cables.each_ref().map(|cable| cable.model.axial_stiffness_n),
            Self::Mass => [robot.load.mass_kg; CABLES],
        }
    }

    /// The override that gives it `value`, in its [unit](Self::unit).
    #[must_use]
    pub fn at(self, value: f64) -> Overrides {
        let none = Overrides::default();
        match self {
            Self::LinearDensity => Overrides { linear_density_kg_m: Some(value), ..none },
            Self::AxialStiffness => Overrides { axial_stiffness_n: Some(value), ..none },
            Self::Mass => Overrides { mass_kg: Some(value), ..none },
        }
    }

    /// `request` with `value` of the parameter.
    #[must_use]
    pub fn request_at(self, request: &Request, value: f64) -> Request {
        Request { robot: self.at(value).apply(&request.robot), ..request.clone() }
    }
}

/// A range of a parameter, in its unit; positive, finite and upwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    from: f64,
    to: f64,
}

impl Range {
    /// The range from `from` up to `to`.
    ///
    /// # Errors
    /// [`BranchesError::Range`] when a number is not positive and finite, or `to` is not above `from`.
    pub fn new(from: f64, to: f64) -> Result<Self, BranchesError> {
        let refuse =
            |message: &str| Err(BranchesError::Range { from, to, message: message.into() });
        let good = |value: f64| value > 0.0 && value.is_finite();
        if !good(from) || !good(to) {
            refuse("both ends must be positive and finite")
        } else if from > to {
            refuse("the lower end comes first")
        } else if to / from - 1.0 < NARROWEST {
            refuse("the range is empty, or too narrow for start values in it")
        } else {
            Ok(Self { from, to })
        }
    }

    /// Lower end.
    #[must_use]
    pub fn from(&self) -> f64 {
        self.from
    }

    /// Upper end.
    #[must_use]
    pub fn to(&self) -> f64 {
        self.to
    }

    /// Logarithms of the start values, both ends among them.
    fn sigmas(&self) -> Vec<f64> {
        let (low, high) = (self.from.ln(), self.to.ln());
        let cells = INTERIOR_STARTS + 1;
        let interior = (1..cells).map(|k| low + (high - low) * f64::from(k) / f64::from(cells));
        std::iter::once(low).chain(interior).chain([high]).collect()
    }

    /// The value of a logarithm: the ends exactly as they were given.
    fn value(&self, sigma: f64) -> f64 {
        if sigma <= self.from.ln() {
            self.from
        } else if sigma >= self.to.ln() {
            self.to
        } else {
            sigma.exp()
        }
    }
}

/// Why branches cannot be followed.
#[derive(Debug, thiserror::Error)]
pub enum BranchesError {
    /// The pose cannot be asked for.
    #[error(transparent)]
    Pose(#[from] GeometryFault),
    /// The range is not one.
    #[error("{from} to {to}: {message}")]
    Range {
        /// Lower end as given.
        from: f64,
        /// Upper end as given.
        to: f64,
        /// What is wrong.
        message: String,
    },
    /// The cable model does not know the parameter.
    #[error("the {} has no effect on the solutions of this model that could be followed", .0.name())]
    NoEffect(Parameter),
}

/// Where a branch ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Border {
    /// At the end of the range.
    Range,
    /// In a fold: index into [`Diagram::folds`].
    Fold(usize),
    /// The tension of this cable, counted from 0, grows without bound.
    RanAway(usize),
    /// Given up at a singular point that is no fold.
    Stalled,
    /// Where another branch has arrived too: one of them is wrong.
    Doubtful,
}

/// One solution of a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct BranchPoint {
    /// Value of the parameter, in its unit.
    pub value: f64,
    /// Forces and rest lengths.
    pub states: [CableState<f64>; CABLES],
    /// Tension at the anchor, N.
    pub anchor_tensions_n: [f64; CABLES],
    /// Whether a length or tension is beyond its limit.
    pub is_beyond_limit: bool,
}

/// Where a branch crosses a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitCrossing {
    /// Value of the parameter, in its unit.
    pub value: f64,
    /// The cable, counted from 0.
    pub cable: usize,
    /// What reaches its limit.
    pub quantity: Quantity,
    /// Whether it is beyond the limit at larger values of the parameter, else at smaller ones.
    pub is_beyond_above: bool,
}

/// Solutions over a stretch of the parameter on which they change smoothly.
#[derive(Clone, Debug)]
pub struct SolutionBranch {
    /// The rigid solution that the inverse scheme leads to from a point of it, if any.
    pub origin: Option<SlackSet>,
    /// Sign of the determinant of the six unit tangents: true for +1.
    pub is_positive: bool,
    /// Where it ends below.
    pub low: Border,
    /// Where it ends above.
    pub high: Border,
    /// Points of it, the parameter rising from one end to the other.
    pub points: Vec<BranchPoint>,
    /// Where it crosses limits, the parameter rising.
    pub limit_crossings: Vec<LimitCrossing>,
}

/// Where two branches meet and end.
#[derive(Clone, Debug, PartialEq)]
pub struct Fold {
    /// Value of the parameter, in its unit.
    pub value: f64,
    /// Forces and rest lengths there.
    pub states: [CableState<f64>; CABLES],
    /// The branches: indices into [`Diagram::branches`].
    pub branches: [usize; 2],
    /// Whether they end there as the parameter grows; else they begin there.
    pub is_death: bool,
}

/// What was found at a start value, without regard to limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartCheck {
    /// Value of the parameter, in its unit.
    pub value: f64,
    /// Solutions that the search at this value alone found.
    pub solutions: usize,
    /// Branches followed through it.
    pub branches: usize,
    /// Sum of the signs of the branches there.
    pub degree: i32,
}

/// Something that should not be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Doubt {
    /// A solution found at a start value is no solution of the equations that are followed.
    StartLost {
        /// Index into [`Diagram::checks`].
        start_value: usize,
    },
    /// Two paths from this start value arrived at one solution, even with short steps.
    TwoPathsAtOne {
        /// Index into [`Diagram::checks`].
        start_value: usize,
    },
    /// A fold could not be located to full accuracy.
    FoldNotLocated {
        /// Value of the parameter near it.
        value: f64,
    },
    /// The place where a limit is crossed could not be located to full accuracy.
    CrossingNotLocated {
        /// Value of the parameter near it.
        value: f64,
    },
    /// The sign of the determinant changes along a branch: a fold or a crossing of curves was missed.
    SignChanges {
        /// Value of the parameter in the middle of the branch.
        value: f64,
    },
    /// New solutions kept turning up.
    TooManyPaths,
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StartLost { start_value } => {
                write!(f, "a solution found at start value {} cannot be followed", start_value + 1)
            }
            Self::TwoPathsAtOne { start_value } => {
                write!(f, "two paths from start value {} arrive at one solution", start_value + 1)
            }
            Self::FoldNotLocated { value } => {
                write!(f, "the fold near {value} is not located to full accuracy")
            }
            Self::CrossingNotLocated { value } => {
                write!(f, "the limit crossed near {value} is not located to full accuracy")
            }
            Self::SignChanges { value } => {
                write!(f, "the sign of det changes along the branch over {value}")
            }
            Self::TooManyPaths => write!(f, "given up after too many paths"),
        }
    }
}

/// All branches over a range.
#[derive(Clone, Debug)]
pub struct Diagram {
    /// What varies.
    pub parameter: Parameter,
    /// Over which range.
    pub range: Range,
    /// The branches, those from rigid solutions with fewer slack cables first.
    pub branches: Vec<SolutionBranch>,
    /// The folds between them, the parameter rising.
    pub folds: Vec<Fold>,
    /// Sum of the signs of the rigid solutions: what the degree is at every value.
    pub rigid_degree: i32,
    /// What was found at each start value.
    pub checks: Vec<StartCheck>,
    /// What should not be.
    pub doubts: Vec<Doubt>,
}

impl Diagram {
    /// Follows all branches of `request` over `range` of `parameter`; its own value is ignored.
    ///
    /// # Errors
    /// [`BranchesError`] when the pose cannot be asked for, or the model has no such branches.
    pub fn trace(
        request: &Request,
        parameter: Parameter,
        range: Range,
    ) -> Result<Self, BranchesError> {
        match (request.model, parameter) {
            (ModelKind::Rigid, _) | (ModelKind::Elastic, Parameter::LinearDensity) => {
                Err(BranchesError::NoEffect(parameter))
            }
            (ModelKind::Irvine, _) => traced::<IrvineCatenary<f64>>(request, parameter, range),
            (ModelKind::Parabolic, _) => traced::<Parabola<f64>>(request, parameter, range),
            (ModelKind::Elastic, _) => traced::<LinearElastic<f64>>(request, parameter, range),
        }
    }

    /// Whether every start value has as many branches as solutions, the degree is that of the rigid
    /// solutions everywhere, and nothing is in doubt.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        let agrees = |c: &StartCheck| c.solutions == c.branches && c.degree == self.rigid_degree;
        self.doubts.is_empty() && self.checks.iter().all(agrees)
    }
}

/// How far beyond the limits solutions are looked for, so that branches are followed which leave them
/// on the way or come in from outside.
const BEYOND_LIMITS: f64 = 4.0;

/// The solutions of one problem, from which branches are followed: all within [`BEYOND_LIMITS`] times
/// its limits, proven, and those further out that continuation finds.
fn solutions_at(request: &Request) -> Result<Vec<Start>, GeometryFault> {
    let mut request = request.clone();
    for limits in &mut request.robot.limits {
        limits.max_length_m *= BEYOND_LIMITS;
        limits.max_tension_n *= BEYOND_LIMITS;
    }
    let answer = request.enumerate(Options { steps: Steps::Tested, ..Options::default() })?;
    let start = |solution: Solution| (solution.states, solution.vertical);
    let beyond = answer.branches.into_iter().filter_map(|branch| match branch.end {
        BranchEnd::BeyondLimit { solution, .. } => Some(solution),
        _ => None,
    });
    let within = answer.solutions.into_iter().map(|found| found.solution);
    Ok(within.chain(beyond).map(start).collect())
}

fn traced<M: FromMaterial + Provable>(
    request: &Request,
    parameter: Parameter,
    range: Range,
) -> Result<Diagram, BranchesError> {
    let family = Family::<M>::new(request, parameter)?;
    let sigmas = range.sigmas();
    let starts = sigmas
        .iter()
        .map(|&sigma| solutions_at(&parameter.request_at(request, range.value(sigma))))
        .collect::<Result<Vec<_>, _>>()?;
    let graph = Graph::trace(&family, &sigmas, &starts);
    let survey = Survey { family: &family, request, parameter, range };

    let chains = graph.chains();
    let mut doubts = graph.doubts.clone();
    let mut branches = Vec::new();
    for chain in &chains {
        let (branch, more) = survey.branch(chain)?;
        branches.push(branch);
        doubts.extend(more);
    }
    // Numbered in the order of their rigid origins, then of the parameter.
    let mut order: Vec<usize> = (0..branches.len()).collect();
    let rank = |index: usize| {
        let origin = branches[index].origin;
        (origin.is_none(), origin.map(|set| (set.len(), set)))
    };
    let low = |index: usize| branches[index].points[0].value;
    order.sort_by(|&a, &b| rank(a).cmp(&rank(b)).then(low(a).total_cmp(&low(b))));
    let mut fold_order: Vec<usize> = (0..graph.folds.len()).collect();
    fold_order.sort_by(|&a, &b| graph.folds[a].sigma.total_cmp(&graph.folds[b].sigma));

    let folds = fold_order
        .iter()
        .map(|&fold| {
            let ends_there = |index: &usize| {
                [chains[*index].low, chains[*index].high].contains(&Tip::Fold(fold))
            };
            let mut ends = (0..order.len()).filter(|&n| ends_there(&order[n]));
            let (first, second) = (ends.next().unwrap_or(0), ends.next().unwrap_or(0));
            Fold {
                value: range.value(graph.folds[fold].sigma),
                states: graph.folds[fold].states,
                branches: [first, second],
                is_death: chains[order[first]].high == Tip::Fold(fold),
            }
        })
        .collect();
    let border = |tip: Tip| match tip {
        Tip::Node(..) => Border::Range,
        Tip::Fold(fold) => {
            Border::Fold(fold_order.iter().position(|&f| f == fold).unwrap_or_default())
        }
        Tip::RanAway(cable) => Border::RanAway(cable),
        Tip::Stalled => Border::Stalled,
        Tip::Doubtful => Border::Doubtful,
    };
    let numbered = order.iter().map(|&index| {
        let (low, high) = (border(chains[index].low), border(chains[index].high));
        SolutionBranch { low, high, ..branches[index].clone() }
    });
    let checks = sigmas.iter().enumerate().map(|(k, &sigma)| {
        let (solutions, branches) = graph.counts(k);
        StartCheck { value: range.value(sigma), solutions, branches, degree: graph.degree(k) }
    });
    Ok(Diagram {
        parameter,
        range,
        branches: numbered.collect(),
        folds,
        rigid_degree: survey.rigid(range.from())?.1.degree(),
        checks: checks.collect(),
        doubts,
    })
}

/// What is asked of each point of a branch.
struct Survey<'a, M> {
    family: &'a Family<M>,
    request: &'a Request,
    parameter: Parameter,
    range: Range,
}

impl<M: FromMaterial + Provable> Survey<'_, M> {
    /// A chain as a branch, its borders left open, and what is in doubt about it.
    fn branch(&self, chain: &Chain) -> Result<(SolutionBranch, Vec<Doubt>), GeometryFault> {
        let waypoints = &chain.waypoints;
        let mut points = vec![self.point(&waypoints[0].point)];
        let (mut limit_crossings, mut doubts) = (Vec::new(), Vec::new());
        for pair in waypoints.windows(2) {
            for (crossing, point) in self.crossings(&pair[0], &pair[1]) {
                let LimitCrossing { value, cable, quantity, .. } = crossing;
                if self.excess(&point, cable, quantity).abs() > CROSSING_DOUBT {
                    doubts.push(Doubt::CrossingNotLocated { value });
                }
                limit_crossings.push(crossing);
                points.push(self.point(&point));
            }
            points.push(self.point(&pair[1].point));
        }
        let sign = |waypoint: &Waypoint| {
            let system = System { homotopy: self.family, vertical: waypoint.vertical };
            Some(system.eliminate_tangents(&waypoint.point)?.is_positive())
        };
        // At a fold there is none.
        let signs = waypoints.iter().filter(|waypoint| !waypoint.is_fold).filter_map(sign);
        let (positive, negative): (Vec<bool>, Vec<bool>) = signs.partition(|&sign| sign);
        if !positive.is_empty() && !negative.is_empty() {
            doubts.push(Doubt::SignChanges { value: points[points.len() / 2].value });
        }
        let branch = SolutionBranch {
            origin: self.origin(waypoints)?,
            is_positive: positive.len() > negative.len(),
            low: Border::Doubtful,
            high: Border::Doubtful,
            points,
            limit_crossings,
        };
        Ok((branch, doubts))
    }

    fn point(&self, point: &Point) -> BranchPoint {
        let beyond = |(cable, quantity)| self.excess(point, cable, quantity) > CROSSING_TOLERANCE;
        BranchPoint {
            value: self.range.value(point.sigma),
            states: point.states,
            anchor_tensions_n: std::array::from_fn(|i| self.anchor_tension_n(point, i)),
            is_beyond_limit: limited().any(beyond),
        }
    }

    fn anchor_tension_n(&self, point: &Point, cable: usize) -> f64 {
        let weight_n_m = self.family.model(cable, point.sigma).weight_n_m();
        point.states[cable].tension_at_anchor_n(weight_n_m)
    }

    /// Logarithm of a length or tension over its limit.
    fn excess(&self, point: &Point, cable: usize, quantity: Quantity) -> f64 {
        let state = &point.states[cable];
        let CableLimits { max_length_m, max_tension_n } = self.request.robot.limits[cable];
        match quantity {
            Quantity::Length => state.rest_length_m / max_length_m,
            Quantity::Tension => {
                let anchor_n = self.anchor_tension_n(point, cable);
                state.tension_at_attachment_n().max(anchor_n) / max_tension_n
            }
        }
        .ln()
    }

    /// Where limits are crossed between two points of a branch, the parameter rising.
    fn crossings(&self, before: &Waypoint, after: &Waypoint) -> Vec<(LimitCrossing, Point)> {
        let mut crossings: Vec<(LimitCrossing, Point)> = limited()
            .filter_map(|(cable, quantity)| {
                let excess = |point: &Point| self.excess(point, cable, quantity);
                let is_beyond_above = excess(&after.point) > 0.0;
                if is_beyond_above == (excess(&before.point) > 0.0) {
                    return None;
                }
                let point = locate_crossing(self.family, before, after, CROSSING_TOLERANCE, excess);
                let value = self.range.value(point.sigma);
                Some((LimitCrossing { value, cable, quantity, is_beyond_above }, point))
            })
            .collect();
        crossings.sort_by(|a, b| a.1.sigma.total_cmp(&b.1.sigma));
        crossings
    }

    /// The rigid solution that the middle of a branch comes from, or else a point nearer to its ends.
    fn origin(&self, waypoints: &[Waypoint]) -> Result<Option<SlackSet>, GeometryFault> {
        let count = waypoints.len();
        for index in [count / 2, count / 4, count - 1 - count / 4] {
            let Waypoint { point, vertical, .. } = &waypoints[index];
            let (problem, rigid) = self.rigid(point.sigma.exp())?;
            let origin = continuation::origin(
                &problem,
                &rigid.solutions,
                point.states,
                *vertical,
                Steps::Tested,
            );
            if origin.is_some() {
                return Ok(origin);
            }
        }
        Ok(None)
    }

    /// The problem at `value` and its rigid solutions.
    fn rigid(&self, value: f64) -> Result<(Problem<M>, RigidSolutions), GeometryFault> {
        let problem = self.parameter.request_at(self.request, value).problem::<M>()?;
        let rigid = RigidSolutions::of(&problem.balance);
        Ok((problem, rigid))
    }
}

/// Every quantity of every cable that has a limit.
fn limited() -> impl Iterator<Item = (usize, Quantity)> {
    (0..CABLES).flat_map(|cable| [Quantity::Length, Quantity::Tension].map(|what| (cable, what)))
}
