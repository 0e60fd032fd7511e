//! The bounds that the search rests on: points and pieces of random force curves against floats, and
//! the equations over a box against solutions that are known or made.

use cdpr_core::{CableModel, CablePlane, CableState, IrvineCatenary, Parabola};
use nalgebra::{Matrix6, Vector2, Vector3, Vector6};

use super::curve::{Curve, Node, Piece};
use super::model::{Provable, Stretch};
use super::statics::{examine, narrow};
use super::*;
use crate::cases::Overrides;
use crate::enumerate::{ModelKind, Request};
use crate::robot_file::RobotDescription;

/// What the floats with which bounds are compared may be off: residuals are checked, so that only the
/// rounding of a few operations is left, and what stiffness makes of it.
const FLOATS: f64 = 64.0 * f64::EPSILON;
/// How much more than the true slope, besides the part by which length and force change, a bound may
/// be on a short piece: the ends of ranges are taken together that are not reached together.
const LOOSE: f64 = 3.0;
/// Part of the short pieces that may be bounded worse: next to singular points. Found 6 % (catenary) and
/// 12 % (parabola).
const LOOSE_PART: f64 = 0.15;
/// Part by which horizontal force and length change along a short piece at most.
const SHORT: f64 = 0.02;
const CABLES_TRIED: u64 = 3000;
const POINTS: i32 = 24;

/// Random numbers (`SplitMix64`), the same in every run.
struct Numbers(u64);

impl Numbers {
    /// Uniform in `[0, 1)`.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * (0.5 * f64::EPSILON)
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn log_within(&mut self, low: f64, high: f64) -> f64 {
        self.within(low.ln(), high.ln()).exp()
    }

    fn sign(&mut self) -> f64 {
        if self.unit() < 0.5 { -1.0 } else { 1.0 }
    }
}

/// A cable between two points: B below and above A, level, steep and nearly vertical, soft and stiff,
/// light and heavy.
struct Line {
    plane: CablePlane<f64>,
    weight_n_m: f64,
    compliance_per_n: f64,
}

impl Line {
    fn random(numbers: &mut Numbers) -> Self {
        let distance_m = numbers.log_within(0.3, 50.0);
        // A hyperbolic angle: 8 is within 1e-3 of vertical.
        let steepness = match numbers.unit() {
            part if part < 0.1 => 0.0,
            part if part < 0.9 => numbers.within(-3.0, 3.0),
            _ => numbers.within(-8.0, 8.0),
        };
        let (sin, cos) = numbers.within(0.0, std::f64::consts::TAU).sin_cos();
        let lever_arm = Vector3::from_fn(|_, _| numbers.within(-0.5, 0.5));
        let weight_n_m = numbers.log_within(1e-3, 1e2);
        let strain = numbers.log_within(1e-8, 0.3);
        Self {
            plane: CablePlane {
                x_m: distance_m / steepness.cosh(),
                z_m: distance_m * steepness.tanh(),
                direction: Vector2::new(cos, sin),
                lever_arm,
            },
            weight_n_m,
            compliance_per_n: strain / (weight_n_m * distance_m),
        }
    }

    fn catenary(&self) -> IrvineCatenary<f64> {
        let &Self { weight_n_m, compliance_per_n, .. } = self;
        IrvineCatenary { weight_n_m, compliance_per_n }
    }

    fn parabola(&self) -> Parabola<f64> {
        let &Self { weight_n_m, compliance_per_n, .. } = self;
        Parabola { weight_n_m, compliance_per_n }
    }
}

/// A point of the curve from its length, slack, or from its tension, taut.
fn random_state<M: Provable>(
    curve: &Curve<'_, M>,
    numbers: &mut Numbers,
) -> Option<CableState<f64>> {
    let distance_m = curve.plane.distance_m();
    if numbers.unit() < 0.5 {
        curve.at_length(distance_m * (1.0 + numbers.log_within(1e-4, 1e2)))
    } else {
        let tension_n = curve.model.weight_n_m() * distance_m * numbers.log_within(0.3, 1e3);
        let guess = CableState { force_n: curve.chord() * tension_n, rest_length_m: distance_m };
        curve.approach(guess, curve.chord(), tension_n)
    }
}

