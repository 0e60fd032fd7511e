//! From rest length to motor angle and back: a cable wound on a grooved drum behind a gear.

use num_traits::ToPrimitive;

use super::angle::{Countable, MotorAngle, Sense, UNITS_PER_RAD, UNITS_PER_TURN, to_real};
use crate::Scalar;

/// What a drum is made of. In `f64` for every [`Drum`]: it is worked out once.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DrumDesign {
    /// Radius to the centre line of the cable, m.
    pub radius_m: f64,
    /// Pitch of the groove, m for each turn of the drum.
    pub pitch_m: f64,
    /// Turns of the motor for one of the drum.
    pub gear: f64,
    /// Forward: a growing motor angle pays cable out.
    pub sense: Sense,
    /// Tension at which the cable was wound, N.
    pub winding_tension_n: f64,
    /// Reciprocal axial stiffness of the cable, `1/EA`, 1/N.
    pub compliance_per_n: f64,
}

/// Why a drum is refused, or has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum DrumFault {
    /// The radius is not positive and finite.
    Radius,
    /// The pitch is negative or not finite.
    Pitch,
    /// The gear is not positive and finite.
    Gear,
    /// Winding tension or compliance is negative or not finite.
    Winding,
    /// A length, rate or angle is not finite, or further than can be counted.
    OutOfRange,
}

impl core::fmt::Display for DrumFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Radius => "the radius of the drum is not positive",
            Self::Pitch => "the pitch of the groove is negative",
            Self::Gear => "the gear is not positive",
            Self::Winding => "winding tension or compliance is negative",
            Self::OutOfRange => "a length or angle is further than can be counted",
        })
    }
}

impl core::error::Error for DrumFault {}

/// A drum whose motor angle at one rest length is known: motor angle against rest length.
///
/// One turn of the drum takes up the arc `c = sqrt((2 pi r)^2 + pitch^2)`, in which lies the rest
/// length `c / (1 + T_w/EA)` because the cable was wound under the tension `T_w`. So the motor angle
/// is linear in the rest length. It is worked out as two multiply-adds, one for the whole cells of
/// 1/16 m in integers, one for what is left over in `T`:
///
/// ```text
/// L = cells/16 + rest        angle = angle at L = 0 + cells * (angle of a cell) + rest * slope
/// ```
///
/// # Rounding
///
/// 60 m of cable on a drum of 5 cm behind a gear of 20 are 24000 rad. In `f32` that number alone
/// would be uncertain by 0.001 rad, 2.4 um of cable, as much again as the 1.9 um by which 60 m are
/// rounded, and the rounded slope and the rounded product would each add their own. Here the split
/// of `L` is exact, the sum of cells is exact, and `rest * slope`, two roundings of 2^-24 on less
/// than 1/16 m, is wrong by at most 2^-27 m = 7.5 nm at any length. The same holds on the way back,
/// up to the last rounding of the length itself: every `f32` length above 0.5 m comes back bit for
/// bit. The angle of a cell is rounded to 2^-32 turn, the same way for all lengths and both ways: as
/// if the radius were wrong by a relative 6e-9 for a drum of 0.5 m without a gear, and by less for
/// others.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Drum<T> {
    /// Angle at zero rest length, units of 2^-32 turn like all angles here.
    zero_units: i64,
    units_per_cell: i64,
    units_per_m: T,
    m_per_unit: T,
    cells_per_unit: T,
    rad_per_m: T,
    m_per_rad: T,
}

/// Cells in a metre: see [`Drum`]. A power of two, so that the split is exact.
const CELLS_PER_M: f64 = 16.0;

