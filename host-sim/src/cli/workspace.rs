//! `cdpr workspace`: map, merge.

use std::io::{self, Write};
use std::num::NonZeroU16;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, Subcommand};
use serde::Serialize;

use super::whole_file::WholeFile;
use super::{CliError, Format, Machine, Poses, THREADS_HELP, progress_bar, write_pretty};
use crate::choice::Choice;
use crate::enumerate::ModelKind;
use crate::in_order;
use crate::journal::{self, Journal, Shard};
use crate::workspace::{self, Findings, Order, Summary, Told};

const LONG_ABOUT: &str = "\
Map where the platform can go: the solutions at every pose of a grid, with proof.

Writes to the folder --out a row for each pose as workspace.csv and workspace.parquet, and what was ordered with the \
statistics as workspace.json. Until it is done, what there is is kept there in part-1-of-1.jsonl: a run that was killed \
goes on where it stopped when it is given again, and ends in the same bytes.";

const SHARD_HELP: &str = "\
Make only part K of N, counted from 1, and leave it in the folder as part-K-of-N.jsonl for `cdpr workspace merge`, \
which gives the same bytes as a run in one";

const PART: &str = "Make only part K of N, for `cdpr workspace merge`";

#[derive(Debug, Args)]
#[command(long_about = LONG_ABOUT, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct Workspace {
    #[command(subcommand)]
    command: Option<WorkspaceCommand>,
    #[command(flatten)]
    machine: Machine,
    #[command(flatten)]
    poses: Option<Poses>,
    #[command(flatten)]
    map: Option<Map>,
}

#[derive(Debug, Subcommand)]
enum WorkspaceCommand {
    /// Put the parts of a map together
    Merge(Merge),
}

#[derive(Debug, Args)]
struct Map {
    /// Cable model
    #[arg(long, value_enum, default_value_t = ModelKind::Irvine)]
    model: ModelKind,
    /// Non-deformable cables only, the same as --model rigid: some thirty times faster
    #[arg(long, conflicts_with = "model")]
    rigid_only: bool,
    /// Which solution of a pose is the best: that whose numbers are kept
    #[arg(long, value_enum, default_value_t = Choice::Shortest)]
    choose: Choice,
    /// Folder for the map
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[arg(long, help = PART, long_help = SHARD_HELP, value_name = "K/N")]
    shard: Option<Shard>,
    /// The statistics, as tables or JSON
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[arg(long, help = THREADS_HELP, value_name = "N")]
    threads: Option<NonZeroU16>,
}

#[derive(Debug, Args)]
struct Merge {
    /// All parts, in any order
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// Folder for the map
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The statistics, as tables or JSON
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

impl Workspace {
    pub(super) fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        match (&self.command, &self.poses, &self.map) {
            (Some(WorkspaceCommand::Merge(merge)), ..) => merge.run(out),
            (None, Some(poses), Some(map)) => map.run(&self.machine, poses, out),
            _ => unreachable!("clap asks for the one or the other"),
        }
    }
}

impl Map {
    fn run(&self, machine: &Machine, poses: &Poses, out: &mut impl Write) -> Result<(), CliError> {
        let order = Order::new(
            &machine.robot()?,
            if self.rigid_only { ModelKind::Rigid } else { self.model },
            poses.grid()?,
            poses.rotation_vector(),
            self.choose,
        )?;
        let pool = in_order::threads(self.threads.map(|n| n.get().into()))?;
        let shard = self.shard.unwrap_or(Shard::WHOLE);
        let files = Files::new(&self.out, &order)?;
        let part = self.out.join(format!("part-{shard}.jsonl"));
        let mut journal = Journal::open(&part, &order)?;

        let missing = journal.missing(shard);
        let poses = missing.iter().map(|tile| order.poses_of(*tile)).sum();
        let progress = progress_bar(poses, "poses");
        let begun = Instant::now();
        order.examine(&pool, &missing, |(tile, findings)| {
            progress.inc(findings.len() as u64);
            journal.keep(tile, findings)
        })?;
        progress.finish_and_clear();
        let seconds = begun.elapsed().as_secs_f64();
        let rate =
            format!("{poses} poses in {seconds:.1} s, {:.0} a second", poses as f64 / seconds);

        if self.shard.is_some() {
            return Ok(());
        }
        let findings: Vec<Findings> = journal.finish()?.into_iter().flatten().collect();
        let summary = files.write(&order, &findings)?;
        journal.remove()?;
        report(out, &order, &summary, self.format)?;
        if self.format == Format::Text && poses > 0 {
            writeln!(out, "\n{rate}")?;
        }
        Ok(out.flush()?)
    }
}

impl Merge {
    fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let (order, tiles) = journal::merge::<Order>(&self.parts)?;
        let files = Files::new(&self.out, &order)?;
        let findings: Vec<Findings> = tiles.into_iter().flatten().collect();
        let summary = files.write(&order, &findings)?;
        report(out, &order, &summary, self.format)?;
        Ok(out.flush()?)
    }
}

/// What a map is written to.
struct Files {
    folder: PathBuf,
    csv: WholeFile,
    parquet: WholeFile,
    json: WholeFile,
}

/// What was ordered, and what came of it.
#[derive(Serialize)]
struct Document<'a> {
    order: &'a Order,
    summary: &'a Summary,
}

impl Files {
    /// In a folder that has no map, or one of the same order.
    fn new(folder: &Path, order: &Order) -> Result<Self, CliError> {
        std::fs::create_dir_all(folder).map_err(|source| misplaced(folder, source))?;
        if Order::of_map(folder)?.is_some_and(|other| other != *order) {
            return Err(CliError::OtherMap { path: folder.display().to_string() });
        }
        let file = |name| WholeFile::new(&folder.join(name), "--out");
        Ok(Self {
            folder: folder.to_owned(),
            csv: file(workspace::TABLE)?,
            parquet: file("workspace.parquet")?,
            json: file(workspace::DOCUMENT)?,
        })
    }

    /// Writes all, the document last: where it is, the others are of the same order. Returns the statistics.
    fn write(&self, order: &Order, findings: &[Findings]) -> Result<Summary, CliError> {
        let summary = Summary::of(findings);
        let write = || {
            self.csv
                .write_with(|file| workspace::csv(order, findings, io::BufWriter::new(file)))?;
            self.parquet.write_with(|file| {
                workspace::parquet(order, findings, file).map_err(io::Error::other)
            })?;
            let mut text = Vec::new();
            write_pretty(&mut text, &Document { order, summary: &summary })?;
            self.json.write(&text)
        };
        write().map_err(|source| misplaced(&self.folder, source))?;
        Ok(summary)
    }
}

fn misplaced(path: &Path, source: io::Error) -> CliError {
    CliError::Place { option: "--out", path: path.display().to_string(), source }
}

fn report(
    out: &mut impl Write,
    order: &Order,
    summary: &Summary,
    format: Format,
) -> io::Result<()> {
    match format {
        Format::Text => write!(out, "{}", Told(order, summary)),
        Format::Json => write_pretty(out, summary),
    }
}
