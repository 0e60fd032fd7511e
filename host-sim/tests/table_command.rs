//! `cdpr table` as a person or a script meets it.

mod common;

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use assert_cmd::assert::Assert;
use cdpr_core::Table;
use cdpr_core::table::{CRC_BYTES, checksum, offset};
use common::{Folder, assert_refused, cdpr, killed_at, lines, lines_of, stdout};
use serde_json::Value;

/// Long, flat and mostly beyond the workspace, cells given up early: many tiles that take little, so that a build
/// has parts and can be killed in between, and is over in a second or two.
const QUESTION: [&str; 11] = [
    "table",
    "build",
    "--region=-100..100,6.9..7.1,2.4..2.6",
    "--position",
    "2,7,2.5",
    "--max-length",
    "50",
    "--depth",
    "4",
    "--threads",
    "1",
];
/// Tiles of it: 200 m, halved until they are no longer than 1 m.
const TILES: usize = 256;

/// The question with more options.
fn with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&QUESTION[..], more].concat()
}

/// A build in one, on one thread.
struct Build {
    table: Vec<u8>,
    /// Its journal, all tiles of it.
    journal: Vec<u8>,
}

static BUILD: LazyLock<Build> = LazyLock::new(|| {
    let folder = Folder::new();
    let (table, journal) = (folder.path("table"), folder.path("journal"));
    let report = stdout(&cdpr(&with(&["--out", &table])).success().stderr(""));
    assert!(report.contains("cells") && report.contains("covered: "), "{report}");
    // Nothing stays behind but the table.
    assert_eq!(folder.names(), ["table"]);
    cdpr(&with(&["--out", &journal, "--shard", "1/1"])).success().stdout("").stderr("");
    Build { table: folder.read("table"), journal: folder.read("journal") }
});

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let folder = Folder::new();
    let mut question = with(&[]);
    *question.last_mut().expect("threads") = "2";
    let out = folder.path("table");
    question.extend(["--out", &out]);
    cdpr(&question).success();
    assert!(folder.read("table") == BUILD.table);
    let table = Table::open(&BUILD.table).expect("a table");
    assert!(table.seeds() >= 2 && table.words() > 10);
}

#[test]
fn parts_merged_in_any_order_are_the_same_bytes() {
    let folder = Folder::new();
    let parts = [folder.path("1"), folder.path("2")];
    for (part, shard) in parts.iter().zip(["1/2", "2/2"]) {
        cdpr(&with(&["--out", part, "--shard", shard])).success().stdout("").stderr("");
        // The order, and every other tile.
        assert_eq!(lines(&fs::read(part).expect("a part")), 1 + TILES / 2);
    }
    assert_eq!(folder.names(), ["1", "2"]);
    let [one, two] = &parts;
    let out = folder.path("table");
    for given in [vec![one, two], vec![two, one], vec![one, two, one]] {
        let mut merge = vec!["table", "merge", "--out", &out];
        merge.extend(given.iter().map(|part| part.as_str()));
        let report = stdout(&cdpr(&merge).success().stderr(""));
        assert!(report.contains("covered: "), "{report}");
        assert!(folder.read("table") == BUILD.table, "{given:?}");
        fs::remove_file(&out).expect("the table");
    }
    // What is missing, or of another order, is said, and nothing is written.
    assert_refused(&["table", "merge", "--out", &out, one], &["128 of 256 tiles are missing"]);
    let other = folder.path("other");
    cdpr(&with(&["--out", &other, "--shard", "2/2", "--mass", "68"])).success();
    assert_refused(
        &["table", "merge", "--out", &out, one, &other],
        &["other: part of a table that was ordered otherwise"],
    );
    let table = folder.write("t", &BUILD.table);
    assert_refused(&["table", "merge", "--out", &out, one, &table], &["t, line 1: not part"]);
    let empty = folder.write("empty", b"");
    assert_refused(&["table", "merge", "--out", &out, one, &empty], &["empty, line 1", "empty"]);
    let missing = folder.path("missing");
    assert_refused(&["table", "merge", "--out", &out, one, &missing], &["missing: "]);
    assert_refused(&["table", "merge", "--out", &out], &["PART"]);
    assert!(!Path::new(&out).exists());
}

