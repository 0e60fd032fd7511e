//! Forward kinematics: where the platform comes to rest on six cables of given rest lengths.
//!
//! The unknown is the pose, the six equations are the balance of the platform, with the force of each cable from
//! its own length ([`CableModel::force_at_length`]). Their derivative is the stiffness of the robot,
//!
//! ```text
//! df_i = -K_i (dp + dtheta x r_i)        K_i = [e z] C_i^-1 [e z]^T + (Fx/x) n n^T
//! ```
//!
//! with the compliance `C = d(X, Z)/d(Fx, Fz)` of the cable in its plane (`e` horizontal, `z` up) and what a
//! pendulum has across it (`n`). At a pose at rest it is symmetric, because all forces but an external moment have
//! a potential, and the platform stays there exactly where it is positive definite.
//!
//! Newton's method with steps cut so that the imbalance falls finds one pose at rest; whether there are others near
//! it is searched from starts all around ([`at_rest_near`]). That is a search, not a proof.

use cdpr_core::controller::Stance;
use cdpr_core::{CABLES, CableModel, LineFault, Load, Robot};
use nalgebra::{Matrix2, Matrix3, Matrix6, UnitQuaternion, Vector2, Vector3, Vector6};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};

/// A pose at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// Where.
    pub place: Stance<f64>,
    /// Forces on the cables at their attachments, `(Fx, Fz)` in their planes, N.
    pub forces_n: [Vector2<f64>; CABLES],
    /// Force, and moment over the moment arm, that are left over, N.
    pub imbalance_n: f64,
    /// Least stiffness against any small move, turns times the moment arm, N/m: not positive where the platform
    /// does not stay.
    pub least_stiffness_n_m: f64,
}

impl Rest {
    /// Whether the platform stays there.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.least_stiffness_n_m > 0.0
    }
}

/// Why there is no pose.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ForwardError {
    /// A cable has no force of this length.
    #[error("cable {}: {fault}", .cable + 1)]
    Cable {
        /// The cable, counted from 0.
        cable: usize,
        /// Why.
        fault: LineFault,
    },
    /// An attachment came to lie exactly below or above its anchor.
    #[error("cable {}: it hangs exactly vertically", .0 + 1)]
    Vertical(usize),
    /// Newton's method did not come to rest.
    #[error("no pose at rest was found from there: {imbalance_n} N are left over")]
    NotFound {
        /// What is left over, N.
        imbalance_n: f64,
    },
}

/// Newton steps at most.
const STEPS: usize = 200;
/// Longest step, m, and rad.
const LONGEST_STEP: f64 = 0.3;
/// A step below this is rounding, m: that of the lengths of some ten metres, times a few for the condition.
const SETTLED_M: f64 = 1e-12;

/// Balance of the platform somewhere.
struct Balance {
    forces_n: [Vector2<f64>; CABLES],
    /// Force, and moment about the platform origin over the moment arm, N.
    wrench_n: Vector6<f64>,
    /// Less its derivative by a move of the origin (m) and a turn (rad times the moment arm), N/m.
    stiffness_n_m: Matrix6<f64>,
}

