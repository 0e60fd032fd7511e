//! One tile of the region, divided into cells.
//!
//! A box of poses is tried with the seed of the larger box that it is a part of; if the proof does not hold for all of it,
//! with seeds of its own, the solution at its middle with one of the two cables eliminated that bend most over the box;
//! else it is halved, in the coordinate that moves the forces most, and each half is tried in the same way. Halves
//! that are covered from the same seed are one cell again: at every pose of the face between them the seed leads to
//! one solution, so that the solution is continuous over both.

use cdpr_core::chart::Start;
use cdpr_core::table::{COORDINATES, Gap, SEED_WORDS, decoded, encoded, shortened};
use serde::{Deserialize, Serialize};

use super::outlook::Outlook;
use super::place::{Point, PoseBox, largest};
use super::proof::{Prover, Verdict};
use super::survey::{Found, Survey};

/// Poses at which a seed is looked for where there is none at the middle.
const SEED_ATTEMPTS: usize = 12;
/// Seeds of other cells of the tile that are tried before a new one is kept.
const KNOWN_SEEDS: usize = 6;
/// Cables that are tried as the eliminated one.
const CABLES_TRIED: usize = 2;
/// Sine of the angle by which the tangents of the others may turn over a box for which a proof is tried.
const MOST_TURN: f64 = 0.5;
/// And how far the matrix may turn.
const MOST_DEFECT: f64 = 0.3;
/// A box for which none is tried gives its parts a seed to share if it turns less than this.
const DEFECT_OF_SEEDS: f64 = 0.9;
/// Where a length is beyond its limit by this factor, nothing is tried.
const FAR_BEYOND: f64 = 1.1;
/// Rounding of a pose's place in the region, in f32, as a part of its extent; and of its turn vector.
const PLACE_ROUNDING: f64 = 4.0 * f32::EPSILON as f64;
const TURN_ROUNDING: f64 = 2e-6;

/// What is made of a box of poses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Plan {
    /// Halved.
    Split {
        /// In which coordinate.
        coordinate: u8,
        /// Lower and upper half.
        halves: Box<[Plan; 2]>,
    },
    /// Covered.
    Cell(Cell),
    /// Not covered.
    Nothing(#[serde(with = "gap_code")] Gap),
}

/// A seed, as it is written.
pub(super) type Seed = [u16; SEED_WORDS];

/// A proven cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The seed, as it is written.
    pub seed: Seed,
    /// Newton steps.
    pub steps: u8,
}

/// What a seed says.
pub(super) fn started(seed: &Seed) -> Option<Start<f64>> {
    Some(decoded(*seed)?.map(f64::from))
}

/// The seed of a start.
#[allow(clippy::cast_possible_truncation)] // that is what is stored
fn written(start: &Start<f64>) -> Seed {
    encoded(&start.map(|number| shortened(number as f32)))
}

/// How cells are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Effort {
    /// Newton steps at most.
    pub steps: u8,
    /// Halvings of a tile at most.
    pub depth: u8,
}

/// A gap by its code.
mod gap_code {
    use cdpr_core::table::Gap;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref)] // serde's way to call it
    pub(super) fn serialize<S: Serializer>(gap: &Gap, to: S) -> Result<S::Ok, S::Error> {
        gap.code().serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Gap, D::Error> {
        u32::deserialize(from).map(Gap::of_code)
    }
}

impl Plan {
    /// Both halves of a box, as one where they say the same.
    ///
    /// Steps do not tell cells apart: the table has one number for all.
    pub(super) fn of(coordinate: usize, halves: [Self; 2]) -> Self {
        match &halves {
            // One reason for both: the more telling one.
            [Self::Nothing(a), Self::Nothing(b)] => Self::Nothing(*a.max(b)),
            [Self::Cell(a), Self::Cell(b)] if a.seed == b.seed => {
                Self::Cell(Cell { seed: a.seed, steps: a.steps.max(b.steps) })
            }
            _ => {
                #[allow(clippy::cast_possible_truncation)] // below six
                let coordinate = coordinate as u8;
                Self::Split { coordinate, halves: Box::new(halves) }
            }
        }
    }

    /// Whether its coordinates are those of a pose: to be asked of one that was read.
    pub(super) fn is_sound(&self) -> bool {
        match self {
            Self::Split { coordinate, halves } => {
                usize::from(*coordinate) < COORDINATES && halves.iter().all(Self::is_sound)
            }
            Self::Cell(cell) => decoded(cell.seed).is_some(),
            Self::Nothing(_) => true,
        }
    }

    /// Number of cells.
    pub(super) fn cells(&self) -> usize {
        match self {
            Self::Split { halves, .. } => halves.iter().map(Self::cells).sum(),
            Self::Cell(_) => 1,
            Self::Nothing(_) => 0,
        }
    }
}

pub(super) struct Tiler<'a> {
    pub(super) prover: &'a Prover,
    pub(super) survey: &'a Survey<'a>,
    pub(super) region: &'a PoseBox,
    pub(super) effort: Effort,
}

