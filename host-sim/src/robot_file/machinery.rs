//! What moves the robot and steers it: optional sections of the robot file, for simulation.

use cdpr_core::controller::monitor::MonitorThresholds;
use cdpr_core::controller::{ControllerSettings, MotionLimits};
use cdpr_core::winch::{DrumDesign, Sense};
use cdpr_core::{CableLimits, Real, TrackerSettings};
use serde::Deserialize;
use toml::Spanned;

use crate::input_file::InputFileError;
use crate::robot_file::{CableMaterial, RobotDescription};
use crate::toml_file::Source;

/// Declares a section of numbers: its public type with the values used when the file gives none, and how it is
/// read. Numbers are finite, and `positive` or `not_negative`.
macro_rules! section {
    (
        $(#[$about:meta])* $name:ident, $raw:ident, $table:literal:
        $($(#[doc = $doc:literal])+ $field:ident: $kind:ident = $value:expr;)+
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name {
            $($(#[doc = $doc])+ pub $field: f64,)+
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $value,)+ }
            }
        }

        #[derive(Default, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub(super) struct $raw {
            $($field: Option<Spanned<f64>>,)+
        }

        impl $raw {
            pub(super) fn check(&self, source: &Source<'_>) -> Result<$name, InputFileError> {
                let mut section = $name::default();
                $(if let Some(value) = &self.$field {
                    let field = concat!($table, ".", stringify!($field));
                    section.$field = source.$kind(value, field)?;
                })+
                Ok(section)
            }
        }
    };
}

section! {
    /// The platform as a rigid body in air.
    Body, RawBody, "body":
    /// Principal moment of inertia about the centre of mass along the platform's x axis, kg m^2.
    inertia_x_kg_m2: positive = 12.0;
    /// The same along y, kg m^2.
    inertia_y_kg_m2: positive = 12.0;
    /// The same along z, kg m^2.
    inertia_z_kg_m2: positive = 12.0;
    /// Area times drag coefficient, the same from all sides, m^2.
    drag_area_m2: not_negative = 0.3;
    /// How long cable stress lags behind strain (Kelvin-Voigt), s. A mode of f hertz is damped by `pi f` times it.
    cable_damping_s: not_negative = 1e-3;
}

section! {
    /// Drum, motor and amplifier of every winch.
    WinchDesign, RawWinchDesign, "winch":
    /// Radius of the drum to the middle of the cable, m.
    drum_radius_m: positive = 0.05;
    /// Way of the cable along the drum in a turn, m.
    drum_pitch_m: not_negative = 0.006;
    /// Turns of the motor for one of the drum.
    gear: positive = 20.0;
    /// Tension under which the cable was wound, N.
    winding_tension_n: not_negative = 200.0;
    /// Inertia of motor, gear and drum, at the motor, kg m^2.
    motor_inertia_kg_m2: positive = 2e-4;
    /// Largest torque of the motor, N m.
    max_torque_nm: positive = 7.0;
    /// Highest rate of the rest length, m/s.
    max_speed_m_s: positive = 3.0;
    /// Dry friction, felt at the cable, N.
    dry_friction_n: not_negative = 20.0;
    /// Viscous friction, felt at the cable, N s/m.
    viscous_friction_n_s_m: not_negative = 50.0;
    /// Bandwidth of the amplifier's speed loop, rad/s.
    speed_bandwidth_rad_s: positive = 400.0;
    /// Speed for a distance to the target, 1/s.
    position_gain_per_s: positive = 50.0;
    /// From a command until the amplifier has it, s.
    command_delay_s: not_negative = 1e-3;
    /// Until a brake is open, s.
    brake_opens_s: not_negative = 0.03;
    /// Until a brake grips, s.
    brake_grips_s: not_negative = 0.02;
}

section! {
    /// What the controller is told.
    Control, RawControl, "control":
    /// Time between two ticks, s.
    period_s: positive = 1e-3;
    /// Shortest rest length, m.
    min_length_m: positive = 1.0;
    /// Lowest tension at the anchor, N.
    min_tension_n: not_negative = 1.0;
    /// Largest move of the platform in a tick, m.
    largest_move_m: positive = 4e-3;
    /// Least distance to a singularity.
    least_distance: positive = 1e-3;
    /// A fold that would be reached sooner is refused, s.
    fold_horizon_s: not_negative = 0.2;
    /// Largest distance from the true solution, N along the force curves.
    largest_error_n: positive = 1.0;
    /// Largest distance between two way-points, m.
    motion_distance_m: positive = 1.0;
    /// Speed of the platform, m/s.
    speed_m_s: positive = 1.2;
    /// Acceleration of the platform, m/s^2.
    acceleration_m_s2: positive = 5.0;
    /// Jerk of the platform, m/s^3.
    jerk_m_s3: positive = 200.0;
    /// Angular speed, rad/s.
    turn_speed_rad_s: positive = 0.5;
    /// Angular acceleration, rad/s^2.
    turn_acceleration_rad_s2: positive = 4.0;
    /// Angular jerk, rad/s^3.
    turn_jerk_rad_s3: positive = 200.0;
    /// Within what time the platform halts, s.
    halt_s: positive = 0.1;
    /// Speed of the winches when aligning, m/s.
    align_speed_m_s: positive = 0.05;
    /// Largest way of a winch when aligning, m.
    align_reach_m: positive = 0.05;
    /// How near lengths must be when aligned, m.
    align_tolerance_m: positive = 1e-3;
    /// How long that may take, s.
    settle_s: positive = 0.1;
    /// Largest difference between measured and commanded rest length, m.
    following_m: positive = 0.02;
    /// How long brakes are waited for, s.
    brake_s: not_negative = 0.05;
    /// After how long at rest the brakes close, s.
    brake_after_s: positive = 0.2;
    /// Time between way-points, s.
    way_point_s: positive = 0.05;
    /// The load swings when the mean excess of tension deviates by more, N.
    swing_n: positive = 60.0;
    /// The load is not shared as commanded when the excesses deviate by more, N.
    spread_n: positive = 200.0;
}

/// `time_s` in whole ticks of `period_s`.
fn ticks(time_s: f64, period_s: f64) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let ticks = (time_s / period_s).round() as u32;
    ticks
}

