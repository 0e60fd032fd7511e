//! All branches as tables for a terminal.

use std::fmt::Write as _;

use cdpr_core::CABLES;

use super::longest;
use crate::branches::{Border, BranchPoint, Diagram};
use crate::enumerate::Request;
use crate::output::text::{counted, decimals, heading, new_table, plain, range_text, sign};

/// Digits of a value of the parameter at folds and limits, which are located to more.
const VALUE_DIGITS: i32 = 10;

/// The branches of `request` as text.
#[must_use]
pub fn text(request: &Request, diagram: &Diagram) -> String {
    let Diagram { parameter, range, .. } = *diagram;
    let mut out = heading(request, Some((parameter, range)));
    let unit = parameter.unit();
    let _ = writeln!(
        out,
        "\nOver the {}, {} {unit}: {}, {}",
        parameter.name(),
        range_text(range),
        counted(diagram.branches.len(), "branch"),
        counted(diagram.folds.len(), "fold"),
    );
    if !diagram.branches.is_empty() {
        let _ = writeln!(out, "{}", branch_table(diagram));
    }
    if !diagram.folds.is_empty() {
        let _ = writeln!(out, "\nFolds, where two branches meet\n{}", fold_table(diagram));
    }
    let crossings = diagram.branches.iter().enumerate().flat_map(|(number, branch)| {
        branch.limit_crossings.iter().map(move |crossing| (number + 1, crossing))
    });
    for (line, (number, crossing)) in crossings.enumerate() {
        if line == 0 {
            let _ = writeln!(out, "\nLimits");
        }
        let _ = writeln!(
            out,
            "  branch {number} is beyond the limit {} {} {unit}: {} of cable {}",
            if crossing.is_beyond_above { "above" } else { "below" },
            value_text(crossing.value),
            crossing.quantity,
            crossing.cable + 1,
        );
    }
    let _ = write!(out, "\n{}", checks_text(diagram));
    out
}

fn branch_table(diagram: &Diagram) -> String {
    let unit = diagram.parameter.unit();
    let columns = [
        "rigid origin".into(),
        "det".into(),
        format!("from [{unit}]"),
        "at".into(),
        "longest cable [m]".into(),
        format!("to [{unit}]"),
        "at".into(),
        "longest cable [m]".into(),
        "within limits".into(),
    ];
    let mut table = new_table("branch", columns);
    for (number, branch) in diagram.branches.iter().enumerate() {
        let end = |border, point: Option<&BranchPoint>| {
            let at = match border {
                Border::Range => "range".to_owned(),
                Border::Fold(fold) => format!("fold {}", fold + 1),
                Border::RanAway(cable) => format!("tension {} runs away", cable + 1),
                Border::Stalled => "singular".to_owned(),
                Border::Doubtful => "doubtful".to_owned(),
            };
            let (value, length) = point.map_or((String::new(), String::new()), |point| {
                let (cable, length_m) = longest(point);
                let value = match border {
                    Border::Range => plain(point.value),
                    _ => value_text(point.value),
                };
                (value, format!("{length_m:.3} ({})", cable + 1))
            });
            [value, at, length]
        };
        let beyond = branch.points.iter().filter(|point| point.is_beyond_limit).count();
        let within = match beyond {
            0 => "yes",
            n if n == branch.points.len() => "no",
            _ => "in part",
        };
        let origin = branch.origin.map_or("no rigid origin".to_owned(), |set| set.to_string());
        let row = [(number + 1).to_string(), origin, sign(branch.is_positive).to_owned()];
        table.add_row(
            row.into_iter()
                .chain(end(branch.low, branch.points.first()))
                .chain(end(branch.high, branch.points.last()))
                .chain([within.to_owned()]),
        );
    }
    table.to_string()
}

fn fold_table(diagram: &Diagram) -> String {
    let columns =
        [format!("value [{}]", diagram.parameter.unit()), "branches".into(), "as it grows".into()];
    let lengths = (1..=CABLES).map(|i| format!("L{i} [m]"));
    let mut table = new_table("fold", columns.into_iter().chain(lengths));
    for (number, fold) in diagram.folds.iter().enumerate() {
        let [a, b] = fold.branches.map(|index| index + 1);
        let row = [
            (number + 1).to_string(),
            value_text(fold.value),
            format!("{a} and {b}"),
            if fold.is_death { "both end" } else { "both begin" }.to_owned(),
        ];
        let lengths = fold.states.iter().map(|state| format!("{:.6}", state.rest_length_m));
        table.add_row(row.into_iter().chain(lengths));
    }
    table.to_string()
}

/// What the start values say about the branches.
fn checks_text(diagram: &Diagram) -> String {
    let unit = diagram.parameter.unit();
    let counts: Vec<_> = diagram.checks.iter().map(|check| check.solutions.to_string()).collect();
    let mut out = format!("Solutions at {} start values: {}\n", counts.len(), counts.join(" "));
    for check in &diagram.checks {
        let (value, degree) = (value_text(check.value), check.degree);
        if check.solutions != check.branches {
            let _ = writeln!(
                out,
                "  At {value} {unit}: {} pass, but the search at this value alone finds {}",
                counted(check.branches, "branch"),
                counted(check.solutions, "solution"),
            );
        }
        if degree != diagram.rigid_degree {
            let _ = writeln!(
                out,
                "  At {value} {unit}: degree {degree}, but {} for the rigid solutions: some are missing",
                diagram.rigid_degree
            );
        }
    }
    for doubt in &diagram.doubts {
        let _ = writeln!(out, "  In doubt: {doubt}");
    }
    if diagram.is_consistent() {
        let degree = diagram.rigid_degree;
        let _ = writeln!(out, "  Each lies on exactly one branch; degree {degree} at every value");
    }
    out
}

/// A located value of the parameter.
fn value_text(value: f64) -> String {
    if (1e-6..1e12).contains(&value) {
        format!("{value:.0$}", decimals(value, VALUE_DIGITS))
    } else {
        format!("{value:.*e}", usize::try_from(VALUE_DIGITS - 1).unwrap_or(0))
    }
}
