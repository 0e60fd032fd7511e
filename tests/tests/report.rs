//! The page of `cdpr report` in a browser without a GPU: what it shows, that it asks the network for
//! nothing, and that it can be used by keyboard, in the dark and on a phone.
//!
//! Pictures of it are left in `target/report-screenshots`.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use cdpr_host_sim::branches::{Parameter, Range};
use cdpr_host_sim::cases::Overrides;
use cdpr_host_sim::enumerate::{Enumeration, Method, ModelKind, Options, Request};
use cdpr_host_sim::output;
use cdpr_host_sim::report::{Curves, Slices, page};
use cdpr_host_sim::robot_file::RobotDescription;
use cdpr_tests::browser::{Browser, key};
use serde_json::Value;
use tempfile::TempDir;

/// The rest lengths of the paper's five solutions, the longest of each, and its cable: from the tables of the
/// README and those that the tests of enumeration hold against 50 digits.
const LONGEST_M: [(usize, f64); 5] =
    [(3, 32.881), (3, 108.530), (6, 1942.293), (3, 922.803), (6, 4103.073)];

fn five() -> Request {
    let overrides =
        Overrides { mass_kg: Some(10.0), linear_density_kg_m: Some(0.004), ..Overrides::default() };
    Request {
        robot: overrides.apply(&RobotDescription::marionet_crane()),
        position_m: [0.96733, 11.3833, 1.65],
        rotation_vector_rad: [0.0; 3],
        model: ModelKind::Irvine,
    }
}

fn answer(request: &Request) -> Enumeration {
    request.enumerate(Options { kantorovich: true, ..Options::default() }).unwrap()
}

fn html(request: &Request, workspace: Option<&Slices>) -> String {
    let range = Range::new(0.0004, 0.008).unwrap();
    let curves = Curves::trace(request, Parameter::LinearDensity, range);
    page(request, &answer(request), &curves, workspace).unwrap()
}

/// A grid of 5 x 4 x 3 poses with values that tell where they are.
static GRID: LazyLock<String> = LazyLock::new(|| {
    let mut text = "iz,iy,ix,x_m,y_m,z_m,solutions,change,fold_margin,length_1_m,length_2_m,\
                    anchor_tension_1_n,attachment_tension_2_n\n"
        .to_owned();
    for iz in 0..3 {
        for iy in 0..4 {
            for ix in 0..5 {
                let (x, y, z) = (f64::from(ix), 9.0 + f64::from(iy), 1.0 + 0.5 * f64::from(iz));
                let place = format!("{iz},{iy},{ix},{x},{y},{z}");
                let row = if (ix + iy) % 4 == 3 {
                    format!("{place},0,lost_by_merging,,,,,\n")
                } else {
                    let number = f64::from(100 * ix + 10 * iy + iz);
                    let change = if ix == 0 { "gained" } else { "" };
                    format!(
                        "{place},{},{change},{},{},7,{},{}\n",
                        1 + (ix + iz) % 3,
                        0.001 * (number + 1.0),
                        number + 8.125,
                        number + 3.0,
                        number + 1000.5,
                    )
                };
                text.push_str(&row);
            }
        }
    }
    text
});

fn with_grid() -> String {
    html(&five(), Some(&Slices::parse(&GRID, "grid.csv").unwrap()))
}

/// A page on disk, open in a browser.
struct Open {
    browser: Browser,
    _folder: TempDir,
    path: PathBuf,
}

impl Open {
    fn new(html: &str) -> Self {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("report.html");
        fs::write(&path, html).unwrap();
        let browser = Browser::start();
        browser.prefer_dark(false);
        browser.resize(1200, 900, false);
        browser.open(&path);
        Self { browser, _folder: folder, path }
    }

    /// The pixels of a canvas.
    fn pixels(&self, id: &str) -> String {
        self.browser.text(&format!("document.getElementById('{id}').toDataURL()"))
    }

    fn keep_screenshot(&self, name: &str) {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("../report-screenshots");
        fs::create_dir_all(&folder).unwrap();
        let png = BASE64_STANDARD.decode(self.browser.screenshot()).unwrap();
        fs::write(folder.join(name), png).unwrap();
    }

