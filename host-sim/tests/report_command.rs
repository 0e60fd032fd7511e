//! `cdpr report` and `cdpr enumerate --shapes` as a person or a script meets them. What the page does in a
//! browser is tested in `tests/tests/report.rs`.

mod common;

use std::fs;

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use common::{CDPR, Folder, stderr, stdout};

const POSE: [&str; 2] = ["--position", "4,7,2"];

fn cdpr_at_pose(folder: &Folder, arguments: &[&str]) -> Assert {
    Command::new(CDPR).current_dir(folder.0.path()).args(arguments).args(POSE).assert()
}

/// The page that `cdpr report` makes.
fn page(folder: &Folder, further: &[&str]) -> String {
    cdpr_at_pose(folder, &[&["report", "--out", "page.html"], further].concat()).success();
    String::from_utf8(folder.read("page.html")).expect("UTF-8")
}

/// What is said about bad input; nothing is written, and there is no page.
fn refusal(folder: &Folder, arguments: &[&str]) -> String {
    let arguments = [&["report", "--out", "page.html"], arguments].concat();
    let assert = cdpr_at_pose(folder, &arguments).code(2).stdout("");
    assert!(!folder.names().contains(&"page.html".to_owned()));
    stderr(&assert)
}

#[test]
fn the_page_is_the_same_every_time_and_says_what_was_made() {
    let folder = Folder::new();
    let first = page(&folder, &[]);
    let assert = cdpr_at_pose(&folder, &["report", "--out", "page.html"]).success();
    assert_eq!(fs::read_to_string(folder.path("page.html")).unwrap(), first);
    let said = stdout(&assert);
    assert!(said.starts_with("page.html: 1 solution, ") && said.ends_with(" kB\n"), "{said}");
    // Cable 4 has 165.25 m, from slack set [4].
    assert!(first.contains("slack when rigid: [4]") && first.contains(">165.2"));
    assert!(
        first.contains("1 solution, proven: it exists, and there is no other within the limits.")
    );
    // A tenth of the density to twice of it.
    assert!(first.contains("over the linear density of the cables, 0.0079"), "no diagram");
    assert!(first.contains("<svg") && first.contains("branches of solutions"));
}

/// Nothing in the page is an address on the network, but for the names of XML.
#[test]
fn the_page_names_no_address() {
    let page = page(&Folder::new(), &[]);
    let addresses = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!addresses.contains("http:") && !addresses.contains("https:"));
    assert!(!addresses.contains("@import") && !addresses.contains("url("));
    for attribute in addresses.split(" src=").skip(1).chain(addresses.split(" href=").skip(1)) {
        assert!(attribute.starts_with("\"#") || attribute.starts_with("\"data:,\""), "{attribute}");
    }
}

#[test]
fn parameter_and_range_can_be_chosen() {
    let folder = Folder::new();
    let page = page(&folder, &["--parameter", "mass", "--from", "50", "--to", "90"]);
    assert!(page.contains("over the mass of the platform, 50 to 90 kg"));
    let refused = cdpr_at_pose(&folder, &["report", "--out", "other.html", "--from", "3"]).code(2);
    let said = stderr(&refused);
    assert!(said.contains("--parameter, --from, --to: 3 to 0.158"), "{said}");
}

#[test]
fn a_page_without_a_diagram_says_why() {
    let page = page(&Folder::new(), &["--model", "rigid"]);
    assert!(page.contains("There is no diagram over the mass of the platform"), "no reason");
    assert!(page.contains("rigid cables are solved by linear algebra, without a proof"));
    assert!(!page.contains("<svg xmlns"));
}

#[test]
fn a_pose_without_solutions_is_an_answer() {
    let folder = Folder::new();
    let report = ["report", "--out", "page.html", "--position", "0,0,2"];
    Command::new(CDPR).current_dir(folder.0.path()).args(report).assert().success();
    let page = fs::read_to_string(folder.path("page.html")).unwrap();
    assert!(page.contains("There is no solution within the limits, proven."));
}

/// The page about the pose of the paper, at the fold of its solutions 1 and 2, where one of the two is found and
/// nothing is decided about them.
fn page_at_fold(folder: &Folder) -> String {
    let fold = ["report", "--out", "fold.html", "--position", "0.96733,11.3833,1.65"];
    let fold = [&fold[..], &["--mass", "10", "--linear-density", "0.0041929924137"]].concat();
    Command::new(CDPR).current_dir(folder.0.path()).args(fold).assert().success();
    fs::read_to_string(folder.path("fold.html")).unwrap()
}

