//! Robots of CASPR, the Cable-robot Analysis and Simulation Platform for Research: two files, `*_bodies.xml` and
//! `*_cables.xml`.
//!
//! There is no written specification (the document types in `data/model_config/templates` name one attribute), so
//! the format is what CASPR's own loaders read. In the repository <https://github.com/darwinlau/CASPR>, below
//! `src/Model`:
//!
//! - `Bodies/RigidBody/BodyModelRigid.m`: mass, centre of mass and inertia (about `com` or `joint`), parent;
//!   `Bodies/SystemModelBodies.m`: a joint of the base translates from the location in the parent;
//! - `Bodies/Joints/JointType.m`, `JointBase.m`, `SphericalEulerXYZ.m`: the joints, and the order of the angles;
//! - `Cables/SystemModelCables.m`, `Cables/CableModels/*`: types of cables, their properties and attachments;
//!   `CableModelLinearSpring.m`: the stiffness is `K` over the length, so that `K` is EA in N;
//! - `Cables/CableAttachments/*`: what `attachment_reference` means; pulleys.
//!
//! and of its models `FAST`, `CoGiRo`, `NIST_ROBOCRANE` and `PoCaBot_spatial` in
//! `data/model_config/models/SCDM/spatial_manipulators`, which cover both roots of the bodies (`links`, and
//! `bodies_system` around it). The constant of gravity and the forces say that units are SI.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::xml::{XmlFile, attribute, elements};
use super::{Imported, ImportedCable, Reading, inertia, is_zero, six};
use crate::input_file::InputFileError;

/// Reads a robot from its two files.
///
/// # Errors
/// [`InputFileError::Content`]: it is not the file it should be, or not a robot of one free body on six cables.
pub(super) fn read(
    bodies: &XmlFile<'_>,
    cables: &XmlFile<'_>,
    reading: &Reading,
) -> Result<Imported, InputFileError> {
    let mut notes = Vec::new();
    let body = body(bodies, &mut notes)?;
    let cables_found = cable_set(cables, reading, &body, &mut notes)?;
    Ok(Imported {
        format: "CASPR",
        paths: vec![bodies.path().to_owned(), cables.path().to_owned()],
        cables_path: cables.path().to_owned(),
        name: body.name,
        mass_kg: Some(body.mass_kg),
        center_of_mass_m: body.center_of_mass_m.into(),
        inertia_kg_m2: body.inertia_kg_m2,
        cables: cables_found,
        notes,
    })
}

struct Body {
    name: String,
    mass_kg: f64,
    /// From the joint, which is the origin of the platform here.
    center_of_mass_m: Vector3<f64>,
    inertia_kg_m2: Option<[f64; 3]>,
}

fn body(file: &XmlFile<'_>, notes: &mut Vec<String>) -> Result<Body, InputFileError> {
    let root = file.root();
    let links = if root.has_tag_name("links") { root } else { file.child(root, "links")? };
    let found: Vec<Node<'_, '_>> = elements(links).collect();
    let &[link] = found.as_slice() else {
        let message = format!("{} bodies, but only one is possible, the platform", found.len());
        return Err(file.refuse(found.get(1).copied().unwrap_or(links), message));
    };
    if !link.has_tag_name("link_rigid") {
        return Err(file.refuse(link, "is not a rigid body (link_rigid)"));
    }
    let number = file.attribute(link, "num")?;
    if number.value().trim() != "1" {
        let message = format!("'{}', but the only body is number 1", number.value());
        return Err(file.refuse_attribute(link, &number, message));
    }
    let name = attribute(link, "name").map_or("CASPR robot", |name| name.value()).to_owned();

    let parent = file.child(link, "parent")?;
    let base = file.child(parent, "num")?;
    if file.number(base)? != 0.0 {
        return Err(file.refuse(base, "the body hangs from another one, not from the base (0)"));
    }
    let start_m = Vector3::from(file.vector(file.child(parent, "location")?)?);
    notes.push("The platform origin is the joint of the source.".to_owned());
    joint(file, file.child(link, "joint")?, start_m, notes)?;

    let physical = file.child(link, "physical")?;
    let mass = file.child(physical, "mass")?;
    let mass_kg = file.number(mass)?;
    if mass_kg <= 0.0 {
        return Err(file.refuse(mass, format!("{mass_kg} kg is not positive")));
    }
    let center_of_mass_m = Vector3::from(file.vector(file.child(physical, "com_location")?)?);
    if let Some(end) = file.optional(physical, "end_location")? {
        let end_m = file.vector(end)?;
        if !is_zero(end_m) {
            notes.push(format!("Dropped: end_location {end_m:?} m."));
        }
    }
    let inertia_kg_m2 = match file.optional(physical, "inertia")? {
        Some(node) => body_inertia(file, node, mass_kg, center_of_mass_m, notes)?,
        None => None,
    };
    Ok(Body { name, mass_kg, center_of_mass_m, inertia_kg_m2 })
}