impl RobotDescription {
    /// Rate and limits of the tracker, each rounded to `T`.
    #[must_use]
    pub fn tracker_settings<T: Real>(&self) -> TrackerSettings<T> {
        let (c, control) = (T::constant, &self.control);
        TrackerSettings {
            period_s: c(control.period_s),
            largest_move_m: c(control.largest_move_m),
            least_distance: c(control.least_distance),
            fold_horizon_s: c(control.fold_horizon_s),
            largest_error_n: c(control.largest_error_n),
            cables: self.limits.map(|limits| CableLimits {
                shortest_m: c(control.min_length_m),
                longest_m: c(limits.max_length_m),
                fastest_m_s: c(self.winch.max_speed_m_s),
                lowest_tension_n: c(control.min_tension_n),
                highest_tension_n: c(limits.max_tension_n),
            }),
        }
    }

    /// Settings of the controller, each rounded to `T`.
    #[must_use]
    pub fn controller_settings<T: Real>(&self) -> ControllerSettings<T> {
        let (c, control) = (T::constant, &self.control);
        let ticks = |time_s| ticks(time_s, control.period_s);
        ControllerSettings {
            motion: self.motion_limits(),
            halt_ticks: ticks(control.halt_s).max(1),
            stream_ticks: None,
            align_speed_m_s: c(control.align_speed_m_s),
            align_reach_m: c(control.align_reach_m),
            align_tolerance_m: c(control.align_tolerance_m),
            settle_ticks: ticks(control.settle_s),
            following_m: c(control.following_m),
            brake_ticks: ticks(control.brake_s),
            brake_after_ticks: Some(ticks(control.brake_after_s)),
        }
    }

    /// What motions may need, each rounded to `T`.
    #[must_use]
    pub fn motion_limits<T: Real>(&self) -> MotionLimits<T> {
        let (c, control) = (T::constant, &self.control);
        MotionLimits {
            distance_m: c(control.motion_distance_m),
            speed_m_s: c(control.speed_m_s),
            acceleration_m_s2: c(control.acceleration_m_s2),
            jerk_m_s3: c(control.jerk_m_s3),
            turn_speed_rad_s: c(control.turn_speed_rad_s),
            turn_acceleration_rad_s2: c(control.turn_acceleration_rad_s2),
            turn_jerk_rad_s3: c(control.turn_jerk_rad_s3),
        }
    }

    /// The drum of every winch, the stretch of its cable that of the first.
    #[must_use]
    pub fn drum(&self) -> DrumDesign {
        let winch = &self.winch;
        let CableMaterial { axial_stiffness_n, .. } = self.robot.cables()[0].model;
        DrumDesign {
            radius_m: winch.drum_radius_m,
            pitch_m: winch.drum_pitch_m,
            gear: winch.gear,
            sense: Sense::Forward,
            winding_tension_n: winch.winding_tension_n,
            compliance_per_n: 1.0 / axial_stiffness_n,
        }
    }

    /// When the monitor of tensions warns.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "to the nearest")]
    pub fn monitor(&self) -> MonitorThresholds {
        MonitorThresholds {
            swing_n: self.control.swing_n as f32,
            spread_n: self.control.spread_n as f32,
        }
    }
}
