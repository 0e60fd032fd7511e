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
//!   at a fold there, and the cell of the rest follows. Bits 0 to 11 are the offset of the plane in two's complement.
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

mod nearest;
mod node;
mod seed;

pub use node::{Node, Plane};
pub use seed::{decoded, encoded};

use crc::{CRC_32_ISO_HDLC, Crc};
use nalgebra::Vector3;

use crate::chart::{self, Charted, Start};
use crate::statics::Balance;
use crate::{CABLES, CableState, GeometryFault, Load, Pose, Real, Robot};

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
        let mut t = self.place(&place);
        let is_inside = t.iter().all(|t| *t >= T::zero() && *t <= T::one()); // false for NaN
        if !is_inside {
            return Err(TableFault::OutsideRegion);
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

    /// Where coordinates are, the sides of the region from 0 to 1.
    #[inline]
    fn place<T: Real>(&self, at: &[T; COORDINATES]) -> [T; COORDINATES] {
        let (low, extent) = (self.low(), self.extent());
        let number = |x: f32| T::constant(f64::from(x));
        core::array::from_fn(|k| (at[k] - number(low[k])) / number(extent[k]))
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
        let word = |index: usize| u16_at(self.bytes, offset::TREE + WORD_BYTES * index);
        Node::decode(index, self.words, word)
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

/// Position (m) and turn vector of a pose; `None` for turns of a right angle and more.
pub fn coordinates<T: Real>(pose: &Pose<T>) -> Option<[T; COORDINATES]> {
    let (c, turn) = (pose.position_m(), pose.turn_vector()?);
    Some([c.x, c.y, c.z, turn.x, turn.y, turn.z])
}

/// The pose with such [`coordinates`].
///
/// # Errors
/// [`GeometryFault::InvalidPose`] when a number is not finite or the turn a right angle or more.
pub fn pose<T: Real>(at: &[T; COORDINATES]) -> Result<Pose<T>, GeometryFault> {
    let [x, y, z, turn @ ..] = *at;
    Pose::with_turn_vector(Vector3::new(x, y, z), &turn.into())
}