impl Balance {
    fn at<M: CableModel<f64>>(
        robot: &Robot<f64, M>,
        load: &Load<f64>,
        lengths_m: &[f64; CABLES],
        place: &Stance<f64>,
    ) -> Result<Self, ForwardError> {
        let arm_m = robot.moment_arm_m();
        let weight_n = Vector3::new(0.0, 0.0, -load.mass_kg * load.gravity_m_s2);
        let to_mass_m = place.orientation * load.center_of_mass_m;
        let mut force_n = weight_n + load.force_n;
        let mut moment_nm = to_mass_m.cross(&weight_n) + load.moment_nm;
        // Derivatives of force and moment by (dp, dtheta).
        let mut force_by_move = Matrix3::zeros();
        let mut force_by_turn = Matrix3::zeros();
        let mut moment_by_move = Matrix3::zeros();
        let mut moment_by_turn = -weight_n.cross_matrix() * -to_mass_m.cross_matrix();
        let mut forces_n = [Vector2::zeros(); CABLES];
        for (i, cable) in robot.cables().iter().enumerate() {
            let lever_m = place.orientation * cable.attachment_m;
            let span_m = place.position_m + lever_m - cable.anchor_m;
            let x_m = span_m.x.hypot(span_m.y);
            if x_m == 0.0 {
                return Err(ForwardError::Vertical(i));
            }
            let (e, n) = (
                Vector3::new(span_m.x / x_m, span_m.y / x_m, 0.0),
                Vector3::new(-span_m.y / x_m, span_m.x / x_m, 0.0),
            );
            let line = cable
                .model
                .force_at_length(x_m, span_m.z, lengths_m[i])
                .map_err(|fault| ForwardError::Cable { cable: i, fault })?;
            let f = line.force_n;
            forces_n[i] = f;
            let end = cable.model.end_point(f, lengths_m[i]);
            let compliance: Matrix2<f64> = end.jacobian.fixed_columns::<2>(0).into();
            let k = compliance.try_inverse().ok_or(ForwardError::Vertical(i))?;
            let z = Vector3::z();
            let cable_by_move = -(e * e.transpose() * k.m11
                + (e * z.transpose() + z * e.transpose()) * (0.5 * (k.m12 + k.m21))
                + z * z.transpose() * k.m22
                + n * n.transpose() * (f.x / x_m));
            let pull_n = -(e * f.x + z * f.y);
            force_n += pull_n;
            moment_nm += lever_m.cross(&pull_n);
            let lever = lever_m.cross_matrix();
            let cable_by_turn = cable_by_move * -lever;
            force_by_move += cable_by_move;
            force_by_turn += cable_by_turn;
            moment_by_move += lever * cable_by_move;
            // r turns as well: d(r x f) = dr x f + r x df, dr = dtheta x r.
            moment_by_turn += -pull_n.cross_matrix() * -lever + lever * cable_by_turn;
        }
        let mut wrench_n = Vector6::zeros();
        wrench_n.fixed_rows_mut::<3>(0).copy_from(&force_n);
        wrench_n.fixed_rows_mut::<3>(3).copy_from(&(moment_nm / arm_m));
        let mut stiffness_n_m = Matrix6::zeros();
        stiffness_n_m.fixed_view_mut::<3, 3>(0, 0).copy_from(&-force_by_move);
        stiffness_n_m.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-force_by_turn / arm_m));
        stiffness_n_m.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-moment_by_move / arm_m));
        stiffness_n_m.fixed_view_mut::<3, 3>(3, 3).copy_from(&(-moment_by_turn / (arm_m * arm_m)));
        Ok(Self { forces_n, wrench_n, stiffness_n_m })
    }
}

/// The pose at rest that Newton's method finds from `guess`, with cables of `lengths_m` (m).
///
/// Cost: some 20 us, a few times that from far away; at most 200 steps.
///
/// # Errors
/// [`ForwardError`].
pub fn at_rest<M: CableModel<f64>>(
    robot: &Robot<f64, M>,
    load: &Load<f64>,
    lengths_m: &[f64; CABLES],
    guess: &Stance<f64>,
) -> Result<Rest, ForwardError> {
    let arm_m = robot.moment_arm_m();
    let mut place = *guess;
    let mut here = Balance::at(robot, load, lengths_m, &place)?;
    let mut is_settled = false;
    for _ in 0..STEPS {
        let imbalance_n = here.wrench_n.norm();
        let step = here.stiffness_n_m.lu().solve(&here.wrench_n);
        let Some(mut step) = step.filter(|step| step.iter().all(|c| c.is_finite())) else {
            break;
        };
        is_settled = step.norm() <= SETTLED_M;
        if is_settled {
            break;
        }
        step *= (LONGEST_STEP / step.norm()).min(1.0);
        // The step is cut until the imbalance falls.
        let mut share = 1.0;
        let next = loop {
            let there = moved(&place, &(step * share), arm_m);
            match Balance::at(robot, load, lengths_m, &there) {
                Ok(next) if next.wrench_n.norm() < imbalance_n => break Some((there, next)),
                _ if share > 1e-4 => share *= 0.5,
                _ => break None,
            }
        };
        let Some(next) = next else {
            // Where it cannot fall, it is rounding or there is no way on.
            is_settled = step.norm() <= SETTLED_M * 1e3;
            break;
        };
        (place, here) = next;
    }
    let imbalance_n = here.wrench_n.norm();
    if !is_settled {
        return Err(ForwardError::NotFound { imbalance_n });
    }
    let symmetric = (here.stiffness_n_m + here.stiffness_n_m.transpose()) * 0.5;
    Ok(Rest {
        place,
        forces_n: here.forces_n,
        imbalance_n,
        least_stiffness_n_m: symmetric.symmetric_eigenvalues().min(),
    })
}

