use core::mem::zeroed;
use core::ptr::{null, null_mut};

use super::*;
use crate::status::Remedy;
use crate::types::{Cable, CableCommand, CableLimits};

fn robot() -> Robot<f64> {
    let cables = [
        ([-3.259, -0.475, 8.826], [-0.10, -0.93, -0.03]),
        ([9.421, -3.482, 11.555], [0.10, -0.93, -0.03]),
        ([9.538, 3.797, 11.533], [0.27, 0.50, -0.07]),
        ([5.570, 20.414, 8.704], [0.27, 0.50, -0.07]),
        ([-2.505, 16.810, 8.649], [-0.27, 0.50, -0.07]),
        ([-3.342, 9.421, 8.788], [-0.27, 0.50, -0.07]),
    ];
    Robot {
        cables: cables.map(|(anchor_m, attachment_m)| Cable {
            anchor_m,
            attachment_m,
            weight_n_m: 0.079 * 9.81,
            compliance_per_n: 1.0 / 1.256_637_1e6,
        }),
    }
}

static LOAD: Load<f64> = Load {
    mass_kg: 69.0,
    center_of_mass_m: [0.0; 3],
    gravity_m_s2: 9.81,
    force_n: [0.0; 3],
    moment_nm: [0.0; 3],
};

static SETTINGS: Settings<f64> = Settings {
    period_s: 0.001,
    largest_move_m: 0.01,
    least_distance: 1e-4,
    fold_horizon_s: 0.1,
    largest_error_n: 1.0,
    cables: [CableLimits {
        shortest_m: 1.0,
        longest_m: 50.0,
        fastest_m_s: 2.0,
        lowest_tension_n: 5.0,
        highest_tension_n: 2000.0,
    }; CDPR_CABLES],
};

static SET_POINT: SetPoint<f64> = SetPoint {
    position_m: [2.0, 7.0, 2.5],
    orientation: [1.0, 0.0, 0.0, 0.0],
    velocity_m_s: [0.0; 3],
    angular_velocity_rad_s: [0.0; 3],
};

/// The solution there: see the firmware's robot.
const LENGTHS_M: [f64; CDPR_CABLES] =
    [10.479_832, 15.077_343, 12.221_567, 14.731_523, 11.970_178, 8.355_886];

fn start(robot: &Robot<f64>, lengths_m: &[f64; 6], tolerance_m: f64) -> (TrackerF64, Status<f64>) {
    let mut tracker = TrackerF64 { words: [0; CDPR_F64_TRACKER_WORDS] };
    // SAFETY: all pointers are of references.
    let status = unsafe {
        cdpr_f64_start_from_lengths(
            &raw mut tracker,
            robot,
            &raw const LOAD,
            &raw const SETTINGS,
            &raw const SET_POINT,
            lengths_m.as_ptr(),
            tolerance_m,
        )
    };
    (tracker, status)
}

#[test]
fn lengths_within_the_tolerance_lead_to_the_solution() {
    let sign = |cables: u32, i: usize| if cables >> i & 1 == 0 { 1.0 } else { -1.0 };
    for error_m in [0.0, 0.001, 0.02, 0.1, 0.3] {
        for cables in 0..64 {
            let lengths_m = core::array::from_fn(|i| LENGTHS_M[i] + error_m * sign(cables, i));
            let (tracker, status) = start(&robot(), &lengths_m, error_m + 1e-5);
            assert_eq!(status, Status::ok(), "{error_m} {cables}");
            // SAFETY: every bit pattern of it is a command, this one included.
            let mut command: Command<f64> = unsafe { zeroed() };
            // SAFETY: both pointers are of references.
            let status = unsafe { cdpr_f64_last_command(&raw const tracker, &raw mut command) };
            assert_eq!(status, Status::ok());
            for (cable, expected_m) in command.cables.iter().zip(LENGTHS_M) {
                // They are written in f32.
                let bound_m = f64::from(f32::EPSILON) * expected_m;
                assert!((cable.rest_length_m - expected_m).abs() <= bound_m);
            }
        }
    }
}

