//! The equations of a step over a patch, with one cable eliminated: what the others can make of them, and where the
//! eliminated one is then. See [`proof`](super::proof).

use std::ops::Range;

use cdpr_core::CABLES;
use cdpr_core::table::COORDINATES;
use nalgebra::{Matrix6, Vector6};
use num_traits::Zero;

use super::patch::Patch;
use super::place::{Along, ByPose};
use super::sums::{Course, Inverse, Piece, Sum, Swept, UPWARDS};
use crate::interval::Interval;

/// Times that the errors of a step are fed back through `A M - I`.
const FEEDBACK: usize = 6;
/// And what is added to each for it.
const SHARE: f64 = 0.01;

/// What the controller rounds off in each row of a step, at most: for the five others and their sum, by newton of the
/// force of the eliminated cable, and by newton that the search along its curve leaves out. None for what is exact.
#[derive(Default)]
pub(super) struct Arithmetic {
    pub(super) others: Vector6<f64>,
    pub(super) unit: Vector6<f64>,
    pub(super) per_newton: Vector6<f64>,
}

impl Arithmetic {
    /// All of it, with the eliminated cable where the equations sum to this.
    pub(super) fn on(&self, sum: &Sum) -> Vector6<f64> {
        self.others + self.unit * sum.force_n + self.per_newton * sum.left_n
    }
}

/// What a step obeys, from anywhere in a box of coordinates.
pub(super) struct Equations<'a> {
    columns: &'a Columns<'a>,
    course: &'a Course<'a>,
    fold_at_slack_end: bool,
    /// What the right sides are off by, as it is and in each row at most, and what is rounded. None of chords.
    missed: Option<Aside<'a>>,
    missed_most: Vector6<f64>,
    arithmetic: Arithmetic,
    /// What the five others weigh at most in row `e`.
    weights: Option<Vector6<f64>>,
}

impl<'a> Equations<'a> {
    pub(super) fn new(
        columns: &'a Columns,
        course: &'a Course<'a>,
        fold_at_slack_end: bool,
        missed: Option<Aside<'a>>,
        arithmetic: Arithmetic,
    ) -> Self {
        let plain = columns.defect(&Vector6::zeros());
        let row = plain.row(columns.cable).transpose();
        let mut back = plain.transpose();
        back.fill_column(columns.cable, 0.0);
        let weights = fed_back(&back, &row);
        let missed_most = missed.as_ref().map_or(Vector6::zeros(), |missed| {
            missed.swept(columns.cable, &Vector6::zeros()).map(Interval::magnitude)
        });
        Self { columns, course, fold_at_slack_end, missed, missed_most, arithmetic, weights }
    }

    fn cable(&self) -> usize {
        self.columns.cable
    }

    fn others(&self, v: impl Fn(usize) -> f64) -> Vector6<f64> {
        Vector6::from_fn(|i, _| if i == self.cable() { 0.0 } else { v(i) })
    }

    /// What tangents miss, swept.
    fn missed(&self, ratio: &Vector6<f64>) -> Vector6<Interval> {
        let missed = self.missed.as_ref();
        missed.map_or(Vector6::zeros(), |missed| missed.swept(self.cable(), ratio))
    }

    /// What is rounded where they sum to this, swept.
    fn rounded(&self, sum: &Sum, ratio: &Vector6<f64>) -> Vector6<f64> {
        let rounding = self.arithmetic.on(sum);
        rounding + ratio.abs() * rounding[self.cable()]
    }

    /// What the five others feed back into each row as they move, by a sum and by what is apart from it. How the sum moves
    /// with the pose is known, and how the matrix turns with it: only what remains of the sum is fed back by its size.
    fn fed(&self, swept: &Swept, apart: &Vector6<f64>) -> Option<Vector6<f64>> {
        let matrix = self.columns.defect(&swept.ratio);
        let mut back = matrix;
        back.fill_row(self.cable(), 0.0);
        let moved = |right: Vector6<f64>| fed_back(&back, &self.others(|i| right[i]));
        let turned = self.columns.turned(swept);
        let still = swept.still.map(Interval::magnitude);
        let fed = moved(apart + still + turned).map(|y| turned + matrix * y);
        if self.course.patch.is_whole() {
            return fed;
        }
        // Before a plane they move less than that.
        let plain = moved(apart + swept.all.map(Interval::magnitude)).map(|y| matrix * y);
        match (fed, plain) {
            (Some(a), Some(b)) => Some(a.inf(&b)),
            (a, b) => a.or(b),
        }
    }

