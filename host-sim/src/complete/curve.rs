//! The force curve of one cable at one pose, cut into pieces with proven enclosures.
//!
//! A [`Node`] is a point of the curve, proven to exist in a box of rounding size. A [`Piece`] is what
//! lies between two nodes. With growing rest length the horizontal force falls, and the vertical one
//! rises at the attachment of a cable that goes down, or falls at the anchor of one that goes up (the
//! contract of [`CableModel`]); so a piece lies in the box of its ends, the direction of the curve
//! over that box bounds its slope against the chord, and two ends with bounded slopes leave a thin
//! rhombus. The curve need not be convex.

use cdpr_core::{CableModel, CablePlane, CableState, CurvePoint};
use nalgebra::{Matrix2, Vector2, Vector6};
use num_traits::Zero;

use super::model::{Course, Provable, Stretch};
use crate::interval::Interval;

/// Newton steps towards a point of the curve.
const NEWTON_STEPS: usize = 12;
/// A step that moves force and length by less than this part of them is the last: the square of it is
/// left, and the proof of a node finds it wherever it is.
const SETTLED: f64 = 1e-5;
/// The box in which a node is proven, relative to force and length, at least.
const LEAST_BOX: f64 = 1e-14;
/// How often that box is enlarged, by this factor each time.
const BOX_ATTEMPTS: usize = 4;
const BOX_GROWTH: f64 = 16.0;
/// Error of a component of the wrench of a force from the rounding of direction and lever arm (8
/// units of 2^-53 each, as in [`PLANE_ROUNDING`](super::PLANE_ROUNDING)) and of the products.
const PLANE_WRENCH_ROUNDING: f64 = 12.0 * f64::EPSILON;
/// How close to the ends of its chord a piece may be cut, as a part of half the chord.
const CUT_MARGIN: f64 = 0.9999;

/// A point of a force curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node<E> {
    /// Near it.
    pub(crate) near: CableState<f64>,
    /// Near the direction of the curve there, towards longer cables.
    pub(crate) tangent: Vector2<f64>,
    /// Encloses it.
    pub(crate) state: CableState<Interval>,
    /// What the model keeps of it.
    pub(crate) end: E,
}

impl<E> Node<E> {
    /// How far its force may be from the middle of its box, N.
    pub(super) fn radius_n(&self) -> f64 {
        self.state.force_n.x.radius() + self.state.force_n.y.radius()
    }
}

/// What lies between two nodes: `force = center + u half_chord + v normal` with
/// `u` in `[-1, 1]`, `|v| <= thickness` and `|dv/du| <= slope`, where `normal` is `half_chord` turned
/// by a right angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece<E> {
    /// The node with the shorter rest length.
    pub(super) shorter: Node<E>,
    pub(super) longer: Node<E>,
    pub(super) center_n: Vector2<f64>,
    pub(super) half_chord_n: Vector2<f64>,
    /// Largest `|u|`, one but for the size of the nodes.
    pub(super) reach: f64,
    pub(super) thickness: f64,
    /// Infinite when nothing is known of it.
    pub(super) slope: f64,
    /// Where the tangents at the ends meet: the best place to cut.
    pub(super) apex: f64,
    /// Wrenches of center, half chord and normal, N.
    pub(super) center_wrench: Vector6<f64>,
    pub(super) chord_wrench: Vector6<f64>,
    pub(super) normal_wrench: Vector6<f64>,
    /// Bound on the error of a component of the wrench of any force of the piece, from rounding and
    /// from that of the plane, N.
    pub(super) wrench_error_n: f64,
    /// The same for the wrench of the normal, N.
    pub(super) normal_error_n: f64,
}

/// One cable at one pose.
pub(crate) struct Curve<'a, M: Provable> {
    pub(super) model: &'a M,
    pub(crate) enclosing: M::Enclosing,
    pub(super) plane: &'a CablePlane<f64>,
    /// How far the computed plane may be from the true one, m.
    pub(super) plane_error_m: f64,
    /// Position of the attachment, with that error.
    pub(crate) target: Vector2<Interval>,
}

impl<'a, M: Provable> Curve<'a, M> {
    pub(super) fn new(model: &'a M, plane: &'a CablePlane<f64>, plane_error_m: f64) -> Self {
        // The error must not take the cable across the vertical, where its plane turns around.
        let x_error_m = plane_error_m.min(1e-3 * plane.x_m);
        let target = Vector2::new(
            Interval::around(plane.x_m, x_error_m),
            Interval::around(plane.z_m, plane_error_m),
        );
        Self { model, enclosing: model.enclosing(), plane, plane_error_m, target }
    }

