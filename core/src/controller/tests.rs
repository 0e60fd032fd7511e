//! The states of a controller of MARIONET-CRANE in f32, with ideal and with bad winches.

#![allow(clippy::float_cmp)] // lengths and positions are handed on, not reckoned again

extern crate alloc;

use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;

use nalgebra::{UnitQuaternion, Vector2, Vector3};
use proptest::prelude::*;

use super::monitor::Warning;
use super::*;
use crate::{Cable, CableLimits, IrvineCatenary, Twist};

const ANCHORS_M: [[f32; 3]; CABLES] = [
    [-3.259, -0.475, 8.826],
    [9.421, -3.482, 11.555],
    [9.538, 3.797, 11.533],
    [5.570, 20.414, 8.704],
    [-2.505, 16.810, 8.649],
    [-3.342, 9.421, 8.788],
];
const ATTACHMENTS_M: [[f32; 3]; CABLES] = [
    [-0.10, -0.93, -0.03],
    [0.10, -0.93, -0.03],
    [0.27, 0.50, -0.07],
    [0.27, 0.50, -0.07],
    [-0.27, 0.50, -0.07],
    [-0.27, 0.50, -0.07],
];
/// Rest length, m, and force, N, of each cable at [`HOME_M`], level.
const START: [[f32; 3]; CABLES] = [
    [10.479_832, 155.414_69, -114.487_35],
    [15.077_343, 179.357_76, -129.583_59],
    [12.221_567, 131.308_53, -141.830_1],
    [14.731_523, 166.606_8, -72.739_22],
    [11.970_178, 129.781_62, -74.298_386],
    [8.355_886, 125.545_906, -143.951_37],
];
const HOME_M: [f32; 3] = [2.0, 7.0, 2.5];
const PERIOD_S: f32 = 1e-3;
const FASTEST_M_S: f32 = 2.0;
const HALT_TICKS: u32 = 40;
const BRAKE_TICKS: u32 = 5;

type Crane = Controller<f32, IrvineCatenary<f32>, 16>;

fn limits() -> MotionLimits<f32> {
    MotionLimits {
        distance_m: 1.0,
        speed_m_s: 0.5,
        acceleration_m_s2: 4.0,
        jerk_m_s3: 200.0,
        turn_speed_rad_s: 0.5,
        turn_acceleration_rad_s2: 4.0,
        turn_jerk_rad_s3: 200.0,
    }
}

fn settings() -> ControllerSettings<f32> {
    ControllerSettings {
        motion: limits(),
        halt_ticks: HALT_TICKS,
        stream_ticks: None,
        align_speed_m_s: 0.1,
        align_reach_m: 0.05,
        align_tolerance_m: 1e-3,
        settle_ticks: 20,
        following_m: 0.02,
        brake_ticks: BRAKE_TICKS,
        brake_after_ticks: None,
    }
}

fn tracker_settings() -> TrackerSettings<f32> {
    let cable = CableLimits {
        shortest_m: 1.0,
        longest_m: 30.0,
        fastest_m_s: FASTEST_M_S,
        lowest_tension_n: 1.0,
        highest_tension_n: 5000.0,
    };
    TrackerSettings {
        period_s: PERIOD_S,
        largest_move_m: 0.01,
        least_distance: 1e-4,
        fold_horizon_s: 0.05,
        largest_error_n: 1.0,
        cables: [cable; CABLES],
    }
}

fn home() -> Stance<f32> {
    Stance { position_m: HOME_M.into(), orientation: UnitQuaternion::identity() }
}

fn start(
    tracker: TrackerSettings<f32>,
    settings: ControllerSettings<f32>,
) -> Result<Crane, StartFault<f32>> {
    let robot = Robot::new(core::array::from_fn(|i| Cable {
        anchor_m: ANCHORS_M[i].into(),
        attachment_m: ATTACHMENTS_M[i].into(),
        model: IrvineCatenary { weight_n_m: 0.079 * 9.81, compliance_per_n: 1.0 / 1.256_637e6 },
    }))
    .unwrap();
    let load = Load {
        mass_kg: 69.0,
        center_of_mass_m: Vector3::zeros(),
        gravity_m_s2: 9.81,
        force_n: Vector3::zeros(),
        moment_nm: Vector3::zeros(),
    };
    let states = START
        .map(|[rest_length_m, fx, fz]| CableState { force_n: Vector2::new(fx, fz), rest_length_m });
    Controller::start(robot, load, tracker, settings, home(), &states)
}

