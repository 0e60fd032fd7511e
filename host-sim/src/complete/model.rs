//! What a proof needs of a cable model: the same model in intervals, and the course of its force curve
//! between two points.

use std::fmt;

use cdpr_core::{CableModel, CableState, IrvineCatenary, LinearElastic, Parabola, Scalar};
use nalgebra::Vector2;
use num_traits::{One, Zero};

use crate::dual::Dual;
use crate::interval::Interval;

/// Part of a force curve: its two ends, and a box that holds it.
#[derive(Clone, Copy, Debug)]
pub struct Stretch<'a, E> {
    /// Attachment relative to the anchor, `(x, z)` in the plane of the cable, m.
    pub span_m: Vector2<Interval>,
    /// The end with the shorter rest length.
    pub shorter: &'a CableState<Interval>,
    /// The end with the longer rest length.
    pub longer: &'a CableState<Interval>,
    /// Holds every force and rest length between the two.
    pub hull: CableState<Interval>,
    /// What the model wanted to keep of the two ends.
    pub ends: [&'a E; 2],
}

/// Where a stretch of force curve runs.
#[derive(Clone, Copy, Debug)]
pub struct Course {
    /// A vector along the curve, towards longer cables, of any positive length that may differ from
    /// point to point: its components enclose those at every point of the stretch.
    pub direction: Vector2<Interval>,
    /// The component of the force across the line from anchor to attachment, `(x Fz - z Fx)/d`, at
    /// every point of the stretch, N. [`Interval::ENTIRE`] when nothing is known of it.
    pub offset_n: Interval,
}

/// A cable model with which proofs can be made.
///
/// A model that is written in a generic [`Scalar`] needs only [`Provable::enclosing`] and
/// [`Provable::moving`], each a copy of its parameters, and nothing to keep: `type End = ()`.
pub trait Provable: CableModel<f64> {
    /// The same model in interval arithmetic.
    type Enclosing: CableModel<Interval>;
    /// The same model in numbers that carry the rate at which they change with a parameter.
    type Moving: CableModel<Dual>;
    /// What [`Provable::course`] wants to know of the ends of a stretch, computed once for each.
    type End: Copy + fmt::Debug;

    /// The model whose parameters are the parameters of this one, as intervals.
    fn enclosing(&self) -> Self::Enclosing;

    /// The model whose parameters are the parameters of this one, none of which changes.
    fn moving(&self) -> Self::Moving;

    /// What to keep of a point of the force curve.
    fn end(model: &Self::Enclosing, state: &CableState<Interval>) -> Self::End;

    /// Where the force curve runs between two points.
    ///
    /// [`jacobian_course`] holds for every model. On a taut cable it loses the direction unless the
    /// stretch is short; a model that knows better is searched faster.
    fn course(model: &Self::Enclosing, stretch: &Stretch<'_, Self::End>) -> Course {
        jacobian_course(model, stretch)
    }
}

/// The course of any cable: its direction is `-adj(K) b` with `K`, `b` the derivative of the end point
/// by force and length, and its offset is `W/d` times the distance of its centre of gravity from the
/// anchor, somewhere between 0 and `x` (the moments about the anchor are in balance).
pub fn jacobian_course<M: CableModel<Interval>, E>(model: &M, stretch: &Stretch<'_, E>) -> Course {
    let CableState { force_n, rest_length_m } = stretch.hull;
    let j = model.end_point(force_n, rest_length_m).jacobian;
    let (x, z) = (stretch.span_m.x, stretch.span_m.y);
    let (distance, _) = Interval::hypot_with_excess(x, z);
    let moment = model.weight_n_m() * rest_length_m * x * Interval::new(0.0, 1.0);
    Course {
        direction: Vector2::new(j.m12 * j.m23 - j.m13 * j.m22, j.m13 * j.m21 - j.m11 * j.m23),
        offset_n: moment / distance,
    }
}

impl Provable for IrvineCatenary<f64> {
    type Enclosing = IrvineCatenary<Interval>;
    type Moving = IrvineCatenary<Dual>;
    type End = Shape;

    fn enclosing(&self) -> Self::Enclosing {
        IrvineCatenary {
            weight_n_m: Interval::point(self.weight_n_m),
            compliance_per_n: Interval::point(self.compliance_per_n),
        }
    }

    fn moving(&self) -> Self::Moving {
        IrvineCatenary {
            weight_n_m: Dual::point(self.weight_n_m),
            compliance_per_n: Dual::point(self.compliance_per_n),
        }
    }

