//! `cdpr workspace` as a person or a script meets it.

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::fs::File;
use std::sync::LazyLock;

use common::{Folder, assert_refused, cdpr, killed_at, lines, lines_of, start, stderr, stdout};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use serde_json::Value;

/// Around the workspace, at a mass and with limits at which every kind of change is met.
const QUESTION: [&str; 10] = [
    "workspace",
    "--grid",
    "11,20,8",
    "--region=-1..8.5,-0.5..20.4,0..4.5",
    "--mass",
    "10",
    "--max-length",
    "300",
    "--threads",
    "1",
];
const POSES: usize = 11 * 20 * 8;
const TILES: usize = POSES.div_ceil(64);

fn with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&QUESTION[..], more].concat()
}

/// The three files of a map.
type Files = [Vec<u8>; 3];

fn files(folder: &Folder) -> Files {
    ["csv", "parquet", "json"].map(|kind| folder.read(&format!("workspace.{kind}")))
}

/// The map in one, on one thread.
struct Map {
    folder: Folder,
    files: Files,
    told: String,
}

static MAP: LazyLock<Map> = LazyLock::new(|| {
    let folder = Folder::new();
    let told = stdout(&cdpr(&with(&["--out", &folder.path("")])).success().stderr(""));
    // Nothing stays behind but the map.
    assert_eq!(folder.names(), ["workspace.csv", "workspace.json", "workspace.parquet"]);
    Map { files: files(&folder), folder, told }
});

/// A row of the CSV: texts by the name of their column.
type Row = BTreeMap<String, String>;

fn rows() -> Vec<Row> {
    let mut reader = csv::Reader::from_reader(MAP.files[0].as_slice());
    let rows: Vec<Row> = reader.deserialize().map(|row| row.expect("a row")).collect();
    assert_eq!(rows.len(), POSES);
    rows
}

fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {:?}", row[column]))
}

/// To the bit.
fn assert_same(a: f64, b: f64) {
    assert_eq!(a.to_bits(), b.to_bits(), "{a} and {b}");
}

