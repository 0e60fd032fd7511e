//! What a controller is told once.

use crate::controller::motion::{MotionLimits, is_positive};
use crate::{Fault, Real, TrackerSettings};

/// How a [`Controller`](crate::controller::Controller) works. Times are in ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ControllerSettings<T> {
    /// What motions may need.
    pub motion: MotionLimits<T>,
    /// Within how many ticks a motion is slowed to rest along its path, 1 to 2^16. Should take no
    /// longer than `fold_horizon_s` of the tracker: then no fold is reached.
    pub halt_ticks: u32,
    /// How long the platform moves on while there is room for a way-point behind the motion under way
    /// and none comes, for streams; `None`: to the last.
    pub stream_ticks: Option<u32>,
    /// Speed of the winches when aligning, m/s; slower ones go at their own.
    pub align_speed_m_s: T,
    /// Largest way of a winch when aligning, m.
    pub align_reach_m: T,
    /// How near measured lengths must be when aligned, m.
    pub align_tolerance_m: T,
    /// How long the winches may take to come that near after the last of their commands.
    pub settle_ticks: u32,
    /// Largest difference between measured and commanded rest length, m.
    pub following_m: T,
    /// How long the brakes take to open: nothing moves meanwhile.
    pub brake_ticks: u32,
    /// After how long at rest the brakes close; `None`: never while armed.
    pub brake_after_ticks: Option<u32>,
}

/// A setting that is not positive and finite, or out of its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SettingFault(
    /// Its name.
    pub &'static str,
);

impl core::fmt::Display for SettingFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "the setting {} is out of range", self.0)
    }
}

impl core::error::Error for SettingFault {}

impl<T: Real> ControllerSettings<T> {
    /// # Errors
    /// [`SettingFault`] names the first that is wrong.
    pub(super) fn check(&self, tracker: &TrackerSettings<T>) -> Result<(), SettingFault> {
        const LONGEST_HALT: u32 = 1 << 16;
        let checks = [
            ("period_s", is_positive(tracker.period_s)),
            ("fastest_m_s", tracker.cables.iter().all(|cable| is_positive(cable.fastest_m_s))),
            ("motion", self.motion.are_positive()),
            ("halt_ticks", (1..=LONGEST_HALT).contains(&self.halt_ticks)),
            ("align_speed_m_s", is_positive(self.align_speed_m_s)),
            ("align_reach_m", is_positive(self.align_reach_m)),
            ("align_tolerance_m", is_positive(self.align_tolerance_m)),
            ("following_m", is_positive(self.following_m)),
        ];
        match checks.iter().find(|(_, is_good)| !is_good) {
            Some(&(name, _)) => Err(SettingFault(name)),
            None => Ok(()),
        }
    }
}

/// Why a controller does not start.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StartFault<T> {
    /// A setting is wrong.
    Setting(SettingFault),
    /// The tracker does not start.
    Tracker(Fault<T>),
}

impl<T: core::fmt::Display> core::fmt::Display for StartFault<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Setting(fault) => fault.fmt(f),
            Self::Tracker(fault) => fault.fmt(f),
        }
    }
}

impl<T: core::fmt::Debug + core::fmt::Display> core::error::Error for StartFault<T> {}
