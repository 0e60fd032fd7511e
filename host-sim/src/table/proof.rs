//! The proof of a cell: from its seed Newton's method reaches one solution, for every pose of a box.
//!
//! The unknowns are the six coordinates `p` of the [chart](cdpr_core::chart), the equations
//! `Phi(P, p) = wrench(P) + sum_i G_i(P) F_i(p_i; x_i(P), z_i(P)) = 0`. `P` runs over a box around `Pc`, `pc`
//! is close to the solution at `Pc`, and `A` close to the inverse of the matrix `M` of the columns
//! `G_i dF_i/dp_i` there.
//!
//! # The solution
//!
//! (Krawczyk's test with parameters.) By the mean value theorem `|A Phi(P, pc)|` is at most
//! `eta = |A Phi(Pc, pc)| + sum_k |A dPhi/dP_k| |P_k - Pc_k|`, with the derivative over the box, summed over the
//! cables before it is multiplied by `A`, so that what balances balances. With `K` a bound of `|A M - I|` over
//! the box of poses and `|p - pc| <= r`, componentwise, `eta + K r < r` shows: for every `P` there is exactly one
//! solution with `|p - pc| <= r`, it is within `eta + K r`, and it depends continuously on `P`.
//!
//! # Newton's method
//!
//! From an iterate `p` the error `e` of the next obeys
//!
//! ```text
//! M(P, p) e = sum_i G_i (F_i(p*_i) - F_i(p_i) - F_i'(p_i) (p*_i - p_i))
//! ```
//!
//! Each bracket is enclosed twice: as it stands, and as `F_i'' (p*_i - p_i)^2/2` with `F_i''` over all that lies
//! between iterate and solution; the second is better near the solution, the first where a step crosses a
//! bend. With `A` now the inverse near the iterate, `e = A (...) - (A M - I) e`. Beginning with the seed this
//! gives a box for each iterate, to which is added what arithmetic in f32 may do.

use cdpr_core::chart::{ChartStep, Charted, Hung, chart_of_root, root};
use cdpr_core::statics::Balance;
use cdpr_core::table::{COORDINATES, Gap, TOLERANCE};
use cdpr_core::{CABLES, IrvineCatenary, Load, Robot};
use nalgebra::{Matrix6, Vector2, Vector6};
use num_traits::{One, Zero};

use super::Model;
use super::place::{Likeness, Point, PoseBox, Sight, alike, pose};
use crate::dual::Dual;
use crate::interval::Interval;

/// Newton steps at the middle of a box, to find the solution there.
const SETTLING_STEPS: usize = 30;
/// A step that changes no coordinate by more than this is the last (relative, and absolute near zero).
const SETTLED: f64 = 1e-11;
/// Radii of the box of a solution, in units of the Newton step: at first, and how they grow.
const ROOM: f64 = 1.1;
const ROOM_ATTEMPTS: usize = 4;
const LEAST_RADIUS: f64 = 1e-9;
/// Times that the bound on the strain is narrowed.
const STRAIN_STEPS: usize = 1;
/// A range is taken in parts when the change of the slope over it is not known to this part, so many that the
/// logarithm of the root changes by so much, and not more.
const WIDE: f64 = 0.03;
const PART: f64 = 0.08;
const MOST_PARTS: f64 = 16.0;
/// For the rounding of sums of non-negative bounds.
const UPWARDS: f64 = 1.0 + 1e-12;
/// Times that the errors of a step are fed back through `A M - I`.
const FEEDBACK: usize = 12;

/// The arithmetic of a controller in f32: a component of the wrench of a cable is off by at most this many
/// units of the force (15 operations of the explicit curve, whose factors are of one sign, rounded half a
/// unit each, as are direction, lever arm, products and the sum of seven).
const F32_ROUNDINGS: f64 = 12.0;
/// And the plane of a cable by this many units of the coordinates that it is made of.
const F32_PLANE: f64 = 2.0;
/// Unit in the last place of 1.
const F32: f64 = f32::EPSILON as f64;