#[test]
fn each_row_is_what_the_enumeration_of_its_pose_says() {
    let rows = rows();
    let mut cases = String::new();
    for row in &rows {
        let position_m = ["x_m", "y_m", "z_m"].map(|axis| number(row, axis));
        cases.push_str(&serde_json::json!({ "position_m": position_m }).to_string());
        cases.push('\n');
    }
    let folder = Folder::new();
    let cases = folder.write("cases.jsonl", cases.as_bytes());
    let question = ["enumerate", "--cases", &cases, "--mass", "10", "--max-length", "300"];
    let further = ["--method", "complete", "--format", "json"];
    let answers = stdout(&cdpr(&[&question[..], &further[..]].concat()).success());
    let mut changes = BTreeMap::<&str, usize>::new();
    let mut best_is_not_first = 0;
    for (row, answer) in rows.iter().zip(answers.lines()) {
        let answer: Value = serde_json::from_str(answer).expect("JSON");
        let solutions = answer["solutions"].as_array().expect("solutions");
        let rigid = answer["rigid"].as_array().expect("rigid").len();
        assert_eq!(row["status"], "proven");
        assert_eq!(row["rigid_solutions"], rigid.to_string());
        assert_eq!(row["rigid_degree"], answer["degree"]["rigid"].to_string());
        assert_eq!(row["solutions"], solutions.len().to_string());
        assert_eq!(row["degree"], answer["degree"]["deformable"].to_string());
        let lost = rigid > 0 && solutions.is_empty();
        let gained = rigid == 0 && !solutions.is_empty();
        assert_eq!(row["change"].starts_with("lost_"), lost, "{row:?}");
        assert_eq!(row["change"] == "gained", gained, "{row:?}");
        *changes.entry(&row["change"]).or_default() += 1;

        let list = |solution: &Value, name: &str| -> Vec<f64> {
            let values = solution[name].as_array().expect(name);
            values.iter().map(|value| value.as_f64().expect(name)).collect()
        };
        let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let longest_m: Vec<f64> =
            solutions.iter().map(|solution| largest(&list(solution, "lengths_m"))).collect();
        let best = (0..solutions.len()).min_by(|a, b| longest_m[*a].total_cmp(&longest_m[*b]));
        let Some(best) = best else {
            for (column, value) in row {
                let of_best = ["length", "tension", "margin"].iter().any(|n| column.contains(n));
                assert!(!of_best || value.is_empty(), "{column} {value}");
            }
            continue;
        };
        best_is_not_first += usize::from(best > 0);
        let best = &solutions[best];
        let (lengths_m, at_anchor_n) = (list(best, "lengths_m"), list(best, "anchor_tensions_n"));
        let (x_n, z_n) = (list(best, "horizontal_forces_n"), list(best, "vertical_forces_n"));
        let mut highest_n = 0.0_f64;
        for i in 0..6 {
            let cable = i + 1;
            assert_same(number(row, &format!("length_{cable}_m")), lengths_m[i]);
            assert_same(number(row, &format!("anchor_tension_{cable}_n")), at_anchor_n[i]);
            let at_attachment_n = number(row, &format!("attachment_tension_{cable}_n"));
            let expected_n = x_n[i].hypot(z_n[i]);
            assert!((at_attachment_n - expected_n).abs() <= 1e-14 * expected_n);
            highest_n = highest_n.max(at_attachment_n).max(at_anchor_n[i]);
        }
        assert_same(number(row, "length_margin_m"), 300.0 - largest(&lengths_m));
        assert_same(number(row, "tension_margin_n"), 50_000.0 - highest_n);
        let condition = best["condition"].as_f64().expect("a condition");
        assert!((number(row, "fold_margin") * condition - 1.0).abs() < 1e-15);
    }
    for change in ["", "gained", "lost_by_merging", "lost_to_limits"] {
        assert!(
            changes.contains_key(change),
            "the grid holds no pose with {change:?}: {changes:?}"
        );
    }
    assert!(best_is_not_first > 0);
}

#[test]
fn parquet_holds_what_csv_holds() {
    let file = File::open(MAP.folder.path("workspace.parquet")).expect("a file");
    let reader = SerializedFileReader::new(file).expect("Parquet");
    let metadata = reader.metadata().file_metadata().key_value_metadata().expect("metadata");
    let order = metadata.iter().find(|pair| pair.key == "cdpr.order").expect("an order");
    let order: Value = serde_json::from_str(order.value.as_ref().expect("a value")).expect("JSON");
    let document: Value = serde_json::from_slice(&MAP.files[2]).expect("JSON");
    assert_eq!(order, document["order"]);
    let mut seen = 0;
    for (row, expected) in reader.get_row_iter(None).expect("rows").zip(rows()) {
        let row = row.expect("a row");
        assert_eq!(row.len(), expected.len());
        for (name, field) in row.get_column_iter() {
            let expected = &expected[name];
            match field {
                Field::Null => assert_eq!(expected, "", "{name}"),
                Field::Int(value) => assert_eq!(*expected, value.to_string(), "{name}"),
                Field::Str(value) => assert_eq!(expected, value, "{name}"),
                Field::Double(value) => {
                    let expected: f64 = expected.parse().expect(name);
                    assert_eq!(expected.to_bits(), value.to_bits(), "{name}");
                }
                other => panic!("{name}: {other:?}"),
            }
        }
        seen += 1;
    }
    assert_eq!(seen, POSES);
}

