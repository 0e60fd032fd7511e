//! The way under way: one motion after the other, in a time of its own that can be slowed to zero.

use crate::controller::motion::{Motion, MotionFault, MotionLimits, Stance, WayPoint};
use crate::{Fault, Real, Remedy, Scalar, SetPoint};

/// Why a motion came to rest before its end.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Halt<T> {
    /// It was asked for.
    Asked,
    /// For this fault.
    Fault(Fault<T>),
}

/// How time passes on a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Clock<T> {
    /// Time between two ticks, s.
    pub(super) period_s: T,
    /// Ticks in which the path's own time comes to a stand.
    pub(super) halt_ticks: u32,
}

/// What became of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Progress<T> {
    /// It goes on.
    Moving,
    /// At rest at the end.
    Arrived,
    /// At rest on the way.
    Halted,
    /// No command for it: the platform is where it was a tick ago.
    Refused(Fault<T>),
}

/// One tick of a path's time, in the fixed point in which it is counted: nothing is rounded away
/// however long a motion takes.
const TICK: u32 = 32;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Path<T: Scalar> {
    motion: Motion<T>,
    /// Accepted: it can follow the motion.
    next: Option<WayPoint<T>>,
    /// Time since the motion began, in ticks times `2^TICK`; at most a tick before it.
    elapsed: i64,
    /// Speed of the path's time, in parts of `halt_ticks`.
    rate: u32,
    /// Whether the rate falls.
    is_slowing: bool,
    halt: Option<Halt<T>>,
}

impl<T: Real> Path<T> {
    pub(super) fn new(motion: Motion<T>, clock: &Clock<T>) -> Self {
        // A motion begins smoothly by itself.
        let rate = clock.halt_ticks;
        Self { motion, next: None, elapsed: 0, rate, is_slowing: false, halt: None }
    }

    /// Whether a way-point can be [offered](Self::offer).
    pub(super) fn has_room(&self) -> bool {
        self.next.is_none() && self.halt.is_none()
    }

    /// Puts a way-point behind the motion. Nothing changes when it is refused.
    pub(super) fn offer(
        &mut self,
        way_point: WayPoint<T>,
        limits: &MotionLimits<T>,
        clock: &Clock<T>,
    ) -> Result<(), MotionFault<T>> {
        let (stance, twist) = self.motion.at(T::one());
        Motion::new(&stance, &twist, &way_point, limits, clock.period_s)?;
        self.next = Some(way_point);
        Ok(())
    }

    /// Slows the path's time to zero, evenly over `halt_ticks`. The first reason counts.
    pub(super) fn halt(&mut self, halt: Halt<T>) {
        self.is_slowing = true;
        self.halt.get_or_insert(halt);
    }

    /// Why it comes to rest, or came.
    pub(super) fn halted(&self) -> Option<Halt<T>> {
        self.halt
    }

    /// Goes on after a halt, as evenly.
    pub(super) fn resume(&mut self) {
        self.is_slowing = false;
        self.halt = None;
    }

    /// The next tick: what `follow` takes is where the platform is then; it is called at most twice.
    ///
    /// When slower is better, the path halts, and slower is tried at once. A fold that lies as far
    /// ahead as the halt lasts is never reached: its time grows as the rate falls.
    pub(super) fn advance(
        &mut self,
        stance: &mut Stance<T>,
        limits: &MotionLimits<T>,
        clock: &Clock<T>,
        age_ticks: u32,
        mut follow: impl FnMut(&SetPoint<T>) -> Result<(), Fault<T>>,
    ) -> Progress<T> {
        let rate = if self.is_slowing {
            self.rate.saturating_sub(1)
        } else {
            (self.rate + 1).min(clock.halt_ticks)
        };
        if self.after(rate, clock) > self.end() {
            self.take_next(limits, clock, age_ticks);
        }
        let outcome = match self.move_to(rate, clock, &mut follow) {
            Err(fault) if rate > 0 && is_milder_when_slower(&fault) => {
                self.halt(Halt::Fault(fault));
                self.move_to(rate - 1, clock, &mut follow)
            }
            outcome => outcome,
        };
        match outcome {
            Ok(reached) => {
                *stance = reached;
                let is_last = self.next.is_none() && !self.motion.passes_through();
                if is_last && self.elapsed == self.end() {
                    Progress::Arrived
                } else if self.rate == 0 {
                    Progress::Halted
                } else {
                    Progress::Moving
                }
            }
            Err(fault) => {
                self.halt(Halt::Fault(fault));
                self.rate = 0;
                Progress::Refused(fault)
            }
        }
    }

