//! The firmware images, run in QEMU: they do what the same sources do on the host, bit for bit, and stay
//! within their budgets of instructions, stack and memory.

use std::fmt::Display;
use std::process::Output;

use cdpr_core::controller::{
    Cause, Event, EventKind, MotionFault, Readings, Refusal, StartFault, State,
};
use cdpr_core::statics::Balance;
use cdpr_core::{CABLES, Fault, GeometryFault, NewtonStep, Real, Table, TableFault};
use cdpr_firmware_example::control::{
    Control, Crane, Request, Summary, WayPoints, Winches, start_controller, start_tracker,
};
use cdpr_firmware_example::path::{Course, PERIOD_S, Path, SLACK, TAUT, TICKS_AROUND};
use cdpr_firmware_example::plain_step::plain_step;
use cdpr_firmware_example::rehearsal::{PRESSED_AT, Rehearsal, TICKS};
use cdpr_firmware_example::{Number, robot};
use cdpr_tests::images::{Images, M4F_F32, M7_F64, cargo};
use object::{Object, ObjectSection};

/// A machine: the aliases of `.cargo/config.toml` for it, and its other images.
struct Machine {
    firmware: &'static str,
    measure: &'static str,
    images: Images,
    budget: Budget,
}

/// What starting on a branch and following it may take.
struct Budget {
    /// Instructions of a tick, on the most expensive one.
    tick_instructions: u64,
    /// Stack of a tick, bytes.
    tick_stack_bytes: u64,
    /// Code and constants of tracker, models, linear algebra and float functions, bytes.
    code_bytes: u64,
    /// A tracker, bytes.
    ram_bytes: u64,
    /// Instructions of checking the bytes of the warm-start table.
    open_instructions: u64,
    /// Instructions of look-up and convergence at the dearest pose.
    seeded_instructions: u64,
    /// Instructions of the whole start by the table, its certificate included, at the dearest pose.
    start_instructions: u64,
    /// Stack of that, bytes, and of a start by way.
    start_stack_bytes: u64,
    /// Instructions of a start by way, a third of a metre beyond the table.
    way_instructions: u64,
}

/// A start by the table takes no more than this on the Cortex-M4F, in instructions.
const START_GOAL: u64 = 40_000;

/// Cortex-M4F, f32.
const M4F: Machine = Machine {
    firmware: "firmware",
    measure: "measure",
    images: M4F_F32,
    budget: Budget {
        tick_instructions: 5_800,
        tick_stack_bytes: 2 * 1024,
        code_bytes: 24 * 1024,
        ram_bytes: 2 * 1024,
        open_instructions: 5_000,
        seeded_instructions: 13_500,
        start_instructions: START_GOAL,
        start_stack_bytes: 5 * 1024,
        way_instructions: 310_000,
    },
};

/// Cortex-M7, f64.
const M7: Machine = Machine {
    firmware: "firmware-m7",
    measure: "measure-m7",
    images: M7_F64,
    budget: Budget {
        tick_instructions: 7_300,
        tick_stack_bytes: 3_700,
        code_bytes: 24 * 1024,
        ram_bytes: 4 * 1024,
        open_instructions: 5_000,
        seeded_instructions: 22_000,
        start_instructions: 44_000,
        start_stack_bytes: 9 * 1024,
        way_instructions: 410_000,
    },
};

/// The plain way takes at least so many times the instructions of the condensed step.
const PLAIN_FACTOR: u64 = 3;

#[test]
fn cortex_m4f_commands_the_bits_of_the_host_in_f32() {
    rehearse::<f32>(&M4F);
}

#[test]
fn cortex_m7_commands_the_bits_of_the_host_in_f64() {
    rehearse::<f64>(&M7);
}

#[test]
fn cortex_m4f_stays_within_its_budget() {
    measure(&M4F);
}

#[test]
fn cortex_m7_stays_within_its_budget() {
    measure(&M7);
}

/// The image of the controller, against the same rehearsal here.
fn rehearse<T: Number + Display>(machine: &Machine) {
    let (summary, events, recovered) = on_the_host::<T>();
    let log = log(machine.firmware);
    for (name, expected) in [
        ("ticks:", summary.ticks),
        ("certified:", summary.certified),
        ("states:", summary.states),
        ("events:", summary.events),
        ("faults:", summary.faults),
        ("overruns:", 0),
        ("dropped:", 0),
    ] {
        assert_eq!(number(&log, name), u64::from(expected), "{name}\n{log}");
    }
    for Event { tick, kind } in events {
        let line = match kind {
            EventKind::Entered(state) => format!("tick {tick}: {state}"),
            EventKind::Refused(fault) => format!("tick {tick}: way-point refused: {fault}"),
            other => panic!("tick {tick}: {other:?}"),
        };
        assert!(log.contains(&line), "{line}\n{log}");
    }
    let refused = format!("table refused for a bare platform: {}", TableFault::OtherLoad);
    assert!(log.contains(&refused), "{refused}\n{log}");
    // Look-up, convergence and start, within a tick whose other work is little.
    let recovery = number(&log, &format!("tick {recovered}: recovered by the table:"));
    within(
        recovery,
        machine.budget.start_instructions + machine.budget.tick_instructions,
        "recovery",
    );
    let checksum = format!("checksum: {:#018x}", summary.checksum.value());
    assert!(log.contains(&checksum), "the host says {checksum}\n{log}");
}