    /// Brings an element to the top of the window.
    fn show(&self, id: &str) {
        self.browser.run(&format!(
            "document.getElementById('{id}').scrollIntoView({{behavior:'instant'}})"
        ));
    }

    /// Nothing was complained about, and nothing but the page itself was asked for.
    fn assert_quiet(&self) {
        let console = self.browser.log("browser");
        assert!(console.is_empty(), "{console:?}");
        let mut requested = Vec::new();
        for entry in self.browser.log("performance") {
            let event: Value = serde_json::from_str(entry["message"].as_str().unwrap()).unwrap();
            if event["message"]["method"] == "Network.requestWillBeSent" {
                requested.push(
                    event["message"]["params"]["request"]["url"].as_str().unwrap().to_owned(),
                );
            }
        }
        let own = format!("file://{}", self.path.display());
        assert!(requested.contains(&own), "{requested:?}");
        requested.retain(|url| *url != own && !url.starts_with("data:"));
        assert!(requested.is_empty(), "{requested:?}");
    }
}

/// The cells of the chosen solution's table as numbers, row by row; text is null.
const CHOSEN_TABLE: &str = "[...document.querySelectorAll('.solution.chosen table.cables tbody tr')]\
    .map(row => [...row.cells].map(cell => Number(cell.textContent)))";

#[test]
fn the_page_shows_the_numbers_of_enumerate() {
    let request = five();
    let open = Open::new(&html(&request, None));
    let document = output::json(&request, Method::Both, &answer(&request));
    let document = serde_json::to_value(&document).unwrap();
    let solutions = document["solutions"].as_array().unwrap();
    assert_eq!(solutions.len(), LONGEST_M.len());
    for (number, (solution, (cable, longest_m))) in (1..).zip(solutions.iter().zip(LONGEST_M)) {
        open.browser.run(&format!("document.querySelector('input[value=\"{number}\"]').click()"));
        let table = open.browser.value(CHOSEN_TABLE);
        let rows = table.as_array().unwrap();
        assert_eq!(rows.len(), 6, "solution {number}");
        for (i, row) in rows.iter().enumerate() {
            let shown = |column: usize| row[column].as_f64().unwrap();
            let expected = |field: &str| solution[field][i].as_f64().unwrap();
            let same = |shown: f64, expected: f64| {
                (shown - expected).abs() <= 1e-5 * expected.abs() + 1e-9
            };
            assert!((shown(1) - expected("lengths_m")).abs() < 1e-6);
            assert!(same(shown(2), expected("anchor_tensions_n")), "{row}");
            let at_b = expected("horizontal_forces_n").hypot(expected("vertical_forces_n"));
            assert!(same(shown(3), at_b), "{row}");
            assert!(same(shown(4), expected("sags_m")), "{row}");
        }
        let said = open.browser.text("document.getElementById('shown').textContent");
        assert!(said.contains(&format!("longest is cable {cable}, {longest_m:.3} m")), "{said}");
    }
    let verdict = open.browser.text("document.querySelector('.verdict').textContent");
    assert!(verdict.contains("5 solutions, proven: each exists, and there are no others"));
    let proof = open.browser.text("document.getElementById('proof').textContent");
    let boxes = document["search"]["boxes"].as_u64().unwrap();
    assert!(proof.contains(&format!("{boxes} boxes")), "{proof}");
    // The fold of the paper, in the diagram.
    let diagram = open.browser.text("document.querySelector('#branches svg').textContent");
    assert!(diagram.contains("fold at 0.0041929924 kg/m"), "{diagram}");
    open.assert_quiet();
    open.keep_screenshot("desktop-light-solution-5.png");
}

