//! The nodes of the tree of a table, in words: see [`table`](super) for the format.

use super::{COORDINATES, Gap};
use crate::Real;

/// Bits of a split that tell where its upper half is, and of a cell that tell its seed.
const SKIP: u16 = (1 << 12) - 1;
const SEED: u16 = (1 << 14) - 1;
/// From here on these bits of a split tell that one half is not covered: whether it is the lower one, and why.
const ONE_HALF: u16 = 0xff0;
const UPPER_HALF: u16 = 1 << 3;
const WHY: u16 = UPPER_HALF - 1;
/// A trim by its position only, and by its turn as well.
const TRIM: u16 = 6 << 12;
const TRIM_TURNED: u16 = 7 << 12;
/// Bits of a component of a normal.
const COMPONENT: usize = 5;
/// Kinds that are no split.
const CELL: u16 = 0b10 << 14;
const NOTHING: u16 = 0b11 << 14;

/// What a node says. Places are counted in words of the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Node {
    /// The box is halved in a coordinate.
    Split {
        /// 0 to 5.
        coordinate: usize,
        /// Place of the node of the lower half.
        lower: usize,
        /// Place of the node of the upper half, behind all of the lower one.
        upper: usize,
    },
    /// The box is halved in a coordinate, and one half is not covered.
    Half {
        /// 0 to 5.
        coordinate: usize,
        /// Whether the upper half is the other one.
        is_upper: bool,
        /// Place of its node.
        inside: usize,
        /// Why the rest is not covered: one of [`Gap::ALL`].
        gap: Gap,
    },
    /// A cell.
    Cell {
        /// Index of its seed.
        seed: usize,
    },
    /// What is beyond a plane is not covered: [`Gap::Fold`].
    Trim {
        /// The plane.
        plane: Plane,
        /// Place of the node of what is left.
        inside: usize,
    },
    /// No cell.
    Nothing(Gap),
}

/// A plane in a box whose coordinates run from 0 to 1 each. What is beyond it has `normal . t > offset/16`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plane {
    /// Its direction: components up to [`Plane::LARGEST`] in size are written.
    pub normal: [i8; COORDINATES],
    /// See above: up to [`Plane::FARTHEST`] in size is written.
    pub offset: i16,
}

impl Plane {
    /// The largest component of a normal.
    pub const LARGEST: i8 = 15;
    /// The largest offset.
    pub const FARTHEST: i16 = (1 << 11) - 1;
    /// Units of the offset in one of the normal.
    pub const PER_UNIT: f64 = 16.0;

    /// How far beyond it a place in the box is, in units of the normal; negative before it.
    #[inline]
    pub(super) fn beyond<T: Real>(self, place: &[T; COORDINATES]) -> T {
        let number = |n: i16| T::constant(f64::from(n));
        let terms = self.normal.iter().zip(place).map(|(n, t)| number(i16::from(*n)) * *t);
        let along = terms.fold(T::zero(), |sum, term| sum + term);
        along - number(self.offset) * T::constant(1.0 / Self::PER_UNIT)
    }

    /// Whether a place in the box is beyond it.
    #[inline]
    #[must_use]
    pub fn is_beyond<T: Real>(&self, place: &[T; COORDINATES]) -> bool {
        self.beyond(place) > T::zero()
    }
}

/// Three components of a normal in a word, and back.
fn packed(components: &[i8]) -> u16 {
    let bits = |n: &i8| u16::from(n.cast_unsigned()) & ((1 << COMPONENT) - 1);
    components.iter().rev().fold(0, |word, n| word << COMPONENT | bits(n))
}

#[allow(clippy::cast_possible_truncation)] // five bits
fn component(word: u16, k: usize) -> i8 {
    // To the highest bits, and back with the sign.
    let highest = 16 - COMPONENT;
    ((word << (highest - COMPONENT * (k % 3))).cast_signed() >> highest) as i8
}

impl Node {
    /// As it is written: the first so many of the words. Of a split the distance between its halves counts, not
    /// where they are. Numbers beyond [`MAX_SEEDS`](super::MAX_SEEDS) and [`MAX_WORDS`](super::MAX_WORDS) do not fit.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // see there
    pub fn encode(self) -> ([u16; 3], usize) {
        let short = |word: u16| ([word, 0, 0], 1);
        let long = |word: u16, number: usize| ([word, number as u16, (number >> 16) as u16], 3);
        match self {
            Self::Split { coordinate, lower, upper } => {
                let word = (coordinate as u16) << 12;
                let skip = upper.saturating_sub(lower).saturating_add(1);
                if skip < usize::from(ONE_HALF) {
                    short(word | skip as u16)
                } else {
                    long(word, skip.saturating_add(2))
                }
            }
            Self::Half { coordinate, is_upper, gap, .. } => {
                let half = if is_upper { UPPER_HALF } else { 0 };
                short((coordinate as u16) << 12 | ONE_HALF | half | gap.code() as u16 & WHY)
            }
            Self::Cell { seed } if seed < usize::from(SEED) => short(CELL | seed as u16),
            Self::Cell { seed } => long(CELL | SEED, seed),
            Self::Trim { plane, .. } => {
                let (position, turn) = plane.normal.split_at(3);
                let turned = turn.iter().any(|n| *n != 0);
                let kind = if turned { TRIM_TURNED } else { TRIM };
                let word = kind | plane.offset.cast_unsigned() & SKIP;
                ([word, packed(position), packed(turn)], if turned { 3 } else { 2 })
            }
            Self::Nothing(gap) => short(NOTHING | gap.code() as u16),
        }
    }

    /// The node at a place of a tree of so many words, by a word at any place of it; `None` when there is none, or it makes
    /// no sense.
    #[inline]
    pub(super) fn decode(index: usize, words: usize, word: impl Fn(usize) -> u16) -> Option<Self> {
        let word = |index: usize| (index < words).then(|| word(index));
        // The number in the two words behind this one.
        let long = || {
            let halves = (usize::from(word(index + 1)?), usize::from(word(index + 2)?));
            Some(halves.0 | halves.1 << 16)
        };
        let first = word(index)?;
        let kind = first & !SKIP;
        if kind == TRIM || kind == TRIM_TURNED {
            let position = word(index + 1)?;
            let (turn, inside) = match kind {
                TRIM => (0, index + 2),
                _ => (word(index + 2)?, index + 3),
            };
            let normal =
                core::array::from_fn(|k| component(if k < 3 { position } else { turn }, k));
            // Twelve bits, the highest of which is the sign.
            let plane = Plane { normal, offset: (first << 4).cast_signed() >> 4 };
            (inside < words).then_some(Node::Trim { plane, inside })
        } else if first & CELL == 0 {
            let coordinate = usize::from(first >> 12);
            if first & SKIP >= ONE_HALF {
                let gap = Gap::of_code(u32::from(first & WHY));
                let (is_upper, inside) = (first & UPPER_HALF != 0, index + 1);
                let half = Node::Half { coordinate, is_upper, inside, gap };
                return (inside < words).then_some(half);
            }
            let (lower, skip) = match first & SKIP {
                0 => (index + 3, long()?),
                skip => (index + 1, usize::from(skip)),
            };
            let upper = index.checked_add(skip)?;
            let is_node = coordinate < COORDINATES && upper > lower && upper < words;
            is_node.then_some(Node::Split { coordinate, lower, upper })
        } else if first & NOTHING == CELL {
            let seed = match first & SEED {
                SEED => long()?,
                seed => usize::from(seed),
            };
            Some(Node::Cell { seed })
        } else {
            Some(Node::Nothing(Gap::of_code(u32::from(first & 0xff))))
        }
    }
}