    /// Moves on at `rate`, if `follow` can.
    fn move_to(
        &mut self,
        rate: u32,
        clock: &Clock<T>,
        follow: &mut impl FnMut(&SetPoint<T>) -> Result<(), Fault<T>>,
    ) -> Result<Stance<T>, Fault<T>> {
        let number = |n: u32| T::constant(f64::from(n));
        let elapsed = self.after(rate, clock).max(0).min(self.end());
        // Both halves fit.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let (ticks, part) = ((elapsed >> TICK) as u32, elapsed as u32);
        let elapsed_ticks =
            number(ticks) + number(part) * T::constant(0.5 / f64::from(1_u32 << 31));
        let (stance, set_point) = self
            .motion
            .set_point(
                elapsed_ticks / number(self.motion.ticks()),
                number(rate) / number(clock.halt_ticks),
            )
            .map_err(Fault::Geometry)?;
        follow(&set_point)?;
        (self.elapsed, self.rate) = (elapsed, rate);
        Ok(stance)
    }

    /// The next motion, or straight on to rest when the platform moves and none has come.
    fn take_next(&mut self, limits: &MotionLimits<T>, clock: &Clock<T>, age_ticks: u32) {
        let (stance, twist) = self.motion.at(T::one());
        let period_s = clock.period_s;
        let next = self
            .next
            .take()
            .and_then(|next| Motion::new(&stance, &twist, &next, limits, period_s).ok());
        let motion = match next {
            Some(motion) => motion,
            None if self.motion.passes_through() => {
                self.halt.get_or_insert(Halt::Fault(Fault::StaleSetPoint { age_ticks }));
                Motion::run_out(&stance, &twist, limits, period_s)
            }
            None => return,
        };
        self.elapsed -= self.end();
        self.motion = motion;
    }

    fn after(&self, rate: u32, clock: &Clock<T>) -> i64 {
        // Never zero, but only the settings know.
        self.elapsed + (i64::from(rate) << TICK) / i64::from(clock.halt_ticks.max(1))
    }

    fn end(&self) -> i64 {
        i64::from(self.motion.ticks()) << TICK
    }
}

