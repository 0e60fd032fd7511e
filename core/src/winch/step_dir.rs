//! Step and direction outputs for a stepper or a servo amplifier.
//!
//! The work is divided: [`StepDrive`] belongs to the control loop and says, once a tick, where to
//! be at its end; [`StepDir`] belongs to a fast timer interrupt and makes the edges. Both hold the
//! same [`StepLink`], a `static`, through which neither ever waits for the other.

use core::num::{NonZeroU8, NonZeroU32};
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering};

use embedded_hal::digital::{Error, ErrorKind, OutputPin};

use super::angle::{Countable, MotorAngle, UNITS_PER_RAD, low_word, to_real};
use super::drive::{Drive, DriveFault};
use super::encoder::{Encoder, EncoderFault};

/// Times, in polls of [`StepDir`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StepTiming {
    /// From a change of direction to the next step pulse.
    pub setup_polls: NonZeroU8,
    /// Length of a step pulse.
    pub high_polls: NonZeroU8,
    /// Least pause after a step pulse, before the next one or a change of direction.
    pub low_polls: NonZeroU8,
    /// Polls in a tick of the control loop; both must come from the same clock.
    pub polls_per_tick: NonZeroU32,
}

/// One command: see [`StepLink`].
#[derive(Clone, Copy)]
struct Ramp {
    /// Where the reference is at the end of the tick, 2^-32 step.
    target: i64,
    /// How far it moves in a poll, 2^-32 step.
    increment: i64,
}

/// What a [`StepDrive`] and its [`StepDir`] have in common.
///
/// A command is written beside the last one, and then the number of commands, whose lowest bit
/// tells which is the newer. An interrupt on the same core sees all of a command or nothing of it;
/// on another core that holds as long as a poll does not last two ticks.
#[derive(Debug, Default)]
pub struct StepLink {
    even: [AtomicU32; 4],
    odd: [AtomicU32; 4],
    commands: AtomicU32,
    runs: AtomicBool,
    position: AtomicI32,
}

impl StepLink {
    /// Standing at step 0.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            even: [const { AtomicU32::new(0) }; 4],
            odd: [const { AtomicU32::new(0) }; 4],
            commands: AtomicU32::new(0),
            runs: AtomicBool::new(false),
            position: AtomicI32::new(0),
        }
    }

    /// Steps made forwards less those made backwards.
    pub fn position_steps(&self) -> i32 {
        self.position.load(Ordering::Acquire)
    }

    /// No step begins from now on. A pulse that has begun is finished.
    fn halt(&self) {
        self.runs.store(false, Ordering::Release);
    }

    fn publish(&self, ramp: Ramp) {
        let command = self.commands.load(Ordering::Relaxed).wrapping_add(1);
        let [target_low, target_high, increment_low, increment_high] = self.slot(command);
        target_low.store(low_word(ramp.target), Ordering::Relaxed);
        target_high.store(low_word(ramp.target >> 32), Ordering::Relaxed);
        increment_low.store(low_word(ramp.increment), Ordering::Relaxed);
        increment_high.store(low_word(ramp.increment >> 32), Ordering::Relaxed);
        self.commands.store(command, Ordering::Release);
        self.runs.store(true, Ordering::Release);
    }

    fn read(&self, command: u32) -> Ramp {
        let [target_low, target_high, increment_low, increment_high] = self.slot(command);
        let join = |low: &AtomicU32, high: &AtomicU32| {
            i64::from(high.load(Ordering::Relaxed).cast_signed()) << 32
                | i64::from(low.load(Ordering::Relaxed))
        };
        Ramp {
            target: join(target_low, target_high),
            increment: join(increment_low, increment_high),
        }
    }

    fn slot(&self, command: u32) -> &[AtomicU32; 4] {
        if command & 1 == 0 { &self.even } else { &self.odd }
    }
}