/// The rehearsal: that it goes as it should, and what came of it; at which tick it recovered.
fn on_the_host<T: Number>() -> (Summary<T>, Vec<Event<T>>, u32) {
    let mut way_points = WayPoints::new();
    let (sender, receiver) = way_points.split();
    let table = Table::open(robot::TABLE).unwrap();
    let controller = start_controller(&TAUT, &table).unwrap();
    let mut control =
        Control::<T>::new(controller, table, receiver, Winches::start(&TAUT).unwrap());
    let mut rehearsal = Rehearsal::new(TAUT, sender);
    let (mut summary, mut events) = (Summary::new(), Vec::new());
    let (mut moving, mut resting) = (0, 0);
    let mut recoveries = Vec::new();
    for tick in 1..=TICKS {
        let inputs = rehearsal.inputs(&control.state());
        let before = *control.controller().tracker().command();
        let outcome = control.tick(&inputs);
        assert_eq!(outcome.refusal, None, "tick {tick}");
        if inputs.request == Some(Request::Recover) {
            recoveries.push(tick);
            // The very solution at which the emergency stop had found the platform.
            let after = control.controller().tracker().command();
            for (before, after) in before.cables.iter().zip(&after.cables) {
                let rounding_m = T::constant(8.0) * T::EPSILON * before.rest_length_m;
                assert!((after.rest_length_m - before.rest_length_m).abs() <= rounding_m);
            }
        }
        summary.add_tick(&control, &outcome.outputs);
        moving += u32::from(control.state() == State::Tracking);
        resting += u32::from(control.state() == State::Holding);
        while let Some(event) = control.take_event() {
            summary.add_event(&event);
            events.push(event);
        }
    }
    let stopped = State::Fault(Cause::EmergencyStop);
    let expected = [
        EventKind::Entered(State::Aligning),
        EventKind::Entered(State::Holding),
        EventKind::Entered(State::Tracking),
        EventKind::Refused(MotionFault::NonFinite),
        EventKind::Entered(stopped),
        EventKind::Entered(State::Disarmed),
        EventKind::Entered(State::Aligning),
        EventKind::Entered(State::Holding),
        EventKind::Entered(State::Tracking),
        EventKind::Entered(State::Holding),
    ];
    let passed: Vec<_> = events.iter().map(|event| event.kind).collect();
    assert_eq!(passed, expected);
    let [recovered] = recoveries[..] else { panic!("recovered at {recoveries:?}") };
    let stop = events.iter().find(|event| event.kind == EventKind::Entered(stopped)).unwrap();
    assert_eq!(stop.tick, PRESSED_AT);
    assert_eq!((summary.ticks, summary.events, summary.states), (TICKS, 10, 9));
    // Alignment ends, each time, with the certified lengths: brakes open or not, they are counted.
    assert!(summary.certified >= moving + resting, "{summary:?}");
    assert!(moving > TICKS * 3 / 4, "{moving}");
    assert_eq!(control.state(), State::Holding);
    // Back to where it started, to what the constants of the rotation and 38 products are rounded to.
    let home = Path::<T>::new(TAUT).target().stance.position_m;
    let off_m = (control.controller().stance().position_m - home).map(Real::abs);
    let rounding_m = T::constant(64.0) * T::EPSILON;
    assert!(off_m.iter().all(|&c| c < rounding_m), "{off_m:?}");
    (summary, events, recovered)
}

/// A controller starts on the sheet of a table, at the solution that is written down for the same pose; anew
/// only while disarmed, and a restart that is refused changes nothing.
#[test]
fn table_starts_and_restarts_the_controller() {
    starts_and_restarts::<f32>();
    starts_and_restarts::<f64>();
}

