//! What a winch controller does around the [`Tracker`]: states, motions, faults.
//!
//! Pure logic: no pins, no bus, no clock. The caller calls [`Controller::tick`] once a period with
//! what the winches report, and applies what it returns; a simulation drives the very same code.
//!
//! Way-points come from wherever the caller takes them, one at most a tick. From an interrupt:
//!
//! ```
//! use cdpr_core::controller::{Controller, Queue, Outputs, Readings};
//! use cdpr_core::IrvineCatenary;
//! use heapless::spsc::Consumer;
//! use cdpr_core::controller::WayPoint;
//!
//! // In firmware a `static`, split once; the producer goes to the interrupt that receives.
//! let mut queue = Queue::<f32, 9>::new(); // room for 8
//! let (mut producer, mut consumer) = queue.split();
//!
//! fn period(
//!     controller: &mut Controller<f32, IrvineCatenary<f32>, 16>,
//!     consumer: &mut Consumer<'_, WayPoint<f32>>,
//!     readings: &Readings<f32>,
//! ) -> Outputs<f32> {
//!     controller.tick(readings, || consumer.dequeue())
//! }
//! ```
//!
//! # How the platform comes to rest
//!
//! - At a way-point to stop at: by the motion itself.
//! - After [`Controller::stop`], a stale stream, a fold or a limit ahead, a winch that would be too
//!   fast: along the path, its time slowing evenly to zero within `halt_ticks`.
//! - When no way-point follows a moving one: straight ahead, within the limits of motion.
//! - When the tracker has no command at all: where the last certified command was, at once.
//! - By the brakes, in [`State::Fault`].
//!
//! Having come to rest before its time the platform waits for [`Controller::resume`] or
//! [`Controller::cancel`]; new way-points alone do not move it.

mod events;
pub mod monitor;
mod motion;
mod outlook;
mod path;
mod settings;
mod state;
#[cfg(test)]
mod tests;

pub use events::{Event, EventKind, Events};
pub use motion::{Motion, MotionFault, MotionLimits, Pace, Stance, WayPoint};
pub use path::Halt;
pub use settings::{ControllerSettings, SettingFault, StartFault};
pub use state::{Cause, Outputs, Readings, Refusal, State, WinchTarget};

use self::motion::{smooth_step, whole_ticks};
use self::outlook::Outlook;
use self::path::{Clock, Path, Progress};
use crate::{
    CABLES, CableState, Charted, Fault, Load, Real, Remedy, Robot, Scalar, SetPoint, ShapedCable,
    Table, Tracker, TrackerSettings, Twist,
};

/// Way-points from an interrupt, room for `N - 1`.
pub type Queue<T, const N: usize> = heapless::spsc::Queue<WayPoint<T>, N>;

/// The controller of one robot, with a ring of `EVENTS` events.
#[derive(Clone, Debug)]
pub struct Controller<T: Real, M, const EVENTS: usize> {
    tracker: Tracker<T, M>,
    settings: ControllerSettings<T>,
    mode: Mode<T>,
    /// Where the last certified command holds the platform.
    stance: Stance<T>,
    path: Option<Path<T>>,
    /// The platform came to rest before its time, and waits.
    is_halted: bool,
    /// Way-points left over from before are still in the queue.
    is_flushing: bool,
    /// Of the last outputs, m. Meaningless while disarmed.
    commanded_m: [T; CABLES],
    brakes: Brakes,
    /// For how long a way-point has been wanted and none has come.
    age_ticks: u32,
    tick: u32,
    events: Events<T, EVENTS>,
    dropped: u32,
}

/// Memory of a controller in f32 with eight events and of a queue of eight way-points, bytes: checked where it counts,
/// on a controller of 32 bits.
#[cfg(target_pointer_width = "32")]
const _: () = {
    const LARGEST: usize = 2048;
    type Crane = Controller<f32, crate::IrvineCatenary<f32>, 8>;
    assert!(size_of::<Crane>() + size_of::<Queue<f32, 9>>() < LARGEST);
};