#[test]
fn a_build_that_is_killed_goes_on_to_the_same_bytes() {
    let folder = Folder::new();
    let out = folder.path("table");
    let part = folder.path("table.part");
    let done = || lines_of(&part);
    let mut killed = Vec::new();
    // As soon as there is an order, after the first tile, in the middle, and with all tiles written.
    for wanted in [1, 2, 40, TILES / 2, TILES - 20, TILES + 1] {
        let before = done();
        if killed_at(&with(&["--out", &out]), &part, wanted) {
            fs::remove_file(&out).expect("the table"); // faster than the kill: from the start again
            continue;
        }
        let after = done();
        assert!(after >= before, "{before} lines became {after}");
        assert!(!Path::new(&out).exists(), "half a table");
        killed.push(after);
    }
    println!("killed with {killed:?} lines"); // shown when it fails
    assert!(killed.len() >= 4, "{killed:?}");
    assert!(killed.iter().any(|lines| (2..=TILES).contains(lines)), "{killed:?}");
    cdpr(&with(&["--out", &out])).success();
    assert!(folder.read("table") == BUILD.table);
    // A draft that was being written when the kill came may be left, the journal not.
    assert!(!Path::new(&part).exists());
}

#[test]
fn a_torn_journal_is_made_whole() {
    let journal = &BUILD.journal;
    assert_eq!(lines(journal), 1 + TILES);
    let ends: Vec<usize> = (0..journal.len()).filter(|&at| journal[at] == b'\n').collect();
    let folder = Folder::new();
    let (out, part) = (folder.path("table"), folder.path("table.part"));
    // Within the order; behind it; within a tile in the middle, the first with a cell; before the
    // last end of line; none of it torn.
    for length in [ends[0] / 2, ends[0] + 1, ends[130] + 9, journal.len() - 1, journal.len()] {
        fs::write(&part, &journal[..length]).expect("a journal");
        cdpr(&with(&["--out", &out])).success();
        assert!(folder.read("table") == BUILD.table, "{length} of {} bytes", journal.len());
        assert_eq!(folder.names(), ["table"]);
        fs::remove_file(&out).expect("the table");
    }
    // A part on its own is made whole, too, to the very same journal.
    fs::write(&part, &journal[..ends[200] + 5]).expect("a journal");
    cdpr(&with(&["--out", &part, "--shard", "1/1"])).success();
    assert!(folder.read("table.part") == *journal);
}

#[test]
fn a_journal_of_something_else_is_left_alone() {
    let folder = Folder::new();
    let out = folder.path("table");
    let part = folder.write("table.part", &BUILD.journal);
    for other in [
        ["--mass", "68.9"],
        ["--max-tension", "40000"],
        ["--linear-density", "0.078"],
        ["--tilt-deg", "0.1"],
        ["--steps", "5"],
    ] {
        let mut question = with(&["--out", &out]);
        question.extend(other);
        assert_refused(&question, &["table.part: part of a table that was ordered otherwise"]);
        assert!(fs::read(&part).expect("the journal") == BUILD.journal, "{other:?}");
    }
    let damaged = |line: usize, text: &str| {
        let mut lines: Vec<&[u8]> = BUILD.journal.split(|byte| *byte == b'\n').collect();
        lines[line] = text.as_bytes();
        lines.join(&b'\n')
    };
    for (foreign, message) in [
        (b"my notes\n".to_vec(), "line 1: not part of a table"),
        (b"my notes".to_vec(), "line 1: not part of a table"),
        (b"\n".to_vec(), "line 1: not part of a table"),
        (b"{\"a\": 1}\n".to_vec(), "line 1: not part of a table"),
        (b"{\"my\":\"settings\"}".to_vec(), "line 1: not part of a table"),
        (BUILD.table.clone(), "line 1: not part of a table"),
        (damaged(7, "{\"tile\":6}"), "line 8: not part of a table"),
        (
            damaged(
                7,
                "{\"tile\":6,\"made\":{\"Split\":{\"coordinate\":9,\"halves\":[{\"Nothing\":0},{\"Nothing\":1}]}}}",
            ),
            "line 8: not part of a table",
        ),
        (damaged(7, "{\"tile\":-1,\"made\":{\"Nothing\":0}}"), "line 8: not part of a table"),
    ] {
        fs::write(&part, &foreign).expect("a file");
        assert_refused(&with(&["--out", &out]), &["table.part", message]);
        assert!(fs::read(&part).expect("the file") == foreign, "{message}");
        // As a part of its own just the same.
        assert_refused(&with(&["--out", &part, "--shard", "1/2"]), &["table.part", message]);
        assert!(fs::read(&part).expect("the file") == foreign, "{message}");
    }
    assert_eq!(folder.names(), ["table.part"]);
}

