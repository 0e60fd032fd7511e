//! One branch of the inverse kinematics, followed from tick to tick.

use nalgebra::{Vector2, Vector3};

use crate::newton::converge;
use crate::statics::Balance;
use crate::{
    CABLES, CableModel, CableState, Fault, Load, NewtonStep, Pose, Real, Robot, Scalar, StepFault,
};

/// Velocity of the platform: of its origin, and of turning, world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist<T: Scalar> {
    /// Velocity of the platform origin, m/s.
    pub linear_m_s: Vector3<T>,
    /// Angular velocity, rad/s.
    pub angular_rad_s: Vector3<T>,
}

/// Where the platform should be, and how fast it should move there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoint<T: Scalar> {
    /// The pose.
    pub pose: Pose<T>,
    /// Its rate of change.
    pub twist: Twist<T>,
}

/// What one winch and its cable can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CableLimits<T> {
    /// Shortest rest length, m.
    pub shortest_m: T,
    /// Longest rest length, m: what the drum holds.
    pub longest_m: T,
    /// Largest rate of the rest length either way, m/s.
    pub fastest_m_s: T,
    /// Lowest tension at the anchor, N.
    pub lowest_tension_n: T,
    /// Highest tension at either end, N.
    pub highest_tension_n: T,
}

/// How a [`Tracker`] works: rate and limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackerSettings<T: Scalar> {
    /// Time between two ticks, s.
    pub period_s: T,
    /// Largest move of the platform origin in a tick, and of an attachment by turning, m.
    pub largest_move_m: T,
    /// Least distance to a singularity (see [`Fault::NearSingularity`]), between 0 and 1.
    pub least_distance: T,
    /// A fold that would be reached sooner than this is refused, s.
    pub fold_horizon_s: T,
    /// Limits of the cables.
    pub cables: [CableLimits<T>; CABLES],
}

/// What one winch is to do, and what its cable then carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CableCommand<T: Scalar> {
    /// Rest length from the anchor to the attachment, m.
    pub rest_length_m: T,
    /// Its rate of change at the twist of the set-point, for speed feed-forward, m/s.
    pub rest_length_rate_m_s: T,
    /// Force on the cable at the attachment, `(Fx, Fz)` in its plane, N.
    pub force_n: Vector2<T>,
    /// Force of the cable on its winch at the anchor, `(Fx, Fz - W)`, N.
    pub anchor_force_n: Vector2<T>,
    /// Whether the cable hangs below both of its ends.
    pub is_slack: bool,
}

/// What is proven about a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate<T> {
    /// Kantorovich's `h`: at most 1/2.
    pub h: T,
    /// There is a solution within this radius, in newtons along the six force curves (2-norm).
    pub existence_radius_n: T,
    /// There is no other solution within this radius.
    pub uniqueness_radius_n: T,
}

/// The outcome of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command<T: Scalar> {
    /// One for each winch.
    pub cables: [CableCommand<T>; CABLES],
    /// What is proven about it.
    pub certificate: Certificate<T>,
    /// Distance to a singularity: see [`Fault::NearSingularity`].
    pub distance: T,
    /// Largest distance between the end of a cable and its attachment, before the last step, m.
    pub closure_m: T,
    /// Unbalanced wrench before the last step, moments over the moment arm, N.
    pub imbalance_n: T,
    /// Parts into which the move was divided.
    pub parts: u8,
}

/// Follows one branch: six rest lengths at each tick, each with a [`Certificate`].
#[derive(Clone, Copy, Debug)]
pub struct Tracker<T: Real, M> {
    robot: Robot<T, M>,
    load: Load<T>,
    settings: TrackerSettings<T>,
    balance: Balance<T>,
    command: Command<T>,
}

impl<T: Real, M: CableModel<T>> Tracker<T, M> {
    /// Starts at the solution that Newton's method finds from `states`.
    ///
    /// # Errors
    /// [`Fault`].
    pub fn start(
        robot: Robot<T, M>,
        load: Load<T>,
        settings: TrackerSettings<T>,
        set_point: &SetPoint<T>,
        states: &[CableState<T>; CABLES],
    ) -> Result<Self, Fault<T>> {
        let balance = Balance::at(&robot, &load, &set_point.pose).map_err(Fault::Geometry)?;
        let found = converge(&robot, &balance, states, T::EPSILON * T::constant(1e3), 20)
            .map_err(|_| Fault::Step(StepFault::SingularStatics))?;
        let command = to_command(&robot, &found.step);
        Ok(Self { robot, load, settings, balance, command })
    }

    /// The next command.
    ///
    /// # Errors
    /// [`Fault`]; the last command then stands.
    pub fn tick(&mut self, set_point: &SetPoint<T>) -> Result<&Command<T>, Fault<T>> {
        let balance = self
            .balance
            .at_next(&self.robot, &self.load, &set_point.pose)
            .map_err(Fault::Geometry)?;
        let states = core::array::from_fn(|i| CableState {
            force_n: self.command.cables[i].force_n,
            rest_length_m: self.command.cables[i].rest_length_m,
        });
        let step = NewtonStep::new(&self.robot, &balance, &states).map_err(Fault::Step)?;
        self.balance = balance;
        self.command = to_command(&self.robot, &step);
        Ok(&self.command)
    }

    /// The last certified command.
    pub fn command(&self) -> &Command<T> {
        &self.command
    }

    /// Rate and limits.
    pub fn settings(&self) -> &TrackerSettings<T> {
        &self.settings
    }
}

fn to_command<T: Real, M: CableModel<T>>(robot: &Robot<T, M>, step: &NewtonStep<T>) -> Command<T> {
    Command {
        cables: core::array::from_fn(|i| {
            let state = &step.states[i];
            let weight = robot.cables()[i].model.weight_n_m() * state.rest_length_m;
            let anchor_force_n = Vector2::new(state.force_n.x, state.force_n.y - weight);
            CableCommand {
                rest_length_m: state.rest_length_m,
                rest_length_rate_m_s: T::zero(),
                force_n: state.force_n,
                anchor_force_n,
                is_slack: state.force_n.y > T::zero() && anchor_force_n.y < T::zero(),
            }
        }),
        certificate: Certificate {
            h: T::zero(),
            existence_radius_n: T::zero(),
            uniqueness_radius_n: T::zero(),
        },
        distance: T::one() / step.condition(),
        closure_m: step.closure_m,
        imbalance_n: step.imbalance_n,
        parts: 1,
    }
}
