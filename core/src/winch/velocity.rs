//! Speed output for an amplifier with a PWM input and a direction input.

use embedded_hal::digital::{Error as _, OutputPin};
use embedded_hal::pwm::{Error as _, SetDutyCycle};

use super::angle::{Countable, MotorAngle};
use super::drive::{Drive, DriveFault};

/// How speeds become duty cycles, and how a target is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocitySettings<T> {
    /// Motor speed at the highest duty, rad/s.
    pub full_scale_rad_s: T,
    /// Slower than this is standstill, with duty 0, rad/s.
    pub dead_band_rad_s: T,
    /// Duty, from 0 to 1, at which the motor just stands; the speed rises linearly from there.
    pub lowest_duty: T,
    /// Duty, from 0 to 1, at full scale.
    pub highest_duty: T,
    /// Speed for each radian behind the target, 1/s. A quarter of 1 / (period of a tick + lag of
    /// the amplifier) is about critically damped; more overshoots.
    pub gain_per_s: T,
}

/// [`VelocitySettings`] that contradict themselves: a number is negative or not finite, the full
/// scale not above the dead band, or the duties not in their order between 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InvalidSettings;

impl core::fmt::Display for InvalidSettings {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the settings of the velocity drive contradict each other")
    }
}

impl core::error::Error for InvalidSettings {}

/// What the outputs show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shown {
    /// Duty 0, so that the direction may change.
    Standstill,
    /// Some duty, or nobody knows.
    Motion,
}

/// Drives a motor by its speed: PWM for how fast, a pin for which way (high: forwards).
///
/// The direction only changes while the duty is 0: a reversal spends one tick at standstill, which
/// leaves the PWM a period to get there.
#[derive(Debug)]
pub struct VelocityDrive<T, P, D> {
    pwm: P,
    direction: D,
    settings: VelocitySettings<T>,
    shown: Shown,
    /// As last written to the pin; `None` when nobody knows.
    is_forward: Option<bool>,
}

impl<T: Countable, P: SetDutyCycle, D: OutputPin> VelocityDrive<T, P, D> {
    /// Takes the outputs and leaves them as they are: call [`Drive::stop`] first.
    ///
    /// # Errors
    /// [`InvalidSettings`].
    pub fn new(
        pwm: P,
        direction: D,
        settings: VelocitySettings<T>,
    ) -> Result<Self, InvalidSettings> {
        let VelocitySettings {
            full_scale_rad_s,
            dead_band_rad_s,
            lowest_duty,
            highest_duty,
            gain_per_s,
        } = settings;
        let is_valid = dead_band_rad_s >= T::zero()
            && full_scale_rad_s > dead_band_rad_s
            && full_scale_rad_s.is_finite()
            && lowest_duty >= T::zero()
            && highest_duty > lowest_duty
            && highest_duty <= T::one()
            && gain_per_s >= T::zero()
            && gain_per_s.is_finite();
        if !is_valid {
            return Err(InvalidSettings);
        }
        Ok(Self { pwm, direction, settings, shown: Shown::Motion, is_forward: None })
    }

    /// Turns at `speed_rad_s`, or stands for one call when that is the other way.
    ///
    /// # Errors
    /// [`DriveFault::OverSpeed`] beyond full scale, with nothing written; [`DriveFault::OutOfRange`]
    /// for NaN; or an output could not be written.
    pub fn set_speed(&mut self, speed_rad_s: T) -> Result<(), DriveFault<T>> {
        let settings = &self.settings;
        let magnitude = speed_rad_s.abs();
        if magnitude > settings.full_scale_rad_s {
            return Err(DriveFault::OverSpeed {
                speed_rad_s,
                limit_rad_s: settings.full_scale_rad_s,
            });
        }
        let share = magnitude / settings.full_scale_rad_s;
        let duty = settings.lowest_duty + (settings.highest_duty - settings.lowest_duty) * share;
        let most = T::from_u16(self.pwm.max_duty_cycle()).unwrap_or_else(T::zero);
        let duty = (duty * most + T::constant(0.5)).to_u16().ok_or(DriveFault::OutOfRange)?;
        if magnitude < settings.dead_band_rad_s || magnitude == T::zero() {
            return self.stand();
        }
        let is_forward = speed_rad_s > T::zero();
        if self.is_forward != Some(is_forward) {
            if self.shown != Shown::Standstill {
                return self.stand();
            }
            self.is_forward = None;
            let written = self.direction.set_state(is_forward.into());
            written.map_err(|e| DriveFault::Pin(e.kind()))?;
            self.is_forward = Some(is_forward);
        }
        self.shown = Shown::Motion;
        self.pwm.set_duty_cycle(duty).map_err(|e| DriveFault::Pwm(e.kind()))
    }

