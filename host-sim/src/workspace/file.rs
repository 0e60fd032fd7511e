//! A map as a table, a row for each pose: as CSV and as Parquet, with the same columns.

use std::io;
use std::sync::Arc;

use cdpr_core::CABLES;
use parquet::basic::{Compression, ConvertedType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::{Best, Change, Findings, Order};

/// Rows of a row group: what a reader has to hold at once.
const GROUP_ROWS: usize = 1 << 17;

/// A pose and what is known of it.
struct Pose<'a> {
    indices: [usize; 3],
    position_m: [f64; 3],
    findings: &'a Findings,
}

/// Reads one value of a row; `None`: there is none.
type Read<V> = Box<dyn Fn(&Pose<'_>) -> Option<V>>;

/// A column. Its unit is the end of its name.
struct Column {
    name: String,
    values: Values,
}

enum Values {
    Whole(Read<i32>),
    Real(Read<f64>),
    Word(Read<&'static str>),
}

fn whole(name: &str, read: impl Fn(&Pose<'_>) -> i32 + 'static) -> Column {
    let values = Values::Whole(Box::new(move |pose| Some(read(pose))));
    Column { name: name.to_owned(), values }
}

fn real(name: &str, read: impl Fn(&Pose<'_>) -> f64 + 'static) -> Column {
    let values = Values::Real(Box::new(move |pose| Some(read(pose))));
    Column { name: name.to_owned(), values }
}

fn word(name: &str, read: impl Fn(&Pose<'_>) -> Option<&'static str> + 'static) -> Column {
    Column { name: name.to_owned(), values: Values::Word(Box::new(read)) }
}

/// Of the best solution.
fn best(name: String, read: impl Fn(&Best) -> Option<f64> + 'static) -> Column {
    let values = Values::Real(Box::new(move |pose| pose.findings.best.as_deref().and_then(&read)));
    Column { name, values }
}

/// Six numbers of the best solution.
type OfCables = fn(&Best) -> &[f64; CABLES];

/// Names of the columns with a number for each cable.
pub(crate) fn of_cables(name: &str, unit: &str) -> [String; CABLES] {
    std::array::from_fn(|cable| format!("{name}_{}_{unit}", cable + 1))
}

/// Every column, in its order.
fn columns() -> Vec<Column> {
    let mut columns = Vec::new();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        // A grid has fewer poses than fit.
        let index = move |pose: &Pose<'_>| i32::try_from(pose.indices[axis]).unwrap_or(i32::MAX);
        columns.push(whole(&format!("i{name}"), index));
    }
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        columns.push(real(&format!("{name}_m"), move |pose| pose.position_m[axis]));
    }
    columns.extend([
        whole("rigid_solutions", |pose| pose.findings.rigid.into()),
        whole("rigid_degree", |pose| pose.findings.rigid_degree.into()),
        whole("rigid_undecided_sets", |pose| pose.findings.rigid_undecided.into()),
        word("status", |pose| Some(pose.findings.status.name())),
        whole("solutions", |pose| pose.findings.solutions.into()),
        whole("degree", |pose| pose.findings.degree.into()),
        word("change", |pose| pose.findings.change.map(Change::name)),
        best("fold_margin".to_owned(), |best| Some(best.fold_margin)),
        best("length_margin_m".to_owned(), |best| best.length_margin_m),
        best("tension_margin_n".to_owned(), |best| best.tension_margin_n),
    ]);
    let values: [(&str, &str, OfCables); 3] = [
        ("length", "m", |best| &best.lengths_m),
        ("anchor_tension", "n", |best| &best.anchor_tensions_n),
        ("attachment_tension", "n", |best| &best.attachment_tensions_n),
    ];
    for (name, unit, read) in values {
        for (cable, name) in of_cables(name, unit).into_iter().enumerate() {
            columns.push(best(name, move |best| Some(read(best)[cable])));
        }
    }
    columns
}

impl Column {
    fn schema(&self) -> Result<Arc<Type>, ParquetError> {
        let (physical, converted) = match self.values {
            Values::Whole(_) => (Physical::INT32, ConvertedType::NONE),
            Values::Real(_) => (Physical::DOUBLE, ConvertedType::NONE),
            Values::Word(_) => (Physical::BYTE_ARRAY, ConvertedType::UTF8),
        };
        let column = Type::primitive_type_builder(&self.name, physical)
            .with_converted_type(converted)
            .with_repetition(Repetition::OPTIONAL);
        Ok(Arc::new(column.build()?))
    }
}

impl Order {
    /// Every pose with what is known of it.
    fn rows<'a>(&self, findings: &'a [Findings]) -> impl Iterator<Item = Pose<'a>> {
        findings.iter().enumerate().map(|(number, findings)| Pose {
            indices: self.grid.indices(number),
            position_m: self.grid.position_m(number),
            findings,
        })
    }
}

/// The map as CSV: a line of names, then a line for each pose; numbers with as many digits as bring them back to
/// the bit. `findings` are those of all poses of the order's grid, in its order.
///
/// # Errors
/// That of `out`.
pub fn csv(order: &Order, findings: &[Findings], out: impl io::Write) -> io::Result<()> {
    let columns = columns();
    let mut writer = ::csv::Writer::from_writer(out);
    writer.write_record(columns.iter().map(|column| column.name.as_str()))?;
    for pose in order.rows(findings) {
        for column in &columns {
            let field = match &column.values {
                Values::Whole(read) => read(&pose).map(|value| value.to_string()),
                Values::Real(read) => read(&pose).map(|value| format!("{value:?}")),
                Values::Word(read) => read(&pose).map(str::to_owned),
            };
            writer.write_field(field.unwrap_or_default())?;
        }
        writer.write_record(None::<&[u8]>)?;
    }
    writer.flush()
}

/// The same as Parquet (Snappy), with the order as JSON under the key `cdpr.order` of its metadata.
///
/// # Errors
/// That of `out`.
pub fn parquet(
    order: &Order,
    findings: &[Findings],
    out: impl io::Write + Send,
) -> Result<(), ParquetError> {
    let columns = columns();
    let fields = columns.iter().map(Column::schema).collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder("workspace").with_fields(fields).build()?;
    let order_json = serde_json::to_string(order).map_err(|e| ParquetError::External(e.into()))?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(Some(vec![KeyValue::new("cdpr.order".to_owned(), order_json)]))
        .build();
    let mut file = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties))?;
    let mut all = order.rows(findings);
    loop {
        let rows: Vec<Pose<'_>> = all.by_ref().take(GROUP_ROWS).collect();
        if rows.is_empty() {
            break;
        }
        let mut group = file.next_row_group()?;
        for column in &columns {
            let Some(mut writer) = group.next_column()? else { break };
            match &column.values {
                Values::Whole(read) => {
                    let (values, present) = present(&rows, read);
                    writer.typed::<Int32Type>().write_batch(&values, Some(&present), None)?;
                }
                Values::Real(read) => {
                    let (values, present) = present(&rows, read);
                    writer.typed::<DoubleType>().write_batch(&values, Some(&present), None)?;
                }
                Values::Word(read) => {
                    let (values, present) = present(&rows, |pose| read(pose).map(ByteArray::from));
                    writer.typed::<ByteArrayType>().write_batch(&values, Some(&present), None)?;
                }
            }
            writer.close()?;
        }
        group.close()?;
    }
    file.close()?;
    Ok(())
}

/// The values that there are, and for each row 1 where there is one and 0 where not.
fn present<V>(rows: &[Pose<'_>], read: impl Fn(&Pose<'_>) -> Option<V>) -> (Vec<V>, Vec<i16>) {
    let read: Vec<Option<V>> = rows.iter().map(read).collect();
    let present = read.iter().map(|value| i16::from(value.is_some())).collect();
    (read.into_iter().flatten().collect(), present)
}
