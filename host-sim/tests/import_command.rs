//! `cdpr import` as a person or a script meets it.
//!
//! The files in `import/` are MARIONET-CRANE, written by hand in the formats of CASPR and WireX. Faulty ones differ
//! from them in one place.

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::Command as Process;

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use cdpr_host_sim::import::{self, Given, ImportError, Reading};
use cdpr_host_sim::robot_file::RobotDescription;
use common::CDPR;
use serde_json::Value;
use tempfile::TempDir;

const BODIES: &str = include_str!("import/crane_bodies.xml");
const CABLES: &str = include_str!("import/crane_cables.xml");
const WIREX: &str = include_str!("import/crane.wcrfx");
const WIREX_PROGRAM: &str = include_str!("import/crane_by_program.xml");

/// What CASPR does not say.
const UNSAID: [&str; 4] = ["--linear-density", "0.079", "--max-length", "5000"];
const STIFFNESS: [&str; 2] = ["--axial-stiffness", "1256637.0614359172"];

/// A folder with the files of a robot.
struct Source {
    folder: TempDir,
    files: Vec<String>,
}

impl Source {
    fn new(texts: &[(&str, &str)]) -> Self {
        let folder = TempDir::new().expect("a folder");
        let write = |(name, text): &(&str, &str)| {
            let path = folder.path().join(name);
            fs::write(&path, text).expect("a temporary file");
            path.to_str().expect("UTF-8").to_owned()
        };
        let files = texts.iter().map(write).collect();
        Self { folder, files }
    }

    fn caspr(bodies: &str, cables: &str) -> Self {
        Self::new(&[("crane_bodies.xml", bodies), ("crane_cables.xml", cables)])
    }

    fn wirex(text: &str) -> Self {
        Self::new(&[("crane.wcrfx", text)])
    }

    fn import(&self, options: &[&str]) -> Assert {
        Command::new(CDPR).arg("import").args(&self.files).args(options).assert()
    }

    /// The robot file.
    fn text(&self, options: &[&str]) -> String {
        let assert = self.import(options).success().stderr("");
        String::from_utf8(assert.get_output().stdout.clone()).expect("UTF-8")
    }

    fn robot(&self, options: &[&str]) -> RobotDescription {
        RobotDescription::parse(&self.text(options), "imported").expect("a robot file")
    }

    /// Bad input: exit code 2, nothing on stdout, and a message that holds all of `parts`.
    fn assert_refused(&self, options: &[&str], parts: &[&str]) {
        let assert = self.import(options).code(2).stdout("");
        let message = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        for part in parts {
            assert!(message.contains(part), "{part:?} not in {message:?}");
        }
    }
}

/// `text` with its first `old` replaced, which must be there.
fn with(text: &str, old: &str, new: &str) -> String {
    assert!(text.contains(old), "{old:?} is not in the sample");
    text.replacen(old, new, 1)
}

/// Line of the first `part` of a text, counted from 1.
fn line_of(text: &str, part: &str) -> usize {
    1 + text[..text.find(part).expect("it is there")].matches('\n').count()
}

fn solutions(robot: &str) -> Value {
    let arguments = ["enumerate", "--position", "0.96733,11.3833,1.65", "--mass", "10"];
    let limits = ["--linear-density", "0.004", "--format", "json", "--robot", robot];
    let assert = Command::new(CDPR).args(arguments).args(limits).assert().success();
    let answer: Value = serde_json::from_slice(&assert.get_output().stdout).expect("JSON");
    answer["solutions"].clone()
}

#[test]
fn every_format_gives_the_crane_back_with_all_its_solutions() {
    let crane = RobotDescription::marionet_crane();
    let toml = concat!(env!("CARGO_MANIFEST_DIR"), "/robots/marionet-crane.toml");
    let wanted = solutions(toml);
    assert_eq!(wanted.as_array().map(Vec::len), Some(5));
    let max_length = ["--max-length", "5000"];
    let by_program = [&STIFFNESS[..], &max_length, &["--pulleys-as-points"]].concat();
    let cases = [
        (Source::caspr(BODIES, CABLES), UNSAID.to_vec()),
        (Source::wirex(WIREX), STIFFNESS.to_vec()),
        (Source::wirex(WIREX_PROGRAM), by_program),
    ];
    for (source, options) in cases {
        assert_eq!(source.robot(&options), crane);
        let out = source.folder.path().join("robot.toml");
        let out = out.to_str().expect("UTF-8");
        source.import(&[&options[..], &["--out", out]].concat()).success().stderr("");
        assert_eq!(fs::read_to_string(out).expect("the robot file"), source.text(&options));
        assert_eq!(solutions(out), wanted);
    }
}