    /// A sum of row `e`, with what the others weigh in it at most, whatever the piece.
    fn open(&self, sum: Interval, own: f64, right: impl Fn(usize) -> f64) -> Interval {
        let others = self.others(right);
        let room = self.weights.map_or(f64::INFINITY, |weights| weights.dot(&others));
        sum + Interval::symmetric((room + own) * UPWARDS)
    }

    /// The left side of the one equation on a piece, as far as its sign matters. Mostly it is enough to know what the
    /// others weigh; where it is not, what is fed back on the piece is swept.
    fn value(&self, sum: &Sum) -> Interval {
        let cable = self.cable();
        let own = sum.rows[cable];
        if own.mignitude() == 0.0 {
            return own;
        }
        let apart = self.missed_most + self.arithmetic.on(sum);
        let rough = self.open(own, apart[cable], |i| apart[i] + sum.rows[i].magnitude());
        if rough.mignitude() > 0.0 {
            return rough;
        }
        let cleared = self.course.cleared(sum);
        let missed = self.missed(&cleared.ratio).map(Interval::magnitude);
        let room = self.fed(cleared, &(missed + self.rounded(sum, &cleared.ratio)));
        let room = room.map_or(f64::INFINITY, |fed| fed[cable]) + apart[cable];
        own + Interval::symmetric(room * UPWARDS)
    }

    /// And its slope, as far as its sign matters.
    fn slope(&self, piece: &Piece) -> Interval {
        let cable = self.cable();
        let slope = piece.slope[cable];
        if slope.mignitude() == 0.0 {
            return slope;
        }
        let apart = self.arithmetic.unit * piece.tangent;
        let own = apart[cable];
        let rough = self.open(slope, own, |i| apart[i] + piece.slope[i].magnitude());
        if rough.mignitude() > 0.0 {
            return rough;
        }
        let swept = self.course.swept_slope(piece);
        let apart = apart + swept.ratio.abs() * own;
        let room = self.fed(swept, &apart).map_or(f64::INFINITY, |fed| fed[cable]);
        slope + Interval::symmetric((room + own) * UPWARDS)
    }

    /// The left side at the lower end of a fine piece, or the upper one of the last.
    fn joint(&self, number: usize) -> Option<Interval> {
        let Course { joints, first_fine, .. } = self.course;
        joints.get(number.checked_sub(*first_fine)?).map(|joint| self.value(joint))
    }

    /// The pieces around the center on which it may be zero: it rises on them, through zero.
    pub(super) fn pieces(&self) -> Option<Range<usize>> {
        let Course { pieces, middle, .. } = self.course;
        let rises = |number: usize| pieces.get(number).is_some_and(|p| self.slope(p).low() > 0.0);
        let mut last = *middle;
        loop {
            let end = rises(last).then(|| self.joint(last + 1)).flatten()?;
            if end.low() > 0.0 {
                break;
            }
            last += 1;
        }
        let mut first = middle.checked_sub(1)?;
        loop {
            let end = rises(first).then(|| self.joint(first)).flatten()?;
            if end.high() < 0.0 {
                break;
            }
            first = first.checked_sub(1)?;
        }
        Some(first..last + 1)
    }

    /// Whether it rises on all of these pieces.
    pub(super) fn rise_on(&self, pieces: &Range<usize>) -> bool {
        self.course.pieces[pieces.clone()].iter().all(|piece| self.slope(piece).low() > 0.0)
    }

    /// Whether the search goes to these pieces from anywhere else in the bracket. Beyond them the sign stays where it
    /// rises; and towards a fold it is enough that it has the sign, or falls.
    pub(super) fn leads_to(&self, pieces: &Range<usize>) -> bool {
        let all = &self.course.pieces;
        let goes = |piece: &Piece, way: f64, has_sign: &mut bool| {
            let slope = self.slope(piece);
            if (way > 0.0) != self.fold_at_slack_end {
                return slope.low() > 0.0;
            }
            let value = self.value(&piece.sum);
            let is_certain = if way > 0.0 { value.low() > 0.0 } else { value.high() < 0.0 };
            *has_sign = is_certain || *has_sign && slope.low() > 0.0;
            *has_sign || slope.high() < 0.0
        };
        let (mut below, mut above) = (true, true);
        all[..pieces.start].iter().rev().all(|piece| goes(piece, -1.0, &mut below))
            && all[pieces.end..].iter().all(|piece| goes(piece, 1.0, &mut above))
    }

