//! Where the sheet ends at a fold within a box of poses: in floats, without proof.

use cdpr_core::CABLES;
use cdpr_core::table::Plane;
use nalgebra::{Matrix2, Vector2, Vector3};

use super::outlook::by_pose;
use super::place::{Point, PoseBox, dot};
use super::proof::Prover;

/// The first part of a way, which is one side of the box where a fold is looked for; and what the last parts exceed, to
/// a fold and to a place beside it.
const FIRST: f64 = 0.25;
const LAST: f64 = 1e-3;
const LAST_BESIDE: f64 = 1.0 / 64.0;
/// Newton steps of a part.
const STEPS: usize = 8;

/// How far back from the end others are looked for beside it, in sides of the box.
const BACK: f64 = 0.35;
/// The largest component of a normal is at least this.
const SMALLEST: i8 = 8;
/// The normal is turned no further than this to fit them.
const MOST_TURN: f64 = 1.0;

/// Where the sheet ends, close to a plane.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    /// Places where it ends, in sides of the box from its lower corner.
    ends: Vec<Point>,
    /// Where it goes on no more, of unit length in sides of the box.
    normal: Point,
}

fn along(from: &Point, way: &Point, far: f64) -> Point {
    std::array::from_fn(|k| from[k] + way[k] * far)
}

impl Edge {
    /// The end that is nearest to the solution `charts` at `at`, if it is near.
    pub(super) fn find(
        prover: &Prover,
        part: &PoseBox,
        at: &Point,
        charts: &[f64; CABLES],
    ) -> Option<Self> {
        let (normal, is_positive) = across(prover, part, at, charts)?;
        let search = Search { prover, part, at, charts, is_positive };
        let both = [normal, normal.map(|n| -n)].map(|way| search.towards(&way));
        let first = both.into_iter().flatten().min_by(|a, b| a.far.total_cmp(&b.far))?;
        // Once more, straight to it; and beside it.
        let end = search.towards(&search.onwards(&first)?)?;
        let normal = search.onwards(&end)?;
        let beside = (0..8).filter_map(|corner| search.beside(&end.at, &normal, corner));
        let ends: Vec<Point> = std::iter::once(end.at).chain(beside).collect();
        let normal = fitted(&ends, &normal);
        Some(Self { ends, normal })
    }

    /// The plane so far before the nearest end, in sides of the box, of those that can be written the one that leaves out
    /// least; `None` where it would not cut it.
    #[allow(clippy::cast_possible_truncation)] // within their limits
    pub(super) fn plane(&self, room: f64) -> Option<Plane> {
        let nearest = |normal: &Point| {
            self.ends.iter().map(|at| dot(normal, at)).fold(f64::INFINITY, f64::min)
        };
        let size = |normal: &Point| dot(normal, normal).sqrt();
        let left_out = |normal: &Point| {
            let sum: f64 = self.ends.iter().map(|at| dot(normal, at)).sum();
            (sum / self.ends.len() as f64 - nearest(normal)) / size(normal)
        };
        let all = self.normals().filter(|normal| size(normal) > 0.0);
        let normal = all.min_by(|a, b| left_out(a).total_cmp(&left_out(b)))?;
        let offset = nearest(&normal) - room * size(&normal);
        let ends = |end: fn(f64, f64) -> f64| normal.iter().map(|n| end(*n, 0.0)).sum::<f64>();
        (offset > ends(f64::min) && offset < ends(f64::max)).then(|| Plane {
            normal: normal.map(|n| n as i8),
            offset: (offset * Plane::PER_UNIT).floor() as i16,
        })
    }

    /// Normals that can be written, about in the direction: its multiples, rounded, and turned by one unit in the
    /// position.
    fn normals(&self) -> impl Iterator<Item = Point> {
        let largest = self.normal.iter().fold(0.0_f64, |most, n| most.max(n.abs()));
        let most = f64::from(Plane::LARGEST);
        let multiples = (SMALLEST..=Plane::LARGEST).map(move |size| f64::from(size) / largest);
        multiples.flat_map(move |unit| {
            let rounded = self.normal.map(|n| (n * unit).round());
            (0..27_u8).map(move |number| {
                let mut normal = rounded;
                for (k, n) in normal.iter_mut().take(3).enumerate() {
                    let digit = number / [1, 3, 9][k] % 3;
                    *n = (*n + f64::from(digit) - 1.0).clamp(-most, most);
                }
                normal
            })
        })
    }
}

/// A place where the sheet ends on a way, how far along that is, and the solution there.
struct End {
    way: Point,
    at: Point,
    far: f64,
    charts: [f64; CABLES],
}

/// The normal of the plane through `ends` that is closest to all of them, near to `normal`: as it is turned in the
/// position.
fn fitted(ends: &[Point], normal: &Point) -> Point {
    let n = Vector3::new(normal[0], normal[1], normal[2]);
    let Some(across) = n.try_normalize(0.1) else { return *normal };
    // Two directions beside it.
    let u = across.cross(&Vector3::ith(across.iamin(), 1.0)).normalize();
    let v = across.cross(&u);
    let beside = |at: &Point| {
        let at = Vector3::new(at[0], at[1], at[2]);
        Vector2::new(at.dot(&u), at.dot(&v))
    };
    let share = 1.0 / ends.len() as f64;
    let middle: Vector2<f64> = ends.iter().map(|at| beside(at) * share).sum();
    let height: f64 = ends.iter().map(|at| dot(normal, at) * share).sum();
    let (mut square, mut product) = (Matrix2::zeros(), Vector2::zeros());
    for at in ends {
        let aside = beside(at) - middle;
        square += aside * aside.transpose();
        product += aside * (dot(normal, at) - height);
    }
    let slope = square.try_inverse().map_or(Vector2::zeros(), |inverse| inverse * product);
    let is_near = slope.norm() <= MOST_TURN; // false for NaN
    if !is_near {
        return *normal;
    }
    let turned = u * slope.x + v * slope.y;
    let mut fit = *normal;
    for k in 0..3 {
        fit[k] -= turned[k];
    }
    let size = dot(&fit, &fit).sqrt();
    fit.map(|n| n / size)
}

