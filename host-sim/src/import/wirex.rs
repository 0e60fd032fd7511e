//! Robots of WireX (WireCenter, WireLib, WiPy): one file, `.xml` or `.wcrfx`.
//!
//! The format is specified in the chapter "An XML file format for Cable Robots" of WireX's own documentation,
//! version 0.32 of 27 April 2016, and written and read by `WireLib/RobotData.cpp` and `RobotDocument.cpp`, the
//! vectors by `motionPlanning/Utilities.cpp`. Read in the repository <https://github.com/gldkhoward/WireX>, a copy
//! of the original with changes for Python 3: `wirex-master/doc/XmlFormat.tex` and the files named. No robot file
//! was found in public; WireX keeps its models in its program.
//!
//! Specification and program differ, and both are understood where they only use other words: `end_effector`,
//! `inertia` and `centre_of_gravity` are `platform`, `inertiatensor` and `centerofgravity` in files that WireX
//! wrote, `motion_pattern` is `motionpattern`. Where they contradict each other nothing is taken: `elasticity` of a
//! cable is 1/N in the specification and Young's modulus in N/m^2 in the program; `l_min` and `dl_max` of a winch
//! have other meanings. `winchtype` is a constant that the program writes and never reads.

use roxmltree::{Attribute, Node};

use super::xml::{XmlFile, attribute, elements};
use super::{Imported, ImportedCable, Reading, inertia, is_zero, six};
use crate::input_file::InputFileError;

/// Reads a robot.
///
/// # Errors
/// [`InputFileError::Content`]: it is not what WireX specifies, or not a robot with six cables from points.
pub(super) fn read(file: &XmlFile<'_>, reading: &Reading) -> Result<Imported, InputFileError> {
    let root = file.root();
    let named = |name: &'static str| elements(root).filter(move |node| node.has_tag_name(name));
    if let Some(old) = named("wireRobot").next() {
        let message =
            "the old form of WireLib, which WireX gave up; save the robot anew with WireX";
        return Err(file.refuse(old, message));
    }
    let robots: Vec<Node<'_, '_>> = named("robot").collect();
    let &[robot] = robots.as_slice() else {
        let message = format!("{} robots in it, one needed", robots.len());
        return Err(file.refuse(robots.get(1).copied().unwrap_or(root), message));
    };
    for spelling in ["motion_pattern", "motionpattern"] {
        if let Some(pattern) =
            attribute(robot, spelling).filter(|pattern| pattern.value() != "3R3T")
        {
            let message = format!("{}, but the platform must be free (3R3T)", pattern.value());
            return Err(file.refuse_attribute(robot, &pattern, message));
        }
    }
    let mut notes = Vec::new();
    if attribute(robot, "generator").is_some() {
        notes.push(
            "WireX writes numbers of its own for what nobody set, such as mass 25 kg, centre of mass 0, 1, 0.2 m, \
             cable 0.023 kg/m, winch 720 N: check them."
                .to_owned(),
        );
    }
    let geometry = file.child(robot, "geometry")?;
    let chains = six(elements(geometry).filter(|node| node.has_tag_name("chain")).collect())
        .map_err(|message| file.refuse(geometry, message))?;
    let (types, winches) = (named("cable").collect(), named("winch").collect());
    let parts = Parts { file, reading, types, winches };
    let mut cables = Vec::with_capacity(chains.len());
    for (number, chain) in (1..).zip(chains) {
        cables.push(parts.chain(number, chain, &mut notes)?);
    }
    parts.note_dropped(&mut notes);
    let platform = platform(file, robot, &mut notes)?;
    Ok(Imported {
        format: "WireX, XML format 0.32",
        paths: vec![file.path().to_owned()],
        cables_path: file.path().to_owned(),
        name: attribute(robot, "name").map_or("WireX robot", |name| name.value()).to_owned(),
        mass_kg: platform.mass_kg,
        center_of_mass_m: platform.center_of_mass_m,
        inertia_kg_m2: platform.inertia_kg_m2,
        cables: six(cables).map_err(|message| file.refuse(geometry, message))?,
        notes,
    })
}

