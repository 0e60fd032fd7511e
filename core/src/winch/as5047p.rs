//! The magnetic absolute encoder AS5047P (ams OSRAM), read over SPI.
//!
//! Register names and bits are those of its data sheet. A frame has 16 bits, most significant
//! first, in SPI mode 1 (CPOL = 0, CPHA = 1) at up to 10 MHz, and needs its own `CSn` pulse: the
//! answer to a command comes in the next frame. The data sheet wants `CSn` high for 350 ns between
//! two frames and low for 350 ns before the first clock; the `SpiDevice` has to see to it.
//!
//! | frame | bit 15 | bit 14 | bits 13:0 |
//! |---|---|---|---|
//! | command | PARC, makes the number of ones even | R/W, 1 to read | ADDR |
//! | answer | PARD, makes the number of ones even | EF, 1 after an error | DATA |

use embedded_hal::spi::{Error, SpiDevice};

use super::angle::{MotorAngle, Sense};
use super::encoder::{CommandErrors, Encoder, EncoderFault, MultiTurn};

/// A register that can be read.
#[derive(Clone, Copy)]
enum Register {
    /// No operation: to get at the last answer.
    Nop = 0x0000,
    /// Errors of the commands; reading it clears it.
    Errfl = 0x0001,
    /// Diagnostics, and the automatic gain control.
    Diaagc = 0x3FFC,
    /// The angle, with dynamic angle error compensation.
    Anglecom = 0x3FFF,
}

const READ: u16 = 1 << 14;
const EF: u16 = 1 << 14;
const DATA: u16 = (1 << 14) - 1;

/// In ERRFL.
const PARERR: u16 = 1 << 2;
const INVCOMM: u16 = 1 << 1;
const FRERR: u16 = 1 << 0;

/// In DIAAGC: field too low, too high, overflow of the CORDIC, offset loops settled, gain.
const MAGL: u16 = 1 << 11;
const MAGH: u16 = 1 << 10;
const COF: u16 = 1 << 9;
const LF: u16 = 1 << 8;
const AGC: u16 = 0xFF;

/// Resolution of the angle: 2^14 counts in a turn.
const BITS: u32 = 14;

/// The sensor by itself.
#[derive(Debug)]
pub struct As5047p<S> {
    spi: S,
}

/// One reading of a sensor with whose magnet all is well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading {
    /// Angle within the turn, 0 to 16383.
    pub counts: u16,
    /// Gain: 0 for the strongest magnet that can be read, 255 for the weakest.
    pub gain: u8,
}

impl<S: SpiDevice> As5047p<S> {
    /// Takes the bus, with its chip select.
    pub fn new(spi: S) -> Self {
        Self { spi }
    }

    /// Reads the angle and whether it can be trusted. Cost: three frames, and two more after an
    /// error of a command.
    ///
    /// # Errors
    /// [`EncoderFault`]. Errors that the sensor keeps are cleared: the next reading is a new one.
    pub fn read(&mut self) -> Result<Reading, EncoderFault> {
        // What the first frame answers is the command of long ago.
        self.frame(Register::Anglecom)?;
        let angle = self.frame(Register::Diaagc)?;
        let counts = self.data(angle)?;
        let diagnostics = self.frame(Register::Nop)?;
        let diagnostics = self.data(diagnostics)?;
        if diagnostics & MAGL != 0 {
            return Err(EncoderFault::MagnetTooWeak);
        }
        if diagnostics & MAGH != 0 {
            return Err(EncoderFault::MagnetTooStrong);
        }
        if diagnostics & COF != 0 {
            return Err(EncoderFault::FieldOverflow);
        }
        // Also what tells a line that is stuck low from a sensor at angle 0.
        if diagnostics & LF == 0 {
            return Err(EncoderFault::NotReady);
        }
        let gain = u8::try_from(diagnostics & AGC).unwrap_or_default(); // 8 bits fit
        Ok(Reading { counts, gain })
    }

    /// Reads and clears the errors of the commands; to be called once after power-up, when the
    /// lines may have moved before there was an SPI. Cost: two frames.
    ///
    /// # Errors
    /// [`EncoderFault::Spi`] or [`EncoderFault::AnswerParity`].
    pub fn clear_errors(&mut self) -> Result<CommandErrors, EncoderFault> {
        self.frame(Register::Errfl)?;
        let errors = self.frame(Register::Nop)?;
        check_parity(errors)?;
        Ok(CommandErrors {
            framing: errors & FRERR != 0,
            invalid_command: errors & INVCOMM != 0,
            parity: errors & PARERR != 0,
        })
    }

