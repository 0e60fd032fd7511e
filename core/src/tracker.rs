//! One branch of the inverse kinematics, followed from tick to tick.

use nalgebra::{Vector2, Vector3, Vector6};

use crate::certificate::{CableFacts, Move, NewtonSize, certify};
use crate::elimination::Inverse;
use crate::geometry::norm3;
use crate::newton::{is_length, max_component, norm};
use crate::statics::Balance;
use crate::{
    CABLES, CablePlane, CableState, Certificate, CurvePoint, Fault, Load, Pose, Real, Robot,
    Scalar, ShapedCable, StepFault,
};

/// Velocity of the platform: of its origin, and of turning, world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist<T: Scalar> {
    /// Velocity of the platform origin, m/s.
    pub linear_m_s: Vector3<T>,
    /// Angular velocity, rad/s.
    pub angular_rad_s: Vector3<T>,
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
    /// Largest distance from the true solution that is accepted, rounding included, in newtons along
    /// the force curves: see [`Certificate::existence_radius_n`].
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
    /// Force on the cable at the attachment, `(Fx, Fz)` in its plane, N.
    pub force_n: Vector2<T>,
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
    solution: Solution<T>,
    command: Command<T>,
}

/// Parts of a move that one tick tries at most: eight that succeed and three that were too long.
pub const MAX_PARTS: u8 = 11;

/// Shortest part of a move.
const SHORTEST_PART: f64 = 1.0 / 8.0;

/// A certified solution, with what the next tick needs of it.
#[derive(Clone, Copy, Debug)]
struct Solution<T: Scalar> {
    pose: Pose<T>,
    directions: [Vector2<T>; CABLES],
    states: [CableState<T>; CABLES],
    rates: [CableRate<T>; CABLES],
    distance: T,
    certificate: Certificate<T>,
    closure_m: T,
    imbalance_n: T,
}

/// How force and rest length of a cable change with time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CableRate<T: Scalar> {
    force_n_s: Vector2<T>,
    rest_length_m_s: T,
}

impl<T: Real, M: ShapedCable<T>> Tracker<T, M> {
    /// Starts at the solution that Newton's method finds from `states`, at most [`START_STEPS`] steps
    /// away. That it is the branch wanted is the caller's to know; from here on it is kept.
    ///
    /// # Errors
    /// [`Fault`].
    pub fn start(
        robot: Robot<T, M>,
        load: Load<T>,
        settings: TrackerSettings<T>,
        set_point: &SetPoint<T>,
        states: &[CableState<T>; CABLES],
    ) -> Result<Self, Fault<T>> {
        let still = Move { attachment_m: T::zero(), lever_arm: T::zero() };
        let mut rates = [CableRate::still(); CABLES];
        let mut directions = [Vector2::new(T::one(), T::zero()); CABLES];
        let mut states = *states;
        let mut outcome = Err(Fault::NotCertified { contraction: T::HUGE });
        for _ in 0..START_STEPS {
            let from = Start { states: &states, rates: &rates, directions: &directions };
            let part =
                Part { robot: &robot, load: &load, set_point, moved: &still, time_s: T::zero() };
            let next = part.solve(&from, T::zero())?;
            let settled = next.change <= T::constant(START_CHANGE) * T::EPSILON;
            (states, rates) = (next.solution.states, next.solution.rates);
            directions = next.solution.directions;
            outcome = next.certified();
            if settled && outcome.is_ok() {
                break;
            }
        }
        let solution = outcome?;
        let mut tracker = Self { robot, load, settings, solution, command: Command::none() };
        tracker.accept(solution, 1)?;
        Ok(tracker)
    }

    /// The next command: for the pose of `set_point`, on the branch of the last one.
    ///
    /// # Errors
    /// [`Fault`]; the last command then stands.
    pub fn tick(&mut self, set_point: &SetPoint<T>) -> Result<&Command<T>, Fault<T>> {
        let goal = self.check(set_point)?;
        let mut solution = self.solution;
        let (mut done, mut share) = (T::zero(), T::one());
        let mut last = Fault::NotCertified { contraction: T::HUGE };
        for parts in 1..=MAX_PARTS {
            let reached = done + share;
            let is_whole = reached >= T::one();
            let between;
            let here = if is_whole {
                set_point
            } else {
                let pose = self.solution.pose.between(&set_point.pose, reached);
                between = SetPoint { pose, twist: set_point.twist };
                &between
            };
            let moved =
                Move { attachment_m: goal.attachment_m * share, lever_arm: goal.lever_arm * share };
            let part = Part {
                robot: &self.robot,
                load: &self.load,
                set_point: here,
                moved: &moved,
                time_s: self.settings.period_s * share,
            };
            let from = Start {
                states: &solution.states,
                rates: &solution.rates,
                directions: &solution.directions,
            };
            match part
                .solve(&from, solution.certificate.existence_radius_n)
                .and_then(Outcome::certified)
            {
                Ok(next) if is_whole => {
                    self.accept(next, parts)?;
                    return Ok(&self.command);
                }
                Ok(next) => {
                    solution = next;
                    done = reached;
                }
                Err(fault) => {
                    last = fault;
                    share *= T::constant(0.5);
                    if share < T::constant(SHORTEST_PART) {
                        break;
                    }
                }
            }
        }
        Err(last)
    }
}

