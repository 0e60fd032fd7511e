//! What crosses the border: plain arrays and numbers, laid out as C does, and their translation.
//!
//! Every structure comes for `float` and for `double`. Cables are always in the same order, the index
//! of an array counts them from 0.

use cdpr_core::{CABLES, IrvineCatenary, Real};
use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};

use crate::status::{Code, Status};

/// Number of cables.
pub const CDPR_CABLES: usize = 6;
const _: () = assert!(CDPR_CABLES == CABLES);

/// One cable: where it starts, where it holds the platform, and what it is made of.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Cable<T> {
    /// Anchor, where the cable leaves its winch: world frame, z up, m.
    pub anchor_m: [T; 3],
    /// Attachment, where the cable holds the platform: platform frame, m.
    pub attachment_m: [T; 3],
    /// Weight of the cable per rest length, N/m: its mass per metre times gravity.
    pub weight_n_m: T,
    /// Reciprocal of the axial stiffness, 1/EA, 1/N. Zero: the cable does not stretch.
    pub compliance_per_n: T,
}

/// The robot: six elastic catenaries.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Robot<T> {
    /// The cables.
    pub cables: [Cable<T>; CDPR_CABLES],
}

/// What the platform carries.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Load<T> {
    /// Mass of platform and payload, kg.
    pub mass_kg: T,
    /// Centre of mass: platform frame, m.
    pub center_of_mass_m: [T; 3],
    /// Gravity, m/s^2, positive, acting along world -z.
    pub gravity_m_s2: T,
    /// Any further force on the platform, at its origin: world frame, N.
    pub force_n: [T; 3],
    /// Any further moment on the platform: world frame, N m.
    pub moment_nm: [T; 3],
}

/// Where the platform should be, and how fast it should move there.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SetPoint<T> {
    /// Position of the platform origin: world frame, m.
    pub position_m: [T; 3],
    /// Orientation, platform to world: unit quaternion w, x, y, z. {1, 0, 0, 0} is level.
    pub orientation: [T; 4],
    /// Velocity of the platform origin: world frame, m/s.
    pub velocity_m_s: [T; 3],
    /// Angular velocity: world frame, rad/s.
    pub angular_velocity_rad_s: [T; 3],
}

/// What one winch and its cable can do.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct CableLimits<T> {
    /// Shortest rest length, m.
    pub shortest_m: T,
    /// Longest rest length, m: what the drum holds.
    pub longest_m: T,
    /// Largest rate of the rest length either way, m/s.
    pub fastest_m_s: T,
    /// Lowest tension at the anchor, N.
    pub lowest_tension_n: T,
    /// Highest tension at either end, N.
    pub highest_tension_n: T,
}

/// Rate and limits.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Settings<T> {
    /// Time between two ticks, s.
    pub period_s: T,
    /// Largest move of the platform origin in a tick, and of an attachment by turning, m.
    pub largest_move_m: T,
    /// Least distance to a singularity, between 0 and 1: see `CDPR_CODE_NEAR_SINGULARITY`.
    pub least_distance: T,
    /// A fold that would be reached sooner than this is refused, s: see `CDPR_CODE_FOLD_AHEAD`.
    pub fold_horizon_s: T,
    /// Largest `existence_n` of a cable that is accepted, N: rounding leaves about 0.05 in f32 with a load of
    /// 70 kg, and 1e-10 in f64.
    pub largest_error_n: T,
    /// Limits of the cables.
    pub cables: [CableLimits<T>; CDPR_CABLES],
}

/// Force and rest length of one cable.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct CableState<T> {
    /// Force on the cable at the attachment, N, in the vertical plane of the cable: outwards from the
    /// anchor, and up. A downward force carries the platform.
    pub force_n: [T; 2],
    /// Rest (unstretched) length from the anchor to the attachment, m.
    pub rest_length_m: T,
}

/// What one winch is to do, and what its cable then carries.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct CableCommand<T> {
    /// Rest length from the anchor to the attachment, m.
    pub rest_length_m: T,
    /// Its rate of change at the velocities of the set-point, for speed feed-forward, m/s.
    pub rest_length_rate_m_s: T,
    /// Horizontal direction from the anchor to the attachment, world x and y.
    pub direction: [T; 2],
    /// Force on the cable at the attachment, N: outwards from the anchor, and up.
    pub force_n: [T; 2],
    /// Its rate of change, N/s.
    pub force_rate_n_s: [T; 2],
    /// Force of the cable on its winch at the anchor, N: outwards, and up.
    pub anchor_force_n: [T; 2],
    /// Tension at the attachment, N.
    pub tension_n: T,
    /// Tension at the anchor, N.
    pub anchor_tension_n: T,
    /// Whether the cable hangs below both of its ends.
    pub is_slack: bool,
}