fn starts_and_restarts<T: Number + Display>() {
    let table = Table::open(robot::TABLE).unwrap();
    let mut controller = start_controller::<T>(&TAUT, &table).unwrap();
    let home = *controller.stance();
    let lengths_m = |controller: &Crane<T>| {
        controller.tracker().command().cables.map(|cable| cable.rest_length_m)
    };
    let written = start_tracker::<T>(TAUT).unwrap();
    for (found, written) in lengths_m(&controller).iter().zip(&written.command().cables) {
        let rounding_m = T::constant(8.0) * T::EPSILON * *found;
        assert!((*found - written.rest_length_m).abs() <= rounding_m);
    }

    // For another load there is no start.
    let refused = start_controller::<T>(&SLACK, &table).unwrap_err();
    assert_eq!(refused, StartFault::Tracker(Fault::Table(TableFault::OtherLoad)));

    let mut elsewhere = home;
    elsewhere.position_m.x += T::constant(0.1);
    let mut outside = home;
    outside.position_m.x += T::constant(1.0);
    let mut nowhere = home;
    nowhere.position_m.x = T::constant(f64::NAN);
    for (stance, fault) in [
        (outside, Fault::Table(TableFault::OutsideRegion)),
        (nowhere, Fault::Geometry(GeometryFault::InvalidPose)),
    ] {
        let before = controller.clone();
        assert_eq!(controller.restart_from(stance, &table, 0), Err(Refusal::NoRestart(fault)));
        assert_eq!(controller.tracker().command(), before.tracker().command());
        assert_eq!(controller.stance(), before.stance());
    }

    let before_m = lengths_m(&controller);
    controller.restart_from(elsewhere, &table, 0).unwrap();
    assert_eq!(*controller.stance(), elsewhere);
    let wanted_m = lengths_m(&controller);
    assert!(before_m.iter().zip(&wanted_m).any(|(a, b)| (*a - *b).abs() > T::constant(0.02)));

    // Armed from less than the reach away, the winches are aligned with the new lengths.
    let mut readings = Readings {
        rest_lengths_m: wanted_m.map(|length_m| length_m + T::constant(0.01)),
        failed_winch: None,
        emergency_stop: false,
    };
    controller.arm(&readings).unwrap();
    let not_now = Refusal::NotNow(State::Aligning);
    assert_eq!(controller.restart_from(home, &table, 0), Err(not_now));
    for _ in 0..1_000 {
        let outputs = controller.tick(&readings, || None);
        readings.rest_lengths_m = outputs.targets.unwrap().map(|target| target.rest_length_m);
    }
    assert_eq!((controller.state(), readings.rest_lengths_m), (State::Holding, wanted_m));
}

/// Every budget of a machine, with what is left of it in the message.
fn measure(machine: &Machine) {
    let log = log(machine.measure);
    let budget = &machine.budget;
    let [code_bytes, all_bytes] = ["size_tracker", "size_controller"]
        .map(|bin| image_bytes(machine, bin) - image_bytes(machine, "size_empty"));
    // Shown by --nocapture.
    println!(
        "{log}tracker: {code_bytes} bytes of code and constants; with controller, table and drums {all_bytes}"
    );
    for path in ["taut path", "slack path"] {
        let instructions = number(&log, &format!("{path}: worst tick:"));
        within(instructions, budget.tick_instructions, path);
        within(number(&log, &format!("{path}: stack of a tick:")), budget.tick_stack_bytes, path);
    }
    for (name, budget) in [
        ("table: open:", budget.open_instructions),
        ("table: worst look-up and convergence:", budget.seeded_instructions),
        ("table: worst start:", budget.start_instructions),
        ("table: stack of a start:", budget.start_stack_bytes),
        ("table: stack of a start by way:", budget.start_stack_bytes),
        ("table: start by way:", budget.way_instructions),
    ] {
        within(number(&log, name), budget, name);
    }
    for all in ["table: 1000 of 1000 poses have a seed", "table: 1000 of them are started at"] {
        assert!(log.contains(all), "{log}");
    }
    within(number(&log, "controller and queue:"), budget.ram_bytes, "bytes of RAM");
    within(code_bytes, budget.code_bytes, "bytes of code");
    let (condensed, plain) = (number(&log, "condensed step:"), number(&log, "plain step:"));
    assert!(plain >= PLAIN_FACTOR * condensed, "plain: {plain}, condensed: {condensed}");
}

/// Within the budget, but for more than nothing.
fn within(found: u64, budget: u64, what: &str) {
    assert!((1..=budget).contains(&found), "{what}: {found}, of {budget}");
}