/// Newton steps of [`Tracker::start`].
pub const START_STEPS: u8 = 20;

/// A start has settled when a step changes forces and rest lengths by less than this many rounding
/// units, relative: what rounding times the condition of a good posture leaves.
const START_CHANGE: f64 = 4096.0;

/// Where a part of a move starts.
struct Start<'a, T: Scalar> {
    states: &'a [CableState<T>; CABLES],
    rates: &'a [CableRate<T>; CABLES],
    directions: &'a [Vector2<T>; CABLES],
}

/// A move, or a part of one.
struct Part<'a, T: Scalar, M> {
    robot: &'a Robot<T, M>,
    load: &'a Load<T>,
    set_point: &'a SetPoint<T>,
    moved: &'a Move<T>,
    time_s: T,
}

/// Where a Newton step has led, and whether that is proven.
struct Outcome<T: Scalar> {
    solution: Solution<T>,
    /// Largest relative change of a force or rest length.
    change: T,
    /// Without a proof, the contraction that was found.
    unproven: Option<T>,
}

impl<T: Real> Outcome<T> {
    fn certified(self) -> Result<Solution<T>, Fault<T>> {
        match self.unproven {
            None => Ok(self.solution),
            Some(contraction) => Err(Fault::NotCertified { contraction }),
        }
    }
}

