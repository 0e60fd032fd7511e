//! What the controller does at a tick, whatever the board.

use cdpr_core::controller::{
    Controller, Event, EventKind, Outputs, Queue, Readings, Refusal, StartFault, State, WayPoint,
    WinchTarget,
};
use cdpr_core::winch::{Drum, DrumFault, MotorAngle};
use cdpr_core::{CABLES, Fault, Table, Tracker};
use cdpr_link::station::WAY_PARTS;
use heapless::spsc::Consumer;

use crate::Number;
use crate::path::{Course, Path};
use crate::rehearsal::Inputs;
use crate::robot::{self, Model};

/// The controller, with the last eight events.
pub type Crane<T> = Controller<T, Model<T>, 8>;

/// Way-points on their way to it: room for eight.
pub type WayPoints<T> = Queue<T, 9>;

/// What an operator may want.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// [`Controller::arm`].
    Arm,
    /// [`Controller::acknowledge`].
    Acknowledge,
    /// [`Controller::restart_from`] the warm-start table, where the platform stands.
    Recover,
}

/// What has come of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome<T> {
    /// What the winches were told.
    pub outputs: Outputs<T>,
    /// Why the operator does not get what he wants.
    pub refusal: Option<Refusal<T>>,
}

/// A controller between its way-points and its winches.
pub struct Control<'q, T: Number> {
    controller: Crane<T>,
    table: Table<'static>,
    way_points: Consumer<'q, WayPoint<T>>,
    winches: Winches<T>,
}

impl<'q, T: Number> Control<'q, T> {
    /// Ties them together.
    #[must_use]
    pub fn new(
        controller: Crane<T>,
        table: Table<'static>,
        way_points: Consumer<'q, WayPoint<T>>,
        winches: Winches<T>,
    ) -> Self {
        Self { controller, table, way_points, winches }
    }

    /// One tick: from the angles of the motors to their commands.
    #[inline]
    pub fn tick(&mut self, inputs: &Inputs) -> Outcome<T> {
        let Self { controller, table, way_points, winches } = self;
        let readings = winches.readings(inputs.is_stop_pressed);
        let granted = request(controller, table, inputs.request, &readings);
        let outputs = controller.tick(&readings, || way_points.dequeue());
        winches.follow(&outputs);
        Outcome { outputs, refusal: granted.err() }
    }

    /// What the controller does.
    pub fn state(&self) -> State<T> {
        self.controller.state()
    }

    /// The controller.
    pub fn controller(&self) -> &Crane<T> {
        &self.controller
    }

    /// Takes the oldest event.
    pub fn take_event(&mut self) -> Option<Event<T>> {
        self.controller.events_mut().take()
    }
}

/// Six winches whose motors are where they were told to be: a stand-in for the drives and encoders of
/// [`cdpr_core::winch`].
#[derive(Clone, Copy, Debug)]
pub struct Winches<T> {
    drums: [Drum<T>; CABLES],
    motors: [Motor<T>; CABLES],
    failed: Option<usize>,
}

/// What a motor was told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor<T> {
    /// Where it should be.
    pub angle: MotorAngle,
    /// How fast it should turn, rad/s.
    pub speed_rad_s: T,
}

impl<T: Number> Winches<T> {
    /// At the start of `course`, but for some millimetres, as after a night without power.
    ///
    /// # Errors
    /// [`DrumFault`], were the constants of [`robot`] wrong.
    pub fn start(course: &Course) -> Result<Self, DrumFault> {
        let home = MotorAngle::ZERO;
        let (lengths_m, off_m) =
            (robot::start_lengths_m::<T>(&course.payload), T::constant(robot::OFF_AT_START_M));
        let still = Motor { angle: home, speed_rad_s: T::zero() };
        let mut winches = Self {
            drums: [Drum::new(&robot::DRUM, lengths_m[0], home)?; CABLES],
            motors: [still; CABLES],
            failed: None,
        };
        for (i, drum) in winches.drums.iter_mut().enumerate() {
            drum.set_home(lengths_m[i], home)?;
            winches.motors[i].angle = drum.motor_angle(lengths_m[i] + off_m)?;
        }
        Ok(winches)
    }

    /// What they report, with the state of the emergency stop.
    #[must_use]
    pub fn readings(&self, emergency_stop: bool) -> Readings<T> {
        // An angle that is no length is for the controller to see.
        let length_m = |i: usize| self.drums[i].rest_length_m(self.motors[i].angle);
        Readings {
            rest_lengths_m: core::array::from_fn(|i| {
                length_m(i).unwrap_or_else(|_| T::constant(f64::NAN))
            }),
            failed_winch: self.failed,
            emergency_stop,
        }
    }