    fn stand(&mut self) -> Result<(), DriveFault<T>> {
        self.shown = Shown::Motion; // unless it can be written
        self.pwm.set_duty_cycle(0).map_err(|e| DriveFault::Pwm(e.kind()))?;
        self.shown = Shown::Standstill;
        Ok(())
    }
}

impl<T: Countable, P: SetDutyCycle, D: OutputPin> Drive<T> for VelocityDrive<T, P, D> {
    /// Turns at `speed_rad_s + gain (angle - measured)`, cut to full scale. Only a `speed_rad_s`
    /// that is by itself beyond full scale is an over-speed.
    fn command(
        &mut self,
        angle: MotorAngle,
        speed_rad_s: T,
        measured: MotorAngle,
    ) -> Result<(), DriveFault<T>> {
        let full_scale = self.settings.full_scale_rad_s;
        if speed_rad_s.abs() > full_scale {
            return self.set_speed(speed_rad_s); // says so
        }
        let behind_rad = angle.checked_sub(measured).ok_or(DriveFault::OutOfRange)?.rad::<T>();
        let wanted = speed_rad_s + self.settings.gain_per_s * behind_rad;
        if !wanted.is_finite() {
            return Err(DriveFault::OutOfRange);
        }
        self.set_speed(wanted.min(full_scale).max(-full_scale))
    }

    fn stop(&mut self) -> Result<(), DriveFault<T>> {
        self.stand()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use embedded_hal_mock::eh1::MockError;
    use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as Set};
    use embedded_hal_mock::eh1::pwm::{Mock as Pwm, Transaction as Duty};
    use std::io;

    const SETTINGS: VelocitySettings<f32> = VelocitySettings {
        full_scale_rad_s: 100.0,
        dead_band_rad_s: 1.0,
        lowest_duty: 0.1,
        highest_duty: 0.9,
        gain_per_s: 20.0,
    };

    const MOST: u16 = 1000;

    fn read_and(duty: u16) -> [Duty; 2] {
        [Duty::max_duty_cycle(MOST), Duty::set_duty_cycle(duty)]
    }

    fn drive(pwm: &Pwm, direction: &Pin) -> VelocityDrive<f32, Pwm, Pin> {
        VelocityDrive::new(pwm.clone(), direction.clone(), SETTINGS).unwrap()
    }

    #[test]
    fn speed_becomes_duty() {
        let mut pwm = Pwm::new(
            &[
                &[Duty::set_duty_cycle(0)][..],
                &read_and(500), // 0.1 + 0.8 / 2
                &read_and(900),
                &read_and(0), // dead band
                &read_and(0), // standstill
                &read_and(500),
            ]
            .concat(),
        );
        let mut direction = Pin::new(&[Set::set(State::High)]);
        let mut drive = drive(&pwm, &direction);
        drive.stop().unwrap();
        for speed in [50.0, 100.0, 0.99, 0.0, 50.0] {
            drive.set_speed(speed).unwrap();
        }
        pwm.done();
        direction.done();
    }

    #[test]
    fn direction_changes_at_standstill_only() {
        let mut pwm = Pwm::new(
            &[
                &read_and(0)[..], // nobody knows what it showed before
                &read_and(500),
                &read_and(0), // reversal: first a tick of standstill
                &read_and(180),
            ]
            .concat(),
        );
        let mut direction = Pin::new(&[Set::set(State::High), Set::set(State::Low)]);
        let mut drive = drive(&pwm, &direction);
        for speed in [50.0, 50.0, -10.0, -10.0] {
            drive.set_speed(speed).unwrap();
        }
        pwm.done();
        direction.done();
    }

    #[test]
    fn over_speed_and_nonsense_write_nothing() {
        let mut pwm = Pwm::new(&[Duty::max_duty_cycle(MOST)]); // NaN gets that far
        let mut direction = Pin::new(&[]);
        let mut drive = drive(&pwm, &direction);
        let zero = MotorAngle::ZERO;
        let fault = DriveFault::OverSpeed { speed_rad_s: -100.1, limit_rad_s: 100.0 };
        assert_eq!(drive.set_speed(-100.1), Err(fault));
        assert_eq!(drive.command(zero, -100.1, zero), Err(fault));
        assert_eq!(drive.set_speed(f32::NAN), Err(DriveFault::OutOfRange));
        assert_eq!(drive.command(zero, f32::NAN, zero), Err(DriveFault::OutOfRange));
        let far = MotorAngle::from_units(i64::MIN);
        let forward = MotorAngle::from_units(1);
        assert_eq!(drive.command(forward, 0.0, far), Err(DriveFault::OutOfRange));
        pwm.done();
        direction.done();
    }

