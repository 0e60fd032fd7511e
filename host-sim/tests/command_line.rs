//! The command `cdpr` as a person or a script meets it.

mod common;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command as Process, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::Command;
use common::{CDPR, assert_refused, cdpr, stdout};
use serde_json::Value;
use tempfile::TempDir;

const CRANE: &str = include_str!("../robots/marionet-crane.toml");

/// Writes `text` to a file and gives its path.
fn file(folder: &TempDir, name: &str, text: &str) -> String {
    let path = folder.path().join(name);
    fs::write(&path, text).expect("a temporary file");
    path.to_str().expect("UTF-8").to_owned()
}

#[test]
fn without_arguments_it_shows_the_five_solutions() {
    let text = stdout(&cdpr::<&str>(&[]).success().stderr(""));
    assert!(text.contains("Deformable cables: 5 solutions, degree -1"), "{text}");
    assert!(text.contains("4103.07"), "{text}");
    for set in ["none", "[3]", "[6]", "[3,5]", "[4,6]"] {
        assert!(text.contains(&format!("from rigid slack set {set}, proven to")), "{text}");
    }
    assert!(text.contains("Complete, proven: each exists, and there are no others"), "{text}");
}

#[test]
fn json_has_the_documented_fields() {
    let arguments = ["enumerate", "--position", "4,7,2", "--format", "json", "--retrace"];
    let answer: Value = serde_json::from_str(&stdout(&cdpr(&arguments).success())).expect("JSON");
    assert_eq!(answer["rigid"][0]["slack"], serde_json::json!([4]));
    assert_eq!(answer["rigid"][0]["forces_n"].as_array().map(Vec::len), Some(6));
    let degree = serde_json::json!({"rigid": -1, "deformable": -1, "continuation": -1});
    assert_eq!(answer["degree"], degree);
    assert_eq!(answer["method"], "both");
    assert_eq!(answer["complete"], true);
    assert_eq!(answer["undecided"], serde_json::json!([]));
    assert_eq!(answer["differences"], serde_json::json!([]));
    assert!(answer["search"]["boxes"].as_u64().is_some_and(|boxes| boxes > 0));
    let solution = &answer["solutions"][0];
    for field in ["lengths_m", "horizontal_forces_n", "vertical_forces_n"] {
        assert_eq!(solution[field].as_array().map(Vec::len), Some(6), "{field}");
    }
    assert_eq!(solution["rigid_slack_set"], serde_json::json!([4]));
    assert_eq!(solution["retraced_slack_set"], serde_json::json!([4]));
    assert_eq!(solution["det_sign"], -1);
    assert!(solution["condition"].as_f64().is_some_and(|c| c > 1.0));
    assert!((solution["lengths_m"][3].as_f64().unwrap() - 165.251_124_791_726).abs() < 1e-6);
    assert_eq!(solution["proved"], true);
    let radii = solution["length_radii_m"].as_array().expect("six radii");
    assert!(radii.len() == 6 && radii.iter().all(|r| r.as_f64().is_some_and(|r| r < 1e-6)));
    let number = |field: &str| solution["kantorovich"][field].as_f64().expect(field);
    let h = number("beta") * number("eta_n") * number("omega_per_n");
    assert!((number("h") / h - 1.0).abs() < 1e-12 && h < 0.5);
    assert!(number("existence_radius_n") < number("uniqueness_radius_n"));
}

#[test]
fn a_solution_without_rigid_origin_is_found_and_explained() {
    let pose = "3.7647115686606005,16.85687014836569,3.958746955731745";
    let question = ["enumerate", "--position", pose, "--mass", "10"];
    let text = stdout(&cdpr(&question).success());
    assert!(text.contains("Non-deformable cables: no solution"), "{text}");
    assert!(text.contains("Deformable cables: 2 solutions, degree 0"), "{text}");
    assert!(text.contains("solution 1 has no rigid origin"), "{text}");
    assert!(text.contains("Solution 2, without a rigid origin, proven to"), "{text}");
    let by_continuation = [&question[..], &["--method", "continuation"]].concat();
    let text = stdout(&cdpr(&by_continuation).success());
    assert!(text.contains("Deformable cables: no solution"), "{text}");
    let by_search = [&question[..], &["--method", "complete"]].concat();
    let text = stdout(&cdpr(&by_search).success());
    assert!(text.contains("2 solutions, degree 0") && !text.contains("branch"), "{text}");
}