#[test]
fn the_statistics_are_those_of_the_rows() {
    let document: Value = serde_json::from_slice(&MAP.files[2]).expect("JSON");
    let summary = &document["summary"];
    let rows = rows();
    let count = |column: &str, value: &str| rows.iter().filter(|row| row[column] == value).count();
    assert_eq!(summary["poses"], POSES);
    for (column, histogram) in [("rigid_solutions", "rigid"), ("solutions", "solutions")] {
        let histogram = summary[histogram].as_object().expect("a histogram");
        assert!(histogram.len() >= 3, "{histogram:?}");
        let without = count(column, "0");
        let with: u64 = histogram.values().map(|n| n.as_u64().expect("a count")).sum();
        assert_eq!(with + without as u64, POSES as u64);
        for (solutions, poses) in histogram {
            assert_eq!(*poses, count(column, solutions));
        }
        let reached = POSES - without;
        let share = 100.0 * count(column, "2") as f64 / reached as f64;
        for told in [format!("{reached} poses with solutions"), format!("{share:.3} %")] {
            assert!(MAP.told.contains(&told), "{told:?} not in {}", MAP.told);
        }
    }
    for change in ["lost_by_merging", "lost_to_limits", "lost", "gained"] {
        assert_eq!(summary[change], count("change", change));
    }
    for cable in 1..=6 {
        let column = format!("length_{cable}_m");
        let with = rows.iter().filter(|row| !row[&column].is_empty());
        let longest_m = with.map(|row| number(row, &column)).fold(0.0, f64::max);
        assert_eq!(summary["needs"][cable - 1]["length_m"], longest_m);
    }
    assert!(MAP.told.contains(&format!("\n{POSES} poses in ")), "{}", MAP.told);
    assert!(MAP.told.contains(" a second"), "{}", MAP.told);
}

#[test]
fn rigid_maps_and_other_choices() {
    let folder = Folder::new();
    // Poses with several solutions are near the border.
    let grid =
        ["workspace", "--grid", "9,16,1", "--region=-1..8.5,-0.5..20.4,1.65", "--mass", "10"];
    let question = [&grid[..], &["--rotation-vector", "0,0.1,0"]].concat();
    let run = |name: &str, further: &[&str]| {
        let out = folder.path(name);
        cdpr(&[&question[..], &["--format", "json", "--out", &out], further].concat()).success();
        folder.read(&format!("{name}/workspace.csv"))
    };
    let rigid = run("rigid", &["--rigid-only"]);
    assert_eq!(rigid, run("model", &["--model", "rigid"]));
    let text = String::from_utf8(rigid.clone()).expect("UTF-8");
    assert_eq!(lines(&rigid), 1 + 9 * 16);
    assert!(text.contains(",rigid,") && !text.contains("proven"), "{text}");
    let shortest = run("shortest", &[]);
    let fold = run("fold", &["--choose", "fold"]);
    let tension = run("tension", &["--choose", "tension"]);
    // Each map is the best one by its own criterion, pose by pose; by another one somewhere worse.
    let values = |bytes: &[u8], column: &str| -> Vec<f64> {
        let mut reader = csv::Reader::from_reader(bytes);
        let rows: Vec<Row> = reader.deserialize().map(|row| row.expect("a row")).collect();
        rows.iter().filter(|row| !row[column].is_empty()).map(|row| number(row, column)).collect()
    };
    for (column, best, other) in [
        ("length_margin_m", &shortest, &fold),
        ("tension_margin_n", &tension, &fold),
        ("fold_margin", &fold, &shortest),
    ] {
        let (best, other) = (values(best, column), values(other, column));
        assert_eq!(best.len(), other.len());
        assert!(best.iter().zip(&other).all(|(best, other)| best >= other), "{column}");
        assert!(best.iter().zip(&other).any(|(best, other)| best > other), "{column}");
    }
}

