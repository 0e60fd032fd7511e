//! The answer as tables for a terminal.

use std::fmt::Write as _;

use cdpr_core::CABLES;
use comfy_table::{CellAlignment, Table, presets};

use crate::branches::{Parameter, Range};
use crate::enumerate::{Enumeration, FoundSolution, ModelKind, Request, Retraced, SearchReport};

/// The answer to `request` as text.
#[must_use]
pub fn text(request: &Request, answer: &Enumeration) -> String {
    let mut out = heading(request, None);
    let rigid = &answer.rigid.solutions;
    let _ = writeln!(
        out,
        "\nNon-deformable cables: {}, degree {}",
        count(rigid.len()),
        answer.rigid.degree()
    );
    if !rigid.is_empty() {
        let mut table =
            new_table("slack", (1..=CABLES).map(|i| format!("tau{i} [N]")).chain(["det".into()]));
        for solution in rigid {
            let forces = solution.forces_n.iter().map(|f| significant(*f));
            table.add_row(
                std::iter::once(solution.slack.to_string())
                    .chain(forces)
                    .chain([sign(solution.is_positive).to_owned()]),
            );
        }
        let _ = writeln!(out, "{table}");
    }
    for slack in &answer.rigid.undecided {
        let _ = writeln!(
            out,
            "Undecided: with slack {slack} a force is zero to rounding (border of two sets)"
        );
    }
    let title = match request.model {
        ModelKind::Rigid => "Within the limits, slack cables hanging vertically",
        _ => "Deformable cables",
    };
    let found = count(answer.solutions.len());
    let _ = writeln!(out, "\n{title}: {found}, degree {}", answer.degree());
    for branch in &answer.branches {
        let _ = writeln!(out, "  branch {}: {branch}", branch.origin);
    }
    if let Some(search) = &answer.search {
        out += &search_text(search, answer);
    }
    for difference in &answer.differences {
        let _ = writeln!(out, "  {difference}");
    }
    if answer.degree() != answer.rigid.degree() {
        let reason = why_degrees_differ(request, answer);
        let _ = writeln!(out, "  The degrees differ: {reason}");
    }
    for (number, found) in answer.solutions.iter().enumerate() {
        let _ = write!(out, "\n{}", solution_text(number + 1, found));
    }
    out
}

/// The reason for degrees that differ from those of rigid cables.
pub(crate) fn why_degrees_differ(request: &Request, answer: &Enumeration) -> &'static str {
    if !request.has_weight() {
        "cables without weight exert no force when they are slack, so the degrees need not agree"
    } else if answer.is_complete() {
        "solutions lie beyond the limits"
    } else {
        "solutions lie beyond the limits, or are missing"
    }
}

fn search_text(search: &SearchReport, answer: &Enumeration) -> String {
    let mut out = String::new();
    if let Some(refusal) = &search.refusal {
        let _ = writeln!(out, "  Not complete: {refusal}");
        return out;
    }
    let effort = format!("{} boxes", search.boxes);
    if answer.is_complete() {
        let claim = if answer.solutions.is_empty() {
            "proven: there is no solution within the limits"
        } else {
            "proven: each exists, and there are no others within the limits"
        };
        let _ = writeln!(out, "  Complete, {claim} ({effort})");
    } else {
        let _ =
            writeln!(out, "  Not complete ({effort}): whether there are more is undecided where");
    }
    for place in &search.undecided {
        let ranges = place.states.iter().map(|state| {
            format!("{:.9}..{:.9}", state.rest_length_m.low(), state.rest_length_m.high())
        });
        let _ = writeln!(out, "    the lengths are {} m", ranges.collect::<Vec<_>>().join(", "));
    }
    out
}

