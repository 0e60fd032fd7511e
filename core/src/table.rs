//! Warm-start tables: which branch to start on, computed once on the host and kept in flash.
//!
//! After power-up, an emergency stop or a jump of the set-point the controller needs a start on the **right**
//! branch. A table divides a region of poses into cells; each cell has a seed, coordinates of force curves
//! (see [`chart`], [`Start`]), from which Newton's method with one cable eliminated is proven to reach the solution of
//! one connected sheet, within so many steps, at every pose of the cell. A cell at a fold ends at a plane before it.
//! The host's `cdpr table build` makes and proves all this; [`Table`] reads it where it lies, without a copy, at any
//! alignment.
//!
//! # Format, version 5
//!
//! Little-endian. Lengths in m, forces in N, masses in kg; `f32` is IEEE 754 single precision.
//!
//! | offset | type | what |
//! |---|---|---|
//! | 0 | 8 bytes | `CDPRSEED` |
//! | 8 | `u16` | version, 5 |
//! | 10 | `u8` | cable model: 1, the elastic catenary |
//! | 11 | `u8` | Newton steps that are certified to suffice |
//! | 12 | `u32` | bytes in all, with the checksum |
//! | 16 | `u32` | number of words of the tree, at least 1 |
//! | 20 | `u32` | number of seeds |
//! | 24 | 8 bytes | zero |
//! | 32 | 6 `f32` | region, lower ends: x, y, z of the platform origin (m), then the turn vector (see below) |
//! | 56 | 6 `f32` | its extents, positive |
//! | 80 | 6 `f32` | a pose through which the sheet goes, in the same coordinates |
//! | 104 | 6 `f32` | its rest lengths there, m |
//! | 128 | 6 x 8 `f32` | cables: anchor (m, 3), attachment (m, 3), weight per rest length (N/m), 1/EA (1/N) |
//! | 320 | 11 `f32` | load: mass (kg), centre of mass (m, 3), gravity (m/s^2), force (N, 3), moment (N m, 3) |
//! | 364 | 6 `f32` | longest rest lengths for which the sheet was wanted, m |
//! | 388 | 2 bytes a word | tree, root first |
//! | | 8 bytes a seed | see [`encoded`] |
//! | last 4 | `u32` | CRC-32 (ISO-HDLC: that of zip and Ethernet) of all bytes before |
//!
//! The turn vector is [`Pose::turn_vector`]: the axis of the platform's turn times the sine of its angle.
//!
//! A node of the tree is a `u16`, and sometimes more. Its highest bits tell its kind:
//!
//! - 0, a split: bits 12 to 14 are the coordinate (0 to 5) in which the box is halved. The node of the lower half
//!   follows; bits 0 to 11 are the number of words from this node to that of the upper half, up to 4079.
//! - The same with 4080 and more in bits 0 to 11: one half is not covered, bits 0 to 2 tell why, and the node of the other
//!   follows, which is the upper one if bit 3 is set.
//! - 0 with 6 or 7 in bits 12 to 14, a trim: what of the box is beyond a [`Plane`] is not covered, as the sheet ends
//!   at a fold there, and the node of the rest follows. Bits 0 to 11 are the offset of the plane in two's complement.
//!   In the next word are the components of its normal in the position, of five bits each in two's complement, the
//!   first in the lowest; after a 7 those in the turn vector are in the word behind it, else they are zero.
//! - 10, a cell: bits 0 to 13 are the index of its seed, which other cells may have as well.
//! - 11, nothing: bits 0 to 7 tell why ([`Gap::code`]).
//!
//! A number that does not fit into a split or a cell is in the next two words, lower half first, and its bits are zero
//! in a split and one in a cell.
//!
//! A table holds for every robot whose parameters differ from its own by no more than the part
//! [`LIKENESS`], which covers those that were rounded to `f32` on another way.

use crc::{CRC_32_ISO_HDLC, Crc};

use crate::chart::{self, Charted, Start};
use crate::statics::Balance;
use crate::{CABLES, CableState, Load, Pose, Real, Robot};

/// What a table begins with.
pub const MAGIC: [u8; 8] = *b"CDPRSEED";
/// The version of the format that is read and written.
pub const VERSION: u16 = 5;
/// Tag of the elastic catenary, the only model of this version.
pub const ELASTIC_CATENARY: u8 = 1;
/// Part by which a parameter of the robot may differ from that of the table: two roundings to `f32`.
pub const LIKENESS: f64 = 1.0 / (1 << 22) as f64;
/// A seed leads so close: no force of a cable is off by more than this part of the sum of all forces.
pub const TOLERANCE: f64 = 1.0 / (1 << 10) as f64;
/// Coordinates of a pose: position and turn vector.
pub const COORDINATES: usize = 6;
/// Splits, single halves and trims from the root to a cell at most.
pub const MAX_DEPTH: usize = 120;
/// Seeds at most.
pub const MAX_SEEDS: u32 = 1 << 27;
/// Words of the tree at most.
pub const MAX_WORDS: u32 = 1 << 27;

