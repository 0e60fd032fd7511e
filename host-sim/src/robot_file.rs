//! The robot file: what a robot is made of, in TOML, with the unit in every name.
//!
//! Every refusal names the file, the line and the field. See `robots/marionet-crane.toml` for a
//! complete example.

use std::fmt;
use std::ops::Range;
use std::path::Path;

use cdpr_core::{CABLES, Cable, GeometryFault, Load, Robot};
use nalgebra::Vector3;
use serde::Deserialize;
use toml::Spanned;

/// Standard gravity used when the file gives none, m/s^2.
const DEFAULT_GRAVITY_M_S2: f64 = 9.81;

/// MARIONET-CRANE, the robot of the paper, as shipped with the program.
const MARIONET_CRANE: &str = include_str!("../robots/marionet-crane.toml");

/// What a cable is made of, whatever the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CableMaterial {
    /// Mass per rest length, kg/m.
    pub linear_density_kg_m: f64,
    /// Axial stiffness EA, N. Infinite: inextensible.
    pub axial_stiffness_n: f64,
}

/// What winch and cable allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CableLimits {
    /// Longest rest length, m.
    pub max_length_m: f64,
    /// Largest tension at either end, N.
    pub max_tension_n: f64,
}

/// A robot as described by its file.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotDescription {
    /// What the file calls it.
    pub name: String,
    /// Geometry, and the material of each cable in place of a model.
    pub robot: Robot<f64, CableMaterial>,
    /// Limits of each cable.
    pub limits: [CableLimits; CABLES],
    /// What the platform carries.
    pub load: Load<f64>,
}

/// Why a robot file was refused.
#[derive(Debug, thiserror::Error)]
pub enum RobotFileError {
    /// The file could not be read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// Something in the file is wrong.
    #[error("{path}:{line}: {field}: {message}")]
    Content {
        /// The file.
        path: String,
        /// Line, counted from 1.
        line: usize,
        /// The field, as a path from the top of the file; cables are counted from 1.
        field: String,
        /// What is wrong with it.
        message: String,
    },
}

impl RobotDescription {
    /// Reads a robot file.
    ///
    /// # Errors
    /// [`RobotFileError`], naming file, line and field.
    pub fn read(path: &Path) -> Result<Self, RobotFileError> {
        let name = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&text, &name),
            Err(source) => Err(RobotFileError::Read { path: name, source }),
        }
    }

    /// The paper's robot, MARIONET-CRANE.
    ///
    /// # Panics
    /// Never: the file is part of the program and a test reads it.
    #[must_use]
    pub fn marionet_crane() -> Self {
        Self::parse(MARIONET_CRANE, "marionet-crane.toml").expect("the shipped robot file is valid")
    }

    /// Reads a robot file from its text; `path` is only for messages.
    ///
    /// # Errors
    /// [`RobotFileError::Content`].
    pub fn parse(text: &str, path: &str) -> Result<Self, RobotFileError> {
        let source = Source { text, path };
        let document = source.deserialize()?;
        document.check(&source)
    }
}

/// The text of a robot file, for turning a place in it into a message.
struct Source<'a> {
    text: &'a str,
    path: &'a str,
}

impl Source<'_> {
    fn deserialize(&self) -> Result<Document, RobotFileError> {
        let document = toml::Deserializer::parse(self.text)
            .map_err(|error| self.refuse(error.span().unwrap_or(0..0), "TOML", error.message()))?;
        serde_path_to_error::deserialize(document).map_err(|error| {
            let field = from_one(error.path());
            let error = error.into_inner();
            // A message like "missing field" belongs to the table named by the path.
            self.refuse(error.span().unwrap_or(0..0), &field, error.message())
        })
    }

    fn refuse(
        &self,
        place: Range<usize>,
        field: &str,
        message: impl fmt::Display,
    ) -> RobotFileError {
        let before = self.text.get(..place.start).unwrap_or_default();
        RobotFileError::Content {
            path: self.path.to_owned(),
            line: 1 + before.matches('\n').count(),
            field: field.to_owned(),
            message: message.to_string(),
        }
    }

    fn number(
        &self,
        value: &Spanned<f64>,
        field: &str,
        good: impl Fn(f64) -> bool,
        need: &str,
    ) -> Result<f64, RobotFileError> {
        let number = *value.get_ref();
        if good(number) {
            Ok(number)
        } else {
            Err(self.refuse(value.span(), field, format_args!("{number} is not {need}")))
        }
    }

    fn positive(&self, value: &Spanned<f64>, field: &str) -> Result<f64, RobotFileError> {
        self.number(value, field, |v| v > 0.0 && v.is_finite(), "positive and finite")
    }

    /// Positive, or infinite for "no limit".
    fn positive_or_infinite(
        &self,
        value: &Spanned<f64>,
        field: &str,
    ) -> Result<f64, RobotFileError> {
        self.number(value, field, |v| v > 0.0, "positive")
    }

    fn vector(
        &self,
        value: &Spanned<Vec<f64>>,
        field: &str,
    ) -> Result<Vector3<f64>, RobotFileError> {
        // Not an array of three: serde would read [8,826, ...] and drop what is too many.
        let &[x, y, z] = value.get_ref().as_slice() else {
            let count = value.get_ref().len();
            let message = format_args!("{count} numbers given, three needed");
            return Err(self.refuse(value.span(), field, message));
        };
        let vector = Vector3::new(x, y, z);
        if vector.iter().all(|c| c.is_finite()) {
            Ok(vector)
        } else {
            Err(self.refuse(value.span(), field, "a coordinate is not finite"))
        }
    }
}

