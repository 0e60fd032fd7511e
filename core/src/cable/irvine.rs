//! The elastic catenary (H. M. Irvine, Cable Structures, 1981; the paper's equation 2).

use nalgebra::{Matrix2x3, Vector2};

use super::tension_profile::TensionProfile;
use super::{CableModel, EndPoint, LinearElastic};
use crate::chart::{Charted, Hung};
use crate::line::{self, LineFault, LineSolution};
use crate::root::{Taylor, monotone_root};
use crate::{Real, Scalar};

/// Elastic catenary: a cable with weight and linear stretch.
///
/// The paper's equation (2) is misprinted (`Fx` is missing under `Fz` in the arcsinh) and cancels
/// for taut cables. The same map in the elliptic coordinates `q`, `c` of the force, with
/// `S = T_A + T_B` and `e = S / (2 EA)` the mean strain of the ends, does not:
///
/// ```text
/// X = (2 L / S) Fx (atanh(q)/q + e)        Z = L c (1 + e)
/// ```
///
/// It is regular at `w = 0` (massless elastic cable), at `1/EA = 0` (inextensible) and at both (the
/// non-deformable cable). The only singular points are those where the tension vanishes along the
/// cable: `Fx = 0` with `0 <= Fz <= w L`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IrvineCatenary<T> {
    /// Weight per rest length, N/m.
    pub weight_n_m: T,
    /// Reciprocal axial stiffness `1/EA`, 1/N. Zero: inextensible.
    pub compliance_per_n: T,
}

impl<T: Scalar> CableModel<T> for IrvineCatenary<T> {
    /// With `e` and `sag = atanh(q)/q - 1` the derivatives are sums of terms of one sign:
    ///
    /// ```text
    /// dX/dFx = (2L/S) (e + sag + c^2 (1 - q^2) / (1 - q^2 c^2))
    /// dX/dFz = dZ/dFx = -(2L/S) (2 Fx/S) c / (1 - q^2 c^2)
    /// dZ/dFz = (2L/S) (e + (1 - c^2) / (1 - q^2 c^2)),      1 - c^2 = (2 Fx/S)^2 / (1 - q^2)
    /// ```
    // Left to the compiler this stays a call whose result goes through memory: 8 % of a single line.
    #[allow(clippy::inline_always)]
    #[inline(always)]
    fn end_point(&self, force_n: Vector2<T>, rest_length_m: T) -> EndPoint<T> {
        let one = T::one();
        let profile = TensionProfile::new(force_n, self.weight_n_m * rest_length_m);
        let sag = profile.sag();
        let two_inverse_sum = profile.inverse_sum + profile.inverse_sum;
        // L / (S/2), the compliance of a massless cable sideways.
        let lateral = rest_length_m * two_inverse_sum;
        let strain = T::constant(0.5) * self.compliance_per_n * profile.sum;
        let (c, balance) = (profile.slope, profile.balance);
        let across = force_n.x * two_inverse_sum; // 2 Fx / S
        let c_balance = c * balance;
        let x_fx = lateral * (strain + sag + c * c_balance * profile.openness());
        let cross = -(lateral * (across * c_balance));
        let z_fz = lateral * (strain + across * (across / profile.openness()) * balance);
        let per_length = self.compliance_per_n + profile.inverse_tension_a;
        EndPoint {
            position_m: Vector2::new(
                rest_length_m * (across * (one + sag + strain)),
                rest_length_m * (c * (one + strain)),
            ),
            jacobian: Matrix2x3::new(
                x_fx,
                cross,
                profile.force_a.x * per_length,
                cross,
                z_fz,
                profile.force_a.y * per_length,
            ),
        }
    }

    fn weight_n_m(&self) -> T {
        self.weight_n_m
    }

    fn at_deformation(&self, s: T) -> Self {
        Self { weight_n_m: self.weight_n_m * s, compliance_per_n: self.compliance_per_n * s }
    }

    fn with_weight(&self, weight_n_m: T) -> Option<Self> {
        Some(Self { weight_n_m, ..*self })
    }