/// Error of the force of a state of the curve in floats: what its residual and rounding of the map (a
/// few units of the length) are worth; `None` where that is not small.
fn force_error_n<M: Provable>(curve: &Curve<'_, M>, state: &CableState<f64>) -> Option<f64> {
    let plane = curve.plane;
    let end = curve.model.end_point(state.force_n, state.rest_length_m);
    let residual_m = (end.position_m - Vector2::new(plane.x_m, plane.z_m)).norm();
    let compliance = end.jacobian.fixed_columns::<2>(0).into_owned();
    // In units of force and of the derivative by length, the least of which moves it back.
    let stiffness_n_m = compliance.try_inverse()?.norm();
    let rounding_m = FLOATS * (state.rest_length_m + plane.distance_m());
    Some(stiffness_n_m * (residual_m + rounding_m) + FLOATS * state.force_n.norm())
}

/// Points of the curve between two lengths, and how well they are known.
fn points_between<M: Provable>(
    curve: &Curve<'_, M>,
    a: &CableState<f64>,
    b: &CableState<f64>,
) -> Vec<(CableState<f64>, f64)> {
    let chord = b.force_n - a.force_n;
    let axis = chord.normalize();
    let mut points = Vec::new();
    for n in 1..POINTS {
        let part = f64::from(n) / f64::from(POINTS);
        let (length_a, length_b) = (a.rest_length_m, b.rest_length_m);
        let by_length = curve.at_length(length_a * (length_b / length_a).powf(part));
        let guess = CableState {
            force_n: a.force_n + chord * part,
            rest_length_m: length_a + (length_b - length_a) * part,
        };
        let target_n = guess.force_n.dot(&axis);
        let by_force = curve
            .approach(guess, axis, target_n)
            .and_then(|state| curve.approach(state, axis, target_n));
        for state in [by_length, by_force].into_iter().flatten() {
            let between = state.rest_length_m >= length_a && state.rest_length_m <= length_b;
            if let Some(error_n) = force_error_n(curve, &state).filter(|_| between) {
                points.push((state, error_n));
            }
        }
    }
    points
}

/// The pieces that are tried: nodes anywhere on the curve, or next to each other.
fn random_piece<M: Provable>(curve: &Curve<'_, M>, numbers: &mut Numbers) -> Option<Piece<M::End>> {
    let first = curve.node(random_state(curve, numbers)?)?;
    let second = if numbers.unit() < 0.5 {
        curve.node(random_state(curve, numbers)?)?
    } else {
        let step_n = numbers.log_within(1e-4, 1.0) * first.near.force_n.norm();
        curve.beside(&first.near, first.tangent, numbers.sign() * step_n)?
    };
    let in_order = first.near.rest_length_m < second.near.rest_length_m;
    let (shorter, longer) = if in_order { (first, second) } else { (second, first) };
    curve.piece(shorter, longer)
}

fn widened(interval: Interval, by: f64) -> Interval {
    interval + Interval::symmetric(by)
}

/// What was seen of many pieces.
#[derive(Debug, Default)]
struct Seen {
    pieces: u32,
    steep: u32,
    points: u32,
    short: u32,
    loose: u32,
    thick: u32,
}

