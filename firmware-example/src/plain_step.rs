//! The same Newton step done the plain way, for comparison: all 18 equations in all 18 unknowns, solved
//! by nalgebra's LU with partial pivoting.

use cdpr_core::statics::Balance;
use cdpr_core::{CABLES, CableModel, CableState, Real, Robot};
use nalgebra::{RealField, SMatrix, SVector, Vector2};

const UNKNOWNS: usize = 3 * CABLES;

/// Forces and rest lengths after one step from `states`; `None` when the matrix is singular.
///
/// Unknown `3i..3i + 3` are Fx, Fz and L of cable `i`; equations `2i` and `2i + 1` close it, and the last
/// six are the balance of the platform.
#[must_use]
pub fn plain_step<T: Real + RealField, M: CableModel<T>>(
    robot: &Robot<T, M>,
    balance: &Balance<T>,
    states: &[CableState<T>; CABLES],
) -> Option<[CableState<T>; CABLES]> {
    let mut matrix = SMatrix::<T, UNKNOWNS, UNKNOWNS>::zeros();
    let mut residual = SVector::<T, UNKNOWNS>::zeros();
    for (i, (plane, state)) in balance.planes().iter().zip(states).enumerate() {
        let end = robot.cables()[i].model.end_point(state.force_n, state.rest_length_m);
        let (row, column) = (2 * i, 3 * i);
        residual[row] = end.position_m.x - plane.x_m;
        residual[row + 1] = end.position_m.y - plane.z_m;
        matrix.fixed_view_mut::<2, 3>(row, column).copy_from(&end.jacobian);
        for (j, unit) in [Vector2::x(), Vector2::y()].iter().enumerate() {
            matrix.fixed_view_mut::<6, 1>(2 * CABLES, column + j).copy_from(&plane.wrench_n(unit));
        }
    }
    let imbalance_n = balance.residual_n(&states.map(|state| state.force_n));
    residual.fixed_rows_mut::<6>(2 * CABLES).copy_from(&imbalance_n);

    let change = matrix.lu().solve(&residual)?;
    Some(core::array::from_fn(|i| CableState {
        force_n: states[i].force_n - Vector2::new(change[3 * i], change[3 * i + 1]),
        rest_length_m: states[i].rest_length_m - change[3 * i + 2],
    }))
}
