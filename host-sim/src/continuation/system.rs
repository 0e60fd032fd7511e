//! The equations along a path, in force-curve coordinates.
//!
//! A [`Point`] has seven coordinates: the position `p_i` of each cable on its force curve and
//! `sigma`, the logarithm of the parameter of a [`Homotopy`]. Near it the six equations of equilibrium
//! are
//!
//! ```text
//! sum_i G_i t_i dp_i + (u + sum_i G_i v_i) d sigma = -(wrench + sum_i G_i (F_i + c_i))
//! ```
//!
//! with `t_i` the unit tangent, `c_i` the way back to the curve, and `v_i` and `u` the shifts of the
//! curve and of the wrench with `sigma`. Holding any one of the seven coordinates leaves a 6x6 system: `sigma` on ordinary
//! stretches of a path (the paper's scheme), the force that turns fastest around a fold.

use cdpr_core::elimination::Elimination;
use cdpr_core::{CABLES, CableModel, CableState, CurvePoint, EndPoint};
use nalgebra::{Matrix6, Vector2, Vector6};

use super::homotopy::Homotopy;
use crate::problem::LEAST_FORCE;

/// Number of coordinates of a path: six forces and `sigma`.
pub(super) const COORDINATES: usize = CABLES + 1;
/// Index of `sigma` among them.
pub(crate) const SIGMA: usize = CABLES;

/// Values of all coordinates, or a direction in them, each force divided by its scale.
pub(crate) type Coordinates = [f64; COORDINATES];

/// Relative step of the central difference in `sigma`: truncation and rounding both leave 1e-10.
const SIGMA_STEP: f64 = 1e-5;

/// Horizontal force, relative to the weight of the cable, at which the height of the simplified
/// vertical cable is evaluated: its square is below rounding.
const VERTICAL_OPENING: f64 = 1e-9;

/// A point near a path.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    pub(crate) states: [CableState<f64>; CABLES],
    /// Logarithm of the parameter.
    pub(crate) sigma: f64,
}

/// The force curve of one cable at a point, and how it shifts with `sigma`.
#[derive(Clone, Copy)]
pub(super) struct MovingCurve {
    pub(super) curve: CurvePoint<f64>,
    shift_n: Vector2<f64>,
    length_shift_m: f64,
}

/// The equations of one pose, with the model of each cable either full or simplified.
pub(crate) struct System<'a, H> {
    pub(crate) homotopy: &'a H,
    /// Cables treated by the simplified model: `Fx = 0`, the equation for `X` left out.
    pub(crate) vertical: [bool; CABLES],
}

// Derived, it would ask for `H: Clone`.
impl<H> Clone for System<'_, H> {
    fn clone(&self) -> Self {
        Self { ..*self }
    }
}

