//! An image that links only when nothing in the controller and the winch layer of `cdpr-core` can panic,
//! as `no_panic` does for what is below them; see there. The image is never run.
//!
//! Errors are not printed: the formatting of floats in Rust's own `core` has assertions, which the
//! optimizer cannot remove. Firmware logs them by defmt.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[path = "../hidden.rs"]
mod hidden;

#[cfg(target_os = "none")]
mod image {
    use core::hint::black_box;
    use core::num::{NonZeroU8, NonZeroU32};
    use core::panic::PanicInfo;

    use cdpr_core::controller::Controller;
    use cdpr_core::controller::monitor::{MonitorThresholds, TensionMonitor};
    use cdpr_core::winch::{
        As5047p, Brake, Countable, Drum, EmergencyStop, MotorAngle, MotorEncoder, Sense,
        StepCounter, StepDir, StepDrive, StepLink, StepTiming, VelocityDrive, VelocitySettings,
        Winch,
    };
    use cdpr_core::{CABLES, Real, SetPoint, Table, Tracker};
    use embedded_hal::digital::{ErrorKind, ErrorType, InputPin, OutputPin, PinState};
    use embedded_hal::{pwm, spi};

    use super::hidden::{self, number, readings, stance, way_point};

    unsafe extern "C" {
        /// Defined nowhere.
        safe fn cdpr_core_can_panic() -> !;
    }

    #[panic_handler]
    fn panic(_: &PanicInfo<'_>) -> ! {
        cdpr_core_can_panic()
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        black_box((controller::<f32>(), controller::<f64>()));
        black_box((winches::<f32>(), winches::<f64>()));
        monitor();
        loop {
            cortex_m::asm::wfi();
        }
    }

    /// All that can be asked of a controller, several times over.
    fn controller<T: Real>() -> Option<()> {
        let (robot, load) = (told(hidden::robot())?, hidden::load());
        let (tracker, settings) = (hidden::tracker_settings(), hidden::controller_settings());
        let states = hidden::states();
        let started =
            Controller::<T, _, 8>::start(robot, load, tracker, settings, stance(), &states);
        let mut controller = black_box(told(started)?);
        // Any bytes, any length: a table comes from outside.
        let table = black_box(told(Table::open(black_box::<&[u8]>(&[])))?);
        told(table.check(&robot, &load));
        let set_point = SetPoint { pose: told(stance().pose())?, twist: hidden::twist() };
        told(table.start_at(&set_point.pose));
        told(table.states(&robot, &load, &set_point.pose));
        let started = Tracker::start_from(robot, load, tracker, &set_point, &table, black_box(8));
        told(black_box(told(started)?).restart_from(&set_point, &table, black_box(8)));
        told(Controller::<T, _, 8>::start_from(
            robot,
            load,
            tracker,
            settings,
            stance(),
            &table,
            black_box(8),
        ));
        told(controller.restart_from(stance(), &table, black_box(8)));
        told(controller.arm(&readings()));
        black_box(controller.tick(&readings(), || black_box(Some(way_point()))));
        told(controller.stop());
        told(controller.resume());
        told(controller.cancel());
        black_box(controller.tick(&readings(), || black_box(Some(way_point()))));
        told(controller.acknowledge(&readings()));
        told(controller.disarm());
        black_box((controller.state(), controller.is_halted(), controller.dropped()));
        black_box((controller.stance(), controller.tracker().command()));
        for event in controller.events().iter() {
            black_box(event);
        }
        black_box((controller.events_mut().take(), controller.events().lost()));
        Some(())
    }

    fn monitor() {
        let thresholds = MonitorThresholds { swing_n: number(), spread_n: number() };
        let mut monitor = black_box(TensionMonitor::<32>::new(thresholds));
        let measured = black_box([Some(1.0); CABLES]);
        black_box(monitor.update(&measured, &black_box([1.0; CABLES])));
    }

