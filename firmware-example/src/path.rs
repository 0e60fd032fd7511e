//! A closed path of the platform: one point for each tick, or coarse way-points.

use core::f64::consts::TAU;

use cdpr_core::controller::Stance;
use cdpr_core::{GeometryFault, Real, SetPoint, Twist};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::robot::{self, Payload};

/// Time between two ticks, s.
pub const PERIOD_S: f64 = 1e-3;

/// Ticks of once around.
pub const TICKS_AROUND: u32 = 9_500;

/// Way-points of once around.
pub const WAY_POINTS_AROUND: u32 = 38;

/// Time between two way-points, s.
pub const WAY_POINT_S: f64 = 0.2;

/// How a path is divided into points.
#[derive(Clone, Copy, Debug)]
struct Division {
    /// Of the phase from one point to the next.
    cos: f64,
    sin: f64,
    /// Of the phase, rad/s.
    rate_rad_s: f64,
}

/// One point for each tick.
const TICKS: Division = Division {
    cos: 0.999_999_781_283_012_9,
    sin: 0.000_661_387_878_852_609_8,
    rate_rad_s: 0.661_387_927_071_535_4,
};

/// Coarse, and a little faster.
const WAY_POINTS: Division = Division {
    cos: 0.986_361_303_402_722_3,
    sin: 0.164_594_590_280_733_9,
    rate_rad_s: TAU / (WAY_POINTS_AROUND as f64 * WAY_POINT_S),
};

/// A path, and what is carried along it: at the phase `p` the platform is at
/// `(x sin p, y sin 2p, z (1 - cos p))` from where it starts, turned about the vertical by
/// `2 asin(half_turn sin p)`. A figure of eight seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// What the platform carries.
    pub payload: Payload,
    /// Along x, m.
    pub x_m: f64,
    /// Along y, m.
    pub y_m: f64,
    /// Along z, half of what it rises, m.
    pub z_m: f64,
    /// Sine of half the largest turn.
    pub half_turn: f64,
}

/// All cables are taut, the platform moves at up to 1 m/s.
pub const TAUT: Course =
    Course { payload: robot::LOADED, x_m: 0.6, y_m: 0.4, z_m: -0.3, half_turn: 0.04 };

/// For a quarter of it cables are slack.
pub const SLACK: Course =
    Course { payload: robot::EMPTY, x_m: 0.4, y_m: 0.25, z_m: -0.4, half_turn: 0.04 };

/// Position and orientation (platform to world) as a trajectory generator gives them: unchecked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target<T: Real> {
    /// Where.
    pub stance: Stance<T>,
    /// Its rate of change.
    pub twist: Twist<T>,
}

impl<T: Real> Target<T> {
    /// The set-point for the tracker.
    ///
    /// # Errors
    /// [`GeometryFault::InvalidPose`].
    pub fn set_point(&self) -> Result<SetPoint<T>, GeometryFault> {
        Ok(SetPoint { pose: self.stance.pose()?, twist: self.twist })
    }
}

/// Goes round a [`Course`] without trigonometric functions, which in f32 take a thousand
/// instructions: the unit vector `(cos p, sin p)` is turned by the same angle from point to point.
#[derive(Clone, Copy, Debug)]
pub struct Path<T> {
    course: Course,
    division: Division,
    cos: T,
    sin: T,
}

impl<T: Real> Path<T> {
    /// At the start, to go on tick by tick.
    #[must_use]
    pub fn new(course: Course) -> Self {
        Self::divided(course, TICKS)
    }

    /// At the start, to go on from way-point to way-point.
    #[must_use]
    pub fn coarse(course: Course) -> Self {
        Self::divided(course, WAY_POINTS)
    }

    fn divided(course: Course, division: Division) -> Self {
        Self { course, division, cos: T::one(), sin: T::zero() }
    }

    /// The point.
    #[must_use]
    pub fn target(&self) -> Target<T> {
        let c = T::constant;
        let (cos, sin) = (self.cos, self.sin);
        let (x_m, y_m) = (c(self.course.x_m), c(self.course.y_m));
        let (z_m, half_turn) = (c(self.course.z_m), c(self.course.half_turn));
        let (rate_rad_s, two) = (c(self.division.rate_rad_s), c(2.0));
        let offset_m = Vector3::new(x_m * sin, y_m * (two * sin * cos), z_m * (T::one() - cos));
        let (k, per_turn) = (half_turn * sin, half_turn * cos);
        let w = (T::one() - k * k).sqrt();
        Target {
            stance: Stance {
                position_m: robot::start_position_m::<T>() + offset_m,
                orientation: UnitQuaternion::new_unchecked(Quaternion::new(
                    w,
                    T::zero(),
                    T::zero(),
                    k,
                )),
            },
            twist: Twist {
                linear_m_s: Vector3::new(
                    x_m * cos * rate_rad_s,
                    y_m * (two * (cos * cos - sin * sin)) * rate_rad_s,
                    z_m * sin * rate_rad_s,
                ),
                angular_rad_s: Vector3::new(T::zero(), T::zero(), two * per_turn * rate_rad_s / w),
            },
        }
    }

    /// On to the next point.
    pub fn advance(&mut self) {
        let (cos_step, sin_step) = (T::constant(self.division.cos), T::constant(self.division.sin));
        let (cos, sin) =
            (self.cos * cos_step - self.sin * sin_step, self.sin * cos_step + self.cos * sin_step);
        // One step of Newton's method for the length 1: rounding errors do not add up in it.
        let scale = T::constant(1.5) - T::constant(0.5) * (cos * cos + sin * sin);
        (self.cos, self.sin) = (cos * scale, sin * scale);
    }
}
