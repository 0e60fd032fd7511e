//! One tile of the region, divided into cells.
//!
//! A box of poses is tried with the seeds of the larger boxes that it is a part of; if the proof does not hold for all
//! of it, with seeds of its own, the solution at its middle with one of the two cables eliminated that bend most over
//! the box. Boxes of some sizes are then proven part by part, with one seed for all parts, which makes fewer cells; and
//! if there is a fold in one, so with what is before a plane close to that. What is left is halved, in the coordinate
//! that moves the forces most, and each half is tried in the same way. Halves that are covered from the same seed are one
//! cell again: at every pose of the face between them the seed leads to one solution, so that the solution is continuous
//! over both. So it is, too, over the parts of a cell. At last cells whose seed no other has, or one other, are
//! [proven](super::sharing) with that of another.

use cdpr_core::CABLES;
use cdpr_core::chart::Start;
use cdpr_core::table::{COORDINATES, Gap, Plane, SEED_BYTES, decoded, encoded};
use serde::{Deserialize, Serialize};

use super::border::Edge;
use super::file;
use super::outlook::Outlook;
use super::patch::{HalfSpace, Patch};
use super::place::{Point, PoseBox, largest, spread};
use super::proof::{Prover, Verdict, is_same};
use super::survey::{Found, Survey};

/// Poses at which a seed is looked for where there is none at the middle.
const SEED_ATTEMPTS: usize = 12;
/// Seeds of larger boxes that are tried.
const SEEDS_GIVEN: usize = 6;
/// A proof is tried for a box over which the tangents of no more cables than this turn by an angle with this sine: the
/// eliminated one, and one for whose bend the box may still be small enough.
const BENDING: usize = 2;
const MOST_TURN: f64 = 0.5;
/// And the matrix by no more than this.
const MOST_DEFECT: f64 = 0.3;
/// A box for which none is tried gives its parts a seed to share if it turns less than this.
const DEFECT_OF_SEEDS: f64 = 0.9;
/// Where so many halvings are left a box is proven part by part.
const PIECED: [u8; 8] = [12, 10, 8, 6, 4, 3, 2, 0];
/// Where so many are left it is trimmed, so far before the fold, in sides of the box.
const ROOMS: [(u8, &[f64]); 4] = [(9, &[0.01]), (6, &[0.01]), (3, &[0.02, 0.08, 0.2]), (0, &[0.1])];
/// Halvings of parts beyond those of the smallest cells.
const PIECE_HALVINGS: u8 = 7;
/// Poses of a box that are looked at before it is said that a seed leads to solutions all over it, besides its corners, or
/// that it is beyond the limits.
const POSES_LED: usize = 64;
/// Poses at which it is looked how hard the proof is, besides the corners.
const POSES_PROBED: usize = 24;
/// Where so few halvings are left a box is not halved for what of it may be within the limits.
const LAST_BEYOND: u8 = 9;
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
    /// Covered up to a plane.
    Trim {
        /// The plane.
        #[serde(flatten, with = "PlaneParts")]
        plane: Plane,
        /// What is before it.
        cell: Cell,
    },
    /// Not covered.
    Nothing(#[serde(with = "gap_code")] Gap),
}

/// A seed, as it is written.
pub(super) type Seed = [u8; SEED_BYTES];

/// A proven cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The seed, as it is written.
    pub seed: Seed,
    /// Newton steps.
    pub steps: u8,
}

/// What a seed says.
pub(super) fn started(seed: Seed) -> Option<Start<f64>> {
    Some(decoded(seed)?.map(f64::from))
}

/// The seed of a start.
#[allow(clippy::cast_possible_truncation)] // that is what is stored
pub(super) fn written(start: &Start<f64>) -> Seed {
    encoded(&start.map(|number| number as f32))
}

/// How cells are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Effort {
    /// Newton steps at most.
    pub steps: u8,
    /// Halvings of a tile at most.
    pub depth: u8,
    /// Bytes of the table at most.
    pub max_bytes: Option<u32>,
}

/// A plane by its parts.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Plane")]
struct PlaneParts {
    normal: [i8; COORDINATES],
    offset: i16,
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

    /// Which of two halves is the only one that is covered at all, if that is so, and why the other is not.
    pub(super) fn one_half(halves: &[Self; 2]) -> Option<(usize, Gap)> {
        match halves {
            [Self::Nothing(gap), _] if Gap::ALL.contains(gap) => Some((1, *gap)),
            [_, Self::Nothing(gap)] if Gap::ALL.contains(gap) => Some((0, *gap)),
            _ => None,
        }
    }

