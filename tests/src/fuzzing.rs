//! Any bytes at all as set-points, twists, limits, readings and requests, as warm-start tables and as robot
//! files: whatever comes, nothing panics, every output is finite and within its limits, and the work of a tick or
//! a look-up is bounded.

use cdpr_core::controller::{
    ControllerSettings, MotionLimits, Pace, Readings, Stance, State, WayPoint,
};
use cdpr_core::table::{
    COORDINATES, CRC_BYTES, ELASTIC_CATENARY, MAGIC, SEED_BYTES, VERSION, WORD_BYTES, checksum,
    coordinates, offset,
};
use cdpr_core::tracker::MAX_PARTS;
use cdpr_core::{
    CABLES, Cable, Command, Controller, Pose, SetPoint, Table, TableFault, Tracker,
    TrackerSettings, Twist,
};
use cdpr_firmware_example::path::TAUT;
use cdpr_firmware_example::robot::{self, Model};
use cdpr_host_sim::input_file::InputFileError;
use cdpr_host_sim::robot_file::RobotDescription;
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
    assert!(command.certificate.existence_n.iter().all(|n| *n <= settings.largest_error_n));
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
    let still = Twist::none();
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

/// Look-ups in one table.
const LOOK_UPS: usize = 4;

/// A warm-start table: as it is, and then with a header that gets it opened, so that what is behind is reached.
///
/// # Panics
/// When a look-up is not what it should be.
pub fn table(bytes: &[u8]) {
    if let Ok(table) = Table::open(bytes) {
        look_up(&table, bytes);
    }
    let Some(bytes) = repaired(bytes) else { return };
    let table = Table::open(&bytes).unwrap_or_else(|fault| panic!("repaired: {fault}"));
    look_up(&table, &bytes);
}

/// The same contents with a header and a checksum that go with them; `None` when there are too few.
fn repaired(bytes: &[u8]) -> Option<Vec<u8>> {
    let whole = bytes.len() / WORD_BYTES * WORD_BYTES;
    let mut bytes = bytes[..whole].to_vec();
    let body = whole.checked_sub(offset::TREE + CRC_BYTES + WORD_BYTES)?;
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| bytes[at + k])) as usize;
    // As many seeds as it says, or as there is room for; the rest are words of the tree.
    let seeds = word(offset::SEEDS) % (body / SEED_BYTES + 1);
    let words = 1 + (body - SEED_BYTES * seeds) / WORD_BYTES;
    for (at, count) in [(offset::TOTAL, whole), (offset::WORDS, words), (offset::SEEDS, seeds)] {
        bytes[at..at + 4].copy_from_slice(&u32::try_from(count).ok()?.to_le_bytes());
    }
    bytes[..MAGIC.len()].copy_from_slice(&MAGIC);
    bytes[offset::VERSION..offset::VERSION + 2].copy_from_slice(&VERSION.to_le_bytes());
    bytes[offset::MODEL] = ELASTIC_CATENARY;
    for k in 0..COORDINATES {
        for (field, smallest) in [(offset::LOW, f32::MIN), (offset::EXTENT, f32::from_bits(1))] {
            let at = field + 4 * k;
            let number = f32::from_le_bytes(std::array::from_fn(|k| bytes[at + k]));
            if !(number >= smallest && number.is_finite()) {
                bytes[at..at + 4].copy_from_slice(&1.0_f32.to_le_bytes());
            }
        }
    }
    let protected = whole - CRC_BYTES;
    let sum = checksum(&bytes[..protected]);
    bytes[protected..].copy_from_slice(&sum.to_le_bytes());
    Some(bytes)
}

