//! Robots from the files of other programs.
//!
//! [`read`] takes the robot of [`caspr`] or [`wirex`], which of the two is seen from the root elements, and
//! [`Imported::robot_file`] writes it as a robot file. What a sagging cable needs and the source does not say is
//! never made up: it has to be given, or the import is refused with a list of all that is missing. What the source
//! says and a robot file cannot is either refused (it would be another robot) or listed at the head of the file.
//!
//! `--robot` does not take such files itself, on purpose: neither format says what sagging needs, so that every call
//! would need the same options again, and nobody would see what was dropped.

use std::fmt::Write as _;
use std::path::PathBuf;

use cdpr_core::{CABLES, Cable, GeometryFault, Robot};
use nalgebra::Vector3;

use crate::input_file::{self, InputFileError};
use xml::XmlFile;

pub mod caspr;
pub mod wirex;
mod xml;

/// How a source is to be read where it leaves a choice.
#[derive(Clone, Debug, Default)]
pub struct Reading {
    /// The set of cables to take (CASPR), in place of the default one of the file.
    pub cable_set: Option<String>,
    /// Take each pulley as the point that the file gives for it.
    pub pulleys_as_points: bool,
}

/// Values for all cables, and the mass, in place of what the source says or leaves out.
#[derive(Clone, Copy, Debug, Default)]
pub struct Given {
    /// Mass of the platform, kg.
    pub mass_kg: Option<f64>,
    /// Mass of the cables per rest length, kg/m.
    pub linear_density_kg_m: Option<f64>,
    /// Axial stiffness EA, N. Infinite: inextensible.
    pub axial_stiffness_n: Option<f64>,
    /// Longest rest length, m. Infinite: no limit.
    pub max_length_m: Option<f64>,
    /// Largest tension, N. Infinite: no limit.
    pub max_tension_n: Option<f64>,
}

/// A cable as far as the source describes it.
#[derive(Clone, Debug)]
struct ImportedCable {
    /// What the source calls it.
    name: String,
    /// Where it stands there.
    line: usize,
    anchor_m: [f64; 3],
    attachment_m: [f64; 3],
    linear_density_kg_m: Option<f64>,
    axial_stiffness_n: Option<f64>,
    max_length_m: Option<f64>,
    max_tension_n: Option<f64>,
}

/// A robot as far as the source describes it.
#[derive(Clone, Debug)]
pub struct Imported {
    format: &'static str,
    /// All files.
    paths: Vec<String>,
    /// The one with the cables.
    cables_path: String,
    name: String,
    mass_kg: Option<f64>,
    center_of_mass_m: [f64; 3],
    /// About the centre of mass, along x, y and z of the platform.
    inertia_kg_m2: Option<[f64; 3]>,
    cables: [ImportedCable; CABLES],
    /// What a reader of the robot file should know.
    notes: Vec<String>,
}

/// Why a robot is not imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// A file was refused.
    #[error(transparent)]
    File(#[from] InputFileError),
    /// The files are not the files of one robot.
    #[error("{0}")]
    Files(String),
    /// The source does not say all that is needed.
    #[error("{paths}: not said there, and not to be guessed: {missing}")]
    Missing {
        /// The files.
        paths: String,
        /// Everything that is missing, with the options for it.
        missing: String,
    },
}