/// Offsets of the fields, bytes.
pub mod offset {
    /// `u16`.
    pub const VERSION: usize = 8;
    /// `u8`.
    pub const MODEL: usize = 10;
    /// `u8`.
    pub const STEPS: usize = 11;
    /// `u32`.
    pub const TOTAL: usize = 12;
    /// `u32`.
    pub const WORDS: usize = 16;
    /// `u32`.
    pub const SEEDS: usize = 20;
    /// 6 `f32`.
    pub const LOW: usize = 32;
    /// 6 `f32`.
    pub const EXTENT: usize = 56;
    /// 6 `f32`.
    pub const SHEET_POSE: usize = 80;
    /// 6 `f32`.
    pub const SHEET_LENGTHS: usize = 104;
    /// 6 x 8 `f32`.
    pub const CABLES: usize = 128;
    /// 11 `f32`.
    pub const LOAD: usize = 320;
    /// 6 `f32`.
    pub const LIMITS: usize = 364;
    /// Where the tree begins.
    pub const TREE: usize = 388;
}

/// Bytes of a word of the tree, a seed and the checksum.
pub const WORD_BYTES: usize = 2;
/// See [`WORD_BYTES`].
pub const SEED_BYTES: usize = 8;
/// See [`WORD_BYTES`].
pub const CRC_BYTES: usize = 4;

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

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// The checksum of a table without its last four bytes.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Why there is no seed for a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Gap {
    /// No solution of the sheet was found there.
    NoSolution,
    /// A rest length or a tension is beyond its limit there.
    BeyondLimits,
    /// A cable is too close to vertical, or to losing its tension.
    SingularCable,
    /// Newton's method takes too many steps.
    TooManySteps,
    /// No proof with cells of the smallest size: a cable is between taut and slack there, where its force curve bends,
    /// or a fold or another singularity is near.
    Unproven,
    /// Proven, but not connected to the sheet within the region.
    NotConnected,
    /// The sheet ends at a fold there, or is about to.
    Fold,
    /// Left out, so that the table is small enough.
    LeftOut,
    /// A reason that this version does not know.
    Other,
}

impl Gap {
    /// All that are written, in the order of their codes.
    pub const ALL: [Self; 8] = [
        Self::NoSolution,
        Self::BeyondLimits,
        Self::SingularCable,
        Self::TooManySteps,
        Self::Unproven,
        Self::NotConnected,
        Self::Fold,
        Self::LeftOut,
    ];

    /// The reason with this code.
    #[must_use]
    pub fn of_code(code: u32) -> Self {
        let known = Self::ALL.iter().zip(0..).find(|(_, number)| *number == code);
        known.map_or(Self::Other, |(gap, _)| *gap)
    }

    /// Its code in a node.
    #[must_use]
    pub fn code(self) -> u32 {
        let known = Self::ALL.iter().zip(0..).find(|(gap, _)| **gap == self);
        known.map_or(255, |(_, number)| number)
    }
}

impl core::fmt::Display for Gap {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::NoSolution => "the sheet has no solution there",
            Self::BeyondLimits => "a rest length or tension is beyond its limit there",
            Self::SingularCable => "a cable is too close to vertical or to losing its tension",
            Self::Unproven => "not proven: a cable between taut and slack, or a fold, is near",
            Self::TooManySteps => "Newton's method takes too many steps",
            Self::NotConnected => "not connected to the sheet within the region",
            Self::Fold => "the sheet ends at a fold there, or is about to",
            Self::LeftOut => "left out, so that the table is small enough",
            Self::Other => "unknown reason",
        })
    }
}

/// Why a table is not used, or has no seed. Cables are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TableFault {
    /// Fewer bytes than the shortest table: torn off, or nothing was written.
    TooShort,
    /// The bytes are no table.
    NotATable,
    /// Of an older version than this one reads.
    OlderVersion(u16),
    /// Of a newer version than this one reads.
    NewerVersion(u16),
    /// Torn off, or followed by something else.
    WrongLength {
        /// Bytes that the table says it has.
        said: u32,
        /// Bytes there are.
        found: u32,
    },
    /// The checksum is not that of the bytes.
    Corrupt,
    /// The checksum is right, but what it protects makes no sense.
    Malformed,
    /// Of another cable model.
    OtherModel(u8),
    /// Made for a robot with another cable here: geometry, weight or stiffness.
    OtherCable(usize),
    /// Made for another load.
    OtherLoad,
    /// The pose is outside the region.
    OutsideRegion,
    /// No cell covers the pose.
    Uncovered(Gap),
}

