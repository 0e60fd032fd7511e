//! What the compiler cannot see: arguments for images that are linked and never run. Not a part of the library, which
//! brings a panic handler and a log; an image includes this file.

#![allow(dead_code)] // each image uses some of it

use core::hint::black_box;

use cdpr_core::controller::{ControllerSettings, MotionLimits, Pace, Readings, Stance, WayPoint};
use cdpr_core::winch::{DrumDesign, Sense};
use cdpr_core::{
    CABLES, Cable, CableLimits, CableState, GeometryFault, IrvineCatenary, Load, Real, Robot,
    SetPoint, TrackerSettings, Twist,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// The numbers of an image whose size counts.
#[cfg(not(feature = "f64"))]
pub(crate) type Float = f32;
#[cfg(feature = "f64")]
pub(crate) type Float = f64;

pub(crate) fn number<T: Real>() -> T {
    black_box(T::one())
}

pub(crate) fn vector<T: Real>() -> Vector3<T> {
    Vector3::new(number(), number(), number())
}

pub(crate) fn robot<T: Real>() -> Result<Robot<T, IrvineCatenary<T>>, GeometryFault> {
    let model = IrvineCatenary { weight_n_m: number(), compliance_per_n: number() };
    let cable = || Cable { anchor_m: vector(), attachment_m: vector(), model };
    Robot::new(black_box([(); CABLES].map(|()| cable())))
}

pub(crate) fn load<T: Real>() -> Load<T> {
    Load {
        mass_kg: number(),
        center_of_mass_m: vector(),
        gravity_m_s2: number(),
        force_n: vector(),
        moment_nm: vector(),
    }
}

pub(crate) fn states<T: Real>() -> [CableState<T>; CABLES] {
    [(); CABLES].map(|()| CableState { force_n: vector().xy(), rest_length_m: number() })
}

pub(crate) fn stance<T: Real>() -> Stance<T> {
    let q = Quaternion::new(number(), number(), number(), number());
    Stance { position_m: vector(), orientation: UnitQuaternion::new_unchecked(q) }
}

pub(crate) fn twist<T: Real>() -> Twist<T> {
    Twist { linear_m_s: vector(), angular_rad_s: vector() }
}

pub(crate) fn set_point<T: Real>() -> Option<SetPoint<T>> {
    Some(SetPoint { pose: stance().pose().ok()?, twist: twist() })
}

pub(crate) fn way_point<T: Real>() -> WayPoint<T> {
    let pace = if black_box(true) { Pace::Duration(number()) } else { Pace::Share(number()) };
    WayPoint { stance: stance(), twist: twist(), pace }
}

pub(crate) fn readings<T: Real>() -> Readings<T> {
    black_box(Readings {
        rest_lengths_m: [(); CABLES].map(|()| number()),
        failed_winch: black_box(Some(7)),
        emergency_stop: black_box(false),
    })
}

pub(crate) fn tracker_settings<T: Real>() -> TrackerSettings<T> {
    let limits = CableLimits {
        shortest_m: number(),
        longest_m: number(),
        fastest_m_s: number(),
        lowest_tension_n: number(),
        highest_tension_n: number(),
    };
    TrackerSettings {
        period_s: number(),
        largest_move_m: number(),
        least_distance: number(),
        fold_horizon_s: number(),
        largest_error_n: number(),
        cables: [limits; CABLES],
    }
}

pub(crate) fn controller_settings<T: Real>() -> ControllerSettings<T> {
    black_box(ControllerSettings {
        motion: MotionLimits {
            distance_m: number(),
            speed_m_s: number(),
            acceleration_m_s2: number(),
            jerk_m_s3: number(),
            turn_speed_rad_s: number(),
            turn_acceleration_rad_s2: number(),
            turn_jerk_rad_s3: number(),
        },
        halt_ticks: black_box(3),
        stream_ticks: black_box(Some(3)),
        align_speed_m_s: number(),
        align_reach_m: number(),
        align_tolerance_m: number(),
        settle_ticks: black_box(3),
        following_m: number(),
        brake_ticks: black_box(3),
        brake_after_ticks: black_box(Some(3)),
    })
}

pub(crate) fn drum_design() -> DrumDesign {
    black_box(DrumDesign {
        radius_m: 1.0,
        pitch_m: 1.0,
        gear: 1.0,
        sense: Sense::Forward,
        winding_tension_n: 1.0,
        compliance_per_n: 1.0,
    })
}
