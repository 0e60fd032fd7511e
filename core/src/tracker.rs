//! One branch of the inverse kinematics, followed from tick to tick.

mod start;

pub use start::START_STEPS;

use nalgebra::{Vector2, Vector3, Vector6};

use crate::certificate::{Change, Hanging, Move, NewtonSize, rounding};
use crate::elimination::Square;
use crate::geometry::norm3;
use crate::statics;
use crate::{
    CABLES, CableModel, CablePlane, CableState, Certificate, CurvePoint, Fault, Load, Pose, Real,
    Robot, Scalar, ShapedCable, StepFault,
};

/// Velocity of the platform: of its origin, and of turning, world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist<T: Scalar> {
    /// Velocity of the platform origin, m/s.
    pub linear_m_s: Vector3<T>,
    /// Angular velocity, rad/s.
    pub angular_rad_s: Vector3<T>,
}

impl<T: Scalar> Twist<T> {
    /// That of a platform that stands.
    #[must_use]
    pub fn none() -> Self {
        let still = Vector3::new(T::zero(), T::zero(), T::zero());
        Self { linear_m_s: still, angular_rad_s: still }
    }
}

/// Where the platform should be, and how fast it should move there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoint<T: Scalar> {
    /// The pose.
    pub pose: Pose<T>,
    /// Its rate of change.
    pub twist: Twist<T>,
}

/// What one winch and its cable can do.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// How a [`Tracker`] works: rate and limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackerSettings<T: Scalar> {
    /// Time between two ticks, s.
    pub period_s: T,
    /// Largest move of the platform origin in a tick, and of an attachment by turning, m.
    pub largest_move_m: T,
    /// Least distance to a singularity (see [`Fault::NearSingularity`]), between 0 and 1.
    pub least_distance: T,
    /// A fold that would be reached sooner than this is refused, s.
    pub fold_horizon_s: T,
    /// Largest distance of a cable's force from that of the true solution that is accepted, rounding included, N along its
    /// force curve: see [`Certificate::existence_n`].
    pub largest_error_n: T,
    /// Limits of the cables.
    pub cables: [CableLimits<T>; CABLES],
}

/// What one winch is to do, and what its cable then carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CableCommand<T: Scalar> {
    /// Rest length from the anchor to the attachment, m.
    pub rest_length_m: T,
    /// Its rate of change at the twist of the set-point, for speed feed-forward, m/s.
    pub rest_length_rate_m_s: T,
    /// Horizontal direction from the anchor to the attachment, world x and y.
    pub direction: Vector2<T>,
    /// Force on the cable at the attachment, `(Fx, Fz)` in its plane, N.
    pub force_n: Vector2<T>,
    /// Its rate of change, N/s.
    pub force_rate_n_s: Vector2<T>,
    /// Force of the cable on its winch at the anchor, `(Fx, Fz - W)`, N.
    pub anchor_force_n: Vector2<T>,
    /// Tension at the attachment, N.
    pub tension_n: T,
    /// Tension at the anchor, N.
    pub anchor_tension_n: T,
    /// Whether the cable hangs below both of its ends.
    pub is_slack: bool,
}

/// The outcome of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command<T: Scalar> {
    /// One for each winch.
    pub cables: [CableCommand<T>; CABLES],
    /// What is proven about it.
    pub certificate: Certificate<T>,
    /// Distance to a singularity: see [`Fault::NearSingularity`].
    pub distance: T,
    /// Largest distance between the end of a cable and its attachment, before the last step, m.
    pub closure_m: T,
    /// Unbalanced wrench before the last step, moments over the moment arm, N.
    pub imbalance_n: T,
    /// Parts into which the move was divided.
    pub parts: u8,
}

/// Follows one branch: six rest lengths at each tick, each with a [`Certificate`].
///
/// A tick predicts by the rates of the last solution, makes one Newton step at the new pose and proves
/// with it, over the ball of a [`Certificate`] and over all poses in between, that the branch leads
/// there. Where that fails the move is halved, down to an eighth; where that fails too, or a limit is
/// exceeded, the tick returns a [`Fault`] and nothing changes. One part of a move costs six end-point
/// maps and the inverse of one 6x6 matrix; a tick does at most [`MAX_PARTS`] of them.
#[derive(Clone, Copy, Debug)]
pub struct Tracker<T: Real, M> {
    robot: Robot<T, M>,
    load: Load<T>,
    settings: TrackerSettings<T>,
    /// See [`load_rounding`].
    load_rounding: T,
    now: Solution<T>,
}

