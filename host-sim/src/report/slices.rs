//! The grid of poses that `cdpr workspace` writes, as the page shows it.

use std::collections::BTreeMap;
use std::path::Path;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use serde::Serialize;

use crate::input_file::{self, InputFileError};
use crate::workspace::{self, Grid, Order, Status, TABLE, of_cables};

/// The column that says how sure a row is.
const STATUS: &str = "status";
/// With these there may be solutions that are not counted; the page knows them by their place, from 1.
const UNSETTLED: [Status; 2] = [Status::Undecided, Status::RigidUndecided];
/// A page is at most about this large, bytes.
const LARGEST_PAGE: usize = 20_000_000;
/// What the page has besides, bytes.
const BESIDES: usize = 1_000_000;
/// Bytes of base64 for each byte.
const BASE64: (usize, usize) = (4, 3);
/// How far rows with the same index may differ in their coordinate, relative to the largest one.
const SAME: f64 = 1e-9;
/// No value, where values are small whole numbers.
const NONE: i8 = i8::MIN;

/// Why a workspace cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum SlicesError {
    /// The file is not what `cdpr workspace` writes.
    #[error(transparent)]
    File(#[from] InputFileError),
    /// The table and the order beside it have different grids.
    #[error("{path} and {document} are of different runs: {difference}")]
    OtherRun {
        /// The table.
        path: String,
        /// The file with the order.
        document: String,
        /// How the first differs from the second.
        difference: String,
    },
    /// The page would be too large.
    #[error(
        "{path}: {poses} poses would make the page larger than {} MB; it can show {most} of them, so take a coarser grid",
        LARGEST_PAGE / 1_000_000
    )]
    TooLarge {
        /// The file.
        path: String,
        /// Poses of the grid.
        poses: u64,
        /// How many can be shown.
        most: usize,
    },
}

/// What is known at each pose of a regular grid.
#[derive(Clone, Debug, Serialize)]
pub struct Slices {
    /// The coordinates of the grid, m: x, y, z.
    axes: [Vec<f64>; 3],
    /// Poses without a row.
    missing: usize,
    quantities: Vec<Quantity>,
    /// Whether what is known of a pose may not be all: signed bytes as base64,
    /// 0 where it is all, or the place in [`UNSETTLED`] from 1. Empty: it is all everywhere.
    unsettled: String,
    /// At how many poses.
    #[serde(skip)]
    undecided: usize,
    /// What was asked for, if that is known.
    #[serde(skip)]
    order: Option<Order>,
}

/// Something that has a value at each pose.
#[derive(Clone, Debug, Serialize)]
struct Quantity {
    key: &'static str,
    name: &'static str,
    unit: &'static str,
    #[serde(flatten)]
    values: Encoded,
}

/// Values as base64, x running first, then y.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", content = "data", rename_all = "lowercase")]
enum Encoded {
    /// 32-bit floats, little endian; NaN: none.
    Number(String),
    /// Signed bytes; -128: none.
    Count(String),
    /// Signed bytes, each the place of a name; -128: none.
    Name { names: Vec<String>, bytes: String },
}