/// Moments of inertia about the centre of mass.
fn body_inertia(
    file: &XmlFile<'_>,
    node: Node<'_, '_>,
    mass_kg: f64,
    center_of_mass_m: Vector3<f64>,
    notes: &mut Vec<String>,
) -> Result<Option<[f64; 3]>, InputFileError> {
    let of = |name: &str| file.number(file.child(node, name)?);
    let (xx, yy, zz) = (of("Ixx")?, of("Iyy")?, of("Izz")?);
    let (xy, xz, yz) = (of("Ixy")?, of("Ixz")?, of("Iyz")?);
    let mut tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let reference = file.attribute(node, "ref")?;
    match reference.value() {
        "com" => {}
        "joint" => {
            let r = center_of_mass_m;
            tensor -= (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * mass_kg;
        }
        other => {
            let message = format!("'{other}' is neither com nor joint");
            return Err(file.refuse_attribute(node, &reference, message));
        }
    }
    let diagonal = [tensor[(0, 0)], tensor[(1, 1)], tensor[(2, 2)]];
    Ok(inertia(diagonal, [tensor[(0, 1)], tensor[(0, 2)], tensor[(1, 2)]], notes))
}

/// The joint must leave the body free; the pose it begins at is worth a note.
fn joint(
    file: &XmlFile<'_>,
    node: Node<'_, '_>,
    start_m: Vector3<f64>,
    notes: &mut Vec<String>,
) -> Result<(), InputFileError> {
    let kind = file.attribute(node, "type")?;
    let coordinates = match kind.value() {
        "SPATIAL_EULER_XYZ" => 6,
        "SPATIAL" | "SPATIAL_QUATERNION" => 7,
        other => {
            let message = format!(
                "a joint of type {other}, but the body must be free (SPATIAL_EULER_XYZ, SPATIAL_QUATERNION, SPATIAL)"
            );
            return Err(file.refuse_attribute(node, &kind, message));
        }
    };
    if let Some(actuated) = attribute(node, "actuated").filter(|a| a.value() == "true") {
        let message = "the joint is actuated, but only cables may move the body";
        return Err(file.refuse_attribute(node, &actuated, message));
    }
    for name in ["q_min", "q_max"] {
        if attribute(node, name).is_some() {
            notes.push(format!("Dropped: bounds of the pose ({name}, line {}).", file.line(node)));
        }
    }
    let Some(initial) = attribute(node, "q_initial") else { return Ok(()) };
    let q = file.numbers_in(node, &initial)?;
    if q.len() != coordinates {
        let message = format!("{} numbers given, {coordinates} needed", q.len());
        return Err(file.refuse_attribute(node, &initial, message));
    }
    let turn = if coordinates == 6 {
        let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
        about(Vector3::x_axis(), q[3])
            * about(Vector3::y_axis(), q[4])
            * about(Vector3::z_axis(), q[5])
    } else {
        let quaternion = Quaternion::new(q[3], q[4], q[5], q[6]); // the scalar first, as there
        UnitQuaternion::try_new(quaternion, 1e-9)
            .ok_or_else(|| file.refuse_attribute(node, &initial, "the quaternion is zero"))?
    };
    let [x, y, z]: [f64; 3] = (start_m + Vector3::new(q[0], q[1], q[2])).into();
    let [rx, ry, rz]: [f64; 3] = turn.scaled_axis().into();
    notes.push(format!(
        "Home pose of the source (q_initial {}): --position={x},{y},{z} --rotation-vector={rx},{ry},{rz}",
        initial.value()
    ));
    Ok(())
}

fn cable_set(
    file: &XmlFile<'_>,
    reading: &Reading,
    body: &Body,
    notes: &mut Vec<String>,
) -> Result<[ImportedCable; 6], InputFileError> {
    let root = file.root();
    let sets: Vec<Node<'_, '_>> =
        elements(root).filter(|set| set.has_tag_name("cable_set")).collect();
    let default = attribute(root, "default_cable_set").map(|name| name.value());
    let Some(wanted) = reading.cable_set.as_deref().or(default) else {
        return Err(
            file.refuse(root, "the attribute default_cable_set is missing; choose by --cable-set")
        );
    };
    let mut named = sets.iter().filter(|set| set.attribute("id") == Some(wanted));
    let Some(&set) = named.next() else {
        let known: Vec<&str> = sets.iter().filter_map(|set| set.attribute("id")).collect();
        let message = format!("no cable_set '{wanted}' in it, only: {}", known.join(", "));
        return Err(file.refuse(root, message));
    };
    if let Some(second) = named.next() {
        return Err(file.refuse(*second, format!("a second cable_set '{wanted}'")));
    }
    if sets.len() > 1 {
        notes.push(format!("The cables are the cable_set '{wanted}', one of {}.", sets.len()));
    }
    let found = six(elements(set).collect()).map_err(|message| file.refuse(set, message))?;
    let mut cables = Vec::with_capacity(found.len());
    let mut dropped = BTreeMap::new();
    for node in found {
        cables.push(cable(file, node, reading, body, notes, &mut dropped)?);
    }
    for (property, lines) in dropped {
        let lines: Vec<String> = lines.iter().map(usize::to_string).collect();
        notes.push(format!("Dropped: {property} of cables (lines {}).", lines.join(", ")));
    }
    six(cables).map_err(|message| file.refuse(set, message))
}

fn cable(
    file: &XmlFile<'_>,
    node: Node<'_, '_>,
    reading: &Reading,
    body: &Body,
    notes: &mut Vec<String>,
    dropped: &mut BTreeMap<String, Vec<usize>>,
) -> Result<ImportedCable, InputFileError> {
    let is_spring = match node.tag_name().name() {
        "cable_ideal" => false,
        "cable_linear_spring" => true,
        "cable_passive_linear_spring" => {
            return Err(
                file.refuse(node, "a passive spring, but every cable must be driven by a winch")
            );
        }
        other => {
            let why = if other.starts_with("cable_vsd") {
                "its stiffness varies with the tension"
            } else {
                "of no known type"
            };
            let message =
                format!("{why}; only cable_ideal and cable_linear_spring can be imported");
            return Err(file.refuse(node, message));
        }
    };
    let name = attribute(node, "name").map_or("cable", |name| name.value()).to_owned();
    let reference = file.attribute(node, "attachment_reference")?;
    let origin_m = match reference.value() {
        "joint" => None,
        "com" => Some(body.center_of_mass_m),
        other => {
            let message = format!("'{other}' is neither joint nor com");
            return Err(file.refuse_attribute(node, &reference, message));
        }
    };

    let properties = file.child(node, "properties")?;
    let axial_stiffness_n = if is_spring {
        let stiffness = file.child(properties, "K")?;
        let value = file.limit(stiffness)?;
        if value <= 0.0 {
            return Err(file.refuse(stiffness, format!("{value} N is not positive")));
        }
        Some(value)
    } else {
        None // "ideal" is the absence of a number, not an infinite one
    };
    let largest = file.child(properties, "force_max")?;
    let max_tension_n = file.limit(largest)?;
    if max_tension_n <= 0.0 {
        return Err(file.refuse(largest, format!("{max_tension_n} N is not positive")));
    }
    for property in elements(properties) {
        let name = property.tag_name().name();
        if name != "force_max" && !(is_spring && name == "K") {
            let value = property.text().unwrap_or_default().trim();
            dropped.entry(format!("{name} {value}")).or_default().push(file.line(property));
        }
    }

    let (anchor_m, attachment_m) = ends(file, node, reading, origin_m, &name, notes)?;
    Ok(ImportedCable {
        line: file.line(node),
        name,
        anchor_m,
        attachment_m,
        linear_density_kg_m: None,
        axial_stiffness_n,
        max_length_m: None,
        max_tension_n: Some(max_tension_n),
    })
}

/// Anchor, and attachment from the joint. `origin_m` is what the source measures attachments from.
fn ends(
    file: &XmlFile<'_>,
    cable: Node<'_, '_>,
    reading: &Reading,
    origin_m: Option<Vector3<f64>>,
    name: &str,
    notes: &mut Vec<String>,
) -> Result<([f64; 3], [f64; 3]), InputFileError> {
    let attachments = file.child(cable, "attachments")?;
    let found: Vec<Node<'_, '_>> = elements(attachments).collect();
    if let Some(third) = found.get(2) {
        let message = format!(
            "{} attachments; a cable runs straight from the base to the body, with no points between",
            found.len()
        );
        return Err(file.refuse(*third, message));
    }
    let (mut anchor_m, mut attachment_m) = (None, None);
    for node in found {
        let (body, location) = match node.tag_name().name() {
            "attachment" => {
                let link = file.child(node, "link")?;
                (file.number(link)?, file.child(node, "location")?)
            }
            "base_rotating_pulley" if reading.pulleys_as_points => {
                let radius_m = file.number(file.child(node, "pulley_radius")?)?;
                notes.push(format!(
                    "The pulley of {name} (radius {radius_m:?} m) is taken as its fixed_location."
                ));
                (0.0, file.child(node, "fixed_location")?)
            }
            "base_rotating_pulley" => {
                let message = "a pulley, but cables begin at a point; --pulleys-as-points takes its fixed_location";
                return Err(file.refuse(node, message));
            }
            "screw_base_rotating_pulley" => {
                let message = "a pulley on a screw drive, but cables begin at a fixed point";
                return Err(file.refuse(node, message));
            }
            _ => return Err(file.refuse(node, "an attachment of no known type")),
        };
        let position_m = file.vector(location)?;
        #[expect(clippy::float_cmp, reason = "numbers of bodies, small and whole")]
        let end = if body == 0.0 {
            &mut anchor_m
        } else if body == 1.0 {
            &mut attachment_m
        } else {
            return Err(file.refuse(node, format!("there is no body {body}")));
        };
        if end.replace(position_m).is_some() {
            return Err(file.refuse(node, format!("both ends of the cable are on body {body}")));
        }
    }
    let (Some(anchor_m), Some(attachment_m)) = (anchor_m, attachment_m) else {
        let message = "two attachments are needed, one on the base (0) and one on the body (1)";
        return Err(file.refuse(attachments, message));
    };
    let attachment_m = match origin_m {
        Some(origin_m) => (origin_m + Vector3::from(attachment_m)).into(),
        None => attachment_m,
    };
    Ok((anchor_m, attachment_m))
}