fn check_piece<M: Provable>(curve: &Curve<'_, M>, piece: &Piece<M::End>, seen: &mut Seen) {
    let (a, b) = (&piece.shorter.state, &piece.longer.state);
    let size_n = piece.half_chord_n.norm();
    let normal_n = Vector2::new(-piece.half_chord_n.y, piece.half_chord_n.x);
    let weight = curve.enclosing.weight_n_m();
    let anchor = |s: &CableState<Interval>| s.force_n.y - weight * s.rest_length_m;
    let x_range = a.force_n.x.hull(b.force_n.x);
    let (attachment_range, anchor_range) =
        (a.force_n.y.hull(b.force_n.y), anchor(a).hull(anchor(b)));
    let hull = curve.hull(a, b);
    let ends = [&piece.shorter.end, &piece.longer.end];
    let span_m = Vector2::new(curve.plane.x_m, curve.plane.z_m).map(Interval::point);
    let stretch = Stretch { span_m, shorter: a, longer: b, hull, ends };
    let course = M::course(&curve.enclosing, &stretch);
    let (x, z) = (curve.plane.x_m, curve.plane.z_m);
    let distance_m = curve.plane.distance_m();

    let mut slope = 0.0_f64;
    let points = points_between(curve, &piece.shorter.near, &piece.longer.near);
    let mut largest_error = 0.0_f64;
    for (state, error_n) in &points {
        let (force_n, error_n) = (state.force_n, *error_n);
        let error = error_n / size_n;
        largest_error = largest_error.max(error);
        // The box, by the contract.
        assert!(widened(hull.force_n.x, error_n).contains(force_n.x));
        assert!(widened(hull.force_n.y, error_n).contains(force_n.y));
        assert!(widened(x_range, error_n).contains(force_n.x));
        let at_anchor_n = force_n.y - curve.model.weight_n_m() * state.rest_length_m;
        let (range, value) =
            if z <= 0.0 { (attachment_range, force_n.y) } else { (anchor_range, at_anchor_n) };
        assert!(widened(range, error_n).contains(value), "{range:?} {value}");
        // The parallelogram.
        let offset = force_n - piece.center_n;
        let u = offset.dot(&piece.half_chord_n) / size_n.powi(2);
        let v = offset.dot(&normal_n) / size_n.powi(2);
        assert!(u.abs() <= piece.reach + error, "u {u}, reach {}", piece.reach);
        assert!(v.abs() <= piece.thickness + error, "v {v}, thickness {}", piece.thickness);
        // The strip.
        let offset_n = (x * force_n.y - z * force_n.x) / distance_m;
        let strip = widened(course.offset_n, error_n);
        assert!(strip.contains(offset_n), "{offset_n} {strip:?}");
        // The direction, where the float's tangent is known.
        let end = curve.model.end_point(state.force_n, state.rest_length_m);
        let tangent = cdpr_core::CurvePoint::new(&end, x, z).tangent;
        let across = tangent.dot(&normal_n) / tangent.dot(&piece.half_chord_n);
        if error < 1e-9 {
            if piece.slope.is_finite() {
                assert!(tangent.dot(&piece.half_chord_n) > 0.0, "{tangent:?}");
                assert!(across.abs() <= piece.slope + 1e-7, "{across} {}", piece.slope);
            }
            slope = slope.max(across.abs());
        }
        // The wrench is linear, and its parts are those of the piece.
        let made = piece.center_wrench
            + piece.chord_wrench * u
            + piece.normal_wrench * (offset.dot(&normal_n) / size_n.powi(2));
        let off_n = (curve.plane.wrench_n(&force_n) - made).amax();
        assert!(off_n <= piece.wrench_error_n + error_n, "{off_n}");
        seen.points += 1;
    }
    seen.pieces += 1;
    seen.steep += u32::from(!piece.slope.is_finite());
    // Short, and known to far less than its size.
    let change = |of: fn(&CableState<f64>) -> f64| {
        (of(&piece.longer.near) / of(&piece.shorter.near) - 1.0).abs()
    };
    let change = change(|s| s.force_n.x).max(change(|s| s.rest_length_m));
    if change < SHORT && !points.is_empty() && largest_error < 1e-3 * slope.max(change) {
        seen.short += 1;
        // The curve itself within its rhombus, and that within what the piece says.
        seen.loose += u32::from(piece.slope > LOOSE * slope + change);
        let nodes = 4.0 * (piece.reach - 1.0);
        seen.thick += u32::from(piece.thickness > piece.slope + nodes);
    }
}

fn check_pieces<M: Provable>(model: impl Fn(&Line) -> M) -> Seen {
    let mut numbers = Numbers(1);
    let mut seen = Seen::default();
    for _ in 0..CABLES_TRIED {
        let line = Line::random(&mut numbers);
        let model = model(&line);
        let curve = Curve::new(&model, &line.plane, 1e-15 * line.plane.distance_m());
        for _ in 0..4 {
            if let Some(piece) = random_piece(&curve, &mut numbers) {
                check_piece(&curve, &piece, &mut seen);
            }
        }
    }
    println!("{seen:?}");
    seen
}

#[test]
fn pieces_of_catenaries_hold_their_curve() {
    let seen = check_pieces(Line::catenary);
    assert!(u64::from(seen.pieces) > 2 * CABLES_TRIED, "{seen:?}");
    assert!(u64::from(seen.short) > CABLES_TRIED / 2, "{seen:?}");
    assert!(f64::from(seen.loose) < LOOSE_PART * f64::from(seen.short), "{seen:?}");
    assert_eq!(seen.thick, 0, "{seen:?}");
}

