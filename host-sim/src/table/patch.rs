//! Boxes of poses, and what of them is on one side of a plane.
//!
//! How far the equations change over a box is known from how fast they do with the pose. A plane that is about parallel
//! to a fold cuts off the poses at which they change too far.

use cdpr_core::table::{COORDINATES, Plane};
use num_traits::Zero;

use super::place::{Point, PoseBox, dot};
use crate::interval::Interval;

/// The poses `P` with `normal . P` up to a limit.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    normal: Point,
    most: f64,
}

impl HalfSpace {
    /// What of a box is before a plane.
    pub(super) fn of(region: &PoseBox, plane: Plane) -> Self {
        let normal: Point = std::array::from_fn(|k| f64::from(plane.normal[k]) / region.extent(k));
        let most = dot(&normal, &region.low) + f64::from(plane.offset) / Plane::PER_UNIT;
        Self { normal, most }
    }

    pub(super) fn contains(&self, at: &Point) -> bool {
        dot(&self.normal, at) <= self.most
    }

    /// All poses that a controller may take for one of it, whose coordinates it may take for others by so much.
    pub(super) fn wider(self, room: &Point) -> Self {
        let more = dot(&self.normal.map(f64::abs), room);
        // And what it may round off, in sides of the box as the normal is; and what is rounded here.
        let most = self.most + more + SINGLE;
        Self { most: most + (self.most.abs() + more) * ROUNDING, ..self }
    }

    /// Which half of a box in a coordinate is nearer to the plane: 0 or 1.
    pub(super) fn nearer_half(&self, coordinate: usize) -> usize {
        usize::from(self.normal[coordinate] > 0.0)
    }
}

/// A sum of six products of up to 15 by 1 in f32 is off by no more than this: twelve times half a unit of 90.
const SINGLE: f64 = 1e-4;
/// Many times the rounding of such a sum in f64.
const ROUNDING: f64 = 1e-12;

/// A box of poses, or what of it is in a half-space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    /// The box.
    pub(super) region: PoseBox,
    /// A pose of the box, about in the middle of the patch.
    pub(super) middle: Point,
    /// How far from the middle a coordinate may be.
    aside: [Interval; COORDINATES],
    cut: Option<Cut>,
}

/// Poses `P` with `normal . (P - middle)` in a range.
#[derive(Clone, Copy, Debug)]
struct Cut {
    normal: Point,
    range: Interval,
    /// The product of the normal with itself, in units of the sides of the box.
    square: f64,
}

/// Roundings of sums of a dozen products, in units of the sum of their sizes.
const ROUNDINGS: f64 = 32.0 * f64::EPSILON;

/// `sum factor_k x_k` in intervals.
fn sum(factor: impl Fn(usize) -> Interval, x: impl Fn(usize) -> Interval) -> Interval {
    (0..COORDINATES).fold(Interval::zero(), |sum, k| sum + factor(k) * x(k))
}

impl Patch {
    /// All of a box.
    pub(super) fn whole(region: PoseBox) -> Self {
        Self::around(region, region.middle())
    }

    fn around(region: PoseBox, middle: Point) -> Self {
        let aside = std::array::from_fn(|k| region.side(k) - Interval::point(middle[k]));
        Self { region, middle, aside, cut: None }
    }

    /// A box, or what of it is in a half-space; `None` when that is nothing.
    pub(super) fn of(region: PoseBox, half: Option<&HalfSpace>) -> Option<Self> {
        half.map_or(Some(Self::whole(region)), |half| Self::within(region, half))
    }

    /// What of a box is in a half-space; `None` when that is nothing.
    pub(super) fn within(region: PoseBox, half: &HalfSpace) -> Option<Self> {
        let whole = Self::whole(region);
        let normal = half.normal;
        let all = sum(|k| Interval::point(normal[k]), |k| region.side(k));
        if all.high() <= half.most {
            return Some(whole);
        }
        let range = all.intersection(Interval::new(f64::NEG_INFINITY, half.most))?;
        // The nearest to the middle of the box; where that is outside, on the way to the corner that is furthest before
        // the plane.
        let wanted = range.middle();
        let factor = (wanted - dot(&normal, &whole.middle)) / whole.product(&normal, &normal);
        let near: Point = std::array::from_fn(|k| {
            let step = factor * normal[k] * region.extent(k) * region.extent(k);
            (whole.middle[k] + step).clamp(region.low[k], region.high[k])
        });
        let corner: Point =
            std::array::from_fn(|k| if normal[k] > 0.0 { region.low[k] } else { region.high[k] });
        let (here, least) = (dot(&normal, &near), dot(&normal, &corner));
        let past = here - wanted;
        let share = if past > 0.0 { (past / (here - least)).min(1.0) } else { 0.0 };
        let middle = std::array::from_fn(|k| near[k] + share * (corner[k] - near[k]));
        let here = sum(|k| Interval::point(normal[k]), |k| Interval::point(middle[k]));
        let square = whole.product(&normal, &normal);
        let cut = Some(Cut { normal, range: range - here, square });
        Some(Self { cut, ..Self::around(region, middle) })
    }

    /// The product of two normals in units of the sides of the box.
    fn product(&self, a: &Point, b: &Point) -> f64 {
        let side = |k: usize| self.region.extent(k);
        (0..COORDINATES).map(|k| a[k] * b[k] * side(k) * side(k)).sum()
    }

    /// How far from the middle a coordinate may be.
    pub(super) fn aside(&self, k: usize) -> Interval {
        self.aside[k]
    }

