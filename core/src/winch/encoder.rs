//! What measures the motor angle, and how turns are counted.

use embedded_hal::spi;

use super::angle::MotorAngle;

/// A sensor of the motor angle.
pub trait Encoder {
    /// The angle now, all turns counted.
    ///
    /// # Errors
    /// [`EncoderFault`].
    fn angle(&mut self) -> Result<MotorAngle, EncoderFault>;
}

/// What a sensor found wrong with the commands it got.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CommandErrors {
    /// A frame had the wrong number of clocks.
    pub framing: bool,
    /// The register does not exist.
    pub invalid_command: bool,
    /// The parity of a command was wrong.
    pub parity: bool,
}

/// Why there is no motor angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum EncoderFault {
    /// The bus failed.
    Spi(spi::ErrorKind),
    /// The parity of an answer is wrong.
    AnswerParity,
    /// The sensor did not understand a command.
    Command(CommandErrors),
    /// The magnet is too far away.
    MagnetTooWeak,
    /// The magnet is too close.
    MagnetTooStrong,
    /// The field cannot be worked with: the magnet is badly off centre, or another one is near.
    FieldOverflow,
    /// The sensor is still starting up, or nobody answers.
    NotReady,
    /// Since the last reading the angle jumped further than the motor can turn. Turns are no longer
    /// known, until they are counted anew.
    Jump {
        /// Apparent motion.
        counts: i16,
    },
    /// More turns than can be counted.
    OutOfRange,
}

impl core::fmt::Display for EncoderFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Spi(kind) => write!(f, "encoder: SPI: {kind}"),
            Self::AnswerParity => f.write_str("encoder: the parity of an answer is wrong"),
            Self::Command(errors) => {
                f.write_str("encoder: it did not understand:")?;
                if errors.framing {
                    f.write_str(" framing")?;
                }
                if errors.invalid_command {
                    f.write_str(" invalid command")?;
                }
                if errors.parity {
                    f.write_str(" parity")?;
                }
                Ok(())
            }
            Self::MagnetTooWeak => f.write_str("encoder: the magnet is too far away"),
            Self::MagnetTooStrong => f.write_str("encoder: the magnet is too close"),
            Self::FieldOverflow => f.write_str("encoder: the magnetic field cannot be worked with"),
            Self::NotReady => f.write_str("encoder: not ready, or not there"),
            Self::Jump { counts } => {
                write!(f, "encoder: a jump of {counts} counts; turns are lost")
            }
            Self::OutOfRange => f.write_str("encoder: more turns than can be counted"),
        }
    }
}

impl core::error::Error for EncoderFault {}

/// Counts the turns of a sensor with `2^BITS` counts in a turn, `BITS` from 2 to 15.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MultiTurn<const BITS: u32> {
    counts: i32,
    furthest_counts: u16,
    fault: Option<EncoderFault>,
}

impl<const BITS: u32> MultiTurn<BITS> {
    const SHIFT: u32 = {
        assert!(BITS >= 2 && BITS <= 15);
        16 - BITS
    };

    /// Starts in turn 0 at the reading `raw`.
    ///
    /// `furthest_counts` is what the motor can move between two readings, and some more for noise.
    /// It is cut to a little less than half a turn, where one way could be taken for the other: only
    /// the difference to half a turn guards against a wrong count.
    #[must_use]
    pub fn new(raw: u16, furthest_counts: u16) -> Self {
        let furthest_counts = furthest_counts.min((1 << (BITS - 1)) - 1);
        let mut turns = Self { counts: 0, furthest_counts, fault: None };
        turns.restart(raw);
        turns
    }

    /// Counts anew from turn 0, at the reading `raw`.
    pub fn restart(&mut self, raw: u16) {
        self.counts = i32::from((raw << Self::SHIFT) >> Self::SHIFT);
        self.fault = None;
    }

