//! Tension along a hanging cable, in the coordinates in which nothing cancels.

use nalgebra::Vector2;

use crate::Scalar;

/// Tensions at both ends of a cable under its own weight, and the two numbers that fix its shape.
///
/// With `W` the weight of the cable, `S = T_A + T_B` is the sum of the distances of `F` from the
/// points `0` and `W z`, so `(S, c)` are elliptic coordinates of `F`:
///
/// ```text
/// q = W / S,   c = (2 Fz - W) / S,   4 Fx^2 = (S^2 - W^2) (1 - c^2),   4 T_A T_B = S^2 (1 - q^2 c^2)
/// ```
///
/// `q = 0` is a massless (or taut) cable, `q -> 1` a slack one. `c` is the mean slope: on a cable
/// that does not stretch, `Z = c L`.
pub(super) struct TensionProfile<T: Scalar> {
    /// Tension vector at the anchor, `(Fx, Fz - W)`, N.
    pub(super) force_a: Vector2<T>,
    /// `S`, N.
    pub(super) sum: T,
    /// `1 / S`, 1/N.
    pub(super) inverse_sum: T,
    /// `1 / T_A`, 1/N.
    pub(super) inverse_tension_a: T,
    /// `q`.
    pub(super) q: T,
    /// `1 - q` without cancellation, from the excesses `T_B - Fz` and `T_A + (Fz - W)`.
    pub(super) gap: T,
    /// `c`.
    pub(super) slope: T,
    /// `1 / (1 - q^2 c^2) = S^2 / (4 T_A T_B)`.
    pub(super) balance: T,
    /// `(atanh(q)/q - 1) / q^2`.
    pub(super) tail: T,
}

impl<T: Scalar> TensionProfile<T> {
    // With the end point that it is a part of.
    #[allow(clippy::inline_always)]
    #[inline(always)]
    pub(super) fn new(force_n: Vector2<T>, weight_n: T) -> Self {
        let force_a = Vector2::new(force_n.x, force_n.y - weight_n);
        let (tension_b, excess_b) = T::hypot_with_excess(force_n.x, force_n.y);
        let (tension_a, excess_a) = T::hypot_with_excess(force_n.x, -force_a.y);
        let sum = tension_a + tension_b;
        let inverse_sum = T::one() / sum;
        let inverse_product = T::one() / (tension_a * tension_b);
        let q = weight_n * inverse_sum;
        let gap = (excess_a + excess_b) * inverse_sum;
        Self {
            force_a,
            sum,
            inverse_sum,
            inverse_tension_a: tension_b * inverse_product,
            q,
            gap,
            slope: (force_n.y + force_a.y) * inverse_sum,
            balance: T::constant(0.25) * sum * sum * inverse_product,
            tail: T::atanh_tail(q, gap),
        }
    }

    /// `atanh(q)/q - 1`: `1 + sag` is the mean of `1/T` over the cable times `S/2`.
    #[inline]
    pub(super) fn sag(&self) -> T {
        self.q * self.q * self.tail
    }

    /// `(1 - q^2) = gap (1 + q)`.
    #[inline]
    pub(super) fn openness(&self) -> T {
        self.gap * (T::one() + self.q)
    }
}
