//! Golden data, independent methods, and the one table of tolerances that the tests across the crates
//! share.

pub mod browser;
pub mod fuzzing;
pub mod images;
pub mod multistart;
pub mod random;

use std::collections::BTreeMap;

use cdpr_core::IrvineCatenary;
use cdpr_host_sim::cases::Overrides;
use cdpr_host_sim::enumerate::{ModelKind, Request};
use cdpr_host_sim::robot_file::RobotDescription;
use nalgebra::{Matrix2x3, Vector2};
use proptest::test_runner::{Config as ProptestConfig, RngSeed};
use serde::de::{Deserialize, Deserializer, Error};

/// The one table of tolerances.
///
/// Most are multiples of the distance `eps` from 1 to the next number of the float type, so that
/// one entry serves f32 and f64: a result of `n` roundings of at most `eps/2` each is off by `n/2`
/// at worst, and by `3 sqrt(n/12)` at three standard deviations when they add like a random walk.
pub mod tolerance {
    /// Error of the end point, times `eps L`, with L the stretched length. The longest path to X
    /// (`W`, `T_A`, `1/S`, logarithm, sum, product) rounds 18 times: 9 at worst, 3.7 at three
    /// standard deviations; largest found 1.7.
    pub const END_POINT: f64 = 4.0;

    /// Error of the derivative, times `eps` and the largest entry of its row, the columns of Fx and
    /// Fz times `(|Fx| + |Fz|)/L`. Products of up to five such paths: 25 roundings of the tensions,
    /// none of which cancels; largest found 5.
    pub const DERIVATIVE: f64 = 8.0;

    /// Error of a composite Gauss quadrature, times `eps L`: 10 levels of pairwise sums and 6
    /// roundings of the integrand, half a unit each, and [`END_POINT`] of the other side.
    pub const QUADRATURE: f64 = 12.0;

    /// Residual of a solved line, times `eps` and the largest of distance and stretched length. The
    /// solver stops at 4 or where no force does better: that is rounded to `eps/2`, the compliance
    /// times the force is up to twice the length, and [`END_POINT`] comes on top. Largest found in
    /// a million lines: 4.6 (catenary), 5.4 (parabola).
    pub const RESIDUAL: f64 = 8.0;

    /// Error of a solved force, times `eps (|K^-1| (L + |x| + |z|) + |F|)`: the solver stops at 4 and
    /// the map is within [`END_POINT`], both of the largest of the three lengths, which are together
    /// about twice as long. Largest found 0.6, in f32 0.9.
    pub const FORCE: f64 = 4.0;

    /// Rest lengths of a solution, relative. The reference values were polished until their static
    /// residual was below 2e-10 N, and the worst condition among them is 1.2e3.
    pub const SOLUTION_LENGTH: f64 = 1e-9;

    /// Force at an attachment, relative, as a plane vector. A slack cable of 4 km answers 1e-9 of its
    /// length with more than that of its force.
    pub const SOLUTION_FORCE: f64 = 1e-7;

    /// Force of a rigid solution, relative: conditions up to 1e4 times rounding of input and matrix,
    /// and the smallest force is 1/300 of the largest.
    pub const RIGID_FORCE: f64 = 1e-9;

    /// Deformation or parameter at a fold, relative: the same fold met from either side, or along two
    /// parameters. It is found to 1e-10 of the unit tangent, and the parameter moves with the square of
    /// that; rounding in its logarithm is more. Largest found 4e-14.
    pub const FOLD: f64 = 1e-12;

    /// Rest lengths at a fold, relative: they move with the place along the path itself, by up to ten
    /// times the unit tangent. Largest found 9e-14.
    pub const FOLD_STATE: f64 = 1e-9;

    /// Residual of a point of a branch, relative to the longest cable or the largest force: Newton ends
    /// at changes of 1e-13, or 1e-9 where rounding leaves more. Largest found below 1e-12.
    pub const POINT: f64 = 1e-9;
}

/// One elastic catenary of `data/cable.json`: what hangs there and, computed with 50 digits, where
/// it ends.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct CableCase {
    /// What the line is an example of: `taut`, `near_taut`, `slack`, `deep_slack`, `above` or
    /// `almost_vertical`.
    pub kind: String,
    /// Horizontal force on the cable at the attachment, N.
    pub fx_n: f64,
    /// Vertical force on the cable at the attachment, N.
    pub fz_n: f64,
    /// Rest length, m.
    pub rest_length_m: f64,
    /// Weight per rest length, N/m.
    pub weight_n_m: f64,
    /// Axial stiffness EA, N.
    pub axial_stiffness_n: f64,
    /// Horizontal distance of the attachment from the anchor, m.
    #[serde(deserialize_with = "decimal")]
    pub x_m: f64,
    /// Height of the attachment above the anchor, m.
    #[serde(deserialize_with = "decimal")]
    pub z_m: f64,
    /// Derivative of `(X, Z)` by `Fx`, `Fz` (m/N) and `L` (m/m).
    #[serde(deserialize_with = "decimals")]
    pub jacobian: Matrix2x3<f64>,
}