    /// The curves of all members of a family of cables at one plane, taken for exact: `enclosing`
    /// holds every member, `model` is one of them for Newton's method, and the attachment of a
    /// member is at `scale` times that of the plane for a number of `scale`. What is proven of a
    /// node then holds for each member, with a node of its own in the box.
    pub(crate) fn of_family(
        model: &'a M,
        enclosing: M::Enclosing,
        plane: &'a CablePlane<f64>,
        scale: Interval,
    ) -> Self {
        let target = Vector2::new(plane.x_m, plane.z_m).map(|c| Interval::point(c) * scale);
        Self { model, enclosing, plane, plane_error_m: 0.0, target }
    }

    /// Unit vector from anchor to attachment.
    pub(super) fn chord(&self) -> Vector2<f64> {
        Vector2::new(self.plane.x_m, self.plane.z_m) / self.plane.distance_m()
    }

    /// The linearised curve at `state`; `None` where it is singular.
    pub(crate) fn linearised(&self, state: &CableState<f64>) -> Option<CurvePoint<f64>> {
        let end = self.model.end_point(state.force_n, state.rest_length_m);
        let curve = CurvePoint::new(&end, self.plane.x_m, self.plane.z_m);
        curve.is_finite().then_some(curve)
    }

    /// Direction of the curve near `state`, towards longer cables.
    pub(super) fn tangent(&self, state: &CableState<f64>) -> Option<Vector2<f64>> {
        Some(self.linearised(state)?.tangent)
    }

    /// A point of the curve near `guess` where the force along the unit vector `axis` is `target_n`
    /// (but for what Newton leaves, which does not matter).
    pub(crate) fn approach(
        &self,
        guess: CableState<f64>,
        axis: Vector2<f64>,
        target_n: f64,
    ) -> Option<CableState<f64>> {
        let mut state = guess;
        for _ in 0..NEWTON_STEPS {
            let curve = self.linearised(&state)?;
            let back = state.force_n + curve.correction_n();
            let along = (target_n - back.dot(&axis)) / curve.tangent.dot(&axis);
            let force_n = back + curve.tangent * along;
            let length_change = curve.length_correction_m() + curve.length_per_force_m_n * along;
            let change = ((force_n - state.force_n).amax() / force_n.amax())
                .max(length_change.abs() / state.rest_length_m);
            state = CableState { force_n, rest_length_m: state.rest_length_m + length_change };
            let possible = state.rest_length_m > 0.0 && force_n.x > 0.0;
            if !possible || !change.is_finite() {
                return None;
            }
            if change < SETTLED {
                return Some(state);
            }
        }
        None
    }

    /// The point of the curve with the given rest length.
    pub(super) fn at_length(&self, rest_length_m: f64) -> Option<CableState<f64>> {
        let line =
            self.model.force_at_length(self.plane.x_m, self.plane.z_m, rest_length_m).ok()?;
        Some(CableState { force_n: line.force_n, rest_length_m })
    }

    /// Proves that the curve has exactly one point near `near` on the line across its tangent there.
    pub(crate) fn node(&self, near: CableState<f64>) -> Option<Node<M::End>> {
        let tangent = self.tangent(&near)?;
        self.node_along(near, tangent, Interval::zero())
    }

    /// Proves that for each number `u` of `along` the curve has exactly one point near
    /// `near + u tangent` on the line across `tangent`, and encloses them all (Krawczyk's test on
    /// distance across and rest length).
    pub(crate) fn node_along(
        &self,
        near: CableState<f64>,
        tangent: Vector2<f64>,
        along: Interval,
    ) -> Option<Node<M::End>> {
        let normal = Vector2::new(-tangent.y, tangent.x);
        let on_tangent = |origin: f64, t: f64| Interval::point(origin) + along * Interval::point(t);
        let on_tangent = Vector2::new(
            on_tangent(near.force_n.x, tangent.x),
            on_tangent(near.force_n.y, tangent.y),
        );
        let length = Interval::point(near.rest_length_m);
        // Called apart, so that the compiler leaves out what is not asked for.
        let mut residual =
            self.enclosing.end_point(near.force_n.map(Interval::point), length).position_m
                - self.target;
        if !along.is_zero() {
            // By the mean value: along a taut cable the end hardly moves, which the position does not
            // show in intervals, but the derivative does.
            let j = self.enclosing.end_point(on_tangent, length).jacobian;
            let (x, z) = (Interval::point(tangent.x), Interval::point(tangent.y));
            residual += Vector2::new(j.m11 * x + j.m12 * z, j.m21 * x + j.m22 * z) * along;
        }
        // Columns: across, longer. Any matrix will do as a preconditioner.
        let j = self.model.end_point(near.force_n, near.rest_length_m).jacobian;
        let (k, b) = (Matrix2::new(j.m11, j.m12, j.m21, j.m22), Vector2::new(j.m13, j.m23));
        let inverse = Matrix2::from_columns(&[k * normal, b]).try_inverse()?;
        if !inverse.iter().all(|c| c.is_finite()) {
            return None;
        }
        let inverse = inverse.map(Interval::point);
        let newton = -(inverse * residual);
        // Across a nearly vertical cable the horizontal force is what counts.
        let across_n =
            near.force_n.x.abs() * normal.x.abs() + near.force_n.y.abs() * normal.y.abs();
        let least = Vector2::new(across_n, near.rest_length_m) * LEAST_BOX;
        let mut radii = newton.zip_map(&least, |n, l| 2.0 * n.magnitude() + l);
        for _ in 0..BOX_ATTEMPTS {
            let around = radii.map(Interval::symmetric);
            let force = on_tangent + normal.map(|n| around.x * Interval::point(n));
            let j = self.enclosing.end_point(force, length + around.y).jacobian;
            let normal = normal.map(Interval::point);
            let across =
                Vector2::new(j.m11, j.m21) * normal.x + Vector2::new(j.m12, j.m22) * normal.y;
            let columns = Matrix2::from_columns(&[across, Vector2::new(j.m13, j.m23)]);
            let contraction = Matrix2::identity() - inverse * columns;
            let image = newton + contraction * around;
            if image.x.is_inside(around.x) && image.y.is_inside(around.y) {
                let state = CableState {
                    force_n: on_tangent + normal.map(|n| n * image.x),
                    rest_length_m: length + image.y,
                };
                // The contract speaks of cables that are not slack beyond measure and pull outwards.
                let physical = state.rest_length_m.low() > 0.0 && state.force_n.x.low() > 0.0;
                return physical.then(|| Node {
                    near,
                    tangent,
                    state,
                    end: M::end(&self.enclosing, &state),
                });
            }
            radii *= BOX_GROWTH;
        }
        None
    }

