//! The physical model: a rigid platform on six cables between six winches.
//!
//! | state | | |
//! |---|---|---|
//! | platform | position and velocity of the centre of mass, orientation, angular velocity in its own axes | Newton and Euler |
//! | winch | rest length, its rate, integral of the speed loop | [`winch`](super::winch) |
//!
//! A cable has no inertia: its force follows from where its ends are and what is paid out
//! ([`CableModel::force_at_length`]), and lags behind by `tau dF/dt` (Kelvin-Voigt; the derivative with the
//! stiffness in its plane and, across it, of a pendulum), which takes energy out of every motion. The air takes
//! `rho/2 A_d |u| u` with `u` the velocity of the wind past the platform.
//!
//! Steel cables make modes of 5 to 50 Hz, far below the rate of an explicit method with a step of a millisecond:
//! Dormand and Prince's method of order 5 with error control, from `ode_solvers`, one period of the controller at a
//! time, as inputs jump between periods.

use cdpr_core::controller::Stance;
use cdpr_core::winch::{Drum, DrumFault, MotorAngle};
use cdpr_core::{CABLES, CableModel, IrvineCatenary, LineFault, Robot};
use cdpr_link::Decision;
use nalgebra::{Matrix2, Quaternion, UnitQuaternion, Vector2, Vector3};
use ode_solvers::{Dopri5, OutputType, SVector, System};
use std::cell::Cell;

use super::scenario::Scenario;
use super::winch::{Ailments, Drive, Mechanics, Winch};
use crate::problem::FromMaterial as _;
use crate::robot_file::{Body, CableMaterial, RobotDescription, WinchDesign};

/// Density of air, kg/m^3.
const AIR_KG_M3: f64 = 1.2;
/// Error allowed in a step: m, rad and their rates, 1e-3 of what a tick of the controller moves.
const TOLERANCE: f64 = 1e-7;
/// Steps in a period at most.
const STEPS: u32 = 1000;

/// Numbers of the state: 13 of the platform, three of each winch.
const STATE: usize = 13 + 3 * CABLES;
type State = SVector<f64, STATE>;

/// What the platform and its cables truly are.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// Geometry and cables.
    pub robot: Robot<f64, IrvineCatenary<f64>>,
    /// Mass of platform and payload, kg.
    pub mass_kg: f64,
    /// Centre of mass, platform frame, m.
    pub center_of_mass_m: Vector3<f64>,
    /// Principal moments of inertia along the platform axes, kg m^2.
    pub inertia_kg_m2: Vector3<f64>,
    /// Gravity, m/s^2.
    pub gravity_m_s2: f64,
    /// Air and damping.
    pub body: Body,
}

impl Truth {
    /// What `robot` describes, but for what is wrong with it in `scenario`.
    #[must_use]
    pub fn of(robot: &RobotDescription, scenario: &Scenario) -> Self {
        let RobotDescription { load, body, .. } = robot;
        let model = |material: &CableMaterial| {
            let material = CableMaterial {
                linear_density_kg_m: material.linear_density_kg_m * scenario.linear_density_factor,
                axial_stiffness_n: material.axial_stiffness_n * scenario.axial_stiffness_factor,
            };
            IrvineCatenary::from_material(&material, load.gravity_m_s2)
        };
        Self {
            robot: robot.robot.map_models(|_, material| model(material)),
            mass_kg: load.mass_kg,
            center_of_mass_m: load.center_of_mass_m,
            inertia_kg_m2: Vector3::new(
                body.inertia_x_kg_m2,
                body.inertia_y_kg_m2,
                body.inertia_z_kg_m2,
            ),
            gravity_m_s2: load.gravity_m_s2,
            body: *body,
        }
    }
}

/// What acts on the platform from outside during a period, besides gravity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weather {
    /// Velocity of the wind, world frame, m/s.
    pub wind_m_s: Vector3<f64>,
    /// Force at the platform origin, world axes, N.
    pub force_n: Vector3<f64>,
    /// Moment, world axes, N m.
    pub moment_nm: Vector3<f64>,
}

/// How the platform moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Where its origin is.
    pub place: Stance<f64>,
    /// Velocity of the centre of mass, world axes, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Angular velocity, platform axes, rad/s.
    pub angular_rad_s: Vector3<f64>,
}

