//! `cdpr import`: a robot file from the files of other programs.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::whole_file::WholeFile;
use super::{CliError, positive};
use crate::import::{Given, Reading, read};
use crate::robot_file::RobotDescription;

const FILES_HELP: &str = "\
Of CASPR NAME_bodies.xml and NAME_cables.xml; of WireX (WireCenter, WiPy) its one XML file";

const SET_HELP: &str = "Which cable_set of a CASPR file [default: its default_cable_set]";

const PULLEYS_HELP: &str = "\
Take each pulley as the point that the file gives for it, where the cable would begin if its radius were zero. \
Without this a pulley is refused: cables begin at points here";

#[derive(Debug, Args)]
pub(super) struct Import {
    #[arg(required = true, value_name = "FILE", help = FILES_HELP)]
    files: Vec<PathBuf>,
    /// The robot file [default: to standard output]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Mass of the platform, kg [default: from the source, like all below; needed where it has none]
    #[arg(long, value_name = "KG", value_parser = positive, allow_hyphen_values = true)]
    mass: Option<f64>,
    /// Mass of the cables per rest length, kg/m
    #[arg(long, value_name = "KG/M", value_parser = positive, allow_hyphen_values = true)]
    linear_density: Option<f64>,
    /// Axial stiffness EA of the cables, N; inf for inextensible
    #[arg(long, value_name = "N", value_parser = positive_or_inf, allow_hyphen_values = true)]
    axial_stiffness: Option<f64>,
    /// Longest rest length of a cable, m; inf for no limit
    #[arg(long, value_name = "M", value_parser = positive_or_inf, allow_hyphen_values = true)]
    max_length: Option<f64>,
    /// Largest tension of a cable at either end, N; inf for no limit
    #[arg(long, value_name = "N", value_parser = positive_or_inf, allow_hyphen_values = true)]
    max_tension: Option<f64>,
    #[arg(long, help = SET_HELP, value_name = "ID")]
    cable_set: Option<String>,
    #[arg(long, help = "Take each pulley as a point", long_help = PULLEYS_HELP)]
    pulleys_as_points: bool,
}

impl Import {
    pub(super) fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let file = self.out.as_deref().map(|path| WholeFile::new(path, "--out")).transpose()?;
        let reading = Reading {
            cable_set: self.cable_set.clone(),
            pulleys_as_points: self.pulleys_as_points,
        };
        let robot = read(&self.files, &reading)?;
        let text = robot.robot_file(&Given {
            mass_kg: self.mass,
            linear_density_kg_m: self.linear_density,
            axial_stiffness_n: self.axial_stiffness,
            max_length_m: self.max_length,
            max_tension_n: self.max_tension,
        })?;
        // What cannot be read back is not handed out.
        RobotDescription::parse(&text, "the robot file made of it")?;
        let Some(file) = file else {
            out.write_all(text.as_bytes())?;
            return Ok(out.flush()?);
        };
        file.write(text.as_bytes()).map_err(|source| file.refuse(source))?;
        for note in robot.notes() {
            writeln!(out, "{note}")?;
        }
        Ok(out.flush()?)
    }
}

fn positive_or_inf(text: &str) -> Result<f64, String> {
    if text.trim() == "inf" { Ok(f64::INFINITY) } else { positive(text) }
}
