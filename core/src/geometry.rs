//! Robot geometry and pose: where the cables start, where they hold the platform, and the vertical
//! plane each of them hangs in.

use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};

use crate::{CABLES, Real, Scalar};

/// One cable: where it starts, where it holds the platform, and what it is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cable<T: Scalar, M> {
    /// Anchor `A`: where the cable leaves its winch, world frame, m.
    pub anchor_m: Vector3<T>,
    /// Attachment `b`: where the cable holds the platform, platform frame, m.
    pub attachment_m: Vector3<T>,
    /// The cable model with its parameters.
    pub model: M,
}

/// Six cables and the length by which moments are made comparable with forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robot<T: Scalar, M> {
    cables: [Cable<T, M>; CABLES],
    moment_arm_m: T,
    /// `1 / moment_arm_m`, because it is needed at every pose.
    per_moment_arm_m: T,
}

/// Why a geometry or a pose is refused. Cables are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum GeometryFault {
    /// A coordinate of this cable is infinite or NaN.
    NonFiniteCable(usize),
    /// Two cables leave from the same anchor: their planes cannot be told apart by the winches.
    CoincidentAnchors(usize, usize),
    /// All attachments lie on one line, about which no set of cables can balance a moment.
    CollinearAttachments,
    /// A coordinate of the pose is infinite or NaN, or its quaternion is not of unit length.
    InvalidPose,
    /// At this pose the attachment of this cable lies on its anchor.
    AttachmentOnAnchor(usize),
}

impl core::fmt::Display for GeometryFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NonFiniteCable(i) => write!(f, "cable {}: a coordinate is not finite", i + 1),
            Self::CoincidentAnchors(i, j) => {
                write!(f, "cables {} and {} leave from the same anchor", i + 1, j + 1)
            }
            Self::CollinearAttachments => write!(f, "all attachments lie on one line"),
            Self::InvalidPose => {
                write!(f, "the pose is not finite or its quaternion not a rotation")
            }
            Self::AttachmentOnAnchor(i) => {
                write!(f, "cable {}: at this pose the attachment lies on the anchor", i + 1)
            }
        }
    }
}

impl core::error::Error for GeometryFault {}

impl<T: Real, M> Robot<T, M> {
    /// Checks the geometry and fixes the moment arm, the largest distance of an attachment from
    /// the platform origin.
    ///
    /// # Errors
    /// [`GeometryFault`] when a coordinate is not finite, two anchors coincide, or the attachments
    /// are collinear. Shared attachments are allowed: the paper's robot has two such pairs.
    pub fn new(cables: [Cable<T, M>; CABLES]) -> Result<Self, GeometryFault> {
        let mut moment_arm_sq = T::zero();
        for (i, cable) in cables.iter().enumerate() {
            let finite = |v: &Vector3<T>| v.iter().all(|c| c.is_finite());
            if !finite(&cable.anchor_m) || !finite(&cable.attachment_m) {
                return Err(GeometryFault::NonFiniteCable(i));
            }
            for (j, other) in cables.iter().enumerate().skip(i + 1) {
                if cable.anchor_m == other.anchor_m {
                    return Err(GeometryFault::CoincidentAnchors(i, j));
                }
            }
            moment_arm_sq = moment_arm_sq.max(dot(&cable.attachment_m, &cable.attachment_m));
        }
        let moment_arm_m = moment_arm_sq.sqrt();
        let robot = Self { cables, moment_arm_m, per_moment_arm_m: T::one() / moment_arm_m };
        if robot.attachments_are_collinear() {
            Err(GeometryFault::CollinearAttachments)
        } else {
            Ok(robot)
        }
    }

    fn attachments_are_collinear(&self) -> bool {
        let from_first = |i: usize| self.cables[i].attachment_m - self.cables[0].attachment_m;
        // The longest of the differences fixes the line; an offset of rounding size is on it.
        let mut line = from_first(1);
        for i in 2..CABLES {
            let other = from_first(i);
            if dot(&other, &other) > dot(&line, &line) {
                line = other;
            }
        }
        let area = dot(&line, &line) * T::EPSILON * T::constant(8.0);
        (1..CABLES).all(|i| {
            let normal = line.cross(&from_first(i));
            dot(&normal, &normal) <= area * area
        })
    }
}

impl<T: Scalar, M> Robot<T, M> {
    /// The six cables.
    pub fn cables(&self) -> &[Cable<T, M>; CABLES] {
        &self.cables
    }

