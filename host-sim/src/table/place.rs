//! Boxes of poses, and what the cables see of them, in intervals.
//!
//! A pose has six coordinates: position, and the turn vector `sigma = sin(angle) axis` of
//! [`Pose::turn_vector`], with which the rotation matrix is free of trigonometry:
//!
//! ```text
//! R = c + [sigma] + sigma sigma^T/(1 + c),      c = sqrt(1 - sigma^2)
//! ```

use std::ops::Range;

use cdpr_core::chart::Hung;
use cdpr_core::table::{COORDINATES, LIKENESS};
use cdpr_core::{CABLES, GeometryFault, Load, Pose, Real, Robot, Scalar};
use nalgebra::{Vector2, Vector3, Vector6};
use num_traits::{One, Zero};

use super::Model;
use crate::interval::Interval;

/// A pose by its coordinates.
pub(super) type Point = [f64; COORDINATES];

/// `a . b`.
pub(super) fn dot(a: &Point, b: &Point) -> f64 {
    (0..COORDINATES).map(|k| a[k] * b[k]).sum()
}

/// The pose with these coordinates, rounded to a number type.
pub(super) fn pose<T: Real>(at: &Point) -> Result<Pose<T>, GeometryFault> {
    cdpr_core::table::pose(&at.map(T::constant))
}

/// A box of poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseBox {
    /// Lower ends: position (m), turn vector.
    pub low: Point,
    /// Upper ends.
    pub high: Point,
}

impl PoseBox {
    pub(super) fn middle(&self) -> Point {
        std::array::from_fn(|k| 0.5 * (self.low[k] + self.high[k]))
    }

    /// All values of a coordinate.
    pub(super) fn side(&self, k: usize) -> Interval {
        Interval::new(self.low[k], self.high[k])
    }

    pub(super) fn extent(&self, k: usize) -> f64 {
        self.high[k] - self.low[k]
    }

    /// Both halves.
    pub(crate) fn halves(&self, k: usize) -> [Self; 2] {
        let middle = 0.5 * (self.low[k] + self.high[k]);
        let (mut lower, mut upper) = (*self, *self);
        lower.high[k] = middle;
        upper.low[k] = middle;
        [lower, upper]
    }

    /// The point whose coordinates run from 0 to 1 between the sides.
    pub(super) fn at(&self, t: &Point) -> Point {
        std::array::from_fn(|k| self.low[k] + t[k] * self.extent(k))
    }

    /// So many points all over it, evenly.
    pub(super) fn spread(&self, count: usize) -> impl Iterator<Item = Point> {
        (0..count).map(|n| self.at(&spread(n)))
    }

    /// The inverse of [`PoseBox::at`].
    pub(super) fn local(&self, point: &Point) -> Point {
        std::array::from_fn(|k| (point[k] - self.low[k]) / self.extent(k))
    }

    pub(super) fn contains(&self, point: &Point) -> bool {
        (0..COORDINATES).all(|k| point[k] >= self.low[k] && point[k] <= self.high[k])
    }

    /// What is in both; `None` when they do not even touch.
    pub(super) fn intersection(&self, other: &Self) -> Option<Self> {
        let both = Self {
            low: std::array::from_fn(|k| self.low[k].max(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].min(other.high[k])),
        };
        (0..COORDINATES).all(|k| both.low[k] <= both.high[k]).then_some(both)
    }
}

/// The `n`th of points that fill the unit cube evenly: an additive recurrence by the powers of the root of
/// `x^7 = x + 1` (M. Roberts).
pub(super) fn spread(n: usize) -> Point {
    const ROOT: f64 = 1.112_775_684_278_705_5;
    std::array::from_fn(|k| {
        let mut step = 1.0;
        for _ in 0..=k {
            step /= ROOT;
        }
        let t = 0.5 + step * n as f64;
        t - t.floor()
    })
}

