//! What is proven about a solution: that it exists, that it is alone, and that it belongs to the
//! branch of the solution before.
//!
//! # Coordinates
//!
//! At the linearisation point `(F_i, L_i)` of a tick let `t_i` be the unit tangent of force curve `i`
//! and `p_i = t_i . (F - F_i)`. While the platform moves from its last pose (`s = 0`) to the new one
//! (`s = 1`, attachments, lever arms and load moving along straight lines), the curves move too; the
//! point of curve `i` at `p_i` has the force `F_i^s(p_i)`, and what must vanish is
//!
//! ```text
//! Phi_s(p) = wrench(s) + sum_i G_i^s F_i^s(p_i),      A = (columns G_i^1 t_i)^-1
//! ```
//!
//! A way `p` is measured by the wrench that makes it: `|p| = max |p_i|/a_i`, where the gain `a_i` of a cable is the norm
//! of row `i` of `A`, so that `|A w| <= |w|_2` for every wrench `w`. Of what rounding leaves of the balance a cable with a
//! small gain feels little, however much the others do, and where it bends matters as little.
//!
//! # Theorem
//!
//! (Banach, with a parameter.) Let `c(s)` go straight from the last solution to 0. Let `|A Phi_s(c(s))| <=
//! eta` and, for all `|p - c(s)| <= 2 eta`, `|A Phi_s'(p) - I| <= k <= 1/2`, for all `s`. Then for every `s`
//! there is exactly one solution in that ball, which depends continuously on `s`; at `s = 0` it is the
//! last solution, if that is known to be in its ball: the two ends belong to one branch.
//!
//! # Bounds
//!
//! `Phi` is separable: column `i` of `Phi_s'` is the wrench of one unit tangent. If these change by `c_i` at most, then
//! `|A Phi_s' - I| <= sum a_i c_i`. It changes because the
//! tangent turns along its curve (curvature times `p`), because the curve moves (turn times the move of
//! the attachment, in the plane and with the plane), and because the lever arm moves. With a lever arm
//! below 1 (moments are over the largest one) a unit force has a wrench of at most `sqrt 2`. How much a
//! curve can bend and move is a property of the cable model, its [`CurveShape`]. The bounds hold over
//! the whole tube of balls and all poses in between, not only at the point: within the trusted region,
//! where no end tension changes by more than a sixteenth, they are taken at their worst.
//!
//! `A Phi_s(c(s))` is the Newton step at `s = 1`; at `s = 0` it is at most `1 + k` times what the last
//! solution is off; in between it is no more than at both ends but for an eighth of its second
//! derivative in `s`, which the same bounds give.

use core::f64::consts::SQRT_2;

use nalgebra::{Vector2, Vector3};

use crate::{
    CABLES, CableModel, CablePlane, CurvePoint, IrvineCatenary, LinearElastic, Load, NonDeformable,
    Parabola, Real, Scalar,
};

/// Numbers without dimension that bound how the force curve of a cable model bends, and how it moves
/// with the end of the cable. They hold for all states of a cable that hangs down to its attachment
/// (`z <= 0`) and, of others, for those with `W <= 3/4 S`; tension is positive along the cable and the
/// mean strain of its ends below one tenth.
///
/// With `T` the smaller of the end tensions, `S` their sum, `W` the weight of the cable and
/// `n = Fx/X` the stiffness of its swing:
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveShape {
    /// The curvature of the force curve is at most this times `(q^2 + q/300) Fx / T^2`, `q = W/S`; the second
    /// term is for light cables that stretch by as much as a tenth.
    pub curvature: f64,
    /// When the end moves, the force across the tangent changes by at most this times `n` per metre.
    pub response: f64,
    /// And the tangent turns by at most this times `n/T` per metre.
    pub turn: f64,
    /// The second derivative of that force is at most this times `(n^2 + w^2)/T`, and `n/X` more for cables
    /// folded nearly double.
    pub second: f64,
}