fn look_up(table: &Table<'_>, bytes: &[u8]) {
    let Ok(robot) = robot::crane::<f32>() else { unreachable!("constants") };
    let load = robot::load(&TAUT.payload);
    let mine = table.check(&robot, &load);
    assert!(matches!(
        mine,
        Ok(()) | Err(TableFault::OtherCable(0..CABLES) | TableFault::OtherLoad)
    ));
    assert!(table.node(table.words()).is_none());
    assert!(table.seed(table.seeds()).is_none());
    let (low, extent) = (table.low(), table.extent());
    // Poses from the far end, where there are seeds.
    let from = bytes.len() - bytes.len().min(64 * LOOK_UPS);
    let mut source = Source(&bytes[from..]);
    for _ in 0..LOOK_UPS {
        let at: [f32; COORDINATES] =
            std::array::from_fn(|k| low[k] + extent[k] * 0.5 * (1.0 + source.number()));
        let sine = Vector3::new(at[3], at[4], at[5]);
        let half = (0.5 * (1.0 + (1.0 - sine.norm_squared()).max(0.0).sqrt())).sqrt();
        let v = sine / (2.0 * half);
        let turn = UnitQuaternion::new_unchecked(Quaternion::new(half, v.x, v.y, v.z));
        let Ok(pose) = Pose::new(Vector3::new(at[0], at[1], at[2]), turn) else { continue };
        let seed = table.start_at(&pose);
        let states = table.states(&robot, &load, &pose);
        match (seed, states) {
            (Ok(_), Ok(states)) => {
                for state in states {
                    assert!(state.force_n.iter().all(|force_n| force_n.is_finite()));
                    assert!(state.rest_length_m.is_finite());
                }
            }
            (Ok(_), Err(fault)) => assert_eq!(fault, TableFault::Malformed),
            (Err(fault), states) => {
                assert_eq!(states, Err(fault));
                assert!(matches!(
                    fault,
                    TableFault::OutsideRegion | TableFault::Uncovered(_) | TableFault::Malformed
                ));
            }
        }
        let twist = Twist::none();
        let settings = robot::settings();
        let set_point = SetPoint { pose, twist };
        if let Some(at) = coordinates(&pose)
            && let Some(near) = table.nearest(&at, robot.moment_arm_m())
        {
            assert!(near.iter().all(|x| x.is_finite()), "{near:?}");
        }
        for way_parts in [0, 4] {
            let started = Tracker::start_from(robot, load, settings, &set_point, table, way_parts);
            if let Ok(tracker) = started {
                assert!(mine.is_ok() && (seed.is_ok() || way_parts > 0));
                check(tracker.command(), &settings);
            }
        }
    }
}

/// A robot file.
///
/// # Panics
/// When a robot that is accepted is none, or a refusal names no place in the text.
pub fn robot_file(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let robot = match RobotDescription::parse(&text, "fuzzed.toml") {
        Ok(robot) => robot,
        Err(InputFileError::Content { path, line, field, message }) => {
            assert_eq!(path, "fuzzed.toml");
            // An end that is missing is missed behind the last line.
            assert!((1..=text.split('\n').count()).contains(&line), "line {line}: {message}");
            assert!(!field.is_empty() && !message.is_empty());
            return;
        }
        Err(error) => panic!("{error}"),
    };
    let is_positive = |number: f64| number > 0.0 && number.is_finite();
    let is_finite = |vector: &Vector3<f64>| vector.iter().all(|number| number.is_finite());
    let load = &robot.load;
    assert!(is_positive(load.mass_kg) && is_positive(load.gravity_m_s2));
    assert!([load.center_of_mass_m, load.force_n, load.moment_nm].iter().all(is_finite));
    let cables = robot.robot.cables();
    for (i, (cable, limits)) in cables.iter().zip(&robot.limits).enumerate() {
        assert!(is_finite(&cable.anchor_m) && is_finite(&cable.attachment_m));
        assert!(is_positive(cable.model.linear_density_kg_m));
        // Infinite: no limit, no stretch.
        assert!(cable.model.axial_stiffness_n > 0.0);
        assert!(limits.max_length_m > 0.0 && limits.max_tension_n > 0.0);
        assert!(cables[..i].iter().all(|other| other.anchor_m != cable.anchor_m));
    }
    // The squares of larger numbers are beyond f64: not caught when the file is read.
    let is_small = |cable: &Cable<f64, _>| cable.attachment_m.iter().all(|b| b.abs() < 1e150);
    assert!(!cables.iter().all(is_small) || is_positive(robot.robot.moment_arm_m()));
}