#[test]
fn without_a_tension_limit_it_does_not_claim_to_be_complete() {
    let folder = TempDir::new().expect("a folder");
    let unlimited = CRANE.replace("max_tension_n = 50000.0", "max_tension_n = inf");
    assert_ne!(unlimited, CRANE);
    let robot = file(&folder, "robot.toml", &unlimited);
    let question = ["enumerate", "--robot", &robot, "--position", "4,7,2"];
    let text = stdout(&cdpr(&question).success());
    assert!(text.contains("1 solution, degree -1"), "{text}");
    assert!(text.contains("Not complete: cable 1: no tension limit"), "{text}");
}

#[test]
fn a_pose_without_solution_is_an_answer() {
    let text = stdout(&cdpr(&["enumerate", "--position", "0,0,2"]).success());
    assert!(text.contains("Deformable cables: no solution, degree 0"), "{text}");
}

#[test]
fn limits_hold_for_rigid_cables_too() {
    let question = ["--model", "rigid", "--position", "4,7,2", "--max-length", "60"];
    let text = stdout(&cdpr(&question).success());
    assert!(text.contains("no solution, degree 0"), "{text}");
    assert!(text.contains("beyond a limit: length of cable 4 is 149.9"), "{text}");
}

#[test]
fn options_override_the_robot_file() {
    let folder = TempDir::new().expect("a folder");
    let robot = file(&folder, "robot.toml", CRANE);
    let by_option = cdpr(&[
        "enumerate",
        "--robot",
        &robot,
        "--position",
        "0.96733,11.3833,1.65",
        "--mass",
        "10",
        "--linear-density",
        "0.004",
        "--format",
        "json",
    ]);
    let text = CRANE.replace("mass_kg = 69.0", "mass_kg = 10.0").replace("0.079", "0.004");
    let robot = file(&folder, "light.toml", &text);
    let by_file = cdpr(&[
        "enumerate",
        "--robot",
        &robot,
        "--position",
        "0.96733,11.3833,1.65",
        "--format",
        "json",
    ]);
    assert_eq!(stdout(&by_option.success()), stdout(&by_file.success()));
    let negative = cdpr(&["--position", "-0.5,8,3", "--rotation-vector", "-0.1,0,0.05"]);
    negative.success();
}

#[test]
fn every_mistake_in_a_robot_file_is_named() {
    let folder = TempDir::new().expect("a folder");
    let line_of = |needle: &str| {
        1 + CRANE
            .lines()
            .position(|line| line.starts_with(needle))
            .expect("a line of the robot file")
    };
    // What is replaced, by what, and what the message must hold besides the file and the line of it.
    let mistakes = [
        ("mass_kg = 69.0", "mass_kg = -1.0", "platform.mass_kg: -1 is not positive"),
        ("mass_kg = 69.0", "mass_kg = nan", "platform.mass_kg: NaN is not positive"),
        ("mass_kg = 69.0", "mass_kg = \"heavy\"", "platform.mass_kg: invalid type"),
        ("mass_kg = 69.0", "mass = 69.0", "unknown field `mass`"),
        ("axial_stiffness_n = 12", "axial_stiffness_n = -12", "cable.axial_stiffness_n: -1256637"),
        ("linear_density_kg_m = 0.079", "linear_density_kg_m = 0", "cable.linear_density_kg_m"),
        ("max_length_m = 5000.0", "max_length_m = 0.0", "cable.max_length_m: 0 is not positive"),
        (
            "anchor_m = [9.538, ",
            "anchor_m = [nan, ",
            "cables[3].anchor_m: a coordinate is not finite",
        ),
        ("anchor_m = [9.538, ", "anchor_m = [", "cables[3].anchor_m"),
        (
            "anchor_m = [9.538, 3.797, 11.533]",
            "anchor_m = [9.421, -3.482, 11.555]",
            "cables[3].anchor_m: cables 2 and 3 leave from the same anchor",
        ),
        (
            "anchor_m = [-3.259, -0.475, 8.826]",
            "anchor_m = [-3.259, -0.475, 8,826]",
            "cables[1].anchor_m: 4 numbers given, three needed",
        ),
        ("center_of_mass_m = [0.0", "center_of_mass_m = [inf", "platform.center_of_mass_m"),
        ("gravity_m_s2 = 9.81", "gravity_m_s2 = -9.81", "gravity_m_s2: -9.81 is not positive"),
        ("name = \"MARIONET-CRANE\"", "name = \"MARIONET-CRANE", "TOML"),
    ];
    for (right, wrong, message) in mistakes {
        assert!(CRANE.contains(right), "{right}");
        let robot = file(&folder, "bad.toml", &CRANE.replacen(right, wrong, 1));
        let place = format!("bad.toml:{}:", line_of(right));
        assert_refused(
            &["enumerate", "--robot", &robot, "--position", "4,7,2"],
            &[&place, message],
        );
    }
    let five = CRANE.rsplit_once("[[cables]]").expect("cables").0;
    let robot = file(&folder, "five.toml", five);
    assert_refused(
        &["enumerate", "--robot", &robot, "--position", "4,7,2"],
        &["five.toml:", "cables: 5 cables"],
    );
    let robot = file(&folder, "none.toml", &CRANE.replace("anchor_m = [5.570, 20.414, 8.704]", ""));
    assert_refused(
        &["enumerate", "--robot", &robot, "--position", "4,7,2"],
        &["cables[4]", "missing field `anchor_m`"],
    );
    let missing = folder.path().join("nowhere.toml");
    assert_refused(
        &["--robot", missing.to_str().unwrap(), "--position", "4,7,2"],
        &["nowhere.toml"],
    );
}