#[test]
fn the_order_of_the_files_and_of_the_ends_does_not_matter() {
    let source = Source::new(&[("a.xml", CABLES), ("b.xml", BODIES)]);
    assert_eq!(source.robot(&UNSAID), RobotDescription::marionet_crane());
    let (anchor, attachment) = ("-3.259 -0.475 8.826", "-0.10 -0.93 -0.03");
    let swapped = with(&with(&with(CABLES, anchor, "@"), attachment, anchor), "@", attachment);
    let swapped =
        with(&with(&with(&swapped, "<link>0", "<link>@"), "<link>1", "<link>0"), "@", "1");
    let source = Source::caspr(BODIES, &swapped);
    assert_eq!(source.robot(&UNSAID), RobotDescription::marionet_crane());
}

#[test]
fn attachments_are_measured_from_what_the_file_says() {
    let bodies = with(BODIES, "<com_location>0.0 0.0 0.0", "<com_location>0.5 -0.25 0.125");
    let cables = with(CABLES, "attachment_reference=\"joint\"", "attachment_reference=\"com\"");
    let robot = Source::caspr(&bodies, &cables).robot(&UNSAID);
    let crane = RobotDescription::marionet_crane();
    assert_eq!(robot.load.center_of_mass_m.as_slice(), [0.5, -0.25, 0.125]);
    let (found, known) = (robot.robot.cables(), crane.robot.cables());
    // The first is given from the centre of mass, the others from the joint; anchors do not move.
    let shift = found[0].attachment_m - known[0].attachment_m;
    assert!((shift - robot.load.center_of_mass_m).norm() < 1e-15, "{shift}");
    assert_eq!(found[0].anchor_m, known[0].anchor_m);
    assert_eq!(found[1..], known[1..]);
}

#[test]
fn inertia_about_the_joint_is_moved_to_the_centre_of_mass() {
    let bodies = with(BODIES, "<com_location>0.0 0.0 0.0", "<com_location>0.1 0.2 0.05");
    let bodies = with(&bodies, "ref=\"com\"", "ref=\"joint\"");
    let source = Source::caspr(&bodies, CABLES);
    let body = source.robot(&UNSAID).body;
    // Steiner, 69 kg: 69 (y^2 + z^2) = 2.9325, 69 (x^2 + z^2) = 0.8625, 69 (x^2 + y^2) = 3.45.
    assert!((body.inertia_x_kg_m2 - (12.0 - 2.9325)).abs() < 1e-12);
    assert!((body.inertia_y_kg_m2 - (12.0 - 0.8625)).abs() < 1e-12);
    assert!((body.inertia_z_kg_m2 - (12.0 - 3.45)).abs() < 1e-12);
    assert!(source.text(&UNSAID).contains("# Dropped: products of inertia"));
    // A point mass has no inertia to carry over; the section is left out then.
    let point = BODIES.replace(">12.0<", ">0<");
    let text = Source::caspr(&point, CABLES).text(&UNSAID);
    assert!(!text.contains("[body]") && text.contains("# Dropped: moments of inertia"), "{text}");
}

#[test]
fn the_home_pose_is_told_as_the_options_that_ask_for_it() {
    let bodies = with(BODIES, "\"4 7 2 0 0 0\"", "\"4 7 2 0.1 0.2 0.3\"");
    let bodies = with(&bodies, "<location>0.0 0.0 0.0", "<location>0.5 0.0 -1.0");
    let text = Source::caspr(&bodies, CABLES).text(&UNSAID);
    assert!(text.contains("--position=4.5,7,1 "), "{text}");
    let turn = text.split("--rotation-vector=").nth(1).and_then(|rest| rest.lines().next());
    let turn: Vec<f64> =
        turn.expect("a pose").split(',').map(|number| number.parse().expect("a number")).collect();
    // Turning matrices about x, y and z multiplied in that order, by another program.
    let known = [0.128_923_363_725_904_04, 0.183_425_795_009_378_75, 0.308_748_163_617_030_2];
    for (found, known) in turn.iter().zip(known) {
        assert!((found - known).abs() < 1e-14, "{turn:?}");
    }
    let quaternion = with(
        BODIES,
        "SPATIAL_EULER_XYZ\" q_initial=\"4 7 2 0 0 0\"",
        "SPATIAL_QUATERNION\" q_initial=\"4 7 2 0 0 0 2\"",
    );
    let text = Source::caspr(&quaternion, CABLES).text(&UNSAID);
    assert!(text.contains(&format!("--rotation-vector=0,0,{}", std::f64::consts::PI)), "{text}");
}