#[test]
fn every_mistake_about_tables_is_named() {
    let folder = Folder::new();
    let out = folder.path("table");
    let region = |text: &str, parts: &[&str]| {
        let option = format!("--region={text}");
        assert_refused(
            &["table", "build", &option, "--out", &out],
            &[&["--region"], parts].concat(),
        );
    };
    region("0..1,2..3", &["2 ranges given, three needed"]);
    region("0..1,2..3,1..2,0..1", &["4 ranges given, three needed"]);
    region("0..1,3..2,1..2", &["'3..2' does not ascend"]);
    region("0..1,2..2,1..2", &["--region, --tilt-deg: the region needs"]);
    region("0..1,2-3,1..2", &["'2-3' is not a number"]);
    region("0..1,2..x,1..2", &["'x' is not a number"]);
    region("0..1,2..inf,1..2", &["not finite"]);
    region("0..1,2..nan,1..2", &["not finite"]);
    region("", &["'' is not a number"]);
    // Ascending, but not in f32.
    region("7..7.00000001,2..3,1..2", &["ascending"]);
    region("-1e39..1e39,2..3,1..2", &["finite"]);

    let build = |more: &[&str], parts: &[&str]| {
        assert_refused(&[&with(&["--out", &out])[..], more].concat(), parts);
    };
    for shard in ["3/2", "0/2", "2", "1/0", "a/b", "-1/2", "1/2/3", ""] {
        build(&[&format!("--shard={shard}")], &["--shard", "is not a part like 2/8"]);
    }
    build(&["--solution", "99"], &["--solution", "the pose has only 1 solutions"]);
    build(&["--solution", "0"], &["--solution", "the pose has only 1 solutions"]);
    build(&["--solution", "1", "--choose", "fold"], &["--solution", "--choose"]);
    build(&["--choose", "longest"], &["--choose", "shortest", "tension", "fold"]);
    build(&["--steps", "0"], &["--steps"]);
    build(&["--steps", "21"], &["--steps"]);
    for tilt in ["-1", "45", "90", "nan", "inf", "x"] {
        build(&[&format!("--tilt-deg={tilt}")], &["--tilt-deg"]);
    }
    build(&["--robot", &folder.path("robot.toml")], &["robot.toml"]);
    build(&["--rotation-vector", "0,0,0.5"], &["outside the region"]);
    build(&["--mass", "0"], &["--mass"]);
    build(&["--model", "parabolic"], &["--model", "elastic catenary"]);
    // Two anchors that are one in f32.
    let robot = include_str!("../robots/marionet-crane.toml")
        .replace("[9.538, 3.797, 11.533]", "[9.4210000001, -3.482, 11.555]");
    let robot = folder.write("twins.toml", robot.as_bytes());
    build(&["--robot", &robot], &["rounded to f32", "cables 2 and 3"]);
    assert_refused(&with(&[]), &["--out"]);
    assert_refused(&["table", "build", "--out", &out], &["--region"]);
    let nowhere = folder.path("nowhere/table");
    assert_refused(&with(&["--out", &nowhere]), &["--out", "nowhere/table"]);
    assert_refused(&with(&["--out", &nowhere, "--shard", "1/2"]), &["nowhere/table"]);
    let place = folder.path("");
    assert_refused(&with(&["--out", &place]), &["--out", "no file"]);
    // Start outside of the region, and without a solution.
    let start = |position: &str, parts: &[&str]| {
        let mut question = with(&["--out", &out]);
        question[4] = position;
        assert_refused(&question, parts);
    };
    start("2,8,2.5", &["outside the region"]);
    start("90,7,2.5", &["no solution"]);

    let good = folder.write("good", &BUILD.table);
    let damaged = |at: usize| {
        let mut bytes = BUILD.table.clone();
        bytes[at] ^= 1;
        bytes
    };
    let files = [
        (folder.path("missing"), "missing: "),
        (folder.write("text", b"my notes\n"), "text: too short for a table"),
        (folder.write("long", &[b'a'; 1000]), "long: not a warm-start table"),
        (folder.write("journal", &BUILD.journal), "journal: not a warm-start table"),
        (folder.write("empty", b""), "empty: too short for a table"),
        (folder.write("version", &damaged(9)), "version: of version 261, newer than 5"),
        (folder.write("torn", &BUILD.table[..BUILD.table.len() - 1]), "torn: "),
        (folder.write("flipped", &damaged(400)), "flipped: corrupt: its checksum is wrong"),
    ];
    for (file, message) in &files {
        for command in ["inspect", "verify", "emit-rust", "emit-c"] {
            assert_refused(&["table", command, file], &[message]);
        }
    }
    for name in ["", "1A", "A-B", "A B", "ä"] {
        let option = format!("--name={name}");
        assert_refused(
            &["table", "emit-rust", &good, &option],
            &["--name", "not a name in Rust and C"],
        );
    }
    assert_refused(&["table", "verify", &good, "--poses=-1"], &["--poses"]);
    assert_refused(&["table"], &["build", "merge", "inspect", "verify", "emit-rust", "emit-c"]);
    // No table, no journal, no draft.
    assert!(folder.names().iter().all(|name| !name.starts_with("table") && !name.starts_with('.')));
}