impl Tiler<'_> {
    /// Covers a tile as far as that goes.
    pub(super) fn cover(&self, tile: &PoseBox) -> Plan {
        self.part(tile, 0, None, &mut Vec::new())
    }

    /// Covers a box, with a seed that a larger box had, or one of those that did for others.
    fn part(&self, part: &PoseBox, depth: u8, seed: Option<Seed>, known: &mut Vec<Seed>) -> Plan {
        if !self.survey.is_near(part) {
            return Plan::Nothing(Gap::NoSolution);
        }
        let Some((at, found)) = self.found(part) else {
            return self.halved(part, depth, seed, None, Gap::NoSolution, known);
        };
        if found.length_share > FAR_BEYOND {
            return self.halved(part, depth, seed, None, Gap::BeyondLimits, known);
        }
        let Some(outlook) = Outlook::new(self.prover, part, &at, &found.charts) else {
            return self.halved(part, depth, seed, None, Gap::SingularCable, known);
        };
        // One cable may bend, and one more is a matter of patches.
        let bends = outlook.turns.iter().skip(2).any(|turn| *turn > MOST_TURN);
        if bends || outlook.defect > MOST_DEFECT {
            let own = || outlook.starts.first().map(written);
            let given = if outlook.defect < DEFECT_OF_SEEDS { own().or(seed) } else { seed };
            return self.halved(part, depth, given, Some(outlook.widest), Gap::Unproven, known);
        }
        let (mut split, mut gap) = match seed.map(|seed| self.examine(part, &seed)) {
            Some(Ok(cell)) => return Plan::Cell(cell),
            Some(Err(why)) => why,
            None => (None, Gap::TooManySteps),
        };
        let mut own = None;
        for start in outlook.starts.iter().take(CABLES_TRIED) {
            let start = written(start);
            match self.examine(part, &start) {
                // A seed that others have already makes a smaller table.
                Ok(cell) => {
                    let is_like = |seed: &&Seed| seed[0] == start[0];
                    let mut others = known.iter().rev().filter(is_like).take(KNOWN_SEEDS);
                    if let Some(cell) = others.find_map(|s| self.examine(part, s).ok()) {
                        return Plan::Cell(cell);
                    }
                    known.push(start);
                    return Plan::Cell(cell);
                }
                Err(why) => {
                    if own.is_none() {
                        (split, gap) = (why.0.or(split), why.1);
                        own = Some(start);
                    }
                }
            }
        }
        let given = seed.filter(|_| gap != Gap::TooManySteps).or(own).or(seed);
        self.halved(part, depth, given, split, gap, known)
    }

    /// What is made of the halves of a box; nothing, for the reason given, when it is not to be halved any more.
    fn halved(
        &self,
        part: &PoseBox,
        depth: u8,
        seed: Option<Seed>,
        split: Option<usize>,
        gap: Gap,
        known: &mut Vec<Seed>,
    ) -> Plan {
        if depth >= self.effort.depth {
            return Plan::Nothing(gap);
        }
        let split = split.unwrap_or_else(|| self.longest(part));
        Plan::of(split, part.halves(split).map(|half| self.part(&half, depth + 1, seed, known)))
    }

    /// The proof of a box, with all that a controller may take for a pose of it.
    fn examine(&self, part: &PoseBox, seed: &Seed) -> Result<Cell, (Option<usize>, Gap)> {
        let mut whole = *part;
        for k in 0..COORDINATES {
            let turn = if k < 3 { 0.0 } else { TURN_ROUNDING };
            let room = PLACE_ROUNDING * self.region.extent(k) + turn;
            whole.low[k] -= room;
            whole.high[k] += room;
        }
        let start = started(seed).ok_or((None, Gap::Other))?;
        match self.prover.examine(&whole, &start, self.effort.steps) {
            Verdict::Proven { steps } => Ok(Cell { seed: *seed, steps }),
            Verdict::Refuted => Err((None, Gap::TooManySteps)),
            Verdict::Open { split, gap } => Err((Some(split), gap)),
        }
    }

    fn longest(&self, part: &PoseBox) -> usize {
        largest(0..3, |k| part.extent(k) / self.region.extent(k))
    }

    /// A solution of the sheet in a box, the nearer its middle the better.
    fn found(&self, part: &PoseBox) -> Option<(Point, Found)> {
        let solution = |at: Point| Some((at, self.survey.solution(&at)?));
        if let Some(found) = solution(part.middle()) {
            return Some(found);
        }
        let mut places: Vec<Point> = (0..SEED_ATTEMPTS).map(spread).collect();
        let far = |t: &Point| t.iter().map(|t| (t - 0.5) * (t - 0.5)).sum::<f64>();
        places.sort_by(|a, b| far(a).total_cmp(&far(b)));
        places.iter().find_map(|t| solution(part.at(t)))
    }
}

/// The `n`th of points that fill the unit cube evenly: an additive recurrence by the powers of the root of
/// `x^7 = x + 1` (M. Roberts).
pub(super) fn spread(n: usize) -> Point {
    const ROOT: f64 = 1.112_775_684_278_705_5;
    std::array::from_fn(|k| {
        let mut step = 1.0;
        for _ in 0..=k {
            step /= ROOT;
        }
        let t = 0.5 + step * n as f64;
        t - t.floor()
    })
}