#[test]
fn any_number_of_threads_and_parts_gives_the_same_bytes() {
    let folder = Folder::new();
    let mut question = with(&[]);
    *question.last_mut().expect("threads") = "2";
    let out = folder.path("threads");
    question.extend(["--out", &out]);
    cdpr(&question).success();
    let in_folder = |name: &str| {
        ["csv", "parquet", "json"].map(|kind| folder.read(&format!("{name}/workspace.{kind}")))
    };
    assert!(in_folder("threads") == MAP.files);

    let out = folder.path("parts");
    for shard in ["1/3", "2/3", "3/3"] {
        cdpr(&with(&["--out", &out, "--shard", shard])).success().stdout("").stderr("");
    }
    let parts = [1, 2, 3].map(|k| folder.path(&format!("parts/part-{k}-of-3.jsonl")));
    let tiles: usize = parts.iter().map(|part| lines_of(part) - 1).sum();
    assert_eq!(tiles, TILES);
    let [one, two, three] = &parts;
    let merged = folder.path("merged");
    let merge = |parts: &[&String]| {
        let merge = ["workspace", "merge", "--out", &merged].into_iter();
        merge.chain(parts.iter().map(|part| part.as_str())).map(str::to_owned).collect::<Vec<_>>()
    };
    for parts in [[three, one, two], [one, two, three]] {
        cdpr(&merge(&parts)).success().stderr("");
        assert!(in_folder("merged") == MAP.files);
        fs::remove_dir_all(&merged).expect("the map");
    }
    assert_refused(&merge(&[one, three]), &["tiles are missing"]);
    let table = folder.write("notes", b"{\"format\":1}\n");
    assert_refused(&merge(&[&table]), &["notes, line 1: not part of a map"]);
    let other = folder.path("other");
    cdpr(&with(&["--out", &other, "--shard", "2/3", "--choose", "fold"])).success();
    let other = folder.path("other/part-2-of-3.jsonl");
    assert_refused(&merge(&[one, &other, three]), &["ordered otherwise"]);
    // A tile with poses too few, or a number that no tile has.
    let text = String::from_utf8(fs::read(one).expect("a part")).expect("UTF-8");
    for (from, to) in [
        ("{\"tile\":3,\"made\":[{", "{\"tile\":3,\"made\":[],\"x\":[{"),
        ("{\"tile\":3,", "{\"tile\":99999999999999999,"),
    ] {
        assert!(text.contains(from));
        let wrong = folder.write("wrong", text.replace(from, to).as_bytes());
        assert_refused(&merge(&[&wrong]), &["wrong, line 3: not part of a map"]);
    }
    assert!(!fs::exists(&merged).expect("a folder"));
}

#[test]
fn a_run_that_is_killed_goes_on_to_the_same_bytes() {
    let folder = Folder::new();
    let (out, part) = (folder.path(""), folder.path("part-1-of-1.jsonl"));
    let question = with(&["--out", &out]);
    let mut killed = Vec::new();
    for wanted in [1, 2, TILES / 3, TILES / 2, TILES - 3] {
        let before = lines_of(&part);
        assert!(!killed_at(&question, &part, wanted), "done before {wanted} lines");
        let after = lines_of(&part);
        assert!(after >= before && after <= TILES, "{before} lines became {after}");
        // Neither half a map nor a draft of one.
        assert_eq!(folder.names(), ["part-1-of-1.jsonl"]);
        killed.push(after);
    }
    assert!(killed.iter().any(|lines| (2..TILES).contains(lines)), "{killed:?}");
    // A line that was torn off is made anew.
    let mut torn = folder.read("part-1-of-1.jsonl");
    torn.truncate(torn.len() - 9);
    folder.write("part-1-of-1.jsonl", &torn);
    cdpr(&question).success();
    assert!(files(&folder) == MAP.files);
    assert!(!folder.names().contains(&"part-1-of-1.jsonl".to_owned()));
}

/// However short the drums are and however light the cables, branches merge in pairs only.
#[test]
fn only_pairs_merge() {
    let folder = Folder::new();
    let out = folder.path("map");
    let far = ["workspace", "--grid", "9,15,8", "--region=-3..9.5,-0.5..20.4,0..8", "--out", &out];
    let mut seen = BTreeMap::<String, usize>::new();
    for further in [
        &["--max-length", "20", "--linear-density", "0.0005"][..],
        &["--mass", "10", "--max-length", "30"],
        &["--mass", "10", "--model", "elastic"],
        &["--mass", "10", "--model", "parabolic", "--max-tension", "30"],
    ] {
        cdpr(&[&far[..], further].concat()).success().stderr("");
        let csv = folder.read("map/workspace.csv");
        for row in csv::Reader::from_reader(csv.as_slice()).deserialize() {
            let row: Row = row.expect("a row");
            if row["change"] == "lost_by_merging" {
                assert_eq!(row["rigid_degree"], "0", "{further:?}: {row:?}");
                assert!(number(&row, "rigid_solutions") >= 2.0);
            }
            let is_weightless = row["change"] == "lost_without_weight";
            assert!(!is_weightless || further.contains(&"elastic"), "{row:?}");
            *seen.entry(row["change"].clone()).or_default() += 1;
        }
        fs::remove_dir_all(&out).expect("the map");
    }
    for change in ["lost_to_limits", "lost_without_weight"] {
        assert!(seen.contains_key(change), "{seen:?}");
    }
}

