//! The command `cdpr`: see [`cdpr_host_sim::cli`].

use std::io::{self, ErrorKind, Write as _};
use std::process::ExitCode;

use cdpr_host_sim::cli::{self, Cli, CliError};
use clap::Parser;

fn main() -> ExitCode {
    match cli::run(Cli::parse(), &mut io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever reads has seen enough: `cdpr ... | head` is no error.
        Err(CliError::Output(error)) if error.kind() == ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            // Not eprintln!, which panics when nobody can be told.
            let _ = writeln!(io::stderr(), "cdpr: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
