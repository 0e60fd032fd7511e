//! Brake and emergency stop.

use embedded_hal::digital::{Error, ErrorKind, InputPin, OutputPin, PinState};

/// A brake that is open only while it is energised, and only while somebody wants it open.
#[derive(Debug)]
pub struct Brake<P> {
    pin: P,
    released_by: PinState,
    release_ticks: u16,
    /// Whether somebody wanted it open in this tick.
    is_held: bool,
    /// Ticks until it is open.
    ticks_left: u16,
}

impl<P: OutputPin> Brake<P> {
    /// Takes the pin and engages. `released_by` is the level that energises the coil, and must not
    /// be what the pin shows without power, or while the controller starts. The armature needs
    /// `release_ticks` to move.
    ///
    /// # Errors
    /// The pin could not be written.
    pub fn new(pin: P, released_by: PinState, release_ticks: u16) -> Result<Self, ErrorKind> {
        let mut brake =
            Self { pin, released_by, release_ticks, is_held: false, ticks_left: release_ticks };
        brake.engage()?;
        Ok(brake)
    }

    /// To be called once a tick: engages, unless it was held released since the last call.
    ///
    /// # Errors
    /// The pin could not be written.
    pub fn tick(&mut self) -> Result<(), ErrorKind> {
        if self.is_held {
            self.is_held = false;
            self.ticks_left = self.ticks_left.saturating_sub(1);
            Ok(())
        } else {
            self.engage()
        }
    }

    /// Releases it until the end of the next tick.
    ///
    /// # Errors
    /// The pin could not be written.
    pub fn hold_released(&mut self) -> Result<(), ErrorKind> {
        self.pin.set_state(self.released_by).map_err(|e| e.kind())?;
        self.is_held = true;
        Ok(())
    }

    /// Whether it was held released in this tick.
    pub fn is_held(&self) -> bool {
        self.is_held
    }

    /// Whether it has been held released for long enough to be open.
    pub fn is_open(&self) -> bool {
        self.ticks_left == 0
    }

    /// Engages at once.
    ///
    /// # Errors
    /// The pin could not be written.
    pub fn engage(&mut self) -> Result<(), ErrorKind> {
        self.is_held = false;
        self.ticks_left = self.release_ticks.max(1);
        self.pin.set_state(!self.released_by).map_err(|e| e.kind())
    }
}

/// The emergency stop circuit: closed while all is well, so that a broken wire stops too.
///
/// It trips at the first reading that is not closed. It stays so until it is reset, which takes an
/// intention (ISO 13850) and a circuit that has been closed for some ticks on end.
#[derive(Debug)]
pub struct EmergencyStop<P> {
    pin: P,
    closed: PinState,
    debounce_ticks: u16,
    ticks_closed: u16,
    is_tripped: bool,
}

impl<P: InputPin> EmergencyStop<P> {
    /// Starts tripped. `closed` is the level while the circuit is closed, which must not be what
    /// the pin shows when its wire is broken.
    pub fn new(pin: P, closed: PinState, debounce_ticks: u16) -> Self {
        Self { pin, closed, debounce_ticks, ticks_closed: 0, is_tripped: true }
    }

    /// To be called once a tick: whether everything has to stop.
    ///
    /// # Errors
    /// The pin could not be read, which trips as well.
    pub fn tick(&mut self) -> Result<bool, ErrorKind> {
        let is_closed = self.pin.is_high().map(|high| PinState::from(high) == self.closed);
        if let Ok(true) = is_closed {
            self.ticks_closed = self.ticks_closed.saturating_add(1);
        } else {
            self.ticks_closed = 0;
            self.is_tripped = true;
        }
        is_closed.map_err(|e| e.kind())?;
        Ok(self.is_tripped)
    }

    /// Whether everything has to stop, as of the last tick.
    pub fn is_tripped(&self) -> bool {
        self.is_tripped
    }

    /// Lets things move again, if the circuit has been closed for long enough: returns whether.
    pub fn reset(&mut self) -> bool {
        if self.ticks_closed > 0 && self.ticks_closed >= self.debounce_ticks {
            self.is_tripped = false;
        }
        !self.is_tripped
    }
}

#[cfg(test)]
mod tests {
    extern crate alloc;
    extern crate std;
    use super::*;
    use alloc::vec::Vec;
    use embedded_hal_mock::eh1::MockError;
    use embedded_hal_mock::eh1::digital::State::{self, High, Low};
    use embedded_hal_mock::eh1::digital::{Mock, Transaction};
    use std::io;

    fn failure() -> MockError {
        MockError::Io(io::ErrorKind::NotConnected)
    }

    #[test]
    fn brake_is_open_only_while_held() {
        let set = |states: &[State]| {
            Mock::new(&states.iter().map(|&state| Transaction::set(state)).collect::<Vec<_>>())
        };
        let mut pin = set(&[Low, High, High, Low, Low, High, Low]);
        let mut brake = Brake::new(pin.clone(), PinState::High, 2).unwrap();
        for is_open in [false, true] {
            brake.hold_released().unwrap();
            assert!(!brake.is_open());
            brake.tick().unwrap(); // was held
            assert_eq!(brake.is_open(), is_open);
        }
        brake.tick().unwrap(); // was not
        assert!(!brake.is_open());
        brake.tick().unwrap();
        brake.hold_released().unwrap();
        brake.engage().unwrap();
        assert!(!brake.is_open());
        pin.done();
        // The other polarity.
        let mut pin = set(&[High, Low]);
        Brake::new(pin.clone(), PinState::Low, 0).unwrap().hold_released().unwrap();
        pin.done();
    }

    #[test]
    fn brake_that_cannot_be_written_is_not_open() {
        let mut pin = Mock::new(&[
            Transaction::set(Low),
            Transaction::set(High).with_error(failure()),
            Transaction::set(Low).with_error(failure()),
        ]);
        let mut brake = Brake::new(pin.clone(), PinState::High, 0).unwrap();
        assert_eq!(brake.hold_released(), Err(ErrorKind::Other));
        assert_eq!(brake.tick(), Err(ErrorKind::Other));
        assert!(!brake.is_open());
        pin.done();
    }

    #[test]
    fn emergency_stop_trips_at_once_and_stays() {
        let closed = Transaction::get(High);
        let open = Transaction::get(Low);
        let mut pin = Mock::new(&[
            closed.clone(),
            closed.clone(),
            closed.clone(),
            open,
            closed.clone(),
            closed.clone(),
            closed.clone(),
            closed.clone().with_error(failure()),
        ]);
        let mut stop = EmergencyStop::new(pin.clone(), PinState::High, 3);
        assert!(stop.is_tripped() && !stop.reset());
        for tick in 1..=3 {
            assert_eq!(stop.tick(), Ok(true));
            assert_eq!(stop.reset(), tick == 3);
        }
        assert_eq!(stop.tick(), Ok(true)); // open: the very first
        assert_eq!(stop.tick(), Ok(true)); // closed again, and bouncing
        assert!(!stop.reset());
        stop.tick().unwrap();
        assert_eq!(stop.tick(), Ok(true), "no reset, no motion");
        assert!(stop.reset());
        assert_eq!(stop.tick(), Err(ErrorKind::Other));
        assert!(stop.is_tripped() && !stop.reset());
        pin.done();
    }
}
