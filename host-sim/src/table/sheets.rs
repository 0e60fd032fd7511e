//! Which sheets of solutions there are over a region: all solutions at the poses of a grid, proven, linked between
//! neighbouring poses where the solution can be followed from one to the other with a certificate.
//!
//! A link is a walk of core's [`Tracker`] along the straight way between two poses: each of its ticks proves that for
//! every pose since the last one there is exactly one solution in a tube around the way. Solutions that are linked lie
//! on one sheet; where no link can be certified (a fold, a limit) is its border. A sheet that holds two solutions of
//! one pose has come back to it on another branch.

use std::collections::BTreeMap;
use std::fmt;

use cdpr_core::{
    CABLES, CableLimits as TrackerLimits, CableState, Fault, GeometryFault, IrvineCatenary, Load,
    Pose, Robot, SetPoint, Tracker, TrackerSettings, Twist,
};
use nalgebra::{UnitQuaternion, Vector3};
use rayon::ThreadPool;
use serde::Serialize;

use super::links::Sets;
use crate::choice::Choice;
use crate::continuation::Solution;
use crate::enumerate::{Method, ModelKind, Options, Request};
use crate::in_order;
use crate::robot_file::{CableLimits, RobotDescription};
use crate::workspace::Grid;

/// Ticks between two poses, and how many are tried when a walk is refused: the tracker halves its moves by itself,
/// but predicts over whole ones.
const TICKS: [u32; 3] = [16, 128, 1024];
/// Time of a walk; it has no other meaning than that of a unit.
const WALK_S: f64 = 1.0;
/// Where the tracker is to stop before a singularity.
const LEAST_DISTANCE: f64 = 1e-6;
/// Error of a force that is accepted, of the sum of tensions at the start of a walk.
const LARGEST_ERROR: f64 = 1e-6;
/// Two forces that differ by less, of the largest one, are of one solution: far above rounding, and far below what lies
/// between two proven ones.
const SAME: f64 = 1e-6;

/// Why a solution is not linked to any at the next pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Border {
    /// A length or a tension reaches its limit on the way.
    Limit,
    /// No certificate, however short the steps: a fold or singularity, or too close to one for the proof.
    Fold,
    /// Whether the next pose has this solution within the limits is not decided.
    Undecided,
}

impl fmt::Display for Border {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Limit => "at a limit of length or tension",
            Self::Fold => "at a fold, or too close to one for the proof",
            Self::Undecided => "where the next pose is not decided",
        })
    }
}

/// The pose of a sheet that is the best in some way.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BestPose {
    /// How good: m, N, or without unit.
    pub value: f64,
    /// Where.
    pub position_m: [f64; 3],
    /// Which of the solutions there, counted from 1 as `cdpr enumerate --method complete` lists them.
    pub solution: usize,
}

/// A sheet, as far as the grid shows it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sheet {
    /// Poses of the grid on it.
    pub poses: usize,
    /// Sign of the determinant all over it; `None`: it changes, which no certified link allows.
    pub det_sign: Option<i8>,
    /// Lowest corner of the box around it, m.
    pub low_m: [f64; 3],
    /// Highest corner, m.
    pub high_m: [f64; 3],
    /// Where its longest cable is the shortest, m.
    pub shortest: BestPose,
    /// Where its highest tension is the lowest, N.
    pub tension: BestPose,
    /// Where it is the furthest from folds: largest reciprocal condition.
    pub fold: BestPose,
    /// Poses that it holds on two branches or more.
    pub seams: Vec<[f64; 3]>,
    /// Links to neighbouring poses that are missing, by reason.
    pub borders: BTreeMap<Border, usize>,
    /// All solutions on it, in the order of the grid.
    pub members: Vec<Member>,
}

/// A solution on a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Member {
    /// Pose.
    pub position_m: [f64; 3],
    /// Which of the solutions there, counted from 1.
    pub solution: usize,
    /// Rest lengths, m.
    pub lengths_m: [f64; CABLES],
}

/// All sheets, the largest first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sheets {
    /// Poses of the grid.
    pub poses: usize,
    /// Of these, with solutions.
    pub reached: usize,
    /// Poses at which it is not decided whether these are all solutions.
    pub undecided: usize,
    /// The sheets.
    pub sheets: Vec<Sheet>,
}

