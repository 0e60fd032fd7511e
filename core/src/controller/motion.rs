//! Jerk-limited motion from one pose to the next, so that a coarse list of poses is enough.
//!
//! Position and quaternion are one curve each, a quintic in the share `u` of the duration:
//!
//! ```text
//! p(u) = p0 + (p1 - p0) s(u) + v0 h(u) - v1 h(1 - u)
//! s(u) = u^3 (10 - 15 u + 6 u^2)        h(u) = u (1 - u)^3 (1 + 3 u)
//! ```
//!
//! with the rates `v0`, `v1` at its ends (over the duration) and no second derivative there: motions
//! in a row are continuous in pose, velocity and acceleration. The quaternion is divided by its
//! length afterwards; from rest to rest this is the normalised linear interpolation. Its angular
//! velocity `2 Im(p' p*) / |p|^2` is exact, because the length only adds a real part. No
//! trigonometric function is needed.
//!
//! The derivatives of a quintic follow in closed form from `D = 5 ((p1 - p0) - (v0 + v1)/2)`,
//! `S = (v1 - v0)/2` and `m = 5 (p1 - p0) - 2 (v0 + v1)`:
//!
//! ```text
//! |p'|   <= max(V, 5/8 V + 3/8 |m|),  V = max(|v0|, |v1|)       15/8 d from rest to rest
//! |p''|  <= 3 |S| + 2/sqrt(3) |D|                               10/sqrt(3) d
//! |p'''| <= 12 (|S| + |D|)                                      60 d
//! ```
//!
//! and are equalities from rest to rest. With `w = |p'|/r`, `a = |p''|/r`, `j = |p'''|/r` and `r`
//! the least length of the quaternion, the angular velocity and its derivatives are at most `2 w`,
//! `2 (a + w^2)` and `2 (j + 3 a w + 2 w^3)`.

use nalgebra::{Quaternion, SVector, UnitQuaternion, Vector3, Vector4};

use crate::{GeometryFault, Pose, Real, Scalar, SetPoint, Twist};

/// Where the platform stands: what a [`Pose`] is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance<T: Scalar> {
    /// Position of the platform origin, world frame, m.
    pub position_m: Vector3<T>,
    /// Orientation, platform to world.
    pub orientation: UnitQuaternion<T>,
}

impl<T: Real> Stance<T> {
    /// The pose.
    ///
    /// # Errors
    /// [`GeometryFault::InvalidPose`].
    pub fn pose(&self) -> Result<Pose<T>, GeometryFault> {
        Pose::new(self.position_m, self.orientation)
    }
}

/// How fast a way-point is to be reached.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Pace<T> {
    /// In this time, s, rounded to whole ticks (one at least).
    Duration(T),
    /// As fast as the limits allow, times this share, above 0 and at most 1. Only from rest to rest.
    Share(T),
}

/// A coarse set-point: the next pose on the way, reached by one quintic from the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WayPoint<T: Scalar> {
    /// Where.
    pub stance: Stance<T>,
    /// How fast the platform moves when it is there; zero to stop. When no other way-point follows
    /// a moving one in time, the platform runs out straight ahead.
    pub twist: Twist<T>,
    /// How fast it is reached.
    pub pace: Pace<T>,
}

impl<T: Real> WayPoint<T> {
    /// A way-point to stop at.
    pub fn stop(stance: Stance<T>, pace: Pace<T>) -> Self {
        Self { stance, twist: Twist::none(), pace }
    }
}

/// What a motion may need at most, all positive.
///
/// Way-points are rounded to the number type, and short motions feel it: 1e-6 m of rounding in
/// 10 ms is 60 m/s^3 of jerk.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionLimits<T> {
    /// Distance between two way-points, m: what is further was not meant.
    pub distance_m: T,
    /// Speed of the platform origin, m/s.
    pub speed_m_s: T,
    /// Acceleration of the platform origin, m/s^2.
    pub acceleration_m_s2: T,
    /// Jerk of the platform origin, m/s^3.
    pub jerk_m_s3: T,
    /// Angular speed, rad/s.
    pub turn_speed_rad_s: T,
    /// Angular acceleration, rad/s^2.
    pub turn_acceleration_rad_s2: T,
    /// Angular jerk, rad/s^3.
    pub turn_jerk_rad_s3: T,
}