/// Reads the files of a robot, in any order.
///
/// # Errors
/// [`ImportError`]: a file that is neither CASPR's nor WireX's, not all files of a robot, or a robot that a robot
/// file cannot describe.
pub fn read(paths: &[PathBuf], reading: &Reading) -> Result<Imported, ImportError> {
    let texts = paths.iter().map(|path| input_file::read(path)).collect::<Result<Vec<_>, _>>()?;
    let files = texts
        .iter()
        .map(|(text, path)| XmlFile::parse(text, path))
        .collect::<Result<Vec<_>, _>>()?;
    let (mut bodies, mut cables, mut models) = (None, None, None);
    for file in &files {
        let root = file.root();
        let slot = match root.tag_name().name() {
            "links" | "bodies_system" => &mut bodies,
            "cables" => &mut cables,
            "models" => &mut models,
            _ => {
                let known = "neither CASPR (root <links>, <bodies_system> or <cables>) nor WireX (<models>)";
                return Err(file.refuse(root, known).into());
            }
        };
        if let Some(first) = slot.replace(file) {
            let first = XmlFile::path(first);
            return Err(file.refuse(root, format!("a second one; the first is {first}")).into());
        }
    }
    let half = |file: &XmlFile<'_>, is: &str, other: &str| {
        let message =
            format!("a robot of CASPR is two files; this is its {is}, give its {other} too");
        ImportError::from(file.refuse(file.root(), message))
    };
    match (models, bodies, cables) {
        (Some(models), None, None) => Ok(wirex::read(models, reading)?),
        (Some(models), Some(other), _) | (Some(models), _, Some(other)) => {
            let (wirex, caspr) = (models.path(), other.path());
            Err(ImportError::Files(format!("{wirex} is of WireX, and {caspr} of CASPR")))
        }
        (None, Some(bodies), Some(cables)) => Ok(caspr::read(bodies, cables, reading)?),
        (None, Some(bodies), None) => Err(half(bodies, "bodies", "cables")),
        (None, None, Some(cables)) => Err(half(cables, "cables", "bodies")),
        (None, None, None) => Err(ImportError::Files("no file is given".to_owned())),
    }
}

/// A cable with all that a robot file needs.
struct WholeCable<'a> {
    source: &'a ImportedCable,
    /// Linear density, stiffness, longest length and largest tension.
    values: [f64; 4],
}

/// Fields and options of [`WholeCable::values`].
const VALUES: [(&str, &str, &str); 4] = [
    ("linear_density_kg_m", "linear density", "--linear-density KG/M"),
    ("axial_stiffness_n", "axial stiffness EA", "--axial-stiffness N"),
    ("max_length_m", "longest rest length", "--max-length M"),
    ("max_tension_n", "largest tension", "--max-tension N"),
];

impl Imported {
    /// What the robot file says at its head beside the robot: where the source is read in a certain way, and what
    /// of it is dropped.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The text of a robot file, which gives every number back to the bit.
    ///
    /// # Errors
    /// [`ImportError::Missing`], and [`ImportError::File`] for a geometry that no pose can be asked for.
    pub fn robot_file(&self, given: &Given) -> Result<String, ImportError> {
        let (mass_kg, cables) = self.complete(given)?;
        self.check_geometry()?;
        let mut text = String::new();
        self.write_head(&mut text, given);
        let name = toml::Value::String(one_line(&self.name));
        let _ = write!(text, "name = {name}\n\n[platform]\nmass_kg = {mass_kg:?}\n");
        let _ = writeln!(text, "center_of_mass_m = {:?}", self.center_of_mass_m);
        if let Some([x, y, z]) = self.inertia_kg_m2 {
            let _ = write!(
                text,
                "\n# About the centre of mass.\n[body]\ninertia_x_kg_m2 = {x:?}\ninertia_y_kg_m2 = {y:?}\n\
                 inertia_z_kg_m2 = {z:?}\n"
            );
        }
        text.push_str("\n[cable]\n");
        let common = cables[0].values;
        for ((field, ..), value) in VALUES.iter().zip(common) {
            let _ = writeln!(text, "{field} = {value:?}");
        }
        for cable in &cables {
            let ImportedCable { name, anchor_m, attachment_m, .. } = cable.source;
            let _ = write!(
                text,
                "\n# {}\n[[cables]]\nanchor_m = {anchor_m:?}\nattachment_m = {attachment_m:?}\n",
                one_line(name)
            );
            for (k, (field, ..)) in VALUES.iter().enumerate() {
                if cable.values[k].to_bits() != common[k].to_bits() {
                    let _ = writeln!(text, "{field} = {:?}", cable.values[k]);
                }
            }
        }
        Ok(text)
    }

