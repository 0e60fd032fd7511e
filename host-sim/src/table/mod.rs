//! Warm-start tables for the controller, built with proof: see [`cdpr_core::table`] for what they are.
//!
//! An [`Order`] says what is wanted. Its region is divided into tiles, each of which is covered with cells by
//! itself, on all cores and in any order, so that a build can be spread over machines and goes on where it was
//! killed ([`Journal`](crate::journal::Journal)). When all tiles are there, the cells are linked into the sheet
//! and the table is written: the same bytes however it came about.
//!
//! `survey` (where the sheet is, roughly), `outlook` (what is worth a proof), `border` (where folds are) and `proof` (of a
//! box of poses, in intervals: `place`, what is before a plane `patch`, force curves `curve`, what they sum to `sums`, as
//! functions of the pose `affine`, the matrix `columns`, what a step makes of that `equations`) →
//! `cells` (of one tile) → `journal` → `links` (of all cells) → `prune` (to so many bytes) → `file` (the bytes) →
//! `verify` (against the complete search).

mod affine;
mod border;
mod cells;
mod columns;
mod curve;
mod equations;
mod file;
mod links;
mod outlook;
mod patch;
mod place;
mod proof;
mod prune;
mod sharing;
mod sheets;
mod sums;
mod survey;
mod verify;

use std::collections::BTreeMap;

use cdpr_core::table::{COORDINATES, Gap, Table};
use cdpr_core::{CABLES, Cable, Charted, GeometryFault, IrvineCatenary, Load, Robot};
use serde::{Deserialize, Serialize};

use crate::choice::{Choice, ChoiceError, choose};
use crate::enumerate::{ModelKind, Request};
use crate::journal::Job;
use crate::robot_file::{CableLimits, RobotDescription};
pub use cells::Effort;
pub use cells::Plan;
use cells::Tiler;
pub use file::WriteFault;
pub use links::Seam;
use links::connected;
pub use place::PoseBox;
use proof::{Prover, is_same};
pub use sheets::{BestPose, Border, Member, Sheet, Sheets};
use survey::Survey;
pub use verify::{Led, Verification, verify};

/// The cable model of a table.
pub type Model = IrvineCatenary<f64>;

/// Tiles have no longer side than this, m, unless there were more than [`MOST_TILES`].
const TILE_M: f64 = 1.0;
const MOST_TILES: usize = 4096;
/// Half the extent of a coordinate that is not to vary: the turn vector of a level platform in f32.
pub const LEVEL: f64 = 1e-6;
/// A tile is not made smaller if it takes no more than its part of the bytes that a table may have, divided by this: others
/// take more than theirs.
const SPARE: usize = 2;
/// Poses at which the coverage is measured, at least, and for each cell.
const COVERAGE_SAMPLES: usize = 20_000;
const SAMPLES_OF_CELL: usize = 12;
/// Newton steps to the start on the robot whose parameters were rounded.
const START_STEPS: usize = 30;

/// Where a table is wanted.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// The poses.
    pub(crate) poses: PoseBox,
    /// Beyond these nothing is wanted.
    pub(crate) limits: [CableLimits; CABLES],
}

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum OrderError {
    /// The region has no inside, or turns too far.
    #[error(
        "--region, --tilt-deg: the region needs finite ends in ascending order, and tilts below 45 degrees"
    )]
    Region,
    /// The start is outside the region.
    #[error("--position: the pose is outside the region")]
    StartOutside,
    /// The sheet could not be chosen at the start.
    #[error("--position, --solution: {0}")]
    Choice(#[from] ChoiceError),
    /// The sheet could not be followed from the start.
    #[error("--position: the sheet cannot be followed from there; choose another pose")]
    Lost,
    /// The cell of the start was not covered.
    #[error(
        "no cell covers the start pose: choose one further from folds and limits, or more --depth"
    )]
    StartUncovered,
    /// The cell of the start does not fit.
    #[error("--max-bytes: too few for a table with the start pose in it")]
    StartLeftOut,
    /// The pose.
    #[error("--position: {0}")]
    Pose(#[from] GeometryFault),
    /// The robot, its parameters rounded to f32.
    #[error("the robot with its parameters rounded to f32: {0}")]
    Robot(GeometryFault),
    /// Another cable model than the elastic catenary.
    #[error("--model: tables are for the elastic catenary (irvine) only")]
    Model,
    /// A parameter that is needed.
    #[error("a limit of tension and cables with weight are needed for a table")]
    Limits,
    /// It does not fit.
    #[error(transparent)]
    Write(#[from] WriteFault),
}

/// What a table is to be of. Two orders that are equal give the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order {
    format: u32,
    cables: [[f32; 8]; CABLES],
    load: [f32; 11],
    low: [f32; COORDINATES],
    extent: [f32; COORDINATES],
    start: [f32; COORDINATES],
    /// Coordinates of the six force curves there.
    start_charts: [f64; CABLES],
    start_lengths_m: [f32; CABLES],
    max_lengths_m: [f32; CABLES],
    max_tensions_n: [f32; CABLES],
    effort: Effort,
}

