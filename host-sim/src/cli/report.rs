//! `cdpr report`: the solutions of a pose on one page for a browser.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::whole_file::WholeFile;
use super::{CliError, Question, positive};
use crate::branches::{Parameter, Range};
use crate::enumerate::{ModelKind, Options, Request};
use crate::output::counted;
use crate::report::{self, Curves, Slices};

/// From a tenth of the value at the pose to twice that, so that it is in the picture.
const DEFAULT_RANGE: (f64, f64) = (0.1, 2.0);

const OUT: &str = "--out";

#[derive(Debug, Args)]
pub(super) struct Report {
    #[command(flatten)]
    question: Question,
    /// What varies in the diagram of branches [default: linear-density; mass for massless cables]
    #[arg(long, value_enum)]
    parameter: Option<Parameter>,
    /// Lower end of its range, in its unit [default: a tenth of the value at the pose]
    #[arg(long, value_name = "VALUE", value_parser = positive, allow_hyphen_values = true)]
    from: Option<f64>,
    /// Upper end of its range, in its unit [default: twice the value at the pose]
    #[arg(long, value_name = "VALUE", value_parser = positive, allow_hyphen_values = true)]
    to: Option<f64>,
    /// Show slices of the workspace in DIR, as `cdpr workspace` writes it
    #[arg(long, value_name = "DIR")]
    workspace: Option<PathBuf>,
    /// Where the page goes (HTML; it needs no other file and no network)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl Report {
    pub(super) fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        if self.out.as_os_str() == "-" {
            let source =
                std::io::Error::other("a page is a file; it is not written to the terminal");
            return Err(CliError::Place { option: OUT, path: "-".to_owned(), source });
        }
        let request = self.question.request()?;
        let (parameter, range) = self.range(&request)?;
        let workspace = self.workspace.as_deref().map(Slices::read).transpose()?;
        let page = WholeFile::new(&self.out, OUT)?;
        let answer = request.enumerate(Options { kantorovich: true, ..Options::default() })?;
        let curves = Curves::trace(&request, parameter, range);
        let html = report::page(&request, &answer, &curves, workspace.as_ref())?;
        page.write(html.as_bytes())?;
        let found = counted(answer.solutions.len(), "solution");
        writeln!(out, "{}: {found}, {} kB", self.out.display(), html.len().div_ceil(1000))?;
        Ok(out.flush()?)
    }

    /// What varies, over which range.
    fn range(&self, request: &Request) -> Result<(Parameter, Range), CliError> {
        let massless = matches!(request.model, ModelKind::Elastic | ModelKind::Rigid);
        let usual = if massless { Parameter::Mass } else { Parameter::LinearDensity };
        let parameter = self.parameter.unwrap_or(usual);
        let value = parameter.of(request).into_iter().find(|value| value.is_finite());
        let end = |given: Option<f64>, ratio: f64, option| {
            let usual = value.map(|value| value * ratio).filter(|end| *end > 0.0);
            given.or(usual).ok_or(CliError::NoRange(option))
        };
        let from = end(self.from, DEFAULT_RANGE.0, "--from")?;
        let to = end(self.to, DEFAULT_RANGE.1, "--to")?;
        Ok((parameter, Range::new(from, to)?))
    }
}
