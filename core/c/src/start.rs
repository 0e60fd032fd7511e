//! A start without any table of solutions: from the rest lengths that the encoders tell.
//!
//! Measured lengths alone give no usable forces: 1 mm of a 10 m steel cable is a hundred newtons. But
//! they tell which cables are taut and which hang slack, and so which of the equilibria of the pose
//! this one is. Each cable by itself has a force at its measured length; from these six forces
//! Newton's method goes to the equilibrium. It goes there well from cables that are too taut, whose
//! tangents point along the chords as those of the solution do, and badly from cables that are
//! too slack; so further attempts shorten all cables, by up to the tolerance of the measurement.

use cdpr_core::newton::converge;
use cdpr_core::statics::Balance;
use cdpr_core::{CABLES, CableModel, CableState, Real, Robot};

use crate::status::{Code, Status};

/// How much the cables are shortened in one attempt after the other, times the tolerance.
const SHORTENINGS: [f64; 5] = [0.0, 1.0, 0.5, 0.25, 0.125];

/// Newton steps of an attempt.
const STEPS: u32 = 20;

/// The equilibrium whose rest lengths are within `tolerance_m` of the measured ones.
///
/// Cost bound: five attempts of six single cables and twenty Newton steps.
pub(crate) fn from_lengths<T: Real, M: CableModel<T>>(
    robot: &Robot<T, M>,
    balance: &Balance<T>,
    lengths_m: &[T; CABLES],
    tolerance_m: T,
) -> Result<[CableState<T>; CABLES], Status<T>> {
    let measured = |length_m: T| length_m > T::zero() && length_m.is_finite();
    if !measured(tolerance_m) {
        return Err(Status::refusal(Code::InvalidMeasurement));
    }
    if let Some(i) = lengths_m.iter().position(|length_m| !measured(*length_m)) {
        return Err(Status::refusal(Code::InvalidMeasurement).of_cable(i));
    }
    let mut nearest = (None, T::HUGE);
    for shortening in SHORTENINGS.map(|part| T::constant(part) * tolerance_m) {
        let Some(states) = single_cables(robot, balance, lengths_m, shortening) else { continue };
        // The tracker polishes; each step squares the change.
        let Ok(found) = converge(robot, balance, &states, T::EPSILON * T::constant(1e3), STEPS)
        else {
            continue;
        };
        let (cable, error_m) = furthest(&found.step.states, lengths_m);
        if error_m <= tolerance_m {
            return Ok(found.step.states);
        }
        if error_m < nearest.1 {
            nearest = (Some(cable), error_m);
        }
    }
    let failure = Status::refusal(Code::NoSolutionNearLengths);
    Err(match nearest {
        (Some(cable), error_m) => failure.of_cable(cable).of_value(error_m),
        (None, _) => failure,
    })
}

/// Each cable by itself, shorter than measured.
fn single_cables<T: Real, M: CableModel<T>>(
    robot: &Robot<T, M>,
    balance: &Balance<T>,
    lengths_m: &[T; CABLES],
    shortening_m: T,
) -> Option<[CableState<T>; CABLES]> {
    let mut states = lengths_m.map(|length_m| CableState {
        force_n: [T::zero(); 2].into(),
        rest_length_m: length_m - shortening_m,
    });
    for ((state, plane), cable) in states.iter_mut().zip(balance.planes()).zip(robot.cables()) {
        let line = cable.model.force_at_length(plane.x_m, plane.z_m, state.rest_length_m);
        state.force_n = line.ok()?.force_n;
    }
    Some(states)
}

/// The cable that is the furthest from its measured length, and by how much, m.
fn furthest<T: Real>(states: &[CableState<T>; CABLES], lengths_m: &[T; CABLES]) -> (usize, T) {
    let mut furthest = (0, T::zero());
    for (i, (state, length_m)) in states.iter().zip(lengths_m).enumerate() {
        let error_m = (state.rest_length_m - *length_m).abs();
        if error_m > furthest.1 {
            furthest = (i, error_m);
        }
    }
    furthest
}
