//! All about one pose on one page for a browser: the robot with its cables in 3-D, tables, proofs, the
//! diagram of branches, and slices of the workspace.
//!
//! The page is one file that asks the network for nothing. Everything that can be read is in its HTML;
//! the script draws the two canvases and hides what is not chosen.

mod slices;
mod tables;

pub use slices::{Slices, SlicesError};

use cdpr_core::{CABLES, GeometryFault};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde::Serialize;

use crate::branches::{Diagram, Parameter, Range};
use crate::enumerate::{Enumeration, ModelKind, Request};
use crate::output::{self, counted, heading, plain};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Nothing may be loaded, not even by mistake.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";

/// Places of the cables are given to a tenth of a millimetre.
const PER_METRE: f64 = 1e4;

/// The diagram of branches as the page shows it, or why there is none.
#[derive(Clone, Debug)]
pub struct Curves {
    parameter: Parameter,
    range: Range,
    drawn: Result<Drawn, String>,
}

#[derive(Clone, Debug)]
struct Drawn {
    svg: String,
    text: String,
}

impl Curves {
    /// Follows the solutions of `request` over a range of a parameter. If that fails the page says why.
    #[must_use]
    pub fn trace(request: &Request, parameter: Parameter, range: Range) -> Self {
        let drawn = Diagram::trace(request, parameter, range)
            .map_err(|fault| fault.to_string())
            .and_then(|diagram| {
                let svg = output::diagram::svg(request, &diagram).map_err(|f| f.to_string())?;
                Ok(Drawn { svg, text: output::diagram::text(request, &diagram) })
            });
        Self { parameter, range, drawn }
    }
}

