//! Root of a monotone function of one positive variable, by Chebyshev's method inside a bracket.

use crate::Real;

/// A function and its first two derivatives at one point.
#[derive(Clone, Copy)]
pub(crate) struct Taylor<T> {
    pub(crate) value: T,
    pub(crate) slope: T,
    /// Second derivative; zero turns Chebyshev's method into Newton's.
    pub(crate) curvature: T,
}

/// Fast steps before the search falls back to bisection alone.
const FAST_STEPS: u32 = 32;

/// The most evaluations that [`monotone_root`] makes: fast steps, then enough bisections of the
/// logarithm to run through every number of the type.
pub(crate) const fn evaluation_bound<T: Real>() -> u32 {
    FAST_STEPS + T::BISECTIONS + 2
}

/// Finds the sign change of `f` on the positive numbers.
///
/// `f` must be negative below its root and positive above. The bracket shrinks with every
/// evaluation; a step that leaves it, or a function on which the steps do not settle, is bisected in
/// the logarithm. Returns the root and the number of evaluations, or `None` when `f` is NaN
/// somewhere or changes its sign at neither end of the number range.
///
/// A step below `settled` (relative) is the last: what is left is of the order of its cube, or of
/// its square when no curvature is given.
#[inline]
pub(crate) fn monotone_root<T: Real>(
    mut f: impl FnMut(T) -> Taylor<T>,
    bracket: (T, T),
    start: T,
    settled: T,
) -> Option<(T, u32)> {
    let (mut low, mut high) = bracket;
    let half = T::constant(0.5);
    let mut x = start.max(low).min(high);
    for evaluation in 1..=evaluation_bound::<T>() {
        let Taylor { value, slope, curvature } = f(x);
        if value < T::zero() {
            low = x;
        } else if value > T::zero() {
            high = x;
        } else if value == T::zero() {
            return Some((x, evaluation));
        } else {
            return None;
        }
        let inverse_slope = T::one() / slope;
        let newton = value * inverse_slope;
        // Chebyshev's correction, which must not turn the step around.
        let bend = (half * newton * curvature * inverse_slope).max(-half).min(half);
        let step = newton * (T::one() + bend);
        // A long step down is taken in 1/x, so that it stays positive.
        let next = if step < x { x - step } else { x * (x / (x + step)) };
        let inside = next > low && next < high; // false for NaN
        if inside && evaluation <= FAST_STEPS {
            if step.abs() <= settled * x {
                return Some((next, evaluation));
            }
            x = next;
        } else {
            if evaluation <= FAST_STEPS && step.abs() <= T::EPSILON * x {
                return Some((x, evaluation)); // the next number is already on the bracket
            }
            let middle = low.sqrt() * high.sqrt();
            if !(middle > low && middle < high) {
                let found = low > bracket.0 && high < bracket.1;
                return found.then_some((x, evaluation));
            }
            x = middle;
        }
    }
    Some((x, evaluation_bound::<T>()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(root: f64, slope: f64) -> impl Fn(f64) -> Taylor<f64> {
        move |x| Taylor { value: x / root - 1.0, slope: slope / root, curvature: 0.0 }
    }

    #[test]
    fn finds_roots_over_the_whole_range_within_the_bound() {
        for exponent in [-300, -100, -8, 0, 3, 100, 300] {
            let root = libm::pow(10.0, f64::from(exponent));
            for start in [1e-200, 1.0, 1e200] {
                // Slope given wrongly by a factor: Newton alone would crawl or run away.
                for slope in [1e-3, 1.0, 1e3] {
                    let (x, evaluations) =
                        monotone_root(line(root, slope), (f64::TINY, f64::HUGE), start, 1e-8)
                            .unwrap();
                    assert!(evaluations <= evaluation_bound::<f64>());
                    assert!((x / root - 1.0).abs() < 1e-7, "{root:e} from {start:e}: {x:e}");
                }
            }
        }
    }

    #[test]
    fn says_when_there_is_none() {
        assert_eq!(monotone_root(line(f64::NAN, 1.0), (f64::TINY, f64::HUGE), 1.0, 1e-8), None);
        assert_eq!(monotone_root(line(-1.0, -1.0), (f64::TINY, f64::HUGE), 1.0, 1e-8), None);
        let falling = |x: f32| Taylor { value: -1.0 / x, slope: 1.0, curvature: 0.0 };
        assert_eq!(monotone_root(falling, (f32::TINY, f32::HUGE), 1.0, 1e-4), None);
    }

    #[test]
    fn curvature_makes_it_third_order() {
        let cube =
            |x: f64| Taylor { value: x * x * x - 2.0, slope: 3.0 * x * x, curvature: 6.0 * x };
        let (x, evaluations) = monotone_root(cube, (f64::TINY, f64::HUGE), 2.0, 5e-6).unwrap();
        assert!((x - libm::cbrt(2.0)).abs() < 4e-16);
        let (_, by_newton) = monotone_root(
            |x| Taylor { curvature: 0.0, ..cube(x) },
            (f64::TINY, f64::HUGE),
            2.0,
            1e-8,
        )
        .unwrap();
        assert!(evaluations < by_newton, "{evaluations} against {by_newton}");
    }
}
