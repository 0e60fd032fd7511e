//! Messages on a serial line.
//!
//! | part | bytes | |
//! |---|---|---|
//! | sequence | 1 to 5 | number of the question, or of the one that is answered, as postcard writes an `u32` |
//! | message | | [`Question`](crate::messages::Question) or [`Answer`](crate::messages::Answer), as [postcard](https://postcard.jamesmunns.com) writes it |
//! | checksum | 4 | CRC-32/ISO-HDLC of both, little-endian |
//! | end | 1 | 0 |
//!
//! All but the end is stuffed (COBS), so that 0 stands nowhere else: whatever is lost or garbled, the next frame
//! begins after the next 0. What has a wrong checksum is dropped.

use cobs::{DecodeResult, DecoderState};
use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::CRC;

/// Longest frame, bytes: a decision with numbers of 64 bits and a full note takes 530.
pub const LONGEST: usize = 768;

/// A message and which question it belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame<M> {
    /// Counted up from question to question; an answer repeats it.
    pub sequence: u32,
    /// What is said.
    pub message: M,
}

/// A frame that is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Garbled;

impl core::fmt::Display for Garbled {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("a frame is garbled")
    }
}

impl core::error::Error for Garbled {}

impl<M: Serialize> Frame<M> {
    /// As it goes over the line, with its end.
    ///
    /// # Errors
    /// [`Garbled`] when it would be longer than [`LONGEST`], which no message of this crate is.
    pub fn encode(&self) -> Result<Vec<u8, LONGEST>, Garbled> {
        let mut plain = [0; LONGEST];
        let plain =
            postcard::to_slice_crc32(self, &mut plain, CRC.digest()).map_err(|_| Garbled)?;
        let mut stuffed = Vec::new();
        stuffed.resize_default(LONGEST).map_err(|_| Garbled)?;
        let length = cobs::try_encode(plain, &mut stuffed).map_err(|_| Garbled)?;
        stuffed.truncate(length);
        stuffed.push(0).map_err(|_| Garbled)?;
        Ok(stuffed)
    }
}

/// Puts frames together from the bytes that come.
#[derive(Debug, Default)]
pub struct Receiver {
    state: DecoderState,
    plain: Vec<u8, LONGEST>,
    is_too_long: bool,
}

impl Receiver {
    /// Nothing has come yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The next byte, and the frame that it ends.
    ///
    /// # Errors
    /// [`Garbled`]: the frame that ends here is none.
    pub fn receive<M: for<'a> Deserialize<'a>>(
        &mut self,
        byte: u8,
    ) -> Result<Option<Frame<M>>, Garbled> {
        match self.state.feed(byte) {
            Ok(DecodeResult::NoData) => Ok(None),
            Ok(DecodeResult::DataStart) => {
                self.plain.clear();
                self.is_too_long = false;
                Ok(None)
            }
            Ok(DecodeResult::DataContinue(byte)) => {
                self.is_too_long |= self.plain.push(byte).is_err();
                Ok(None)
            }
            Ok(DecodeResult::DataComplete) if !self.is_too_long => {
                match postcard::take_from_bytes_crc32(&self.plain, CRC.digest()) {
                    Ok((frame, [])) => Ok(Some(frame)),
                    // With what should be the next frame behind it, for one.
                    _ => Err(Garbled),
                }
            }
            Ok(DecodeResult::DataComplete) | Err(_) => Err(Garbled),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::{Inputs, Request};
    use proptest::prelude::*;
    use std::vec::Vec as Bytes;

    fn frame(sequence: u32) -> Frame<Inputs> {
        let message = Inputs {
            angles: [0, 1, -1, i64::MAX, i64::MIN, 0x00ff_0000_00ff],
            tensions_n: Some([0.0, -1.5, 1e9, f32::MIN_POSITIVE, 256.0, 3.0]),
            request: Some(Request::Arm),
            ..Inputs::default()
        };
        Frame { sequence, message }
    }

    fn all(bytes: &[u8]) -> Bytes<Result<Frame<Inputs>, Garbled>> {
        let mut receiver = Receiver::new();
        bytes.iter().filter_map(|&byte| receiver.receive(byte).transpose()).collect()
    }

    #[test]
    fn what_is_sent_is_received() {
        let frames = [0, 1, 127, 128, u32::MAX].map(frame);
        let bytes: Bytes<u8> = frames.iter().flat_map(|frame| frame.encode().unwrap()).collect();
        assert!(all(&bytes).into_iter().eq(frames.into_iter().map(Ok)));
    }

    #[test]
    fn an_endless_frame_is_dropped_and_the_next_received() {
        let mut bytes = std::vec![1; 10 * LONGEST];
        bytes.push(0);
        bytes.extend(frame(3).encode().unwrap());
        assert_eq!(all(&bytes), [Err(Garbled), Ok(frame(3))]);
    }

    #[test]
    fn every_flipped_bit_and_every_lost_byte_is_noticed() {
        let (good, next) = (frame(7).encode().unwrap(), frame(8).encode().unwrap());
        let check = |bytes: Bytes<u8>| {
            // The damaged frame may have taken the next with it; it never says something else.
            for received in all(&bytes).iter().flatten() {
                assert_eq!(*received, frame(8));
            }
        };
        for at in 0..good.len() {
            for bit in 0..8 {
                let mut bytes = good.to_vec();
                bytes[at] ^= 1 << bit;
                bytes.extend(&next);
                check(bytes);
            }
            let mut bytes = good.to_vec();
            bytes.remove(at);
            bytes.extend(&next);
            check(bytes);
        }
    }

    proptest! {
        #[test]
        fn noise_is_no_frame_and_does_not_stop_the_next(noise in proptest::collection::vec(any::<u8>(), 0..2000)) {
            let mut bytes = noise;
            bytes.push(0);
            bytes.extend(frame(9).encode().unwrap());
            let received = all(&bytes);
            prop_assert_eq!(received.last(), Some(&Ok(frame(9))));
            prop_assert!(received[..received.len() - 1].iter().all(Result::is_err));
        }
    }
}
