//! A cable model of one's own: a rope that stiffens under load.
//!
//! All that the solvers ask of a model is where the cable ends and how that changes. Here the part
//! that the library knows, an inextensible catenary, is kept, and the stretch is added as an
//! integral of any stress-strain law over the rope:
//!
//! ```text
//! (X, Z) = catenary(F, L) + int_0^L c(T(u)) T(u)-vector du,      T(u)-vector = F - w u z
//! ```
//!
//! with `u` measured from the attachment and `c(T) = strain / T` the secant compliance.

use cdpr_core::{CableModel, CableState, EndPoint, IrvineCatenary, Scalar};
use cdpr_host_sim::complete::Provable;
use cdpr_host_sim::dual::Dual;
use cdpr_host_sim::interval::Interval;
use nalgebra::{Matrix2, Vector2};

/// A fibre rope: strain `c0 T / (1 + T/T0)`, which rises with the tension towards the limit `c0 T0`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StiffeningRope<T> {
    /// Weight per rest length, N/m.
    pub(crate) weight_n_m: T,
    /// Compliance `c0` at small tension, 1/N.
    pub(crate) compliance_per_n: T,
    /// Tension `T0` at which the compliance has halved, N.
    pub(crate) stiffening_n: T,
}

/// Nodes in `[0, 1]` and weights of the Gauss-Legendre rule with five points (Abramowitz and Stegun,
/// table 25.4). The integrand is smooth wherever the tension does not vanish.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668_004, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

impl<T: Scalar> StiffeningRope<T> {
    /// `c(T) T-vector` at the tension vector `force_n`, and its derivative by that vector.
    fn strain(&self, force_n: Vector2<T>) -> (Vector2<T>, Matrix2<T>) {
        let (tension, _) = T::hypot_with_excess(force_n.x, force_n.y);
        let soft = T::one() / (T::one() + tension / self.stiffening_n);
        let compliance = self.compliance_per_n * soft;
        // dc/dT = -c soft / T0, and dT/dF is the unit vector along F.
        let stiffening = -(compliance * soft / self.stiffening_n);
        let unit = force_n / tension;
        let derivative = Matrix2::identity() * compliance + force_n * unit.transpose() * stiffening;
        (force_n * compliance, derivative)
    }
}

impl<T: Scalar> CableModel<T> for StiffeningRope<T> {
    fn end_point(&self, force_n: Vector2<T>, rest_length_m: T) -> EndPoint<T> {
        let catenary = IrvineCatenary { weight_n_m: self.weight_n_m, compliance_per_n: T::zero() };
        let mut end = catenary.end_point(force_n, rest_length_m);
        let tension_vector =
            |u: T| Vector2::new(force_n.x, force_n.y - self.weight_n_m * rest_length_m * u);
        for (node, weight) in GAUSS {
            let (strain, derivative) = self.strain(tension_vector(T::constant(node)));
            let share = rest_length_m * T::constant(weight);
            end.position_m += strain * share;
            end.jacobian.m11 += derivative.m11 * share;
            end.jacobian.m12 += derivative.m12 * share;
            end.jacobian.m21 += derivative.m21 * share;
            end.jacobian.m22 += derivative.m22 * share;
        }
        // By length: the integrand at the anchor.
        let (strain, _) = self.strain(tension_vector(T::one()));
        end.jacobian.m13 += strain.x;
        end.jacobian.m23 += strain.y;
        end
    }

    fn weight_n_m(&self) -> T {
        self.weight_n_m
    }

    fn at_deformation(&self, s: T) -> Self {
        Self {
            weight_n_m: self.weight_n_m * s,
            compliance_per_n: self.compliance_per_n * s,
            stiffening_n: self.stiffening_n,
        }
    }

    /// Its stretch is a matter of the tension alone, so similar ropes are similar.
    fn with_weight(&self, weight_n_m: T) -> Option<Self> {
        Some(Self { weight_n_m, ..*self })
    }
}

impl StiffeningRope<f64> {
    /// The same rope in another kind of number.
    fn map<T>(self, number: impl Fn(f64) -> T) -> StiffeningRope<T> {
        StiffeningRope {
            weight_n_m: number(self.weight_n_m),
            compliance_per_n: number(self.compliance_per_n),
            stiffening_n: number(self.stiffening_n),
        }
    }
}

/// With this the solutions are proven, and every step of a path. (The five nodes of the quadrature are part of the model.)
impl Provable for StiffeningRope<f64> {
    type Enclosing = StiffeningRope<Interval>;
    type Moving = StiffeningRope<Dual>;
    type End = ();

    fn enclosing(&self) -> Self::Enclosing {
        self.map(Interval::point)
    }

    fn moving(&self) -> Self::Moving {
        self.map(Dual::point)
    }

    fn end(_model: &Self::Enclosing, _state: &CableState<Interval>) {}
}
