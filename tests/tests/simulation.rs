//! The simulated plant against statics and energy, and what becomes of every fault.

use cdpr_core::controller::Stance;
use cdpr_core::{CABLES, CableModel, IrvineCatenary, Load, Robot, Table};
use cdpr_host_sim::enumerate::{Method, ModelKind, Options, Request};
use cdpr_host_sim::forward;
use cdpr_host_sim::problem::Precision;
use cdpr_host_sim::robot_file::RobotDescription;
use cdpr_host_sim::simulate::controller;
use cdpr_host_sim::simulate::firmware::Firmware;
use cdpr_host_sim::simulate::scenario::{Fault, TimedFault};
use cdpr_host_sim::simulate::summary::Outcome;
use cdpr_host_sim::simulate::{
    Beginning, HostController, Plant, Sample, Scenario, Simulation, Summary, Trajectory, Truth,
    Weather,
};
use cdpr_link::{Decision, Start};
use cdpr_tests::images::M4F_F32;
use nalgebra::{UnitQuaternion, Vector2, Vector3};

/// MARIONET-CRANE with the drums of the example firmware.
fn crane() -> RobotDescription {
    let mut crane = RobotDescription::marionet_crane();
    for limits in &mut crane.limits {
        (limits.max_length_m, limits.max_tension_n) = (60.0, 2000.0);
    }
    crane
}

fn truth(crane: &RobotDescription) -> Truth {
    Truth::of(crane, &Scenario::default())
}

fn level(x: f64, y: f64, z: f64) -> Stance<f64> {
    Stance { position_m: Vector3::new(x, y, z), orientation: UnitQuaternion::identity() }
}

/// Rest lengths of all proven solutions at a level pose.
fn solutions(crane: &RobotDescription, place: &Stance<f64>) -> Vec<[f64; CABLES]> {
    let request = Request {
        robot: crane.clone(),
        position_m: place.position_m.into(),
        rotation_vector_rad: [0.0; 3],
        model: ModelKind::Irvine,
    };
    let answer =
        request.enumerate(Options { method: Method::Complete, ..Options::default() }).unwrap();
    answer.solutions.iter().map(|found| found.solution.states.map(|s| s.rest_length_m)).collect()
}

fn start(place: &Stance<f64>, lengths_m: &[f64; CABLES]) -> Start {
    let q = place.orientation.as_ref();
    Start {
        position_m: place.position_m.into(),
        quaternion: [q.w, q.i, q.j, q.k],
        home_lengths_m: *lengths_m,
    }
}

fn plant(
    crane: &RobotDescription,
    truth: &Truth,
    place: &Stance<f64>,
    lengths_m: &[f64; CABLES],
) -> Plant {
    let drums = start(place, lengths_m).drums(&crane.drum()).unwrap();
    Plant::new(*truth, &crane.winch, &drums, 1e-3, place, lengths_m).unwrap()
}

/// The plant, damped, comes to rest at the pose whose proven lengths it hangs on: 1e-6 m, wherever inverse
/// kinematics has a stable solution, all taut or slack.
#[test]
fn the_plant_rests_where_inverse_kinematics_says() {
    let mut crane = crane();
    // Settles within seconds; where it settles does not depend on it.
    crane.body.cable_damping_s = 0.05;
    let mut rested = 0;
    for place in
        [level(2.0, 7.0, 2.5), level(3.28, 7.0, 2.5), level(2.0, 9.6, 2.5), level(2.0, 7.0, 1.0)]
    {
        for lengths_m in solutions(&crane, &place) {
            let truth = truth(&crane);
            let by_newton =
                forward::at_rest(&truth.robot, &crane.load, &lengths_m, &place).unwrap();
            let error_m = forward::distance_m(&by_newton.place, &place, truth.robot.moment_arm_m());
            assert!(error_m < 1e-6, "{error_m} m from {place:?}");
            if !by_newton.is_stable() {
                continue;
            }
            let mut plant = plant(&crane, &truth, &place, &lengths_m);
            let braked = Decision::disarmed(&start(&place, &lengths_m));
            // Where the slowest swing dies down within seconds it is pushed first; elsewhere it must stay.
            if rested == 0 {
                plant.set_velocity(&Vector3::new(1e-4, -1e-4, 0.5e-4));
            }
            for _ in 0..12_000 {
                plant.step(&braked, &Weather::default()).unwrap();
            }
            let motion = plant.motion();
            let error_m = (motion.place.position_m - place.position_m).norm();
            assert!(motion.velocity_m_s.norm() < 1e-6, "{motion:?}");
            assert!(error_m < 1e-6, "{error_m} m from {place:?}");
            rested += 1;
        }
    }
    assert!(rested >= 3, "{rested}");
}

