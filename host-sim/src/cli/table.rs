//! `cdpr table`: build, merge, inspect, verify, emit-rust, emit-c.

use std::io::Write;
use std::num::NonZeroU16;
use std::path::{Path, PathBuf};

use cdpr_core::table::{COORDINATES, Gap, Node, Table};
use clap::{Args, Subcommand};
use serde::Serialize;

use super::whole_file::WholeFile;
use super::{
    CliError, Format, Machine, Poses, Question, THREADS_HELP, progress_bar, ranges, write_pretty,
};
use crate::choice::Choice;
use crate::in_order;
use crate::journal::{self, Journal, Shard};
use crate::problem::Precision;
use crate::table::{
    Effort, LEVEL, Led, Order, OrderError, Outcome, PoseBox, Sheets, Verification, verify,
};

const SHARD_HELP: &str = "\
Make only part K of N, counted from 1; --out is then a file for `cdpr table merge`, which gives the same bytes \
as a build in one";

#[derive(Debug, Subcommand)]
pub(super) enum TableCommand {
    /// List the sheets of solutions over a region: what a table can be of
    Sheets(Box<SheetsOf>),
    /// Build a table with proof; goes on where a build of the same was killed
    Build(Box<Build>),
    /// Put the parts of a build together
    Merge(Merge),
    /// Say what is in a table
    Inspect(Inspect),
    /// Check a table against the complete search at random poses
    Verify(Verify),
    /// Write a table as a constant in Rust
    EmitRust(Emit),
    /// Write a table as a constant in C
    EmitC(Emit),
}

#[derive(Debug, Args)]
pub(super) struct SheetsOf {
    #[command(flatten)]
    machine: Machine,
    #[command(flatten)]
    poses: Poses,
    /// As text or JSON
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[arg(long, help = THREADS_HELP, value_name = "N")]
    threads: Option<NonZeroU16>,
}

#[derive(Debug, Args)]
pub(super) struct Build {
    #[command(flatten)]
    question: Question,
    /// Positions of the platform origin, m, like 0..4,4..12,1..4
    #[arg(long, value_name = "X..X,Y..Y,Z..Z", value_parser = ranges, allow_hyphen_values = true)]
    region: [[f64; 2]; 3],
    /// Largest tilt about each axis, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    tilt_deg: f64,
    /// How the sheet is chosen among the solutions of --position [default position: the middle]
    #[arg(long, value_enum, default_value_t = Choice::Shortest)]
    choose: Choice,
    /// Or by hand: the number of a solution as `cdpr enumerate --method complete` lists them
    #[arg(long, value_name = "N", conflicts_with = "choose")]
    solution: Option<usize>,
    /// Newton steps that a seed may take
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=20))]
    steps: u8,
    /// How often a tile of a metre may be halved: more covers more, in more bytes
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u8).range(0..=60))]
    depth: u8,
    /// Leave out the cells that cover least, until the table has no more bytes than this; what is far from it is not made
    /// smaller, which takes less time
    #[arg(long, value_name = "N")]
    max_bytes: Option<u32>,
    /// The table
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[arg(long, help = "Make only part K of N, for `cdpr table merge`", long_help = SHARD_HELP, value_name = "K/N")]
    shard: Option<Shard>,
    /// What was made, as a table or JSON
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[arg(long, help = THREADS_HELP, value_name = "N")]
    threads: Option<NonZeroU16>,
}

#[derive(Debug, Args)]
pub(super) struct Merge {
    /// All parts, in any order
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// The table
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// What was made, as a table or JSON
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Debug, Args)]
pub(super) struct Inspect {
    /// The table
    #[arg(value_name = "FILE")]
    table: PathBuf,
    /// Text, or JSON with every place that is not covered
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Debug, Args)]
pub(super) struct Verify {
    /// The table
    #[arg(value_name = "FILE")]
    table: PathBuf,
    /// Random poses of the region
    #[arg(long, value_name = "N", default_value_t = 2000)]
    poses: usize,
    /// Where the random numbers begin
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Start where the table has no seed as well, by a certified way of at most so many parts from the nearest pose that
    /// it covers; 0 for not
    #[arg(long, value_name = "N", default_value_t = 0)]
    way_parts: u16,
    /// Arithmetic of the controller
    #[arg(long, value_enum, default_value_t)]
    precision: Precision,
    /// Text or JSON
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Debug, Args)]
pub(super) struct Emit {
    /// The table
    #[arg(value_name = "FILE")]
    table: PathBuf,
    /// Name of the constant
    #[arg(long, value_name = "NAME", default_value = "TABLE", value_parser = constant_name)]
    name: String,
}