impl<T: Real> MotionLimits<T> {
    pub(super) fn are_positive(&self) -> bool {
        [
            self.distance_m,
            self.speed_m_s,
            self.acceleration_m_s2,
            self.jerk_m_s3,
            self.turn_speed_rad_s,
            self.turn_acceleration_rad_s2,
            self.turn_jerk_rad_s3,
        ]
        .iter()
        .all(|&limit| is_positive(limit))
    }
}

/// Why a way-point is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MotionFault<T> {
    /// A number is infinite or NaN, or too large to reckon with.
    NonFinite,
    /// The quaternion has no unit length.
    NotARotation,
    /// The duration or share is not positive, or the share is above 1.
    InvalidPace,
    /// It lies further from the last way-point than allowed.
    TooFar {
        /// The distance, m.
        distance_m: T,
    },
    /// It turns the platform by more than 90 degrees, or the turn overshoots as much.
    TurnsTooFar,
    /// Speed, acceleration or jerk would exceed a limit.
    TooFast {
        /// The time there is, s.
        duration_s: T,
    },
    /// It would take longer than 2^24 ticks.
    TooLong,
    /// A share of the limits is asked for, but the motion does not begin and end at rest.
    NeedsDuration,
}

impl<T: core::fmt::Display> core::fmt::Display for MotionFault<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NonFinite => f.write_str("a number of the way-point is not finite"),
            Self::NotARotation => f.write_str("the quaternion of the way-point is not a rotation"),
            Self::InvalidPace => f.write_str("the duration or share is not positive, or above 1"),
            Self::TooFar { distance_m } => write!(f, "the way-point is {distance_m} m away"),
            Self::TurnsTooFar => f.write_str("the way-point turns the platform above 90 degrees"),
            Self::TooFast { duration_s } => write!(f, "beyond the limits in {duration_s} s"),
            Self::TooLong => f.write_str("the motion takes more than 2^24 ticks"),
            Self::NeedsDuration => f.write_str("a motion not from rest to rest needs a duration"),
        }
    }
}

impl<T: core::fmt::Debug + core::fmt::Display> core::error::Error for MotionFault<T> {}

/// Least length of the quaternion before it is divided by it, for rates that make it overshoot.
const LEAST_LENGTH: f64 = 0.5;
/// Cosine of half of 90 degrees, and what rounding adds to it.
const COS_HALF_LARGEST_TURN: f64 = core::f64::consts::FRAC_1_SQRT_2;
const TURN_ROUNDING: f64 = 4.0;
/// Ticks are counted in what every number type represents exactly.
const TICK_BITS: u32 = 24;

/// The way from one stance to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T: Scalar> {
    position_m: Quintic<T, 3>,
    quaternion: Quintic<T, 4>,
    ticks: u32,
    per_duration_s: T,
}

