//! The constants of [`CurveShape`](cdpr_core::CurveShape) against derivatives of the end-point map that
//! share nothing with the certificates that rest on them.
//!
//! With `Psi(F, L) = (t . F, X, Z)` at a fixed unit tangent `t` of the force curve, the inverse map of
//! `(p, x, z)` to the state `u = (Fx, Fz, L)` has the derivatives `B^-1`, `B = D Psi`, and
//! `-B^-1 D2 Psi[B^-1, B^-1]`: three numbers, and six second derivatives, of each component.

use cdpr_core::{
    CableModel, CurvePoint, CurveShape, IrvineCatenary, LinearElastic, NonDeformable, Parabola,
    ShapedCable,
};
use cdpr_tests::random::{self, log_uniform, uniform};
use cdpr_tests::random_tests;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};
use rand::Rng;
use rayon::prelude::*;

/// Step of the differences of the derivative, over tension and length at which it varies. Central
/// differences of fourth order: the fourth power of this and rounding over it are both below 1e-9.
const STEP: f64 = 1e-3;
/// Error of a second derivative, relative to the largest of its kind, and of a ratio.
const ERROR: f64 = 1e-4;
/// A constant is at most this times the largest ratio.
const TOO_LARGE: f64 = 1.2;

/// Largest ratios: what the constants bound, and what the contract does of the anchor.
#[derive(Clone, Copy, Debug, Default)]
struct Ratios {
    curvature: f64,
    response: f64,
    turn: f64,
    second: f64,
    /// Change of the force at the anchor, along the curve of a cable that hangs down.
    anchor_along: f64,
    /// Of others.
    anchor_along_above: f64,
    /// And when the end moves, over `n + w`.
    anchor_by_end: f64,
    /// What the force follows the end beside its plane, over what it does in the plane.
    beside: f64,
}

impl Ratios {
    fn with(self, o: Self) -> Self {
        Self {
            curvature: self.curvature.max(o.curvature),
            response: self.response.max(o.response),
            turn: self.turn.max(o.turn),
            second: self.second.max(o.second),
            anchor_along: self.anchor_along.max(o.anchor_along),
            anchor_along_above: self.anchor_along_above.max(o.anchor_along_above),
            anchor_by_end: self.anchor_by_end.max(o.anchor_by_end),
            beside: self.beside.max(o.beside),
        }
    }
}

/// Largest singular value.
fn norm2(m: &Matrix2<f64>) -> f64 {
    let (a, b) = (m.norm_squared(), m.determinant());
    (0.5 * (a + (a * a - 4.0 * b * b).max(0.0).sqrt())).sqrt()
}

/// The ratios at a state; nothing where it is not one of those that the constants are for.
fn ratios<M: CableModel<f64>>(model: &M, force_n: Vector2<f64>, length_m: f64) -> Option<Ratios> {
    let weight_n_m = model.weight_n_m();
    let end = model.end_point(force_n, length_m);
    let (x_m, z_m) = (end.position_m.x, end.position_m.y);
    let anchor_n = Vector2::new(force_n.x, force_n.y - weight_n_m * length_m);
    let sum_n = force_n.norm() + anchor_n.norm();
    let (tension_n, weight_n) = (force_n.norm().min(anchor_n.norm()), weight_n_m * length_m);
    if z_m > 0.0 && weight_n > 0.75 * sum_n {
        return None;
    }
    let curve = CurvePoint::new(&end, x_m, z_m);
    let (tangent, normal) = (curve.tangent, curve.normal());
    let rows = |j: &Matrix2x3<f64>| {
        Matrix3::new(tangent.x, tangent.y, 0.0, j.m11, j.m12, j.m13, j.m21, j.m22, j.m23)
    };
    // In units of the tension and of the length at which the tension changes: numbers of size 1.
    let units = Vector3::new(tension_n, tension_n, length_m * (tension_n / sum_n));
    let inverse = rows(&end.jacobian).try_inverse()?;
    // Derivatives of the Jacobian by Fx, Fz, L.
    let second: [Matrix2x3<f64>; 3] = std::array::from_fn(|k| {
        let step = STEP * units[k];
        let at = |times: f64| {
            let mut u = Vector3::new(force_n.x, force_n.y, length_m);
            u[k] += times * step;
            model.end_point(Vector2::new(u.x, u.y), u.z).jacobian
        };
        ((at(1.0) - at(-1.0)) * 8.0 - (at(2.0) - at(-2.0))) / (12.0 * step)
    });
    // The change of (Fx, Fz, L) by two of the coordinates (p, x, z).
    let change = |a: usize, b: usize| {
        let (u, v) = (inverse.column(a), inverse.column(b));
        let mut psi = Vector3::zeros();
        for k in 0..3 {
            let end = second[k] * v * u[k];
            psi += Vector3::new(0.0, end.x, end.y);
        }
        -(inverse * psi)
    };
    let across = |u: &Vector3<f64>| normal.x * u.x + normal.y * u.y;
    let swing = force_n.x / x_m;
    let column = |k: usize| -> Vector3<f64> { inverse.column(k).into() };
    let at_anchor = |u: &Vector3<f64>| Vector2::new(u.x, u.y - weight_n_m * u.z);
    let (p, x, z) = (0, 1, 2);
    let q = weight_n / sum_n;
    let bend = q * (q + 1.0 / 300.0) * force_n.x / (tension_n * tension_n);
    let curvature = across(&change(p, p)).abs();
    let turn = across(&change(p, x)).hypot(across(&change(p, z)));
    let by_end = Matrix2::from_columns(&[column(x).xy(), column(z).xy()]);
    let twice = Matrix2::new(
        across(&change(x, x)),
        across(&change(x, z)),
        across(&change(z, x)),
        across(&change(z, z)),
    );
    let anchor_by_end = Matrix2::from_columns(&[at_anchor(&column(x)), at_anchor(&column(z))]);
    let along = at_anchor(&column(p)).norm();
    let hangs = z_m <= 0.0;
    Some(Ratios {
        // Straight cables have no bend to divide by; see `straight_cables_do_not_bend`.
        curvature: if bend > 0.0 { curvature / bend } else { curvature * tension_n },
        response: norm2(&by_end) / swing,
        turn: turn * tension_n / swing,
        second: norm2(&twice) * tension_n / (swing * swing + weight_n_m * weight_n_m),
        anchor_along: if hangs { along } else { 0.0 },
        anchor_along_above: if hangs { 0.0 } else { along },
        anchor_by_end: norm2(&anchor_by_end) / (swing + weight_n_m),
        beside: swing / curve.normal_force_by_end_n_m.lp_norm(1),
    })
}

