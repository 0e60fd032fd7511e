//! Force curves over boxes of poses, in intervals.

use cdpr_core::chart::{Charted, Hung, chart_of_root, root};
use cdpr_core::{CABLES, IrvineCatenary, Robot};
use nalgebra::{SVector, Vector2};
use num_traits::{One, Zero};

use super::Model;
use super::place::{Sight, alike};
use crate::dual::Dual;
use crate::interval::Interval;

/// Times that the bound on the strain is narrowed.
const STRAIN_STEPS: usize = 1;
/// A range is taken in parts when the change of the slope over it is not known to this part, so many that the
/// logarithm of the root changes by so much, and not more.
const WIDE: f64 = 0.03;
const PART: f64 = 0.05;
const MOST_PARTS: f64 = 16.0;
/// A curve over which the slant is known so well is taken at once.
const STRAIGHT: f64 = 1e-4;
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
    /// How the force changes with the end of the cable in `x` and in `z`, N/m.
    pub(super) by_end_n: [Vector2<Interval>; 2],
}

impl Reach {
    fn hull(&self, other: &Self) -> Self {
        let both = |a: &Vector2<Interval>, b: &Vector2<Interval>| a.zip_map(b, Interval::hull);
        Self {
            force_n: both(&self.force_n, &other.force_n),
            by_chart_n: both(&self.by_chart_n, &other.by_chart_n),
            bend_n: both(&self.bend_n, &other.bend_n),
            by_end_n: [0, 1].map(|k| both(&self.by_end_n[k], &other.by_end_n[k])),
        }
    }
}

/// Its tangents by the force density of the cable, m. They turn with the pose, but do not grow as a cable gets taut, so that
/// little cancels where they turn little.
#[allow(clippy::struct_field_names)] // their unit
struct Tangent {
    at_m: Vector2<Interval>,
    /// How they change with the coordinate.
    bend_m: Vector2<Interval>,
    /// That in the middle of the range.
    middle_m: Vector2<Interval>,
}

/// Where the curve of a cable is heading over a range, seen along a direction: its tangent is that plus the slant
/// times the direction across, as often as the rate.
pub(super) struct Heading {
    pub(super) direction: Vector2<f64>,
    pub(super) rate_n: Interval,
    pub(super) slant: Interval,
    /// How the slant changes with the coordinate.
    pub(super) bend: Interval,
}

impl Heading {
    /// `None` where it may turn back.
    fn of(
        reach: &Reach,
        tangent: &Tangent,
        chart: Interval,
        direction: &Vector2<f64>,
    ) -> Option<Self> {
        let (rate_n, _) = seen(&reach.by_chart_n, direction);
        let (along_m, across_m) = seen(&tangent.at_m, direction);
        let is_on = rate_n.low() > 0.0 && along_m.low() > 0.0; // false for NaN
        if !is_on {
            return None;
        }
        let slant = across_m / along_m;
        let (bent_along, bent_across) = seen(&tangent.bend_m, direction);
        let bend = (bent_across - slant * bent_along) / along_m;
        // By the mean value theorem: all along the curve its parts change together.
        let (along_m, across_m) = seen(&tangent.middle_m, direction);
        let near = across_m / along_m + bend * Interval::symmetric(chart.radius());
        let slant = slant.intersection(near)?;
        let is_known = [rate_n, slant, bend].iter().all(|c| c.is_bounded());
        is_known.then_some(Self { direction: *direction, rate_n, slant, bend })
    }

    /// That of a curve as it stands, along its direction in the middle.
    pub(super) fn at(hung: &Hung<Interval>) -> Option<Self> {
        let direction = direction(&-hung.heading_m);
        let (rate_n, _) = seen(&hung.force_by_chart_n, &direction);
        let (along_m, across_m) = seen(&-hung.heading_m, &direction);
        let slant = across_m / along_m;
        let is_on = rate_n.low() > 0.0 && along_m.low() > 0.0 && slant.is_bounded();
        is_on.then_some(Self { direction, rate_n, slant, bend: Interval::zero() })
    }

    fn hull(&self, other: &Self) -> Self {
        Self {
            direction: self.direction,
            rate_n: self.rate_n.hull(other.rate_n),
            slant: self.slant.hull(other.slant),
            bend: self.bend.hull(other.bend),
        }
    }

    /// Whether the slant over a range is known so well at once that parts of it tell no more.
    fn is_told_at_once(&self, chart: Interval) -> bool {
        self.bend.radius() * chart.radius() <= STRAIGHT
    }