impl TableCommand {
    pub(super) fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        match self {
            Self::Sheets(options) => options.run(out),
            Self::Build(options) => options.run(out),
            Self::Merge(options) => {
                let file = WholeFile::new(&options.out, "--out")?;
                let (order, plans) = journal::merge::<Order>(&options.parts)?;
                let outcome = order.assemble(plans)?;
                file.write(&outcome.bytes).map_err(|source| file.refuse(source))?;
                report(out, &outcome, options.format)
            }
            Self::Inspect(options) => options.run(out),
            Self::Verify(options) => options.run(out),
            Self::EmitRust(options) => options.run(Language::Rust, out),
            Self::EmitC(options) => options.run(Language::C, out),
        }
    }
}

impl SheetsOf {
    fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let (robot, grid) = (self.machine.robot()?, self.poses.grid()?);
        if robot.limits.iter().any(|limits| !limits.max_tension_n.is_finite()) {
            return Err(OrderError::Limits.into());
        }
        let pool = in_order::threads(self.threads.map(|n| n.get().into()))?;
        let progress = progress_bar(2 * grid.poses(), "half poses");
        let turn = self.poses.rotation_vector();
        let sheets = Sheets::of(&robot, &grid, turn, &pool, || progress.inc(1))?;
        progress.finish_and_clear();
        match self.format {
            Format::Json => write_pretty(out, &sheets)?,
            Format::Text => write!(out, "{sheets}")?,
        }
        Ok(out.flush()?)
    }
}

impl Build {
    fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let good_tilt = self.tilt_deg >= 0.0 && self.tilt_deg.is_finite();
        if !good_tilt {
            return Err(OrderError::Region.into());
        }
        let tilt = self.tilt_deg.to_radians().sin().max(LEVEL);
        let (mut low, mut high) = ([-tilt; COORDINATES], [tilt; COORDINATES]);
        for (k, [from, to]) in self.region.iter().enumerate() {
            (low[k], high[k]) = (*from, *to);
        }
        let middle = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        let request = self.question.request_at(self.question.position.unwrap_or(middle))?;
        let effort = Effort { steps: self.steps, depth: self.depth, max_bytes: self.max_bytes };
        let order = Order::new(&request, low, high, self.choose, self.solution, effort)?;
        let pool = in_order::threads(self.threads.map(|n| n.get().into()))?;
        let shard = self.shard.unwrap_or(Shard::WHOLE);
        // A part is its own journal; a whole table has one beside it until it is done.
        let (file, place) = match self.shard {
            Some(_) => (None, self.out.clone()),
            None => (Some(WholeFile::new(&self.out, "--out")?), beside(&self.out)),
        };
        let mut journal = Journal::open(&place, &order)?;
        let missing = journal.missing(shard);
        let progress = progress_bar(missing.len(), "tiles");
        order.cover(&pool, &missing, |(tile, plan)| {
            progress.inc(1);
            journal.keep(tile, plan)
        })??;
        progress.finish_and_clear();
        let Some(file) = file else { return Ok(()) };
        let outcome = order.assemble(journal.finish()?)?;
        file.write(&outcome.bytes).map_err(|source| file.refuse(source))?;
        journal.remove()?;
        report(out, &outcome, self.format)
    }
}

/// Where a build keeps what is done.
fn beside(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".part");
    PathBuf::from(name)
}