/// Why the plant cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// A cable has no force: it tears, or its ends lie on each other.
    #[error("cable {}: {fault}", .cable + 1)]
    Cable {
        /// The cable, counted from 0.
        cable: usize,
        /// Why.
        fault: LineFault,
    },
    /// No step is short enough.
    #[error("the motion is too fast to be followed in steps of {} us", 1e6 * .period_s / f64::from(STEPS))]
    TooFast {
        /// The period of the controller, s.
        period_s: f64,
    },
    /// A drum cannot be.
    #[error("winch: {0}")]
    Drum(DrumFault),
}

/// What the sensors show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Motor angles.
    pub angles: [MotorAngle; CABLES],
    /// The first winch that is not well, counted from 0.
    pub failed_winch: Option<usize>,
}

/// The plant.
#[derive(Debug)]
pub struct Plant {
    truth: Truth,
    mechanics: Mechanics,
    winches: [Winch; CABLES],
    period_s: f64,
    state: State,
    /// At the end of the last period, N.
    tensions_n: [f64; CABLES],
    /// Steps that the last period took.
    steps: u32,
}

impl Plant {
    /// At rest at `place` with `lengths_m` paid out, brakes closed; the motors stand as `drums` say.
    ///
    /// # Errors
    /// [`PlantError`].
    pub fn new(
        truth: Truth,
        design: &WinchDesign,
        drums: &[Drum<f64>; CABLES],
        period_s: f64,
        place: &Stance<f64>,
        lengths_m: &[f64; CABLES],
    ) -> Result<Self, PlantError> {
        let winch = |i: usize| {
            Winch::new(design, period_s, drums[i], lengths_m[i]).map_err(PlantError::Drum)
        };
        let mut state = State::zeros();
        let center_m = place.position_m + place.orientation * truth.center_of_mass_m;
        put(&mut state, 0, center_m.as_slice());
        let q = place.orientation.as_ref();
        put(&mut state, 6, &[q.w, q.i, q.j, q.k]);
        for (i, length_m) in lengths_m.iter().enumerate() {
            state[13 + 3 * i] = *length_m;
        }
        let mut plant = Self {
            truth,
            mechanics: Mechanics::new(design, drums[0].motor_speed_rad_s(1.0)),
            winches: [winch(0)?, winch(1)?, winch(2)?, winch(3)?, winch(4)?, winch(5)?],
            period_s,
            state,
            tensions_n: [0.0; CABLES],
            steps: 1,
        };
        plant.tensions_n = plant.tensions_now()?;
        Ok(plant)
    }

    /// What it truly is, to be changed between periods: a payload, for one.
    pub fn truth_mut(&mut self) -> &mut Truth {
        &mut self.truth
    }

    /// What it truly is.
    #[must_use]
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// What is wrong with a winch, to be changed between periods.
    pub fn ailments_mut(&mut self, winch: usize) -> &mut Ailments {
        &mut self.winches[winch].ailments
    }

    /// How the platform moves.
    #[must_use]
    pub fn motion(&self) -> Motion {
        let (center_m, velocity_m_s, orientation, angular_rad_s) = platform(&self.state);
        Motion {
            place: Stance {
                position_m: center_m - orientation * self.truth.center_of_mass_m,
                orientation,
            },
            velocity_m_s,
            angular_rad_s,
        }
    }

    /// Gives the platform another velocity at once, as a push would.
    pub fn set_velocity(&mut self, velocity_m_s: &Vector3<f64>) {
        put(&mut self.state, 3, velocity_m_s.as_slice());
    }

    /// Rest lengths that are paid out, m.
    #[must_use]
    pub fn lengths_m(&self) -> [f64; CABLES] {
        std::array::from_fn(|i| self.state[13 + 3 * i])
    }

    /// Tensions at the anchors, N.
    #[must_use]
    pub fn tensions_n(&self) -> &[f64; CABLES] {
        &self.tensions_n
    }

    /// What the sensors show, with so many counts of noise.
    pub fn measure(&mut self, noise_counts: &[i32; CABLES]) -> Measured {
        let lengths_m = self.lengths_m();
        let mut measured = Measured { angles: [MotorAngle::ZERO; CABLES], failed_winch: None };
        for (i, winch) in self.winches.iter_mut().enumerate() {
            let (angle, is_well) = winch.measure(lengths_m[i], noise_counts[i]);
            measured.angles[i] = angle;
            if !is_well {
                measured.failed_winch.get_or_insert(i);
            }
        }
        measured
    }

