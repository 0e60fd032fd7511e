//! What can be read on the page: the answer in one sentence, tables, and the proof in plain words.

use cdpr_core::CABLES;
use maud::{Markup, html};

use crate::enumerate::{Difference, Enumeration, FoundSolution, ModelKind, Request, Retraced};
use crate::output::{counted, sign, significant, why_degrees_differ};

/// A length or tension above this part of its limit is said to be near it.
const NEAR: f64 = 0.8;

/// The answer in one sentence.
pub(super) fn verdict(request: &Request, answer: &Enumeration) -> Markup {
    html! {
        p.verdict.good[answer.is_complete()].warning[!answer.is_complete()] {
            span aria-hidden="true" { @if answer.is_complete() { "\u{2713} " } @else { "? " } }
            (verdict_words(request, answer))
        }
    }
}

fn verdict_words(request: &Request, answer: &Enumeration) -> String {
    let number = answer.solutions.len();
    if answer.is_complete() {
        return match number {
            0 => "There is no solution within the limits, proven.".to_owned(),
            1 => {
                "1 solution, proven: it exists, and there is no other within the limits.".to_owned()
            }
            _ => format!(
                "{number} solutions, proven: each exists, and there are no others within the limits."
            ),
        };
    }
    if contradicted(answer) {
        return "The search and the continuation contradict each other: do not rely on this answer."
            .to_owned();
    }
    if number == 0 {
        return "No solution found, and it is not proven that there is none.".to_owned();
    }
    if request.model == ModelKind::Rigid {
        let found = counted(number, "solution");
        return format!("{found} found by linear algebra, to rounding; nothing is proven.");
    }
    let unproven = answer.solutions.iter().filter(|found| found.proof.is_none()).count();
    let exist = match (number - unproven, unproven) {
        (0, _) => format!("{} found, not proven to exist", counted(number, "solution")),
        (proven, 0) => format!("{} proven", counted(proven, "solution")),
        (proven, _) => {
            format!("{} proven, {unproven} not proven to exist", counted(proven, "solution"))
        }
    };
    if answer.search.as_ref().is_some_and(|search| search.refusal.is_none()) {
        format!("{exist}; in some places it is undecided whether there are others.")
    } else {
        format!("{exist}; there may be others.")
    }
}

/// Whether a branch arrives where the search has proven that there is nothing.
fn contradicted(answer: &Enumeration) -> bool {
    let is_contradicted =
        |d: &Difference| matches!(d, Difference::Unconfirmed { contradicted: true, .. });
    answer.differences.iter().any(is_contradicted)
}

/// What is said of a solution whose existence is not proven. Those of rigid cables are found by linear algebra,
/// none of them with a proof.
pub(super) fn doubt(request: &Request, found: &FoundSolution) -> Option<&'static str> {
    (found.proof.is_none() && request.model != ModelKind::Rigid).then_some("not proven to exist")
}

/// The solution (from 1) to look at first: one that exists.
pub(super) fn first_shown(answer: &Enumeration) -> usize {
    answer.solutions.iter().position(|found| found.proof.is_some()).unwrap_or(0) + 1
}

/// Where a solution comes from, in a few words.
pub(super) fn origin(found: &FoundSolution) -> String {
    match (found.origin, found.retraced) {
        (Some(set), _) if set.is_empty() => "all taut when rigid".to_owned(),
        (Some(set), _) => format!("slack when rigid: {set}"),
        (None, Some(Retraced::Rigid(set))) => format!("leads back to slack set {set}"),
        (None, Some(Retraced::Nowhere)) => "without a rigid origin".to_owned(),
        (None, None) => "origin not looked for".to_owned(),
    }
}

/// The part that a length and a tension are of their limits.
fn shares(request: &Request, found: &FoundSolution, cable: usize) -> [f64; 2] {
    let limits = &request.robot.limits[cable];
    [
        found.solution.states[cable].rest_length_m / limits.max_length_m,
        found.solution.tension_n(cable) / limits.max_tension_n,
    ]
}

fn percent(share: f64) -> String {
    if share == 0.0 {
        "no limit".to_owned()
    } else if share < 0.001 {
        "< 0.1 %".to_owned()
    } else if share < 0.1 {
        format!("{:.1} %", 100.0 * share)
    } else {
        format!("{:.0} %", 100.0 * share)
    }
}

/// Which limits are near, in words.
fn near(request: &Request, found: &FoundSolution) -> String {
    let mut near = Vec::new();
    for i in 0..CABLES {
        let limits = &request.robot.limits[i];
        let [length, tension] = shares(request, found, i);
        if length > NEAR {
            near.push(format!(
                "length of cable {}, {} of {} m",
                i + 1,
                percent(length),
                limits.max_length_m
            ));
        }
        if tension > NEAR {
            let limit_n = limits.max_tension_n;
            near.push(format!("tension of cable {}, {} of {limit_n} N", i + 1, percent(tension)));
        }
    }
    if near.is_empty() {
        format!("No limit is near (all below {}).", percent(NEAR))
    } else {
        format!("Near a limit: {}.", near.join("; "))
    }
}

