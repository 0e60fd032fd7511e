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
///
/// Its two families of directions span all changes of force and rest length: along the curve with
/// the end held, and with the force moving across the curve so that the end moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint<T: Scalar> {
    /// Unit tangent of the curve in the force plane, towards longer cables.
    pub tangent: Vector2<T>,
    /// Change of the rest length per newton along the tangent, m/N, never negative.
    pub length_per_force_m_n: T,
    /// Change of the force across the tangent (along [`CurvePoint::normal`]) per metre that the end
    /// moves in x and in z, N/m.
    pub normal_force_by_end_n_m: Vector2<T>,
    /// Change of the rest length then, per metre in x and in z.
    pub length_by_end: Vector2<T>,
    /// Where the cable ends at the state, less where it should, m.
    pub gap_m: Vector2<T>,
}

impl<T: Real> CurvePoint<T> {
    /// Linearises the curve of a cable that should end at `(x_m, z_m)` and at `state` ends at `end`.
    ///
    /// With `J_F` (columns for Fx, Fz) and `J_L` the derivative of the end, the tangent is
    /// `t = (-J_F^+ J_L, 1)` up to its length, written as the cross product of the two rows of the
    /// derivative. With the force part of `t` of length `|t_F|` and the unit normal `n`,
    /// `(J_F n) x J_L = |t_F|`: the directions across need no other division, and no inverse of the
    /// compliance appears, so massless and inextensible cables are covered.
    ///
    /// At a singular point, where the tension vanishes somewhere, the result is not finite: see
    /// [`CurvePoint::is_finite`].
    // Left to the compiler this stays a call whose result goes through memory: 2 % of a step.
    #[allow(clippy::inline_always)]
    #[inline(always)]
    pub fn new(end: &EndPoint<T>, x_m: T, z_m: T) -> Self {
        let j = &end.jacobian;
        let tx = j.m12 * j.m23 - j.m13 * j.m22;
        let tz = j.m13 * j.m21 - j.m11 * j.m23;
        let per_force = T::one() / (tx * tx + tz * tz).sqrt();
        let tangent = Vector2::new(tx * per_force, tz * per_force);
        // How the end moves when the force moves along the normal (-tangent.y, tangent.x).
        let sideways = Vector2::new(
            j.m12 * tangent.x - j.m11 * tangent.y,
            j.m22 * tangent.x - j.m21 * tangent.y,
        );
        Self {
            tangent,
            length_per_force_m_n: (j.m11 * j.m22 - j.m12 * j.m21) * per_force,
            normal_force_by_end_n_m: Vector2::new(j.m23 * per_force, -(j.m13 * per_force)),
            length_by_end: Vector2::new(-(sideways.y * per_force), sideways.x * per_force),
            gap_m: Vector2::new(end.position_m.x - x_m, end.position_m.y - z_m),
        }
    }

    /// Unit normal of the curve in the force plane: the tangent turned by a right angle to the left.
    #[inline]
    #[must_use]
    pub fn normal(&self) -> Vector2<T> {
        Vector2::new(-self.tangent.y, self.tangent.x)
    }

    /// Change of the force, across the tangent, when the end moves by `end_m`, N.
    #[inline]
    #[must_use]
    pub fn force_by_end(&self, end_m: &Vector2<T>) -> Vector2<T> {
        let by_end = &self.normal_force_by_end_n_m;
        self.normal() * (by_end.x * end_m.x + by_end.y * end_m.y)
    }

    /// Change of the rest length that goes with it, m.
    #[inline]
    #[must_use]
    pub fn length_by_end_m(&self, end_m: &Vector2<T>) -> T {
        self.length_by_end.x * end_m.x + self.length_by_end.y * end_m.y
    }

    /// The way back to the curve, across it: change of the force, N.
    #[inline]
    #[must_use]
    pub fn correction_n(&self) -> Vector2<T> {
        self.force_by_end(&-self.gap_m)
    }

    /// The way back to the curve, across it: change of the rest length, m.
    #[inline]
    #[must_use]
    pub fn length_correction_m(&self) -> T {
        self.length_by_end_m(&-self.gap_m)
    }

    /// Whether all numbers are finite (or, which never happens to a real cable, their sum overflows).
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let across = self.normal_force_by_end_n_m + self.length_by_end + self.gap_m + self.tangent;
        // One sum instead of nine checks: infinities and NaN do not cancel out of it.
        (across.x + across.y + self.length_per_force_m_n).is_finite()
    }
}
