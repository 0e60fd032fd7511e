//! The best table of so many bytes: cells that cover little for what they take are left out.

use std::collections::BTreeMap;

use cdpr_core::table::{Gap, Node, Plane, SEED_BYTES, WORD_BYTES};

use super::cells::{Cell, Plan, Seed};
use super::place::spread;

/// Halvings of the price.
const SEARCH: usize = 40;
/// Places of the box of a trim at which it is looked whether they are before its plane.
const PLACES: usize = 64;

/// The plan, or what remains of it when `fits` at last.
///
/// Each part of it is kept when the share of the region that it covers is worth its words, at one price for a word,
/// which is the lowest at which the table fits: so nearly the most is covered. The words of a seed are shared out among
/// all cells of the plan that have it.
pub(super) fn fitting(plan: Plan, fits: impl Fn(&Plan) -> bool) -> Plan {
    if fits(&plan) {
        return plan;
    }
    let mut uses = BTreeMap::new();
    plan.for_each_cell(&mut |cell| *uses.entry(cell.seed).or_default() += 1);
    let at_price = |price: f64| Market { price, uses: &uses }.kept(&plan, 1.0).0;
    // No cell covers more than all.
    let (mut low, mut high) = (0.0, 1.0);
    let mut best = at_price(high);
    for _ in 0..SEARCH {
        // From very little on.
        let price = if low > 0.0 { 0.5 * (low + high) } else { 0.125 * high };
        let pruned = at_price(price);
        if fits(&pruned) {
            (high, best) = (price, pruned);
        } else {
            low = price;
        }
    }
    best
}

/// What words cost.
struct Market<'a> {
    /// Of one word, as a share of the region.
    price: f64,
    /// How many cells of the plan have each seed.
    uses: &'a BTreeMap<Seed, usize>,
}

impl Market<'_> {
    /// What is worth the price of its words of a plan for this share of the region, and what it is worth.
    fn kept(&self, plan: &Plan, share: f64) -> (Plan, f64) {
        let price = self.price;
        let cell_price = |cell: &Cell| {
            let sharing = self.uses.get(&cell.seed).map_or(1.0, |uses| *uses as f64);
            (1.0 + (SEED_BYTES / WORD_BYTES) as f64 / sharing) * price
        };
        let (kept, worth) = match plan {
            Plan::Split { coordinate, halves } => {
                let [(lower, a), (upper, b)] =
                    halves.each_ref().map(|half| self.kept(half, 0.5 * share));
                (Plan::of(usize::from(*coordinate), [lower, upper]), a + b - price)
            }
            Plan::Cell(cell) => (plan.clone(), share - cell_price(cell)),
            Plan::Trim { plane, cell } => {
                let (_, words) = Node::Trim { plane: *plane, inside: 0 }.encode();
                (plan.clone(), before(*plane) * share - words as f64 * price - cell_price(cell))
            }
            // It is said where the box was halved.
            Plan::Nothing(_) => (plan.clone(), 0.0),
        };
        if worth < 0.0 { (Plan::Nothing(Gap::LeftOut), 0.0) } else { (kept, worth) }
    }
}

/// What of a box is before a plane, about.
fn before(plane: Plane) -> f64 {
    let places = (0..PLACES).map(spread).filter(|place| !plane.is_beyond(place));
    places.count() as f64 / PLACES as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(seed: u8) -> Plan {
        Plan::Cell(Cell { seed: [seed; SEED_BYTES], steps: 1 })
    }

    fn split(lower: Plan, upper: Plan) -> Plan {
        Plan::Split { coordinate: 0, halves: Box::new([lower, upper]) }
    }

    /// A large cell, and ever smaller ones.
    fn staircase(depth: u8) -> Plan {
        if depth == 0 { Plan::Nothing(Gap::Fold) } else { split(cell(depth), staircase(depth - 1)) }
    }

    #[test]
    fn what_fits_is_kept_whole() {
        let plan = staircase(8);
        assert_eq!(fitting(plan.clone(), |_| true), plan);
    }

    #[test]
    fn the_smallest_cells_go_first() {
        for most in 1..8 {
            let kept = fitting(staircase(8), |plan| plan.cells() <= most);
            assert_eq!(kept.cells(), most);
            let mut at = &kept;
            for depth in 0..most {
                let Plan::Split { halves, .. } = at else { panic!("{kept:?}") };
                assert_eq!(halves[0], cell(8 - u8::try_from(depth).unwrap()));
                at = &halves[1];
            }
            assert_eq!(*at, Plan::Nothing(Gap::LeftOut));
        }
    }

    #[test]
    fn nothing_remains_where_nothing_fits() {
        assert_eq!(fitting(staircase(3), |plan| plan.cells() == 0), Plan::Nothing(Gap::LeftOut));
    }
}