    /// One equation for `S`; at most [`line::root_iteration_bound`] iterations, usually 2.
    fn force_at_length(
        &self,
        x_m: T,
        z_m: T,
        rest_length_m: T,
    ) -> Result<LineSolution<T>, LineFault>
    where
        T: Real,
    {
        force_at_length(self, x_m, z_m, rest_length_m)
    }
}

/// What the force density of a catenary is, and with it all that does not depend on where it ends.
#[derive(Clone, Copy, Debug)]
pub struct Slackness<T: Scalar> {
    /// `s`, and its square.
    root: T,
    square: T,
    /// `q = w/(2m)`, `1 + q` and `1 - q^2`.
    q: T,
    twice: T,
    open: T,
    /// `atanh(q)/q - 1`.
    sag: T,
    /// `m`, N/m.
    density: T,
}

/// With `m` the force density, `q = w/(2m)`, `sag = atanh(q)/q - 1`, `e` the mean strain of the ends,
/// `P = 1 + e` and `Q = P + sag`, the catenary through two given points is explicit but for the strain
/// `e = m L/EA`:
///
/// ```text
/// Fx = m x/Q        Fz = w L/2 + m z/P        L^2 = x^2/(Q^2 (1 - q^2)) + z^2/P^2
/// ```
///
/// With `r = q^2/(1 - q^2)`, `u = x^2/(Q^2 (1 - q^2) L^2)`, `v = 1 - u = z^2/(P^2 L^2)` and
/// `f = e (u/Q + v/P)`, the logarithmic derivatives by `m` are `sag - r` of the sag and `-a` of the length,
///
/// ```text
/// a = (g + f)/(1 + f),        g = u (r (1 - 1/Q) + sag/Q)
/// ```
///
/// and `dL/L = (u dx/x + v dz/z)/(1 + f)` at fixed `m`. All factors are positive and nothing cancels for taut
/// cables, where `sag`, `r`, `e` and with them all corrections to `F = m (x, z)` are small.
impl<T: Scalar> Charted<T> for IrvineCatenary<T> {
    type Slackness = Slackness<T>;

    #[inline]
    fn slackness(&self, root: T) -> Slackness<T> {
        let one = T::one();
        let square = root * root;
        let q = one / (one + square);
        let gap = square * q;
        let twice = one + q;
        let density = T::constant(0.5) * self.weight_n_m * (one + square);
        let sag = q * q * T::atanh_tail(q, gap);
        Slackness { root, square, q, twice, open: gap * twice, sag, density }
    }

    #[inline]
    fn hung(&self, x_m: T, z_m: T, slackness: &Slackness<T>, strain: T) -> Hung<T> {
        let (one, two, half) = (T::one(), T::constant(2.0), T::constant(0.5));
        let Slackness { root, square, q, twice, open, sag, density } = *slackness;
        let half_n_m = half * self.weight_n_m;
        let stretch = one + strain;
        let (per_stretch, per_wide) = (one / stretch, one / (stretch + sag));
        let (across, down) = (x_m * per_wide, z_m * per_stretch);
        let (across_sq, down_sq) = (across * across, down * down * open);
        let span_sq = across_sq + down_sq; // L^2 (1 - q^2)
        let per_span_sq = one / span_sq;
        let rest_length_m = (span_sq / open).sqrt();
        let (level, steep) = (across_sq * per_span_sq, down_sq * per_span_sq);
        let softness = strain * (level * per_wide + steep * per_stretch);
        let per_soft = one / (one + softness);
        let (sag_share, stretch_share) = (sag * per_wide, (strain + sag) * per_wide);
        let slack_share = q * q / open;
        let bend = level * (slack_share * stretch_share + sag_share);
        let strain_rate = strain * (one - bend) * per_soft;

        // Rates by p: d ln m/dp = drive s^3 q, because m = (w/2)(1 + s^2) and p = c/s - s^2. What grows with
        // s or falls with it is multiplied before it becomes a factor of its own: m s^3 q, r s^3 q, L s.
        let scale = T::constant(crate::chart::CHART_SCALE);
        let cube = square * root;
        let drive = -(two / (scale + two * cube));
        let driven = -(one / (one + half * scale / cube)); // drive s^3
        let rate = driven * q;
        let density_rate = half_n_m * driven;
        let density_room = half_n_m * drive * root * q / twice;
        let length_root = (span_sq / (q * twice)).sqrt();
        let shortening = level * stretch_share * length_root * (drive * q * q / twice)
            + (level * sag_share + softness) * rest_length_m * rate;
        let half_weight = half_n_m * rest_length_m;
        let (fx, pull) = (density * across, density * down);
        // d ln L / dx and / dz.
        let length_by_x = across * per_wide * per_span_sq * per_soft;
        let length_by_z = down * per_stretch * open * per_span_sq * per_soft;
        let lift = half_weight - pull * per_stretch * strain;
        let softer = strain * per_wide;
        Hung {
            force_n: Vector2::new(fx, half_weight + pull),
            rest_length_m,
            heading_m: Vector2::new(
                across * (one - sag_share + (slack_share - strain_rate) * per_wide),
                down * (one - strain_rate * per_stretch)
                    - rest_length_m * q * ((bend + softness) * per_soft),
            ),
            force_by_chart_n: Vector2::new(
                across
                    * (density_rate * (one - strain_rate * per_wide - sag_share)
                        + density_room * per_wide),
                down * density_rate * (one - strain_rate * per_stretch)
                    - half_n_m * shortening * per_soft,
            ),
            strain_by_chart: strain_rate * rate,
            strain_by_end_per_m: Vector2::new(strain * length_by_x, strain * length_by_z),
            force_by_x_n_m: Vector2::new(
                density * per_wide * (one - softer * level * per_soft),
                length_by_x * lift,
            ),
            force_by_z_n_m: Vector2::new(
                -(fx * softer * length_by_z),
                density * per_stretch + length_by_z * lift,
            ),
        }
    }

