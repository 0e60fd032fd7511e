//! A controller that runs as a firmware image in QEMU, asked over its serial line.
//!
//! Both sides wait for each other, period by period: how fast they are does not change what they decide. The
//! line may lose, garble and repeat what it likes: a question that is not answered, or is answered as garbled,
//! is asked again in the same bytes, and the firmware answers the same period with the same decision
//! ([`cdpr_link::serial`]).

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::Duration;

use cdpr_link::frame::{Frame, Garbled, Receiver};
use cdpr_link::messages::{Answer, Question};
use cdpr_link::{Decision, Identity, Inputs, Start};
use cdpr_qemu::Serving;
use serde::de::DeserializeOwned;

/// The first answer is waited for so long, each further one twice as long.
const PATIENCE: Duration = Duration::from_millis(200);

/// Times that a question is asked again.
const REPEATS: u32 = 8;

/// Why the firmware does not decide.
#[derive(Debug, thiserror::Error)]
pub enum FirmwareError {
    /// The image does not run.
    #[error(transparent)]
    Qemu(#[from] cdpr_qemu::Error),
    /// The line to it does not work.
    #[error("serial line to the firmware: {0}")]
    Line(#[from] io::Error),
    /// The image has ended, or QEMU has.
    #[error("the firmware has ended")]
    Ended,
    /// It says nothing, or nothing that arrives.
    #[error("no answer from the firmware, which was asked {} times", REPEATS + 1)]
    NoAnswer,
    /// It does not start, or has not, for the reason it tells.
    #[error("the firmware refuses: {0}")]
    Refused(String),
    /// It answers what it was not asked: a firmware of another version.
    #[error("the firmware speaks another language")]
    Unexpected,
}

/// A firmware image at the other end of a serial line.
///
/// Of a line of your own, `read` fails with [`ErrorKind::WouldBlock`] or [`ErrorKind::TimedOut`] when nothing
/// has come for as long as the first answer may take.
#[derive(Debug)]
pub struct Firmware<L = Serving> {
    line: L,
    receiver: Receiver,
    /// Of the last question.
    sequence: u32,
    /// Bits of its numbers.
    number_bits: u8,
    repeats: u64,
}

impl Firmware {
    /// Starts `image` (`in_the_loop` of `firmware-example`, or another that answers the same way) on QEMU's
    /// `machine`: `mps2-an386`, a Cortex-M4F, or `mps2-an500`, a Cortex-M7.
    ///
    /// # Errors
    /// [`FirmwareError::Qemu`]
    pub fn launch(machine: &str, image: &Path) -> Result<Self, FirmwareError> {
        Ok(Self::over(Serving::launch(machine, image, PATIENCE)?))
    }

    /// What the image has logged since this was last asked.
    pub fn log(&self) -> impl Iterator<Item = String> {
        self.line.log()
    }
}

impl<L: Read + Write> super::Controller for Firmware<L> {
    type Error = FirmwareError;

    fn tick(&mut self, inputs: &Inputs) -> Result<Decision<f64>, FirmwareError> {
        Self::tick(self, inputs)
    }
}

impl<L: Read + Write> Firmware<L> {
    /// At the other end of `line`.
    #[must_use]
    pub fn over(line: L) -> Self {
        Self { line, receiver: Receiver::new(), sequence: 0, number_bits: 32, repeats: 0 }
    }

    /// The line back.
    #[must_use]
    pub fn into_line(self) -> L {
        self.line
    }

    /// Starts the controller, anew where one runs already; returns what it is built for.
    ///
    /// # Errors
    /// [`FirmwareError`]
    pub fn start(&mut self, start: &Start) -> Result<Identity, FirmwareError> {
        match self.ask::<f32>(Question::Start(*start))? {
            Answer::Started(identity) => {
                self.number_bits = identity.number_bits;
                Ok(identity)
            }
            other => Err(not_expected(other)),
        }
    }

    /// One period: what the controller decides, its numbers as they are, whether of 32 or 64 bits.
    ///
    /// # Errors
    /// [`FirmwareError`]
    pub fn tick(&mut self, inputs: &Inputs) -> Result<Decision<f64>, FirmwareError> {
        let question = Question::Tick(inputs.clone());
        match self.number_bits {
            32 => self.ask(question).and_then(decision::<f32>),
            64 => self.ask(question).and_then(decision::<f64>),
            _ => Err(FirmwareError::Unexpected),
        }
    }

    /// Times that a question was asked again.
    #[must_use]
    pub fn repeats(&self) -> u64 {
        self.repeats
    }

    fn ask<T: DeserializeOwned>(&mut self, message: Question) -> Result<Answer<T>, FirmwareError> {
        self.sequence = self.sequence.wrapping_add(1);
        let frame = Frame { sequence: self.sequence, message };
        let question = frame.encode().map_err(io::Error::other)?;
        for repeat in 0..=REPEATS {
            self.repeats += u64::from(repeat > 0);
            self.line.write_all(&question).map_err(ended)?;
            if let Some(answer) = self.answer(1 << repeat)? {
                return Ok(answer);
            }
        }
        Err(FirmwareError::NoAnswer)
    }

    /// The answer to the last question; `None` when it is garbled, or does not come while the line is silent
    /// `patience` times.
    fn answer<T: DeserializeOwned>(
        &mut self,
        mut patience: u32,
    ) -> Result<Option<Answer<T>>, FirmwareError> {
        let mut bytes = [0; 1024];
        while patience > 0 {
            let count = match self.line.read(&mut bytes) {
                Ok(0) => return Err(FirmwareError::Ended),
                Ok(count) => count,
                Err(error) => {
                    match error.kind() {
                        ErrorKind::WouldBlock | ErrorKind::TimedOut => patience -= 1,
                        ErrorKind::Interrupted => {}
                        _ => return Err(ended(error)),
                    }
                    continue;
                }
            };
            let (mut answer, mut is_garbled) = (None, false);
            // All of them, so that the next frame is found.
            for &byte in &bytes[..count] {
                match self.receiver.receive(byte) {
                    Ok(Some(Frame { message: Answer::Garbled, .. })) | Err(Garbled) => {
                        is_garbled = true;
                    }
                    Ok(Some(frame)) if frame.sequence == self.sequence => {
                        answer = Some(frame.message);
                    }
                    // Nothing yet, or the answer to a question that was asked once too often.
                    Ok(_) => {}
                }
            }
            if answer.is_some() || is_garbled {
                return Ok(answer);
            }
        }
        Ok(None)
    }
}

fn decision<T: Into<f64>>(answer: Answer<T>) -> Result<Decision<f64>, FirmwareError> {
    match answer {
        Answer::Ticked(decision) => Ok(decision.map(T::into)),
        other => Err(not_expected(other)),
    }
}

fn not_expected<T>(answer: Answer<T>) -> FirmwareError {
    match answer {
        Answer::Refused(note) => FirmwareError::Refused(note.as_str().into()),
        _ => FirmwareError::Unexpected,
    }
}

fn ended(error: io::Error) -> FirmwareError {
    match error.kind() {
        ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => FirmwareError::Ended,
        _ => error.into(),
    }
}
