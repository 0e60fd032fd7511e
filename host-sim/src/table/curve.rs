//! Force curves over boxes of poses, in intervals.

use cdpr_core::chart::{Charted, Hung, chart_of_root, root};
use cdpr_core::{CABLES, IrvineCatenary, Robot};
use nalgebra::Vector2;
use num_traits::One;

use super::Model;
use super::place::{Sight, alike};
use crate::dual::Dual;
use crate::interval::Interval;

/// Times that the bound on the strain is narrowed.
const STRAIN_STEPS: usize = 1;
/// A range is taken in parts when the change of the slope over it is not known to this part, so many that the
/// logarithm of the root changes by so much, and not more.
const WIDE: f64 = 0.03;
const PART: f64 = 0.08;
const MOST_PARTS: f64 = 16.0;
/// Stretches in which a curve is followed: the root changes by this part over each, and so many at most.
const STRETCH: f64 = 0.04;
const MOST_STRETCHES: usize = 64;
/// Many times the rounding of a number, as a part of it.
const ROUNDING: f64 = 1e-12;

/// The force curves of a robot, with all parameters that a reader takes for the same.
pub(super) struct Curves {
    models: [IrvineCatenary<Interval>; CABLES],
}

/// One cable over a box of poses and a range of its coordinate: force, and its first and second derivative by
/// the coordinate.
#[allow(clippy::struct_field_names)] // their unit
pub(super) struct Reach {
    pub(super) force_n: Vector2<Interval>,
    pub(super) by_chart_n: Vector2<Interval>,
    pub(super) bend_n: Vector2<Interval>,
    /// How force and first derivative change with the end of the cable in `x` and in `z`, per metre.
    pub(super) by_end_n: [Vector2<Interval>; 2],
    pub(super) turn_n: [Vector2<Interval>; 2],
}

impl Reach {
    fn hull(&self, other: &Self) -> Self {
        let both = |a: &Vector2<Interval>, b: &Vector2<Interval>| a.zip_map(b, Interval::hull);
        Self {
            force_n: both(&self.force_n, &other.force_n),
            by_chart_n: both(&self.by_chart_n, &other.by_chart_n),
            bend_n: both(&self.bend_n, &other.bend_n),
            by_end_n: [0, 1].map(|k| both(&self.by_end_n[k], &other.by_end_n[k])),
            turn_n: [0, 1].map(|k| both(&self.turn_n[k], &other.turn_n[k])),
        }
    }
}

/// Where the curve of a cable is heading over a range, seen along a direction: its tangent is that plus the slant
/// times the direction across, as often as the rate.
pub(super) struct Heading {
    direction: Vector2<f64>,
    pub(super) rate_n: Interval,
    pub(super) slant: Interval,
    /// How direction and slant change with the end of the cable in `x` and in `z`, per metre.
    pub(super) turn: [Vector2<Interval>; 2],
}

impl Heading {
    /// `None` where it may turn back.
    pub(super) fn new(reach: &Reach, direction: &Vector2<f64>) -> Option<Self> {
        // Of unit length but for rounding.
        const LENGTH: f64 = 8.0 * f64::EPSILON;
        let direction = *direction;
        let (along_n, aside_n) = seen(&reach.by_chart_n, &direction);
        let rate_n = along_n * Interval::around(1.0, LENGTH);
        let is_on = rate_n.low() > 0.0; // false for NaN
        if !is_on {
            return None;
        }
        let slant = aside_n / along_n;
        let turn = reach.turn_n.map(|turn_n| {
            let (along, aside) = seen(&turn_n, &direction);
            let by_end = (aside - slant * along) / along_n;
            Vector2::new(-direction.y, direction.x).map(|c| by_end * Interval::point(c))
        });
        Some(Self { direction, rate_n, slant, turn })
    }

    /// The direction with a slant.
    pub(super) fn vector(&self, slant: Interval) -> Vector2<Interval> {
        let along = self.direction.map(Interval::point);
        along + Vector2::new(-along.y, along.x) * slant
    }
}

