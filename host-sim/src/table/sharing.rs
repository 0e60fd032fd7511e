//! Cells of a tile that can do with the seed of another: a seed takes more bytes than a cell. To find them takes about half
//! as long as to cover the tile, and is left out where there are bytes to spare.
//!
//! While a box is covered it is not known which seeds others will have. So at the end each cell that is alone with its
//! seed is tried with those of the cells nearest to it in the tree; then so is each of those that share theirs with one
//! other. Halves that have one seed then are one cell.

use std::collections::{BTreeMap, BTreeSet};

use super::cells::{Cell, Pieces, Plan, Seed, Tiler, started};
use super::patch::{HalfSpace, Patch};
use super::place::PoseBox;

/// Cells of a seed at most, for them to be tried with others.
const FEW: usize = 2;
/// Seeds of others that are looked at in floats for a cell, and those of which a proof is tried.
const SEEDS_LOOKED_AT: usize = 40;
const SEEDS_TRIED: usize = 3;

/// The cells of a tile, in the order of the tree.
struct Cells {
    seeds: Vec<Seed>,
    /// How many cells have each seed now.
    uses: BTreeMap<Seed, usize>,
    /// The seeds whose cells are tried with others.
    rare: BTreeSet<Seed>,
    /// The number of the next one.
    next: usize,
}

impl Cells {
    /// The cells of a plan. Those are tried with the seeds of others whose own exactly so many of them have.
    fn of(plan: &Plan, few: usize) -> Self {
        let (mut seeds, mut uses) = (Vec::new(), BTreeMap::new());
        plan.for_each_cell(&mut |cell| {
            seeds.push(cell.seed);
            *uses.entry(cell.seed).or_default() += 1;
        });
        let rare = uses.iter().filter(|(_, uses)| **uses == few).map(|(seed, _)| *seed).collect();
        Self { seeds, uses, rare, next: 0 }
    }

    /// The seeds of other cells that no fewer have, of the nearest first, each once.
    fn nearest(&self, cell: usize) -> Vec<Seed> {
        let own = self.seeds[cell];
        let mut nearest = Vec::with_capacity(SEEDS_LOOKED_AT);
        let both = |far| [cell.checked_sub(far), Some(cell + far)];
        for other in (1..self.seeds.len()).flat_map(both).flatten() {
            let Some(seed) = self.seeds.get(other) else { continue };
            let is_new = *seed != own && !nearest.contains(seed);
            if is_new && self.uses[seed] >= self.uses[&own] {
                nearest.push(*seed);
            }
            if nearest.len() == SEEDS_LOOKED_AT {
                break;
            }
        }
        nearest
    }
}

impl Tiler<'_> {
    /// A plan of a tile with fewer seeds.
    pub(super) fn shared(&self, plan: Plan, tile: &PoseBox) -> Plan {
        (1..=FEW).fold(plan, |plan, few| {
            let mut cells = Cells::of(&plan, few);
            self.shared_part(plan, tile, self.effort.depth, &mut cells)
        })
    }

    fn shared_part(&self, plan: Plan, part: &PoseBox, left: u8, cells: &mut Cells) -> Plan {
        match plan {
            Plan::Split { coordinate, halves } => {
                let coordinate = usize::from(coordinate);
                let [lower, upper] = *halves;
                let [below, above] = part.halves(coordinate);
                let lower = self.shared_part(lower, &below, left - 1, cells);
                let upper = self.shared_part(upper, &above, left - 1, cells);
                Plan::of(coordinate, [lower, upper])
            }
            Plan::Cell(cell) => Plan::Cell(self.sharing(cell, part, None, left, cells)),
            Plan::Trim { plane, cell } => {
                let half = self.before(part, plane);
                Plan::Trim { plane, cell: self.sharing(cell, part, Some(&half), left, cells) }
            }
            Plan::Nothing(gap) => Plan::Nothing(gap),
        }
    }

    /// The next cell, with the seed of another if its own is rare and that is proven.
    fn sharing(
        &self,
        cell: Cell,
        part: &PoseBox,
        half: Option<&HalfSpace>,
        left: u8,
        cells: &mut Cells,
    ) -> Cell {
        let number = cells.next;
        cells.next += 1;
        if !cells.rare.contains(&cell.seed) {
            return cell;
        }
        let other = || {
            let at = Patch::of(*part, half)?.middle;
            let charts = self.prover.led(&at, &started(cell.seed)?, cell.steps)?;
            let pieces = Pieces::new(part, half, left, (at, charts));
            let nearest = cells.nearest(number).into_iter();
            let leading = nearest.filter(|seed| self.leads_over(*seed, &pieces));
            leading.take(SEEDS_TRIED).find_map(|seed| self.prove(&pieces, seed))
        };
        let Some(shared) = other() else { return cell };
        *cells.uses.entry(cell.seed).or_default() -= 1;
        *cells.uses.entry(shared.seed).or_default() += 1;
        shared
    }
}

#[cfg(test)]
mod tests {
    use cdpr_core::table::SEED_BYTES;

    use super::*;

    #[test]
    fn the_nearest_come_first_and_once() {
        let seed = |number: u8| [number; SEED_BYTES];
        let plan = |number: u8| Plan::Cell(Cell { seed: seed(number), steps: 1 });
        let plans = [1, 2, 1, 3, 4, 4, 5].map(plan);
        let all = plans
            .into_iter()
            .rev()
            .reduce(|rest, plan| Plan::Split { coordinate: 0, halves: Box::new([plan, rest]) });
        let mut cells = Cells::of(&all.expect("seven"), 2);
        assert_eq!(cells.nearest(3), [1, 4, 2, 5].map(seed));
        // A cell that shares its seed with another is not tried with one that is alone.
        assert_eq!(cells.nearest(0), [4].map(seed));
        // Nothing is left of this one.
        cells.uses.insert(seed(2), 0);
        cells.uses.insert(seed(1), 1);
        assert_eq!(cells.nearest(0), [3, 4, 5].map(seed));
        assert!(cells.rare.iter().eq(&[1, 4].map(seed)));
    }
}