#[test]
fn numbers_come_back_to_the_bit() {
    let awkward = ["0.1", "-0.0", "1e21", "0.30000000000000004", "1e-7", "2.2250738585072014e-308"];
    let [a, b, c, d, e, f] = awkward.map(|number| number.parse::<f64>().expect("a number"));
    let cables = with(CABLES, "-3.259 -0.475 8.826", "0.1 -0.0 1e21");
    let cables =
        with(&cables, "-0.10 -0.93 -0.03", "0.30000000000000004 1e-7 2.2250738585072014e-308");
    let cables = with(&cables, "1256637.0614359172", "1256637.0614359174");
    let cables = with(&cables, "<force_max>50000", "<force_max>Inf");
    let robot = Source::caspr(BODIES, &cables).robot(&UNSAID);
    let bits = |vector: nalgebra::Vector3<f64>| [vector.x, vector.y, vector.z].map(f64::to_bits);
    let first = &robot.robot.cables()[0];
    assert_eq!(bits(first.anchor_m), [a, b, c].map(f64::to_bits));
    assert_eq!(bits(first.attachment_m), [d, e, f].map(f64::to_bits));
    // Where cables differ, each has its own.
    assert_eq!(first.model.axial_stiffness_n.to_bits(), 1_256_637.061_435_917_4_f64.to_bits());
    let second = &robot.robot.cables()[1];
    assert_eq!(second.model.axial_stiffness_n.to_bits(), 1_256_637.061_435_917_2_f64.to_bits());
    let tensions = robot.limits.map(|limits| limits.max_tension_n.to_bits());
    assert_eq!(tensions, [f64::INFINITY, 5e4, 5e4, 5e4, 5e4, 5e4].map(f64::to_bits));
}

#[test]
fn what_is_not_said_is_asked_for_all_at_once() {
    let ideal = CABLES
        .replace("cable_linear_spring", "cable_ideal")
        .replace("<K>1256637.0614359172</K>", "<force_min>1</force_min>");
    let source = Source::caspr(BODIES, &ideal);
    let all = [
        "crane_bodies.xml",
        "crane_cables.xml",
        "linear density of the cables (--linear-density KG/M)",
        "axial stiffness EA of the cables (--axial-stiffness N)",
        "longest rest length of the cables (--max-length M)",
    ];
    source.assert_refused(&[], &all);
    let assert = source.import(&[&UNSAID[..], &STIFFNESS].concat()).success();
    let text = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
    assert!(text.contains("# Given by hand: axial stiffness EA 1256637.0614359172."), "{text}");
    assert!(
        text.contains("# Dropped: force_min 1 of cables (lines 10, 26, 42, 58, 74, 90)."),
        "{text}"
    );
    assert!(!text.contains("in place of"), "{text}");
    // Of some cables only.
    let mixed = with(
        &with(CABLES, "<cable_linear_spring", "<cable_ideal"),
        "</cable_linear_spring",
        "</cable_ideal",
    );
    Source::caspr(BODIES, &mixed)
        .assert_refused(&UNSAID, &["axial stiffness EA of cables 1 (--axial-stiffness N)"]);
    // Zero is how WireX says nothing.
    let nothing =
        with(&with(WIREX, "mass=\"69.0\"", "mass=\"0\""), "weight=\"0.079\"", "weight=\"0.0\"");
    Source::wirex(&nothing).assert_refused(
        &STIFFNESS,
        &["mass of the platform (--mass KG)", "linear density of the cables"],
    );
    let robot = Source::wirex(&nothing)
        .robot(&[&STIFFNESS[..], &["--mass", "69", "--linear-density", "0.079"]].concat());
    assert_eq!(robot, RobotDescription::marionet_crane());
    // What is given by hand wins, and the file says so.
    let text = Source::wirex(WIREX)
        .text(&[&STIFFNESS[..], &["--mass", "10", "--max-length", "inf"]].concat());
    assert!(
        text.contains("# Given by hand: mass 10.0, in place of what the source says."),
        "{text}"
    );
    assert!(text.contains("mass_kg = 10.0\n") && text.contains("max_length_m = inf\n"), "{text}");
}