/// All poses at rest that are found from `starts` random places within `radius_m` of `guess` (turned by up to
/// `radius_m` over the moment arm) and from `guess` itself, which comes first if there is one. Two places are one
/// where they are closer than 1e-6 m.
///
/// # Errors
/// [`ForwardError`] of the guess, when nothing was found at all.
pub fn at_rest_near<M: CableModel<f64>>(
    robot: &Robot<f64, M>,
    load: &Load<f64>,
    lengths_m: &[f64; CABLES],
    guess: &Stance<f64>,
    radius_m: f64,
    starts: usize,
) -> Result<Vec<Rest>, ForwardError> {
    const SAME_M: f64 = 1e-6;
    let arm_m = robot.moment_arm_m();
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let first = at_rest(robot, load, lengths_m, guess);
    let mut found: Vec<Rest> = first.into_iter().collect();
    for _ in 0..starts {
        let by = Vector6::from_fn(|_, _| random.random_range(-radius_m..=radius_m));
        let Ok(rest) = at_rest(robot, load, lengths_m, &moved(guess, &by, arm_m)) else {
            continue;
        };
        if found.iter().all(|other| distance_m(&other.place, &rest.place, arm_m) > SAME_M) {
            found.push(rest);
        }
    }
    if found.is_empty() { first.map(|rest| vec![rest]) } else { Ok(found) }
}

/// How far apart two places are, turns times `arm_m`, m.
#[must_use]
pub fn distance_m(a: &Stance<f64>, b: &Stance<f64>, arm_m: f64) -> f64 {
    (a.position_m - b.position_m).norm().hypot(arm_m * a.orientation.angle_to(&b.orientation))
}

/// `place` after a move of the origin (m) and a turn (rad times `arm_m`), world axes.
fn moved(place: &Stance<f64>, by: &Vector6<f64>, arm_m: f64) -> Stance<f64> {
    let turn: Vector3<f64> = by.fixed_rows::<3>(3) / arm_m;
    Stance {
        position_m: place.position_m + by.fixed_rows::<3>(0),
        orientation: UnitQuaternion::from_scaled_axis(turn) * place.orientation,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::FromMaterial as _;
    use crate::robot_file::RobotDescription;
    use cdpr_core::IrvineCatenary;

    fn crane() -> (Robot<f64, IrvineCatenary<f64>>, Load<f64>) {
        let crane = RobotDescription::marionet_crane();
        let g = crane.load.gravity_m_s2;
        (
            crane.robot.map_models(|_, material| IrvineCatenary::from_material(material, g)),
            crane.load,
        )
    }

    /// Rest lengths at (2, 7, 2.5), level, 69 kg, by the complete search to 1e-6 m.
    const LENGTHS_M: [f64; CABLES] = [10.0, 14.8, 12.5, 14.8, 12.2, 8.4];

    /// A place near where these hold the platform, turned a little.
    fn place() -> Stance<f64> {
        Stance {
            position_m: Vector3::new(2.1, 6.9, 2.6),
            orientation: UnitQuaternion::from_scaled_axis(Vector3::new(0.05, -0.1, 0.15)),
        }
    }

    #[test]
    fn stiffness_is_the_derivative() {
        let (robot, load) = crane();
        let load = Load { center_of_mass_m: Vector3::new(0.1, 0.05, -0.3), ..load };
        let arm_m = robot.moment_arm_m();
        // Some cables taut at first, some slack.
        let lengths_m = [10.5, 14.9, 12.4, 16.0, 12.9, 9.5];
        let here = Balance::at(&robot, &load, &lengths_m, &place()).unwrap();
        let h = 1e-6;
        for column in 0..6 {
            let mut by = Vector6::zeros();
            by[column] = h;
            let at = |by: &Vector6<f64>| {
                Balance::at(&robot, &load, &lengths_m, &moved(&place(), by, arm_m))
                    .unwrap()
                    .wrench_n
            };
            let slope = (at(&-by) - at(&by)) / (2.0 * h);
            let error = (slope - here.stiffness_n_m.column(column)).norm();
            // Central differences: h^2 times the third derivative, and rounding over h.
            assert!(error < 1e-5 * slope.norm() + 1e-3, "{column}: {error} of {}", slope.norm());
        }
    }

    #[test]
    fn stiffness_is_symmetric_at_rest() {
        let (robot, load) = crane();
        let load = Load { center_of_mass_m: Vector3::new(0.1, 0.05, -0.1), ..load };
        let rest = at_rest(&robot, &load, &LENGTHS_M, &place()).unwrap();
        let there = Balance::at(&robot, &load, &LENGTHS_M, &rest.place).unwrap();
        let k = there.stiffness_n_m;
        assert!((k - k.transpose()).amax() < 1e-9 * k.amax(), "{}", k - k.transpose());
        assert!(rest.is_stable());
    }
}