/// Parts of a move that one tick tries at most: eight that succeed and three that were too long.
pub const MAX_PARTS: u8 = 11;

/// Shortest part of a move.
const SHORTEST_PART: f64 = 1.0 / 8.0;

/// A pose and what holds the platform there.
#[derive(Clone, Copy, Debug)]
struct Solution<T: Scalar> {
    pose: Pose<T>,
    command: Command<T>,
}

/// What a part of a move is made for.
#[derive(Clone, Copy, PartialEq)]
enum Purpose {
    /// To come closer to a solution: proven or not, and beyond limits.
    Start,
    /// To come closer to the pose of a command: proven, but beyond limits.
    Part,
    /// To be commanded.
    Command,
}

/// Why a part of a move was not made.
enum Refusal<T> {
    /// It cannot be: smaller parts would not help.
    Fault(Fault<T>),
    /// It is not proven; the contraction that was found.
    Unproven { contraction: T },
}

impl<T> Refusal<T> {
    fn fault(self) -> Fault<T> {
        match self {
            Self::Fault(fault) => fault,
            Self::Unproven { contraction } => Fault::NotCertified { contraction },
        }
    }
}

impl<T: Real, M: ShapedCable<T>> Tracker<T, M> {
    /// The next command: for the pose of `set_point`, on the branch of the last one.
    ///
    /// # Errors
    /// [`Fault`]; the last command then stands.
    pub fn tick(&mut self, set_point: &SetPoint<T>) -> Result<&Command<T>, Fault<T>> {
        let goal = self.check(set_point)?;
        match self.advance(set_point, &goal, self.settings.period_s, Purpose::Command) {
            Ok(_) => Ok(&self.now.command),
            Err(Refusal::Fault(fault)) => Err(fault),
            Err(Refusal::Unproven { contraction }) => {
                let before = self.now;
                match self.advance_in_parts(set_point, &goal, contraction) {
                    Ok(()) => Ok(&self.now.command),
                    Err(fault) => {
                        self.now = before;
                        Err(fault)
                    }
                }
            }
        }
    }

    /// A tick in parts of half the move and less, after the whole was not proven.
    #[cold]
    #[inline(never)]
    fn advance_in_parts(
        &mut self,
        set_point: &SetPoint<T>,
        goal: &Move<T>,
        contraction: T,
    ) -> Result<(), Fault<T>> {
        let start = self.now.pose;
        let (mut done, mut share) = (T::zero(), T::constant(0.5));
        let mut contraction = contraction;
        for parts in 2..=MAX_PARTS {
            let reached = done + share;
            let is_last = reached >= T::one();
            let pose =
                if is_last { set_point.pose } else { start.between(&set_point.pose, reached) };
            let time_s = self.settings.period_s * share;
            let here = SetPoint { pose, twist: set_point.twist };
            match self.advance(
                &here,
                &goal.part(share),
                time_s,
                if is_last { Purpose::Command } else { Purpose::Part },
            ) {
                Ok(_) if is_last => {
                    self.now.command.parts = parts;
                    return Ok(());
                }
                Ok(_) => done = reached,
                Err(Refusal::Fault(fault)) => return Err(fault),
                Err(Refusal::Unproven { contraction: found }) => {
                    contraction = found;
                    share *= T::constant(0.5);
                    if share < T::constant(SHORTEST_PART) {
                        break;
                    }
                }
            }
        }
        Err(Fault::NotCertified { contraction })
    }

