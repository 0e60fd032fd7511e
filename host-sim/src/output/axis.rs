//! Axes of pictures.

use std::ops::RangeInclusive;

/// An axis is logarithmic from this ratio of its ends.
const LOG_RATIO: f64 = 10.0;

/// A place on an axis where a line of the grid is, named or not.
pub(super) struct Tick {
    pub(super) value: f64,
    pub(super) label: Option<String>,
}

/// An axis, linear or logarithmic.
pub(super) struct Axis {
    is_log: bool,
    /// Ends, or the decimal logarithms of the ends.
    low: f64,
    high: f64,
    /// Where they are, px.
    ends: (f64, f64),
}

impl Axis {
    /// Px between named lines of the grid.
    const ROOM: f64 = 34.0;

    /// Over a range, logarithmic where that is positive and wide, at two places (px), with so much room left at both
    /// ends, as a part of its length.
    pub(super) fn new(range: RangeInclusive<f64>, ends: (f64, f64), headroom: f64) -> Self {
        let is_log = range.end() / range.start() >= LOG_RATIO;
        Self::scaled(range, ends, headroom, is_log)
    }

    /// The same, logarithmic or not.
    pub(super) fn scaled(
        range: RangeInclusive<f64>,
        ends: (f64, f64),
        headroom: f64,
        is_log: bool,
    ) -> Self {
        let (low, high) = range.into_inner();
        let (low, high) = if is_log { (low.log10(), high.log10()) } else { (low, high) };
        let room = (high - low) * headroom;
        Self { is_log, low: low - room, high: high + room, ends }
    }

    pub(super) fn place(&self, value: f64) -> f64 {
        let value = if self.is_log { value.log10() } else { value };
        let (first, last) = self.ends;
        first + (value - self.low) / (self.high - self.low) * (last - first)
    }

    fn length(&self) -> f64 {
        (self.ends.1 - self.ends.0).abs()
    }

    pub(super) fn ticks(&self) -> Vec<Tick> {
        if self.is_log { self.log_ticks() } else { self.linear_ticks() }
    }

    #[allow(clippy::cast_possible_truncation)] // decimal exponents
    fn log_ticks(&self) -> Vec<Tick> {
        let decade = self.length() / (self.high - self.low);
        let (first, last) = (self.low.floor() as i32, self.high.ceil() as i32);
        let every = (Self::ROOM / decade).ceil().max(1.0) as i32;
        let mut ticks = Vec::new();
        for exponent in first..=last {
            for digit in 1..=9 {
                let value = f64::from(digit) * 10_f64.powi(exponent);
                let inside = (self.low - 1e-9..=self.high + 1e-9).contains(&value.log10());
                let named = match digit {
                    1 => exponent.rem_euclid(every) == 0,
                    2 | 5 => decade > 4.0 * Self::ROOM,
                    _ => false,
                };
                // Too many lines are none.
                if inside && (named || decade > 2.0 * Self::ROOM || (digit == 1)) {
                    let label = named.then(|| decimal(f64::from(digit), exponent));
                    ticks.push(Tick { value, label });
                }
            }
        }
        ticks
    }

    #[allow(clippy::cast_possible_truncation)] // decimal exponents, and a few steps
    fn linear_ticks(&self) -> Vec<Tick> {
        let least = (self.high - self.low) * 2.0 * Self::ROOM / self.length();
        let exponent = least.log10().floor() as i32;
        let unit = 10_f64.powi(exponent);
        let step = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * unit);
        let step = step.into_iter().find(|step| *step >= least).unwrap_or(least);
        let decimals = usize::try_from(-step.log10().floor() as i32).unwrap_or(0);
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step).floor() as i64);
        (first..=last)
            .map(|count| {
                let value = count as f64 * step;
                Tick { value, label: Some(format!("{value:.decimals$}")) }
            })
            .collect()
    }
}

/// `digit` times a power of ten, in the shorter way.
fn decimal(digit: f64, exponent: i32) -> String {
    match exponent {
        0..=5 => format!("{:.0}", digit * 10_f64.powi(exponent)),
        -4..0 => {
            format!("{:.*}", usize::try_from(-exponent).unwrap_or(0), digit * 10_f64.powi(exponent))
        }
        _ => format!("{digit:.0}e{exponent}").replace('-', "\u{2212}"),
    }
}
