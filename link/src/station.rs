//! The controller with what surrounds it in a winch cabinet.

use core::fmt::Write as _;

use cdpr_core::controller::monitor::{MonitorThresholds, TensionMonitor, Warning};
use cdpr_core::controller::{
    self, Controller, ControllerSettings, EventKind, Outputs, Readings, Refusal, Stance,
    StartFault, WayPoint,
};
use cdpr_core::winch::{Countable, Drum, DrumDesign, DrumFault, MotorAngle};
use cdpr_core::{CABLES, CableState, Charted, Load, Robot, ShapedCable, Table, TrackerSettings};
use heapless::Deque;

use crate::messages::{Decision, Inputs, Mode, Motor, Note, Request, Start};

/// Parts of the way to a pose that a warm-start table does not cover, from the nearest one that it covers. A way takes as many
/// ticks' worth at once: a recovery, with the brakes closed, may last that long.
pub const WAY_PARTS: u16 = 256;
/// Events that may happen in a period.
const EVENTS: usize = 8;

/// Way-points that may wait.
const WAITING: usize = 8;

/// Periods over which tensions are watched.
const WINDOW: usize = 64;

/// What a station is built for.
#[derive(Clone, Copy, Debug)]
pub struct Blueprint<T: Countable, M> {
    /// The robot, with the cables that the controller believes in.
    pub robot: Robot<T, M>,
    /// What it believes to carry.
    pub load: Load<T>,
    /// Rate and limits.
    pub tracker: TrackerSettings<T>,
    /// Motions and winches.
    pub controller: ControllerSettings<T>,
    /// The drums.
    pub drum: DrumDesign,
    /// When the monitor warns.
    pub monitor: MonitorThresholds,
}

/// Why a station does not start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StationFault<T> {
    /// The controller does not.
    Controller(StartFault<T>),
    /// A drum cannot be.
    Drum(DrumFault),
}

impl<T: core::fmt::Display> core::fmt::Display for StationFault<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Controller(fault) => fault.fmt(f),
            Self::Drum(fault) => fault.fmt(f),
        }
    }
}

impl<T: core::fmt::Debug + core::fmt::Display> core::error::Error for StationFault<T> {}

/// A controller with drums, a queue of way-points, a monitor of tensions and, maybe, a warm-start table.
#[derive(Clone, Debug)]
pub struct Station<'t, T: Countable, M> {
    controller: Controller<T, M, EVENTS>,
    table: Option<Table<'t>>,
    drums: [Drum<T>; CABLES],
    way_points: Deque<WayPoint<T>, WAITING>,
    monitor: TensionMonitor<WINDOW>,
    /// A winch that was told to go where no angle is.
    failed: Option<usize>,
}

impl<'t, T: Countable + core::fmt::Display, M: ShapedCable<T> + Charted<T>> Station<'t, T, M> {
    /// Disarmed, at `start`, on the sheet of `table`.
    ///
    /// # Errors
    /// [`StationFault`].
    pub fn from_table(
        blueprint: Blueprint<T, M>,
        start: &Start,
        table: Table<'t>,
    ) -> Result<Self, StationFault<T>> {
        let Blueprint { robot, load, tracker, controller, drum, monitor } = blueprint;
        let controller = Controller::start_from(
            robot,
            load,
            tracker,
            controller,
            start.stance(),
            &table,
            WAY_PARTS,
        )
        .map_err(StationFault::Controller)?;
        Self::around(controller, Some(table), &drum, start, monitor)
    }

    /// Disarmed, at `start` with `states`, and without a table to recover from.
    ///
    /// # Errors
    /// [`StationFault`].
    pub fn from_states(
        blueprint: Blueprint<T, M>,
        start: &Start,
        states: &[CableState<T>; CABLES],
    ) -> Result<Self, StationFault<T>> {
        let Blueprint { robot, load, tracker, controller, drum, monitor } = blueprint;
        let controller =
            Controller::start(robot, load, tracker, controller, start.stance(), states)
                .map_err(StationFault::Controller)?;
        Self::around(controller, None, &drum, start, monitor)
    }

    fn around(
        controller: Controller<T, M, EVENTS>,
        table: Option<Table<'t>>,
        drum: &DrumDesign,
        start: &Start,
        monitor: MonitorThresholds,
    ) -> Result<Self, StationFault<T>> {
        Ok(Self {
            controller,
            table,
            drums: start.drums(drum).map_err(StationFault::Drum)?,
            way_points: Deque::new(),
            monitor: TensionMonitor::new(monitor),
            failed: None,
        })
    }

    /// The controller.
    pub fn controller(&self) -> &Controller<T, M, EVENTS> {
        &self.controller
    }

