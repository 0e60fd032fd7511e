//! The shape of a cable in space, from the anchor to the attachment.
//!
//! What hangs between the anchor and the point at rest length `s` is itself a cable. At its end acts what
//! the rest of the cable needs to be carried and held, `T(s) = F - w (L - s) z`; so the end-point map of
//! the model says where that point is, whatever the model:
//!
//! ```text
//! p(s) = (X, Z)(F - w (L - s) z, s)
//! ```

use cdpr_core::{
    CABLES, CableModel, CablePlane, CableState, IrvineCatenary, LinearElastic, Parabola,
};
use nalgebra::{Vector2, Vector3};

use crate::continuation::Solution;
use crate::enumerate::{ModelKind, Request};
use crate::problem::{FromMaterial, Problem};

/// Largest step of `u`, where the slope of the cable is `sinh u`. The cable turns by less than that many
/// radians between two points, and steps by no more than that part of its length.
const STEP: f64 = 0.1;
/// Fewest pieces: a straight cable has shades and dashes too.
const FEWEST: u32 = 16;
/// Most pieces. Only cables whose ends are some 1e-9 of their length apart would have more.
const MOST: u32 = 600;
/// Horizontal force of a cable that hangs exactly vertically, relative to its weight, so that the model
/// does not divide by a tension of zero; its square is below rounding.
const OPENING: f64 = 1e-9;
/// A cable has its lowest point between its ends, and is longer than the straight line by this part of
/// it, when it is called slack.
const SLACK_EXCESS: f64 = 0.01;

/// A point of a cable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapePoint {
    /// Rest length from the anchor to here, m.
    pub rest_length_m: f64,
    /// Where it is, world frame, m.
    pub position_m: Vector3<f64>,
    /// Tension, N.
    pub tension_n: f64,
}

/// The shapes of the six cables of a solution.
pub type Shapes = [Vec<ShapePoint>; CABLES];

/// Samples the shape of a cable from its anchor (world frame, m) to its attachment, for a `state` that
/// fits its `plane`: 17 to 601 points, close where it bends. A chord between two of them is off the
/// cable by about a thousandth of the smallest radius of curvature.
///
/// A cable whose horizontal force is exactly zero hangs vertically: down on the side of the anchor, across
/// at its lowest point where the ends are not exactly above each other, and up on the other side.
pub fn shape<M: CableModel<f64>>(
    model: &M,
    anchor_m: &Vector3<f64>,
    plane: &CablePlane<f64>,
    state: &CableState<f64>,
) -> Vec<ShapePoint> {
    let CableState { force_n, rest_length_m } = *state;
    let weight_n_m = model.weight_n_m();
    let tension_at = |s: f64| force_n - Vector2::new(0.0, weight_n_m * (rest_length_m - s));
    let lowest_m = lowest_m(state, weight_n_m);
    let point = |s: f64, position: Vector2<f64>| ShapePoint {
        rest_length_m: s,
        position_m: anchor_m
            + Vector3::new(
                plane.direction.x * position.x,
                plane.direction.y * position.x,
                position.y,
            ),
        tension_n: tension_at(s).norm(),
    };
    let end_at = |s: f64| model.end_point(tension_at(s), s).position_m;

    let mut points = vec![point(0.0, Vector2::zeros())];
    if let (true, Some(lowest_m)) = (force_n.x == 0.0, lowest_m) {
        // A tension vanishes at the lowest point, where only the height is defined.
        let pieces = FEWEST / 2;
        let share = |k: u32| f64::from(k) / f64::from(pieces);
        let down = (1..=pieces).map(|k| (lowest_m * share(k), 0.0));
        let up = (0..=pieces)
            .map(|k| (lowest_m + (rest_length_m - lowest_m) * share(k), plane.x_m))
            .skip(usize::from(plane.x_m <= 0.0));
        let opening = Vector2::new(OPENING * weight_n_m * rest_length_m, 0.0);
        let height_at = |s: f64| model.end_point(tension_at(s) + opening, s).position_m.y;
        points.extend(down.chain(up).map(|(s, x)| point(s, Vector2::new(x, height_at(s)))));
        return points;
    }
    // The slope at rest length s is sinh u. For a catenary u is proportional to the horizontal distance,
    // and even steps of u have the least error of their chords.
    let slope = |s: f64| (tension_at(s).y / force_n.x).asinh();
    let (first, last) = (slope(0.0), slope(rest_length_m));
    let turn = last - first;
    if turn.is_finite() && turn > STEP * f64::from(FEWEST) / 2.0 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 5 to 600
        let pieces = (turn / STEP).ceil().clamp(FEWEST.into(), MOST.into()) as u32;
        points.extend((1..pieces).map(|k| {
            let u = first + turn * f64::from(k) / f64::from(pieces);
            let beyond_m = (force_n.y - force_n.x * u.sinh()) / weight_n_m;
            let s = (rest_length_m - beyond_m).clamp(0.0, rest_length_m);
            point(s, end_at(s))
        }));
    } else {
        // As good as straight; by the slope, the places would drown in rounding.
        points.extend((1..FEWEST).map(|k| {
            let s = rest_length_m * f64::from(k) / f64::from(FEWEST);
            point(s, end_at(s))
        }));
    }
    points.push(point(rest_length_m, end_at(rest_length_m)));
    points
}

