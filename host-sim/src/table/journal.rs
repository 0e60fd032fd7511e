//! A build on disk, tile by tile: it goes on where it was killed, and parts of it can be made anywhere.
//!
//! The first line is the order, each further line one tile, as JSON. A line that was torn off at the end is made
//! anew. The lines of several files of one order make a table when all tiles are there.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use rayon::ThreadPool;
use serde::{Deserialize, Serialize};

use super::cells::Plan;
use super::{Order, OrderError, Outcome};

/// What the line of an order begins with.
const ORDER_BEGINS: &[u8] = b"{\"format\":";

/// Part `number` of `parts`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    parts: usize,
}

impl Shard {
    /// All of it.
    pub const WHOLE: Self = Self { number: 1, parts: 1 };

    /// Whether a tile belongs to it. Neighbouring tiles, which take about as long, go to different parts.
    fn holds(self, tile: usize) -> bool {
        tile % self.parts == self.number - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let shard = text.split_once('/').and_then(|(number, parts)| {
            Some(Self { number: number.trim().parse().ok()?, parts: parts.trim().parse().ok()? })
        });
        shard
            .filter(|shard| (1..=shard.parts).contains(&shard.number))
            .ok_or_else(|| format!("'{text}' is not a part like 2/8"))
    }
}

/// Why a build on disk cannot be used or written.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// Reading or writing.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file is of something else.
    #[error("{path}, line {line}: not part of a table: {message}")]
    Content {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// The file belongs to another table.
    #[error("{path}: part of another table (robot, region, start or effort differ)")]
    OtherOrder {
        /// The file.
        path: PathBuf,
    },
    /// Not all tiles are there.
    #[error(
        "{missing} of {tiles} tiles are missing: not all parts are there, or one is not finished"
    )]
    Incomplete {
        /// How many.
        missing: usize,
        /// Of how many.
        tiles: usize,
    },
    /// No files.
    #[error("no parts to merge")]
    Nothing,
    /// The order itself.
    #[error(transparent)]
    Order(#[from] OrderError),
}

#[derive(Serialize, Deserialize)]
struct Line {
    tile: usize,
    plan: Plan,
}

/// A file with the tiles that are done.
pub struct Journal {
    path: PathBuf,
    file: File,
    order: Order,
    tiles: usize,
    done: BTreeMap<usize, Plan>,
}

impl Journal {
    /// Opens the build of `order` at `path`, or begins it.
    ///
    /// # Errors
    /// [`JournalError`].
    pub fn open(path: &Path, order: &Order) -> Result<Self, JournalError> {
        let fail = |source| JournalError::Io { path: path.to_owned(), source };
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(fail)?;
        let mut text = Vec::new();
        file.read_to_end(&mut text).map_err(fail)?;
        let tiles = order.tiles();
        let mut done = BTreeMap::new();
        let mut kept = 0;
        if !text.is_empty() {
            let read = read(path, &text)?;
            kept = read.bytes;
            if let Some((known, lines)) = read.content {
                if known != *order {
                    return Err(JournalError::OtherOrder { path: path.to_owned() });
                }
                done = lines;
            }
        }
        file.set_len(kept as u64).map_err(fail)?;
        file.seek(SeekFrom::End(0)).map_err(fail)?;
        if kept == 0 {
            append(&mut file, order).map_err(fail)?;
        }
        Ok(Self { path: path.to_owned(), file, order: order.clone(), tiles, done })
    }

    /// Number of tiles of a shard that are still to be made.
    #[must_use]
    pub fn missing(&self, shard: Shard) -> usize {
        self.todo(shard).len()
    }

    fn todo(&self, shard: Shard) -> Vec<usize> {
        (0..self.tiles).filter(|n| shard.holds(*n) && !self.done.contains_key(n)).collect()
    }