    /// The data of an answer, once it is sound.
    fn data(&mut self, answer: u16) -> Result<u16, EncoderFault> {
        check_parity(answer)?;
        if answer & EF != 0 {
            return Err(EncoderFault::Command(self.clear_errors()?));
        }
        Ok(answer & DATA)
    }

    /// Sends a command; the answer to the last one.
    fn frame(&mut self, register: Register) -> Result<u16, EncoderFault> {
        let mut answer = [0; 2];
        let command = command(register).to_be_bytes();
        self.spi.transfer(&mut answer, &command).map_err(|e| EncoderFault::Spi(e.kind()))?;
        Ok(u16::from_be_bytes(answer))
    }
}

/// The frame that reads a register.
fn command(register: Register) -> u16 {
    let frame = READ | register as u16;
    if is_even(frame) { frame } else { frame | 1 << 15 }
}

fn is_even(frame: u16) -> bool {
    frame.count_ones() & 1 == 0
}

fn check_parity(answer: u16) -> Result<(), EncoderFault> {
    if is_even(answer) { Ok(()) } else { Err(EncoderFault::AnswerParity) }
}

/// An [`As5047p`] on a motor shaft, with its turns counted.
#[derive(Debug)]
pub struct MotorEncoder<S> {
    sensor: As5047p<S>,
    turns: MultiTurn<BITS>,
    sense: Sense,
}

impl<S: SpiDevice> MotorEncoder<S> {
    /// Clears old errors and takes the first reading, which is in turn 0. `sense` is forward when
    /// the counts grow with the motor angle. For `furthest_counts` see [`MultiTurn::new`]; a turn
    /// has 16384 counts.
    ///
    /// # Errors
    /// [`EncoderFault`].
    pub fn start(
        mut sensor: As5047p<S>,
        furthest_counts: u16,
        sense: Sense,
    ) -> Result<Self, EncoderFault> {
        sensor.clear_errors()?;
        let turns = MultiTurn::new(sensor.read()?.counts, furthest_counts);
        Ok(Self { sensor, turns, sense })
    }

    /// Counts anew after a jump, with this reading in turn 0: the winch must then be homed.
    ///
    /// # Errors
    /// [`EncoderFault`].
    pub fn restart(&mut self) -> Result<(), EncoderFault> {
        self.turns.restart(self.sensor.read()?.counts);
        Ok(())
    }
}

impl<S: SpiDevice> Encoder for MotorEncoder<S> {
    fn angle(&mut self) -> Result<MotorAngle, EncoderFault> {
        let counts = self.turns.update(self.sensor.read()?.counts)?;
        let units = i64::from(counts) << (32 - BITS);
        Ok(MotorAngle::from_units(match self.sense {
            Sense::Forward => units,
            Sense::Reverse => -units, // 46 bits: it has a negative
        }))
    }
}

#[cfg(test)]
mod tests {
    extern crate alloc;
    use super::*;
    use alloc::vec;
    use alloc::vec::Vec;
    use embedded_hal_mock::eh1::spi::{Mock, Transaction};

    // Worked out by hand: 0x4000 | address has 15, 2, 13 and 1 ones.
    const READ_ANGLECOM: u16 = 0xFFFF;
    const READ_ERRFL: u16 = 0x4001;
    const READ_DIAAGC: u16 = 0xFFFC;
    const READ_NOP: u16 = 0xC000;

    /// Settled, gain 0x80: two ones.
    const WELL: u16 = 0x0180;

    fn frames(exchange: &[(u16, u16)]) -> Mock<u8> {
        let expectations: Vec<_> = exchange
            .iter()
            .flat_map(|(command, answer)| {
                [
                    Transaction::transaction_start(),
                    Transaction::transfer(
                        vec![(command >> 8) as u8, (command & 0xFF) as u8],
                        vec![(answer >> 8) as u8, (answer & 0xFF) as u8],
                    ),
                    Transaction::transaction_end(),
                ]
            })
            .collect();
        Mock::new(&expectations)
    }