/// [`State`], with what belongs to one state only.
#[derive(Clone, Copy, Debug)]
enum Mode<T> {
    Disarmed,
    Aligning(Alignment<T>),
    Holding { ticks: u32 },
    Tracking,
    Fault(Cause<T>),
}

#[derive(Clone, Copy, Debug)]
struct Alignment<T> {
    start_m: [T; CABLES],
    duration_ticks: u32,
    ticks: u32,
}

/// How long the brakes have been told to be open: `None` when they are to be closed.
#[derive(Clone, Copy, Debug)]
struct Brakes {
    open_ticks: Option<u32>,
}

impl<T: Real, M: ShapedCable<T>, const EVENTS: usize> Controller<T, M, EVENTS> {
    /// A disarmed controller of a robot that stands, or should stand, at `stance` with `states`.
    ///
    /// # Errors
    /// [`StartFault`].
    pub fn start(
        robot: Robot<T, M>,
        load: Load<T>,
        tracker: TrackerSettings<T>,
        settings: ControllerSettings<T>,
        stance: Stance<T>,
        states: &[CableState<T>; CABLES],
    ) -> Result<Self, StartFault<T>> {
        settings.check(&tracker).map_err(StartFault::Setting)?;
        let set_point = resting_at(&stance).map_err(StartFault::Tracker)?;
        let tracker = Tracker::start(robot, load, tracker, &set_point, states);
        Ok(Self::around(tracker.map_err(StartFault::Tracker)?, settings, stance))
    }

    /// [`Controller::start`] on the sheet of a warm-start table, on a way of so many parts at most
    /// ([`Tracker::start_from`]).
    ///
    /// # Errors
    /// [`StartFault`], that of the tracker as in [`Tracker::start_from`].
    pub fn start_from(
        robot: Robot<T, M>,
        load: Load<T>,
        tracker: TrackerSettings<T>,
        settings: ControllerSettings<T>,
        stance: Stance<T>,
        table: &Table<'_>,
        way_parts: u16,
    ) -> Result<Self, StartFault<T>>
    where
        M: Charted<T>,
    {
        settings.check(&tracker).map_err(StartFault::Setting)?;
        let set_point = resting_at(&stance).map_err(StartFault::Tracker)?;
        let tracker = Tracker::start_from(robot, load, tracker, &set_point, table, way_parts);
        Ok(Self::around(tracker.map_err(StartFault::Tracker)?, settings, stance))
    }

    /// A disarmed controller, its settings checked, around a tracker at rest at `stance`.
    fn around(tracker: Tracker<T, M>, settings: ControllerSettings<T>, stance: Stance<T>) -> Self {
        Self {
            commanded_m: tracker.command().cables.map(|cable| cable.rest_length_m),
            tracker,
            settings,
            mode: Mode::Disarmed,
            stance,
            path: None,
            is_halted: false,
            is_flushing: true,
            brakes: Brakes { open_ticks: None },
            age_ticks: 0,
            tick: 0,
            events: Events::new(),
            dropped: 0,
        }
    }

    /// What it does.
    pub fn state(&self) -> State<T> {
        match self.mode {
            Mode::Disarmed => State::Disarmed,
            Mode::Aligning(_) => State::Aligning,
            Mode::Holding { .. } => State::Holding,
            Mode::Tracking => State::Tracking,
            Mode::Fault(cause) => State::Fault(cause),
        }
    }

    /// Whether it came to rest before its time, and waits for [`Controller::resume`] or
    /// [`Controller::cancel`].
    pub fn is_halted(&self) -> bool {
        self.is_halted
    }

    /// Where the last certified command holds the platform.
    pub fn stance(&self) -> &Stance<T> {
        &self.stance
    }

    /// The tracker, with the last certified command.
    pub fn tracker(&self) -> &Tracker<T, M> {
        &self.tracker
    }

    /// What happened.
    pub fn events(&self) -> &Events<T, EVENTS> {
        &self.events
    }