#[test]
fn pieces_of_parabolas_hold_their_curve() {
    let seen = check_pieces(Line::parabola);
    assert!(u64::from(seen.pieces) > 2 * CABLES_TRIED, "{seen:?}");
    assert!(u64::from(seen.short) > CABLES_TRIED / 2, "{seen:?}");
    assert!(f64::from(seen.loose) < LOOSE_PART * f64::from(seen.short), "{seen:?}");
    assert_eq!(seen.thick, 0, "{seen:?}");
}

/// Nodes enclose what they say: for a target known only to a box, and numbers along known only to a
/// range, every point of every curve that is possible.
fn check_nodes<M: Provable>(model: impl Fn(&Line) -> M) {
    let mut numbers = Numbers(2);
    let mut corners = 0;
    for _ in 0..CABLES_TRIED {
        let line = Line::random(&mut numbers);
        let model = model(&line);
        let error_m = 1e-7 * line.plane.x_m;
        let curve = Curve::new(&model, &line.plane, error_m);
        let Some(near) = random_state(&curve, &mut numbers) else { continue };
        let Some(plain) = curve.node(near) else { continue };
        let axis = plain.tangent;
        // From as little as proofs need to as much as cannot be proven.
        let along_n = numbers.log_within(1e-8, 0.3) * near.force_n.norm();
        let along = Interval::new(-along_n, 0.3 * along_n);
        let Some(node) = curve.node_along(near, axis, along) else { continue };
        for corner in 0..8 {
            let side = |bit: i32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let mut plane = line.plane;
            plane.x_m += side(0) * error_m;
            plane.z_m += side(1) * error_m;
            let true_curve = Curve::new(&model, &plane, 0.0);
            let part = if corner < 4 { numbers.sign() } else { numbers.within(-1.0, 1.0) };
            let u = if side(2) > 0.0 { along.high() } else { along.low() } * part.abs();
            let target_n = near.force_n.dot(&axis) + u;
            let state = true_curve
                .approach(near, axis, target_n)
                .and_then(|state| true_curve.approach(state, axis, target_n));
            let Some(state) = state else { continue };
            let Some(error_n) = force_error_n(&true_curve, &state) else { continue };
            // Rounding against what the errors that are put in do.
            if error_n > 1e-3 * node.state.force_n.map(Interval::radius).max() {
                continue;
            }
            let held = |i: Interval, value: f64, error: f64| widened(i, error).contains(value);
            assert!(held(node.state.force_n.x, state.force_n.x, error_n), "{state:?} {node:?}");
            assert!(held(node.state.force_n.y, state.force_n.y, error_n), "{state:?} {node:?}");
            let rounding_m = FLOATS * state.rest_length_m;
            let length_error = 1e-3 * node.state.rest_length_m.radius() + rounding_m;
            assert!(held(node.state.rest_length_m, state.rest_length_m, length_error));
            corners += 1;
        }
    }
    assert!(corners > CABLES_TRIED, "{corners}");
}

/// The moment of the weight keeps the curve on one side of the line from anchor to attachment: on a
/// line beside it, on the other side, there is no node, from wherever one looks.
#[test]
fn a_node_is_not_made_of_nothing() {
    let mut numbers = Numbers(17);
    for _ in 0..20_000 {
        let line = Line::random(&mut numbers);
        let model = line.catenary();
        let curve = Curve::new(&model, &line.plane, 0.0);
        let chord = curve.chord();
        let below = Vector2::new(chord.y, -chord.x);
        let weight_n = line.weight_n_m * curve.plane.distance_m();
        let pull_n = weight_n * numbers.log_within(0.3, 1e3);
        let near = CableState {
            force_n: chord * pull_n + below * (weight_n * numbers.log_within(1e-3, 1.0)),
            rest_length_m: curve.plane.distance_m() * numbers.within(0.9, 1.1),
        };
        assert!(curve.node_along(near, below, Interval::zero()).is_none(), "{near:?}");
    }
}

#[test]
fn nodes_of_catenaries_hold_their_point() {
    check_nodes(Line::catenary);
}

#[test]
fn nodes_of_parabolas_hold_their_point() {
    check_nodes(Line::parabola);
}

#[derive(serde::Deserialize)]
struct Case {
    position_m: [f64; 3],
    rotation_vector_rad: [f64; 3],
    mass_kg: f64,
    linear_density_kg_m: f64,
    axial_stiffness_n: f64,
    solutions: Vec<Digits>,
}

