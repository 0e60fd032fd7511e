//! What a run comes to.

use cdpr_core::CABLES;
use cdpr_link::Mode;
use serde::Serialize;

use super::{PoseError, Sample};

/// Static pose error of a platform that is where it should be, m.
const EXACT_M: f64 = 1e-3;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// The platform followed the trajectory to its end.
    Tracked,
    /// It did, but was stopped on the way, or a monitor warned, or a way-point was refused, or the static part of
    /// the pose error was above a millimetre: something is not as the controller believes.
    Degraded,
    /// It stands at its last certified pose, on its motors or brakes, before the end.
    Held,
    /// A fault closed the brakes.
    Stopped,
    /// It never set out.
    Waiting,
}

impl Outcome {
    /// Whether the platform got to the end of the trajectory.
    #[must_use]
    pub fn is_at_end(self) -> bool {
        matches!(self, Self::Tracked | Self::Degraded)
    }
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Tracked => "tracked to the end",
            Self::Degraded => "tracked to the end, degraded",
            Self::Held => "held before the end",
            Self::Stopped => "stopped by a fault, brakes closed",
            Self::Waiting => "never set out",
        })
    }
}

/// Largest and root mean square of something.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Largest.
    pub largest: f64,
    /// Root of the mean square.
    pub rms: f64,
    #[serde(skip)]
    squares: f64,
    #[serde(skip)]
    count: u64,
}

impl Spread {
    fn add(&mut self, value: f64) {
        self.largest = self.largest.max(value);
        self.squares += value * value;
        self.count += 1;
        self.rms = (self.squares / self.count as f64).sqrt();
    }
}

/// What a run comes to. Pose errors are those of all looks while the trajectory is under way.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// How it ended.
    pub outcome: Outcome,
    /// Simulated time, s.
    pub simulated_s: f64,
    /// Periods.
    pub ticks: u64,
    /// Periods in each state: disarmed, aligning, holding, tracking, fault.
    pub ticks_in: [u64; 5],
    /// Periods in which the winches were told lengths of a certified command.
    pub certified: u64,
    /// Largest contraction of a certificate; below 0.44 it is one.
    pub largest_contraction: f64,
    /// Least distance to a singularity.
    pub least_distance: f64,
    /// How often the platform was stopped before the end.
    pub stops: u32,
    /// Periods in which a monitor warned.
    pub warnings: u64,
    /// Periods in which a way-point was refused or lost.
    pub refusals: u64,
    /// Pose errors, all together, m.
    pub total_m: Spread,
    /// All together, rad.
    pub total_rad: Spread,
    /// Static part, m.
    pub static_m: Spread,
    /// Of the static part, what the controller believes, m.
    pub model_m: Spread,
    /// Of the static part, what the winches do not follow, m.
    pub winches_m: Spread,
    /// Dynamic part, m.
    pub dynamic_m: Spread,
    /// Looks at which the platform had no stable place to rest nearby.
    pub restless: u64,
    /// Lowest and highest true tension of each cable while tracking, N.
    pub tensions_n: [[f64; 2]; CABLES],
    /// Shortest and longest rest length of each cable while tracking, m.
    pub lengths_m: [[f64; 2]; CABLES],
    /// What happened: time since power-up (s) and words.
    pub events: Vec<(f64, String)>,
    #[serde(skip)]
    last_mode: Mode,
    #[serde(skip)]
    period_s: f64,
}

impl Summary {
    /// Of nothing yet, with periods of `period_s`.
    #[must_use]
    pub fn new(period_s: f64) -> Self {
        let nothing = [[f64::INFINITY, f64::NEG_INFINITY]; CABLES];
        let none = Spread::default();
        Self {
            outcome: Outcome::Waiting,
            simulated_s: 0.0,
            ticks: 0,
            ticks_in: [0; 5],
            certified: 0,
            largest_contraction: 0.0,
            least_distance: f64::INFINITY,
            stops: 0,
            warnings: 0,
            refusals: 0,
            total_m: none,
            total_rad: none,
            static_m: none,
            model_m: none,
            winches_m: none,
            dynamic_m: none,
            restless: 0,
            tensions_n: nothing,
            lengths_m: nothing,
            events: Vec::new(),
            last_mode: Mode::Disarmed,
            period_s,
        }
    }

    /// Adds a period.
    pub fn add(&mut self, sample: &Sample) {
        let decision = &sample.decision;
        self.ticks += 1;
        self.simulated_s = self.ticks as f64 * self.period_s;
        self.ticks_in[decision.mode as usize] += 1;
        self.last_mode = decision.mode;
        self.warnings += u64::from(decision.is_warning);
        self.refusals += u64::from(decision.is_refusal);
        if !decision.note.is_empty() {
            self.events.push((sample.time_s, decision.note.to_string()));
        }
        if matches!(decision.mode, Mode::Holding | Mode::Tracking) && decision.motors.is_some() {
            self.certified += 1;
        }
        if decision.mode == Mode::Tracking {
            self.largest_contraction = self.largest_contraction.max(decision.contraction);
            self.least_distance = self.least_distance.min(decision.distance);
            for i in 0..CABLES {
                widen(&mut self.tensions_n[i], sample.tensions_n[i]);
                widen(&mut self.lengths_m[i], sample.lengths_m[i]);
            }
        }
    }

    /// Adds a look at the pose; `None`: there was no stable place to rest.
    pub fn look(&mut self, sample: &Sample, error: Option<&PoseError>) {
        if sample.trajectory_s.is_none() {
            return;
        }
        let Some(error) = error else {
            self.restless += 1;
            return;
        };
        self.total_m.add(error.total_m);
        self.total_rad.add(error.total_rad);
        self.static_m.add(error.static_m);
        self.model_m.add(error.model_m);
        self.winches_m.add(error.winches_m);
        self.dynamic_m.add(error.dynamic_m);
    }

    /// Says how it ended.
    pub fn close(&mut self, is_finished: bool, stops: u32) {
        self.stops = stops;
        let is_exact = self.restless == 0 && self.static_m.largest <= EXACT_M;
        let is_clean = stops == 0 && self.warnings == 0 && self.refusals == 0 && is_exact;
        self.outcome = match self.last_mode {
            _ if is_finished && is_clean => Outcome::Tracked,
            _ if is_finished => Outcome::Degraded,
            Mode::Fault => Outcome::Stopped,
            _ if self.ticks_in[Mode::Tracking as usize] == 0 => Outcome::Waiting,
            Mode::Disarmed => Outcome::Stopped,
            _ => Outcome::Held,
        };
    }
}

fn widen([low, high]: &mut [f64; 2], value: f64) {
    *low = low.min(value);
    *high = high.max(value);
}