/// Proves cells of one robot with one load.
pub(super) struct Prover {
    robot: Robot<f64, Model>,
    load: Load<f64>,
    likeness: Likeness,
    models: [IrvineCatenary<Interval>; CABLES],
    /// Largest coordinate of an anchor, m.
    size_m: f64,
}

/// What is known of a box.
#[derive(Clone, Debug)]
pub(super) enum Verdict {
    /// Newton's method arrives after this many steps.
    Proven { steps: u8 },
    /// At its middle it does not arrive.
    Refuted,
    /// Not proven; a smaller box may be. The coordinate in which to halve it.
    Open { split: usize, gap: Gap },
}

/// One cable over a box of poses and a range of its coordinate: force, and its first and second derivative by
/// the coordinate.
#[allow(clippy::struct_field_names)] // their unit
struct Reach {
    force_n: Vector2<Interval>,
    by_chart_n: Vector2<Interval>,
    bend_n: Vector2<Interval>,
}

/// The slope of a curve, `dF/dp`, N.
struct Slope(Vector2<Interval>);

impl AsRef<Vector2<Interval>> for Slope {
    fn as_ref(&self) -> &Vector2<Interval> {
        &self.0
    }
}

impl AsRef<Vector2<Interval>> for Reach {
    fn as_ref(&self) -> &Vector2<Interval> {
        &self.by_chart_n
    }
}

impl Reach {
    fn hull(&self, other: &Self) -> Self {
        let both = |a: &Vector2<Interval>, b: &Vector2<Interval>| a.zip_map(b, Interval::hull);
        Self {
            force_n: both(&self.force_n, &other.force_n),
            by_chart_n: both(&self.by_chart_n, &other.by_chart_n),
            bend_n: both(&self.bend_n, &other.bend_n),
        }
    }
}

impl Prover {
    pub(super) fn new(robot: &Robot<f64, Model>, load: &Load<f64>) -> Self {
        let models = std::array::from_fn(|i| {
            let model = &robot.cables()[i].model;
            IrvineCatenary {
                weight_n_m: alike(model.weight_n_m),
                compliance_per_n: alike(model.compliance_per_n),
            }
        });
        let size_m = robot.cables().iter().map(|c| c.anchor_m.amax()).fold(0.0, f64::max);
        Self { robot: *robot, load: *load, likeness: Likeness::new(robot, load), models, size_m }
    }

    pub(super) fn robot(&self) -> &Robot<f64, Model> {
        &self.robot
    }

    pub(super) fn load(&self) -> &Load<f64> {
        &self.load
    }

    pub(super) fn balance(&self, at: &Point) -> Option<Balance<f64>> {
        Balance::at(&self.robot, &self.load, &pose(at).ok()?).ok()
    }

    /// The solution that Newton's method leads to from `charts`, in at most `steps` steps.
    pub(super) fn settle(
        &self,
        balance: &Balance<f64>,
        charts: &[f64; CABLES],
        steps: usize,
    ) -> Option<([f64; CABLES], ChartStep<f64>)> {
        let mut charts = *charts;
        for _ in 0..steps {
            let step = ChartStep::new(&self.robot, balance, &charts).ok()?;
            let settled = (0..CABLES)
                .all(|i| (step.charts[i] - charts[i]).abs() <= SETTLED * (1.0 + charts[i].abs()));
            if settled {
                return Some((charts, step));
            }
            charts = step.charts;
        }
        None
    }

