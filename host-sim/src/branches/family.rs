//! The problems of one pose over a parameter, as a homotopy.

use std::marker::PhantomData;

use cdpr_core::statics::Balance;
use cdpr_core::{CABLES, CablePlane, GeometryFault, Load};
use nalgebra::Vector6;

use super::Parameter;
use crate::continuation::Homotopy;
use crate::enumerate::Request;
use crate::problem::FromMaterial;
use crate::robot_file::CableMaterial;

/// The problems of `request` with `parameter = exp(sigma)`, for cable model `M`.
pub(super) struct Family<M> {
    parameter: Parameter,
    materials: [CableMaterial; CABLES],
    gravity_m_s2: f64,
    mass_kg: f64,
    planes: [CablePlane<f64>; CABLES],
    /// The wrench is affine in the mass of the platform.
    massless_wrench_n: Vector6<f64>,
    wrench_per_kg_n: Vector6<f64>,
    model: PhantomData<M>,
}

impl<M> Family<M> {
    pub(super) fn new(request: &Request, parameter: Parameter) -> Result<Self, GeometryFault> {
        let (robot, load) = (&request.robot.robot, &request.robot.load);
        let pose = request.pose()?;
        let massless = Balance::at(robot, &Load { mass_kg: 0.0, ..*load }, &pose)?;
        let only_mass = Load {
            mass_kg: 1.0,
            force_n: nalgebra::Vector3::zeros(),
            moment_nm: nalgebra::Vector3::zeros(),
            ..*load
        };
        Ok(Self {
            parameter,
            materials: std::array::from_fn(|i| robot.cables()[i].model),
            gravity_m_s2: load.gravity_m_s2,
            mass_kg: load.mass_kg,
            planes: *massless.planes(),
            massless_wrench_n: *massless.wrench_n(),
            wrench_per_kg_n: *Balance::at(robot, &only_mass, &pose)?.wrench_n(),
            model: PhantomData,
        })
    }
}

impl<M: FromMaterial> Homotopy for Family<M> {
    type Model = M;

    fn planes(&self) -> &[CablePlane<f64>; CABLES] {
        &self.planes
    }

    fn model(&self, cable: usize, sigma: f64) -> M {
        let material = self.parameter.at(sigma.exp()).material(&self.materials[cable]);
        M::from_material(&material, self.gravity_m_s2)
    }

    fn wrench_n(&self, sigma: f64) -> Vector6<f64> {
        let mass_kg = self.parameter.at(sigma.exp()).mass_kg.unwrap_or(self.mass_kg);
        self.massless_wrench_n + self.wrench_per_kg_n * mass_kg
    }

    fn wrench_slope_n(&self, sigma: f64) -> Vector6<f64> {
        // d exp(sigma) / d sigma is the mass itself.
        let slope_kg = self.parameter.at(sigma.exp()).mass_kg.unwrap_or(0.0);
        self.wrench_per_kg_n * slope_kg
    }
}

#[cfg(test)]
mod tests {
    use cdpr_core::{CableModel, IrvineCatenary};

    use super::*;
    use crate::enumerate::ModelKind;
    use crate::robot_file::RobotDescription;

    #[test]
    fn a_member_is_the_problem_with_that_value() {
        let mut robot = RobotDescription::marionet_crane();
        robot.load.center_of_mass_m.x = 0.3;
        robot.load.force_n.y = 7.0;
        robot.load.moment_nm.z = -2.0;
        let request = Request {
            robot,
            position_m: [2.0, 7.0, 2.5],
            rotation_vector_rad: [0.1, 0.0, 0.2],
            model: ModelKind::Irvine,
        };
        for parameter in [Parameter::LinearDensity, Parameter::AxialStiffness, Parameter::Mass] {
            let family = Family::<IrvineCatenary<f64>>::new(&request, parameter).expect("a pose");
            let value = 17.0;
            let sigma = f64::ln(value);
            let member = parameter.request_at(&request, value);
            let problem = member.problem::<IrvineCatenary<f64>>().expect("a pose");
            let wrench_n = family.wrench_n(sigma);
            assert!((wrench_n - problem.balance.wrench_n()).amax() < 1e-13 * wrench_n.amax());
            for i in 0..CABLES {
                let (found, expected) = (family.model(i, sigma), problem.model(i));
                assert!((found.weight_n_m() / expected.weight_n_m() - 1.0).abs() < 1e-14);
                assert!((found.compliance_per_n / expected.compliance_per_n - 1.0).abs() < 1e-14);
            }
            let step = 1e-5;
            let slope =
                (family.wrench_n(sigma + step) - family.wrench_n(sigma - step)) / (2.0 * step);
            assert!((slope - family.wrench_slope_n(sigma)).amax() < 1e-9 * wrench_n.amax());
        }
    }
}