struct Platform {
    mass_kg: Option<f64>,
    center_of_mass_m: [f64; 3],
    inertia_kg_m2: Option<[f64; 3]>,
}

/// The element under the name of the specification or that of the program.
fn either<'d, 'a>(
    file: &XmlFile<'a>,
    node: Node<'d, 'a>,
    names: [&str; 2],
) -> Result<Option<Node<'d, 'a>>, InputFileError> {
    match (file.optional(node, names[0])?, file.optional(node, names[1])?) {
        (Some(_), Some(second)) => {
            Err(file.refuse(second, format!("<{}> is given as well", names[0])))
        }
        (one, other) => Ok(one.or(other)),
    }
}

fn platform(
    file: &XmlFile<'_>,
    robot: Node<'_, '_>,
    notes: &mut Vec<String>,
) -> Result<Platform, InputFileError> {
    let nothing = Platform { mass_kg: None, center_of_mass_m: [0.0; 3], inertia_kg_m2: None };
    let Some(platform) = either(file, robot, ["end_effector", "platform"])? else {
        notes.push(
            "The source describes no platform; its centre of mass is put at the origin.".to_owned(),
        );
        return Ok(nothing);
    };
    let center = either(file, platform, ["centre_of_gravity", "centerofgravity"])?;
    let center_of_mass_m = if let Some(center) = center {
        file.vector_in(center)?
    } else {
        notes.push(
            "The source gives no centre of mass; it is put at the origin, its default.".to_owned(),
        );
        [0.0; 3]
    };
    let inertia_kg_m2 = match either(file, platform, ["inertia", "inertiatensor"])? {
        Some(node) => {
            let of = |name| Ok(file.optional_number_in(node, name)?.unwrap_or(0.0));
            let diagonal = [of("Ixx")?, of("Iyy")?, of("Izz")?];
            let products = [of("Ixy")?, of("Ixz")?, of("Iyz")?];
            // All zero is how the format says nothing.
            if is_zero(diagonal) && is_zero(products) {
                None
            } else {
                if !is_zero(center_of_mass_m) {
                    let about = "The source does not say about which point inertia is; taken about the centre of mass.";
                    notes.push(about.to_owned());
                }
                inertia(diagonal, products, notes)
            }
        }
        None => None,
    };
    Ok(Platform { mass_kg: said(file, platform, "mass")?, center_of_mass_m, inertia_kg_m2 })
}

/// A positive number of an attribute; zero is the default of the format and says nothing.
fn said(file: &XmlFile<'_>, node: Node<'_, '_>, name: &str) -> Result<Option<f64>, InputFileError> {
    match (file.optional_number_in(node, name)?, attribute(node, name)) {
        (Some(value), Some(attribute)) if value < 0.0 => {
            Err(file.refuse_attribute(node, &attribute, format!("{value} is not positive")))
        }
        (value, _) => Ok(value.filter(|value| *value > 0.0)),
    }
}

/// What chains refer to.
struct Parts<'f, 'd, 'a> {
    file: &'f XmlFile<'a>,
    reading: &'f Reading,
    types: Vec<Node<'d, 'a>>,
    winches: Vec<Node<'d, 'a>>,
}