    /// One period, with what the controller decided.
    ///
    /// # Errors
    /// [`PlantError`].
    pub fn step(&mut self, decision: &Decision<f64>, weather: &Weather) -> Result<(), PlantError> {
        let mut drives = [Drive { wanted_m_s: 0.0, is_locked: true }; CABLES];
        for (i, drive) in drives.iter_mut().enumerate() {
            let motor = decision.motors.as_ref().map(|motors| &motors[i]);
            *drive = self.winches[i].command(motor, decision.brakes_released);
            if drive.is_locked {
                // The amplifier bears the load before the brake lets it go.
                self.state[15 + 3 * i] = self.mechanics.bearing_m(self.tensions_n[i]);
            }
        }
        let fault = Cell::new(None);
        let equations = Equations {
            truth: &self.truth,
            mechanics: &self.mechanics,
            weather,
            drives: &drives,
            fault: &fault,
        };
        // The first step is as long as those of the last period were.
        let first_s = self.period_s / f64::from(self.steps);
        let mut solver = Dopri5::from_param(
            equations,
            0.0,
            self.period_s,
            0.0,
            self.state,
            TOLERANCE,
            TOLERANCE,
            0.9,
            0.04,
            0.2,
            10.0,
            self.period_s,
            first_s,
            STEPS,
            STEPS,
            OutputType::Sparse,
        );
        let stats = solver.integrate();
        if let Some((cable, fault)) = fault.get() {
            return Err(PlantError::Cable { cable, fault });
        }
        let (Ok(stats), Some(state)) = (stats, solver.y_out().last()) else {
            return Err(PlantError::TooFast { period_s: self.period_s });
        };
        self.state = *state;
        self.steps = stats.accepted_steps.max(1);
        let q =
            Quaternion::new(self.state[6], self.state[7], self.state[8], self.state[9]).normalize();
        put(&mut self.state, 6, &[q.w, q.i, q.j, q.k]);
        self.tensions_n = self.tensions_now()?;
        Ok(())
    }

    fn tensions_now(&self) -> Result<[f64; CABLES], PlantError> {
        let pulls = Pull::all(&self.truth, &self.state);
        let mut tensions_n = [0.0; CABLES];
        for (i, (tension_n, pull)) in tensions_n.iter_mut().zip(pulls).enumerate() {
            *tension_n =
                pull.map_err(|fault| PlantError::Cable { cable: i, fault })?.anchor_tension_n;
        }
        Ok(tensions_n)
    }
}

fn put(state: &mut State, at: usize, numbers: &[f64]) {
    for (place, number) in state.iter_mut().skip(at).zip(numbers) {
        *place = *number;
    }
}

fn vector(state: &State, at: usize) -> Vector3<f64> {
    Vector3::new(state[at], state[at + 1], state[at + 2])
}

/// Centre of mass, its velocity, orientation and angular velocity of the platform.
fn platform(state: &State) -> (Vector3<f64>, Vector3<f64>, UnitQuaternion<f64>, Vector3<f64>) {
    let q = Quaternion::new(state[6], state[7], state[8], state[9]);
    (vector(state, 0), vector(state, 3), UnitQuaternion::from_quaternion(q), vector(state, 10))
}

/// What a cable does.
struct Pull {
    /// Force on the platform, world axes, N.
    force_n: Vector3<f64>,
    /// Where it acts, from the centre of mass, world axes, m.
    lever_m: Vector3<f64>,
    /// Tension at the anchor, N.
    anchor_tension_n: f64,
}

impl Pull {
    fn all(truth: &Truth, state: &State) -> [Result<Self, LineFault>; CABLES] {
        let (center_m, velocity_m_s, orientation, angular_rad_s) = platform(state);
        let turn = orientation.to_rotation_matrix();
        let angular_rad_s = turn * angular_rad_s;
        std::array::from_fn(|i| {
            let cable = &truth.robot.cables()[i];
            let lever_m = turn * (cable.attachment_m - truth.center_of_mass_m);
            let span_m = center_m + lever_m - cable.anchor_m;
            let moving_m_s = velocity_m_s + angular_rad_s.cross(&lever_m);
            let (length_m, rate_m_s) = (state[13 + 3 * i], state[14 + 3 * i]);
            let damping_s = truth.body.cable_damping_s;
            Self::of(&cable.model, &span_m, &moving_m_s, length_m, rate_m_s, damping_s)
                .map(|(force_n, anchor_tension_n)| Self { force_n, lever_m, anchor_tension_n })
        })
    }