/// Cable (from 0) with the largest value.
fn largest(value: impl Fn(usize) -> f64) -> usize {
    (1..CABLES).fold(0, |best, i| if value(i) > value(best) { i } else { best })
}

pub(super) fn answer_section(
    request: &Request,
    answer: &Enumeration,
    slack: &[[bool; CABLES]],
) -> Markup {
    html! {
        section #answer aria-labelledby="answer-title" {
            h2 #answer-title { "Lengths and tensions" }
            @if answer.solutions.is_empty() {
                p { "There is nothing to list: no solution was found." }
            }
            @if answer.solutions.len() > 1 { (overview(answer)) }
            @for ((number, found), slack) in (1_usize..).zip(&answer.solutions).zip(slack) {
                div.solution data-solution=(number) {
                    h3 {
                        "Solution " (number)
                        @if let Some(doubt) = doubt(request, found) { ", " span.doubt { (doubt) } }
                        small { " " (origin(found)) }
                    }
                    (cables(request, found, *slack))
                    p {
                        (near(request, found)) " Determinant "
                        (if found.solution.is_positive { "positive" } else { "negative" })
                        " (counts " (sign(found.solution.is_positive)) "1 in the degree), condition "
                        (format!("{:.1}", found.solution.condition))
                        ": the larger, the closer to a fold or a singularity."
                    }
                }
            }
            p {
                "Degree, the sum of the signs: " (answer.degree()) "; with rigid cables " (answer.rigid.degree()) ". "
                @if answer.degree() == answer.rigid.degree() {
                    "They agree"
                    @if request.has_weight() { ", as they must unless solutions are beyond the limits or missing" }
                    "."
                } @else {
                    "They differ: " (why_degrees_differ(request, answer)) "."
                }
            }
        }
    }
}

/// All solutions side by side.
fn overview(answer: &Enumeration) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label="All solutions" {
            table {
                caption { "All solutions" }
                thead { tr {
                    th scope="col" { "Solution" }
                    th scope="col" { "Origin" }
                    th.number scope="col" { "Longest cable (m)" }
                    th.number scope="col" { "Highest tension (N)" }
                    th.number scope="col" { "Sign of det" }
                    th.number scope="col" { "Condition" }
                    th scope="col" { "Proven" }
                } }
                tbody { @for (number, found) in (1_usize..).zip(&answer.solutions) {
                    @let solution = &found.solution;
                    @let long = largest(|i| solution.states[i].rest_length_m);
                    @let tense = largest(|i| solution.tension_n(i));
                    tr {
                        th scope="row" { (number) }
                        td { (origin(found)) }
                        td.number { (format!("{:.3}", solution.states[long].rest_length_m)) " (" (long + 1) ")" }
                        td.number { (significant(solution.tension_n(tense))) " (" (tense + 1) ")" }
                        td.number { (sign(solution.is_positive)) }
                        td.number { (format!("{:.1}", solution.condition)) }
                        td { (if found.proof.is_some() { "yes" } else { "no" }) }
                    }
                } }
            }
        }
    }
}

/// The six cables of a solution.
fn cables(request: &Request, found: &FoundSolution, slack: [bool; CABLES]) -> Markup {
    let solution = &found.solution;
    html! {
        div.scroll tabindex="0" role="region" aria-label="Cables" {
            table.cables {
                thead { tr {
                    th scope="col" { "Cable" }
                    th.number scope="col" { "Rest length (m)" }
                    th.number scope="col" { "Tension at A (N)" }
                    th.number scope="col" { "Tension at B (N)" }
                    th.number scope="col" { "Sag (m)" }
                    th scope="col" { "State" }
                    th.number scope="col" { "Of its length limit" }
                    th.number scope="col" { "Of its tension limit" }
                    th.number scope="col" { "Fx at B (N)" }
                    th.number scope="col" { "Fz at B (N)" }
                } }
                tbody { @for i in 0..CABLES {
                    @let state = &solution.states[i];
                    @let [length, tension] = shares(request, found, i);
                    tr {
                        th scope="row" { (i + 1) }
                        td.number { (format!("{:.6}", state.rest_length_m)) }
                        td.number { (significant(solution.anchor_tensions_n[i])) }
                        td.number { (significant(state.tension_at_attachment_n())) }
                        td.number { (significant(found.sags_m[i])) }
                        td {
                            (if slack[i] { "slack" } else { "taut" })
                            @if solution.vertical[i] { ", vertical" }
                        }
                        td.number.near[length > NEAR] { (percent(length)) }
                        td.number.near[tension > NEAR] { (percent(tension)) }
                        td.number { (significant(state.force_n.x)) }
                        td.number { (significant(state.force_n.y)) }
                    }
                } }
            }
        }
    }
}

pub(super) fn proof_section(request: &Request, answer: &Enumeration) -> Markup {
    html! {
        section #proof aria-labelledby="proof-title" {
            h2 #proof-title { "How sure is this?" }
            (search_words(answer))
            @if !answer.differences.is_empty() { (differences(answer)) }
            @if answer.solutions.iter().any(|found| found.proof.is_some()) { (proofs(answer)) }
            (continuation_words(request, answer))
        }
    }
}