/// For people.
impl fmt::Display for Sheets {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { poses, reached, undecided, sheets } = self;
        writeln!(f, "{poses} poses, {reached} with solutions; {} sheets", sheets.len())?;
        if *undecided > 0 {
            writeln!(f, "{undecided} poses at which it is not decided whether these are all")?;
        }
        for (number, sheet) in (1..).zip(sheets) {
            let share = 100.0 * sheet.poses as f64 / *poses as f64;
            let sign = match sheet.det_sign {
                Some(1) => "+",
                Some(_) => "-",
                None => "changes",
            };
            writeln!(
                f,
                "\nSheet {number}: {} poses, {share:.2} % of all, det {sign}",
                sheet.poses
            )?;
            let (low, high) = (sheet.low_m, sheet.high_m);
            let span = |axis: usize| format!("{:.3} .. {:.3}", low[axis], high[axis]);
            writeln!(f, "  within x {}, y {}, z {} m", span(0), span(1), span(2))?;
            let bests = [
                ("shortest longest cable", "m", sheet.shortest),
                ("lowest highest tension", "N", sheet.tension),
                ("furthest from a fold", "(1/condition)", sheet.fold),
            ];
            for (what, unit, BestPose { value, position_m: [x, y, z], solution }) in bests {
                writeln!(
                    f,
                    "  {what}: {value:.6} {unit} at --position {x},{y},{z} --solution {solution}"
                )?;
            }
            for (border, links) in &sheet.borders {
                writeln!(f, "  ends {border}: {links} links")?;
            }
            if let Some([x, y, z]) = sheet.seams.first() {
                let count = sheet.seams.len();
                writeln!(
                    f,
                    "  comes back on another branch at {count} poses, one at ({x}, {y}, {z}) m"
                )?;
            }
        }
        Ok(())
    }
}

/// All solutions of one pose.
struct Node {
    solutions: Vec<Solution>,
    is_complete: bool,
}

/// What a walk needs.
struct Walker {
    robot: Robot<f64, IrvineCatenary<f64>>,
    load: Load<f64>,
    limits: [CableLimits; CABLES],
    orientation: UnitQuaternion<f64>,
}

impl Sheets {
    /// The sheets of `robot` with elastic catenaries over the poses of `grid`, turned by a rotation vector. `progress`
    /// is told of each pose, twice.
    ///
    /// # Errors
    /// [`GeometryFault`]: the orientation is not finite. A pose with an attachment on its anchor has no solution.
    pub fn of(
        robot: &RobotDescription,
        grid: &Grid,
        rotation_vector_rad: [f64; 3],
        pool: &ThreadPool,
        mut progress: impl FnMut(),
    ) -> Result<Self, GeometryFault> {
        let request = |position_m: [f64; 3]| Request {
            robot: robot.clone(),
            position_m,
            rotation_vector_rad,
            model: ModelKind::Irvine,
        };
        request([0.0; 3]).pose()?;
        let numbers: Vec<usize> = (0..grid.poses()).collect();
        let options = Options { method: Method::Complete, ..Options::default() };
        let examine = |number: &usize| match request(grid.position_m(*number)).enumerate(options) {
            Ok(answer) => Node {
                is_complete: answer.is_complete(),
                solutions: answer.solutions.into_iter().map(|found| found.solution).collect(),
            },
            Err(_) => Node { is_complete: false, solutions: Vec::new() },
        };
        let mut nodes = Vec::with_capacity(numbers.len());
        in_order::for_each(pool, &numbers, examine, |node| {
            progress();
            nodes.push(node);
            Ok::<(), GeometryFault>(())
        })?;

        let walker = Walker {
            robot: robot.with_model(),
            load: robot.load,
            limits: robot.limits,
            orientation: UnitQuaternion::from_scaled_axis(Vector3::from(rotation_vector_rad)),
        };
        let firsts: Vec<usize> = nodes
            .iter()
            .scan(0, |count, node| Some(std::mem::replace(count, *count + node.solutions.len())))
            .collect();
        let all: usize = nodes.iter().map(|node| node.solutions.len()).sum();
        let mut sets = Sets::new(all);
        let mut borders: Vec<(usize, Border)> = Vec::new();
        let links = |number: &usize| walker.links(grid, &nodes, *number);
        in_order::for_each(pool, &numbers, links, |links: Vec<Link>| {
            progress();
            for Link { from, to, ends } in links {
                match ends {
                    Ok((a, b)) => sets.join(firsts[from] + a, firsts[to] + b),
                    Err((solution, border)) => borders.push((firsts[from] + solution, border)),
                }
            }
            Ok::<(), GeometryFault>(())
        })?;
        Ok(gather(grid, &nodes, &firsts, sets, &borders))
    }
}

