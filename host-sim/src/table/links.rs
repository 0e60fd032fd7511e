//! The cells of a region, linked into connected sheets.
//!
//! Within a cell the solution is one continuous function of the pose: at every pose it is where Newton's method
//! leads from the seed. Two cells that share a face have the same solution all over what they share of it, which is
//! convex, when they have it at one pose. Where they do not, the sheet has come back to the same poses on another
//! branch: a seam. Cells that share no face with others of the sheet are linked to it by the way on which the survey came
//! there, proven box by box as cells are.

use std::collections::BTreeMap;

use cdpr_core::CABLES;
use cdpr_core::table::{COORDINATES, Gap};

use super::cells::{Cell, Plan, started};
use super::outlook::Outlook;
use super::patch::{HalfSpace, Patch};
use super::place::{Point, PoseBox};
use super::proof::{Prover, Verdict, is_same};
use super::survey::Survey;

/// Poses of a face, and of a cell, that are tried.
const POSES_TRIED: usize = 64;
/// Ways that are tried from cells that are connected to each other but not to the sheet; halvings of a leg, and Newton
/// steps of a box of it.
const WAYS: usize = 16;
const WAY_HALVINGS: u8 = 7;
const WAY_STEPS: u8 = 6;

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

/// Keeps of `plan` what is connected to the cell with this solution at a pose; `None` when there is none. Returns the
/// seams within what is kept as well.
pub(super) fn connected(
    prover: &Prover,
    survey: &Survey,
    region: &PoseBox,
    plan: Plan,
    (start, charts): (&Point, &[f64; CABLES]),
) -> Option<(Plan, Vec<Seam>)> {
    let mut cells = Vec::new();
    gather(&plan, region, &mut cells);
    let is_first = |placed: &Placed| {
        placed.contains(start)
            && placed.solution(prover, start).is_some_and(|its| is_same(&its, charts))
    };
    let first = cells.iter().position(is_first)?;
    let mut sets = Sets::new(cells.len());
    let mut seams = Vec::new();
    for (a, placed) in cells.iter().enumerate() {
        for (b, other) in cells.iter().enumerate().skip(a + 1) {
            let Some(at) = placed.shared(other) else { continue };
            let ends = [placed, other].map(|placed| placed.solution(prover, &at));
            let [Some(here), Some(there)] = ends else { continue };
            if is_same(&here, &there) {
                sets.join(a, b);
            } else {
                seams.push((a, b, Seam { pose: at }));
            }
        }
    }
    by_ways(prover, survey, &cells, &mut sets, first);
    let sheet = sets.root(first);
    let kept: Vec<bool> = (0..cells.len()).map(|index| sets.root(index) == sheet).collect();
    let within = seams.into_iter().filter(|(a, b, _)| kept[*a] && kept[*b]);
    let seams = within.map(|(_, _, seam)| seam).collect();
    let mut index = 0;
    Some((keep(plan, &kept, &mut index), seams))
}

/// Joins to the sheet what shares no face with others of it but is linked to them by a way: that by which the survey came
/// there from the start, proven leg by leg.
fn by_ways(prover: &Prover, survey: &Survey, cells: &[Placed], sets: &mut Sets, first: usize) {
    let roots: Vec<usize> = (0..cells.len()).map(|index| sets.root(index)).collect();
    let mut tried: BTreeMap<usize, usize> = BTreeMap::new();
    for (a, from) in cells.iter().enumerate() {
        let tried = tried.entry(roots[a]).or_default();
        if *tried >= WAYS || sets.root(a) == sets.root(first) {
            continue;
        }
        let Some((end, at_end)) = from.known(prover, survey) else { continue };
        *tried += 1;
        let (mut at, mut known) = (end, at_end);
        for to in survey.way_back(&end) {
            let Some(there) = walked(prover, (&at, &known), &to, WAY_HALVINGS) else { break };
            for (b, cell) in cells.iter().enumerate().filter(|(_, cell)| cell.contains(&to)) {
                if cell.solution(prover, &to).is_some_and(|its| is_same(&its, &there)) {
                    sets.join(a, b);
                }
            }
            if sets.root(a) == sets.root(first) {
                break;
            }
            (at, known) = (to, there);
        }
    }
}