#[derive(serde::Deserialize)]
struct Digits {
    lengths_m: [String; CABLES],
    fx_n: [String; CABLES],
    fz_n: [String; CABLES],
}

impl Digits {
    fn states(&self) -> [CableState<f64>; CABLES] {
        let number = |digits: &String| digits.parse::<f64>().expect("a decimal number");
        std::array::from_fn(|k| CableState {
            force_n: Vector2::new(number(&self.fx_n[k]), number(&self.fz_n[k])),
            rest_length_m: number(&self.lengths_m[k]),
        })
    }
}

type States = [CableState<f64>; CABLES];

/// The solutions to 40 digits, rounded, and their problems.
fn known_solutions() -> Vec<(Problem<IrvineCatenary<f64>>, Vec<States>)> {
    let text = include_str!("../../../tests/data/solutions.json");
    let cases: Vec<Case> = serde_json::from_str(text).expect("tests/data/solutions.json");
    let problem = |case: &Case| {
        let overrides = Overrides {
            mass_kg: Some(case.mass_kg),
            linear_density_kg_m: Some(case.linear_density_kg_m),
            axial_stiffness_n: Some(case.axial_stiffness_n),
            ..Overrides::default()
        };
        let request = Request {
            robot: overrides.apply(&RobotDescription::marionet_crane()),
            position_m: case.position_m,
            rotation_vector_rad: case.rotation_vector_rad,
            model: ModelKind::Irvine,
        };
        request.problem().expect("a pose of the robot")
    };
    let states = |case: &Case| case.solutions.iter().map(Digits::states).collect();
    cases.iter().map(|case| (problem(case), states(case))).collect()
}

/// A piece around a point, from as far before it to as far behind it as chance has it.
fn around<M: Provable>(
    curve: &Curve<'_, M>,
    state: &CableState<f64>,
    largest: f64,
    numbers: &mut Numbers,
) -> Option<Piece<M::End>> {
    let node = curve.node(*state)?;
    let mut beside = |towards: f64| {
        let step_n = numbers.log_within(1e-6, largest) * state.force_n.norm();
        curve.beside(&node.near, node.tangent, towards * step_n)
    };
    let (shorter, longer) = (beside(-1.0)?, beside(1.0)?);
    curve.piece(shorter, longer)
}

/// A piece from a little before one point to a little behind another.
fn spanning<M: Provable>(
    curve: &Curve<'_, M>,
    a: &CableState<f64>,
    b: &CableState<f64>,
) -> Option<Piece<M::End>> {
    let (a, b) = if a.rest_length_m < b.rest_length_m { (a, b) } else { (b, a) };
    let (first, last) = (curve.node(*a)?, curve.node(*b)?);
    let before = curve.beside(&first.near, first.tangent, -1e-3 * a.force_n.norm())?;
    let behind = curve.beside(&last.near, last.tangent, 1e-3 * b.force_n.norm())?;
    curve.piece(before, behind)
}