impl<T: Real> Motion<T> {
    /// From `start`, moving with `twist`, to `end`.
    ///
    /// # Errors
    /// [`MotionFault`]. Cost: some 300 operations, nine square roots, no loop with a variable bound.
    pub fn new(
        start: &Stance<T>,
        twist: &Twist<T>,
        end: &WayPoint<T>,
        limits: &MotionLimits<T>,
        period_s: T,
    ) -> Result<Self, MotionFault<T>> {
        check(start, twist)?;
        check(&end.stance, &end.twist)?;
        let chord_m = end.stance.position_m - start.position_m;
        let distance_m = length(&chord_m);
        let near = distance_m <= limits.distance_m;
        if !near {
            return Err(MotionFault::TooFar { distance_m });
        }
        let from = start.orientation.as_ref().coords;
        let mut to = end.stance.orientation.as_ref().coords;
        if dot(&from, &to) < T::zero() {
            to = -to; // the same orientation, the shorter way
        }
        let cosine = dot(&from, &to);
        let least_cosine =
            T::constant(COS_HALF_LARGEST_TURN) - T::constant(TURN_ROUNDING) * T::EPSILON;
        if cosine < least_cosine {
            return Err(MotionFault::TurnsTooFar);
        }
        let chord_length = ((T::one() + cosine) * T::constant(0.5)).sqrt();

        let (from_rate, to_rate) =
            (quaternion_rate(twist, &from), quaternion_rate(&end.twist, &to));
        let over = |duration_s: T| Self {
            position_m: Quintic {
                start: start.position_m,
                chord: chord_m,
                start_rate: twist.linear_m_s * duration_s,
                end_rate: end.twist.linear_m_s * duration_s,
            },
            quaternion: Quintic {
                start: from,
                chord: to - from,
                start_rate: from_rate * duration_s,
                end_rate: to_rate * duration_s,
            },
            ticks: 1,
            per_duration_s: T::one(),
        };
        let ticks = match end.pace {
            Pace::Duration(duration_s) => {
                if !is_positive(duration_s) {
                    return Err(MotionFault::InvalidPace);
                }
                // Half a tick added: to the nearest.
                whole_ticks(duration_s / period_s + T::constant(0.5))?
            }
            Pace::Share(share) => {
                if !is_positive(share) || share > T::one() {
                    return Err(MotionFault::InvalidPace);
                }
                if is_moving(twist) || is_moving(&end.twist) {
                    return Err(MotionFault::NeedsDuration);
                }
                let shortest_s = over(T::one()).shortest_s(chord_length, limits);
                whole_ticks(shortest_s / (share * period_s) + T::one())?
            }
        };
        let duration_s = T::constant(f64::from(ticks)) * period_s;
        let motion = Self { ticks, per_duration_s: T::one() / duration_s, ..over(duration_s) };
        // The rate basis h reaches 16/81 at u = 1/3.
        let overshoot = (length(&motion.quaternion.start_rate)
            + length(&motion.quaternion.end_rate))
            * T::constant(16.0 / 81.0);
        let least_length = chord_length - overshoot;
        let stays_a_rotation = least_length >= T::constant(LEAST_LENGTH);
        if !stays_a_rotation {
            return Err(MotionFault::TurnsTooFar);
        }
        // `shortest_s` is in units of the duration that its rates belong to.
        let rounding = T::one() + T::constant(16.0) * T::EPSILON;
        let slow_enough = motion.shortest_s(least_length, limits) <= duration_s * rounding;
        if slow_enough { Ok(motion) } else { Err(MotionFault::TooFast { duration_s }) }
    }

    /// From `start`, moving with `twist`, straight on to rest: half the twist times the duration.
    ///
    /// Acceleration and jerk stay within the limits, those of the turn to first order in its angle,
    /// unless that took longer than 2^24 ticks. `start` and `twist` are those of a motion.
    #[must_use]
    pub fn run_out(
        start: &Stance<T>,
        twist: &Twist<T>,
        limits: &MotionLimits<T>,
        period_s: T,
    ) -> Self {
        // p'' = 12 u (1 - u) S and p''' = 12 (1 - 2 u) S with S = -v0/2.
        let needed_s = |speed: T, acceleration: T, jerk: T| {
            (T::constant(1.5) * speed / acceleration).max((T::constant(6.0) * speed / jerk).sqrt())
        };
        let (speed, turn_speed) = (length(&twist.linear_m_s), length(&twist.angular_rad_s));
        let shortest_s = needed_s(speed, limits.acceleration_m_s2, limits.jerk_m_s3).max(needed_s(
            turn_speed,
            limits.turn_acceleration_rad_s2,
            limits.turn_jerk_rad_s3,
        ));
        let ticks = whole_ticks(shortest_s / period_s + T::one()).unwrap_or(1 << TICK_BITS);
        let duration_s = T::constant(f64::from(ticks)) * period_s;
        let quaternion = start.orientation.as_ref().coords;
        let rate = quaternion_rate(twist, &quaternion) * duration_s;
        Self {
            position_m: Quintic::run_out(start.position_m, twist.linear_m_s * duration_s),
            quaternion: Quintic::run_out(quaternion, rate),
            ticks,
            per_duration_s: T::one() / duration_s,
        }
    }

    /// Ticks it takes, one at least.
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Where the platform is, and how fast, after the share `u` of the duration, from 0 to 1.
    ///
    /// The twist is the exact derivative of the stance. Cost: some 100 operations and a square root.
    pub fn at(&self, u: T) -> (Stance<T>, Twist<T>) {
        let (position_m, velocity) = self.position_m.at(u);
        let (quaternion, rate) = self.quaternion.at(u);
        let norm_sq = dot(&quaternion, &quaternion);
        let unit = quaternion * (T::one() / norm_sq.sqrt());
        let (w, v) = (quaternion.w, quaternion.xyz());
        // The imaginary part of p' p*.
        let turning = rate.xyz() * w - v * rate.w + v.cross(&rate.xyz());
        let two = T::constant(2.0) * self.per_duration_s / norm_sq;
        (
            Stance {
                position_m,
                orientation: UnitQuaternion::new_unchecked(Quaternion::from_vector(unit)),
            },
            Twist { linear_m_s: velocity * self.per_duration_s, angular_rad_s: turning * two },
        )
    }