impl<T: Real, M: ShapedCable<T>> Part<'_, T, M> {
    /// Predicts, makes one Newton step at the pose, and tries to certify it. The solution that the
    /// part starts from is known to `known_n`.
    #[inline]
    fn solve(&self, from: &Start<'_, T>, known_n: T) -> Result<Outcome<T>, Fault<T>> {
        let (robot, pose) = (self.robot, &self.set_point.pose);
        let balance = Balance::with_directions(robot, self.load, pose, |i| from.directions[i])
            .map_err(Fault::Geometry)?;
        let planes = balance.planes();
        let mut states = *from.states;
        let mut curves = [CurvePoint::none(); CABLES];
        let mut facts = [CableFacts::none(); CABLES];
        let mut columns = [[T::zero(); CABLES]; CABLES];
        let mut imbalance = *balance.wrench_n();
        let (mut closure_m, mut rounding_n, mut behind_sq) = (T::zero(), T::zero(), T::zero());
        let size_m = pose.size_m() + robot.moment_arm_m();
        for i in 0..CABLES {
            let (plane, model, state) = (&planes[i], &robot.cables()[i].model, &mut states[i]);
            let predicted = from.rates[i].force_n_s * self.time_s;
            state.force_n += predicted;
            state.rest_length_m += from.rates[i].rest_length_m_s * self.time_s;
            if !is_length(state.rest_length_m) {
                return Err(Fault::Step(StepFault::LengthNotPositive(i)));
            }
            let end = model.end_point(state.force_n, state.rest_length_m);
            let curve = CurvePoint::new(&end, plane.x_m, plane.z_m);
            if !curve.is_finite() {
                return Err(Fault::Step(StepFault::SingularCable(i)));
            }
            let cable = CableFacts::new(
                &M::SHAPE,
                model.weight_n_m(),
                plane,
                state,
                &curve,
                self.moved.attachment_m,
            );
            imbalance += plane.wrench_n(&(state.force_n + curve.correction_n()));
            columns[i] = plane.wrench_n(&curve.tangent).data.0[0];
            closure_m = closure_m.max(cable.gap_m);
            rounding_n += cable.rounding_n(&curve, state.rest_length_m + size_m);
            let along = predicted.x * curve.tangent.x + predicted.y * curve.tangent.y;
            behind_sq += along * along;
            curves[i] = curve;
            facts[i] = cable;
        }
        let inverse = Inverse::new(&columns).ok_or(Fault::Step(StepFault::SingularStatics))?;
        let advance_n = inverse.times(&-imbalance);
        let mut change = T::zero();
        for i in 0..CABLES {
            let (curve, state) = (&curves[i], &mut states[i]);
            let force_change = curve.correction_n() + curve.tangent * advance_n[i];
            let length_change =
                curve.length_correction_m() + curve.length_per_force_m_n * advance_n[i];
            let size = state.force_n.x.abs() + state.force_n.y.abs();
            let by_force = (force_change.x.abs() + force_change.y.abs()) / size;
            change = change.max(by_force).max(length_change.abs() / state.rest_length_m);
            state.force_n += force_change;
            state.rest_length_m += length_change;
            if !is_length(state.rest_length_m) {
                return Err(Fault::Step(StepFault::LengthNotPositive(i)));
            }
            if !(state.force_n.x + state.force_n.y).is_finite() {
                return Err(Fault::Step(StepFault::SingularCable(i)));
            }
        }
        let inverse_norm = inverse.norm();
        let newton = NewtonSize {
            step_n: norm(&advance_n),
            // The tangents have turned a little since.
            behind_n: behind_sq.sqrt() + known_n * T::constant(1.25),
            rounding_n: rounding_n * T::EPSILON,
        };
        let certificate = certify(&M::SHAPE, &facts, self.moved, inverse_norm, &newton);
        let (certificate, unproven) = match certificate {
            Ok(certificate) => (certificate, None),
            Err(contraction) => (Certificate::none(), Some(contraction)),
        };
        let rates = self.rates(planes, &states, &curves, &inverse);
        let solution = Solution {
            pose: *pose,
            directions: core::array::from_fn(|i| planes[i].direction),
            states,
            rates,
            distance: T::one() / inverse_norm,
            certificate,
            closure_m,
            imbalance_n: max_component(&imbalance),
        };
        Ok(Outcome { solution, change, unproven })
    }

    /// How forces and rest lengths change at the twist of the set-point: the equations of closure and
    /// of balance, differentiated by time.
    #[inline]
    fn rates(
        &self,
        planes: &[CablePlane<T>; CABLES],
        states: &[CableState<T>; CABLES],
        curves: &[CurvePoint<T>; CABLES],
        inverse: &Inverse<T>,
    ) -> [CableRate<T>; CABLES] {
        let (twist, arm_m) = (&self.set_point.twist, self.robot.moment_arm_m());
        let load = self.load.moment_rate_nm_s(&self.set_point.pose, &twist.angular_rad_s)
            * self.robot.per_moment_arm_m();
        let mut sum = Vector6::new(T::zero(), T::zero(), T::zero(), load.x, load.y, load.z);
        let mut ends = [Vector2::new(T::zero(), T::zero()); CABLES];
        for i in 0..CABLES {
            let (plane, state) = (&planes[i], &states[i]);
            let (e, r) = (&plane.direction, &plane.lever_arm);
            let turn = twist.angular_rad_s.cross(r);
            let v = twist.linear_m_s + turn * arm_m;
            let end = Vector2::new(e.x * v.x + e.y * v.y, v.z);
            ends[i] = end;
            // The plane turns: the horizontal force with it.
            let sideways = e.x * v.y - e.y * v.x;
            let swing = if plane.x_m > T::zero() {
                state.force_n.x * (sideways / plane.x_m)
            } else {
                T::zero()
            };
            let in_plane = curves[i].force_by_end(&end);
            let rate = -Vector3::new(
                in_plane.x * e.x - swing * e.y,
                in_plane.x * e.y + swing * e.x,
                in_plane.y,
            );
            let force =
                -Vector3::new(state.force_n.x * e.x, state.force_n.x * e.y, state.force_n.y);
            let moment = r.cross(&rate) + turn.cross(&force);
            sum += Vector6::new(rate.x, rate.y, rate.z, moment.x, moment.y, moment.z);
        }
        let along_n_s = inverse.times(&-sum);
        core::array::from_fn(|i| {
            let curve = &curves[i];
            CableRate {
                force_n_s: curve.force_by_end(&ends[i]) + curve.tangent * along_n_s[i],
                rest_length_m_s: curve.length_by_end_m(&ends[i])
                    + curve.length_per_force_m_n * along_n_s[i],
            }
        })
    }
}

impl<T: Real, M: ShapedCable<T>> Tracker<T, M> {
    /// Refuses a set-point that is not finite or too far away; else how far the move is.
    fn check(&self, set_point: &SetPoint<T>) -> Result<Move<T>, Fault<T>> {
        let twist = &set_point.twist;
        let (linear_m_s, angular_rad_s) = (norm3(&twist.linear_m_s), norm3(&twist.angular_rad_s));
        let (distance_m, lever_arm) = self.solution.pose.apart(&set_point.pose);
        let turn_m = lever_arm * self.robot.moment_arm_m();
        let largest = self.settings.largest_move_m;
        let way_m =
            (linear_m_s + angular_rad_s * self.robot.moment_arm_m()) * self.settings.period_s;
        let sum = distance_m + turn_m + way_m;
        if !sum.is_finite() {
            return Err(Fault::NonFiniteSetPoint);
        }
        if distance_m > largest || turn_m > largest || way_m > largest + largest {
            return Err(Fault::JumpingSetPoint {
                distance_m: distance_m.max(linear_m_s * self.settings.period_s),
                turn_m: turn_m.max(way_m - linear_m_s * self.settings.period_s),
            });
        }
        Ok(Move { attachment_m: distance_m + turn_m, lever_arm })
    }

