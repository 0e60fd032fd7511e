//! A winch: from rest lengths to motors, on the traits of `embedded-hal` 1.0.
//!
//! ```text
//!              rest length, rate           angle, speed              edges, duty
//! controller ---------------------> Drum ---------------> Drive ------------------> motor
//!     ^                              |                                                |
//!     +------- rest length ----------+<------ angle ------ Encoder <------------------+
//! ```
//!
//! [`Drum`] is the kinematics; [`StepDrive`] and [`VelocityDrive`] are drives, [`MotorEncoder`]
//! (an AS5047P) and [`StepCounter`] encoders; [`Winch`] ties one of each to a [`Brake`]. The
//! [`EmergencyStop`] is one for all winches. Winches are counted from 0, and shown from 1.
//!
//! # Use
//!
//! All winches are measured before one is commanded, and a fault of one stops all:
//!
//! ```
//! use cdpr_core::CableCommand;
//! use cdpr_core::winch::{Countable, Drive, Encoder, Winch, WinchFault};
//! use embedded_hal::digital::OutputPin;
//!
//! fn tick<T: Countable, D: Drive<T>, E: Encoder, P: OutputPin>(
//!     winches: &mut [Winch<T, D, E, P>],
//!     commands: &[CableCommand<T>],
//! ) -> Result<(), WinchFault<T>> {
//!     for winch in winches.iter_mut() {
//!         let _rest_length_m = winch.measure()?;
//!     }
//!     for (winch, command) in winches.iter_mut().zip(commands) {
//!         winch.command(command.rest_length_m, command.rest_length_rate_m_s)?;
//!     }
//!     Ok(())
//! }
//!
//! fn stop<T: Countable, D: Drive<T>, E: Encoder, P: OutputPin>(
//!     winches: &mut [Winch<T, D, E, P>],
//! ) -> Result<(), WinchFault<T>> {
//!     // All of them, whatever one says; then what the first said.
//!     winches.iter_mut().map(Winch::stop).fold(Ok(()), |first, next| first.and(next))
//! }
//! ```

mod angle;
mod as5047p;
mod drive;
mod drum;
mod encoder;
mod safety;
mod step_dir;
mod velocity;

pub use angle::{Countable, MotorAngle, Sense};
pub use as5047p::{As5047p, MotorEncoder, Reading};
pub use drive::{Drive, DriveFault};
pub use drum::{Drum, DrumDesign, DrumFault};
pub use encoder::{CommandErrors, Encoder, EncoderFault, MultiTurn};
pub use safety::{Brake, EmergencyStop};
pub use step_dir::{StepCounter, StepDir, StepDrive, StepLink, StepTiming};
pub use velocity::{InvalidSettings, VelocityDrive, VelocitySettings};

use embedded_hal::digital::{ErrorKind, OutputPin};

/// Why a winch does not do what it should.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WinchFault<T> {
    /// The winch, counted from 0.
    pub winch: usize,
    /// What happened.
    pub cause: Cause<T>,
}

/// What happened to a winch.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Cause<T> {
    /// The encoder gives no angle.
    Encoder(EncoderFault),
    /// The drive does not take the command.
    Drive(DriveFault<T>),
    /// The drum has no such angle or length.
    Drum(DrumFault),
    /// The brake could not be written.
    Brake(ErrorKind),
    /// The winch was to move while its brake is not open.
    BrakeNotOpen,
    /// The winch was to move without having been measured in this tick.
    NotMeasured,
    /// The winch is too far from where it should be: it is blocked, slips, or is overloaded.
    Following {
        /// Rest length wanted less rest length measured, m.
        error_m: T,
        /// Largest difference allowed, m.
        limit_m: T,
    },
}

impl<T: core::fmt::Display> core::fmt::Display for WinchFault<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "winch {}: {}", self.winch.saturating_add(1), self.cause)
    }
}

impl<T: core::fmt::Display> core::fmt::Display for Cause<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Encoder(fault) => fault.fmt(f),
            Self::Drive(fault) => fault.fmt(f),
            Self::Drum(fault) => fault.fmt(f),
            Self::Brake(kind) => write!(f, "brake: {kind}"),
            Self::BrakeNotOpen => f.write_str("the brake is not open"),
            Self::NotMeasured => f.write_str("not measured in this tick"),
            Self::Following { error_m, limit_m } => {
                write!(f, "{error_m} m from where it should be; {limit_m} m are allowed")
            }
        }
    }
}