#[test]
fn lengths_of_no_equilibrium_are_refused() {
    let mut lengths_m = LENGTHS_M;
    lengths_m[3] += 0.1;
    let (mut tracker, status) = start(&robot(), &lengths_m, 0.05);
    assert_eq!(status.code, Code::NoSolutionNearLengths);
    assert_eq!(status.remedy, Remedy::MendCall);
    assert_eq!(status.cable, 3);
    assert!((status.value - 0.1).abs() < 1e-5, "{}", status.value);
    // SAFETY: every bit pattern of it is a command, this one included.
    let mut command: Command<f64> = unsafe { zeroed() };
    // SAFETY: all pointers are of references.
    let status = unsafe { cdpr_f64_tick(&raw mut tracker, &raw const SET_POINT, &raw mut command) };
    assert_eq!(status, Status::refusal(Code::NotStarted));

    lengths_m[3] = f64::NAN;
    let (_, status) = start(&robot(), &lengths_m, 0.05);
    assert_eq!((status.code, status.cable), (Code::InvalidMeasurement, 3));
    let (_, status) = start(&robot(), &LENGTHS_M, 0.0);
    assert_eq!((status.code, status.cable), (Code::InvalidMeasurement, -1));
}

/// The firmware's table: a start somewhere, from so many of its bytes or others.
fn start_at(
    (robot, load): (&Robot<f64>, &Load<f64>),
    set_point: &SetPoint<f64>,
    table: &[u8],
    way_parts: u16,
) -> (TrackerF64, Status<f64>) {
    let mut tracker = TrackerF64 { words: [0; CDPR_F64_TRACKER_WORDS] };
    let settings = &raw const SETTINGS;
    let bytes = table.len();
    // SAFETY: all pointers are of references.
    let status = unsafe {
        let (tracker, table) = (&raw mut tracker, table.as_ptr());
        cdpr_f64_start_from_table(
            tracker, robot, load, settings, set_point, table, bytes, way_parts,
        )
    };
    (tracker, status)
}

#[test]
fn a_table_leads_to_the_solution_or_is_refused() {
    let table = include_bytes!("../../../firmware-example/tables/marionet-crane.cdpr");
    let (robot, asked) = (robot(), (&robot(), &LOAD));
    let (tracker, status) = start_at(asked, &SET_POINT, table, 0);
    assert_eq!(status, Status::ok());
    // SAFETY: every bit pattern of it is a command, this one included.
    let mut command: Command<f64> = unsafe { zeroed() };
    // SAFETY: both pointers are of references.
    let status = unsafe { cdpr_f64_last_command(&raw const tracker, &raw mut command) };
    assert_eq!(status, Status::ok());
    for (cable, expected_m) in command.cables.iter().zip(LENGTHS_M) {
        // These are those of parameters in f32, some of which are lengths of up to 20 m.
        assert!((cable.rest_length_m - expected_m).abs() <= 1e-5, "{}", cable.rest_length_m);
    }

    // Beyond the region by way only.
    let far = SetPoint { position_m: [2.4, 7.5, 2.5], ..SET_POINT };
    let refused = start_at(asked, &far, table, 0).1;
    assert_eq!((refused.code, refused.remedy), (Code::NotInTable, Remedy::GoBack));
    assert_eq!(start_at(asked, &far, table, 1).1.code, Code::NotInTable);
    let (tracker, status) = start_at(asked, &far, table, 200);
    assert_eq!(status, Status::ok());
    // SAFETY: both pointers are of references.
    let status = unsafe { cdpr_f64_last_command(&raw const tracker, &raw mut command) };
    assert_eq!(status, Status::ok());
    let there = far.to_core().unwrap();
    let (robot_there, settings) = (robot.to_core().unwrap(), SETTINGS.to_core());
    let opened = Table::open(table).unwrap();
    let same = Tracker::start_from(robot_there, LOAD.to_core(), settings, &there, &opened, 200);
    for (cable, expected) in command.cables.iter().zip(&same.unwrap().command().cables) {
        assert_eq!(cable.rest_length_m.to_bits(), expected.rest_length_m.to_bits());
    }

    let mut damaged = *table;
    damaged[200] ^= 4;
    for bad in [&damaged[..], &table[..table.len() - 1], &[]] {
        let refused = start_at(asked, &SET_POINT, bad, 200).1;
        assert_eq!((refused.code, refused.remedy), (Code::BadTable, Remedy::ReplaceTable));
    }
    // A number of bytes that no array has is refused before one of them is read.
    let mut tracker = TrackerF64 { words: [0; CDPR_F64_TRACKER_WORDS] };
    // SAFETY: all pointers are of references, and the last of them is read no further than a slice may reach.
    let status = unsafe {
        let (tracker, settings, there) =
            (&raw mut tracker, &raw const SETTINGS, &raw const SET_POINT);
        let bytes = table.as_ptr();
        let (robot, load) = (&raw const robot, &raw const LOAD);
        cdpr_f64_start_from_table(tracker, robot, load, settings, there, bytes, usize::MAX, 200)
    };
    assert_eq!((status.code, status.remedy), (Code::BadTable, Remedy::ReplaceTable));
    let mut heavier = robot;
    heavier.cables[4].weight_n_m *= 1.01;
    let refused = start_at((&heavier, &LOAD), &SET_POINT, table, 0).1;
    assert_eq!((refused.code, refused.cable), (Code::OtherRobot, 4));
    let loaded = Load { mass_kg: 70.0, ..LOAD };
    let refused = start_at((asked.0, &loaded), &SET_POINT, table, 0).1;
    assert_eq!((refused.code, refused.cable), (Code::OtherRobot, -1));
}