/// What a vector is along a direction, and across it.
fn seen(v: &Vector2<Interval>, direction: &Vector2<f64>) -> (Interval, Interval) {
    let [x, z] = [direction.x, direction.y].map(Interval::point);
    (v.x * x + v.y * z, v.y * x - v.x * z)
}

impl Curves {
    pub(super) fn new(robot: &Robot<f64, Model>) -> Self {
        let models = std::array::from_fn(|i| {
            let model = &robot.cables()[i].model;
            IrvineCatenary {
                weight_n_m: alike(model.weight_n_m),
                compliance_per_n: alike(model.compliance_per_n),
            }
        });
        Self { models }
    }

    /// One cable over a range of its coordinate, in parts where the whole is not known well.
    pub(super) fn reach(&self, i: usize, sight: &Sight, chart: Interval) -> Option<Reach> {
        let whole = self.reach_at_once(i, sight, chart);
        if whole.as_ref().is_some_and(|reach| is_known(chart, &reach.bend_n, &reach.by_chart_n)) {
            return whole;
        }
        let mut all: Option<Reach> = None;
        for part in parts(chart) {
            let reach = self.reach_at_once(i, sight, part)?;
            all = Some(match all {
                None => reach,
                Some(all) => all.hull(&reach),
            });
        }
        all
    }

    /// The slant of a cable over a range of its coordinate.
    pub(super) fn slant(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
        direction: &Vector2<f64>,
    ) -> Option<Interval> {
        let mut all: Option<Interval> = None;
        for part in parts(chart) {
            let (reach, middle_n) = self.reach_about(i, sight, part)?;
            let heading = Heading::new(&reach, direction)?;
            let (rate_n, aside_n) = seen(&middle_n, direction);
            // By the mean value theorem: all along the curve its parts change together.
            let (along, aside) = seen(&reach.bend_n, direction);
            let by_chart = (aside - heading.slant * along) / heading.rate_n;
            let near = aside_n / rate_n + by_chart * Interval::symmetric(part.radius());
            let slant = heading.slant.intersection(near)?;
            all = Some(all.map_or(slant, |all| all.hull(slant)));
        }
        all
    }

    /// A coordinate that is past all at which the force has changed by so much along a direction, from a coordinate on.
    pub(super) fn reached(
        &self,
        i: usize,
        sight: &Sight,
        from: f64,
        along_n: f64,
        direction: &Vector2<f64>,
    ) -> Option<f64> {
        let (mut chart, mut left_n, way) = (from, along_n.abs(), along_n.signum());
        for _ in 0..MOST_STRETCHES {
            let next = chart + way * stretch(chart, STRETCH);
            let over = Interval::new(chart.min(next), chart.max(next));
            let (rate_n, _) = seen(&self.hung(i, sight, over)?.force_by_chart_n, direction);
            let known_n = rate_n.low() * (next - chart).abs() * (1.0 - ROUNDING);
            let is_on = known_n > 0.0; // false for NaN
            if !is_on {
                return None;
            }
            if known_n >= left_n {
                let last = left_n / rate_n.low() + chart.abs() * ROUNDING;
                return Some(chart + way * last * (1.0 + ROUNDING));
            }
            left_n -= known_n;
            chart = next;
        }
        None
    }

    /// One cable over a range of its coordinate, with the second derivative.
    pub(super) fn reach_at_once(&self, i: usize, sight: &Sight, chart: Interval) -> Option<Reach> {
        Some(self.reach_about(i, sight, chart)?.0)
    }

