//! Monitors beside the controller: they see tensions, warn, and never change a command.
//!
//! Whatever the statics leaves out shows in the measured tensions: a swinging or bouncing load in
//! their common excess over the commanded ones as time goes by, a wrong length or load in how
//! unequal the excesses of the cables are.

use micromath::statistics::{Mean, Variance};

use crate::{CABLES, Scalar};

/// What a monitor has to say.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Warning {
    /// The load swings or bounces.
    LoadSwings {
        /// Standard deviation over the window of the mean excess of tension, N.
        deviation_n: f32,
    },
    /// The load is not shared as commanded.
    TensionsSpread {
        /// Standard deviation among the cables of the excess of tension, the root of its mean
        /// square over the window, N.
        deviation_n: f32,
    },
}

/// When a [`TensionMonitor`] warns.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MonitorThresholds {
    /// Largest standard deviation over time of the mean excess, N.
    pub swing_n: f32,
    /// Largest standard deviation of the excess among the cables, N.
    pub spread_n: f32,
}

/// Watches measured tensions over the last `WINDOW` ticks, 2 at least.
///
/// The **excess** of a cable is its measured tension at the anchor less the commanded one. A warning
/// is given once, when a deviation rises above its threshold, and again only after it was below 80 %
/// of it, so that noise at the threshold does not flood the events.
#[derive(Clone, Debug)]
pub struct TensionMonitor<const WINDOW: usize> {
    thresholds: MonitorThresholds,
    mean_n: [f32; WINDOW],
    spread_n2: [f32; WINDOW],
    next: usize,
    is_full: bool,
    swings: Alarm,
    spreads: Alarm,
}

impl<const WINDOW: usize> TensionMonitor<WINDOW> {
    /// A window with nothing in it yet.
    #[must_use]
    pub fn new(thresholds: MonitorThresholds) -> Self {
        Self {
            thresholds,
            mean_n: [0.0; WINDOW],
            spread_n2: [0.0; WINDOW],
            next: 0,
            is_full: false,
            swings: Alarm::default(),
            spreads: Alarm::default(),
        }
    }

    /// Takes the tensions at the anchors of one tick, N: `None` where none is measured. Ticks with
    /// fewer than two finite measurements are left out.
    ///
    /// No warning comes before the window is full. Cost: three passes over the window.
    pub fn update(
        &mut self,
        measured_n: &[Option<f32>; CABLES],
        commanded_n: &[f32; CABLES],
    ) -> [Option<Warning>; 2] {
        let mut excess_n = [0.0; CABLES];
        let mut count = 0;
        for (measured, commanded) in measured_n.iter().zip(commanded_n) {
            let Some(excess) = measured.map(|m| m - commanded).filter(|e| e.is_finite()) else {
                continue;
            };
            if let Some(free) = excess_n.get_mut(count) {
                *free = excess;
                count += 1;
            }
        }
        let measured = excess_n.get(..count).unwrap_or(&[]);
        let (Some(mean), Some(spread)) =
            (self.mean_n.get_mut(self.next), self.spread_n2.get_mut(self.next))
        else {
            return [None; 2]; // a window of no length
        };
        if count < 2 {
            return [None; 2];
        }
        *mean = measured.iter().copied().mean();
        *spread = measured.variance();
        self.next += 1;
        if self.next == WINDOW {
            self.next = 0;
            self.is_full = true;
        }
        if !self.is_full {
            return [None; 2];
        }
        let swing_n2 = self.mean_n.as_slice().variance();
        let spread_n2 = self.spread_n2.iter().copied().mean();
        // micromath's own root is 6 % off, and squares compare as well.
        [
            self.swings
                .rises(swing_n2, self.thresholds.swing_n)
                .then(|| Warning::LoadSwings { deviation_n: Scalar::sqrt(swing_n2) }),
            self.spreads
                .rises(spread_n2, self.thresholds.spread_n)
                .then(|| Warning::TensionsSpread { deviation_n: Scalar::sqrt(spread_n2) }),
        ]
    }
}

/// Whether a threshold is exceeded, with hysteresis.
#[derive(Clone, Copy, Debug, Default)]
struct Alarm {
    is_on: bool,
}

impl Alarm {
    /// Whether it goes on now.
    fn rises(&mut self, square: f32, threshold: f32) -> bool {
        const OFF: f32 = 0.8;
        let was_on = self.is_on;
        let limit = if was_on { OFF * threshold } else { threshold };
        self.is_on = square > limit * limit;
        self.is_on && !was_on
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMANDED: [f32; CABLES] = [100.0, 150.0, 120.0, 110.0, 90.0, 130.0];
    const THRESHOLDS: MonitorThresholds = MonitorThresholds { swing_n: 5.0, spread_n: 20.0 };

    fn measured(excess: impl Fn(usize) -> f32) -> [Option<f32>; CABLES] {
        core::array::from_fn(|i| Some(COMMANDED[i] + excess(i)))
    }

    #[test]
    fn a_bouncing_load_warns_once_until_it_has_calmed_down() {
        let mut monitor = TensionMonitor::<8>::new(THRESHOLDS);
        let mut run = |amplitude: f32| {
            let mut warnings = 0;
            for k in 0..32_u8 {
                let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                let [swing, spread] = monitor.update(&measured(|_| sign * amplitude), &COMMANDED);
                assert_eq!(spread, None);
                if let Some(Warning::LoadSwings { deviation_n }) = swing {
                    // Eight samples of +-a: standard deviation a sqrt(8/7).
                    assert!(deviation_n > 5.0 && deviation_n < 1.1 * amplitude, "{deviation_n}");
                    warnings += 1;
                }
            }
            warnings
        };
        assert_eq!(run(4.0), 0);
        assert_eq!(run(10.0), 1);
        assert_eq!(run(4.2), 0); // 4.5 N: between 80 % and the threshold, it stays on
        assert_eq!(run(10.0), 0);
        assert_eq!(run(1.0), 0);
        assert_eq!(run(10.0), 1);
    }

    #[test]
    fn unequal_cables_warn_and_a_steady_offset_does_not() {
        let mut monitor = TensionMonitor::<4>::new(THRESHOLDS);
        for _ in 0..8 {
            assert_eq!(monitor.update(&measured(|_| 40.0), &COMMANDED), [None; 2]);
        }
        let uneven = measured(|i| if i % 2 == 0 { 30.0 } else { -30.0 });
        let mut spread = None;
        for _ in 0..4 {
            let warnings = monitor.update(&uneven, &COMMANDED);
            spread = spread.or(warnings[1]);
        }
        // Six values of +-30: variance 6/5 900 N^2; the mean over the window passes 400 N^2 with
        // the second tick of four: sqrt(540).
        let Some(Warning::TensionsSpread { deviation_n }) = spread else { panic!("no warning") };
        assert!((deviation_n - 23.237_9).abs() < 1e-3, "{deviation_n}");
    }

    #[test]
    fn what_is_not_measured_is_left_out() {
        let mut monitor = TensionMonitor::<2>::new(THRESHOLDS);
        let mut one = [None; CABLES];
        one[3] = Some(1e3);
        for bad in [[None; CABLES], one, [Some(f32::NAN); CABLES], [Some(f32::INFINITY); CABLES]] {
            for _ in 0..4 {
                assert_eq!(monitor.update(&bad, &COMMANDED), [None; 2]);
            }
        }
        let mut empty = TensionMonitor::<0>::new(THRESHOLDS);
        assert_eq!(empty.update(&measured(|_| 1e3), &COMMANDED), [None; 2]);
    }
}
