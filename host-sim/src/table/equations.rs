//! The equations of a step over a patch, with one cable eliminated: what the others can make of them, and where the
//! eliminated one is then. See [`proof`](super::proof).

use std::ops::Range;

use cdpr_core::CABLES;
use cdpr_core::table::COORDINATES;
use nalgebra::{Matrix6, Vector6};
use num_traits::Zero;

use super::affine::Affine;
use super::patch::Patch;
use super::place::{Along, ByPose};
use super::sums::{Course, Inverse, Piece, Sum, UPWARDS};
use crate::interval::Interval;

/// Times that rows are fed back through a matrix like `A M - 1`.
const FEEDBACK: usize = 6;
/// And what is added to each for it.
const SHARE: f64 = 0.01;
/// Many times the rounding of products with the matrices here, as a part of the sum of their sizes.
const ROUNDINGS: f64 = 256.0 * f64::EPSILON;
/// A determinant that is larger has a sign for certain.
const LEAST_DETERMINANT: f64 = 1e-6;

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
    /// What the right sides are off by, as tangents miss it, and how much that is at most; and what is rounded.
    missed: Vector6<Interval>,
    missed_most: Vector6<f64>,
    arithmetic: Arithmetic,
    /// What the five others weigh at most in row `e`.
    weights: Option<Vector6<f64>>,
    /// How they follow; `None` where that is not bounded.
    others: Option<Others>,
}

/// How steeply row `e` rises on a piece as the others follow, by newton of the eliminated cable at least, and how far each
/// follows at most.
struct Rise {
    least: f64,
    others: Vector6<f64>,
}

/// The errors after a step, N.
pub(super) struct Errors {
    pub(super) others_n: Vector6<f64>,
    pub(super) eliminated_n: f64,
}

impl<'a> Equations<'a> {
    pub(super) fn new(
        columns: &'a Columns<'a>,
        course: &'a Course<'a>,
        fold_at_slack_end: bool,
        missed: Vector6<Interval>,
        arithmetic: Arithmetic,
    ) -> Self {
        let plain = columns.defect();
        let row = plain.row(columns.cable).transpose();
        let mut back = plain.transpose();
        back.fill_column(columns.cable, 0.0);
        let weights = fed_back(&back, &row);
        let others = Others::new(columns);
        let missed_most = missed.map(Interval::magnitude);
        Self {
            columns,
            course,
            fold_at_slack_end,
            missed,
            missed_most,
            arithmetic,
            weights,
            others,
        }
    }

    fn cable(&self) -> usize {
        self.columns.cable
    }

    /// A sum of row `e`, with what the others weigh in it at most, for what is in each row.
    fn weighed(&self, sum: Interval, own: f64, mut others: Vector6<f64>) -> Interval {
        others[self.cable()] = 0.0;
        let room = self.weights.map_or(f64::INFINITY, |weights| weights.dot(&others));
        sum + Interval::symmetric((room + own) * UPWARDS)
    }

    /// The left side of the one equation on a piece, as far as its sign matters. Mostly it is enough to know what the
    /// others weigh; where it is not, it is told how they follow.
    fn value(&self, sum: &Sum) -> Interval {
        let cable = self.cable();
        let own = sum.rows[cable];
        if own.mignitude() == 0.0 {
            return own;
        }
        let apart = self.missed_most + self.arithmetic.on(sum);
        let rough = self.weighed(own, apart[cable], apart + sum.rows.map(Interval::magnitude));
        if rough.mignitude() > 0.0 {
            return rough;
        }
        let Some(others) = &self.others else { return rough };
        let Some(followed) = others.follow(&sum.affine, &apart) else { return rough };
        let patch = self.course.patch;
        let value = followed.rows.over(patch, cable);
        if value.mignitude() > 0.0 {
            return value;
        }
        followed.balanced(others, patch, cable).rows.over(patch, cable)
    }

