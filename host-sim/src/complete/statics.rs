//! The six equations of equilibrium over a box of six pieces.
//!
//! With `F_i = center_i + u_i half_chord_i + v_i(u_i) normal_i` and any matrix `C` near the inverse of
//! `M = [G_i half_chord_i]` the equations read
//!
//! ```text
//! u = -C (wrench + sum_i G_i center_i) - sum_i v_i(u_i) C G_i normal_i - (C M - 1) u
//! ```
//!
//! With `|v_i|` bounded the right side is a box that holds all solutions: none when it misses the
//! pieces. With `|dv_i/du_i|` bounded so that all row sums of the derivative are below one the right
//! side is a contraction: at most one solution, and exactly one when the box is mapped into itself
//! (Banach; this is Krawczyk's test for a separable system).
//!
//! The arithmetic here is plain floats with one bound on the error for all of it: every sum of `n`
//! products of floats is off by at most `n` units of the sum of their absolute values.

use cdpr_core::CABLES;
use cdpr_core::elimination::Elimination;
use nalgebra::{Matrix6, Vector6};

use super::curve::Piece;

/// Rounding per unit of the sizes that are summed: 7 additions of terms that are rounded 3 times
/// themselves, 6 products with the inverse; 20 units of 2^-53, and room.
const ROUNDING: f64 = 12.0 * f64::EPSILON;
/// How often each equation narrows the box at most, and how much one range has to shrink for another
/// time.
const SWEEPS: usize = 3;
const WORTHWHILE: f64 = 0.7;
/// For the rounding of sums of non-negative bounds.
const UPWARDS: f64 = 1.0 + 1e-12;

/// What the equations say about a box.
pub(super) struct Verdict {
    /// Holds the coordinates `u` of all solutions in the box: middle and radius, one for each cable.
    pub(super) center: Vector6<f64>,
    pub(super) radius: Vector6<f64>,
    /// Largest row sum of the derivative of the map: below one there is at most one solution.
    pub(super) contraction: f64,
    /// Largest row sum of the inverse of the chord matrix, 1/N.
    pub(super) inverse_norm: f64,
    /// How much the thickness of each piece adds to the radius, the sum over all rows.
    pub(super) thickness_share: Vector6<f64>,
    /// The same for its slope and the contraction.
    pub(super) slope_share: Vector6<f64>,
}

/// Ranges of the coordinates `u`.
pub(super) type Ranges = [(f64, f64); CABLES];

/// Bound on the error of a component of the sum of all wrenches of a box, N.
fn rounding_n<E>(pieces: &[&Piece<E>; CABLES], wrench_n: &Vector6<f64>) -> f64 {
    let mut size_n = wrench_n.amax();
    let mut error_n = 0.0;
    for piece in pieces {
        size_n += piece.center_wrench.amax()
            + piece.chord_wrench.amax()
            + piece.normal_wrench.amax() * piece.thickness;
        error_n += piece.wrench_error_n;
    }
    error_n + ROUNDING * size_n
}

/// The part of a box that each of the six equations leaves by itself; `None` when that is nothing.
///
/// It does not depend on the inverse of a matrix: it decides where the chords are nearly dependent,
/// as four slack cables always are, and bounds each tension by the load.
pub(super) fn narrow<E>(pieces: &[&Piece<E>; CABLES], wrench_n: &Vector6<f64>) -> Option<Ranges> {
    let error_n = rounding_n(pieces, wrench_n);
    let mut ranges: Ranges = pieces.map(|p| (-p.reach, p.reach));
    for sweep in 0..SWEEPS {
        let before = ranges;
        for j in 0..CABLES {
            let (mut low, mut high) = (wrench_n[j] - error_n, wrench_n[j] + error_n);
            let mut shares = [(0.0, 0.0); CABLES];
            for (i, piece) in pieces.iter().enumerate() {
                let thick = piece.normal_wrench[j].abs() * piece.thickness;
                low += piece.center_wrench[j] - thick;
                high += piece.center_wrench[j] + thick;
                let slope = piece.chord_wrench[j];
                let (a, b) = (slope * ranges[i].0, slope * ranges[i].1);
                shares[i] = (a.min(b), a.max(b));
                low += shares[i].0;
                high += shares[i].1;
            }
            if low > 0.0 || high < 0.0 {
                return None;
            }
            for (i, piece) in pieces.iter().enumerate() {
                let slope = piece.chord_wrench[j];
                // What the others leave for this one; the sums above carry their error already.
                let per_slope = 1.0 / slope;
                let (a, b) = ((shares[i].1 - high) * per_slope, (shares[i].0 - low) * per_slope);
                let (a, b) = (a.min(b), a.max(b));
                let room = 4.0 * f64::EPSILON * (a.abs() + b.abs());
                let range = &mut ranges[i];
                // Written so that NaN and infinity change nothing.
                if a - room > range.0 {
                    range.0 = a - room;
                }
                if b + room < range.1 {
                    range.1 = b + room;
                }
                if range.0 > range.1 {
                    return None;
                }
            }
        }
        let width = |r: &(f64, f64)| r.1 - r.0;
        let narrowed = ranges.iter().zip(&before).any(|(a, b)| width(a) < WORTHWHILE * width(b));
        if sweep + 1 < SWEEPS && !narrowed {
            break;
        }
    }
    Some(ranges)
}