    #[inline]
    fn strain(&self, x_m: T, z_m: T, slackness: &Slackness<T>, strain: T) -> (T, T) {
        let one = T::one();
        let Slackness { open, sag, density, .. } = *slackness;
        let stretch = one + strain;
        let (per_stretch, per_wide) = (one / stretch, one / (stretch + sag));
        let (across, down) = (x_m * per_wide, z_m * per_stretch);
        let (across_sq, down_sq) = (across * across, down * down * open);
        let span_sq = across_sq + down_sq;
        let next = self.compliance_per_n * density * (span_sq / open).sqrt();
        let softness = next * (across_sq * per_wide + down_sq * per_stretch) / span_sq;
        (next, one + softness)
    }

    fn compliance_per_n(&self) -> T {
        self.compliance_per_n
    }
}

/// The force of a given length. In the elliptic coordinates `q = W/S`, `c` of the force the two
/// equations of the end point give `c` and `Fx` explicitly, and the ellipse
/// `4 Fx^2/(S^2 - W^2) + c^2 = 1` is one equation for `S` alone:
///
/// ```text
/// (z / (L (1 + e)))^2 + (x / (L (atanh(q)/q + e)))^2 / (1 - q^2) = 1,      e = S / (2 EA)
/// ```
///
/// With `q = tanh a` the second denominator is `(L (a/sinh a + e/cosh a))^2`, so the left side
/// falls strictly with `S`, from infinity at `S = W` (`x > 0`) to zero (or to `(d/L)^2` when
/// `1/EA = 0`): there is exactly one root, and none only for an inextensible cable that is too
/// short. Multiplied out, so that nothing is divided, the equation is close to linear in `S - W`,
/// for taut cables (through `e`) as well as for slack ones (through `1 - q^2`):
///
/// ```text
/// g = ((1 + e)^2 - (z/L)^2) (1 - q^2) (atanh(q)/q + e)^2 - (x/L)^2 (1 + e)^2
/// ```
fn force_at_length<T: Real>(
    model: &IrvineCatenary<T>,
    x_m: T,
    z_m: T,
    rest_length_m: T,
) -> Result<LineSolution<T>, LineFault> {
    line::check_input(x_m, z_m, rest_length_m)?;
    let (one, half) = (T::one(), T::constant(0.5));
    let (two, three, four) = (T::constant(2.0), T::constant(3.0), T::constant(4.0));
    let weight = model.weight_n_m * rest_length_m;
    if weight <= T::zero() {
        let massless = LinearElastic { compliance_per_n: model.compliance_per_n };
        return massless.force_at_length(x_m, z_m, rest_length_m);
    }
    let per_length = one / rest_length_m;
    let (xi, zeta) = (x_m * per_length, z_m * per_length);
    // Strain for S = W; e = unit_strain S/W.
    let unit_strain = half * model.compliance_per_n * weight;
    let distance_sq = xi * xi + zeta * zeta;
    if unit_strain <= T::zero() && distance_sq >= one {
        return Err(LineFault::TooShort);
    }
    if xi <= line::vertical_ratio::<T>() {
        return vertical_force(weight, unit_strain, z_m, rest_length_m);
    }

    // u = S/W - 1 is the unknown. sag = atanh(q)/q - 1 may cancel here: it is only added to one.
    let far = T::constant(16.0);
    let sag_at = |u: T, s: T, q: T, inverse_open: T| {
        if s * s > far {
            q * q * T::atanh_tail(q, u * q)
        } else {
            // (1 + q)/(1 - q) = (s + 1)^2 / ((s + 1) u)
            half * s * ((s + one) * (s + one) * inverse_open).ln() - one
        }
    };
    let mut last = (one, one, one, one);
    let equation = |u: T| {
        let s = one + u;
        let q = one / s;
        let inverse_open = one / ((s + one) * u); // q^2 / (1 - q^2)
        let sag = sag_at(u, s, q, inverse_open);
        // The sag obeys d sag/ds = (sag - 1/(s^2 - 1)) / s, hence d^2 sag/ds^2 = 2 / (s^2 - 1)^2.
        let sag_slope = q * (sag - inverse_open);
        last = (u, sag, sag_slope, inverse_open);
        let stretch = one + unit_strain * s;
        let wide = stretch + sag;
        let widening = sag_slope + unit_strain;
        // g = a o w - b with a = stretch^2 - zeta^2, o = 1 - q^2, w = wide^2, b = (xi stretch)^2,
        // and half of their derivatives by s.
        let (a, a_slope) = (stretch * stretch - zeta * zeta, unit_strain * stretch);
        let a_curvature = unit_strain * unit_strain;
        let (o, o_slope) = ((u * q) * ((s + one) * q), q * q * q);
        let o_curvature = -three * o_slope * q;
        let (w, w_slope) = (wide * wide, wide * widening);
        // o w'' in an order in which nothing overflows for x -> 0; o inverse_open is q^2.
        let ow_bend = (o * widening) * widening + two * wide * (q * q) * inverse_open;
        let (ow, ow_slope) = (o * w, o_slope * w + o * w_slope);
        let ow_curvature = o_curvature * w + four * o_slope * w_slope + ow_bend;
        let xi_sq = xi * xi;
        Taylor {
            value: a * ow - xi_sq * (stretch * stretch),
            slope: two * (a_slope * (ow - xi_sq) + a * ow_slope),
            curvature: two
                * (a_curvature * (ow - xi_sq) + four * a_slope * ow_slope + a * ow_curvature),
        }
    };
    let start = search_start(xi, zeta, distance_sq, unit_strain);
    let (u, iterations) =
        monotone_root(equation, (T::TINY, T::HUGE), start, T::EPSILON.rough_cbrt())
            .ok_or(LineFault::OutOfRange)?;

    // The last evaluation was within the settling step, where the Taylor series of the sag is exact.
    let (last_u, last_sag, sag_slope, inverse_open) = last;
    let change = u - last_u;
    let sag = last_sag + change * (sag_slope + change * inverse_open * inverse_open);
    let s = one + u;
    let stretch = one + unit_strain * s;
    let half_sum = half * weight * s;
    let force_n = Vector2::new(
        half_sum * (xi / (stretch + sag)),
        half * weight + half_sum * (zeta / stretch),
    );
    line::polish(model, x_m, z_m, rest_length_m, force_n, iterations)
}

