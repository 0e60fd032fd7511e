//! The robot as this firmware knows it: MARIONET-CRANE.

use cdpr_core::controller::monitor::MonitorThresholds;
use cdpr_core::controller::{ControllerSettings, MotionLimits};
use cdpr_core::winch::{Countable, DrumDesign, Sense};
use cdpr_core::{
    CABLES, Cable, CableLimits, CableState, GeometryFault, IrvineCatenary, Load, Real, Robot,
    TrackerSettings,
};
use cdpr_link::station::Blueprint;
use nalgebra::{Vector2, Vector3};

use crate::path::PERIOD_S;

/// The model of all cables.
pub type Model<T> = IrvineCatenary<T>;

/// Anchors `A1..A6`, world frame, m.
const ANCHORS_M: [[f64; 3]; CABLES] = [
    [-3.259, -0.475, 8.826],
    [9.421, -3.482, 11.555],
    [9.538, 3.797, 11.533],
    [5.570, 20.414, 8.704],
    [-2.505, 16.810, 8.649],
    [-3.342, 9.421, 8.788],
];

/// Attachments `b1..b6`, platform frame, m.
const ATTACHMENTS_M: [[f64; 3]; CABLES] = [
    [-0.10, -0.93, -0.03],
    [0.10, -0.93, -0.03],
    [0.27, 0.50, -0.07],
    [0.27, 0.50, -0.07],
    [-0.27, 0.50, -0.07],
    [-0.27, 0.50, -0.07],
];

const GRAVITY_M_S2: f64 = 9.81;

/// Cable of 0.079 kg/m.
const WEIGHT_N_M: f64 = 0.079 * GRAVITY_M_S2;

/// 4 mm thick, modulus 1e11 Pa: `EA = pi (2 mm)^2 E`.
const COMPLIANCE_PER_N: f64 = 1.0 / 1.256_637_061_435_917_2e6;

/// Where every path starts, m; the platform is level there.
const START_POSITION_M: [f64; 3] = [2.0, 7.0, 2.5];

/// What the platform carries, and how the cables then hang at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Payload {
    /// Mass of platform and payload, kg, centred on the platform origin.
    mass_kg: f64,
    /// Rest length (m), Fx and Fz (N) of each cable at the start: the one solution there with rest
    /// lengths up to 60 m, as `cdpr enumerate --position 2,7,2.5 --max-length 60` proves.
    start: [[f64; 3]; CABLES],
}

/// The payload of the paper's robot.
pub const LOADED: Payload = Payload {
    mass_kg: 69.0,
    start: [
        [10.479_832, 155.414_69, -114.487_35],
        [15.077_343, 179.357_76, -129.583_59],
        [12.221_567, 131.308_53, -141.830_1],
        [14.731_523, 166.606_8, -72.739_22],
        [11.970_178, 129.781_62, -74.298_386],
        [8.355_886, 125.545_906, -143.951_37],
    ],
};

/// A bare platform, lighter than its cables.
pub const EMPTY: Payload = Payload {
    mass_kg: 5.0,
    start: [
        [10.515_526, 18.232_08, -9.975_572],
        [15.187_233, 17.957_001, -7.973_967],
        [12.270_071, 13.874_217, -10.995_676],
        [14.840_387, 22.224_729, -4.898_337],
        [12.262_932, 8.903_332, -1.014_676],
        [8.368_752, 14.772_827, -14.191_771],
    ],
};

/// The warm-start table of the crane with the payload [`LOADED`], of a few cells. It covers what start and
/// recovery need, [`TAUT`](crate::path::TAUT) where it is level within a degree.
///
/// ```text
/// cdpr table build --position 2,7,2.5 --region 1.8..2.2,6.8..7.2,1.8..2.6 --tilt-deg 1 \
///     --max-length 50 --steps 2 --out firmware-example/tables/marionet-crane.cdpr
/// ```
pub const TABLE: &[u8] = include_bytes!("../tables/marionet-crane.cdpr");

/// What the winches can do.
const LIMITS: CableLimits<f64> = CableLimits {
    shortest_m: 1.0,
    longest_m: 50.0,
    fastest_m_s: 3.0,
    lowest_tension_n: 1.0,
    highest_tension_n: 2000.0,
};

/// Largest move at a tick, m: four times that of the fastest path, so that a few lost set-points do no
/// harm.
const LARGEST_MOVE_M: f64 = 4e-3;

/// Least distance to a singularity.
const LEAST_DISTANCE: f64 = 1e-3;

/// A fold nearer than this is refused, s: the time the winches need to stop.
const FOLD_HORIZON_S: f64 = 0.2;

/// Largest distance from the true solution, N: above what rounding in f32 leaves.
const LARGEST_ERROR_N: f64 = 1.0;