/// With another number of Newton steps, and the checksum for it.
fn with_steps(steps: u8) -> Vec<u8> {
    let mut bytes = BUILD.table.clone();
    bytes[offset::STEPS] = steps;
    let protected = bytes.len() - CRC_BYTES;
    let sum = checksum(&bytes[..protected]);
    bytes[protected..].copy_from_slice(&sum.to_le_bytes());
    bytes
}

#[test]
fn verification_confirms_a_good_table_and_no_other() {
    let folder = Folder::new();
    let good = folder.write("good", &BUILD.table);
    // One pose in a hundred is among the cells of this region.
    let verify = |file: &str| {
        ["table", "verify", file, "--poses", "20000", "--format", "json"].map(str::to_owned)
    };
    let numbers = |assert: &Assert, led: &str| -> [u64; 4] {
        let answer: Value = serde_json::from_str(&stdout(assert)).expect("JSON");
        assert_eq!(answer["poses"], 20_000);
        ["poses", "confirmed", "wrong", "undecided"]
            .map(|field| answer[led][field].as_u64().expect(field))
    };
    let [covered, confirmed, wrong, undecided] =
        numbers(&cdpr(&verify(&good)).success(), "covered");
    assert_eq!((wrong, undecided), (0, 0));
    assert!(covered >= 50 && confirmed == covered, "{confirmed} of {covered}");
    let text = stdout(&cdpr(&["table", "verify", &good, "--poses", "20"]).success());
    assert!(text.contains("20 random poses") && text.contains("0 do not"), "{text}");
    // And where it covers nothing, by way: none from metres away.
    for precision in ["f32", "f64"] {
        let options = ["--way-parts", "60", "--precision", precision].map(str::to_owned);
        let assert = cdpr(&[&verify(&good)[..], &options].concat()).success();
        assert_eq!(numbers(&assert, "covered"), [covered, covered, 0, 0]);
        let [reached, confirmed, wrong, undecided] = numbers(&assert, "by_way");
        assert_eq!((wrong, undecided), (0, 0));
        assert!(reached >= 20 && confirmed == reached, "{confirmed} of {reached}");
    }
    let by_way = ["table", "verify", &good, "--poses", "20", "--way-parts", "60"];
    let text = stdout(&cdpr(&by_way).success());
    assert!(text.contains("others reached") && text.contains("% are covered"), "{text}");
    // Without a step nothing arrives that is not a seed already.
    let hasty = folder.write("hasty", &with_steps(0));
    let assert = cdpr(&verify(&hasty)).code(1);
    let [.., wrong, _] = numbers(&assert, "covered");
    assert!(wrong > 0);
    let message = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    assert!(message.contains(&format!("the table is wrong at {wrong} poses")), "{message}");
}

fn assert_compiles(folder: &Folder, compiler: &str, language: &str, text: &str) {
    let file = folder.write("emitted", text.as_bytes());
    let options = ["-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", language, &file];
    let status = std::process::Command::new(compiler).args(options).status().expect("a compiler");
    assert!(status.success(), "{compiler}: {status}");
}

#[test]
fn constants_for_rust_and_c_have_the_very_bytes() {
    let folder = Folder::new();
    let file = folder.write("good", &BUILD.table);
    let count = BUILD.table.len();
    for (options, name) in [(&[][..], "TABLE"), (&["--name", "_HOME_2"][..], "_HOME_2")] {
        for (command, head, end) in [
            ("emit-rust", format!("pub const {name}: [u8; {count}] = [\n"), "];\n"),
            ("emit-c", format!("const unsigned char {name}[{count}] = {{\n"), "};\n"),
        ] {
            let text = stdout(&cdpr(&[&["table", command, &file][..], options].concat()).success());
            if command == "emit-c" {
                assert_compiles(&folder, "cc", "c", &text);
                assert_compiles(&folder, "c++", "c++", &text);
            }
            let (_, rest) = text.split_once(&head).expect("a constant");
            let numbers = rest.strip_suffix(end).expect("its end");
            let bytes: Vec<u8> = numbers
                .split(',')
                .map(str::trim)
                .filter(|number| !number.is_empty())
                .map(|number| number.parse().expect("a byte"))
                .collect();
            assert!(bytes == BUILD.table);
        }
    }
}

