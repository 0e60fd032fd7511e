//! The equations along a deformation path, in force-curve coordinates.
//!
//! A [`Point`] has seven coordinates: the position `p_i` of each cable on its force curve and
//! `sigma = ln s`, the logarithm of the deformation. Near it the six equations of equilibrium are
//!
//! ```text
//! sum_i G_i t_i dp_i + (sum_i G_i v_i) d sigma = -(wrench + sum_i G_i (F_i + c_i))
//! ```
//!
//! with `t_i` the unit tangent, `c_i` the way back to the curve and `v_i` the shift of the curve with
//! `sigma`. Holding any one of the seven coordinates leaves a 6x6 system: `sigma` on ordinary
//! stretches of a path (the paper's scheme), the force that turns fastest around a fold.

use cdpr_core::elimination::Elimination;
use cdpr_core::{CABLES, CableModel, CableState, CurvePoint, EndPoint};
use nalgebra::{Matrix6, Vector2, Vector6};

use crate::problem::Problem;

/// Number of coordinates of a path: six forces and the deformation.
pub(super) const COORDINATES: usize = CABLES + 1;
/// Index of `sigma` among them.
pub(super) const DEFORMATION: usize = CABLES;

/// Values of all coordinates, or a direction in them, each force divided by its scale.
pub(super) type Coordinates = [f64; COORDINATES];

/// Relative step of the central difference in `sigma`: truncation and rounding both leave 1e-10.
const SIGMA_STEP: f64 = 1e-5;

/// Part of the total load that counts as a force even in a cable without any.
const LEAST_FORCE: f64 = 1e-3;

/// Horizontal force, relative to the weight of the cable, at which the height of the simplified
/// vertical cable is evaluated: its square is below rounding.
const VERTICAL_OPENING: f64 = 1e-9;

/// A point near a path.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) states: [CableState<f64>; CABLES],
    /// `ln s`.
    pub(super) sigma: f64,
}

impl Point {
    pub(super) fn deformation(&self) -> f64 {
        self.sigma.exp()
    }
}

/// The force curve of one cable at a point, and how it shifts with `sigma`.
#[derive(Clone, Copy)]
pub(super) struct MovingCurve {
    pub(super) curve: CurvePoint<f64>,
    shift_n: Vector2<f64>,
    length_shift_m: f64,
}

/// The equations of one pose, with the model of each cable either full or simplified.
#[derive(Clone)]
pub(super) struct System<'a, M> {
    pub(super) problem: &'a Problem<M>,
    /// Cables treated by the simplified model: `Fx = 0`, the equation for `X` left out.
    pub(super) vertical: [bool; CABLES],
}

impl<'a, M: CableModel<f64>> System<'a, M> {
    pub(super) fn new(problem: &'a Problem<M>) -> Self {
        Self { problem, vertical: [false; CABLES] }
    }

    fn end_point(&self, cable: usize, state: &CableState<f64>, sigma: f64) -> EndPoint<f64> {
        let model = self.problem.model(cable).at_deformation(sigma.exp());
        if !self.vertical[cable] {
            return model.end_point(state.force_n, state.rest_length_m);
        }
        let opening = VERTICAL_OPENING * model.weight_n_m() * state.rest_length_m;
        let opened = Vector2::new(opening, state.force_n.y);
        let mut end = model.end_point(opened, state.rest_length_m);
        // Fx = 0 in place of X = x, scaled to metres.
        let per_force = state.rest_length_m / state.force_n.y.abs();
        end.position_m.x = self.problem.balance.planes()[cable].x_m + state.force_n.x * per_force;
        end.jacobian.m11 = per_force;
        end.jacobian.m12 = 0.0;
        end.jacobian.m13 = 0.0;
        end.jacobian.m21 = 0.0;
        end
    }

    /// The force curve of `cable` near `state`; `None` at a singular point.
    pub(super) fn curve(
        &self,
        cable: usize,
        state: &CableState<f64>,
        sigma: f64,
    ) -> Option<MovingCurve> {
        let plane = &self.problem.balance.planes()[cable];
        let end = self.end_point(cable, state, sigma);
        let curve = CurvePoint::new(&end, plane.x_m, plane.z_m, state);
        let ahead = self.end_point(cable, state, sigma + SIGMA_STEP).position_m;
        let behind = self.end_point(cable, state, sigma - SIGMA_STEP).position_m;
        let drift = EndPoint { position_m: (ahead - behind) / (2.0 * SIGMA_STEP), ..end };
        let shift = CurvePoint::new(&drift, 0.0, 0.0, state);
        (curve.is_finite() && shift.is_finite()).then_some(MovingCurve {
            curve,
            shift_n: shift.correction_n,
            length_shift_m: shift.length_correction_m,
        })
    }

