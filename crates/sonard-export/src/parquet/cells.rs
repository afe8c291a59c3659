//! Buffered cells of a column.
//!
//! Parquet encodes nulls and lists by levels in addition to the values: the definition level states
//! how much of a cell is defined, the repetition level whether a value continues the list of the
//! previous one.

use std::collections::HashMap;

use ::parquet::{
    basic::{LogicalType, Repetition, TimeUnit, Type as Physical},
    data_type::{
        BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type,
    },
    errors::ParquetError,
    file::writer::SerializedColumnWriter,
    schema::types::{ColumnPath, Type},
};
use std::sync::Arc;

use crate::{ColumnKind, ColumnType, Value};

/// Buffered cells of one column.
#[derive(Debug)]
pub(super) struct ColumnBuffer {
    values: Values,
    /// Definition level of each cell: 1, or 0 for null; see [`LIST`] for lists.
    definitions: Vec<i16>,
}

/// Definition levels of lists: null, empty list, element.
const LIST: [i16; 3] = [0, 1, 2];

#[derive(Debug)]
enum Values {
    Text(DistinctTexts),
    Whole(Vec<i64>),
    Double(Vec<f64>),
    Single(Vec<f32>),
    Flag(Vec<bool>),
    List(Elements, Vec<i16>),
}

/// Concatenated elements of lists.
#[derive(Debug)]
enum Elements {
    Whole(Vec<i32>),
    Single(Vec<f32>),
}

/// Texts, with each distinct text stored once.
#[derive(Debug, Default)]
struct DistinctTexts {
    places: HashMap<Box<str>, u32>,
    distinct: Vec<ByteArray>,
    cells: Vec<u32>,
}

