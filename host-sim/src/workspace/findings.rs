//! What is known of one pose.

use cdpr_core::{CABLES, GeometryFault};
use num_traits::Bounded;
use serde::{Deserialize, Serialize};

use crate::choice::Choice;
use crate::continuation::Solution;
use crate::enumerate::{Enumeration, Method, ModelKind, Options, Request};
use crate::rigid::RigidSolutions;
use crate::robot_file::{CableLimits, RobotDescription};

/// How much higher than limits and rigid forces the tensions may be where a pose without a solution is searched, to
/// tell whether it is the limits that took it. There is no limit of length then.
const WIDE: f64 = 1000.0;

/// How sure the count of solutions is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Proven: each exists, and there are no others within the limits.
    Proven,
    /// Not decided: two solutions meet here, or a bound is met exactly. Those that are counted exist.
    Undecided,
    /// Non-deformable cables, solved by linear algebra.
    Rigid,
    /// Not decided: a force with non-deformable cables is zero to rounding.
    RigidUndecided,
    /// A cable has no direction at this pose.
    AttachmentOnAnchor,
}

impl Status {
    /// As it stands in the files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Proven => "proven",
            Self::Undecided => "undecided",
            Self::Rigid => "rigid",
            Self::RigidUndecided => "rigid_undecided",
            Self::AttachmentOnAnchor => "attachment_on_anchor",
        }
    }

    /// Whether the count of solutions is settled.
    #[must_use]
    pub fn is_settled(self) -> bool {
        matches!(self, Self::Proven | Self::Rigid)
    }
}

/// How the workspace of deformable cables differs from that of non-deformable ones at a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// There are rigid solutions whose signs add up to zero, and (proven) no deformable one of whatever length, with
    /// tensions up to a thousand times as high as limits and rigid forces: they have merged in pairs.
    LostByMerging,
    /// There are rigid solutions, and deformable ones only beyond the limits of length or tension (proven).
    LostToLimits,
    /// In every rigid solution a cable is slack, and the cables have no weight with which it would pull.
    LostWithoutWeight,
    /// There are rigid solutions and no deformable one, and none of these reasons could be shown.
    Lost,
    /// There are deformable solutions and no rigid one.
    Gained,
}

impl Change {
    /// As it stands in the files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::LostByMerging => "lost_by_merging",
            Self::LostToLimits => "lost_to_limits",
            Self::LostWithoutWeight => "lost_without_weight",
            Self::Lost => "lost",
            Self::Gained => "gained",
        }
    }
}

/// The best solution of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Best {
    /// Rest lengths, m.
    pub lengths_m: [f64; CABLES],
    /// Tensions at the anchors, where the winches are, N.
    pub anchor_tensions_n: [f64; CABLES],
    /// Tensions at the attachments, N.
    pub attachment_tensions_n: [f64; CABLES],
    /// Reciprocal condition of the six unit tangents: how far, relative to them, the next fold or singularity is.
    pub fold_margin: f64,
    /// Least length that a cable has left, m; `None`: no limit.
    pub length_margin_m: Option<f64>,
    /// Least tension that a cable has left at either end, N; `None`: no limit.
    pub tension_margin_n: Option<f64>,
}

impl Best {
    fn of(solution: &Solution, limits: &[CableLimits; CABLES]) -> Self {
        let lengths_m = solution.states.map(|state| state.rest_length_m);
        let least = |left: [f64; CABLES]| {
            let least = left.into_iter().fold(f64::INFINITY, f64::min);
            least.is_finite().then_some(least)
        };
        Self {
            lengths_m,
            anchor_tensions_n: solution.anchor_tensions_n,
            attachment_tensions_n: solution.states.map(|state| state.tension_at_attachment_n()),
            fold_margin: 1.0 / solution.condition,
            length_margin_m: least(std::array::from_fn(|i| limits[i].max_length_m - lengths_m[i])),
            tension_margin_n: least(std::array::from_fn(|i| {
                limits[i].max_tension_n - solution.tension_n(i)
            })),
        }
    }
}

/// What is known of one pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Solutions with non-deformable cables, whatever the limits.
    pub rigid: u8,
    /// Sum of their signs.
    pub rigid_degree: i8,
    /// Slack sets with a force that is zero to rounding: whether these are solutions is not decided.
    pub rigid_undecided: u8,
    /// How sure the count of solutions is.
    pub status: Status,
    /// Solutions of the cable model within the limits.
    pub solutions: u16,
    /// Sum of their signs.
    pub degree: i16,
    /// How it differs from non-deformable cables, where it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<Change>,
    /// The best of the solutions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub best: Option<Box<Best>>,
}