    /// And the first derivative in the middle of the range.
    fn reach_about(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
    ) -> Option<(Reach, Vector2<Interval>)> {
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
            &model.slackness(Dual { value: root, rate: by_chart }),
            Dual { value: strain, rate: hung.strain_by_chart },
        );
        let bend_n = moving.force_by_chart_n.map(|c| c.rate);
        let turn_n = [moving.force_by_x_n_m, moving.force_by_z_n_m].map(|v| v.map(|c| c.rate));
        // By the mean value, where that is better.
        let half = Interval::symmetric(chart.radius());
        let (_, _, middle) = self.hung_at(i, sight, Interval::point(chart.middle()))?;
        let near = middle.force_by_chart_n + bend_n * half;
        let by_chart_n = both(&hung.force_by_chart_n, &near)?;
        let near = middle.force_n + by_chart_n * half;
        let force_n = both(&hung.force_n, &near)?;
        let by_end_n = [hung.force_by_x_n_m, hung.force_by_z_n_m];
        let known = [hung.force_n, hung.force_by_chart_n, bend_n];
        let mut known = known.iter().chain(&by_end_n).chain(&turn_n);
        let is_known = known.all(|v| size(v).is_bounded());
        let reach = Reach { force_n, by_chart_n, bend_n, by_end_n, turn_n };
        is_known.then_some((reach, middle.force_by_chart_n))
    }

    /// Only the first derivative, of which the second is known already.
    pub(super) fn slope(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
        bend_n: &Vector2<Interval>,
    ) -> Option<Vector2<Interval>> {
        let middle = self.hung(i, sight, Interval::point(chart.middle()))?.force_by_chart_n;
        let near = middle + bend_n * Interval::symmetric(chart.radius());
        if is_known(chart, bend_n, &middle) {
            return Some(near);
        }
        both(&self.hung(i, sight, chart)?.force_by_chart_n, &near)
    }

    /// The curve over a range of its coordinate.
    pub(super) fn hung(&self, i: usize, sight: &Sight, chart: Interval) -> Option<Hung<Interval>> {
        let (_, _, hung) = self.hung_at(i, sight, chart)?;
        let by_end = size(&hung.force_by_x_n_m) + size(&hung.force_by_z_n_m);
        let known = size(&hung.force_n) + size(&hung.force_by_chart_n) + by_end;
        known.is_bounded().then_some(hung)
    }

    /// Root, strain, and the rest.
    fn hung_at(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
    ) -> Option<(Interval, Interval, Hung<Interval>)> {
        let root = root_of(chart)?;
        let (model, x_m, z_m) = (&self.models[i], sight.x_m, sight.z_m);
        let slackness = model.slackness(root);
        let next = |strain| model.strain(x_m, z_m, &slackness, strain).0;
        // The strain that comes out falls as the one given grows: the true one is below that of none.
        let mut strain = Interval::new(0.0, next(Interval::point(0.0)).high());
        for _ in 0..STRAIN_STEPS {
            strain = next(strain).intersection(strain)?;
        }
        Some((root, strain, model.hung(x_m, z_m, &slackness, strain)))
    }
}

/// How long a range is at a coordinate over which the root changes by this part.
pub(super) fn stretch(chart: f64, change: f64) -> f64 {
    let s = root(chart);
    (0.5 / s + 2.0 * s * s) * change
}

/// A range in parts, over each of which the root hardly changes.
fn parts(chart: Interval) -> impl Iterator<Item = Interval> {
    let (least, most) = (root(chart.high()), root(chart.low()));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
    let parts = ((most / least).ln() / PART).ceil().clamp(1.0, MOST_PARTS) as u32;
    let at = move |k: u32| {
        let share = f64::from(k) / f64::from(parts);
        if k == parts { chart.high() } else { chart.low() + (chart.high() - chart.low()) * share }
    };
    (0..parts).map(move |part| Interval::new(at(part), at(part + 1)))
}

/// Whether the change of the slope over a range is known well.
fn is_known(chart: Interval, bend_n: &Vector2<Interval>, by_chart_n: &Vector2<Interval>) -> bool {
    let open = bend_n.map(Interval::radius).sum() * chart.radius();
    open <= WIDE * size(by_chart_n).low() // false for NaN
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
pub(super) fn both(a: &Vector2<Interval>, b: &Vector2<Interval>) -> Option<Vector2<Interval>> {
    Some(Vector2::new(a.x.intersection(b.x)?, a.y.intersection(b.y)?))
}

/// Sum of the sizes of two components.
pub(super) fn size(v: &Vector2<Interval>) -> Interval {
    let abs = |i: Interval| Interval::new(i.mignitude(), i.magnitude());
    abs(v.x) + abs(v.y)
}
