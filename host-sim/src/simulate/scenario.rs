//! What goes wrong: the file of `--faults`.
//!
//! ```toml
//! seed = 1
//!
//! [cable]                       # what the cables truly are, times what the controller believes
//! linear_density_factor = 1.1
//! axial_stiffness_factor = 0.9
//!
//! [wind]
//! velocity_m_s = [3, 0, 0]
//! gust_m_s = 1.5                # standard deviation along each axis
//! gust_time_s = 2.0             # how long a gust lasts
//!
//! [noise]
//! tension_n = 2.0               # standard deviation of the load cells
//! encoder_counts = 1.0          # and of the encoders, 16384 to a turn
//!
//! [start]
//! winches_off_m = 0.003         # by how much the winches are off in the morning
//! swing_m_s = [0.05, 0, 0]      # velocity of the platform when the brakes open
//!
//! [operator]
//! waits_s = 1.0                 # after a fault or a halt, before all goes on; without: it ends there
//!
//! [[fault]]
//! kind = "winch-stuck"
//! winch = 3                     # counted from 1
//! at_s = 10                     # after the trajectory set out
//! for_s = 2                     # without: to the end
//! ```
//!
//! | kind | further fields |
//! |---|---|
//! | `winch-stuck` | `winch` |
//! | `winch-slow` | `winch`, `speed_m_s`: no faster |
//! | `encoder-stuck`, `encoder-parity` | `winch` |
//! | `dropout` | no set-points come |
//! | `emergency-stop` | it is pressed |
//! | `payload` | `mass_kg`: what platform and payload weigh meanwhile |
//! | `push` | `force_n`, `moment_nm`: on the platform, world axes |
//! | `table` | `bit`: one bit of the warm-start table is flipped before the start |

use std::path::Path;

use cdpr_core::CABLES;
use nalgebra::Vector3;
use serde::Deserialize;
use toml::Spanned;

use crate::input_file::{self, InputFileError};
use crate::toml_file::Source;

/// What goes wrong in a simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Where random numbers begin.
    pub seed: u64,
    /// True over believed linear density of the cables.
    pub linear_density_factor: f64,
    /// True over believed axial stiffness.
    pub axial_stiffness_factor: f64,
    /// Mean velocity of the wind, m/s.
    pub wind_m_s: Vector3<f64>,
    /// Standard deviation of gusts along each axis, m/s.
    pub gust_m_s: f64,
    /// Correlation time of gusts, s.
    pub gust_time_s: f64,
    /// Standard deviation of measured tensions, N.
    pub tension_noise_n: f64,
    /// Standard deviation of encoders, counts.
    pub encoder_noise_counts: f64,
    /// How far the winches are off at the start, m.
    pub winches_off_m: f64,
    /// Velocity of the platform when the brakes open first, m/s.
    pub swing_m_s: Vector3<f64>,
    /// How long the operator waits before all goes on, s; `None`: he does not.
    pub operator_waits_s: Option<f64>,
    /// Faults, in the order of the file.
    pub faults: Vec<TimedFault>,
}

/// Nothing goes wrong.
impl Default for Scenario {
    fn default() -> Self {
        Self {
            seed: 0,
            linear_density_factor: 1.0,
            axial_stiffness_factor: 1.0,
            wind_m_s: Vector3::zeros(),
            gust_m_s: 0.0,
            gust_time_s: 1.0,
            tension_noise_n: 0.0,
            encoder_noise_counts: 0.0,
            winches_off_m: 0.0,
            swing_m_s: Vector3::zeros(),
            operator_waits_s: None,
            faults: Vec::new(),
        }
    }
}

/// A fault and when it is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedFault {
    /// From when, s after the trajectory set out.
    pub from_s: f64,
    /// Until when, s.
    pub until_s: f64,
    /// What.
    pub fault: Fault,
}