/// The first of the largest of some numbers.
pub(super) fn largest(among: Range<usize>, size: impl Fn(usize) -> f64) -> usize {
    among.reduce(|best, k| if size(k) > size(best) { k } else { best }).unwrap_or(0)
}

type Vector3i = Vector3<Interval>;

fn dot3(a: &Vector3i, b: &Vector3i) -> Interval {
    a.x * b.x + a.y * b.y + a.z * b.z
}

fn unit(k: usize) -> Vector3i {
    let mut unit = Vector3i::zeros();
    unit[k] = Interval::one();
    unit
}

/// Rotation by all turn vectors of a box, and how it changes with each component.
struct Rotation {
    turn: Vector3i,
    cosine: Interval,
    /// `1/(1 + c)`.
    half: Interval,
}

impl Rotation {
    fn of(region: &PoseBox) -> Self {
        let one = Interval::one();
        let turn = Vector3i::from_fn(|k, _| region.side(k + 3));
        let sine_sq = turn.x.square() + turn.y.square() + turn.z.square();
        let cosine = (one - sine_sq).sqrt();
        Self { turn, cosine, half: one / (one + cosine) }
    }

    fn turned(&self, b: &Vector3i) -> Vector3i {
        let along = dot3(&self.turn, b) * self.half;
        b * self.cosine + self.turn.cross(b) + self.turn * along
    }

    /// `d(R b)/d sigma_k`; `dc/d sigma_k = -sigma_k/c`.
    fn derivative(&self, b: &Vector3i, k: usize) -> Vector3i {
        let along = dot3(&self.turn, b);
        let rate = self.turn[k] / self.cosine;
        unit(k).cross(b) - b * rate
            + unit(k) * (along * self.half)
            + self.turn * (b[k] * self.half + along * rate * self.half.square())
    }
}

/// `value` and all that is taken for it: see [`LIKENESS`].
pub(super) fn alike(value: f64) -> Interval {
    Interval::around(value, LIKENESS * value.abs())
}

/// A robot and its load, with all parameters that a reader takes for the same.
pub(super) struct Likeness {
    anchors_m: [Vector3i; CABLES],
    attachments_m: [Vector3i; CABLES],
    moment_arm_m: f64,
    weight_n: Interval,
    center_of_mass_m: Vector3i,
    force_n: Vector3i,
    moment_nm: Vector3i,
}

/// Turns that move attachments less than this part of what the position does are not followed.
const HARDLY_TURNED: f64 = 1e-3;
/// Turn matrices of a controller in f32 are off by less than this part.
const TURN_ROUNDING: f64 = 1e-6;

/// What one cable sees of a box of poses.
#[derive(Clone, Copy)]
pub(super) struct Sight {
    pub(super) x_m: Interval,
    pub(super) z_m: Interval,
    /// Horizontal direction.
    direction: Vector2<Interval>,
    /// From the platform origin to the attachment over the moment arm, and its derivatives by the turn vector.
    arm: Vector3i,
    arm_by_turn: [Vector3i; 3],
}

impl Likeness {
    pub(super) fn new(robot: &Robot<f64, Model>, load: &Load<f64>) -> Self {
        let cables = robot.cables();
        Self {
            anchors_m: std::array::from_fn(|i| cables[i].anchor_m.map(alike)),
            attachments_m: std::array::from_fn(|i| cables[i].attachment_m.map(alike)),
            moment_arm_m: robot.moment_arm_m(),
            weight_n: alike(load.mass_kg) * alike(load.gravity_m_s2),
            center_of_mass_m: load.center_of_mass_m.map(alike),
            force_n: load.force_n.map(alike),
            moment_nm: load.moment_nm.map(alike),
        }
    }