/// The page (HTML) about `answer` to `request`; the same bytes for the same input.
///
/// # Errors
/// As [`Request::check`].
pub fn page(
    request: &Request,
    answer: &Enumeration,
    curves: &Curves,
    workspace: Option<&Slices>,
) -> Result<String, GeometryFault> {
    let data = Data::of(request, answer, workspace)?;
    let cables: Vec<_> = data.solutions.iter().map(|solution| &solution.cables).collect();
    let slack: Vec<[bool; CABLES]> =
        cables.iter().map(|cables| std::array::from_fn(|i| cables[i].slack)).collect();
    let question = heading(request, None);
    let (pose, cables) = question.trim_end().split_once('\n').unwrap_or((&question, ""));
    let name = &request.robot.name;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                link rel="icon" href="data:,";
                title { (pose) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                a.skip href="#answer" { "Skip to the answer" }
                header {
                    div.bar {
                        h1 { (name) }
                        button #theme type="button" hidden { "Dark" }
                    }
                    p { (pose.strip_prefix(name.as_str()).unwrap_or(pose).trim_start()) br; (cables) }
                    (tables::verdict(request, answer))
                    nav aria-label="Parts of this page" {
                        a href="#robot" { "Robot" } " "
                        a href="#answer" { "Lengths and tensions" } " "
                        a href="#proof" { "Proof" } " "
                        a href="#branches" { "Branches" } " "
                        @if workspace.is_some() { a href="#workspace" { "Workspace" } }
                    }
                }
                main {
                    (robot_section(request, answer, &slack))
                    (tables::answer_section(request, answer, &slack))
                    (tables::proof_section(request, answer))
                    (branches_section(curves))
                    @if let Some(workspace) = workspace { (workspace_section(request, workspace)) }
                }
                footer { p { "Made by cdpr " (env!("CARGO_PKG_VERSION")) "." } }
                script type="application/json" #data { (PreEscaped(inert(&data))) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    Ok(page.into_string())
}

/// JSON that cannot end the element it is in, whatever the names are.
fn inert(data: &impl Serialize) -> String {
    let text = serde_json::to_string(data).unwrap_or_else(|_| "null".to_owned());
    text.replace('<', "\\u003c")
}

fn robot_section(request: &Request, answer: &Enumeration, slack: &[[bool; CABLES]]) -> Markup {
    let first = tables::first_shown(answer);
    html! {
        section #robot aria-labelledby="robot-title" {
            h2 #robot-title { "The robot" }
            noscript { p.note { "The picture needs JavaScript; the tables below do not." } }
            @if !answer.solutions.is_empty() {
                fieldset #chooser.needs-script {
                    legend { "Solution" }
                    @for (number, found) in (1..).zip(&answer.solutions) {
                        label.pill {
                            input type="radio" name="solution" value=(number) checked[number == first];
                            span {
                                (number)
                                @if let Some(doubt) = tables::doubt(request, found) {
                                    b.doubt aria-hidden="true" { " ?" }
                                    small.doubt { " " (doubt) "," }
                                }
                                small { " " (tables::origin(found)) }
                            }
                        }
                    }
                    @if answer.solutions.len() > 1 {
                        label.pill { input type="radio" name="solution" value="all"; span { "all" } }
                    }
                }
            }
            div.view.needs-script {
                canvas #picture tabindex="0" role="application" aria-label="The robot in 3-D"
                    aria-describedby="picture-help" {}
                div.buttons role="group" aria-label="View" {
                    button type="button" data-view="left" aria-label="turn left" title="turn left" { "\u{2190}" }
                    button type="button" data-view="right" aria-label="turn right" title="turn right" { "\u{2192}" }
                    button type="button" data-view="up" aria-label="look from higher" title="look from higher" { "\u{2191}" }
                    button type="button" data-view="down" aria-label="look from lower" title="look from lower" { "\u{2193}" }
                    button type="button" data-view="in" aria-label="zoom in" title="zoom in" { "+" }
                    button type="button" data-view="out" aria-label="zoom out" title="zoom out" { "\u{2212}" }
                    button type="button" data-view="top" { "Top" }
                    button type="button" data-view="side" { "Side" }
                    button type="button" data-view="reset" { "Reset" }
                    button type="button" data-view="all" { "Fit all" }
                }
            }
            ul #key.key.needs-script aria-label="Cables" {}
            p #shown.needs-script aria-live="polite" {}
            p #picture-help.note.needs-script {
                "Drag to turn, Shift and drag to move, pinch or click and turn the wheel to zoom; with the \
                 picture in focus: arrow keys, Shift and arrow keys, + and \u{2212}, 0 to reset, F to fit all. \
                 " (shapes(request, slack.iter().flatten().any(|is_slack| *is_slack))) " \
                 Cables that are slack (lowest point between their ends, over 1 % longer than the straight line) are \
                 dashed, what is below the ground is thin. Slack cables can hang far below the picture: \
                 \u{201c}Fit all\u{201d} shows how far."
            }
        }
    }
}

/// How true the shapes in the picture are.
fn shapes(request: &Request, any_slack: bool) -> &'static str {
    match (request.model, any_slack) {
        (ModelKind::Rigid, true) => {
            "Schematic for slack cables, which this model has hang straight down, across and up."
        }
        (ModelKind::Parabolic, true) => {
            "Schematic for slack cables, which this model draws longer than they are."
        }
        _ => "True shapes.",
    }
}

fn branches_section(curves: &Curves) -> Markup {
    let (parameter, range) = (curves.parameter, curves.range);
    let over = format!(
        "over the {}, {} to {} {}",
        parameter.name(),
        plain(range.from()),
        plain(range.to()),
        parameter.unit()
    );
    html! {
        section #branches aria-labelledby="branches-title" {
            h2 #branches-title { "Branches of solutions" }
            @match &curves.drawn {
                Ok(drawn) => {
                    p { "How the solutions change " (over) "; where two of them meet and vanish, there is a fold." }
                    div.scroll tabindex="0" role="img" aria-label={ "Diagram: longest rest length " (over) "; the same as text below" } {
                        (PreEscaped(&drawn.svg))
                    }
                    details { summary { "The same as text" } pre.scroll tabindex="0" { (drawn.text) } }
                }
                Err(why) => p.warning { "There is no diagram " (over) ": " (why) "." },
            }
        }
    }
}

