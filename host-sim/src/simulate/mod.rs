//! The controller against a physical plant, period by period.
//!
//! ```text
//! trajectory -> operator --(request, way-point)--> controller --(motor angles, speeds, brakes)--> plant
//!                  ^                                  ^  |                                          |
//!                  +------------- decision -----------|--+                                          |
//!                                                     +------(encoders, switches, load cells)-------+
//! ```
//!
//! The controller is the code of core, on the host ([`HostController`]) or as firmware ([`firmware`]), or anything
//! that implements [`Controller`]. [`Simulation::step`] is one period, for a test bench of one's own: see
//! `examples/test_bench.rs`.

pub mod controller;
pub mod firmware;
pub mod log;
pub mod operator;
pub mod plant;
pub mod scenario;
pub mod summary;
pub mod trajectory;
pub mod winch;

pub use controller::{BeginError, Beginning, Controller, HostController};
pub use plant::{Plant, PlantError, Truth, Weather};
pub use scenario::Scenario;
pub use summary::Summary;
pub use trajectory::{Trajectory, TrajectoryError};

use cdpr_core::controller::Stance;
use cdpr_core::{CABLES, Load};
use cdpr_link::{Decision, Inputs, Mode};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand::SeedableRng as _;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::forward::{self, ForwardError};
use crate::robot_file::RobotDescription;
use operator::{Operator, Progress};
use scenario::Fault;
use winch::Ailments;

/// How long is simulated after the platform has come to rest for good, s.
const AFTERWARDS_S: f64 = 1.0;
/// Time allowed for arming and for every way back, s.
const PATIENCE_S: f64 = 30.0;

/// Why a simulation ends before its time.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError<E> {
    /// The plant cannot go on.
    #[error("at {time_s:.3} s: {error}")]
    Plant {
        /// When.
        time_s: f64,
        /// Why.
        error: PlantError,
    },
    /// The platform has no place to rest at the start.
    #[error("at the start: {0}")]
    Rest(#[from] ForwardError),
    /// The controller gives no decision.
    #[error("at {time_s:.3} s: {error}")]
    Controller {
        /// When.
        time_s: f64,
        /// Why.
        error: E,
    },
    /// The controller commands what is no number: it must never.
    #[error("at {0:.3} s: the controller commands what is no number")]
    NotFinite(f64),
}

/// One period: what was, and what the controller made of it.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Since the power was switched on, s.
    pub time_s: f64,
    /// Since the trajectory set out, s.
    pub trajectory_s: Option<f64>,
    /// Where the platform truly is.
    pub place: Stance<f64>,
    /// Where the last certified command holds it.
    pub commanded: Stance<f64>,
    /// Velocity of the centre of mass, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Rest lengths that are paid out, m.
    pub lengths_m: [f64; CABLES],
    /// True tensions at the anchors, N.
    pub tensions_n: [f64; CABLES],
    /// What the controller decided.
    pub decision: Decision<f64>,
}

/// How far the platform is from where it should be, and why.
///
/// With `rest(L)` the pose at which the true platform comes to rest on cables of the lengths `L`:
/// what the controller believes of cables and load is `rest(commanded) - commanded`, what the winches do not follow
/// `rest(paid out) - rest(commanded)`, both together are the static part; what swings is the true pose less
/// `rest(paid out)`. The air is at rest for this.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseError {
    /// All together: distance of the origins, m.
    pub total_m: f64,
    /// All together: angle, rad.
    pub total_rad: f64,
    /// Static part, m.
    pub static_m: f64,
    /// Static part, rad.
    pub static_rad: f64,
    /// Of the static part, what the controller believes, m.
    pub model_m: f64,
    /// Of the static part, what the winches do not follow, m.
    pub winches_m: f64,
    /// Dynamic part, m.
    pub dynamic_m: f64,
    /// Dynamic part, rad.
    pub dynamic_rad: f64,
}

/// A simulation.
#[derive(Debug)]
pub struct Simulation<'a, C> {
    trajectory: &'a Trajectory,
    scenario: &'a Scenario,
    controller: C,
    plant: Plant,
    operator: Operator,
    random: ChaCha8Rng,
    gust_m_s: Vector3<f64>,
    /// Of the platform as the robot file says.
    load: Load<f64>,
    period_s: f64,
    tick: u64,
    last: Decision<f64>,
    /// When the trajectory set out, ticks.
    set_out: Option<u64>,
    has_swung: bool,
    /// The platform has been at rest for good, for so long, s.
    over_s: f64,
    /// Where the platform rests on the lengths commanded and paid out, as far as known: guesses for the next.
    rests: [Stance<f64>; 2],
}

