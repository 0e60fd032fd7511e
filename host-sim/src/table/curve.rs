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
/// Narrower ranges are as good as points.
const LEAST_RADIUS: f64 = 1e-9;

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

    /// The first derivative only, over a range for which a bound on the second is known; as well as [`Self::reach`].
    pub(super) fn tangent(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
        bend_n: &Vector2<Interval>,
    ) -> Option<Vector2<Interval>> {
        match self.slope(i, sight, chart, bend_n) {
            Some(by_chart_n) if is_known(chart, bend_n, &by_chart_n) => Some(by_chart_n),
            _ => Some(self.reach(i, sight, chart)?.by_chart_n),
        }
    }

    /// One cable over a range of its coordinate, with the second derivative.
    pub(super) fn reach_at_once(&self, i: usize, sight: &Sight, chart: Interval) -> Option<Reach> {
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
        known.all(|v| size(v).is_bounded()).then_some(Reach {
            force_n,
            by_chart_n,
            bend_n,
            by_end_n,
            turn_n,
        })
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
        if chart.radius() <= LEAST_RADIUS {
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
        let at = |strain| self.models[i].hung(sight.x_m, sight.z_m, root, strain);
        let next = |strain| self.models[i].strain(sight.x_m, sight.z_m, root, strain).0;
        // The strain that comes out falls as the one given grows: the true one is below that of none.
        let mut strain = Interval::new(0.0, next(Interval::point(0.0)).high());
        for _ in 0..STRAIN_STEPS {
            strain = next(strain).intersection(strain)?;
        }
        Some((root, strain, at(strain)))
    }
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