    /// Makes a certified solution the present one, unless it is beyond a limit.
    fn accept(&mut self, next: Solution<T>, parts: u8) -> Result<(), Fault<T>> {
        let settings = &self.settings;
        let (now, before) = (next.distance, self.solution.distance);
        if !(now >= settings.least_distance) {
            return Err(Fault::NearSingularity { distance: now });
        }
        // Towards a fold the square of the distance falls linearly with time.
        let lost = before * before - now * now;
        if lost > T::zero() {
            let time_s = now * now * settings.period_s / lost;
            if time_s < settings.fold_horizon_s {
                return Err(Fault::FoldAhead { time_s });
            }
        }
        if !(next.certificate.existence_radius_n <= settings.largest_error_n) {
            return Err(Fault::ResidualNotMet {
                closure_m: next.closure_m,
                imbalance_n: next.imbalance_n,
            });
        }
        let mut cables = self.command.cables;
        for i in 0..CABLES {
            let weight_n_m = self.robot.cables()[i].model.weight_n_m();
            cables[i] = CableCommand::new(weight_n_m, &next.states[i], &next.rates[i]);
            settings.cables[i].check(i, &cables[i])?;
        }
        self.command = Command {
            cables,
            certificate: next.certificate,
            distance: now,
            closure_m: next.closure_m,
            imbalance_n: next.imbalance_n,
            parts,
        };
        self.solution = next;
        Ok(())
    }

    /// The last certified command.
    pub fn command(&self) -> &Command<T> {
        &self.command
    }

    /// The pose of the last certified command.
    pub fn pose(&self) -> &Pose<T> {
        &self.solution.pose
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

impl<T: Real> CableLimits<T> {
    /// Whether `command` keeps the limits of this cable, the one of number `cable`.
    fn check(&self, cable: usize, command: &CableCommand<T>) -> Result<(), Fault<T>> {
        let rest_length_m = command.rest_length_m;
        // Each written so that NaN fails.
        if !(rest_length_m >= self.shortest_m && rest_length_m <= self.longest_m) {
            return Err(Fault::LengthBeyondWinch { cable, rest_length_m });
        }
        let speed_m_s = command.rest_length_rate_m_s;
        if !(speed_m_s.abs() <= self.fastest_m_s) {
            return Err(Fault::SpeedBeyondWinch { cable, speed_m_s });
        }
        let (at_anchor, at_attachment) = (command.anchor_tension_n, command.tension_n);
        if !(at_anchor >= self.lowest_tension_n) {
            return Err(Fault::TensionBelow { cable, tension_n: at_anchor });
        }
        let tension_n = at_anchor.max(at_attachment);
        if !(tension_n <= self.highest_tension_n) {
            return Err(Fault::TensionAbove { cable, tension_n });
        }
        Ok(())
    }
}

impl<T: Real> CableCommand<T> {
    #[inline]
    fn new(weight_n_m: T, state: &CableState<T>, rate: &CableRate<T>) -> Self {
        let weight_n = weight_n_m * state.rest_length_m;
        let anchor_force_n = Vector2::new(state.force_n.x, state.force_n.y - weight_n);
        Self {
            rest_length_m: state.rest_length_m,
            rest_length_rate_m_s: rate.rest_length_m_s,
            force_n: state.force_n,
            anchor_force_n,
            tension_n: T::hypot_with_excess(state.force_n.x, state.force_n.y).0,
            anchor_tension_n: T::hypot_with_excess(anchor_force_n.x, anchor_force_n.y).0,
            is_slack: state.force_n.y > T::zero() && anchor_force_n.y < T::zero(),
        }
    }
}

impl<T: Real> Command<T> {
    /// A place for a command, not one to be followed.
    fn none() -> Self {
        let (zero, none) = (T::zero(), Vector2::new(T::zero(), T::zero()));
        let cable = CableCommand {
            rest_length_m: zero,
            rest_length_rate_m_s: zero,
            force_n: none,
            anchor_force_n: none,
            tension_n: zero,
            anchor_tension_n: zero,
            is_slack: false,
        };
        Self {
            cables: [cable; CABLES],
            certificate: Certificate::none(),
            distance: zero,
            closure_m: zero,
            imbalance_n: zero,
            parts: 0,
        }
    }
}

impl<T: Real> CableRate<T> {
    fn still() -> Self {
        Self { force_n_s: Vector2::new(T::zero(), T::zero()), rest_length_m_s: T::zero() }
    }
}