    /// The direction with a slant.
    pub(super) fn vector(&self, slant: Interval) -> Vector2<Interval> {
        self.direction.map(Interval::point) + self.across(slant)
    }

    /// So much of the direction across.
    pub(super) fn across(&self, size: Interval) -> Vector2<Interval> {
        across(&self.direction).map(|c| Interval::point(c) * size)
    }
}

/// A short range of a curve.
pub(super) struct Run {
    pub(super) reach: Reach,
    pub(super) heading: Heading,
    /// How the tangents change with the end of the cable in `x` and in `z`, per metre.
    pub(super) turn: [Vector2<Interval>; 2],
}

/// The same over a patch of poses, and rate and slant at the middle of it.
pub(super) struct Fine {
    pub(super) run: Run,
    pub(super) rate_here_n: Interval,
    pub(super) slant_here: Interval,
}

/// The direction across another.
pub(super) fn across(direction: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-direction.y, direction.x)
}

/// The direction in the middle of a vector.
fn direction(v: &Vector2<Interval>) -> Vector2<f64> {
    v.map(Interval::middle).normalize()
}

/// What a vector is along a direction of unit length, and across it.
pub(super) fn seen(v: &Vector2<Interval>, direction: &Vector2<f64>) -> (Interval, Interval) {
    // Of unit length but for rounding.
    const LENGTH: f64 = 8.0 * f64::EPSILON;
    let unit = Interval::around(1.0, LENGTH);
    let [x, z] = [direction.x, direction.y].map(|c| Interval::point(c) * unit);
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

    /// One cable over a range of its coordinate, seen along a direction: in parts where the whole is not known well.
    /// `None` where it may turn back.
    pub(super) fn course(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
        direction: &Vector2<f64>,
    ) -> Option<(Reach, Heading)> {
        if let Some((reach, heading)) = self.headed(i, sight, chart, direction)
            && is_known(chart, &reach.bend_n, &reach.by_chart_n)
            && heading.is_told_at_once(chart)
        {
            return Some((reach, heading));
        }
        let mut all: Option<(Reach, Heading)> = None;
        for part in parts(chart) {
            let (reach, heading) = self.headed(i, sight, part, direction)?;
            all = Some(match all {
                None => (reach, heading),
                Some(all) => (all.0.hull(&reach), all.1.hull(&heading)),
            });
        }
        all
    }

    /// One cable over a range of its coordinate at once.
    fn headed(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
        direction: &Vector2<f64>,
    ) -> Option<(Reach, Heading)> {
        let (reach, tangent) = self.reach(i, sight, chart, &self.hung_at(i, sight, chart)?)?;
        let heading = Heading::of(&reach, &tangent, chart, direction)?;
        Some((reach, heading))
    }

    /// By how much the slant of a chord from a coordinate to any of a range differs from that of the tangent where it
    /// begins: the slants along it in the mean.
    pub(super) fn chord(
        &self,
        i: usize,
        sight: &Sight,
        from: f64,
        to: Interval,
        direction: &Vector2<f64>,
    ) -> Option<Interval> {
        if !to.is_bounded() {
            return None;
        }
        let headed = |chart| Some(self.headed(i, sight, chart, direction)?.1);
        let mut all = Interval::zero();
        for (end, way) in [(to.low(), -1.0), (to.high(), 1.0)] {
            if (end - from) * way <= 0.0 {
                continue;
            }
            let whole = Interval::new(from.min(end), from.max(end));
            let mut parts: Vec<Interval> = match headed(whole) {
                Some(heading) if heading.is_told_at_once(whole) => vec![whole],
                _ => parts(whole).collect(),
            };
            if way < 0.0 {
                parts.reverse();
            }
            // Up to a part: the mean, the slant, and how far along the force has got.
            let mut mean = Interval::zero();
            let mut slant = Interval::zero();
            let mut along_n = Interval::zero();
            for part in parts {
                let heading = headed(part)?;
                let length = part.high() - part.low();
                let [short, long] = [1.0 - ROUNDING, 1.0 + ROUNDING].map(|one| length * one);
                let turned = heading.bend * Interval::point(way) * Interval::new(short, long);
                let over = slant + turned.hull(Interval::zero());
                // The mean over the part, or some of it, has a share in that over all.
                let gained_n = heading.rate_n * Interval::point(long);
                let most = (1.0 + ROUNDING) / (1.0 + along_n.low() / gained_n.high());
                let least = (1.0 - ROUNDING) / (1.0 + along_n.high() / gained_n.low());
                let mixed = |share: f64| {
                    let share = Interval::point(share);
                    mean * (Interval::one() - share) + over * share
                };
                let (most, least) = (mixed(most.min(1.0)), mixed(least));
                all = all.hull(mean).hull(most);
                mean = most.hull(least);
                slant += turned;
                along_n += gained_n;
            }
            all = all.hull(mean);
        }
        Some(all)
    }

    /// How a tangent, seen along its heading, changes with the end of the cable in `x` and in `z`, per metre.
    pub(super) fn turn(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
        heading: &Heading,
    ) -> Option<[Vector2<Interval>; 2]> {
        self.turned(i, sight, &self.hung_at(i, sight, chart)?, heading)
    }

    fn turned(
        &self,
        i: usize,
        sight: &Sight,
        at: &At,
        heading: &Heading,
    ) -> Option<[Vector2<Interval>; 2]> {
        let (along_m, _) = seen(&-at.hung.heading_m, &heading.direction);
        let turned = self.tangent_by_end(i, sight, at)?.map(|by_end| {
            let (along, across) = seen(&by_end, &heading.direction);
            (across - heading.slant * along) / along_m
        });
        let is_known = along_m.low() > 0.0 && turned.iter().all(|c| c.is_bounded());
        is_known.then(|| turned.map(|c| heading.across(c)))
    }

    /// A curve, where root, strain and the end in `x` and in `z` change at such rates.
    fn moving(
        &self,
        i: usize,
        sight: &Sight,
        at: &At,
        [root_by, strain_by, x_by, z_by]: [Interval; 4],
    ) -> Hung<Dual> {
        let dual = |value, rate| Dual { value, rate };
        let model = IrvineCatenary {
            weight_n_m: Dual::fixed(self.models[i].weight_n_m),
            compliance_per_n: Dual::fixed(self.models[i].compliance_per_n),
        };
        model.hung(
            dual(sight.x_m, x_by),
            dual(sight.z_m, z_by),
            &model.slackness(dual(at.root, root_by)),
            dual(at.strain, strain_by),
        )
    }

    /// How tangents change with the end of the cable in `x` and in `z`.
    fn tangent_by_end(&self, i: usize, sight: &Sight, at: &At) -> Option<[Vector2<Interval>; 2]> {
        let (zero, one, by_end) = (Interval::zero(), Interval::one(), at.hung.strain_by_end_per_m);
        let moved = |rates| self.moving(i, sight, at, rates).heading_m.map(|c| -c.rate);
        let all = [moved([zero, by_end.x, one, zero]), moved([zero, by_end.y, zero, one])];
        all.iter().all(|v| size(v).is_bounded()).then_some(all)
    }

    /// A coordinate that is past all at which the force has changed by so much along a direction, from a coordinate on in a
    /// way: up or down, 1 or -1.
    pub(super) fn reached(
        &self,
        i: usize,
        sight: &Sight,
        (from, way): (f64, f64),
        along_n: f64,
        direction: &Vector2<f64>,
    ) -> Option<f64> {
        let (mut chart, mut left_n) = (from, along_n);
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

    /// One cable over a short range of its coordinate, seen along its direction there: over a patch, and `here`, at the
    /// middle of it. `None` where it may turn back.
    pub(super) fn fine(
        &self,
        i: usize,
        sight: &Sight,
        here: &Sight,
        chart: Interval,
    ) -> Option<Fine> {
        let run = self.run(i, sight, chart, None)?;
        let Run { reach, heading, .. } = &run;
        // By the mean value theorem.
        let half = Interval::symmetric(chart.radius());
        let middle = self.hung(i, here, Interval::point(chart.middle()))?;
        let by_chart_n = middle.force_by_chart_n + reach.bend_n * half;
        let (rate_n, _) = seen(&by_chart_n, &heading.direction);
        let (along_m, across_m) = seen(&-middle.heading_m, &heading.direction);
        let slant = across_m / along_m + heading.bend * half;
        let rate_here_n = heading.rate_n.intersection(rate_n)?;
        let slant_here = heading.slant.intersection(slant)?;
        Some(Fine { run, rate_here_n, slant_here })
    }

    /// One cable over a short range, seen along a direction, or its own.
    pub(super) fn run(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
        along: Option<&Vector2<f64>>,
    ) -> Option<Run> {
        let at = self.hung_at(i, sight, chart)?;
        let (reach, tangent) = self.reach(i, sight, chart, &at)?;
        let own = || direction(&tangent.middle_m);
        let heading = Heading::of(&reach, &tangent, chart, &along.copied().unwrap_or_else(own))?;
        let turn = self.turned(i, sight, &at, &heading)?;
        Some(Run { reach, heading, turn })
    }

    /// The curve over a range of its coordinate, and how its slope changes.
    pub(super) fn bending(
        &self,
        i: usize,
        sight: &Sight,
        chart: Interval,
    ) -> Option<(Hung<Interval>, Vector2<Interval>)> {
        let at = self.hung_at(i, sight, chart)?;
        let hung = Self::known(&at)?;
        let bend_n = self.by_chart(i, sight, &at).force_by_chart_n.map(|c| c.rate);
        Some((hung, bend_n))
    }

    /// A curve, where its coordinate changes.
    fn by_chart(&self, i: usize, sight: &Sight, at: &At) -> Hung<Dual> {
        let (_, slope) = chart_of_root(at.root);
        let (zero, by_chart) = (Interval::zero(), Interval::one() / slope);
        self.moving(i, sight, at, [by_chart, at.hung.strain_by_chart, zero, zero])
    }

    fn reach(&self, i: usize, sight: &Sight, chart: Interval, at: &At) -> Option<(Reach, Tangent)> {
        let hung = &at.hung;
        let moving = self.by_chart(i, sight, at);
        let bend_n = moving.force_by_chart_n.map(|c| c.rate);
        let bend_m = moving.heading_m.map(|c| -c.rate);
        // By the mean value, where that is better.
        let half = Interval::symmetric(chart.radius());
        let middle = self.hung_at(i, sight, Interval::point(chart.middle()))?.hung;
        let near = middle.force_by_chart_n + bend_n * half;
        let by_chart_n = both(&hung.force_by_chart_n, &near)?;
        let near = middle.force_n + by_chart_n * half;
        let force_n = both(&hung.force_n, &near)?;
        let middle_m = -middle.heading_m;
        let at_m = both(&-hung.heading_m, &(middle_m + bend_m * half))?;
        let by_end_n = [hung.force_by_x_n_m, hung.force_by_z_n_m];
        let known = [force_n, by_chart_n, bend_n, at_m, bend_m];
        let is_known = known.iter().chain(&by_end_n).all(|v| size(v).is_bounded());
        let reach = Reach { force_n, by_chart_n, bend_n, by_end_n };
        is_known.then_some((reach, Tangent { at_m, bend_m, middle_m }))
    }

    /// The curve over a range of its coordinate.
    pub(super) fn hung(&self, i: usize, sight: &Sight, chart: Interval) -> Option<Hung<Interval>> {
        Self::known(&self.hung_at(i, sight, chart)?)
    }

    fn known(at: &At) -> Option<Hung<Interval>> {
        let hung = at.hung;
        let by_end = size(&hung.force_by_x_n_m) + size(&hung.force_by_z_n_m);
        let along = size(&hung.force_by_chart_n) + size(&hung.heading_m);
        (size(&hung.force_n) + along + by_end).is_bounded().then_some(hung)
    }

    fn hung_at(&self, i: usize, sight: &Sight, chart: Interval) -> Option<At> {
        let root = root_of(chart)?;
        let (model, x_m, z_m) = (&self.models[i], sight.x_m, sight.z_m);
        let slackness = model.slackness(root);
        let next = |strain| model.strain(x_m, z_m, &slackness, strain).0;
        // The strain that comes out falls as the one given grows: the true one is below that of none.
        let mut strain = Interval::new(0.0, next(Interval::point(0.0)).high());
        for _ in 0..STRAIN_STEPS {
            strain = next(strain).intersection(strain)?;
        }
        Some(At { root, strain, hung: model.hung(x_m, z_m, &slackness, strain) })
    }
}

/// A curve over a range of its coordinate, by root and strain.
struct At {
    root: Interval,
    strain: Interval,
    hung: Hung<Interval>,
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
pub(super) fn both<const N: usize>(
    a: &SVector<Interval, N>,
    b: &SVector<Interval, N>,
) -> Option<SVector<Interval, N>> {
    let mut both = *a;
    for (both, other) in both.iter_mut().zip(b) {
        *both = both.intersection(*other)?;
    }
    Some(both)
}

/// Sum of the sizes of two components.
pub(super) fn size(v: &Vector2<Interval>) -> Interval {
    let abs = |i: Interval| Interval::new(i.mignitude(), i.magnitude());
    abs(v.x) + abs(v.y)
}

#[cfg(test)]
mod tests;
