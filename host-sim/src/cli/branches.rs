//! `cdpr branches`: how the solutions of a pose change with a parameter.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;

use super::whole_file::WholeFile;
use super::{CliError, Format, Question, positive, write_pretty};
use crate::branches::{Diagram, Parameter, Range};
use crate::output;

#[derive(Debug, Args)]
pub(super) struct Branches {
    #[command(flatten)]
    question: Question,
    /// What varies
    #[arg(long, value_enum)]
    parameter: Parameter,
    /// Lower end of its range, in its unit
    #[arg(long, value_name = "VALUE", value_parser = positive, allow_hyphen_values = true)]
    from: f64,
    /// Upper end of its range, in its unit
    #[arg(long, value_name = "VALUE", value_parser = positive, allow_hyphen_values = true)]
    to: f64,
    /// Draw the branches to a file (SVG) as well
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Output: tables, or JSON with the points of every branch
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

impl Branches {
    pub(super) fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let fixed = match self.parameter {
            Parameter::LinearDensity => (self.question.machine.linear_density, "--linear-density"),
            Parameter::AxialStiffness => {
                (self.question.machine.axial_stiffness, "--axial-stiffness")
            }
            Parameter::Mass => (self.question.machine.mass, "--mass"),
        };
        if let (Some(_), option) = fixed {
            return Err(CliError::Fixed(option));
        }
        let range = Range::new(self.from, self.to)?;
        let request = self.question.request()?;
        let picture =
            self.plot.as_deref().map(|path| WholeFile::new(path, "--plot")).transpose()?;
        let diagram = Diagram::trace(&request, self.parameter, range)?;
        if let Some(picture) = picture {
            let svg = output::diagram::svg(&request, &diagram)
                .map_err(|fault| CliError::Plot(io::Error::other(fault.to_string())))?;
            picture.write(svg.as_bytes()).map_err(CliError::Plot)?;
        }
        match self.format {
            Format::Text => write!(out, "{}", output::diagram::text(&request, &diagram))?,
            Format::Json => write_pretty(out, &output::diagram::json(&request, &diagram))?,
        }
        Ok(out.flush()?)
    }
}