impl CableCase {
    /// The cable.
    #[must_use]
    pub fn model(&self) -> IrvineCatenary<f64> {
        IrvineCatenary {
            weight_n_m: self.weight_n_m,
            compliance_per_n: self.axial_stiffness_n.recip(),
        }
    }

    /// Force on the cable at the attachment, N.
    #[must_use]
    pub fn force_n(&self) -> Vector2<f64> {
        Vector2::new(self.fx_n, self.fz_n)
    }

    /// Where the cable ends, m.
    #[must_use]
    pub fn position_m(&self) -> Vector2<f64> {
        Vector2::new(self.x_m, self.z_m)
    }
}

/// The lines of `data/cable.json`.
///
/// # Panics
/// When the file is not what [`CableCase`] describes.
#[must_use]
pub fn cable_cases() -> Vec<CableCase> {
    serde_json::from_str(include_str!("../data/cable.json")).expect("data/cable.json")
}

/// A decimal string of any length, to the nearest float.
fn decimal<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
}

/// Two rows of three decimal strings.
fn decimals<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Matrix2x3<f64>, D::Error> {
    let mut matrix = Matrix2x3::zeros();
    for (i, row) in <[[String; 3]; 2]>::deserialize(deserializer)?.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            matrix[(i, j)] = entry.parse().map_err(D::Error::custom)?;
        }
    }
    Ok(matrix)
}

/// An operation on intervals, from `data/interval.json`, with the range of its exact results.
#[derive(Clone, Debug)]
pub struct IntervalCase {
    /// `add`, `sub`, `mul`, `div`, `neg`, `square`, `sqrt`, `ln`, `hull`, `intersection`, `around`
    /// (center and radius), `distance` and `excess` (`sqrt(x^2 + z^2)`, less `z`), `tail` (of `q` and
    /// its complement to one) or `constant` (the float next to the number meant).
    pub operation: String,
    /// Low and high of each operand.
    pub operands: Vec<[f64; 2]>,
    /// The largest float that is not above the least exact result, and the smallest that is not
    /// below the greatest: any sound enclosure holds both. Empty where the first is the larger.
    pub range: [f64; 2],
}

/// The operations of `data/interval.json`.
///
/// # Panics
/// When the file is not what `oracles/interval.py` writes.
#[must_use]
pub fn interval_cases() -> Vec<IntervalCase> {
    let data: BTreeMap<String, Vec<String>> =
        serde_json::from_str(include_str!("../data/interval.json")).expect("data/interval.json");
    let case = |operation: &str, line: &str| {
        let numbers: Vec<f64> = line.split(' ').map(|n| n.parse().expect("a float")).collect();
        let mut pairs: Vec<[f64; 2]> = numbers.chunks_exact(2).map(|p| [p[0], p[1]]).collect();
        let range = pairs.pop().expect("a range");
        IntervalCase { operation: operation.to_owned(), operands: pairs, range }
    };
    data.iter()
        .flat_map(|(operation, lines)| lines.iter().map(move |line| case(operation, line)))
        .collect()
}

/// Answers for one pose: `data/paper.json` and `data/random.json`; with `S` as in [`RefinedCase`],
/// `data/solutions.json`.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct PoseCase<S = SolutionCase> {
    /// Position of the platform origin, m.
    pub position_m: [f64; 3],
    /// Orientation as rotation vector, rad.
    pub rotation_vector_rad: [f64; 3],
    /// Mass of the platform, kg.
    pub mass_kg: f64,
    /// Mass of the cables per length, kg/m.
    pub linear_density_kg_m: f64,
    /// Axial stiffness EA of the cables, N.
    pub axial_stiffness_n: f64,
    /// Longest cable, m.
    pub max_length_m: f64,
    /// Largest tension, N.
    pub max_tension_n: f64,
    /// Rigid solutions with their forces; `random.json` has only the sets.
    #[serde(default)]
    pub rigid_solutions: Vec<RigidCase>,
    /// Sets of slack cables that have a rigid solution.
    #[serde(default)]
    pub rigid_slack_sets: Vec<Vec<usize>>,
    /// All deformable solutions.
    pub solutions: Vec<S>,
}

/// A rigid solution of `data/paper.json`.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct RigidCase {
    /// Numbers of the slack cables.
    pub slack: Vec<usize>,
    /// Tension, or downward pull of a slack cable, N.
    pub forces_n: [f64; 6],
}

