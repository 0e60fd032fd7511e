//! The controller in the loop: that of core on the host, in either precision.

use cdpr_core::winch::{Countable, DrumFault};
use cdpr_core::{
    CABLES, CableState, GeometryFault, IrvineCatenary, Pose, SetPoint, Table, Tracker, Twist,
};
use cdpr_link::station::{Blueprint, StationFault, WAY_PARTS};
use cdpr_link::{Decision, Inputs, Start, Station};

use super::trajectory::Trajectory;
use crate::choice::{Choice, ChoiceError, choose};
use crate::enumerate::{ModelKind, Request};
use crate::problem::{Precision, rounded};
use crate::robot_file::RobotDescription;

/// What decides in each period: the controller on the host, firmware, or a user's own.
pub trait Controller {
    /// Why there is no decision.
    type Error;

    /// One period.
    ///
    /// # Errors
    /// As it says itself; the simulation then ends.
    fn tick(&mut self, inputs: &Inputs) -> Result<Decision<f64>, Self::Error>;
}

/// Why a simulation does not begin.
#[derive(Debug, thiserror::Error)]
pub enum BeginError {
    /// The robot, in the precision of the controller.
    #[error("robot: {0}")]
    Robot(GeometryFault),
    /// No solution to start with.
    #[error("at the first set-point: {0}")]
    Solution(ChoiceError),
    /// The controller refuses to start.
    #[error("the controller does not start: {0}")]
    Start(String),
    /// A drum cannot be.
    #[error("winch: {0}")]
    Drum(#[from] DrumFault),
    /// The cables do not stretch.
    #[error("cable.axial_stiffness_n: the plant needs cables that stretch")]
    Inextensible,
}

impl<T: std::fmt::Display> From<StationFault<T>> for BeginError {
    fn from(fault: StationFault<T>) -> Self {
        Self::Start(fault.to_string())
    }
}

/// Where a simulation begins: the first set-point, and a solution there.
#[derive(Clone, Debug)]
pub struct Beginning {
    /// Where the platform should stand, and what is paid out where the motors stand at angle 0.
    pub start: Start,
    /// The solution, exact to rounding.
    pub states: [CableState<f64>; CABLES],
}

impl Beginning {
    /// At the first set-point of `trajectory`: on the sheet of `table`, or else on that of the solution whose
    /// longest cable is shortest, of all within the limits.
    ///
    /// # Errors
    /// [`BeginError`].
    pub fn at(
        robot: &RobotDescription,
        trajectory: &Trajectory,
        table: Option<&Table<'_>>,
    ) -> Result<Self, BeginError> {
        if robot.robot.cables().iter().any(|cable| cable.model.axial_stiffness_n.is_infinite()) {
            return Err(BeginError::Inextensible);
        }
        let stance = trajectory.at(0.0).stance;
        let q = stance.orientation.as_ref();
        let position_m = stance.position_m.into();
        let blueprint = blueprint::<f64>(robot).map_err(BeginError::Robot)?;
        let pose = Pose::new(stance.position_m, stance.orientation).map_err(BeginError::Robot)?;
        let states = if let Some(table) = table {
            let set_point = SetPoint { pose, twist: Twist::none() };
            let tracker = Tracker::start_from(
                blueprint.robot,
                blueprint.load,
                blueprint.tracker,
                &set_point,
                table,
                WAY_PARTS,
            )
            .map_err(|fault| BeginError::Start(fault.to_string()))?;
            tracker.command().states()
        } else {
            let request = Request {
                robot: robot.clone(),
                position_m,
                rotation_vector_rad: stance.orientation.scaled_axis().into(),
                model: ModelKind::Irvine,
            };
            choose(&request, Choice::Shortest, None).map_err(BeginError::Solution)?.states
        };
        let start = Start {
            position_m,
            quaternion: [q.w, q.i, q.j, q.k],
            home_lengths_m: states.map(|state| state.rest_length_m),
        };
        Ok(Self { start, states })
    }
}

/// What the controller of `robot` is built for, each number rounded to `T` once.
///
/// # Errors
/// [`GeometryFault`]: rounded it is no robot.
pub fn blueprint<T: Countable>(
    robot: &RobotDescription,
) -> Result<Blueprint<T, IrvineCatenary<T>>, GeometryFault> {
    let (rounded_robot, load) = rounded(&robot.with_model(), &robot.load)?;
    Ok(Blueprint {
        robot: rounded_robot,
        load,
        tracker: robot.tracker_settings(),
        controller: robot.controller_settings(),
        drum: robot.drum(),
        monitor: robot.monitor(),
    })
}

/// The station of `cdpr-link` on the host, in either precision.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one of it")]
pub enum HostController<'t> {
    /// In single precision.
    Single(Station<'t, f32, IrvineCatenary<f32>>),
    /// In double precision.
    Double(Station<'t, f64, IrvineCatenary<f64>>),
}

impl<'t> HostController<'t> {
    /// Starts at `beginning`, from `table` where there is one.
    ///
    /// # Errors
    /// [`BeginError`].
    pub fn start(
        robot: &RobotDescription,
        beginning: &Beginning,
        table: Option<Table<'t>>,
        precision: Precision,
    ) -> Result<Self, BeginError> {
        Ok(match precision {
            Precision::F32 => Self::Single(station(robot, beginning, table)?),
            Precision::F64 => Self::Double(station(robot, beginning, table)?),
        })
    }
}

fn station<'t, T: Countable + std::fmt::Display>(
    robot: &RobotDescription,
    beginning: &Beginning,
    table: Option<Table<'t>>,
) -> Result<Station<'t, T, IrvineCatenary<T>>, BeginError>
where
    IrvineCatenary<T>: cdpr_core::ShapedCable<T> + cdpr_core::Charted<T>,
{
    let blueprint = blueprint::<T>(robot).map_err(BeginError::Robot)?;
    if let Some(table) = table {
        return Ok(Station::from_table(blueprint, &beginning.start, table)?);
    }
    let states = beginning.states.map(|state| CableState {
        force_n: state.force_n.map(T::constant),
        rest_length_m: T::constant(state.rest_length_m),
    });
    Ok(Station::from_states(blueprint, &beginning.start, &states)?)
}

impl Controller for HostController<'_> {
    type Error = std::convert::Infallible;

    fn tick(&mut self, inputs: &Inputs) -> Result<Decision<f64>, Self::Error> {
        Ok(match self {
            Self::Single(station) => station.tick(inputs).map(f64::from),
            Self::Double(station) => station.tick(inputs),
        })
    }
}