    /// The same as a set-point, with the motion's own time running at `speed` (1: as planned).
    ///
    /// # Errors
    /// [`GeometryFault::InvalidPose`].
    pub fn set_point(&self, u: T, speed: T) -> Result<(Stance<T>, SetPoint<T>), GeometryFault> {
        let (stance, twist) = self.at(u);
        let twist = Twist {
            linear_m_s: twist.linear_m_s * speed,
            angular_rad_s: twist.angular_rad_s * speed,
        };
        Ok((stance, SetPoint { pose: stance.pose()?, twist }))
    }

    /// Whether the platform still moves at its end.
    pub fn passes_through(&self) -> bool {
        !(is_zero(&self.position_m.end_rate) && is_zero(&self.quaternion.end_rate))
    }

    /// The shortest time with the same curve and rates over the duration, s.
    fn shortest_s(&self, least_length: T, limits: &MotionLimits<T>) -> T {
        let two = T::constant(2.0);
        let [w, a, j] = self.quaternion.peaks().map(|peak| peak / least_length);
        let [speed, acceleration, jerk] = self.position_m.peaks();
        let turn_speed = two * w;
        let turn_acceleration = two * (a + w * w);
        let turn_jerk = two * (j + T::constant(3.0) * a * w + two * w * w * w);
        (speed / limits.speed_m_s)
            .max(turn_speed / limits.turn_speed_rad_s)
            .max((acceleration / limits.acceleration_m_s2).sqrt())
            .max((turn_acceleration / limits.turn_acceleration_rad_s2).sqrt())
            .max(cbrt((jerk / limits.jerk_m_s3).max(turn_jerk / limits.turn_jerk_rad_s3)))
    }
}

/// A quintic with rates over its duration, and no second derivative, at its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Quintic<T: Scalar, const D: usize> {
    start: SVector<T, D>,
    chord: SVector<T, D>,
    start_rate: SVector<T, D>,
    end_rate: SVector<T, D>,
}

impl<T: Real, const D: usize> Quintic<T, D> {
    /// Straight on to rest.
    fn run_out(start: SVector<T, D>, start_rate: SVector<T, D>) -> Self {
        Self { start, chord: start_rate * T::constant(0.5), start_rate, end_rate: SVector::zeros() }
    }

    /// Value and derivative.
    fn at(&self, u: T) -> (SVector<T, D>, SVector<T, D>) {
        let (s, ds) = smooth_step(u);
        let (h0, dh0) = rate_basis(u);
        let (h1, dh1) = rate_basis(T::one() - u);
        (
            self.start + self.chord * s + self.start_rate * h0 - self.end_rate * h1,
            self.chord * ds + self.start_rate * dh0 + self.end_rate * dh1,
        )
    }

    /// Bounds of the first three derivatives.
    fn peaks(&self) -> [T; 3] {
        let c = T::constant;
        let mean = (self.start_rate + self.end_rate) * c(0.5);
        let d = length(&((self.chord - mean) * c(5.0)));
        let s = length(&((self.end_rate - self.start_rate) * c(0.5)));
        let m = length(&(self.chord * c(5.0) - mean * c(4.0)));
        let ends = length(&self.start_rate).max(length(&self.end_rate));
        [
            ends.max(ends * c(5.0 / 8.0) + m * c(3.0 / 8.0)),
            s * c(3.0) + d * c(1.154_700_538_379_251_5), // 2 / sqrt(3)
            (s + d) * c(12.0),
        ]
    }
}

/// From 0 to 1 with no velocity and acceleration at the ends: value and derivative.
pub(super) fn smooth_step<T: Real>(u: T) -> (T, T) {
    let c = T::constant;
    let rest = T::one() - u;
    (u * u * u * (c(10.0) - u * (c(15.0) - u * c(6.0))), c(30.0) * u * u * rest * rest)
}