impl<T: Countable> Drum<T> {
    /// The drum whose motor stands at `home` when the rest length `rest_length_m` is paid out.
    ///
    /// # Errors
    /// [`DrumFault`].
    pub fn new(design: &DrumDesign, rest_length_m: T, home: MotorAngle) -> Result<Self, DrumFault> {
        let DrumDesign { radius_m, pitch_m, gear, sense, winding_tension_n, compliance_per_n } =
            *design;
        let is_positive = |x: f64| x > 0.0 && x.is_finite();
        let is_not_negative = |x: f64| x >= 0.0 && x.is_finite();
        if !is_positive(radius_m) {
            return Err(DrumFault::Radius);
        }
        if !is_not_negative(pitch_m) {
            return Err(DrumFault::Pitch);
        }
        if !is_positive(gear) {
            return Err(DrumFault::Gear);
        }
        if !(is_not_negative(winding_tension_n) && is_not_negative(compliance_per_n)) {
            return Err(DrumFault::Winding);
        }
        let (arc_m, _) = f64::hypot_with_excess(core::f64::consts::TAU * radius_m, pitch_m);
        let rest_length_per_turn_m = arc_m / (1.0 + winding_tension_n * compliance_per_n);
        let turns_per_m = match sense {
            Sense::Forward => gear / rest_length_per_turn_m,
            Sense::Reverse => -gear / rest_length_per_turn_m,
        };
        let units_per_m = turns_per_m * UNITS_PER_TURN;
        let rounding = if units_per_m > 0.0 { 0.5 } else { -0.5 };
        let units_per_cell =
            (units_per_m / CELLS_PER_M + rounding).to_i64().ok_or(DrumFault::OutOfRange)?;
        // Fewer units are not worth counting, and zero cannot be turned around.
        if units_per_cell.unsigned_abs() < (1_u64 << 16) {
            return Err(DrumFault::OutOfRange);
        }
        let rad_per_m = units_per_m / UNITS_PER_RAD;
        let mut drum = Self {
            zero_units: 0,
            units_per_cell,
            units_per_m: T::constant(units_per_m),
            m_per_unit: T::constant(1.0 / units_per_m),
            cells_per_unit: T::constant(CELLS_PER_M / units_per_m),
            rad_per_m: T::constant(rad_per_m),
            m_per_rad: T::constant(1.0 / rad_per_m),
        };
        drum.set_home(rest_length_m, home)?;
        Ok(drum)
    }

    /// From now on the motor stands at `home` when `rest_length_m` is paid out.
    ///
    /// # Errors
    /// [`DrumFault::OutOfRange`]; the drum is then as before.
    pub fn set_home(&mut self, rest_length_m: T, home: MotorAngle) -> Result<(), DrumFault> {
        let paid_out = self.units(rest_length_m).ok_or(DrumFault::OutOfRange)?;
        self.zero_units = home.units().checked_sub(paid_out).ok_or(DrumFault::OutOfRange)?;
        Ok(())
    }

    /// Motor angle at which `rest_length_m` is paid out.
    ///
    /// # Errors
    /// [`DrumFault::OutOfRange`].
    #[inline]
    pub fn motor_angle(&self, rest_length_m: T) -> Result<MotorAngle, DrumFault> {
        self.units(rest_length_m)
            .and_then(|units| self.zero_units.checked_add(units))
            .map(MotorAngle::from_units)
            .ok_or(DrumFault::OutOfRange)
    }

    /// Rest length that is paid out when the motor stands at `angle`, m.
    ///
    /// # Errors
    /// [`DrumFault::OutOfRange`].
    #[inline]
    pub fn rest_length_m(&self, angle: MotorAngle) -> Result<T, DrumFault> {
        let units = angle.units().checked_sub(self.zero_units).ok_or(DrumFault::OutOfRange)?;
        // A rounded number of cells may be one off the whole one: then the rest is a little longer.
        let cells =
            (to_real::<T>(units) * self.cells_per_unit).to_i32().ok_or(DrumFault::OutOfRange)?;
        let rest = i64::from(cells)
            .checked_mul(self.units_per_cell)
            .and_then(|whole| units.checked_sub(whole))
            .ok_or(DrumFault::OutOfRange)?;
        Ok(cells_to_m::<T>(cells) + to_real::<T>(rest) * self.m_per_unit)
    }

    /// Motor speed for a rate of the rest length, rad/s.
    #[inline]
    pub fn motor_speed_rad_s(&self, rest_length_rate_m_s: T) -> T {
        rest_length_rate_m_s * self.rad_per_m
    }

    /// Rate of the rest length at a motor speed, m/s.
    #[inline]
    pub fn rest_length_rate_m_s(&self, motor_speed_rad_s: T) -> T {
        motor_speed_rad_s * self.m_per_rad
    }