#[test]
fn solutions_and_view_change_by_keyboard() {
    let open = Open::new(&html(&five(), None));
    let browser = &open.browser;
    let chosen = || browser.value("document.querySelector('input[name=solution]:checked').value");
    let focus = "document.activeElement.name || document.activeElement.id";
    let until = |name: &str| {
        for _ in 0..30 {
            browser.press(&[key::TAB]);
            if browser.value(focus) == name {
                return;
            }
        }
        panic!("{name} is not reached with Tab");
    };
    until("solution");
    assert_eq!(chosen(), "1");
    open.keep_screenshot("desktop-light.png");
    let mut pictures = vec![open.pixels("picture")];
    for expected in ["2", "3", "4", "5", "all"] {
        browser.press(&[key::RIGHT]);
        assert_eq!(chosen(), expected);
        pictures.push(open.pixels("picture"));
        let tables = browser.value("document.querySelectorAll('.solution.chosen').length");
        assert_eq!(tables, if expected == "all" { 5 } else { 1 });
        if expected == "2" {
            open.keep_screenshot("desktop-light-solution-2.png");
        }
    }
    open.keep_screenshot("desktop-light-all.png");
    // Focus can be seen.
    let outline = browser
        .text("getComputedStyle(document.querySelector('input[value=all] + span')).outlineStyle");
    assert_eq!(outline, "solid");
    until("picture");
    for key in [key::LEFT, key::UP, '+', '+', 'f'] {
        browser.press(&[key]);
        pictures.push(open.pixels("picture"));
    }
    open.keep_screenshot("desktop-light-fit-all.png");
    let last = pictures.clone();
    pictures.sort();
    pictures.dedup();
    assert_eq!(pictures.len(), last.len(), "two pictures are the same");
    // Back to where it was.
    browser.press(&['0']);
    assert_eq!(open.pixels("picture"), last[5]);
    open.assert_quiet();
}

/// At the fold of solutions 1 and 2, where one of the two is found and not proven.
#[test]
fn a_solution_that_is_not_proven_is_shown_as_such() {
    let mut request = five();
    let overrides =
        Overrides { linear_density_kg_m: Some(0.004_192_992_413_7), ..Overrides::default() };
    request.robot = overrides.apply(&request.robot);
    let open = Open::new(&html(&request, None));
    let browser = &open.browser;
    let said = || browser.text("document.getElementById('shown').textContent");
    let heading = || browser.text("document.querySelector('.solution.chosen h3').textContent");
    assert!(said().starts_with("Solution 2 of 4: longest is"), "{}", said());
    assert!(heading().starts_with("Solution 2 ") && !heading().contains("proven"), "{}", heading());
    browser.run("document.querySelector('input[value=\"1\"]').click()");
    assert!(said().starts_with("Solution 1 of 4, not proven to exist: "), "{}", said());
    assert!(heading().starts_with("Solution 1, not proven to exist"), "{}", heading());
    let least = browser.value(LEAST_CONTRAST);
    assert!(least[0].as_f64().unwrap() >= 4.5, "{least}");
    open.keep_screenshot("not-proven.png");
    browser.run("document.querySelector('input[value=all]').click()");
    let key = browser.text("document.getElementById('key').textContent");
    assert!(key.contains("solution 1, not proven to existsolution 2solution 3"), "{key}");
    open.assert_quiet();
}

/// `background, ink` of the page as they are painted.
const COLOURS: &str =
    "(() => { const s = getComputedStyle(document.body); return [s.backgroundColor, s.color]; })()";

#[test]
fn dark_and_light_differ_and_can_be_chosen() {
    let open = Open::new(&html(&five(), None));
    let browser = &open.browser;
    let (light, light_picture) = (browser.value(COLOURS), open.pixels("picture"));
    browser.prefer_dark(true);
    let (dark, dark_picture) = (browser.value(COLOURS), open.pixels("picture"));
    assert_ne!(light[0], dark[0]);
    assert_ne!(light[1], dark[1]);
    assert_ne!(light_picture, dark_picture);
    open.keep_screenshot("desktop-dark.png");
    open.show("branches");
    open.keep_screenshot("desktop-dark-branches.png");
    browser.run("document.getElementById('theme').click()");
    assert_eq!(browser.value(COLOURS), light);
    open.assert_quiet();
}

/// Contrast of text as WCAG 2 defines it, over the elements that have text of their own: the least, and
/// where. The diagram has colours of its own.
const LEAST_CONTRAST: &str = r"(() => {
  const light = (rgb) => rgb.map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
  const parse = (text) => (text.match(/[\d.]+/g) || []).map(Number);
  const ground = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const c = parse(getComputedStyle(e).backgroundColor);
      if (c.length === 3 || c[3] === 1) return c.slice(0, 3);
    }
    return [255, 255, 255];
  };
  let least = [99, ''];
  for (const element of document.body.querySelectorAll('*')) {
    const own = [...element.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || element.closest('svg, script, noscript') || !element.getClientRects().length) continue;
    const [a, b] = [light(parse(getComputedStyle(element).color).slice(0, 3)), light(ground(element))];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < least[0]) least = [contrast, element.tagName + ' ' + element.textContent.slice(0, 60)];
  }
  return least;
})()";