/// `u (1 - u)^3 (1 + 3 u)`: slope 1 at the start, and its derivative.
fn rate_basis<T: Real>(u: T) -> (T, T) {
    let (one, three, five) = (T::one(), T::constant(3.0), T::constant(5.0));
    let rest = one - u;
    let rest_sq = rest * rest;
    (u * rest * rest_sq * (one + three * u), rest_sq * (one - three * u) * (one + five * u))
}

/// `1/2 omega q`.
fn quaternion_rate<T: Real>(twist: &Twist<T>, q: &Vector4<T>) -> Vector4<T> {
    let half = twist.angular_rad_s * T::constant(0.5);
    let v = half * q.w + half.cross(&q.xyz());
    Vector4::new(v.x, v.y, v.z, -dot(&half, &q.xyz()))
}

fn check<T: Real>(stance: &Stance<T>, twist: &Twist<T>) -> Result<(), MotionFault<T>> {
    // Squares that overflow are as bad as infinities: no sum of them hides one.
    let q = &stance.orientation.as_ref().coords;
    let squares = dot(&stance.position_m, &stance.position_m)
        + dot(&twist.linear_m_s, &twist.linear_m_s)
        + dot(&twist.angular_rad_s, &twist.angular_rad_s)
        + dot(q, q);
    if !squares.is_finite() {
        Err(MotionFault::NonFinite)
    } else if stance.pose().is_err() {
        Err(MotionFault::NotARotation)
    } else {
        Ok(())
    }
}

fn is_moving<T: Real>(twist: &Twist<T>) -> bool {
    !(is_zero(&twist.linear_m_s) && is_zero(&twist.angular_rad_s))
}

fn is_zero<T: Real, const D: usize>(a: &SVector<T, D>) -> bool {
    a.iter().all(T::is_zero)
}

/// False for NaN and infinities.
pub(super) fn is_positive<T: Real>(x: T) -> bool {
    x > T::zero() && x <= T::HUGE
}

/// The whole part of a number, one at least, bit by bit: exact, and the number types have no cast.
pub(super) fn whole_ticks<T: Real>(x: T) -> Result<u32, MotionFault<T>> {
    let mut ticks = 0;
    for bit in (0..TICK_BITS).rev() {
        let more = ticks | 1 << bit;
        if T::constant(f64::from(more)) <= x {
            ticks = more;
        }
    }
    let fits = x < T::constant(f64::from(1_u32 << TICK_BITS));
    if fits { Ok(ticks.max(1)) } else { Err(MotionFault::TooLong) }
}

/// Cube root of a number that is not negative, never too small: Newton's method comes from above.
fn cbrt<T: Real>(x: T) -> T {
    if !is_positive(x) {
        return x; // zero; infinity and NaN are refused by the caller
    }
    let third = T::constant(1.0 / 3.0);
    let mut root = x.rough_cbrt();
    // 5e-2, 3e-3, 7e-6, 5e-11, 3e-21
    for _ in 0..4 {
        root = root - (root - x / (root * root)) * third;
    }
    root * (T::one() + T::EPSILON)
}

fn dot<T: Real, const D: usize>(a: &SVector<T, D>, b: &SVector<T, D>) -> T {
    a.iter().zip(b.iter()).fold(T::zero(), |sum, (&a, &b)| sum + a * b)
}