    /// The same, if so many steps come as close as a table asks for.
    fn settle_in_time(
        &self,
        balance: &Balance<f64>,
        seed: &[f64; CABLES],
        steps: u8,
    ) -> Option<([f64; CABLES], ChartStep<f64>)> {
        let mut reached = *seed;
        for _ in 0..steps {
            reached = ChartStep::new(&self.robot, balance, &reached).ok()?.charts;
        }
        let (center, step) = self.settle(balance, &reached, SETTLING_STEPS)?;
        let (mut off_n, mut forces_n) = (0.0_f64, 0.0);
        for i in 0..CABLES {
            let point = &step.points[i];
            off_n = off_n.max(point.force_by_chart_n.lp_norm(1) * (reached[i] - center[i]).abs());
            forces_n += point.state.force_n.lp_norm(1);
        }
        (off_n <= TOLERANCE * forces_n).then_some((center, step))
    }

    /// Examines a box of poses; `steps` is what the seed may take at most.
    pub(super) fn examine(&self, region: &PoseBox, seed: &[f64; CABLES], steps: u8) -> Verdict {
        let middle = region.middle();
        let longest = || {
            // Before anything is known: as far as an attachment moves.
            let extent = |k: usize| {
                region.extent(k) * if k < 3 { 1.0 } else { self.likeness.moment_arm_m() }
            };
            (0..COORDINATES).fold(0, |best, k| if extent(k) > extent(best) { k } else { best })
        };
        let Some(balance) = self.balance(&middle) else { return Verdict::Refuted };
        let Some((center, at_center)) = self.settle_in_time(&balance, seed, steps) else {
            return Verdict::Refuted;
        };
        let Ok((sights, loading)) = self.likeness.look(region) else {
            return Verdict::Open { split: longest(), gap: Gap::SingularCable };
        };
        let open = |gap| Verdict::Open { split: longest(), gap };
        let inverse = at_center.elimination().inverse();

        // eta
        let point = PoseBox { low: middle, high: middle };
        let Ok((exact, exact_load)) = self.likeness.look(&point) else {
            return open(Gap::SingularCable);
        };
        let mut imbalance = exact_load.wrench_n;
        let mut by_pose = [Vector6::zeros(); COORDINATES];
        by_pose[3..].copy_from_slice(&loading.by_turn);
        for i in 0..CABLES {
            let Some(here) = self.hung(i, &exact[i], Interval::point(center[i])) else {
                return open(Gap::SingularCable);
            };
            imbalance += exact[i].wrench_n(&here.force_n);
            let Some(all) = self.hung(i, &sights[i], Interval::point(center[i])) else {
                return open(Gap::SingularCable);
            };
            let (by_x, by_z) = (&all.force_by_x_n_m, &all.force_by_z_n_m);
            let arm_m = self.likeness.moment_arm_m();
            sights[i].add_by_pose(&mut by_pose, &all.force_n, by_x, by_z, arm_m);
        }
        let mut eta = times(&inverse, &imbalance).map(Interval::magnitude);
        // How far each coordinate of the pose moves the forces, N.
        let mut shares = [0.0; COORDINATES];
        let slopes_n: [f64; CABLES] = at_center.points.map(|p| p.force_by_chart_n.norm());
        for k in 0..COORDINATES {
            let half = 0.5 * region.extent(k) * UPWARDS;
            let moved = times(&inverse, &by_pose[k]).map(|c| c.magnitude() * half);
            eta += moved;
            shares[k] = (0..CABLES).map(|i| moved[i] * slopes_n[i]).sum();
        }
        let widest = (0..COORDINATES).fold(0, |b, k| if shares[k] > shares[b] { k } else { b });
        let open = |gap| Verdict::Open { split: widest, gap };
        if !eta.iter().all(|e| e.is_finite()) {
            return open(Gap::Unproven);
        }

        // Where already the poses alone turn the matrix too far there is no need to look at the curves.
        let Some(thin) = self.turned(&sights, &center) else { return open(Gap::SingularCable) };
        let Some(least) = fed_back(&defect(&inverse, &sights, &thin), &eta) else {
            return open(Gap::Unproven);
        };

        // The solution.
        let mut radii = least.map(|r| ROOM * r + LEAST_RADIUS);
        let mut found = None;
        for _ in 0..ROOM_ATTEMPTS {
            let Some(reach) = self.reach(&sights, |i| Interval::around(center[i], radii[i])) else {
                return open(Gap::SingularCable);
            };
            let defect = defect(&inverse, &sights, &reach);
            let image = (eta + defect * radii) * UPWARDS;
            if (0..CABLES).all(|i| image[i] < radii[i]) {
                found = Some((image, defect));
                break;
            }
            let Some(next) = fed_back(&defect, &eta) else { break };
            radii = next.map(|r| ROOM * r + LEAST_RADIUS);
        }
        let Some((image, defect)) = found else { return open(Gap::Unproven) };
        let solution_radius = (eta + defect * image) * UPWARDS;
        let solution = |i: usize| Interval::around(center[i], solution_radius[i].min(image[i]));

        // Newton's method.
        let solutions: [Interval; CABLES] = std::array::from_fn(solution);
        let mut iterate = seed.map(Interval::point);
        let mut errors: [Interval; CABLES] = std::array::from_fn(|i| iterate[i] - solutions[i]);
        for done in 1..=steps {
            let next = self.newton(&balance, &sights, &solutions, &iterate, &errors);
            let Some(next) = next else { return open(Gap::TooManySteps) };
            errors = next;
            iterate = std::array::from_fn(|i| solutions[i] + errors[i]);
            let Some(reach) = self.reach(&sights, |i| solutions[i].hull(iterate[i])) else {
                return open(Gap::TooManySteps);
            };
            let sum_n: f64 = reach.iter().map(|reach| size(&reach.force_n).low()).sum();
            let error_n = (0..CABLES)
                .map(|i| size(&reach[i].by_chart_n).high() * errors[i].magnitude())
                .fold(0.0, f64::max);
            if error_n < TOLERANCE * sum_n {
                return Verdict::Proven { steps: done };
            }
        }
        open(Gap::TooManySteps)
    }