    /// Force on the platform and tension at the anchor of a cable whose end is at `span_m` and moves.
    fn of(
        model: &IrvineCatenary<f64>,
        span_m: &Vector3<f64>,
        moving_m_s: &Vector3<f64>,
        length_m: f64,
        rate_m_s: f64,
        damping_s: f64,
    ) -> Result<(Vector3<f64>, f64), LineFault> {
        let x_m = span_m.x.hypot(span_m.y);
        let e = if x_m > 0.0 { Vector2::new(span_m.x, span_m.y) / x_m } else { Vector2::x() };
        let f = model.force_at_length(x_m, span_m.z, length_m)?.force_n;
        let weight_n = model.weight_n_m() * length_m;
        let anchor_n = Vector2::new(f.x, f.y - weight_n);
        // What lags behind: tau dF/dt, in the plane and across.
        let end = model.end_point(f, length_m).jacobian;
        let compliance: Matrix2<f64> = end.fixed_columns::<2>(0).into();
        let along_m_s = e.x * moving_m_s.x + e.y * moving_m_s.y;
        let across_m_s = e.x * moving_m_s.y - e.y * moving_m_s.x;
        let stretching_m_s = Vector2::new(along_m_s, moving_m_s.z) - end.column(2) * rate_m_s;
        let lag_n =
            compliance.try_inverse().map_or(Vector2::zeros(), |k| k * stretching_m_s * damping_s);
        let across_n = if x_m > 0.0 { f.x / x_m * across_m_s * damping_s } else { 0.0 };
        let pull = f + lag_n;
        let force_n =
            -Vector3::new(e.x * pull.x - e.y * across_n, e.y * pull.x + e.x * across_n, pull.y);
        let tension_n = anchor_n.norm();
        let lag_at_anchor_n = if tension_n > 0.0 { lag_n.dot(&anchor_n) / tension_n } else { 0.0 };
        Ok((force_n, tension_n + lag_at_anchor_n))
    }
}

/// The equations of motion during a period.
struct Equations<'a> {
    truth: &'a Truth,
    mechanics: &'a Mechanics,
    weather: &'a Weather,
    drives: &'a [Drive; CABLES],
    /// The first cable without a force.
    fault: &'a Cell<Option<(usize, LineFault)>>,
}

impl System<f64, State> for Equations<'_> {
    fn system(&self, _time_s: f64, state: &State, rates: &mut State) {
        let Self { truth, mechanics, weather, drives, fault } = self;
        rates.fill(0.0);
        let (_, velocity_m_s, orientation, angular_rad_s) = platform(state);
        let mut force_n =
            Vector3::new(0.0, 0.0, -truth.mass_kg * truth.gravity_m_s2) + weather.force_n;
        let mut moment_nm =
            weather.moment_nm - (orientation * truth.center_of_mass_m).cross(&weather.force_n);
        let past_m_s = weather.wind_m_s - velocity_m_s;
        force_n += past_m_s * (0.5 * AIR_KG_M3 * truth.body.drag_area_m2 * past_m_s.norm());
        for (i, pull) in Pull::all(truth, state).into_iter().enumerate() {
            let pull = match pull {
                Ok(pull) => pull,
                Err(why) => {
                    // Nothing moves any more, so that the method comes to its end; the fault tells.
                    fault.set(fault.get().or(Some((i, why))));
                    rates.fill(0.0);
                    return;
                }
            };
            force_n += pull.force_n;
            moment_nm += pull.lever_m.cross(&pull.force_n);
            let at = 13 + 3 * i;
            let winch =
                mechanics.rates(&drives[i], state[at + 1], state[at + 2], pull.anchor_tension_n);
            put(rates, at, &winch);
        }
        put(rates, 0, velocity_m_s.as_slice());
        put(rates, 3, (force_n / truth.mass_kg).as_slice());
        let q = Quaternion::new(state[6], state[7], state[8], state[9]);
        let turning = q * Quaternion::from_imag(angular_rad_s) * 0.5;
        put(rates, 6, &[turning.w, turning.i, turning.j, turning.k]);
        let spin = truth.inertia_kg_m2.component_mul(&angular_rad_s);
        let moment_nm =
            orientation.inverse_transform_vector(&moment_nm) - angular_rad_s.cross(&spin);
        put(rates, 10, moment_nm.component_div(&truth.inertia_kg_m2).as_slice());
    }
}