fn report(out: &mut impl Write, outcome: &Outcome, format: Format) -> Result<(), CliError> {
    if format == Format::Json {
        #[derive(Serialize)]
        struct Document<'a> {
            bytes: usize,
            #[serde(flatten)]
            outcome: &'a Outcome,
            seams: Vec<[f64; COORDINATES]>,
        }
        let seams = outcome.seams.iter().map(|seam| seam.pose).collect();
        write_pretty(out, &Document { bytes: outcome.bytes.len(), outcome, seams })?;
        return Ok(out.flush()?);
    }
    let Outcome { cells, seeds, steps, wanted, covered, .. } = outcome;
    writeln!(
        out,
        "{} bytes: {cells} cells with {seeds} seeds, each proven to need",
        outcome.bytes.len()
    )?;
    writeln!(out, "at most {steps} Newton steps in f32")?;
    if *wanted > 0 {
        let share = 100.0 * *covered as f64 / *wanted as f64;
        writeln!(out, "covered: {share:.2} % of the sheet within the region and the limits")?;
        writeln!(out, "({covered} of {wanted} sampled poses at which it was found)")?;
    }
    for (gap, count) in &outcome.gaps {
        writeln!(out, "  not covered, {count} places: {gap}")?;
    }
    match outcome.seams.first() {
        None => writeln!(out, "the sheet comes back to no pose on another branch")?,
        Some(seam) => {
            let p = seam.pose;
            writeln!(
                out,
                "the sheet comes back on another branch at {} pairs of cells, one at ({:.3}, {:.3}, {:.3}) m",
                outcome.seams.len(),
                p[0],
                p[1],
                p[2]
            )?;
        }
    }
    Ok(out.flush()?)
}

fn read(path: &Path) -> Result<Vec<u8>, CliError> {
    std::fs::read(path)
        .map_err(|source| CliError::Read { path: path.display().to_string(), source })
}

fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<Table<'a>, CliError> {
    Table::open(bytes).map_err(|fault| CliError::Table { path: path.display().to_string(), fault })
}

/// A place that is not covered.
#[derive(Serialize)]
struct Uncovered {
    low: [f64; COORDINATES],
    high: [f64; COORDINATES],
    reason: String,
}

#[derive(Serialize)]
struct Contents {
    bytes: usize,
    version: u16,
    steps: u8,
    words: usize,
    seeds: usize,
    cells: usize,
    low: [f32; COORDINATES],
    extent: [f32; COORDINATES],
    start_pose: [f32; COORDINATES],
    start_lengths_m: [f32; 6],
    max_lengths_m: [f32; 6],
    cables: [[f32; 8]; 6],
    load: [f32; 11],
    uncovered: Vec<Uncovered>,
}

impl Inspect {
    fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let bytes = read(&self.table)?;
        let table = open(&self.table, &bytes)?;
        let (low, extent) = (table.low().map(f64::from), table.extent().map(f64::from));
        let region = PoseBox { low, high: std::array::from_fn(|k| low[k] + extent[k]) };
        let mut cells = 0;
        let mut uncovered = Vec::new();
        let mut leave_out = |PoseBox { low, high }: PoseBox, gap: Gap| {
            uncovered.push(Uncovered { low, high, reason: gap.to_string() });
        };
        let mut stack = vec![(0, region)];
        let mut seen = 0;
        while let Some((index, part)) = stack.pop() {
            seen += 1;
            // In a tree no node is met twice.
            match table.node(index).filter(|_| seen <= table.words()) {
                Some(Node::Split { coordinate, lower, upper }) => {
                    let [below, above] = part.halves(coordinate);
                    stack.extend([(upper, above), (lower, below)]);
                }
                Some(Node::Half { coordinate, is_upper, inside, gap }) => {
                    let halves = part.halves(coordinate);
                    leave_out(halves[usize::from(!is_upper)], gap);
                    stack.push((inside, halves[usize::from(is_upper)]));
                }
                Some(Node::Trim { inside, .. }) => {
                    leave_out(part, Gap::Fold);
                    stack.push((inside, part));
                }
                Some(Node::Cell { .. }) => cells += 1,
                Some(Node::Nothing(gap)) => leave_out(part, gap),
                _ => {
                    let fault = cdpr_core::TableFault::Malformed;
                    let path = self.table.display().to_string();
                    return Err(CliError::Table { path, fault });
                }
            }
        }
        let (start_pose, start_lengths_m) = table.sheet();
        let contents = Contents {
            bytes: bytes.len(),
            version: cdpr_core::table::VERSION,
            steps: table.steps(),
            words: table.words(),
            seeds: table.seeds(),
            cells,
            low: table.low(),
            extent: table.extent(),
            start_pose,
            start_lengths_m,
            max_lengths_m: table.limits_m(),
            cables: std::array::from_fn(|i| table.cable(i)),
            load: table.load(),
            uncovered,
        };
        if self.format == Format::Json {
            write_pretty(out, &contents)?;
            return Ok(out.flush()?);
        }
        let c = &contents;
        writeln!(out, "warm-start table, version {}, {} bytes", c.version, c.bytes)?;
        writeln!(
            out,
            "{} cells, {} seeds, a tree of {} words; at most {} Newton steps",
            c.cells, c.seeds, c.words, c.steps
        )?;
        for (k, name) in
            ["x [m]", "y [m]", "z [m]", "turn x", "turn y", "turn z"].iter().enumerate()
        {
            writeln!(out, "  {name:7} {:12.6} .. {:.6}", region.low[k], region.high[k])?;
        }
        writeln!(
            out,
            "sheet through ({}, {}, {}) m with rest lengths {:?} m",
            start_pose[0], start_pose[1], start_pose[2], start_lengths_m
        )?;
        writeln!(out, "load {} kg, longest rest lengths {:?} m", c.load[0], c.max_lengths_m)?;
        let mut reasons = std::collections::BTreeMap::<&str, usize>::new();
        for place in &c.uncovered {
            *reasons.entry(&place.reason).or_default() += 1;
        }
        for (reason, count) in reasons {
            writeln!(out, "  not covered, {count} places: {reason}")?;
        }
        Ok(out.flush()?)
    }
}