/// A deformable solution.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct SolutionCase {
    /// The rigid solution it comes from, where the file says so.
    pub from_rigid_slack_set: Option<Vec<usize>>,
    /// Rest lengths, m.
    pub lengths_m: [f64; 6],
    /// Horizontal force on the cable at B, N.
    pub fx_n: [f64; 6],
    /// Vertical force on the cable at B, N.
    pub fz_n: [f64; 6],
    /// Sign of the determinant, where the file says so.
    pub det_sign: Option<i8>,
}

impl<S> PoseCase<S> {
    /// The question of this case, for MARIONET-CRANE with elastic catenaries.
    #[must_use]
    pub fn request(&self) -> Request {
        let overrides = Overrides {
            mass_kg: Some(self.mass_kg),
            gravity_m_s2: None,
            linear_density_kg_m: Some(self.linear_density_kg_m),
            axial_stiffness_n: Some(self.axial_stiffness_n),
            max_length_m: Some(self.max_length_m),
            max_tension_n: Some(self.max_tension_n),
        };
        Request {
            robot: overrides.apply(&RobotDescription::marionet_crane()),
            position_m: self.position_m,
            rotation_vector_rad: self.rotation_vector_rad,
            model: ModelKind::Irvine,
        }
    }
}

/// The poses of the paper.
///
/// # Panics
/// When `data/paper.json` is not what [`PoseCase`] describes.
#[must_use]
pub fn paper_cases() -> Vec<PoseCase> {
    serde_json::from_str(include_str!("../data/paper.json")).expect("data/paper.json")
}

/// Random poses, masses, densities and stiffnesses.
///
/// # Panics
/// When `data/random.json` is not what [`PoseCase`] describes.
#[must_use]
pub fn random_cases() -> Vec<PoseCase> {
    serde_json::from_str(include_str!("../data/random.json")).expect("data/random.json")
}

/// One pose of `data/solutions.json` with its solutions to 40 digits: all that are known of
/// `paper.json` and `random.json`, and of a pose that has no rigid solution.
#[derive(Clone, Debug)]
pub struct RefinedCase {
    /// Which case it is.
    pub origin: String,
    /// The question, and the solutions. No rigid ones are in the file.
    pub pose: PoseCase<RefinedSolution>,
    /// Gravity, m/s^2.
    pub gravity_m_s2: f64,
    /// Weight of the cables per length as the program rounds it, N/m.
    pub weight_n_m: f64,
    /// Compliance of the cables as the program rounds it, 1/N.
    pub compliance_per_n: f64,
    /// Weight of the platform as the program rounds it, N.
    pub platform_weight_n: f64,
}

/// A deformable solution; decimal strings, because no float holds it.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct RefinedSolution {
    /// Rest lengths, m.
    pub lengths_m: [String; 6],
    /// Horizontal force on the cable at B, N.
    pub fx_n: [String; 6],
    /// Vertical force on the cable at B, N.
    pub fz_n: [String; 6],
}

/// The poses of `data/solutions.json`.
///
/// # Panics
/// When the file is not what [`RefinedCase`] describes.
#[must_use]
pub fn refined_cases() -> Vec<RefinedCase> {
    /// Read beside the pose rather than flattened into one: where another package has `serde_json` keep
    /// numbers in all their digits, flattened ones are no numbers.
    #[derive(serde::Deserialize)]
    struct Constants {
        origin: String,
        gravity_m_s2: f64,
        weight_n_m: f64,
        compliance_per_n: f64,
        platform_weight_n: f64,
    }
    let text = include_str!("../data/solutions.json");
    let poses: Vec<PoseCase<RefinedSolution>> =
        serde_json::from_str(text).expect("data/solutions.json");
    let constants: Vec<Constants> = serde_json::from_str(text).expect("data/solutions.json");
    poses
        .into_iter()
        .zip(constants)
        .map(
            |(
                pose,
                Constants { origin, gravity_m_s2, weight_n_m, compliance_per_n, platform_weight_n },
            )| RefinedCase {
                origin,
                pose,
                gravity_m_s2,
                weight_n_m,
                compliance_per_n,
                platform_weight_n,
            },
        )
        .collect()
}

/// Random tests, `ordinary` of them every day and a hundred times as many when the environment
/// variable `CDPR_LONG` is set. The same ones in every run; `PROPTEST_RNG_SEED` gives others.
#[must_use]
pub fn random_tests(ordinary: u32) -> ProptestConfig {
    let long = std::env::var_os("CDPR_LONG").is_some_and(|value| !value.is_empty());
    let config = ProptestConfig::default();
    let rng_seed = match config.rng_seed {
        RngSeed::Random => RngSeed::Fixed(0),
        given @ RngSeed::Fixed(_) => given,
    };
    let cases = if long { 100 * ordinary } else { ordinary };
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..config }
}
