//! Parts of a box of poses between parallel planes.
//!
//! How far a force moves over a box is known from how fast it changes with the pose. Where a force may not move far, a
//! box is cut by planes across the direction in which it does: two such directions are enough for two forces, in how
//! many coordinates ever a pose varies.

use cdpr_core::table::COORDINATES;
use num_traits::Zero;

use super::place::{Point, PoseBox};
use crate::interval::Interval;

/// Planes closer to parallel than this are taken for parallel.
const PARALLEL: f64 = 1e-6;
/// Sums of both normals with these weights (relative to their extents) show that a part is empty.
const WEIGHTS: [f64; 6] = [-2.0, -1.0, -0.5, 0.5, 1.0, 2.0];

/// The poses of a box that are between planes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    /// A pose of the box, about in the middle of the patch.
    pub(super) middle: Point,
    cuts: Option<[Cut; 2]>,
}

/// Poses `P` with `normal . P` in a range.
#[derive(Clone, Copy, Debug)]
struct Cut {
    normal: Point,
    range: Interval,
}

/// `sum factor_k x_k` in intervals.
fn sum(factor: impl Fn(usize) -> Interval, x: impl Fn(usize) -> Interval) -> Interval {
    (0..COORDINATES).fold(Interval::zero(), |sum, k| sum + factor(k) * x(k))
}

/// The range of `normal . P` over a box.
fn over(region: &PoseBox, normal: impl Fn(usize) -> f64) -> Interval {
    sum(|k| Interval::point(normal(k)), |k| region.side(k))
}

/// The product of two normals in units of the sides of a box.
fn product(region: &PoseBox, a: impl Fn(usize) -> f64, b: impl Fn(usize) -> f64) -> f64 {
    (0..COORDINATES).map(|k| a(k) * b(k) * region.extent(k) * region.extent(k)).sum()
}

/// The factors of two normals in `right`, given by its products with them.
fn factors(region: &PoseBox, [one, two]: &[Cut; 2], right: [f64; 2]) -> [f64; 2] {
    let (n, m) = (|k: usize| one.normal[k], |k: usize| two.normal[k]);
    let (nn, nm, mm) = (product(region, n, n), product(region, n, m), product(region, m, m));
    let determinant = nn * mm - nm * nm;
    if determinant > PARALLEL * nn * mm {
        let [a, b] = right;
        [(a * mm - b * nm) / determinant, (b * nn - a * nm) / determinant]
    } else {
        [0.0; 2]
    }
}

impl Patch {
    /// All of a box.
    pub(super) fn whole(region: &PoseBox) -> Self {
        Self { middle: region.middle(), cuts: None }
    }

    /// The range of `sum gradient_k (P_k - middle_k)` over the patch.
    pub(super) fn spread(&self, region: &PoseBox, gradient: &[Interval; COORDINATES]) -> Interval {
        let aside = |k: usize| region.side(k) - Interval::point(self.middle[k]);
        let whole = sum(|k| gradient[k], aside);
        let Some(cuts) = &self.cuts else { return whole };
        // What the cuts tell of it, and the rest; right for any factors.
        let with = |cut: &Cut| product(region, |k| gradient[k].middle(), |k| cut.normal[k]);
        let factors = factors(region, cuts, cuts.each_ref().map(with)).map(Interval::point);
        let mut rest = *gradient;
        let mut known = Interval::zero();
        for (cut, factor) in cuts.iter().zip(factors) {
            let normal = cut.normal.map(Interval::point);
            known += factor * (cut.range - sum(|k| normal[k], |k| Interval::point(self.middle[k])));
            for k in 0..COORDINATES {
                rest[k] -= factor * normal[k];
            }
        }
        (known + sum(|k| rest[k], aside)).intersection(whole).unwrap_or(whole)
    }

    /// Whether it is certain that no pose is in it.
    pub(super) fn is_empty(&self, region: &PoseBox) -> bool {
        let Some([one, two]) = &self.cuts else { return false };
        let (n, m) = (|k: usize| one.normal[k], |k: usize| two.normal[k]);
        let ranges = (over(region, n), over(region, m));
        let misses = |all: Interval, cut: Interval| all.intersection(cut).is_none();
        let unit = ranges.0.radius() / ranges.1.radius();
        misses(ranges.0, one.range)
            || misses(ranges.1, two.range)
            || WEIGHTS.iter().any(|weight| {
                let weight = Interval::point(weight * unit);
                let both = |k: usize| Interval::point(n(k)) + weight * Interval::point(m(k));
                misses(sum(both, |k| region.side(k)), one.range + weight * two.range)
            })
    }

