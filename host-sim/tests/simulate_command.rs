//! `cdpr simulate` as a person or a script meets it.

mod common;

use std::fs;
use std::io::Read as _;
use std::path::PathBuf;
use std::process::{Command as Process, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use assert_cmd::Command;
use common::CDPR;
use serde_json::Value;
use tempfile::TempDir;

const LIMITS: [&str; 4] = ["--max-length", "60", "--max-tension", "2000"];
const TRAJECTORY: &str =
    "time_s,x_m,y_m,z_m,rz_rad\n0,2,7,2.5,0\n2,2.2,7.4,2.6,0.05\n4,2,7,2.5,0\n";

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(TempDir::new().expect("a folder"));
        fs::write(
            folder.path("t.csv"),
            TRAJECTORY
                .replace("rz_rad", "rx_rad,ry_rad,rz_rad")
                .replace(",0\n", ",0,0,0\n")
                .replace(",0.05\n", ",0,0,0.05\n"),
        )
        .expect("a file");
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn simulate(&self, further: &[&str]) -> assert_cmd::assert::Assert {
        Command::new(CDPR)
            .current_dir(self.0.path())
            .args(["simulate", "--trajectory", "t.csv"])
            .args(LIMITS)
            .args(further)
            .assert()
    }
}

#[test]
fn a_run_is_summed_up_logged_and_drawn() {
    let folder = Folder::new();
    let further = ["--log", "run.csv", "--plot", "run.svg", "--format", "json"];
    let assert = folder.simulate(&further).success();
    let summary: Value = serde_json::from_slice(&assert.get_output().stdout).expect("JSON");
    assert_eq!(summary["outcome"], "tracked");
    assert!(summary["static_m"]["largest"].as_f64().unwrap() < 1e-3);
    let svg = fs::read_to_string(folder.path("run.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("pose error, mm"));

    let mut log = csv::Reader::from_path(folder.path("run.csv")).unwrap();
    let columns = log.headers().unwrap().clone();
    let place = |name: &str| columns.iter().position(|column| column == name).expect(name);
    let (time, mode) = (place("time_s"), place("mode"));
    for name in [
        "x_m",
        "commanded_qw",
        "tension_n_6",
        "motor_angle_1",
        "contraction",
        "static_error_m",
        "note",
    ] {
        place(name);
    }
    let rows: Vec<_> = log.records().collect::<Result<_, _>>().unwrap();
    let times: Vec<f64> = rows.iter().map(|row| row[time].parse().unwrap()).collect();
    assert!(times.is_sorted());
    assert!(rows.iter().any(|row| &row[mode] == "tracking"));
    // As many rows as looks, and one for each event between them.
    let ticks = summary["ticks"].as_u64().unwrap();
    assert!(rows.len() as u64 >= ticks / 10);
}

#[test]
fn an_mcap_log_has_its_topics() {
    let folder = Folder::new();
    folder.simulate(&["--log", "run.mcap"]).success();
    let bytes = fs::read(folder.path("run.mcap")).unwrap();
    let mut counts = std::collections::BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(
            (schema.encoding.as_str(), message.channel.message_encoding.as_str()),
            ("jsonschema", "json")
        );
        serde_json::from_slice::<Value>(&schema.data).unwrap();
        let value: Value = serde_json::from_slice(&message.data).unwrap();
        if message.channel.topic == "/run" {
            assert_eq!(value["length_m"].as_array().unwrap().len(), 6);
        }
        *counts.entry(message.channel.topic.clone()).or_insert(0) += 1;
    }
    assert_eq!(
        counts.keys().map(String::as_str).collect::<Vec<_>>(),
        ["/commanded", "/events", "/platform", "/run"]
    );
    assert_eq!(counts["/platform"], counts["/run"]);
}

/// What was written before a kill is all there: rows of both kinds of logs up to nearly the end.
#[test]
fn a_killed_run_leaves_what_it_wrote() {
    let folder = Folder::new();
    // Long, so that it can be killed: an hour of going nowhere.
    fs::write(folder.path("long.csv"), "time_s,x_m,y_m,z_m\n0,2,7,2.5\n3600,2.1,7,2.5\n").unwrap();
    for name in ["run.csv", "run.mcap"] {
        let mut child = Process::new(CDPR)
            .current_dir(folder.0.path())
            .args(["simulate", "--trajectory", "long.csv", "--log", name])
            .args(LIMITS)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let began = Instant::now();
        let size = || fs::metadata(folder.path(name)).map_or(0, |file| file.len());
        while size() < 200_000 && began.elapsed() < Duration::from_mins(1) {
            sleep(Duration::from_millis(5));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let bytes = fs::read(folder.path(name)).unwrap();
        let rows = if name == "run.csv" {
            let rows = csv::Reader::from_reader(&bytes[..]).records().flatten().count();
            assert_eq!(bytes.last(), Some(&b'\n'), "a row is torn");
            rows
        } else {
            let options = mcap::read::Options::IgnoreEndMagic.into();
            let stream = mcap::MessageStream::new_with_options(&bytes, options).unwrap();
            stream.map_while(Result::ok).filter(|message| message.channel.topic == "/run").count()
        };
        // 200 kB at less than 2 kB a row.
        assert!(rows > 80, "{name}: {rows} rows of {} bytes", bytes.len());
    }
}

/// Ctrl-C ends the log, sums up, and says so.
#[cfg(unix)]
#[test]
fn an_interrupted_run_sums_up() {
    let folder = Folder::new();
    fs::write(folder.path("long.csv"), "time_s,x_m,y_m,z_m\n0,2,7,2.5\n3600,2.1,7,2.5\n").unwrap();
    let mut child = Process::new(CDPR)
        .current_dir(folder.0.path())
        .args(["simulate", "--trajectory", "long.csv", "--log", "run.mcap"])
        .args(LIMITS)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let began = Instant::now();
    while fs::metadata(folder.path("run.mcap")).map_or(0, |file| file.len()) < 50_000
        && began.elapsed() < Duration::from_mins(1)
    {
        sleep(Duration::from_millis(5));
    }
    let id = child.id().to_string();
    assert!(Process::new("kill").args(["-INT", &id]).status().unwrap().success());
    let status = child.wait().unwrap();
    assert_eq!(status.code(), Some(130));
    let (mut out, mut err) = (String::new(), String::new());
    child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    assert!(out.contains("Outcome: held before the end"), "{out}");
    assert!(err.contains("interrupted"), "{err}");
    // With its end: no option needed.
    let bytes = fs::read(folder.path("run.mcap")).unwrap();
    assert!(mcap::MessageStream::new(&bytes).unwrap().all(|message| message.is_ok()));
}

#[test]
fn outcomes_have_exit_codes_and_words() {
    let folder = Folder::new();
    fs::write(folder.path("f.toml"), "[[fault]]\nkind = 'winch-stuck'\nwinch = 3\nat_s = 0.5\n")
        .unwrap();
    let assert = folder.simulate(&["--faults", "f.toml"]).code(1);
    let output = assert.get_output();
    let (out, err) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(
        out.contains("fault: cable 3: ")
            && out.contains("Outcome: stopped by a fault, brakes closed"),
        "{out}"
    );
    assert_eq!(err, "cdpr: the platform: stopped by a fault, brakes closed\n");
}

#[test]
fn bad_input_is_refused_by_name() {
    let folder = Folder::new();
    let write = |name: &str, text: &str| fs::write(folder.path(name), text).unwrap();
    let refused = |further: &[&str], what: &str| {
        let assert = folder.simulate(further).code(2).stdout("");
        let message = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(message.contains(what), "{message}");
    };
    write("f.toml", "[[fault]]\nkind = 'winch-stick'\n");
    refused(&["--faults", "f.toml"], "f.toml:2: fault[1].kind: 'winch-stick' is none of");
    refused(&["--faults", "none.toml"], "none.toml: ");
    refused(&["--log", "no/such/place.csv"], "--log no/such/place.csv: ");
    refused(&["--plot", "no/such/place.svg"], "--plot no/such/place.svg: ");
    refused(&["--table", "t.csv"], "t.csv: ");
    refused(&["--firmware", "none.elf"], "none.elf");
    refused(&["--max-length", "9"], "--max-length");
    write("robot.toml", "name = 'x'\n[winch]\ngear = 0\n");
    refused(&["--robot", "robot.toml"], "robot.toml:");
    // A bit of a table flips in its flash.
    let table =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../firmware-example/tables/marionet-crane.cdpr");
    write("f.toml", "[[fault]]\nkind = 'table'\nbit = 3000\n");
    refused(&["--faults", "f.toml", "--table", table], "marionet-crane.cdpr: ");
    // Nowhere near a solution.
    write("t.csv", "time_s,x_m,y_m,z_m\n0,50,7,2.5\n9,50.1,7,2.5\n");
    refused(&[], "at the first set-point: ");
}

#[test]
fn places_to_rest_are_found_from_lengths() {
    let lengths = "10.479831,15.077343,12.221567,14.731523,11.970178,8.355886";
    let question =
        ["forward", "--lengths", lengths, "--position", "2.1,6.9,2.4", "--format", "json"];
    let assert = Command::new(CDPR).args(question).assert().success();
    let answer: Value = serde_json::from_slice(&assert.get_output().stdout).expect("JSON");
    let place = &answer["places"][0];
    assert_eq!(place["is_stable"], true);
    for (coordinate, wanted) in [2.0, 7.0, 2.5].iter().enumerate() {
        // Lengths are given to 1e-6 m.
        assert!(
            (place["position_m"][coordinate].as_f64().unwrap() - wanted).abs() < 1e-4,
            "{place}"
        );
    }
    assert_eq!(place["is_within_limits"], true);
    // Steel that stretches to eight times its length: an answer of the model, and marked as none of the robot.
    let short = ["forward", "--lengths", "1,1,1,1,1,1", "--position", "2,7,2.5"];
    let assert = Command::new(CDPR).args(short).assert().success();
    let text = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
    assert!(text.contains("BEYOND THE LIMIT OF TENSION"), "{text}");
    Command::new(CDPR)
        .args(["forward", "--lengths", "1,2,3", "--position", "2,7,2.5"])
        .assert()
        .code(2);
}