    /// The length by which moments are divided before they stand beside forces, m.
    pub fn moment_arm_m(&self) -> T {
        self.moment_arm_m
    }

    /// The reciprocal of [`Robot::moment_arm_m`], 1/m.
    pub(crate) fn per_moment_arm_m(&self) -> T {
        self.per_moment_arm_m
    }

    /// The same geometry with other cable models, made from the present ones.
    pub fn map_models<N>(&self, map: impl Fn(usize, &M) -> N) -> Robot<T, N> {
        let cables = core::array::from_fn(|i| {
            let cable = &self.cables[i];
            Cable {
                anchor_m: cable.anchor_m,
                attachment_m: cable.attachment_m,
                model: map(i, &cable.model),
            }
        });
        let Self { moment_arm_m, per_moment_arm_m, .. } = *self;
        Robot { cables, moment_arm_m, per_moment_arm_m }
    }
}

/// Pose of the platform: position of its origin and orientation of its axes, in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<T: Scalar> {
    position_m: Vector3<T>,
    rotation: Matrix3<T>,
}

impl<T: Real> Pose<T> {
    /// A pose from position (world frame, m) and orientation (platform to world).
    ///
    /// # Errors
    /// [`GeometryFault::InvalidPose`] when a number is not finite or the quaternion has no unit
    /// length within the square root of the rounding unit (one can be made without a check).
    pub fn new(
        position_m: Vector3<T>,
        orientation: UnitQuaternion<T>,
    ) -> Result<Self, GeometryFault> {
        let (w, i, j, k) = {
            let q = &orientation.as_ref().coords;
            (q.w, q.x, q.y, q.z)
        };
        let norm_sq = w * w + i * i + j * j + k * k;
        let close = (norm_sq - T::one()).abs() <= T::EPSILON.sqrt(); // false for NaN
        if !close || !position_m.iter().all(|c| c.is_finite()) {
            return Err(GeometryFault::InvalidPose);
        }
        // nalgebra's conversion asks for its RealField, which the scalar seam does not. Dividing by
        // the norm keeps the matrix orthonormal to rounding.
        let two = T::constant(2.0) / norm_sq;
        let one = T::one();
        let rotation = Matrix3::new(
            one - two * (j * j + k * k),
            two * (i * j - w * k),
            two * (i * k + w * j),
            two * (i * j + w * k),
            one - two * (i * i + k * k),
            two * (j * k - w * i),
            two * (i * k - w * j),
            two * (j * k + w * i),
            one - two * (i * i + j * j),
        );
        Ok(Self { position_m, rotation })
    }
}

impl<T: Real> Pose<T> {
    /// The pose with a position (world frame, m) and a [`Pose::turn_vector`].
    ///
    /// # Errors
    /// [`GeometryFault::InvalidPose`] when a number is not finite or the vector is as long as 1.
    pub fn with_turn_vector(
        position_m: Vector3<T>,
        turn: &Vector3<T>,
    ) -> Result<Self, GeometryFault> {
        let cosine_sq = T::one() - dot(turn, turn);
        let is_pose = cosine_sq > T::zero() && position_m.iter().all(|c| c.is_finite()); // false for NaN
        if !is_pose {
            return Err(GeometryFault::InvalidPose);
        }
        // R = c + [t] + t t^T/(1 + c)
        let cosine = cosine_sq.sqrt();
        let u = *turn * (T::one() / (T::one() + cosine));
        let (x, y, z) = (turn.x, turn.y, turn.z);
        let rotation = Matrix3::new(
            cosine + u.x * x,
            u.x * y - z,
            u.x * z + y,
            u.y * x + z,
            cosine + u.y * y,
            u.y * z - x,
            u.z * x - y,
            u.z * y + x,
            cosine + u.z * z,
        );
        Ok(Self { position_m, rotation })
    }

    /// The pose at the share `s` in `[0, 1]` of the way to `other`: positions and axes go straight, and
    /// the axes are made orthonormal again to the third order of the angle (one step of Newton's method
    /// for the polar factor, `R (3 - R^T R) / 2`).
    #[must_use]
    pub(crate) fn between(&self, other: &Self, s: T) -> Self {
        let position_m = self.position_m + (other.position_m - self.position_m) * s;
        let r = self.rotation + (other.rotation - self.rotation) * s;
        let excess = Matrix3::identity() * T::constant(3.0) - r.transpose() * r;
        Self { position_m, rotation: r * excess * T::constant(0.5) }
    }