    /// Does what the controller wants; nothing wanted, the motors stand where they are.
    pub fn follow(&mut self, outputs: &Outputs<T>) {
        match &outputs.targets {
            Some(targets) => self.command(targets.iter().copied()),
            None => self.motors.iter_mut().for_each(|motor| motor.speed_rad_s = T::zero()),
        }
    }

    /// From rest lengths to motors. A winch that cannot is a failed one from now on.
    #[inline]
    pub fn command(&mut self, targets: impl Iterator<Item = WinchTarget<T>>) {
        for (i, (target, drum)) in targets.zip(&self.drums).enumerate() {
            match drum.motor_angle(target.rest_length_m) {
                Ok(angle) => {
                    let speed_rad_s = drum.motor_speed_rad_s(target.rate_m_s);
                    self.motors[i] = Motor { angle, speed_rad_s };
                }
                Err(_) => self.failed = Some(i),
            }
        }
    }

    /// What the motors were told.
    pub fn motors(&self) -> &[Motor<T>; CABLES] {
        &self.motors
    }
}

/// What has come of all ticks so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary<T> {
    /// Ticks.
    pub ticks: u32,
    /// Those with the rest lengths of a certified command, moving or at rest.
    pub certified: u32,
    /// States entered.
    pub states: u32,
    /// Those that were faults.
    pub faults: u32,
    /// Events, of every kind.
    pub events: u32,
    /// Largest distance between the end of a cable and its attachment, m.
    pub largest_closure_m: T,
    /// Of the bits of all rest lengths, motor angles and motor speeds commanded.
    pub checksum: Checksum,
}

impl<T: Number> Summary<T> {
    /// Of no ticks.
    #[must_use]
    pub fn new() -> Self {
        Self {
            ticks: 0,
            certified: 0,
            states: 0,
            faults: 0,
            events: 0,
            largest_closure_m: T::zero(),
            checksum: Checksum::EMPTY,
        }
    }

    /// Adds a tick.
    pub fn add_tick(&mut self, control: &Control<'_, T>, outputs: &Outputs<T>) {
        self.ticks += 1;
        let command = control.controller().tracker().command();
        self.largest_closure_m = self.largest_closure_m.max(command.closure_m);
        let Some(targets) = &outputs.targets else { return };
        let mut pairs = targets.iter().zip(&command.cables);
        let is_certified =
            pairs.all(|(target, cable)| target.rest_length_m.bits() == cable.rest_length_m.bits());
        self.certified += u32::from(is_certified);
        for (target, motor) in targets.iter().zip(control.winches.motors()) {
            self.checksum.add(target.rest_length_m.bits());
            self.checksum.add(motor.angle.units().cast_unsigned());
            self.checksum.add(motor.speed_rad_s.bits());
        }
    }

    /// Adds an event.
    pub fn add_event(&mut self, event: &Event<T>) {
        self.events += 1;
        if let EventKind::Entered(state) = event.kind {
            self.states += 1;
            self.faults += u32::from(matches!(state, State::Fault(_)));
        }
    }
}

impl<T: Number> Default for Summary<T> {
    fn default() -> Self {
        Self::new()
    }
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

/// Asks the controller for what the operator wants.
///
/// # Errors
/// [`Refusal`].
pub fn request<T: Number>(
    controller: &mut Crane<T>,
    table: &Table<'_>,
    request: Option<Request>,
    readings: &Readings<T>,
) -> Result<(), Refusal<T>> {
    match request {
        Some(Request::Arm) => controller.arm(readings),
        Some(Request::Acknowledge) => controller.acknowledge(readings),
        Some(Request::Recover) => controller.restart_from(*controller.stance(), table, WAY_PARTS),
        None => Ok(()),
    }
}

/// The controller at the start of `course`, disarmed, on the sheet of a warm-start table.
///
/// # Errors
/// [`StartFault`] of the constants of [`robot`], or when the table is for another payload.
pub fn start_controller<T: Number>(
    course: &Course,
    table: &Table<'_>,
) -> Result<Crane<T>, StartFault<T>> {
    let geometry = |fault| StartFault::Tracker(Fault::Geometry(fault));
    Controller::start_from(
        robot::crane().map_err(geometry)?,
        robot::load(&course.payload),
        robot::settings(),
        robot::controller_settings(),
        Path::new(*course).target().stance,
        table,
        WAY_PARTS,
    )
}

/// The tracker alone, at the start of `course`, from the states that are written there.
///
/// # Errors
/// [`Fault`] of the constants of [`robot`].
pub fn start_tracker<T: Number>(course: Course) -> Result<Tracker<T, Model<T>>, Fault<T>> {
    let robot = robot::crane().map_err(Fault::Geometry)?;
    let set_point = Path::new(course).target().set_point().map_err(Fault::Geometry)?;
    let (load, states) = (robot::load(&course.payload), robot::start_states(&course.payload));
    Tracker::start(robot, load, robot::settings(), &set_point, &states)
}