/// Makes the edges, from a fast timer interrupt.
///
/// A reference runs from where it should be at the start of the tick to where it should be at the
/// end, in equal parts of 2^-32 step for each poll; a step is due whenever the counted position is
/// too far from it. So the steps are evenly spaced over the whole tick whatever the speed, and
/// nothing is lost that had to wait: for the direction to settle, or for the last pulse to end.
#[derive(Debug)]
pub struct StepDir<'a, S, D> {
    link: &'a StepLink,
    step: S,
    direction: D,
    timing: StepTiming,
    command: u32,
    /// Where the motor should be, 2^-32 step; and how far that moves in each of the polls left.
    reference: i64,
    increment: i64,
    polls_left: u32,
    /// Polls until the next edge is allowed.
    wait: u8,
    is_high: bool,
    is_forward: bool,
}

/// A step is made when the reference is further away than this, 2^-32 step. Half a step would
/// do, but a reference that hovers midway between two steps would then make it chatter.
const FAR: u64 = 3 << 30;

impl<'a, S: OutputPin, D: OutputPin> StepDir<'a, S, D> {
    /// Takes the pins: a rising edge of `step` is a step, forwards when `direction` is high.
    ///
    /// # Errors
    /// A pin could not be written.
    pub fn new(
        link: &'a StepLink,
        mut step: S,
        mut direction: D,
        timing: StepTiming,
    ) -> Result<Self, ErrorKind> {
        step.set_low().map_err(|e| e.kind())?;
        direction.set_high().map_err(|e| e.kind())?;
        Ok(Self {
            link,
            step,
            direction,
            timing,
            command: link.commands.load(Ordering::Acquire),
            reference: i64::from(link.position_steps()) << 32,
            increment: 0,
            polls_left: 0,
            wait: timing.setup_polls.get() - 1,
            is_high: false,
            is_forward: true,
        })
    }

    /// To be called at equal intervals. Makes at most one edge, of one of the two pins; no loops.
    ///
    /// # Errors
    /// The pin could not be written: the edge is not counted, and tried again at the next poll.
    #[inline]
    pub fn poll(&mut self) -> Result<(), ErrorKind> {
        self.advance();
        if self.wait > 0 {
            self.wait -= 1;
            return Ok(());
        }
        if self.is_high {
            self.step.set_low().map_err(|e| e.kind())?;
            self.is_high = false;
            self.wait = self.timing.low_polls.get() - 1;
            return Ok(());
        }
        let position = self.link.position.load(Ordering::Relaxed);
        let ahead = self.reference.saturating_sub(i64::from(position) << 32);
        if ahead.unsigned_abs() <= FAR || !self.link.runs.load(Ordering::Acquire) {
            return Ok(());
        }
        let is_forward = ahead > 0;
        if is_forward != self.is_forward {
            self.direction.set_state(is_forward.into()).map_err(|e| e.kind())?;
            self.is_forward = is_forward;
            self.wait = self.timing.setup_polls.get() - 1;
            return Ok(());
        }
        self.step.set_high().map_err(|e| e.kind())?;
        self.is_high = true;
        self.wait = self.timing.high_polls.get() - 1;
        let next = position.wrapping_add(if is_forward { 1 } else { -1 });
        self.link.position.store(next, Ordering::Release);
        Ok(())
    }

    /// Moves the reference.
    #[inline]
    fn advance(&mut self) {
        let command = self.link.commands.load(Ordering::Acquire);
        if command != self.command {
            self.command = command;
            let ramp = self.link.read(command);
            self.polls_left = self.timing.polls_per_tick.get();
            // Counted back from the target, which is then met exactly.
            let way = ramp.increment.wrapping_mul(i64::from(self.polls_left));
            self.reference = ramp.target.wrapping_sub(way);
            self.increment = ramp.increment;
        }
        if self.polls_left > 0 {
            self.polls_left -= 1;
            self.reference = self.reference.wrapping_add(self.increment);
        }
    }
}

