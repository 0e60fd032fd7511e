//! How far a solution may be from a command, with straight cables: nothing bends, so that of what a certificate adds up only
//! what cables turn is left, and what is rounded. Near singularities, and with loads far from the platform.

use cdpr_core::newton::converge;
use cdpr_core::statics::Balance;
use cdpr_core::{
    CABLES, Cable, CableModel, CableState, CurvePoint, LinearElastic, Load, Pose, Real, Robot,
    SetPoint, Tracker, TrackerSettings, Twist,
};
use cdpr_firmware_example::Number;
use cdpr_tests::random::{self, log_uniform, rounded, uniform, vector};
use cdpr_tests::random_tests;
use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};
use rand::Rng;
use rayon::prelude::*;

type Model<T> = LinearElastic<T>;

fn anywhere(rng: &mut impl Rng, sizes_m: [f64; 2]) -> Vector3<f64> {
    let size_m = log_uniform(rng, sizes_m);
    Vector3::from_fn(|_, _| rounded(uniform(rng, [-size_m, size_m])))
}

/// A platform, level at a position, that is in balance with its cables.
struct Hung {
    robot: Robot<f64, Model<f64>>,
    load: Load<f64>,
    position_m: Vector3<f64>,
    states: [CableState<f64>; CABLES],
}

fn pose<T: Real>(position_m: Vector3<f64>) -> Pose<T> {
    let level =
        UnitQuaternion::new_unchecked(Quaternion::new(T::one(), T::zero(), T::zero(), T::zero()));
    Pose::new(vector(position_m), level).expect("a pose")
}

/// Six random cables, and a load that balances them, its centre of mass up to ten metres off.
fn hung(rng: &mut impl Rng) -> Option<Hung> {
    let position_m = anywhere(rng, [0.9, 1.0]);
    let cables = std::array::from_fn(|_| Cable {
        anchor_m: anywhere(rng, [4.0, 5.0]) + Vector3::new(0.0, 0.0, 8.0),
        attachment_m: anywhere(rng, [0.9, 1.0]),
        model: LinearElastic { compliance_per_n: rounded(1e-6) },
    });
    let robot = Robot::new(cables).ok()?;
    let mut load = Load {
        mass_kg: rounded(log_uniform(rng, [0.1, 100.0])),
        center_of_mass_m: anywhere(rng, [0.01, 10.0]),
        gravity_m_s2: rounded(9.81),
        force_n: Vector3::zeros(),
        moment_nm: Vector3::zeros(),
    };
    let balance = Balance::at(&robot, &load, &pose(position_m)).ok()?;
    let states = std::array::from_fn(|i| {
        let plane = &balance.planes()[i];
        let chord_m = Vector2::new(plane.x_m, plane.z_m);
        let tension_n = log_uniform(rng, [10.0, 1000.0]);
        let stretch = 1.0 + tension_n * robot.cables()[i].model.compliance_per_n;
        CableState {
            force_n: chord_m * (tension_n / chord_m.norm()),
            rest_length_m: chord_m.norm() / stretch,
        }
    });
    let left = balance.residual_n(&states.map(|state: CableState<f64>| state.force_n));
    load.force_n = -Vector3::new(left[0], left[1], left[2]).map(rounded);
    let moment = Vector3::new(left[3], left[4], left[5]) * robot.moment_arm_m();
    load.moment_nm = -moment.map(rounded);
    Some(Hung { robot, load, position_m, states })
}

/// A tick of which no twist tells, so that its prediction is where it was: the error as a part of what is certified. `None`
/// where nothing is.
fn share<T: Number + Into<f64>>(case: u64) -> Option<f64> {
    let rng = &mut random::numbers(case);
    let hung = hung(rng)?;
    let cables = hung.robot.cables().each_ref().map(|cable| Cable {
        anchor_m: vector(cable.anchor_m),
        attachment_m: vector(cable.attachment_m),
        model: LinearElastic { compliance_per_n: T::constant(cable.model.compliance_per_n) },
    });
    let load = Load {
        mass_kg: T::constant(hung.load.mass_kg),
        center_of_mass_m: vector(hung.load.center_of_mass_m),
        gravity_m_s2: T::constant(hung.load.gravity_m_s2),
        force_n: vector(hung.load.force_n),
        moment_nm: vector(hung.load.moment_nm),
    };
    let states = hung.states.each_ref().map(|state| CableState {
        force_n: state.force_n.map(|c| T::constant(c)),
        rest_length_m: T::constant(state.rest_length_m),
    });
    let there_m = hung.position_m + anywhere(rng, [1e-5, 1e-2]);
    let there_m = there_m.map(rounded);
    let at = |position_m| SetPoint { pose: pose(position_m), twist: Twist::none() };
    let robot = Robot::new(cables).ok()?;
    let mut tracker = Tracker::start(
        robot,
        load,
        TrackerSettings::unlimited(T::constant(1e-3)),
        &at(hung.position_m),
        &states,
    )
    .ok()?;
    let command = tracker.tick(&at(there_m)).ok()?;
    let found = command.cables.each_ref().map(|cable| CableState {
        force_n: cable.force_n.map(Into::into),
        rest_length_m: cable.rest_length_m.into(),
    });
    let balance = Balance::at(&hung.robot, &hung.load, &pose(there_m)).ok()?;
    let exact = converge(&hung.robot, &balance, &found, 1e-13, 20).ok()?.step.states;
    let shares = (0..CABLES).map(|i| {
        let (plane, model) = (&balance.planes()[i], &hung.robot.cables()[i].model);
        let end = model.end_point(exact[i].force_n, exact[i].rest_length_m);
        let tangent = CurvePoint::new(&end, plane.x_m, plane.z_m).tangent;
        let along_n = tangent.dot(&(exact[i].force_n - found[i].force_n)).abs();
        let certified_n: f64 = command.certificate.existence_n[i].into();
        // What f64 leaves of the exact one.
        (along_n - 1e-10 * exact[i].force_n.norm()) / certified_n
    });
    Some(shares.fold(0.0, f64::max))
}

fn check<T: Number + Into<f64>>() {
    let cases = u64::from(random_tests(20_000).cases);
    let shares: Vec<f64> = (0..cases).into_par_iter().filter_map(share::<T>).collect();
    let largest = shares.iter().copied().fold(0.0, f64::max);
    println!("{} of {cases} certified, largest share {largest}", shares.len());
    assert!(shares.len() as u64 > cases / 10, "{}", shares.len());
    assert!(largest <= 1.0, "{largest}");
}

#[test]
fn solutions_are_as_close_as_certified_in_f64() {
    check::<f64>();
}

#[test]
fn solutions_are_as_close_as_certified_in_f32() {
    check::<f32>();
}
