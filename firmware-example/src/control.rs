//! What the controller does at a tick, whatever the board.

use cdpr_core::{Command, Fault, SetPoint, Tracker};

use crate::Number;
use crate::path::{Course, Path};
use crate::rehearsal::Inputs;
use crate::robot::{self, Model};

/// What has come of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event<T> {
    /// A new command, certified.
    Commanded,
    /// No new command; the last one stands.
    Refused(Fault<T>),
    /// The emergency stop is pressed; the last command stands.
    Stopped,
}

/// What has come of all ticks so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary<T> {
    /// Ticks.
    pub ticks: u32,
    /// Those with a new command.
    pub certified: u32,
    /// Those with a fault.
    pub faults: u32,
    /// Those with the emergency stop pressed.
    pub stopped: u32,
    /// Largest distance between the end of a cable and its attachment, m.
    pub largest_closure_m: T,
    /// Of the bits of all rest lengths commanded.
    pub checksum: Checksum,
}

/// FNV-1a, taken word by word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checksum(u64);

impl Checksum {
    const EMPTY: Self = Self(0xcbf2_9ce4_8422_2325);

    fn add(&mut self, word: u64) {
        self.0 = (self.0 ^ word).wrapping_mul(0x0000_0100_0000_01b3);
    }

    /// The checksum.
    #[must_use]
    pub fn value(self) -> u64 {
        self.0
    }
}

/// A tracker, and what stands between it and the winches.
#[derive(Clone, Copy, Debug)]
pub struct Control<T: Number> {
    tracker: Tracker<T, Model<T>>,
    summary: Summary<T>,
}

impl<T: Number> Control<T> {
    /// At the start of `course`, the platform at rest.
    ///
    /// # Errors
    /// [`Fault`] of the constants of [`robot`].
    pub fn start(course: Course) -> Result<Self, Fault<T>> {
        let summary = Summary {
            ticks: 0,
            certified: 0,
            faults: 0,
            stopped: 0,
            largest_closure_m: T::zero(),
            checksum: Checksum::EMPTY,
        };
        Ok(Self { tracker: start_tracker(course)?, summary })
    }

    /// One tick. Then [`Control::command`] is for the winches, whatever has happened.
    pub fn tick(&mut self, inputs: &Inputs<T>) -> Event<T> {
        let event = self.track(inputs);
        let Summary { ticks, certified, faults, stopped, .. } = &mut self.summary;
        *ticks += 1;
        *match event {
            Event::Commanded => certified,
            Event::Refused(_) => faults,
            Event::Stopped => stopped,
        } += 1;
        let command = self.tracker.command();
        self.summary.largest_closure_m = self.summary.largest_closure_m.max(command.closure_m);
        for cable in &command.cables {
            self.summary.checksum.add(cable.rest_length_m.bits());
        }
        event
    }

    fn track(&mut self, inputs: &Inputs<T>) -> Event<T> {
        if inputs.is_stop_pressed {
            return Event::Stopped;
        }
        let set_point: Result<SetPoint<T>, _> = inputs.target.set_point().map_err(Fault::Geometry);
        match set_point.and_then(|set_point| self.tracker.tick(&set_point).map(|_| ())) {
            Ok(()) => Event::Commanded,
            Err(fault) => Event::Refused(fault),
        }
    }

    /// For the winches.
    #[must_use]
    pub fn command(&self) -> &Command<T> {
        self.tracker.command()
    }

    /// Of all ticks so far.
    #[must_use]
    pub fn summary(&self) -> &Summary<T> {
        &self.summary
    }
}

/// The tracker at the start of `course`.
///
/// # Errors
/// [`Fault`] of the constants of [`robot`].
pub fn start_tracker<T: Number>(course: Course) -> Result<Tracker<T, Model<T>>, Fault<T>> {
    let robot = robot::crane().map_err(Fault::Geometry)?;
    let set_point = Path::new(course).target().set_point().map_err(Fault::Geometry)?;
    let (load, states) = (robot::load(&course.payload), robot::start_states(&course.payload));
    Tracker::start(robot, load, robot::settings(), &set_point, &states)
}