/// A [`CableModel`] whose [`CurveShape`] is known, so that its branches can be certified.
///
/// # Contract
/// The bounds of [`CurveShape`] hold; the force at the anchor changes by at most 3/2 of what the
/// force at the attachment does along the curve, and by `n + w` per metre that the end moves; and `n` is at most the sum of
/// the two numbers in [`CurvePoint::normal_force_by_end_n_m`], without their signs.
pub trait ShapedCable<T: Scalar>: CableModel<T> {
    /// The bounds.
    const SHAPE: CurveShape;
}

/// Of the elastic catenary: the largest values over all states (sampled: see the tests) are 6.64, 2.28,
/// 4.36 and 1.02.
const CATENARY: CurveShape = CurveShape { curvature: 7.0, response: 2.4, turn: 4.6, second: 1.1 };

impl<T: Scalar> ShapedCable<T> for IrvineCatenary<T> {
    const SHAPE: CurveShape = CATENARY;
}

/// Of the parabola, sampled likewise: 7.74, 1.92, 3.78 and 1.02.
const PARABOLA: CurveShape = CurveShape { curvature: 8.0, response: 2.1, turn: 4.0, second: 1.1 };

impl<T: Scalar> ShapedCable<T> for Parabola<T> {
    const SHAPE: CurveShape = PARABOLA;
}

/// Straight lines: nothing bends, and the force turns with the line.
const LINE: CurveShape = CurveShape { curvature: 0.0, response: 1.0, turn: 1.0, second: 1.1 };

impl<T: Scalar> ShapedCable<T> for LinearElastic<T> {
    const SHAPE: CurveShape = LINE;
}

impl<T: Scalar> ShapedCable<T> for NonDeformable {
    const SHAPE: CurveShape = LINE;
}

/// What is proven about a [`Command`](crate::Command).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Certificate<T> {
    /// Kantorovich's `h = omega eta`: the change of the derivative, multiplied by its inverse, per newton of wrench over
    /// the whole ball, and the largest Newton step of all poses in between. At most 1/4.
    pub h: T,
    /// Contraction of the simplified Newton's method over the ball and over all poses since the last
    /// command: at most 0.44.
    pub contraction: T,
    /// There is a solution at which no cable's force is further from the command than this, N along its force curve.
    /// Rounding is in it, and where moves are short and told by the twist nearly all of it.
    pub existence_n: [T; CABLES],
    /// And no other at which none is further than so many times that.
    pub uniqueness_ratio: T,
}

impl<T: Real> Move<T> {
    /// No move.
    pub(crate) fn none() -> Self {
        Self { attachment_m: T::zero(), lever_arm: T::zero() }
    }

    /// A part of the move.
    pub(crate) fn part(&self, share: T) -> Self {
        Self { attachment_m: self.attachment_m * share, lever_arm: self.lever_arm * share }
    }
}

/// How far the platform has moved since the last certified solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Move<T> {
    /// No attachment has moved further, m.
    pub(crate) attachment_m: T,
    /// No lever arm has moved further, over the moment arm.
    pub(crate) lever_arm: T,
}

/// The factor between `S / (|x| + |z|)` and the bound on the response of the force over the trusted region:
/// `n <= S/(2 L)`, where `S` may rise by 1/16, `L` is at least the distance over 1.2, and the distance at
/// least `(|x| + |z|)/sqrt 2`.
const RESPONSE_OVER_REGION: f64 = 0.5 * 1.2 * SQRT_2 * 17.0 / 16.0;

/// The tensions of a cable.
#[allow(clippy::struct_field_names)] // all are newtons
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hanging<T> {
    /// At the attachment, N.
    pub(crate) tension_n: T,
    /// At the anchor, N.
    pub(crate) anchor_tension_n: T,
    /// The vertical force there, `Fz - W`, N.
    pub(crate) anchor_vertical_n: T,
}

impl<T: Real> Hanging<T> {
    /// Of a cable of this weight per length.
    #[inline]
    pub(crate) fn new(weight_n_m: T, force_n: &Vector2<T>, rest_length_m: T) -> Self {
        let anchor_vertical_n = force_n.y - weight_n_m * rest_length_m;
        let horizontal_sq = force_n.x * force_n.x;
        Self {
            tension_n: (horizontal_sq + force_n.y * force_n.y).sqrt(),
            anchor_tension_n: (horizontal_sq + anchor_vertical_n * anchor_vertical_n).sqrt(),
            anchor_vertical_n,
        }
    }
}

