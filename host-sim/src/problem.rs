//! One inverse-kinematics problem: a robot, its load, a pose, and the limits of its cables.

use cdpr_core::statics::Balance;
use cdpr_core::{
    CABLES, Cable, CableModel, GeometryFault, IrvineCatenary, LinearElastic, Load, NonDeformable,
    Parabola, Pose, Real, Robot,
};
use nalgebra::Vector3;

use crate::robot_file::{CableLimits, CableMaterial, RobotDescription};

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

/// The number type of a controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Precision {
    /// Single, as on a Cortex-M4F.
    #[default]
    F32,
    /// Double, as on a Cortex-M7.
    F64,
}

/// Robot and load as a controller in `T` has them: each number rounded once.
///
/// # Errors
/// [`GeometryFault`]: rounded it is no robot.
#[allow(clippy::type_complexity)] // two things, each with its name in the type
pub fn rounded<T: Real>(
    robot: &Robot<f64, IrvineCatenary<f64>>,
    load: &Load<f64>,
) -> Result<(Robot<T, IrvineCatenary<T>>, Load<T>), GeometryFault> {
    let vector = |v: &Vector3<f64>| v.map(T::constant);
    let cables = robot.cables().map(|cable| Cable {
        anchor_m: vector(&cable.anchor_m),
        attachment_m: vector(&cable.attachment_m),
        model: IrvineCatenary {
            weight_n_m: T::constant(cable.model.weight_n_m),
            compliance_per_n: T::constant(cable.model.compliance_per_n),
        },
    });
    let load = Load {
        mass_kg: T::constant(load.mass_kg),
        center_of_mass_m: vector(&load.center_of_mass_m),
        gravity_m_s2: T::constant(load.gravity_m_s2),
        force_n: vector(&load.force_n),
        moment_nm: vector(&load.moment_nm),
    };
    Ok((Robot::new(cables)?, load))
}

impl RobotDescription {
    /// The robot with a cable model made from its materials.
    #[must_use]
    pub fn with_model<M: FromMaterial>(&self) -> Robot<f64, M> {
        self.robot.map_models(|_, material| M::from_material(material, self.load.gravity_m_s2))
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