    fn end(model: &Self::Enclosing, state: &CableState<Interval>) -> Shape {
        Shape::of(model, state)
    }

    /// With the force density `m = S/(2L)` as parameter the catenary through two given points is
    /// explicit: `q = w/(2m)`, `e = m L/EA`, `sag = atanh(q)/q - 1`, `P = 1 + e`, `Q = P + sag` and
    ///
    /// ```text
    /// Fx = m x/Q        Fz - wL/2 = m z/P        L^2 = x^2/(Q^2 (1 - q^2)) + z^2/P^2
    /// ```
    ///
    /// With `r = q^2/(1 - q^2)`, `c = z/(L P)`, `s^2 = 1 - c^2` and
    ///
    /// ```text
    /// g = s^2 (r (1 - 1/Q) + 1 - P/Q)      f = e (s^2/Q + c^2/P)      a = (g + f)/(1 + f)
    /// ```
    ///
    /// the logarithmic derivatives by `m` are `sag - r` for the sag and `-a` for the length, so that
    /// `m` falls as the cable gets longer, and `-dF/dm` points along
    ///
    /// ```text
    /// -( x B (1 + e a/(1 + r))/(1 + e a) (1 + e sag/Q)^2,   z - q L P^2 a/(1 + e a) )
    /// ```
    ///
    /// with `B = 1/((1 - q^2) (1 + sag)^2) = (sinh(t)/t)^2` for `q = tanh t`. `q` and `B` are monotone
    /// along the curve, so their ranges follow from the ends. On a taut cable everything but `x` and `z`
    /// is a small correction: a stretch over any range of tensions has a thin direction.
    ///
    /// With `l = 1/q - 1/atanh(q) = sag/(q (1 + sag))`, which rises with `q`, the offset is
    ///
    /// ```text
    /// (x Fz - z Fx)/d = (x w/(2 d)) (L + z l/P 1/(1 + e/(1 + sag)))
    /// ```
    fn course(model: &Self::Enclosing, stretch: &Stretch<'_, Shape>) -> Course {
        let one = Interval::one();
        let length = stretch.hull.rest_length_m;
        let [a, b] = stretch.ends;
        // e = m L/EA, and both m and L are monotone.
        let strain = a.strain_per_m.hull(b.strain_per_m) * length;
        let (q, sag) = (a.q.hull(b.q), a.sag.hull(b.sag));
        let (bend, room) = (a.bend.hull(b.bend), a.room.hull(b.room));
        let unit = Interval::new(0.0, 1.0);
        let (x, z) = (stretch.span_m.x, stretch.span_m.y);
        let p = one + strain;
        let (per_p, per_wide) = (one / p, one / (p + sag));
        let c_sq = (z * per_p / length).square().intersection(unit).unwrap_or(unit);
        let s_sq = one - c_sq;
        let f = strain * (s_sq * per_wide + c_sq * per_p);
        let sag_share = one - one / (one + sag * per_p); // 1 - P/Q
        let fall = (s_sq * (room * (one - per_wide) + sag_share) + f) / (one + f);
        let stretched = one + strain * fall;
        let open = one / (one + room); // 1 - q^2
        let x_share = ((one + strain * open * fall) / stretched).intersection(unit).unwrap_or(unit);
        let widening = (one + strain * sag * per_wide).square();
        // a/(1 + e a) rises with a and falls with e.
        let at = |fall: f64| {
            let fall = Interval::point(fall);
            fall / (one + strain * fall)
        };
        let share = at(fall.low()).hull(at(fall.high()));
        let lift = a.langevin.hull(b.langevin) * per_p / (one + strain / (one + sag));
        let (distance, _) = Interval::hypot_with_excess(x, z);
        Course {
            direction: Vector2::new(
                -(x * bend * x_share * widening),
                q * length * p.square() * share - z,
            ),
            offset_n: Interval::point(0.5)
                * model.weight_n_m
                * (x / distance)
                * (length + z * lift),
        }
    }
}

/// A point of the catenary's force curve in the numbers that are monotone along it.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// `W/S`.
    q: Interval,
    /// `q^2/(1 - q^2)`.
    room: Interval,
    /// `atanh(q)/q - 1`.
    sag: Interval,
    /// `1/((1 - q^2) (1 + sag)^2)`.
    bend: Interval,
    /// `sag/(q (1 + sag))`.
    langevin: Interval,
    /// `S/(2 EA L)`, 1/m.
    strain_per_m: Interval,
}