/// What goes wrong. Winches are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// A winch does not turn.
    WinchStuck(usize),
    /// A winch turns no faster.
    WinchSlow {
        /// The winch.
        winch: usize,
        /// Rate of its rest length, m/s.
        speed_m_s: f64,
    },
    /// An encoder shows the same angle for ever.
    EncoderStuck(usize),
    /// The answers of an encoder have the wrong parity.
    EncoderParity(usize),
    /// No set-points come.
    Dropout,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// Another load than the controller knows of.
    Payload {
        /// Mass of platform and payload, kg.
        mass_kg: f64,
    },
    /// Something pushes the platform.
    Push {
        /// Force at its origin, world axes, N.
        force_n: Vector3<f64>,
        /// Moment, world axes, N m.
        moment_nm: Vector3<f64>,
    },
    /// A bit of the warm-start table is flipped, before all starts.
    Table {
        /// Which, counted from the first of the first byte.
        bit: usize,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    seed: Option<u64>,
    #[serde(default)]
    cable: RawCable,
    #[serde(default)]
    wind: RawWind,
    #[serde(default)]
    noise: RawNoise,
    #[serde(default)]
    start: RawStart,
    #[serde(default)]
    operator: RawOperator,
    #[serde(default)]
    fault: Vec<RawFault>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCable {
    linear_density_factor: Option<Spanned<f64>>,
    axial_stiffness_factor: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(clippy::struct_field_names, reason = "units")]
struct RawWind {
    velocity_m_s: Option<Spanned<Vec<f64>>>,
    gust_m_s: Option<Spanned<f64>>,
    gust_time_s: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawNoise {
    tension_n: Option<Spanned<f64>>,
    encoder_counts: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStart {
    winches_off_m: Option<Spanned<f64>>,
    swing_m_s: Option<Spanned<Vec<f64>>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOperator {
    waits_s: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFault {
    kind: Spanned<String>,
    at_s: Option<Spanned<f64>>,
    for_s: Option<Spanned<f64>>,
    winch: Option<Spanned<usize>>,
    speed_m_s: Option<Spanned<f64>>,
    mass_kg: Option<Spanned<f64>>,
    force_n: Option<Spanned<Vec<f64>>>,
    moment_nm: Option<Spanned<Vec<f64>>>,
    bit: Option<Spanned<usize>>,
}

impl Scenario {
    /// Reads a file.
    ///
    /// # Errors
    /// [`InputFileError`], naming file, line and field.
    pub fn read(path: &Path) -> Result<Self, InputFileError> {
        let (text, name) = input_file::read(path)?;
        Self::parse(&text, &name)
    }

    /// Reads it from its text; `path` is only for messages.
    ///
    /// # Errors
    /// [`InputFileError::Content`].
    pub fn parse(text: &str, path: &str) -> Result<Self, InputFileError> {
        let source = Source { text, path };
        let document: Document = source.deserialize()?;
        let vector = |value: &Option<Spanned<Vec<f64>>>, field: &str| match value {
            Some(value) => source.vector(value, field),
            None => Ok(Vector3::zeros()),
        };
        let positive = |value: &Option<Spanned<f64>>, field: &str, or: f64| match value {
            Some(value) => source.positive(value, field),
            None => Ok(or),
        };
        let not_negative = |value: &Option<Spanned<f64>>, field: &str| match value {
            Some(value) => source.not_negative(value, field),
            None => Ok(0.0),
        };
        let usual = Self::default();
        let Document { seed, cable, wind, noise, start, operator, fault } = &document;
        let off_m = match &start.winches_off_m {
            Some(value) => source.number(value, "start.winches_off_m", f64::is_finite, "finite")?,
            None => 0.0,
        };
        Ok(Self {
            seed: seed.unwrap_or_default(),
            linear_density_factor: positive(
                &cable.linear_density_factor,
                "cable.linear_density_factor",
                usual.linear_density_factor,
            )?,
            axial_stiffness_factor: positive(
                &cable.axial_stiffness_factor,
                "cable.axial_stiffness_factor",
                usual.axial_stiffness_factor,
            )?,
            wind_m_s: vector(&wind.velocity_m_s, "wind.velocity_m_s")?,
            gust_m_s: not_negative(&wind.gust_m_s, "wind.gust_m_s")?,
            gust_time_s: positive(&wind.gust_time_s, "wind.gust_time_s", usual.gust_time_s)?,
            tension_noise_n: not_negative(&noise.tension_n, "noise.tension_n")?,
            encoder_noise_counts: not_negative(&noise.encoder_counts, "noise.encoder_counts")?,
            winches_off_m: off_m,
            swing_m_s: vector(&start.swing_m_s, "start.swing_m_s")?,
            operator_waits_s: match &operator.waits_s {
                Some(value) => Some(source.not_negative(value, "operator.waits_s")?),
                None => None,
            },
            faults: (1..)
                .zip(fault)
                .map(|(number, fault)| fault.check(number, &source))
                .collect::<Result<_, _>>()?,
        })
    }
}

impl RawFault {
    /// The fault with this number in the file.
    fn check(&self, number: usize, source: &Source<'_>) -> Result<TimedFault, InputFileError> {
        let own = |field: &str| format!("fault[{number}].{field}");
        let kind = self.kind.get_ref().as_str();
        let missing = |field: &str| {
            source.refuse(self.kind.span(), &own(field), format_args!("{kind} needs it"))
        };
        let winch = || {
            let winch = self.winch.as_ref().ok_or_else(|| missing("winch"))?;
            let number = *winch.get_ref();
            if (1..=CABLES).contains(&number) {
                Ok(number - 1)
            } else {
                let message = format_args!("{number} is no winch: they are 1 to {CABLES}");
                Err(source.refuse(winch.span(), &own("winch"), message))
            }
        };
        let positive = |value: &Option<Spanned<f64>>, field: &str| {
            source.positive(value.as_ref().ok_or_else(|| missing(field))?, &own(field))
        };
        let vector = |value: &Option<Spanned<Vec<f64>>>, field: &str| match value {
            Some(value) => source.vector(value, &own(field)),
            None => Ok(Vector3::zeros()),
        };
        // What a kind has no use for is a mistake.
        let (fault, used): (_, &[&str]) = match kind {
            "winch-stuck" => (Fault::WinchStuck(winch()?), &["winch"]),
            "winch-slow" => {
                let speed_m_s = positive(&self.speed_m_s, "speed_m_s")?;
                (Fault::WinchSlow { winch: winch()?, speed_m_s }, &["winch", "speed_m_s"])
            }
            "encoder-stuck" => (Fault::EncoderStuck(winch()?), &["winch"]),
            "encoder-parity" => (Fault::EncoderParity(winch()?), &["winch"]),
            "dropout" => (Fault::Dropout, &[]),
            "emergency-stop" => (Fault::EmergencyStop, &[]),
            "payload" => {
                (Fault::Payload { mass_kg: positive(&self.mass_kg, "mass_kg")? }, &["mass_kg"])
            }
            "push" => {
                let force_n = vector(&self.force_n, "force_n")?;
                (
                    Fault::Push { force_n, moment_nm: vector(&self.moment_nm, "moment_nm")? },
                    &["force_n", "moment_nm"],
                )
            }
            "table" => {
                let bit = *self.bit.as_ref().ok_or_else(|| missing("bit"))?.get_ref();
                (Fault::Table { bit }, &["bit"])
            }
            _ => {
                let message = format_args!(
                    "'{kind}' is none of winch-stuck, winch-slow, encoder-stuck, encoder-parity, dropout, \
                     emergency-stop, payload, push, table"
                );
                return Err(source.refuse(self.kind.span(), &own("kind"), message));
            }
        };
        let given = [
            ("winch", self.winch.as_ref().map(Spanned::span)),
            ("speed_m_s", self.speed_m_s.as_ref().map(Spanned::span)),
            ("mass_kg", self.mass_kg.as_ref().map(Spanned::span)),
            ("force_n", self.force_n.as_ref().map(Spanned::span)),
            ("moment_nm", self.moment_nm.as_ref().map(Spanned::span)),
            ("bit", self.bit.as_ref().map(Spanned::span)),
        ];
        for (field, place) in given {
            if let Some(place) = place.filter(|_| !used.contains(&field)) {
                return Err(source.refuse(
                    place,
                    &own(field),
                    format_args!("{kind} has no use for it"),
                ));
            }
        }
        let from_s = match &self.at_s {
            Some(value) => source.not_negative(value, &own("at_s"))?,
            None => 0.0,
        };
        let until_s = match &self.for_s {
            Some(value) => from_s + source.positive(value, &own("for_s"))?,
            None => f64::INFINITY,
        };
        Ok(TimedFault { from_s, until_s, fault })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_read() {
        let text = "seed = 7\n[cable]\nlinear_density_factor = 1.1\n[wind]\nvelocity_m_s = [3, 0, 0]\n\
            [operator]\nwaits_s = 1\n[[fault]]\nkind = 'winch-stuck'\nwinch = 3\nat_s = 10\nfor_s = 2\n\
            [[fault]]\nkind = 'push'\nforce_n = [0, 10, 0]\n";
        let scenario = Scenario::parse(text, "f.toml").unwrap();
        assert_eq!(scenario.seed, 7);
        assert_eq!(scenario.linear_density_factor.to_string(), "1.1");
        assert_eq!(scenario.axial_stiffness_factor.to_string(), "1");
        assert_eq!(scenario.operator_waits_s, Some(1.0));
        let stuck = TimedFault { from_s: 10.0, until_s: 12.0, fault: Fault::WinchStuck(2) };
        let force_n = Vector3::new(0.0, 10.0, 0.0);
        let push = Fault::Push { force_n, moment_nm: Vector3::zeros() };
        let push = TimedFault { from_s: 0.0, until_s: f64::INFINITY, fault: push };
        assert_eq!(scenario.faults, [stuck, push]);
        assert_eq!(
            Scenario::parse("", "f.toml").unwrap(),
            Scenario { gust_time_s: 1.0, ..Scenario::default() }
        );
    }

    #[test]
    fn mistakes_are_named() {
        let refused = |text: &str, what: &str| {
            let message = Scenario::parse(text, "f.toml").unwrap_err().to_string();
            assert!(message.contains(what), "{message}");
        };
        refused(
            "[[fault]]\nkind = 'winch-stick'\n",
            "f.toml:2: fault[1].kind: 'winch-stick' is none of",
        );
        refused(
            "[[fault]]\nkind = 'winch-stuck'\n",
            "f.toml:2: fault[1].winch: winch-stuck needs it",
        );
        refused(
            "[[fault]]\nkind = 'winch-stuck'\nwinch = 7\n",
            "f.toml:3: fault[1].winch: 7 is no winch",
        );
        refused(
            "[[fault]]\nkind = 'dropout'\nwinch = 1\n",
            "f.toml:3: fault[1].winch: dropout has no use for it",
        );
        refused(
            "[[fault]]\nkind = 'payload'\nmass_kg = -1\n",
            "f.toml:3: fault[1].mass_kg: -1 is not positive",
        );
        refused(
            "[cable]\nlinear_density_factor = 0\n",
            "f.toml:2: cable.linear_density_factor: 0 is not positive",
        );
        refused("[wimd]\n", "f.toml:1: wimd");
        refused("[wind]\nvelocity_m_s = [1, 2]\n", "f.toml:2: wind.velocity_m_s: 2 numbers given");
    }
}