/// From a solution.
struct Search<'a> {
    prover: &'a Prover,
    part: &'a PoseBox,
    at: &'a Point,
    charts: &'a [f64; CABLES],
    is_positive: bool,
}

impl Search<'_> {
    /// How far the solution can be followed on a way from the pose, of places in the box by the share of the way, and
    /// what it is there.
    fn followed(&self, place: impl Fn(f64) -> Point, last: f64) -> (f64, [f64; CABLES]) {
        let Self { prover, part, is_positive, .. } = *self;
        let (mut done, mut known, mut step) = (0.0, *self.charts, FIRST);
        // Every part is a power of two, so that they sum up to the whole way.
        while done < 1.0 && step > last {
            match prover.nearby(&part.at(&place(done + step)), &known, is_positive, STEPS) {
                Some(found) => (known, done) = (found, done + step),
                None => step *= 0.5,
            }
        }
        (done, known)
    }

    /// Where the sheet ends this way.
    fn towards(&self, way: &Point) -> Option<End> {
        let from = self.part.local(self.at);
        let (far, charts) = self.followed(|far| along(&from, way, far), LAST);
        (far < 1.0).then(|| End { way: *way, at: along(&from, way, far), far, charts })
    }

    /// The direction in which it ends there.
    fn onwards(&self, end: &End) -> Option<Point> {
        let (normal, _) = across(self.prover, self.part, &self.part.at(&end.at), &end.charts)?;
        let sign = dot(&normal, &end.way).signum();
        Some(normal.map(|n| n * sign))
    }

    /// Where it ends beside a place, nearer to a corner of the box.
    fn beside(&self, at: &Point, normal: &Point, corner: u8) -> Option<Point> {
        let mut aside = *at;
        for k in 0..3 {
            aside[k] = f64::from(corner >> k & 1);
        }
        let before = dot(normal, &aside) - dot(normal, at) + BACK;
        let start = along(&aside, normal, -before).map(|t| t.clamp(0.0, 1.0));
        let from = self.part.local(self.at);
        let there = |done: f64| std::array::from_fn(|k| from[k] + (start[k] - from[k]) * done);
        let (done, charts) = self.followed(there, LAST_BESIDE);
        let search = Search { at: &self.part.at(&start), charts: &charts, ..*self };
        (done >= 1.0).then(|| search.towards(normal))?.map(|end| end.at)
    }
}

/// The direction in which the solution at a pose changes most, in sides of the box, and the sign of its determinant.
/// Close to a fold the direction is across the fold, as what the cables cannot balance there is one wrench.
fn across(
    prover: &Prover,
    part: &PoseBox,
    at: &Point,
    charts: &[f64; CABLES],
) -> Option<(Point, bool)> {
    let step = prover.step(&prover.balance(at)?, charts)?;
    // All rows are close to parallel.
    let row = step.elimination().inverse().row(0).transpose();
    let by_pose = by_pose(prover, at, charts)?;
    let normal: Point = std::array::from_fn(|k| row.dot(&by_pose[k]) * part.extent(k));
    let size = dot(&normal, &normal).sqrt();
    (size > 0.0).then(|| (normal.map(|n| n / size), step.elimination().is_positive()))
}

#[cfg(test)]
mod tests {
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt as _, SeedableRng as _};

    use super::*;

    /// A plane is before all ends by the room, and leaves out less than the rounded normal would.
    #[test]
    fn planes_are_close_before_the_ends() {
        let (mut all, mut rounded) = (0.0, 0.0);
        for seed in 0..300 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut random = || random.random_range(-1.0..1.0);
            let direction = Vector3::new(random(), random(), random()).normalize();
            let middle = Vector3::repeat(0.5);
            let mut normal = [0.0; 6];
            normal[..3].copy_from_slice(direction.as_slice());
            let ends: Vec<Point> = (0..9)
                .map(|_| {
                    let aside = Vector3::new(random(), random(), random()) * 0.5;
                    let at = middle + aside - direction * direction.dot(&aside);
                    [at.x, at.y, at.z, 0.0, 0.0, 0.0]
                })
                .collect();
            let room = 0.01 * (1.0 + random());
            let left_out = |normal: &Point, offset: f64| {
                let size = dot(normal, normal).sqrt();
                let far: Vec<f64> =
                    ends.iter().map(|at| (dot(normal, at) - offset) / size).collect();
                (far.iter().copied().fold(f64::INFINITY, f64::min), far.iter().sum::<f64>() / 9.0)
            };
            let edge = Edge { ends: ends.clone(), normal };
            let plane = edge.plane(room).expect("it goes through the middle");
            let written = plane.normal.map(f64::from);
            let (nearest, mean) = left_out(&written, f64::from(plane.offset) / Plane::PER_UNIT);
            // The offset is rounded down to a sixteenth of a unit, of which the normal has eight at least.
            assert!(nearest >= room - 1e-12 && nearest < room + 1.0 / 128.0, "{seed}: {nearest}");
            let plain = normal.map(|n| (n * f64::from(Plane::LARGEST)).round());
            let least = ends.iter().map(|at| dot(&plain, at)).fold(f64::INFINITY, f64::min);
            all += mean - room;
            rounded += left_out(&plain, least).1;
        }
        assert!(all < 0.75 * rounded, "{all} {rounded}");
    }
}
