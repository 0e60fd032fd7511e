//! Where the sheet ends at a fold within a box of poses: in floats, without proof.

use cdpr_core::CABLES;
use cdpr_core::table::Plane;

use super::outlook::by_pose;
use super::place::{Point, PoseBox, dot};
use super::proof::Prover;

/// How far a fold is looked for from a pose, in sides of the box.
const FAR: f64 = 1.0;
/// Ways to it: the first part, and the last.
const FIRST: f64 = 0.25;
const LAST: f64 = 1e-3;
/// Newton steps of a part.
const STEPS: usize = 8;

/// A plane near to where the sheet ends.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    /// Where it ends, in sides of the box from its lower corner.
    at: Point,
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
        let (first, _) = both.into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1))?;
        // Once more, straight to it.
        Some(search.towards(&first.normal)?.0)
    }

    /// The plane so far before the end, in sides of the box; `None` where it would not cut it.
    #[allow(clippy::cast_possible_truncation)] // within their limits
    pub(super) fn plane(&self, room: f64) -> Option<Plane> {
        let largest = self.normal.iter().fold(0.0_f64, |most, n| most.max(n.abs()));
        let unit = f64::from(Plane::LARGEST) / largest;
        let normal = self.normal.map(|n| (n * unit).round());
        let offset = dot(&normal, &self.at) - room * unit;
        let ends = |end: fn(f64, f64) -> f64| normal.iter().map(|n| end(*n, 0.0)).sum::<f64>();
        (offset > ends(f64::min) && offset < ends(f64::max)).then(|| Plane {
            normal: normal.map(|n| n as i8),
            offset: (offset * Plane::PER_UNIT).floor() as i16,
        })
    }
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
    /// Where the sheet ends this way, and how far that is in sides of the box.
    fn towards(&self, way: &Point) -> Option<(Edge, f64)> {
        let Self { prover, part, at, charts, is_positive } = *self;
        let from = part.local(at);
        let (mut known, mut far, mut step) = (*charts, 0.0, FIRST);
        while step > LAST {
            let next = far + step;
            if next > FAR {
                return None;
            }
            let there = part.at(&along(&from, way, next));
            match prover.nearby(&there, &known, is_positive, STEPS) {
                Some(found) => (known, far) = (found, next),
                None => step *= 0.5,
            }
        }
        let at = along(&from, way, far);
        let (normal, _) = across(prover, part, &part.at(&at), &known)?;
        let sign = dot(&normal, way).signum();
        Some((Edge { at, normal: normal.map(|n| n * sign) }, far))
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