#[test]
fn text_has_contrast_in_both_themes() {
    let open = Open::new(&with_grid());
    for dark in [false, true] {
        open.browser.prefer_dark(dark);
        let least = open.browser.value(LEAST_CONTRAST);
        assert!(least[0].as_f64().unwrap() >= 4.5, "dark {dark}: {least}");
    }
}

#[test]
fn a_phone_needs_no_sideways_scrolling() {
    let open = Open::new(&with_grid());
    let browser = &open.browser;
    for (name, dark) in [("phone-light", false), ("phone-dark", true)] {
        browser.prefer_dark(dark);
        browser.resize(360, 740, true);
        browser.open(&open.path);
        let width = browser.value("[innerWidth, document.documentElement.scrollWidth]");
        assert_eq!(width.to_string(), "[360,360]");
        // Not because it is cut off: what is wider scrolls in a box of its own.
        let wide = browser.value(
            "[...document.querySelectorAll('main *')].filter(e => !e.closest('.scroll, option') && \
             e.getBoundingClientRect().right > 361).map(e => e.outerHTML.slice(0, 80))",
        );
        assert_eq!(wide.to_string(), "[]");
        open.keep_screenshot(&format!("{name}.png"));
        open.show("answer");
        open.keep_screenshot(&format!("{name}-table.png"));
        open.show("workspace");
        open.keep_screenshot(&format!("{name}-workspace.png"));
    }
    open.assert_quiet();
}

#[test]
fn the_workspace_is_shown_slice_by_slice() {
    let open = Open::new(&with_grid());
    let browser = &open.browser;
    open.show("workspace");
    let read = || -> std::collections::BTreeMap<String, String> {
        let value = browser.value(
            "Object.fromEntries([...document.querySelectorAll('#readout dt')].map(t => [t.textContent, t.nextSibling.textContent]))",
        );
        serde_json::from_value(value).unwrap()
    };
    // The grid point next to the pose of the report: x 1, y 11, z 1.5.
    let readout = read();
    assert_eq!(readout["pose"], "x 1, y 11, z 1.5 m");
    assert_eq!(readout["number of solutions"], "0");
    assert_eq!(readout["longest rest length"], "no value");
    assert_eq!(readout["change against rigid cables"], "lost by merging");
    assert_eq!(browser.value("document.getElementById('slice').max"), "2");
    open.keep_screenshot("workspace-light.png");

    // By keyboard, to x 3, y 12 and then to the next slice; against the rows of the file.
    browser.run("document.getElementById('slices').focus({preventScroll: true})");
    let before = open.pixels("slices");
    browser.press(&[key::RIGHT, key::RIGHT, key::UP]);
    assert_ne!(open.pixels("slices"), before);
    let assert_same_as_file = |x: f64, y: f64, z: f64| {
        let readout = read();
        assert_eq!(readout["pose"], format!("x {x}, y {y}, z {z} m"));
        let mut table = csv::Reader::from_reader(GRID.as_bytes());
        let header = table.headers().unwrap().clone();
        let row = table
            .records()
            .map(Result::unwrap)
            .find(|row| [x, y, z].map(|c| c.to_string()) == [3, 4, 5].map(|k| row[k].to_owned()))
            .unwrap();
        let cell = |name: &str| &row[header.iter().position(|column| column == name).unwrap()];
        let number = |text: &str| text.split(' ').next().unwrap().parse::<f64>().unwrap();
        assert_eq!(readout["number of solutions"], cell("solutions"));
        let largest = number(cell("length_1_m")).max(number(cell("length_2_m")));
        assert!((number(&readout["longest rest length"]) / largest - 1.0).abs() < 1e-5);
        let tension = number(cell("attachment_tension_2_n"));
        assert!((number(&readout["highest tension"]) / tension - 1.0).abs() < 1e-5);
        let margin = number(cell("fold_margin"));
        assert!((number(&readout["margin to a fold, 1/condition"]) / margin - 1.0).abs() < 1e-5);
    };
    assert_same_as_file(3.0, 12.0, 1.5);

    // The slider, and another quantity.
    let middle = open.pixels("slices");
    browser.run(
        "const s = document.getElementById('slice'); s.value = 2; s.dispatchEvent(new Event('input'))",
    );
    assert_ne!(open.pixels("slices"), middle);
    assert_same_as_file(3.0, 12.0, 2.0);
    let solutions = open.pixels("slices");
    browser.run(
        "const q = document.getElementById('quantity'); q.selectedIndex = 1; q.dispatchEvent(new Event('change'))",
    );
    assert_ne!(open.pixels("slices"), solutions);
    let legend = browser.text("document.getElementById('legend').textContent");
    assert!(legend.contains("8.125 m") && legend.contains("no value"), "{legend}");

    // By mouse: the middle of the leftmost cell of the lowest row.
    let place = browser.value(
        "(() => { const r = document.getElementById('slices').getBoundingClientRect(); return [r.left, r.bottom]; })()",
    );
    #[allow(clippy::cast_possible_truncation)] // px
    let px = |k: usize, offset: f64| (place[k].as_f64().unwrap() + offset) as i64;
    browser.point_at(px(0, 58.0 + 20.0), px(1, -44.0 - 20.0));
    assert_same_as_file(0.0, 9.0, 2.0);
    browser.prefer_dark(true);
    open.keep_screenshot("workspace-dark.png");
    browser.run(
        "const a = document.getElementById('axis'); a.value = 0; a.dispatchEvent(new Event('change'))",
    );
    assert_eq!(browser.value("document.getElementById('slice').max"), "4");
    open.assert_quiet();
}