impl<H: Homotopy> System<'_, H> {
    /// Whether the force curve of `cable` is the vertical line `Fx = 0`: where anchor and attachment
    /// stand exactly above each other it is, and in the simplified model.
    pub(super) fn is_vertical_line(&self, cable: usize) -> bool {
        self.vertical[cable] || self.homotopy.planes()[cable].x_m <= 0.0
    }

    fn end_point(&self, cable: usize, state: &CableState<f64>, sigma: f64) -> EndPoint<f64> {
        let model = self.homotopy.model(cable, sigma);
        if !self.vertical[cable] {
            return model.end_point(state.force_n, state.rest_length_m);
        }
        let opening = VERTICAL_OPENING * model.weight_n_m() * state.rest_length_m;
        let opened = Vector2::new(opening, state.force_n.y);
        let mut end = model.end_point(opened, state.rest_length_m);
        // Fx = 0 in place of X = x, scaled to metres.
        let per_force = state.rest_length_m / state.force_n.y.abs();
        end.position_m.x = self.homotopy.planes()[cable].x_m + state.force_n.x * per_force;
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
        let plane = &self.homotopy.planes()[cable];
        let end = self.end_point(cable, state, sigma);
        let curve = CurvePoint::new(&end, plane.x_m, plane.z_m);
        let ahead = self.end_point(cable, state, sigma + SIGMA_STEP).position_m;
        let behind = self.end_point(cable, state, sigma - SIGMA_STEP).position_m;
        let drift = EndPoint { position_m: (ahead - behind) / (2.0 * SIGMA_STEP), ..end };
        let shift = CurvePoint::new(&drift, 0.0, 0.0);
        (curve.is_finite() && shift.is_finite()).then_some(MovingCurve {
            curve,
            shift_n: shift.correction_n(),
            length_shift_m: shift.length_correction_m(),
        })
    }

    /// The elimination of the matrix of unit tangents at `point`, whose determinant and condition are
    /// those of the solution; `None` when it or a cable is singular.
    pub(crate) fn eliminate_tangents(&self, point: &Point) -> Option<Elimination<f64>> {
        Elimination::new(&self.linearise(point)?.tangent_matrix())
    }

    /// All equations, linearised at `point`; `None` when a cable is singular there.
    pub(super) fn linearise(&self, point: &Point) -> Option<Linearised<'_, H>> {
        let planes = self.homotopy.planes();
        let mut imbalance = self.homotopy.wrench_n(point.sigma);
        let load = imbalance.amax();
        let mut curves = Vec::with_capacity(CABLES);
        let mut columns = [Vector6::zeros(); COORDINATES];
        let load_shift_n = self.homotopy.wrench_slope_n(point.sigma);
        columns[SIGMA] = load_shift_n;
        let mut scales = [1.0; COORDINATES];
        for (i, state) in point.states.iter().enumerate() {
            let moving = self.curve(i, state, point.sigma)?;
            scales[i] = state.force_n.norm() + LEAST_FORCE * load;
            columns[i] = planes[i].wrench_n(&moving.curve.tangent) * scales[i];
            columns[SIGMA] += planes[i].wrench_n(&moving.shift_n);
            imbalance += planes[i].wrench_n(&(state.force_n + moving.curve.correction_n()));
            curves.push(moving);
        }
        Some(Linearised { system: self, curves, load_shift_n, columns, scales, imbalance })
    }
}

/// The equations linearised at a point, in scaled coordinates.
pub(super) struct Linearised<'a, H> {
    system: &'a System<'a, H>,
    pub(super) curves: Vec<MovingCurve>,
    load_shift_n: Vector6<f64>,
    columns: [Vector6<f64>; COORDINATES],
    pub(super) scales: Coordinates,
    imbalance: Vector6<f64>,
}

impl<H: Homotopy> Linearised<'_, H> {
    /// The 6x6 matrix when coordinate `held` is held: its column gives way to that of `sigma`.
    fn matrix(&self, held: usize) -> Matrix6<f64> {
        let mut columns: [Vector6<f64>; CABLES] = std::array::from_fn(|i| self.columns[i]);
        if held < CABLES {
            columns[held] = self.columns[SIGMA];
        }
        Matrix6::from_columns(&columns)
    }

    fn tangent_matrix(&self) -> Matrix6<f64> {
        let planes = self.system.homotopy.planes();
        let columns: [Vector6<f64>; CABLES] =
            std::array::from_fn(|i| planes[i].wrench_n(&self.curves[i].curve.tangent));
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
            step[SIGMA] = step[held];
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
            let (curve, along, shift) = (&moving.curve, step[i] * self.scales[i], step[SIGMA]);
            let length_change = curve.length_per_force_m_n * along
                + moving.length_shift_m * shift
                + curve.length_correction_m() * share;
            CableState {
                force_n: state.force_n
                    + curve.tangent * along
                    + moving.shift_n * shift
                    + curve.correction_n() * share,
                rest_length_m: state.rest_length_m * (length_change / state.rest_length_m).exp(),
            }
        });
        Point { states, sigma: point.sigma + step[SIGMA] }
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
            elimination.solve(&self.system.homotopy.planes()[cable].wrench_n(&change)).abs()
        };
        [
            seen((other.curve.tangent - here.curve.tangent) * self.scales[cable]),
            seen(other.shift_n - here.shift_n),
        ]
    }
    /// How the shift of the wrench at another `sigma` differs from that here, seen in the same way.
    pub(super) fn load_difference(
        &self,
        sigma: f64,
        elimination: &Elimination<f64>,
    ) -> Vector6<f64> {
        let change = self.system.homotopy.wrench_slope_n(sigma) - self.load_shift_n;
        if change.amax() > 0.0 { elimination.solve(&change).abs() } else { change }
    }
}