/// The solution at the end of a straight way that is the one at its beginning, proven all along: the way is covered
/// with boxes, over each of which the solution is one continuous function of the pose, and which share their ends.
fn walked(
    prover: &Prover,
    (from, start): (&Point, &[f64; CABLES]),
    to: &Point,
    halvings: u8,
) -> Option<[f64; CABLES]> {
    let low = std::array::from_fn(|k| from[k].min(to[k]));
    let high = std::array::from_fn(|k| from[k].max(to[k]));
    let part = PoseBox { low, high };
    let middle = part.middle();
    let at_once = || {
        let (charts, _) =
            prover.settle(&prover.balance(&middle)?, start, usize::from(WAY_STEPS))?;
        let outlook = Outlook::new(prover, &part, &middle, &charts)?;
        let patch = Patch::whole(part);
        outlook.starts.iter().find_map(|seed| {
            let Verdict::Proven { steps } = prover.examine(&patch, seed, WAY_STEPS) else {
                return None;
            };
            is_same(start, &prover.led(from, seed, steps)?).then(|| prover.led(to, seed, steps))?
        })
    };
    at_once().or_else(|| {
        let left = halvings.checked_sub(1)?;
        let there = walked(prover, (from, start), &middle, left)?;
        walked(prover, (&middle, &there), to, left)
    })
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

    /// A pose of it at which its solution is that of the survey, and the solution.
    fn known(&self, prover: &Prover, survey: &Survey) -> Option<(Point, [f64; CABLES])> {
        let middle = Patch::of(self.part, self.trim.as_ref())?.middle;
        let others = self.part.spread(POSES_TRIED).filter(|at| self.contains(at));
        std::iter::once(middle).chain(others).find_map(|at| {
            let (known, found) = (self.solution(prover, &at)?, survey.solution(&at)?);
            is_same(&known, &found.charts).then_some((at, known))
        })
    }

    /// Its solution at a pose of it.
    fn solution(&self, prover: &Prover, at: &Point) -> Option<[f64; CABLES]> {
        prover.led(at, &started(self.cell.seed)?, self.cell.steps)
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
        let others = face.spread(POSES_TRIED);
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

#[cfg(test)]
mod tests {
    use cdpr_core::Charted as _;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt as _, SeedableRng as _};

    use super::super::cells::{Effort, Tiler, written};
    use super::super::{LEVEL, Model, Region};
    use super::*;
    use crate::choice::{Choice, choose};
    use crate::enumerate::{ModelKind, Request};
    use crate::robot_file::{CableLimits, RobotDescription};

    /// MARIONET-CRANE, level at a position, and one of its solutions within 60 m.
    fn hung(position_m: [f64; 3], solution: Option<usize>) -> (Prover, [f64; CABLES]) {
        let mut robot = RobotDescription::marionet_crane();
        for limits in &mut robot.limits {
            limits.max_length_m = 60.0;
        }
        let load = robot.load;
        let model = ModelKind::Irvine;
        let request = Request { robot, position_m, rotation_vector_rad: [0.0; 3], model };
        let robot = request.problem::<Model>().expect("a problem").robot;
        let states = choose(&request, Choice::Shortest, solution).expect("a solution").states;
        let charts = std::array::from_fn(|i| robot.cables()[i].model.chart(&states[i]));
        (Prover::new(&robot, &load), charts)
    }

    /// Where many small steps of Newton's method lead, without proof; `None` where one is long, or changes the sign.
    fn in_small_steps(
        prover: &Prover,
        from: &Point,
        start: &[f64; CABLES],
        to: &Point,
    ) -> Option<[f64; CABLES]> {
        const PARTS: u32 = 2000;
        let mut charts = *start;
        let sign = |at: &Point, charts: &[f64; CABLES]| {
            let step = prover.step(&prover.balance(at)?, charts)?;
            Some(step.elimination().is_positive())
        };
        let wanted = sign(from, start)?;
        for part in 1..=PARTS {
            let share = f64::from(part) / f64::from(PARTS);
            let at: Point = std::array::from_fn(|k| from[k] + (to[k] - from[k]) * share);
            let (next, _) = prover.settle(&prover.balance(&at)?, &charts, 8)?;
            let is_short = (0..CABLES).all(|i| (next[i] - charts[i]).abs() < 1.0);
            if !is_short || sign(&at, &next)? != wanted {
                return None;
            }
            charts = next;
        }
        Some(charts)
    }

    /// From a pose at 17 cm from a fold: ways end where small steps lead, and none goes through the fold.
    #[test]
    fn ways_end_where_small_steps_lead() {
        let (prover, start) = hung([2.1, 9.1, 1.2], None);
        let from = [2.1, 9.1, 1.2, 0.0, 0.0, 0.0];
        let (mut linked, mut folded) = (0, 0);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..24 {
            let mut to = from;
            for k in 0..3 {
                to[k] += random.random_range(-0.1..0.6);
            }
            let way = walked(&prover, (&from, &start), &to, WAY_HALVINGS);
            let steps = in_small_steps(&prover, &from, &start, &to);
            match (way, steps) {
                (Some(way), Some(steps)) => {
                    assert!(is_same(&way, &steps), "{to:?}: {way:?} {steps:?}");
                    linked += 1;
                }
                (Some(way), None) => panic!("{to:?}: through a fold to {way:?}"),
                (None, None) => folded += 1,
                (None, Some(_)) => {} // too close to the fold for the proof
            }
        }
        assert!(linked > 5 && folded > 5, "{linked} {folded}");
    }

    /// Where two branches of one sign are over the same poses, one of them is of the sheet. A seed that leads to the other
    /// is not taken. Cells with a gap between them are linked by the way through it if they have one solution there, and
    /// not else.
    #[test]
    fn of_two_branches_one_is_of_the_sheet() {
        let position_m = [3.438, 7.32, 1.089];
        let [(prover, start), (_, other)] = [1, 3].map(|number| hung(position_m, Some(number)));
        // The branches are over the same poses in a band 2 cm wide, along z.
        let around = |aside: f64, up: f64| {
            let [x, y, z] = position_m;
            PoseBox {
                low: [x - aside, y - aside, z - up, -LEVEL, -LEVEL, -LEVEL],
                high: [x + aside, y + aside, z + up, LEVEL, LEVEL, LEVEL],
            }
        };
        let poses = around(0.001, 0.02);
        let at = poses.middle();
        let limits = [CableLimits { max_length_m: 60.0, max_tension_n: f64::INFINITY }; CABLES];
        let region = Region { poses: around(0.02, 0.1), limits };
        let survey = Survey::new(&prover, &region, &at, &start).expect("the sheet");
        let seed = |charts: &[f64; CABLES]| {
            let outlook = Outlook::new(&prover, &poses, &at, charts).expect("regular");
            written(&outlook.starts[0])
        };
        let effort = Effort { steps: 4, depth: 1, max_bytes: None };
        let (spare_bytes, region) = (0, &poses);
        let tiler = Tiler { prover: &prover, survey: &survey, region, effort, spare_bytes };
        assert!(tiler.leads_to(seed(&start), &(at, start)));
        assert!(!tiler.leads_to(seed(&other), &(at, start)));

        let cell = |charts: &[f64; CABLES]| Plan::Cell(Cell { seed: seed(charts), steps: 4 });
        let split = |lower: Plan, upper: Plan| Plan::Split {
            coordinate: 2,
            halves: Box::new([lower, upper]),
        };
        let linked = |upper: Plan| {
            let plan = split(cell(&start), upper);
            let (plan, seams) =
                connected(&prover, &survey, &poses, plan, (&at, &start)).expect("the first");
            (plan.cells(), seams.len())
        };
        let gap = || Plan::Nothing(Gap::Unproven);
        assert_eq!(linked(split(gap(), cell(&start))), (2, 0));
        assert_eq!(linked(split(gap(), cell(&other))), (1, 0));
        // They share a face, but no seam is within the sheet.
        assert_eq!(linked(cell(&other)), (1, 0));
        // Nor is there anything of the sheet where another branch alone is covered.
        let other = connected(&prover, &survey, &poses, cell(&other), (&at, &start));
        assert!(other.is_none());
    }
}