/// The drum of every winch: 5 cm, behind a gear of 20, wound at about the tension of the paper's load.
pub const DRUM: DrumDesign = DrumDesign {
    radius_m: 0.05,
    pitch_m: 0.006,
    gear: 20.0,
    sense: Sense::Forward,
    winding_tension_n: 200.0,
    compliance_per_n: COMPLIANCE_PER_N,
};

/// The monitor warns at a third of what a cable bears at the start, 181 N on average, in common, as the
/// quickest way of [`TAUT`](crate::path::TAUT), 1.1 m/s² against gravity, changes it by a ninth; and among the
/// cables above all of it, as a cable that takes over another's share does: circles at 0.5 m/s, in which nothing is
/// wrong, spread them by 121 N (`cdpr simulate`).
const MONITOR: MonitorThresholds = MonitorThresholds { swing_n: 60.0, spread_n: 200.0 };

/// How far the winches are from their lengths when the power is switched on, m.
pub const OFF_AT_START_M: f64 = 0.003;

/// The robot.
///
/// # Errors
/// [`GeometryFault`], were the constants of this file wrong.
pub fn crane<T: Real>() -> Result<Robot<T, Model<T>>, GeometryFault> {
    let model = IrvineCatenary {
        weight_n_m: T::constant(WEIGHT_N_M),
        compliance_per_n: T::constant(COMPLIANCE_PER_N),
    };
    Robot::new(core::array::from_fn(|i| Cable {
        anchor_m: vector(ANCHORS_M[i]),
        attachment_m: vector(ATTACHMENTS_M[i]),
        model,
    }))
}

/// What it carries.
#[must_use]
pub fn load<T: Real>(payload: &Payload) -> Load<T> {
    Load {
        mass_kg: T::constant(payload.mass_kg),
        center_of_mass_m: vector([0.0; 3]),
        gravity_m_s2: T::constant(GRAVITY_M_S2),
        force_n: vector([0.0; 3]),
        moment_nm: vector([0.0; 3]),
    }
}

/// Rate and limits.
#[must_use]
pub fn settings<T: Real>() -> TrackerSettings<T> {
    let c = T::constant;
    TrackerSettings {
        period_s: c(PERIOD_S),
        largest_move_m: c(LARGEST_MOVE_M),
        least_distance: c(LEAST_DISTANCE),
        fold_horizon_s: c(FOLD_HORIZON_S),
        largest_error_n: c(LARGEST_ERROR_N),
        cables: [CableLimits {
            shortest_m: c(LIMITS.shortest_m),
            longest_m: c(LIMITS.longest_m),
            fastest_m_s: c(LIMITS.fastest_m_s),
            lowest_tension_n: c(LIMITS.lowest_tension_n),
            highest_tension_n: c(LIMITS.highest_tension_n),
        }; CABLES],
    }
}

/// Motions and winches.
#[must_use]
pub fn controller_settings<T: Real>() -> ControllerSettings<T> {
    let c = T::constant;
    ControllerSettings {
        motion: MotionLimits {
            distance_m: c(1.0),
            speed_m_s: c(1.2),
            acceleration_m_s2: c(5.0),
            jerk_m_s3: c(200.0),
            turn_speed_rad_s: c(0.5),
            turn_acceleration_rad_s2: c(4.0),
            turn_jerk_rad_s3: c(200.0),
        },
        halt_ticks: 100, // half of FOLD_HORIZON_S
        stream_ticks: None,
        align_speed_m_s: c(0.05),
        align_reach_m: c(0.05),
        align_tolerance_m: c(1e-3),
        settle_ticks: 100,
        following_m: c(0.02),
        brake_ticks: 50,
        brake_after_ticks: Some(200),
    }
}

/// All that a station needs to know, carrying [`LOADED`], for which [`TABLE`] is.
///
/// # Errors
/// [`GeometryFault`], were the constants of this file wrong.
pub fn blueprint<T: Countable>() -> Result<Blueprint<T, Model<T>>, GeometryFault> {
    Ok(Blueprint {
        robot: crane()?,
        load: load(&LOADED),
        tracker: settings(),
        controller: controller_settings(),
        drum: DRUM,
        monitor: MONITOR,
    })
}

/// Where every path starts, m.
#[must_use]
pub fn start_position_m<T: Real>() -> Vector3<T> {
    vector(START_POSITION_M)
}

/// Forces and rest lengths there.
#[must_use]
pub fn start_states<T: Real>(payload: &Payload) -> [CableState<T>; CABLES] {
    payload.start.map(|[rest_length_m, fx_n, fz_n]| CableState {
        force_n: Vector2::new(T::constant(fx_n), T::constant(fz_n)),
        rest_length_m: T::constant(rest_length_m),
    })
}

/// Rest lengths there, m.
#[must_use]
pub fn start_lengths_m<T: Real>(payload: &Payload) -> [T; CABLES] {
    payload.start.map(|[rest_length_m, ..]| T::constant(rest_length_m))
}

fn vector<T: Real>(coordinates: [f64; 3]) -> Vector3<T> {
    Vector3::from(coordinates.map(T::constant))
}