    /// How far `other` is: distance of the origins (m), and Frobenius norm of the difference of the
    /// axes, which bounds how far any point moves by turning, over its distance from the origin.
    #[must_use]
    pub(crate) fn apart(&self, other: &Self) -> (T, T) {
        let way = other.position_m - self.position_m;
        let turn = other.rotation - self.rotation;
        let square = turn.iter().fold(T::zero(), |sum, c| sum + *c * *c);
        (norm3(&way), square.sqrt())
    }

    /// The turn to the orientation of `other`, about world axes: a vector along its axis, as long as the sine of its angle.
    #[must_use]
    pub(crate) fn turned_to(&self, other: &Self) -> Vector3<T> {
        skew(&(other.rotation * self.rotation.transpose()))
    }

    /// The orientation as a vector along the axis of the turn, as long as the sine of its angle: half the
    /// skew part of the rotation matrix, with no trigonometry. `None` for turns of a right angle and more.
    #[must_use]
    pub fn turn_vector(&self) -> Option<Vector3<T>> {
        let r = &self.rotation;
        let is_small = r.m11 + r.m22 + r.m33 > T::one(); // 1 + 2 cos
        is_small.then(|| skew(r))
    }

    /// Largest coordinate of the position, without sign, m.
    pub(crate) fn size_m(&self) -> T {
        self.position_m.iter().fold(T::zero(), |largest, c| largest.max(c.abs()))
    }
}

impl<T: Scalar> Pose<T> {
    /// Position of the platform origin, world frame, m.
    pub fn position_m(&self) -> &Vector3<T> {
        &self.position_m
    }

    /// A direction or offset of the platform frame, turned into the world frame.
    pub fn turn(&self, platform: &Vector3<T>) -> Vector3<T> {
        self.rotation * platform
    }
}

/// The vertical plane of one cable at one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CablePlane<T: Scalar> {
    /// Horizontal distance from anchor to attachment, m, never negative.
    pub x_m: T,
    /// Height of the attachment above the anchor, m; negative when the platform hangs below.
    pub z_m: T,
    /// Horizontal unit vector (world x, y) from anchor to attachment.
    pub direction: Vector2<T>,
    /// From the platform origin to the attachment, world axes, over the robot's moment arm.
    pub lever_arm: Vector3<T>,
}

impl<T: Real> CablePlane<T> {
    /// The plane of one of the cables of `robot` at `pose`. Where anchor and attachment stand
    /// exactly above each other any direction will do; `previous` is kept, so that a moving cable
    /// does not flip.
    pub fn new<M>(
        robot: &Robot<T, M>,
        cable: &Cable<T, M>,
        pose: &Pose<T>,
        previous: Vector2<T>,
    ) -> Self {
        let lever_arm_m = pose.turn(&cable.attachment_m);
        let span = pose.position_m + lever_arm_m - cable.anchor_m;
        let (x_m, _) = T::hypot_with_excess(span.x, span.y);
        let direction = if x_m > T::zero() {
            let per_distance_m = T::one() / x_m;
            Vector2::new(span.x * per_distance_m, span.y * per_distance_m)
        } else {
            previous
        };
        Self { x_m, z_m: span.z, direction, lever_arm: lever_arm_m * robot.per_moment_arm_m }
    }

    /// Straight distance from anchor to attachment, m.
    pub fn distance_m(&self) -> T {
        T::hypot_with_excess(self.x_m, self.z_m).0
    }
}

/// Length of a vector.
#[inline]
pub(crate) fn norm3<T: Scalar>(v: &Vector3<T>) -> T {
    dot(v, v).sqrt()
}

/// The vector whose cross product is the skew part of a matrix.
fn skew<T: Real>(r: &Matrix3<T>) -> Vector3<T> {
    let half = T::constant(0.5);
    Vector3::new((r.m32 - r.m23) * half, (r.m13 - r.m31) * half, (r.m21 - r.m12) * half)
}