#[test]
fn boxes_around_known_solutions_keep_them() {
    let mut numbers = Numbers(3);
    let (mut boxes, mut unique, mut with_two) = (0, 0, 0);
    for (problem, solutions) in known_solutions() {
        let curves: [_; CABLES] = std::array::from_fn(|k| curve(&problem, k));
        let wrench_n = problem.balance.wrench_n();
        let pairs = solutions.iter().flat_map(|a| solutions.iter().map(move |b| (a, Some(b))));
        let alone = solutions.iter().flat_map(|states| [(states, None); 200]);
        for (states, other) in pairs.filter(|(a, b)| Some(*a) != *b).chain(alone) {
            let largest = numbers.log_within(1e-5, 3.0);
            let piece = |k: usize, numbers: &mut Numbers| match other {
                Some(other) => spanning(&curves[k], &states[k], &other[k]),
                None => around(&curves[k], &states[k], largest, numbers),
            };
            let pieces: Vec<_> = (0..CABLES).filter_map(|k| piece(k, &mut numbers)).collect();
            if pieces.len() < CABLES {
                continue; // a step too far for Newton
            }
            let pieces: [&Piece<_>; CABLES] = std::array::from_fn(|k| &pieces[k]);
            let u: [f64; CABLES] = std::array::from_fn(|k| {
                let chord = pieces[k].half_chord_n;
                (states[k].force_n - pieces[k].center_n).dot(&chord) / chord.norm_squared()
            });
            let rounding: [f64; CABLES] = std::array::from_fn(|k| {
                FLOATS * states[k].force_n.norm() / pieces[k].half_chord_n.norm()
            });
            let ranges = narrow(&pieces, wrench_n).expect("there is a solution");
            for k in 0..CABLES {
                let (low, high) = (ranges[k].0 - rounding[k], ranges[k].1 + rounding[k]);
                assert!(low <= u[k] && u[k] <= high, "{} in {:?}", u[k], ranges[k]);
            }
            boxes += 1;
            let Some(verdict) = examine(&pieces, wrench_n) else { continue };
            for k in 0..CABLES {
                let off = (u[k] - verdict.center[k]).abs();
                assert!(off <= verdict.radius[k] + rounding[k], "{off} {}", verdict.radius[k]);
            }
            let narrowed = verdict.narrow(&ranges).expect("there is a solution");
            for k in 0..CABLES {
                let (low, high) = (narrowed[k].0 - rounding[k], narrowed[k].1 + rounding[k]);
                assert!(low <= u[k] && u[k] <= high, "{} in {:?}", u[k], narrowed[k]);
            }
            let held = |other: &&[CableState<f64>; CABLES]| {
                (0..CABLES).all(|k| {
                    let (shorter, longer) = (&pieces[k].shorter.near, &pieces[k].longer.near);
                    (shorter.rest_length_m..longer.rest_length_m).contains(&other[k].rest_length_m)
                })
            };
            let inside = solutions.iter().filter(held).count();
            assert!(inside >= 1);
            assert!(inside == 1 || !verdict.is_unique(), "{inside} solutions in a box of one");
            unique += u32::from(verdict.is_unique());
            with_two += u32::from(inside > 1);
        }
    }
    println!("{boxes} boxes, {unique} unique, {with_two} with more than one");
    assert!(boxes > 5000 && unique > boxes / 4 && with_two > 20, "{boxes} {unique} {with_two}");
}

/// Six pieces that belong to no curve: random chords, thickness and slope.
fn made_pieces(numbers: &mut Numbers) -> [Piece<()>; CABLES] {
    std::array::from_fn(|_| {
        let line = Line::random(numbers);
        let mut vector = || Vector2::new(numbers.within(-1.0, 1.0), numbers.within(-1.0, 1.0));
        let (center_n, half_chord_n) = (vector() * 100.0, vector() * 10.0);
        let normal_n = Vector2::new(-half_chord_n.y, half_chord_n.x);
        let state = CableState { force_n: center_n, rest_length_m: 1.0 };
        let enclosed = CableState {
            force_n: center_n.map(Interval::point),
            rest_length_m: Interval::point(1.0),
        };
        let node =
            Node { near: state, tangent: half_chord_n.normalize(), state: enclosed, end: () };
        Piece {
            shorter: node,
            longer: node,
            center_n,
            half_chord_n,
            reach: 1.0 + 0.3 * numbers.unit(),
            thickness: numbers.log_within(1e-6, 0.3),
            slope: numbers.log_within(1e-6, 0.3),
            apex: 0.0,
            center_wrench: line.plane.wrench_n(&center_n),
            chord_wrench: line.plane.wrench_n(&half_chord_n),
            normal_wrench: line.plane.wrench_n(&normal_n),
            wrench_error_n: 0.0,
            normal_error_n: 0.0,
        }
    })
}

/// A wrench that balances the pieces at `u`, `v`.
fn balancing(pieces: &[&Piece<()>; CABLES], u: &[f64; CABLES], v: &[f64; CABLES]) -> Vector6<f64> {
    let forces = pieces.iter().enumerate().map(|(k, piece)| {
        piece.center_wrench + piece.chord_wrench * u[k] + piece.normal_wrench * v[k]
    });
    -forces.sum::<Vector6<f64>>()
}