/// How a quantity is made of the columns of the file.
enum Source {
    /// The largest of these columns.
    Largest(Vec<String>),
    /// A whole number.
    Count(&'static str),
    /// A word.
    Name(&'static str),
}

struct Wanted {
    key: &'static str,
    name: &'static str,
    unit: &'static str,
    source: Source,
}

/// What the page shows, in the order of the chooser.
fn wanted() -> Vec<Wanted> {
    let both: Vec<String> =
        ["anchor_tension", "attachment_tension"].iter().flat_map(|n| of_cables(n, "n")).collect();
    let one = |name: &str| Source::Largest(vec![name.to_owned()]);
    let row = |key, name, unit, source| Wanted { key, name, unit, source };
    vec![
        row("solutions", "number of solutions", "", Source::Count("solutions")),
        row(
            "longest_length",
            "longest rest length",
            "m",
            Source::Largest(of_cables("length", "m").into()),
        ),
        row("highest_tension", "highest tension", "N", Source::Largest(both)),
        row("fold_margin", "margin to a fold, 1/condition", "", one("fold_margin")),
        row("length_margin", "margin to the limit of length", "m", one("length_margin_m")),
        row("tension_margin", "margin to the limit of tension", "N", one("tension_margin_n")),
        row("change", "change against rigid cables", "", Source::Name("change")),
        row(STATUS, "status", "", Source::Name(STATUS)),
        row("degree", "degree", "", Source::Count("degree")),
        row("rigid_solutions", "solutions with rigid cables", "", Source::Count("rigid_solutions")),
        row("rigid_degree", "degree with rigid cables", "", Source::Count("rigid_degree")),
    ]
}

/// A file under reading, for messages.
struct Table<'a> {
    path: &'a str,
    header: csv::StringRecord,
}

impl Table<'_> {
    fn refuse(&self, line: usize, column: &str, message: impl Into<String>) -> InputFileError {
        InputFileError::Content {
            path: self.path.to_owned(),
            line,
            field: column.to_owned(),
            message: message.into(),
        }
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|column| column.trim() == name)
    }

    /// Where these columns are; nowhere, if there is none of them.
    fn all_or_none(&self, names: &[&str]) -> Result<Vec<usize>, InputFileError> {
        let found: Vec<usize> = names.iter().filter_map(|name| self.column(name)).collect();
        let missing = names.iter().find(|name| self.column(name).is_none());
        match missing {
            Some(missing) if !found.is_empty() => {
                let message = "there is no such column, but others of the same quantity";
                Err(self.refuse(1, missing, message))
            }
            _ => Ok(found),
        }
    }

    fn needed(&self, name: &str) -> Result<usize, InputFileError> {
        self.column(name).ok_or_else(|| self.refuse(1, name, "there is no such column"))
    }

    /// The value of a cell; an empty one has none.
    fn cell<T: std::str::FromStr>(
        &self,
        row: &csv::StringRecord,
        column: usize,
        what: &str,
    ) -> Result<Option<T>, InputFileError> {
        let text = row.get(column).unwrap_or_default().trim();
        if text.is_empty() {
            return Ok(None);
        }
        let refuse =
            |_| self.refuse(line(row), &self.header[column], format!("'{text}' is not {what}"));
        text.parse().map(Some).map_err(refuse)
    }

    fn number(
        &self,
        row: &csv::StringRecord,
        column: usize,
    ) -> Result<Option<f64>, InputFileError> {
        self.cell(row, column, "a number")
    }
}

fn line(row: &csv::StringRecord) -> usize {
    row.position().and_then(|place| usize::try_from(place.line()).ok()).unwrap_or(0)
}

/// One row: where it is in the grid, and its line in the file.
struct Place {
    indices: [usize; 3],
    line: usize,
}

impl Slices {
    /// Reads what `cdpr workspace` has written to `folder`.
    ///
    /// # Errors
    /// [`SlicesError`], naming file, line and column.
    pub fn read(folder: &Path) -> Result<Self, SlicesError> {
        let (text, path) = input_file::read(&folder.join(TABLE))?;
        let slices = Self::parse(&text, &path)?;
        let order = Order::of_map(folder)?;
        if let Some(difference) = order.as_ref().and_then(|order| slices.differs_from(&order.grid))
        {
            let document = folder.join(workspace::DOCUMENT).display().to_string();
            return Err(SlicesError::OtherRun { path, document, difference });
        }
        Ok(Self { order, ..slices })
    }