impl<T: core::fmt::Debug + core::fmt::Display> core::error::Error for WinchFault<T> {}

/// One winch: a drum, its drive, encoder and brake.
///
/// Each tick: [`Winch::measure`], then [`Winch::command`] or [`Winch::hold`]. After a fault the
/// last command may still be going on: call [`Winch::stop`]. If nobody does, the next measurement
/// stops it, as it does after any tick that neither moved nor held. A control loop that has stopped
/// altogether needs a watchdog, whose reset leaves the brake without power.
#[derive(Debug)]
pub struct Winch<T, D, E, P> {
    number: usize,
    drum: Drum<T>,
    drive: D,
    encoder: E,
    brake: Brake<P>,
    largest_error_m: T,
    /// What was measured in this tick.
    measured: Option<Measured<T>>,
    /// Where it is held, m.
    held_m: Option<T>,
}

#[derive(Clone, Copy, Debug)]
struct Measured<T> {
    angle: MotorAngle,
    rest_length_m: T,
}

impl<T: Countable, D: Drive<T>, E: Encoder, P: OutputPin> Winch<T, D, E, P> {
    /// Winch `number`, from 0, stopped. A winch further than `largest_error_m` from its commanded
    /// rest length is at fault.
    ///
    /// # Errors
    /// [`WinchFault`]: it could not be stopped.
    pub fn new(
        number: usize,
        drum: Drum<T>,
        drive: D,
        encoder: E,
        brake: Brake<P>,
        largest_error_m: T,
    ) -> Result<Self, WinchFault<T>> {
        let mut winch = Self {
            number,
            drum,
            drive,
            encoder,
            brake,
            largest_error_m,
            measured: None,
            held_m: None,
        };
        winch.stop()?;
        Ok(winch)
    }

    /// Begins a tick: the rest length that is paid out, m. Stops when the last tick had neither
    /// command nor hold.
    ///
    /// # Errors
    /// [`WinchFault`].
    pub fn measure(&mut self) -> Result<T, WinchFault<T>> {
        let ready = if self.brake.is_held() {
            self.measured = None;
            self.brake.tick().map_err(Cause::Brake)
        } else {
            self.halt()
        };
        let measured = self.encoder.angle().map_err(Cause::Encoder).and_then(|angle| {
            let rest_length_m = self.drum.rest_length_m(angle).map_err(Cause::Drum)?;
            Ok(Measured { angle, rest_length_m })
        });
        let measured = ready.and(measured).map_err(|cause| self.fault(cause))?;
        self.measured = Some(measured);
        Ok(measured.rest_length_m)
    }

    /// Moves: the rest length should now be `rest_length_m`, and change by `rest_length_rate_m_s`
    /// until the next tick (positive: the cable is paid out).
    ///
    /// # Errors
    /// [`WinchFault`]; nothing new is then commanded.
    pub fn command(
        &mut self,
        rest_length_m: T,
        rest_length_rate_m_s: T,
    ) -> Result<(), WinchFault<T>> {
        let moved = if self.brake.is_open() {
            self.held_m = None;
            self.follow(rest_length_m, rest_length_rate_m_s)
        } else {
            Err(Cause::BrakeNotOpen)
        };
        moved.map_err(|cause| self.fault(cause))
    }

    /// Stands still where it was at the first of consecutive calls, and releases the brake; returns
    /// whether that is open. To be called each tick, before the first command and whenever there
    /// is none: the motor carries the load before the brake lets it go.
    ///
    /// # Errors
    /// [`WinchFault`].
    pub fn hold(&mut self) -> Result<bool, WinchFault<T>> {
        let held = self.measured.ok_or(Cause::NotMeasured).and_then(|measured| {
            let rest_length_m = *self.held_m.get_or_insert(measured.rest_length_m);
            self.follow(rest_length_m, T::zero())
        });
        held.map_err(|cause| self.fault(cause))?;
        Ok(self.brake.is_open())
    }

    /// No motion: stops the drive and engages the brake. May be called at any time.
    ///
    /// # Errors
    /// [`WinchFault`]: both were tried, and this is what failed first.
    pub fn stop(&mut self) -> Result<(), WinchFault<T>> {
        self.halt().map_err(|cause| self.fault(cause))
    }