impl<'a, C: Controller> Simulation<'a, C> {
    /// The platform at rest where `beginning` says, but for what `scenario` has to it; brakes closed.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn new(
        robot: &RobotDescription,
        trajectory: &'a Trajectory,
        scenario: &'a Scenario,
        beginning: &Beginning,
        controller: C,
    ) -> Result<Self, SimulationError<C::Error>> {
        let plant_error = |error| SimulationError::Plant { time_s: 0.0, error };
        let load = robot.load;
        let truth = Truth::of(robot, scenario);
        let lengths_m =
            beginning.start.home_lengths_m.map(|length_m| length_m + scenario.winches_off_m);
        let start = beginning.start.stance();
        let rest = forward::at_rest(&truth.robot, &load, &lengths_m, &start)?.place;
        let drums = beginning.start.drums(&robot.drum()).map_err(PlantError::Drum);
        let drums = drums.map_err(plant_error)?;
        let period_s = robot.control.period_s;
        let plant = Plant::new(truth, &robot.winch, &drums, period_s, &rest, &lengths_m)
            .map_err(plant_error)?;
        let motion = plant.motion();
        Ok(Self {
            trajectory,
            scenario,
            controller,
            plant,
            operator: Operator::new(robot.control.way_point_s, period_s, scenario.operator_waits_s),
            random: ChaCha8Rng::seed_from_u64(scenario.seed),
            gust_m_s: Vector3::zeros(),
            load,
            period_s,
            tick: 0,
            last: Decision::disarmed(&beginning.start),
            set_out: None,
            has_swung: false,
            over_s: 0.0,
            rests: [motion.place; 2],
        })
    }

    /// One period; `None` when all is over.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn step(&mut self) -> Result<Option<Sample>, SimulationError<C::Error>> {
        if self.is_over() {
            return Ok(None);
        }
        let time_s = self.tick as f64 * self.period_s;
        let (weather, is_stop_pressed, is_dropout) = self.apply_faults();
        let noise: [i32; CABLES] =
            std::array::from_fn(|_| whole(self.noise(self.scenario.encoder_noise_counts)));
        let measured = self.plant.measure(&noise);
        let tension_noise: [f64; CABLES] =
            std::array::from_fn(|_| self.noise(self.scenario.tension_noise_n));
        let (request, way_point) = self.operator.act(&self.last, self.trajectory, is_dropout);
        let tensions_n = *self.plant.tensions_n();
        let inputs = Inputs {
            angles: measured.angles.map(cdpr_core::winch::MotorAngle::units),
            failed_winch: measured.failed_winch.and_then(|winch| u8::try_from(winch).ok()),
            emergency_stop: is_stop_pressed,
            tensions_n: Some(std::array::from_fn(|i| single(tensions_n[i] + tension_noise[i]))),
            request,
            way_point,
        };
        let decision = self
            .controller
            .tick(&inputs)
            .map_err(|error| SimulationError::Controller { time_s, error })?;
        if !is_finite(&decision) {
            return Err(SimulationError::NotFinite(time_s));
        }
        if decision.mode == Mode::Tracking && self.set_out.is_none() {
            self.set_out = Some(self.tick);
        }
        if decision.brakes_released && !std::mem::replace(&mut self.has_swung, true) {
            self.plant.set_velocity(&self.scenario.swing_m_s);
        }
        let motion = self.plant.motion();
        let [x, y, z] = decision.position_m;
        let [w, i, j, k] = decision.quaternion;
        let sample = Sample {
            time_s,
            trajectory_s: self.trajectory_s(),
            place: motion.place,
            commanded: Stance {
                position_m: Vector3::new(x, y, z),
                orientation: UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)),
            },
            velocity_m_s: motion.velocity_m_s,
            lengths_m: self.plant.lengths_m(),
            tensions_n,
            decision: decision.clone(),
        };
        self.plant
            .step(&decision, &weather)
            .map_err(|error| SimulationError::Plant { time_s, error })?;
        match self.operator.progress(&decision, self.trajectory) {
            Progress::Busy => self.over_s = 0.0,
            Progress::Finished | Progress::GivenUp => self.over_s += self.period_s,
        }
        self.last = decision;
        self.tick += 1;
        Ok(Some(sample))
    }

    fn is_over(&self) -> bool {
        let patience_s = PATIENCE_S * f64::from(1 + self.operator.stops());
        let longest_s = 2.0 * self.trajectory.duration_s() + patience_s;
        self.over_s >= AFTERWARDS_S || self.tick as f64 * self.period_s > longest_s
    }

    /// Whether the platform stands at the end of the trajectory.
    pub fn is_finished(&self) -> bool {
        self.operator.progress(&self.last, self.trajectory) == Progress::Finished
    }

    /// How often the platform was stopped before the end.
    pub fn stops(&self) -> u32 {
        self.operator.stops()
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// How far the platform was in `sample` from where it should be; `None` when the true platform has no stable
    /// place to rest on these lengths nearby. Cost: some 20 us.
    pub fn pose_error(&mut self, sample: &Sample) -> Option<PoseError> {
        let truth = self.plant.truth();
        let load = Load { mass_kg: truth.mass_kg, ..self.load };
        let rest = |lengths_m: &[f64; CABLES], guess: &Stance<f64>| {
            let rest = forward::at_rest(&truth.robot, &load, lengths_m, guess).ok()?;
            rest.is_stable().then_some(rest.place)
        };
        let commanded = rest(&sample.decision.rest_lengths_m, &self.rests[0]);
        let paid_out = rest(&sample.lengths_m, &self.rests[1]);
        let (Some(of_commanded), Some(of_paid_out)) = (commanded, paid_out) else {
            self.rests = [sample.commanded, sample.place]; // to start anew
            return None;
        };
        self.rests = [of_commanded, of_paid_out];
        let apart_m = |a: &Stance<f64>, b: &Stance<f64>| (a.position_m - b.position_m).norm();
        let apart_rad = |a: &Stance<f64>, b: &Stance<f64>| a.orientation.angle_to(&b.orientation);
        Some(PoseError {
            total_m: apart_m(&sample.place, &sample.commanded),
            total_rad: apart_rad(&sample.place, &sample.commanded),
            static_m: apart_m(&of_paid_out, &sample.commanded),
            static_rad: apart_rad(&of_paid_out, &sample.commanded),
            model_m: apart_m(&of_commanded, &sample.commanded),
            winches_m: apart_m(&of_paid_out, &of_commanded),
            dynamic_m: apart_m(&sample.place, &of_paid_out),
            dynamic_rad: apart_rad(&sample.place, &of_paid_out),
        })
    }

    fn trajectory_s(&self) -> Option<f64> {
        self.set_out.map(|set_out| (self.tick - set_out) as f64 * self.period_s)
    }

    /// A random number of this standard deviation; none is drawn for none.
    fn noise(&mut self, deviation: f64) -> f64 {
        if deviation == 0.0 {
            return 0.0;
        }
        let normal: f64 = StandardNormal.sample(&mut self.random);
        deviation * normal
    }

    /// Lets the faults of this period loose: the weather, whether the emergency stop is pressed, and whether no
    /// set-points come.
    fn apply_faults(&mut self) -> (Weather, bool, bool) {
        let scenario = self.scenario;
        let mut ailments = [Ailments::NONE; CABLES];
        let mut mass_kg = self.load.mass_kg;
        let further = &self.load;
        let mut weather = Weather {
            wind_m_s: scenario.wind_m_s,
            force_n: further.force_n,
            moment_nm: further.moment_nm,
        };
        if scenario.gust_m_s > 0.0 {
            // Ornstein and Uhlenbeck's process, exact from period to period.
            let kept = (-self.period_s / scenario.gust_time_s).exp();
            let fresh = scenario.gust_m_s * (1.0 - kept * kept).sqrt();
            let fresh = Vector3::from_fn(|_, _| self.noise(fresh));
            self.gust_m_s = self.gust_m_s * kept + fresh;
            weather.wind_m_s += self.gust_m_s;
        }
        let (mut is_stop_pressed, mut is_dropout) = (false, false);
        let now_s = self.trajectory_s().unwrap_or(-1.0);
        let present =
            scenario.faults.iter().filter(|timed| (timed.from_s..timed.until_s).contains(&now_s));
        for timed in present {
            match timed.fault {
                Fault::WinchStuck(winch) => ailments[winch].is_stuck = true,
                Fault::WinchSlow { winch, speed_m_s } => {
                    ailments[winch].fastest_m_s = Some(speed_m_s);
                }
                Fault::EncoderStuck(winch) => ailments[winch].is_sensor_stuck = true,
                Fault::EncoderParity(winch) => ailments[winch].is_sensor_corrupt = true,
                Fault::Dropout => is_dropout = true,
                Fault::EmergencyStop => is_stop_pressed = true,
                Fault::Payload { mass_kg: other_kg } => mass_kg = other_kg,
                Fault::Push { force_n, moment_nm } => {
                    weather.force_n += force_n;
                    weather.moment_nm += moment_nm;
                }
                Fault::Table { .. } => {} // was done before the start
            }
        }
        for (winch, ailments) in ailments.into_iter().enumerate() {
            *self.plant.ailments_mut(winch) = ailments;
        }
        let truth = self.plant.truth_mut();
        truth.inertia_kg_m2 *= mass_kg / truth.mass_kg;
        truth.mass_kg = mass_kg;
        (weather, is_stop_pressed, is_dropout)
    }
}

/// To the nearest whole number.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn whole(number: f64) -> i32 {
    number.round() as i32
}

/// To the nearest number in single precision.
#[expect(clippy::cast_possible_truncation, reason = "rounds")]
fn single(number: f64) -> f32 {
    number as f32
}

/// Whether all that a winch would be told is a number.
fn is_finite(decision: &Decision<f64>) -> bool {
    decision.motors.iter().flatten().all(|motor| motor.speed_rad_s.is_finite())
        && decision
            .rest_lengths_m
            .iter()
            .chain(&decision.position_m)
            .all(|number| number.is_finite())
}