    /// The piece between two nodes; `None` unless the first is the shorter one by proof.
    pub(super) fn piece(
        &self,
        shorter: Node<M::End>,
        longer: Node<M::End>,
    ) -> Option<Piece<M::End>> {
        let (a, b) = (&shorter.state, &longer.state);
        if a.rest_length_m.high() >= b.rest_length_m.low() {
            return None;
        }
        let hull = self.hull(a, b);
        let (from, to) = (a.force_n.map(Interval::middle), b.force_n.map(Interval::middle));
        let half_chord_n = (to - from) * 0.5;
        let center_n = from + half_chord_n;
        let normal_n = Vector2::new(-half_chord_n.y, half_chord_n.x);
        let size_sq = half_chord_n.norm_squared();
        if !(size_sq > 0.0 && size_sq.is_finite()) {
            return None;
        }
        let ends = [&shorter.end, &longer.end];
        let stretch = Stretch { span_m: self.target, shorter: a, longer: b, hull, ends };
        let Course { direction, offset_n } = M::course(&self.enclosing, &stretch);
        let chord = half_chord_n.map(Interval::point);
        let forwards = direction.x * chord.x + direction.y * chord.y;
        let sideways = direction.y * chord.x - direction.x * chord.y;
        // How far the nodes reach beyond the points that were taken for them, in half chords.
        let size = size_sq.sqrt();
        let slack = (shorter.radius_n().max(longer.radius_n())
            + 8.0 * f64::EPSILON * (center_n.amax() + size))
            / size;
        let mut across = Interval::ENTIRE;
        let mut slope = f64::INFINITY;
        let mut reach = 1.0 + 2.0 * slack;
        if forwards.low() > 0.0 {
            let slopes = sideways / forwards;
            let (rise, fall) = (slopes.high().max(0.0), -slopes.low().min(0.0));
            slope = rise.max(fall);
            let sum = rise + fall;
            let height = if sum > 0.0 { 2.0 * rise * (fall / sum) } else { 0.0 };
            across = Interval::symmetric(height * (1.0 + 1e-12) + 3.0 * slack * (1.0 + slope));
        }
        // The box of the ends bounds it too, better where the direction is not known well.
        let offset = hull.force_n - center_n.map(Interval::point);
        let per_size_sq = Interval::point(1.0) / Interval::point(size_sq);
        let box_across = (offset.y * chord.x - offset.x * chord.y) * per_size_sq;
        let box_along = (offset.x * chord.x + offset.y * chord.y) * per_size_sq;
        let mut across = across.intersection(box_across)?;
        if !slope.is_finite() {
            // Going up, the force of a cable need not stay between those of its ends.
            reach = reach.max(box_along.magnitude());
        }
        // So does the strip along the line from anchor to attachment. Against the chord, which runs
        // from one offset to another, a point of the strip is between their differences.
        if offset_n.is_bounded() {
            // From taut to slack the chord runs against the line.
            let line = -self.chord();
            let (nx, nz) = (Interval::point(-line.y), Interval::point(line.x));
            let offset = |f: &Vector2<f64>| nx * Interval::point(f.x) + nz * Interval::point(f.y);
            let chord_ends = offset(&center_n) + Interval::symmetric(reach) * offset(&half_chord_n);
            // The normal of the chord against that of the line, at least this much of it.
            let cosine = (nz * chord.x - nx * chord.y) / Interval::point(size);
            let line_error = Interval::symmetric(
                8.0 * f64::EPSILON * hull.force_n.map(Interval::magnitude).sum(),
            );
            if cosine.low() > 0.5 {
                let width =
                    (-offset_n - chord_ends + line_error) / (Interval::point(size) * cosine);
                across = across.intersection(width)?;
            }
        }
        if !across.is_bounded() {
            return None;
        }
        let center_n = center_n + normal_n * across.middle();
        let thickness = across.radius()
            + 4.0 * f64::EPSILON * (1.0 + across.magnitude() + center_n.amax() / size);
        let x_error =
            if self.plane.x_m > 0.0 { 2.0 * self.plane_error_m / self.plane.x_m } else { 0.0 };
        let error_n = |x_n: f64, z_n: f64| {
            x_error.min(2.0) * x_n.abs() + PLANE_WRENCH_ROUNDING * (x_n.abs() + z_n.abs())
        };
        let force_n = hull.force_n.map(Interval::magnitude);
        let wrench_error_n = error_n(force_n.x, force_n.y);
        let normal_error_n = error_n(normal_n.x, normal_n.y);
        Some(Piece {
            shorter,
            longer,
            center_n,
            half_chord_n,
            reach,
            thickness,
            slope,
            apex: apex(&shorter, &longer, &half_chord_n),
            center_wrench: self.plane.wrench_n(&center_n),
            chord_wrench: self.plane.wrench_n(&half_chord_n),
            normal_wrench: self.plane.wrench_n(&normal_n),
            wrench_error_n,
            normal_error_n,
        })
    }