    /// One period: from what is measured to what the motors are to do.
    ///
    /// Cost: that of [`Controller::tick`] or, for [`Request::Recover`], of [`Controller::restart_from`] as well.
    pub fn tick(&mut self, inputs: &Inputs) -> Decision<T> {
        let mut note = Note::new();
        let readings = self.readings(inputs);
        let mut is_refusal = false;
        if let Some(target) = &inputs.way_point
            && self.way_points.push_back(target.way_point()).is_err()
        {
            is_refusal = true;
            tell(&mut note, format_args!("way-point lost: the queue is full"));
        }
        if let Some(Err(refusal)) = inputs.request.map(|request| self.grant(request, &readings)) {
            tell(&mut note, format_args!("request refused: {refusal}"));
        }
        let Self { controller, way_points, .. } = self;
        let outputs = controller.tick(&readings, || way_points.pop_front());
        let motors = self.motors(&outputs);
        let is_warning = self.watch(inputs);
        while let Some(event) = self.controller.events_mut().take() {
            match event.kind {
                EventKind::Entered(state) => tell(&mut note, format_args!("{state}")),
                EventKind::Refused(fault) => {
                    is_refusal = true;
                    tell(&mut note, format_args!("way-point refused: {fault}"));
                }
                EventKind::Halted(controller::Halt::Asked) => {
                    tell(&mut note, format_args!("halted as asked"));
                }
                EventKind::Halted(controller::Halt::Fault(fault)) => {
                    tell(&mut note, format_args!("halted: {fault}"));
                }
                EventKind::Warning(Warning::LoadSwings { deviation_n }) => {
                    tell(&mut note, format_args!("the load swings: {deviation_n} N"));
                }
                EventKind::Warning(Warning::TensionsSpread { deviation_n }) => {
                    tell(
                        &mut note,
                        format_args!("the load is not shared as commanded: {deviation_n} N"),
                    );
                }
                _ => tell(&mut note, format_args!("an event that this station does not know")),
            }
        }
        Decision { is_warning, is_refusal, note, ..self.decision(motors, outputs.brakes_released) }
    }

    fn readings(&self, inputs: &Inputs) -> Readings<T> {
        Readings {
            rest_lengths_m: core::array::from_fn(|i| {
                let angle = MotorAngle::from_units(inputs.angles[i]);
                // An angle that is no length is for the controller to see.
                self.drums[i].rest_length_m(angle).unwrap_or_else(|_| T::constant(f64::NAN))
            }),
            failed_winch: inputs.failed_winch.map(usize::from).or(self.failed),
            emergency_stop: inputs.emergency_stop,
        }
    }

    fn grant(&mut self, request: Request, readings: &Readings<T>) -> Result<(), Refusal<T>> {
        let controller = &mut self.controller;
        match request {
            Request::Arm => controller.arm(readings),
            Request::Disarm => controller.disarm(),
            Request::Stop => controller.stop(),
            Request::Resume => controller.resume(),
            Request::Cancel => controller.cancel(),
            Request::Acknowledge => controller.acknowledge(readings),
            Request::Recover => match &self.table {
                Some(table) => controller.restart_from(*controller.stance(), table, WAY_PARTS),
                // What the last command was is still certified: arming goes back there.
                None => Ok(()),
            },
        }
    }

    fn motors(&mut self, outputs: &Outputs<T>) -> Option<[Motor<T>; CABLES]> {
        let targets = outputs.targets.as_ref()?;
        let mut motors = [Motor { angle: 0, speed_rad_s: T::zero() }; CABLES];
        for (i, (motor, target)) in motors.iter_mut().zip(targets).enumerate() {
            let Ok(angle) = self.drums[i].motor_angle(target.rest_length_m) else {
                self.failed = Some(i); // a fault from the next period on
                return None;
            };
            let speed_rad_s = self.drums[i].motor_speed_rad_s(target.rate_m_s);
            *motor = Motor { angle: angle.units(), speed_rad_s };
        }
        Some(motors)
    }

    /// Watches the tensions while the platform hangs on the motors; whether that gave a warning.
    fn watch(&mut self, inputs: &Inputs) -> bool {
        let mode = Mode::from(&self.controller.state());
        let Some(tensions_n) =
            inputs.tensions_n.filter(|_| matches!(mode, Mode::Holding | Mode::Tracking))
        else {
            return false;
        };
        let commanded = self.controller.tracker().command().cables;
        let commanded_n =
            commanded.map(|cable| cable.anchor_tension_n.to_f32().unwrap_or(f32::NAN));
        let warnings = self.monitor.update(&tensions_n.map(Some), &commanded_n);
        for warning in warnings.iter().flatten() {
            self.controller.warn(*warning);
        }
        warnings.iter().any(Option::is_some)
    }

    fn decision(&self, motors: Option<[Motor<T>; CABLES]>, brakes_released: bool) -> Decision<T> {
        let command = self.controller.tracker().command();
        let Stance { position_m, orientation } = *self.controller.stance();
        let q = orientation.as_ref().coords;
        Decision {
            motors,
            brakes_released,
            mode: Mode::from(&self.controller.state()),
            is_halted: self.controller.is_halted(),
            waiting: u8::try_from(self.way_points.len()).unwrap_or(u8::MAX),
            is_warning: false,
            is_refusal: false,
            position_m: position_m.into(),
            quaternion: [q.w, q.x, q.y, q.z],
            rest_lengths_m: command.cables.map(|cable| cable.rest_length_m),
            tensions_n: command.cables.map(|cable| cable.anchor_tension_n),
            contraction: command.certificate.contraction,
            distance: command.distance,
            note: Note::new(),
        }
    }
}

/// Adds to `note` what there is room for.
fn tell(note: &mut Note, what: core::fmt::Arguments<'_>) {
    struct Rest<'a>(&'a mut Note);
    impl core::fmt::Write for Rest<'_> {
        fn write_str(&mut self, text: &str) -> core::fmt::Result {
            text.chars().try_for_each(|c| self.0.push(c)).map_err(|_| core::fmt::Error)
        }
    }
    let separator = if note.is_empty() { "" } else { "; " };
    let _ = write!(Rest(note), "{separator}{what}"); // cut off
}