    /// Angle by which the motor turns for a rest length.
    #[inline]
    fn units(&self, rest_length_m: T) -> Option<i64> {
        let cells = (rest_length_m * T::constant(CELLS_PER_M)).to_i32()?; // towards zero; no NaN
        let rest_m = rest_length_m - cells_to_m(cells);
        let rest = (rest_m * self.units_per_m).to_i64()?;
        i64::from(cells).checked_mul(self.units_per_cell)?.checked_add(rest)
    }
}

/// Exact: as many cells as fit into a number of type `T` came out of one.
#[inline]
fn cells_to_m<T: Countable>(cells: i32) -> T {
    to_real::<T>(i64::from(cells)) * T::constant(1.0 / CELLS_PER_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DESIGN: DrumDesign = DrumDesign {
        radius_m: 0.05,
        pitch_m: 0.006,
        gear: 20.0,
        sense: Sense::Forward,
        winding_tension_n: 200.0,
        compliance_per_n: 8e-7,
    };

    /// Turns of the motor for a metre of rest length, by the formula.
    fn turns_per_m(design: &DrumDesign) -> f64 {
        let around = core::f64::consts::TAU * design.radius_m;
        let arc = libm::hypot(around, design.pitch_m);
        design.gear / (arc / (1.0 + design.winding_tension_n * design.compliance_per_n))
    }

    #[test]
    fn wound_turns_by_hand() {
        // r = 5 cm, pitch 0, gear 1, no stretch: 2 pi 0.05 m is one turn.
        let design = DrumDesign { gear: 1.0, pitch_m: 0.0, winding_tension_n: 0.0, ..DESIGN };
        let drum = Drum::new(&design, 3.0_f64, MotorAngle::from_units(7)).unwrap();
        let turn_m = 0.314_159_265_358_979;
        let angle = drum.motor_angle(3.0 + turn_m).unwrap();
        assert!((angle.units() - 7 - (1 << 32)).abs() <= 6, "{angle:?}"); // 3 m: 48 + 53 half units
        assert!((drum.motor_speed_rad_s(0.05) - 1.0).abs() < 1e-15);
        assert!((drum.rest_length_rate_m_s(1.0) - 0.05).abs() < 1e-17);
        // Wound at 1 % stretch, a turn holds 1/1.01 of it, and the motor turns as much more.
        let stretched = DrumDesign { winding_tension_n: 1e4, compliance_per_n: 1e-6, ..design };
        let drum = Drum::new(&stretched, 0.0_f64, MotorAngle::ZERO).unwrap();
        assert!((drum.motor_speed_rad_s(0.05) - 1.01).abs() < 1e-15);
    }

    #[test]
    fn reverse_turns_the_other_way() {
        let forward = Drum::new(&DESIGN, 1.0_f32, MotorAngle::ZERO).unwrap();
        let design = DrumDesign { sense: Sense::Reverse, ..DESIGN };
        let reverse = Drum::new(&design, 1.0_f32, MotorAngle::ZERO).unwrap();
        let angle = forward.motor_angle(2.3).unwrap();
        assert!(angle > MotorAngle::ZERO);
        assert_eq!(reverse.motor_angle(2.3).unwrap().units(), -angle.units());
        let both = forward.motor_speed_rad_s(0.5) + reverse.motor_speed_rad_s(0.5);
        assert!(both.abs() < f32::MIN_POSITIVE);
    }

    #[test]
    fn bad_drums_and_lengths_are_refused() {
        let fault = |design| Drum::new(&design, 1.0_f32, MotorAngle::ZERO).err();
        assert_eq!(fault(DrumDesign { radius_m: 0.0, ..DESIGN }), Some(DrumFault::Radius));
        assert_eq!(fault(DrumDesign { radius_m: f64::NAN, ..DESIGN }), Some(DrumFault::Radius));
        assert_eq!(fault(DrumDesign { pitch_m: -1e-3, ..DESIGN }), Some(DrumFault::Pitch));
        assert_eq!(fault(DrumDesign { gear: f64::INFINITY, ..DESIGN }), Some(DrumFault::Gear));
        assert_eq!(
            fault(DrumDesign { winding_tension_n: -1.0, ..DESIGN }),
            Some(DrumFault::Winding)
        );
        assert_eq!(fault(DrumDesign { gear: 1e-30, ..DESIGN }), Some(DrumFault::OutOfRange));
        assert_eq!(fault(DrumDesign { gear: 1e30, ..DESIGN }), Some(DrumFault::OutOfRange));
        let drum = Drum::new(&DESIGN, 1.0_f32, MotorAngle::ZERO).unwrap();
        for length in [f32::NAN, f32::INFINITY, -f32::MAX, 1e9] {
            assert_eq!(drum.motor_angle(length), Err(DrumFault::OutOfRange), "{length}");
        }
        // Half of what can be counted is a length; from one end to the other is none.
        assert!(drum.rest_length_m(MotorAngle::from_units(i64::MAX / 2)).is_ok());
        let far = Drum::new(&DESIGN, 1.0_f32, MotorAngle::from_units(i64::MAX)).unwrap();
        assert_eq!(far.motor_angle(100.0), Err(DrumFault::OutOfRange));
        let low = MotorAngle::from_units(i64::MIN);
        assert_eq!(far.rest_length_m(low), Err(DrumFault::OutOfRange));
    }

    /// Half a unit in each cell (see [`Drum`]), as a fraction of the length.
    fn slope_error(design: &DrumDesign) -> f64 {
        0.5 / (turns_per_m(design) * UNITS_PER_TURN / CELLS_PER_M)
    }

    /// 2^-27 m of the product, and one unit by which it is cut off.
    fn rest_error_m(design: &DrumDesign) -> f64 {
        libm::ldexp(1.0, -27) + 1.0 / (turns_per_m(design) * UNITS_PER_TURN)
    }

    fn design() -> impl Strategy<Value = DrumDesign> {
        (0.01..0.5, 0.0..0.02, 1.0..200.0, 0.0..1e4, 0.0..1e-5, any::<bool>()).prop_map(
            |(radius_m, pitch_m, gear, winding_tension_n, compliance_per_n, forward)| DrumDesign {
                radius_m,
                pitch_m,
                gear,
                sense: if forward { Sense::Forward } else { Sense::Reverse },
                winding_tension_n,
                compliance_per_n,
            },
        )
    }

    proptest! {
        #[test]
        fn single_precision_loses_nothing(design in design(), home in 0.5_f32..60.0, length in 0.5_f32..128.0) {
            let drum = Drum::new(&design, home, MotorAngle::from_units(1 << 40)).unwrap();
            let angle = drum.motor_angle(length).unwrap();
            // Against the formula in f64, in metres of cable.
            let turns = (angle.units() - (1 << 40)) as f64 / UNITS_PER_TURN;
            let sign = if design.sense == Sense::Forward { 1.0 } else { -1.0 };
            let paid_out = f64::from(length) - f64::from(home);
            let error = sign * turns / turns_per_m(&design) - paid_out;
            let bound = 2.0 * rest_error_m(&design) + slope_error(&design) * paid_out.abs();
            prop_assert!(error.abs() <= bound, "{error:e} > {bound:e}");
            prop_assert!(slope_error(&design) < 1e-8);
            // And back, bit for bit: both errors together are below half the spacing of lengths.
            prop_assert_eq!(drum.rest_length_m(angle), Ok(length));
        }

        #[test]
        fn double_precision_is_turned_around(design in design(), home in 0.0..60.0, length in -10.0..200.0) {
            let drum = Drum::<f64>::new(&design, home, MotorAngle::ZERO).unwrap();
            let back = drum.rest_length_m(drum.motor_angle(length).unwrap()).unwrap();
            // A unit by which the angle is cut off, and the rounding of 200 m.
            let unit_m = 1.0 / (turns_per_m(&design) * UNITS_PER_TURN);
            prop_assert!((back - length).abs() <= unit_m + 1e-13);
            let speed = drum.motor_speed_rad_s(length);
            prop_assert!((drum.rest_length_rate_m_s(speed) - length).abs() <= 1e-13);
        }
    }
}
