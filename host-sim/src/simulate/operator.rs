//! Who arms the controller, sends the way-points of a trajectory, and knows what to do after a fault.

use cdpr_link::{Decision, Mode, Pace, Request, Target};

use super::trajectory::Trajectory;

/// The operator acts once in so many periods.
const LOOK_TICKS: u32 = 100;
/// From a stand to the pace of the trajectory, s.
const RAMP_S: f64 = 1.0;
/// The way back onto the trajectory is gone at this share of what the limits allow.
const SHARE_BACK: f64 = 0.5;

/// The trajectory's own time, as far as way-points have been sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Of the last way-point, s.
    pub time_s: f64,
    /// How fast it goes there: 1 as planned, 0 at a stand.
    pub rate: f64,
}

impl Clock {
    /// At the beginning.
    pub const START: Self = Self { time_s: 0.0, rate: 1.0 };

    /// The next way-point, `step_s` later or, where the pace rises, a little more of it; `None` at the end.
    pub fn next(&mut self, trajectory: &Trajectory, step_s: f64) -> Option<Target> {
        let left_s = trajectory.duration_s() - self.time_s;
        if left_s <= 0.0 {
            return None;
        }
        let rate = (self.rate + step_s / RAMP_S).min(1.0);
        let mean = 0.5 * (self.rate + rate);
        // A last piece shorter than half a step is added to the one before.
        let is_last = left_s <= 1.5 * step_s * mean;
        let duration_s = if is_last { left_s / mean } else { step_s };
        self.time_s = if is_last { trajectory.duration_s() } else { self.time_s + step_s * mean };
        self.rate = rate;
        Some(trajectory.target(self.time_s, rate, duration_s))
    }
}

/// How far an operator has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is something to be done.
    Busy,
    /// The platform stands at the end of the trajectory.
    Finished,
    /// It does not go on, and stands before the end.
    GivenUp,
}

/// An operator with a trajectory.
#[derive(Clone, Debug)]
pub struct Operator {
    step_s: f64,
    period_s: f64,
    /// How long he waits after a fault or a halt; `None`: for ever.
    waits_s: Option<f64>,
    clock: Clock,
    last_mode: Mode,
    /// Sent out at a stand off the trajectory.
    is_off: bool,
    must_recover: bool,
    /// Something stopped the platform, s ago.
    stopped_s: Option<f64>,
    ticks: u32,
    /// Times that it was stopped before the end.
    stops: u32,
}

impl Operator {
    /// Before the controller is armed.
    #[must_use]
    pub fn new(step_s: f64, period_s: f64, waits_s: Option<f64>) -> Self {
        Self {
            step_s,
            period_s,
            waits_s,
            clock: Clock::START,
            last_mode: Mode::Disarmed,
            is_off: false,
            must_recover: false,
            stopped_s: None,
            ticks: 0,
            stops: 0,
        }
    }

    /// How often the platform was stopped before the end.
    #[must_use]
    pub fn stops(&self) -> u32 {
        self.stops
    }

    /// What is asked of the controller in the next period, given what it decided in the last one.
    pub fn act(
        &mut self,
        last: &Decision<f64>,
        trajectory: &Trajectory,
        is_dropout: bool,
    ) -> (Option<Request>, Option<Target>) {
        self.ticks += 1;
        self.look(last, trajectory);
        let waited = match (self.stopped_s, self.waits_s) {
            (None, _) => true,
            (Some(stopped_s), Some(waits_s)) => stopped_s >= waits_s,
            (Some(_), None) => false,
        };
        let mut request = None;
        match last.mode {
            Mode::Fault if waited => request = Some(Request::Acknowledge),
            Mode::Disarmed if !waited => {}
            Mode::Disarmed if self.must_recover => request = Some(Request::Recover),
            Mode::Disarmed => request = Some(Request::Arm),
            // What is left of the motion is given up: the way back begins where the platform stands.
            Mode::Holding if last.is_halted && waited => request = Some(Request::Cancel),
            Mode::Holding | Mode::Tracking
                if !last.is_halted && waited && last.waiting == 0 && !is_dropout =>
            {
                if self.is_off && !self.ticks.is_multiple_of(LOOK_TICKS) {
                    return (None, None); // what was sent before is still being dropped
                }
                self.stopped_s = None;
                return (None, self.next(trajectory));
            }
            _ => {}
        }
        let request = request.filter(|_| self.ticks.is_multiple_of(LOOK_TICKS));
        self.must_recover &= request != Some(Request::Recover);
        (request, None)
    }

    /// Notices what has changed.
    fn look(&mut self, last: &Decision<f64>, trajectory: &Trajectory) {
        if let Some(stopped_s) = &mut self.stopped_s {
            *stopped_s += self.period_s;
        }
        let came_to_rest = self.last_mode == Mode::Tracking && last.mode == Mode::Holding;
        let is_refused = last.mode == Mode::Holding && last.is_refusal;
        let (is_fault, was_fault) = (last.mode == Mode::Fault, self.last_mode == Mode::Fault);
        self.must_recover |= is_fault;
        // What was sent is lost, or came too late: the platform ran out.
        let is_lost = is_fault && !was_fault
            || came_to_rest && (last.is_halted || !self.is_there(last, trajectory))
            || is_refused;
        if is_lost {
            self.is_off = true;
            self.stops += 1;
            self.stopped_s = Some(0.0);
        }
        self.last_mode = last.mode;
    }

    /// Whether the platform is commanded to be where the last way-point was to bring it.
    fn is_there(&self, decision: &Decision<f64>, trajectory: &Trajectory) -> bool {
        const NEAR_M: f64 = 1e-4; // far above rounding in single precision
        let wanted_m = trajectory.at(self.clock.time_s).stance.position_m;
        (nalgebra::Vector3::from(decision.position_m) - wanted_m).norm() < NEAR_M
    }

    fn next(&mut self, trajectory: &Trajectory) -> Option<Target> {
        if !self.is_off {
            return self.clock.next(trajectory, self.step_s);
        }
        self.is_off = false;
        self.clock.rate = 0.0;
        Some(Target {
            pace: Pace::Share(SHARE_BACK),
            ..trajectory.target(self.clock.time_s, 0.0, 1.0)
        })
    }

    /// How far he has come, given what the controller decided in this period.
    #[must_use]
    pub fn progress(&self, now: &Decision<f64>, trajectory: &Trajectory) -> Progress {
        let is_at_end = self.clock.time_s >= trajectory.duration_s() && !self.is_off;
        let rests = now.mode == Mode::Holding && self.last_mode == Mode::Holding && !now.is_halted;
        if is_at_end && rests && now.waiting == 0 && self.is_there(now, trajectory) {
            return Progress::Finished;
        }
        let stands = matches!(now.mode, Mode::Holding | Mode::Fault | Mode::Disarmed);
        let is_left = self.stopped_s.is_some() && self.waits_s.is_none();
        if stands && is_left { Progress::GivenUp } else { Progress::Busy }
    }
}