    /// The mass, and the cables with all that they need; or everything that is missing at once.
    fn complete(&self, given: &Given) -> Result<(f64, Vec<WholeCable<'_>>), ImportError> {
        let options = given.cable_values();
        let mut missing: Vec<String> = Vec::new();
        let mass_kg = given.mass_kg.or(self.mass_kg);
        if mass_kg.is_none() {
            missing.push("mass of the platform (--mass KG)".to_owned());
        }
        for (k, (_, what, option)) in VALUES.iter().enumerate() {
            let without: Vec<String> = (1..)
                .zip(&self.cables)
                .filter(|(_, cable)| options[k].or(cable.values()[k]).is_none())
                .map(|(number, _): (usize, _)| number.to_string())
                .collect();
            match without.len() {
                0 => {}
                CABLES => missing.push(format!("{what} of the cables ({option})")),
                _ => missing.push(format!("{what} of cables {} ({option})", without.join(", "))),
            }
        }
        let (Some(mass_kg), true) = (mass_kg, missing.is_empty()) else {
            let (paths, missing) = (self.paths.join(", "), missing.join("; "));
            return Err(ImportError::Missing { paths, missing });
        };
        let cables = self.cables.iter().map(|source| WholeCable {
            source,
            values: std::array::from_fn(|k| {
                options[k].or(source.values()[k]).unwrap_or(f64::INFINITY)
            }),
        });
        Ok((mass_kg, cables.collect()))
    }

    /// Refuses what no robot file may have, with the place in the source.
    fn check_geometry(&self) -> Result<(), InputFileError> {
        let cables = self.cables.each_ref().map(|cable| Cable {
            anchor_m: Vector3::from(cable.anchor_m),
            attachment_m: Vector3::from(cable.attachment_m),
            model: (),
        });
        Robot::new(cables).map(|_| ()).map_err(|fault| {
            let cable = match fault {
                GeometryFault::CoincidentAnchors(_, second) => &self.cables[second],
                _ => &self.cables[0],
            };
            InputFileError::Content {
                path: self.cables_path.clone(),
                line: cable.line,
                field: cable.name.clone(),
                message: fault.to_string(),
            }
        })
    }

    fn write_head(&self, text: &mut String, given: &Given) {
        let paths: Vec<String> = self.paths.iter().map(|path| one_line(path)).collect();
        let _ =
            writeln!(text, "# Made by `cdpr import` from {} ({}).", paths.join(", "), self.format);
        let _ = writeln!(
            text,
            "# World frame z up; SI units, written in the names. Gravity is 9.81 m/s^2."
        );
        let mut options: Vec<(&str, f64, bool)> = Vec::new();
        if let Some(mass_kg) = given.mass_kg {
            options.push(("mass", mass_kg, self.mass_kg.is_some()));
        }
        for (k, value) in given.cable_values().into_iter().enumerate() {
            if let Some(value) = value {
                let said = self.cables.iter().any(|cable| cable.values()[k].is_some());
                options.push((VALUES[k].1, value, said));
            }
        }
        for (what, value, said) in options {
            let place = if said { ", in place of what the source says" } else { "" };
            let _ = writeln!(text, "# Given by hand: {what} {value:?}{place}.");
        }
        for note in &self.notes {
            let _ = writeln!(text, "# {}", one_line(note));
        }
        text.push('\n');
    }
}

impl Given {
    /// In the order of [`VALUES`].
    fn cable_values(&self) -> [Option<f64>; 4] {
        [self.linear_density_kg_m, self.axial_stiffness_n, self.max_length_m, self.max_tension_n]
    }
}

impl ImportedCable {
    /// In the order of [`VALUES`].
    fn values(&self) -> [Option<f64>; 4] {
        [self.linear_density_kg_m, self.axial_stiffness_n, self.max_length_m, self.max_tension_n]
    }
}

/// Text that stays on its line of a robot file, whatever the source puts into a name.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The moments of inertia along x, y and z if a robot file can have them, and a note where something is lost.
/// `products` are xy, xz and yz.
fn inertia(diagonal: [f64; 3], products: [f64; 3], notes: &mut Vec<String>) -> Option<[f64; 3]> {
    if !diagonal.iter().all(|moment| *moment > 0.0 && moment.is_finite()) {
        notes.push(format!(
            "Dropped: moments of inertia {diagonal:?} kg m^2, which must be positive."
        ));
        return None;
    }
    if !is_zero(products) {
        notes.push(format!(
            "Dropped: products of inertia xy, xz, yz {products:?} kg m^2; x, y and z are taken as principal axes."
        ));
    }
    Some(diagonal)
}

fn is_zero(vector: [f64; 3]) -> bool {
    vector.iter().all(|component| *component == 0.0)
}

/// Six of what are cables in the source.
fn six<T>(cables: Vec<T>) -> Result<[T; CABLES], String> {
    cables.try_into().map_err(|found: Vec<T>| {
        format!("{} cables, but the method needs exactly {CABLES}", found.len())
    })
}
