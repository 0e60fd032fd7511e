//! What a proof needs of a cable model: the same model in intervals, and the direction of its force
//! curve between two points.

use cdpr_core::{CableModel, CableState, IrvineCatenary, LinearElastic, Parabola, Scalar};
use nalgebra::Vector2;
use num_traits::One;

use crate::interval::Interval;

/// Part of a force curve: its two ends, and a box that holds it.
#[derive(Clone, Copy, Debug)]
pub struct Stretch<'a> {
    /// Attachment relative to the anchor, `(x, z)` in the plane of the cable, m.
    pub span_m: Vector2<Interval>,
    /// The end with the shorter rest length.
    pub shorter: &'a CableState<Interval>,
    /// The end with the longer rest length.
    pub longer: &'a CableState<Interval>,
    /// Holds every force and rest length between the two.
    pub hull: CableState<Interval>,
}

/// A cable model with which proofs can be made.
///
/// A model that is written in a generic [`Scalar`] needs only [`Provable::enclosing`].
pub trait Provable: CableModel<f64> {
    /// The same model in interval arithmetic.
    type Enclosing: CableModel<Interval>;

    /// The model whose parameters are the parameters of this one, as intervals.
    fn enclosing(&self) -> Self::Enclosing;

    /// A vector along the force curve, towards longer cables, of any positive length that may differ
    /// from point to point: its components enclose those at every point of the stretch.
    ///
    /// The default holds for every model, `-adj(K) b` with `K`, `b` the derivative of the end point
    /// by force and length. On a taut cable it loses the direction unless the stretch is short,
    /// because `K` changes with the tension; a model that knows better is searched faster.
    fn direction(model: &Self::Enclosing, stretch: &Stretch<'_>) -> Vector2<Interval> {
        let j = model.end_point(stretch.hull.force_n, stretch.hull.rest_length_m).jacobian;
        Vector2::new(j.m12 * j.m23 - j.m13 * j.m22, j.m13 * j.m21 - j.m11 * j.m23)
    }

    /// The component of the force across the line from anchor to attachment, `(x Fz - z Fx)/d`, at
    /// every point of the stretch, N. The default knows nothing of it.
    fn offset_n(_model: &Self::Enclosing, _stretch: &Stretch<'_>) -> Interval {
        Interval::ENTIRE
    }
}

impl Provable for IrvineCatenary<f64> {
    type Enclosing = IrvineCatenary<Interval>;

    fn enclosing(&self) -> Self::Enclosing {
        IrvineCatenary {
            weight_n_m: Interval::point(self.weight_n_m),
            compliance_per_n: Interval::point(self.compliance_per_n),
        }
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
    fn direction(model: &Self::Enclosing, stretch: &Stretch<'_>) -> Vector2<Interval> {
        let one = Interval::one();
        let length = stretch.hull.rest_length_m;
        let (a, b) = (Shape::of(model, stretch.shorter), Shape::of(model, stretch.longer));
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
        Vector2::new(-(x * bend * x_share * widening), q * length * p.square() * share - z)
    }

    /// In the same numbers, with `l = 1/q - 1/atanh(q) = sag/(q (1 + sag))`, which rises with `q`:
    ///
    /// ```text
    /// (x Fz - z Fx)/d = (x w/(2 d)) (L + z l/P 1/(1 + e/(1 + sag)))
    /// ```
    fn offset_n(model: &Self::Enclosing, stretch: &Stretch<'_>) -> Interval {
        let one = Interval::one();
        let length = stretch.hull.rest_length_m;
        let (a, b) = (Shape::of(model, stretch.shorter), Shape::of(model, stretch.longer));
        let strain = a.strain_per_m.hull(b.strain_per_m) * length;
        let langevin = |s: &Shape| s.sag / (s.q * (one + s.sag));
        let lift = langevin(&a).hull(langevin(&b)) / (one + strain);
        let lift = lift / (one + strain / (one + a.sag.hull(b.sag)));
        let (x, z) = (stretch.span_m.x, stretch.span_m.y);
        let (distance, _) = Interval::hypot_with_excess(x, z);
        Interval::point(0.5) * model.weight_n_m * (x / distance) * (length + z * lift)
    }
}

/// A point of the catenary's force curve in the numbers that are monotone along it.
struct Shape {
    /// `W/S`.
    q: Interval,
    /// `q^2/(1 - q^2)`.
    room: Interval,
    /// `atanh(q)/q - 1`.
    sag: Interval,
    /// `1/((1 - q^2) (1 + sag)^2)`.
    bend: Interval,
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
            strain_per_m: strain / state.rest_length_m,
        }
    }
}

impl Provable for Parabola<f64> {
    type Enclosing = Parabola<Interval>;

    fn enclosing(&self) -> Self::Enclosing {
        Parabola {
            weight_n_m: Interval::point(self.weight_n_m),
            compliance_per_n: Interval::point(self.compliance_per_n),
        }
    }
}

impl Provable for LinearElastic<f64> {
    type Enclosing = LinearElastic<Interval>;

    fn enclosing(&self) -> Self::Enclosing {
        LinearElastic { compliance_per_n: Interval::point(self.compliance_per_n) }
    }

    /// A massless cable pulls along the chord.
    fn direction(_model: &Self::Enclosing, stretch: &Stretch<'_>) -> Vector2<Interval> {
        -stretch.span_m
    }
}