    /// Bounds the errors after a Newton step from any of the points `iterate`, with their `errors`.
    fn newton(
        &self,
        balance: &Balance<f64>,
        sights: &[Sight],
        solutions: &[Interval; CABLES],
        iterate: &[Interval; CABLES],
        errors: &[Interval; CABLES],
    ) -> Option<[Interval; CABLES]> {
        let step = ChartStep::new(&self.robot, balance, &iterate.map(Interval::middle)).ok()?;
        let inverse = step.elimination().inverse();
        let here = self.reach(sights, |i| iterate[i])?;
        let there = self.reach(sights, |i| solutions[i])?;
        let between = self.reach(sights, |i| solutions[i].hull(iterate[i]))?;
        let mut left_n = Vector6::zeros();
        let sizes = Vector6::from_fn(|j, _| errors[j].magnitude());
        for j in 0..CABLES {
            let error = errors[j];
            // What the tangent misses, as it stands and by the second derivative.
            let plain = there[j].force_n - here[j].force_n + here[j].by_chart_n * error;
            let bent = between[j].bend_n * (error.square() * Interval::point(0.5));
            left_n += sights[j].wrench_n(&both(&plain, &bent)?);
        }
        let ahead = times(&inverse, &left_n);
        let rounding = self.rounding(&inverse, sights, &here, &sizes);
        let kept = defect(&inverse, sights, &here);
        let bound = fed_back(&kept, &(ahead.map(Interval::magnitude) + rounding))?;
        let room = (kept * bound + rounding) * UPWARDS;
        Some(std::array::from_fn(|i| ahead[i] + Interval::symmetric(room[i])))
    }