impl core::fmt::Display for TableFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooShort => f.write_str("too short for a table"),
            Self::NotATable => f.write_str("not a warm-start table"),
            Self::OlderVersion(version) => {
                write!(f, "of version {version}, older than {VERSION}: build it again")
            }
            Self::NewerVersion(version) => write!(f, "of version {version}, newer than {VERSION}"),
            Self::WrongLength { said, found } => {
                write!(f, "{found} bytes long instead of {said}")
            }
            Self::Corrupt => f.write_str("corrupt: its checksum is wrong"),
            Self::Malformed => f.write_str("malformed"),
            Self::OtherModel(tag) => write!(f, "made for another cable model (number {tag})"),
            Self::OtherCable(cable) => {
                write!(f, "made for a robot with another cable {}", cable + 1)
            }
            Self::OtherLoad => f.write_str("made for another load"),
            Self::OutsideRegion => f.write_str("the pose is outside the region of the table"),
            Self::Uncovered(gap) => write!(f, "the pose is in no cell of the table: {gap}"),
        }
    }
}

impl core::error::Error for TableFault {}

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

    /// Whether a place in the box is beyond it.
    #[inline]
    #[must_use]
    pub fn is_beyond<T: Real>(&self, place: &[T; COORDINATES]) -> bool {
        let number = |n: i16| T::constant(f64::from(n));
        let terms = self.normal.iter().zip(place).map(|(n, t)| number(i16::from(*n)) * *t);
        let along = terms.fold(T::zero(), |sum, term| sum + term);
        along > number(self.offset) * T::constant(1.0 / Self::PER_UNIT)
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
    /// where they are. Numbers beyond [`MAX_SEEDS`] and [`MAX_WORDS`] do not fit.
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
}

/// A table in flash: borrowed bytes that have been checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Table<'a> {
    bytes: &'a [u8],
    words: usize,
    seeds: usize,
}

/// `N` bytes from `at` on, zeros beyond the end (which a checked table does not ask for).
#[inline]
fn bytes_at<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let mut found = [0; N];
    if let Some(end) = at.checked_add(N)
        && let Some(part) = bytes.get(at..end)
    {
        for (to, from) in found.iter_mut().zip(part) {
            *to = *from;
        }
    }
    found
}

#[inline]
fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes_at(bytes, at))
}

#[inline]
fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes_at(bytes, at))
}

#[inline]
fn floats_at<const N: usize>(bytes: &[u8], at: usize) -> [f32; N] {
    core::array::from_fn(|k| f32::from_le_bytes(bytes_at(bytes, at + 4 * k)))
}

impl<'a> Table<'a> {
    /// Checks the bytes of a table: once, as it reads all of them (about ten instructions each).
    ///
    /// # Errors
    /// [`TableFault`]: the first that applies of not a table, version, length, checksum, contents.
    pub fn open(bytes: &'a [u8]) -> Result<Self, TableFault> {
        if bytes.len() < offset::TREE + WORD_BYTES + CRC_BYTES {
            return Err(TableFault::TooShort);
        }
        if bytes_at(bytes, 0) != MAGIC {
            return Err(TableFault::NotATable);
        }
        let version = u16_at(bytes, offset::VERSION);
        if version < VERSION {
            return Err(TableFault::OlderVersion(version));
        }
        if version > VERSION {
            return Err(TableFault::NewerVersion(version));
        }
        let said = u32_at(bytes, offset::TOTAL);
        let found = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        if said != found {
            return Err(TableFault::WrongLength { said, found });
        }
        let protected = bytes.len() - CRC_BYTES;
        if checksum(bytes.get(..protected).unwrap_or_default()) != u32_at(bytes, protected) {
            return Err(TableFault::Corrupt);
        }
        let model = bytes_at::<1>(bytes, offset::MODEL)[0];
        if model != ELASTIC_CATENARY {
            return Err(TableFault::OtherModel(model));
        }
        let count = |at| u32_at(bytes, at);
        let (words, seeds) = (count(offset::WORDS), count(offset::SEEDS));
        let fits = (1..MAX_WORDS).contains(&words) && seeds <= MAX_SEEDS;
        if !fits {
            return Err(TableFault::Malformed);
        }
        let table = Self { bytes, words: words as usize, seeds: seeds as usize };
        let extents = table.extent();
        let is_region = table.low().iter().all(|l| l.is_finite())
            && extents.iter().all(|e| *e > 0.0 && e.is_finite());
        // In 64 bits, where no count overflows.
        let tree = offset::TREE as u64
            + WORD_BYTES as u64 * u64::from(words)
            + SEED_BYTES as u64 * u64::from(seeds);
        if tree != protected as u64 || !is_region {
            return Err(TableFault::Malformed);
        }
        Ok(table)
    }

