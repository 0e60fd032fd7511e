//! The seeds of a table, in bytes.

use super::SEED_BYTES;
use crate::CABLES;
use crate::chart::{self, Start};

/// Bits of the first byte of a seed, besides the eliminated cable.
const IS_POSITIVE: u8 = 1 << 3;
const FOLD_AT_SLACK_END: u8 = 1 << 4;
/// Bit of the other bytes that tells that the coordinate is negative.
const IS_NEGATIVE: u8 = 1 << 7;
/// Coordinates are written as a part of their size and this, up to [`FARTHEST`].
const NEAR: f32 = 0.25;
/// The largest size of a coordinate that is written: 15,360 less [`NEAR`].
const FARTHEST: u8 = IS_NEGATIVE - 1;
/// Bits of an `f32` that a byte leaves out, after the three upper ones of its fraction; and those of 1.
const LEFT_OUT: u32 = 20;
const ONE: u32 = 1.0_f32.to_bits();

/// A coordinate in a byte: bit 7 its sign, the others four bits of exponent and three of fraction, as an `f32` would have
/// them, of its size in quarters plus one. `rounding` is added to what is left out.
#[allow(clippy::cast_possible_truncation)] // below 128
fn byte_of(chart: f32, rounding: u32) -> u8 {
    let size = (chart.abs() / NEAR + 1.0).to_bits().saturating_sub(ONE);
    let byte = (size.saturating_add(rounding) >> LEFT_OUT).min(u32::from(FARTHEST)) as u8;
    if chart < 0.0 { byte | IS_NEGATIVE } else { byte }
}

#[inline]
fn chart_of(byte: u8) -> f32 {
    let size = f32::from_bits(ONE + (u32::from(byte & FARTHEST) << LEFT_OUT)) - 1.0;
    if byte & IS_NEGATIVE == 0 { NEAR * size } else { -NEAR * size }
}

/// A seed as it is written.
///
/// Bits 0 to 2 of the first byte are the eliminated cable (0 to 5), bit 3 is set where the determinant is positive, bit 4
/// where a fold is at the slack end (see [`Start`]). Then come the bracket of its coordinate and the coordinates of the
/// five others, in their order, a byte each: bit 7 is set for negative ones; bits 0 to 6 are exponent (four) and fraction
/// (three) of one plus four times the size, `2^exponent (1 + fraction/8)`. So coordinates, rounded to the nearest, are
/// good to one part in 16 or to 1/64, which is enough, as Newton's method starts from anywhere near; brackets are made
/// wider.
#[must_use]
#[allow(clippy::cast_possible_truncation)] // below eight
pub fn encoded(seed: &Start<f32>) -> [u8; SEED_BYTES] {
    const NEAREST: u32 = 1 << (LEFT_OUT - 1);
    const UP: u32 = (1 << LEFT_OUT) - 1;
    let bit = |is_set: bool, bit: u8| if is_set { bit } else { 0 };
    let kind = (seed.eliminated & 7) as u8
        | bit(seed.is_positive, IS_POSITIVE)
        | bit(seed.fold_at_slack_end, FOLD_AT_SLACK_END);
    let [low, high] = seed.bracket;
    let low = byte_of(low, if low < 0.0 { UP } else { 0 });
    let high = byte_of(high, if high < 0.0 { 0 } else { UP });
    let mut bytes = [kind, low, high, 0, 0, 0, 0, 0];
    let others = seed.charts.iter().enumerate().filter(|(i, _)| *i != seed.eliminated);
    for (byte, (_, chart)) in bytes.iter_mut().skip(3).zip(others) {
        *byte = byte_of(*chart, NEAREST);
    }
    bytes
}

/// The inverse of [`encoded`]; `None` when the bytes make no sense. The coordinate of the eliminated cable is between
/// those of the bracket.
#[inline]
#[must_use]
pub fn decoded([kind, low, high, others @ ..]: [u8; SEED_BYTES]) -> Option<Start<f32>> {
    let (eliminated, bracket) = (usize::from(kind & 7), [chart_of(low), chart_of(high)]);
    let is_sound = eliminated < CABLES && kind >> 5 == 0 && bracket[0] < bracket[1];
    let mut charts = [chart::between(bracket[0], bracket[1]); CABLES];
    let free = charts.iter_mut().enumerate().filter(|(i, _)| *i != eliminated);
    for ((_, chart), byte) in free.zip(others) {
        *chart = chart_of(byte);
    }
    let is_positive = kind & IS_POSITIVE != 0;
    let fold_at_slack_end = kind & FOLD_AT_SLACK_END != 0;
    is_sound.then_some(Start { charts, eliminated, bracket, fold_at_slack_end, is_positive })
}