    /// Predicts, makes one Newton step at the pose, and certifies it. Nothing changes where that
    /// is refused. Returns the size of the step and the sum of the end tensions, N.
    #[inline]
    fn advance(
        &mut self,
        set_point: &SetPoint<T>,
        moved: &Move<T>,
        time_s: T,
        purpose: Purpose,
    ) -> Result<(T, T), Refusal<T>> {
        let Self { robot, load, settings, load_rounding, now } = self;
        let (pose, twist, arm_m) = (&set_point.pose, &set_point.twist, robot.moment_arm_m());
        let mut sum = statics::wrench_n(robot, load, pose);
        let (mut closure_m, mut rounding_n) = (T::zero(), *load_rounding);
        let size_m = pose.size_m() + arm_m;
        let mut inverse = Square::new([[T::one(); CABLES]; CABLES]);
        let mut linear = [Linear::place(); CABLES];
        for i in 0..CABLES {
            let (last, fixed) = (&now.command.cables[i], &robot.cables()[i]);
            let next = &mut linear[i];
            next.plane = CablePlane::new(robot, fixed, pose, last.direction);
            let predicted = next.predict(&fixed.model, last, time_s);
            let (plane, curve) = (&next.plane, &next.curve);
            let gap_m = curve.gap_m.x.abs() + curve.gap_m.y.abs();
            closure_m = closure_m.max(gap_m);
            rounding_n += rounding(curve, &next.force_n, next.rest_length_m + size_m);
            let along = predicted.x * curve.tangent.x + predicted.y * curve.tangent.y;
            next.along_n = along.abs();
            add(&mut sum, &plane.wrench_n(&next.force_n));
            inverse.columns[i] = plane.wrench_n(&curve.tangent).data.0[0];
        }
        if !inverse.invert() {
            return Err(Refusal::Fault(why_singular(&linear)));
        }
        let gains = inverse.row_norms();
        let inverse_norm = norm(&gains);
        // Backwards along the curves; how far in all.
        let back_n = inverse.times(&sum);
        let mut newton = NewtonSize::new(rounding_n * T::EPSILON);
        for i in 0..CABLES {
            let known_n = now.command.certificate.existence_n[i];
            newton.add(gains[i], back_n[i], linear[i].along_n, known_n);
        }
        let radius_n = newton.radius_n();
        let mut change = Change::new();
        let mut tensions_n = T::zero();
        let load_rate =
            load.moment_rate_nm_s(pose, &twist.angular_rad_s) * robot.per_moment_arm_m();
        let mut rate = [T::zero(), T::zero(), T::zero(), load_rate.x, load_rate.y, load_rate.z];
        for i in 0..CABLES {
            let Linear { plane, curve, force_n, rest_length_m, along_n, hanging, end_m_s } =
                &mut linear[i];
            *force_n -= curve.tangent * back_n[i];
            *rest_length_m -= curve.length_per_force_m_n * back_n[i];
            let weight_n_m = robot.cables()[i].model.weight_n_m();
            *hanging = Hanging::new(weight_n_m, force_n, *rest_length_m);
            tensions_n += hanging.tension_n + hanging.anchor_tension_n;
            let horizontal_n = force_n.x.abs();
            change.add(
                &M::SHAPE,
                weight_n_m,
                plane,
                curve,
                horizontal_n,
                hanging,
                *rest_length_m,
                moved,
                *along_n,
                radius_n,
                gains[i],
            );
            *end_m_s = add_rate(&mut rate, plane, curve, force_n, twist, arm_m);
        }
        let back_n_s = inverse.times(&rate);
        let certificate = match change.certify(&gains, inverse_norm, &newton, moved) {
            Ok(certificate) => certificate,
            Err(contraction) if purpose != Purpose::Start => {
                return Err(Refusal::Unproven { contraction });
            }
            Err(_) => Certificate::none(),
        };
        let distance = T::one() / inverse_norm;
        let imbalance_n = sum.iter().fold(T::zero(), |most, c| most.max(c.abs()));
        if purpose == Purpose::Command {
            let check = || {
                settings.check_distance(distance, now.command.distance)?;
                settings.check_error(&certificate, closure_m, imbalance_n)
            };
            check().map_err(Refusal::Fault)?;
            for (i, (next, limits)) in linear.iter().zip(&settings.cables).enumerate() {
                let rate_m_s = next.rest_length_rate_m_s(back_n_s[i]);
                limits
                    .check(i, next.rest_length_m, rate_m_s, &next.hanging)
                    .map_err(Refusal::Fault)?;
            }
        }
        now.command.take(&linear, &back_n_s);
        now.pose = *pose;
        let command = &mut now.command;
        command.certificate = certificate;
        // A fold is sought between two commands.
        if purpose != Purpose::Part {
            command.distance = distance;
        }
        command.closure_m = closure_m;
        command.imbalance_n = imbalance_n;
        command.parts = 1;
        Ok((newton.step_n, tensions_n))
    }