    /// A pin, a PWM output and a bus of which nothing is known.
    struct Part;

    impl ErrorType for Part {
        type Error = ErrorKind;
    }

    impl OutputPin for Part {
        fn set_low(&mut self) -> Result<(), ErrorKind> {
            black_box(Err(ErrorKind::Other))
        }
        fn set_high(&mut self) -> Result<(), ErrorKind> {
            black_box(Err(ErrorKind::Other))
        }
    }

    impl InputPin for Part {
        fn is_high(&mut self) -> Result<bool, ErrorKind> {
            black_box(Ok(true))
        }
        fn is_low(&mut self) -> Result<bool, ErrorKind> {
            black_box(Ok(true))
        }
    }

    impl pwm::ErrorType for Part {
        type Error = pwm::ErrorKind;
    }

    impl pwm::SetDutyCycle for Part {
        fn max_duty_cycle(&self) -> u16 {
            black_box(7)
        }
        fn set_duty_cycle(&mut self, duty: u16) -> Result<(), pwm::ErrorKind> {
            black_box(duty);
            black_box(Ok(()))
        }
    }

    impl spi::ErrorType for Part {
        type Error = spi::ErrorKind;
    }

    impl spi::SpiDevice for Part {
        fn transaction(
            &mut self,
            operations: &mut [spi::Operation<'_, u8>],
        ) -> Result<(), spi::ErrorKind> {
            black_box(operations);
            black_box(Ok(()))
        }
    }

    static LINK: StepLink = StepLink::new();

    /// Both kinds of winch.
    fn winches<T: Countable>() -> Option<()> {
        let angle = || black_box(MotorAngle::ZERO);
        let design = hidden::drum_design();
        let drum = told(Drum::<T>::new(&design, number(), angle()))?;
        let steps = NonZeroU32::new(black_box(5))?;
        black_box((angle().counts(steps), MotorAngle::from_counts(black_box(4), steps)));
        black_box((MotorAngle::from_rad(number::<T>()), angle().rad::<T>()));
        black_box((drum.rest_length_rate_m_s(number()), drum.motor_speed_rad_s(number())));
        let one = black_box(NonZeroU8::MIN);
        let timing =
            StepTiming { setup_polls: one, high_polls: one, low_polls: one, polls_per_tick: steps };
        let mut pulses = told(StepDir::new(&LINK, Part, Part, timing))?;
        told(pulses.poll());
        let brake = || told(Brake::new(Part, black_box(PinState::High), black_box(3)));
        let drive = StepDrive::new(&LINK, &timing, steps, number());
        let counter = StepCounter::new(&LINK, steps);
        let stepper = Winch::new(black_box(1), drum, drive, counter, brake()?, number());
        let mut winch = told(stepper)?;
        told(winch.measure());
        told(winch.hold());
        told(winch.command(number(), number()));
        told(winch.stop());
        told(winch.home(number()));
        let settings = VelocitySettings {
            full_scale_rad_s: number(),
            dead_band_rad_s: number(),
            lowest_duty: number(),
            highest_duty: number(),
            gain_per_s: number(),
        };
        let drive = told(VelocityDrive::new(Part, Part, settings))?;
        let chip = As5047p::new(Part);
        let encoder = told(MotorEncoder::start(chip, black_box(4), black_box(Sense::Reverse)))?;
        let servo = Winch::new(black_box(1), drum, drive, encoder, brake()?, number());
        let mut winch = told(servo)?;
        told(winch.measure());
        told(winch.hold());
        told(winch.command(number(), number()));
        told(winch.stop());
        told(winch.home(number()));
        let mut stop = EmergencyStop::new(Part, black_box(PinState::High), black_box(3));
        told(stop.tick());
        black_box(stop.reset());
        Some(())
    }

    /// Hides an outcome.
    fn told<R, E>(outcome: Result<R, E>) -> Option<R> {
        black_box(outcome).map_err(|fault| black_box(&raw const fault)).ok()
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