    /// How far the others move, N, with the eliminated cable on one of the pieces.
    pub(super) fn moved(&self, pieces: &Range<usize>) -> Option<Vector6<Interval>> {
        let cable = self.cable();
        let mut all: Option<Vector6<Interval>> = None;
        for piece in &self.course.pieces[pieces.clone()] {
            let swept = self.course.swept(piece);
            let missed = self.missed(&swept.ratio);
            let rounded = self.rounded(&piece.sum, &swept.ratio);
            let fed = self.fed(swept, &(missed.map(Interval::magnitude) + rounded))?;
            let here = Vector6::from_fn(|i, _| {
                if i == cable {
                    return Interval::zero();
                }
                missed[i] - swept.all[i] + Interval::symmetric((fed[i] + rounded[i]) * UPWARDS)
            });
            all = Some(all.map_or(here, |all| all.zip_map(&here, Interval::hull)));
        }
        all
    }
}

/// What 1 N across the tangent of each cable makes in the rows, by middle and radius.
pub(super) struct Across {
    pub(super) middle: Matrix6<f64>,
    pub(super) radius: Matrix6<f64>,
}

/// What tangents miss of curves across them, N.
pub(super) struct Aside<'a> {
    pub(super) across: &'a Across,
    pub(super) by_cable_n: [Interval; CABLES],
}

impl Aside<'_> {
    /// In the rows, with row `e` times factors taken from the others.
    pub(super) fn swept(&self, cable: usize, ratio: &Vector6<f64>) -> Vector6<Interval> {
        // Sums of six products of a difference are off by fewer units than these of the sum of their sizes.
        const ROUNDING: f64 = 16.0 * f64::EPSILON;
        let of = |part: fn(Interval) -> f64| Vector6::from_fn(|i, _| part(self.by_cable_n[i]));
        let Across { middle, radius } = self.across;
        let taken = ratio * middle.row(cable);
        let swept = middle - taken;
        let open = radius + ratio.abs() * radius.row(cable);
        let open = open + (middle.abs() + taken.abs()) * ROUNDING;
        let room = swept.abs() * of(Interval::radius) + open * of(Interval::magnitude);
        (swept * of(Interval::middle)).zip_map(&(room * UPWARDS), Interval::around)
    }
}

/// `A M - 1` over a patch, for the tangents of five cables; column `e` is zero.
pub(super) struct Columns<'a> {
    inverse: &'a Inverse,
    cable: usize,
    along: Along,
    /// At the middle of the patch, with the middles of the tangents.
    defect: Matrix6<f64>,
    /// How far the slants turn it at most.
    slanted: Matrix6<f64>,
    /// How far each coordinate of the pose turns it at most, by middle.
    turned: [Matrix6<f64>; COORDINATES],
    /// The radii of that, and all roundings, of what is made of a row and as much again of row `e`, too.
    blur: Matrix6<f64>,
}

impl<'a> Columns<'a> {
    /// None, until they are set, of a start that eliminates a cable.
    pub(super) fn new(inverse: &'a Inverse, cable: usize, along: Along) -> Self {
        let zero = Matrix6::zeros();
        let turned = [zero; COORDINATES];
        Self { inverse, cable, along, defect: zero, slanted: zero, turned, blur: zero }
    }

    /// Sets a column at the middle of the patch: a tangent, and by how much more of the direction across it may slant.
    pub(super) fn set(
        &mut self,
        cable: usize,
        wrench_n: &Vector6<Interval>,
        (across, slant): (&Across, f64),
    ) {
        let inverse = self.inverse;
        let middle = wrench_n.map(Interval::middle);
        let mut defect = inverse.matrix * middle;
        defect[cable] -= 1.0;
        self.defect.set_column(cable, &defect);
        self.slanted.set_column(cable, &(across.middle.column(cable) * slant));
        // Ten roundings of a sum of six products that is about 1 or 0, and of the matrix.
        let rounding = inverse.sizes * middle.abs() * (16.0 * f64::EPSILON);
        let open = inverse.sizes * wrench_n.map(Interval::radius);
        let blur = rounding + open + across.radius.column(cable) * slant;
        self.blur.set_column(cable, &blur);
    }

