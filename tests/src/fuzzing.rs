//! Any bytes at all as set-points, twists, limits, readings and requests: whatever comes, nothing panics,
//! every output is finite and within its limits, and the work of a tick is bounded.

use cdpr_core::controller::{
    ControllerSettings, MotionLimits, Pace, Readings, Stance, State, WayPoint,
};
use cdpr_core::tracker::MAX_PARTS;
use cdpr_core::{CABLES, Command, Controller, Pose, SetPoint, Tracker, TrackerSettings, Twist};
use cdpr_firmware_example::path::TAUT;
use cdpr_firmware_example::robot::{self, Model};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Set-points or requests of one run: more bytes are left over.
const REQUESTS: usize = 400;

/// Ticks from one request to the next at most: motions get somewhere in a few hundred bytes.
const MOST_TICKS: u8 = 64;

/// Takes numbers off a string of bytes; zeros when there are no more.
struct Source<'a>(&'a [u8]);

impl Source<'_> {
    fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }

    /// A number between -1 and 1 mostly; and now and then any bit pattern.
    fn number(&mut self) -> f32 {
        match self.byte() {
            255 => f32::from_bits(u32::from_le_bytes(std::array::from_fn(|_| self.byte()))),
            254 => f32::NAN,
            253 => f32::INFINITY,
            byte => (f32::from(byte) - 126.0) / 127.0,
        }
    }

    fn vector(&mut self, scale: f32) -> Vector3<f32> {
        Vector3::from_fn(|_, _| self.number() * scale)
    }

    fn twist(&mut self) -> Twist<f32> {
        Twist { linear_m_s: self.vector(1.0), angular_rad_s: self.vector(0.3) }
    }

    /// Adds to `setting`, once in 32 times.
    fn spoil(&mut self, setting: &mut f32, scale: f32) {
        if self.byte() < 8 {
            *setting += scale * self.number();
        }
    }

    /// A turn about a small or any angle, sometimes not of unit length.
    fn orientation(&mut self, scale: f32) -> UnitQuaternion<f32> {
        let v = self.vector(scale);
        let w =
            if self.byte() == 0 { self.number() } else { (1.0 - v.norm_squared()).max(0.0).sqrt() };
        UnitQuaternion::new_unchecked(Quaternion::new(w, v.x, v.y, v.z))
    }
}

/// Those of the crane; one or two of them of any kind, nonsense included. Were it more, nothing would
/// start.
fn settings(source: &mut Source<'_>) -> TrackerSettings<f32> {
    let mut settings = robot::settings();
    for cable in &mut settings.cables {
        source.spoil(&mut cable.shortest_m, 10.0);
        source.spoil(&mut cable.longest_m, 30.0);
        source.spoil(&mut cable.fastest_m_s, 3.0);
        source.spoil(&mut cable.lowest_tension_n, 50.0);
        source.spoil(&mut cable.highest_tension_n, 1e3);
    }
    source.spoil(&mut settings.period_s, 0.01);
    source.spoil(&mut settings.largest_move_m, 0.05);
    source.spoil(&mut settings.fold_horizon_s, 1.0);
    source.spoil(&mut settings.least_distance, 0.1);
    source.spoil(&mut settings.largest_error_n, 1.0);
    settings
}

/// # Panics
/// When a command is not what it should be.
fn check(command: &Command<f32>, settings: &TrackerSettings<f32>) {
    assert!((1..=MAX_PARTS).contains(&command.parts));
    assert!(command.certificate.contraction <= 0.5 && command.certificate.h <= 0.5);
    assert!(command.certificate.existence_radius_n <= settings.largest_error_n);
    for (cable, limits) in command.cables.iter().zip(&settings.cables) {
        let numbers = [
            cable.rest_length_m,
            cable.rest_length_rate_m_s,
            cable.force_n.x,
            cable.force_n.y,
            cable.anchor_force_n.y,
            cable.tension_n,
            cable.anchor_tension_n,
        ];
        assert!(numbers.iter().all(|number| number.is_finite()), "{cable:?}");
        assert!(
            cable.rest_length_m >= limits.shortest_m && cable.rest_length_m <= limits.longest_m
        );
        assert!(cable.rest_length_rate_m_s.abs() <= limits.fastest_m_s);
        assert!(cable.tension_n.max(cable.anchor_tension_n) <= limits.highest_tension_n);
    }
}