    /// From now on what is paid out at the measured angle is `rest_length_m`. Only while stopped,
    /// or the winch will jump there.
    ///
    /// # Errors
    /// [`WinchFault`] when it was not measured in this tick, or the length is not one.
    pub fn home(&mut self, rest_length_m: T) -> Result<(), WinchFault<T>> {
        let homed = self.measured.take().ok_or(Cause::NotMeasured).and_then(|measured| {
            self.drum.set_home(rest_length_m, measured.angle).map_err(Cause::Drum)
        });
        homed.map_err(|cause| self.fault(cause))
    }

    /// The encoder: to count its turns anew after a jump. Only while stopped, and home the winch
    /// before it moves again.
    pub fn encoder_mut(&mut self) -> &mut E {
        &mut self.encoder
    }

    fn halt(&mut self) -> Result<(), Cause<T>> {
        self.measured = None;
        self.held_m = None;
        let stopped = self.drive.stop().map_err(Cause::Drive);
        let braked = self.brake.engage().map_err(Cause::Brake);
        stopped.and(braked)
    }

    fn follow(&mut self, rest_length_m: T, rest_length_rate_m_s: T) -> Result<(), Cause<T>> {
        // Taken: the next command needs a measurement of its own.
        let measured = self.measured.take().ok_or(Cause::NotMeasured)?;
        let angle = self.drum.motor_angle(rest_length_m).map_err(Cause::Drum)?;
        let error_m = rest_length_m - measured.rest_length_m;
        if error_m.abs() > self.largest_error_m {
            return Err(Cause::Following { error_m, limit_m: self.largest_error_m });
        }
        let speed_rad_s = self.drum.motor_speed_rad_s(rest_length_rate_m_s);
        self.drive.command(angle, speed_rad_s, measured.angle).map_err(Cause::Drive)?;
        self.brake.hold_released().map_err(Cause::Brake)
    }

    fn fault(&self, cause: Cause<T>) -> WinchFault<T> {
        WinchFault { winch: self.number, cause }
    }
}

#[cfg(test)]
mod tests {
    extern crate alloc;
    use super::*;
    use alloc::string::ToString;
    use core::cell::Cell;
    use core::convert::Infallible;
    use core::num::{NonZeroU8, NonZeroU32};
    use embedded_hal::digital::{ErrorType, PinState};
    use embedded_hal::pwm::{self, SetDutyCycle};

    const DESIGN: DrumDesign = DrumDesign {
        radius_m: 0.05,
        pitch_m: 0.006,
        gear: 20.0,
        sense: Sense::Reverse,
        winding_tension_n: 200.0,
        compliance_per_n: 8e-7,
    };

    /// What a bench shows, and what fails on it.
    #[derive(Default)]
    struct Bench {
        angle: Cell<MotorAngle>,
        commanded: Cell<Option<(MotorAngle, f64)>>,
        released: Cell<bool>,
        encoder_fault: Cell<Option<EncoderFault>>,
        drive_fault: Cell<Option<DriveFault<f64>>>,
        pin_fails: Cell<bool>,
    }

