//! The elastic catenary (H. M. Irvine, Cable Structures, 1981; the paper's equation 2).

use nalgebra::{Matrix2x3, Vector2};

use super::tension_profile::TensionProfile;
use super::{CableModel, EndPoint};
use crate::line::{self, LineFault, LineSolution};
use crate::{Real, Scalar};

/// Elastic catenary: a cable with weight and linear stretch.
///
/// The paper's equation (2) is misprinted (`Fx` is missing under `Fz` in the arcsinh) and cancels
/// for taut cables. The same map in the elliptic coordinates `q`, `c` of the force, with
/// `S = T_A + T_B` and `e = S / (2 EA)` the mean strain of the ends, does not:
///
/// ```text
/// X = (2 L / S) Fx (atanh(q)/q + e)        Z = L c (1 + e)
/// ```
///
/// It is regular at `w = 0` (massless elastic cable), at `1/EA = 0` (inextensible) and at both (the
/// non-deformable cable). The only singular points are those where the tension vanishes along the
/// cable: `Fx = 0` with `0 <= Fz <= w L`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IrvineCatenary<T> {
    /// Weight per rest length, N/m.
    pub weight_n_m: T,
    /// Reciprocal axial stiffness `1/EA`, 1/N. Zero: inextensible.
    pub compliance_per_n: T,
}

impl<T: Scalar> CableModel<T> for IrvineCatenary<T> {
    /// With `e` and `sag = atanh(q)/q - 1` the derivatives are sums of terms of one sign:
    ///
    /// ```text
    /// dX/dFx = (2L/S) (e + sag + c^2 (1 - q^2) / (1 - q^2 c^2))
    /// dX/dFz = dZ/dFx = -(2L/S) (2 Fx/S) c / (1 - q^2 c^2)
    /// dZ/dFz = (2L/S) (e + (1 - c^2) / (1 - q^2 c^2)),      1 - c^2 = (2 Fx/S)^2 / (1 - q^2)
    /// ```
    #[inline]
    fn end_point(&self, force_n: Vector2<T>, rest_length_m: T) -> EndPoint<T> {
        let one = T::one();
        let profile = TensionProfile::new(force_n, self.weight_n_m * rest_length_m);
        let sag = profile.sag();
        let two_inverse_sum = profile.inverse_sum + profile.inverse_sum;
        // L / (S/2), the compliance of a massless cable sideways.
        let lateral = rest_length_m * two_inverse_sum;
        let strain = self.compliance_per_n / two_inverse_sum;
        let (c, balance) = (profile.slope, profile.balance);
        let across = force_n.x * two_inverse_sum; // 2 Fx / S
        let c_balance = c * balance;
        let x_fx = lateral * (strain + sag + c * c_balance * profile.openness());
        let cross = -(lateral * (across * c_balance));
        let z_fz = lateral * (strain + across * (across / profile.openness()) * balance);
        let per_length = self.compliance_per_n + profile.inverse_tension_a;
        EndPoint {
            position_m: Vector2::new(
                rest_length_m * (across * (one + sag + strain)),
                rest_length_m * (c * (one + strain)),
            ),
            jacobian: Matrix2x3::new(
                x_fx,
                cross,
                profile.force_a.x * per_length,
                cross,
                z_fz,
                profile.force_a.y * per_length,
            ),
        }
    }

    fn weight_n_m(&self) -> T {
        self.weight_n_m
    }

    fn at_deformation(&self, s: T) -> Self {
        Self { weight_n_m: self.weight_n_m * s, compliance_per_n: self.compliance_per_n * s }
    }

    /// One equation for `S` (see [`line::catenary_force`]); at most
    /// [`line::root_iteration_bound`] iterations, usually 3 to 5.
    fn force_at_length(
        &self,
        x_m: T,
        z_m: T,
        rest_length_m: T,
    ) -> Result<LineSolution<T>, LineFault>
    where
        T: Real,
    {
        line::catenary_force(self, x_m, z_m, rest_length_m)
    }
}