/// Scalar product.
#[inline]
fn dot<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    a.x * b.x + a.y * b.y + a.z * b.z
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cables(attachments: [[f64; 3]; CABLES]) -> [Cable<f64, ()>; CABLES] {
        core::array::from_fn(|i| Cable {
            anchor_m: Vector3::new(i as f64, 1.0, 8.0),
            attachment_m: Vector3::from(attachments[i]),
            model: (),
        })
    }

    const PLATFORM: [[f64; 3]; CABLES] = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 2.0],
        [0.0, 0.0, 2.0],
    ];

    #[test]
    fn turn_vectors_lead_there_and_back() {
        let position_m = Vector3::new(1.0, -2.0, 3.0);
        for turn in [[0.0, 0.0, 0.0], [0.1, -0.2, 0.3], [-0.9, 0.0, 0.3], [1e-9, 2e-9, 0.0]] {
            let turn = Vector3::<f64>::from(turn);
            let pose = Pose::with_turn_vector(position_m, &turn).unwrap();
            // By the half angle: (cos(a/2), sin(a/2) axis).
            let cosine = Scalar::sqrt(1.0 - turn.norm_squared());
            let w = Scalar::sqrt(0.5 * (1.0 + cosine));
            let [x, y, z] = (turn / (2.0 * w)).into();
            let quaternion = nalgebra::Quaternion::new(w, x, y, z);
            let same = Pose::new(position_m, UnitQuaternion::new_unchecked(quaternion)).unwrap();
            let (moved_m, turned) = pose.apart(&same);
            assert!(moved_m == 0.0 && turned < 1e-15, "{turn:?}: {turned:e}");
            let back = pose.turn_vector().unwrap() - turn;
            assert!(back.norm() <= 1e-15 * turn.norm(), "{turn:?}: {back:?}");
            let still = Pose::with_turn_vector(position_m, &Vector3::zeros()).unwrap();
            assert!((still.turned_to(&pose) - turn).norm() <= 1e-15 * turn.norm());
        }
        for turn in [[1.0, 0.0, 0.0], [0.8, 0.0, -0.7], [f64::NAN, 0.0, 0.0], [f64::INFINITY; 3]] {
            let refused = Pose::with_turn_vector(position_m, &Vector3::from(turn));
            assert_eq!(refused, Err(GeometryFault::InvalidPose));
        }
        let nowhere = Vector3::new(0.0, f64::NAN, 0.0);
        assert!(Pose::with_turn_vector(nowhere, &Vector3::zeros()).is_err());
    }

    #[test]
    fn refuses_what_has_no_statics() {
        assert!(Robot::new(cables(PLATFORM)).is_ok());
        let mut bad = cables(PLATFORM);
        bad[3].anchor_m.y = f64::NAN;
        assert_eq!(Robot::new(bad), Err(GeometryFault::NonFiniteCable(3)));
        let mut bad = cables(PLATFORM);
        bad[4].anchor_m = bad[1].anchor_m;
        assert_eq!(Robot::new(bad), Err(GeometryFault::CoincidentAnchors(1, 4)));
        let on_a_line = core::array::from_fn(|i| [0.1 * i as f64, 0.3 * i as f64, -0.7 * i as f64]);
        assert_eq!(Robot::new(cables(on_a_line)), Err(GeometryFault::CollinearAttachments));
        assert_eq!(
            Robot::new(cables([[0.5; 3]; CABLES])),
            Err(GeometryFault::CollinearAttachments)
        );
    }

    #[test]
    fn pose_turns_like_nalgebra() {
        let q = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.7));
        let pose = Pose::new(Vector3::new(1.0, 2.0, 3.0), q).unwrap();
        let v = Vector3::new(-0.4, 0.9, 0.1);
        assert!((pose.turn(&v) - q * v).amax() < 4.0 * f64::EPSILON);
        assert_eq!(
            Pose::new(Vector3::new(f64::INFINITY, 0.0, 0.0), q),
            Err(GeometryFault::InvalidPose)
        );
        let not_unit = UnitQuaternion::new_unchecked(q.into_inner() * 1.1);
        assert_eq!(Pose::new(Vector3::zeros(), not_unit), Err(GeometryFault::InvalidPose));
    }

    #[test]
    fn exactly_vertical_cable_keeps_its_direction() {
        let robot = Robot::new(cables(PLATFORM)).unwrap();
        // The first attachment, at (1, 0, 0), under the first anchor, at (0, 1, 8).
        let pose = Pose::new(Vector3::new(-1.0, 1.0, 2.0), UnitQuaternion::identity()).unwrap();
        let plane = CablePlane::new(&robot, &robot.cables()[0], &pose, Vector2::new(0.0, 1.0));
        assert_eq!((plane.x_m, plane.z_m), (0.0, -6.0));
        assert_eq!(plane.direction, Vector2::new(0.0, 1.0));
    }
}
