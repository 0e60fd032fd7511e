//! `cdpr simulate`: the controller against a physical plant.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use cdpr_core::Table;
use cdpr_link::Identity;
use clap::Args;

use super::whole_file::WholeFile;
use super::{CliError, Format, positive, progress_bar, write_pretty};
use crate::cases::Overrides;
use crate::output::run as output;
use crate::problem::Precision;
use crate::robot_file::RobotDescription;
use crate::simulate::controller::blueprint;
use crate::simulate::firmware::Firmware;
use crate::simulate::log::Log;
use crate::simulate::scenario::Fault;
use crate::simulate::{
    BeginError, Beginning, Controller, HostController, Sample, Scenario, Simulation, Summary,
    Trajectory,
};

#[derive(Debug, Args)]
pub(super) struct Simulate {
    /// Robot file (TOML) [default: the paper's MARIONET-CRANE]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Set-points (CSV): columns `time_s,x_m,y_m,z_m` and, unless the platform stays level, `qw,qx,qy,qz` or
    /// `rx_rad,ry_rad,rz_rad`
    #[arg(long, value_name = "FILE")]
    trajectory: PathBuf,
    /// Warm-start table to start and recover from [default: the solution with the shortest longest cable]; firmware
    /// has its own, and begins in the same place when this is it
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// What goes wrong (TOML)
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
    /// Log, CSV if its name ends so, else MCAP
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Look at the pose, and write a row, every so many ticks
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    log_every: u32,
    /// Picture of errors, tensions, lengths and certificates (SVG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Number type of the controller
    #[arg(long, value_enum, default_value_t = Precision::F32, conflicts_with = "firmware")]
    precision: Precision,
    /// A firmware image that decides in place of the host, in QEMU (`cargo in-the-loop` builds one)
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// QEMU's machine for it: mps2-an386 is a Cortex-M4F, mps2-an500 a Cortex-M7
    #[arg(long, value_name = "NAME", default_value = "mps2-an386", requires = "firmware")]
    machine: String,
    /// Mass of the platform that the controller believes in, kg [default: from the robot file, like all below]
    #[arg(long, value_name = "KG", value_parser = positive, allow_hyphen_values = true)]
    mass: Option<f64>,
    /// Longest rest length of a cable, m
    #[arg(long, value_name = "M", value_parser = positive, allow_hyphen_values = true)]
    max_length: Option<f64>,
    /// Largest tension of a cable at either end, N
    #[arg(long, value_name = "N", value_parser = positive, allow_hyphen_values = true)]
    max_tension: Option<f64>,
    /// What came of it, as text or JSON
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

impl Simulate {
    pub(super) fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let robot = super::robot(self.robot.as_deref())?;
        let overrides = Overrides {
            mass_kg: self.mass,
            max_length_m: self.max_length,
            max_tension_n: self.max_tension,
            ..Overrides::default()
        };
        let robot = overrides.apply(&robot);
        let trajectory = Trajectory::read(&self.trajectory)?;
        let control = &robot.control;
        trajectory.check(control.way_point_s, &robot.motion_limits(), control.period_s)?;
        let scenario = match &self.faults {
            Some(path) => Scenario::read(path)?,
            None => Scenario::default(),
        };
        let bytes = self.table_bytes(&scenario)?;
        let table = match (&self.table, &bytes) {
            (Some(path), Some(bytes)) => Some(
                Table::open(bytes)
                    .map_err(|fault| CliError::Table { path: path.display().to_string(), fault })?,
            ),
            _ => None,
        };
        let picture =
            self.plot.as_deref().map(|path| WholeFile::new(path, "--plot")).transpose()?;
        let beginning = Beginning::at(&robot, &trajectory, table.as_ref())?;
        let setup = Setup {
            robot: &robot,
            trajectory: &trajectory,
            scenario: &scenario,
            beginning: &beginning,
        };
        let finished = if let Some(image) = &self.firmware {
            self.drive(&setup, self.launch(image, &setup)?)?
        } else {
            let host = HostController::start(&robot, &beginning, table, self.precision)?;
            self.drive(&setup, host)?
        };
        if let Some(picture) = picture {
            let svg = output::svg(&robot.name, &finished.kept)
                .map_err(|fault| CliError::Plot(io::Error::other(fault.to_string())))?;
            picture.write(svg.as_bytes()).map_err(CliError::Plot)?;
        }
        let summary = &finished.summary;
        match self.format {
            Format::Text => output::text(out, summary, finished.wall_s)?,
            Format::Json => write_pretty(out, summary)?,
        }
        out.flush()?;
        match (finished.is_interrupted, summary.outcome.is_at_end()) {
            (true, _) => Err(CliError::Interrupted),
            (false, true) => Ok(()),
            (false, false) => Err(CliError::NotTracked(summary.outcome)),
        }
    }