impl Verify {
    fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let bytes = read(&self.table)?;
        let table = open(&self.table, &bytes)?;
        let found = verify(&table, self.poses, self.seed, self.precision, self.way_parts)
            .map_err(|fault| CliError::Table { path: self.table.display().to_string(), fault })?;
        if self.format == Format::Json {
            write_pretty(out, &found)?;
        } else {
            let Verification { poses, covered, uncertified, by_way, .. } = found;
            writeln!(out, "{poses} random poses, {} covered", covered.poses)?;
            write_led(out, &covered)?;
            writeln!(
                out,
                "  at {uncertified} of these poses the tracker's certificate is refused"
            )?;
            if self.way_parts > 0 {
                writeln!(
                    out,
                    "{} others reached from the nearest covered pose, in at most {} parts",
                    by_way.poses, self.way_parts
                )?;
                write_led(out, &by_way)?;
                let Verification { unreached, unreached_undecided, .. } = found;
                writeln!(
                    out,
                    "{unreached} others have a solution of the sheet's sign within its lengths, {unreached_undecided} undecided"
                )?;
                let [covered, reached] = found.shares().map(|share| 100.0 * share);
                writeln!(
                    out,
                    "of all poses with such a solution {covered:.2} % are covered, {reached:.2} % reached"
                )?;
            }
        }
        out.flush()?;
        match found.wrong() {
            0 => Ok(()),
            wrong => Err(CliError::Wrong(wrong)),
        }
    }
}

fn write_led(out: &mut impl Write, led: &Led) -> std::io::Result<()> {
    let Led { confirmed, wrong, undecided, with_others, .. } = led;
    writeln!(
        out,
        "  {confirmed} lead to a solution that the complete search proves, {wrong} do not, {undecided} undecided"
    )?;
    writeln!(out, "  {with_others} of these poses have other solutions as well")
}

/// How a constant array of bytes is written.
#[derive(Clone, Copy)]
enum Language {
    Rust,
    C,
}

impl Emit {
    fn run(&self, language: Language, out: &mut impl Write) -> Result<(), CliError> {
        let bytes = read(&self.table)?;
        let table = open(&self.table, &bytes)?;
        let (name, count) = (&self.name, bytes.len());
        let (seeds, steps) = (table.seeds(), table.steps());
        let end = match language {
            Language::Rust => {
                writeln!(out, "/// A warm-start table: {seeds} seeds, {steps} steps.")?;
                writeln!(out, "pub const {name}: [u8; {count}] = [")?;
                "];"
            }
            Language::C => {
                writeln!(out, "// A warm-start table: {seeds} seeds, {steps} steps.")?;
                writeln!(out, "#ifdef __cplusplus\nextern \"C\"\n#endif")?;
                writeln!(out, "const unsigned char {name}[{count}] = {{")?;
                "};"
            }
        };
        for line in bytes.chunks(20) {
            let numbers: Vec<String> = line.iter().map(u8::to_string).collect();
            writeln!(out, "    {},", numbers.join(", "))?;
        }
        writeln!(out, "{end}")?;
        Ok(out.flush()?)
    }
}

fn constant_name(text: &str) -> Result<String, String> {
    let mut characters = text.chars();
    let starts = characters.next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    if starts && characters.all(|c| c.is_ascii_alphanumeric() || c == '_') {
        Ok(text.to_owned())
    } else {
        Err("is not a name in Rust and C".to_owned())
    }
}
