//! What a controller does at every tick: a new pose, and Newton steps from the last solution.

use core::fmt::{self, Display};

use cdpr_core::statics::Balance;
use cdpr_core::{GeometryFault, NewtonStep, Pose, StepFault};
use nalgebra::{UnitQuaternion, Vector3};

use crate::board::{Counter, print_line};
use crate::robot;

/// Relative rounding error of a rest length: it hardly depends on the statics, so that only the
/// rounding of the coordinates and of the end-point map counts. Over 400 directions of the move it
/// was at most 2.2 units.
const LENGTH_ROUNDING: f32 = 4.0 * f32::EPSILON;

/// Why the run has failed.
pub(crate) enum Fault {
    /// The constants of the robot are wrong.
    Geometry(GeometryFault),
    /// A Newton step was refused.
    Step(StepFault),
    /// This is not what it should be.
    Inaccurate(&'static str),
}

impl Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Geometry(fault) => fault.fmt(f),
            Self::Step(fault) => fault.fmt(f),
            Self::Inaccurate(what) => write!(f, "{what}, by more than rounding explains"),
        }
    }
}

impl From<GeometryFault> for Fault {
    fn from(fault: GeometryFault) -> Self {
        Self::Geometry(fault)
    }
}

impl From<StepFault> for Fault {
    fn from(fault: StepFault) -> Self {
        Self::Step(fault)
    }
}

/// Moves the platform by 1 mm, follows with two Newton steps, prints and checks the outcome.
///
/// # Errors
/// [`Fault`].
pub(crate) fn run(counter: &Counter) -> Result<(), Fault> {
    let robot = robot::crane()?;
    let level = |position_m: Vector3<f32>| Pose::new(position_m, UnitQuaternion::identity());
    let before = Balance::at(&robot, &robot::LOAD, &level(robot::START_POSITION_M)?)?;

    let pose = level(robot::NEXT_POSITION_M)?;
    let (balance, balance_cost) = counter.count(|| before.at_next(&robot, &robot::LOAD, &pose));
    let balance = balance?;
    let (first, _) = counter.count(|| NewtonStep::new(&robot, &balance, &robot::START));
    let first = first?;
    let (second, step_cost) = counter.count(|| NewtonStep::new(&robot, &balance, &first.states));
    let second = second?;
    let condition = second.condition();

    print_line!("cable  rest length, m");
    for (i, state) in second.states.iter().enumerate() {
        print_line!("{:5}  {:.6}", i + 1, state.rest_length_m);
    }
    for (name, step) in [("first", &first), ("second", &second)] {
        print_line!(
            "{name} step: closure {:.1e} m, relative change {:.1e}",
            step.closure_m,
            step.relative_change
        );
    }
    print_line!("condition: {condition:.1}");
    print_line!("instructions: {balance_cost} for the balance at a pose, {step_cost} for a step");

    check(&second, condition)
}

/// Compares what the last step found with the solution made on a host.
fn check(step: &NewtonStep<f32>, condition: f32) -> Result<(), Fault> {
    // Equations whose coefficients are rounded have a solution that is uncertain by the rounding
    // unit times their condition: 7e-6 here, and the first step is 1e-3. What that one leaves over
    // in exact arithmetic is of second order, at most 1.6e-7 over the directions of the move.
    let rounding = f32::EPSILON * condition;
    require(step.relative_change <= rounding, "a second step that changes the solution")?;
    for (found, expected) in step.states.iter().zip(&robot::NEXT) {
        let length_error_m = (found.rest_length_m - expected.rest_length_m).abs();
        let length_bound_m = LENGTH_ROUNDING * expected.rest_length_m;
        require(length_error_m <= length_bound_m, "a wrong rest length")?;
        let force_error_n = (found.force_n - expected.force_n).amax();
        require(force_error_n <= rounding * expected.tension_at_attachment_n(), "a wrong force")?;
    }
    Ok(())
}

fn require(right: bool, otherwise: &'static str) -> Result<(), Fault> {
    if right { Ok(()) } else { Err(Fault::Inaccurate(otherwise)) }
}