    struct Motor<'a>(&'a Bench);
    struct Sensor<'a>(&'a Bench);
    struct Coil<'a>(&'a Bench);

    impl Drive<f64> for Motor<'_> {
        fn command(
            &mut self,
            angle: MotorAngle,
            speed_rad_s: f64,
            measured: MotorAngle,
        ) -> Result<(), DriveFault<f64>> {
            assert_eq!(measured, self.0.angle.get());
            self.0.drive_fault.get().map_or(Ok(()), Err)?;
            self.0.commanded.set(Some((angle, speed_rad_s)));
            Ok(())
        }

        fn stop(&mut self) -> Result<(), DriveFault<f64>> {
            self.0.drive_fault.get().map_or(Ok(()), Err)?;
            self.0.commanded.set(None);
            Ok(())
        }
    }

    impl Encoder for Sensor<'_> {
        fn angle(&mut self) -> Result<MotorAngle, EncoderFault> {
            self.0.encoder_fault.get().map_or(Ok(self.0.angle.get()), Err)
        }
    }

    impl ErrorType for Coil<'_> {
        type Error = ErrorKind;
    }

    impl OutputPin for Coil<'_> {
        fn set_low(&mut self) -> Result<(), ErrorKind> {
            if self.0.pin_fails.get() {
                return Err(ErrorKind::Other);
            }
            self.0.released.set(false);
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), ErrorKind> {
            if self.0.pin_fails.get() {
                return Err(ErrorKind::Other);
            }
            self.0.released.set(true);
            Ok(())
        }
    }

    type BenchWinch<'a> = Winch<f64, Motor<'a>, Sensor<'a>, Coil<'a>>;

    /// At 5 m, limit 1 cm, brake open after two ticks.
    fn winch(bench: &Bench) -> BenchWinch<'_> {
        let drum = Drum::new(&DESIGN, 5.0, MotorAngle::ZERO).unwrap();
        let brake = Brake::new(Coil(bench), PinState::High, 2).unwrap();
        Winch::new(2, drum, Motor(bench), Sensor(bench), brake, 0.01).unwrap()
    }

    fn open(winch: &mut BenchWinch) {
        for tick in 0..3 {
            winch.measure().unwrap();
            assert_eq!(winch.hold(), Ok(tick == 2));
        }
    }

    fn cause<R: core::fmt::Debug>(outcome: Result<R, WinchFault<f64>>) -> Cause<f64> {
        let fault = outcome.unwrap_err();
        assert_eq!(fault.winch, 2);
        assert!(fault.to_string().starts_with("winch 3: "));
        fault.cause
    }

    #[test]
    fn a_tick_measures_and_moves() {
        let bench = Bench::default();
        let mut winch = winch(&bench);
        assert!((winch.measure().unwrap() - 5.0).abs() < 1e-9);
        assert_eq!(cause(winch.command(5.0, 0.0)), Cause::BrakeNotOpen);
        assert!(!bench.released.get());
        open(&mut winch);
        assert!(bench.released.get());
        winch.measure().unwrap();
        winch.command(5.001, 0.2).unwrap();
        let (angle, speed) = bench.commanded.get().unwrap();
        // 1 mm paid out, and 0.2 m/s, at a gear of 20 in reverse; the drum takes up 0.31 m a turn.
        let rad_per_m = 20.0 / 0.05 * 1.000_16;
        assert!((angle.rad::<f64>() + 0.001 * rad_per_m).abs() < 1e-4, "{angle:?}");
        assert!((speed + 0.2 * rad_per_m).abs() < 0.02, "{speed}");
        bench.angle.set(angle);
        assert!((winch.measure().unwrap() - 5.001).abs() < 1e-9);
        // Held after a move, it stays where that led.
        winch.hold().unwrap();
        assert!((bench.commanded.get().unwrap().0.rad::<f64>() - angle.rad::<f64>()).abs() < 1e-6);
        winch.measure().unwrap();
        // Each command needs its own measurement.
        winch.command(5.001, 0.0).unwrap();
        assert_eq!(cause(winch.command(5.001, 0.0)), Cause::NotMeasured);
        assert_eq!(cause(winch.hold()), Cause::NotMeasured);
        assert_eq!(cause(winch.home(1.0)), Cause::NotMeasured);
    }

    #[test]
    fn a_tick_without_command_stops() {
        let bench = Bench::default();
        let mut winch = winch(&bench);
        open(&mut winch);
        winch.measure().unwrap();
        assert!(bench.released.get());
        winch.measure().unwrap();
        assert!(!bench.released.get());
        assert!(bench.commanded.get().is_none());
        assert_eq!(cause(winch.command(5.0, 0.0)), Cause::BrakeNotOpen);
    }

    #[test]
    fn hold_stays_where_it_began() {
        let bench = Bench::default();
        let mut winch = winch(&bench);
        let per_mm = Drum::new(&DESIGN, 0.0, MotorAngle::ZERO).unwrap().motor_angle(1e-3).unwrap();
        let mut sagged = MotorAngle::ZERO;
        for _ in 0..10 {
            winch.measure().unwrap();
            winch.hold().unwrap();
            let (angle, speed) = bench.commanded.get().unwrap();
            assert!(angle.units().abs() < 10 && speed.abs() < f64::MIN_POSITIVE);
            sagged = sagged.checked_add(per_mm).unwrap();
            bench.angle.set(sagged);
        }
        // The load drags it down: at the limit that is a fault.
        bench.angle.set(sagged.checked_add(per_mm).unwrap());
        winch.measure().unwrap();
        assert!(matches!(cause(winch.hold()), Cause::Following { .. }));
        // Held anew after a stop, it is where it is.
        winch.stop().unwrap();
        winch.measure().unwrap();
        winch.hold().unwrap();
    }

    #[test]
    fn faults_are_told_with_their_winch() {
        let bench = Bench::default();
        let mut winch = winch(&bench);
        open(&mut winch);
        bench.encoder_fault.set(Some(EncoderFault::MagnetTooWeak));
        assert_eq!(cause(winch.measure()), Cause::Encoder(EncoderFault::MagnetTooWeak));
        assert_eq!(cause(winch.command(5.0, 0.0)), Cause::NotMeasured);
        bench.encoder_fault.set(None);
        open(&mut winch);
        winch.measure().unwrap();
        let Cause::Following { error_m, limit_m } = cause(winch.command(4.989, 0.0)) else {
            panic!("no following error");
        };
        assert!((error_m + 0.011).abs() < 1e-9 && (limit_m - 0.01).abs() < 1e-9);
        open(&mut winch);
        winch.measure().unwrap();
        assert_eq!(cause(winch.command(f64::NAN, 0.0)), Cause::Drum(DrumFault::OutOfRange));
        open(&mut winch);
        winch.measure().unwrap();
        let fault = DriveFault::OverSpeed { speed_rad_s: 2.0, limit_rad_s: 1.0 };
        bench.drive_fault.set(Some(fault));
        assert_eq!(cause(winch.command(5.0, 0.0)), Cause::Drive(fault));
        // And the brake takes over, although nobody stops.
        assert_eq!(cause(winch.measure()), Cause::Drive(fault));
        assert!(!bench.released.get());
    }

    #[test]
    fn stop_tries_everything_and_tells_the_first_failure() {
        let bench = Bench::default();
        let mut winch = winch(&bench);
        open(&mut winch);
        let fault = DriveFault::Pwm(pwm::ErrorKind::Other);
        bench.drive_fault.set(Some(fault));
        assert_eq!(cause(winch.stop()), Cause::Drive(fault));
        assert!(!bench.released.get(), "the brake is tried after the drive failed");
        bench.pin_fails.set(true);
        assert_eq!(cause(winch.stop()), Cause::Drive(fault));
        bench.drive_fault.set(None);
        assert_eq!(cause(winch.stop()), Cause::Brake(ErrorKind::Other));
        assert!(bench.commanded.get().is_none(), "the drive is stopped before the brake failed");
        assert_eq!(cause(winch.measure()), Cause::Brake(ErrorKind::Other));
    }

    #[test]
    fn homing_moves_the_lengths() {
        let bench = Bench::default();
        let mut winch = winch(&bench);
        bench.angle.set(MotorAngle::from_units(123 << 32));
        winch.measure().unwrap();
        winch.home(7.5).unwrap();
        assert!((winch.measure().unwrap() - 7.5).abs() < 1e-9);
    }

    /// A pin that goes nowhere.
    struct Nowhere;

    impl ErrorType for Nowhere {
        type Error = Infallible;
    }

    impl OutputPin for Nowhere {
        fn set_low(&mut self) -> Result<(), Infallible> {
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }

    const PERIOD_S: f32 = 1e-3;

    /// A swing of 0.4 m about 20 m in 4 s: at most 0.63 m/s.
    #[allow(clippy::cast_possible_truncation)]
    fn swing(tick: u32) -> (f32, f32) {
        let omega = core::f64::consts::TAU / 4.0;
        let phase = omega * f64::from(PERIOD_S) * f64::from(tick);
        let length = 20.0 + 0.4 * libm::sin(phase);
        (length as f32, (0.4 * omega * libm::cos(phase)) as f32)
    }

    #[test]
    fn a_stepper_follows_a_swing_to_a_step() {
        // 251 rad/s at the motor are 128 steps of 3200 in a tick: 300 polls.
        let polls = NonZeroU32::new(300).unwrap();
        let one = NonZeroU8::MIN;
        let timing =
            StepTiming { setup_polls: one, high_polls: one, low_polls: one, polls_per_tick: polls };
        let steps_per_turn = NonZeroU32::new(3200).unwrap();
        let link = StepLink::new();
        let mut steps = StepDir::new(&link, Nowhere, Nowhere, timing).unwrap();
        let drum = Drum::new(&DESIGN, swing(0).0, MotorAngle::ZERO).unwrap();
        let mut winch = Winch::new(
            0,
            drum,
            StepDrive::new(&link, &timing, steps_per_turn, PERIOD_S),
            StepCounter::new(&link, steps_per_turn),
            Brake::new(Nowhere, PinState::High, 0).unwrap(),
            0.001,
        )
        .unwrap();
        winch.measure().unwrap();
        winch.hold().unwrap();
        let step_m = 0.315 / 20.0 / 3200.0;
        for tick in 0..8000 {
            let (length, rate) = swing(tick);
            let measured = winch.measure().unwrap();
            // A step and the pulse under way; 2 um of the rounded length; and what the end of the
            // last tick was aimed beside, a t^2/2 = 0.5 um.
            if tick > 0 {
                let error = (measured - length).abs();
                assert!(error < 2.0 * step_m + 2.5e-6 + 0.5e-6, "tick {tick}: {error:e}");
            }
            winch.command(length, rate).unwrap();
            for _ in 0..polls.get() {
                steps.poll().unwrap();
            }
        }
    }

    /// An amplifier whose duty is the speed, and its motor.
    struct Amplifier<'a>(&'a Cell<u16>);

    impl pwm::ErrorType for Amplifier<'_> {
        type Error = Infallible;
    }

    impl SetDutyCycle for Amplifier<'_> {
        fn max_duty_cycle(&self) -> u16 {
            4000
        }

        fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
            self.0.set(duty);
            Ok(())
        }
    }

    struct Direction<'a>(&'a Cell<bool>);

    impl ErrorType for Direction<'_> {
        type Error = Infallible;
    }

    impl OutputPin for Direction<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.set(false);
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0.set(true);
            Ok(())
        }
    }

    struct Shaft<'a>(&'a Cell<f64>);

    impl Encoder for Shaft<'_> {
        fn angle(&mut self) -> Result<MotorAngle, EncoderFault> {
            Ok(MotorAngle::from_rad(self.0.get()).unwrap())
        }
    }

    #[test]
    fn an_amplifier_follows_a_swing() {
        let (duty, forward, shaft) = (Cell::new(0), Cell::new(false), Cell::new(0.0));
        let settings = VelocitySettings {
            full_scale_rad_s: 400.0,
            dead_band_rad_s: 0.05,
            lowest_duty: 0.0,
            highest_duty: 1.0,
            gain_per_s: 100.0,
        };
        let drive = VelocityDrive::new(Amplifier(&duty), Direction(&forward), settings).unwrap();
        let drum = Drum::new(&DESIGN, swing(0).0, MotorAngle::ZERO).unwrap();
        let brake = Brake::new(Nowhere, PinState::High, 0).unwrap();
        let mut winch = Winch::new(5, drum, drive, Shaft(&shaft), brake, 0.01).unwrap();
        winch.measure().unwrap();
        winch.hold().unwrap();
        let mut speed = 0.0;
        let mut worst = 0.0_f32;
        for tick in 0..8000 {
            let (length, rate) = swing(tick);
            let measured = winch.measure().unwrap();
            if tick > 200 {
                worst = worst.max((measured - length).abs());
            }
            winch.command(length, rate).unwrap();
            // The motor follows its amplifier with a lag of 2 ms, and 1 % too slowly.
            let sign = if forward.get() { 1.0 } else { -1.0 };
            let wanted = 0.99 * sign * f64::from(duty.get()) / 4000.0 * 400.0;
            speed += (wanted - speed) * (1.0 - libm::exp(-0.5));
            shaft.set(shaft.get() + speed * f64::from(PERIOD_S));
        }
        // 1 % of 0.63 m/s at a gain of 100/s is 63 um; the lag, 2 ms of 1 m/s^2, 20 um more.
        assert!(worst < 1e-4, "{worst:e}");
        assert!(worst > 1e-6, "the plant has no error: {worst:e}");
    }
}