    /// Whether this is a table for `robot` with `load`.
    ///
    /// # Errors
    /// [`TableFault::OtherCable`], [`TableFault::OtherLoad`].
    pub fn check<T: Real, M: Charted<T>>(
        &self,
        robot: &Robot<T, M>,
        load: &Load<T>,
    ) -> Result<(), TableFault> {
        let alike = |known: &[f32], asked: &[T]| {
            known.iter().zip(asked).all(|(known, asked)| {
                let known = T::constant(f64::from(*known));
                // False for NaN.
                (*asked - known).abs() <= T::constant(LIKENESS) * known.abs()
            })
        };
        for (i, cable) in robot.cables().iter().enumerate() {
            let (a, b, model) = (&cable.anchor_m, &cable.attachment_m, &cable.model);
            let asked =
                [a.x, a.y, a.z, b.x, b.y, b.z, model.weight_n_m(), model.compliance_per_n()];
            if !alike(&self.cable(i), &asked) {
                return Err(TableFault::OtherCable(i));
            }
        }
        let (c, f, m) = (&load.center_of_mass_m, &load.force_n, &load.moment_nm);
        let asked = [load.mass_kg, c.x, c.y, c.z, load.gravity_m_s2, f.x, f.y, f.z, m.x, m.y, m.z];
        if alike(&self.load(), &asked) { Ok(()) } else { Err(TableFault::OtherLoad) }
    }

    /// How the cables hang at `pose`, on the sheet of the table: within [`TOLERANCE`] by proof, and usually
    /// to rounding.
    ///
    /// That it is a table for `robot` and `load` is for [`Table::check`].
    ///
    /// Cost: at most [`MAX_DEPTH`] nodes, and the certified steps of [`chart::converge`].
    ///
    /// # Errors
    /// [`TableFault`]: outside the region, uncovered, malformed.
    pub fn states<T: Real, M: Charted<T>>(
        &self,
        robot: &Robot<T, M>,
        load: &Load<T>,
        pose: &Pose<T>,
    ) -> Result<[CableState<T>; CABLES], TableFault> {
        let start = self.start_at(pose)?;
        // From a cell there is a way, by proof.
        let balance = Balance::at(robot, load, pose).map_err(|_| TableFault::Malformed)?;
        chart::converge(robot, &balance, &start, self.steps()).map_err(|_| TableFault::Malformed)
    }

    /// The seed for `pose`.
    ///
    /// # Errors
    /// [`TableFault`]: outside the region, uncovered, malformed.
    pub fn start_at<T: Real>(&self, pose: &Pose<T>) -> Result<Start<T>, TableFault> {
        let place = coordinates(pose).ok_or(TableFault::OutsideRegion)?;
        let (low, extent) = (self.low(), self.extent());
        let mut t = [T::zero(); COORDINATES];
        for k in 0..COORDINATES {
            let number = |x: f32| T::constant(f64::from(x));
            t[k] = (place[k] - number(low[k])) / number(extent[k]);
            let is_inside = t[k] >= T::zero() && t[k] <= T::one(); // false for NaN
            if !is_inside {
                return Err(TableFault::OutsideRegion);
            }
        }
        let mut index = 0;
        for _ in 0..=MAX_DEPTH {
            match self.node(index).ok_or(TableFault::Malformed)? {
                Node::Split { coordinate, lower, upper } => {
                    let along = t.get_mut(coordinate).ok_or(TableFault::Malformed)?;
                    index = if in_upper_half(along) { upper } else { lower };
                }
                Node::Half { coordinate, is_upper, inside, gap } => {
                    let along = t.get_mut(coordinate).ok_or(TableFault::Malformed)?;
                    if in_upper_half(along) != is_upper {
                        return Err(TableFault::Uncovered(gap));
                    }
                    index = inside;
                }
                Node::Cell { seed } => {
                    let start = self.seed(seed).ok_or(TableFault::Malformed)?;
                    return Ok(start.map(|number| T::constant(f64::from(number))));
                }
                Node::Trim { plane, .. } if plane.is_beyond(&t) => {
                    return Err(TableFault::Uncovered(Gap::Fold));
                }
                Node::Trim { inside, .. } => index = inside,
                Node::Nothing(gap) => return Err(TableFault::Uncovered(gap)),
            }
        }
        Err(TableFault::Malformed)
    }