    /// Both halves, cut across the first normal or the second, whichever has the longer range in the unit given for
    /// it. The normals count where nothing is cut yet.
    pub(super) fn halves(
        &self,
        region: &PoseBox,
        normals: [Point; 2],
        units: [f64; 2],
    ) -> [Self; 2] {
        let cuts = self.cuts.unwrap_or_else(|| {
            normals.map(|normal| Cut { normal, range: over(region, |k| normal[k]) })
        });
        let long = |which: usize| cuts[which].range.radius() * units[which];
        let which = usize::from(long(1) > long(0));
        let range = cuts[which].range;
        [(range.low(), range.middle()), (range.middle(), range.high())].map(|(low, high)| {
            let mut cuts = cuts;
            cuts[which].range = Interval::new(low, high);
            let mut middle = region.middle();
            let off = |cut: &Cut| {
                let here: f64 = (0..COORDINATES).map(|k| cut.normal[k] * middle[k]).sum();
                cut.range.middle() - here
            };
            // The nearest to the middle of the box.
            let factors = factors(region, &cuts, cuts.each_ref().map(off));
            for k in 0..COORDINATES {
                let step: f64 = (0..2).map(|c| factors[c] * cuts[c].normal[k]).sum();
                let step = step * region.extent(k) * region.extent(k);
                middle[k] = (middle[k] + step).clamp(region.low[k], region.high[k]);
            }
            Self { middle, cuts: Some(cuts) }
        })
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::ChaCha8Rng;
    use rand::{Rng, RngExt as _, SeedableRng as _};

    use super::*;

    fn point(random: &mut impl Rng) -> Point {
        std::array::from_fn(|_| random.random_range(-1.0..1.0))
    }

    /// Cut four times over; whatever is in a patch is in what it says, and the patches leave nothing out.
    #[test]
    fn patches_hold_all_of_a_box_and_bound_what_is_in_them() {
        let (mut empty, mut narrower) = (0, 0);
        for seed in 0..200 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let low = point(&mut random);
            let high = low.map(|low| low + random.random_range(1e-3..1.0));
            let region = PoseBox { low, high };
            let mut normals = [point(&mut random), point(&mut random)];
            if seed % 10 == 0 {
                normals[1] = normals[0].map(|n| -2.0 * n); // parallel
            }
            let mut patches = vec![Patch::whole(&region)];
            for _ in 0..4 {
                let units = [random.random_range(0.1..10.0), 1.0];
                let halves = |patch: &Patch| patch.halves(&region, normals, units);
                patches = patches.iter().flat_map(halves).collect();
            }
            let gradient = point(&mut random).map(|g| Interval::around(g, 0.01));
            let whole = Patch::whole(&region).spread(&region, &gradient);
            let mut held = vec![false; patches.len()];
            for _ in 0..200 {
                let pose = region.at(&std::array::from_fn(|_| random.random()));
                let dot = |a: &Point| (0..COORDINATES).map(|k| a[k] * pose[k]).sum::<f64>();
                let mut is_held = false;
                for (patch, held) in patches.iter().zip(&mut held) {
                    let cuts = patch.cuts.expect("cut");
                    if !cuts.iter().all(|cut| cut.range.contains(dot(&cut.normal))) {
                        continue;
                    }
                    (is_held, *held) = (true, true);
                    let moved: f64 = (0..COORDINATES)
                        .map(|k| {
                            let g = gradient[k].middle() + random.random_range(-0.01..0.01);
                            g * (pose[k] - patch.middle[k])
                        })
                        .sum();
                    let spread = patch.spread(&region, &gradient);
                    assert!(spread.contains(moved), "{seed}: {moved} not in {spread:?}");
                    narrower += usize::from(spread.radius() < 0.9 * whole.radius());
                }
                assert!(is_held, "{seed}: in no patch");
            }
            for (patch, held) in patches.iter().zip(held) {
                assert!(region.contains(&patch.middle));
                assert!(!(held && patch.is_empty(&region)), "{seed}");
                empty += usize::from(patch.is_empty(&region));
            }
        }
        assert!(empty > 0 && narrower > 0, "{empty} {narrower}");
    }
}