/// Sums over the cables of what may change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Change<T> {
    /// Change of the matrix per newton of wrench, at the new pose, 1/N.
    bend_per_n: T,
    /// Its change over the tube and the move.
    column: T,
    /// Its change by the way back to the curves.
    turned: T,
    /// Change of the wrench of second order along the tube, N.
    path_n: T,
    /// Change of the wrench of second order over the move, per metre of it, N/m.
    second_n: T,
    /// And by the way back to the curves, N.
    gap_n: T,
    /// Whether all cables stay within their trusted regions.
    is_trusted: bool,
}

impl<T: Real> Change<T> {
    #[inline]
    pub(crate) fn new() -> Self {
        Self {
            bend_per_n: T::zero(),
            column: T::zero(),
            turned: T::zero(),
            path_n: T::zero(),
            second_n: T::zero(),
            gap_n: T::zero(),
            is_trusted: true,
        }
    }

    /// Adds a cable, hanging as in `cable` after the Newton step, which has come `along_n` along its
    /// curve, in a tube of `radius_n`, newtons of wrench.
    #[inline]
    #[allow(clippy::too_many_arguments)] // all that is known of a cable
    pub(crate) fn add(
        &mut self,
        shape: &CurveShape,
        weight_n_m: T,
        plane: &CablePlane<T>,
        curve: &CurvePoint<T>,
        horizontal_n: T,
        cable: &Hanging<T>,
        rest_length_m: T,
        moved: &Move<T>,
        along_n: T,
        radius_n: T,
        gain: T,
    ) {
        let (one, two, moved_m) = (T::one(), T::constant(2.0), moved.attachment_m);
        let tensions_n = cable.tension_n + cable.anchor_tension_n;
        let tension_n = cable.tension_n.min(cable.anchor_tension_n);
        let weight_n = weight_n_m * rest_length_m;
        // A lower bound of the distance of the ends at all poses: |x| + |z| is at most sqrt 2 of it.
        let span_m = plane.x_m + plane.z_m.abs();
        let room_m = span_m - two * moved_m;
        let response = T::constant(shape.response * RESPONSE_OVER_REGION) * tensions_n / room_m;
        let gap_m = curve.gap_m.x.abs() + curve.gap_m.y.abs();
        let way_m = moved_m + gap_m;
        let beside_n = gain * radius_n;
        let extent = along_n + beside_n;
        // Both end forces stay within this of their places: that at the anchor changes by 3/2 of what the other does. The
        // tube ends around where the Newton step began, less than half of its radius away.
        let reach = T::constant(1.6) * extent
            + T::constant(0.75) * beside_n
            + two * (response + weight_n_m) * way_m;
        let beside_m = plane.x_m - two * moved_m; // so that there is room, too
        let hangs = plane.z_m <= T::zero() || weight_n <= T::constant(0.7) * tensions_n;
        self.is_trusted = self.is_trusted
            && hangs
            && reach <= T::constant(1.0 / 16.0) * tension_n
            && plane.x_m * plane.x_m + plane.z_m * plane.z_m
                <= T::constant(1.1 * 1.1) * rest_length_m * rest_length_m
            && beside_m > T::zero();

        let per_tension = one / tension_n;
        let per_beside = one / beside_m;
        // (16/15)^4 = 1.295: the end tensions may fall by a sixteenth.
        let ratio = (weight_n + two * reach) * per_tension / tensions_n;
        let curvature = T::constant(1.295 * shape.curvature)
            * (ratio * (ratio + per_tension * T::constant(1.0 / 300.0)))
            * (horizontal_n + reach);
        let swing = response * per_tension;
        let turn_per_m = T::constant(16.0 / 15.0 * shape.turn / shape.response) * swing;
        let turn = turn_per_m * way_m;
        let with_plane =
            (curve.tangent.x.abs() + turn + curvature * extent) * (moved_m * per_beside);
        let column = T::constant(SQRT_2) * (turn + with_plane) + moved.lever_arm;
        let bend = T::constant(SQRT_2) * curvature;
        let total = column + bend * extent;
        self.bend_per_n += gain * gain * bend;
        self.column += gain * total;
        self.turned += gain * (turn_per_m * gap_m);
        self.path_n += along_n * (bend * along_n + two * column);
        // Of second order: the response itself changes, and the plane turns around the anchor.
        let second = T::constant(16.0 / 15.0 * shape.second)
            * (response * swing + weight_n_m * weight_n_m * per_tension)
            + T::constant(10.0) * response * per_beside;
        self.gap_n += second * (gap_m * gap_m);
        self.second_n += second * moved_m + two * moved.lever_arm * response;
    }