    /// And its slope, by newton of the eliminated cable, as far as its sign matters.
    fn slope(&self, piece: &Piece) -> Interval {
        let cable = self.cable();
        let slope = piece.slope[cable];
        if slope.mignitude() == 0.0 {
            return slope;
        }
        let apart = self.arithmetic.unit * piece.tangent;
        let rough = self.weighed(slope, apart[cable], apart + piece.slope.map(Interval::magnitude));
        if rough.mignitude() > 0.0 {
            return rough;
        }
        let followed = self.followed_slope(piece);
        followed.map_or(rough, |followed| followed.rows.over(self.course.patch, cable))
    }

    fn followed_slope(&self, piece: &Piece) -> Option<Followed> {
        let apart = self.arithmetic.unit * piece.tangent;
        self.others.as_ref()?.follow(&piece.affine_slope, &apart)
    }

    /// `None` where it may not rise.
    fn rise(&self, piece: &Piece) -> Option<Rise> {
        let followed = self.followed_slope(piece)?;
        let least = followed.rows.over(self.course.patch, self.cable()).low();
        (least > 0.0).then(|| Rise { least, others: followed.rows.most() })
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
        let (cable, patch) = (self.cable(), self.course.patch);
        let others = self.others.as_ref()?;
        let mut all: Option<Vector6<Interval>> = None;
        for piece in &self.course.pieces[pieces.clone()] {
            let mut affine = piece.sum.affine;
            affine.middle -= self.missed.map(Interval::middle);
            let apart = self.missed.map(Interval::radius) + self.arithmetic.on(&piece.sum);
            let followed = others.follow(&affine, &apart)?.balanced(others, patch, cable);
            let here = Vector6::from_fn(|i, _| {
                if i == cable {
                    Interval::zero()
                } else {
                    -followed.rows.where_zero(patch, cable, i)
                }
            });
            all = Some(all.map_or(here, |all| all.zip_map(&here, Interval::hull)));
        }
        all
    }

    /// The errors after a step that misses so much, with the solution on some pieces, and the step on some that these are
    /// part of.
    pub(super) fn errors(&self, solutions: &Range<usize>, all: &Range<usize>) -> Option<Errors> {
        let pieces = &self.course.pieces;
        // On all of them: it is not known yet where the step ends.
        let rounding = pieces[all.clone()].iter().map(|piece| self.arithmetic.on(&piece.sum));
        let rounding = rounding.fold(Vector6::zeros(), |most, next| most.sup(&next));
        let alone_n = fed_back(&self.columns.defect(), &(self.missed_most + rounding))?;
        let reach_n = alone_n[self.cable()];
        let (mut pulled, mut steepest) = (Vector6::zeros(), 0.0_f64);
        let mut rise_n = |number: usize| {
            let piece: &Piece = pieces.get(number)?;
            let Rise { least, others } = self.rise(piece)?;
            pulled = others.map(|other| other / least).sup(&pulled);
            steepest = steepest.max(piece.tangent / least);
            Some(least * piece.along_n)
        };
        for number in solutions.clone() {
            rise_n(number)?;
        }
        // And as far beyond as it may get, down and up.
        let beyond: [&mut dyn Iterator<Item = usize>; 2] =
            [&mut (all.start..solutions.start).rev(), &mut (solutions.end..all.end)];
        for numbers in beyond {
            let mut left_n = reach_n;
            while left_n >= 0.0
                && let Some(number) = numbers.next()
            {
                left_n -= rise_n(number)? / UPWARDS;
            }
        }
        let others_n = (alone_n + pulled * reach_n) * UPWARDS;
        Some(Errors { others_n, eliminated_n: reach_n * steepest * UPWARDS })
    }
}

/// `N = B A M - 1` over a patch, where `B` inverts `A M` in the middle, so that nothing is left of it there. Column `e` is
/// zero.
struct Others {
    /// `B`.
    base: Matrix6<f64>,
    sizes: Matrix6<f64>,
    /// How each coordinate of the pose turns it at most, and all of them.
    turned: [Matrix6<f64>; COORDINATES],
    turning: Matrix6<f64>,
    /// What there is of it besides, and all of it.
    besides: Matrix6<f64>,
    all: Matrix6<f64>,
}