/// Where the search for `u = S/W - 1` starts: within some percent in each regime, which leaves two
/// evaluations for nearly all cables. `xi = x/L`, `zeta = z/L`.
#[inline]
fn search_start<T: Real>(xi: T, zeta: T, distance_sq: T, unit_strain: T) -> T {
    let (one, half) = (T::one(), T::constant(0.5));
    // Near taut, to second order in q = 1/s: unit_strain s = excess + bow / s^2, a cubic for s.
    let excess = half * (distance_sq - one);
    let bow = xi * xi * T::constant(1.0 / 6.0);
    if excess >= T::zero() {
        let straight = excess / unit_strain;
        let bent = (bow / unit_strain).rough_cbrt();
        let share = bent / (straight + bent);
        let s = straight + bent * share * share;
        // One Newton step on the cubic, where its two limits meet.
        let three_halves = T::constant(1.5);
        let slope = s * (three_halves * unit_strain * s - excess);
        let change = half * ((unit_strain * s - excess) * s * s - bow) / slope;
        let taut = (s - change - one).max(half);
        // It may also hang slack because its own weight stretches it: then u (1 + e + sag)^2 is
        // known, and sag = ln(2/u)/2 - 1.
        let stretch = one + unit_strain;
        let room = (stretch - zeta) * (stretch + zeta);
        let opening = half * xi * xi * stretch * stretch / room;
        let slack = |u: T| {
            let wide = unit_strain - half * (half * u).rough_ln();
            opening / (wide * wide)
        };
        return if room > T::zero() && opening < half {
            slack(slack(opening)).min(taut)
        } else {
            taut
        };
    }
    // Inextensible: sinh(a)/a = ratio with q = tanh(a), that is S/W = coth(a).
    let ratio = ((one - zeta) * (one + zeta)).max(T::zero()).sqrt() / xi;
    let surplus = -(excess + excess) / (xi * xi * (ratio + one)); // ratio - 1
    if surplus < T::constant(2.0) {
        // 1 + a^2/6 + a^4/120 = ratio, and coth^2(a) = 1 + 1/sinh^2(a).
        let root = (one + T::constant(1.2) * surplus).sqrt();
        let a_sq = T::constant(12.0) * surplus / (one + root);
        let opening = one / (ratio * ratio * a_sq);
        let s = (one + opening).sqrt();
        let u = opening / (s + one);
        // Stretch, by one Newton step on the cubic, or from its other end where it dominates.
        let softness = unit_strain * s * s * s;
        return if softness < bow {
            (u - s * softness / (bow + bow + T::constant(3.0) * softness)).max(half * u)
        } else {
            let bent = (bow / unit_strain).rough_cbrt();
            (bent + excess / (T::constant(3.0) * unit_strain)).max(half * bent)
        };
    }
    // Slack: a = ln(2 ratio a), one Newton step from a fit that is good to 5 %.
    let level = (ratio + ratio).rough_ln();
    let fit = half + T::constant(1.2) * level;
    let a = fit + (level + fit.rough_ln() - fit) * (fit / (fit - one));
    let growth = (ratio + ratio) * a;
    // S/W = coth(a)
    T::constant(2.0) / (growth * growth - one)
}