#[test]
fn inspection_says_what_is_in_a_table() {
    let folder = Folder::new();
    let file = folder.write("good", &BUILD.table);
    let json = stdout(&cdpr(&["table", "inspect", &file, "--format", "json"]).success());
    let answer: Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(answer["bytes"], BUILD.table.len());
    assert_eq!(answer["version"], 5);
    assert_eq!(answer["load"][0], 69.0);
    assert_eq!(answer["max_lengths_m"], serde_json::json!([50.0, 50.0, 50.0, 50.0, 50.0, 50.0]));
    assert_eq!(answer["low"][0], -100.0);
    assert_eq!(answer["extent"][0], 200.0);
    // A binary tree has a leaf more than it has splits, and in a short one each takes a word, but for what is not covered.
    let count = |field: &str| answer[field].as_u64().expect(field);
    let uncovered = answer["uncovered"].as_array().expect("places");
    assert_eq!(count("words"), 2 * count("cells") + uncovered.len() as u64 - 1);
    // Cells and the other places fill the region; a pose in the middle of one of these has no seed.
    let table = Table::open(&BUILD.table).expect("a table");
    for place in uncovered {
        let middle = |k: usize| {
            let end = |side: &str| place[side][k].as_f64().expect("a number");
            0.5 * (end("low") + end("high"))
        };
        let position = nalgebra::Vector3::from_fn(|k, _| middle(k));
        let pose = cdpr_core::Pose::new(position, nalgebra::UnitQuaternion::identity());
        let fault = table.start_at(&pose.expect("a pose")).expect_err("a gap");
        let reason = place["reason"].as_str().expect("a reason");
        assert!(fault.to_string().contains(reason), "{fault}, not {reason}");
    }
    let text = stdout(&cdpr(&["table", "inspect", &file]).success());
    assert!(text.contains("warm-start table, version 5") && text.contains("load 69 kg"), "{text}");
}

#[test]
fn help_of_tables_names_units_and_defaults() {
    let help = stdout(&cdpr(&["table", "build", "--help"]).success());
    for part in ["--region <X..X,Y..Y,Z..Z>", "--tilt-deg <DEG>", "--shard <K/N>", "m"] {
        assert!(help.contains(part), "{part} not in {help}");
    }
}

#[test]
fn sheets_are_listed_with_where_a_table_of_them_starts() {
    let question = ["table", "sheets", "--grid", "5,9,4", "--region", "0..4,4..12,1..4"];
    let limited = [&question[..], &["--max-length", "60"]].concat();
    let text = stdout(&cdpr(&limited).success().stderr(""));
    assert!(text.starts_with("180 poses, "), "{text}");
    assert!(text.contains("Sheet 1: ") && text.contains("shortest longest cable: "), "{text}");
    let json = stdout(&cdpr(&[&limited[..], &["--format", "json"]].concat()).success());
    let one = [&limited[..], &["--format", "json", "--threads", "1"]].concat();
    assert_eq!(json, stdout(&cdpr(&one).success()));
    let sheets: Value = serde_json::from_str(&json).expect("JSON");
    let largest = &sheets["sheets"][0];
    // Its best start is the best of the solutions there, which a table would take.
    let best = &largest["shortest"];
    let position: Vec<String> =
        best["position_m"].as_array().expect("a position").iter().map(Value::to_string).collect();
    let position = position.join(",");
    let ask = ["enumerate", "--position", &position, "--max-length", "60", "--method", "complete"];
    let answer = stdout(&cdpr(&[&ask[..], &["--format", "json"]].concat()).success());
    let answer: Value = serde_json::from_str(&answer).expect("JSON");
    let index = usize::try_from(best["solution"].as_u64().expect("a number")).expect("small") - 1;
    let lengths_m = answer["solutions"][index]["lengths_m"].as_array().expect("lengths");
    let longest_m = lengths_m.iter().map(|l| l.as_f64().expect("m")).fold(0.0, f64::max);
    assert!((longest_m - best["value"].as_f64().expect("m")).abs() < 1e-9);

    assert_refused(&question[..4], &["--region"]);
    assert_refused(&[&question[..], &["--rotation-vector", "0,x,0"]].concat(), &["'x'"]);
    assert_refused(&["table", "sheets", "--grid", "2,2,2", "--region", "0,0,0"], &["no extent"]);
}