    fn read(exchange: &[(u16, u16)]) -> Result<Reading, EncoderFault> {
        let mut spi = frames(exchange);
        let reading = As5047p::new(spi.clone()).read();
        spi.done();
        reading
    }

    #[test]
    fn commands_have_even_parity() {
        assert_eq!(command(Register::Anglecom), READ_ANGLECOM);
        assert_eq!(command(Register::Errfl), READ_ERRFL);
        assert_eq!(command(Register::Diaagc), READ_DIAAGC);
        assert_eq!(command(Register::Nop), READ_NOP);
    }

    #[test]
    fn answers_come_a_frame_later() {
        // The first answer is garbage of wrong parity with an old error, and is not looked at.
        let exchange = [(READ_ANGLECOM, 0x7FFF), (READ_DIAAGC, 0x8000 | 0x2AAA), (READ_NOP, WELL)];
        assert_eq!(read(&exchange), Ok(Reading { counts: 0x2AAA, gain: 0x80 }));
    }

    #[test]
    fn a_magnet_that_is_not_well_is_told() {
        let fault = |diagnostics| {
            read(&[(READ_ANGLECOM, 0), (READ_DIAAGC, 0), (READ_NOP, diagnostics)]).unwrap_err()
        };
        assert_eq!(fault(0x09FF), EncoderFault::MagnetTooWeak); // MAGL, LF, gain 255
        assert_eq!(fault(0x0500), EncoderFault::MagnetTooStrong); // MAGH, LF, gain 0
        assert_eq!(fault(0x8380), EncoderFault::FieldOverflow); // COF, LF
        assert_eq!(fault(0x8080), EncoderFault::NotReady);
        assert_eq!(fault(0x0000), EncoderFault::NotReady); // the line is stuck
    }

    #[test]
    fn wrong_parity_of_an_answer_is_told() {
        let exchange = [(READ_ANGLECOM, 0), (READ_DIAAGC, 0x0001)];
        assert_eq!(read(&exchange), Err(EncoderFault::AnswerParity));
        let exchange = [(READ_ANGLECOM, 0), (READ_DIAAGC, 0), (READ_NOP, WELL | 0x8000)];
        assert_eq!(read(&exchange), Err(EncoderFault::AnswerParity));
    }

    #[test]
    fn errors_of_commands_are_read_and_cleared() {
        let errors = |answer| {
            read(&[
                (READ_ANGLECOM, 0),
                (READ_DIAAGC, 0x4000 | 0x8000), // EF
                (READ_ERRFL, 0),
                (READ_NOP, answer),
            ])
        };
        let command = |framing, invalid_command, parity| {
            Err(EncoderFault::Command(CommandErrors { framing, invalid_command, parity }))
        };
        assert_eq!(errors(0x8001), command(true, false, false));
        assert_eq!(errors(0x8002), command(false, true, false));
        assert_eq!(errors(0x8004), command(false, false, true));
        assert_eq!(errors(0xFFFF), command(true, true, true)); // the line is stuck high
        assert_eq!(errors(0x0001), Err(EncoderFault::AnswerParity));
    }

    #[test]
    fn turns_are_counted_with_their_sense() {
        let reading = |counts: u16| {
            let answer = if is_even(counts) { counts } else { counts | 0x8000 };
            [(READ_ANGLECOM, 0), (READ_DIAAGC, answer), (READ_NOP, WELL)]
        };
        let exchange = [
            &[(READ_ERRFL, 0), (READ_NOP, 0x8001)][..],
            &reading(16000),
            &reading(100),
            &reading(700),
            &reading(700),
            &reading(701),
        ]
        .concat();
        let mut spi = frames(&exchange);
        let sensor = As5047p::new(spi.clone());
        let mut encoder = MotorEncoder::start(sensor, 500, Sense::Reverse).unwrap();
        let angle = encoder.angle().unwrap();
        assert_eq!(angle, MotorAngle::from_units(-((16384 + 100) << 18)));
        assert_eq!(encoder.angle(), Err(EncoderFault::Jump { counts: 600 }));
        encoder.restart().unwrap();
        assert_eq!(encoder.angle(), Ok(MotorAngle::from_units(-(701 << 18))));
        spi.done();
    }
}