/// A faulty file of cables is refused at this line, with a message that holds all of `parts`.
fn refuse_cables(cables: &str, line: usize, parts: &[&str]) {
    let place = format!("crane_cables.xml:{line}: ");
    Source::caspr(BODIES, cables).assert_refused(&UNSAID, &[&[place.as_str()], parts].concat());
}

/// The text between the first `begin` after `from` and the next `end`, both included.
fn piece<'a>(text: &'a str, from: &str, end: &str) -> &'a str {
    let begin = text.find(from).expect("it begins");
    let length = text[begin..].find(end).expect("it ends") + end.len();
    &text[begin..begin + length]
}

#[test]
fn six_cables_of_a_known_type_are_needed() {
    let spring = "<cable_linear_spring name=\"cable 3\"";
    let third = piece(CABLES, spring, "</cable_linear_spring>");
    let set = line_of(CABLES, "<cable_set id");
    let five = ["cables/cable_set: 5 cables, but the method needs exactly 6"];
    refuse_cables(&with(CABLES, third, ""), set, &five);
    refuse_cables(&with(CABLES, third, &third.repeat(3)), set, &["8 cables"]);
    for (name, message) in [
        ("cable_vsd_polynomial", "varies with the tension"),
        ("cable_passive_linear_spring", "a passive spring"),
        ("muscle_hill_type", "of no known type"),
    ] {
        let other = third.replace("cable_linear_spring", name);
        let place = format!("cables/cable_set/{name}: ");
        refuse_cables(&with(CABLES, third, &other), line_of(CABLES, spring), &[&place, message]);
    }
}

#[test]
fn faulty_cables_of_caspr_are_named_with_their_place() {
    let reference = "attachment_reference=\"joint\"";
    let stiffness = "<K>1256637.0614359172</K>";
    let location = "<location>-3.259 -0.475 8.826";
    let default = " default_cable_set=\"steel\"";
    let set = "<cable_set id=\"steel\">";
    let limit = "<force_max>50000</force_max>";
    for (old, new, message) in [
        (
            reference,
            "attachment_reference=\"tip\"",
            ", attachment_reference: 'tip' is neither joint nor com",
        ),
        (reference, "", "cable_linear_spring[1]: the attribute attachment_reference is missing"),
        (stiffness, "<K>-1</K>", "cable_linear_spring[1]/properties/K: -1 N is not positive"),
        (stiffness, "<K>12 13</K>", "2 numbers given, one needed"),
        (stiffness, "<K/>", "0 numbers given, one needed"),
        (stiffness, "<K>nan</K>", "'nan' is not a number"),
        (location, "<location>-3,259 -0.475 8.826", "'-3,259' is not a number"),
        (location, "<location>-3.259 -0.475", "attachment[1]/location: 2 numbers given"),
        (location, "<location>inf 0 0", "is not finite"),
        (default, " default_cable_set=\"rope\"", "no cable_set 'rope' in it, only: steel"),
        (default, "", "default_cable_set is missing"),
        (set, "<cable_set id=\"steel\"/><cable_set id=\"steel\">", "a second cable_set 'steel'"),
        (limit, "<force_max>1</force_max><force_max>1</force_max>", "force_max[2]: given twice"),
        (limit, "<force_max>0</force_max>", "0 N is not positive"),
    ] {
        refuse_cables(&with(CABLES, old, new), line_of(CABLES, old), &[message]);
    }
    let above = line_of(CABLES, "<properties>");
    refuse_cables(&with(CABLES, limit, ""), above, &["<force_max> is missing in it"]);
    let coincident = with(CABLES, "9.421 -3.482 11.555", "-3.259 -0.475 8.826");
    let second = line_of(CABLES, "name=\"cable 2\"");
    refuse_cables(&coincident, second, &["cable 2: ", "same anchor"]);
}