    /// Adds what a controller rounds in a column.
    pub(super) fn round(&mut self, cable: usize, rounding: &Vector6<f64>) {
        let mut blur = self.blur.column_mut(cable);
        blur += rounding;
    }

    /// Sets how it changes with each coordinate.
    pub(super) fn turn(&mut self, cable: usize, by_pose: &ByPose, patch: &Patch) {
        let rows = self.inverse.rows(by_pose, self.along);
        let mut blur = self.blur.column_mut(cable);
        for k in 0..self.along.count() {
            let aside = patch.aside(k).magnitude();
            let turned = rows.middle[k] * aside;
            blur += rows.radius[k] * aside + turned.abs() * (4.0 * f64::EPSILON);
            self.turned[k].set_column(cable, &turned);
        }
    }

    /// Bound of `|A M - I|`, column `e` zero, after row `e` times the factors was taken from the others.
    pub(super) fn defect(&self, ratio: &Vector6<f64>) -> Matrix6<f64> {
        let mut bound = self.still(ratio);
        for turned in self.turned.iter().take(self.along.count()) {
            bound += (turned - ratio * turned.row(self.cable)).abs();
        }
        bound * UPWARDS
    }

    /// What of it does not turn with the pose.
    fn still(&self, ratio: &Vector6<f64>) -> Matrix6<f64> {
        let swept = |matrix: &Matrix6<f64>| (matrix - ratio * matrix.row(self.cable)).abs();
        let blur = self.blur + ratio.abs() * self.blur.row(self.cable);
        swept(&self.defect) + swept(&self.slanted) + blur
    }

    /// A bound on what it makes of what moves with the pose, in which both are known to do so together.
    fn turned(&self, swept: &Swept) -> Vector6<f64> {
        let Swept { ratio, moved, .. } = swept;
        let count = self.along.count();
        let others = moved.map(|mut moved| {
            moved[self.cable] = 0.0;
            moved
        });
        let size = |v: Vector6<f64>| (v - ratio * v[self.cable]).abs();
        let reach = others.iter().take(count).fold(Vector6::zeros(), |sum, next| sum + next.abs());
        let mut bound = self.still(ratio) * reach;
        for k in 0..count {
            bound += size(self.turned[k] * others[k]);
            for l in 0..k {
                bound += size(self.turned[k] * others[l] + self.turned[l] * others[k]);
            }
        }
        // Roundings of the products are below the 16 units of the blur that are in it.
        bound * UPWARDS
    }
}