/// A stop at `offset_m` from home.
fn stop_at(offset_m: [f32; 3], duration_s: f32) -> WayPoint<f32> {
    let mut stance = home();
    stance.position_m += Vector3::from(offset_m);
    WayPoint::stop(stance, Pace::Duration(duration_s))
}

fn through(offset_m: [f32; 3], velocity_m_s: [f32; 3], duration_s: f32) -> WayPoint<f32> {
    let twist = Twist { linear_m_s: velocity_m_s.into(), angular_rad_s: Vector3::zeros() };
    WayPoint { twist, ..stop_at(offset_m, duration_s) }
}

/// A controller with winches that do what they are told, unless the readings are tampered with.
struct Rig {
    controller: Crane,
    readings: Readings<f32>,
    queue: VecDeque<WayPoint<f32>>,
    brakes_released: bool,
}

impl Rig {
    fn new(settings: ControllerSettings<f32>) -> Self {
        Self {
            controller: start(tracker_settings(), settings).unwrap(),
            readings: Readings {
                rest_lengths_m: START.map(|[length, ..]| length),
                failed_winch: None,
                emergency_stop: false,
            },
            queue: VecDeque::new(),
            brakes_released: false,
        }
    }

    /// Armed and aligned.
    fn holding(settings: ControllerSettings<f32>) -> Self {
        let mut rig = Self::new(settings);
        rig.controller.arm(&rig.readings).unwrap();
        rig.until(State::Holding);
        rig
    }

    /// Half a second on the way to 0.2 m along x.
    fn tracking(settings: ControllerSettings<f32>) -> Self {
        let mut rig = Self::holding(settings);
        rig.queue.push_back(stop_at([0.2, 0.0, 0.0], 1.0));
        rig.run(500);
        assert_eq!(rig.state(), State::Tracking);
        rig
    }

    fn state(&self) -> State<f32> {
        self.controller.state()
    }

    fn tick(&mut self) -> Outputs<f32> {
        let outputs = self.controller.tick(&self.readings, || self.queue.pop_front());
        if let Some(targets) = outputs.targets {
            self.readings.rest_lengths_m = targets.map(|target| target.rest_length_m);
        }
        self.brakes_released = outputs.brakes_released;
        outputs
    }

    fn run(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    fn until(&mut self, state: State<f32>) -> u32 {
        for ticks in 1..5000 {
            self.tick();
            if self.state() == state {
                return ticks;
            }
        }
        panic!("stays {}", self.state());
    }

    fn x_m(&self) -> f32 {
        self.controller.stance().position_m.x - HOME_M[0]
    }

    fn last_halt(&self) -> Option<Halt<f32>> {
        let halts = self.controller.events().iter().filter_map(|event| match event.kind {
            EventKind::Halted(halt) => Some(halt),
            _ => None,
        });
        halts.last()
    }
}

#[test]
fn wrong_settings_do_not_start() {
    assert!(start(tracker_settings(), settings()).is_ok());
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let fault = |settings| start(tracker_settings(), settings).map(|_| ()).unwrap_err();
        let named = |name| StartFault::Setting(SettingFault(name));
        let motion = MotionLimits { jerk_m_s3: bad, ..limits() };
        assert_eq!(fault(ControllerSettings { motion, ..settings() }), named("motion"));
        assert_eq!(
            fault(ControllerSettings { align_speed_m_s: bad, ..settings() }),
            named("align_speed_m_s")
        );
        assert_eq!(
            fault(ControllerSettings { following_m: bad, ..settings() }),
            named("following_m")
        );
        let tracker = TrackerSettings { period_s: bad, ..tracker_settings() };
        assert_eq!(start(tracker, settings()).map(|_| ()).unwrap_err(), named("period_s"));
    }
    let never = ControllerSettings { halt_ticks: 0, ..settings() };
    assert!(start(tracker_settings(), never).is_err());
}

