//! Work on disk, tile by tile: it goes on where it was killed, and parts of it can be done anywhere.
//!
//! The first line is the order, each further line one tile, as JSON. A line that was torn off at the end is made
//! anew. The lines of several files of one order are the whole when all tiles are there.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// What the line of an order begins with.
const ORDER_BEGINS: &[u8] = b"{\"format\":";

/// What is wanted, as it stands in the first line of a journal. Its first field is its `format`, and two orders
/// that are equal have the same tiles.
pub trait Job: Clone + PartialEq + Serialize + DeserializeOwned {
    /// What it makes, for messages: "a table".
    const MAKES: &'static str;
    /// What is made of one tile.
    type Tile: Serialize + DeserializeOwned;

    /// Number of tiles.
    fn tiles(&self) -> usize;

    /// Whether it can be worked on: to be asked of an order that was read.
    ///
    /// # Errors
    /// What is wrong with it.
    fn check(&self) -> Result<(), String>;

    /// Whether a tile that was read under this number can be one of this order.
    fn is_sound(&self, number: usize, tile: &Self::Tile) -> bool;
}

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

/// As a name: `2-of-8`.
impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-of-{}", self.number, self.parts)
    }
}

/// Why work on disk cannot be used or written.
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
    #[error("{path}, line {line}: not part of {makes}: {message}")]
    Content {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What it was taken for.
        makes: &'static str,
        /// What is wrong.
        message: String,
    },
    /// The file belongs to another order.
    #[error("{path}: part of {makes} that was ordered otherwise (robot, region or options differ)")]
    OtherOrder {
        /// The file.
        path: PathBuf,
        /// What was ordered.
        makes: &'static str,
    },
    /// Somebody else writes it.
    #[error("{path}: another process is at work on this part")]
    Busy {
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
}

#[derive(Serialize, Deserialize)]
struct Line<T> {
    tile: usize,
    made: T,
}

/// A file with the tiles that are done. One process at a time has it; the system lets go of it when that ends,
/// however it ends.
pub struct Journal<J: Job> {
    path: PathBuf,
    file: File,
    order: J,
    done: BTreeMap<usize, J::Tile>,
}

impl<J: Job> Journal<J> {
    /// Opens the work on `order` at `path`, or begins it.
    ///
    /// # Errors
    /// [`JournalError`].
    pub fn open(path: &Path, order: &J) -> Result<Self, JournalError> {
        let fail = |source| JournalError::Io { path: path.to_owned(), source };
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(fail)?;
        file.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => JournalError::Busy { path: path.to_owned() },
            TryLockError::Error(source) => fail(source),
        })?;
        let mut text = Vec::new();
        file.read_to_end(&mut text).map_err(fail)?;
        let mut done = BTreeMap::new();
        let mut kept = 0;
        if !text.is_empty() {
            let read = read::<J>(path, &text)?;
            kept = read.bytes;
            if let Some((known, lines)) = read.content {
                if known != *order {
                    return Err(other_order::<J>(path));
                }
                done = lines;
            }
        }
        file.set_len(kept as u64).map_err(fail)?;
        file.seek(SeekFrom::End(0)).map_err(fail)?;
        if kept == 0 {
            append(&mut file, order).map_err(fail)?;
        }
        Ok(Self { path: path.to_owned(), file, order: order.clone(), done })
    }

    /// The tiles of a shard that are still to be made.
    #[must_use]
    pub fn missing(&self, shard: Shard) -> Vec<usize> {
        let all = 0..self.order.tiles();
        all.filter(|n| shard.holds(*n) && !self.done.contains_key(n)).collect()
    }

    /// Keeps a tile that was made.
    ///
    /// # Errors
    /// [`JournalError::Io`].
    pub fn keep(&mut self, tile: usize, made: J::Tile) -> Result<(), JournalError> {
        let line = Line { tile, made };
        append(&mut self.file, &line)
            .map_err(|source| JournalError::Io { path: self.path.clone(), source })?;
        self.done.insert(tile, line.made);
        Ok(())
    }

    /// All tiles in their order, when all are there. They are handed out once; nobody else gets the journal until
    /// it is dropped or removed.
    ///
    /// # Errors
    /// [`JournalError::Incomplete`].
    pub fn finish(&mut self) -> Result<Vec<J::Tile>, JournalError> {
        all(&self.order, std::mem::take(&mut self.done))
    }

    /// Removes it, when what it was for is written.
    ///
    /// # Errors
    /// [`JournalError::Io`].
    pub fn remove(self) -> Result<(), JournalError> {
        match std::fs::remove_file(&self.path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(JournalError::Io { path: self.path.clone(), source: error })
            }
            _ => Ok(()),
        }
    }
}

