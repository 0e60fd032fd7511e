//! What is asked of the controller, in place of an operator and a trajectory generator: once around a
//! path, with one way-point spoilt and one emergency stop, after which it recovers by the warm-start table.

use cdpr_core::Real;
use cdpr_core::controller::{Pace, State, WayPoint};
use heapless::spsc::Producer;

use crate::control::Request;
use crate::path::{Course, Path, WAY_POINT_S, WAY_POINTS_AROUND};

/// The operator acts once in so many ticks.
const LOOK_TICKS: u32 = 100;

/// After so many way-points comes one of which a coordinate is no number.
const SPOILT_AFTER: u32 = 12;

/// From this tick on the emergency stop is pressed: half-way, where the platform passes nearly level
/// through what the warm-start table covers.
pub const PRESSED_AT: u32 = 4_250;

/// At this tick it is released.
pub const RELEASED_AT: u32 = 4_500;

/// Ticks of the whole rehearsal: 10 s, after which the platform is back, and stands.
pub const TICKS: u32 = 10_000;

/// The way back onto the path is gone at half of what the limits allow.
const SHARE_BACK: f64 = 0.5;

/// What the controller is given at a tick, besides way-points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// The emergency stop is pressed.
    pub is_stop_pressed: bool,
    /// What the operator wants.
    pub request: Option<Request>,
}

/// Gives the inputs of one tick after the other, and way-points.
pub struct Rehearsal<'q, T: Real> {
    path: Path<T>,
    way_points: Producer<'q, WayPoint<T>>,
    tick: u32,
    /// Way-points given.
    given: u32,
    /// Way-points of the path still to come.
    left: u32,
    place: Place,
    /// There was a fault; the operator recovers before he arms.
    must_recover: bool,
}

/// Where the last way-point given leaves the platform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// Anywhere.
    OffPath,
    /// On the path, at rest.
    AtRest,
    /// On the path, moving.
    OnTheWay,
}

impl<'q, T: Real> Rehearsal<'q, T> {
    /// Before the first tick, with the platform at the start; to send `way_points`.
    #[must_use]
    pub fn new(course: Course, way_points: Producer<'q, WayPoint<T>>) -> Self {
        let (path, left, place) = (Path::coarse(course), WAY_POINTS_AROUND, Place::AtRest);
        Self { path, way_points, tick: 0, given: 0, left, place, must_recover: false }
    }

    /// The inputs of the next tick, for a controller in this state.
    pub fn inputs(&mut self, state: &State<T>) -> Inputs {
        self.tick += 1;
        let is_stop_pressed = (PRESSED_AT..RELEASED_AT).contains(&self.tick);
        let mut request = None;
        match state {
            State::Disarmed if self.must_recover => request = Some(Request::Recover),
            State::Disarmed => request = Some(Request::Arm),
            State::Fault(_) if !is_stop_pressed => request = Some(Request::Acknowledge),
            State::Holding | State::Tracking if self.way_points.is_empty() => self.send(),
            _ => {}
        }
        if let State::Fault(_) = state {
            self.place = Place::OffPath; // what was sent is dropped
            self.must_recover = true;
        }
        let request = request.filter(|_| self.tick.is_multiple_of(LOOK_TICKS));
        self.must_recover &= request != Some(Request::Recover);
        Inputs { is_stop_pressed, request }
    }

    fn send(&mut self) {
        if let Some(way_point) = self.next_way_point() {
            let _ = self.way_points.enqueue(way_point); // there is room: the queue is empty
        }
    }

    fn next_way_point(&mut self) -> Option<WayPoint<T>> {
        self.given += 1;
        if self.given == SPOILT_AFTER {
            let mut stance = self.path.target().stance;
            stance.position_m.x = T::constant(f64::NAN);
            return Some(WayPoint::stop(stance, Pace::Duration(T::constant(WAY_POINT_S))));
        }
        if self.place == Place::OffPath {
            self.place = Place::AtRest;
            let pace = Pace::Share(T::constant(SHARE_BACK));
            return Some(WayPoint::stop(self.path.target().stance, pace));
        }
        self.left = self.left.checked_sub(1)?;
        self.path.advance();
        let target = self.path.target();
        let is_last = self.left == 0;
        // At half the speed on average, to set out and to come to rest.
        let is_slow = is_last || self.place == Place::AtRest;
        let duration_s = if is_slow { 2.0 * WAY_POINT_S } else { WAY_POINT_S };
        let pace = Pace::Duration(T::constant(duration_s));
        self.place = Place::OnTheWay;
        Some(if is_last {
            WayPoint::stop(target.stance, pace)
        } else {
            WayPoint { stance: target.stance, twist: target.twist, pace }
        })
    }
}
