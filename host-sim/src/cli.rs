//! The command line.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressFinish, ProgressStyle};

use crate::branches::BranchesError;
use crate::cases::{CasesError, Overrides};
use crate::enumerate::{ModelKind, Request};
use crate::input_file::InputFileError;
use crate::journal::JournalError;
use crate::report::SlicesError;
use crate::robot_file::RobotDescription;
use crate::simulate::firmware::FirmwareError;
use crate::simulate::summary::Outcome;
use crate::simulate::{BeginError, TrajectoryError};
use crate::table::OrderError;
use crate::workspace::{Grid, GridError};
use cdpr_core::TableFault;

use branches::Branches;
use enumerate::Enumerate;

mod branches;
mod enumerate;
mod forward;
mod import;
mod report;
mod simulate;
mod table;
mod whole_file;
mod workspace;

/// The paper's pose with five solutions: position in m, mass in kg, linear density in kg/m.
const FIVE_SOLUTIONS: ([f64; 3], f64, f64) = ([0.96733, 11.3833, 1.65], 10.0, 0.004);

const THREADS_HELP: &str = "\
Threads; what is written is the same for any number [default: one for each core, or \
RAYON_NUM_THREADS from the environment]";

/// Inverse kinematics of cable-driven parallel robots with six deformable cables.
///
/// Without a command: all solutions at the paper's pose with five of them.
#[derive(Debug, Parser)]
#[command(name = "cdpr", version, args_conflicts_with_subcommands = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    enumerate: Enumerate,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Find the rest lengths of all six cables, all solutions, for a pose of the platform
    Enumerate(Enumerate),
    /// Follow all solutions of a pose over a range of one parameter, through folds
    Branches(Branches),
    /// Make a robot file from files of CASPR or WireX
    Import(Box<import::Import>),
    /// Warm-start tables for the controller: sheets, build, merge, inspect, verify, emit-rust, emit-c
    #[command(subcommand)]
    Table(table::TableCommand),
    /// Map where the platform can go: the solutions at every pose of a grid, with proof
    Workspace(Box<workspace::Workspace>),
    /// Find where the platform comes to rest on cables of given rest lengths
    Forward(forward::Forward),
    /// Show the solutions of a pose on one page for a browser, the robot in 3-D
    Report(Box<report::Report>),
    /// Drive a physical model of the robot along a trajectory with the controller, faults included
    Simulate(Box<simulate::Simulate>),
}

/// A robot, and what replaces values of its file.
#[derive(Debug, Args)]
struct Machine {
    /// Robot file (TOML) [default: the paper's MARIONET-CRANE]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Mass of the platform, kg [default: from the robot file, like all below]
    #[arg(long, value_name = "KG", value_parser = positive, allow_hyphen_values = true)]
    mass: Option<f64>,
    /// Mass of the cables per rest length, kg/m
    #[arg(long, value_name = "KG/M", value_parser = positive, allow_hyphen_values = true)]
    linear_density: Option<f64>,
    /// Axial stiffness EA of the cables, N
    #[arg(long, value_name = "N", value_parser = positive, allow_hyphen_values = true)]
    axial_stiffness: Option<f64>,
    /// Longest rest length of a cable, m
    #[arg(long, value_name = "M", value_parser = positive, allow_hyphen_values = true)]
    max_length: Option<f64>,
    /// Largest tension of a cable at either end, N
    #[arg(long, value_name = "N", value_parser = positive, allow_hyphen_values = true)]
    max_tension: Option<f64>,
}

/// A robot and a pose of it.
#[derive(Debug, Args)]
struct Question {
    #[command(flatten)]
    machine: Machine,
    /// Position of the platform origin, world frame, m
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    position: Option<[f64; 3]>,
    /// Orientation of the platform as rotation vector (axis times angle), rad [default: 0,0,0]
    #[arg(long, value_name = "RX,RY,RZ", value_parser = triple, allow_hyphen_values = true)]
    rotation_vector: Option<[f64; 3]>,
    /// Cable model
    #[arg(long, value_enum, default_value_t = ModelKind::Irvine)]
    model: ModelKind,
}

/// Poses on a grid.
#[derive(Debug, Args)]
struct Poses {
    /// Number of poses along x, y and z
    #[arg(long, value_name = "NX,NY,NZ", value_parser = counts)]
    grid: [usize; 3],
    /// Positions of the platform origin, world frame, m, both ends included, like 0..4,4..12,2
    #[arg(long, value_name = "X..X,Y..Y,Z..Z", value_parser = ranges, allow_hyphen_values = true)]
    region: [[f64; 2]; 3],
    /// Orientation of the platform as rotation vector (axis times angle), rad [default: 0,0,0]
    #[arg(long, value_name = "RX,RY,RZ", value_parser = triple, allow_hyphen_values = true)]
    rotation_vector: Option<[f64; 3]>,
}