/// Force at the attachment and weight of a cable with `S = 2 N`, from the shape that it hangs in: `q` is
/// `W/S = tanh t`, `c` the slope of the chord of an inextensible one, `tanh y`.
fn state(t: f64, y: f64) -> (Vector2<f64>, f64) {
    // Tensions of the catenary at its ends are H cosh(y - t) and H cosh(y + t), vertical ones H sinh.
    let horizontal_n = 1.0 / (t.cosh() * y.cosh());
    let vertical_n = horizontal_n * (y + t).sinh();
    (Vector2::new(horizontal_n, vertical_n), 2.0 * t.tanh())
}

/// The largest ratios of all shapes that a cable hangs in, made with its weight and compliance.
fn largest<M: CableModel<f64>>(model: fn(f64, f64) -> M) -> Ratios {
    // Each thread takes a thousand shapes.
    (0..u64::from(random_tests(200).cases.min(2_000)))
        .into_par_iter()
        .map(|case| {
            let rng = &mut random::numbers(case);
            (0..1000).filter_map(|_| shape(rng, model)).fold(Ratios::default(), Ratios::with)
        })
        .reduce(Ratios::default, Ratios::with)
}

fn shape<M: CableModel<f64>>(rng: &mut impl Rng, model: fn(f64, f64) -> M) -> Option<Ratios> {
    let t = log_uniform(rng, [1e-3, 7.0]);
    let y = uniform(rng, [-7.0, 7.0]);
    let strain = match uniform(rng, [0.0, 2.0]) {
        choice if choice < 1.0 => 0.0,
        _ => log_uniform(rng, [1e-9, 0.1]),
    };
    let (force_n, weight_n) = state(t, y);
    // S = 2 N at a length of 1 m, and the strain is S/(2 EA).
    ratios(&model(weight_n, strain), force_n, 1.0)
}

fn assert_close(constant: f64, largest: f64, what: &str) {
    assert!(largest * (1.0 - ERROR) <= constant, "{what}: {constant} < {largest}");
    assert!(constant <= TOO_LARGE * largest, "{what}: {constant}, but never more than {largest}");
}

/// The bounds of a model against the largest ratios.
fn check<M: ShapedCable<f64>>(model: fn(f64, f64) -> M) {
    let largest = largest(model);
    println!("{largest:?}");
    let shape: CurveShape = M::SHAPE;
    assert_close(shape.curvature, largest.curvature, "curvature");
    assert_close(shape.response, largest.response, "response");
    assert_close(shape.turn, largest.turn, "turn");
    assert_close(shape.second, largest.second, "second");
    // The contract of `ShapedCable`.
    assert!(largest.anchor_along.max(largest.anchor_along_above) <= 1.5, "{largest:?}");
    assert!(largest.anchor_by_end <= 1.0, "{largest:?}");
    assert!(largest.beside <= 1.0 + ERROR, "{largest:?}");
}

#[test]
fn catenaries_bend_as_much_as_stated() {
    check(|weight_n_m, compliance_per_n| IrvineCatenary { weight_n_m, compliance_per_n });
}

#[test]
fn parabolas_bend_as_much_as_stated() {
    check(|weight_n_m, compliance_per_n| Parabola { weight_n_m, compliance_per_n });
}

#[test]
fn straight_cables_turn_as_much_as_stated() {
    let shape = <LinearElastic<f64> as ShapedCable<f64>>::SHAPE;
    assert_eq!(shape, <NonDeformable as ShapedCable<f64>>::SHAPE);
    let mut largest = Ratios::default();
    for case in 0..10_000 {
        let rng = &mut random::numbers(case);
        let angle = uniform(rng, [-1.5, 1.5]);
        let force_n = Vector2::new(angle.cos(), angle.sin()) * log_uniform(rng, [0.1, 1e3]);
        let compliance_per_n = log_uniform(rng, [1e-9, 0.1]) / force_n.norm();
        let elastic = LinearElastic { compliance_per_n };
        let length_m = log_uniform(rng, [0.1, 100.0]);
        for found in
            [ratios(&elastic, force_n, length_m), ratios(&NonDeformable, force_n, length_m)]
        {
            largest = largest.with(found.expect("a massless cable"));
        }
    }
    println!("{largest:?}");
    // Nothing bends: here over 1/T.
    assert!(shape.curvature == 0.0 && largest.curvature < ERROR, "{largest:?}");
    assert_close(shape.response, largest.response, "response");
    assert_close(shape.turn, largest.turn, "turn");
    assert_close(shape.second, largest.second, "second");
    assert!(largest.anchor_along.max(largest.anchor_along_above) <= 1.0 + ERROR, "{largest:?}");
    assert!(largest.beside <= 1.0 + ERROR, "{largest:?}");
}