impl Findings {
    /// Where a cable has no direction.
    const NOWHERE: Self = Self {
        rigid: 0,
        rigid_degree: 0,
        rigid_undecided: 0,
        status: Status::AttachmentOnAnchor,
        solutions: 0,
        degree: 0,
        change: None,
        best: None,
    };

    /// Whether they can be those of a pose with this model: to be asked of what was read.
    pub(super) fn are_sound(&self, model: ModelKind) -> bool {
        let is_rigid = matches!(self.status, Status::Rigid | Status::RigidUndecided);
        let has_best = self.status.is_settled() && self.solutions > 0;
        self.rigid <= 63
            && self.rigid_undecided <= 63
            && (is_rigid == (model == ModelKind::Rigid)
                || self.status == Status::AttachmentOnAnchor)
            && self.best.is_some() == has_best
    }

    /// Examines the pose of `request`; `choice` says which solution is the best.
    #[must_use]
    pub fn of(request: &Request, choice: Choice) -> Self {
        let options = Options { method: Method::Complete, ..Options::default() };
        let answer = match request.enumerate(options) {
            Ok(answer) => answer,
            Err(GeometryFault::AttachmentOnAnchor(_)) => return Self::NOWHERE,
            Err(_) => return Self { status: Status::Undecided, ..Self::NOWHERE },
        };
        let status = match (request.model, answer.rigid.undecided.len()) {
            (ModelKind::Rigid, 0) => Status::Rigid,
            (ModelKind::Rigid, _) => Status::RigidUndecided,
            _ if answer.is_complete() => Status::Proven,
            _ => Status::Undecided,
        };
        // Of what is not settled nothing is the best.
        let best = choice.best(&answer.solutions).filter(|_| status.is_settled());
        Self {
            rigid: count(answer.rigid.solutions.len()),
            rigid_degree: sum(answer.rigid.degree()),
            rigid_undecided: count(answer.rigid.undecided.len()),
            status,
            solutions: count(answer.solutions.len()),
            degree: sum(answer.degree()),
            change: change(request, &answer, status),
            best: best.map(|solution| Box::new(Best::of(solution, &request.robot.limits))),
        }
    }
}

/// Far more than there are: 63 slack sets, and a dozen solutions.
fn count<N: TryFrom<usize> + Bounded>(number: usize) -> N {
    N::try_from(number).unwrap_or_else(|_| N::max_value())
}

fn sum<N: TryFrom<i32> + Bounded>(degree: i32) -> N {
    N::try_from(degree).unwrap_or_else(|_| N::max_value())
}

fn change(request: &Request, answer: &Enumeration, status: Status) -> Option<Change> {
    let rigid = &answer.rigid;
    if request.model == ModelKind::Rigid {
        return None;
    }
    match (rigid.solutions.is_empty(), answer.solutions.is_empty()) {
        (true, false) if rigid.undecided.is_empty() => Some(Change::Gained),
        (false, true) if status == Status::Proven => Some(lost(request, rigid)),
        _ => None,
    }
}

/// Why a pose with rigid solutions has no deformable one within the limits.
fn lost(request: &Request, rigid: &RigidSolutions) -> Change {
    let wide = Request { robot: without_limits(&request.robot, rigid), ..request.clone() };
    let options = Options { method: Method::Complete, ..Options::default() };
    let Ok(answer) = wide.enumerate(options) else { return Change::Lost };
    if !answer.solutions.is_empty() {
        return Change::LostToLimits;
    }
    let all_are_slack = rigid.solutions.iter().all(|solution| !solution.slack.is_empty());
    if request.model == ModelKind::Elastic {
        return if all_are_slack { Change::LostWithoutWeight } else { Change::Lost };
    }
    // Else solutions are left over, so far away that the search did not see them.
    let may_merge = rigid.degree() == 0 && rigid.undecided.is_empty();
    if answer.is_complete() && may_merge { Change::LostByMerging } else { Change::Lost }
}

fn without_limits(robot: &RobotDescription, rigid: &RigidSolutions) -> RobotDescription {
    let forces = rigid.solutions.iter().flat_map(|solution| solution.forces_n);
    let largest_n = forces.fold(0.0, f64::max);
    let mut wide = robot.clone();
    for limits in &mut wide.limits {
        limits.max_length_m = f64::INFINITY;
        limits.max_tension_n = WIDE * limits.max_tension_n.max(largest_n);
    }
    wide
}
