//! The six equations of equilibrium at one pose.
//!
//! Cable `i` with the force `F = (Fx, Fz)` on it at the attachment acts on the platform with
//! `f = -(Fx e + Fz z)` at the lever arm `r`, that is with the wrench `G F = (f, r x f)`. Moments
//! are divided by the robot's moment arm, so that all six rows are newtons and the condition number
//! of a 6x6 matrix of columns `G q` does not depend on the unit of length.

use nalgebra::{Vector2, Vector6};

use crate::{CABLES, CablePlane, GeometryFault, Load, Pose, Real, Robot, Scalar};

/// Equilibrium of the platform at one pose: the planes of the cables and the external wrench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance<T: Scalar> {
    planes: [CablePlane<T>; CABLES],
    wrench_n: Vector6<T>,
}

impl<T: Real> Balance<T> {
    /// The equilibrium of `robot` with `load` at `pose`.
    ///
    /// A cable that is exactly vertical here is given the world x axis as its direction; use
    /// [`Balance::at_next`] on a path.
    ///
    /// # Errors
    /// [`GeometryFault::AttachmentOnAnchor`].
    pub fn at<M>(
        robot: &Robot<T, M>,
        load: &Load<T>,
        pose: &Pose<T>,
    ) -> Result<Self, GeometryFault> {
        Self::with_directions(robot, load, pose, |_| Vector2::new(T::one(), T::zero()))
    }

    /// The same at the next pose of a path: an exactly vertical cable keeps its direction.
    ///
    /// # Errors
    /// [`GeometryFault::AttachmentOnAnchor`].
    pub fn at_next<M>(
        &self,
        robot: &Robot<T, M>,
        load: &Load<T>,
        pose: &Pose<T>,
    ) -> Result<Self, GeometryFault> {
        Self::with_directions(robot, load, pose, |i| self.planes[i].direction)
    }

    fn with_directions<M>(
        robot: &Robot<T, M>,
        load: &Load<T>,
        pose: &Pose<T>,
        previous: impl Fn(usize) -> Vector2<T>,
    ) -> Result<Self, GeometryFault> {
        let cables = robot.cables();
        let planes =
            core::array::from_fn(|i| CablePlane::new(robot, &cables[i], pose, previous(i)));
        // Closer than rounding of the coordinates can tell, the direction is noise.
        let coordinates =
            pose.position_m().iter().fold(robot.moment_arm_m(), |m, c| m.max(c.abs()));
        let apart = T::constant(8.0) * T::EPSILON * coordinates;
        let touching = |plane: &CablePlane<T>| plane.x_m.max(plane.z_m.abs()) <= apart;
        if let Some(i) = planes.iter().position(touching) {
            return Err(GeometryFault::AttachmentOnAnchor(i));
        }
        Ok(Self { planes, wrench_n: wrench_n(robot, load, pose).into() })
    }
}

/// The external wrench at `pose`: force, then moment over the moment arm, N.
#[inline]
pub(crate) fn wrench_n<T: Real, M>(
    robot: &Robot<T, M>,
    load: &Load<T>,
    pose: &Pose<T>,
) -> [T; CABLES] {
    let wrench = load.wrench(pose);
    let (f, m) = (wrench.force_n, wrench.moment_nm * robot.per_moment_arm_m());
    [f.x, f.y, f.z, m.x, m.y, m.z]
}

impl<T: Scalar> Balance<T> {
    /// The planes of the six cables.
    pub fn planes(&self) -> &[CablePlane<T>; CABLES] {
        &self.planes
    }

    /// The external wrench: force, then moment over the moment arm, N.
    pub fn wrench_n(&self) -> &Vector6<T> {
        &self.wrench_n
    }

    /// `sum G F + wrench`: what is left over, zero at equilibrium, N.
    pub fn residual_n(&self, forces_n: &[Vector2<T>; CABLES]) -> Vector6<T> {
        let mut sum = self.wrench_n;
        for (plane, force) in self.planes.iter().zip(forces_n) {
            sum += plane.wrench_n(force);
        }
        sum
    }
}

impl<T: Scalar> CablePlane<T> {
    /// `G F`: what the cable does to the platform when `force_n` acts on it at the attachment
    /// (force, then moment over the moment arm, N). Linear in `force_n`.
    #[inline]
    pub fn wrench_n(&self, force_n: &Vector2<T>) -> Vector6<T> {
        let (e, r) = (&self.direction, &self.lever_arm);
        let (fx, fy, fz) = (-(force_n.x * e.x), -(force_n.x * e.y), -force_n.y);
        Vector6::new(fx, fy, fz, r.y * fz - r.z * fy, r.z * fx - r.x * fz, r.x * fy - r.y * fx)
    }
}

#[cfg(test)]
mod tests {
    use libm::{cos, sin};
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use crate::Cable;

    #[test]
    fn residual_is_the_sum_of_forces_and_moments() {
        let cables = core::array::from_fn(|i| {
            let i = i as f64;
            Cable {
                anchor_m: Vector3::new(3.0 * sin(i) + i, 4.0 * cos(2.0 * i), 8.0 - i),
                attachment_m: Vector3::new(cos(1.0 + i), sin(3.0 * i), 0.1 * i * i),
                model: (),
            }
        });
        let robot = Robot::new(cables).unwrap();
        let pose = Pose::new(
            Vector3::new(1.0, 2.0, 3.0),
            UnitQuaternion::from_scaled_axis(Vector3::new(0.1, 0.2, -0.3)),
        )
        .unwrap();
        let load = Load {
            mass_kg: 10.0,
            center_of_mass_m: Vector3::new(0.1, -0.2, 0.3),
            gravity_m_s2: 9.81,
            force_n: Vector3::new(1.0, 2.0, 3.0),
            moment_nm: Vector3::new(-4.0, 5.0, 6.0),
        };
        let balance = Balance::at(&robot, &load, &pose).unwrap();
        let forces: [_; CABLES] =
            core::array::from_fn(|i| Vector2::new(10.0 + i as f64, i as f64 - 7.0));
        let residual = balance.residual_n(&forces);

        // The same by forces and moments about the world origin.
        let mut force = load.force_n;
        let mut moment = pose.position_m().cross(&load.force_n) + load.moment_nm;
        let weight = Vector3::new(0.0, 0.0, -98.1);
        force += weight;
        moment += (pose.position_m() + pose.turn(&load.center_of_mass_m)).cross(&weight);
        for (i, f) in forces.iter().enumerate() {
            let point = pose.position_m() + pose.turn(&cables[i].attachment_m);
            let mut horizontal = point - cables[i].anchor_m;
            horizontal.z = 0.0;
            let pull = -(horizontal.normalize() * f.x + Vector3::z() * f.y);
            force += pull;
            moment += point.cross(&pull);
        }
        moment -= pose.position_m().cross(&force);
        assert!((residual.fixed_rows::<3>(0) - force).amax() < 1e-13);
        assert!((residual.fixed_rows::<3>(3) * robot.moment_arm_m() - moment).amax() < 1e-12);
    }
}