/// Without damping and air, energy is only exchanged: motion, height, stretch and height of the cables. Those of the
/// cables are summed up along them, which the plant never does.
#[test]
fn energy_is_kept() {
    let mut crane = crane();
    (crane.body.cable_damping_s, crane.body.drag_area_m2) = (0.0, 0.0);
    crane.load.center_of_mass_m = Vector3::new(0.02, -0.03, -0.1);
    let place = level(2.0, 7.0, 2.5);
    let lengths_m = solutions(&crane, &place)[0];
    let truth = truth(&crane);
    let mut plant = plant(&crane, &truth, &place, &lengths_m);
    plant.set_velocity(&Vector3::new(0.3, -0.2, 0.1));
    let braked = Decision::disarmed(&start(&place, &lengths_m));
    let energy_j = |plant: &Plant| {
        let motion = plant.motion();
        let turn = motion.place.orientation;
        let height_m = motion.place.position_m.z + (turn * truth.center_of_mass_m).z;
        let spin = motion.angular_rad_s;
        let moving = 0.5 * truth.mass_kg * motion.velocity_m_s.norm_squared()
            + 0.5 * spin.dot(&truth.inertia_kg_m2.component_mul(&spin));
        let cables: f64 = (0..CABLES)
            .map(|i| {
                let cable = &truth.robot.cables()[i];
                let span = motion.place.position_m + turn * cable.attachment_m - cable.anchor_m;
                cable_energy_j(&cable.model, span.x.hypot(span.y), span.z, lengths_m[i])
            })
            .sum();
        (moving, moving + truth.mass_kg * truth.gravity_m_s2 * height_m + cables)
    };
    let (most_moving, at_start) = energy_j(&plant);
    let mut exchanged: f64 = 0.0;
    for _ in 0..40 {
        for _ in 0..50 {
            plant.step(&braked, &Weather::default()).unwrap();
        }
        let (moving, all) = energy_j(&plant);
        exchanged = exchanged.max(most_moving - moving);
        // A step is wrong by 1e-7 in the state at most: in 2000 of them 2e-4 of the motion, if all erred alike.
        assert!(
            (all - at_start).abs() < 2e-4 * most_moving,
            "{all} J after {at_start} J, {most_moving} J of it moving"
        );
    }
    assert!(exchanged > 0.5 * most_moving);
}

/// Energy of a hanging cable above its anchor: stretch and height, by the trapezoidal rule along it.
fn cable_energy_j(model: &IrvineCatenary<f64>, x_m: f64, z_m: f64, length_m: f64) -> f64 {
    const PARTS: usize = 4000;
    let force_n = model.force_at_length(x_m, z_m, length_m).unwrap().force_n;
    let h = length_m / PARTS as f64;
    let at = |i: usize| {
        let along =
            Vector2::new(force_n.x, force_n.y - model.weight_n_m * (length_m - i as f64 * h));
        let tension_n = along.norm();
        let stretch = 0.5 * tension_n * tension_n * model.compliance_per_n;
        (stretch, along.y * (model.compliance_per_n + 1.0 / tension_n))
    };
    let (mut height_m, mut energy) = (0.0, 0.0);
    for i in 0..PARTS {
        let ((stretch, slope), (next_stretch, next_slope)) = (at(i), at(i + 1));
        let next_m = height_m + 0.5 * h * (slope + next_slope);
        energy += 0.5 * h * (stretch + next_stretch + model.weight_n_m * (height_m + next_m));
        height_m = next_m;
    }
    assert!((height_m - z_m).abs() < 1e-5);
    energy
}

/// The load cells show what forward kinematics has at the anchors.
#[test]
fn tensions_at_rest_are_those_of_the_solution() {
    let crane = crane();
    let place = level(2.0, 7.0, 2.5);
    let lengths_m = solutions(&crane, &place)[0];
    let truth = truth(&crane);
    let plant = plant(&crane, &truth, &place, &lengths_m);
    let rest = forward::at_rest(&truth.robot, &crane.load, &lengths_m, &place).unwrap();
    for (i, tension_n) in plant.tensions_n().iter().enumerate() {
        let f = rest.forces_n[i];
        let anchor_n = f.x.hypot(f.y - truth.robot.cables()[i].model.weight_n_m * lengths_m[i]);
        assert!((tension_n - anchor_n).abs() < 1e-6 * anchor_n, "cable {i}");
    }
}