    /// Whether its coordinates are those of a pose: to be asked of one that was read.
    pub(super) fn is_sound(&self) -> bool {
        match self {
            Self::Split { coordinate, halves } => {
                usize::from(*coordinate) < COORDINATES && halves.iter().all(Self::is_sound)
            }
            Self::Cell(cell) => decoded(cell.seed).is_some(),
            Self::Trim { plane: Plane { normal, offset }, cell } => {
                normal.iter().all(|n| n.unsigned_abs() <= Plane::LARGEST.unsigned_abs())
                    && offset.unsigned_abs() <= Plane::FARTHEST.unsigned_abs()
                    && decoded(cell.seed).is_some()
            }
            Self::Nothing(_) => true,
        }
    }

    /// Its cells, in the order in which they are written.
    pub(super) fn for_each_cell(&self, see: &mut impl FnMut(&Cell)) {
        match self {
            Self::Split { halves, .. } => halves.iter().for_each(|half| half.for_each_cell(see)),
            Self::Cell(cell) | Self::Trim { cell, .. } => see(cell),
            Self::Nothing(_) => {}
        }
    }

    /// Number of cells.
    pub(super) fn cells(&self) -> usize {
        let mut count = 0;
        self.for_each_cell(&mut |_| count += 1);
        count
    }
}

/// A box, or what of it is in a half-space, to be covered with one seed that is proven part by part, in so many halvings
/// at most.
pub(super) struct Pieces<'a> {
    part: &'a PoseBox,
    half: Option<&'a HalfSpace>,
    halvings: u8,
    /// One of the poses, and the solution of the sheet there.
    known: (Point, [f64; CABLES]),
}

impl<'a> Pieces<'a> {
    /// Of a box that may be halved so often.
    pub(super) fn new(
        part: &'a PoseBox,
        half: Option<&'a HalfSpace>,
        left: u8,
        known: (Point, [f64; CABLES]),
    ) -> Self {
        Self { part, half, halvings: left + PIECE_HALVINGS, known }
    }

    /// The corners of the box and so many poses all over it, those that are covered.
    fn poses(&self, count: usize) -> impl Iterator<Item = Point> {
        let all = corners(self.part).chain(self.part.spread(count));
        all.filter(|at| self.half.is_none_or(|half| half.contains(at)))
    }

    /// What of the box is around a pose, as large as the smallest pieces.
    fn around(&self, at: &Point) -> PoseBox {
        let part = self.part;
        // Only three coordinates are halved where turns are hardly any.
        let share = 0.5_f64.powi(i32::from(self.halvings / 3) + 1);
        let side = |k: usize| share * part.extent(k);
        PoseBox {
            low: std::array::from_fn(|k| part.low[k].max(at[k] - side(k))),
            high: std::array::from_fn(|k| part.high[k].min(at[k] + side(k))),
        }
    }
}

/// The corners of the positions of a box, with the turn in the middle.
fn corners(part: &PoseBox) -> impl Iterator<Item = Point> {
    (0..8_u8).map(|number| {
        let end = |k: usize| f64::from(number >> k & 1);
        part.at(&std::array::from_fn(|k| if k < 3 { end(k) } else { 0.5 }))
    })
}

pub(super) struct Tiler<'a> {
    pub(super) prover: &'a Prover,
    pub(super) survey: &'a Survey<'a>,
    pub(super) region: &'a PoseBox,
    pub(super) effort: Effort,
    /// A tile that takes no more than this is not worth the time to make it smaller.
    pub(super) spare_bytes: usize,
}

