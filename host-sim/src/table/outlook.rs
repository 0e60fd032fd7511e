//! What a box of poses looks like before any proof, in floats: with which starts one is worth trying, and whether.

use cdpr_core::CABLES;
use cdpr_core::chart::{Charted as _, Start};
use cdpr_core::statics::Balance;
use cdpr_core::table::COORDINATES;
use nalgebra::{Matrix6, Vector2, Vector6};

use super::place::{Point, PoseBox, largest};
use super::proof::Prover;
use crate::interval::Interval;

/// Cables that are tried as the eliminated one.
const CABLES_TRIED: usize = 2;
/// Bracket of an eliminated cable: what it moves over a box, times one of these and a little more; the largest at
/// which the tangent is this steep, in units of the solution.
const BRACKETS: [f64; 7] = [1.0, 1.3, 1.6, 2.0, 2.5, 3.2, 4.0];
const LEAST_BRACKET: f64 = 0.5;
const STEEP: f64 = 0.3;

/// A box, seen from the solution at a pose of it.
pub(super) struct Outlook {
    /// With the cable eliminated whose tangent turns most over the box, and with the one that follows.
    pub(super) starts: Vec<Start<f64>>,
    /// Sines of the angles by which the tangents of all cables turn, about, in that order.
    pub(super) turns: Vec<f64>,
    /// The coordinate that moves the forces most.
    pub(super) widest: usize,
    /// How far the matrix turns over the box at fixed coordinates, about: a proof needs less than 1.
    pub(super) defect: f64,
}

impl Outlook {
    /// What a box looks like from the solution `charts` at a pose of it.
    pub(super) fn new(
        prover: &Prover,
        region: &PoseBox,
        at: &Point,
        charts: &[f64; CABLES],
    ) -> Option<Self> {
        let balance = prover.balance(at)?;
        let step = prover.step(&balance, charts)?;
        let inverse = step.elimination().inverse();
        let by_pose_n = by_pose(prover, at, charts)?;
        let mut reach = Vector6::zeros();
        let slopes_n = Vector6::from_fn(|i, _| step.points[i].force_by_chart_n.norm());
        let mut moved_n = [0.0; COORDINATES];
        for k in 0..COORDINATES {
            let moved = (inverse * by_pose_n[k]).abs();
            let moved = moved * (0.5 * region.extent(k));
            reach += moved;
            moved_n[k] = moved.dot(&slopes_n);
        }
        let turns: [f64; CABLES] =
            std::array::from_fn(|i| turn(prover, &balance, i, charts[i], reach[i]));
        let mut order: Vec<usize> = (0..CABLES).collect();
        order.sort_by(|a, b| turns[*b].total_cmp(&turns[*a]));
        let start = |eliminated: usize| {
            let (chart, reach) = (charts[eliminated], reach[eliminated]);
            let row = inverse.row(eliminated).transpose();
            let plane = &balance.planes()[eliminated];
            let rise = |chart: f64| {
                let tangent_n = slope_n(prover, &balance, eliminated, chart).normalize();
                row.dot(&plane.wrench_n(&tangent_n))
            };
            let steep = STEEP * rise(chart);
            let ends = [-1.0, 1.0].map(|way| {
                BRACKETS.map(|times| {
                    let end = chart + way * (times * reach + LEAST_BRACKET);
                    (end, rise(end))
                })
            });
            // As far as it is steep; or up to a fold, and beyond to where it falls as steeply.
            let until = |side: usize| {
                let [nearest, ..] = ends[side];
                ends[side].iter().rev().find(|(_, rise)| *rise >= steep).unwrap_or(&nearest).0
            };
            let past = |side: usize| {
                let [.., farthest] = ends[side];
                ends[side].iter().find(|(_, rise)| *rise <= -steep).unwrap_or(&farthest).0
            };
            let least =
                ends.map(|all| all.into_iter().fold(f64::INFINITY, |least, (_, r)| least.min(r)));
            let fold_at_slack_end = least[1] < least[0];
            let bracket = if fold_at_slack_end { [until(0), past(1)] } else { [past(0), until(1)] };
            Start {
                charts: *charts,
                eliminated,
                bracket,
                fold_at_slack_end,
                is_positive: step.elimination().is_positive(),
            }
        };
        let turns = order.iter().map(|cable| turns[*cable]).collect();
        let starts = order.into_iter().take(CABLES_TRIED).map(start).collect();
        let widest = largest(0..COORDINATES, |k| moved_n[k]);
        let defect = defect(prover, region, at, charts, &inverse, &slopes_n)?;
        Some(Self { starts, turns, widest, defect })
    }
}

/// The tangent of a cable.
fn slope_n(prover: &Prover, balance: &Balance<f64>, cable: usize, chart: f64) -> Vector2<f64> {
    let (plane, model) = (&balance.planes()[cable], &prover.robot().cables()[cable].model);
    model.hang(plane.x_m, plane.z_m, chart).force_by_chart_n
}

/// Sine of the angle by which the tangent of a cable turns around a coordinate.
fn turn(prover: &Prover, balance: &Balance<f64>, cable: usize, chart: f64, reach: f64) -> f64 {
    let tangent = |chart: f64| slope_n(prover, balance, cable, chart).normalize();
    tangent(chart - reach).perp(&tangent(chart + reach)).abs()
}

/// How the sum of the wrenches changes with each coordinate of the pose, N/m and N, at fixed coordinates of the cables.
pub(super) fn by_pose(
    prover: &Prover,
    at: &Point,
    charts: &[f64; CABLES],
) -> Option<[Vector6<f64>; COORDINATES]> {
    let (sights, loading) = prover.likeness.look(&PoseBox { low: *at, high: *at }).ok()?;
    let mut by_pose_n = loading.by_pose(prover.likeness.everywhere());
    for (i, sight) in sights.iter().enumerate() {
        let hung = prover.curves.hung(i, sight, Interval::point(charts[i]))?;
        sight.add_by_pose(&mut by_pose_n, &hung, prover.likeness.everywhere());
    }
    Some(by_pose_n.map(|column| column.map(Interval::middle)))
}

/// How far the matrix at fixed coordinates is from that at a pose, at the ends of a box: the norm in newtons.
fn defect(
    prover: &Prover,
    region: &PoseBox,
    at: &Point,
    charts: &[f64; CABLES],
    inverse: &Matrix6<f64>,
    slopes_n: &Vector6<f64>,
) -> Option<f64> {
    let mut sum = Vector6::zeros();
    for k in 0..COORDINATES {
        let mut there = *at;
        there[k] += 0.5 * region.extent(k);
        let balance = prover.balance(&there)?;
        for i in 0..CABLES {
            let tangent_n = slope_n(prover, &balance, i, charts[i]);
            let mut column = inverse * balance.planes()[i].wrench_n(&tangent_n);
            column[i] -= 1.0;
            // A move by 1 N of this cable, in newtons of each.
            sum += column.abs().component_mul(slopes_n) / (slopes_n[i] * CABLES as f64);
        }
    }
    Some(sum.sum())
}