/// A bound on all `e >= 0` with `e <= right + defect e`; `None` when that does not bound them.
pub(super) fn fed_back(defect: &Matrix6<f64>, right: &Vector6<f64>) -> Option<Vector6<f64>> {
    let mut weights = *right;
    for _ in 0..FEEDBACK {
        weights = right + defect * weights;
    }
    // A little more, so that what comes from others only has something of its own as well.
    let right = right + weights * SHARE + Vector6::repeat(f64::MIN_POSITIVE);
    for _ in 0..FEEDBACK {
        weights = right + defect * weights;
    }
    let fed = defect * weights;
    // e <= weights max(right/(weights - defect weights)), where the difference is positive
    let mut factor = 0.0_f64;
    for i in 0..CABLES {
        let kept = weights[i] - fed[i] * UPWARDS;
        let is_kept = kept > 0.0 && kept.is_finite();
        if !is_kept {
            return None;
        }
        factor = factor.max(right[i] / kept);
    }
    let bound = weights * (factor * UPWARDS);
    Some((right + defect * bound) * UPWARDS)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector6};
    use rand::rngs::ChaCha8Rng;
    use rand::{Rng, RngExt as _, SeedableRng as _};

    use super::super::place::Along;
    use super::*;

    fn number(random: &mut impl Rng) -> f64 {
        random.random_range(-1.0..1.0)
    }

    fn vector(random: &mut impl Rng) -> Vector6<f64> {
        Vector6::from_fn(|_, _| number(random))
    }

    /// Factors of all rows but that of a cable.
    fn factors(cable: usize, random: &mut impl Rng) -> Vector6<f64> {
        let mut ratio = vector(random) * 4.0;
        ratio[cable] = 0.0;
        ratio
    }

    /// For any pose and any slants, what the matrix makes of what moves with the pose is within its bound, which is far
    /// less than if both were taken for independent; and it is within the bound on the matrix alone.
    #[test]
    fn what_turns_and_moves_with_the_pose_is_bounded_together() {
        let (mut together, mut apart) = (0.0, 0.0);
        for seed in 0..200 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let cable = random.random_range(0..CABLES);
            let inverse = Inverse {
                matrix: Matrix6::identity(),
                sizes: Matrix6::identity(),
                per_newton: Vector6::repeat(1.0),
            };
            let along = Along::PositionAndTurn { moment_arm_m: 1.0 };
            let mut columns = Columns::new(&inverse, cable, along);
            let random_matrix = |size: f64, random: &mut ChaCha8Rng| {
                let mut matrix = Matrix6::from_fn(|_, _| size * number(random));
                matrix.fill_column(cable, 0.0);
                matrix
            };
            columns.defect = random_matrix(0.01, &mut random);
            columns.slanted = random_matrix(0.02, &mut random);
            columns.turned = std::array::from_fn(|_| random_matrix(0.1, &mut random));
            columns.blur = random_matrix(0.01, &mut random).abs();
            let swept = Swept {
                ratio: factors(cable, &mut random),
                all: Vector6::zeros(),
                moved: std::array::from_fn(|_| vector(&mut random)),
                still: Vector6::zeros(),
            };
            let bound = columns.turned(&swept);
            let defect = columns.defect(&swept.ratio);
            for _ in 0..100 {
                let pose = vector(&mut random);
                let slants = Matrix6::from_diagonal(&vector(&mut random));
                let blur = columns.blur.map(|blur| blur * number(&mut random));
                let mut matrix = columns.defect + columns.slanted * slants + blur;
                let mut moved = Vector6::zeros();
                for k in 0..COORDINATES {
                    matrix += columns.turned[k] * pose[k];
                    moved += swept.moved[k] * pose[k];
                }
                moved[cable] = 0.0;
                let matrix = matrix - swept.ratio * matrix.row(cable);
                let made = matrix * moved;
                for i in 0..CABLES {
                    assert!(made[i].abs() <= bound[i], "{seed}: {} of {}", made[i], bound[i]);
                    for j in 0..CABLES {
                        assert!(matrix[(i, j)].abs() <= defect[(i, j)], "{seed}");
                    }
                }
            }
            let mut reach = swept.moved.iter().fold(Vector6::zeros(), |sum, v| sum + v.abs());
            reach[cable] = 0.0;
            together += bound.sum();
            apart += (defect * reach).sum();
        }
        assert!(together < 0.6 * apart, "{together} of {apart}");
    }

    /// Whatever is missed by each cable is in the rows that are said of all.
    #[test]
    fn what_is_missed_aside_is_in_its_rows() {
        for seed in 0..200 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let cable = random.random_range(0..CABLES);
            let across = Across {
                middle: Matrix6::from_fn(|_, _| number(&mut random)),
                radius: Matrix6::from_fn(|_, _| 0.01 * number(&mut random).abs()),
            };
            let by_cable_n = std::array::from_fn(|_| {
                let (a, b) = (number(&mut random), number(&mut random));
                Interval::new(a.min(b), a.max(b))
            });
            let ratio = factors(cable, &mut random);
            let rows = Aside { across: &across, by_cable_n }.swept(cable, &ratio);
            for _ in 0..100 {
                let columns =
                    across.middle + across.radius.map(|radius| radius * number(&mut random));
                let missed_n = Vector6::from_fn(|i, _| {
                    random.random_range(by_cable_n[i].low()..=by_cable_n[i].high())
                });
                let all = columns * missed_n;
                let swept = all - ratio * all[cable];
                assert!((0..CABLES).all(|i| rows[i].contains(swept[i])), "{seed}");
            }
        }
    }
}