fn workspace_section(request: &Request, workspace: &Slices) -> Markup {
    let [nx, ny, nz] = workspace.counts();
    let differs = workspace.order().map(|order| order.differs_from(request));
    html! {
        section #workspace aria-labelledby="workspace-title" {
            h2 #workspace-title { "Workspace" }
            p {
                "A grid of " (nx) " \u{d7} " (ny) " \u{d7} " (nz) " poses"
                @if workspace.missing() > 0 { ", " (workspace.missing()) " of them not computed" }
                @if let Some(order) = workspace.order() {
                    "; lengths, tensions and margins of the solution that is the best: " (order.choice)
                }
                "."
            }
            @if workspace.undecided() > 0 {
                p {
                    "Undecided at " (counted(workspace.undecided(), "pose"))
                    ", which are hatched: there may be more solutions than are counted, and a better one."
                }
            }
            @match differs.as_deref() {
                Some([]) => {}
                Some(differs) => p.warning {
                    "The map is of something else than this report: " (differs.join(", "))
                    @if differs.len() == 1 { " differs." } @else { " differ." }
                },
                None => p.warning { "What the map is of is not known: there is no workspace.json beside it." }
            }
            noscript { p.note { "The slices need JavaScript." } }
            div.controls.needs-script {
                label { "Show " select #quantity {} }
                label {
                    "Slice across "
                    select #axis {
                        option value="0" { "x" }
                        option value="1" { "y" }
                        option value="2" selected { "z" }
                    }
                }
                label.wide { span #slice-name { "at" } input #slice type="range" min="0" value="0" step="1"; }
            }
            div.slices.needs-script {
                canvas #slices tabindex="0" role="application" aria-label="Slice of the workspace"
                    aria-describedby="slices-help" {}
                div {
                    div #legend.legend {}
                    dl #readout.readout aria-live="polite" aria-label="At the cursor" {}
                }
            }
            p #slices-help.note.needs-script {
                "Point at a pose, or move with the arrow keys while the slice is in focus; Page Up and \
                 Page Down change the slice. The cross is the pose of this report, dashed where it is in another slice."
            }
        }
    }
}

/// What the script draws.
#[derive(Serialize)]
struct Data<'a> {
    position: [f64; 3],
    anchors: [[f64; 3]; CABLES],
    attachments: [[f64; 3]; CABLES],
    solutions: Vec<DrawnSolution>,
    workspace: Option<&'a Slices>,
}

#[derive(Serialize)]
struct DrawnSolution {
    /// What is said of it where it is shown.
    doubt: Option<&'static str>,
    cables: [DrawnCable; CABLES],
}

#[derive(Serialize)]
struct DrawnCable {
    slack: bool,
    length: f64,
    tension: f64,
    /// x, y, z of each point in turn.
    points: Vec<f64>,
}

impl<'a> Data<'a> {
    fn of(
        request: &Request,
        answer: &Enumeration,
        workspace: Option<&'a Slices>,
    ) -> Result<Self, GeometryFault> {
        let pose = request.pose()?;
        let cables = request.robot.robot.cables();
        let mut solutions = Vec::new();
        for found in &answer.solutions {
            let solution = &found.solution;
            let (shapes, slack) = (request.shapes(solution)?, request.slack(solution)?);
            let drawn = |i: usize| DrawnCable {
                slack: slack[i],
                length: solution.states[i].rest_length_m,
                tension: solution.tension_n(i),
                points: shapes[i].iter().flat_map(|p| rounded(p.position_m.into())).collect(),
            };
            solutions.push(DrawnSolution {
                doubt: tables::doubt(request, found),
                cables: std::array::from_fn(drawn),
            });
        }
        Ok(Self {
            position: request.position_m,
            anchors: cables.each_ref().map(|cable| cable.anchor_m.into()),
            attachments: cables
                .each_ref()
                .map(|cable| rounded((pose.position_m() + pose.turn(&cable.attachment_m)).into())),
            solutions,
            workspace,
        })
    }
}

fn rounded(place_m: [f64; 3]) -> [f64; 3] {
    place_m.map(|c| (c * PER_METRE).round() / PER_METRE)
}
