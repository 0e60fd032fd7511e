//! The cells of a region, linked into connected sheets.
//!
//! Within a cell the solution is one continuous function of the pose: at every pose it is where Newton's method
//! leads from the seed. Two cells that share a face have the same solution all over what they share of it, which is
//! convex, when they have it at one pose. Where they do not, the sheet has come back to the same poses on another
//! branch: a seam.

use std::collections::BTreeMap;

use cdpr_core::CABLES;
use cdpr_core::table::{COORDINATES, Gap};

use super::cells::{Cell, Plan, spread, started};
use super::patch::HalfSpace;
use super::place::{Point, PoseBox};
use super::proof::Prover;

/// Two solutions that differ by less are one: far below the radii within which each is proven to be alone.
const SAME: f64 = 1e-6;
/// Poses of a face that are tried.
const FACE_ATTEMPTS: usize = 64;

/// Where two cells share poses but not the solution. Not looked for where planes leave next to nothing of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seam {
    /// Such a pose: position (m) and turn vector.
    pub pose: Point,
}

/// Sets of what is connected.
pub(super) struct Sets(Vec<usize>);

impl Sets {
    /// So many things, each by itself.
    pub(super) fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    /// What stands for the set of this one.
    pub(super) fn root(&mut self, mut index: usize) -> usize {
        while self.0[index] != index {
            self.0[index] = self.0[self.0[index]];
            index = self.0[index];
        }
        index
    }

    pub(super) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        // The lower number stands for both, in whatever order they come.
        self.0[a.max(b)] = a.min(b);
    }
}

/// Keeps of `plan` what is connected to the cell at `start`; `None` when there is none. Returns the seams
/// within what is kept as well.
pub(super) fn connected(
    prover: &Prover,
    region: &PoseBox,
    plan: Plan,
    start: &Point,
) -> Option<(Plan, Vec<Seam>)> {
    let mut cells = Vec::new();
    gather(&plan, region, &mut cells);
    let first = cells.iter().position(|placed| placed.contains(start))?;
    let mut sets = Sets::new(cells.len());
    let mut seams = Vec::new();
    for (a, placed) in cells.iter().enumerate() {
        for (b, other) in cells.iter().enumerate().skip(a + 1) {
            let Some(at) = placed.shared(other) else { continue };
            let lead = |cell: &Cell| {
                let balance = prover.balance(&at)?;
                Some(prover.lead(&balance, &started(&cell.seed)?, cell.steps)?.0)
            };
            let (Some(here), Some(there)) = (lead(&placed.cell), lead(&other.cell)) else {
                continue;
            };
            let same = |i: usize| (here[i] - there[i]).abs() <= SAME * (1.0 + here[i].abs());
            if (0..CABLES).all(same) {
                sets.join(a, b);
            } else {
                seams.push((a, Seam { pose: at }));
            }
        }
    }
    let sheet = sets.root(first);
    let kept: Vec<bool> = (0..cells.len()).map(|index| sets.root(index) == sheet).collect();
    let seams = seams.into_iter().filter(|(a, _)| kept[*a]).map(|(_, seam)| seam).collect();
    let mut index = 0;
    Some((keep(plan, &kept, &mut index), seams))
}

/// A cell, where it is.
struct Placed {
    part: PoseBox,
    trim: Option<HalfSpace>,
    cell: Cell,
}

impl Placed {
    fn contains(&self, at: &Point) -> bool {
        self.part.contains(at) && self.trim.is_none_or(|half| half.contains(at))
    }

    /// A pose of the face that two cells share; `None` when they do not even touch, or along an edge only, or none was
    /// found before their planes.
    fn shared(&self, other: &Self) -> Option<Point> {
        let face = self.part.intersection(&other.part)?;
        let flat = (0..COORDINATES).filter(|&k| face.extent(k) <= 0.0).count();
        if flat != 1 {
            return None;
        }
        let is_of_both = |at: &Point| self.contains(at) && other.contains(at);
        let others = (0..FACE_ATTEMPTS).map(|n| face.at(&spread(n)));
        std::iter::once(face.middle()).chain(others).find(is_of_both)
    }
}

fn gather(plan: &Plan, region: &PoseBox, cells: &mut Vec<Placed>) {
    match plan {
        Plan::Split { coordinate, halves } => {
            let parts = region.halves(usize::from(*coordinate));
            for (half, part) in halves.iter().zip(&parts) {
                gather(half, part, cells);
            }
        }
        Plan::Cell(cell) => cells.push(Placed { part: *region, trim: None, cell: *cell }),
        Plan::Trim { plane, cell } => {
            let trim = Some(HalfSpace::of(region, *plane));
            cells.push(Placed { part: *region, trim, cell: *cell });
        }
        Plan::Nothing(_) => {}
    }
}

fn keep(plan: Plan, kept: &[bool], index: &mut usize) -> Plan {
    match plan {
        Plan::Split { coordinate, halves } => {
            let [lower, upper] = *halves;
            let lower = keep(lower, kept, index);
            let upper = keep(upper, kept, index);
            Plan::of(usize::from(coordinate), [lower, upper])
        }
        Plan::Cell(_) | Plan::Trim { .. } => {
            let is_kept = kept[*index];
            *index += 1;
            if is_kept { plan } else { Plan::Nothing(Gap::NotConnected) }
        }
        Plan::Nothing(_) => plan,
    }
}

/// How many places of a plan are not covered, by reason.
pub(super) fn gaps(plan: &Plan, counts: &mut BTreeMap<Gap, usize>) {
    match plan {
        Plan::Split { halves, .. } => halves.iter().for_each(|half| gaps(half, counts)),
        Plan::Trim { .. } => *counts.entry(Gap::Fold).or_default() += 1,
        Plan::Nothing(gap) => *counts.entry(*gap).or_default() += 1,
        Plan::Cell(_) => {}
    }
}
