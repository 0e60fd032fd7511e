//! Random questions: poses and loads of MARIONET-CRANE, and robots of any shape.

use std::f64::consts::TAU;

use cdpr_core::{CABLES, Cable, Load, Real, Robot};
use cdpr_host_sim::enumerate::{ModelKind, Request};
use cdpr_host_sim::robot_file::{CableLimits, CableMaterial, RobotDescription};
use nalgebra::Vector3;
use proptest::test_runner::RngSeed;
use rand::rngs::ChaCha8Rng;
use rand::{Rng, RngExt, SeedableRng};

use crate::random_tests;

/// Mass of the platform, kg.
const MASS_KG: [f64; 2] = [2.0, 200.0];
/// Mass of the cables per length, kg/m: from polyethylene fibre of 1 mm to steel of 8 mm.
const LINEAR_DENSITY_KG_M: [f64; 2] = [0.001, 0.3];
/// Axial stiffness EA of the cables, N.
const AXIAL_STIFFNESS_N: [f64; 2] = [1e4, 1e7];
/// Largest turn of the platform, rad.
const LARGEST_TURN_RAD: f64 = 0.3;
/// MARIONET-CRANE's workspace and some more, m.
const CRANE_WORKSPACE_M: [[f64; 2]; 3] = [[-3.0, 9.5], [-0.5, 20.4], [0.2, 5.2]];

/// Length and width of the frame of a random robot, m.
const FRAME_M: [f64; 2] = [2.0, 50.0];
/// Height of the frame over the floor, as part of its mean side.
const FRAME_HEIGHT: [f64; 2] = [0.3, 1.0];
/// Radius of the platform of a random robot, as part of the mean side of the frame.
const PLATFORM: [f64; 2] = [0.01, 0.2];

/// The random numbers of one test case: always the same ones for the same seed of [`random_tests`], and
/// independent of those of other cases.
#[must_use]
pub fn numbers(case: u64) -> ChaCha8Rng {
    let RngSeed::Fixed(seed) = random_tests(1).rng_seed else {
        unreachable!("random_tests fixes it")
    };
    let mut numbers = ChaCha8Rng::seed_from_u64(seed);
    numbers.set_stream(case);
    numbers
}

/// MARIONET-CRANE somewhere in its workspace, a little turned, with a random load and cables of one
/// random material. Limits are those of its robot file.
pub fn request(rng: &mut impl Rng) -> Request {
    let mut description = RobotDescription::marionet_crane();
    let material = material(rng);
    description.robot = description.robot.map_models(|_, _| material);
    description.load.mass_kg = log_uniform(rng, MASS_KG);
    Request {
        robot: description,
        position_m: CRANE_WORKSPACE_M.map(|range| uniform(rng, range)),
        rotation_vector_rad: turn(rng),
        model: ModelKind::Irvine,
    }
}

/// A random robot at a random pose: anchors near the top of a box, attachments within a flat
/// platform, center of mass off its origin, every other robot with cables of six materials. Limits
/// are those of MARIONET-CRANE's robot file.
///
/// # Panics
/// When two anchors fall together, which random numbers do not.
pub fn request_of_random_robot(rng: &mut impl Rng) -> Request {
    let sides_m = [log_uniform(rng, FRAME_M), log_uniform(rng, FRAME_M)];
    let mean_side_m = (sides_m[0] * sides_m[1]).sqrt();
    let height_m = mean_side_m * uniform(rng, FRAME_HEIGHT);
    let radius_m = mean_side_m * log_uniform(rng, PLATFORM);
    let common = material(rng);
    let mixed = rng.random::<bool>();
    // Cables in order around frame and platform, as builders do, or anyhow.
    let in_order = rng.random::<bool>();
    let cables = std::array::from_fn(|i| {
        let around = |rng: &mut _| {
            let part = uniform(rng, [0.0, 1.0]);
            TAU * if in_order { (i as f64 + 0.8 * part) / CABLES as f64 } else { part }
        };
        let angle = around(rng);
        // From half the way out up to the corner of the square that holds the circle.
        let out = uniform(rng, [0.25, 0.5]) / angle.sin().abs().max(angle.cos().abs());
        let anchor_m = Vector3::new(
            sides_m[0] * (0.5 + out * angle.cos()),
            sides_m[1] * (0.5 + out * angle.sin()),
            height_m * uniform(rng, [0.8, 1.2]),
        );
        let angle = around(rng);
        let out_m = radius_m * uniform(rng, [0.3, 1.0]);
        let attachment_m = Vector3::new(
            out_m * angle.cos(),
            out_m * angle.sin(),
            radius_m * uniform(rng, [-0.3, 0.3]),
        );
        Cable { anchor_m, attachment_m, model: if mixed { material(rng) } else { common } }
    });
    let limits = RobotDescription::marionet_crane().limits;
    let load = Load {
        mass_kg: log_uniform(rng, MASS_KG),
        center_of_mass_m: Vector3::from_fn(|_, _| radius_m * uniform(rng, [-0.2, 0.2])),
        gravity_m_s2: 9.81,
        force_n: Vector3::zeros(),
        moment_nm: Vector3::zeros(),
    };
    Request {
        robot: RobotDescription {
            name: "a random robot".to_owned(),
            robot: Robot::new(cables).expect("six anchors"),
            limits,
            load,
            ..RobotDescription::marionet_crane()
        },
        position_m: [
            sides_m[0] * uniform(rng, [0.0, 1.0]),
            sides_m[1] * uniform(rng, [0.0, 1.0]),
            height_m * uniform(rng, [0.05, 0.7]),
        ],
        rotation_vector_rad: turn(rng),
        model: ModelKind::Irvine,
    }
}

/// `request` without limits of length and tension, for what holds only then.
#[must_use]
pub fn without_limits(mut request: Request) -> Request {
    let none = CableLimits { max_length_m: f64::INFINITY, max_tension_n: f64::INFINITY };
    request.robot.limits = [none; CABLES];
    request
}

fn material(rng: &mut impl Rng) -> CableMaterial {
    CableMaterial {
        linear_density_kg_m: log_uniform(rng, LINEAR_DENSITY_KG_M),
        axial_stiffness_n: log_uniform(rng, AXIAL_STIFFNESS_N),
    }
}

/// A rotation vector, uniform in the ball.
fn turn(rng: &mut impl Rng) -> [f64; 3] {
    loop {
        let vector = Vector3::from_fn(|_, _| uniform(rng, [-LARGEST_TURN_RAD, LARGEST_TURN_RAD]));
        if vector.norm() <= LARGEST_TURN_RAD {
            return vector.into();
        }
    }
}

/// Uniform in a range.
pub fn uniform(rng: &mut impl Rng, [least, largest]: [f64; 2]) -> f64 {
    rng.random_range(least..largest)
}

/// Log-uniform in a range.
pub fn log_uniform(rng: &mut impl Rng, range: [f64; 2]) -> f64 {
    uniform(rng, range.map(f64::ln)).exp()
}

/// To the nearest f32, so that it is the same number in every type.
#[must_use]
#[allow(clippy::cast_possible_truncation)]
pub fn rounded(x: f64) -> f64 {
    f64::from(x as f32)
}

/// In another type.
#[must_use]
pub fn vector<T: Real>(v: Vector3<f64>) -> Vector3<T> {
    v.map(|x| T::constant(x))
}