#[test]
fn names_are_only_text() {
    let hostile =
        "</script><script>document.title = 'owned'</script><img src=x onerror=alert(1)> & \"'";
    let mut request = five();
    request.robot.name = hostile.to_owned();
    let grid = GRID.replacen("gained", "\"</script><script>document.title='owned'</script>\"", 1);
    let workspace = Slices::parse(&grid, "grid.csv").unwrap();
    let open = Open::new(&html(&request, Some(&workspace)));
    let title = open.browser.text("document.title");
    assert!(title.starts_with(hostile), "{title}");
    assert_eq!(open.browser.text("document.querySelector('h1').textContent"), hostile);
    assert_eq!(open.browser.value("document.querySelectorAll('script').length"), 2);
    assert_eq!(open.browser.value("document.images.length"), 0);
    open.assert_quiet();
}

/// Without a script the tables are all there, and what needs one is not.
#[test]
fn without_scripts_the_tables_are_there() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("report.html");
    fs::write(&path, html(&five(), None)).unwrap();
    let browser = Browser::start();
    browser.prefer_dark(true);
    browser.devtools("Emulation.setScriptExecutionDisabled", &serde_json::json!({ "value": true }));
    browser.open(&path);
    browser
        .devtools("Emulation.setScriptExecutionDisabled", &serde_json::json!({ "value": false }));
    let seen = |selector: &str| {
        browser.value(&format!(
            "[...document.querySelectorAll('{selector}')].filter(e => e.getClientRects().length).length"
        ))
    };
    assert_eq!(seen("table.cables"), 5);
    assert_eq!(seen("#branches svg"), 1);
    assert_eq!(seen("canvas, fieldset, button"), 0);
    assert_eq!(seen("noscript"), 1);
    let colours = browser.value(COLOURS);
    assert_ne!(colours[0], "rgb(255, 255, 255)", "it is not dark");
}

#[test]
fn on_paper_all_solutions_are_listed() {
    let open = Open::new(&html(&five(), None));
    let light = open.browser.value(COLOURS);
    open.browser.run("document.getElementById('theme').click()");
    assert_ne!(open.browser.value(COLOURS), light);
    open.browser.devtools("Emulation.setEmulatedMedia", &serde_json::json!({ "media": "print" }));
    assert_eq!(open.browser.value(COLOURS), light, "dark on paper");
    let seen = "[...document.querySelectorAll('table.cables')].filter(e => e.getClientRects().length).length";
    assert_eq!(open.browser.value(seen), 5);
    let buttons = "[...document.querySelectorAll('button, fieldset, nav')].filter(e => e.getClientRects().length).length";
    assert_eq!(open.browser.value(buttons), 0);
}
