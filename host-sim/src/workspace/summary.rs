//! A map in a few numbers.

use std::collections::BTreeMap;
use std::fmt;

use cdpr_core::CABLES;
use serde::Serialize;

use super::{Change, Findings, Order, Status};
use crate::enumerate::ModelKind;

/// Poses by their number of solutions.
pub type Histogram = BTreeMap<u16, usize>;

/// What the best solutions of a map ask of one winch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Needs {
    /// Longest rest length, m.
    pub length_m: f64,
    /// Highest tension at the anchor, N.
    pub anchor_tension_n: f64,
}

/// A map in a few numbers. Shares are to be taken of the poses with a solution, as in the paper.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Poses of the grid.
    pub poses: usize,
    /// Poses with rigid solutions, whatever the limits, by their number.
    pub rigid: Histogram,
    /// Poses at which that number is not settled.
    pub rigid_undecided: usize,
    /// Poses with solutions of the cable model within the limits, by their number.
    pub solutions: Histogram,
    /// Poses at which that number is not settled; they are in no other count of solutions.
    pub undecided: usize,
    /// Poses at which a cable has no direction.
    pub attachment_on_anchor: usize,
    /// See [`Change`].
    pub lost_by_merging: usize,
    /// See [`Change`].
    pub lost_to_limits: usize,
    /// See [`Change`].
    pub lost_without_weight: usize,
    /// See [`Change`].
    pub lost: usize,
    /// See [`Change`].
    pub gained: usize,
    /// What the best solutions ask of each winch; `None`: there are none.
    pub needs: Option<[Needs; CABLES]>,
}

impl Summary {
    /// Of all poses of a map.
    #[must_use]
    pub fn of(findings: &[Findings]) -> Self {
        let mut summary = Self { poses: findings.len(), ..Self::default() };
        for pose in findings {
            summary.add(pose);
        }
        summary
    }

    fn add(&mut self, pose: &Findings) {
        if pose.status == Status::AttachmentOnAnchor {
            self.attachment_on_anchor += 1;
            return;
        }
        if pose.rigid_undecided > 0 {
            self.rigid_undecided += 1;
        } else if pose.rigid > 0 {
            *self.rigid.entry(pose.rigid.into()).or_default() += 1;
        }
        if !pose.status.is_settled() {
            self.undecided += 1;
        } else if pose.solutions > 0 {
            *self.solutions.entry(pose.solutions).or_default() += 1;
        }
        match pose.change {
            None => {}
            Some(Change::LostByMerging) => self.lost_by_merging += 1,
            Some(Change::LostToLimits) => self.lost_to_limits += 1,
            Some(Change::LostWithoutWeight) => self.lost_without_weight += 1,
            Some(Change::Lost) => self.lost += 1,
            Some(Change::Gained) => self.gained += 1,
        }
        if let Some(best) = &pose.best {
            let needs = self.needs.get_or_insert_default();
            for (i, need) in needs.iter_mut().enumerate() {
                need.length_m = need.length_m.max(best.lengths_m[i]);
                need.anchor_tension_n = need.anchor_tension_n.max(best.anchor_tensions_n[i]);
            }
        }
    }
}

/// For people.
pub struct Told<'a>(pub &'a Order, pub &'a Summary);

impl fmt::Display for Told<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(order, summary) = self;
        let [nx, ny, nz] = order.grid.counts();
        let (low, high) = (order.grid.low_m(), order.grid.high_m());
        let [rx, ry, rz] = order.rotation_vector_rad;
        writeln!(
            f,
            "{}, {} kg, rotation vector ({rx}, {ry}, {rz}) rad",
            order.robot, order.load.mass_kg
        )?;
        write!(f, "{nx} x {ny} x {nz} poses")?;
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            write!(f, ", {name} {} .. {} m", low[axis], high[axis])?;
        }
        writeln!(f)?;
        writeln!(f, "\nNon-deformable cables, whatever the limits:")?;
        shares(f, summary.poses, &summary.rigid, summary.rigid_undecided)?;
        match order.model {
            ModelKind::Rigid => writeln!(f, "\nThe same within the limits:")?,
            _ => writeln!(f, "\nDeformable cables, within the limits, proven:")?,
        }
        shares(f, summary.poses, &summary.solutions, summary.undecided)?;
        if order.model != ModelKind::Rigid {
            for (count, what) in [
                (
                    summary.lost_by_merging,
                    "lost by merging: rigid solutions, no deformable one at all",
                ),
                (
                    summary.lost_to_limits,
                    "lost to the limits: deformable solutions only beyond them",
                ),
                (
                    summary.lost_without_weight,
                    "lost for want of weight: cables that are slack when rigid",
                ),
                (summary.lost, "lost, for a reason that could not be shown"),
                (summary.gained, "gained: deformable solutions, no rigid one"),
            ] {
                if count > 0 {
                    writeln!(f, "  {count:9} poses {what}")?;
                }
            }
        }
        if summary.attachment_on_anchor > 0 {
            let count = summary.attachment_on_anchor;
            writeln!(f, "  {count:9} poses with an attachment on its anchor, passed over")?;
        }
        let Some(needs) = &summary.needs else { return Ok(()) };
        writeln!(f, "\nThe best solution of each pose ({}) asks at most:", order.choice)?;
        writeln!(f, "  cable  rest length [m]  tension at A [N]")?;
        for (i, Needs { length_m, anchor_tension_n }) in needs.iter().enumerate() {
            writeln!(f, "  {:5}  {length_m:15.6}  {anchor_tension_n:16.3}", i + 1)?;
        }
        Ok(())
    }
}

fn shares(
    f: &mut fmt::Formatter<'_>,
    poses: usize,
    histogram: &Histogram,
    undecided: usize,
) -> fmt::Result {
    let reached: usize = histogram.values().sum();
    let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole as f64;
    writeln!(f, "  {reached} poses with solutions, {:.3} % of all", percent(reached, poses))?;
    for (solutions, count) in histogram {
        let noun = if *solutions == 1 { "solution " } else { "solutions" };
        writeln!(f, "  {solutions:3} {noun} {count:9} poses {:9.3} %", percent(*count, reached))?;
    }
    if undecided > 0 {
        writeln!(f, "  {undecided:9} poses not decided, and in no count above")?;
    }
    Ok(())
}