#[test]
fn arms_aligns_and_holds() {
    let mut rig = Rig::new(settings());
    let outputs = rig.tick();
    assert_eq!((rig.state(), outputs.brakes_released), (State::Disarmed, false));
    assert_eq!(outputs.targets, None);
    for (i, length_m) in rig.readings.rest_lengths_m.iter_mut().enumerate() {
        *length_m += 0.01 * (i as f32 - 2.0); // -0.02 to 0.03 m
    }
    rig.controller.arm(&rig.readings).unwrap();
    let begin_m = rig.readings.rest_lengths_m;
    // Nothing moves before the brakes are open.
    for _ in 0..BRAKE_TICKS {
        let outputs = rig.tick();
        assert!(outputs.brakes_released);
        assert_eq!(
            outputs.targets.unwrap().map(|t| (t.rest_length_m, t.rate_m_s)),
            begin_m.map(|l| (l, 0.0))
        );
    }
    let mut last_m = begin_m;
    let mut ticks = 0;
    while rig.state() == State::Aligning {
        let targets = rig.tick().targets.unwrap();
        for (target, last_m) in targets.iter().zip(&mut last_m) {
            assert!(target.rate_m_s.abs() <= 0.1001);
            // Rounding of 15 m.
            assert!((target.rest_length_m - *last_m).abs() <= 0.1001e-3 + 2e-6);
            *last_m = target.rest_length_m;
        }
        ticks += 1;
        assert!(ticks < 1000);
    }
    // 15/8 0.03 m / 0.1 m/s, a tick for rounding up and one to see it.
    assert!((563..=565).contains(&ticks), "{ticks}");
    assert_eq!(rig.state(), State::Holding);
    assert_eq!(last_m, rig.controller.tracker().command().cables.map(|c| c.rest_length_m));
    let outputs = rig.tick();
    assert!(outputs.brakes_released && outputs.targets.unwrap().iter().all(|t| t.rate_m_s == 0.0));
}

#[test]
fn does_not_arm_when_something_is_wrong() {
    let mut rig = Rig::new(settings());
    let good = rig.readings;
    let persists = Refusal::Persists;
    let mut far = good;
    far.rest_lengths_m[4] += 0.06;
    assert!(matches!(
        rig.controller.arm(&far),
        Err(Refusal::TooFarToAlign { cable: 4, error_m }) if (error_m - 0.06).abs() < 1e-3
    ));
    let mut bad = good;
    bad.rest_lengths_m[2] = f32::NAN;
    assert_eq!(rig.controller.arm(&bad), Err(persists(Cause::NonFiniteReading(2))));
    let stopped = Readings { emergency_stop: true, ..good };
    assert_eq!(rig.controller.arm(&stopped), Err(persists(Cause::EmergencyStop)));
    let failed = Readings { failed_winch: Some(3), ..good };
    assert_eq!(rig.controller.arm(&failed), Err(persists(Cause::WinchFailed(3))));
    assert_eq!(rig.state(), State::Disarmed);
    rig.controller.arm(&good).unwrap();
}

#[test]
fn every_request_is_refused_where_it_makes_no_sense() {
    let mut disarmed = Rig::new(settings());
    disarmed.tick();
    let mut aligning = Rig::new(settings());
    aligning.controller.arm(&aligning.readings).unwrap();
    aligning.tick();
    let mut fault = Rig::holding(settings());
    fault.readings.emergency_stop = true;
    fault.tick();
    let rigs = [disarmed, aligning, Rig::holding(settings()), Rig::tracking(settings()), fault];
    //                 arm disarm stop resume cancel acknowledge
    let granted = [
        [true, false, false, false, false, false],
        [false, true, false, false, false, false],
        [false, true, false, false, false, false],
        [false, false, true, false, false, false],
        [false, false, false, false, false, true],
    ];
    for (rig, granted) in rigs.iter().zip(granted) {
        for (request, granted) in granted.into_iter().enumerate() {
            let mut controller = rig.controller.clone();
            let readings = Readings { emergency_stop: false, ..rig.readings };
            let before = (controller.state(), controller.events().iter().count());
            let outcome = match request {
                0 => controller.arm(&readings),
                1 => controller.disarm(),
                2 => controller.stop(),
                3 => controller.resume(),
                4 => controller.cancel(),
                _ => controller.acknowledge(&readings),
            };
            assert_eq!(outcome.is_ok(), granted, "{request} while {}: {outcome:?}", before.0);
            if let Err(refusal) = outcome {
                let expected = match (before.0, request) {
                    (State::Holding, 3 | 4) => Refusal::NotHalted,
                    (state, _) => Refusal::NotNow(state),
                };
                assert_eq!(refusal, expected);
                assert_eq!((controller.state(), controller.events().iter().count()), before);
            }
        }
    }
}

