//! The station of the image `in_the_loop`, which a plant on the host asks over a serial line.

use core::fmt::{Display, Write as _};

use cdpr_core::Table;
use cdpr_link::{Identity, Note, Start, Station};

use crate::Number;
use crate::robot::{self, Model};

/// A station of this firmware's robot, disarmed, by the table in flash, and what it is built for.
///
/// # Errors
/// Why there is none, in words: mostly that the table has no seed for `start`.
#[expect(clippy::result_large_err, reason = "words without an allocator")]
pub fn station<T: Number + Display>(
    start: &Start,
) -> Result<(Station<'static, T, Model<T>>, Identity), Note> {
    let blueprint = robot::blueprint().map_err(in_words)?;
    let identity = Identity::of(&blueprint);
    let table = Table::open(robot::TABLE).map_err(in_words)?;
    let station = Station::from_table(blueprint, start, table).map_err(in_words)?;
    Ok((station, identity))
}

fn in_words(fault: impl Display) -> Note {
    let mut note = Note::new();
    let _ = write!(note, "{fault}"); // cut off
    note
}
