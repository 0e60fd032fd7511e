//! The robot file: what a robot is made of, in TOML, with the unit in every name.
//!
//! Every refusal names the file, the line and the field. See `robots/marionet-crane.toml` for a
//! complete example.

use std::path::Path;

mod machinery;

pub use machinery::{Body, Control, WinchDesign};
use machinery::{RawBody, RawControl, RawWinchDesign};

use cdpr_core::{CABLES, Cable, GeometryFault, Load, Robot};
use nalgebra::Vector3;
use serde::Deserialize;
use toml::Spanned;

use crate::input_file::{self, InputFileError};
use crate::toml_file::Source;

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
    /// The platform as a body that moves.
    pub body: Body,
    /// What turns the drums.
    pub winch: WinchDesign,
    /// What the controller is told.
    pub control: Control,
}

impl RobotDescription {
    /// Reads a robot file.
    ///
    /// # Errors
    /// [`InputFileError`], naming file, line and field.
    pub fn read(path: &Path) -> Result<Self, InputFileError> {
        let (text, name) = input_file::read(path)?;
        Self::parse(&text, &name)
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
    /// [`InputFileError::Content`].
    pub fn parse(text: &str, path: &str) -> Result<Self, InputFileError> {
        let source = Source { text, path };
        if text.trim_start().starts_with('<') {
            let message =
                "this is XML; `cdpr import` makes a robot file of what CASPR and WireX write";
            return Err(source.refuse(0..0, "TOML", message));
        }
        let document: Document = source.deserialize()?;
        document.check(&source)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    name: String,
    gravity_m_s2: Option<Spanned<f64>>,
    platform: Platform,
    cable: CommonCable,
    cables: Spanned<Vec<Spanned<OneCable>>>,
    #[serde(default)]
    body: RawBody,
    #[serde(default)]
    winch: RawWinchDesign,
    #[serde(default)]
    control: RawControl,
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
    fn check(self, source: &Source<'_>) -> Result<RobotDescription, InputFileError> {
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
        let body = self.body.check(source)?;
        let (winch, control) = (self.winch.check(source)?, self.control.check(source)?);
        Ok(RobotDescription { name: self.name, robot, limits, load, body, winch, control })
    }
}

impl OneCable {
    fn check(
        &self,
        common: &CommonCable,
        index: usize,
        source: &Source<'_>,
    ) -> Result<(Cable<f64, CableMaterial>, CableLimits), InputFileError> {
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