/// What became of the way of one solution to a neighbouring pose.
struct Link {
    from: usize,
    to: usize,
    /// The solutions that are linked; or the one that is not, and why.
    ends: Result<(usize, usize), (usize, Border)>,
}

impl Walker {
    /// The links of all solutions of a pose to the next poses along x, y and z, and back from those that were not met.
    fn links(&self, grid: &Grid, nodes: &[Node], number: usize) -> Vec<Link> {
        let (indices, counts) = (grid.indices(number), grid.counts());
        let mut links = Vec::new();
        let mut stride = 1;
        for axis in 0..3 {
            let next = number + stride;
            stride *= counts[axis];
            if indices[axis] + 1 == counts[axis] {
                continue;
            }
            let mut met = vec![false; nodes[next].solutions.len()];
            for a in 0..nodes[number].solutions.len() {
                let ends = self.walk(grid, nodes, (number, a), next).map(|b| (a, b));
                if let Ok((_, b)) = ends {
                    met[b] = true;
                }
                links.push(Link { from: number, to: next, ends: ends.map_err(|why| (a, why)) });
            }
            for b in (0..met.len()).filter(|b| !met[*b]) {
                let ends = self.walk(grid, nodes, (next, b), number).map(|a| (b, a));
                links.push(Link { from: next, to: number, ends: ends.map_err(|why| (b, why)) });
            }
        }
        links
    }

    /// Follows a solution to another pose; which of the solutions there it is.
    fn walk(
        &self,
        grid: &Grid,
        nodes: &[Node],
        (from, solution): (usize, usize),
        to: usize,
    ) -> Result<usize, Border> {
        let start = &nodes[from].solutions[solution].states;
        let ends = [grid.position_m(from), grid.position_m(to)].map(Vector3::from);
        for ticks in TICKS {
            match self.follow(start, &ends, ticks) {
                Ok(forces) => {
                    let is_it = |states: &[CableState<f64>; CABLES]| {
                        let largest_n = states.iter().map(|s| s.force_n.amax()).fold(0.0, f64::max);
                        (0..CABLES).all(|i| {
                            (forces[i].force_n - states[i].force_n).amax() <= SAME * largest_n
                        })
                    };
                    let at = nodes[to].solutions.iter().position(|there| is_it(&there.states));
                    // Within the limits all the way, it must be there; at a limit that is a matter of rounding.
                    return at.ok_or(Border::Undecided);
                }
                Err(
                    Fault::TensionAbove { .. }
                    | Fault::TensionBelow { .. }
                    | Fault::LengthBeyondWinch { .. },
                ) => return Err(Border::Limit),
                Err(_) => {} // in shorter steps
            }
        }
        Err(Border::Fold)
    }