/// What is proven about a command.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Certificate<T> {
    /// Kantorovich's h: at most 1/4.
    pub h: T,
    /// Contraction over the ball and all poses since the last command: at most 0.44.
    pub contraction: T,
    /// There is a solution at which no cable's force is further from the command than this, N along its force curve.
    pub existence_n: [T; CDPR_CABLES],
    /// And no other at which none is further than so many times that.
    pub uniqueness_ratio: T,
}

/// The outcome of a tick.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Command<T> {
    /// One for each winch.
    pub cables: [CableCommand<T>; CDPR_CABLES],
    /// What is proven about it.
    pub certificate: Certificate<T>,
    /// Distance to a singularity, between 0 and 1: see `CDPR_CODE_NEAR_SINGULARITY`.
    pub distance: T,
    /// Largest distance between the end of a cable and its attachment, before the last step, m.
    pub closure_m: T,
    /// Unbalanced wrench before the last step, moments over the moment arm, N.
    pub imbalance_n: T,
    /// Parts into which the move was divided.
    pub parts: u32,
}

impl<T: Real> Robot<T> {
    pub(crate) fn to_core(self) -> Result<cdpr_core::Robot<T, IrvineCatenary<T>>, Status<T>> {
        let cables = self.cables.map(|cable| cdpr_core::Cable {
            anchor_m: Vector3::from(cable.anchor_m),
            attachment_m: Vector3::from(cable.attachment_m),
            model: IrvineCatenary {
                weight_n_m: cable.weight_n_m,
                compliance_per_n: cable.compliance_per_n,
            },
        });
        for (i, cable) in cables.iter().enumerate() {
            let IrvineCatenary { weight_n_m, compliance_per_n } = cable.model;
            let physical = |number: T| number >= T::zero() && number.is_finite();
            if !physical(weight_n_m) || !physical(compliance_per_n) {
                return Err(Status::refusal(Code::InvalidCable).of_cable(i));
            }
        }
        Ok(cdpr_core::Robot::new(cables)?)
    }
}

impl<T: Real> Load<T> {
    pub(crate) fn to_core(self) -> cdpr_core::Load<T> {
        cdpr_core::Load {
            mass_kg: self.mass_kg,
            center_of_mass_m: self.center_of_mass_m.into(),
            gravity_m_s2: self.gravity_m_s2,
            force_n: self.force_n.into(),
            moment_nm: self.moment_nm.into(),
        }
    }
}

impl<T: Real> SetPoint<T> {
    pub(crate) fn to_core(self) -> Result<cdpr_core::SetPoint<T>, Status<T>> {
        let [w, x, y, z] = self.orientation;
        // Its length is checked by the pose.
        let orientation = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        Ok(cdpr_core::SetPoint {
            pose: cdpr_core::Pose::new(self.position_m.into(), orientation)?,
            twist: cdpr_core::Twist {
                linear_m_s: self.velocity_m_s.into(),
                angular_rad_s: self.angular_velocity_rad_s.into(),
            },
        })
    }
}

impl<T: Real> Settings<T> {
    pub(crate) fn to_core(self) -> cdpr_core::TrackerSettings<T> {
        cdpr_core::TrackerSettings {
            period_s: self.period_s,
            largest_move_m: self.largest_move_m,
            least_distance: self.least_distance,
            fold_horizon_s: self.fold_horizon_s,
            largest_error_n: self.largest_error_n,
            cables: self.cables.map(|limits| cdpr_core::CableLimits {
                shortest_m: limits.shortest_m,
                longest_m: limits.longest_m,
                fastest_m_s: limits.fastest_m_s,
                lowest_tension_n: limits.lowest_tension_n,
                highest_tension_n: limits.highest_tension_n,
            }),
        }
    }
}

impl<T: Real> CableState<T> {
    pub(crate) fn to_core(self) -> cdpr_core::CableState<T> {
        cdpr_core::CableState {
            force_n: Vector2::from(self.force_n),
            rest_length_m: self.rest_length_m,
        }
    }
}

impl<T: Real> From<&cdpr_core::Command<T>> for Command<T> {
    fn from(command: &cdpr_core::Command<T>) -> Self {
        let certificate = &command.certificate;
        Self {
            cables: command.cables.map(|cable| CableCommand {
                rest_length_m: cable.rest_length_m,
                rest_length_rate_m_s: cable.rest_length_rate_m_s,
                direction: cable.direction.into(),
                force_n: cable.force_n.into(),
                force_rate_n_s: cable.force_rate_n_s.into(),
                anchor_force_n: cable.anchor_force_n.into(),
                tension_n: cable.tension_n,
                anchor_tension_n: cable.anchor_tension_n,
                is_slack: cable.is_slack,
            }),
            certificate: Certificate {
                h: certificate.h,
                contraction: certificate.contraction,
                existence_n: certificate.existence_n,
                uniqueness_ratio: certificate.uniqueness_ratio,
            },
            distance: command.distance,
            closure_m: command.closure_m,
            imbalance_n: command.imbalance_n,
            parts: command.parts.into(),
        }
    }
}