/// Rest length from the anchor to the lowest point, where that is between the ends.
fn lowest_m(state: &CableState<f64>, weight_n_m: f64) -> Option<f64> {
    let weight_n = weight_n_m * state.rest_length_m;
    let hangs = state.force_n.y > 0.0 && state.force_n.y < weight_n;
    hangs.then(|| state.rest_length_m - state.force_n.y / weight_n_m)
}

impl Request {
    /// The shapes of the cables of one of the solutions of this request.
    ///
    /// They are schematic for the slack cables of two models. Those of [`ModelKind::Rigid`] do not stretch, and go
    /// straight down, across and up. Those of [`ModelKind::Parabolic`] are put together of parts that are each
    /// taken for a parabola, and are longer than their rest length says.
    ///
    /// # Errors
    /// As [`Request::check`].
    pub fn shapes(&self, solution: &Solution) -> Result<Shapes, cdpr_core::GeometryFault> {
        match self.model {
            ModelKind::Irvine => Ok(shapes(&self.problem::<IrvineCatenary<f64>>()?, solution)),
            ModelKind::Parabolic => Ok(shapes(&self.problem::<Parabola<f64>>()?, solution)),
            ModelKind::Elastic => Ok(shapes(&self.problem::<LinearElastic<f64>>()?, solution)),
            ModelKind::Rigid => {
                let hanging = self.problem::<IrvineCatenary<f64>>()?;
                let Problem { robot, balance, limits } = hanging;
                let robot = robot.map_models(|i, model| IrvineCatenary {
                    weight_n_m: if solution.vertical[i] { model.weight_n_m } else { 0.0 },
                    compliance_per_n: 0.0,
                });
                Ok(shapes(&Problem { robot, balance, limits }, solution))
            }
        }
    }

    /// Which cables of a solution are slack: with their lowest point between their ends, and longer than the
    /// straight line by more than a hundredth.
    ///
    /// # Errors
    /// As [`Request::check`].
    pub fn slack(&self, solution: &Solution) -> Result<[bool; CABLES], cdpr_core::GeometryFault> {
        let problem = self.problem::<LinearElastic<f64>>()?; // for the geometry
        Ok(std::array::from_fn(|i| {
            let material = self.robot.robot.cables()[i].model;
            let weight_n_m =
                IrvineCatenary::from_material(&material, self.robot.load.gravity_m_s2).weight_n_m;
            let state = &solution.states[i];
            let chord_m = problem.balance.planes()[i].distance_m();
            solution.vertical[i]
                || lowest_m(state, weight_n_m).is_some()
                    && state.rest_length_m > (1.0 + SLACK_EXCESS) * chord_m
        }))
    }
}

/// The shapes of the cables of a solution of `problem`.
pub fn shapes<M: CableModel<f64>>(problem: &Problem<M>, solution: &Solution) -> Shapes {
    std::array::from_fn(|i| {
        let cable = &problem.robot.cables()[i];
        let mut state = solution.states[i];
        if solution.vertical[i] {
            state.force_n.x = 0.0; // as the simplified model has it
        }
        shape(&cable.model, &cable.anchor_m, &problem.balance.planes()[i], &state)
    })
}

#[cfg(test)]
mod tests {
    use cdpr_core::NonDeformable;

    use super::*;
    use crate::enumerate::{Method, Options};
    use crate::robot_file::{CableMaterial, RobotDescription};

    const ANCHOR_M: Vector3<f64> = Vector3::new(3.0, -4.0, 7.0);

    fn plane(x_m: f64, z_m: f64) -> CablePlane<f64> {
        let direction = Vector2::new(-0.6, 0.8);
        CablePlane { x_m, z_m, direction, lever_arm: Vector3::zeros() }
    }

    fn state(fx: f64, fz: f64, rest_length_m: f64) -> CableState<f64> {
        CableState { force_n: Vector2::new(fx, fz), rest_length_m }
    }

