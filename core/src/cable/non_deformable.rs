//! The non-deformable cable: the limit that all models share.

use nalgebra::Vector2;

use super::{CableModel, EndPoint, LinearElastic};
use crate::line::{LineFault, LineSolution};
use crate::{Real, Scalar};

/// Massless and inextensible: a straight line of length `L` (the paper's equation 3).
///
/// Its force does not follow from its length: `L` equal to the distance fits every tension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NonDeformable;

impl<T: Scalar> CableModel<T> for NonDeformable {
    #[inline]
    fn end_point(&self, force_n: Vector2<T>, rest_length_m: T) -> EndPoint<T> {
        LinearElastic { compliance_per_n: T::zero() }.end_point(force_n, rest_length_m)
    }

    fn weight_n_m(&self) -> T {
        T::zero()
    }

    fn at_deformation(&self, _s: T) -> Self {
        *self
    }

    /// Never a force: [`LineFault::Limp`] or [`LineFault::TooShort`].
    fn force_at_length(
        &self,
        x_m: T,
        z_m: T,
        rest_length_m: T,
    ) -> Result<LineSolution<T>, LineFault>
    where
        T: Real,
    {
        LinearElastic { compliance_per_n: T::zero() }.force_at_length(x_m, z_m, rest_length_m)
    }
}