impl Tiler<'_> {
    /// Covers a tile as far as that goes.
    pub(super) fn cover(&self, tile: &PoseBox) -> Plan {
        let plan = self.part(tile, 0, &[]);
        if file::bytes(&plan) <= self.spare_bytes { plan } else { self.shared(plan, tile) }
    }

    /// Covers a box, with one of the seeds that larger boxes had, or of its own.
    fn part(&self, part: &PoseBox, depth: u8, given: &[Seed]) -> Plan {
        if !self.survey.is_near(part) {
            return Plan::Nothing(Gap::NoSolution);
        }
        let Some((at, found)) = self.found(part) else {
            return self.halved(part, depth, given, None, Gap::NoSolution);
        };
        if found.length_share > 1.0 && !self.is_within(part) {
            return self.halved(part, depth, given, None, Gap::BeyondLimits);
        }
        let Some(outlook) = Outlook::new(self.prover, part, &at, &found.charts) else {
            return self.halved(part, depth, given, None, Gap::SingularCable);
        };
        let known = (at, found.charts);
        let leads = |seed: &Seed| self.leads_to(*seed, &known);
        let mut given: Vec<Seed> = given.iter().copied().filter(leads).collect();
        let own: Vec<Seed> = outlook.starts.iter().map(written).filter(leads).collect();
        let bends = outlook.turns.iter().skip(BENDING).any(|turn| *turn > MOST_TURN);
        let at_once = if bends || outlook.defect > MOST_DEFECT {
            Err((Some(outlook.widest), Gap::Unproven))
        } else {
            self.cell(part, &given, &own)
        };
        let (split, gap) = match at_once {
            Ok(cell) => return Plan::Cell(cell),
            Err(why) => why,
        };
        let left = self.effort.depth - depth;
        if PIECED.contains(&left) {
            let pieces = Pieces::new(part, None, left, known);
            if let Some(cell) = self.pieced(&pieces, given.first(), &own) {
                return Plan::Cell(cell);
            }
        }
        if let Some(trimmed) = self.trimmed(part, left, (&at, &found), given.first()) {
            return trimmed;
        }
        if outlook.defect < DEFECT_OF_SEEDS {
            given.extend(own.first());
            if given.len() > SEEDS_GIVEN {
                given.remove(1);
            }
        }
        self.halved(part, depth, &given, split, gap)
    }

    /// Covers all of a box, with a seed that it was given or one of its own; the reason why that is not proven, and the
    /// coordinate in which to halve it.
    fn cell(
        &self,
        part: &PoseBox,
        given: &[Seed],
        own: &[Seed],
    ) -> Result<Cell, (Option<usize>, Gap)> {
        let leads = |seed: &&Seed| corners(part).all(|at| self.leads(**seed, &at));
        let mut leading = given.iter().filter(leads);
        let why = match self.first(part, leading.next()) {
            Ok(cell) => return Ok(cell),
            Err(why) => why,
        };
        let cell = self.first(part, own).map_err(|next| (next.0.or(why.0), next.1))?;
        // A seed that others have already makes a smaller table.
        Ok(self.first(part, leading).unwrap_or(cell))
    }

    /// The cell of the first seed with which it is proven.
    fn first<'s>(
        &self,
        part: &PoseBox,
        seeds: impl IntoIterator<Item = &'s Seed>,
    ) -> Result<Cell, (Option<usize>, Gap)> {
        let mut why = (None, Gap::TooManySteps);
        for seed in seeds {
            match self.examine(part, *seed) {
                Ok(cell) => return Ok(cell),
                Err(next) => why = (next.0.or(why.0), next.1),
            }
        }
        Err(why)
    }

    /// Covers a box up to a plane before a fold.
    fn trimmed(
        &self,
        part: &PoseBox,
        left: u8,
        (at, found): (&Point, &Found),
        given: Option<&Seed>,
    ) -> Option<Plan> {
        let (_, rooms) = ROOMS.iter().find(|(at, _)| *at == left)?;
        let edge = Edge::find(self.prover, part, at, &found.charts)?;
        rooms.iter().find_map(|room| {
            let plane = edge.plane(*room)?;
            let half = self.before(part, plane);
            let middle = Patch::within(*part, &half)?.middle;
            let charts = self.survey.follow(at, found, &middle)?.charts;
            let outlook = Outlook::new(self.prover, part, &middle, &charts)?;
            let own = outlook.starts.first().map(written);
            let pieces = Pieces::new(part, Some(&half), left, (middle, charts));
            let cell = self.pieced(&pieces, given, own.as_slice())?;
            Some(Plan::Trim { plane, cell })
        })
    }

    /// All that a controller may take for a pose of a box before a plane.
    pub(super) fn before(&self, part: &PoseBox, plane: Plane) -> HalfSpace {
        HalfSpace::of(part, plane).wider(&self.room())
    }

    /// Covers all of some pieces with one seed: one that the box was given, or one of its own.
    fn pieced(&self, pieces: &Pieces, given: Option<&Seed>, own: &[Seed]) -> Option<Cell> {
        let mut seeds = given.into_iter().chain(own).filter(|seed| self.leads_over(**seed, pieces));
        seeds.find_map(|seed| self.prove(pieces, *seed))
    }

    /// The cell of some pieces with a seed that leads to solutions over them, if that is proven.
    pub(super) fn prove(&self, pieces: &Pieces, seed: Seed) -> Option<Cell> {
        let start = started(seed)?;
        // Where it is hard it fails at once.
        let hardest = self.hardest(pieces, &start)?;
        match self.verdict(&hardest, pieces.half, &start) {
            Verdict::Proven { .. } => {
                let steps = self.prove_pieces(pieces.part, pieces, &start, pieces.halvings)?;
                Some(Cell { seed, steps })
            }
            _ => None,
        }
    }

    /// A small box in one of the pieces over which the equations bend and turn most.
    fn hardest(&self, pieces: &Pieces, start: &Start<f64>) -> Option<PoseBox> {
        let all = pieces.poses(POSES_PROBED).filter_map(|at| {
            let charts = self.prover.led(&at, start, self.effort.steps)?;
            let around = pieces.around(&at);
            let Outlook { turns, defect, .. } = Outlook::new(self.prover, &around, &at, &charts)?;
            // The cable that turns most is the eliminated one, mostly.
            Some((defect + turns[1], around))
        });
        let (_, hardest) = all.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
        Some(hardest)
    }

    /// The steps that a seed takes for the pieces in a part of their box, if that is proven.
    fn prove_pieces(
        &self,
        part: &PoseBox,
        pieces: &Pieces,
        start: &Start<f64>,
        halvings: u8,
    ) -> Option<u8> {
        match self.verdict(part, pieces.half, start) {
            Verdict::Proven { steps } => Some(steps),
            Verdict::Open { split, .. } if halvings > 0 => {
                let parts = part.halves(split);
                // What is closer to the plane fails sooner.
                let first = pieces.half.map_or(0, |half| half.nearer_half(split));
                let mut most = 1;
                for part in [parts[first], parts[1 - first]] {
                    most = most.max(self.prove_pieces(&part, pieces, start, halvings - 1)?);
                }
                Some(most)
            }
            _ => None,
        }
    }

    /// Whether a seed leads to the known solution of some pieces, and to one at the corners and all over them.
    pub(super) fn leads_over(&self, seed: Seed, pieces: &Pieces) -> bool {
        self.leads_to(seed, &pieces.known)
            && pieces.poses(POSES_LED).all(|at| self.leads(seed, &at))
    }

    /// Whether the sheet is found within its limits anywhere in a box.
    fn is_within(&self, part: &PoseBox) -> bool {
        let mut poses = part.spread(POSES_LED);
        poses.any(|at| self.survey.solution(&at).is_some_and(|found| found.length_share <= 1.0))
    }

    /// Whether a seed leads to a solution at a pose, as far as floats tell.
    fn leads(&self, seed: Seed, at: &Point) -> bool {
        started(seed).is_some_and(|start| self.prover.leads(at, &start, self.effort.steps))
    }

    /// Whether a seed leads to this solution at a pose: there may be another one of the same sign.
    pub(super) fn leads_to(&self, seed: Seed, (at, charts): &(Point, [f64; CABLES])) -> bool {
        let led = started(seed).and_then(|start| self.prover.led(at, &start, self.effort.steps));
        led.is_some_and(|led| is_same(charts, &led))
    }

    /// What of each coordinate a controller's rounding may add.
    fn room(&self) -> Point {
        std::array::from_fn(|k| {
            let turn = if k < 3 { 0.0 } else { TURN_ROUNDING };
            PLACE_ROUNDING * self.region.extent(k) + turn
        })
    }

    /// The proof of a box, or of what of it is in a half-space, with all that a controller may take for a pose of it.
    fn verdict(&self, part: &PoseBox, half: Option<&HalfSpace>, start: &Start<f64>) -> Verdict {
        let room = self.room();
        let mut whole = *part;
        for k in 0..COORDINATES {
            whole.low[k] -= room[k];
            whole.high[k] += room[k];
        }
        match Patch::of(whole, half) {
            Some(patch) => self.prover.examine(&patch, start, self.effort.steps),
            None => Verdict::Proven { steps: 1 }, // for no pose at all
        }
    }

    /// What is made of the halves of a box; nothing, for the reason given, when it is not to be halved any more.
    fn halved(
        &self,
        part: &PoseBox,
        depth: u8,
        given: &[Seed],
        split: Option<usize>,
        gap: Gap,
    ) -> Plan {
        // What is within its limits of a box without a pose that is found to be so is hardly worth its words.
        let is_last = gap == Gap::BeyondLimits && self.effort.depth - depth <= LAST_BEYOND;
        if depth >= self.effort.depth || is_last {
            return Plan::Nothing(gap);
        }
        let split = split.unwrap_or_else(|| self.longest(part));
        Plan::of(split, part.halves(split).map(|half| self.part(&half, depth + 1, given)))
    }

    /// The proof of a box.
    fn examine(&self, part: &PoseBox, seed: Seed) -> Result<Cell, (Option<usize>, Gap)> {
        let start = started(seed).ok_or((None, Gap::Other))?;
        match self.verdict(part, None, &start) {
            Verdict::Proven { steps } => Ok(Cell { seed, steps }),
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