    /// All equations, linearised at `point`; `None` when a cable is singular there.
    pub(super) fn linearise(&self, point: &Point) -> Option<Linearised<'_, M>> {
        let balance = &self.problem.balance;
        let load = balance.wrench_n().amax();
        let mut curves = Vec::with_capacity(CABLES);
        let mut columns = [Vector6::zeros(); COORDINATES];
        let mut scales = [1.0; COORDINATES];
        let mut imbalance = *balance.wrench_n();
        for (i, state) in point.states.iter().enumerate() {
            let moving = self.curve(i, state, point.sigma)?;
            scales[i] = state.force_n.norm() + LEAST_FORCE * load;
            columns[i] = balance.planes()[i].wrench_n(&moving.curve.tangent) * scales[i];
            columns[DEFORMATION] += balance.planes()[i].wrench_n(&moving.shift_n);
            imbalance += balance.planes()[i].wrench_n(&(state.force_n + moving.curve.correction_n));
            curves.push(moving);
        }
        Some(Linearised { system: self, curves, columns, scales, imbalance })
    }
}

/// The equations linearised at a point, in scaled coordinates.
pub(super) struct Linearised<'a, M> {
    system: &'a System<'a, M>,
    pub(super) curves: Vec<MovingCurve>,
    columns: [Vector6<f64>; COORDINATES],
    pub(super) scales: Coordinates,
    imbalance: Vector6<f64>,
}

impl<M: CableModel<f64>> Linearised<'_, M> {
    /// The 6x6 matrix when coordinate `held` is held: its column gives way to that of `sigma`.
    fn matrix(&self, held: usize) -> Matrix6<f64> {
        let mut columns: [Vector6<f64>; CABLES] = std::array::from_fn(|i| self.columns[i]);
        if held < CABLES {
            columns[held] = self.columns[DEFORMATION];
        }
        Matrix6::from_columns(&columns)
    }

    /// The matrix of unit tangents, whose determinant and condition are those of the solution.
    pub(super) fn tangent_matrix(&self) -> Matrix6<f64> {
        let balance = &self.system.problem.balance;
        let columns: [Vector6<f64>; CABLES] =
            std::array::from_fn(|i| balance.planes()[i].wrench_n(&self.curves[i].curve.tangent));
        Matrix6::from_columns(&columns)
    }

    pub(super) fn eliminate(&self, held: usize) -> Option<Elimination<f64>> {
        Elimination::new(&self.matrix(held))
    }

    /// A 6-vector of the held system as a step in all coordinates.
    fn spread(held: usize, solution: &Vector6<f64>) -> Coordinates {
        let mut step = [0.0; COORDINATES];
        step[..CABLES].copy_from_slice(solution.as_slice());
        if held < CABLES {
            step[DEFORMATION] = step[held];
            step[held] = 0.0;
        }
        step
    }

    /// The Newton step that leaves coordinate `held` where it is.
    pub(super) fn newton(&self, held: usize, elimination: &Elimination<f64>) -> Coordinates {
        Self::spread(held, &elimination.solve(&-self.imbalance))
    }

    /// Unit tangent of the path, on the side where `like` points.
    pub(super) fn tangent(&self, held: usize, like: &Coordinates) -> Option<Coordinates> {
        let elimination = self.eliminate(held)?;
        let mut tangent = Self::spread(held, &elimination.solve(&-self.columns[held]));
        tangent[held] = 1.0;
        let along: f64 = tangent.iter().zip(like).map(|(a, b)| a * b).sum();
        let size = tangent.iter().map(|t| t * t).sum::<f64>().sqrt().copysign(along);
        Some(tangent.map(|t| t / size))
    }

    /// `point` moved by `step` along the linearised curves. Lengths move by a factor, because those
    /// of slack cables fall like `1/s`.
    pub(super) fn advance(&self, point: &Point, step: &Coordinates, back_to_curve: bool) -> Point {
        let share = if back_to_curve { 1.0 } else { 0.0 };
        let states = std::array::from_fn(|i| {
            let (moving, state) = (&self.curves[i], &point.states[i]);
            let (curve, along, shift) =
                (&moving.curve, step[i] * self.scales[i], step[DEFORMATION]);
            let length_change = curve.length_per_force_m_n * along
                + moving.length_shift_m * shift
                + curve.length_correction_m * share;
            CableState {
                force_n: state.force_n
                    + curve.tangent * along
                    + moving.shift_n * shift
                    + curve.correction_n * share,
                rest_length_m: state.rest_length_m * (length_change / state.rest_length_m).exp(),
            }
        });
        Point { states, sigma: point.sigma + step[DEFORMATION] }
    }

    /// How the columns of `cable` at another point of its curve differ from those here, as seen
    /// through the inverse of the held matrix: one 6-vector for its force, one for `sigma`.
    pub(super) fn difference(
        &self,
        cable: usize,
        other: &MovingCurve,
        elimination: &Elimination<f64>,
    ) -> [Vector6<f64>; 2] {
        let here = &self.curves[cable];
        let seen = |change: Vector2<f64>| {
            elimination.solve(&self.system.problem.balance.planes()[cable].wrench_n(&change)).abs()
        };
        [
            seen((other.curve.tangent - here.curve.tangent) * self.scales[cable]),
            seen(other.shift_n - here.shift_n),
        ]
    }
}
