//! What drives a winch, seen from the control loop.

use embedded_hal::{digital, pwm};

use super::angle::MotorAngle;

/// A motor with its amplifier.
pub trait Drive<T> {
    /// To be called once a tick: the motor should now stand at `angle` and move at `speed_rad_s`
    /// until the next tick; `measured` is where it stands. Speeds are positive for growing angles.
    ///
    /// # Errors
    /// [`DriveFault`]. A command that is too fast or too far is refused as a whole: nothing is
    /// written, and what was commanded before goes on until [`Drive::stop`].
    fn command(
        &mut self,
        angle: MotorAngle,
        speed_rad_s: T,
        measured: MotorAngle,
    ) -> Result<(), DriveFault<T>>;

    /// No motion from now on, until the next command. May be called at any time.
    ///
    /// # Errors
    /// [`DriveFault`] when an output could not be written; all of them were tried.
    fn stop(&mut self) -> Result<(), DriveFault<T>>;
}

/// Why a drive does not follow.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum DriveFault<T> {
    /// A pin could not be written.
    Pin(digital::ErrorKind),
    /// The duty cycle could not be written.
    Pwm(pwm::ErrorKind),
    /// The motor would have to turn faster than it can.
    OverSpeed {
        /// Speed wanted, rad/s.
        speed_rad_s: T,
        /// Highest speed, rad/s.
        limit_rad_s: T,
    },
    /// The angle is further than can be counted, or not a number.
    OutOfRange,
}

impl<T: core::fmt::Display> core::fmt::Display for DriveFault<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Pin(kind) => write!(f, "drive: pin: {kind}"),
            Self::Pwm(kind) => write!(f, "drive: PWM: {kind}"),
            Self::OverSpeed { speed_rad_s, limit_rad_s } => {
                write!(f, "drive: {speed_rad_s} rad/s are more than {limit_rad_s} rad/s")
            }
            Self::OutOfRange => f.write_str("drive: the angle is further than can be counted"),
        }
    }
}

impl<T: core::fmt::Debug + core::fmt::Display> core::error::Error for DriveFault<T> {}
