//! How a [`Tracker`] starts: at forces and lengths that are known, or from a warm-start table.

use nalgebra::Vector2;

use super::{Command, Purpose, Refusal, SetPoint, Solution, Tracker, TrackerSettings, Twist};
use crate::certificate::{Move, load_rounding};
use crate::table::{self, COORDINATES, Table, TableFault};
use crate::{CABLES, CableState, Charted, Fault, Load, Pose, Real, Robot, ShapedCable};

/// Newton steps of [`Tracker::start`].
pub const START_STEPS: u8 = 20;

/// From a step on that is below this many rounding units of the tensions a start may be proven.
const START_STEP: f64 = 4096.0;

/// A part of a way that is proven is followed by one that is longer by this factor, one that is not by one that is shorter.
const LONGER: f64 = 17.0 / 16.0;
const SHORTER: f64 = 0.5;
/// Parts that are shorter, in units of the whole way, hardly lead on: a fold is there.
const SHORTEST: f64 = 1.0 / 16384.0;
/// Largest turn of a part. Attachments go straight, so that in its middle they would be closer to the platform origin by an
/// eighth of its square.
const LARGEST_TURN: f64 = 1.0 / 16.0;

impl<T: Real, M: ShapedCable<T>> Tracker<T, M> {
    /// Starts at the solution that Newton's method finds from `states`, at most [`START_STEPS`] steps
    /// away, each of which may be followed by one that is to be proven. That it is the branch wanted is the caller's to
    /// know; from here on it is kept.
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
        let mut tracker = Self::at(robot, load, settings, set_point, states)?;
        tracker.settle(set_point, Purpose::Command)?;
        Ok(tracker)
    }

    /// Starts on the sheet of a warm-start table: at the solution that its seed for the pose leads to.
    ///
    /// Where the table has no seed for it, and `way_parts` is not zero, at the nearest pose for which it has one
    /// ([`Table::nearest`]), and from there straight on to the pose of the set-point, in at most so many parts. Each is
    /// proven to stay on the branch as those of a tick are, and costs as much; limits are kept at the set-point, not on the
    /// way. Where the sheet comes back to this pose on another branch it is the one that this way leads to.
    ///
    /// # Errors
    /// [`Fault::Table`] when the table is for another robot or load, or has no seed for the pose and no such way was found;
    /// and those of [`Tracker::start`]; [`Fault::NotCertified`] as well when that ended elsewhere than the seed.
    pub fn start_from(
        robot: Robot<T, M>,
        load: Load<T>,
        settings: TrackerSettings<T>,
        set_point: &SetPoint<T>,
        table: &Table<'_>,
        way_parts: u16,
    ) -> Result<Self, Fault<T>>
    where
        M: Charted<T>,
    {
        table.check(&robot, &load).map_err(Fault::Table)?;
        match table.states(&robot, &load, &set_point.pose) {
            Ok(states) => {
                // Not by [`Tracker::start`]: to hand a tracker on takes 1.5 kB of stack more on a Cortex-M4F, and on a
                // Cortex-M7 10,000 instructions.
                let mut tracker = Self::at(robot, load, settings, set_point, &states)?;
                tracker.settle(set_point, Purpose::Command)?;
                tracker.check_seed(&states)?;
                Ok(tracker)
            }
            Err(fault @ (TableFault::Uncovered(_) | TableFault::OutsideRegion))
                if way_parts > 0 =>
            {
                let refused = Fault::Table(fault);
                let near = nearest(&robot, &load, &set_point.pose, table);
                let (way, states) = near.ok_or(refused)?;
                let mut tracker = Self::at(robot, load, settings, set_point, &states)?;
                tracker.go(&way, &states, way_parts).ok_or(refused)?;
                tracker.stay(set_point, Purpose::Command).map_err(Refusal::fault)?;
                Ok(tracker)
            }
            Err(fault) => Err(Fault::Table(fault)),
        }
    }

    /// [`Tracker::start_from`] with the robot, the load and the settings that it has.
    ///
    /// # Errors
    /// [`Fault`]; the last command then stands.
    pub fn restart_from(
        &mut self,
        set_point: &SetPoint<T>,
        table: &Table<'_>,
        way_parts: u16,
    ) -> Result<(), Fault<T>>
    where
        M: Charted<T>,
    {
        *self =
            Self::start_from(self.robot, self.load, self.settings, set_point, table, way_parts)?;
        Ok(())
    }

    /// At the pose of a set-point, with these forces and rest lengths, of which nothing is proven.
    fn at(
        robot: Robot<T, M>,
        load: Load<T>,
        settings: TrackerSettings<T>,
        set_point: &SetPoint<T>,
        states: &[CableState<T>; CABLES],
    ) -> Result<Self, Fault<T>> {
        let settings = TrackerSettings {
            cables: settings.cables.each_ref().map(super::CableLimits::finite),
            ..settings
        };
        let now = Solution { pose: set_point.pose, command: Command::at(states) };
        let load_rounding = load_rounding(&load, robot.per_moment_arm_m());
        let tracker = Self { robot, load, settings, load_rounding, now };
        tracker.check(set_point)?;
        Ok(tracker)
    }

    /// Makes steps where it is until one that is as small as rounding is proven, and then one for a purpose, which is.
    fn settle(&mut self, set_point: &SetPoint<T>, purpose: Purpose) -> Result<(), Fault<T>> {
        let mut refused = Fault::NotCertified { contraction: T::HUGE };
        let settled = T::constant(START_STEP) * T::EPSILON;
        for _ in 0..START_STEPS {
            // The steps follow each other without prediction.
            for cable in &mut self.now.command.cables {
                cable.rest_length_rate_m_s = T::zero();
                cable.force_rate_n_s = Vector2::new(T::zero(), T::zero());
            }
            self.forget();
            let (step_n, tensions_n) =
                self.stay(set_point, Purpose::Start).map_err(Refusal::fault)?;
            if step_n <= settled * tensions_n {
                self.forget();
                let Err(refusal) = self.stay(set_point, purpose) else { return Ok(()) };
                refused = refusal.fault();
                // A smaller step may be proven, and to be closer.
                let goes_on =
                    matches!(refused, Fault::NotCertified { .. } | Fault::ResidualNotMet { .. });
                if !goes_on {
                    break;
                }
            }
        }
        Err(refused)
    }

    /// What is known of one iterate is nothing that was proven of a solution before, or on the way to a fold.
    fn forget(&mut self) {
        self.now.command.certificate.existence_n = [T::zero(); CABLES];
        self.now.command.distance = T::zero();
    }

    /// A step where it is.
    fn stay(&mut self, set_point: &SetPoint<T>, purpose: Purpose) -> Result<(T, T), Refusal<T>> {
        self.advance(set_point, &Move::none(), T::zero(), purpose)
    }

    /// Refuses a solution that is not the one a table led to.
    fn check_seed(&self, states: &[CableState<T>; CABLES]) -> Result<(), Fault<T>> {
        let (mut moved_n, mut forces_n) = (T::zero(), T::zero());
        for (cable, state) in self.now.command.cables.iter().zip(states) {
            let moved = cable.force_n - state.force_n;
            moved_n = moved_n.max(moved.x.abs() + moved.y.abs());
            forces_n += cable.force_n.x.abs() + cable.force_n.y.abs();
        }
        let stayed = moved_n <= T::constant(2.0 * table::TOLERANCE) * forces_n; // false for NaN
        let contraction = self.now.command.certificate.contraction;
        if stayed { Ok(()) } else { Err(Fault::NotCertified { contraction }) }
    }

    /// Along a straight way to where it is, from where a table led to certain states, in at most so many parts. `None` where
    /// these are not enough, and where the way cannot begin.
    #[cold]
    #[inline(never)]
    fn go(
        &mut self,
        [from, to]: &[[T; COORDINATES]; 2],
        states: &[CableState<T>; CABLES],
        parts: u16,
    ) -> Option<()> {
        let between = |share: T| {
            let at = core::array::from_fn(|k| from[k] + (to[k] - from[k]) * share);
            table::pose(&at).ok()
        };
        // The tracker is where the way ends.
        let (begin, end) = (between(T::zero())?, self.now.pose);
        // Predicted as if the way took a second.
        let linear_m_s = end.position_m() - begin.position_m();
        let twist = Twist { linear_m_s, angular_rad_s: begin.turned_to(&end) };
        self.now.pose = begin;
        self.settle(&SetPoint { pose: begin, twist }, Purpose::Part).ok()?;
        self.check_seed(states).ok()?;
        let (mut done, mut share) = (T::zero(), T::one());
        for _ in 0..parts {
            let left = T::one() - done;
            let is_last = share >= left;
            if is_last {
                share = left;
            }
            let pose = if is_last { end } else { between(done + share)? };
            let (distance_m, lever_arm) = self.now.pose.apart(&pose);
            let attachment_m = distance_m + lever_arm * self.robot.moment_arm_m();
            let moved = Move { attachment_m, lever_arm };
            let is_proven = lever_arm <= T::constant(LARGEST_TURN)
                && self.advance(&SetPoint { pose, twist }, &moved, share, Purpose::Part).is_ok();
            if is_proven && is_last {
                return Some(());
            } else if is_proven {
                done += share;
                share *= T::constant(LONGER);
            } else if share > T::constant(SHORTEST) {
                share *= T::constant(SHORTER);
            } else {
                return None;
            }
        }
        None
    }
}

/// The coordinates of the nearest pose that a table covers and of a pose, and the states that the table leads to at the
/// first.
#[cold]
#[inline(never)]
#[allow(clippy::type_complexity)] // a way, and states
fn nearest<T: Real, M: Charted<T>>(
    robot: &Robot<T, M>,
    load: &Load<T>,
    pose: &Pose<T>,
    table: &Table<'_>,
) -> Option<([[T; COORDINATES]; 2], [CableState<T>; CABLES])> {
    let to = table::coordinates(pose)?;
    let from = table.nearest(&to, robot.moment_arm_m())?;
    let states = table.states(robot, load, &table::pose(&from).ok()?).ok()?;
    Some(([from, to], states))
}