/// What became of an order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// The table.
    #[serde(skip)]
    pub bytes: Vec<u8>,
    /// Cells.
    pub cells: usize,
    /// Different seeds.
    pub seeds: usize,
    /// Newton steps that suffice.
    pub steps: u8,
    /// Of the poses sampled, those at which the sheet was found within the limits (by following it, without
    /// proof), and how many of these are covered.
    pub wanted: usize,
    /// See `wanted`.
    pub covered: usize,
    /// Places without a cell, by reason.
    pub gaps: Vec<(String, usize)>,
    /// Where the sheet comes back to the same poses on another branch.
    #[serde(skip)]
    pub seams: Vec<Seam>,
}

impl Order {
    /// An order for `request`'s robot and model, the sheet through a solution at its pose.
    ///
    /// `low` and `high` are the corners of the region: position (m) and turn vector.
    ///
    /// # Errors
    /// [`OrderError`].
    pub fn new(
        request: &Request,
        low: [f64; COORDINATES],
        high: [f64; COORDINATES],
        choice: Choice,
        solution: Option<usize>,
        effort: Effort,
    ) -> Result<Self, OrderError> {
        if request.model != ModelKind::Irvine {
            return Err(OrderError::Model);
        }
        #[allow(clippy::cast_possible_truncation)] // that is what is stored
        let single = |value: f64| value as f32;
        let low = low.map(single);
        let high = high.map(single);
        let extent: [f32; COORDINATES] = std::array::from_fn(|k| high[k] - low[k]);
        let is_region = extent.iter().all(|e| *e > 0.0 && e.is_finite())
            && (3..COORDINATES).all(|k| low[k].abs().max(high[k].abs()) < 0.4083); // sqrt(1/6)
        if !is_region {
            return Err(OrderError::Region);
        }
        let RobotDescription { limits, load, .. } = &request.robot;
        let problem = request.problem::<Model>()?;
        let cables = std::array::from_fn(|i| {
            let Cable { anchor_m: a, attachment_m: b, model } = &problem.robot.cables()[i];
            [a.x, a.y, a.z, b.x, b.y, b.z, model.weight_n_m, model.compliance_per_n].map(single)
        });
        let physical = cables.iter().all(|c: &[f32; 8]| c[6] > 0.0)
            && limits.iter().all(|l| l.max_tension_n.is_finite());
        if !physical {
            return Err(OrderError::Limits);
        }
        let pose = request.pose()?;
        let Some(start) = cdpr_core::table::coordinates(&pose) else {
            return Err(OrderError::StartOutside);
        };
        let (c, f, m) = (&load.center_of_mass_m, &load.force_n, &load.moment_nm);
        let mut order = Self {
            format: u32::from(cdpr_core::table::VERSION),
            cables,
            load: [load.mass_kg, c.x, c.y, c.z, load.gravity_m_s2, f.x, f.y, f.z, m.x, m.y, m.z]
                .map(single),
            low,
            extent,
            start: start.map(single),
            start_charts: [0.0; CABLES],
            start_lengths_m: [0.0; CABLES],
            max_lengths_m: limits.map(|l| single(l.max_length_m)),
            max_tensions_n: limits.map(|l| single(l.max_tension_n)),
            effort,
        };
        machine(&order.cables, &order.load).map_err(OrderError::Robot)?;
        let region = order.region();
        if !region.poses.contains(&order.start.map(f64::from)) {
            return Err(OrderError::StartOutside);
        }
        let states = choose(request, choice, solution)?.states;
        let prover = order.prover();
        let charts = std::array::from_fn(|i| prover.robot().cables()[i].model.chart(&states[i]));
        let at = order.start.map(f64::from);
        let settled = prover.balance(&at).and_then(|b| prover.settle(&b, &charts, START_STEPS));
        let (charts, step) = settled.ok_or(OrderError::Lost)?;
        order.start_charts = charts;
        order.start_lengths_m = step.points.map(|point| single(point.state.rest_length_m));
        Ok(order)
    }