#[test]
fn courses_are_what_they_are_called() {
    let mut slack_ticks = 0;
    for (course, may_be_slack) in [(TAUT, false), (SLACK, true)] {
        let mut tracker = start_tracker::<f64>(course).unwrap();
        let mut path = Path::new(course);
        let start_m = path.target().stance.position_m;
        let limits = tracker.settings().cables;
        let mut last_m = tracker.command().cables.map(|cable| cable.rest_length_m);
        for tick in 0..TICKS_AROUND {
            path.advance();
            let target = path.target();
            let command = *tracker.tick(&target.set_point().unwrap()).unwrap();
            for (i, cable) in command.cables.iter().enumerate() {
                assert!(may_be_slack || !cable.is_slack, "tick {tick}, cable {i}");
                let speed_m_s = (cable.rest_length_m - last_m[i]).abs() / PERIOD_S;
                assert!(speed_m_s <= limits[i].fastest_m_s, "tick {tick}, cable {i}: {speed_m_s}");
                assert!(cable.anchor_force_n.norm() >= limits[i].lowest_tension_n);
                assert!(cable.rest_length_m <= limits[i].longest_m);
                last_m[i] = cable.rest_length_m;
            }
            slack_ticks += u32::from(command.cables.iter().any(|cable| cable.is_slack));
        }
        // Closed to what the constants of the rotation and 9500 products are rounded to.
        assert!((path.target().stance.position_m - start_m).norm() < 1e-11);
    }
    assert!(slack_ticks > TICKS_AROUND / 5, "{slack_ticks}");
}

/// The twist of the path is its derivative: central differences at a hundred places. Their error is
/// `h^2/6` of the third derivative, at most 1e-6 of the speed, and rounding of 1e-16/h.
#[test]
fn twist_is_the_rate_of_the_path() {
    let mut path = Path::<f64>::new(TAUT);
    for _ in 0..100 {
        let before = path.target();
        path.advance();
        let now = path.target();
        path.advance();
        let after = path.target();
        let linear_m_s = (after.stance.position_m - before.stance.position_m) / (2.0 * PERIOD_S);
        assert!((linear_m_s - now.twist.linear_m_s).norm() < 1e-6);
        let turn = before.stance.orientation.inverse() * after.stance.orientation;
        let angular_rad_s = turn.scaled_axis() / (2.0 * PERIOD_S);
        assert!((angular_rad_s - now.twist.angular_rad_s).norm() < 1e-6);
        for _ in 2..TICKS_AROUND / 100 {
            path.advance();
        }
    }
}

/// Both ways of taking a Newton step lead to the same forces and rest lengths, to rounding times the
/// condition (60): otherwise their costs could not be compared.
#[test]
fn plain_step_is_the_condensed_step() {
    for course in [TAUT, SLACK] {
        let (robot, load) = (robot::crane::<f64>().unwrap(), robot::load(&course.payload));
        let states = robot::start_states(&course.payload);
        let pose = moved(course);
        let balance = Balance::at(&robot, &load, &pose).unwrap();
        let condensed = NewtonStep::new(&robot, &balance, &states).unwrap().states;
        let plain = plain_step(&robot, &balance, &states).unwrap();
        for i in 0..CABLES {
            let force_n = condensed[i].force_n;
            assert!((plain[i].force_n - force_n).norm() < 1e-11 * force_n.norm());
            assert!((plain[i].rest_length_m / condensed[i].rest_length_m - 1.0).abs() < 1e-12);
            assert!((force_n - states[i].force_n).norm() > 1e-3 * force_n.norm(), "no step");
        }
    }
}

/// A pose some centimetres along `course`.
fn moved<T: Real>(course: Course) -> cdpr_core::Pose<T> {
    let mut path = Path::new(course);
    (0..50).for_each(|_| path.advance());
    path.target().set_point().unwrap().pose
}

/// What an alias of `.cargo/config.toml` prints, which is what a user sees.
fn log(alias: &str) -> String {
    let Output { status, stdout, stderr } = cargo(&[alias]);
    let (log, errors) = (String::from_utf8_lossy(&stdout), String::from_utf8_lossy(&stderr));
    assert!(status.success(), "cargo {alias}: {status}\n{log}{errors}");
    log.into_owned()
}

/// The number behind `name` in the log.
fn number(log: &str, name: &str) -> u64 {
    let (_, rest) = log.split_once(&format!(" {name} ")).unwrap_or_else(|| panic!("{name}\n{log}"));
    let digits = rest.split_whitespace().next().unwrap();
    digits.parse().unwrap_or_else(|error| panic!("{name} {digits}: {error}"))
}

/// Code and constants of an image without log.
fn image_bytes(machine: &Machine, bin: &str) -> u64 {
    let elf = std::fs::read(machine.images.build(bin)).unwrap();
    let elf = object::File::parse(&*elf).unwrap();
    [".vector_table", ".text", ".rodata", ".data"]
        .iter()
        .map(|name| elf.section_by_name(name).map_or(0, |section| section.size()))
        .sum()
}