#[test]
fn a_winch_that_does_not_get_there_is_a_fault() {
    let mut rig = Rig::new(settings());
    rig.readings.rest_lengths_m[1] += 0.01;
    rig.controller.arm(&rig.readings).unwrap();
    let stuck_m = rig.readings.rest_lengths_m[1];
    for _ in 0..1000 {
        rig.tick();
        rig.readings.rest_lengths_m[1] = stuck_m;
    }
    let State::Fault(Cause::NotAligned { cable: 1, error_m }) = rig.state() else {
        panic!("{}", rig.state());
    };
    assert!((error_m - 0.01).abs() < 1e-5);
    assert!(!rig.brakes_released);
}

#[test]
fn disarms_from_aligning_and_holding() {
    let mut rig = Rig::new(settings());
    rig.controller.arm(&rig.readings).unwrap();
    rig.tick();
    rig.controller.disarm().unwrap();
    rig.tick();
    assert_eq!((rig.state(), rig.brakes_released), (State::Disarmed, false));
    let mut rig = Rig::holding(settings());
    rig.controller.disarm().unwrap();
    rig.tick();
    assert_eq!((rig.state(), rig.brakes_released), (State::Disarmed, false));
}

#[test]
fn follows_way_points_and_arrives() {
    let mut rig = Rig::holding(settings());
    rig.queue.push_back(through([0.1, 0.05, 0.0], [0.2, 0.0, 0.05], 0.8));
    let mut end = stop_at([0.3, 0.05, 0.1], 1.2);
    end.stance.orientation = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 0.1));
    rig.queue.push_back(end);
    // One tick to start, 800 and 1200 on the way; the last of them arrives.
    assert_eq!(rig.until(State::Tracking), 1);
    assert_eq!(rig.until(State::Holding), 1999);
    let stance = rig.controller.stance();
    assert!((stance.position_m - end.stance.position_m).amax() < 1e-6);
    assert!(stance.orientation.angle_to(&end.stance.orientation) < 1e-3); // acos near 1
    assert!(!rig.controller.is_halted());
    // Back at as much as half the limits.
    rig.queue.push_back(WayPoint::stop(home(), Pace::Share(0.5)));
    rig.until(State::Tracking);
    rig.until(State::Holding);
    assert!((rig.controller.stance().position_m - home().position_m).amax() < 1e-6);
    for (now, [length_m, ..]) in rig.readings.rest_lengths_m.iter().zip(START) {
        assert!((now - length_m).abs() < 1e-4, "{now} {length_m}"); // the branch is the same
    }
}

#[test]
fn a_bad_way_point_is_refused_and_the_motion_goes_on() {
    let mut rig = Rig::tracking(settings());
    for bad in [
        stop_at([f32::NAN, 0.0, 0.0], 1.0),
        stop_at([0.2, 1.5, 0.0], 100.0),
        stop_at([0.2, 0.5, 0.0], 0.1),
    ] {
        rig.queue.push_back(bad);
    }
    rig.queue.push_back(stop_at([0.2, 0.1, 0.0], 0.6));
    rig.run(4);
    let refused: Vec<_> = rig
        .controller
        .events()
        .iter()
        .filter_map(|event| match event.kind {
            EventKind::Refused(fault) => Some(fault),
            _ => None,
        })
        .collect();
    assert!(matches!(
        refused[..],
        [MotionFault::NonFinite, MotionFault::TooFar { .. }, MotionFault::TooFast { .. }]
    ));
    assert_eq!(rig.state(), State::Tracking);
    rig.until(State::Holding);
    assert!((rig.controller.stance().position_m.y - HOME_M[1] - 0.1).abs() < 1e-6);
}