/// Commands a [`StepDir`] from the control loop.
///
/// After a start or a stop the first command ties the steps to the measured angle, so that steps
/// lost while stopping hard, or a motor turned by hand, do no harm.
#[derive(Debug)]
pub struct StepDrive<'a, T> {
    link: &'a StepLink,
    steps_per_turn: NonZeroU32,
    polls_per_tick: NonZeroU32,
    /// Largest increment: one step in the shortest pulse and pause.
    fastest: u64,
    units_per_rad_s: T,
    rad_s_per_increment: T,
    /// Last target, 2^-32 step, and the angle of step 0; `None` while stopped.
    course: Option<Course>,
}

#[derive(Clone, Copy, Debug)]
struct Course {
    target: i64,
    angle_of_zero: i64,
}

impl<'a, T: Countable> StepDrive<'a, T> {
    /// `steps_per_turn` of the motor, microsteps included; `period_s` is the time of a tick.
    /// `timing` is that of the [`StepDir`] of the same `link`.
    pub fn new(
        link: &'a StepLink,
        timing: &StepTiming,
        steps_per_turn: NonZeroU32,
        period_s: T,
    ) -> Self {
        let polls_per_step = u64::from(timing.high_polls.get()) + u64::from(timing.low_polls.get());
        let polls = to_real::<T>(i64::from(timing.polls_per_tick.get()));
        let units_per_rad = T::constant(UNITS_PER_RAD);
        let steps_per_turn_real = to_real::<T>(i64::from(steps_per_turn.get()));
        Self {
            link,
            steps_per_turn,
            polls_per_tick: timing.polls_per_tick,
            fastest: (1 << 32) / polls_per_step.max(2),
            units_per_rad_s: units_per_rad * period_s,
            rad_s_per_increment: polls / (steps_per_turn_real * units_per_rad * period_s),
            course: None,
        }
    }

    /// Highest speed of the motor, rad/s: a step in the shortest pulse and pause.
    pub fn fastest_rad_s(&self) -> T {
        self.speed_rad_s(self.fastest)
    }

    fn speed_rad_s(&self, increment: u64) -> T {
        T::from_u64(increment).unwrap_or_else(T::zero) * self.rad_s_per_increment
    }

    /// The ramp to the target, and where it leads.
    fn course(
        &self,
        angle: MotorAngle,
        speed_rad_s: T,
        measured: MotorAngle,
    ) -> Result<(Course, Ramp), DriveFault<T>> {
        let plan = || {
            let ahead = (speed_rad_s * self.units_per_rad_s).to_i64()?;
            let end = angle.checked_add(MotorAngle::from_units(ahead))?;
            let end = end.fine_counts(self.steps_per_turn)?;
            let last = if let Some(course) = self.course {
                course
            } else {
                let target = i64::from(self.link.position_steps()) << 32;
                let measured = measured.fine_counts(self.steps_per_turn)?;
                Course { target, angle_of_zero: measured.checked_sub(target)? }
            };
            let target = end.checked_sub(last.angle_of_zero)?;
            let way = target.checked_sub(last.target)?;
            let increment = way / i64::from(self.polls_per_tick.get());
            Some((Course { target, ..last }, Ramp { target, increment }))
        };
        let (course, ramp) = plan().ok_or(DriveFault::OutOfRange)?;
        let increment = ramp.increment.unsigned_abs();
        if increment > self.fastest {
            return Err(DriveFault::OverSpeed {
                speed_rad_s: self.speed_rad_s(increment),
                limit_rad_s: self.fastest_rad_s(),
            });
        }
        Ok((course, ramp))
    }
}

impl<T: Countable> Drive<T> for StepDrive<'_, T> {
    /// At the end of the tick the motor stands where `angle` and `speed_rad_s` lead in a tick,
    /// to a step, whatever the last command left undone.
    fn command(
        &mut self,
        angle: MotorAngle,
        speed_rad_s: T,
        measured: MotorAngle,
    ) -> Result<(), DriveFault<T>> {
        let (course, ramp) = self.course(angle, speed_rad_s, measured)?;
        self.course = Some(course);
        self.link.publish(ramp);
        Ok(())
    }

    fn stop(&mut self) -> Result<(), DriveFault<T>> {
        self.link.halt();
        self.course = None;
        Ok(())
    }
}