    /// Makes the tiles of a shard that are missing. `progress` is told of each.
    ///
    /// # Errors
    /// [`JournalError`].
    pub fn fill(
        &mut self,
        pool: &ThreadPool,
        shard: Shard,
        mut progress: impl FnMut(),
    ) -> Result<(), JournalError> {
        let todo = self.todo(shard);
        if todo.is_empty() {
            return Ok(());
        }
        let Self { path, file, order, done, .. } = self;
        order.cover(pool, &todo, |(tile, plan)| {
            let line = Line { tile, plan };
            append(file, &line)
                .map_err(|source| JournalError::Io { path: path.clone(), source })?;
            done.insert(tile, line.plan);
            progress();
            Ok(())
        })?
    }

    /// The table, when all tiles are there.
    ///
    /// # Errors
    /// [`JournalError`].
    pub fn finish(self) -> Result<Outcome, JournalError> {
        finish(&self.order, self.tiles, self.done)
    }
}

/// The table of several files of one order.
///
/// # Errors
/// [`JournalError`].
pub fn merge(paths: &[PathBuf]) -> Result<Outcome, JournalError> {
    let mut whole: Option<(Order, BTreeMap<usize, Plan>)> = None;
    for path in paths {
        let fail = |source| JournalError::Io { path: path.clone(), source };
        let text = std::fs::read(path).map_err(fail)?;
        let Some((order, lines)) = read(path, &text)?.content else {
            let message = "empty".to_owned();
            return Err(JournalError::Content { path: path.clone(), line: 1, message });
        };
        match &mut whole {
            None => whole = Some((order, lines)),
            Some((known, all)) if *known == order => all.extend(lines),
            Some(_) => return Err(JournalError::OtherOrder { path: path.clone() }),
        }
    }
    let (order, done) = whole.ok_or(JournalError::Nothing)?;
    finish(&order, order.tiles(), done)
}

fn finish(
    order: &Order,
    tiles: usize,
    done: BTreeMap<usize, Plan>,
) -> Result<Outcome, JournalError> {
    let missing = (0..tiles).filter(|n| !done.contains_key(n)).count();
    if missing > 0 {
        return Err(JournalError::Incomplete { missing, tiles });
    }
    let plans = done.into_iter().filter(|(n, _)| *n < tiles).map(|(_, plan)| plan).collect();
    Ok(order.assemble(plans)?)
}

fn append(file: &mut File, line: &impl Serialize) -> io::Result<()> {
    let mut text = serde_json::to_vec(line)?;
    text.push(b'\n');
    file.write_all(&text)
}

/// What is in a file, up to its last whole line.
struct Contents {
    bytes: usize,
    content: Option<(Order, BTreeMap<usize, Plan>)>,
}

fn read(path: &Path, text: &[u8]) -> Result<Contents, JournalError> {
    let bytes = text.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
    let say = |line: usize, message: String| JournalError::Content {
        path: path.to_owned(),
        line,
        message,
    };
    let refuse = |line: usize, error: serde_json::Error| say(line, error.to_string());
    let mut lines = text[..bytes].split(|b| *b == b'\n').enumerate();
    let Some((_, first)) = lines.next().filter(|(_, line)| !line.is_empty()) else {
        // Not even an order was written; but leave alone what is something else.
        let common = text.len().min(ORDER_BEGINS.len());
        if text[..common] != ORDER_BEGINS[..common] {
            return Err(say(1, "no order in the first line".to_owned()));
        }
        return Ok(Contents { bytes: 0, content: None });
    };
    let order: Order = serde_json::from_slice(first).map_err(|error| refuse(1, error))?;
    order.check().map_err(|fault| say(1, fault.to_string()))?;
    let mut done = BTreeMap::new();
    for (index, line) in lines.filter(|(_, line)| !line.is_empty()) {
        let Line { tile, plan } =
            serde_json::from_slice(line).map_err(|error| refuse(index + 1, error))?;
        if !plan.is_sound() {
            return Err(say(index + 1, "a coordinate that no pose has".to_owned()));
        }
        done.insert(tile, plan);
    }
    Ok(Contents { bytes, content: Some((order, done)) })
}
