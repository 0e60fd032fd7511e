//! The force curve: for a fixed pose each cable has one degree of freedom left.
//!
//! As the rest length grows, the force at the attachment runs along a plane curve, from tension
//! without bound along the chord, through a bend, to a nearly vertical pull. A [`CurvePoint`] is
//! what one Newton step needs of it, at a state that need not be on it exactly: the way back to the
//! curve and the direction along it.

use nalgebra::Vector2;

use crate::{EndPoint, Real, Scalar};

/// Force and rest length of one cable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CableState<T: Scalar> {
    /// Force on the cable at the attachment, `(Fx, Fz)` in its plane, N.
    pub force_n: Vector2<T>,
    /// Rest (unstretched) length, m.
    pub rest_length_m: T,
}

impl<T: Scalar> CableState<T> {
    /// Tension at the attachment, N.
    pub fn tension_at_attachment_n(&self) -> T {
        T::hypot_with_excess(self.force_n.x, self.force_n.y).0
    }

    /// Tension at the anchor of a cable that weighs `weight_n_m`, N.
    pub fn tension_at_anchor_n(&self, weight_n_m: T) -> T {
        T::hypot_with_excess(self.force_n.x, self.force_n.y - weight_n_m * self.rest_length_m).0
    }
}

/// The force curve linearised at a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint<T: Scalar> {
    /// Unit tangent of the curve in the force plane, towards longer cables.
    pub tangent: Vector2<T>,
    /// Change of the rest length per newton along the tangent, m/N, never negative.
    pub length_per_force_m_n: T,
    /// Shortest way back to the curve: change of the force, N.
    pub correction_n: Vector2<T>,
    /// Shortest way back to the curve: change of the rest length, m.
    pub length_correction_m: T,
}

impl<T: Real> CurvePoint<T> {
    /// Linearises the curve of a cable that should end at `(x_m, z_m)` and at `state` ends at `end`.
    ///
    /// With `r1`, `r2` the rows of the derivative in the unknowns `F/s_F` and `L/s_L`
    /// (`s_F = |Fx| + |Fz|`, `s_L = L`), the tangent is `t = r1 x r2` and the minimum-norm solution
    /// of `r1 . d = -g1`, `r2 . d = -g2` is `d = t x (g1 r2 - g2 r1) / |t|^2`. No inverse of the
    /// compliance appears, so massless and inextensible cables are covered.
    ///
    /// At a singular point, where the tension vanishes somewhere, the result is not finite: see
    /// [`CurvePoint::is_finite`].
    // Left to the compiler this stays a call whose result goes through memory: 2 % of a step.
    #[allow(clippy::inline_always)]
    #[inline(always)]
    pub fn new(end: &EndPoint<T>, x_m: T, z_m: T, state: &CableState<T>) -> Self {
        let force_scale = state.force_n.x.abs() + state.force_n.y.abs();
        let length_scale = state.rest_length_m;
        // Dividing the rows by the length as well makes every entry a number around one or below.
        let per_length = T::one() / length_scale;
        let scale = force_scale * per_length;
        let j = &end.jacobian;
        let r1 = [j.m11 * scale, j.m12 * scale, j.m13];
        let r2 = [j.m21 * scale, j.m22 * scale, j.m23];
        let t = cross(&r1, &r2);
        let force_part_sq = t[0] * t[0] + t[1] * t[1];
        let inverse_square = T::one() / (force_part_sq + t[2] * t[2]);
        let g1 = (end.position_m.x - x_m) * per_length * inverse_square;
        let g2 = (end.position_m.y - z_m) * per_length * inverse_square;
        let skew = core::array::from_fn(|k| g1 * r2[k] - g2 * r1[k]);
        let back = cross(&t, &skew);
        let inverse_force_part = T::one() / force_part_sq.sqrt();
        Self {
            tangent: Vector2::new(t[0] * inverse_force_part, t[1] * inverse_force_part),
            length_per_force_m_n: t[2] * inverse_force_part * (length_scale / force_scale),
            correction_n: Vector2::new(back[0] * force_scale, back[1] * force_scale),
            length_correction_m: back[2] * length_scale,
        }
    }

    /// Whether all numbers are finite (or, which never happens to a real cable, their sum overflows).
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let force = self.tangent + self.correction_n;
        // One sum instead of six checks: infinities and NaN do not cancel out of it.
        (force.x + force.y + self.length_per_force_m_n + self.length_correction_m).is_finite()
    }
}

#[inline]
fn cross<T: Scalar>(a: &[T; 3], b: &[T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