/// What is found around a pose are places at rest, all different, the pose itself first.
#[test]
fn places_to_rest_near_are_different_and_at_rest() {
    let crane = crane();
    let truth = truth(&crane);
    let place = level(2.0, 7.0, 2.5);
    let lengths_m = solutions(&crane, &place)[0];
    let load: Load<f64> = crane.load;
    let near = forward::at_rest_near(&truth.robot, &load, &lengths_m, &place, 1.5, 200).unwrap();
    assert!(forward::distance_m(&near[0].place, &place, 1.0) < 1e-9);
    for (i, one) in near.iter().enumerate() {
        assert!(residual_n(&truth.robot, &load, &lengths_m, &one.place) < 1e-6);
        for other in &near[..i] {
            assert!(forward::distance_m(&one.place, &other.place, 1.0) > 1e-7);
        }
    }
}

/// Force and moment left over at a place, the moment about the world origin: from scratch.
fn residual_n(
    robot: &Robot<f64, IrvineCatenary<f64>>,
    load: &Load<f64>,
    lengths_m: &[f64; CABLES],
    place: &Stance<f64>,
) -> f64 {
    let weight = Vector3::new(0.0, 0.0, -load.mass_kg * load.gravity_m_s2);
    let (mut force, mut moment) = (weight, place.position_m.cross(&weight));
    for (cable, length_m) in robot.cables().iter().zip(lengths_m) {
        let end = place.position_m + place.orientation * cable.attachment_m;
        let span = end - cable.anchor_m;
        let x_m = span.x.hypot(span.y);
        let f = cable.model.force_at_length(x_m, span.z, *length_m).unwrap().force_n;
        let pull = -Vector3::new(f.x * span.x / x_m, f.x * span.y / x_m, f.y);
        force += pull;
        moment += end.cross(&pull);
    }
    force.norm().max((moment - place.position_m.cross(&force)).norm())
}

/// From (2, 7, 2.5) to (2.3, 8, 2.6) and back in eight seconds, from rest to rest.
fn there_and_back() -> Trajectory {
    let text = include_str!("../../host-sim/trajectories/there-and-back.csv");
    Trajectory::parse(text, "there-and-back.csv").unwrap()
}

/// Runs it with this scenario.
fn run(scenario: &Scenario, precision: Precision) -> Summary {
    let (crane, trajectory) = (crane(), there_and_back());
    let beginning = Beginning::at(&crane, &trajectory, None).unwrap();
    let controller = HostController::start(&crane, &beginning, None, precision).unwrap();
    let mut simulation =
        Simulation::new(&crane, &trajectory, scenario, &beginning, controller).unwrap();
    let mut summary = Summary::new(crane.control.period_s);
    while let Some(sample) = simulation.step().unwrap() {
        let sample: Sample = sample;
        summary.add(&sample);
        if summary.ticks % 10 == 1 {
            let error = simulation.pose_error(&sample);
            summary.look(&sample, error.as_ref());
        }
    }
    summary.close(simulation.is_finished(), simulation.stops());
    summary
}

fn with(faults: &[(f64, f64, Fault)]) -> Scenario {
    let timed =
        |&(from_s, until_s, fault): &(f64, f64, Fault)| TimedFault { from_s, until_s, fault };
    Scenario { faults: faults.iter().map(timed).collect(), ..Scenario::default() }
}

fn says(summary: &Summary, what: &str) -> bool {
    summary.events.iter().any(|(_, note)| note.contains(what))
}

#[test]
fn with_exact_parameters_the_static_error_is_below_a_millimetre() {
    for precision in [Precision::F32, Precision::F64] {
        let summary = run(&with(&[]), precision);
        assert_eq!(summary.outcome, Outcome::Tracked, "{summary:?}");
        assert!(summary.static_m.largest < 1e-3, "{:?}", summary.static_m);
        // The dynamic part is reported; it is there.
        assert!(summary.dynamic_m.largest > 1e-4, "{:?}", summary.dynamic_m);
        // Rounding of f32, and nothing else: 4e-6 m of length times the condition.
        let most = if precision == Precision::F32 { 1e-4 } else { 1e-9 };
        assert!(summary.model_m.largest < most, "{:?}", summary.model_m);
        let ticks: u64 = summary.ticks_in.iter().sum();
        assert_eq!(ticks, summary.ticks);
    }
}

/// Cables ten per cent off show in the part of the error that is theirs.
#[test]
fn wrong_cables_are_reported() {
    let mut heavy = with(&[]);
    heavy.linear_density_factor = 1.1;
    let mut soft = with(&[]);
    soft.axial_stiffness_factor = 0.9;
    for scenario in [heavy, soft] {
        let summary = run(&scenario, Precision::F32);
        assert!(summary.outcome.is_at_end());
        assert!(summary.model_m.largest > 3e-4, "{:?}", summary.model_m);
        assert!(summary.static_m.largest > 3e-4, "{:?}", summary.static_m);
    }
}

