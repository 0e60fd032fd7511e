//! States of the controller, what it reads and writes at each tick, and why it says no.

use crate::{CABLES, Fault};

/// What the controller does.
///
/// ```text
///            arm             all at their lengths          way-point, brakes open
/// Disarmed -----> Aligning --------------------> Holding <-----------------------> Tracking
///    ^  ^            |                              |       at rest, stop, fault
///    |  +------------+------- disarm ---------------+
///    +---- acknowledge ---- Fault <---- from everywhere
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State<T> {
    /// Brakes on; nothing moves.
    Disarmed,
    /// The winches go from the lengths they have to those of the tracker.
    Aligning,
    /// The platform stands at the last certified pose.
    Holding,
    /// A motion is under way.
    Tracking,
    /// Brakes on, until the cause is gone and acknowledged.
    Fault(Cause<T>),
}

/// Why the controller is in [`State::Fault`]. Cables are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Cause<T> {
    /// The emergency stop is pressed.
    EmergencyStop,
    /// This winch has failed.
    WinchFailed(usize),
    /// The length measured at this winch is infinite or NaN.
    NonFiniteReading(usize),
    /// A winch does not follow its commands.
    FollowingError {
        /// The cable.
        cable: usize,
        /// Measured less commanded rest length, m.
        error_m: T,
    },
    /// A winch did not reach its length in time when aligning.
    NotAligned {
        /// The cable.
        cable: usize,
        /// Measured less commanded rest length, m.
        error_m: T,
    },
    /// There is no command for the way ahead, and the platform could not be halted before.
    Tracker(Fault<T>),
}

/// What the winches and the emergency stop report at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings<T> {
    /// Measured rest lengths from the anchor to the attachment, m.
    pub rest_lengths_m: [T; CABLES],
    /// A winch that has failed, counted from 0.
    pub failed_winch: Option<usize>,
    /// Whether the emergency stop is pressed.
    pub emergency_stop: bool,
}

/// What one winch is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WinchTarget<T> {
    /// Rest length, m.
    pub rest_length_m: T,
    /// Its rate of change, for speed feed-forward, m/s.
    pub rate_m_s: T,
}

/// What the winches are to do until the next tick.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Outputs<T> {
    /// One target for each winch, or `None`: keep the last length, rate zero.
    pub targets: Option<[WinchTarget<T>; CABLES]>,
    /// Whether the brakes are to be open.
    pub brakes_released: bool,
}

/// Why a request was not granted; nothing has changed. Cables are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Refusal<T> {
    /// Not in this state.
    NotNow(State<T>),
    /// There is nothing to resume or cancel: the platform stands where it should.
    NotHalted,
    /// The cause is still there.
    Persists(Cause<T>),
    /// The winch of this cable is too far from where it should be.
    TooFarToAlign {
        /// The cable.
        cable: usize,
        /// Measured less wanted rest length, m.
        error_m: T,
    },
    /// The tracker does not start anew.
    NoRestart(Fault<T>),
}

impl<T: core::fmt::Display> core::fmt::Display for State<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Disarmed => f.write_str("disarmed"),
            Self::Aligning => f.write_str("aligning"),
            Self::Holding => f.write_str("holding"),
            Self::Tracking => f.write_str("tracking"),
            Self::Fault(cause) => write!(f, "fault: {cause}"),
        }
    }
}

impl<T: core::fmt::Display> core::fmt::Display for Cause<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::EmergencyStop => f.write_str("emergency stop"),
            Self::WinchFailed(winch) => write!(f, "winch {} has failed", winch + 1),
            Self::NonFiniteReading(winch) => {
                write!(f, "winch {}: the measured length is not finite", winch + 1)
            }
            Self::FollowingError { cable, error_m } => {
                write!(f, "cable {}: {error_m} m off the commanded length", cable + 1)
            }
            Self::NotAligned { cable, error_m } => {
                write!(f, "cable {}: not aligned, {error_m} m off", cable + 1)
            }
            Self::Tracker(fault) => fault.fmt(f),
        }
    }
}

impl<T: core::fmt::Display> core::fmt::Display for Refusal<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotNow(state) => write!(f, "not while {state}"),
            Self::NotHalted => f.write_str("nothing was halted"),
            Self::Persists(cause) => write!(f, "still there: {cause}"),
            Self::TooFarToAlign { cable, error_m } => {
                write!(f, "cable {}: {error_m} m is too far to align", cable + 1)
            }
            Self::NoRestart(fault) => fault.fmt(f),
        }
    }
}

impl<T: core::fmt::Debug + core::fmt::Display> core::error::Error for Refusal<T> {}