/// Whether the same path may be had at a lower speed.
fn is_milder_when_slower<T: Real>(fault: &Fault<T>) -> bool {
    fault.remedy() == Remedy::GoSlower || matches!(fault, Fault::FoldAhead { .. })
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // what is handed on, not reckoned again
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use crate::Twist;
    use crate::controller::motion::Pace;
    use crate::controller::motion::tests::limits;

    const CLOCK: Clock<f64> = Clock { period_s: 1e-3, halt_ticks: 100 };

    fn at(x_m: f64) -> Stance<f64> {
        Stance { position_m: Vector3::new(x_m, 0.0, 0.0), orientation: UnitQuaternion::identity() }
    }

    fn along_x(speed_m_s: f64) -> Twist<f64> {
        Twist { linear_m_s: Vector3::new(speed_m_s, 0.0, 0.0), ..Twist::none() }
    }

    fn way_point(x_m: f64, speed_m_s: f64, duration_s: f64) -> WayPoint<f64> {
        WayPoint { stance: at(x_m), twist: along_x(speed_m_s), pace: Pace::Duration(duration_s) }
    }

    /// A path on the x axis, where it is, and the set-points that were followed.
    struct Walk {
        path: Path<f64>,
        stance: Stance<f64>,
        last: (f64, f64),
        largest_change: f64,
    }

    impl Walk {
        fn new(first: &WayPoint<f64>) -> Self {
            let motion = Motion::new(&at(0.0), &Twist::none(), first, &limits(), 1e-3).unwrap();
            Self {
                path: Path::new(motion, &CLOCK),
                stance: at(0.0),
                last: (0.0, 0.0),
                largest_change: 0.0,
            }
        }

        fn offer(&mut self, next: WayPoint<f64>) -> Result<(), MotionFault<f64>> {
            self.path.offer(next, &limits(), &CLOCK)
        }

        /// One tick; position and speed must belong together.
        fn step(&mut self, limit: impl Fn(f64, f64) -> Option<Fault<f64>>) -> Progress<f64> {
            let mut reached = self.last;
            let progress = self.path.advance(&mut self.stance, &limits(), &CLOCK, 7, |set_point| {
                let (x, v) = (set_point.pose.position_m().x, set_point.twist.linear_m_s.x);
                if let Some(fault) = limit(x, v) {
                    return Err(fault);
                }
                reached = (x, v);
                Ok(())
            });
            let (x, v) = self.last;
            if !matches!(progress, Progress::Refused(_)) {
                // The rate of time falls by a hundredth a tick: at 0.5 m/s, 5 mm/s, with 1 mm/s of
                // the motion's own.
                assert!(
                    (reached.0 - x - reached.1 * 1e-3).abs() < 6e-6,
                    "{:?} {reached:?}",
                    (x, v)
                );
                self.largest_change = self.largest_change.max((reached.1 - v).abs());
            }
            assert_eq!(self.stance.position_m.x, reached.0);
            self.last = reached;
            progress
        }

        fn until_rest(&mut self, limit: impl Fn(f64, f64) -> Option<Fault<f64>>) -> Progress<f64> {
            for _ in 0..20_000 {
                match self.step(&limit) {
                    Progress::Moving => {}
                    progress => return progress,
                }
            }
            panic!("never at rest");
        }
    }

    #[test]
    fn passes_through_one_way_point_and_stops_at_the_next() {
        let mut walk = Walk::new(&way_point(0.5, 0.3, 3.0));
        assert!(walk.path.has_room());
        walk.offer(way_point(1.0, 0.0, 3.0)).unwrap();
        assert!(!walk.path.has_room());
        for _ in 0..3000 {
            assert_eq!(walk.step(|_, _| None), Progress::Moving);
        }
        assert!((walk.last.0 - 0.5).abs() < 1e-15 && (walk.last.1 - 0.3).abs() < 1e-15);
        assert_eq!(walk.until_rest(|_, _| None), Progress::Arrived);
        assert_eq!(walk.last, (1.0, 0.0));
        assert!(walk.largest_change < 1.0 * 1e-3); // the limit of acceleration
        assert_eq!(walk.path.halted(), None);
    }

    #[test]
    fn a_refused_way_point_changes_nothing() {
        let mut walk = Walk::new(&way_point(0.5, 0.0, 3.0));
        assert_eq!(walk.offer(way_point(f64::NAN, 0.0, 3.0)), Err(MotionFault::NonFinite));
        assert!(walk.path.has_room());
        assert_eq!(walk.until_rest(|_, _| None), Progress::Arrived);
    }

    #[test]
    fn runs_out_when_nothing_follows() {
        let mut walk = Walk::new(&way_point(0.5, 0.3, 3.0));
        assert_eq!(walk.until_rest(|_, _| None), Progress::Arrived);
        let stale = Fault::StaleSetPoint { age_ticks: 7 };
        assert_eq!(walk.path.halted(), Some(Halt::Fault(stale)));
        // 1.5 v/a = 0.45 s and sqrt(6 v/j) = 0.42 s: v T/2 further, a tick at most added.
        assert!((walk.last.0 - 0.5675).abs() < 0.3e-3 && walk.last.1 == 0.0, "{:?}", walk.last);
        assert!(walk.largest_change < 1.0 * 1e-3);
    }

    #[test]
    fn halts_on_the_path_and_resumes() {
        let mut walk = Walk::new(&way_point(0.5, 0.0, 3.0));
        for _ in 0..1500 {
            walk.step(|_, _| None);
        }
        let before = walk.last;
        walk.path.halt(Halt::Asked);
        for _ in 0..99 {
            assert_eq!(walk.step(|_, _| None), Progress::Moving);
        }
        assert_eq!(walk.step(|_, _| None), Progress::Halted);
        assert_eq!(walk.path.halted(), Some(Halt::Asked));
        assert_eq!(walk.last.1, 0.0);
        // 49.5 ticks of the path's time.
        assert!((walk.last.0 - before.0 - before.1 * 49.5e-3).abs() < 1e-4);
        walk.path.resume();
        assert_eq!(walk.until_rest(|_, _| None), Progress::Arrived);
        assert_eq!(walk.last, (0.5, 0.0));
        assert!(walk.largest_change < 4.4e-3); // 0.3125 m/s in 100 ticks, and the motion's own
    }

    #[test]
    fn never_reaches_a_fold_that_is_as_far_ahead_as_a_halt() {
        const FOLD_M: f64 = 0.3;
        const HORIZON_S: f64 = 0.1; // 100 ticks
        let fold_ahead = |x: f64, v: f64| {
            let time_s = (FOLD_M - x) / v;
            (time_s < HORIZON_S).then_some(Fault::FoldAhead { time_s })
        };
        let mut walk = Walk::new(&way_point(0.6, 0.0, 3.0));
        assert_eq!(walk.until_rest(fold_ahead), Progress::Halted);
        assert!(matches!(walk.path.halted(), Some(Halt::Fault(Fault::FoldAhead { .. }))));
        assert!(walk.last.0 < FOLD_M && walk.last.0 > 0.9 * FOLD_M && walk.last.1 == 0.0);
        assert!(walk.largest_change < 6e-3); // no jump to zero
    }

    #[test]
    fn slows_down_where_it_is_too_fast() {
        let too_fast = |_: f64, v: f64| {
            (v > 0.2).then_some(Fault::SpeedBeyondWinch { cable: 2, speed_m_s: v })
        };
        let mut walk = Walk::new(&way_point(0.5, 0.0, 3.0));
        assert_eq!(walk.until_rest(too_fast), Progress::Halted);
        assert!(walk.largest_change < 4e-3);
    }

    #[test]
    fn stands_at_once_where_there_is_no_command() {
        const WALL: Fault<f64> = Fault::TensionAbove { cable: 1, tension_n: 1.0 };
        let mut walk = Walk::new(&way_point(0.5, 0.0, 3.0));
        assert_eq!(walk.until_rest(|x, _| (x > 0.25).then_some(WALL)), Progress::Refused(WALL));
        assert!(walk.stance.position_m.x <= 0.25 && walk.stance.position_m.x > 0.249);
        // From there it goes on gently when it can.
        walk.path.resume();
        walk.last.1 = 0.0;
        walk.largest_change = 0.0;
        assert_eq!(walk.until_rest(|_, _| None), Progress::Arrived);
        assert_eq!(walk.last, (0.5, 0.0));
        assert!(walk.largest_change < 4e-3);
    }

    #[test]
    fn the_first_reason_of_a_halt_counts() {
        let mut walk = Walk::new(&way_point(0.5, 0.0, 3.0));
        for _ in 0..100 {
            walk.step(|_, _| None);
        }
        walk.path.halt(Halt::Asked);
        walk.path.halt(Halt::Fault(Fault::NonFiniteSetPoint));
        assert_eq!(walk.until_rest(|_, _| None), Progress::Halted);
        assert_eq!(walk.path.halted(), Some(Halt::Asked));
    }
}
