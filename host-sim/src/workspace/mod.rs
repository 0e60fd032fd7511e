//! Where the platform can go: the solutions at every pose of a grid (the paper's section 4).
//!
//! An [`Order`] says what is wanted: a robot, a [`Grid`], and which solution of a pose is the best. Each pose gives
//! [`Findings`] by itself, so a map can be spread over machines and goes on where it was killed
//! ([`Journal`](crate::journal::Journal)): the same bytes however it came about.
//!
//! `grid` (the poses) → `findings` (of one pose) → `summary` (of all of them) and `file` (a row for each).

mod file;
mod findings;
mod grid;
mod summary;

use std::path::Path;

use cdpr_core::{CABLES, Cable, GeometryFault, Load, Robot};
use nalgebra::Vector3;
use rayon::ThreadPool;
use serde::{Deserialize, Serialize};

use crate::choice::Choice;
use crate::enumerate::{ModelKind, Request};
use crate::in_order;
use crate::input_file::{self, InputFileError};
use crate::journal::Job;
use crate::robot_file::{Body, CableLimits, CableMaterial, Control, RobotDescription, WinchDesign};
pub(crate) use file::of_cables;
pub use file::{csv, parquet};
pub use findings::{Best, Change, Findings, Status};
pub use grid::{Grid, GridError, MOST_POSES};
pub use summary::{Histogram, Needs, Summary, Told};

/// Poses of a tile: some 30 ms of work.
const TILE: usize = 64;

/// File with a row for each pose, in the folder of a map.
pub const TABLE: &str = "workspace.csv";
/// File with the order and the statistics, beside it.
pub const DOCUMENT: &str = "workspace.json";

/// Version of the journal of a map, and of its files.
const FORMAT: u32 = 1;

/// What a map is to be of. Two orders that are equal give the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order {
    format: u32,
    robot: String,
    cables: [CableRecord; CABLES],
    load: LoadRecord,
    /// The positions.
    pub grid: Grid,
    /// The orientation at all of them, rad.
    pub rotation_vector_rad: [f64; 3],
    /// Cable model.
    pub model: ModelKind,
    /// What makes one solution of a pose better than another.
    pub choice: Choice,
}

/// A cable in numbers; what is infinite is left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct CableRecord {
    anchor_m: [f64; 3],
    attachment_m: [f64; 3],
    linear_density_kg_m: f64,
    axial_stiffness_n: Option<f64>,
    max_length_m: Option<f64>,
    max_tension_n: Option<f64>,
}

/// A load in numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct LoadRecord {
    mass_kg: f64,
    center_of_mass_m: [f64; 3],
    gravity_m_s2: f64,
    force_n: [f64; 3],
    moment_nm: [f64; 3],
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum OrderError {
    /// The search for deformable cables would have no end.
    #[error(
        "--max-tension: cable {} has no limit of tension, which a map with deformable cables needs", .0 + 1
    )]
    NoTensionLimit(usize),
    /// The orientation.
    #[error("--rotation-vector: {0}")]
    Orientation(GeometryFault),
}

impl Order {
    /// An order for `robot`.
    ///
    /// # Errors
    /// [`OrderError`].
    pub fn new(
        robot: &RobotDescription,
        model: ModelKind,
        grid: Grid,
        rotation_vector_rad: [f64; 3],
        choice: Choice,
    ) -> Result<Self, OrderError> {
        let RobotDescription { limits, .. } = robot;
        if model != ModelKind::Rigid
            && let Some(cable) = limits.iter().position(|l| !l.max_tension_n.is_finite())
        {
            return Err(OrderError::NoTensionLimit(cable));
        }
        let order = Self::record(robot, model, grid, rotation_vector_rad, choice);
        order.request([0.0; 3]).pose().map_err(OrderError::Orientation)?;
        Ok(order)
    }

    /// All numbers, whether they make an order or not.
    fn record(
        robot: &RobotDescription,
        model: ModelKind,
        grid: Grid,
        rotation_vector_rad: [f64; 3],
        choice: Choice,
    ) -> Self {
        let RobotDescription { name, limits, load, .. } = robot;
        let finite = |value: f64| value.is_finite().then_some(value);
        let cables = std::array::from_fn(|i| {
            let Cable { anchor_m, attachment_m, model: material } = &robot.robot.cables()[i];
            CableRecord {
                anchor_m: (*anchor_m).into(),
                attachment_m: (*attachment_m).into(),
                linear_density_kg_m: material.linear_density_kg_m,
                axial_stiffness_n: finite(material.axial_stiffness_n),
                max_length_m: finite(limits[i].max_length_m),
                max_tension_n: finite(limits[i].max_tension_n),
            }
        });
        let load = LoadRecord {
            mass_kg: load.mass_kg,
            center_of_mass_m: load.center_of_mass_m.into(),
            gravity_m_s2: load.gravity_m_s2,
            force_n: load.force_n.into(),
            moment_nm: load.moment_nm.into(),
        };
        let robot = name.clone();
        Self { format: FORMAT, robot, cables, load, grid, rotation_vector_rad, model, choice }
    }

    /// The robot, as it was ordered.
    ///
    /// # Panics
    /// Never: it was checked when the order was made or read.
    #[must_use]
    pub fn robot(&self) -> RobotDescription {
        self.described().expect("checked when it was made or read")
    }

