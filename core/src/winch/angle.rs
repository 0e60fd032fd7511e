//! The angle of a motor shaft over many turns, as fine at the last turn as at the first.

use core::num::NonZeroU32;

use num_traits::{FromPrimitive, ToPrimitive};

use crate::Real;

/// A [`Real`] that is exchanged with counters: `f32` or `f64`.
pub trait Countable: Real + FromPrimitive + ToPrimitive {}

impl<T: Real + FromPrimitive + ToPrimitive> Countable for T {}

/// Which of the two ways something turns, or is wired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sense {
    /// The same way: +1.
    Forward,
    /// The other way: -1.
    Reverse,
}

/// Angle of a motor shaft, counted through all turns, in units of 2^-32 turn.
///
/// A float cannot hold it: 24000 rad in `f32` are only known to 0.002 rad, and a difference of two
/// such numbers, which is what a drive follows, is mostly rounding. Whole turns and fraction in one
/// integer give the same 2^-32 turn everywhere, differences are exact, and the range of 2^31 turns
/// is beyond any winch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorAngle(i64);

/// Units of [`MotorAngle`] in a turn.
pub(super) const UNITS_PER_TURN: f64 = 4_294_967_296.0;

/// Units of [`MotorAngle`] in a radian.
pub(super) const UNITS_PER_RAD: f64 = UNITS_PER_TURN / core::f64::consts::TAU;

impl MotorAngle {
    /// Where the counting starts.
    pub const ZERO: Self = Self(0);

    /// From units of 2^-32 turn.
    #[must_use]
    pub const fn from_units(units: i64) -> Self {
        Self(units)
    }

    /// In units of 2^-32 turn.
    #[must_use]
    pub const fn units(self) -> i64 {
        self.0
    }

    /// From an angle in radians; `None` when it is not finite or beyond 2^31 turns.
    #[must_use]
    pub fn from_rad<T: Countable>(angle_rad: T) -> Option<Self> {
        (angle_rad * T::constant(UNITS_PER_RAD)).to_i64().map(Self)
    }

    /// In radians, rounded to `T`: for display and for small angles.
    #[must_use]
    pub fn rad<T: Countable>(self) -> T {
        to_real::<T>(self.0) * T::constant(1.0 / UNITS_PER_RAD)
    }

    /// This angle less `other`; exact; `None` beyond 2^31 turns.
    #[must_use]
    pub const fn checked_sub(self, other: Self) -> Option<Self> {
        match self.0.checked_sub(other.0) {
            Some(units) => Some(Self(units)),
            None => None,
        }
    }

    /// The sum; `None` beyond 2^31 turns.
    #[must_use]
    pub const fn checked_add(self, other: Self) -> Option<Self> {
        match self.0.checked_add(other.0) {
            Some(units) => Some(Self(units)),
            None => None,
        }
    }

    /// From a count of which there are `per_turn` in a turn.
    #[must_use]
    pub fn from_counts(counts: i32, per_turn: NonZeroU32) -> Self {
        Self((i64::from(counts) << 32) / i64::from(per_turn.get()))
    }

    /// The nearest whole count, of which there are `per_turn` in a turn: steps of a stepper, or
    /// lines of an encoder. `None` when it, or the one below, is no `i32`; never wraps.
    #[must_use]
    pub fn counts(self, per_turn: NonZeroU32) -> Option<i32> {
        let half = 1 << 31;
        let fine = self.fine_counts(per_turn)?.checked_add(half)?;
        i32::try_from(fine >> 32).ok()
    }

    /// Counts in units of 2^-32 count, rounded down; `None` when the whole count is no `i32`.
    pub(super) fn fine_counts(self, per_turn: NonZeroU32) -> Option<i64> {
        // Whole turns and fraction by themselves: neither product can overflow 64 bits.
        let turns = self.0 >> 32;
        let fraction = u64::from(low_word(self.0)) * u64::from(per_turn.get());
        let whole = turns * i64::from(per_turn.get()) + i64::from(high_word(fraction));
        i32::try_from(whole).ok()?;
        Some((whole << 32) | i64::from(low_word(fraction.cast_signed())))
    }
}

/// The nearest `T`.
pub(super) fn to_real<T: Countable>(value: i64) -> T {
    T::from_i64(value).unwrap_or_else(T::zero) // floats take every i64
}

#[allow(clippy::cast_possible_truncation)] // that is what it is for
pub(super) const fn low_word(value: i64) -> u32 {
    value.cast_unsigned() as u32
}

const fn high_word(value: u64) -> u32 {
    low_word((value >> 32).cast_signed())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn counts_beyond_their_range_are_refused() {
        let per_turn = NonZeroU32::new(16384).unwrap();
        let last = MotorAngle::from_counts(i32::MAX, per_turn);
        assert_eq!(last.counts(per_turn), Some(i32::MAX));
        let one = MotorAngle::from_counts(1, per_turn);
        assert_eq!(last.checked_add(one).unwrap().counts(per_turn), None);
        let first = MotorAngle::from_counts(i32::MIN, per_turn);
        assert_eq!(first.counts(per_turn), Some(i32::MIN));
        assert_eq!(first.checked_sub(one).unwrap().counts(per_turn), None);
        assert_eq!(MotorAngle::from_units(i64::MAX).counts(NonZeroU32::MAX), None);
        assert_eq!(MotorAngle::from_units(i64::MAX).checked_add(one), None);
        assert_eq!(MotorAngle::from_rad(f32::NAN), None);
        assert_eq!(MotorAngle::from_rad(1e12_f64), None);
    }

    proptest! {
        #[test]
        fn counts_come_back(counts: i32, per_turn in 1_u32..=1 << 30) {
            let per_turn = NonZeroU32::new(per_turn).unwrap();
            prop_assert_eq!(MotorAngle::from_counts(counts, per_turn).counts(per_turn), Some(counts));
        }

        #[test]
        fn counts_agree_with_wide_integers(
            units in prop_oneof![any::<i64>(), -1_i64 << 50..1 << 50],
            per_turn in prop_oneof![1_u32.., 1_u32..1 << 14],
        ) {
            let product = i128::from(units) * i128::from(per_turn);
            // Neither the count nor the one below may be out of range.
            let below = i32::try_from(product >> 32).ok();
            let nearest = below.and(i32::try_from((product + (1 << 31)) >> 32).ok());
            let found = MotorAngle::from_units(units).counts(NonZeroU32::new(per_turn).unwrap());
            prop_assert_eq!(found, nearest);
        }
    }
}