/// For a stepper without an encoder: takes every step that was sent for made.
#[derive(Clone, Copy, Debug)]
pub struct StepCounter<'a> {
    link: &'a StepLink,
    steps_per_turn: NonZeroU32,
}

impl<'a> StepCounter<'a> {
    /// Counts the steps of the [`StepDir`] with the same `link`.
    pub fn new(link: &'a StepLink, steps_per_turn: NonZeroU32) -> Self {
        Self { link, steps_per_turn }
    }
}

impl Encoder for StepCounter<'_> {
    fn angle(&mut self) -> Result<MotorAngle, EncoderFault> {
        Ok(MotorAngle::from_counts(self.link.position_steps(), self.steps_per_turn))
    }
}

#[cfg(test)]
mod tests {
    extern crate alloc;
    extern crate std;
    use super::*;
    use alloc::vec::Vec;
    use core::cell::Cell;
    use core::convert::Infallible;
    use embedded_hal::digital::ErrorType;
    use embedded_hal_mock::eh1::MockError;
    use embedded_hal_mock::eh1::digital::{Mock, State, Transaction};
    use proptest::prelude::*;
    use std::io;

    fn timing(setup: u8, high: u8, low: u8, polls_per_tick: u32) -> StepTiming {
        StepTiming {
            setup_polls: NonZeroU8::new(setup).unwrap(),
            high_polls: NonZeroU8::new(high).unwrap(),
            low_polls: NonZeroU8::new(low).unwrap(),
            polls_per_tick: NonZeroU32::new(polls_per_tick).unwrap(),
        }
    }

    const STEPS: NonZeroU32 = NonZeroU32::new(3200).unwrap();

    /// A motor that counts rising edges, and checks the times of its data sheet.
    #[derive(Default)]
    struct Motor {
        position: Cell<i32>,
        forward: Cell<bool>,
        high: Cell<bool>,
        now: Cell<u32>,
        turned: Cell<u32>,
        rose: Cell<u32>,
        fell: Cell<u32>,
        edges: Cell<u32>,
    }