    /// The solution at the other end of a straight way, certified all along.
    fn follow(
        &self,
        start: &[CableState<f64>; CABLES],
        [from_m, to_m]: &[Vector3<f64>; 2],
        ticks: u32,
    ) -> Result<[CableState<f64>; CABLES], Fault<f64>> {
        let way_m = to_m - from_m;
        let tensions_n: f64 = start.iter().map(|state| state.force_n.norm()).sum();
        let settings = TrackerSettings {
            period_s: WALK_S / f64::from(ticks),
            largest_move_m: way_m.norm(),
            least_distance: LEAST_DISTANCE,
            fold_horizon_s: 0.0,
            largest_error_n: LARGEST_ERROR * tensions_n,
            cables: self.limits.map(|limits| TrackerLimits {
                shortest_m: 0.0,
                longest_m: limits.max_length_m,
                fastest_m_s: f64::INFINITY,
                lowest_tension_n: 0.0,
                highest_tension_n: limits.max_tension_n,
            }),
        };
        let twist = Twist { linear_m_s: way_m / WALK_S, angular_rad_s: Vector3::zeros() };
        let at = |tick: u32| -> Result<SetPoint<f64>, Fault<f64>> {
            let position_m = if tick == ticks {
                *to_m
            } else {
                from_m + way_m * (f64::from(tick) / f64::from(ticks))
            };
            let pose = Pose::new(position_m, self.orientation).map_err(Fault::Geometry)?;
            Ok(SetPoint { pose, twist })
        };
        let mut tracker = Tracker::start(self.robot, self.load, settings, &at(0)?, start)?;
        for tick in 1..=ticks {
            tracker.tick(&at(tick)?)?;
        }
        Ok(tracker.command().states())
    }
}

fn gather(
    grid: &Grid,
    nodes: &[Node],
    firsts: &[usize],
    mut sets: Sets,
    borders: &[(usize, Border)],
) -> Sheets {
    let mut sheets = BTreeMap::<usize, Sheet>::new();
    for (number, node) in nodes.iter().enumerate() {
        let position_m = grid.position_m(number);
        let mut seen = Vec::new();
        for (index, solution) in node.solutions.iter().enumerate() {
            let root = sets.root(firsts[number] + index);
            let here = Sheet::at(position_m, index + 1, solution);
            match sheets.get_mut(&root) {
                None => {
                    sheets.insert(root, here);
                }
                Some(sheet) => sheet.add(&here, seen.contains(&root)),
            }
            seen.push(root);
        }
    }
    for (solution, border) in borders {
        if let Some(sheet) = sheets.get_mut(&sets.root(*solution)) {
            *sheet.borders.entry(*border).or_default() += 1;
        }
    }
    let mut sheets: Vec<Sheet> = sheets.into_values().collect();
    sheets.sort_by_key(|sheet| std::cmp::Reverse(sheet.poses)); // stable: equal ones in the order of the grid
    Sheets {
        poses: nodes.len(),
        reached: nodes.iter().filter(|node| !node.solutions.is_empty()).count(),
        undecided: nodes.iter().filter(|node| !node.is_complete).count(),
        sheets,
    }
}

impl Sheet {
    /// Of one solution of one pose.
    fn at(position_m: [f64; 3], solution: usize, found: &Solution) -> Self {
        let best = |value| BestPose { value, position_m, solution };
        Self {
            poses: 1,
            det_sign: Some(if found.is_positive { 1 } else { -1 }),
            low_m: position_m,
            high_m: position_m,
            shortest: best(Choice::Shortest.measure(found)),
            tension: best(Choice::Tension.measure(found)),
            fold: best(1.0 / Choice::Fold.measure(found)),
            seams: Vec::new(),
            borders: BTreeMap::new(),
            members: vec![Member {
                position_m,
                solution,
                lengths_m: found.states.map(|state| state.rest_length_m),
            }],
        }
    }

    /// Adds what is known of another solution on it, at a pose that it holds already or not.
    fn add(&mut self, here: &Self, is_seam: bool) {
        if is_seam {
            if self.seams.last() != Some(&here.low_m) {
                self.seams.push(here.low_m);
            }
        } else {
            self.poses += 1;
        }
        self.members.extend(&here.members);
        if self.det_sign != here.det_sign {
            self.det_sign = None;
        }
        for axis in 0..3 {
            self.low_m[axis] = self.low_m[axis].min(here.low_m[axis]);
            self.high_m[axis] = self.high_m[axis].max(here.high_m[axis]);
        }
        let better = |mine: &mut BestPose, other: BestPose, is_better: fn(f64, f64) -> bool| {
            if is_better(other.value, mine.value) {
                *mine = other;
            }
        };
        better(&mut self.shortest, here.shortest, |a, b| a < b);
        better(&mut self.tension, here.tension, |a, b| a < b);
        better(&mut self.fold, here.fold, |a, b| a > b);
    }
}