    /// Takes a reading; the count since turn 0.
    ///
    /// # Errors
    /// [`EncoderFault::Jump`] or [`EncoderFault::OutOfRange`]. Both stay: a later reading that
    /// happens to be near the last good one proves nothing about the turns.
    pub fn update(&mut self, raw: u16) -> Result<i32, EncoderFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        // The difference modulo a turn, with its sign: shifted so that a turn is all 16 bits.
        let last = self.counts.cast_unsigned() & u32::from(u16::MAX);
        let last = u16::try_from(last).unwrap_or_default(); // 16 bits fit
        let moved = (raw.wrapping_sub(last) << Self::SHIFT).cast_signed() >> Self::SHIFT;
        let next = if moved.unsigned_abs() > self.furthest_counts {
            Err(EncoderFault::Jump { counts: moved })
        } else {
            self.counts.checked_add(i32::from(moved)).ok_or(EncoderFault::OutOfRange)
        };
        match next {
            Ok(counts) => self.counts = counts,
            Err(fault) => self.fault = Some(fault),
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn counts_over_the_seam_both_ways() {
        let mut turns = MultiTurn::<14>::new(16380, 100);
        assert_eq!(turns.update(16383), Ok(16383));
        assert_eq!(turns.update(2), Ok(16386));
        assert_eq!(turns.update(16382), Ok(16382));
        let mut turns = MultiTurn::<14>::new(1, 100);
        assert_eq!(turns.update(16383), Ok(-1));
        assert_eq!(turns.update(0), Ok(0));
    }

    #[test]
    fn a_jump_stays() {
        let mut turns = MultiTurn::<14>::new(100, 50);
        assert_eq!(turns.update(150), Ok(150));
        let jump = Err(EncoderFault::Jump { counts: -51 });
        assert_eq!(turns.update(99), jump);
        assert_eq!(turns.update(150), jump);
        // Half a turn is never accepted, however generous the bound.
        let mut turns = MultiTurn::<14>::new(0, u16::MAX);
        assert_eq!(turns.update(8191), Ok(8191));
        assert_eq!(turns.update(8191 + 8192), Err(EncoderFault::Jump { counts: -8192 }));
    }

    #[test]
    fn the_last_turn_is_not_passed() {
        let mut turns = MultiTurn::<14> { counts: i32::MAX - 1, furthest_counts: 100, fault: None };
        assert_eq!(turns.update(16383), Ok(i32::MAX));
        assert_eq!(turns.update(0), Err(EncoderFault::OutOfRange));
        assert_eq!(turns.update(16383), Err(EncoderFault::OutOfRange));
    }

    proptest! {
        #[test]
        fn follows_any_motion_within_its_bound(
            start in 0_u16..16384, furthest in 0_u16..8192,
            moves in prop::collection::vec(-1.0..1.0_f64, 0..200),
        ) {
            let mut turns = MultiTurn::<14>::new(start, furthest);
            let mut angle = i64::from(start);
            for part in moves {
                #[allow(clippy::cast_possible_truncation)]
                let way = (part * f64::from(furthest)) as i64;
                angle += way;
                let raw = u16::try_from(angle.rem_euclid(16384)).unwrap();
                prop_assert_eq!(turns.update(raw).map(i64::from), Ok(angle));
            }
        }

        #[test]
        fn refuses_any_motion_beyond_its_bound(
            start in 0_u16..16384, furthest in 0_u16..8191, beyond in 1_i64..8191, back: bool,
        ) {
            let way = i64::from(furthest) + beyond;
            prop_assume!(way < 16384 - i64::from(furthest)); // else it looks like a small one back
            let angle = i64::from(start) + if back { -way } else { way };
            let raw = u16::try_from(angle.rem_euclid(16384)).unwrap();
            let update = MultiTurn::<14>::new(start, furthest).update(raw);
            let jump = matches!(update, Err(EncoderFault::Jump { .. }));
            prop_assert!(jump);
        }
    }
}