#[test]
fn cables_of_caspr_run_from_a_point_of_the_base_to_one_of_the_body() {
    let first = line_of(CABLES, "<attachment>");
    let point = piece(CABLES, "<attachment>", "</attachment>");
    let pulley = "<base_rotating_pulley><fixed_location>0 0 9</fixed_location><pulley_radius>0.05</pulley_radius>\
                  <cable_entry_vector>0 0 1</cable_entry_vector></base_rotating_pulley>";
    let with_pulley = with(CABLES, point, pulley);
    let parts = ["base_rotating_pulley: a pulley", "--pulleys-as-points"];
    refuse_cables(&with_pulley, first, &parts);
    let options = [&UNSAID[..], &["--pulleys-as-points"]].concat();
    let text = Source::caspr(BODIES, &with_pulley).text(&options);
    assert!(text.contains("anchor_m = [0.0, 0.0, 9.0]"), "{text}");
    let note = "# The pulley of cable 1 (radius 0.05 m) is taken as its fixed_location.";
    assert!(text.contains(note), "{text}");

    let screw = with(CABLES, point, "<screw_base_rotating_pulley/>");
    refuse_cables(&screw, first, &["a pulley on a screw drive"]);
    refuse_cables(&with(CABLES, point, "<hook/>"), first, &["an attachment of no known type"]);
    let (other, above) = (first + 4, first - 1);
    let via = with(CABLES, point, &format!("{point}\n{point}"));
    refuse_cables(&via, first + 8, &["attachment[3]: 3 attachments; a cable runs straight"]);
    refuse_cables(&with(CABLES, point, ""), above, &["two attachments are needed"]);
    let base = with(CABLES, "<link>1", "<link>0");
    refuse_cables(&base, other, &["both ends of the cable are on body 0"]);
    refuse_cables(&with(CABLES, "<link>1", "<link>2"), other, &["there is no body 2"]);
}

#[test]
fn faulty_bodies_of_caspr_are_named_with_their_place() {
    for (old, new, message) in [
        ("SPATIAL_EULER_XYZ", "PLANAR_XY", "a joint of type PLANAR_XY, but the body must be free"),
        ("type=\"SPATIAL_EULER_XYZ\"", "", "the attribute type is missing"),
        ("\"4 7 2 0 0 0\"", "\"4 7 2\"", "q_initial: 3 numbers given, 6 needed"),
        ("<joint ", "<joint actuated=\"true\" ", "the joint is actuated"),
        ("<num>0</num>", "<num>1</num>", "not from the base (0)"),
        ("num=\"1\"", "num=\"2\"", "the only body is number 1"),
        ("<mass>69.0", "<mass>0", "0 kg is not positive"),
        ("<mass>69.0</mass>", "<mass>69.0</mass><mass>1</mass>", "given twice"),
        ("ref=\"com\"", "ref=\"tip\"", "'tip' is neither com nor joint"),
    ] {
        let place = format!("crane_bodies.xml:{}: ", line_of(BODIES, old));
        Source::caspr(&with(BODIES, old, new), CABLES).assert_refused(&UNSAID, &[&place, message]);
    }
    let end = "</link_rigid>";
    let two = with(BODIES, end, "</link_rigid>\n<link_rigid num=\"2\"/>");
    let place = format!("crane_bodies.xml:{}: ", 1 + line_of(BODIES, end));
    let source = Source::caspr(&two, CABLES);
    source.assert_refused(&UNSAID, &[&place, "2 bodies, but only one is possible"]);
}