    /// The certificate, or the contraction where there is none.
    ///
    /// # Errors
    /// The contraction; it may be small, when a cable leaves its trusted region.
    #[inline]
    pub(crate) fn certify(
        &self,
        gains: &[T; CABLES],
        inverse_norm: T,
        newton: &NewtonSize<T>,
        moved: &Move<T>,
    ) -> Result<Certificate<T>, T> {
        let one = T::one();
        // A function lies between its values at the ends of [0, 1] but for an eighth of its second
        // derivative; a linearisation is off by half of it. A unit force has a wrench of sqrt 2.
        let second_n = T::constant(0.125)
            * (T::constant(SQRT_2) * self.second_n * moved.attachment_m + self.path_n);
        let gap_n = T::constant(0.5 * SQRT_2) * self.gap_n;
        let rounded = T::constant(INVERSE_ROUNDING) * T::EPSILON * inverse_norm;
        let radius_n = newton.radius_n();
        let eta = newton.bound_n() + second_n + gap_n;
        let contraction = self.column + rounded;
        // All of it is false for NaN.
        let proven = self.is_trusted
            && eta + eta <= radius_n
            && contraction <= T::constant(LARGEST_CONTRACTION);
        if !proven {
            return Err(contraction);
        }
        let omega = self.bend_per_n;
        let known_n = newton.step_n + newton.rounding_n + gap_n;
        let here = omega * (known_n + known_n) + T::constant(SQRT_2) * self.turned + rounded;
        // For a solution `p*` and the step `p_1`, |p* - p_1| <= here |p*| and what is rounded; `here` is below a half.
        let existence_n = (here * newton.step_n + newton.rounding_n + gap_n) / (one - here);
        let uniqueness_n = radius_n - newton.step_n * (one + here);
        Ok(Certificate {
            h: omega * eta,
            contraction,
            existence_n: gains.map(|gain| gain * existence_n),
            uniqueness_ratio: uniqueness_n / existence_n,
        })
    }
}

/// The sizes from which the ball of a certificate is made, in newtons of wrench.
#[allow(clippy::struct_field_names)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NewtonSize<T> {
    /// The Newton step at the new pose.
    pub(crate) step_n: T,
    /// The way from the last solution along the curves.
    along_n: T,
    /// What the last solution may be off.
    known_n: T,
    /// Rounding of the residual.
    rounding_n: T,
}

impl<T: Real> NewtonSize<T> {
    /// Before any cable.
    #[inline]
    pub(crate) fn new(rounding_n: T) -> Self {
        Self { step_n: T::zero(), along_n: T::zero(), known_n: T::zero(), rounding_n }
    }

    /// Adds a cable: its Newton step, its way since the last solution, and what that may be off, N along its curve. What is
    /// no number may be lost here; no trusted region has it.
    #[inline]
    pub(crate) fn add(&mut self, gain: T, back_n: T, along_n: T, known_n: T) {
        let per_gain = T::one() / gain;
        self.step_n = self.step_n.max(back_n.abs() * per_gain);
        self.along_n = self.along_n.max(along_n * per_gain);
        // The tangent has turned since it was found, by 0.44 at most, and what is off across it counts by the sine of that.
        self.known_n = self.known_n.max(known_n * T::constant(1.45) * per_gain);
    }

