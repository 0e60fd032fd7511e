//! The massless linear elastic cable.

use nalgebra::{Matrix2x3, Vector2};

use super::{CableModel, EndPoint};
use crate::line::{self, LineFault, LineSolution};
use crate::{Real, Scalar};

/// Massless cable with linear stretch: a straight line of length `L (1 + T/EA)`.
///
/// It exerts no force when longer than the distance of its ends; such a cable has no end-point map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearElastic<T> {
    /// Reciprocal axial stiffness `1/EA`, 1/N. Zero: the non-deformable cable.
    pub compliance_per_n: T,
}

impl<T: Scalar> CableModel<T> for LinearElastic<T> {
    #[inline]
    fn end_point(&self, force_n: Vector2<T>, rest_length_m: T) -> EndPoint<T> {
        let (tension, _) = T::hypot_with_excess(force_n.x, force_n.y);
        let inverse_tension = T::one() / tension;
        let unit = force_n * inverse_tension;
        let along = rest_length_m * self.compliance_per_n;
        let lateral = rest_length_m * inverse_tension;
        let stretch = T::one() + self.compliance_per_n * tension;
        let cross = -(lateral * (unit.x * unit.y));
        EndPoint {
            position_m: unit * (rest_length_m * stretch),
            jacobian: Matrix2x3::new(
                along + lateral * (unit.y * unit.y),
                cross,
                unit.x * stretch,
                cross,
                along + lateral * (unit.x * unit.x),
                unit.y * stretch,
            ),
        }
    }

    fn weight_n_m(&self) -> T {
        T::zero()
    }

    fn at_deformation(&self, s: T) -> Self {
        Self { compliance_per_n: self.compliance_per_n * s }
    }

    /// Closed form: `T = EA (d/L - 1)` along the line.
    ///
    /// # Errors
    /// [`LineFault::Limp`] at `L >= d`; [`LineFault::TooShort`] when it cannot stretch.
    fn force_at_length(
        &self,
        x_m: T,
        z_m: T,
        rest_length_m: T,
    ) -> Result<LineSolution<T>, LineFault>
    where
        T: Real,
    {
        line::check_input(x_m, z_m, rest_length_m)?;
        let (distance, _) = T::hypot_with_excess(x_m, z_m);
        let slack = rest_length_m >= distance;
        if slack {
            return Err(LineFault::Limp);
        }
        let tension = (distance - rest_length_m) / (rest_length_m * self.compliance_per_n);
        if !tension.is_finite() {
            return Err(LineFault::TooShort);
        }
        let force_n = Vector2::new(x_m, z_m) * (tension / distance);
        let solution = line::with_residual(self, x_m, z_m, rest_length_m, force_n, 0);
        if solution.residual_m.is_finite() { Ok(solution) } else { Err(LineFault::OutOfRange) }
    }
}