    /// Back into the plane: horizontal distance from the anchor, and height above it.
    fn in_plane(point: &ShapePoint) -> Vector2<f64> {
        let from_anchor = point.position_m - ANCHOR_M;
        Vector2::new(from_anchor.x * -0.6 + from_anchor.y * 0.8, from_anchor.z)
    }

    const CATENARY: IrvineCatenary<f64> =
        IrvineCatenary { weight_n_m: 0.8, compliance_per_n: 1e-5 };

    /// Taut, sagging, slack, and one of four kilometres that hangs like a V; below and above the anchor.
    const STATES: [(f64, f64, f64); 6] = [
        (4000.0, -1500.0, 10.0),
        (20.0, -9.0, 30.0),
        (2.0, 11.0, 25.0),
        (30.0, 60.0, 40.0),
        (0.2, 1640.0, 4100.0),
        (1e-7, 5.0, 12.0),
    ];

    #[test]
    fn a_catenary_runs_from_anchor_to_attachment_along_its_tension() {
        for (fx, fz, length_m) in STATES {
            let state = state(fx, fz, length_m);
            let end_m = CATENARY.end_point(state.force_n, length_m).position_m;
            let points = shape(&CATENARY, &ANCHOR_M, &plane(end_m.x, end_m.y), &state);
            let (first, last) = (points[0], points[points.len() - 1]);
            assert_eq!((first.position_m, first.rest_length_m), (ANCHOR_M, 0.0));
            assert!((in_plane(&last) - end_m).norm() < 1e-15 * (10.0 + 4.0 * length_m));
            assert_eq!(last.rest_length_m.to_bits(), length_m.to_bits());
            let weight_n = CATENARY.weight_n_m * length_m;
            assert!((first.tension_n - fx.hypot(fz - weight_n)).abs() <= 1e-14 * first.tension_n);
            assert!((last.tension_n - fx.hypot(fz)).abs() <= 1e-14 * last.tension_n);
            // The cable is under tension alone: each chord is between the directions of the tension at
            // its ends, which turn upwards; and so is as long as the stretched cable but for the turn.
            let angle = |s: f64| (fz - CATENARY.weight_n_m * (length_m - s)).atan2(fx);
            let mut arc_m = 0.0;
            for pair in points.windows(2) {
                let chord = in_plane(&pair[1]) - in_plane(&pair[0]);
                let (low, high) = (angle(pair[0].rest_length_m), angle(pair[1].rest_length_m));
                let rounding = 1e-14 * (10.0 + length_m) / chord.norm();
                let along = chord.y.atan2(chord.x);
                assert!(low - rounding < along && along < high + rounding, "{state:?}");
                assert!(high - low <= STEP, "{state:?}: {low} to {high}");
                arc_m += chord.norm();
            }
            let mean_n = points.windows(2).map(|pair| {
                let piece_m = pair[1].rest_length_m - pair[0].rest_length_m;
                piece_m * f64::midpoint(pair[0].tension_n, pair[1].tension_n)
            });
            let stretched_m = length_m + CATENARY.compliance_per_n * mean_n.sum::<f64>();
            assert!((arc_m / stretched_m - 1.0).abs() < 1e-3, "{arc_m} {stretched_m}");
            assert!(points.len() < 500, "{}", points.len());
        }
    }

    #[test]
    fn other_models_end_where_they_say() {
        fn ends<M: CableModel<f64>>(model: M, states: &[(f64, f64, f64)]) {
            for &(fx, fz, length_m) in states {
                let state = state(fx, fz, length_m);
                let end_m = model.end_point(state.force_n, length_m).position_m;
                let points = shape(&model, &ANCHOR_M, &plane(end_m.x, end_m.y), &state);
                let last = in_plane(&points[points.len() - 1]);
                assert!((last - end_m).norm() < 1e-14 * (10.0 + length_m));
                assert!(points.iter().all(|p| p.position_m.iter().all(|c| c.is_finite())));
                assert!(points.is_sorted_by(|a, b| a.rest_length_m < b.rest_length_m));
            }
        }
        ends(Parabola { weight_n_m: 0.8, compliance_per_n: 1e-5 }, &STATES);
        ends(LinearElastic { compliance_per_n: 1e-5 }, &STATES[..2]);
        ends(NonDeformable, &STATES[..2]);
    }

    #[test]
    fn a_massless_cable_is_straight() {
        let state = state(30.0, -40.0, 5.0);
        let points = shape(&NonDeformable, &ANCHOR_M, &plane(3.0, -4.0), &state);
        for point in &points {
            let expected = Vector2::new(0.6, -0.8) * point.rest_length_m;
            assert!((in_plane(point) - expected).norm() < 1e-14);
            assert!((point.tension_n - 50.0).abs() < 1e-13);
        }
    }