    #[test]
    fn following_adds_the_correction_and_is_cut_to_full_scale() {
        let mut pwm = Pwm::new(
            &[
                &[Duty::set_duty_cycle(0)][..],
                &read_and(420), // 30 + 20 * 0.5 = 40 of 100
                &read_and(900), // 30 + 20 * 50
            ]
            .concat(),
        );
        let mut direction = Pin::new(&[Set::set(State::High)]);
        let mut drive = drive(&pwm, &direction);
        drive.stop().unwrap();
        let rad = |x: f32| MotorAngle::from_rad(x).unwrap();
        drive.command(rad(7.5), 30.0, rad(7.0)).unwrap();
        drive.command(rad(7.0 + 50.0), 30.0, rad(7.0)).unwrap();
        pwm.done();
        direction.done();
    }

    #[test]
    fn an_output_that_fails_is_told_and_not_trusted() {
        let failure = MockError::Io(io::ErrorKind::NotConnected);
        let mut pwm = Pwm::new(
            &[
                &[Duty::set_duty_cycle(0).with_error(failure.clone())][..],
                &read_and(0), // the first zero did not arrive: again before the direction
                &[Duty::max_duty_cycle(MOST)],
                &read_and(500),
            ]
            .concat(),
        );
        let mut direction =
            Pin::new(&[Set::set(State::High).with_error(failure), Set::set(State::High)]);
        let mut drive = drive(&pwm, &direction);
        assert!(matches!(drive.stop(), Err(DriveFault::Pwm(_))));
        drive.set_speed(50.0).unwrap();
        assert!(matches!(drive.set_speed(50.0), Err(DriveFault::Pin(_))));
        drive.set_speed(50.0).unwrap();
        pwm.done();
        direction.done();
    }

    #[test]
    fn after_a_failure_nothing_is_taken_for_written() {
        let failure = MockError::Io(io::ErrorKind::NotConnected);
        let mut pwm = Pwm::new(
            &[
                &[Duty::set_duty_cycle(0)][..],
                &read_and(500),
                &[Duty::set_duty_cycle(0)],
                &[Duty::max_duty_cycle(MOST)], // the direction fails
                &read_and(500),                // the old direction is written again before
                &[Duty::set_duty_cycle(0)],
                &[Duty::set_duty_cycle(0).with_error(failure.clone())],
                &read_and(0), // standstill is written again before the direction changes
                &read_and(500),
            ]
            .concat(),
        );
        let mut direction = Pin::new(&[
            Set::set(State::High),
            Set::set(State::Low).with_error(failure),
            Set::set(State::High),
            Set::set(State::Low),
        ]);
        let mut drive = drive(&pwm, &direction);
        drive.stop().unwrap();
        drive.set_speed(50.0).unwrap();
        drive.stop().unwrap();
        assert!(drive.set_speed(-50.0).is_err());
        drive.set_speed(50.0).unwrap();
        drive.stop().unwrap();
        assert!(drive.stop().is_err());
        drive.set_speed(-50.0).unwrap();
        drive.set_speed(-50.0).unwrap();
        pwm.done();
        direction.done();
    }

    #[test]
    fn settings_that_contradict_themselves_are_refused() {
        let refused = |settings| {
            let (mut pwm, mut direction) = (Pwm::new(&[]), Pin::new(&[]));
            let drive = VelocityDrive::new(pwm.clone(), direction.clone(), settings);
            pwm.done();
            direction.done();
            drive.is_err()
        };
        assert!(!refused(SETTINGS));
        assert!(refused(VelocitySettings { full_scale_rad_s: 1.0, ..SETTINGS }));
        assert!(refused(VelocitySettings { full_scale_rad_s: f32::INFINITY, ..SETTINGS }));
        assert!(refused(VelocitySettings { dead_band_rad_s: -1.0, ..SETTINGS }));
        assert!(refused(VelocitySettings { lowest_duty: 0.9, ..SETTINGS }));
        assert!(refused(VelocitySettings { highest_duty: 1.1, ..SETTINGS }));
        assert!(refused(VelocitySettings { gain_per_s: f32::NAN, ..SETTINGS }));
    }
}