    /// What the cables see of `region`, and the external wrench with its derivatives by the turn vector (N);
    /// the number of a cable that may be vertical when there is one.
    pub(super) fn look(&self, region: &PoseBox) -> Result<(Vec<Sight>, Loading), usize> {
        let rotation = Rotation::of(region);
        let position = Vector3i::from_fn(|k, _| region.side(k));
        let per_arm = Interval::one() / Interval::point(self.moment_arm_m);
        let rounding = Interval::symmetric(TURN_ROUNDING * self.moment_arm_m);
        let mut sights = Vec::with_capacity(CABLES);
        for i in 0..CABLES {
            let b = &self.attachments_m[i];
            let arm_m = rotation.turned(b).map(|c| c + rounding);
            let span = position + arm_m - self.anchors_m[i];
            let (x_m, _) = Interval::hypot_with_excess(span.x, span.y);
            if x_m.low() <= 0.0 {
                return Err(i);
            }
            sights.push(Sight {
                x_m,
                z_m: span.z,
                direction: direction(&span, x_m),
                arm: arm_m * per_arm,
                arm_by_turn: std::array::from_fn(|k| rotation.derivative(b, k) * per_arm),
            });
        }
        let zero = Interval::zero();
        let weight = Vector3i::new(zero, zero, -self.weight_n);
        let arm = rotation.turned(&self.center_of_mass_m).map(|c| c + rounding);
        let moment = (arm.cross(&weight) + self.moment_nm) * per_arm;
        let force = weight + self.force_n;
        let wrench_n = stack(&force, &moment);
        let by_turn = std::array::from_fn(|k| {
            let moment = rotation.derivative(&self.center_of_mass_m, k).cross(&weight) * per_arm;
            stack(&Vector3i::zeros(), &moment)
        });
        Ok((sights, Loading { wrench_n, by_turn }))
    }
}

/// The external wrench over a box of poses, N.
pub(super) struct Loading {
    pub(super) wrench_n: Vector6<Interval>,
    by_turn: [Vector6<Interval>; 3],
}

/// How a wrench changes with each coordinate of the pose, N/m and N.
pub(super) type ByPose = [Vector6<Interval>; COORDINATES];

/// The coordinates of a pose along which a change is followed. Over the others it is enclosed as it stands.
#[derive(Clone, Copy)]
pub(super) enum Along {
    Position,
    PositionAndTurn { moment_arm_m: f64 },
}

impl Along {
    /// How many coordinates these are.
    pub(super) fn count(self) -> usize {
        match self {
            Self::Position => 3,
            Self::PositionAndTurn { .. } => COORDINATES,
        }
    }

    /// The poses of a box with the coordinates of `at` that are followed.
    pub(super) fn across(self, region: &PoseBox, at: &Point) -> PoseBox {
        let mut across = *region;
        let count = self.count();
        for end in [&mut across.low, &mut across.high] {
            end[..count].copy_from_slice(&at[..count]);
        }
        across
    }
}

impl Loading {
    /// How it changes with the pose.
    pub(super) fn by_pose(&self, along: Along) -> ByPose {
        let mut by_pose = [Vector6::zeros(); COORDINATES];
        if let Along::PositionAndTurn { .. } = along {
            by_pose[3..].copy_from_slice(&self.by_turn);
        }
        by_pose
    }
}

/// `(x, y)/|(x, y)|`: each component rises with its own coordinate, and depends on the size of the other.
fn direction(span: &Vector3i, x_m: Interval) -> Vector2<Interval> {
    let component = |along: Interval, across: Interval| {
        let plain = along / x_m;
        if along.low() <= 0.0 && along.high() >= 0.0 {
            return plain;
        }
        // cos = 1/sqrt(1 + (across/along)^2)
        let one = Interval::one();
        let steep = one / (one + (across / along).square()).sqrt();
        let signed = if along.low() > 0.0 { steep } else { -steep };
        plain.intersection(signed).unwrap_or(plain)
    };
    Vector2::new(component(span.x, span.y), component(span.y, span.x))
}