    fn described(&self) -> Result<RobotDescription, GeometryFault> {
        let or_none = |value: Option<f64>| value.unwrap_or(f64::INFINITY);
        let robot = Robot::new(self.cables.map(|cable| Cable {
            anchor_m: Vector3::from(cable.anchor_m),
            attachment_m: Vector3::from(cable.attachment_m),
            model: CableMaterial {
                linear_density_kg_m: cable.linear_density_kg_m,
                axial_stiffness_n: or_none(cable.axial_stiffness_n),
            },
        }))?;
        let LoadRecord { mass_kg, center_of_mass_m, gravity_m_s2, force_n, moment_nm } = self.load;
        Ok(RobotDescription {
            name: self.robot.clone(),
            robot,
            limits: self.cables.map(|cable| CableLimits {
                max_length_m: or_none(cable.max_length_m),
                max_tension_n: or_none(cable.max_tension_n),
            }),
            load: Load {
                mass_kg,
                center_of_mass_m: center_of_mass_m.into(),
                gravity_m_s2,
                force_n: force_n.into(),
                moment_nm: moment_nm.into(),
            },
            body: Body::default(),
            winch: WinchDesign::default(),
            control: Control::default(),
        })
    }

    /// What the map in a folder was ordered as; `None`: nobody has left it there.
    ///
    /// # Errors
    /// [`InputFileError`], naming file, line and what is wrong.
    pub fn of_map(folder: &Path) -> Result<Option<Self>, InputFileError> {
        #[derive(Deserialize)]
        struct Document {
            order: Order,
        }
        let path = folder.join(DOCUMENT);
        if !path.exists() {
            return Ok(None);
        }
        let (text, path) = input_file::read(&path)?;
        let refuse = |line: usize, message: String| InputFileError::Content {
            path: path.clone(),
            line,
            field: "order".to_owned(),
            message,
        };
        let Document { order } =
            serde_json::from_str(&text).map_err(|error| refuse(error.line(), error.to_string()))?;
        order.check().map_err(|fault| refuse(1, fault))?;
        Ok(Some(order))
    }

    /// In what the robot, the load, the orientation and the cables of `request` differ from those ordered.
    #[must_use]
    #[allow(clippy::float_cmp)] // the same is what has the same bits
    pub fn differs_from(&self, request: &Request) -> Vec<&'static str> {
        let Request { robot, rotation_vector_rad, model, .. } = request;
        let other = Self::record(robot, *model, self.grid, *rotation_vector_rad, self.choice);
        let cables = |is_same: fn(&CableRecord, &CableRecord) -> bool| {
            self.cables.iter().zip(&other.cables).all(|(a, b)| is_same(a, b))
        };
        let same = [
            ("robot", self.robot == other.robot),
            (
                "geometry",
                cables(|a, b| (a.anchor_m, a.attachment_m) == (b.anchor_m, b.attachment_m)),
            ),
            ("load", self.load == other.load),
            ("rotation vector", self.rotation_vector_rad == other.rotation_vector_rad),
            ("cable model", self.model == other.model),
            ("linear density", cables(|a, b| a.linear_density_kg_m == b.linear_density_kg_m)),
            ("axial stiffness", cables(|a, b| a.axial_stiffness_n == b.axial_stiffness_n)),
            (
                "limits",
                cables(|a, b| {
                    (a.max_length_m, a.max_tension_n) == (b.max_length_m, b.max_tension_n)
                }),
            ),
        ];
        same.iter().filter(|(_, is_same)| !is_same).map(|(what, _)| *what).collect()
    }

    fn request(&self, position_m: [f64; 3]) -> Request {
        let Self { rotation_vector_rad, model, .. } = *self;
        Request { robot: self.robot(), position_m, rotation_vector_rad, model }
    }

    /// Number of poses of a tile.
    #[must_use]
    pub fn poses_of(&self, tile: usize) -> usize {
        TILE.min(self.grid.poses().saturating_sub(tile.saturating_mul(TILE)))
    }

    /// Examines the tiles with the numbers `wanted`, on the threads of `pool`, and gives each to `take`, in order.
    /// A pose takes the same time however many there are.
    ///
    /// # Errors
    /// The first one of `take`.
    pub fn examine<E>(
        &self,
        pool: &ThreadPool,
        wanted: &[usize],
        take: impl FnMut((usize, Vec<Findings>)) -> Result<(), E>,
    ) -> Result<(), E> {
        let question = self.request([0.0; 3]);
        let examine = |tile: &usize| {
            let mut question = question.clone();
            let poses = (0..self.poses_of(*tile)).map(|n| {
                question.position_m = self.grid.position_m(tile * TILE + n);
                Findings::of(&question, self.choice)
            });
            (*tile, poses.collect())
        };
        in_order::for_each(pool, wanted, examine, take)
    }
}

impl Job for Order {
    const MAKES: &'static str = "a map of a workspace";
    type Tile = Vec<Findings>;

    fn tiles(&self) -> usize {
        self.grid.poses().div_ceil(TILE)
    }

    fn check(&self) -> Result<(), String> {
        if self.format != FORMAT {
            return Err(format!("format {} instead of {FORMAT}", self.format));
        }
        self.grid.check().map_err(|fault| fault.to_string())?;
        self.described().map_err(|fault| fault.to_string())?;
        self.request([0.0; 3]).pose().map_err(|fault| fault.to_string())?;
        Ok(())
    }

    fn is_sound(&self, number: usize, tile: &Vec<Findings>) -> bool {
        number < self.tiles()
            && tile.len() == self.poses_of(number)
            && tile.iter().all(|findings| findings.are_sound(self.model))
    }
}