#[test]
fn stops_resumes_and_cancels() {
    let mut rig = Rig::tracking(settings());
    rig.queue.push_back(stop_at([0.2, 0.1, 0.0], 0.6));
    rig.controller.stop().unwrap();
    assert_eq!(rig.until(State::Holding), HALT_TICKS);
    assert!(rig.controller.is_halted() && rig.last_halt() == Some(Halt::Asked));
    let halted_m = rig.x_m();
    assert!(halted_m > 0.1 && halted_m < 0.12, "{halted_m}");
    rig.run(50);
    assert_eq!((rig.state(), rig.x_m(), rig.queue.len()), (State::Holding, halted_m, 1));

    let mut resumed = Rig {
        controller: rig.controller.clone(),
        queue: rig.queue.clone(),
        readings: rig.readings,
        brakes_released: true,
    };
    resumed.controller.resume().unwrap();
    resumed.until(State::Holding);
    assert!((resumed.x_m() - 0.2).abs() < 1e-6 && resumed.queue.is_empty());
    assert!((resumed.controller.stance().position_m.y - HOME_M[1] - 0.1).abs() < 1e-6);

    rig.controller.cancel().unwrap();
    rig.run(50);
    assert_eq!((rig.state(), rig.x_m(), rig.controller.dropped()), (State::Holding, halted_m, 1));
    rig.queue.push_back(stop_at([0.0; 3], 1.0));
    rig.until(State::Tracking);
    rig.until(State::Holding);
    assert!(rig.x_m().abs() < 1e-6);
}

#[test]
fn a_stale_stream_comes_to_rest_and_waits() {
    let mut rig = Rig::holding(ControllerSettings { stream_ticks: Some(15), ..settings() });
    rig.queue.push_back(stop_at([0.2, 0.0, 0.0], 1.0));
    rig.until(State::Tracking);
    // Way-points that wait behind a long motion keep the stream alive,
    rig.queue.push_back(stop_at([0.2, 0.1, 0.0], 0.6));
    assert_eq!(rig.until(State::Holding), 999 + 16 + HALT_TICKS);
    // but then none comes: where the platform has hardly begun to move.
    let stale = Fault::StaleSetPoint { age_ticks: 16 };
    assert_eq!(rig.last_halt(), Some(Halt::Fault(stale)));
    assert!(rig.controller.is_halted());
    assert!(rig.controller.stance().position_m.y < HOME_M[1] + 0.01);
}

#[test]
fn a_stream_that_dries_up_runs_out() {
    let mut rig = Rig::holding(settings());
    rig.queue.push_back(through([0.05, 0.0, 0.0], [0.1, 0.0, 0.0], 1.0));
    for step in 1..=20_u8 {
        let x = 0.05 + 1e-3 * f32::from(step);
        rig.queue.push_back(through([x, 0.0, 0.0], [0.1, 0.0, 0.0], 0.01));
    }
    rig.until(State::Tracking);
    rig.until(State::Holding);
    assert!(matches!(rig.last_halt(), Some(Halt::Fault(Fault::StaleSetPoint { .. }))));
    // 0.07 m, and v T/2 with T = sqrt(6 v/j) = 55 ms.
    assert!((rig.x_m() - 0.0728).abs() < 2e-4, "{}", rig.x_m());
    // What comes too late waits for `resume`.
    rig.queue.push_back(stop_at([0.1, 0.0, 0.0], 1.0));
    rig.run(20);
    assert!(rig.controller.is_halted() && rig.queue.len() == 1);
    rig.controller.resume().unwrap();
    rig.until(State::Tracking);
    rig.until(State::Holding);
    assert!((rig.x_m() - 0.1).abs() < 1e-6);
}