/// Returns the Parquet type of a column; every cell may be null.
pub(super) fn parquet_type(column: &ColumnType) -> Result<Type, ParquetError> {
    let (physical, logical) = match column.kind {
        ColumnKind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        ColumnKind::Integer => (Physical::INT64, None),
        ColumnKind::Number if column.is_single => (Physical::FLOAT, None),
        ColumnKind::Number => (Physical::DOUBLE, None),
        ColumnKind::Flag => (Physical::BOOLEAN, None),
        ColumnKind::Time => (Physical::INT64, Some(LogicalType::timestamp(true, TimeUnit::NANOS))),
        ColumnKind::Integers => {
            let count = Some(LogicalType::integer(32, false));
            return list_of(column.name, Physical::INT32, count);
        }
        ColumnKind::Numbers => return list_of(column.name, Physical::FLOAT, None),
    };
    Type::primitive_type_builder(column.name, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(logical)
        .build()
}

/// Returns a list type in the three levels that the format specifies.
fn list_of(
    name: &str,
    physical: Physical,
    logical: Option<LogicalType>,
) -> Result<Type, ParquetError> {
    let element = Type::primitive_type_builder("element", physical)
        .with_repetition(Repetition::REQUIRED)
        .with_logical_type(logical)
        .build()?;
    let list = Type::group_type_builder("list")
        .with_repetition(Repetition::REPEATED)
        .with_fields(vec![Arc::new(element)])
        .build()?;
    Type::group_type_builder(name)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(Some(LogicalType::List))
        .with_fields(vec![Arc::new(list)])
        .build()
}

/// Returns the path of a column's values in the schema.
pub(super) fn leaf_path(column: &ColumnType) -> ColumnPath {
    let is_list = matches!(column.kind, ColumnKind::Integers | ColumnKind::Numbers);
    let below: &[&str] = if is_list { &["list", "element"] } else { &[] };
    ColumnPath::new([column.name].iter().chain(below).map(ToString::to_string).collect())
}

impl ColumnBuffer {
    /// Creates an empty buffer.
    pub(super) fn new(column: &ColumnType) -> Self {
        let values = match column.kind {
            ColumnKind::Text => Values::Text(DistinctTexts::default()),
            ColumnKind::Integer | ColumnKind::Time => Values::Whole(Vec::new()),
            ColumnKind::Number if column.is_single => Values::Single(Vec::new()),
            ColumnKind::Number => Values::Double(Vec::new()),
            ColumnKind::Flag => Values::Flag(Vec::new()),
            ColumnKind::Integers => Values::List(Elements::Whole(Vec::new()), Vec::new()),
            ColumnKind::Numbers => Values::List(Elements::Single(Vec::new()), Vec::new()),
        };
        Self { values, definitions: Vec::new() }
    }

    /// Adds a cell and returns its size in bytes beyond that of a number.
    pub(super) fn push(&mut self, value: Option<Value<'_>>) -> usize {
        let (is_there, bytes) = match (&mut self.values, value) {
            (Values::List(elements, repetitions), value) => {
                let Some(length) = value.and_then(|list| elements.extend(&list)) else {
                    repetitions.push(0);
                    self.definitions.push(LIST[0]);
                    return 0;
                };
                repetitions.extend((0..length.max(1)).map(|place| i16::from(place > 0)));
                let level = if length == 0 { LIST[1] } else { LIST[2] };
                self.definitions.extend(std::iter::repeat_n(level, length.max(1)));
                return 8 * length;
            }
            (Values::Text(texts), Some(Value::Text(text))) => (true, texts.push(&text)),
            (Values::Whole(cells), Some(Value::Integer(number))) => {
                cells.push(number);
                (true, 0)
            }
            (Values::Whole(cells), Some(Value::Time(time))) => {
                // Times before 1678 and after 2262 do not occur.
                let time_ns = i64::try_from(time.as_nanosecond()).ok();
                cells.extend(time_ns);
                (time_ns.is_some(), 0)
            }
            (Values::Double(cells), Some(Value::Number(number))) => {
                cells.push(number);
                (true, 0)
            }
            (Values::Single(cells), Some(Value::Number(number))) => {
                cells.push(number as f32);
                (true, 0)
            }
            (Values::Flag(cells), Some(Value::Flag(flag))) => {
                cells.push(flag);
                (true, 0)
            }
            // The caller passes values of the column's kind.
            (_, None | Some(_)) => (false, 0),
        };
        self.definitions.push(is_there.into());
        bytes
    }

    /// Writes and clears the cells.
    pub(super) fn write(
        &mut self,
        column: &mut SerializedColumnWriter<'_>,
    ) -> Result<(), ParquetError> {
        let levels = &self.definitions;
        match &mut self.values {
            Values::Text(texts) => texts.write(levels, column)?,
            Values::Whole(cells) => write::<Int64Type>(cells, levels, None, column)?,
            Values::Double(cells) => write::<DoubleType>(cells, levels, None, column)?,
            Values::Single(cells) => write::<FloatType>(cells, levels, None, column)?,
            Values::Flag(cells) => write::<BoolType>(cells, levels, None, column)?,
            Values::List(elements, repetitions) => {
                match elements {
                    Elements::Whole(cells) => {
                        write::<Int32Type>(cells, levels, Some(repetitions), column)?;
                    }
                    Elements::Single(cells) => {
                        write::<FloatType>(cells, levels, Some(repetitions), column)?;
                    }
                }
                repetitions.clear();
            }
        }
        self.definitions.clear();
        Ok(())
    }
}

fn write<T: DataType>(
    cells: &mut Vec<T::T>,
    definitions: &[i16],
    repetitions: Option<&[i16]>,
    column: &mut SerializedColumnWriter<'_>,
) -> Result<(), ParquetError> {
    column.typed::<T>().write_batch(cells, Some(definitions), repetitions)?;
    cells.clear();
    Ok(())
}

impl Elements {
    /// Adds the elements of a list and returns their number; `None` for a value of another kind.
    fn extend(&mut self, list: &Value<'_>) -> Option<usize> {
        match (self, list) {
            (Self::Whole(cells), Value::Integers(list)) => {
                // Unsigned by the logical type, with equal bits.
                cells.extend(list.iter().map(|number| number.cast_signed()));
                Some(list.len())
            }
            (Self::Single(cells), Value::Numbers(list)) => {
                cells.extend_from_slice(list);
                Some(list.len())
            }
            _ => None,
        }
    }
}

impl DistinctTexts {
    fn push(&mut self, text: &str) -> usize {
        if let Some(place) = self.places.get(text) {
            self.cells.push(*place);
            return 0;
        }
        let place = self.distinct.len() as u32;
        self.places.insert(text.into(), place);
        self.distinct.push(text.as_bytes().to_vec().into());
        self.cells.push(place);
        2 * text.len()
    }

    /// Writes the texts in pieces, because each cell temporarily takes the memory of a long text.
    fn write(
        &mut self,
        definitions: &[i16],
        column: &mut SerializedColumnWriter<'_>,
    ) -> Result<(), ParquetError> {
        const PIECE: usize = 4096;
        let mut cells = self.cells.iter();
        for levels in definitions.chunks(PIECE) {
            let there = levels.iter().filter(|level| **level > 0).count();
            let texts = cells.by_ref().take(there);
            let texts: Vec<_> = texts.map(|place| self.distinct[*place as usize].clone()).collect();
            column.typed::<ByteArrayType>().write_batch(&texts, Some(levels), None)?;
        }
        *self = Self::default();
        Ok(())
    }
}