    /// The same from the text of the file; `path` is only for messages.
    ///
    /// # Errors
    /// As [`Slices::read`].
    pub fn parse(text: &str, path: &str) -> Result<Self, SlicesError> {
        let (table, rows) = rows(text, path)?;
        let (places, axes) = grid(&table, &rows)?;
        let [nx, ny, nz] = axes.each_ref().map(Vec::len);
        let poses = [nx, ny, nz].iter().fold(1_u64, |all, n| all.saturating_mul(*n as u64));

        let mut shown = Vec::new();
        for wanted in wanted() {
            let names: Vec<&str> = match &wanted.source {
                Source::Largest(names) => names.iter().map(String::as_str).collect(),
                Source::Count(name) | Source::Name(name) => vec![name],
            };
            let columns = table.all_or_none(&names)?;
            let filled = |row: &csv::StringRecord| {
                columns.iter().any(|&c| row.get(c).is_some_and(|cell| !cell.trim().is_empty()))
            };
            if rows.iter().any(filled) {
                shown.push((wanted, columns));
            }
        }
        if shown.is_empty() {
            return Err(table.refuse(1, "solutions", "no column has a value to show").into());
        }
        let pose_bytes: usize = shown
            .iter()
            .map(|(wanted, _)| if matches!(wanted.source, Source::Largest(_)) { 4 } else { 1 })
            .sum::<usize>()
            + usize::from(table.column(STATUS).is_some()); // for what is unsettled
        let most = (LARGEST_PAGE - BESIDES) * BASE64.1 / BASE64.0 / pose_bytes;
        if poses > most as u64 {
            return Err(SlicesError::TooLarge { path: path.to_owned(), poses, most });
        }

        let mut taken = vec![0; nx * ny * nz];
        let index = |[ix, iy, iz]: [usize; 3]| (iz * ny + iy) * nx + ix;
        for place in &places {
            let line = std::mem::replace(&mut taken[index(place.indices)], place.line);
            if line != 0 {
                let message = format!("the pose of line {line} again");
                return Err(table.refuse(place.line, "ix, iy, iz", message).into());
            }
        }
        let missing = taken.iter().filter(|line| **line == 0).count();
        let at: Vec<usize> = places.iter().map(|place| index(place.indices)).collect();
        let mut quantities = Vec::new();
        for (Wanted { key, name, unit, source }, columns) in shown {
            let values = match source {
                Source::Largest(_) => numbers(&table, &rows, &at, taken.len(), &columns)?,
                Source::Count(_) => counts(&table, &rows, &at, taken.len(), columns[0])?,
                Source::Name(_) => words(&table, &rows, &at, taken.len(), columns[0])?,
            };
            quantities.push(Quantity { key, name, unit, values });
        }
        let (unsettled, undecided) = unsettled(&table, &rows, &at, taken.len());
        Ok(Self { axes, missing, quantities, unsettled, undecided, order: None })
    }

    /// How its grid is another one than was ordered, in words.
    fn differs_from(&self, ordered: &Grid) -> Option<String> {
        let (found, counts) = (self.counts(), ordered.counts());
        if found != counts {
            return Some(format!("{found:?} poses along x, y, z instead of {counts:?}"));
        }
        (0..3).find_map(|axis| {
            let expected = (0..counts[axis]).map(|k| {
                let mut number = k; // of the pose on this axis of the grid
                number *= counts[..axis].iter().product::<usize>();
                ordered.position_m(number)[axis]
            });
            let size_m = ordered.low_m()[axis].abs().max(ordered.high_m()[axis].abs());
            let name = ["x", "y", "z"][axis];
            expected.zip(&self.axes[axis]).find_map(|(expected, found)| {
                let is_other = (expected - found).abs() > SAME * size_m;
                is_other.then(|| format!("{name} {found} m instead of {expected} m"))
            })
        })
    }

    /// How many poses the grid has along x, y, z.
    #[must_use]
    pub fn counts(&self) -> [usize; 3] {
        self.axes.each_ref().map(Vec::len)
    }

    /// What was asked for, if that is known.
    #[must_use]
    pub fn order(&self) -> Option<&Order> {
        self.order.as_ref()
    }

    /// At how many poses it is undecided whether there are more solutions.
    #[must_use]
    pub fn undecided(&self) -> usize {
        self.undecided
    }

    /// How many poses of the grid have no row in the file.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.missing
    }
}

/// The header and all rows, whatever their width.
fn rows<'a>(
    text: &str,
    path: &'a str,
) -> Result<(Table<'a>, Vec<csv::StringRecord>), InputFileError> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
    let mut table = Table { path, header: csv::StringRecord::new() };
    let broken = |table: &Table<'_>, fault: &csv::Error| {
        let line = fault.position().and_then(|place| usize::try_from(place.line()).ok());
        table.refuse(line.unwrap_or(1), "row", fault.to_string())
    };
    let header = reader.headers().map_err(|fault| broken(&table, &fault))?.clone();
    table.header = header;
    let rows: Vec<_> =
        reader.records().collect::<Result<_, _>>().map_err(|fault| broken(&table, &fault))?;
    if let Some(row) = rows.iter().find(|row| row.len() != table.header.len()) {
        let message = format!("{} cells, {} in the header", row.len(), table.header.len());
        return Err(table.refuse(line(row), "row", message));
    }
    Ok((table, rows))
}