impl Others {
    fn new(columns: &Columns) -> Option<Self> {
        let (one, middle) = (Matrix6::identity(), &columns.defect);
        let mut base = (one + middle).try_inverse()?;
        // Exactly.
        base.set_column(columns.cable, &one.column(columns.cable));
        // Of the right sign, so that slopes have that of `det`.
        if base.determinant() <= LEAST_DETERMINANT {
            return None;
        }
        let sizes = base.abs();
        let turned = columns.turned.map(|turned| base * turned);
        let sum = |of: &[Matrix6<f64>]| of.iter().fold(Matrix6::zeros(), |sum, m| sum + m.abs());
        let turning = sum(&turned);
        let left = (base * (one + middle) - one).abs();
        let rounded = sizes * (one + middle.abs() + sum(&columns.turned));
        let open = columns.slanted.abs() + columns.blur;
        let mut besides = (sizes * open + left + rounded * ROUNDINGS) * UPWARDS;
        besides.fill_column(columns.cable, 0.0);
        let all = (turning + besides) * UPWARDS;
        Some(Self { base, sizes, turned, turning, besides, all })
    }

    /// What becomes of the rows `r` as the others follow: `u = (A M)^-1 r = (1 + N)^-1 B r`, of which row `e` is the left
    /// side of the one equation, and the others are minus how far those move. `None` where that is not bounded.
    fn follow(&self, rows: &Affine, apart: &Vector6<f64>) -> Option<Followed> {
        let Self { base, sizes, turned, turning, all, .. } = self;
        let sum = |of: &[Vector6<f64>]| of.iter().fold(Vector6::zeros(), |sum, v| sum + v.abs());
        let middle = base * rows.middle;
        let mut along = rows.along.map(|along| base * along);
        let moving = sum(&along);
        let rounded = sizes * (rows.middle.abs() + sum(&rows.along));
        let rounded = rounded + turning * (middle.abs() + moving);
        let open = sizes * (rows.open + apart) + rounded * ROUNDINGS;
        let most = fed_back(all, &(middle.abs() + moving + open))?;
        let mut twice = turning * (open + turning * (moving + open));
        for (along, turned) in along.iter_mut().zip(turned) {
            *along -= turned * middle;
        }
        for (k, turned_k) in turned.iter().enumerate() {
            twice += (turned_k * along[k]).abs() + (turned_k * along[COORDINATES]).abs();
            for (l, turned_l) in turned.iter().enumerate().take(k) {
                twice += (turned_k * along[l] + turned_l * along[k]).abs();
            }
        }
        Some(self.within(&Affine { middle, along, open: open + twice }, &most))
    }

    /// What is made of that besides, where none of it is more than so much.
    fn within(&self, short: &Affine, most: &Vector6<f64>) -> Followed {
        let besides = self.besides * most;
        let thrice = self.turning * (besides + self.turning * (self.all * most));
        let open = (short.open + besides + thrice) * UPWARDS;
        Followed { rows: Affine { open, ..*short }, short: *short }
    }
}

/// What becomes of rows as the others follow.
struct Followed {
    rows: Affine,
    /// Without what is made of it by what bounds all of it only.
    short: Affine,
}

impl Followed {
    /// The same where row `e` is zero, and the others move less for it.
    fn balanced(&self, others: &Others, patch: &Patch, cable: usize) -> Self {
        let most = Vector6::from_fn(|i, _| {
            if i == cable { 0.0 } else { self.rows.where_zero(patch, cable, i).magnitude() }
        });
        others.within(&self.short, &most)
    }
}

/// What 1 N across the tangent of each cable makes in the rows, by middle and radius.
pub(super) struct Across {
    pub(super) middle: Matrix6<f64>,
    pub(super) radius: Matrix6<f64>,
}