    /// Refuses a set-point that is not finite or too far away; else how far the move is.
    fn check(&self, set_point: &SetPoint<T>) -> Result<Move<T>, Fault<T>> {
        let (twist, arm_m) = (&set_point.twist, self.robot.moment_arm_m());
        let (distance_m, lever_arm) = self.now.pose.apart(&set_point.pose);
        let turn_m = lever_arm * arm_m;
        let period_s = self.settings.period_s;
        let way_m = norm3(&twist.linear_m_s) * period_s;
        let way_turning_m = norm3(&twist.angular_rad_s) * arm_m * period_s;
        if !(distance_m + turn_m + way_m + way_turning_m).is_finite() {
            return Err(Fault::NonFiniteSetPoint);
        }
        // What the twist promises for the next tick must be possible as well.
        let (distance_m, turn_m) = (distance_m.max(way_m), turn_m.max(way_turning_m));
        let largest_m = self.settings.largest_move_m;
        if distance_m <= largest_m && turn_m <= largest_m {
            Ok(Move { attachment_m: distance_m + turn_m, lever_arm })
        } else {
            Err(Fault::JumpingSetPoint { distance_m, turn_m })
        }
    }

    /// The last certified command.
    pub fn command(&self) -> &Command<T> {
        &self.now.command
    }

    /// The pose of the last certified command.
    pub fn pose(&self) -> &Pose<T> {
        &self.now.pose
    }

    /// Rate and limits.
    pub fn settings(&self) -> &TrackerSettings<T> {
        &self.settings
    }

    /// The robot.
    pub fn robot(&self) -> &Robot<T, M> {
        &self.robot
    }
}

/// Adds how the wrench of a cable changes with time when the coordinates along the curves are held: the
/// equations of balance, differentiated. Returns the velocity of the attachment in the plane of the cable.
#[inline]
fn add_rate<T: Real>(
    sum: &mut [T; CABLES],
    plane: &CablePlane<T>,
    curve: &CurvePoint<T>,
    force_n: &Vector2<T>,
    twist: &Twist<T>,
    arm_m: T,
) -> Vector2<T> {
    let (e, r) = (&plane.direction, &plane.lever_arm);
    let turn = twist.angular_rad_s.cross(r);
    let v = twist.linear_m_s + turn * arm_m;
    let end = Vector2::new(e.x * v.x + e.y * v.y, v.z);
    // The plane turns, and the horizontal force with it.
    let sideways = e.x * v.y - e.y * v.x;
    let swing = if plane.x_m > T::zero() { force_n.x * (sideways / plane.x_m) } else { T::zero() };
    let across = curve.force_by_end(&end);
    let rate = -Vector3::new(across.x * e.x - swing * e.y, across.x * e.y + swing * e.x, across.y);
    let force = -Vector3::new(force_n.x * e.x, force_n.x * e.y, force_n.y);
    let moment = r.cross(&rate) + turn.cross(&force);
    add(sum, &Vector6::new(rate.x, rate.y, rate.z, moment.x, moment.y, moment.z));
    end
}

/// Which part of the equations is singular.
#[cold]
fn why_singular<T: Real>(linear: &[Linear<T>; CABLES]) -> Fault<T> {
    Fault::Step(match linear.iter().position(|cable| !cable.curve.is_finite()) {
        Some(cable) => StepFault::SingularCable(cable),
        None => StepFault::SingularStatics,
    })
}

#[inline]
fn add<T: Real>(sum: &mut [T; CABLES], wrench: &Vector6<T>) {
    for i in 0..CABLES {
        sum[i] += wrench[i];
    }
}

/// Euclidean norm.
#[inline]
fn norm<T: Real>(vector: &[T; CABLES]) -> T {
    vector.iter().fold(T::zero(), |sum, c| sum + *c * *c).sqrt()
}