fn stack(force: &Vector3i, moment: &Vector3i) -> Vector6<Interval> {
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

impl Sight {
    /// The force on the platform of a force on the cable.
    fn push(&self, force_n: &Vector2<Interval>) -> Vector3i {
        let e = &self.direction;
        -Vector3i::new(force_n.x * e.x, force_n.x * e.y, force_n.y)
    }

    /// The wrench of a force on the cable, N.
    pub(super) fn wrench_n(&self, force_n: &Vector2<Interval>) -> Vector6<Interval> {
        let push = self.push(force_n);
        stack(&push, &self.arm.cross(&push))
    }

    /// What a force of 1 N at the attachment, in any direction, makes of a row at most.
    pub(super) fn per_newton(&self, row: &Vector6<f64>) -> f64 {
        // row . (f, arm x f) = (row_f + row_m x arm) . f
        let [force, moment] = [0, 3].map(|k| Vector3i::from_fn(|j, _| Interval::point(row[k + j])));
        let most = (force + moment.cross(&self.arm)).map(Interval::magnitude);
        most.norm() * (1.0 + 8.0 * f64::EPSILON)
    }

    /// Adds to `sums` how the wrench of a cable at fixed coordinate changes with each coordinate of the pose.
    pub(super) fn add_by_pose(&self, sums: &mut ByPose, hung: &Hung<Interval>, along: Along) {
        let by_end = [hung.force_by_x_n_m, hung.force_by_z_n_m];
        self.add_moved(sums, &hung.force_n, &by_end, along);
    }

    /// The same for the wrench of any vector in the plane of the cable, that changes so with the end of the cable.
    pub(super) fn add_moved(
        &self,
        sums: &mut ByPose,
        force_n: &Vector2<Interval>,
        [force_by_x_n_m, force_by_z_n_m]: &[Vector2<Interval>; 2],
        along: Along,
    ) {
        // Along the horizontal direction, upwards, and sideways, where the plane turns with the move.
        let (cos, sin) = (self.direction.x, self.direction.y);
        let swing = force_n.x / self.x_m;
        let (across, both) = (cos * sin, force_by_x_n_m.x - swing);
        let turned = -(across * both);
        let by_position = [
            Vector3i::new(
                -(force_by_x_n_m.x * cos.square() + swing * sin.square()),
                turned,
                -(force_by_x_n_m.y * cos),
            ),
            Vector3i::new(
                turned,
                -(force_by_x_n_m.x * sin.square() + swing * cos.square()),
                -(force_by_x_n_m.y * sin),
            ),
            self.push(force_by_z_n_m),
        ];
        for (sum, by) in sums.iter_mut().zip(&by_position) {
            *sum += stack(by, &self.arm.cross(by));
        }
        let Along::PositionAndTurn { moment_arm_m } = along else { return };
        let push = self.push(force_n);
        let arm_m = Interval::point(moment_arm_m);
        for k in 0..3 {
            let turn = &self.arm_by_turn[k];
            let by = by_position[0] * (turn.x * arm_m)
                + by_position[1] * (turn.y * arm_m)
                + by_position[2] * (turn.z * arm_m);
            sums[k + 3] += stack(&by, &(self.arm.cross(&by) + turn.cross(&push)));
        }
    }
}

impl Likeness {
    pub(super) fn moment_arm_m(&self) -> f64 {
        self.moment_arm_m
    }

    /// All coordinates.
    pub(super) fn everywhere(&self) -> Along {
        Along::PositionAndTurn { moment_arm_m: self.moment_arm_m }
    }

    /// The coordinates of a box that are worth it.
    pub(super) fn along(&self, region: &PoseBox) -> Along {
        let largest =
            |range: Range<usize>| range.fold(0.0_f64, |most, k| most.max(region.extent(k)));
        if largest(3..6) * self.moment_arm_m < HARDLY_TURNED * largest(0..3) {
            Along::Position
        } else {
            self.everywhere()
        }
    }
}