    fn region(&self) -> Region {
        let low = self.low.map(f64::from);
        let high = std::array::from_fn(|k| low[k] + f64::from(self.extent[k]));
        let limits = std::array::from_fn(|i| CableLimits {
            max_length_m: f64::from(self.max_lengths_m[i]),
            max_tension_n: f64::from(self.max_tensions_n[i]),
        });
        Region { poses: PoseBox { low, high }, limits }
    }

    fn machine(&self) -> (Robot<f64, Model>, Load<f64>) {
        machine(&self.cables, &self.load).expect("checked when it was made or read")
    }

    fn prover(&self) -> Prover {
        let (robot, load) = self.machine();
        Prover::new(&robot, &load)
    }

    fn tile_boxes(&self) -> Vec<PoseBox> {
        let mut tiles = Vec::new();
        self.tile(&self.region().poses, &mut |tile| {
            tiles.push(*tile);
            Plan::Nothing(Gap::Other)
        });
        tiles
    }

    /// Divides the region, and puts together what `make` makes of each tile.
    fn tile(&self, part: &PoseBox, make: &mut impl FnMut(&PoseBox) -> Plan) -> Plan {
        let whole = self.region().poses;
        let volume: f64 = (0..3).map(|k| whole.extent(k)).product();
        let side_m = TILE_M.max((volume / MOST_TILES as f64).cbrt());
        let longest = place::largest(0..3, |k| part.extent(k));
        // A side that was rounded is not halved once more.
        if part.extent(longest) <= side_m * (1.0 + 1e-6) {
            return make(part);
        }
        let halves = part.halves(longest).map(|half| self.tile(&half, make));
        Plan::of(longest, halves)
    }

    /// The table of all tiles. Cells are linked, and seams found, before any is left out for the size.
    ///
    /// # Errors
    /// [`OrderError`], but for those of an order.
    ///
    /// # Panics
    /// When `plans` are not those of this order.
    pub fn assemble(&self, plans: Vec<Plan>) -> Result<Outcome, OrderError> {
        let (prover, region) = (self.prover(), self.region());
        let survey = self.survey(&prover, &region).ok_or(OrderError::Lost)?;
        let start = self.start.map(f64::from);
        let mut plans = plans.into_iter();
        let plan = self.tile(&region.poses, &mut |_| plans.next().expect("a plan for each tile"));
        let (plan, seams) =
            connected(&prover, &survey, &region.poses, plan, (&start, &self.start_charts))
                .ok_or(OrderError::StartUncovered)?;
        let header = file::Header {
            low: self.low,
            extent: self.extent,
            sheet_pose: self.start,
            sheet_lengths_m: self.start_lengths_m,
            limits_m: self.max_lengths_m,
        };
        let write = |plan: &Plan| file::write(prover.robot(), prover.load(), &header, plan);
        let is_short =
            |bytes: &[u8]| self.effort.max_bytes.is_none_or(|most| bytes.len() <= most as usize);
        let found = plan.cells();
        let plan = match self.effort.max_bytes {
            Some(_) => prune::fitting(plan, |plan| write(plan).is_ok_and(|bytes| is_short(&bytes))),
            None => plan,
        };
        let bytes = write(&plan)?;
        let table = Table::open(&bytes).expect("what was just written");
        let at_start = place::pose::<f64>(&start).map_err(OrderError::Pose)?;
        // On a face of cells the reader's side may be covered by none.
        let is_left_out = plan.cells() < found;
        let lost = if is_left_out { OrderError::StartLeftOut } else { OrderError::StartUncovered };
        let seed = table.start_at(&at_start).map_err(|_| lost)?;
        if !is_short(&bytes) {
            return Err(OrderError::StartLeftOut);
        }
        // On a face of cells a reader may take another one than was taken for the first.
        let led = prover.led(&start, &seed, table.steps());
        if !led.is_some_and(|led| is_same(&self.start_charts, &led)) {
            return Err(OrderError::StartUncovered);
        }
        let (cells, seeds, steps) = (plan.cells(), table.seeds(), table.steps());
        let (mut wanted, mut covered) = (0, 0);
        for at in region.poses.spread(COVERAGE_SAMPLES.max(SAMPLES_OF_CELL * cells)) {
            if survey.solution(&at).is_some_and(|found| found.is_within) {
                wanted += 1;
                let pose = place::pose::<f64>(&at).map_err(OrderError::Pose)?;
                covered += usize::from(table.start_at(&pose).is_ok());
            }
        }
        let mut gaps = BTreeMap::new();
        links::gaps(&plan, &mut gaps);
        Ok(Outcome {
            cells,
            seeds,
            steps,
            wanted,
            covered,
            gaps: gaps.into_iter().map(|(gap, count)| (gap.to_string(), count)).collect(),
            seams,
            bytes,
        })
    }