impl<'d, 'a> Parts<'_, 'd, 'a> {
    /// The part that an attribute of a chain names, or the only one.
    fn part(
        &self,
        chain: Node<'_, 'a>,
        named_by: Option<Attribute<'_, 'a>>,
        parts: &[Node<'d, 'a>],
        what: &str,
    ) -> Result<Option<Node<'d, 'a>>, InputFileError> {
        let Some(attribute) = named_by else {
            return match parts {
                [] => Ok(None),
                &[only] => Ok(Some(only)),
                _ => {
                    let message = format!(
                        "does not say which of {} {what} it has ({what}_type)",
                        parts.len()
                    );
                    Err(self.file.refuse(chain, message))
                }
            };
        };
        let name = attribute.value();
        let is_named = |part: &&Node<'d, 'a>| {
            part.attribute("name") == Some(name) || part.attribute("id") == Some(name)
        };
        let found: Vec<&Node<'d, 'a>> = parts.iter().filter(is_named).collect();
        match found.as_slice() {
            [part] => Ok(Some(**part)),
            all => {
                let message =
                    format!("'{name}': {} <{what}> in the file have this name or id", all.len());
                Err(self.file.refuse_attribute(chain, &attribute, message))
            }
        }
    }

    fn chain(
        &self,
        number: usize,
        chain: Node<'_, 'a>,
        notes: &mut Vec<String>,
    ) -> Result<ImportedCable, InputFileError> {
        let file = self.file;
        let name = match attribute(chain, "id") {
            Some(id) => format!("chain {}", id.value()),
            None => format!("chain number {number}"),
        };
        let base = file.child(chain, "base")?;
        self.pulley(base, &name, notes)?;
        let material = self.part(chain, attribute(chain, "cable_type"), &self.types, "cable")?;
        let (linear_density_kg_m, max_length_m) = match material {
            Some(node) => (said(file, node, "weight")?, said(file, node, "max_length")?),
            None => (None, None),
        };
        let max_tension_n =
            match self.part(chain, attribute(chain, "winch_type"), &self.winches, "winch")? {
                Some(winch) => match file.optional(winch, "cable")? {
                    Some(node) => {
                        if let Some(count) = attribute(node, "nr_cables")
                            .filter(|count| !matches!(count.value(), "0" | "1"))
                        {
                            let message =
                                format!("{} cables on one winch, one needed", count.value());
                            return Err(file.refuse_attribute(node, &count, message));
                        }
                        said(file, node, "f_max")?
                    }
                    None => None,
                },
                None => None,
            };
        Ok(ImportedCable {
            name,
            line: file.line(chain),
            anchor_m: file.vector_in(base)?,
            attachment_m: file.vector_in(file.child(chain, "platform")?)?,
            linear_density_kg_m,
            axial_stiffness_n: None,
            max_length_m,
            max_tension_n,
        })
    }

    /// Refuses a pulley, or takes it as a point if that is wanted.
    fn pulley(
        &self,
        base: Node<'_, 'a>,
        name: &str,
        notes: &mut Vec<String>,
    ) -> Result<(), InputFileError> {
        for spelling in ["radius", "Radius"] {
            let Some(attribute) = attribute(base, spelling) else { continue };
            let Some(radius_m) =
                self.file.optional_number_in(base, spelling)?.filter(|r| *r != 0.0)
            else {
                continue;
            };
            if !self.reading.pulleys_as_points {
                let message = format!(
                    "a pulley of radius {radius_m} m, but cables begin at a point; --pulleys-as-points takes the \
                     point of <base> (WireX writes a radius, 0.1, for any robot)"
                );
                return Err(self.file.refuse_attribute(base, &attribute, message));
            }
            notes.push(format!(
                "The pulley of {name} (radius {radius_m:?} m) is taken as the point of its base."
            ));
        }
        Ok(())
    }

    /// What of the cables and winches has no place in a robot file.
    fn note_dropped(&self, notes: &mut Vec<String>) {
        for node in &self.types {
            for name in ["elasticity", "radius", "breaking_load", "minimum_load", "damping"] {
                let Some(value) = node.attribute(name).filter(|value| value.trim() != "0") else {
                    continue;
                };
                let why = match name {
                    "elasticity" => {
                        ": 1/N by the specification, N/m^2 by the program; give --axial-stiffness"
                    }
                    "breaking_load" => ": no limit to work at; give --max-tension",
                    _ => "",
                };
                let line = self.file.line(*node);
                notes.push(format!("Dropped: {name} {value} of the cable in line {line}{why}."));
            }
        }
        for winch in &self.winches {
            let line = self.file.line(*winch);
            notes.push(format!("Dropped: all of the winch in line {line} but f_max of its cable."));
        }
    }
}