#[test]
fn a_solution_that_is_not_proven_is_not_offered_as_one() {
    let page = page_at_fold(&Folder::new());
    let verdict = "3 solutions proven, 1 not proven to exist; in some places it is undecided whether \
                   there are others.";
    assert!(page.contains(verdict), "verdict");
    let checked: Vec<&str> = page.split("<input ").filter(|i| i.contains(" checked>")).collect();
    assert_eq!(checked.len(), 1);
    assert!(checked[0].contains(r#"value="2""#), "{}", checked[0]);
    let button = page.split(r#"name="solution" value="1""#).nth(1).unwrap();
    let button = button.split("</label>").next().unwrap();
    assert!(button.contains("not proven to exist"), "{button}");
    let headings: Vec<bool> = page
        .split("<h3>Solution ")
        .skip(1)
        .map(|text| text.split("</h3>").next().unwrap().contains("not proven to exist"))
        .collect();
    assert_eq!(headings, [true, false, false, false]);
}

#[test]
fn nothing_found_is_not_nothing_there() {
    let folder = Folder::new();
    // Beside all anchors, and no search.
    let none = ["report", "--out", "none.html", "--position", "0,0,2", "--model", "rigid"];
    Command::new(CDPR).current_dir(folder.0.path()).args(none).assert().success();
    let page = fs::read_to_string(folder.path("none.html")).unwrap();
    assert!(page.contains("No solution found, and it is not proven that there is none."), "none");
}

/// A slack cable without weight exerts no force: it is not the limits that keep the degrees apart.
#[test]
fn degrees_of_cables_without_weight_need_not_agree() {
    let folder = Folder::new();
    let reason = "cables without weight exert no force when they are slack";
    let elastic = page(&folder, &["--model", "elastic"]);
    assert!(elastic.contains(reason) && !elastic.contains("beyond the limits"), "elastic");
    let text = stdout(&cdpr_at_pose(&folder, &["enumerate", "--model", "elastic"]).success());
    assert!(text.contains(reason) && !text.contains("beyond the limits"), "{text}");
    let text = stdout(&cdpr_at_pose(&folder, &["enumerate", "--max-length", "100"]).success());
    assert!(text.contains("The degrees differ: solutions lie beyond the limits"), "{text}");
}

/// The shapes of slack cables are those of the model, which are true only for the catenary.
#[test]
fn shapes_that_are_schematic_are_said_to_be() {
    let folder = Folder::new();
    assert!(page(&folder, &[]).contains("True shapes."), "irvine");
    for model in ["rigid", "parabolic"] {
        let page = page(&folder, &["--model", model]);
        assert!(page.contains("Schematic for slack cables, which"), "{model}");
        assert!(!page.contains("True shapes"), "{model}");
    }
}

#[test]
fn limits_that_are_near_are_named() {
    let page = page(&Folder::new(), &["--max-length", "170"]);
    assert!(page.contains("Near a limit: length of cable 4, 97 % of 170 m."), "not near");
}

#[test]
fn bad_input_is_refused_by_name() {
    let folder = Folder::new();
    let said = refusal(&folder, &["--workspace", "nowhere"]);
    assert!(said.contains("nowhere/workspace.csv: No such file"), "{said}");
    fs::create_dir(folder.path("grid")).unwrap();
    fs::write(folder.path("grid/workspace.csv"), "ix,iy,iz,x_m,y_m,z_m,solutions\n0,0,0,1,2,?,1\n")
        .unwrap();
    let said = refusal(&folder, &["--workspace", "grid"]);
    assert!(said.contains("grid/workspace.csv:2: z_m: '?' is not a number"), "{said}");
    let said = refusal(&folder, &["--robot", "robot.toml"]);
    assert!(said.contains("robot.toml: No such file"), "{said}");
    fs::create_dir(folder.path("there")).unwrap();
    let said = cdpr_at_pose(&folder, &["report", "--out", "there"]).code(2);
    let said = stderr(&said);
    assert!(said.contains("--out there: it is there already, and is no file"), "{said}");
    let refused = cdpr_at_pose(&folder, &["report", "--out", "-"]).code(2).stdout("");
    let said = stderr(&refused);
    assert!(said.contains("--out -: a page is a file"), "{said}");
    assert!(!folder.names().contains(&"-".to_owned()));
}

#[test]
fn shapes_are_written_for_each_solution() {
    let folder = Folder::new();
    cdpr_at_pose(&folder, &["enumerate", "--shapes", "a/b"]).success();
    let mut names: Vec<_> = fs::read_dir(folder.path("a/b"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["solution-1.csv", "solution-1.vtp"]);
    let mut table = csv::Reader::from_path(folder.path("a/b/solution-1.csv")).unwrap();
    let rows: Vec<[f64; 6]> = table.deserialize().map(Result::unwrap).collect();
    // Cable 4 from its anchor, whose place the robot file has.
    let fourth: Vec<_> = rows.iter().filter(|row| (3.5..4.5).contains(&row[0])).collect();
    assert_eq!(fourth[0][1..5], [0.0, 5.570, 20.414, 8.704]);
    let length_m = fourth[fourth.len() - 1][1];
    assert!((length_m - 165.25).abs() < 0.01, "{length_m}");
    let picture = fs::read_to_string(folder.path("a/b/solution-1.vtp")).unwrap();
    roxmltree::Document::parse(&picture).unwrap();

    // What is left from another answer is not mixed with this one.
    let refused = cdpr_at_pose(&folder, &["enumerate", "--shapes", "a/b"]).code(2);
    let said = stderr(&refused);
    assert!(said.contains("--shapes a/b/solution-1.csv: there from another answer"), "{said}");
    assert!(refused.get_output().stdout.is_empty());
}

/// What `cdpr workspace` writes, slice by slice; what the page does with it is tested in a browser.
#[test]
fn a_map_of_the_workspace_is_shown() {
    let folder = Folder::new();
    let map = ["workspace", "--grid", "3,4,2", "--region", "0..4,4..10,1..2", "--out", "map"];
    Command::new(CDPR).current_dir(folder.0.path()).args(map).assert().success();
    let page = page(&folder, &["--workspace", "map"]);
    let grid = "A grid of 3 \u{d7} 4 \u{d7} 2 poses; lengths, tensions and margins of the solution";
    assert!(page.contains(grid), "no grid");
    assert!(!page.contains("something else"), "the same robot");
    assert!(page.contains(r#""axes":[[0.0,2.0,4.0],[4.0,6.0,8.0,10.0],[1.0,2.0]]"#), "no axes");
    for key in ["solutions", "longest_length", "highest_tension", "fold_margin", "status", "degree"]
    {
        assert!(page.contains(&format!(r#"{{"key":"{key}","#)), "no {key}");
    }
    let rigid = [&map[..], &["--rigid-only"]].concat();
    let rigid: Vec<_> =
        rigid.iter().map(|word| if *word == "map" { "rigid" } else { word }).collect();
    Command::new(CDPR).current_dir(folder.0.path()).args(rigid).assert().success();
    let page = rigid_page(&folder);
    assert!(page.contains(r#"{"key":"rigid_solutions","#), "no rigid solutions");
    assert!(page.contains("something else than this report: cable model differs."), "other cables");
    let further = ["--workspace", "map", "--mass", "60", "--linear-density", "0.08"];
    let page = crate::page(&folder, &further);
    let said = "something else than this report: load, linear density differ.";
    assert!(page.contains(said), "another mass");
    // A table beside the order of another grid.
    let table = fs::read_to_string(folder.path("map/workspace.csv")).unwrap();
    fs::copy(folder.path("map/workspace.json"), folder.path("rigid/workspace.json")).unwrap();
    for (other, difference) in [
        (table.replace(",10.0,", ",11.0,"), "y 11 m instead of 10 m"),
        (
            table
                .lines()
                .filter(|row| !row.starts_with("2,"))
                .fold(String::new(), |all, row| all + row + "\n"),
            "[2, 4, 2] poses along x, y, z instead of [3, 4, 2]",
        ),
    ] {
        fs::write(folder.path("rigid/workspace.csv"), other).unwrap();
        fs::remove_file(folder.path("page.html")).unwrap();
        let said = refusal(&folder, &["--workspace", "rigid"]);
        let files = "rigid/workspace.csv and rigid/workspace.json are of different runs: ";
        assert!(said.contains(&format!("{files}{difference}")), "{said}");
        fs::write(folder.path("page.html"), "").unwrap();
    }
    fs::write(folder.path("map/workspace.json"), "{\n\"order\": 1}").unwrap();
    let said = refusal_of_map(&folder);
    assert!(said.contains("map/workspace.json:2: order: "), "{said}");
    fs::remove_file(folder.path("map/workspace.json")).unwrap();
    let page = crate::page(&folder, &["--workspace", "map"]);
    assert!(page.contains("What the map is of is not known"), "no word of it");
}

fn refusal_of_map(folder: &Folder) -> String {
    fs::remove_file(folder.path("page.html")).unwrap();
    refusal(folder, &["--workspace", "map"])
}

fn rigid_page(folder: &Folder) -> String {
    page(folder, &["--workspace", "rigid"])
}