/// What was asked, with the range of what varies in place of its value.
pub(crate) fn heading(request: &Request, varied: Option<(Parameter, Range)>) -> String {
    let robot = &request.robot;
    let [x, y, z] = request.position_m;
    let [a, b, c] = request.rotation_vector_rad;
    let model = match request.model {
        ModelKind::Irvine => "elastic catenary (Irvine)",
        ModelKind::Elastic => "massless elastic",
        ModelKind::Parabolic => "parabola with stretch",
        ModelKind::Rigid => "non-deformable",
    };
    let same = |value: &dyn Fn(usize) -> f64| {
        let first = value(0);
        if (1..CABLES).all(|i| value(i).to_bits() == first.to_bits()) {
            plain(first)
        } else {
            "by cable".to_owned()
        }
    };
    let cables = robot.robot.cables();
    let or_range = |parameter, value: String| match varied {
        Some((varied, range)) if varied == parameter => range_text(range),
        _ => value,
    };
    format!(
        "{} at ({x}, {y}, {z}) m, rotation vector ({a}, {b}, {c}) rad, {} kg\n\
         cables: {model}, {} kg/m, EA {} N, at most {} m and {} N\n",
        robot.name,
        or_range(Parameter::Mass, plain(robot.load.mass_kg)),
        or_range(Parameter::LinearDensity, same(&|i| cables[i].model.linear_density_kg_m)),
        or_range(Parameter::AxialStiffness, same(&|i| cables[i].model.axial_stiffness_n)),
        same(&|i| robot.limits[i].max_length_m),
        same(&|i| robot.limits[i].max_tension_n),
    )
}

/// Both ends of a range, without the unit.
pub(super) fn range_text(range: Range) -> String {
    format!("{} to {}", plain(range.from()), plain(range.to()))
}

fn solution_text(number: usize, found: &FoundSolution) -> String {
    let solution = &found.solution;
    let origin = match (found.origin, found.retraced) {
        (Some(origin), _) => format!(", from rigid slack set {origin}"),
        (None, Some(Retraced::Nowhere)) => ", without a rigid origin".to_owned(),
        (None, _) => String::new(),
    };
    let proof = found.proof.as_ref().map_or(String::new(), |proof| {
        let largest_m = proof.length_radii_m.iter().copied().fold(0.0, f64::max);
        format!(", proven to {largest_m:.0e} m")
    });
    let mut out = format!(
        "Solution {number}{origin}{proof}: det {}, condition {:.1}\n",
        sign(solution.is_positive),
        solution.condition,
    );
    let columns = [
        "rest length [m]",
        "tension at A [N]",
        "tension at B [N]",
        "Fx at B [N]",
        "Fz at B [N]",
        "sag [m]",
    ];
    let mut table = new_table("cable", columns.map(String::from));
    for i in 0..CABLES {
        let state = &solution.states[i];
        let note = if solution.vertical[i] { " (vertical)" } else { "" };
        table.add_row([
            format!("{}{note}", i + 1),
            format!("{:.6}", state.rest_length_m),
            significant(solution.anchor_tensions_n[i]),
            significant(state.tension_at_attachment_n()),
            significant(state.force_n.x),
            significant(state.force_n.y),
            significant(found.sags_m[i]),
        ]);
    }
    let _ = writeln!(out, "{table}");
    match found.retraced {
        Some(Retraced::Rigid(set)) => {
            let _ = writeln!(out, "Retraced: the inverse scheme leads to rigid slack set {set}");
        }
        Some(Retraced::Nowhere) => {
            let _ = writeln!(out, "Retraced: the inverse scheme leads to no rigid solution");
        }
        None => {}
    }
    out
}

/// A borderless table, its first column to the left and the others to the right.
pub(super) fn new_table(first: &str, others: impl IntoIterator<Item = String>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(std::iter::once(first.to_owned()).chain(others));
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn count(number: usize) -> String {
    counted(number, "solution")
}

/// A number of things, in words.
pub(crate) fn counted(number: usize, thing: &str) -> String {
    match number {
        0 => format!("no {thing}"),
        1 => format!("1 {thing}"),
        n => format!("{n} {thing}{}", if thing.ends_with("ch") { "es" } else { "s" }),
    }
}

pub(crate) fn sign(is_positive: bool) -> &'static str {
    if is_positive { "+" } else { "-" }
}

/// All digits, with an exponent where there would be many zeros.
pub(crate) fn plain(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-4..1e9).contains(&size) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// Six significant digits without an exponent, for the range of forces and sags.
pub(crate) fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    format!("{value:.0$}", decimals(value, 6).min(9))
}

/// How many decimals show this many significant digits of a number that is not zero.
pub(super) fn decimals(value: f64, significant: i32) -> usize {
    #[allow(clippy::cast_possible_truncation)] // a decimal exponent
    let exponent = value.abs().log10().floor() as i32;
    usize::try_from(significant - 1 - exponent).unwrap_or(0)
}