/// Examines a box; `None` when the chords are linearly dependent.
pub(super) fn examine<E>(pieces: &[&Piece<E>; CABLES], wrench_n: &Vector6<f64>) -> Option<Verdict> {
    let mut imbalance = *wrench_n;
    for piece in pieces {
        imbalance += piece.center_wrench;
    }
    let error_n = rounding_n(pieces, wrench_n);
    let matrix = Matrix6::from_columns(&pieces.map(|p| p.chord_wrench));
    let inverse = Elimination::new(&matrix)?.inverse();
    let center = -(inverse * imbalance);
    let defect = inverse * matrix - Matrix6::identity();
    let (mut radius, mut slopes) = (Vector6::zeros(), Vector6::zeros());
    let rows: [f64; CABLES] =
        std::array::from_fn(|k| (0..CABLES).map(|j| inverse[(k, j)].abs()).sum());
    for k in 0..CABLES {
        let off: f64 = (0..CABLES).map(|j| defect[(k, j)].abs() * pieces[j].reach).sum();
        radius[k] = rows[k] * error_n + off;
        slopes[k] = radius[k];
    }
    let (mut thickness_share, mut slope_share) = (Vector6::zeros(), Vector6::zeros());
    // The columns of the normals are off as well: rounded, and of a plane that is not quite the true one.
    let turned_n: f64 = pieces
        .iter()
        .map(|p| (ROUNDING * p.normal_wrench.amax() + p.normal_error_n) * p.slope)
        .sum();
    for k in 0..CABLES {
        slopes[k] += rows[k] * turned_n;
    }
    for (j, piece) in pieces.iter().enumerate() {
        let seen = (inverse * piece.normal_wrench).abs();
        radius += seen * piece.thickness;
        slopes += seen * piece.slope;
        thickness_share[j] = seen.sum() * piece.thickness;
        slope_share[j] = seen.sum() * piece.slope;
    }
    // A maximum that keeps NaN, which proves nothing.
    let contraction = slopes.iter().fold(0.0, |most, s| if *s <= most { most } else { *s });
    let verdict = Verdict {
        center,
        radius: radius * UPWARDS,
        contraction: contraction * UPWARDS,
        inverse_norm: rows.iter().copied().fold(0.0, f64::max),
        thickness_share,
        slope_share,
    };
    verdict.radius.sum().is_finite().then_some(verdict)
}

impl Verdict {
    /// The part of `ranges` that can hold a solution; `None` when that is nothing.
    pub(super) fn narrow(&self, ranges: &Ranges) -> Option<Ranges> {
        let mut narrowed = *ranges;
        for (k, range) in narrowed.iter_mut().enumerate() {
            range.0 = range.0.max(self.center[k] - self.radius[k]);
            range.1 = range.1.min(self.center[k] + self.radius[k]);
            if range.0 > range.1 {
                return None;
            }
        }
        Some(narrowed)
    }

    /// Whether there is at most one solution in the box.
    pub(super) fn is_unique(&self) -> bool {
        self.contraction < 1.0
    }

    /// Whether the box is mapped into its inside. A piece reaches `2 - reach` at least.
    pub(super) fn maps_inside<E>(&self, pieces: &[&Piece<E>; CABLES]) -> bool {
        (0..CABLES).all(|k| self.center[k].abs() + self.radius[k] < 2.0 - pieces[k].reach)
    }
}
