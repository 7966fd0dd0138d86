//! The table of objects for the page: columns with their definitions, one array of values per column, and
//! outlines in metres.

use std::io::{self, Write};

use serde_json::json;

use crate::model::{Column, ColumnType, Value};
use crate::output::objects::{ObjectTable, places, rounded};
use crate::spill::{Spill, Spilled};

/// Number of rows whose text is in memory at a time: about 1 MB (chosen).
const ROWS_AT_ONCE: usize = 1_000;

/// The origin of the coordinates of the page, and the metres per unit of the input.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PageFrame {
    /// In metres of the world frame.
    pub(crate) origin_m: [f64; 2],
    /// For x and y.
    pub(crate) units_m: [f64; 2],
}

/// Writes the table as JSON. `shown` has the positions of the rows. In the JSON one column follows the other,
/// so the texts of the columns wait in `spill`.
pub(super) fn write_json(
    table: &ObjectTable<'_>,
    shown: &[usize],
    frame: PageFrame,
    spill: &mut Spill,
    out: &mut dyn Write,
) -> Result<(), serde_json::Error> {
    let columns: Vec<_> = table.columns.iter().map(described).collect();
    // One text for each column, and one for the outlines.
    let mut texts = vec![Vec::new(); columns.len() + 1];
    let mut spilled: Vec<Vec<Spilled>> = vec![Vec::new(); texts.len()];
    for (part, positions) in shown.chunks(ROWS_AT_ONCE).enumerate() {
        for (number, &position) in positions.iter().enumerate() {
            let separator: &[u8] = if part == 0 && number == 0 { b"" } else { b"," };
            texts.iter_mut().for_each(|text| text.extend_from_slice(separator));
            let row = (table.row)(position).map_err(serde_json::Error::io)?;
            for ((column, value), to) in table.columns.iter().zip(&row.values).zip(&mut texts) {
                write_value(column, value, to)?;
            }
            let outline: Vec<String> =
                row.outline.iter().flat_map(|&place| coordinates(place, frame)).collect();
            if let Some(outlines) = texts.last_mut() {
                let _ = write!(outlines, "[{}]", outline.join(","));
            }
        }
        for (text, spilled) in texts.iter_mut().zip(&mut spilled) {
            spilled.push(spill.push(text).map_err(serde_json::Error::io)?);
            text.clear();
        }
    }
    drop(texts);
    let head = format!(r#"{{"columns":{},"values":["#, json!(columns));
    join(&head, &spilled, spill, out).map_err(serde_json::Error::io)
}

/// Writes the texts of the columns, and the outlines, as arrays.
fn join(head: &str, texts: &[Vec<Spilled>], spill: &Spill, out: &mut dyn Write) -> io::Result<()> {
    out.write_all(head.as_bytes())?;
    for (number, pieces) in texts.iter().enumerate() {
        let is_outlines = number + 1 == texts.len();
        let before: &[u8] = match number {
            _ if is_outlines => b"],\n\"outlines\":[",
            0 => b"[",
            _ => b",\n[",
        };
        out.write_all(before)?;
        for piece in pieces {
            out.write_all(&spill.read(*piece)?)?;
        }
        out.write_all(if is_outlines { b"]}" } else { b"]" })?;
    }
    Ok(())
}

fn described(column: &Column) -> serde_json::Value {
    let kind = match column.column_type {
        ColumnType::Count => "count",
        ColumnType::Decimal { .. } => "decimal",
        ColumnType::Text => "text",
        ColumnType::Texts => "texts",
        ColumnType::Counts => "counts",
        ColumnType::Flag => "flag",
    };
    json!({
        "name": column.name,
        "type": kind,
        "unit": column.unit.label(),
        "places": places(column.column_type),
        "definition": column.plain_definition(),
    })
}

/// Writes a value with the same digits as the other formats; `null` if it is missing.
fn write_value(column: &Column, value: &Value<'_>, to: &mut Vec<u8>) -> Result<(), serde_json::Error> {
    match value {
        Value::Missing => to.extend_from_slice(b"null"),
        Value::Count(count) => to.extend_from_slice(count.to_string().as_bytes()),
        Value::Decimal(value) => {
            let places = places(column.column_type);
            let text = rounded(*value, places)
                .map_or("null".to_owned(), |value| format!("{value:.*}", places.into()));
            to.extend_from_slice(text.as_bytes());
        }
        Value::Text(text) => serde_json::to_writer(to, text)?,
        Value::Texts(texts) => serde_json::to_writer(to, texts)?,
        Value::Counts(counts) => serde_json::to_writer(to, counts)?,
        Value::Flag(flag) => serde_json::to_writer(to, flag)?,
    }
    Ok(())
}

/// A vertex of an outline in metres from the origin of the page, to the centimetre.
fn coordinates(place: [f64; 2], frame: PageFrame) -> [String; 2] {
    [0, 1].map(|axis| {
        let metres = place[axis] * frame.units_m[axis] - frame.origin_m[axis];
        rounded(metres, 2).map_or("0".to_owned(), |metres| metres.to_string())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::objects::DriveShape;
    use crate::output::objects::tests::{COLUMNS, car, stray};

    /// The table of a car and strays.
    fn json_of(shown: &[usize]) -> serde_json::Value {
        let row = |at: usize| Ok(if at == 0 { car() } else { stray() });
        let drive = DriveShape::default();
        let table = ObjectTable { columns: COLUMNS, drive: &drive, len: 3, row: &row };
        let frame = PageFrame { origin_m: [530_000.0, 3_380_000.0], units_m: [1.0, 1.0] };
        let folder = tempfile::tempdir().unwrap();
        let mut spill = Spill::create(&folder.path().join("table")).unwrap();
        let mut text = Vec::new();
        write_json(&table, shown, frame, &mut spill, &mut text).unwrap();
        serde_json::from_slice(&text).unwrap()
    }

    #[test]
    fn rows_are_columns_with_the_digits_of_the_other_formats() {
        let found = json_of(&[0, 1]);
        assert_eq!(found["values"][1], json!([530_000.123, null]));
        assert_eq!(found["values"][3], json!(["car, \"red\"", "none"]));
        assert_eq!(found["values"][4][0], json!(["a.las", "b, \"c\".laz"]));
        assert_eq!(found["columns"][2]["places"], 1);
        // The marks of code are for the documentation.
        assert_eq!(found["columns"][0]["definition"], "as x of the points");
        assert_eq!(found["outlines"][0], json!([0, 0, 4, 0, 4, 2]));
        let none = json_of(&[]);
        assert_eq!((&none["values"], &none["outlines"]), (&json!([[], [], [], [], []]), &json!([])));
    }

    #[test]
    fn more_rows_than_are_in_memory_at_a_time_are_one_table() {
        let shown: Vec<usize> = (0..2 * ROWS_AT_ONCE + 3).map(|at| at % 3).collect();
        let found = json_of(&shown);
        for (name, of_column) in [("values", 3), ("outlines", 0)] {
            let column = if name == "values" { &found[name][of_column] } else { &found[name] };
            let column = column.as_array().unwrap();
            assert_eq!(column.len(), shown.len());
            assert!(column.iter().zip(&shown).all(|(value, &at)| (*value == column[0]) == (at == 0)));
        }
    }
}