/// At a fold two solutions are one: nothing is claimed there, and nothing is the best.
#[test]
fn what_is_not_decided_has_no_best() {
    let folder = Folder::new();
    let out = folder.path("map");
    let pose = ["workspace", "--grid", "1,1,1", "--region=0.96733,11.3833,1.65", "--mass", "10"];
    let further = ["--linear-density", "0.0041929924137", "--out", &out];
    let told = stdout(&cdpr(&[&pose[..], &further].concat()).success());
    assert!(told.contains("1 poses not decided, and in no count above"), "{told}");
    assert!(!told.contains("asks at most"), "{told}");
    let csv = folder.read("map/workspace.csv");
    let row: Row = csv::Reader::from_reader(csv.as_slice()).deserialize().next().unwrap().unwrap();
    assert_eq!((row["status"].as_str(), row["solutions"].as_str()), ("undecided", "3"));
    assert_eq!(row["length_1_m"], "");
}

/// A map is not written over by another one, and not mixed with it.
#[test]
fn another_map_is_left_alone() {
    let folder = Folder::new();
    let out = folder.path("");
    let map = ["workspace", "--grid", "2,2,1", "--region", "1..3,6..8,2", "--out", &out];
    cdpr(&map).success();
    let before = files(&folder);
    let other = [&map[..], &["--mass", "50"]].concat();
    assert_refused(&other, &["--out", "there is a map in it that was ordered otherwise"]);
    let parts = folder.path("parts");
    let mut shard = other.clone();
    shard[6] = &parts;
    cdpr(&[&shard[..], &["--shard", "1/1"]].concat()).success();
    let part = folder.path("parts/part-1-of-1.jsonl");
    assert_refused(&["workspace", "merge", "--out", &out, &part], &["ordered otherwise"]);
    assert!(files(&folder) == before);
    // The same again is no harm.
    cdpr(&map).success();
    assert!(files(&folder) == before);
    // What cannot be of this order is found in a part.
    let text = fs::read_to_string(&part).expect("a part");
    for (from, to) in [("\"rigid\":1,", "\"rigid\":200,"), ("\"proven\"", "\"rigid\"")] {
        assert!(text.contains(from), "{text}");
        let wrong = folder.write("wrong", text.replace(from, to).as_bytes());
        let merged = folder.path("merged");
        assert_refused(&["workspace", "merge", "--out", &merged, &wrong], &["wrong, line 2"]);
    }
}

#[test]
fn two_at_work_on_one_part_do_not_mix() {
    let folder = Folder::new();
    let (out, part) = (folder.path(""), folder.path("part-1-of-1.jsonl"));
    let question = with(&["--out", &out]);
    let mut first = start(&question);
    while lines_of(&part) < 2 {
        assert!(first.try_wait().expect("a child").is_none(), "too fast to be met");
    }
    // Not bad input: the same may work later.
    let refused = cdpr(&question).code(75).stdout("");
    let message = stderr(&refused);
    assert!(message.contains("part-1-of-1.jsonl: another process is at work"), "{message}");
    assert!(first.wait().expect("ended").success());
    assert!(files(&folder) == MAP.files);
}