#[test]
fn every_mistake_on_the_command_line_is_named() {
    assert_refused(&["--position", "1,2"], &["--position", "2 numbers given, three needed"]);
    assert_refused(&["--position", "1,2,x"], &["--position", "'x' is not a number"]);
    assert_refused(&["--position", "1,2,nan"], &["--position", "not finite"]);
    assert_refused(&["--mass", "0"], &["--mass", "not positive"]);
    assert_refused(&["--max-tension", "-5"], &["--max-tension", "not positive"]);
    assert_refused(&["--model", "chain"], &["--model", "irvine", "parabolic"]);
    assert_refused(&["--rotation-vector", "0,0,1"], &["--position"]);
    assert_refused(&["--cases", "a.json", "--position", "1,2,3"], &["--cases", "--position"]);
    // Attachment 1 on anchor 1.
    assert_refused(&["--position", "-3.159,0.455,8.856"], &["--position", "cable 1"]);
}

#[test]
fn cases_are_run_as_array_and_as_lines() {
    let folder = TempDir::new().expect("a folder");
    let cases = [
        r#"{"position_m": [4, 7, 2], "mass_kg": 69, "claim": "one"}"#,
        r#"{"position_m": [0, 0, 2], "solutions": []}"#,
        r#"{"position_m": [0.96733, 11.3833, 1.65], "mass_kg": 10, "linear_density_kg_m": 0.004}"#,
    ];
    let array = file(&folder, "cases.json", &format!("[{}]", cases.join(",\n")));
    let lines = file(&folder, "cases.jsonl", &cases.join("\n"));
    let by_array = stdout(&cdpr(&["enumerate", "--cases", &array, "--format", "json"]).success());
    assert_eq!(
        by_array,
        stdout(&cdpr(&["enumerate", "--cases", &lines, "--format", "json"]).success())
    );
    let counts: Vec<_> = by_array
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).expect("one JSON document a line"))
        .map(|answer| answer["solutions"].as_array().map_or(0, Vec::len))
        .collect();
    assert_eq!(counts, [1, 0, 5]);

    for (wrong, message) in [
        (r#"{"position_m": [4, 7, 2], "mas_kg": 69}"#, "unknown field `mas_kg`"),
        (r#"{"position_m": [4, 7]}"#, "invalid length 2"),
        (r#"{"position_m": [4, 7, 2], "mass_kg": -3}"#, "mass_kg: -3 is not positive"),
        (r#"{"position_m": [-3.159, 0.455, 8.856]}"#, "cable 1"),
        ("{", "EOF"),
    ] {
        let bad = file(&folder, "bad.jsonl", &format!("{}\n{wrong}\n", cases[0]));
        assert_refused(&["enumerate", "--cases", &bad], &["bad.jsonl: case 2", message]);
    }
    assert_refused(&["enumerate", "--cases", "nowhere.json"], &["nowhere.json"]);
    for nothing in ["", "[]", "\n\n"] {
        let empty = file(&folder, "empty.json", nothing);
        assert_refused(&["enumerate", "--cases", &empty], &["empty.json: no case in the file"]);
    }
    let marked =
        file(&folder, "marked.jsonl", &format!("\u{feff}{}\r\n{}\r\n", cases[0], cases[1]));
    assert_eq!(
        stdout(&cdpr(&["--cases", &marked, "--format", "json"]).success()).lines().count(),
        2
    );
}

#[test]
fn a_reader_may_leave_early() {
    let folder = TempDir::new().expect("a folder");
    let case = r#"{"position_m": [0.96733, 11.3833, 1.65], "mass_kg": 10}"#;
    // At least half a minute's work for two threads.
    let cases = file(&folder, "many.jsonl", &format!("{case}\n").repeat(50_000));
    for threads in ["1", "2"] {
        let begin = Instant::now();
        let mut child = Process::new(CDPR)
            .args(["enumerate", "--cases", &cases, "--threads", threads])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("a pipe")).read_line(&mut line).expect("a line");
        assert!(line.starts_with("MARIONET-CRANE"), "{line}");
        let output = child.wait_with_output().expect("the program ends");
        assert!(output.status.success());
        assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
        // Reading the cases takes a second or two.
        let taken = begin.elapsed();
        assert!(taken < Duration::from_secs(20), "{taken:?} with {threads} threads");
    }
}

/// Poses all over the workspace, with none to three solutions; JSON Lines.
fn many_poses() -> String {
    let case = |n: u32| {
        let n = f64::from(n);
        let (x, y, z) =
            (n * 0.618 % 1.0 * 10.0 - 1.0, n * 0.755 % 1.0 * 18.0, n * 0.57 % 4.0 + 0.5);
        format!("{{\"position_m\": [{x}, {y}, {z}], \"mass_kg\": 10}}")
    };
    (0..300).map(case).collect::<Vec<_>>().join("\n") + "\n"
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let folder = TempDir::new().expect("a folder");
    let cases = file(&folder, "many.jsonl", &many_poses());
    for format in ["json", "text"] {
        let question = ["enumerate", "--cases", &cases, "--format", format, "--threads"];
        let with = |threads| {
            let assert = Command::new(CDPR).args(question).arg(threads).assert();
            assert.success().stderr("").get_output().stdout.clone()
        };
        let one = with("1");
        assert!(one.split(|&byte| byte == b'\n').count() > 300);
        for threads in ["2", "7"] {
            assert!(one == with(threads), "{threads} threads, {format}");
        }
    }
    for threads in ["0", "-1", "all"] {
        assert_refused(&["--cases", &cases, &format!("--threads={threads}")], &["--threads"]);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn as_many_threads_run_as_asked_for() {
    use std::io::Read as _;

    let folder = TempDir::new().expect("a folder");
    let cases = file(&folder, "many.jsonl", &many_poses().repeat(10));
    for (option, environment, threads) in [
        (Some("1"), None, 1),
        (Some("3"), None, 3),
        (None, Some("3"), 3),
        (Some("2"), Some("3"), 2),
    ] {
        let mut process = Process::new(CDPR);
        process.args(["enumerate", "--cases", &cases]).env_remove("RAYON_NUM_THREADS");
        process.args(option.map(|threads| format!("--threads={threads}")));
        process.envs(environment.map(|threads| ("RAYON_NUM_THREADS", threads)));
        let mut child = process.stdout(Stdio::piped()).spawn().expect("the program starts");
        // Once it has written something all threads run, and the full pipe keeps it from ending.
        let mut first = [0];
        child.stdout.as_mut().expect("a pipe").read_exact(&mut first).expect("a byte");
        let tasks = fs::read_dir(format!("/proc/{}/task", child.id())).expect("its threads");
        let tasks = tasks.count();
        child.kill().expect("still running");
        child.wait().expect("ended");
        // The one that writes comes on top.
        assert_eq!(tasks, threads + 1, "--threads {option:?}, environment {environment:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn progress_is_shown_on_a_terminal_and_never_on_stdout() {
    use std::io::Read as _;

    use rustix::pty;

    let folder = TempDir::new().expect("a folder");
    let cases = file(&folder, "many.jsonl", &many_poses());
    let question = ["enumerate", "--cases", &cases, "--format", "json"];
    let without_terminal = cdpr(&question).success().stderr("");

    let master =
        pty::openpt(pty::OpenptFlags::RDWR | pty::OpenptFlags::NOCTTY).expect("a pseudo-terminal");
    pty::grantpt(&master).expect("granted");
    pty::unlockpt(&master).expect("unlocked");
    let name = pty::ptsname(&master, Vec::new()).expect("a name").into_string().expect("UTF-8");
    let mut master = fs::File::from(master);
    let terminal = fs::OpenOptions::new().read(true).write(true).open(name).expect("a terminal");
    let child = Process::new(CDPR)
        .args(question)
        .env("TERM", "xterm")
        .env_remove("NO_COLOR")
        .stdout(Stdio::piped())
        .stderr(terminal)
        .spawn()
        .expect("the program starts");
    // Read at the same time, for a terminal holds little; ends with an error when the child does.
    let screen = std::thread::spawn(move || {
        let mut screen = Vec::new();
        let _ = master.read_to_end(&mut screen);
        String::from_utf8_lossy(&screen).into_owned()
    });
    let output = child.wait_with_output().expect("the program ends");
    assert!(output.status.success());
    assert!(output.stdout == without_terminal.get_output().stdout);
    let screen = screen.join().expect("the terminal is read");
    for part in ["of 300 poses", "/s", "left"] {
        assert!(screen.contains(part), "{part:?} not in {screen:?}");
    }
}

#[test]
fn help_names_units() {
    let help = stdout(&cdpr(&["enumerate", "--help"]).success());
    for unit in ["m", "rad", "kg", "kg/m", "N"] {
        assert!(help.contains(unit), "{unit} in {help}");
    }
    assert!(help.contains("--axial-stiffness <N>") && help.contains("world frame, m"), "{help}");
}

/// The picture in the README.
const PICTURE: &str = include_str!("../pictures/branches.svg");
const OVER_DENSITY: [&str; 7] =
    ["branches", "--parameter", "linear-density", "--from", "0.001", "--to", "0.079"];

#[test]
fn branches_are_tabled_with_their_fold() {
    let text = stdout(&cdpr(&OVER_DENSITY).success().stderr(""));
    assert!(text.contains("0.001 to 0.079 kg/m: 5 branches, 1 fold\n"), "{text}");
    assert!(text.contains("0.004192992414"), "{text}");
    for label in ["none", "[3]", "[6]", "[3,5]", "[4,6]"] {
        assert!(text.contains(&format!(" {label} ")), "{label} in {text}");
    }
    assert!(text.contains("start values: 5 5 5 5 3 3 3 3 3 3 3\n"), "{text}");
    assert!(text.contains("Each lies on exactly one branch; degree -1 at every value"), "{text}");
    // A branch that begins and ends in folds, without a rigid origin.
    let hysteresis = cdpr(&[
        "branches",
        "--parameter",
        "mass",
        "--from",
        "1",
        "--to",
        "300",
        "--position",
        "-0.0877,7.1964,0.8488",
        "--rotation-vector",
        "-0.0265,0.3645,0.2415",
        "--linear-density",
        "0.243",
        "--axial-stiffness",
        "1.78e6",
    ]);
    let text = stdout(&hysteresis.success());
    assert!(text.contains("no rigid origin"), "{text}");
    assert!(text.contains("start values: 1 1 3 3 1 1 1 1 1 1 1\n"), "{text}");
    assert!(text.contains("Each lies on exactly one branch"), "{text}");
}

#[test]
fn json_of_branches_has_the_documented_fields() {
    let arguments = [&OVER_DENSITY[..], &["--format", "json"]].concat();
    let answer: Value = serde_json::from_str(&stdout(&cdpr(&arguments).success())).expect("JSON");
    assert_eq!(answer["parameter"], "linear_density_kg_m");
    assert_eq!([&answer["from"], &answer["to"]], [0.001, 0.079]);
    assert_eq!(answer["mass_kg"], 10.0);
    assert_eq!(answer["cables"][0]["linear_density_kg_m"], Value::Null);
    assert_eq!((&answer["is_consistent"], &answer["rigid_degree"]), (&true.into(), &(-1).into()));
    assert_eq!(answer["doubts"], serde_json::json!([]));
    assert_eq!(answer["start_values"].as_array().map(Vec::len), Some(11));
    assert_eq!(answer["start_values"][0]["solutions"], 5);
    assert_eq!(answer["start_values"][0]["branches"], 5);
    assert_eq!(answer["start_values"][0]["degree"], -1);

    let fold = &answer["folds"][0];
    assert_eq!((&fold["kind"], &fold["branches"]), (&"death".into(), &serde_json::json!([1, 2])));
    assert_eq!(fold["lengths_m"].as_array().map(Vec::len), Some(6));

    let branches = answer["branches"].as_array().expect("branches");
    assert_eq!(branches.len(), 5);
    for (branch, number) in branches.iter().zip(1..) {
        assert_eq!(branch["number"], number);
        assert!(branch["rigid_slack_set"].is_array() && branch["det_sign"].is_i64());
        assert_eq!(branch["low"], serde_json::json!({"value": 0.001, "at": "range"}));
        let points = branch["points"].as_array().expect("points");
        assert!(points.len() > 40, "{}", points.len());
        for point in points {
            for field in ["lengths_m", "anchor_tensions_n"] {
                assert_eq!(point[field].as_array().map(Vec::len), Some(6), "{field}");
            }
            assert!(point["value"].is_f64() && point["is_beyond_limit"].is_boolean());
        }
    }
    let high = serde_json::json!({"value": fold["value"], "at": "fold", "fold": 1});
    assert_eq!((&branches[0]["high"], &branches[1]["high"]), (&high, &high));
    let crossing = &branches[4]["limit_crossings"][0];
    assert_eq!((&crossing["quantity"], &crossing["beyond"]), (&"length".into(), &"below".into()));
    assert_eq!(crossing["cable"], 6);
}

#[test]
fn branches_are_drawn() {
    let folder = TempDir::new().expect("a folder");
    let place = folder.path().join("branches.svg");
    let plot = ["--plot", place.to_str().expect("UTF-8")];
    fs::write(&place, "an older picture").expect("a temporary file");
    cdpr(&[&OVER_DENSITY[..], &plot].concat()).success();
    let svg = fs::read_to_string(&place).expect("a picture");
    for picture in [svg.as_str(), PICTURE] {
        assert!(picture.starts_with("<svg") && picture.trim_end().ends_with("</svg>"));
        for text in ["fold at 0.0041929924 kg/m", "1: none, L", "5: [4,6], L6", "(kg/m)"] {
            assert!(picture.contains(text), "{text}");
        }
    }
    // Nothing but the picture stays behind, also where there is no solution to draw.
    let nowhere = ["branches", "--parameter", "mass", "--from", "1", "--to", "2"];
    let nowhere = [&nowhere[..], &["--position", "0,0,2"], &plot].concat();
    assert!(stdout(&cdpr(&nowhere).success()).contains("no branch, no fold"));
    assert!(fs::read_to_string(&place).expect("a picture").contains("no solution found"));
    assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 1);
}

#[test]
fn every_mistake_about_branches_is_named() {
    let refused = |from: &str, to: &str, more: &[&str], parts: &[&str]| {
        let range = ["branches", "--parameter", "linear-density", "--from", from, "--to", to];
        assert_refused(&[&range[..], more].concat(), parts);
    };
    refused("0.1", "0.01", &[], &["--from", "0.1 to 0.01: the lower end comes first"]);
    refused("0.1", "0.1", &[], &["--from", "empty"]);
    refused("0", "0.1", &[], &["--from", "not positive"]);
    refused("0.1", "-1", &[], &["--to", "not positive"]);
    refused("0.1", "inf", &[], &["--to", "not finite"]);
    refused("0.1", "x", &[], &["--to", "'x' is not a number"]);
    refused("0.1", "0.2", &["--linear-density", "0.1"], &["--linear-density", "varies"]);
    refused("0.1", "0.2", &["--model", "elastic"], &["linear density of the cables has no effect"]);
    refused("0.1", "0.2", &["--model", "rigid"], &["no effect"]);
    refused("0.1", "0.2", &["--rotation-vector", "0,0,1"], &["--position"]);
    assert_refused(&["branches", "--from", "1", "--to", "2"], &["--parameter"]);
    let folder = TempDir::new().expect("a folder");
    for place in [folder.path().join("nowhere/a.svg"), folder.path().to_owned()] {
        let place = place.to_str().expect("UTF-8");
        refused("0.1", "0.2", &["--plot", place], &["--plot", place]);
    }
    assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 0);
}

#[test]
fn a_reader_of_branches_may_leave_early() {
    let mut child = Process::new(CDPR)
        .args(OVER_DENSITY)
        .args(["--format", "json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut line = String::new();
    // Points fill more than a pipe holds.
    BufReader::new(child.stdout.take().expect("a pipe")).read_line(&mut line).expect("a line");
    assert_eq!(line, "{\n");
    let output = child.wait_with_output().expect("the program ends");
    assert!(output.status.success());
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}
