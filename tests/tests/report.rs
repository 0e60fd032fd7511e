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
    let of_cables = |name: &str, unit: &str| -> Vec<String> {
        (1..=6).map(|i| format!("{name}_{i}_{unit}")).collect()
    };
    let mut header: Vec<String> =
        ["iz", "iy", "ix", "x_m", "y_m", "z_m", "solutions", "change", "fold_margin"]
            .map(str::to_owned)
            .into();
    header.extend(of_cables("length", "m"));
    header.extend(of_cables("anchor_tension", "n"));
    header.extend(of_cables("attachment_tension", "n"));
    let mut text = header.join(",") + "\n";
    for iz in 0..3 {
        for iy in 0..4 {
            for ix in 0..5 {
                let (x, y, z) = (f64::from(ix), 9.0 + f64::from(iy), 1.0 + 0.5 * f64::from(iz));
                let place = format!("{iz},{iy},{ix},{x},{y},{z}");
                let row = if (ix + iy) % 4 == 3 {
                    format!("{place},0,lost_by_merging,{}\n", ",".repeat(18))
                } else {
                    let number = f64::from(100 * ix + 10 * iy + iz);
                    let change = if ix == 0 { "gained" } else { "" };
                    let solutions = 1 + (ix + iz) % 3;
                    let mut cells = vec![0.001 * (number + 1.0), number + 8.125];
                    cells.extend([7.0; 5]); // lengths
                    cells.extend([number + 3.0, 2.0, 2.0, 2.0, 2.0, 2.0]);
                    cells.extend([2.0, number + 1000.5, 2.0, 2.0, 2.0, 2.0]);
                    let cells: Vec<String> = cells.iter().map(f64::to_string).collect();
                    format!("{place},{solutions},{change},{}\n", cells.join(","))
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

/// Red, green, blue of a CSS colour.
fn rgb(css: &str) -> Vec<f64> {
    let numbers = css.split(|c: char| !c.is_ascii_digit()).filter(|part| !part.is_empty());
    numbers.take(3).map(|part| part.parse().unwrap()).collect()
}

/// Largest difference of two colours in a channel, of 255.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

impl Open {
    /// The colours painted in a square of `size` px with its middle at (`x`, `y`) of a canvas.
    fn colours(&self, id: &str, x: f64, y: f64, size: u32) -> Vec<Vec<f64>> {
        let half = f64::from(size - 1) / 2.0;
        let value = self.browser.value(&format!(
            "[...document.getElementById('{id}').getContext('2d').getImageData({}, {}, {size}, {size}).data]",
            (x - half).floor(),
            (y - half).floor(),
        ));
        let bytes: Vec<f64> = serde_json::from_value(value).unwrap();
        // What is transparent is not painted.
        let painted = bytes.chunks(4).filter(|pixel| pixel[3] > 254.5);
        painted.map(|pixel| pixel[..3].to_vec()).collect()
    }

    /// The middle of a cell of [`GRID`]'s slice across z, px, and the size of the cell. The axes have 58 px on the
    /// left and 44 px below; there are 12 px on the right and above.
    fn cell(&self, ix: u32, iy: u32) -> ([f64; 2], [f64; 2]) {
        let size = self.browser.value(
            "(() => { const c = document.getElementById('slices'); return [c.clientWidth, c.clientHeight]; })()",
        );
        let [width, height] = [0, 1].map(|k| size[k].as_f64().unwrap());
        let [across, upright] = [(width - 58.0 - 12.0) / 5.0, (height - 44.0 - 12.0) / 4.0];
        let x = 58.0 + (f64::from(ix) + 0.5) * across;
        let y = height - 44.0 - (f64::from(iy) + 0.5) * upright;
        ([x, y], [across, upright])
    }

    fn choose_quantity(&self, name: &str) {
        self.browser.run(&format!(
            "const q = document.getElementById('quantity'); \
             q.selectedIndex = [...q.options].findIndex(o => o.text === '{name}'); \
             q.dispatchEvent(new Event('change'))"
        ));
    }
}

/// Each cell has the colour that the legend gives its value: of two that differ in x and y, and whose mirror images
/// have other values.
#[test]
fn a_cell_has_the_colour_of_its_value() {
    let open = Open::new(&with_grid());
    // The counts have a box each: 1 + (1 + 1) % 3 solutions at (1, 0), and 1 + (4 + 1) % 3 at (4, 1).
    let boxes = open.browser.value(
        "[...document.querySelectorAll('#legend > span')].map(e => [e.textContent, e.firstChild.style.background])",
    );
    for (ix, iy, solutions) in [(1, 0, "3"), (0, 1, "2"), (3, 2, "2")] {
        let entry = boxes.as_array().unwrap().iter().find(|entry| entry[0] == solutions).unwrap();
        let ([x, y], _) = open.cell(ix, iy);
        let painted = &open.colours("slices", x, y, 1)[0];
        assert!(apart(painted, &rgb(entry[1].as_str().unwrap())) <= 1.0, "{ix} {iy}: {painted:?}");
    }
    open.choose_quantity("longest rest length");
    let legend = open.browser.text("document.getElementById('legend').textContent");
    assert!(legend.contains("8.125 m") && legend.contains("430.1 m (logarithmic)"), "{legend}");
    let ramp = open.browser.text("document.querySelector('#legend .ramp').style.background");
    let stops: Vec<Vec<f64>> = ramp.split("rgb(").skip(1).map(rgb).collect();
    assert!(stops.len() > 10, "{ramp}");
    for (ix, iy) in [(1, 0), (3, 2), (0, 1)] {
        let value: f64 = f64::from(100 * ix + 10 * iy + 1) + 8.125; // in the slice z = 1.5 m
        let place = (value / 8.125).ln() / (430.125_f64 / 8.125).ln() * (stops.len() - 1) as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 20
        let below = place.floor() as usize;
        let share = place - place.floor();
        let mix = stops[below].iter().zip(&stops[below + 1]).map(|(a, b)| a + share * (b - a));
        let expected: Vec<f64> = mix.collect();
        let ([x, y], _) = open.cell(ix, iy);
        let painted = &open.colours("slices", x, y, 1)[0];
        assert!(apart(painted, &expected) <= 2.0, "{ix} {iy}: {painted:?} {expected:?}");
    }
}

/// Poses where solutions may be missing are hatched whatever is shown, and their readout says so.
#[test]
fn undecided_poses_can_be_seen() {
    let (header, rows) = GRID.split_once('\n').unwrap();
    let status = |row: &str| match row {
        _ if row.starts_with("1,2,3,") => "undecided",
        _ if row.starts_with("1,2,1,") => "rigid_undecided", // no solution found
        _ => "proven",
    };
    let rows = rows.lines().map(|row| format!("{row},{}\n", status(row)));
    let grid = rows.fold(format!("{header},status\n"), |all, row| all + &row);
    let open = Open::new(&html(&five(), Some(&Slices::parse(&grid, "grid.csv").unwrap())));
    let browser = &open.browser;
    open.show("workspace");
    browser.run("document.getElementById('slices').focus({preventScroll: true})");
    // Black and white pixels of a cell, away from its edges and from what is in its middle.
    let stripes = |ix, iy| {
        let ([x, y], [across, upright]) = open.cell(ix, iy);
        let pixels = open.colours("slices", x + across / 4.0, y + upright / 4.0, 12);
        let all = |value: f64| {
            pixels.iter().filter(|p| p.iter().all(|c| (c - value).abs() < 0.5)).count()
        };
        (all(0.0), all(255.0))
    };
    for name in
        ["number of solutions", "longest rest length", "change against rigid cables", "status"]
    {
        open.choose_quantity(name);
        for (ix, iy) in [(3, 2), (1, 2)] {
            let (black, white) = stripes(ix, iy);
            assert!(black > 10 && white > 10, "{name}: {black} {white}");
        }
        assert_eq!(stripes(2, 2).0, 0, "{name}");
        let legend = browser.text("document.getElementById('undecided').textContent");
        assert_eq!(legend, "undecided: there may be more solutions");
    }
    let section = browser.text("document.getElementById('workspace').textContent");
    assert!(section.contains("Undecided at 2 poses"), "{section}");
    open.keep_screenshot("workspace-undecided.png");
    let said = |name: &str| {
        browser.text(&format!(
            "[...document.querySelectorAll('#readout dt')].find(t => t.textContent === '{name}').nextSibling.textContent"
        ))
    };
    // The cursor is at ix 1, iy 2.
    assert_eq!(said("number of solutions"), "at least 0");
    assert_eq!(said("longest rest length"), "undecided");
    browser.press(&[key::RIGHT]);
    assert_eq!(said("number of solutions"), "1");
    browser.press(&[key::RIGHT]);
    assert_eq!(said("number of solutions"), "at least 2");
    assert_eq!(said("longest rest length"), "329.125 m, of those found");
    assert_eq!(said("change against rigid cables"), "undecided");
    // All decided: nothing about it.
    let open = Open::new(&with_grid());
    assert_eq!(open.browser.value("document.getElementById('undecided')"), Value::Null);
}

/// From above, a cable is painted where the projection from a point says, which two anchors determine: a picture
/// that is mirrored or otherwise wrong does not fit the other anchors, or has no cable there.
#[test]
fn cables_are_painted_where_they_are() {
    let request = five();
    let open = Open::new(&html(&request, None));
    let browser = &open.browser;
    browser.run(
        "window.dots = []; const arc = CanvasRenderingContext2D.prototype.arc; \
         CanvasRenderingContext2D.prototype.arc = function (x, y, ...more) { \
           dots.push([x, y]); return arc.call(this, x, y, ...more); }; \
         document.querySelector('[data-view=top]').click()",
    );
    let dots: Vec<[f64; 2]> = serde_json::from_value(browser.value("window.dots")).unwrap();
    let pose = request.pose().unwrap();
    let cables = request.robot.robot.cables();
    let anchors: Vec<[f64; 3]> = cables.iter().map(|cable| cable.anchor_m.into()).collect();
    let ends: Vec<[f64; 3]> = cables
        .iter()
        .map(|cable| (pose.position_m() + pose.turn(&cable.attachment_m)).into())
        .collect();
    assert_eq!(dots.len(), anchors.len() + ends.len());
    let size = browser.value("[picture.clientWidth, picture.clientHeight]");
    let [width, height] = [0, 1].map(|k| size[k].as_f64().unwrap());
    // The field of view is 0.8 rad; x to the right, y upwards.
    let scale = width.min(height) / 2.0 / 0.4_f64.tan();
    let seen = |dot: [f64; 2]| [(dot[0] - width / 2.0) / scale, (height / 2.0 - dot[1]) / scale];
    let far = (1..6).max_by(|i, k| {
        let across = |i: usize| (anchors[i][0] - anchors[0][0]).abs();
        across(*i).total_cmp(&across(*k))
    });
    let (a, b) = (0, far.unwrap());
    let (sa, sb) = (seen(dots[a]), seen(dots[b]));
    // s (eye_z - z) = x - eye_x, at both.
    let eye_z = (anchors[a][0] - anchors[b][0] + sa[0] * anchors[a][2] - sb[0] * anchors[b][2])
        / (sa[0] - sb[0]);
    let eye = [0, 1].map(|k| anchors[a][k] - sa[k] * (eye_z - anchors[a][2]));
    assert!(anchors.iter().all(|anchor| anchor[2] < eye_z), "from below: {eye_z}");
    let place = |p: [f64; 3]| {
        let at = [0, 1].map(|k| scale * (p[k] - eye[k]) / (eye_z - p[2]));
        [width / 2.0 + at[0], height / 2.0 - at[1]]
    };
    for (p, dot) in anchors.iter().chain(&ends).zip(&dots) {
        let expected = place(*p);
        let off = (expected[0] - dot[0]).hypot(expected[1] - dot[1]);
        assert!(off < 0.5, "{p:?}: {dot:?} instead of {expected:?}");
    }
    // Half way from anchor to platform the colour of the key; of the cables that are nearly straight.
    let colours = browser
        .value("[...document.querySelectorAll('#key line')].map(e => getComputedStyle(e).stroke)");
    let slack = request.slack(&answer(&request).solutions[0].solution).unwrap();
    for i in (0..6).filter(|i| !slack[*i]) {
        let (from, to) = (place(anchors[i]), place(ends[i]));
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let [x, y] = [0, 1].map(|k| from[k] + 0.5 * (to[k] - from[k]));
        let expected = rgb(colours[i].as_str().unwrap());
        let painted = open.colours("picture", x, y, 3);
        let least = painted.iter().map(|pixel| apart(pixel, &expected)).fold(255.0, f64::min);
        assert!(least < 24.0, "cable {}: {painted:?}, not {expected:?} ({length} px)", i + 1);
    }
    open.keep_screenshot("top.png");
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
