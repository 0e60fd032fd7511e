//! What is asked of the controller, in place of an operator and a trajectory generator: once around a
//! path, with one set-point spoilt and one emergency stop.

use cdpr_core::Real;

use crate::path::{Course, Path, TICKS_AROUND, Target};

/// At this tick a coordinate of the set-point is no number.
pub const SPOILT_AT: u32 = 3_000;

/// From this tick on the emergency stop is pressed.
pub const PRESSED_AT: u32 = 6_000;

/// At this tick it is released; the path goes on from where it was.
pub const RELEASED_AT: u32 = 6_500;

/// Ticks of the whole rehearsal: 10 s, after which the platform is back.
pub const TICKS: u32 = TICKS_AROUND + (RELEASED_AT - PRESSED_AT);

/// What the controller is given at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs<T: Real> {
    /// The emergency stop is pressed.
    pub is_stop_pressed: bool,
    /// Where the platform should be.
    pub target: Target<T>,
}

/// Gives the inputs of one tick after the other.
#[derive(Clone, Copy, Debug)]
pub struct Rehearsal<T> {
    path: Path<T>,
    tick: u32,
}

impl<T: Real> Rehearsal<T> {
    /// Before the first tick.
    #[must_use]
    pub fn new(course: Course) -> Self {
        Self { path: Path::new(course), tick: 0 }
    }

    /// The inputs of the next tick.
    pub fn inputs(&mut self) -> Inputs<T> {
        self.tick += 1;
        let is_stop_pressed = (PRESSED_AT..RELEASED_AT).contains(&self.tick);
        if !is_stop_pressed {
            self.path.advance();
        }
        let mut target = self.path.target();
        if self.tick == SPOILT_AT {
            target.position_m.x = T::constant(f64::NAN);
        }
        Inputs { is_stop_pressed, target }
    }
}