/// The limit `x -> 0` of the catenary, where the cable is a vertical line: taut below or above the
/// anchor, or slack with its lowest point somewhere between the ends.
fn vertical_force<T: Real>(
    weight: T,
    unit_strain: T,
    z_m: T,
    rest_length_m: T,
) -> Result<LineSolution<T>, LineFault> {
    let (one, half) = (T::one(), T::constant(0.5));
    let zeta = z_m / rest_length_m;
    let slack_slope = zeta / (one + unit_strain);
    let fz = if slack_slope.abs() <= one {
        // S = W
        half * weight * (one + slack_slope)
    } else {
        // c = +-1 and 1 + e = |zeta|
        let sum_over_weight = (zeta.abs() - one) / unit_strain;
        let side = if zeta > T::zero() { one } else { -one };
        half * weight * (one + side * sum_over_weight)
    };
    // Z = (Fz - W/2)(2L/S + L/EA), S = |Fz| + |Fz - W|
    let sum = fz.abs() + (fz - weight).abs();
    let middle = (fz + fz - weight) / weight;
    let end = middle * rest_length_m * (weight / sum + unit_strain);
    let residual_m = (end - z_m).abs();
    if residual_m.is_finite() {
        Ok(LineSolution { force_n: Vector2::new(T::zero(), fz), residual_m, iterations: 1 })
    } else {
        Err(LineFault::OutOfRange)
    }
}
