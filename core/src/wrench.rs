//! The external wrench on the platform.

use nalgebra::Vector3;

use crate::{Pose, Scalar};

/// Force and moment on the platform, world axes, moment about the platform origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench<T: Scalar> {
    /// Force, N.
    pub force_n: Vector3<T>,
    /// Moment about the platform origin, N m.
    pub moment_nm: Vector3<T>,
}

/// What the platform carries, from which the wrench at any pose follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load<T: Scalar> {
    /// Mass of platform and payload, kg.
    pub mass_kg: T,
    /// Centre of mass, platform frame, m. It need not be the platform origin.
    pub center_of_mass_m: Vector3<T>,
    /// Gravity, m/s^2, positive, acting along world -z.
    pub gravity_m_s2: T,
    /// Any further force, applied at the platform origin, world axes, N.
    pub force_n: Vector3<T>,
    /// Any further moment, world axes, N m.
    pub moment_nm: Vector3<T>,
}

impl<T: Scalar> Load<T> {
    /// The wrench of this load at `pose`.
    pub fn wrench(&self, pose: &Pose<T>) -> Wrench<T> {
        let weight = Vector3::new(T::zero(), T::zero(), -(self.mass_kg * self.gravity_m_s2));
        let arm = pose.turn(&self.center_of_mass_m);
        Wrench { force_n: weight + self.force_n, moment_nm: arm.cross(&weight) + self.moment_nm }
    }

    /// How the moment of this load changes when the platform at `pose` turns: its force does not.
    pub(crate) fn moment_rate_nm_s(
        &self,
        pose: &Pose<T>,
        angular_rad_s: &Vector3<T>,
    ) -> Vector3<T> {
        let weight_n = self.mass_kg * self.gravity_m_s2;
        let turn = angular_rad_s.cross(&pose.turn(&self.center_of_mass_m));
        Vector3::new(-(turn.y * weight_n), turn.x * weight_n, T::zero())
    }
}