#[test]
fn made_solutions_at_the_rim_are_kept() {
    let mut numbers = Numbers(4);
    let (mut tight, mut narrowed) = (0.0_f64, 0);
    for _ in 0..CABLES_TRIED {
        let made = made_pieces(&mut numbers);
        let pieces: [&Piece<()>; CABLES] = std::array::from_fn(|k| &made[k]);
        let matrix = Matrix6::from_columns(&pieces.map(|p| p.chord_wrench));
        let Some(inverse) = matrix.try_inverse() else { continue };
        // The sides on which one row of the answer, or one equation, is furthest from the middle.
        let row = numbers.within(0.0, 6.0).floor().min(5.0);
        let row = (0..CABLES).find(|&k| k as f64 >= row).unwrap_or(0);
        let of_answer = numbers.unit() < 0.5;
        let reached: [f64; CABLES] = std::array::from_fn(|k| pieces[k].reach * numbers.sign());
        let at_rim = numbers.unit() < 0.5;
        let u = if at_rim { reached } else { reached.map(|reach| reach * numbers.unit()) };
        let v = std::array::from_fn(|k| {
            let normal = pieces[k].normal_wrench;
            let side = if of_answer { (inverse * normal)[row] } else { normal[row] };
            pieces[k].thickness * side.signum()
        });
        let wrench_n = balancing(&pieces, &u, &v);
        // The wrench itself is rounded, by less than the bounds allow for.
        let ranges = narrow(&pieces, &wrench_n).expect("there is a solution");
        for k in 0..CABLES {
            let rounding = FLOATS * (1.0 + ranges[k].0.abs() + ranges[k].1.abs());
            assert!(ranges[k].0 <= u[k] + rounding && u[k] <= ranges[k].1 + rounding);
            narrowed += u32::from(ranges[k].1 - ranges[k].0 < 1.9);
        }
        let Some(verdict) = examine(&pieces, &wrench_n) else { continue };
        for k in 0..CABLES {
            let off = (u[k] - verdict.center[k]).abs();
            assert!(off <= verdict.radius[k], "{off} {}", verdict.radius[k]);
        }
        if of_answer {
            let off = (u[row] - verdict.center[row]).abs();
            tight = tight.max(1.0 - off / verdict.radius[row]);
        }
        assert!(verdict.narrow(&ranges).is_some());
        let inside = (0..CABLES)
            .all(|k| verdict.center[k].abs() + verdict.radius[k] < 2.0 - pieces[k].reach);
        assert_eq!(verdict.maps_inside(&pieces), inside);
        if at_rim {
            assert!(!verdict.maps_inside(&pieces), "a solution at the rim is not inside");
        }
    }
    println!("{tight:e} {narrowed}");
    assert!(tight < 1e-3, "{tight}");
    assert!(narrowed > 1000, "{narrowed}");
}

#[test]
fn boxes_that_may_hold_two_are_not_unique() {
    let mut numbers = Numbers(5);
    let (mut doubles, mut nearest) = (0_u64, f64::INFINITY);
    for _ in 0..CABLES_TRIED {
        let mut made = made_pieces(&mut numbers);
        let side: [f64; CABLES] = std::array::from_fn(|_| numbers.sign());
        let matrix =
            Matrix6::from_columns(&std::array::from_fn::<_, CABLES, _>(|k| made[k].chord_wrench));
        let Some(inverse) = matrix.try_inverse() else { continue };
        // Curves of slope `t side` against their chords: two solutions, indeed a line of them, when the
        // matrix of their tangents is singular.
        let turned = Matrix6::from_columns(&std::array::from_fn::<_, CABLES, _>(|k| {
            made[k].normal_wrench * side[k]
        }));
        let eigenvalues = (inverse * turned).complex_eigenvalues();
        let real = eigenvalues.iter().filter(|e| e.im == 0.0).map(|e| e.re.abs());
        let largest = real.fold(0.0, f64::max);
        if largest < 1e-3 {
            continue;
        }
        let slope = (1.0 + 1e-6) / largest;
        for piece in &mut made {
            piece.slope = slope;
        }
        let pieces: [&Piece<()>; CABLES] = std::array::from_fn(|k| &made[k]);
        let wrench_n = balancing(&pieces, &[0.0; CABLES], &[0.0; CABLES]);
        if let Some(verdict) = examine(&pieces, &wrench_n) {
            assert!(!verdict.is_unique(), "{}", verdict.contraction);
            nearest = nearest.min(verdict.contraction);
            doubles += 1;
        }
    }
    println!("{doubles} doubles, {nearest}");
    assert!(doubles > CABLES_TRIED / 3, "{doubles}");
    // Some of them are all that the bound leaves room for, or it would be far too large.
    assert!(nearest < 1.5, "{nearest}");
}