impl Shape {
    fn of(model: &IrvineCatenary<Interval>, state: &CableState<Interval>) -> Self {
        let one = Interval::one();
        let weight = model.weight_n_m * state.rest_length_m;
        let force = state.force_n;
        let (tension_b, excess_b) = Interval::hypot_with_excess(force.x, force.y);
        let (tension_a, excess_a) = Interval::hypot_with_excess(force.x, weight - force.y);
        let sum = tension_a + tension_b;
        let per_sum = one / sum;
        let q = weight * per_sum;
        let gap = (excess_a + excess_b) * per_sum;
        let open = gap * (one + q);
        let sag = q.square() * Interval::atanh_tail(q, gap);
        let strain = Interval::point(0.5) * model.compliance_per_n * sum;
        Self {
            q,
            room: q.square() / open,
            sag,
            bend: one / (open * (one + sag).square()),
            langevin: sag / (q * (one + sag)),
            strain_per_m: strain / state.rest_length_m,
        }
    }
}

impl Provable for Parabola<f64> {
    type Enclosing = Parabola<Interval>;
    type Moving = Parabola<Dual>;
    type End = ();

    fn enclosing(&self) -> Self::Enclosing {
        Parabola {
            weight_n_m: Interval::point(self.weight_n_m),
            compliance_per_n: Interval::point(self.compliance_per_n),
        }
    }

    fn moving(&self) -> Self::Moving {
        Parabola {
            weight_n_m: Dual::point(self.weight_n_m),
            compliance_per_n: Dual::point(self.compliance_per_n),
        }
    }

    fn end(_model: &Self::Enclosing, _state: &CableState<Interval>) {}

    /// `F - (wL/2) z` points along the chord, so the offset is known. Its size `M` falls as the cable
    /// gets longer; with `g = dT_m/dM` at fixed weight,
    ///
    /// ```text
    /// dF/dL = -r (x, z)/d + (w/2) z,      r = (M/L) (g M/T_m^2 + 1/EA)/((1 - g M/T_m)/T_m + 1/EA)
    /// ```
    ///
    /// `1/T_m = d/(L M) - 1/EA`, because the cable ends where it should.
    fn course(model: &Self::Enclosing, stretch: &Stretch<'_, ()>) -> Course {
        let one = Interval::one();
        let (x, z) = (stretch.span_m.x, stretch.span_m.y);
        let (distance, _) = Interval::hypot_with_excess(x, z);
        let (cx, cz) = (x / distance, z / distance);
        let half_weight = Interval::point(0.5) * model.weight_n_m;
        let CableState { force_n, rest_length_m } = stretch.hull;
        let pull = force_n.x / cx;
        let mean = Parabola::mean_tension(force_n, model.weight_n_m * rest_length_m);
        let growth = mean.by_force.x * cx + mean.by_force.y * cz;
        let positive = Interval::new(0.0, f64::INFINITY);
        let part = |i: Interval| i.intersection(positive).unwrap_or(positive);
        let by_closing = distance / (rest_length_m * pull) - model.compliance_per_n;
        let per_mean = (one / mean.mean_n).intersection(by_closing).unwrap_or(by_closing);
        let turn = part(growth) * pull * per_mean;
        let rate = pull / rest_length_m * (turn * per_mean + model.compliance_per_n)
            / (part(one - turn) * per_mean + model.compliance_per_n);
        // Divided by the larger of the two parts.
        let direction = if rate.magnitude() < half_weight.magnitude() {
            Vector2::new(-(rate * cx), half_weight - rate * cz)
        } else {
            Vector2::new(-cx, half_weight / rate - cz)
        };
        Course { direction, offset_n: half_weight * cx * rest_length_m }
    }
}

impl Provable for LinearElastic<f64> {
    type Enclosing = LinearElastic<Interval>;
    type Moving = LinearElastic<Dual>;
    type End = ();

    fn enclosing(&self) -> Self::Enclosing {
        LinearElastic { compliance_per_n: Interval::point(self.compliance_per_n) }
    }

    fn moving(&self) -> Self::Moving {
        LinearElastic { compliance_per_n: Dual::point(self.compliance_per_n) }
    }

    fn end(_model: &Self::Enclosing, _state: &CableState<Interval>) {}
    /// A massless cable pulls along the chord.
    fn course(_model: &Self::Enclosing, stretch: &Stretch<'_, ()>) -> Course {
        Course { direction: -stretch.span_m, offset_n: Interval::zero() }
    }
}