/// Where each row is in the grid, and the coordinates of the grid.
fn grid(
    table: &Table<'_>,
    rows: &[csv::StringRecord],
) -> Result<(Vec<Place>, [Vec<f64>; 3]), InputFileError> {
    let names = [("ix", "x_m"), ("iy", "y_m"), ("iz", "z_m")];
    let mut columns = [(0, 0); 3];
    for (column, (index, coordinate)) in columns.iter_mut().zip(names) {
        *column = (table.needed(index)?, table.needed(coordinate)?);
    }
    if rows.is_empty() {
        return Err(table.refuse(1, "ix", "there are no poses"));
    }
    let mut known: [BTreeMap<usize, f64>; 3] = Default::default();
    let mut places = Vec::with_capacity(rows.len());
    for row in rows {
        let mut indices = [0; 3];
        for (axis, (at, coordinate)) in columns.into_iter().enumerate() {
            let empty = |column: usize| table.refuse(line(row), &table.header[column], "is empty");
            let index: u32 =
                table.cell(row, at, "a whole number from 0")?.ok_or_else(|| empty(at))?;
            indices[axis] = index as usize;
            let value = table.number(row, coordinate)?.ok_or_else(|| empty(coordinate))?;
            if !value.is_finite() {
                return Err(table.refuse(line(row), names[axis].1, "is not finite"));
            }
            let first = *known[axis].entry(indices[axis]).or_insert(value);
            if (first - value).abs() > SAME * first.abs().max(value.abs()) {
                let message =
                    format!("{value} m, but {first} m in another row of {} {index}", names[axis].0);
                return Err(table.refuse(line(row), names[axis].1, message));
            }
        }
        places.push(Place { indices, line: line(row) });
    }
    for (axis, known) in known.iter().enumerate() {
        if let Some(gap) = (0..).zip(known.keys()).find_map(|(k, key)| (k != *key).then_some(k)) {
            let message = format!("no row has {gap}, so the grid is not regular");
            return Err(table.refuse(1, names[axis].0, message));
        }
        if !known.values().is_sorted_by(|a, b| a < b) {
            return Err(table.refuse(1, names[axis].1, "does not grow with its index"));
        }
    }
    Ok((places, known.map(|known| known.into_values().collect())))
}

fn numbers(
    table: &Table<'_>,
    rows: &[csv::StringRecord],
    at: &[usize],
    poses: usize,
    columns: &[usize],
) -> Result<Encoded, InputFileError> {
    let mut values = vec![f32::NAN; poses];
    for (row, place) in rows.iter().zip(at) {
        let cells = columns.iter().map(|&column| table.number(row, column));
        let cells: Vec<Option<f64>> = cells.collect::<Result<_, _>>()?;
        if cells.iter().all(Option::is_none) {
            continue;
        }
        let mut largest = f64::NEG_INFINITY;
        for (cell, &column) in cells.into_iter().zip(columns) {
            let value = cell.filter(|value| !value.is_nan()).ok_or_else(|| {
                let message = "has no value, but others of the same quantity have";
                table.refuse(line(row), &table.header[column], message)
            })?;
            largest = largest.max(value);
        }
        #[allow(clippy::cast_possible_truncation)] // what is shown has six digits
        let largest = largest as f32;
        values[*place] = largest;
    }
    let bytes: Vec<u8> = values.into_iter().flat_map(f32::to_le_bytes).collect();
    Ok(Encoded::Number(BASE64_STANDARD.encode(bytes)))
}

fn base64_of(values: &[i8]) -> String {
    BASE64_STANDARD.encode(values.iter().map(|value| value.cast_unsigned()).collect::<Vec<_>>())
}

fn counts(
    table: &Table<'_>,
    rows: &[csv::StringRecord],
    at: &[usize],
    poses: usize,
    column: usize,
) -> Result<Encoded, InputFileError> {
    let mut values = vec![NONE; poses];
    for (row, place) in rows.iter().zip(at) {
        if let Some(value) = table.cell::<i8>(row, column, "a whole number from -127 to 127")? {
            values[*place] = value;
        }
    }
    Ok(Encoded::Count(base64_of(&values)))
}