#[test]
fn refused_robots_of_wirex_are_named_with_their_place() {
    let pulley = "--pulleys-as-points takes the point of <base>";
    let edits = [
        (
            "x=\"-3.259\"",
            "radius=\"0.1\" x=\"-3.259\"",
            "chain[1]/base, radius: a pulley of radius 0.1 m",
            pulley,
        ),
        ("3R3T", "2R3T", "robot, motion_pattern: 2R3T, but the platform must be free", ""),
        ("y=\"-0.475\" ", "", "chain[1]/base: the attribute y is missing", ""),
        ("x=\"-3.259\"", "x=\"here\"", "chain[1]/base, x: 'here' is not a number", ""),
        ("mass=\"69.0\"", "mass=\"-69\"", "end_effector, mass: -69 is not positive", ""),
        ("weight=\"0.079\"", "weight=\"-1\"", "cable, weight: -1 is not positive", ""),
        (
            "cable_type=\"steel\"",
            "cable_type=\"rope\"",
            "'rope': 0 <cable> in the file have this name or id",
            "",
        ),
        ("nr_cables=\"1\"", "nr_cables=\"2\"", "2 cables on one winch", ""),
        ("<end_effector", "<platform/><end_effector", "<end_effector> is given as well", ""),
    ];
    for (old, new, message, also) in edits {
        let place = format!("crane.wcrfx:{}: ", line_of(WIREX, old));
        Source::wirex(&with(WIREX, old, new)).assert_refused(&STIFFNESS, &[&place, message, also]);
    }
    let chain = piece(WIREX, "<chain", "</chain>");
    let seven = with(WIREX, chain, &chain.repeat(2));
    let place = format!("crane.wcrfx:{}: ", line_of(WIREX, "<geometry>"));
    Source::wirex(&seven)
        .assert_refused(&STIFFNESS, &[&place, "7 cables, but the method needs exactly 6"]);
    let robots = with(WIREX, "<cable name", "<robot/><cable name");
    Source::wirex(&robots).assert_refused(&STIFFNESS, &["2 robots in it, one needed"]);
    let cables = with(WIREX, "<cable name", "<cable name=\"rope\"/><cable name");
    assert_eq!(Source::wirex(&cables).robot(&STIFFNESS), RobotDescription::marionet_crane());
    let unnamed = cables.replace(" cable_type=\"steel\"", "");
    let parts =
        ["models/robot/geometry/chain[1]: does not say which of 2 cable it has (cable_type)"];
    Source::wirex(&unnamed).assert_refused(&STIFFNESS, &parts);
    let old = "<models><wireRobot><systemParameter units=\"6\"/></wireRobot></models>";
    Source::wirex(old).assert_refused(&STIFFNESS, &["crane.wcrfx:1: ", "the old form of WireLib"]);
    // The unit of the elasticity depends on whom one asks: never taken.
    Source::wirex(WIREX).assert_refused(&[], &["axial stiffness EA of the cables"]);
    let text = Source::wirex(WIREX).text(&STIFFNESS);
    assert!(text.contains("# Dropped: elasticity 100e9 of the cable in line"), "{text}");
}

#[test]
fn files_that_are_no_robot_are_refused() {
    let one = |name: &'static str, text: &str| Source::new(&[(name, text)]);
    one("crane_bodies.xml", BODIES)
        .assert_refused(&UNSAID, &["crane_bodies.xml:4: ", "give its cables too"]);
    one("crane_cables.xml", CABLES)
        .assert_refused(&UNSAID, &["crane_cables.xml:6: ", "give its bodies too"]);
    one("page.xml", "\n<html/>").assert_refused(&UNSAID, &["page.xml:2: html: neither CASPR"]);
    one("empty.xml", "").assert_refused(&UNSAID, &["empty.xml:1: XML: "]);
    one("open.xml", "<links>\n<link_rigid>\n</links>")
        .assert_refused(&UNSAID, &["open.xml:3: XML: "]);
    let twice = Source::new(&[("a.xml", BODIES), ("b.xml", BODIES)]);
    twice.assert_refused(&UNSAID, &["b.xml:4: ", "a second one; the first is", "a.xml"]);
    let mixed = Source::new(&[("a.xml", BODIES), ("b.xml", WIREX)]);
    mixed.assert_refused(&UNSAID, &["b.xml is of WireX, and", "a.xml of CASPR"]);
    Command::new(CDPR).args(["import", "no-such-file.xml"]).assert().code(2).stdout("");
    Command::new(CDPR).arg("import").assert().code(2).stdout("");
    // The other way round: XML where a robot file should be.
    let crane = one("crane.xml", WIREX);
    let assert = Command::new(CDPR)
        .args(["enumerate", "--position", "4,7,2", "--robot", &crane.files[0]])
        .assert()
        .code(2);
    let message = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    assert!(message.contains("crane.xml:1: ") && message.contains("cdpr import"), "{message}");
}