    /// Bound on `|A Phi_s|` at both ends of the tube: at the start it is `1 + k` times what the last
    /// solution is off, with `k` below a half.
    #[inline]
    fn bound_n(&self) -> T {
        (self.step_n + self.rounding_n).max(self.known_n * T::constant(1.5))
    }

    /// Radius of the tube: twice the bound, an eighth of that, and for what is of second order along the
    /// way, a third of the way.
    #[inline]
    pub(crate) fn radius_n(&self) -> T {
        self.bound_n() * T::constant(2.25) + self.along_n * T::constant(0.35)
    }
}

/// The theorem wants one half. The bounds are about angles and arcs, where the theorem asks for tangents and chords: no
/// angle is larger than this, as gains are `1/sqrt 2` at least, and `tan(asin 0.44) = 0.4900`.
const LARGEST_CONTRACTION: f64 = 0.44;

/// Rounding of the matrix of tangent wrenches and of its inverse, times the rounding unit and the
/// Frobenius norm of the inverse, which the gains have as well: `sum a_i c_i <= |A| |c|`. Elimination with partial pivoting
/// is off by `6 g |M|` with `|M| <= sqrt 12` and the growth `g` hardly ever above 8: 166, of which 8 were found in two
/// million matrices; the tangents by 32 units each, of which 4.4 were found, so `32 sqrt 12`. (An end that is nearer to
/// its anchor than a hundredth of its coordinates may turn a tangent further.)
const INVERSE_ROUNDING: f64 = 300.0;

impl<T: Real> Certificate<T> {
    /// Where nothing is proven.
    pub(crate) fn none() -> Self {
        Self {
            h: T::HUGE,
            contraction: T::HUGE,
            existence_n: [T::HUGE; CABLES],
            uniqueness_ratio: T::zero(),
        }
    }
}

/// Rounding of what a cable adds to the wrench, in units of `T::EPSILON`, N: of its force, and of its end,
/// which is known to a few units of the lengths that it is made of.
#[inline]
pub(crate) fn rounding<T: Real>(curve: &CurvePoint<T>, force_n: &Vector2<T>, lengths_m: T) -> T {
    let by_end = &curve.normal_force_by_end_n_m;
    let (force, by_end) = (force_n.x.abs() + force_n.y.abs(), by_end.x.abs() + by_end.y.abs());
    T::constant(FORCE_ROUNDINGS) * force + T::constant(END_ROUNDINGS) * (by_end * lengths_m)
}

/// And of the wrench of the load, which does not depend on the pose.
pub(crate) fn load_rounding<T: Real>(load: &Load<T>, per_moment_arm_m: T) -> T {
    let size = |v: &Vector3<T>| v.x.abs() + v.y.abs() + v.z.abs();
    let weight_n = (load.mass_kg * load.gravity_m_s2).abs();
    let moment_nm = weight_n * size(&load.center_of_mass_m) + size(&load.moment_nm);
    T::constant(LOAD_ROUNDINGS)
        * (weight_n + size(&load.force_n) + T::constant(2.0) * moment_nm * per_moment_arm_m)
}

/// Of the wrench of a force, with half a unit for each operation, and their worst in each: 5 halves in a force, for its
/// direction is off by 4; with 5 of the lever arm and 2 of the products 12 in a moment; `sqrt(5^2 + 12^2) = 13`. And 6
/// in a sum with that of the load of six wrenches that are up to `sqrt 2` of their forces: 8.5.
const FORCE_ROUNDINGS: f64 = 11.0;

/// Of the force of the load: 2 halves, and 6 in the sum. Of its moment 10, for its arm is off by 5, and 6: twice as many.
const LOAD_ROUNDINGS: f64 = 4.0;

/// Of the end of a cable: 2.7 units of its length are the most that was found for the end-point map as it moves the force,
/// and the attachment is off by a half for each of the two sums that make it, and by the lever arm; each moves a force with
/// a wrench of `sqrt 2`. Beside its plane a force follows the end by no more than it does in the plane: see the contract of
/// [`ShapedCable`].
const END_ROUNDINGS: f64 = 4.0;