impl<T: Real> CableLimits<T> {
    /// The same, but where there is none, that of the number type: nothing infinite is commanded. A limit
    /// that is no number stays so, and nothing keeps it.
    fn finite(&self) -> Self {
        let least = |limit: T, least: T| if limit < least { least } else { limit };
        let most = |limit: T| if limit > T::HUGE { T::HUGE } else { limit };
        Self {
            shortest_m: least(self.shortest_m, T::TINY),
            longest_m: most(self.longest_m),
            fastest_m_s: most(self.fastest_m_s),
            lowest_tension_n: least(self.lowest_tension_n, T::zero()),
            highest_tension_n: most(self.highest_tension_n),
        }
    }

    /// Refuses what is beyond the limits of this cable, the one of number `cable`.
    #[inline]
    fn check(
        &self,
        cable: usize,
        rest_length_m: T,
        speed_m_s: T,
        hanging: &Hanging<T>,
    ) -> Result<(), Fault<T>> {
        // Each is false for NaN.
        let fits = rest_length_m >= self.shortest_m && rest_length_m <= self.longest_m;
        if !fits {
            return Err(Fault::LengthBeyondWinch { cable, rest_length_m });
        }
        let in_time = speed_m_s.abs() <= self.fastest_m_s;
        if !in_time {
            return Err(Fault::SpeedBeyondWinch { cable, speed_m_s });
        }
        let tension_n = hanging.anchor_tension_n;
        let is_tight = tension_n >= self.lowest_tension_n;
        if !is_tight {
            return Err(Fault::TensionBelow { cable, tension_n });
        }
        let tension_n = tension_n.max(hanging.tension_n);
        let holds = tension_n <= self.highest_tension_n;
        if !holds {
            return Err(Fault::TensionAbove { cable, tension_n });
        }
        Ok(())
    }
}

impl<T: Real> TrackerSettings<T> {
    /// Those with which a tracker refuses only what it cannot prove: where no winch follows, as in tests and offline.
    #[must_use]
    pub fn unlimited(period_s: T) -> Self {
        let cable = CableLimits {
            shortest_m: T::zero(),
            longest_m: T::HUGE,
            fastest_m_s: T::HUGE,
            lowest_tension_n: T::zero(),
            highest_tension_n: T::HUGE,
        };
        Self {
            period_s,
            largest_move_m: T::HUGE,
            least_distance: T::zero(),
            fold_horizon_s: T::zero(),
            largest_error_n: T::HUGE,
            cables: [cable; CABLES],
        }
    }

    /// Refuses a solution near a singularity, and one on the way to a fold; `before` is the distance of
    /// the last one.
    #[inline]
    fn check_distance(&self, distance: T, before: T) -> Result<(), Fault<T>> {
        let is_apart = distance >= self.least_distance; // false for NaN
        if !is_apart {
            return Err(Fault::NearSingularity { distance });
        }
        // Towards a fold the square of the distance falls linearly with time.
        let (square, lost) = (distance * distance, before * before - distance * distance);
        // False for a horizon that is no number.
        let is_far = lost <= T::zero() || lost * self.fold_horizon_s <= square * self.period_s;
        if is_far {
            Ok(())
        } else {
            Err(Fault::FoldAhead { time_s: square * self.period_s / lost })
        }
    }

    /// Refuses a solution that rounding leaves too far from the true one.
    #[inline]
    fn check_error(
        &self,
        certificate: &Certificate<T>,
        closure_m: T,
        imbalance_n: T,
    ) -> Result<(), Fault<T>> {
        // False for NaN.
        if certificate.existence_n.iter().all(|error_n| *error_n <= self.largest_error_n) {
            Ok(())
        } else {
            Err(Fault::ResidualNotMet { closure_m, imbalance_n })
        }
    }
}

/// A cable linearised at its prediction, and then after the Newton step.
#[derive(Clone, Copy, Debug)]
struct Linear<T: Scalar> {
    plane: CablePlane<T>,
    curve: CurvePoint<T>,
    force_n: Vector2<T>,
    rest_length_m: T,
    /// The predicted way along the curve, N.
    along_n: T,
    hanging: Hanging<T>,
    /// Velocity of the attachment in the plane of the cable, m/s.
    end_m_s: Vector2<T>,
}

