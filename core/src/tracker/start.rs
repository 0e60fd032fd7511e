//! How a [`Tracker`] starts: at forces and lengths that are known, or from a warm-start table.

use nalgebra::{Vector2, Vector3};

use super::{Command, Purpose, Refusal, SetPoint, Solution, Tracker, TrackerSettings, Twist};
use crate::certificate::Move;
use crate::table::{self, Table, TableFault};
use crate::{CABLES, CableState, Charted, Fault, Load, Pose, Real, Robot, ShapedCable};

/// Newton steps of [`Tracker::start`].
const START_STEPS: u8 = 20;

/// A start has settled when a step is below this many rounding units of the tensions: what rounding
/// times the condition of a good posture leaves.
const START_STEP: f64 = 4096.0;

/// A part of a way that is proven is followed by one that is longer by this factor, one that is not by one that is shorter.
const LONGER: f64 = 17.0 / 16.0;
const SHORTER: f64 = 0.5;

impl<T: Real, M: ShapedCable<T>> Tracker<T, M> {
    /// Starts at the solution that Newton's method finds from `states`, at most twenty steps
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
        let mut tracker = Self::at(robot, load, settings, set_point, states)?;
        tracker.settle(set_point, Purpose::Command)?;
        Ok(tracker)
    }

    /// Starts on the sheet of a warm-start table: at the solution that its seed for the pose leads to.
    ///
    /// Where the table has no seed for it, and `way_parts` is not zero, at the nearest pose for which it has one
    /// ([`Table::nearest`]), and from there straight on to the pose of the set-point, in at most so many parts. Each is
    /// proven to stay on the branch as those of a tick are, and costs as much; limits are those of the set-point only. Where
    /// the sheet comes back to this pose on another branch it is the one that this way leads to.
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
                let mut tracker = Self::at(robot, load, settings, set_point, &states)?;
                tracker.settle(set_point, Purpose::Command)?;
                tracker.check_seed(&states)?;
                Ok(tracker)
            }
            Err(fault @ (TableFault::Uncovered(_) | TableFault::OutsideRegion))
                if way_parts > 0 =>
            {
                let near = nearest(&robot, &load, &set_point.pose, table);
                let (pose, states) = near.ok_or(Fault::Table(fault))?;
                let mut tracker = Self::at(robot, load, settings, set_point, &states)?;
                tracker.now.pose = pose;
                tracker.go(&states, set_point, way_parts).ok_or(Fault::Table(fault))?;
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
        let tracker = Self { robot, load, settings, now };
        tracker.check(set_point)?;
        Ok(tracker)
    }

    /// Makes steps where it is until they are as small as rounding, and the last one for a purpose.
    fn settle(&mut self, set_point: &SetPoint<T>, purpose: Purpose) -> Result<(), Fault<T>> {
        let mut contraction = T::HUGE;
        for _ in 0..START_STEPS {
            // The steps follow each other without prediction, and nothing was known before.
            for cable in &mut self.now.command.cables {
                cable.rest_length_rate_m_s = T::zero();
                cable.force_rate_n_s = Vector2::new(T::zero(), T::zero());
            }
            self.now.command.certificate.existence_radius_n = T::zero();
            let settled = T::constant(START_STEP) * T::EPSILON;
            match self.stay(set_point, Purpose::Start) {
                Ok((step_n, tensions_n)) if step_n <= settled * tensions_n => {
                    self.stay(set_point, purpose).map_err(Refusal::fault)?;
                    return Ok(());
                }
                Ok(_) => {}
                Err(Refusal::Unproven { contraction: found }) => contraction = found,
                Err(Refusal::Fault(fault)) => return Err(fault),
            }
        }
        Err(Fault::NotCertified { contraction })
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

    /// From where a table led to certain states straight to a pose, in at most so many parts. `None` where these are not
    /// enough, and where it cannot begin.
    #[cold]
    #[inline(never)]
    fn go(&mut self, states: &[CableState<T>; CABLES], to: &SetPoint<T>, parts: u16) -> Option<()> {
        let from = self.now.pose;
        // Predicted as if the way took a second.
        let linear_m_s = to.pose.position_m() - from.position_m();
        let twist = Twist { linear_m_s, angular_rad_s: from.turned_to(&to.pose) };
        self.settle(&SetPoint { pose: from, twist }, Purpose::Part).ok()?;
        self.check_seed(states).ok()?;
        let (mut done, mut share) = (T::zero(), T::one());
        for _ in 0..parts {
            let reached = done + share;
            let is_last = reached >= T::one();
            let pose = if is_last { to.pose } else { from.between(&to.pose, reached) };
            let (distance_m, lever_arm) = self.now.pose.apart(&pose);
            let attachment_m = distance_m + lever_arm * self.robot.moment_arm_m();
            let moved = Move { attachment_m, lever_arm };
            let time_s = if is_last { T::one() - done } else { share };
            if self.advance(&SetPoint { pose, twist }, &moved, time_s, Purpose::Part).is_err() {
                share *= T::constant(SHORTER);
            } else if is_last {
                return Some(());
            } else {
                done = reached;
                share *= T::constant(LONGER);
            }
        }
        None
    }
}

/// The nearest pose that a table covers, and the states that it leads to there.
#[cold]
#[inline(never)]
fn nearest<T: Real, M: Charted<T>>(
    robot: &Robot<T, M>,
    load: &Load<T>,
    pose: &Pose<T>,
    table: &Table<'_>,
) -> Option<(Pose<T>, [CableState<T>; CABLES])> {
    let at = table.nearest(&table::coordinates(pose)?, robot.moment_arm_m())?;
    let [x, y, z, turn @ ..] = at;
    let near = Pose::with_turn_vector(Vector3::new(x, y, z), &turn.into()).ok()?;
    Some((near, table.states(robot, load, &near).ok()?))
}
