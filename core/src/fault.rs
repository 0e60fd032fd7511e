//! What can go wrong at a control tick, and what the caller is to do about it.

use crate::{GeometryFault, Real, StepFault, TableFault};

/// Why a tick gives no new command. The last certified command stands. Cables are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Fault<T> {
    /// A number of the set-point is infinite or NaN. Mend the source; the next good one is taken.
    NonFiniteSetPoint,
    /// The set-point lies further from the last pose than a tick may move. Send poses in between.
    JumpingSetPoint {
        /// Distance of the platform origin from its last position, m.
        distance_m: T,
        /// Largest move of an attachment relative to the platform origin, m.
        turn_m: T,
    },
    /// No set-point has come for longer than allowed. Hold; mend the source.
    StaleSetPoint {
        /// Ticks since the last one.
        age_ticks: u32,
    },
    /// The pose has no cable planes.
    Geometry(GeometryFault),
    /// No Newton step could be taken: a vanishing tension, or singular statics.
    Step(StepFault),
    /// The cables hardly hold the platform against some wrench. Go back the way.
    NearSingularity {
        /// Reciprocal of the Frobenius norm of the inverse of the matrix of tangent wrenches: how
        /// much the matrix may change before it is singular. Between 0 and 1.
        distance: T,
    },
    /// At the present speed this branch ends in a fold. Stop within the time, or go back.
    FoldAhead {
        /// Time to the fold, s.
        time_s: T,
    },
    /// A tension is above its limit. Go back, or lighten the load.
    TensionAbove {
        /// The cable.
        cable: usize,
        /// The larger of the tensions at its ends, N.
        tension_n: T,
    },
    /// The tension at an anchor is below its limit: the cable may jump off its drum. Go back.
    TensionBelow {
        /// The cable.
        cable: usize,
        /// Tension at the anchor, N.
        tension_n: T,
    },
    /// The rest length is longer or shorter than the winch can hold. Go back.
    LengthBeyondWinch {
        /// The cable.
        cable: usize,
        /// Rest length wanted, m.
        rest_length_m: T,
    },
    /// The rest length would have to change faster than the winch can. Go slower.
    SpeedBeyondWinch {
        /// The cable.
        cable: usize,
        /// Speed wanted, m/s.
        speed_m_s: T,
    },
    /// The equations are not met to the rounding of the number type.
    ResidualNotMet {
        /// Largest distance between the end of a cable and its attachment, m.
        closure_m: T,
        /// Unbalanced wrench, moments over the moment arm, N.
        imbalance_n: T,
    },
    /// That the solution belongs to the branch could not be proven, not even in the smallest steps.
    /// Go slower, or back.
    NotCertified {
        /// Contraction that was found; at most 0.44 is needed, and cables that stay near where they are.
        contraction: T,
    },
    /// A start was to come from a table, which is not used or has none for the pose.
    Table(TableFault),
}

/// What is to be done after a [`Fault`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Remedy {
    /// Stand still; a sound set-point near the last pose is taken as if nothing had been.
    MendSetPoint,
    /// The pose is right but the way there too fast: the same in smaller steps is taken.
    GoSlower,
    /// This pose is not to be had on this branch: go back the way.
    GoBack,
    /// The warm-start table cannot be used: write the right one.
    ReplaceTable,
}

impl<T: Real> Fault<T> {
    /// What is to be done.
    #[must_use]
    pub fn remedy(&self) -> Remedy {
        match self {
            Self::NonFiniteSetPoint | Self::StaleSetPoint { .. } => Remedy::MendSetPoint,
            Self::JumpingSetPoint { .. }
            | Self::SpeedBeyondWinch { .. }
            | Self::NotCertified { .. }
            | Self::ResidualNotMet { .. } => Remedy::GoSlower,
            Self::Geometry(_)
            | Self::Step(_)
            | Self::NearSingularity { .. }
            | Self::FoldAhead { .. }
            | Self::TensionAbove { .. }
            | Self::TensionBelow { .. }
            | Self::LengthBeyondWinch { .. }
            | Self::Table(TableFault::OutsideRegion | TableFault::Uncovered(_)) => Remedy::GoBack,
            Self::Table(_) => Remedy::ReplaceTable,
        }
    }
}

impl<T: core::fmt::Display> core::fmt::Display for Fault<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NonFiniteSetPoint => f.write_str("a number of the set-point is not finite"),
            Self::JumpingSetPoint { distance_m, turn_m } => {
                write!(f, "the set-point jumps by {distance_m} m and turns by {turn_m} m")
            }
            Self::StaleSetPoint { age_ticks } => write!(f, "no set-point for {age_ticks} ticks"),
            Self::Geometry(fault) => fault.fmt(f),
            Self::Step(fault) => fault.fmt(f),
            Self::NearSingularity { distance } => {
                write!(f, "near a singularity, at a distance of {distance}")
            }
            Self::FoldAhead { time_s } => write!(f, "the branch ends in a fold in {time_s} s"),
            Self::TensionAbove { cable, tension_n } => {
                write!(f, "cable {}: a tension of {tension_n} N is too high", cable + 1)
            }
            Self::TensionBelow { cable, tension_n } => {
                write!(f, "cable {}: a tension of {tension_n} N is too low", cable + 1)
            }
            Self::LengthBeyondWinch { cable, rest_length_m } => {
                write!(f, "cable {}: a length of {rest_length_m} m is beyond the winch", cable + 1)
            }
            Self::SpeedBeyondWinch { cable, speed_m_s } => {
                write!(f, "cable {}: a speed of {speed_m_s} m/s is beyond the winch", cable + 1)
            }
            Self::ResidualNotMet { closure_m, imbalance_n } => {
                write!(f, "equations missed by {closure_m} m and {imbalance_n} N")
            }
            Self::NotCertified { contraction } => {
                write!(f, "the branch is not certified (contraction {contraction})")
            }
            Self::Table(fault) => write!(f, "warm-start table: {fault}"),
        }
    }
}

impl<T: core::fmt::Debug + core::fmt::Display> core::error::Error for Fault<T> {}