/// Where the status says that solutions may be missing, and at how many poses.
fn unsettled(
    table: &Table<'_>,
    rows: &[csv::StringRecord],
    at: &[usize],
    poses: usize,
) -> (String, usize) {
    let Some(column) = table.column(STATUS) else { return Default::default() };
    let mut values = vec![0; poses];
    for (row, place) in rows.iter().zip(at) {
        let status = row[column].trim();
        let kind = (1..).zip(UNSETTLED).find(|(_, unsettled)| unsettled.name() == status);
        values[*place] = kind.map_or(0, |(number, _)| number);
    }
    let undecided = values.iter().filter(|value| **value != 0).count();
    (if undecided == 0 { String::new() } else { base64_of(&values) }, undecided)
}

/// Words, numbered in the order of the alphabet.
fn words(
    table: &Table<'_>,
    rows: &[csv::StringRecord],
    at: &[usize],
    poses: usize,
    column: usize,
) -> Result<Encoded, InputFileError> {
    let word = |row: &csv::StringRecord| row[column].trim().replace('_', " ");
    let mut names: BTreeMap<String, i8> = BTreeMap::new();
    for row in rows {
        let word = word(row);
        if names.len() > 100 {
            let message = "there are more than a hundred different words";
            return Err(table.refuse(line(row), &table.header[column], message));
        }
        if !word.is_empty() {
            names.insert(word, 0);
        }
    }
    for (number, place) in (0..).zip(names.values_mut()) {
        *place = number;
    }
    let mut values = vec![NONE; poses];
    for (row, place) in rows.iter().zip(at) {
        if let Some(number) = names.get(&word(row)) {
            values[*place] = *number;
        }
    }
    let names = names.into_keys().collect();
    Ok(Encoded::Name { names, bytes: base64_of(&values) })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "iz,iy,ix,x_m,y_m,z_m,more,solutions,length_1_m,length_2_m,change";

    /// Parses rows under [`HEADER`]; cables 3 to 6 are as long as cable 1.
    fn parse(rows: &[&str]) -> Result<Slices, String> {
        let others: Vec<String> = (3..=6).map(|i| format!("length_{i}_m")).collect();
        let mut lines = vec![format!("{HEADER},{}", others.join(","))];
        for row in rows {
            let first = row.split(',').nth(8).unwrap_or_default();
            lines.push(format!("{row},{}", [first; 4].join(",")));
        }
        let text = lines.join("\n") + "\n";
        Slices::parse(&text, "w.csv").map_err(|fault| fault.to_string())
    }

    fn quantity<'a>(workspace: &'a Slices, key: &str) -> &'a Encoded {
        &workspace.quantities.iter().find(|quantity| quantity.key == key).unwrap().values
    }

    #[test]
    fn columns_are_found_by_name_and_rows_in_any_order() {
        let workspace = parse(&[
            "0,0,1,1.5,2,3,foo,2,10.25,11.5,lost_to_limits",
            "0,0,0,0.5,2,3,,0,,,",
            "1,0,1,1.5,2,4,bar,1,7,-1,gained",
        ])
        .unwrap();
        assert_eq!(workspace.counts(), [2, 1, 2]);
        assert_eq!(workspace.missing(), 1); // x 0.5, z 4
        let Encoded::Number(longest) = quantity(&workspace, "longest_length") else { panic!() };
        let bytes = BASE64_STANDARD.decode(longest).unwrap();
        let longest: Vec<f32> =
            bytes.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        assert!(longest[0].is_nan() && longest[2].is_nan());
        assert_eq!([longest[1], longest[3]].map(f32::to_bits), [11.5, 7.0].map(f32::to_bits));
        let Encoded::Count(solutions) = quantity(&workspace, "solutions") else { panic!() };
        assert_eq!(BASE64_STANDARD.decode(solutions).unwrap(), [0, 2, 128, 1]);
        let Encoded::Name { names, bytes } = quantity(&workspace, "change") else { panic!() };
        assert_eq!(names, &["gained", "lost to limits"]);
        assert_eq!(BASE64_STANDARD.decode(bytes).unwrap(), [128, 1, 128, 0]);
        assert!(!workspace.quantities.iter().any(|quantity| quantity.key == "fold_margin"));
    }

    #[test]
    fn refusals_name_line_and_column() {
        let good = "0,0,0,0.5,2,3,,1,4,5,";
        for (row, expected) in [
            ("0,0,1,one,2,3,,1,4,5,", "w.csv:3: x_m: 'one' is not a number"),
            ("0,0,-1,1,2,3,,1,4,5,", "w.csv:3: ix: '-1' is not a whole number from 0"),
            ("0,,1,1,2,3,,1,4,5,", "w.csv:3: iy: is empty"),
            ("0,0,1,inf,2,3,,1,4,5,", "w.csv:3: x_m: is not finite"),
            ("0,0,1,1,2.5,3,,1,4,5,", "w.csv:3: y_m: 2.5 m, but 2 m in another row of iy 0"),
            ("0,0,1,1,2,3,,1,4,", "w.csv:3: row: 14 cells, 15 in the header"),
            ("0,0,0,0.5,2,3,,1,4,5,", "w.csv:3: ix, iy, iz: the pose of line 2 again"),
            ("0,0,1,1,2,3,,many,4,5,", "w.csv:3: solutions: 'many' is not a whole number"),
            ("0,0,1,1,2,3,,1,4,5 m,", "w.csv:3: length_2_m: '5 m' is not a number"),
            ("0,0,1,1,2,3,,1,4,,", "w.csv:3: length_2_m: has no value, but others"),
            ("0,0,1,1,2,3,,1,4,NaN,", "w.csv:3: length_2_m: has no value, but others"),
            ("0,0,2,1,2,3,,1,4,5,", "w.csv:1: ix: no row has 1, so the grid is not regular"),
            ("0,0,1,0,2,3,,1,4,5,", "w.csv:1: x_m: does not grow with its index"),
        ] {
            let message = parse(&[good, row]).unwrap_err();
            assert!(message.starts_with(expected), "{message}");
        }
        assert!(parse(&[]).unwrap_err().contains("there are no poses"));
        let no_z = Slices::parse("ix,iy,iz,x_m,y_m\n", "w.csv").unwrap_err().to_string();
        assert_eq!(no_z, "w.csv:1: z_m: there is no such column");
    }

    /// The largest of five cables is not the largest of six.
    #[test]
    fn a_missing_column_is_named() {
        let text = "ix,iy,iz,x_m,y_m,z_m,length_1_m,length_2_m,length_3_m,length_5_m,length_6_m\n";
        let message =
            Slices::parse(&format!("{text}0,0,0,1,2,3,4,4,4,4,4\n"), "w.csv").unwrap_err();
        let expected = "w.csv:1: length_4_m: there is no such column, but others";
        assert!(message.to_string().starts_with(expected), "{message}");
    }

    #[test]
    fn the_grid_is_held_against_the_order() {
        let row = |ix: usize, x: f64| format!("0,0,{ix},{x},2,3,,1,4,5,");
        let slices = parse(&[&row(0, 1.0), &row(1, 2.0), &row(2, 3.0)]).unwrap();
        let grid =
            |nx, low, high| Grid::new([nx, 1, 1], [low, 2.0, 3.0], [high, 2.0, 3.0]).unwrap();
        assert_eq!(slices.differs_from(&grid(3, 1.0, 3.0)), None);
        let said = slices.differs_from(&grid(4, 1.0, 3.0)).unwrap();
        assert_eq!(said, "[3, 1, 1] poses along x, y, z instead of [4, 1, 1]");
        let said = slices.differs_from(&grid(3, 1.0, 5.0)).unwrap();
        assert_eq!(said, "x 2 m instead of 3 m");
    }

    #[test]
    fn a_grid_that_is_too_large_is_refused() {
        // A diagonal: every index is there, most of the poses are not.
        let rows = (0..160).map(|k| format!("{k},{k},{k},{k},{k},{k},0.5\n"));
        let text =
            rows.fold("ix,iy,iz,x_m,y_m,z_m,fold_margin\n".to_owned(), |all, row| all + &row);
        let message = Slices::parse(&text, "w.csv").unwrap_err().to_string();
        assert!(message.starts_with("w.csv: 4096000 poses would make"), "{message}");
        assert!(message.contains("larger than 20 MB; it can show 3562500 of them"), "{message}");
    }
}
