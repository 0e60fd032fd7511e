//! Where the sheet is, roughly: followed over a grid of level poses, from the start outwards, the poses with
//! the shortest longest cable first. Nothing is proven here; it says where to look for seeds, which solution they are to
//! lead to, and by which ways cells may be linked.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use cdpr_core::chart::ChartStep;
use cdpr_core::table::COORDINATES;
use cdpr_core::{CABLES, CableState};

use super::Region;
use super::place::{Point, PoseBox};
use super::proof::Prover;

/// Grid points, about.
const GRID_POINTS: f64 = 60_000.0;
/// Parts of a straight way at first, and how often one may be halved.
const PARTS: f64 = 1.0 / 4.0;
const SHORTEST_PART: f64 = 1.0 / 512.0;
/// Newton steps of a part.
const STEPS: usize = 6;
/// Lengths beyond the limit by this factor are not followed further.
const BEYOND: f64 = 2.0;

/// A solution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) charts: [f64; CABLES],
    /// Largest rest length over its limit.
    pub(super) length_share: f64,
    /// Whether tensions are within their limits, too.
    pub(super) is_within: bool,
    is_positive: bool,
}

/// Solutions of the sheet on a grid.
pub(super) struct Survey<'a> {
    prover: &'a Prover,
    region: &'a Region,
    /// Where it began.
    start: Point,
    counts: [usize; 3],
    /// At the grid points, which all have the turn vector of the middle of the region.
    nodes: Vec<Option<Node>>,
}

/// A grid point with the solution there.
#[derive(Clone, Copy)]
struct Node {
    found: Found,
    /// The one from which it was followed; none for the first.
    from: Option<usize>,
}

/// For the queue, where infinities and NaN are not used.
#[derive(Clone, Copy, PartialEq)]
struct Share(f64);

impl Eq for Share {}

impl PartialOrd for Share {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Share {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl<'a> Survey<'a> {
    /// Follows the sheet through the solution `charts` at `start` over the region.
    pub(super) fn new(
        prover: &'a Prover,
        region: &'a Region,
        start: &Point,
        charts: &[f64; CABLES],
    ) -> Option<Self> {
        let space = &region.poses;
        let volume: f64 = (0..3).map(|k| space.extent(k)).product();
        let spacing = (volume / GRID_POINTS).cbrt();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // positive, and not large
        let counts: [usize; 3] = std::array::from_fn(|k| {
            (space.extent(k) / spacing).ceil().clamp(1.0, 1e4) as usize + 1
        });
        let nodes = vec![None; counts.iter().product()];
        let mut survey = Self { prover, region, start: *start, counts, nodes };
        let first = survey.found_at(start, charts)?;
        let nearest = survey.nearest(start);
        let mut queue = BinaryHeap::new();
        let at_first = survey.follow(start, &first, &survey.place(nearest))?;
        queue.push((Reverse(Share(at_first.length_share)), nearest));
        let mut pending = vec![None; survey.nodes.len()];
        pending[nearest] = Some(Node { found: at_first, from: None });
        while let Some((_, index)) = queue.pop() {
            if survey.nodes[index].is_some() {
                continue;
            }
            let Some(node) = pending[index] else { continue };
            survey.nodes[index] = Some(node);
            let found = node.found;
            if found.length_share > BEYOND {
                continue;
            }
            let from = survey.place(index);
            for neighbour in survey.neighbours(index) {
                if survey.nodes[neighbour].is_some() {
                    continue;
                }
                let Some(next) = survey.follow(&from, &found, &survey.place(neighbour)) else {
                    continue;
                };
                let better = pending[neighbour]
                    .is_none_or(|known: Node| next.length_share < known.found.length_share);
                if better {
                    pending[neighbour] = Some(Node { found: next, from: Some(index) });
                    queue.push((Reverse(Share(next.length_share)), neighbour));
                }
            }
        }
        Some(survey)
    }

    fn place(&self, index: usize) -> Point {
        let [nx, ny, _] = self.counts;
        let at = [index % nx, index / nx % ny, index / (nx * ny)];
        let space = &self.region.poses;
        let mut t = [0.5; COORDINATES];
        for k in 0..3 {
            t[k] = at[k] as f64 / (self.counts[k] - 1) as f64;
        }
        space.at(&t)
    }

    fn nearest(&self, point: &Point) -> usize {
        let t = self.region.poses.local(point);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        let at: [usize; 3] = std::array::from_fn(|k| {
            (t[k].clamp(0.0, 1.0) * (self.counts[k] - 1) as f64).round() as usize
        });
        self.index(&at)
    }

    fn index(&self, at: &[usize; 3]) -> usize {
        at[0] + self.counts[0] * (at[1] + self.counts[1] * at[2])
    }

    fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> {
        let [nx, ny, _] = self.counts;
        let at = [index % nx, index / nx % ny, index / (nx * ny)];
        let strides = [1, nx, nx * ny];
        let counts = self.counts;
        (0..3).flat_map(move |k| {
            let lower = (at[k] > 0).then(|| index - strides[k]);
            let upper = (at[k] + 1 < counts[k]).then(|| index + strides[k]);
            lower.into_iter().chain(upper)
        })
    }

    /// A solution near `charts`.
    pub(super) fn found_at(&self, at: &Point, charts: &[f64; CABLES]) -> Option<Found> {
        let balance = self.prover.balance(at)?;
        let (charts, step) = self.prover.settle(&balance, charts, 4 * STEPS)?;
        Some(self.judge(charts, &step))
    }

    fn judge(&self, charts: [f64; CABLES], step: &ChartStep<f64>) -> Found {
        let cables = self.prover.robot().cables();
        let (mut length_share, mut is_within) = (0.0_f64, true);
        for i in 0..CABLES {
            let (limits, state) = (&self.region.limits[i], &step.points[i].state);
            length_share = length_share.max(state.rest_length_m / limits.max_length_m);
            let tension_n = CableState::tension_at_attachment_n(state)
                .max(state.tension_at_anchor_n(cables[i].model.weight_n_m));
            is_within &= tension_n <= limits.max_tension_n;
        }
        is_within &= length_share <= 1.0;
        Found { charts, length_share, is_within, is_positive: step.elimination().is_positive() }
    }

    /// The solution at `to` on the branch of `found` at `from`, along the straight way; `None` where that ends.
    pub(super) fn follow(&self, from: &Point, found: &Found, to: &Point) -> Option<Found> {
        let (mut done, mut part) = (0.0, PARTS);
        let mut last = *found;
        while done < 1.0 {
            let next = (done + part).min(1.0);
            let at = std::array::from_fn(|k| from[k] + (to[k] - from[k]) * next);
            if let Some(found) = self.part(&at, &last) {
                last = found;
                done = next;
                part = (2.0 * part).min(PARTS);
            } else {
                part *= 0.5;
                if part < SHORTEST_PART {
                    return None;
                }
            }
        }
        Some(last)
    }

    /// One part of a way: Newton's method at once contracts, and does not change the sign.
    fn part(&self, at: &Point, last: &Found) -> Option<Found> {
        let balance = self.prover.balance(at)?;
        let first = self.prover.step(&balance, &last.charts)?;
        let second = self.prover.step(&balance, &first.charts)?;
        let moved = |a: &[f64; CABLES], b: &[f64; CABLES], step: &ChartStep<f64>| -> f64 {
            (0..CABLES).map(|i| (a[i] - b[i]).abs() * step.points[i].force_by_chart_n.norm()).sum()
        };
        let far = moved(&first.charts, &last.charts, &first);
        let near = moved(&second.charts, &first.charts, &second);
        let contracts = near <= 0.25 * far + 1e-9; // false for NaN
        if !contracts {
            return None;
        }
        let (charts, step) = self.prover.settle(&balance, &second.charts, STEPS)?;
        let found = self.judge(charts, &step);
        (found.is_positive == last.is_positive).then_some(found)
    }

    /// The solution of the sheet at any pose of the region, by the straight way from the nearest grid point
    /// that has one.
    pub(super) fn solution(&self, at: &Point) -> Option<Found> {
        Some(self.reached(at)?.1)
    }

    /// The poses of the grid by which the sheet was followed from the start to a pose, from that back to the start.
    pub(super) fn way_back(&self, at: &Point) -> impl Iterator<Item = Point> {
        let last = self.reached(at).map(|(index, _)| index);
        let nodes = std::iter::successors(last, |index| self.nodes[*index]?.from);
        let nodes = nodes.map(|index| self.place(index));
        nodes.chain(last.map(|_| self.start))
    }

    /// The grid point from which the sheet is followed to a pose, and the solution there.
    fn reached(&self, at: &Point) -> Option<(usize, Found)> {
        let nearest = self.nearest(at);
        std::iter::once(nearest).chain(self.neighbours(nearest)).find_map(|index| {
            let found = &self.nodes[index].as_ref()?.found;
            Some((index, self.follow(&self.place(index), found, at)?))
        })
    }

    /// Whether the sheet was met in a box, or within a grid step of it.
    pub(super) fn is_near(&self, region: &PoseBox) -> bool {
        let space = &self.region.poses;
        let (low, high) = (space.local(&region.low), space.local(&region.high));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        let range = |k: usize| {
            let last = (self.counts[k] - 1) as f64;
            let from = ((low[k] * last).floor() - 1.0).clamp(0.0, last) as usize;
            let to = ((high[k] * last).ceil() + 1.0).clamp(0.0, last) as usize;
            from..=to
        };
        range(2).any(|z| {
            range(1).any(|y| {
                range(0).any(|x| {
                    self.nodes[self.index(&[x, y, z])].is_some_and(|n| n.found.length_share <= 1.2)
                })
            })
        })
    }
}