impl Across {
    /// What so much across each makes.
    pub(super) fn times(&self, by_cable_n: &[Interval; CABLES]) -> Vector6<Interval> {
        // Sums of six products are off by fewer units than these of the sum of their sizes.
        const ROUNDING: f64 = 8.0 * f64::EPSILON;
        let of = |part: fn(Interval) -> f64| Vector6::from_fn(|i, _| part(by_cable_n[i]));
        let sizes = self.middle.abs();
        let room = sizes * of(Interval::radius)
            + (self.radius + sizes * ROUNDING) * of(Interval::magnitude);
        (self.middle * of(Interval::middle)).zip_map(&(room * UPWARDS), Interval::around)
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
    /// The radii of that, and all roundings.
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

    /// Bound of `|A M - I|`, column `e` zero.
    fn defect(&self) -> Matrix6<f64> {
        let still = self.defect.abs() + self.slanted.abs() + self.blur;
        self.turned.iter().fold(still, |bound, turned| bound + turned.abs()) * UPWARDS
    }
}

/// A bound on all `e >= 0` with `e <= right + defect e`; `None` when that does not bound them.
fn fed_back(defect: &Matrix6<f64>, right: &Vector6<f64>) -> Option<Vector6<f64>> {
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
    use cdpr_core::table::Plane;
    use rand::rngs::ChaCha8Rng;
    use rand::{Rng, RngExt as _, SeedableRng as _};

    use super::super::patch::HalfSpace;
    use super::super::place::{Along, Point, PoseBox};
    use super::*;

    fn number(random: &mut impl Rng) -> f64 {
        random.random_range(-1.0..1.0)
    }

    fn vector(random: &mut impl Rng) -> Vector6<f64> {
        Vector6::from_fn(|_, _| number(random))
    }

    /// A matrix whose column of a cable is zero.
    fn matrix(size: f64, cable: usize, random: &mut impl Rng) -> Matrix6<f64> {
        let mut matrix = Matrix6::from_fn(|_, _| size * number(random));
        matrix.fill_column(cable, 0.0);
        matrix
    }

    /// For any pose, slants and what is not known besides, what becomes of rows as the others follow is what is said of
    /// them, and where row `e` is zero what is said of that, which is far less. So it is of what the others weigh in row
    /// `e` at most.
    #[test]
    fn rows_are_what_becomes_of_them_as_the_others_follow() {
        let (mut all, mut apart, mut zeros, mut reached) = ([0.0; 3], 0.0, 0, 0.0_f64);
        let mut signs = 0;
        let region = PoseBox { low: [-1.0; COORDINATES], high: [1.0; COORDINATES] };
        for seed in 0..200 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let cable = random.random_range(0..CABLES);
            // All of a box, or what is before a plane.
            let plane = Plane {
                normal: std::array::from_fn(|_| {
                    random.random_range(-Plane::LARGEST..=Plane::LARGEST)
                }),
                offset: random.random_range(-200..400),
            };
            let half = Some(HalfSpace::of(&region, plane)).filter(|_| seed % 2 == 1);
            let Some(patch) = Patch::of(region, half.as_ref()) else { continue };
            let inverse = Inverse {
                matrix: Matrix6::identity(),
                sizes: Matrix6::identity(),
                per_newton: Vector6::repeat(1.0),
            };
            let along = Along::PositionAndTurn { moment_arm_m: 1.0 };
            let mut columns = Columns::new(&inverse, cable, along);
            columns.defect = matrix(0.03, cable, &mut random);
            columns.slanted = matrix(0.01, cable, &mut random);
            columns.turned = std::array::from_fn(|_| matrix(0.03, cable, &mut random));
            columns.blur = matrix(0.005, cable, &mut random).abs();
            let mut open = vector(&mut random).abs() * 0.1;
            open[cable] = 1.0;
            let rows = Affine {
                middle: vector(&mut random) * if seed % 4 < 2 { 3.0 } else { 12.0 },
                along: std::array::from_fn(|_| vector(&mut random)),
                open,
            };
            let others = Others::new(&columns).expect("it is close to one");
            let followed = others.follow(&rows, &Vector6::zeros()).expect("bounded");
            let balanced = followed.balanced(&others, &patch, cable);
            // No zero by what holds where it is one is none.
            let told = balanced.rows.over(&patch, cable);
            let is_certain = told.mignitude() > 0.0;
            signs += usize::from(is_certain);
            let weighed = fed_back(&columns.defect(), &rows.most()).expect("bounded");
            let mut ends = [[0.0_f64; 2]; CABLES];
            for _ in 0..300 {
                let part = |random: &mut ChaCha8Rng| {
                    if random.random() { number(random).signum() } else { number(random) }
                };
                let at: Point = std::array::from_fn(|_| part(&mut random));
                if half.is_some_and(|half| !half.contains(&at)) {
                    continue;
                }
                let pose: [f64; COORDINATES + 1] = std::array::from_fn(|k| match at.get(k) {
                    Some(at) => (at - patch.middle[k]) / patch.aside(k).magnitude(),
                    None => part(&mut random),
                });
                let slants = Matrix6::from_diagonal(&Vector6::from_fn(|_, _| part(&mut random)));
                let blur = columns.blur.map(|blur| blur * part(&mut random));
                let mut turned = Matrix6::identity() + columns.defect;
                turned += columns.slanted * slants + blur;
                let mut right = rows.middle + rows.open.map(|open| open * part(&mut random));
                for (k, part) in pose.iter().enumerate() {
                    right += rows.along[k] * *part;
                    if k < COORDINATES {
                        turned += columns.turned[k] * *part;
                    }
                }
                let becomes = turned.try_inverse().expect("regular") * right;
                assert!(!is_certain || becomes[cable] * told.middle() > 0.0, "{seed}");
                for i in 0..CABLES {
                    assert!(followed.rows.over(&patch, i).contains(becomes[i]), "{seed}");
                    assert!(becomes[i].abs() <= weighed[i], "{seed}");
                    ends[i] = [ends[i][0].min(becomes[i]), ends[i][1].max(becomes[i])];
                }
                // Row `e` with what makes it zero, if that is open.
                if becomes[cable].abs() > 0.5 {
                    continue;
                }
                let mut zero = rows;
                zero.open[cable] = 1.5;
                let zero = others.follow(&zero, &Vector6::zeros()).expect("bounded");
                let less = zero.balanced(&others, &patch, cable);
                for i in (0..CABLES).filter(|i| *i != cable) {
                    assert!(zero.rows.where_zero(&patch, cable, i).contains(becomes[i]), "{seed}");
                    assert!(less.rows.where_zero(&patch, cable, i).contains(becomes[i]), "{seed}");
                    zeros += 1;
                }
            }
            for i in (0..CABLES).filter(|i| *i != cable) {
                let over = followed.rows.over(&patch, i);
                all[0] += over.radius();
                all[1] += followed.rows.where_zero(&patch, cable, i).radius();
                all[2] += balanced.rows.where_zero(&patch, cable, i).radius();
                apart += weighed[i];
                reached = reached.max((ends[i][1] - ends[i][0]) / (2.0 * over.radius()));
            }
        }
        let [over, zero, balanced] = all;
        assert!(zeros > 10_000, "{zeros}");
        assert!(signs > 10, "{signs}");
        assert!(over < 0.8 * apart && zero < over && balanced < zero, "{all:?} {apart}");
        // They are not far too wide either.
        assert!(reached > 0.5, "{reached}");
    }

    /// Whatever is missed by each cable is in the rows that are said of all.
    #[test]
    fn what_is_missed_across_is_in_its_rows() {
        for seed in 0..200 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let across = Across {
                middle: Matrix6::from_fn(|_, _| number(&mut random)),
                radius: Matrix6::from_fn(|_, _| 0.01 * number(&mut random).abs()),
            };
            let by_cable_n = std::array::from_fn(|_| {
                let (a, b) = (number(&mut random), number(&mut random));
                Interval::new(a.min(b), a.max(b))
            });
            let rows = across.times(&by_cable_n);
            for _ in 0..100 {
                let columns =
                    across.middle + across.radius.map(|radius| radius * number(&mut random));
                let missed_n = Vector6::from_fn(|i, _| {
                    random.random_range(by_cable_n[i].low()..=by_cable_n[i].high())
                });
                let all = columns * missed_n;
                assert!((0..CABLES).all(|i| rows[i].contains(all[i])), "{seed}");
            }
        }
    }
}