    fn survey<'a>(&self, prover: &'a Prover, region: &'a Region) -> Option<Survey<'a>> {
        Survey::new(prover, region, &self.start.map(f64::from), &self.start_charts)
    }

    /// Covers tiles with the numbers `wanted`, on the threads of `pool`, and gives each to `take`, in order.
    ///
    /// # Errors
    /// [`OrderError::Lost`]; inside, the first one of `take`.
    pub fn cover<E>(
        &self,
        pool: &rayon::ThreadPool,
        wanted: &[usize],
        take: impl FnMut((usize, Plan)) -> Result<(), E>,
    ) -> Result<Result<(), E>, OrderError> {
        if wanted.is_empty() {
            return Ok(Ok(()));
        }
        let (prover, region) = (self.prover(), self.region());
        let survey = self.survey(&prover, &region).ok_or(OrderError::Lost)?;
        let tiles = self.tile_boxes();
        let (prover, survey, region, effort) = (&prover, &survey, &region.poses, self.effort);
        let most = effort.max_bytes.map_or(0, |bytes| bytes as usize);
        let spare_bytes = most / tiles.len() / SPARE;
        let tiler = Tiler { prover, survey, region, effort, spare_bytes };
        let questions: Vec<(usize, PoseBox)> = wanted.iter().map(|&n| (n, tiles[n])).collect();
        Ok(crate::in_order::for_each(
            pool,
            &questions,
            |(number, tile)| (*number, tiler.cover(tile)),
            take,
        ))
    }
}

impl Job for Order {
    const MAKES: &'static str = "a table";
    type Tile = Plan;

    fn tiles(&self) -> usize {
        self.tile_boxes().len()
    }

    fn check(&self) -> Result<(), String> {
        machine(&self.cables, &self.load).map(|_| ()).map_err(|fault| fault.to_string())
    }

    fn is_sound(&self, _number: usize, plan: &Plan) -> bool {
        plan.is_sound()
    }
}

/// Robot and load with the parameters of a table.
pub(crate) fn machine(
    cables: &[[f32; 8]; CABLES],
    load: &[f32; 11],
) -> Result<(Robot<f64, Model>, Load<f64>), GeometryFault> {
    let cables = cables.map(|c| {
        let c = c.map(f64::from);
        Cable {
            anchor_m: [c[0], c[1], c[2]].into(),
            attachment_m: [c[3], c[4], c[5]].into(),
            model: IrvineCatenary { weight_n_m: c[6], compliance_per_n: c[7] },
        }
    });
    let l = load.map(f64::from);
    let load = Load {
        mass_kg: l[0],
        center_of_mass_m: [l[1], l[2], l[3]].into(),
        gravity_m_s2: l[4],
        force_n: [l[5], l[6], l[7]].into(),
        moment_nm: [l[8], l[9], l[10]].into(),
    };
    Ok((Robot::new(cables)?, load))
}