    /// The box of what is aside by no more than a share of that, in the first coordinates; in the others all of it.
    pub(super) fn part(&self, count: usize, share: Interval) -> PoseBox {
        let mut part = self.region;
        for k in 0..count {
            let side = Interval::point(self.middle[k]) + self.aside[k] * share;
            (part.low[k], part.high[k]) = (side.low(), side.high());
        }
        part
    }

    /// The range of `sum g_k (P_k - middle_k)` over the patch, of the first coordinates, for every gradient `g` no further
    /// than `radius` from `middle`.
    pub(super) fn spread(&self, middle: &[f64], radius: &[f64]) -> Interval {
        let whole = self.range(middle, radius, 0.0);
        let Some(Cut { normal, square, .. }) = &self.cut else { return whole };
        let mut across = [0.0; COORDINATES];
        across[..middle.len()].copy_from_slice(middle);
        let factor = self.product(&across, normal) / square;
        if !factor.is_finite() {
            return whole;
        }
        self.range(middle, radius, factor).intersection(whole).unwrap_or(whole)
    }

    /// That range, of so many times the normal by what the cut tells of it, and of the rest; right for any factor.
    ///
    /// In floats, with all roundings added at the end.
    fn range(&self, middle: &[f64], radius: &[f64], factor: f64) -> Interval {
        let cut = self.cut.as_ref().filter(|_| factor != 0.0);
        let (mut low, mut high, mut room, mut size) = (0.0, 0.0, 0.0, 0.0);
        // What is not given of the gradient is zero; not so the rest of the normal there.
        let count = cut.map_or(middle.len(), |_| COORDINATES);
        for (k, aside) in self.aside.iter().take(count).enumerate() {
            let given = |of: &[f64]| of.get(k).copied().unwrap_or(0.0);
            let (middle, known) = (given(middle), cut.map_or(0.0, |cut| factor * cut.normal[k]));
            let ends = [aside.low(), aside.high()].map(|end| (middle - known) * end);
            let most = aside.magnitude();
            low += ends[0].min(ends[1]);
            high += ends[0].max(ends[1]);
            room += given(radius) * most;
            size += (middle.abs() + known.abs()) * most;
        }
        if let Some(Cut { range, .. }) = cut {
            let ends = [range.low(), range.high()].map(|end| factor * end);
            low += ends[0].min(ends[1]);
            high += ends[0].max(ends[1]);
            size += factor.abs() * range.magnitude();
        }
        room += (room + size) * ROUNDINGS;
        Interval::new(low - room, high + room)
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

    /// Whatever is before a plane is in what its patch says, as the reader of a table has it.
    #[test]
    fn patches_hold_what_is_before_a_plane() {
        let (mut empty, mut narrower, mut whole_box) = (0, 0, 0);
        for seed in 0..2000 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let low = point(&mut random);
            let high = low.map(|low| low + random.random_range(1e-3..1.0));
            let region = PoseBox { low, high };
            let plane = Plane {
                normal: std::array::from_fn(|_| {
                    random.random_range(-Plane::LARGEST..=Plane::LARGEST)
                }),
                offset: random.random_range(-700..700),
            };
            let half = HalfSpace::of(&region, plane).wider(&region.low.map(|_| 1e-7));
            let patch = Patch::within(region, &half);
            let (gradient, room) = (point(&mut random), [0.01; COORDINATES]);
            let all = Patch::whole(region).spread(&gradient, &room);
            whole_box += usize::from(patch.is_some_and(|patch| patch.cut.is_none()));
            let mut is_empty = true;
            for _ in 0..100 {
                let place: Point = std::array::from_fn(|_| random.random());
                #[allow(clippy::cast_possible_truncation)] // as a controller has it
                if plane.is_beyond(&place.map(|t| t as f32)) {
                    continue;
                }
                is_empty = false;
                let pose = region.at(&place);
                assert!(half.contains(&pose), "{seed}");
                let patch = patch.expect("a pose is in it");
                // Of the positions only, as where turns are hardly any, and of all; anyhow, and across the plane.
                for middle in [gradient, half.normal] {
                    let room = middle.map(|g| 0.01 * g.abs());
                    for count in [3, COORDINATES] {
                        let part = 0.01 * random.random_range(-1.0..1.0);
                        let moved: f64 = (0..count)
                            .map(|k| middle[k] * (1.0 + part) * (pose[k] - patch.middle[k]))
                            .sum();
                        let spread = patch.spread(&middle[..count], &room[..count]);
                        assert!(spread.contains(moved), "{seed}: {moved} not in {spread:?}");
                    }
                }
                let moved: f64 = (0..COORDINATES)
                    .map(|k| {
                        let g = gradient[k] + random.random_range(-0.01..0.01);
                        g * (pose[k] - patch.middle[k])
                    })
                    .sum();
                let spread = patch.spread(&gradient, &room);
                assert!(spread.contains(moved), "{seed}: {moved} not in {spread:?}");
                narrower += usize::from(spread.radius() < 0.9 * all.radius());
            }
            if let Some(patch) = &patch {
                assert!(region.contains(&patch.middle), "{seed}");
                assert!(half.contains(&patch.middle), "{seed}");
            } else {
                assert!(is_empty, "{seed}");
                empty += 1;
            }
        }
        assert!(empty > 0 && narrower > 0 && whole_box > 0, "{empty} {narrower} {whole_box}");
    }
}