fn length<T: Real, const D: usize>(a: &SVector<T, D>) -> T {
    dot(a, a).sqrt()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    pub(in crate::controller) fn limits<T: Real>() -> MotionLimits<T> {
        MotionLimits {
            distance_m: T::constant(10.0),
            speed_m_s: T::constant(0.5),
            acceleration_m_s2: T::constant(1.0),
            jerk_m_s3: T::constant(10.0),
            turn_speed_rad_s: T::constant(0.5),
            turn_acceleration_rad_s2: T::constant(1.0),
            turn_jerk_rad_s3: T::constant(10.0),
        }
    }

    fn stance(position: [f64; 3], rotation: [f64; 3]) -> Stance<f64> {
        Stance {
            position_m: position.into(),
            orientation: UnitQuaternion::from_scaled_axis(Vector3::from(rotation)),
        }
    }

    fn twist(linear: [f64; 3], angular: [f64; 3]) -> Twist<f64> {
        Twist { linear_m_s: linear.into(), angular_rad_s: angular.into() }
    }

    /// Velocities from stances on both sides: the rotation between them by nalgebra's logarithm.
    fn difference(before: &Stance<f64>, after: &Stance<f64>, time_s: f64) -> Twist<f64> {
        let turn = after.orientation * before.orientation.inverse();
        Twist {
            linear_m_s: (after.position_m - before.position_m) / time_s,
            angular_rad_s: turn.scaled_axis() / time_s,
        }
    }

    fn norms(twist: &Twist<f64>) -> [f64; 2] {
        [length(&twist.linear_m_s), length(&twist.angular_rad_s)]
    }

    fn minus(a: &Twist<f64>, b: &Twist<f64>) -> Twist<f64> {
        Twist {
            linear_m_s: a.linear_m_s - b.linear_m_s,
            angular_rad_s: a.angular_rad_s - b.angular_rad_s,
        }
    }

    fn moving() -> (Stance<f64>, Twist<f64>, WayPoint<f64>) {
        let end = WayPoint {
            stance: stance([1.4, 2.3, 2.9], [0.3, -0.2, 0.8]),
            twist: twist([0.2, -0.1, 0.05], [-0.1, 0.2, 0.15]),
            pace: Pace::Duration(4.0),
        };
        (stance([1.0, 2.0, 3.0], [0.1, -0.4, 0.6]), twist([0.1, 0.2, -0.1], [0.2, 0.0, -0.1]), end)
    }

    fn motions() -> [Motion<f64>; 3] {
        let (start, velocity, end) = moving();
        let quarter_turn = stance([1.5, 2.0, 3.0], [0.0, core::f64::consts::FRAC_PI_2, 0.0]);
        [
            Motion::new(&start, &velocity, &end, &limits(), PERIOD_S).unwrap(),
            Motion::new(
                &stance([1.0, 2.0, 3.0], [0.0; 3]),
                &Twist::none(),
                &WayPoint::stop(quarter_turn, Pace::Share(1.0)),
                &limits(),
                PERIOD_S,
            )
            .unwrap(),
            Motion::run_out(&start, &velocity, &limits(), PERIOD_S),
        ]
    }

    #[test]
    fn the_twist_is_the_derivative_of_the_stance() {
        // Central differences: h^2/6 times the third derivative, some 50/s^3 over a duration of a
        // second or more, and rounding 1e-16/h.
        let h = 1e-5;
        for motion in motions() {
            let duration_s = f64::from(motion.ticks()) * PERIOD_S;
            for k in 1..100 {
                let u = f64::from(k) / 100.0;
                let (before, after) = (motion.at(u - h).0, motion.at(u + h).0);
                let expected = difference(&before, &after, 2.0 * h * duration_s);
                let error = norms(&minus(&motion.at(u).1, &expected));
                assert!(error[0] < 1e-8 && error[1] < 1e-8, "{u}: {error:?}");
            }
        }
    }

    #[test]
    fn f32_moves_like_f64() {
        let (start, velocity, end) = moving();
        let single = |s: &Stance<f64>| Stance {
            position_m: s.position_m.cast::<f32>(),
            orientation: s.orientation.cast::<f32>(),
        };
        let single_twist = |t: &Twist<f64>| Twist {
            linear_m_s: t.linear_m_s.cast::<f32>(),
            angular_rad_s: t.angular_rad_s.cast::<f32>(),
        };
        let exact = Motion::new(&start, &velocity, &end, &limits(), PERIOD_S).unwrap();
        let way_point = WayPoint {
            stance: single(&end.stance),
            twist: single_twist(&end.twist),
            pace: Pace::Duration(4.0),
        };
        let motion =
            Motion::new(&single(&start), &single_twist(&velocity), &way_point, &limits(), 1e-3_f32)
                .unwrap();
        assert_eq!(motion.ticks(), exact.ticks());
        for k in 0..=64_u8 {
            let (stance, twist) = motion.at(f32::from(k) / 64.0);
            let (stance64, twist64) = exact.at(f64::from(k) / 64.0);
            // A few rounding units of 3 m.
            assert!((stance.position_m.cast::<f64>() - stance64.position_m).amax() < 1e-6);
            assert!(stance.orientation.cast::<f64>().angle_to(&stance64.orientation) < 1e-6);
            assert!((twist.linear_m_s.cast::<f64>() - twist64.linear_m_s).amax() < 1e-6);
            assert!((twist.angular_rad_s.cast::<f64>() - twist64.angular_rad_s).amax() < 1e-6);
        }
    }

    #[test]
    fn limits_hold_and_are_reached_from_rest_to_rest() {
        let h = 1e-4;
        let mut largest = [[0.0_f64; 6]; 3];
        for (motion, largest) in motions().iter().zip(&mut largest) {
            let step_s = h * f64::from(motion.ticks()) * PERIOD_S;
            for k in 1..1000 {
                let u = f64::from(k) * 1e-3;
                let [before, now, after] = [u - h, u, u + h].map(|u| motion.at(u).1);
                let acceleration = norms(&minus(&after, &before)).map(|a| a / (2.0 * step_s));
                let jerk = norms(&minus(&minus(&after, &now), &minus(&now, &before)))
                    .map(|j| j / (step_s * step_s));
                let now = norms(&now);
                let all = [now[0], acceleration[0], jerk[0], now[1], acceleration[1], jerk[1]];
                for (largest, value) in largest.iter_mut().zip(all) {
                    *largest = largest.max(value);
                }
            }
        }
        let allowed = [0.5, 1.0, 10.0, 0.5, 1.0, 10.0];
        for peaks in largest {
            for (peak, allowed) in peaks.iter().zip(allowed) {
                assert!(*peak <= allowed * 1.001, "{peaks:?}"); // differences
            }
        }
        // The quarter turn is held up by its angular speed, the run-out by its jerk.
        assert!(largest[1][3] > 0.499, "{:?}", largest[1]);
        assert!(largest[2][5] > 9.8 || largest[2][2] > 9.8, "{:?}", largest[2]);
    }

    #[test]
    fn each_limit_sets_the_duration_by_its_formula() {
        let start = stance([0.0; 3], [0.0; 3]);
        let end = WayPoint::stop(stance([0.0, 0.6, 0.8], [0.0; 3]), Pace::Share(0.5));
        let duration = |limits: MotionLimits<f64>| {
            f64::from(Motion::new(&start, &Twist::none(), &end, &limits, PERIOD_S).unwrap().ticks())
                * PERIOD_S
        };
        let high = MotionLimits {
            speed_m_s: 1e6,
            acceleration_m_s2: 1e6,
            jerk_m_s3: 1e6,
            ..limits::<f64>()
        };
        for (limits, expected_s) in [
            (MotionLimits { speed_m_s: 0.5, ..high }, 15.0 / 8.0 / 0.5),
            (
                MotionLimits { acceleration_m_s2: 0.5, ..high },
                libm::sqrt(10.0 / libm::sqrt(3.0) / 0.5),
            ),
            (MotionLimits { jerk_m_s3: 0.5, ..high }, libm::cbrt(60.0 / 0.5)),
        ] {
            // Half the speed; rounded up to a tick.
            let excess_s = duration(limits) - 2.0 * expected_s;
            assert!((0.0..=PERIOD_S * 1.01).contains(&excess_s), "{excess_s}");
        }
    }

    #[test]
    fn motions_in_a_row_are_smooth() {
        let (start, velocity, middle) = moving();
        let first = Motion::new(&start, &velocity, &middle, &limits(), PERIOD_S).unwrap();
        let (at_middle, speed) = first.at(1.0);
        assert!((at_middle.position_m - middle.stance.position_m).amax() < 1e-15);
        assert!(at_middle.orientation.angle_to(&middle.stance.orientation) < 1e-7); // acos near 1
        let error = norms(&minus(&speed, &middle.twist));
        assert!(error[0] < 1e-15 && error[1] < 1e-15, "{error:?}");
        let end = WayPoint::stop(stance([1.7, 2.2, 3.0], [0.3, 0.3, 1.0]), Pace::Duration(2.0));
        let second = Motion::new(&at_middle, &speed, &end, &limits(), PERIOD_S).unwrap();
        // No acceleration on either side: the twist changes with the square of the time.
        for h in [1e-2, 1e-3] {
            for side in [first.at(1.0 - h).1, second.at(h).1] {
                let change = norms(&minus(&side, &speed));
                assert!(change[0] < 20.0 * h * h && change[1] < 20.0 * h * h, "{h}: {change:?}");
            }
        }
        let (_, at_end) = second.at(1.0);
        assert_eq!(at_end, Twist::none());
        assert!(!second.passes_through() && first.passes_through());
    }

    #[test]
    fn turns_go_the_shorter_way_and_not_above_a_quarter() {
        let start = stance([0.0; 3], [0.0; 3]);
        let to = |angle: f64| WayPoint::stop(stance([0.0; 3], [0.0, 0.0, angle]), Pace::Share(1.0));
        let motion =
            |end: &WayPoint<f64>| Motion::new(&start, &Twist::none(), end, &limits(), PERIOD_S);
        assert!(motion(&to(core::f64::consts::FRAC_PI_2)).is_ok());
        assert_eq!(motion(&to(1.571)), Err(MotionFault::TurnsTooFar));
        assert_eq!(motion(&to(3.0)), Err(MotionFault::TurnsTooFar));
        let mut other_sign = to(0.8);
        let q = other_sign.stance.orientation.into_inner();
        other_sign.stance.orientation = UnitQuaternion::new_unchecked(-q);
        assert_eq!(motion(&other_sign), motion(&to(0.8)));
        // No turn, but rates that would turn it over on the way.
        let spin = twist([0.0; 3], [0.0, 0.0, 0.4]);
        let back = WayPoint { twist: spin, pace: Pace::Duration(20.0), ..to(0.0) };
        assert_eq!(
            Motion::new(&start, &spin, &back, &limits(), PERIOD_S),
            Err(MotionFault::TurnsTooFar)
        );
    }

    #[test]
    fn bad_way_points_are_refused() {
        let start = stance([0.0; 3], [0.0; 3]);
        let good = WayPoint::stop(stance([0.1, 0.0, 0.0], [0.0; 3]), Pace::Duration(2.0));
        let motion =
            |end: &WayPoint<f64>| Motion::new(&start, &Twist::none(), end, &limits(), PERIOD_S);
        assert!(motion(&good).is_ok());
        for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e200] {
            let mut end = good;
            end.stance.position_m.y = bad;
            assert_eq!(motion(&end), Err(MotionFault::NonFinite));
            let mut end = good;
            end.twist.angular_rad_s.x = bad;
            assert_eq!(motion(&end), Err(MotionFault::NonFinite));
            let mut end = good;
            end.stance.orientation =
                UnitQuaternion::new_unchecked(Quaternion::new(bad, 0.0, 0.0, 0.0));
            assert_eq!(motion(&end), Err(MotionFault::NonFinite));
        }
        let mut end = good;
        end.stance.orientation = UnitQuaternion::new_unchecked(Quaternion::new(0.9, 0.0, 0.0, 0.0));
        assert_eq!(motion(&end), Err(MotionFault::NotARotation));
        for pace in [
            Pace::Duration(0.0),
            Pace::Duration(-1.0),
            Pace::Duration(f64::NAN),
            Pace::Duration(f64::INFINITY),
            Pace::Share(0.0),
            Pace::Share(1.1),
            Pace::Share(f64::NAN),
        ] {
            assert_eq!(motion(&WayPoint { pace, ..good }), Err(MotionFault::InvalidPace));
        }
        for pace in [Pace::Duration(1e6), Pace::Share(1e-30)] {
            assert_eq!(motion(&WayPoint { pace, ..good }), Err(MotionFault::TooLong));
        }
        let fast = WayPoint { pace: Pace::Duration(0.1), ..good };
        assert_eq!(motion(&fast), Err(MotionFault::TooFast { duration_s: 0.1 }));
        let mut far = good;
        far.stance.position_m.x = 10.1;
        assert_eq!(motion(&far), Err(MotionFault::TooFar { distance_m: 10.1 }));
        let mut passing = WayPoint { pace: Pace::Share(1.0), ..good };
        passing.twist.linear_m_s.x = 0.1;
        assert_eq!(motion(&passing), Err(MotionFault::NeedsDuration));
    }

    #[test]
    fn whole_parts_are_exact() {
        for (x, expected) in
            [(0.0, 1), (0.9, 1), (1.0, 1), (2.999, 2), (3.0, 3), (16_777_215.9, 16_777_215)]
        {
            assert_eq!(whole_ticks(x), Ok(expected));
        }
        for x in [16_777_216.0, f64::INFINITY, f64::NAN] {
            assert_eq!(whole_ticks(x), Err(MotionFault::TooLong));
        }
    }
}