#[test]
fn every_fault_ends_in_a_stated_outcome() {
    const FOR_EVER: f64 = f64::INFINITY;
    let push = Fault::Push { force_n: Vector3::new(0.0, 60.0, 0.0), moment_nm: Vector3::zeros() };
    let cases: [(Fault, f64, &[Outcome], &str); 8] = [
        (Fault::WinchStuck(2), FOR_EVER, &[Outcome::Stopped], "cable 3: "),
        (
            Fault::WinchSlow { winch: 5, speed_m_s: 0.01 },
            FOR_EVER,
            &[Outcome::Stopped, Outcome::Degraded],
            "",
        ),
        (Fault::EncoderStuck(2), FOR_EVER, &[Outcome::Stopped], "cable 3: "),
        (Fault::EncoderParity(2), FOR_EVER, &[Outcome::Stopped], "winch 3 has failed"),
        (Fault::Dropout, FOR_EVER, &[Outcome::Held], "no set-point"),
        (Fault::EmergencyStop, 1.0, &[Outcome::Stopped], "emergency stop"),
        (Fault::Payload { mass_kg: 95.0 }, FOR_EVER, &[Outcome::Degraded], ""),
        (push, 0.5, &[Outcome::Tracked, Outcome::Degraded], ""),
    ];
    for (fault, for_s, outcomes, words) in cases {
        let summary = run(&with(&[(1.5, 1.5 + for_s, fault)]), Precision::F32);
        assert!(outcomes.contains(&summary.outcome), "{fault:?}: {:?}", summary.outcome);
        assert!(says(&summary, words), "{fault:?}: {:?}", summary.events);
    }
}

/// With an operator all goes on, and ends where it should.
#[test]
fn an_operator_brings_it_to_the_end() {
    for fault in [Fault::EmergencyStop, Fault::Dropout, Fault::EncoderParity(4)] {
        let scenario = Scenario { operator_waits_s: Some(0.3), ..with(&[(1.5, 2.5, fault)]) };
        let summary = run(&scenario, Precision::F32);
        assert_eq!(summary.outcome, Outcome::Degraded, "{fault:?}: {:?}", summary.events);
        assert!(summary.stops >= 1);
    }
}

/// The same seed gives the same run to the bit, another one does not.
#[test]
fn noise_has_a_seed() {
    let noisy = |seed| {
        let scenario = Scenario {
            seed,
            gust_m_s: 2.0,
            tension_noise_n: 1.0,
            encoder_noise_counts: 2.0,
            winches_off_m: 0.002,
            ..with(&[])
        };
        run(&scenario, Precision::F32)
    };
    let (one, same, other) = (noisy(1), noisy(1), noisy(2));
    assert!(one.outcome.is_at_end());
    assert_eq!(one.total_m, same.total_m);
    assert_ne!(one.total_m, other.total_m);
}

/// The same code on the host and in QEMU, against the same plant: all that the motors are told is the same to the bit,
/// emergency stop and recovery included.
#[test]
fn the_firmware_closes_the_loop_as_the_host_does() {
    let mut crane = crane();
    for limits in &mut crane.limits {
        limits.max_length_m = 50.0; // as the image has it
    }
    let bytes = cdpr_firmware_example::robot::TABLE;
    let trajectory =
        Trajectory::parse("time_s,x_m,y_m,z_m\n0,2,7,2.5\n1.2,2.05,7.1,2.55\n", "short.csv")
            .unwrap();
    let stop = [(0.4, 0.5, Fault::EmergencyStop)];
    let scenario = Scenario { operator_waits_s: Some(0.1), tension_noise_n: 1.0, ..with(&stop) };
    let table = Table::open(bytes).unwrap();
    let beginning = Beginning::at(&crane, &trajectory, Some(&table)).unwrap();

    let host = HostController::start(&crane, &beginning, Some(table), Precision::F32).unwrap();
    let mut firmware = Firmware::launch(M4F_F32.machine, &M4F_F32.build("in_the_loop")).unwrap();
    let theirs = firmware.start(&beginning.start).unwrap();
    let ours = cdpr_link::Identity::of(&controller::blueprint::<f32>(&crane).unwrap());
    assert_eq!(ours.differs_in(&theirs), None);

    let mut on_host = Simulation::new(&crane, &trajectory, &scenario, &beginning, host).unwrap();
    let mut in_qemu =
        Simulation::new(&crane, &trajectory, &scenario, &beginning, firmware).unwrap();
    let mut ticks = 0;
    loop {
        let (one, other) = (on_host.step().unwrap(), in_qemu.step().unwrap());
        let (Some(one), Some(other)) = (&one, &other) else {
            assert!(one.is_none() && other.is_none());
            break;
        };
        assert_eq!(one.decision, other.decision, "at {} s", one.time_s);
        assert_eq!(one.place, other.place);
        ticks += 1;
    }
    assert!(on_host.is_finished() && on_host.stops() == 1, "after {ticks} ticks");
}