#[test]
fn every_mistake_is_named() {
    let folder = Folder::new();
    let out = folder.path("map");
    let refused = |arguments: &[&str], parts: &[&str]| {
        let question = [&["workspace", "--out", &out], arguments].concat();
        assert_refused(&question, parts);
        assert_eq!(folder.names(), ["file"], "{arguments:?} left something behind");
    };
    folder.write("file", b"");
    let (grid, region) = (["--grid", "2,2,2"], ["--region", "0..1,0..1,0..1"]);
    let both = [grid, region].concat();
    let with = |further: &[&'static str]| [&both, further].concat();
    refused(&[], &["--grid", "--region"]);
    refused(&grid, &["--region"]);
    refused(&["--grid", "2,2", "--region", "0,0,0"], &["--grid", "2 numbers given, three needed"]);
    refused(&["--grid", "2,x,2", "--region", "0,0,0"], &["'x' is not a number of poses"]);
    refused(&["--grid", "2,0,1", "--region", "0..1,0..1,0"], &["--grid", "along y"]);
    refused(&["--grid", "2,2,1", "--region", "0..1,0..1,0..1"], &["--grid, --region", "along z"]);
    refused(&["--grid", "2,2,2", "--region", "0..1,0..1,0"], &["no extent there", "along z"]);
    refused(&["--grid", "2,2,2", "--region", "0..1,1..0,0"], &["'1..0' does not ascend"]);
    refused(&["--grid", "2000,2000,2000", region[0], region[1]], &["--grid: more than"]);
    refused(&with(&["--rigid-only", "--model", "irvine"]), &["--rigid-only", "--model"]);
    refused(&with(&["--rotation-vector", "0,nan,0"]), &["--rotation-vector"]);
    refused(&with(&["--shard", "4/3"]), &["'4/3' is not a part like 2/8"]);
    refused(&with(&["--position", "1,2,3"]), &["--position"]);
    refused(&with(&["--robot", "nowhere.toml"]), &["nowhere.toml"]);
    let file = folder.path("file");
    assert_refused(&[&["workspace", "--out", &file][..], &both].concat(), &["--out", "file"]);
    let inside = folder.path("file/map");
    assert_refused(&[&["workspace", "--out", &inside][..], &both].concat(), &["--out", "file/map"]);
    // Without a limit of tension the search has no end; rigid cables need none.
    let robot = include_str!("../robots/marionet-crane.toml");
    assert!(robot.contains("max_tension_n = "));
    let limited = |line: &&str| line.starts_with("max_tension_n");
    let endless: Vec<&str> = robot.lines().filter(|line| !limited(line)).collect();
    let endless = endless.join("\n");
    let endless = folder.write("endless.toml", endless.as_bytes());
    let question = [&["workspace", "--out", &out, "--robot", &endless][..], &both].concat();
    assert_refused(&question, &["--max-tension", "cable 1"]);
    cdpr(&[&question[..], &["--rigid-only"]].concat()).success();
}

#[test]
fn a_pose_on_an_anchor_is_passed_over() {
    // Attachment 1 of a level platform is on anchor 1.
    let robot: toml::Table = include_str!("../robots/marionet-crane.toml").parse().expect("TOML");
    let of = |name: &str| -> Vec<f64> {
        let values = robot["cables"][0][name].as_array().expect(name);
        values
            .iter()
            .map(|v| v.as_float().or(v.as_integer().map(|i| i as f64)).expect(name))
            .collect()
    };
    let (a, b) = (of("anchor_m"), of("attachment_m"));
    let [x, y, z]: [f64; 3] = std::array::from_fn(|k| a[k] - b[k]);
    let folder = Folder::new();
    let out = folder.path("map");
    let region = format!("--region={x:?},{}..{y:?},{z:?}", y - 1.0);
    let told = stdout(&cdpr(&["workspace", "--grid", "1,2,1", &region, "--out", &out]).success());
    assert!(told.contains("1 poses with an attachment on its anchor"), "{told}");
    let csv = String::from_utf8(folder.read("map/workspace.csv")).expect("UTF-8");
    let last = csv.lines().last().expect("rows");
    assert!(last.contains(",attachment_on_anchor,"), "{csv}");
}
