//! One inverse-kinematics problem: a robot, its load, a pose, and the limits of its cables.

use cdpr_core::statics::Balance;
use cdpr_core::{
    CABLES, CableModel, GeometryFault, IrvineCatenary, LinearElastic, Load, NonDeformable,
    Parabola, Pose, Robot,
};

use crate::robot_file::{CableLimits, CableMaterial};

/// Part of the load that counts as a force even in a cable without any.
pub(crate) const LEAST_FORCE: f64 = 1e-3;

/// A robot with cable model `M` at one pose.
#[derive(Clone, Debug)]
pub struct Problem<M> {
    /// The robot.
    pub robot: Robot<f64, M>,
    /// Equilibrium of its platform at the pose.
    pub balance: Balance<f64>,
    /// Limits of each cable.
    pub limits: [CableLimits; CABLES],
}

impl<M: CableModel<f64>> Problem<M> {
    /// The problem of `robot` with `load` at `pose`.
    ///
    /// # Errors
    /// [`GeometryFault::AttachmentOnAnchor`] when a cable has no direction at this pose.
    pub fn new(
        robot: Robot<f64, M>,
        load: &Load<f64>,
        pose: &Pose<f64>,
        limits: [CableLimits; CABLES],
    ) -> Result<Self, GeometryFault> {
        let balance = Balance::at(&robot, load, pose)?;
        Ok(Self { robot, balance, limits })
    }

    /// The model of one cable.
    #[must_use]
    pub fn model(&self, cable: usize) -> &M {
        &self.robot.cables()[cable].model
    }
}

/// A cable model that can be made from the material in a robot file.
pub trait FromMaterial: CableModel<f64> {
    /// The model of a cable of `material` under gravity.
    fn from_material(material: &CableMaterial, gravity_m_s2: f64) -> Self;
}

impl FromMaterial for IrvineCatenary<f64> {
    fn from_material(material: &CableMaterial, gravity_m_s2: f64) -> Self {
        Self {
            weight_n_m: material.linear_density_kg_m * gravity_m_s2,
            compliance_per_n: 1.0 / material.axial_stiffness_n,
        }
    }
}

impl FromMaterial for Parabola<f64> {
    fn from_material(material: &CableMaterial, gravity_m_s2: f64) -> Self {
        Self {
            weight_n_m: material.linear_density_kg_m * gravity_m_s2,
            compliance_per_n: 1.0 / material.axial_stiffness_n,
        }
    }
}

impl FromMaterial for LinearElastic<f64> {
    fn from_material(material: &CableMaterial, _gravity_m_s2: f64) -> Self {
        Self { compliance_per_n: 1.0 / material.axial_stiffness_n }
    }
}

impl FromMaterial for NonDeformable {
    fn from_material(_material: &CableMaterial, _gravity_m_s2: f64) -> Self {
        Self
    }
}