#[test]
fn a_robot_that_is_refused_leaves_the_robot_file_alone() {
    let source = Source::wirex(&with(WIREX, "3R3T", "2R3T"));
    let out = source.folder.path().join("robot.toml");
    fs::write(&out, "precious").expect("a file");
    source.import(&["--out", out.to_str().expect("UTF-8")]).code(2);
    assert_eq!(fs::read_to_string(&out).expect("still there"), "precious");
    let nowhere = source.folder.path().join("no/such/folder.toml");
    Source::wirex(WIREX).assert_refused(
        &[&STIFFNESS[..], &["--out", nowhere.to_str().expect("UTF-8")]].concat(),
        &["--out ", "folder.toml"],
    );
}

#[test]
fn another_set_of_cables_can_be_chosen() {
    let set = "<cable_set id=\"steel\">";
    let both = with(CABLES, set, &format!("<cable_set id=\"none\"></cable_set>\n{set}"));
    let source = Source::caspr(BODIES, &both);
    assert_eq!(source.robot(&UNSAID), RobotDescription::marionet_crane());
    assert!(source.text(&UNSAID).contains("# The cables are the cable_set 'steel', one of 2."));
    source.assert_refused(&[&UNSAID[..], &["--cable-set", "none"]].concat(), &["0 cables"]);
    source
        .assert_refused(&[&UNSAID[..], &["--cable-set", "rope"]].concat(), &["only: none, steel"]);
}

#[test]
fn names_cannot_break_out_of_their_place() {
    let name = "MARIONET-CRANE&quot;&#10;mass_kg = 1 &#13;\\ ü";
    let wirex = with(WIREX, "name=\"MARIONET-CRANE\"", &format!("name=\"{name}\""));
    let wirex = with(&wirex, "chain id=\"1\"", "chain id=\"1&#10;[cable]\"");
    let robot = Source::wirex(&wirex).robot(&STIFFNESS);
    assert_eq!(robot.name, "MARIONET-CRANE\" mass_kg = 1  \\ ü");
    assert_eq!(robot.load, RobotDescription::marionet_crane().load);
}

/// What a reader of one process makes of some text: it must neither panic nor hang.
fn read(text: &str) -> Result<import::Imported, ImportError> {
    let source = Source::wirex(text);
    let files: Vec<PathBuf> = source.files.iter().map(PathBuf::from).collect();
    import::read(&files, &Reading::default())
}

#[test]
fn entities_are_never_expanded() {
    let laughs = "<!DOCTYPE models [\n<!ENTITY a \"ha\">\n<!ENTITY b \"&a;&a;&a;&a;\">\n]>\n<models>&b;</models>";
    Source::wirex(laughs).assert_refused(&[], &["crane.wcrfx:2: XML: entities are not read"]);
    let outside =
        "<!DOCTYPE models [<!ENTITY a SYSTEM \"file:///etc/hostname\">]><models>&a;</models>";
    Source::wirex(outside).assert_refused(&[], &["crane.wcrfx:1: XML: entities are not read"]);
}

#[test]
fn no_text_makes_the_reader_panic() {
    // In a thread with little stack: depth of the input must not become depth of calls.
    let deep = format!("{}{}", "<models>".repeat(90_000), "</models>".repeat(90_000));
    let small = std::thread::Builder::new().stack_size(256 * 1024);
    let deep = small.spawn(move || read(&deep).is_err()).expect("a thread");
    assert!(deep.join().expect("no overflow"));
    assert!(read(&format!("<models>{}</models>", "<a/>".repeat(200_000))).is_err(), "too many");
    for text in [WIREX, WIREX_PROGRAM] {
        for end in (0..text.len()).step_by(7) {
            let _ = read(&text[..end]);
        }
    }
    for (begin, _) in WIREX.match_indices(['"', '<', '>', '=']) {
        for new in ["", "\"", "<", "\0", "1e999"] {
            let mut text = WIREX.to_owned();
            text.replace_range(begin..=begin, new);
            if let Ok(robot) = read(&text) {
                let _ = robot.robot_file(&Given::default());
            }
        }
    }
}

#[test]
fn help_names_what_is_read() {
    let output = Process::new(CDPR).args(["import", "--help"]).output().expect("it runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    for part in ["CASPR", "WireX", "--linear-density", "--pulleys-as-points", "--cable-set"] {
        assert!(text.contains(part), "{part} not in {text}");
    }
}