#[test]
fn brakes_close_at_rest_and_open_before_the_next_motion() {
    let mut rig = Rig::holding(ControllerSettings { brake_after_ticks: Some(100), ..settings() });
    rig.run(99);
    assert!(rig.brakes_released);
    rig.run(5);
    assert!(!rig.brakes_released && rig.state() == State::Holding);
    rig.queue.push_back(stop_at([0.1, 0.0, 0.0], 1.0));
    for _ in 0..BRAKE_TICKS {
        rig.tick();
        assert!(rig.brakes_released);
        assert_eq!((rig.state(), rig.x_m()), (State::Holding, 0.0));
    }
    rig.tick();
    assert_eq!(rig.state(), State::Tracking);
    rig.until(State::Holding);
    assert!((rig.x_m() - 0.1).abs() < 1e-6);
}

#[test]
fn emergency_stop_from_every_state_and_back() {
    let mut aligning = Rig::new(settings());
    aligning.controller.arm(&aligning.readings).unwrap();
    for mut rig in
        [Rig::new(settings()), aligning, Rig::holding(settings()), Rig::tracking(settings())]
    {
        rig.queue.push_back(stop_at([0.2, 0.1, 0.0], 0.6));
        rig.readings.emergency_stop = true;
        let outputs = rig.tick();
        assert_eq!(rig.state(), State::Fault(Cause::EmergencyStop));
        assert_eq!(outputs, Outputs { targets: None, brakes_released: false });
        assert_eq!(
            rig.controller.acknowledge(&rig.readings),
            Err(Refusal::Persists(Cause::EmergencyStop))
        );
        rig.readings.emergency_stop = false;
        rig.run(3);
        assert_eq!(rig.state(), State::Fault(Cause::EmergencyStop));
        rig.controller.acknowledge(&rig.readings).unwrap();
        assert_eq!(rig.state(), State::Disarmed);
        // What was queued is forgotten; it stands where it stood, and works again.
        rig.controller.arm(&rig.readings).unwrap();
        rig.until(State::Holding);
        let x_m = rig.x_m();
        rig.run(20);
        assert_eq!((rig.state(), rig.x_m()), (State::Holding, x_m));
        rig.queue.push_back(stop_at([0.0; 3], 1.0));
        rig.until(State::Tracking);
        rig.until(State::Holding);
        assert!(rig.x_m().abs() < 1e-6);
    }
}

#[test]
fn failed_and_lagging_winches_are_faults() {
    for mut rig in [Rig::holding(settings()), Rig::tracking(settings())] {
        let good = rig.readings;
        let controller = rig.controller.clone();
        rig.readings.failed_winch = Some(5);
        rig.tick();
        assert_eq!(rig.state(), State::Fault(Cause::WinchFailed(5)));
        assert!(!rig.brakes_released);

        rig.controller = controller.clone();
        rig.readings = good;
        rig.readings.rest_lengths_m[3] -= 0.021;
        rig.tick();
        assert!(matches!(
            rig.state(),
            State::Fault(Cause::FollowingError { cable: 3, error_m }) if (error_m + 0.021).abs() < 1e-4
        ));
        rig.controller = controller;
        rig.readings = good;
        rig.readings.rest_lengths_m[0] = f32::INFINITY;
        rig.tick();
        assert_eq!(rig.state(), State::Fault(Cause::NonFiniteReading(0)));
    }
}

#[test]
fn halts_before_a_winch_runs_out_of_cable() {
    let mut tracker = tracker_settings();
    tracker.cables[0].longest_m = START[0][0] + 0.05;
    let mut rig = Rig::holding(settings());
    rig.controller = start(tracker, settings()).unwrap();
    rig.controller.arm(&rig.readings).unwrap();
    rig.until(State::Holding);
    rig.queue.push_back(stop_at([0.2, 0.0, 0.0], 1.0));
    rig.until(State::Tracking);
    rig.until(State::Holding);
    let Some(Halt::Fault(fault)) = rig.last_halt() else { panic!("not halted") };
    assert!(rig.readings.rest_lengths_m[0] <= START[0][0] + 0.05);
    assert!(matches!(fault, Fault::LengthBeyondWinch { cable: 0, .. }));
}