    /// The firmware, once it has shown that it is built for this robot.
    fn launch(&self, image: &Path, setup: &Setup<'_>) -> Result<Firmware, CliError> {
        let mut firmware = Firmware::launch(&self.machine, image)?;
        let theirs = firmware.start(&setup.beginning.start)?;
        let ours = match theirs.number_bits {
            64 => blueprint::<f64>(setup.robot).map(|blueprint| Identity::of(&blueprint)),
            _ => blueprint::<f32>(setup.robot).map(|blueprint| Identity::of(&blueprint)),
        };
        match ours.map_err(BeginError::Robot)?.differs_in(&theirs) {
            Some(what) => Err(CliError::AnotherFirmware(what)),
            None => Ok(firmware),
        }
    }

    /// Runs to the end, and how long that took, s.
    fn drive<C: Controller>(&self, setup: &Setup<'_>, controller: C) -> Result<Finished, CliError>
    where
        C::Error: std::error::Error,
    {
        let Setup { robot, trajectory, scenario, beginning } = setup;
        let log = match &self.log {
            Some(path) => Some(Log::create(path).map_err(|source| CliError::Place {
                option: "--log",
                path: path.display().to_string(),
                source,
            })?),
            None => None,
        };
        let simulation = Simulation::new(robot, trajectory, scenario, beginning, controller)
            .map_err(|error| CliError::Simulation(error.to_string()))?;
        let mut run = Run {
            options: self,
            simulation,
            summary: Summary::new(robot.control.period_s),
            log,
            kept: Vec::new(),
            trajectory,
        };
        let began = Instant::now();
        let is_interrupted = run.go()?;
        let Run { simulation, mut summary, kept, log, .. } = run;
        summary.close(simulation.is_finished(), simulation.stops());
        log.map_or(Ok(()), Log::finish)?;
        Ok(Finished { summary, kept, is_interrupted, wall_s: began.elapsed().as_secs_f64() })
    }

    /// The table's bytes, with those bits flipped that the scenario wants so.
    fn table_bytes(&self, scenario: &Scenario) -> Result<Option<Vec<u8>>, CliError> {
        let Some(path) = &self.table else { return Ok(None) };
        let read = std::fs::read(path);
        let mut bytes =
            read.map_err(|source| CliError::Read { path: path.display().to_string(), source })?;
        for timed in &scenario.faults {
            if let Fault::Table { bit } = timed.fault
                && let Some(byte) = bytes.get_mut(bit / 8)
            {
                *byte ^= 1 << (bit % 8);
            }
        }
        Ok(Some(bytes))
    }
}

/// What a run is made of, besides the controller.
struct Setup<'a> {
    robot: &'a RobotDescription,
    trajectory: &'a Trajectory,
    scenario: &'a Scenario,
    beginning: &'a Beginning,
}

/// What is left of a run.
struct Finished {
    summary: Summary,
    kept: Vec<output::Kept>,
    is_interrupted: bool,
    /// How long it took.
    wall_s: f64,
}

/// A run under way.
struct Run<'a, C> {
    options: &'a Simulate,
    simulation: Simulation<'a, C>,
    summary: Summary,
    log: Option<Log>,
    /// For the picture.
    kept: Vec<output::Kept>,
    trajectory: &'a Trajectory,
}

impl<C: Controller> Run<'_, C>
where
    C::Error: std::error::Error,
{
    /// To its end; whether it was interrupted.
    fn go(&mut self) -> Result<bool, CliError> {
        let is_interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&is_interrupted);
        // Where it is set already nothing is lost: the log is whole up to the last row anyway.
        let _ = ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed));
        let every = u64::from(self.options.log_every);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, for a bar"
        )]
        let progress =
            progress_bar((100.0 * self.trajectory.duration_s()) as usize, "hundredths of a second");
        while let Some(sample) =
            self.simulation.step().map_err(|error| CliError::Simulation(error.to_string()))?
        {
            self.summary.add(&sample);
            let is_look = (self.summary.ticks - 1).is_multiple_of(every);
            if is_look || !sample.decision.note.is_empty() {
                self.look(&sample, is_look)?;
            }
            if is_look {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "positive, for a bar"
                )]
                progress.set_position((100.0 * sample.trajectory_s.unwrap_or_default()) as u64);
                if is_interrupted.load(Ordering::Relaxed) {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    fn look(&mut self, sample: &Sample, is_look: bool) -> Result<(), CliError> {
        let error = self.simulation.pose_error(sample);
        if is_look {
            self.summary.look(sample, error.as_ref());
            if self.options.plot.is_some() {
                self.kept.push(output::Kept::of(sample, error.as_ref()));
            }
        }
        if let Some(log) = &mut self.log {
            log.write(sample, error.as_ref())?;
        }
        Ok(())
    }
}
