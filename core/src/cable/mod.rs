//! Cable models, each a single map: from the force at the attachment and the rest length to where
//! the cable ends.
//!
//! All physical models come from one integral over the rest length `s` (from the anchor),
//!
//! ```text
//! (X, Z) = int_0^L (1/EA + 1/T(s)) T(s)-vector ds,      T(s)-vector = F - w (L - s) z
//! ```
//!
//! so that the compliance `K = d(X, Z)/dF` is symmetric and positive (semi)definite and
//! `d(X, Z)/dL = (1/EA + 1/T_A) T_A-vector`. Nothing else in this crate depends on which model it is.

mod irvine;
mod linear_elastic;
mod non_deformable;
mod parabola;
mod tension_profile;

pub use irvine::{IrvineCatenary, Slackness};
pub use linear_elastic::LinearElastic;
pub use non_deformable::NonDeformable;
pub use parabola::{MeanTension, Parabola};

use nalgebra::{Matrix2x3, Vector2};

use crate::line::{self, LineFault, LineSolution};
use crate::{Real, Scalar};

/// Where a cable ends, and how that changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndPoint<T: Scalar> {
    /// `(X, Z)`: the attachment relative to the anchor, in the plane of the cable, m.
    pub position_m: Vector2<T>,
    /// Derivative of `(X, Z)` with respect to `Fx`, `Fz` (m/N) and `L` (m/m).
    pub jacobian: Matrix2x3<T>,
}

/// A cable model: the end-point map and what continuation and start-up need to know of it.
///
/// # Contract
/// - `X` is odd in `Fx` and positive for `Fx > 0`; the derivative with respect to `F` has a
///   positive diagonal and a determinant that is not negative.
/// - Results are finite wherever the tension vanishes nowhere along the cable, exactly vertical
///   cables included.
/// - Along the force curve of fixed ends `(x, z)`, `x > 0`, as `L` grows: `Fx` falls; for `z <= 0` `Fz`
///   rises, for `z >= 0` `Fz - wL` falls; and `0 <= x Fz - z Fx <= w L x`, the moment of the weight about
///   the anchor. Proofs of completeness rest on this.
/// - At `s -> 0`, [`at_deformation`](Self::at_deformation) approaches [`NonDeformable`] (the
///   paper's assumption 3, section 2).
pub trait CableModel<T: Scalar>: Copy {
    /// The end-point map at `force_n = (Fx, Fz)`, the force on the cable at the attachment (N), and
    /// the rest length (m). Constant cost, no branches on the values.
    fn end_point(&self, force_n: Vector2<T>, rest_length_m: T) -> EndPoint<T>;

    /// Weight of the cable per rest length, N/m.
    fn weight_n_m(&self) -> T;

    /// The model at deformation `s` in `[0, 1]`: 0 is the non-deformable cable, 1 is `self`.
    #[must_use]
    fn at_deformation(&self, s: T) -> Self;

    /// The same cable with another weight per rest length, N/m, if the model obeys the law of similar
    /// cables: `r` times as long, of `1/r` the weight per length, stretching alike under the same
    /// tension, it ends `r` times as far away under the same force. Every local law of stretch does.
    ///
    /// Proofs about slack cables are much sharper with it: as the weight per length changes their
    /// length does too, and only in the product, the weight of all of it, does that not show. The
    /// default does without.
    #[must_use]
    fn with_weight(&self, _weight_n_m: T) -> Option<Self> {
        None
    }

    /// The force at the attachment of a single cable of given rest length between two given points
    /// (`x_m >= 0`, `z_m`: attachment relative to anchor).
    ///
    /// The default needs only the [contract](Self#contract) and is bounded by
    /// [`line::nested_iteration_bound`]; models with more structure override it.
    ///
    /// # Errors
    /// [`LineFault`] when the input is not physical or no finite force fits.
    fn force_at_length(
        &self,
        x_m: T,
        z_m: T,
        rest_length_m: T,
    ) -> Result<LineSolution<T>, LineFault>
    where
        T: Real,
    {
        line::nested_force(self, x_m, z_m, rest_length_m)
    }
}