    /// What happened, to be taken.
    pub fn events_mut(&mut self) -> &mut Events<T, EVENTS> {
        &mut self.events
    }

    /// Way-points that came when none was wanted and were dropped; it stops at `u32::MAX`.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Records the warning of a monitor.
    pub fn warn(&mut self, warning: monitor::Warning) {
        self.record(EventKind::Warning(warning));
    }

    /// In [`State::Disarmed`]: starts anew at `stance`, on the sheet of a warm-start table, wherever the
    /// last command held the platform. [`Controller::arm`] then brings the winches to the lengths of that.
    ///
    /// Cost: that of [`Tracker::start_from`], several ticks' worth, and if there is a way the search where it begins and one
    /// tick's worth for each part. Nothing moves meanwhile, but a caller in an interrupt must bear it, or ask for no way.
    ///
    /// # Errors
    /// [`Refusal`]: not disarmed, or [`Refusal::NoRestart`].
    pub fn restart_from(
        &mut self,
        stance: Stance<T>,
        table: &Table<'_>,
        way_parts: u16,
    ) -> Result<(), Refusal<T>>
    where
        M: Charted<T>,
    {
        let Mode::Disarmed = self.mode else {
            return Err(Refusal::NotNow(self.state()));
        };
        let set_point = resting_at(&stance).map_err(Refusal::NoRestart)?;
        let restarted = self.tracker.restart_from(&set_point, table, way_parts);
        restarted.map_err(Refusal::NoRestart)?;
        self.stance = stance;
        Ok(())
    }

    /// From [`State::Disarmed`] to [`State::Aligning`]: opens the brakes and brings the winches
    /// from where they are to the lengths of the tracker.
    ///
    /// # Errors
    /// [`Refusal`]: not disarmed, a winch has failed or is too far off, the emergency stop is
    /// pressed.
    pub fn arm(&mut self, readings: &Readings<T>) -> Result<(), Refusal<T>> {
        let Mode::Disarmed = self.mode else {
            return Err(Refusal::NotNow(self.state()));
        };
        check_readings(readings).map_err(Refusal::Persists)?;
        let start_m = readings.rest_lengths_m;
        let tracker = self.tracker.settings();
        let mut duration_ticks = 1;
        for (cable, wanted) in self.tracker.command().cables.iter().enumerate() {
            let error_m = start_m[cable] - wanted.rest_length_m;
            // Peak speed of the smooth step: 15/8.
            let speed_m_s = self.settings.align_speed_m_s.min(tracker.cables[cable].fastest_m_s);
            let shortest_s = error_m.abs() * T::constant(15.0 / 8.0) / speed_m_s;
            let ticks = whole_ticks(shortest_s / tracker.period_s + T::one());
            match ticks {
                Ok(ticks) if error_m.abs() <= self.settings.align_reach_m => {
                    duration_ticks = duration_ticks.max(ticks);
                }
                _ => return Err(Refusal::TooFarToAlign { cable, error_m }),
            }
        }
        self.commanded_m = start_m;
        self.is_flushing = true;
        self.enter(Mode::Aligning(Alignment { start_m, duration_ticks, ticks: 0 }));
        Ok(())
    }

    /// From [`State::Aligning`] or [`State::Holding`] to [`State::Disarmed`]: closes the brakes.
    ///
    /// # Errors
    /// [`Refusal::NotNow`].
    pub fn disarm(&mut self) -> Result<(), Refusal<T>> {
        match self.mode {
            Mode::Aligning(_) | Mode::Holding { .. } => {
                self.abandon();
                self.enter(Mode::Disarmed);
                Ok(())
            }
            _ => Err(Refusal::NotNow(self.state())),
        }
    }

    /// Brings a motion to rest along its path.
    ///
    /// # Errors
    /// [`Refusal::NotNow`] when not [`State::Tracking`].
    pub fn stop(&mut self) -> Result<(), Refusal<T>> {
        match (&self.mode, &mut self.path) {
            (Mode::Tracking, Some(path)) => {
                path.halt(Halt::Asked);
                Ok(())
            }
            _ => Err(Refusal::NotNow(self.state())),
        }
    }