    /// The box of forces and lengths between two points of the curve, by its monotonicity.
    pub(crate) fn hull(
        &self,
        shorter: &CableState<Interval>,
        longer: &CableState<Interval>,
    ) -> CableState<Interval> {
        let rest_length_m = shorter.rest_length_m.hull(longer.rest_length_m);
        let x = shorter.force_n.x.hull(longer.force_n.x);
        let at_attachment = shorter.force_n.y.hull(longer.force_n.y);
        let weight = self.enclosing.weight_n_m();
        let at_anchor = (shorter.force_n.y - weight * shorter.rest_length_m)
            .hull(longer.force_n.y - weight * longer.rest_length_m)
            + weight * rest_length_m;
        let y = if self.target.y.high() <= 0.0 {
            at_attachment
        } else if self.target.y.low() >= 0.0 {
            at_anchor
        } else {
            at_attachment.hull(at_anchor)
        };
        CableState { force_n: Vector2::new(x, y), rest_length_m }
    }

    /// A point of the curve between the ends of a piece, near `u` on its chord.
    pub(super) fn cut(&self, piece: &Piece<M::End>, u: f64) -> Option<Node<M::End>> {
        let size = piece.half_chord_n.norm();
        let axis = piece.half_chord_n / size;
        let (a, b) = (&piece.shorter.near, &piece.longer.near);
        let between = |node: &Node<M::End>| {
            let l = node.state.rest_length_m;
            l.low() > piece.shorter.state.rest_length_m.high()
                && l.high() < piece.longer.state.rest_length_m.low()
        };
        let u = u.clamp(-CUT_MARGIN, CUT_MARGIN);
        let chord_point = piece.center_n + piece.half_chord_n * u;
        let share = 0.5 * (1.0 + u);
        let guess = CableState {
            force_n: chord_point,
            rest_length_m: a.rest_length_m + (b.rest_length_m - a.rest_length_m) * share,
        };
        let by_force = || {
            let state = self.approach(guess, axis, chord_point.dot(&axis))?;
            self.node(state).filter(between)
        };
        let by_length = || {
            let middle = (a.rest_length_m * b.rest_length_m).sqrt();
            self.node(self.at_length(middle)?).filter(between)
        };
        by_force().or_else(by_length)
    }
}

/// Where the tangents at the ends of a chord meet, as a part of half the chord from its middle; 0 when
/// they do not.
fn apex<E>(shorter: &Node<E>, longer: &Node<E>, half_chord: &Vector2<f64>) -> f64 {
    let slope = |t: &Vector2<f64>| {
        (t.y * half_chord.x - t.x * half_chord.y) / (t.x * half_chord.x + t.y * half_chord.y)
    };
    let (begin, end) = (slope(&shorter.tangent), slope(&longer.tangent));
    let u = (begin + end) / (end - begin);
    if begin * end < 0.0 && u.is_finite() { u } else { 0.0 }
}