    /// What one step in f32 may be off by, from an iterate with these errors.
    fn rounding(
        &self,
        inverse: &Matrix6<f64>,
        sights: &[Sight],
        reach: &[Reach],
        errors: &Vector6<f64>,
    ) -> Vector6<f64> {
        let mut wrench_n = 0.0;
        for (j, reach) in reach.iter().enumerate() {
            let force_n = size(&reach.force_n).high();
            // The step is about as long as the error, and its matrix is rounded, too.
            let step_n = size(&reach.by_chart_n).high() * errors[j] * 4.0;
            let plane_m = F32_PLANE * (self.size_m + sights[j].x_m.high());
            let swing_n_m = force_n / sights[j].x_m.low() * 2.0;
            wrench_n += F32_ROUNDINGS * (force_n + step_n) + plane_m * swing_n_m;
        }
        Vector6::from_fn(|i, _| {
            let row: f64 = (0..CABLES).map(|j| inverse[(i, j)].abs()).sum();
            row * wrench_n * F32
        })
    }

    /// The slopes at fixed coordinates.
    fn turned(&self, sights: &[Sight], charts: &[f64; CABLES]) -> Option<Vec<Slope>> {
        let slope = |i: usize| {
            let (_, _, hung) = self.hung_at(i, &sights[i], Interval::point(charts[i]))?;
            Some(Slope(hung.force_by_chart_n))
        };
        (0..CABLES).map(slope).collect()
    }

    fn reach(&self, sights: &[Sight], chart: impl Fn(usize) -> Interval) -> Option<Vec<Reach>> {
        (0..CABLES).map(|i| self.reach_of(i, &sights[i], chart(i))).collect()
    }

    /// One cable over a range of its coordinate, in parts where the whole is not known well.
    fn reach_of(&self, i: usize, sight: &Sight, chart: Interval) -> Option<Reach> {
        let whole = self.reach_at_once(i, sight, chart);
        let is_good = |reach: &Reach| {
            let open = reach.bend_n.map(Interval::radius).sum() * chart.radius();
            open <= WIDE * size(&reach.by_chart_n).low()
        };
        if whole.as_ref().is_some_and(is_good) {
            return whole;
        }
        // So many that the root hardly changes over each.
        let (least, most) = (root(chart.high()), root(chart.low()));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        let parts = ((most / least).ln() / PART).ceil().clamp(2.0, MOST_PARTS) as u32;
        let mut all: Option<Reach> = None;
        for part in 0..parts {
            let at = |k: u32| {
                let share = f64::from(k) / f64::from(parts);
                chart.low() + (chart.high() - chart.low()) * share
            };
            let high = if part + 1 == parts { chart.high() } else { at(part + 1) };
            let reach = self.reach_at_once(i, sight, Interval::new(at(part), high))?;
            all = Some(match all {
                None => reach,
                Some(all) => all.hull(&reach),
            });
        }
        all
    }

    /// One cable over a range of its coordinate, with the second derivative.
    fn reach_at_once(&self, i: usize, sight: &Sight, chart: Interval) -> Option<Reach> {
        let (root, strain, hung) = self.hung_at(i, sight, chart)?;
        let (_, slope) = chart_of_root(root);
        let by_chart = Interval::one() / slope;
        let model = IrvineCatenary {
            weight_n_m: Dual::fixed(self.models[i].weight_n_m),
            compliance_per_n: Dual::fixed(self.models[i].compliance_per_n),
        };
        let moving = model.hung(
            Dual::fixed(sight.x_m),
            Dual::fixed(sight.z_m),
            Dual { value: root, rate: by_chart },
            Dual { value: strain, rate: hung.strain_by_chart },
        );
        let bend_n = moving.force_by_chart_n.map(|c| c.rate);
        // By the mean value, where that is better.
        let half = Interval::symmetric(chart.radius());
        let (_, _, middle) = self.hung_at(i, sight, Interval::point(chart.middle()))?;
        let near = middle.force_by_chart_n + bend_n * half;
        let by_chart_n = both(&hung.force_by_chart_n, &near)?;
        let near = middle.force_n + by_chart_n * half;
        let force_n = both(&hung.force_n, &near)?;
        let known = size(&hung.force_n) + size(&hung.force_by_chart_n) + size(&bend_n);
        known.is_bounded().then_some(Reach { force_n, by_chart_n, bend_n })
    }