    /// 20 m of cable over ends 4 m apart in height: 12 m hang on one side and 8 m on the other.
    #[test]
    fn a_vertical_cable_goes_down_and_up() {
        let inextensible = IrvineCatenary { weight_n_m: 0.5, compliance_per_n: 0.0 };
        let hangs = state(0.0, 4.0, 20.0);
        for x_m in [0.0, 1.5] {
            let points = shape(&inextensible, &ANCHOR_M, &plane(x_m, -4.0), &hangs);
            let lowest = points.iter().min_by(|a, b| a.tension_n.total_cmp(&b.tension_n)).unwrap();
            assert!((lowest.rest_length_m - 12.0).abs() < 1e-12 && lowest.tension_n < 1e-12);
            for point in &points {
                let s = point.rest_length_m;
                let height = if s <= 12.0 { -s } else { s - 24.0 };
                let expected_n = 0.5 * (s - 12.0).abs();
                assert!((in_plane(point).y - height).abs() < 1e-7, "{s}");
                assert!((point.tension_n - expected_n).abs() < 1e-12);
            }
            let last = in_plane(&points[points.len() - 1]);
            assert!((last - Vector2::new(x_m, -4.0)).norm() < 1e-7);
        }
        // A parabola of this length has its mean force over its mean tension: 1 N upwards of 2.6 N.
        let parabola = Parabola { weight_n_m: 0.5, compliance_per_n: 0.0 };
        let plane = plane(0.0, -20.0 / 2.6);
        let points = shape(&parabola, &ANCHOR_M, &plane, &hangs);
        let last = in_plane(&points[points.len() - 1]);
        assert!((last - Vector2::new(0.0, plane.z_m)).norm() < 1e-7, "{last}");
        assert!(points.iter().all(|p| p.position_m.iter().all(|c| c.is_finite())));
    }

    fn five(model: ModelKind) -> Request {
        let mut robot = RobotDescription::marionet_crane();
        robot.load.mass_kg = 10.0;
        robot.robot = robot
            .robot
            .map_models(|_, material| CableMaterial { linear_density_kg_m: 0.004, ..*material });
        Request {
            robot,
            position_m: [0.96733, 11.3833, 1.65],
            rotation_vector_rad: [0.0, 0.0, 0.01],
            model,
        }
    }

    #[test]
    fn every_solution_of_every_model_ends_at_the_platform() {
        use ModelKind::{Elastic, Irvine, Parabolic, Rigid};
        for model in [Irvine, Parabolic, Elastic, Rigid] {
            let mut request = five(model);
            if model == Elastic {
                request.position_m = [2.0, 7.0, 2.5]; // where a solution has no slack cable
            }
            let options = Options { method: Method::Continuation, ..Options::default() };
            let solutions = request.enumerate(options).unwrap().solutions;
            assert!(!solutions.is_empty());
            let pose = request.pose().unwrap();
            for found in solutions {
                let shapes = request.shapes(&found.solution).unwrap();
                for (points, cable) in shapes.iter().zip(request.robot.robot.cables()) {
                    let attachment_m = pose.position_m() + pose.turn(&cable.attachment_m);
                    let length_m = points[points.len() - 1].rest_length_m;
                    let off_m = (points[points.len() - 1].position_m - attachment_m).norm();
                    assert!(off_m < 1e-9 + 1e-11 * length_m, "{model:?}: {off_m}");
                    assert_eq!(points[0].position_m, cable.anchor_m);
                }
            }
        }
    }

    /// The pose of the paper with five solutions, the first of them close to its fold with the second, cable 3
    /// hanging; the deepest by a sag of 2051.61 m.
    #[test]
    fn slack_cables_hang_deep() {
        let request = Request { rotation_vector_rad: [0.0; 3], ..five(ModelKind::Irvine) };
        let solutions = request.enumerate(Options::default()).unwrap().solutions;
        let slack = solutions.iter().map(|found| request.slack(&found.solution).unwrap());
        let numbers: Vec<Vec<usize>> =
            slack.map(|slack| (1..=CABLES).filter(|i| slack[i - 1]).collect()).collect();
        assert_eq!(numbers, [vec![3], vec![3], vec![6], vec![3, 5], vec![4, 6]]);
        let shapes = request.shapes(&solutions[4].solution).unwrap();
        let deepest = shapes[5].iter().map(|p| p.position_m.z).fold(f64::INFINITY, f64::min);
        // The chord is 7.2 m lower at B than at A, where the sag is measured within that.
        let sag_m = shapes[5][0].position_m.z - deepest;
        assert!((2051.0..2059.0).contains(&sag_m), "{sag_m}");
    }
}