impl Poses {
    fn grid(&self) -> Result<Grid, CliError> {
        let [low_m, high_m] = [0, 1].map(|end| self.region.map(|range| range[end]));
        Ok(Grid::new(self.grid, low_m, high_m)?)
    }

    fn rotation_vector(&self) -> [f64; 3] {
        self.rotation_vector.unwrap_or_default()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Tables for people
    Text,
    /// JSON for programs
    Json,
}

/// Why the command failed.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The robot file, or that of the faults, is not valid.
    #[error(transparent)]
    Robot(#[from] InputFileError),
    /// The file of cases is not valid.
    #[error(transparent)]
    Cases(#[from] CasesError),
    /// The pose cannot be asked for.
    #[error("--position: {0}")]
    Pose(#[from] cdpr_core::GeometryFault),
    /// There is no pose.
    #[error("--position or --cases is needed with --robot or --rotation-vector")]
    NoPose,
    /// The threads could not be started.
    #[error("--threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The branches cannot be followed over this range.
    #[error("--parameter, --from, --to: {0}")]
    Branches(#[from] BranchesError),
    /// The range of what varies is not known.
    #[error("{0} is needed: the value at the pose is not a positive, finite number")]
    NoRange(&'static str),
    /// What varies has a value as well.
    #[error("{0}: this is what varies, so --from and --to give its values")]
    Fixed(&'static str),
    /// A file cannot be written there.
    #[error("{option} {path}: {source}")]
    Place {
        /// The option that names it.
        option: &'static str,
        /// The file.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// The picture could not be made or written.
    #[error("writing the picture: {0}")]
    Plot(io::Error),
    /// A table cannot be made of what was asked for.
    #[error(transparent)]
    Order(#[from] OrderError),
    /// There is no such grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The folder has another map in it.
    #[error(
        "--out {path}: there is a map in it that was ordered otherwise (robot, region or options); remove it, or take another folder"
    )]
    OtherMap {
        /// The folder.
        path: String,
    },
    /// A map cannot be made of what was asked for.
    #[error(transparent)]
    Workspace(#[from] crate::workspace::OrderError),
    /// Work on disk.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The file is not a table.
    #[error("{path}: {fault}")]
    Table {
        /// The file.
        path: String,
        /// What is wrong.
        fault: TableFault,
    },
    /// A file could not be read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// A table failed its check.
    #[error("the table is wrong at {0} poses")]
    Wrong(usize),
    /// The trajectory is not valid.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// The workspace cannot be shown.
    #[error("--workspace: {0}")]
    Slices(#[from] SlicesError),
    /// A simulation does not begin.
    #[error(transparent)]
    Begin(#[from] BeginError),
    /// The firmware does not answer.
    #[error("--firmware: {0}")]
    Firmware(#[from] FirmwareError),
    /// The firmware is built for something else.
    #[error(
        "--firmware: it is built for another {0}; --mass, --max-length, --max-tension and the robot file must say what it knows"
    )]
    AnotherFirmware(&'static str),
    /// A robot is not imported.
    #[error(transparent)]
    Import(#[from] crate::import::ImportError),
    /// There is no place to rest.
    #[error(transparent)]
    Forward(#[from] crate::forward::ForwardError),
    /// A simulation cannot go on.
    #[error("{0}")]
    Simulation(String),
    /// The platform did not get to the end of the trajectory.
    #[error("the platform: {0}")]
    NotTracked(Outcome),
    /// Somebody wanted it to end.
    #[error("interrupted; the log is whole up to here")]
    Interrupted,
    /// The answer could not be written.
    #[error("writing the answer: {0}")]
    Output(#[from] io::Error),
}

impl CliError {
    /// Exit code: 2 for bad input, 1 for anything else; two that scripts wait for or expect, as they know them.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Output(_)
            | Self::Threads(_)
            | Self::Plot(_)
            | Self::Wrong(_)
            | Self::Simulation(_)
            | Self::NotTracked(_)
            | Self::Forward(_) => 1,
            Self::Interrupted => 130, // as a shell says it
            Self::Journal(JournalError::Busy { .. }) => 75, // EX_TEMPFAIL: the same may work later
            _ => 2,
        }
    }
}

/// Runs the command and writes its answers to `out`, in the order of the poses and each as soon as it
/// is known. All input is read and checked before the first byte is written.
///
/// # Errors
/// [`CliError`].
pub fn run(cli: Cli, out: &mut impl Write) -> Result<(), CliError> {
    match cli.command {
        Some(Command::Enumerate(options)) => options.run(out),
        Some(Command::Branches(options)) => options.run(out),
        Some(Command::Import(options)) => options.run(out),
        Some(Command::Table(command)) => command.run(out),
        Some(Command::Workspace(options)) => options.run(out),
        Some(Command::Forward(options)) => options.run(out),
        Some(Command::Report(options)) => options.run(out),
        Some(Command::Simulate(options)) => options.run(out),
        None => cli.enumerate.run(out),
    }
}

/// How far a run over `count` of `what` is, on stderr when that is a terminal; gone when the run ends.
fn progress_bar(count: usize, what: &str) -> ProgressBar {
    let target =
        if count > 1 { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let style = ProgressStyle::with_template(&format!(
        "{{wide_bar}} {{human_pos}} of {{human_len}} {what}, {{per_sec:1}}, {{eta}} left"
    ))
    .expect("a template without mistakes");
    ProgressBar::with_draw_target(Some(count as u64), target)
        .with_style(style)
        .with_finish(ProgressFinish::AndClear)
}

fn write_pretty(out: &mut impl Write, document: &impl serde::Serialize) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut *out, document)?;
    writeln!(out)
}

impl Machine {
    /// As it is in its file.
    fn described(&self) -> Result<RobotDescription, CliError> {
        robot(self.robot.as_deref())
    }

    /// With everything that the command line replaces.
    fn robot(&self) -> Result<RobotDescription, CliError> {
        Ok(self.overrides().apply(&self.described()?))
    }

    fn overrides(&self) -> Overrides {
        Overrides {
            mass_kg: self.mass,
            gravity_m_s2: None,
            linear_density_kg_m: self.linear_density,
            axial_stiffness_n: self.axial_stiffness,
            max_length_m: self.max_length,
            max_tension_n: self.max_tension,
        }
    }
}

impl Question {
    fn request(&self) -> Result<Request, CliError> {
        let (robot, overrides) = (self.machine.described()?, self.machine.overrides());
        let (position_m, overrides) = match self.position {
            Some(position) => (position, overrides),
            None if self.machine.robot.is_none() && self.rotation_vector.is_none() => {
                let (position, mass, density) = FIVE_SOLUTIONS;
                let paper = Overrides {
                    mass_kg: Some(mass),
                    linear_density_kg_m: Some(density),
                    ..Overrides::default()
                };
                (position, overrides.or(paper))
            }
            None => return Err(CliError::NoPose),
        };
        self.asked(&overrides.apply(&robot), position_m)
    }

    /// The same at a pose that is not this one's to give.
    fn request_at(&self, position_m: [f64; 3]) -> Result<Request, CliError> {
        self.asked(&self.machine.robot()?, position_m)
    }

    fn asked(&self, robot: &RobotDescription, position_m: [f64; 3]) -> Result<Request, CliError> {
        let request = Request {
            robot: robot.clone(),
            position_m,
            rotation_vector_rad: self.rotation_vector.unwrap_or_default(),
            model: self.model,
        };
        request.check()?;
        Ok(request)
    }
}

/// The robot of a file, or the paper's.
fn robot(path: Option<&Path>) -> Result<RobotDescription, CliError> {
    Ok(match path {
        Some(path) => RobotDescription::read(path)?,
        None => RobotDescription::marionet_crane(),
    })
}

fn finite(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err("is not finite".to_owned()),
        Err(_) => Err(format!("'{}' is not a number", text.trim())),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 { Ok(value) } else { Err("is not positive".to_owned()) }
}

fn triple(text: &str) -> Result<[f64; 3], String> {
    let numbers = text.split(',').map(finite).collect::<Result<Vec<_>, _>>()?;
    numbers
        .try_into()
        .map_err(|given: Vec<_>| format!("{} numbers given, three needed", given.len()))
}

/// Three ranges, each of two values in ascending order, or one value.
fn ranges(text: &str) -> Result<[[f64; 2]; 3], String> {
    let range = |part: &str| {
        let (low, high) = part.split_once("..").unwrap_or((part, part));
        let (low, high) = (finite(low)?, finite(high)?);
        if low <= high { Ok([low, high]) } else { Err(format!("'{part}' does not ascend")) }
    };
    let ranges = text.split(',').map(range).collect::<Result<Vec<_>, _>>()?;
    let three = |given: Vec<_>| format!("{} ranges given, three needed", given.len());
    ranges.try_into().map_err(three)
}

fn counts(text: &str) -> Result<[usize; 3], String> {
    let count = |part: &str| {
        part.trim().parse().map_err(|_| format!("'{}' is not a number of poses", part.trim()))
    };
    let counts = text.split(',').map(count).collect::<Result<Vec<usize>, _>>()?;
    counts
        .try_into()
        .map_err(|given: Vec<_>| format!("{} numbers given, three needed", given.len()))
}
