//! Many poses from one file: a JSON array, or JSON Lines.

use std::path::Path;

use serde::Deserialize;

use crate::enumerate::{ModelKind, Request};
use crate::robot_file::{CableMaterial, RobotDescription};

/// What the command line or a case changes in a robot file, for all cables alike.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overrides {
    /// Mass of the platform, kg.
    pub mass_kg: Option<f64>,
    /// Gravity, m/s^2.
    pub gravity_m_s2: Option<f64>,
    /// Mass of the cables per rest length, kg/m.
    pub linear_density_kg_m: Option<f64>,
    /// Axial stiffness of the cables, N.
    pub axial_stiffness_n: Option<f64>,
    /// Longest rest length, m.
    pub max_length_m: Option<f64>,
    /// Largest tension, N.
    pub max_tension_n: Option<f64>,
}

impl Overrides {
    /// These values where given, else those of `base`.
    #[must_use]
    pub fn or(self, base: Self) -> Self {
        Self {
            mass_kg: self.mass_kg.or(base.mass_kg),
            gravity_m_s2: self.gravity_m_s2.or(base.gravity_m_s2),
            linear_density_kg_m: self.linear_density_kg_m.or(base.linear_density_kg_m),
            axial_stiffness_n: self.axial_stiffness_n.or(base.axial_stiffness_n),
            max_length_m: self.max_length_m.or(base.max_length_m),
            max_tension_n: self.max_tension_n.or(base.max_tension_n),
        }
    }

    /// `robot` with these values in place of its own.
    #[must_use]
    pub fn apply(&self, robot: &RobotDescription) -> RobotDescription {
        let mut changed = robot.clone();
        changed.load.mass_kg = self.mass_kg.unwrap_or(robot.load.mass_kg);
        changed.load.gravity_m_s2 = self.gravity_m_s2.unwrap_or(robot.load.gravity_m_s2);
        changed.robot = robot.robot.map_models(|_, own| self.material(own));
        for limits in &mut changed.limits {
            limits.max_length_m = self.max_length_m.unwrap_or(limits.max_length_m);
            limits.max_tension_n = self.max_tension_n.unwrap_or(limits.max_tension_n);
        }
        changed
    }

    /// The material of a cable with these values in place of its `own`.
    #[must_use]
    pub fn material(&self, own: &CableMaterial) -> CableMaterial {
        CableMaterial {
            linear_density_kg_m: self.linear_density_kg_m.unwrap_or(own.linear_density_kg_m),
            axial_stiffness_n: self.axial_stiffness_n.unwrap_or(own.axial_stiffness_n),
        }
    }
}

/// Why a file of cases was refused.
#[derive(Debug, thiserror::Error)]
pub enum CasesError {
    /// The file could not be read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// There is no case in it.
    #[error("{path}: no case in the file")]
    Empty {
        /// The file.
        path: String,
    },
    /// A case is not valid.
    #[error("{path}: case {case}: {message}")]
    Case {
        /// The file.
        path: String,
        /// Which case, counted from 1.
        case: usize,
        /// What is wrong, with the field or the line and column.
        message: String,
    },
}

/// A case as written in the file. Answers of reference cases may stand beside the question; they are
/// read over, so that such a file can be run as it is.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    position_m: [f64; 3],
    #[serde(default)]
    rotation_vector_rad: [f64; 3],
    mass_kg: Option<f64>,
    gravity_m_s2: Option<f64>,
    linear_density_kg_m: Option<f64>,
    axial_stiffness_n: Option<f64>,
    max_length_m: Option<f64>,
    max_tension_n: Option<f64>,
    #[serde(default, rename = "claim")]
    _claim: serde::de::IgnoredAny,
    #[serde(default, rename = "rigid_slack_sets")]
    _rigid_slack_sets: serde::de::IgnoredAny,
    #[serde(default, rename = "rigid_solutions")]
    _rigid_solutions: serde::de::IgnoredAny,
    #[serde(default, rename = "solutions")]
    _solutions: serde::de::IgnoredAny,
}

impl Case {
    fn overrides(&self) -> Result<Overrides, String> {
        let positive = |value: Option<f64>, field: &str| match value {
            Some(v) if !(v > 0.0 && v.is_finite()) => {
                Err(format!("{field}: {v} is not positive and finite"))
            }
            value => Ok(value),
        };
        Ok(Overrides {
            mass_kg: positive(self.mass_kg, "mass_kg")?,
            gravity_m_s2: positive(self.gravity_m_s2, "gravity_m_s2")?,
            linear_density_kg_m: positive(self.linear_density_kg_m, "linear_density_kg_m")?,
            axial_stiffness_n: positive(self.axial_stiffness_n, "axial_stiffness_n")?,
            max_length_m: positive(self.max_length_m, "max_length_m")?,
            max_tension_n: positive(self.max_tension_n, "max_tension_n")?,
        })
    }
}

/// Reads all cases of a file, as requests to `robot` with `base` overriding it where a case does not.
///
/// # Errors
/// [`CasesError`] for the first case that is not valid; none is returned then.
pub fn read(
    path: &Path,
    robot: &RobotDescription,
    base: Overrides,
    model: ModelKind,
) -> Result<Vec<Request>, CasesError> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path)
        .map_err(|source| CasesError::Read { path: name.clone(), source })?;
    parse(&text, &name)?
        .into_iter()
        .enumerate()
        .map(|(index, case)| {
            let refuse =
                |message| CasesError::Case { path: name.clone(), case: index + 1, message };
            let overrides = case.overrides().map_err(refuse)?.or(base);
            let request = Request {
                robot: overrides.apply(robot),
                position_m: case.position_m,
                rotation_vector_rad: case.rotation_vector_rad,
                model,
            };
            request.check().map_err(|fault| refuse(fault.to_string()))?;
            Ok(request)
        })
        .collect()
}

/// An array of cases, or any number of cases one after the other (JSON Lines among them).
fn parse(text: &str, path: &str) -> Result<Vec<Case>, CasesError> {
    // Editors of some systems put a byte order mark first.
    let text = text.trim_start_matches('\u{feff}');
    let mut cases = Vec::new();
    if text.trim_start().starts_with('[') {
        // Element by element, so that an error can name its case.
        let array: Vec<&serde_json::value::RawValue> =
            serde_json::from_str(text).map_err(|error| CasesError::Case {
                path: path.to_owned(),
                case: 1,
                message: error.to_string(),
            })?;
        for element in array {
            push(&mut cases, serde_json::from_str(element.get()), path)?;
        }
    } else {
        for case in serde_json::Deserializer::from_str(text).into_iter() {
            push(&mut cases, case, path)?;
        }
    }
    if cases.is_empty() {
        return Err(CasesError::Empty { path: path.to_owned() });
    }
    Ok(cases)
}

fn push(
    cases: &mut Vec<Case>,
    case: serde_json::Result<Case>,
    path: &str,
) -> Result<(), CasesError> {
    match case {
        Ok(case) => cases.push(case),
        Err(error) => {
            let (case, message) = (cases.len() + 1, error.to_string());
            return Err(CasesError::Case { path: path.to_owned(), case, message });
        }
    }
    Ok(())
}