    /// Goes on after a halt: with the rest of the motion, if any, then with the way-points waiting.
    ///
    /// # Errors
    /// [`Refusal`] when not [`State::Holding`], or not [halted](Controller::is_halted).
    pub fn resume(&mut self) -> Result<(), Refusal<T>> {
        self.end_halt()?;
        self.age_ticks = 0;
        if let Some(path) = &mut self.path {
            path.resume();
        }
        Ok(())
    }

    /// Gives up the rest of a halted motion, and the way-points that wait when this is called: as
    /// many ticks take them from the queue.
    ///
    /// # Errors
    /// [`Refusal`] when not [`State::Holding`], or not [halted](Controller::is_halted).
    pub fn cancel(&mut self) -> Result<(), Refusal<T>> {
        self.end_halt()?;
        self.abandon();
        Ok(())
    }

    fn end_halt(&mut self) -> Result<(), Refusal<T>> {
        match self.mode {
            Mode::Holding { .. } if self.is_halted => {
                self.is_halted = false;
                Ok(())
            }
            Mode::Holding { .. } => Err(Refusal::NotHalted),
            _ => Err(Refusal::NotNow(self.state())),
        }
    }

    /// From [`State::Fault`] to [`State::Disarmed`], when the cause is gone.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn acknowledge(&mut self, readings: &Readings<T>) -> Result<(), Refusal<T>> {
        let Mode::Fault(_) = self.mode else {
            return Err(Refusal::NotNow(self.state()));
        };
        check_readings(readings).map_err(Refusal::Persists)?;
        self.enter(Mode::Disarmed);
        Ok(())
    }

    /// One period: reads, decides, and says what the winches are to do.
    ///
    /// `next_way_point` is called at most once. Way-points are dropped while the platform could not
    /// take them: disarmed, aligning, in a fault, after [`Controller::cancel`].
    ///
    /// Cost: at most two ticks of the tracker, one motion planned and one made, one evaluated twice;
    /// no loop with a variable bound.
    pub fn tick(
        &mut self,
        readings: &Readings<T>,
        next_way_point: impl FnOnce() -> Option<WayPoint<T>>,
    ) -> Outputs<T> {
        self.tick = self.tick.wrapping_add(1);
        if let Some(cause) = self.trouble(readings) {
            self.fail(cause);
        }
        self.take_way_point(next_way_point);
        let targets = match self.mode {
            Mode::Disarmed | Mode::Fault(_) => None,
            Mode::Aligning(alignment) => self.align(alignment, readings),
            Mode::Holding { ticks } => self.hold(ticks),
            Mode::Tracking => self.track(),
        };
        if let Some(targets) = &targets {
            self.commanded_m = targets.map(|target| target.rest_length_m);
        }
        let brakes_released = self.brakes.open_ticks.is_some();
        self.brakes.open_ticks = self.brakes.open_ticks.map(|ticks| ticks.saturating_add(1));
        Outputs { targets, brakes_released }
    }

    /// Why nothing must move.
    fn trouble(&self, readings: &Readings<T>) -> Option<Cause<T>> {
        match self.mode {
            Mode::Fault(_) => None,
            // Lengths are of no interest yet.
            Mode::Disarmed => check_switches(readings).err(),
            _ => check_readings(readings).err().or_else(|| {
                self.off_by_more_than(self.settings.following_m, readings)
                    .map(|(cable, error_m)| Cause::FollowingError { cable, error_m })
            }),
        }
    }

    /// The first cable that is not where it was commanded to be.
    fn off_by_more_than(&self, tolerance_m: T, readings: &Readings<T>) -> Option<(usize, T)> {
        let errors = readings.rest_lengths_m.iter().zip(&self.commanded_m);
        errors
            .map(|(&measured_m, &commanded_m)| measured_m - commanded_m)
            .enumerate()
            .find(|(_, error_m)| error_m.abs() > tolerance_m)
    }

    fn take_way_point(&mut self, next: impl FnOnce() -> Option<WayPoint<T>>) {
        let is_wanted = match (&self.mode, &self.path) {
            _ if self.is_flushing => false,
            (Mode::Holding { .. }, None) if !self.is_halted => true,
            (Mode::Holding { .. } | Mode::Tracking, Some(path)) if path.has_room() => true,
            (Mode::Holding { .. } | Mode::Tracking, _) => {
                self.age_ticks = 0;
                return; // it waits in the queue
            }
            _ => false,
        };
        let Some(way_point) = next() else {
            self.is_flushing = false;
            self.age_ticks = self.age_ticks.saturating_add(1);
            return;
        };
        if !is_wanted {
            self.dropped = self.dropped.saturating_add(1);
            return;
        }
        let (limits, clock) = (&self.settings.motion, self.clock());
        let outcome = match &mut self.path {
            Some(path) => path.offer(way_point, limits, &clock),
            None => Motion::new(&self.stance, &Twist::none(), &way_point, limits, clock.period_s)
                .map(|motion| self.path = Some(Path::new(motion, &clock))),
        };
        match outcome {
            Ok(()) => self.age_ticks = 0,
            Err(fault) => {
                self.age_ticks = self.age_ticks.saturating_add(1); // as if none had come
                self.record(EventKind::Refused(fault));
            }
        }
    }

    fn align(
        &mut self,
        alignment: Alignment<T>,
        readings: &Readings<T>,
    ) -> Option<[WinchTarget<T>; CABLES]> {
        let Alignment { start_m, duration_ticks, ticks } = alignment;
        if !self.open_brakes() {
            return Some(still(&start_m));
        }
        let wanted_m = self.certified_m();
        if ticks >= duration_ticks {
            match self.off_by_more_than(self.settings.align_tolerance_m, readings) {
                None => self.enter(Mode::Holding { ticks: 0 }),
                Some((cable, error_m)) => {
                    if ticks - duration_ticks >= self.settings.settle_ticks {
                        self.fail(Cause::NotAligned { cable, error_m });
                        return None;
                    }
                    self.mode = Mode::Aligning(Alignment { ticks: ticks + 1, ..alignment });
                }
            }
            return Some(still(&wanted_m));
        }
        self.mode = Mode::Aligning(Alignment { ticks: ticks + 1, ..alignment });
        let duration = T::constant(f64::from(duration_ticks));
        let (s, slope) = smooth_step(T::constant(f64::from(ticks + 1)) / duration);
        let per_second = slope / (duration * self.tracker.settings().period_s);
        Some(core::array::from_fn(|i| {
            let way_m = wanted_m[i] - start_m[i];
            // The last command is the wanted length to the bit.
            let rest_length_m =
                if ticks + 1 == duration_ticks { wanted_m[i] } else { start_m[i] + way_m * s };
            WinchTarget { rest_length_m, rate_m_s: way_m * per_second }
        }))
    }

    fn hold(&mut self, ticks: u32) -> Option<[WinchTarget<T>; CABLES]> {
        if self.path.is_some() && !self.is_halted {
            if self.open_brakes() {
                self.enter(Mode::Tracking);
                return self.track();
            }
        } else {
            if self.settings.brake_after_ticks.is_some_and(|limit| ticks >= limit) {
                self.brakes.open_ticks = None;
            }
            self.mode = Mode::Holding { ticks: ticks.saturating_add(1) };
        }
        Some(still(&self.certified_m()))
    }

    fn track(&mut self) -> Option<[WinchTarget<T>; CABLES]> {
        let clock = self.clock();
        let Some(path) = &mut self.path else {
            self.enter(Mode::Holding { ticks: 0 });
            return Some(still(&self.certified_m()));
        };
        if self.settings.stream_ticks.is_some_and(|limit| self.age_ticks > limit) {
            path.halt(Halt::Fault(Fault::StaleSetPoint { age_ticks: self.age_ticks }));
        }
        let before = Outlook::of(self.tracker.command());
        let tracker = &mut self.tracker;
        let progress = path.advance(
            &mut self.stance,
            &self.settings.motion,
            &clock,
            self.age_ticks,
            |set_point| tracker.tick(set_point).map(|_| ()),
        );
        let halt = path.halted();
        match progress {
            Progress::Moving => {
                let command = self.tracker.command();
                let settings = self.tracker.settings();
                // A halt goes half as far as the same ticks at the present speed.
                let ticks = T::constant(0.5 * f64::from(clock.halt_ticks + 1));
                if let Some(fault) = before.fault(&Outlook::of(command), &settings.cables, ticks) {
                    path.halt(Halt::Fault(fault));
                }
                return Some(command.cables.map(|cable| WinchTarget {
                    rest_length_m: cable.rest_length_m,
                    rate_m_s: cable.rest_length_rate_m_s,
                }));
            }
            Progress::Arrived => self.path = None,
            Progress::Refused(fault) if fault.remedy() == Remedy::GoBack => {
                self.fail(Cause::Tracker(fault));
                return None;
            }
            Progress::Halted | Progress::Refused(_) => {}
        }
        if let Some(halt) = halt {
            self.is_halted = true;
            self.record(EventKind::Halted(halt));
        }
        self.enter(Mode::Holding { ticks: 0 });
        Some(still(&self.certified_m()))
    }

    fn fail(&mut self, cause: Cause<T>) {
        self.abandon();
        self.enter(Mode::Fault(cause));
    }

    /// Whatever was under way is not any more.
    fn abandon(&mut self) {
        self.path = None;
        self.is_halted = false;
        self.is_flushing = true;
    }

    fn enter(&mut self, mode: Mode<T>) {
        self.mode = mode;
        if let Mode::Disarmed | Mode::Fault(_) = self.mode {
            self.brakes.open_ticks = None;
        }
        self.record(EventKind::Entered(self.state()));
    }

    /// Tells the brakes to open; whether they are open.
    fn open_brakes(&mut self) -> bool {
        *self.brakes.open_ticks.get_or_insert(0) >= self.settings.brake_ticks
    }

    fn record(&mut self, kind: EventKind<T>) {
        self.events.push(Event { tick: self.tick, kind });
    }

    fn clock(&self) -> Clock<T> {
        Clock { period_s: self.tracker.settings().period_s, halt_ticks: self.settings.halt_ticks }
    }

    /// Rest lengths of the last certified command, m.
    fn certified_m(&self) -> [T; CABLES] {
        self.tracker.command().cables.map(|cable| cable.rest_length_m)
    }
}

/// The set-point of a platform that stands.
fn resting_at<T: Real>(stance: &Stance<T>) -> Result<SetPoint<T>, Fault<T>> {
    Ok(SetPoint { pose: stance.pose().map_err(Fault::Geometry)?, twist: Twist::none() })
}

fn still<T: Scalar>(rest_lengths_m: &[T; CABLES]) -> [WinchTarget<T>; CABLES] {
    rest_lengths_m.map(|rest_length_m| WinchTarget { rest_length_m, rate_m_s: T::zero() })
}

fn check_switches<T>(readings: &Readings<T>) -> Result<(), Cause<T>> {
    if readings.emergency_stop {
        Err(Cause::EmergencyStop)
    } else if let Some(winch) = readings.failed_winch {
        Err(Cause::WinchFailed(winch))
    } else {
        Ok(())
    }
}

fn check_readings<T: Real>(readings: &Readings<T>) -> Result<(), Cause<T>> {
    check_switches(readings)?;
    match readings.rest_lengths_m.iter().position(|length_m| !length_m.is_finite()) {
        Some(winch) => Err(Cause::NonFiniteReading(winch)),
        None => Ok(()),
    }
}