#[test]
fn unsound_robots_are_refused() {
    let mut unsound = robot();
    unsound.cables[2].weight_n_m = -1.0;
    assert_eq!(start(&unsound, &LENGTHS_M, 0.1).1, Status::refusal(Code::InvalidCable).of_cable(2));
    let mut unsound = robot();
    unsound.cables[5].anchor_m = unsound.cables[1].anchor_m;
    let status = start(&unsound, &LENGTHS_M, 0.1).1;
    assert_eq!((status.code, status.cable, status.other_cable), (Code::CoincidentAnchors, 1, 5));
}

#[test]
fn bad_pointers_are_refused() {
    let bad = Status::refusal(Code::BadPointer);
    let (mut tracker, status) = start(&robot(), &LENGTHS_M, 0.01);
    assert_eq!(status, Status::ok());
    // SAFETY: every bit pattern of it is a command, this one included.
    let mut command: Command<f64> = unsafe { zeroed() };
    // SAFETY: both pointers are of references.
    let _ = unsafe { cdpr_f64_last_command(&raw const tracker, &raw mut command) };
    let states = command
        .cables
        .map(|CableCommand { force_n, rest_length_m, .. }| CableState { force_n, rest_length_m });
    let crane = robot();
    let misaligned = (&raw mut tracker).wrapping_byte_add(1);
    let (tracker, command) = (&raw mut tracker, &raw mut command);
    // SAFETY: all pointers are of references, null or misaligned.
    unsafe {
        assert_eq!(cdpr_f64_tick(null_mut(), &raw const SET_POINT, command), bad);
        assert_eq!(cdpr_f64_tick(misaligned, &raw const SET_POINT, command), bad);
        assert_eq!(cdpr_f64_tick(tracker, null(), command), bad);
        assert_eq!(cdpr_f64_tick(tracker, &raw const SET_POINT, null_mut()), bad);
        assert_eq!(cdpr_f64_last_command(tracker, null_mut()), bad);
        assert_eq!(cdpr_f64_last_command(null(), command), bad);
        // None of which has harmed it.
        assert_eq!(cdpr_f64_tick(tracker, &raw const SET_POINT, command), Status::ok());

        let set_point = &raw const SET_POINT;
        let (robot, load, settings) = (&raw const crane, &raw const LOAD, &raw const SETTINGS);
        let states = states.as_ptr();
        assert_eq!(cdpr_f64_start(null_mut(), robot, load, settings, set_point, states), bad);
        assert_eq!(cdpr_f64_start(tracker, null(), load, settings, set_point, states), bad);
        assert_eq!(cdpr_f64_start(tracker, robot, null(), settings, set_point, states), bad);
        assert_eq!(cdpr_f64_start(tracker, robot, load, null(), set_point, states), bad);
        assert_eq!(cdpr_f64_start(tracker, robot, load, settings, null(), states), bad);
        assert_eq!(cdpr_f64_start(tracker, robot, load, settings, set_point, null()), bad);
        let table = null();
        let from_table =
            cdpr_f64_start_from_table(tracker, robot, load, settings, set_point, table, 402, 0);
        assert_eq!(from_table, bad);
        assert_eq!(cdpr_f64_start(tracker, robot, load, settings, set_point, states), Status::ok());
    }
}

#[test]
fn every_code_has_its_own_text_and_nothing_else_has_one() {
    // SAFETY: the texts are of static C strings.
    let text = |code| unsafe { core::ffi::CStr::from_ptr(cdpr_text(code)) };
    for code in -10..=110 {
        let known = Code::ALL.iter().any(|known| *known as i32 == code);
        assert_eq!(text(code) != c"not a code", known, "{code}");
    }
    for (i, code) in Code::ALL.iter().enumerate() {
        for other in &Code::ALL[..i] {
            assert_ne!(text(*code as i32), text(*other as i32));
        }
    }
}

#[test]
fn version_is_that_of_the_package() {
    let part = |text: &str| text.parse::<u32>().unwrap();
    let version = part(env!("CARGO_PKG_VERSION_MAJOR")) << 16
        | part(env!("CARGO_PKG_VERSION_MINOR")) << 8
        | part(env!("CARGO_PKG_VERSION_PATCH"));
    assert_eq!(cdpr_version(), version);
}