#[test]
fn halts_before_a_tension_is_beyond_its_limit() {
    let mut tracker = tracker_settings();
    // It is 228.3 N at the anchor of cable 2 and rises along x.
    tracker.cables[1].highest_tension_n = 236.0;
    let mut controller = start(tracker, settings()).unwrap();
    let mut rig = Rig::new(settings());
    controller.arm(&rig.readings).unwrap();
    rig.controller = controller;
    rig.until(State::Holding);
    rig.queue.push_back(stop_at([0.4, 0.0, 0.0], 2.0));
    rig.until(State::Tracking);
    rig.until(State::Holding);
    assert!(matches!(rig.last_halt(), Some(Halt::Fault(Fault::TensionAbove { cable: 1, .. }))));
    let cable = &rig.controller.tracker().command().cables[1];
    let tension_n = cable.force_n.norm().max(cable.anchor_force_n.norm());
    assert!(tension_n < 236.0 && tension_n > 235.0, "{tension_n}");
}

#[test]
fn a_pose_that_is_not_to_be_had_is_a_fault() {
    // Up and up: above the anchors nothing can hold the platform.
    let far = MotionLimits { distance_m: 20.0, ..limits() };
    let mut rig = Rig::holding(ControllerSettings { motion: far, ..settings() });
    rig.queue.push_back(WayPoint::stop(
        Stance { position_m: Vector3::new(2.0, 7.0, 14.0), ..home() },
        Pace::Share(1.0),
    ));
    rig.until(State::Tracking);
    for _ in 0..60_000 {
        rig.tick();
        if rig.state() != State::Tracking {
            break;
        }
    }
    let is_at_rest = match rig.state() {
        State::Fault(Cause::Tracker(_)) => !rig.brakes_released,
        State::Holding => rig.controller.is_halted(),
        _ => false,
    };
    assert!(is_at_rest, "{}", rig.state());
    assert!(rig.controller.stance().position_m.z < 12.0);
}

#[test]
fn warnings_are_recorded_and_change_nothing() {
    let mut rig = Rig::tracking(settings());
    let warning = Warning::LoadSwings { deviation_n: 9.0 };
    rig.controller.warn(warning);
    let last = rig.controller.events().iter().last().copied();
    assert_eq!(last.map(|event| event.kind), Some(EventKind::Warning(warning)));
    assert_eq!(rig.state(), State::Tracking);
}

/// What can happen in a tick.
#[derive(Clone, Debug)]
enum Happening {
    Nothing,
    WayPoint(WayPoint<f32>),
    Arm,
    Disarm,
    Stop,
    Resume,
    Cancel,
    Acknowledge,
    EmergencyStop(bool),
    WinchFails(Option<usize>),
    Reads(usize, f32),
}

/// Mostly near home, where the branch has no fold, sometimes any bit pattern.
fn number(scale: f32) -> impl Strategy<Value = f32> {
    prop_oneof![
        20 => -scale..=scale,
        1 => any::<u32>().prop_map(f32::from_bits),
        1 => prop::sample::select(vec![
            f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, 1e-45, -0.0,
        ]),
    ]
}

fn numbers(scale: f32) -> impl Strategy<Value = Vector3<f32>> {
    [number(scale), number(scale), number(scale)].prop_map(Vector3::from)
}

fn way_points() -> impl Strategy<Value = WayPoint<f32>> {
    let pace = prop_oneof![
        8 => (0.001..1.0_f32).prop_map(Pace::Duration),
        4 => (0.1..1.0_f32).prop_map(Pace::Share),
        1 => number(1e3).prop_map(Pace::Duration),
        1 => number(2.0).prop_map(Pace::Share),
    ];
    let still = prop_oneof![2 => Just(true), 1 => Just(false)];
    (numbers(0.1), numbers(0.05), numbers(0.05), numbers(0.05), still, pace).prop_map(
        |(offset, turn, linear_m_s, angular_rad_s, still, pace)| {
            let q = nalgebra::Quaternion::new(1.0, turn.x, turn.y, turn.z);
            let stance = Stance {
                position_m: home().position_m + offset,
                orientation: UnitQuaternion::new_unchecked(q / q.norm()),
            };
            let twist = if still { Twist::none() } else { Twist { linear_m_s, angular_rad_s } };
            WayPoint { stance, twist, pace }
        },
    )
}