/// A bare tracker.
///
/// # Panics
/// When a command is not what it should be.
pub fn tracker(bytes: &[u8]) {
    let mut source = Source(bytes);
    let settings = settings(&mut source);
    let Ok(robot) = robot::crane::<f32>() else { unreachable!("constants") };
    let home = robot::start_position_m::<f32>();
    let set_point = |pose, twist| SetPoint { pose, twist };
    let still = Twist { linear_m_s: Vector3::zeros(), angular_rad_s: Vector3::zeros() };
    let Ok(pose) = Pose::new(home, UnitQuaternion::identity()) else { unreachable!("constants") };
    let payload = &TAUT.payload;
    let states = robot::start_states(payload);
    let started =
        Tracker::start(robot, robot::load(payload), settings, &set_point(pose, still), &states);
    let Ok(mut tracker) = started else { return };
    check(tracker.command(), &settings);
    let mut position_m = home;
    for _ in 0..REQUESTS {
        if source.0.is_empty() {
            break;
        }
        // Within the largest move at a tick mostly, of origin and attachments.
        let (scale, turn) = if source.byte() < 16 { (1.0, 0.02) } else { (2e-3, 5e-4) };
        let next = position_m + source.vector(scale);
        let Ok(pose) = Pose::new(next, source.orientation(turn)) else { continue };
        let before = *tracker.command();
        match tracker.tick(&set_point(pose, source.twist())) {
            Ok(command) => {
                check(command, &settings);
                position_m = next;
            }
            Err(_) => assert_eq!(*tracker.command(), before),
        }
    }
}

/// A whole controller.
///
/// # Panics
/// When an output is not what it should be.
pub fn controller(bytes: &[u8]) {
    let mut source = Source(bytes);
    let tracker = settings(&mut source);
    let Ok(robot) = robot::crane::<f32>() else { unreachable!("constants") };
    let settings = ControllerSettings {
        motion: MotionLimits {
            distance_m: 3.0,
            speed_m_s: 1.0,
            acceleration_m_s2: 5.0,
            jerk_m_s3: 100.0,
            turn_speed_rad_s: 0.5,
            turn_acceleration_rad_s2: 5.0,
            turn_jerk_rad_s3: 100.0,
        },
        halt_ticks: 1 + u32::from(source.byte()),
        stream_ticks: (source.byte() < 64).then_some(5),
        align_speed_m_s: 0.1,
        align_reach_m: 0.05,
        align_tolerance_m: 1e-3,
        settle_ticks: 20,
        following_m: 0.02,
        brake_ticks: 3,
        brake_after_ticks: (source.byte() < 64).then_some(5),
    };
    let home =
        Stance { position_m: robot::start_position_m(), orientation: UnitQuaternion::identity() };
    let payload = &TAUT.payload;
    let states = robot::start_states(payload);
    let started = Controller::<f32, Model<f32>, 4>::start(
        robot,
        robot::load(payload),
        tracker,
        settings,
        home,
        &states,
    );
    let Ok(mut controller) = started else { return };
    let mut lengths_m = controller.tracker().command().cables.map(|cable| cable.rest_length_m);
    for _ in 0..REQUESTS {
        if source.0.is_empty() {
            break;
        }
        let mut readings =
            Readings { rest_lengths_m: lengths_m, failed_winch: None, emergency_stop: false };
        // Refusals are as good as grants here.
        let mut way_point = None;
        match source.byte() % 16 {
            0 => _ = controller.disarm(),
            1 => _ = controller.stop(),
            2 => _ = controller.resume(),
            3 => _ = controller.cancel(),
            4 => readings.emergency_stop = true,
            5 => readings.failed_winch = Some(usize::from(source.byte())),
            6 => readings.rest_lengths_m[usize::from(source.byte()) % CABLES] = source.number(),
            7..11 => {
                _ = controller.acknowledge(&readings);
                _ = controller.arm(&readings);
            }
            _ => {
                let stance = Stance {
                    position_m: home.position_m + source.vector(0.2),
                    orientation: source.orientation(0.02),
                };
                let pace = match source.byte() {
                    byte if byte < 128 => Pace::Duration(source.number()),
                    _ => Pace::Share(source.number().abs()),
                };
                let mut point = WayPoint::stop(stance, pace);
                if source.byte() < 64 {
                    point.twist = source.twist();
                }
                way_point = Some(point);
            }
        }
        for _ in 0..=source.byte() % MOST_TICKS {
            let outputs = controller.tick(&readings, || way_point.take());
            check(controller.tracker().command(), &tracker);
            let is_off = matches!(controller.state(), State::Disarmed | State::Fault(_));
            assert!(!is_off || (outputs.targets.is_none() && !outputs.brakes_released));
            let Some(targets) = outputs.targets else { continue };
            for (i, target) in targets.iter().enumerate() {
                assert!(target.rest_length_m.is_finite() && target.rate_m_s.is_finite());
                let fastest = tracker.cables[i].fastest_m_s;
                assert!(target.rate_m_s.abs() <= fastest, "{target:?}");
                lengths_m[i] = target.rest_length_m;
            }
            readings.rest_lengths_m = lengths_m;
        }
    }
}
