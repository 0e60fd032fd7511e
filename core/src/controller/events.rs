//! What happened, for whoever looks later: the last few events.

use heapless::Deque;

use crate::Real;
use crate::controller::monitor::Warning;
use crate::controller::motion::MotionFault;
use crate::controller::path::Halt;
use crate::controller::state::State;

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum EventKind<T> {
    /// The controller is in this state now.
    Entered(State<T>),
    /// A way-point was refused; the motion under way goes on.
    Refused(MotionFault<T>),
    /// The platform was brought to rest before the end of its motion.
    Halted(Halt<T>),
    /// A [monitor](crate::controller::monitor) warned.
    Warning(Warning),
}

/// What happened, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Event<T> {
    /// The tick, counted from 1, after which it goes on from 0 at `u32::MAX`.
    pub tick: u32,
    /// What.
    pub kind: EventKind<T>,
}

/// The last `N` events that were not taken, `N` at least 1.
#[derive(Clone, Debug)]
pub struct Events<T, const N: usize> {
    ring: Deque<Event<T>, N>,
    lost: u32,
}

impl<T: Real, const N: usize> Events<T, N> {
    pub(super) fn new() -> Self {
        Self { ring: Deque::new(), lost: 0 }
    }

    /// Adds the latest; the oldest makes room.
    pub(super) fn push(&mut self, event: Event<T>) {
        if self.ring.is_full() {
            self.ring.pop_front();
            self.lost = self.lost.saturating_add(1);
        }
        let _ = self.ring.push_back(event); // there is room now
    }

    /// Oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &Event<T>> {
        self.ring.iter()
    }

    /// Takes the oldest.
    pub fn take(&mut self) -> Option<Event<T>> {
        self.ring.pop_front()
    }

    /// How many made room before they were taken; it stops at `u32::MAX`.
    pub fn lost(&self) -> u32 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(tick: u32) -> Event<f32> {
        Event { tick, kind: EventKind::Halted(Halt::Asked) }
    }

    #[test]
    fn the_oldest_makes_room_and_is_counted() {
        let mut events = Events::<f32, 3>::new();
        assert_eq!(events.take(), None);
        for tick in 1..=5 {
            events.push(event(tick));
        }
        assert!(events.iter().map(|e| e.tick).eq([3, 4, 5]));
        assert_eq!(events.lost(), 2);
        assert_eq!(events.take(), Some(event(3)));
        events.push(event(6));
        assert!(events.iter().map(|e| e.tick).eq([4, 5, 6]));
        assert_eq!(events.lost(), 2);
    }
}
