//! The firmware's end of a serial line: one answer for each question, however often it is asked.
//!
//! | the host asks ([`frame`](crate::frame)) | the answer |
//! |---|---|
//! | `Start` | `Started` with the [`Identity`], or `Refused` with the reason; what ran before has ended |
//! | `Tick`, its sequence that of the last question and one | `Ticked` with the decision |
//! | `Tick` with the sequence of the last `Tick` | the same bytes again |
//! | `Tick` with another sequence, or before a `Start` | `Refused` |
//! | what is no frame | `Garbled`, with the sequence 0 |
//!
//! The host asks again, in the same bytes, when the answer is `Garbled`, is no frame itself, or does not come, and
//! drops answers to earlier questions. It sends nothing else before it has the answer, so that a firmware needs
//! room for one question only.

use cdpr_core::winch::Countable;
use cdpr_core::{Charted, ShapedCable};
use heapless::Vec;
use serde::Serialize;

use crate::frame::{Frame, LONGEST, Receiver};
use crate::messages::{Answer, Note, Question, Start};
use crate::{Identity, Station};

/// Bytes to be sent.
pub type Reply = Vec<u8, LONGEST>;

/// Answers questions for a station.
///
/// A period that is asked for again is the same period: its answer was lost. It gets the same bytes, and the
/// station does not move on. A period that does not follow the last is refused. What is garbled is answered as
/// such at once, so that nobody waits.
#[derive(Debug)]
pub struct Responder<'t, T: Countable, M> {
    receiver: Receiver,
    running: Option<Running<'t, T, M>>,
}

#[derive(Debug)]
struct Running<'t, T: Countable, M> {
    station: Station<'t, T, M>,
    /// The last question that was answered.
    sequence: u32,
    reply: Reply,
}

impl<'t, T, M> Responder<'t, T, M>
where
    T: Countable + core::fmt::Display + Serialize,
    M: ShapedCable<T> + Charted<T>,
{
    /// Nothing has been asked.
    #[must_use]
    pub fn new() -> Self {
        Self { receiver: Receiver::new(), running: None }
    }

    /// Takes the next byte; returns what is to be sent when it ends a question. `start` makes the station.
    pub fn receive(
        &mut self,
        byte: u8,
        start: impl FnOnce(&Start) -> Result<(Station<'t, T, M>, Identity), Note>,
    ) -> Option<Reply> {
        let Ok(question) = self.receiver.receive::<Question>(byte) else {
            return reply(0, Answer::<T>::Garbled);
        };
        let Frame { sequence, message } = question?;
        match (message, &mut self.running) {
            (Question::Start(at), running) => match start(&at) {
                Ok((station, identity)) => {
                    let reply = reply(sequence, Answer::<T>::Started(identity))?;
                    *running = Some(Running { station, sequence, reply: reply.clone() });
                    Some(reply)
                }
                Err(note) => {
                    *running = None;
                    reply(sequence, Answer::<T>::Refused(note))
                }
            },
            (Question::Tick(_), Some(running)) if running.sequence == sequence => {
                Some(running.reply.clone())
            }
            (Question::Tick(inputs), Some(running))
                if running.sequence.wrapping_add(1) == sequence =>
            {
                let decision = running.station.tick(&inputs);
                running.reply = reply(sequence, Answer::Ticked(decision))?;
                running.sequence = sequence;
                Some(running.reply.clone())
            }
            (Question::Tick(_), Some(_)) => {
                refuse::<T>(sequence, "this period does not follow the last")
            }
            (Question::Tick(_), None) => refuse::<T>(sequence, "not started"),
        }
    }
}

impl<T, M> Default for Responder<'_, T, M>
where
    T: Countable + core::fmt::Display + Serialize,
    M: ShapedCable<T> + Charted<T>,
{
    fn default() -> Self {
        Self::new()
    }
}

fn refuse<T: Serialize>(sequence: u32, why: &str) -> Option<Reply> {
    reply(sequence, Answer::<T>::Refused(Note::try_from(why).unwrap_or_default()))
}

fn reply<T: Serialize>(sequence: u32, message: Answer<T>) -> Option<Reply> {
    Frame { sequence, message }.encode().ok() // all messages fit
}
