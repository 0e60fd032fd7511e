//! `cdpr enumerate`: the solutions of one pose or many.

use std::io::{self, IsTerminal, Write};
use std::num::NonZeroU16;
use std::path::{Path, PathBuf};

use clap::Args;

use super::whole_file::WholeFile;
use super::{CliError, Format, Question, THREADS_HELP, progress_bar};
use crate::cases;
use crate::continuation::Steps;
use crate::enumerate::{Enumeration, Method, Options, Request};
use crate::{in_order, output};

const CASES_HELP: &str = "\
Many poses from a file, JSON Lines or a JSON array, of objects with position_m and optionally \
rotation_vector_rad, mass_kg, gravity_m_s2, linear_density_kg_m, axial_stiffness_n, max_length_m, \
max_tension_n; what a case leaves out is taken from the command line, then from the robot file";

#[derive(Debug, Args)]
pub(super) struct Enumerate {
    #[command(flatten)]
    question: Question,
    /// Many poses from a file, JSON Lines or a JSON array
    #[arg(long, long_help = CASES_HELP, value_name = "FILE")]
    #[arg(conflicts_with_all = ["position", "rotation_vector"])]
    cases: Option<PathBuf>,
    /// How to search
    #[arg(long, value_enum, default_value_t = Method::Both)]
    method: Method,
    /// How sure each step of continuation is
    #[arg(long, value_enum, default_value_t = Steps::Certified)]
    steps: Steps,
    /// Follow every solution back to non-deformable cables as well (the inverse scheme)
    #[arg(long)]
    retrace: bool,
    /// Write the cable shapes of each solution as well: DIR/solution-K.csv, and solution-K.vtp (VTK)
    #[arg(long, value_name = "DIR", conflicts_with = "cases")]
    shapes: Option<PathBuf>,
    /// Output: tables, or JSON (one line for each case of --cases)
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[arg(long, help = THREADS_HELP, value_name = "N")]
    threads: Option<NonZeroU16>,
}

impl Enumerate {
    pub(super) fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let requests = self.requests()?;
        if let Some(folder) = &self.shapes {
            new_folder_for_shapes(folder)?;
        }
        let threads = in_order::threads(self.threads.map(|n| n.get().into()))?;
        let progress = progress_bar(requests.len(), "poses");
        // Where both are seen on one screen, the bar makes way for the answers.
        let one_screen = !progress.is_hidden() && io::stdout().is_terminal();
        in_order::for_each(
            &threads,
            &requests,
            |request| self.answer(request),
            |answer| {
                let answer = answer?;
                let mut write = || {
                    out.write_all(&answer)?;
                    out.flush() // what is done can be used while the rest is computed
                };
                if one_screen { progress.suspend(write) } else { write() }?;
                progress.inc(1);
                Ok(())
            },
        )
    }

    /// The answer to one request as it is written.
    fn answer(&self, request: &Request) -> Result<Vec<u8>, CliError> {
        let json = self.format == Format::Json;
        let answer = request.enumerate(Options {
            method: self.method,
            steps: self.steps,
            retrace: self.retrace,
            kantorovich: json,
        })?;
        if let Some(folder) = &self.shapes {
            write_shapes(folder, request, &answer)?;
        }
        let mut text = match self.format {
            Format::Text => output::text(request, &answer).into_bytes(),
            Format::Json => {
                let document = output::json(request, self.method, &answer);
                let write = if self.cases.is_some() {
                    serde_json::to_vec
                } else {
                    serde_json::to_vec_pretty
                };
                write(&document).map_err(io::Error::from)?
            }
        };
        text.push(b'\n');
        Ok(text)
    }

    fn requests(&self) -> Result<Vec<Request>, CliError> {
        let Some(path) = &self.cases else {
            return Ok(vec![self.question.request()?]);
        };
        let machine = &self.question.machine;
        let (robot, overrides) = (machine.described()?, machine.overrides());
        Ok(cases::read(Path::new(path), &robot, overrides, self.question.model)?)
    }
}

const SHAPES: &str = "--shapes";

/// Makes the folder for shapes, or refuses one with those of another answer.
fn new_folder_for_shapes(folder: &Path) -> Result<(), CliError> {
    let place = |path: &Path, source| CliError::Place {
        option: SHAPES,
        path: path.display().to_string(),
        source,
    };
    std::fs::create_dir_all(folder).map_err(|source| place(folder, source))?;
    let mut earlier = Vec::new();
    for entry in folder.read_dir().map_err(|source| place(folder, source))? {
        let path = entry.map_err(|source| place(folder, source))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("solution-") {
            earlier.push(path);
        }
    }
    match earlier.into_iter().min() {
        Some(path) => Err(place(&path, io::Error::other("there from another answer; remove it"))),
        None => Ok(()),
    }
}

/// The cable shapes of each solution, in two files.
fn write_shapes(folder: &Path, request: &Request, answer: &Enumeration) -> Result<(), CliError> {
    for (number, found) in (1..).zip(&answer.solutions) {
        let shapes = request.shapes(&found.solution)?;
        let table = output::shapes::csv(&shapes).map_err(io::Error::other)?;
        let picture = output::shapes::vtp(request, &shapes).into_bytes();
        for (kind, bytes) in [("csv", table), ("vtp", picture)] {
            let path = folder.join(format!("solution-{number}.{kind}"));
            WholeFile::new(&path, SHAPES)?.write(&bytes)?;
        }
    }
    Ok(())
}
