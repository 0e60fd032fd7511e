//! The matrix of the equations over a patch, and what becomes of their rows as the five other cables follow. See
//! [`proof`](super::proof).

use cdpr_core::CABLES;
use cdpr_core::table::COORDINATES;
use nalgebra::{Matrix6, Vector6};

use super::affine::{Affine, sum_of_sizes};
use super::patch::Patch;
use super::place::{Along, ByPose};
use super::sums::{Inverse, UPWARDS};
use crate::interval::Interval;

/// Times that rows are fed back through a matrix like `A M - 1`.
const FEEDBACK: usize = 6;
/// And what is added to each for it.
const SHARE: f64 = 0.01;
/// Many times the rounding of products with the matrices here, as a part of the sum of their sizes.
const ROUNDINGS: f64 = 256.0 * f64::EPSILON;
/// A determinant that is larger has a sign for certain.
const LEAST_DETERMINANT: f64 = 1e-6;

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
    pub(super) cable: usize,
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
    pub(super) fn defect(&self) -> Matrix6<f64> {
        let still = self.defect.abs() + self.slanted.abs() + self.blur;
        (still + sum_of_sizes(&self.turned)) * UPWARDS
    }
}

/// `N = B A M - 1` over a patch, where `B` inverts `A M` in the middle, so that nothing is left of it there. Column `e` is
/// zero.
pub(super) struct Others {
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
    pub(super) fn new(columns: &Columns) -> Option<Self> {
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
        let turning = sum_of_sizes(&turned);
        let left = (base * (one + middle) - one).abs();
        let rounded = sizes * (one + middle.abs() + sum_of_sizes(&columns.turned));
        let open = columns.slanted.abs() + columns.blur;
        let mut besides = (sizes * open + left + rounded * ROUNDINGS) * UPWARDS;
        besides.fill_column(columns.cable, 0.0);
        let all = (turning + besides) * UPWARDS;
        Some(Self { base, sizes, turned, turning, besides, all })
    }

    /// What becomes of the rows `r` as the others follow: `u = (A M)^-1 r = (1 + N)^-1 B r`, of which row `e` is the left
    /// side of the one equation, and the others are minus how far those move. `None` where that is not bounded.
    pub(super) fn follow(&self, rows: &Affine, apart: &Vector6<f64>) -> Option<Followed> {
        let Self { base, sizes, turned, turning, all, .. } = self;
        let middle = base * rows.middle;
        let mut along = rows.along.map(|along| base * along);
        let moving = sum_of_sizes(&along);
        let rounded = sizes * (rows.middle.abs() + sum_of_sizes(&rows.along));
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
pub(super) struct Followed {
    pub(super) rows: Affine,
    /// Without what is made of it by what bounds all of it only.
    short: Affine,
}

impl Followed {
    /// The same where row `e` is zero, and the others move less for it.
    pub(super) fn balanced(&self, others: &Others, patch: &Patch, cable: usize) -> Self {
        let most = Vector6::from_fn(|i, _| {
            if i == cable { 0.0 } else { self.rows.where_zero(patch, cable, i).magnitude() }
        });
        others.within(&self.short, &most)
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