/// The order of several files, and all its tiles.
///
/// # Errors
/// [`JournalError`].
pub fn merge<J: Job>(paths: &[PathBuf]) -> Result<(J, Vec<J::Tile>), JournalError> {
    let mut whole: Option<(J, BTreeMap<usize, J::Tile>)> = None;
    for path in paths {
        let fail = |source| JournalError::Io { path: path.clone(), source };
        let text = std::fs::read(path).map_err(fail)?;
        let Some((order, lines)) = read::<J>(path, &text)?.content else {
            return Err(content::<J>(path, 1, "empty".to_owned()));
        };
        match &mut whole {
            None => whole = Some((order, lines)),
            Some((known, all)) if *known == order => all.extend(lines),
            Some(_) => return Err(other_order::<J>(path)),
        }
    }
    let (order, done) = whole.ok_or(JournalError::Nothing)?;
    let tiles = all(&order, done)?;
    Ok((order, tiles))
}

fn all<J: Job>(
    order: &J,
    mut done: BTreeMap<usize, J::Tile>,
) -> Result<Vec<J::Tile>, JournalError> {
    let tiles = order.tiles();
    done.retain(|n, _| *n < tiles);
    let missing = tiles - done.len();
    if missing > 0 {
        return Err(JournalError::Incomplete { missing, tiles });
    }
    Ok(done.into_values().collect())
}

fn append(file: &mut File, line: &impl Serialize) -> io::Result<()> {
    let mut text = serde_json::to_vec(line)?;
    text.push(b'\n');
    file.write_all(&text)
}

fn content<J: Job>(path: &Path, line: usize, message: String) -> JournalError {
    JournalError::Content { path: path.to_owned(), line, makes: J::MAKES, message }
}

fn other_order<J: Job>(path: &Path) -> JournalError {
    JournalError::OtherOrder { path: path.to_owned(), makes: J::MAKES }
}

/// What is in a file, up to its last whole line.
struct Contents<J: Job> {
    bytes: usize,
    content: Option<(J, BTreeMap<usize, J::Tile>)>,
}

fn read<J: Job>(path: &Path, text: &[u8]) -> Result<Contents<J>, JournalError> {
    let bytes = text.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
    let refuse = |line, error: serde_json::Error| content::<J>(path, line, error.to_string());
    let mut lines = text[..bytes].split(|b| *b == b'\n').enumerate();
    let Some((_, first)) = lines.next().filter(|(_, line)| !line.is_empty()) else {
        // Not even an order was written; but leave alone what is something else.
        let common = text.len().min(ORDER_BEGINS.len());
        if text[..common] != ORDER_BEGINS[..common] {
            return Err(content::<J>(path, 1, "no order in the first line".to_owned()));
        }
        return Ok(Contents { bytes: 0, content: None });
    };
    let order: J = serde_json::from_slice(first).map_err(|error| refuse(1, error))?;
    order.check().map_err(|fault| content::<J>(path, 1, fault))?;
    let mut done = BTreeMap::new();
    for (index, line) in lines.filter(|(_, line)| !line.is_empty()) {
        let Line { tile, made } =
            serde_json::from_slice(line).map_err(|error| refuse(index + 1, error))?;
        if !order.is_sound(tile, &made) {
            return Err(content::<J>(path, index + 1, "no tile of this order".to_owned()));
        }
        done.insert(tile, made);
    }
    Ok(Contents { bytes, content: Some((order, done)) })
}
