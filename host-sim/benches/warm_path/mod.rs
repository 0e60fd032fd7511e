//! The path that the warm-step benches walk: MARIONET-CRANE with 69 kg, level, on a horizontal circle
//! of 0.3 m around (2, 7, 2.5) m, once around in 3142 ticks, that is 0.6 m/s at 1 kHz.

use std::f64::consts::TAU;

use cdpr_core::statics::Balance;
use cdpr_core::{
    CABLES, CableState, GeometryFault, IrvineCatenary, Load, NewtonStep, Pose, Real, Robot,
    StepFault,
};
use cdpr_host_sim::enumerate::{ModelKind, Options, Request};
use cdpr_host_sim::robot_file::RobotDescription;
use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};

/// Control ticks in one turn of the circle.
pub(crate) const TICKS: usize = 3142;
/// Middle of the circle, world frame, m.
const CENTER_M: [f64; 3] = [2.0, 7.0, 2.5];
/// Radius of the circle, m.
const RADIUS_M: f64 = 0.3;

/// Forces and rest lengths of the six cables.
pub(crate) type States<T> = [CableState<T>; CABLES];

/// A controller on its way around the circle, without end, in its own precision.
pub(crate) struct Walker<T: Real> {
    pub(crate) robot: Robot<T, IrvineCatenary<T>>,
    pub(crate) load: Load<T>,
    poses: Vec<Pose<T>>,
    /// Largest relative change with which a step counts as converged.
    tolerance: T,
    pub(crate) tick: usize,
    balance: Balance<T>,
    pub(crate) states: States<T>,
    previous: States<T>,
}

impl<T: Real> Walker<T> {
    /// At the beginning, with a step counting as converged that changes nothing by more than
    /// `tolerance` (relative).
    ///
    /// Has walked once around with one warm step a tick and checked at every tick that a second step
    /// would have changed nothing by more than `error` (relative).
    pub(crate) fn on_circle(tolerance: T, error: T) -> Self {
        let request = Request {
            robot: RobotDescription::marionet_crane(),
            position_m: position_m(0),
            rotation_vector_rad: [0.0; 3],
            model: ModelKind::Irvine,
        };
        let problem = request.problem::<IrvineCatenary<f64>>().expect("the pose is regular");
        let solutions =
            request.enumerate(Options::default()).expect("the pose is regular").solutions;
        assert_eq!(solutions.len(), 1, "the first pose has one solution");
        let start = solutions[0].solution.states.map(|state| cast_state(&state));

        let robot = cast_robot(&problem.robot);
        let load = cast_load(&request.robot.load);
        let poses: Vec<_> = (0..TICKS).map(|tick| level(position_m(tick))).collect();
        let balance = Balance::at(&robot, &load, &poses[0]).expect("the pose is regular");
        let mut walker = Self {
            robot,
            load,
            poses,
            tolerance,
            tick: 0,
            balance,
            states: start,
            previous: start,
        };
        walker.cold_tick();
        walker.cold_tick();
        for _ in 0..TICKS {
            walker.warm_tick();
            let left = walker.step(&walker.states).expect("regular").relative_change;
            assert!(left <= error, "tick {}: {left:?} is left", walker.tick);
        }
        walker
    }

    /// One tick with prediction: the next pose, the line through the last two solutions, one Newton
    /// step. Returns its relative change, whose square is the error left.
    #[inline]
    pub(crate) fn warm_tick(&mut self) -> T {
        self.advance().expect("regular");
        let predicted = std::array::from_fn(|i| CableState {
            force_n: self.states[i].force_n * T::constant(2.0) - self.previous[i].force_n,
            rest_length_m: self.states[i].rest_length_m * T::constant(2.0)
                - self.previous[i].rest_length_m,
        });
        let step = self.step(&predicted).expect("regular");
        self.accept(&step)
    }

    /// One tick without prediction: the next pose and two Newton steps.
    #[inline]
    pub(crate) fn cold_tick(&mut self) -> T {
        self.advance().expect("regular");
        let first = self.step(&self.states).expect("regular");
        let second = self.step(&first.states).expect("regular");
        self.accept(&second)
    }

    /// A Newton step at the present pose.
    #[inline]
    fn step(&self, states: &States<T>) -> Result<NewtonStep<T>, StepFault> {
        NewtonStep::new(&self.robot, &self.balance, states)
    }

    #[inline]
    fn advance(&mut self) -> Result<(), GeometryFault> {
        self.tick = (self.tick + 1) % TICKS;
        let pose = &self.poses[self.tick];
        self.balance = self.balance.at_next(&self.robot, &self.load, pose)?;
        Ok(())
    }

    #[inline]
    fn accept(&mut self, step: &NewtonStep<T>) -> T {
        let converged = step.relative_change <= self.tolerance; // false for NaN
        assert!(converged, "tick {}: the step changes {:?}", self.tick, step.relative_change);
        self.previous = self.states;
        self.states = step.states;
        step.relative_change
    }
}

/// Position of the platform at a tick, m.
#[allow(clippy::cast_precision_loss)]
pub(crate) fn position_m(tick: usize) -> [f64; 3] {
    let (sine, cosine) = (TAU * tick as f64 / TICKS as f64).sin_cos();
    [CENTER_M[0] + RADIUS_M * cosine, CENTER_M[1] + RADIUS_M * sine, CENTER_M[2]]
}

fn level<T: Real>(position_m: [f64; 3]) -> Pose<T> {
    let identity = Quaternion::new(T::one(), T::zero(), T::zero(), T::zero());
    Pose::new(cast_vector(&position_m.into()), UnitQuaternion::new_unchecked(identity))
        .expect("a finite pose")
}

fn cast_robot<T: Real>(robot: &Robot<f64, IrvineCatenary<f64>>) -> Robot<T, IrvineCatenary<T>> {
    let cables = robot.cables().each_ref().map(|cable| cdpr_core::Cable {
        anchor_m: cast_vector(&cable.anchor_m),
        attachment_m: cast_vector(&cable.attachment_m),
        model: IrvineCatenary {
            weight_n_m: T::constant(cable.model.weight_n_m),
            compliance_per_n: T::constant(cable.model.compliance_per_n),
        },
    });
    Robot::new(cables).expect("a robot stays one when rounded")
}

fn cast_load<T: Real>(load: &Load<f64>) -> Load<T> {
    Load {
        mass_kg: T::constant(load.mass_kg),
        center_of_mass_m: cast_vector(&load.center_of_mass_m),
        gravity_m_s2: T::constant(load.gravity_m_s2),
        force_n: cast_vector(&load.force_n),
        moment_nm: cast_vector(&load.moment_nm),
    }
}

fn cast_state<T: Real>(state: &CableState<f64>) -> CableState<T> {
    CableState {
        force_n: Vector2::new(T::constant(state.force_n.x), T::constant(state.force_n.y)),
        rest_length_m: T::constant(state.rest_length_m),
    }
}

fn cast_vector<T: Real>(vector: &Vector3<f64>) -> Vector3<T> {
    Vector3::new(T::constant(vector.x), T::constant(vector.y), T::constant(vector.z))
}