impl<T: Real> Linear<T> {
    /// A place for one. Ones, because zeros would be written by a call of memclr, word by word: 190
    /// instructions of a tick.
    #[inline]
    fn place() -> Self {
        let (one, ones) = (T::one(), Vector2::new(T::one(), T::one()));
        Self {
            plane: CablePlane {
                x_m: one,
                z_m: one,
                direction: ones,
                lever_arm: Vector3::new(one, one, one),
            },
            curve: CurvePoint {
                tangent: ones,
                length_per_force_m_n: one,
                normal_force_by_end_n_m: ones,
                length_by_end: ones,
                gap_m: ones,
            },
            force_n: ones,
            rest_length_m: one,
            along_n: one,
            hanging: Hanging { tension_n: one, anchor_tension_n: one, anchor_vertical_n: one },
            end_m_s: ones,
        }
    }

    /// Predicts by the rates of the last command, linearises there, and goes the shortest way back to
    /// the curve. Returns the predicted change of the force, N.
    #[inline]
    fn predict<M: CableModel<T>>(
        &mut self,
        model: &M,
        last: &CableCommand<T>,
        time_s: T,
    ) -> Vector2<T> {
        let predicted = last.force_rate_n_s * time_s;
        let force_n = last.force_n + predicted;
        let rest_length_m = last.rest_length_m + last.rest_length_rate_m_s * time_s;
        let end = model.end_point(force_n, rest_length_m);
        let curve = CurvePoint::new(&end, self.plane.x_m, self.plane.z_m);
        self.force_n = force_n + curve.correction_n();
        self.rest_length_m = rest_length_m + curve.length_correction_m();
        self.curve = curve;
        predicted
    }

    /// Rate of the rest length, going back along the curve at `back_n_s`.
    #[inline]
    fn rest_length_rate_m_s(&self, back_n_s: T) -> T {
        self.curve.length_by_end_m(&self.end_m_s) - self.curve.length_per_force_m_n * back_n_s
    }
}

impl<T: Real> Command<T> {
    /// How the cables hang.
    #[must_use]
    pub fn states(&self) -> [CableState<T>; CABLES] {
        self.cables
            .each_ref()
            .map(|cable| CableState { force_n: cable.force_n, rest_length_m: cable.rest_length_m })
    }

    /// Takes over what was found of the cables, going back along the curves at `back_n_s`.
    #[inline]
    fn take(&mut self, linear: &[Linear<T>; CABLES], back_n_s: &[T; CABLES]) {
        for (i, (cable, next)) in self.cables.iter_mut().zip(linear).enumerate() {
            let (curve, hanging) = (&next.curve, &next.hanging);
            cable.rest_length_m = next.rest_length_m;
            cable.rest_length_rate_m_s = next.rest_length_rate_m_s(back_n_s[i]);
            cable.direction = next.plane.direction;
            cable.force_n = next.force_n;
            cable.force_rate_n_s = curve.force_by_end(&next.end_m_s) - curve.tangent * back_n_s[i];
            cable.anchor_force_n = Vector2::new(next.force_n.x, hanging.anchor_vertical_n);
            cable.tension_n = hanging.tension_n;
            cable.anchor_tension_n = hanging.anchor_tension_n;
            cable.is_slack = next.force_n.y > T::zero() && hanging.anchor_vertical_n < T::zero();
        }
    }

    /// At rest with these forces and rest lengths; nothing is proven of it.
    fn at(states: &[CableState<T>; CABLES]) -> Self {
        let (zero, none) = (T::zero(), Vector2::new(T::zero(), T::zero()));
        Self {
            cables: states.map(|state| CableCommand {
                rest_length_m: state.rest_length_m,
                rest_length_rate_m_s: zero,
                direction: Vector2::new(T::one(), zero),
                force_n: state.force_n,
                force_rate_n_s: none,
                anchor_force_n: none,
                tension_n: zero,
                anchor_tension_n: zero,
                is_slack: false,
            }),
            certificate: Certificate::none(),
            distance: zero,
            closure_m: zero,
            imbalance_n: zero,
            parts: 0,
        }
    }
}