/// The path of a field with array indices counted from 1, like the cables everywhere else.
fn from_one(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    let segments = path.iter().filter_map(|segment| match segment {
        Segment::Seq { index } => Some(format!("[{}]", index + 1)),
        // The inside of a value that remembers its place.
        Segment::Map { key } if key.starts_with('$') => None,
        Segment::Map { key } | Segment::Enum { variant: key } => Some(format!(".{key}")),
        Segment::Unknown => Some(".?".to_owned()),
    });
    let text: String = segments.collect();
    if text.is_empty() { "top level".to_owned() } else { text.trim_start_matches('.').to_owned() }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    name: String,
    gravity_m_s2: Option<Spanned<f64>>,
    platform: Platform,
    cable: CommonCable,
    cables: Spanned<Vec<Spanned<OneCable>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Platform {
    mass_kg: Spanned<f64>,
    center_of_mass_m: Option<Spanned<Vec<f64>>>,
    external_force_n: Option<Spanned<Vec<f64>>>,
    external_moment_nm: Option<Spanned<Vec<f64>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CommonCable {
    linear_density_kg_m: Spanned<f64>,
    axial_stiffness_n: Spanned<f64>,
    max_length_m: Option<Spanned<f64>>,
    max_tension_n: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OneCable {
    anchor_m: Spanned<Vec<f64>>,
    attachment_m: Spanned<Vec<f64>>,
    linear_density_kg_m: Option<Spanned<f64>>,
    axial_stiffness_n: Option<Spanned<f64>>,
    max_length_m: Option<Spanned<f64>>,
    max_tension_n: Option<Spanned<f64>>,
}

impl Document {
    fn check(self, source: &Source<'_>) -> Result<RobotDescription, RobotFileError> {
        let gravity_m_s2 = match &self.gravity_m_s2 {
            Some(value) => source.positive(value, "gravity_m_s2")?,
            None => DEFAULT_GRAVITY_M_S2,
        };
        let optional_vector = |value: &Option<Spanned<Vec<f64>>>, field: &str| match value {
            Some(value) => source.vector(value, field),
            None => Ok(Vector3::zeros()),
        };
        let platform = &self.platform;
        let load = Load {
            mass_kg: source.positive(&platform.mass_kg, "platform.mass_kg")?,
            center_of_mass_m: optional_vector(
                &platform.center_of_mass_m,
                "platform.center_of_mass_m",
            )?,
            gravity_m_s2,
            force_n: optional_vector(&platform.external_force_n, "platform.external_force_n")?,
            moment_nm: optional_vector(
                &platform.external_moment_nm,
                "platform.external_moment_nm",
            )?,
        };

        let entries = self.cables.get_ref();
        if entries.len() != CABLES {
            let message =
                format!("{} cables, but the method needs exactly {CABLES}", entries.len());
            // Without any entry there is no place in the text but the array itself.
            let place = entries.last().map_or(self.cables.span(), Spanned::span);
            return Err(source.refuse(place, "cables", message));
        }
        let mut cables = Vec::with_capacity(CABLES);
        let mut limits = Vec::with_capacity(CABLES);
        for (index, entry) in entries.iter().enumerate() {
            let (cable, limit) = entry.get_ref().check(&self.cable, index, source)?;
            cables.push(cable);
            limits.push(limit);
        }
        let (Ok(cables), Ok(limits)) = (cables.try_into(), limits.try_into()) else {
            unreachable!("the number of cables was checked");
        };
        let robot = Robot::new(cables).map_err(|fault| {
            let (place, field) = match fault {
                GeometryFault::CoincidentAnchors(_, second) => (
                    entries[second].get_ref().anchor_m.span(),
                    format!("cables[{}].anchor_m", second + 1),
                ),
                _ => (entries[0].get_ref().attachment_m.span(), "cables[].attachment_m".to_owned()),
            };
            source.refuse(place, &field, fault)
        })?;
        Ok(RobotDescription { name: self.name, robot, limits, load })
    }
}

impl OneCable {
    fn check(
        &self,
        common: &CommonCable,
        index: usize,
        source: &Source<'_>,
    ) -> Result<(Cable<f64, CableMaterial>, CableLimits), RobotFileError> {
        let own = |field: &str| format!("cables[{}].{field}", index + 1);
        // The cable's own value, or the common one, each named by where it stands.
        let pick = |mine: &Option<Spanned<f64>>, all: Option<&Spanned<f64>>, field: &str| {
            let (value, name) = match (mine, all) {
                (Some(value), _) => (value.clone(), own(field)),
                (None, Some(value)) => (value.clone(), format!("cable.{field}")),
                (None, None) => return Ok(f64::INFINITY),
            };
            if field == "linear_density_kg_m" {
                source.positive(&value, &name)
            } else {
                source.positive_or_infinite(&value, &name)
            }
        };
        let material = CableMaterial {
            linear_density_kg_m: pick(
                &self.linear_density_kg_m,
                Some(&common.linear_density_kg_m),
                "linear_density_kg_m",
            )?,
            axial_stiffness_n: pick(
                &self.axial_stiffness_n,
                Some(&common.axial_stiffness_n),
                "axial_stiffness_n",
            )?,
        };
        let limits = CableLimits {
            max_length_m: pick(&self.max_length_m, common.max_length_m.as_ref(), "max_length_m")?,
            max_tension_n: pick(
                &self.max_tension_n,
                common.max_tension_n.as_ref(),
                "max_tension_n",
            )?,
        };
        let cable = Cable {
            anchor_m: source.vector(&self.anchor_m, &own("anchor_m"))?,
            attachment_m: source.vector(&self.attachment_m, &own("attachment_m"))?,
            model: material,
        };
        Ok((cable, limits))
    }
}