    struct StepPin<'a>(&'a Motor, StepTiming);
    struct DirectionPin<'a>(&'a Motor, StepTiming);

    impl ErrorType for StepPin<'_> {
        type Error = Infallible;
    }
    impl ErrorType for DirectionPin<'_> {
        type Error = Infallible;
    }

    impl OutputPin for StepPin<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            let motor = self.0;
            if motor.high.replace(false) {
                assert!(motor.now.get() - motor.rose.get() >= self.1.high_polls.get().into());
                motor.fell.set(motor.now.get());
                motor.edges.set(motor.edges.get() + 1);
            }
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), Infallible> {
            let motor = self.0;
            assert!(!motor.high.replace(true), "a step during a step");
            assert!(motor.now.get() - motor.turned.get() >= self.1.setup_polls.get().into());
            assert!(motor.now.get() - motor.fell.get() >= self.1.low_polls.get().into());
            motor.rose.set(motor.now.get());
            motor.edges.set(motor.edges.get() + 1);
            motor.position.set(motor.position.get() + if motor.forward.get() { 1 } else { -1 });
            Ok(())
        }
    }

    impl OutputPin for DirectionPin<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.turn(false)
        }

        fn set_high(&mut self) -> Result<(), Infallible> {
            self.turn(true)
        }
    }

    impl DirectionPin<'_> {
        #[allow(clippy::unnecessary_wraps)] // as the trait wants it
        fn turn(&mut self, forward: bool) -> Result<(), Infallible> {
            let motor = self.0;
            assert!(!motor.high.get(), "turned during a step");
            assert!(motor.now.get() - motor.fell.get() >= self.1.low_polls.get().into());
            motor.forward.set(forward);
            motor.turned.set(motor.now.get());
            motor.edges.set(motor.edges.get() + 1);
            Ok(())
        }
    }

    fn run(motor: &Motor, steps: &mut StepDir<StepPin, DirectionPin>, polls: u32) {
        for _ in 0..polls {
            motor.now.set(motor.now.get() + 1);
            let edges = motor.edges.get();
            steps.poll().unwrap();
            assert!(motor.edges.get() - edges <= 1, "more than one edge in a poll");
        }
    }

    fn at_step(step: i32) -> MotorAngle {
        MotorAngle::from_counts(step, NonZeroU32::new(3200).unwrap())
    }

    fn new_motor() -> Motor {
        let motor = Motor::default();
        motor.now.set(1000); // all that went before is long ago
        motor
    }

    proptest! {
        #[test]
        fn every_target_is_met(
            setup in 1_u8..6, high in 1_u8..4, low in 1_u8..4, polls_per_tick in 20_u32..400,
            moves in prop::collection::vec((-1.0..1.0_f64, -2_i32..=2), 1..20),
        ) {
            let timing = timing(setup, high, low, polls_per_tick);
            let (motor, link) = (new_motor(), StepLink::new());
            let mut steps = StepDir::new(
                &link, StepPin(&motor, timing), DirectionPin(&motor, timing), timing,
            ).unwrap();
            let mut drive = StepDrive::new(&link, &timing, STEPS, 1e-3_f64);
            let fastest = f64::from(polls_per_tick) / f64::from(high + low); // steps in a tick
            let mut target = 0_i32;
            for (part, jitter) in moves {
                let from = target;
                #[allow(clippy::cast_possible_truncation)]
                let way = (part * fastest) as i32;
                target += way;
                let speed = f64::from(way) / f64::from(STEPS.get()) * core::f64::consts::TAU / 1e-3;
                prop_assert!(speed.abs() <= drive.fastest_rad_s() * (1.0 + 1e-12));
                // Where it is to be now, and the speed that leads to the target in a tick.
                drive.command(at_step(from), speed, at_step(from)).unwrap();
                // Ticks may come a little early or late.
                run(&motor, &mut steps, polls_per_tick.saturating_add_signed(jitter));
                // What is late waited for the direction and one pulse, or for the next tick.
                let late = u32::from(setup) + 2 * u32::from(high + low) + 2;
                let late_steps = late / u32::from(high + low) + 1;
                prop_assert!((target - motor.position.get()).unsigned_abs() <= late_steps);
                prop_assert_eq!(link.position_steps(), motor.position.get());
            }
            // The loop falls silent: the last target is met, exactly, and kept.
            run(&motor, &mut steps, 10 * (u32::from(setup) + 2 * u32::from(high + low)));
            prop_assert_eq!(motor.position.get(), target);
            let edges = motor.edges.get();
            run(&motor, &mut steps, 100);
            prop_assert_eq!(motor.edges.get(), edges);
        }
    }

    #[test]
    fn steps_are_evenly_spaced_at_any_speed() {
        // 10.3 steps in each tick of 100 polls: every distance is 9 or 10 polls, also across ticks.
        let timing = timing(1, 1, 1, 100);
        let (motor, link) = (new_motor(), StepLink::new());
        let mut steps =
            StepDir::new(&link, StepPin(&motor, timing), DirectionPin(&motor, timing), timing)
                .unwrap();
        let mut drive = StepDrive::new(&link, &timing, STEPS, 1e-3_f64);
        let per_tick = 10.3 / 3200.0 * core::f64::consts::TAU;
        let mut rises = Vec::new();
        for tick in 0..50 {
            let angle = MotorAngle::from_rad(per_tick * f64::from(tick)).unwrap();
            drive.command(angle, per_tick / 1e-3, angle).unwrap();
            for _ in 0..100 {
                let position = motor.position.get();
                run(&motor, &mut steps, 1);
                if motor.position.get() != position {
                    rises.push(motor.now.get());
                }
            }
        }
        assert_eq!(rises.len(), 515);
        assert!(rises.windows(2).all(|pair| (9..=10).contains(&(pair[1] - pair[0]))));
    }

    #[test]
    fn over_speed_is_refused_and_nothing_moves() {
        let timing = timing(1, 1, 1, 100); // at most 50 steps in a tick
        let link = StepLink::new();
        let mut drive = StepDrive::new(&link, &timing, STEPS, 1e-3_f32);
        let limit = drive.fastest_rad_s();
        assert!((limit - 50.0 / 3200.0 * core::f32::consts::TAU / 1e-3).abs() < 1e-4);
        let zero = MotorAngle::ZERO;
        assert!(drive.command(zero, limit * 0.999, zero).is_ok());
        let before = link.commands.load(Ordering::Relaxed);
        // Too fast by its speed, and too fast by its distance.
        for (angle, speed) in [(at_step(50), limit * 1.01), (at_step(200), 0.0)] {
            let fault = drive.command(angle, speed, zero);
            assert!(matches!(fault, Err(DriveFault::OverSpeed { .. })), "{fault:?}");
        }
        assert_eq!(drive.command(zero, f32::NAN, zero), Err(DriveFault::OutOfRange));
        assert_eq!(
            drive.command(MotorAngle::from_units(i64::MAX), 0.0, zero),
            Err(DriveFault::OutOfRange)
        );
        assert_eq!(link.commands.load(Ordering::Relaxed), before);
    }

    #[test]
    fn stops_at_once_and_starts_from_the_measured_angle() {
        let timing = timing(2, 1, 1, 100);
        let (motor, link) = (new_motor(), StepLink::new());
        let mut steps =
            StepDir::new(&link, StepPin(&motor, timing), DirectionPin(&motor, timing), timing)
                .unwrap();
        let mut drive = StepDrive::new(&link, &timing, STEPS, 1e-3_f64);
        drive.command(at_step(40), 0.0, MotorAngle::ZERO).unwrap();
        run(&motor, &mut steps, 30);
        Drive::stop(&mut drive).unwrap();
        let stopped = motor.position.get();
        assert!(stopped > 0 && stopped < 40);
        run(&motor, &mut steps, 200);
        assert_eq!(motor.position.get(), stopped);
        assert!(!motor.high.get(), "the pulse was finished");
        // The motor slipped to step 7000; ten from there are ten steps.
        drive.command(at_step(7010), 0.0, at_step(7000)).unwrap();
        run(&motor, &mut steps, 300);
        assert_eq!(motor.position.get(), stopped + 10);
        let mut counter = StepCounter::new(&link, STEPS);
        assert_eq!(counter.angle().unwrap().counts(STEPS), Some(stopped + 10));
    }

    #[test]
    fn a_command_is_written_beside_the_last_one() {
        let link = StepLink::new();
        let ramps = [(1_i64 << 40, -3_i64), (-5, 1 << 31)];
        let [first, second] = ramps.map(|(target, increment)| {
            link.publish(Ramp { target, increment });
            link.commands.load(Ordering::Relaxed)
        });
        for (command, ramp) in [first, second].into_iter().zip(ramps) {
            let Ramp { target, increment } = link.read(command);
            assert_eq!((target, increment), ramp);
        }
    }

    #[test]
    fn edges_one_by_one_and_a_pin_that_fails() {
        let timing = timing(2, 2, 1, 12);
        let failure = MockError::Io(io::ErrorKind::NotConnected);
        let mut step = Mock::new(&[
            Transaction::set(State::Low),
            Transaction::set(State::High).with_error(failure),
            Transaction::set(State::High),
            Transaction::set(State::Low),
        ]);
        let mut direction =
            Mock::new(&[Transaction::set(State::High), Transaction::set(State::Low)]);
        let link = StepLink::new();
        let mut steps = StepDir::new(&link, step.clone(), direction.clone(), timing).unwrap();
        let mut drive = StepDrive::new(&link, &timing, STEPS, 1e-3_f32);
        drive.command(at_step(-1), 0.0, MotorAngle::ZERO).unwrap();
        // The reference passes 3/4 of a step at the tenth poll: it turns, settles for two polls,
        // fails once, steps, and stays high for two.
        for poll in 1..=20 {
            assert_eq!(steps.poll().is_err(), poll == 12, "poll {poll}");
            let expected = if poll < 13 { 0 } else { -1 };
            assert_eq!(link.position_steps(), expected, "poll {poll}");
        }
        step.done();
        direction.done();
    }
}