fn search_words(answer: &Enumeration) -> Markup {
    let Some(search) = &answer.search else {
        return html! { p { "The complete search was not asked for." } };
    };
    if let Some(refusal) = &search.refusal {
        return html! {
            p.warning {
                "Nothing is proven to be complete: " (refusal)
                ". The solutions listed were found from rigid cables; there may be others."
            }
        };
    }
    let effort = format!(
        "The complete search has cut the forces within the limits into {}, from {} of force curves",
        counted(search.boxes, "box").replace("boxs", "boxes"),
        counted(search.pieces, "piece"),
    );
    html! {
        p {
            (effort) ", and showed in interval arithmetic for each that it holds no solution, or exactly one"
            @if search.undecided.is_empty() {
                ". Rounding is part of the proof, and it rests on the contract of the cable model."
            } @else {
                ", but for the places below."
            }
        }
        @if !search.undecided.is_empty() {
            p.warning {
                "Undecided: in " (counted(search.undecided.len(), "place"))
                " there may be a solution, or two close to a fold, or none. The rest lengths there, m:"
            }
            div.scroll tabindex="0" role="region" aria-label="Undecided places" { table {
                thead { tr {
                    th scope="col" { "Place" }
                    @for i in 1..=CABLES { th.number scope="col" { "Cable " (i) } }
                } }
                tbody { @for (number, place) in (1_usize..).zip(&search.undecided) { tr {
                    th scope="row" { (number) }
                    @for state in &place.states {
                        td.number { (format!("{:.6} to {:.6}", state.rest_length_m.low(), state.rest_length_m.high())) }
                    }
                } } }
            } }
        }
    }
}

fn differences(answer: &Enumeration) -> Markup {
    let contradicted = contradicted(answer);
    html! {
        p.warning[contradicted] {
            "The complete search and the continuation from rigid cables do not say the same"
            @if contradicted { ", and contradict each other: do not rely on this answer" }
            ":"
        }
        ul { @for difference in &answer.differences { li { (difference) } } }
    }
}

/// The proof of each solution in numbers.
fn proofs(answer: &Enumeration) -> Markup {
    let short = |value: f64| format!("{value:.2e}");
    html! {
        p {
            "Each proven solution has a proof of its own: within the first distance of the forces given, measured along the force \
             curves, there is a solution, and within the second no other (Kantorovich: h = \u{3b2}\u{3b7}\u{3c9} is at most 0.5). \
             The last column is how far a true rest length can be from the one given."
        }
        div.scroll tabindex="0" role="region" aria-label="Proofs" { table {
            caption { "Proof of each solution" }
            thead { tr {
                th scope="col" { "Solution" }
                th.number scope="col" { "\u{3b2}" }
                th.number scope="col" { "\u{3b7} (N)" }
                th.number scope="col" { "\u{3c9} (1/N)" }
                th.number scope="col" { "h" }
                th.number scope="col" { "Exists within (N)" }
                th.number scope="col" { "Alone within (N)" }
                th.number scope="col" { "Length known to (m)" }
            } }
            tbody { @for (number, found) in (1_usize..).zip(&answer.solutions) { tr {
                th scope="row" { (number) }
                @match &found.proof {
                    None => td colspan="7" { "not proven" },
                    Some(proof) => {
                        @match &proof.kantorovich {
                            None => td colspan="6" { "proven by its box; the Kantorovich numbers could not be bounded" },
                            Some(k) => {
                                td.number { (significant(k.beta)) }
                                td.number { (short(k.eta_n)) }
                                td.number { (short(k.omega_per_n)) }
                                td.number { (short(k.h)) }
                                td.number { (short(k.existence_radius_n)) }
                                td.number { (significant(k.uniqueness_radius_n)) }
                            }
                        }
                        td.number { (format!("{:.0e}", proof.length_radii_m.iter().copied().fold(0.0, f64::max))) }
                    }
                }
            } } }
        } }
    }
}

fn continuation_words(request: &Request, answer: &Enumeration) -> Markup {
    let rigid = &answer.rigid.solutions;
    html! {
        h3 { "From rigid cables" }
        p {
            "With cables that neither sag nor stretch there " (if rigid.len() == 1 { "is " } else { "are " })
            (counted(rigid.len(), "solution")) "."
            @if request.model != ModelKind::Rigid && !answer.branches.is_empty() {
                " Each was followed while mass and stretch grow to their true values; certified means that every step is proven."
            }
        }
        @if !answer.branches.is_empty() {
            ul { @for branch in &answer.branches { li {
                "slack " (branch.origin) ": " (branch)
                @if branch.steps > 0 {
                    " (" (counted(branch.steps, "step"))
                    @if branch.is_certified() { ", certified" }
                    @else { ", " (branch.unproved_steps) " without proof" }
                    ")"
                }
            } } }
        }
        @for slack in &answer.rigid.undecided {
            p.warning { "With slack cables " (slack) " a force is zero to rounding: the pose is on the border of two sets." }
        }
    }
}