fn happenings() -> impl Strategy<Value = Happening> {
    prop_oneof![
        20 => Just(Happening::Nothing),
        20 => way_points().prop_map(Happening::WayPoint),
        8 => Just(Happening::Arm),
        1 => Just(Happening::Disarm),
        2 => Just(Happening::Stop),
        4 => Just(Happening::Resume),
        2 => Just(Happening::Cancel),
        8 => Just(Happening::Acknowledge),
        1 => Just(Happening::EmergencyStop(true)),
        4 => Just(Happening::EmergencyStop(false)),
        1 => (0..CABLES).prop_map(|winch| Happening::WinchFails(Some(winch))),
        4 => Just(Happening::WinchFails(None)),
        1 => (0..CABLES, number(0.03)).prop_map(|(winch, error)| Happening::Reads(winch, error)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_makes_it_unsafe(
        happenings in prop::collection::vec((happenings(), 1..60_u32), 1..60),
        stream_ticks in prop::option::of(1..100_u32),
        brake_after_ticks in prop::option::of(0..50_u32),
    ) {
        let mut rig = Rig::new(ControllerSettings { stream_ticks, brake_after_ticks, ..settings() });
        let mut queue = Queue::<f32, 9>::new();
        let (mut producer, mut consumer) = queue.split();
        let mut last_m: Option<[f32; CABLES]> = None;
        for (happening, ticks) in happenings {
            let controller = &mut rig.controller;
            match happening {
                Happening::Nothing => {}
                Happening::WayPoint(way_point) => { let _ = producer.enqueue(way_point); }
                Happening::Arm => { let _ = controller.arm(&rig.readings); }
                Happening::Disarm => { let _ = controller.disarm(); }
                Happening::Stop => { let _ = controller.stop(); }
                Happening::Resume => { let _ = controller.resume(); }
                Happening::Cancel => { let _ = controller.cancel(); }
                Happening::Acknowledge => { let _ = controller.acknowledge(&rig.readings); }
                Happening::EmergencyStop(pressed) => rig.readings.emergency_stop = pressed,
                Happening::WinchFails(winch) => rig.readings.failed_winch = winch,
                Happening::Reads(winch, error_m) => {
                    rig.readings.rest_lengths_m[winch] =
                        controller.tracker().command().cables[winch].rest_length_m + error_m;
                }
            }
            for _ in 0..ticks {
                let outputs = rig.controller.tick(&rig.readings, || consumer.dequeue());
                let state = rig.state();
                if let State::Disarmed | State::Fault(_) = state {
                    prop_assert_eq!(outputs, Outputs { targets: None, brakes_released: false });
                }
                if rig.readings.emergency_stop {
                    prop_assert!(matches!(state, State::Fault(_)));
                }
                if state == State::Tracking || state == State::Aligning {
                    prop_assert!(outputs.brakes_released);
                }
                let lengths_m = outputs.targets.map(|t| t.map(|target| target.rest_length_m));
                for target in outputs.targets.iter().flatten() {
                    prop_assert!(target.rest_length_m.is_finite() && target.rest_length_m > 0.0);
                    prop_assert!(target.rate_m_s.abs() <= FASTEST_M_S);
                }
                // The lengths go no faster than the winches either; 2e-5 m for Newton's rounding.
                if let (Some(now_m), Some(last_m)) = (lengths_m, last_m) {
                    for (now_m, last_m) in now_m.iter().zip(last_m) {
                        prop_assert!((now_m - last_m).abs() <= FASTEST_M_S * PERIOD_S + 2e-5);
                    }
                }
                last_m = lengths_m;
                if let Some(now_m) = lengths_m {
                    rig.readings.rest_lengths_m = now_m;
                }
                let at_m = rig.controller.stance().position_m;
                prop_assert!((at_m - home().position_m).amax() < 1.0, "{at_m:?}");
            }
        }
    }
}