    fn hung(&self, i: usize, sight: &Sight, chart: Interval) -> Option<Hung<Interval>> {
        let (_, _, hung) = self.hung_at(i, sight, chart)?;
        let by_end = size(&hung.force_by_x_n_m) + size(&hung.force_by_z_n_m);
        (size(&hung.force_n) + by_end).is_bounded().then_some(hung)
    }

    /// The curve over a range of its coordinate: root, strain, and the rest.
    fn hung_at(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
    ) -> Option<(Interval, Interval, Hung<Interval>)> {
        let root = root_of(chart)?;
        let at = |strain| self.models[i].hung(sight.x_m, sight.z_m, root, strain);
        let next = |strain| self.models[i].strain(sight.x_m, sight.z_m, root, strain).0;
        // The strain that comes out falls as the one given grows: the true one is below that of none.
        let mut strain = Interval::new(0.0, next(Interval::zero()).high());
        for _ in 0..STRAIN_STEPS {
            strain = next(strain).intersection(strain)?;
        }
        Some((root, strain, at(strain)))
    }
}

/// The roots of all coordinates of a range.
fn root_of(chart: Interval) -> Option<Interval> {
    if !chart.is_bounded() {
        return None;
    }
    // The root falls as the coordinate rises.
    let least = root(chart.high()) * (1.0 - 1e-13);
    let most = root(chart.low()) * (1.0 + 1e-13);
    let low = chart_of_root(Interval::point(least)).0;
    let high = chart_of_root(Interval::point(most)).0;
    (least > 0.0 && low.low() >= chart.high() && high.high() <= chart.low())
        .then(|| Interval::new(least, most))
}

/// What two enclosures of one vector leave of it.
fn both(a: &Vector2<Interval>, b: &Vector2<Interval>) -> Option<Vector2<Interval>> {
    Some(Vector2::new(a.x.intersection(b.x)?, a.y.intersection(b.y)?))
}

/// Sum of the sizes of two components.
fn size(v: &Vector2<Interval>) -> Interval {
    let abs = |i: Interval| Interval::new(i.mignitude(), i.magnitude());
    abs(v.x) + abs(v.y)
}

/// The product of a matrix of floats, taken for exact, with intervals.
fn times(matrix: &Matrix6<f64>, vector: &Vector6<Interval>) -> Vector6<Interval> {
    Vector6::from_fn(|i, _| {
        (0..CABLES)
            .fold(Interval::zero(), |sum, j| sum + Interval::point(matrix[(i, j)]) * vector[j])
    })
}

/// Bound of `|A M - I|`, componentwise.
fn defect(
    inverse: &Matrix6<f64>,
    sights: &[Sight],
    reach: &[impl AsRef<Vector2<Interval>>],
) -> Matrix6<f64> {
    let mut defect = Matrix6::zeros();
    for j in 0..CABLES {
        let mut column = times(inverse, &sights[j].wrench_n(reach[j].as_ref()));
        column[j] -= Interval::one();
        defect.set_column(j, &column.map(Interval::magnitude));
    }
    defect
}

/// A bound on all `e >= 0` with `e <= right + defect e`; `None` when that does not bound them.
fn fed_back(defect: &Matrix6<f64>, right: &Vector6<f64>) -> Option<Vector6<f64>> {
    let mut weights = right.map(|r| r + f64::MIN_POSITIVE);
    for _ in 0..FEEDBACK {
        weights = right + defect * weights;
    }
    let fed = defect * weights;
    let share = (0..CABLES).map(|i| fed[i] / weights[i]).fold(0.0, f64::max);
    if !(share < 1.0 && weights.iter().all(|w| w.is_finite())) {
        return None;
    }
    // e <= weights max(right/(weights - defect weights))
    let factor = (0..CABLES).map(|i| right[i] / (weights[i] - fed[i])).fold(0.0, f64::max);
    let bound = weights * (factor * UPWARDS);
    Some((right + defect * bound) * UPWARDS)
}