    /// Newton steps that suffice, by proof.
    #[must_use]
    pub fn steps(&self) -> u8 {
        bytes_at::<1>(self.bytes, offset::STEPS)[0]
    }

    /// Lower ends of the region: position (m), turn vector.
    #[must_use]
    pub fn low(&self) -> [f32; COORDINATES] {
        floats_at(self.bytes, offset::LOW)
    }

    /// Extents of the region: position (m), turn vector.
    #[must_use]
    pub fn extent(&self) -> [f32; COORDINATES] {
        floats_at(self.bytes, offset::EXTENT)
    }

    /// A pose through which the sheet goes, and its rest lengths there, m.
    #[must_use]
    pub fn sheet(&self) -> ([f32; COORDINATES], [f32; CABLES]) {
        let pose = floats_at(self.bytes, offset::SHEET_POSE);
        (pose, floats_at(self.bytes, offset::SHEET_LENGTHS))
    }

    /// Anchor, attachment (m), weight per rest length (N/m) and 1/EA (1/N) of a cable; zeros when there is no
    /// such cable.
    #[must_use]
    pub fn cable(&self, cable: usize) -> [f32; 8] {
        if cable < CABLES { floats_at(self.bytes, offset::CABLES + 32 * cable) } else { [0.0; 8] }
    }

    /// Mass (kg), centre of mass (m), gravity (m/s^2), force (N) and moment (N m).
    #[must_use]
    pub fn load(&self) -> [f32; 11] {
        floats_at(self.bytes, offset::LOAD)
    }

    /// Longest rest lengths for which the sheet was wanted, m.
    #[must_use]
    pub fn limits_m(&self) -> [f32; CABLES] {
        floats_at(self.bytes, offset::LIMITS)
    }

    /// Number of words of the tree.
    #[must_use]
    pub fn words(&self) -> usize {
        self.words
    }

    /// Number of seeds.
    #[must_use]
    pub fn seeds(&self) -> usize {
        self.seeds
    }

    /// The node at a place of the tree; the root is at 0. `None` when there is none, or it makes no sense.
    #[inline]
    #[must_use]
    pub fn node(&self, index: usize) -> Option<Node> {
        let word = |index: usize| {
            (index < self.words).then(|| u16_at(self.bytes, offset::TREE + WORD_BYTES * index))
        };
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
            (inside < self.words).then_some(Node::Trim { plane, inside })
        } else if first & CELL == 0 {
            let coordinate = usize::from(first >> 12);
            if first & SKIP >= ONE_HALF {
                let gap = Gap::of_code(u32::from(first & WHY));
                let (is_upper, inside) = (first & UPPER_HALF != 0, index + 1);
                let half = Node::Half { coordinate, is_upper, inside, gap };
                return (inside < self.words).then_some(half);
            }
            let (lower, skip) = match first & SKIP {
                0 => (index + 3, long()?),
                skip => (index + 1, usize::from(skip)),
            };
            let upper = index.checked_add(skip)?;
            let is_node = coordinate < COORDINATES && upper > lower && upper < self.words;
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

    /// A seed. `None` when there is none, or it makes no sense.
    #[inline]
    #[must_use]
    pub fn seed(&self, index: usize) -> Option<Start<f32>> {
        if index >= self.seeds {
            return None;
        }
        decoded(bytes_at(self.bytes, offset::TREE + WORD_BYTES * self.words + SEED_BYTES * index))
    }
}

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

/// Whether a place in a box, from 0 to 1, is in its upper half; the place in that half then.
#[inline]
fn in_upper_half<T: Real>(along: &mut T) -> bool {
    // Exact: doubling is, and so is taking one from a number between one and two.
    *along += *along;
    let is_upper = *along >= T::one();
    if is_upper {
        *along -= T::one();
    }
    is_upper
}

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

/// Position (m) and turn vector of a pose; `None` for turns of a right angle and more.
pub fn coordinates<T: Real>(pose: &Pose<T>) -> Option<[T; COORDINATES]> {
    let (c, turn) = (pose.position_m(), pose.turn_vector()?);
    Some([c.x, c.y, c.z, turn.x, turn.y, turn.z])
}
