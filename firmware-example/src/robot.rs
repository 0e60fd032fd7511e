//! The robot as this firmware knows it: MARIONET-CRANE, in f32.

use cdpr_core::{CABLES, Cable, CableState, GeometryFault, IrvineCatenary, Load, Robot};
use nalgebra::{Vector2, Vector3};

/// Anchors `A1..A6`, world frame, m.
const ANCHORS_M: [[f32; 3]; CABLES] = [
    [-3.259, -0.475, 8.826],
    [9.421, -3.482, 11.555],
    [9.538, 3.797, 11.533],
    [5.570, 20.414, 8.704],
    [-2.505, 16.810, 8.649],
    [-3.342, 9.421, 8.788],
];

/// Attachments `b1..b6`, platform frame, m.
const ATTACHMENTS_M: [[f32; 3]; CABLES] = [
    [-0.10, -0.93, -0.03],
    [0.10, -0.93, -0.03],
    [0.27, 0.50, -0.07],
    [0.27, 0.50, -0.07],
    [-0.27, 0.50, -0.07],
    [-0.27, 0.50, -0.07],
];

const GRAVITY_M_S2: f32 = 9.81;

/// Cable of 0.079 kg/m, 4 mm thick, modulus 1e11 Pa: `EA = pi (2 mm)^2 E`.
const CABLE: IrvineCatenary<f32> =
    IrvineCatenary { weight_n_m: 0.079 * GRAVITY_M_S2, compliance_per_n: 1.0 / 1.256_637_1e6 };

/// Platform and payload, centred on the platform origin.
pub(crate) const LOAD: Load<f32> = Load {
    mass_kg: 69.0,
    center_of_mass_m: Vector3::new(0.0, 0.0, 0.0),
    gravity_m_s2: GRAVITY_M_S2,
    force_n: Vector3::new(0.0, 0.0, 0.0),
    moment_nm: Vector3::new(0.0, 0.0, 0.0),
};

/// Where the platform hangs, level, at [`START`], m.
pub(crate) const START_POSITION_M: Vector3<f32> = Vector3::new(2.0, 7.0, 2.5);

/// 1 mm along x from there, m.
pub(crate) const NEXT_POSITION_M: Vector3<f32> = Vector3::new(2.001, 7.0, 2.5);

// Both solutions were made on a host: cdpr_core::newton::converge in f64 to a relative change of
// 1e-13 from 20000 random starts (rest lengths longer than the chord by 1e-5 to 1, forces of the
// single cables). All that ended with every cable pulling the platform towards its winch ended here.

/// Rest lengths and forces at [`START_POSITION_M`].
pub(crate) const START: [CableState<f32>; CABLES] = [
    state(10.479_832, 155.414_69, -114.487_35),
    state(15.077_343, 179.357_76, -129.583_59),
    state(12.221_567, 131.308_53, -141.830_1),
    state(14.731_523, 166.606_8, -72.739_22),
    state(11.970_178, 129.781_62, -74.298_386),
    state(8.355_886, 125.545_906, -143.951_37),
];

/// Rest lengths and forces at [`NEXT_POSITION_M`].
pub(crate) const NEXT: [CableState<f32>; CABLES] = [
    state(10.480_325, 155.348_16, -114.427_63),
    state(15.076_856, 179.427_61, -129.643_36),
    state(12.220_972, 131.332_72, -141.873_3),
    state(14.731_303, 166.474_52, -72.678_51),
    state(11.970_526, 129.977_66, -74.414_21),
    state(8.356_494, 125.483_82, -143.853),
];

const fn state(rest_length_m: f32, fx_n: f32, fz_n: f32) -> CableState<f32> {
    CableState { force_n: Vector2::new(fx_n, fz_n), rest_length_m }
}

/// The robot.
///
/// # Errors
/// [`GeometryFault`], were the constants above wrong.
pub(crate) fn crane() -> Result<Robot<f32, IrvineCatenary<f32>>, GeometryFault> {
    Robot::new(core::array::from_fn(|i| Cable {
        anchor_m: ANCHORS_M[i].into(),
        attachment_m: ATTACHMENTS_M[i].into(),
        model: CABLE,
    }))
}
